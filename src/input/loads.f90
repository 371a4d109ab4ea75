!> Reads what acts on bodies from checked groups: `&load`, `&mass` (point masses), `&support`, `&spring` (supports that
!> yield), `&temperature` and `&initial_stress`.
!>
!> A mass acts by its weight and its centrifugal force: for each load of its body that is an acceleration or an angular
!> velocity it becomes a total load on the surface, with its moment about the point.
module dotyk_input_loads
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, analysis_plane_stress, load_acceleration, &
    load_angular_velocity, load_force_density, load_local_traction, load_names, load_pressure, load_total
  use dotyk_base_text, only: join, shown, split_words, text_t, to_text
  use dotyk_input_case, only: body_input_t, field_input_t, load_input_t, material_input_t, share_a_case, support_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: append_places, input_t, need_place, place_key, read_formulas, read_vector
  implicit none
  private
  public :: read_loads, read_supports, read_initial_stresses, read_temperatures

contains

  !> Read all of them, for each body that a group names.
  subroutine read_loads(groups, input, body, material, load)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! The bodies (n_bodies).
    type(material_input_t), intent(in) :: material(:)  !! The materials (n_materials).
    type(load_input_t), allocatable, intent(out) :: load(:)  !! The loads (n_loads).
    type(load_input_t), allocatable :: given(:)
    integer, allocatable :: picked(:), matched(:), group_of(:), body_of(:)
    integer :: i
    call pick_groups(groups, 'load', picked)
    allocate (given(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_load(groups(picked(i)), input, given(i), matched)
      call append_places(i, matched, group_of, body_of)
    end do
    allocate (load(size(group_of)))
    do i = 1, size(group_of)
      load(i) = given(group_of(i))
      load(i)%body = body_of(i)
    end do
    call read_masses(groups, input, load)
    call check_densities(input, load, body, material)
  end subroutine read_loads

  !> Read `&load`.
  subroutine read_load(group, input, load, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(out) :: load  !! The load, without a body; incomplete where the group has mistakes.
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that the group names, ascending (n_matched).
    type(text_t), allocatable :: kinds(:)
    character(:), allocatable :: given, key
    integer :: k, n
    call input%begin_action(group, load, matched)
    allocate (load%formula(0))
    call split_words(load_names, kinds)
    given = ''
    n = 0
    do k = 1, size(kinds)
      if (.not. (group%is_given(kinds(k)%s) .or. group%is_given(kinds(k)%s//'_formula'))) cycle
      call input%refuse_both(group, kinds(k)%s, kinds(k)%s//'_formula')
      n = n + 1
      given = given//', '//kinds(k)%s
      load%kind = k
    end do
    if (group%is_given('force') .or. group%is_given('moment')) then
      n = n + 1
      given = given//', force and moment'
      load%kind = load_total
    else if (group%is_given('point')) then
      call input%report(group, 'point', 'point goes together with force and moment only')
    end if
    if (n /= 1) then
      if (n == 0) given = ', none of them'
      call input%add(group%line, '&load: exactly one of '//join(kinds, ', ')//' (or its formula), or force and '// &
                     'moment, is needed, got '//given(3:))
      return
    end if
    key = 'force'
    if (load%kind <= size(kinds)) key = kinds(load%kind)%s
    if (any(load%kind == [load_force_density, load_angular_velocity, load_acceleration])) then
      do k = 1, size(place_key)
        call input%refuse(group, trim(place_key(k)), key)
      end do
    else
      call need_place(input, group)
    end if
    if (any(load%kind == [load_pressure, load_local_traction])) then
      do k = 2, size(place_key)
        if (group%is_given(trim(place_key(k)))) call input%report(group, trim(place_key(k)), key//' is along the '// &
          'normal and axes of a surface: edges and nodes have traction, force and moment')
      end do
    end if
    if (group%is_given('centre') .and. load%kind /= load_angular_velocity) &
      call input%report(group, 'centre', 'centre means nothing without angular_velocity')
    if (load%kind == load_angular_velocity) then
      call read_rotation(group, input, load)
    else if (load%kind == load_total) then
      call read_total(group, input, load)
    else if (load%kind == load_pressure) then
      load%value(1) = group%real_of(key)
      call group%texts_of(key//'_formula', load%formula)
    else
      call read_vector(group, input, key, load%kind == load_local_traction, load%value)
      call read_formulas(group, input, key//'_formula', load%kind == load_local_traction, load%formula)
      if (load%kind == load_acceleration .and. input%scene%analysis == analysis_axisymmetric .and. &
          abs(load%value(1)) > 0) call input%report(group, key, 'acceleration: in axisymmetric analyses only that '// &
          'along the axis y exists')
    end if
  end subroutine read_load

  !> Read angular velocity and centre.
  subroutine read_rotation(group, input, load)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(inout) :: load  !! Gets both.
    character, parameter :: name(3) = ['x', 'y', 'z']
    real(dp), allocatable :: numbers(:)
    integer :: axis
    axis = merge(2, 3, input%scene%analysis == analysis_axisymmetric)
    call group%reals_of('angular_velocity', numbers)
    if (size(numbers) == 3) then
      load%value = numbers
      load%value(axis) = 0
      if (input%scene%dimension == 2 .and. any(abs(load%value) > 0)) &
        call input%report(group, 'angular_velocity', 'angular_velocity must be about '//name(axis)// &
                          ' in this analysis: its other components are 0')
      load%value = numbers
    else if (size(numbers) == 1 .and. input%scene%dimension == 2) then
      load%value(axis) = numbers(1)
    else if (group%is_usable('angular_velocity')) then
      call input%report(group, 'angular_velocity', 'angular_velocity needs '// &
                        trim(merge('1 or 3 values                ', '3 values in three dimensions ', &
                        input%scene%dimension == 2))//', got '//to_text(size(numbers)))
    end if
    call read_vector(group, input, 'centre', .false., load%centre)
    if (group%is_given('centre') .and. input%scene%analysis == analysis_axisymmetric) &
      call input%report(group, 'centre', 'axisymmetric bodies rotate about their axis: remove centre')
  end subroutine read_rotation

  !> Read force, moment and point of a total load.
  subroutine read_total(group, input, load)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(inout) :: load  !! Gets them.
    real(dp), allocatable :: moment(:)
    call read_vector(group, input, 'force', .false., load%value)
    call read_vector(group, input, 'point', .false., load%point)
    load%has_point = group%is_given('point')
    call group%reals_of('moment', moment)
    if (size(moment) == 3) then
      load%moment = moment
      if (input%scene%dimension == 2 .and. any(abs(moment(1:2)) > 0)) &
        call input%report(group, 'moment', 'moment: the x and y components must be 0 in two dimensions')
    else if (size(moment) == 1 .and. input%scene%dimension /= 3) then
      load%moment(3) = moment(1)
    else if (size(moment) > 0) then
      call input%report(group, 'moment', 'moment needs 3 values'//trim(merge('             ', ' or that of z', &
                        input%scene%dimension == 3))//', got '//to_text(group%count_of('moment')))
    end if
  end subroutine read_total

  !> Read all `&mass` and append their forces to the loads.
  subroutine read_masses(groups, input, load)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), allocatable, intent(inout) :: load(:)  !! Loads, added to (n_loads).
    type(load_input_t) :: of_mass
    integer, allocatable :: picked(:), matched(:)
    integer :: b, i, k, n
    call pick_groups(groups, 'mass', picked)
    n = size(load)
    of_mass%kind = load_total
    of_mass%of_mass = .true.
    allocate (of_mass%formula(0))
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call input%begin_action(group, of_mass, matched)
        of_mass%has_point = group%is_usable('point')
        call read_vector(group, input, 'point', .false., of_mass%point)
        if (input%scene%analysis == analysis_axisymmetric .and. abs(of_mass%point(1)) > 0) &
          call input%report(group, 'point', 'point: in axisymmetric analyses a mass is on the axis: point = 0, y')
        do b = 1, size(matched)
          of_mass%body = matched(b)
          k = size(load)
          call add_forces(group, input, n, of_mass, load)
          if (size(load) == k) &
            call input%add(group%line, '&mass: no &load acceleration or angular_velocity acts on body '// &
                           shown(input%bodies%name(matched(b))%s)//': the mass has no force')
        end do
      end associate
    end do
  end subroutine read_masses

  !> Append the forces of a mass on one body.
  subroutine add_forces(group, input, n, of_mass, load)
    type(group_t), intent(in) :: group  !! `&mass`.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    integer, intent(in) :: n  !! Number of `&load`.
    type(load_input_t), intent(inout) :: of_mass  !! The total load, but for its force.
    type(load_input_t), allocatable, intent(inout) :: load(:)  !! Loads, added to (n_loads).
    real(dp) :: arm(3), mass
    integer :: k
    mass = group%real_of('mass')
    do k = 1, n
      if (load(k)%body /= of_mass%body) cycle
      if (load(k)%kind == load_acceleration) then
        of_mass%value = mass*load(k)%value
      else if (load(k)%kind == load_angular_velocity) then
        if (.not. group%is_given('point') .and. input%scene%analysis /= analysis_axisymmetric) &
          call input%add(group%line, '&mass: point is needed for the centrifugal force of the &load in line '// &
                         to_text(load(k)%line))
        arm = of_mass%point - load(k)%centre
        of_mass%value = 0
        ! On the axis of an axisymmetric body there is none.
        if (input%scene%analysis /= analysis_axisymmetric) &
          of_mass%value = mass*(arm*sum(load(k)%value**2) - load(k)%value*dot_product(load(k)%value, arm))
      else
        cycle
      end if
      ! The mass acts in the load cases of the acceleration.
      if (allocated(of_mass%in_case)) deallocate (of_mass%in_case)
      if (allocated(load(k)%in_case)) of_mass%in_case = load(k)%in_case
      load = [load, of_mass]
    end do
  end subroutine add_forces

  !> Report bodies without a density that a load needs; those with point masses may have none at all.
  subroutine check_densities(input, load, body, material)
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(in) :: load(:)  !! Loads of bodies (n_loads).
    type(body_input_t), intent(in) :: body(:)  !! The bodies (n_bodies).
    type(material_input_t), intent(in) :: material(:)  !! The materials (n_materials).
    integer :: i, k
    do i = 1, size(load)
      if (.not. any(load(i)%kind == [load_angular_velocity, load_acceleration]) .or. load(i)%body == 0) cycle
      if (body(load(i)%body)%is_surface) cycle
      if (any(load%of_mass .and. load%body == load(i)%body) .and. &
          .not. any([(has_density(body(load(i)%body)%material(k)), k=1, size(body(load(i)%body)%material))])) cycle
      do k = 1, size(body(load(i)%body)%material)
        associate (m => body(load(i)%body)%material(k))
          if (m == 0) cycle
          if (.not. has_density(m)) &
            call input%add(load(i)%line, '&load: the material '//shown(material(m)%name)//' of body '// &
                           shown(body(load(i)%body)%name)//' has no density')
        end associate
      end do
    end do

  contains

    !> Whether a material has a density.
    pure logical function has_density(m)
      integer, intent(in) :: m  !! The material; 0 for none.
      has_density = .false.
      if (m > 0) has_density = material(m)%density > 0 .or. len(material(m)%density_formula) > 0
    end function has_density
  end subroutine check_densities

  !> Read all of them, for each body that a group names.
  subroutine read_supports(groups, input, support)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(support_input_t), allocatable, intent(out) :: support(:)  !! Supports, then springs (n_supports).
    type(support_input_t), allocatable :: given(:)
    integer, allocatable :: supports(:), springs(:), picked(:), matched(:), group_of(:), body_of(:)
    integer :: i
    call pick_groups(groups, 'support', supports)
    call pick_groups(groups, 'spring', springs)
    picked = [supports, springs]
    allocate (given(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_support(groups(picked(i)), input, given(i), matched)
      call append_places(i, matched, group_of, body_of)
    end do
    allocate (support(size(group_of)))
    do i = 1, size(group_of)
      support(i) = given(group_of(i))
      support(i)%body = body_of(i)
    end do
  end subroutine read_supports

  !> Read one of them.
  subroutine read_support(group, input, support, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(support_input_t), intent(out) :: support  !! The support, without a body; incomplete if the group is wrong.
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that the group names, ascending (n_matched).
    character(:), allocatable :: message
    call input%begin_action(group, support, matched)
    allocate (support%value_formula(0))
    support%is_spring = group%name == 'spring'
    call need_place(input, group)
    if (support%is_spring) then
      call input%refuse_both(group, 'modulus', 'stiffness')
      if (.not. (group%is_given('modulus') .or. group%is_given('stiffness'))) &
        call input%add(group%line, '&spring: one of modulus (per area) and stiffness (total) is needed')
      support%modulus = group%real_of('modulus')
      support%stiffness = group%real_of('stiffness')
    else
      call input%refuse_both(group, 'value', 'value_formula')
      if (group%is_given('case') .and. .not. (group%is_given('value') .or. group%is_given('value_formula'))) &
        call input%report(group, 'case', 'case is that of value, which is missing: what is held is the same in '// &
                          'all load cases (for value = 0 in this one and another value elsewhere, give value)')
    end if
    if (.not. group%is_usable('fix')) return
    call support%fix%parse(group%text_of('fix'), input%scene%dimension, message)
    if (len(message) > 0) then
      call input%report(group, 'fix', 'fix: '//message)
      return
    end if
    if (support%fix%local .and. input%scene%dimension > 0 .and. &
        support%place%dimension < input%scene%dimension - 1) &
      call input%report(group, 'fix', 'fix: edges and nodes have no normal: give directions of '// &
                        trim(merge('xyz', 'xy ', input%scene%dimension == 3)))
    call read_vector(group, input, 'value', support%fix%local, support%value)
    call read_formulas(group, input, 'value_formula', support%fix%local, support%value_formula)
    call refuse_values_not_fixed(group, input, support)
  end subroutine read_support

  !> Report values in directions without prescribed displacement.
  subroutine refuse_values_not_fixed(group, input, support)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(support_input_t), intent(in) :: support  !! The support, with directions and values.
    character(:), allocatable :: name
    integer :: i
    do i = 1, 3
      if (support%fix%fixed(i)) cycle
      name = support%fix%name(i)
      if (abs(support%value(i)) > 0) &
        call input%report(group, 'value', 'value has '//name//' = '//to_text(support%value(i))// &
                          ', but fix does not name '//name)
      if (size(support%value_formula) == 0) cycle
      if (support%value_formula(i)%s /= '0') &
        call input%report(group, 'value_formula', 'value_formula has '//name//' = '// &
                          shown(support%value_formula(i)%s)//', but fix does not name '//name//' (write ''0'')')
    end do
  end subroutine refuse_values_not_fixed

  !> Read all `&temperature`.
  subroutine read_temperatures(groups, input, body, material, temperature)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! The bodies (n_bodies).
    type(material_input_t), intent(in) :: material(:)  !! The materials (n_materials).
    type(field_input_t), allocatable, intent(out) :: temperature(:)  !! For each body named (n_temperatures).
    integer :: i, k
    call read_fields(groups, input, 'temperature', temperature)
    do i = 1, size(temperature)
      associate (b => temperature(i)%body)
        if (b == 0) cycle
        do k = 1, size(body(b)%material)
          associate (m => body(b)%material(k))
            if (m == 0) cycle
            if (.not. material(m)%expands) &
              call input%add(temperature(i)%line, '&temperature: the material '//shown(material(m)%name)// &
                             ' of body '//shown(body(b)%name)//' has no expansion')
          end associate
        end do
      end associate
    end do
  end subroutine read_temperatures

  !> Read all `&initial_stress`.
  subroutine read_initial_stresses(groups, input, initial_stress)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(field_input_t), allocatable, intent(out) :: initial_stress(:)  !! For each body named (n_initial_stresses).
    character(2), parameter :: name(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'xz']
    logical :: is_zero
    integer :: i, k
    call read_fields(groups, input, 'initial_stress', initial_stress)
    if (input%scene%dimension /= 2) return
    do i = 1, size(initial_stress)
      if (i > 1) then
        if (initial_stress(i)%line == initial_stress(i - 1)%line) cycle
      end if
      do k = 3, 6
        if (k == 4 .or. (k == 3 .and. input%scene%analysis /= analysis_plane_stress)) cycle
        is_zero = .not. abs(initial_stress(i)%value(k)) > 0
        if (size(initial_stress(i)%formula) > 0) is_zero = initial_stress(i)%formula(k)%s == '0'
        if (.not. is_zero) &
          call input%add(initial_stress(i)%line, '&initial_stress: the component '//name(k)//' must be 0 in '// &
                         trim(merge('plane stress  ', 'two dimensions', k == 3)))
      end do
    end do
  end subroutine read_initial_stresses

  !> Read all groups of one name; a body that two of them name is reported.
  subroutine read_fields(groups, input, name, field)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: name  !! Name of the groups.
    type(field_input_t), allocatable, intent(out) :: field(:)  !! One for each body that a group names (n_fields).
    type(field_input_t), allocatable :: of_group(:)
    integer, allocatable :: picked(:), matched(:), group_of(:), body_of(:)
    integer :: i, j, k
    call pick_groups(groups, name, picked)
    allocate (of_group(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call read_field(group, input, of_group(i), matched)
        twice: do k = 1, size(matched)
          do j = 1, size(body_of)
            if (body_of(j) /= matched(k)) cycle
            if (.not. share_a_case(of_group(i)%in_case, of_group(group_of(j))%in_case)) cycle
            call input%report(group, 'body', 'a second &'//name//' of body '//shown(input%bodies%name(matched(k))%s)// &
                              trim(merge(' in one load case', '                 ', size(input%cases%name) > 0))// &
                              ' (the first is in line '//to_text(of_group(group_of(j))%line)//')')
            exit twice
          end do
        end do twice
        call append_places(i, matched, group_of, body_of)
      end associate
    end do
    allocate (field(size(group_of)))
    do i = 1, size(group_of)
      field(i) = of_group(group_of(i))
      field(i)%body = body_of(i)
    end do
  end subroutine read_fields

  !> Read value or formula of one group.
  subroutine read_field(group, input, field, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(field_input_t), intent(out) :: field  !! The field, without a body; incomplete where the group has mistakes.
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that the group names, ascending (n_matched).
    call input%begin_action(group, field, matched)
    field%array = group%text_of('field')
    field%reference = group%real_of('reference')
    if (len(field%array) > 0) then
      call input%refuse(group, 'value', 'field')
      call input%refuse(group, 'formula', 'field')
    else if (group%is_given('reference')) then
      call input%report(group, 'reference', 'reference is for a field: value and formula are above that of the '// &
                        'unstressed body')
    end if
    call input%refuse_both(group, 'value', 'formula')
    if (.not. (group%is_given('value') .or. group%is_given('formula') .or. len(field%array) > 0)) &
      call input%add(group%line, '&'//group%name//': ''value'' or ''formula'' is missing')
    call group%read_numbers('value', field%value)
    call group%texts_of('formula', field%formula)
  end subroutine read_field
end module dotyk_input_loads
