!> Iterative refinement of the displacements of ill-conditioned bodies, and what it changes at the contact rows.
!>
!> The residual is computed from the elements, to the accuracy of the forces themselves
!> (`body_force`); the factor is the preconditioner of conjugate gradients, which tolerate that it
!> is inaccurate in a few modes. The energy norm of what is left of the residual is known. Rigid body and
!> near-null-space modes are not refined: they are the scheme's.
module dotyk_control_refinement
  use dotyk_base_error, only: error_slot_t, error_t, add_context, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_base_text, only: quoted, to_text
  use dotyk_base_thresholds, only: one_digit
  use dotyk_control_body_solution, only: body_solution_t, share_solution
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_elasticity_conditioning_diagnosis, only: diagnose_conditioning
  use dotyk_elasticity_internal_force, only: body_force
  use dotyk_elasticity_material, only: least_compressible
  use dotyk_elasticity_nodal_stress, only: element_stress
  use dotyk_ranks_exchange, only: share, share_errors
  use dotyk_response_response, only: response_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: energy_of, refine_bodies, refuse_lost_pressures, penetrations, collect_conditioning

  type, public :: conditioning_t  !! The conditioning of one body.
    real(dp) :: condition = 1  !! Condition number of the scaled stiffness; a lower bound where not measured [].
    !> That of the stiffness without the near-null-space modes that were split off, likewise [].
    real(dp) :: condition_left = 1
    logical :: is_measured = .false.  !! Whether both were measured.
    logical :: is_rounded = .false.  !! Whether rounding of its displacement exceeds what the tolerance allows.
    integer :: n_near_null = 0  !! Near-null-space modes that were split off.
    integer :: n_steps = 0  !! Steps of iterative refinement of its displacement, 0 where none was needed.
  contains
    procedure :: lost_digits => conditioning_lost_digits
    procedure :: needs_refinement => conditioning_needs_refinement
  end type conditioning_t


  real(dp), parameter :: refined_condition = 1.0e7_dp  !! Conditions above this are worth iterative refinement.

  integer, parameter :: most_restarts = 4, most_steps = 8  !! Restarts with a true residual, and steps between them.
  !> Residuals below this fraction of the displacement, in the energy norm, are as small as they get.
  real(dp), parameter, public :: least_residual = 1.0e-15_dp
  !> Pressures of which more than this fraction is rounding have no significant digit: a mean error is several times as
  !> large in single elements.
  real(dp), parameter :: no_pressure = 0.03_dp
  !> Bulk over shear modulus from which on pressures may lose their significant digits.
  real(dp), parameter :: nearly_incompressible = 1.0e6_dp

