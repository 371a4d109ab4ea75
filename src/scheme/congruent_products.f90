!> Products of the compliances of congruent bodies, several bodies at a time.
!>
!> A solve with one right-hand side reads the whole factor for two operations with each entry; congruent bodies, which
!> share the factor, are solved as one block of right-hand sides. So are products with a matrix that they share. Batches
!> follow from the bodies alone: results do not depend on the number of threads that work on them.
module dotyk_scheme_congruent_products
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: is_own, item_t, share
  use dotyk_response_response, only: equation_vector_t, response_slot_t, response_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_entry_forming, only: body_operator_t
  implicit none
  private
  public :: make_batches, sweep_costs, solve_together, solve_bodies, multiply_bodies, share_moved

  type, public :: batch_t  !! Congruent bodies that one thread works on together.
    integer, allocatable :: body(:)  !! The bodies, ascending (n).
    real(dp) :: cost = 0  !! Cost of a product of all of them, in entries that a single solve goes through twice [].
  end type batch_t

  type, public :: row_displacement_t  !! Displacements of one body's rows.
    real(dp), allocatable :: value(:)  !! (n) [length].
  end type row_displacement_t

  integer, parameter :: most_bodies = 8  !! Bodies of a batch at most: the gain grows little beyond.
  !> Batches that a class has at least, if it has as many bodies: work for as many threads.
  integer, parameter :: least_batches = 8

