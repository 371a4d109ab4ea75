!> Monomials in two or three variables, and their values at nodes.
!>
!> Each monomial is an earlier one times a variable, so that a value costs one multiplication.
module dotyk_elasticity_monomials
  use dotyk_base_kinds, only: dp
  implicit none
  private

  type, public :: monomials_t  !! All monomials up to a degree, lower degrees first.
    integer :: dimension = 0  !! Number of variables.
    integer :: degree = 0  !! Degree.
    integer :: n = 0  !! Number of monomials.
    integer :: n_lower = 0  !! Number of monomials of one degree less.
    integer, allocatable :: exponent(:, :)  !! Exponents (dimension, n).
    !> Monomial k is monomial parent(k) times variable axis(k); the first one, 1, has no parent (n).
    integer, allocatable :: parent(:)
    integer, allocatable :: axis(:)  !! Variable of this product (n).
    !> The derivative of a monomial by a variable is its exponent times this monomial; 0 for none (dimension, n).
    integer, allocatable :: derivative(:, :)
  contains
    procedure :: init => monomials_init
    procedure :: up_to => monomials_up_to
  end type monomials_t

  !> Number of nodes that are processed together: the length of the inner loops, a multiple of any vector length.
  integer, parameter, public :: lanes = 8

  public :: evaluate_monomials

contains

  !> List the monomials.
  subroutine monomials_init(self, dimension, degree)
    class(monomials_t), intent(out) :: self
    integer, intent(in) :: dimension  !! Number of variables, 2 or 3.
    integer, intent(in) :: degree  !! Degree, at least 1.
    integer :: k, i, e(dimension)
    self%dimension = dimension
    self%degree = degree
    self%n = number_up_to(dimension, degree)
    self%n_lower = number_up_to(dimension, degree - 1)
    call list_exponents(dimension, degree, self%exponent)
    allocate (self%parent(self%n), self%axis(self%n), source=0)
    do k = 2, self%n
      e = self%exponent(:, k)
      i = findloc(e > 0, .true., dim=1)
      e(i) = e(i) - 1
      self%parent(k) = position_of(self%exponent(:, :k - 1), e)
      self%axis(k) = i
    end do
    allocate (self%derivative(dimension, self%n))
    do k = 1, self%n
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
    integer, intent(in) :: degree  !! Degree, at most that of the list.
    n = number_up_to(self%dimension, degree)
  end function monomials_up_to

  !> Number of monomials up to a degree.
  pure integer function number_up_to(dimension, degree) result(n)
    integer, intent(in) :: dimension  !! Number of variables, 2 or 3.
    integer, intent(in) :: degree  !! Degree.
    n = (degree + 1)*(degree + 2)/2
    if (dimension == 3) n = n*(degree + 3)/3
  end function number_up_to

  !> Position of exponents in a list, 0 where they are not in it.
  pure integer function position_of(list, exponent) result(place)
    integer, intent(in) :: list(:, :)  !! Exponents of monomials (dimension, n).
    integer, intent(in) :: exponent(:)  !! The exponents searched for (dimension).
    do place = size(list, 2), 1, -1
      if (all(list(:, place) == exponent)) return
    end do
  end function position_of

  !> Exponents of all monomials up to a degree, lower degrees first.
  pure subroutine list_exponents(dimension, degree, exponent)
    integer, intent(in) :: dimension  !! Number of variables, 2 or 3.
    integer, intent(in) :: degree  !! Degree.
    integer, allocatable, intent(out) :: exponent(:, :)  !! Exponents (dimension, n).
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

  !> Values of monomials at nodes, times the square roots of the nodes' weights.
  pure subroutine evaluate_monomials(dim, n, n_blocks, parent, axis, t, root_weight, power)
    integer, intent(in) :: dim  !! Number of variables.
    integer, intent(in) :: n  !! Number of monomials.
    integer, intent(in) :: n_blocks  !! Number of blocks of `lanes` nodes.
    integer, intent(in) :: parent(n)  !! Earlier monomial of each product, see `monomials_t` (n).
    integer, intent(in) :: axis(n)  !! Variable of each product, see `monomials_t` (n).
    real(dp), intent(in) :: t(lanes, dim, n_blocks)  !! Scaled positions of the nodes (lanes, dim, n_blocks) [].
    real(dp), intent(in) :: root_weight(lanes, n_blocks)  !! Square roots of the weights (lanes, n_blocks) [].
    real(dp), intent(out) :: power(lanes, n_blocks, n)  !! Values (lanes, n_blocks, n) [].
    integer :: b, k
    power(:, :, 1) = root_weight
    do k = 2, n
      do b = 1, n_blocks
        power(:, b, k) = power(:, b, parent(k))*t(:, axis(k), b)
      end do
    end do
  end subroutine evaluate_monomials
end module dotyk_elasticity_monomials
