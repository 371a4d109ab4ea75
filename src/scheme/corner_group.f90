!> The corner spaces of bodies as the contact of p-multigrid sees them: a group is a body, or several bodies that ties
!> join.
!>
!> Ties are closed in the corner space of their group, by the factor of `K_c + E^T W E`: K_c the stiffness of the corner
!> spaces of its bodies, E = B P the tied rows on them, of the stiffness W. Such a group is like one body: it has the
!> rigid body motions that its ties leave, contact rows, and their compliance.
module dotyk_scheme_corner_group
  use dotyk_base_error, only: add_context, error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: half_digits, rounding
  use dotyk_linalg_dense, only: orthonormal_range, symmetric_eigen
  use dotyk_linalg_ordered_solve, only: ordered_solve_t
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_linalg_springs, only: add_springs, choose_fixing_equations
  use dotyk_response_corner_compliance, only: form_corner_compliance
  use dotyk_response_direct, only: direct_response_t, remove_modes
  use dotyk_response_multigrid, only: least_shared
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_gap_closing, only: find_neighbours
  use dotyk_scheme_grid_body, only: body_vector_t, grid_body_t, grid_pointer_t
  implicit none
  private

  !> A group. It may own a factor: never copy it, destroy it in the end.
  type, public :: corner_group_t
    integer, allocatable :: body(:)  !! Its bodies, ascending.
    integer, allocatable :: row(:)  !! Its contact rows.
    !> Compliance of its contact rows in the corner space, B P K_c^+ P^T B^T; not allocated where it is that of another
    !> group (n, n) [length/force].
    real(dp), allocatable :: compliance(:, :)
    !> The group that has the compliance: this one, or one of a congruent body with the same rows.
    integer :: owner = 0
    integer, allocatable :: mode(:)  !! Rigid body modes of its bodies.
    integer, allocatable, private :: block(:)  !! Bodies of the QP that have these modes.
    !> Rigid body motions that ties leave, in amplitudes of these; not allocated where they are these (n,
    !> n_modes) [].
    real(dp), allocatable :: combination(:, :)
    integer :: n_modes = 0  !! Number of such motions.
    real(dp), allocatable :: row_mode(:, :)  !! Displacements of the contact rows by them (n, n_modes) [].
    logical :: is_tied = .false.  !! Whether it has tied rows: a factor of its own.
    integer, allocatable, private :: first(:)  !! Unknowns of its k-th body are first(k)+1 .. first(k+1).
    type(direct_response_t), private :: response  !! Factor of K_c + E^T W E.
    type(ordered_solve_t), private :: ordered  !! Its solves in a cycle.
  contains
    procedure :: init => group_init
    procedure :: init_tied => group_init_tied
    procedure :: solve => group_solve
    procedure :: entries => group_entries
    procedure :: to_modes => group_to_modes
    procedure :: from_modes => group_from_modes
    procedure :: keep_motions => group_keep_motions
    procedure :: gather_springs => group_gather_springs
    procedure :: destroy => group_destroy
  end type corner_group_t

