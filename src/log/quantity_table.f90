!> Quantities with error bars of the mesh in the log.
module dotyk_log_quantity_table
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, to_text
  use dotyk_control_quantity_error, only: bar_is_known, bar_no_contact, bar_no_estimate, bar_no_factors, &
    bar_no_limit, bar_one_mesh, bar_singular, bar_soft, bar_zero, quantity_errors_t, quantity_value_t
  implicit none
  private
  public :: show_quantities

  integer, parameter :: most_digits = 10, digits_of_error = 2  !! Digits of a value at most, and of its error bar.
  integer, parameter :: most_shown = 20  !! Greatest number of quantities with a line each; more are counted.

contains

  !> A line for each quantity.
  subroutine show_quantities(log, quantities)
    type(log_t), intent(inout) :: log  !! The log.
    type(quantity_errors_t), intent(in) :: quantities  !! The quantities; nothing is shown where there are none.
    character(:), allocatable :: name
    integer :: i, n
    if (.not. allocated(quantities%of)) return
    n = size(quantities%of)
    if (n > 0) call log%line('  quantity             value, error bar of the mesh')
    do i = 1, min(n, most_shown)
      name = quantities%of(i)%name
      call log%line('  '//name//repeat(' ', max(1, 21 - len(name)))//quantity_text(quantities%of(i)))
    end do
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more quantity', 'more quantities')// &
                                      ' in the results file')
  end subroutine show_quantities

  !> Value and error bar, or why there is none.
  function quantity_text(of) result(text)
    type(quantity_value_t), intent(in) :: of  !! The quantity.
    character(:), allocatable :: text
    integer :: digits
    if (of%why_unknown /= bar_is_known) then
      text = to_text(of%value, 6)//', no error bar: '//reason(of%why_unknown)
      return
    end if
    digits = most_digits
    if (of%error > 0) digits = digits_of_error + ceiling(log10(max(1.0_dp, abs(of%value)/of%error)))
    text = to_text(of%value, min(most_digits, digits))//' +- '//to_text(of%error, digits_of_error)
  end function quantity_text

  !> Why there is no error bar.
  function reason(why) result(text)
    integer, intent(in) :: why  !! One of `bar_*`.
    character(:), allocatable :: text
    select case (why)
    case (bar_no_contact)
      text = 'no constraint is active'
    case (bar_zero)
      text = 'zero, but for rounding'
    case (bar_no_estimate)
      text = 'the discretization error is not known'
    case (bar_no_factors)
      text = "bodies have no factors; response='full' has them"
    case (bar_soft)
      text = 'supports hardly resist motions of bodies'
    case (bar_singular)
      text = 'contact forces are not unique'
    case (bar_one_mesh)
      text = 'one mesh only; &accuracy has several'
    case (bar_no_limit)
      text = 'it grows from mesh to mesh and has no limit'
    case default
      text = 'unknown'
    end select
  end function reason
end module dotyk_log_quantity_table
