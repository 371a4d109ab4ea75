!> Factorization of the stiffness of a body: regularized where rigid body modes are left, and its condition measured
!> where that matters.
!>
!> The smallest pivot, relative to the diagonal entry of its equation, is known at no cost, and the condition number is
!> at least its inverse. Only where it is small are the lowest eigenmodes of the scaled stiffness computed: they give
!> the condition, and tell whether a few near-null-space modes are the only cause.
!>
!> The stiffness of a body on a weak support holds the stiffness of its near-null-space modes, nearly rigid as a rule,
!> as the difference of large numbers. Springs at as many equations E as there are such modes make it
!> `K_s = K + E s E^T`, as for floating bodies. With the solutions Z of `K_s Z = E s`, which are the modes, and their
!> own stiffness S,
!>
!>     K^{-1} = K_s^{-1} + Z S^{-1} Z^T,    S = (E^T Z)^{-T} Z^T K Z,
!>
!> exactly. K_s is well conditioned, and S is stationary in Z, so that it is as accurate as the energy `Z^T K Z`, which
!> is computed from the elements (`body_force`). For the schemes Z are rigid body modes with
!> springs S.
module dotyk_response_stiffness_factor
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_text, only: to_text
  use dotyk_elasticity_body, only: assemble_stiffness, body_t, stiffness_t, strain_energy
  use dotyk_elasticity_conditioning_diagnosis, only: diagnose_conditioning
  use dotyk_elasticity_internal_force, only: body_force
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_dense, only: right_singular_vectors, solve_dense
  use dotyk_linalg_spectrum, only: scaled_norm, smallest_eigenpairs
  use dotyk_linalg_springs, only: add_springs, choose_fixing_equations
  implicit none
  private
  public :: factorize_stiffness, separate_by_contact

  !> A displacement with less than this part of the energy that its nodes would have one by one, all others at rest,
  !> strains nothing. Elements know it to the square of round-off: mechanisms have 1e-25 and less, a bar 1000 times
  !> longer than thick 1e-13, a ribbon of 10000 by 100 by 1 3e-17.
  real(dp), parameter :: least_energy = 1.0e-20_dp

  type, public :: factorization_report_t  !! What a factorization found out about the stiffness of a body.
    !> Condition number of the stiffness with its diagonal scaled to 1; a lower bound where it was not measured [].
    real(dp) :: condition = 1
    !> That of the factorized matrix, which is without the near-null-space modes that were split off [].
    real(dp) :: condition_left = 1
    logical :: is_measured = .false.  !! Whether the condition was measured.
    real(dp), allocatable :: diagonal(:)  !! Diagonal of the stiffness, without springs (n_equations) [force/length].
    !> Equations with springs, against rigid body or near-null-space modes (n_springs).
    integer, allocatable :: fixing_equation(:)
    real(dp), allocatable :: spring(:)  !! The springs (n_springs) [force/length].
    !> Near-null-space modes over the equations (n_equations, n) [], and their stiffness (n, n) [force/length]; not
    !> allocated where there are none.
    real(dp), allocatable :: near_null(:, :), near_null_stiffness(:, :)
    integer :: n_near_null = 0  !! Number of near-null-space modes.
  end type factorization_report_t

  !> A pivot below this fraction of its diagonal entry may be round-off. (Thin bodies have small ones too, and round-off
  !> leaves 1e-16 to 1e-13: the energy of the displacement that belongs to it decides.)
  real(dp), parameter :: suspicious_pivot = 1.0e-8_dp
  !> Below this fraction the condition is worth a measurement: compact bodies have 1e-2, plates 1e-4 at about 20 times
  !> their thickness.
  real(dp), parameter :: small_pivot = 1.0e-4_dp
  integer, parameter :: n_eigenmodes = 8  !! Number of eigenmodes: six rigid body modes, and what comes after them.
  !> Eigenvalues of the scaled stiffness above this do not cost noticeable accuracy.
  real(dp), parameter :: largest_eigenvalue = 1.0e-4_dp
  !> A near-null space has eigenvalues below all others by this factor; the spectrum of a thin body has no such gap.
  real(dp), parameter :: least_gap = 100
  integer, parameter :: refinement_steps = 2  !! Steps of iterative refinement of the modes.

