!> Faces of the elements of an Abaqus or CalculiX deck: those that its surfaces name, and the outer faces all of whose
!> nodes are in a node set.
module dotyk_mesh_inp_faces
  use dotyk_base_text, only: quoted, to_text
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds
  use dotyk_mesh_inp_element_type, only: face_of_label
  use dotyk_mesh_inp_numbering, only: inp_numbering_t
  use dotyk_mesh_inp_part, only: find_set, inp_part_t, inp_surface_t
  use dotyk_mesh_inp_state, only: inp_state_t
  implicit none
  private

  type, public :: inp_face_list_t  !! List of faces.
    integer :: n = 0  !! Number of faces.
    integer, allocatable :: element(:), face(:)  !! Element of each face, and its number there (room).
  contains
    procedure :: add => list_add
  end type inp_face_list_t

  type, public :: inp_outer_faces_t  !! Faces that belong to one element only, by their first nodes.
    type(inp_face_list_t) :: list  !! The faces.
    !> Start of the faces of each node in `order`: faces are with the least of their nodes (n_nodes + 1).
    integer, allocatable :: start(:)
    integer, allocatable :: order(:)  !! Faces by their nodes (list%n).
    logical, allocatable :: on_face(:)  !! Whether a node is on one of them (n_nodes).
  contains
    procedure :: find => outer_find
    procedure :: of_nodes => outer_of_nodes
  end type inp_outer_faces_t

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a face.

  public :: faces_of_surface, face_nodes

