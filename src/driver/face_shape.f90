!> What a curved face of a body is, for a user who has to tell faces apart: a cylinder, a hole or a sphere, with radius
!> and axis, from the corners of its facets.
module dotyk_driver_face_shape
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_linalg_lapack, only: dgesv, dsyev
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: shape_text

  !> Mean deviation of the corners, relative to the radius, up to which a face has a shape.
  real(dp), parameter :: tolerance = 5.0e-3_dp
  !> Distance of the middle of a facet from the axis or centre, relative to the radius, at least: seven facets around.
  !> The corners of a box lie on a sphere, too.
  real(dp), parameter :: least_middle = 0.9_dp
  real(dp), parameter :: greatest_radius = 100  !! Greatest radius, relative to the extent of the face.
  integer, parameter :: n_steps = 6  !! Steps of Newton's method, and components of vectors that are 0.
  real(dp), parameter :: rounding = 1.0e-4_dp

contains

  !> Shape of a face in space; empty where it is none of those that are known.
  function shape_text(x, surface) result(text)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The face.
    character(:), allocatable :: text
    real(dp), allocatable :: p(:, :), middle(:, :), normal(:, :)
    character(:), allocatable :: as_cylinder
    real(dp) :: centre(3), axis(3), radius, extent, deviation, of_cylinder
    text = ''
    call find_corners(x, surface, p, middle, normal)
    if (size(p, 2) < 6) return
    extent = maxval(maxval(p, dim=2) - minval(p, dim=2))
    centre = sum(p, dim=2)/size(p, 2)
    call fit_cylinder(p, normal, centre, axis, radius)
    as_cylinder = ''
    of_cylinder = huge(of_cylinder)
    if (fits(distances(p), distances(middle))) then
      of_cylinder = deviation
      as_cylinder = words('cylinder', 'hole')//' of radius '//to_text(radius, 4)//' about '//vector_text(axis)
    end if
    centre = sum(p, dim=2)/size(p, 2)
    call fit_sphere(p, centre, radius)
    if (fits(norm2(p - spread(centre, 2, size(p, 2)), dim=1), &
             norm2(middle - spread(centre, 2, size(p, 2)), dim=1))) &
      text = words('sphere', 'hollow sphere')//' of radius '//to_text(radius, 4)
    ! Two circles, the corners of a cylinder of one layer, lie on a sphere, too.
    if (len(as_cylinder) > 0 .and. (len(text) == 0 .or. of_cylinder <= max(deviation, rounding*tolerance))) &
      text = as_cylinder

  contains

    !> Distances from the axis.
    pure function distances(q) result(distance)
      real(dp), intent(in) :: q(:, :)  !! Points (3, n) [length].
      real(dp) :: distance(size(q, 2))
      integer :: i
      do i = 1, size(q, 2)
        distance(i) = norm2(q(:, i) - centre - axis*dot_product(q(:, i) - centre, axis))
      end do
    end function distances

    !> Whether distances are the radius.
    logical function fits(distance, of_middles)
      !> The distances of corners, and of the middles of facets [length].
      real(dp), intent(in) :: distance(:), of_middles(:)
      fits = radius > 0 .and. radius < greatest_radius*extent
      deviation = huge(deviation)
      if (fits) deviation = norm2(distance - radius)/(radius*sqrt(real(size(distance), dp)))
      if (fits) fits = deviation < tolerance
      if (fits) fits = minval(of_middles) > least_middle*radius
    end function fits

    !> The word for a face that bulges out, or for one that bulges in.
    function words(outward, inward) result(word)
      character(*), intent(in) :: outward, inward  !! The words.
      character(:), allocatable :: word
      word = inward
      if (sum(normal*(p - spread(centre, 2, size(p, 2)))) > 0) word = outward
    end function words
  end function shape_text

  !> Corners of the facets, as often as facets have them, and the areas and normals of these.
  subroutine find_corners(x, surface, p, middle, normal)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The face.
    real(dp), allocatable, intent(out) :: p(:, :)  !! The corners (3, n) [length].
    real(dp), allocatable, intent(out) :: middle(:, :)  !! Middles of their facets (3, n) [length].
    real(dp), allocatable, intent(out) :: normal(:, :)  !! Area times normal of their facets (3, n) [area].
    type(element_kind_t) :: kind
    integer :: f, n
    allocate (p(3, 4*surface%n_facets), middle(3, 4*surface%n_facets), normal(3, 4*surface%n_facets))
    n = 0
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      associate (corner => surface%node(:kind%n_corners, f))
        p(:, n + 1:n + kind%n_corners) = x(:, corner)
        middle(:, n + 1:n + kind%n_corners) = spread(sum(x(:, corner), dim=2)/kind%n_corners, 2, kind%n_corners)
        normal(:, n + 1:n + kind%n_corners) = &
          spread(cross(x(:, corner(2)) - x(:, corner(1)), x(:, corner(3)) - x(:, corner(1))), 2, kind%n_corners)
      end associate
      n = n + kind%n_corners
    end do
    p = p(:, :n)
    middle = middle(:, :n)
    normal = normal(:, :n)
  end subroutine find_corners

  !> Sphere through points by least squares of |p|^2 = 2 c p + k.
  subroutine fit_sphere(p, centre, radius)
    real(dp), intent(in) :: p(:, :)  !! Points (3, n) [length].
    real(dp), intent(inout) :: centre(3)  !! A point near them; the centre on return (3) [length].
    real(dp), intent(out) :: radius  !! Radius; 0 where there is no sphere [length].
    real(dp) :: a(4, 4), b(4, 1), row(4), scale
    integer :: i, info, pivot(4)
    scale = max(tiny(scale), maxval(abs(p - spread(centre, 2, size(p, 2)))))
    a = 0
    b = 0
    do i = 1, size(p, 2)
      row = [(p(:, i) - centre)/scale, 1.0_dp]
      a = a + spread(row, 2, 4)*spread(row, 1, 4)
      b(:, 1) = b(:, 1) + row*sum(row(:3)**2)
    end do
    radius = 0
    call dgesv(4, 1, a, 4, pivot, b, 4, info)
    if (info /= 0) return
    radius = scale*sqrt(max(0.0_dp, b(4, 1) + sum(b(:3, 1)**2)/4))
    centre = centre + scale*b(:3, 1)/2
  end subroutine fit_sphere

  !> Cylinder through points: the axis to which the normals are most nearly perpendicular, then Gauss-Newton steps.
  subroutine fit_cylinder(p, normal, centre, axis, radius)
    real(dp), intent(in) :: p(:, :)  !! Points (3, n) [length].
    real(dp), intent(in) :: normal(:, :)  !! Normals there (3, n) [any].
    real(dp), intent(inout) :: centre(3)  !! A point near them; one of the axis on return (3) [length].
    real(dp), intent(out) :: axis(3)  !! Direction of the axis; its greatest component is positive (3) [].
    real(dp), intent(out) :: radius  !! Radius; 0 where there is no cylinder [length].
    real(dp) :: a(3, 3), value(3), work(32), j(5), m(5, 5), r(5, 1), q(3), u(3), v(3), d, h, scale
    integer :: i, step, info, pivot(5)
    radius = 0
    a = matmul(normal, transpose(normal))
    call dsyev('V', 'L', 3, a, 3, value, work, size(work), info)
    if (info /= 0) return
    axis = a(:, 1)
    scale = max(tiny(scale), maxval(abs(p - spread(centre, 2, size(p, 2)))))
    radius = scale
    ! A circle in the plane of the other two directions is the start.
    call fit_circle(p, a(:, 2), a(:, 3), scale, centre, radius)
    do step = 1, n_steps
      u = a(:, 2) - axis*dot_product(a(:, 2), axis)
      u = u/norm2(u)
      v = cross(axis, u)
      m = 0
      r = 0
      do i = 1, size(p, 2)
        h = dot_product(p(:, i) - centre, axis)
        q = p(:, i) - centre - axis*h
        d = max(tiny(d), norm2(q))
        q = q/d
        j = [-dot_product(q, u), -dot_product(q, v), -dot_product(q, u)*h/scale, -dot_product(q, v)*h/scale, -1.0_dp]
        m = m + spread(j, 2, 5)*spread(j, 1, 5)
        r(:, 1) = r(:, 1) - j*(d - radius)
      end do
      call dgesv(5, 1, m, 5, pivot, r, 5, info)
      if (info /= 0) return
      centre = centre + r(1, 1)*u + r(2, 1)*v
      axis = axis + (r(3, 1)*u + r(4, 1)*v)/scale
      axis = axis/norm2(axis)
      radius = radius + r(5, 1)
    end do
    axis = axis*sign(1.0_dp, axis(maxloc(abs(axis), dim=1)))
  end subroutine fit_cylinder

  !> Circle through the projections of points.
  subroutine fit_circle(p, u, v, scale, centre, radius)
    real(dp), intent(in) :: p(:, :)  !! Points (3, n) [length].
    real(dp), intent(in) :: u(3), v(3)  !! Directions of its plane (3) [].
    real(dp), intent(in) :: scale  !! Size of the points [length].
    real(dp), intent(inout) :: centre(3)  !! A point near them; the centre on return (3) [length].
    real(dp), intent(inout) :: radius  !! Radius; unchanged where there is no circle [length].
    real(dp) :: a(3, 3), b(3, 1), row(3)
    integer :: i, info, pivot(3)
    a = 0
    b = 0
    do i = 1, size(p, 2)
      row = [dot_product(p(:, i) - centre, u)/scale, dot_product(p(:, i) - centre, v)/scale, 1.0_dp]
      a = a + spread(row, 2, 3)*spread(row, 1, 3)
      b(:, 1) = b(:, 1) + row*sum(row(:2)**2)
    end do
    call dgesv(3, 1, a, 3, pivot, b, 3, info)
    if (info /= 0) return
    radius = scale*sqrt(max(0.0_dp, b(3, 1) + sum(b(:2, 1)**2)/4))
    centre = centre + scale*(b(1, 1)*u + b(2, 1)*v)/2
  end subroutine fit_circle

  !> A vector as text; components that are small beside the others are 0.
  function vector_text(v) result(text)
    real(dp), intent(in) :: v(3)  !! Vector (3) [any].
    character(:), allocatable :: text
    real(dp) :: w(3)
    w = v
    where (abs(w) < rounding*maxval(abs(w))) w = 0
    text = '('//to_text(w(1), 4)//', '//to_text(w(2), 4)//', '//to_text(w(3), 4)//')'
  end function vector_text
end module dotyk_driver_face_shape
