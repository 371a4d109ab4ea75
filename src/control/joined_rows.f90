!> Contact rows of the two sides of a tie that are one row: where tied surfaces meet the same third surface, as bodies
!> that lie side by side on a plate do, or the cut of a cyclic sector that is in contact across the cut.
!>
!> Each side has a row of its own in the vertex that both sides have there, and the tie makes their displacements equal.
!> The two rows then differ by the master surface alone, and would divide the pressure at will. One body in place of
!> both has one row there, whose dual shape function is the sum of those of both sides: the weighted mean of the rows.
!> Where the third surface is the slave, its vertices at the edge of the tie have a row in the pair of each side, which
!> are one alike.
module dotyk_control_joined_rows
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_problem, only: tied_surfaces_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: find_joined_rows, pair_of_other_roles

  !> Vertices of both sides are one where they are closer than this, in facets [].
  real(dp), parameter :: touching = 1.0e-3_dp
  !> Rows whose normals differ by less than 40 degrees are those of one smooth surface.
  real(dp), parameter :: smooth_cosine = 0.766_dp
  !> A generic direction: not normal to the planes of a regular mesh, whose vertices would all be close along it [].
  real(dp), parameter :: direction(3) = [0.5453920137_dp, 0.6180339887_dp, 0.5663117921_dp]

  type :: side_rows_t  !! Contact rows near a side of a tie.
    !> Contact rows, their pairs, and the nearest vertices of the tie (n).
    integer, allocatable :: row(:), pair(:), vertex(:)
    integer, allocatable :: own(:)  !! Their numbers in the pairs (n).
    logical, allocatable :: is_there(:)  !! Whether the row is in that vertex (n).
    !> Normals, those of the master side rotated to the slave side (dimension, n) [].
    real(dp), allocatable :: normal(:, :)
  end type side_rows_t

