!> Refinement of the displacements of bodies whose factors lose digits, and what it changes at the contact points.
!>
!> The residual comes from the elements, which know the forces of a displacement to their own size (`dotyk_elasticity_internal_force`); the factor
!> is the preconditioner of conjugate gradients, which forgive that it is wrong in a few shapes. What is left of the residual is a
!> displacement whose energy norm is known. Soft and free motions are not refined: they are the scheme's.
module dotyk_driver_refinement
  use dotyk_base_error, only: error_t, add_context, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_base_text, only: quoted, to_text
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_digits, only: body_digits_t
  use dotyk_driver_body_solution, only: body_solution_t
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_elasticity_internal_force, only: internal_force
  use dotyk_elasticity_conditioning_diagnosis, only: diagnose_conditioning
  use dotyk_elasticity_stress, only: element_stress
  use dotyk_response_definite, only: digits_t
  use dotyk_response_full, only: full_response_t
  use dotyk_response_response, only: response_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: energy_of, refine_bodies, refuse_lost_pressures, penetrations

  !> Restarts with a true residual, and steps between them.
  integer, parameter :: most_restarts = 4, most_steps = 8
  !> Residuals below this part of the displacement, in the energy norm, are as small as they get.
  real(dp), parameter :: enough = 1.0e-15_dp
  !> More than this part of an answer that is rounding leaves no digit of it.
  real(dp), parameter :: no_digit = 0.1_dp
  !> The same of pressures: what is so much in the mean is several times as much in single elements.
  real(dp), parameter :: no_pressure = 0.03_dp
  !> Bulk over shear modulus that may cost pressures their digits.
  real(dp), parameter :: nearly_incompressible = 1.0e6_dp

