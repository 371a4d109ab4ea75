!> The scheme of a scene with ties.
module dotyk_driver_tied_scheme
  use dotyk_base_text, only: text_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_scheme_condensation, only: slide_t
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
    type(slide_t), allocatable :: slide(:)
    type(text_t), allocatable :: name(:)
    integer, allocatable :: first_row(:)
    integer :: k, first
    first = sum(problem%pair%n_rows) + 1
    allocate (slide(0), name(size(problem%tie)), first_row(size(problem%tie)))
    do k = 1, size(problem%tie)
      associate (tie => problem%tie(k), n => problem%tie(k)%component(1)%n_rows, d => size(problem%tie(k)%component))
        if (tie%slides) slide = [slide, slide_t(first, n, d, tie%normal, tie%force)]
        name(k)%s = tie%name
        first_row(k) = first
        first = first + d*n
      end associate
    end do
    if (allocated(tied)) deallocate (tied)
    allocate (tied_t :: tied)
    select type (tied)
    type is (tied_t)
      allocate (tied%of_groups, source=scheme)
      tied%first_tie = sum(problem%pair%n_rows) + 1
      call move_alloc(slide, tied%slide)
      call move_alloc(first_row, tied%first_row)
      call move_alloc(name, tied%name)
    end select
  end subroutine tie_bodies
end module dotyk_driver_tied_scheme
