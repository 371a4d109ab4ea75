!> Groups of a namelist file: keys and values as written, and as the table of keywords has checked and converted them.
module dotyk_input_groups
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: text_t
  implicit none
  private

  type, public :: value_t  !! One value as written.
    character(:), allocatable :: text  !! Its text, without quotes.
    integer :: line = 0  !! Line of the file.
    logical :: quoted = .false.  !! Whether it is in quotes.
  end type value_t

  type, public :: entry_t  !! One key with its values.
    character(:), allocatable :: key  !! Its name in lower case.
    integer :: line = 0  !! Line of the key.
    integer :: n_values = 0  !! Number of values.
    type(value_t), allocatable :: value(:)  !! Values as written; the first `n_values` are in use (n_allocated).
    logical :: usable = .true.  !! Whether it has no mistake so far. Checks skip what depends on unusable keys.
    logical :: from_default = .false.  !! Whether it is a default of the table of keywords, not given in the file.
    real(dp), allocatable :: reals(:)  !! Checked values of a real key (n_values) [unit of the key].
    !> Checked values of an integer key (n_values), or the options that its names stand for (n_names).
    integer, allocatable :: integers(:)
    logical, allocatable :: logicals(:)  !! Checked values of a logical key (n_values).
  contains
    procedure :: add => entry_add
  end type entry_t

  !> One group. Its procedures give the values of keys without mistakes, given or by default; else 0, false, empty.
  type, public :: group_t
    character(:), allocatable :: name  !! Its name in lower case.
    integer :: line = 0  !! Line of its beginning.
    integer :: n_entries = 0  !! Number of keys.
    type(entry_t), allocatable :: entry(:)  !! Keys; the first `n_entries` are in use (n_allocated).
    logical :: full = .false.  !! Whether further keys were dropped.
  contains
    procedure :: add => group_add
    procedure :: is_given, is_usable, line_of, count_of, has_option, text_of, texts_of, real_of, reals_of, integer_of
    procedure :: integers_of, logical_of, read_numbers
  end type group_t

  integer, parameter :: most_values = 1000  !! Greatest number of values of a key: the rest is dropped.

  public :: pick_groups

