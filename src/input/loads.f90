!> Reads `&load` and `&mass`, point masses, from checked groups.
!>
!> A mass acts by its weight and its centrifugal force: for each load of its body that is an acceleration or an angular
!> velocity it becomes a total load on the surface, with its moment about the point.
module dotyk_input_loads
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_acceleration, load_angular_velocity, load_force_density, &
    load_local_traction, load_names, load_pressure, load_total
  use dotyk_base_text, only: join, shown, split_words, text_t, to_text
  use dotyk_input_case, only: body_input_t, load_input_t, material_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: append_places, input_t
  use dotyk_input_vectors, only: read_formulas, read_vector
  implicit none
  private
  public :: read_loads

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
    !> Bodies that the group names, ascending; none where the name is unknown (n_matched).
    integer, allocatable, intent(out) :: matched(:)
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
      if (group%is_given('surface')) call input%report(group, 'surface', 'surface does not go together with '//key)
    else if (.not. group%is_given('surface')) then
      call input%add(group%line, '&load: ''surface'' is missing')
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
end module dotyk_input_loads
