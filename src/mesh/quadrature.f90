!> Quadrature rules on the reference domains: positive weights, points inside, any degree.
!>
!> Lines, quadrilaterals and hexahedra: tensor products of Gauss-Legendre rules, exact for the degree in each variable.
!> Triangles and tetrahedra: symmetric rules where short ones are known, conical products of Gauss-Jacobi rules beyond,
!> exact for the total degree. Prisms: triangle x line. Pyramids: conical products of Gauss-Legendre and Gauss-Jacobi
!> rules, exact for the total degree and in each of the collapsed coordinates.
!>
!> Symmetric rules are written as orbits of one point in barycentric coordinates under the permutations of the corners.
!> Sources: triangle, Radon (degree 5), Strang and Fix, Dunavant 1985 (4, 6, 8); tetrahedron, Walkington 2000 (5), Keast
!> 1986 (6), and for degree 3 the rule of 8 points of Felippa 2004. Their numbers were refined to 20 digits by Newton's
!> method on the moment equations.
module dotyk_mesh_quadrature
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: pi
  use dotyk_mesh_element_kind, only: element_hex20, element_hex27, element_hex8, element_line2, element_line3, &
    element_point, element_pyramid13, element_pyramid14, element_pyramid5, element_quad4, element_quad8, &
    element_quad9, element_tet10, element_tet4, element_tri3, element_tri6
  implicit none
  private
  public :: quadrature_rule

  real(dp), parameter :: third = 1/3.0_dp, quarter = 0.25_dp  !! Barycentric coordinates of the centres.

