!> The engines that solve a contact, and which one is next where one of them does not.
!>
!> Where p-multigrid does not reach the tolerance, or is of no use, the bodies of a scene get factors of their whole
!> stiffness, if the memory suffices.
module dotyk_driver_engines
  use dotyk_base_error, only: error_t, exit_machine
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t, set_stage
  use dotyk_base_options, only: response_auto
  use dotyk_control_contact_problem, only: build_rows
  use dotyk_control_factorization, only: analyze_bodies, check_memory, factor_size_t
  use dotyk_control_response_choice, only: bytes_of_unknown, factors_fit, form_direct, form_multigrid, &
    iterations_worth_factors, operator_slot_t
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_control_slow_multigrid, only: find_slow_ones
  use dotyk_driver_scene, only: scene_t
  use dotyk_elasticity_body, only: stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_input_case, only: case_t
  use dotyk_log_outcome, only: note_factors, note_no_memory, note_rebuilt
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_assemble, stage_order
  use dotyk_model_assembly, only: assemble_bodies
  use dotyk_scheme_linear_solver_choice, only: work_of_ties
  use dotyk_scheme_primal, only: grid_dual_t, primal_t
  use dotyk_scheme_scheme, only: reason_accuracy, reason_no_rows, reason_none, reason_slow, scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_costly, ended_interrupted, ended_limit, solver_state_t
  implicit none
  private
  public :: first_engine, take_engine, take_next_engine, why_not_taken, may_return_to_factors, return_to_factors, &
    tied_rows

  !> The engines in the order of preference.
  integer, parameter, public :: engine_split = 1  !< all ranks compute the bodies together (`split_primal_t`)
  integer, parameter, public :: engine_grids = 2  !< displacements by p-multigrid (`primal_t`)
  integer, parameter, public :: engine_factors = 3  !< the scheme of the run, with factors of all bodies
  integer, parameter, public :: engine_grid_solves = 4  !< the dual scheme with solves by p-multigrid (`grid_dual_t`)
  integer, parameter, public :: engine_rebuilt = 5  !< a scene that is built anew, its bodies not split
  integer, parameter, public :: engine_none = 6  !< there is no other one

