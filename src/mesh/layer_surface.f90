!> Named surfaces of a body of which this rank may hold no element: from its surface layer and the surface elements of
!> the mesh file, which all ranks read. The counterpart of `dotyk_mesh_surface` for the whole mesh of a body.
module dotyk_mesh_layer_surface
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: quoted, text_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_boundary_part, only: find_entities
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension, max_facet_nodes
  use dotyk_mesh_element_faces, only: corners_of
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_physical_group, only: groups_like, names_text, unknown_group
  use dotyk_mesh_surface, only: choose_facets, find_parents, gather_facets, name_surfaces, node_numbers, &
    refuse_inner, surface_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use dotyk_mesh_tag_map, only: tag_map_t
  implicit none
  private
  public :: extract_layer_surface, layer_surface_names, layer_boundary, find_inner_facets

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.

contains

  !> Tags of the surface elements of a file that are faces of elements of a rank and not on the boundary of the body.
  subroutine find_inner_facets(mesh, body_mesh, boundary, tag)
    type(mesh_t), intent(in) :: mesh  !! Mesh from which the elements were extracted.
    type(body_mesh_t), intent(in) :: body_mesh  !! Elements that the rank owns, and their nodes.
    type(boundary_candidates_t), intent(in) :: boundary  !! Faces of these elements on the boundary of the body.
    integer(int64), allocatable, intent(out) :: tag(:)  !! The tags (any).
    type(corner_table_t) :: table
    type(surface_t) :: surface
    type(element_kind_t) :: kind
    integer(int64), allocatable :: first_tag(:)
    integer, allocatable :: number(:), entity(:), parents(:)
    integer :: i, b, e, m, entry, corner(max_corners)
    logical :: all_groups(size(mesh%group))
    if (allocated(body_mesh%mesh_node)) then
      call node_numbers(mesh, body_mesh, number)
    else
      call numbers_by_tag(mesh, body_mesh%node_tag, number)
    end if
    all_groups = .true.
    call gather_facets(mesh, body_mesh%dimension, number, all_groups, table, first_tag, entity)
    call find_parents(body_mesh, table, surface, parents)
    do i = 1, boundary%n
      kind = element_kind(body_mesh%block(boundary%block(i))%kind)
      m = corners_of(kind%face_kind(boundary%face(i)))
      entry = table%find(body_mesh%block(boundary%block(i))%node(kind%face_node(:m, boundary%face(i)), &
                                                                boundary%element(i)))
      if (entry > 0) parents(entry) = 0
    end do
    allocate (tag(0))
    if (.not. any(parents > 0)) return
    do b = 1, size(mesh%block)
      if (kind_dimension(mesh%block(b)%kind) /= body_mesh%dimension - 1) cycle
      kind = element_kind(mesh%block(b)%kind)
      do e = 1, size(mesh%block(b)%tag)
        corner(:kind%n_corners) = number(mesh%block(b)%node(:kind%n_corners, e))
        if (any(corner(:kind%n_corners) == 0)) cycle
        if (parents(table%find(corner(:kind%n_corners))) > 0) tag = [tag, mesh%block(b)%tag(e)]
      end do
    end do
  end subroutine find_inner_facets

  !> Number in a layer of each node of a mesh; 0 where the layer has no such node.
  subroutine layer_numbers(mesh, layer, number)
    type(mesh_t), intent(in) :: mesh  !! Mesh with the surface elements.
    type(surface_layer_t), intent(in) :: layer  !! Surface layer.
    integer, allocatable, intent(out) :: number(:)  !! The numbers (n_nodes of the mesh).
    integer, allocatable :: in_file(:)
    integer :: i
    in_file = pack([(i, i=1, size(layer%in_file))], layer%in_file)
    call numbers_by_tag(mesh, layer%mesh%node_tag(in_file), number)
    where (number > 0) number = in_file(max(1, number))
  end subroutine layer_numbers

  !> Number of each node of a mesh in a list of tags; 0 where the list does not have it.
  pure subroutine numbers_by_tag(mesh, tag, number)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    integer(int64), intent(in) :: tag(:)  !! Node tags, each once (n).
    integer, allocatable, intent(out) :: number(:)  !! The numbers (n_nodes of the mesh).
    type(tag_map_t) :: map
    integer :: i, repeated
    call map%init(tag, repeated)
    allocate (number(size(mesh%x, 2)))
    do i = 1, size(number)
      number(i) = map%find(mesh%node_tag(i))
    end do
  end subroutine numbers_by_tag

  !> Facets of a body that a name stands for, as `extract_surface` finds them.
  subroutine extract_layer_surface(mesh, layer, surface_name, surface, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh with the surface elements.
    type(surface_layer_t), intent(in) :: layer  !! Surface layer of the body.
    !> Name of the physical groups; with wildcards the union of those that it matches.
    character(*), intent(in) :: surface_name
    type(surface_t), intent(out) :: surface  !! Facets in the order of the file, in the numbers of the layer.
    !> Set for an unknown name, a group without facets on the body, and facets inside the body.
    type(error_t), allocatable, intent(out) :: error
    type(corner_table_t) :: table
    type(text_t), allocatable :: names(:)
    integer(int64), allocatable :: tag(:)
    integer, allocatable :: number(:), entity(:), parents(:)
    character(:), allocatable :: message
    logical :: wanted(size(mesh%group))
    wanted = groups_like(mesh, trim(surface_name), layer%mesh%dimension - 1)
    if (any(wanted)) then
      call check_inner(mesh, layer, wanted, surface_name, error)
      if (allocated(error)) return
      call layer_numbers(mesh, layer, number)
      call gather_facets(mesh, layer%mesh%dimension, number, wanted, table, tag, entity)
      call take_parents(layer%boundary, table, surface, parents)
      call choose_facets(mesh, surface_name, layer%mesh%dimension, tag, entity, parents, surface, error)
      if (surface%n_facets > 0 .or. allocated(error)) return
      message = 'mesh '//quoted(mesh%file)//': '//quoted(surface_name)//' has no facet on this body'
    else
      message = unknown_group(mesh, trim(surface_name), layer%mesh%dimension - 1)
    end if
    call layer_surface_names(mesh, layer, names)
    call set_error(error, message//'; on this body: '//names_text(names))
  end subroutine extract_layer_surface

  !> Refuse surfaces inside the body.
  subroutine check_inner(mesh, layer, wanted, surface_name, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh with the surface elements.
    type(surface_layer_t), intent(in) :: layer  !! Surface layer of the body.
    logical, intent(in) :: wanted(:)  !! Physical groups of the surface (n_groups).
    character(*), intent(in) :: surface_name  !! Name of the surface.
    type(error_t), allocatable, intent(out) :: error  !! Set if an element of the groups is inside the body.
    type(tag_map_t) :: inner
    integer(int64) :: first
    integer :: b, e, n, repeated
    if (size(layer%inner_tag) == 0) return
    call inner%init(layer%inner_tag, repeated)
    n = 0
    first = 0
    do b = 1, size(mesh%block)
      if (.not. any(wanted(mesh%block(b)%group))) cycle
      do e = 1, size(mesh%block(b)%tag)
        if (inner%find(mesh%block(b)%tag(e)) == 0) cycle
        if (n == 0) first = mesh%block(b)%tag(e)
        n = n + 1
      end do
    end do
    if (n > 0) call refuse_inner(mesh, surface_name, n, first, error)
  end subroutine check_inner

  !> Facets of a boundary that coincide with those of a table.
  subroutine take_parents(boundary, table, surface, parents)
    type(surface_t), intent(in) :: boundary  !! Boundary of the body.
    type(corner_table_t), intent(in) :: table  !! Facets by their corners.
    !> Surface; it gets one facet for each entry of the table, 0 for those that are not on the boundary.
    type(surface_t), intent(inout) :: surface
    integer, allocatable, intent(out) :: parents(:)  !! 1 for the facets on the boundary, otherwise 0 (n_facets).
    type(element_kind_t) :: kind
    integer :: f, n, entry
    n = table%n
    allocate (surface%kind(n), surface%block(n), surface%element(n), parents(n), source=0)
    allocate (surface%node(max_facet_nodes, n), source=0)
    surface%order_elevated = boundary%order_elevated
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      entry = table%find(boundary%node(:kind%n_corners, f))
      if (entry == 0) cycle
      parents(entry) = 1
      surface%kind(entry) = boundary%kind(f)
      surface%node(:, entry) = boundary%node(:, f)
      surface%block(entry) = boundary%block(f)
      surface%element(entry) = boundary%element(f)
    end do
  end subroutine take_parents

  !> Names of the physical groups that have a facet on a body.
  subroutine layer_surface_names(mesh, layer, names)
    type(mesh_t), intent(in) :: mesh  !! Mesh with the surface elements.
    type(surface_layer_t), intent(in) :: layer  !! Surface layer of the body.
    type(text_t), allocatable, intent(out) :: names(:)  !! Names (n_names).
    integer, allocatable :: number(:)
    call layer_numbers(mesh, layer, number)
    call name_surfaces(mesh, layer%mesh%dimension, number > 0, names)
  end subroutine layer_surface_names

  !> The whole boundary of a body with the geometric entities of its facets.
  subroutine layer_boundary(mesh, layer, boundary)
    type(mesh_t), intent(in) :: mesh  !! Mesh with the surface elements.
    type(surface_layer_t), intent(in) :: layer  !! Surface layer of the body.
    type(surface_t), intent(out) :: boundary  !! The boundary, in the numbers of the layer.
    integer, allocatable :: number(:)
    call layer_numbers(mesh, layer, number)
    boundary = layer%boundary
    call find_entities(mesh, number, boundary)
  end subroutine layer_boundary
end module dotyk_mesh_layer_surface
