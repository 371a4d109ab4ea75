!> Displacements and stresses of load cases that are solved ahead.
module dotyk_control_recovery_ahead
  use dotyk_base_error, only: error_slot_t, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_progress, only: add_progress, expect_progress
  use dotyk_control_body_solution, only: add_modes, forces_on_body, share_solution
  use dotyk_control_case_ahead, only: case_ahead_t
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_control_parallel, only: largest_first, set_blas_threads
  use dotyk_elasticity_load_cases, only: take_case
  use dotyk_elasticity_stress, only: element_stress
  use dotyk_ranks_exchange, only: share_errors
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: move_ahead, recover_ahead

contains

  !> Begin the displacements of a load case whose contact is solved: motions along rigid body modes, and bodies that
  !> touch no other. Its modes may be those of this case alone.
  subroutine move_ahead(problem, ahead)
    !> Bodies and modes; the load case acts on the bodies.
    type(contact_problem_t), intent(in) :: problem
    !> Its contact is solved.
    type(case_ahead_t), intent(inout) :: ahead
    integer :: b, first(size(problem%body) + 1)
    first = first_mode(problem%modes)
    allocate (ahead%body(size(problem%body)))
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b), solution => ahead%body(b))
        if (allocated(ahead%isolated(b)%displacement)) then
          solution%displacement = ahead%isolated(b)%displacement
        else
          allocate (solution%displacement(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
        end if
        call add_modes(problem%modes(b), ahead%state%alpha(first(b):first(b + 1) - 1), solution%displacement)
      end associate
    end do
  end subroutine move_ahead

  !> Displacements and stresses of all bodies in all of the cases: one solve of each body with as many right-hand sides.
  subroutine recover_ahead(problem, qp, compliance, want_stress, cases, error)
    !> Bodies and modes; any of the load cases acts on the bodies on return.
    type(contact_problem_t), intent(inout) :: problem
    !> The quadratic programme of any of the cases.
    type(contact_qp_t), intent(in) :: qp
    !> Its compliance operator.
    type(body_compliance_t), intent(in) :: compliance
    !> Whether stresses are wanted.
    logical, intent(in) :: want_stress
    !> Begun by `move_ahead` (n).
    type(case_ahead_t), intent(inout) :: cases(:)
    !> Allocated where a right-hand side cannot be assembled.
    type(error_t), allocatable, intent(out) :: error
    type(error_slot_t) :: failed(size(problem%body))
    integer :: b, i, order(size(problem%body))
    order = largest_first(real(problem%body%n_unknowns(), dp))
    call set_blas_threads(problem%n_blas)
    call expect_progress(sum(real(problem%body%n_unknowns(), dp)))
    !$omp parallel do default(none) private(b) schedule(dynamic, 1) if (compliance%side_by_side) &
    !$omp& shared(problem, qp, compliance, want_stress, cases, order, failed)
    do i = 1, size(order)
      b = order(i)
      if (.not. problem%ranks%is_own(b)) cycle
      call recover_body(problem, qp, compliance, b, want_stress, cases, failed(b)%error)
      call add_progress(real(problem%body(b)%n_unknowns(), dp))
    end do
    !$omp end parallel do
    call expect_progress(0.0_dp)
    call set_blas_threads(1)
    call share_errors(problem%ranks%owner, failed)
    do b = 1, size(failed)
      if (allocated(failed(b)%error) .and. .not. allocated(error)) call move_alloc(failed(b)%error, error)
    end do
    if (allocated(error)) return
    do i = 1, size(cases)
      call share_solution(problem, cases(i)%body)
    end do
  end subroutine recover_ahead

  !> One body in all of the cases.
  subroutine recover_body(problem, qp, compliance, b, want_stress, cases, error)
    !> Bodies; any of the load cases acts on this one on return.
    type(contact_problem_t), intent(inout) :: problem
    !> As in `recover_ahead`.
    type(contact_qp_t), intent(in) :: qp
    !> Likewise.
    type(body_compliance_t), intent(in) :: compliance
    !> The body.
    integer, intent(in) :: b
    !> Whether stresses are wanted.
    logical, intent(in) :: want_stress
    !> Get displacements and stresses of this body (n).
    type(case_ahead_t), intent(inout) :: cases(:)
    !> Allocated where a right-hand side cannot be assembled.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: x(:, :), u(:, :)
    integer :: j
    associate (body => problem%body(b))
      allocate (x(body%constraint%n_equations, size(cases)), u(body%dimension, body%mesh%n_nodes()))
      if (.not. allocated(cases(1)%isolated(b)%displacement)) then
        do j = 1, size(cases)
          call take_case(body, cases(j)%number)
          call body%assemble_loads(error)
          if (allocated(error)) return
          call forces_on_body(body, qp, b, cases(j)%state%m, x(:, j))
        end do
        call compliance%response(compliance%body(b)%representative)%form%solve_block(x)
      end if
      do j = 1, size(cases)
        call take_case(body, cases(j)%number)
        associate (solution => cases(j)%body(b))
          if (.not. allocated(cases(1)%isolated(b)%displacement)) then
            call body%constraint%expand(x(:, j), u, .true.)
            solution%displacement = solution%displacement + u
          end if
          if (.not. want_stress) cycle
          allocate (solution%stress(6, body%mesh%n_elements()))
          call element_stress(body, solution%displacement, solution%stress, solution%strain_energy)
        end associate
      end do
    end associate
  end subroutine recover_body
end module dotyk_control_recovery_ahead
