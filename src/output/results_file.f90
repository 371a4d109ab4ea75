!> The results file: `/VTKHDF` as VTK and ParaView read it, one partition per body, and `/dotyk`.
!>
!> Written to a temporary name and renamed by `commit`: a results file is whole or absent, and an older one stays until
!> then. Bodies are written one at a time. Every error has the exit code `exit_not_written`. One thread at a time.
module dotyk_output_results_file
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_output_cells, only: cells_of_body, cells_t, connectivity_length
  use dotyk_output_file_system, only: check_writable, delete_file, replace_file, temporary_name
  use dotyk_output_hdf5, only: hdf5_file_t, hdf5_int32, hdf5_int64, hdf5_real, hdf5_uint8
  implicit none
  private

  !> A results file being written.
  type, public :: results_file_t
    !> Where it will be.
    character(:), allocatable :: path
    !> Where it is until `commit`.
    character(:), allocatable :: temporary
    type(hdf5_file_t) :: file
    !> Points, cells and connectivity entries before each part (n_parts + 1).
    integer(int64), allocatable :: first_point(:), first_cell(:), first_id(:)
    !> The first failure of a `put_...`, kept for `commit`.
    type(error_t), allocatable :: failure
  contains
    procedure :: create => results_create
    procedure :: write_part => results_write_part
    procedure :: write_displacement => results_write_displacement
    procedure :: write_contact_pressure => results_write_contact_pressure
    procedure :: write_stress => results_write_stress
    procedure :: write_discretization_error => results_write_discretization_error
    procedure :: add_contact => results_add_contact
    procedure, private :: put_text, put_integer, put_long, put_real, put_logical, put_reals
    !> put_attribute(group, name, value): `group` is relative to `/dotyk`: '', 'summary', 'timing', contact_group(name).
    !> Values: text, integers (32 and 64 bits), real, logical (0 or 1), real vector. A failure is reported by `commit`.
    generic :: put_attribute => put_text, put_integer, put_long, put_real, put_logical, put_reals
    procedure, private :: array_real, array_integer, array_long, array_vectors
    !> put_array(group, name, values): numbers (n), or real vectors (2 or 3, n), stored with three components. `group`
    !> is relative to `/dotyk`: 'history', contact_group(name). A failure is reported by `commit`.
    generic :: put_array => array_real, array_integer, array_long, array_vectors
    procedure :: commit => results_commit
    procedure :: discard => results_discard
    procedure, private :: keep_failure
  end type results_file_t

  public :: check_writable, connectivity_length, contact_group

