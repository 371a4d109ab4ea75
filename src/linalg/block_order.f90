!> Elimination orders of block-sparse symmetric matrices.
module dotyk_linalg_block_order
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_tree, only: block_tree_t
  use dotyk_linalg_ordering, only: nested_dissection
  implicit none
  private
  public :: order_blocks

  !> Separators of each level from which the smallest one is taken: about half the operations for thousands of bodies in
  !> a box. Their order is luck all the same, for a thousand of them a worse one.
  integer, parameter :: separators = 20
  !> Fewer blocks than this have cheap factors in any order.
  integer, parameter :: many = 1000

contains

  !> The better one of two orders by nested dissection. Any order is right: the blocks as they are where METIS fails.
  subroutine order_blocks(sizes, start, neighbour, order)
    !> Rows of each block (n_blocks).
    integer, intent(in) :: sizes(:)
    !> Coupled blocks of block p, without p itself: neighbour(start(p):start(p+1)-1); symmetric (n_blocks + 1).
    integer, intent(in) :: start(:)
    !> See `start` (number of couplings).
    integer, intent(in) :: neighbour(:)
    !> The block that is eliminated k-th (n_blocks).
    integer, allocatable, intent(out) :: order(:)
    type(error_t), allocatable :: error
    type(block_tree_t) :: tree
    integer, allocatable :: other(:)
    real(dp) :: operations
    integer :: b
    allocate (order(size(sizes)), other(size(sizes)))
    call nested_dissection(start, neighbour, order, error)
    if (allocated(error)) order = [(b, b=1, size(sizes))]
    if (allocated(error) .or. size(sizes) < many) return
    call nested_dissection(start, neighbour, other, error, separators=separators)
    if (allocated(error)) return
    call tree%init(sizes, start, neighbour, order)
    operations = tree%operations()
    call tree%init(sizes, start, neighbour, other)
    if (tree%operations() < operations) call move_alloc(other, order)
  end subroutine order_blocks
end module dotyk_linalg_block_order
