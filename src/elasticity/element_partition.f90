!> Partition of elements over threads with a fixed order of summation at each node, whatever the number of threads.
!>
!> The elements come in an ordering; each part (thread) gets a run of consecutive elements, and owns the nodes that no
!> earlier run touches. Contributions to a node are added by its owner in the order of the elements: the owner's run
!> holds the first of them, and the owner also evaluates the few elements of later runs that touch its nodes. Hence no
!> atomic updates, no colouring, and the same rounding on any number of threads.
module dotyk_elasticity_element_partition
  implicit none
  private

  type, public :: element_partition_t  !! The parts.
    integer :: n = 0  !! Number of parts.
    integer, allocatable :: owner(:)  !! Part that owns each node; 0 for nodes of no element (n_nodes).
    integer, allocatable :: first(:)  !! First entry of each part in `position` (n + 1).
    !> Elements of part s, as ascending positions in the ordering: position(first(s) : first(s + 1) - 1).
    integer, allocatable :: position(:)
    !> Last entry in `position` of the part's own run; later entries belong to the runs of other parts (n).
    integer, allocatable :: last_own(:)
  contains
    procedure :: init => element_partition_init
  end type element_partition_t

contains

  !> Partition the elements of a block.
  subroutine element_partition_init(self, n_nodes, node, order, n_parts)
    class(element_partition_t), intent(out) :: self
    integer, intent(in) :: n_nodes  !! Number of nodes of the body.
    integer, intent(in) :: node(:, :)  !! Nodes of the elements (n, n_elements).
    integer, intent(in) :: order(:)  !! Index of the k-th element of the ordering (n_elements).
    integer, intent(in) :: n_parts  !! Number of parts, at least 1.
    integer, allocatable :: last(:)
    integer :: i, k, s, pass
    self%n = n_parts
    allocate (self%owner(n_nodes), self%first(n_parts + 1), self%last_own(n_parts), last(0:n_parts), source=0)
    do k = 1, size(order)
      do i = 1, size(node, 1)
        associate (owner => self%owner(node(i, order(k))))
          if (owner == 0) owner = run_of(k)
        end associate
      end do
    end do
    ! The first pass counts the elements of each part, the second one lists them.
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
      do s = 1, n_parts
        self%first(s + 1) = self%first(s) + last(s)
        last(s) = self%first(s) - 1
      end do
      allocate (self%position(self%first(n_parts + 1) - 1))
    end do

  contains

    !> Part whose run contains a position in the ordering.
    pure integer function run_of(k)
      integer, intent(in) :: k  !! Position in the ordering.
      run_of = int((int(k, kind=selected_int_kind(18)) - 1)*n_parts/size(order)) + 1
    end function run_of

    !> Add an element to a part.
    subroutine add(part, k)
      integer, intent(in) :: part  !! Index of the part.
      integer, intent(in) :: k  !! Position of the element in the ordering.
      last(part) = last(part) + 1
      if (pass == 1) return
      self%position(last(part)) = k
      if (part == run_of(k)) self%last_own(part) = last(part)
    end subroutine add
  end subroutine element_partition_init
end module dotyk_elasticity_element_partition
