!> Layout of the results file: groups, attributes and datasets, before any body is written.
module dotyk_output_results_layout
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: field_contact, field_displacement, field_error, field_nodal_stress, field_reaction, &
    field_stress
  use dotyk_output_hdf5, only: hdf5_file_t, hdf5_int32, hdf5_int64, hdf5_real, hdf5_uint8
  implicit none
  private
  public :: create_groups, create_geometry, create_fields, create_result_groups, create_steps

contains

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

  !> Create the group of the steps of time, for VTK: where each step begins in the datasets.
  subroutine create_steps(file, n_steps, n_parts, points, cells)
    class(hdf5_file_t), intent(inout) :: file  !! The results file, with all fields.
    integer, intent(in) :: n_steps  !! Number of steps.
    integer, intent(in) :: n_parts  !! Number of bodies.
    integer(int64), intent(in) :: points  !! Number of nodes of all bodies.
    integer(int64), intent(in) :: cells  !! Number of elements of all bodies.
    character(*), parameter :: constant(*) = [character(30) :: 'PartOffsets', 'PointOffsets', 'CellOffsets', &
                                              'ConnectivityIdOffsets', 'PointDataOffsets/node_tag', &
                                              'CellDataOffsets/body', 'CellDataOffsets/material', &
                                              'CellDataOffsets/element_tag']
    integer(int64) :: step(n_steps)
    integer :: i
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
    call put_offsets('PointData', points*step)
    call put_offsets('CellData', cells*step)

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
  end subroutine create_steps

  !> Create the datasets of the geometry.
  subroutine create_geometry(file, n_points, n_cells, n_connectivity)
    class(hdf5_file_t), intent(inout) :: file  !! The results file.
    integer(int64), intent(in), contiguous :: n_points(:)  !! Nodes of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_cells(:)  !! Elements of each body (n_parts).
    !> Sum of the nodes of all elements of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_connectivity(:)
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
end module dotyk_output_results_layout
