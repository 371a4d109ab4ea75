!> What an Abaqus or CalculiX deck has of a mesh: nodes, elements, sets and surfaces, by the numbers of the deck.
module dotyk_mesh_inp_part
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: text_t
  implicit none
  private

  type, public :: inp_set_t  !! Set of nodes or elements.
    character(:), allocatable :: name, key  !! Name as the deck first writes it, and in small letters.
    integer :: n = 0  !! Number of members.
    integer(int64), allocatable :: member(:)  !! Their numbers (room).
    integer(int64), allocatable :: line(:)  !! Line of each member, 0 where a missing one is no mistake (room).
  end type inp_set_t

  type, public :: inp_surface_t  !! Surface: faces of elements, or the nodes of faces.
    character(:), allocatable :: name, key  !! Name as the deck writes it, and in small letters.
    logical :: of_nodes = .false.  !! Whether nodes are given.
    integer :: n = 0  !! Number of entries.
    type(text_t), allocatable :: set(:)  !! Set of each entry in small letters, empty for a number (room).
    integer(int64), allocatable :: number(:)  !! Element or node of each entry, where it is a number (room).
    integer, allocatable :: face(:)  !! Face of each entry: 1 for S1 and so on, 0 for the outer faces (room).
    integer(int64), allocatable :: line(:)  !! Line of each entry (room).
  end type inp_surface_t

  !> Lines are numbers of `max_files` times the line plus the number of the file.
  integer(int64), parameter, public :: max_files = 100000

  type, public :: inp_part_t  !! A part, or the whole mesh.
    character(:), allocatable :: key  !! Name of the part in small letters.
    integer :: n_nodes = 0, n_elements = 0  !! Number of nodes and elements.
    integer(int64), allocatable :: node_tag(:)  !! Numbers of the nodes (room).
    real(dp), allocatable :: x(:, :)  !! Their coordinates (3, room) [length].
    integer(int64), allocatable :: node_line(:)  !! Their lines (room).
    integer(int64), allocatable :: element_tag(:), element_line(:)  !! Numbers, kinds and lines of the elements (room).
    integer, allocatable :: kind(:)
    !> Geometric entities of the elements; not allocated where the file tells none (n_elements).
    integer, allocatable :: entity(:)
    integer, allocatable :: first(:)  !! First node of each element in `connectivity` (room + 1).
    !> Nodes of the elements by their numbers, in the order of the kinds (room).
    integer(int64), allocatable :: connectivity(:)
    integer :: n_node_sets = 0, n_element_sets = 0, n_surfaces = 0  !! Number of node sets, element sets and surfaces.
    type(inp_set_t), allocatable :: node_set(:), element_set(:)  !! Sets of nodes and of elements, and surfaces (room).
    type(inp_surface_t), allocatable :: surface(:)
  contains
    procedure :: add_node => part_add_node
    procedure :: add_element => part_add_element
    procedure :: add_surface => part_add_surface
    procedure :: greatest_tag => part_greatest_tag
  end type inp_part_t

  public :: find_set, add_set, add_member, add_entry

