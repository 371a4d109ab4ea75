!> Vertex normals of the smooth surface that linear facets approximate.
!>
!> Facets of one geometric entity, a face of the CAD model, belong to one smooth sheet. Others do where they differ no
!> more at their common edge than beside it; where no entities are known, by no more than 40 degrees. On each sheet the
!> normal at a vertex comes from a fit (normal_fit.f90) to the vertices around it. Planes stay planar: facets belong to
!> a plane if all facets at one of their vertices inside the surface lie in this plane (at a boundary vertex, as
!> everywhere in a mesh of one element layer: also the facets around these), and so do their neighbours in the plane.
!> They keep their normal, and adjacent curved facets take it over at shared vertices.
module dotyk_contact_vertex_normals
  use dotyk_base_kinds, only: dp
  use dotyk_contact_adjacency, only: adjacency_t, corner_of, edges_of_corner
  use dotyk_contact_facet_corners, only: corner_normal
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_normal_fit, only: fit_normal
  use dotyk_contact_smooth_sheets, only: is_smooth_edge
  use dotyk_mesh_facet, only: cross
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: find_smooth_sheets, smooth_corner_normals

  !> Facets whose directions differ by less than this are coplanar [rad].
  real(dp), parameter, public :: flat_angle = 1.0e-8_dp
  !> Rings of facets around a vertex that a fit may use, and facets altogether.
  integer, parameter :: max_rings = 4, max_facets = 256
  !> Facets of a fit are inclined to the mean normal at the vertex by less than 60 degrees.
  real(dp), parameter :: min_fit_cosine = 0.5_dp

