!> A contact problem on fewer rows: some joined to groups, some left out.
!>
!> A group is one row: mean gap and mean displacement of its points, one force shared among them.
module dotyk_scheme_part
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: join_rows, keep_rows, give_back

contains

  !> The problem on some rows alone: it takes the responses over.
  subroutine keep_rows(problem, keep, part)
    type(contact_problem_t), intent(inout) :: problem
    !> (n_rows).
    logical, intent(in) :: keep(:)
    type(contact_problem_t), intent(out) :: part
    real(dp), allocatable :: share(:)
    integer, allocatable :: group(:)
    integer :: i, n
    allocate (group(size(keep)), source=0)
    n = count(keep)
    group(pack([(i, i=1, size(keep))], keep)) = [(i, i=1, n)]
    call join_rows(problem, group, n, part, share)
    part%operator%origin = pack(problem%operator%origin, keep)
  end subroutine keep_rows

  !> Give the responses back.
  subroutine give_back(part, problem)
    type(contact_problem_t), intent(inout) :: part, problem
    problem%body_solves = part%body_solves
    call move_alloc(part%response, problem%response)
    call part%destroy()
  end subroutine give_back

  !> The problem on groups: it takes the responses over.
  subroutine join_rows(problem, group, n_groups, joined, share)
    type(contact_problem_t), intent(inout) :: problem
    !> Group of each row, 0 where it is left out (n_rows), and their number.
    integer, intent(in) :: group(:), n_groups
    type(contact_problem_t), intent(out) :: joined
    !> Share of each row in its group, by weight (n_rows).
    real(dp), allocatable, intent(out) :: share(:)
    integer :: i, k, b
    associate (fine => problem%operator, rough => joined%operator)
      rough%n_rows = n_groups
      rough%dimension = fine%dimension
      allocate (rough%weight(n_groups), source=0.0_dp)
      do i = 1, size(group)
        if (group(i) > 0) rough%weight(group(i)) = rough%weight(group(i)) + fine%weight(i)
      end do
      allocate (share(size(group)), source=0.0_dp)
      do i = 1, size(group)
        if (group(i) > 0) share(i) = fine%weight(i)/rough%weight(group(i))
      end do
      rough%origin = [(i, i=1, n_groups)]
      rough%gap = means(fine%gap)
      rough%theta = means(fine%theta)
      joined%y_free = means(problem%y_free)
      joined%y_load = means(problem%y_load)
      joined%foundation = means(problem%foundation)
      rough%pair_first_row = fine%pair_first_row
      do k = 1, size(fine%pair_first_row) - 1
        associate (first => fine%pair_first_row(k), last => fine%pair_first_row(k + 1) - 1)
          ! A group has points of one pair, and groups are numbered pair by pair.
          rough%pair_first_row(k + 1) = max(rough%pair_first_row(k), maxval([0, group(first:last)]) + 1)
        end associate
      end do
      allocate (rough%block(size(fine%block)))
      do b = 1, size(fine%block)
        call join_block(fine%block(b), group, n_groups, share, rough%block(b))
      end do
    end associate
    joined%energy_free = problem%energy_free
    joined%norm_free = problem%norm_free
    joined%side_by_side = problem%side_by_side
    joined%body_solves = problem%body_solves
    if (allocated(problem%kind)) then
      joined%kind = problem%kind
      joined%axes = problem%axes
    end if
    call move_alloc(problem%response, joined%response)
    call joined%prepare(problem%cost)
    call joined%coarse%init(joined%operator, joined%response, problem%coarse%resultant/problem%coarse%scale)
    if (allocated(problem%coarse%lift)) then
      joined%coarse%lift = joined%coarse%scale*problem%coarse%lift/problem%coarse%scale
      joined%coarse%resultant_size = joined%coarse%scale*problem%coarse%resultant_size/problem%coarse%scale
    end if
  contains
    !> Weighted means over the groups.
    function means(value) result(mean)
      real(dp), intent(in) :: value(:)
      real(dp), allocatable :: mean(:)
      integer :: j
      allocate (mean(n_groups), source=0.0_dp)
      do j = 1, size(value)
        if (group(j) > 0) mean(group(j)) = mean(group(j)) + share(j)*value(j)
      end do
    end function means
  end subroutine join_rows

  !> One body's columns of B with rows joined.
  subroutine join_block(fine, group, n_groups, share, rough)
    type(contact_block_t), intent(in) :: fine
    !> As in `join_rows`.
    integer, intent(in) :: group(:), n_groups
    !> Share of each point in its group (n_rows).
    real(dp), intent(in) :: share(:)
    type(contact_block_t), intent(inout) :: rough
    integer, allocatable :: row(:), column(:), number(:)
    real(dp), allocatable :: value(:)
    integer :: i, k, n
    rough%n_nodes = fine%n_nodes
    rough%contact_node = fine%contact_node
    allocate (number(0:n_groups), source=0)
    do i = 1, size(fine%row)
      number(group(fine%row(i))) = 1
    end do
    rough%row = pack([(i, i=1, n_groups)], number(1:) > 0)
    number(0) = 0
    number(rough%row) = [(i, i=1, size(rough%row))]
    allocate (row(size(fine%matrix%column)), column(size(fine%matrix%column)), value(size(fine%matrix%column)))
    n = 0
    do i = 1, fine%matrix%n_rows
      if (group(fine%row(i)) == 0) cycle
      do k = fine%matrix%row_start(i), fine%matrix%row_start(i + 1) - 1
        n = n + 1
        row(n) = number(group(fine%row(i)))
        column(n) = fine%matrix%column(k)
        value(n) = share(fine%row(i))*fine%matrix%value(k)
      end do
    end do
    call rough%matrix%init_from_triplets(size(rough%row), fine%matrix%n_columns, row(:n), column(:n), value(:n))
  end subroutine join_block
end module dotyk_scheme_part
