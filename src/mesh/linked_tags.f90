!> Tags of which some belong together: links between two of them, found piece by piece, make sets.
module dotyk_mesh_linked_tags
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_tag_map, only: growing_tag_map_t
  use dotyk_mesh_union_find, only: root_of
  implicit none
  private

  type, public :: linked_tags_t  !! Sets of tags.
    type(growing_tag_map_t), private :: tags  !! The tags.
    !> Parent of each tag, itself at a root, which has the lowest tag of its set (n).
    integer, allocatable, private :: parent(:)
  contains
    procedure :: init => linked_init
    procedure :: n_sets => linked_n_sets
    procedure :: lowest => linked_lowest
  end type linked_tags_t

  type, public :: tag_links_t  !! Links, each of them once.
    integer(int64), allocatable :: link(:, :)  !! The links, the lower tag first (2, room); the first n are set.
    integer :: n = 0  !! Number of links.
    type(growing_tag_map_t), private :: known  !! The links as tags.
    type(growing_tag_map_t), private :: tags  !! The tags that have links.
  contains
    procedure :: add => links_add
  end type tag_links_t

contains

  !> Join tags.
  subroutine linked_init(self, tag, link)
    class(linked_tags_t), intent(out) :: self
    integer(int64), intent(in) :: tag(:)  !! The tags, maybe several times (any).
    integer(int64), intent(in) :: link(:, :)  !! Tags that belong together, two by two (2, any).
    integer :: i, k(2), a, b
    allocate (self%parent(size(tag) + 2*size(link, 2)))
    self%parent = [(i, i=1, size(self%parent))]
    do i = 1, size(tag)
      call self%tags%add(tag(i), k(1))
    end do
    do i = 1, size(link, 2)
      call self%tags%add(link(1, i), k(1))
      call self%tags%add(link(2, i), k(2))
      a = root_of(self%parent, k(1))
      b = root_of(self%parent, k(2))
      if (a == b) cycle
      if (self%tags%tag(a) < self%tags%tag(b)) then
        self%parent(b) = a
      else
        self%parent(a) = b
      end if
    end do
  end subroutine linked_init

  !> Number of sets.
  pure integer function linked_n_sets(self) result(n)
    class(linked_tags_t), intent(in) :: self
    integer :: i
    n = count([(self%parent(i) == i, i=1, self%tags%n)])
  end function linked_n_sets

  !> Lowest tag of the set of a tag; the tag where it is not known.
  integer(int64) function linked_lowest(self, tag) result(lowest)
    class(linked_tags_t), intent(inout) :: self
    integer(int64), intent(in) :: tag  !! The tag.
    integer :: k
    lowest = tag
    k = self%tags%find(tag)
    if (k > 0) lowest = self%tags%tag(root_of(self%parent, k))
  end function linked_lowest

  !> Add a link, unless it is known or joins a tag with itself.
  subroutine links_add(self, a, b)
    class(tag_links_t), intent(inout) :: self
    integer(int64), intent(in) :: a  !! First tag.
    integer(int64), intent(in) :: b  !! Second tag.
    integer(int64), allocatable :: more(:, :)
    integer :: i, j, k
    if (a == b) return
    if (.not. allocated(self%link)) allocate (self%link(2, 16))
    call self%tags%add(min(a, b), i)
    call self%tags%add(max(a, b), j)
    call self%known%add(ishft(int(i, int64), 32) + j, k)
    if (k <= self%n) return
    if (self%n == size(self%link, 2)) then
      allocate (more(2, 2*self%n))
      more(:, :self%n) = self%link
      call move_alloc(more, self%link)
    end if
    self%n = self%n + 1
    self%link(:, self%n) = [min(a, b), max(a, b)]
  end subroutine links_add
end module dotyk_mesh_linked_tags
