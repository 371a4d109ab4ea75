!> The fields of a results file (docs/results.md): `/VTKHDF` for VTK and ParaView, one partition per body. It is written
!> under a temporary name until the results file is complete. One thread writes body after body. All errors have the
!> exit code `exit_not_written`.
module dotyk_output_fields_file
  use, intrinsic :: iso_fortran_env, only: int32, int8
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_base_operating_system, only: remove_file
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_output_file_system, only: temporary_name
  use dotyk_output_hdf5, only: hdf5_file_t, with_three_components
  use dotyk_output_results_layout, only: create_fields, create_geometry, create_groups, create_steps
  implicit none
  private

  type :: cells_t  !! Cells of one part, in the order of the blocks of its body.
    !> Nodes of all cells, one cell after the other, from 0, in the order of VTK (n_connectivity).
    integer(int64), allocatable :: connectivity(:)
    !> Offsets of the cells in `connectivity`, from 0, and its length (n_cells + 1).
    integer(int64), allocatable :: offset(:)
    integer(int8), allocatable :: vtk_type(:)  !! Cell types of VTK (n_cells).
    integer(int64), allocatable :: tag(:)  !! Element tags of the mesh file (n_cells).
    integer(int32), allocatable :: material(:)  !! Numbers of their materials (n_cells).
  end type cells_t

  type, public, extends(hdf5_file_t) :: fields_file_t  !! Meshes and fields being written.
    character(:), allocatable :: path  !! Path of the finished file.
    character(:), allocatable :: temporary  !! Its path until it is finished.
    integer(int64), allocatable :: first_point(:)  !! Points before each part (n_parts + 1).
    integer(int64), allocatable :: first_cell(:)  !! Cells before each part (n_parts + 1).
    integer(int64), allocatable :: first_id(:)  !! Connectivity entries before each part (n_parts + 1).
    integer :: n_steps = 0  !! Steps of time for VTK, the load cases; 0: none.
    integer :: step = 1  !! The step that is written.
  contains
    procedure :: begin => fields_begin
    procedure :: finish_steps => fields_finish_steps
    procedure :: write_part => fields_write_part
    procedure, private :: write_reals, write_integers, write_vectors
    !> write_field(part, name, values): a field of the nodes or elements of one body, 'PointData/...' or
    !> 'CellData/...': reals or integers (n), vectors (2 or 3, n) or tensors (6, n); it is 0 where it is not written.
    generic :: write_field => write_reals, write_integers, write_vectors
    procedure :: raise => fields_raise
    procedure :: discard => fields_discard
  end type fields_file_t

  public :: connectivity_length

