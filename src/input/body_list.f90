!> Materials and bodies of a namelist file: copies have bodies of their own, and bolts cut theirs.
module dotyk_input_body_list
  use dotyk_base_files, only: is_cad_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, material_anisotropic, material_isotropic, material_orthotropic
  use dotyk_base_text, only: shown, split_words, text_t, to_text
  use dotyk_input_bodies, only: read_body
  use dotyk_input_case, only: body_input_t, case_t, material_input_t, scene_input_t
  use dotyk_input_cut, only: cut_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_repeat, only: append_bodies, name_copies, repeat_body
  use dotyk_input_values, only: count_of, is_given, is_usable, names_t, pick_groups, read_numbers, real_of, refuse, &
    report, text_of, texts_of
  use dotyk_input_wildcards, only: refer_to_bodies
  implicit none
  private
  public :: read_bodies

contains

  !> Read the materials and bodies.
  subroutine read_bodies(groups, materials, mesh_expected, problems, bodies, case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(names_t), intent(in) :: materials  !! Names of the materials.
    logical, intent(in) :: mesh_expected  !! Whether the scene has no mesh, so that each body needs one.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(names_t), intent(inout) :: bodies  !! Names of the bodies: of the groups in, of all bodies out.
    type(case_t), intent(inout) :: case  !! The case with its scene; gets materials and bodies.
    type(body_input_t) :: body
    type(body_input_t), allocatable :: copies(:)
    integer, allocatable :: picked(:)
    integer :: i, n
    call pick_groups(groups, 'material', picked)
    allocate (case%material(size(picked)))
    do i = 1, size(picked)
      call read_material(groups(picked(i)), problems, case%material(i))
    end do
    call pick_groups(groups, 'body', picked)
    allocate (case%body(size(picked)))
    n = 0
    do i = 1, size(picked)
      call read_body(groups(picked(i)), materials, case%scene, case%directory, mesh_expected, problems, body)
      call repeat_body(groups(picked(i)), case%scene, problems, body, copies)
      call append_bodies(case%body, n, copies)
    end do
    case%body = case%body(:n)
    if (n > size(picked)) call name_copies(case%body, problems, bodies)
    call cut_bodies(groups, case%scene, problems, case%body, bodies)
    call check_mesh_keys(groups, case%body, problems)
  end subroutine read_bodies

  !> Keys of `&scene` for CAD files mean nothing where no body has one.
  subroutine check_mesh_keys(groups, body, problems)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    character(10), parameter :: keys(2) = ['mesh_size ', 'mesh_order']
    integer, allocatable :: picked(:)
    integer :: b, k
    call pick_groups(groups, 'scene', picked)
    if (size(picked) == 0 .or. any([(is_cad_file(body(b)%mesh), b=1, size(body))])) return
    do k = 1, size(keys)
      if (is_given(groups(picked(1)), trim(keys(k)))) &
        call report(problems, groups(picked(1)), trim(keys(k)), trim(keys(k))//' is for CAD files, and no body has '// &
                    'one: sizes and orders of .geo files are in them')
    end do
  end subroutine check_mesh_keys

  !> Cut the bodies that `&bolt` names by its key `body`.
  subroutine cut_bodies(groups, scene, problems, body, names)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(scene_input_t), intent(in) :: scene  !! The scene, for its analysis.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> Bodies; those that are cut are two, one after the other, on return (n_bodies).
    type(body_input_t), allocatable, intent(inout) :: body(:)
    type(names_t), intent(inout) :: names  !! Their names (n_bodies).
    type(cut_input_t), allocatable :: cut(:)
    type(cut_input_t) :: given
    integer, allocatable :: picked(:), matched(:)
    integer :: i, k
    call pick_groups(groups, 'bolt', picked)
    allocate (cut(size(body)))
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call read_cut(group, scene, problems, given)
        if (.not. is_given(group, 'body')) cycle
        call refer_to_bodies(group, 'body', text_of(group, 'body'), names, problems, matched)
        do k = 1, size(matched)
          if (matched(k) > size(body)) cycle
          associate (whole => body(matched(k)))
            if (cut(matched(k))%is_cut()) &
              call report(problems, group, 'body', 'body '//shown(whole%name)//' is cut already in line '// &
                          to_text(cut(matched(k))%line)//': a bolt has one cut')
            if (whole%is_surface) &
              call report(problems, group, 'body', 'body '//shown(whole%name)//' has no volume to cut')
            cut(matched(k)) = given
            cut(matched(k))%whole = whole%name
          end associate
        end do
      end associate
    end do
    if (.not. any(cut%is_cut())) return
    call divide(cut, body, names)
    do i = 1, size(body)
      if (.not. body(i)%cut%is_cut()) cycle
      do k = 1, size(body)
        if (k /= i .and. body(k)%name == body(i)%name) &
          call problems%add(body(k)%line, '&body: '//shown(body(k)%name)//' is the name of a half of body '// &
                            shown(body(i)%cut%whole)//', which the &bolt of line '//to_text(body(i)%cut%line)// &
                            ' cuts: give it another name')
      end do
    end do
  end subroutine cut_bodies

  !> Read where a bolt is cut.
  subroutine read_cut(group, scene, problems, cut)
    type(group_t), intent(in) :: group  !! Checked group.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its analysis.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(cut_input_t), intent(out) :: cut  !! The cut.
    character(7), parameter :: of_cut(3) = [character(7) :: 'point', 'normal', 'surface']
    integer :: k
    cut%line = group%line
    cut%surface = text_of(group, 'surface')
    if (.not. is_given(group, 'body')) then
      do k = 1, size(of_cut)
        if (is_given(group, trim(of_cut(k)))) &
          call report(problems, group, trim(of_cut(k)), trim(of_cut(k))//' is for a body that is cut: add body')
      end do
      return
    end if
    call refuse(group, 'surface_a', 'body', problems)
    call refuse(group, 'surface_b', 'body', problems)
    call refuse(group, 'search_radius', 'body', problems)
    if (is_given(group, 'surface')) then
      call refuse(group, 'point', 'surface', problems)
      call refuse(group, 'normal', 'surface', problems)
      return
    end if
    if (.not. is_given(group, 'point') .or. .not. is_given(group, 'normal')) then
      call problems%add(group%line, '&bolt: a body is cut by a plane, ''point'' and ''normal'', or along a '// &
                        '''surface'' inside it')
      return
    end if
    call read_numbers(group, 'point', cut%point)
    call read_numbers(group, 'normal', cut%normal)
    if (.not. is_usable(group, 'normal')) return
    if (.not. norm2(cut%normal) > 0) then
      call report(problems, group, 'normal', 'normal has no direction')
      return
    end if
    cut%normal = cut%normal/norm2(cut%normal)
    if (scene%dimension == 2 .and. abs(cut%normal(3)) > 0) &
      call report(problems, group, 'normal', 'in two dimensions the normal of a cut is in the plane')
    if (scene%analysis == analysis_axisymmetric .and. abs(cut%normal(1)) > 0) &
      call report(problems, group, 'normal', 'in axisymmetric analyses bolts are along the axis: normal=0,1')
  end subroutine read_cut

  !> Put two halves in the place of each body that is cut.
  subroutine divide(cut, body, names)
    type(cut_input_t), intent(in) :: cut(:)  !! Cut of each body (n_bodies).
    type(body_input_t), allocatable, intent(inout) :: body(:)  !! Bodies; more on return (n_bodies).
    type(names_t), intent(inout) :: names  !! Their names (n_bodies).
    type(body_input_t), allocatable :: all_bodies(:)
    type(names_t) :: all_names
    integer :: b, half, n
    n = size(body) + count(cut%is_cut())
    allocate (all_bodies(n), all_names%name(n), all_names%line(n), all_names%whole(n))
    all_names%what = names%what
    all_names%incomplete = names%incomplete
    n = 0
    do b = 1, size(body)
      do half = 1, merge(2, 1, cut(b)%is_cut())
        n = n + 1
        all_bodies(n) = body(b)
        all_names%whole(n)%s = ''
        if (cut(b)%is_cut()) then
          all_bodies(n)%cut = cut(b)
          all_bodies(n)%cut%half = half
          all_bodies(n)%name = body(b)%name//' ('//to_text(half)//')'
          all_names%whole(n)%s = body(b)%name
        end if
        all_names%name(n)%s = all_bodies(n)%name
        all_names%line(n) = body(b)%line
      end do
    end do
    call move_alloc(all_bodies, body)
    names = all_names
  end subroutine divide

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
end module dotyk_input_body_list