contains

  !> Edges across which the surface is smooth, and facets that belong to planes.
  pure subroutine find_smooth_sheets(set, adjacency, x, entity, smooth_neighbour, flat)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: x(:, :)  !! Positions of the vertices, numbered as in `adjacency` (3, n_vertices) [length].
    integer, intent(in) :: entity(:)  !! Geometric entity of each facet, 0 if unknown (n).
    !> Facet across each edge, 0 where the edge is sharp or the surface ends (4, n).
    integer, intent(out) :: smooth_neighbour(:, :)
    logical, intent(inout) :: flat(:)  !! Facets of planes: those known on entry, all on return (n).
    real(dp) :: normal(3, set%n)
    logical :: planar(set%n), changed
    integer :: f, e, v, other
    do f = 1, set%n
      call mean_normal(set%corners(f), x(:, adjacency%vertex(1:set%corners(f), f)), normal(:, f), planar(f))
    end do
    do v = 1, size(adjacency%start) - 1
      associate (around => adjacency%facet(adjacency%start(v):adjacency%start(v + 1) - 1))
        if (.not. all(planar(around))) cycle
        if (maxval(norm2(normal(:, around) - spread(normal(:, around(1)), 2, size(around)), dim=1)) > flat_angle) cycle
        if (is_interior_vertex(set, adjacency, v) .or. &
            is_extended_plane(set, adjacency, around, planar, normal)) flat(around) = .true.
      end associate
    end do
    changed = .true.
    do while (changed)
      changed = .false.
      do f = 1, set%n
        if (flat(f) .or. .not. planar(f)) cycle
        do e = 1, set%corners(f)
          other = adjacency%neighbour(e, f)
          if (other == 0) cycle
          if (.not. flat(other) .or. norm2(normal(:, f) - normal(:, other)) > flat_angle) cycle
          flat(f) = .true.
          changed = .true.
        end do
      end do
    end do
    smooth_neighbour = 0
    do f = 1, set%n
      do e = 1, set%corners(f)
        other = adjacency%neighbour(e, f)
        if (other == 0) cycle
        ! The edge between two planes is sharp at any angle.
        if (flat(f) .and. flat(other) .and. norm2(normal(:, f) - normal(:, other)) > flat_angle) cycle
        if (is_smooth_edge(adjacency, normal, entity, flat, f, other)) smooth_neighbour(e, f) = other
      end do
    end do
  end subroutine find_smooth_sheets

  !> Whether a vertex lies inside the surface.
  pure logical function is_interior_vertex(set, adjacency, v)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    integer, intent(in) :: v  !! Vertex number.
    integer :: k, f, edge(2)
    is_interior_vertex = .true.
    do k = adjacency%start(v), adjacency%start(v + 1) - 1
      f = adjacency%facet(k)
      edge = edges_of_corner(set%corners(f), corner_of(set, adjacency, v, f))
      is_interior_vertex = is_interior_vertex .and. all(adjacency%neighbour(edge, f) > 0)
    end do
  end function is_interior_vertex

  !> Whether the coplanar facets at a vertex are surrounded by other facets of their plane. (Two triangles at the end of
  !> a coarse cylinder are not.)
  pure logical function is_extended_plane(set, adjacency, around, planar, normal)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    integer, intent(in) :: around(:)  !! Facets at the vertex (number of facets there).
    logical, intent(in) :: planar(:)  !! Facets whose corners are coplanar (n).
    real(dp), intent(in) :: normal(:, :)  !! Mean normals of the facets (3, n) [].
    integer :: i, c, k, v, f
    logical :: has_neighbours
    is_extended_plane = .false.
    has_neighbours = .false.
    do i = 1, size(around)
      do c = 1, set%corners(around(i))
        v = adjacency%vertex(c, around(i))
        do k = adjacency%start(v), adjacency%start(v + 1) - 1
          f = adjacency%facet(k)
          if (any(f == around)) cycle
          if (.not. planar(f) .or. norm2(normal(:, f) - normal(:, around(1))) > flat_angle) return
          has_neighbours = .true.
        end do
      end do
    end do
    is_extended_plane = has_neighbours .and. size(around) > 1
  end function is_extended_plane

  !> Mean normal of a facet.
  pure subroutine mean_normal(corners, x, normal, planar)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: x(:, :)  !! Corners (3, corners) [length].
    real(dp), intent(out) :: normal(3)  !! Unit normal; zero for a degenerate facet (3) [].
    logical, intent(out) :: planar  !! All corners are coplanar.
    integer :: k
    normal = corner_normal(x(:, :corners))
    planar = .true.
    do k = 3, corners
      planar = planar .and. abs(dot_product(normal, x(:, k) - x(:, 1))) <= flat_angle*norm2(x(:, k) - x(:, 1))
    end do
  end subroutine mean_normal

  !> Normal of a linear facet at a corner, whose length is the area spanned by its edges there, and the weight with
  !> which the weighted sum of these normals at a vertex of a sphere is the normal of the sphere (Max, Weights for
  !> computing vertex normals from facet normals, Journal of Graphics Tools 4, 1999); in two dimensions likewise for a
  !> circle.
  pure subroutine area_at_corner(corners, k, x, normal, weight)
    integer, intent(in) :: corners  !! Number of corners of the facet.
    integer, intent(in) :: k  !! Corner.
    real(dp), intent(in) :: x(:, :)  !! Corners (3, corners) [length].
    real(dp), intent(out) :: normal(3)  !! Normal (3) [length^2; length in two dimensions].
    real(dp), intent(out) :: weight  !! Weight [1/length^4; 1/length^2 in two dimensions].
    real(dp) :: a(3), b(3)
    if (corners == 2) then
      normal = [x(2, 2) - x(2, 1), x(1, 1) - x(1, 2), 0.0_dp]
      weight = 1/max(sum(normal**2), tiny(1.0_dp))
    else
      a = x(:, modulo(k, corners) + 1) - x(:, k)
      b = x(:, modulo(k - 2, corners) + 1) - x(:, k)
      normal = cross(a, b)
      weight = 1/max(sum(a**2)*sum(b**2), tiny(1.0_dp))
    end if
  end subroutine area_at_corner

  !> Unit normals of the smooth surface at the corners of linear facets.
  subroutine smooth_corner_normals(division, set, adjacency, x, smooth_neighbour, flat, wanted, normal)
    type(division_t), intent(in) :: division  !! How ranks divide the vertices.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: x(:, :)  !! Positions of the vertices (3, n_vertices) [length].
    logical, intent(in) :: flat(:)  !! Facets of planes (n).
    integer, intent(in) :: smooth_neighbour(:, :)  !! Facet across each smooth edge, 0 at the others (4, n).
    logical, intent(in) :: wanted(:)  !! Vertices at which normals are wanted (n_vertices).
    real(dp), intent(out) :: normal(:, :, :)  !! Outward normals, 0 at the other vertices (3, 4, n) [].
    integer :: v, first, last
    normal = 0
    call division%portion(merge(1.0_dp, 0.0_dp, wanted), first, last)
    !$omp parallel do default(none) schedule(dynamic, 64) &
    !$omp shared(set, adjacency, x, smooth_neighbour, flat, wanted, normal, first, last)
    do v = first, last
      if (wanted(v)) call normals_at_vertex(set, adjacency, x, smooth_neighbour, flat, v, normal)
    end do
    !$omp end parallel do
    if (division%is_divided) call share_normals(division, set, adjacency, first, last, normal)
  end subroutine smooth_corner_normals

  !> Make the normals at the vertices of all ranks known to all.
  subroutine share_normals(division, set, adjacency, first, last, normal)
    type(division_t), intent(in) :: division  !! How ranks divide the vertices.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    integer, intent(in) :: first  !! First vertex of this rank.
    integer, intent(in) :: last  !! Its last vertex.
    real(dp), intent(inout) :: normal(:, :, :)  !! Normals at the vertices of this rank in, at all out (3, 4, n) [].
    real(dp), allocatable :: at_vertex(:, :)
    integer :: v, k
    allocate (at_vertex(3, size(adjacency%facet)))
    do v = first, last
      do k = adjacency%start(v), adjacency%start(v + 1) - 1
        at_vertex(:, k) = normal(:, corner_of(set, adjacency, v, adjacency%facet(k)), adjacency%facet(k))
      end do
    end do
    call division%fill(at_vertex, adjacency%start(first), adjacency%start(last + 1) - 1)
    do v = 1, size(adjacency%start) - 1
      do k = adjacency%start(v), adjacency%start(v + 1) - 1
        normal(:, corner_of(set, adjacency, v, adjacency%facet(k)), adjacency%facet(k)) = at_vertex(:, k)
      end do
    end do
  end subroutine share_normals

  !> Normals at one vertex, sheet by sheet.
  subroutine normals_at_vertex(set, adjacency, x, smooth_neighbour, flat, v, normal)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: x(:, :)  !! Positions of the vertices (3, n_vertices) [length].
    logical, intent(in) :: flat(:)  !! Facets of planes (n).
    integer, intent(in) :: smooth_neighbour(:, :)  !! Facet across each smooth edge, 0 at the others (4, n).
    integer, intent(in) :: v  !! Vertex number.
    !> Normals at the corners of the facets; those at the vertex are set (3, 4, n) [].
    real(dp), intent(inout) :: normal(:, :, :)
    integer :: first, last, i, j, k, n, f, edge(2)
    integer, allocatable :: sheet(:), corner(:)
    real(dp) :: mean(3), plane(3), own(3), weight
    logical :: has_plane
    first = adjacency%start(v)
    last = adjacency%start(v + 1) - 1
    n = last - first + 1
    allocate (sheet(n), corner(n))
    associate (around => adjacency%facet(first:last))
      do i = 1, n
        sheet(i) = i
        corner(i) = corner_of(set, adjacency, v, around(i))
      end do
      ! Facets with a common smooth edge at the vertex belong to one sheet: the least number propagates.
      do k = 1, n
        do i = 1, n
          edge = edges_of_corner(set%corners(around(i)), corner(i))
          do j = 1, n
            if (any(smooth_neighbour(edge, around(i)) == around(j))) sheet(i) = min(sheet(i), sheet(j))
          end do
        end do
      end do
      do k = 1, n
        if (.not. any(sheet == k)) cycle
        mean = 0
        plane = 0
        has_plane = .false.
        do i = 1, n
          if (sheet(i) /= k) cycle
          f = around(i)
          call area_at_corner(set%corners(f), corner(i), x(:, adjacency%vertex(1:set%corners(f), f)), own, weight)
          mean = mean + weight*own
          normal(:, corner(i), f) = own/max(norm2(own), tiny(1.0_dp))
          if (.not. flat(f)) cycle
          has_plane = .true.
          plane = plane + weight*own
        end do
        if (.not. norm2(mean) > 0) cycle
        if (has_plane) then
          mean = plane/max(norm2(plane), tiny(1.0_dp))
        else
          mean = mean/norm2(mean)
          call fit_normal_around(set, adjacency, x, smooth_neighbour, flat, v, pack(around, sheet == k), mean)
        end if
        do i = 1, n
          if (sheet(i) == k .and. .not. flat(around(i))) normal(:, corner(i), around(i)) = mean
        end do
      end do
    end associate
  end subroutine normals_at_vertex

  !> Fit the normal at a vertex to the vertices of the facets of one sheet around it, with as few rings of facets as
  !> determine as many coefficients as any. A fit is rejected if it differs from the mean by more than twice the
  !> greatest angle between the mean and the facets around.
  subroutine fit_normal_around(set, adjacency, x, smooth_neighbour, flat, v, start, normal)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: x(:, :)  !! Positions of the vertices (3, n_vertices) [length].
    integer, intent(in) :: smooth_neighbour(:, :)  !! Facet across each smooth edge, 0 at the others (4, n).
    logical, intent(in) :: flat(:)  !! Facets of planes (n).
    integer, intent(in) :: v  !! Vertex number.
    integer, intent(in) :: start(:)  !! Facets of the sheet at the vertex (number of these facets).
    !> Weighted mean of the facet normals on entry, fitted normal on return (3) [].
    real(dp), intent(inout) :: normal(3)
    integer :: facet(max_facets), vertex(4*max_facets), n, n_vertices, ring, i, e, k, last, other
    real(dp) :: mean(3), facet_normal(3), least_cosine, fitted(3)
    integer :: n_undetermined, fewest
    logical :: planar
    mean = normal
    n = min(size(start), max_facets)
    facet(:n) = start(:n)
    least_cosine = 1
    do i = 1, n
      do e = 1, set%corners(facet(i))
        if (smooth_neighbour(e, facet(i)) > 0) least_cosine = min(least_cosine, facing(smooth_neighbour(e, facet(i))))
      end do
      least_cosine = min(least_cosine, facing(facet(i)))
    end do
    fewest = huge(fewest)
    do ring = 1, max_rings
      n_vertices = 0
      do i = 1, n
        do k = 1, set%corners(facet(i))
          other = adjacency%vertex(k, facet(i))
          if (other == v .or. any(vertex(:n_vertices) == other)) cycle
          n_vertices = n_vertices + 1
          vertex(n_vertices) = other
        end do
      end do
      fitted = mean
      call fit_normal(set%dimension, x(:, vertex(:n_vertices)) - spread(x(:, v), 2, n_vertices), fitted, n_undetermined)
      if (n_undetermined < fewest) then
        fewest = n_undetermined
        normal = fitted
      end if
      if (fewest == 0) exit
      last = n
      do i = 1, last
        do e = 1, set%corners(facet(i))
          other = smooth_neighbour(e, facet(i))
          if (other == 0 .or. n == max_facets) cycle
          if (flat(other) .or. any(facet(:n) == other)) cycle
          if (facing(other) < min_fit_cosine) cycle
          least_cosine = min(least_cosine, facing(other))
          n = n + 1
          facet(n) = other
        end do
      end do
      if (n == last) exit
    end do
    if (dot_product(normal, mean) < 2*least_cosine**2 - 1) normal = mean

  contains

    !> Cosine of the angle between a facet and the mean normal [].
    real(dp) function facing(f)
      integer, intent(in) :: f  !! Facet number.
      call mean_normal(set%corners(f), x(:, adjacency%vertex(1:set%corners(f), f)), facet_normal, planar)
      facing = dot_product(facet_normal, mean)
    end function facing
  end subroutine fit_normal_around
end module dotyk_contact_vertex_normals
