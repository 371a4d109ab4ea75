!> A contact QP on fewer rows: restricted to some of them, or with rows aggregated to groups.
!>
!> A restriction leaves out rows that stay inactive; it has the same compliance operator. A group of an aggregation is
!> one row: weighted mean gap and displacement of its rows, one force distributed over them by weight.
module dotyk_scheme_restriction
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, mode_block_t
  use dotyk_scheme_compliance, only: compliance_t, entries_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: restrict_qp, aggregate_qp, aggregate_values, aggregate_compliance, form_aggregate, join_qp, join_state, &
    merge_bodies, part_state

  type, public :: index_list_t  !! Some rows.
    integer, allocatable :: value(:)  !! Their numbers.
  end type index_list_t


contains

  !> The QP on some of its rows.
  subroutine restrict_qp(qp, keep, part)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, intent(in) :: keep(:)  !! Rows to keep (n_rows).
    type(contact_qp_t), intent(out) :: part  !! The QP of these rows.
    real(dp), allocatable :: fraction(:)
    integer, allocatable :: group(:)
    integer :: i, n
    allocate (group(size(keep)), source=0)
    n = count(keep)
    group(pack([(i, i=1, size(keep))], keep)) = [(i, i=1, n)]
    call join_groups(qp, group, n, part, fraction)
    part%level = qp%level
    part%parent_row = pack(qp%parent_row, keep)
  end subroutine restrict_qp

  !> The QP on groups of its rows.
  subroutine aggregate_qp(qp, group, n_groups, aggregated, fraction)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    integer, intent(in) :: group(:)  !! Group of each row; groups are numbered pair by pair (n_rows).
    integer, intent(in) :: n_groups  !! Number of groups.
    type(contact_qp_t), intent(out) :: aggregated  !! The QP of the groups.
    real(dp), allocatable, intent(out) :: fraction(:)  !! Fraction of each row in the weight of its group (n_rows) [].
    integer :: i
    call join_groups(qp, group, n_groups, aggregated, fraction)
    aggregated%level = qp%level + 1
    aggregated%parent_row = [(i, i=1, n_groups)]
  end subroutine aggregate_qp

  !> The compliance of groups of rows from that of the rows, `S C S^T` with the fractions S.
  subroutine aggregate_compliance(qp, compliance, group, fraction, aggregated, of_groups)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(in) :: compliance  !! Formed at the rows of `qp`.
    integer, intent(in) :: group(:)  !! Group of each row (n_rows).
    real(dp), intent(in) :: fraction(:)  !! Fraction of each row in the weight of its group (n_rows) [].
    type(contact_qp_t), intent(in) :: aggregated  !! The QP of the groups.
    type(dense_compliance_t), intent(out) :: of_groups  !! Their compliance.
    integer, allocatable :: place_of(:)
    real(dp), allocatable :: entries(:, :), half(:, :), value(:, :)
    integer :: b, i, j, n
    call of_groups%init(aggregated)
    allocate (place_of(aggregated%n_rows))
    do b = 1, size(qp%block)
      associate (row => qp%block(b)%row, group_row => aggregated%block(b)%row)
        n = size(group_row)
        place_of(group_row) = [(i, i=1, n)]
        call compliance%get_entries(qp, b, row, entries)
        allocate (half(n, size(row)), value(n, n), source=0.0_dp)
        do j = 1, size(row)
          do i = 1, size(row)
            associate (at => place_of(group(row(i))))
              half(at, j) = half(at, j) + fraction(row(i))*entries(i, j)
            end associate
          end do
        end do
        do j = 1, size(row)
          associate (at => place_of(group(row(j))))
            value(:, at) = value(:, at) + fraction(row(j))*half(:, j)
          end associate
        end do
        call of_groups%set(aggregated, b, value)
        deallocate (half, value)
      end associate
    end do
  end subroutine aggregate_compliance

  !> The entries of groups whose rows have none.
  subroutine form_aggregate(aggregated, compliance, of_groups)
    type(contact_qp_t), intent(in) :: aggregated  !! The QP of the groups.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator of the bodies.
    type(dense_compliance_t), intent(out) :: of_groups  !! That of the groups.
    type(entries_t), allocatable :: entries(:)
    integer :: b
    call compliance%form_all(aggregated, entries)
    call of_groups%init(aggregated)
    do b = 1, size(entries)
      call of_groups%set(aggregated, b, entries(b)%value)
    end do
  end subroutine form_aggregate

  !> The QP of the pressures that are left at seams (`seam`).
  subroutine join_qp(qp, joined, fraction)
    type(contact_qp_t), intent(in) :: qp  !! With seams.
    type(contact_qp_t), intent(out) :: joined  !! The QP.
    type(sparse_rows_t), intent(out) :: fraction  !! Fraction of each row in the weight of the joined ones [].
    integer :: b, i, k
    call join_rows(qp, qp%seam, joined, fraction)
    joined%level = qp%level + 1
    joined%parent_row = [(i, i=1, joined%n_rows)]
    ! Motions that move the rows of both sides in opposite directions, as a rotation moves the two rows of one vertex of
    ! a polygon, leave rounding in their mean.
    do b = 1, size(joined%block)
      associate (mean => joined%coarse%block(b)%value, each => qp%coarse%block(b)%value)
        do k = 1, size(mean, 2)
          where (abs(mean(:, k)) < rounding*maxval(abs(each(:, k)))) mean(:, k) = 0
        end do
      end associate
    end do
  end subroutine join_qp

  !> A state of the rows as a start for the pressures that are left at seams.
  subroutine join_state(fraction, state)
    type(sparse_rows_t), intent(in) :: fraction  !! As in `join_qp`.
    type(solver_state_t), intent(inout) :: state  !! The state.
    real(dp) :: left(fraction%n_columns)
    if (allocated(state%m)) then
      call fraction%multiply_transposed(state%m, left)
      state%m = left
    end if
    if (allocated(state%y)) then
      call fraction%multiply_transposed(state%y, left)
      state%y = left
    end if
  end subroutine join_state

  !> The pressures of all rows from those that are left at seams.
  subroutine part_state(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! With seams.
    type(solver_state_t), intent(inout) :: state  !! The state; its penetrations are left to the caller.
    real(dp) :: m(qp%n_rows)
    call qp%seam%multiply(state%m, m)
    state%m = m
    if (allocated(state%y)) deallocate (state%y)
  end subroutine part_state

  !> The QP in which groups of bodies are one body each, with the rigid body motions of the group. Its rows of B are
  !> empty: the compliance of the groups is known otherwise.
  subroutine merge_bodies(qp, row, mode, resultant, merged)
    type(contact_qp_t), intent(in) :: qp  !! The QP.
    type(index_list_t), intent(in) :: row(:)  !! Rows of each group, ascending (n_groups).
    type(mode_block_t), intent(in) :: mode(:)  !! These rows by the motions of the groups (n_groups) [].
    type(mode_block_t), intent(in) :: resultant(:)  !! Of the loads on the motions, (n, 1) each (n_groups) [force].
    type(contact_qp_t), intent(out) :: merged  !! The QP of the groups.
    real(dp) :: most
    integer :: g, j, n
    merged = qp
    deallocate (merged%block)
    allocate (merged%block(size(row)))
    call merged%coarse%destroy()
    associate (coarse => merged%coarse)
      allocate (coarse%first(size(row) + 1), coarse%block(size(row)), coarse%translation(size(row)))
      coarse%first(1) = 1
      do g = 1, size(row)
        coarse%first(g + 1) = coarse%first(g) + size(mode(g)%value, 2)
      end do
      coarse%n = coarse%first(size(row) + 1) - 1
      allocate (coarse%is_slide(coarse%n), source=.false.)
      allocate (coarse%resultant(coarse%n), coarse%scale(coarse%n), coarse%mean_square(coarse%n), source=1.0_dp)
      do g = 1, size(row)
        n = size(row(g)%value)
        merged%block(g)%row = row(g)%value
        allocate (merged%block(g)%contact_node(0))
        call merged%block(g)%matrix%init_from_triplets(n, 0, [integer ::], [integer ::], [real(dp) ::])
        allocate (coarse%translation(g)%value(size(mode(g)%value, 2), 0))
        coarse%block(g)%value = mode(g)%value
        do j = 1, size(mode(g)%value, 2)
          associate (k => coarse%first(g) + j - 1, own => coarse%block(g)%value)
            most = maxval([0.0_dp, abs(own(:, j))])
            if (most > 0) coarse%scale(k) = 1/most
            own(:, j) = coarse%scale(k)*own(:, j)
            coarse%resultant(k) = coarse%scale(k)*resultant(g)%value(j, 1)
          end associate
        end do
      end do
      call coarse%take_rows(merged%block, merged%n_rows)
    end associate
  end subroutine merge_bodies

  !> The QP on groups of rows, of one row or of several; level and parent rows are left to the caller.
  subroutine join_groups(qp, group, n_groups, joined, fraction)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    integer, intent(in) :: group(:)  !! Group of each row, 0 where it is not in the aggregation (n_rows).
    integer, intent(in) :: n_groups  !! Number of groups.
    type(contact_qp_t), intent(out) :: joined  !! The QP of the groups.
    real(dp), allocatable, intent(out) :: fraction(:)  !! Fraction of each row in the weight of its group (n_rows) [].
    type(sparse_rows_t) :: share, of_rows
    integer :: i
    share%n_rows = size(group)
    share%n_columns = n_groups
    allocate (share%row_start(size(group) + 1))
    share%row_start(1) = 1
    do i = 1, size(group)
      share%row_start(i + 1) = share%row_start(i) + merge(1, 0, group(i) > 0)
    end do
    share%column = pack(group, group > 0)
    share%value = [(1.0_dp, i=1, size(share%column))]
    call join_rows(qp, share, joined, of_rows)
    fraction = unpack(of_rows%value, group > 0, [(0.0_dp, i=1, size(group))])
  end subroutine join_groups

  !> The QP of other pressures, of which those of the rows are sums.
  subroutine join_rows(qp, share, joined, fraction)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    !> Pressures of the rows from the other ones; no entries for rows that are left out (n_rows, n_joined) [].
    type(sparse_rows_t), intent(in) :: share
    type(contact_qp_t), intent(out) :: joined  !! The QP of the other pressures.
    type(sparse_rows_t), intent(out) :: fraction  !! Fractions of the rows in the weights of these [].
    integer :: home(share%n_columns), i, k, b
    associate (n => share%n_columns)
      joined%n_rows = n
      joined%dimension = qp%dimension
      allocate (joined%is_tied(n), source=.false.)
      allocate (joined%weight(n), joined%gap(n), joined%theta(n), joined%initial_penetration(n), &
                joined%load_displacement(n), joined%foundation(n))
      call share%multiply_transposed(qp%weight, joined%weight)
      fraction = share
      home = share%n_rows
      do i = share%n_rows, 1, -1
        do k = share%row_start(i), share%row_start(i + 1) - 1
          associate (j => share%column(k))
            fraction%value(k) = share%value(k)*qp%weight(i)/joined%weight(j)
            joined%is_tied(j) = qp%is_tied(i)
            ! Interpolated rows may be in pairs before.
            if (.not. share%value(k) < 1) home(j) = i
          end associate
        end do
      end do
      call fraction%multiply_transposed(qp%gap, joined%gap)
      call fraction%multiply_transposed(qp%theta, joined%theta)
      call fraction%multiply_transposed(qp%initial_penetration, joined%initial_penetration)
      call fraction%multiply_transposed(qp%load_displacement, joined%load_displacement)
      call fraction%multiply_transposed(qp%foundation, joined%foundation)
    end associate
    joined%pair_first_row = [(1 + count(home < qp%pair_first_row(k)), k=1, size(qp%pair_first_row))]
    joined%energy_0 = qp%energy_0
    joined%norm_square_0 = qp%norm_square_0
    allocate (joined%block(size(qp%block)))
    do b = 1, size(qp%block)
      call join_block(qp%block(b), fraction, joined%block(b))
    end do
    call join_modes(qp, fraction, joined%block, joined%coarse)
  end subroutine join_rows

  !> Weighted means of values over groups.
  pure function aggregate_values(group, n_groups, fraction, value) result(mean)
    integer, intent(in) :: group(:)  !! Group of each row, 0 where it is not in the aggregation (n_rows).
    integer, intent(in) :: n_groups  !! Number of groups.
    real(dp), intent(in) :: fraction(:)  !! Fraction of each row in the weight of its group (n_rows) [].
    real(dp), intent(in) :: value(:)  !! Values of the rows (n_rows) [any].
    real(dp) :: mean(n_groups)  !! Of the groups (n_groups).
    integer :: j
    mean = 0
    do j = 1, size(value)
      if (group(j) > 0) mean(group(j)) = mean(group(j)) + fraction(j)*value(j)
    end do
  end function aggregate_values

  !> One body's rows of B, joined.
  subroutine join_block(fine, fraction, joined)
    type(contact_block_t), intent(in) :: fine  !! The body's rows.
    type(sparse_rows_t), intent(in) :: fraction  !! Fractions of the rows in the joined ones (n_rows, n_joined) [].
    type(contact_block_t), intent(inout) :: joined  !! The body's joined rows.
    integer, allocatable :: row(:), column(:), number(:)
    real(dp), allocatable :: value(:)
    integer :: i, k, l, n
    joined%n_nodes = fine%n_nodes
    joined%contact_node = fine%contact_node
    if (allocated(fine%whole_node)) joined%whole_node = fine%whole_node
    allocate (number(fraction%n_columns), source=0)
    n = 0
    do i = 1, size(fine%row)
      associate (first => fraction%row_start(fine%row(i)), last => fraction%row_start(fine%row(i) + 1) - 1)
        number(fraction%column(first:last)) = 1
        n = n + (last - first + 1)*(fine%matrix%row_start(i + 1) - fine%matrix%row_start(i))
      end associate
    end do
    joined%row = pack([(i, i=1, size(number))], number > 0)
    number(joined%row) = [(i, i=1, size(joined%row))]
    allocate (row(n), column(n), value(n))
    n = 0
    do i = 1, fine%matrix%n_rows
      do l = fraction%row_start(fine%row(i)), fraction%row_start(fine%row(i) + 1) - 1
        do k = fine%matrix%row_start(i), fine%matrix%row_start(i + 1) - 1
          n = n + 1
          row(n) = number(fraction%column(l))
          column(n) = fine%matrix%column(k)
          value(n) = fraction%value(l)*fine%matrix%value(k)
        end do
      end do
    end do
    call joined%matrix%init_from_triplets(size(joined%row), fine%matrix%n_columns, row, column, value)
  end subroutine join_block

  !> The rigid body modes at the joined rows; scales and resultants are those of the bodies.
  subroutine join_modes(qp, fraction, block, coarse)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(sparse_rows_t), intent(in) :: fraction  !! Fractions of the rows in the joined ones (n_rows, n_joined) [].
    type(contact_block_t), intent(in) :: block(:)  !! Joined rows of B (n_bodies).
    type(coarse_space_t), intent(out) :: coarse  !! The modes at the joined rows.
    integer, allocatable :: place_of(:)
    integer :: b, i
    coarse = qp%coarse
    call coarse%take_rows(block, fraction%n_columns)
    allocate (place_of(fraction%n_columns))
    do b = 1, size(block)
      place_of(block(b)%row) = [(i, i=1, size(block(b)%row))]
      call join(qp%block(b)%row, size(block(b)%row), qp%coarse%block(b)%value, coarse%block(b)%value)
      if (allocated(coarse%deviation)) &
        call join(qp%block(b)%row, size(block(b)%row), qp%coarse%deviation(b)%value, coarse%deviation(b)%value)
    end do
  contains
    !> Rows of one body.
    subroutine join(row, n, fine, joined)
      integer, intent(in) :: row(:)  !! All rows of the body (n_fine).
      integer, intent(in) :: n  !! Number of its joined ones.
      real(dp), intent(in) :: fine(:, :)  !! Modes at its rows (n_fine, n_modes) [].
      real(dp), allocatable, intent(inout) :: joined(:, :)  !! At its joined ones (n, n_modes) [].
      integer :: j, l
      deallocate (joined)
      allocate (joined(n, size(fine, 2)), source=0.0_dp)
      do j = 1, size(row)
        do l = fraction%row_start(row(j)), fraction%row_start(row(j) + 1) - 1
          associate (at => place_of(fraction%column(l)))
            joined(at, :) = joined(at, :) + fraction%value(l)*fine(j, :)
          end associate
        end do
      end do
    end subroutine join
  end subroutine join_modes
end module dotyk_scheme_restriction
