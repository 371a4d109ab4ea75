!> The active contact rows in the preconditioner of `dotyk_scheme_contact_multigrid`: factors of W^{-1} + C for the
!> smoother, where C is sparse, and for the corner space, where C is dense and rigid body modes of floating bodies
!> stand beside.
module dotyk_scheme_active_rows
  use dotyk_base_error, only: add_context, error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: half_digits, sum_rounding
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_dense_cholesky, only: dense_cholesky_t
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_scheme_body_grids, only: body_grids_t
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_proximal_system, only: mode_factor_t
  implicit none
  private

  type, public :: active_rows_t  !! The factors. They own memory of CHOLMOD: never copy them, destroy them in the end.
    integer, allocatable :: row(:)  !! Active rows, ascending.
    !> Active contact rows, ascending: the corner space has ties by itself (n).
    integer, allocatable, private :: contact(:)
    !> Sum of B D^{-1} B^T over the bodies, lower triangle (n_rows, n_rows) [length/force].
    type(sparse_symmetric_t) :: sum
    type(cholesky_t), private :: smoother  !! Of W^{-1} + B D^{-1} B^T; inactive rows are decoupled.
    type(dense_cholesky_t), private :: corner  !! Of W^{-1} + B P K_c^+ P^T B^T on the active contact rows.
    !> Motions of the groups at the active contact rows, G (n, n_motions) [].
    real(dp), allocatable, private :: mode(:, :)
    !> Stiffness of these by contact, G^T (W^{-1} + C)^{-1} G (n_motions, n_motions) [force/length].
    real(dp), allocatable, private :: mode_stiffness(:, :)
    !> That of the rigid body modes by all active rows alone, G^T W G (n_modes, n_modes) [force/length].
    real(dp), allocatable, private :: row_stiffness(:, :)
    type(mode_factor_t), private :: mode_factor, row_factor  !! Of both with springs.
  contains
    procedure :: set => rows_set
    procedure :: set_springs => rows_set_springs
    procedure :: solve_smoother => rows_solve_smoother
    procedure :: solve_corner => rows_solve_corner
    procedure :: solve_modes => rows_solve_modes
    procedure :: destroy => rows_destroy
  end type active_rows_t