contains

  !> Create the file with the layout of all parts. Nothing is at `path` until `commit`.
  subroutine results_create(self, path, n_points, n_cells, n_connectivity, want_displacement, want_stress, &
    want_contact, want_error, error)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: path
    !> Nodes, elements and the sum of the nodes of all elements (`connectivity_length`) of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_points(:), n_cells(:), n_connectivity(:)
    !> Which fields will be written.
    logical, intent(in) :: want_displacement, want_stress, want_contact, want_error
    type(error_t), allocatable, intent(out) :: error
    if (allocated(self%failure)) deallocate (self%failure)
    self%path = path
    self%temporary = temporary_name(path)
    self%first_point = running_sum(n_points)
    self%first_cell = running_sum(n_cells)
    self%first_id = running_sum(n_connectivity)
    call self%file%create(self%temporary, error, label=path)
    if (.not. allocated(error)) call create_groups(self%file, error)
    if (.not. allocated(error)) call create_geometry(self, n_points, n_cells, n_connectivity, error)
    if (.not. allocated(error)) call create_fields(self, want_displacement, want_stress, want_contact, want_error, error)
    if (allocated(error)) call self%discard()
  end subroutine results_create

  !> 0, n(1), n(1) + n(2), ...
  pure function running_sum(n) result(total)
    integer(int64), intent(in) :: n(:)
    integer(int64) :: total(size(n) + 1)
    integer :: i
    total(1) = 0
    do i = 1, size(n)
      total(i + 1) = total(i) + n(i)
    end do
  end function running_sum

  !> The groups, and what tells VTK how to read them.
  subroutine create_groups(file, error)
    type(hdf5_file_t), intent(in) :: file
    type(error_t), allocatable, intent(out) :: error
    character(*), parameter :: names(*) = [character(20) :: '/VTKHDF', '/VTKHDF/PointData', '/VTKHDF/CellData', &
      '/dotyk', '/dotyk/summary', '/dotyk/history', '/dotyk/contact', '/dotyk/timing']
    integer :: i
    do i = 1, size(names)
      call file%add_group(trim(names(i)), error)
      if (allocated(error)) return
    end do
    call file%put_attribute('/VTKHDF', 'Version', [2_int64, 0_int64], error)
    if (.not. allocated(error)) call file%put_attribute('/VTKHDF', 'Type', 'UnstructuredGrid', error)
  end subroutine create_groups

  !> The datasets of the geometry.
  subroutine create_geometry(self, n_points, n_cells, n_connectivity, error)
    class(results_file_t), intent(in) :: self
    integer(int64), intent(in), contiguous :: n_points(:), n_cells(:), n_connectivity(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: points, cells, ids
    integer :: n_parts
    n_parts = size(n_points)
    points = self%first_point(n_parts + 1)
    cells = self%first_cell(n_parts + 1)
    ids = self%first_id(n_parts + 1)
    associate (file => self%file)
      call file%put_dataset('/VTKHDF/NumberOfPoints', n_points, error)
      if (.not. allocated(error)) call file%put_dataset('/VTKHDF/NumberOfCells', n_cells, error)
      if (.not. allocated(error)) call file%put_dataset('/VTKHDF/NumberOfConnectivityIds', n_connectivity, error)
      if (.not. allocated(error)) call file%new_dataset('/VTKHDF/Points', hdf5_real, [3_int64, points], error)
      if (.not. allocated(error)) call file%new_dataset('/VTKHDF/Connectivity', hdf5_int64, [ids], error)
      ! One more than the cells of each part: every part has its beginning and its end.
      if (.not. allocated(error)) call file%new_dataset('/VTKHDF/Offsets', hdf5_int64, [cells + n_parts], error)
      if (.not. allocated(error)) call file%new_dataset('/VTKHDF/Types', hdf5_uint8, [cells], error)
      if (.not. allocated(error)) call file%new_dataset('/VTKHDF/PointData/node_tag', hdf5_int64, [points], error)
      if (.not. allocated(error)) call file%new_dataset('/VTKHDF/CellData/body', hdf5_int32, [cells], error)
      if (.not. allocated(error)) call file%new_dataset('/VTKHDF/CellData/element_tag', hdf5_int64, [cells], error)
    end associate
  end subroutine create_geometry

  !> The datasets of the fields that were asked for; parts that are never written are zero.
  subroutine create_fields(self, want_displacement, want_stress, want_contact, want_error, error)
    class(results_file_t), intent(in) :: self
    logical, intent(in) :: want_displacement, want_stress, want_contact, want_error
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: points, cells
    points = self%first_point(size(self%first_point))
    cells = self%first_cell(size(self%first_cell))
    associate (file => self%file)
      if (want_displacement) then
        call file%new_dataset('/VTKHDF/PointData/displacement', hdf5_real, [3_int64, points], error, zero=.true.)
        if (allocated(error)) return
      end if
      if (want_contact) then
        call file%new_dataset('/VTKHDF/PointData/contact_pressure', hdf5_real, [points], error, zero=.true.)
        if (allocated(error)) return
      end if
      if (want_stress) then
        call file%new_dataset('/VTKHDF/CellData/stress', hdf5_real, [6_int64, cells], error, zero=.true.)
        if (allocated(error)) return
        call file%new_dataset('/VTKHDF/CellData/von_mises', hdf5_real, [cells], error, zero=.true.)
        if (allocated(error)) return
      end if
      if (want_error) call file%new_dataset('/VTKHDF/CellData/discretization_error', hdf5_real, [cells], error, zero=.true.)
    end associate
  end subroutine create_fields

  !> Write the geometry of one body.
  subroutine results_write_part(self, part, mesh, error)
    class(results_file_t), intent(in) :: self
    !> Number of the body, from 1.
    integer, intent(in) :: part
    type(body_mesh_t), intent(in) :: mesh
    type(error_t), allocatable, intent(out) :: error
    type(cells_t) :: cells
    integer(int32), allocatable :: body(:)
    integer(int64) :: point, cell, id
    call cells_of_body(mesh, cells)
    allocate (body(size(cells%tag)))
    body = part
    point = self%first_point(part)
    cell = self%first_cell(part)
    id = self%first_id(part)
    associate (file => self%file)
      call file%put_part('/VTKHDF/Points', point, with_three_components(mesh%x), error)
      if (.not. allocated(error)) call file%put_part('/VTKHDF/PointData/node_tag', point, mesh%node_tag, error)
      if (.not. allocated(error)) call file%put_part('/VTKHDF/Connectivity', id, cells%connectivity, error)
      if (.not. allocated(error)) call file%put_part('/VTKHDF/Offsets', cell + part - 1, cells%offset, error)
      if (.not. allocated(error)) call file%put_part('/VTKHDF/Types', cell, cells%vtk_type, error)
      if (.not. allocated(error)) call file%put_part('/VTKHDF/CellData/body', cell, body, error)
      if (.not. allocated(error)) call file%put_part('/VTKHDF/CellData/element_tag', cell, cells%tag, error)
    end associate
  end subroutine results_write_part

  !> Vectors with three components; those of the plane get z = 0.
  pure function with_three_components(x) result(y)
    !> Shape (2 or 3, n).
    real(dp), intent(in) :: x(:, :)
    real(dp), allocatable :: y(:, :)
    integer :: i, dimension
    dimension = min(3, size(x, 1))
    allocate (y(3, size(x, 2)))
    do i = 1, size(x, 2)
      y(:dimension, i) = x(:dimension, i)
      y(dimension + 1:, i) = 0
    end do
  end function with_three_components

  !> Write the displacements of one body.
  subroutine results_write_displacement(self, part, displacement, error)
    class(results_file_t), intent(in) :: self
    integer, intent(in) :: part
    !> At the nodes (dimension, n_nodes) [length].
    real(dp), intent(in), contiguous :: displacement(:, :)
    type(error_t), allocatable, intent(out) :: error
    call self%file%put_part('/VTKHDF/PointData/displacement', self%first_point(part), &
      with_three_components(displacement), error)
  end subroutine results_write_displacement

  !> Write the contact pressure of one body; a body that touches nothing need not be written.
  subroutine results_write_contact_pressure(self, part, pressure, error)
    class(results_file_t), intent(in) :: self
    integer, intent(in) :: part
    !> At the nodes, 0 off the contact surfaces (n_nodes) [pressure].
    real(dp), intent(in), contiguous :: pressure(:)
    type(error_t), allocatable, intent(out) :: error
    call self%file%put_part('/VTKHDF/PointData/contact_pressure', self%first_point(part), pressure, error)
  end subroutine results_write_contact_pressure

  !> Write the stresses of one body.
  subroutine results_write_stress(self, part, stress, von_mises, error)
    class(results_file_t), intent(in) :: self
    integer, intent(in) :: part
    !> Means of the elements, xx yy zz xy yz xz, elements in the order of the blocks (6, n_elements) [pressure].
    real(dp), intent(in), contiguous :: stress(:, :)
    !> Their von Mises stress (n_elements) [pressure].
    real(dp), intent(in), contiguous :: von_mises(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: cell
    cell = self%first_cell(part)
    call self%file%put_part('/VTKHDF/CellData/stress', cell, stress, error)
    if (.not. allocated(error)) call self%file%put_part('/VTKHDF/CellData/von_mises', cell, von_mises, error)
  end subroutine results_write_stress

  !> Write the discretization errors of one body's elements.
  subroutine results_write_discretization_error(self, part, value, error)
    class(results_file_t), intent(in) :: self
    integer, intent(in) :: part
    !> Relative, in the energy norm; elements in the order of the blocks (n_elements) [].
    real(dp), intent(in), contiguous :: value(:)
    type(error_t), allocatable, intent(out) :: error
    call self%file%put_part('/VTKHDF/CellData/discretization_error', self%first_cell(part), value, error)
  end subroutine results_write_discretization_error

  !> Group of a contact, relative to `/dotyk`.
  pure function contact_group(name) result(group)
    !> Name of the contact.
    character(*), intent(in) :: name
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

  !> Add the group of a contact; a failure is reported by `commit`.
  subroutine results_add_contact(self, name)
    class(results_file_t), intent(inout) :: self
    !> Name of the contact.
    character(*), intent(in) :: name
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%add_group(dotyk_path(contact_group(name)), error)
    call self%keep_failure(error)
  end subroutine results_add_contact

  !> Path in the file of a group relative to `/dotyk`.
  pure function dotyk_path(group) result(path)
    character(*), intent(in) :: group
    character(:), allocatable :: path
    path = '/dotyk'
    if (len(group) > 0) path = path//'/'//group
  end function dotyk_path

  subroutine put_text(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name, value
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(group), name, value, error)
    call self%keep_failure(error)
  end subroutine put_text

  subroutine put_integer(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    integer(int32), intent(in) :: value
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(group), name, value, error)
    call self%keep_failure(error)
  end subroutine put_integer

  subroutine put_long(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    integer(int64), intent(in) :: value
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(group), name, value, error)
    call self%keep_failure(error)
  end subroutine put_long

  subroutine put_real(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    real(dp), intent(in) :: value
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(group), name, value, error)
    call self%keep_failure(error)
  end subroutine put_real

  subroutine put_logical(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    logical, intent(in) :: value
    call self%put_integer(group, name, merge(1, 0, value))
  end subroutine put_logical

  subroutine put_reals(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    real(dp), intent(in), contiguous :: value(:)
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(group), name, value, error)
    call self%keep_failure(error)
  end subroutine put_reals

  subroutine array_real(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    real(dp), intent(in), contiguous :: values(:)
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(group)//'/'//name, values, error)
    call self%keep_failure(error)
  end subroutine array_real

  subroutine array_integer(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    integer(int32), intent(in), contiguous :: values(:)
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(group)//'/'//name, values, error)
    call self%keep_failure(error)
  end subroutine array_integer

  subroutine array_long(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    integer(int64), intent(in), contiguous :: values(:)
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(group)//'/'//name, values, error)
    call self%keep_failure(error)
  end subroutine array_long

  subroutine array_vectors(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name
    real(dp), intent(in), contiguous :: values(:, :)
    type(error_t), allocatable :: error
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(group)//'/'//name, with_three_components(values), error)
    call self%keep_failure(error)
  end subroutine array_vectors

  !> Keep the first failure for `commit`.
  subroutine keep_failure(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    if (allocated(error)) call move_alloc(error, self%failure)
  end subroutine keep_failure

  !> Finish the file and give it its name, in place of an older one; where anything failed, nothing of it remains.
  subroutine results_commit(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    if (allocated(self%failure)) then
      call move_alloc(self%failure, error)
    else
      call self%file%close(error)
      if (.not. allocated(error)) call replace_file(self%temporary, self%path, error)
    end if
    if (allocated(error)) call self%discard()
  end subroutine results_commit

  !> Give up: what was written is deleted. Safe to call at any time, also when nothing was created.
  subroutine results_discard(self)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable :: ignored
    call self%file%close(ignored)
    if (allocated(self%temporary)) call delete_file(self%temporary)
  end subroutine results_discard
end module dotyk_output_results_file
