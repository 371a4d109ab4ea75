!> Symbolic factorization of a block-sparse symmetric matrix: fill-in, elimination tree, and the panels of the factor.
!>
!> Successive blocks with nearly the same structure below the diagonal are amalgamated to a group (a relaxed supernode):
!> one dense panel, explicit zeros included, so that products are of large matrices. Groups are the nodes of the
!> elimination tree, in postorder.
module dotyk_linalg_block_tree
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private

  !> The order of elimination and the structure of the factor.
  type, public :: block_tree_t
    !> Number of blocks.
    integer :: n_blocks = 0
    !> Number of groups.
    integer :: n_groups = 0
    !> Order of the matrix.
    integer :: n = 0
    !> Rows of each block (n_blocks).
    integer, allocatable :: size(:)
    !> First row of each block (n_blocks + 1).
    integer, allocatable :: first(:)
    !> The block that is eliminated k-th (n_blocks).
    integer, allocatable :: order(:)
    !> Elimination time of each block: the inverse of `order` (n_blocks).
    integer, allocatable :: time(:)
    !> Times of group g: begin(g) .. begin(g+1)-1 (n_groups + 1).
    integer, allocatable :: begin(:)
    !> Group of each time (n_blocks).
    integer, allocatable :: group(:)
    !> Start of the list of each group in `under` (n_groups + 1).
    integer, allocatable :: under_start(:)
    !> Times of the blocks below the diagonal block of group g, ascending: under(under_start(g):under_start(g+1)-1).
    integer, allocatable :: under(:)
    !> Rows of the group's panel before each of them (size of under).
    integer, allocatable :: under_row(:)
    !> Start of the list of each group in `row` (n_groups + 1).
    integer, allocatable :: row_start(:)
    !> Rows of the matrix in the panel of group g: row(row_start(g):row_start(g+1)-1).
    integer, allocatable :: row(:)
    !> Columns of the panels (n_groups).
    integer, allocatable :: width(:)
    !> Rows of the panels (n_groups).
    integer, allocatable :: height(:)
    !> Group of the first block below each group, 0 at roots (n_groups).
    integer, allocatable :: parent(:)
    !> First group of the subtree of each group, which ends with the group itself (n_groups).
    integer, allocatable :: first_below(:)
    !> Couplings and order that it was made of.
    integer, allocatable, private :: given_start(:), given_neighbour(:), given_order(:)
  contains
    procedure :: init => tree_init
    procedure :: is_made_of => tree_is_made_of
    procedure :: row_under => tree_row_under
    procedure :: entries => tree_entries
    procedure :: operations => tree_operations
  end type block_tree_t

  !> A list of elimination times.
  type :: list_t
    !> Times (n).
    integer, allocatable :: item(:)
  end type list_t

  !> Explicit zeros that amalgamation may store, as a fraction of the entries of a group.
  real(dp), parameter :: most_zeros = 0.2_dp
  !> Explicit zeros that are always accepted: a call of BLAS costs more.
  real(dp), parameter :: few_zeros = 500

