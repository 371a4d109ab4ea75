!> A run from the namelist file to the results file: the sequence of its steps.
module dotyk_driver_run_case
  use dotyk_base_error, only: error_t, exit_converged, exit_not_converged, set_error
  use dotyk_base_files, only: behind_links
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_memory, only: set_stage
  use dotyk_base_text, only: text_t, to_text
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_control_parallel, only: set_factor_threads, use_threads
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_accuracy, only: accuracy_t
  use dotyk_driver_arguments, only: arguments_t
  use dotyk_driver_cad_faces, only: show_cad_faces
  use dotyk_driver_load_cases, only: check_cases, predict_run, solve_cases
  use dotyk_driver_mesh_sizes, only: choose_sizes
  use dotyk_driver_penetration, only: check_placement
  use dotyk_driver_run_settings, only: choose_scheme, set_pair_conditions
  use dotyk_driver_scene_building, only: build_scene, make_parts, scene_t
  use dotyk_input_case, only: case_t
  use dotyk_input_parse, only: read_case
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_scene, show_title
  use dotyk_model_mesh_file, only: forget_meshes
  use dotyk_output_file_system, only: check_replaceable, check_writable
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_scheme_scheme, only: reason_none
  implicit none
  private
  public :: run_case

  integer, parameter :: most_added = 3  !! Times that rows are added where bodies meet beside their contact rows.

