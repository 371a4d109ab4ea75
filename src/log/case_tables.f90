!> Load cases in the log: what acts in each, resultants of the loads, warnings of formulas that quadrature does not
!> resolve, and the table of all cases.
module dotyk_log_case_tables
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t, most_shown
  use dotyk_base_options, only: analysis_axisymmetric, gap_formula
  use dotyk_base_text, only: counted, quoted, text_t, to_text
  use dotyk_base_thresholds, only: notable, rounding
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load_report, only: difference_in_volume, difference_on_surface, load_resultant_t
  use dotyk_input_case, only: case_t
  use dotyk_scheme_solver_state, only: ending_name
  implicit none
  private
  public :: add_case_row, show_case, show_case_table, show_loads, resultant_line, vector_text

  type, public :: case_row_t  !! A line of the table.
    character(:), allocatable :: name  !! Name of the load case.
    integer :: iterations = 0, active = 0  !! Iterations of the scheme, and active contact rows.
    real(dp) :: energy = 0  !! Potential energy [energy].
    real(dp) :: peak = 0  !! Greatest contact pressure [pressure].
    real(dp) :: least_gap = huge(1.0_dp)  !! Least gap; huge without contact [length].
    real(dp) :: error = 0  !! The greatest part of the relative error that is known [].
    character(:), allocatable :: ending  !! How the scheme ended.
  end type case_row_t

  integer, parameter :: label_width = 20  !! Width of the first column.

  !> What a force without area means, for warnings.
  character(*), parameter, public :: concentrated = 'an edge or nodes: stress and displacement there have no limit '// &
    'as the mesh is refined; the estimated error of the mesh leaves out the elements there'

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
    type(pair_solution_t), intent(in) :: pair_solution(:)  !! Results of the pairs (n_pairs).
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
    if (size(row) < n_cases) call log%line('  interrupted: '//counted(n_cases - size(row), 'load case')//' not solved')
  end subroutine show_case_table

  !> A text in the width of the column of energies.
  pure function wide(text)
    character(*), intent(in) :: text  !! The text.
    character(16) :: wide
    wide = text
  end function wide

  !> The resultant of each load, and the warnings.
  subroutine show_loads(log, case, problem, changed)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies with loads, and pairs.
    !> Pairs of which warnings are new, where those of the bodies are not; all are new if absent (n_pairs).
    logical, intent(in), optional :: changed(:)
    integer :: b, k, n
    n = 0
    do b = 1, size(problem%body)
      if (.not. allocated(problem%body(b)%resultant)) cycle
      do k = 1, size(problem%body(b)%resultant)
        n = n + 1
        if (n == 1) then
          call log%line('')
          call log%line('  load                 resultant')
        end if
        if (n <= most_shown) call log%line(resultant_line(problem%body(b), problem%body(b)%resultant(k)))
      end do
    end do
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more load'))
    do b = 1, size(problem%body)
      if (.not. allocated(problem%body(b)%resultant)) cycle
      if (.not. any(problem%body(b)%resultant%is_concentrated)) cycle
      call log%line('    warning: '//quoted(problem%body(b)%name)//': a load on '//concentrated)
      exit
    end do
    call show_initial_states(log, problem%body)
    call warn_of_formulas(log, case, problem, changed)
  end subroutine show_loads

  !> Line of one load, or of the reaction of one support.
  function resultant_line(body, resultant, scale) result(line)
    type(body_t), intent(in) :: body  !! The body.
    type(load_resultant_t), intent(in) :: resultant  !! The resultant.
    !> Size of all forces and moments on the body, for what is rounding; the components themselves if absent (2)
    !> [force, force length].
    real(dp), intent(in), optional :: scale(2)
    real(dp) :: largest(2)
    character(:), allocatable :: line, label
    largest = 0
    if (present(scale)) largest = scale
    label = body%name//':'//resultant%place
    line = '  '//label//repeat(' ', max(0, label_width - len(label)))//' force '// &
           vector_text(resultant%force, largest(1))
    if (body%analysis == analysis_axisymmetric) then
      if (abs(resultant%radial) > rounding*largest(1)) &
        line = line//', radial '//to_text(resultant%radial, 5)//' around the circumference'
    else if (body%dimension == 2) then
      line = line//', moment about the origin '//&
             to_text(merge(resultant%moment(3), 0.0_dp, abs(resultant%moment(3)) > rounding*largest(2)), 5)
    else
      line = line//', moment about the origin '//vector_text(resultant%moment, largest(2))
    end if
  end function resultant_line

  !> A vector; components that are rounding beside the others are written as zero.
  function vector_text(v, scale) result(text)
    real(dp), intent(in) :: v(3)  !! The vector (3) [any].
    real(dp), intent(in), optional :: scale  !! What else tells the size; nothing if absent [as v].
    character(:), allocatable :: text
    real(dp) :: clean(3), largest
    largest = maxval(abs(v))
    if (present(scale)) largest = max(largest, scale)
    clean = merge(v, 0.0_dp, abs(v) > rounding*largest)
    text = '('//to_text(clean(1), 5)//', '//to_text(clean(2), 5)//', '//to_text(clean(3), 5)//')'
  end function vector_text

  !> Warn of formulas for which two quadrature rules differ.
  subroutine warn_of_formulas(log, case, problem, changed)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    logical, intent(in), optional :: changed(:)  !! As in `show_loads` (n_pairs).
    type(text_t), allocatable :: formula(:)
    integer :: b, k
    do b = 1, size(problem%body)
      associate (body => problem%body(b))
        if (allocated(body%unresolved)) then
          do k = 1, size(body%unresolved)
            call log%line('    warning: '//body%unresolved(k)%s)
          end do
        end if
        if (present(changed)) cycle
        do k = 1, size(body%material)
          if (.not. body%material(k)%has_modulus_field() .or. .not. problem%classes%is_representative(b)) cycle
          if (allocated(body%material(k)%modulus_formula)) then
            allocate (formula(1))
            formula(1)%s = body%material(k)%modulus_formula
            call warn_of_material(': young_formula', formula)
            deallocate (formula)
          end if
          if (allocated(body%material(k)%formulas%stiffness)) &
            call warn_of_material(': material '//quoted(body%material(k)%name), body%material(k)%formulas%stiffness)
          if (allocated(body%material(k)%formulas%expansion)) &
            call warn_of_material(': expansion_formula', body%material(k)%formulas%expansion)
        end do
      end associate
    end do
    do k = 1, min(size(case%contact), size(problem%pair))
      if (case%contact(k)%gap_kind /= gap_formula) cycle
      if (present(changed)) then
        if (.not. changed(k)) cycle
      end if
      allocate (formula(1))
      formula(1)%s = case%contact(k)%gap_formula
      call warn('contact '//quoted(problem%pair(k)%name)//': gap_formula', &
                difference_on_surface(problem%body(problem%pair(k)%body_a)%mesh, problem%surface_a(k), formula), &
                'facets', 'the gaps are')
      deallocate (formula)
    end do

  contains

    !> Add a warning about formulas of a material: each by itself, for they differ in size.
    subroutine warn_of_material(name, formulas)
      character(*), intent(in) :: name  !! What has the formulas.
      type(text_t), intent(in) :: formulas(:)  !! The formulas (n).
      type(text_t), allocatable :: one(:)
      real(dp) :: difference
      integer :: i
      difference = 0
      allocate (one(1))
      do i = 1, size(formulas)
        one(1)%s = formulas(i)%s
        difference = max(difference, difference_in_volume(problem%body(b)%mesh, one))
      end do
      call warn(quoted(problem%body(b)%name)//name, difference, 'elements', &
                'the stiffness and the estimated discretization error are')
    end subroutine warn_of_material

    !> Add a warning where the difference is notable.
    subroutine warn(name, difference, where, what)
      character(*), intent(in) :: name  !! What has the formula.
      real(dp), intent(in) :: difference  !! Difference of two rules, relative [].
      character(*), intent(in) :: where  !! 'elements' or 'facets'.
      character(*), intent(in) :: what  !! What is wrong, and its verb.
      if (difference > notable) &
        call log%line('    warning: '//name//' varies within '//where//': two quadrature rules differ by '// &
                      to_text(100*difference, 2)//' %, and '//what//' no better')
    end subroutine warn
  end subroutine warn_of_formulas

  !> One line for each body that has any, or for successive ones with the same.
  subroutine show_initial_states(log, body)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    character(:), allocatable :: line, next
    character(20) :: label
    integer :: b, n, n_like
    line = ''
    n = 0
    n_like = 0
    do b = 1, size(body)
      next = state_text(body(b))
      if (len(next) > 0 .and. next == line) then
        n_like = n_like + 1
        cycle
      end if
      call show()
      line = next
      label = body(b)%name
      n_like = 0
    end do
    call show()
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more body', 'more bodies'))

  contains

    !> The line of a body, and how many bodies after it have the same.
    subroutine show()
      if (len(line) == 0) return
      n = n + 1
      if (n == 1) then
        call log%line('')
        call log%line('  body                 temperature, initial stress')
      end if
      if (n > most_shown) return
      if (n_like > 0) line = line//', and the next '//counted(n_like, 'body', 'bodies')
      call log%line('  '//label//' '//line)
    end subroutine show

    !> Temperature and initial stress of a body; empty where it has neither.
    function state_text(body) result(text)
      type(body_t), intent(in) :: body  !! The body.
      character(:), allocatable :: text
      text = ''
      associate (state => body%initial)
        if (.not. state%is_set()) return
        text = 'no temperature'
        if (allocated(state%temperature)) text = to_text(state%range(1), 6)
        if (state%range(2) > state%range(1)) text = text//' to '//to_text(state%range(2), 6)
        if (allocated(state%stress)) text = text//', initial stress'
      end associate
    end function state_text
  end subroutine show_initial_states
end module dotyk_log_case_tables
