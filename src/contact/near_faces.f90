!> The search for faces that may come into contact, over the boundary facets of all bodies.
!>
!> Two facets of different bodies may come into contact where they face each other, are no farther apart than the search
!> distance, lie in front of each other (or overlap by less than half the thickness of the bodies), and no third body
!> lies between them. Bounding-volume trees, one of the bodies and one of the facets of each, make the search
!> O(N log N). Lengths and angles of the facets themselves decide, not their boxes: a rotation of the scene changes
!> nothing.
module dotyk_contact_near_faces
  use dotyk_base_kinds, only: dp
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_facing_facets, only: compare_facets, greatest_overlap, search_distance
  use dotyk_contact_meeting_edges, only: meet_along_edges
  use dotyk_contact_tree_search, only: box_neighbourhood_t, facets_in_region
  implicit none
  private

  !> Facets of two bodies that may come into contact.
  type, public :: near_faces_t
    !> Index of the first body, the lower one.
    integer :: body_a = 0
    !> Index of the second body.
    integer :: body_b = 0
    !> Number of pairs of facets.
    integer :: n = 0
    !> Facets of the first body (n).
    integer, allocatable :: facet_a(:)
    !> Facets of the second body opposite them (n).
    integer, allocatable :: facet_b(:)
    !> Smallest distance of each pair of facets; negative where they overlap (n) [length].
    real(dp), allocatable :: distance(:)
    !> Whether they lie opposite each other, seen along their normals, and not just beside each other; of bodies without
    !> such facets: whether they meet along an edge with free flanks (n).
    logical, allocatable :: opposite(:)
  end type near_faces_t

  public :: find_near_faces, find_facets

  !> Sample points of a facet lie at this fraction of the way from its centre to its corners [].
  real(dp), parameter :: to_corner = 0.9_dp

