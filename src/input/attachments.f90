!> Reads what is attached to surfaces from checked groups: `&spring`, supports that yield, and `&mass`, point masses.
!>
!> A mass acts by its weight and its centrifugal force: for each load of its body that is an acceleration or an angular
!> velocity it becomes a total load on the surface, with its moment about the point.
module dotyk_input_attachments
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_acceleration, load_angular_velocity, load_total
  use dotyk_base_text, only: shown, to_text
  use dotyk_input_boundary, only: read_vector
  use dotyk_input_case, only: load_input_t, support_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: append_places, input_t, names_several
  implicit none
  private
  public :: read_masses, read_springs

contains

  !> Read all `&spring` and append them to the supports.
  subroutine read_springs(groups, input, support)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(support_input_t), allocatable, intent(inout) :: support(:)  !! Supports, added to (n_supports).
    type(support_input_t), allocatable :: spring(:), all(:)
    integer, allocatable :: picked(:), matched(:), group_of(:), body_of(:)
    integer :: i, n
    call pick_groups(groups, 'spring', picked)
    if (size(picked) == 0) return
    allocate (spring(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_spring(groups(picked(i)), input, spring(i), matched)
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
  subroutine read_spring(group, input, spring, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    !> The spring, without a body; incomplete where the group has mistakes.
    type(support_input_t), intent(out) :: spring
    !> Bodies that the group names, ascending; none where the name is unknown (n_matched).
    integer, allocatable, intent(out) :: matched(:)
    character(:), allocatable :: message, name
    integer :: i
    spring%line = group%line
    spring%is_spring = .true.
    call input%refer_to_bodies(group, 'body', group%text_of('body'), matched)
    spring%any_body = names_several(group%text_of('body'), input%bodies)
    spring%surface = group%text_of('surface')
    allocate (spring%value_formula(0))
    if (group%is_given('modulus') .eqv. group%is_given('stiffness')) then
      if (group%is_given('modulus')) then
        call input%report(group, 'stiffness', 'modulus and stiffness are both given: only one can be meant')
      else
        call input%add(group%line, '&spring: one of modulus (per area) and stiffness (total) is needed')
      end if
    end if
    if (group%is_usable('modulus')) spring%modulus = group%real_of('modulus')
    if (group%is_usable('stiffness')) spring%stiffness = group%real_of('stiffness')
    if (.not. group%is_usable('fix')) return
    call spring%fix%parse(group%text_of('fix'), input%scene%dimension, message)
    if (len(message) > 0) then
      call input%report(group, 'fix', 'fix: '//message)
      return
    end if
    call read_vector(group, input, 'value', spring%fix%local, spring%value)
    do i = 1, 3
      if (spring%fix%fixed(i) .or. .not. abs(spring%value(i)) > 0) cycle
      name = spring%fix%name(i)
      call input%report(group, 'value', 'value has '//name//' = '//to_text(spring%value(i))// &
                        ', but fix does not name '//name)
    end do
  end subroutine read_spring

  !> Read all `&mass` and append their forces to the loads.
  subroutine read_masses(groups, input, load)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), allocatable, intent(inout) :: load(:)  !! Loads, added to (n_loads).
    type(load_input_t) :: of_mass
    integer, allocatable :: picked(:), matched(:)
    real(dp) :: mass
    integer :: b, i, k, n
    call pick_groups(groups, 'mass', picked)
    n = size(load)
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call input%refer_to_bodies(group, 'body', group%text_of('body'), matched)
        of_mass%line = group%line
        of_mass%any_body = names_several(group%text_of('body'), input%bodies)
        of_mass%surface = group%text_of('surface')
        of_mass%kind = load_total
        of_mass%of_mass = .true.
        if (.not. allocated(of_mass%formula)) allocate (of_mass%formula(0))
        of_mass%has_point = group%is_usable('point')
        call read_vector(group, input, 'point', .false., of_mass%point)
        mass = 0
        if (group%is_usable('mass')) mass = group%real_of('mass')
        if (input%scene%analysis == analysis_axisymmetric .and. abs(of_mass%point(1)) > 0) &
          call input%report(group, 'point', 'point: in axisymmetric analyses a mass is on the axis: point = 0, y')
        do b = 1, size(matched)
          of_mass%body = matched(b)
          k = size(load)
          call add_forces(group, input, n, mass, of_mass, load)
          if (size(load) == k) &
            call input%add(group%line, '&mass: no &load acceleration or angular_velocity acts on body '// &
                           shown(input%bodies%name(matched(b))%s)//': the mass has no force')
        end do
      end associate
    end do
  end subroutine read_masses

  !> Append the forces of a mass on one body.
  subroutine add_forces(group, input, n, mass, of_mass, load)
    type(group_t), intent(in) :: group  !! `&mass`.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    integer, intent(in) :: n  !! Number of `&load`.
    real(dp), intent(in) :: mass  !! The mass [mass].
    type(load_input_t), intent(inout) :: of_mass  !! The total load, but for its force.
    type(load_input_t), allocatable, intent(inout) :: load(:)  !! Loads, added to (n_loads).
    real(dp) :: arm(3)
    integer :: k
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
end module dotyk_input_attachments
