!> Thickness of a body behind the facets of a contact surface that has both of its sides.
!>
!> Where one contact surface holds both sides of a thin body, each side faces the other bodies on the far side as well,
!> through the body. A point can lie behind a facet by no more than the body is thick there: what lies deeper is no
!> overlap but the wrong side.
module dotyk_contact_local_depth
  use dotyk_base_kinds, only: dp
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t, facing_cosine
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_tree_search, only: facets_in_region, oriented_box_t
  use dotyk_mesh_facet, only: frame_of_normal
  implicit none
  private
  public :: find_depths

  !> Half width of the beam behind a facet in which opposite facets are searched, relative to the size of the facet.
  real(dp), parameter :: beam = 1.0e-3_dp
  !> The beam begins at this distance behind the facet, relative to its size.
  real(dp), parameter :: start = 1.0e-6_dp
  !> The beam meets a facet where it comes closer to it than this, relative to the size of that facet.
  real(dp), parameter :: hit_tolerance = 0.05_dp
  !> Steps to the intersection of the beam with a curved facet.
  integer, parameter :: n_steps = 4

contains

  !> Set the depths of the facets of a surface.
  subroutine find_depths(tree, neighbour, limit, set)
    !> Bounding-volume tree of the surface.
    type(bounding_volume_tree_t), intent(in) :: tree
    !> Facet across each edge, 0 at the boundary of the surface (4, n_facets).
    integer, intent(in) :: neighbour(:, :)
    !> Greatest depth of interest [length].
    real(dp), intent(in) :: limit
    !> Facets of the surface; `depth` is set, to a huge number where no facet of the surface lies behind.
    type(facet_set_t), intent(inout) :: set
    real(dp), allocatable :: depth(:)
    integer :: f, k
    allocate (depth(set%n))
    !$omp parallel do default(none) schedule(dynamic, 64) shared(tree, limit, set, depth)
    do f = 1, set%n
      depth(f) = depth_behind(tree, set, f, limit)
    end do
    !$omp end parallel do
    set%depth = depth
    ! The beam may miss the other side at the end of a body: neighbours know the thickness there.
    do f = 1, set%n
      if (depth(f) < huge(depth)) cycle
      do k = 1, set%corners(f)
        if (neighbour(k, f) > 0) set%depth(f) = min(set%depth(f), depth(neighbour(k, f)))
      end do
    end do
  end subroutine find_depths

  !> Distance from the middle of a facet against its normal to the nearest facet seen from inside; huge if there is none
  !> [length].
  pure real(dp) function depth_behind(tree, set, f, limit) result(depth)
    !> Bounding-volume tree of the surface.
    type(bounding_volume_tree_t), intent(in) :: tree
    !> Facets of the surface.
    type(facet_set_t), intent(in) :: set
    !> Facet number.
    integer, intent(in) :: f
    !> Greatest depth of interest [length].
    real(dp), intent(in) :: limit
    type(oriented_box_t) :: box
    integer, allocatable :: list(:)
    real(dp), dimension(3) :: centre, normal, position, other, xu, xv
    real(dp) :: xi(2), square, t, cosine
    integer :: i, step
    depth = huge(depth)
    xi = merge(1/3.0_dp, 0.0_dp, set%corners(f) == 3)
    call facet_position_and_normal(set, f, xi, centre, normal, xu, xv)
    if (.not. norm2(normal) > 0) return
    call frame_of_normal(3, -normal, box%axes)
    box%toward = -normal
    box%origin = centre
    box%low = [-beam*set%size(f), -beam*set%size(f), start*set%size(f)]
    box%high = [beam*set%size(f), beam*set%size(f), limit]
    call facets_in_region(tree, box, list)
    do i = 1, size(list)
      if (list(i) == f) cycle
      t = 0
      do step = 1, n_steps
        call closest_point_on_facet(set, list(i), centre - t*normal, xi, square)
        call facet_position_and_normal(set, list(i), xi, position, other, xu, xv)
        cosine = -dot_product(other, normal)
        if (.not. cosine > facing_cosine) exit
        ! The beam meets the tangent plane there.
        t = dot_product(position - centre, other)/cosine
        if (set%affine(list(i))) exit
      end do
      if (.not. cosine > facing_cosine .or. .not. t > start*set%size(f)) cycle
      call closest_point_on_facet(set, list(i), centre - t*normal, xi, square)
      if (square <= (hit_tolerance*set%size(list(i)))**2) depth = min(depth, t)
    end do
  end function depth_behind
end module dotyk_contact_local_depth
