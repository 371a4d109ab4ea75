!> Recovery patch: the nodes in rings of elements around a vertex, in axes in which the patch is about as long as
!> wide.
!>
!> Monomials in two or three variables, and their values at nodes.
!>
!> Each monomial is an earlier one times a variable, so that a value costs one multiplication.
module dotyk_elasticity_recovery_patch
  use dotyk_base_kinds, only: dp
  use dotyk_base_number_set, only: number_set_t
  implicit none
  private
  public :: add_ring, diagonalize, evaluate_monomials

  !> Added to the squared distance from the vertex, relative to the farthest node, in the reciprocal of a node's
  !> weight: near nodes count more, up to a hundredfold.
  real(dp), parameter :: weight_floor = 0.01_dp

  type, public :: recovery_patch_t  !! The nodes of a patch in scaled axes, in blocks of `lanes` nodes.
    type(number_set_t) :: nodes  !! Nodes; the first one is the vertex.
    integer :: n_blocks = 0  !! Number of blocks.
    real(dp), allocatable :: t(:, :, :)  !! Scaled positions relative to the vertex (lanes, dim, >= n_blocks) [].
    !> Square roots of the weights of the least squares; 0 beyond the last node (lanes, >= n_blocks) [].
    real(dp), allocatable :: root_weight(:, :)
  contains
    procedure :: fill => recovery_patch_fill
  end type recovery_patch_t

  type, public :: monomials_t  !! All monomials up to a degree, lower degrees first.
    integer :: dimension = 0  !! Number of variables.
    integer :: degree = 0  !! Degree.
    integer :: n = 0  !! Number of monomials.
    integer :: n_lower = 0  !! Number of monomials of one degree less.
    integer, allocatable :: exponent(:, :)  !! Exponents (dimension, n).
    !> Monomial k is monomial parent(k) times variable axis(k); the first one, 1, has no parent (n).
    integer, allocatable :: parent(:)
    integer, allocatable :: axis(:)  !! Variable of this product (n).
    !> The derivative of a monomial by a variable is its exponent times this monomial; 0 for none (dimension, n).
    integer, allocatable :: derivative(:, :)
  contains
    procedure :: init => monomials_init
    procedure :: up_to => monomials_up_to
  end type monomials_t

  !> Number of nodes that are processed together: the length of the inner loops, a multiple of any vector length.
  integer, parameter, public :: lanes = 8

