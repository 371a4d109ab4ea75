!> The system of an active set by factorization.
!>
!> M consists of one dense block per couple of pairs that share a body. It is factorized as a sparse matrix, pairs ordered by nested
!> dissection, and the border goes by its Schur complement `S = G^T M^{-1} G`, whose null space are the motions that the active points
!> do not hold. With theta = 0 points can say the same thing twice, and M is singular: what is factorized is M plus a small part of
!> its diagonal, and the solution is refined with the true M. This is the proximal point method: it keeps the consistent part exact
!> and gives redundant points the forces of least norm.
module dotyk_scheme_direct_system
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_pair_graph, only: couple_pairs, order_pairs
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> The factorized system. It owns a factor: never copy it, destroy it in the end.
  type, extends(active_system_t), public :: direct_system_t
    type(cholesky_t), private :: factor
    !> Diagonal of M (n) [length/force].
    real(dp), allocatable, private :: diagonal(:)
    !> theta/w (n) [length/force].
    real(dp), allocatable, private :: layer(:)
    !> G on the active points and M^{-1} G (n, coarse%n).
    real(dp), allocatable, private :: g(:, :), x(:, :)
    !> S^{-1}, pseudo-inverse where S is singular (coarse%n, coarse%n).
    real(dp), allocatable, private :: schur_inverse(:, :)
    !> Spring on each motion (coarse%n) [force/length].
    real(dp), allocatable, private :: hold(:)
  contains
    procedure :: init => direct_system_init
    procedure :: solve => direct_system_solve
    procedure :: destroy => direct_system_destroy
  end type direct_system_t

  !> Part of the diagonal that is added before the factorization.
  real(dp), parameter :: proximal_part = 1.0e-9_dp

