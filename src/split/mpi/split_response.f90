!> The compliance operator of a body that all ranks compute together. Every solve is made by all of them at the same
!> time, one after the other.
module dotyk_split_split_response
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_ranks_exchange, only: add_up
  use dotyk_response_multigrid_response, only: near
  use dotyk_response_response, only: equation_vector_t, response_t, substituted_rows_t
  use dotyk_split_split_bodies, only: split_bodies_t
  implicit none
  private

  type, extends(response_t), public :: split_response_t  !! The operator.
    type(split_bodies_t), pointer :: bodies => null()  !! All bodies.
    integer :: b = 0  !! This one.
  contains
    procedure :: solve => response_solve
    procedure :: solve_from => response_solve_from
    procedure :: subtract_forces => response_subtract_forces
    procedure :: solves_together => response_solves_together
    procedure :: solve_together => response_solve_together
    procedure :: solve_error => response_solve_error
    procedure :: prepare_substitution => response_prepare_substitution
    procedure :: path_entries => response_path_entries
    procedure :: substitute => response_substitute
    procedure :: product => response_product
    procedure :: destroy => response_destroy
  end type split_response_t

contains

  !> x := K^+ x.
  subroutine response_solve(self, x)
    class(split_response_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)
    call self%bodies%solve(self%b, x)
  end subroutine response_solve

  !> x := K^+ x from an approximate solution, which is kept where it leaves a small part of the forces only: that of the
  !> scheme, whose bound knows what it leaves.
  subroutine response_solve_from(self, start, x)
    class(split_response_t), intent(in) :: self
    real(dp), intent(in) :: start(:)
    real(dp), intent(inout) :: x(:)
    real(dp), allocatable :: left(:)
    real(dp) :: norms(2)
    left = x
    call self%bodies%subtract_forces(self%b, start, left)
    associate (own => self%bodies%map(self%b)%equation)
      norms = [sum(left(own)**2), sum(x(own)**2)]
    end associate
    call add_up(norms)
    if (norms(1) <= near**2*norms(2)) then
      x = start
    else
      call self%solve(x)
    end if
  end subroutine response_solve_from

  !> What a solve leaves.
  subroutine response_subtract_forces(self, x, f)
    class(split_response_t), intent(in) :: self
    real(dp), intent(in) :: x(:)
    real(dp), intent(inout) :: f(:)
    call self%bodies%subtract_forces(self%b, x, f)
  end subroutine response_subtract_forces

  !> They are.
  pure logical function response_solves_together(self) result(together)
    class(split_response_t), intent(in) :: self
    together = associated(self%bodies)
  end function response_solves_together

  !> x := K^+ x of all bodies.
  subroutine response_solve_together(self, x)
    class(split_response_t), intent(in) :: self
    type(equation_vector_t), intent(inout) :: x(:)
    call self%bodies%solve_all(x)
  end subroutine response_solve_together

  !> Relative error of a solve in the energy norm.
  pure real(dp) function response_solve_error(self) result(error)
    class(split_response_t), intent(in) :: self
    error = self%bodies%solve_error()
  end function response_solve_error

  !> Nothing.
  subroutine response_prepare_substitution(self)
    class(split_response_t), intent(inout) :: self
    associate (not_needed => self%b)
    end associate
  end subroutine response_prepare_substitution

  !> A solve for each row is no choice.
  real(dp) function response_path_entries(self, equation) result(entries)
    class(split_response_t), intent(inout) :: self
    integer, intent(in) :: equation(:)
    entries = huge(1)
    associate (not_needed => self%b, nor_this => size(equation))
    end associate
  end function response_path_entries

  !> Rows, and K^+ of them: one solve for each.
  subroutine response_substitute(self, rows, substituted)
    class(split_response_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows
    type(substituted_rows_t), intent(inout) :: substituted
    real(dp) :: e(rows%n_rows)
    integer :: j
    substituted%forward%n = rows%n_rows
    substituted%forward%first_column = rows%row_start
    substituted%forward%column = rows%column
    substituted%forward%value = rows%value
    allocate (substituted%regularized(size(self%mode, 1), rows%n_rows), source=0.0_dp)
    do j = 1, rows%n_rows
      e = 0
      e(j) = 1
      call rows%multiply_transposed(e, substituted%regularized(:rows%n_columns, j))
      call self%solve(substituted%regularized(:, j))
    end do
  end subroutine response_substitute

  !> c_ij = a_i K^+ b_j.
  subroutine response_product(self, a, b, same, c)
    class(split_response_t), intent(in) :: self
    type(substituted_rows_t), intent(in) :: a, b
    logical, intent(in) :: same
    real(dp), intent(out) :: c(:, :)
    integer :: i, j, k
    c = 0
    do j = 1, size(c, 2)
      do i = 1, size(c, 1)
        do k = a%forward%first_column(i), a%forward%first_column(i + 1) - 1
          c(i, j) = c(i, j) + a%forward%value(k)*b%regularized(a%forward%column(k), j)
        end do
      end do
    end do
    if (same) c = (c + transpose(c))/2
    associate (not_needed => self%b)
    end associate
  end subroutine response_product

  !> The bodies belong to the scene.
  subroutine response_destroy(self)
    class(split_response_t), intent(inout) :: self
    self%bodies => null()
  end subroutine response_destroy
end module dotyk_split_split_response
