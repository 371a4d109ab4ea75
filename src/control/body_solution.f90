!> Displacements and stresses of all bodies, once the contact pressures are known.
!>
!> Several load cases are recovered in one block: one solve of each body with as many right-hand sides reads the entries
!> of its factor once.
module dotyk_control_body_solution
  use dotyk_base_kinds, only: dp
  use dotyk_base_progress, only: add_progress, expect_progress
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_ranks_exchange, only: item_t, share
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_control_parallel, only: largest_first, set_blas_threads
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_gradient_recovery, only: recovered_strains_t
  use dotyk_elasticity_load_cases, only: take_case
  use dotyk_elasticity_nodal_stress, only: element_stress
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  type, public :: body_solution_t  !! One body under its loads and contact pressures.
    !> Displacements of the nodes (dimension, n_nodes) [length]; not allocated where nobody needs them. Of bodies that
    !> other ranks compute those of the shared nodes are known (`body_t%shared_node`), others are 0.
    real(dp), allocatable :: displacement(:, :)
    !> Mean stress of the elements, xx yy zz xy yz xz (6, n_elements) [pressure]; not allocated where nobody asked, and
    !> on ranks that do not compute the body.
    real(dp), allocatable :: stress(:, :)
    real(dp) :: strain_energy = 0  !! Strain energy of the own elements, where the stress is allocated [energy].
    !> Forces whose displacements are to be added; not allocated where there are none (n_equations) [force].
    real(dp), allocatable, private :: force(:)
  end type body_solution_t

  type, public :: element_field_t  !! One number for each element of a body.
    real(dp), allocatable :: value(:)  !! In the order of the blocks (n_elements).
  end type element_field_t

  type, public :: group_strains_t  !! Strains that were recovered for some congruent bodies.
    type(recovered_strains_t), allocatable :: of_material(:)  !! (n_materials)
  end type group_strains_t

  type, public :: displacements_t  !! Displacements of all bodies in a load case, and the errors of the mesh in them.
    !> The load case, to be taken by the bodies first where several are in a block; 0: it acts on them already.
    integer :: case = 0
    real(dp), allocatable :: pressure(:)  !! Contact pressures of a load case in a block (n_rows) [pressure].
    !> Displacements and stresses; not allocated where they are not known (n_bodies).
    type(body_solution_t), allocatable :: body(:)
    !> Squared errors of the elements; not allocated where they are not known, or for bodies of other ranks (n_bodies)
    !> [energy].
    type(element_field_t), allocatable :: square(:)
    real(dp) :: norm_square = 0  !! Squared energy norm of the solution, known with the errors [energy].
    !> Recovered strains, until nodal stresses take them; not allocated where nothing has replaced them in
    !> `kept_estimates_t` (those of `congruent_groups`).
    type(group_strains_t), allocatable :: recovered(:)
    !> Recoveries of all bodies that they took, those of the corrections of ill-conditioned bodies included.
    integer :: n_recoveries = 0
  contains
    procedure :: forget => displacements_forget
    procedure :: begin => displacements_begin
  end type displacements_t

  public :: recover_block, recover_bodies, share_solution

