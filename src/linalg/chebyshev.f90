!> Chebyshev smoother with inverse diagonal blocks, in single precision (M. Adams, M. Brezina, J. Hu and R. Tuminaro, J.
!> Comput. Phys. 188, 2003; Y. Saad, Iterative Methods for Sparse Linear Systems, 2003, algorithm 12.1).
!>
!> With D the diagonal blocks of A, errors along eigenvectors of D^{-1} A from greatest/ratio to greatest fall by the
!> same factor at least; a coarse space takes the others. The smoother is a polynomial in D^{-1} A times D^{-1}, hence
!> symmetric: it needs no coloring and has the same digits on any number of threads.
module dotyk_linalg_chebyshev
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_linalg_block_products, only: smooth_rows, smoothing_step
  use dotyk_linalg_block_rows, only: block_rows_t
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient, preconditioned_system_t
  use dotyk_linalg_spectrum, only: fixed_start
  implicit none
  private

  !> A matrix with its smoother. As a system for conjugate gradients its preconditioner is D^{-1} alone.
  type, extends(preconditioned_system_t), public :: chebyshev_t
    type(block_rows_t) :: rows  !! The matrix A.
    integer :: degree = 3  !! Number of products with D^{-1}.
    real(dp) :: ratio = 8  !! Ratio of the ends of the interval.
    real(dp) :: greatest = 0  !! Upper end of the interval: greatest eigenvalue of D^{-1} A, with a margin [].
    real(sp), allocatable :: inverse(:, :, :)  !! Inverse diagonal blocks of A/scale (dim, dim, n) [].
  contains
    procedure :: prepare => chebyshev_prepare
    procedure :: multiply => chebyshev_multiply
    procedure :: precondition => chebyshev_precondition
    procedure :: smooth => chebyshev_smooth
    procedure :: bytes => chebyshev_bytes
    procedure :: destroy => chebyshev_destroy
  end type chebyshev_t

  !> Lanczos steps for the greatest eigenvalue, and the margin: Ritz values after 12 steps are 0.96 to 1 of it
  !> (`benchmark_multigrid table`). With degree 3 and ratio 8 the smoother converges up to 1.12 times `greatest`: 0.81
  !> of it would do.
  integer, parameter, public :: lanczos_steps = 12
  real(dp), parameter, public :: lanczos_margin = 1.1_dp

contains

  !> Invert the diagonal blocks and estimate the greatest eigenvalue; `rows` is set before.
  subroutine chebyshev_prepare(self, regular)
    class(chebyshev_t), intent(inout) :: self
    logical, intent(out) :: regular  !! Whether all diagonal blocks are positive definite, as smoothing needs.
    type(cg_outcome_t) :: outcome
    real(dp), allocatable :: start(:), x(:)
    real(dp) :: least
    integer :: n
    if (allocated(self%inverse)) deallocate (self%inverse)
    allocate (self%inverse(self%rows%dim, self%rows%dim, self%rows%n))
    call self%rows%invert_diagonal(self%inverse, regular)
    if (.not. regular) return
    n = self%rows%dim*self%rows%n
    allocate (start(n), x(n))
    call fixed_start(start)
    call conjugate_gradient(self, start, x, 0.0_dp, lanczos_steps, outcome)
    call outcome%ritz_values(least, self%greatest)
    self%greatest = lanczos_margin*self%greatest
  end subroutine chebyshev_prepare

  !> y = A x.
  subroutine chebyshev_multiply(self, x, y)
    class(chebyshev_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Vector x (n) [any].
    real(dp), intent(out), contiguous :: y(:)  !! Product y (n) [A times x].
    call self%rows%multiply(x, y)
  end subroutine chebyshev_multiply

  !> z = D^{-1} r.
  subroutine chebyshev_precondition(self, r, z)
    class(chebyshev_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! Residual r (n) [A times x].
    real(dp), intent(out), contiguous :: z(:)  !! Preconditioned residual z (n) [as x].
    call apply_inverse(self%rows%dim, self%rows%n, self%inverse, 1/self%rows%scale, r, z)
  end subroutine chebyshev_precondition

  !> z = factor D^{-1} r.
  subroutine apply_inverse(dim, n, inverse, factor, r, z)
    integer, intent(in) :: dim  !! Order of the blocks.
    integer, intent(in) :: n  !! Number of blocks.
    real(sp), intent(in) :: inverse(dim, dim, n)  !! Inverse blocks (dim, dim, n) [].
    real(dp), intent(in) :: factor  !! Factor [1/A].
    real(dp), intent(in) :: r(dim, n)  !! Residual r (dim, n) [A times x].
    real(dp), intent(out) :: z(dim, n)  !! Preconditioned residual z (dim, n) [as x].
    integer :: i, j
    !$omp parallel do default(none) shared(dim, n, inverse, factor, r, z) private(j) schedule(static)
    do i = 1, n
      do j = 1, dim
        z(j, i) = factor*sum(inverse(j, :, i)*r(:, i))
      end do
    end do
    !$omp end parallel do
  end subroutine apply_inverse

  !> x: the smoother's approximate solution of (A/scale) x = b, from x = 0.
  subroutine chebyshev_smooth(self, b, x)
    class(chebyshev_t), intent(in) :: self
    real(sp), intent(in), contiguous :: b(:)  !! Right-hand side b (n) [any].
    real(sp), intent(out), contiguous :: x(:)  !! Approximate solution x (n) [as b].
    real(sp), allocatable :: other(:), p(:)
    real(dp) :: middle, half, rho, last
    integer :: k
    allocate (other(size(b)), p(size(b)))
    ! Saad's theta, delta, rho.
    middle = self%greatest*(1 + 1/self%ratio)/2
    half = self%greatest*(1 - 1/self%ratio)/2
    rho = half/middle
    ! Iterates take turns in two arrays; the last one is in x.
    if (modulo(self%degree, 2) == 1) then
      call begin(x)
    else
      call begin(other)
    end if
    do k = 2, self%degree
      last = rho
      rho = 1/(2*middle/half - last)
      if (modulo(self%degree - k, 2) == 1) then
        call step(x, other)
      else
        call step(other, x)
      end if
    end do

  contains

    !> The first step, from x = 0.
    subroutine begin(first)
      real(sp), intent(out) :: first(:)  !! The first iterate (n) [as x].
      first = 0
      call smoothing_step(self%rows%dim, self%rows%n, self%inverse, 0.0_sp, real(1/middle, sp), b, p, first)
    end subroutine begin

    !> A step.
    subroutine step(from, to)
      real(sp), intent(in), contiguous :: from(:)  !! Iterate (n) [as x].
      real(sp), intent(out), contiguous :: to(:)  !! The next one (n) [as x].
      call smooth_rows(self%rows%dim, self%rows%n, self%rows%start, self%rows%column, self%rows%leading, self%inverse, &
        real(rho*last, sp), real(2*rho/half, sp), b, from, p, to)
    end subroutine step
  end subroutine chebyshev_smooth

  !> Memory of the matrix and the inverse blocks [bytes].
  pure integer(int64) function chebyshev_bytes(self) result(bytes)
    class(chebyshev_t), intent(in) :: self
    bytes = self%rows%bytes()
    if (allocated(self%inverse)) bytes = bytes + 4*size(self%inverse, kind=int64)
  end function chebyshev_bytes

  !> Free the memory.
  subroutine chebyshev_destroy(self)
    class(chebyshev_t), intent(inout) :: self
    call self%rows%destroy()
    if (allocated(self%inverse)) deallocate (self%inverse)
  end subroutine chebyshev_destroy
end module dotyk_linalg_chebyshev