contains

  !> Symbolic factorization.
  subroutine tree_init(self, sizes, start, neighbour, order)
    !> The structure.
    class(block_tree_t), intent(out) :: self
    !> Rows of each block (n_blocks).
    integer, intent(in) :: sizes(:)
    !> Coupled blocks of block p, without p itself: neighbour(start(p):start(p+1)-1); symmetric (n_blocks + 1).
    integer, intent(in) :: start(:)
    !> See `start` (number of couplings).
    integer, intent(in) :: neighbour(:)
    !> The block that is eliminated k-th, but for the order of independent ones: postorder keeps subtrees together
    !> (n_blocks).
    integer, intent(in) :: order(:)
    type(list_t), allocatable :: under(:)
    integer, allocatable :: parent(:), sequence(:), rank(:)
    integer :: n, k
    n = size(sizes)
    self%given_start = start
    self%given_neighbour = neighbour
    self%given_order = order
    self%n_blocks = n
    self%n = sum(sizes)
    self%size = sizes
    allocate (self%first(n + 1), self%time(n))
    self%first(1) = 1
    do k = 1, n
      self%first(k + 1) = self%first(k) + sizes(k)
    end do
    self%order = order
    self%time(order) = [(k, k=1, n)]
    call eliminate(self, start, neighbour, under, parent)
    call sort_tree(parent, sequence)
    allocate (rank(n))
    rank(sequence) = [(k, k=1, n)]
    self%order = order(sequence)
    self%time(self%order) = [(k, k=1, n)]
    call collect_groups(self, under, rank, sequence)
  end subroutine tree_init

  !> Whether the structure was made of these.
  pure logical function tree_is_made_of(self, sizes, start, neighbour, order) result(same)
    !> The structure.
    class(block_tree_t), intent(in) :: self
    !> As in `init`.
    integer, intent(in) :: sizes(:), start(:), neighbour(:), order(:)
    same = self%n_blocks == size(sizes) .and. self%n_blocks > 0
    if (same) same = size(self%given_neighbour) == size(neighbour)
    if (same) same = all(self%size == sizes) .and. all(self%given_start == start) .and. &
      all(self%given_neighbour == neighbour) .and. all(self%given_order == order)
  end function tree_is_made_of

  !> Fill-in by elimination, and the elimination tree of the blocks.
  subroutine eliminate(self, start, neighbour, under, parent)
    !> With sizes and order.
    type(block_tree_t), intent(in) :: self
    !> See `tree_init` (n_blocks + 1).
    integer, intent(in) :: start(:)
    !> See `tree_init` (number of couplings).
    integer, intent(in) :: neighbour(:)
    !> Times of the blocks below the diagonal of each block column, not sorted; by times (n_blocks).
    type(list_t), allocatable, intent(out) :: under(:)
    !> The first of them, 0 where there is none (n_blocks).
    integer, allocatable, intent(out) :: parent(:)
    integer :: last_child(self%n_blocks), next_child(self%n_blocks), mark(self%n_blocks), buffer(self%n_blocks)
    integer :: k, i, c, n
    allocate (under(self%n_blocks), parent(self%n_blocks))
    last_child = 0
    next_child = 0
    mark = 0
    do k = 1, self%n_blocks
      n = 0
      mark(k) = k
      do i = start(self%order(k)), start(self%order(k) + 1) - 1
        call take(self%time(neighbour(i)))
      end do
      c = last_child(k)
      do while (c > 0)
        do i = 1, size(under(c)%item)
          call take(under(c)%item(i))
        end do
        c = next_child(c)
      end do
      under(k)%item = buffer(:n)
      parent(k) = 0
      if (n == 0) cycle
      parent(k) = minval(buffer(:n))
      next_child(k) = last_child(parent(k))
      last_child(parent(k)) = k
    end do
  contains
    !> Add a block to column k, once.
    subroutine take(time)
      !> Its elimination time.
      integer, intent(in) :: time
      if (time < k) return
      if (mark(time) == k) return
      mark(time) = k
      n = n + 1
      buffer(n) = time
    end subroutine take
  end subroutine eliminate

  !> Postorder of a forest.
  pure subroutine sort_tree(parent, sequence)
    !> Parent of each node, larger than its number; 0 at roots (n).
    integer, intent(in) :: parent(:)
    !> The node that comes k-th (n).
    integer, allocatable, intent(out) :: sequence(:)
    integer :: first_child(0:size(parent)), next(size(parent)), k, n
    first_child = 0
    do k = size(parent), 1, -1
      next(k) = first_child(parent(k))
      first_child(parent(k)) = k
    end do
    allocate (sequence(size(parent)))
    n = 0
    k = first_child(0)
    do while (k > 0)
      do while (first_child(k) > 0)
        k = first_child(k)
      end do
      do
        n = n + 1
        sequence(n) = k
        if (next(k) > 0) exit
        k = parent(k)
        if (k == 0) return
      end do
      k = next(k)
    end do
  end subroutine sort_tree

  !> Amalgamate blocks to groups.
  subroutine collect_groups(self, under, rank, sequence)
    !> In postorder; sets the groups.
    type(block_tree_t), intent(inout) :: self
    !> Fill-in by former times; by new times on return (n_blocks).
    type(list_t), intent(inout) :: under(:)
    !> New time of each former time (n_blocks).
    integer, intent(in) :: rank(:)
    !> Former time of each new time (n_blocks).
    integer, intent(in) :: sequence(:)
    integer :: rows_under(self%n_blocks), k, n, width, more, last
    real(dp) :: zeros, added
    do k = 1, self%n_blocks
      associate (item => under(sequence(k))%item)
        item = rank(item)
        rows_under(k) = sum(self%size(self%order(item)))
      end associate
    end do
    allocate (self%begin(self%n_blocks + 1), self%group(self%n_blocks))
    n = 0
    last = 0
    width = 0
    zeros = 0
    do k = 1, self%n_blocks
      associate (own => self%size(self%order(k)))
        if (last > 0) then
          if (any(under(sequence(last))%item == k)) then
            ! Rows that the columns of the group so far do not have.
            more = own + rows_under(k) - rows_under(last)
            added = real(width, dp)*more
            if (zeros + added <= max(few_zeros, most_zeros*real(width + own, dp)*(width + own + rows_under(k)))) then
              zeros = zeros + added
              width = width + own
              self%group(k) = n
              last = k
              cycle
            end if
          end if
        end if
        last = k
        n = n + 1
        self%begin(n) = k
        self%group(k) = n
        width = own
        zeros = 0
      end associate
    end do
    self%n_groups = n
    self%begin(n + 1) = self%n_blocks + 1
    self%begin = self%begin(:n + 1)
    call describe_groups(self, under, rows_under, sequence)
  end subroutine collect_groups

  !> Sizes, parents and rows of the groups; the last block of a group has the structure of all.
  subroutine describe_groups(self, under, rows_under, sequence)
    !> With the times of the groups; completed on return.
    type(block_tree_t), intent(inout) :: self
    !> Fill-in, items by new times, lists by former times (n_blocks).
    type(list_t), intent(in) :: under(:)
    !> Rows below the diagonal of each block column, by new times (n_blocks).
    integer, intent(in) :: rows_under(:)
    !> Former time of each new time (n_blocks).
    integer, intent(in) :: sequence(:)
    logical :: marked(self%n_blocks)
    integer :: g, last, i, k, row
    allocate (self%width(self%n_groups), self%height(self%n_groups), self%parent(self%n_groups), source=0)
    allocate (self%under_start(self%n_groups + 1))
    allocate (self%under(sum([(size(under(sequence(self%begin(g + 1) - 1))%item), g=1, self%n_groups)])))
    allocate (self%under_row(size(self%under)))
    self%first_below = [(g, g=1, self%n_groups)]
    marked = .false.
    self%under_start(1) = 1
    do g = 1, self%n_groups
      last = self%begin(g + 1) - 1
      self%width(g) = sum(self%size(self%order(self%begin(g):last)))
      self%height(g) = self%width(g) + rows_under(last)
      associate (item => under(sequence(last))%item)
        marked(item) = .true.
        i = self%under_start(g)
        row = self%width(g)
        if (size(item) > 0) then
          do k = minval(item), maxval(item)
            if (.not. marked(k)) cycle
            self%under(i) = k
            self%under_row(i) = row
            row = row + self%size(self%order(k))
            i = i + 1
          end do
          self%parent(g) = self%group(self%under(self%under_start(g)))
          self%first_below(self%parent(g)) = min(self%first_below(self%parent(g)), self%first_below(g))
        end if
        marked(item) = .false.
        self%under_start(g + 1) = i
      end associate
    end do
    call find_rows(self)
  end subroutine describe_groups

  !> The rows of the panels.
  subroutine find_rows(self)
    !> Sets `row` and `row_start`.
    type(block_tree_t), intent(inout) :: self
    integer :: g, k, n
    allocate (self%row_start(self%n_groups + 1), self%row(sum(self%height)))
    n = 0
    do g = 1, self%n_groups
      self%row_start(g) = n + 1
      do k = self%begin(g), self%begin(g + 1) - 1
        call add(self%order(k))
      end do
      do k = self%under_start(g), self%under_start(g + 1) - 1
        call add(self%order(self%under(k)))
      end do
    end do
    self%row_start(self%n_groups + 1) = n + 1
  contains
    !> Append the rows of a block.
    subroutine add(block)
      !> The block.
      integer, intent(in) :: block
      integer :: i
      do i = self%first(block), self%first(block + 1) - 1
        n = n + 1
        self%row(n) = i
      end do
    end subroutine add
  end subroutine find_rows

  !> Rows of a group's panel before a block below its diagonal.
  pure integer function tree_row_under(self, g, time) result(row)
    !> The structure.
    class(block_tree_t), intent(in) :: self
    !> The group.
    integer, intent(in) :: g
    !> Elimination time of the block.
    integer, intent(in) :: time
    integer :: low, high, middle
    low = self%under_start(g)
    high = self%under_start(g + 1) - 1
    do while (low < high)
      middle = (low + high)/2
      if (self%under(middle) < time) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    row = self%under_row(low)
  end function tree_row_under

  !> Entries of all panels.
  pure integer(int64) function tree_entries(self) result(entries)
    !> The structure.
    class(block_tree_t), intent(in) :: self
    entries = sum(int(self%width, int64)*self%height)
  end function tree_entries

  !> Floating-point operations of the numeric factorization.
  pure real(dp) function tree_operations(self) result(operations)
    !> The structure.
    class(block_tree_t), intent(in) :: self
    real(dp) :: w(self%n_groups), h(self%n_groups)
    w = self%width
    h = self%height - w
    operations = sum(w**3/3 + w**2*h + w*h**2)
  end function tree_operations
end module dotyk_linalg_block_tree
