!> Errors of the mesh in single numbers: contact forces, mean displacements of faces, reactions of supports; others are
!> known by several meshes (`dotyk_control_mesh_quantities`).
!>
!> A quantity J is a linear functional of displacements and contact forces. Its dual solution z is the response of the
!> bodies, linearized at the active set of the solution u (`dotyk_scheme_linearized_contact`): to forces that weight the
!> displacements as J does; to gaps that are shut by the weights of the contact forces; to displacements of the support
!> by the opposite of the weights of its reactions. The system of u and z is symmetric, so that all of them have the
!> error `J(u) - J(u_h) = A(u - u_h, z - z_h)` (Becker and Rannacher, Acta Numerica 10, 2001); both factors are the
!> differences of recovered and computed strains (`dotyk_elasticity_discretization_error`).
module dotyk_control_quantity_error
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, last_linear_quantity, quantity_displacement, quantity_force, &
    quantity_reaction
  use dotyk_base_thresholds, only: notable, rounding
  use dotyk_contact_pair, only: pair_force
  use dotyk_control_body_solution, only: body_solution_t, displacements_t, element_field_t
  use dotyk_control_contact_problem, only: congruent_group_t, congruent_groups, contact_problem_t, first_mode, &
    most_bodies
  use dotyk_control_error_budget, only: error_budget_t
  use dotyk_control_gap_doubt, only: gap_doubt_t, is_narrow
  use dotyk_control_kept_estimates, only: kept_estimates_t
  use dotyk_control_mesh_error, only: collect_thermal, to_representative
  use dotyk_control_parallel, only: set_blas_threads
  use dotyk_elasticity_assembly, only: subtract_dirichlet_lift
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_discretization_error, only: estimate_discretization_errors
  use dotyk_elasticity_internal_force, only: find_reactions
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_linearized_contact, only: solve_linearized
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private

  type, public :: quantity_t  !! A quantity of a scene.
    integer :: kind = quantity_force  !! One of `quantity_*`.
    character(:), allocatable :: name  !! Its name, such as `displacement:plate:top z`.
    logical :: is_goal = .false.  !! Whether meshes are made until its error is small enough.
    integer :: pair = 0  !! The contact pair; 0 where it belongs to a body.
    integer :: body = 0  !! The body; 0 where it belongs to a pair.
    !> Weights of the displacements, or reactions, of its nodes (dim, n_nodes) [].
    real(dp), allocatable :: weight(:, :)
    logical, allocatable :: node(:)  !! Nodes that it is the greatest value of (n_nodes).
  end type quantity_t

  !> Why the error of a quantity is not known.
  integer, parameter, public :: bar_is_known = 0     !< it is known
  integer, parameter, public :: bar_no_contact = 1   !< the pair has no active row: it has no force
  integer, parameter, public :: bar_zero = 2         !< it is zero, but for rounding
  integer, parameter, public :: bar_no_estimate = 3  !< the error of the mesh is not known either
  integer, parameter, public :: bar_no_factors = 4   !< bodies are solved by p-multigrid
  integer, parameter, public :: bar_soft = 5         !< supports hardly resist motions of bodies
  integer, parameter, public :: bar_singular = 6     !< the linearized contact does not determine its forces
  integer, parameter, public :: bar_one_mesh = 7     !< it has no dual solution, and no finer mesh to compare with
  integer, parameter, public :: bar_no_limit = 8     !< it grows from mesh to mesh: it is singular
  integer, parameter, public :: bar_narrow = 9       !< a contact is narrower than a facet, which estimates do not see

  type, public :: quantity_value_t  !! A quantity in a load case.
    character(:), allocatable :: name  !! Its name.
    logical :: is_goal = .false.  !! As in `quantity_t`.
    logical :: is_linear = .true.  !! Whether it is linear in displacements and contact forces.
    real(dp) :: value = 0  !! What it is [any].
    !> Error bar of the mesh; and the estimated error, which may be added to the value; NaN where they are not known
    !> [any].
    real(dp) :: error = 0, estimate = 0
    integer :: why_unknown = bar_is_known  !! One of `bar_*`.
    !> Whether a further mesh has confirmed the error bar: greatest values may have no limit.
    logical :: is_confirmed = .true.
    !> Order of its error in that of the mesh, e; its relative error is at least `least*e**least_order`.
    real(dp) :: order = 2, least = 1, least_order = 2
    real(dp), private :: rounding = 0  !! What rounding leaves of the value [any].
  end type quantity_value_t

  type, public :: quantity_errors_t  !! The quantities of a load case.
    type(quantity_value_t), allocatable :: of(:)  !! (n_quantities)
    !> What elements contribute at most to the relative errors of the quantities that meshes are made for, together; not
    !> allocated where no error is known (n_bodies) [].
    type(element_field_t), allocatable :: of_element(:)
  contains
    procedure :: greatest => errors_greatest
    procedure :: has_goal => errors_has_goal
    procedure :: are_confirmed => errors_are_confirmed
    procedure :: name_without_limit => errors_name_without_limit
  end type quantity_errors_t

  type :: dual_t  !! Dual solutions of a body, and what they begin with.
    real(dp), allocatable :: rhs(:, :)  !! Forces over the equations, without contact (n_equations, n) [any].
    real(dp), allocatable :: given(:, :, :)  !! Displacements of supports (dim, n_nodes, n) [any].
    real(dp), allocatable :: z(:, :, :)  !! Displacements (dim, n_nodes, n) [any].
  end type dual_t

  public :: find_quantity_errors

  !> Error bars over estimated errors []. Where contributions of elements cancel, bars are the sum of their sizes: true
  !> errors are 0.3 to 1.2 bars in 73 % of the meshes of seven examples, and less in all others but 5 %
  !> (`studies/error_calibration.py quantities`).
  real(dp), parameter :: safety = 2
  integer, parameter :: most_together = 10  !! Dual solutions that are computed together.

