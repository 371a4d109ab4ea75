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
  use dotyk_response_response, only: response_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_entry_forming, only: body_operator_t
  implicit none
  private
  public :: make_batches, solve_bodies, multiply_bodies, share_moved

  !> Congruent bodies that one thread works on together.
  type, public :: batch_t
    !> The bodies, ascending (n).
    integer, allocatable :: body(:)
    !> Cost of a product of all of them, in entries that a single solve goes through twice [].
    real(dp) :: cost = 0
  end type batch_t

  !> Displacements of one body's rows.
  type, public :: row_displacement_t
    !> (n) [length].
    real(dp), allocatable :: value(:)
  end type row_displacement_t

  !> Bodies of a batch at most: the gain grows little beyond.
  integer, parameter :: most_bodies = 8
  !> Batches that a class has at least, if it has as many bodies: work for as many threads.
  integer, parameter :: least_batches = 8
  !> Cost of a product of one body over that of a further one in a batch: dense products reuse the entries.
  real(dp), parameter :: gain_of_blocks = 4

contains

  !> Put the bodies that may touch others in batches, those with most work first.
  subroutine make_batches(body, n_rows, batch)
    !> Operators of the bodies (n_bodies).
    type(body_operator_t), intent(in) :: body(:)
    !> Contact rows of each body (n_bodies).
    integer, intent(in) :: n_rows(:)
    !> The batches (n_batches).
    type(batch_t), allocatable, intent(out) :: batch(:)
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
        associate (cost => body(found(n)%body)%cost)
          found(n)%cost = max(maxval(cost), sum(cost)/gain_of_blocks)
        end associate
      end do
    end do
    allocate (order(n), batch(n))
    call sort_order(-found(:n)%cost, order)
    batch = found(order)
  end subroutine make_batches

  !> B_b K_b^+ B_b^T lambda of congruent bodies, by one solve with a block of right-hand sides.
  subroutine solve_bodies(response, body, block, chosen, lambda, moved)
    !> Compliance operator of their class.
    class(response_t), intent(in) :: response
    !> Operators of all bodies (n_bodies).
    type(body_operator_t), intent(in) :: body(:)
    !> Rows of B of all bodies (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> The congruent bodies (n).
    integer, intent(in) :: chosen(:)
    !> Contact forces (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> Gets the displacements of the rows of the chosen bodies (n_bodies).
    type(row_displacement_t), intent(inout) :: moved(:)
    real(dp), allocatable :: nodal(:), x(:, :)
    integer :: j
    if (size(chosen) == 0) return
    allocate (x(size(response%mode, 1), size(chosen)))
    do j = 1, size(chosen)
      associate (own => body(chosen(j)), rows => block(chosen(j)))
        allocate (nodal(own%map%dimension*own%map%n_nodes))
        call rows%matrix%multiply_transposed(lambda(rows%row), nodal)
        call own%map%scatter(nodal, x(:, j))
        deallocate (nodal)
      end associate
    end do
    if (size(chosen) == 1) then
      call response%solve(x(:, 1))
    else
      call response%solve_block(x)
    end if
    do j = 1, size(chosen)
      associate (own => body(chosen(j)), rows => block(chosen(j)), displacement => moved(chosen(j)))
        allocate (nodal(own%map%dimension*own%map%n_nodes), displacement%value(size(rows%row)))
        call own%map%gather(x(:, j), nodal)
        call rows%matrix%multiply(nodal, displacement%value)
        deallocate (nodal)
      end associate
    end do
  end subroutine solve_bodies

  !> The same by their matrices; bodies with one matrix together.
  subroutine multiply_bodies(matrix, chosen, force, moved)
    !> Formed at all rows with forces of the chosen bodies.
    type(dense_compliance_t), intent(in) :: matrix
    !> The bodies (n).
    integer, intent(in) :: chosen(:)
    !> Contact forces, at the rows of the QP of `init` (all its rows) [force].
    real(dp), intent(in) :: force(:)
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
    !> Rank of each body (n_bodies).
    integer, intent(in) :: owner(:)
    !> Contact forces, which must be the same on all ranks (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
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
