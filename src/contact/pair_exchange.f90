!> Contact pairs that one rank each has discretized, made known to all ranks.
module dotyk_contact_pair_exchange
  use dotyk_base_kinds, only: dp
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: all_ranks, item_t, share
  implicit none
  private
  public :: pack_pair, share_pairs, unpack_pair

  !> Numbers of a pair that are no arrays.
  integer, parameter :: n_scalars = 20
  !> Length of an array that is not allocated.
  real(dp), parameter :: not_there = -1

contains

  !> Make pairs known to all ranks.
  subroutine share_pairs(owner, pair)
    !> Rank of each pair, or `all_ranks` where all have it (n_pairs).
    integer, intent(in) :: owner(:)
    !> Those of this rank in, all out, but for the names (n_pairs).
    type(contact_pair_t), intent(inout) :: pair(:)
    type(item_t), allocatable :: item(:)
    integer, allocatable :: dealt(:)
    integer :: i, k
    dealt = pack([(k, k=1, size(owner))], owner /= all_ranks)
    if (n_ranks() == 1 .or. size(dealt) == 0) return
    allocate (item(size(dealt)))
    do i = 1, size(dealt)
      if (owner(dealt(i)) == this_rank()) call pack_pair(pair(dealt(i)), item(i)%value)
    end do
    call share(owner(dealt), item)
    do i = 1, size(dealt)
      if (owner(dealt(i)) /= this_rank()) call unpack_pair(item(i)%value, pair(dealt(i)))
    end do
  end subroutine share_pairs

  !> A pair as numbers.
  pure subroutine pack_pair(pair, list)
    !> The pair.
    type(contact_pair_t), intent(in) :: pair
    !> The numbers (any) [any].
    real(dp), allocatable, intent(out) :: list(:)
    list = [real([pair%body_a, pair%body_b, pair%dimension, pair%discretization, pair%n_points, pair%n_unprojected, &
                  pair%n_not_facing, pair%n_outside, pair%n_too_far, pair%gap_kind, merge(1, 0, pair%is_layer), &
                  pair%n_rows, pair%n_point_contacts, pair%n_mortar_rows, pair%n_mortar_points], dp), &
            pair%lost_not_facing, pair%lost_outside, pair%lost_too_far, pair%theta, real(pair%average%n_columns, dp)]
    call add_table(list, pair%position)
    call add_table(list, pair%normal)
    call add(list, pair%weight)
    call add(list, pair%gap)
    call add_integers(list, pair%facet_a)
    call add_table(list, pair%xi_a)
    call add_integers(list, pair%facet_b)
    call add_table(list, pair%xi_b)
    call add_integers(list, pair%average%row_start)
    call add_integers(list, pair%average%column)
    call add(list, pair%average%value)
    call add_integers(list, pair%row_corner)
    call add_table(list, pair%row_position)
    call add_table(list, pair%row_normal)
    call add(list, pair%row_weight)
    call add(list, pair%row_gap)
    call add(list, pair%row_theta)
  end subroutine pack_pair

  !> A pair from numbers.
  pure subroutine unpack_pair(list, pair)
    !> The numbers of `pack_pair` (any) [any].
    real(dp), intent(in) :: list(:)
    !> The pair, without its name.
    type(contact_pair_t), intent(out) :: pair
    integer :: number(15), n
    number = nint(list(:15))
    pair%body_a = number(1)
    pair%body_b = number(2)
    pair%dimension = number(3)
    pair%discretization = number(4)
    pair%n_points = number(5)
    pair%n_unprojected = number(6)
    pair%n_not_facing = number(7)
    pair%n_outside = number(8)
    pair%n_too_far = number(9)
    pair%gap_kind = number(10)
    pair%is_layer = number(11) == 1
    pair%n_rows = number(12)
    pair%n_point_contacts = number(13)
    pair%n_mortar_rows = number(14)
    pair%n_mortar_points = number(15)
    pair%lost_not_facing = list(16)
    pair%lost_outside = list(17)
    pair%lost_too_far = list(18)
    pair%theta = list(19)
    n = n_scalars
    call take_table(list, n, pair%dimension, pair%position)
    call take_table(list, n, pair%dimension, pair%normal)
    call take(list, n, pair%weight)
    call take(list, n, pair%gap)
    call take_integers(list, n, pair%facet_a)
    call take_table(list, n, pair%dimension - 1, pair%xi_a)
    call take_integers(list, n, pair%facet_b)
    call take_table(list, n, pair%dimension - 1, pair%xi_b)
    pair%average%n_columns = nint(list(20))
    call take_integers(list, n, pair%average%row_start)
    if (allocated(pair%average%row_start)) pair%average%n_rows = size(pair%average%row_start) - 1
    call take_integers(list, n, pair%average%column)
    call take(list, n, pair%average%value)
    call take_integers(list, n, pair%row_corner)
    call take_table(list, n, pair%dimension, pair%row_position)
    call take_table(list, n, pair%dimension, pair%row_normal)
    call take(list, n, pair%row_weight)
    call take(list, n, pair%row_gap)
    call take(list, n, pair%row_theta)
  end subroutine unpack_pair

  !> Append an array with its length.
  pure subroutine add(list, value)
    !> The numbers so far [any].
    real(dp), allocatable, intent(inout) :: list(:)
    !> The array, or none (n) [any].
    real(dp), allocatable, intent(in) :: value(:)
    if (allocated(value)) then
      list = [list, real(size(value), dp), value]
    else
      list = [list, not_there]
    end if
  end subroutine add

  !> Append integers with their number.
  pure subroutine add_integers(list, value)
    !> The numbers so far [any].
    real(dp), allocatable, intent(inout) :: list(:)
    !> The integers, or none (n).
    integer, allocatable, intent(in) :: value(:)
    real(dp), allocatable :: reals(:)
    if (allocated(value)) reals = value
    call add(list, reals)
  end subroutine add_integers

  !> Append a table, column by column.
  pure subroutine add_table(list, value)
    !> The numbers so far [any].
    real(dp), allocatable, intent(inout) :: list(:)
    !> The table, or none (rows, n) [any].
    real(dp), allocatable, intent(in) :: value(:, :)
    real(dp), allocatable :: flat(:)
    if (allocated(value)) flat = reshape(value, [size(value)])
    call add(list, flat)
  end subroutine add_table

  !> Take an array from the numbers.
  pure subroutine take(list, n, value)
    !> The numbers [any].
    real(dp), intent(in) :: list(:)
    !> Numbers taken so far; updated.
    integer, intent(inout) :: n
    !> The array; not allocated if there is none (any) [any].
    real(dp), allocatable, intent(out) :: value(:)
    integer :: length
    length = nint(list(n + 1))
    n = n + 1
    if (length < 0) return
    value = list(n + 1:n + length)
    n = n + length
  end subroutine take

  !> Take integers from the numbers.
  pure subroutine take_integers(list, n, value)
    !> The numbers [any].
    real(dp), intent(in) :: list(:)
    !> Numbers taken so far; updated.
    integer, intent(inout) :: n
    !> The integers; not allocated if there are none (any).
    integer, allocatable, intent(out) :: value(:)
    real(dp), allocatable :: reals(:)
    call take(list, n, reals)
    if (allocated(reals)) value = nint(reals)
  end subroutine take_integers

  !> Take a table from the numbers.
  pure subroutine take_table(list, n, rows, value)
    !> The numbers [any].
    real(dp), intent(in) :: list(:)
    !> Numbers taken so far; updated.
    integer, intent(inout) :: n
    !> Rows of the table.
    integer, intent(in) :: rows
    !> The table; not allocated if there is none (rows, any) [any].
    real(dp), allocatable, intent(out) :: value(:, :)
    real(dp), allocatable :: flat(:)
    call take(list, n, flat)
    if (allocated(flat)) value = reshape(flat, [rows, size(flat)/max(1, rows)])
  end subroutine take_table
end module dotyk_contact_pair_exchange
