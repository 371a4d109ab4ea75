!> Bodies that all ranks compute together, as a run sees them: their compliance operators, whose solves are made by all
!> ranks at the same time, one after the other, and their scheme, the engine of `dotyk_scheme_primal` with the linear
!> systems of `dotyk_distributed_system`.
module dotyk_split_split_scene
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_interrupt, only: interrupted, watch_interrupts
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_control_response_choice, only: iterations_per_step
  use dotyk_distributed_petsc, only: start_petsc, stop_petsc
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_material, only: weight_moduli
  use dotyk_elasticity_stress_energy, only: stresses_and_energy
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: add_up, agree_on_error, meet
  use dotyk_response_multigrid_response, only: near
  use dotyk_response_response, only: equation_vector_t, response_slot_t, response_t, substituted_rows_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_primal, only: solve_by_displacements
  use dotyk_scheme_proximal_active_set, only: proximal_outcome_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_costly, ended_interrupted, ended_solves
  use dotyk_scheme_stopping, only: solver_settings_t
  use dotyk_scheme_winkler_start, only: clear
  use dotyk_split_split_bodies, only: split_bodies_t
  implicit none
  private
  public :: can_split

  type, extends(response_t) :: split_response_t  !! The compliance operator of a body.
    type(split_bodies_t), pointer :: bodies => null()  !! All bodies.
    integer :: b = 0  !! This one.
  contains
    procedure :: solve => response_solve
    procedure :: solve_from => response_solve_from
    procedure :: subtract_forces => response_subtract_forces
    procedure :: solves_together => response_solves_together
    procedure :: solve_together => response_solve_together
    procedure :: solve_error => response_solve_error
    procedure :: prepare_substitution => response_prepare_substitution
    procedure :: path_entries => response_path_entries
    procedure :: substitute => response_substitute
    procedure :: product => response_product
    procedure :: destroy => response_destroy
  end type split_response_t

  type, extends(scheme_t) :: split_primal_t  !! The scheme.
    type(split_bodies_t), pointer :: bodies => null()  !! The bodies.
  contains
    procedure :: solve => primal_solve
  end type split_primal_t

  type, public :: split_scene_t  !! The bodies of a scene.
    !> They; one place for all copies, because others refer to it.
    type(split_bodies_t), pointer, private :: bodies => null()
  contains
    procedure :: assemble => scene_assemble
    procedure :: factorize => scene_factorize
    procedure :: take_responses => scene_take_responses
    procedure :: take_scheme => scene_take_scheme
    procedure :: destroy => scene_destroy
  end type split_scene_t

