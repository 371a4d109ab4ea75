!> From mesh files to bodies: what each rank reads of them, and what it holds.
module dotyk_driver_body_building
  use dotyk_base_error, only: error_t
  use dotyk_base_options, only: analysis_3d, response_auto, response_multigrid
  use dotyk_base_text, only: text_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_response_choice, only: crossover
  use dotyk_driver_run_settings, only: may_use_multigrid
  use dotyk_input_case, only: case_t
  use dotyk_model_body_setup, only: body_surfaces_t, build_bodies
  use dotyk_model_dealt_bodies, only: build_dealt_bodies
  use dotyk_model_mesh_shares, only: mesh_shares_t
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_split_split_scene, only: can_split
  implicit none
  private
  public :: read_bodies

contains

  !> Build the bodies of a scene.
  subroutine read_bodies(case, may_split, problem, surfaces, remarks, in_parts, are_dealt, error)
    type(case_t), intent(in) :: case  !! The case.
    logical, intent(in) :: may_split  !! Whether several ranks may compute a body together.
    !> Gets bodies; with `are_dealt` congruence classes, the ranks that compute the bodies, and rigid body modes, too.
    type(contact_problem_t), intent(inout) :: problem
    !> Surfaces of the bodies that contact pairs may need (n_bodies).
    type(body_surfaces_t), allocatable, intent(out) :: surfaces(:)
    type(text_t), allocatable, intent(out) :: remarks(:)  !! Lines for the log (n_remarks).
    logical, intent(out) :: in_parts  !! Whether each rank has a part of each body.
    logical, intent(out) :: are_dealt  !! Whether each rank has its own bodies, and the surfaces of others.
    !> Allocated where meshes, materials, supports or loads cannot be used: all problems, one per line.
    type(error_t), allocatable, intent(out) :: error
    type(mesh_survey_t) :: survey
    type(mesh_shares_t) :: shares
    logical :: may_be_split
    are_dealt = .false.
    in_parts = .false.
    may_be_split = may_split .and. can_split() .and. may_use_multigrid(case) .and. size(case%tie) == 0
    if (n_ranks() > 1) call survey%read(case)
    if (may_be_split) call shares%read(case, survey, crossover, in_parts, error)
    if (allocated(error)) return
    if (in_parts) then
      call build_bodies(case, problem%body, surfaces, remarks, error, shares)
      call put_first(survey%remark, remarks)
      return
    end if
    if (may_be_split) may_be_split = are_maybe_large(case, survey)
    if (survey%is_known .and. .not. may_be_split) &
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

  !> Whether p-multigrid may be chosen for a body.
  pure logical function are_maybe_large(case, survey) result(are_large)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_survey_t), intent(in) :: survey  !! What the mesh files have.
    integer :: b
    are_large = case%solver%response == response_multigrid
    if (case%solver%response == response_auto .and. case%scene%analysis == analysis_3d .and. survey%is_known) &
      are_large = any([(case%scene%dimension*survey%most_nodes(b) > crossover, b=1, size(case%body))])
  end function are_maybe_large
end module dotyk_driver_body_building
