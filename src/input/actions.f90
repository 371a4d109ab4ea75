!> What acts on the bodies of a namelist file: supports, springs, loads, masses, temperatures and initial stresses.
module dotyk_input_actions
  use dotyk_input_attachments, only: read_masses, read_springs
  use dotyk_input_body_fields, only: read_initial_stresses, read_temperatures
  use dotyk_input_boundary, only: append_places, check_densities, read_load, read_support
  use dotyk_input_case, only: case_t, load_input_t, support_input_t
  use dotyk_input_load_cases, only: cases_of
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: names_t, pick_groups
  implicit none
  private
  public :: read_actions

contains

  !> Read them, for each body that a group names.
  subroutine read_actions(groups, cases, bodies, problems, case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(names_t), intent(in) :: cases  !! Names of the load cases.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(case_t), intent(inout) :: case  !! The case with scene, materials and bodies; all else here is set.
    type(support_input_t), allocatable :: support(:)
    type(load_input_t), allocatable :: load(:)
    integer, allocatable :: picked(:), matched(:), group_of(:), body_of(:)
    integer :: i
    call pick_groups(groups, 'support', picked)
    allocate (support(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_support(groups(picked(i)), bodies, case%scene%dimension, problems, support(i), matched)
      call cases_of(groups(picked(i)), cases, problems, support(i)%in_case)
      call append_places(i, matched, group_of, body_of)
    end do
    allocate (case%support(size(group_of)))
    do i = 1, size(group_of)
      case%support(i) = support(group_of(i))
      case%support(i)%body = body_of(i)
    end do
    deallocate (group_of, body_of)
    call read_springs(groups, bodies, case%scene%dimension, problems, case%support)
    call pick_groups(groups, 'load', picked)
    allocate (load(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_load(groups(picked(i)), bodies, case%scene, problems, load(i), matched)
      call cases_of(groups(picked(i)), cases, problems, load(i)%in_case)
      call append_places(i, matched, group_of, body_of)
    end do
    allocate (case%load(size(group_of)))
    do i = 1, size(group_of)
      case%load(i) = load(group_of(i))
      case%load(i)%body = body_of(i)
    end do
    call read_masses(groups, bodies, case%scene, problems, case%load)
    call check_densities(case%load, case%body, case%material, problems)
    deallocate (group_of, body_of)
    call read_temperatures(groups, cases, bodies, case%body, case%material, problems, case%temperature)
    call read_initial_stresses(groups, cases, bodies, case%scene, problems, case%initial_stress)
  end subroutine read_actions
end module dotyk_input_actions
