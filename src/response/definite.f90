!> The factor of a body's stiffness: made definite, factorized, and looked at where it may have lost digits.
!>
!> The least part of a diagonal entry that elimination leaves costs nothing to know, and no condition is better than its inverse. Only
!> where it is small are the softest shapes found, which gives the condition, and says whether a few soft motions are all that is
!> wrong: these are treated apart then (`dotyk_response_soft_motions`).
module dotyk_response_definite
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_conditioning_diagnosis, only: diagnose_conditioning
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_condition, only: scaled_norm, smallest_eigenpairs
  use dotyk_response_hold, only: add_springs, choose_holds, is_mechanism
  use dotyk_response_soft_motions, only: count_soft, find_near_null_modes
  implicit none
  private

  !> What is known of a body's stiffness and its factor.
  type, public :: digits_t
    !> Condition of the stiffness with its diagonal scaled to 1; a lower bound where it was not measured.
    real(dp) :: condition = 1
    !> That of what was factorized: soft motions are no part of it.
    real(dp) :: condition_left = 1
    logical :: is_measured = .false.
    !> Diagonal of the stiffness, springs included (n_equations) [force/length].
    real(dp), allocatable :: diagonal(:)
    !> Equations with springs, those against free or soft motions, and the springs (n_springs) [force/length].
    integer, allocatable :: hold(:)
    real(dp), allocatable :: spring(:)
    !> Soft motions over the equations (n_equations, n), and their stiffness (n, n) [force/length]; none where not allocated.
    real(dp), allocatable :: motion(:, :), stiffness(:, :)
  end type digits_t

  public :: factorize_stiffness

  !> A pivot that elimination has left less than this part of may be round-off. (Thin bodies have small ones too, and round-off
  !> leaves 1e-16 to 1e-13: whether it is, the displacement says that belongs to it.)
  real(dp), parameter :: suspicious_pivot = 1.0e-8_dp
  !> One with less than this says that the condition is worth a measurement: compact bodies have 1e-2, plates 1e-4 at about 20 times their
  !> thickness.
  real(dp), parameter :: small_pivot = 1.0e-4_dp
  !> Shapes to look at: rigid motions, and what comes after them.
  integer, parameter :: n_shapes = 8

