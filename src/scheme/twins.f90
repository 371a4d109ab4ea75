!> Bodies of one kind whose contact points are the same, as in a row of equal bodies that touch in the same way: their compliances
!> `B_b K_b^{-1} B_b^T` are the same matrix.
module dotyk_scheme_twins
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: are_twins

  !> Entries of B that differ by less, relative to the largest of their row, differ by the rounding of places.
  real(dp), parameter :: same_entry = 1.0e-12_dp

contains

  !> Whether rows of two bodies are the same, each in the axes of the kind.
  logical function are_twins(problem, b, row_b, c, row_c) result(are)
    type(contact_problem_t), intent(in) :: problem
    !> The bodies.
    integer, intent(in) :: b, c
    !> Places among the rows of each.
    integer, intent(in) :: row_b(:), row_c(:)
    real(dp), allocatable :: difference(:, :)
    real(dp) :: largest
    integer :: i
    are = .false.
    if (.not. allocated(problem%kind)) return
    if (problem%kind(b) /= problem%kind(c) .or. size(row_b) /= size(row_c)) return
    associate (block_b => problem%operator%block(b), block_c => problem%operator%block(c))
      if (block_b%n_nodes /= block_c%n_nodes) return
      if (any(block_b%contact_node /= block_c%contact_node)) return
      allocate (difference(problem%operator%dimension, block_b%n_nodes), source=0.0_dp)
      do i = 1, size(row_b)
        largest = 0
        call add_row(block_b, row_b(i), problem%axes(:, :, b), 1.0_dp, difference, largest)
        call add_row(block_c, row_c(i), problem%axes(:, :, c), -1.0_dp, difference, largest)
        if (.not. is_small(block_b, row_b(i), difference, same_entry*largest)) return
        if (.not. is_small(block_c, row_c(i), difference, same_entry*largest)) return
        call clear(block_b, row_b(i), difference)
        call clear(block_c, row_c(i), difference)
      end do
    end associate
    are = .true.
  end function are_twins

  !> Add a row, in the axes of the kind.
  pure subroutine add_row(block, row, axes, factor, sum, largest)
    type(contact_block_t), intent(in) :: block
    integer, intent(in) :: row
    !> The axes of the kind, turned with the body, as columns (dimension, dimension).
    real(dp), intent(in) :: axes(:, :)
    real(dp), intent(in) :: factor
    !> (dimension, n_nodes).
    real(dp), intent(inout) :: sum(:, :)
    !> Largest entry so far.
    real(dp), intent(inout) :: largest
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
    type(contact_block_t), intent(in) :: block
    integer, intent(in) :: row
    !> (dimension, n_nodes).
    real(dp), intent(in) :: values(:, :)
    real(dp), intent(in) :: limit
    integer :: k
    is_small = .false.
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      if (any(abs(values(:, (block%matrix%column(k) - 1)/size(values, 1) + 1)) > limit)) return
    end do
    is_small = .true.
  end function is_small

  !> Set the nodes of a row to zero.
  pure subroutine clear(block, row, values)
    type(contact_block_t), intent(in) :: block
    integer, intent(in) :: row
    !> (dimension, n_nodes).
    real(dp), intent(inout) :: values(:, :)
    integer :: k
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      values(:, (block%matrix%column(k) - 1)/size(values, 1) + 1) = 0
    end do
  end subroutine clear
end module dotyk_scheme_twins
