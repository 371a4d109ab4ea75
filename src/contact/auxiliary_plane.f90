!> A plane coordinate system for one facet, in which the facets of the other surface are drawn along a fixed direction.
!>
!> Where the facet is flat with straight edges the coordinates are those of its plane, and edges of the other surface stay
!> straight. Elsewhere they are the facet's reference coordinates: its edges are straight then, those of the other surface
!> bend.
module dotyk_contact_auxiliary_plane
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_set, only: evaluate_facet, facet_set_t
  use dotyk_contact_polygon, only: append_corner, polygon_t, signed_area
  implicit none
  private

  !> The coordinate system of a facet in three dimensions.
  type, public :: auxiliary_plane_t
    !> Number of corners of the facet.
    integer :: corners = 0
    !> Origin (3) [length].
    real(dp) :: origin(3) = 0
    !> Directions of the plane and the normal, the direction of projection (3, 3).
    real(dp) :: axes(3, 3) = 0
    !> Size of the facet [length].
    real(dp) :: size = 0
    !> Flat with straight edges: coordinates are those of the plane, else the facet's own.
    logical :: straight = .false.
    !> The map from the reference domain to the plane is affine.
    logical :: affine = .false.
    !> The facet in these coordinates, counter-clockwise.
    type(polygon_t) :: window
    !> Area of the window.
    real(dp) :: area = 0
    !> Box of the facet's nodes along the axes (3) [length].
    real(dp) :: low(3) = 0, high(3) = 0
  contains
    procedure :: init => chart_init
    procedure :: to_plane
    procedure :: draw
  end type auxiliary_plane_t

  public :: is_affine, is_plane_polygon, reference_centre, inverse_map

  !> Distances below this part of a facet's size are round-off of the mesh.
  real(dp), parameter :: flat = 1e-10_dp
  !> The same for maps that count as affine.
  real(dp), parameter :: parallel = 1e-12_dp
  !> Reference coordinates beyond this are too far away from the facet to be trusted.
  real(dp), parameter :: far = 3

