!> The rounding error of the displacements, measured by the forces that they leave unbalanced.
!>
!> A displacement u that leaves the forces r is the exact solution for loads changed by r: its distance to the exact
!> solution for the same contact forces is `sqrt(r^T K^{-1} r)` in the energy norm, and solutions with contact are no
!> farther from each other than that. r includes everything: inaccurate factors, digits that doubles do not have,
!> rounded pressures. It is computed from the elements (`body_force`), K^{-1} is the compliance
!> operator of the body.
module dotyk_control_rounding
  use dotyk_base_error, only: error_slot_t, error_t, add_context
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_thresholds, only: notable
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_parallel, only: largest_first, set_blas_threads
  use dotyk_control_refinement, only: conditioning_t, penetrations
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_elasticity_internal_force, only: body_force
  use dotyk_ranks_exchange, only: share_errors
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: expect_rounding, measure_rounding, flag_rounded, relative_rounding, gap_rounding, storage_rounding, &
    is_negative

  !> Bodies with more rounding than this fraction of the tolerance are refined.
  real(dp), parameter, public :: worth_refining = 0.2_dp
  !> Where more than this fraction of it is expected, rounding is measured.
  real(dp), parameter, public :: worth_measuring = 1.0e-3_dp
  !> Safety factor of the expected rounding: least eigenvalues are smaller than displacements tell, and may be the
  !> square of the pivots.
  real(dp), parameter :: margin = 10

