!> The compliance C = B K^+ B^T as matrices, one for each body.
!>
!> Rows join when they are needed, many at a time: forward substitutions with the factors give L^{-1} B^T, and their
!> products the matrices (`dotyk_linalg_forward_substitution`). In parallel over bodies and lots of rows. Bodies that touch in the same way have one matrix
!> (`dotyk_scheme_twins`).
module dotyk_scheme_explicit
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: blas_threads, set_blas_threads
  use dotyk_response_response, only: forward_response_t, response_t
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_twins, only: are_twins
  implicit none
  private

  !> The compliance of one body at some of its rows.
  type, public :: body_compliance_t
    !> Number of rows that have joined.
    integer :: n = 0
    !> (n, n), symmetric [length/force].
    real(dp), allocatable :: value(:, :)
    !> Place of each of them among the body's rows (n), and the number of each of the body's rows, 0 where it has not joined.
    integer, allocatable :: row(:), number(:)
    !> Their numbers in the operator that they come from (n).
    integer, allocatable, private :: origin(:)
    !> First row of each lot (n_lots + 1).
    integer, allocatable, private :: first(:)
    !> Solutions of L y = P b of the lots, while rows join (n_lots).
    type(forward_response_t), allocatable, private :: forward(:)
    !> The body that this one has its matrix from; 0: it has solutions of L y = P b of its own.
    integer, private :: twin = 0
  end type body_compliance_t

  !> The compliances of all bodies.
  type, public :: explicit_compliance_t
    !> (n_bodies).
    type(body_compliance_t), allocatable :: body(:)
    !> True: there are no matrices, products are sweeps over all bodies.
    logical :: by_sweeps = .false.
  contains
    procedure :: init => explicit_init
    procedure :: adopt => explicit_adopt
    procedure :: mark => explicit_mark
    procedure :: form => explicit_form
    procedure :: join => explicit_join
    procedure :: lend => explicit_lend
    procedure :: multiply => explicit_multiply
    procedure :: diagonal => explicit_diagonal
  end type explicit_compliance_t

  !> A forward substitution of one lot of a body, or the product of two lots.
  type :: task_t
    integer :: body = 0, lot = 0, other = 0
  end type task_t

  !> Rows of a lot at most: enough for the rate of dense products, few enough for many threads.
  integer, parameter :: lot_size = 256

