!> Forming entries of the compliance, many rows at a time: forward substitution gives L^{-1} B^T, and its products the
!> matrices, in parallel over bodies and blocks of rows.
!>
!> Congruent bodies can have the same rows of B, as in a row of equal bodies that touch in the same way: their
!> compliances `B_b K_b^+ B_b^T` are one matrix.
module dotyk_scheme_entry_forming
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_progress, only: add_progress, expect_progress
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_blas, only: blas_threads, set_blas_threads
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: is_own, item_t, share
  use dotyk_response_contact_map, only: contact_map_t
  use dotyk_response_response, only: response_slot_t, response_t, substituted_rows_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  implicit none
  private
  public :: add_rows, cut_rows, form_blocks, have_same_rows

  !> Where one body stands in its class of congruent bodies, and where it may touch others.
  type, public :: body_operator_t
    integer :: representative = 0  !! The body of the class that has the compliance operator.
    !> Rotation from the representative to this body, as columns (dimension, dimension) [].
    real(dp), allocatable :: rotation(:, :)
    type(contact_map_t) :: map  !! Its contact nodes and their equations.
    !> Diagonal of the stiffness at the contact nodes, in Cartesian components, 0 where not known
    !> (dimension*n_contact_nodes) [force/length].
    real(dp), allocatable :: nodal_stiffness(:)
    real(dp) :: cost = 0  !! Entries that a solve goes through twice.
    integer :: owner = 0  !! Rank that solves the body.
    !> Displacement without contact, u_0, and the last one by a scheme that finds displacements, u without its rigid
    !> body modes; allocated for bodies that are solved iteratively (n_equations) [length].
    real(dp), allocatable :: free(:), found(:)
    !> Loads, and the forces that the solve of u_0 has left; allocated where `free` is (n_equations) [force].
    real(dp), allocatable :: load(:), left(:)
  end type body_operator_t

  type, public :: row_blocks_t  !! Forward substitution of one body's rows, in blocks.
    integer, allocatable :: place(:)  !! Places of the rows among the body's rows of the QP (n).
    integer, allocatable :: first(:)  !! First row of each block (n_blocks + 1).
    type(substituted_rows_t), allocatable :: substituted(:)  !! L^{-1} of each block (n_blocks).
  end type row_blocks_t

  type :: task_t  !! The substitution of one block of a body's rows, or the product of two blocks.
    integer :: body = 0, block = 0, other = 0  !! The body, one of its blocks, and the other one of a product.
  end type task_t

  !> Rows of a block at most: enough for the speed of dense products, few enough for many threads.
  integer, parameter :: block_rows = 256

