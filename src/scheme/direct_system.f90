!> The system of an active set by factorization.
!>
!> M consists of one dense block per couple of pairs that share a body. It is factorized block by block, pairs ordered by nested
!> dissection, and the border goes by its Schur complement `S = G^T M^{-1} G`, whose null space are the motions that the active points
!> do not hold. With theta = 0 points can say the same thing twice, and M is singular: what is factorized is M plus a small part of
!> its diagonal, and the solution is refined with the true M. This is the proximal point method: it keeps the consistent part exact
!> and gives redundant points the forces of least norm.
module dotyk_scheme_direct_system
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_cholesky, only: block_cholesky_t
  use dotyk_scheme_active_system, only: active_system_t, proximal_part
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_pair_graph, only: couple_pairs, order_pairs
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> The factorized system. It owns a factor: never copy it, destroy it in the end.
  type, extends(active_system_t), public :: direct_system_t
    type(block_cholesky_t), private :: factor
    !> Diagonal of M (n) [length/force].
    real(dp), allocatable, private :: diagonal(:)
    !> G on the active points and M^{-1} G (n, coarse%n).
    real(dp), allocatable, private :: g(:, :), x(:, :)
    !> S^{-1}, pseudo-inverse where S is singular (coarse%n, coarse%n).
    real(dp), allocatable, private :: schur_inverse(:, :)
  contains
    procedure :: init => direct_system_init
    procedure :: solve => direct_system_solve
    procedure :: destroy => direct_system_destroy
  end type direct_system_t

