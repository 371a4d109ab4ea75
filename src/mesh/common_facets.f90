!> Facets that two surfaces of one body have in common.
module dotyk_mesh_common_facets
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: find_common_facets

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.

contains

  !> Facets of a surface that another surface of the same body has, too.
  subroutine find_common_facets(surface, other, is_common)
    type(surface_t), intent(in) :: surface  !! The surface.
    type(surface_t), intent(in) :: other  !! The other one.
    !> Whether the other one has each facet of the surface (n_facets).
    logical, allocatable, intent(out) :: is_common(:)
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
end module dotyk_mesh_common_facets
