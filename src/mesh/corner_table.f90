!> Hash table of elements and facets by their corners, regardless of the order of the corners.
module dotyk_mesh_corner_table
  use dotyk_base_kinds, only: int64
  implicit none
  private

  type, public :: corner_table_t  !! Set of entries 1..n, each with its corners.
    integer :: n = 0  !! Number of entries.
    integer, allocatable :: key(:, :)  !! Sorted corners of each entry, padded with zeros in front (max_corners, room).
    integer, allocatable :: slot(:)  !! Entry in each slot, 0 where empty (n_slots), a power of 2 of them.
  contains
    procedure :: init => table_init
    procedure :: add => table_add
    procedure :: find => table_find
  end type corner_table_t

contains

  !> Empty table.
  subroutine table_init(self, max_corners, room)
    class(corner_table_t), intent(out) :: self
    integer, intent(in) :: max_corners  !! Greatest number of corners of an entry.
    integer, intent(in) :: room  !! Greatest number of entries.
    integer :: n_slots
    n_slots = 4
    do while (n_slots < 2*room)
      n_slots = 2*n_slots
    end do
    allocate (self%key(max_corners, room), self%slot(n_slots))
    self%slot = 0
  end subroutine table_init

  !> Add an entry unless it exists.
  subroutine table_add(self, corners, entry)
    class(corner_table_t), intent(inout) :: self
    integer, intent(in) :: corners(:)  !! Corners in any order (number of corners).
    integer, intent(out) :: entry  !! The entry: n if it is new, less if it existed.
    integer :: key(size(self%key, 1)), slot
    key = sorted(size(key), corners)
    call locate(self, key, slot)
    if (self%slot(slot) == 0) then
      self%n = self%n + 1
      self%key(:, self%n) = key
      self%slot(slot) = self%n
    end if
    entry = self%slot(slot)
  end subroutine table_add

  !> Entry with given corners, 0 if there is none.
  pure integer function table_find(self, corners) result(entry)
    class(corner_table_t), intent(in) :: self
    integer, intent(in) :: corners(:)  !! Corners in any order (number of corners).
    integer :: slot
    call locate(self, sorted(size(self%key, 1), corners), slot)
    entry = self%slot(slot)
  end function table_find

  !> Slot that holds a key, or the empty slot where it belongs.
  pure subroutine locate(table, key, slot)
    type(corner_table_t), intent(in) :: table  !! Table.
    integer, intent(in) :: key(:)  !! Sorted corners (max_corners).
    integer, intent(out) :: slot  !! Slot.
    integer(int64), parameter :: mask = int(z'7fffffff', int64)
    integer(int64) :: hash
    integer :: i
    hash = 0
    do i = 1, size(key)
      hash = iand(hash*1000003 + key(i), mask)
      hash = ieor(hash, ishft(hash, -15))
    end do
    slot = int(iand(hash, int(size(table%slot) - 1, int64))) + 1
    do while (table%slot(slot) /= 0)
      if (all(table%key(:, table%slot(slot)) == key)) return
      slot = mod(slot, size(table%slot)) + 1
    end do
  end subroutine locate

  !> Corners in ascending order, padded with zeros in front.
  pure function sorted(m, corners) result(key)
    integer, intent(in) :: m  !! Length of the key.
    integer, intent(in) :: corners(:)  !! Corners (number of corners).
    integer :: key(m)  !! Key (m).
    integer :: i, j
    key(:m - size(corners)) = 0
    do i = m - size(corners) + 1, m
      j = i
      do while (j > m - size(corners) + 1)
        if (key(j - 1) <= corners(i - m + size(corners))) exit
        key(j) = key(j - 1)
        j = j - 1
      end do
      key(j) = corners(i - m + size(corners))
    end do
  end function sorted
end module dotyk_mesh_corner_table