contains

  !> Number the rows, those that are one together, in the order of the first of each.
  subroutine find_joined_rows(pair, tie, n_rows, joined_row, n_split)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs, whose rows follow each other (n_pairs).
    type(tied_surfaces_t), intent(in), optional :: tie(:)  !! Ties; none if absent (n_ties).
    integer, intent(in) :: n_rows  !! Number of rows, with those of the ties after those of the pairs.
    !> Number of each row; not allocated where each is one by itself (n_rows).
    integer, allocatable, intent(out) :: joined_row(:)
    !> Number of rows of each pair at each tie that have no counterpart on the other side, where contact goes on, in the
    !> same place: the meshes do not fit (n_pairs, n_ties).
    integer, allocatable, intent(out), optional :: n_split(:, :)
    type(side_rows_t) :: slave, master
    integer, allocatable :: parent(:), of_pair(:, :)
    integer :: i, k, n, found
    logical :: faces_other
    if (.not. present(tie)) return
    allocate (parent(n_rows), joined_row(n_rows), of_pair(size(pair), size(tie)))
    parent(:) = [(i, i=1, n_rows)]
    of_pair = 0
    do k = 1, size(tie)
      associate (rows => tie(k)%component(1))
        call find_rows_near(pair, rows%body_a, tie(k), .false., slave)
        call find_rows_near(pair, rows%body_b, tie(k), .true., master)
        do i = 1, size(slave%row)
          if (.not. slave%is_there(i)) cycle
          call find_counterpart(pair, tie, slave, i, master, parent, found, faces_other)
          if (found > 0) then
            call join(parent, slave%row(i), found)
          else if (faces_other) then
            of_pair(slave%pair(i), k) = of_pair(slave%pair(i), k) + 1
          end if
        end do
      end associate
      call join_rows_on_masters(pair, tie, k, parent)
    end do
    n = 0
    do i = 1, size(parent)
      if (parent(i) == i) then
        n = n + 1
        joined_row(i) = n
      else
        joined_row(i) = joined_row(root_of(parent, i))
      end if
    end do
    if (n == n_rows) deallocate (joined_row)
    if (present(n_split)) n_split = of_pair
  end subroutine find_joined_rows

  !> The row on the master side of a tie that is one with a row on the slave side.
  subroutine find_counterpart(pair, tie, slave, i, master, parent, found, faces_other)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    type(side_rows_t), intent(in) :: slave  !! Rows on the slave side.
    integer, intent(in) :: i  !! The row among these.
    type(side_rows_t), intent(in) :: master  !! Rows on the master side.
    integer, intent(inout) :: parent(:)  !! Rows that are one already; paths are shortened (n_rows).
    integer, intent(out) :: found  !! Number of the row; 0 where there is none.
    !> Whether rows near the vertex on the master side touch the same body, or one that is tied to it there, from the
    !> same side.
    logical, intent(out) :: faces_other
    integer :: j
    found = 0
    faces_other = .false.
    do j = 1, size(master%row)
      if (master%vertex(j) /= slave%vertex(i) .or. master%row(j) == slave%row(i)) cycle
      if (dot_product(master%normal(:, j), slave%normal(:, i)) < smooth_cosine) cycle
      if (.not. is_one_master(pair, tie, slave%pair(i), slave%own(i), master%pair(j), master%own(j))) cycle
      faces_other = .true.
      if (.not. master%is_there(j)) cycle
      ! Of several, as where pairs meet on the master surface, the one of the same pair.
      if (found == 0 .or. master%pair(j) == slave%pair(i)) found = master%row(j)
    end do
    if (found > 0) found = root_of(parent, found)
  end subroutine find_counterpart

  !> Join the rows of a slave vertex that has one on each of two master bodies, near the edge at which these are tied.
  subroutine join_rows_on_masters(pair, tie, k, parent)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    integer, intent(in) :: k  !! The tie of the bodies.
    integer, intent(inout) :: parent(:)  !! Rows that are one already; joined (n_rows).
    real(dp), allocatable :: along(:)
    integer, allocatable :: order(:)
    real(dp) :: apart
    integer :: p, q, i, j, l
    apart = touching*tie(k)%facet_size
    associate (rows => tie(k)%component(1))
      ! Rotated sides are not side by side.
      if (rows%body_a == rows%body_b .or. allocated(rows%turn)) return
      do p = 1, size(pair)
        if (pair(p)%body_b /= rows%body_a) cycle
        do q = 1, size(pair)
          if (pair(q)%body_b /= rows%body_b .or. pair(q)%body_a /= pair(p)%body_a) cycle
          along = matmul(direction(:rows%dimension), pair(q)%row_position)
          if (allocated(order)) deallocate (order)
          allocate (order(size(along)))
          call sort_order(along, order)
          along = along(order)
          do i = 1, pair(p)%n_rows
            associate (x => pair(p)%row_position(:, i))
              do l = first_above(along, dot_product(direction(:rows%dimension), x) - apart), size(along)
                if (along(l) > dot_product(direction(:rows%dimension), x) + apart) exit
                j = order(l)
                if (norm2(pair(q)%row_position(:, j) - x) > apart) cycle
                if (dot_product(pair(q)%row_normal(:, j), pair(p)%row_normal(:, i)) < smooth_cosine) cycle
                if (.not. is_one_master(pair, tie, p, i, q, j)) cycle
                call join(parent, sum(pair(:p - 1)%n_rows) + i, sum(pair(:q - 1)%n_rows) + j)
              end do
            end associate
          end do
        end do
      end do
    end associate
  end subroutine join_rows_on_masters

  !> Whether two rows have the same master body, or bodies that are tied to each other within their reach.
  logical function is_one_master(pair, tie, p, i, q, j) result(is_one)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    integer, intent(in) :: p, i  !! Pair of the first row, and its number in it.
    integer, intent(in) :: q, j  !! Pair of the other one, and its number in it.
    integer :: k, l
    real(dp) :: reach
    associate (a => pair(p)%body_b, b => pair(q)%body_b, x => pair(p)%row_position(:, i))
      is_one = a == b
      do k = 1, size(tie)
        if (is_one) exit
        associate (rows => tie(k)%component(1))
          if (allocated(rows%turn)) cycle
          if (.not. (rows%body_a == a .and. rows%body_b == b .or. rows%body_a == b .and. rows%body_b == a)) cycle
          reach = tie(k)%facet_size + max(extent(pair(p), i), extent(pair(q), j))
          is_one = any([(norm2(rows%row_position(:, l) - x) <= reach, l=1, rows%n_rows)])
        end associate
      end do
    end associate
  end function is_one_master

  !> The pair in which contact goes on across a tie with the roles exchanged: the third body is the master of one side,
  !> and the slave of the other one; 0 where there is none. The rows are in the vertices of different bodies then, and
  !> none are joined.
  integer function pair_of_other_roles(pair, tie, p) result(other)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie  !! The tie.
    integer, intent(in) :: p  !! The pair in which a side of the tie is the slave.
    integer :: i, j, l, side
    associate (rows => tie%component(1), x => pair(p)%row_position)
      side = 0
      if (pair(p)%body_a == rows%body_a) side = rows%body_b
      if (pair(p)%body_a == rows%body_b) side = rows%body_a
      ! Rotated sides are not side by side.
      if (allocated(rows%turn)) side = 0
      do other = 1, merge(size(pair), 0, side > 0)
        if (pair(other)%body_b /= side .or. pair(other)%body_a /= pair(p)%body_b) cycle
        if (pair(p)%body_b == side) cycle
        do i = 1, pair(p)%n_rows
          if (all([(norm2(rows%row_position(:, l) - x(:, i)) > tie%facet_size, l=1, rows%n_rows)])) cycle
          do j = 1, pair(other)%n_rows
            if (norm2(pair(other)%row_position(:, j) - x(:, i)) > &
                extent(pair(p), i) + extent(pair(other), j)) cycle
            if (dot_product(pair(other)%row_normal(:, j), pair(p)%row_normal(:, i)) < -smooth_cosine) return
          end do
        end do
      end do
    end associate
    other = 0
  end function pair_of_other_roles

  !> Greatest distance of the points of a row from it [length].
  pure real(dp) function extent(pair, i)
    type(contact_pair_t), intent(in) :: pair  !! The pair.
    integer, intent(in) :: i  !! The row.
    integer :: k
    extent = 0
    do k = pair%average%row_start(i), pair%average%row_start(i + 1) - 1
      extent = max(extent, norm2(pair%position(:, pair%average%column(k)) - pair%row_position(:, i)))
    end do
  end function extent

  !> Contact rows of a slave body near the vertices of a tie.
  subroutine find_rows_near(pair, body, tie, from_master, near)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: body  !! The slave body.
    type(tied_surfaces_t), intent(in) :: tie  !! The tie.
    logical, intent(in) :: from_master  !! Whether the body is on the master side, which is rotated to the slave side.
    type(side_rows_t), intent(out) :: near  !! The rows.
    real(dp), allocatable :: along(:)
    integer, allocatable :: order(:)
    real(dp) :: x(tie%component(1)%dimension), normal(tie%component(1)%dimension), distance, nearest
    integer :: p, i, j, first, vertex, before, n
    associate (rows => tie%component(1), d => tie%component(1)%dimension)
      n = sum(pair%n_rows, mask=pair%body_a == body)
      allocate (near%row(n), near%pair(n), near%vertex(n), near%own(n), near%is_there(n), near%normal(d, n), &
                order(rows%n_rows))
      along = matmul(direction(:d), rows%row_position)
      call sort_order(along, order)
      along = along(order)
      n = 0
      do p = 1, size(pair)
        before = sum(pair(:p - 1)%n_rows)
        if (pair(p)%body_a /= body) cycle
        do i = 1, pair(p)%n_rows
          x = pair(p)%row_position(:, i)
          normal = pair(p)%row_normal(:, i)
          if (from_master .and. allocated(rows%turn)) then
            x = matmul(rows%turn, x) + tie%offset(:d)
            normal = matmul(rows%turn, normal)
          end if
          nearest = tie%facet_size
          vertex = 0
          first = first_above(along, dot_product(direction(:d), x) - nearest)
          do j = first, rows%n_rows
            if (along(j) > dot_product(direction(:d), x) + nearest) exit
            distance = norm2(rows%row_position(:, order(j)) - x)
            if (distance > nearest) cycle
            nearest = distance
            vertex = order(j)
          end do
          if (vertex == 0) cycle
          n = n + 1
          near%row(n) = before + i
          near%own(n) = i
          near%pair(n) = p
          near%vertex(n) = vertex
          near%is_there(n) = nearest <= touching*tie%facet_size
          near%normal(:, n) = normal
        end do
      end do
    end associate
    near%row = near%row(:n)
    near%own = near%own(:n)
    near%pair = near%pair(:n)
    near%vertex = near%vertex(:n)
    near%is_there = near%is_there(:n)
    near%normal = near%normal(:, :n)
  end subroutine find_rows_near

  !> Place of the first number that is not below a value.
  pure integer function first_above(sorted, value) result(place)
    real(dp), intent(in) :: sorted(:)  !! Ascending (n) [any].
    real(dp), intent(in) :: value  !! The value [any].
    integer :: last, middle
    place = 1
    last = size(sorted) + 1
    do while (place < last)
      middle = (place + last)/2
      if (sorted(middle) < value) then
        place = middle + 1
      else
        last = middle
      end if
    end do
  end function first_above
end module dotyk_control_joined_rows