contains

  !> From the namelist file to the results file.
  subroutine run_case(arguments, code, error)
    type(arguments_t), intent(in) :: arguments  !! The command line.
    integer, intent(out) :: code  !! Exit code where there is no error.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the run has no results; with its exit code.
    type(case_t) :: case
    type(scheme_run_t) :: run
    type(log_monitor_t) :: monitor
    type(accuracy_t) :: accuracy
    character(:), allocatable :: lines, before
    integer :: threads
    logical :: is_last, is_stopped, reached
    code = exit_converged
    reached = .false.
    call monitor%begin(arguments%quiet, arguments%verbose)
    call use_threads(arguments%threads, threads)
    call set_stage('reading '//arguments%case_file)
    call read_case(arguments%case_file, case, error)
    if (allocated(error)) return
    call set_factor_threads(merge(1, threads, case%solver%reproducible))
    case%no_shell = arguments%no_shell
    call choose_scheme(case, run)
    call show_title(monitor%log, case, threads)
    if (arguments%remesh) call forget_meshes(case)
    call choose_sizes(case, arguments%remesh, error)
    if (allocated(error)) return
    if (arguments%parts > 0) then
      call write_parts(case, arguments%parts, monitor, error)
      return
    end if
    call prepare_output(case, arguments%output, error)
    if (allocated(error)) return
    if (.not. case%accuracy%is_given .or. arguments%check) then
      call run_mesh(arguments, case, run, threads, monitor, accuracy, code, error)
      return
    end if
    if (n_ranks() > 1) then
      call set_error(error, case%file//':'//to_text(case%accuracy%line)//': &accuracy: one process chooses the '// &
                     'meshes; run without mpirun')
      return
    end if
    if (len(arguments%restart) > 0) then
      call set_error(error, '--restart: '//case%file//' has an &accuracy, which makes new meshes, and the results '// &
                     'of one mesh start no other')
      return
    end if
    do
      call monitor%log%hold()
      call accuracy%begin_mesh(case)
      ! One that is kept has the sizes of another run, by other errors, loads or quantities.
      if (accuracy%n_meshes > 1) call forget_meshes(case)
      call run_mesh(arguments, case, run, threads, monitor, accuracy, code, error)
      call accuracy%remove_views()
      call monitor%log%take(lines)
      is_stopped = interrupted()
      is_last = allocated(error) .or. is_stopped
      if (.not. is_last) call accuracy%conclude(case, code, monitor%log, reached, is_last, error)
      is_stopped = interrupted()
      if (allocated(error) .and. accuracy%n_meshes > 1 .and. .not. is_stopped) then
        ! The results of the last mesh are there.
        call monitor%log%line('  accuracy         not reached: mesh '//to_text(accuracy%n_meshes)//': '//error%message)
        deallocate (error)
        code = exit_not_converged
        if (allocated(before)) call monitor%log%line(before)
        exit
      end if
      if (is_last) then
        if (len(lines) > 0) call monitor%log%line(lines)
        if (.not. reached) code = exit_not_converged
        exit
      end if
      call move_alloc(lines, before)
    end do
  end subroutine run_case

  !> From the meshes to the results file, with contact rows where deformed bodies meet beside them.
  subroutine run_mesh(arguments, case, run, threads, monitor, accuracy, code, error)
    type(arguments_t), intent(in) :: arguments  !! The command line.
    type(case_t), intent(in) :: case  !! The case.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(accuracy_t), intent(inout) :: accuracy  !! Takes the errors.
    integer, intent(out) :: code  !! Exit code where there is no error.
    type(error_t), allocatable, intent(out) :: error  !! As in `run_case`.
    type(met_point_t), allocatable :: met(:)
    integer :: reason, n, n_added
    logical :: has_shown, is_stopped
    has_shown = .false.
    allocate (met(0))
    n_added = 0
    do
      n = size(met)
      code = exit_converged
      call run_scene(arguments, case, run, .true., n_added < most_added, threads, monitor, has_shown, met, accuracy, &
                     reason, code, error)
      if (reason /= reason_none) &
        call run_scene(arguments, case, run, .false., n_added < most_added, threads, monitor, has_shown, met, &
                       accuracy, reason, code, error)
      is_stopped = interrupted()
      if (allocated(error) .and. n > 0 .and. .not. is_stopped) then
        ! What supports prescribe, for example, no row keeps out: the results without them say where bodies are deep.
        call monitor%log%line('  corners          no solution with these contact rows: '//error%message)
        deallocate (error)
        met = met(:0)
        n_added = most_added
        cycle
      end if
      if (size(met) == n) exit
      n_added = n_added + 1
    end do
  end subroutine run_mesh

  !> Make the parts of the meshes for the ranks of later runs.
  subroutine write_parts(case, n_parts, monitor, error)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: n_parts  !! Number of these ranks.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets lines.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where something is wrong.
    type(text_t), allocatable :: lines(:)
    integer :: i
    if (n_ranks() > 1) then
      call set_error(error, '--partition needs one process, without mpirun')
      return
    end if
    call set_stage('dividing meshes')
    call make_parts(case, n_parts, lines, error)
    if (allocated(error)) return
    do i = 1, size(lines)
      call monitor%log%line('  '//lines(i)%s)
    end do
  end subroutine write_parts

  !> From the case to the results file.
  subroutine run_scene(arguments, input, chosen, may_split, may_add, threads, monitor, has_shown, met, accuracy, &
                       reason, code, error)
    type(arguments_t), intent(in) :: arguments  !! The command line.
    type(case_t), intent(in) :: input  !! The case.
    type(scheme_run_t), intent(in) :: chosen  !! Scheme and its settings.
    logical, intent(in) :: may_split  !! Whether several ranks may compute a body together.
    logical, intent(in) :: may_add  !! Whether `met` may grow.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    logical, intent(inout) :: has_shown  !! Whether the log has the tables of the scene.
    !> Points at which bodies met beside their contact rows. Where it has grown, nothing is written: the scene is to be
    !> built anew, with rows there (n).
    type(met_point_t), allocatable, intent(inout) :: met(:)
    type(accuracy_t), intent(inout) :: accuracy  !! Takes the errors.
    !> Why the contact needs the factors of bodies that were split, one of `reason_*`: nothing is written; `reason_none`
    !> otherwise.
    integer, intent(out) :: reason
    integer, intent(inout) :: code  !! Exit code where there is no error.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the run has no results; with its exit code.
    type(case_t) :: case
    type(scheme_run_t) :: run
    type(scene_t) :: scene
    case = input
    run = chosen
    ! Bodies that are split are computed once: load cases have factors.
    call build_scene(case, run%scheme, may_split .and. case%n_cases() == 1, met, scene, monitor, reason, error)
    if (allocated(error) .or. reason /= reason_none) return
    call set_pair_conditions(case, run)
    call show_scene(monitor%log, case, scene%problem, scene%size_of, has_shown)
    if (.not. has_shown) call check_placement(scene, monitor)
    has_shown = .true.
    if (arguments%check) then
      call show_cad_faces(case, monitor%log)
      call check_cases(arguments%restart, case, scene, monitor, error)
      if (allocated(error)) return
      call predict_run(case, run%scheme, scene, monitor, error)
      if (allocated(error)) return
      call monitor%log%line('  input checked; nothing was solved')
      return
    end if
    call solve_cases(arguments%restart, case, run, scene, may_add, threads, monitor, met, accuracy, reason, code, error)
    call scene%compliance%destroy()
    call scene%split%destroy()
  end subroutine run_scene

  !> The path of the results file; refuse one that cannot be written before anything is computed.
  subroutine prepare_output(case, output, error)
    type(case_t), intent(inout) :: case  !! The case; its path of the results file is set.
    character(*), intent(in) :: output  !! Path from the command line; empty for that of the case.
    type(error_t), allocatable, intent(out) :: error  !! Where it cannot be written, or would replace another file.
    if (len(output) > 0) case%scene%output = output
    ! A new file takes the place of an old one, not that of a link to it.
    case%scene%output = behind_links(case%scene%output)
    ! The first rank writes.
    if (this_rank() > 0) return
    call check_writable(case%scene%output, error)
    if (.not. allocated(error)) call check_replaceable(case%scene%output, error)
  end subroutine prepare_output
end module dotyk_driver_run_case
