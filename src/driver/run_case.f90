!> A run from the namelist file to the results file: the one place that turns input into bodies, operator, scheme and results.
module dotyk_driver_run_case
  use dotyk_base_error, only: error_t, set_error, exit_converged, exit_not_converged, exit_not_written
  use dotyk_base_files, only: behind_links, print_text
  use dotyk_base_interrupt, only: interrupted, stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t, print_error
  use dotyk_base_memory, only: set_stage
  use dotyk_base_options, only: scheme_dual
  use dotyk_base_text, only: to_text
  use dotyk_base_timer, only: wall_time
  use dotyk_contact_operator, only: build_operator
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_driver_arguments, only: arguments_t
  use dotyk_driver_body_setup, only: build_bodies, check_held, assemble_bodies
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_digits, only: body_digits_t, collect_digits, show_digits
  use dotyk_driver_displacements, only: find_displacements
  use dotyk_driver_error_budget, only: error_budget_t, ask_for_more, errors_decide, estimate_errors, first_tolerance, &
    most_rounds
  use dotyk_driver_finite, only: refuse_overflow
  use dotyk_driver_factorization, only: factor_size_t, analyze_bodies, attach_bodies, check_memory, factorize_bodies
  use dotyk_driver_free_scene, only: free_body_t, solve_free_scene
  use dotyk_driver_locking, only: show_locking
  use dotyk_driver_pairs, only: find_pairs
  use dotyk_driver_parallel, only: use_threads, share_solves, set_blas_threads
  use dotyk_driver_pressures, only: pair_solution_t, nodal_field_t, project_pressures
  use dotyk_driver_body_solution, only: body_solution_t
  use dotyk_driver_results, only: write_fields, write_pairs, write_summary, write_provenance, write_timing
  use dotyk_driver_scheme, only: needs_held_bodies, prepare_coarse_space, scheme_name, scheme_of, solve_scheme
  use dotyk_driver_screen, only: show_scene, show_bodies, show_pairs, show_factorization, &
    show_budget, show_left_out, show_memory, show_responses, show_result, show_pair_results, show_timing
  use dotyk_driver_timing, only: timing_t, stopwatch_t
  use dotyk_driver_version, only: version, compiler, build_type
  use dotyk_driver_warm_start, only: read_pressures, start_from_pressures
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t
  use dotyk_input_help, only: help_text
  use dotyk_input_parse, only: read_case
  use dotyk_input_reference, only: reference_text
  use dotyk_mesh_surface, only: surface_t
  use dotyk_output_file_system, only: check_replaceable, check_writable
  use dotyk_output_results_file, only: results_file_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_interrupted, ended_time
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: run_case

  !> All that a run knows, in the order in which it comes to know it.
  type :: run_t
    type(case_t) :: case
    type(log_t) :: log
    type(timing_t) :: timing
    type(stopwatch_t) :: watch
    !> Threads in use, and BLAS threads of each solve.
    integer :: threads = 1, n_blas = 1
    !> Date and time of the start.
    character(:), allocatable :: started
    !> Bodies (n_bodies) and contact pairs with their two surfaces (n_pairs).
    type(body_t), allocatable :: body(:)
    type(congruence_classes_t) :: classes
    type(surface_t), allocatable :: surface_a(:), surface_b(:)
    type(contact_pair_t), allocatable :: pair(:)
    !> Factors to come (n_bodies).
    type(factor_size_t), allocatable :: size_of(:)
    type(contact_problem_t) :: problem
    !> Digits that the stiffnesses lose (n_bodies).
    type(body_digits_t), allocatable :: digits(:)
    !> What bodies do that touch nothing (n_bodies).
    type(free_body_t), allocatable :: alone(:)
    type(explicit_compliance_t) :: compliance
    !> Contact pressures that the scheme starts from (n_rows) [pressure]; not allocated: from the scene without contact.
    real(dp), allocatable :: start_pressure(:)
    type(scheme_result_t) :: result
    type(error_budget_t) :: budget
    !> Displacements and stresses (n_bodies), pressures (n_pairs), pressures at the nodes (n_bodies).
    type(body_solution_t), allocatable :: solution(:)
    type(pair_solution_t), allocatable :: pair_solution(:)
    type(nodal_field_t), allocatable :: contact_pressure(:)
    !> Results could not be written on the way, which is said once.
    logical :: has_warned = .false.
    !> Wall time of the last results, or of the start of the scheme [s].
    real(dp) :: written_at = 0
  end type run_t

