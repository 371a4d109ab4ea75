!> Vectors of two or three components, as numbers or formulas, from checked groups.
module dotyk_input_vectors
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: text_t, to_text
  use dotyk_input_groups, only: group_t
  use dotyk_input_references, only: input_t
  implicit none
  private
  public :: read_formulas, read_vector

contains

  !> Read a vector with three components from two or three numbers.
  subroutine read_vector(group, input, key, local, vector)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the vector is in the axes of a surface: xi, eta, n.
    real(dp), intent(out) :: vector(3)  !! The vector (3) [unit of the key]; 0 where it is not given.
    real(dp), allocatable :: numbers(:)
    integer :: across
    vector = 0
    call group%reals_of(key, numbers)
    if (.not. right_count(group, input, key, size(numbers))) return
    across = merge(2, 3, local)
    if (size(numbers) == 3) then
      vector = numbers
      if (input%scene%dimension == 2 .and. abs(vector(across)) > 0) call report_across(group, input, key, local)
    else
      vector(1) = numbers(1)
      vector(merge(3, 2, local)) = numbers(2)
    end if
  end subroutine read_vector

  !> Read a vector of formulas from two or three texts.
  subroutine read_formulas(group, input, key, local, formulas)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the formulas are in the axes of a surface: xi, eta, n.
    type(text_t), allocatable, intent(out) :: formulas(:)  !! Formulas of the components (3), or none.
    type(text_t), allocatable :: texts(:)
    integer :: i, across
    call group%texts_of(key, texts)
    if (.not. right_count(group, input, key, size(texts))) then
      allocate (formulas(0))
      return
    end if
    across = merge(2, 3, local)
    allocate (formulas(3))
    if (size(texts) == 3) then
      do i = 1, 3
        formulas(i)%s = texts(i)%s
      end do
      if (input%scene%dimension == 2 .and. formulas(across)%s /= '0') call report_across(group, input, key, local)
    else
      formulas(1)%s = texts(1)%s
      formulas(across)%s = '0'
      formulas(merge(3, 2, local))%s = texts(2)%s
    end if
  end subroutine read_formulas

  !> Whether a vector is given with as many values as the space has dimensions; too few are reported.
  logical function right_count(group, input, key, n) result(right)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    integer, intent(in) :: n  !! Number of its values; 0 where it is not given or not usable.
    right = n > 0
    if (n /= 2 .or. input%scene%dimension /= 3) return
    call input%report(group, key, key//' needs 3 values in three dimensions, got '//to_text(group%count_of(key)))
    right = .false.
  end function right_count

  !> Report a component across the plane in two dimensions.
  subroutine report_across(group, input, key, local)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the vector is in the axes of a surface: xi, eta, n.
    call input%report(group, key, key//': the '//trim(merge('eta', 'z  ', local))//' component must be 0 in two '// &
                      'dimensions')
  end subroutine report_across
end module dotyk_input_vectors
