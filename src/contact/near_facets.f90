!> The facets of two bodies that may come into contact, in the order of the facets of the body with fewer of them:
!> threads share parts of these, and ranks may divide them.
module dotyk_contact_near_facets
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: same_number
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_contact_facet_distance, only: polygon_distance, polygons_overlap
  use dotyk_contact_tree_search, only: box_neighbourhood_t, facets_in_region
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_division, only: division_t
  use dotyk_ranks_exchange, only: all_ranks, item_t, share
  implicit none
  private
  public :: find_facets, share_near, compare_facets, search_distance

  type, public :: near_faces_t  !! Facets of two bodies that may come into contact.
    integer :: body_a = 0  !! Index of the first body, the lower one.
    integer :: body_b = 0  !! Index of the second body.
    integer :: n = 0  !! Number of pairs of facets.
    integer, allocatable :: facet_a(:)  !! Facets of the first body (n).
    integer, allocatable :: facet_b(:)  !! Facets of the second body opposite them (n).
    !> Smallest distance of each pair of facets; negative where they overlap (n) [length].
    real(dp), allocatable :: distance(:)
    !> Whether they lie opposite each other, seen along their normals, and not just beside each other; of bodies without
    !> such facets: whether they meet along an edge with free flanks (n).
    logical, allocatable :: opposite(:)
  end type near_faces_t


  integer, parameter :: most_parts = 64  !! Parts of the facets of two bodies that threads compare, at most.
  integer, parameter :: least_part = 8  !! Facets of a part, at least.
  !> Search distance where none is given, as a fraction of the diameter of the smaller body [].
  real(dp), parameter :: default_fraction = 0.1_dp
  !> Facets face each other where the cosine of the angle between their normals is below this: 84 degrees between one
  !> normal and the reverse of the other [].
  real(dp), parameter :: facing_limit = -0.1_dp
  !> Greatest initial overlap, as a fraction of the diameter of the smaller body [].
  real(dp), parameter, public :: greatest_overlap = 0.05_dp