contains

  !> Nothing is known but the number of recoveries.
  subroutine displacements_forget(self)
    class(displacements_t), intent(inout) :: self
    self%case = 0
    if (allocated(self%pressure)) deallocate (self%pressure)
    if (allocated(self%body)) deallocate (self%body)
    if (allocated(self%square)) deallocate (self%square)
    if (allocated(self%recovered)) deallocate (self%recovered)
  end subroutine displacements_forget

  !> Begin the displacements of a load case whose contact is solved, while it acts on the bodies: motions along its
  !> modes, bodies that touch no other, and the forces on all others.
  subroutine displacements_begin(self, problem, qp, pressure, alpha)
    class(displacements_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    !> Amplitudes of the modes of all bodies, body after body (number of modes) [length]; of size 0 where there are
    !> none.
    real(dp), intent(in) :: alpha(:)
    integer :: b, first(size(problem%body) + 1)
    call self%forget()
    self%pressure = pressure
    allocate (self%body(size(problem%body)))
    first = first_mode(problem%modes, problem%tie)
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b), solution => self%body(b))
        if (allocated(problem%isolated(b)%displacement)) then
          solution%displacement = problem%isolated(b)%displacement
        else
          allocate (solution%displacement(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
          allocate (solution%force(body%constraint%n_equations))
          call forces_on_body(body, qp, b, pressure, solution%force)
        end if
        call add_modes(problem%modes(b), alpha(first(b):first(b) + problem%modes(b)%n - 1), solution%displacement)
      end associate
    end do
  end subroutine displacements_begin

  !> Recover the bodies of the load case that acts on them.
  subroutine recover_bodies(problem, qp, compliance, pressure, alpha, want_stress, solution)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(body_compliance_t), intent(in) :: compliance  !! Its compliance operator.
    real(dp), intent(in) :: pressure(:), alpha(:)  !! As in `displacements_begin`.
    logical, intent(in) :: want_stress  !! Whether stresses are wanted.
    !> Displacements and stresses of the bodies (n_bodies).
    type(body_solution_t), allocatable, intent(out) :: solution(:)
    type(displacements_t) :: block(1)
    call block(1)%begin(problem, qp, pressure, alpha)
    call recover_block(problem, compliance, want_stress, block)
    call move_alloc(block(1)%body, solution)
  end subroutine recover_bodies

  !> Recover all bodies in all load cases of a block, side by side.
  subroutine recover_block(problem, compliance, want_stress, block)
    !> Bodies and modes; any of the load cases acts on the bodies on return.
    type(contact_problem_t), intent(inout) :: problem
    type(body_compliance_t), intent(in) :: compliance  !! The compliance operator of all of the load cases.
    logical, intent(in) :: want_stress  !! Whether stresses are wanted.
    type(displacements_t), intent(inout) :: block(:)  !! Begun (n).
    integer :: b, i, order(size(problem%body))
    order = largest_first(real(problem%body%n_unknowns(), dp))
    call set_blas_threads(problem%n_blas)
    call expect_progress(sum(real(problem%body%n_unknowns(), dp)))
    !$omp parallel do default(none) private(b) schedule(dynamic, 1) if (compliance%side_by_side) &
    !$omp& shared(problem, compliance, want_stress, block, order)
    do i = 1, size(order)
      b = order(i)
      if (.not. problem%ranks%is_own(b)) cycle
      call recover_body(problem%body(b), compliance, b, want_stress, block)
      call add_progress(real(problem%body(b)%n_unknowns(), dp))
    end do
    !$omp end parallel do
    call expect_progress(0.0_dp)
    call set_blas_threads(1)
    do i = 1, size(block)
      block(i)%n_recoveries = block(i)%n_recoveries + 1
      call share_solution(problem, block(i)%body)
    end do
  end subroutine recover_block

  !> Recover one body: one solve, unless it touches no other.
  subroutine recover_body(body, compliance, b, want_stress, block)
    type(body_t), intent(inout) :: body  !! The body; any of the load cases acts on it on return.
    type(body_compliance_t), intent(in) :: compliance  !! The compliance operator.
    integer, intent(in) :: b  !! Its number.
    logical, intent(in) :: want_stress  !! Whether stresses are wanted.
    type(displacements_t), intent(inout) :: block(:)  !! Begun (n).
    real(dp), allocatable :: x(:, :), u(:, :)
    logical :: moves
    integer :: j
    ! A body touches another in all load cases or in none.
    moves = allocated(block(1)%body(b)%force)
    if (moves) then
      allocate (x(body%constraint%n_equations, size(block)), u(body%dimension, body%mesh%n_nodes()))
      do j = 1, size(block)
        x(:, j) = block(j)%body(b)%force
        deallocate (block(j)%body(b)%force)
      end do
      call compliance%solve_block(b, x)
    end if
    do j = 1, size(block)
      if (block(j)%case > 0) call take_case(body, block(j)%case)
      associate (solution => block(j)%body(b))
        if (moves) then
          call body%constraint%expand(x(:, j), u, .true.)
          solution%displacement = solution%displacement + u
        end if
        if (.not. want_stress) cycle
        allocate (solution%stress(6, body%mesh%n_elements()))
        call element_stress(body, solution%displacement, solution%stress, solution%strain_energy)
      end associate
    end do
  end subroutine recover_body

  !> Make the displacements of the shared nodes of all bodies known to all ranks.
  subroutine share_solution(problem, solution)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(body_solution_t), intent(inout) :: solution(:)  !! Those of this rank in, of all out (n_bodies).
    type(item_t) :: item(size(solution))
    integer :: b
    if (n_ranks() == 1 .or. problem%ranks%are_split()) return
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b))
        item(b)%value = reshape(solution(b)%displacement(:, body%shared_node), [body%dimension*size(body%shared_node)])
      end associate
    end do
    call share(problem%ranks%owner, item)
    do b = 1, size(solution)
      if (problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b))
        if (allocated(solution(b)%displacement)) deallocate (solution(b)%displacement)
        allocate (solution(b)%displacement(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
        solution(b)%displacement(:, body%shared_node) = reshape(item(b)%value, [body%dimension, size(body%shared_node)])
      end associate
    end do
  end subroutine share_solution

  !> Loads and contact forces over the equations of a body.
  subroutine forces_on_body(body, qp, b, pressure, x)
    type(body_t), intent(in) :: body  !! The body; its right-hand side is that of the loads.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    integer, intent(in) :: b  !! Its number.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    real(dp), intent(out) :: x(:)  !! (n_equations) [force]
    real(dp), allocatable :: force(:, :), of_nodes(:, :)
    allocate (of_nodes(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
    call qp%body_force(b, pressure, force)
    of_nodes(:, qp%block(b)%contact_node) = force
    call body%constraint%reduce(of_nodes, x)
    x = x + body%rhs
  end subroutine forces_on_body

  !> Add motions along rigid body modes.
  pure subroutine add_modes(modes, alpha, displacement)
    type(body_modes_t), intent(in) :: modes  !! The modes.
    real(dp), intent(in) :: alpha(:)  !! Their amplitudes (n_modes) [length].
    real(dp), intent(inout) :: displacement(:, :)  !! Displacements, added to (dimension, n_nodes) [length].
    integer :: k
    do k = 1, size(alpha)
      displacement = displacement + alpha(k)*modes%shape(:, :, k)
    end do
  end subroutine add_modes
end module dotyk_control_body_solution
