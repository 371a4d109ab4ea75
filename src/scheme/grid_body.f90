!> One body among several with their p-multigrids (`dotyk_scheme_body_grids`).
module dotyk_scheme_grid_body
  use dotyk_base_kinds, only: dp
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_response_contact_map, only: contact_map_t
  use dotyk_response_multigrid_rows, only: multigrid_rows_t
  implicit none
  private
  public :: scatter_rows

  !> A body among others.
  type, public :: grid_body_t
    !> Body whose p-multigrid is that of this one: congruent bodies share it.
    integer :: representative = 0
    !> Contact nodes and their equations.
    type(contact_map_t) :: map
    !> Rows of the problem that involve the body, in the order of `rows`.
    integer, allocatable :: row(:)
    !> Its rows on both levels.
    type(multigrid_rows_t) :: rows
    !> The body whose `rows` have the compliance: this one, or a congruent one with the same rows.
    integer :: owner = 0
  end type grid_body_t

  !> A vector of one body.
  type, public :: body_vector_t
    !> (any)
    real(dp), allocatable :: value(:)
  end type body_vector_t

  !> The p-multigrid of a body.
  type, public :: grid_pointer_t
    !> Associated for representatives of congruent bodies.
    class(body_grid_t), pointer :: p => null()
  end type grid_pointer_t

contains

  !> Add a vector over the rows of a body to one over all rows. A row can belong to a body twice.
  pure subroutine scatter_rows(row, own, all)
    !> Rows of the body (n).
    integer, intent(in) :: row(:)
    !> At these rows (n) [any].
    real(dp), intent(in) :: own(:)
    !> At all rows (n_rows) [as own].
    real(dp), intent(inout) :: all(:)
    integer :: i
    do i = 1, size(row)
      all(row(i)) = all(row(i)) + own(i)
    end do
  end subroutine scatter_rows
end module dotyk_scheme_grid_body
