!> Bodies of several volumes: a physical group that is the union of others, added to a mesh that was read.
!>
!> All that takes the volume of a body by the name of its physical group takes such a union by its name, too.
module dotyk_mesh_volume_union
  use dotyk_base_text, only: quoted, text_t
  use dotyk_mesh_element, only: kind_dimension
  use dotyk_mesh_mesh, only: mesh_t, physical_group_t
  use dotyk_mesh_physical_group, only: groups_named, unknown_group
  implicit none
  private
  public :: add_volume_union

contains

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
end module dotyk_mesh_volume_union
