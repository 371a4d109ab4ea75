!> Refuses floating bodies where the scheme needs supported ones, and assembles the bodies.
module dotyk_model_assembly
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_error, only: error_slot_t, error_t, exit_not_solvable, problem_list_t, set_error
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: option_name, scheme_names
  use dotyk_base_progress, only: add_progress, expect_progress
  use dotyk_base_text, only: quoted, to_text
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_parallel, only: largest_first
  use dotyk_control_response_choice, only: assemble_representative, operator_slot_t
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_rigid_motion, only: free_rigid_modes
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_input_case, only: case_t
  use dotyk_ranks_exchange, only: share, share_errors
  implicit none
  private
  public :: check_held, assemble_bodies

contains

  !> For schemes that need supported bodies: refuse floating bodies; all are reported together.
  subroutine check_held(case, body, classes, ranks, error)
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), intent(in) :: body(:)  !! Bodies with supports (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    !> Owners of the bodies, where a rank holds the volumes of some only; else without owners.
    type(body_ranks_t), intent(in) :: ranks
    type(error_t), allocatable, intent(out) :: error  !! Allocated where bodies float: all of them, one per line.
    type(problem_list_t) :: problems
    type(error_slot_t) :: failed(size(body))
    character(:), allocatable :: scheme, motions
    logical :: free(size(body))
    integer :: b, n_free
    scheme = option_name(scheme_names, case%solver%scheme)
    free = .true.
    do b = 1, size(body)
      ! Congruent bodies float alike.
      if (.not. free(classes%first(b))) cycle
      if (.not. (body(b)%mesh%is_whole() .or. body(b)%mesh%is_in_parts())) cycle
      call free_rigid_modes(body(b), n_free, motions)
      free(b) = n_free > 0
      if (n_free == 0) cycle
      call set_error(failed(b)%error, &
                     "scheme '"//scheme//"' needs supported bodies, and this body floats: "//motions// &
                     "; add a &support against this motion, or use scheme='dual', which allows floating bodies", &
                     exit_not_solvable)
    end do
    if (allocated(ranks%owner)) call share_errors(ranks%owner, failed)
    do b = 1, size(body)
      call problems%add_error(failed(b)%error, body_context(case, b))
    end do
    call problems%raise(error)
  end subroutine check_held

  !> Assemble all bodies: much larger ones with all threads, then the others in parallel; all problems are reported
  !> together.
  subroutine assemble_bodies(case, classes, ranks, form, body, modes, stiffness, slot, error)
    type(case_t), intent(in) :: case  !! The case.
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    integer, intent(in) :: form(:)  !! How they are solved: one of `form_*` of dotyk_control_response_choice (n_bodies).
    !> Bodies (n_bodies); only the first one of each congruence class gets a stiffness matrix.
    type(body_t), intent(inout) :: body(:)
    !> Rigid body modes that the supports leave; found already for bodies that other ranks compute, if it is allocated
    !> (n_bodies).
    type(body_modes_t), allocatable, intent(inout) :: modes(:)
    !> Stiffness matrices of the representatives; empty with p-multigrid (n_bodies).
    type(stiffness_t), allocatable, intent(out) :: stiffness(:)
    !> Compliance operators of the representatives to come (n_bodies).
    type(operator_slot_t), allocatable, intent(out) :: slot(:)
    type(error_t), allocatable, intent(out) :: error  !! Where bodies cannot be assembled: all problems.
    type(problem_list_t) :: problems
    type(error_slot_t), allocatable :: failed(:)
    integer :: i, b, order(size(body))
    logical :: alone(size(body))
    real(dp) :: share_of_thread
    allocate (failed(size(body)), stiffness(size(body)), slot(size(body)))
    if (.not. allocated(modes)) allocate (modes(size(body)))
    order = largest_first(real(body%n_unknowns(), dp))
    ! The other threads would wait for a body that exceeds the share of one thread.
    share_of_thread = sum(real(body%constraint%n_equations, dp), mask=ranks%factorizes)/omp_get_max_threads()
    alone = .false.
    if (omp_get_max_threads() > 1) then
      alone = ranks%factorizes .and. body%constraint%n_equations > 1.2_dp*share_of_thread
    end if
    call expect_progress(sum(real(body%n_unknowns(), dp), mask=classes%is_representative([(b, b=1, size(body))])))
    do b = 1, size(body)
      if (interrupted()) cycle
      if (.not. alone(b)) cycle
      call assemble_representative(body(b), form(b), modes(b), stiffness(b), slot(b), failed(b)%error)
      call add_progress(real(body(b)%n_unknowns(), dp))
    end do
    !$omp parallel default(none) private(b) &
    !$omp& shared(body, classes, ranks, form, modes, stiffness, slot, failed, order, alone)
    !$omp do schedule(dynamic, 1)
    do i = 1, size(body)
      b = order(i)
      if (interrupted()) cycle
      if (alone(b) .or. .not. classes%is_representative(b)) cycle
      if (ranks%factorizes(b)) then
        call assemble_representative(body(b), form(b), modes(b), stiffness(b), slot(b), failed(b)%error)
      else if (.not. body(b)%mesh%is_whole()) then
        if (ranks%is_own(b)) call body(b)%assemble_loads(failed(b)%error)
      else
        call body(b)%assemble_loads(failed(b)%error)
        call modes(b)%find(body(b))
      end if
      call add_progress(real(body(b)%n_unknowns(), dp))
    end do
    !$omp end do
    !$omp do schedule(dynamic, 1)
    do i = 1, size(body)
      b = order(i)
      if (interrupted()) cycle
      if (classes%is_representative(b) .or. .not. body(b)%mesh%is_whole()) cycle
      if (allocated(failed(classes%first(b))%error)) cycle
      call body(b)%assemble_like(body(classes%first(b)), failed(b)%error)
      call modes(b)%move(modes(classes%first(b)), classes%motion(b), body(b))
    end do
    !$omp end do
    !$omp end parallel
    call share_errors(ranks%owner, failed)
    do b = 1, size(body)
      call problems%add_error(failed(b)%error, body_context(case, b))
    end do
    call problems%raise(error)
    if (allocated(error)) return
    call share(ranks%owner, body%volume)
    call share(ranks%owner, body%mean_modulus_factor)
  end subroutine assemble_bodies

  !> Context of the errors of a body: "file:line: body 'upper': ".
  function body_context(case, b) result(text)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: b  !! Index of the body.
    character(:), allocatable :: text
    text = case%file//':'//to_text(case%body(b)%line)//': body '//quoted(case%body(b)%name)//': '
  end function body_context
end module dotyk_model_assembly
