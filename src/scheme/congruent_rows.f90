!> Congruent bodies whose rows of B are the same, as in a row of equal bodies that touch in the same way: their
!> compliances `B_b K_b^+ B_b^T` are one matrix.
module dotyk_scheme_congruent_rows
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_operator, only: contact_block_t
  implicit none
  private
  public :: have_same_rows

contains

  !> Whether rows of two congruent bodies are the same, each in the axes of the representative of their class.
  logical function have_same_rows(block_b, rotation_b, place_b, block_c, rotation_c, place_c) result(same)
    type(contact_block_t), intent(in) :: block_b  !! Rows of B of the one body.
    type(contact_block_t), intent(in) :: block_c  !! Rows of B of the other body.
    !> Rotation from the representative to each body, as columns (dimension, dimension) [].
    real(dp), intent(in) :: rotation_b(:, :), rotation_c(:, :)
    integer, intent(in) :: place_b(:), place_c(:)  !! Which of its rows (n).
    real(dp), allocatable :: difference(:, :)
    real(dp) :: largest
    integer :: i
    same = .false.
    if (size(place_b) /= size(place_c) .or. block_b%n_nodes /= block_c%n_nodes) return
    if (any(block_b%node_numbers() /= block_c%node_numbers())) return
    allocate (difference(size(rotation_b, 1), block_b%n_nodes), source=0.0_dp)
    do i = 1, size(place_b)
      largest = 0
      call add_row(block_b, place_b(i), rotation_b, 1.0_dp, difference, largest)
      call add_row(block_c, place_c(i), rotation_c, -1.0_dp, difference, largest)
      if (.not. is_small(block_b, place_b(i), difference, rounding*largest)) return
      if (.not. is_small(block_c, place_c(i), difference, rounding*largest)) return
      call clear(block_b, place_b(i), difference)
      call clear(block_c, place_c(i), difference)
    end do
    same = .true.
  end function have_same_rows

  !> Add a row in the axes of the representative.
  pure subroutine add_row(block, row, axes, factor, sum, largest)
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: row  !! Which of its rows.
    real(dp), intent(in) :: axes(:, :)  !! As `rotation_b` (dimension, dimension) [].
    real(dp), intent(in) :: factor  !! 1 to add, -1 to subtract [].
    real(dp), intent(inout) :: sum(:, :)  !! By nodes (dimension, n_nodes) [].
    real(dp), intent(inout) :: largest  !! Largest entry so far [].
    integer :: k, d, node, component
    d = size(sum, 1)
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      node = (block%matrix%column(k) - 1)/d + 1
      component = block%matrix%column(k) - (node - 1)*d
      sum(:, node) = sum(:, node) + factor*block%matrix%value(k)*axes(component, :)
      largest = max(largest, abs(block%matrix%value(k)))
    end do
  end subroutine add_row

  !> Whether the nodes of a row have small entries.
  pure logical function is_small(block, row, values, limit)
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: row  !! Which of its rows.
    real(dp), intent(in) :: values(:, :)  !! Sum of the rows, by nodes (dimension, n_nodes) [].
    real(dp), intent(in) :: limit  !! Largest absolute value that is small [].
    integer :: k
    is_small = .false.
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      if (any(abs(values(:, (block%matrix%column(k) - 1)/size(values, 1) + 1)) > limit)) return
    end do
    is_small = .true.
  end function is_small

  !> Set the nodes of a row to zero.
  pure subroutine clear(block, row, values)
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: row  !! Which of its rows.
    real(dp), intent(inout) :: values(:, :)  !! Sum of the rows, by nodes (dimension, n_nodes) [].
    integer :: k
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      values(:, (block%matrix%column(k) - 1)/size(values, 1) + 1) = 0
    end do
  end subroutine clear
end module dotyk_scheme_congruent_rows