contains

  !> Greatest error bar of the quantities that meshes are made for, relative to their values; NaN where one of them is
  !> not known, but for those that are zero [].
  pure real(dp) function errors_greatest(self, is_linear) result(greatest)
    class(quantity_errors_t), intent(in) :: self
    logical, intent(in) :: is_linear  !! Of those that have a dual solution; of the others if false.
    integer :: i
    greatest = 0
    if (.not. allocated(self%of)) return
    do i = 1, size(self%of)
      associate (of => self%of(i))
        if (.not. of%is_goal .or. (of%is_linear .neqv. is_linear)) cycle
        if (any(of%why_unknown == [bar_no_contact, bar_zero])) cycle
        if (of%why_unknown /= bar_is_known) greatest = of%error
        if (ieee_is_nan(greatest)) return
        greatest = max(greatest, of%error/abs(of%value))
      end associate
    end do
  end function errors_greatest

  !> Whether meshes are made for quantities that have a value, and none of them has to wait for the next mesh.
  pure logical function errors_has_goal(self) result(has_goal)
    class(quantity_errors_t), intent(in) :: self
    has_goal = .false.
    if (allocated(self%of)) has_goal = any(self%of%is_goal .and. self%of%why_unknown == bar_is_known) .and. &
      .not. any(self%of%is_goal .and. self%of%why_unknown == bar_one_mesh)
  end function errors_has_goal

  !> Whether the error bars of the quantities that meshes are made for are confirmed.
  pure logical function errors_are_confirmed(self) result(are)
    class(quantity_errors_t), intent(in) :: self
    are = .true.
    if (allocated(self%of)) are = .not. any(self%of%is_goal .and. self%of%why_unknown == bar_is_known .and. &
                                            .not. self%of%is_confirmed)
  end function errors_are_confirmed

  !> Name of a quantity that meshes are made for and that has no limit; empty where there is none.
  pure function errors_name_without_limit(self) result(name)
    class(quantity_errors_t), intent(in) :: self
    character(:), allocatable :: name
    integer :: i
    name = ''
    if (.not. allocated(self%of)) return
    do i = 1, size(self%of)
      if (self%of(i)%is_goal .and. self%of(i)%why_unknown == bar_no_limit) name = self%of(i)%name
    end do
  end function errors_name_without_limit

  !> Values and errors of quantities. The load case acts on the bodies.
  subroutine find_quantity_errors(problem, qp, compliance, linear_solver, quantity, state, doubt, budget, kept, &
                                  displacements, errors, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, pairs and ties.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(body_compliance_t), intent(inout) :: compliance  !! Its compliance; entries that are formed stay there.
    integer, intent(in) :: linear_solver  !! One of `linear_solver_*` of dotyk_base_options.
    type(quantity_t), intent(in) :: quantity(:)  !! The quantities, those that are linear first (n).
    type(solver_state_t), intent(in) :: state  !! The solution.
    type(gap_doubt_t), intent(in) :: doubt(:)  !! What hangs on uncertain gaps (n_pairs).
    type(error_budget_t), intent(in) :: budget  !! Its errors.
    type(kept_estimates_t), intent(inout) :: kept  !! What estimates keep.
    type(displacements_t), intent(inout) :: displacements  !! Known; gets recovered strains for nodal stresses.
    type(quantity_errors_t), intent(out) :: errors  !! What the quantities are.
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    type(dual_t), allocatable :: dual(:)
    integer :: b, first, i, last, n, why
    allocate (errors%of(size(quantity)))
    if (size(quantity) == 0) return
    do i = 1, size(quantity)
      call find_value(problem, qp, quantity(i), state, displacements%body, errors%of(i), error)
      if (allocated(error)) return
    end do
    n = count(errors%of%is_linear)
    if (n == 0) return
    why = why_unknown(qp, compliance, budget, doubt)
    if (why /= bar_is_known) then
      do i = 1, n
        if (errors%of(i)%why_unknown == bar_is_known) call forget(why, errors%of(i))
      end do
      return
    end if
    allocate (errors%of_element(size(problem%body)))
    do b = 1, size(problem%body)
      allocate (errors%of_element(b)%value(problem%body(b)%mesh%n_elements()), source=0.0_dp)
    end do
    do first = 1, n, most_together
      last = min(first + most_together - 1, n)
      call solve_dual(problem, qp, compliance, linear_solver, quantity(first:last), state, dual, error)
      if (allocated(error)) then
        deallocate (error)
        do i = first, last
          if (errors%of(i)%why_unknown == bar_is_known) call forget(bar_singular, errors%of(i))
        end do
        cycle
      end if
      call multiply_errors(problem, dual, budget, kept, displacements, errors%of(first:last), errors%of_element, error)
      if (allocated(error)) return
    end do
  end subroutine find_quantity_errors

  !> Why no error is known; `bar_is_known` otherwise.
  pure integer function why_unknown(qp, compliance, budget, doubt) result(why)
    type(contact_qp_t), intent(in) :: qp  !! As in `find_quantity_errors`.
    type(body_compliance_t), intent(in) :: compliance  !! As in `find_quantity_errors`.
    type(error_budget_t), intent(in) :: budget  !! As in `find_quantity_errors`.
    type(gap_doubt_t), intent(in) :: doubt(:)  !! As in `find_quantity_errors` (n_pairs).
    why = bar_is_known
    if (any(is_narrow(doubt) .and. doubt%force > notable*maxval(doubt%force))) why = bar_narrow
    if (allocated(qp%coarse%lift)) why = bar_soft
    if (compliance%solve_error() > 0 .or. compliance%solves_together()) why = bar_no_factors
    if (.not. allocated(budget%of_element) .or. ieee_is_nan(budget%discretization)) why = bar_no_estimate
  end function why_unknown

  !> The error of a quantity is not known.
  subroutine forget(why, of)
    integer, intent(in) :: why  !! One of `bar_*`.
    type(quantity_value_t), intent(inout) :: of  !! The quantity.
    of%why_unknown = why
    of%error = ieee_value(of%error, ieee_quiet_nan)
    of%estimate = of%error
  end subroutine forget

  !> Value of a quantity.
  subroutine find_value(problem, qp, quantity, state, solution, of, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(quantity_t), intent(in) :: quantity  !! The quantity.
    type(solver_state_t), intent(in) :: state  !! The solution.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements (n_bodies).
    type(quantity_value_t), intent(inout) :: of  !! Gets name and value.
    type(error_t), allocatable, intent(out) :: error  !! As in `find_reactions`.
    real(dp), allocatable :: contact(:, :), reaction(:, :)
    real(dp) :: terms
    of%name = quantity%name
    of%is_goal = quantity%is_goal
    of%is_linear = quantity%kind <= last_linear_quantity
    terms = 0
    select case (quantity%kind)
    case (quantity_force)
      associate (first => qp%pair_first_row(quantity%pair), last => qp%pair_first_row(quantity%pair + 1) - 1)
        of%value = norm2(resultant_of(problem, quantity%pair, state%pressure(first:last)))
        terms = sum(qp%weight(first:last)*abs(state%pressure(first:last)))
        if (.not. any(state%pressure(first:last) > 0)) call forget(bar_no_contact, of)
      end associate
    case (quantity_displacement)
      of%value = sum(quantity%weight*solution(quantity%body)%displacement)
      terms = sum(abs(quantity%weight*solution(quantity%body)%displacement))
    case (quantity_reaction)
      associate (b => quantity%body)
        call qp%body_force(b, state%pressure, contact)
        call find_reactions(problem%body(b), solution(b)%displacement, qp%block(b)%contact_node, contact, reaction, &
                            error)
        if (allocated(error)) return
        of%value = sum(quantity%weight*reaction)
        terms = sum(abs(reaction))
      end associate
    case default
      call forget(bar_one_mesh, of)
    end select
    of%rounding = rounding*terms
    if (of%why_unknown == bar_is_known .and. .not. abs(of%value) > of%rounding) call forget(bar_zero, of)
  end subroutine find_value

  !> Contact force on the slave body; along the axis in axisymmetric analyses (3) [force].
  pure function resultant_of(problem, k, pressure) result(force)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    integer, intent(in) :: k  !! The pair.
    real(dp), intent(in) :: pressure(:)  !! Its pressures (n_rows) [pressure].
    real(dp) :: force(3)
    force = pair_force(problem%pair(k), pressure)
    if (problem%body(problem%pair(k)%body_a)%analysis == analysis_axisymmetric) force(1) = 0
  end function resultant_of

  !> Dual solutions.
  subroutine solve_dual(problem, qp, compliance, linear_solver, quantity, state, dual, error)
    type(contact_problem_t), intent(in) :: problem  !! As in `find_quantity_errors`.
    type(contact_qp_t), intent(in) :: qp  !! As in `find_quantity_errors`.
    type(body_compliance_t), intent(inout) :: compliance  !! As in `find_quantity_errors`.
    integer, intent(in) :: linear_solver  !! As in `find_quantity_errors`.
    type(quantity_t), intent(in) :: quantity(:)  !! The quantities (n).
    type(solver_state_t), intent(in) :: state  !! The solution.
    type(dual_t), allocatable, intent(out) :: dual(:)  !! (n_bodies)
    type(error_t), allocatable, intent(out) :: error  !! As in `solve_linearized`.
    real(dp) :: y(qp%n_rows, size(quantity)), force(qp%n_rows, size(quantity))
    real(dp), dimension(qp%coarse%n, size(quantity)) :: resultant, alpha
    integer :: b, j, n, first(size(problem%body) + 1)
    n = size(quantity)
    y = 0
    resultant = 0
    allocate (dual(size(problem%body)))
    first = first_mode(problem%modes, problem%tie)
    call set_blas_threads(problem%n_blas)
    do j = 1, n
      if (quantity(j)%kind == quantity_force) &
        call shut_gaps(problem, quantity(j)%pair, qp%pair_first_row, state%pressure, y(:, j))
    end do
    do b = 1, size(problem%body)
      associate (body => problem%body(b))
        allocate (dual(b)%rhs(body%constraint%n_equations, n), source=0.0_dp)
        allocate (dual(b)%z(body%dimension, body%mesh%n_nodes(), n), source=0.0_dp)
        if (.not. any(quantity%body == b)) cycle
        allocate (dual(b)%given, source=dual(b)%z)
        call act(problem, qp, compliance, b, first(b), quantity, dual(b), y, resultant, error)
        if (allocated(error)) return
      end associate
    end do
    call solve_linearized(qp, compliance, linear_solver, state%pressure > 0 .or. qp%is_tied, y, resultant, force, &
                          alpha, error)
    if (.not. allocated(error)) then
      do j = 1, n
        force(:, j) = force(:, j)/qp%weight
        alpha(:, j) = qp%coarse%scale*alpha(:, j)
      end do
      !$omp parallel do default(none) schedule(dynamic, 1) if (compliance%side_by_side) &
      !$omp& shared(problem, qp, compliance, force, alpha, first, dual)
      do b = 1, size(problem%body)
        call recover(problem, qp, compliance, b, force, alpha(first(b):first(b) + problem%modes(b)%n - 1, :), dual(b))
      end do
      !$omp end parallel do
    end if
    call set_blas_threads(1)
  end subroutine solve_dual

  !> Gaps of a pair that are shut as its rows contribute to the force.
  subroutine shut_gaps(problem, k, first_row, pressure, y)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    integer, intent(in) :: k  !! The pair.
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(inout) :: y(:)  !! Penetrations without contact (n_rows) [].
    real(dp) :: force(3)
    associate (pair => problem%pair(k), first => first_row(k), last => first_row(k + 1) - 1)
      force = resultant_of(problem, k, pressure(first:last))
      if (.not. norm2(force) > 0) return
      call pair%average%multiply(matmul(force(:pair%dimension)/norm2(force), pair%normal), y(first:last))
    end associate
  end subroutine shut_gaps

  !> Forces and prescribed displacements of the quantities of a body, and what they do without contact.
  subroutine act(problem, qp, compliance, b, first, quantity, dual, y, resultant, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and modes.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(body_compliance_t), intent(in) :: compliance  !! The compliance.
    integer, intent(in) :: b  !! The body.
    integer, intent(in) :: first  !! Its first mode.
    type(quantity_t), intent(in) :: quantity(:)  !! Quantities of all bodies (n).
    type(dual_t), intent(inout) :: dual  !! Of the body; gets forces and prescribed displacements.
    real(dp), intent(inout) :: y(:, :)  !! Penetrations of the rows, added to (n_rows, n) [].
    real(dp), intent(inout) :: resultant(:, :)  !! Resultants on the modes; those of the body are set (coarse%n, n).
    type(error_t), allocatable, intent(out) :: error  !! As in `subtract_dirichlet_lift`.
    type(constraint_t) :: moved
    real(dp), allocatable :: x(:, :), u(:, :), of_rows(:)
    integer :: j, k
    associate (body => problem%body(b), block => qp%block(b), modes => problem%modes(b))
      do j = 1, size(quantity)
        if (quantity(j)%body /= b) cycle
        if (quantity(j)%kind == quantity_displacement) then
          call body%constraint%reduce(quantity(j)%weight, dual%rhs(:, j))
          do k = 1, modes%n
            resultant(first + k - 1, j) = qp%coarse%scale(first + k - 1)*sum(modes%shape(:, :, k)*quantity(j)%weight)
          end do
        else
          moved = body%constraint
          call prescribe(quantity(j)%weight, moved)
          call subtract_dirichlet_lift(body%mesh, body%analysis, body%material, moved, dual%rhs(:, j), error)
          if (allocated(error)) return
          call moved%expand(0*dual%rhs(:, j), dual%given(:, :, j), .true.)
        end if
      end do
      if (size(block%row) == 0) return
      x = dual%rhs
      if (size(x) > 0) call compliance%solve_block(b, x)
      allocate (u(body%dimension, body%mesh%n_nodes()), of_rows(size(block%row)))
      do j = 1, size(quantity)
        if (quantity(j)%body /= b) cycle
        call body%constraint%expand(x(:, j), u, .false.)
        u = u + dual%given(:, :, j)
        call block%matrix%multiply(reshape(u(:, block%contact_node), [body%dimension*size(block%contact_node)]), &
                                   of_rows)
        y(block%row, j) = y(block%row, j) + of_rows
      end do
    end associate
  end subroutine act

  !> Move supports by the opposite of the weights of their reactions.
  pure subroutine prescribe(weight, constraint)
    real(dp), intent(in) :: weight(:, :)  !! Weights in global axes (dim, n_nodes) [].
    type(constraint_t), intent(inout) :: constraint  !! Its prescribed displacements are set.
    real(dp) :: local(size(weight, 1))
    integer :: i
    do i = 1, size(weight, 2)
      local = weight(:, i)
      if (constraint%frame_of(i) > 0) local = matmul(local, constraint%frame(:, :, constraint%frame_of(i)))
      constraint%prescribed(:, i) = merge(-local, 0.0_dp, constraint%equation(:, i) == held)
    end do
  end subroutine prescribe

  !> Dual solutions of a body.
  subroutine recover(problem, qp, compliance, b, pressure, alpha, dual)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and modes.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(body_compliance_t), intent(in) :: compliance  !! The compliance.
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: pressure(:, :)  !! Contact pressures (n_rows, n).
    real(dp), intent(in) :: alpha(:, :)  !! Amplitudes of the modes of the body (n_modes, n).
    type(dual_t), intent(inout) :: dual  !! Gets the solutions.
    real(dp), allocatable :: of_contact(:, :), nodal(:, :), x(:)
    integer :: j, k
    associate (body => problem%body(b), node => qp%block(b)%contact_node)
      allocate (nodal(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
      allocate (x(body%constraint%n_equations))
      do j = 1, size(dual%rhs, 2)
        call qp%body_force(b, pressure(:, j), of_contact)
        nodal(:, node) = of_contact
        call body%constraint%reduce(nodal, x)
        dual%rhs(:, j) = dual%rhs(:, j) + x
      end do
      if (any(abs(dual%rhs) > 0)) call compliance%solve_block(b, dual%rhs)
      do j = 1, size(dual%rhs, 2)
        call body%constraint%expand(dual%rhs(:, j), dual%z(:, :, j), .false.)
        if (allocated(dual%given)) dual%z(:, :, j) = dual%z(:, :, j) + dual%given(:, :, j)
        do k = 1, size(alpha, 1)
          dual%z(:, :, j) = dual%z(:, :, j) + alpha(k, j)*problem%modes(b)%shape(:, :, k)
        end do
      end do
    end associate
  end subroutine recover

  !> Errors of the quantities from those of solution and dual solutions.
  subroutine multiply_errors(problem, dual, budget, kept, displacements, of, of_element, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and classes.
    type(dual_t), intent(inout) :: dual(:)  !! Dual solutions (n_bodies).
    type(error_budget_t), intent(in) :: budget  !! Errors of the solution.
    type(kept_estimates_t), intent(inout) :: kept  !! What estimates keep.
    type(displacements_t), intent(inout) :: displacements  !! The solution; gets recovered strains.
    type(quantity_value_t), intent(inout) :: of(:)  !! Get their errors (n).
    type(element_field_t), intent(inout) :: of_element(:)  !! What elements contribute, added to (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! As in `estimate_discretization_errors`.
    type(congruent_group_t), allocatable :: group(:)
    real(dp), dimension(size(of)) :: estimate, size_of
    integer :: first, g, last, i
    estimate = 0
    size_of = 0
    call kept%init(size(problem%body))
    call congruent_groups(problem, group)
    if (.not. allocated(displacements%recovered)) allocate (displacements%recovered(size(group)))
    do g = 1, size(group)
      associate (some => group(g)%body, of_class => kept%of_class(group(g)%representative))
        call of_class%init(problem%body(group(g)%representative))
        do first = 1, size(of), max(1, most_bodies/size(some) - 1)
          last = min(first + max(1, most_bodies/size(some) - 1) - 1, size(of))
          call multiply_group(first, last)
          if (allocated(error)) return
        end do
      end associate
    end do
    do i = 1, size(of)
      if (of(i)%why_unknown /= bar_is_known) cycle
      of(i)%estimate = estimate(i)
      of(i)%error = max(safety*abs(estimate(i)), size_of(i), of(i)%rounding)
    end do

  contains

    !> Some quantities on congruent bodies: the solution of all bodies first, then the dual ones, body after body.
    subroutine multiply_group(first, last)
      integer, intent(in) :: first, last  !! The quantities.
      type(body_solution_t) :: of_dual(size(problem%body))
      real(dp), allocatable :: part(:, :, :), u(:, :, :), thermal(:, :, :), expanded(:, :, :)
      real(dp), allocatable :: square(:, :), norm(:), product(:, :), eta(:)
      integer, allocatable :: partner(:)
      integer :: b, i, j, k, m, n
      associate (some => group(g)%body, body => problem%body(group(g)%representative), &
                 recovery => kept%of_class(group(g)%representative)%recovery)
        n = size(some)
        m = n*(last - first + 2)
        allocate (u(m, body%dimension, body%mesh%n_nodes()), square(m, body%mesh%n_elements()), norm(m))
        allocate (product, mold=square)
        call to_representative(problem, some, displacements%body, part)
        u(:n, :, :) = part
        do j = first, last
          do i = 1, n
            of_dual(some(i))%displacement = dual(some(i))%z(:, :, j)
          end do
          call to_representative(problem, some, of_dual, part)
          u((j - first + 1)*n + 1:(j - first + 2)*n, :, :) = part
        end do
        partner = [[(0, i=1, n)], [([(i, i=1, n)], j=first, last)]]
        call collect_thermal(problem, some, thermal)
        if (allocated(thermal)) then
          allocate (expanded(m, size(thermal, 2), size(thermal, 3)), source=0.0_dp)
          expanded(:n, :, :) = thermal
        end if
        call estimate_discretization_errors(body%mesh, body%analysis, body%material, u, recovery, square, norm, error, &
                                            expanded, partner, product)
        if (allocated(error)) return
        ! Nodal stresses take them.
        if (.not. allocated(displacements%recovered(g)%of_material)) then
          allocate (displacements%recovered(g)%of_material(size(recovery)))
          do k = 1, size(recovery)
            if (allocated(recovery(k)%u)) call recovery(k)%give(1, n, displacements%recovered(g)%of_material(k))
          end do
        end if
        do i = 1, n
          b = some(i)
          eta = budget%norm*budget%of_element(b)%value
          do j = first, last
            associate (row => (j - first + 1)*n + i)
              ! Where residuals of the elements have told that recovered strains say too much, those of the dual
              ! solution do, too.
              product(row, :) = product(row, :)*min(1.0_dp, eta**2/max(tiny(eta), square(i, :)))
              estimate(j) = estimate(j) + sum(product(row, :))
              size_of(j) = size_of(j) + sum(abs(product(row, :)))
              if (of(j)%is_goal .and. of(j)%why_unknown == bar_is_known) &
                of_element(b)%value = of_element(b)%value + eta*sqrt(square(row, :))/abs(of(j)%value)
            end associate
          end do
        end do
      end associate
    end subroutine multiply_group
  end subroutine multiply_errors
end module dotyk_control_quantity_error
