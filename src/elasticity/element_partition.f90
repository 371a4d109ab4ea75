!> Elements shared out over threads so that sums over the elements of a node have one order, whatever the number of threads.
!>
!> Elements are given in an order; each thread gets a run of them, and owns the nodes that no run before touches. What elements add to a
!> node is added by its owner, in their order: its own run holds the first ones, and it works on the few elements of later runs that
!> touch its nodes as well.
module dotyk_elasticity_element_partition
  implicit none
  private

  !> The shares.
  type, public :: element_partition_t
    !> Number of shares.
    integer :: n = 0
    !> Share that owns each node; 0 for nodes of no element (n_nodes).
    integer, allocatable :: owner(:)
    !> Elements of share s, as places in the order, ascending: place(first(s) : first(s + 1) - 1).
    integer, allocatable :: first(:), place(:)
    !> Those up to own(s) are its run; the others are in other shares' runs (n).
    integer, allocatable :: own(:)
  contains
    procedure :: init => element_partition_init
  end type element_partition_t

contains

  !> Share out elements.
  subroutine element_partition_init(self, n_nodes, node, order, n_shares)
    class(element_partition_t), intent(out) :: self
    integer, intent(in) :: n_nodes
    !> Nodes of the elements (n, n_elements).
    integer, intent(in) :: node(:, :)
    !> The element that comes k-th (n_elements).
    integer, intent(in) :: order(:)
    !> Number of shares, at least 1.
    integer, intent(in) :: n_shares
    integer, allocatable :: last(:)
    integer :: i, k, s, pass
    self%n = n_shares
    allocate (self%owner(n_nodes), self%first(n_shares + 1), self%own(n_shares), last(0:n_shares), source=0)
    do k = 1, size(order)
      do i = 1, size(node, 1)
        associate (owner => self%owner(node(i, order(k))))
          if (owner == 0) owner = run_of(k)
        end associate
      end do
    end do
    ! Count, then list.
    do pass = 1, 2
      do k = 1, size(order)
        call add(run_of(k), k)
        do i = 1, size(node, 1)
          s = self%owner(node(i, order(k)))
          if (s == run_of(k)) cycle
          if (any(self%owner(node(:i - 1, order(k))) == s)) cycle
          call add(s, k)
        end do
      end do
      if (pass == 2) exit
      self%first(1) = 1
      do s = 1, n_shares
        self%first(s + 1) = self%first(s) + last(s)
        last(s) = self%first(s) - 1
      end do
      allocate (self%place(self%first(n_shares + 1) - 1))
    end do

  contains

    !> The run of the element that comes k-th.
    pure integer function run_of(k)
      integer, intent(in) :: k
      run_of = int((int(k, kind=selected_int_kind(18)) - 1)*n_shares/size(order)) + 1
    end function run_of

    !> One more element of a share.
    subroutine add(share, k)
      integer, intent(in) :: share, k
      last(share) = last(share) + 1
      if (pass == 1) return
      self%place(last(share)) = k
      if (share == run_of(k)) self%own(share) = last(share)
    end subroutine add
  end subroutine element_partition_init
end module dotyk_elasticity_element_partition
