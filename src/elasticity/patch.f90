!> The nodes around a vertex of a body: rings of elements, and axes in which these are about as long as wide.
module dotyk_elasticity_patch
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_monomials, only: lanes
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private

  !> The nodes of a patch in their own axes, eight at a time.
  type, public :: patch_t
    !> Number of nodes, and of blocks of them.
    integer :: n = 0, n_blocks = 0
    !> Nodes (any number >= n).
    integer, allocatable :: node(:)
    !> Places (lanes, dimension, >= n_blocks) [], and weights in the sum of squares (lanes, >= n_blocks).
    real(dp), allocatable :: t(:, :, :), weight(:, :)
    !> Displacements relative to the vertex (lanes, dimension, >= n_blocks) [length].
    real(dp), allocatable :: u(:, :, :)
  contains
    procedure :: fill => patch_fill
  end type patch_t

  public :: add_ring

contains

  !> Add the nodes of all elements that vertices of a patch belong to.
  pure subroutine add_ring(start, node, first, element, vertex, centre, mark, patch, inner, n)
    !> As in incidence_t.
    integer, intent(in) :: start(:), node(:), first(:), element(:)
    integer, intent(in) :: vertex(:)
    !> The vertex whose patch it is.
    integer, intent(in) :: centre
    integer, intent(inout) :: mark(:), patch(:)
    !> Number of nodes whose elements are in the patch already, and of all nodes of the patch.
    integer, intent(inout) :: inner, n
    integer :: i, k, p, last
    last = n
    do i = inner + 1, last
      if (vertex(patch(i)) == 0) cycle
      do k = first(patch(i)), first(patch(i) + 1) - 1
        do p = start(element(k)), start(element(k) + 1) - 1
          if (mark(node(p)) == centre) cycle
          mark(node(p)) = centre
          n = n + 1
          patch(n) = node(p)
        end do
      end do
    end do
    inner = last
  end subroutine add_ring

  !> Take places and displacements of the nodes of a patch, the first of which is its vertex, and find its axes.
  subroutine patch_fill(self, x, u, axes)
    class(patch_t), intent(inout) :: self
    !> Nodes (dimension, n_nodes) and their displacements [length].
    real(dp), intent(in) :: x(:, :), u(:, :)
    real(dp), intent(out) :: axes(:, :)
    real(dp) :: local(size(x, 1))
    integer :: i, b, l, dim
    dim = size(x, 1)
    self%n_blocks = (self%n + lanes - 1)/lanes
    if (allocated(self%t)) then
      if (size(self%weight, 2) < self%n_blocks) deallocate (self%t, self%u, self%weight)
    end if
    if (.not. allocated(self%t)) &
      allocate (self%t(lanes, dim, 2*self%n_blocks), self%u(lanes, dim, 2*self%n_blocks), self%weight(lanes, 2*self%n_blocks))
    call own_axes(self%n, dim, x, self%node, axes)
    do i = 1, lanes*self%n_blocks
      b = (i - 1)/lanes + 1
      l = i - lanes*(b - 1)
      if (i > self%n) then
        self%t(l, :, b) = 0
        self%u(l, :, b) = 0
        self%weight(l, b) = 0
        cycle
      end if
      call to_axes(dim, axes, x(:, self%node(i)), x(:, self%node(1)), local)
      self%t(l, :, b) = local
      self%u(l, :, b) = u(:, self%node(i)) - u(:, self%node(1))
      ! Far nodes of one-sided patches would bend the polynomial.
      self%weight(l, b) = 1/(0.01_dp + sum(local**2))**2
    end do
  end subroutine patch_fill

  !> Axes of a patch, along which the mean squares of its nodes' coordinates are the same.
  subroutine own_axes(n, dim, x, node, axes)
    !> Number of nodes, dimension.
    integer, intent(in) :: n, dim
    !> Nodes (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Those of the patch, its vertex first (n).
    integer, intent(in) :: node(:)
    !> To coordinates of 1 at most [1/length].
    real(dp), intent(out) :: axes(:, :)
    type(error_t), allocatable :: error
    real(dp) :: moment(dim, dim), vectors(dim, dim), values(dim), local(dim), square
    integer :: i, k
    moment = 0
    do i = 2, n
      local = x(:, node(i)) - x(:, node(1))
      do k = 1, dim
        moment(:, k) = moment(:, k) + local(k)*local
      end do
    end do
    square = 0
    do k = 1, dim
      square = max(square, moment(k, k))
    end do
    square = max(square, tiny(square))
    moment = moment/square
    call symmetric_eigen(moment, values, vectors, error)
    axes = 0
    do k = 1, dim
      axes(k, k) = 1
      ! Elements have volume: only rounding makes a patch flatter than this.
      if (.not. allocated(error)) axes(k, :) = vectors(:, k)/sqrt(max(values(k), epsilon(square)**2))
    end do
    square = tiny(square)
    do i = 2, n
      call to_axes(dim, axes, x(:, node(i)), x(:, node(1)), local)
      square = max(square, sum(local**2))
    end do
    axes = axes/sqrt(square)
  end subroutine own_axes

  !> A place in axes of a patch.
  pure subroutine to_axes(dim, axes, x, centre, local)
    integer, intent(in) :: dim
    real(dp), intent(in) :: axes(dim, dim), x(dim), centre(dim)
    real(dp), intent(out) :: local(dim)
    integer :: k
    local = 0
    do k = 1, dim
      local = local + axes(:, k)*(x(k) - centre(k))
    end do
  end subroutine to_axes
end module dotyk_elasticity_patch
