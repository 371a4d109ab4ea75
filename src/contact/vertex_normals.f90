!> Normals of the surface that straight facets approximate, at the corners of the facets.
!>
!> Where neighbouring facets turn by more than `sharp_angle` an edge is taken for one of the body; the facets on its two sides are
!> separate sheets. On each sheet the normal at a vertex comes from a fit (normal_fit.f90) to the vertices around it. Flat parts
!> stay flat: facets are part of a plane where all facets at one of their vertices, inside the surface, lie in this plane (at its rim,
!> which is everywhere in a slice of one element: the facets around these too), and so are their neighbours in it; they keep their normal, and curved facets beside them take it over at the vertices that they share.
module dotyk_contact_vertex_normals
  use dotyk_base_kinds, only: dp
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_normal_fit, only: fit_normal
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: find_smooth_sheets, smooth_corner_normals

  !> Cosine of the angle between neighbouring facets beyond which the edge is sharp: 40 degrees.
  real(dp), parameter :: sharp_cosine = 0.766_dp
  !> Facets that turn by less than this lie in a plane [rad].
  real(dp), parameter, public :: flat_angle = 1e-8_dp
  !> Rings of facets around a vertex that a fit may use, and facets in all.
  integer, parameter :: most_rings = 4, most_facets = 256
  !> Facets of a fit see the vertex's normal under less than 60 degrees.
  real(dp), parameter :: facing_cosine = 0.5_dp

