!> From the input to a contact problem: bodies, pairs, ties and their rows, and the choice whether ranks compute the
!> bodies together.
module dotyk_driver_scene_building
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_kinds, only: int64
  use dotyk_base_memory, only: peak_memory, set_stage
  use dotyk_base_options, only: analysis_3d, last_linear_quantity, response_auto, response_multigrid
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_contact_problem, only: build_rows, contact_problem_t
  use dotyk_control_factorization, only: analyze_bodies
  use dotyk_control_response_choice, only: choose_forms, form_direct, form_multigrid, form_split, large, suits_multigrid
  use dotyk_control_seams, only: pair_of_other_roles
  use dotyk_driver_run_settings, only: may_use_multigrid
  use dotyk_driver_scene, only: scene_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_rigid_motion, only: free_rigid_modes
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_assemble, stage_order, stage_read, stage_search
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_assembly, only: assemble_bodies, check_held
  use dotyk_model_body_setup, only: build_bodies
  use dotyk_model_body_surfaces, only: body_surfaces_t, hold_parts
  use dotyk_model_contact_cases, only: check_contact_cases
  use dotyk_model_dealt_bodies, only: build_dealt_bodies
  use dotyk_model_joints, only: refuse_doubles
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_model_pair_search, only: search_pair
  use dotyk_model_pairs, only: add_met_pairs, find_pairs
  use dotyk_model_part_files, only: part_files_t
  use dotyk_model_quantities, only: find_quantities
  use dotyk_model_ties, only: find_ties
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_division, only: division_t
  use dotyk_ranks_exchange, only: agree_on_error, gather_all, meet, on_any_rank
  use dotyk_scheme_scheme, only: reason_none, reason_parts, scheme_t
  use dotyk_split_split_scene, only: can_split
  implicit none
  private
  public :: build_scene, scene_t, make_parts

  !> Floating bodies at most that are split: the coarse level does not know the motions of each, and needs hundreds of
  !> iterations for networks of more.
  integer, parameter :: most_floating = 15