contains

  !> Add a key without values.
  subroutine group_add(self, key, line)
    class(group_t), intent(inout) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer, intent(in) :: line  !! Its line.
    type(entry_t), allocatable :: longer(:)
    if (self%n_entries == size(self%entry)) then
      allocate (longer(max(8, 2*self%n_entries)))
      longer(:self%n_entries) = self%entry
      call move_alloc(longer, self%entry)
    end if
    self%n_entries = self%n_entries + 1
    associate (entry => self%entry(self%n_entries))
      entry%key = key
      entry%line = line
      allocate (entry%value(4))
    end associate
  end subroutine group_add

  !> Add a value, up to the greatest number.
  subroutine entry_add(self, text, line, quoted)
    class(entry_t), intent(inout) :: self
    character(*), intent(in) :: text  !! Value as written.
    integer, intent(in) :: line  !! Line of the value.
    logical, intent(in) :: quoted  !! Whether it is in quotes.
    type(value_t), allocatable :: longer(:)
    if (self%n_values == most_values) return
    if (self%n_values == size(self%value)) then
      allocate (longer(2*self%n_values))
      longer(:self%n_values) = self%value
      call move_alloc(longer, self%value)
    end if
    self%n_values = self%n_values + 1
    associate (value => self%value(self%n_values))
      value%text = text
      value%line = line
      value%quoted = quoted
    end associate
  end subroutine entry_add

  !> Place of a key; 0 where it is neither given nor a default; the first one where it is given twice.
  pure integer function place_of(self, key) result(place)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    do place = 1, self%n_entries
      if (self%entry(place)%key == key) return
    end do
    place = 0
  end function place_of

  !> Place of a key that can be used; 0 where there is none.
  pure integer function usable_place(self, key) result(place)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    place = place_of(self, key)
    if (place == 0) return
    if (.not. self%entry(place)%usable) place = 0
  end function usable_place

  !> Whether a key is in the file.
  pure logical function is_given(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = place_of(self, key)
    is_given = i > 0
    if (is_given) is_given = .not. self%entry(i)%from_default
  end function is_given

  !> Whether a key has values without mistakes, given or by default.
  pure logical function is_usable(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    is_usable = usable_place(self, key) > 0
  end function is_usable

  !> Line of a key, or of its group where it is not given.
  pure integer function line_of(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = place_of(self, key)
    line_of = self%line
    if (i > 0) line_of = self%entry(i)%line
  end function line_of

  !> Number of values of a key as written.
  pure integer function count_of(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = place_of(self, key)
    count_of = 0
    if (i > 0) count_of = self%entry(i)%n_values
  end function count_of

  !> Text of a key without blanks around it.
  pure function text_of(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    character(:), allocatable :: text_of
    integer :: i
    i = usable_place(self, key)
    text_of = ''
    if (i > 0) text_of = trim(adjustl(self%entry(i)%value(1)%text))
  end function text_of

  !> All texts of a key.
  pure subroutine texts_of(self, key, list)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    type(text_t), allocatable, intent(out) :: list(:)  !! The texts (n_values).
    integer :: i, k
    i = usable_place(self, key)
    allocate (list(merge(self%count_of(key), 0, i > 0)))
    do k = 1, size(list)
      list(k)%s = trim(adjustl(self%entry(i)%value(k)%text))
    end do
  end subroutine texts_of

  !> First real of a key [its unit].
  pure real(dp) function real_of(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = usable_place(self, key)
    real_of = 0
    if (i > 0) real_of = self%entry(i)%reals(1)
  end function real_of

  !> All reals of a key.
  pure subroutine reals_of(self, key, values)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    real(dp), allocatable, intent(out) :: values(:)  !! The numbers (n_values) [unit of the key].
    integer :: i
    i = usable_place(self, key)
    if (i > 0) then
      values = self%entry(i)%reals
    else
      allocate (values(0))
    end if
  end subroutine reals_of

  !> First integer of a key, or the option of its name.
  pure integer function integer_of(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = usable_place(self, key)
    integer_of = 0
    if (i > 0) integer_of = self%entry(i)%integers(1)
  end function integer_of

  !> All integers of a key, or the options of its names.
  pure subroutine integers_of(self, key, values)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer, allocatable, intent(out) :: values(:)  !! The integers (n_values).
    integer :: i
    i = usable_place(self, key)
    if (i > 0) then
      values = self%entry(i)%integers
    else
      allocate (values(0))
    end if
  end subroutine integers_of

  !> Whether an option is among the names of a key.
  pure logical function has_option(self, key, option)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer, intent(in) :: option  !! Option, from 1.
    integer :: i
    i = usable_place(self, key)
    has_option = .false.
    if (i > 0) has_option = any(self%entry(i)%integers == option)
  end function has_option

  !> Logical of a key.
  pure logical function logical_of(self, key)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = usable_place(self, key)
    logical_of = .false.
    if (i > 0) logical_of = self%entry(i)%logicals(1)
  end function logical_of

  !> Copy the numbers of a key; components that the key does not have keep their values.
  pure subroutine read_numbers(self, key, values)
    class(group_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the key.
    real(dp), intent(inout) :: values(:)  !! At least as many as the key has [its unit].
    integer :: i, n
    i = usable_place(self, key)
    if (i == 0) return
    n = min(size(self%entry(i)%reals), size(values))
    values(:n) = self%entry(i)%reals(:n)
  end subroutine read_numbers

  !> Indices of the groups of a name.
  pure subroutine pick_groups(groups, name, picked)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    character(*), intent(in) :: name  !! Name of the groups.
    integer, allocatable, intent(out) :: picked(:)  !! Ascending (n_picked).
    integer :: i
    picked = pack([(i, i=1, size(groups))], [(groups(i)%name == name, i=1, size(groups))])
  end subroutine pick_groups
end module dotyk_input_groups
