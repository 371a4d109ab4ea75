!> A small set of integers in the order in which they are added: a hash table as large as the set, in place of one mark
!> for each integer that there may be. Threads that gather neighbours have one each.
module dotyk_base_number_set
  use dotyk_base_kinds, only: int64
  implicit none
  private

  type, public :: number_set_t  !! The set.
    integer :: n = 0  !! Number of its members; `clear` before the first one.
    integer, allocatable :: member(:)  !! The members, in the order in which they were added (at least n).
    integer, allocatable, private :: slot_of(:)  !! Slot of each member (size of `member`).
    !> Index of the member in each slot, 0 for none; their number is a power of two (2*size of `member`).
    integer, allocatable, private :: slot(:)
  contains
    procedure :: add => set_add
    procedure :: clear => set_clear
  end type number_set_t

  integer, parameter :: first_room = 64  !! Members that a set has room for at first, a power of two.

contains

  !> Add a number, unless it is a member.
  pure subroutine set_add(self, number)
    class(number_set_t), intent(inout) :: self
    integer, intent(in) :: number  !! The number, not negative.
    integer :: s
    if (.not. allocated(self%member)) call make_room(self, first_room)
    if (self%n == size(self%member)) call make_room(self, 2*self%n)
    s = free_slot(self, number)
    if (s == 0) return
    self%n = self%n + 1
    self%member(self%n) = number
    self%slot_of(self%n) = s
    self%slot(s) = self%n
  end subroutine set_add

  !> Remove all members; the room stays.
  pure subroutine set_clear(self)
    class(number_set_t), intent(inout) :: self
    ! gfortran 12 does not initialize private copies of threads: without room the number means nothing.
    if (allocated(self%member)) self%slot(self%slot_of(:self%n)) = 0
    self%n = 0
  end subroutine set_clear

  !> The slot for a number that is no member; 0 where it is one. Half of the slots are free: linear probing ends.
  pure integer function free_slot(self, number) result(s)
    type(number_set_t), intent(in) :: self  !! The set.
    integer, intent(in) :: number  !! The number.
    !> 2^32 over the golden ratio: its product spreads successive numbers (Knuth, volume 3, 6.4).
    integer(int64), parameter :: factor = 2654435769_int64
    integer :: mask
    mask = size(self%slot) - 1
    s = 1 + int(iand(shiftr(number*factor, 16), int(mask, int64)))
    do while (self%slot(s) > 0)
      if (self%member(self%slot(s)) == number) then
        s = 0
        return
      end if
      s = 1 + iand(s, mask)
    end do
  end function free_slot

  !> Make room for more members.
  pure subroutine make_room(self, room)
    type(number_set_t), intent(inout) :: self  !! The set.
    integer, intent(in) :: room  !! Members that it gets room for, a power of two.
    integer, allocatable :: before(:)
    integer :: k
    allocate (before(0))
    if (self%n > 0) before = self%member(:self%n)
    if (allocated(self%member)) deallocate (self%member, self%slot_of, self%slot)
    allocate (self%member(room), self%slot_of(room))
    allocate (self%slot(2*room), source=0)
    do k = 1, size(before)
      self%member(k) = before(k)
      self%slot_of(k) = free_slot(self, before(k))
      self%slot(self%slot_of(k)) = k
    end do
  end subroutine make_room
end module dotyk_base_number_set
