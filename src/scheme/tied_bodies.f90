!> Which bodies ties join.
module dotyk_scheme_tied_bodies
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: find_groups

contains

  !> Groups of bodies that ties join, those without any tie each by itself, in the order of their first bodies.
  subroutine find_groups(qp, first_tie, group_of, n_groups)
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Rows from this one on are ties.
    integer, intent(in) :: first_tie
    !> Group of each body (n_bodies).
    integer, allocatable, intent(out) :: group_of(:)
    !> Number of groups.
    integer, intent(out) :: n_groups
    integer :: i, b, least, number(size(qp%block))
    logical :: changes
    group_of = [(b, b=1, size(qp%block))]
    do
      changes = .false.
      do i = first_tie, qp%n_rows
        associate (one => qp%coarse%body(1, i), other => qp%coarse%body(2, i))
          if (one == 0 .or. other == 0) cycle
          least = min(group_of(one), group_of(other))
          if (group_of(one) == least .and. group_of(other) == least) cycle
          group_of(one) = least
          group_of(other) = least
          changes = .true.
        end associate
      end do
      if (.not. changes) exit
    end do
    n_groups = 0
    do b = 1, size(group_of)
      if (group_of(b) == b) then
        n_groups = n_groups + 1
        number(b) = n_groups
      end if
      group_of(b) = number(group_of(b))
    end do
  end subroutine find_groups
end module dotyk_scheme_tied_bodies
