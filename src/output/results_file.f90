!> The results file (docs/results.md): layout, meshes and fields of `/VTKHDF` for VTK and ParaView, one partition per
!> body, and `/dotyk`. One thread writes body after body. The file is written under a temporary name and renamed by
!> `commit`: complete or absent; an older one stays until then. All errors have the exit code `exit_not_written`.
module dotyk_output_results_file
  use, intrinsic :: iso_fortran_env, only: int32, int8
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_base_operating_system, only: remove_file
  use dotyk_base_options, only: field_contact, field_displacement, field_error, field_nodal_stress, field_reaction, &
    field_stress
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_output_file_system, only: replace_file, temporary_name
  use dotyk_output_hdf5, only: hdf5_file_t, hdf5_int32, hdf5_int64, hdf5_real, hdf5_uint8, with_three_components
  implicit none
  private
  public :: connectivity_length, contact_group

  !> A results file being written. Groups are relative to `/dotyk`, or to that of a load case: '', 'summary', 'timing',
  !> 'history', contact_group(name). The first failure is reported by `commit`.
  type, extends(hdf5_file_t), public :: results_file_t
    character(:), allocatable :: path  !! Path of the finished file.
    character(:), allocatable :: temporary  !! Its path until it is finished.
    integer(int64), allocatable :: first_point(:)  !! Points before each part (n_parts + 1).
    integer(int64), allocatable :: first_cell(:)  !! Cells before each part (n_parts + 1).
    integer(int64), allocatable :: first_id(:)  !! Connectivity entries before each part (n_parts + 1).
    integer :: n_steps = 0  !! Steps of time for VTK, the load cases; 0: none.
    integer :: step = 1  !! The step that is written.
  contains
    procedure :: begin => results_begin
    procedure :: write_part => results_write_part
    procedure, private :: write_reals, write_integers, write_vectors
    !> write_field(part, name, values): a field of the nodes or elements of one body, 'PointData/...' or
    !> 'CellData/...': reals or integers (n), vectors (2 or 3, n) or tensors (6, n); it is 0 where it is not written.
    generic :: write_field => write_reals, write_integers, write_vectors
    procedure :: raise => results_raise
    procedure :: discard => results_discard
    procedure :: begin_case => results_begin_case
    procedure :: end_cases => results_end_cases
    procedure :: commit => results_commit
  end type results_file_t

  type :: cells_t  !! Cells of one part, in the order of the blocks of its body.
    integer(int64), allocatable :: connectivity(:)  !! Nodes of the cells, from 0, in VTK's order (n_connectivity).
    integer(int64), allocatable :: offset(:)  !! Offsets of cells in `connectivity`, from 0, and the end (n_cells + 1).
    integer(int8), allocatable :: vtk_type(:)  !! Cell types of VTK (n_cells).
    integer(int64), allocatable :: tag(:)  !! Element tags of the mesh file (n_cells).
    integer(int32), allocatable :: material(:)  !! Numbers of their materials (n_cells).
  end type cells_t

