!> Data lines of Abaqus and CalculiX decks: nodes, elements, members of sets, faces of surfaces, places of instances.
module dotyk_mesh_inp_data
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: lower, quoted, shown, to_text
  use dotyk_mesh_inp_card, only: get_real_field, next_field, to_integer, without_quotes
  use dotyk_mesh_inp_part, only: add_entry, add_member, find_set, inp_part_t, inp_set_t
  use dotyk_mesh_inp_state, only: inp_state_t
  use dotyk_mesh_tag_map, only: tag_map_t
  implicit none
  private
  public :: read_data, take_nodes_of

  integer(int64), parameter :: most_members = 10_int64**9  !! Members of a range beyond which it is a mistake.

contains

  !> Read a data line of the present card.
  subroutine read_data(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(inout) :: text  !! Text of the file; commas behind numbers may become blanks.
    integer(int64), intent(in) :: first, last  !! First and last character of the line that are not blank.
    select case (state%purpose)
    case ('node')
      call read_node(state, text, first, last)
    case ('element')
      call read_element(state, text, first, last)
    case ('nset', 'elset')
      if (state%card%has('generate')) then
        call read_range(state, text, first, last)
      else
        call read_members(state, text, first, last)
      end if
    case ('surface')
      call read_faces(state, text, first, last)
    case ('temperature')
      call read_temperature(state, text, first, last)
    case ('instance')
      call read_placement(state, text, first, last)
    end select
  end subroutine read_data

  !> An integer that a field must be.
  subroutine need_integer(state, text, value)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! The field.
    integer(int64), intent(out) :: value  !! The integer; 0 after a mistake.
    logical :: valid
    call to_integer(text, value, valid)
    if (.not. valid) call state%fail('expected an integer, found '//shown(text))
  end subroutine need_integer

  !> A number that a field must be.
  subroutine need_real(state, text, a, b, value)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(inout) :: text  !! Text of the file; a comma behind the number may become a blank.
    integer(int64), intent(in) :: a, b  !! First and last character of the field.
    real(dp), intent(out) :: value  !! The number.
    logical :: valid
    call get_real_field(text, a, b, value, valid)
    if (.not. valid) call state%fail('expected a finite number, found '//shown(text(a:b)))
  end subroutine need_real

  !> Read a node: its number and up to three coordinates.
  subroutine read_node(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(inout) :: text  !! Text of the file.
    integer(int64), intent(in) :: first, last  !! The line.
    integer(int64) :: p, a, b, tag
    real(dp) :: x(3)
    integer :: k
    p = first
    call next_field(text, p, last, a, b)
    call need_integer(state, text(a:b), tag)
    x = 0
    do k = 1, 3
      if (p > last) exit
      call next_field(text, p, last, a, b)
      call need_real(state, text, a, b, x(k))
    end do
    if (tag <= 0) call state%fail('the number of a node must be positive')
    if (allocated(state%fault)) return
    associate (part => state%slot(state%at)%part)
      call part%add_node(tag, x, state%line)
      if (state%index > 0) call add_member(part%node_set(state%index), tag, 0_int64)
    end associate
  end subroutine read_node

  !> Read a line of an element, or of several: the number and the nodes of each, on as many lines as are needed.
  subroutine read_element(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! Text of the file.
    integer(int64), intent(in) :: first, last  !! The line.
    integer(int64) :: p, a, b
    integer :: n, i
    p = first
    do while (p <= last)
      call next_field(text, p, last, a, b)
      if (b < a) cycle
      n = state%n_values + 1
      call need_integer(state, text(a:b), state%value(n))
      if (allocated(state%fault)) return
      if (n == 1) state%first_line = state%line
      state%n_values = n
      if (n <= state%type%n_nodes) cycle
      state%n_values = 0
      if (p <= last) then
        if (verify(text(p:last), ', ') > 0) &
          call state%fail('element '//to_text(state%value(1))//' has more than '//to_text(n - 1)//' nodes')
      end if
      do i = 2, n - 1
        if (any(state%value(i + 1:n) == state%value(i))) &
          call state%fail('element '//to_text(state%value(1))//' has node '//to_text(state%value(i))//' twice: '// &
                          'collapsed elements are not read, write it as a C3D6 or C3D15, or a triangle')
      end do
      if (allocated(state%fault)) return
      associate (part => state%slot(state%at)%part)
        call part%add_element(state%value(1), state%type%kind, state%value(1 + state%type%order(:n - 1)), &
                              state%first_line)
        if (state%index > 0) call add_member(part%element_set(state%index), state%value(1), 0_int64)
      end associate
      return
    end do
  end subroutine read_element

  !> Add a member to the set of the card.
  subroutine add_to_set(state, tag, line)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    integer(int64), intent(in) :: tag  !! Number of the node or element.
    integer(int64), intent(in) :: line  !! Its line, 0 where a missing one is no mistake.
    associate (part => state%slot(state%at)%part)
      if (state%purpose == 'nset') then
        call add_member(part%node_set(state%index), tag, line)
      else
        call add_member(part%element_set(state%index), tag, line)
      end if
    end associate
  end subroutine add_to_set

  !> Read a range: first, last, step.
  subroutine read_range(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! Text of the file.
    integer(int64), intent(in) :: first, last  !! The line.
    integer(int64) :: p, a, b, value(3), i
    integer :: n
    p = first
    n = 0
    value = 1
    do while (p <= last .and. n < 3)
      call next_field(text, p, last, a, b)
      if (b < a) cycle
      n = n + 1
      call need_integer(state, text(a:b), value(n))
    end do
    if (n == 1) value(2) = value(1)
    if (value(3) < 1 .or. value(2) < value(1)) call state%fail('GENERATE needs first, last and step of a range')
    if ((value(2) - value(1))/max(value(3), 1_int64) > most_members) call state%fail('the range has too many members')
    if (allocated(state%fault)) return
    do i = value(1), value(2), value(3)
      call add_to_set(state, i + state%offset, 0_int64)
    end do
  end subroutine read_range

  !> Read members: numbers, or sets that are defined above.
  subroutine read_members(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! Text of the file.
    integer(int64), intent(in) :: first, last  !! The line.
    integer(int64) :: p, a, b, tag
    logical :: valid
    p = first
    do while (p <= last .and. .not. allocated(state%fault))
      call next_field(text, p, last, a, b)
      if (b < a) cycle
      call find_number(state, text(a:b), tag, valid)
      if (valid) then
        call add_to_set(state, tag, state%line)
      else if (state%purpose == 'nset') then
        call copy_set(state, state%slot(state%at)%part%node_set, state%slot(state%at)%part%n_node_sets, &
                      lower(without_quotes(text(a:b))))
      else
        call copy_set(state, state%slot(state%at)%part%element_set, state%slot(state%at)%part%n_element_sets, &
                      lower(without_quotes(text(a:b))))
      end if
    end do
  end subroutine read_members

  !> The number of a node or element: an integer, or that of an instance, as part-1.17.
  subroutine find_number(state, text, tag, valid)
    type(inp_state_t), intent(in) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! The field.
    integer(int64), intent(out) :: tag  !! The number.
    logical, intent(out) :: valid  !! Whether the field is one.
    integer(int64) :: offset
    integer :: dot
    call to_integer(text, tag, valid)
    tag = tag + state%offset
    dot = index(text, '.', back=.true.)
    if (valid .or. dot < 2) return
    call to_integer(text(dot + 1:), tag, valid)
    if (.not. valid) return
    offset = state%instances%offset_of(lower(text(:dot - 1)))
    valid = offset > 0
    tag = tag + offset
  end subroutine find_number

  !> Find a set that must be defined above: of the part, or of the instance that the card names.
  subroutine find_above(state, sets, n, what, key, found)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    type(inp_set_t), allocatable, intent(in) :: sets(:)  !! Sets of the part (room).
    integer, intent(in) :: n  !! Their number.
    character(*), intent(in) :: what  !! What it is, for the message.
    character(*), intent(in) :: key  !! Its name in small letters.
    integer, intent(out) :: found  !! Its index; 0 after a mistake.
    found = find_set(sets, n, key)
    if (found == 0 .and. len(state%card%get('instance')) > 0) &
      found = find_set(sets, n, lower(state%card%get('instance'))//'.'//key)
    if (found == 0) call state%fail('there is no '//what//' '//quoted(key)//' above this line')
  end subroutine find_above

  !> Add the members of another set to that of the card.
  subroutine copy_set(state, sets, n, key)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    type(inp_set_t), allocatable, intent(in) :: sets(:)  !! Sets of the part (room).
    integer, intent(in) :: n  !! Their number.
    character(*), intent(in) :: key  !! Name of the other set in small letters.
    integer(int64), allocatable :: member(:)
    integer :: i, other
    call find_above(state, sets, n, 'set', key, other)
    if (other == 0) return
    member = sets(other)%member(:sets(other)%n)
    do i = 1, size(member)
      call add_to_set(state, member(i), 0_int64)
    end do
  end subroutine copy_set

  !> Add the nodes of the elements of a set to the node set of the card.
  subroutine take_nodes_of(state, key)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: key  !! Name of the element set in small letters.
    type(tag_map_t) :: map
    integer :: set, i, e, k, repeated
    associate (part => state%slot(state%at)%part)
      call find_above(state, part%element_set, part%n_element_sets, 'element set', key, set)
      if (set == 0) return
      call map%init(part%element_tag(:part%n_elements), repeated)
      if (repeated > 0) return
      do i = 1, part%element_set(set)%n
        e = map%find(part%element_set(set)%member(i))
        if (e == 0) cycle
        do k = part%first(e), part%first(e + 1) - 1
          call add_member(part%node_set(state%index), part%connectivity(k), 0_int64)
        end do
      end do
    end associate
  end subroutine take_nodes_of

  !> Read an entry of a surface: elements and a face of them, or nodes.
  subroutine read_faces(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! Text of the file.
    integer(int64), intent(in) :: first, last  !! The line.
    integer(int64) :: p, a, b, number
    character(:), allocatable :: set, label
    integer :: face
    logical :: valid
    p = first
    call next_field(text, p, last, a, b)
    call find_number(state, text(a:b), number, valid)
    set = ''
    if (.not. valid) set = lower(without_quotes(text(a:b)))
    if (b < a) call state%fail('expected an element, a node or a set')
    face = 0
    associate (surface => state%slot(state%at)%part%surface(state%index))
      if (p <= last .and. .not. surface%of_nodes) then
        call next_field(text, p, last, a, b)
        label = lower(text(a:b))
        if (len(label) == 2) face = index('123456', label(2:2))*merge(1, 0, label(1:1) == 's')
        if (face == 0 .and. len(label) > 0) &
          call state%fail('expected a face of solid elements, S1 to S6, found '//shown(text(a:b)))
      end if
      if (.not. allocated(state%fault)) call add_entry(surface, set, number, face, state%line)
    end associate
  end subroutine read_faces

  !> Read a temperature of a node or of a set.
  subroutine read_temperature(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(inout) :: text  !! Text of the file.
    integer(int64), intent(in) :: first, last  !! The line.
    integer(int64) :: p, a, b, tag
    character(:), allocatable :: set
    real(dp) :: value
    integer :: s, i
    logical :: valid
    p = first
    call next_field(text, p, last, a, b)
    call find_number(state, text(a:b), tag, valid)
    if (.not. valid) set = lower(without_quotes(text(a:b)))
    call next_field(text, p, last, a, b)
    call need_real(state, text, a, b, value)
    if (allocated(state%fault)) return
    if (valid) then
      call state%temperature%take(tag, value)
      return
    end if
    associate (part => state%slot(state%at)%part)
      call find_above(state, part%node_set, part%n_node_sets, 'node set', set, s)
      if (s == 0) return
      do i = 1, part%node_set(s)%n
        call state%temperature%take(part%node_set(s)%member(i), value)
      end do
    end associate
  end subroutine read_temperature

  !> Read the numbers that place an instance.
  subroutine read_placement(state, text, first, last)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(inout) :: text  !! Text of the file.
    integer(int64), intent(in) :: first, last  !! The line.
    integer(int64) :: p, a, b
    p = first
    do while (p <= last)
      call next_field(text, p, last, a, b)
      if (state%n_placement == size(state%placement)) then
        call state%fail('an instance has one translation and one rotation: nodes and elements belong into its *PART')
        return
      end if
      state%n_placement = state%n_placement + 1
      call need_real(state, text, a, b, state%placement(state%n_placement))
    end do
    ! A translation may be shorter.
    if (state%n_placement < 3) state%n_placement = 3
  end subroutine read_placement
end module dotyk_mesh_inp_data
