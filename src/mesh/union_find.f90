!> Union-find forests: sets of numbers 1..n that are joined two by two.
module dotyk_mesh_union_find
  implicit none
  private
  public :: join, root_of

contains

  !> Root of a number: the lowest of its set. Paths are shortened by halving.
  integer function root_of(parent, number) result(root)
    !> Parent of each number, itself at a root (n); paths are shortened.
    integer, intent(inout) :: parent(:)
    !> The number.
    integer, intent(in) :: number
    root = number
    do while (parent(root) /= root)
      parent(root) = parent(parent(root))
      root = parent(root)
    end do
  end function root_of

  !> Join the sets of two numbers.
  subroutine join(parent, a, b)
    !> Parent of each number, itself at a root (n); updated.
    integer, intent(inout) :: parent(:)
    !> First number.
    integer, intent(in) :: a
    !> Second number.
    integer, intent(in) :: b
    integer :: i, j
    i = root_of(parent, a)
    j = root_of(parent, b)
    parent(max(i, j)) = min(i, j)
  end subroutine join
end module dotyk_mesh_union_find
