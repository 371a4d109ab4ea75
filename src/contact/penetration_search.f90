!> Penetration of one part into another after deformation: nodes of the one below the boundary of the other, and edges
!> that pass through it without a node inside.
!>
!> A depth counts where it exceeds what is allowed (penetration_tolerance.f90).
module dotyk_contact_penetration_search
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_thresholds, only: same_number
  use dotyk_contact_met_points, only: inside_point_t
  use dotyk_contact_passage_search, only: facet_parts, find_passage, max_parts, part_corners, passage_t, &
    place_at_part, swept_facets_t
  use dotyk_contact_penetration_tolerance, only: penetration_t, penetration_tolerance_t
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_contact_tree_search, only: box_neighbourhood_t, tree_walk_t
  use dotyk_mesh_element, only: kind_nodes
  use dotyk_ranks_division, only: distant_cost, division_t
  implicit none
  private
  public :: find_penetration, find_passages

  integer, parameter :: max_crossings = 32  !! Crossings of one segment that are kept.

  !> Points along the part of an edge that is inside, the middle first [], and steps of the search for the deepest one.
  real(dp), parameter :: sample(3) = [0.5_dp, 0.25_dp, 0.75_dp]
  integer, parameter :: n_steps = 30
  !> Nodes or facets that a thread takes at once, and the number from which on threads share them.
  integer, parameter :: chunk = 256, least_shared = 1024
  !> Numbers of a segment that is found, and segments that there is room for at first.
  integer, parameter :: segment_length = 8, first_room = 64
  real(dp), parameter :: golden = 0.381966011250105_dp  !! Golden section.

