!> Checked values of a group by key, and names that other groups refer to.
module dotyk_input_values
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: shown, suggestion, text_t, to_text, visible
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  implicit none
  private

  type, public :: names_t  !! Names of all groups of one kind, such as the bodies.
    character(:), allocatable :: what  !! Kind of the groups, for messages: 'body'.
    type(text_t), allocatable :: name(:)  !! The names (n); empty where one cannot be used.
    integer, allocatable :: line(:)  !! Lines of the groups (n).
    !> Name of the body of which each is a half, empty where it is none; not allocated where no body is cut (n).
    type(text_t), allocatable :: whole(:)
    logical :: incomplete = .false.  !! Whether names may be missing because of mistakes that are reported already.
  end type names_t

  public :: is_given, is_usable, line_of, count_of
  public :: text_of, texts_of, real_of, reals_of, integer_of, integers_of, has_option, logical_of
  public :: read_numbers
  public :: pick_groups, gather_names, find_name, first_names, refer, refuse, report

contains

  !> Place of a key in a group; 0 where it is neither given nor a default; the first one where it is given twice.
  pure integer function place_of(group, key) result(place)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    do place = 1, group%n_entries
      if (group%entry(place)%key == key) return
    end do
    place = 0
  end function place_of

  !> Whether a key is in the file.
  pure logical function is_given(group, key) result(given)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = place_of(group, key)
    given = i > 0
    if (given) given = .not. group%entry(i)%from_default
  end function is_given

  !> Whether a key has values without mistakes, given or by default.
  pure logical function is_usable(group, key) result(usable)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = place_of(group, key)
    usable = i > 0
    if (usable) usable = group%entry(i)%usable
  end function is_usable

  !> Line of a key, or of its group where it is not given.
  pure integer function line_of(group, key) result(line)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = place_of(group, key)
    line = group%line
    if (i > 0) line = group%entry(i)%line
  end function line_of

  !> Number of values of a key.
  pure integer function count_of(group, key) result(n)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    integer :: i
    i = place_of(group, key)
    n = 0
    if (i > 0) n = group%entry(i)%n_values
  end function count_of

  !> Text of a key without blanks around it; empty where it has none that can be used.
  pure function text_of(group, key) result(text)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    character(:), allocatable :: text
    text = ''
    if (is_usable(group, key)) text = trim(adjustl(group%entry(place_of(group, key))%value(1)%text))
  end function text_of

  !> All texts of a key; none where it has none that can be used.
  pure subroutine texts_of(group, key, texts)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    type(text_t), allocatable, intent(out) :: texts(:)  !! The texts (n_values).
    integer :: i, k, n
    n = 0
    if (is_usable(group, key)) n = count_of(group, key)
    allocate (texts(n))
    k = place_of(group, key)
    do i = 1, n
      texts(i)%s = trim(adjustl(group%entry(k)%value(i)%text))
    end do
  end subroutine texts_of

  !> Real of a key [its unit]; 0 where it has none that can be used.
  pure real(dp) function real_of(group, key) result(value)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    value = 0
    if (is_usable(group, key)) value = group%entry(place_of(group, key))%reals(1)
  end function real_of

  !> All reals of a key; none where it has none that can be used.
  pure subroutine reals_of(group, key, values)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    real(dp), allocatable, intent(out) :: values(:)  !! The reals (n_values) [unit of the key].
    if (is_usable(group, key)) then
      values = group%entry(place_of(group, key))%reals
    else
      allocate (values(0))
    end if
  end subroutine reals_of

  !> Integer of a key, or the option of its name; 0 where it has none that can be used.
  pure integer function integer_of(group, key) result(value)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    value = 0
    if (is_usable(group, key)) value = group%entry(place_of(group, key))%integers(1)
  end function integer_of

  !> All integers of a key; none where it has none that can be used.
  pure subroutine integers_of(group, key, values)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    integer, allocatable, intent(out) :: values(:)  !! The integers (n_values).
    if (is_usable(group, key)) then
      values = group%entry(place_of(group, key))%integers
    else
      allocate (values(0))
    end if
  end subroutine integers_of

  !> Whether an option is among the names of a key.
  pure logical function has_option(group, key, option) result(has)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    integer, intent(in) :: option  !! Option, from 1.
    has = .false.
    if (is_usable(group, key)) has = any(group%entry(place_of(group, key))%integers == option)
  end function has_option

  !> Logical of a key; false where it has none that can be used.
  pure logical function logical_of(group, key) result(value)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    value = .false.
    if (is_usable(group, key)) value = group%entry(place_of(group, key))%logicals(1)
  end function logical_of

  !> Report a problem of a key, at its line.
  subroutine report(problems, group, key, message)
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! The key; the line is that of the group where it is not given.
    character(*), intent(in) :: message  !! What is wrong, after '&group: '.
    call problems%add(line_of(group, key), '&'//group%name//': '//message)
  end subroutine report

  !> Indices of the groups of a name.
  pure subroutine pick_groups(groups, name, picked)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    character(*), intent(in) :: name  !! Name of the groups.
    integer, allocatable, intent(out) :: picked(:)  !! Their indices, ascending (n_picked).
    integer :: i
    picked = pack([(i, i=1, size(groups))], [(groups(i)%name == name, i=1, size(groups))])
  end subroutine pick_groups

  !> Gather the names of groups of one kind and report duplicates.
  subroutine gather_names(groups, what, misspelled, problems, names)
    type(group_t), intent(in) :: groups(:)  !! All groups of the file (n_groups).
    character(*), intent(in) :: what  !! Name of the groups.
    logical, intent(in) :: misspelled  !! Whether the file may have such a group under a misspelled name.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(names_t), intent(out) :: names  !! Their names.
    integer, allocatable :: picked(:)
    integer :: i, j
    call pick_groups(groups, what, picked)
    names%what = what
    names%incomplete = misspelled
    allocate (names%name(size(picked)), names%line(size(picked)))
    do i = 1, size(picked)
      names%name(i)%s = text_of(groups(picked(i)), 'name')
      names%line(i) = groups(picked(i))%line
      if (len(names%name(i)%s) == 0) then
        names%incomplete = .true.
        cycle
      end if
      do j = 1, i - 1
        if (names%name(j)%s /= names%name(i)%s .or. len(names%name(j)%s) /= len(names%name(i)%s)) cycle
        call report(problems, groups(picked(i)), 'name', 'a second '//what//' '//shown(names%name(i)%s)// &
                    ' (the first is in line '//to_text(names%line(j))//')')
        exit
      end do
    end do
  end subroutine gather_names

  !> Index of a name; 0 where it is unknown.
  pure integer function find_name(names, name) result(place)
    type(names_t), intent(in) :: names  !! Names to search.
    character(*), intent(in) :: name  !! Name to look up.
    do place = 1, size(names%name)
      if (names%name(place)%s == name .and. len(names%name(place)%s) == len(name)) return
    end do
    place = 0
  end function find_name

  !> Find the group that a key refers to; an unknown name is reported.
  subroutine refer(group, key, name, names, problems, place)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Key of the reference.
    character(*), intent(in) :: name  !! Name that it refers to; nothing is reported where it is empty.
    type(names_t), intent(in) :: names  !! Names that the key may refer to.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    integer, intent(out) :: place  !! Index of the name; 0 where it is unknown.
    character(:), allocatable :: hint
    place = 0
    if (len(name) == 0) return
    place = find_name(names, name)
    if (place > 0 .or. names%incomplete .or. size(names%name) == 0) return
    hint = suggestion(name, names%name)
    if (len(hint) == 0) hint = ' (known: '//first_names(names%name)//')'
    call report(problems, group, key, key//': unknown '//names%what//' '//shown(name)//hint)
  end subroutine refer

  !> The first names of a list, for messages.
  function first_names(name) result(text)
    type(text_t), intent(in) :: name(:)  !! The names, at least one (n_names).
    character(:), allocatable :: text
    integer, parameter :: most = 10
    integer :: i
    text = visible(name(1)%s)
    do i = 2, min(most, size(name))
      text = text//', '//visible(name(i)%s)
    end do
    if (size(name) > most) text = text//' and '//to_text(size(name) - most)//' more'
  end function first_names

  !> Report a key that another one excludes.
  subroutine refuse(group, key, other, problems)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! The excluded key.
    character(*), intent(in) :: other  !! The key that excludes it.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    if (is_given(group, key)) call report(problems, group, key, key//' does not go together with '//other)
  end subroutine refuse

  !> Copy the numbers of a key; components that the key does not have keep their values.
  subroutine read_numbers(group, key, values)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    real(dp), intent(inout) :: values(:)  !! Values of the key (at least as many as the key has) [unit of the key].
    real(dp), allocatable :: numbers(:)
    integer :: n
    call reals_of(group, key, numbers)
    n = min(size(numbers), size(values))
    values(:n) = numbers(:n)
  end subroutine read_numbers
end module dotyk_input_values
