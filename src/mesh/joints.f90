!> Whether the parts of one body hang together: cracks and hanging nodes that nobody sees in a mesh.
!>
!> Boundary facets that face each other at no distance are an interface whose two sides do not share their nodes: nodes
!> at the same place (a crack), meshes of two sizes (hanging nodes), a quadrilateral and two triangles. Found by points
!> of the facets, which lie on another facet of opposite normal; a sweep along the longest edge of the bounding box
!> finds the pairs.
module dotyk_mesh_joints
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: counted, to_text
  use dotyk_base_thresholds, only: generic_direction, of_mesh, opposite_cosine, same_place
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_boundary, only: boundary_facets_t, max_corners
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  type, public :: joints_t  !! How the parts of a body hang together.
    integer :: n_parts = 1  !! Number of unconnected parts.
    integer :: n_pieces = 1  !! Pieces that no whole face joins; above `n_parts` where edges or corners join some.
    character(:), allocatable :: crack  !! What joins no parts although it seems to; not allocated where all is well.
    !> Why elements overlap or do not match, which nobody can mean; not allocated where all is well.
    character(:), allocatable :: fault
    character(:), allocatable :: slit  !! Slit that hardly is one; not allocated where there is none.
  contains
    procedure :: find => joints_find
    procedure :: carry => joints_carry
  end type joints_t

  type :: findings_t  !! Findings of the comparison of facets.
    logical, allocatable :: touches(:)  !! Whether a facet lies on another one, with other nodes (n).
    logical, allocatable :: overlaps(:)  !! Whether a facet is inside another part (n).
    logical, allocatable :: close(:)  !! Whether a facet is close to another one (n).
    real(dp) :: depth = 0, width = 0  !! Greatest depth of an overlap, and greatest width of a slit [length].
  end type findings_t

  !> Parts overlap up to this fraction of the size of elements, as they do where polygons stand for one arc.
  real(dp), parameter :: deepest = 0.2_dp
  !> Sample points of a facet: its centre, and this far from it to each corner [].
  real(dp), parameter, public :: towards_corner = 0.9_dp

