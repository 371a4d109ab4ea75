!> Reads `&body` from a checked group.
module dotyk_input_bodies
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: counted, join, shown, text_t, to_text
  use dotyk_input_boundary, only: read_vector
  use dotyk_input_case, only: body_input_t, scene_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_settings, only: read_mesh_path
  use dotyk_input_values, only: count_of, is_given, is_usable, logical_of, names_t, read_numbers, real_of, refer, &
    refuse, report, text_of, texts_of
  implicit none
  private
  public :: read_body, union_name

contains

  !> Read `&body`.
  subroutine read_body(group, materials, scene, directory, mesh_expected, problems, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(names_t), intent(in) :: materials  !! Names of the materials.
    type(scene_input_t), intent(in) :: scene  !! The scene: its mesh is that of bodies without their own.
    character(*), intent(in) :: directory  !! Directory of the namelist file.
    !> Whether a body without a mesh is a mistake; not where the mesh of the scene has one itself.
    logical, intent(in) :: mesh_expected
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(body_input_t), intent(out) :: body  !! The body; incomplete where the group has mistakes.
    body%line = group%line
    body%name = text_of(group, 'name')
    if (index(body%name, ':') > 0) &
      call report(problems, group, 'name', 'name: '//shown(body%name)//' must not contain '':''')
    call read_volumes(group, materials, scene%dimension, problems, body)
    if (is_given(group, 'mesh')) then
      call read_mesh_path(group, directory, scene%dimension, problems, body%mesh)
      if (len(body%mesh) > 0 .and. body%mesh == scene%output) &
        call report(problems, group, 'mesh', 'mesh: '//shown(body%mesh)//' is the results file of &scene')
    else
      body%mesh = scene%mesh
      if (len(scene%mesh) == 0 .and. mesh_expected) &
        call problems%add(group%line, '&body: ''mesh'' is missing, here and in &scene')
    end if
    call read_placement(group, scene, problems, body)
    body%crack = logical_of(group, 'crack')
  end subroutine read_body

  !> Read the volumes of a body and their materials.
  subroutine read_volumes(group, materials, dimension, problems, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(names_t), intent(in) :: materials  !! Names of the materials.
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3; 0 where it is unknown.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(body_input_t), intent(inout) :: body  !! The body; its volumes and materials are set.
    type(text_t), allocatable :: names(:)
    integer, allocatable :: index_of(:)
    integer :: i, k
    call texts_of(group, 'volume', body%volumes)
    call texts_of(group, 'material', names)
    body%is_surface = is_given(group, 'surface')
    if (body%is_surface) then
      ! gfortran 12 leaks the text of an array constructor.
      if (allocated(body%volumes)) deallocate (body%volumes)
      allocate (body%volumes(1))
      body%volumes(1)%s = text_of(group, 'surface')
      call refuse(group, 'volume', 'surface', problems)
      call refuse(group, 'material', 'surface', problems)
      call refuse(group, 'crack', 'surface', problems)
      body%has_facing = is_given(group, 'facing')
      call read_vector(group, 'facing', .false., dimension, problems, body%facing)
      ! It has none: the first one stands in.
      body%material = [1]
      body%material_of = [1]
      body%volume = union_name(body)
      return
    end if
    if (.not. is_given(group, 'volume')) call problems%add(group%line, "&body: 'volume' is missing")
    if (.not. is_given(group, 'material')) call problems%add(group%line, "&body: 'material' is missing")
    if (is_given(group, 'facing')) &
      call report(problems, group, 'facing', 'facing tells the side of a body without volume: it needs surface')
    do i = 2, size(body%volumes)
      if (any([(body%volumes(k)%s == body%volumes(i)%s, k=1, i - 1)])) &
        call report(problems, group, 'volume', 'volume: '//shown(body%volumes(i)%s)//' is named twice')
    end do
    if (size(names) > 1 .and. size(body%volumes) > 0 .and. size(names) /= size(body%volumes)) &
      call report(problems, group, 'material', 'material has '//counted(size(names), 'value')//', and volume has '// &
                  to_text(size(body%volumes))//': give one material for all volumes, or one for each')
    allocate (index_of(max(1, size(names))), source=0)
    do i = 1, size(names)
      if (any([(names(k)%s == names(i)%s, k=1, i - 1)])) then
        index_of(i) = index_of(findloc([(names(k)%s == names(i)%s, k=1, i - 1)], .true., dim=1))
      else
        call refer(group, 'material', names(i)%s, materials, problems, index_of(i))
      end if
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
  subroutine read_placement(group, scene, problems, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its dimension and analysis.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(body_input_t), intent(inout) :: body  !! The body; its placement is set.
    if (is_given(group, 'at') .and. is_usable(group, 'at')) then
      if (scene%dimension == 3 .and. count_of(group, 'at') < 3) &
        call report(problems, group, 'at', 'at needs 3 values in three dimensions, got '// &
                    to_text(count_of(group, 'at')))
      call read_numbers(group, 'at', body%at)
      if (scene%dimension == 2 .and. abs(body%at(3)) > 0) &
        call report(problems, group, 'at', 'at has z = '//to_text(body%at(3))//', but there is no z in two dimensions')
      if (scene%analysis == analysis_axisymmetric .and. abs(body%at(1)) > 0) &
        call report(problems, group, 'at', 'at has x = '//to_text(body%at(1))// &
                    ', but axisymmetric bodies are shifted along y only')
    end if
    if (is_given(group, 'axis') .and. .not. (is_given(group, 'angle') .or. is_given(group, 'first_angle'))) &
      call report(problems, group, 'axis', 'axis is given without an angle')
    if (is_given(group, 'axis') .and. is_usable(group, 'axis')) then
      call read_numbers(group, 'axis', body%axis)
      if (.not. maxval(abs(body%axis)) > 0) then
        call report(problems, group, 'axis', 'axis has no direction: all its components are 0')
      else if (scene%dimension == 2 .and. maxval(abs(body%axis(:2))) > 0) then
        call report(problems, group, 'axis', 'in two dimensions bodies are rotated about z only')
      end if
    end if
    if (is_given(group, 'angle')) body%angle = real_of(group, 'angle')
    if (scene%analysis /= analysis_axisymmetric) return
    if (is_given(group, 'angle')) &
      call report(problems, group, 'angle', 'axisymmetric bodies cannot be rotated: remove angle')
    if (is_given(group, 'first_angle')) &
      call report(problems, group, 'first_angle', 'axisymmetric bodies cannot be rotated: remove first_angle')
  end subroutine read_placement
end module dotyk_input_bodies
