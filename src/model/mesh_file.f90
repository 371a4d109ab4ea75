!> Mesh files of bodies, and bodies of several volumes: a physical group that is the union of others is added to a mesh
!> that was read.
!>
!> All that takes the volume of a body by the name of its physical group takes such a union by its name, too.
module dotyk_model_mesh_file
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: is_cad_file, is_geo_file, is_stl_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: quoted, text_t
  use dotyk_base_thresholds, only: pi
  use dotyk_input_case, only: case_t
  use dotyk_mesh_cad_script, only: sharp
  use dotyk_mesh_conversion, only: forget_mesh, make_mesh, meshing_t, needs_conversion
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_gmsh, only: read_gmsh
  use dotyk_mesh_mesh, only: groups_named, mesh_selection_t, mesh_t, physical_group_t, unknown_group
  use dotyk_mesh_union_find, only: join, root_of
  use dotyk_ranks_communication, only: this_rank
  use dotyk_ranks_exchange, only: meet
  implicit none
  private
  public :: add_unions, find_msh, forget_meshes, meshing_of, read_alone, read_mesh

contains

  !> How a case has its geometries meshed.
  pure type(meshing_t) function meshing_of(case) result(meshing)
    type(case_t), intent(in) :: case  !! The case.
    meshing%no_shell = case%no_shell
    meshing%size = case%scene%mesh_size
    meshing%order = case%scene%mesh_order
    meshing%number = case%mesh_number
    if (allocated(case%sized_file)) meshing%sized_file = case%sized_file
    if (allocated(case%size_script)) meshing%size_script = case%size_script
    if (allocated(case%size_mark)) meshing%size_mark = case%size_mark
  end function meshing_of

  !> Give up the meshes that are kept for the files of a case, so that they are made again.
  subroutine forget_meshes(case)
    type(case_t), intent(in) :: case  !! The case.
    integer :: b
    if (this_rank() > 0) return
    do b = 1, size(case%body)
      if (needs_conversion(case%body(b)%mesh)) &
        call forget_mesh(case%body(b)%mesh, case%scene%dimension, meshing_of(case))
    end do
  end subroutine forget_meshes

  !> Read a mesh of the format MSH 4.1, or one that is made of another file: the first rank lets it be made, and the
  !> others read it.
  subroutine read_mesh(path, dimension, mesh, meshing, error, selection)
    character(*), intent(in) :: path  !! Path of the mesh or geometry.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(mesh_t), intent(out) :: mesh  !! The mesh.
    type(meshing_t), intent(inout) :: meshing  !! What geometries may do; what was found in this one is set.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be read or meshed.
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read; all if absent.
    logical :: waits
    waits = this_rank() > 0
    if (waits) waits = needs_conversion(path)
    meshing%is_made = waits
    if (.not. waits) call read_alone(path, dimension, mesh, meshing, error, selection)
    call meet()
    if (waits) call read_alone(path, dimension, mesh, meshing, error, selection)
  end subroutine read_mesh

  !> The MSH file of a mesh; it is made first where there is none, or an older one.
  subroutine find_msh(case, path, msh, error)
    type(case_t), intent(in) :: case  !! The case.
    character(*), intent(in) :: path  !! Path of the mesh or geometry.
    character(:), allocatable, intent(out) :: msh  !! Path of the MSH file.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be meshed or converted.
    type(meshing_t) :: meshing
    meshing = meshing_of(case)
    msh = path
    if (needs_conversion(path)) call make_mesh(path, case%scene%dimension, msh, error, meshing)
  end subroutine find_msh

  !> Add the unions of the volumes of bodies that have several to the mesh of their file.
  subroutine add_unions(case, path, mesh)
    type(case_t), intent(in) :: case  !! The case.
    character(*), intent(in) :: path  !! Path of the mesh, as the bodies name it.
    type(mesh_t), intent(inout) :: mesh  !! The mesh.
    integer :: b
    do b = 1, size(case%body)
      if (size(case%body(b)%volumes) < 2 .or. case%body(b)%mesh /= path) cycle
      call add_volume_union(mesh, case%body(b)%volume, case%body(b)%volumes, case%body(b)%material_of, &
                            case%scene%dimension)
    end do
  end subroutine add_unions

  !> Read a mesh, or make it first, without other ranks.
  subroutine read_alone(path, dimension, mesh, meshing, error, selection)
    character(*), intent(in) :: path  !! Path of the mesh or geometry.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(mesh_t), intent(out) :: mesh  !! The mesh.
    type(meshing_t), intent(inout) :: meshing  !! What geometries may do; what was found in this one is set.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be read or meshed.
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read; all if absent.
    character(:), allocatable :: msh
    msh = path
    meshing%remark = ''
    if (needs_conversion(path)) call make_mesh(path, dimension, msh, error, meshing)
    if (.not. allocated(error)) call read_gmsh(msh, mesh, error, selection)
    if (.not. (allocated(error) .or. is_geo_file(path) .or. is_cad_file(path))) call mesh%forget_repeated_entities()
    if (is_stl_file(path) .and. .not. allocated(error)) call join_smooth_faces(mesh, sharp*pi/180)
    ! Messages name the file of the namelist.
    if (.not. allocated(error)) mesh%file = path
  end subroutine read_alone

  !> Add the union of some volumes; once, if it is asked for again.
  subroutine add_volume_union(mesh, name, volume, material, dimension)
    type(mesh_t), intent(inout) :: mesh  !! The mesh; its blocks of these volumes belong to one group more.
    character(*), intent(in) :: name  !! Name of the union.
    type(text_t), intent(in) :: volume(:)  !! Names of the volumes (n_volumes).
    integer, intent(in) :: material(:)  !! Number of the material of each of them among those of the body (n_volumes).
    integer, intent(in) :: dimension  !! Dimension of space.
    type(physical_group_t) :: joined
    type(physical_group_t), allocatable :: group(:)
    logical :: wanted(size(mesh%group)), found(size(mesh%group))
    integer :: b, g, v, n
    found = groups_named(mesh, name, dimension)
    do g = 1, size(found)
      if (found(g) .and. allocated(mesh%group(g)%member)) return
    end do
    joined%name = name
    joined%dimension = dimension
    joined%fault = ''
    if (any(found)) joined%fault = 'mesh '//quoted(mesh%file)//' has a physical group '//quoted(name)// &
      ', the name of the volumes of the body together: rename it'
    allocate (joined%member(0), joined%material(0))
    do v = 1, size(volume)
      wanted = groups_named(mesh, volume(v)%s, dimension)
      if (.not. any(wanted) .and. len(joined%fault) == 0) joined%fault = unknown_group(mesh, volume(v)%s, dimension)
      n = 0
      do b = 1, size(mesh%block)
        if (kind_dimension(mesh%block(b)%kind) /= dimension) cycle
        if (.not. any(wanted(mesh%block(b)%group))) cycle
        n = n + 1
        if (any_member(mesh%block(b)%group) .and. len(joined%fault) == 0) &
          joined%fault = 'mesh '//quoted(mesh%file)//': the volumes of the body, '//quoted(name)// &
          ', have elements in common: the material of these is not clear'
      end do
      if (n == 0 .and. len(joined%fault) == 0) &
        joined%fault = 'mesh '//quoted(mesh%file)//': physical group '//quoted(volume(v)%s)//' has no elements'
      do g = 1, size(wanted)
        if (.not. wanted(g)) cycle
        joined%member = [joined%member, g]
        joined%material = [joined%material, material(v)]
      end do
    end do
    allocate (group(size(mesh%group) + 1))
    do g = 1, size(mesh%group)
      group(g) = mesh%group(g)
    end do
    group(size(group)) = joined
    call move_alloc(group, mesh%group)
    do b = 1, size(mesh%block)
      if (kind_dimension(mesh%block(b)%kind) /= dimension) cycle
      if (any_member(mesh%block(b)%group)) mesh%block(b)%group = [mesh%block(b)%group, size(mesh%group)]
    end do

  contains

    !> Whether a volume of the union is among some groups.
    pure logical function any_member(list)
      integer, intent(in) :: list(:)  !! The groups.
      integer :: i
      any_member = any([(any(joined%member == list(i)), i=1, size(list))])
    end function any_member
  end subroutine add_volume_union

  !> Join surfaces that meet at less than an angle wherever they meet; the first of them keeps its name.
  subroutine join_smooth_faces(mesh, angle)
    type(mesh_t), intent(inout) :: mesh  !! The mesh, each of whose facets belongs to one surface.
    real(dp), intent(in) :: angle  !! The angle [radians].
    real(dp), allocatable :: key(:), normal(:, :)
    integer, allocatable :: group(:), order(:), root(:)
    logical, allocatable :: sharp(:, :), meet(:, :)
    integer :: n, i, a, b
    call find_edges(mesh, key, normal, group)
    n = size(mesh%group)
    if (size(key) < 2) return
    allocate (order(size(key)), sharp(n, n), meet(n, n), root(n))
    call sort_order(key, order)
    sharp = .false.
    meet = .false.
    do i = 1, size(key) - 1
      if (key(order(i)) < key(order(i + 1))) cycle
      a = min(group(order(i)), group(order(i + 1)))
      b = max(group(order(i)), group(order(i + 1)))
      meet(a, b) = .true.
      if (dot_product(normal(:, order(i)), normal(:, order(i + 1))) > -cos(angle)) sharp(a, b) = .true.
    end do
    root = [(i, i=1, n)]
    do a = 1, n
      do b = a + 1, n
        if (meet(a, b) .and. .not. sharp(a, b)) call join(root, a, b)
      end do
    end do
    call rename_groups(mesh, [(root_of(root, i), i=1, n)])
  end subroutine join_smooth_faces

  !> Edges of the facets.
  subroutine find_edges(mesh, key, normal, group)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    real(dp), allocatable, intent(out) :: key(:)  !! Number of each edge by its ends (n_edges).
    !> Normal of its facet, with a minus where the facet runs along it to its lesser node (3, n_edges).
    real(dp), allocatable, intent(out) :: normal(:, :)
    integer, allocatable, intent(out) :: group(:)  !! Surface of its facet (n_edges).
    type(element_kind_t) :: kind
    real(dp) :: own(3)
    integer :: b, e, k, n, ends(2)
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      if (kind%dimension == 2) n = n + kind%n_corners*size(mesh%block(b)%tag)
    end do
    allocate (key(n), normal(3, n), group(n))
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      if (kind%dimension /= 2) cycle
      do e = 1, size(mesh%block(b)%tag)
        associate (node => mesh%block(b)%node(:kind%n_corners, e))
          own = cross(mesh%x(:, node(2)) - mesh%x(:, node(1)), mesh%x(:, node(3)) - mesh%x(:, node(1)))
          own = own/max(tiny(own), norm2(own))
          do k = 1, kind%n_corners
            n = n + 1
            ends = [node(k), node(mod(k, kind%n_corners) + 1)]
            key(n) = real(minval(ends), dp)*size(mesh%x, 2) + maxval(ends)
            ! Neighbours run along their edge in opposite directions, unless one of them is turned.
            normal(:, n) = own*merge(1, -1, ends(1) < ends(2))
            group(n) = mesh%block(b)%group(1)
          end do
        end associate
      end do
    end do
  end subroutine find_edges

  !> Give surfaces the groups that they belong to, and leave out those that are empty then.
  subroutine rename_groups(mesh, root)
    type(mesh_t), intent(inout) :: mesh  !! The mesh.
    integer, intent(in) :: root(:)  !! Group for each group (n_groups).
    type(physical_group_t), allocatable :: group(:)
    integer :: number(size(root)), i, n
    n = 0
    allocate (group(count(root == [(i, i=1, size(root))])))
    do i = 1, size(root)
      if (root(i) /= i) cycle
      n = n + 1
      number(i) = n
      group(n) = mesh%group(i)
    end do
    number = number(root)
    do i = 1, size(mesh%block)
      mesh%block(i)%group = number(mesh%block(i)%group)
    end do
    call move_alloc(group, mesh%group)
  end subroutine rename_groups
end module dotyk_model_mesh_file
