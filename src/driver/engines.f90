!> The engines that solve a contact, and which one is next where one of them does not.
module dotyk_driver_engines
  use dotyk_base_error, only: error_t
  use dotyk_base_options, only: response_auto
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_control_split_costs, only: factors_fit, iterations_worth_factors
  use dotyk_driver_return_to_factors, only: may_return_to_factors, return_to_factors
  use dotyk_driver_scene, only: scene_t
  use dotyk_input_case, only: case_t
  use dotyk_log_outcome, only: note_factors, note_no_memory, note_rebuilt
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_scheme_primal, only: grid_dual_t, primal_t
  use dotyk_scheme_scheme, only: reason_accuracy, reason_no_rows, reason_none, reason_slow, scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_costly, ended_interrupted, ended_limit, solver_state_t
  implicit none
  private
  public :: first_engine, take_engine, take_next_engine, why_not_taken

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
end module dotyk_driver_engines
