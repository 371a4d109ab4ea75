!> Where the active sets begin: the same contact problem on groups of points.
!>
!> Neighbouring contact points are joined to groups of a few. A group is one row: mean gap and mean displacement of its points, one
!> force shared among them. Their active set is found first (on groups of groups, if they are many, and so on), it costs next to
!> nothing, and the forces of the groups, spread over their points, tell which points to take for closed. Without it, active sets
!> would shrink ring by ring from far too large ones, and columns be formed for points that never touch.
module dotyk_scheme_nested
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: linear_solver_auto
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_scheme_active_set, only: iterate_t, find_active_set, rest_on_winkler_foundation
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_choice, only: choose_solver
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t
  use dotyk_scheme_part, only: give_back, join_rows
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_winkler_start, only: find_unbounded_direction
  implicit none
  private
  public :: find_start, join_points

  !> Fewer points than this need no better start than that of rigid bodies.
  integer, parameter, public :: few_points = 60
  !> Points of a group at most.
  integer, parameter :: most_joined = 6
  !> Active sets of the groups at most: a start need not be exact.
  integer, parameter :: most_steps = 12
  !> Points of a closed group are closed unless they are open by more than this part of how deep the group's own force presses it.
  real(dp), parameter :: part_of_dent = 0.5_dp

