!> Auxiliary plane of a slave facet, on which master facets are projected for clipping (Puso and Laursen, Comput.
!> Methods Appl. Mech. Engrg. 193, 2004).
!>
!> The plane is normal to the mean normal of the slave facet, which is the direction of projection. Clipping takes place
!> in clip coordinates: those of the plane where the slave facet is a plane polygon, so that projected edges of the
!> master surface stay straight; elsewhere the reference coordinates of the slave facet, in which its own edges are
!> straight and projected edges bend.
module dotyk_contact_auxiliary_plane
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: few_roundings, given_rounding, rounding, shape_rounding
  use dotyk_contact_facet_polynomial, only: evaluate_facet
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_polygon, only: append_corner, polygon_t, signed_area
  implicit none
  private

  type, public :: auxiliary_plane_t  !! Auxiliary plane of a slave facet in three dimensions.
    integer :: corners = 0  !! Number of corners of the facet.
    real(dp) :: origin(3) = 0  !! Origin of the plane (3) [length].
    !> Unit vectors in the plane and, as the third, the normal: the direction of projection (3, 3) [].
    real(dp) :: axes(3, 3) = 0
    real(dp) :: size = 0  !! Size of the facet [length].
    !> The facet is a plane polygon: clip coordinates are those of the plane; otherwise reference coordinates.
    logical :: is_polygon = .false.
    logical :: affine = .false.  !! The map from the reference domain to the plane is affine.
    type(polygon_t) :: clip_window  !! The slave facet in clip coordinates, counter-clockwise.
    real(dp) :: area = 0  !! Area of the clip window [as the square of the clip coordinates].
    real(dp) :: low(3) = 0  !! Lower corner of the box of the facet nodes along the axes (3) [length].
    real(dp) :: high(3) = 0  !! Upper corner of that box (3) [length].
  contains
    procedure :: init => auxiliary_plane_init
    procedure :: to_plane
    procedure :: to_clip_coordinates
  end type auxiliary_plane_t

  public :: is_affine, is_plane_polygon, reference_centre, inverse_map

  !> Inverse maps beyond this are too far outside the facet to be reliable.
  real(dp), parameter :: max_reference_coordinate = 3
  real(dp), parameter :: divergence_limit = 100  !! Newton's method diverges where a reference coordinate exceeds this.
  integer, parameter :: max_steps = 30  !! Newton steps of an inverse map; they converge quadratically, in 3 to 6.
  !> An inverse map is found where the last Newton step is below this; the next step is round-off.
  real(dp), parameter :: converged_step = 1.0e-10_dp

