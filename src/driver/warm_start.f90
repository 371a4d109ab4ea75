!> Warm start: the scheme starts from the contact pressures of an earlier results file (`--restart RESULTS.vtkhdf`).
!>
!> The contact rows must be those of the file: the same pairs, with as many rows at the same positions. Materials,
!> loads, theta and scheme may differ, as the pressures are an initial iterate and no solution. The amplitudes of rigid
!> body modes are found by the scheme.
module dotyk_driver_warm_start
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, add_context, set_error
  use dotyk_base_files, only: why_no_file
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_base_thresholds, only: same_place
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t
  use dotyk_output_hdf5, only: hdf5_file_t
  use dotyk_output_results_file, only: contact_group
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: initial_pressures, start_from_pressures

  !> Larger pressures are those of a diverged run: numbers of the input are below 1e40.
  real(dp), parameter :: largest_pressure = 1.0e60_dp

contains

  !> Contact pressures that a load case starts from: those of an earlier run, or of the load case before.
  subroutine initial_pressures(restart, case, k, problem, log, before, pressure, error)
    character(*), intent(in) :: restart  !! Results file of the earlier run; empty where there is none.
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: k  !! The load case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    type(log_t), intent(inout) :: log  !! The log.
    type(solver_state_t), intent(in) :: before  !! Solution of the case before; no pressures where none.
    !> Not allocated where the case starts from nothing (n_rows) [pressure].
    real(dp), allocatable, intent(out) :: pressure(:)
    type(error_t), allocatable, intent(out) :: error  !! Where the file cannot be read, or has other contact rows.
    character(:), allocatable :: name
    name = ''
    if (case%has_cases()) name = case%load_case(k)%name
    if (len(restart) > 0) then
      call read_pressures(restart, name, problem%body, problem%pair, log, pressure, error)
    else if (case%has_cases()) then
      if (case%load_case(k)%continues .and. allocated(before%pressure)) pressure = before%pressure
    end if
  end subroutine initial_pressures

  !> Read the contact pressures of a results file. All errors lead to exit code 2.
  subroutine read_pressures(path, name, body, pair, log, pressure, error)
    character(*), intent(in) :: path  !! Path of the results file.
    !> Name of the load case; empty where the case has none. A file without load cases serves all of them.
    character(*), intent(in) :: name
    type(body_t), intent(in) :: body(:)  !! Bodies; their meshes give the size of the scene (n_bodies).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact rows of this case (n_pairs).
    type(log_t), intent(inout) :: log  !! The log.
    real(dp), allocatable, intent(out) :: pressure(:)  !! Multipliers of all rows, by pairs (n_rows) [pressure].
    type(error_t), allocatable, intent(out) :: error  !! Where it is missing, no results file, or has other rows.
    type(hdf5_file_t) :: source
    character(:), allocatable :: reason, root
    reason = why_no_file(path)
    if (len(reason) > 0) then
      call set_error(error, '--restart: '//quoted(path)//' '//reason)
      return
    end if
    call source%open(path, error)
    if (.not. allocated(error)) call find_root(source, name, root, error)
    if (.not. allocated(error)) call read_pairs(source, root, scene_size(body), pair, pressure, error)
    call source%close()
    call add_context(error, '--restart: ')
    if (allocated(error)) return
    call log%line('  warm start       from '//path//': '//to_text(count(pressure > 0))//' of '// &
                  counted(size(pressure), 'constraint')//' active')
  end subroutine read_pressures

  !> Diagonal of the box around all bodies [length].
  pure real(dp) function scene_size(body)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    real(dp) :: low(3), high(3)
    integer :: b, d
    low = huge(low)
    high = -huge(high)
    d = 0
    do b = 1, size(body)
      d = body(b)%dimension
      low(:d) = min(low(:d), minval(body(b)%mesh%x, 2))
      high(:d) = max(high(:d), maxval(body(b)%mesh%x, 2))
    end do
    scene_size = norm2(high(:d) - low(:d))
  end function scene_size

  !> The group of a results file that has the results of a load case.
  subroutine find_root(source, name, root, error)
    type(hdf5_file_t), intent(in) :: source  !! Results file, open.
    character(*), intent(in) :: name  !! Name of the load case; empty where the case has none.
    character(:), allocatable, intent(out) :: root  !! Path of the group.
    type(error_t), allocatable, intent(out) :: error  !! Where it is none of dotyk, or lacks this load case.
    root = '/dotyk'
    if (.not. source%has(root)) then
      call set_error(error, quoted(source%label)//' is not a results file of dotyk')
    else if (source%has('/dotyk/cases')) then
      if (len(name) == 0) then
        call set_error(error, quoted(source%label)//' has load cases, and the case has none')
      else if (.not. source%has('/dotyk/cases/'//name)) then
        call set_error(error, quoted(source%label)//' has no load case '//quoted(name))
      else
        root = '/dotyk/cases/'//name
      end if
    end if
  end subroutine find_root

  !> Compare the contact pairs of the file with those of the case, and read their pressures.
  subroutine read_pairs(source, root, length, pair, pressure, error)
    type(hdf5_file_t), intent(in) :: source  !! Results file, open.
    character(*), intent(in) :: root  !! Group of the results.
    real(dp), intent(in) :: length  !! Size of the scene [length].
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs of the case (n_pairs).
    real(dp), allocatable, intent(out) :: pressure(:)  !! Multipliers of all rows, by pairs (n_rows) [pressure].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file has no contact, or other contact rows.
    character(:), allocatable :: what
    integer :: k, n
    allocate (pressure(sum(pair%n_rows)), source=0.0_dp)
    if (source%n_members(root//'/contact') /= size(pair)) then
      call set_error(error, quoted(source%label)//' has '// &
                     counted(source%n_members(root//'/contact'), 'contact pair')// &
                     ', and the case has '//to_text(size(pair)))
      return
    end if
    n = 0
    do k = 1, size(pair)
      call read_pair(source, root, same_place*length, pair(k), pressure(n + 1:n + pair(k)%n_rows), what, error)
      if (len(what) > 0) &
        call set_error(error, quoted(source%label)//' has other contact rows: '//what// &
                       '; a warm start needs the same meshes and contact settings')
      if (allocated(error)) return
      n = n + pair(k)%n_rows
    end do
  end subroutine read_pairs

  !> Compare one contact pair, and read its pressures.
  subroutine read_pair(source, root, tolerance, pair, pressure, what, error)
    type(hdf5_file_t), intent(in) :: source  !! Results file, open.
    character(*), intent(in) :: root  !! Group of the results.
    real(dp), intent(in) :: tolerance  !! Largest distance between the row of the file and that of the case [length].
    type(contact_pair_t), intent(in) :: pair  !! Contact pair of the case.
    real(dp), contiguous, intent(out) :: pressure(:)  !! Lagrange multipliers of its rows (n_rows) [pressure].
    character(:), allocatable, intent(out) :: what  !! The difference between the rows, in words; empty: none.
    type(error_t), allocatable, intent(out) :: error  !! Where it cannot be read, or its run diverged.
    character(:), allocatable :: group
    real(dp), allocatable :: position(:)
    real(dp) :: distance
    integer :: i
    what = ''
    pressure = 0
    group = root//'/'//contact_group(pair%name)
    if (.not. source%has(group)) then
      what = 'pair '//quoted(pair%name)//' is missing'
      return
    else if (source%n_values(group//'/pressure') /= pair%n_rows) then
      what = 'pair '//quoted(pair%name)//' has '//to_text(max(0_int64, source%n_values(group//'/pressure')))// &
             ' rows in the file and '//to_text(pair%n_rows)//' in the case'
      return
    end if
    allocate (position(3*pair%n_rows))
    call source%read_reals(group//'/position', position, error)
    if (.not. allocated(error)) call source%read_reals(group//'/pressure', pressure, error)
    if (allocated(error)) return
    do i = 1, pair%n_rows
      associate (there => position(3*i - 2:3*i))
        distance = norm2([there(:pair%dimension) - pair%row_position(:, i), there(pair%dimension + 1:)])
      end associate
      if (distance <= tolerance) cycle
      what = 'row '//to_text(i)//' of pair '//quoted(pair%name)//' is displaced by '//to_text(distance, 3)
      return
    end do
    if (.not. (all(ieee_is_finite(pressure)) .and. all(abs(pressure) <= largest_pressure))) &
      call set_error(error, quoted(source%label)//': the pressures of pair '//quoted(pair%name)// &
                     ' are those of a diverged run')
  end subroutine read_pair

  !> The state that a scheme starts from.
  subroutine start_from_pressures(pressure, qp, compliance, state)
    !> Lagrange multipliers of the contact pairs; those of ties start from 0; where all are 0, the scheme starts without
    !> a state (n_rows of the pairs) [pressure].
    real(dp), intent(in) :: pressure(:)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the contact rows; one product is made.
    !> Initial state: pressures and penetrations, without history, L and amplitudes of rigid body modes.
    type(solver_state_t), intent(inout) :: state
    if (.not. any(pressure > 0)) return
    state%pressure = [pressure, spread(0.0_dp, 1, qp%n_rows - size(pressure))]
    if (allocated(state%alpha)) deallocate (state%alpha)
    allocate (state%alpha(qp%coarse%n), state%penetration(qp%n_rows), source=0.0_dp)
    call compliance%multiply(qp, qp%weight*state%pressure, state%penetration)
    state%penetration = qp%initial_penetration - state%penetration
  end subroutine start_from_pressures
end module dotyk_driver_warm_start