contains

  !> A first iterate and its active set.
  recursive subroutine find_start(problem, compliance, now, active, error)
    !> The same on return, but for the count of solves.
    type(contact_problem_t), intent(inout) :: problem
    !> Of all rows, or by sweeps.
    type(explicit_compliance_t), intent(in) :: compliance
    type(iterate_t), intent(out) :: now
    !> (n_rows).
    logical, intent(out) :: active(:)
    type(error_t), allocatable, intent(out) :: error
    type(contact_problem_t) :: joined
    type(explicit_compliance_t) :: joined_compliance
    class(active_system_t), allocatable :: system
    type(iterate_t) :: start
    type(scheme_result_t) :: result
    type(log_t) :: silent
    integer, allocatable :: group(:)
    real(dp), allocatable :: dent(:), share(:), motion(:)
    logical, allocatable :: closed(:)
    logical :: found
    integer :: n_groups, i

    call rest_on_winkler_foundation(problem, now, active)
    if (problem%operator%n_rows < few_points) return
    allocate (group(problem%operator%n_rows))
    call join_points(problem, group, n_groups)
    if (2*n_groups > problem%operator%n_rows) return
    call join_rows(problem, group, n_groups, joined, share)
    if (.not. compliance%by_sweeps) call compliance%join(problem, group, share, joined, joined_compliance)
    ! Means of normals may not carry what the points carry.
    if (problem%coarse%n > 0) then
      allocate (motion(problem%coarse%n))
      call find_unbounded_direction(joined%operator, joined%coarse, motion, found)
      if (found) call give_back(joined, problem)
      if (found) return
    end if
    allocate (closed(n_groups))
    call silent%init(.true.)
    call rest_on_winkler_foundation(joined, start, closed)
    call choose_solver(joined, linear_solver_auto, closed, joined_compliance, system)
    call joined_compliance%form(joined)
    call find_start(joined, joined_compliance, start, closed, error)
    if (.not. allocated(error)) &
      call find_active_set(joined, most_steps, 0.0_dp, silent, joined_compliance, system, start, closed, result, error)
    call system%destroy()
    dent = [(max(0.0_dp, start%lambda(i))*joined_compliance%diagonal(joined, i), i=1, n_groups)]
    call give_back(joined, problem)
    if (allocated(error)) return
    call spread_forces(problem, compliance, group, start, dent, now, active)
  end subroutine find_start

  !> Forces of the groups on their points, and the points that are closed then.
  subroutine spread_forces(problem, compliance, group, start, dent, now, active)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> Group of each point (n_rows).
    integer, intent(in) :: group(:)
    !> Iterate of the groups.
    type(iterate_t), intent(in) :: start
    !> How deep each group's own force presses it (size of start%lambda) [length].
    real(dp), intent(in) :: dent(:)
    type(iterate_t), intent(inout) :: now
    logical, intent(out) :: active(:)
    real(dp), allocatable :: total(:), z(:), motion(:)
    integer :: i
    allocate (total(size(start%lambda)), z(size(group)), motion(size(group)))
    associate (weight => problem%operator%weight)
      total = 0
      do i = 1, size(group)
        total(group(i)) = total(group(i)) + weight(i)
      end do
      now%lambda = max(0.0_dp, start%lambda(group))*weight/total(group)
      now%alpha = start%alpha
      call compliance%multiply(problem, now%lambda, z)
      call problem%coarse%displacement(problem%operator, now%alpha, motion)
      now%y = problem%y_free - z + motion
      active = now%y > -part_of_dent*dent(group)
    end associate
  end subroutine spread_forces

  !> Join each point that is still alone with its neighbours that are: points of a pair whose rows touch the same node. Points that
  !> are left over join a neighbouring group.
  subroutine join_points(problem, group, n_groups)
    type(contact_problem_t), intent(in) :: problem
    !> (n_rows).
    integer, intent(out) :: group(:)
    integer, intent(out) :: n_groups
    integer, allocatable :: start(:), row_of(:), neighbour(:)
    integer :: k, i, j, n, b
    group = 0
    n_groups = 0
    associate (first => problem%operator%pair_first_row)
      do k = 1, size(first) - 1
        if (first(k + 1) == first(k)) cycle
        b = problem%coarse%body(1, first(k))
        associate (block => problem%operator%block(b))
          call rows_of_nodes(block, problem%operator%dimension, start, row_of)
          do i = first(k), first(k + 1) - 1
            if (group(i) > 0) cycle
            call neighbours(block, problem%operator%dimension, problem%coarse%place(1, i), start, row_of, neighbour)
            neighbour = pack(neighbour, neighbour >= first(k) .and. neighbour < first(k + 1))
            n = count(group(neighbour) == 0)
            if (3*n >= size(neighbour)) then
              n_groups = n_groups + 1
              group(i) = n_groups
              n = 1
              do j = 1, size(neighbour)
                if (n == most_joined) exit
                if (group(neighbour(j)) > 0) cycle
                group(neighbour(j)) = n_groups
                n = n + 1
              end do
            else
              group(i) = maxval(group(neighbour))
            end if
          end do
        end associate
      end do
    end associate
  end subroutine join_points

  !> Rows that touch each node of a block.
  subroutine rows_of_nodes(block, dimension, start, row)
    type(contact_block_t), intent(in) :: block
    integer, intent(in) :: dimension
    !> Rows of node i: row(start(i):start(i+1)-1), as numbers in the operator, ascending; a row stands once per entry.
    integer, allocatable, intent(out) :: start(:), row(:)
    integer, allocatable :: next(:)
    integer :: i, k, node
    allocate (start(block%n_nodes + 1), row(size(block%matrix%column)))
    start = 0
    do k = 1, size(block%matrix%column)
      node = (block%matrix%column(k) - 1)/dimension + 1
      start(node + 1) = start(node + 1) + 1
    end do
    start(1) = 1
    do i = 1, block%n_nodes
      start(i + 1) = start(i) + start(i + 1)
    end do
    next = start(:block%n_nodes)
    do i = 1, block%matrix%n_rows
      do k = block%matrix%row_start(i), block%matrix%row_start(i + 1) - 1
        node = (block%matrix%column(k) - 1)/dimension + 1
        row(next(node)) = block%row(i)
        next(node) = next(node) + 1
      end do
    end do
  end subroutine rows_of_nodes

  !> Rows that share the nodes of the largest entries of one row, itself among them.
  subroutine neighbours(block, dimension, i, start, row, list)
    type(contact_block_t), intent(in) :: block
    integer, intent(in) :: dimension
    !> Place of the row in the block.
    integer, intent(in) :: i
    !> Of `rows_of_nodes`.
    integer, intent(in) :: start(:), row(:)
    integer, allocatable, intent(out) :: list(:)
    integer, allocatable :: found(:)
    integer :: k, j, node, n
    real(dp) :: largest
    associate (matrix => block%matrix)
      largest = maxval(abs(matrix%value(matrix%row_start(i):matrix%row_start(i + 1) - 1)))
      allocate (found(0))
      do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
        if (abs(matrix%value(k)) < 0.5_dp*largest) cycle
        node = (matrix%column(k) - 1)/dimension + 1
        found = [found, row(start(node):start(node + 1) - 1)]
      end do
    end associate
    ! Each once.
    n = 0
    do j = 1, size(found)
      if (any(found(:n) == found(j))) cycle
      n = n + 1
      found(n) = found(j)
    end do
    list = found(:n)
  end subroutine neighbours

end module dotyk_scheme_nested