contains

  !> Add a node.
  subroutine part_add_node(self, tag, x, line)
    class(inp_part_t), intent(inout) :: self
    integer(int64), intent(in) :: tag  !! Its number.
    real(dp), intent(in) :: x(3)  !! Its place (3) [length].
    integer(int64), intent(in) :: line  !! Its line.
    real(dp), allocatable :: larger(:, :)
    integer :: n
    n = self%n_nodes + 1
    call make_room(self%node_tag, n)
    call make_room(self%node_line, n)
    if (.not. allocated(self%x)) allocate (self%x(3, size(self%node_tag)))
    if (n > size(self%x, 2)) then
      allocate (larger(3, size(self%node_tag)))
      larger(:, :n - 1) = self%x(:, :n - 1)
      call move_alloc(larger, self%x)
    end if
    self%n_nodes = n
    self%node_tag(n) = tag
    self%x(:, n) = x
    self%node_line(n) = line
  end subroutine part_add_node

  !> Add an element.
  subroutine part_add_element(self, tag, kind, node, line)
    class(inp_part_t), intent(inout) :: self
    integer(int64), intent(in) :: tag  !! Its number.
    integer, intent(in) :: kind  !! Its kind.
    integer(int64), intent(in) :: node(:)  !! Its nodes by their numbers, in the order of the kind (n_nodes).
    integer(int64), intent(in) :: line  !! Its line.
    integer, allocatable :: larger(:)
    integer :: n, m
    n = self%n_elements + 1
    call make_room(self%element_tag, n)
    call make_room(self%element_line, n)
    if (.not. allocated(self%kind)) then
      allocate (self%kind(size(self%element_tag)), self%first(size(self%element_tag) + 1))
      self%first(1) = 1
    end if
    if (n > size(self%kind)) then
      allocate (larger(size(self%element_tag)))
      larger(:n - 1) = self%kind(:n - 1)
      call move_alloc(larger, self%kind)
      allocate (larger(size(self%element_tag) + 1))
      larger(:n) = self%first(:n)
      call move_alloc(larger, self%first)
    end if
    m = self%first(n) - 1
    call make_room(self%connectivity, m + size(node))
    self%n_elements = n
    self%element_tag(n) = tag
    self%kind(n) = kind
    self%element_line(n) = line
    self%connectivity(m + 1:m + size(node)) = node
    self%first(n + 1) = m + size(node) + 1
  end subroutine part_add_element

  !> Add a surface.
  subroutine part_add_surface(self, name, key, of_nodes)
    class(inp_part_t), intent(inout) :: self
    character(*), intent(in) :: name, key  !! Name as the deck writes it, and in small letters.
    logical, intent(in) :: of_nodes  !! Whether nodes are given.
    type(inp_surface_t), allocatable :: larger(:)
    integer :: i
    if (.not. allocated(self%surface)) allocate (self%surface(16))
    if (self%n_surfaces == size(self%surface)) then
      allocate (larger(2*self%n_surfaces))
      do i = 1, self%n_surfaces
        call move_alloc(self%surface(i)%name, larger(i)%name)
        call move_alloc(self%surface(i)%key, larger(i)%key)
        larger(i)%of_nodes = self%surface(i)%of_nodes
        larger(i)%n = self%surface(i)%n
        call move_alloc(self%surface(i)%set, larger(i)%set)
        call move_alloc(self%surface(i)%number, larger(i)%number)
        call move_alloc(self%surface(i)%face, larger(i)%face)
        call move_alloc(self%surface(i)%line, larger(i)%line)
      end do
      call move_alloc(larger, self%surface)
    end if
    self%n_surfaces = self%n_surfaces + 1
    associate (surface => self%surface(self%n_surfaces))
      surface%name = name
      surface%key = key
      surface%of_nodes = of_nodes
      allocate (surface%set(4), surface%number(4), surface%face(4), surface%line(4))
    end associate
  end subroutine part_add_surface

  !> The greatest number of a node or element.
  pure integer(int64) function part_greatest_tag(self) result(tag)
    class(inp_part_t), intent(in) :: self
    tag = 0
    if (self%n_nodes > 0) tag = maxval(self%node_tag(:self%n_nodes))
    if (self%n_elements > 0) tag = max(tag, maxval(self%element_tag(:self%n_elements)))
  end function part_greatest_tag

  !> Index of a set, 0 if there is none of the name.
  pure integer function find_set(sets, n, key) result(index)
    type(inp_set_t), allocatable, intent(in) :: sets(:)  !! Sets (room).
    integer, intent(in) :: n  !! Their number.
    character(*), intent(in) :: key  !! Name in small letters.
    do index = n, 1, -1
      if (sets(index)%key == key) return
    end do
    index = 0
  end function find_set

  !> Index of a set; it is added if there is none of the name.
  subroutine add_set(sets, n, name, key, index)
    type(inp_set_t), allocatable, intent(inout) :: sets(:)  !! Sets (room).
    integer, intent(inout) :: n  !! Their number.
    character(*), intent(in) :: name, key  !! Name as the deck writes it, and in small letters.
    integer, intent(out) :: index  !! The index.
    type(inp_set_t), allocatable :: larger(:)
    integer :: i
    index = find_set(sets, n, key)
    if (index > 0) return
    if (.not. allocated(sets)) allocate (sets(16))
    if (n == size(sets)) then
      allocate (larger(2*n))
      do i = 1, n
        call move_alloc(sets(i)%name, larger(i)%name)
        call move_alloc(sets(i)%key, larger(i)%key)
        larger(i)%n = sets(i)%n
        call move_alloc(sets(i)%member, larger(i)%member)
        call move_alloc(sets(i)%line, larger(i)%line)
      end do
      call move_alloc(larger, sets)
    end if
    n = n + 1
    index = n
    sets(n)%name = name
    sets(n)%key = key
    allocate (sets(n)%member(8), sets(n)%line(8))
  end subroutine add_set

  !> Add a member to a set.
  subroutine add_member(set, tag, line)
    type(inp_set_t), intent(inout) :: set  !! The set.
    integer(int64), intent(in) :: tag  !! Number of the node or element.
    integer(int64), intent(in) :: line  !! Its line, 0 where a missing one is no mistake.
    set%n = set%n + 1
    call make_room(set%member, set%n)
    call make_room(set%line, set%n)
    set%member(set%n) = tag
    set%line(set%n) = line
  end subroutine add_member

  !> Add an entry to a surface.
  subroutine add_entry(surface, set, number, face, line)
    type(inp_surface_t), intent(inout) :: surface  !! The surface.
    character(*), intent(in) :: set  !! Set in small letters, empty for a number.
    integer(int64), intent(in) :: number  !! Element or node, where it is a number.
    integer, intent(in) :: face  !! Face, 0 for the outer faces.
    integer(int64), intent(in) :: line  !! Its line.
    type(text_t), allocatable :: larger(:)
    integer, allocatable :: larger_face(:)
    integer :: n, i
    n = surface%n + 1
    call make_room(surface%number, n)
    call make_room(surface%line, n)
    if (n > size(surface%set)) then
      allocate (larger(2*n), larger_face(2*n))
      do i = 1, n - 1
        call move_alloc(surface%set(i)%s, larger(i)%s)
      end do
      larger_face(:n - 1) = surface%face(:n - 1)
      call move_alloc(larger, surface%set)
      call move_alloc(larger_face, surface%face)
    end if
    surface%n = n
    surface%set(n)%s = set
    surface%number(n) = number
    surface%face(n) = face
    surface%line(n) = line
  end subroutine add_entry

  !> Make room for items.
  subroutine make_room(list, n)
    integer(int64), allocatable, intent(inout) :: list(:)  !! List (room); it at least doubles when it grows.
    integer, intent(in) :: n  !! Number of items that it must hold.
    integer(int64), allocatable :: larger(:)
    if (.not. allocated(list)) allocate (list(max(n, 64)))
    if (n <= size(list)) return
    allocate (larger(max(n, 2*size(list))))
    larger(:size(list)) = list
    call move_alloc(larger, list)
  end subroutine make_room
end module dotyk_mesh_inp_part