contains

  !> A body that no tie joins to others.
  subroutine group_init(self, b, body, first_mode)
    class(corner_group_t), intent(inout) :: self
    integer, intent(in) :: b  !! The body.
    type(grid_body_t), intent(in) :: body  !! With its rows on both levels.
    integer, intent(in) :: first_mode  !! Number of modes of the bodies before it.
    integer :: k
    self%body = [b]
    self%block = [body%block]
    self%row = body%row
    self%n_modes = size(body%rows%mode, 2)
    self%mode = [(first_mode + k, k=1, self%n_modes)]
    self%row_mode = body%rows%mode
  end subroutine group_init

  !> Bodies that ties join.
  subroutine group_init_tied(self, member, body, grid, first_mode, is_tied, stiffness, error)
    class(corner_group_t), intent(inout) :: self
    integer, intent(in) :: member(:)  !! The bodies, ascending.
    type(grid_body_t), intent(in) :: body(:)  !! All bodies (n_bodies).
    type(grid_pointer_t), intent(in) :: grid(:)  !! p-multigrids of the representatives (n_bodies).
    integer, intent(in) :: first_mode(:)  !! Modes of body b are first_mode(b)+1 .. first_mode(b+1).
    logical, intent(in) :: is_tied(:)  !! Rows of ties (n_rows).
    real(dp), intent(in) :: stiffness(:)  !! W of tied rows, 0 of contact rows (n_rows) [force/length].
    !> Allocated where the ties leave a motion of a corner space that is none of a rigid body, or memory runs out.
    type(error_t), allocatable, intent(out) :: error
    type(sparse_rows_t) :: tie, contact
    type(sparse_symmetric_t) :: matrix
    integer :: k, j
    self%is_tied = .true.
    self%body = member
    allocate (self%first(size(member) + 1), source=0)
    self%mode = [integer ::]
    self%block = [integer ::]
    do k = 1, size(member)
      ! Shortenings of bolts follow their body.
      if (.not. any(self%block == body(member(k))%block)) self%block = [self%block, body(member(k))%block]
      associate (b => member(k))
        self%first(k + 1) = self%first(k) + grid(body(b)%representative)%p%interpolation%n
        self%mode = [self%mode, (j, j=first_mode(b) + 1, first_mode(b + 1))]
      end associate
    end do
    call gather_rows(self, body, .not. is_tied, spread(1.0_dp, 1, size(stiffness)), contact, self%row)
    call find_motions(self, body, first_mode, stiffness)
    block
      integer, allocatable :: tied(:)
      call gather_rows(self, body, stiffness > 0, sqrt(stiffness), tie, tied)
    end block
    call find_corner_modes(self, body, grid, tie, self%response%mode, error)
    if (allocated(error)) return
    call add_up(self, body, grid, tie, matrix)
    call factorize(self, matrix, error)
    if (.not. allocated(error)) then
      if (size(self%row) > 0) call self%response%prepare_substitution()
      call form_corner_compliance(self%response, contact, self%compliance)
    end if
    if (allocated(error)) call add_context(error, 'multigrid, corner space of tied bodies: ')
  end subroutine group_init_tied

  !> Some rows over the corner spaces of the bodies, one after the other.
  subroutine gather_rows(self, body, chosen, factor, rows, row)
    type(corner_group_t), intent(in) :: self  !! The group with its bodies.
    type(grid_body_t), intent(in) :: body(:)  !! All bodies (n_bodies).
    logical, intent(in) :: chosen(:)  !! Rows to take, where they are rows of the group (n_rows).
    real(dp), intent(in) :: factor(:)  !! Factors of the rows (n_rows) [any].
    type(sparse_rows_t), intent(out) :: rows  !! The rows.
    integer, allocatable, intent(out) :: row(:)  !! Their numbers among all rows.
    integer, allocatable :: number(:), at(:), column(:)
    real(dp), allocatable :: value(:)
    logical, allocatable :: is_own(:)
    integer :: i, j, k, n
    allocate (is_own(size(chosen)), source=.false.)
    n = 0
    do k = 1, size(self%body)
      associate (own => body(self%body(k)))
        is_own(own%row) = chosen(own%row)
        n = n + size(own%rows%corner%column)
      end associate
    end do
    row = pack([(i, i=1, size(chosen))], is_own)
    allocate (number(size(chosen)), source=0)
    number(row) = [(i, i=1, size(row))]
    allocate (at(n), column(n), value(n))
    n = 0
    do k = 1, size(self%body)
      associate (own => body(self%body(k)), matrix => body(self%body(k))%rows%corner)
        do i = 1, own%rows%n
          if (number(own%row(i)) == 0) cycle
          do j = matrix%row_start(i), matrix%row_start(i + 1) - 1
            n = n + 1
            at(n) = number(own%row(i))
            column(n) = self%first(k) + matrix%column(j)
            value(n) = factor(own%row(i))*matrix%value(j)
          end do
        end do
      end associate
    end do
    call rows%init_from_triplets(size(row), self%first(size(self%first)), at(:n), column(:n), value(:n))
  end subroutine gather_rows

  !> The rigid body motions that the ties leave, and how they move the contact rows.
  subroutine find_motions(self, body, first_mode, stiffness)
    type(corner_group_t), intent(inout) :: self  !! The group with its bodies and contact rows.
    type(grid_body_t), intent(in) :: body(:)  !! All bodies (n_bodies).
    integer, intent(in) :: first_mode(:)  !! Modes of body b are first_mode(b)+1 .. first_mode(b+1).
    real(dp), intent(in) :: stiffness(:)  !! W of tied rows, 0 of contact rows (n_rows) [force/length].
    real(dp), allocatable :: moved(:, :)
    integer :: i, k, n
    allocate (moved(size(stiffness), size(self%mode)), source=0.0_dp)
    n = 0
    do k = 1, size(self%body)
      associate (b => self%body(k), own => body(self%body(k)))
        do i = 1, own%rows%n
          associate (at => moved(own%row(i), n + 1:n + first_mode(b + 1) - first_mode(b)))
            at = at + own%rows%mode(i, :)
          end associate
        end do
        n = n + first_mode(b + 1) - first_mode(b)
      end associate
    end do
    call null_space(moved(pack([(i, i=1, size(stiffness))], stiffness > 0), :), self%combination)
    self%n_modes = size(self%combination, 2)
    self%row_mode = matmul(moved(self%row, :), self%combination)
  end subroutine find_motions

  !> The null space of displacements by modes, each of these scaled by the displacements that it causes.
  subroutine null_space(moved, combination)
    real(dp), intent(in) :: moved(:, :)  !! Displacements of tied rows by modes (n_rows, n) [].
    real(dp), allocatable, intent(out) :: combination(:, :)  !! Amplitudes of the modes (n, any number) [].
    type(error_t), allocatable :: error
    real(dp), allocatable :: a(:, :), values(:), vectors(:, :), scale(:)
    integer :: i, n
    n = size(moved, 2)
    allocate (a(n, n), values(n), vectors(n, n))
    a = matmul(transpose(moved), moved)
    scale = [(merge(sqrt(a(i, i)), 1.0_dp, a(i, i) > 0), i=1, n)]
    a = a/spread(scale, 1, n)/spread(scale, 2, n)
    values = 1
    if (n > 0) call symmetric_eigen(a, values, vectors, error)
    associate (m => count(values < rounding))
      combination = vectors(:, :m)/spread(scale, 2, m)
    end associate
  end subroutine null_space

  !> The null vectors of K_c + E^T W E, orthonormal: motions of the corner spaces that the ties leave.
  subroutine find_corner_modes(self, body, grid, tie, mode, error)
    type(corner_group_t), intent(in) :: self  !! The group with its bodies.
    type(grid_body_t), intent(in) :: body(:)  !! All bodies (n_bodies).
    type(grid_pointer_t), intent(in) :: grid(:)  !! p-multigrids of the representatives (n_bodies).
    type(sparse_rows_t), intent(in) :: tie  !! The tied rows over the corner spaces.
    real(dp), allocatable, intent(out) :: mode(:, :)  !! (n, any number) [].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a p-multigrid has no such matrix.
    type(sparse_symmetric_t), pointer :: matrix
    real(dp), pointer :: own(:, :)
    real(dp), allocatable :: all_modes(:, :), moved(:, :), combination(:, :), left(:, :)
    integer :: k, j, n, rank
    n = 0
    do k = 1, size(self%body)
      call grid(body(self%body(k))%representative)%p%get_corner_matrix(matrix, own)
      if (.not. associated(matrix)) then
        call set_error(error, 'its stiffness is not there', exit_not_solvable)
        return
      end if
      n = n + size(own, 2)
    end do
    allocate (all_modes(self%first(size(self%first)), n), source=0.0_dp)
    n = 0
    do k = 1, size(self%body)
      call grid(body(self%body(k))%representative)%p%get_corner_matrix(matrix, own)
      all_modes(self%first(k) + 1:self%first(k + 1), n + 1:n + size(own, 2)) = own
      n = n + size(own, 2)
    end do
    allocate (moved(tie%n_rows, n))
    do j = 1, n
      call tie%multiply(all_modes(:, j), moved(:, j))
    end do
    call null_space(moved, combination)
    left = matmul(all_modes, combination)
    allocate (mode(size(left, 1), size(left, 2)))
    call orthonormal_range(left, half_digits, mode, rank)
    mode = mode(:, :rank)
  end subroutine find_corner_modes

  !> K_c + E^T W E.
  subroutine add_up(self, body, grid, tie, matrix)
    type(corner_group_t), intent(in) :: self  !! The group with its bodies.
    type(grid_body_t), intent(in) :: body(:)  !! All bodies (n_bodies).
    type(grid_pointer_t), intent(in) :: grid(:)  !! p-multigrids of the representatives (n_bodies).
    type(sparse_rows_t), intent(in) :: tie  !! Tied rows over the corner spaces, times the roots of W.
    type(sparse_symmetric_t), intent(out) :: matrix  !! The sum.
    type(sparse_rows_t) :: transposed, product, lower
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
    type(sparse_symmetric_t), pointer :: of_corners
    real(dp), pointer :: own(:, :)
    integer(int64) :: m
    integer :: i, j, k, l, n
    allocate (row(size(tie%column)))
    do i = 1, tie%n_rows
      row(tie%row_start(i):tie%row_start(i + 1) - 1) = i
    end do
    call transposed%init_from_triplets(tie%n_columns, tie%n_rows, tie%column, row, tie%value)
    call product%set_product(transposed, tie)
    n = count(product%column >= [((i, l=product%row_start(i), product%row_start(i + 1) - 1), i=1, product%n_rows)])
    do k = 1, size(self%body)
      call grid(body(self%body(k))%representative)%p%get_corner_matrix(of_corners, own)
      n = n + size(of_corners%row)
    end do
    deallocate (row)
    allocate (row(n), column(n), value(n))
    n = 0
    do i = 1, product%n_rows
      do l = product%row_start(i), product%row_start(i + 1) - 1
        if (product%column(l) < i) cycle
        n = n + 1
        row(n) = i
        column(n) = product%column(l)
        value(n) = product%value(l)
      end do
    end do
    call product%destroy()
    do k = 1, size(self%body)
      call grid(body(self%body(k))%representative)%p%get_corner_matrix(of_corners, own)
      do j = 1, of_corners%n
        do m = of_corners%column_start(j) + 1, of_corners%column_start(j + 1)
          n = n + 1
          row(n) = self%first(k) + j
          column(n) = self%first(k) + int(of_corners%row(m)) + 1
          value(n) = of_corners%value(m)
        end do
      end do
    end do
    ! Columns of the lower triangle are rows of the upper one.
    call lower%init_from_triplets(self%first(size(self%first)), self%first(size(self%first)), row, column, value)
    deallocate (row, column, value)
    matrix%n = lower%n_rows
    matrix%column_start = int(lower%row_start, int64) - 1
    matrix%row = int(lower%column, int64) - 1
    call move_alloc(lower%value, matrix%value)
  end subroutine add_up

  !> Factorize, with springs against the motions that the ties leave.
  subroutine factorize(self, matrix, error)
    type(corner_group_t), intent(inout) :: self  !! The group with its corner modes.
    type(sparse_symmetric_t), intent(inout) :: matrix  !! K_c + E^T W E; empty on return.
    type(error_t), allocatable, intent(out) :: error  !! As in `init_tied`.
    integer, allocatable :: start(:), neighbour(:), order(:)
    real(dp), allocatable :: spring(:)
    integer :: failed
    call choose_fixing_equations(self%response%mode, self%response%fixing_equation)
    call find_neighbours(matrix, start, neighbour)
    allocate (order(matrix%n))
    call nested_dissection(start, neighbour, order, error)
    deallocate (start, neighbour)
    if (.not. allocated(error)) call self%response%factor%analyze(matrix, order, error)
    if (allocated(error)) return
    call add_springs(matrix, self%response%fixing_equation, spring)
    call self%response%factor%factorize_and_discard(matrix, failed, error)
    if (.not. allocated(error) .and. failed > 0) call set_error(error, 'it is not positive definite', exit_not_solvable)
    if (allocated(error)) return
    if (self%response%factor%factor_entries > least_shared) call self%ordered%init(self%response%factor)
  end subroutine factorize

  !> x := (K_c + E^T W E)^+ x in the corner spaces of tied bodies.
  subroutine group_solve(self, x)
    class(corner_group_t), intent(in) :: self
    type(body_vector_t), intent(inout) :: x(:)  !! Forces in, displacements out, of all bodies (n_bodies).
    real(dp), allocatable :: all_of_them(:)
    integer :: k
    allocate (all_of_them(self%first(size(self%first))))
    do k = 1, size(self%body)
      all_of_them(self%first(k) + 1:self%first(k + 1)) = x(self%body(k))%value
    end do
    if (self%ordered%n == 0) then
      call self%response%solve(all_of_them)
    else
      call remove_modes(self%response%mode, all_of_them)
      call self%ordered%solve(all_of_them)
      call remove_modes(self%response%mode, all_of_them)
    end if
    do k = 1, size(self%body)
      x(self%body(k))%value = all_of_them(self%first(k) + 1:self%first(k + 1))
    end do
  end subroutine group_solve

  !> Entries of the factor of tied bodies.
  pure real(dp) function group_entries(self) result(entries)
    class(corner_group_t), intent(in) :: self
    entries = real(self%response%factor%factor_entries, dp)
  end function group_entries

  !> Resultants on the motions from those on the modes of the bodies.
  pure function group_to_modes(self, e) result(of_group)
    class(corner_group_t), intent(in) :: self
    real(dp), intent(in) :: e(:)  !! On all modes of all bodies [force].
    real(dp) :: of_group(self%n_modes)  !! (n_modes) [force]
    if (allocated(self%combination)) then
      of_group = matmul(e(self%mode), self%combination)
    else
      of_group = e(self%mode)
    end if
  end function group_to_modes

  !> Amplitudes of the modes of the bodies from those of the motions.
  pure subroutine group_from_modes(self, of_group, alpha)
    class(corner_group_t), intent(in) :: self
    real(dp), intent(in) :: of_group(:)  !! (n_modes) [length]
    real(dp), intent(inout) :: alpha(:)  !! Of all modes of all bodies; those of the group are set [length].
    if (allocated(self%combination)) then
      alpha(self%mode) = matmul(self%combination, of_group)
    else
      alpha(self%mode) = of_group
    end if
  end subroutine group_from_modes

  !> Keep, of resultants on the modes of the bodies, those on the motions that the ties leave.
  pure subroutine group_keep_motions(self, e)
    class(corner_group_t), intent(in) :: self
    real(dp), intent(inout) :: e(:)  !! On all modes of all bodies; those of the group are changed [force].
    real(dp) :: q(size(self%mode), size(self%mode))
    integer :: rank
    if (.not. allocated(self%combination)) return
    call orthonormal_range(self%combination, half_digits, q, rank)
    e(self%mode) = matmul(q(:, :rank), matmul(e(self%mode), q(:, :rank)))
  end subroutine group_keep_motions

  !> Springs on the motions from those on the modes of the bodies.
  pure subroutine group_gather_springs(self, spring, of_group)
    class(corner_group_t), intent(in) :: self
    type(mode_block_t), intent(in) :: spring(:)  !! T, block by block over all modes [force/length].
    real(dp), allocatable, intent(out) :: of_group(:, :)  !! (n_modes, n_modes) [force/length]
    real(dp), allocatable :: t(:, :)
    integer :: k, m, n
    if (.not. allocated(self%combination)) then
      of_group = spring(self%block(1))%value
      return
    end if
    allocate (t(size(self%mode), size(self%mode)), source=0.0_dp)
    n = 0
    do k = 1, size(self%block)
      m = size(spring(self%block(k))%value, 1)
      t(n + 1:n + m, n + 1:n + m) = spring(self%block(k))%value
      n = n + m
    end do
    of_group = matmul(transpose(self%combination), matmul(t, self%combination))
  end subroutine group_gather_springs

  !> Give back all memory.
  subroutine group_destroy(self)
    class(corner_group_t), intent(inout) :: self
    call self%ordered%destroy()
    call self%response%destroy()
  end subroutine group_destroy
end module dotyk_scheme_corner_group