contains

  !> Look how the parts of a body hang together.
  subroutine joints_find(self, mesh)
    class(joints_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(boundary_facets_t) :: facets
    real(dp) :: shortest(mesh%n_nodes())
    integer :: component(mesh%n_nodes())
    call connected_components(mesh, component, self%n_parts)
    call facets%find(mesh)
    self%n_pieces = facets%n_pieces
    call find_shortest_edges(mesh, shortest)
    call judge(self, mesh, facets, component, shortest)
  end subroutine joints_find

  !> Shortest edge or diagonal of the elements at each node: what is small beside it is no thickness of elements.
  pure subroutine find_shortest_edges(mesh, shortest)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    real(dp), intent(out) :: shortest(:)  !! Lengths; huge at nodes that are no corners (n_nodes) [length].
    type(element_kind_t) :: kind
    real(dp) :: length
    integer :: b, e, i, j, n, p, q
    shortest = huge(shortest)
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      n = kind%n_corners
      do e = 1, size(mesh%block(b)%tag)
        do i = 2, n
          p = mesh%block(b)%node(i, e)
          do j = 1, i - 1
            q = mesh%block(b)%node(j, e)
            length = norm2(mesh%x(:, p) - mesh%x(:, q))
            shortest(p) = min(shortest(p), length)
            shortest(q) = min(shortest(q), length)
          end do
        end do
      end do
    end do
  end subroutine find_shortest_edges

  !> Judge the findings.
  subroutine judge(self, mesh, facets, component, shortest)
    class(joints_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Mesh with the nodes of the facets.
    type(boundary_facets_t), intent(in) :: facets  !! Boundary facets.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    real(dp), intent(in) :: shortest(:)  !! Shortest edge at each node (n_nodes) [length].
    type(findings_t) :: found
    integer :: pair(2), n_pairs
    character(:), allocatable :: unit
    allocate (found%touches(facets%n), found%overlaps(facets%n), found%close(facets%n), source=.false.)
    call compare_facets(mesh, facets, component, shortest, found)
    call find_coincident_nodes(mesh, facets, shortest, n_pairs, pair)
    unit = merge('an area  ', 'a length ', mesh%dimension == 3)
    if (n_pairs > 0) then
      self%crack = 'nodes '//to_text(mesh%node_tag(pair(1)))//' and '//to_text(mesh%node_tag(pair(2)))// &
                   ' lie at the same place '//position_text(mesh%x(:, pair(1)))//' ('// &
                   counted(n_pairs, 'such pair')//')'
      if (any(found%touches)) self%crack = self%crack//', and faces of the body touch there'
    else if (any(found%touches)) then
      self%crack = 'faces of the body touch whose meshes do not match: nodes of one side hang on the other'
    end if
    if (any(found%touches)) &
      self%crack = self%crack//', over '//trim(unit)//' of about '// &
                   to_text(sum(facets%area, mask=found%touches)/2, 3)//', near '//places(found%touches)
    if (facets%faults%n_shared > 0) then
      self%fault = 'elements overlap: '//counted(facets%faults%n_shared, 'face')// &
                   ' of more than two elements, near '//position_text(facets%faults%shared_position(:mesh%dimension))
    else if (facets%faults%n_mixed > 0) then
      self%fault = 'elements '//to_text(facets%faults%mixed(1))//' and '//to_text(facets%faults%mixed(2))//' near '// &
                   position_text(facets%faults%mixed_position(:mesh%dimension))// &
                   ' have other nodes on their common face ('//counted(facets%faults%n_mixed, 'such face')//'): '
      if (facets%faults%mixed_kinds) then
        self%fault = self%fault//'give all elements of a body one order'
      else
        self%fault = self%fault//'give it the same nodes, as gmsh does with `Coherence Mesh;`'
      end if
    else if (any(found%overlaps)) then
      self%fault = 'unconnected parts of the body overlap by up to '//to_text(found%depth, 2)//', near '// &
                   places(found%overlaps)//': join them in gmsh (`BooleanFragments` and `Coherence;`), or make '// &
                   'them separate bodies'
    end if
    if (any(found%close .and. .not. found%touches)) &
      self%slit = 'faces that are not connected are '//to_text(found%width, 2)// &
                  ' apart or less, a thousandth of an element, near '//places(found%close .and. .not. found%touches)

  contains

    !> The first, middle and last of some facets.
    function places(chosen) result(text)
      logical, intent(in) :: chosen(:)  !! Whether a facet is meant (n).
      character(:), allocatable :: text
      integer :: all(count(chosen)), i, k
      all = pack([(i, i=1, size(chosen))], chosen)
      text = position_text(facets%centre(:mesh%dimension, all(1)))
      do k = 2, min(3, size(all))
        i = all(merge((size(all) + 1)/2, size(all), k == 2 .and. size(all) > 2))
        text = text//', '//position_text(facets%centre(:mesh%dimension, i))
      end do
    end function places
  end subroutine judge

  !> Compare all pairs of facets that are near each other and face each other.
  subroutine compare_facets(mesh, facets, component, shortest, found)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(boundary_facets_t), intent(in) :: facets  !! Boundary facets.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    real(dp), intent(in) :: shortest(:)  !! Shortest edge at each node (n_nodes) [length].
    type(findings_t), intent(inout) :: found  !! Findings; completed.
    real(dp), allocatable :: lo(:, :), hi(:, :), size_of(:)
    integer, allocatable :: order(:)
    real(dp) :: x(3, max_corners), h, thinnest
    integer :: i, j, k, m, n, axis
    n = facets%n
    if (n == 0) return
    allocate (lo(3, n), hi(3, n), size_of(n), order(n))
    do i = 1, n
      m = facets%n_corners(i)
      call corners_of(mesh, facets, i, x)
      size_of(i) = facets%area(i)
      if (mesh%dimension == 3) size_of(i) = sqrt(size_of(i))
      lo(:, i) = minval(x(:, :m), dim=2) - deepest*size_of(i)
      hi(:, i) = maxval(x(:, :m), dim=2) + deepest*size_of(i)
    end do
    axis = maxloc(maxval(hi, dim=2) - minval(lo, dim=2), dim=1)
    call sort_order(lo(axis, :), order)
    do k = 1, n
      i = order(k)
      do m = k + 1, n
        j = order(m)
        if (lo(axis, j) > hi(axis, i)) exit
        if (dot_product(facets%normal(:, i), facets%normal(:, j)) > opposite_cosine) cycle
        if (any(lo(:, j) > hi(:, i)) .or. any(lo(:, i) > hi(:, j))) cycle
        if (facets%element(i) == facets%element(j)) cycle
        h = min(size_of(i), size_of(j))
        thinnest = min(h, minval(shortest(facets%corner(:facets%n_corners(i), i))), &
                       minval(shortest(facets%corner(:facets%n_corners(j), j))))
        call compare(mesh, facets, i, j, component, h, thinnest, found)
        call compare(mesh, facets, j, i, component, h, thinnest, found)
      end do
    end do
  end subroutine compare_facets

  !> Compare points of facet i with facet j.
  subroutine compare(mesh, facets, i, j, component, h, thinnest, found)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(boundary_facets_t), intent(in) :: facets  !! Boundary facets.
    integer, intent(in) :: i  !! Facet whose points are taken.
    integer, intent(in) :: j  !! Facet on which they may lie.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    real(dp), intent(in) :: h  !! Size of the smaller facet [length].
    real(dp), intent(in) :: thinnest  !! The same, or the shortest edge of the elements there if less [length].
    type(findings_t), intent(inout) :: found  !! Findings; completed.
    real(dp) :: x(3, max_corners), y(3, max_corners), p(3), gap
    integer :: k, n
    n = facets%n_corners(i)
    ! A triangle on a warped quadrilateral lies on it at its corners only.
    if (n < facets%n_corners(j)) then
      if (all([(any(facets%corner(:, j) == facets%corner(k, i)), k=1, n)])) then
        found%touches([i, j]) = .true.
        return
      end if
    end if
    call corners_of(mesh, facets, i, x)
    call corners_of(mesh, facets, j, y)
    do k = 0, n
      p = facets%centre(:, i)
      if (k > 0) p = p + towards_corner*(x(:, k) - p)
      gap = dot_product(p - facets%centre(:, j), facets%normal(:, j))
      if (abs(gap) > deepest*h) cycle
      if (.not. is_over(facets%n_corners(j), y, facets%normal(:, j), p)) cycle
      if (abs(gap) <= same_place*thinnest) then
        found%touches(i) = .true.
      else if (gap > 0) then
        if (gap > of_mesh*thinnest) cycle
        found%close(i) = .true.
        found%width = max(found%width, gap)
      else if (component(facets%corner(1, i)) /= component(facets%corner(1, j))) then
        ! The two sides of a thin part look the same, but are connected.
        found%overlaps(i) = .true.
        found%depth = max(found%depth, -gap)
      end if
    end do
  end subroutine compare

  !> Whether a point lies over a convex facet.
  pure logical function is_over(n, x, normal, p)
    integer, intent(in) :: n  !! Number of corners.
    real(dp), intent(in) :: x(3, max_corners)  !! Corners (3, max_corners) [length].
    real(dp), intent(in) :: normal(3)  !! Unit normal (3) [].
    real(dp), intent(in) :: p(3)  !! The point (3) [length].
    real(dp) :: edge(3)
    integer :: k
    is_over = .false.
    if (n == 2) then
      edge = x(:, 2) - x(:, 1)
      is_over = abs(dot_product(p - (x(:, 1) + x(:, 2))/2, edge)) < dot_product(edge, edge)/2
      return
    end if
    do k = 1, n
      edge = x(:, mod(k, n) + 1) - x(:, k)
      if (dot_product(cross(edge, p - x(:, k)), normal) <= 0) return
    end do
    is_over = .true.
  end function is_over

  !> Corners of a facet in three components.
  pure subroutine corners_of(mesh, facets, i, x)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(boundary_facets_t), intent(in) :: facets  !! Boundary facets.
    integer, intent(in) :: i  !! Facet.
    real(dp), intent(out) :: x(3, max_corners)  !! Corners, padded with 0 (3, max_corners) [length].
    integer :: n
    n = facets%n_corners(i)
    x = 0
    x(:mesh%dimension, :n) = mesh%x(:, facets%corner(:n, i))
  end subroutine corners_of

  !> Find nodes at the same place. Only such on the boundary can be: the elements between others would have no volume.
  subroutine find_coincident_nodes(mesh, facets, shortest, n_pairs, first)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(boundary_facets_t), intent(in) :: facets  !! Boundary facets.
    real(dp), intent(in) :: shortest(:)  !! Shortest edge at each node (n_nodes) [length].
    integer, intent(out) :: n_pairs  !! Number of pairs.
    integer, intent(out) :: first(2)  !! The first pair (2).
    real(dp), allocatable :: along(:), tolerance(:)
    integer, allocatable :: order(:), node(:)
    logical, allocatable :: on_boundary(:)
    real(dp) :: widest
    integer :: i, j, n
    allocate (on_boundary(0:mesh%n_nodes()), source=.false.)
    do i = 1, facets%n
      on_boundary(facets%corner(:, i)) = .true.
    end do
    node = pack([(i, i=1, size(shortest))], on_boundary(1:))
    tolerance = same_place*shortest(node)
    along = matmul(generic_direction(:mesh%dimension), mesh%x(:, node))
    allocate (order(size(node)))
    call sort_order(along, order)
    widest = maxval(tolerance)
    n_pairs = 0
    first = 0
    n = size(order)
    do i = 1, n
      do j = i + 1, n
        if (along(order(j)) - along(order(i)) > 2*widest) exit
        if (norm2(mesh%x(:, node(order(j))) - mesh%x(:, node(order(i)))) > &
            min(tolerance(order(i)), tolerance(order(j)))) cycle
        n_pairs = n_pairs + 1
        if (n_pairs == 1) first = [min(node(order(i)), node(order(j))), max(node(order(i)), node(order(j)))]
      end do
    end do
  end subroutine find_coincident_nodes

  !> Coordinates, for messages.
  pure function position_text(x) result(text)
    real(dp), intent(in) :: x(:)  !! Coordinates (dimension) [length].
    character(:), allocatable :: text
    integer :: k
    text = '('//to_text(x(1), 4)
    do k = 2, size(x)
      text = text//', '//to_text(x(k), 4)
    end do
    text = text//')'
  end function position_text

  !> Put what was found into a parcel, or take it out.
  subroutine joints_carry(self, parcel)
    class(joints_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%n_parts)
    call parcel%carry(self%n_pieces)
    call parcel%carry(self%crack)
    call parcel%carry(self%fault)
    call parcel%carry(self%slit)
  end subroutine joints_carry
end module dotyk_mesh_joints
