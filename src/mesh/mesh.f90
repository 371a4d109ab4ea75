!> A mesh as in the file: nodes, elements in blocks of one kind, physical groups by name; all of the file, or volumes of
!> some names with all surfaces, so that no process need hold the volumes of all bodies.
!>
!> Bodies extract their own part of it (`dotyk_mesh_body_mesh`); this module does not know bodies.
module dotyk_mesh_mesh
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_files, only: is_cad_file, is_foreign_mesh
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: has_wildcard, join, matches, nearest_name, quoted, text_t
  use dotyk_mesh_element_kind, only: element_point
  implicit none
  private
  public :: group_names, groups_named, groups_like, unknown_group, names_text, fault_of_volume, material_of_block, &
    n_materials_of

  type, public :: element_block_t  !! Elements of one kind that belong to the same physical groups.
    integer :: kind = 0  !! Element kind, one of the named integers of `dotyk_mesh_element`.
    !> Nodes of the elements in the order of gmsh, indices of nodes of the mesh (n_nodes of the kind, n_elements).
    integer, allocatable :: node(:, :)
    integer(int64), allocatable :: tag(:)  !! Element tags in the file (n_elements).
    integer :: material = 1  !! Number of their material among those of the body; unused in a mesh as in the file.
    !> Geometric entity (curve, surface or volume of the geometry) of each element, 0 if unknown (n_elements); not
    !> allocated in parts of a mesh.
    integer, allocatable :: entity(:)
    !> Physical groups to which all these elements belong, indices of `group` of the mesh (n_groups of the block, may be
    !> 0).
    integer, allocatable :: group(:)
    integer :: n_in_file = 0  !! Number of elements of the block in the file, where they are counted only.
  end type element_block_t

  type, public :: physical_group_t  !! Named set of elements of one dimension.
    character(:), allocatable :: name  !! Name; the digits of the tag if the file has no name.
    integer :: dimension = 0  !! Dimension of the elements: 0 points, 1 curves, 2 surfaces, 3 volumes.
    integer :: tag = 0  !! Tag in the file, unique among groups of one dimension.
    !> Groups whose union it is, the volumes of one body (`dotyk_model_mesh_file`); not allocated where the group is
    !> in the file (n_members).
    integer, allocatable :: member(:)
    integer, allocatable :: material(:)  !! Number of the material of each of these among those of the body (n_members).
    character(:), allocatable :: fault  !! What is wrong with such a union; empty where nothing is.
  end type physical_group_t

  type, public :: mesh_t  !! Mesh as read from a file.
    character(:), allocatable :: file  !! File name, for messages.
    !> Nodal coordinates (3, n_nodes) [length]; z is 0 in a plane mesh. Nodes without elements are allowed.
    real(dp), allocatable :: x(:, :)
    integer(int64), allocatable :: node_tag(:)  !! Node tags in the file (n_nodes).
    type(element_block_t), allocatable :: block(:)  !! Elements (n_blocks).
    !> Physical groups (n_groups). Groups of different dimension, and of the same one, may share a name.
    type(physical_group_t), allocatable :: group(:)
  contains
    procedure :: forget_repeated_entities => mesh_forget_repeated_entities
  end type mesh_t

  type, public :: mesh_selection_t  !! What is read of a mesh file.
    logical :: everything = .true.  !! Whether all is read; the other components have no meaning then.
    integer :: dimension = 3  !! Dimension of the volumes: that of space. All elements below it are read.
    !> Names of physical groups: their elements are read, and all of surfaces, curves and points (n_names).
    type(text_t), allocatable :: volume(:)
    !> Whether the elements of the volumes are counted only (`n_in_file` of their blocks): nothing else is read.
    logical :: counts_only = .false.
  contains
    procedure :: has_volume => selection_has_volume
  end type mesh_selection_t

contains

  !> Forget geometric entities that only repeat the tags of the physical groups, as scripts write them that know of no
  !> faces: they say nothing about the geometry. In meshes of geometries the tags may be equal by chance.
  pure subroutine mesh_forget_repeated_entities(self)
    class(mesh_t), intent(inout) :: self
    integer :: i
    do i = 1, size(self%block)
      associate (block => self%block(i))
        if (block%kind == element_point) cycle
        if (size(block%group) /= 1) return
        if (any(block%entity /= self%group(block%group(1))%tag)) return
      end associate
    end do
    do i = 1, size(self%block)
      self%block(i)%entity = 0
    end do
  end subroutine mesh_forget_repeated_entities

  !> Whether the elements of a physical group of the dimension of space are read.
  pure logical function selection_has_volume(self, name) result(has)
    class(mesh_selection_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the group.
    integer :: i
    has = .false.
    do i = 1, size(self%volume)
      has = has .or. self%volume(i)%s == name
    end do
  end function selection_has_volume

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
    if (is_cad_file(mesh%file) .and. dimension < 2) then
      message = 'mesh '//quoted(mesh%file)//' has no names of edges and points: give nodes_at, positions of nodes'
      return
    end if
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
    do other = 0, 3
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
end module dotyk_mesh_mesh
