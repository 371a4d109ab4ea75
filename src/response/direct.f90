!> The compliance operator of a body through a sparse Cholesky factor of its stiffness.
!>
!> Built in two steps, because a driver runs them for many bodies with different shares of the machine: `analyze`
!> (fill-reducing order and symbolic factorization; fill and operations are known then) and `factorize`.
!>
!> A body with rigid body modes R is factorized with springs on a few unknowns (`dotyk_linalg_springs`), K_s;
!> then `K^+ = P K_s^{-1} P`, `P = I - R R^T`.
!>
!> With modes R, K_s the regularized stiffness and `Z = K_s^{-1} R`, `K^+ = K_s^{-1} - Z R^T - R Z^T + R (R^T Z) R^T`:
!> rows of B need their products with R and Z beside L^{-1} B^T.
module dotyk_response_direct
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_node_graph, only: fill_reducing_order
  use dotyk_linalg_blas, only: transposed_product
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_forward_substitution, only: elimination_tree_t, forward_product
  use dotyk_linalg_ordering, only: expand_permutation
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_linalg_springs, only: choose_fixing_equations
  use dotyk_response_response, only: response_t, substituted_rows_t
  use dotyk_response_stiffness_factor, only: factorization_report_t, factorize_stiffness
  implicit none
  private
  public :: remove_modes

  !> Compliance operator by triangular solves. It owns a factor: never copy it, destroy it in the end.
  type, extends(response_t), public :: direct_response_t
    type(cholesky_t) :: factor  !! Factor of the (regularized) stiffness.
    !> Equations that springs regularize, one for each rigid body mode; chosen by `analyze` (n_modes).
    integer, allocatable :: fixing_equation(:)
    !> What forward substitutions need beside the factor: its elimination tree, not allocated before it is needed; Z
    !> (n_equations, n_modes) and R^T Z (n_modes, n_modes) [length/force].
    type(elimination_tree_t), allocatable, private :: tree
    real(dp), allocatable, private :: regularized(:, :), product_of_modes(:, :)
  contains
    procedure :: analyze => direct_analyze
    procedure :: factorize => direct_factorize
    procedure :: solve => direct_solve
    procedure :: solve_block => direct_solve_block
    procedure :: prepare_substitution => direct_prepare_substitution
    procedure :: path_entries => direct_path_entries
    procedure :: substitute => direct_substitute
    procedure :: product => direct_product
    procedure :: destroy => direct_destroy
  end type direct_response_t

