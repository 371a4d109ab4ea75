!> Reader of unstructured grids of VTK's XML format (.vtu), which meshio, ParaView and many programs write.
!>
!> Arrays of integers of the cells become volumes and surfaces, one for each of their values: `NAME VALUE`, or `VALUE`
!> where there is one such array, and for `gmsh:physical`. Arrays of integers of the points become surfaces: the outer
!> faces all of whose points have a value other than 0. The rest is as for decks (`dotyk_mesh_inp`).
module dotyk_mesh_vtu
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: quoted, to_text
  use dotyk_mesh_element, only: element_hex8, element_kind, element_kind_t, element_prism15, element_prism18, &
    element_prism6, element_pyramid14, element_quad4, kind_nodes, max_element_nodes, n_element_kinds
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_inp, only: mesh_of_sets
  use dotyk_mesh_inp_part, only: add_member, add_set, max_files
  use dotyk_mesh_inp_state, only: inp_state_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_selection, only: mesh_selection_t
  use dotyk_mesh_tag_map, only: growing_tag_map_t
  use dotyk_mesh_vtu_file, only: vtu_file_t
  implicit none
  private
  public :: read_point_array, read_vtu

  !> Values of an array beyond which it numbers cells or points; names in a remark.
  integer, parameter :: most_values = 1000, most_listed = 8
  !> Cell types of VTK: points, squares and cubes in the order of their coordinates.
  integer, parameter :: vtk_vertex = 1, vtk_poly_vertex = 2, vtk_pixel = 8, vtk_voxel = 11
  !> Nodes of a wedge of VTK whose triangles are turned (18).
  integer, parameter :: turned(18) = [1, 3, 2, 4, 6, 5, 9, 8, 7, 12, 11, 10, 13, 15, 14, 18, 17, 16]
  integer, parameter :: greatest_type = 255  !! Greatest cell type.

