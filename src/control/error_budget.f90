!> The error budget of a solution: iteration, penalty, discretization; all in the energy norm, relative to that of the
!> solution.
!>
!> The part of the iteration is the guaranteed bound of the scheme. That of the penalty is the distance to the solution
!> without it (`dotyk_control_penalty_error`), that of the mesh an asymptotically exact estimate
!> (`dotyk_elasticity_discretization_error`). Beside them stands the violation of the contact conditions, which hold in
!> the mean, at single points (`dotyk_contact_complementarity`).
module dotyk_control_error_budget
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_contact_complementarity, only: complementarity_error
  use dotyk_control_body_solution, only: displacements_t, element_field_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_kept_estimates, only: kept_estimates_t
  use dotyk_control_mesh_error, only: estimate_mesh_errors
  use dotyk_control_penalty_error, only: estimate_penalty_error, near_enough, penalty_reference_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_interrupted, ended_time
  implicit none
  private

  type, public :: error_budget_t  !! Parts of the error, relative; NaN where a part is not known [].
    real(dp) :: penalty = 0  !! Distance to the solution without penalty [].
    !> Whether that is a bound, not an extrapolated distance (`dotyk_control_penalty_error`).
    logical :: penalty_is_bound = .true.
    real(dp) :: discretization = 0  !! Error of the mesh [].
    !> Work of the pressures on the remaining gaps under them, as the root of twice an energy: no part of the others [].
    real(dp) :: contact = 0
    real(dp) :: norm = 0  !! Energy norm ||u||_A of the solution [sqrt(energy)].
    !> Error of the mesh of each body; not allocated where nobody asked (n_bodies) []. Squares add up.
    real(dp), allocatable :: of_body(:)
    type(element_field_t), allocatable :: of_element(:)  !! That of each element of each body, likewise (n_bodies) [].
  contains
    procedure :: init => budget_init
  end type error_budget_t

  public :: estimate_errors


