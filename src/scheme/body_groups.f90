!> Which bodies are worked on side by side.
!>
!> Operations on vectors share a large body out over all threads. Small bodies are too short for that, and are worked on
!> side by side. The digits are the same either way: threads never change a sum.
module dotyk_scheme_body_groups
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  implicit none
  private

  !> Groups of bodies: one after the other, the bodies of each side by side.
  type, public :: body_groups_t
    !> Number of groups.
    integer :: n = 0
    !> First place of each group in `body` (n + 1).
    integer, allocatable :: first(:)
    !> The bodies, by falling cost (n_bodies).
    integer, allocatable :: body(:)
  contains
    procedure :: init => groups_init
    procedure :: is_many => groups_is_many
  end type body_groups_t

contains

  !> Form the groups: a body that costs more than its share of the machine among the bodies that are no larger is alone.
  subroutine groups_init(self, cost, n_threads)
    class(body_groups_t), intent(out) :: self
    !> Cost of each body (n_bodies) [any].
    real(dp), intent(in) :: cost(:)
    !> Number of threads; 1: all bodies are in one group.
    integer, intent(in) :: n_threads
    real(dp) :: rest
    integer :: k
    allocate (self%body(size(cost)), self%first(1))
    call sort_order(-cost, self%body)
    self%first = 1
    rest = sum(cost)
    do k = 1, size(cost)
      if (.not. cost(self%body(k))*n_threads > rest .or. n_threads == 1) exit
      self%first = [self%first, k + 1]
      rest = rest - cost(self%body(k))
    end do
    if (self%first(size(self%first)) <= size(cost)) self%first = [self%first, size(cost) + 1]
    self%n = size(self%first) - 1
  end subroutine groups_init

  !> Whether a group has several bodies.
  pure logical function groups_is_many(self, group) result(is_many)
    class(body_groups_t), intent(in) :: self
    !> The group.
    integer, intent(in) :: group
    is_many = self%first(group + 1) - self%first(group) > 1
  end function groups_is_many
end module dotyk_scheme_body_groups
