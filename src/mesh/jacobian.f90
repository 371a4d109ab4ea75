!> The sign of the jacobian determinant of elements, and their mirror images.
module dotyk_mesh_jacobian
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_hex8, element_kind, element_kind_t, element_prism6, element_quad4, &
    kind_dimension, kind_nodes, max_element_nodes, quadrature_rule, reference_nodes, shape_gradients
  implicit none
  private
  public :: jacobian_range, mirror_order

  !> So few elements are not worth a team of threads.
  integer, parameter :: few = 1000

  !> A determinant smaller than this times the element's diameter**dimension counts as zero.
  real(dp), parameter :: vanishing = 1.0e-14_dp
  !> Elements whose nodes are this near to the affine image, relative to the diameter, have one jacobian.
  real(dp), parameter :: almost_affine = 1.0e-9_dp

contains

  !> The least and the largest jacobian determinant of each element, over the quadrature points and nodes.
  !>
  !> One point does for elements that are affine images of the reference domain.
  subroutine jacobian_range(kind, n, node, d, n_nodes, x, least, most)
    !> Element kind.
    integer, intent(in) :: kind
    !> Number of elements.
    integer, intent(in) :: n
    !> Their nodes.
    integer, intent(in) :: node(kind_nodes(kind), n)
    !> Dimension of space and of the kind.
    integer, intent(in) :: d
    !> Number of nodes.
    integer, intent(in) :: n_nodes
    !> Coordinates [length].
    real(dp), intent(in) :: x(d, n_nodes)
    !> Range of the determinant; exactly 0 where it is as good as zero [length**d].
    real(dp), intent(out) :: least(n), most(n)
    type(element_kind_t) :: info
    real(dp), allocatable :: gradient(:, :, :), affine(:, :)
    real(dp) :: xe(3, max_element_nodes), det, diameter
    integer :: e, p, m, nn, nc, base(4)
    info = element_kind(kind)
    nn = info%n_nodes
    nc = info%n_corners
    call sample(info, kind, gradient, base, affine)
    !$omp parallel do default(none) schedule(static) if (n > few) private(e, p, m, xe, det, diameter) &
    !$omp shared(n, nn, nc, d, node, x, least, most, gradient, affine, base)
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
      if (is_affine(nn, xe, base, affine, almost_affine*diameter)) m = 1
      least(e) = huge(det)
      most(e) = -huge(det)
      do p = 1, m
        det = determinant(d, nn, xe, gradient(:, :, p))
        if (abs(det) <= vanishing*diameter**d) det = 0
        least(e) = min(least(e), det)
        most(e) = max(most(e), det)
      end do
    end do
    !$omp end parallel do
  end subroutine jacobian_range

  !> Gradients where the determinant is sampled, and the affine image of the reference domain.
  subroutine sample(info, kind, gradient, base, affine)
    type(element_kind_t), intent(in) :: info
    integer, intent(in) :: kind
    !> Gradients (3, n_nodes, n_points), 0 beyond the dimension: at quadrature points, then at nodes.
    real(dp), allocatable, intent(out) :: gradient(:, :, :)
    !> The corners that span the affine image; the last is 1 in two dimensions.
    integer, intent(out) :: base(4)
    !> Weights of these corners for the place of each node (4, n_nodes).
    real(dp), allocatable, intent(out) :: affine(:, :)
    real(dp), allocatable :: points(:, :), weights(:)
    real(dp) :: nodes(info%dimension, info%n_nodes)
    integer :: i, m, d
    d = info%dimension
    call quadrature_rule(kind, 2*info%order, points, weights)
    call reference_nodes(kind, nodes)
    m = size(weights)
    allocate (gradient(3, info%n_nodes, m + info%n_nodes), affine(4, info%n_nodes))
    gradient = 0
    do i = 1, m
      call gradients_at(points(:, i), gradient(:d, :, i))
    end do
    do i = 1, info%n_nodes
      call gradients_at(nodes(:, i), gradient(:d, :, m + i))
    end do
    ! Coordinates from 0 to 1 along the edges from corner 1.
    affine = 0
    affine(2:d + 1, :) = nodes
    select case (info%corner_kind)
    case (element_quad4, element_hex8)
      base = [1, 2, 4, 5]
      affine(2:d + 1, :) = 0.5_dp*(1 + nodes)
    case (element_prism6)
      base = [1, 2, 3, 4]
      affine(4, :) = 0.5_dp*(1 + nodes(3, :))
    case default
      base = [1, 2, 3, 4]
    end select
    if (d == 2) base(4) = 1
    affine(1, :) = 1 - sum(affine(2:, :), dim=1)

  contains

    subroutine gradients_at(xi, values)
      real(dp), intent(in) :: xi(:)
      real(dp), intent(out) :: values(:, :)
      real(dp) :: found(info%dimension, info%n_nodes)
      call shape_gradients(kind, xi, found)
      values = found
    end subroutine gradients_at
  end subroutine sample

  !> Whether all nodes are where an affine map of the reference domain has them.
  pure logical function is_affine(nn, xe, base, affine, tolerance)
    integer, intent(in) :: nn, base(4)
    real(dp), intent(in) :: xe(3, nn), affine(4, nn), tolerance
    real(dp) :: corner(3, 4), off(3)
    integer :: i, k
    is_affine = .false.
    do k = 1, 4
      corner(:, k) = xe(:, base(k))
    end do
    do i = 1, nn
      off = -xe(:, i)
      do k = 1, 4
        off = off + affine(k, i)*corner(:, k)
      end do
      if (any(abs(off) > tolerance)) return
    end do
    is_affine = .true.
  end function is_affine

  !> Determinant of the derivatives of the position.
  pure real(dp) function determinant(d, nn, xe, gradient) result(det)
    integer, intent(in) :: d, nn
    !> Coordinates and gradients; their third components are 0 in two dimensions.
    real(dp), intent(in) :: xe(3, nn), gradient(3, nn)
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

  !> The order of the nodes of an element's mirror image: node i of the image is node order(i).
  !>
  !> Every reference domain of two or three dimensions is symmetric in its first two variables: nodes that their
  !> exchange carries into one another are exchanged.
  pure function mirror_order(kind) result(order)
    !> Element kind, not a line.
    integer, intent(in) :: kind
    integer :: order(kind_nodes(kind))
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