contains

  !> Set up the plane of a facet.
  subroutine auxiliary_plane_init(self, set, facet, x)
    class(auxiliary_plane_t), intent(out) :: self
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: x(:, :)  !! Coordinates of the nodes of the facet (3, n_nodes) [length].
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
    self%is_polygon = is_plane_polygon(self%corners, x, self%axes(:, 3))
    self%affine = self%is_polygon .and. is_affine(set%coefficient(:, :, facet))
    if (self%is_polygon) then
      do i = 1, self%corners
        call append_corner(self%clip_window, self%to_plane(x(:, i)))
      end do
    else if (self%corners == 3) then
      self%clip_window%n = 3
      self%clip_window%x(:, 1:3) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [2, 3])
    else
      self%clip_window%n = 4
      self%clip_window%x(:, 1:4) = reshape([-1.0_dp, -1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp], [2, 4])
    end if
    self%area = signed_area(self%clip_window)
  end subroutine auxiliary_plane_init

  !> Whether a facet is a plane polygon: flat, normal to a direction, with straight edges.
  pure logical function is_plane_polygon(corners, x, normal) result(is_polygon)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    !> Coordinates of the nodes of the facet: corners, then one node an edge where there are more (3, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    real(dp), intent(in) :: normal(3)  !! Unit normal (3) [].
    real(dp) :: diameter, along(3), off(3)
    integer :: i
    diameter = norm2(maxval(x, dim=2) - minval(x, dim=2))
    is_polygon = .true.
    do i = 2, size(x, 2)
      if (abs(dot_product(normal, x(:, i) - x(:, 1))) > shape_rounding*diameter) is_polygon = .false.
    end do
    if (.not. is_polygon .or. size(x, 2) < 2*corners) return
    do i = 1, corners
      along = x(:, mod(i, corners) + 1) - x(:, i)
      off = x(:, corners + i) - x(:, i)
      off = off - dot_product(off, along)/max(sum(along**2), tiny(1.0_dp))*along
      if (norm2(off) > shape_rounding*diameter) is_polygon = .false.
    end do
  end function is_plane_polygon

  !> Whether a facet polynomial has only linear terms, up to round-off of the mesh.
  pure logical function is_affine(c)
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp) :: bent
    bent = maxval(abs(c(:, [3, 5, 6, 7, 8, 9])))
    is_affine = bent <= rounding*maxval(abs(c(:, [2, 4])))
  end function is_affine

  !> Coordinates of a point in the plane, projected along the normal.
  pure function to_plane(self, x) result(p)
    class(auxiliary_plane_t), intent(in) :: self
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp) :: p(2)  !! Coordinates in the plane (2) [length].
    p = matmul(x - self%origin, self%axes(:, 1:2))
  end function to_plane

  !> Clip coordinates of a point of the plane.
  pure subroutine to_clip_coordinates(self, coefficient, p, s, ok)
    class(auxiliary_plane_t), intent(in) :: self
    real(dp), intent(in) :: coefficient(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: p(2)  !! Point of the plane (2) [length].
    real(dp), intent(out) :: s(2)  !! Clip coordinates (2) [length or, if the facet is not a polygon, none].
    logical, intent(out) :: ok  !! The clip coordinates are reliable.
    real(dp) :: determinant
    s = p
    ok = .true.
    if (self%is_polygon) return
    s = reference_centre(self%corners)
    call inverse_map(coefficient, [0.0_dp, 0.0_dp], self%axes, self%size, p, s, determinant, ok)
    ! Rejected where the facet folds back.
    if (ok) ok = maxval(abs(s)) <= max_reference_coordinate .and. determinant > 0
  end subroutine to_clip_coordinates

  !> Centre of the reference domain of a facet.
  pure function reference_centre(corners) result(xi)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp) :: xi(2)  !! Reference coordinates (2) [].
    xi = merge(1/3.0_dp, 0.0_dp, corners == 3)
  end function reference_centre

  !> Inverse isoparametric map along the normal of a plane: the point of a facet that is projected on a point of the
  !> plane, by Newton's method.
  pure subroutine inverse_map(coefficient, shift, axes, size, p, xi, determinant, ok)
    real(dp), intent(in) :: coefficient(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: shift(2)  !! Origin of the facet polynomial in the plane (2) [length].
    real(dp), intent(in) :: axes(3, 3)  !! The first two columns span the plane (3, 3) [].
    real(dp), intent(in) :: size  !! Size of the facet [length].
    real(dp), intent(in) :: p(2)  !! Point of the plane (2) [length].
    real(dp), intent(inout) :: xi(2)  !! Initial guess; reference coordinates on return (2) [].
    real(dp), intent(out) :: determinant  !! Area in the plane per reference area at the result [length^2].
    logical, intent(out) :: ok  !! Newton's method converged.
    real(dp), dimension(3) :: x, xu, xv, xuu, xuv, xvv
    real(dp) :: r(2), u(2), v(2), step(2)
    integer :: i
    ok = .false.
    do i = 1, max_steps
      call evaluate_facet(coefficient, xi(1), xi(2), x, xu, xv, xuu, xuv, xvv)
      r = p - shift - matmul(x, axes(:, 1:2))
      u = matmul(xu, axes(:, 1:2))
      v = matmul(xv, axes(:, 1:2))
      determinant = u(1)*v(2) - u(2)*v(1)
      if (.not. abs(determinant) > rounding*size**2) return
      step = [r(1)*v(2) - r(2)*v(1), u(1)*r(2) - u(2)*r(1)]/determinant
      xi = xi + step
      if (.not. maxval(abs(xi)) < divergence_limit) return
      if (maxval(abs(step)) <= few_roundings .or. (ok .and. maxval(abs(step)) <= given_rounding)) exit
      ok = maxval(abs(step)) <= converged_step
    end do
    ok = maxval(abs(step)) <= converged_step
  end subroutine inverse_map
end module dotyk_contact_auxiliary_plane
