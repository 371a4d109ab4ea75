!> Reads `&material` and `&body` from checked groups.
module dotyk_input_bodies
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, material_anisotropic, material_isotropic, material_orthotropic
  use dotyk_base_text, only: counted, join, shown, split_words, text_t, to_text
  use dotyk_input_boundary, only: read_vector
  use dotyk_input_case, only: body_input_t, material_input_t, scene_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_settings, only: read_mesh_path
  use dotyk_input_values, only: count_of, is_given, is_usable, logical_of, names_t, real_of, reals_of, refer, &
    report, text_of, texts_of
  implicit none
  private
  public :: read_material, read_body, union_name

contains

  !> Read `&material`.
  subroutine read_material(group, problems, material)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The material; incomplete where the group has mistakes.
    type(material_input_t), intent(out) :: material
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
    !> Checked group.
    type(group_t), intent(in) :: group
    !> The key.
    character(*), intent(in) :: key
    has = is_given(group, key) .or. is_given(group, key//'_formula')
  end function has

  !> Whether a material without a stiffness has axes: three values of a constant.
  pure logical function has_axes(group)
    !> Checked group.
    type(group_t), intent(in) :: group
    has_axes = max(count_of(group, 'young'), count_of(group, 'poisson'), count_of(group, 'shear'), &
                   count_of(group, 'young_formula'), count_of(group, 'poisson_formula'), &
                   count_of(group, 'shear_formula')) > 1
  end function has_axes

  !> Keep the formulas of constants.
  pure subroutine read_formulas(group, keys, n_values, material)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Keys of the constants, in their order, separated by blanks.
    character(*), intent(in) :: keys
    !> Number of constants of each (n_keys).
    integer, intent(in) :: n_values(:)
    !> The material; its formulas are set.
    type(material_input_t), intent(inout) :: material
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
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The material; its expansion is set.
    type(material_input_t), intent(inout) :: material
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
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The material; its shear moduli and axes are set.
    type(material_input_t), intent(inout) :: material
    integer :: n(3)
    n = [values_of('young'), values_of('poisson'), values_of('shear')]
    if (is_right('young') .and. is_right('poisson') .and. is_right('shear')) then
      if (any(n /= 3)) &
        call problems%add(group%line, '&material: an orthotropic material needs 3 values each of young, poisson '// &
                          'and shear, got '//to_text(n(1))//', '//to_text(n(2))//' and '//to_text(n(3)))
    end if
    call read_numbers(group, 'shear', material%shear)
    call read_axes(group, problems, material)

  contains

    !> Number of values of a constant, or of its formulas.
    pure integer function values_of(key)
      !> The key.
      character(*), intent(in) :: key
      values_of = count_of(group, key)
      if (.not. is_given(group, key)) values_of = count_of(group, key//'_formula')
    end function values_of

    !> Whether a constant, or its formulas, can be used; or shear is missing, which is told by the number of values.
    pure logical function is_right(key)
      !> The key.
      character(*), intent(in) :: key
      is_right = is_usable(group, key) .or. is_usable(group, key//'_formula') .or. &
                 (key == 'shear' .and. .not. has(group, key))
    end function is_right
  end subroutine read_orthotropic

  !> Read the axes of a material.
  subroutine read_axes(group, problems, material)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The material; its axes are set.
    type(material_input_t), intent(inout) :: material
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

  !> Report a key that another one excludes.
  subroutine refuse(group, key, other, problems)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> The excluded key.
    character(*), intent(in) :: key
    !> The key that excludes it.
    character(*), intent(in) :: other
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    if (is_given(group, key)) call report(problems, group, key, key//' does not go together with '//other)
  end subroutine refuse

  !> Report a constant that has both numbers and formulas.
  subroutine refuse_both(group, key, problems)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> The key of the numbers.
    character(*), intent(in) :: key
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    if (is_given(group, key) .and. is_given(group, key//'_formula')) &
      call report(problems, group, key, key//' and '//key//'_formula are both given: only one can be meant')
  end subroutine refuse_both

  !> Copy the numbers of a key; components that the key does not have keep their values.
  subroutine read_numbers(group, key, values)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Name of the key.
    character(*), intent(in) :: key
    !> Values of the key (at least as many as the key has) [unit of the key].
    real(dp), intent(inout) :: values(:)
    real(dp), allocatable :: numbers(:)
    integer :: n
    call reals_of(group, key, numbers)
    n = min(size(numbers), size(values))
    values(:n) = numbers(:n)
  end subroutine read_numbers

  !> Read `&body`.
  subroutine read_body(group, materials, scene, directory, mesh_expected, problems, body)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Names of the materials.
    type(names_t), intent(in) :: materials
    !> The scene: its mesh is that of bodies without their own.
    type(scene_input_t), intent(in) :: scene
    !> Directory of the namelist file.
    character(*), intent(in) :: directory
    !> Whether a body without a mesh is a mistake; not where the mesh of the scene has one itself.
    logical, intent(in) :: mesh_expected
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The body; incomplete where the group has mistakes.
    type(body_input_t), intent(out) :: body
    body%line = group%line
    body%name = text_of(group, 'name')
    if (index(body%name, ':') > 0) &
      call report(problems, group, 'name', 'name: '//shown(body%name)//' must not contain '':''')
    call read_volumes(group, materials, scene%dimension, problems, body)
    if (is_given(group, 'mesh')) then
      call read_mesh_path(group, directory, scene%dimension, problems, body%mesh)
      if (len(body%mesh) > 0 .and. body%mesh == scene%output) &
        call report(problems, group, 'mesh', 'mesh: '//shown(body%mesh)//' is the results file of &scene')
    else
      body%mesh = scene%mesh
      if (len(scene%mesh) == 0 .and. mesh_expected) &
        call problems%add(group%line, '&body: ''mesh'' is missing, here and in &scene')
    end if
    call read_placement(group, scene, problems, body)
    body%crack = logical_of(group, 'crack')
  end subroutine read_body

  !> Read the volumes of a body and their materials.
  subroutine read_volumes(group, materials, dimension, problems, body)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Names of the materials.
    type(names_t), intent(in) :: materials
    !> Dimension of space, 2 or 3; 0 where it is unknown.
    integer, intent(in) :: dimension
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The body; its volumes and materials are set.
    type(body_input_t), intent(inout) :: body
    type(text_t), allocatable :: names(:)
    integer, allocatable :: index_of(:)
    integer :: i, k
    call texts_of(group, 'volume', body%volumes)
    call texts_of(group, 'material', names)
    body%is_surface = is_given(group, 'surface')
    if (body%is_surface) then
      body%volumes = [text_t(text_of(group, 'surface'))]
      call refuse(group, 'volume', 'surface', problems)
      call refuse(group, 'material', 'surface', problems)
      call refuse(group, 'crack', 'surface', problems)
      body%has_facing = is_given(group, 'facing')
      call read_vector(group, 'facing', .false., dimension, problems, body%facing)
      ! It has none: the first one stands in.
      body%material = [1]
      body%material_of = [1]
      body%volume = union_name(body)
      return
    end if
    if (.not. is_given(group, 'volume')) call problems%add(group%line, "&body: 'volume' is missing")
    if (.not. is_given(group, 'material')) call problems%add(group%line, "&body: 'material' is missing")
    if (is_given(group, 'facing')) &
      call report(problems, group, 'facing', 'facing tells the side of a body without volume: it needs surface')
    do i = 2, size(body%volumes)
      if (any([(body%volumes(k)%s == body%volumes(i)%s, k=1, i - 1)])) &
        call report(problems, group, 'volume', 'volume: '//shown(body%volumes(i)%s)//' is named twice')
    end do
    if (size(names) > 1 .and. size(body%volumes) > 0 .and. size(names) /= size(body%volumes)) &
      call report(problems, group, 'material', 'material has '//counted(size(names), 'value')//', and volume has '// &
                  to_text(size(body%volumes))//': give one material for all volumes, or one for each')
    allocate (index_of(max(1, size(names))), source=0)
    do i = 1, size(names)
      if (any([(names(k)%s == names(i)%s, k=1, i - 1)])) then
        index_of(i) = index_of(findloc([(names(k)%s == names(i)%s, k=1, i - 1)], .true., dim=1))
      else
        call refer(group, 'material', names(i)%s, materials, problems, index_of(i))
      end if
    end do
    allocate (body%material(0), body%material_of(size(body%volumes)))
    do i = 1, size(index_of)
      if (.not. any(body%material == index_of(i))) body%material = [body%material, index_of(i)]
    end do
    do i = 1, size(body%volumes)
      body%material_of(i) = findloc(body%material, index_of(min(i, size(index_of))), dim=1)
    end do
    body%volume = union_name(body)
  end subroutine read_volumes

  !> Name of the volumes of a body together: its only one, or those of one material joined by `, `, the materials by
  !> `; `.
  pure function union_name(body) result(name)
    !> The body, with its volumes and their materials.
    type(body_input_t), intent(in) :: body
    character(:), allocatable :: name
    integer :: m
    name = ''
    do m = 1, size(body%material)
      if (m > 1) name = name//'; '
      name = name//join(pack(body%volumes, body%material_of == m), ', ')
    end do
  end function union_name

  !> Read the position and rotation of a body.
  subroutine read_placement(group, scene, problems, body)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> The scene, for its dimension and analysis.
    type(scene_input_t), intent(in) :: scene
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The body; its placement is set.
    type(body_input_t), intent(inout) :: body
    if (is_given(group, 'at') .and. is_usable(group, 'at')) then
      if (scene%dimension == 3 .and. count_of(group, 'at') < 3) &
        call report(problems, group, 'at', 'at needs 3 values in three dimensions, got '// &
                    to_text(count_of(group, 'at')))
      call read_numbers(group, 'at', body%at)
      if (scene%dimension == 2 .and. abs(body%at(3)) > 0) &
        call report(problems, group, 'at', 'at has z = '//to_text(body%at(3))//', but there is no z in two dimensions')
      if (scene%analysis == analysis_axisymmetric .and. abs(body%at(1)) > 0) &
        call report(problems, group, 'at', 'at has x = '//to_text(body%at(1))// &
                    ', but axisymmetric bodies are shifted along y only')
    end if
    if (is_given(group, 'axis') .and. .not. (is_given(group, 'angle') .or. is_given(group, 'first_angle'))) &
      call report(problems, group, 'axis', 'axis is given without an angle')
    if (is_given(group, 'axis') .and. is_usable(group, 'axis')) then
      call read_numbers(group, 'axis', body%axis)
      if (.not. maxval(abs(body%axis)) > 0) then
        call report(problems, group, 'axis', 'axis has no direction: all its components are 0')
      else if (scene%dimension == 2 .and. maxval(abs(body%axis(:2))) > 0) then
        call report(problems, group, 'axis', 'in two dimensions bodies are rotated about z only')
      end if
    end if
    if (is_given(group, 'angle')) body%angle = real_of(group, 'angle')
    if (scene%analysis /= analysis_axisymmetric) return
    if (is_given(group, 'angle')) &
      call report(problems, group, 'angle', 'axisymmetric bodies cannot be rotated: remove angle')
    if (is_given(group, 'first_angle')) &
      call report(problems, group, 'first_angle', 'axisymmetric bodies cannot be rotated: remove first_angle')
  end subroutine read_placement
end module dotyk_input_bodies
