!> Contact that goes on across a tie: where tied surfaces meet the same third surface, as bodies that lie side by side
!> on a plate do, or the cut of a cyclic sector that is in contact across the cut.
!>
!> At such a seam each side has contact rows of its own. As the tie makes the displacements equal, only the sum of their
!> pressures would be determined. The pressure is one function on both sides: at the seam it has its values in the
!> vertices of the master side of the tie, and in those of the slave side it is interpolated between them, whatever
!> meshes meet. (Mortar methods have no multipliers in such cross points either.) Where the third surface is the slave,
!> its vertices at the edge of the tie have a row in the pair of each side; these are one row as well.
module dotyk_control_seams
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_thresholds, only: generic_direction, of_mesh, opposite_cosine, sharp_cosine
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_problem, only: tied_surfaces_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  implicit none
  private
  public :: count_split_rows, find_seams, pair_of_other_roles

  type :: side_rows_t  !! Contact rows at the edge of one side of a tie.
    integer, allocatable :: row(:), pair(:), own(:)  !! The rows, their pairs, and their numbers in these (n).
    !> Positions and normals, those of the master side rotated to the slave side (dimension, n) [length], [].
    real(dp), allocatable :: x(:, :), normal(:, :)
  end type side_rows_t

  type :: values_t  !! Where rows have their pressures from.
    !> Rows that a pressure is the mean of: the row itself; another one; or two others (2, n_rows).
    integer, allocatable :: of(:, :)
    real(dp), allocatable :: part(:)  !! Weight of the first one (n_rows) [].
  contains
    procedure :: root => values_root
    procedure :: depends => values_depends
  end type values_t

