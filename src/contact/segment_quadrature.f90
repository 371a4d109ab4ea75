!> Quadrature rules on mortar segments, the polygons in which facets of the slave and the master surface overlap.
!>
!> Moment fitting transfers a uniform contact pressure exactly between facets of any shape. On flat quadrilaterals that
!> are not parallelograms the shape functions are not polynomials in the plane, so that no usual rule integrates them
!> exactly over a polygon. Their integrals are computed to round-off with a rule of high degree; then the weights of the
!> rule in use are changed as little as possible so that it reproduces these integrals for the shape functions of both
!> facets (moment fitting, as in Mousavi and Sukumar, Comput. Mech. 47, 2011). A uniform pressure then gives consistent
!> nodal forces on both sides, whatever the meshes: the contact patch test.
module dotyk_contact_segment_quadrature
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: given_rounding, no_offset
  use dotyk_contact_auxiliary_plane, only: auxiliary_plane_t, reference_centre, inverse_map
  use dotyk_contact_facet_polynomial, only: evaluate_facet
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_polygon, only: is_parallelogram, max_corners, polygon_t, triangulate
  use dotyk_mesh_element, only: element_line2, element_line3, element_quad4, element_quad8, element_quad9, &
    element_tri3, element_tri6, kind_nodes, quadrature_rule, shape_functions
  implicit none
  private
  public :: polygon_rule, append_points, shape_degree, fit_segment_weights

  type, public :: quadrature_rule_t  !! Quadrature rule of a facet or of a reference domain.
    real(dp), allocatable :: xi(:, :)  !! Points (dimension-1, n) [].
    real(dp), allocatable :: weight(:)  !! Weights (n) [].
  end type quadrature_rule_t

  integer, parameter, public :: max_degree = 20  !! Greatest degree of the rules in the table.

  type, public :: rule_table_t  !! Rules on the reference domains, of the degrees that were asked for.
    type(quadrature_rule_t) :: line(0:max_degree)  !! On (0:max_degree) [-1,1], by degree.
    type(quadrature_rule_t) :: triangle(0:max_degree)  !! On the unit triangle, by degree (0:max_degree).
    type(quadrature_rule_t) :: square(0:max_degree)  !! On (0:max_degree) [-1,1]^2, by degree.
  contains
    procedure :: init => table_init
  end type rule_table_t

  !> Integration errors below this fraction of the area are round-off.
  real(dp), parameter :: integral_round_off = 3.0e-15_dp
  !> Greatest relative change of the weights to integrate a nearly dependent function.
  real(dp), parameter :: max_dependent_change = 0.05_dp
  real(dp), parameter :: max_change = 0.5_dp  !! Greatest relative change of a weight: the fitted weights stay positive.
  !> Upper limit of `distortion`, where the area per reference area vanishes at a corner: the degree of the reference
  !> rule stays finite.
  real(dp), parameter :: max_distortion = 0.9_dp
  !> Lower limit of the distortion seen by a segment: below it the rule of least degree is exact to round-off.
  real(dp), parameter :: min_distortion = 1.0e-3_dp
  integer, parameter :: base_degree = 6  !! Degree of the reference rule for polynomials.
  !> n more degrees for a singularity on the Bernstein ellipse rho make the error rho^(-n) = exp(-round_off_exponent) =
  !> 1e-14.
  integer, parameter :: round_off_exponent = 32

