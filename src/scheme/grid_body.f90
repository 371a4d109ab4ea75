!> One body among several with their p-multigrids (`dotyk_scheme_body_grids`).
module dotyk_scheme_grid_body
  use dotyk_base_kinds, only: dp
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_response_contact_map, only: contact_map_t
  use dotyk_response_multigrid_rows, only: multigrid_rows_t
  implicit none
  private
  public :: scatter_rows

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
end module dotyk_scheme_grid_body
