!> A vector field in space: constant components, components by formula, or both; or an affine field.
!>
!> Formulas are parsed here from their text, because a formula serves one thread: no two users share a field.
module dotyk_elasticity_vector_field
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: is_too_large, size_rule
  use dotyk_base_text, only: point_text, quoted, text_t, to_text
  use dotyk_base_thresholds, only: same_number
  implicit none
  private

  type, public :: vector_field_t  !! A vector field. It owns formulas: never copy it, and destroy it in the end.
    real(dp) :: value(3) = 0  !! Components without a formula (3) [any].
    logical :: constant = .true.  !! Whether the field is constant: no component has a formula, and it is not affine.
    real(dp), private :: slope(3, 3) = 0  !! Derivatives of an affine field by the coordinates (3, 3) [any/length].
    real(dp), private :: origin(3) = 0  !! Where an affine field has the constant components (3) [length].
    type(formula_t) :: formula(3)  !! Formulas of the components; not set where the component is constant (3).
    type(formula_t), private :: density  !! Formula of a density that multiplies the field; not set where there is none.
    type(text_t), private :: text(3)  !! Their texts, for messages; not allocated where the component is constant (3).
  contains
    procedure :: init => vector_field_init
    procedure :: init_affine => vector_field_init_affine
    procedure :: multiply_by_density => vector_field_multiply_by_density
    procedure :: evaluate => vector_field_evaluate
    procedure :: destroy => vector_field_destroy
  end type vector_field_t

  public :: vector_text

contains

  !> Parse the formulas of a field.
  subroutine vector_field_init(self, value, error, text)
    class(vector_field_t), intent(inout) :: self
    real(dp), intent(in) :: value(3)  !! Constant components (3) [any].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula does not parse.
    !> Formulas of the first components; an empty one keeps the constant; no formulas where not allocated (<= 3).
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
      self%text(i)%s = trim(text(i)%s)
    end do
  end subroutine vector_field_init

  !> An affine field that vanishes at a point.
  subroutine vector_field_init_affine(self, slope, origin)
    class(vector_field_t), intent(inout) :: self
    real(dp), intent(in) :: slope(3, 3)  !! Derivatives of the components by the coordinates (3, 3) [any/length].
    real(dp), intent(in) :: origin(3)  !! The point (3) [length].
    call self%destroy()
    self%slope = slope
    self%origin = origin
    self%constant = .false.
  end subroutine vector_field_init_affine

  !> Multiply the field by a density.
  subroutine vector_field_multiply_by_density(self, text, error)
    class(vector_field_t), intent(inout) :: self
    character(*), intent(in) :: text  !! Its formula.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the formula does not parse.
    call self%density%init(text, error)
    if (.not. allocated(error)) self%constant = .false.
  end subroutine vector_field_multiply_by_density

  !> Value of the field at a point.
  subroutine vector_field_evaluate(self, x, value, error)
    class(vector_field_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Coordinates of the point, two or three (dim) [length].
    real(dp), intent(out) :: value(3)  !! The vector (3) [any].
    !> Allocated where a component has no finite value there, or one that is too large or too small.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: position(3), density
    integer :: i
    value = self%value
    if (self%constant) return
    position = 0
    position(:size(x)) = x
    value = value + matmul(self%slope, position - self%origin)
    do i = 1, 3
      if (.not. self%formula(i)%is_set()) cycle
      value(i) = self%formula(i)%evaluate(position)
      if (.not. is_too_large(value(i))) cycle
      !$omp critical (message)
      call set_error(error, 'formula '//to_text(i)//', '//quoted(self%text(i)%s)//', is '//to_text(value(i))//' at '// &
                     point_text(x), exit_bad_input)
      !$omp end critical (message)
      if (ieee_is_finite(value(i))) error%message = error%message//'; '//size_rule
      return
    end do
    if (.not. self%density%is_set()) return
    density = self%density%evaluate(position)
    value = density*value
    if (.not. is_too_large(density)) then
      if (density >= 0) return
    end if
    !$omp critical (message)
    call set_error(error, 'density_formula is '//to_text(density)//' at '//point_text(x)//', but must not be '// &
                   'negative, nor beyond 1e40', exit_bad_input)
    !$omp end critical (message)
  end subroutine vector_field_evaluate

  !> Free the formulas; the field is constantly zero afterwards.
  subroutine vector_field_destroy(self)
    class(vector_field_t), intent(inout) :: self
    integer :: i
    do i = 1, 3
      call self%formula(i)%destroy()
    end do
    call self%density%destroy()
    self%value = 0
    self%slope = 0
    self%origin = 0
    self%constant = .true.
  end subroutine vector_field_destroy

  !> A vector for messages, without rounding errors.
  pure function vector_text(vector, scale) result(text)
    real(dp), intent(in) :: vector(:)  !! The vector (n) [any].
    real(dp), intent(in) :: scale  !! Size of numbers that are not rounding errors [any].
    character(:), allocatable :: text
    real(dp) :: clean(size(vector))
    clean = vector
    where (abs(clean) < same_number*abs(scale)) clean = 0
    text = point_text(clean)
  end function vector_text
end module dotyk_elasticity_vector_field