contains

  !> No rows yet.
  subroutine explicit_init(self, n_bodies, by_sweeps)
    class(explicit_compliance_t), intent(out) :: self
    integer, intent(in) :: n_bodies
    !> Whether there will never be any.
    logical, intent(in) :: by_sweeps
    integer :: b
    self%by_sweeps = by_sweeps
    allocate (self%body(n_bodies))
    do b = 1, n_bodies
      allocate (self%body(b)%value(0, 0), self%body(b)%row(0), self%body(b)%origin(0))
      self%body(b)%first = [1]
    end do
  end subroutine explicit_init

  !> Work for a problem on some of the rows, or on more of them than before: those that have joined must be among them.
  subroutine explicit_adopt(self, problem)
    class(explicit_compliance_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer, allocatable :: place_of(:)
    integer :: b, i
    if (self%by_sweeps) return
    do b = 1, size(self%body)
      associate (body => self%body(b), row => problem%operator%block(b)%row)
        if (allocated(body%number)) deallocate (body%number)
        allocate (body%number(size(row)), source=0)
        if (body%n == 0) cycle
        allocate (place_of(maxval(problem%operator%origin)), source=0)
        place_of(problem%operator%origin(row)) = [(i, i=1, size(row))]
        body%row = place_of(body%origin)
        body%number(body%row) = [(i, i=1, body%n)]
        deallocate (place_of)
      end associate
    end do
  end subroutine explicit_adopt

  !> Mark the rows that have joined.
  subroutine explicit_mark(self, joined)
    class(explicit_compliance_t), intent(in) :: self
    !> Of the operator that they come from; others stay as they are.
    logical, intent(inout) :: joined(:)
    integer :: b
    do b = 1, size(self%body)
      joined(self%body(b)%origin) = .true.
    end do
  end subroutine explicit_mark

  !> Let all rows join.
  subroutine explicit_form(self, problem, chosen, may_stop)
    class(explicit_compliance_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> The bodies whose rows join; all if absent (n_bodies).
    logical, intent(in), optional :: chosen(:)
    !> Whether it ends, with matrices that mean nothing, as soon as somebody asks the program to stop; not if absent.
    logical, intent(in), optional :: may_stop
    type(task_t), allocatable :: forward(:), product(:)
    logical, allocatable :: copied(:)
    integer :: b, i, n_blas, n_forward, n_products
    logical :: asks
    if (self%by_sweeps) return
    asks = .false.
    if (present(may_stop)) asks = may_stop
    call self%adopt(problem)
    call plan(self, problem, forward, n_forward, product, n_products, copied, chosen)
    if (n_forward == 0 .and. .not. any(copied)) return
    n_blas = blas_threads()
    if (n_forward > 1) call set_blas_threads(1)
    !$omp parallel do default(none) shared(self, problem, forward, n_forward, asks) private(b) schedule(dynamic, 1) &
    !$omp if (n_forward > 1)
    do i = 1, n_forward
      if (has_to_stop(asks)) cycle
      b = forward(i)%body
      associate (body => self%body(b), lot => forward(i)%lot)
        call problem%response(b)%form%forward_substitution(problem%operator%block(b)%matrix, &
                                                           body%row(body%first(lot):body%first(lot + 1) - 1), &
                                                           body%forward(lot))
      end associate
    end do
    !$omp end parallel do
    !$omp parallel do default(none) shared(self, problem, product, n_products, asks) private(b) schedule(dynamic, 1) &
    !$omp if (n_forward > 1)
    do i = 1, n_products
      if (has_to_stop(asks)) cycle
      b = product(i)%body
      call multiply_lots(problem%response(b)%form, self%body(b), product(i)%lot, product(i)%other)
    end do
    !$omp end parallel do
    call set_blas_threads(n_blas)
    do b = 1, size(self%body)
      if (allocated(self%body(b)%forward)) deallocate (self%body(b)%forward)
      if (copied(b)) self%body(b)%value = self%body(self%body(b)%twin)%value
    end do
  end subroutine explicit_form

  !> Whether the program was asked to stop, and this is to end then.
  logical function has_to_stop(asks)
    logical, intent(in) :: asks
    has_to_stop = asks
    if (asks) has_to_stop = interrupted()
  end function has_to_stop

  !> Number the rows that join, make room for them, and say what is to be done.
  subroutine plan(self, problem, forward, n_forward, product, n_products, copied, chosen)
    class(explicit_compliance_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> Forward substitutions and products of lots, with room for more.
    type(task_t), allocatable, intent(out) :: forward(:), product(:)
    integer, intent(out) :: n_forward, n_products
    !> Bodies that take over the matrix of their twin (n_bodies).
    logical, allocatable, intent(out) :: copied(:)
    logical, intent(in), optional :: chosen(:)
    integer :: b, i, k, m, n_old, most
    most = 0
    n_forward = 0
    n_products = 0
    allocate (forward(0), product(0))
    allocate (copied(size(self%body)), source=.false.)
    do b = 1, size(self%body)
      if (present(chosen)) then
        if (.not. chosen(b)) cycle
      end if
      associate (body => self%body(b), row => problem%operator%block(b)%row)
        m = count(body%number == 0)
        if (m == 0) cycle
        call problem%response(b)%form%prepare_forward_substitution()
        n_old = body%n
        body%row = [body%row, pack([(i, i=1, size(row))], body%number == 0)]
        body%origin = [body%origin, problem%operator%origin(row(body%row(n_old + 1:)))]
        body%n = n_old + m
        body%number(body%row) = [(i, i=1, body%n)]
        most = max(most, m)
        call choose_twin(self, problem, b, n_old)
        copied(b) = body%twin > 0
        if (copied(b)) cycle
        call make_room(body, n_old)
        n_old = size(body%first) - 1
        do while (body%first(size(body%first)) <= body%n)
          body%first = [body%first, min(body%first(size(body%first)) + lot_size, body%n + 1)]
        end do
        allocate (body%forward(size(body%first) - 1))
        do i = 1, size(body%forward)
          ! Solutions of L y = P b take memory as C does: those of rows that joined before are found once more, which is rare.
          forward = [forward, task_t(b, i, i)]
          if (i <= n_old) cycle
          do k = 1, i
            product = [product, task_t(b, i, k)]
          end do
        end do
        n_forward = size(forward)
        n_products = size(product)
      end associate
    end do
    problem%body_solves = problem%body_solves + (most + 1)/2
  end subroutine plan

  !> Find an earlier body that has the same rows, for one without solutions of L y = P b. One that had a twin and has none any more begins
  !> anew.
  subroutine choose_twin(self, problem, b, n_old)
    class(explicit_compliance_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> The body.
    integer, intent(in) :: b
    !> Its rows with solutions of L y = P b, or of a twin, before.
    integer, intent(inout) :: n_old
    integer :: c
    if (self%body(b)%twin == 0 .and. n_old > 0) return
    self%body(b)%twin = 0
    n_old = 0
    do c = 1, b - 1
      if (self%body(c)%twin > 0 .or. self%body(c)%n == 0) cycle
      if (.not. are_twins(problem, b, self%body(b)%row, c, self%body(c)%row)) cycle
      self%body(b)%twin = c
      return
    end do
  end subroutine choose_twin

  !> Room for the matrix of all rows.
  subroutine make_room(body, n_old)
    type(body_compliance_t), intent(inout) :: body
    !> Rows before.
    integer, intent(in) :: n_old
    real(dp), allocatable :: value(:, :)
    allocate (value(body%n, body%n))
    value(:n_old, :n_old) = body%value(:n_old, :n_old)
    call move_alloc(value, body%value)
  end subroutine make_room

  !> The block of two lots, and its mirror image.
  subroutine multiply_lots(response, body, lot, other)
    class(response_t), intent(in) :: response
    type(body_compliance_t), intent(inout) :: body
    integer, intent(in) :: lot, other
    real(dp), allocatable :: c(:, :)
    associate (a => body%first(lot), b => body%first(other))
      allocate (c(body%forward(lot)%forward%n, body%forward(other)%forward%n))
      call response%forward_product(body%forward(lot), body%forward(other), lot == other, c)
      body%value(a:a + size(c, 1) - 1, b:b + size(c, 2) - 1) = c
      if (lot /= other) body%value(b:b + size(c, 2) - 1, a:a + size(c, 1) - 1) = transpose(c)
    end associate
  end subroutine multiply_lots

  !> The compliance of groups of rows, from that of the rows: S C S^T, where row i has the share S(group(i), i) in its group.
  subroutine explicit_join(self, problem, group, share, rough, joined)
    !> Of all rows.
    class(explicit_compliance_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    !> Group of each row (n_rows), and its share.
    integer, intent(in) :: group(:)
    real(dp), intent(in) :: share(:)
    !> The problem of the groups.
    type(contact_problem_t), intent(in) :: rough
    type(explicit_compliance_t), intent(out) :: joined
    integer, allocatable :: place_of(:)
    real(dp), allocatable :: half(:, :)
    integer :: b, i, j
    call joined%init(size(self%body), .false.)
    do b = 1, size(self%body)
      associate (fine => self%body(b), row => problem%operator%block(b)%row, &
                 own => joined%body(b), own_row => rough%operator%block(b)%row)
        own%n = size(own_row)
        own%row = [(i, i=1, own%n)]
        own%number = own%row
        own%origin = own_row
        allocate (place_of(rough%operator%n_rows))
        allocate (half(own%n, fine%n), source=0.0_dp)
        place_of(own_row) = own%row
        do j = 1, fine%n
          do i = 1, fine%n
            associate (at => place_of(group(row(fine%row(i)))))
              half(at, j) = half(at, j) + share(row(fine%row(i)))*fine%value(i, j)
            end associate
          end do
        end do
        deallocate (own%value)
        allocate (own%value(own%n, own%n), source=0.0_dp)
        do j = 1, fine%n
          associate (at => place_of(group(row(fine%row(j)))))
            own%value(:, at) = own%value(:, at) + share(row(fine%row(j)))*half(:, j)
          end associate
        end do
        deallocate (place_of, half)
      end associate
    end do
  end subroutine explicit_join

  !> Let the matrices of some bodies stand for their responses. An interrupt ends it: there is no answer then.
  subroutine explicit_lend(self, problem, chosen)
    class(explicit_compliance_t), intent(inout) :: self
    !> The problem that all rows belong to.
    type(contact_problem_t), intent(inout) :: problem
    !> (n_bodies).
    logical, intent(in) :: chosen(:)
    integer :: b
    if (.not. any(chosen)) return
    call self%init(size(chosen), .false.)
    call self%form(problem, chosen, may_stop=.true.)
    if (interrupted()) return
    do b = 1, size(chosen)
      ! Rows joined in their own order.
      if (chosen(b)) call problem%take_matrix(b, self%body(b)%value)
    end do
  end subroutine explicit_lend

  !> z = C lambda at the rows that have joined, 0 elsewhere.
  subroutine explicit_multiply(self, problem, lambda, z)
    class(explicit_compliance_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> Forces (n_rows), 0 at other rows [force].
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
        allocate (sum_of_columns(body%n), source=0.0_dp)
        do j = 1, body%n
          if (abs(lambda(row(body%row(j)))) > 0) sum_of_columns = sum_of_columns + lambda(row(body%row(j)))*body%value(:, j)
        end do
        z(row(body%row)) = z(row(body%row)) + sum_of_columns
        deallocate (sum_of_columns)
      end associate
    end do
  end subroutine explicit_multiply

  !> Diagonal of C at one row that has joined, `huge` where products are sweeps [length/force].
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
      i = self%body(b)%number(problem%coarse%place(k, row))
      if (i > 0) diagonal = diagonal + self%body(b)%value(i, i)
    end do
  end function explicit_diagonal
end module dotyk_scheme_explicit
