!> Groups and keys of the namelist as data, and how their table is made and searched. The table is in keyword_table.f90.
module dotyk_input_keywords
  use dotyk_base_text, only: text_t
  implicit none
  private

  !> How often a group may stand in a file.
  integer, parameter, public :: exactly_one = 1, at_most_one = 2, at_least_one = 3, any_number = 4

  !> What the values of a key are.
  integer, parameter, public :: kind_real = 1     !< real numbers
  integer, parameter, public :: kind_integer = 2  !< integers
  integer, parameter, public :: kind_logical = 3  !< .true. or .false.
  integer, parameter, public :: kind_text = 4     !< texts in quotes
  integer, parameter, public :: kind_name = 5     !< one name of a list, in quotes
  integer, parameter, public :: kind_names = 6    !< names of a list, separated by blanks, in one pair of quotes
  integer, parameter, public :: kind_formula = 7  !< formulas in x, y, z, each in quotes

  type, public :: group_keyword_t  !! A group.
    character(:), allocatable :: name  !! Its name in lower case.
    integer :: occurs = any_number  !! One of `exactly_one`, `at_most_one`, `at_least_one`, `any_number`.
    character(:), allocatable :: meaning  !! What it describes.
    character(:), allocatable :: example  !! A typical group, for the reference.
  end type group_keyword_t

  type, public :: keyword_t  !! A key of a group.
    character(:), allocatable :: group  !! Name of the group, in lower case.
    character(:), allocatable :: key  !! Name of the key, in lower case.
    integer :: kind = kind_text  !! One of `kind_*`.
    integer :: least = 1  !! Least number of values.
    integer :: most = 1  !! Greatest number of values; other numbers between the two are allowed, but mean nothing.
    logical :: positive = .false.  !! Whether its numbers must be above 0.
    logical :: not_negative = .false.  !! Whether its numbers must not be below 0.
    logical :: required = .false.  !! Whether it must be given.
    logical :: may_be_empty = .false.  !! Whether its text may be empty.
    !> Whether its numbers are measured in units, or multiples of such numbers: then their size is limited.
    logical :: measured = .false.
    character(:), allocatable :: unit  !! Unit of the numbers; empty where they have none.
    character(:), allocatable :: names  !! Names that are allowed, separated by blanks.
    character(:), allocatable :: default  !! Default values, separated by blanks; empty where there is none.
    character(:), allocatable :: meaning  !! What it means.
  end type keyword_t

  type, public :: keyword_list_t  !! A table of keys that is being made.
    type(keyword_t), allocatable :: row(:)  !! The keys so far (n_keys).
    character(:), allocatable, private :: group  !! Group of the keys to come.
  contains
    procedure :: init => keyword_list_init
    procedure :: begin_group => keyword_list_begin_group
    procedure :: add => keyword_list_add
  end type keyword_list_t

  public :: place_of_keyword, keys_of_group

contains

  !> Begin an empty table.
  pure subroutine keyword_list_init(self)
    class(keyword_list_t), intent(inout) :: self
    allocate (self%row(0))
  end subroutine keyword_list_init

  !> Begin the keys of a group.
  pure subroutine keyword_list_begin_group(self, group)
    class(keyword_list_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Name of the group, in lower case.
    self%group = group
  end subroutine keyword_list_begin_group

  !> Add a key of the group; what is absent is as in `keyword_t`.
  pure subroutine keyword_list_add(self, key, kind, meaning, least, most, unit, names, default, positive, &
                                   not_negative, required, may_be_empty)
    class(keyword_list_t), intent(inout) :: self
    character(*), intent(in) :: key  !! Name of the key, in lower case.
    integer, intent(in) :: kind  !! One of `kind_*`.
    character(*), intent(in) :: meaning  !! What it means.
    integer, intent(in), optional :: least  !! Least number of values.
    integer, intent(in), optional :: most  !! Greatest number of values.
    character(*), intent(in), optional :: unit  !! Unit of the numbers.
    character(*), intent(in), optional :: names  !! Names that are allowed, separated by blanks.
    character(*), intent(in), optional :: default  !! Default values, separated by blanks.
    logical, intent(in), optional :: positive  !! Whether its numbers must be above 0.
    logical, intent(in), optional :: not_negative  !! Whether its numbers must not be below 0.
    logical, intent(in), optional :: required  !! Whether it must be given.
    logical, intent(in), optional :: may_be_empty  !! Whether its text may be empty.
    type(keyword_t), allocatable :: longer(:)
    integer :: i, n
    n = size(self%row)
    allocate (longer(n + 1))
    do i = 1, n
      longer(i) = self%row(i)
    end do
    call move_alloc(longer, self%row)
    associate (row => self%row(n + 1))
      row%group = self%group
      row%key = key
      row%kind = kind
      row%meaning = meaning
      row%unit = ''
      row%names = ''
      row%default = ''
      if (present(least)) row%least = least
      if (present(most)) row%most = most
      if (present(unit)) row%unit = unit
      row%measured = len(row%unit) > 0 .or. index(key, 'theta') == 1
      if (present(names)) row%names = names
      if (present(default)) row%default = default
      if (present(positive)) row%positive = positive
      if (present(not_negative)) row%not_negative = not_negative
      if (present(required)) row%required = required
      if (present(may_be_empty)) row%may_be_empty = may_be_empty
    end associate
  end subroutine keyword_list_add

  !> Place of a key in the table; 0 where the group has no such key.
  pure integer function place_of_keyword(table, group, key) result(place)
    type(keyword_t), intent(in) :: table(:)  !! Table of all keys (n_keys).
    character(*), intent(in) :: group  !! Name of the group, in lower case.
    character(*), intent(in) :: key  !! Name of the key, in lower case.
    integer :: i
    place = 0
    do i = 1, size(table)
      if (table(i)%group == group .and. table(i)%key == key) place = i
    end do
  end function place_of_keyword

  !> Names of the keys of a group.
  pure subroutine keys_of_group(table, group, keys)
    type(keyword_t), intent(in) :: table(:)  !! Table of all keys (n_keys).
    character(*), intent(in) :: group  !! Name of the group, in lower case.
    !> Names of its keys, in the order of the table (n_keys_of_group).
    type(text_t), allocatable, intent(out) :: keys(:)
    integer :: i, n
    n = 0
    do i = 1, size(table)
      if (table(i)%group == group) n = n + 1
    end do
    allocate (keys(n))
    n = 0
    do i = 1, size(table)
      if (table(i)%group /= group) cycle
      n = n + 1
      keys(n)%s = table(i)%key
    end do
  end subroutine keys_of_group
end module dotyk_input_keywords
