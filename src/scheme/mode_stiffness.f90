!> A symmetric positive definite matrix on the rigid body modes of many bodies: a block for each body and for each
!> couple of coupled bodies, factorized by CHOLMOD in the order of a nested dissection of the bodies.
module dotyk_scheme_mode_stiffness
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_clique_matrix, only: make_clique_graph
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private

  !> The matrix and its factor. It owns a factor: never copy it, destroy it in the end.
  type, public :: mode_stiffness_t
    integer, allocatable, private :: first(:)  !! Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    !> Bodies after b that couple to it, ascending: later(start(b):start(b+1)-1) (n_bodies + 1).
    integer, allocatable, private :: start(:)
    integer, allocatable, private :: later(:)  !! See `start`.
    !> Modes of the bodies in `later` before each, in the columns of b (as `later`).
    integer, allocatable, private :: before(:)
    type(sparse_symmetric_t), private :: matrix  !! The matrix [force/length].
    type(cholesky_t), private :: factor  !! Its factor.
  contains
    procedure :: init => modes_init
    procedure :: clear => modes_clear
    procedure :: add => modes_add
    procedure :: factorize => modes_factorize
    procedure :: solve => modes_solve
    procedure :: destroy => modes_destroy
  end type mode_stiffness_t

contains

  !> Structure of the matrix, its entries 0.
  subroutine modes_init(self, first, list_start, member, error)
    class(mode_stiffness_t), intent(inout) :: self
    integer, intent(in) :: first(:)  !! Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    !> Lists of bodies that are coupled to each other: member(list_start(l):list_start(l+1)-1) (n_lists + 1).
    integer, intent(in) :: list_start(:), member(:)
    type(error_t), allocatable, intent(out) :: error  !! METIS or CHOLMOD has no memory.
    integer, allocatable :: graph_start(:), neighbour(:), body_order(:), order(:)
    logical, allocatable :: couples(:)
    integer :: b, i, j, k, l, n_bodies, n
    integer(int64) :: at
    call self%destroy()
    n_bodies = size(first) - 1
    n = first(n_bodies + 1) - 1
    self%first = first
    call make_clique_graph(list_start, member, n_bodies, graph_start, neighbour)
    allocate (body_order(n_bodies), self%start(n_bodies + 1), couples(n_bodies))
    call nested_dissection(graph_start, neighbour, body_order, error, weight=max(1, first(2:) - first(:n_bodies)))
    if (allocated(error)) return
    allocate (order(n), self%later(size(neighbour)), self%before(size(neighbour)))
    k = 0
    do i = 1, n_bodies
      do j = first(body_order(i)), first(body_order(i) + 1) - 1
        k = k + 1
        order(k) = j
      end do
    end do
    couples = .false.
    self%start(1) = 1
    do b = 1, n_bodies
      associate (near => neighbour(graph_start(b):graph_start(b + 1) - 1))
        couples(near) = .true.
        k = self%start(b)
        l = 0
        do i = 1, size(near)
          associate (c => self%later(k))
            ! Ascending, as `near` need not be.
            c = next_body(couples, merge(b, self%later(max(1, k - 1)), k == self%start(b)))
            if (c == 0) exit
            self%before(k) = l
            l = l + first(c + 1) - first(c)
          end associate
          k = k + 1
        end do
        couples(near) = .false.
      end associate
      self%start(b + 1) = k
    end do
    self%matrix%n = n
    allocate (self%matrix%column_start(n + 1))
    self%matrix%column_start(1) = 0
    do b = 1, n_bodies
      l = sum([(first(self%later(k) + 1) - first(self%later(k)), k=self%start(b), self%start(b + 1) - 1)])
      do j = first(b), first(b + 1) - 1
        self%matrix%column_start(j + 1) = self%matrix%column_start(j) + first(b + 1) - j + l
      end do
    end do
    allocate (self%matrix%row(self%matrix%column_start(n + 1)))
    do b = 1, n_bodies
      do j = first(b), first(b + 1) - 1
        at = self%matrix%column_start(j)
        do i = j, first(b + 1) - 1
          at = at + 1
          self%matrix%row(at) = i - 1
        end do
        do k = self%start(b), self%start(b + 1) - 1
          do i = first(self%later(k)), first(self%later(k) + 1) - 1
            at = at + 1
            self%matrix%row(at) = i - 1
          end do
        end do
      end do
    end do
    allocate (self%matrix%value(size(self%matrix%row)), source=0.0_dp)
    call self%factor%analyze(self%matrix, order, error)
  end subroutine modes_init

  !> The next body after b that is marked; 0 if there is none.
  pure integer function next_body(marked, b) result(next)
    logical, intent(in) :: marked(:)  !! (n_bodies)
    integer, intent(in) :: b  !! The body.
    next = findloc(marked(b + 1:), .true., 1)
    if (next > 0) next = next + b
  end function next_body

  !> All entries 0 again.
  subroutine modes_clear(self)
    class(mode_stiffness_t), intent(inout) :: self
    self%matrix%value = 0
  end subroutine modes_clear

  !> Add a block.
  subroutine modes_add(self, b, c, value)
    class(mode_stiffness_t), intent(inout) :: self
    integer, intent(in) :: b, c  !! The bodies of its rows and columns: the same, or coupled.
    real(dp), intent(in) :: value(:, :)  !! (modes of b, modes of c) [force/length]
    integer :: i, j, k
    integer(int64) :: at
    if (size(value) == 0) return
    if (b < c) then
      call self%add(c, b, transpose(value))
      return
    end if
    if (b == c) then
      do j = 1, size(value, 2)
        at = self%matrix%column_start(self%first(b) + j - 1) + 1 - j
        do i = j, size(value, 1)
          self%matrix%value(at + i) = self%matrix%value(at + i) + value(i, j)
        end do
      end do
      return
    end if
    k = self%start(c) - 1 + findloc(self%later(self%start(c):self%start(c + 1) - 1), b, 1)
    do j = 1, size(value, 2)
      at = self%matrix%column_start(self%first(c) + j - 1) + self%first(c + 1) - self%first(c) - j + 1 + self%before(k)
      do i = 1, size(value, 1)
        self%matrix%value(at + i) = self%matrix%value(at + i) + value(i, j)
      end do
    end do
  end subroutine modes_add

  !> Factorize.
  subroutine modes_factorize(self, is_singular, error)
    class(mode_stiffness_t), intent(inout) :: self
    logical, intent(out) :: is_singular  !! Whether the matrix is not positive definite.
    type(error_t), allocatable, intent(out) :: error  !! CHOLMOD has no memory.
    integer :: failed
    call self%factor%factorize(self%matrix, failed, error)
    is_singular = failed > 0
  end subroutine modes_factorize

  !> Solve.
  subroutine modes_solve(self, x)
    class(mode_stiffness_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:)  !! Right-hand side [force], then solution (n_modes) [length].
    if (size(x) > 0) call self%factor%solve(x)
  end subroutine modes_solve

  !> Free all memory.
  subroutine modes_destroy(self)
    class(mode_stiffness_t), intent(inout) :: self
    call self%factor%destroy()
    call self%matrix%destroy()
    if (allocated(self%first)) deallocate (self%first)
    if (allocated(self%start)) deallocate (self%start)
    if (allocated(self%later)) deallocate (self%later, self%before)
  end subroutine modes_destroy
end module dotyk_scheme_mode_stiffness
