!> Values on their way from one rank to others: the sender puts them into a list of words, one after the other, and the
!> receivers take them out in the same order. A type has one procedure `carry` for both ways, which names its components
!> once.
module dotyk_base_parcel
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: text_t
  implicit none
  private

  type, public :: parcel_t  !! A list of words that is written or read. Values keep all their bits.
    private
    integer(int64), allocatable :: word(:)  !! Words; the first n are in use while it is written (room).
    integer(int64) :: n = 0  !! Words that were written or read so far.
    logical, public :: is_read = .false.  !! Whether values are taken out.
  contains
    procedure :: open => parcel_open
    procedure :: words => parcel_words
    procedure :: n_words => parcel_size
    procedure :: at_end => parcel_at_end
    procedure, private :: carry_integer, carry_long, carry_real, carry_logical, carry_text, carry_texts
    procedure, private :: carry_integers, carry_longs, carry_integer_table, carry_logicals
    procedure, private :: carry_reals, carry_real_table, carry_real_tables
    generic :: carry => carry_integer, carry_long, carry_real, carry_logical, carry_text, carry_texts, &
      carry_integers, carry_longs, carry_integer_table, carry_logicals, carry_reals, carry_real_table, carry_real_tables
    procedure :: carry_fixed => carry_fixed_reals
    procedure :: carry_shape => carry_shape_of
  end type parcel_t

  integer, parameter :: not_there = -1  !! Extent of an array that is not allocated.

