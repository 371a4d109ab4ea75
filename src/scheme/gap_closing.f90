!> Displacements that close the gaps of contact rows, and what they leave of the complementarity: for the error bound of
!> the primal scheme.
!>
!> g = D^{-1} B^T mu with the diagonal blocks D of the smoothers, which are above the stiffness: `A(g, g) <= g^T D g =
!> mu^T B g`. All that is needed of them is B D^{-1} B^T, sparse and in double precision. Rows of soft layers are closed
!> so far as that costs less than their energy: `B g + (theta/w) mu = gap`.
module dotyk_scheme_gap_closing
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: half_digits, least_gain
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: close_gaps, factorize_rows, find_neighbours, left_open, restrict_matrix

  integer, parameter :: most_passes = 8  !! Improvements at most: rows that depend on each other leave something.
  !> Fraction of the diagonal that is added at most where rounding has made the matrix indefinite [].
  real(dp), parameter :: most_shift = 0.1_dp

contains

  !> Close the gaps of some rows.
  subroutine close_gaps(compliance, chosen, gap, softness, shift, closed, norm, error)
    type(sparse_symmetric_t), intent(in) :: compliance  !! B D^{-1} B^T (n_rows, n_rows) [length/force].
    logical, intent(in) :: chosen(:)  !! Rows to close (n_rows).
    real(dp), intent(in) :: gap(:)  !! Gaps to close (n_rows) [length].
    real(dp), intent(in) :: softness(:)  !! theta/w (n_rows) [length/force].
    !> Fraction of the diagonal that is added: rows that depend on each other are closed in the mean, with less force
    !> the larger it is [].
    real(dp), intent(in) :: shift
    real(dp), intent(out) :: closed(:)  !! B g, of all rows (n_rows) [length].
    real(dp), intent(out) :: norm  !! Energy norm of g, at most; `huge` where there is none [sqrt(energy)].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or memory runs out.
    type(cholesky_t) :: factor
    type(sparse_symmetric_t) :: part
    real(dp), allocatable :: mu(:), all_mu(:), left(:)
    integer, allocatable :: row(:)
    real(dp) :: last
    integer :: k, i
    closed = 0
    norm = 0
    row = pack([(i, i=1, size(gap))], chosen)
    if (.not. any(abs(gap(row)) > 0)) return
    norm = huge(norm)
    call restrict_matrix(compliance, row, part)
    call factorize_rows(part, softness(row), shift, factor, error)
    if (.not. allocated(error)) then
      allocate (all_mu(size(gap)), source=0.0_dp)
      left = gap(row)
      last = huge(last)
      do k = 1, most_passes
        mu = left
        call factor%solve(mu)
        if (.not. all(abs(mu) <= huge(last))) exit
        all_mu(row) = all_mu(row) + mu
        call compliance%multiply(all_mu, closed)
        left(:) = gap(row) - closed(row) - softness(row)*all_mu(row)
        if (.not. norm2(left) < least_gain*last) exit
        last = norm2(left)
      end do
      if (k > 1) norm = sqrt(max(0.0_dp, dot_product(all_mu, closed)))
    end if
    call factor%destroy()
  end subroutine close_gaps

  !> The rows and columns of some contact rows.
  subroutine restrict_matrix(matrix, row, part)
    type(sparse_symmetric_t), intent(in) :: matrix  !! Of all rows.
    integer, intent(in) :: row(:)  !! Rows, ascending (n).
    type(sparse_symmetric_t), intent(out) :: part  !! Of these rows.
    integer :: number(matrix%n), i, j
    integer(int64) :: k, n
    number = 0
    number(row) = [(i, i=1, size(row))]
    part%n = size(row)
    allocate (part%column_start(part%n + 1), source=0_int64)
    do j = 1, part%n
      associate (first => matrix%column_start(row(j)) + 1, last => matrix%column_start(row(j) + 1))
        part%column_start(j + 1) = part%column_start(j) + count(number(matrix%row(first:last) + 1) > 0)
      end associate
    end do
    n = part%column_start(part%n + 1)
    allocate (part%row(n), part%value(n))
    n = 0
    do j = 1, part%n
      do k = matrix%column_start(row(j)) + 1, matrix%column_start(row(j) + 1)
        if (number(matrix%row(k) + 1) == 0) cycle
        n = n + 1
        part%row(n) = number(matrix%row(k) + 1) - 1
        part%value(n) = matrix%value(k)
      end do
    end do
  end subroutine restrict_matrix

  !> Factorize the matrix with the softness of the rows on its diagonal.
  subroutine factorize_rows(matrix, softness, shift, factor, error)
    type(sparse_symmetric_t), intent(in) :: matrix  !! B D^{-1} B^T of the rows.
    real(dp), intent(in) :: softness(:)  !! theta/w (n) [length/force].
    real(dp), intent(in) :: shift  !! As in `close_gaps`; larger where rounding has made the matrix indefinite [].
    type(cholesky_t), intent(inout) :: factor  !! The factor.
    type(error_t), allocatable, intent(out) :: error  !! As in `close_gaps`.
    type(sparse_symmetric_t) :: shifted
    integer, allocatable :: start(:), neighbour(:), order(:)
    real(dp) :: now
    integer :: failed, j
    call find_neighbours(matrix, start, neighbour)
    allocate (order(matrix%n))
    call nested_dissection(start, neighbour, order, error)
    if (.not. allocated(error)) call factor%analyze(matrix, order, error)
    if (allocated(error)) return
    now = shift
    do
      shifted = matrix
      do j = 1, matrix%n
        associate (diagonal => shifted%value(matrix%column_start(j) + 1))
          ! Rows between held nodes do not move.
          if (.not. diagonal > 0) diagonal = 1
          diagonal = (1 + now)*diagonal + softness(j)
        end associate
      end do
      call factor%factorize_and_discard(shifted, failed, error)
      if (failed == 0 .or. allocated(error) .or. now > most_shift) return
      now = 10*now
    end do
  end subroutine factorize_rows

  !> The graph of a symmetric matrix.
  subroutine find_neighbours(matrix, start, neighbour)
    type(sparse_symmetric_t), intent(in) :: matrix  !! The matrix.
    integer, allocatable, intent(out) :: start(:)  !! First neighbour of each row, and their number + 1 (n + 1).
    integer, allocatable, intent(out) :: neighbour(:)  !! The neighbours, row after row (start(n + 1) - 1).
    integer, allocatable :: next(:)
    integer :: i, j, pass
    integer(int64) :: k
    allocate (start(matrix%n + 1), source=0)
    do pass = 1, 2
      if (pass == 2) then
        start = [1, start(:matrix%n)]
        do j = 1, matrix%n
          start(j + 1) = start(j) + start(j + 1)
        end do
        allocate (neighbour(start(matrix%n + 1) - 1))
        next = start(:matrix%n)
      end if
      do j = 1, matrix%n
        do k = matrix%column_start(j) + 2, matrix%column_start(j + 1)
          i = int(matrix%row(k)) + 1
          if (pass == 1) then
            start(i) = start(i) + 1
            start(j) = start(j) + 1
          else
            neighbour(next(i)) = j
            neighbour(next(j)) = i
            next(i) = next(i) + 1
            next(j) = next(j) + 1
          end if
        end do
      end do
    end do
  end subroutine find_neighbours

  !> What a displacement leaves of the complementarity, `sum w [(y^+)^2/(2 theta) + theta m^2/2 - m y]` with y - B g:
  !> the duality gap but for the energy of the residual. `huge` where rows without forces penetrate.
  !>
  !> Rows with forces, theta = 0 and a remaining penetration are no admissible ones: as in 6.3 of docs/theory.md, twice
  !> its work stands for the displacement that closes it, and for those of ties and stiff layers likewise.
  pure real(dp) function left_open(weight, theta, is_tied, lambda, penetration, closed, is_stiff) result(left)
    real(dp), intent(in) :: weight(:)  !! Weights (n_rows) [area].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    logical, intent(in) :: is_tied(:)  !! Rows of ties, whose forces have any sign (n_rows).
    real(dp), intent(in) :: lambda(:)  !! Forces, not negative on contact rows (n_rows) [force].
    real(dp), intent(in) :: penetration(:), closed(:)  !! Penetrations, and what is closed of them (n_rows) [length].
    !> Whether theta = 0, or the layer is stiffer than the nodes of the row (n_rows).
    logical, intent(in) :: is_stiff(:)
    real(dp) :: rest, over, nothing, of_row
    integer :: i
    left = 0
    nothing = half_digits*maxval([0.0_dp, abs(closed)]) + epsilon(left)*maxval([0.0_dp, abs(penetration)])
    do i = 1, size(penetration)
      rest = penetration(i) - closed(i)
      over = rest - theta(i)*lambda(i)/weight(i)
      if (is_tied(i)) then
        left = left + 2*abs(lambda(i)*rest)
      else if (lambda(i) > 0) then
        if (rest > 0) then
          of_row = huge(of_row)
          if (theta(i) > 0) of_row = weight(i)*over**2/(2*theta(i))
          if (is_stiff(i)) of_row = min(of_row, 2*lambda(i)*abs(over))
        else
          of_row = lambda(i)*(theta(i)*lambda(i)/(2*weight(i)) - rest)
        end if
        left = left + of_row
      else if (rest > nothing) then
        if (.not. theta(i) > 0) then
          left = huge(left)
          return
        end if
        left = left + weight(i)*rest**2/(2*theta(i))
      end if
    end do
  end function left_open
end module dotyk_scheme_gap_closing
