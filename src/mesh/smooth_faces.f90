!> Surfaces of meshes from STL files: gmsh divides smooth faces into parts that it can mesh; here they are joined again.
module dotyk_mesh_smooth_faces
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_mesh, only: mesh_t, physical_group_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: join_smooth_faces

contains

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
end module dotyk_mesh_smooth_faces
