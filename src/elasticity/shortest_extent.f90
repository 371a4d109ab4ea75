!> The size of a body that no rotation changes: the shortest edge of the brick with the same second moments of volume.
!>
!> A brick with the edges a >= b >= c has the moments a^2/12, b^2/12, c^2/12 per volume along its axes: the size is c of
!> a brick, the thickness of a plate or a ring, 0.77 diameters of a ball.
module dotyk_elasticity_shortest_extent
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_strain, analysis_3d
  use dotyk_elasticity_shape_table, only: map_element, shape_table_pair_t, shape_table_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: shortest_extent

contains

  !> Shortest edge of the brick with the moments of a body; of the section in plane and axisymmetric analyses; 0 where
  !> its elements have no volume [length].
  real(dp) function shortest_extent(mesh) result(extent)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    if (mesh%is_whole()) then
      call find_extent(mesh, extent)
    else
      extent = mesh%whole%shortest_extent
    end if
  end function shortest_extent

  !> Shortest edge of the brick with the moments of the elements.
  subroutine find_extent(mesh, extent)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(out) :: extent  !! As in `shortest_extent` [length].
    type(error_t), allocatable :: error
    real(dp), dimension(mesh%dimension) :: origin, first, values
    real(dp), dimension(mesh%dimension, mesh%dimension) :: second, axes
    real(dp) :: volume
    integer :: b, k
    volume = 0
    first = 0
    second = 0
    origin = sum(mesh%x, dim=2)/mesh%n_nodes()
    do b = 1, size(mesh%block)
      call add_block(mesh, b, origin, volume, first, second)
    end do
    extent = 0
    if (.not. volume > 0) return
    first = first/volume
    second = second/volume
    do k = 1, mesh%dimension
      second(:, k) = second(:, k) - first*first(k)
    end do
    call symmetric_eigen(second, values, axes, error)
    if (.not. allocated(error)) extent = sqrt(12*max(0.0_dp, values(1)))
  end subroutine find_extent

  !> Add the moments of the elements of one block.
  subroutine add_block(mesh, i_block, origin, volume, first, second)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    real(dp), intent(in) :: origin(:)  !! Point that the moments are about (dimension) [length].
    real(dp), intent(inout) :: volume  !! Volume, added to [volume].
    real(dp), intent(inout) :: first(:)  !! First moments, added to (dimension) [volume length].
    real(dp), intent(inout) :: second(:, :)  !! Second moments, added to (dimension, dimension) [volume length^2].
    type(shape_table_pair_t) :: tables
    real(dp), allocatable :: x(:, :), g(:), w(:)
    integer :: e, n, most_points
    associate (block => mesh%block(i_block), dim => mesh%dimension)
      n = size(block%node, 1)
      call tables%init_load(block%kind, merge(analysis_3d, analysis_plane_strain, dim == 3), .true.)
      most_points = max(tables%straight%n_points, tables%curved%n_points)
      allocate (x(dim, n), g(n*dim*most_points), w(most_points))
      do e = 1, size(block%node, 2)
        x(:, :) = mesh%x(:, block%node(:, e)) - spread(origin, 2, n)
        if (tables%is_curved(x)) then
          call add_element(tables%curved)
        else
          call add_element(tables%straight)
        end if
      end do
    end associate

  contains

    !> Add the moments of the current element; one that is inverted counts nothing.
    subroutine add_element(table)
      type(shape_table_t), intent(in) :: table  !! Shape functions at the points of the rule.
      real(dp) :: worst, position(size(x, 1))
      integer :: q, k
      call map_element(n, size(x, 1), size(x, 1), table%n_points, table%shape, table%gradient, table%weight, x, g, w, &
                       worst)
      if (.not. worst > 0) return
      do q = 1, table%n_points
        position = matmul(x, table%shape(:, q))
        volume = volume + w(q)
        first = first + w(q)*position
        do k = 1, size(position)
          second(:, k) = second(:, k) + w(q)*position(k)*position
        end do
      end do
    end subroutine add_element
  end subroutine add_block
end module dotyk_elasticity_shortest_extent
