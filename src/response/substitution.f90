!> Compliance entries by forward substitution with sparse right-hand sides, rigid body modes included.
!>
!> With modes R, K_s the regularized stiffness and `Z = K_s^{-1} R`, `K^+ = K_s^{-1} - Z R^T - R Z^T + R (R^T Z) R^T`:
!> rows of B need their products with R and Z beside L^{-1} B^T.
module dotyk_response_substitution
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: transposed_product
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_forward_substitution, only: elimination_tree_t, forward_product
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_response, only: substituted_rows_t
  implicit none
  private

  type, public :: substitution_t  !! What forward substitutions need beside the factor.
    !> Elimination tree of the factor; not allocated before it is needed.
    type(elimination_tree_t), allocatable, private :: tree
    !> Z (n_equations, n_modes) and R^T Z (n_modes, n_modes) [length/force].
    real(dp), allocatable, private :: regularized(:, :), product_of_modes(:, :)
  contains
    procedure :: init => substitution_init
    procedure :: path_entries => substitution_path_entries
    procedure :: substitute => substitution_substitute
    procedure :: product => substitution_product
    procedure :: destroy => substitution_destroy
  end type substitution_t

contains

  !> Make ready; nothing is done where it is ready already.
  subroutine substitution_init(self, factor, mode)
    class(substitution_t), intent(inout) :: self
    type(cholesky_t), intent(in) :: factor  !! Factorized.
    real(dp), intent(in) :: mode(:, :)  !! Rigid body modes (n_equations, n_modes) [].
    if (allocated(self%regularized)) return
    call find_tree(self, factor)
    ! The tree may be from before the factorization.
    call factor%supernodes(self%tree%list)
    allocate (self%regularized, source=mode)
    call factor%solve_block(self%regularized)
    allocate (self%product_of_modes(size(mode, 2), size(mode, 2)))
    call transposed_product(mode, self%regularized, self%product_of_modes)
  end subroutine substitution_init

  !> The elimination tree.
  subroutine find_tree(self, factor)
    type(substitution_t), intent(inout) :: self  !! Gets the elimination tree, unless it has it.
    type(cholesky_t), intent(in) :: factor  !! Analysed.
    if (allocated(self%tree)) return
    allocate (self%tree)
    call self%tree%init(factor)
  end subroutine find_tree

  !> Entries of the factor from an equation to the root of the elimination tree, on average over some equations.
  real(dp) function substitution_path_entries(self, factor, equation) result(entries)
    class(substitution_t), intent(inout) :: self
    type(cholesky_t), intent(in) :: factor  !! Analysed.
    integer, intent(in) :: equation(:)  !! Where the paths begin (n).
    call find_tree(self, factor)
    entries = self%tree%path_entries(equation)
  end function substitution_path_entries

  !> Forward substitution of rows.
  subroutine substitution_substitute(self, rows, mode, substituted)
    class(substitution_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows  !! Rows over the equations.
    real(dp), intent(in) :: mode(:, :)  !! As in `init` (n_equations, n_modes) [].
    type(substituted_rows_t), intent(inout) :: substituted  !! L^{-1} of them, and their products with R and Z.
    integer :: k
    call substituted%forward%init(self%tree, rows)
    allocate (substituted%along(rows%n_rows, size(mode, 2)), substituted%regularized(rows%n_rows, size(mode, 2)))
    do k = 1, size(mode, 2)
      call rows%multiply(mode(:, k), substituted%along(:, k))
      call rows%multiply(self%regularized(:, k), substituted%regularized(:, k))
    end do
  end subroutine substitution_substitute

  !> c_ij = a_i K^+ b_j.
  subroutine substitution_product(self, a, b, same, c)
    class(substitution_t), intent(in) :: self
    type(substituted_rows_t), intent(in) :: a, b  !! Rows of the two sides.
    logical, intent(in) :: same  !! Whether a and b are the same rows.
    real(dp), intent(out) :: c(:, :)  !! Entries between the rows (a%forward%n, b%forward%n) [length/force].
    call forward_product(self%tree, a%forward, b%forward, same, c)
    if (size(a%along, 2) == 0) return
    c = c - matmul(a%regularized, transpose(b%along)) - matmul(a%along, transpose(b%regularized)) + &
      matmul(matmul(a%along, self%product_of_modes), transpose(b%along))
  end subroutine substitution_product

  !> Give back all memory.
  subroutine substitution_destroy(self)
    class(substitution_t), intent(inout) :: self
    if (allocated(self%tree)) deallocate (self%tree)
    if (allocated(self%regularized)) deallocate (self%regularized, self%product_of_modes)
  end subroutine substitution_destroy
end module dotyk_response_substitution