contains

  !> Create the file with the layout of all parts, under a temporary name.
  subroutine fields_begin(self, path, n_points, n_cells, n_connectivity, wanted, n_steps)
    class(fields_file_t), intent(inout) :: self
    character(*), intent(in) :: path  !! Path of the file.
    integer(int64), intent(in), contiguous :: n_points(:)  !! Nodes of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_cells(:)  !! Elements of each body (n_parts).
    !> Sum of the nodes of all cells of each body, of `connectivity_length` (n_parts).
    integer(int64), intent(in), contiguous :: n_connectivity(:)
    logical, intent(in) :: wanted(:)  !! Which fields will be written, by the `field_*` of `dotyk_base_options`.
    !> Steps of time, all with fields of their own on the same meshes; 0: fields without time.
    integer, intent(in) :: n_steps
    self%path = path
    self%temporary = temporary_name(path)
    self%root = '/dotyk'
    self%n_steps = n_steps
    self%step = 1
    self%first_point = running_sum(n_points)
    self%first_cell = running_sum(n_cells)
    self%first_id = running_sum(n_connectivity)
    call self%create(self%temporary, label=path)
    call create_groups(self, n_steps > 0)
    call create_geometry(self, n_points, n_cells, n_connectivity)
    call create_fields(self, max(1, n_steps)*sum(n_points), max(1, n_steps)*sum(n_cells), wanted)
  end subroutine fields_begin

  !> Write what VTK needs to know of the steps of time: meshes and tags are those of the first one.
  subroutine fields_finish_steps(self, n_written)
    class(fields_file_t), intent(inout) :: self
    integer, intent(in) :: n_written  !! Steps that were written.
    associate (n_parts => size(self%first_point) - 1)
      call create_steps(self, n_written, n_parts, self%first_point(n_parts + 1), self%first_cell(n_parts + 1))
    end associate
  end subroutine fields_finish_steps

  !> First value of a part in a field.
  pure integer(int64) function first_of(self, part, name) result(first)
    class(fields_file_t), intent(in) :: self
    integer, intent(in) :: part  !! Index of the body.
    character(*), intent(in) :: name  !! 'PointData/...' or 'CellData/...'.
    if (index(name, 'PointData') == 1) then
      first = (self%step - 1)*self%first_point(size(self%first_point)) + self%first_point(part)
    else
      first = (self%step - 1)*self%first_cell(size(self%first_cell)) + self%first_cell(part)
    end if
  end function first_of

  !> Offsets of parts: 0, n(1), n(1) + n(2), ...
  pure function running_sum(n) result(total)
    integer(int64), intent(in) :: n(:)  !! Numbers (n_parts).
    integer(int64) :: total(size(n) + 1)
    integer :: i
    total(1) = 0
    do i = 1, size(n)
      total(i + 1) = total(i) + n(i)
    end do
  end function running_sum

  !> Write the geometry of one body.
  subroutine fields_write_part(self, part, mesh)
    class(fields_file_t), intent(inout) :: self
    integer, intent(in) :: part  !! Index of the body.
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body; its blocks tell their materials, by numbers in the file.
    type(cells_t) :: cells
    call cells_of_body(mesh, cells)
    associate (point => self%first_point(part), cell => self%first_cell(part))
      call self%put_part('/VTKHDF/Points', point, with_three_components(mesh%x))
      call self%put_part('/VTKHDF/PointData/node_tag', point, mesh%node_tag)
      call self%put_part('/VTKHDF/Connectivity', self%first_id(part), cells%connectivity)
      call self%put_part('/VTKHDF/Offsets', cell + part - 1, cells%offset)
      call self%put_part('/VTKHDF/Types', cell, cells%vtk_type)
      call self%put_part('/VTKHDF/CellData/body', cell, 0*cells%material + part)
      call self%put_part('/VTKHDF/CellData/material', cell, cells%material)
      call self%put_part('/VTKHDF/CellData/element_tag', cell, cells%tag)
    end associate
  end subroutine fields_write_part

  !> Write numbers of one body.
  subroutine write_reals(self, part, name, values)
    class(fields_file_t), intent(inout) :: self
    integer, intent(in) :: part  !! Index of the body.
    character(*), intent(in) :: name  !! Name of the field.
    real(dp), intent(in), contiguous :: values(:)  !! Values (n) [any].
    call self%put_part('/VTKHDF/'//name, first_of(self, part, name), values)
  end subroutine write_reals

  !> Write integers of one body.
  subroutine write_integers(self, part, name, values)
    class(fields_file_t), intent(inout) :: self
    integer, intent(in) :: part  !! Index of the body.
    character(*), intent(in) :: name  !! Name of the field.
    integer(int32), intent(in), contiguous :: values(:)  !! Values (n).
    call self%put_part('/VTKHDF/'//name, first_of(self, part, name), values)
  end subroutine write_integers

  !> Write vectors or tensors of one body.
  subroutine write_vectors(self, part, name, values)
    class(fields_file_t), intent(inout) :: self
    integer, intent(in) :: part  !! Index of the body.
    character(*), intent(in) :: name  !! Name of the field.
    real(dp), intent(in), contiguous :: values(:, :)  !! Values (2, 3 or 6, n) [any].
    if (size(values, 1) > 3) then
      call self%put_part('/VTKHDF/'//name, first_of(self, part, name), values)
    else
      call self%put_part('/VTKHDF/'//name, first_of(self, part, name), with_three_components(values))
    end if
  end subroutine write_vectors

  !> Where a write has failed, say so, and delete the file.
  subroutine fields_raise(self, error)
    class(fields_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    if (.not. allocated(self%failure)) return
    error = self%failure
    call self%discard()
  end subroutine fields_raise

  !> Delete an unfinished file; nothing happens where there is none.
  subroutine fields_discard(self)
    class(fields_file_t), intent(inout) :: self
    type(error_t), allocatable :: ignored
    call self%close(ignored)
    if (allocated(self%temporary)) call remove_file(self%temporary)
  end subroutine fields_discard

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
end module dotyk_output_fields_file
