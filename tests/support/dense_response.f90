!> A body that consists of its contact nodes only, in one direction: its response is a dense compliance.
module dense_response
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_response, only: forward_response_t, response_t
  implicit none
  private

  !> Response by a dense compliance.
  type, extends(response_t), public :: dense_response_t
    !> (n, n) [length/force].
    real(dp), allocatable :: compliance(:, :)
  contains
    procedure :: apply => dense_apply
    procedure :: prepare_forward_substitution => dense_prepare_forward_substitution
    procedure :: path_entries => dense_path_entries
    procedure :: forward_substitution => dense_forward_substitution
    procedure :: forward_product => dense_forward_product
    procedure :: solve => dense_solve
    procedure :: destroy => dense_destroy
  end type dense_response_t

contains

  !> u = C f.
  subroutine dense_apply(self, force, displacement)
    class(dense_response_t), intent(inout) :: self
    real(dp), intent(in) :: force(:, :)
    real(dp), intent(out) :: displacement(:, :)
    integer :: i
    do i = 1, size(force, 2)
      displacement(1, i) = dot_product(self%compliance(:, i), force(1, :))
    end do
  end subroutine dense_apply

  !> Nothing to prepare.
  subroutine dense_prepare_forward_substitution(self)
    class(dense_response_t), intent(inout) :: self
    self%n_contact_nodes = size(self%compliance, 1)
  end subroutine dense_prepare_forward_substitution

  !> Nearly nothing, beside the cost of a solve that the tests set.
  real(dp) function dense_path_entries(self) result(entries)
    class(dense_response_t), intent(inout) :: self
    entries = size(self%compliance, 1)
  end function dense_path_entries

  !> Instead of solutions of L y = P b: b in `along`, b C in `answer`.
  subroutine dense_forward_substitution(self, matrix, row, forward)
    class(dense_response_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: matrix
    integer, intent(in) :: row(:)
    type(forward_response_t), intent(inout) :: forward
    integer :: j, k
    forward%forward%n = size(row)
    allocate (forward%along(size(row), size(self%compliance, 1)), source=0.0_dp)
    do j = 1, size(row)
      do k = matrix%row_start(row(j)), matrix%row_start(row(j) + 1) - 1
        forward%along(j, matrix%column(k)) = forward%along(j, matrix%column(k)) + matrix%value(k)
      end do
    end do
    forward%answer = matmul(forward%along, self%compliance)
  end subroutine dense_forward_substitution

  !> b C b'.
  subroutine dense_forward_product(self, a, b, same, c)
    class(dense_response_t), intent(in) :: self
    type(forward_response_t), intent(in) :: a, b
    logical, intent(in) :: same
    real(dp), intent(out) :: c(:, :)
    c = matmul(a%answer, transpose(b%along))
    associate (not_needed => self%n_motions, nor_this => same)
    end associate
  end subroutine dense_forward_product

  !> x <- C x.
  subroutine dense_solve(self, x)
    class(dense_response_t), intent(inout) :: self
    real(dp), intent(inout) :: x(:)
    real(dp) :: b(size(x))
    integer :: i
    b = x
    do i = 1, size(x)
      x(i) = dot_product(self%compliance(:, i), b)
    end do
  end subroutine dense_solve

  !> Give back all memory.
  subroutine dense_destroy(self)
    class(dense_response_t), intent(inout) :: self
    if (allocated(self%compliance)) deallocate (self%compliance)
  end subroutine dense_destroy
end module dense_response
