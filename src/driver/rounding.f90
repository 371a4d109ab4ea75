!> What rounding has left of the displacements, measured: the forces that they leave unbalanced.
!>
!> A displacement u that leaves the forces r is the exact answer to loads changed by r, so that its distance to the exact answer for the
!> same contact forces is `sqrt(r^T K^{-1} r)` in the energy norm; answers with contact are no farther from each other than that. What
!> factors have lost, digits that the numbers of the results do not have, rounded pressures: all is in r. The elements know the forces
!> (`dotyk_elasticity_internal_force`), K^{-1} is the response of the body.
module dotyk_driver_rounding
  use dotyk_base_error, only: error_t, add_context
  use dotyk_base_kinds, only: dp, qp
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_digits, only: body_digits_t
  use dotyk_driver_parallel, only: largest_first, set_blas_threads
  use dotyk_driver_body_solution, only: body_solution_t
  use dotyk_driver_refinement, only: penetrations
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_elasticity_internal_force, only: internal_force
  use dotyk_response_full, only: full_response_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: expect_rounding, measure_rounding, flag_rounded, relative_rounding, gap_rounding, worth_of_digits

  !> Bodies with more rounding than this part of the tolerance are refined.
  real(dp), parameter :: worth_refining = 0.2_dp
  !> Expected more than this part of it, rounding is measured.
  real(dp), parameter, public :: worth_measuring = 1.0e-3_dp
  !> Least eigenvalues are smaller than displacements say; of pivots, they may be as small as the square.
  real(dp), parameter :: margin = 10
  !> Displacements are no larger in the measure of the diagonal than this times the energy norm: more is no strain at all.
  real(dp), parameter :: most_stretched = 1.0e30_dp
  !> A stiffness whose condition was not worth a measurement does not let more than this part of an answer be rounding.
  real(dp), parameter :: all_rounding = 0.01_dp

