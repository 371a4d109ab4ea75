!> The smoother of the linear system of an active set, `K + B^T W B`: Chebyshev's with `D + B^T W B` in place of the
!> diagonal blocks D of the smoother of each body (`dotyk_linalg_chebyshev`). As K <= D, this bounds K + B^T W B, too.
module dotyk_scheme_contact_smoother
  use dotyk_base_kinds, only: dp, sp
  use dotyk_linalg_block_products, only: smoothing_step
  use dotyk_scheme_active_rows, only: active_rows_t
  use dotyk_scheme_body_grids, only: body_grids_t
  use dotyk_scheme_grid_body, only: body_vector_t
  implicit none
  private

  type, abstract, extends(body_grids_t), public :: contact_smoother_t  !! The bodies with their active rows.
    type(active_rows_t) :: active  !! The active rows, with the factors of the preconditioner.
  contains
    procedure :: smooth => smoother_smooth
    procedure :: low_residual => smoother_low_residual
    procedure :: smoothed_rows => smoother_smoothed_rows
    procedure :: smoother_force => smoother_row_force
  end type contact_smoother_t

contains

  !> Subtract B^T (W B x) from a residual in single precision, x of each body times the scale of its stiffness.
  subroutine subtract_contact(self, x, r)
    class(contact_smoother_t), intent(in) :: self
    real(sp), intent(in), contiguous :: x(:)  !! Scaled displacements (n) [force].
    real(sp), intent(inout), contiguous :: r(:)  !! Residual (n) [force].
    real(dp) :: moved(self%n_rows)
    if (size(self%active%row) == 0) return
    call self%row_displacement_low(x, moved)
    call self%subtract_row_force_low(self%stiffness*moved, r)
  end subroutine subtract_contact

  !> p := c p + d (D + B^T W B)^{-1} r, x := x + p; r is changed.
  subroutine smoother_step(self, c, d, r, p, x)
    class(contact_smoother_t), intent(in) :: self
    real(dp), intent(in) :: c, d  !! Factors [].
    real(sp), intent(inout), contiguous :: r(:)  !! Residual (n) [force].
    !> Step and iterate, times the scale of the stiffness of each body (n) [force].
    real(sp), intent(inout), contiguous :: p(:), x(:)
    real(dp), allocatable :: lambda(:)
    integer :: k
    if (size(self%active%row) > 0) then
      allocate (lambda(self%n_rows))
      call self%smoothed_rows(r, lambda)
      lambda(:) = self%smoother_force(lambda)
      call self%subtract_row_force_low(lambda, r)
    end if
    do k = 1, self%groups%n_alone
      call step_of_body(self%groups%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%groups%n_alone < self%groups%n)
    do k = self%groups%n_alone + 1, self%groups%n
      call step_of_body(self%groups%body(k))
    end do
    !$omp end parallel do

  contains

    !> The step of one body.
    subroutine step_of_body(b)
      integer, intent(in) :: b  !! The body.
      associate (first => self%first(b) + 1, last => self%first(b + 1), &
                 fine => self%grid(self%body(b)%representative)%p%fine)
        call smoothing_step(self%dim, fine%rows%n, fine%inverse, real(c, sp), real(d/fine%greatest, sp), &
                            r(first:last), p(first:last), x(first:last))
      end associate
    end subroutine step_of_body
  end subroutine smoother_step

  !> y = B D^{-1} r, D the diagonal blocks of the smoother.
  subroutine smoother_smoothed_rows(self, r, y)
    class(contact_smoother_t), intent(in) :: self
    real(sp), intent(in), contiguous :: r(:)  !! Forces (n) [force].
    real(dp), intent(out) :: y(:)  !! At the rows (n_rows) [length].
    type(body_vector_t), allocatable :: own(:)
    integer :: b
    allocate (own(size(self%body)))
    !$omp parallel do default(none) shared(self, r, own) schedule(dynamic, 1) if (self%many_rows())
    do b = 1, size(self%body)
      allocate (own(b)%value(size(self%body(b)%row)), source=0.0_dp)
      call self%body(b)%rows%add_smoothed(self%grid(self%body(b)%representative)%p, self%dim, &
                                          r(self%first(b) + 1:self%first(b + 1)), own(b)%value)
    end do
    !$omp end parallel do
    call self%add_rows(own, y)
  end subroutine smoother_smoothed_rows

  !> Forces on the active rows that displace them against W and the diagonal blocks: (W^{-1} + B D^{-1} B^T)^{-1} y.
  function smoother_row_force(self, y) result(lambda)
    class(contact_smoother_t), intent(in) :: self
    real(dp), intent(in) :: y(:)  !! At the rows (n_rows) [length].
    real(dp), allocatable :: lambda(:)  !! Zero on inactive rows (n_rows) [force].
    lambda = y
    call self%active%solve_smoother(lambda)
  end function smoother_row_force

  !> r = b - (K + B^T W B) x, x of each body times the scale of its stiffness.
  subroutine smoother_low_residual(self, b, x, rough, r)
    class(contact_smoother_t), intent(in) :: self
    real(sp), intent(in), contiguous :: b(:)  !! Right-hand side (n) [force].
    real(sp), intent(in), contiguous :: x(:)  !! Scaled displacements (n) [force].
    logical, intent(in) :: rough  !! Whether with the matrix of smoothers, see `block_rows_t`.
    real(sp), intent(out), contiguous :: r(:)  !! Residual (n) [force].
    integer :: k
    do k = 1, self%groups%n_alone
      call residual_of_body(self%groups%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%groups%n_alone < self%groups%n)
    do k = self%groups%n_alone + 1, self%groups%n
      call residual_of_body(self%groups%body(k))
    end do
    !$omp end parallel do
    call subtract_contact(self, x, r)

  contains

    !> The residual of one body.
    subroutine residual_of_body(body)
      integer, intent(in) :: body  !! The body.
      associate (first => self%first(body) + 1, last => self%first(body + 1), &
                 rows => self%grid(self%body(body)%representative)%p%fine%rows)
        call rows%residual(b(first:last), x(first:last), r(first:last), rough)
      end associate
    end subroutine residual_of_body
  end subroutine smoother_low_residual

  !> Chebyshev's iteration from x = 0 on the interval from 1/ratio to 1, see `chebyshev_t`.
  subroutine smoother_smooth(self, b, x)
    class(contact_smoother_t), intent(in) :: self
    real(sp), intent(in), contiguous :: b(:)  !! Right-hand side (n) [force].
    !> Approximate solution, times the scale of the stiffness of each body (n) [force].
    real(sp), intent(out), contiguous :: x(:)
    real(sp), allocatable :: r(:), p(:)
    real(dp) :: middle, half, rho, last
    integer :: k
    allocate (r, source=b)
    allocate (p(size(b)))
    associate (fine => self%grid(self%body(1)%representative)%p%fine)
      middle = (1 + 1/fine%ratio)/2
      half = (1 - 1/fine%ratio)/2
      x = 0
      rho = half/middle
      call smoother_step(self, 0.0_dp, 1/middle, r, p, x)
      do k = 2, fine%degree
        call self%low_residual(b, x, .true., r)
        last = rho
        rho = 1/(2*middle/half - last)
        call smoother_step(self, rho*last, 2*rho/half, r, p, x)
      end do
    end associate
  end subroutine smoother_smooth
end module dotyk_scheme_contact_smoother