contains

  !> Find all faces that may come into contact.
  subroutine find_near_faces(faces, given, near)
    !> Boundary facets of the bodies (n_bodies).
    type(body_faces_t), intent(in) :: faces(:)
    !> Search distance that the user gives, or 0 [length].
    real(dp), intent(in) :: given
    !> Facets that may come into contact, by pairs of bodies in ascending order (n_pairs).
    type(near_faces_t), allocatable, intent(out) :: near(:)
    type(near_faces_t), allocatable :: found(:)
    logical, allocatable :: kept(:)
    integer :: k, i
    call near_bodies(faces, given, found)
    !$omp parallel do default(none) shared(faces, given, found) schedule(dynamic, 4)
    do k = 1, size(found)
      call find_facets(faces(found(k)%body_a), faces(found(k)%body_b), given, found(k))
    end do
    !$omp end parallel do
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

  !> Mark the facets of bodies that meet along edges only. Where other bodies lie opposite the flanks, as where four
  !> bricks meet, these carry the contact.
  subroutine add_edges(faces, near)
    !> Boundary facets of the bodies (n_bodies).
    type(body_faces_t), intent(in) :: faces(:)
    !> Facets that are near each other, by pairs of bodies (n_pairs).
    type(near_faces_t), intent(inout) :: near(:)
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
    !> Boundary facets of the bodies (n_bodies).
    type(body_faces_t), intent(in) :: faces(:)
    !> Search distance that the user gives, or 0 [length].
    real(dp), intent(in) :: given
    !> Pairs of bodies, ascending, without facets (n_pairs).
    type(near_faces_t), allocatable, intent(out) :: near(:)
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
    set%half_angle = acos(-1.0_dp)
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

  !> Find the facets of two bodies that may come into contact, without regard to other bodies.
  subroutine find_facets(a, b, given, near)
    !> First body.
    type(body_faces_t), intent(in) :: a
    !> Second body.
    type(body_faces_t), intent(in) :: b
    !> Search distance that the user gives, or 0 [length].
    real(dp), intent(in) :: given
    !> The two bodies; their facets are set.
    type(near_faces_t), intent(inout) :: near
    type(box_neighbourhood_t) :: region
    integer, allocatable :: list(:), opposite(:), more(:)
    real(dp), allocatable :: longer(:)
    real(dp) :: reach, overlap, distance
    integer :: i, j, f, g, n
    logical, allocatable :: flags(:)
    logical :: swapped, meets, opposed
    reach = search_distance(a, b, given)
    overlap = greatest_overlap*min(a%diameter, b%diameter)
    n = 0
    ! The facets of the body with fewer of them, each in the tree of the other one.
    swapped = b%n < a%n
    region%distance = reach
    region%low = merge(a%lo, b%lo, swapped)
    region%high = merge(a%hi, b%hi, swapped)
    if (swapped) then
      call facets_in_region(b%tree, region, list)
    else
      call facets_in_region(a%tree, region, list)
    end if
    allocate (near%facet_a(2*size(list)), near%facet_b(2*size(list)), near%distance(2*size(list)), &
              near%opposite(2*size(list)))
    do i = 1, size(list)
      if (swapped) then
        region%low = b%tree%facet_volume(list(i))%lo
        region%high = b%tree%facet_volume(list(i))%hi
        call facets_in_region(a%tree, region, opposite)
      else
        region%low = a%tree%facet_volume(list(i))%lo
        region%high = a%tree%facet_volume(list(i))%hi
        call facets_in_region(b%tree, region, opposite)
      end if
      do j = 1, size(opposite)
        f = merge(opposite(j), list(i), swapped)
        g = merge(list(i), opposite(j), swapped)
        call compare_facets(a, f, b, g, reach, overlap, meets, distance, opposed)
        if (.not. meets) cycle
        if (n == size(near%facet_a)) then
          allocate (more(2*n), longer(2*n), flags(2*n))
          flags(:n) = near%opposite
          call move_alloc(flags, near%opposite)
          more(:n) = near%facet_a
          near%facet_a = more
          more(:n) = near%facet_b
          call move_alloc(more, near%facet_b)
          longer(:n) = near%distance
          call move_alloc(longer, near%distance)
        end if
        n = n + 1
        near%facet_a(n) = f
        near%facet_b(n) = g
        near%distance(n) = distance
        near%opposite(n) = opposed
      end do
    end do
    near%n = n
    near%facet_a = near%facet_a(:n)
    near%facet_b = near%facet_b(:n)
    near%distance = near%distance(:n)
    near%opposite = near%opposite(:n)
  end subroutine find_facets

  !> Drop pairs of facets with another body in between.
  subroutine drop_hidden(faces, near)
    !> Boundary facets of the bodies (n_bodies).
    type(body_faces_t), intent(in) :: faces(:)
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
      !> Number of the facets of the bodies before.
      integer, intent(in) :: before
      !> Facets of the side (n).
      integer, intent(in) :: facet(:)
      !> The pair of bodies.
      integer, intent(in) :: pair
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
    !> Boundary facets of the bodies (n_bodies).
    type(body_faces_t), intent(in) :: faces(:)
    !> Whether a facet of the first body has several partner bodies (number of its facets).
    logical, intent(in) :: several_a(:)
    !> The same of the second body (number of its facets).
    logical, intent(in) :: several_b(:)
    !> Bodies near the first one (n_near).
    integer, intent(in) :: neighbour_a(:)
    !> Bodies near the second one (n_near).
    integer, intent(in) :: neighbour_b(:)
    !> The two bodies; hidden facets are dropped.
    type(near_faces_t), intent(inout) :: near
    real(dp), allocatable :: sight_a(:), sight_b(:)
    logical :: kept(near%n)
    integer :: i, a, b
    kept = .not. (several_a(near%facet_a) .and. several_b(near%facet_b))
    if (all(kept)) return
    a = near%body_a
    b = near%body_b
    allocate (sight_a(size(several_a)), sight_b(size(several_b)))
    sight_a = -1
    sight_b = -1
    do i = 1, near%n
      if (kept(i)) cycle
      associate (f => near%facet_a(i), g => near%facet_b(i))
        if (sight_a(f) < 0) sight_a(f) = sight(faces, a, f, neighbour_a, b)
        if (sight_b(g) < 0) sight_b(g) = sight(faces, b, g, neighbour_b, a)
        kept(i) = near%distance(i) <= max(sight_a(f), sight_b(g))
      end associate
    end do
    near%facet_a = pack(near%facet_a, kept)
    near%facet_b = pack(near%facet_b, kept)
    near%distance = pack(near%distance, kept)
    near%opposite = pack(near%opposite, kept)
    near%n = count(kept)
  end subroutine keep_visible

  !> How far a facet sees in the direction of its normal, from the best of its sample points, before the middle of a
  !> body other than its own and the one that it looks for [length].
  real(dp) function sight(faces, body, facet, neighbour, target)
    !> Boundary facets of the bodies (n_bodies).
    type(body_faces_t), intent(in) :: faces(:)
    !> Body of the facet.
    integer, intent(in) :: body
    !> The facet.
    integer, intent(in) :: facet
    !> Bodies near that body (n_near).
    integer, intent(in) :: neighbour(:)
    !> Body that it looks for.
    integer, intent(in) :: target
    real(dp) :: point(3), centre(3), enters, leaves, free
    integer :: s, i
    sight = 0
    centre = faces(body)%centre(facet)
    do s = 0, faces(body)%n_corners(facet)
      point = centre
      if (s > 0) point = centre + to_corner*(faces(body)%corner(:, s, facet) - centre)
      free = huge(free)
      do i = 1, size(neighbour)
        if (neighbour(i) == target) cycle
        associate (other => faces(neighbour(i)))
          call other%cross_along(point, faces(body)%normal(:, facet), -greatest_overlap*other%diameter, &
                                 2*faces(body)%diameter + other%diameter, 0, enters, leaves)
        end associate
        if (leaves < huge(leaves)) free = min(free, (max(enters, 0.0_dp) + leaves)/2)
      end do
      sight = max(sight, free)
    end do
  end function sight
end module dotyk_contact_near_faces
