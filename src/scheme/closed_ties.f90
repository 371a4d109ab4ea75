!> Whether ties are closed, and which contact rows they hold by themselves, without loads and contact.
module dotyk_scheme_closed_ties
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: half_digits, rounding
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t, drop_rigid_constraints
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_open_tie, ended_rigid_constraint
  implicit none
  private
  public :: check_ties, find_held_rows

  !> Ties that stay open by more than this fraction of what they or their forces would open contradict each other or
  !> supports [].
  real(dp), parameter :: most_open = 1.0e-6_dp

contains

  !> Whether ties stay open: the state ends there.
  subroutine check_ties(qp, compliance, lambda, alpha, penetration, state)
    type(contact_qp_t), intent(in) :: qp  !! Rows of contact and ties.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    real(dp), intent(in) :: lambda(:)  !! Forces of a solution (n_rows) [force].
    real(dp), intent(in) :: alpha(:)  !! Its amplitudes (coarse%n) [length].
    real(dp), intent(in) :: penetration(:)  !! Its penetrations (n_rows) [length].
    type(solver_state_t), intent(inout) :: state  !! Ended by a tie, or as it was.
    real(dp) :: yielded(qp%n_rows), moved(qp%n_rows), most
    integer :: b, i
    if (.not. any(qp%is_tied)) return
    call compliance%multiply(qp, merge(lambda, 0.0_dp, qp%is_tied), yielded)
    moved = 0
    do b = 1, size(qp%block)
      associate (row => qp%block(b)%row, own => qp%coarse%block(b)%value)
        moved(row) = moved(row) + matmul(abs(own), abs(alpha(qp%coarse%first(b):qp%coarse%first(b + 1) - 1)))
      end associate
    end do
    i = maxloc(abs(penetration), 1, qp%is_tied)
    most = maxval(abs(qp%initial_penetration) + abs(yielded), mask=qp%is_tied)
    ! Large motions, on soft springs, leave their rounding.
    if (.not. abs(penetration(i)) > max(most_open*most, rounding*maxval(moved, mask=qp%is_tied))) return
    state%ended = ended_open_tie
    state%overlap_of = most
    state%rigid_row = qp%parent_row(i)
    state%overlap = abs(penetration(i))
  end subroutine check_ties

  !> Find contact rows that ties hold. The state ends where surfaces overlap there.
  subroutine find_held_rows(qp, with_springs, compliance, system, state, is_held, error)
    type(contact_qp_t), intent(in) :: qp  !! Rows of contact and ties.
    type(contact_qp_t), intent(in) :: with_springs  !! The same with springs on the modes.
    !> Compliance of the bodies at these rows; formed unless the linear system needs no entries.
    class(compliance_t), intent(inout) :: compliance
    type(active_system_t), intent(inout) :: system  !! Work space: that of the ties on return, where rows may be held.
    type(solver_state_t), intent(inout) :: state  !! Ended by an overlap, or as it was.
    logical, allocatable, intent(out) :: is_held(:)  !! Contact rows without penalty that ties hold (n_rows).
    type(error_t), allocatable, intent(out) :: error  !! The linear system cannot be prepared.
    logical :: active(qp%n_rows), is_rigid(qp%n_rows)
    real(dp), allocatable :: yields(:)
    real(dp) :: y(qp%n_rows), terms(qp%n_rows), z(qp%n_rows), unit(qp%n_rows), none(qp%coarse%n), resultant(qp%coarse%n)
    integer, allocatable :: candidate(:)
    integer :: i, k
    allocate (is_held(qp%n_rows), source=.false.)
    if (.not. any(qp%is_tied)) return
    call find_candidates(qp, compliance, candidate)
    if (size(candidate) == 0) return
    active = qp%is_tied
    is_rigid = .false.
    call drop_rigid_constraints(qp, compliance, yields, active, is_rigid)
    call system%init(with_springs, compliance, active, error)
    if (allocated(error)) return
    do k = 1, size(candidate)
      i = candidate(k)
      unit = 0
      unit(i) = 1
      call compliance%multiply(qp, unit, z)
      call qp%mode_resultant(unit, resultant)
      call find_gaps(-z, -resultant, y, terms)
      ! Beside the tie of a cantilever 700 times as long as thick a row yields by 4e-10 of what it yields without it.
      is_held(i) = abs(y(i)) <= rounding*terms(i)
    end do
    if (.not. any(is_held)) return
    none = 0
    call find_gaps(qp%initial_penetration, none, y, terms)
    ! Rounding is no overlap: slender bodies move far by the forces of ties, and back by those of others.
    if (.not. any(is_held .and. y > max(rounding*terms, half_digits*maxval(abs(qp%initial_penetration))))) return
    i = maxloc(y, 1, is_held)
    state%ended = ended_rigid_constraint
    state%rigid_row = qp%parent_row(i)
    state%overlap = y(i)

  contains

    !> What closed ties leave of penetrations.
    subroutine find_gaps(penetration, force, left, size_of)
      real(dp), intent(in) :: penetration(:)  !! Without forces of ties (n_rows) [length].
      real(dp), intent(in) :: force(:)  !! On the modes (coarse%n) [force].
      real(dp), intent(out) :: left(:)  !! (n_rows) [length].
      real(dp), intent(out) :: size_of(:)  !! Sum of the absolute values of its terms (n_rows) [length].
      real(dp) :: lambda(qp%n_rows), moved(qp%n_rows), yielded(qp%n_rows), alpha(qp%coarse%n)
      real(dp), allocatable :: forces(:)
      allocate (forces(size(system%row)), source=0.0_dp)
      call system%solve(with_springs, compliance, penetration(system%row), force, forces, alpha)
      lambda = 0
      lambda(system%row) = forces
      call compliance%multiply(qp, lambda, yielded)
      call qp%mode_displacement(alpha, moved)
      left = penetration - yielded + moved
      size_of = abs(penetration) + abs(yielded) + abs(moved)
    end subroutine find_gaps
  end subroutine find_held_rows

  !> Contact rows without penalty whose nodes ties or supports have, all of them: others yield.
  subroutine find_candidates(qp, compliance, candidate)
    type(contact_qp_t), intent(in) :: qp  !! Rows of contact and ties.
    class(compliance_t), intent(in) :: compliance  !! Compliance of the bodies at these rows.
    integer, allocatable, intent(out) :: candidate(:)  !! The rows.
    real(dp), allocatable :: entry(:, :)
    logical, allocatable :: has_tie(:)
    logical :: may(qp%n_rows), on_tie(qp%n_rows)
    integer :: b, i, k
    may = .not. (qp%is_tied .or. qp%theta > 0)
    on_tie = .false.
    do b = 1, size(qp%block)
      associate (row => qp%block(b)%row, matrix => qp%block(b)%matrix)
        if (all(qp%is_tied(row)) .or. .not. any(may(row))) cycle
        allocate (has_tie(matrix%n_columns), source=.false.)
        do k = 1, 2
          do i = 1, size(row)
            associate (column => matrix%column(matrix%row_start(i):matrix%row_start(i + 1) - 1), &
                       value => abs(matrix%value(matrix%row_start(i):matrix%row_start(i + 1) - 1)))
              if (k == 1 .and. qp%is_tied(row(i))) has_tie(column) = .true.
              if (k == 1 .or. .not. may(row(i))) cycle
              if (all(has_tie(column) .or. value < half_digits*maxval(value))) then
                on_tie(row(i)) = .true.
              else
                may(row(i)) = compliance%is_formed(qp)
                if (.not. may(row(i))) cycle
                call compliance%get_entries(qp, b, [row(i)], entry)
                may(row(i)) = .not. entry(1, 1) > 0
              end if
            end associate
          end do
        end do
        deallocate (has_tie)
      end associate
    end do
    candidate = pack([(i, i=1, qp%n_rows)], may .and. on_tie)
  end subroutine find_candidates
end module dotyk_scheme_closed_ties
