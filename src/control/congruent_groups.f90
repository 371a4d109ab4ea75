!> Groups of congruent bodies that are computed in one pass over their mesh.
module dotyk_control_congruent_groups
  use dotyk_control_contact_problem, only: contact_problem_t
  implicit none
  private

  type, public :: congruent_group_t  !! One group.
    integer :: representative = 0  !! The representative of the class.
    !> Bodies of the class (n). Those of other ranks keep their places, so that the digits of the others do not depend
    !> on them.
    integer, allocatable :: body(:)
  end type congruent_group_t

  !> Congruent bodies in one pass at most: the work that depends on the mesh alone is small beside that for so many, and
  !> the memory is small beside a factor.
  integer, parameter, public :: most_bodies = 16

  public :: congruent_groups

contains

  !> The groups with bodies of this rank, class after class.
  subroutine congruent_groups(problem, group)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and ranks.
    type(congruent_group_t), allocatable, intent(out) :: group(:)  !! (n_groups)
    type(congruent_group_t) :: found(size(problem%body))
    integer, allocatable :: alike(:)
    integer :: b, c, n
    n = 0
    do b = 1, size(problem%body)
      if (.not. problem%classes%is_representative(b)) cycle
      alike = pack([(c, c=1, size(problem%body))], problem%classes%first == b)
      do c = 1, size(alike), most_bodies
        associate (some => alike(c:min(c + most_bodies - 1, size(alike))))
          if (.not. any(problem%ranks%is_own(some))) cycle
          n = n + 1
          found(n)%representative = b
          found(n)%body = some
        end associate
      end do
    end do
    allocate (group, source=found(:n))
  end subroutine congruent_groups
end module dotyk_control_congruent_groups
