!> The scene without contact, u0: one solve of every body that has loads or given displacements. It is the start of every scheme, and for
!> bodies that touch nothing it is the answer.
!>
!> A body with free rigid motions does not move by them in u0: loads are taken without their resultants on the motions, which are
!> the schemes' to balance.
module dotyk_driver_free_scene
  use dotyk_base_kinds, only: dp
  use dotyk_driver_parallel, only: largest_first, set_blas_threads
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_response_response, only: response_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: solve_free_scene, recover_displacement

  !> Displacements of a body that touches nothing.
  type, public :: free_body_t
    !> (dimension, n_nodes) [length]; not allocated where it touches something.
    real(dp), allocatable :: displacement(:, :)
  end type free_body_t

  !> What one body adds.
  type :: contribution_t
    !> Displacements of the contact nodes without contact, and those by the loads alone with supports at rest (dimension*n).
    real(dp), allocatable :: u_free(:), u_load(:)
    !> A(u0,u0)/2 and L(u0) [energy].
    real(dp) :: strain_energy = 0, work = 0
    !> Solves that it took.
    integer :: solves = 0
  end type contribution_t

contains

  !> Fill `y_free`, `y_load`, `energy_free` and `norm_free` of the problem.
  subroutine solve_free_scene(body, problem, n_blas, alone)
    !> The bodies (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> With operator and responses.
    type(contact_problem_t), intent(inout) :: problem
    !> BLAS threads of each solve.
    integer, intent(in) :: n_blas
    !> What bodies do that touch nothing (n_bodies).
    type(free_body_t), allocatable, intent(out) :: alone(:)
    type(contribution_t), allocatable :: part(:)
    real(dp), allocatable :: row_displacement(:)
    integer :: i, b, order(size(body))
    allocate (part(size(body)), alone(size(body)))
    order = largest_first(real(body%constraint%n_equations, dp))
    call set_blas_threads(n_blas)
    !$omp parallel do default(none) shared(body, problem, part, alone, order) private(b) &
    !$omp& schedule(dynamic, 1) if (problem%side_by_side)
    do i = 1, size(body)
      b = order(i)
      call solve_free_body(body(b), problem%response(b)%form, problem%operator%block(b)%contact_node, part(b), alone(b))
    end do
    !$omp end parallel do
    call set_blas_threads(1)

    problem%y_free = -problem%operator%gap
    allocate (problem%y_load(problem%operator%n_rows), source=0.0_dp)
    problem%energy_free = 0
    problem%norm_free = 0
    do b = 1, size(body)
      problem%energy_free = problem%energy_free + part(b)%strain_energy - part(b)%work
      problem%norm_free = problem%norm_free + 2*part(b)%strain_energy
      problem%full_solves = problem%full_solves + part(b)%solves
      associate (block => problem%operator%block(b))
        if (size(block%row) == 0) cycle
        if (allocated(row_displacement)) deallocate (row_displacement)
        allocate (row_displacement(size(block%row)))
        call block%matrix%multiply(part(b)%u_free, row_displacement)
        problem%y_free(block%row) = problem%y_free(block%row) + row_displacement
        call block%matrix%multiply(part(b)%u_load, row_displacement)
        problem%y_load(block%row) = problem%y_load(block%row) + row_displacement
      end associate
    end do
  end subroutine solve_free_scene

  !> One body without contact.
  subroutine solve_free_body(body, response, contact_node, part, alone)
    type(body_t), intent(in) :: body
    class(response_t), intent(inout) :: response
    !> Nodes of the body that may touch.
    integer, intent(in) :: contact_node(:)
    type(contribution_t), intent(out) :: part
    type(free_body_t), intent(inout) :: alone
    real(dp), allocatable :: x(:), u(:, :)
    logical :: is_moved
    is_moved = any(abs(body%constraint%prescribed) > 0)
    x = body%rhs
    call solve_if_loaded(response, x, part%solves)
    allocate (u(body%dimension, size(body%mesh%x, 2)))
    call body%constraint%expand(x, u, .true.)
    if (is_moved) then
      part%strain_energy = strain_energy(body, u)
    else
      part%strain_energy = dot_product(x, body%rhs)/2
    end if
    part%work = sum(body%load*u)
    part%u_free = reshape(u(:, contact_node), [body%dimension*size(contact_node)])
    if (size(contact_node) == 0) then
      call move_alloc(u, alone%displacement)
    else if (is_moved) then
      call body%constraint%reduce(body%load, x)
      call solve_if_loaded(response, x, part%solves)
      call body%constraint%expand(x, u, .false.)
      part%u_load = reshape(u(:, contact_node), [body%dimension*size(contact_node)])
    else
      part%u_load = part%u_free
    end if
  end subroutine solve_free_body

  !> A solve, unless there is nothing to solve for: most bodies of many scenes have neither loads nor given displacements.
  subroutine solve_if_loaded(response, x, solves)
    class(response_t), intent(inout) :: response
    real(dp), intent(inout) :: x(:)
    !> Counts.
    integer, intent(inout) :: solves
    if (.not. any(abs(x) > 0)) return
    call response%solve(x)
    solves = solves + 1
  end subroutine solve_if_loaded

  !> Displacements of all nodes of a body under its loads, given displacements and contact forces, and free motions: one
  !> solve.
  subroutine recover_displacement(body, response, contact_node, contact_force, alpha, u)
    type(body_t), intent(in) :: body
    class(response_t), intent(inout) :: response
    !> Nodes where contact forces act (n), and the forces (dimension, n) [force].
    integer, intent(in) :: contact_node(:)
    real(dp), intent(in) :: contact_force(:, :)
    !> Amplitudes of the body's free motions (n_motions) [length].
    real(dp), intent(in) :: alpha(:)
    !> Displacements (dimension, n_nodes) [length].
    real(dp), allocatable, intent(out) :: u(:, :)
    real(dp), allocatable :: x(:)
    integer :: k
    allocate (u(body%dimension, size(body%mesh%x, 2)), source=0.0_dp)
    allocate (x(body%constraint%n_equations))
    u(:, contact_node) = contact_force
    call body%constraint%reduce(u, x)
    x = x + body%rhs
    call response%solve(x)
    call body%constraint%expand(x, u, .true.)
    do k = 1, size(alpha)
      u = u + alpha(k)*body%rigid_mode(:, :, k)
    end do
  end subroutine recover_displacement
end module dotyk_driver_free_scene