contains

  !> Set up for a facet.
  subroutine chart_init(self, set, facet, x)
    class(auxiliary_plane_t), intent(out) :: self
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: facet
    !> Coordinates of its nodes (3, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    real(dp) :: length, p(3)
    integer :: i
    self%corners = set%corners(facet)
    self%origin = set%origin(:, facet)
    self%size = set%size(facet)
    self%axes(:, 3) = set%axis(:, facet)
    self%axes(:, 1) = x(:, 2) - x(:, 1)
    self%axes(:, 1) = self%axes(:, 1) - dot_product(self%axes(:, 1), self%axes(:, 3))*self%axes(:, 3)
    length = norm2(self%axes(:, 1))
    if (.not. length > 0) return
    self%axes(:, 1) = self%axes(:, 1)/length
    associate (t => self%axes(:, 1), n => self%axes(:, 3))
      self%axes(:, 2) = [n(2)*t(3) - n(3)*t(2), n(3)*t(1) - n(1)*t(3), n(1)*t(2) - n(2)*t(1)]
    end associate
    self%low = huge(1.0_dp)
    self%high = -huge(1.0_dp)
    do i = 1, size(x, 2)
      p = matmul(x(:, i) - self%origin, self%axes)
      self%low = min(self%low, p)
      self%high = max(self%high, p)
    end do
    self%straight = is_plane_polygon(self%corners, x, self%axes(:, 3))
    self%affine = self%straight .and. is_affine(set%coefficient(:, :, facet))
    if (self%straight) then
      do i = 1, self%corners
        call append_corner(self%window, self%to_plane(x(:, i)))
      end do
    else if (self%corners == 3) then
      self%window%n = 3
      self%window%x(:, 1:3) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [2, 3])
    else
      self%window%n = 4
      self%window%x(:, 1:4) = reshape([-1.0_dp, -1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp], [2, 4])
    end if
    self%area = signed_area(self%window)
  end subroutine chart_init

  !> Is a facet flat, normal to a direction, with straight edges?
  pure logical function is_plane_polygon(corners, x, normal) result(straight)
    integer, intent(in) :: corners
    !> Coordinates of its nodes (3, n_nodes) [length]: corners, then one node an edge where there are more.
    real(dp), intent(in) :: x(:, :)
    !> Unit vector (3).
    real(dp), intent(in) :: normal(3)
    real(dp) :: diameter, along(3), off(3)
    integer :: i
    diameter = norm2(maxval(x, dim=2) - minval(x, dim=2))
    straight = .true.
    do i = 2, size(x, 2)
      if (abs(dot_product(normal, x(:, i) - x(:, 1))) > flat*diameter) straight = .false.
    end do
    if (.not. straight .or. size(x, 2) < 2*corners) return
    do i = 1, corners
      along = x(:, mod(i, corners) + 1) - x(:, i)
      off = x(:, corners + i) - x(:, i)
      off = off - dot_product(off, along)/max(sum(along**2), tiny(1.0_dp))*along
      if (norm2(off) > flat*diameter) straight = .false.
    end do
  end function is_plane_polygon

  !> The polynomial has only linear terms, but for round-off of the mesh.
  pure logical function is_affine(c)
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    real(dp) :: bent
    bent = maxval(abs(c(:, [3, 5, 6, 7, 8, 9])))
    is_affine = bent <= parallel*maxval(abs(c(:, [2, 4])))
  end function is_affine

  !> Coordinates of a point in the plane (2) [length].
  pure function to_plane(self, x) result(p)
    class(auxiliary_plane_t), intent(in) :: self
    !> (3) [length].
    real(dp), intent(in) :: x(3)
    real(dp) :: p(2)
    p = matmul(x - self%origin, self%axes(:, 1:2))
  end function to_plane

  !> Coordinates of a point of the plane in the chart.
  pure subroutine draw(self, coefficient, p, s, ok)
    class(auxiliary_plane_t), intent(in) :: self
    !> The facet's polynomial (3, 9).
    real(dp), intent(in) :: coefficient(3, 9)
    !> (2) [length].
    real(dp), intent(in) :: p(2)
    !> (2).
    real(dp), intent(out) :: s(2)
    !> It has some that can be trusted.
    logical, intent(out) :: ok
    real(dp) :: determinant
    s = p
    ok = .true.
    if (self%straight) return
    s = reference_centre(self%corners)
    call inverse_map(coefficient, [0.0_dp, 0.0_dp], self%axes, self%size, p, s, determinant, ok)
    ! Not where the facet folds back.
    if (ok) ok = maxval(abs(s)) <= far .and. determinant > 0
  end subroutine draw

  !> Centre of the reference domain.
  pure function reference_centre(corners) result(xi)
    integer, intent(in) :: corners
    real(dp) :: xi(2)
    xi = merge(1/3.0_dp, 0.0_dp, corners == 3)
  end function reference_centre

  !> The point of a facet that lies above a point of a plane, by Newton's method.
  pure subroutine inverse_map(coefficient, shift, axes, size, p, xi, determinant, ok)
    !> The facet's polynomial (3, 9).
    real(dp), intent(in) :: coefficient(3, 9)
    !> Its origin in the plane (2) [length].
    real(dp), intent(in) :: shift(2)
    !> The plane is spanned by the first two (3, 3).
    real(dp), intent(in) :: axes(3, 3)
    !> Size of the facet [length].
    real(dp), intent(in) :: size
    !> (2) [length].
    real(dp), intent(in) :: p(2)
    !> A guess; reference coordinates on return (2).
    real(dp), intent(inout) :: xi(2)
    !> Area of the plane over area of the reference domain there.
    real(dp), intent(out) :: determinant
    !> The method converged.
    logical, intent(out) :: ok
    real(dp), dimension(3) :: x, xu, xv, xuu, xuv, xvv
    real(dp) :: r(2), u(2), v(2), step(2)
    integer :: i
    ok = .false.
    do i = 1, 30
      call evaluate_facet(coefficient, xi(1), xi(2), x, xu, xv, xuu, xuv, xvv)
      r = p - shift - matmul(x, axes(:, 1:2))
      u = matmul(xu, axes(:, 1:2))
      v = matmul(xv, axes(:, 1:2))
      determinant = u(1)*v(2) - u(2)*v(1)
      if (.not. abs(determinant) > 1e-12_dp*size**2) return
      step = [r(1)*v(2) - r(2)*v(1), u(1)*r(2) - u(2)*r(1)]/determinant
      xi = xi + step
      if (.not. maxval(abs(xi)) < 100) return
      if (maxval(abs(step)) <= 1e-14_dp .or. (ok .and. maxval(abs(step)) <= 1e-13_dp)) exit
      ok = maxval(abs(step)) <= 1e-10_dp
    end do
    ok = maxval(abs(step)) <= 1e-10_dp
  end subroutine inverse_map
end module dotyk_contact_auxiliary_plane
