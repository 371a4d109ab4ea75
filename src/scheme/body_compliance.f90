!> The compliance of bodies with compliance operators of their own: matrix-free by solves, or as matrices where these
!> are formed.
!>
!> A product without entries solves every body once, side by side. Entries are formed when a scheme asks for them, many
!> rows at a time: forward substitution gives L^{-1} B^T, and its products the matrices (`dotyk_response_substitution`),
!> in parallel over bodies and blocks of rows. Congruent bodies have one operator; those that touch in the same way have
!> one matrix (`dotyk_scheme_congruent_rows`).
module dotyk_scheme_body_compliance
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_blas, only: blas_threads, set_blas_threads
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_contact_map, only: contact_map_t
  use dotyk_response_response, only: response_slot_t, response_t, substituted_rows_t
  use dotyk_scheme_compliance, only: compliance_t, entries_t
  use dotyk_scheme_congruent_rows, only: have_same_rows
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  implicit none
  private

  !> Where one body stands in its class of congruent bodies, and where it may touch others.
  type, public :: body_operator_t
    !> The body of the class that has the compliance operator.
    integer :: representative = 0
    !> Rotation from the representative to this body, as columns (dimension, dimension) [].
    real(dp), allocatable :: rotation(:, :)
    !> Its contact nodes and their equations.
    type(contact_map_t) :: map
    !> Diagonal of the stiffness at the contact nodes, in Cartesian components, 0 where not known
    !> (dimension*n_contact_nodes) [force/length].
    real(dp), allocatable :: nodal_stiffness(:)
    !> Entries that a solve goes through twice.
    real(dp) :: cost = 0
  end type body_operator_t

  !> The operator of all bodies.
  type, extends(compliance_t), public :: body_compliance_t
    !> Operators of the representatives (n_bodies).
    type(response_slot_t), allocatable :: response(:)
    !> (n_bodies).
    type(body_operator_t), allocatable :: body(:)
    !> Entries that were formed.
    type(dense_compliance_t) :: matrix
    !> Whether bodies are solved side by side, or one after the other (each with all BLAS threads).
    logical :: side_by_side = .true.
    !> Bodies that may touch others, the one with most work first.
    integer, allocatable, private :: sequence(:)
  contains
    procedure :: init => compliance_init
    procedure :: solve => compliance_solve
    procedure :: multiply => compliance_multiply
    procedure :: form => compliance_form
    procedure :: form_bodies => compliance_form_bodies
    procedure :: form_all => compliance_form_all
    procedure :: is_formed => compliance_is_formed
    procedure :: has_entries => compliance_has_entries
    procedure :: get_entries => compliance_get_entries
    procedure :: get_diagonal => compliance_get_diagonal
    procedure :: nodal_diagonal => compliance_nodal_diagonal
    procedure :: get_costs => compliance_get_costs
    procedure :: mark_formed => compliance_mark_formed
    procedure :: destroy => compliance_destroy
  end type body_compliance_t

  !> Displacements of one body's rows.
  type :: displacement_t
    real(dp), allocatable :: value(:)
  end type displacement_t

  !> Forward substitution of one body's rows, in blocks.
  type :: row_blocks_t
    !> Places of the rows among the body's rows of the QP (n).
    integer, allocatable :: place(:)
    !> First row of each block (n_blocks + 1).
    integer, allocatable :: first(:)
    !> L^{-1} of each block (n_blocks).
    type(substituted_rows_t), allocatable :: substituted(:)
  end type row_blocks_t

  !> The substitution of one block of a body's rows, or the product of two blocks.
  type :: task_t
    integer :: body = 0, block = 0, other = 0
  end type task_t

  !> Rows of a block at most: enough for the speed of dense products, few enough for many threads.
  integer, parameter :: block_rows = 256

