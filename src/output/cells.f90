!> Elements of a body as cells of VTK.
module dotyk_output_cells
  use, intrinsic :: iso_fortran_env, only: int32, int8
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  type, public :: cells_t  !! Cells of one part, in the order of the blocks of its body.
    !> Nodes of all cells, one cell after the other, from 0, in the order of VTK (n_connectivity).
    integer(int64), allocatable :: connectivity(:)
    !> Offsets of the cells in `connectivity`, from 0, and its length (n_cells + 1).
    integer(int64), allocatable :: offset(:)
    integer(int8), allocatable :: vtk_type(:)  !! Cell types of VTK (n_cells).
    integer(int64), allocatable :: tag(:)  !! Element tags of the mesh file (n_cells).
    integer(int32), allocatable :: material(:)  !! Numbers of their materials (n_cells).
  end type cells_t

  public :: cells_of_body, connectivity_length

contains

  !> Sum of the nodes of all cells of a body, of the whole body where this rank holds a part of it.
  pure integer(int64) function connectivity_length(mesh) result(length)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(element_kind_t) :: kind
    integer :: k
    length = 0
    do k = 1, size(mesh%block)
      kind = element_kind(mesh%block(k)%kind)
      length = length + count(kind%vtk_order > 0, kind=int64)*mesh%whole_block_size(k)
    end do
  end function connectivity_length

  !> The cells of a body.
  subroutine cells_of_body(mesh, cells)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body; its blocks tell their materials.
    type(cells_t), intent(out) :: cells  !! Its cells.
    type(element_kind_t) :: kind
    integer(int64) :: first_node, node_count
    integer(int64) :: n_ids
    integer :: k, m, n, first, cell_count
    cell_count = 0
    do k = 1, size(mesh%block)
      cell_count = cell_count + size(mesh%block(k)%node, 2)
    end do
    node_count = connectivity_length(mesh)
    allocate (cells%connectivity(node_count), cells%offset(cell_count + 1))
    allocate (cells%vtk_type(cell_count), cells%tag(cell_count), cells%material(cell_count))
    cells%offset(1) = 0
    first = 0
    first_node = 0
    do k = 1, size(mesh%block)
      kind = element_kind(mesh%block(k)%kind)
      n = size(mesh%block(k)%node, 2)
      cells%vtk_type(first + 1:first + n) = int(kind%vtk_type, int8)
      cells%tag(first + 1:first + n) = mesh%block(k)%tag
      cells%material(first + 1:first + n) = mesh%block(k)%material
      m = count(kind%vtk_order > 0)
      n_ids = m*int(n, int64)
      call fill_connectivity(m, n, mesh%block(k)%node, kind%vtk_order(:m), first_node, &
                             cells%connectivity(first_node + 1:first_node + n_ids), &
                             cells%offset(first + 2:first + n + 1))
      first = first + n
      first_node = first_node + n_ids
    end do
  end subroutine cells_of_body

  !> Connectivity of the cells of one block.
  pure subroutine fill_connectivity(n_nodes, n_cells, node, vtk_order, first_node, connectivity, last)
    integer, intent(in) :: n_nodes  !! Nodes per cell.
    integer, intent(in) :: n_cells  !! Number of elements.
    !> Nodes of the elements, from 1, in the order of gmsh (at least n_nodes, n_cells).
    integer, intent(in) :: node(:, :)
    integer, intent(in) :: vtk_order(n_nodes)  !! Local node of gmsh for each node of VTK (n_nodes).
    integer(int64), intent(in) :: first_node  !! Length of the connectivity of earlier blocks.
    !> Nodes of all cells, counted from 0 (n_nodes, n_cells).
    integer(int64), intent(out) :: connectivity(n_nodes, n_cells)
    integer(int64), intent(out) :: last(n_cells)  !! Offsets of the ends of the cells (n_cells).
    integer :: i, j
    do j = 1, n_cells
      do i = 1, n_nodes
        connectivity(i, j) = node(vtk_order(i), j) - 1
      end do
      last(j) = first_node + int(n_nodes, int64)*j
    end do
  end subroutine fill_connectivity
end module dotyk_output_cells
