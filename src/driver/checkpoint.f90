!> Checkpoints of a run: the state of the iteration is saved from time to time, and a run goes on from where another was.
module dotyk_driver_checkpoint
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_error, only: error_t, set_error, exit_bad_input, exit_not_written
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: log_t, print_error
  use dotyk_base_text, only: quoted, to_text
  use dotyk_base_timer, only: wall_time
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_driver_fingerprint, only: differences
  use dotyk_driver_version, only: version
  use dotyk_output_checkpoint_file, only: checkpoint_t, is_checkpoint, n_columns
  use dotyk_output_file_system, only: check_replaceable, check_writable
  use dotyk_scheme_history, only: ending_name, history_t, scheme_result_t
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_relaxation, only: lambda_max_unknown
  use dotyk_scheme_state_keeper, only: state_keeper_t
  implicit none
  private

  !> Saves the state in a file.
  type, extends(state_keeper_t), public :: checkpoint_keeper_t
    !> The file.
    character(:), allocatable :: path
    !> What is the same in every state of this run.
    type(checkpoint_t) :: state
    !> One failure was told of: there is no need to tell of the next.
    logical, private :: warned = .false.
    !> True: the last attempt failed.
    logical :: failed = .false.
  contains
    procedure :: keep => keeper_keep
    procedure :: begin => keeper_begin
    procedure :: keep_result => keeper_keep_result
  end type checkpoint_keeper_t

  public :: check_checkpoint_path, check_results_path, check_scene, start_keeping, restore