contains

  !> Refine the displacements of the bodies that need it.
  subroutine refine_bodies(problem, rows, compliance, pressure, alpha, conditioning, solution, left, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(in) :: rows  !! The quadratic programme, for its contact forces.
    type(body_compliance_t), intent(in) :: compliance  !! Its compliance operator.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    !> Amplitudes of the modes of all bodies, body after body (number of modes) [length].
    real(dp), intent(in) :: alpha(:)
    type(conditioning_t), intent(inout) :: conditioning(:)  !! Counts steps (n_bodies).
    type(body_solution_t), intent(inout) :: solution(:)  !! Recovered (n_bodies).
    real(dp), intent(out) :: left  !! Energy norm of what is left of the residuals [sqrt(energy)].
    !> Allocated where no significant digit of the displacement of a body is left, or a formula of a material cannot be
    !> evaluated.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: force(:, :), load(:, :)
    type(error_slot_t) :: failed(size(problem%body))
    real(dp) :: of_body(size(problem%body)), steps(size(problem%body)), norm
    integer :: b, k, first(size(problem%body) + 1)
    of_body = 0
    first = first_mode(problem%modes, problem%tie)
    do b = 1, size(problem%body)
      if (.not. conditioning(b)%needs_refinement() .or. .not. problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b), representative => problem%classes%first(b))
        load = body%load
        call rows%body_force(b, pressure, force)
        associate (node => rows%block(b)%contact_node)
          load(:, node) = load(:, node) + force
        end associate
        call refine(body, problem%report(representative), compliance%response(representative)%form, load, &
                    solution(b)%displacement, conditioning(b)%n_steps, of_body(b), norm, failed(b)%error)
        if (.not. allocated(failed(b)%error) .and. of_body(b) > one_digit*norm) &
          call refuse(body, conditioning(b)%condition, failed(b)%error)
        if (allocated(failed(b)%error)) exit
        do k = 1, problem%modes(b)%n
          solution(b)%displacement = solution(b)%displacement + alpha(first(b) + k - 1)*problem%modes(b)%shape(:, :, k)
        end do
        if (allocated(solution(b)%stress)) &
          call element_stress(body, solution(b)%displacement, solution(b)%stress, solution(b)%strain_energy)
      end associate
    end do
    call share_errors(problem%ranks%owner, failed)
    left = 0
    do b = 1, size(problem%body)
      if (allocated(failed(b)%error)) then
        call move_alloc(failed(b)%error, error)
        call add_context(error, 'body '//quoted(problem%body(b)%name)//': ')
        return
      end if
    end do
    steps = conditioning%n_steps
    call share(problem%ranks%owner, steps)
    conditioning%n_steps = nint(steps)
    call share(problem%ranks%owner, of_body)
    do b = 1, size(problem%body)
      if (conditioning(b)%needs_refinement()) left = hypot(left, of_body(b))
    end do
    call share_solution(problem, solution)
  end subroutine refine_bodies

  !> Displacements of nearly incompressible bodies may be accurate where the pressures inside, bulk modulus times the
  !> rounding of the dilatation, are not: their relative error is larger than that in the energy norm by the root of
  !> bulk over shear modulus.
  subroutine refuse_lost_pressures(body, conditioning, distance, norm, error)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(conditioning_t), intent(in) :: conditioning(:)  !! Bodies that are not refined are not refused (n_bodies).
    real(dp), intent(in) :: distance(:)  !! Rounding of each body in the energy norm (n_bodies) [sqrt(energy)].
    real(dp), intent(in) :: norm  !! Energy norm of the solution [sqrt(energy)].
    !> Allocated where no significant digit of the pressures in a body is left.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: ratio
    integer :: b, m
    do b = 1, size(body)
      if (.not. conditioning(b)%needs_refinement() .or. body(b)%analysis == analysis_plane_stress) cycle
      m = least_compressible(body(b)%material)
      ratio = body(b)%material(m)%bulk_over_shear()
      if (distance(b)*sqrt(max(1.0_dp, ratio)) <= no_pressure*norm) cycle
      if (ratio < nearly_incompressible) cycle
      call set_error(error, 'body '//quoted(body(b)%name)//': no significant digit remains in the pressures '// &
                     'of the nearly incompressible material '//quoted(body(b)%material(m)%name)//' (K/G = '// &
                     to_text(ratio, 2)//"); a Poisson's ratio of 0.499999 gives the same displacements", &
                     exit_not_solvable)
      return
    end do
  end subroutine refuse_lost_pressures

  !> The error of a body whose displacement has no significant digit.
  subroutine refuse(body, condition, error)
    type(body_t), intent(in) :: body  !! The body.
    real(dp), intent(in) :: condition  !! Condition number of its stiffness [].
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return; names a likely cause.
    character(:), allocatable :: cause
    call diagnose_conditioning(body%mesh, body%analysis, body%material, cause)
    if (len(cause) == 0) cause = 'supports that hardly resist some rigid body mode, or a very slender shape'
    call set_error(error, 'no significant digit of the displacement remains: the condition number of the '// &
                   'stiffness matrix is '//to_text(condition, 2)//'; likely cause: '//cause, exit_not_solvable)
  end subroutine refuse

  !> Penetrations of the contact rows, from the displacements.
  subroutine penetrations(rows, solution, penetration)
    type(contact_qp_t), intent(in) :: rows  !! Rows of B and gaps.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    real(dp), intent(out) :: penetration(:)  !! B u - d (n_rows) [length].
    real(dp), allocatable :: of_body(:)
    integer :: b
    penetration = -rows%gap
    do b = 1, size(solution)
      associate (block => rows%block(b))
        if (size(block%row) == 0) cycle
        allocate (of_body(size(block%row)))
        call block%matrix%multiply(reshape(solution(b)%displacement(:, block%contact_node), &
                                           [size(solution(b)%displacement, 1)*size(block%contact_node)]), of_body)
        penetration(block%row) = penetration(block%row) + of_body
        deallocate (of_body)
      end associate
    end do
  end subroutine penetrations

  !> F_theta(u) of equation (19) from the displacements; without the energy of penetrations where theta = 0 [energy].
  real(dp) function energy_of(problem, rows, solution, pressure, penetration) result(energy)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(contact_qp_t), intent(in) :: rows  !! Weights of the rows.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    real(dp), dimension(size(solution)) :: strained, work
    integer :: b
    strained = 0
    work = 0
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      strained(b) = strain_energy(problem%body(b), solution(b)%displacement)
      work(b) = sum(problem%body(b)%of_own_nodes(problem%body(b)%load)*solution(b)%displacement)
    end do
    call problem%ranks%share_sum(strained)
    call problem%ranks%share_sum(work)
    energy = sum(rows%penalty_of_rows(pressure, penetration))
    do b = 1, size(solution)
      energy = energy + strained(b) - work(b)
    end do
  end function energy_of

  !> Refine one body, without its modes.
  subroutine refine(body, report, response, load, u, steps, left, norm, error)
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(factorization_report_t), intent(in) :: report  !! Report of the representative of its class.
    class(response_t), intent(in) :: response  !! Compliance operator of its representative, the preconditioner.
    real(dp), intent(in) :: load(:, :)  !! All forces (dim, n_nodes) [force].
    real(dp), intent(inout) :: u(:, :)  !! Displacement (dim, n_nodes) [length].
    integer, intent(inout) :: steps  !! Grows.
    real(dp), intent(out) :: left  !! Energy norm of what is left of the residual [sqrt(energy)].
    real(dp), intent(out) :: norm  !! Energy norm of the displacement [sqrt(energy)].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of the material cannot be evaluated.
    real(qp), allocatable :: x(:), best(:)
    real(dp), allocatable :: r(:), z(:), d(:), q(:)
    real(dp) :: rz, before, now, curvature, energy
    integer :: restart, k
    allocate (x(body%constraint%n_equations), best(body%constraint%n_equations), r(body%constraint%n_equations))
    allocate (q, mold=r)
    r = body%rhs
    call body%constraint%reduce(load, q)
    call body%constraint%reduce(body%load, r)
    z = body%rhs + (q - r)
    call response%solve(z)
    x = z
    left = huge(left)
    norm = 0
    do restart = 1, most_restarts
      call apply_stiffness(body, report, x, .true., q, energy, error)
      if (allocated(error)) return
      call body%constraint%reduce(load, r)
      r = r - q
      z = r
      call response%solve(z)
      rz = dot_product(r, z)
      now = sqrt(max(0.0_dp, rz))
      if (.not. now < 0.5_dp*left) exit
      left = now
      norm = sqrt(energy)
      best = x
      if (left <= least_residual*norm) exit
      d = z
      do k = 1, most_steps
        call apply_stiffness(body, report, real(d, qp), .false., q, energy, error)
        if (allocated(error)) return
        curvature = dot_product(d, q)
        if (.not. curvature > 0) exit
        steps = steps + 1
        x = x + real(rz/curvature, qp)*d
        r = r - rz/curvature*q
        z = r
        call response%solve(z)
        before = rz
        rz = dot_product(r, z)
        if (.not. rz > (0.1_dp*least_residual*norm)**2) exit
        d = z + rz/before*d
      end do
    end do
    if (.not. left <= huge(left)) best = x
    call body%constraint%expand(real(best, dp), u, .true.)
  end subroutine refine

  !> The stiffness, with its springs against near-null-space modes, times a displacement.
  subroutine apply_stiffness(body, report, x, with_prescribed, product, energy, error)
    type(body_t), intent(in) :: body  !! The body.
    type(factorization_report_t), intent(in) :: report  !! Report of the representative of its class.
    real(qp), intent(in) :: x(:)  !! Displacement over the equations (n_equations) [length].
    logical, intent(in) :: with_prescribed  !! Whether given displacements are put in.
    real(dp), intent(out) :: product(:)  !! Forces over the equations (n_equations) [force].
    real(dp), intent(out) :: energy  !! Twice the strain energy [energy].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of the material cannot be evaluated.
    real(qp), allocatable :: u(:, :)
    real(dp), allocatable :: force(:, :)
    allocate (u(body%dimension, body%mesh%n_nodes()), force(body%dimension, body%mesh%n_nodes()))
    call body%constraint%expand_long(x, u, with_prescribed)
    call body_force(body, u, force, energy, error)
    if (allocated(error)) return
    call body%constraint%reduce(force, product)
    if (.not. allocated(report%near_null)) return
    associate (fixed => report%fixing_equation)
      product(fixed) = product(fixed) + report%spring*real(x(fixed), dp)
      energy = energy + sum(report%spring*real(x(fixed), dp)**2)
    end associate
  end subroutine apply_stiffness

  !> Decimal digits of 16 that are lost in a solve with the factor.
  elemental integer function conditioning_lost_digits(self) result(lost)
    class(conditioning_t), intent(in) :: self
    lost = nint(log10(max(1.0_dp, min(1.0e16_dp, self%condition_left))))
  end function conditioning_lost_digits

  !> Whether the displacement is to be refined with residuals computed from the elements.
  elemental logical function conditioning_needs_refinement(self) result(needs)
    class(conditioning_t), intent(in) :: self
    needs = self%is_rounded .or. (self%is_measured .and. self%condition_left > refined_condition)
  end function conditioning_needs_refinement

  !> From the factorizations.
  pure subroutine collect_conditioning(classes, report, conditioning)
    type(congruence_classes_t), intent(in) :: classes  !! Classes of congruent bodies.
    type(factorization_report_t), intent(in) :: report(:)  !! Reports of the representatives (n_bodies).
    type(conditioning_t), allocatable, intent(out) :: conditioning(:)  !! Conditioning of the bodies (n_bodies).
    integer :: b
    allocate (conditioning(size(report)))
    do b = 1, size(report)
      associate (of_class => report(classes%first(b)))
        conditioning(b)%condition = of_class%condition
        conditioning(b)%condition_left = of_class%condition_left
        conditioning(b)%is_measured = of_class%is_measured
        conditioning(b)%n_near_null = of_class%n_near_null
      end associate
    end do
  end subroutine collect_conditioning
end module dotyk_control_refinement