contains

  !> Take values out of words that have come.
  subroutine parcel_open(self, word)
    class(parcel_t), intent(out) :: self
    integer(int64), allocatable, intent(inout) :: word(:)  !! As from `words`; given up (n).
    call move_alloc(word, self%word)
    self%is_read = .true.
  end subroutine parcel_open

  !> Number of words so far.
  pure integer(int64) function parcel_size(self) result(n)
    class(parcel_t), intent(in) :: self
    n = self%n
  end function parcel_size

  !> The words that were written (n).
  pure function parcel_words(self) result(word)
    class(parcel_t), intent(in) :: self
    integer(int64), allocatable :: word(:)
    if (self%n == 0) then
      allocate (word(0))
    else
      word = self%word(:self%n)
    end if
  end function parcel_words

  !> Whether all words were read.
  pure logical function parcel_at_end(self) result(at_end)
    class(parcel_t), intent(in) :: self
    at_end = self%n == size(self%word, kind=int64)
  end function parcel_at_end

  !> Write words, or read as many.
  pure subroutine move(self, word)
    class(parcel_t), intent(inout) :: self
    integer(int64), intent(inout) :: word(:)  !! The words (any).
    integer(int64), allocatable :: more(:)
    integer(int64) :: last
    last = self%n + size(word, kind=int64)
    if (self%is_read) then
      word = self%word(self%n + 1:last)
    else
      if (.not. allocated(self%word)) allocate (self%word(1024))
      if (last > size(self%word, kind=int64)) then
        allocate (more(max(last, 2*size(self%word, kind=int64))))
        more(:self%n) = self%word(:self%n)
        call move_alloc(more, self%word)
      end if
      self%word(self%n + 1:last) = word
    end if
    self%n = last
  end subroutine move

  !> An integer.
  pure subroutine carry_integer(self, value)
    class(parcel_t), intent(inout) :: self
    integer, intent(inout) :: value  !! Written, or set.
    integer(int64) :: word(1)
    word = value
    call move(self, word)
    value = int(word(1))
  end subroutine carry_integer

  !> An integer of 64 bits.
  pure subroutine carry_long(self, value)
    class(parcel_t), intent(inout) :: self
    integer(int64), intent(inout) :: value  !! Written, or set.
    integer(int64) :: word(1)
    word = value
    call move(self, word)
    value = word(1)
  end subroutine carry_long

  !> A real.
  pure subroutine carry_real(self, value)
    class(parcel_t), intent(inout) :: self
    real(dp), intent(inout) :: value  !! Written, or set [any].
    integer(int64) :: word(1)
    word = transfer(value, word)
    call move(self, word)
    value = transfer(word(1), value)
  end subroutine carry_real

  !> A logical.
  pure subroutine carry_logical(self, value)
    class(parcel_t), intent(inout) :: self
    logical, intent(inout) :: value  !! Written, or set.
    integer :: number
    number = merge(1, 0, value)
    call self%carry_integer(number)
    value = number == 1
  end subroutine carry_logical

  !> The extents of an array.
  pure subroutine carry_shape_of(self, is_there, extent)
    class(parcel_t), intent(inout) :: self
    logical, intent(inout) :: is_there  !! Whether the array is allocated.
    integer, intent(inout) :: extent(:)  !! Its extents; not used where it is not there (rank).
    if (.not. is_there) extent = not_there
    call carry_extents(self, extent)
    is_there = extent(1) /= not_there
  end subroutine carry_shape_of

  !> The extents of an array, or `not_there`.
  pure subroutine carry_extents(self, extent)
    class(parcel_t), intent(inout) :: self  !! The parcel.
    integer, intent(inout) :: extent(:)  !! The extents (rank).
    integer :: k
    do k = 1, size(extent)
      call self%carry_integer(extent(k))
    end do
  end subroutine carry_extents

  !> A text.
  subroutine carry_text(self, text)
    class(parcel_t), intent(inout) :: self
    character(:), allocatable, intent(inout) :: text  !! Written, or set; not allocated where it was not.
    integer :: length(1), letter, i
    length = not_there
    if (allocated(text)) length = len(text)
    call carry_extents(self, length)
    if (self%is_read .and. allocated(text)) deallocate (text)
    if (length(1) == not_there) return
    if (self%is_read) allocate (character(length(1)) :: text)
    do i = 1, length(1)
      letter = 0
      if (.not. self%is_read) letter = iachar(text(i:i))
      call self%carry_integer(letter)
      text(i:i) = achar(letter)
    end do
  end subroutine carry_text

  !> Texts.
  subroutine carry_texts(self, text)
    class(parcel_t), intent(inout) :: self
    type(text_t), allocatable, intent(inout) :: text(:)  !! Written, or set (n).
    integer :: n(1), i
    n = not_there
    if (allocated(text)) n = shape(text)
    call carry_extents(self, n)
    if (self%is_read .and. allocated(text)) deallocate (text)
    if (n(1) == not_there) return
    if (self%is_read) allocate (text(n(1)))
    do i = 1, n(1)
      call self%carry_text(text(i)%s)
    end do
  end subroutine carry_texts

  !> Integers.
  pure subroutine carry_integers(self, value)
    class(parcel_t), intent(inout) :: self
    integer, allocatable, intent(inout) :: value(:)  !! Written, or set; not allocated where they were not (n).
    integer :: n(1)
    n = not_there
    if (allocated(value)) n = shape(value)
    call carry_extents(self, n)
    if (self%is_read .and. allocated(value)) deallocate (value)
    if (n(1) == not_there) return
    if (self%is_read) allocate (value(n(1)))
    call move_integers(self, size(value), value)
  end subroutine carry_integers

  !> A table of integers.
  pure subroutine carry_integer_table(self, value)
    class(parcel_t), intent(inout) :: self
    integer, allocatable, intent(inout) :: value(:, :)  !! Written, or set; not allocated where it was not (n, m).
    integer :: n(2)
    n = not_there
    if (allocated(value)) n = shape(value)
    call carry_extents(self, n)
    if (self%is_read .and. allocated(value)) deallocate (value)
    if (n(1) == not_there) return
    if (self%is_read) allocate (value(n(1), n(2)))
    call move_integers(self, size(value), value)
  end subroutine carry_integer_table

  !> Integers of a known number, two in a word.
  pure subroutine move_integers(self, n, value)
    class(parcel_t), intent(inout) :: self
    integer, intent(in) :: n  !! Their number.
    integer, intent(inout) :: value(n)  !! Written, or set (n).
    integer, parameter :: half = 32
    integer(int64), allocatable :: word(:)
    integer(int64) :: second
    integer :: i
    allocate (word((n + 1)/2))
    if (.not. self%is_read) then
      do i = 1, n, 2
        second = 0
        if (i < n) second = iand(int(value(i + 1), int64), maskr(half, int64))
        word((i + 1)/2) = ior(shiftl(int(value(i), int64), half), second)
      end do
    end if
    call move(self, word)
    if (.not. self%is_read) return
    do i = 1, n
      value(i) = int(shifta(merge(word((i + 1)/2), shiftl(word((i + 1)/2), half), mod(i, 2) == 1), half))
    end do
  end subroutine move_integers

  !> Integers of 64 bits.
  pure subroutine carry_longs(self, value)
    class(parcel_t), intent(inout) :: self
    integer(int64), allocatable, intent(inout) :: value(:)  !! Written, or set; not allocated where they were not (n).
    integer :: n(1)
    n = not_there
    if (allocated(value)) n = shape(value)
    call carry_extents(self, n)
    if (self%is_read .and. allocated(value)) deallocate (value)
    if (n(1) == not_there) return
    if (self%is_read) allocate (value(n(1)))
    call move(self, value)
  end subroutine carry_longs

  !> Logicals.
  pure subroutine carry_logicals(self, value)
    class(parcel_t), intent(inout) :: self
    logical, allocatable, intent(inout) :: value(:)  !! Written, or set; not allocated where they were not (n).
    integer, allocatable :: number(:)
    integer :: i
    if (allocated(value)) number = [(merge(1, 0, value(i)), i=1, size(value))]
    call self%carry_integers(number)
    if (.not. self%is_read) return
    if (allocated(value)) deallocate (value)
    if (allocated(number)) value = number == 1
  end subroutine carry_logicals

  !> Reals.
  pure subroutine carry_reals(self, value)
    class(parcel_t), intent(inout) :: self
    real(dp), allocatable, intent(inout) :: value(:)  !! Written, or set; not allocated where they were not (n) [any].
    integer :: n(1)
    n = not_there
    if (allocated(value)) n = shape(value)
    call carry_extents(self, n)
    if (self%is_read .and. allocated(value)) deallocate (value)
    if (n(1) == not_there) return
    if (self%is_read) allocate (value(n(1)))
    call self%carry_fixed(size(value), value)
  end subroutine carry_reals

  !> A table of reals.
  pure subroutine carry_real_table(self, value)
    class(parcel_t), intent(inout) :: self
    real(dp), allocatable, intent(inout) :: value(:, :)  !! Written, or set; allocated as it was (n, m) [any].
    integer :: n(2)
    n = not_there
    if (allocated(value)) n = shape(value)
    call carry_extents(self, n)
    if (self%is_read .and. allocated(value)) deallocate (value)
    if (n(1) == not_there) return
    if (self%is_read) allocate (value(n(1), n(2)))
    call self%carry_fixed(size(value), value)
  end subroutine carry_real_table

  !> Several tables of reals.
  pure subroutine carry_real_tables(self, value)
    class(parcel_t), intent(inout) :: self
    real(dp), allocatable, intent(inout) :: value(:, :, :)  !! Written, or set; allocated as they were (n, m, k) [any].
    integer :: n(3)
    n = not_there
    if (allocated(value)) n = shape(value)
    call carry_extents(self, n)
    if (self%is_read .and. allocated(value)) deallocate (value)
    if (n(1) == not_there) return
    if (self%is_read) allocate (value(n(1), n(2), n(3)))
    call self%carry_fixed(size(value), value)
  end subroutine carry_real_tables

  !> Reals of a known number.
  pure subroutine carry_fixed_reals(self, n, value)
    class(parcel_t), intent(inout) :: self
    integer, intent(in) :: n  !! Their number.
    real(dp), intent(inout) :: value(n)  !! Written, or set (n) [any].
    integer(int64), allocatable :: word(:)
    integer :: i
    allocate (word(n))
    if (.not. self%is_read) then
      do i = 1, n
        word(i) = transfer(value(i), word(i))
      end do
    end if
    call move(self, word)
    if (.not. self%is_read) return
    do i = 1, n
      value(i) = transfer(word(i), value(i))
    end do
  end subroutine carry_fixed_reals
end module dotyk_base_parcel