contains

  !> An upper limit of rounding, of each body: u is wrong by no more than epsilon of `sqrt(u^T D u)`, D the diagonal of
  !> the stiffness, over the root of the least eigenvalue with respect to D; u itself bounds that eigenvalue from above.
  subroutine expect_rounding(problem, solution, norm, distance)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(body_solution_t), intent(in) :: solution(:)  !! Recovered (n_bodies).
    real(dp), intent(in) :: norm  !! Energy norm of the solution [sqrt(energy)].
    real(dp), intent(out) :: distance(:)  !! In the energy norm (n_bodies) [sqrt(energy)].
    real(dp), allocatable :: x(:)
    real(dp) :: size_of_u(size(solution))
    integer :: b
    size_of_u = 0
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (body => problem%body(b), report => problem%report(problem%classes%first(b)))
        if (body%constraint%n_equations == 0) cycle
        allocate (x(body%constraint%n_equations))
        call body%constraint%reduce(solution(b)%displacement, x)
        size_of_u(b) = norm2(body%of_own_equations(sqrt(report%diagonal)*x))
        deallocate (x)
      end associate
    end do
    call problem%ranks%share_norm(size_of_u)
    do b = 1, size(solution)
      associate (report => problem%report(problem%classes%first(b)))
        distance(b) = margin*epsilon(norm)*size_of_u(b)* &
          max(report%condition_left, size_of_u(b)/max(tiny(norm), norm, epsilon(norm)**2*size_of_u(b)))
      end associate
    end do
  end subroutine expect_rounding

  !> The rounding error of each body.
  subroutine measure_rounding(problem, rows, compliance, pressure, solution, distance, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(in) :: rows  !! The quadratic programme, for its contact forces.
    type(body_compliance_t), intent(in) :: compliance  !! Its compliance operator.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    type(body_solution_t), intent(in) :: solution(:)  !! Recovered (n_bodies).
    real(dp), intent(out) :: distance(:)  !! In the energy norm (n_bodies) [sqrt(energy)].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of a material cannot be evaluated.
    type(error_slot_t) :: failed(size(solution))
    integer :: order(size(solution)), i, b
    distance = 0
    order = largest_first(real(problem%body%n_unknowns(), dp))
    call set_blas_threads(problem%n_blas)
    !$omp parallel do default(none) private(b) schedule(dynamic, 1) &
    !$omp& shared(problem, rows, compliance, pressure, solution, distance, order, failed) if (compliance%side_by_side)
    do i = 1, size(solution)
      b = order(i)
      if (.not. problem%ranks%is_own(b)) cycle
      call measure_body(problem%body(b), rows, compliance, b, pressure, solution(b)%displacement, distance(b), &
                        failed(b)%error)
    end do
    !$omp end parallel do
    call set_blas_threads(1)
    call share_errors(problem%ranks%owner, failed)
    do b = 1, size(solution)
      if (allocated(failed(b)%error) .and. .not. allocated(error)) call move_alloc(failed(b)%error, error)
    end do
    call problem%ranks%share_sum(distance)
    distance = sqrt(max(0.0_dp, distance))
  end subroutine measure_rounding

  !> One body.
  subroutine measure_body(body, rows, compliance, b, pressure, u, square, error)
    type(body_t), intent(in) :: body  !! The body.
    type(contact_qp_t), intent(in) :: rows  !! The quadratic programme, for its contact forces.
    type(body_compliance_t), intent(in) :: compliance  !! Its compliance operator.
    integer, intent(in) :: b  !! Index of the body.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: u(:, :)  !! Displacement (dim, n_nodes) [length].
    real(dp), intent(out) :: square  !! Square of the rounding in the energy norm, the part of this rank [energy].
    type(error_t), allocatable, intent(out) :: error  !! As in `measure_rounding`.
    real(dp), allocatable :: force(:, :), contact(:, :), r(:), z(:)
    real(dp) :: energy
    square = 0
    if (body%n_unknowns() == 0) return
    allocate (force, mold=u)
    call body_force(body, real(u, qp), force, energy, error)
    if (allocated(error)) then
      call add_context(error, "body '"//body%name//"': ")
      return
    end if
    force = body%load - force
    call rows%body_force(b, pressure, contact)
    associate (node => rows%block(b)%contact_node)
      force(:, node) = force(:, node) + contact
    end associate
    allocate (r(body%constraint%n_equations))
    call body%constraint%reduce(force, r)
    if (allocated(compliance%body(b)%found) .and. any(rows%is_tied(rows%block(b)%row))) &
      call subtract_known(body, rows, compliance, b, pressure, u, r)
    z = r
    call compliance%solve(b, z)
    square = dot_product(body%of_own_equations(r), z)
  end subroutine measure_body

  !> Subtract the forces that a body leaves by its assembled stiffness. The bound of a scheme that finds displacements
  !> has them, in a norm that knows the ties: rounded forces of ties bend a soft body, but not one that is tied.
  subroutine subtract_known(body, rows, compliance, b, pressure, u, r)
    type(body_t), intent(in) :: body  !! The body.
    type(contact_qp_t), intent(in) :: rows  !! As in `measure_body`.
    type(body_compliance_t), intent(in) :: compliance  !! As in `measure_body`.
    integer, intent(in) :: b  !! Index of the body.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: u(:, :)  !! Displacement (dim, n_nodes) [length].
    !> Forces that u leaves by the elements in, the difference out (n_equations) [force].
    real(dp), intent(inout) :: r(:)
    real(dp), allocatable :: force(:, :), contact(:, :), left(:), x(:)
    allocate (force(size(u, 1), size(u, 2)), source=0.0_dp)
    call rows%body_force(b, pressure, contact)
    force(:, rows%block(b)%contact_node) = contact
    allocate (left, x, mold=r)
    call body%constraint%reduce(force, left)
    left = left + body%rhs
    call body%constraint%reduce(u, x)
    call compliance%response(compliance%body(b)%representative)%form%subtract_forces(x, left)
    r = r - left
  end subroutine subtract_known

  !> Energy of a displacement that closes the difference of the gaps by displacements and by the scheme, where there is
  !> pressure: the nodes at each row move alone, against their nodal stiffness.
  real(dp) function gap_rounding(rows, compliance, solution, pressure, penetration) result(distance)
    type(contact_qp_t), intent(in) :: rows  !! Rows of B, weights and gaps.
    type(body_compliance_t), intent(in) :: compliance  !! For the stiffness of the nodes.
    type(body_solution_t), intent(in) :: solution(:)  !! Recovered (n_bodies).
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d of the scheme (n_rows) [length].
    real(dp), allocatable :: difference(:), yields(:)
    allocate (difference(size(penetration)), yields(size(penetration)))
    call penetrations(rows, solution, difference)
    difference = difference - penetration
    call compliance%nodal_diagonal(rows, yields)
    yields = yields + rows%theta/rows%weight
    distance = sqrt(sum(difference**2/max(tiny(distance), yields), mask=(pressure > 0 .or. rows%is_tied) .and. &
                        yields > 0))
  end function gap_rounding

  !> The energy norm of half a unit in the last place of the displacements, of each body: no result stored in double
  !> precision is more accurate.
  subroutine storage_rounding(problem, solution, distance)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(body_solution_t), intent(in) :: solution(:)  !! Recovered (n_bodies).
    real(dp), intent(out) :: distance(:)  !! In the energy norm (n_bodies) [sqrt(energy)].
    real(dp), allocatable :: unit(:, :)
    integer :: b, i, k
    distance = 0
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      unit = spacing(solution(b)%displacement)
      do i = 1, size(unit, 2)
        do k = 1, size(unit, 1)
          if (is_negative(i, k)) unit(k, i) = -unit(k, i)
        end do
      end do
      distance(b) = sqrt(2*strain_energy(problem%body(b), unit))
    end do
    call problem%ranks%share_norm(distance)
  end subroutine storage_rounding

  !> A pattern of signs without order: neighbours are not rounded alike. i enters modulo 7, so that no product
  !> overflows.
  elemental logical function is_negative(i, k)
    integer, intent(in) :: i  !! Node.
    integer, intent(in) :: k  !! Component.
    integer :: j
    j = mod(i, 7)
    is_negative = mod(j*(j + 3) + 5*k*j, 7) < 3
  end function is_negative

  !> Have bodies refined whose rounding keeps the solution from the tolerance.
  subroutine flag_rounded(distance, norm, tolerance, conditioning)
    real(dp), intent(in) :: distance(:)  !! Rounding of each body, in the energy norm (n_bodies) [sqrt(energy)].
    real(dp), intent(in) :: norm  !! Energy norm of the solution [sqrt(energy)].
    real(dp), intent(in) :: tolerance  !! Relative, in the energy norm [].
    type(conditioning_t), intent(inout) :: conditioning(:)  !! Conditioning of the bodies; gets the flags (n_bodies).
    if (.not. is_strain_free(distance, norm, conditioning)) &
      conditioning%is_rounded = conditioning%is_rounded .or. distance > worth_refining*tolerance*norm
  end subroutine flag_rounded

  !> Rounding as a fraction of the solution [].
  pure real(dp) function relative_rounding(distance, norm, conditioning) result(rounding)
    real(dp), intent(in) :: distance(:)  !! Contributions (n) [sqrt(energy)].
    real(dp), intent(in) :: norm  !! Energy norm of the solution [sqrt(energy)].
    type(conditioning_t), intent(in) :: conditioning(:)  !! Conditioning of the bodies (n_bodies).
    rounding = 0
    if (.not. is_strain_free(distance, norm, conditioning)) rounding = norm2(distance)/max(tiny(norm), norm)
  end function relative_rounding

  !> Whether all bodies move without strain, so that the energy of their displacements is nothing but rounding.
  pure logical function is_strain_free(distance, norm, conditioning)
    real(dp), intent(in) :: distance(:)  !! Contributions (n) [sqrt(energy)].
    real(dp), intent(in) :: norm  !! Energy norm of the solution [sqrt(energy)].
    type(conditioning_t), intent(in) :: conditioning(:)  !! Conditioning of the bodies (n_bodies).
    is_strain_free = .not. (any(conditioning%is_measured) .or. norm2(distance) < notable*norm)
  end function is_strain_free
end module dotyk_control_rounding
