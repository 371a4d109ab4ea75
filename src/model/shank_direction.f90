!> The direction of the shank of a bolt where it is cut: along the faces around the cut.
module dotyk_model_shank_direction
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_recovery_patch, only: diagonalize
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: area_vector
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: angle_to_shank

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.
  !> A body is a shank where the mean squared cosine between the normals around the cut and its direction is less than
  !> this fraction of that of any other direction: a cone of 17 degrees still is, the foot of a head is not [].
  real(dp), parameter :: clearly = 0.2_dp

contains

  !> Angle between the normal of a cut and the shank, 0 where the body is no shank there [degrees].
  !>
  !> The normals n of the faces beside the cut are perpendicular to a shank: its direction is the eigenvector of the
  !> smallest eigenvalue of the sum of A n n^T over these faces of areas A.
  real(dp) function angle_to_shank(mesh, cut, normal) result(angle)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of one half.
    type(surface_t), intent(in) :: cut  !! Its faces at the cut.
    real(dp), intent(in) :: normal(3)  !! Unit normal of the cut (3) [].
    type(surface_t) :: boundary
    type(corner_table_t) :: faces
    type(element_kind_t) :: kind
    logical, allocatable :: at_cut(:)
    real(dp) :: total(mesh%dimension, mesh%dimension), vectors(mesh%dimension, mesh%dimension), n(mesh%dimension)
    real(dp) :: spread_of(mesh%dimension)
    integer :: d, f, i, entry, least
    d = mesh%dimension
    angle = 0
    allocate (at_cut(mesh%n_nodes()), source=.false.)
    call faces%init(max_corners, cut%n_facets)
    do f = 1, cut%n_facets
      kind = element_kind(cut%kind(f))
      call faces%add(cut%node(:kind%n_corners, f), entry)
      at_cut(cut%node(:kind%n_corners, f)) = .true.
    end do
    call extract_boundary(mesh, boundary)
    total = 0
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      associate (corner => boundary%node(:kind%n_corners, f))
        if (.not. any(at_cut(corner))) cycle
        if (faces%find(corner) > 0) cycle
        n = area_vector(mesh%x(:, corner))
      end associate
      if (norm2(n) > 0) total = total + spread(n, 2, d)*spread(n, 1, d)/norm2(n)
    end do
    call diagonalize(d, total, vectors)
    spread_of = [(total(i, i), i=1, d)]
    least = minloc(spread_of, dim=1)
    if (.not. spread_of(least) < clearly*minval(spread_of, mask=[(i /= least, i=1, d)])) return
    angle = acos(min(1.0_dp, abs(dot_product(vectors(:, least), normal(:d)))))*180/acos(-1.0_dp)
  end function angle_to_shank
end module dotyk_model_shank_direction
