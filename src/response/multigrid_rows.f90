!> Contact rows of one body on the two levels of its p-multigrid (`dotyk_response_multigrid`).
!>
!> With B the rows over the unknowns of the system, P the interpolation from the corners, K_c the stiffness of the
!> corner space and R the rigid body modes: the products that preconditioners of `K + B^T W B` need. Those of the
!> smoother, `B D^{-1} B^T` with D the diagonal blocks times the greatest eigenvalue of D^{-1} K (`chebyshev_t`), so
!> that K <= D; the rows on the corner space, `B P`; and `B R`.
module dotyk_response_multigrid_rows
  use dotyk_base_kinds, only: dp, sp
  use dotyk_base_thresholds, only: rounding
  use dotyk_linalg_sparse, only: same_rows, sparse_rows_t
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_response_contact_map, only: contact_map_t
  implicit none
  private

  type, public :: multigrid_rows_t  !! The rows of one body.
    integer :: n = 0  !! Number of rows.
    integer, allocatable :: node(:)  !! Nodes of the system that they touch, ascending (n_nodes).
    type(sparse_rows_t) :: fine  !! The rows over the components of these nodes, in nodal axes (n x dim*n_nodes) [].
    type(sparse_rows_t) :: corner  !! The rows over the equations of the corner space, B P (n x n_corner_equations) [].
    type(sparse_rows_t) :: smoother  !! Compliance of the smoother, B D^{-1} B^T (n x n) [length/force].
    real(dp), allocatable :: mode(:, :)  !! Rigid body modes at the rows, B R (n, n_modes) [].
  contains
    procedure :: init => rows_init
    procedure :: init_motions => rows_init_motions
    procedure :: is_like => rows_is_like
    procedure :: add_displacement => rows_add_displacement
    procedure :: add_displacement_low => rows_add_displacement_low
    procedure :: add_smoothed => rows_add_smoothed
    procedure :: subtract_force => rows_subtract_force
    procedure :: subtract_force_low => rows_subtract_force_low
  end type multigrid_rows_t

