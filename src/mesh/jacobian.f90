!> The sign of the jacobian determinant of elements, and their mirror images.
module dotyk_mesh_jacobian
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_tet4, element_tri3, kind_dimension, kind_nodes, &
    max_element_nodes, quadrature_rule, reference_nodes, shape_functions, shape_gradients
  implicit none
  private
  public :: jacobian_range, mirror_order

  !> A determinant smaller than this times the element's diameter**dimension counts as zero.
  real(dp), parameter :: vanishing = 1.0e-14_dp
  !> Middle nodes of simplices that are this near to the middle of their edge, relative to the diameter, are straight.
  real(dp), parameter :: straight = 1.0e-12_dp

contains

  !> The least and the largest jacobian determinant of each element, over the quadrature points and nodes.
  !>
  !> One point does for straight simplices.
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
    real(dp), allocatable :: gradient(:, :, :), middle(:, :)
    real(dp) :: xe(d, max_element_nodes), det, diameter
    logical :: simplex
    integer :: e, p, m, nn, nc
    info = element_kind(kind)
    nn = info%n_nodes
    nc = info%n_corners
    simplex = info%corner_kind == element_tri3 .or. info%corner_kind == element_tet4
    call sample(info, kind, gradient, middle)
    !$omp parallel do default(none) schedule(static) private(e, p, m, xe, det, diameter) &
    !$omp shared(n, nn, nc, d, node, x, least, most, gradient, middle, simplex)
    do e = 1, n
      xe(:, :nn) = x(:, node(:, e))
      diameter = maxval([(norm2(xe(:, p) - xe(:, 1)), p=2, nc)])
      m = size(gradient, 3)
      if (simplex) then
        if (is_straight(d, nn, nc, xe, middle, straight*diameter)) m = 1
      end if
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

  !> Gradients where the determinant is sampled, and the corner functions at the other nodes.
  subroutine sample(info, kind, gradient, middle)
    type(element_kind_t), intent(in) :: info
    integer, intent(in) :: kind
    !> Gradients (dimension, n_nodes, n_points): quadrature points, then nodes.
    real(dp), allocatable, intent(out) :: gradient(:, :, :)
    !> Linear functions of the corners at the nodes that are none (n_corners, n_nodes - n_corners).
    real(dp), allocatable, intent(out) :: middle(:, :)
    real(dp), allocatable :: points(:, :), weights(:)
    real(dp) :: nodes(info%dimension, info%n_nodes)
    integer :: i, m
    call quadrature_rule(kind, 2*info%order, points, weights)
    call reference_nodes(kind, nodes)
    m = size(weights)
    allocate (gradient(info%dimension, info%n_nodes, m + info%n_nodes))
    do i = 1, m
      call shape_gradients(kind, points(:, i), gradient(:, :, i))
    end do
    do i = 1, info%n_nodes
      call shape_gradients(kind, nodes(:, i), gradient(:, :, m + i))
    end do
    allocate (middle(info%n_corners, info%n_corners + 1:info%n_nodes))
    do i = info%n_corners + 1, info%n_nodes
      call shape_functions(info%corner_kind, nodes(:, i), middle(:, i))
    end do
  end subroutine sample

  !> Whether all nodes are where the linear functions of the corners have them.
  pure logical function is_straight(d, nn, nc, xe, middle, tolerance)
    integer, intent(in) :: d, nn, nc
    real(dp), intent(in) :: xe(d, nn), middle(nc, nc + 1:nn), tolerance
    integer :: i, k
    is_straight = .true.
    do i = nc + 1, nn
      do k = 1, d
        is_straight = is_straight .and. abs(dot_product(xe(k, :nc), middle(:, i)) - xe(k, i)) <= tolerance
      end do
    end do
  end function is_straight

  !> Determinant of the derivatives of the position.
  pure real(dp) function determinant(d, nn, xe, gradient) result(det)
    integer, intent(in) :: d, nn
    real(dp), intent(in) :: xe(d, nn), gradient(d, nn)
    real(dp) :: a(3, 3)
    integer :: i, k
    a = 0
    do i = 1, nn
      do k = 1, d
        a(:d, k) = a(:d, k) + xe(:, i)*gradient(k, i)
      end do
    end do
    if (d == 2) then
      det = a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1)
    else
      det = a(1, 1)*(a(2, 2)*a(3, 3) - a(2, 3)*a(3, 2)) - a(1, 2)*(a(2, 1)*a(3, 3) - a(2, 3)*a(3, 1)) &
        + a(1, 3)*(a(2, 1)*a(3, 2) - a(2, 2)*a(3, 1))
    end if
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
