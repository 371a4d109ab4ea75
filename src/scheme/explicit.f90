!> Columns of the compliance C = B K^+ B^T, body by body, formed when they are needed.
!>
!> Column j of body b is the answer of its rows to a unit force at row j. Columns are formed by blocks of right-hand sides, which is
!> several times cheaper than one by one, and in parallel over bodies and blocks. A scheme needs the columns of the points that ever
!> were under pressure, no others.
module dotyk_scheme_explicit
  use dotyk_base_kinds, only: dp, int64
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_blas, only: blas_threads, set_blas_threads
  use dotyk_response_response, only: response_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> The columns of one body.
  type, public :: body_columns_t
    !> Number of columns.
    integer :: n = 0
    !> The first n are in use (n_rows of the block, capacity) [length/force].
    real(dp), allocatable :: value(:, :)
    !> Column of each row of the block, 0 where it has none (n_rows of the block), and the row of each column (capacity).
    integer, allocatable :: column(:), row(:)
  end type body_columns_t

  !> The columns of all bodies.
  type, public :: explicit_compliance_t
    !> (n_bodies).
    type(body_columns_t), allocatable :: body(:)
    !> True: no columns are formed, products are sweeps over all bodies.
    logical :: by_sweeps = .false.
  contains
    procedure :: init => explicit_init
    procedure :: form => explicit_form
    procedure :: multiply => explicit_multiply
    procedure :: diagonal => explicit_diagonal
    procedure :: bytes => explicit_bytes
  end type explicit_compliance_t

  !> One block of right-hand sides: columns first..last of a body.
  type :: task_t
    integer :: body = 0, first = 0, last = 0
  end type task_t

  !> Right-hand sides at a time, and equations times right-hand sides at most.
  integer, parameter :: block_size = 64