contains

  !> Find the rows that have their pressures from others.
  subroutine find_seams(body, pair, tie, n_rows, share, n_split)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs, whose rows follow each other (n_pairs).
    type(tied_surfaces_t), intent(in), optional :: tie(:)  !! Ties; none if absent (n_ties).
    integer, intent(in) :: n_rows  !! Number of rows, with those of the ties after those of the pairs.
    !> Pressures of the rows from those that are left; not allocated where each row has its own (n_rows, n_left) [].
    type(sparse_rows_t), allocatable, intent(out) :: share
    integer, allocatable, intent(out), optional :: n_split(:, :)  !! As in `count_split_rows` (n_pairs, n_ties).
    type(side_rows_t), allocatable :: slave(:), master(:)
    type(values_t) :: value
    logical :: has_equal(n_rows)
    integer :: i, k, n
    if (.not. present(tie)) return
    if (present(n_split)) allocate (n_split(size(pair), size(tie)), source=0)
    allocate (slave(size(tie)), master(size(tie)), value%of(2, n_rows))
    allocate (value%part(n_rows), source=1.0_dp)
    has_equal = .false.
    value%of(1, :) = [(i, i=1, n_rows)]
    value%of(2, :) = value%of(1, :)
    do k = 1, size(tie)
      associate (rows => tie(k)%component(1))
        call find_rows_at(pair, body(rows%body_a), rows%body_a, tie(k)%surface_a, tie(k), .false., slave(k))
        call find_rows_at(pair, body(rows%body_b), rows%body_b, tie(k)%surface_b, tie(k), .true., master(k))
      end associate
      do i = 1, size(slave(k)%row)
        call join_at_one_place(pair, tie, k, slave(k), i, master(k), value, has_equal(slave(k)%row(i)))
      end do
      call join_rows_on_masters(pair, tie, k, value)
    end do
    do k = 1, size(tie)
      do i = 1, size(slave(k)%row)
        n = 0
        if (.not. has_equal(slave(k)%row(i))) call interpolate(pair, tie, slave(k), i, master(k), value, n)
        if (present(n_split)) n_split(slave(k)%pair(i), k) = n_split(slave(k)%pair(i), k) + n
      end do
    end do
    if (any(value%of(1, :) /= [(i, i=1, n_rows)])) call make_share(value, share)
  end subroutine find_seams

  !> Number of rows of each pair at each tie, where contact goes on, that are between no rows of the other side.
  subroutine count_split_rows(body, pair, tie, n_split)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    integer, allocatable, intent(out) :: n_split(:, :)  !! (n_pairs, n_ties).
    type(sparse_rows_t), allocatable :: share
    call find_seams(body, pair, tie, sum(pair%n_rows), share, n_split)
  end subroutine count_split_rows

  !> The row that has the pressure of a row; the row itself where it is interpolated.
  pure integer function values_root(self, row) result(root)
    class(values_t), intent(in) :: self
    integer, intent(in) :: row  !! The row.
    root = row
    do while (self%of(1, root) /= root .and. self%of(1, root) == self%of(2, root))
      root = self%of(1, root)
    end do
  end function values_root

  !> Whether the pressure of a row depends on that of another one.
  pure recursive logical function values_depends(self, row, other) result(depends)
    class(values_t), intent(in) :: self
    integer, intent(in) :: row, other  !! The row, and the other one.
    depends = row == other
    if (.not. depends .and. self%of(1, row) /= row) &
      depends = self%depends(self%of(1, row), other) .or. self%depends(self%of(2, row), other)
  end function values_depends

  !> Let a row on the slave side have the pressure of the row at the same place on the master side.
  subroutine join_at_one_place(pair, tie, k, slave, i, master, value, has_equal)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    integer, intent(in) :: k  !! The tie.
    type(side_rows_t), intent(in) :: slave  !! Rows on the slave side.
    integer, intent(in) :: i  !! The row among these.
    type(side_rows_t), intent(in) :: master  !! Rows on the master side.
    type(values_t), intent(inout) :: value  !! Changed.
    logical, intent(inout) :: has_equal  !! Set where there is such a row.
    integer :: j, found
    found = 0
    do j = 1, size(master%row)
      if (norm2(master%x(:, j) - slave%x(:, i)) > of_mesh*tie(k)%facet_size) cycle
      if (.not. is_one_surface(pair, tie, slave, i, master, j)) cycle
      ! Of several, as where pairs meet on the master surface, the one of the same pair.
      if (found == 0 .or. master%pair(j) == slave%pair(i)) found = master%row(j)
    end do
    if (found == 0) return
    has_equal = .true.
    call unite(value, slave%row(i), found)
  end subroutine join_at_one_place

  !> Let two rows have one pressure.
  subroutine unite(value, one, other)
    type(values_t), intent(inout) :: value  !! Changed.
    integer, intent(in) :: one, other  !! The rows.
    integer :: a, b
    a = value%root(one)
    b = value%root(other)
    if (a /= b) value%of(:, max(a, b)) = min(a, b)
  end subroutine unite

  !> Interpolate the pressure of a row on the slave side between the two rows on the master side that are next to it
  !> along the seam.
  subroutine interpolate(pair, tie, slave, i, master, value, n_split)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    type(side_rows_t), intent(in) :: slave  !! Rows on the slave side.
    integer, intent(in) :: i  !! The row among these.
    type(side_rows_t), intent(in) :: master  !! Rows on the master side.
    type(values_t), intent(inout) :: value  !! Changed.
    !> 1 where contact goes on, but there are no two such rows; 0 elsewhere.
    integer, intent(out) :: n_split
    real(dp) :: arm(size(slave%x, 1), size(master%row)), distance(size(master%row))
    integer :: order(size(master%row)), next(2), j, n
    n_split = 0
    n = 0
    arm = master%x - spread(slave%x(:, i), 2, size(master%row))
    distance = norm2(arm, 1)
    call sort_order(distance, order)
    do j = 1, size(order)
      associate (candidate => order(j))
        ! Beyond the facets of its vertex a row knows nothing.
        if (distance(candidate) > extent(pair(master%pair(candidate)), master%own(candidate))) cycle
        if (.not. is_one_surface(pair, tie, slave, i, master, candidate)) cycle
        n_split = 1
        if (n == 1) then
          if (dot_product(arm(:, next(1)), arm(:, candidate)) > &
              opposite_cosine*distance(next(1))*distance(candidate)) cycle
        end if
        n = n + 1
        next(n) = candidate
        if (n == 2) exit
      end associate
    end do
    if (n < 2 .or. value%root(slave%row(i)) /= slave%row(i)) return
    if (value%depends(master%row(next(1)), slave%row(i)) .or. value%depends(master%row(next(2)), slave%row(i))) return
    n_split = 0
    value%of(:, slave%row(i)) = master%row(next)
    value%part(slave%row(i)) = distance(next(2))/sum(distance(next))
  end subroutine interpolate

  !> Whether two rows on both sides of a tie are on one smooth surface, and touch one other.
  logical function is_one_surface(pair, tie, slave, i, master, j) result(is_one)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    type(side_rows_t), intent(in) :: slave  !! Rows on the slave side.
    integer, intent(in) :: i  !! The row among these.
    type(side_rows_t), intent(in) :: master  !! Rows on the master side.
    integer, intent(in) :: j  !! The row among these.
    is_one = master%row(j) /= slave%row(i)
    if (is_one) is_one = dot_product(master%normal(:, j), slave%normal(:, i)) >= sharp_cosine
    if (is_one) is_one = is_one_master(pair, tie, slave%pair(i), slave%own(i), master%pair(j), master%own(j))
  end function is_one_surface

  !> The matrix of the pressures. Rows that are left are numbered in the order of their first copies.
  subroutine make_share(value, share)
    type(values_t), intent(in) :: value  !! Where rows have their pressures from.
    type(sparse_rows_t), allocatable, intent(out) :: share  !! (n_rows, n_left) [].
    integer, allocatable :: number(:), row(:), column(:)
    real(dp), allocatable :: weight(:)
    integer :: i, n
    allocate (number(size(value%part)), source=0)
    n = 0
    do i = 1, size(number)
      associate (root => value%root(i))
        if (value%of(1, root) /= root .or. number(root) > 0) cycle
        n = n + 1
        number(root) = n
      end associate
    end do
    allocate (row(0), column(0), weight(0), share)
    do i = 1, size(number)
      call add(i, 1.0_dp)
    end do
    call share%init_from_triplets(size(number), n, row, column, weight)

  contains

    !> Add the parts of a row.
    recursive subroutine add(j, part)
      integer, intent(in) :: j  !! A row that the pressure of row i is from.
      real(dp), intent(in) :: part  !! Its weight [].
      if (value%of(1, j) == j) then
        row = [row, i]
        column = [column, number(j)]
        weight = [weight, part]
      else if (value%of(1, j) == value%of(2, j)) then
        call add(value%of(1, j), part)
      else
        call add(value%of(1, j), value%part(j)*part)
        call add(value%of(2, j), (1 - value%part(j))*part)
      end if
    end subroutine add
  end subroutine make_share

  !> Join the rows of a slave vertex that has one on each of two master bodies, near the edge at which these are tied.
  subroutine join_rows_on_masters(pair, tie, k, value)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    integer, intent(in) :: k  !! The tie of the bodies.
    type(values_t), intent(inout) :: value  !! Changed.
    real(dp) :: apart
    integer, allocatable :: near(:)
    integer :: p, q, i, j
    apart = of_mesh*tie(k)%facet_size
    associate (rows => tie(k)%component(1))
      ! Rotated sides are not side by side.
      if (rows%body_a == rows%body_b .or. allocated(rows%turn)) return
      do p = 1, size(pair)
        if (pair(p)%body_b /= rows%body_a) cycle
        do q = 1, size(pair)
          if (pair(q)%body_b /= rows%body_b .or. pair(q)%body_a /= pair(p)%body_a) cycle
          call find_same_points(pair(p)%row_position, pair(q)%row_position, apart, near)
          do i = 1, pair(p)%n_rows
            j = near(i)
            if (j == 0) cycle
            if (dot_product(pair(q)%row_normal(:, j), pair(p)%row_normal(:, i)) < sharp_cosine) cycle
            if (.not. is_one_master(pair, tie, p, i, q, j)) cycle
            call unite(value, sum(pair(:p - 1)%n_rows) + i, sum(pair(:q - 1)%n_rows) + j)
          end do
        end do
      end do
    end associate
  end subroutine join_rows_on_masters

  !> For each point the nearest of some others that is at the same place.
  subroutine find_same_points(x, others, apart, found)
    real(dp), intent(in) :: x(:, :), others(:, :)  !! Points, and others (dimension, n), (dimension, n_others) [length].
    real(dp), intent(in) :: apart  !! Distance of points that are one, at most [length].
    integer, allocatable, intent(out) :: found(:)  !! 0 where there is none (n).
    real(dp), allocatable :: along(:)
    real(dp) :: here, nearest
    integer :: order(size(others, 2)), first, middle, last, i, l
    along = matmul(generic_direction(:size(x, 1)), others)
    call sort_order(along, order)
    along = along(order)
    allocate (found(size(x, 2)), source=0)
    do i = 1, size(x, 2)
      here = dot_product(generic_direction(:size(x, 1)), x(:, i))
      first = 1
      last = size(along) + 1
      do while (first < last)
        middle = (first + last)/2
        if (along(middle) < here - apart) then
          first = middle + 1
        else
          last = middle
        end if
      end do
      nearest = apart
      do l = first, size(along)
        if (along(l) > here + apart) exit
        if (norm2(others(:, order(l)) - x(:, i)) > nearest) cycle
        nearest = norm2(others(:, order(l)) - x(:, i))
        found(i) = order(l)
      end do
    end do
  end subroutine find_same_points

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
            if (norm2(pair(other)%row_position(:, j) - x(:, i)) > extent(pair(p), i) + extent(pair(other), j)) cycle
            if (dot_product(pair(other)%row_normal(:, j), pair(p)%row_normal(:, i)) < -sharp_cosine) return
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

  !> Contact rows of a body at the nodes of one side of a tie, where the body is the slave.
  subroutine find_rows_at(pair, body, number, surface, tie, from_master, rows)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(body_t), intent(in) :: body  !! The body.
    integer, intent(in) :: number  !! Its number.
    type(surface_t), intent(in) :: surface  !! The side of the tie.
    type(tied_surfaces_t), intent(in) :: tie  !! The tie.
    logical, intent(in) :: from_master  !! Whether it is the master side, which is rotated to the slave side.
    type(side_rows_t), intent(out) :: rows  !! The rows.
    integer, allocatable :: node(:), at(:), own(:)
    integer :: p, i, d
    logical :: turns
    d = tie%component(1)%dimension
    turns = from_master .and. allocated(tie%component(1)%turn)
    allocate (rows%row(0), rows%pair(0), rows%own(0), rows%x(d, 0), rows%normal(d, 0))
    if (all(pair%body_a /= number)) return
    call surface_nodes(surface, node)
    do p = 1, size(pair)
      if (pair(p)%body_a /= number) cycle
      call find_same_points(pair(p)%row_position, body%mesh%x(:, node), of_mesh*tie%facet_size, at)
      own = pack([(i, i=1, size(at))], at > 0)
      rows%row = [rows%row, sum(pair(:p - 1)%n_rows) + own]
      rows%pair = [rows%pair, [(p, i=1, size(own))]]
      rows%own = [rows%own, own]
      if (turns) then
        associate (turn => tie%component(1)%turn)
          rows%x = reshape([rows%x, matmul(turn, pair(p)%row_position(:, own)) + &
                            spread(tie%offset(:d), 2, size(own))], [d, size(rows%row)])
          rows%normal = reshape([rows%normal, matmul(turn, pair(p)%row_normal(:, own))], [d, size(rows%row)])
        end associate
      else
        rows%x = reshape([rows%x, pair(p)%row_position(:, own)], [d, size(rows%row)])
        rows%normal = reshape([rows%normal, pair(p)%row_normal(:, own)], [d, size(rows%row)])
      end if
    end do
  end subroutine find_rows_at
end module dotyk_control_seams
