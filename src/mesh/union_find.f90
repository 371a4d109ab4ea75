!> Union-find forests: sets of numbers 1..n that are joined two by two.
module dotyk_mesh_union_find
  implicit none
  private
  public :: join, root_of

contains

  !> Root of a number: the lowest of its set. Paths are shortened by halving.
  integer function root_of(parent, number) result(root)
    integer, intent(inout) :: parent(:)  !! Parent of each number, itself at a root (n); paths are shortened.
    integer, intent(in) :: number  !! The number.
    root = number
    do while (parent(root) /= root)
      parent(root) = parent(parent(root))
      root = parent(root)
    end do
  end function root_of

  !> Join the sets of two numbers.
  subroutine join(parent, a, b)
    integer, intent(inout) :: parent(:)  !! Parent of each number, itself at a root (n); updated.
    integer, intent(in) :: a  !! First number.
    integer, intent(in) :: b  !! Second number.
    integer :: i, j
    i = root_of(parent, a)
    j = root_of(parent, b)
    parent(max(i, j)) = min(i, j)
  end subroutine join
end module dotyk_mesh_union_find
