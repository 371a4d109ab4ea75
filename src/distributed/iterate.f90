!> An iterate of the proximal active set of distributed bodies, the same on all ranks, and what is done where active
!> sets come again.
module dotyk_distributed_iterate
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_proximal_active_set, only: mark_of_set
  implicit none
  private

  !> An iterate.
  type, public :: iterate_t
    !> prox, and theta + prox (n_rows) [length/pressure].
    real(dp), allocatable :: prox(:), softness(:)
    !> B u, and the gap less prox m_0 (n_rows) [length].
    real(dp), allocatable :: y(:), shifted(:)
    !> The active set of the linear system (n_rows).
    logical, allocatable :: active(:)
    !> Relative residual of the next linear system [].
    real(dp) :: aim = 0
    !> Energy norm of the displacements, prescribed ones included [sqrt(energy)].
    real(dp) :: norm = 0
    !> Whether steps are minima along their directions.
    logical :: guarded = .false.
    !> Marks of the active sets since the pressures m_0 changed.
    real(dp), allocatable :: seen(:)
    !> Last residual, and last change of the pressures [sqrt(energy)].
    real(dp) :: residual = 0, change = 0
  contains
    procedure :: init => iterate_init
    procedure :: look_for_cycles => iterate_look_for_cycles
  end type iterate_t

  !> prox as a fraction of the compliance of the rows in the smoother: with 1/1000 coarse levels, whose smoothers do not
  !> know the rows, take up to twice the iterations, with 1/20 proximal steps are more.
  real(dp), parameter :: proximal_fraction = 1.0e-2_dp
  !> prox grows by this factor where active sets come again although steps are minima.
  real(dp), parameter :: growth = 10
  !> Accuracy of the linear systems of the first active sets; its factor where sets come again or after `many_sets`.
  real(dp), parameter :: first_aim = 3.0e-3_dp, closer_aim = 0.1_dp
  integer, parameter :: many_sets = 5

contains

  !> Set the proximal terms, and the accuracy of the first linear systems.
  subroutine iterate_init(self, theta, compliance)
    class(iterate_t), intent(inout) :: self
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Compliance of the rows in the smoother, of pressures (n_rows) [length/pressure].
    real(dp), intent(in) :: compliance(:)
    self%prox = proximal_fraction*compliance
    self%prox = max(self%prox, proximal_fraction*maxval([tiny(1.0_dp), self%prox]))
    self%prox = max(0.0_dp, self%prox - theta)
    self%softness = theta + self%prox
    self%aim = first_aim
    self%seen = [real(dp) ::]
  end subroutine iterate_init

  !> Whether an active set has come again, and what to do about it: as in one process.
  subroutine iterate_look_for_cycles(self, theta, compliance, gap, m, accuracy, new)
    class(iterate_t), intent(inout) :: self
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Compliance of the rows in the smoother, of pressures (n_rows) [length/pressure].
    real(dp), intent(in) :: compliance(:)
    !> Gaps without the displacement by prescribed displacements (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Of the displacements [].
    real(dp), intent(in) :: accuracy
    !> The next active set; changed where prox is (n_rows).
    logical, intent(inout) :: new(:)
    real(dp) :: mark
    mark = mark_of_set(new)
    if (.not. any(abs(self%seen - mark) <= 0)) then
      self%seen = [self%seen, mark]
      if (modulo(size(self%seen), many_sets) == 0) self%aim = max(accuracy/2, closer_aim*self%aim)
      return
    end if
    self%aim = max(accuracy/2, closer_aim*self%aim)
    self%seen = [real(dp) ::]
    if (self%guarded) then
      self%prox = min(growth*self%prox, max(self%prox, compliance))
      self%softness = theta + self%prox
      self%shifted = gap - self%prox*m
      new = self%y - self%shifted > 0
    end if
    self%guarded = .true.
  end subroutine iterate_look_for_cycles
end module dotyk_distributed_iterate