contains

  !> More than rounding leaves, of each body: u is wrong by no more than 1e-16 of `sqrt(u^T D u)`, D the diagonal of the stiffness, over
  !> the root of the least eigenvalue in the measure of D. No shape has less energy than that eigenvalue says, u neither.
  subroutine expect_rounding(body, classes, problem, solution, norm, distance)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(contact_problem_t), intent(in) :: problem
    !> Recovered (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Energy norm of the answer [sqrt(energy)].
    real(dp), intent(in) :: norm
    !> In the energy norm (n_bodies) [sqrt(energy)].
    real(dp), intent(out) :: distance(:)
    real(dp), allocatable :: x(:)
    real(dp) :: size_of_u
    integer :: b
    distance = 0
    do b = 1, size(body)
      if (body(b)%constraint%n_equations == 0) cycle
      allocate (x(body(b)%constraint%n_equations))
      call body(b)%constraint%reduce(solution(b)%displacement, x)
      select type (owner => problem%response(classes%first(b))%form)
      type is (full_response_t)
        size_of_u = norm2(sqrt(owner%digits%diagonal)*x)
        distance(b) = margin*epsilon(norm)*size_of_u*max(owner%digits%condition_left, &
                                                         size_of_u/max(tiny(norm), norm, size_of_u/most_stretched))
      end select
      deallocate (x)
    end do
  end subroutine expect_rounding

  !> The distance that rounding has left, of each body.
  subroutine measure_rounding(body, problem, m, solution, n_blas, distance, error)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(contact_problem_t), intent(inout) :: problem
    !> State of the scheme (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Recovered (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> BLAS threads of each solve.
    integer, intent(in) :: n_blas
    !> In the energy norm (n_bodies) [sqrt(energy)].
    real(dp), intent(out) :: distance(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: failed
    integer :: order(size(body)), i, b
    order = largest_first(real(body%constraint%n_equations, dp))
    call set_blas_threads(n_blas)
    !$omp parallel do default(none) shared(body, problem, m, solution, distance, order, error) private(b, failed) &
    !$omp& schedule(dynamic, 1) if (problem%side_by_side)
    do i = 1, size(body)
      b = order(i)
      call measure_body(body(b), problem, b, m, solution(b)%displacement, distance(b), failed)
      if (.not. allocated(failed)) cycle
      !$omp critical (rounding_error)
      if (.not. allocated(error)) call move_alloc(failed, error)
      !$omp end critical (rounding_error)
    end do
    !$omp end parallel do
    call set_blas_threads(1)
  end subroutine measure_rounding

  !> One body.
  subroutine measure_body(body, problem, b, m, u, distance, error)
    type(body_t), intent(in) :: body
    type(contact_problem_t), intent(inout) :: problem
    !> Index of the body.
    integer, intent(in) :: b
    real(dp), intent(in) :: m(:)
    !> Displacement (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    real(dp), intent(out) :: distance
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: force(:, :), contact(:, :), r(:), z(:)
    real(dp) :: energy
    distance = 0
    if (body%constraint%n_equations == 0) return
    allocate (force, mold=u)
    call internal_force(body%mesh, body%analysis, body%material, real(u, qp), force, energy, error)
    if (allocated(error)) then
      call add_context(error, "body '"//body%name//"': ")
      return
    end if
    force = body%load - force
    call problem%body_force(b, m, contact)
    associate (node => problem%operator%block(b)%contact_node)
      force(:, node) = force(:, node) + contact
    end associate
    allocate (r(body%constraint%n_equations))
    call body%constraint%reduce(force, r)
    z = r
    call problem%response(b)%form%solve(z)
    distance = sqrt(max(0.0_dp, dot_product(r, z)))
  end subroutine measure_body

  !> What it takes to close the gaps that displacements leave beside those that the scheme knows, where points press: a displacement of the
  !> nodes at each point alone does, and the diagonals of the stiffnesses tell its energy.
  real(dp) function gap_rounding(problem, solution, m, y) result(distance)
    type(contact_problem_t), intent(in) :: problem
    !> Recovered (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> State of the scheme (n_rows) [pressure], B u - d as it knows it (n_rows) [length].
    real(dp), intent(in) :: m(:), y(:)
    real(dp), allocatable :: wrong(:), yields(:)
    integer :: b, i, k
    allocate (wrong(size(y)))
    call penetrations(problem, solution, wrong)
    wrong = wrong - y
    yields = problem%operator%theta/problem%operator%weight
    do b = 1, size(solution)
      if (size(problem%operator%block(b)%row) == 0) cycle
      associate (block => problem%operator%block(b), diagonal => problem%response(b)%form%diagonal)
        do i = 1, size(block%row)
          do k = block%matrix%row_start(i), block%matrix%row_start(i + 1) - 1
            if (diagonal(block%matrix%column(k)) > 0) yields(block%row(i)) = yields(block%row(i)) + &
                                                      block%matrix%value(k)**2/diagonal(block%matrix%column(k))
          end do
        end do
      end associate
    end do
    distance = sqrt(sum(wrong**2/max(tiny(distance), yields), mask=m > 0 .and. yields > 0))
  end function gap_rounding

  !> What the last digits of the displacements are worth, of each body: no answer in doubles is nearer to the exact one.
  subroutine worth_of_digits(body, solution, distance)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> Recovered (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> In the energy norm (n_bodies) [sqrt(energy)].
    real(dp), intent(out) :: distance(:)
    real(dp), allocatable :: digit(:, :)
    integer :: b, i, k
    do b = 1, size(body)
      digit = spacing(solution(b)%displacement)
      ! Neighbours are not rounded alike.
      do i = 1, size(digit, 2)
        do k = 1, size(digit, 1)
          if (mod(i*(i + 3) + 5*k*i, 7) < 3) digit(k, i) = -digit(k, i)
        end do
      end do
      distance(b) = sqrt(2*strain_energy(body(b), digit))
    end do
  end subroutine worth_of_digits

  !> Have bodies refined that rounding keeps from the tolerance.
  subroutine flag_rounded(distance, norm, tolerance, digits)
    !> (n_bodies) [sqrt(energy)].
    real(dp), intent(in) :: distance(:)
    !> Of the answer [sqrt(energy)].
    real(dp), intent(in) :: norm
    !> Where to stop [].
    real(dp), intent(in) :: tolerance
    !> (n_bodies).
    type(body_digits_t), intent(inout) :: digits(:)
    if (.not. strains_nothing(distance, norm, digits)) &
      digits%is_rounded = digits%is_rounded .or. distance > worth_refining*tolerance*norm
  end subroutine flag_rounded

  !> Rounding as a part of the answer [].
  pure real(dp) function relative_rounding(distance, norm, digits) result(rounding)
    !> (n_bodies), of the answer [sqrt(energy)].
    real(dp), intent(in) :: distance(:), norm
    !> (n_bodies).
    type(body_digits_t), intent(in) :: digits(:)
    rounding = 0
    if (.not. strains_nothing(distance, norm, digits)) rounding = norm2(distance)/max(tiny(norm), norm)
  end function relative_rounding

  !> Whether all bodies move without strain, so that the energy of what they do is nothing but rounding.
  pure logical function strains_nothing(distance, norm, digits) result(nothing)
    real(dp), intent(in) :: distance(:), norm
    type(body_digits_t), intent(in) :: digits(:)
    nothing = .not. (any(digits%is_measured) .or. norm2(distance) < all_rounding*norm)
  end function strains_nothing
end module dotyk_driver_rounding
