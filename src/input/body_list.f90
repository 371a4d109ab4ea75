!> Materials and bodies of a namelist file: copies have bodies of their own, and bolts cut theirs.
module dotyk_input_body_list
  use dotyk_base_files, only: is_cad_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, material_anisotropic, material_isotropic, material_orthotropic
  use dotyk_base_text, only: shown, split_words, text_t, to_text
  use dotyk_input_bodies, only: append_bodies, name_copies, read_body, repeat_body
  use dotyk_input_case, only: body_input_t, case_t, cut_input_t, material_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: input_t, names_t
  implicit none
  private
  public :: read_bodies

contains

  !> Read the materials and bodies.
  subroutine read_bodies(groups, input, mesh_expected, case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    logical, intent(in) :: mesh_expected  !! Whether the scene has no mesh, so that each body needs one.
    type(case_t), intent(inout) :: case  !! The case with its scene; gets materials and bodies.
    type(body_input_t) :: body
    type(body_input_t), allocatable :: copies(:)
    integer, allocatable :: picked(:)
    integer :: i, n
    call pick_groups(groups, 'material', picked)
    allocate (case%material(size(picked)))
    do i = 1, size(picked)
      call read_material(groups(picked(i)), input, case%material(i))
    end do
    call pick_groups(groups, 'body', picked)
    allocate (case%body(size(picked)))
    n = 0
    do i = 1, size(picked)
      call read_body(groups(picked(i)), input, case%directory, mesh_expected, body)
      call repeat_body(groups(picked(i)), input, body, copies)
      call append_bodies(case%body, n, copies)
    end do
    case%body = case%body(:n)
    if (n > size(picked)) call name_copies(input, case%body)
    call cut_bodies(groups, input, case%body)
    call check_mesh_keys(groups, input, case%body)
  end subroutine read_bodies

  !> Keys of `&scene` for CAD files mean nothing where no body has one.
  subroutine check_mesh_keys(groups, input, body)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    character(10), parameter :: keys(2) = ['mesh_size ', 'mesh_order']
    integer, allocatable :: picked(:)
    integer :: b, k
    call pick_groups(groups, 'scene', picked)
    if (size(picked) == 0 .or. any([(is_cad_file(body(b)%mesh), b=1, size(body))])) return
    do k = 1, size(keys)
      if (groups(picked(1))%is_given(trim(keys(k)))) &
        call input%report(groups(picked(1)), trim(keys(k)), trim(keys(k))//' is for CAD files, and no body has '// &
                          'one: sizes and orders of .geo files are in them')
    end do
  end subroutine check_mesh_keys

  !> Cut the bodies that `&bolt` names by its key `body`.
  subroutine cut_bodies(groups, input, body)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), allocatable, intent(inout) :: body(:)  !! Bodies; cut ones are two on return (n_bodies).
    type(cut_input_t), allocatable :: cut(:)
    type(cut_input_t) :: given
    integer, allocatable :: picked(:), matched(:)
    integer :: i, k
    call pick_groups(groups, 'bolt', picked)
    allocate (cut(size(body)))
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call read_cut(group, input, given)
        if (.not. group%is_given('body')) cycle
        call input%refer_to_bodies(group, 'body', group%text_of('body'), matched)
        do k = 1, size(matched)
          if (matched(k) > size(body)) cycle
          associate (whole => body(matched(k)))
            if (cut(matched(k))%is_cut()) &
              call input%report(group, 'body', 'body '//shown(whole%name)//' is cut already in line '// &
                                to_text(cut(matched(k))%line)//': a bolt has one cut')
            if (whole%is_surface) call input%report(group, 'body', 'body '//shown(whole%name)//' has no volume to cut')
            cut(matched(k)) = given
            cut(matched(k))%whole = whole%name
          end associate
        end do
      end associate
    end do
    if (.not. any(cut%is_cut())) return
    call divide(input, cut, body)
    do i = 1, size(body)
      if (.not. body(i)%cut%is_cut()) cycle
      do k = 1, size(body)
        if (k /= i .and. body(k)%name == body(i)%name) &
          call input%add(body(k)%line, '&body: '//shown(body(k)%name)//' is the name of a half of body '// &
                         shown(body(i)%cut%whole)//', which the &bolt of line '//to_text(body(i)%cut%line)// &
                         ' cuts: give it another name')
      end do
    end do
  end subroutine cut_bodies

  !> Read where a bolt is cut.
  subroutine read_cut(group, input, cut)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(cut_input_t), intent(out) :: cut  !! The cut.
    character(7), parameter :: of_cut(3) = [character(7) :: 'point', 'normal', 'surface']
    integer :: k
    cut%line = group%line
    cut%surface = group%text_of('surface')
    if (.not. group%is_given('body')) then
      do k = 1, size(of_cut)
        if (group%is_given(trim(of_cut(k)))) &
          call input%report(group, trim(of_cut(k)), trim(of_cut(k))//' is for a body that is cut: add body')
      end do
      return
    end if
    call input%refuse(group, 'surface_a', 'body')
    call input%refuse(group, 'surface_b', 'body')
    call input%refuse(group, 'search_radius', 'body')
    if (group%is_given('surface')) then
      call input%refuse(group, 'point', 'surface')
      call input%refuse(group, 'normal', 'surface')
      return
    end if
    if (.not. group%is_given('point') .or. .not. group%is_given('normal')) then
      call input%add(group%line, '&bolt: a body is cut by a plane, ''point'' and ''normal'', or along a '// &
                     '''surface'' inside it')
      return
    end if
    call group%read_numbers('point', cut%point)
    call group%read_numbers('normal', cut%normal)
    if (.not. group%is_usable('normal')) return
    if (.not. norm2(cut%normal) > 0) then
      call input%report(group, 'normal', 'normal has no direction')
      return
    end if
    cut%normal = cut%normal/norm2(cut%normal)
    if (input%scene%dimension == 2 .and. abs(cut%normal(3)) > 0) &
      call input%report(group, 'normal', 'in two dimensions the normal of a cut is in the plane')
    if (input%scene%analysis == analysis_axisymmetric .and. abs(cut%normal(1)) > 0) &
      call input%report(group, 'normal', 'in axisymmetric analyses bolts are along the axis: normal=0,1')
  end subroutine read_cut

  !> Put two halves in the place of each body that is cut.
  subroutine divide(input, cut, body)
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(cut_input_t), intent(in) :: cut(:)  !! Cut of each body (n_bodies).
    type(body_input_t), allocatable, intent(inout) :: body(:)  !! Bodies; more on return (n_bodies).
    type(body_input_t), allocatable :: all_bodies(:)
    type(names_t) :: all_names
    integer :: b, half, n
    n = size(body) + count(cut%is_cut())
    allocate (all_bodies(n), all_names%name(n), all_names%line(n), all_names%whole(n))
    all_names%what = input%bodies%what
    all_names%incomplete = input%bodies%incomplete
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
    input%bodies = all_names
  end subroutine divide

  !> Read `&material`.
  subroutine read_material(group, input, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(material_input_t), intent(out) :: material  !! The material; incomplete where the group has mistakes.
    material%line = group%line
    material%name = group%text_of('name')
    material%young_formula = group%text_of('young_formula')
    material%density = group%real_of('density')
    material%density_formula = group%text_of('density_formula')
    call input%refuse_both(group, 'density', 'density_formula')
    call read_expansion(group, input, material)
    if (has(group, 'stiffness')) then
      material%kind = material_anisotropic
      call input%refuse_both(group, 'stiffness', 'stiffness_formula')
      call group%read_numbers('stiffness', material%stiffness)
      call input%refuse(group, 'young', 'stiffness')
      call input%refuse(group, 'poisson', 'stiffness')
      call input%refuse(group, 'poisson_formula', 'stiffness')
      call input%refuse(group, 'shear', 'stiffness')
      call input%refuse(group, 'shear_formula', 'stiffness')
      if (group%count_of('young_formula') > 1) &
        call input%report(group, 'young_formula', 'young_formula does not go together with stiffness: one formula '// &
                          'is a factor, three are not')
      call read_formulas(group, 'stiffness', [21], material)
      call read_axes(group, input, material)
      return
    end if
    if (.not. has(group, 'young')) call input%report(group, 'young', '''young'' or ''stiffness'' is missing')
    if (.not. has(group, 'poisson')) call input%report(group, 'poisson', '''poisson'' is missing')
    call input%refuse_both(group, 'poisson', 'poisson_formula')
    call input%refuse_both(group, 'shear', 'shear_formula')
    if (group%count_of('young_formula') > 1) call input%refuse_both(group, 'young', 'young_formula')
    ! Without young, its formula is the modulus itself: a factor of 1.
    if (.not. group%is_given('young')) material%young = 1
    call group%read_numbers('young', material%young)
    call group%read_numbers('poisson', material%poisson)
    if (has_axes(group)) then
      material%kind = material_orthotropic
      call read_orthotropic(group, input, material)
      ! Three formulas are the moduli, not a factor.
      if (group%count_of('young_formula') > 1) material%young_formula = ''
      call read_formulas(group, 'young poisson shear', [3, 3, 3], material)
    else
      material%kind = material_isotropic
      if (group%is_usable('poisson') .and. (material%poisson(1) <= -1 .or. material%poisson(1) >= 0.5_dp)) &
        call input%report(group, 'poisson', 'poisson must be above -1 and below 0.5, got '// &
                          to_text(material%poisson(1), 15))
      if (group%is_given('axis_1')) call input%report(group, 'axis_1', 'axis_1 means nothing for an isotropic material')
      if (group%is_given('axis_2')) call input%report(group, 'axis_2', 'axis_2 means nothing for an isotropic material')
      call read_formulas(group, 'young poisson', [1, 1], material)
    end if
  end subroutine read_material

  !> Whether a key or its formula is given.
  pure logical function has(group, key)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! The key.
    has = group%is_given(key) .or. group%is_given(key//'_formula')
  end function has

  !> Whether a material without a stiffness has axes: three values of a constant.
  pure logical function has_axes(group)
    type(group_t), intent(in) :: group  !! Checked group.
    has_axes = max(group%count_of('young'), group%count_of('poisson'), group%count_of('shear'), &
                   group%count_of('young_formula'), group%count_of('poisson_formula'), &
                   group%count_of('shear_formula')) > 1
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
      call group%texts_of(key(k)%s//'_formula', some)
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
  subroutine read_expansion(group, input, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(material_input_t), intent(inout) :: material  !! The material; its expansion is set.
    character(:), allocatable :: key
    material%expands = has(group, 'expansion')
    call input%refuse_both(group, 'expansion', 'expansion_formula')
    call group%texts_of('expansion_formula', material%expansion_formula)
    key = 'expansion'
    if (.not. group%is_given(key)) key = 'expansion_formula'
    if (.not. group%is_usable(key)) return
    if (key == 'expansion') call group%read_numbers(key, material%expansion)
    select case (group%count_of(key))
    case (1)
      material%expansion = material%expansion(1)
    case (2)
      call input%report(group, key, key//' needs 1 or 3 values, got 2')
    case (3)
      if (.not. (has(group, 'stiffness') .or. has_axes(group))) &
        call input%report(group, key, 'an isotropic material has one value of expansion, got 3')
    end select
  end subroutine read_expansion

  !> Read shear moduli and axes of an orthotropic material.
  subroutine read_orthotropic(group, input, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(material_input_t), intent(inout) :: material  !! The material; its shear moduli and axes are set.
    integer :: n(3)
    n = [values_of('young'), values_of('poisson'), values_of('shear')]
    if (is_right('young') .and. is_right('poisson') .and. is_right('shear')) then
      if (any(n /= 3)) &
        call input%add(group%line, '&material: an orthotropic material needs 3 values each of young, poisson and '// &
                       'shear, got '//to_text(n(1))//', '//to_text(n(2))//' and '//to_text(n(3))// &
                       trim(merge('; decimals have a point, 0.3 not 0,3', repeat(' ', 36), n(3) == 0 .and. &
                       any(n == 2))))
    end if
    call group%read_numbers('shear', material%shear)
    call read_axes(group, input, material)

  contains

    !> Number of values of a constant, or of its formulas.
    pure integer function values_of(key)
      character(*), intent(in) :: key  !! The key.
      values_of = group%count_of(key)
      if (.not. group%is_given(key)) values_of = group%count_of(key//'_formula')
    end function values_of

    !> Whether a constant, or its formulas, can be used; or shear is missing, which is told by the number of values.
    pure logical function is_right(key)
      character(*), intent(in) :: key  !! The key.
      is_right = group%is_usable(key) .or. group%is_usable(key//'_formula') .or. &
                 (key == 'shear' .and. .not. has(group, key))
    end function is_right
  end subroutine read_orthotropic

  !> Read the axes of a material.
  subroutine read_axes(group, input, material)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(material_input_t), intent(inout) :: material  !! The material; its axes are set.
    real(dp) :: a(3), b(3), normal(3)
    call group%read_numbers('axis_1', material%axis_1)
    call group%read_numbers('axis_2', material%axis_2)
    if (.not. (group%is_usable('axis_1') .and. group%is_usable('axis_2'))) return
    if (.not. maxval(abs(material%axis_1)) > 0) then
      call input%report(group, 'axis_1', 'axis_1 has no direction: all its components are 0')
    else if (.not. maxval(abs(material%axis_2)) > 0) then
      call input%report(group, 'axis_2', 'axis_2 has no direction: all its components are 0')
    else
      a = material%axis_1/maxval(abs(material%axis_1))
      b = material%axis_2/maxval(abs(material%axis_2))
      normal = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
      ! Below this angle (in radians) rounding in the input decides where axis 3 points.
      if (norm2(normal) <= 1e-6_dp*norm2(a)*norm2(b)) &
        call input%report(group, 'axis_1', 'axis_1 and axis_2 are parallel (by default 1, 0, 0 and 0, 1, 0)')
    end if
  end subroutine read_axes

end module dotyk_input_body_list
