!> Quadrature rules on the reference domains: positive weights, points inside, any degree.
!>
!> Lines, quadrilaterals and hexahedra: tensor products of Gauss-Legendre rules, exact for the degree in each variable.
!> Triangles and tetrahedra: symmetric rules where short ones are known, conical products of Gauss-Jacobi rules beyond,
!> exact for the total degree. Prisms: triangle x line. Pyramids: conical products of Gauss-Legendre and Gauss-Jacobi
!> rules, exact for the total degree and in each of the collapsed coordinates.
module dotyk_mesh_quadrature
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element_kind, only: element_line2, element_line3, element_quad4, element_quad8, element_quad9, &
    element_tet10, element_tet4, element_tri3, element_tri6, element_hex20, element_hex27, element_hex8, &
    element_pyramid13, element_pyramid14, element_pyramid5
  use dotyk_mesh_gauss, only: gauss_jacobi
  use dotyk_mesh_simplex_rule, only: tetrahedron_rule, triangle_rule
  implicit none
  private
  public :: quadrature_rule

contains

  !> The rule with the fewest points that is exact for a degree.
  pure subroutine quadrature_rule(kind, degree, points, weights)
    integer, intent(in) :: kind  !! Element kind.
    !> Polynomial degree that is integrated exactly: total on simplices and pyramids, in each variable on
    !> products.
    integer, intent(in) :: degree
    real(dp), allocatable, intent(out) :: points(:, :)  !! Reference coordinates (dimension, n) [].
    !> Weights, whose sum is the measure of the reference domain (n) [].
    real(dp), allocatable, intent(out) :: weights(:)
    real(dp), allocatable :: flat(:, :), flat_weights(:)
    real(dp) :: x(degree/2 + 1), w(degree/2 + 1)
    integer :: n, m, i
    n = degree/2 + 1
    call gauss_jacobi(n, 0, x, w)
    ! From [0,1] to [-1,1].
    x = 2*x - 1
    w = 2*w
    select case (kind)
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
end module dotyk_mesh_quadrature
