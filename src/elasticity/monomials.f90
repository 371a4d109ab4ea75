!> Monomials in two or three variables, and their values at nodes.
!>
!> Each monomial is an earlier one times a variable: a value costs one multiplication.
module dotyk_elasticity_monomials
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> All monomials up to a degree, lower degrees first.
  type, public :: monomials_t
    !> Number of variables; degree.
    integer :: dimension = 0, degree = 0
    !> Number of monomials, and of those of one degree less.
    integer :: n = 0, n_lower = 0
    !> Exponents (dimension, n).
    integer, allocatable :: exponent(:, :)
    !> Monomial k is monomial parent(k) times variable axis(k); the first one, 1, has none (n).
    integer, allocatable :: parent(:), axis(:)
    !> The derivative of a monomial by a variable is its exponent times this one; 0 for none (dimension, n).
    integer, allocatable :: derivative(:, :)
  contains
    procedure :: init => monomials_init
    procedure :: up_to => monomials_up_to
  end type monomials_t

  !> Nodes that are worked on at a time.
  integer, parameter, public :: lanes = 8

  public :: evaluate_monomials

contains

  !> List the monomials.
  subroutine monomials_init(self, dimension, degree)
    class(monomials_t), intent(out) :: self
    !> Number of variables, 2 or 3.
    integer, intent(in) :: dimension
    !> At least 1.
    integer, intent(in) :: degree
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

  !> Values at nodes, times the roots of the nodes' weights.
  pure subroutine evaluate_monomials(dim, n, n_blocks, parent, axis, t, root_weight, power)
    integer, intent(in) :: dim, n, n_blocks
    !> As in monomials_t.
    integer, intent(in) :: parent(n), axis(n)
    !> Nodes, and the roots of their weights.
    real(dp), intent(in) :: t(lanes, dim, n_blocks), root_weight(lanes, n_blocks)
    real(dp), intent(out) :: power(lanes, n_blocks, n)
    integer :: b, k
    power(:, :, 1) = root_weight
    do k = 2, n
      do b = 1, n_blocks
        power(:, b, k) = power(:, b, parent(k))*t(:, axis(k), b)
      end do
    end do
  end subroutine evaluate_monomials
end module dotyk_elasticity_monomials
