!> Modulus field: the factor on the stiffness of a material that varies in space, `young_formula` in the input.
module dotyk_elasticity_modulus_field
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: size_rule, smallest_number
  use dotyk_base_text, only: text_t, to_text
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_vector_field, only: vector_field_t, point_text
  implicit none
  private
  public :: read_modulus_field, apply_modulus_field

contains

  !> Parse the modulus field of a material: 1 where the material has none.
  subroutine read_modulus_field(material, factor, error)
    type(material_t), intent(in) :: material  !! The material.
    type(vector_field_t), intent(inout) :: factor  !! The modulus field, in the first component.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the formula does not parse.
    type(text_t), allocatable :: text(:)
    if (allocated(material%modulus_formula)) then
      allocate (text(1))
      text(1)%s = material%modulus_formula
    end if
    call factor%init([1.0_dp, 0.0_dp, 0.0_dp], error, text)
    call add_context(error, 'young_formula: ')
  end subroutine read_modulus_field

  !> Multiply the quadrature weights of an element by the modulus field.
  subroutine apply_modulus_field(factor, shape, x, tag, w, error)
    type(vector_field_t), intent(in) :: factor  !! The modulus field, in the first component.
    real(dp), intent(in) :: shape(:, :)  !! Shape functions at the points (n_nodes, n_points) [].
    real(dp), intent(in) :: x(:, :)  !! Nodes of the element (dim, n_nodes) [length].
    integer(int64), intent(in) :: tag  !! Tag of the element, for messages.
    real(dp), intent(inout) :: w(:)  !! Weights (n_points) [volume].
    !> Allocated where the modulus field has no value, is not positive, or is too large or too small at a point.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: position(size(x, 1)), value(3)
    integer :: q
    do q = 1, size(w)
      position = matmul(x, shape(:, q))
      call factor%evaluate(position, value, error)
      if (.not. allocated(error) .and. value(1) >= smallest_number) then
        w(q) = w(q)*value(1)
        cycle
      end if
      !$omp critical (message)
      if (allocated(error)) then
        continue   ! The formula has no value there: the message exists.
      else if (.not. value(1) > 0) then
        call set_error(error, 'the modulus factor must be positive, it is '//to_text(value(1))//' at '// &
                       point_text(position), exit_bad_input)
      else
        call set_error(error, 'the formula is '//to_text(value(1))//' at '//point_text(position)//'; '//size_rule, &
                       exit_bad_input)
      end if
      call add_context(error, 'young_formula: ')
      error%message = error%message//' (element '//to_text(tag)//')'
      !$omp end critical (message)
      return
    end do
  end subroutine apply_modulus_field
end module dotyk_elasticity_modulus_field
