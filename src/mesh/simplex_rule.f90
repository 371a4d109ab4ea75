!> Quadrature on the unit triangle and the unit tetrahedron: exact for the total degree, positive weights, points
!> inside.
!>
!> Symmetric rules are written as orbits of one point in barycentric coordinates under the permutations of the corners.
!> Sources: triangle, Radon (degree 5), Strang and Fix, Dunavant 1985 (4, 6, 8); tetrahedron, Walkington 2000 (5), Keast
!> 1986 (6), and for degree 3 the rule of 8 points of Felippa 2004. Their numbers were refined to 20 digits by Newton's
!> method on the moment equations.
module dotyk_mesh_simplex_rule
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_gauss, only: gauss_jacobi
  implicit none
  private
  public :: triangle_rule, tetrahedron_rule

  real(dp), parameter :: third = 1/3.0_dp, quarter = 0.25_dp  !! Barycentric coordinates of the centres.

contains

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
end module dotyk_mesh_simplex_rule
