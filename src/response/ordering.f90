!> Fill-reducing order of a body's equations.
!>
!> Nested dissection orders the nodes, not the equations: the graph is three times smaller, and the equations of a node stay
!> together.
module dotyk_response_ordering
  use dotyk_base_error, only: error_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_linalg_ordering, only: nested_dissection
  implicit none
  private
  public :: order_equations

contains

  !> Order the free equations of a body.
  subroutine order_equations(body, permutation, error)
    !> The body, assembled.
    type(body_t), intent(in) :: body
    !> The k-th equation of the new order (n_equations).
    integer, allocatable, intent(out) :: permutation(:)
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: node_order(:)
    integer :: i, k, component, equation
    call nested_dissection(body%graph_start, body%graph_neighbour, node_order, error)
    if (allocated(error)) return
    allocate (permutation(body%constraint%n_equations))
    k = 0
    do i = 1, size(node_order)
      do component = 1, body%dimension
        equation = body%constraint%equation(component, node_order(i))
        if (equation == 0) cycle
        k = k + 1
        permutation(k) = equation
      end do
    end do
  end subroutine order_equations
end module dotyk_response_ordering
