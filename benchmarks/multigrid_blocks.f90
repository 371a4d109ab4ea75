!> Blocks of quadratic elements for the benchmark of p-multigrid.
module multigrid_blocks
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_3d
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: held
  use dotyk_mesh_element, only: element_kind, element_kind_t, reference_nodes, shape_functions
  implicit none
  private
  public :: make_block, move_corners, hold_side, thin_layer

contains

  !> A block [0, 1] x [0, 1] x [0, n3/n1] of equal cells, held at z = 0, loaded on top; material of Poisson's ratio 0.3.
  subroutine make_block(kind, n1, n3, body)
    integer, intent(in) :: kind  !! Element kind: tet10, hex20, hex27, prism15 or prism18, or a linear one.
    integer, intent(in) :: n1  !! Cells along x and y.
    integer, intent(in) :: n3  !! Cells along z.
    type(body_t), intent(out) :: body  !! The block.
    type(element_kind_t) :: properties
    type(error_t), allocatable :: error
    real(dp), allocatable :: xi(:, :), corner(:, :, :), linear(:)
    integer, allocatable :: number(:, :, :), local(:, :, :)
    integer :: i, j, k, a, p, e, n, place(3)
    properties = element_kind(kind)
    call split_cell(properties, corner)
    allocate (xi(3, properties%n_nodes), linear(properties%n_corners), local(3, properties%n_nodes, size(corner, 3)))
    call reference_nodes(kind, xi)
    do p = 1, size(corner, 3)
      do a = 1, properties%n_nodes
        call shape_functions(properties%corner_kind, xi(:, a), linear)
        local(:, a, p) = nint(2*matmul(corner(:, :, p), linear))
      end do
    end do
    body%name = 'block'
    body%mesh%file = 'block'
    body%mesh%dimension = 3
    allocate (body%mesh%block(1))
    allocate (number(0:2*n1, 0:2*n1, 0:2*n3), source=0)
    body%mesh%block(1)%kind = kind
    allocate (body%mesh%block(1)%node(properties%n_nodes, n1*n1*n3*size(corner, 3)))
    n = 0
    e = 0
    do k = 0, n3 - 1
      do j = 0, n1 - 1
        do i = 0, n1 - 1
          do p = 1, size(corner, 3)
            e = e + 1
            do a = 1, properties%n_nodes
              place = 2*[i, j, k] + local(:, a, p)
              associate (node => number(place(1), place(2), place(3)))
                if (node == 0) then
                  n = n + 1
                  node = n
                end if
                body%mesh%block(1)%node(a, e) = node
              end associate
            end do
          end do
        end do
      end do
    end do
    body%mesh%block(1)%tag = [(int(a, int64), a=1, e)]
    body%mesh%node_tag = [(int(a, int64), a=1, n)]
    allocate (body%mesh%x(3, n), body%load(3, n), source=0.0_dp)
    call body%constraint%init(3, n)
    do k = 0, 2*n3
      do j = 0, 2*n1
        do i = 0, 2*n1
          a = number(i, j, k)
          if (a == 0) cycle
          body%mesh%x(:, a) = real([i, j, k], dp)/(2*n1)
          if (k == 0) body%constraint%equation(:, a) = held
          if (k == 2*n3) body%load(:, a) = [0.3_dp, 0.0_dp, -1.0_dp]
        end do
      end do
    end do
    call body%constraint%number_equations()
    body%dimension = 3
    body%analysis = analysis_3d
    allocate (body%material(1))
    call body%material(1)%init_isotropic('steel', 2.0e11_dp, 0.3_dp, error)
  end subroutine make_block

  !> Divide a unit cell into elements.
  subroutine split_cell(properties, corner)
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    real(dp), allocatable, intent(out) :: corner(:, :, :)  !! Corners of the elements (3, n_corners, n_pieces) [].
    integer, parameter :: order(3, 6) = reshape([1, 2, 3, 2, 3, 1, 3, 1, 2, 1, 3, 2, 3, 2, 1, 2, 1, 3], [3, 6])
    real(dp), allocatable :: xi(:, :)
    integer :: i, k
    if (properties%n_corners == 8) then
      allocate (corner(3, 8, 1), xi(3, 8))
      call reference_nodes(properties%corner_kind, xi)
      corner(:, :, 1) = 0.5_dp*(xi + 1)
      return
    end if
    if (properties%n_corners == 6) then
      allocate (corner(3, 6, 2), xi(3, 6))
      call reference_nodes(properties%corner_kind, xi)
      xi(3, :) = 0.5_dp*(xi(3, :) + 1)
      corner(:, :, 1) = xi
      corner(1:2, :, 2) = 1 - xi(1:2, :)
      corner(3, :, 2) = xi(3, :)
      return
    end if
    allocate (corner(3, 4, 6), source=0.0_dp)
    do i = 1, 6
      do k = 1, 3
        corner(:, k + 1, i) = corner(:, k, i)
        corner(order(k, i), k + 1, i) = 1
      end do
      if (i > 3) corner(:, 2:3, i) = corner(:, [3, 2], i)
    end do
  end subroutine split_cell

  !> Displace the inner corners, and put the other nodes where straight elements have them.
  subroutine move_corners(body, n1, n3, every, shift, irregular)
    type(body_t), intent(inout) :: body  !! The block.
    integer, intent(in) :: n1  !! Cells along x and y.
    integer, intent(in) :: n3  !! Cells along z.
    integer, intent(in) :: every  !! One inner corner out of so many is displaced.
    real(dp), intent(in) :: shift(3)  !! Displacement, in cells (3) [].
    logical, intent(in) :: irregular  !! Whether the displacements change from corner to corner.
    type(element_kind_t) :: properties
    real(dp), allocatable :: xi(:, :), shape(:, :)
    integer :: i, e, a, place(3), count
    count = 0
    do i = 1, body%mesh%n_nodes()
      place = nint(2*n1*body%mesh%x(:, i))
      if (any(mod(place, 2) /= 0) .or. any(place == 0) .or. any(place == 2*[n1, n1, n3])) cycle
      count = count + 1
      if (mod(count, every) /= 0) cycle
      if (irregular) then
        body%mesh%x(:, i) = body%mesh%x(:, i) + shift/n1*sin(12.9898_dp*i + 78.233_dp*[1, 2, 3])
      else
        body%mesh%x(:, i) = body%mesh%x(:, i) + shift/n1
      end if
    end do
    properties = element_kind(body%mesh%block(1)%kind)
    allocate (xi(3, properties%n_nodes), shape(properties%n_corners, properties%n_nodes))
    call reference_nodes(body%mesh%block(1)%kind, xi)
    do a = 1, properties%n_nodes
      call shape_functions(properties%corner_kind, xi(:, a), shape(:, a))
    end do
    do e = 1, body%mesh%n_elements()
      associate (node => body%mesh%block(1)%node(:, e))
        do a = properties%n_corners + 1, properties%n_nodes
          body%mesh%x(:, node(a)) = matmul(body%mesh%x(:, node(:properties%n_corners)), shape(:, a))
        end do
      end associate
    end do
  end subroutine move_corners

  !> Hold the side x = 0 in place of z = 0.
  subroutine hold_side(body)
    type(body_t), intent(inout) :: body  !! The block.
    integer :: i
    do i = 1, body%mesh%n_nodes()
      body%constraint%equation(:, i) = merge(1, held, body%mesh%x(1, i) > 0)
    end do
    call body%constraint%number_equations()
  end subroutine hold_side

  !> Make the layer of cells in the middle thinner.
  subroutine thin_layer(body, n, ratio)
    type(body_t), intent(inout) :: body  !! The block.
    integer, intent(in) :: n  !! Cells along its edges.
    integer, intent(in) :: ratio  !! Ratio of the thicknesses.
    real(dp) :: bottom, height
    integer :: i
    bottom = real(n/2, dp)/n
    do i = 1, body%mesh%n_nodes()
      height = body%mesh%x(3, i) - bottom
      if (height > 0) body%mesh%x(3, i) = bottom + min(height, 1.0_dp/n)/ratio + max(0.0_dp, height - 1.0_dp/n)
    end do
  end subroutine thin_layer
end module multigrid_blocks