contains

  !> Add one ring: the nodes of all elements of the vertices of a patch.
  pure subroutine add_ring(start, node, first, element, vertex, inner, patch)
    integer, intent(in) :: start(:)  !! First entry of each element in `node` (n_elements + 1).
    integer, intent(in) :: node(:)  !! Nodes of the elements, one element after the other (n_entries).
    integer, intent(in) :: first(:)  !! First entry of each node in `element` (n_nodes + 1).
    integer, intent(in) :: element(:)  !! Elements of the nodes, one node after the other (n_entries).
    integer, intent(in) :: vertex(:)  !! Vertex of each node, 0 for none (n_nodes).
    integer, intent(inout) :: inner  !! Number of nodes whose elements are in the patch already.
    type(number_set_t), intent(inout) :: patch  !! Nodes of the patch.
    integer :: i, k, p, last, of
    last = patch%n
    do i = inner + 1, last
      of = patch%member(i)
      if (vertex(of) == 0) cycle
      do k = first(of), first(of + 1) - 1
        do p = start(element(k)), start(element(k) + 1) - 1
          call patch%add(node(p))
        end do
      end do
    end do
    inner = last
  end subroutine add_ring

  !> Take the positions of the nodes of the patch, and find its axes.
  subroutine recovery_patch_fill(self, dim, x, axes)
    class(recovery_patch_t), intent(inout) :: self
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    real(dp), intent(in), contiguous :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    real(dp), intent(out) :: axes(dim, dim)  !! Axes of the patch, as rows (dim, dim) [1/length].
    self%n_blocks = (self%nodes%n + lanes - 1)/lanes
    if (allocated(self%t)) then
      if (size(self%root_weight, 2) < self%n_blocks) deallocate (self%t, self%root_weight)
    end if
    if (.not. allocated(self%t)) then
      allocate (self%t(lanes, dim, 2*self%n_blocks), self%root_weight(lanes, 2*self%n_blocks))
    end if
    call gather(self%nodes%n, dim, self%n_blocks, self%nodes%member, x, self%t)
    call own_axes(dim, self%n_blocks, self%t, axes)
    call to_axes(self%nodes%n, dim, self%n_blocks, axes, self%t, self%root_weight)
  end subroutine recovery_patch_fill

  !> Vectors at the nodes of a patch relative to that of the first node; zeros fill the last block.
  pure subroutine gather(n, dim, n_blocks, node, of_nodes, relative)
    integer, intent(in) :: n  !! Number of nodes of the patch.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n_blocks  !! Number of blocks.
    integer, intent(in) :: node(n)  !! Nodes of the patch (n).
    real(dp), intent(in) :: of_nodes(dim, *)  !! Vectors at the nodes of the body (dim, *) [length].
    real(dp), intent(out) :: relative(lanes, dim, n_blocks)  !! Relative vectors (lanes, dim, n_blocks) [length].
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

  !> Principal axes of a patch, scaled so that the mean squares of its nodes' coordinates are equal.
  subroutine own_axes(dim, n_blocks, x, axes)
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n_blocks  !! Number of blocks.
    real(dp), intent(in) :: x(lanes, dim, n_blocks)  !! Nodes relative to the vertex (lanes, dim, n_blocks) [length].
    real(dp), intent(out) :: axes(dim, dim)  !! Axes as rows (dim, dim) [1/length].
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
      ! Elements have volume: only rounding makes a patch flatter than epsilon.
      axes(k, :) = vectors(:, k)/(sqrt(max(moment(k, k), epsilon(largest)**2))*sqrt(largest))
    end do
  end subroutine own_axes

  !> Eigenvalues and eigenvectors of a small symmetric matrix by Jacobi rotations: fewer operations than a call of
  !> LAPACK, always in the same order.
  pure subroutine diagonalize(n, a, vectors)
    integer, intent(in) :: n  !! Order of the matrix.
    real(dp), intent(inout) :: a(n, n)  !! The matrix; its eigenvalues on the diagonal on return (n, n) [any].
    real(dp), intent(out) :: vectors(n, n)  !! Eigenvectors as columns (n, n) [].
    integer, parameter :: sweeps = 12  !! Largest number of sweeps; three or four are enough.
    !> Entries below this fraction of the diagonal are zero: the square of t must not overflow.
    real(dp), parameter :: negligible = 1.0e-100_dp
    !> Off-diagonal entries below this fraction of the diagonal do not change it.
    real(dp), parameter :: converged = 0.1_dp*epsilon(1.0_dp)
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
          if (.not. abs(a(i, k)) > negligible*size_of_diagonal) cycle
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
      if (t <= converged*size_of_diagonal) exit
    end do
  end subroutine diagonalize

  !> Transform the nodes to axes in which none is farther from the vertex than 1, and weight them.
  pure subroutine to_axes(n, dim, n_blocks, axes, t, root_weight)
    integer, intent(in) :: n  !! Number of nodes of the patch.
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n_blocks  !! Number of blocks.
    real(dp), intent(inout) :: axes(dim, dim)  !! Axes of the patch, scaled on return (dim, dim) [1/length].
    real(dp), intent(inout) :: t(lanes, dim, n_blocks)  !! Positions from the vertex [length], scaled on return [].
    real(dp), intent(out) :: root_weight(lanes, n_blocks)  !! Square roots of the weights (lanes, n_blocks) [].
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
      ! Weights: distant nodes of one-sided patches would dominate the fit.
      root_weight(:, b) = 1/(weight_floor + scale**2*root_weight(:, b))
    end do
    do i = lanes, lanes - (lanes*n_blocks - n) + 1, -1
      root_weight(i, n_blocks) = 0
    end do
  end subroutine to_axes

  !> List the monomials.
  subroutine monomials_init(self, dimension, degree)
    class(monomials_t), intent(out) :: self
    integer, intent(in) :: dimension  !! Number of variables, 2 or 3.
    integer, intent(in) :: degree  !! Degree, at least 1.
    integer :: k, i, e(dimension)
    self%dimension = dimension
    self%degree = degree
    self%n = number_up_to(dimension, degree)
    self%n_lower = number_up_to(dimension, degree - 1)
    call list_exponents(dimension, degree, self%exponent)
    allocate (self%parent(self%n), self%axis(self%n), source=0)
    do k = 2, self%n
      e = self%exponent(:, k)
      i = findloc(e > 0, .true., dim=1)
      e(i) = e(i) - 1
      self%parent(k) = position_of(self%exponent(:, :k - 1), e)
      self%axis(k) = i
    end do
    allocate (self%derivative(dimension, self%n))
    do k = 1, self%n
      do i = 1, dimension
        e = self%exponent(:, k)
        e(i) = e(i) - 1
        self%derivative(i, k) = position_of(self%exponent(:, :self%n_lower), e)
      end do
    end do
  end subroutine monomials_init

  !> Number of the monomials up to a degree.
  pure integer function monomials_up_to(self, degree) result(n)
    class(monomials_t), intent(in) :: self
    integer, intent(in) :: degree  !! Degree, at most that of the list.
    n = number_up_to(self%dimension, degree)
  end function monomials_up_to

  !> Number of monomials up to a degree.
  pure integer function number_up_to(dimension, degree) result(n)
    integer, intent(in) :: dimension  !! Number of variables, 2 or 3.
    integer, intent(in) :: degree  !! Degree.
    n = (degree + 1)*(degree + 2)/2
    if (dimension == 3) n = n*(degree + 3)/3
  end function number_up_to

  !> Position of exponents in a list, 0 where they are not in it.
  pure integer function position_of(list, exponent) result(place)
    integer, intent(in) :: list(:, :)  !! Exponents of monomials (dimension, n).
    integer, intent(in) :: exponent(:)  !! The exponents searched for (dimension).
    do place = size(list, 2), 1, -1
      if (all(list(:, place) == exponent)) return
    end do
  end function position_of

  !> Exponents of all monomials up to a degree, lower degrees first.
  pure subroutine list_exponents(dimension, degree, exponent)
    integer, intent(in) :: dimension  !! Number of variables, 2 or 3.
    integer, intent(in) :: degree  !! Degree.
    integer, allocatable, intent(out) :: exponent(:, :)  !! Exponents (dimension, n).
    integer :: total, i, j, n
    allocate (exponent(dimension, number_up_to(dimension, degree)))
    n = 0
    do total = 0, degree
      do i = total, 0, -1
        if (dimension == 2) then
          n = n + 1
          exponent(:, n) = [i, total - i]
        else
          do j = total - i, 0, -1
            n = n + 1
            exponent(:, n) = [i, j, total - i - j]
          end do
        end if
      end do
    end do
  end subroutine list_exponents

  !> Values of monomials at nodes, times the square roots of the nodes' weights.
  pure subroutine evaluate_monomials(dim, n, n_blocks, parent, axis, t, root_weight, power)
    integer, intent(in) :: dim  !! Number of variables.
    integer, intent(in) :: n  !! Number of monomials.
    integer, intent(in) :: n_blocks  !! Number of blocks of `lanes` nodes.
    integer, intent(in) :: parent(n)  !! Earlier monomial of each product, see `monomials_t` (n).
    integer, intent(in) :: axis(n)  !! Variable of each product, see `monomials_t` (n).
    real(dp), intent(in) :: t(lanes, dim, n_blocks)  !! Scaled positions of the nodes (lanes, dim, n_blocks) [].
    real(dp), intent(in) :: root_weight(lanes, n_blocks)  !! Square roots of the weights (lanes, n_blocks) [].
    real(dp), intent(out) :: power(lanes, n_blocks, n)  !! Values (lanes, n_blocks, n) [].
    integer :: b, k
    power(:, :, 1) = root_weight
    do k = 2, n
      do b = 1, n_blocks
        power(:, b, k) = power(:, b, parent(k))*t(:, axis(k), b)
      end do
    end do
  end subroutine evaluate_monomials
end module dotyk_elasticity_recovery_patch