contains

  !> Depth of a part below the boundary of another one.
  subroutine find_penetration(division, a, b, tolerance, depth, worst, clear, inside)
    type(division_t), intent(in) :: division  !! How ranks divide nodes and facets.
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    !> Depth of each node that is too deep, or at an edge that is; 0 elsewhere (a%n_nodes) [length].
    real(dp), allocatable, intent(out) :: depth(:)
    type(penetration_t), intent(out) :: worst  !! The deepest point.
    !> Least distance of each node from b, 0 where it is not outside (a%n_nodes) [length].
    real(dp), allocatable, intent(out) :: clear(:)
    type(inside_point_t), allocatable, intent(out) :: inside(:)  !! Points that are too deep (n).
    logical :: is_below(a%n_nodes)
    real(dp) :: between(a%n_nodes)
    integer :: near(a%n_nodes), i, hint, known, first, last
    allocate (depth(a%n_nodes), source=0.0_dp)
    allocate (inside(0))
    is_below = .false.
    between = 0
    near = 0
    allocate (clear(a%n_nodes), source=0.0_dp)
    associate (box => b%tree%volume(1))
      call division%portion([(merge(distant_cost, 1.0_dp, any(a%x(:, i) < box%lo .or. a%x(:, i) > box%hi)), &
                              i=1, a%n_nodes)], first, last)
    end associate
    !$omp parallel default(none) shared(a, b, tolerance, depth, between, is_below, near, clear, first, last) &
    !$omp& private(hint, known) if (a%n_nodes > least_shared)
    hint = 0
    known = 0
    !$omp do schedule(dynamic, chunk)
    do i = first, last
      ! A node that is nearer to another one than that to b is outside as well.
      if (known > 0) clear(i) = clear(known) - norm2(a%x(:, i) - a%x(:, known))
      if (clear(i) > tolerance%slack) cycle
      call find_node_depth(a, b, i, tolerance, hint, clear(i), is_below(i), depth(i), between(i))
      near(i) = hint
      known = i
    end do
    !$omp end do
    !$omp end parallel
    call division%fill(clear, first, last)
    call division%fill(between, first, last)
    i = maxloc(between, 1)
    if (between(i) > 0) then
      worst%between_rows = between(i)
      worst%between_at = a%x(:, i)
    end if
    if (division%is_divided) call share_depths(division, is_below, depth)
    do i = 1, a%n_nodes
      if (.not. depth(i) > 0) cycle
      worst%n_nodes = worst%n_nodes + 1
      inside = [inside, inside_point_t(a%around(a%first(i)), [i, i], 0, a%x(:, i))]
      if (depth(i) <= (1 + same_number)*worst%depth) cycle
      worst%depth = depth(i)
      worst%position = a%x(:, i)
    end do
    call find_edges(division, a, b, tolerance, is_below, near, clear, depth, worst, inside)
  end subroutine find_penetration

  !> Make the depths of the nodes of all ranks known to all.
  subroutine share_depths(division, is_below, depth)
    type(division_t), intent(in) :: division  !! How ranks divide the nodes.
    logical, intent(inout) :: is_below(:)  !! Nodes below the boundary; of this rank in, of all out (n_nodes).
    real(dp), intent(inout) :: depth(:)  !! Depths that are not allowed, likewise (n_nodes) [length].
    real(dp), allocatable :: list(:, :)
    integer, allocatable :: node(:)
    integer :: i
    node = pack([(i, i=1, size(depth))], is_below .or. abs(depth) > 0)
    allocate (list(3, size(node)))
    list(1, :) = node
    list(2, :) = merge(1.0_dp, 0.0_dp, is_below(node))
    list(3, :) = depth(node)
    call division%append(list)
    node = nint(list(1, :))
    is_below(node) = list(2, :) > 0
    depth(node) = list(3, :)
  end subroutine share_depths

  !> Nodes of a part that have passed wholly through another one.
  subroutine find_passages(division, a, b, swept, tolerance, clear, depth, worst, inside)
    type(division_t), intent(in) :: division  !! How ranks divide the nodes.
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    type(swept_facets_t), intent(in) :: swept  !! Facets of the other part in motion.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    real(dp), intent(in) :: clear(:)  !! Least distance of each node from b after deformation (a%n_nodes) [length].
    !> Depth of each node; that of nodes that have passed through the other part is added, the distance from the face
    !> that they entered through (a%n_nodes) [length].
    real(dp), intent(inout) :: depth(:)
    type(penetration_t), intent(inout) :: worst  !! The deepest point; nodes are added.
    type(inside_point_t), allocatable, intent(inout) :: inside(:)  !! Points that have passed through are added (n).
    type(passage_t) :: passage
    real(dp) :: allowed, left, certain, centre(2), passed(a%n_nodes)
    integer :: entered(a%n_nodes), i, first, last
    passed = 0
    entered = 0
    call division%portion(a%n_nodes, first, last)
    !$omp parallel do default(none) private(passage, allowed, left, certain, centre) schedule(dynamic, chunk) &
    !$omp& shared(a, b, swept, tolerance, clear, depth, passed, entered, first, last) if (a%n_nodes > least_shared)
    do i = first, last
      if (depth(i) > 0) cycle
      ! Farther from b than the two have moved.
      if (clear(i) > norm2(a%x(:, i) - a%x0(:, i) - swept%shift) + swept%farthest) cycle
      call find_passage(a, i, b, swept, tolerance%slack, passage)
      if (passage%facet == 0) cycle
      centre = merge(1/3.0_dp, 0.0_dp, b%set%corners(passage%facet) == 3)
      call tolerance%find_allowed(a, [i], b, passage%facet, centre, &
                                  a%x(:, i), a%x(:, i) - a%x0(:, i), allowed, left, certain)
      ! Penalty moves nothing to the other side, a given gap may.
      if (.not. passage%through > allowed - left + max(tolerance%left_a%given, tolerance%left_b%given)) cycle
      passed(i) = -passage%depth
      entered(i) = passage%facet
    end do
    !$omp end parallel do
    call division%fill(passed, first, last)
    do i = 1, a%n_nodes
      if (abs(passed(i)) > 0) depth(i) = passed(i)
      if (.not. depth(i) < 0) cycle
      depth(i) = -depth(i)
      worst%n_passed = worst%n_passed + 1
      if (entered(i) > 0) inside = [inside, inside_point_t(a%around(a%first(i)), [i, i], entered(i), a%x(:, i))]
      if (depth(i) <= (1 + same_number)*worst%depth) cycle
      worst%depth = depth(i)
      worst%position = a%x(:, i)
    end do
  end subroutine find_passages

  !> Depth of a node that is not allowed; 0 where it is [length].
  pure subroutine find_node_depth(a, b, i, tolerance, hint, clear, is_below, depth, between)
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    integer, intent(in) :: i  !! Node of the part.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    integer, intent(inout) :: hint  !! Facet that is probably near, that of the last node; 0 for none.
    real(dp), intent(out) :: clear  !! Least distance from the other part, 0 where it is not outside [length].
    logical, intent(out) :: is_below  !! Whether the node is below the boundary, allowed or not.
    real(dp), intent(out) :: depth  !! Depth [length].
    real(dp), intent(out) :: between  !! As of `judge` [length].
    real(dp) :: xi(2), reach
    integer :: facet, other
    is_below = .false.
    depth = 0
    between = 0
    associate (box => b%tree%volume(1))
      clear = norm2(max(0.0_dp, box%lo - a%x(:, i), a%x(:, i) - box%hi))
    end associate
    if (clear > tolerance%slack) return
    call b%depth_of(a%x(:, i), hint, depth, facet, xi)
    hint = facet
    clear = max(0.0_dp, -depth)
    if (clear > tolerance%slack) then
      depth = 0
      return
    end if
    if (a%is_flush(i, b, facet)) then
      ! Farther and farther, until another facet is known to be the closest one.
      reach = max(tiny(reach), b%set%size(facet))
      do
        call b%depth_beside_flush(a%x(:, i), a, [i], .false., reach, depth, other, xi)
        if (other > 0 .or. reach > norm2(b%tree%volume(1)%hi - b%tree%volume(1)%lo)) exit
        reach = 2*reach
      end do
      if (other == 0) depth = 0
      if (other > 0) facet = other
    end if
    is_below = depth > tolerance%slack
    call tolerance%judge(a, [i], b, facet, xi, a%x(:, i), a%x(:, i) - a%x0(:, i), depth, between)
  end subroutine find_node_depth

  !> Edges that pass through another part, or run inside it between two nodes that are allowed.
  subroutine find_edges(division, a, b, tolerance, is_below, near, clear, depth, worst, inside)
    type(division_t), intent(in) :: division  !! How ranks divide the facets.
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    logical, intent(in) :: is_below(:)  !! Nodes below the boundary (a%n_nodes).
    integer, intent(in) :: near(:)  !! Facet of b that is nearest to each node, 0 where it is not known (a%n_nodes).
    !> Least distances of the nodes from b, 0 where they are not outside (a%n_nodes) [length].
    real(dp), intent(in) :: clear(:)
    !> Depth of each node that is too deep; on return also of those at an edge that is (a%n_nodes) [length].
    real(dp), intent(inout) :: depth(:)
    type(penetration_t), intent(inout) :: worst  !! The deepest point.
    type(inside_point_t), allocatable, intent(inout) :: inside(:)  !! Points that are too deep are added (n).
    real(dp), allocatable :: found(:, :), all_between(:, :)
    integer :: f, e, n, other, corners, ends(3), n_found, first, last
    n = a%set%n
    n_found = 0
    allocate (found(segment_length, first_room))
    call division%portion([(merge(distant_cost, 1.0_dp, is_far(f)), f=1, n)], first, last)
    !$omp parallel do default(none) private(e, other, corners, ends) schedule(dynamic, chunk) &
    !$omp& shared(a, b, tolerance, is_below, near, clear, n, n_found, found, first, last, worst) if (n > least_shared)
    do f = first, last
      if (is_far(f)) cycle
      corners = a%set%corners(f)
      do e = 1, merge(1, corners, corners == 2)
        other = 0
        if (corners > 2) other = a%adjacency%neighbour(e, f)
        if (other > 0) then
          if (other < f) cycle
          ! What passes through the inside of a plane face has nodes or edges of its own behind it.
          if (a%is_in_plane(f, other)) cycle
        end if
        ends(1) = a%surface%node(e, f)
        ends(2) = a%surface%node(modulo(e, corners) + 1, f)
        if (kind_nodes(a%surface%kind(f)) > corners) then
          ends(3) = a%surface%node(corners + e, f)
          call search_segment(f, e, ends([1, 3, 2]))
          call search_segment(f, e, ends([2, 3, 1]))
        else
          call search_segment(f, e, ends(1:2))
        end if
      end do
    end do
    !$omp end parallel do
    found = found(:, :n_found)
    call division%append(found)
    all_between = reshape([worst%between_rows, worst%between_at], [4, 1])
    call division%append(all_between)
    f = maxloc(all_between(1, :), 1)
    worst%between_rows = all_between(1, f)
    worst%between_at = all_between(2:, f)
    call keep_segments(found, depth, worst, inside)

  contains

    !> Whether a facet is outside of the box of the other part.
    pure logical function is_far(f)
      integer, intent(in) :: f  !! Facet.
      is_far = any(a%set%lo(:, f) > b%tree%volume(1)%hi .or. a%set%hi(:, f) < b%tree%volume(1)%lo)
    end function is_far

    !> Find the deepest point between two nodes of an edge. Its chord shows where it crosses the other part, depths are
    !> those of the edge itself.
    subroutine search_segment(f, e, nodes)
      integer, intent(in) :: f  !! A facet at it.
      integer, intent(in) :: e  !! Number of the edge there.
      integer, intent(in) :: nodes(:)  !! Its ends, and of a curved edge the third node (2 or 3).
      real(dp) :: s(max_crossings), deepest, place, raw, own, at, length
      real(dp), allocatable :: more(:, :)
      integer :: k, n_crossings, facet, j
      logical :: enters(max_crossings), is_inside
      ! No point of the edge is nearer to b than an end but for its way there.
      if (sum(clear(nodes(:2))) > longest_way(a%x(:, nodes))) return
      call crossings(b, a%x(:, nodes(1)), a%x(:, nodes(2)), tolerance%slack, n_crossings, s, enters)
      if (n_crossings == 0 .and. .not. all(is_below(nodes(:2)))) return
      length = norm2(a%x(:, nodes(2)) - a%x(:, nodes(1)))
      deepest = 0
      at = 0
      facet = maxval(near(nodes(:2)))
      do k = 0, n_crossings
        associate (low => merge(0.0_dp, s(max(k, 1)), k == 0), &
                   high => merge(1.0_dp, s(min(k + 1, size(s))), k == n_crossings))
          is_inside = n_crossings == 0
          if (k > 0) is_inside = enters(max(k, 1))
          if (k < n_crossings) is_inside = is_inside .or. .not. enters(k + 1)
          ! No point is deeper than it is far from a crossing.
          if (.not. is_inside .or. (high - low)*length <= tolerance%slack) cycle
          do j = 1, size(sample)
            place = low + (high - low)*sample(j)
            call segment_depth(nodes, place, raw, own, facet)
            ! The middle between two crossings is at least half as deep as any point, in a convex part.
            if (j == 1 .and. raw <= tolerance%slack/2) exit
            if (.not. own > deepest) cycle
            call deepen(nodes, low, high, place, own, facet)
            deepest = own
            at = place
          end do
        end associate
      end do
      if (.not. deepest > 0) return
      !$omp critical (penetration)
      if (n_found == size(found, 2)) then
        allocate (more(segment_length, 2*n_found))
        more(:, :n_found) = found
        call move_alloc(more, found)
      end if
      n_found = n_found + 1
      found(:, n_found) = [real([f, e, nodes(:2)], dp), deepest, matmul(a%x(:, nodes), edge_shape(size(nodes), at))]
      !$omp end critical (penetration)
    end subroutine search_segment

    !> Search for the deepest point near a point by golden section.
    subroutine deepen(nodes, low, high, place, own, facet)
      integer, intent(in) :: nodes(:)  !! Its nodes (2 or 3).
      real(dp), intent(in) :: low, high  !! Bounds of the place [].
      real(dp), intent(inout) :: place  !! Place on the segment, from 0 to 1 [].
      real(dp), intent(inout) :: own  !! Depth there that is not allowed [length].
      integer, intent(inout) :: facet  !! Facet of the closest point.
      real(dp) :: left, right, trial, raw, value
      integer :: step, hit
      hit = facet
      left = low
      right = high
      do step = 1, n_steps
        trial = merge(place + golden*(right - place), place - golden*(place - left), right - place > place - left)
        call segment_depth(nodes, trial, raw, value, hit)
        if (value > own) then
          if (trial > place) left = place
          if (trial < place) right = place
          place = trial
          own = value
          facet = hit
        else if (trial > place) then
          right = trial
        else
          left = trial
        end if
      end do
    end subroutine deepen

    !> Depth of a point of a segment that is not allowed; 0 where it is.
    subroutine segment_depth(nodes, place, raw, own, facet)
      integer, intent(in) :: nodes(:)  !! Its nodes (2 or 3).
      real(dp), intent(in) :: place  !! Place, from 0 to 1 [].
      real(dp), intent(out) :: raw  !! Depth, negative outside [length].
      real(dp), intent(out) :: own  !! Depth that is not allowed [length].
      integer, intent(inout) :: facet  !! Facet of the closest point; on entry one that is probably near, or 0.
      real(dp) :: x(3), u(3), xi(2), between
      integer :: hint
      x = matmul(a%x(:, nodes), edge_shape(size(nodes), place))
      u = x - matmul(a%x0(:, nodes), edge_shape(size(nodes), place))
      hint = facet
      call b%depth_of(x, hint, raw, facet, xi)
      own = raw
      call tolerance%judge(a, nodes(:2), b, facet, xi, x, u, own, between)
      if (.not. between > 0) return
      !$omp critical (penetration)
      if (between > worst%between_rows) then
        worst%between_rows = between
        worst%between_at = x
      end if
      !$omp end critical (penetration)
    end subroutine segment_depth
  end subroutine find_edges

  !> Bound of the length of an edge between its first two nodes [length].
  pure real(dp) function longest_way(x) result(length)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the edge (3, 2 or 3) [length].
    length = norm2(x(:, 2) - x(:, 1))
    ! The derivative is linear along the edge.
    if (size(x, 2) == 3) length = max(norm2(x(:, 3) - x(:, 1)), norm2(4*x(:, 2) - 3*x(:, 1) - x(:, 3)))/2
  end function longest_way

  !> Shape functions of the nodes of an edge at a place between the first two; a third one is beyond the second.
  pure function edge_shape(n, place) result(shape)
    integer, intent(in) :: n  !! Number of nodes, 2 or 3.
    real(dp), intent(in) :: place  !! Place, from 0 at the first to 1 at the second node [].
    real(dp) :: shape(n)  !! Values (n) [].
    shape(1:2) = [1 - place, place]
    ! Nodes at 0, 1 and 2.
    if (n == 3) shape = [(1 - place)*(2 - place)/2, place*(2 - place), place*(place - 1)/2]
  end function edge_shape

  !> Add the segments that are too deep to the deepest point, in the order of the facets.
  subroutine keep_segments(found, depth, worst, inside)
    !> The segments: facet, its edge, ends, depth and its position (segment_length, n).
    real(dp), intent(in) :: found(:, :)
    !> Depth of each node that is too deep; on return also of those at a segment that is (a%n_nodes) [length].
    real(dp), intent(inout) :: depth(:)
    type(penetration_t), intent(inout) :: worst  !! The deepest point.
    type(inside_point_t), allocatable, intent(inout) :: inside(:)  !! Points that are too deep are added (n).
    logical :: is_inside(size(depth))
    integer :: order(size(found, 2)), i
    is_inside = depth > 0
    call sort_order(found(1, :), order)
    do i = 1, size(order)
      associate (segment => found(:, order(i)), nodes => nint(found(3:4, order(i))))
        ! A node inside says it already.
        if (segment(5) > 0 .and. .not. any(is_inside(nodes))) then
          worst%n_edges = worst%n_edges + 1
          depth(nodes) = max(depth(nodes), segment(5))
          inside = [inside, inside_point_t(nint(segment(1)), nodes, 0, segment(6:8), nint(segment(2)))]
        end if
        if (segment(5) > (1 + same_number)*worst%depth) then
          worst%depth = segment(5)
          worst%position = segment(6:8)
        end if
      end associate
    end do
  end subroutine keep_segments

  !> Where a segment crosses the deformed boundary, ascending. Facets are passed over where both ends are nearer to
  !> their planes than they resolve.
  subroutine crossings(b, start, finish, slack, n, s, enters)
    type(solid_t), intent(in) :: b  !! The part.
    real(dp), intent(in) :: start(3)  !! First end (3) [length].
    real(dp), intent(in) :: finish(3)  !! Second end (3) [length].
    real(dp), intent(in) :: slack  !! Error of the displacements and of rounding [length].
    integer, intent(out) :: n  !! Number of crossings.
    !> Their places, from 0 at the first end to 1 at the second (max_crossings) [].
    real(dp), intent(out) :: s(max_crossings)
    !> Whether the segment enters the part there; otherwise it leaves it (max_crossings).
    logical, intent(out) :: enters(max_crossings)
    type(box_neighbourhood_t) :: region
    type(tree_walk_t) :: walk
    real(dp) :: corner(3, 3), first, second, at, inside
    integer :: f, k, n_parts, part(3, max_parts)
    n = 0
    s = 0
    enters = .false.
    region%low = min(start, finish)
    region%high = max(start, finish)
    call walk%start(b%tree)
    do
      call walk%next(b%tree, region, f)
      if (f == 0) exit
      call facet_parts(b%surface%node(:, f), b%set%corners(f), n_parts, part)
      do k = 1, n_parts
        corner = part_corners(b%x, part(:, k))
        call place_at_part(corner, start, first, inside)
        call place_at_part(corner, finish, second, inside)
        if (first*second > 0 .or. max(abs(first), abs(second)) <= slack + b%roughness(f)) cycle
        at = first/(first - second)
        call place_at_part(corner, start + at*(finish - start), second, inside)
        if (inside >= -same_number) call keep(at, first > 0)
      end do
    end do

  contains

    !> Keep a crossing.
    subroutine keep(place, is_entry)
      real(dp), intent(in) :: place  !! Place on the segment [].
      logical, intent(in) :: is_entry  !! Whether the segment enters the part.
      integer :: i
      if (n == max_crossings) return
      do i = n, 1, -1
        if (s(i) <= place) exit
        s(i + 1) = s(i)
        enters(i + 1) = enters(i)
      end do
      s(i + 1) = place
      enters(i + 1) = is_entry
      n = n + 1
    end subroutine keep
  end subroutine crossings
end module dotyk_contact_penetration_search
