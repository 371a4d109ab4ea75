!> Monomials in two or three variables, and sums of them over nodes.
!>
!> Each monomial is an earlier one times a variable: a value costs one multiplication. The sums run over eight nodes at a time.
module dotyk_elasticity_monomials
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> All monomials up to a degree, lower degrees first, and those up to twice the degree, the products of two of them.
  type, public :: monomials_t
    !> Number of variables; degree.
    integer :: dimension = 0, degree = 0
    !> Number of monomials, of those of one degree less, and of products.
    integer :: n = 0, n_lower = 0, n_products = 0
    !> Exponents (dimension, n_products).
    integer, allocatable :: exponent(:, :)
    !> Monomial k is monomial parent(k) times variable axis(k); the first one, 1, has none (n_products).
    integer, allocatable :: parent(:), axis(:)
    !> The product of two monomials (n, n).
    integer, allocatable :: product(:, :)
    !> The derivative of a monomial by a variable is its exponent times this one; 0 for none (dimension, n).
    integer, allocatable :: derivative(:, :)
  contains
    procedure :: init => monomials_init
    procedure :: up_to => monomials_up_to
  end type monomials_t

  !> Nodes that are worked on at a time.
  integer, parameter, public :: lanes = 8

  public :: sum_products, sum_residuals

