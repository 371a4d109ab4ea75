!> State of the reader of Abaqus and CalculiX decks: what was read, and what the data lines of the present card are for.
module dotyk_mesh_inp_state
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: lower, quoted, text_t, to_text
  use dotyk_mesh_element, only: max_element_nodes
  use dotyk_mesh_inp_card, only: inp_card_t
  use dotyk_mesh_inp_element_type, only: inp_type_t
  use dotyk_mesh_inp_instance, only: add_instance, instance_list_t
  use dotyk_mesh_inp_part, only: add_set, inp_part_t, max_files
  use dotyk_mesh_inp_temperature, only: inp_temperature_t
  implicit none
  private

  type, public :: inp_slot_t  !! A part, in a slot so that it can be moved.
    type(inp_part_t), allocatable :: part  !! The part.
  end type inp_slot_t

  type, public :: inp_state_t  !! The state.
    !> The model, what is outside of parts with the instances of the parts, then the parts (room); their number.
    type(inp_slot_t), allocatable :: slot(:)
    integer :: n_slots = 0
    integer :: at = 1  !! The part to which cards belong.
    type(instance_list_t) :: instances  !! Instances of the parts.
    type(text_t), allocatable :: file(:)  !! Files (room), and their number.
    integer :: n_files = 0
    character(:), allocatable :: not_read  !! Keywords that are not read, each once, separated by commas.
    logical :: by_gmsh = .false.  !! Whether gmsh wrote the file: its truss elements are edges of plane meshes.
    character(:), allocatable :: fault  !! Message of the first mistake, not allocated where there is none.
    !> The present card, what its data lines are for ('' to skip them), and the line that is read.
    type(inp_card_t) :: card
    character(:), allocatable :: purpose
    integer(int64) :: line = 0
    !> Type of the elements; integers of the element so far, its number and nodes; its first line.
    type(inp_type_t) :: type
    integer :: n_values = 0
    integer(int64) :: value(max_element_nodes + 1) = 0
    integer(int64) :: first_line = 0
    integer :: index = 0  !! Set or surface of the card, 0 for none; what is added to the numbers of its members.
    integer(int64) :: offset = 0
    real(dp) :: placement(10) = 0  !! Numbers that place an instance, and how many.
    integer :: n_placement = 0
    type(inp_temperature_t), allocatable :: temperature  !! Temperatures; not allocated where only the mesh is read.
  contains
    procedure :: start => state_start
    procedure :: place => state_place
    procedure :: fail => state_fail
    procedure :: add_file => state_add_file
    procedure :: add_part => state_add_part
    procedure :: open_set => state_open_set
    procedure :: end_data => state_end_data
  end type inp_state_t

contains

  !> Start with an empty model.
  subroutine state_start(self)
    class(inp_state_t), intent(inout) :: self
    self%not_read = ''
    self%purpose = ''
    self%card%keyword = ''
    allocate (self%file(8))
    call self%add_part('')
  end subroutine state_start

  !> 'file:line' of a line.
  function state_place(self, line) result(place)
    class(inp_state_t), intent(in) :: self
    integer(int64), intent(in) :: line  !! Line, with its file.
    character(:), allocatable :: place
    place = self%file(int(mod(line, max_files)))%s//':'//to_text(line/max_files)
  end function state_place

  !> Keep a mistake with the present line, if it is the first.
  subroutine state_fail(self, message)
    class(inp_state_t), intent(inout) :: self
    character(*), intent(in) :: message  !! Message.
    if (.not. allocated(self%fault)) self%fault = self%place(self%line)//': '//message
  end subroutine state_fail

  !> Add a file.
  subroutine state_add_file(self, path)
    class(inp_state_t), intent(inout) :: self
    character(*), intent(in) :: path  !! Its path.
    type(text_t), allocatable :: larger(:)
    integer :: i
    if (self%n_files == size(self%file)) then
      allocate (larger(2*self%n_files))
      do i = 1, self%n_files
        call move_alloc(self%file(i)%s, larger(i)%s)
      end do
      call move_alloc(larger, self%file)
    end if
    self%n_files = self%n_files + 1
    self%file(self%n_files)%s = path
  end subroutine state_add_file

  !> Add a part, to which the cards after it belong.
  subroutine state_add_part(self, key)
    class(inp_state_t), intent(inout) :: self
    character(*), intent(in) :: key  !! Its name in small letters.
    type(inp_slot_t), allocatable :: larger(:)
    integer :: i
    if (.not. allocated(self%slot)) allocate (self%slot(8))
    if (self%n_slots == size(self%slot)) then
      allocate (larger(2*self%n_slots))
      do i = 1, self%n_slots
        call move_alloc(self%slot(i)%part, larger(i)%part)
      end do
      call move_alloc(larger, self%slot)
    end if
    self%n_slots = self%n_slots + 1
    self%at = self%n_slots
    allocate (self%slot(self%at)%part)
    self%slot(self%at)%part%key = key
  end subroutine state_add_part

  !> Set that the card names, in the present part; it is added where there is none.
  subroutine state_open_set(self, parameter)
    class(inp_state_t), intent(inout) :: self
    character(*), intent(in) :: parameter  !! 'nset' or 'elset'.
    character(:), allocatable :: name
    name = self%card%get(parameter)
    associate (part => self%slot(self%at)%part)
      if (parameter == 'nset') then
        call add_set(part%node_set, part%n_node_sets, name, lower(name), self%index)
      else
        call add_set(part%element_set, part%n_element_sets, name, lower(name), self%index)
      end if
    end associate
  end subroutine state_open_set

  !> End the data of a card: elements are complete, and an instance is added.
  subroutine state_end_data(self)
    class(inp_state_t), intent(inout) :: self
    if (self%purpose == 'element' .and. self%n_values > 0) then
      self%line = self%first_line
      call self%fail('element '//to_text(self%value(1))//' has '//to_text(self%n_values - 1)//' nodes, '// &
                     to_text(self%type%n_nodes)//' are needed')
    else if (self%purpose == 'instance') then
      call end_instance(self)
    end if
  end subroutine state_end_data

  !> Add the instance whose card and data were read.
  subroutine end_instance(self)
    type(inp_state_t), intent(inout) :: self  !! The state.
    character(:), allocatable :: name, part
    integer(int64) :: step
    integer :: i
    name = self%card%get('name')
    part = self%card%get('part')
    if (len(name) == 0 .or. len(part) == 0) call self%fail('*INSTANCE needs NAME= and PART=')
    if (any(self%n_placement == [4, 5, 6, 7, 8, 9])) &
      call self%fail('a rotation of an instance has 7 numbers: two points of the axis and the angle')
    if (self%instances%offset_of(lower(name)) > 0) &
      call self%fail('the instance '//quoted(name)//' occurs a second time')
    step = 10
    do i = 1, self%n_slots
      do while (step <= self%slot(i)%part%greatest_tag() .and. i > 1)
        step = 10*step
      end do
    end do
    do i = 2, self%n_slots
      if (self%slot(i)%part%key /= lower(part) .or. allocated(self%fault)) cycle
      call self%instances%add(lower(name), step)
      call add_instance(self%slot(1)%part, self%slot(i)%part, name, self%instances%offset(self%instances%n), &
                        self%placement, self%n_placement)
      return
    end do
    call self%fail('there is no part '//quoted(part)//' above this line')
  end subroutine end_instance
end module dotyk_mesh_inp_state
