!> Ordering of elements along a Morton (Z-order) curve, on which consecutive elements are near each other in space.
!>
!> Mesh generators number elements and nodes with little regard to locality; assembly in their order is bound by
!> memory latency. The sort is a radix sort of the keys, ten bits at a time: linear in the number of elements.
module dotyk_mesh_element_ordering
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: morton_order

  integer, parameter :: bits = 10  !! Bits of the curve per axis: 30 bits of three axes fit in a default integer.

contains

  !> Sort elements by the position of their first node on the curve; equal positions keep their order.
  pure subroutine morton_order(dim, x, node, order)
    integer, intent(in) :: dim  !! Number of coordinates, 2 or 3.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: node(:, :)  !! Nodes of the elements (n, n_elements).
    integer, intent(out) :: order(size(node, 2))  !! Index of the k-th element (n_elements).
    integer, allocatable :: key(:), other(:)
    integer :: start(0:2**bits), low_bits, pass, i, k, d, e
    real(dp) :: low(dim), extent
    do d = 1, dim
      low(d) = minval(x(d, :))
    end do
    extent = 0
    do d = 1, dim
      extent = max(extent, maxval(x(d, :)) - low(d))
    end do
    allocate (key(size(node, 2)), other(size(node, 2)))
    call morton_keys(dim, x, node, low, extent, key)
    order = [(e, e=1, size(order))]
    ! Radix sort: counting sorts by `bits` bits at a time, lowest first.
    do pass = 1, dim
      low_bits = bits*(pass - 1)
      start = 0
      do e = 1, size(order)
        k = ibits(key(e), low_bits, bits)
        start(k + 1) = start(k + 1) + 1
      end do
      start(0) = 1
      do k = 1, 2**bits
        start(k) = start(k) + start(k - 1)
      end do
      other = order
      do i = 1, size(order)
        k = ibits(key(other(i)), low_bits, bits)
        order(start(k)) = other(i)
        start(k) = start(k) + 1
      end do
    end do
  end subroutine morton_order

  !> Positions of elements on the curve through a box.
  pure subroutine morton_keys(dim, x, node, low, extent, key)
    integer, intent(in) :: dim  !! Number of coordinates, 2 or 3.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: node(:, :)  !! Nodes of the elements; the first one has the position (n, n_elements).
    real(dp), intent(in) :: low(dim)  !! Lower corner of the box (dim) [length].
    real(dp), intent(in) :: extent  !! Longest edge of the box [length].
    integer, intent(out) :: key(:)  !! Position of each element, dim*bits bits (n_elements).
    integer :: spread_bits(0:2**bits - 1), i, k, d, e
    real(dp) :: scale
    scale = extent
    if (scale > 0) scale = (2**bits - 1)/scale
    do i = 0, 2**bits - 1
      spread_bits(i) = 0
      do k = 0, bits - 1
        spread_bits(i) = ior(spread_bits(i), ishft(ibits(i, k, 1), dim*k))
      end do
    end do
    do e = 1, size(node, 2)
      key(e) = 0
      do d = 1, dim
        k = max(0, min(2**bits - 1, int((x(d, node(1, e)) - low(d))*scale)))
        key(e) = ior(key(e), ishft(spread_bits(k), d - 1))
      end do
    end do
  end subroutine morton_keys
end module dotyk_mesh_element_ordering