contains

  !> List the monomials.
  subroutine monomials_init(self, dimension, degree)
    class(monomials_t), intent(out) :: self
    !> Number of variables, 2 or 3.
    integer, intent(in) :: dimension
    !> At least 1.
    integer, intent(in) :: degree
    integer :: j, k, i, e(dimension)
    self%dimension = dimension
    self%degree = degree
    self%n = number_up_to(dimension, degree)
    self%n_lower = number_up_to(dimension, degree - 1)
    self%n_products = number_up_to(dimension, 2*degree)
    call list_exponents(dimension, 2*degree, self%exponent)
    allocate (self%parent(self%n_products), self%axis(self%n_products), source=0)
    do k = 2, self%n_products
      e = self%exponent(:, k)
      i = findloc(e > 0, .true., dim=1)
      e(i) = e(i) - 1
      self%parent(k) = position_of(self%exponent(:, :k - 1), e)
      self%axis(k) = i
    end do
    allocate (self%product(self%n, self%n), self%derivative(dimension, self%n))
    do k = 1, self%n
      do j = 1, self%n
        self%product(j, k) = position_of(self%exponent, self%exponent(:, j) + self%exponent(:, k))
      end do
      do i = 1, dimension
        e = self%exponent(:, k)
        e(i) = e(i) - 1
        self%derivative(i, k) = position_of(self%exponent(:, :self%n_lower), e)
      end do
    end do
  end subroutine monomials_init

  !> Number of the monomials up to a degree.
  pure integer function monomials_up_to(self, degree) result(n)
    class(monomials_t), intent(in) :: self
    integer, intent(in) :: degree
    n = number_up_to(self%dimension, degree)
  end function monomials_up_to

  !> Number of monomials up to a degree.
  pure integer function number_up_to(dimension, degree) result(n)
    integer, intent(in) :: dimension, degree
    n = (degree + 1)*(degree + 2)/2
    if (dimension == 3) n = n*(degree + 3)/3
  end function number_up_to

  !> Where exponents stand in a list, 0 where they do not.
  pure integer function position_of(list, exponent) result(place)
    integer, intent(in) :: list(:, :), exponent(:)
    do place = size(list, 2), 1, -1
      if (all(list(:, place) == exponent)) return
    end do
  end function position_of

  !> Exponents of all monomials up to a degree, lower degrees first.
  pure subroutine list_exponents(dimension, degree, exponent)
    integer, intent(in) :: dimension, degree
    !> (dimension, number).
    integer, allocatable, intent(out) :: exponent(:, :)
    integer :: total, i, j, n
    allocate (exponent(dimension, number_up_to(dimension, degree)))
    n = 0
    do total = 0, degree
      do i = total, 0, -1
        if (dimension == 2) then
          n = n + 1
          exponent(:, n) = [i, total - i]
        else
          do j = total - i, 0, -1
            n = n + 1
            exponent(:, n) = [i, j, total - i - j]
          end do
        end if
      end do
    end do
  end subroutine list_exponents

  !> Weighted sums over nodes of all products of two monomials, and of the monomials times the values of the nodes.
  pure subroutine sum_products(dim, n, n_products, n_blocks, parent, axis, t, weight, value, moment, rhs)
    !> Numbers of variables, which is that of values of a node, of monomials, of products, of blocks of nodes.
    integer, intent(in) :: dim, n, n_products, n_blocks
    !> As in monomials_t.
    integer, intent(in) :: parent(n_products), axis(n_products)
    !> Places and weights of the nodes; weights of 0 fill the last block up.
    real(dp), intent(in) :: t(lanes, dim, n_blocks), weight(lanes, n_blocks)
    real(dp), intent(in) :: value(lanes, dim, n_blocks)
    real(dp), intent(out) :: moment(n_products), rhs(dim, n)
    real(dp) :: power(lanes, n_products), total(lanes, n_products), side(lanes, dim, n), line(lanes)
    integer :: b, c, k
    total = 0
    side = 0
    do b = 1, n_blocks
      power(:, 1) = weight(:, b)
      total(:, 1) = total(:, 1) + power(:, 1)
      do k = 2, n_products
        line = power(:, parent(k))*t(:, axis(k), b)
        power(:, k) = line
        total(:, k) = total(:, k) + line
      end do
      do k = 1, n
        do c = 1, dim
          side(:, c, k) = side(:, c, k) + power(:, k)*value(:, c, b)
        end do
      end do
    end do
    do k = 1, n_products
      moment(k) = sum_lanes(total(:, k))
    end do
    do k = 1, n
      do c = 1, dim
        rhs(c, k) = sum_lanes(side(:, c, k))
      end do
    end do
  end subroutine sum_products

  !> Weighted sums over nodes of the monomials times what a polynomial leaves of the values of the nodes.
  pure subroutine sum_residuals(dim, n, n_blocks, parent, axis, t, weight, value, coefficient, rhs)
    !> As in sum_products.
    integer, intent(in) :: dim, n, n_blocks
    integer, intent(in) :: parent(n), axis(n)
    real(dp), intent(in) :: t(lanes, dim, n_blocks), weight(lanes, n_blocks), value(lanes, dim, n_blocks)
    !> The polynomials.
    real(dp), intent(in) :: coefficient(dim, n)
    real(dp), intent(out) :: rhs(dim, n)
    real(dp) :: power(lanes, n), rest(lanes, dim), side(lanes, dim, n), line(lanes)
    integer :: b, c, k
    side = 0
    do b = 1, n_blocks
      power(:, 1) = 1
      do k = 2, n
        line = power(:, parent(k))*t(:, axis(k), b)
        power(:, k) = line
      end do
      do c = 1, dim
        line = value(:, c, b)
        do k = 1, n
          line = line - coefficient(c, k)*power(:, k)
        end do
        rest(:, c) = line*weight(:, b)
      end do
      do k = 1, n
        do c = 1, dim
          side(:, c, k) = side(:, c, k) + power(:, k)*rest(:, c)
        end do
      end do
    end do
    do k = 1, n
      do c = 1, dim
        rhs(c, k) = sum_lanes(side(:, c, k))
      end do
    end do
  end subroutine sum_residuals

  !> Sum in a fixed order.
  pure real(dp) function sum_lanes(line) result(total)
    real(dp), intent(in) :: line(lanes)
    total = ((line(1) + line(2)) + (line(3) + line(4))) + ((line(5) + line(6)) + (line(7) + line(8)))
  end function sum_lanes
end module dotyk_elasticity_monomials
