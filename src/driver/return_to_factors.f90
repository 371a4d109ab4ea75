!> The way back from p-multigrid: the bodies of a scene get factors of their whole stiffness, where p-multigrid does not
!> reach the tolerance or is of no use, and the memory suffices.
module dotyk_driver_return_to_factors
  use dotyk_base_error, only: error_t, exit_machine
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t, set_stage
  use dotyk_base_options, only: response_auto
  use dotyk_control_contact_problem, only: build_rows
  use dotyk_control_factorization, only: analyze_bodies, check_memory, factor_size_t
  use dotyk_control_response_choice, only: form_direct, form_multigrid, operator_slot_t
  use dotyk_control_slow_multigrid, only: find_slow_ones
  use dotyk_control_split_costs, only: bytes_of_unknown
  use dotyk_driver_scene, only: scene_t
  use dotyk_elasticity_body, only: stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_assemble, stage_order
  use dotyk_model_assembly, only: assemble_bodies
  use dotyk_scheme_linear_solver_choice, only: work_of_ties
  use dotyk_scheme_scheme, only: scheme_t
  implicit none
  private
  public :: may_return_to_factors, return_to_factors, tied_rows

contains

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
end module dotyk_driver_return_to_factors
