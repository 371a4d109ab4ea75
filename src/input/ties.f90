!> Reads `&tie` and `&bolt` from checked groups.
module dotyk_input_ties
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, option_name, response_multigrid, response_names, scheme_auto, &
    scheme_dual, scheme_names
  use dotyk_base_text, only: quoted, shown
  use dotyk_input_case, only: scene_input_t, solver_input_t, tie_input_t
  use dotyk_input_contacts, only: read_side
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: is_given, is_usable, names_t, pick_groups, real_of, reals_of, report, text_of
  implicit none
  private
  public :: read_ties

contains

  !> Read all `&tie`, then all `&bolt`.
  subroutine read_ties(groups, bodies, scene, solver, problems, tie)
    !> Groups of the file (n_groups).
    type(group_t), intent(in) :: groups(:)
    !> Names of the bodies.
    type(names_t), intent(in) :: bodies
    !> The scene, for its analysis.
    type(scene_input_t), intent(in) :: scene
    !> Settings of the solver.
    type(solver_input_t), intent(in) :: solver
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> Ties and bolts; incomplete where groups have mistakes (n_ties).
    type(tie_input_t), allocatable, intent(out) :: tie(:)
    integer, allocatable :: ties(:), bolts(:)
    integer :: i
    call pick_groups(groups, 'tie', ties)
    call pick_groups(groups, 'bolt', bolts)
    allocate (tie(size(ties) + size(bolts)))
    do i = 1, size(ties)
      call read_sides(groups(ties(i)), bodies, is_given(groups(ties(i)), 'angle'), problems, tie(i))
      call read_turn(groups(ties(i)), scene, problems, tie(i))
    end do
    do i = 1, size(bolts)
      associate (bolt => tie(size(ties) + i))
        call read_sides(groups(bolts(i)), bodies, .false., problems, bolt)
        call read_tension(groups(bolts(i)), problems, bolt)
      end associate
    end do
    if (size(tie) == 0) return
    if (all(solver%scheme /= [scheme_auto, scheme_dual])) &
      call problems%add(solver%line, '&solver: scheme='//quoted(option_name(scheme_names, solver%scheme))// &
                        ' knows no ties: leave it out')
    if (solver%response == response_multigrid) &
      call problems%add(solver%line, '&solver: response='//quoted(option_name(response_names, solver%response))// &
                        ' knows no ties: leave it out')
  end subroutine read_ties

  !> Read name, surfaces and search distance.
  subroutine read_sides(group, bodies, may_be_one, problems, tie)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Names of the bodies.
    type(names_t), intent(in) :: bodies
    !> Whether both surfaces may be those of one body.
    logical, intent(in) :: may_be_one
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The tie.
    type(tie_input_t), intent(out) :: tie
    integer, allocatable :: matched_a(:), matched_b(:)
    logical :: several_a, several_b
    tie%line = group%line
    tie%name = text_of(group, 'name')
    call read_side(group, 'surface_a', bodies, problems, matched_a, tie%surface_a, several_a)
    call read_side(group, 'surface_b', bodies, problems, matched_b, tie%surface_b, several_b)
    if (several_a) call report(problems, group, 'surface_a', 'surface_a of &'//group%name//' names one body, '// &
                               'without wildcards')
    if (several_b) call report(problems, group, 'surface_b', 'surface_b of &'//group%name//' names one body, '// &
                               'without wildcards')
    if (size(matched_a) > 0) tie%body_a = matched_a(1)
    if (size(matched_b) > 0) tie%body_b = matched_b(1)
    if (tie%body_a > 0 .and. tie%body_a == tie%body_b .and. .not. may_be_one) &
      call report(problems, group, 'surface_b', '&'//group%name//' needs two different bodies, got '// &
                  shown(bodies%name(tie%body_a)%s)//' twice')
    if (tie%body_a > 0 .and. tie%body_a == tie%body_b .and. tie%surface_a == tie%surface_b) &
      call report(problems, group, 'surface_b', 'surface_a and surface_b are the same surface')
    if (is_usable(group, 'search_radius')) tie%search_radius = real_of(group, 'search_radius')
  end subroutine read_sides

  !> Read the rotation of the master side.
  subroutine read_turn(group, scene, problems, tie)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> The scene, for its analysis.
    type(scene_input_t), intent(in) :: scene
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The tie; gets the rotation.
    type(tie_input_t), intent(inout) :: tie
    real(dp), allocatable :: numbers(:)
    tie%angle = real_of(group, 'angle')
    if (is_usable(group, 'axis')) then
      call reals_of(group, 'axis', numbers)
      tie%axis = numbers
      if (.not. any(abs(numbers) > 0)) call report(problems, group, 'axis', 'axis has no direction')
      if (scene%dimension == 2 .and. any(abs(numbers(:2)) > 0)) &
        call report(problems, group, 'axis', 'in two dimensions surfaces are rotated about z')
    end if
    if (is_usable(group, 'centre')) then
      call reals_of(group, 'centre', numbers)
      tie%centre(:size(numbers)) = numbers
    end if
    if (.not. is_given(group, 'angle')) then
      if (is_given(group, 'axis')) call report(problems, group, 'axis', 'axis is given without an angle')
      if (is_given(group, 'centre')) call report(problems, group, 'centre', 'centre is given without an angle')
    else if (scene%analysis == analysis_axisymmetric) then
      call report(problems, group, 'angle', 'angle means nothing in axisymmetric analyses')
    end if
  end subroutine read_turn

  !> Read how far a bolt is tightened.
  subroutine read_tension(group, problems, bolt)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The bolt.
    type(tie_input_t), intent(inout) :: bolt
    bolt%is_bolt = .true.
    bolt%has_force = is_given(group, 'force')
    bolt%force = real_of(group, 'force')
    bolt%shortening = real_of(group, 'shortening')
    if (bolt%has_force .and. is_given(group, 'shortening')) then
      call report(problems, group, 'shortening', 'force and shortening are both given: only one can be meant')
    else if (.not. (bolt%has_force .or. is_given(group, 'shortening'))) then
      call problems%add(group%line, '&bolt: ''force'' or ''shortening'' is missing')
    end if
  end subroutine read_tension
end module dotyk_input_ties
