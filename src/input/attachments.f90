!> Reads what is attached to surfaces from checked groups: `&spring`, supports that yield, and `&mass`, point masses.
!>
!> A mass acts by its weight and its centrifugal force: for each load of its body that is an acceleration or an angular
!> velocity it becomes a total load on the surface, with its moment about the point.
module dotyk_input_attachments
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_acceleration, load_angular_velocity, load_total
  use dotyk_base_text, only: shown, to_text
  use dotyk_input_boundary, only: read_vector
  use dotyk_input_case, only: load_input_t, scene_input_t, support_input_t
  use dotyk_input_keywords, only: keyword_list_t, kind_real, kind_text
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_rigid_bodies, only: add_rigid_keys, read_rigid_bodies
  use dotyk_input_values, only: is_given, is_usable, names_t, pick_groups, real_of, report, text_of
  use dotyk_input_wildcards, only: append_places, names_several, refer_to_bodies
  implicit none
  private
  public :: add_mass_keys, add_rigid_keys, add_spring_keys, read_masses, read_rigid_bodies, read_springs

contains

  !> Keys of `&spring`.
  pure subroutine add_spring_keys(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('spring')
    call list%add('body', kind_text, required=.true., &
                  meaning='name of the body, with wildcards as in &support')
    call list%add('surface', kind_text, required=.true., &
                  meaning='physical group of the surface, with wildcards as in &support')
    call list%add('fix', kind_text, required=.true., &
                  meaning='directions of the springs, as in &support: letters of xyz, or of n, t, xi, eta')
    call list%add('modulus', kind_real, unit='pressure/length', positive=.true., &
                  meaning='stiffness per area of each direction: the modulus of a Winkler foundation')
    call list%add('stiffness', kind_real, unit='force/length', positive=.true., &
                  meaning='total stiffness of each direction in place of modulus, spread evenly over the area of '// &
                  'the surface; in the plane per unit thickness, in axisymmetric analyses on the full '// &
                  'circumference. Of several bodies each gets it; with wildcards in surface it is that of all '// &
                  'surfaces of a body together, as the log shows')
    call list%add('value', kind_real, least=2, most=3, unit='length', &
                  meaning='displacement of the far ends of the springs, as value of &support; at rest if absent')
  end subroutine add_spring_keys

  !> Read all `&spring` and append them to the supports.
  subroutine read_springs(groups, bodies, dimension, problems, support)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3; 0 where it is unknown.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(support_input_t), allocatable, intent(inout) :: support(:)  !! Supports, added to (n_supports).
    type(support_input_t), allocatable :: spring(:), all(:)
    integer, allocatable :: picked(:), matched(:), group_of(:), body_of(:)
    integer :: i, n
    call pick_groups(groups, 'spring', picked)
    if (size(picked) == 0) return
    allocate (spring(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_spring(groups(picked(i)), bodies, dimension, problems, spring(i), matched)
      call append_places(i, matched, group_of, body_of)
    end do
    n = size(support)
    allocate (all(n + size(group_of)))
    do i = 1, n
      all(i) = support(i)
    end do
    do i = 1, size(group_of)
      all(n + i) = spring(group_of(i))
      all(n + i)%body = body_of(i)
    end do
    call move_alloc(all, support)
  end subroutine read_springs

  !> Read one `&spring`.
  subroutine read_spring(group, bodies, dimension, problems, spring, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3; 0 where it is unknown.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> The spring, without a body; incomplete where the group has mistakes.
    type(support_input_t), intent(out) :: spring
    !> Bodies that the group names, ascending; none where the name is unknown (n_matched).
    integer, allocatable, intent(out) :: matched(:)
    character(:), allocatable :: message, name
    integer :: i
    spring%line = group%line
    spring%is_spring = .true.
    call refer_to_bodies(group, 'body', text_of(group, 'body'), bodies, problems, matched)
    spring%any_body = names_several(text_of(group, 'body'), bodies)
    spring%surface = text_of(group, 'surface')
    allocate (spring%value_formula(0))
    if (is_given(group, 'modulus') .eqv. is_given(group, 'stiffness')) then
      if (is_given(group, 'modulus')) then
        call report(problems, group, 'stiffness', 'modulus and stiffness are both given: only one can be meant')
      else
        call problems%add(group%line, '&spring: one of modulus (per area) and stiffness (total) is needed')
      end if
    end if
    if (is_usable(group, 'modulus')) spring%modulus = real_of(group, 'modulus')
    if (is_usable(group, 'stiffness')) spring%stiffness = real_of(group, 'stiffness')
    if (.not. is_usable(group, 'fix')) return
    call spring%fix%parse(text_of(group, 'fix'), dimension, message)
    if (len(message) > 0) then
      call report(problems, group, 'fix', 'fix: '//message)
      return
    end if
    call read_vector(group, 'value', spring%fix%local, dimension, problems, spring%value)
    do i = 1, 3
      if (spring%fix%fixed(i) .or. .not. abs(spring%value(i)) > 0) cycle
      name = spring%fix%name(i)
      call report(problems, group, 'value', 'value has '//name//' = '//to_text(spring%value(i))// &
                  ', but fix does not name '//name)
    end do
  end subroutine read_spring

  !> Keys of `&mass`.
  pure subroutine add_mass_keys(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('mass')
    call list%add('body', kind_text, required=.true., &
                  meaning='name of the body, with wildcards as in &support; a &load acceleration or '// &
                  'angular_velocity acts on it')
    call list%add('surface', kind_text, required=.true., &
                  meaning='physical group of the surface that carries the mass, with wildcards as in &support: the '// &
                  'force is spread as that of &load force')
    call list%add('mass', kind_real, unit='mass', required=.true., positive=.true., &
                  meaning='the mass; in the plane per unit thickness. Of several bodies each has it')
    call list%add('point', kind_real, least=2, most=3, unit='length', &
                  meaning='where the mass is, on the surface or away from it; the centroid of the surface if '// &
                  'absent, required where the body rotates; in axisymmetry on the axis')
  end subroutine add_mass_keys

  !> Read all `&mass` and append their forces to the loads.
  subroutine read_masses(groups, bodies, scene, problems, load)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its dimension and analysis.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(load_input_t), allocatable, intent(inout) :: load(:)  !! Loads, added to (n_loads).
    type(load_input_t) :: of_mass
    integer, allocatable :: picked(:), matched(:)
    real(dp) :: mass
    integer :: b, i, k, n
    call pick_groups(groups, 'mass', picked)
    n = size(load)
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call refer_to_bodies(group, 'body', text_of(group, 'body'), bodies, problems, matched)
        of_mass%line = group%line
        of_mass%any_body = names_several(text_of(group, 'body'), bodies)
        of_mass%surface = text_of(group, 'surface')
        of_mass%kind = load_total
        of_mass%of_mass = .true.
        if (.not. allocated(of_mass%formula)) allocate (of_mass%formula(0))
        of_mass%has_point = is_usable(group, 'point')
        call read_vector(group, 'point', .false., scene%dimension, problems, of_mass%point)
        mass = 0
        if (is_usable(group, 'mass')) mass = real_of(group, 'mass')
        if (scene%analysis == analysis_axisymmetric .and. abs(of_mass%point(1)) > 0) &
          call report(problems, group, 'point', 'point: in axisymmetric analyses a mass is on the axis: point = 0, y')
        do b = 1, size(matched)
          of_mass%body = matched(b)
          k = size(load)
          call add_forces(group, n, mass, of_mass, scene%analysis, problems, load)
          if (size(load) == k) &
            call problems%add(group%line, '&mass: no &load acceleration or angular_velocity acts on body '// &
                              shown(bodies%name(matched(b))%s)//': the mass has no force')
        end do
      end associate
    end do
  end subroutine read_masses

  !> Append the forces of a mass on one body.
  subroutine add_forces(group, n, mass, of_mass, analysis, problems, load)
    type(group_t), intent(in) :: group  !! `&mass`.
    integer, intent(in) :: n  !! Number of `&load`.
    real(dp), intent(in) :: mass  !! The mass [mass].
    type(load_input_t), intent(inout) :: of_mass  !! The total load, but for its force.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(load_input_t), allocatable, intent(inout) :: load(:)  !! Loads, added to (n_loads).
    real(dp) :: arm(3)
    integer :: k
    do k = 1, n
      if (load(k)%body /= of_mass%body) cycle
      if (load(k)%kind == load_acceleration) then
        of_mass%value = mass*load(k)%value
      else if (load(k)%kind == load_angular_velocity) then
        if (.not. is_given(group, 'point') .and. analysis /= analysis_axisymmetric) &
          call problems%add(group%line, '&mass: point is needed for the centrifugal force of the &load in line '// &
                            to_text(load(k)%line))
        arm = of_mass%point - load(k)%centre
        of_mass%value = 0
        ! On the axis of an axisymmetric body there is none.
        if (analysis /= analysis_axisymmetric) &
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
end module dotyk_input_attachments
