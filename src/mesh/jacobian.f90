!> Jacobian determinants of elements, whose sign tells inverted and degenerate elements, and mirror images of elements.
module dotyk_mesh_jacobian
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_hex8, element_kind, element_kind_t, element_prism6, element_pyramid5, &
    element_quad4, kind_dimension, kind_nodes, max_element_nodes, quadrature_rule, reference_nodes, shape_gradients
  implicit none
  private
  public :: jacobian_range, mirror_order

  integer, parameter :: min_parallel = 1000  !! Loops over fewer elements are faster on one thread.

  !> A determinant below this fraction of diameter**dimension of the element counts as zero.
  real(dp), parameter :: zero_determinant = 1.0e-14_dp
  !> An element is affine, with one Jacobian determinant, where its nodes deviate from the affine image of the reference
  !> domain by less than this fraction of its diameter.
  real(dp), parameter :: affine_tolerance = 1.0e-9_dp

contains

  !> Smallest and largest Jacobian determinant of each element, over the quadrature points and nodes.
  !>
  !> For elements that are affine images of the reference domain one point suffices.
  subroutine jacobian_range(kind, n, node, d, n_nodes, x, smallest, largest)
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: n  !! Number of elements.
    integer, intent(in) :: node(kind_nodes(kind), n)  !! Nodes of the elements (kind_nodes(kind), n).
    integer, intent(in) :: d  !! Dimension of space and of the kind.
    integer, intent(in) :: n_nodes  !! Number of nodes.
    real(dp), intent(in) :: x(d, n_nodes)  !! Nodal coordinates (d, n_nodes) [length].
    real(dp), intent(out) :: smallest(n)  !! Smallest determinant; 0 where it is round-off (n) [length^d].
    real(dp), intent(out) :: largest(n)  !! Largest determinant, likewise (n) [length^d].
    type(element_kind_t) :: info
    real(dp), allocatable :: gradient(:, :, :), barycentric(:, :)
    real(dp) :: xe(3, max_element_nodes), det, diameter
    integer :: e, p, m, nn, nc, base(4)
    info = element_kind(kind)
    nn = info%n_nodes
    nc = info%n_corners
    call sampling(info, kind, gradient, base, barycentric)
    !$omp parallel do default(none) schedule(static) if (n > min_parallel) private(e, p, m, xe, det, diameter) &
    !$omp shared(n, nn, nc, d, node, x, smallest, largest, gradient, barycentric, base)
    do e = 1, n
      xe(3, :nn) = 0
      do p = 1, nn
        xe(:d, p) = x(:, node(p, e))
      end do
      diameter = 0
      do p = 2, nc
        diameter = max(diameter, sum((xe(:, p) - xe(:, 1))**2))
      end do
      diameter = sqrt(diameter)
      m = size(gradient, 3)
      if (is_affine(nn, xe, base, barycentric, affine_tolerance*diameter)) m = 1
      smallest(e) = huge(det)
      largest(e) = -huge(det)
      do p = 1, m
        det = determinant(d, nn, xe, gradient(:, :, p))
        if (abs(det) <= zero_determinant*diameter**d) det = 0
        smallest(e) = min(smallest(e), det)
        largest(e) = max(largest(e), det)
      end do
    end do
    !$omp end parallel do
  end subroutine jacobian_range

  !> Gradients at the points where the determinant is evaluated, and the affine image of the reference domain.
  subroutine sampling(info, kind, gradient, base, barycentric)
    type(element_kind_t), intent(in) :: info  !! Properties of the element kind.
    integer, intent(in) :: kind  !! Element kind.
    !> Gradients at quadrature points, then at nodes, 0 beyond the dimension (3, n_nodes, n_points) [].
    real(dp), allocatable, intent(out) :: gradient(:, :, :)
    integer, intent(out) :: base(4)  !! Corners that span the affine image (4); the last is 1 in two dimensions.
    !> Weights of these corners in the position of each node (4, n_nodes) [].
    real(dp), allocatable, intent(out) :: barycentric(:, :)
    real(dp), allocatable :: points(:, :), weights(:)
    real(dp) :: nodes(info%dimension, info%n_nodes)
    integer :: i, m, d
    d = info%dimension
    call quadrature_rule(kind, 2*info%order, points, weights)
    call reference_nodes(kind, nodes)
    m = size(weights)
    allocate (gradient(3, info%n_nodes, m + info%n_nodes), barycentric(4, info%n_nodes))
    gradient = 0
    do i = 1, m
      call gradients_at(points(:, i), gradient(:d, :, i))
    end do
    do i = 1, info%n_nodes
      call gradients_at(nodes(:, i), gradient(:d, :, m + i))
    end do
    ! Coordinates from 0 to 1 along the edges from corner 1.
    barycentric = 0
    barycentric(2:d + 1, :) = nodes
    select case (info%corner_kind)
    case (element_quad4, element_hex8)
      base = [1, 2, 4, 5]
      barycentric(2:d + 1, :) = 0.5_dp*(1 + nodes)
    case (element_prism6)
      base = [1, 2, 3, 4]
      barycentric(4, :) = 0.5_dp*(1 + nodes(3, :))
    case (element_pyramid5)
      base = [1, 2, 4, 5]
      barycentric(2, :) = 0.5_dp*(1 + nodes(1, :) - nodes(3, :))
      barycentric(3, :) = 0.5_dp*(1 + nodes(2, :) - nodes(3, :))
    case default
      base = [1, 2, 3, 4]
    end select
    if (d == 2) base(4) = 1
    barycentric(1, :) = 1 - sum(barycentric(2:, :), dim=1)

  contains

    !> Gradients of the shape functions at a point.
    subroutine gradients_at(xi, values)
      real(dp), intent(in) :: xi(:)  !! Reference coordinates (dimension) [].
      real(dp), intent(out) :: values(:, :)  !! Gradients (dimension, n_nodes) [].
      real(dp) :: found(info%dimension, info%n_nodes)
      call shape_gradients(kind, xi, found)
      values = found
    end subroutine gradients_at
  end subroutine sampling

  !> Whether all nodes are at their positions under an affine map of the reference domain.
  pure logical function is_affine(nn, xe, base, barycentric, tolerance)
    integer, intent(in) :: nn  !! Number of nodes.
    integer, intent(in) :: base(4)  !! Corners that span the affine image (4).
    real(dp), intent(in) :: xe(3, nn)  !! Nodal coordinates (3, nn) [length].
    real(dp), intent(in) :: barycentric(4, nn)  !! Weights of these corners (4, nn) [].
    real(dp), intent(in) :: tolerance  !! Greatest deviation [length].
    real(dp) :: corner(3, 4), deviation(3)
    integer :: i, k
    is_affine = .false.
    do k = 1, 4
      corner(:, k) = xe(:, base(k))
    end do
    do i = 1, nn
      deviation = -xe(:, i)
      do k = 1, 4
        deviation = deviation + barycentric(k, i)*corner(:, k)
      end do
      if (any(abs(deviation) > tolerance)) return
    end do
    is_affine = .true.
  end function is_affine

  !> Jacobian determinant [length^d].
  pure real(dp) function determinant(d, nn, xe, gradient) result(det)
    integer, intent(in) :: d  !! Dimension.
    integer, intent(in) :: nn  !! Number of nodes.
    real(dp), intent(in) :: xe(3, nn)  !! Nodal coordinates, the third 0 in two dimensions (3, nn) [length].
    real(dp), intent(in) :: gradient(3, nn)  !! Gradients of the shape functions, likewise (3, nn) [].
    real(dp) :: a(3), b(3), c(3)
    integer :: i
    a = 0
    b = 0
    c = 0
    do i = 1, nn
      a = a + xe(:, i)*gradient(1, i)
      b = b + xe(:, i)*gradient(2, i)
      c = c + xe(:, i)*gradient(3, i)
    end do
    if (d == 2) c(3) = 1
    det = a(1)*(b(2)*c(3) - b(3)*c(2)) + a(2)*(b(3)*c(1) - b(1)*c(3)) + a(3)*(b(1)*c(2) - b(2)*c(1))
  end function determinant

  !> Node order of the mirror image of an element: node i of the image is node order(i).
  !>
  !> Every reference domain of two or three dimensions is symmetric in its first two coordinates: nodes that swap under
  !> the exchange of these coordinates are exchanged.
  pure function mirror_order(kind) result(order)
    integer, intent(in) :: kind  !! Element kind, not a line.
    integer :: order(kind_nodes(kind))  !! Permutation (n_nodes).
    real(dp) :: nodes(kind_dimension(kind), kind_nodes(kind)), image(kind_dimension(kind))
    integer :: i, j
    call reference_nodes(kind, nodes)
    order = 0
    do i = 1, size(order)
      image = nodes(:, i)
      image(:2) = nodes([2, 1], i)
      do j = 1, size(order)
        if (all(abs(nodes(:, j) - image) < 0.1_dp)) order(i) = j
      end do
    end do
  end function mirror_order
end module dotyk_mesh_jacobian
