!> Surfaces of a body: the boundary faces of its elements that a physical group names.
!>
!> Bodies may share a group name, which then stands for the faces of each body. Facets take their nodes from the face
!> table of the parent element, so that their normals point out of the body whatever the orientation in the file.
!>
!> Parts of the boundary of a body: the numbers of the facets of a surface in it, some of its facets as a surface, and
!> facets that two surfaces have in common.
module dotyk_mesh_surface
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: int64
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension, max_facet_nodes
  use dotyk_mesh_mesh, only: group_names, groups_like, groups_named, mesh_t, names_text, unknown_group
  implicit none
  private
  public :: extract_surface, surface_nodes, surface_names, gather_facets, node_numbers, refuse_inner, &
    facets_in_boundary, boundary_part, find_entities, find_common_facets

  !> Facets of one body. Facets of lower dimension, lines in space and nodes, make an edge or a set of nodes
  !> (`dotyk_mesh_edges_and_nodes`): they have neither parents nor normals, and loads and supports alone act on them.
  type, public :: surface_t
    character(:), allocatable :: name  !! Name of the physical group, or a name with wildcards.
    integer :: dimension = 0  !! Dimension of space.
    integer :: n_facets = 0  !! Number of facets.
    integer, allocatable :: kind(:)  !! Element kind of each facet (n_facets).
    !> Nodes of each facet, body-local numbers, padded with 0, oriented outward (max_facet_nodes, n_facets).
    integer, allocatable :: node(:, :)
    integer, allocatable :: block(:)  !! Block of the body mesh with the parent element of each facet (n_facets).
    integer, allocatable :: element(:)  !! Parent element in its block, 0: none, on bodies without volume (n_facets).
    integer(int64), allocatable :: tag(:)  !! Element tag of each facet in the file (n_facets).
    integer, allocatable :: entity(:)  !! Geometric entity (face of the CAD model), 0 if unknown (n_facets).
    !> Smooth sheet of each facet at each of its corners, from 1: at a sharp edge the facets on its two sides belong to
    !> different sheets; padded with 0 (4, n_facets). Not allocated where nobody needs it: then there is one sheet.
    integer, allocatable :: sheet(:, :)
    !> The facets were linear in the file: mid-side nodes lie on straight edges and carry no information about the
    !> shape.
    logical :: order_elevated = .false.
  contains
    procedure :: is_concentrated => surface_is_concentrated
    procedure :: carry => surface_carry
  end type surface_t


  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.

