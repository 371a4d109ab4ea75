!> Displacements and stresses of all bodies, once the contact pressures are known.
module dotyk_control_body_solution
  use dotyk_base_kinds, only: dp
  use dotyk_base_progress, only: add_progress, expect_progress
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_ranks_exchange, only: item_t, share
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_control_parallel, only: largest_first, set_blas_threads
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_stress, only: element_stress
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  !> One body under its loads and contact pressures.
  type, public :: body_solution_t
    !> Displacements of the nodes (dimension, n_nodes) [length]; not allocated where nobody needs them. Of bodies that
    !> other ranks compute those of the shared nodes are known (`body_t%shared_node`), others are 0.
    real(dp), allocatable :: displacement(:, :)
    !> Mean stress of the elements, xx yy zz xy yz xz (6, n_elements) [pressure]; not allocated where nobody asked, and
    !> on ranks that do not compute the body.
    real(dp), allocatable :: stress(:, :)
    !> Strain energy of the own elements, where the stress is allocated [energy].
    real(dp) :: strain_energy = 0
  end type body_solution_t

  public :: add_modes, forces_on_body, recover_bodies, share_solution

contains

  !> Recover all bodies, side by side.
  subroutine recover_bodies(problem, qp, compliance, m, alpha, want_stress, solution)
    !> Bodies, modes, factorization reports, pairs.
    type(contact_problem_t), intent(in) :: problem
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Its compliance operator.
    type(body_compliance_t), intent(in) :: compliance
    !> Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Amplitudes of the modes of all bodies, body after body (number of modes) [length]; of size 0 where there are
    !> none.
    real(dp), intent(in) :: alpha(:)
    !> Whether stresses are wanted.
    logical, intent(in) :: want_stress
    !> Displacements and stresses of the bodies (n_bodies).
    type(body_solution_t), allocatable, intent(out) :: solution(:)
    integer :: i, b, order(size(problem%body)), first(size(problem%body) + 1)
    allocate (solution(size(problem%body)))
    first = first_mode(problem%modes)
    order = largest_first(real(problem%body%n_unknowns(), dp))
    call set_blas_threads(problem%n_blas)
    call expect_progress(sum(real(problem%body%n_unknowns(), dp)))
    !$omp parallel do default(none) private(b) schedule(dynamic, 1) &
    !$omp& shared(problem, qp, compliance, m, alpha, first, want_stress, solution, order) if (compliance%side_by_side)
    do i = 1, size(solution)
      b = order(i)
      if (.not. problem%ranks%is_own(b)) cycle
      call recover_body(problem, qp, compliance, b, m, alpha(first(b):first(b + 1) - 1), want_stress, solution(b))
      call add_progress(real(problem%body(b)%n_unknowns(), dp))
    end do
    !$omp end parallel do
    call expect_progress(0.0_dp)
    call set_blas_threads(1)
    call share_solution(problem, solution)
  end subroutine recover_bodies

  !> Make the displacements of the shared nodes of all bodies known to all ranks.
  subroutine share_solution(problem, solution)
    !> Bodies and their ranks.
    type(contact_problem_t), intent(in) :: problem
    !> Those of this rank in, of all out (n_bodies).
    type(body_solution_t), intent(inout) :: solution(:)
    type(item_t) :: item(size(solution))
    integer :: b
    if (n_ranks() == 1 .or. problem%ranks%are_split()) return
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b))
        item(b)%value = reshape(solution(b)%displacement(:, body%shared_node), &
                                [body%dimension*size(body%shared_node)])
      end associate
    end do
    call share(problem%ranks%owner, item)
    do b = 1, size(solution)
      if (problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b))
        if (allocated(solution(b)%displacement)) deallocate (solution(b)%displacement)
        allocate (solution(b)%displacement(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
        solution(b)%displacement(:, body%shared_node) = &
          reshape(item(b)%value, [body%dimension, size(body%shared_node)])
      end associate
    end do
  end subroutine share_solution

  !> Recover one body: one solve, unless it touches no other.
  subroutine recover_body(problem, qp, compliance, b, m, alpha, want_stress, solution)
    !> Bodies, modes, factorization reports, pairs.
    type(contact_problem_t), intent(in) :: problem
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Its compliance operator.
    type(body_compliance_t), intent(in) :: compliance
    !> The body.
    integer, intent(in) :: b
    !> Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Amplitudes of the modes of the body (n_modes) [length].
    real(dp), intent(in) :: alpha(:)
    !> Whether stresses are wanted.
    logical, intent(in) :: want_stress
    !> Displacements, and stresses where wanted.
    type(body_solution_t), intent(inout) :: solution
    real(dp), allocatable :: x(:)
    associate (body => problem%body(b), isolated => problem%isolated(b))
      if (allocated(isolated%displacement)) then
        solution%displacement = isolated%displacement
      else
        allocate (solution%displacement(body%dimension, body%mesh%n_nodes()))
        allocate (x(body%constraint%n_equations))
        call forces_on_body(body, qp, b, m, x)
        call compliance%solve(b, x)
        call body%constraint%expand(x, solution%displacement, .true.)
      end if
      call add_modes(problem%modes(b), alpha, solution%displacement)
      if (.not. want_stress) return
      allocate (solution%stress(6, body%mesh%n_elements()))
      call element_stress(body, solution%displacement, solution%stress, solution%strain_energy)
    end associate
  end subroutine recover_body

  !> Loads and contact forces over the equations of a body.
  subroutine forces_on_body(body, qp, b, m, x)
    !> The body; its right-hand side is that of the loads.
    type(body_t), intent(in) :: body
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Its number.
    integer, intent(in) :: b
    !> Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> (n_equations) [force]
    real(dp), intent(out) :: x(:)
    real(dp), allocatable :: force(:, :), of_nodes(:, :)
    allocate (of_nodes(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
    call qp%body_force(b, m, force)
    of_nodes(:, qp%block(b)%contact_node) = force
    call body%constraint%reduce(of_nodes, x)
    x = x + body%rhs
  end subroutine forces_on_body

  !> Add motions along rigid body modes.
  pure subroutine add_modes(modes, alpha, displacement)
    !> The modes.
    type(body_modes_t), intent(in) :: modes
    !> Their amplitudes (n_modes) [length].
    real(dp), intent(in) :: alpha(:)
    !> Displacements, added to (dimension, n_nodes) [length].
    real(dp), intent(inout) :: displacement(:, :)
    integer :: k
    do k = 1, size(alpha)
      displacement = displacement + alpha(k)*modes%shape(:, :, k)
    end do
  end subroutine add_modes
end module dotyk_control_body_solution
