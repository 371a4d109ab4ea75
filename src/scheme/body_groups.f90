!> Which bodies are worked on side by side.
!>
!> Operations on vectors share a large body out over all threads. Small bodies are too short for that, and are worked on
!> side by side. The digits are the same either way: threads never change a sum.
module dotyk_scheme_body_groups
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  implicit none
  private

  !> Bodies in the order in which they are worked on: first those that are alone, one after the other, then all others
  !> side by side. Loops over the first ones stand outside of parallel regions: threads inside of a region with one
  !> thread would be made anew each time.
  type, public :: body_groups_t
    integer :: n_alone = 0  !! Bodies that are alone.
    integer :: n = 0  !! Number of bodies.
    integer, allocatable :: body(:)  !! The bodies, by falling cost (n).
  contains
    procedure :: init => groups_init
  end type body_groups_t

contains

  !> Form the groups: a body that costs more than its share of the machine among the bodies that are no larger is alone,
  !> and so is the only one that is left.
  subroutine groups_init(self, cost, n_threads)
    class(body_groups_t), intent(out) :: self
    real(dp), intent(in) :: cost(:)  !! Cost of each body (n_bodies) [any].
    integer, intent(in) :: n_threads  !! Number of threads; 1: bodies are side by side, if there are several.
    real(dp) :: rest
    integer :: k
    self%n = size(cost)
    allocate (self%body(self%n))
    call sort_order(-cost, self%body)
    rest = sum(cost)
    do k = 1, self%n
      if (.not. cost(self%body(k))*n_threads > rest .or. n_threads == 1) exit
      self%n_alone = k
      rest = rest - cost(self%body(k))
    end do
    if (self%n_alone == self%n - 1) self%n_alone = self%n
  end subroutine groups_init
end module dotyk_scheme_body_groups