contains

  !> Order the equations and analyse the factorization.
  subroutine direct_analyze(self, body, modes, stiffness, error)
    class(direct_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that its supports leave.
    type(stiffness_t), intent(in) :: stiffness  !! Its stiffness, with the graph of its nodes.
    !> Allocated where METIS or CHOLMOD has no memory, METIS refuses the graph, or the factor exceeds 64-bit integers.
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: node_order(:), permutation(:)
    integer :: k, n
    n = modes%n
    ! A rigid body has no equations.
    if (body%constraint%n_equations == 0) n = 0
    allocate (self%mode(body%constraint%n_equations, n))
    do k = 1, n
      call body%constraint%reduce(modes%shape(:, :, k), self%mode(:, k))
    end do
    call choose_fixing_equations(self%mode, self%fixing_equation)
    ! Nodes are ordered, not equations: the graph is smaller, and the equations of a node stay together.
    allocate (node_order(size(stiffness%graph_start) - 1))
    call fill_reducing_order(body%mesh, stiffness%graph_start, stiffness%graph_neighbour, node_order, error)
    if (allocated(error)) return
    allocate (permutation(body%constraint%n_equations))
    call expand_permutation(node_order, body%constraint%equation, permutation)
    call self%factor%analyze(stiffness%matrix, permutation, error)
  end subroutine direct_analyze

  !> Factorize. The memory of the stiffness is given back before that of the factor is taken.
  subroutine direct_factorize(self, body, stiffness, split_near_null, report, error)
    class(direct_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The same body as in `analyze`.
    type(stiffness_t), intent(inout) :: stiffness  !! Its stiffness; empty on return.
    !> Whether near-null-space modes are split off the operator: it is that of the body regularized against them then.
    logical, intent(in) :: split_near_null
    type(factorization_report_t), intent(out) :: report  !! Condition, near-null-space modes.
    !> As in `factorize_stiffness`: the stiffness is not positive definite (names a node), memory runs out, and
    !> rarer ones.
    type(error_t), allocatable, intent(out) :: error
    call factorize_stiffness(body, stiffness, self%factor, self%fixing_equation, split_near_null, report, error)
  end subroutine direct_factorize

  !> x := K^+ x.
  subroutine direct_solve(self, x)
    class(direct_response_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    call remove_modes(self%mode, x)
    call self%factor%solve(x)
    call remove_modes(self%mode, x)
  end subroutine direct_solve

  !> X := K^+ X, with dense products of blocks.
  subroutine direct_solve_block(self, x)
    class(direct_response_t), intent(in) :: self
    !> Right-hand sides [force] in, solutions [length] out (n_equations, n).
    real(dp), intent(inout), contiguous :: x(:, :)
    integer :: j
    do j = 1, size(x, 2)
      call remove_modes(self%mode, x(:, j))
    end do
    call self%factor%solve_block(x)
    do j = 1, size(x, 2)
      call remove_modes(self%mode, x(:, j))
    end do
  end subroutine direct_solve_block

  !> Make ready for forward substitutions; nothing is done where it is ready already.
  subroutine direct_prepare_substitution(self)
    class(direct_response_t), intent(inout) :: self
    if (allocated(self%regularized)) return
    call find_tree(self)
    ! The tree may be from before the factorization.
    call self%factor%supernodes(self%tree%list)
    allocate (self%regularized, source=self%mode)
    call self%factor%solve_block(self%regularized)
    allocate (self%product_of_modes(size(self%mode, 2), size(self%mode, 2)))
    call transposed_product(self%mode, self%regularized, self%product_of_modes)
  end subroutine direct_prepare_substitution

  !> The elimination tree.
  subroutine find_tree(self)
    class(direct_response_t), intent(inout) :: self  !! Analysed; gets the elimination tree, unless it has it.
    if (allocated(self%tree)) return
    allocate (self%tree)
    call self%tree%init(self%factor)
  end subroutine find_tree

  !> Entries of the factor on the elimination-tree paths from some equations to the root, on average.
  real(dp) function direct_path_entries(self, equation) result(entries)
    class(direct_response_t), intent(inout) :: self
    integer, intent(in) :: equation(:)  !! Where the paths begin (n).
    call find_tree(self)
    entries = self%tree%path_entries(equation)
  end function direct_path_entries

  !> Forward substitution of rows.
  subroutine direct_substitute(self, rows, substituted)
    class(direct_response_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows  !! Rows over the equations.
    type(substituted_rows_t), intent(inout) :: substituted  !! L^{-1} of them, and their products with R and Z.
    integer :: k
    call substituted%forward%init(self%tree, rows)
    associate (n => size(self%mode, 2))
      allocate (substituted%along(rows%n_rows, n), substituted%regularized(rows%n_rows, n))
      do k = 1, n
        call rows%multiply(self%mode(:, k), substituted%along(:, k))
        call rows%multiply(self%regularized(:, k), substituted%regularized(:, k))
      end do
    end associate
  end subroutine direct_substitute

  !> c_ij = a_i K^+ b_j.
  subroutine direct_product(self, a, b, same, c)
    class(direct_response_t), intent(in) :: self
    type(substituted_rows_t), intent(in) :: a, b  !! Rows of the two sides.
    logical, intent(in) :: same  !! Whether a and b are the same rows.
    real(dp), intent(out) :: c(:, :)  !! Entries between the rows (a%forward%n, b%forward%n) [length/force].
    call forward_product(self%tree, a%forward, b%forward, same, c)
    if (size(a%along, 2) == 0) return
    c = c - matmul(a%regularized, transpose(b%along)) - matmul(a%along, transpose(b%regularized)) + &
      matmul(matmul(a%along, self%product_of_modes), transpose(b%along))
  end subroutine direct_product

  !> Give back all memory.
  subroutine direct_destroy(self)
    class(direct_response_t), intent(inout) :: self
    call self%factor%destroy()
    if (allocated(self%tree)) deallocate (self%tree)
    if (allocated(self%regularized)) deallocate (self%regularized, self%product_of_modes)
    if (allocated(self%mode)) deallocate (self%mode)
    if (allocated(self%fixing_equation)) deallocate (self%fixing_equation)
  end subroutine direct_destroy

  !> x := P x.
  pure subroutine remove_modes(mode, x)
    real(dp), intent(in) :: mode(:, :)  !! Orthonormal modes over the equations (n_equations, n_modes) [].
    real(dp), intent(inout) :: x(:)  !! A force or a displacement (n_equations) [force or length].
    real(dp) :: amplitude(size(mode, 2))
    integer :: k
    do k = 1, size(mode, 2)
      amplitude(k) = dot_product(mode(:, k), x)
    end do
    do k = 1, size(mode, 2)
      x = x - amplitude(k)*mode(:, k)
    end do
  end subroutine remove_modes
end module dotyk_response_direct
