!> The contact pairs of each body: of thousands of bodies, a couple has a few of tens of thousands.
module dotyk_control_pairs_of_bodies
  use dotyk_contact_pair, only: contact_pair_t
  implicit none
  private

  type, public :: pairs_of_bodies_t  !! Lists of pairs.
    integer, allocatable :: start(:)  !! Pairs of body b, ascending: pair(start(b):start(b+1)-1) (n_bodies + 1).
    integer, allocatable :: pair(:)  !! See `start`.
  contains
    procedure :: init => pairs_of_bodies_init
    procedure :: of => pairs_of_bodies_of
    procedure :: between => pairs_of_bodies_between
    procedure :: linking => pairs_of_bodies_linking
  end type pairs_of_bodies_t

contains

  !> Find the pairs of all bodies.
  subroutine pairs_of_bodies_init(self, pair, n_bodies)
    class(pairs_of_bodies_t), intent(out) :: self
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer :: next(n_bodies), b, k
    next = 0
    do k = 1, size(pair)
      next(pair(k)%body_a) = next(pair(k)%body_a) + 1
      if (pair(k)%body_b /= pair(k)%body_a) next(pair(k)%body_b) = next(pair(k)%body_b) + 1
    end do
    allocate (self%start(n_bodies + 1))
    self%start(1) = 1
    do b = 1, n_bodies
      self%start(b + 1) = self%start(b) + next(b)
    end do
    next = self%start(:n_bodies)
    allocate (self%pair(self%start(n_bodies + 1) - 1))
    do k = 1, size(pair)
      call put(pair(k)%body_a)
      if (pair(k)%body_b /= pair(k)%body_a) call put(pair(k)%body_b)
    end do
  contains
    !> Add pair k to the list of a body.
    subroutine put(body)
      integer, intent(in) :: body  !! The body.
      self%pair(next(body)) = k
      next(body) = next(body) + 1
    end subroutine put
  end subroutine pairs_of_bodies_init

  !> Pairs of a body, ascending.
  pure function pairs_of_bodies_of(self, body) result(list)
    class(pairs_of_bodies_t), intent(in) :: self
    integer, intent(in) :: body  !! The body.
    integer, allocatable :: list(:)
    list = self%pair(self%start(body):self%start(body + 1) - 1)
  end function pairs_of_bodies_of

  !> Pairs that two bodies have with each other, ascending.
  pure function pairs_of_bodies_between(self, pair, a, b) result(list)
    class(pairs_of_bodies_t), intent(in) :: self
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: a  !! One body.
    integer, intent(in) :: b  !! The other body; may be the same.
    integer, allocatable :: list(:)
    list = self%of(a)
    list = pack(list, (pair(list)%body_a == a .and. pair(list)%body_b == b) .or. &
                (pair(list)%body_b == a .and. pair(list)%body_a == b))
  end function pairs_of_bodies_between

  !> Pairs that push two bodies against each other: their own, or else those with the bodies that touch both.
  pure function pairs_of_bodies_linking(self, pair, a, b) result(list)
    class(pairs_of_bodies_t), intent(in) :: self
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: a  !! One body.
    integer, intent(in) :: b  !! The other body; may be the same.
    integer, allocatable :: list(:), of_a(:), of_b(:)
    integer :: k
    list = self%between(pair, a, b)
    if (size(list) > 0) return
    of_a = self%of(a)
    do k = 1, size(of_a)
      of_b = self%between(pair, pair(of_a(k))%body_a + pair(of_a(k))%body_b - a, b)
      if (size(of_b) > 0) list = [list, of_a(k), of_b]
    end do
  end function pairs_of_bodies_linking
end module dotyk_control_pairs_of_bodies
