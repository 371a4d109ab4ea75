!> Solutions of linear systems with a block LDL^T factor (`dotyk_linalg_block_ldlt`), and the null vectors of its
!> matrix.
module dotyk_linalg_block_ldlt_solution
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemv, dtrsv
  use dotyk_linalg_block_ldlt, only: block_ldlt_t
  implicit none
  private
  public :: solve_block_ldlt, expand_null_vector

contains

  !> x <- A^+ x: exact where x is in the range of A; components along null directions come out as 0.
  subroutine solve_block_ldlt(factor, x)
    !> Factorized.
    type(block_ldlt_t), intent(in) :: factor
    !> Right-hand side [any], the solution on return [that over the matrix]; by blocks (n).
    real(dp), intent(inout) :: x(:)
    integer :: g, k
    associate (tree => factor%tree)
      do g = 1, tree%n_groups
        call substitute_forward(factor, g, x)
      end do
      do k = 1, tree%n_blocks
        if (factor%sign(k) < 0) x(tree%first(k):tree%first(k + 1) - 1) = -x(tree%first(k):tree%first(k + 1) - 1)
      end do
      do g = tree%n_groups, 1, -1
        call substitute_backward(factor, g, factor%first_run(g + 1) - 1, x)
      end do
    end associate
  end subroutine solve_block_ldlt

  !> The null vector of A that belongs to a null direction: `A x = 0`.
  subroutine expand_null_vector(factor, i, x)
    !> Factorized.
    type(block_ldlt_t), intent(in) :: factor
    !> Number of the null direction.
    integer, intent(in) :: i
    !> Null vector, by blocks (n) [].
    real(dp), intent(out) :: x(:)
    integer :: g, r
    x = 0
    associate (tree => factor%tree, block => factor%null_block(i))
      x(tree%first(block):tree%first(block + 1) - 1) = factor%null_direction(:tree%size(block), i)
      g = tree%group(tree%time(block))
      ! The run of a block of H has no other block; substitution begins at the run before it.
      r = factor%first_run(g)
      do while (factor%run(r) < tree%time(block))
        r = r + 1
      end do
      call substitute_backward(factor, g, r - 1, x)
      ! The groups of the subtree are numbered successively; x vanishes on all others.
      do g = g - 1, tree%first_below(g), -1
        call substitute_backward(factor, g, factor%first_run(g + 1) - 1, x)
      end do
    end associate
  end subroutine expand_null_vector

  !> x <- L^{-1} x, the columns of one group.
  subroutine substitute_forward(factor, g, x)
    !> Factorized.
    type(block_ldlt_t), intent(in) :: factor
    !> The group.
    integer, intent(in) :: g
    !> Right-hand side; overwritten, by blocks (n) [any].
    real(dp), intent(inout) :: x(:)
    real(dp), allocatable :: front(:)
    integer :: r, at, n, m
    m = factor%tree%height(g)
    allocate (front(m))
    associate (panel => factor%panel(g)%x, &
               row => factor%tree%row(factor%tree%row_start(g):factor%tree%row_start(g + 1) - 1))
      front = x(row)
      do r = factor%first_run(g), factor%first_run(g + 1) - 1
        at = factor%offset(factor%run(r))
        n = factor%columns(factor%run(r), factor%run(r + 1) - 1)
        if (n == 0) cycle
        if (factor%sign(factor%tree%order(factor%run(r))) > 0) then
          call dtrsv('L', 'N', 'N', n, panel(at + 1, at + 1), m, front(at + 1), 1)
        else
          front(at + 1:at + n) = matmul(front(at + 1:at + n), factor%root(factor%run(r))%x)
        end if
        if (at + n < m) call dgemv('N', m - at - n, n, -1.0_dp, panel(at + n + 1, at + 1), m, front(at + 1), 1, &
                                   1.0_dp, front(at + n + 1), 1)
      end do
      x(row) = front
    end associate
  end subroutine substitute_forward

  !> x <- L^{-T} x, the columns of one group from a given run to its first.
  subroutine substitute_backward(factor, g, last, x)
    !> Factorized.
    type(block_ldlt_t), intent(in) :: factor
    !> The group.
    integer, intent(in) :: g
    !> The run to begin with.
    integer, intent(in) :: last
    !> Result of the forward substitution, the solution on return; by blocks (n) [any].
    real(dp), intent(inout) :: x(:)
    real(dp), allocatable :: front(:)
    integer :: r, at, n, m
    m = factor%tree%height(g)
    allocate (front(m))
    associate (panel => factor%panel(g)%x, &
               row => factor%tree%row(factor%tree%row_start(g):factor%tree%row_start(g + 1) - 1))
      front = x(row)
      do r = last, factor%first_run(g), -1
        at = factor%offset(factor%run(r))
        n = factor%columns(factor%run(r), factor%run(r + 1) - 1)
        if (n == 0) cycle
        if (at + n < m) call dgemv('T', m - at - n, n, -1.0_dp, panel(at + n + 1, at + 1), m, front(at + n + 1), 1, &
                                   1.0_dp, front(at + 1), 1)
        if (factor%sign(factor%tree%order(factor%run(r))) > 0) then
          call dtrsv('L', 'T', 'N', n, panel(at + 1, at + 1), m, front(at + 1), 1)
        else
          front(at + 1:at + n) = matmul(factor%root(factor%run(r))%x, front(at + 1:at + n))
        end if
      end do
      x(row) = front
    end associate
  end subroutine substitute_backward
end module dotyk_linalg_block_ldlt_solution
