!> Between Cartesian components at the contact nodes of a body and its equations.
!>
!> Equations of a node may be in rotated axes (local supports), and prescribed components have none. Rows of B know the
!> contact nodes alone: column (i-1)*dimension + component of contact node i.
module dotyk_response_contact_map
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  implicit none
  private

  type, public :: contact_map_t  !! The map of one body.
    integer :: dimension = 0, n_nodes = 0  !! Space dimension, and number of contact nodes.
    !> Equation of each component, in the axes of the node; 0 where prescribed (dimension, n_nodes).
    integer, allocatable :: equation(:, :)
    !> Axes of each node: 0 for the global ones, else an index into `axes` (n_nodes).
    integer, allocatable, private :: axes_of(:)
    real(dp), allocatable, private :: axes(:, :, :)  !! Axes as columns (dimension, dimension, n_axes) [].
  contains
    procedure :: init => map_init
    procedure :: scatter => map_scatter
    procedure :: gather => map_gather
    procedure :: rows => map_rows
    procedure :: diagonal => map_diagonal
  end type contact_map_t

contains

  !> Make the map.
  subroutine map_init(self, constraint, contact_node)
    class(contact_map_t), intent(out) :: self
    type(constraint_t), intent(in) :: constraint  !! Equations and local axes of the body.
    integer, intent(in) :: contact_node(:)  !! Nodes of the body where contact forces may act (n_nodes).
    integer :: i, n_axes, frame
    self%dimension = size(constraint%equation, 1)
    self%n_nodes = size(contact_node)
    self%equation = constraint%equation(:, contact_node)
    allocate (self%axes_of(size(contact_node)), source=0)
    n_axes = count(constraint%frame_of(contact_node) > 0)
    allocate (self%axes(self%dimension, self%dimension, n_axes))
    n_axes = 0
    do i = 1, size(contact_node)
      frame = constraint%frame_of(contact_node(i))
      if (frame == 0) cycle
      n_axes = n_axes + 1
      self%axes_of(i) = n_axes
      self%axes(:, :, n_axes) = constraint%frame(:, :, frame)
    end do
  end subroutine map_init

  !> Nodal forces to a right-hand side.
  pure subroutine map_scatter(self, force, x)
    class(contact_map_t), intent(in) :: self
    real(dp), intent(in) :: force(:)  !! Cartesian forces (dimension*n_nodes) [force].
    real(dp), intent(out) :: x(:)  !! Right-hand side (n_equations) [force].
    real(dp) :: local(self%dimension)
    integer :: i, k
    x = 0
    do i = 1, self%n_nodes
      local = force((i - 1)*self%dimension + 1:i*self%dimension)
      if (self%axes_of(i) > 0) local = matmul(local, self%axes(:, :, self%axes_of(i)))
      do k = 1, self%dimension
        if (self%equation(k, i) > 0) x(self%equation(k, i)) = local(k)
      end do
    end do
  end subroutine map_scatter

  !> A solution to displacements of the contact nodes.
  pure subroutine map_gather(self, x, displacement)
    class(contact_map_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Solution (n_equations) [length].
    real(dp), intent(out) :: displacement(:)  !! Cartesian displacements (dimension*n_nodes) [length].
    real(dp) :: local(self%dimension)
    integer :: i, k
    do i = 1, self%n_nodes
      local = 0
      do k = 1, self%dimension
        if (self%equation(k, i) > 0) local(k) = x(self%equation(k, i))
      end do
      if (self%axes_of(i) > 0) local = matmul(self%axes(:, :, self%axes_of(i)), local)
      displacement((i - 1)*self%dimension + 1:i*self%dimension) = local
    end do
  end subroutine map_gather

  !> Rows of B to rows over the equations.
  subroutine map_rows(self, matrix, row, rows)
    class(contact_map_t), intent(in) :: self
    !> Rows over the components of the contact nodes; all entries of a node stand together.
    type(sparse_rows_t), intent(in) :: matrix
    integer, intent(in) :: row(:)  !! Which rows of it (n).
    type(sparse_rows_t), intent(inout) :: rows  !! They over the equations.
    real(dp) :: local(self%dimension)
    integer :: j, k, i, c, n, dim, last
    dim = self%dimension
    rows%n_rows = size(row)
    rows%n_columns = maxval([0, self%equation])
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
        if (self%axes_of(i) > 0) local = matmul(local, self%axes(:, :, self%axes_of(i)))
        do c = 1, dim
          if (self%equation(c, i) == 0 .or. .not. abs(local(c)) > 0) cycle
          n = n + 1
          rows%column(n) = self%equation(c, i)
          rows%value(n) = local(c)
        end do
      end do
    end do
    rows%row_start(size(row) + 1) = n + 1
  end subroutine map_rows

  !> Diagonal of the stiffness in Cartesian components; 0 along prescribed ones.
  pure function map_diagonal(self, diagonal) result(cartesian)
    class(contact_map_t), intent(in) :: self
    real(dp), intent(in) :: diagonal(:)  !! Over the equations (n_equations) [force/length].
    real(dp), allocatable :: cartesian(:)  !! (dimension*n_nodes) [force/length]
    real(dp) :: axis(self%dimension)
    integer :: i, k
    allocate (cartesian(self%dimension*self%n_nodes), source=0.0_dp)
    do i = 1, self%n_nodes
      do k = 1, self%dimension
        if (self%equation(k, i) == 0) cycle
        axis = 0
        axis(k) = 1
        if (self%axes_of(i) > 0) axis = self%axes(:, k, self%axes_of(i))
        associate (own => cartesian((i - 1)*self%dimension + 1:i*self%dimension))
          own = own + axis**2*diagonal(self%equation(k, i))
        end associate
      end do
    end do
  end function map_diagonal
end module dotyk_response_contact_map