contains

  !> Assemble and factorize.
  subroutine direct_system_init(self, problem, compliance, theta, active, error, hold)
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
    !> Spring on each motion; none where not given (coarse%n) [force/length].
    real(dp), intent(in), optional :: hold(:)
    type(sparse_symmetric_t) :: matrix
    integer, allocatable :: permutation(:)
    integer(int64) :: k
    integer :: i, n, failed
    call self%destroy()
    self%row = pack([(i, i=1, size(active))], active)
    n = size(self%row)
    allocate (self%hold(problem%coarse%n), source=0.0_dp)
    if (present(hold)) self%hold = hold
    self%layer = theta(self%row)/problem%operator%weight(self%row)
    call assemble(problem, compliance, self%row, active, matrix, permutation, error)
    if (allocated(error)) return
    allocate (self%diagonal(n))
    do i = 1, n
      k = matrix%column_start(i) + 1
      matrix%value(k) = matrix%value(k) + self%layer(i)
      self%diagonal(i) = matrix%value(k)
      matrix%value(k) = (1 + proximal_part)*matrix%value(k)
    end do
    call self%factor%analyze(matrix, permutation, error)
    if (.not. allocated(error)) call self%factor%factorize_and_discard(matrix, failed, error)
    if (.not. allocated(error) .and. failed > 0) call set_error(error, 'the compliance of the active contact points is '// &
      'not positive definite', exit_not_solvable)
    if (allocated(error)) return
    call eliminate_border(self, problem, error)
  end subroutine direct_system_init

  !> C on the active points, lower triangle, and the order of elimination.
  subroutine assemble(problem, compliance, row, active, matrix, permutation, error)
    type(contact_problem_t), intent(in) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> Active rows (n), and as marks (n_rows).
    integer, intent(in) :: row(:)
    logical, intent(in) :: active(:)
    type(sparse_symmetric_t), intent(out) :: matrix
    integer, allocatable, intent(out) :: permutation(:)
    type(error_t), allocatable, intent(out) :: error
    logical, allocatable :: coupled(:, :)
    integer, allocatable :: first(:), number(:), pair_of(:), order(:), offset(:)
    integer :: n, n_pairs, i, j, k, l, b
    integer(int64) :: base
    n = size(row)
    associate (pair_first => problem%operator%pair_first_row)
      n_pairs = size(pair_first) - 1
      allocate (number(size(active)), source=0)
      allocate (first(n_pairs + 1), pair_of(n))
      number(row) = [(i, i=1, n)]
      first(1) = 1
      do k = 1, n_pairs
        first(k + 1) = first(k) + count(active(pair_first(k):pair_first(k + 1) - 1))
        pair_of(first(k):first(k + 1) - 1) = k
      end do
    end associate
    call couple_pairs(problem, n_pairs, coupled)
    call order_pairs(coupled, order, error)
    if (allocated(error)) return
    permutation = [((i, i=first(order(k)), first(order(k) + 1) - 1), k=1, n_pairs)]

    ! Column j has the rows of its own pair from j on, then all rows of the later pairs that are coupled to it.
    matrix%n = n
    allocate (matrix%column_start(n + 1))
    matrix%column_start(1) = 0
    do j = 1, n
      k = pair_of(j)
      base = first(k + 1) - j
      do l = k + 1, n_pairs
        if (coupled(l, k)) base = base + first(l + 1) - first(l)
      end do
      matrix%column_start(j + 1) = matrix%column_start(j) + base
    end do
    allocate (matrix%row(matrix%column_start(n + 1)), matrix%value(matrix%column_start(n + 1)))
    matrix%value = 0
    do j = 1, n
      base = matrix%column_start(j)
      do l = pair_of(j), n_pairs
        if (.not. coupled(l, pair_of(j))) cycle
        do i = max(j, first(l)), first(l + 1) - 1
          base = base + 1
          matrix%row(base) = i - 1
        end do
      end do
    end do
    allocate (offset(n_pairs))
    do b = 1, size(problem%operator%block)
      associate (body => compliance%body(b), rows => problem%operator%block(b)%row(compliance%body(b)%row))
        do l = 1, body%n
          j = number(rows(l))
          if (j == 0) cycle
          ! Place of active point i of pair k in column j: column_start + offset(k) + i.
          base = matrix%column_start(j)
          do k = pair_of(j), n_pairs
            if (.not. coupled(k, pair_of(j))) cycle
            offset(k) = int(base - matrix%column_start(j)) - max(j, first(k)) + 1
            base = base + first(k + 1) - max(j, first(k))
          end do
          call add_column(rows, number, pair_of, offset, j, body%value(:, l), &
                          matrix%value(matrix%column_start(j) + 1:matrix%column_start(j + 1)))
        end do
      end associate
    end do
  end subroutine assemble

  !> Add one column of a body's compliance.
  pure subroutine add_column(rows, number, pair_of, offset, j, column, value)
    !> Rows of the body; their numbers among the active ones, 0 where they are not; the pairs of those.
    integer, intent(in) :: rows(:), number(:), pair_of(:)
    !> See `assemble`.
    integer, intent(in) :: offset(:)
    !> Number of the column.
    integer, intent(in) :: j
    real(dp), intent(in) :: column(:)
    real(dp), intent(inout) :: value(:)
    integer :: i, m
    do m = 1, size(rows)
      i = number(rows(m))
      if (i < j) cycle
      value(offset(pair_of(i)) + i) = value(offset(pair_of(i)) + i) + column(m)
    end do
  end subroutine add_column

  !> The Schur complement of the border and its pseudo-inverse.
  subroutine eliminate_border(self, problem, error)
    type(direct_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: schur(:, :)
    integer :: n, r, i
    n = size(self%row)
    r = problem%coarse%n
    allocate (self%g(n, r))
    call problem%coarse%rows(self%row, self%g)
    self%x = self%g
    if (n > 0 .and. r > 0) call self%factor%solve_block(self%x)
    schur = matmul(transpose(self%g), self%x)
    do i = 1, r
      schur(i, i) = schur(i, i) + self%hold(i)
    end do
    call problem%coarse%invert(schur, self%schur_inverse, self%null_motion, error)
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
      step = r_b
      call self%factor%solve(step)
      step_alpha = matmul(self%schur_inverse, r_c - matmul(step, self%g))
      step = step + matmul(self%x, step_alpha)
      all_forces(self%row) = lambda + step
      call compliance%multiply(problem, all_forces, z)
      r_b = b - z(self%row) - self%layer*(lambda + step) + matmul(self%g, alpha + step_alpha)
      r_c = c - matmul(lambda + step, self%g) - self%hold*(alpha + step_alpha)
      residual = sum(r_b**2/self%diagonal)
      ! Rounding errors do not get smaller.
      if (k > 1 .and. .not. residual < previous) exit
      lambda = lambda + step
      alpha = alpha + step_alpha
      if (.not. residual < 0.1_dp*previous) exit
      previous = residual
    end do
  end subroutine direct_system_solve

  !> Give all memory back.
  subroutine direct_system_destroy(self)
    class(direct_system_t), intent(inout) :: self
    call self%factor%destroy()
    if (allocated(self%row)) deallocate (self%row)
    if (allocated(self%null_motion)) deallocate (self%null_motion)
    if (allocated(self%diagonal)) deallocate (self%diagonal)
    if (allocated(self%hold)) deallocate (self%hold)
    if (allocated(self%layer)) deallocate (self%layer)
    if (allocated(self%g)) deallocate (self%g)
    if (allocated(self%x)) deallocate (self%x)
    if (allocated(self%schur_inverse)) deallocate (self%schur_inverse)
  end subroutine direct_system_destroy
end module dotyk_scheme_direct_system