contains

  !> Factorize. The memory of the stiffness is given back before that of the factor is taken.
  subroutine factorize_stiffness(body, factor, hold, digits, error, take_apart)
    !> Assembled; without stiffness on return.
    type(body_t), intent(inout) :: body
    !> Analysed.
    type(cholesky_t), intent(inout) :: factor
    !> Equations that get springs, one for each free motion.
    integer, intent(in) :: hold(:)
    type(digits_t), intent(out) :: digits
    type(error_t), allocatable, intent(out) :: error
    !> Whether soft motions may be treated apart; not if absent.
    logical, intent(in), optional :: take_apart
    real(dp), allocatable :: diagonal(:), spring(:), shapes(:, :), values(:)
    real(dp) :: norm
    integer :: failed_column, n, i
    call add_springs(body%stiffness, hold, spring)
    diagonal = [(body%stiffness%value(body%stiffness%column_start(i) + 1), i=1, body%stiffness%n)]
    call factor%factorize_and_discard(body%stiffness, failed_column, error, may_stop=.true.)
    if (allocated(error)) return
    ! A part that is not held can pass the factorization by round-off; its last pivot is nothing but that.
    if (failed_column == 0 .and. factor%weakest_pivot < suspicious_pivot) then
      if (is_loose(body, factor, diagonal, hold, spring)) failed_column = factor%weakest_equation
    end if
    if (failed_column > 0) then
      call refuse(body, failed_column, error)
      return
    end if
    digits%hold = hold
    digits%spring = spring
    digits%condition = 1/factor%weakest_pivot
    digits%condition_left = digits%condition
    digits%diagonal = diagonal
    if (factor%weakest_pivot > small_pivot) return
    n = min(n_shapes, size(diagonal))
    allocate (shapes(size(diagonal), n), values(n))
    call smallest_eigenpairs(factor, diagonal, values, shapes, error)
    if (allocated(error)) return
    call assemble_again(body, hold, spring, error)
    if (allocated(error)) return
    digits%is_measured = .true.
    norm = scaled_norm(body%stiffness)
    digits%condition = norm/max(tiny(norm), values(1))
    digits%condition_left = digits%condition
    n = 0
    if (present(take_apart)) then
      if (take_apart .and. size(hold) == 0) n = count_soft(values)
    end if
    if (n > 0) then
      ! A shape that is not so soft is that of the body held.
      digits%condition_left = norm/values(n + 1)
      call part_soft_motions(body, factor, diagonal, shapes(:, :n), digits, error)
    end if
    call body%stiffness%destroy()
  end subroutine factorize_stiffness

  !> Factorize once more with springs against the soft motions.
  subroutine part_soft_motions(body, factor, diagonal, shapes, digits, error)
    !> With its stiffness again; without it on return.
    type(body_t), intent(inout) :: body
    type(cholesky_t), intent(inout) :: factor
    !> Of the stiffness (n_equations).
    real(dp), intent(in) :: diagonal(:)
    !> The soft motions, about (n_equations, n).
    real(dp), intent(in) :: shapes(:, :)
    type(digits_t), intent(inout) :: digits
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: scaled(:, :), spring(:)
    integer, allocatable :: hold(:)
    integer :: failed_column, k
    allocate (scaled, mold=shapes)
    do k = 1, size(shapes, 2)
      scaled(:, k) = sqrt(diagonal)*shapes(:, k)
    end do
    call choose_holds(scaled, hold)
    call add_springs(body%stiffness, hold, spring)
    call factor%factorize_and_discard(body%stiffness, failed_column, error, may_stop=.true.)
    if (allocated(error)) return
    if (failed_column > 0) then
      call refuse(body, failed_column, error)
      return
    end if
    call find_near_null_modes(body, factor, hold, spring, digits%motion, digits%stiffness, error)
    digits%hold = hold
    digits%spring = spring
  end subroutine part_soft_motions

  !> The stiffness once more.
  subroutine assemble_again(body, hold, spring, error)
    type(body_t), intent(inout) :: body
    !> Equations with springs, and what these were (n).
    integer, intent(in) :: hold(:)
    real(dp), allocatable, intent(inout) :: spring(:)
    type(error_t), allocatable, intent(out) :: error
    call body%assemble(error)
    if (allocated(error)) return
    deallocate (body%graph_start, body%graph_neighbour)
    call add_springs(body%stiffness, hold, spring)
  end subroutine assemble_again

  !> Whether the weakest pivot is that of a motion which strains nothing.
  logical function is_loose(body, factor, diagonal, hold, spring)
    type(body_t), intent(in) :: body
    type(cholesky_t), intent(in) :: factor
    !> Diagonal with the springs in (n_equations).
    real(dp), intent(in) :: diagonal(:)
    !> Equations with springs, and the springs.
    integer, intent(in) :: hold(:)
    real(dp), intent(in) :: spring(:)
    real(dp), allocatable :: x(:)
    allocate (x(size(diagonal)), source=0.0_dp)
    x(factor%weakest_equation) = 1
    call factor%solve(x)
    is_loose = is_mechanism(body, diagonal, hold, spring, x)
  end function is_loose

  !> The error of a stiffness that is not definite.
  subroutine refuse(body, equation, error)
    type(body_t), intent(in) :: body
    !> Where it was found out.
    integer, intent(in) :: equation
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: cause
    integer :: place(2)
    call diagnose_conditioning(body%mesh, body%analysis, body%material, cause)
    if (len(cause) > 0) cause = '; or rounding leaves no digit of it, and the likely cause is: '//cause
    place = findloc(body%constraint%equation, equation)
    !$omp critical (message)
    call set_error(error, 'the stiffness is not positive definite (node '// &
      to_text(body%mesh%node_tag(place(2)))//', direction '//to_text(place(1))//'): the body, or a part of it that '// &
      'hangs on single nodes or edges, is not held; add a &support'//cause, exit_not_solvable)
    !$omp end critical (message)
  end subroutine refuse
end module dotyk_response_definite
