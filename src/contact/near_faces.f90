!> The search for faces that may come into contact, over the boundary facets of all bodies.
!>
!> Two facets of different bodies may come into contact where they face each other, are no farther apart than the search
!> distance, lie in front of each other (or overlap by less than half the thickness of the bodies), and no third body
!> lies between them. Bounding-volume trees, one of the bodies and one of the facets of each, make the search
!> O(N log N). Lengths and angles of the facets themselves decide, not their boxes: a rotation of the scene changes
!> nothing.
module dotyk_contact_near_faces
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: of_mesh, pi
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_near_facets, only: find_facets, greatest_overlap, near_faces_t, search_distance, share_near
  use dotyk_contact_tree_search, only: box_neighbourhood_t, facets_in_region
  use dotyk_mesh_joints, only: towards_corner
  use dotyk_ranks_communication, only: this_rank
  use dotyk_ranks_division, only: deal_out, division_t, least_divided
  use dotyk_ranks_exchange, only: all_ranks
  implicit none
  private

  public :: find_near_faces

  !> Cosine of the greatest angle between parallel edges: 5 degrees [].
  real(dp), parameter :: parallel_cosine = 0.9962_dp

  integer, parameter :: many_pairs = 32  !! From so many pairs of bodies on, threads share the pairs.

