!> The check after the solution: whether the deformed bodies penetrate each other, in contact pairs or not.
!>
!> It depends neither on the contact search nor on contact rows: the whole boundary of each part of each body is held
!> against that of all others whose boxes it meets. Contact pairs only explain the penetration that their penalty and
!> their given gaps leave. Self contact of one part is not checked.
module dotyk_control_penetration_check
  use, intrinsic :: iso_fortran_env, only: int8
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_contact_broad_phase, only: overlapping_boxes
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_couple_penetration, only: body_penetration_t, check_bodies, parts_t, split_parts
  use dotyk_control_pairs_of_bodies, only: pairs_of_bodies_t
  use dotyk_control_pressures, only: nodal_field_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_division, only: deal_out, division_t
  use dotyk_ranks_exchange, only: all_ranks, share_flat
  implicit none
  private

  !> Outcome of the check.
  type, public :: penetration_check_t
    !> Whether it was done: it needs displacements.
    logical :: is_done = .false.
    !> Pairs of bodies that penetrate each other, the deepest first.
    type(body_penetration_t), allocatable :: found(:)
    !> Pairs of bodies that touch, and are in no contact pair.
    type(body_penetration_t), allocatable :: touching(:)
    !> Pairs of bodies that are inside each other by a notable part of their displacements, which facets explain, the
    !> deepest first.
    type(body_penetration_t), allocatable :: unresolved(:)
    !> Depth of the nodes that are too deep, or at an edge that is; 0 elsewhere (n_bodies) [length].
    type(nodal_field_t), allocatable :: depth(:)
  contains
    procedure :: deepest => check_deepest
    procedure :: deepest_unresolved => check_deepest_unresolved
  end type penetration_check_t

  public :: body_penetration_t, check_couples, check_penetration

  !> Depths below this fraction of the largest displacement of the two bodies are not told.
  real(dp), parameter :: least_fraction = 1.0e-3_dp
  !> Rounding of coordinates relative to the largest.
  real(dp), parameter :: coordinate_rounding = 1.0e-13_dp
  !> From this number of couples of bodies per thread on, couples are checked in parallel.
  integer, parameter :: many = 4
  !> From this number of boundary nodes of two bodies on, ranks divide their check: below, the exchanges take as long.
  real(dp), parameter :: least_divided = 1000
  !> Error bounds above this leave nothing to check: the slack grows no further.
  real(dp), parameter :: largest_bound = 0.01_dp

