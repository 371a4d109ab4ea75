!> Where the active-set iteration begins: the solution of the same contact problem on groups of rows, level by level.
!>
!> Neighbouring contact rows are aggregated to groups of a few (weighted mean gap and displacement, one force
!> distributed over the rows). Their active set is found first, on groups of groups if they are many, and so on; it
!> costs next to nothing, and the forces of the groups tell which rows start active. Without it, active sets would
!> shrink ring by ring from far too large ones, and entries of the compliance be formed for rows that are never active.
module dotyk_scheme_multilevel_start
  use dotyk_base_error, only: error_t, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: linear_solver_auto
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_scheme_active_set, only: iterate_t, find_active_set, rest_on_winkler_foundation, update_penetrations
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_linear_solver_choice, only: choose_coupling
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_restriction, only: form_aggregate, transformed_qp_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_winkler_start, only: find_unbounded_direction
  implicit none
  private
  public :: find_start, group_rows

  !> Fewer contact rows than this need no better start than that of rigid bodies.
  integer, parameter, public :: few_rows = 60
  integer, parameter :: most_rows = 6  !! Rows of a group at most.
  integer, parameter :: most_steps = 12  !! Active sets of the groups at most: a start need not be exact.
  !> A row of an active group starts active unless its gap exceeds this fraction of the group's self-indentation, the
  !> displacement by the group's own force.
  real(dp), parameter :: gap_over_indentation = 0.5_dp

  !> Groups of fewer rows than this in the mean are not worth a solution: rows without common nodes.
  integer, parameter :: least_mean = 2
  !> A row makes a group where at least one in so many of its neighbours is single; otherwise it joins another one, so
  !> that no group is tiny.
  integer, parameter :: neighbours_per_single = 3
  !> Rows share a node where both have entries there of at least this fraction of the largest: those of a mortar row far
  !> from its node are small.
  real(dp), parameter :: large_entry = 0.5_dp

