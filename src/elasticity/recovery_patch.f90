!> The nodes around a vertex of a body: rings of elements, and axes in which these are about as long as wide.
module dotyk_elasticity_recovery_patch
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_monomials, only: lanes
  implicit none
  private

  !> The nodes of a patch in their own axes, eight at a time.
  type, public :: recovery_patch_t
    !> Number of nodes, and of blocks of them.
    integer :: n = 0, n_blocks = 0
    !> Nodes (any number >= n).
    integer, allocatable :: node(:)
    !> Places (lanes, dimension, >= n_blocks) [], and roots of the weights in the sum of squares (lanes, >= n_blocks).
    real(dp), allocatable :: t(:, :, :), root_weight(:, :)
    !> Values, relative to those of the vertex, times these roots (n_values, >= n).
    real(dp), allocatable :: value(:, :)
  contains
    procedure :: fill => recovery_patch_fill
    procedure :: take => recovery_patch_take
  end type recovery_patch_t

  public :: add_ring, diagonalize

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

  !> Take places of the nodes of a patch, the first of which is its vertex, and find its axes.
  subroutine recovery_patch_fill(self, dim, x, axes)
    class(recovery_patch_t), intent(inout) :: self
    integer, intent(in) :: dim
    !> Nodes (dimension, n_nodes) [length].
    real(dp), intent(in), contiguous :: x(:, :)
    real(dp), intent(out) :: axes(dim, dim)
    self%n_blocks = (self%n + lanes - 1)/lanes
    if (allocated(self%t)) then
      if (size(self%root_weight, 2) < self%n_blocks) deallocate (self%t, self%root_weight)
    end if
    if (.not. allocated(self%t)) allocate (self%t(lanes, dim, 2*self%n_blocks), self%root_weight(lanes, 2*self%n_blocks))
    call gather(self%n, dim, self%n_blocks, self%node, x, self%t)
    call own_axes(dim, self%n_blocks, self%t, axes)
    call to_axes(self%n, dim, self%n_blocks, axes, self%t, self%root_weight)
  end subroutine recovery_patch_fill

  !> Take values at the nodes of a patch that is filled.
  subroutine recovery_patch_take(self, values)
    class(recovery_patch_t), intent(inout) :: self
    !> (n_values, n_nodes).
    real(dp), intent(in), contiguous :: values(:, :)
    real(dp) :: root
    integer :: i
    if (allocated(self%value)) then
      if (size(self%value, 2) < self%n) deallocate (self%value)
    end if
    if (.not. allocated(self%value)) allocate (self%value(size(values, 1), 2*self%n))
    do i = 1, self%n
      root = self%root_weight(mod(i - 1, lanes) + 1, (i - 1)/lanes + 1)
      self%value(:, i) = root*(values(:, self%node(i)) - values(:, self%node(1)))
    end do
  end subroutine recovery_patch_take

  !> Vectors of the nodes of a patch, relative to that of the first one; zeros fill the last block up.
  pure subroutine gather(n, dim, n_blocks, node, of_nodes, relative)
    integer, intent(in) :: n, dim, n_blocks
    integer, intent(in) :: node(n)
    real(dp), intent(in) :: of_nodes(dim, *)
    real(dp), intent(out) :: relative(lanes, dim, n_blocks)
    real(dp) :: origin(dim)
    integer :: b, i, k, l
    origin = of_nodes(:, node(1))
    i = 0
    do b = 1, n_blocks
      do l = 1, lanes
        i = i + 1
        do k = 1, dim
          relative(l, k, b) = of_nodes(k, node(min(i, n))) - origin(k)
        end do
      end do
    end do
    do l = lanes, lanes - (lanes*n_blocks - n) + 1, -1
      relative(l, :, n_blocks) = 0
    end do
  end subroutine gather

  !> Axes of a patch, along which the mean squares of its nodes' coordinates are the same.
  subroutine own_axes(dim, n_blocks, x, axes)
    integer, intent(in) :: dim, n_blocks
    !> Nodes, from the centre [length].
    real(dp), intent(in) :: x(lanes, dim, n_blocks)
    !> To coordinates of any length [1/length].
    real(dp), intent(out) :: axes(dim, dim)
    real(dp) :: total(lanes, dim, dim), moment(dim, dim), vectors(dim, dim), largest
    integer :: b, i, k
    total = 0
    do b = 1, n_blocks
      do k = 1, dim
        do i = k, dim
          total(:, i, k) = total(:, i, k) + x(:, i, b)*x(:, k, b)
        end do
      end do
    end do
    moment = 0
    largest = tiny(largest)
    do k = 1, dim
      do i = k, dim
        moment(i, k) = sum(total(:, i, k))
        moment(k, i) = moment(i, k)
      end do
      largest = max(largest, moment(k, k))
    end do
    moment = moment/largest
    call diagonalize(dim, moment, vectors)
    do k = 1, dim
      ! Elements have volume: only rounding makes a patch flatter than this.
      axes(k, :) = vectors(:, k)/(sqrt(max(moment(k, k), epsilon(largest)**2))*sqrt(largest))
    end do
  end subroutine own_axes

  !> Eigenvectors of a small symmetric matrix by Jacobi's rotations: fewer operations than a call of LAPACK, always in the same order.
  pure subroutine diagonalize(n, a, vectors)
    integer, intent(in) :: n
    !> The matrix; its eigenvalues on the diagonal on return.
    real(dp), intent(inout) :: a(n, n)
    !> Columns.
    real(dp), intent(out) :: vectors(n, n)
    !> Sweeps at most; three or four are enough.
    integer, parameter :: sweeps = 12
    !> Entries below this part of the diagonal are none.
    real(dp), parameter :: nothing = 1.0e-100_dp
    real(dp) :: t, c, s, line(n), size_of_diagonal
    integer :: i, k, sweep
    vectors = 0
    do k = 1, n
      vectors(k, k) = 1
    end do
    do sweep = 1, sweeps
      size_of_diagonal = 0
      do k = 1, n
        size_of_diagonal = max(size_of_diagonal, abs(a(k, k)))
      end do
      do k = 2, n
        do i = 1, k - 1
          ! The square of t must not overflow.
          if (.not. abs(a(i, k)) > nothing*size_of_diagonal) cycle
          t = (a(k, k) - a(i, i))/(2*a(i, k))
          t = sign(1.0_dp, t)/(abs(t) + sqrt(1 + t**2))
          c = 1/sqrt(1 + t**2)
          s = c*t
          line = a(:, i)
          a(:, i) = c*line - s*a(:, k)
          a(:, k) = s*line + c*a(:, k)
          line = a(i, :)
          a(i, :) = c*line - s*a(k, :)
          a(k, :) = s*line + c*a(k, :)
          line = vectors(:, i)
          vectors(:, i) = c*line - s*vectors(:, k)
          vectors(:, k) = s*line + c*vectors(:, k)
        end do
      end do
      t = 0
      do k = 2, n
        t = max(t, maxval(abs(a(:k - 1, k))))
      end do
      if (t <= 0.1_dp*epsilon(t)*size_of_diagonal) exit
    end do
  end subroutine diagonalize

  !> Turn the nodes into axes in which none is farther from the centre than 1, and weigh them.
  pure subroutine to_axes(n, dim, n_blocks, axes, t, root_weight)
    integer, intent(in) :: n, dim, n_blocks
    !> To coordinates of any length, then of 1 at most [1/length].
    real(dp), intent(inout) :: axes(dim, dim)
    !> Places [length], then [].
    real(dp), intent(inout) :: t(lanes, dim, n_blocks)
    real(dp), intent(out) :: root_weight(lanes, n_blocks)
    real(dp) :: line(lanes, dim), square(lanes), farthest(lanes), scale
    integer :: b, i, k
    farthest = tiny(scale)
    do b = 1, n_blocks
      square = 0
      do i = 1, dim
        line(:, i) = 0
        do k = 1, dim
          line(:, i) = line(:, i) + axes(i, k)*t(:, k, b)
        end do
        square = square + line(:, i)**2
      end do
      t(:, :, b) = line
      root_weight(:, b) = square
      farthest = max(farthest, square)
    end do
    scale = 1/sqrt(maxval(farthest))
    axes = scale*axes
    do b = 1, n_blocks
      t(:, :, b) = scale*t(:, :, b)
      ! Far nodes of one-sided patches would bend the polynomial.
      root_weight(:, b) = 1/(0.01_dp + scale**2*root_weight(:, b))
    end do
    do i = lanes, lanes - (lanes*n_blocks - n) + 1, -1
      root_weight(i, n_blocks) = 0
    end do
  end subroutine to_axes
end module dotyk_elasticity_recovery_patch