contains

  !> Find all faces that may come into contact.
  subroutine find_near_faces(faces, given, near, named, named_reach)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    real(dp), intent(in) :: given  !! Search distance that the user gives, or 0 [length].
    !> Facets that may come into contact, by pairs of bodies in ascending order (n_pairs).
    type(near_faces_t), allocatable, intent(out) :: near(:)
    !> Pairs of bodies of which facets farther apart than `named_reach` may be omitted (2, n_named).
    integer, intent(in), optional :: named(:, :)
    real(dp), intent(in), optional :: named_reach  !! Distance, as a fraction of the diameter of the smaller body [].
    type(near_faces_t), allocatable :: found(:)
    logical, allocatable :: kept(:)
    real(dp), allocatable :: most(:)
    integer, allocatable :: owner(:)
    integer :: k, i
    call near_bodies(faces, given, found)
    allocate (most(size(found)), source=huge(1.0_dp))
    if (present(named)) call limit_named(faces, found, named, named_reach, most)
    owner = deal_out(real(faces(found%body_a)%n + faces(found%body_b)%n, dp), least_divided)
    ! The threads share the facets of few pairs of bodies.
    !$omp parallel do default(none) shared(faces, given, found, most, owner) schedule(dynamic, 4) &
    !$omp& if (size(found) >= many_pairs)
    do k = 1, size(found)
      if (owner(k) == this_rank()) call find_between(faces, given, most(k), division_t(), found(k))
    end do
    !$omp end parallel do
    do k = 1, size(found)
      if (owner(k) == all_ranks) call find_between(faces, given, most(k), division_t(.true.), found(k))
    end do
    call share_near(owner, found)
    call drop_hidden(faces, found)
    call add_edges(faces, found)
    allocate (kept(size(found)))
    kept = found%n > 0
    allocate (near(count(kept)))
    i = 0
    do k = 1, size(found)
      if (.not. kept(k)) cycle
      i = i + 1
      near(i) = found(k)
    end do
  end subroutine find_near_faces

  !> Find the faces of two bodies that may come into contact.
  subroutine find_between(faces, given, most, division, near)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    real(dp), intent(in) :: given  !! Search distance that the user gives, or 0 [length].
    real(dp), intent(in) :: most  !! Bound of the search distance [length].
    type(division_t), intent(in) :: division  !! How ranks divide the facets.
    type(near_faces_t), intent(inout) :: near  !! The two bodies; their facets are set.
    call find_facets(faces(near%body_a), faces(near%body_b), given, near, most, division)
    if (.not. most < huge(most) .or. any(near%opposite)) return
    ! Bodies that do not lie opposite each other may meet along edges.
    call find_facets(faces(near%body_a), faces(near%body_b), given, near, division=division)
  end subroutine find_between

  !> Bound the search distance of named pairs of bodies that are near no other body: their far facets decide nothing.
  subroutine limit_named(faces, near, named, named_reach, most)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    type(near_faces_t), intent(in) :: near(:)  !! Pairs of bodies that are near each other (n_pairs).
    integer, intent(in) :: named(:, :)  !! Named pairs of bodies (2, n_named).
    real(dp), intent(in) :: named_reach  !! Distance, as a fraction of the diameter of the smaller body [].
    !> Bounds of the search distance; those of such pairs are set (n_pairs) [length].
    real(dp), intent(inout) :: most(:)
    integer :: k, n_near(size(faces))
    n_near = 0
    do k = 1, size(near)
      n_near(near(k)%body_a) = n_near(near(k)%body_a) + 1
      n_near(near(k)%body_b) = n_near(near(k)%body_b) + 1
    end do
    do k = 1, size(near)
      associate (a => near(k)%body_a, b => near(k)%body_b)
        if (max(n_near(a), n_near(b)) > 1) cycle
        if (any(minval(named, 1) == a .and. maxval(named, 1) == b)) &
          most(k) = named_reach*min(faces(a)%diameter, faces(b)%diameter)
      end associate
    end do
  end subroutine limit_named

  !> Mark the facets of bodies that meet along edges only. Where other bodies lie opposite the flanks, as where four
  !> bricks meet, these carry the contact.
  subroutine add_edges(faces, near)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    type(near_faces_t), intent(inout) :: near(:)  !! Facets that are near each other, by pairs of bodies (n_pairs).
    integer :: offset(size(faces) + 1), b, i, k
    logical, allocatable :: is_covered(:)
    offset(1) = 0
    do b = 1, size(faces)
      offset(b + 1) = offset(b) + faces(b)%n
    end do
    allocate (is_covered(offset(size(faces) + 1)), source=.false.)
    do k = 1, size(near)
      do i = 1, near(k)%n
        if (.not. near(k)%opposite(i)) cycle
        is_covered(offset(near(k)%body_a) + near(k)%facet_a(i)) = .true.
        is_covered(offset(near(k)%body_b) + near(k)%facet_b(i)) = .true.
      end do
    end do
    do k = 1, size(near)
      if (any(near(k)%opposite(:near(k)%n))) cycle
      do i = 1, near(k)%n
        associate (a => near(k)%body_a, f => near(k)%facet_a(i), g => near(k)%facet_b(i))
          if (is_covered(offset(a) + f) .or. is_covered(offset(near(k)%body_b) + g)) cycle
          near(k)%opposite(i) = meet_along_edges(faces(a), f, faces(near(k)%body_b), g)
        end associate
      end do
    end do
  end subroutine add_edges

  !> Pairs of bodies whose boxes are within the search distance.
  subroutine near_bodies(faces, given, near)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    real(dp), intent(in) :: given  !! Search distance that the user gives, or 0 [length].
    type(near_faces_t), allocatable, intent(out) :: near(:)  !! Pairs of bodies, ascending, without facets (n_pairs).
    type(near_faces_t), allocatable :: longer(:)
    type(facet_set_t) :: set
    type(bounding_volume_tree_t) :: tree
    type(box_neighbourhood_t) :: region
    integer, allocatable :: list(:)
    integer :: b, i, n
    set%n = size(faces)
    set%dimension = 3
    allocate (set%lo(3, set%n), set%hi(3, set%n), set%axis(3, set%n), set%half_angle(set%n))
    do b = 1, set%n
      set%lo(:, b) = faces(b)%lo
      set%hi(:, b) = faces(b)%hi
    end do
    set%axis = 0
    set%half_angle = pi
    call tree%init(set)
    allocate (near(8*set%n))
    n = 0
    do b = 1, set%n
      region%low = faces(b)%lo
      region%high = faces(b)%hi
      region%distance = search_distance(faces(b), faces(b), given)
      call facets_in_region(tree, region, list)
      do i = 1, size(list)
        if (list(i) <= b .or. faces(b)%n == 0 .or. faces(list(i))%n == 0) cycle
        if (n == size(near)) then
          allocate (longer(2*n))
          longer(:n) = near
          call move_alloc(longer, near)
        end if
        n = n + 1
        near(n)%body_a = b
        near(n)%body_b = list(i)
      end do
    end do
    allocate (longer(n))
    longer = near(:n)
    call move_alloc(longer, near)
  end subroutine near_bodies

  !> Drop pairs of facets with another body in between.
  subroutine drop_hidden(faces, near)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    !> Facets that are near each other, by pairs of bodies; hidden ones are dropped (n_pairs).
    type(near_faces_t), intent(inout) :: near(:)
    integer, allocatable :: start(:), neighbour(:), fill(:), first(:), offset(:)
    logical, allocatable :: several(:)
    integer :: b, k, i
    ! Facets of all bodies are numbered one after the other: those with one partner body have nothing in between.
    allocate (offset(size(faces) + 1), start(size(faces) + 1))
    offset(1) = 0
    do b = 1, size(faces)
      offset(b + 1) = offset(b) + faces(b)%n
    end do
    allocate (first(offset(size(faces) + 1)), several(offset(size(faces) + 1)))
    first = 0
    several = .false.
    start = 0
    do k = 1, size(near)
      if (near(k)%n == 0) cycle
      call mark(offset(near(k)%body_a), near(k)%facet_a, k)
      call mark(offset(near(k)%body_b), near(k)%facet_b, k)
      start(near(k)%body_a + 1) = start(near(k)%body_a + 1) + 1
      start(near(k)%body_b + 1) = start(near(k)%body_b + 1) + 1
    end do
    ! Bodies near body b are neighbour(start(b)+1:start(b+1)).
    do b = 1, size(faces)
      start(b + 1) = start(b) + start(b + 1)
    end do
    allocate (neighbour(2*size(near)))
    fill = start(:size(faces))
    do k = 1, size(near)
      if (near(k)%n == 0) cycle
      do i = 1, 2
        b = merge(near(k)%body_a, near(k)%body_b, i == 1)
        fill(b) = fill(b) + 1
        neighbour(fill(b)) = merge(near(k)%body_b, near(k)%body_a, i == 1)
      end do
    end do
    !$omp parallel do default(none) shared(faces, near, offset, several, start, neighbour) private(b, i) &
    !$omp& schedule(dynamic, 4)
    do k = 1, size(near)
      b = near(k)%body_a
      i = near(k)%body_b
      call keep_visible(faces, several(offset(b) + 1:offset(b + 1)), several(offset(i) + 1:offset(i + 1)), &
                        neighbour(start(b) + 1:start(b + 1)), neighbour(start(i) + 1:start(i + 1)), near(k))
    end do
    !$omp end parallel do

  contains

    !> Mark the facets of one side of a pair of bodies.
    subroutine mark(before, facet, pair)
      integer, intent(in) :: before  !! Number of the facets of the bodies before.
      integer, intent(in) :: facet(:)  !! Facets of the side (n).
      integer, intent(in) :: pair  !! The pair of bodies.
      integer :: j
      do j = 1, size(facet)
        associate (known => first(before + facet(j)))
          if (known == 0) known = pair
          if (known /= pair) several(before + facet(j)) = .true.
        end associate
      end do
    end subroutine mark
  end subroutine drop_hidden

  !> Keep those facets of two bodies that can see each other from one side at least.
  subroutine keep_visible(faces, several_a, several_b, neighbour_a, neighbour_b, near)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    !> Whether a facet of the first body has several partner bodies (number of its facets).
    logical, intent(in) :: several_a(:)
    logical, intent(in) :: several_b(:)  !! The same of the second body (number of its facets).
    integer, intent(in) :: neighbour_a(:)  !! Bodies near the first one (n_near).
    integer, intent(in) :: neighbour_b(:)  !! Bodies near the second one (n_near).
    type(near_faces_t), intent(inout) :: near  !! The two bodies; hidden facets are dropped.
    real(dp), allocatable :: sight_a(:), sight_b(:)
    logical :: kept(near%n)
    integer :: i, a, b
    real(dp), parameter :: unknown = -2
    kept = .not. (several_a(near%facet_a) .and. several_b(near%facet_b))
    if (all(kept)) return
    a = near%body_a
    b = near%body_b
    allocate (sight_a(size(several_a)), sight_b(size(several_b)))
    sight_a = unknown
    sight_b = unknown
    do i = 1, near%n
      if (kept(i)) cycle
      associate (f => near%facet_a(i), g => near%facet_b(i))
        if (sight_a(f) <= unknown) sight_a(f) = sight(faces, a, f, neighbour_a, b)
        if (sight_b(g) <= unknown) sight_b(g) = sight(faces, b, g, neighbour_b, a)
        ! What one facet does not see is hidden unless the other one sees it.
        kept(i) = near%distance(i) <= max(sight_a(f), sight_b(g)) .or. max(sight_a(f), sight_b(g)) < 0
      end associate
    end do
    near%facet_a = pack(near%facet_a, kept)
    near%facet_b = pack(near%facet_b, kept)
    near%distance = pack(near%distance, kept)
    near%opposite = pack(near%opposite, kept)
    near%n = count(kept)
  end subroutine keep_visible

  !> How far a facet sees in the direction of its normal, from the best of its sample points that have the body that it
  !> looks for before them, up to the middle of another body; -1 without such points [length].
  real(dp) function sight(faces, body, facet, neighbour, target)
    type(body_faces_t), intent(in) :: faces(:)  !! Boundary facets of the bodies (n_bodies).
    integer, intent(in) :: body  !! Body of the facet.
    integer, intent(in) :: facet  !! The facet.
    integer, intent(in) :: neighbour(:)  !! Bodies near that body (n_near).
    integer, intent(in) :: target  !! Body that it looks for.
    real(dp) :: point(3), centre(3), enters, leaves, free
    integer :: s, i
    sight = -1
    centre = faces(body)%centre(facet)
    do s = 0, faces(body)%n_corners(facet)
      point = centre
      if (s > 0) point = centre + towards_corner*(faces(body)%corner(:, s, facet) - centre)
      call look_at(target)
      if (.not. leaves < huge(leaves)) cycle
      free = huge(free)
      do i = 1, size(neighbour)
        if (neighbour(i) == target) cycle
        call look_at(neighbour(i))
        if (leaves < huge(leaves)) free = min(free, (max(enters, 0.0_dp) + leaves)/2)
      end do
      sight = max(sight, free)
    end do

  contains

    !> Where a body is before the sample point.
    subroutine look_at(b)
      integer, intent(in) :: b  !! The body.
      associate (other => faces(b))
        call other%cross_along(point, faces(body)%normal(:, facet), -greatest_overlap*other%diameter, &
                               2*faces(body)%diameter + other%diameter, 0, enters, leaves)
      end associate
    end subroutine look_at
  end function sight

  !> Whether two facets in three dimensions meet along edges that are parallel, side by side at least in part.
  pure logical function meet_along_edges(a, f, b, g) result(meet)
    type(body_faces_t), intent(in) :: a  !! First body.
    integer, intent(in) :: f  !! Its facet.
    type(body_faces_t), intent(in) :: b  !! Second body.
    integer, intent(in) :: g  !! Its facet.
    real(dp), dimension(3) :: p, along, q, other
    real(dp) :: first, last, length, reach
    integer :: i, j
    meet = .false.
    reach = of_mesh*min(a%diameter, b%diameter)
    if (a%n_corners(f) < 3) return
    do i = 1, a%n_corners(f)
      p = a%corner(:, i, f)
      along = a%corner(:, modulo(i, a%n_corners(f)) + 1, f) - p
      length = norm2(along)
      do j = 1, b%n_corners(g)
        q = b%corner(:, j, g)
        other = b%corner(:, modulo(j, b%n_corners(g)) + 1, g) - q
        ! False for edges of no length, those of collapsed facets, too.
        if (.not. abs(dot_product(along, other)) > parallel_cosine*length*norm2(other)) cycle
        first = dot_product(q - p, along)/length
        last = dot_product(q + other - p, along)/length
        if (norm2(q - p - first/length*along) > reach .or. norm2(q + other - p - last/length*along) > reach) cycle
        meet = meet .or. min(max(first, last), length) - max(min(first, last), 0.0_dp) > reach
      end do
    end do
  end function meet_along_edges
end module dotyk_contact_near_faces
