!> The scheme of a scene with ties.
module dotyk_driver_tied_scheme
  use dotyk_base_text, only: text_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_joined_rows, only: find_joined_rows
  use dotyk_scheme_condensation, only: slide_t
  use dotyk_scheme_condensed_qp, only: ties_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_tied, only: tied_t
  implicit none
  private
  public :: tie_bodies

contains

  !> The scheme for tied bodies.
  subroutine tie_bodies(problem, scheme, tied)
    !> Pairs and ties.
    type(contact_problem_t), intent(in) :: problem
    !> Scheme of the run.
    class(scheme_t), intent(in) :: scheme
    !> The same for groups of tied bodies.
    class(scheme_t), allocatable, intent(inout) :: tied
    type(ties_t) :: ties
    integer, allocatable :: n_split(:, :)
    integer :: k, first
    first = sum(problem%pair%n_rows) + 1
    ties%first_tie = first
    allocate (ties%slide(0), ties%name(size(problem%tie)), ties%first_row(size(problem%tie)))
    do k = 1, size(problem%tie)
      associate (tie => problem%tie(k), n => problem%tie(k)%component(1)%n_rows, d => size(problem%tie(k)%component))
        if (tie%slides) ties%slide = [ties%slide, slide_t(first, n, d, tie%normal, tie%force)]
        ties%name(k)%s = tie%name
        ties%first_row(k) = first
        first = first + d*n
      end associate
    end do
    call find_joined_rows(problem%pair, problem%tie, ties%joined_row, n_split)
    if (allocated(tied)) deallocate (tied)
    allocate (tied_t :: tied)
    select type (tied)
    type is (tied_t)
      allocate (tied%of_groups, source=scheme)
      tied%ties = ties
    end select
  end subroutine tie_bodies
end module dotyk_driver_tied_scheme