contains

  !> Carry the rows to both levels.
  subroutine rows_init(self, grid, map, matrix)
    class(multigrid_rows_t), intent(out) :: self
    class(body_grid_t), intent(in) :: grid  !! The p-multigrid of the body.
    type(contact_map_t), intent(in) :: map  !! Contact nodes of the body and their equations.
    !> The rows over the Cartesian components of the contact nodes (n x dim*n_contact_nodes) [].
    type(sparse_rows_t), intent(in) :: matrix
    type(sparse_rows_t) :: rows
    integer, allocatable :: unknown(:)
    real(dp), allocatable :: x(:)
    integer :: i, k, dim
    self%n = matrix%n_rows
    dim = grid%fine%rows%dim
    call map%rows(matrix, [(i, i=1, self%n)], rows)
    ! It leaves room for entries of held components.
    rows%column = rows%column(:rows%row_start(self%n + 1) - 1)
    rows%value = rows%value(:rows%row_start(self%n + 1) - 1)
    allocate (unknown(grid%constraint%n_equations), source=0)
    call invert(size(grid%constraint%equation), grid%constraint%equation, unknown)
    rows%column(:) = unknown(rows%column)
    call grid%interpolation%carry_rows(grid%constraint, rows, self%corner)
    call number_nodes(dim, grid%fine%rows%n, rows%column, self%node)
    do k = 1, size(rows%column)
      i = (rows%column(k) - 1)/dim + 1
      rows%column(k) = dim*(place(self%node, i) - 1) + rows%column(k) - dim*(i - 1)
    end do
    rows%n_columns = dim*size(self%node)
    self%fine = rows
    allocate (self%mode(self%n, size(grid%mode, 2)), x(rows%n_columns))
    do k = 1, size(grid%mode, 2)
      do i = 1, size(self%node)
        x(dim*(i - 1) + 1:dim*i) = grid%mode(dim*(self%node(i) - 1) + 1:dim*self%node(i), k)
      end do
      call multiply_exactly(self%fine, x, self%mode(:, k))
    end do
    call smoother_compliance(grid, self)
  end subroutine rows_init

  !> Rows of unknowns without stiffness, which are their own corner space.
  subroutine rows_init_motions(self, dim, motion)
    class(multigrid_rows_t), intent(out) :: self
    integer, intent(in) :: dim  !! Components of a node: unknowns come by nodes.
    real(dp), intent(in) :: motion(:, :)  !! Displacements of the rows by the unknowns (n, n_motions) [].
    integer :: i, j
    self%n = size(motion, 1)
    associate (m => size(motion, 2))
      self%node = [(i, i=1, (m + dim - 1)/dim)]
      call self%corner%init_from_triplets(self%n, m, [((i, i=1, self%n), j=1, m)], [((j, i=1, self%n), j=1, m)], &
                                          reshape(motion, [size(motion)]))
    end associate
    self%fine = self%corner
    self%fine%n_columns = dim*size(self%node)
    call self%smoother%init_from_triplets(self%n, self%n, [integer ::], [integer ::], [real(dp) ::])
    self%mode = motion
  end subroutine rows_init_motions

  !> y = B x, zero where nothing but rounding is left.
  pure subroutine multiply_exactly(matrix, x, y)
    type(sparse_rows_t), intent(in) :: matrix  !! B.
    real(dp), intent(in) :: x(:)  !! A rigid body mode [].
    real(dp), intent(out) :: y(:)  !! At the rows [].
    integer :: i
    call matrix%multiply(x, y)
    do i = 1, matrix%n_rows
      associate (first => matrix%row_start(i), last => matrix%row_start(i + 1) - 1)
        if (abs(y(i)) <= rounding*sum(abs(matrix%value(first:last)*x(matrix%column(first:last))))) y(i) = 0
      end associate
    end do
  end subroutine multiply_exactly

  !> Whether these are the rows of another body with the same p-multigrid: their compliances are one matrix.
  pure logical function rows_is_like(self, other) result(is_like)
    class(multigrid_rows_t), intent(in) :: self
    type(multigrid_rows_t), intent(in) :: other  !! The rows of the other body.
    is_like = same_rows(self%corner, other%corner, rounding)
  end function rows_is_like

  !> The unknown of the system of each equation.
  pure subroutine invert(n, equation, unknown)
    integer, intent(in) :: n  !! Number of unknowns.
    integer, intent(in) :: equation(n)  !! Equation of each unknown, 0 where it is held (n).
    integer, intent(inout) :: unknown(:)  !! Unknown of each equation (n_equations).
    integer :: i
    do i = 1, n
      if (equation(i) > 0) unknown(equation(i)) = i
    end do
  end subroutine invert

  !> The nodes of some unknowns.
  pure subroutine number_nodes(dim, n_nodes, unknown, node)
    integer, intent(in) :: dim  !! Unknowns of a node.
    integer, intent(in) :: n_nodes  !! Number of nodes of the system.
    integer, intent(in) :: unknown(:)  !! The unknowns (any number).
    integer, allocatable, intent(out) :: node(:)  !! Their nodes, ascending (n).
    logical, allocatable :: touched(:)
    integer :: i
    allocate (touched(n_nodes), source=.false.)
    do i = 1, size(unknown)
      touched((unknown(i) - 1)/dim + 1) = .true.
    end do
    node = pack([(i, i=1, n_nodes)], touched)
  end subroutine number_nodes

  !> Place of a number in an ascending list that has it.
  pure integer function place(list, number)
    integer, intent(in) :: list(:)  !! The list (n).
    integer, intent(in) :: number  !! The number.
    integer :: low, high, middle
    low = 1
    high = size(list)
    do while (low < high)
      middle = (low + high)/2
      if (list(middle) < number) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    place = low
  end function place

  !> B D^{-1} B^T.
  subroutine smoother_compliance(grid, self)
    class(body_grid_t), intent(in) :: grid  !! The p-multigrid.
    type(multigrid_rows_t), intent(inout) :: self  !! The rows; gets the matrix.
    type(sparse_rows_t) :: diagonal, scaled, transposed
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
    real(dp) :: scale
    integer :: i, j, k, dim
    dim = grid%fine%rows%dim
    scale = 1/(grid%fine%greatest*grid%fine%rows%scale)
    allocate (row(size(self%fine%column)))
    do i = 1, self%n
      row(self%fine%row_start(i):self%fine%row_start(i + 1) - 1) = i
    end do
    call transposed%init_from_triplets(self%fine%n_columns, self%n, self%fine%column, row, self%fine%value)
    row = [(((dim*(i - 1) + k, k=1, dim), j=1, dim), i=1, size(self%node))]
    column = [(((dim*(i - 1) + j, k=1, dim), j=1, dim), i=1, size(self%node))]
    value = scale*reshape(real(grid%fine%inverse(:, :, self%node), dp), [size(row)])
    call diagonal%init_from_triplets(self%fine%n_columns, self%fine%n_columns, row, column, value)
    call scaled%set_product(self%fine, diagonal)
    call self%smoother%set_product(scaled, transposed)
  end subroutine smoother_compliance

  !> x := D^{-1} x at some nodes.
  pure subroutine apply_diagonal(grid, node, x)
    class(body_grid_t), intent(in) :: grid  !! The p-multigrid.
    integer, intent(in) :: node(:)  !! The nodes (n).
    real(dp), intent(inout) :: x(:)  !! Forces [force] in, displacements [length] out (dim*n).
    real(dp) :: scale
    integer :: i, dim
    dim = grid%fine%rows%dim
    scale = 1/(grid%fine%greatest*grid%fine%rows%scale)
    do i = 1, size(node)
      x(dim*(i - 1) + 1:dim*i) = scale*matmul(real(grid%fine%inverse(:, :, node(i)), dp), x(dim*(i - 1) + 1:dim*i))
    end do
  end subroutine apply_diagonal

  !> y := y + B x.
  subroutine rows_add_displacement(self, dim, x, y)
    class(multigrid_rows_t), intent(in) :: self
    integer, intent(in) :: dim  !! Components of a node.
    real(dp), intent(in) :: x(dim, *)  !! Vector of the system (dim, all nodes) [length].
    real(dp), intent(inout) :: y(:)  !! At the rows (n) [length].
    real(dp) :: moved(self%n)
    if (self%n == 0) return
    call self%fine%multiply(reshape(x(:, self%node), [dim*size(self%node)]), moved)
    y(:) = y + moved
  end subroutine rows_add_displacement

  !> y := y + factor B x of a vector in single precision.
  subroutine rows_add_displacement_low(self, dim, factor, x, y)
    class(multigrid_rows_t), intent(in) :: self
    integer, intent(in) :: dim  !! Components of a node.
    real(dp), intent(in) :: factor  !! Factor [].
    real(sp), intent(in) :: x(dim, *)  !! Vector of the system (dim, all nodes) [any].
    real(dp), intent(inout) :: y(:)  !! At the rows (n) [as x].
    real(dp) :: moved(self%n)
    if (self%n == 0) return
    call self%fine%multiply(reshape(real(x(:, self%node), dp), [dim*size(self%node)]), moved)
    y(:) = y + factor*moved
  end subroutine rows_add_displacement_low

  !> y := y + B D^{-1} r.
  subroutine rows_add_smoothed(self, grid, dim, r, y)
    class(multigrid_rows_t), intent(in) :: self
    class(body_grid_t), intent(in) :: grid  !! The p-multigrid.
    integer, intent(in) :: dim  !! Components of a node.
    real(sp), intent(in) :: r(dim, *)  !! Residual of the system (dim, all nodes) [force].
    real(dp), intent(inout) :: y(:)  !! At the rows (n) [length].
    real(dp) :: x(dim*size(self%node)), moved(self%n)
    if (self%n == 0) return
    x = reshape(real(r(:, self%node), dp), [size(x)])
    call apply_diagonal(grid, self%node, x)
    call self%fine%multiply(x, moved)
    y(:) = y + moved
  end subroutine rows_add_smoothed

  !> r := r - B^T lambda.
  subroutine rows_subtract_force(self, dim, lambda, r)
    class(multigrid_rows_t), intent(in) :: self
    integer, intent(in) :: dim  !! Components of a node.
    real(dp), intent(in) :: lambda(:)  !! At the rows (n) [force].
    real(dp), intent(inout) :: r(dim, *)  !! Vector of the system (dim, all nodes) [force].
    real(dp) :: force(dim, size(self%node))
    if (self%n == 0) return
    call transposed_product(self%fine, lambda, size(force), force)
    r(:, self%node) = r(:, self%node) - force
  end subroutine rows_subtract_force

  !> r := r - B^T lambda for a vector in single precision.
  subroutine rows_subtract_force_low(self, dim, lambda, r)
    class(multigrid_rows_t), intent(in) :: self
    integer, intent(in) :: dim  !! Components of a node.
    real(dp), intent(in) :: lambda(:)  !! At the rows (n) [force].
    real(sp), intent(inout) :: r(dim, *)  !! Vector of the system (dim, all nodes) [force].
    real(dp) :: force(dim, size(self%node))
    if (self%n == 0) return
    call transposed_product(self%fine, lambda, size(force), force)
    r(:, self%node) = real(real(r(:, self%node), dp) - force, sp)
  end subroutine rows_subtract_force_low

  !> B^T lambda over the components of the touched nodes.
  subroutine transposed_product(matrix, lambda, n, force)
    type(sparse_rows_t), intent(in) :: matrix  !! The rows.
    real(dp), intent(in) :: lambda(:)  !! At the rows [force].
    integer, intent(in) :: n  !! Number of components.
    real(dp), intent(out) :: force(n)  !! (n) [force].
    call matrix%multiply_transposed(lambda, force)
  end subroutine transposed_product
end module dotyk_response_multigrid_rows
