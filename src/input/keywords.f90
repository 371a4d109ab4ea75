!> Groups and keys of the namelist as data, and how their table is made and searched. The table is in keyword_table.f90.
module dotyk_input_keywords
  implicit none
  private

  integer, parameter, public :: exactly_one = 1, at_most_one = 2, at_least_one = 3, any_number = 4  !! Of a group.

  !> What the values of a key are.
  integer, parameter, public :: kind_real = 1     !< real numbers
  integer, parameter, public :: kind_integer = 2  !< integers
  integer, parameter, public :: kind_logical = 3  !< .true. or .false.
  integer, parameter, public :: kind_text = 4     !< texts in quotes
  integer, parameter, public :: kind_name = 5     !< one name of a list, in quotes
  integer, parameter, public :: kind_names = 6    !< names of a list, separated by blanks, in one pair of quotes
  integer, parameter, public :: kind_formula = 7  !< formulas in x, y, z, each in quotes

  type, public :: keyword_t  !! A key of a group.
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

  type, public :: group_keyword_t  !! A group.
    character(:), allocatable :: name  !! Its name in lower case.
    integer :: occurs = any_number  !! One of `exactly_one`, `at_most_one`, `at_least_one`, `any_number`.
    character(:), allocatable :: meaning  !! What it describes.
    character(:), allocatable :: example  !! A typical group, for the reference.
    type(keyword_t), allocatable :: key(:)  !! Its keys (n_keys).
  end type group_keyword_t

  type, public :: keyword_list_t  !! A table that is being made.
    type(group_keyword_t), allocatable :: group(:)  !! The groups so far (n_groups).
  contains
    procedure :: begin_group => keyword_list_begin_group
    procedure :: add => keyword_list_add
    procedure :: add_edges_and_nodes => keyword_list_add_edges_and_nodes
  end type keyword_list_t

  public :: find_group, find_key

contains

  !> Begin a group.
  pure subroutine keyword_list_begin_group(self, name, occurs, meaning, example)
    class(keyword_list_t), intent(inout) :: self
    character(*), intent(in) :: name, meaning, example  !! As in `group_keyword_t`.
    integer, intent(in) :: occurs  !! Likewise.
    type(group_keyword_t), allocatable :: longer(:)
    integer :: n
    n = size(self%group)
    allocate (longer(n + 1))
    longer(:n) = self%group
    call move_alloc(longer, self%group)
    associate (group => self%group(n + 1))
      group%name = name
      group%occurs = occurs
      group%meaning = meaning
      group%example = example
      allocate (group%key(0))
    end associate
  end subroutine keyword_list_begin_group

  !> Add a key to the last group; arguments and what is absent are as in `keyword_t`.
  pure subroutine keyword_list_add(self, key, kind, meaning, least, most, unit, names, default, positive, &
                                   not_negative, required, may_be_empty)
    class(keyword_list_t), intent(inout) :: self
    character(*), intent(in) :: key, meaning
    integer, intent(in) :: kind
    integer, intent(in), optional :: least, most
    character(*), intent(in), optional :: unit, names, default
    logical, intent(in), optional :: positive, not_negative, required, may_be_empty
    type(keyword_t), allocatable :: longer(:)
    integer :: n
    associate (group => self%group(size(self%group)))
      n = size(group%key)
      allocate (longer(n + 1))
      longer(:n) = group%key
      call move_alloc(longer, group%key)
      associate (row => group%key(n + 1))
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
    end associate
  end subroutine keyword_list_add

  !> Add the keys of edges and nodes, in place of a surface, to the last group.
  pure subroutine keyword_list_add_edges_and_nodes(self)
    class(keyword_list_t), intent(inout) :: self
    integer, parameter :: most_coordinates = 300
    call self%add('edge', kind_text, 'in place of surface, in three dimensions: physical curve along edges of '// &
      'elements, or a set of nodes of a deck that has no face; with wildcards')
    call self%add('nodes', kind_text, 'in place of surface: the nodes of a physical point, curve or surface, or a '// &
      'set of nodes of a deck; with wildcards')
    call self%add('nodes_at', kind_real, least=2, most=most_coordinates, unit='length', meaning='in place of '// &
      'surface: positions of nodes of the mesh, with the body in place, 2 or 3 values for each node')
  end subroutine keyword_list_add_edges_and_nodes

  !> Place of a group in the table; 0 where it is unknown.
  pure integer function find_group(table, name) result(place)
    type(group_keyword_t), intent(in) :: table(:)  !! The groups (n_groups).
    character(*), intent(in) :: name  !! Name in lower case.
    do place = 1, size(table)
      if (table(place)%name == name) return
    end do
    place = 0
  end function find_group

  !> Place of a key in its group; 0 where it is unknown.
  pure integer function find_key(group, key) result(place)
    type(group_keyword_t), intent(in) :: group  !! The group.
    character(*), intent(in) :: key  !! Name in lower case.
    do place = 1, size(group%key)
      if (group%key(place)%key == key) return
    end do
    place = 0
  end function find_key
end module dotyk_input_keywords