contains

  !> Facets of a body that a name stands for.
  subroutine extract_surface(mesh, body_mesh, surface_name, surface, error, has_facets)
    type(mesh_t), intent(in) :: mesh  !! Mesh from which the body was extracted.
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    character(*), intent(in) :: surface_name  !! Name of the physical groups; with wildcards the union.
    type(surface_t), intent(out) :: surface  !! Facets in the order of the file.
    !> Set for an unknown name, a group without facets on the body, and facets inside the body.
    type(error_t), allocatable, intent(out) :: error
    logical, intent(out), optional :: has_facets  !! Whether facets of the body have the name, be they inside it.
    logical :: wanted(size(mesh%group))
    type(corner_table_t) :: table
    type(text_t), allocatable :: names(:)
    integer(int64), allocatable :: tag(:)
    integer, allocatable :: number(:), entity(:), parents(:)
    character(:), allocatable :: message
    integer :: inner
    wanted = groups_like(mesh, trim(surface_name), body_mesh%dimension - 1)
    message = ''
    if (present(has_facets)) has_facets = .false.
    if (any(wanted)) then
      call node_numbers(mesh, body_mesh, number)
      call gather_facets(mesh, body_mesh%dimension, number, wanted, table, tag, entity)
      surface%order_elevated = body_mesh%order_elevated
      if (allocated(body_mesh%face)) then
        call find_faces(body_mesh, table, surface, parents)
      else
        call find_parents(body_mesh, table, surface, parents)
      end if
      if (present(has_facets)) has_facets = any(parents > 0)
      surface%name = trim(surface_name)
      surface%dimension = body_mesh%dimension
      inner = findloc(parents > 1, .true., dim=1)
      if (inner > 0) then
        call refuse_inner(mesh, surface_name, count(parents > 1), tag(inner), error)
      else
        call keep_facets(surface, tag, entity, parents == 1)
      end if
      if (surface%n_facets > 0 .or. allocated(error)) return
      message = 'mesh '//quoted(mesh%file)//': '//quoted(surface_name)//' has no facet on this body'
    else
      message = unknown_group(mesh, trim(surface_name), body_mesh%dimension - 1)
    end if
    call surface_names(mesh, body_mesh, names)
    call set_error(error, message//'; on this body: '//names_text(names))
  end subroutine extract_surface

  !> Refuse a surface inside the body.
  subroutine refuse_inner(mesh, surface_name, n_inner, first_tag, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    character(*), intent(in) :: surface_name  !! Name of the physical groups, maybe with wildcards.
    integer, intent(in) :: n_inner  !! Number of its facets inside the body.
    integer(int64), intent(in) :: first_tag  !! Element tag of the first of them.
    type(error_t), allocatable, intent(out) :: error  !! The error.
    call set_error(error, 'mesh '//quoted(mesh%file)//': '//quoted(surface_name)//' lies inside the body, '// &
                   'not on its surface, with '//to_text(n_inner)//' of its facets (the first is '// &
                   'element '//to_text(first_tag)//')')
  end subroutine refuse_inner

  !> Number in the body of each node of a mesh; 0 where the body has no such node.
  pure subroutine node_numbers(mesh, body_mesh, number)
    type(mesh_t), intent(in) :: mesh  !! Mesh from which the body was extracted.
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    integer, allocatable, intent(out) :: number(:)  !! The numbers (n_nodes of the mesh).
    integer :: i
    allocate (number(size(mesh%x, 2)), source=0)
    number(body_mesh%mesh_node) = [(i, i=1, size(body_mesh%mesh_node))]
  end subroutine node_numbers

  !> Collect the facets of some groups whose corners are all nodes of the body, each once.
  subroutine gather_facets(mesh, dimension, number, wanted, table, tag, entity)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    integer, intent(in) :: dimension  !! Dimension of space.
    integer, intent(in) :: number(:)  !! Number of each node in the body, 0 where none (n_nodes of the mesh).
    logical, intent(in) :: wanted(:)  !! Groups to collect (n_groups).
    type(corner_table_t), intent(out) :: table  !! Facets by their corners, body-local numbers.
    integer(int64), allocatable, intent(out) :: tag(:)  !! Element tags of the facets (table%n).
    integer, allocatable, intent(out) :: entity(:)  !! Their geometric entities (table%n).
    type(element_kind_t) :: kind
    integer :: b, e, n, entry, corner(max_corners)
    n = 0
    do b = 1, size(mesh%block)
      if (any(wanted(mesh%block(b)%group))) n = n + size(mesh%block(b)%tag)
    end do
    call table%init(max_corners, n)
    allocate (tag(n), entity(n))
    do b = 1, size(mesh%block)
      if (.not. any(wanted(mesh%block(b)%group))) cycle
      if (kind_dimension(mesh%block(b)%kind) /= dimension - 1) cycle
      kind = element_kind(mesh%block(b)%kind)
      n = kind%n_corners
      do e = 1, size(mesh%block(b)%tag)
        corner(:n) = number(mesh%block(b)%node(:n, e))
        if (any(corner(:n) == 0)) cycle
        call table%add(corner(:n), entry)
        tag(entry) = mesh%block(b)%tag(e)
        entity(entry) = 0
        if (allocated(mesh%block(b)%entity)) entity(entry) = mesh%block(b)%entity(e)
      end do
    end do
    tag = tag(:table%n)
    entity = entity(:table%n)
  end subroutine gather_facets

  !> Find the element faces that coincide with the facets of a table, and count the parents of each facet.
  subroutine find_parents(body_mesh, table, surface, parents)
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    type(corner_table_t), intent(in) :: table  !! Facets by their corners.
    type(surface_t), intent(inout) :: surface  !! Surface; gets a facet for each entry of the table, without parents.
    integer, allocatable, intent(out) :: parents(:)  !! Number of parent elements of each facet (n_facets).
    logical, allocatable :: touched(:)
    type(element_kind_t) :: kind
    integer :: b, e, f, i, n, facet, n_face_nodes, corners(6), nodes(max_facet_nodes)
    type(element_kind_t) :: face(6)
    n = table%n
    allocate (surface%kind(n), surface%node(max_facet_nodes, n), surface%block(n), surface%element(n), parents(n))
    surface%kind = 0
    surface%node = 0
    surface%block = 0
    surface%element = 0
    parents = 0
    allocate (touched(0:body_mesh%n_nodes()))
    touched = .false.
    do i = 1, n
      touched(table%key(:, i)) = .true.
    end do
    do b = 1, size(body_mesh%block)
      kind = element_kind(body_mesh%block(b)%kind)
      do f = 1, kind%n_faces
        face(f) = element_kind(kind%face_kind(f))
        corners(f) = face(f)%n_corners
      end do
      do e = 1, size(body_mesh%block(b)%tag)
        if (count(touched(body_mesh%block(b)%node(:kind%n_corners, e))) < body_mesh%dimension) cycle
        do f = 1, kind%n_faces
          n_face_nodes = face(f)%n_nodes
          nodes(:n_face_nodes) = body_mesh%block(b)%node(kind%face_node(:n_face_nodes, f), e)
          if (.not. all(touched(nodes(:corners(f))))) cycle
          facet = table%find(nodes(:corners(f)))
          if (facet == 0) cycle
          parents(facet) = parents(facet) + 1
          surface%kind(facet) = kind%face_kind(f)
          surface%node(:n_face_nodes, facet) = nodes(:n_face_nodes)
          surface%block(facet) = b
          surface%element(facet) = e
        end do
      end do
    end do
  end subroutine find_parents

  !> Find the facets of a table among the faces of a body without volume.
  subroutine find_faces(body_mesh, table, surface, times)
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    type(corner_table_t), intent(in) :: table  !! Facets by their corners.
    type(surface_t), intent(inout) :: surface  !! Surface; gets a facet for each entry of the table, without parents.
    integer, allocatable, intent(out) :: times(:)  !! 1 for the facets that are faces, 0 for others (n_facets).
    type(element_kind_t) :: kind
    integer :: b, e, facet
    allocate (surface%kind(table%n), surface%node(max_facet_nodes, table%n), surface%block(table%n), &
              surface%element(table%n), times(table%n), source=0)
    do b = 1, size(body_mesh%face)
      kind = element_kind(body_mesh%face(b)%kind)
      do e = 1, size(body_mesh%face(b)%tag)
        facet = table%find(body_mesh%face(b)%node(:kind%n_corners, e))
        if (facet == 0) cycle
        times(facet) = 1
        surface%kind(facet) = body_mesh%face(b)%kind
        surface%node(:kind%n_nodes, facet) = body_mesh%face(b)%node(:, e)
      end do
    end do
  end subroutine find_faces

  !> Keep some facets.
  subroutine keep_facets(surface, tag, entity, kept)
    type(surface_t), intent(inout) :: surface  !! Surface.
    integer(int64), intent(in) :: tag(:)  !! Element tags of all facets (number of facets before).
    integer, intent(in) :: entity(:)  !! Geometric entities of all facets (number of facets before).
    logical, intent(in) :: kept(:)  !! Facets to keep (number of facets before).
    integer, allocatable :: chosen(:)
    integer :: i
    chosen = pack([(i, i=1, size(kept))], kept)
    surface%n_facets = size(chosen)
    surface%kind = surface%kind(chosen)
    surface%node = surface%node(:, chosen)
    surface%block = surface%block(chosen)
    surface%element = surface%element(chosen)
    surface%tag = tag(chosen)
    surface%entity = entity(chosen)
  end subroutine keep_facets

  !> Nodes of the body on a surface, ascending, each once.
  pure subroutine surface_nodes(surface, nodes)
    type(surface_t), intent(in) :: surface  !! Surface.
    integer, allocatable, intent(out) :: nodes(:)  !! Body-local node numbers (n).
    logical, allocatable :: on_surface(:)
    integer :: i
    allocate (on_surface(0:maxval(surface%node)))
    on_surface = .false.
    do i = 1, surface%n_facets
      on_surface(surface%node(:, i)) = .true.
    end do
    nodes = pack([(i, i=1, ubound(on_surface, 1))], on_surface(1:))
  end subroutine surface_nodes

  !> Names of the physical groups that have a facet on a body.
  subroutine surface_names(mesh, body_mesh, names)
    type(mesh_t), intent(in) :: mesh  !! Mesh from which the body was extracted.
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    type(text_t), allocatable, intent(out) :: names(:)  !! Names (n_names).
    type(text_t), allocatable :: all_names(:)
    integer, allocatable :: number(:)
    logical, allocatable :: found(:)
    integer :: i, n
    call node_numbers(mesh, body_mesh, number)
    call group_names(mesh, body_mesh%dimension - 1, all_names)
    allocate (found(size(all_names)))
    do i = 1, size(all_names)
      found(i) = touches(mesh, groups_named(mesh, all_names(i)%s, body_mesh%dimension - 1), number > 0)
    end do
    allocate (names(count(found)))
    n = 0
    do i = 1, size(all_names)
      if (.not. found(i)) cycle
      n = n + 1
      names(n)%s = all_names(i)%s
    end do
  end subroutine surface_names

  !> Whether some element of some groups has all its nodes in the body.
  pure logical function touches(mesh, wanted, in_body)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    logical, intent(in) :: wanted(:)  !! Groups (n_groups).
    logical, intent(in) :: in_body(:)  !! Nodes of the body (n_nodes of the mesh).
    integer :: b, e
    touches = .false.
    do b = 1, size(mesh%block)
      if (.not. any(wanted(mesh%block(b)%group))) cycle
      do e = 1, size(mesh%block(b)%tag)
        touches = all(in_body(mesh%block(b)%node(:, e)))
        if (touches) return
      end do
    end do
  end function touches

  !> Whether it is an edge in space, or a set of nodes: what acts on it has no area.
  pure logical function surface_is_concentrated(self) result(is_concentrated)
    class(surface_t), intent(in) :: self
    is_concentrated = any(kind_dimension(self%kind(:self%n_facets)) < self%dimension - 1)
  end function surface_is_concentrated

  !> Put a surface into a parcel, or take it out.
  subroutine surface_carry(self, parcel)
    class(surface_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%name)
    call parcel%carry(self%dimension)
    call parcel%carry(self%n_facets)
    call parcel%carry(self%kind)
    call parcel%carry(self%node)
    call parcel%carry(self%block)
    call parcel%carry(self%element)
    call parcel%carry(self%tag)
    call parcel%carry(self%entity)
    call parcel%carry(self%sheet)
    call parcel%carry(self%order_elevated)
  end subroutine surface_carry

  !> Number of each facet of a surface in the boundary of its body.
  subroutine facets_in_boundary(boundary, surface, number)
    type(surface_t), intent(in) :: boundary  !! Boundary of the body.
    type(surface_t), intent(in) :: surface  !! A surface of the body.
    integer, allocatable, intent(out) :: number(:)  !! Numbers of its facets in the boundary (surface%n_facets).
    type(corner_table_t) :: table
    type(element_kind_t) :: kind
    integer :: f, entry
    call table%init(max_corners, boundary%n_facets)
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      call table%add(boundary%node(:kind%n_corners, f), entry)
    end do
    allocate (number(surface%n_facets))
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      number(f) = table%find(surface%node(:kind%n_corners, f))
    end do
  end subroutine facets_in_boundary

  !> Geometric entities of the facets of a boundary, as far as the mesh has these facets as elements.
  subroutine find_entities(mesh, number, boundary)
    type(mesh_t), intent(in) :: mesh  !! Mesh from which the body was extracted.
    integer, intent(in) :: number(:)  !! Number of each node in the body, 0 where none (n_nodes of the mesh).
    type(surface_t), intent(inout) :: boundary  !! Boundary of the body; its entities are set.
    type(corner_table_t) :: table
    type(element_kind_t) :: kind
    integer :: b, e, f, n, entry, corner(max_corners)
    allocate (boundary%entity(boundary%n_facets), source=0)
    call table%init(max_corners, boundary%n_facets)
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      call table%add(boundary%node(:kind%n_corners, f), entry)
    end do
    do b = 1, size(mesh%block)
      if (kind_dimension(mesh%block(b)%kind) /= boundary%dimension - 1) cycle
      if (.not. allocated(mesh%block(b)%entity)) cycle
      kind = element_kind(mesh%block(b)%kind)
      n = kind%n_corners
      do e = 1, size(mesh%block(b)%tag)
        corner(:n) = number(mesh%block(b)%node(:n, e))
        if (any(corner(:n) == 0)) cycle
        f = table%find(corner(:n))
        if (f > 0) boundary%entity(f) = mesh%block(b)%entity(e)
      end do
    end do
  end subroutine find_entities

  !> Some facets of a boundary as a surface.
  subroutine boundary_part(boundary, facet, part)
    type(surface_t), intent(in) :: boundary  !! Boundary of a body.
    integer, intent(in) :: facet(:)  !! Facets of the part (n).
    type(surface_t), intent(out) :: part  !! The part.
    part%name = 'boundary'
    part%dimension = boundary%dimension
    part%order_elevated = boundary%order_elevated
    part%n_facets = size(facet)
    part%kind = boundary%kind(facet)
    part%node = boundary%node(:, facet)
    part%block = boundary%block(facet)
    part%element = boundary%element(facet)
    if (allocated(boundary%tag)) part%tag = boundary%tag(facet)
    if (allocated(boundary%entity)) part%entity = boundary%entity(facet)
  end subroutine boundary_part

  !> Facets of a surface that another surface of the same body has, too.
  subroutine find_common_facets(surface, other, is_common)
    type(surface_t), intent(in) :: surface  !! The surface.
    type(surface_t), intent(in) :: other  !! The other one.
    logical, allocatable, intent(out) :: is_common(:)  !! Whether the other has each facet (n_facets).
    type(corner_table_t) :: table
    type(element_kind_t) :: kind
    integer :: f, entry
    call table%init(max_corners, other%n_facets)
    do f = 1, other%n_facets
      kind = element_kind(other%kind(f))
      call table%add(other%node(:kind%n_corners, f), entry)
    end do
    allocate (is_common(surface%n_facets))
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      is_common(f) = table%find(surface%node(:kind%n_corners, f)) > 0
    end do
  end subroutine find_common_facets
end module dotyk_mesh_surface