contains

  !> Find the facets of two bodies that may come into contact, without regard to other bodies.
  subroutine find_facets(a, b, given, near, most, division)
    type(body_faces_t), intent(in) :: a  !! First body.
    type(body_faces_t), intent(in) :: b  !! Second body.
    real(dp), intent(in) :: given  !! Search distance that the user gives, or 0 [length].
    type(near_faces_t), intent(inout) :: near  !! The two bodies; their facets are set.
    real(dp), intent(in), optional :: most  !! Bound of the search distance [length].
    type(division_t), intent(in), optional :: division  !! How ranks divide the facets; not if absent.
    type(box_neighbourhood_t) :: region
    type(near_faces_t) :: part(most_parts)
    integer, allocatable :: list(:)
    real(dp), allocatable :: behind_a(:), behind_b(:)
    real(dp) :: reach, overlap
    integer :: k, n_parts, first, last
    logical :: swapped
    reach = search_distance(a, b, given)
    if (present(most)) reach = min(reach, most)
    overlap = greatest_overlap*min(a%diameter, b%diameter)
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
    if (present(division)) then
      call division%portion(size(list), first, last)
      list = list(first:last)
    end if
    n_parts = min(most_parts, 1 + size(list)/least_part)
    !$omp parallel default(none) private(behind_a, behind_b) if (n_parts > 1) &
    !$omp& shared(a, b, swapped, reach, overlap, list, n_parts, part)
    allocate (behind_a(a%n), source=-1.0_dp)
    allocate (behind_b(b%n), source=-1.0_dp)
    !$omp do schedule(dynamic, 1)
    do k = 1, n_parts
      call compare_some(a, b, swapped, reach, overlap, &
                        list(1 + part_end(k - 1, n_parts, size(list)):part_end(k, n_parts, size(list))), &
                        behind_a, behind_b, part(k))
    end do
    !$omp end do
    deallocate (behind_a, behind_b)
    !$omp end parallel
    ! In the order of the list, on any number of threads.
    near%n = sum(part(:n_parts)%n)
    near%facet_a = [(part(k)%facet_a(:part(k)%n), k=1, n_parts)]
    near%facet_b = [(part(k)%facet_b(:part(k)%n), k=1, n_parts)]
    near%distance = [(part(k)%distance(:part(k)%n), k=1, n_parts)]
    near%opposite = [(part(k)%opposite(:part(k)%n), k=1, n_parts)]
    if (present(division)) call append_near(division, near)
  end subroutine find_facets

  !> Put the facets that all ranks have found together, in the order of the ranks.
  subroutine append_near(division, near)
    type(division_t), intent(in) :: division  !! How ranks divide the facets.
    type(near_faces_t), intent(inout) :: near  !! Those of this rank in, of all out.
    real(dp), allocatable :: list(:, :)
    if (.not. division%is_divided) return
    allocate (list(4, near%n))
    call put(near, list)
    call division%append(list)
    call take(list, near)
  end subroutine append_near

  !> Make the facets of pairs of bodies that one rank each has found known to all.
  subroutine share_near(owner, near)
    integer, intent(in) :: owner(:)  !! Ranks, or `all_ranks` where all of them have the facets (n_pairs).
    type(near_faces_t), intent(inout) :: near(:)  !! Those of this rank in, of all out (n_pairs).
    type(item_t), allocatable :: item(:)
    real(dp), allocatable :: list(:, :)
    integer, allocatable :: dealt(:)
    integer :: i, k
    dealt = pack([(k, k=1, size(owner))], owner /= all_ranks)
    if (n_ranks() == 1 .or. size(dealt) == 0) return
    allocate (item(size(dealt)))
    do i = 1, size(dealt)
      k = dealt(i)
      if (owner(k) /= this_rank()) cycle
      allocate (list(4, near(k)%n))
      call put(near(k), list)
      item(i)%value = reshape(list, [size(list)])
      deallocate (list)
    end do
    call share(owner(dealt), item)
    do i = 1, size(dealt)
      call take(reshape(item(i)%value, [4, size(item(i)%value)/4]), near(dealt(i)))
    end do
  end subroutine share_near

  !> Facets as numbers.
  pure subroutine put(near, list)
    type(near_faces_t), intent(in) :: near  !! The facets.
    !> First facet, second facet, distance, whether they are opposite (4, n) [1, 1, length, 1].
    real(dp), intent(out) :: list(:, :)
    list(1, :) = near%facet_a(:near%n)
    list(2, :) = near%facet_b(:near%n)
    list(3, :) = near%distance(:near%n)
    list(4, :) = merge(1.0_dp, 0.0_dp, near%opposite(:near%n))
  end subroutine put

  !> Facets from numbers.
  pure subroutine take(list, near)
    real(dp), intent(in) :: list(:, :)  !! As from `put` (4, n) [1, 1, length, 1].
    type(near_faces_t), intent(inout) :: near  !! The facets.
    near%n = size(list, 2)
    near%facet_a = nint(list(1, :))
    near%facet_b = nint(list(2, :))
    near%distance = list(3, :)
    near%opposite = list(4, :) > 0
  end subroutine take

  !> End of a part of a list in equal parts.
  pure integer function part_end(part, n_parts, n) result(last)
    integer, intent(in) :: part  !! The part.
    integer, intent(in) :: n_parts  !! Number of parts.
    integer, intent(in) :: n  !! Length of the list.
    last = int(int(part, int64)*n/n_parts)
  end function part_end

  !> Compare some facets of the body with fewer of them with those of the other one.
  subroutine compare_some(a, b, swapped, reach, overlap, list, behind_a, behind_b, near)
    type(body_faces_t), intent(in) :: a  !! First body.
    type(body_faces_t), intent(in) :: b  !! Second body.
    logical, intent(in) :: swapped  !! Whether the facets are those of the second body.
    real(dp), intent(in) :: reach  !! Search distance [length].
    real(dp), intent(in) :: overlap  !! Greatest initial overlap [length].
    integer, intent(in) :: list(:)  !! The facets (n).
    !> Thickness of the first body behind its facets; negative where it is not known yet (a%n) [length].
    real(dp), intent(inout) :: behind_a(:)
    real(dp), intent(inout) :: behind_b(:)  !! The same of the second body (b%n) [length].
    type(near_faces_t), intent(inout) :: near  !! Facets that are near each other; there may be room for more.
    type(box_neighbourhood_t) :: region
    integer, allocatable :: opposite(:)
    real(dp) :: distance
    integer :: i, j, f, g
    logical :: meets, opposed
    region%distance = reach
    allocate (near%facet_a(2*size(list) + 1), near%facet_b(2*size(list) + 1), near%distance(2*size(list) + 1), &
              near%opposite(2*size(list) + 1))
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
        call compare_facets(a, f, b, g, reach, overlap, behind_a, behind_b, meets, distance, opposed)
        if (.not. meets) cycle
        if (near%n == size(near%facet_a)) call resize(near, 2*near%n)
        near%n = near%n + 1
        near%facet_a(near%n) = f
        near%facet_b(near%n) = g
        near%distance(near%n) = distance
        near%opposite(near%n) = opposed
      end do
    end do
  end subroutine compare_some

  !> Give the arrays another size.
  subroutine resize(near, n)
    type(near_faces_t), intent(inout) :: near  !! The facets.
    integer, intent(in) :: n  !! The size, not below the number of facets.
    integer, allocatable :: facet(:)
    real(dp), allocatable :: distance(:)
    logical, allocatable :: opposite(:)
    allocate (facet(n))
    facet(:near%n) = near%facet_a(:near%n)
    call move_alloc(facet, near%facet_a)
    allocate (facet(n))
    facet(:near%n) = near%facet_b(:near%n)
    call move_alloc(facet, near%facet_b)
    allocate (distance(n), opposite(n))
    distance(:near%n) = near%distance(:near%n)
    opposite(:near%n) = near%opposite(:near%n)
    call move_alloc(distance, near%distance)
    call move_alloc(opposite, near%opposite)
  end subroutine resize

  !> Search distance of two bodies [length].
  pure real(dp) function search_distance(a, b, given) result(distance)
    type(body_faces_t), intent(in) :: a  !! First body.
    type(body_faces_t), intent(in) :: b  !! Second body.
    real(dp), intent(in) :: given  !! Distance that the user gives, or 0 [length].
    distance = given
    if (.not. given > 0) distance = default_fraction*min(a%diameter, b%diameter)
  end function search_distance

  !> Whether two facets face each other within the search distance, in front of each other or with a small overlap.
  pure subroutine compare_facets(a, f, b, g, reach, overlap, behind_a, behind_b, meets, distance, opposite)
    type(body_faces_t), intent(in) :: a  !! First body.
    integer, intent(in) :: f  !! Its facet.
    type(body_faces_t), intent(in) :: b  !! Second body.
    integer, intent(in) :: g  !! Its facet.
    real(dp), intent(in) :: reach  !! Search distance [length].
    real(dp), intent(in) :: overlap  !! Greatest initial overlap [length].
    !> Thickness of the first body behind its facets; negative where it is not known yet (a%n) [length].
    real(dp), intent(inout) :: behind_a(:)
    real(dp), intent(inout) :: behind_b(:)  !! The same of the second body (b%n) [length].
    logical, intent(out) :: meets  !! Whether they do.
    real(dp), intent(out) :: distance  !! Their distance; negative where they overlap [length].
    logical, intent(out) :: opposite  !! Whether they lie opposite each other, seen along their normals.
    real(dp) :: toward(3), at_f(3), at_g(3), depth, cosine, angle
    meets = .false.
    opposite = .false.
    distance = 0
    cosine = dot_product(a%normal(:, f), b%normal(:, g))
    if (cosine >= facing_limit) then
      angle = acos(min(1.0_dp, cosine)) + a%half_angle(f) + b%half_angle(g)
      if (angle < acos(facing_limit)) return
    end if
    call polygon_distance(a%n_corners(f), a%corner(:, :a%n_corners(f), f), b%n_corners(g), &
                          b%corner(:, :b%n_corners(g), g), distance, at_f, at_g)
    if (distance > reach + a%bulge(f) + b%bulge(g)) return
    toward = a%normal(:, f) - b%normal(:, g)
    ! Normals of one direction, of facets that bend so far: neither lies in front of the other.
    if (.not. norm2(toward) > sqrt(epsilon(cosine))) return
    toward = toward/norm2(toward)
    meets = .true.
    depth = dot_product(at_f - at_g, toward)
    if (depth > a%bulge(f) + b%bulge(g) + same_number*(a%diameter + b%diameter)) then
      distance = -distance
      meets = depth <= overlap
      if (meets) then
        if (behind_a(f) < 0) behind_a(f) = thickness(a, f)
        if (behind_b(g) < 0) behind_b(g) = thickness(b, g)
        meets = 2*depth <= min(behind_a(f), behind_b(g))
      end if
    end if
    if (meets) opposite = polygons_overlap(a%n_corners(f), a%corner(:, :a%n_corners(f), f), b%n_corners(g), &
                                           b%corner(:, :b%n_corners(g), g), toward)
  end subroutine compare_facets

  !> Thickness of a body behind a facet, from the centre of the facet; huge where it is open [length].
  pure real(dp) function thickness(faces, facet)
    type(body_faces_t), intent(in) :: faces  !! The body.
    integer, intent(in) :: facet  !! Its facet.
    real(dp) :: enters, leaves
    call faces%cross_along(faces%centre(facet), -faces%normal(:, facet), 0.0_dp, 2*faces%diameter, facet, enters, &
                           leaves)
    thickness = leaves
  end function thickness
end module dotyk_contact_near_facets