contains

  !> Refine the displacements of the bodies that need it.
  subroutine refine_bodies(body, classes, problem, m, alpha, digits, solution, left, error)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(contact_problem_t), intent(inout) :: problem
    !> State of the scheme (n_rows) [pressure], amplitudes of the motions of all bodies [length].
    real(dp), intent(in) :: m(:), alpha(:)
    !> Counts steps (n_bodies).
    type(body_digits_t), intent(inout) :: digits(:)
    !> Recovered (n_bodies).
    type(body_solution_t), intent(inout) :: solution(:)
    !> Energy norm of what is left of the residuals [sqrt(energy)].
    real(dp), intent(out) :: left
    !> A body of which no digit is left.
    type(error_t), allocatable, intent(out) :: error
    type(digits_t) :: factor
    real(dp), allocatable :: force(:, :), load(:, :)
    real(dp) :: of_body, norm
    integer :: b, k, first
    left = 0
    first = 1
    do b = 1, size(body)
      if (digits(b)%needs_refinement()) then
        select type (owner => problem%response(classes%first(b))%form)
        type is (full_response_t)
          factor = owner%digits
        end select
        load = body(b)%load
        call problem%body_force(b, m, force)
        associate (node => problem%operator%block(b)%contact_node)
          load(:, node) = load(:, node) + force
        end associate
        call refine(body(b), factor, problem%response(b)%form, load, solution(b)%displacement, digits(b)%steps, of_body, norm, &
                    error)
        if (.not. allocated(error) .and. of_body > no_digit*norm) call refuse(body(b), digits(b)%condition, error)
        call add_context(error, 'body '//quoted(body(b)%name)//': ')
        if (allocated(error)) return
        left = hypot(left, of_body)
        do k = 1, body(b)%modes%n
          solution(b)%displacement = solution(b)%displacement + alpha(first + k - 1)*body(b)%rigid_mode(:, :, k)
        end do
        if (allocated(solution(b)%stress)) call element_stress(body(b), solution(b)%displacement, solution(b)%stress)
      end if
      first = first + body(b)%modes%n
    end do
  end subroutine refine_bodies

  !> Displacements of nearly incompressible bodies may be right where the pressures inside, the bulk modulus times what their last digits
  !> say, are not: that is worse by the root of bulk over shear modulus than the energy norm tells.
  subroutine refuse_lost_pressures(body, digits, distance, norm, error)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(body_digits_t), intent(in) :: digits(:)
    !> What rounding leaves (n_bodies), and the answer, in the energy norm [sqrt(energy)].
    real(dp), intent(in) :: distance(:), norm
    !> A body of whose pressures no digit is left.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: ratio
    integer :: b
    do b = 1, size(body)
      if (.not. digits(b)%needs_refinement() .or. body(b)%analysis == analysis_plane_stress) cycle
      ratio = body(b)%material%bulk_over_shear()
      if (distance(b)*sqrt(max(1.0_dp, ratio)) <= no_pressure*norm) cycle
      if (ratio < nearly_incompressible) cycle
      call set_error(error, 'body '//quoted(body(b)%name)//': rounding leaves no digit of the pressures in material '// &
                     quoted(body(b)%material%name)//', which is nearly incompressible: its bulk modulus is '//to_text(ratio, 2)// &
                     " times the shear modulus; a Poisson's ratio of 0.499999 gives the same displacements", exit_not_solvable)
      return
    end do
  end subroutine refuse_lost_pressures

  !> The error of a body without digits.
  subroutine refuse(body, condition, error)
    type(body_t), intent(in) :: body
    real(dp), intent(in) :: condition
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: cause
    call diagnose_conditioning(body%mesh, body%analysis, body%material, cause)
    if (len(cause) == 0) cause = 'supports that hardly resist some of its motions, or a very slender shape'
    call set_error(error, 'no digit of its displacement is left, the condition of its stiffness is '//to_text(condition, 2)// &
                   '; the likely cause: '//cause, exit_not_solvable)
  end subroutine refuse

  !> Penetrations of the contact points, from the displacements.
  subroutine penetrations(problem, solution, y)
    type(contact_problem_t), intent(in) :: problem
    !> (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(out) :: y(:)
    real(dp), allocatable :: of_body(:)
    integer :: b
    y = -problem%operator%gap
    do b = 1, size(solution)
      associate (block => problem%operator%block(b))
        if (size(block%row) == 0) cycle
        allocate (of_body(size(block%row)))
        call block%matrix%multiply(reshape(solution(b)%displacement(:, block%contact_node), &
                                           [size(solution(b)%displacement, 1)*size(block%contact_node)]), of_body)
        y(block%row) = y(block%row) + of_body
        deallocate (of_body)
      end associate
    end do
  end subroutine penetrations

  !> F_theta(u) of (19) from the displacements; without penetrations where theta = 0 [energy].
  real(dp) function energy_of(body, problem, solution, y) result(energy)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(contact_problem_t), intent(in) :: problem
    type(body_solution_t), intent(in) :: solution(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    integer :: b
    energy = 0.5_dp*sum(problem%operator%weight*max(0.0_dp, y)**2/problem%operator%theta, mask=problem%operator%theta > 0)
    do b = 1, size(body)
      energy = energy + strain_energy(body(b), solution(b)%displacement) - sum(body(b)%load*solution(b)%displacement)
    end do
  end function energy_of

  !> Refine one body, without its motions.
  subroutine refine(body, factor, response, load, u, steps, left, norm, error)
    type(body_t), intent(in) :: body
    !> Of the first body of the kind.
    type(digits_t), intent(in) :: factor
    class(response_t), intent(inout) :: response
    !> All forces (dim, n_nodes) [force].
    real(dp), intent(in) :: load(:, :)
    !> Displacement (dim, n_nodes) [length].
    real(dp), intent(inout) :: u(:, :)
    !> Grows.
    integer, intent(inout) :: steps
    !> Energy norms of what is left of the residual, and of the displacement [sqrt(energy)].
    real(dp), intent(out) :: left, norm
    type(error_t), allocatable, intent(out) :: error
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
      call apply_stiffness(body, factor, x, .true., q, energy, error)
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
      if (left <= enough*norm) exit
      d = z
      do k = 1, most_steps
        call apply_stiffness(body, factor, real(d, qp), .false., q, energy, error)
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
        if (.not. rz > (0.1_dp*enough*norm)**2) exit
        d = z + rz/before*d
      end do
    end do
    if (.not. left <= huge(left)) best = x
    call body%constraint%expand(real(best, dp), u, .true.)
  end subroutine refine

  !> The stiffness, with its springs against soft motions, times a displacement.
  subroutine apply_stiffness(body, factor, x, with_prescribed, product, energy, error)
    type(body_t), intent(in) :: body
    type(digits_t), intent(in) :: factor
    !> (n_equations).
    real(qp), intent(in) :: x(:)
    !> Whether given displacements are put in.
    logical, intent(in) :: with_prescribed
    !> (n_equations) [force].
    real(dp), intent(out) :: product(:)
    !> [force length].
    real(dp), intent(out) :: energy
    type(error_t), allocatable, intent(out) :: error
    real(qp), allocatable :: u(:, :)
    real(dp), allocatable :: force(:, :)
    allocate (u(body%dimension, body%mesh%n_nodes()), force(body%dimension, body%mesh%n_nodes()))
    call body%constraint%expand_long(x, u, with_prescribed)
    call internal_force(body%mesh, body%analysis, body%material, u, force, energy, error)
    if (allocated(error)) return
    call body%constraint%reduce(force, product)
    if (.not. allocated(factor%motion)) return
    product(factor%hold) = product(factor%hold) + factor%spring*real(x(factor%hold), dp)
    energy = energy + sum(factor%spring*real(x(factor%hold), dp)**2)
  end subroutine apply_stiffness
end module dotyk_driver_refinement