contains

  !> Number the rows of a body that are not formed yet, and make room for their entries.
  subroutine add_rows(matrix, body, qp, b, place, first_new)
    type(dense_compliance_t), intent(inout) :: matrix  !! Gets the rows, without their entries.
    type(body_operator_t), intent(in) :: body(:)  !! All bodies: congruent ones may share a matrix (n_bodies).
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    integer, intent(in) :: b  !! The body.
    !> Place of each row of the matrix among the body's rows of the QP (n).
    integer, allocatable, intent(out) :: place(:)
    integer, intent(out) :: first_new  !! First row of the matrix without entries.
    integer, allocatable :: row(:), new_place(:), place_of(:)
    real(dp), allocatable :: value(:, :)
    integer :: i, n_old, c
    associate (own => matrix%of_body(b), parent => qp%parent_row(qp%block(b)%row))
      allocate (new_place(size(parent)))
      do i = 1, size(parent)
        new_place(i) = matrix%row_place(findloc(matrix%row_body(:, parent(i)), b, 1), parent(i))
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
          if (matrix%of_body(c)%same_as > 0 .or. matrix%of_body(c)%n /= own%n) cycle
          if (body(c)%representative /= body(b)%representative) cycle
          if (any(matrix%of_body(c)%place /= own%place)) cycle
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
    integer, intent(in) :: n  !! Number of rows.
    integer, intent(in) :: first_new  !! First new row.
    integer, allocatable, intent(out) :: first(:)  !! First row of each block (n_blocks + 1).
    integer :: next
    first = [1]
    do while (first(size(first)) <= n)
      next = first(size(first)) + block_rows
      if (first(size(first)) < first_new) next = min(next, first_new)
      first = [first, min(next, n + 1)]
    end do
  end subroutine cut_rows

  !> Substitute all blocks of rows, and multiply each block that has new rows with all blocks up to it; each rank those
  !> of its bodies.
  subroutine form_blocks(response, body, contact, blocks, first_new, may_stop, matrix)
    type(response_slot_t), intent(inout) :: response(:)  !! Operators of the representatives (n_bodies).
    type(body_operator_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_block_t), intent(in) :: contact(:)  !! Rows of B of each body (n_bodies).
    type(row_blocks_t), intent(inout) :: blocks(:)  !! Row blocks of the bodies with new rows (n_bodies).
    integer, intent(in) :: first_new(:)  !! First new row of each body; 0: it has none (n_bodies).
    logical, intent(in) :: may_stop  !! Whether an interrupt ends it, with entries that are not valid.
    type(dense_compliance_t), intent(inout) :: matrix  !! Gets the entries.
    type(task_t), allocatable :: substitution(:), product(:)
    real(dp) :: of_substitution
    integer :: b, i, k, n_blas
    allocate (substitution(0), product(0))
    do b = 1, size(blocks)
      if (first_new(b) == 0 .or. .not. is_own(body(b)%owner)) cycle
      call response(body(b)%representative)%form%prepare_substitution()
      allocate (blocks(b)%substituted(size(blocks(b)%first) - 1))
      ! L^{-1} B^T takes as much memory as C: that of old rows was not kept.
      substitution = [substitution, (task_t(b, i, i), i=1, size(blocks(b)%substituted))]
      do i = 1, size(blocks(b)%substituted)
        if (blocks(b)%first(i) < first_new(b)) cycle
        product = [product, (task_t(b, i, k), k=1, i)]
      end do
    end do
    ! Substitutions and products take about as long as each other; progress counts whole units.
    of_substitution = max(1.0_dp, anint(real(size(product), dp)/max(1, size(substitution))))
    call expect_progress(size(substitution)*of_substitution + size(product))
    n_blas = blas_threads()
    if (size(substitution) > 1) call set_blas_threads(1)
    !$omp parallel default(none) private(b) &
    !$omp& shared(response, body, contact, blocks, may_stop, matrix, substitution, product, of_substitution) &
    !$omp& if (size(substitution) > 1)
    !$omp do schedule(dynamic, 1)
    do i = 1, size(substitution)
      if (has_to_stop(may_stop)) cycle
      b = substitution(i)%body
      call substitute_block(response(body(b)%representative)%form, body(b)%map, contact(b), &
                            substitution(i)%block, blocks(b))
      call add_progress(of_substitution)
    end do
    !$omp end do
    !$omp do schedule(dynamic, 1)
    do i = 1, size(product)
      if (has_to_stop(may_stop)) cycle
      b = product(i)%body
      call multiply_blocks(response(body(b)%representative)%form, blocks(b), product(i)%block, product(i)%other, &
                           matrix%of_body(b)%value)
      call add_progress(1.0_dp)
    end do
    !$omp end do
    !$omp end parallel
    call set_blas_threads(n_blas)
    call expect_progress(0.0_dp)
    call share_entries(body, first_new, matrix)
  end subroutine form_blocks

  !> Make the new entries of all bodies known to all ranks.
  subroutine share_entries(body, first_new, matrix)
    type(body_operator_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    integer, intent(in) :: first_new(:)  !! First new row of each body; 0: it has none (n_bodies).
    !> With the new entries of the bodies of this rank in, of all bodies out.
    type(dense_compliance_t), intent(inout) :: matrix
    type(item_t) :: columns(size(body))
    integer :: b, n
    if (n_ranks() == 1) return
    do b = 1, size(body)
      if (first_new(b) == 0 .or. .not. is_own(body(b)%owner)) cycle
      associate (new => matrix%of_body(b)%value(:, first_new(b):))
        columns(b)%value = reshape(new, [size(new)])
      end associate
    end do
    call share(body%owner, columns)
    do b = 1, size(body)
      if (first_new(b) == 0 .or. is_own(body(b)%owner)) cycle
      associate (value => matrix%of_body(b)%value)
        n = size(value, 1)
        value(:, first_new(b):) = reshape(columns(b)%value, [n, n - first_new(b) + 1])
        value(first_new(b):, :first_new(b) - 1) = transpose(value(:first_new(b) - 1, first_new(b):))
      end associate
    end do
  end subroutine share_entries

  !> Whether the program was asked to stop, and forming entries ends then.
  logical function has_to_stop(may_stop)
    logical, intent(in) :: may_stop  !! Whether an interrupt ends it, with entries that are not valid.
    has_to_stop = may_stop
    if (may_stop) has_to_stop = interrupted()
  end function has_to_stop

  !> Forward substitution of one block.
  subroutine substitute_block(response, map, contact, block, blocks)
    class(response_t), intent(in) :: response  !! Compliance operator of the body.
    type(contact_map_t), intent(in) :: map  !! Contact nodes of the body and their equations.
    type(contact_block_t), intent(in) :: contact  !! The body's rows of B.
    integer, intent(in) :: block  !! The block of rows.
    type(row_blocks_t), intent(inout) :: blocks  !! Blocks of the body; gets the substituted block.
    type(sparse_rows_t) :: rows
    call map%rows(contact%matrix, blocks%place(blocks%first(block):blocks%first(block + 1) - 1), rows)
    call response%substitute(rows, blocks%substituted(block))
  end subroutine substitute_block

  !> The entries between two blocks, and their mirror image.
  subroutine multiply_blocks(response, blocks, block, other, value)
    class(response_t), intent(in) :: response  !! Compliance operator of the body.
    type(row_blocks_t), intent(in) :: blocks  !! Blocks of the body, both substituted.
    integer, intent(in) :: block, other  !! The two blocks of rows, or one twice.
    !> Entries of the body, of which those of the two blocks are set (n, n) [length/force].
    real(dp), intent(inout) :: value(:, :)
    real(dp), allocatable :: c(:, :)
    associate (a => blocks%first(block), b => blocks%first(other))
      allocate (c(blocks%substituted(block)%forward%n, blocks%substituted(other)%forward%n))
      call response%product(blocks%substituted(block), blocks%substituted(other), block == other, c)
      value(a:a + size(c, 1) - 1, b:b + size(c, 2) - 1) = c
      if (block /= other) value(b:b + size(c, 2) - 1, a:a + size(c, 1) - 1) = transpose(c)
    end associate
  end subroutine multiply_blocks

  !> Whether rows of two congruent bodies are the same, each in the axes of the representative of their class.
  logical function have_same_rows(block_b, rotation_b, place_b, block_c, rotation_c, place_c) result(same)
    type(contact_block_t), intent(in) :: block_b  !! Rows of B of the one body.
    type(contact_block_t), intent(in) :: block_c  !! Rows of B of the other body.
    !> Rotation from the representative to each body, as columns (dimension, dimension) [].
    real(dp), intent(in) :: rotation_b(:, :), rotation_c(:, :)
    integer, intent(in) :: place_b(:), place_c(:)  !! Which of its rows (n).
    real(dp), allocatable :: difference(:, :)
    real(dp) :: largest
    integer :: i
    same = .false.
    if (size(place_b) /= size(place_c) .or. block_b%n_nodes /= block_c%n_nodes) return
    if (any(block_b%node_numbers() /= block_c%node_numbers())) return
    allocate (difference(size(rotation_b, 1), block_b%n_nodes), source=0.0_dp)
    do i = 1, size(place_b)
      largest = 0
      call add_row(block_b, place_b(i), rotation_b, 1.0_dp, difference, largest)
      call add_row(block_c, place_c(i), rotation_c, -1.0_dp, difference, largest)
      if (.not. is_small(block_b, place_b(i), difference, rounding*largest)) return
      if (.not. is_small(block_c, place_c(i), difference, rounding*largest)) return
      call clear(block_b, place_b(i), difference)
      call clear(block_c, place_c(i), difference)
    end do
    same = .true.
  end function have_same_rows

  !> Add a row in the axes of the representative.
  pure subroutine add_row(block, row, axes, factor, sum, largest)
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: row  !! Which of its rows.
    real(dp), intent(in) :: axes(:, :)  !! As `rotation_b` (dimension, dimension) [].
    real(dp), intent(in) :: factor  !! 1 to add, -1 to subtract [].
    real(dp), intent(inout) :: sum(:, :)  !! By nodes (dimension, n_nodes) [].
    real(dp), intent(inout) :: largest  !! Largest entry so far [].
    integer :: k, d, node, component
    d = size(sum, 1)
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      node = (block%matrix%column(k) - 1)/d + 1
      component = block%matrix%column(k) - (node - 1)*d
      sum(:, node) = sum(:, node) + factor*block%matrix%value(k)*axes(component, :)
      largest = max(largest, abs(block%matrix%value(k)))
    end do
  end subroutine add_row

  !> Whether the nodes of a row have small entries.
  pure logical function is_small(block, row, values, limit)
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: row  !! Which of its rows.
    real(dp), intent(in) :: values(:, :)  !! Sum of the rows, by nodes (dimension, n_nodes) [].
    real(dp), intent(in) :: limit  !! Largest absolute value that is small [].
    integer :: k
    is_small = .false.
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      if (any(abs(values(:, (block%matrix%column(k) - 1)/size(values, 1) + 1)) > limit)) return
    end do
    is_small = .true.
  end function is_small

  !> Set the nodes of a row to zero.
  pure subroutine clear(block, row, values)
    type(contact_block_t), intent(in) :: block  !! One body's rows of B.
    integer, intent(in) :: row  !! Which of its rows.
    real(dp), intent(inout) :: values(:, :)  !! Sum of the rows, by nodes (dimension, n_nodes) [].
    integer :: k
    do k = block%matrix%row_start(row), block%matrix%row_start(row + 1) - 1
      values(:, (block%matrix%column(k) - 1)/size(values, 1) + 1) = 0
    end do
  end subroutine clear
end module dotyk_scheme_entry_forming