contains

  !> Put the bodies that may touch others in batches, those with most work first.
  subroutine make_batches(body, n_rows, batch)
    type(body_operator_t), intent(in) :: body(:)  !! Operators of the bodies (n_bodies).
    integer, intent(in) :: n_rows(:)  !! Contact rows of each body (n_bodies).
    type(batch_t), allocatable, intent(out) :: batch(:)  !! The batches (n_batches).
    type(batch_t), allocatable :: found(:)
    integer, allocatable :: member(:), order(:)
    integer :: b, first, n, size_of_batch
    allocate (found(size(body)))
    n = 0
    do b = 1, size(body)
      if (body(b)%representative /= b) cycle
      member = pack([(first, first=1, size(body))], body%representative == b .and. n_rows > 0)
      size_of_batch = max(1, min(most_bodies, size(member)/least_batches))
      do first = 1, size(member), size_of_batch
        n = n + 1
        found(n)%body = member(first:min(size(member), first + size_of_batch - 1))
        ! The entries are read once.
        found(n)%cost = maxval(body(found(n)%body)%cost)
      end do
    end do
    allocate (order(n), batch(n))
    call sort_order(-found(:n)%cost, order)
    batch = found(order)
  end subroutine make_batches

  !> Costs of the parts of a product, which threads share: batches of congruent bodies. Of all bodies, which are solved
  !> without contact, where none may touch another.
  subroutine sweep_costs(body, block, cost)
    type(body_operator_t), intent(in) :: body(:)  !! Operators of the bodies (n_bodies).
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B of each body (n_bodies).
    real(dp), allocatable, intent(out) :: cost(:)  !! Entries that a solve goes through twice (n).
    type(batch_t), allocatable :: batch(:)
    integer :: b
    call make_batches(body, [(size(block(b)%row), b=1, size(block))], batch)
    cost = body%cost
    if (size(batch) > 0) cost = batch%cost
  end subroutine sweep_costs

  !> B_b K_b^+ B_b^T lambda of congruent bodies, by one solve with a block of right-hand sides.
  subroutine solve_bodies(response, body, block, chosen, lambda, moved)
    class(response_t), intent(in) :: response  !! Compliance operator of their class.
    type(body_operator_t), intent(in) :: body(:)  !! Operators of all bodies (n_bodies).
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B of all bodies (n_bodies).
    integer, intent(in) :: chosen(:)  !! The congruent bodies (n).
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    !> Gets the displacements of the rows of the chosen bodies (n_bodies).
    type(row_displacement_t), intent(inout) :: moved(:)
    real(dp), allocatable :: x(:, :)
    integer :: j
    if (size(chosen) == 0) return
    allocate (x(size(response%mode, 1), size(chosen)))
    do j = 1, size(chosen)
      call contact_forces(body(chosen(j)), block(chosen(j)), lambda, x(:, j))
    end do
    if (size(chosen) == 1) then
      call response%solve(x(:, 1))
    else
      call response%solve_block(x)
    end if
    do j = 1, size(chosen)
      call move_rows(body(chosen(j)), block(chosen(j)), x(:, j), moved(chosen(j)))
    end do
  end subroutine solve_bodies

  !> The same of all bodies by one solve of all.
  subroutine solve_together(response, body, block, lambda, moved)
    !> Compliance operators of the bodies, which are solved together (n_bodies).
    type(response_slot_t), intent(in) :: response(:)
    type(body_operator_t), intent(in) :: body(:)  !! Operators of all bodies (n_bodies).
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B of all bodies (n_bodies).
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    !> Gets the displacements of the rows of bodies that have some (n_bodies).
    type(row_displacement_t), intent(inout) :: moved(:)
    type(equation_vector_t) :: x(size(body))
    integer :: b
    do b = 1, size(body)
      allocate (x(b)%value(size(response(b)%form%mode, 1)))
      call contact_forces(body(b), block(b), lambda, x(b)%value)
    end do
    call response(1)%form%solve_together(x)
    do b = 1, size(body)
      if (size(block(b)%row) > 0) call move_rows(body(b), block(b), x(b)%value, moved(b))
    end do
  end subroutine solve_together

  !> B_b^T lambda.
  subroutine contact_forces(body, block, lambda, x)
    type(body_operator_t), intent(in) :: body  !! Operator of the body.
    type(contact_block_t), intent(in) :: block  !! Its rows of B.
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(out) :: x(:)  !! Over the equations of the body (n_equations) [force].
    real(dp) :: nodal(body%map%dimension*body%map%n_nodes)
    call block%matrix%multiply_transposed(lambda(block%row), nodal)
    call body%map%scatter(nodal, x)
  end subroutine contact_forces

  !> B_b x.
  subroutine move_rows(body, block, x, moved)
    type(body_operator_t), intent(in) :: body  !! Operator of the body.
    type(contact_block_t), intent(in) :: block  !! Its rows of B.
    real(dp), intent(in) :: x(:)  !! Over the equations of the body (n_equations) [length].
    type(row_displacement_t), intent(inout) :: moved  !! Gets the displacements of its rows.
    real(dp) :: nodal(body%map%dimension*body%map%n_nodes)
    allocate (moved%value(size(block%row)))
    call body%map%gather(x, nodal)
    call block%matrix%multiply(nodal, moved%value)
  end subroutine move_rows

  !> The same by their matrices; bodies with one matrix together.
  subroutine multiply_bodies(matrix, chosen, force, moved)
    type(dense_compliance_t), intent(in) :: matrix  !! Formed at all rows with forces of the chosen bodies.
    integer, intent(in) :: chosen(:)  !! The bodies (n).
    real(dp), intent(in) :: force(:)  !! Contact forces, at the rows of the QP of `begin` (all its rows) [force].
    !> Gets the displacements of the formed rows of the chosen bodies, in their order (n_bodies).
    type(row_displacement_t), intent(inout) :: moved(:)
    integer :: owner(size(chosen)), j, k
    integer, allocatable :: alike(:)
    real(dp), allocatable :: displacement(:, :)
    owner = [(matrix%owner(chosen(j)), j=1, size(chosen))]
    do j = 1, size(chosen)
      if (any(owner(:j - 1) == owner(j))) cycle
      alike = pack(chosen, owner == owner(j))
      if (size(alike) == 1) then
        call matrix%multiply_body(alike(1), force, moved(alike(1))%value)
        cycle
      end if
      call matrix%multiply_alike(alike, force, displacement)
      do k = 1, size(alike)
        moved(alike(k))%value = displacement(:, k)
      end do
    end do
  end subroutine multiply_bodies

  !> Make the displacements of the rows of all bodies known to all ranks.
  subroutine share_moved(owner, lambda, moved)
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    real(dp), intent(in) :: lambda(:)  !! Contact forces, which must be the same on all ranks (n_rows) [force].
    !> Displacements of the bodies of this rank in, of all bodies out (n_bodies).
    type(row_displacement_t), intent(inout) :: moved(:)
    type(item_t) :: item(size(moved))
    integer :: b
    if (n_ranks() == 1) return
    do b = 1, size(moved)
      if (is_own(owner(b))) call move_alloc(moved(b)%value, item(b)%value)
    end do
    call share(owner, item, lambda)
    do b = 1, size(moved)
      call move_alloc(item(b)%value, moved(b)%value)
    end do
  end subroutine share_moved
end module dotyk_scheme_congruent_products
