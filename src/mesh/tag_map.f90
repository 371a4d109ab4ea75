!> Map from the tags of a file, which may have gaps, to indices 1..n.
module dotyk_mesh_tag_map
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private

  type, public :: tag_map_t  !! Direct table over the range of the tags if they are compact, a hash table otherwise.
    logical :: compact = .true.  !! Whether `index` is a direct table; otherwise it belongs to the hash table `key`.
    integer(int64) :: first = 0  !! Smallest tag.
    integer(int64) :: last = -1  !! Largest tag.
    integer(int64), allocatable :: key(:)  !! Tags by hash slot, set where `index` is not 0 (0:n_slots-1).
    integer, allocatable :: index(:)  !! Index of the tag in each slot, or 0 (0:).
  contains
    procedure :: init => tag_map_init
    procedure :: find => tag_map_find
  end type tag_map_t

  type, public :: growing_tag_map_t  !! Map from tags to indices 1..n in the order in which they are added.
    integer :: n = 0  !! Number of tags.
    integer(int64), allocatable :: tag(:)  !! The tags; the first n are in use (room).
    integer(int64), allocatable, private :: key(:)  !! Tags by hash slot, set where `index` is not 0 (0:n_slots-1).
    integer, allocatable, private :: index(:)  !! Index of the tag in each slot, or 0 (0:).
  contains
    procedure :: add => growing_add
    procedure :: find => growing_find
  end type growing_tag_map_t

contains

  !> Index of a tag; it is added if it does not exist.
  pure subroutine growing_add(self, tag, index)
    class(growing_tag_map_t), intent(inout) :: self
    integer(int64), intent(in) :: tag  !! Tag.
    integer, intent(out) :: index  !! Its index.
    integer(int64), allocatable :: larger(:)
    integer(int64) :: slot
    integer :: i
    if (.not. allocated(self%tag)) then
      allocate (self%tag(32), self%key(0:63), source=0_int64)
      allocate (self%index(0:63), source=0)
    else if (self%n == size(self%tag)) then
      allocate (larger(2*self%n))
      larger(:self%n) = self%tag(:self%n)
      call move_alloc(larger, self%tag)
      deallocate (self%key, self%index)
      allocate (self%key(0:4_int64*self%n - 1), source=0_int64)
      allocate (self%index(0:4_int64*self%n - 1), source=0)
      do i = 1, self%n
        slot = slot_of(self%key, self%index, size(self%key, kind=int64), self%tag(i))
        self%key(slot) = self%tag(i)
        self%index(slot) = i
      end do
    end if
    slot = slot_of(self%key, self%index, size(self%key, kind=int64), tag)
    if (self%index(slot) == 0) then
      self%n = self%n + 1
      self%tag(self%n) = tag
      self%key(slot) = tag
      self%index(slot) = self%n
    end if
    index = self%index(slot)
  end subroutine growing_add

  !> Index of a tag, 0 if it is unknown.
  pure integer function growing_find(self, tag) result(index)
    class(growing_tag_map_t), intent(in) :: self
    integer(int64), intent(in) :: tag  !! Tag.
    index = 0
    if (self%n > 0) index = self%index(slot_of(self%key, self%index, size(self%key, kind=int64), tag))
  end function growing_find

  !> Set up from tags; tag(i) gets the index i.
  pure subroutine tag_map_init(self, tag, repeated)
    class(tag_map_t), intent(inout) :: self
    integer(int64), intent(in) :: tag(:)  !! Tags (n).
    integer, intent(out) :: repeated  !! Index of the first tag that occurred before, or 0; the map is not usable then.
    integer(int64) :: n_slots, slot
    real(dp) :: range
    integer :: i, n
    repeated = 0
    n = size(tag)
    if (allocated(self%key)) deallocate (self%key)
    if (allocated(self%index)) deallocate (self%index)
    self%compact = .true.
    self%first = 0
    self%last = -1
    if (n == 0) then
      allocate (self%index(0:-1))
      return
    end if
    self%first = minval(tag)
    self%last = maxval(tag)
    ! The difference of any two tags may overflow as an integer.
    range = real(self%last, dp) - real(self%first, dp)
    self%compact = range < 4*real(n, dp) + 1024
    if (self%compact) then
      allocate (self%index(0:self%last - self%first), source=0)
      do i = 1, n
        slot = tag(i) - self%first
        if (self%index(slot) /= 0) then
          repeated = i
          return
        end if
        self%index(slot) = i
      end do
    else
      n_slots = 16
      do while (n_slots < 2*int(n, int64))
        n_slots = 2*n_slots
      end do
      allocate (self%key(0:n_slots - 1), source=0_int64)
      allocate (self%index(0:n_slots - 1), source=0)
      do i = 1, n
        slot = slot_of(self%key, self%index, n_slots, tag(i))
        if (self%index(slot) /= 0) then
          repeated = i
          return
        end if
        self%key(slot) = tag(i)
        self%index(slot) = i
      end do
    end if
  end subroutine tag_map_init

  !> Index of a tag, 0 if it is unknown.
  pure integer function tag_map_find(self, tag) result(index)
    class(tag_map_t), intent(in) :: self
    integer(int64), intent(in) :: tag  !! Tag.
    integer(int64) :: slot
    index = 0
    if (tag < self%first .or. tag > self%last) return
    if (self%compact) then
      slot = tag - self%first
    else
      slot = slot_of(self%key, self%index, size(self%key, kind=int64), tag)
    end if
    index = self%index(slot)
  end function tag_map_find

  !> Slot that holds a tag, or the free slot where it belongs (open addressing).
  pure integer(int64) function slot_of(key, index, n_slots, tag) result(slot)
    integer(int64), intent(in) :: n_slots  !! Number of slots, a power of two.
    integer(int64), intent(in) :: key(0:n_slots - 1)  !! Tags by slot (0:n_slots-1).
    integer, intent(in) :: index(0:n_slots - 1)  !! Index by slot, 0 where free (0:n_slots-1).
    integer(int64), intent(in) :: tag  !! Tag.
    !> 31 bits of the golden ratio: the product of two such numbers does not overflow.
    integer(int64), parameter :: factor = 1327217885_int64, low_bits = 2_int64**31 - 1
    integer(int64) :: mixed
    mixed = iand(ieor(tag, ieor(ishft(tag, -31), ishft(tag, -62))), low_bits)*factor
    slot = iand(ieor(mixed, ishft(mixed, -29)), n_slots - 1)
    do while (index(slot) /= 0)
      if (key(slot) == tag) return
      slot = iand(slot + 1, n_slots - 1)
    end do
  end function slot_of
end module dotyk_mesh_tag_map
