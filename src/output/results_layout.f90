!> Layout of the results file: groups, attributes and datasets, before any body is written.
module dotyk_output_results_layout
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_output_hdf5, only: hdf5_file_t, hdf5_int32, hdf5_int64, hdf5_real, hdf5_uint8
  implicit none
  private
  public :: create_groups, create_geometry, create_fields, create_result_groups, create_steps, with_three_components

contains

  !> Create the groups and the attributes for VTK.
  subroutine create_groups(file, has_cases, error)
    type(hdf5_file_t), intent(in) :: file  !! The results file.
    logical, intent(in) :: has_cases  !! Whether it has load cases: each gets groups of its own when it is written.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    character(*), parameter :: names(*) = [character(20) :: '/VTKHDF', '/VTKHDF/PointData', '/VTKHDF/CellData', &
                                           '/dotyk', '/dotyk/timing']
    integer :: i
    do i = 1, size(names)
      call file%add_group(trim(names(i)), error)
      if (allocated(error)) return
    end do
    if (has_cases) then
      call file%add_group('/dotyk/cases', error)
    else
      call create_result_groups(file, '/dotyk', error)
    end if
    if (allocated(error)) return
    call file%put_attribute('/VTKHDF', 'Version', [2_int64, 0_int64], error)
    if (.not. allocated(error)) call file%put_attribute('/VTKHDF', 'Type', 'UnstructuredGrid', error)
  end subroutine create_groups

  !> Create the groups of the results, those of a load case or of a file without any.
  subroutine create_result_groups(file, root, error)
    type(hdf5_file_t), intent(in) :: file  !! The results file.
    character(*), intent(in) :: root  !! Group that they are in.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    character(*), parameter :: names(*) = [character(8) :: 'summary', 'history', 'contact', 'bodies', 'supports', &
                                           'loads']
    integer :: i
    do i = 1, size(names)
      call file%add_group(root//'/'//trim(names(i)), error)
      if (allocated(error)) return
    end do
  end subroutine create_result_groups

  !> Create the group of the steps of time, for VTK: where each step begins in the datasets.
  subroutine create_steps(file, n_steps, n_parts, points, cells, error)
    type(hdf5_file_t), intent(in) :: file  !! The results file, with all fields.
    integer, intent(in) :: n_steps  !! Number of steps.
    integer, intent(in) :: n_parts  !! Number of bodies.
    integer(int64), intent(in) :: points  !! Number of nodes of all bodies.
    integer(int64), intent(in) :: cells  !! Number of elements of all bodies.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    character(*), parameter :: constant(*) = [character(30) :: 'PartOffsets', 'PointOffsets', 'CellOffsets', &
                                              'ConnectivityIdOffsets', 'PointDataOffsets/node_tag', &
                                              'CellDataOffsets/body', 'CellDataOffsets/material', &
                                              'CellDataOffsets/element_tag']
    integer(int64) :: step(n_steps)
    integer :: i
    step = [(int(i - 1, int64), i=1, n_steps)]
    call file%add_group('/VTKHDF/Steps', error)
    if (.not. allocated(error)) call file%add_group('/VTKHDF/Steps/PointDataOffsets', error)
    if (.not. allocated(error)) call file%add_group('/VTKHDF/Steps/CellDataOffsets', error)
    if (.not. allocated(error)) call file%put_attribute('/VTKHDF/Steps', 'NSteps', int(n_steps, int64), error)
    if (.not. allocated(error)) call file%put_dataset('/VTKHDF/Steps/Values', real(step + 1, dp), error)
    if (.not. allocated(error)) &
      call file%put_dataset('/VTKHDF/Steps/NumberOfParts', [(int(n_parts, int64), i=1, n_steps)], error)
    if (allocated(error)) return
    do i = 1, size(constant)
      call file%put_dataset('/VTKHDF/Steps/'//trim(constant(i)), 0*step, error)
      if (allocated(error)) return
    end do
    call put_offsets('PointData', points*step)
    if (.not. allocated(error)) call put_offsets('CellData', cells*step)

  contains

    !> Offsets of all fields of nodes or elements, but for those that are the same in all steps.
    subroutine put_offsets(place, offset)
      character(*), intent(in) :: place  !! Their group.
      integer(int64), intent(in), contiguous :: offset(:)  !! First value of each step (n_steps).
      character(:), allocatable :: path
      integer :: k
      do k = 1, file%n_members('/VTKHDF/'//place)
        path = '/VTKHDF/Steps/'//place//'Offsets/'//file%member('/VTKHDF/'//place, k)
        if (file%has(path)) cycle
        call file%put_dataset(path, offset, error)
        if (allocated(error)) return
      end do
    end subroutine put_offsets
  end subroutine create_steps

  !> Create the datasets of the geometry.
  subroutine create_geometry(file, n_points, n_cells, n_connectivity, error)
    type(hdf5_file_t), intent(in) :: file  !! The results file.
    integer(int64), intent(in), contiguous :: n_points(:)  !! Nodes of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_cells(:)  !! Elements of each body (n_parts).
    !> Sum of the nodes of all elements of each body (n_parts).
    integer(int64), intent(in), contiguous :: n_connectivity(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    integer(int64) :: points, cells, ids
    integer :: n_parts
    n_parts = size(n_points)
    points = sum(n_points)
    cells = sum(n_cells)
    ids = sum(n_connectivity)
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
    if (.not. allocated(error)) call file%new_dataset('/VTKHDF/CellData/material', hdf5_int32, [cells], error)
    if (.not. allocated(error)) call file%new_dataset('/VTKHDF/CellData/element_tag', hdf5_int64, [cells], error)
  end subroutine create_geometry

  !> Create the datasets of the fields; parts that are not written are zero.
  subroutine create_fields(file, points, cells, want_displacement, want_stress, want_contact, want_error, &
                           want_reaction, want_nodal_stress, error)
    type(hdf5_file_t), intent(in) :: file  !! The results file.
    integer(int64), intent(in) :: points  !! Number of nodes of all bodies.
    integer(int64), intent(in) :: cells  !! Number of elements of all bodies.
    logical, intent(in) :: want_displacement  !! Whether displacements will be written.
    logical, intent(in) :: want_stress  !! Whether stresses will be written.
    logical, intent(in) :: want_contact  !! Whether the fields of contact will be written.
    logical, intent(in) :: want_error  !! Whether discretization errors will be written.
    logical, intent(in) :: want_reaction  !! Whether reactions at nodes will be written.
    logical, intent(in) :: want_nodal_stress  !! Whether stresses at nodes will be written.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    if (want_displacement) then
      call file%new_dataset('/VTKHDF/PointData/displacement', hdf5_real, [3_int64, points], error, zero=.true.)
      if (allocated(error)) return
    end if
    if (want_contact) then
      call file%new_dataset('/VTKHDF/PointData/contact_pressure', hdf5_real, [points], error, zero=.true.)
      if (allocated(error)) return
      call file%new_dataset('/VTKHDF/PointData/penetration', hdf5_real, [points], error, zero=.true.)
      if (allocated(error)) return
      call file%new_dataset('/VTKHDF/PointData/contact_traction', hdf5_real, [3_int64, points], error, zero=.true.)
      if (allocated(error)) return
      call file%new_dataset('/VTKHDF/PointData/contact_gap', hdf5_real, [points], error, zero=.true.)
      if (allocated(error)) return
      call file%new_dataset('/VTKHDF/PointData/contact_status', hdf5_int32, [points], error, zero=.true.)
      if (allocated(error)) return
    end if
    if (want_reaction) then
      call file%new_dataset('/VTKHDF/PointData/reaction_force', hdf5_real, [3_int64, points], error, zero=.true.)
      if (allocated(error)) return
    end if
    if (want_nodal_stress) then
      call file%new_dataset('/VTKHDF/PointData/nodal_stress', hdf5_real, [6_int64, points], error, zero=.true.)
      if (allocated(error)) return
      call file%new_dataset('/VTKHDF/PointData/nodal_von_mises', hdf5_real, [points], error, zero=.true.)
      if (allocated(error)) return
      call file%new_dataset('/VTKHDF/PointData/nodal_principal_stress', hdf5_real, [3_int64, points], error, &
                            zero=.true.)
      if (allocated(error)) return
    end if
    if (want_stress) then
      call file%new_dataset('/VTKHDF/CellData/stress', hdf5_real, [6_int64, cells], error, zero=.true.)
      if (allocated(error)) return
      call file%new_dataset('/VTKHDF/CellData/von_mises', hdf5_real, [cells], error, zero=.true.)
      if (allocated(error)) return
    end if
    if (want_error) &
      call file%new_dataset('/VTKHDF/CellData/discretization_error', hdf5_real, [cells], error, zero=.true.)
  end subroutine create_fields

  !> Vectors with three components; plane vectors get z = 0 (3, n) [any].
  pure function with_three_components(x) result(y)
    real(dp), intent(in) :: x(:, :)  !! Vectors (2 or 3, n) [any].
    real(dp), allocatable :: y(:, :)
    integer :: i, dimension
    dimension = min(3, size(x, 1))
    allocate (y(3, size(x, 2)))
    do i = 1, size(x, 2)
      y(:dimension, i) = x(:dimension, i)
      y(dimension + 1:, i) = 0
    end do
  end function with_three_components
end module dotyk_output_results_layout