contains

  !> Factorize. The memory of the stiffness is given back before that of the factor is taken.
  subroutine factorize_stiffness(body, stiffness, factor, fixing_equation, split_near_null, report, error)
    type(body_t), intent(in) :: body  !! Assembled.
    type(stiffness_t), intent(inout) :: stiffness  !! Its stiffness; empty on return.
    type(cholesky_t), intent(inout) :: factor  !! Analysed; factorized on return.
    integer, intent(in) :: fixing_equation(:)  !! Equations that get springs, one for each rigid body mode (n_modes).
    logical, intent(in) :: split_near_null  !! Whether near-null-space modes may be split off.
    type(factorization_report_t), intent(out) :: report  !! Condition, springs, near-null-space modes.
    !> Allocated where the stiffness is not positive definite (names a node), or memory runs out.
    !> Where pivots are small also: a formula of the material cannot be evaluated again, the smallest eigenvalues are
    !> not found (a solution is not finite, or LAPACK does not converge), or the near-null-space modes are linearly
    !> dependent.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: diagonal(:), spring(:), shapes(:, :), values(:)
    real(dp) :: norm
    integer :: failed_column, n, i
    call add_springs(stiffness%matrix, fixing_equation, spring)
    diagonal = [(stiffness%matrix%value(stiffness%matrix%column_start(i) + 1), i=1, stiffness%matrix%n)]
    call factor%factorize_and_discard(stiffness%matrix, failed_column, error)
    if (allocated(error)) return
    ! A part that is not held can pass the factorization by round-off, which is all that its last pivot consists of.
    if (failed_column == 0 .and. factor%weakest_pivot < suspicious_pivot) then
      if (is_loose(body, factor, diagonal, fixing_equation, spring)) failed_column = factor%weakest_equation
    end if
    if (failed_column > 0) then
      call refuse(body, failed_column, error)
      return
    end if
    report%fixing_equation = fixing_equation
    report%spring = spring
    report%condition = 1/factor%weakest_pivot
    report%condition_left = report%condition
    report%diagonal = diagonal
    report%diagonal(fixing_equation) = diagonal(fixing_equation) - spring
    if (factor%weakest_pivot > small_pivot) return
    n = min(n_eigenmodes, size(diagonal))
    allocate (shapes(size(diagonal), n), values(n))
    call smallest_eigenpairs(factor, diagonal, values, shapes, error)
    if (allocated(error)) return
    ! The factor has taken the place of the matrix.
    call assemble_stiffness(body, stiffness, error)
    if (allocated(error)) return
    call add_springs(stiffness%matrix, fixing_equation, spring)
    report%is_measured = .true.
    norm = scaled_norm(stiffness%matrix)
    report%condition = norm/max(tiny(norm), values(1))
    report%condition_left = report%condition
    n = 0
    if (split_near_null .and. size(fixing_equation) == 0) n = count_near_null(values)
    if (n > 0) then
      report%condition_left = norm/values(n + 1)
      call split_off(body, stiffness, factor, diagonal, shapes(:, :n), report, error)
    end if
    call stiffness%destroy()
  end subroutine factorize_stiffness

  !> Factorize once more, regularized against the near-null-space modes.
  subroutine split_off(body, stiffness, factor, diagonal, shapes, report, error)
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(stiffness_t), intent(inout) :: stiffness  !! Stiffness of a body that its supports hold; empty on return.
    type(cholesky_t), intent(inout) :: factor  !! Factor of the stiffness; of the regularized one on return.
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of the stiffness (n_equations) [force/length].
    real(dp), intent(in) :: shapes(:, :)  !! The modes, approximately (n_equations, n) [].
    type(factorization_report_t), intent(inout) :: report  !! Gets the modes and the springs.
    type(error_t), allocatable, intent(out) :: error  !! As in `factorize_stiffness`.
    real(dp), allocatable :: scaled(:, :)
    integer :: failed_column, k
    allocate (scaled, mold=shapes)
    do k = 1, size(shapes, 2)
      scaled(:, k) = sqrt(diagonal)*shapes(:, k)
    end do
    call choose_fixing_equations(scaled, report%fixing_equation)
    call add_springs(stiffness%matrix, report%fixing_equation, report%spring)
    call factor%factorize_and_discard(stiffness%matrix, failed_column, error)
    if (allocated(error)) return
    if (failed_column > 0) then
      call refuse(body, failed_column, error)
      return
    end if
    call find_near_null(body, factor, report%fixing_equation, report%spring, report%near_null, &
                        report%near_null_stiffness, error)
    if (allocated(report%near_null)) report%n_near_null = size(report%near_null, 2)
  end subroutine split_off

  !> Whether the displacement that belongs to the weakest pivot is a mechanism.
  logical function is_loose(body, factor, diagonal, fixing_equation, spring)
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(cholesky_t), intent(in) :: factor  !! Factor of the stiffness, springs included.
    real(dp), intent(in) :: diagonal(:)  !! Springs included (n_equations) [force/length].
    integer, intent(in) :: fixing_equation(:)  !! Equations with springs (n_modes).
    real(dp), intent(in) :: spring(:)  !! The springs (n_modes) [force/length].
    real(dp), allocatable :: x(:)
    allocate (x(size(diagonal)), source=0.0_dp)
    x(factor%weakest_equation) = 1
    call factor%solve(x)
    is_loose = is_mechanism(body, diagonal, fixing_equation, spring, x)
  end function is_loose

  !> The error of a stiffness that is not positive definite.
  subroutine refuse(body, equation, error)
    type(body_t), intent(in) :: body  !! The body, assembled.
    integer, intent(in) :: equation  !! Where elimination found it out.
    type(error_t), allocatable, intent(out) :: error  !! Always allocated.
    character(:), allocatable :: cause
    integer :: place(2)
    call diagnose_conditioning(body%mesh, body%analysis, body%material, cause)
    if (len(cause) > 0) cause = '; or no significant digit of the stiffness matrix remains, likely cause: '//cause
    place = findloc(body%constraint%equation, equation)
    !$omp critical (message)
    call set_error(error, 'the stiffness matrix is not positive definite (node '// &
                   to_text(body%mesh%node_tag(place(2)))//', direction '//to_text(place(1))// &
                   '): the body, or a part of it that '// &
                   'is connected by single nodes or edges only, has a free rigid body mode; add a &support'//cause, &
                   exit_not_solvable)
    !$omp end critical (message)
  end subroutine refuse

  !> Whether a displacement is a mechanism: it moves parts of the body against each other without strain.
  logical function is_mechanism(body, diagonal, fixed, spring, x)
    type(body_t), intent(in) :: body  !! Assembled.
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of the stiffness, springs included (n_equations) [force/length].
    integer, intent(in) :: fixed(:)  !! Equations with springs (n).
    real(dp), intent(in) :: spring(:)  !! The springs (n) [force/length].
    real(dp), intent(in) :: x(:)  !! The displacement (n_equations) [any].
    real(dp), allocatable :: u(:, :)
    real(dp) :: most
    is_mechanism = .true.
    most = maxval(abs(x))
    if (.not. ieee_is_finite(most) .or. .not. most > 0) return
    allocate (u(body%dimension, body%mesh%n_nodes()))
    call body%constraint%expand(x/most, u, .false.)
    is_mechanism = .not. 2*strain_energy(body, u) + sum(spring*(x(fixed)/most)**2) > &
                   least_energy*sum(diagonal*(x/most)**2)
  end function is_mechanism

  !> Dimension of the near-null space.
  pure integer function count_near_null(values) result(n)
    !> The least eigenvalues of the scaled stiffness, ascending, more than the near-null space has (number of them) [].
    real(dp), intent(in) :: values(:)
    integer :: k
    real(dp) :: widest
    n = 0
    widest = least_gap
    do k = 1, size(values) - 1
      if (.not. (values(k) < largest_eigenvalue .and. values(k) > 0)) cycle
      if (.not. values(k + 1) > widest*values(k)) cycle
      widest = values(k + 1)/values(k)
      n = k
    end do
  end function count_near_null

  !> The modes and their stiffness.
  subroutine find_near_null(body, factor, fixed, spring, mode, stiffness, error)
    type(body_t), intent(in) :: body  !! Assembled.
    type(cholesky_t), intent(in) :: factor  !! Factor of K_s.
    integer, intent(in) :: fixed(:)  !! Equations with springs E (n).
    real(dp), intent(in) :: spring(:)  !! The springs s (n) [force/length].
    real(dp), allocatable, intent(out) :: mode(:, :)  !! Z (n_equations, n) [].
    real(dp), allocatable, intent(out) :: stiffness(:, :)  !! S (n, n) [force/length].
    !> Allocated where a formula of the material cannot be evaluated, or the modes are linearly dependent at the
    !> springs.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :, :), force(:, :), at_springs(:, :), residual(:)
    real(dp) :: energy
    integer :: j, k, n, step
    n = size(fixed)
    allocate (mode(body%constraint%n_equations, n), stiffness(n, n), source=0.0_dp)
    do k = 1, n
      mode(fixed(k), k) = spring(k)
    end do
    call factor%solve_block(mode)
    allocate (u(body%dimension, body%mesh%n_nodes(), n), force(body%dimension, body%mesh%n_nodes()))
    allocate (residual(size(mode, 1)))
    do k = 1, n
      call body%constraint%expand(mode(:, k), u(:, :, k), .false.)
      ! Self-equilibrated loads must not excite the modes through the rounding errors of Z.
      do step = 1, refinement_steps
        call body_force(body, real(u(:, :, k), qp), force, energy, error)
        if (allocated(error)) return
        call body%constraint%reduce(-force, residual)
        residual(fixed(k)) = residual(fixed(k)) + spring(k)
        residual(fixed) = residual(fixed) - spring*mode(fixed, k)
        call factor%solve(residual)
        mode(:, k) = mode(:, k) + residual
        call body%constraint%expand(mode(:, k), u(:, :, k), .false.)
      end do
    end do
    do k = 1, n
      call body_force(body, real(u(:, :, k), qp), force, energy, error)
      if (allocated(error)) return
      do j = 1, n
        stiffness(j, k) = sum(u(:, :, j)*force)
      end do
    end do
    at_springs = transpose(mode(fixed, :))
    call solve_dense(at_springs, stiffness, error)
    stiffness = (stiffness + transpose(stiffness))/2
  end subroutine find_near_null

  !> Recombine the modes so that those which move contact rows and those which do not are separate: rounding errors of
  !> large contact forces must not excite the latter.
  subroutine separate_by_contact(at_rows, mode, stiffness, error)
    real(dp), intent(in) :: at_rows(:, :)  !! The modes at the contact rows, B Z (n_rows, n) [].
    real(dp), intent(inout) :: mode(:, :)  !! Z (n_equations, n) [].
    real(dp), intent(inout) :: stiffness(:, :)  !! S (n, n) [force/length].
    !> Allocated where an entry at the rows is not finite, or LAPACK's singular value decomposition does not converge.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: values(size(mode, 2)), vectors(size(mode, 2), size(mode, 2)), scaled(size(at_rows, 1), size(mode, 2))
    integer :: k
    do k = 1, size(mode, 2)
      values(k) = maxval(abs(mode(:, k)))
      mode(:, k) = mode(:, k)/values(k)
      scaled(:, k) = at_rows(:, k)/values(k)
    end do
    do k = 1, size(mode, 2)
      stiffness(:, k) = stiffness(:, k)/values/values(k)
    end do
    call right_singular_vectors(scaled, values, vectors, error)
    if (allocated(error)) return
    mode = matmul(mode, vectors)
    stiffness = matmul(transpose(vectors), matmul(stiffness, vectors))
  end subroutine separate_by_contact
end module dotyk_response_stiffness_factor
