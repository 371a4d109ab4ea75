!> Vertex normals of the smooth surface that linear facets approximate.
!>
!> Facets of one geometric entity, a face of the CAD model, belong to one smooth sheet. Others do where they differ no
!> more at their common edge than beside it; where no entities are known, by no more than 40 degrees. On each sheet the
!> normal at a vertex comes from a fit to the vertices around it. Planes stay planar: facets belong to
!> a plane if all facets at one of their vertices inside the surface lie in this plane (at a boundary vertex, as
!> everywhere in a mesh of one element layer: also the facets around these), and so do their neighbours in the plane.
!> They keep their normal, and adjacent curved facets take it over at shared vertices.
!>
!> The surface is the graph of a function h of two tangential coordinates u, v through the vertex. The fit by least
!> squares is h = a u + b v + (c u^2 + d u v + e v^2) (1 + h^2/(u^2+v^2)). The last factor tends to 1 at the vertex and
!> makes the fit exact on spheres and circles: these obey h = a u + b v + c (u^2+v^2+h^2) in any frame. On every smooth
!> surface the error of the normal is of second order in the distance of the vertices, whether these lie around the
!> vertex or, at the boundary of the surface, on one side of it.
module dotyk_contact_vertex_normals
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: few_roundings, no_offset, shape_rounding
  use dotyk_contact_adjacency, only: adjacency_t, corner_of, edges_of_corner
  use dotyk_contact_bounding_volume_tree, only: facing_cosine
  use dotyk_contact_facet_set, only: corner_normal, facet_set_t
  use dotyk_contact_smooth_sheets, only: is_smooth_edge
  use dotyk_mesh_facet, only: cross
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: find_smooth_sheets, smooth_corner_normals, fit_normal

  !> Rings of facets around a vertex that a fit may use, and facets altogether.
  integer, parameter :: max_rings = 4, max_facets = 256
  integer, parameter :: n_fits = 3  !! Number of fits, each in the frame of the previous normal.
  !> With a pivot of the scaled normal equations below this the vertices hardly determine a coefficient: two layers of
  !> them tell no curvature from a slope.
  real(dp), parameter :: min_pivot = 0.02_dp

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
        if (maxval(norm2(normal(:, around) - spread(normal(:, around(1)), 2, size(around)), dim=1)) > no_offset) cycle
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
          if (.not. flat(other) .or. norm2(normal(:, f) - normal(:, other)) > no_offset) cycle
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
        if (flat(f) .and. flat(other) .and. norm2(normal(:, f) - normal(:, other)) > no_offset) cycle
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
          if (.not. planar(f) .or. norm2(normal(:, f) - normal(:, around(1))) > no_offset) return
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
      planar = planar .and. abs(dot_product(normal, x(:, k) - x(:, 1))) <= no_offset*norm2(x(:, k) - x(:, 1))
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
          if (facing(other) < facing_cosine) cycle
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

  !> Fit the normal.
  pure subroutine fit_normal(dimension, point, normal, n_undetermined)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    !> Vertices of the patch relative to the vertex itself, which is not among them (3, n) [length].
    real(dp), intent(in) :: point(:, :)
    !> Unit normal: on entry a guess, in whose frame all heights are functions of the tangential coordinates; the fit on
    !> return (3) [].
    real(dp), intent(inout) :: normal(3)
    !> Number of coefficients that the vertices do not determine: they are zero, those of second order first.
    integer, intent(out) :: n_undetermined
    real(dp) :: axis(3, 2), slope(2)
    integer :: k
    do k = 1, n_fits
      call tangents(dimension, normal, axis)
      call fit_slope(dimension, point, normal, axis, slope, n_undetermined)
      normal = normal - slope(1)*axis(:, 1) - slope(2)*axis(:, 2)
      normal = normal/norm2(normal)
    end do
  end subroutine fit_normal

  !> Two unit vectors normal to a direction; in two dimensions one, and zero.
  pure subroutine tangents(dimension, normal, axis)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: normal(3)  !! Direction (3) [].
    real(dp), intent(out) :: axis(3, 2)  !! Unit vectors (3, 2) [].
    integer :: i
    axis = 0
    if (dimension == 2) then
      axis(1:2, 1) = [-normal(2), normal(1)]
      return
    end if
    i = minloc(abs(normal), dim=1)
    axis(i, 1) = 1
    axis(:, 1) = axis(:, 1) - normal(i)*normal
    axis(:, 1) = axis(:, 1)/norm2(axis(:, 1))
    axis(1, 2) = normal(2)*axis(3, 1) - normal(3)*axis(2, 1)
    axis(2, 2) = normal(3)*axis(1, 1) - normal(1)*axis(3, 1)
    axis(3, 2) = normal(1)*axis(2, 1) - normal(2)*axis(1, 1)
  end subroutine tangents

  !> Slopes of the surface at the vertex along the two tangential axes.
  pure subroutine fit_slope(dimension, point, normal, axis, slope, n_undetermined)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: point(:, :)  !! Vertices relative to the vertex (3, n) [length].
    real(dp), intent(in) :: normal(3)  !! Normal of the frame (3) [].
    real(dp), intent(in) :: axis(3, 2)  !! Tangential axes of the frame (3, 2) [].
    real(dp), intent(out) :: slope(2)  !! Slopes along the axes (2) [].
    integer, intent(out) :: n_undetermined  !! As in `fit_normal`.
    real(dp) :: p(2, size(point, 2)), h(size(point, 2)), row(5), gram(5, 5), right(5), scale(5), principal(2, 2)
    real(dp) :: square, curvature_factor
    integer :: i, n
    n = merge(2, 5, dimension == 2)
    p = matmul(transpose(axis), point)
    h = matmul(normal, point)
    call principal_axes(p, principal)
    gram = 0
    right = 0
    do i = 1, size(h)
      square = sum(p(:, i)**2)
      if (.not. square > 0) cycle
      curvature_factor = 1 + h(i)**2/square
      associate (q => matmul(transpose(principal), p(:, i)))
        if (dimension == 2) then
          row(1:2) = [q(1), curvature_factor*q(1)**2]
        else
          row = [q(1), q(2), curvature_factor*q(1)**2, curvature_factor*q(1)*q(2), curvature_factor*q(2)**2]
        end if
        ! weight 1/distance^2
        gram(1:n, 1:n) = gram(1:n, 1:n) + spread(row(1:n), 2, n)*spread(row(1:n), 1, n)/sum(q**2)
        right(1:n) = right(1:n) + row(1:n)*h(i)/sum(q**2)
      end associate
    end do
    scale = 1
    do i = 1, n
      if (gram(i, i) > 0) scale(i) = 1/sqrt(gram(i, i))
    end do
    gram = gram*spread(scale, 2, 5)*spread(scale, 1, 5)
    right = right*scale
    call solve_determined(gram(1:n, 1:n), right(1:n), n_undetermined)
    right = right*scale
    if (dimension == 2) right(2) = 0
    slope = matmul(principal, right(1:2))
  end subroutine fit_slope

  !> Principal axes of points and the origin about their mean, which follow the layers of a mesh, divided by the
  !> root-mean-square coordinates along them. An axis along which the points have no extent is zero.
  pure subroutine principal_axes(p, axes)
    real(dp), intent(in) :: p(:, :)  !! Points (2, n) [length].
    real(dp), intent(out) :: axes(2, 2)  !! Axes as columns (2, 2) [1/length].
    real(dp) :: xx, xy, yy, angle, extent(2), mean(2)
    integer :: i
    mean = sum(p, dim=2)/(size(p, 2) + 1)
    xx = sum(p(1, :)**2)/(size(p, 2) + 1) - mean(1)**2
    xy = sum(p(1, :)*p(2, :))/(size(p, 2) + 1) - mean(1)*mean(2)
    yy = sum(p(2, :)**2)/(size(p, 2) + 1) - mean(2)**2
    angle = 0
    if (abs(xy) > few_roundings*(xx + yy)) angle = atan2(2*xy, xx - yy)/2
    axes(:, 1) = [cos(angle), sin(angle)]
    axes(:, 2) = [-sin(angle), cos(angle)]
    do i = 1, 2
      extent(i) = sqrt(sum(matmul(axes(:, i), p)**2)/size(p, 2))
    end do
    do i = 1, 2
      if (extent(i) > shape_rounding*maxval(extent)) then
        axes(:, i) = axes(:, i)/extent(i)
      else
        axes(:, i) = 0
      end if
    end do
  end subroutine principal_axes

  !> Solve by Cholesky factorization, without the unknowns that those before them determine already: they are zero.
  pure subroutine solve_determined(a, b, n_undetermined)
    real(dp), intent(in) :: a(:, :)  !! Symmetric matrix with diagonal 1, or 0 of unknowns that are zero (n, n) [].
    real(dp), intent(inout) :: b(:)  !! Right-hand side; solution on return (n) [any].
    integer, intent(out) :: n_undetermined  !! Number of unknowns that are not determined.
    real(dp) :: l(size(b), size(b)), y(size(b)), pivot
    integer :: i, j
    n_undetermined = 0
    l = 0
    do j = 1, size(b)
      pivot = a(j, j) - sum(l(j, :j - 1)**2)
      if (pivot > min_pivot) then
        l(j, j) = sqrt(pivot)
        l(j + 1:, j) = [((a(i, j) - sum(l(i, :j - 1)*l(j, :j - 1)))/l(j, j), i=j + 1, size(b))]
        y(j) = (b(j) - sum(l(j, :j - 1)*y(:j - 1)))/l(j, j)
      else
        n_undetermined = n_undetermined + 1
        l(j, j) = 1
        y(j) = 0
      end if
    end do
    do j = size(b), 1, -1
      b(j) = (y(j) - sum(l(j + 1:, j)*b(j + 1:)))/l(j, j)
    end do
  end subroutine solve_determined
end module dotyk_contact_vertex_normals