contains

  !> Add a face.
  subroutine list_add(self, element, face)
    class(inp_face_list_t), intent(inout) :: self
    integer, intent(in) :: element  !! Element.
    integer, intent(in) :: face  !! Number of the face in the kind of the element.
    if (.not. allocated(self%element)) allocate (self%element(64), self%face(64))
    if (self%n == size(self%element)) then
      self%element = [self%element, self%element]
      self%face = [self%face, self%face]
    end if
    self%n = self%n + 1
    self%element(self%n) = element
    self%face(self%n) = face
  end subroutine list_add

  !> Nodes of a face.
  subroutine face_nodes(part, numbering, element, face, kind, node)
    type(inp_part_t), intent(in) :: part  !! The model.
    type(inp_numbering_t), intent(in) :: numbering  !! Its numbering.
    integer, intent(in) :: element  !! Element.
    integer, intent(in) :: face  !! Number of the face.
    integer, intent(out) :: kind  !! Kind of the face.
    !> Its nodes in the order of the kind; the first ones are set (at least n_nodes of the kind).
    integer, intent(inout) :: node(:)
    type(element_kind_t) :: of_element
    integer :: n
    of_element = element_kind(part%kind(element))
    kind = of_element%face_kind(face)
    n = kind_nodes(kind)
    node(:n) = numbering%node(part%first(element) - 1 + of_element%face_node(:n, face))
  end subroutine face_nodes

  !> Find the faces of all elements of the dimension of space that belong to one element only.
  subroutine outer_find(self, part, numbering, dimension)
    class(inp_outer_faces_t), intent(inout) :: self
    type(inp_part_t), intent(in) :: part  !! The model.
    type(inp_numbering_t), intent(in) :: numbering  !! Its numbering.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(corner_table_t) :: table
    type(element_kind_t) :: kind(n_element_kinds), face
    integer, allocatable :: times(:), element(:), number(:)
    integer :: e, f, k, n, entry, node(9), corners(n_element_kinds)
    do k = 1, n_element_kinds
      kind(k) = element_kind(k)
      face = kind(k)
      corners(k) = face%n_corners
    end do
    n = 0
    do e = 1, part%n_elements
      if (numbering%dimension(e) == dimension) n = n + kind(part%kind(e))%n_faces
    end do
    call table%init(max_corners, n)
    allocate (times(n), element(n), number(n), source=0)
    do e = 1, part%n_elements
      if (numbering%dimension(e) /= dimension) cycle
      associate (own => kind(part%kind(e)))
        do f = 1, own%n_faces
          k = corners(own%face_kind(f))
          call table%add(numbering%node(part%first(e) - 1 + own%face_node(:k, f)), entry)
          times(entry) = times(entry) + 1
          element(entry) = e
          number(entry) = f
        end do
      end associate
    end do
    allocate (self%start(part%n_nodes + 1), source=0)
    allocate (self%on_face(part%n_nodes), source=.false.)
    do entry = 1, table%n
      if (times(entry) /= 1) cycle
      call self%list%add(element(entry), number(entry))
      call face_nodes(part, numbering, element(entry), number(entry), k, node)
      self%on_face(node(:kind_nodes(k))) = .true.
      n = minval(node(:kind_nodes(k)))
      self%start(n + 1) = self%start(n + 1) + 1
    end do
    self%start(1) = 1
    do k = 1, part%n_nodes
      self%start(k + 1) = self%start(k + 1) + self%start(k)
    end do
    allocate (self%order(self%list%n))
    do entry = 1, self%list%n
      call face_nodes(part, numbering, self%list%element(entry), self%list%face(entry), k, node)
      n = minval(node(:kind_nodes(k)))
      self%order(self%start(n)) = entry
      self%start(n) = self%start(n) + 1
    end do
    self%start = eoshift(self%start, -1, 1)
  end subroutine outer_find

  !> The outer faces all of whose nodes are in a set.
  subroutine outer_of_nodes(self, part, numbering, node, is_member, faces, n_left)
    class(inp_outer_faces_t), intent(in) :: self
    type(inp_part_t), intent(in) :: part  !! The model.
    type(inp_numbering_t), intent(in) :: numbering  !! Its numbering.
    integer, intent(in) :: node(:)  !! The nodes of the set (n).
    logical, intent(inout) :: is_member(:)  !! Room; all false before and afterwards (n_nodes).
    type(inp_face_list_t), intent(inout) :: faces  !! The faces; these are added.
    integer, intent(out) :: n_left  !! Number of nodes of the set on outer faces, but on none of these.
    integer :: i, k, entry, kind, own(9), n, first
    is_member(node) = .true.
    first = faces%n
    do i = 1, size(node)
      if (.not. is_member(node(i))) cycle
      do k = self%start(node(i)), self%start(node(i) + 1) - 1
        entry = self%order(k)
        call face_nodes(part, numbering, self%list%element(entry), self%list%face(entry), kind, own)
        if (all(is_member(own(:kind_nodes(kind))))) &
          call faces%add(self%list%element(entry), self%list%face(entry))
      end do
    end do
    do i = first + 1, faces%n
      call face_nodes(part, numbering, faces%element(i), faces%face(i), kind, own)
      is_member(own(:kind_nodes(kind))) = .false.
    end do
    n = 0
    do i = 1, size(node)
      if (is_member(node(i)) .and. self%on_face(node(i))) n = n + 1
      is_member(node(i)) = .false.
    end do
    n_left = n
  end subroutine outer_of_nodes

  !> Faces of a surface.
  subroutine faces_of_surface(state, numbering, surface, outer, is_member, faces)
    type(inp_state_t), intent(inout) :: state  !! What was read; mistakes are kept there.
    type(inp_numbering_t), intent(in) :: numbering  !! Numbering of the model.
    type(inp_surface_t), intent(in) :: surface  !! The surface.
    type(inp_outer_faces_t), intent(in) :: outer  !! Outer faces.
    logical, intent(inout) :: is_member(:)  !! Room; all false before and afterwards (n_nodes).
    type(inp_face_list_t), intent(inout) :: faces  !! The faces.
    integer, allocatable :: member(:), node(:)
    integer :: i, k, set, face, ignored
    allocate (node(0))
    do i = 1, surface%n
      state%line = surface%line(i)
      call find_members(i)
      if (allocated(state%fault)) return
      if (surface%of_nodes) then
        node = [node, member]
      else if (surface%face(i) == 0) then
        call add_outer_faces()
      else
        do k = 1, size(member)
          face = face_of_label(state%slot(1)%part%kind(member(k)), surface%face(i))
          if (face == 0) then
            call state%fail('element '//to_text(state%slot(1)%part%element_tag(member(k)))//' has no face S'// &
                            to_text(surface%face(i)))
            return
          end if
          call faces%add(member(k), face)
        end do
      end if
    end do
    if (surface%of_nodes) &
      call outer%of_nodes(state%slot(1)%part, numbering, node, is_member, faces, ignored)

  contains

    !> Elements or nodes of an entry.
    subroutine find_members(entry)
      integer, intent(in) :: entry  !! The entry.
      associate (part => state%slot(1)%part, name => surface%set(entry)%s)
        if (len(name) == 0) then
          if (surface%of_nodes) then
            member = [numbering%node_of_tag%find(surface%number(entry))]
          else
            member = [numbering%element_of_tag%find(surface%number(entry))]
          end if
          if (member(1) == 0) call state%fail('surface '//quoted(surface%name)//': there is no '// &
                                             trim(merge('node   ', 'element', surface%of_nodes))//' '// &
                                             to_text(surface%number(entry)))
          return
        end if
        if (surface%of_nodes) then
          set = find_set(part%node_set, part%n_node_sets, name)
          if (set > 0) call numbering%members(state, part%node_set(set), .true., member)
        else
          set = find_set(part%element_set, part%n_element_sets, name)
          if (set > 0) call numbering%members(state, part%element_set(set), .false., member)
        end if
        if (set == 0) call state%fail('surface '//quoted(surface%name)//': there is no '// &
                                      trim(merge('node   ', 'element', surface%of_nodes))//' set '//quoted(name))
      end associate
    end subroutine find_members

    !> Add the outer faces of the elements of an entry.
    subroutine add_outer_faces()
      logical :: wanted(size(numbering%dimension))
      wanted = .false.
      wanted(member) = .true.
      do k = 1, outer%list%n
        if (wanted(outer%list%element(k))) call faces%add(outer%list%element(k), outer%list%face(k))
      end do
    end subroutine add_outer_faces
  end subroutine faces_of_surface
end module dotyk_mesh_inp_faces
