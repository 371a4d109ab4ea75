!> Extend-add of update matrices in multifrontal elimination by blocks: from the rows of a child to the panel of its
!> parent.
module dotyk_linalg_block_extend_add
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_tree, only: block_tree_t
  implicit none
  private
  public :: find_places, add_update

contains

  !> Position of each block in the panel of a group.
  pure subroutine find_places(tree, offset, g, place)
    !> Structure of the factor.
    type(block_tree_t), intent(in) :: tree
    !> Rows of its group's panel before each block, by elimination times (n_blocks).
    integer, intent(in) :: offset(:)
    !> The group.
    integer, intent(in) :: g
    !> Rows of the panel of g before each block that it has, by elimination times; others keep their values (n_blocks).
    integer, intent(inout) :: place(:)
    integer :: i
    do i = tree%begin(g), tree%begin(g + 1) - 1
      place(i) = offset(i)
    end do
    do i = tree%under_start(g), tree%under_start(g + 1) - 1
      place(tree%under(i)) = tree%under_row(i)
    end do
  end subroutine find_places

  !> Add the update matrix of a child to the panel and the update matrix of its parent.
  pure subroutine add_update(tree, c, place, child_update, panel, update)
    !> Structure of the factor.
    type(block_tree_t), intent(in) :: tree
    !> The child.
    integer, intent(in) :: c
    !> `find_places` of the parent (n_blocks).
    integer, intent(in) :: place(:)
    !> Update matrix of the child, lower triangle (rows below the child, the same) [as the matrix].
    real(dp), intent(in) :: child_update(:, :)
    !> Panel of the parent (height, width) [as the matrix].
    real(dp), intent(inout) :: panel(:, :)
    !> Update matrix of the parent, lower triangle (height - width, height - width) [as the matrix].
    real(dp), intent(inout) :: update(:, :)
    integer :: to(size(child_update, 1)), i, j, n, width
    n = 0
    do i = tree%under_start(c), tree%under_start(c + 1) - 1
      associate (rows => tree%size(tree%order(tree%under(i))))
        to(n + 1:n + rows) = [(place(tree%under(i)) + j, j=1, rows)]
        n = n + rows
      end associate
    end do
    width = size(panel, 2)
    do j = 1, n
      if (to(j) <= width) then
        do i = j, n
          panel(to(i), to(j)) = panel(to(i), to(j)) + child_update(i, j)
        end do
      else
        do i = j, n
          update(to(i) - width, to(j) - width) = update(to(i) - width, to(j) - width) + child_update(i, j)
        end do
      end if
    end do
  end subroutine add_update
end module dotyk_linalg_block_extend_add
