!> From mesh files to bodies: what each rank reads of them, and what it holds.
module dotyk_driver_body_building
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_options, only: analysis_3d, response_auto, response_multigrid
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t, to_text
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_response_choice, only: large
  use dotyk_driver_run_settings, only: may_use_multigrid
  use dotyk_input_case, only: case_t
  use dotyk_model_body_setup, only: body_surfaces_t, build_bodies
  use dotyk_model_dealt_bodies, only: build_dealt_bodies
  use dotyk_model_mesh_survey, only: mesh_survey_t
  use dotyk_model_part_files, only: part_files_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: agree_on_error, gather_all, on_any_rank
  use dotyk_split_split_scene, only: can_split
  implicit none
  private
  public :: make_parts, read_bodies

contains

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
end module dotyk_driver_body_building
