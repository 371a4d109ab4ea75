!> A vector that depends on the place: constants, formulas, or some of each.
!>
!> Formulas are parsed here from their text, for one field serves one thread: no two bodies share one.
module dotyk_elasticity_vector_field
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: is_too_large, size_rule
  use dotyk_base_text, only: text_t, to_text
  implicit none
  private

  !> A vector field. Never copy it; destroy it in the end.
  type, public :: vector_field_t
    !> Components that have no formula (3).
    real(dp) :: value(3) = 0
    !> Whether the value is the same everywhere.
    logical :: constant = .true.
    !> Formulas of the components; not set: the constant (3).
    type(formula_t) :: formula(3)
  contains
    procedure :: init => vector_field_init
    procedure :: evaluate => vector_field_evaluate
    procedure :: destroy => vector_field_destroy
  end type vector_field_t

  public :: point_text, vector_text

contains

  !> Parse the formulas of a field.
  subroutine vector_field_init(self, value, error, text)
    class(vector_field_t), intent(inout) :: self
    !> Constant components (3).
    real(dp), intent(in) :: value(3)
    !> Allocated where a formula does not parse.
    type(error_t), allocatable, intent(out) :: error
    !> Formulas of the first components; an empty one leaves the constant. None where not allocated.
    type(text_t), intent(in), allocatable, optional :: text(:)
    integer :: i
    call self%destroy()
    self%value = value
    if (.not. present(text)) return
    if (.not. allocated(text)) return
    do i = 1, min(3, size(text))
      if (.not. allocated(text(i)%s)) cycle
      if (len_trim(text(i)%s) == 0) cycle
      call self%formula(i)%init(text(i)%s, error)
      if (allocated(error)) then
        call self%destroy()
        return
      end if
      self%constant = .false.
    end do
  end subroutine vector_field_init

  !> The vector at a place.
  subroutine vector_field_evaluate(self, x, value, error)
    class(vector_field_t), intent(in) :: self
    !> Coordinates, two or three [length].
    real(dp), intent(in) :: x(:)
    !> The vector (3).
    real(dp), intent(out) :: value(3)
    !> Allocated where a component is no number, or too large a one, there.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: place(3)
    integer :: i
    value = self%value
    if (self%constant) return
    place = 0
    place(:size(x)) = x
    do i = 1, 3
      if (self%formula(i)%is_set()) value(i) = self%formula(i)%evaluate(place)
      if (.not. is_too_large(value(i))) cycle
      !$omp critical (message)
      call set_error(error, 'the formula is '//to_text(value(i))//' at '//point_text(x), exit_bad_input)
      !$omp end critical (message)
      if (ieee_is_finite(value(i))) error%message = error%message//'; '//size_rule
      return
    end do
  end subroutine vector_field_evaluate

  !> Give the formulas back; the field is constantly zero then.
  subroutine vector_field_destroy(self)
    class(vector_field_t), intent(inout) :: self
    integer :: i
    do i = 1, 3
      call self%formula(i)%destroy()
    end do
    self%value = 0
    self%constant = .true.
  end subroutine vector_field_destroy

  !> A place for messages, as "(1.5, 0, 2)".
  pure function point_text(x) result(text)
    real(dp), intent(in) :: x(:)
    character(:), allocatable :: text
    integer :: i
    text = '('
    do i = 1, size(x)
      if (i > 1) text = text//', '
      text = text//to_text(x(i))
    end do
    text = text//')'
  end function point_text

  !> A vector of numbers for messages, without the dust of round-off.
  pure function vector_text(vector, scale) result(text)
    real(dp), intent(in) :: vector(:)
    !> Numbers below 1e-9 of this are written as zero.
    real(dp), intent(in) :: scale
    character(:), allocatable :: text
    real(dp) :: clean(size(vector))
    clean = vector
    where (abs(clean) < 1.0e-9_dp*abs(scale)) clean = 0
    text = point_text(clean)
  end function vector_text
end module dotyk_elasticity_vector_field