contains

  !> Take the operators of the bodies.
  subroutine compliance_init(self, qp, response, body, side_by_side)
    class(body_compliance_t), intent(out) :: self
    !> All rows.
    type(contact_qp_t), intent(in) :: qp
    !> Factorized, of the representatives; not allocated on return (n_bodies).
    type(response_slot_t), allocatable, intent(inout) :: response(:)
    !> Not allocated on return (n_bodies).
    type(body_operator_t), allocatable, intent(inout) :: body(:)
    !> As in `body_compliance_t`.
    logical, intent(in) :: side_by_side
    integer :: b, n
    call move_alloc(response, self%response)
    call move_alloc(body, self%body)
    self%side_by_side = side_by_side
    call self%matrix%init(qp)
    allocate (self%sequence(0))
    do b = 1, size(self%body)
      if (size(qp%block(b)%row) == 0) cycle
      n = count(self%body(self%sequence)%cost >= self%body(b)%cost)
      self%sequence = [self%sequence(:n), b, self%sequence(n + 1:)]
    end do
  end subroutine compliance_init

  !> x := K_b^+ x, over the equations of a body; many threads may.
  subroutine compliance_solve(self, b, x)
    class(body_compliance_t), intent(in) :: self
    !> The body.
    integer, intent(in) :: b
    !> Right-hand side [force] in, solution [length] out (n_equations).
    real(dp), intent(inout) :: x(:)
    call self%response(self%body(b)%representative)%form%solve(x)
  end subroutine compliance_solve

  !> z = C lambda: by the matrices of bodies that have all entries, by one solve of every other body that the rows
  !> touch.
  subroutine compliance_multiply(self, qp, lambda, z)
    class(body_compliance_t), intent(inout) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> (n_rows) [length].
    real(dp), intent(out) :: z(:)
    type(displacement_t) :: moved(size(self%body))
    logical :: formed(size(self%body))
    integer :: i, b
    formed = [(self%matrix%is_body_formed(qp, b), b=1, size(self%body))]
    if (all(formed)) then
      call self%matrix%multiply(qp, lambda, z)
      return
    end if
    !$omp parallel do default(none) shared(self, qp, lambda, moved, formed) private(b) schedule(dynamic, 1) &
    !$omp& if (self%side_by_side)
    do i = 1, size(self%sequence)
      b = self%sequence(i)
      if (size(qp%block(b)%row) == 0) cycle
      if (formed(b)) then
        call multiply_matrix(self%matrix, qp, b, lambda, moved(b)%value)
      else
        call solve_body(self%response(self%body(b)%representative)%form, self%body(b), qp%block(b), lambda, &
          moved(b)%value)
      end if
    end do
    !$omp end parallel do
    ! In the order of the bodies: the sum must not depend on which thread is first.
    z = 0
    do b = 1, size(self%body)
      if (.not. allocated(moved(b)%value)) cycle
      associate (row => qp%block(b)%row)
        z(row) = z(row) + moved(b)%value
      end associate
    end do
    self%n_sweeps = self%n_sweeps + 1
  end subroutine compliance_multiply

  !> B_b K_b^+ B_b^T lambda by a solve.
  subroutine solve_body(response, body, block, lambda, displacement)
    class(response_t), intent(in) :: response
    type(body_operator_t), intent(in) :: body
    !> The body's rows of B.
    type(contact_block_t), intent(in) :: block
    !> (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> At the rows of the block [length].
    real(dp), allocatable, intent(out) :: displacement(:)
    real(dp), allocatable :: nodal(:), x(:)
    allocate (nodal(body%map%dimension*body%map%n_nodes), x(size(response%mode, 1)), displacement(size(block%row)))
    call block%matrix%multiply_transposed(lambda(block%row), nodal)
    call body%map%scatter(nodal, x)
    call response%solve(x)
    call body%map%gather(x, nodal)
    call block%matrix%multiply(nodal, displacement)
  end subroutine solve_body

  !> The same by the matrix.
  subroutine multiply_matrix(matrix, qp, b, lambda, displacement)
    type(dense_compliance_t), intent(in) :: matrix
    type(contact_qp_t), intent(in) :: qp
    !> The body.
    integer, intent(in) :: b
    !> (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> At the body's rows of the QP [length].
    real(dp), allocatable, intent(out) :: displacement(:)
    real(dp), allocatable :: force(:), moved(:), formed(:)
    allocate (force(size(matrix%row_body, 2)), moved(size(matrix%row_body, 2)), source=0.0_dp)
    force(qp%parent_row) = lambda
    call matrix%multiply_body(b, force, formed)
    moved(matrix%body(b)%row) = formed
    displacement = moved(qp%parent_row(qp%block(b)%row))
  end subroutine multiply_matrix

  !> Form the entries at all rows of a QP.
  subroutine compliance_form(self, qp, may_stop)
    class(body_compliance_t), intent(inout) :: self
    !> A restriction of that of `init`, in which all formed rows are.
    type(contact_qp_t), intent(in) :: qp
    !> As in `compliance_t`.
    logical, intent(in), optional :: may_stop
    integer :: b
    logical :: stops
    stops = .false.
    if (present(may_stop)) stops = may_stop
    call self%form_bodies(qp, [(.true., b=1, size(self%body))], stops)
  end subroutine compliance_form

  !> Form the entries of some bodies at all of their rows.
  subroutine compliance_form_bodies(self, qp, chosen, may_stop)
    class(body_compliance_t), intent(inout) :: self
    !> As in `form`.
    type(contact_qp_t), intent(in) :: qp
    !> (n_bodies).
    logical, intent(in) :: chosen(:)
    !> Whether an interrupt ends it, with entries that are not valid.
    logical, intent(in) :: may_stop
    type(row_blocks_t), allocatable :: blocks(:)
    integer :: first_new(size(self%body)), b
    allocate (blocks(size(self%body)))
    first_new = 0
    do b = 1, size(self%body)
      if (.not. chosen(b) .or. self%matrix%is_body_formed(qp, b)) cycle
      call add_rows(self%matrix, self%body, qp, b, blocks(b)%place, first_new(b))
      if (self%matrix%body(b)%same_as > 0) first_new(b) = 0
      if (first_new(b) == 0) cycle
      call cut_rows(self%matrix%body(b)%n, first_new(b), blocks(b)%first)
    end do
    if (all(first_new == 0)) return
    call form_blocks(self%response, self%body, qp%block, blocks, first_new, may_stop, self%matrix)
    self%n_sweeps = self%n_sweeps + (maxval(self%matrix%body%n - first_new + 1, mask=first_new > 0) + 1)/2
  end subroutine compliance_form_bodies

  !> Number the rows of a body that are not formed yet, and make room for their entries.
  subroutine add_rows(matrix, body, qp, b, place, first_new)
    type(dense_compliance_t), intent(inout) :: matrix
    type(body_operator_t), intent(in) :: body(:)
    type(contact_qp_t), intent(in) :: qp
    !> The body.
    integer, intent(in) :: b
    !> Place of each row of the matrix among the body's rows of the QP (n).
    integer, allocatable, intent(out) :: place(:)
    !> First row of the matrix without entries.
    integer, intent(out) :: first_new
    integer, allocatable :: row(:), new_place(:), place_of(:)
    real(dp), allocatable :: value(:, :)
    integer :: i, n_old, c
    associate (own => matrix%body(b), parent => qp%parent_row(qp%block(b)%row))
      allocate (new_place(size(parent)))
      do i = 1, size(parent)
        new_place(i) = matrix%row_place(merge(1, 2, matrix%row_body(1, parent(i)) == b), parent(i))
      end do
      row = pack(parent, own%number(new_place) == 0)
      new_place = pack(new_place, own%number(new_place) == 0)
      n_old = own%n
      own%row = [own%row, row]
      own%place = [own%place, new_place]
      own%n = size(own%row)
      own%number(new_place) = [(i, i=n_old + 1, own%n)]
      allocate (place_of(maxval(parent)))
      place_of(parent) = [(i, i=1, size(parent))]
      place = place_of(own%row)
      ! One that had another's matrix, and has not any more, begins anew.
      if (own%same_as > 0) n_old = 0
      own%same_as = 0
      first_new = n_old + 1
      if (n_old == 0) then
        do c = 1, b - 1
          if (matrix%body(c)%same_as > 0 .or. matrix%body(c)%n /= own%n) cycle
          if (body(c)%representative /= body(b)%representative) cycle
          if (any(matrix%body(c)%place /= own%place)) cycle
          if (.not. have_same_rows(qp%block(b), body(b)%rotation, place, qp%block(c), body(c)%rotation, place)) cycle
          own%same_as = c
          if (allocated(own%value)) deallocate (own%value)
          return
        end do
      end if
      allocate (value(own%n, own%n))
      if (n_old > 0) value(:n_old, :n_old) = own%value
      call move_alloc(value, own%value)
    end associate
  end subroutine add_rows

  !> Blocks of rows; a block has old rows or new ones.
  pure subroutine cut_rows(n, first_new, first)
    !> Number of rows, and the first new one.
    integer, intent(in) :: n, first_new
    !> First row of each block (n_blocks + 1).
    integer, allocatable, intent(out) :: first(:)
    integer :: next
    first = [1]
    do while (first(size(first)) <= n)
      next = first(size(first)) + block_rows
      if (first(size(first)) < first_new) next = min(next, first_new)
      first = [first, min(next, n + 1)]
    end do
  end subroutine cut_rows

  !> Substitute all blocks of rows, and multiply each block that has new rows with all blocks up to it.
  subroutine form_blocks(response, body, contact, blocks, first_new, may_stop, matrix)
    type(response_slot_t), intent(inout) :: response(:)
    !> (n_bodies).
    type(body_operator_t), intent(in) :: body(:)
    !> Rows of B of each body (n_bodies).
    type(contact_block_t), intent(in) :: contact(:)
    !> Of the bodies with new rows (n_bodies).
    type(row_blocks_t), intent(inout) :: blocks(:)
    !> First new row of each body; 0: it has none (n_bodies).
    integer, intent(in) :: first_new(:)
    logical, intent(in) :: may_stop
    !> Gets the entries.
    type(dense_compliance_t), intent(inout) :: matrix
    type(task_t), allocatable :: substitution(:), product(:)
    integer :: b, i, k, n_blas
    allocate (substitution(0), product(0))
    do b = 1, size(blocks)
      if (first_new(b) == 0) cycle
      call response(body(b)%representative)%form%prepare_substitution()
      allocate (blocks(b)%substituted(size(blocks(b)%first) - 1))
      ! L^{-1} B^T takes as much memory as C: that of old rows was not kept.
      substitution = [substitution, (task_t(b, i, i), i=1, size(blocks(b)%substituted))]
      do i = 1, size(blocks(b)%substituted)
        if (blocks(b)%first(i) < first_new(b)) cycle
        product = [product, (task_t(b, i, k), k=1, i)]
      end do
    end do
    n_blas = blas_threads()
    if (size(substitution) > 1) call set_blas_threads(1)
    !$omp parallel default(none) private(b) &
    !$omp& shared(response, body, contact, blocks, may_stop, matrix, substitution, product) &
    !$omp& if (size(substitution) > 1)
    !$omp do schedule(dynamic, 1)
    do i = 1, size(substitution)
      if (has_to_stop(may_stop)) cycle
      b = substitution(i)%body
      call substitute_block(response(body(b)%representative)%form, body(b)%map, contact(b), substitution(i)%block, &
        blocks(b))
    end do
    !$omp end do
    !$omp do schedule(dynamic, 1)
    do i = 1, size(product)
      if (has_to_stop(may_stop)) cycle
      b = product(i)%body
      call multiply_blocks(response(body(b)%representative)%form, blocks(b), product(i)%block, product(i)%other, &
                           matrix%body(b)%value)
    end do
    !$omp end do
    !$omp end parallel
    call set_blas_threads(n_blas)
  end subroutine form_blocks

  !> Whether the program was asked to stop, and forming entries ends then.
  logical function has_to_stop(may_stop)
    logical, intent(in) :: may_stop
    has_to_stop = may_stop
    if (may_stop) has_to_stop = interrupted()
  end function has_to_stop

  !> Forward substitution of one block.
  subroutine substitute_block(response, map, contact, block, blocks)
    class(response_t), intent(in) :: response
    type(contact_map_t), intent(in) :: map
    !> The body's rows of B.
    type(contact_block_t), intent(in) :: contact
    integer, intent(in) :: block
    type(row_blocks_t), intent(inout) :: blocks
    type(sparse_rows_t) :: rows
    call map%rows(contact%matrix, blocks%place(blocks%first(block):blocks%first(block + 1) - 1), rows)
    call response%substitute(rows, blocks%substituted(block))
  end subroutine substitute_block

  !> The entries between two blocks, and their mirror image.
  subroutine multiply_blocks(response, blocks, block, other, value)
    class(response_t), intent(in) :: response
    type(row_blocks_t), intent(in) :: blocks
    integer, intent(in) :: block, other
    !> (n, n) [length/force].
    real(dp), intent(inout) :: value(:, :)
    real(dp), allocatable :: c(:, :)
    associate (a => blocks%first(block), b => blocks%first(other))
      allocate (c(blocks%substituted(block)%forward%n, blocks%substituted(other)%forward%n))
      call response%product(blocks%substituted(block), blocks%substituted(other), block == other, c)
      value(a:a + size(c, 1) - 1, b:b + size(c, 2) - 1) = c
      if (block /= other) value(b:b + size(c, 2) - 1, a:a + size(c, 1) - 1) = transpose(c)
    end associate
  end subroutine multiply_blocks

  !> Entries at all rows of any QP over the same bodies; this operator keeps none of them.
  subroutine compliance_form_all(self, qp, entries)
    class(body_compliance_t), intent(inout) :: self
    !> A restriction of that of `init`, an aggregation, or that one.
    type(contact_qp_t), intent(in) :: qp
    !> Of each body at its rows, in their order (n_bodies).
    type(entries_t), allocatable, intent(out) :: entries(:)
    type(dense_compliance_t) :: matrix
    type(row_blocks_t), allocatable :: blocks(:)
    integer :: first_new(size(self%body)), b, i
    allocate (entries(size(self%body)))
    if (self%is_formed(qp)) then
      do b = 1, size(self%body)
        call self%matrix%get_entries(qp, b, qp%block(b)%row, entries(b)%value)
      end do
      return
    end if
    allocate (matrix%body(size(self%body)), blocks(size(self%body)))
    first_new = 0
    do b = 1, size(self%body)
      associate (n => size(qp%block(b)%row))
        allocate (matrix%body(b)%value(n, n))
        if (n == 0) cycle
        first_new(b) = 1
        blocks(b)%place = [(i, i=1, n)]
        call cut_rows(n, 1, blocks(b)%first)
      end associate
    end do
    call form_blocks(self%response, self%body, qp%block, blocks, first_new, .false., matrix)
    do b = 1, size(self%body)
      call move_alloc(matrix%body(b)%value, entries(b)%value)
    end do
    self%n_sweeps = self%n_sweeps + (maxval([(size(qp%block(b)%row), b=1, size(self%body))]) + 1)/2
  end subroutine compliance_form_all

  !> Whether all entries at the rows of a QP are there.
  pure logical function compliance_is_formed(self, qp) result(is_formed)
    class(body_compliance_t), intent(in) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    is_formed = self%matrix%is_formed(qp)
  end function compliance_is_formed

  !> Whether any entries are there.
  pure logical function compliance_has_entries(self) result(has_entries)
    class(body_compliance_t), intent(in) :: self
    has_entries = self%matrix%has_entries()
  end function compliance_has_entries

  !> Entries between some rows of a body.
  subroutine compliance_get_entries(self, qp, b, row, entries)
    class(body_compliance_t), intent(in) :: self
    !> Formed.
    type(contact_qp_t), intent(in) :: qp
    !> The body.
    integer, intent(in) :: b
    !> (n).
    integer, intent(in) :: row(:)
    !> (n, n) [length/force].
    real(dp), allocatable, intent(out) :: entries(:, :)
    call self%matrix%get_entries(qp, b, row, entries)
  end subroutine compliance_get_entries

  !> Diagonal entries.
  subroutine compliance_get_diagonal(self, qp, row, diagonal)
    class(body_compliance_t), intent(in) :: self
    !> Formed at the rows.
    type(contact_qp_t), intent(in) :: qp
    !> (n).
    integer, intent(in) :: row(:)
    !> (n) [length/force].
    real(dp), intent(out) :: diagonal(:)
    call self%matrix%get_diagonal(qp, row, diagonal)
  end subroutine compliance_get_diagonal

  !> `B D^{-1} B^T` with the diagonals of the stiffnesses.
  subroutine compliance_nodal_diagonal(self, qp, diagonal)
    class(body_compliance_t), intent(in) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> (n_rows) [length/force].
    real(dp), intent(out) :: diagonal(:)
    integer :: b, i, k
    diagonal = 0
    do b = 1, size(self%body)
      associate (stiffness => self%body(b)%nodal_stiffness, row => qp%block(b)%row, matrix => qp%block(b)%matrix)
        do i = 1, size(row)
          do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            if (stiffness(matrix%column(k)) > 0) &
              diagonal(row(i)) = diagonal(row(i)) + matrix%value(k)**2/stiffness(matrix%column(k))
          end do
        end do
      end associate
    end do
  end subroutine compliance_nodal_diagonal

  !> Costs of one body.
  subroutine compliance_get_costs(self, b, path, solve)
    class(body_compliance_t), intent(inout) :: self
    !> The body.
    integer, intent(in) :: b
    !> As in `compliance_t`.
    real(dp), intent(out) :: path, solve
    associate (equation => self%body(b)%map%equation)
      path = self%response(self%body(b)%representative)%form%path_entries(pack(equation, equation > 0))
    end associate
    solve = self%body(b)%cost
  end subroutine compliance_get_costs

  !> Mark rows with entries.
  subroutine compliance_mark_formed(self, formed)
    class(body_compliance_t), intent(in) :: self
    !> (all rows of the QP of `init`).
    logical, intent(inout) :: formed(:)
    call self%matrix%mark_formed(formed)
  end subroutine compliance_mark_formed

  !> Give back all memory.
  subroutine compliance_destroy(self)
    class(body_compliance_t), intent(inout) :: self
    integer :: b
    if (.not. allocated(self%response)) return
    do b = 1, size(self%response)
      if (allocated(self%response(b)%form)) call self%response(b)%form%destroy()
    end do
    deallocate (self%response)
  end subroutine compliance_destroy
end module dotyk_scheme_body_compliance
