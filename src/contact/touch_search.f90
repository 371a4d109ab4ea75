!> Faces of two parts that touch after deformation.
module dotyk_contact_touch_search
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_set, only: facet_position_and_normal
  use dotyk_contact_solid_boundary, only: solid_t
  implicit none
  private

  type, public :: touch_t  !! Touching of two parts.
    integer :: n_facets = 0  !! Facets of the two whose centres lie on faces of the other which face them.
    real(dp) :: position(3) = 0  !! Centre of the deepest of them after deformation (3) [length].
    real(dp) :: depth = 0  !! Its depth in the other part, 0 where none is below its facets [length].
  end type touch_t

  public :: find_touch

  !> Faces face each other where the cosine of the angle of their normals is below this: 150 degrees.
  real(dp), parameter :: facing_cosine = -0.866_dp
  real(dp), parameter :: no_gap = 1.0e-6_dp  !! Gaps below this fraction of the size of the facet count as none.

contains

  !> Facets of a part whose centres lie on faces of another one.
  pure subroutine find_touch(a, b, slack, touch)
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    real(dp), intent(in) :: slack  !! Error of the displacements and of rounding [length].
    type(touch_t), intent(inout) :: touch  !! Facets are added.
    real(dp) :: depth, xi(2), x(3), normal(3), xu(3), xv(3)
    integer :: f, facet, hint
    hint = 0
    do f = 1, a%set%n
      if (any(a%set%hi(:, f) < b%tree%volume(1)%lo - slack .or. &
              a%set%lo(:, f) > b%tree%volume(1)%hi + slack)) cycle
      xi = merge(1/3.0_dp, 0.0_dp, a%set%corners(f) == 3)
      call facet_position_and_normal(a%set, f, xi, x, normal, xu, xv)
      call b%depth_of(x, hint, depth, facet, xi)
      hint = facet
      if (abs(depth) > no_gap*b%set%size(facet) + slack + b%roughness(facet) + a%roughness(f)) cycle
      if (dot_product(normal, b%normal(:, facet)) > facing_cosine) cycle
      if (touch%n_facets == 0 .or. depth > touch%depth) touch%position = x
      touch%n_facets = touch%n_facets + 1
      if (depth > slack) touch%depth = max(touch%depth, depth)
    end do
  end subroutine find_touch
end module dotyk_contact_touch_search
