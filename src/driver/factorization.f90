!> From bodies and contact rows to the quadratic programme and its compliance.
module dotyk_driver_factorization
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, set_stage
  use dotyk_control_body_operators, only: make_operators
  use dotyk_control_factorization, only: check_memory, factorize_bodies
  use dotyk_control_parallel, only: set_blas_threads, share_solves
  use dotyk_control_response_choice, only: form_multigrid
  use dotyk_control_seams, only: find_seams
  use dotyk_control_slow_multigrid, only: find_slow_ones, replace_slow_ones
  use dotyk_driver_engines, only: may_return_to_factors, return_to_factors, tied_rows
  use dotyk_driver_load_case, only: solve_free
  use dotyk_driver_scene, only: scene_t
  use dotyk_input_case, only: case_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_factorize, stage_iterate
  use dotyk_model_pairs, only: foundation_compliance
  use dotyk_response_response, only: response_slot_t
  use dotyk_scheme_body_compliance, only: body_operator_t
  use dotyk_scheme_coarse_space, only: coarse_space_t
  use dotyk_scheme_congruent_products, only: sweep_costs
  use dotyk_scheme_scheme, only: scheme_t
  implicit none
  private
  public :: factorize_scene, use_factors

contains

  !> Factorize, and solve the load case of the bodies without contact: the QP and its compliance.
  subroutine factorize_scene(case, scheme, scene, monitor, error)
    type(case_t), intent(in) :: case  !! The case.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the run.
    type(scene_t), intent(inout) :: scene  !! Built; without stiffnesses, operator and compliance operators on return.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(error_t), allocatable, intent(out) :: error  !! Where a body is not held, memory is short, or on an interrupt.
    type(response_slot_t), allocatable :: response(:)
    type(body_operator_t), allocatable :: operators(:)
    type(coarse_space_t) :: coarse
    real(dp), allocatable :: foundation(:), cost(:), nothing(:)
    type(sparse_rows_t), allocatable :: seam
    integer :: i
    logical :: side_by_side
    if (scene%is_split()) then
      call scene%split%factorize(scene%problem%body, scene%operator, scene%problem%report, error)
    else
      call factorize_all(case, scheme, scene, monitor, error)
    end if
    if (allocated(error)) return
    associate (problem => scene%problem, block => scene%operator%block, qp => scene%qp, compliance => scene%compliance)
      call make_operators(problem%body, problem%classes, problem%ranks, block, problem%report, scene%size_of, &
                          scene%slot, response, operators)
      if (scene%is_split()) call scene%split%take_responses(problem%body, problem%modes, response)
      call sweep_costs(operators, block, cost)
      call share_solves(cost, case%solver%reproducible, side_by_side, problem%n_blas)
      ! All ranks solve one body after the other.
      side_by_side = side_by_side .and. .not. scene%is_split()
      call foundation_compliance(problem%body, problem%pair, foundation, problem%tie)
      ! The rows; loads come after it.
      call coarse%take_rows(block, scene%operator%n_rows)
      coarse%max_unbalanced = case%solver%max_unbalanced
      allocate (nothing(scene%operator%n_rows), source=0.0_dp)
      call find_seams(problem%body, problem%pair, problem%tie, scene%operator%n_rows, seam)
      call qp%init(scene%operator, nothing, nothing, 0.0_dp, 0.0_dp, foundation, coarse, &
                   [(i > sum(problem%pair%n_rows), i=1, scene%operator%n_rows)], seam)
      call compliance%init(qp, response, operators, side_by_side)
      if (case%n_cases() > 1) scene%modes = problem%modes
      call solve_free(scene, scene%has_multigrid(), error)
      if (allocated(error)) return
      if (any(scene%size_of%forms_matrix)) then
        call set_stage('forming the compliance')
        call set_blas_threads(scene%problem%n_blas)
        call compliance%form_bodies(qp, scene%size_of%forms_matrix, may_stop=.true.)
        call set_blas_threads(1)
      end if
    end associate
    scene%is_factorized = .true.
    call stop_if_interrupted(error)
    call monitor%lap(stage_iterate)
  end subroutine factorize_scene

  !> Factorize the bodies. Where p-multigrid would converge slowly, factors take its place if the memory suffices: of
  !> such a body, or of all bodies where no p-multigrid remains.
  subroutine factorize_all(case, scheme, scene, monitor, error)
    type(case_t), intent(in) :: case  !! As in `factorize_scene`.
    class(scheme_t), intent(in) :: scheme  !! As in `factorize_scene`.
    type(scene_t), intent(inout) :: scene  !! As in `factorize_scene`.
    type(log_monitor_t), intent(inout) :: monitor  !! As in `factorize_scene`.
    type(error_t), allocatable, intent(out) :: error  !! As in `factorize_scene`.
    character(:), allocatable :: warning
    logical :: all_again, is_refused
    call keep_corner_matrices(scene)
    ! Factors that cost less than p-multigrid anyhow need no trial.
    call use_factors(case, scheme, scene, monitor, all_again, error)
    is_refused = any(scene%size_of%is_slow) .and. .not. all_again
    do
      if (allocated(error)) return
      call check_memory(memory_now(), pack(scene%size_of, scene%problem%ranks%factorizes), warning, error)
      if (allocated(error)) return
      if (len(warning) > 0) call monitor%log%line('  warning: '//warning)
      call set_stage('factorizing')
      associate (problem => scene%problem)
        call factorize_bodies(problem%body, problem%ranks, problem%modes, .not. scheme%is_iteration(), &
                              scene%size_of, scene%stiffness, scene%slot, problem%report, error)
        call stop_if_interrupted(error)
        if (allocated(error)) return
        call monitor%lap(stage_factorize)
        if (is_refused) exit
        call use_factors(case, scheme, scene, monitor, all_again, error)
        if (all_again) cycle
        if (allocated(error) .or. .not. may_return_to_factors(case, scene) .or. .not. any(scene%size_of%is_slow)) exit
        call replace_slow_ones(problem%body, problem%modes, scene%slot, scene%size_of, problem%report, error)
        call monitor%lap(stage_factorize)
      end associate
      exit
    end do
  end subroutine factorize_all

  !> Let p-multigrids of tied bodies keep the stiffness of their corner spaces.
  subroutine keep_corner_matrices(scene)
    type(scene_t), intent(inout) :: scene  !! The scene, analysed.
    integer :: i, k
    do k = 1, scene%problem%n_ties()
      associate (rows => scene%problem%tie(k)%component(1))
        do i = 1, 2
          associate (slot => scene%slot(scene%problem%classes%first(merge(rows%body_a, rows%body_b, i == 1))))
            if (allocated(slot%multigrid)) slot%multigrid%grid%keeps_corner_matrix = .true.
          end associate
        end do
      end associate
    end do
  end subroutine keep_corner_matrices

  !> Return to factors where no body remains for which p-multigrid is better.
  subroutine use_factors(case, scheme, scene, monitor, has_returned, error)
    type(case_t), intent(in) :: case  !! As in `factorize_scene`.
    class(scheme_t), intent(in) :: scheme  !! As in `factorize_scene`.
    type(scene_t), intent(inout) :: scene  !! Analysed or factorized; analysed where it has returned to factors.
    type(log_monitor_t), intent(inout) :: monitor  !! As in `factorize_scene`.
    logical, intent(out) :: has_returned  !! Whether it has: not where the memory does not suffice.
    type(error_t), allocatable, intent(out) :: error  !! As in `factorize_scene`.
    has_returned = .false.
    if (.not. may_return_to_factors(case, scene)) return
    call find_slow_ones(scene%problem%classes, case%n_cases(), tied_rows(scene), scene%slot, scene%size_of)
    if (.not. all(scene%size_of%is_slow .or. scene%size_of%form /= form_multigrid)) return
    call return_to_factors(case, scheme, scene, monitor, has_returned, error)
  end subroutine use_factors
end module dotyk_driver_factorization
