!> Factors of stiffnesses of rigid body modes, those by contact and by springs, `S + T`: S may be singular, T is not.
module dotyk_scheme_mode_factor
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: half_digits, sum_rounding
  use dotyk_linalg_dense_cholesky, only: dense_cholesky_t
  use dotyk_scheme_coarse_space, only: mode_block_t
  implicit none
  private
  public :: multiply_springs

  type, public :: mode_factor_t  !! The factor.
    type(dense_cholesky_t), private :: factor  !! Of the matrix, scaled to a unit diagonal.
    real(dp), allocatable, private :: scale(:)  !! Scales of the modes (n_modes) [sqrt(length/force)].
  contains
    procedure :: init => factor_init
    procedure :: solve => factor_solve
  end type mode_factor_t

contains

  !> Factorize.
  subroutine factor_init(self, stiffness, spring, error)
    class(mode_factor_t), intent(inout) :: self
    real(dp), intent(in) :: stiffness(:, :)  !! S (n_modes, n_modes) [force/length].
    !> T by bodies; of size 0 for bodies without modes (n_bodies) [force/length].
    type(mode_block_t), intent(in) :: spring(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite.
    real(dp), allocatable :: sum(:, :)
    real(dp) :: shift
    integer :: b, first, k, n, failed
    sum = stiffness
    first = 0
    do b = 1, size(spring)
      n = size(spring(b)%value, 1)
      sum(first + 1:first + n, first + 1:first + n) = sum(first + 1:first + n, first + 1:first + n) + spring(b)%value
      first = first + n
    end do
    n = size(sum, 1)
    self%scale = [(1/sqrt(sum(k, k)), k=1, n)]
    sum = sum*spread(self%scale, 1, n)*spread(self%scale, 2, n)
    shift = 0
    do
      do k = 1, n
        sum(k, k) = 1 + shift
      end do
      call self%factor%resize(n)
      self%factor%value(:int(n, int64)**2) = reshape(sum, [int(n, int64)**2])
      call self%factor%factorize(failed)
      if (failed == 0) return
      shift = max(10*shift, sum_rounding)
      if (shift > half_digits) exit
    end do
    call set_error(error, 'the stiffness of rigid body modes is not positive definite', exit_not_solvable)
  end subroutine factor_init

  !> alpha := (S + T)^{-1} alpha.
  subroutine factor_solve(self, alpha)
    class(mode_factor_t), intent(in) :: self
    real(dp), intent(inout) :: alpha(:)  !! Resultants in [force], amplitudes out [length] (n_modes).
    alpha = self%scale*alpha
    call self%factor%solve(alpha)
    alpha = self%scale*alpha
  end subroutine factor_solve

  !> T alpha.
  pure function multiply_springs(spring, alpha) result(force)
    !> T by bodies; of size 0 for bodies without modes (n_bodies) [force/length].
    type(mode_block_t), intent(in) :: spring(:)
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (n_modes) [length].
    real(dp) :: force(size(alpha))  !! (n_modes) [force]
    integer :: b, first, n
    force = 0
    first = 0
    do b = 1, size(spring)
      n = size(spring(b)%value, 1)
      force(first + 1:first + n) = matmul(spring(b)%value, alpha(first + 1:first + n))
      first = first + n
    end do
  end function multiply_springs
end module dotyk_scheme_mode_factor