contains

  !> The facets whose surface is smooth across an edge, and those that are parts of planes.
  pure subroutine find_smooth_sheets(set, adjacency, x, joined, flat)
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    !> Positions of the vertices, numbered as in adjacency (3, n_vertices) [length].
    real(dp), intent(in) :: x(:, :)
    !> The facet beyond each edge, 0 where the edge is sharp or the surface ends (4, n).
    integer, intent(out) :: joined(:, :)
    !> Parts of planes (n): those known on entry, all on return.
    logical, intent(inout) :: flat(:)
    real(dp) :: normal(3, set%n)
    logical :: planar(set%n), spreads
    integer :: f, e, v, other
    do f = 1, set%n
      call mean_normal(set%corners(f), x(:, adjacency%vertex(1:set%corners(f), f)), normal(:, f), planar(f))
    end do
    joined = 0
    do f = 1, set%n
      do e = 1, set%corners(f)
        other = adjacency%neighbour(e, f)
        if (other == 0) cycle
        if (dot_product(normal(:, f), normal(:, other)) > sharp_cosine) joined(e, f) = other
      end do
    end do
    do v = 1, size(adjacency%start) - 1
      associate (around => adjacency%facet(adjacency%start(v):adjacency%start(v + 1) - 1))
        if (.not. all(planar(around))) cycle
        if (maxval(norm2(normal(:, around) - spread(normal(:, around(1)), 2, size(around)), dim=1)) > flat_angle) cycle
        if (inside(set, adjacency, joined, v) .or. wide(set, adjacency, around, planar, normal)) flat(around) = .true.
      end associate
    end do
    spreads = .true.
    do while (spreads)
      spreads = .false.
      do f = 1, set%n
        if (flat(f) .or. .not. planar(f)) cycle
        do e = 1, set%corners(f)
          other = joined(e, f)
          if (other == 0) cycle
          if (.not. flat(other) .or. norm2(normal(:, f) - normal(:, other)) > flat_angle) cycle
          flat(f) = .true.
          spreads = .true.
        end do
      end do
    end do
    ! Two planes that meet keep their edge, however small its angle.
    do f = 1, set%n
      do e = 1, set%corners(f)
        other = joined(e, f)
        if (other == 0) cycle
        if (flat(f) .and. flat(other) .and. norm2(normal(:, f) - normal(:, other)) > flat_angle) joined(e, f) = 0
      end do
    end do
  end subroutine find_smooth_sheets

  !> Does a vertex lie inside the surface, with facets all around it?
  pure logical function inside(set, adjacency, joined, v)
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    integer, intent(in) :: joined(:, :)
    !> The vertex.
    integer, intent(in) :: v
    integer :: k, f, edge(2)
    inside = .true.
    do k = adjacency%start(v), adjacency%start(v + 1) - 1
      f = adjacency%facet(k)
      edge = edges_of_corner(set%corners(f), corner_of(set, adjacency, v, f))
      inside = inside .and. all(joined(edge, f) > 0)
    end do
  end function inside

  !> Are facets that lie in a plane surrounded by others in this plane? (Two triangles at the end of a coarse cylinder are not.)
  pure logical function wide(set, adjacency, around, planar, normal)
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    !> The facets at a vertex.
    integer, intent(in) :: around(:)
    !> As in find_smooth_sheets (n), (3, n).
    logical, intent(in) :: planar(:)
    real(dp), intent(in) :: normal(:, :)
    integer :: i, c, k, v, f
    logical :: more
    wide = .false.
    more = .false.
    do i = 1, size(around)
      do c = 1, set%corners(around(i))
        v = adjacency%vertex(c, around(i))
        do k = adjacency%start(v), adjacency%start(v + 1) - 1
          f = adjacency%facet(k)
          if (any(f == around)) cycle
          if (.not. planar(f) .or. norm2(normal(:, f) - normal(:, around(1))) > flat_angle) return
          more = .true.
        end do
      end do
    end do
    wide = more .and. size(around) > 1
  end function wide

  !> Normal of a facet in the mean.
  pure subroutine mean_normal(corners, x, normal, planar)
    integer, intent(in) :: corners
    !> Corners (3, corners).
    real(dp), intent(in) :: x(:, :)
    !> Unit vector (3); zero for a degenerate facet.
    real(dp), intent(out) :: normal(3)
    !> All corners lie in a plane.
    logical, intent(out) :: planar
    integer :: k
    select case (corners)
    case (2)
      normal = [x(2, 2) - x(2, 1), x(1, 1) - x(1, 2), 0.0_dp]
    case (3)
      normal = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))
    case default
      normal = cross(x(:, 3) - x(:, 1), x(:, 4) - x(:, 2))
    end select
    if (norm2(normal) > 0) normal = normal/norm2(normal)
    planar = .true.
    do k = 3, corners
      planar = planar .and. abs(dot_product(normal, x(:, k) - x(:, 1))) <= flat_angle*norm2(x(:, k) - x(:, 1))
    end do
  end subroutine mean_normal

  !> Normal of a straight facet at a corner, as long as the area that its edges there span, and the weight that makes the weighted
  !> sum of these normals at a vertex of a sphere the sphere's normal (Max, Weights for computing vertex normals from
  !> facet normals, Journal of Graphics Tools 4, 1999); in two dimensions likewise for a circle.
  pure subroutine corner_normal(corners, k, x, normal, weight)
    !> Number of corners, and the corner.
    integer, intent(in) :: corners, k
    !> Corners (3, corners).
    real(dp), intent(in) :: x(:, :)
    real(dp), intent(out) :: normal(3), weight
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
  end subroutine corner_normal

  !> Unit normals of the smooth surface at the corners of linear facets.
  subroutine smooth_corner_normals(set, adjacency, x, joined, flat, wanted, normal)
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    !> Positions of the vertices (3, n_vertices) [length].
    real(dp), intent(in) :: x(:, :)
    !> As in find_smooth_sheets.
    logical, intent(in) :: flat(:)
    integer, intent(in) :: joined(:, :)
    !> The vertices where normals are wanted (n_vertices).
    logical, intent(in) :: wanted(:)
    !> Outward (3, 4, n), 0 at the others.
    real(dp), intent(out) :: normal(:, :, :)
    integer :: v
    normal = 0
    !$omp parallel do default(none) schedule(dynamic, 64) shared(set, adjacency, x, joined, flat, wanted, normal)
    do v = 1, size(adjacency%start) - 1
      if (wanted(v)) call normals_at_vertex(set, adjacency, x, joined, flat, v, normal)
    end do
    !$omp end parallel do
  end subroutine smooth_corner_normals

  !> The normals at one vertex, sheet by sheet.
  subroutine normals_at_vertex(set, adjacency, x, joined, flat, v, normal)
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    real(dp), intent(in) :: x(:, :)
    logical, intent(in) :: flat(:)
    integer, intent(in) :: joined(:, :)
    !> The vertex.
    integer, intent(in) :: v
    !> Only the facets' corners at the vertex are set.
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
      ! facets joined across edges at the vertex are one sheet: the least number spreads
      do k = 1, n
        do i = 1, n
          edge = edges_of_corner(set%corners(around(i)), corner(i))
          do j = 1, n
            if (any(joined(edge, around(i)) == around(j))) sheet(i) = min(sheet(i), sheet(j))
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
          call corner_normal(set%corners(f), corner(i), x(:, adjacency%vertex(1:set%corners(f), f)), own, weight)
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
          call fit_around(set, adjacency, x, joined, flat, v, pack(around, sheet == k), mean)
        end if
        do i = 1, n
          if (sheet(i) == k .and. .not. flat(around(i))) normal(:, corner(i), around(i)) = mean
        end do
      end do
    end associate
  end subroutine normals_at_vertex

  !> Fit the normal at a vertex to the vertices of the facets of one sheet around it: as many rings as the fit needs. A fit that
  !> differs from the mean by more than twice what the facets of the fit and beside do is none.
  subroutine fit_around(set, adjacency, x, joined, flat, v, start, normal)
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    real(dp), intent(in) :: x(:, :)
    integer, intent(in) :: joined(:, :)
    logical, intent(in) :: flat(:)
    !> The vertex, and the facets of the sheet there.
    integer, intent(in) :: v, start(:)
    !> A mean (3); the fit on return.
    real(dp), intent(inout) :: normal(3)
    integer :: facet(most_facets), vertex(4*most_facets), n, n_vertices, ring, i, e, k, last, other
    real(dp) :: mean(3), its(3), widest
    logical :: determined, planar
    mean = normal
    n = min(size(start), most_facets)
    facet(:n) = start(:n)
    widest = 1
    do i = 1, n
      do e = 1, set%corners(facet(i))
        if (joined(e, facet(i)) > 0) widest = min(widest, facing(joined(e, facet(i))))
      end do
      widest = min(widest, facing(facet(i)))
    end do
    do ring = 1, most_rings
      n_vertices = 0
      do i = 1, n
        do k = 1, set%corners(facet(i))
          other = adjacency%vertex(k, facet(i))
          if (other == v .or. any(vertex(:n_vertices) == other)) cycle
          n_vertices = n_vertices + 1
          vertex(n_vertices) = other
        end do
      end do
      normal = mean
      call fit_normal(set%dimension, x(:, vertex(:n_vertices)) - spread(x(:, v), 2, n_vertices), normal, determined)
      if (determined) exit
      last = n
      do i = 1, last
        do e = 1, set%corners(facet(i))
          other = joined(e, facet(i))
          if (other == 0 .or. n == most_facets) cycle
          if (flat(other) .or. any(facet(:n) == other)) cycle
          if (facing(other) < facing_cosine) cycle
          widest = min(widest, facing(other))
          n = n + 1
          facet(n) = other
        end do
      end do
      if (n == last) exit
    end do
    if (dot_product(normal, mean) < 2*widest**2 - 1) normal = mean

  contains

    !> Cosine of the angle of a facet to the mean.
    real(dp) function facing(f)
      integer, intent(in) :: f
      call mean_normal(set%corners(f), x(:, adjacency%vertex(1:set%corners(f), f)), its, planar)
      facing = dot_product(its, mean)
    end function facing
  end subroutine fit_around

  !> The corner of a facet that is a vertex.
  pure integer function corner_of(set, adjacency, v, f) result(corner)
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    integer, intent(in) :: v, f
    corner = findloc(adjacency%vertex(1:set%corners(f), f), v, dim=1)
  end function corner_of

  !> The two edges that meet at a corner; in two dimensions the end itself, twice.
  pure function edges_of_corner(corners, corner) result(edge)
    integer, intent(in) :: corners, corner
    integer :: edge(2)
    if (corners == 2) then
      edge = corner
    else
      edge = [corner, modulo(corner - 2, corners) + 1]
    end if
  end function edges_of_corner
end module dotyk_contact_vertex_normals
