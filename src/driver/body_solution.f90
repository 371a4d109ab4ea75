!> Displacements and stresses of all bodies, once the contact pressures are known.
module dotyk_driver_body_solution
  use dotyk_base_kinds, only: dp
  use dotyk_driver_free_scene, only: free_body_t, recover_displacement
  use dotyk_driver_parallel, only: largest_first, set_blas_threads
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_stress, only: element_stress
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> What one body does under its loads and contact pressures.
  type, public :: body_solution_t
    !> Displacements of the nodes (dimension, n_nodes) [length]; not allocated where nobody needs them.
    real(dp), allocatable :: displacement(:, :)
    !> Mean stress of the elements, xx yy zz xy yz xz (6, n_elements) [pressure]; not allocated where nobody asked.
    real(dp), allocatable :: stress(:, :)
  end type body_solution_t

  public :: recover_bodies

contains

  !> Recover all bodies, side by side.
  subroutine recover_bodies(body, problem, m, alpha, alone, want_stress, n_blas, solution)
    !> The bodies (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(contact_problem_t), intent(inout) :: problem
    !> State of the scheme (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Amplitudes of the free motions of all bodies, body after body; of size 0 where all are held [length].
    real(dp), intent(in) :: alpha(:)
    !> What bodies do that touch nothing (n_bodies).
    type(free_body_t), intent(in) :: alone(:)
    logical, intent(in) :: want_stress
    !> BLAS threads of each solve.
    integer, intent(in) :: n_blas
    !> (n_bodies).
    type(body_solution_t), allocatable, intent(out) :: solution(:)
    integer :: i, b, order(size(body)), first(size(body) + 1)
    allocate (solution(size(body)))
    first(1) = 1
    do b = 1, size(body)
      first(b + 1) = first(b) + body(b)%modes%n
    end do
    order = largest_first(real(body%constraint%n_equations, dp))
    call set_blas_threads(n_blas)
    !$omp parallel do default(none) shared(body, problem, m, alpha, alone, first, want_stress, solution, order) private(b) &
    !$omp& schedule(dynamic, 1) if (problem%side_by_side)
    do i = 1, size(body)
      b = order(i)
      call recover_body(body(b), problem, b, m, alpha(first(b):first(b + 1) - 1), alone(b), want_stress, solution(b))
    end do
    !$omp end parallel do
    call set_blas_threads(1)
    do b = 1, size(body)
      if (.not. allocated(alone(b)%displacement)) problem%full_solves = problem%full_solves + 1
    end do
  end subroutine recover_bodies

  !> Recover one body.
  subroutine recover_body(body, problem, b, m, alpha, alone, want_stress, solution)
    type(body_t), intent(in) :: body
    type(contact_problem_t), intent(inout) :: problem
    !> Index of the body.
    integer, intent(in) :: b
    real(dp), intent(in) :: m(:)
    !> Amplitudes of the body's free motions (n_motions) [length].
    real(dp), intent(in) :: alpha(:)
    type(free_body_t), intent(in) :: alone
    logical, intent(in) :: want_stress
    type(body_solution_t), intent(inout) :: solution
    real(dp), allocatable :: force(:, :)
    integer :: k
    if (allocated(alone%displacement)) then
      solution%displacement = alone%displacement
      do k = 1, size(alpha)
        solution%displacement = solution%displacement + alpha(k)*body%rigid_mode(:, :, k)
      end do
    else
      call problem%body_force(b, m, force)
      call recover_displacement(body, problem%response(b)%form, problem%operator%block(b)%contact_node, force, &
                                alpha, solution%displacement)
    end if
    if (.not. want_stress) return
    allocate (solution%stress(6, body%mesh%n_elements()))
    call element_stress(body, solution%displacement, solution%stress)
  end subroutine recover_body
end module dotyk_driver_body_solution