contains

  !> Nothing is known.
  subroutine budget_init(self)
    class(error_budget_t), intent(out) :: self
    self%penalty = ieee_value(self%penalty, ieee_quiet_nan)
    self%discretization = self%penalty
    self%contact = self%penalty
    self%norm = self%penalty
  end subroutine budget_init

  !> Estimate the errors of a solution.
  subroutine estimate_errors(problem, qp, compliance, linear_solver, scheme, want_mesh, want_penalty, displacements, &
                             kept, state, budget, error)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    !> Its compliance operator; entries that the dual scheme forms stay there.
    class(compliance_t), intent(inout) :: compliance
    integer, intent(in) :: linear_solver  !! One of `linear_solver_*` of dotyk_base_options, for the dual scheme.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the state.
    logical, intent(in) :: want_mesh  !! Whether the error of the mesh is estimated.
    logical, intent(in) :: want_penalty  !! Whether the error of the penalty is estimated.
    !> Known where the error of the mesh is wanted; its squared errors are not, on return.
    type(displacements_t), intent(inout) :: displacements
    type(kept_estimates_t), intent(inout) :: kept  !! What the estimates keep.
    type(solver_state_t), intent(inout) :: state  !! The end of its history gets the errors.
    type(error_budget_t), intent(out) :: budget  !! Parts that were not asked for, or are not known, are NaN.
    !> Allocated where a formula of a material cannot be evaluated, or the compliance of an active set is not positive
    !> definite.
    type(error_t), allocatable, intent(out) :: error
    type(penalty_reference_t) :: reference
    real(dp) :: distance
    call budget%init()
    budget%norm = state%norm(qp)
    if (want_mesh) then
      call estimate_mesh_error(problem, displacements, qp%pair_first_row, state%pressure, qp%theta, kept, budget, error)
      if (allocated(error)) return
      if (.not. is_near(state)) call forget_mesh_error(budget)
    end if
    ! The error of the penalty takes another solution.
    if (want_penalty .and. .not. budget%norm > 0) then
      budget%penalty = 0
    else if (want_penalty .and. is_near(state) .and. all(state%ended /= [ended_interrupted, ended_time])) then
      call reference%init(problem, qp%pair_first_row, qp%theta)
      call estimate_penalty_error(qp, compliance, reference, linear_solver, scheme, state, distance, error)
      if (allocated(error)) return
      budget%penalty_is_bound = reference%is_exact()
      budget%penalty = distance/budget%norm
      if (interrupted()) budget%penalty = ieee_value(budget%penalty, ieee_quiet_nan)
    end if
    associate (history => state%history)
      if (history%n == 0) return
      history%error_penalty(history%n) = budget%penalty
      history%error_discretization(history%n) = budget%discretization
    end associate
  end subroutine estimate_errors

  !> Whether the iteration came near enough to its end for the other errors to be meaningful.
  pure logical function is_near(state)
    type(solver_state_t), intent(in) :: state  !! Where the scheme ended.
    is_near = size(state%pressure) == 0
    if (.not. (is_near .or. ieee_is_nan(state%error_bound))) is_near = state%error_bound < near_enough
  end function is_near

  !> The error of the mesh is not known.
  subroutine forget_mesh_error(budget)
    type(error_budget_t), intent(inout) :: budget  !! With parts of the mesh; NaN on return.
    real(dp) :: nan
    integer :: b
    nan = ieee_value(nan, ieee_quiet_nan)
    budget%discretization = nan
    budget%contact = nan
    budget%of_body = nan
    do b = 1, size(budget%of_element)
      if (allocated(budget%of_element(b)%value)) budget%of_element(b)%value = nan
    end do
  end subroutine forget_mesh_error

  !> The error of the mesh.
  subroutine estimate_mesh_error(problem, displacements, first_row, pressure, theta, kept, budget, error)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(displacements_t), intent(inout) :: displacements  !! As in `estimate_errors`.
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    type(kept_estimates_t), intent(inout) :: kept  !! What the estimates keep.
    type(error_budget_t), intent(inout) :: budget  !! Gets discretization, contact and norm.
    type(error_t), allocatable, intent(out) :: error  !! As in `estimate_errors`.
    type(displacements_t) :: block(1)
    real(dp) :: norm_square, work
    integer :: b, i, k
    if (allocated(budget%of_body)) deallocate (budget%of_body, budget%of_element)
    allocate (budget%of_body(size(problem%body)))
    if (.not. allocated(displacements%square)) then
      block(1)%pressure = pressure
      call move_alloc(displacements%body, block(1)%body)
      call estimate_mesh_errors(problem, first_row, kept, block, error)
      call move_alloc(block(1)%body, displacements%body)
      if (allocated(error)) return
      call move_alloc(block(1)%square, displacements%square)
      displacements%norm_square = block(1)%norm_square
    end if
    call move_alloc(displacements%square, budget%of_element)
    ! Without strain, what the mesh leaves of motions is rounding.
    norm_square = 0
    if (budget%norm > 0) norm_square = displacements%norm_square
    work = 0
    do k = 1, size(problem%pair)
      associate (pair => problem%pair(k), surface_a => problem%surface_a(k), surface_b => problem%surface_b(k), &
                 rows => [(i, i=first_row(k), first_row(k + 1) - 1)])
        associate (u_a => displacements%body(pair%body_a)%displacement, &
                   u_b => displacements%body(pair%body_b)%displacement)
          work = work + complementarity_error(pair, surface_a, surface_b, u_a, u_b, pressure(rows), theta(rows))
        end associate
      end associate
    end do
    budget%contact = 0
    if (norm_square > 0) budget%contact = sqrt(2*work/norm_square)
    budget%norm = sqrt(norm_square)
    budget%of_body = 0
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      if (norm_square > 0) then
        budget%of_element(b)%value = sqrt(budget%of_element(b)%value/norm_square)
      else
        budget%of_element(b)%value = 0
      end if
      budget%of_body(b) = norm2(budget%of_element(b)%value)
    end do
    call problem%ranks%share_norm(budget%of_body)
    budget%discretization = norm2(budget%of_body)
  end subroutine estimate_mesh_error
end module dotyk_control_error_budget