contains

  !> Assemble and factorize.
  subroutine direct_system_init(self, problem, compliance, theta, active, error)
    class(direct_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> Of all rows.
    type(explicit_compliance_t), intent(in) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> (n_rows).
    logical, intent(in) :: active(:)
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    integer :: failed
    call self%destroy()
    call self%take_points(problem, theta, active)
    call assemble(self, problem, compliance, active, error)
    if (allocated(error)) return
    allocate (self%diagonal(size(self%row)))
    call self%factor%add_diagonal(self%layer)
    call self%factor%get_diagonal(self%diagonal)
    call self%factor%add_diagonal(proximal_part*self%diagonal)
    call self%factor%factorize(failed)
    if (failed > 0) call set_error(error, 'the compliance of the active contact points is '// &
      'not positive definite', exit_not_solvable)
    if (allocated(error)) return
    call eliminate_border(self, problem, error)
  end subroutine direct_system_init

  !> C on the active points: what the bodies of two pairs that share them contribute to the pairs' block.
  subroutine assemble(self, problem, compliance, active, error)
    type(direct_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> (n_rows).
    logical, intent(in) :: active(:)
    type(error_t), allocatable, intent(out) :: error
    logical, allocatable :: coupled(:, :)
    integer, allocatable :: order(:), member(:), first(:), pair(:), start(:), neighbour(:), n_points(:)
    integer :: n_pairs, b, k, l
    associate (pair_first => problem%operator%pair_first_row)
      n_pairs = size(pair_first) - 1
      allocate (n_points(n_pairs))
      do k = 1, n_pairs
        n_points(k) = count(active(pair_first(k):pair_first(k + 1) - 1))
      end do
      call couple_pairs(problem, start, neighbour)
      call order_pairs(start, neighbour, n_points, order, error)
      if (allocated(error)) return
      allocate (coupled(n_pairs, n_pairs), source=.false.)
      do k = 1, n_pairs
        coupled(k, k) = .true.
        coupled(neighbour(start(k):start(k + 1) - 1), k) = .true.
      end do
      call self%factor%init(n_points, coupled, order, error)
      if (allocated(error)) return
      do b = 1, size(compliance%body)
        associate (row => problem%operator%block(b)%row, number => compliance%body(b)%number)
          ! The body's active rows, pair by pair, as numbers in its matrix.
          member = pack(number, active(row))
          call find_runs(pack(row, active(row)), pair_first, pair, first)
        end associate
        do k = 1, size(pair)
          do l = 1, k
            call self%factor%add(pair(k), pair(l), &
                                 compliance%body(b)%value(member(first(k):first(k + 1) - 1), member(first(l):first(l + 1) - 1)))
          end do
        end do
      end do
    end associate
  end subroutine assemble

  !> Where the rows of each pair stand in a list of rows.
  subroutine find_runs(row, pair_first, pair, first)
    !> Ascending.
    integer, intent(in) :: row(:)
    !> First row of each pair (n_pairs + 1).
    integer, intent(in) :: pair_first(:)
    !> Pairs that are there (n), and the place of the first row of each (n + 1).
    integer, allocatable, intent(out) :: pair(:), first(:)
    integer :: i, k
    allocate (pair(0), first(0))
    k = 0
    do i = 1, size(row)
      if (k > 0) then
        if (row(i) < pair_first(k + 1)) cycle
      end if
      do
        k = k + 1
        if (row(i) < pair_first(k + 1)) exit
      end do
      pair = [pair, k]
      first = [first, i]
    end do
    first = [first, size(row) + 1]
  end subroutine find_runs

  !> The Schur complement of the border and its pseudo-inverse.
  subroutine eliminate_border(self, problem, error)
    type(direct_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: schur(:, :)
    integer :: n, r
    n = size(self%row)
    r = problem%coarse%n
    allocate (self%g(n, r))
    call problem%coarse%rows(self%row, self%g)
    self%x = self%g
    if (n > 0 .and. r > 0) call self%factor%solve(self%x)
    schur = matmul(transpose(self%g), self%x)
    if (allocated(problem%coarse%stiffness)) schur = schur + problem%coarse%stiffness
    call problem%coarse%invert(schur, self%schur_inverse, self%null_mode, error)
  end subroutine eliminate_border

  !> Solve, and refine the solution until rounding allows no more. Motions that nothing holds stay at rest; the part of c that excites
  !> them is left over.
  subroutine direct_system_solve(self, problem, compliance, b, c, lambda, alpha)
    class(direct_system_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> Right-hand sides: (n) [length], (coarse%n) [force].
    real(dp), intent(in) :: b(:), c(:)
    !> Forces at the active points; what they are on entry does not matter (n) [force].
    real(dp), intent(inout) :: lambda(:)
    !> Amplitudes of the free motions (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    real(dp), allocatable :: r_b(:), r_c(:), step(:), step_alpha(:), all_forces(:), z(:)
    real(dp) :: residual, previous
    integer :: k
    integer, parameter :: most_steps = 8
    allocate (all_forces(problem%operator%n_rows), z(problem%operator%n_rows), source=0.0_dp)
    r_b = b
    r_c = c
    lambda = 0
    alpha = 0
    previous = huge(previous)
    do k = 1, most_steps
      step = solve_one(self%factor, r_b)
      step_alpha = matmul(self%schur_inverse, r_c - matmul(step, self%g))
      step = step + matmul(self%x, step_alpha)
      all_forces(self%row) = lambda + step
      call compliance%multiply(problem, all_forces, z)
      r_b = b - z(self%row) - self%layer*(lambda + step) + matmul(self%g, alpha + step_alpha)
      r_c = c - matmul(lambda + step, self%g) - problem%coarse%springs(alpha + step_alpha)
      residual = sum(r_b**2/self%diagonal)
      if (allocated(problem%coarse%stiffness)) residual = residual + dot_product(r_c, matmul(self%schur_inverse, r_c))
      ! Rounding errors do not get smaller.
      if (k > 1 .and. .not. residual < previous) exit
      lambda = lambda + step
      alpha = alpha + step_alpha
      if (.not. residual < 0.1_dp*previous) exit
      previous = residual
    end do
  end subroutine direct_system_solve

  !> The solution for one right-hand side.
  function solve_one(factor, b) result(x)
    type(block_cholesky_t), intent(in) :: factor
    real(dp), intent(in) :: b(:)
    real(dp) :: x(size(b)), column(size(b), 1)
    column(:, 1) = b
    call factor%solve(column)
    x = column(:, 1)
  end function solve_one

  !> Give all memory back.
  subroutine direct_system_destroy(self)
    class(direct_system_t), intent(inout) :: self
    call self%factor%destroy()
    call self%forget()
    if (allocated(self%diagonal)) deallocate (self%diagonal)
    if (allocated(self%g)) deallocate (self%g)
    if (allocated(self%x)) deallocate (self%x)
    if (allocated(self%schur_inverse)) deallocate (self%schur_inverse)
  end subroutine direct_system_destroy
end module dotyk_scheme_direct_system
