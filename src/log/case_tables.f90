!> Load cases in the log: what acts in each, and the table of all of them.
module dotyk_log_case_tables
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_input_case, only: case_t
  use dotyk_log_load_tables, only: show_loads
  use dotyk_scheme_solver_state, only: ending_name
  implicit none
  private
  public :: add_case_row, show_case, show_case_table

  type, public :: case_row_t  !! A line of the table.
    character(:), allocatable :: name  !! Name of the load case.
    integer :: iterations = 0, active = 0  !! Iterations of the scheme, and active contact rows.
    real(dp) :: energy = 0  !! Potential energy [energy].
    real(dp) :: peak = 0  !! Greatest contact pressure [pressure].
    real(dp) :: least_gap = huge(1.0_dp)  !! Least gap; huge without contact [length].
    real(dp) :: error = 0  !! The greatest part of the relative error that is known [].
    character(:), allocatable :: ending  !! How the scheme ended.
  end type case_row_t

  integer, parameter :: most_shown = 20  !! Greatest number of contact pairs with a line each.

contains

  !> Name of a load case, its loads, and the pairs whose gap or theta it changes.
  subroutine show_case(log, case, k, problem, is_changed)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case, with the contacts of the load case.
    integer, intent(in) :: k  !! The load case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs in the load case.
    logical, intent(in) :: is_changed(:)  !! Whether it changes a pair (n_pairs).
    integer :: i, n
    call log%line('')
    call log%line('  case '//quoted(case%load_case(k)%name)//' ('//to_text(k)//' of '//to_text(case%n_cases())//')')
    if (k == 1) then
      call show_loads(log, case, problem)
    else
      call show_loads(log, case, problem, is_changed)
    end if
    n = 0
    do i = 1, size(is_changed)
      if (.not. is_changed(i)) cycle
      n = n + 1
      if (n > most_shown) cycle
      associate (pair => problem%pair(i))
        call log%line('  '//pair%name//': gap '//to_text(minval(pair%row_gap), 5)//' to '// &
                      to_text(maxval(pair%row_gap), 5)//', theta '//to_text(pair%theta, 5))
      end associate
    end do
    if (n > most_shown) &
      call log%line('  ... '//counted(n - most_shown, 'more contact pair')//' with other gaps or theta')
  end subroutine show_case

  !> Add a line to the table.
  subroutine add_case_row(name, solution, pair_solution, row)
    character(*), intent(in) :: name  !! Name of the load case.
    type(contact_solution_t), intent(in) :: solution  !! Its solution.
    !> Contact pressures, gaps and resultants of the pairs (n_pairs).
    type(pair_solution_t), intent(in) :: pair_solution(:)
    type(case_row_t), allocatable, intent(inout) :: row(:)  !! The table; is longer on return (n_rows).
    type(case_row_t), allocatable :: more(:)
    real(dp) :: part(3)
    integer :: i
    allocate (more(size(row) + 1))
    do i = 1, size(row)
      more(i) = row(i)
    end do
    associate (new => more(size(row) + 1), state => solution%state)
      new%name = name
      new%iterations = state%iterations
      new%active = sum(pair_solution%n_active)
      new%energy = state%energy
      if (size(pair_solution) > 0) new%peak = maxval(pair_solution%peak)
      if (size(pair_solution) > 0) new%least_gap = minval(pair_solution%least_gap)
      part = [state%error_bound, solution%budget%penalty, solution%budget%discretization]
      new%error = maxval(pack(part, .not. ieee_is_nan(part)))
      new%ending = ending_name(state%ended)
    end associate
    call move_alloc(more, row)
  end subroutine add_case_row

  !> The table of all load cases.
  subroutine show_case_table(log, row, n_cases)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_row_t), intent(in) :: row(:)  !! Load cases that were solved (n).
    integer, intent(in) :: n_cases  !! Load cases of the input.
    character(120) :: line
    character(20) :: label
    character(13) :: peak, gap, error
    integer :: k
    call log%line('')
    call log%line('  case                  iterations    active  potential energy  peak pressure     least gap'// &
                  '   error  end')
    do k = 1, size(row)
      label = row(k)%name
      peak = to_text(row(k)%peak, 5)
      gap = '-'
      if (row(k)%least_gap < huge(1.0_dp)) gap = to_text(row(k)%least_gap, 4)
      error = 'unknown'
      if (row(k)%error < 1.0e100_dp) error = to_text(100*row(k)%error, 2)//' %'
      write (line, '(2x,a20,1x,i11,i10,2x,a16,2x,a13,1x,a13,1x,a7)') label, row(k)%iterations, row(k)%active, &
        adjustr(wide(to_text(row(k)%energy, 8))), adjustr(peak), adjustr(gap), adjustr(error(1:7))
      call log%line(trim(line)//'  '//row(k)%ending)
    end do
    if (size(row) < n_cases) &
      call log%line('  interrupted: '//counted(n_cases - size(row), 'load case')//' not solved')
  end subroutine show_case_table

  !> A text in the width of the column of energies.
  pure function wide(text)
    character(*), intent(in) :: text  !! The text.
    character(16) :: wide
    wide = text
  end function wide
end module dotyk_log_case_tables