contains

  !> The engine of a scene as it is built.
  integer function first_engine(scene) result(engine)
    type(scene_t), intent(in) :: scene  !! The scene.
    engine = engine_factors
    if (scene%has_multigrid()) engine = engine_grids
    if (scene%is_split()) engine = engine_split
  end function first_engine

  !> The scheme of an engine.
  subroutine take_engine(engine, case, scene, scheme)
    integer, intent(in) :: engine  !! One of the first four.
    type(case_t), intent(in) :: case  !! The case.
    type(scene_t), intent(inout) :: scene  !! The scene, factorized.
    class(scheme_t), allocatable, intent(inout) :: scheme  !! That of the run; replaced.
    if (any(engine == [engine_grids, engine_grid_solves])) then
      deallocate (scheme)
      if (engine == engine_grids) allocate (primal_t :: scheme)
      if (engine == engine_grid_solves) allocate (grid_dual_t :: scheme)
    end if
    if (engine == engine_split) &
      call scene%split%take_scheme(merge(iterations_worth_factors(scene%problem%body), huge(1), &
                                         may_rebuild(case, scene)), scheme)
  end subroutine take_engine

  !> Whether a scene of bodies that are split may be built anew with factors.
  logical function may_rebuild(case, scene)
    type(case_t), intent(in) :: case  !! The case.
    type(scene_t), intent(in) :: scene  !! The scene.
    may_rebuild = case%solver%response == response_auto
    if (may_rebuild) may_rebuild = factors_fit(scene%problem%body)
  end function may_rebuild

  !> Why the solution of an engine is not taken where there is another engine: one of `reason_*`. It is where the user
  !> has limited the iterations, and where there is none: rigid body modes tell that.
  integer function why_not_taken(state) result(reason)
    type(solver_state_t), intent(in) :: state  !! How it ended.
    reason = reason_none
    if (state%ended == ended_costly) then
      reason = reason_slow
    else if (all(state%ended /= [ended_converged, ended_interrupted, ended_limit]) .and. state%history%n > 0) then
      reason = reason_accuracy
    end if
  end function why_not_taken

  !> The next engine that may solve the contact. Says so.
  subroutine take_next_engine(reason, case, run, scene, monitor, engine, error)
    integer, intent(in) :: reason  !! Why the last one does not.
    type(case_t), intent(in) :: case  !! The case.
    type(scheme_run_t), intent(in) :: run  !! Scheme of the run.
    type(scene_t), intent(inout) :: scene  !! The scene; to be factorized again where factors replace p-multigrids.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    integer, intent(inout) :: engine  !! The last one, and the next one.
    type(error_t), allocatable, intent(out) :: error  !! As in `return_to_factors`.
    integer :: last
    logical :: fits
    last = engine
    engine = engine_none
    if (last == engine_split) then
      if (.not. may_rebuild(case, scene)) return
      engine = engine_rebuilt
      call note_rebuilt(reason, monitor)
    else if (last == engine_grids) then
      if (may_return_to_factors(case, scene) .and. reason /= reason_no_rows) then
        call return_to_factors(case, run%scheme, scene, monitor, fits, error)
        if (allocated(error)) return
        if (fits) then
          engine = engine_factors
          call note_factors(reason, monitor)
          return
        end if
        call note_no_memory(reason, monitor)
      end if
      ! What the primal scheme has not reached, inexact solves do not reach either.
      if (all(reason /= [reason_accuracy, reason_slow])) engine = engine_grid_solves
    end if
  end subroutine take_next_engine

  !> Whether a scene has p-multigrids, its user leaves the choice to the program, and this rank holds the bodies wholly.
  pure logical function may_return_to_factors(case, scene) result(may)
    type(case_t), intent(in) :: case  !! The case.
    type(scene_t), intent(in) :: scene  !! The scene, built.
    integer :: b
    may = case%solver%response == response_auto .and. scene%has_multigrid()
    do b = 1, size(scene%problem%body)
      may = may .and. scene%problem%body(b)%mesh%is_whole()
    end do
  end function may_return_to_factors

  !> Assemble and analyse all bodies again, for their factors. A scene that was factorized is as it was built on return,
  !> and has all that it had where the memory does not suffice.
  subroutine return_to_factors(case, scheme, scene, monitor, fits, error)
    type(case_t), intent(in) :: case  !! The case.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the run.
    type(scene_t), intent(inout) :: scene  !! Built, with p-multigrids; to be factorized on return.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> Whether the memory suffices, and, in a scene that is not solved yet, the factors cost less indeed.
    logical, intent(out) :: fits
    type(error_t), allocatable, intent(out) :: error  !! As in `analyze_bodies`, or an interrupt came.
    type(body_modes_t), allocatable :: modes(:)
    type(stiffness_t), allocatable :: stiffness(:)
    type(operator_slot_t), allocatable :: slot(:)
    type(factor_size_t), allocatable :: size_of(:)
    type(memory_t) :: memory
    character(:), allocatable :: warning
    integer, allocatable :: form(:)
    integer :: b
    associate (problem => scene%problem)
      memory = memory_now()
      fits = .not. memory%is_known
      ! The factor is larger than the stiffness.
      if (.not. fits) fits = bytes_of_unknown*sum(real(problem%body%constraint%n_equations, dp), &
        mask=problem%classes%first == [(b, b=1, size(problem%body))]) < memory%left
      if (.not. fits) return
      call set_stage('assembling')
      allocate (form(size(problem%body)), source=form_direct)
      call assemble_bodies(case, problem%classes, problem%ranks, form, problem%body, modes, stiffness, slot, error)
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%lap(stage_assemble)
      call set_stage('ordering the equations')
      call build_rows(problem, case%scene%dimension, scene%operator, divided=.false.)
      call analyze_bodies(problem%body, modes, stiffness, problem%classes, problem%ranks, &
                          scene%operator%block, case%solver%response, scheme%expected_products(), slot, size_of, error)
      call monitor%lap(stage_order)
      if (allocated(error)) then
        fits = error%code /= exit_machine
      else
        call check_memory(memory_now(), size_of, warning, error)
        fits = .not. allocated(error)
        ! How many contact rows will be active is not known.
        scene%size_of%whole_flops = size_of%flops + work_of_ties(tied_rows(scene), size_of%path_entries, &
                                                                 real(size_of%class_entries, dp))
        ! Not yet solved, the factors are for their cost, which is known now.
        if (any([(allocated(scene%slot(b)%multigrid), b=1, size(slot))])) then
          call find_slow_ones(problem%classes, case%n_cases(), tied_rows(scene), scene%slot, scene%size_of)
          fits = fits .and. all(scene%size_of%is_slow .or. scene%size_of%form /= form_multigrid)
        end if
      end if
      if (.not. fits) then
        if (allocated(error)) deallocate (error)
        do b = 1, size(slot)
          if (allocated(slot(b)%direct)) call slot(b)%direct%destroy()
          call stiffness(b)%destroy()
        end do
      end if
      call stop_if_interrupted(error)
      if (allocated(error) .or. .not. fits) return
      do b = 1, size(slot)
        if (allocated(scene%slot(b)%multigrid)) call scene%slot(b)%multigrid%destroy()
      end do
      call scene%compliance%destroy()
      scene%is_factorized = .false.
      size_of%is_slow = scene%size_of%is_slow
      size_of%steps = scene%size_of%steps
      call move_alloc(modes, problem%modes)
      call move_alloc(stiffness, scene%stiffness)
      call move_alloc(slot, scene%slot)
      call move_alloc(size_of, scene%size_of)
    end associate
  end subroutine return_to_factors

  !> Tied rows of each body.
  pure function tied_rows(scene) result(n)
    type(scene_t), intent(in) :: scene  !! The scene, built.
    integer :: n(size(scene%problem%body))  !! (n_bodies)
    integer :: b
    n = [(count(scene%operator%block(b)%row > sum(scene%problem%pair%n_rows)), b=1, size(n))]
  end function tied_rows
end module dotyk_driver_engines
