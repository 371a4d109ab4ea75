!> How many digits the bodies' stiffnesses lose, said in the log and in the results.
module dotyk_driver_digits
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: quoted, to_text
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_response_full, only: full_response_t
  use dotyk_response_response, only: response_slot_t
  implicit none
  private

  !> What became of one body's digits.
  type, public :: body_digits_t
    !> Condition of the scaled stiffness, and of what is left of it without soft motions; lower bounds where not measured.
    real(dp) :: condition = 1, condition_left = 1
    logical :: is_measured = .false.
    !> Whether what its displacement leaves of the forces says more than the tolerance allows.
    logical :: is_rounded = .false.
    !> Soft motions that are treated apart.
    integer :: n_soft = 0
    !> Steps of refinement that its displacement took, 0 where none was needed.
    integer :: steps = 0
  contains
    procedure :: lost => digits_lost
    procedure :: needs_refinement => digits_needs_refinement
  end type body_digits_t

  public :: collect_digits, show_digits

  !> Conditions above this are worth a refinement.
  real(dp), parameter :: refined_condition = 1.0e7_dp

contains

  !> Decimal digits of 16 that the factor loses.
  elemental integer function digits_lost(self) result(lost)
    class(body_digits_t), intent(in) :: self
    lost = nint(log10(max(1.0_dp, min(1.0e16_dp, self%condition_left))))
  end function digits_lost

  !> Whether the displacement is to be refined with forces that the elements know better.
  elemental logical function digits_needs_refinement(self) result(needs)
    class(body_digits_t), intent(in) :: self
    needs = self%is_rounded .or. (self%is_measured .and. self%condition_left > refined_condition)
  end function digits_needs_refinement

  !> From the responses.
  subroutine collect_digits(classes, response, digits)
    type(congruence_classes_t), intent(in) :: classes
    !> Factorized (n_bodies).
    type(response_slot_t), intent(in) :: response(:)
    !> (n_bodies).
    type(body_digits_t), allocatable, intent(out) :: digits(:)
    integer :: b
    allocate (digits(size(response)))
    do b = 1, size(response)
      select type (full => response(classes%first(b))%form)
      type is (full_response_t)
        digits(b)%condition = full%digits%condition
        digits(b)%condition_left = full%digits%condition_left
        digits(b)%is_measured = full%digits%is_measured
        if (allocated(full%digits%motion)) digits(b)%n_soft = size(full%digits%motion, 2)
      end select
    end do
  end subroutine collect_digits

  !> One line for each kind of bodies that loses digits.
  subroutine show_digits(log, body, classes, digits)
    type(log_t), intent(inout) :: log
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(body_digits_t), intent(in) :: digits(:)
    character(:), allocatable :: line
    integer :: b
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) cycle
      line = '  digits           '//quoted(body(b)%name)//': '
      if (.not. digits(b)%is_measured) then
        if (digits(b)%steps > 0) call log%line(line//steps_of_refinement(digits(b)%steps))
        cycle
      end if
      line = line//'condition '//to_text(digits(b)%condition, 2)
      if (digits(b)%n_soft > 0) line = line//', '//to_text(digits(b)%condition_left, 2)//' without '// &
                                       to_text(digits(b)%n_soft)//' soft '// &
                                       trim(merge('motion ', 'motions', digits(b)%n_soft == 1))//' treated apart'
      line = line//': '//to_text(digits(b)%lost())//' of 16 digits lost'
      if (digits(b)%steps > 0) line = line//', '//steps_of_refinement(digits(b)%steps)
      call log%line(line)
    end do
  end subroutine show_digits

  !> How many, in words.
  pure function steps_of_refinement(n) result(text)
    integer, intent(in) :: n
    character(:), allocatable :: text
    text = to_text(n)//' '//trim(merge('step ', 'steps', n == 1))//' of refinement'
  end function steps_of_refinement
end module dotyk_driver_digits
