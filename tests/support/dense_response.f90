!> Bodies that consist of their contact nodes only, in one direction: their compliance operators are dense matrices.
module dense_response
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_response, only: response_t, substituted_rows_t
  implicit none
  private

  type, extends(response_t), public :: dense_response_t  !! Compliance operator by a dense matrix.
    real(dp), allocatable :: compliance(:, :)  !! (n, n) [length/force].
  contains
    procedure :: solve => dense_solve
    procedure :: prepare_substitution => dense_prepare_substitution
    procedure :: path_entries => dense_path_entries
    procedure :: substitute => dense_substitute
    procedure :: product => dense_product
    procedure :: destroy => dense_destroy
  end type dense_response_t

contains

  !> x <- C x.
  subroutine dense_solve(self, x)
    class(dense_response_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)
    real(dp) :: b(size(x))
    integer :: i
    b = x
    do i = 1, size(x)
      x(i) = dot_product(self%compliance(:, i), b)
    end do
  end subroutine dense_solve

  !> Nothing to prepare.
  subroutine dense_prepare_substitution(self)
    class(dense_response_t), intent(inout) :: self
    associate (not_needed => self%compliance)
    end associate
  end subroutine dense_prepare_substitution

  !> Nearly nothing, beside the cost of a solve that the tests set.
  real(dp) function dense_path_entries(self, equation) result(entries)
    class(dense_response_t), intent(inout) :: self
    integer, intent(in) :: equation(:)
    entries = size(self%compliance, 1)
    associate (not_needed => equation)
    end associate
  end function dense_path_entries

  !> Instead of L^{-1} b: b in `along`, b C in `regularized`.
  subroutine dense_substitute(self, rows, substituted)
    class(dense_response_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows
    type(substituted_rows_t), intent(inout) :: substituted
    integer :: j, k
    substituted%forward%n = rows%n_rows
    allocate (substituted%along(rows%n_rows, size(self%compliance, 1)), source=0.0_dp)
    do j = 1, rows%n_rows
      do k = rows%row_start(j), rows%row_start(j + 1) - 1
        substituted%along(j, rows%column(k)) = substituted%along(j, rows%column(k)) + rows%value(k)
      end do
    end do
    substituted%regularized = matmul(substituted%along, self%compliance)
  end subroutine dense_substitute

  !> b C b'.
  subroutine dense_product(self, a, b, same, c)
    class(dense_response_t), intent(in) :: self
    type(substituted_rows_t), intent(in) :: a, b
    logical, intent(in) :: same
    real(dp), intent(out) :: c(:, :)
    c = matmul(a%regularized, transpose(b%along))
    associate (not_needed => self%compliance, nor_this => same)
    end associate
  end subroutine dense_product

  !> Give back all memory.
  subroutine dense_destroy(self)
    class(dense_response_t), intent(inout) :: self
    if (allocated(self%compliance)) deallocate (self%compliance)
  end subroutine dense_destroy
end module dense_response
