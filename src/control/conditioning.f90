!> The conditioning of the stiffness of each body, and what was done about it.
module dotyk_control_conditioning
  use dotyk_base_kinds, only: dp
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  implicit none
  private

  type, public :: conditioning_t  !! The conditioning of one body.
    real(dp) :: condition = 1  !! Condition number of the scaled stiffness; a lower bound where not measured [].
    !> That of the stiffness without the near-null-space modes that were split off, likewise [].
    real(dp) :: condition_left = 1
    logical :: is_measured = .false.  !! Whether both were measured.
    logical :: is_rounded = .false.  !! Whether rounding of its displacement exceeds what the tolerance allows.
    integer :: n_near_null = 0  !! Near-null-space modes that were split off.
    integer :: n_steps = 0  !! Steps of iterative refinement of its displacement, 0 where none was needed.
  contains
    procedure :: lost_digits => conditioning_lost_digits
    procedure :: needs_refinement => conditioning_needs_refinement
  end type conditioning_t

  public :: collect_conditioning

  real(dp), parameter :: refined_condition = 1.0e7_dp  !! Conditions above this are worth iterative refinement.

contains

  !> Decimal digits of 16 that are lost in a solve with the factor.
  elemental integer function conditioning_lost_digits(self) result(lost)
    class(conditioning_t), intent(in) :: self
    lost = nint(log10(max(1.0_dp, min(1.0e16_dp, self%condition_left))))
  end function conditioning_lost_digits

  !> Whether the displacement is to be refined with residuals computed from the elements.
  elemental logical function conditioning_needs_refinement(self) result(needs)
    class(conditioning_t), intent(in) :: self
    needs = self%is_rounded .or. (self%is_measured .and. self%condition_left > refined_condition)
  end function conditioning_needs_refinement

  !> From the factorizations.
  pure subroutine collect_conditioning(classes, report, conditioning)
    type(congruence_classes_t), intent(in) :: classes  !! Classes of congruent bodies.
    type(factorization_report_t), intent(in) :: report(:)  !! Reports of the representatives (n_bodies).
    type(conditioning_t), allocatable, intent(out) :: conditioning(:)  !! Conditioning of the bodies (n_bodies).
    integer :: b
    allocate (conditioning(size(report)))
    do b = 1, size(report)
      associate (of_class => report(classes%first(b)))
        conditioning(b)%condition = of_class%condition
        conditioning(b)%condition_left = of_class%condition_left
        conditioning(b)%is_measured = of_class%is_measured
        conditioning(b)%n_near_null = of_class%n_near_null
      end associate
    end do
  end subroutine collect_conditioning
end module dotyk_control_conditioning
