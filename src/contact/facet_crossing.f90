!> Crossings of a straight segment with the deformed boundary of a part.
module dotyk_contact_facet_crossing
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_parts, only: facet_parts, max_parts, part_corners, place_at_part
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_contact_tree_search, only: box_neighbourhood_t, tree_walk_t
  implicit none
  private

  integer, parameter, public :: max_crossings = 32  !! Crossings of one segment that are kept.

  public :: crossings

  real(dp), parameter :: border = 1.0e-9_dp  !! Margin of the borders of a triangle, in its coordinates [].

contains

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
        if (inside >= -border) call keep(at, first > 0)
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
end module dotyk_contact_facet_crossing
