!> Transformations of a contact QP, and their ways back: restricted to some of its rows, or with the pressures that are
!> left at seams.
!>
!> All are one: pressures of the original rows are sums of those of the transformed QP, whose gaps and displacements are
!> weighted means of the original ones. A restriction screens inactive rows; it has the same compliance operator.
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
  public :: form_entries, merge_bodies, restrict_qp

  type, public :: index_list_t  !! Some rows.
    integer, allocatable :: value(:)  !! Their numbers.
  end type index_list_t

  type, public :: transformed_qp_t  !! A QP, and how its pressures make up those of the original QP.
    type(contact_qp_t) :: qp  !! The transformed QP.
    !> Pressures of the original rows from those of this QP, without entries for screened rows, and fractions of the
    !> original rows in the weights of its rows (n_original, n_rows) [].
    type(sparse_rows_t), private :: share, fraction
  contains
    procedure :: restrict => transformed_restrict
    procedure :: join => transformed_join
    procedure :: take => transformed_take
    procedure :: pressures => transformed_pressures
    procedure :: means => transformed_means
    procedure :: active => transformed_active
    procedure :: give_back => transformed_give_back
  end type transformed_qp_t

contains

  !> A QP on some of its rows, where there is no way back.
  subroutine restrict_qp(qp, keep, part)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, intent(in) :: keep(:)  !! Rows to keep (n_rows).
    type(contact_qp_t), intent(out) :: part  !! The QP of these rows.
    type(transformed_qp_t) :: restricted
    call restricted%restrict(qp, keep)
    part = restricted%qp
  end subroutine restrict_qp

  !> A QP on some of its rows.
  subroutine transformed_restrict(self, qp, keep)
    class(transformed_qp_t), intent(out) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, intent(in) :: keep(:)  !! Rows to keep (n_rows).
    integer :: i
    call join_rows(qp, selection(unpack([(i, i=1, count(keep))], keep, 0), count(keep)), self)
    self%qp%level = qp%level
    self%qp%parent_row = pack(qp%parent_row, keep)
  end subroutine transformed_restrict

  !> The QP of the pressures that are left at seams (`seam`).
  subroutine transformed_join(self, qp)
    class(transformed_qp_t), intent(out) :: self
    type(contact_qp_t), intent(in) :: qp  !! With seams.
    integer :: b, k
    call join_rows(qp, qp%seam, self)
    ! Motions that move the rows of both sides in opposite directions, as a rotation moves the two rows of one vertex of
    ! a polygon, leave rounding in their mean.
    do b = 1, size(self%qp%block)
      associate (mean => self%qp%coarse%block(b)%value, each => qp%coarse%block(b)%value)
        do k = 1, size(mean, 2)
          where (abs(mean(:, k)) < rounding*maxval(abs(each(:, k)))) mean(:, k) = 0
        end do
      end associate
    end do
  end subroutine transformed_join

  !> A state of the original QP as a start.
  subroutine transformed_take(self, state)
    class(transformed_qp_t), intent(in) :: self
    type(solver_state_t), intent(inout) :: state  !! The state.
    if (allocated(state%pressure)) state%pressure = self%means(state%pressure)
    if (allocated(state%penetration)) state%penetration = self%means(state%penetration)
  end subroutine transformed_take

  !> The pressures of the original rows.
  function transformed_pressures(self, pressure) result(of_rows)
    class(transformed_qp_t), intent(in) :: self
    real(dp), intent(in) :: pressure(:)  !! Those of the transformed QP (n_rows) [pressure].
    real(dp) :: of_rows(self%share%n_rows)  !! [pressure]
    call self%share%multiply(pressure, of_rows)
  end function transformed_pressures

  !> Means of numbers of the original rows.
  function transformed_means(self, value) result(mean)
    class(transformed_qp_t), intent(in) :: self
    real(dp), intent(in) :: value(:)  !! (n_rows of the original QP) [any].
    real(dp) :: mean(self%qp%n_rows)  !! Those of the transformed QP.
    call self%fraction%multiply_transposed(value, mean)
  end function transformed_means

  !> Active rows of the transformed QP: all original rows that have their pressure alone are active.
  pure function transformed_active(self, active) result(of_joined)
    class(transformed_qp_t), intent(in) :: self
    logical, intent(in) :: active(:)  !! Of the original rows (n_rows of the original QP).
    logical :: of_joined(self%qp%n_rows)
    integer :: i, k
    of_joined = .true.
    do i = 1, self%share%n_rows
      do k = self%share%row_start(i), self%share%row_start(i + 1) - 1
        if (.not. (self%share%value(k) < 1 .or. active(i))) of_joined(self%share%column(k)) = .false.
      end do
    end do
  end function transformed_active

  !> The state of the original QP from one of the transformed QP.
  subroutine transformed_give_back(self, qp, compliance, state)
    class(transformed_qp_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The original QP.
    class(compliance_t), intent(inout) :: compliance  !! Its compliance.
    type(solver_state_t), intent(inout) :: state  !! The state.
    real(dp) :: y(qp%n_rows), motion(qp%n_rows)
    integer :: i
    state%pressure = self%pressures(state%pressure)
    call compliance%multiply(qp, qp%weight*state%pressure, y)
    call qp%mode_displacement(state%alpha/qp%coarse%scale, motion)
    y = qp%initial_penetration - y + motion
    ! Rows that are in both.
    do i = 1, qp%n_rows
      associate (k => self%share%row_start(i))
        if (self%share%row_start(i + 1) /= k + 1) cycle
        if (.not. self%fraction%value(k) < 1) y(i) = state%penetration(self%share%column(k))
      end associate
    end do
    state%penetration = y
  end subroutine transformed_give_back

  !> The entries of a transformed QP whose rows are none of those that have some.
  subroutine form_entries(transformed, compliance, of_rows)
    type(contact_qp_t), intent(in) :: transformed  !! The QP.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator of the bodies.
    type(dense_compliance_t), intent(out) :: of_rows  !! Compliance of its rows.
    type(entries_t), allocatable :: entries(:)
    integer :: b
    call compliance%form_all(transformed, entries)
    call of_rows%begin(transformed)
    do b = 1, size(entries)
      call of_rows%set(transformed, b, entries(b)%value)
    end do
  end subroutine form_entries

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
      coarse%resultant_size = abs(coarse%resultant)
      call coarse%take_rows(merged%block, merged%n_rows)
    end associate
  end subroutine merge_bodies

  !> Each row has the pressure of its group.
  pure function selection(group, n_groups) result(share)
    integer, intent(in) :: group(:)  !! Group of each row, 0 where it has none (n_rows).
    integer, intent(in) :: n_groups  !! Number of groups.
    type(sparse_rows_t) :: share  !! (n_rows, n_groups) [].
    integer :: i
    share%n_rows = size(group)
    share%n_columns = n_groups
    allocate (share%row_start(size(group) + 1), source=1)
    do i = 1, size(group)
      share%row_start(i + 1) = share%row_start(i) + merge(1, 0, group(i) > 0)
    end do
    share%column = pack(group, group > 0)
    share%value = [(1.0_dp, i=1, size(share%column))]
  end function selection

  !> The QP of pressures of which those of the original rows are sums.
  subroutine join_rows(qp, share, joined)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(sparse_rows_t), intent(in) :: share  !! As in `transformed_qp_t`.
    class(transformed_qp_t), intent(inout) :: joined  !! The transformed QP, of a level of its own.
    integer :: home(share%n_columns), i, k, b
    joined%share = share
    joined%fraction = share
    associate (n => share%n_columns, part => joined%qp, fraction => joined%fraction)
      part%n_rows = n
      part%dimension = qp%dimension
      part%level = qp%level + 1
      part%parent_row = [(i, i=1, n)]
      part%weight = joined%means(qp%weight)
      part%is_tied = [(.false., i=1, n)]
      home = share%n_rows
      do i = share%n_rows, 1, -1
        do k = share%row_start(i), share%row_start(i + 1) - 1
          associate (j => share%column(k))
            fraction%value(k) = share%value(k)*qp%weight(i)/part%weight(j)
            part%is_tied(j) = qp%is_tied(i)
            ! Interpolated rows may be in pairs before.
            if (.not. share%value(k) < 1) home(j) = i
          end associate
        end do
      end do
      part%gap = joined%means(qp%gap)
      part%theta = joined%means(qp%theta)
      part%initial_penetration = joined%means(qp%initial_penetration)
      part%load_displacement = joined%means(qp%load_displacement)
      part%foundation = joined%means(qp%foundation)
      part%pair_first_row = [(1 + count(home < qp%pair_first_row(k)), k=1, size(qp%pair_first_row))]
      part%energy_0 = qp%energy_0
      part%norm_square_0 = qp%norm_square_0
      allocate (part%block(size(qp%block)))
      do b = 1, size(qp%block)
        call join_block(qp%block(b), fraction, part%block(b))
      end do
      call join_modes(qp, fraction, part%block, part%coarse)
    end associate
  end subroutine join_rows

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