contains

  !> Choose the active rows and their stiffness.
  subroutine rows_set(self, grids, stiffness, error)
    class(active_rows_t), intent(inout) :: self
    class(body_grids_t), intent(in) :: grids  !! The bodies; the same in each call.
    real(dp), intent(in) :: stiffness(:)  !! W; zero where not active (n_rows) [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or memory runs out.
    integer :: i
    self%row = pack([(i, i=1, size(stiffness))], stiffness > 0)
    self%contact = pack([(i, i=1, size(stiffness))], stiffness > 0 .and. .not. grids%is_tied)
    if (.not. allocated(self%sum%column_start)) call analyze_smoother(self, grids, error)
    if (.not. allocated(error)) call factorize_smoother(self, stiffness, error)
    if (.not. allocated(error)) call factorize_corner(self, grids, stiffness, error)
    if (.not. allocated(error)) call find_mode_stiffness(self, grids, stiffness)
    if (allocated(error)) call add_context(error, 'multigrid, active rows: ')
  end subroutine rows_set

  !> Add up B D^{-1} B^T, and order the rows.
  subroutine analyze_smoother(self, grids, error)
    type(active_rows_t), intent(inout) :: self  !! The factors.
    class(body_grids_t), intent(in) :: grids  !! The bodies.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where memory runs out.
    type(sparse_rows_t) :: all
    integer, allocatable :: row(:), column(:), start(:), neighbour(:), order(:)
    real(dp), allocatable :: value(:)
    integer(int64) :: n_lower
    integer :: b, i, k, n, n_all
    n = 0
    do b = 1, size(grids%body)
      n = n + size(grids%body(b)%rows%smoother%column)
    end do
    allocate (row(n), column(n), value(n))
    n = 0
    do b = 1, size(grids%body)
      associate (own => grids%body(b), matrix => grids%body(b)%rows%smoother)
        do i = 1, own%rows%n
          do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            n = n + 1
            row(n) = own%row(i)
            column(n) = own%row(matrix%column(k))
            value(n) = matrix%value(k)
          end do
        end do
      end associate
    end do
    ! Rows between held nodes have no entries.
    row = [row, (i, i=1, grids%n_rows)]
    column = [column, (i, i=1, grids%n_rows)]
    value = [value, (0.0_dp, i=1, grids%n_rows)]
    call all%init_from_triplets(grids%n_rows, grids%n_rows, row, column, value)
    deallocate (row, column, value)
    self%sum%n = grids%n_rows
    allocate (self%sum%column_start(grids%n_rows + 1), start(grids%n_rows + 1))
    n_all = size(all%column)
    n_lower = (n_all + grids%n_rows)/2
    allocate (self%sum%row(n_lower), self%sum%value(n_lower), neighbour(n_all - grids%n_rows))
    n_lower = 0
    n = 0
    do i = 1, grids%n_rows
      self%sum%column_start(i) = n_lower
      start(i) = n + 1
      do k = all%row_start(i), all%row_start(i + 1) - 1
        if (all%column(k) /= i) then
          n = n + 1
          neighbour(n) = all%column(k)
        end if
        if (all%column(k) < i) cycle
        n_lower = n_lower + 1
        self%sum%row(n_lower) = all%column(k) - 1
        self%sum%value(n_lower) = all%value(k)
      end do
    end do
    self%sum%column_start(grids%n_rows + 1) = n_lower
    start(grids%n_rows + 1) = n + 1
    allocate (order(grids%n_rows))
    call nested_dissection(start, neighbour, order, error)
    if (.not. allocated(error)) call self%smoother%analyze(self%sum, order, error)
  end subroutine analyze_smoother

  !> Factorize W^{-1} + C of the smoother. Inactive rows have the identity: the pattern stays.
  subroutine factorize_smoother(self, stiffness, error)
    type(active_rows_t), intent(inout) :: self  !! The factors.
    real(dp), intent(in) :: stiffness(:)  !! W (n_rows) [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite.
    type(sparse_symmetric_t) :: matrix
    real(dp) :: shift
    integer :: j, failed
    integer(int64) :: k
    if (size(self%row) == 0) return
    shift = 0
    do
      matrix = self%sum
      do j = 1, matrix%n
        do k = matrix%column_start(j) + 1, matrix%column_start(j + 1)
          if (.not. (stiffness(j) > 0 .and. stiffness(matrix%row(k) + 1) > 0)) matrix%value(k) = 0
        end do
        associate (diagonal => matrix%value(matrix%column_start(j) + 1))
          if (stiffness(j) > 0) then
            diagonal = (1 + shift)*diagonal + 1/stiffness(j)
          else
            diagonal = 1
          end if
        end associate
      end do
      call self%smoother%factorize_and_discard(matrix, failed, error)
      if (failed == 0 .or. allocated(error)) return
      shift = max(10*shift, sum_rounding)
      if (shift > half_digits) exit
    end do
    call set_error(error, 'the smoother is not positive definite', exit_not_solvable)
  end subroutine factorize_smoother

  !> Factorize W^{-1} + C of the corner space.
  subroutine factorize_corner(self, grids, stiffness, error)
    type(active_rows_t), intent(inout) :: self  !! The factors.
    class(body_grids_t), intent(in) :: grids  !! The bodies.
    real(dp), intent(in) :: stiffness(:)  !! W (n_rows) [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite.
    integer, allocatable :: number(:), last(:)
    real(dp) :: shift
    integer :: k, i, m, failed
    m = size(self%contact)
    allocate (number(grids%n_rows), source=0)
    number(self%contact) = [(i, i=1, m)]
    ! Rows of different pairs have bodies between them: pairs of a stack couple to their neighbours alone.
    last = [(i, i=1, m)]
    do k = 1, size(grids%group)
      associate (own => pack(number(grids%group(k)%row), number(grids%group(k)%row) > 0))
        if (size(own) > 0) last(own) = max(last(own), maxval(own))
      end associate
    end do
    shift = 0
    do
      call self%corner%resize(m)
      do k = 1, size(grids%group)
        call add_group(grids%group(k)%row, number, grids%group(grids%group(k)%owner)%compliance, m, self%corner%value)
      end do
      call add_diagonal(1/stiffness(self%contact), shift, m, self%corner%value)
      call self%corner%factorize(failed, last)
      if (failed == 0) return
      shift = max(10*shift, sum_rounding)
      if (shift > half_digits) exit
    end do
    call set_error(error, 'the corner space is not positive definite', exit_not_solvable)
  end subroutine factorize_corner

  !> Add the compliance of one group to the lower triangle.
  pure subroutine add_group(row, number, compliance, m, sum)
    integer, intent(in) :: row(:)  !! Contact rows of the group (n).
    integer, intent(in) :: number(:)  !! Number of each row among the active ones, 0 where not active (n_rows).
    real(dp), intent(in) :: compliance(:, :)  !! Of these rows (n, n) [length/force].
    integer, intent(in) :: m  !! Number of active rows.
    real(dp), intent(inout) :: sum(m, *)  !! The sum over groups (m, m) [length/force].
    integer, allocatable :: own(:)
    integer :: i, j, k, l
    own = pack([(i, i=1, size(row))], number(row) > 0)
    do j = 1, size(own)
      l = number(row(own(j)))
      do i = 1, size(own)
        k = number(row(own(i)))
        if (k >= l) sum(k, l) = sum(k, l) + compliance(own(i), own(j))
      end do
    end do
  end subroutine add_group

  !> Add to the diagonal.
  pure subroutine add_diagonal(added, shift, m, sum)
    real(dp), intent(in) :: added(:)  !! W^{-1} (m) [length/force].
    real(dp), intent(in) :: shift  !! Fraction of the diagonal to add [].
    integer, intent(in) :: m  !! Number of active rows.
    real(dp), intent(inout) :: sum(m, *)  !! The matrix (m, m) [length/force].
    integer :: i
    do i = 1, m
      sum(i, i) = (1 + shift)*sum(i, i) + added(i)
    end do
  end subroutine add_diagonal

  !> The stiffness of the modes by contact.
  subroutine find_mode_stiffness(self, grids, stiffness)
    type(active_rows_t), intent(inout) :: self  !! The factors.
    class(body_grids_t), intent(in) :: grids  !! The bodies.
    real(dp), intent(in) :: stiffness(:)  !! W (n_rows) [force/length].
    real(dp), allocatable :: solved(:, :)
    integer, allocatable :: number(:)
    integer :: b, i, k, n
    if (allocated(self%mode)) deallocate (self%mode)
    allocate (self%mode(size(self%contact), sum(grids%group%n_modes)), source=0.0_dp)
    allocate (number(grids%n_rows), source=0)
    number(self%contact) = [(i, i=1, size(self%contact))]
    n = 0
    do b = 1, size(grids%group)
      associate (own => grids%group(b))
        do i = 1, size(own%row)
          k = number(own%row(i))
          if (k > 0) self%mode(k, n + 1:n + own%n_modes) = self%mode(k, n + 1:n + own%n_modes) + own%row_mode(i, :)
        end do
        n = n + own%n_modes
      end associate
    end do
    allocate (solved, source=self%mode)
    if (n > 0) call self%corner%solve_lower(solved)
    self%mode_stiffness = matmul(transpose(solved), solved)
    deallocate (solved)
    n = grids%first_mode(size(grids%first_mode))
    allocate (solved(size(self%row), n), source=0.0_dp)
    number(self%row) = [(i, i=1, size(self%row))]
    do b = 1, size(grids%body)
      associate (own => grids%body(b), first => grids%first_mode(b) + 1, last => grids%first_mode(b + 1))
        do i = 1, own%rows%n
          k = number(own%row(i))
          if (k > 0) solved(k, first:last) = solved(k, first:last) + own%rows%mode(i, :)
        end do
      end associate
    end do
    solved = solved*spread(sqrt(stiffness(self%row)), 2, n)
    self%row_stiffness = matmul(transpose(solved), solved)
  end subroutine find_mode_stiffness

  !> Factorize the stiffness of the modes with springs.
  subroutine rows_set_springs(self, grids, spring, error)
    class(active_rows_t), intent(inout) :: self
    class(body_grids_t), intent(in) :: grids  !! The bodies, as in `set`.
    !> T by bodies; of size 0 for bodies without modes (n_bodies) [force/length].
    type(mode_block_t), intent(in) :: spring(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite.
    type(mode_block_t) :: of_group(size(grids%group))
    integer :: k
    do k = 1, size(of_group)
      call grids%group(k)%gather_springs(spring, of_group(k)%value)
    end do
    call self%mode_factor%init(self%mode_stiffness, of_group, error)
    if (.not. allocated(error)) call self%row_factor%init(self%row_stiffness, spring, error)
    if (allocated(error)) call add_context(error, 'multigrid, active rows: ')
  end subroutine rows_set_springs

  !> alpha := (G^T W G + T)^{-1} alpha.
  subroutine rows_solve_modes(self, alpha)
    class(active_rows_t), intent(in) :: self
    real(dp), intent(inout) :: alpha(:)  !! Resultants in [force], amplitudes out [length] (n_modes).
    call self%row_factor%solve(alpha)
  end subroutine rows_solve_modes

  !> lambda := (W^{-1} + B D^{-1} B^T)^{-1} lambda on the active rows; zero elsewhere.
  subroutine rows_solve_smoother(self, lambda)
    class(active_rows_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: lambda(:)  !! Displacements in [length], forces out [force] (n_rows).
    real(dp), allocatable :: own(:)
    own = lambda(self%row)
    lambda = 0
    lambda(self%row) = own
    if (size(own) > 0) call self%smoother%solve(lambda)
  end subroutine rows_solve_smoother

  !> Forces and amplitudes of (W^{-1} + C) lambda - G alpha = y, G^T lambda + T alpha = e, of the contact rows and the
  !> motions that ties leave.
  subroutine rows_solve_corner(self, grids, lambda, e, alpha)
    class(active_rows_t), intent(in) :: self
    class(body_grids_t), intent(in) :: grids  !! The bodies, as in `set`.
    !> Displacements y in [length], forces out, zero where not active and on ties [force] (n_rows).
    real(dp), intent(inout) :: lambda(:)
    real(dp), intent(in) :: e(:)  !! Resultants (n_modes) [force].
    real(dp), intent(out) :: alpha(:)  !! Amplitudes (n_modes) [length].
    real(dp), allocatable :: force(:), pushed(:), motion(:)
    integer :: k, n
    force = lambda(self%contact)
    lambda = 0
    call self%corner%solve(force)
    if (size(e) > 0) then
      allocate (motion(size(self%mode, 2)))
      n = 0
      do k = 1, size(grids%group)
        motion(n + 1:n + grids%group(k)%n_modes) = grids%group(k)%to_modes(e)
        n = n + grids%group(k)%n_modes
      end do
      motion(:) = motion - matmul(force, self%mode)
      call self%mode_factor%solve(motion)
      pushed = matmul(self%mode, motion)
      call self%corner%solve(pushed)
      force = force + pushed
      alpha = 0
      n = 0
      do k = 1, size(grids%group)
        call grids%group(k)%from_modes(motion(n + 1:n + grids%group(k)%n_modes), alpha)
        n = n + grids%group(k)%n_modes
      end do
    end if
    lambda(self%contact) = force
  end subroutine rows_solve_corner

  !> Give back all memory.
  subroutine rows_destroy(self)
    class(active_rows_t), intent(inout) :: self
    call self%smoother%destroy()
    call self%sum%destroy()
    if (allocated(self%row)) deallocate (self%row)
    if (allocated(self%corner%value)) deallocate (self%corner%value)
  end subroutine rows_destroy
end module dotyk_scheme_active_rows