contains

  !> Read a file, or a selection of it.
  subroutine read_vtu(file, dimension, mesh, remark, error, selection)
    character(*), intent(in) :: file  !! Path of the file.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(mesh_t), intent(out) :: mesh  !! Mesh.
    character(:), allocatable, intent(out) :: remark  !! Remark for the log; empty where there is none.
    !> Set for files that cannot be read and for mistakes in them, with file and line.
    type(error_t), allocatable, intent(out) :: error
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read; all if absent.
    type(vtu_file_t) :: vtu
    type(inp_state_t) :: state
    remark = ''
    call vtu%read_tags(file, error)
    if (allocated(error)) return
    call state%start
    call state%add_file(file)
    if (.not. allocated(vtu%fault)) call take_points(vtu, state)
    if (.not. allocated(vtu%fault)) call take_cells(vtu, state)
    if (.not. allocated(vtu%fault)) call take_sets(vtu, state)
    if (allocated(vtu%fault)) then
      call set_error(error, vtu%fault)
    else
      call mesh_of_sets(file, state, dimension, mesh, remark, error, selection)
    end if
  end subroutine read_vtu

  !> Read an array of reals of the points, one for each.
  subroutine read_point_array(file, name, value, error)
    character(*), intent(in) :: file  !! Path of the file.
    character(*), intent(in) :: name  !! Name of the array.
    real(dp), allocatable, intent(out) :: value(:)  !! The values, by the tags of the nodes (n_points) [any].
    !> Set for files that cannot be read, without such an array, and for mistakes in it, with file and line.
    type(error_t), allocatable, intent(out) :: error
    type(vtu_file_t) :: vtu
    integer :: a
    call vtu%read_tags(file, error)
    if (allocated(error)) return
    if (.not. allocated(vtu%fault)) then
      if (.not. any([(vtu%array(a)%parent == 'PointData' .and. vtu%array(a)%name == name, a=1, vtu%n_arrays)])) then
        call set_error(error, file//': the points have no array '//quoted(name)//'; they have '//names_of_points(vtu))
        return
      end if
      a = vtu%find('PointData', name)
      if (vtu%array(a)%n_components /= 1) &
        call vtu%fail('array '//quoted(name)//' must have one component', vtu%array(a)%position)
      call vtu%reals(a, int(vtu%n_points, int64), value)
    end if
    if (allocated(vtu%fault)) call set_error(error, vtu%fault)
  end subroutine read_point_array

  !> Names of the arrays of the points, for messages.
  function names_of_points(vtu) result(text)
    type(vtu_file_t), intent(in) :: vtu  !! The file.
    character(:), allocatable :: text
    integer :: a
    text = ''
    do a = 1, vtu%n_arrays
      if (vtu%array(a)%parent /= 'PointData') cycle
      if (len(text) > 0) text = text//', '
      text = text//quoted(vtu%array(a)%name)
    end do
    if (len(text) == 0) text = 'none'
  end function names_of_points

  !> Take the points, numbered from 1.
  subroutine take_points(vtu, state)
    type(vtu_file_t), intent(inout) :: vtu  !! The file; mistakes are kept there.
    type(inp_state_t), intent(inout) :: state  !! The mesh.
    real(dp), allocatable :: x(:)
    integer(int64) :: i
    integer :: a
    a = vtu%find('Points', '')
    if (allocated(vtu%fault)) return
    if (vtu%array(a)%n_components /= 3) then
      call vtu%fail('points need NumberOfComponents="3"', vtu%array(a)%position)
      return
    end if
    call vtu%reals(a, 3_int64*vtu%n_points, x)
    if (allocated(vtu%fault)) return
    associate (part => state%slot(1)%part)
      part%x = reshape(x, [3, vtu%n_points])
      part%n_nodes = vtu%n_points
      part%node_tag = [(i, i=1, vtu%n_points)]
      allocate (part%node_line(vtu%n_points), source=line_of(vtu, a))
    end associate
  end subroutine take_points

  !> Take the cells, numbered from 1; points and empty ones are left out.
  subroutine take_cells(vtu, state)
    type(vtu_file_t), intent(inout) :: vtu  !! The file; mistakes are kept there.
    type(inp_state_t), intent(inout) :: state  !! The mesh.
    integer(int64), allocatable :: type(:), offset(:), connectivity(:)
    integer(int64) :: node(max_element_nodes), first, n, line
    integer :: kind_of(0:greatest_type), order(max_element_nodes, n_element_kinds), a, c, k
    type(element_kind_t) :: properties
    a = vtu%find('Cells', 'types')
    if (.not. allocated(vtu%fault)) call vtu%integers(a, int(vtu%n_cells, int64), type)
    if (allocated(vtu%fault)) return
    line = line_of(vtu, a)
    a = vtu%find('Cells', 'offsets')
    if (.not. allocated(vtu%fault)) call vtu%integers(a, int(vtu%n_cells, int64), offset)
    if (allocated(vtu%fault)) return
    if (offset(1) < 0 .or. any(offset(2:) < offset(:size(offset) - 1)) .or. offset(size(offset)) > huge(0)) then
      call vtu%fail('array ''offsets'': they must ascend', vtu%array(a)%position)
      return
    end if
    a = vtu%find('Cells', 'connectivity')
    if (.not. allocated(vtu%fault)) call vtu%integers(a, offset(size(offset)), connectivity)
    if (allocated(vtu%fault)) return
    node = 1
    kind_of = 0
    do k = 1, n_element_kinds
      properties = element_kind(k)
      order(:, k) = properties%vtk_order
      if (k /= element_pyramid14) kind_of(properties%vtk_type) = k
    end do
    kind_of(vtk_pixel) = element_quad4
    kind_of(vtk_voxel) = element_hex8
    do c = 1, vtu%n_cells
      first = 0
      if (c > 1) first = offset(c - 1)
      n = offset(c) - first
      k = 0
      if (type(c) >= 0 .and. type(c) <= greatest_type) k = kind_of(type(c))
      if (any(type(c) == [0, vtk_vertex, vtk_poly_vertex])) cycle
      if (k == 0) then
        call vtu%fail('cell '//to_text(c - 1)//' has type '//to_text(type(c))//': only lines, triangles, '// &
                      'quadrilaterals, tetrahedra, hexahedra, wedges and pyramids are read, linear and quadratic', &
                      vtu%array(a)%position)
      else if (n /= kind_nodes(k)) then
        properties = element_kind(k)
        call vtu%fail('cell '//to_text(c - 1)//' of type '//to_text(type(c))//' ('//trim(properties%name)//') has '// &
                      to_text(n)//' points', vtu%array(a)%position)
      else if (any(connectivity(first + 1:first + n) < 0 .or. connectivity(first + 1:first + n) >= vtu%n_points)) then
        call vtu%fail('cell '//to_text(c - 1)//' has a point that is not among 0 to '//to_text(vtu%n_points - 1), &
                      vtu%array(a)%position)
      end if
      if (allocated(vtu%fault)) return
      node(:n) = connectivity(first + 1:first + n) + 1
      if (is_turned_wedge(k, state%slot(1)%part%x(:, node(:4)))) node(:n) = node(turned(:n))
      node(order(:n, k)) = node(:n)
      if (any(type(c) == [vtk_pixel, vtk_voxel])) node(:4) = node([1, 2, 4, 3])
      if (type(c) == vtk_voxel) node(5:8) = node([5, 6, 8, 7])
      call state%slot(1)%part%add_element(int(c, int64), k, node(:n), line)
    end do
  end subroutine take_cells

  !> Whether a wedge has its first triangle turned against the order of VTK, whose normal points out of it: many
  !> programs write wedges so, quadratic ones above all.
  pure logical function is_turned_wedge(kind, x)
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: x(3, 4)  !! First four corners (3, 4) [length].
    is_turned_wedge = .false.
    if (all(kind /= [element_prism6, element_prism15, element_prism18])) return
    is_turned_wedge = dot_product(cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1)), x(:, 4) - x(:, 1)) > 0
  end function is_turned_wedge

  !> Take the sets: of cells as sets of elements, of points as sets of nodes.
  subroutine take_sets(vtu, state)
    type(vtu_file_t), intent(inout) :: vtu  !! The file; mistakes are kept there.
    type(inp_state_t), intent(inout) :: state  !! The mesh.
    integer(int64), allocatable :: value(:)
    logical :: of_cells(vtu%n_arrays), of_points(vtu%n_arrays)
    integer :: a, n
    of_cells = [(is_of_sets(vtu, a, 'CellData'), a=1, vtu%n_arrays)]
    of_points = [(is_of_sets(vtu, a, 'PointData'), a=1, vtu%n_arrays)]
    do a = 1, vtu%n_arrays
      if (.not. of_cells(a) .or. allocated(vtu%fault)) cycle
      call vtu%integers(a, int(vtu%n_cells, int64), value)
      if (vtu%array(a)%name == 'vtkGhostType') then
        if (any(value /= 0)) call vtu%fail('the piece has ghost cells: save the mesh as one piece without them', &
                                           vtu%array(a)%position)
        of_cells(a) = .false.
      else
        of_cells(a) = has_few_values(value)
      end if
    end do
    n = 0
    do a = 1, vtu%n_arrays
      if (allocated(vtu%fault)) return
      if (of_cells(a)) then
        call vtu%integers(a, int(vtu%n_cells, int64), value)
        call add_sets(value, name_of(a), .false., state)
        if (vtu%array(a)%name == 'gmsh:geometrical') state%slot(1)%part%entity = &
          int(max(0_int64, min(value(state%slot(1)%part%element_tag(:state%slot(1)%part%n_elements)), &
                               int(huge(0), int64))))
      else if (of_points(a)) then
        call vtu%integers(a, int(vtu%n_points, int64), value)
        of_points(a) = has_few_values(value)
        if (of_points(a)) call add_sets(value, vtu%array(a)%name//' ', .true., state)
      end if
      if (of_cells(a) .or. of_points(a) .or. index(vtu%array(a)%parent, 'Data') == 0) cycle
      n = n + 1
      if (n > most_listed) cycle
      if (n > 1) state%not_read = state%not_read//', '
      state%not_read = state%not_read//vtu%array(a)%name
    end do
    if (n > most_listed) state%not_read = state%not_read//', ...'

  contains

    !> Beginning of the names of sets of cells.
    function name_of(a) result(name)
      integer, intent(in) :: a  !! Index of the array.
      character(:), allocatable :: name
      name = vtu%array(a)%name//' '
      if (count(of_cells) == 1 .or. name == 'gmsh:physical ') name = ''
    end function name_of
  end subroutine take_sets

  !> Whether an array may have sets: integers, one for each point or cell.
  pure logical function is_of_sets(vtu, a, parent)
    type(vtu_file_t), intent(in) :: vtu  !! The file.
    integer, intent(in) :: a  !! Index of the array.
    character(*), intent(in) :: parent  !! Tag that it must have around it.
    is_of_sets = vtu%array(a)%parent == parent .and. vtu%array(a)%n_components == 1 .and. &
                 index(vtu%array(a)%type, 'Int') > 0
  end function is_of_sets

  !> Different values of an array, and which of them each item has.
  subroutine find_values(value, map, which)
    integer(int64), intent(in) :: value(:)  !! The array (n).
    type(growing_tag_map_t), intent(out) :: map  !! The values.
    integer, intent(out) :: which(:)  !! Index among them of each item (n).
    integer :: i
    do i = 1, size(value)
      call map%add(value(i), which(i))
    end do
  end subroutine find_values

  !> Whether an array does not number points or cells.
  logical function has_few_values(value)
    integer(int64), intent(in) :: value(:)  !! The array (n).
    type(growing_tag_map_t) :: map
    integer, allocatable :: which(:)
    allocate (which(size(value)))
    call find_values(value, map, which)
    has_few_values = map%n <= most_values
  end function has_few_values

  !> Add the sets of an array, one for each value.
  subroutine add_sets(value, name, of_nodes, state)
    integer(int64), intent(in) :: value(:)  !! The array (n).
    character(*), intent(in) :: name  !! Beginning of their names.
    logical, intent(in) :: of_nodes  !! Whether they are of nodes: those of value 0 have none then.
    type(inp_state_t), intent(inout) :: state  !! The mesh.
    type(growing_tag_map_t) :: map
    integer, allocatable :: which(:), order(:), set(:)
    character(:), allocatable :: full
    integer :: i, k
    allocate (which(size(value)))
    call find_values(value, map, which)
    allocate (order(map%n), set(map%n))
    call sort_order(real(map%tag(:map%n), dp), order)
    associate (part => state%slot(1)%part)
      do i = 1, map%n
        k = order(i)
        set(k) = 0
        full = name//to_text(map%tag(k))
        if (of_nodes .and. map%tag(k) == 0) cycle
        if (of_nodes) then
          call add_set(part%node_set, part%n_node_sets, full, full, set(k))
        else
          call add_set(part%element_set, part%n_element_sets, full, full, set(k))
        end if
      end do
      do i = 1, size(value)
        k = set(which(i))
        if (k == 0) cycle
        if (of_nodes) then
          call add_member(part%node_set(k), int(i, int64), 0_int64)
        else
          ! Cells that are points have no element.
          call add_member(part%element_set(k), int(i, int64), 0_int64)
        end if
      end do
    end associate
  end subroutine add_sets

  !> Line of an array, as the numbering of decks has it.
  integer(int64) function line_of(vtu, a)
    type(vtu_file_t), intent(inout) :: vtu  !! The file.
    integer, intent(in) :: a  !! Index of the array.
    line_of = max_files*vtu%bytes%line_of(vtu%array(a)%position) + 1
  end function line_of
end module dotyk_mesh_vtu
