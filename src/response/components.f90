!> Between Cartesian components at the contact nodes and the unknowns of a system.
module dotyk_response_components
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_sparse, only: sparse_rows_t
  implicit none
  private
  public :: scatter, gather, to_equations

contains

  !> Forces at the contact nodes to a right-hand side.
  pure subroutine scatter(dim, n, equation, axes_of, axes, force, x)
    !> Numbers of displacement components and of contact nodes.
    integer, intent(in) :: dim, n
    !> Unknown of each component (0: none) and axes of each node (0: global), an index into `axes`.
    integer, intent(in) :: equation(dim, n), axes_of(n)
    real(dp), intent(in) :: axes(:, :, :)
    !> Forces [force].
    real(dp), intent(in) :: force(dim, n)
    !> Right-hand side (n_equations).
    real(dp), intent(out) :: x(:)
    real(dp) :: local(dim)
    integer :: i, k
    x = 0
    do i = 1, n
      local = force(:, i)
      if (axes_of(i) > 0) local = matmul(local, axes(:, :, axes_of(i)))
      do k = 1, dim
        if (equation(k, i) > 0) x(equation(k, i)) = local(k)
      end do
    end do
  end subroutine scatter

  !> A solution to displacements of the contact nodes.
  pure subroutine gather(dim, n, equation, axes_of, axes, x, displacement)
    !> As in `scatter`.
    integer, intent(in) :: dim, n
    integer, intent(in) :: equation(dim, n), axes_of(n)
    real(dp), intent(in) :: axes(:, :, :)
    !> Solution (n_equations).
    real(dp), intent(in) :: x(:)
    !> Displacements [length].
    real(dp), intent(out) :: displacement(dim, n)
    real(dp) :: local(dim)
    integer :: i, k
    do i = 1, n
      local = 0
      do k = 1, dim
        if (equation(k, i) > 0) local(k) = x(equation(k, i))
      end do
      if (axes_of(i) > 0) local = matmul(axes(:, :, axes_of(i)), local)
      displacement(:, i) = local
    end do
  end subroutine gather

  !> Rows over Cartesian components of the contact nodes to rows over the unknowns.
  subroutine to_equations(equation, axes_of, axes, matrix, row, rows)
    !> As in `scatter`.
    integer, intent(in) :: equation(:, :), axes_of(:)
    real(dp), intent(in) :: axes(:, :, :)
    !> Column (i-1)*dimension + component of contact node i; all entries of a node stand together.
    type(sparse_rows_t), intent(in) :: matrix
    !> Which rows.
    integer, intent(in) :: row(:)
    type(sparse_rows_t), intent(inout) :: rows
    real(dp) :: local(size(equation, 1))
    integer :: j, k, i, c, n, dim, last
    dim = size(equation, 1)
    rows%n_rows = size(row)
    rows%n_columns = maxval([0, equation])
    allocate (rows%row_start(size(row) + 1))
    n = dim*sum(matrix%row_start(row + 1) - matrix%row_start(row))
    allocate (rows%column(n), rows%value(n))
    n = 0
    do j = 1, size(row)
      rows%row_start(j) = n + 1
      k = matrix%row_start(row(j))
      last = matrix%row_start(row(j) + 1) - 1
      do while (k <= last)
        i = (matrix%column(k) - 1)/dim + 1
        local = 0
        do while (k <= last)
          if ((matrix%column(k) - 1)/dim + 1 /= i) exit
          c = matrix%column(k) - (i - 1)*dim
          local(c) = local(c) + matrix%value(k)
          k = k + 1
        end do
        if (axes_of(i) > 0) local = matmul(local, axes(:, :, axes_of(i)))
        do c = 1, dim
          if (equation(c, i) == 0 .or. .not. abs(local(c)) > 0) cycle
          n = n + 1
          rows%column(n) = equation(c, i)
          rows%value(n) = local(c)
        end do
      end do
    end do
    rows%row_start(size(row) + 1) = n + 1
  end subroutine to_equations
end module dotyk_response_components
