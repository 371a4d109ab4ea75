!> One body among several with their p-multigrids (`dotyk_scheme_body_grids`).
!>
!> Operations on vectors share a large body out over all threads. Small bodies are too short for that, and are worked on
!> side by side. The digits are the same either way: threads never change a sum.
module dotyk_scheme_grid_body
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_response_contact_map, only: contact_map_t
  use dotyk_response_multigrid_rows, only: multigrid_rows_t
  implicit none
  private
  public :: scatter_rows

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

  type, public :: grid_body_t  !! A body among others.
    integer :: block = 0  !! Its rows of B are those of this body; 0: of the body with its own number.
    integer :: first_motion = 0  !! First mode of the QP that it has as unknowns without stiffness; 0: none are that.
    integer :: representative = 0  !! Body whose p-multigrid is that of this one: congruent bodies share it.
    type(contact_map_t) :: map  !! Contact nodes and their equations.
    integer, allocatable :: row(:)  !! Rows of the problem that involve the body, in the order of `rows`.
    type(multigrid_rows_t) :: rows  !! Its rows on both levels.
  end type grid_body_t

  type, public :: body_vector_t  !! A vector of one body.
    real(dp), allocatable :: value(:)  !! (any)
  end type body_vector_t

  type, public :: grid_pointer_t  !! The p-multigrid of a body.
    class(body_grid_t), pointer :: p => null()  !! Associated for representatives of congruent bodies.
  end type grid_pointer_t

contains

  !> Add a vector over the rows of a body to one over all rows. A row can belong to a body twice.
  pure subroutine scatter_rows(row, own, all)
    integer, intent(in) :: row(:)  !! Rows of the body (n).
    real(dp), intent(in) :: own(:)  !! At these rows (n) [any].
    real(dp), intent(inout) :: all(:)  !! At all rows (n_rows) [as own].
    integer :: i
    do i = 1, size(row)
      all(row(i)) = all(row(i)) + own(i)
    end do
  end subroutine scatter_rows

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
end module dotyk_scheme_grid_body