contains

  !> A first iterate and its active set.
  recursive subroutine find_start(qp, compliance, now, active, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Formed at all rows, or matrix-free.
    type(iterate_t), intent(out) :: now  !! The iterate.
    logical, intent(out) :: active(:)  !! Active set (n_rows).
    type(error_t), allocatable, intent(out) :: error  !! As in `find_active_set`, for the groups.
    type(transformed_qp_t) :: coarse
    type(dense_compliance_t) :: of_groups
    type(iterate_t) :: start
    type(active_system_t) :: system
    integer, allocatable :: group(:)
    real(dp), allocatable :: motion(:), indentation(:)
    logical, allocatable :: all_rows(:)
    logical :: found
    integer :: n_groups

    call rest_on_winkler_foundation(qp, now, active)
    if (count(.not. qp%is_tied) < few_rows) return
    allocate (group(qp%n_rows))
    call group_rows(qp, group, n_groups)
    if (least_mean*n_groups > qp%n_rows) return
    call coarse%aggregate(qp, group, n_groups)
    ! Mean normals may not carry what the rows carry.
    if (qp%coarse%n > 0) then
      allocate (motion(qp%coarse%n))
      call find_unbounded_direction(coarse%qp, motion, found)
      if (found) return
    end if
    allocate (all_rows(n_groups), source=.true.)
    if (compliance%is_formed(qp)) then
      call coarse%compliance_of_groups(qp, compliance, of_groups)
      call choose_coupling(coarse%qp, of_groups, linear_solver_auto, all_rows, system)
      call solve_groups(coarse%qp, of_groups, system, start, indentation, error)
    else
      call choose_coupling(coarse%qp, compliance, linear_solver_auto, all_rows, system)
      if (system%needs_entries()) then
        call form_aggregate(coarse%qp, compliance, of_groups)
        call solve_groups(coarse%qp, of_groups, system, start, indentation, error)
      else
        call solve_groups(coarse%qp, compliance, system, start, indentation, error)
      end if
    end if
    call system%destroy()
    if (allocated(error)) then
      ! Mean rows of a tie may not hold what its rows hold: the bodies stay on the foundation.
      if (any(qp%is_tied) .and. error%code == exit_not_solvable) deallocate (error)
      return
    end if
    ! Distribute the forces of the groups.
    now%lambda = qp%weight*coarse%pressures(start%lambda/coarse%qp%weight)
    now%lambda = merge(now%lambda, max(0.0_dp, now%lambda), qp%is_tied)
    now%alpha = start%alpha
    call update_penetrations(qp, compliance, now)
    active = now%penetration > -gap_over_indentation*indentation(group) .or. qp%is_tied
  end subroutine find_start

  !> The contact problem of the groups.
  recursive subroutine solve_groups(qp, compliance, system, now, indentation, error)
    type(contact_qp_t), intent(in) :: qp  !! QP of the groups.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(active_system_t), intent(inout) :: system  !! Linear system of an active set: work space.
    type(iterate_t), intent(out) :: now  !! The last iterate.
    !> Displacement of each group by its own force (n_groups) [length].
    real(dp), allocatable, intent(out) :: indentation(:)
    type(error_t), allocatable, intent(out) :: error  !! As in `find_start`.
    type(monitor_t) :: silent
    type(solver_state_t) :: state
    logical :: active(qp%n_rows)
    integer :: i
    call find_start(qp, compliance, now, active, error)
    if (.not. allocated(error)) &
      call find_active_set(qp, qp, compliance, most_steps, silent, system, now, active, state, error)
    if (allocated(error)) return
    allocate (indentation(qp%n_rows))
    if (compliance%is_formed(qp)) then
      call compliance%get_diagonal(qp, [(i, i=1, qp%n_rows)], indentation)
    else
      call compliance%nodal_diagonal(qp, indentation)
    end if
    indentation = max(0.0_dp, now%lambda)*indentation
  end subroutine solve_groups

  !> Group each row that is still single with its single neighbours: rows of a pair that share a node. Rows that are
  !> left over join a neighbouring group.
  subroutine group_rows(qp, group, n_groups)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    integer, intent(out) :: group(:)  !! Group of each row; groups are numbered pair by pair (n_rows).
    integer, intent(out) :: n_groups  !! Number of groups.
    integer, allocatable :: start(:), row_of(:), neighbour(:)
    integer :: k, i, j, n, b
    group = 0
    n_groups = 0
    associate (first => qp%pair_first_row)
      do k = 1, size(first) - 1
        if (first(k + 1) == first(k)) cycle
        b = qp%coarse%body(1, first(k))
        associate (block => qp%block(b))
          call rows_of_nodes(block, qp%dimension, start, row_of)
          do i = first(k), first(k + 1) - 1
            if (group(i) > 0) cycle
            call neighbours(block, qp%dimension, qp%coarse%place(1, i), start, row_of, neighbour)
            neighbour = pack(neighbour, neighbour >= first(k) .and. neighbour < first(k + 1))
            n = count(group(neighbour) == 0)
            if (neighbours_per_single*n >= size(neighbour)) then
              n_groups = n_groups + 1
              group(i) = n_groups
              n = 1
              do j = 1, size(neighbour)
                if (n == most_rows) exit
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
  end subroutine group_rows

  !> Rows that touch each node of a block.
  subroutine rows_of_nodes(block, dimension, start, row)
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: dimension  !! Dimension of the scene, 2 or 3.
    integer, allocatable, intent(out) :: start(:)  !! Rows of node i: row(start(i):start(i+1)-1) (n_nodes + 1).
    !> Rows of the nodes, as numbers in the operator, ascending; a row stands once per entry (number of entries).
    integer, allocatable, intent(out) :: row(:)
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
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: dimension  !! Dimension of the scene, 2 or 3.
    integer, intent(in) :: i  !! Place of the row in the block.
    integer, intent(in) :: start(:)  !! As from `rows_of_nodes` (n_nodes + 1).
    integer, intent(in) :: row(:)  !! As from `rows_of_nodes` (number of entries).
    !> Neighbouring rows, as numbers in the operator, each once (number of neighbours).
    integer, allocatable, intent(out) :: list(:)
    integer, allocatable :: found(:)
    integer :: k, j, node, n
    real(dp) :: largest
    associate (matrix => block%matrix)
      largest = maxval(abs(matrix%value(matrix%row_start(i):matrix%row_start(i + 1) - 1)))
      allocate (found(0))
      do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
        if (abs(matrix%value(k)) < large_entry*largest) cycle
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

end module dotyk_scheme_multilevel_start
