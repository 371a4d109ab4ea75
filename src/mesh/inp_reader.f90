!> Files and cards of an Abaqus or CalculiX deck that is read as a mesh: nodes, elements, sets, surfaces; files that it
!> includes; parts and instances of Abaqus. Keywords about materials, loads and steps are listed and not read.
!>
!> Sources: CalculiX CrunchiX USER'S MANUAL, chapter "Input deck format"; Abaqus Keywords Reference Guide.
module dotyk_mesh_inp_reader
  use dotyk_base_byte_window, only: byte_window_t
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_files, only: nature_of
  use dotyk_base_kinds, only: int64
  use dotyk_base_operating_system, only: directory_of
  use dotyk_base_text, only: lower, quoted, shown
  use dotyk_mesh_inp_card, only: inp_card_t
  use dotyk_mesh_inp_data, only: read_data, take_nodes_of
  use dotyk_mesh_inp_element_type, only: find_inp_type
  use dotyk_mesh_inp_part, only: max_files
  use dotyk_mesh_inp_state, only: inp_state_t
  implicit none
  private
  public :: read_deck

  integer, parameter :: most_nested = 20  !! Nested files beyond which one includes itself.

contains

  !> Read a deck.
  subroutine read_deck(file, state, error, field)
    character(*), intent(in) :: file  !! Path of the file.
    type(inp_state_t), intent(out) :: state  !! What was read.
    !> Set for files that cannot be read and for mistakes in them, with file and line.
    type(error_t), allocatable, intent(out) :: error
    character(*), intent(in), optional :: field  !! Name of a field of temperatures, which is read too; none if absent.
    call state%start
    if (present(field)) then
      allocate (state%temperature)
      call state%temperature%init(field)
    end if
    call read_file(state, file, 1, error)
    if (allocated(error)) return
    if (.not. allocated(state%fault)) call state%end_data
    if (state%at > 1) call state%fail('the file ends inside a *PART: *END PART is missing')
    if (allocated(state%fault)) call set_error(error, state%fault)
  end subroutine read_deck

  !> Read one file.
  recursive subroutine read_file(state, path, depth, error)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: path  !! Path of the file.
    integer, intent(in) :: depth  !! 1 for the deck, more for a file that is included.
    type(error_t), allocatable, intent(out) :: error  !! Set where a file cannot be read, or is none of the format.
    type(byte_window_t) :: bytes
    character(:), allocatable :: card, include
    integer(int64) :: p, first, last, number
    integer :: file
    call bytes%read_all(path, error)
    if (allocated(error)) return
    call state%add_file(path)
    file = state%n_files
    p = 1
    number = 0
    state%line = max_files + file
    do while (p <= bytes%size .and. .not. allocated(state%fault))
      number = number + 1
      state%line = max_files*number + file
      call find_line(bytes%text, p, bytes%size, first, last)
      if (first > last) cycle
      if (bytes%text(first:first) /= '*') then
        if (depth == 1 .and. len(state%card%keyword) == 0) then
          call refuse_content(state, bytes)
          exit
        end if
        call read_data(state, bytes%text, first, last)
        cycle
      end if
      if (bytes%text(first:min(first + 1, last)) == '**') then
        state%by_gmsh = state%by_gmsh .or. index(bytes%text(first:last), 'E L E M E N T S') > 0
        cycle
      end if
      card = bytes%text(first:last)
      do while (card(len(card):) == ',' .and. p <= bytes%size)
        number = number + 1
        call find_line(bytes%text, p, bytes%size, first, last)
        card = card//bytes%text(first:last)
        if (first > last) exit
      end do
      call begin_card(state, card, include)
      if (len(include) == 0 .or. allocated(state%fault)) cycle
      call read_include(state, include, depth, error)
      if (allocated(error)) return
    end do
    if (depth == 1 .and. bytes%size == 0) call state%fail('the file is empty')
  end subroutine read_file

  !> Refuse a file that does not begin as a deck.
  subroutine refuse_content(state, bytes)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    type(byte_window_t), intent(inout) :: bytes  !! The file.
    character(:), allocatable :: beginning, nature
    call bytes%first_bytes(1024, beginning)
    nature = nature_of(beginning)
    if (len(nature) > 0) nature = 'is '//nature//' and '
    call state%fail('this is no Abaqus or CalculiX deck: it '//nature//'does not begin with a keyword, as *NODE')
  end subroutine refuse_content

  !> Read a file that the present line names: beside the deck.
  recursive subroutine read_include(state, name, depth, error)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: name  !! Its name.
    integer, intent(in) :: depth  !! Depth of the file that names it.
    type(error_t), allocatable, intent(out) :: error  !! Set where it cannot be read; the message names the line.
    character(:), allocatable :: path, place
    path = name
    if (path(1:1) /= '/') path = directory_of(state%file(1)%s)//path
    place = state%place(state%line)
    if (depth >= most_nested .or. state%n_files + 1 >= max_files) then
      call state%fail('too many nested files: one includes itself')
      return
    end if
    call read_file(state, path, depth + 1, error)
    if (allocated(error)) error%message = place//': '//error%message
  end subroutine read_include

  !> The next line of a text.
  pure subroutine find_line(text, p, size, first, last)
    character(*), intent(in) :: text  !! Text.
    integer(int64), intent(inout) :: p  !! First character of the line; that of the next line on return.
    integer(int64), intent(in) :: size  !! Length of the text.
    !> First and last character that are not blank; last < first in an empty line.
    integer(int64), intent(out) :: first, last
    integer(int64) :: end
    do end = p, size
      if (text(end:end) == achar(10)) exit
    end do
    do first = p, end - 1
      if (iachar(text(first:first)) > 32) exit
    end do
    do last = end - 1, first, -1
      if (iachar(text(last:last)) > 32) exit
    end do
    p = end + 1
  end subroutine find_line

  !> Begin a card.
  subroutine begin_card(state, text, include)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! The card.
    character(:), allocatable, intent(out) :: include  !! File that is to be read next; empty for none.
    type(inp_card_t) :: card
    call card%parse(text)
    include = ''
    if (card%keyword == 'include') then
      ! Its lines may be data of the card before it.
      include = card%get('input')
      if (len(include) == 0) call state%fail('*INCLUDE needs INPUT=')
      return
    end if
    call state%end_data
    if (allocated(state%fault)) return
    state%card = card
    state%purpose = ''
    state%index = 0
    state%offset = 0
    select case (card%keyword)
    case ('node')
      state%purpose = 'node'
      include = card%get('input')
      if (scan(lower(card%get('system')), 'cs') > 0) &
        call state%fail('*NODE, SYSTEM='//card%get('system')//': only Cartesian coordinates are read')
      if (len(card%get('nset')) > 0) call state%open_set('nset')
    case ('element')
      include = card%get('input')
      call begin_elements(state)
    case ('nset', 'elset')
      call begin_set(state)
    case ('surface')
      call begin_surface(state)
    case ('part')
      if (state%at > 1) call state%fail('*PART inside a *PART')
      call state%add_part(lower(card%get('name')))
    case ('endpart')
      state%at = 1
    case ('instance')
      state%purpose = 'instance'
      state%n_placement = 0
      state%placement = 0
    case ('temperature', 'initialconditions')
      call begin_temperatures(state)
    case ('step')
      if (allocated(state%temperature)) call state%temperature%begin_step(card)
      call note(state, '*STEP')
    case ('assembly', 'endassembly', 'endinstance', 'heading', 'endstep')
      continue
    case ('ncopy', 'ngen', 'nfill', 'nmap', 'elgen', 'elcopy', 'system', 'elementcopy')
      call state%fail('*'//capital(card%keyword)//': nodes and elements must be in the file, they are not generated')
    case default
      call note(state, '*'//capital(card%keyword))
    end select
  end subroutine begin_card

  !> Note a keyword that is not read.
  subroutine note(state, text)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(*), intent(in) :: text  !! The keyword.
    if (index(', '//state%not_read//',', ', '//text//',') > 0) return
    if (len(state%not_read) > 0) state%not_read = state%not_read//', '
    state%not_read = state%not_read//text
  end subroutine note

  !> A keyword in capital letters.
  pure function capital(keyword) result(text)
    character(*), intent(in) :: keyword  !! Keyword in small letters.
    character(len(keyword)) :: text
    integer :: i
    text = keyword
    do i = 1, len(keyword)
      if (keyword(i:i) >= 'a' .and. keyword(i:i) <= 'z') text(i:i) = achar(iachar(keyword(i:i)) - 32)
    end do
  end function capital

  !> Begin elements: find their type.
  subroutine begin_elements(state)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(:), allocatable :: name
    name = state%card%get('type')
    state%purpose = 'element'
    state%type = find_inp_type(lower(name))
    state%n_values = 0
    if (index(lower(name), 't3d') == 1 .and. .not. state%by_gmsh) state%type%kind = 0
    if (len(name) == 0) then
      call state%fail('*ELEMENT needs TYPE=')
    else if (state%type%kind == 0) then
      call state%fail('*ELEMENT, TYPE='//shown(name)//' is not read, only solid elements: C3D4, C3D5, C3D6, C3D8, '// &
                      'C3D10, C3D15, C3D20 and their variants, in two dimensions CPS, CPE, CAX with 3, 4, 6, 8 '// &
                      'nodes; remove these elements from the file, and model what they stand for in the namelist')
    else if (len(state%card%get('elset')) > 0) then
      call state%open_set('elset')
    end if
  end subroutine begin_elements

  !> Begin temperatures, which are read where a field of them is wanted.
  subroutine begin_temperatures(state)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(:), allocatable :: fault
    logical :: wanted
    wanted = allocated(state%temperature)
    if (state%card%keyword == 'initialconditions') &
      wanted = wanted .and. lower(state%card%get('type')) == 'temperature'
    if (.not. wanted) then
      call note(state, '*'//capital(state%card%keyword))
      return
    end if
    call state%temperature%begin_card(state%card, wanted, fault)
    if (len(fault) > 0) call state%fail(fault)
    if (wanted) state%purpose = 'temperature'
  end subroutine begin_temperatures

  !> Begin a set of nodes or elements.
  subroutine begin_set(state)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(:), allocatable :: keyword, instance
    keyword = state%card%keyword
    state%purpose = keyword
    if (len(state%card%get(keyword)) == 0) then
      call state%fail('*'//capital(keyword)//' needs a name, '//capital(keyword)//'=')
      return
    end if
    instance = state%card%get('instance')
    if (len(instance) > 0) then
      state%offset = state%instances%offset_of(lower(instance))
      if (state%offset == 0) call state%fail('there is no instance '//quoted(instance)//' above this line')
    end if
    call state%open_set(keyword)
    if (keyword == 'nset' .and. state%card%has('elset')) call take_nodes_of(state, lower(state%card%get('elset')))
  end subroutine begin_set

  !> Begin a surface.
  subroutine begin_surface(state)
    type(inp_state_t), intent(inout) :: state  !! State of the reader.
    character(:), allocatable :: name, type
    integer :: i
    name = state%card%get('name')
    type = lower(state%card%get('type'))
    if (len(name) == 0) then
      call state%fail('*SURFACE needs a name, NAME=')
    else if (state%card%has('combine') .or. len(type) > 0 .and. type /= 'element' .and. type /= 'node') then
      call note(state, '*SURFACE NAME='//name)
    else
      state%purpose = 'surface'
      associate (part => state%slot(state%at)%part)
        do i = 1, part%n_surfaces
          if (part%surface(i)%key == lower(name)) &
            call state%fail('the surface '//quoted(name)//' occurs a second time')
        end do
        call part%add_surface(name, lower(name), type == 'node')
        state%index = part%n_surfaces
      end associate
    end if
  end subroutine begin_surface
end module dotyk_mesh_inp_reader
