!> Penalty parameters of the contact rows, theta of (18), from values at the quadrature points: by a formula of the
!> position, or any others.
module dotyk_model_row_theta
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: is_too_large, size_rule
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  implicit none
  private
  public :: set_formula_theta, set_row_theta

contains

  !> Set the penalty parameters of a pair by a formula of the position on surface_a.
  subroutine set_formula_theta(text, allows_zero, pair, error)
    character(*), intent(in) :: text  !! The formula, in x, y, z [length/pressure].
    logical, intent(in) :: allows_zero  !! Whether the formula may be zero at points.
    type(contact_pair_t), intent(inout) :: pair  !! The contact pair; its penalty parameters are set.
    !> Allocated where the formula cannot be read, or is negative, zero though it must not be, too large or no number at
    !> a point; names the pair and the point.
    type(error_t), allocatable, intent(out) :: error
    type(formula_t) :: formula
    real(dp) :: at_points(pair%n_points), x(3)
    integer :: i
    call formula%init(text, error)
    if (allocated(error)) return
    x = 0
    do i = 1, pair%n_points
      x(1:pair%dimension) = pair%position(:, i)
      at_points(i) = formula%evaluate(x)
      if (.not. is_wrong(at_points(i))) cycle
      !$omp critical (message)
      call set_error(error, '&contact '//quoted(pair%name)//': theta_formula is '//to_text(at_points(i))//' at ('// &
                     to_text(x(1))//', '//to_text(x(2))//', '//to_text(x(3))//')', exit_bad_input)
      if (at_points(i) < 0) then
        error%message = error%message//'; theta must not be negative'
      else if (pair%is_layer .and. abs(at_points(i)) <= 0) then
        error%message = error%message//'; theta of a layer must be positive'
      else if (abs(at_points(i)) <= 0) then
        error%message = error%message//"; theta = 0 needs scheme='dual'"
      else if (ieee_is_finite(at_points(i))) then
        error%message = error%message//'; '//size_rule
      end if
      !$omp end critical (message)
      exit
    end do
    call formula%destroy()
    if (.not. allocated(error)) call set_row_theta(1.0_dp, at_points, pair)
  contains
    !> Whether a value is no penalty parameter.
    pure logical function is_wrong(value)
      real(dp), intent(in) :: value  !! Value of the formula [length/pressure].
      is_wrong = ieee_is_nan(value) .or. is_too_large(value)
      if (.not. is_wrong) is_wrong = value < 0 .or. (.not. value > 0 .and. .not. allows_zero)
    end function is_wrong
  end subroutine set_formula_theta

  !> Set the penalty parameters of the rows of a pair, means of values at its points.
  subroutine set_row_theta(factor, at_points, pair)
    real(dp), intent(in) :: factor  !! Factor of the values [].
    real(dp), intent(in) :: at_points(:)  !! Values at the points (n_points) [length/pressure].
    type(contact_pair_t), intent(inout) :: pair  !! The contact pair; its penalty parameters are set.
    integer :: i, k
    ! Weights of dual shape functions may be negative: theta of a row is the mean by their magnitudes.
    associate (average => pair%average)
      do i = 1, pair%n_rows
        pair%row_theta(i) = 0
        do k = average%row_start(i), average%row_start(i + 1) - 1
          pair%row_theta(i) = pair%row_theta(i) + abs(average%value(k))*at_points(average%column(k))
        end do
        pair%row_theta(i) = factor*pair%row_theta(i)/ &
                            sum(abs(average%value(average%row_start(i):average%row_start(i + 1) - 1)))
      end do
    end associate
    pair%theta = sum(pair%row_weight*pair%row_theta)/sum(pair%row_weight)
  end subroutine set_row_theta
end module dotyk_model_row_theta
