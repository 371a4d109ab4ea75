!> The depth that the facets of a surface cannot resolve, and their curvature.
!>
!> Facets that meet at a smooth edge (smooth_sheets.f90) before deformation are parts of one smooth surface. An arc over
!> a facet of width h that turns by b has the height h b/8; contact conditions that hold in the mean over the facets
!> around a vertex leave penetrations of this order, where the surface is curved and where deformation bends it.
module dotyk_contact_facet_roughness
  use dotyk_base_kinds, only: dp
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_facet_corners, only: corner_coordinates, corner_normal
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_smooth_sheets, only: facet_entity, is_smooth_edge
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: measure_roughness

  !> Roughness over curvature times width^2: twice the height of the arc [].
  real(dp), parameter :: roughness_factor = 0.25_dp

contains

  !> Normals, roughness and curvature of all facets.
  subroutine measure_roughness(surface, set, adjacency, x0, normal0, normal, roughness0, roughness, curvature)
    type(surface_t), intent(in) :: surface  !! Facets.
    type(facet_set_t), intent(in) :: set  !! Deformed facets.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: x0(:, :)  !! Nodes before deformation (3, n_nodes) [length].
    !> Unit normals of the facets before deformation (3, n_facets) [].
    real(dp), allocatable, intent(out) :: normal0(:, :)
    real(dp), allocatable, intent(out) :: normal(:, :)  !! The same after deformation (3, n_facets) [].
    !> Roughness before deformation where the surface is concave: chords lie outside of the body there, and touch before
    !> the surface does. Chords of convex surfaces lie inside, and depths below them are real (n_facets) [length].
    real(dp), allocatable, intent(out) :: roughness0(:)
    real(dp), allocatable, intent(out) :: roughness(:)  !! Roughness after deformation (n_facets) [length].
    real(dp), allocatable, intent(out) :: curvature(:)  !! Curvature before deformation (n_facets) [1/length].
    type(facet_set_t) :: before
    real(dp) :: width(2), bent, centre_normal(3)
    integer :: entity(set%n), smooth(4, set%n), f, e, other, back
    logical :: in_plane(set%n)
    entity = [(facet_entity(surface, f), f=1, set%n)]
    in_plane = .false.
    allocate (normal0(3, set%n), normal(3, set%n), roughness0(set%n), roughness(set%n), curvature(set%n))
    ! Deformation bends flat facets too.
    call before%init_polynomials(x0(1:set%dimension, :), surface)
    do f = 1, set%n
      associate (corner => surface%node(1:set%corners(f), f), is_flat => set%affine(f) .and. set%corners(f) > 2)
        normal0(:, f) = corner_normal(x0(:, corner))
        call bulge(set, f, is_flat, normal(:, f), roughness(f), bent)
        call bulge(before, f, is_flat, centre_normal, bent, curvature(f))
        roughness0(f) = 0
      end associate
    end do
    smooth = 0
    do f = 1, set%n
      do e = 1, set%corners(f)
        other = adjacency%neighbour(e, f)
        if (other < f) cycle
        back = findloc(adjacency%neighbour(1:set%corners(other), other), f, dim=1)
        if (back == 0) cycle
        if (.not. is_smooth_edge(adjacency, normal0, entity, in_plane, f, other)) cycle
        smooth(e, f) = other
        smooth(back, other) = f
      end do
    end do
    do f = 1, set%n
      do e = 1, set%corners(f)
        other = smooth(e, f)
        if (other < f) cycle
        back = findloc(smooth(1:set%corners(other), other), f, dim=1)
        width = [width_at(surface, set, x0, f, e), width_at(surface, set, x0, other, back)]
        if (.not. minval(width) > 0) cycle
        associate (pair => [f, other], curved => norm2(normal(:, f) - normal(:, other))/(sum(width)/2), &
                   curved0 => norm2(normal0(:, f) - normal0(:, other))/(sum(width)/2))
          roughness(pair) = max(roughness(pair), roughness_factor*width**2*curved)
          if (is_concave(f, other)) roughness0(pair) = max(roughness0(pair), roughness_factor*width**2*curved0)
          curvature(pair) = max(curvature(pair), curved0)
        end associate
      end do
    end do
    call spread_to_neighbours(roughness0)
    call spread_to_neighbours(roughness)

  contains

    !> Whether the surface is concave across the edge of two facets: whether the normals on both sides of the two
    !> converge outside. The edge itself may be a diagonal that bends the other way, as of skew facets of a cylinder.
    pure logical function is_concave(f, g)
      integer, intent(in) :: f, g  !! The facets.
      real(dp) :: between(3)
      between = sum(x0(:, surface%node(:set%corners(g), g)), 2)/set%corners(g) - &
                sum(x0(:, surface%node(:set%corners(f), f)), 2)/set%corners(f)
      is_concave = dot_product(normal_beyond(g, f) - normal_beyond(f, g), between) < 0
    end function is_concave

    !> Mean normal of the smooth neighbours of a facet but one; its own where it has no other (3) [].
    pure function normal_beyond(f, g) result(mean)
      integer, intent(in) :: f, g  !! The facet, and the neighbour that does not count.
      real(dp) :: mean(3)
      integer :: e, n
      mean = 0
      n = 0
      do e = 1, set%corners(f)
        if (smooth(e, f) == 0 .or. smooth(e, f) == g) cycle
        mean = mean + normal0(:, smooth(e, f))
        n = n + 1
      end do
      mean = merge(mean/max(1, n), normal0(:, f), n > 0)
    end function normal_beyond

    !> Means over the facets around a vertex depend on all of them.
    subroutine spread_to_neighbours(height)
      real(dp), intent(inout) :: height(:)  !! Heights (n_facets) [length].
      real(dp) :: own(set%n)
      own = height
      do f = 1, set%n
        do e = 1, set%corners(f)
          if (smooth(e, f) > 0) height(f) = max(height(f), own(smooth(e, f)))
        end do
      end do
    end subroutine spread_to_neighbours
  end subroutine measure_roughness

  !> Normal at the centre of a facet, and its roughness and curvature by the normals at its corners.
  pure subroutine bulge(set, f, is_flat, normal, roughness, curvature)
    type(facet_set_t), intent(in) :: set  !! Facets, deformed or not.
    integer, intent(in) :: f  !! Facet number.
    logical, intent(in) :: is_flat  !! Whether it is flat: roughness and curvature are 0.
    real(dp), intent(out) :: normal(3)  !! Unit normal at the centre (3) [].
    real(dp), intent(out) :: roughness  !! Roughness [length].
    real(dp), intent(out) :: curvature  !! Curvature [1/length].
    real(dp) :: centre(3), position(3), other(3), xu(3), xv(3), xi(2), turn, distance
    integer :: i
    xi = merge(1/3.0_dp, 0.0_dp, set%corners(f) == 3)
    call facet_position_and_normal(set, f, xi, centre, normal, xu, xv)
    roughness = 0
    curvature = 0
    if (is_flat) return
    do i = 1, set%corners(f)
      xi = corner_coordinates(set%corners(f), i)
      call facet_position_and_normal(set, f, xi, position, other, xu, xv)
      turn = norm2(other - normal)
      distance = norm2(position - centre)
      if (.not. distance > 0) cycle
      ! The corner is half a width away, and the normal has turned by half the angle.
      roughness = max(roughness, 4*roughness_factor*turn*distance)
      curvature = max(curvature, turn/distance)
    end do
  end subroutine bulge

  !> Width of a facet across one of its edges: the distance of its farthest corner from the edge; in two dimensions its
  !> length [length].
  pure real(dp) function width_at(surface, set, x0, f, e) result(width)
    type(surface_t), intent(in) :: surface  !! Facets.
    type(facet_set_t), intent(in) :: set  !! Facets, for the numbers of corners.
    real(dp), intent(in) :: x0(:, :)  !! Nodes (3, n_nodes) [length].
    integer, intent(in) :: f  !! Facet number.
    integer, intent(in) :: e  !! Edge.
    real(dp) :: along(3), r(3)
    integer :: i, n
    n = set%corners(f)
    associate (corner => surface%node(1:n, f))
      if (n == 2) then
        width = norm2(x0(:, corner(2)) - x0(:, corner(1)))
        return
      end if
      along = x0(:, corner(modulo(e, n) + 1)) - x0(:, corner(e))
      along = along/max(norm2(along), tiny(1.0_dp))
      width = 0
      do i = 1, n
        r = x0(:, corner(i)) - x0(:, corner(e))
        width = max(width, norm2(r - dot_product(r, along)*along))
      end do
    end associate
  end function width_at
end module dotyk_contact_facet_roughness
