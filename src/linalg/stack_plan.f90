!> Where the updates of a subtree of supernodes lie while it is factorized.
module dotyk_linalg_stack_plan
  use dotyk_base_kinds, only: int64
  use dotyk_linalg_supernodes, only: supernodes_t, supernode_tree_t
  implicit none
  private
  public :: plan_stack

contains

  !> Children lie on one stack, from the lower end up, their parents on another, from the upper end down, so that a parent's update
  !> never has to be moved.
  pure subroutine plan_stack(supernodes, tree, t, place, side, needed)
    type(supernodes_t), intent(in) :: supernodes
    type(supernode_tree_t), intent(in) :: tree
    !> The subtree.
    integer, intent(in) :: t
    !> Where the update of a supernode starts, 0-based (0:n-1); only those of the subtree are set.
    integer(int64), intent(inout) :: place(0:)
    !> Which of the two stacks it is on (0:n-1), likewise.
    integer, intent(inout) :: side(0:)
    !> Length of both stacks together.
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
      place(s) = height(side(s))
      height(side(s)) = height(side(s)) + update_length(s)
      needed = max(needed, sum(height))
      child = tree%first_child(s)
      if (child >= 0) height(1 - side(s)) = place(child)
    end do
    do i = first, last
      s = tree%order(i)
      if (side(s) == 1) place(s) = needed - place(s) - update_length(s)
    end do
  contains
    !> Entries of the square that a supernode's update is.
    pure integer(int64) function update_length(s)
      integer, intent(in) :: s
      update_length = int(supernodes%rows(s) - supernodes%columns(s), int64)**2
    end function update_length
  end subroutine plan_stack
end module dotyk_linalg_stack_plan
