!> Resultants of the loads in the log, and warnings of formulas that quadrature does not resolve.
module dotyk_log_load_tables
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: analysis_axisymmetric, gap_formula
  use dotyk_base_text, only: counted, quoted, text_t, to_text
  use dotyk_base_thresholds, only: rounding
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load_report, only: difference_in_volume, difference_on_surface, load_resultant_t, &
    notable_difference
  use dotyk_input_case, only: case_t
  implicit none
  private
  public :: show_loads, resultant_line, vector_text

  !> Greatest number of loads, or bodies, with a line each; more are summed up by the table's last line.
  integer, parameter :: most_shown = 20
  integer, parameter :: label_width = 20  !! Width of the first column.

contains

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
      if (difference > notable_difference) &
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
end module dotyk_log_load_tables