contains

  !> The deepest penetration; 0 where there is none, NaN where the check was not done [length].
  pure real(dp) function check_deepest(self) result(depth)
    class(penetration_check_t), intent(in) :: self
    depth = 0
    if (.not. self%is_done) then
      depth = ieee_value(depth, ieee_quiet_nan)
    else if (size(self%found) > 0) then
      depth = self%found(1)%worst%depth
    end if
  end function check_deepest

  !> The deepest point that facets explain, though it is a notable part of the displacements; 0 where there is none, NaN
  !> where the check was not done [length].
  pure real(dp) function check_deepest_unresolved(self) result(depth)
    class(penetration_check_t), intent(in) :: self
    depth = 0
    if (.not. self%is_done) then
      depth = ieee_value(depth, ieee_quiet_nan)
    else if (size(self%unresolved) > 0) then
      depth = self%unresolved(1)%worst%unresolved
    end if
  end function check_deepest_unresolved

  !> Check all bodies.
  subroutine check_penetration(problem, solution, first_row, y, error_bound, check)
    !> Bodies and contact pairs.
    type(contact_problem_t), intent(in) :: problem
    !> Displacements of the bodies (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Relative error of the iteration [].
    real(dp), intent(in) :: error_bound
    !> Outcome.
    type(penetration_check_t), intent(out) :: check
    integer, allocatable :: couple(:, :)
    real(dp) :: box(6, size(problem%body))
    integer :: b, k
    ! Lower corners, with the other sign, and upper corners.
    box = 0
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (x => problem%body(b)%mesh%x, u => solution(b)%displacement)
        box(1:size(x, 1), b) = -min(minval(x, dim=2), minval(x + u, dim=2))
        box(4:3 + size(x, 1), b) = max(maxval(x, dim=2), maxval(x + u, dim=2))
      end associate
    end do
    do k = 1, 6
      call problem%ranks%share_greatest(box(k, :))
    end do
    call overlapping_boxes(-box(:3, :), box(4:, :), couple)
    call check_couples(problem, solution, first_row, y, error_bound, couple, check)
  end subroutine check_penetration

  !> Check some couples of bodies.
  subroutine check_couples(problem, solution, first_row, y, error_bound, couple, check)
    !> Bodies and contact pairs.
    type(contact_problem_t), intent(in) :: problem
    !> Displacements of the bodies (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Relative error of the iteration [].
    real(dp), intent(in) :: error_bound
    !> The couples; a body with itself for its parts (2, n_couples).
    integer, intent(in) :: couple(:, :)
    !> Outcome.
    type(penetration_check_t), intent(out) :: check
    type(parts_t), allocatable :: parts(:)
    type(body_penetration_t), allocatable :: found(:)
    type(pairs_of_bodies_t) :: pairs
    real(dp) :: moved(size(problem%body))
    logical :: needed(size(problem%body))
    real(dp), allocatable :: cost(:)
    integer, allocatable :: owner(:)
    integer :: n_nodes(size(problem%body)), b, k, n
    n = size(problem%body)
    allocate (check%depth(n))
    do b = 1, n
      allocate (check%depth(b)%value(problem%body(b)%mesh%n_nodes()), source=0.0_dp)
    end do
    check%is_done = .true.
    moved = 0
    do b = 1, n
      if (problem%ranks%is_own(b)) moved(b) = maxval(norm2(solution(b)%displacement, dim=1))
    end do
    call problem%ranks%share_greatest(moved)
    needed = .false.
    needed(couple(1, :)) = .true.
    needed(couple(2, :)) = .true.
    allocate (parts(n))
    n_nodes = 0
    !$omp parallel do default(none) shared(problem, solution, needed, parts, n, n_nodes) schedule(dynamic, 1)
    do b = 1, n
      if (.not. needed(b)) cycle
      call split_parts(b, problem%body(b)%mesh, solution(b)%displacement, parts(b))
      n_nodes(b) = sum(parts(b)%part%n_nodes)
    end do
    !$omp end parallel do
    allocate (cost(size(couple, 2)))
    do k = 1, size(cost)
      cost(k) = sum(n_nodes(couple(:, k)))
      ! A body of one part is not checked against itself.
      if (couple(1, k) == couple(2, k) .and. size(parts(couple(1, k))%part) == 1) cost(k) = 0
    end do
    owner = deal_out(cost, least_divided)
    call pairs%init(problem%pair, n)
    ! Few couples: threads share the nodes of each. Many couples: threads share the couples.
    allocate (found(size(couple, 2)))
    !$omp parallel do default(none) schedule(dynamic, 1) if (size(found) >= many*omp_get_max_threads()) shared(owner)
    do k = 1, size(found)
      if (owner(k) == this_rank()) call check_couple(division_t(), k)
    end do
    !$omp end parallel do
    ! Ranks divide the nodes of large bodies.
    do k = 1, size(found)
      if (owner(k) == all_ranks) call check_couple(division_t(.true.), k)
    end do
    if (n_ranks() > 1) call share_findings(owner, parts, found, check%depth)
    check%found = pack(found, found%worst%depth > 0)
    check%touching = pack(found, found%touch%n_facets > 0 .and. .not. found%worst%depth > 0)
    check%unresolved = pack(found, found%worst%unresolved > 0 .and. .not. found%worst%depth > 0)
    call sort_found(-check%found%worst%depth, check%found)
    call sort_found(-check%unresolved%worst%unresolved, check%unresolved)

  contains

    !> Check one couple.
    subroutine check_couple(division, k)
      !> How ranks divide the nodes.
      type(division_t), intent(in) :: division
      !> The couple.
      integer, intent(in) :: k
      associate (a => couple(1, k), c => couple(2, k))
        call check_bodies(division, problem, pairs, first_row, y, parts(a), parts(c), a, c, solution(a)%displacement, &
                          slack_of(problem%body(a)%mesh, problem%body(c)%mesh, max(moved(a), moved(c)), error_bound), &
                          max(moved(a), moved(c)), &
                          check%depth(a)%value, check%depth(c)%value, found(k))
      end associate
    end subroutine check_couple
  end subroutine check_couples

  !> Make what the ranks have found in couples of their own known to all.
  subroutine share_findings(owner, parts, found, depth)
    !> Rank of each couple, or `all_ranks` (n_couples).
    integer, intent(in) :: owner(:)
    !> Parts of the bodies, whose nodes are numbered alike on all ranks (n_bodies).
    type(parts_t), intent(in) :: parts(:)
    !> Penetration of each couple; of this rank in, of all out (n_couples).
    type(body_penetration_t), intent(inout) :: found(:)
    !> Depth at the nodes, likewise (n_bodies) [length].
    type(nodal_field_t), intent(inout) :: depth(:)
    type(division_t) :: division
    integer(int8), allocatable :: bytes(:, :)
    real(dp), allocatable :: list(:, :)
    integer, allocatable :: dealt(:)
    integer :: b, i, k, n
    dealt = pack([(k, k=1, size(owner))], owner /= all_ranks)
    if (size(dealt) == 0) return
    allocate (bytes(storage_size(found)/8, size(dealt)))
    do k = 1, size(dealt)
      bytes(:, k) = transfer(found(dealt(k)), bytes(:, k))
    end do
    call share_flat(owner(dealt), bytes)
    do k = 1, size(dealt)
      found(dealt(k)) = transfer(bytes(:, k), found(dealt(k)))
    end do
    if (.not. any(found(dealt)%worst%depth > 0)) return
    ! Body, part, node and depth where there is one.
    n = sum([(count(depth(b)%value > 0), b=1, size(depth))])
    allocate (list(4, n))
    n = 0
    do b = 1, size(depth)
      if (.not. any(depth(b)%value > 0)) cycle
      do k = 1, size(parts(b)%part)
        do i = 1, parts(b)%part(k)%n_nodes
          associate (here => depth(b)%value(parts(b)%part(k)%node(i)))
            if (.not. here > 0) cycle
            n = n + 1
            list(:, n) = [real([b, k, i], dp), here]
          end associate
        end do
      end do
    end do
    division%is_divided = .true.
    call division%append(list)
    do n = 1, size(list, 2)
      b = nint(list(1, n))
      associate (here => depth(b)%value(parts(b)%part(nint(list(2, n)))%node(nint(list(3, n)))))
        here = max(here, list(4, n))
      end associate
    end do
  end subroutine share_findings

  !> Error of displacements and of rounding [length].
  pure real(dp) function slack_of(mesh_a, mesh_b, moved, error_bound) result(slack)
    !> Mesh of one body.
    type(body_mesh_t), intent(in) :: mesh_a
    !> Mesh of the other body.
    type(body_mesh_t), intent(in) :: mesh_b
    !> Largest displacement of the two [length].
    real(dp), intent(in) :: moved
    !> Relative error of the iteration [].
    real(dp), intent(in) :: error_bound
    slack = (least_fraction + min(largest_bound, max(0.0_dp, error_bound)))*moved + &
            coordinate_rounding*max(maxval(abs(mesh_a%x)), maxval(abs(mesh_b%x)))
  end function slack_of

  !> Sort penetrations.
  pure subroutine sort_found(key, found)
    !> Key, in ascending order afterwards (n) [length].
    real(dp), intent(in) :: key(:)
    !> Penetrations (n).
    type(body_penetration_t), intent(inout) :: found(:)
    integer :: order(size(found))
    call sort_order(key, order)
    found = found(order)
  end subroutine sort_found
end module dotyk_control_penetration_check
