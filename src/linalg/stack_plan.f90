!> Positions of the update matrices on the working stack of a subtree of supernodes.
module dotyk_linalg_stack_plan
  use dotyk_base_kinds, only: int64
  use dotyk_linalg_supernodes, only: supernodes_t, supernode_tree_t
  implicit none
  private
  public :: plan_stack

contains

  !> Update matrices of the levels of the subtree lie in turn on two stacks in one array: one grows from the lower end,
  !> the other from the upper end. Children and parent are on different stacks, so no update matrix is ever moved.
  pure subroutine plan_stack(supernodes, tree, t, position, side, needed)
    !> Supernodes of the factor.
    type(supernodes_t), intent(in) :: supernodes
    !> Their elimination tree, cut into subtrees.
    type(supernode_tree_t), intent(in) :: tree
    !> Number of the subtree.
    integer, intent(in) :: t
    !> First entry of the update matrix of each supernode in the array, from 0 (0:n-1); set for the supernodes of the
    !> subtree.
    integer(int64), intent(inout) :: position(0:)
    !> Stack of each supernode, 0 (lower) or 1 (upper) (0:n-1); set for the supernodes of the subtree.
    integer, intent(inout) :: side(0:)
    !> Length of the array.
    integer(int64), intent(out) :: needed
    integer :: i, s, child, first, last
    integer(int64) :: height(0:1)
    first = tree%first(t)
    last = tree%last(t)
    side(tree%order(last)) = 0
    do i = last - 1, first, -1
      s = tree%order(i)
      side(s) = 1 - side(tree%parent(s))
    end do
    needed = 0
    height = 0
    do i = first, last
      s = tree%order(i)
      position(s) = height(side(s))
      height(side(s)) = height(side(s)) + update_entries(s)
      needed = max(needed, sum(height))
      child = tree%first_child(s)
      if (child >= 0) height(1 - side(s)) = position(child)
    end do
    do i = first, last
      s = tree%order(i)
      if (side(s) == 1) position(s) = needed - position(s) - update_entries(s)
    end do
  contains
    !> Entries of the update matrix of a supernode, stored as a square.
    pure integer(int64) function update_entries(s)
      !> The supernode.
      integer, intent(in) :: s
      update_entries = int(supernodes%rows(s) - supernodes%columns(s), int64)**2
    end function update_entries
  end subroutine plan_stack
end module dotyk_linalg_stack_plan
