!> Reads `&material` from a checked group.
module dotyk_input_materials
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: material_anisotropic, material_isotropic, material_orthotropic
  use dotyk_base_text, only: split_words, text_t, to_text
  use dotyk_input_case, only: material_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: count_of, is_given, is_usable, read_numbers, real_of, refuse, report, text_of, texts_of
  implicit none
  private
  public :: read_material

contains

  !> Read `&material`.
  subroutine read_material(group, problems, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(material_input_t), intent(out) :: material  !! The material; incomplete where the group has mistakes.
    material%line = group%line
    material%name = text_of(group, 'name')
    material%young_formula = text_of(group, 'young_formula')
    material%density = real_of(group, 'density')
    material%density_formula = text_of(group, 'density_formula')
    call refuse_both(group, 'density', problems)
    call read_expansion(group, problems, material)
    if (has(group, 'stiffness')) then
      material%kind = material_anisotropic
      call refuse_both(group, 'stiffness', problems)
      call read_numbers(group, 'stiffness', material%stiffness)
      call refuse(group, 'young', 'stiffness', problems)
      call refuse(group, 'poisson', 'stiffness', problems)
      call refuse(group, 'poisson_formula', 'stiffness', problems)
      call refuse(group, 'shear', 'stiffness', problems)
      call refuse(group, 'shear_formula', 'stiffness', problems)
      if (count_of(group, 'young_formula') > 1) &
        call report(problems, group, 'young_formula', 'young_formula does not go together with stiffness: one '// &
                    'formula is a factor, three are not')
      call read_formulas(group, 'stiffness', [21], material)
      call read_axes(group, problems, material)
      return
    end if
    if (.not. has(group, 'young')) call report(problems, group, 'young', '''young'' or ''stiffness'' is missing')
    if (.not. has(group, 'poisson')) call report(problems, group, 'poisson', '''poisson'' is missing')
    call refuse_both(group, 'poisson', problems)
    call refuse_both(group, 'shear', problems)
    if (count_of(group, 'young_formula') > 1) call refuse_both(group, 'young', problems)
    ! Without young, its formula is the modulus itself: a factor of 1.
    if (.not. is_given(group, 'young')) material%young = 1
    call read_numbers(group, 'young', material%young)
    call read_numbers(group, 'poisson', material%poisson)
    if (has_axes(group)) then
      material%kind = material_orthotropic
      call read_orthotropic(group, problems, material)
      ! Three formulas are the moduli, not a factor.
      if (count_of(group, 'young_formula') > 1) material%young_formula = ''
      call read_formulas(group, 'young poisson shear', [3, 3, 3], material)
    else
      material%kind = material_isotropic
      if (is_usable(group, 'poisson') .and. (material%poisson(1) <= -1 .or. material%poisson(1) >= 0.5_dp)) &
        call report(problems, group, 'poisson', 'poisson must be above -1 and below 0.5, got '// &
                    to_text(material%poisson(1), 15))
      if (is_given(group, 'axis_1')) &
        call report(problems, group, 'axis_1', 'axis_1 means nothing for an isotropic material')
      if (is_given(group, 'axis_2')) &
        call report(problems, group, 'axis_2', 'axis_2 means nothing for an isotropic material')
      call read_formulas(group, 'young poisson', [1, 1], material)
    end if
  end subroutine read_material

  !> Whether a key or its formula is given.
  pure logical function has(group, key)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! The key.
    has = is_given(group, key) .or. is_given(group, key//'_formula')
  end function has

  !> Whether a material without a stiffness has axes: three values of a constant.
  pure logical function has_axes(group)
    type(group_t), intent(in) :: group  !! Checked group.
    has_axes = max(count_of(group, 'young'), count_of(group, 'poisson'), count_of(group, 'shear'), &
                   count_of(group, 'young_formula'), count_of(group, 'poisson_formula'), &
                   count_of(group, 'shear_formula')) > 1
  end function has_axes

  !> Keep the formulas of constants.
  pure subroutine read_formulas(group, keys, n_values, material)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: keys  !! Keys of the constants, in their order, separated by blanks.
    integer, intent(in) :: n_values(:)  !! Number of constants of each (n_keys).
    type(material_input_t), intent(inout) :: material  !! The material; its formulas are set.
    type(text_t), allocatable :: formula(:), key(:), some(:)
    integer :: i, k, first
    logical :: any_given
    call split_words(keys, key)
    allocate (formula(sum(n_values)))
    do i = 1, size(formula)
      formula(i)%s = ''
    end do
    first = 0
    any_given = .false.
    do k = 1, size(key)
      call texts_of(group, key(k)%s//'_formula', some)
      ! One formula of Young's modulus is a factor of all constants.
      if (size(some) == n_values(k) .and. (key(k)%s /= 'young' .or. size(some) > 1)) then
        do i = 1, n_values(k)
          formula(first + i)%s = some(i)%s
        end do
        any_given = .true.
      end if
      first = first + n_values(k)
    end do
    if (any_given) call move_alloc(formula, material%stiffness_formula)
  end subroutine read_formulas

  !> Read the thermal expansion: one coefficient, or three of a material with axes.
  subroutine read_expansion(group, problems, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(material_input_t), intent(inout) :: material  !! The material; its expansion is set.
    character(:), allocatable :: key
    material%expands = has(group, 'expansion')
    call refuse_both(group, 'expansion', problems)
    call texts_of(group, 'expansion_formula', material%expansion_formula)
    key = 'expansion'
    if (.not. is_given(group, key)) key = 'expansion_formula'
    if (.not. is_usable(group, key)) return
    if (key == 'expansion') call read_numbers(group, key, material%expansion)
    select case (count_of(group, key))
    case (1)
      material%expansion = material%expansion(1)
    case (2)
      call report(problems, group, key, key//' needs 1 or 3 values, got 2')
    case (3)
      if (.not. (has(group, 'stiffness') .or. has_axes(group))) &
        call report(problems, group, key, 'an isotropic material has one value of expansion, got 3')
    end select
  end subroutine read_expansion

  !> Read shear moduli and axes of an orthotropic material.
  subroutine read_orthotropic(group, problems, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(material_input_t), intent(inout) :: material  !! The material; its shear moduli and axes are set.
    integer :: n(3)
    n = [values_of('young'), values_of('poisson'), values_of('shear')]
    if (is_right('young') .and. is_right('poisson') .and. is_right('shear')) then
      if (any(n /= 3)) &
        call problems%add(group%line, '&material: an orthotropic material needs 3 values each of young, poisson '// &
                          'and shear, got '//to_text(n(1))//', '//to_text(n(2))//' and '//to_text(n(3))// &
                          trim(merge('; decimals have a point, 0.3 not 0,3', repeat(' ', 36), &
                                     n(3) == 0 .and. any(n == 2))))
    end if
    call read_numbers(group, 'shear', material%shear)
    call read_axes(group, problems, material)

  contains

    !> Number of values of a constant, or of its formulas.
    pure integer function values_of(key)
      character(*), intent(in) :: key  !! The key.
      values_of = count_of(group, key)
      if (.not. is_given(group, key)) values_of = count_of(group, key//'_formula')
    end function values_of

    !> Whether a constant, or its formulas, can be used; or shear is missing, which is told by the number of values.
    pure logical function is_right(key)
      character(*), intent(in) :: key  !! The key.
      is_right = is_usable(group, key) .or. is_usable(group, key//'_formula') .or. &
                 (key == 'shear' .and. .not. has(group, key))
    end function is_right
  end subroutine read_orthotropic

  !> Read the axes of a material.
  subroutine read_axes(group, problems, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(material_input_t), intent(inout) :: material  !! The material; its axes are set.
    real(dp) :: a(3), b(3), normal(3)
    call read_numbers(group, 'axis_1', material%axis_1)
    call read_numbers(group, 'axis_2', material%axis_2)
    if (.not. (is_usable(group, 'axis_1') .and. is_usable(group, 'axis_2'))) return
    if (.not. maxval(abs(material%axis_1)) > 0) then
      call report(problems, group, 'axis_1', 'axis_1 has no direction: all its components are 0')
    else if (.not. maxval(abs(material%axis_2)) > 0) then
      call report(problems, group, 'axis_2', 'axis_2 has no direction: all its components are 0')
    else
      a = material%axis_1/maxval(abs(material%axis_1))
      b = material%axis_2/maxval(abs(material%axis_2))
      normal = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
      ! Below this angle (in radians) rounding in the input decides where axis 3 points.
      if (norm2(normal) <= 1e-6_dp*norm2(a)*norm2(b)) &
        call report(problems, group, 'axis_1', 'axis_1 and axis_2 are parallel (by default 1, 0, 0 and 0, 1, 0)')
    end if
  end subroutine read_axes

  !> Report a constant that has both numbers and formulas.
  subroutine refuse_both(group, key, problems)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! The key of the numbers.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    if (is_given(group, key) .and. is_given(group, key//'_formula')) &
      call report(problems, group, key, key//' and '//key//'_formula are both given: only one can be meant')
  end subroutine refuse_both
end module dotyk_input_materials