contains

  !> Refuse a path that cannot be written, or where there is something else than results.
  subroutine check_results_path(path, error)
    character(*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    call check_writable(path, error)
    if (allocated(error)) return
    call check_replaceable(path, error)
    if (allocated(error)) return
    if (is_checkpoint(path)) call set_error(error, quoted(path)//' is a checkpoint: give another name to the results', &
                                            exit_not_written)
  end subroutine check_results_path

  !> Refuse a path that cannot be written, or where there is something else than a checkpoint.
  subroutine check_checkpoint_path(path, output, error)
    character(*), intent(in) :: path
    !> The results file.
    character(*), intent(in) :: output
    type(error_t), allocatable, intent(out) :: error
    logical :: found
    if (path == output) then
      call set_error(error, '&output checkpoint: '//quoted(path)//' is the results file', exit_bad_input)
      return
    end if
    call check_writable(path, error)
    if (allocated(error)) return
    inquire (file=path, exist=found)
    if (.not. found) return
    if (.not. is_checkpoint(path)) call set_error(error, '&output checkpoint: '//quoted(path)// &
      ' is there already and is no checkpoint of dotyk: give another name, or delete it', exit_bad_input)
  end subroutine check_checkpoint_path

  !> Let the states of a problem be saved.
  subroutine start_keeping(problem, path, interval, scene, scheme, pair)
    type(contact_problem_t), intent(inout) :: problem
    character(*), intent(in) :: path
    !> Seconds between two states.
    real(dp), intent(in) :: interval
    !> Of `fingerprint`.
    character(*), intent(in) :: scene
    !> Name of the scheme.
    character(*), intent(in) :: scheme
    !> With the thetas of the input (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(checkpoint_keeper_t), allocatable :: keeper
    allocate (keeper)
    keeper%path = path
    keeper%interval = interval
    keeper%kept_at = wall_time()
    keeper%state%version = version
    keeper%state%scheme = scheme
    keeper%state%scene = scene
    keeper%state%theta = pair%theta
    keeper%state%theta_factor = pair%theta_factor
    allocate (keeper%state%pressure(problem%operator%n_rows), keeper%state%closed(problem%operator%n_rows))
    call move_alloc(keeper, problem%keeper)
  end subroutine start_keeping

  !> Another answer begins where the last one ended.
  subroutine keeper_begin(self, earlier, tolerance, pair)
    class(checkpoint_keeper_t), intent(inout) :: self
    !> What was done up to now.
    type(history_t), intent(in) :: earlier
    !> Of the answer.
    real(dp), intent(in) :: tolerance
    !> Their thetas may have become smaller (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(history_t) :: none
    self%earlier = earlier
    self%before = none
    self%state%tolerance = tolerance
    self%state%theta_factor = pair%theta_factor
  end subroutine keeper_begin

  !> Save a state while the iteration goes on.
  subroutine keeper_keep(self, row, m, alpha, lambda_max, history, closed)
    class(checkpoint_keeper_t), intent(inout) :: self
    integer, intent(in) :: row(:)
    real(dp), intent(in) :: m(:), alpha(:), lambda_max
    type(history_t), intent(in) :: history
    logical, intent(in) :: closed(:)
    self%state%status = 'running'
    self%state%history = reshape([table(self%earlier), table(self%before), table(history)], &
                                 [n_columns, self%earlier%n + self%before%n + history%n])
    call write_state(self, row, m, alpha, lambda_max, closed)
  end subroutine keeper_keep

  !> Save the state in the end, or where a run was interrupted.
  subroutine keeper_keep_result(self, result)
    class(checkpoint_keeper_t), intent(inout) :: self
    type(scheme_result_t), intent(in) :: result
    logical, allocatable :: closed(:)
    real(dp) :: lambda_max
    integer :: i
    self%state%status = ending_name(result%ended)
    self%state%history = reshape(table(result%history), [n_columns, result%history%n])
    lambda_max = result%lambda_max
    if (ieee_is_nan(lambda_max)) lambda_max = 0
    if (lambda_max >= lambda_max_unknown) lambda_max = 0
    closed = result%m > 0
    if (allocated(result%closed)) closed = result%closed
    call write_state(self, [(i, i=1, size(result%m))], result%m, result%alpha, lambda_max, closed)
  end subroutine keeper_keep_result

  !> Write the file. A failure is told of once.
  subroutine write_state(self, row, m, alpha, lambda_max, closed)
    class(checkpoint_keeper_t), intent(inout) :: self
    integer, intent(in) :: row(:)
    real(dp), intent(in) :: m(:), alpha(:), lambda_max
    logical, intent(in) :: closed(:)
    type(error_t), allocatable :: error
    self%kept_at = wall_time()
    self%state%pressure = 0
    self%state%closed = 0
    self%state%pressure(row) = m
    self%state%closed(row) = merge(1_int64, 0_int64, closed)
    self%state%alpha = alpha
    self%state%lambda_max = lambda_max
    call self%state%write(self%path, error)
    self%failed = allocated(error)
    if (.not. self%failed) return
    if (.not. self%warned) call print_error('warning: checkpoint '//error%message//'; the run goes on without it')
    self%warned = .true.
  end subroutine write_state

  !> Columns of a history, one behind the other.
  pure function table(history) result(values)
    type(history_t), intent(in) :: history
    real(dp) :: values(n_columns*history%n)
    integer :: k
    do k = 1, history%n
      values(n_columns*(k - 1) + 1:n_columns*k) = [history%seconds(k), history%increment(k), history%error_bound(k), &
        history%error_penalty(k), history%error_discretization(k), history%energy(k), history%max_penetration(k), &
        real(history%active(k), dp)]
    end do
  end function table

  !> Refuse the checkpoint of another scene.
  subroutine check_scene(state, path, scene, n_rows, error)
    type(checkpoint_t), intent(in) :: state
    !> Its file, and the lines of `fingerprint` of this scene.
    character(*), intent(in) :: path, scene
    !> Contact points.
    integer, intent(in) :: n_rows
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: text
    text = differences(scene, state%scene)
    if (len(text) > 0) call set_error(error, 'checkpoint '//quoted(path)//' is of another scene: other than here are '//text// &
                                      '; start without --restart, or give the file of this scene', exit_bad_input)
    if (.not. allocated(error) .and. size(state%pressure) /= n_rows) &
      call set_error(error, 'checkpoint '//quoted(path)//' holds '//to_text(size(state%pressure))//' contact points, and '// &
                     'the scene has '//to_text(n_rows)//'; start without --restart', exit_bad_input)
  end subroutine check_scene

  !> The state that a checkpoint of this scene holds, as a result to go on from.
  subroutine restore(state, path, pair, problem, log, result, tolerance)
    type(checkpoint_t), intent(in) :: state
    !> Its file.
    character(*), intent(in) :: path
    !> Thetas become as small as they were, if they are those of then (n_pairs).
    type(contact_pair_t), intent(inout) :: pair(:)
    !> With operator, responses, the scene without contact and coarse space.
    type(contact_problem_t), intent(inout) :: problem
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    !> Of the answer that was under way; 0 where it means nothing here.
    real(dp), intent(out) :: tolerance
    real(dp), allocatable :: z(:), motion(:)
    integer :: k
    tolerance = 0
    result%m = state%pressure
    result%closed = state%closed == 1
    ! Free motions are found anew where another scheme saved none.
    allocate (result%alpha(problem%coarse%n), source=0.0_dp)
    if (size(state%alpha) == problem%coarse%n) result%alpha = state%alpha
    call from_table(state%history, result%history)
    result%iterations = result%history%n
    if (size(state%theta) == size(pair)) then
      if (all(abs(state%theta - pair%theta) <= 1.0e-12_dp*pair%theta)) then
        tolerance = state%tolerance
        result%lambda_max = state%lambda_max
        do k = 1, size(pair)
          if (.not. state%theta_factor(k) < 1) cycle
          pair(k)%theta_factor = state%theta_factor(k)
          pair(k)%theta = state%theta_factor(k)*pair(k)%theta
          pair(k)%row_theta = state%theta_factor(k)*pair(k)%row_theta
          problem%operator%theta(problem%operator%pair_first_row(k):problem%operator%pair_first_row(k + 1) - 1) = pair(k)%row_theta
        end do
      end if
    end if
    allocate (z(problem%operator%n_rows), motion(problem%operator%n_rows))
    motion = 0
    z = 0
    if (size(z) > 0) call problem%compliance(problem%operator%weight*result%m, z)
    if (problem%coarse%n > 0) call problem%coarse%displacement(problem%operator, result%alpha/problem%coarse%scale, motion)
    result%y = problem%y_free - z + motion
    call log%line('  restart          from '//path//': '//trim(state%status)//' after '//to_text(result%history%n)//' steps of '// &
                  state%scheme)
  end subroutine restore

  !> A history from its columns.
  subroutine from_table(values, history)
    real(dp), intent(in) :: values(:, :)
    type(history_t), intent(out) :: history
    history%n = size(values, 2)
    history%seconds = values(1, :)
    history%increment = values(2, :)
    history%error_bound = values(3, :)
    history%error_penalty = values(4, :)
    history%error_discretization = values(5, :)
    history%energy = values(6, :)
    history%max_penetration = values(7, :)
    history%active = nint(min(values(8, :), real(huge(0), dp)))
  end subroutine from_table
end module dotyk_driver_checkpoint
