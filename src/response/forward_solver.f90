!> Forward substitutions with the factor of a body's stiffness, free motions included: K^+ between rows of B.
!>
!> With free motions R, K_s the stiffness with springs and Z = K_s^{-1} R, `K^+ = K_s^{-1} - Z R^T - R Z^T + R (R^T Z) R^T`, see
!> dotyk_response_condensed: rows need their products with R and Z beside the solutions of L y = P b.
module dotyk_response_forward_solver
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: transposed_product
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_forward_substitution, only: elimination_tree_t, forward_product
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_response, only: forward_response_t
  implicit none
  private

  !> What forward substitutions need beside the factor.
  type, public :: forward_solver_t
    type(elimination_tree_t), allocatable, private :: tree
    !> Z (n_equations, n_motions) and R^T Z (n_motions, n_motions).
    real(dp), allocatable, private :: answer(:, :), rigid_answer(:, :)
  contains
    procedure :: init => forward_solver_init
    procedure :: path_entries => forward_solver_path_entries
    procedure :: solve => forward_solver_solve
    procedure :: product => forward_solver_product
    procedure :: destroy => forward_solver_destroy
  end type forward_solver_t

contains

  !> Get ready; again where it is already.
  subroutine forward_solver_init(self, factor, rigid)
    class(forward_solver_t), intent(inout) :: self
    !> Factorized.
    type(cholesky_t), intent(in) :: factor
    !> Free motions (n_equations, n_motions).
    real(dp), intent(in) :: rigid(:, :)
    if (allocated(self%answer)) return
    call find_tree(self, factor)
    ! The tree may be from before the factorization.
    call factor%supernodes(self%tree%list)
    allocate (self%answer, source=rigid)
    call factor%solve_block(self%answer)
    allocate (self%rigid_answer(size(rigid, 2), size(rigid, 2)))
    call transposed_product(rigid, self%answer, self%rigid_answer)
  end subroutine forward_solver_init

  !> The elimination tree.
  subroutine find_tree(self, factor)
    type(forward_solver_t), intent(inout) :: self
    type(cholesky_t), intent(in) :: factor
    if (allocated(self%tree)) return
    allocate (self%tree)
    call self%tree%init(factor)
  end subroutine find_tree

  !> Entries of the factor from an equation to the root, in the mean over some equations.
  real(dp) function forward_solver_path_entries(self, factor, equation) result(entries)
    class(forward_solver_t), intent(inout) :: self
    !> Analyzed.
    type(cholesky_t), intent(in) :: factor
    integer, intent(in) :: equation(:)
    call find_tree(self, factor)
    entries = self%tree%path_entries(equation)
  end function forward_solver_path_entries

  !> Forward substitutions.
  subroutine forward_solver_solve(self, rows, rigid, forward)
    class(forward_solver_t), intent(in) :: self
    !> Rows over the equations.
    type(sparse_rows_t), intent(in) :: rows
    !> As in `init`.
    real(dp), intent(in) :: rigid(:, :)
    type(forward_response_t), intent(inout) :: forward
    integer :: k
    call forward%forward%init(self%tree, rows)
    allocate (forward%along(rows%n_rows, size(rigid, 2)), forward%answer(rows%n_rows, size(rigid, 2)))
    do k = 1, size(rigid, 2)
      call rows%multiply(rigid(:, k), forward%along(:, k))
      call rows%multiply(self%answer(:, k), forward%answer(:, k))
    end do
  end subroutine forward_solver_solve

  !> b K^+ b'.
  subroutine forward_solver_product(self, a, b, same, c)
    class(forward_solver_t), intent(in) :: self
    type(forward_response_t), intent(in) :: a, b
    !> Whether a and b are one and the same.
    logical, intent(in) :: same
    real(dp), intent(out) :: c(:, :)
    call forward_product(self%tree, a%forward, b%forward, same, c)
    if (size(a%along, 2) == 0) return
    c = c - matmul(a%answer, transpose(b%along)) - matmul(a%along, transpose(b%answer)) + &
      matmul(matmul(a%along, self%rigid_answer), transpose(b%along))
  end subroutine forward_solver_product

  !> Give back all memory.
  subroutine forward_solver_destroy(self)
    class(forward_solver_t), intent(inout) :: self
    if (allocated(self%tree)) deallocate (self%tree)
    if (allocated(self%answer)) deallocate (self%answer, self%rigid_answer)
  end subroutine forward_solver_destroy
end module dotyk_response_forward_solver