contains

  !> No columns yet.
  subroutine explicit_init(self, problem, by_sweeps)
    class(explicit_compliance_t), intent(out) :: self
    type(contact_problem_t), intent(in) :: problem
    !> Whether there will never be any.
    logical, intent(in) :: by_sweeps
    integer :: b, n
    self%by_sweeps = by_sweeps
    allocate (self%body(size(problem%operator%block)))
    do b = 1, size(self%body)
      n = size(problem%operator%block(b)%row)
      allocate (self%body(b)%value(n, 0), self%body(b)%row(0))
      allocate (self%body(b)%column(n), source=0)
    end do
  end subroutine explicit_init

  !> Form the columns of some rows, unless they are there.
  subroutine explicit_form(self, problem, wanted)
    class(explicit_compliance_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> Rows whose columns are needed (n_rows).
    logical, intent(in) :: wanted(:)
    type(task_t), allocatable :: task(:)
    integer :: b, i, k, n_old, n_tasks, n_blas, most
    if (self%by_sweeps) return
    allocate (task(sum([(size(problem%operator%block(b)%row)/block_size + 1, b=1, size(self%body))])))
    n_tasks = 0
    most = 0
    do b = 1, size(self%body)
      associate (body => self%body(b), row => problem%operator%block(b)%row)
        n_old = body%n
        call make_room(body, count(wanted(row) .and. body%column == 0))
        do i = 1, size(row)
          if (.not. wanted(row(i)) .or. body%column(i) > 0) cycle
          body%n = body%n + 1
          body%column(i) = body%n
          body%row(body%n) = i
        end do
        most = max(most, body%n - n_old)
        do k = n_old + 1, body%n, block_size
          n_tasks = n_tasks + 1
          task(n_tasks) = task_t(b, k, min(body%n, k + block_size - 1))
        end do
      end associate
    end do
    n_blas = blas_threads()
    if (n_tasks > 1) call set_blas_threads(1)
    !$omp parallel do default(none) shared(self, problem, task, n_tasks) private(b) schedule(dynamic, 1) if (n_tasks > 1)
    do i = 1, n_tasks
      b = task(i)%body
      call form_columns(problem%operator%block(b), problem%response(b)%form, self%body(b)%row(task(i)%first:task(i)%last), &
                        self%body(b)%value(:, task(i)%first:task(i)%last))
    end do
    !$omp end parallel do
    call set_blas_threads(n_blas)
    problem%body_solves = problem%body_solves + most
  end subroutine explicit_form

  !> Room for m more columns.
  subroutine make_room(body, m)
    type(body_columns_t), intent(inout) :: body
    integer, intent(in) :: m
    real(dp), allocatable :: value(:, :)
    integer, allocatable :: row(:)
    integer :: capacity
    if (body%n + m <= size(body%value, 2)) return
    ! The first request is nearly all that will ever be asked for; later ones are small.
    capacity = min(size(body%column), body%n + m + body%n/8)
    allocate (value(size(body%column), capacity), row(capacity))
    value(:, :body%n) = body%value(:, :body%n)
    row(:body%n) = body%row(:body%n)
    call move_alloc(value, body%value)
    call move_alloc(row, body%row)
  end subroutine make_room

  !> Columns of one body by one block of right-hand sides.
  subroutine form_columns(block, response, row, column)
    !> The body's rows of B.
    type(contact_block_t), intent(in) :: block
    class(response_t), intent(in) :: response
    !> Places of the unit forces among the body's rows (m).
    integer, intent(in) :: row(:)
    !> (n_rows, m).
    real(dp), intent(out) :: column(:, :)
    real(dp), allocatable :: force(:, :), displacement(:, :)
    integer :: j, k
    allocate (force(block%matrix%n_columns, size(row)), displacement(block%matrix%n_columns, size(row)))
    force = 0
    do j = 1, size(row)
      do k = block%matrix%row_start(row(j)), block%matrix%row_start(row(j) + 1) - 1
        force(block%matrix%column(k), j) = block%matrix%value(k)
      end do
    end do
    call response%apply_block(force, displacement)
    do j = 1, size(row)
      call block%matrix%multiply(displacement(:, j), column(:, j))
    end do
  end subroutine form_columns

  !> z = C lambda; forces only where there are columns.
  subroutine explicit_multiply(self, problem, lambda, z)
    class(explicit_compliance_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> Forces (n_rows), 0 where no column was formed [force].
    real(dp), intent(in) :: lambda(:)
    !> Normal displacements (n_rows) [length].
    real(dp), intent(out) :: z(:)
    real(dp), allocatable :: sum_of_columns(:)
    integer :: b, j
    if (self%by_sweeps) then
      call problem%compliance(lambda, z)
      return
    end if
    z = 0
    do b = 1, size(self%body)
      associate (body => self%body(b), row => problem%operator%block(b)%row)
        if (body%n == 0) cycle
        allocate (sum_of_columns(size(row)), source=0.0_dp)
        do j = 1, body%n
          if (abs(lambda(row(body%row(j)))) > 0) sum_of_columns = sum_of_columns + lambda(row(body%row(j)))*body%value(:, j)
        end do
        z(row) = z(row) + sum_of_columns
        deallocate (sum_of_columns)
      end associate
    end do
  end subroutine explicit_multiply

  !> Diagonal of C at one row that has a column in all its bodies, `huge` where products are sweeps [length/force].
  real(dp) function explicit_diagonal(self, problem, row) result(diagonal)
    class(explicit_compliance_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: row
    integer :: k, b, i
    diagonal = huge(diagonal)
    if (self%by_sweeps) return
    diagonal = 0
    do k = 1, 2
      b = problem%coarse%body(k, row)
      if (b == 0) cycle
      i = problem%coarse%place(k, row)
      if (self%body(b)%column(i) > 0) diagonal = diagonal + self%body(b)%value(i, self%body(b)%column(i))
    end do
  end function explicit_diagonal

  !> Memory of the columns [bytes].
  integer(int64) function explicit_bytes(self) result(bytes)
    class(explicit_compliance_t), intent(in) :: self
    integer :: b
    bytes = 0
    do b = 1, size(self%body)
      bytes = bytes + 8*size(self%body(b)%value, kind=int64)
    end do
  end function explicit_bytes
end module dotyk_scheme_explicit
