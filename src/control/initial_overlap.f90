!> Bodies in no contact pair that overlap as they are placed: parts of an assembly in the wrong place.
!>
!> The search for pairs takes overlaps of a few percent of a body for interference; the check for penetration on the
!> undeformed bodies sees the others. Bodies that no contact pair has are checked.
module dotyk_control_initial_overlap
  use dotyk_base_kinds, only: dp
  use dotyk_contact_broad_phase, only: overlapping_boxes
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_penetration_check, only: body_penetration_t, check_couples, &
    penetration_check_t
  implicit none
  private
  public :: find_initial_overlap

  !> Overlaps below this fraction of the diameter of the smaller body are those of meshes [].
  real(dp), parameter :: least_fraction = 1.0e-3_dp

contains

  !> Find the bodies that overlap before they are loaded.
  subroutine find_initial_overlap(problem, found)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs, with what the search for pairs found.
    !> Couples of bodies, the deepest first, without those that the search names (n_found).
    type(body_penetration_t), allocatable, intent(out) :: found(:)
    type(body_solution_t) :: at_rest(size(problem%body))
    type(penetration_check_t) :: check
    real(dp) :: lo(3, size(problem%body)), hi(3, size(problem%body))
    integer, allocatable :: couple(:, :)
    integer :: b, k, n
    lo = 0
    hi = 0
    do b = 1, size(problem%body)
      associate (x => problem%body(b)%mesh%x)
        lo(1:size(x, 1), b) = minval(x, dim=2)
        hi(1:size(x, 1), b) = maxval(x, dim=2)
        allocate (at_rest(b)%displacement, mold=x)
        at_rest(b)%displacement = 0
      end associate
    end do
    call overlapping_boxes(lo, hi, couple)
    n = 0
    do k = 1, size(couple, 2)
      if (is_known(problem, couple(1, k), couple(2, k))) cycle
      n = n + 1
      couple(:, n) = couple(:, k)
    end do
    allocate (found(0))
    if (n == 0) return
    ! Couples without contact pairs: no row explains anything.
    call check_couples(problem, at_rest, [(1, k=0, size(problem%pair))], [real(dp) ::], 0.0_dp, couple(:, :n), check)
    found = pack(check%found, [(is_gross(problem, check%found(k)), k=1, size(check%found))])
  end subroutine find_initial_overlap

  !> Whether two bodies need no check: they are in a contact pair, which has its smallest gap where they overlap.
  pure logical function is_known(problem, a, b)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    integer, intent(in) :: a  !! Index of a body.
    integer, intent(in) :: b  !! Index of the other body, not lower.
    is_known = a == b .or. problem%are_tied(a, b) .or. any(min(problem%pair%body_a, problem%pair%body_b) == a .and. &
                               max(problem%pair%body_a, problem%pair%body_b) == b)
  end function is_known

  !> Whether an overlap is none that meshes of curved faces make.
  logical function is_gross(problem, overlap)
    type(contact_problem_t), intent(in) :: problem  !! Bodies.
    type(body_penetration_t), intent(in) :: overlap  !! The overlap.
    is_gross = overlap%worst%depth > least_fraction*min(problem%body(overlap%body)%mesh%diameter(), &
                                                        problem%body(overlap%other)%mesh%diameter())
  end function is_gross
end module dotyk_control_initial_overlap
