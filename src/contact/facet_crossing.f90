!> Crossings of a straight segment with the deformed boundary of a part.
module dotyk_contact_facet_crossing
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_parts, only: facet_parts, max_parts
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_contact_tree_search, only: box_neighbourhood_t, tree_walk_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  !> Crossings of one segment that are kept.
  integer, parameter, public :: max_crossings = 32

  public :: crossings

  !> Margin of the borders of a triangle, in its coordinates [].
  real(dp), parameter :: border = 1.0e-9_dp

contains

  !> Where a segment crosses the deformed boundary, ascending. Facets are passed over where both ends are nearer to
  !> their planes than they resolve.
  subroutine crossings(b, start, finish, slack, n, s, enters)
    !> The part.
    type(solid_t), intent(in) :: b
    !> First end (3) [length].
    real(dp), intent(in) :: start(3)
    !> Second end (3) [length].
    real(dp), intent(in) :: finish(3)
    !> Error of the displacements and of rounding [length].
    real(dp), intent(in) :: slack
    !> Number of crossings.
    integer, intent(out) :: n
    !> Their places, from 0 at the first end to 1 at the second (max_crossings) [].
    real(dp), intent(out) :: s(max_crossings)
    !> Whether the segment enters the part there; otherwise it leaves it (max_crossings).
    logical, intent(out) :: enters(max_crossings)
    type(box_neighbourhood_t) :: region
    type(tree_walk_t) :: walk
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
        if (part(3, k) == 0) then
          call cross_line(part(1:2, k))
        else
          call cross_triangle(part(:, k))
        end if
      end do
    end do

  contains

    !> Keep a crossing.
    subroutine keep(place, is_entry)
      !> Place on the segment [].
      real(dp), intent(in) :: place
      !> Whether the segment enters the part.
      logical, intent(in) :: is_entry
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

    !> Crossing with a line, in the plane.
    subroutine cross_line(node)
      !> Ends of the line.
      integer, intent(in) :: node(2)
      real(dp) :: normal(3), along(3), first, second, t
      along = b%x(:, node(2)) - b%x(:, node(1))
      normal = [along(2), -along(1), 0.0_dp]/max(norm2(along), tiny(1.0_dp))
      first = dot_product(normal, start - b%x(:, node(1)))
      second = dot_product(normal, finish - b%x(:, node(1)))
      if (first*second > 0 .or. max(abs(first), abs(second)) <= slack + b%roughness(f)) return
      t = dot_product(along, start + first/(first - second)*(finish - start) - b%x(:, node(1)))/ &
          dot_product(along, along)
      if (t >= -border .and. t <= 1 + border) call keep(first/(first - second), first > second)
    end subroutine cross_line

    !> Crossing with a triangle.
    subroutine cross_triangle(node)
      !> Corners.
      integer, intent(in) :: node(3)
      real(dp) :: normal(3), e1(3), e2(3), r(3), area, first, second, u, v
      e1 = b%x(:, node(2)) - b%x(:, node(1))
      e2 = b%x(:, node(3)) - b%x(:, node(1))
      normal = cross(e1, e2)
      area = norm2(normal)
      if (.not. area > 0) return
      normal = normal/area
      first = dot_product(normal, start - b%x(:, node(1)))
      second = dot_product(normal, finish - b%x(:, node(1)))
      if (first*second > 0 .or. max(abs(first), abs(second)) <= slack + b%roughness(f)) return
      r = start + first/(first - second)*(finish - start) - b%x(:, node(1))
      u = dot_product(cross(r, e2), normal)/area
      v = dot_product(cross(e1, r), normal)/area
      if (min(u, v, 1 - u - v) >= -border) call keep(first/(first - second), first > second)
    end subroutine cross_triangle
  end subroutine crossings
end module dotyk_contact_facet_crossing