contains

  !> Run what the command line asks for.
  subroutine run_case(arguments, code, error)
    type(arguments_t), intent(in) :: arguments
    !> Exit code where there is no error.
    integer, intent(out) :: code
    type(error_t), allocatable, intent(out) :: error
    type(run_t) :: run
    code = exit_converged
    if (arguments%help) then
      call print_answer(help_text(), error)
      return
    else if (arguments%reference) then
      call print_answer(reference_text(), error)
      return
    else if (arguments%version) then
      call print_answer('dotyk '//version//' ('//compiler//', '//build_type//')', error)
      return
    end if
    call run%watch%start()
    run%started = date_and_time_text()
    call run%log%init(arguments%quiet)
    call use_threads(arguments%threads, run%threads)
    call set_stage('reading '//arguments%case_file)
    call read_case(arguments%case_file, run%case, error)
    if (allocated(error)) return
    if (len(arguments%output) > 0) run%case%scene%output = arguments%output
    ! A new file takes the place of an old one, not that of a link to it.
    run%case%scene%output = behind_links(run%case%scene%output)
    call show_scene(run%log, run%case, run%threads)
    call build(run, error)
    if (.not. allocated(error) .and. len(arguments%restart) > 0) &
      call read_pressures(arguments%restart, run%body, run%pair, run%log, run%start_pressure, error)
    if (allocated(error) .or. arguments%check) then
      if (.not. allocated(error)) call show_memory(run%log, run%size_of)
      if (.not. allocated(error)) call run%log%line('  checked; nothing was solved')
      call run%problem%destroy()
      return
    end if
    call solve(run, error)
    if (.not. allocated(error)) call recover(run, error)
    if (.not. allocated(error)) call show_pair_results(run%log, run%pair, run%pair_solution)
    if (.not. allocated(error)) call write_results(run, error)
    call run%problem%destroy()
    if (allocated(error)) return
    call show_timing(run%log, run%timing)
    call run%log%line('  results          '//run%case%scene%output)
    if (run%result%ended /= ended_converged) code = exit_not_converged
  end subroutine run_case

  !> A text that was asked for.
  subroutine print_answer(text, error)
    character(*), intent(in) :: text
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    call print_text(text//new_line('a'), status)
    if (status /= 0) call set_error(error, 'the standard output cannot be written', exit_not_written)
  end subroutine print_answer

  !> Meshes to bodies, contact points, and the sizes of the factors: all that can be checked before anything is solved.
  subroutine build(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    call check_writable(run%case%scene%output, error)
    if (.not. allocated(error)) call check_replaceable(run%case%scene%output, error)
    if (allocated(error)) return
    call set_stage('reading meshes')
    call build_bodies(run%case, run%body, run%surface_a, run%surface_b, error)
    call stop_if_interrupted(error)
    if (allocated(error)) return
    call run%watch%lap(run%timing%read)
    call run%classes%init(size(run%body))
    call run%classes%find(run%body)
    if (needs_held_bodies(run%case)) call check_held(run%case, run%body, run%classes, error)
    if (allocated(error)) return
    call set_stage('assembling')
    call assemble_bodies(run%case, run%classes, run%body, error)
    call stop_if_interrupted(error)
    if (allocated(error)) return
    call run%watch%lap(run%timing%assemble)
    call set_stage('searching contact points')
    call find_pairs(run%case, run%body, run%surface_a, run%surface_b, run%pair, error)
    call stop_if_interrupted(error)
    if (allocated(error)) return
    call build_operator(run%case%scene%dimension, size(run%body), run%pair, run%surface_a, run%surface_b, run%problem%operator)
    call run%watch%lap(run%timing%search)
    call set_stage('ordering equations')
    call analyze_bodies(run%body, run%classes, run%problem%operator%block, run%case%solver%response, &
                        scheme_of(run%case) /= scheme_dual, run%problem%response, run%size_of, error)
    call stop_if_interrupted(error)
    if (allocated(error)) return
    call run%watch%lap(run%timing%order)
    call show_bodies(run%log, run%case, run%body, run%classes, run%size_of)
    call show_locking(run%log, run%case, run%body, run%classes)
    call show_pairs(run%log, run%body, run%pair, run%surface_a, run%surface_b)
    call run%log%line('')
  end subroutine build

  !> Factorize, and iterate from the scene without contact.
  subroutine solve(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    associate (case => run%case, problem => run%problem)
      call attach_bodies(run%body, run%classes, problem%operator%block, problem%response)
      call run%watch%lap(run%timing%search)
      call check_memory(run%size_of, run%log, error)
      if (allocated(error)) return
      call set_stage('factorizing')
      call factorize_bodies(run%body, run%classes, problem%operator%block, .not. needs_held_bodies(case), problem%response, &
                            run%size_of, error)
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call run%watch%lap(run%timing%factorize)
      call show_factorization(run%log, run%size_of, run%timing%factorize)
      call show_responses(run%log, run%size_of)
      call collect_digits(run%classes, problem%response, run%digits)
      call share_solves(real(run%size_of%response_entries, dp), case%solver%reproducible, problem%side_by_side, run%n_blas)
      call problem%prepare(real(run%size_of%response_entries, dp))
      call run%classes%copy(case%scene%dimension, problem%kind, problem%axes)
      call set_blas_threads(run%n_blas)
      call set_stage('solving the scene without contact')
      call run%compliance%lend(problem, run%size_of%is_explicit)
      call set_blas_threads(1)
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call solve_free_scene(run%body, problem, run%n_blas, run%alone)
      call prepare_coarse_space(run%body, problem)
      call stop_if_interrupted(error)
    end associate
    if (.not. allocated(error)) call find_answer(run, error)
  end subroutine solve

  !> Solve the contact, recover the displacements, estimate what the error is made of; again where the rules ask for a better answer.
  subroutine find_answer(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    type(scheme_result_t) :: last
    real(dp) :: tolerance, time_limit
    integer :: round
    logical :: continues
    tolerance = first_tolerance(run%case%solver)
    time_limit = huge(time_limit)
    if (run%case%output%interval > 0) time_limit = run%case%output%interval
    run%written_at = wall_time()
    continues = .false.
    if (allocated(run%start_pressure)) continues = any(run%start_pressure > 0)
    if (continues) call start_from_pressures(run%start_pressure, run%problem, run%result)
    round = 1
    do
      call set_blas_threads(run%n_blas)
      call set_stage('iterating')
      if (continues) then
        last = run%result
        call solve_scheme(run%case, run%body, run%pair, run%problem, tolerance, run%log, run%compliance, run%result, error, &
                          last, time_limit)
        if (.not. allocated(error)) call run%result%history%put_behind(last%history)
      else
        call solve_scheme(run%case, run%body, run%pair, run%problem, tolerance, run%log, run%compliance, run%result, error, &
                          time_limit=time_limit)
      end if
      call set_blas_threads(1)
      if (allocated(error)) return
      continues = .true.
      call run%watch%lap(run%timing%iterate)
      call find_displacements(run%case, run%body, run%classes, run%pair, run%problem, run%compliance, run%alone, run%n_blas, &
                              tolerance, run%log, run%watch, run%timing, run%digits, run%solution, run%result, error)
      if (allocated(error)) return
      run%result%iterations = run%result%history%n
      call run%watch%lap(run%timing%recover)
      call set_stage('estimating errors')
      call estimate_errors(run%case, run%body, run%classes, run%pair, run%surface_a, run%surface_b, run%solution, run%problem, &
                           run%compliance, run%result, run%budget, error)
      call run%watch%lap(run%timing%estimate)
      if (allocated(error)) return
      if (run%result%ended == ended_time) then
        call write_on_the_way(run)
        cycle
      end if
      if (is_due(run)) call write_on_the_way(run)
      if (errors_decide(run%case) .and. run%result%ended == ended_converged) then
        if (interrupted()) run%result%ended = ended_interrupted
      end if
      if (.not. ask_for_more(run%case, round == most_rounds, run%pair, run%budget, run%problem, run%result, tolerance, &
                             run%log)) exit
      round = round + 1
    end do
    call show_result(run%log, run%result, tolerance, run%problem%body_solves, run%timing%iterate)
    call show_budget(run%log, run%case%output, run%body, run%result, run%budget)
    call show_left_out(run%log, run%case, run%result)
    call show_digits(run%log, run%body, run%classes, run%digits)
    call run%problem%free_responses()
  end subroutine find_answer

  !> From the state of the scheme to what users look at.
  subroutine recover(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    call set_stage('projecting pressures')
    call project_pressures(run%body, run%pair, run%surface_a, run%surface_b, run%problem, run%result%m, run%result%y, &
                           run%pair_solution, run%contact_pressure, error)
    if (.not. allocated(error)) call refuse_overflow(run%case, run%body, run%pair, run%solution, run%pair_solution, run%result, &
                                                     error)
    call run%watch%lap(run%timing%recover)
  end subroutine recover

  !> Whether it is time to write results that the error budget may ask to improve.
  logical function is_due(run)
    type(run_t), intent(in) :: run
    is_due = run%case%output%interval > 0 .and. errors_decide(run%case)
    if (is_due) is_due = wall_time() - run%written_at >= run%case%output%interval
  end function is_due

  !> Write the results of a run that continues. A failure is no reason to end it.
  subroutine write_on_the_way(run)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable :: error
    integer :: ended
    ended = run%result%ended
    run%result%ended = ended_time
    call recover(run, error)
    if (.not. allocated(error)) call write_results(run, error)
    if (.not. allocated(error)) then
      call run%log%line('  written          '//run%case%scene%output//' after '//to_text(run%result%iterations)//' iterations')
    else if (.not. run%has_warned) then
      call print_error('warning: '//error%message//'; the run continues')
      run%has_warned = .true.
    end if
    run%result%ended = ended
    run%written_at = wall_time()
  end subroutine write_on_the_way

  !> Write the results file.
  subroutine write_results(run, error)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(out) :: error
    type(results_file_t) :: file
    call set_stage('writing results')
    call write_fields(file, run%case%scene%output, run%case, run%body, run%solution, run%contact_pressure, run%budget, error)
    if (allocated(error)) return
    call write_pairs(file, run%pair, run%pair_solution)
    call write_summary(file, run%body, run%classes, run%size_of, run%problem, run%result, run%budget, run%digits, &
                       scheme_name(run%case))
    call write_provenance(file, run%case, run%threads, run%started)
    call run%watch%lap(run%timing%write)
    run%timing%total = run%watch%since_start()
    call write_timing(file, run%timing)
    call file%commit(error)
  end subroutine write_results

  !> Now, as 2026-01-31T12:00:00+0100.
  function date_and_time_text() result(text)
    character(:), allocatable :: text
    character(10) :: date, time, zone
    call date_and_time(date, time, zone)
    text = date(1:4)//'-'//date(5:6)//'-'//date(7:8)//'T'//time(1:2)//':'//time(3:4)//':'//time(5:6)//trim(zone)
  end function date_and_time_text
end module dotyk_driver_run_case
