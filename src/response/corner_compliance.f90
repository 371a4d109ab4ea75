!> The compliance of contact rows in the corner space of a body, B P K_c^+ P^T B^T, in bounded memory.
!>
!> Forward substitution gives L^{-1} of blocks of rows, and products of these the entries (`dotyk_response_direct`).
!> Substituted rows can take more memory than the entries: groups of blocks are substituted, two groups at a time, some
!> of them again where there are more than two.
module dotyk_response_corner_compliance
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_response, only: response_t, substituted_rows_t
  implicit none
  private
  public :: form_corner_compliance

  !> Rows in one forward substitution: few enough for many threads, enough for the speed of dense products.
  integer, parameter :: few_rows = 64, many_rows = 256
  !> Substituted rows may take as much memory as the entries, and this much in any case [bytes].
  integer(int64), parameter :: least_room = 2_int64**28

contains

  !> Form the entries.
  subroutine form_corner_compliance(coarse, rows, value, room)
    !> Compliance operator of the corner space, ready for forward substitutions.
    class(response_t), intent(in) :: coarse
    !> The rows over the equations of the corner space, B P (n x n_corner_equations) [].
    type(sparse_rows_t), intent(in) :: rows
    real(dp), allocatable, intent(out) :: value(:, :)  !! (n, n) [length/force].
    integer(int64), intent(in), optional :: room  !! Memory of substituted rows at most; chosen if absent [bytes].
    type(substituted_rows_t), allocatable :: first(:), group(:), other(:)
    integer(int64) :: bytes
    integer :: i, k, n_blocks, length, n, last
    allocate (value(rows%n_rows, rows%n_rows))
    if (rows%n_rows == 0) return
    bytes = max(8*size(value, kind=int64), least_room)
    if (present(room)) bytes = room
    length = merge(many_rows, few_rows, rows%n_rows > 8*many_rows)
    n_blocks = (rows%n_rows + length - 1)/length
    ! The first block tells how many there may be in each of two groups.
    call substitute(coarse, rows, length, 1, 1, first)
    n = int(min(int(n_blocks, int64), max(1_int64, bytes/(2*size_of(first(1))))))
    ! There is no second group.
    if (n_blocks*size_of(first(1)) <= bytes) n = n_blocks
    do i = 1, n_blocks, n
      last = min(i + n - 1, n_blocks)
      call substitute(coarse, rows, length, i, last, group, first)
      call multiply(coarse, length, i, group, i, group, .true., value)
      do k = last + 1, n_blocks, n
        call substitute(coarse, rows, length, k, min(k + n - 1, n_blocks), other)
        call multiply(coarse, length, k, other, i, group, .false., value)
      end do
    end do
  end subroutine form_corner_compliance

  !> Memory of the values of substituted rows [bytes].
  pure integer(int64) function size_of(rows)
    type(substituted_rows_t), intent(in) :: rows  !! The rows.
    size_of = max(1_int64, 8*size(rows%forward%value, kind=int64))
  end function size_of

  !> Forward substitution of some blocks.
  subroutine substitute(coarse, rows, length, first, last, substituted, known)
    class(response_t), intent(in) :: coarse  !! Compliance operator of the corner space.
    type(sparse_rows_t), intent(in) :: rows  !! All rows.
    integer, intent(in) :: length  !! Rows in a block.
    integer, intent(in) :: first, last  !! First and last block.
    type(substituted_rows_t), allocatable, intent(out) :: substituted(:)  !! L^{-1} of them (last - first + 1).
    !> The first block of all, where it is known; without it on return (1).
    type(substituted_rows_t), allocatable, intent(inout), optional :: known(:)
    type(sparse_rows_t) :: part
    integer :: k, begin
    allocate (substituted(last - first + 1))
    begin = first
    if (present(known)) then
      if (allocated(known)) then
        substituted(1) = known(1)
        deallocate (known)
        begin = first + 1
      end if
    end if
    !$omp parallel do default(none) shared(coarse, rows, length, first, last, begin, substituted) private(part) &
    !$omp& schedule(dynamic, 1)
    do k = begin, last
      call cut(rows, (k - 1)*length + 1, min(k*length, rows%n_rows), part)
      call coarse%substitute(part, substituted(k - first + 1))
    end do
    !$omp end parallel do
  end subroutine substitute

  !> The entries between two groups of blocks, or within one.
  subroutine multiply(coarse, length, first_a, a, first_b, b, same, value)
    class(response_t), intent(in) :: coarse  !! Compliance operator of the corner space.
    integer, intent(in) :: length  !! Rows in a block.
    integer, intent(in) :: first_a, first_b  !! First block of each group.
    type(substituted_rows_t), intent(in) :: a(:), b(:)  !! The groups, substituted.
    logical, intent(in) :: same  !! Whether they are one group.
    real(dp), intent(inout) :: value(:, :)  !! Gets the entries (n, n) [length/force].
    real(dp), allocatable :: c(:, :)
    integer :: k, l, i, j
    !$omp parallel do default(none) shared(coarse, length, first_a, a, first_b, b, same, value) private(c, l, i, j) &
    !$omp& schedule(dynamic, 1)
    do k = 1, size(a)
      i = (first_a + k - 2)*length
      do l = 1, merge(k, size(b), same)
        j = (first_b + l - 2)*length
        allocate (c(a(k)%forward%n, b(l)%forward%n))
        call coarse%product(a(k), b(l), same .and. k == l, c)
        value(i + 1:i + size(c, 1), j + 1:j + size(c, 2)) = c
        if (.not. (same .and. k == l)) value(j + 1:j + size(c, 2), i + 1:i + size(c, 1)) = transpose(c)
        deallocate (c)
      end do
    end do
    !$omp end parallel do
  end subroutine multiply

  !> Some rows of a matrix.
  subroutine cut(matrix, first, last, rows)
    type(sparse_rows_t), intent(in) :: matrix  !! The matrix.
    integer, intent(in) :: first, last  !! First and last row.
    type(sparse_rows_t), intent(out) :: rows  !! They.
    associate (begin => matrix%row_start(first), end => matrix%row_start(last + 1) - 1)
      rows%n_rows = last - first + 1
      rows%n_columns = matrix%n_columns
      rows%row_start = matrix%row_start(first:last + 1) - begin + 1
      rows%column = matrix%column(begin:end)
      rows%value = matrix%value(begin:end)
    end associate
  end subroutine cut
end module dotyk_response_corner_compliance