contains

  !> Compute the rules.
  subroutine table_init(self, highest)
    class(rule_table_t), intent(out) :: self
    integer, intent(in) :: highest  !! Degree of the last one; at most `max_degree`.
    integer :: k
    do k = 0, highest
      call quadrature_rule(element_line2, k, self%line(k)%xi, self%line(k)%weight)
      call quadrature_rule(element_tri3, k, self%triangle(k)%xi, self%triangle(k)%weight)
      call quadrature_rule(element_quad4, k, self%square(k)%xi, self%square(k)%weight)
    end do
  end subroutine table_init

  !> Total degree of the shape functions of a facet kind.
  pure integer function shape_degree(kind) result(degree)
    integer, intent(in) :: kind  !! Element kind of the facet.
    select case (kind)
    case (element_line2, element_tri3)
      degree = 1
    case (element_line3, element_tri6, element_quad4)
      degree = 2
    case (element_quad8)
      degree = 3
    case (element_quad9)
      degree = 4
    case default
      degree = 1
    end select
  end function shape_degree

  !> Quadrature rule on a polygon: a tensor-product rule on a parallelogram, rules on triangles otherwise.
  pure subroutine polygon_rule(polygon, table, degree, n, points, weights, ok)
    type(polygon_t), intent(in) :: polygon  !! Polygon, counter-clockwise.
    type(rule_table_t), intent(in) :: table  !! Quadrature rules on reference domains, by degree.
    integer, intent(in) :: degree  !! Total degree that is integrated exactly.
    integer, intent(out) :: n  !! Number of points.
    real(dp), allocatable, intent(out) :: points(:, :)  !! Points (2, n) [as the polygon].
    !> Weights, whose sum is the area (n) [as the area of the polygon].
    real(dp), allocatable, intent(out) :: weights(:)
    logical, intent(out) :: ok  !! The polygon could be divided into triangles.
    real(dp) :: triangle(2, 3, max_corners), u(2), v(2), area
    integer :: n_triangles, i, k, m
    if (is_parallelogram(polygon)) then
      ok = .true.
      u = (polygon%x(:, 2) - polygon%x(:, 1))/2
      v = (polygon%x(:, 4) - polygon%x(:, 1))/2
      area = u(1)*v(2) - u(2)*v(1)
      n = size(table%square(degree)%weight)
      allocate (points(2, n), weights(n))
      do i = 1, n
        associate (xi => table%square(degree)%xi(:, i))
          points(:, i) = (polygon%x(:, 1) + polygon%x(:, 3))/2 + xi(1)*u + xi(2)*v
        end associate
        weights(i) = area*table%square(degree)%weight(i)
      end do
      return
    end if
    call triangulate(polygon, n_triangles, triangle, ok)
    m = size(table%triangle(degree)%weight)
    n = m*n_triangles
    allocate (points(2, n), weights(n))
    do k = 1, n_triangles
      u = triangle(:, 2, k) - triangle(:, 1, k)
      v = triangle(:, 3, k) - triangle(:, 1, k)
      area = u(1)*v(2) - u(2)*v(1)
      do i = 1, m
        associate (xi => table%triangle(degree)%xi(:, i))
          points(:, (k - 1)*m + i) = triangle(:, 1, k) + xi(1)*u + xi(2)*v
        end associate
        weights((k - 1)*m + i) = area*table%triangle(degree)%weight(i)
      end do
    end do
  end subroutine polygon_rule

  !> Append points to a rule that grows.
  pure subroutine append_points(points, weights, n, xi, weight)
    real(dp), intent(in) :: points(:, :)  !! New points (d, m) [].
    real(dp), intent(in) :: weights(:)  !! New weights (m) [].
    integer, intent(inout) :: n  !! Number of points in the buffers, before and after.
    real(dp), allocatable, intent(inout) :: xi(:, :)  !! Buffer of points (d, room) [].
    real(dp), allocatable, intent(inout) :: weight(:)  !! Buffer of weights (room) [].
    real(dp), allocatable :: more(:, :), more_weight(:)
    integer :: m
    m = size(weights)
    if (.not. allocated(weight)) allocate (xi(size(points, 1), 2*m), weight(2*m))
    if (n + m > size(weight)) then
      allocate (more(size(points, 1), 2*(n + m)), more_weight(2*(n + m)))
      more(:, 1:n) = xi(:, 1:n)
      more_weight(1:n) = weight(1:n)
      call move_alloc(more, xi)
      call move_alloc(more_weight, weight)
    end if
    xi(:, n + 1:n + m) = points
    weight(n + 1:n + m) = weights
    n = n + m
  end subroutine append_points

  !> Variation of the area per reference area over a facet, (max - min)/(max + min) of its corners; 0 for other facets
  !> than quadrilaterals [].
  pure real(dp) function distortion(set, facet) result(ratio)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: facet  !! Facet number.
    real(dp), parameter :: corner(2, 4) = &
      reshape([-1.0_dp, -1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp], [2, 4])
    real(dp) :: area(4)
    real(dp), dimension(3) :: x, xu, xv, xuu, xuv, xvv
    integer :: i
    ratio = 0
    if (set%corners(facet) /= 4) return
    do i = 1, 4
      call evaluate_facet(set%coefficient(:, :, facet), corner(1, i), corner(2, i), x, xu, xv, xuu, xuv, xvv)
      area(i) = dot_product(set%axis(:, facet), [xu(2)*xv(3) - xu(3)*xv(2), xu(3)*xv(1) - xu(1)*xv(3), &
                                                 xu(1)*xv(2) - xu(2)*xv(1)])
    end do
    ratio = min(max_distortion, (maxval(area) - minval(area))/max(maxval(area) + minval(area), tiny(ratio)))
  end function distortion

  !> Fit the weights of a mortar segment between two flat parallel facets.
  pure subroutine fit_segment_weights(plane, set_a, facet_a, kind_a, set_b, facet_b, kind_b, polygon, table, xi, &
                                      weight, fits)
    type(auxiliary_plane_t), intent(in) :: plane  !! Auxiliary plane of the slave facet, which is a plane polygon.
    type(facet_set_t), intent(in) :: set_a  !! Facets of the slave surface.
    type(facet_set_t), intent(in) :: set_b  !! Facets of the master surface.
    integer, intent(in) :: facet_a  !! Slave facet.
    integer, intent(in) :: kind_a  !! Element kind of the slave facet.
    integer, intent(in) :: facet_b  !! Master facet.
    integer, intent(in) :: kind_b  !! Element kind of the master facet.
    type(polygon_t), intent(in) :: polygon  !! Mortar segment in the auxiliary plane.
    type(rule_table_t), intent(in) :: table  !! Quadrature rules on reference domains, by degree.
    real(dp), intent(in) :: xi(:, :)  !! Quadrature points in reference coordinates of the slave facet (2, n) [].
    real(dp), intent(inout) :: weight(:)  !! Quadrature weights there, fitted on return (n) [].
    !> A small change was enough; otherwise the weights are unchanged, and a rule with more points is needed.
    logical, intent(out) :: fits
    real(dp), allocatable :: points(:, :), weights(:), values(:, :), integrals(:), fitted(:), projected(:, :), scale(:)
    real(dp) :: diameter_ratio, ratio
    real(dp), dimension(3) :: x, xu, xv, xuu, xuv, xvv
    integer :: n, m, i, degree
    logical :: ok
    fits = .false.
    ! The inverse maps have square-root singularities outside the segment at this relative distance: the quadrature
    ! error decreases like a power of it.
    diameter_ratio = min(1.0_dp, norm2(maxval(polygon%x(:, 1:polygon%n), dim=2) - &
                                       minval(polygon%x(:, 1:polygon%n), dim=2))/ &
                         min(set_a%size(facet_a), set_b%size(facet_b)))
    ratio = max(min_distortion, diameter_ratio*max(distortion(set_a, facet_a), distortion(set_b, facet_b)))
    degree = min(max_degree, base_degree + ceiling(round_off_exponent/log(1/ratio + sqrt(1/ratio**2 - 1))))
    call polygon_rule(polygon, table, degree, m, points, weights, ok)
    if (.not. ok) return
    n = kind_nodes(kind_a) + kind_nodes(kind_b)
    allocate (values(n, max(m, size(weight))), integrals(n), projected(2, size(weight)), scale(size(weight)))
    call shapes_in_plane(points, values(:, 1:m), ok)
    if (.not. ok) return
    integrals = matmul(values(:, 1:m), weights)
    do i = 1, size(weight)
      call evaluate_facet(set_a%coefficient(:, :, facet_a), xi(1, i), xi(2, i), x, xu, xv, xuu, xuv, xvv)
      projected(:, i) = matmul(x, plane%axes(:, 1:2))
      associate (u => matmul(xu, plane%axes(:, 1:2)), v => matmul(xv, plane%axes(:, 1:2)))
        scale(i) = u(1)*v(2) - u(2)*v(1)
      end associate
    end do
    call shapes_in_plane(projected, values(:, 1:size(weight)), ok)
    if (.not. ok) return
    fitted = weight*scale
    call fit_weights(values(:, 1:size(weight)), integrals, fitted, fits)
    if (fits) weight = fitted/scale

  contains

    !> Shape functions of both facets at points of the auxiliary plane.
    pure subroutine shapes_in_plane(p, shape, ok)
      real(dp), intent(in) :: p(:, :)  !! Points (2, n) [length].
      !> Shape functions of the slave facet, then of the master facet (n_functions, n) [].
      real(dp), intent(out) :: shape(:, :)
      logical, intent(out) :: ok  !! The inverse maps of all points were found.
      real(dp) :: a(2), b(2), shift(2), determinant
      integer :: k
      a = reference_centre(set_a%corners(facet_a))
      b = reference_centre(set_b%corners(facet_b))
      shift = plane%to_plane(set_b%origin(:, facet_b))
      do k = 1, size(p, 2)
        call inverse_map(set_a%coefficient(:, :, facet_a), [0.0_dp, 0.0_dp], plane%axes, plane%size, p(:, k), a, &
                         determinant, ok)
        if (ok) &
          call inverse_map(set_b%coefficient(:, :, facet_b), shift, plane%axes, set_b%size(facet_b), p(:, k), b, &
                           determinant, ok)
        if (.not. ok) return
        call shape_functions(kind_a, a, shape(1:kind_nodes(kind_a), k))
        call shape_functions(kind_b, b, shape(kind_nodes(kind_a) + 1:, k))
      end do
    end subroutine shapes_in_plane
  end subroutine fit_segment_weights

  !> Smallest relative change of weights that gives functions prescribed integrals. Dependent functions are allowed;
  !> nothing changes where a weight would change by more than `max_change`.
  pure subroutine fit_weights(values, integrals, weights, fits)
    real(dp), intent(in) :: values(:, :)  !! Values of the functions at the points (n_functions, n_points) [].
    real(dp), intent(in) :: integrals(:)  !! Prescribed integrals (n_functions) [length^2].
    real(dp), intent(inout) :: weights(:)  !! Weights (n_points) [length^2].
    logical, intent(out) :: fits  !! The integrals are met.
    real(dp) :: v(size(weights), size(integrals)), residual(size(integrals)), length(size(integrals)), q(size(weights))
    real(dp) :: change(size(weights)), scale, coefficient, total
    logical :: remaining(size(integrals))
    integer :: i, j, k, n, sweep
    n = size(integrals)
    do sweep = 1, 2   ! the second removes the round-off of the first
      do j = 1, n
        v(:, j) = values(j, :)*sqrt(weights)
        residual(j) = integrals(j) - sum(values(j, :)*weights)
        length(j) = norm2(v(:, j))
      end do
      scale = maxval(length)
      total = sum(weights)
      remaining = .true.
      change = 0
      ! Gram-Schmidt orthogonalization, the longest vector first.
      do i = 1, n
        k = maxloc(length, dim=1, mask=remaining)
        if (.not. length(k) > given_rounding*scale) exit
        remaining(k) = .false.
        ! A nearly dependent function has its integral with the others, or too small a component of its own to correct
        ! it.
        if (length(k) < no_offset*scale .and. &
            (abs(residual(k)) < integral_round_off*total .or. &
             abs(residual(k)) > max_dependent_change*length(k)*sqrt(total))) cycle
        q = v(:, k)/length(k)
        change = change + residual(k)/length(k)*q
        do j = 1, n
          if (.not. remaining(j)) cycle
          coefficient = dot_product(q, v(:, j))
          v(:, j) = v(:, j) - coefficient*q
          residual(j) = residual(j) - coefficient*residual(k)/length(k)
          coefficient = dot_product(q, v(:, j))   ! reorthogonalization against round-off
          v(:, j) = v(:, j) - coefficient*q
          residual(j) = residual(j) - coefficient*residual(k)/length(k)
          length(j) = norm2(v(:, j))
        end do
      end do
      change = change/sqrt(weights)
      fits = all(abs(change) < max_change)
      if (.not. fits) return
      weights = weights*(1 + change)
    end do
  end subroutine fit_weights
end module dotyk_contact_segment_quadrature