contains

  !> Whether there are several ranks, and what splits bodies.
  logical function can_split()
    can_split = n_ranks() > 1
  end function can_split

  !> Assemble the parts of all bodies.
  subroutine scene_assemble(self, body, modes, error)
    class(split_scene_t), intent(inout) :: self
    !> Parts of bodies with supports and loads; get the mean modulus of the bodies (n_bodies).
    type(body_t), intent(inout) :: body(:)
    type(body_modes_t), intent(in) :: modes(:)  !! Their rigid body modes (n_bodies).
    !> Allocated where elements do not conform, or are inverted, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    call start_petsc(error)
    if (allocated(error)) return
    ! PETSc has taken the signals.
    call watch_interrupts()
    call set_mean_modulus(body, error)
    if (allocated(error)) return
    allocate (self%bodies)
    call self%bodies%assemble(body, modes, error)
  end subroutine scene_assemble

  !> Means of the modulus fields over the volumes of bodies.
  subroutine set_mean_modulus(body, error)
    !> Parts of bodies; those with a modulus field or several materials get the mean (n_bodies).
    type(body_t), intent(inout) :: body(:)
    !> Allocated where a field is not positive, or an element is inverted.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :), stress(:, :), factor(:), volume(:)
    real(dp) :: energy, sums(2)
    integer :: b, first, k, last
    do b = 1, size(body)
      if (size(body(b)%material) == 1 .and. .not. body(b)%material(1)%has_modulus_field()) cycle
      associate (mesh => body(b)%mesh)
        allocate (u(body(b)%dimension, mesh%n_nodes()), source=0.0_dp)
        allocate (stress(6, mesh%n_elements()), factor(mesh%n_elements()), volume(mesh%n_elements()))
        call stresses_and_energy(mesh, body(b)%analysis, body(b)%material, u, stress, energy, error, factor, volume)
        call agree_on_error(error)
        call add_context(error, 'body '//quoted(body(b)%name)//': ')
        if (allocated(error)) return
        last = 0
        do k = 1, size(mesh%block)
          first = last + 1
          last = last + size(mesh%block(k)%tag)
          call weight_moduli(body(b)%material, mesh%block(k)%material, factor(first:last))
        end do
        sums = [sum(factor*volume, mask=mesh%whole%own_element), sum(volume, mask=mesh%whole%own_element)]
      end associate
      call add_up(sums)
      body(b)%mean_modulus_factor = sums(1)/sums(2)
      deallocate (u, stress, factor, volume)
    end do
  end subroutine set_mean_modulus

  !> Make ready for solves.
  subroutine scene_factorize(self, body, operator, report, error)
    class(split_scene_t), intent(in) :: self
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_operator_t), intent(in) :: operator  !! Contact rows, the same on all ranks.
    !> Gets the diagonals of the stiffnesses (n_bodies).
    type(factorization_report_t), allocatable, intent(out) :: report(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer :: b
    allocate (report(size(body)))
    call self%bodies%factorize(operator, error)
    if (allocated(error)) return
    do b = 1, size(body)
      call self%bodies%diagonal(b, report(b)%diagonal)
      allocate (report(b)%fixing_equation(0), report(b)%spring(0))
    end do
  end subroutine scene_factorize

  !> Compliance operators.
  subroutine scene_take_responses(self, body, modes, response)
    class(split_scene_t), intent(in) :: self
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_modes_t), intent(in) :: modes(:)  !! Their rigid body modes (n_bodies).
    type(response_slot_t), intent(inout) :: response(:)  !! Get the operators (n_bodies).
    type(split_response_t), allocatable :: form
    integer :: b, k
    do b = 1, size(body)
      allocate (form)
      form%bodies => self%bodies
      form%b = b
      allocate (form%mode(body(b)%constraint%n_equations, modes(b)%n))
      do k = 1, modes(b)%n
        call body(b)%constraint%reduce(modes(b)%shape(:, :, k), form%mode(:, k))
      end do
      call move_alloc(form, response(b)%form)
    end do
  end subroutine scene_take_responses

  !> The scheme.
  subroutine scene_take_scheme(self, most_iterations, scheme)
    class(split_scene_t), intent(in) :: self
    integer, intent(in) :: most_iterations  !! Iterations of conjugate gradients after which it ends without a solution.
    class(scheme_t), allocatable, intent(inout) :: scheme  !! Replaced.
    if (allocated(scheme)) deallocate (scheme)
    allocate (split_primal_t :: scheme)
    select type (scheme)
    type is (split_primal_t)
      scheme%bodies => self%bodies
      scheme%bodies%system%most_iterations = most_iterations
    end select
  end subroutine scene_take_scheme

  !> Give back all memory.
  subroutine scene_destroy(self)
    class(split_scene_t), intent(inout) :: self
    if (.not. associated(self%bodies)) return
    call self%bodies%destroy()
    deallocate (self%bodies)
    call stop_petsc()
  end subroutine scene_destroy

  !> Solve.
  subroutine primal_solve(self, qp, compliance, settings, monitor, state, error)
    class(split_primal_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    type(solver_settings_t), intent(in) :: settings
    class(monitor_t), intent(inout) :: monitor
    type(solver_state_t), intent(inout) :: state
    type(error_t), allocatable, intent(out) :: error
    type(dual_t) :: dual
    type(proximal_outcome_t) :: total
    real(dp), allocatable :: u(:), left(:)
    real(dp) :: tolerance
    integer :: steps, b
    select type (compliance)
    class is (body_compliance_t)
      call compliance%forget_displacements()
    end select
    if (qp%n_rows == 0) then
      call dual%solve(qp, compliance, settings, monitor, state, error)
      if (.not. allocated(error)) call add_solve_error(self%bodies%solve_error(), settings%tolerance, state)
      return
    end if
    associate (system => self%bodies%system)
      if (iterations_per_step*self%bodies%steps_of_free > system%most_iterations) then
        call clear(state)
        state%ended = ended_costly
        return
      end if
      steps = system%n_iterations
      ! The error of solves is added to its bound, and may have grown a little by then.
      tolerance = settings%tolerance - 2*min(settings%tolerance/4, self%bodies%solve_error())
      call move_alloc(system%u, u)
      if (.not. allocated(state%pressure) .and. allocated(u)) deallocate (u)
      call solve_by_displacements(system, qp, tolerance, settings, spread(.false., 1, qp%n_rows), monitor, u, total, &
                                  state, error)
      if (allocated(error)) return
      call meet()
      if (.not. allocated(state%pressure)) return
      allocate (left, source=u)
      call move_alloc(u, system%u)
      call system%remove_modes(left)
      call add_solve_error(self%bodies%solve_error(), settings%tolerance, state)
      if (interrupted() .and. state%ended /= ended_converged) state%ended = ended_interrupted
      select type (compliance)
      class is (body_compliance_t)
        do b = 1, size(compliance%body)
          if (.not. allocated(compliance%body(b)%found)) &
            allocate (compliance%body(b)%found(size(compliance%response(b)%form%mode, 1)))
          call self%bodies%to_equations(b, left, compliance%body(b)%found)
        end do
      end select
      steps = system%n_iterations - steps
      compliance%n_sweeps = compliance%n_sweeps + steps
      call monitor%note('displacements    '//to_text(total%steps)//' active sets, '//to_text(steps)// &
                        ' iterations of conjugate gradients with p-multigrid, '//to_text(system%n_setups)// &
                        ' set-ups of smoothed aggregation')
    end associate
  end subroutine primal_solve

  !> Add the error of solves: of the solution without contact, and of bodies that touch no other.
  subroutine add_solve_error(solve_error, tolerance, state)
    real(dp), intent(in) :: solve_error  !! Relative, in the energy norm; huge where a solve has failed [].
    real(dp), intent(in) :: tolerance  !! Bound that was asked for [].
    type(solver_state_t), intent(inout) :: state  !! Where the scheme ended.
    state%bound_is_guaranteed = .false.
    if (.not. allocated(state%pressure) .or. .not. state%error_bound < huge(tolerance)) return
    state%error_bound = min(huge(tolerance)/2, state%error_bound) + min(huge(tolerance)/2, solve_error)
    if (state%ended == ended_converged .and. state%error_bound > tolerance) state%ended = ended_solves
  end subroutine add_solve_error

  !> x := K^+ x.
  subroutine response_solve(self, x)
    class(split_response_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)
    call self%bodies%solve(self%b, x)
  end subroutine response_solve

  !> x := K^+ x from an approximate solution, which is kept where it leaves a small part of the forces only: that of the
  !> scheme, whose bound knows what it leaves.
  subroutine response_solve_from(self, start, x)
    class(split_response_t), intent(in) :: self
    real(dp), intent(in) :: start(:)
    real(dp), intent(inout) :: x(:)
    real(dp), allocatable :: left(:)
    real(dp) :: norms(2)
    left = x
    call self%bodies%subtract_forces(self%b, start, left)
    associate (own => self%bodies%map(self%b)%equation)
      norms = [sum(left(own)**2), sum(x(own)**2)]
    end associate
    call add_up(norms)
    if (norms(1) <= near**2*norms(2)) then
      x = start
    else
      call self%solve(x)
    end if
  end subroutine response_solve_from

  !> What a solve leaves.
  subroutine response_subtract_forces(self, x, f)
    class(split_response_t), intent(in) :: self
    real(dp), intent(in) :: x(:)
    real(dp), intent(inout) :: f(:)
    call self%bodies%subtract_forces(self%b, x, f)
  end subroutine response_subtract_forces

  !> They are.
  pure logical function response_solves_together(self) result(together)
    class(split_response_t), intent(in) :: self
    together = associated(self%bodies)
  end function response_solves_together

  !> x := K^+ x of all bodies.
  subroutine response_solve_together(self, x)
    class(split_response_t), intent(in) :: self
    type(equation_vector_t), intent(inout) :: x(:)
    call self%bodies%solve_all(x)
  end subroutine response_solve_together

  !> Relative error of a solve in the energy norm.
  pure real(dp) function response_solve_error(self) result(error)
    class(split_response_t), intent(in) :: self
    error = self%bodies%solve_error()
  end function response_solve_error

  !> Nothing.
  subroutine response_prepare_substitution(self)
    class(split_response_t), intent(inout) :: self
    associate (not_needed => self%b)
    end associate
  end subroutine response_prepare_substitution

  !> A solve for each row is no choice.
  real(dp) function response_path_entries(self, equation) result(entries)
    class(split_response_t), intent(inout) :: self
    integer, intent(in) :: equation(:)
    entries = huge(1)
    associate (not_needed => self%b, nor_this => size(equation))
    end associate
  end function response_path_entries

  !> Rows, and K^+ of them: one solve for each.
  subroutine response_substitute(self, rows, substituted)
    class(split_response_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows
    type(substituted_rows_t), intent(inout) :: substituted
    real(dp) :: e(rows%n_rows)
    integer :: j
    substituted%forward%n = rows%n_rows
    substituted%forward%first_column = rows%row_start
    substituted%forward%column = rows%column
    substituted%forward%value = rows%value
    allocate (substituted%regularized(size(self%mode, 1), rows%n_rows), source=0.0_dp)
    do j = 1, rows%n_rows
      e = 0
      e(j) = 1
      call rows%multiply_transposed(e, substituted%regularized(:rows%n_columns, j))
      call self%solve(substituted%regularized(:, j))
    end do
  end subroutine response_substitute

  !> c_ij = a_i K^+ b_j.
  subroutine response_product(self, a, b, same, c)
    class(split_response_t), intent(in) :: self
    type(substituted_rows_t), intent(in) :: a, b
    logical, intent(in) :: same
    real(dp), intent(out) :: c(:, :)
    integer :: i, j, k
    c = 0
    do j = 1, size(c, 2)
      do i = 1, size(c, 1)
        do k = a%forward%first_column(i), a%forward%first_column(i + 1) - 1
          c(i, j) = c(i, j) + a%forward%value(k)*b%regularized(a%forward%column(k), j)
        end do
      end do
    end do
    if (same) c = (c + transpose(c))/2
    associate (not_needed => self%b)
    end associate
  end subroutine response_product

  !> The bodies belong to the scene.
  subroutine response_destroy(self)
    class(split_response_t), intent(inout) :: self
    self%bodies => null()
  end subroutine response_destroy
end module dotyk_split_split_scene