contains

  !> Group of a contact pair below `/dotyk`.
  pure function contact_group(name) result(group)
    character(*), intent(in) :: name  !! Name of the contact pair.
    character(:), allocatable :: group
    integer :: i
    group = trim(name)
    ! '/' separates groups, and '.' is the group itself.
    do i = 1, len(group)
      if (group(i:i) == '/') group(i:i) = '_'
    end do
    if (group == '.') group = '_'
    group = 'contact/'//group
  end function contact_group

  !> What follows is of a load case.
  subroutine results_begin_case(self, step, name)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: step  !! Number of the case.
    character(*), intent(in) :: name  !! Its name.
    self%step = step
    self%root = '/dotyk/cases/'//name
    call self%add_group('')
    call create_result_groups(self)
    call self%put_attribute('', 'step', step)
  end subroutine results_begin_case

  !> What follows is of all load cases.
  subroutine results_end_cases(self, names, n_written, n_cases)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: names  !! Names of the cases that were written, separated by line feeds.
    integer, intent(in) :: n_written  !! Their number.
    integer, intent(in) :: n_cases  !! Number of those of the scene: more where the run was interrupted.
    self%root = '/dotyk'
    call write_steps(self, n_written)
    call self%put_attribute('cases', 'names', names)
    call self%put_attribute('cases', 'n_missing', n_cases - n_written)
  end subroutine results_end_cases

  !> Finish the file and rename it, in place of an older one; where a write has failed, the file is deleted.
  subroutine results_commit(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call self%close(error)
    if (.not. allocated(error)) call replace_file(self%temporary, self%path, error)
    if (allocated(error)) call self%discard()
  end subroutine results_commit

  !> Create the file with the layout of all parts, under a temporary name.
  subroutine results_begin(self, path, n_points, n_cells, n_connectivity, wanted, n_steps)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: path  !! Path of the file.
    integer(int64), intent(in), contiguous :: n_points(:)  !! Nodes of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_cells(:)  !! Elements of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_connectivity(:)  !! By `connectivity_length` (n_parts).
    logical, intent(in) :: wanted(:)  !! Which fields will be written, by the `field_*` of `dotyk_base_options`.
    integer, intent(in) :: n_steps  !! Steps of time with fields of their own on the same meshes; 0: without time.
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
  end subroutine results_begin

  !> First value of a part in a field.
  pure integer(int64) function first_of(self, part, name) result(first)
    class(results_file_t), intent(in) :: self
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
  subroutine results_write_part(self, part, mesh)
    class(results_file_t), intent(inout) :: self
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
  end subroutine results_write_part

  !> Write numbers of one body.
  subroutine write_reals(self, part, name, values)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: part  !! Index of the body.
    character(*), intent(in) :: name  !! Name of the field.
    real(dp), intent(in), contiguous :: values(:)  !! Values (n) [any].
    call self%put_part('/VTKHDF/'//name, first_of(self, part, name), values)
  end subroutine write_reals

  !> Write integers of one body.
  subroutine write_integers(self, part, name, values)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: part  !! Index of the body.
    character(*), intent(in) :: name  !! Name of the field.
    integer(int32), intent(in), contiguous :: values(:)  !! Values (n).
    call self%put_part('/VTKHDF/'//name, first_of(self, part, name), values)
  end subroutine write_integers

  !> Write vectors or tensors of one body.
  subroutine write_vectors(self, part, name, values)
    class(results_file_t), intent(inout) :: self
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
  subroutine results_raise(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    if (.not. allocated(self%failure)) return
    error = self%failure
    call self%discard()
  end subroutine results_raise

  !> Delete an unfinished file; nothing happens where there is none.
  subroutine results_discard(self)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable :: ignored
    call self%close(ignored)
    if (allocated(self%temporary)) call remove_file(self%temporary)
  end subroutine results_discard

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
    integer, intent(in) :: node(:, :)  !! Nodes of the elements, from 1, in gmsh's order (at least n_nodes, n_cells).
    integer, intent(in) :: vtk_order(n_nodes)  !! Local node of gmsh for each node of VTK (n_nodes).
    integer(int64), intent(in) :: first_node  !! Length of the connectivity of earlier blocks.
    integer(int64), intent(out) :: connectivity(n_nodes, n_cells)  !! Nodes of all cells, counted from 0.
    integer(int64), intent(out) :: last(n_cells)  !! Offsets of the ends of the cells (n_cells).
    integer :: i, j
    do j = 1, n_cells
      do i = 1, n_nodes
        connectivity(i, j) = node(vtk_order(i), j) - 1
      end do
      last(j) = first_node + int(n_nodes, int64)*j
    end do
  end subroutine fill_connectivity

  !> Create the groups and the attributes for VTK.
  subroutine create_groups(file, has_cases)
    class(hdf5_file_t), intent(inout) :: file  !! The results file.
    logical, intent(in) :: has_cases  !! Whether it has load cases: each gets groups of its own when it is written.
    character(*), parameter :: names(*) = [character(20) :: '/VTKHDF', '/VTKHDF/PointData', '/VTKHDF/CellData', &
                                           '/dotyk', '/dotyk/timing']
    integer :: i
    do i = 1, size(names)
      call file%add_group(trim(names(i)))
    end do
    if (has_cases) then
      call file%add_group('/dotyk/cases')
    else
      call create_result_groups(file)
    end if
    call file%put_attribute('/VTKHDF', 'Version', [2_int64, 0_int64])
    call file%put_attribute('/VTKHDF', 'Type', 'UnstructuredGrid')
  end subroutine create_groups

  !> Create the groups of the results, those of a load case or of a file without any.
  subroutine create_result_groups(file)
    class(hdf5_file_t), intent(inout) :: file  !! The results file; they are in its `root`.
    character(*), parameter :: names(*) = [character(8) :: 'summary', 'history', 'contact', 'bodies', 'supports', &
                                           'loads']
    integer :: i
    do i = 1, size(names)
      call file%add_group(trim(names(i)))
    end do
  end subroutine create_result_groups

  !> Write what VTK needs to know of the steps of time, where each begins in the datasets: meshes and tags are those of
  !> the first one.
  subroutine write_steps(file, n_steps)
    class(results_file_t), intent(inout) :: file  !! The results file, with all fields.
    integer, intent(in) :: n_steps  !! Number of steps.
    character(*), parameter :: constant(*) = [character(30) :: 'PartOffsets', 'PointOffsets', 'CellOffsets', &
                                              'ConnectivityIdOffsets', 'PointDataOffsets/node_tag', &
                                              'CellDataOffsets/body', 'CellDataOffsets/material', &
                                              'CellDataOffsets/element_tag']
    integer(int64) :: step(n_steps)
    integer :: i, n_parts
    n_parts = size(file%first_point) - 1
    step = [(int(i - 1, int64), i=1, n_steps)]
    call file%add_group('/VTKHDF/Steps')
    call file%add_group('/VTKHDF/Steps/PointDataOffsets')
    call file%add_group('/VTKHDF/Steps/CellDataOffsets')
    call file%put_attribute('/VTKHDF/Steps', 'NSteps', int(n_steps, int64))
    call file%put_array('/VTKHDF/Steps', 'Values', real(step + 1, dp))
    call file%put_array('/VTKHDF/Steps', 'NumberOfParts', [(int(n_parts, int64), i=1, n_steps)])
    do i = 1, size(constant)
      call file%put_array('/VTKHDF/Steps', trim(constant(i)), 0*step)
    end do
    call put_offsets('PointData', file%first_point(n_parts + 1)*step)
    call put_offsets('CellData', file%first_cell(n_parts + 1)*step)

  contains

    !> Offsets of all fields of nodes or elements, but for those that are the same in all steps.
    subroutine put_offsets(place, offset)
      character(*), intent(in) :: place  !! Their group.
      integer(int64), intent(in), contiguous :: offset(:)  !! First value of each step (n_steps).
      character(:), allocatable :: group, name
      integer :: k
      group = '/VTKHDF/Steps/'//place//'Offsets'
      do k = 1, file%n_members('/VTKHDF/'//place)
        name = file%member('/VTKHDF/'//place, k)
        if (.not. file%has(group//'/'//name)) call file%put_array(group, name, offset)
      end do
    end subroutine put_offsets
  end subroutine write_steps

  !> Create the datasets of the geometry.
  subroutine create_geometry(file, n_points, n_cells, n_connectivity)
    class(hdf5_file_t), intent(inout) :: file  !! The results file.
    integer(int64), intent(in), contiguous :: n_points(:)  !! Nodes of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_cells(:)  !! Elements of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_connectivity(:)  !! Nodes of all elements of each body (n_parts).
    integer(int64) :: points, cells, ids
    integer :: n_parts
    n_parts = size(n_points)
    points = sum(n_points)
    cells = sum(n_cells)
    ids = sum(n_connectivity)
    call file%put_array('/VTKHDF', 'NumberOfPoints', n_points)
    call file%put_array('/VTKHDF', 'NumberOfCells', n_cells)
    call file%put_array('/VTKHDF', 'NumberOfConnectivityIds', n_connectivity)
    call file%new_dataset('/VTKHDF/Points', hdf5_real, [3_int64, points])
    call file%new_dataset('/VTKHDF/Connectivity', hdf5_int64, [ids])
    ! One more than the cells of each part: every part has its beginning and its end.
    call file%new_dataset('/VTKHDF/Offsets', hdf5_int64, [cells + n_parts])
    call file%new_dataset('/VTKHDF/Types', hdf5_uint8, [cells])
    call file%new_dataset('/VTKHDF/PointData/node_tag', hdf5_int64, [points])
    call file%new_dataset('/VTKHDF/CellData/body', hdf5_int32, [cells])
    call file%new_dataset('/VTKHDF/CellData/material', hdf5_int32, [cells])
    call file%new_dataset('/VTKHDF/CellData/element_tag', hdf5_int64, [cells])
  end subroutine create_geometry

  !> Create the datasets of the fields; parts that are not written are zero.
  subroutine create_fields(file, points, cells, wanted)
    class(hdf5_file_t), intent(inout) :: file  !! The results file.
    integer(int64), intent(in) :: points, cells  !! Numbers of nodes and elements of all bodies.
    logical, intent(in) :: wanted(:)  !! Which fields will be written, by the `field_*` of `dotyk_base_options`.
    call add(field_displacement, 'PointData/displacement', 3)
    call add(field_contact, 'PointData/contact_pressure', 1)
    call add(field_contact, 'PointData/penetration', 1)
    call add(field_contact, 'PointData/contact_traction', 3)
    call add(field_contact, 'PointData/contact_gap', 1)
    call add(field_contact, 'PointData/contact_status', 1, hdf5_int32)
    call add(field_reaction, 'PointData/reaction_force', 3)
    call add(field_nodal_stress, 'PointData/nodal_stress', 6)
    call add(field_nodal_stress, 'PointData/nodal_von_mises', 1)
    call add(field_nodal_stress, 'PointData/nodal_principal_stress', 3)
    call add(field_stress, 'CellData/stress', 6)
    call add(field_stress, 'CellData/von_mises', 1)
    call add(field_error, 'CellData/discretization_error', 1)

  contains

    !> Create one, where it is wanted.
    subroutine add(field, name, width, number_kind)
      integer, intent(in) :: field  !! The field of `&output` that it belongs to.
      character(*), intent(in) :: name  !! Its name below /VTKHDF.
      integer, intent(in) :: width  !! Numbers at each node or element.
      integer, intent(in), optional :: number_kind  !! Kind of its numbers; real if absent.
      integer(int64) :: extent(2)
      integer :: kind
      if (.not. wanted(field)) return
      kind = hdf5_real
      if (present(number_kind)) kind = number_kind
      extent = [int(width, int64), merge(points, cells, index(name, 'PointData') == 1)]
      call file%new_dataset('/VTKHDF/'//name, kind, extent(merge(2, 1, width == 1):), zero=.true.)
    end subroutine add
  end subroutine create_fields
end module dotyk_output_results_file
