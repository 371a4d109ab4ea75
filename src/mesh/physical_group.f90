!> Physical groups of a mesh, by name.
module dotyk_mesh_physical_group
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_files, only: is_cad_file, is_foreign_mesh
  use dotyk_base_text, only: join, nearest_name, quoted, text_t
  use dotyk_base_wildcard, only: has_wildcard, matches
  use dotyk_mesh_mesh, only: mesh_t
  implicit none
  private
  public :: group_names, groups_named, groups_like, unknown_group, names_text
  public :: fault_of_volume, material_of_block, n_materials_of

contains

  !> Names of the groups of a dimension, each once, in the order of the file.
  pure subroutine group_names(mesh, dimension, names)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    integer, intent(in) :: dimension  !! 1 curves, 2 surfaces, 3 volumes.
    type(text_t), allocatable, intent(out) :: names(:)  !! Names (n_names).
    logical :: chosen(size(mesh%group))
    integer :: i, j, n
    do i = 1, size(chosen)
      chosen(i) = mesh%group(i)%dimension == dimension .and. .not. allocated(mesh%group(i)%member)
      do j = 1, i - 1
        if (chosen(j)) then
          if (mesh%group(j)%name == mesh%group(i)%name) chosen(i) = .false.
        end if
      end do
    end do
    allocate (names(count(chosen)))
    n = 0
    do i = 1, size(chosen)
      if (.not. chosen(i)) cycle
      n = n + 1
      names(n)%s = mesh%group(i)%name
    end do
  end subroutine group_names

  !> Groups that bear a name; there may be several.
  pure function groups_named(mesh, name, dimension) result(chosen)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    character(*), intent(in) :: name  !! Name.
    integer, intent(in) :: dimension  !! 1 curves, 2 surfaces, 3 volumes.
    logical :: chosen(size(mesh%group))  !! True for the groups of that name and dimension (n_groups).
    integer :: i
    do i = 1, size(chosen)
      chosen(i) = mesh%group(i)%dimension == dimension .and. mesh%group(i)%name == name
    end do
  end function groups_named

  !> Groups that a name stands for: those that bear it, or else those that its wildcards match.
  pure function groups_like(mesh, name, dimension) result(chosen)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    character(*), intent(in) :: name  !! Name, maybe with wildcards.
    integer, intent(in) :: dimension  !! 1 curves, 2 surfaces, 3 volumes.
    logical :: chosen(size(mesh%group))  !! True for these groups (n_groups).
    integer :: i
    chosen = groups_named(mesh, name, dimension)
    if (any(chosen) .or. .not. has_wildcard(name)) return
    do i = 1, size(chosen)
      chosen(i) = mesh%group(i)%dimension == dimension .and. matches(name, mesh%group(i)%name)
    end do
  end function groups_like

  !> Message for a name that no group of the dimension bears.
  pure function unknown_group(mesh, name, dimension) result(message)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    character(*), intent(in) :: name  !! Requested name.
    integer, intent(in) :: dimension  !! 1 curves, 2 surfaces, 3 volumes.
    character(:), allocatable :: message  !! Message.
    type(text_t), allocatable :: names(:)
    character(:), allocatable :: suggestion, kind
    integer :: other
    kind = 'physical '//trim(kind_name(dimension))
    if (is_cad_file(mesh%file)) kind = trim(merge('solid', 'face ', dimension == 3))
    call group_names(mesh, dimension, names)
    suggestion = nearest_name(name, names)
    message = 'mesh '//quoted(mesh%file)//' has no '//kind// &
              trim(merge(' like', '     ', has_wildcard(name)))//' '//quoted(name)
    if (suggestion /= '') message = message//' (did you mean '//quoted(suggestion)//'?)'
    if (size(names) > 0) then
      message = message//'; its '//kind//'s: '//names_text(names)
    else if (is_foreign_mesh(mesh%file)) then
      message = message//', nor any other: they are sets and surfaces of a deck, groups, or the values of arrays '// &
                'of integers of the cells or points'
    else
      message = message//', nor any other: name them in gmsh, as Physical '//capital_name(dimension)//'("name") = {1};'
    end if
    do other = 1, 3
      if (other == dimension) cycle
      if (.not. any(groups_named(mesh, name, other))) cycle
      message = message//'; '//quoted(name)//' is a physical '//trim(kind_name(other))
    end do
  end function unknown_group

  !> What is wrong with the volume of a body: no group bears its name, or the volumes that it joins cannot be joined.
  subroutine fault_of_volume(mesh, name, dimension, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    character(*), intent(in) :: name  !! Name of the volume.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where something is wrong.
    logical :: wanted(size(mesh%group))
    integer :: i
    wanted = groups_named(mesh, name, dimension)
    if (.not. any(wanted)) then
      if (has_wildcard(name)) then
        call set_error(error, unknown_group(mesh, name, dimension)//'; a * in volume stands for the numbers 1, 2, '// &
                       '... of repeat, which makes a body of each')
      else
        call set_error(error, unknown_group(mesh, name, dimension))
      end if
      return
    end if
    do i = 1, size(wanted)
      if (.not. (wanted(i) .and. allocated(mesh%group(i)%fault))) cycle
      if (len(mesh%group(i)%fault) == 0) cycle
      call set_error(error, mesh%group(i)%fault)
      return
    end do
  end subroutine fault_of_volume

  !> Greatest number of a material of the volume of a body.
  pure integer function n_materials_of(mesh, wanted) result(n)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    logical, intent(in) :: wanted(:)  !! Groups of the volume (n_groups).
    integer :: i
    n = 1
    do i = 1, size(wanted)
      if (wanted(i) .and. allocated(mesh%group(i)%member)) n = max(n, maxval(mesh%group(i)%material))
    end do
  end function n_materials_of

  !> Number of the material of a block of the volume of a body, among those of the body.
  pure integer function material_of_block(mesh, wanted, block) result(material)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    logical, intent(in) :: wanted(:)  !! Groups of the volume (n_groups).
    integer, intent(in) :: block  !! The block, which belongs to one of them.
    integer :: i, k
    material = 1
    do i = 1, size(wanted)
      if (.not. (wanted(i) .and. allocated(mesh%group(i)%member))) cycle
      do k = 1, size(mesh%group(i)%member)
        if (any(mesh%block(block)%group == mesh%group(i)%member(k))) material = mesh%group(i)%material(k)
      end do
    end do
  end function material_of_block

  !> Quoted names, separated by commas; 'none' where there is none.
  pure function names_text(names) result(text)
    type(text_t), intent(in) :: names(:)  !! Names (n_names).
    character(:), allocatable :: text  !! Text.
    type(text_t) :: in_quotes(size(names))
    integer :: i
    do i = 1, size(names)
      in_quotes(i)%s = quoted(names(i)%s)
    end do
    text = join(in_quotes, ', ')
    if (size(names) == 0) text = 'none'
  end function names_text

  !> Name of gmsh for a group of a dimension.
  pure character(7) function kind_name(dimension)
    integer, intent(in) :: dimension  !! 0 points, 1 curves, 2 surfaces, 3 volumes.
    character(7), parameter :: names(0:3) = ['point  ', 'curve  ', 'surface', 'volume ']
    kind_name = names(dimension)
  end function kind_name

  !> The same as a keyword of the gmsh language.
  pure function capital_name(dimension) result(name)
    integer, intent(in) :: dimension  !! 0 points, 1 curves, 2 surfaces, 3 volumes.
    character(:), allocatable :: name  !! Keyword.
    name = trim(kind_name(dimension))
    name(1:1) = achar(iachar(name(1:1)) - 32)
  end function capital_name
end module dotyk_mesh_physical_group
