!> Galerkin matrices P^T A P of a matrix A of 2x2 or 3x3 blocks and a prolongator from aggregates, in 3x3 blocks.
!>
!> First A P by the rows of A, then P^T (A P) by aggregates: each sum belongs to one thread and has a fixed order.
module dotyk_linalg_galerkin_product
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_linalg_block_prolongator, only: block_prolongator_t, sort_ascending
  use dotyk_linalg_block_rows, only: block_rows_t
  implicit none
  private
  public :: galerkin_product

  integer, parameter :: order = 3  !! Order of the blocks of the result.

  type :: product_t  !! A P, by the block rows of A.
    integer(int64), allocatable :: start(:)  !! First entry of each row (n + 1).
    integer, allocatable :: column(:)  !! Aggregate of each entry, ascending in each row (n_entries).
    real(dp), allocatable :: value(:, :, :)  !! Entries: coarse unknown, component (m, dim, n_entries) [A/scale].
  end type product_t

contains

  !> The Galerkin matrix, with the scale of A.
  subroutine galerkin_product(rows, prolongator, missing, coarse)
    type(block_rows_t), intent(in) :: rows  !! The matrix A.
    type(block_prolongator_t), intent(in) :: prolongator  !! The prolongator P.
    !> Coarse unknowns that do not exist, columns of zeros of P: they get the unit diagonal (m, n_coarse).
    logical, intent(in), contiguous :: missing(:, :)
    type(block_rows_t), intent(out) :: coarse  !! P^T A P; an aggregate has m/3 block rows, one after the other.
    type(product_t) :: product
    call multiply_prolongator(rows, prolongator, product)
    call make_pattern(prolongator, product, rows%scale, coarse)
    call fill(prolongator, product, coarse)
    call coarse%hold(reshape(missing, [order, coarse%n]))
    call coarse%pack()
  end subroutine galerkin_product

  !> A P.
  subroutine multiply_prolongator(rows, prolongator, product)
    type(block_rows_t), intent(in) :: rows  !! The matrix A.
    type(block_prolongator_t), intent(in) :: prolongator  !! The prolongator P.
    type(product_t), intent(out) :: product  !! A P.
    integer, allocatable :: place(:), list(:)
    integer :: i, k, n
    allocate (product%start(rows%n + 1))
    product%start(1) = 1
    !$omp parallel default(none) shared(rows, prolongator, product) private(place, list, n)
    allocate (place(prolongator%n_coarse), list(prolongator%n_coarse))
    place = 0
    !$omp do schedule(static)
    do i = 1, rows%n
      call columns_of_product(rows, prolongator, i, place, list, n)
      product%start(i + 1) = n
    end do
    !$omp end do
    !$omp end parallel
    do i = 1, rows%n
      product%start(i + 1) = product%start(i) + product%start(i + 1)
    end do
    allocate (product%column(product%start(rows%n + 1) - 1), &
              product%value(prolongator%m, rows%dim, product%start(rows%n + 1) - 1))
    !$omp parallel default(none) shared(rows, prolongator, product) private(place, list, n, k)
    allocate (place(prolongator%n_coarse), list(prolongator%n_coarse))
    place = 0
    !$omp do schedule(static)
    do i = 1, rows%n
      call columns_of_product(rows, prolongator, i, place, list, n)
      do k = 1, n
        place(list(k)) = k
      end do
      associate (first => product%start(i), last => product%start(i + 1) - 1)
        product%column(first:last) = list(:n)
        if (prolongator%m == 6) then
          call multiply_row(6, 3, rows, prolongator%start, prolongator%column, prolongator%value, i, n, place, &
                            product%value(:, :, first:last))
        else
          call multiply_row(prolongator%m, rows%dim, rows, prolongator%start, prolongator%column, prolongator%value, &
                            i, n, place, product%value(:, :, first:last))
        end if
      end associate
      do k = 1, n
        place(list(k)) = 0
      end do
    end do
    !$omp end do
    !$omp end parallel
  end subroutine multiply_prolongator

  !> Aggregates of a row of A P.
  pure subroutine columns_of_product(rows, prolongator, i, place, list, n)
    type(block_rows_t), intent(in) :: rows  !! The matrix A.
    type(block_prolongator_t), intent(in) :: prolongator  !! The prolongator P.
    integer, intent(in) :: i  !! The block row.
    integer, intent(inout) :: place(:)  !! Work space: zeros in and out (n_coarse).
    integer, intent(inout) :: list(:)  !! The aggregates, ascending (at least n).
    integer, intent(out) :: n  !! Their number.
    integer(int64) :: k
    n = 0
    do k = rows%start(i), rows%start(i + 1) - 1
      associate (j => rows%column(k))
        call add_new(prolongator%column(prolongator%start(j):prolongator%start(j + 1) - 1), place, list, n)
      end associate
    end do
    call sort_ascending(list(:n))
    place(list(:n)) = 0
  end subroutine columns_of_product

  !> Add the aggregates to a list that are not in it.
  pure subroutine add_new(column, place, list, n)
    integer, intent(in) :: column(:)  !! Aggregates (any number).
    integer, intent(inout) :: place(:)  !! Place of each aggregate in the list, 0 for none (n_coarse).
    integer, intent(inout) :: list(:)  !! The list (at least n).
    integer, intent(inout) :: n  !! Its length.
    integer :: q
    do q = 1, size(column)
      if (place(column(q)) /= 0) cycle
      n = n + 1
      list(n) = column(q)
      place(list(n)) = n
    end do
  end subroutine add_new

  !> A row of A P.
  pure subroutine multiply_row(m, dim, rows, start, column, value, i, n, place, product)
    integer, intent(in) :: m  !! Coarse unknowns of an aggregate.
    integer, intent(in) :: dim  !! Order of the blocks of A.
    type(block_rows_t), intent(in) :: rows  !! The matrix A.
    integer, intent(in) :: start(*)  !! First entry of each row of P (n + 1).
    integer, intent(in) :: column(*)  !! Aggregate of each entry of P.
    real(sp), intent(in) :: value(m, dim, *)  !! Entries of P (m, dim, n_entries) [].
    integer, intent(in) :: i  !! The block row.
    integer, intent(in) :: n  !! Number of aggregates of the row.
    integer, intent(in) :: place(*)  !! Place of each aggregate in the row (n_coarse).
    real(dp), intent(out) :: product(m, dim, n)  !! The row (m, dim, n) [A/scale].
    real(dp) :: a(dim, dim), p(m, dim)
    integer(int64) :: k
    integer :: q, l, r, c
    product = 0
    do k = rows%start(i), rows%start(i + 1) - 1
      call rows%get_block(k, a)
      do q = start(rows%column(k)), start(rows%column(k) + 1) - 1
        l = place(column(q))
        p = value(:, :, q)
        do r = 1, dim
          do c = 1, dim
            product(:, r, l) = product(:, r, l) + a(r, c)*p(:, c)
          end do
        end do
      end do
    end do
  end subroutine multiply_row

  !> The pattern of P^T A P.
  subroutine make_pattern(prolongator, product, scale, coarse)
    type(block_prolongator_t), intent(in) :: prolongator  !! The prolongator P.
    type(product_t), intent(in) :: product  !! A P.
    real(dp), intent(in) :: scale  !! Scale of A [matrix].
    type(block_rows_t), intent(out) :: coarse  !! Gets the pattern, with zeros.
    integer, allocatable :: place(:), list(:), first(:), column(:), neighbour(:)
    integer(int64), allocatable :: start(:)
    integer :: part, i, k, n, r, pass
    part = prolongator%m/order
    allocate (first(prolongator%n_coarse + 1))
    first(1) = 1
    do pass = 1, 2
      !$omp parallel default(none) shared(prolongator, product, first, column, pass) private(place, list, n)
      allocate (place(prolongator%n_coarse), list(prolongator%n_coarse))
      place = 0
      !$omp do schedule(static)
      do i = 1, prolongator%n_coarse
        call columns_of_aggregate(prolongator, product, i, place, list, n)
        if (pass == 1) then
          first(i + 1) = n
        else
          column(first(i):first(i + 1) - 1) = list(:n)
        end if
      end do
      !$omp end do
      !$omp end parallel
      if (pass == 2) exit
      do i = 1, prolongator%n_coarse
        first(i + 1) = first(i) + first(i + 1)
      end do
      allocate (column(first(prolongator%n_coarse + 1) - 1))
    end do
    allocate (start(part*prolongator%n_coarse + 1), neighbour(part**2*size(column) - part*prolongator%n_coarse))
    n = 0
    do i = 1, prolongator%n_coarse
      do r = part*(i - 1) + 1, part*i
        start(r) = n + 1
        do k = part*(first(i) - 1), part*(first(i + 1) - 1) - 1
          associate (block_column => part*(column(k/part + 1) - 1) + mod(k, part) + 1)
            if (block_column == r) cycle
            n = n + 1
            neighbour(n) = block_column
          end associate
        end do
      end do
    end do
    start(size(start)) = n + 1
    call coarse%init(order, start, neighbour(:n), scale)
  end subroutine make_pattern

  !> Aggregates of a block row of P^T A P, its own included.
  pure subroutine columns_of_aggregate(prolongator, product, i, place, list, n)
    type(block_prolongator_t), intent(in) :: prolongator  !! The prolongator P.
    type(product_t), intent(in) :: product  !! A P.
    integer, intent(in) :: i  !! The aggregate.
    integer, intent(inout) :: place(:)  !! Work space: zeros in and out (n_coarse).
    integer, intent(inout) :: list(:)  !! The aggregates, ascending (at least n).
    integer, intent(out) :: n  !! Their number.
    integer :: q
    n = 0
    do q = prolongator%first(i), prolongator%first(i + 1) - 1
      associate (j => prolongator%row(q))
        call add_new(product%column(product%start(j):product%start(j + 1) - 1), place, list, n)
      end associate
    end do
    call sort_ascending(list(:n))
    place(list(:n)) = 0
  end subroutine columns_of_aggregate

  !> The entries of P^T (A P).
  subroutine fill(prolongator, product, coarse)
    type(block_prolongator_t), intent(in) :: prolongator  !! The prolongator P.
    type(product_t), intent(in) :: product  !! A P.
    type(block_rows_t), intent(inout) :: coarse  !! The matrix, with its pattern.
    integer, allocatable :: place(:)
    real(dp), allocatable :: sum(:, :, :)
    integer(int64) :: k
    integer :: i, j, n, part, r
    part = prolongator%m/order
    n = 0
    do i = 1, coarse%n
      n = max(n, int(coarse%start(i + 1) - coarse%start(i)))
    end do
    !$omp parallel default(none) shared(prolongator, product, coarse, part) private(place, sum, j, k, r) &
    !$omp& firstprivate(n)
    allocate (place(prolongator%n_coarse), sum(prolongator%m, prolongator%m, n/part))
    !$omp do schedule(static)
    do i = 1, prolongator%n_coarse
      ! The aggregates of the row in its order: the diagonal block comes first.
      j = part*(i - 1) + 1
      n = 0
      do k = coarse%start(j), coarse%start(j + 1) - 1
        if (mod(coarse%column(k) - 1, part) /= 0) cycle
        n = n + 1
        place((coarse%column(k) - 1)/part + 1) = n
      end do
      if (prolongator%m == 6) then
        call add_aggregate(6, 3, prolongator%first(i), prolongator%first(i + 1) - 1, prolongator%row, &
                           prolongator%entry, prolongator%value, product%start, product%column, product%value, &
                           place, n, sum)
      else
        call add_aggregate(prolongator%m, prolongator%dim, prolongator%first(i), prolongator%first(i + 1) - 1, &
                           prolongator%row, prolongator%entry, prolongator%value, product%start, product%column, &
                           product%value, place, n, sum)
      end if
      do r = 1, part
        do k = coarse%start(j + r - 1), coarse%start(j + r) - 1
          call put_block(part, r, coarse%column(k), place, sum, coarse%high(:, k), coarse%low(:, k))
        end do
      end do
    end do
    !$omp end do
    !$omp end parallel
  end subroutine fill

  !> The blocks of an aggregate, P_i^T (A P)_j.
  pure subroutine add_aggregate(m, dim, first, last, row, entry, value, start, column, product, place, n, sum)
    integer, intent(in) :: m  !! Coarse unknowns of an aggregate.
    integer, intent(in) :: dim  !! Order of the blocks of A.
    integer, intent(in) :: first  !! First entry of the aggregate in `row`.
    integer, intent(in) :: last  !! Last entry of the aggregate in `row`.
    integer, intent(in) :: row(*)  !! Block rows of A with an entry for the aggregate.
    integer, intent(in) :: entry(*)  !! Their entries of P.
    real(sp), intent(in) :: value(m, dim, *)  !! Entries of P (m, dim, n_entries) [].
    integer(int64), intent(in) :: start(*)  !! First entry of each row of A P.
    integer, intent(in) :: column(*)  !! Aggregate of each entry of A P.
    real(dp), intent(in) :: product(m, dim, *)  !! Entries of A P (m, dim, n_entries) [A/scale].
    integer, intent(in) :: place(*)  !! Place of each aggregate in the row of the result (n_coarse).
    integer, intent(in) :: n  !! Number of aggregates of the row.
    real(dp), intent(out) :: sum(m, m, n)  !! The blocks: column, row, aggregate (m, m, n) [A/scale].
    real(dp) :: p
    integer(int64) :: k
    integer :: q, c, i, l
    sum = 0
    do q = first, last
      do k = start(row(q)), start(row(q) + 1) - 1
        l = place(column(k))
        do c = 1, dim
          do i = 1, m
            p = value(i, c, entry(q))
            sum(:, i, l) = sum(:, i, l) + p*product(:, c, k)
          end do
        end do
      end do
    end do
  end subroutine add_aggregate

  !> Put a 3x3 block in its place.
  pure subroutine put_block(part, r, column, place, sum, high, low)
    integer, intent(in) :: part  !! Block rows of an aggregate.
    integer, intent(in) :: r  !! Which of them.
    integer, intent(in) :: column  !! Block column.
    integer, intent(in) :: place(:)  !! Place of each aggregate in the row (n_coarse).
    real(dp), intent(in) :: sum(:, :, :)  !! The blocks: column, row, aggregate (m, m, n) [A/scale].
    real(sp), intent(out) :: high(:)  !! Leading parts of the entries (9) [].
    real(sp), intent(out) :: low(:)  !! Remainders (9) [].
    real(dp) :: entry
    integer :: i, j, c, l
    l = place((column - 1)/part + 1)
    c = mod(column - 1, part)
    do j = 1, order
      do i = 1, order
        entry = sum(order*c + j, order*(r - 1) + i, l)
        high(i + order*(j - 1)) = real(entry, sp)
        low(i + order*(j - 1)) = real(entry - high(i + order*(j - 1)), sp)
      end do
    end do
  end subroutine put_block
end module dotyk_linalg_galerkin_product
