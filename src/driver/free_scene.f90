!> The scene without contact, u0: one solve of every body. It is the start of every scheme.
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

  !> What one body adds.
  type :: contribution_t
    !> Displacements of the contact nodes without contact, and those by the loads alone with supports at rest (dimension*n).
    real(dp), allocatable :: u_free(:), u_load(:)
    !> A(u0,u0)/2 and L(u0) [energy].
    real(dp) :: strain_energy = 0, work = 0
  end type contribution_t

contains

  !> Fill `y_free`, `y_load`, `energy_free` and `norm_free` of the problem.
  subroutine solve_free_scene(body, problem, n_blas)
    !> The bodies (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> With operator and responses.
    type(contact_problem_t), intent(inout) :: problem
    !> BLAS threads of each solve.
    integer, intent(in) :: n_blas
    type(contribution_t), allocatable :: part(:)
    real(dp), allocatable :: row_displacement(:)
    integer :: i, b, order(size(body))
    allocate (part(size(body)))
    order = largest_first(real(body%constraint%n_equations, dp))
    call set_blas_threads(n_blas)
    !$omp parallel do default(none) shared(body, problem, part, order) private(b) schedule(dynamic, 1) &
    !$omp& if (problem%side_by_side)
    do i = 1, size(body)
      b = order(i)
      call solve_free_body(body(b), problem%response(b)%form, problem%operator%block(b)%contact_node, part(b))
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
  subroutine solve_free_body(body, response, contact_node, part)
    type(body_t), intent(in) :: body
    class(response_t), intent(inout) :: response
    !> Nodes of the body that may touch.
    integer, intent(in) :: contact_node(:)
    type(contribution_t), intent(out) :: part
    real(dp), allocatable :: x(:), u(:, :)
    x = body%rhs
    ! Most bodies of many scenes have neither loads nor given displacements.
    if (any(abs(x) > 0)) call response%solve(x)
    allocate (u(body%dimension, size(body%mesh%x, 2)))
    call body%constraint%expand(x, u, .true.)
    part%strain_energy = strain_energy(body, u)
    part%work = sum(body%load*u)
    part%u_free = reshape(u(:, contact_node), [body%dimension*size(contact_node)])
    if (any(abs(body%constraint%prescribed) > 0)) then
      call body%constraint%reduce(body%load, x)
      if (any(abs(x) > 0)) call response%solve(x)
      call body%constraint%expand(x, u, .false.)
      part%u_load = reshape(u(:, contact_node), [body%dimension*size(contact_node)])
    else
      part%u_load = part%u_free
    end if
  end subroutine solve_free_body

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
      u = u + alpha(k)*body%free_motion(:, :, k)
    end do
  end subroutine recover_displacement
end module dotyk_driver_free_scene