contains

  !> Meshes to bodies, contact rows, and the sizes of the factors: all that can be checked before anything is solved.
  subroutine build_scene(case, scheme, may_split, met, scene, monitor, reason, error)
    type(case_t), intent(inout) :: case  !! The case; its contacts become the pairs that they stand for.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the run.
    logical, intent(in) :: may_split  !! Whether several ranks may compute a body together.
    type(met_point_t), intent(in) :: met(:)  !! Points at which bodies met beside their contact rows before (n).
    type(scene_t), intent(out) :: scene  !! The scene: bodies, contact pairs, sizes of the factors.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> `reason_parts` where the ranks have parts of bodies that are not to be split: the scene is to be built anew,
    !> without; `reason_none` otherwise.
    integer, intent(out) :: reason
    !> Allocated where a mesh, a material, a support, a load or a pair is wrong; names file and line.
    type(error_t), allocatable, intent(out) :: error
    type(text_t), allocatable :: remarks(:)
    integer, allocatable :: form(:)
    type(body_surfaces_t), allocatable :: surfaces(:)
    logical :: splits, in_parts, are_dealt
    integer :: i
    reason = reason_none
    associate (problem => scene%problem)
      call refuse_doubles(case, error)
      if (allocated(error)) return
      call set_stage('reading meshes')
      call read_bodies(case, may_split, problem, surfaces, remarks, in_parts, are_dealt, error)
      if (.not. allocated(problem%body)) return
      ! A scene that is built anew has told them already: only then its bodies may not be split.
      if (may_split) then
        do i = 1, size(remarks)
          call monitor%log%line('  '//remarks(i)%s)
        end do
      end if
      call meet()
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%lap(stage_read)
      if (in_parts) call problem%classes%init(size(problem%body))
      if (.not. (in_parts .or. are_dealt)) call problem%classes%find(problem%body)
      if (scheme%is_iteration()) call check_held(case, problem%body, problem%classes, problem%ranks, error)
      if (allocated(error)) return
      call set_stage('assembling')
      call choose_solution(case, problem%body, problem%classes, in_parts, monitor, form, splits)
      if (in_parts .and. .not. splits) reason = reason_parts
      if (reason /= reason_none) return
      if (splits) call problem%classes%init(size(problem%body))
      if (.not. are_dealt) then
        call problem%ranks%init(problem%body, problem%classes, splits)
        call hold_parts(problem%classes, problem%ranks, problem%body, surfaces, problem%modes)
      end if
      monitor%timing%memory_of_bodies = peak_memory()
      call assemble_bodies(case, problem%classes, problem%ranks, form, problem%body, problem%modes, scene%stiffness, &
                           scene%slot, error)
      if (splits .and. .not. allocated(error)) call scene%split%assemble(problem%body, problem%modes, error)
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%lap(stage_assemble)
      call set_stage('searching for contact')
      call build_contact(case, surfaces, met, scene, error)
      if (allocated(error)) return
      call find_quantities(case, surfaces, problem, scene%quantity, error)
      if (allocated(error)) return
      call monitor%lap(stage_search)
      call set_stage('ordering the equations')
      call analyze_bodies(problem%body, problem%modes, scene%stiffness, problem%classes, problem%ranks, &
                          scene%operator%block, case%solver%response, scheme%expected_products(), scene%slot, &
                          scene%size_of, error)
      if (splits .and. allocated(scene%size_of)) scene%size_of%form = form_split
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%lap(stage_order)
    end associate
  end subroutine build_scene

  !> Find contact pairs and ties, and make their rows.
  subroutine build_contact(case, surfaces, met, scene, error)
    type(case_t), intent(inout) :: case  !! The case; its contacts become the pairs that they stand for.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(met_point_t), intent(in) :: met(:)  !! Points at which bodies met beside their contact rows before (n).
    type(scene_t), intent(inout) :: scene  !! The scene with its bodies; gets pairs, ties and rows.
    type(error_t), allocatable, intent(out) :: error  !! Where a pair, tie or case is wrong, or on an interrupt.
    integer :: i
    associate (problem => scene%problem)
      call find_pairs(case, problem%body, surfaces, problem%surface_a, problem%surface_b, problem%pair, problem%found, &
                      error)
      call meet()
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call find_ties(case, problem%body, surfaces, problem%pair, problem%surface_a, problem%surface_b, problem%tie, &
                     error)
      if (.not. allocated(error)) call align_roles(case, problem, error)
      if (.not. allocated(error)) call add_met_pairs(case, met, problem%body, problem%surface_a, problem%surface_b, &
                                                     problem%pair, error)
      if (.not. allocated(error)) call check_contact_cases(case, problem, scene%pair_conditions, error)
      if (allocated(error)) return
      call build_rows(problem, case%scene%dimension, scene%operator, divided=n_ranks() > 1)
      do i = 1, size(problem%body)
        associate (block => scene%operator%block(i))
          if (n_ranks() > 1) block%whole_node = problem%body(i)%mesh%whole_nodes(block%contact_node)
        end associate
      end do
    end associate
  end subroutine build_contact

  !> Exchange the sides of a pair in which contact goes on across a tie with other roles: both tied bodies are slaves of
  !> the third one then, and their pressures one function. Rigid bodies remain masters.
  subroutine align_roles(case, problem, error)
    type(case_t), intent(inout) :: case  !! The case, with one contact for each pair.
    type(contact_problem_t), intent(inout) :: problem  !! With pairs and ties.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the pair cannot be discretized; names the line.
    type(surface_t) :: surface
    logical :: is_exchanged(size(problem%pair))
    integer :: k, p, q
    is_exchanged = .false.
    ! Pairs may be divided over ranks.
    if (n_ranks() > 1) return
    do k = 1, problem%n_ties()
      do p = 1, size(problem%pair)
        q = pair_of_other_roles(problem%pair, problem%tie(k), p)
        if (q == 0 .or. is_exchanged(p)) cycle
        if (is_exchanged(q) .or. problem%body(problem%pair(q)%body_b)%constraint%rigid%is_set) cycle
        is_exchanged(q) = .true.
        call case%contact(q)%exchange()
        surface = problem%surface_a(q)
        problem%surface_a(q) = problem%surface_b(q)
        problem%surface_b(q) = surface
        associate (given => case%contact(q))
          call search_pair(case, given, problem%body(given%body_a), problem%surface_a(q), problem%body(given%body_b), &
                           problem%surface_b(q), division_t(), problem%pair(q), error)
          if (allocated(error)) call add_context(error, case%file//':'//to_text(given%line)//': ')
        end associate
        if (allocated(error)) return
        problem%pair(q)%other_roles = problem%tie(k)%name
      end do
    end do
  end subroutine align_roles

  !> How the bodies are solved, and whether ranks compute them together.
  subroutine choose_solution(case, body, classes, may_split, monitor, form, splits)
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), intent(in) :: body(:)  !! Bodies with supports (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes.
    logical, intent(in) :: may_split  !! Whether several ranks may compute a body together.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets a line where not, although p-multigrid would be taken.
    integer, allocatable, intent(out) :: form(:)  !! One of `form_*` (n_bodies).
    logical, intent(out) :: splits  !! Whether the bodies are split over all ranks.
    form = choose_forms(body, classes, case%solver%response, may_use_multigrid(case), &
                        can_split() .or. any(case%quantity%kind <= last_linear_quantity))
    splits = can_split() .and. any(form == form_multigrid)
    ! Bodies that are split know no ties.
    if (splits .and. .not. (may_split .and. size(case%tie) == 0)) form(:) = form_direct
    ! A scene that is built anew has told already why.
    if (splits .and. case%n_cases() > 1) call note_factors('there are load cases', monitor)
    splits = splits .and. may_split .and. size(case%tie) == 0
    if (splits) call choose_split(body, monitor, form, splits)
  end subroutine choose_solution

  !> Split the bodies over all ranks, or leave each to one rank with its factor: not where the iterations would be too
  !> many, for nearly incompressible bodies and networks of many floating ones.
  subroutine choose_split(body, monitor, form, splits)
    type(body_t), intent(in) :: body(:)  !! Bodies with supports (n_bodies).
    type(log_monitor_t), intent(inout) :: monitor  !! Gets a line where they are not split.
    integer, intent(inout) :: form(:)  !! How the bodies are solved (n_bodies).
    logical, intent(out) :: splits  !! Whether they are split.
    character(:), allocatable :: reason, motions
    integer :: b, n_free, n_floating
    reason = ''
    n_floating = 0
    do b = 1, size(body)
      call free_rigid_modes(body(b), n_free, motions)
      if (n_free > 0) n_floating = n_floating + 1
      if (.not. suits_multigrid(body(b))) reason = quoted(body(b)%name)//' is nearly incompressible'
      if (body(b)%constraint%foundation%n > 0) reason = quoted(body(b)%name)//' has springs'
      if (body(b)%is_hinged) reason = 'edges or corners alone join pieces of '//quoted(body(b)%name)
      if (len(reason) > 0) exit
    end do
    if (n_floating > most_floating) reason = to_text(n_floating)//' bodies float'
    splits = len(reason) == 0
    form(:) = merge(form_split, form_direct, splits)
    if (.not. splits) call note_factors(reason, monitor)
  end subroutine choose_split

  !> Tell that each body has its factor on one rank.
  subroutine note_factors(reason, monitor)
    character(*), intent(in) :: reason  !! Why bodies are not split.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%note('factors          '//reason//': bodies are not split over ranks, each has its factor on one '// &
                      'of them')
  end subroutine note_factors

  !> Build the bodies of a scene.
  subroutine read_bodies(case, may_split, problem, surfaces, remarks, in_parts, are_dealt, error)
    type(case_t), intent(in) :: case  !! The case.
    logical, intent(in) :: may_split  !! Whether several ranks may compute a body together.
    !> Gets bodies; with `are_dealt` congruence classes, the ranks that compute the bodies, and rigid body modes, too.
    type(contact_problem_t), intent(inout) :: problem
    type(body_surfaces_t), allocatable, intent(out) :: surfaces(:)  !! Surfaces that pairs may need (n_bodies).
    type(text_t), allocatable, intent(out) :: remarks(:)  !! Lines for the log (n_remarks).
    logical, intent(out) :: in_parts  !! Whether each rank has a part of each body.
    logical, intent(out) :: are_dealt  !! Whether each rank has its own bodies, and the surfaces of others.
    type(error_t), allocatable, intent(out) :: error  !! Where meshes, materials, supports or loads are wrong.
    type(mesh_survey_t) :: survey
    type(part_files_t) :: parts
    are_dealt = .false.
    in_parts = .false.
    if (n_ranks() > 1) call survey%read(case)
    if (may_split .and. can_split()) then
      if (may_be_split(case) .and. are_maybe_large(case, survey)) call read_parts(case, parts, in_parts, error)
    end if
    if (allocated(error)) return
    if (in_parts) then
      call build_bodies(case, problem%body, surfaces, remarks, error, given=parts%volume)
      call agree_on_error(error)
      call move_alloc(parts%remark, remarks)
      return
    end if
    if (survey%is_known) &
      call build_dealt_bodies(case, survey, problem%body, surfaces, remarks, problem%classes, problem%ranks, &
                              problem%modes, are_dealt)
    if (are_dealt) then
      call put_first(survey%remark, remarks)
      return
    end if
    call build_bodies(case, problem%body, surfaces, remarks, error)
  end subroutine read_bodies

  !> Put what the log says of mesh files before what it says of bodies.
  pure subroutine put_first(first, remarks)
    type(text_t), intent(in) :: first(:)  !! Of the files (n_first).
    type(text_t), allocatable, intent(inout) :: remarks(:)  !! Of the bodies; all on return (n_remarks).
    type(text_t), allocatable :: all_of_them(:)
    allocate (all_of_them(size(first) + size(remarks)))
    all_of_them(:size(first)) = first
    all_of_them(size(first) + 1:) = remarks
    call move_alloc(all_of_them, remarks)
  end subroutine put_first

  !> Whether bodies of a case may be split over ranks, as far as the input tells.
  pure logical function may_be_split(case)
    type(case_t), intent(in) :: case  !! The case.
    may_be_split = may_use_multigrid(case) .and. size(case%tie) == 0 .and. case%n_cases() == 1 .and. &
                   any(case%solver%response == [response_auto, response_multigrid])
  end function may_be_split

  !> Whether a body may be large enough to be split.
  pure logical function are_maybe_large(case, survey) result(are_large)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    integer :: b
    are_large = case%solver%response == response_multigrid
    if (are_large .or. case%scene%analysis /= analysis_3d) return
    are_large = .not. survey%is_known
    if (are_large) return
    are_large = any([(case%scene%dimension*survey%most_nodes(b) > large, b=1, size(case%body))])
  end function are_maybe_large

  !> Read the part of this rank; the first rank makes the parts where there are none.
  subroutine read_parts(case, parts, in_parts, error)
    type(case_t), intent(in) :: case  !! The case.
    type(part_files_t), intent(out) :: parts  !! The part of this rank.
    logical, intent(out) :: in_parts  !! Whether there are parts: not of small bodies.
    type(error_t), allocatable, intent(out) :: error  !! Allocated on all ranks where something is wrong.
    type(parcel_t) :: parcel
    integer(int64), allocatable :: word(:)
    in_parts = .false.
    if (this_rank() == 0) then
      call parts%provide(case, n_ranks(), large, in_parts, error)
      if (in_parts) call parts%carry(parcel)
    end if
    call agree_on_error(error)
    if (allocated(error)) return
    in_parts = on_any_rank(in_parts)
    if (.not. in_parts) return
    ! All ranks read the files of the same key.
    call gather_all(parcel%words(), word)
    call parcel%open(word)
    call parts%carry(parcel)
    call parts%read(this_rank(), error)
    call agree_on_error(error)
  end subroutine read_parts

  !> Make the parts of a case before it is run.
  subroutine make_parts(case, n_parts, remarks, error)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: n_parts  !! Number of ranks of the runs.
    type(text_t), allocatable, intent(out) :: remarks(:)  !! Lines for the log (n_remarks).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where something is wrong.
    type(part_files_t) :: parts
    type(text_t) :: line(1)
    logical :: are_of_use
    are_of_use = .false.
    if (may_be_split(case)) call parts%provide(case, n_parts, large, are_of_use, error)
    if (allocated(error)) return
    if (.not. are_of_use) then
      line(1)%s = 'no body is split over ranks: the case needs no parts'
    else if (parts%are_made) then
      line(1)%s = to_text(n_parts)//' parts written: '//parts%path//'*.part'
    else
      line(1)%s = to_text(n_parts)//' parts are there: '//parts%path//'*.part'
    end if
    if (allocated(parts%remark)) call move_alloc(parts%remark, remarks)
    if (.not. allocated(remarks)) allocate (remarks(0))
    call put_first(line, remarks)
  end subroutine make_parts
end module dotyk_driver_scene_building
