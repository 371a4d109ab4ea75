!> Parts of the boundary of a body: the numbers of the facets of a surface in it, some of its facets as a surface, and
!> facets that two surfaces have in common.
module dotyk_mesh_boundary_part
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: facets_in_boundary, boundary_part, find_entities, find_common_facets

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.

contains

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
end module dotyk_mesh_boundary_part