contains

  !> The rule with the fewest points that is exact for a degree.
  pure subroutine quadrature_rule(kind, degree, points, weights)
    integer, intent(in) :: kind  !! Element kind.
    !> Polynomial degree that is integrated exactly: total on simplices and pyramids, in each variable on
    !> products.
    integer, intent(in) :: degree
    real(dp), allocatable, intent(out) :: points(:, :)  !! Reference coordinates (dimension, n) [].
    real(dp), allocatable, intent(out) :: weights(:)  !! Weights; their sum is that of the reference domain (n) [].
    real(dp), allocatable :: flat(:, :), flat_weights(:)
    real(dp) :: x(degree/2 + 1), w(degree/2 + 1)
    integer :: n, m, i
    n = degree/2 + 1
    call gauss_jacobi(n, 0, x, w)
    ! From [0,1] to [-1,1].
    x = 2*x - 1
    w = 2*w
    select case (kind)
    case (element_point)
      allocate (points(0, 1), weights(1))
      weights = 1
    case (element_line2, element_line3)
      call product_rule(1, n, x, w, points, weights)
    case (element_quad4, element_quad8, element_quad9)
      call product_rule(2, n, x, w, points, weights)
    case (element_hex8, element_hex20, element_hex27)
      call product_rule(3, n, x, w, points, weights)
    case (element_tri3, element_tri6)
      call triangle_rule(degree, points, weights)
    case (element_tet4, element_tet10)
      call tetrahedron_rule(degree, points, weights)
    case (element_pyramid5, element_pyramid13, element_pyramid14)
      call pyramid_rule(n, x, w, points, weights)
    case default
      call triangle_rule(degree, flat, flat_weights)
      m = size(flat_weights)
      allocate (points(3, m*n), weights(m*n))
      do i = 1, n
        points(:2, (i - 1)*m + 1:i*m) = flat
        points(3, (i - 1)*m + 1:i*m) = x(i)
        weights((i - 1)*m + 1:i*m) = flat_weights*w(i)
      end do
    end select
  end subroutine quadrature_rule

  !> Tensor product of a rule on the line with itself; the first variable runs fastest.
  pure subroutine product_rule(d, n, x, w, points, weights)
    integer, intent(in) :: d  !! Dimension.
    integer, intent(in) :: n  !! Number of points of the rule on the line.
    real(dp), intent(in) :: x(n)  !! Points on the line (n) [].
    real(dp), intent(in) :: w(n)  !! Weights on the line (n) [].
    real(dp), allocatable, intent(out) :: points(:, :)  !! Points of the product (d, n**d) [].
    real(dp), allocatable, intent(out) :: weights(:)  !! Weights of the product (n**d) [].
    integer :: i, k, index, digit
    allocate (points(d, n**d), weights(n**d))
    do i = 1, n**d
      index = i - 1
      weights(i) = 1
      do k = 1, d
        digit = mod(index, n) + 1
        index = index/n
        points(k, i) = x(digit)
        weights(i) = weights(i)*w(digit)
      end do
    end do
  end subroutine product_rule

  !> Conical product: a rule on the square, shrunk towards the apex, at each height of a Gauss-Jacobi rule.
  pure subroutine pyramid_rule(n, x, w, points, weights)
    integer, intent(in) :: n  !! Number of points of the rules on the line and of heights.
    real(dp), intent(in) :: x(n)  !! Points on the line (n) [].
    real(dp), intent(in) :: w(n)  !! Weights on the line (n) [].
    real(dp), allocatable, intent(out) :: points(:, :)  !! Points (3, n**3) [].
    real(dp), allocatable, intent(out) :: weights(:)  !! Weights (n**3) [].
    real(dp), allocatable :: flat(:, :), flat_weights(:)
    real(dp) :: height(n), height_weight(n)
    integer :: i, m
    call product_rule(2, n, x, w, flat, flat_weights)
    ! The area of a section decreases as (1 - height)^2.
    call gauss_jacobi(n, 2, height, height_weight)
    m = n**2
    allocate (points(3, m*n), weights(m*n))
    do i = 1, n
      points(:2, (i - 1)*m + 1:i*m) = (1 - height(i))*flat
      points(3, (i - 1)*m + 1:i*m) = height(i)
      weights((i - 1)*m + 1:i*m) = height_weight(i)*flat_weights
    end do
  end subroutine pyramid_rule

  !> Gauss rule with n points on [0,1] for the weight (1-x)^alpha: exact for degree 2n-1. alpha = 0 is Gauss-Legendre.
  !>
  !> Newton's method on the Jacobi polynomial P_n^(alpha,0), deflated by the roots already found.
  pure subroutine gauss_jacobi(n, alpha, x, w)
    integer, intent(in) :: n  !! Number of points.
    integer, intent(in) :: alpha  !! Exponent of the weight, 0 or above.
    real(dp), intent(out) :: x(n)  !! Points, ascending (n) [].
    real(dp), intent(out) :: w(n)  !! Weights, whose sum is 1/(alpha+1) (n) [].
    integer, parameter :: most_steps = 100
    real(dp) :: t, p, derivative, change, last
    integer :: i, step
    last = -1
    do i = 1, n
      t = -cos(pi*(2*i - 1)/(2*n))
      ! Start: Chebyshev point; from the second root on its mean with the previous root, as roots lie closer to -1.
      if (i > 1) t = 0.5_dp*(t + last)
      do step = 1, most_steps
        call jacobi(n, alpha, t, p, derivative)
        change = -p/(derivative - p*sum(1/(t - (2*x(:i - 1) - 1))))
        t = t + change
        if (abs(change) <= epsilon(t)) exit
      end do
      call jacobi(n, alpha, t, p, derivative)
      last = t
      x(i) = 0.5_dp*(1 + t)
      w(i) = 1/((1 - t)*(1 + t)*derivative**2)
    end do
    ! Removes the effect of the round-off of the roots on the weights.
    w = w/((alpha + 1)*sum(w))
  end subroutine gauss_jacobi

  !> Jacobi polynomial P_n^(alpha,0) and its derivative, by the three-term recurrence (Abramowitz and Stegun 22.7.1,
  !> 22.8.1).
  pure subroutine jacobi(n, alpha, t, p, derivative)
    integer, intent(in) :: n  !! Degree, 1 or above.
    integer, intent(in) :: alpha  !! Exponent alpha.
    real(dp), intent(in) :: t  !! Argument, inside (-1,1) [].
    real(dp), intent(out) :: p  !! Value [].
    real(dp), intent(out) :: derivative  !! Derivative [].
    real(dp) :: previous, next, a, two
    integer :: k
    a = alpha
    previous = 1
    p = 0.5_dp*(a + (a + 2)*t)
    do k = 2, n
      two = 2*k + a
      next = ((two - 1)*(two*(two - 2)*t + a**2)*p - 2*(k + a - 1)*(k - 1)*two*previous)/(2*k*(k + a)*(two - 2))
      previous = p
      p = next
    end do
    two = 2*n + a
    derivative = (n*(a - two*t)*p + 2*(n + a)*n*previous)/(two*(1 - t)*(1 + t))
  end subroutine jacobi

  !> Rule on the unit triangle; the sum of the weights is 1/2.
  pure subroutine triangle_rule(degree, points, weights)
    integer, intent(in) :: degree  !! Total degree.
    real(dp), allocatable, intent(out) :: points(:, :)  !! Points (2, n) [].
    real(dp), allocatable, intent(out) :: weights(:)  !! Weights (n) [].
    real(dp) :: r
    allocate (points(2, 0), weights(0))
    select case (degree)
    case (:1)
      call add_orbit([third, third, third], 1.0_dp, points, weights)
    case (2)
      call add_orbit([2*third, 0.5_dp*third, 0.5_dp*third], third, points, weights)
    case (3:4)
      call add_opposite(0.44594849091596488632_dp, 0.22338158967801146570_dp, points, weights)
      call add_opposite(0.091576213509770743460_dp, 0.10995174365532186764_dp, points, weights)
    case (5)
      r = sqrt(15.0_dp)
      call add_orbit([third, third, third], 9/40.0_dp, points, weights)
      call add_opposite((6 - r)/21, (155 - r)/1200, points, weights)
      call add_opposite((6 + r)/21, (155 + r)/1200, points, weights)
    case (6)
      call add_opposite(0.24928674517091042129_dp, 0.11678627572637936603_dp, points, weights)
      call add_opposite(0.063089014491502228340_dp, 0.050844906370206816921_dp, points, weights)
      call add_general(0.053145049844816947353_dp, 0.31035245103378440542_dp, 0.082851075618373575194_dp, &
                       points, weights)
    case (7:8)
      call add_orbit([third, third, third], 0.14431560767778716825_dp, points, weights)
      call add_opposite(0.45929258829272315603_dp, 0.095091634267284624794_dp, points, weights)
      call add_opposite(0.17056930775176020662_dp, 0.10321737053471825028_dp, points, weights)
      call add_opposite(0.050547228317030975458_dp, 0.032458497623198080311_dp, points, weights)
      call add_general(0.0083947774099576053372_dp, 0.26311282963463811342_dp, 0.027230314174434994265_dp, &
                       points, weights)
    case default
      call conical_rule(2, degree/2 + 1, points, weights)
      return
    end select
    weights = weights/2
  end subroutine triangle_rule

  !> Rule on the unit tetrahedron; the sum of the weights is 1/6.
  pure subroutine tetrahedron_rule(degree, points, weights)
    integer, intent(in) :: degree  !! Total degree.
    real(dp), allocatable, intent(out) :: points(:, :)  !! Points (3, n) [].
    real(dp), allocatable, intent(out) :: weights(:)  !! Weights (n) [].
    real(dp) :: a, b, r
    allocate (points(3, 0), weights(0))
    select case (degree)
    case (:1)
      call add_orbit([quarter, quarter, quarter, quarter], 1.0_dp, points, weights)
    case (2)
      call add_opposite((5 - sqrt(5.0_dp))/20, quarter, points, weights)
    case (3)
      r = sqrt(17.0_dp)
      a = 55 - 3*r
      b = sqrt(1022 - 134*r)
      r = quarter/2 + sqrt((1715161837 - 406006699*r)/23101)/3120
      call add_opposite((a + b)/196, r, points, weights)
      call add_opposite((a - b)/196, quarter - r, points, weights)
    case (4:5)
      call add_opposite(0.31088591926330060980_dp, 0.11268792571801585080_dp, points, weights)
      call add_opposite(0.092735250310891226402_dp, 0.073493043116361949544_dp, points, weights)
      a = 0.045503704125649649492_dp
      call add_orbit([a, a, 0.5_dp - a, 0.5_dp - a], 0.042546020777081466438_dp, points, weights)
    case (6)
      call add_opposite(0.21460287125915202929_dp, 0.039922750258167492100_dp, points, weights)
      call add_opposite(0.040673958534611353116_dp, 0.010077211055320642948_dp, points, weights)
      call add_opposite(0.32233789014227551034_dp, 0.055357181543654722095_dp, points, weights)
      call add_general(0.063661001875017525299_dp, 0.26967233145831580803_dp, 27/560.0_dp, points, weights)
    case default
      call conical_rule(3, degree/2 + 1, points, weights)
      return
    end select
    weights = weights/6
  end subroutine tetrahedron_rule

  !> Add the orbit of a point on a median, with the barycentric coordinates a, ..., a and the remainder.
  pure subroutine add_opposite(a, weight, points, weights)
    real(dp), intent(in) :: a  !! Repeated coordinate [].
    real(dp), intent(in) :: weight  !! Weight of each point [].
    real(dp), allocatable, intent(inout) :: points(:, :)  !! Points so far, extended on return (d, n) [].
    real(dp), allocatable, intent(inout) :: weights(:)  !! Weights so far, extended on return (n) [].
    real(dp) :: bary(size(points, 1) + 1)
    bary = a
    bary(1) = 1 - size(points, 1)*a
    call add_orbit(bary, weight, points, weights)
  end subroutine add_opposite

  !> Add the orbit of a point with the barycentric coordinates a, ..., a, b and the remainder.
  pure subroutine add_general(a, b, weight, points, weights)
    real(dp), intent(in) :: a  !! Repeated coordinate [].
    real(dp), intent(in) :: b  !! Single coordinate [].
    real(dp), intent(in) :: weight  !! Weight of each point [].
    real(dp), allocatable, intent(inout) :: points(:, :)  !! Points so far, extended on return (d, n) [].
    real(dp), allocatable, intent(inout) :: weights(:)  !! Weights so far, extended on return (n) [].
    real(dp) :: bary(size(points, 1) + 1)
    bary = a
    bary(1) = 1 - b - (size(points, 1) - 1)*a
    bary(2) = b
    call add_orbit(bary, weight, points, weights)
  end subroutine add_general

  !> Add all distinct permutations of a point. Its equal coordinates are equal to the bit.
  pure subroutine add_orbit(bary, weight, points, weights)
    real(dp), intent(in) :: bary(:)  !! Barycentric coordinates of one point (d+1) [].
    real(dp), intent(in) :: weight  !! Weight of each point [].
    real(dp), allocatable, intent(inout) :: points(:, :)  !! Points so far, extended on return (d, n) [].
    real(dp), allocatable, intent(inout) :: weights(:)  !! Weights so far, extended on return (n) [].
    real(dp) :: permuted(size(bary)), orbit(size(bary), 24)
    integer :: order(size(bary)), n, d, code, digit, i, k
    d = size(bary)
    n = 0
    do code = 0, d**d - 1
      k = code
      do i = 1, d
        digit = mod(k, d)
        k = k/d
        order(i) = digit + 1
      end do
      if (any([(count(order == i) /= 1, i=1, d)])) cycle
      permuted = bary(order)
      if (any([(all(abs(orbit(:, i) - permuted) <= 0), i=1, n)])) cycle
      n = n + 1
      orbit(:, n) = permuted
    end do
    points = reshape([points, orbit(2:, :n)], [d - 1, size(points, 2) + n])
    weights = [weights, [(weight, i=1, n)]]
  end subroutine add_orbit

  !> Conical product of Gauss-Jacobi rules, exact for the total degree 2n-1.
  pure subroutine conical_rule(d, n, points, weights)
    integer, intent(in) :: d  !! Dimension, 2 or 3.
    integer, intent(in) :: n  !! Number of points on the line.
    real(dp), allocatable, intent(out) :: points(:, :)  !! Points (d, n**d) [].
    real(dp), allocatable, intent(out) :: weights(:)  !! Weights (n**d) [].
    real(dp) :: x(n, d), w(n, d), remainder
    integer :: i, k, index, digit
    do k = 1, d
      call gauss_jacobi(n, d - k, x(:, k), w(:, k))
    end do
    allocate (points(d, n**d), weights(n**d))
    do i = 1, n**d
      index = i - 1
      remainder = 1
      weights(i) = 1
      do k = 1, d
        digit = mod(index, n) + 1
        index = index/n
        points(k, i) = remainder*x(digit, k)
        remainder = remainder*(1 - x(digit, k))
        weights(i) = weights(i)*w(digit, k)
      end do
    end do
  end subroutine conical_rule
end module dotyk_mesh_quadrature
