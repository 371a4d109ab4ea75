!> Reads `&body` from a checked group.
module dotyk_input_bodies
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: counted, join, shown, text_t, to_text
  use dotyk_input_case, only: body_input_t
  use dotyk_input_groups, only: group_t
  use dotyk_input_references, only: find_name, input_t, why_unknown
  use dotyk_input_settings, only: read_mesh_path
  use dotyk_input_vectors, only: read_vector
  implicit none
  private
  public :: read_body, union_name

contains

  !> Read `&body`.
  subroutine read_body(group, input, directory, mesh_expected, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: directory  !! Directory of the namelist file.
    !> Whether a body without a mesh is a mistake; not where the mesh of the scene has one itself.
    logical, intent(in) :: mesh_expected
    type(body_input_t), intent(out) :: body  !! The body; incomplete where the group has mistakes.
    body%line = group%line
    body%name = group%text_of('name')
    if (index(body%name, ':') > 0) &
      call input%report(group, 'name', 'name: '//shown(body%name)//' must not contain '':''')
    call read_volumes(group, input, body)
    if (group%is_given('mesh')) then
      call read_mesh_path(group, input, directory, body%mesh)
      if (len(body%mesh) > 0 .and. body%mesh == input%scene%output) &
        call input%report(group, 'mesh', 'mesh: '//shown(body%mesh)//' is the results file of &scene')
    else
      body%mesh = input%scene%mesh
      if (len(input%scene%mesh) == 0 .and. mesh_expected) &
        call input%add(group%line, '&body: ''mesh'' is missing, here and in &scene')
    end if
    call read_placement(group, input, body)
    body%crack = group%logical_of('crack')
  end subroutine read_body

  !> Read the volumes of a body and their materials.
  subroutine read_volumes(group, input, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(inout) :: body  !! The body; its volumes and materials are set.
    type(text_t), allocatable :: names(:)
    character(:), allocatable :: message
    integer, allocatable :: index_of(:)
    integer :: i, k
    call group%texts_of('volume', body%volumes)
    call group%texts_of('material', names)
    body%is_surface = group%is_given('surface')
    if (body%is_surface) then
      ! gfortran 12 leaks the text of an array constructor.
      if (allocated(body%volumes)) deallocate (body%volumes)
      allocate (body%volumes(1))
      body%volumes(1)%s = group%text_of('surface')
      call input%refuse(group, 'volume', 'surface')
      call input%refuse(group, 'material', 'surface')
      call input%refuse(group, 'crack', 'surface')
      body%has_facing = group%is_given('facing')
      call read_vector(group, input, 'facing', .false., body%facing)
      ! It has none: the first one stands in.
      body%material = [1]
      body%material_of = [1]
      body%volume = union_name(body)
      return
    end if
    if (.not. group%is_given('volume')) call input%add(group%line, "&body: 'volume' is missing")
    if (.not. group%is_given('material')) call input%add(group%line, "&body: 'material' is missing")
    if (group%is_given('facing')) &
      call input%report(group, 'facing', 'facing tells the side of a body without volume: it needs surface')
    do i = 2, size(body%volumes)
      if (any([(body%volumes(k)%s == body%volumes(i)%s, k=1, i - 1)])) &
        call input%report(group, 'volume', 'volume: '//shown(body%volumes(i)%s)//' is named twice')
    end do
    if (size(names) > 1 .and. size(body%volumes) > 0 .and. size(names) /= size(body%volumes)) &
      call input%report(group, 'material', 'material has '//counted(size(names), 'value')//', and volume has '// &
                        to_text(size(body%volumes))//': give one material for all volumes, or one for each')
    allocate (index_of(max(1, size(names))), source=0)
    do i = 1, size(names)
      index_of(i) = find_name(input%materials, names(i)%s)
      message = why_unknown(input%materials, names(i)%s)
      if (len(message) > 0 .and. .not. any([(names(k)%s == names(i)%s, k=1, i - 1)])) &
        call input%report(group, 'material', 'material: '//message)
    end do
    allocate (body%material(0), body%material_of(size(body%volumes)))
    do i = 1, size(index_of)
      if (.not. any(body%material == index_of(i))) body%material = [body%material, index_of(i)]
    end do
    do i = 1, size(body%volumes)
      body%material_of(i) = findloc(body%material, index_of(min(i, size(index_of))), dim=1)
    end do
    body%volume = union_name(body)
  end subroutine read_volumes

  !> Name of the volumes of a body together: its only one, or those of one material joined by `, `, the materials by
  !> `; `.
  pure function union_name(body) result(name)
    type(body_input_t), intent(in) :: body  !! The body, with its volumes and their materials.
    character(:), allocatable :: name
    integer :: m
    name = ''
    do m = 1, size(body%material)
      if (m > 1) name = name//'; '
      name = name//join(pack(body%volumes, body%material_of == m), ', ')
    end do
  end function union_name

  !> Read the position and rotation of a body.
  subroutine read_placement(group, input, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(inout) :: body  !! The body; its placement is set.
    if (group%is_given('at') .and. group%is_usable('at')) then
      if (input%scene%dimension == 3 .and. group%count_of('at') < 3) &
        call input%report(group, 'at', 'at needs 3 values in three dimensions, got '//to_text(group%count_of('at')))
      call group%read_numbers('at', body%at)
      if (input%scene%dimension == 2 .and. abs(body%at(3)) > 0) &
        call input%report(group, 'at', 'at has z = '//to_text(body%at(3))//', but there is no z in two dimensions')
      if (input%scene%analysis == analysis_axisymmetric .and. abs(body%at(1)) > 0) &
        call input%report(group, 'at', 'at has x = '//to_text(body%at(1))//', but axisymmetric bodies are shifted '// &
                          'along y only')
    end if
    if (group%is_given('axis') .and. .not. (group%is_given('angle') .or. group%is_given('first_angle'))) &
      call input%report(group, 'axis', 'axis is given without an angle')
    if (group%is_given('axis') .and. group%is_usable('axis')) then
      call group%read_numbers('axis', body%axis)
      if (.not. maxval(abs(body%axis)) > 0) then
        call input%report(group, 'axis', 'axis has no direction: all its components are 0')
      else if (input%scene%dimension == 2 .and. maxval(abs(body%axis(:2))) > 0) then
        call input%report(group, 'axis', 'in two dimensions bodies are rotated about z only')
      end if
    end if
    if (group%is_given('angle')) body%angle = group%real_of('angle')
    if (input%scene%analysis /= analysis_axisymmetric) return
    if (group%is_given('angle')) &
      call input%report(group, 'angle', 'axisymmetric bodies cannot be rotated: remove angle')
    if (group%is_given('first_angle')) &
      call input%report(group, 'first_angle', 'axisymmetric bodies cannot be rotated: remove first_angle')
  end subroutine read_placement
end module dotyk_input_bodies
