!> Normals of surfaces at their nodes: normals of faces that meet smoothly are averaged, edges keep one normal per
!> side.
module dotyk_elasticity_face_normals
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_nodal_vector_list, only: nodal_vector_list_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension, kind_nodes, max_facet_nodes, &
    reference_nodes
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: add_face_normals, group_normals

  !> Smallest cosine of the angle of two normals of one smooth face: 20 degrees. Facets of coarse meshes of curved
  !> surfaces meet at smaller angles, edges of machine parts at larger ones.
  real(dp), parameter :: least_cosine = 0.939692620785908_dp
  real(dp), parameter :: cancelled = 1.0e-6_dp  !! Mean normals shorter than this fraction cancelled out.

contains

  !> Add the outward normal of each facet at each of its nodes to a list, with the area of the facet as value.
  subroutine add_face_normals(x, surface, source, faces)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    integer, intent(in) :: source  !! Index of the support, stored with each normal.
    type(nodal_vector_list_t), intent(inout) :: faces  !! List of normals.
    integer :: f, a, n, d, dim, kind, node(max_facet_nodes)
    real(dp) :: xi(2*max_facet_nodes), corners(size(x, 1), max_facet_nodes)
    real(dp) :: position(size(x, 1)), normal(size(x, 1)), jacobian
    type(element_kind_t) :: properties
    dim = size(x, 1)
    do f = 1, surface%n_facets
      kind = surface%kind(f)
      n = kind_nodes(kind)
      d = kind_dimension(kind)
      properties = element_kind(kind)
      node(:n) = surface%node(:n, f)
      corners(:, :n) = x(:, node(:n))
      call reference_nodes(kind, xi)
      do a = 1, n
        call facet_geometry(kind, dim, corners, xi((a - 1)*d + 1:a*d), position, normal, jacobian)
        if (jacobian > 0) call faces%add(node(a), source, normal, jacobian*reference_area(properties))
      end do
    end do
  end subroutine add_face_normals

  !> Area of the reference facet [].
  pure real(dp) function reference_area(properties) result(area)
    type(element_kind_t), intent(in) :: properties  !! Properties of the facet's kind.
    select case (properties%n_corners)
    case (2)
      area = 2
    case (3)
      area = 0.5_dp
    case default
      area = 4
    end select
  end function reference_area

  !> Group normals: two within 20 degrees are in one group, and so are those connected by a chain of such pairs.
  pure subroutine group_normals(dim, n, normal, area, signature, group, n_groups, mean)
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n  !! Number of normals.
    real(dp), intent(in) :: normal(dim, n)  !! Unit normals (dim, n) [].
    real(dp), intent(in) :: area(n)  !! Areas of their facets (n) [length^(dim-1)].
    integer, intent(in) :: signature(n)  !! Normals of different signatures are never in one group (n).
    !> Group of each normal; groups are numbered in the order of their first normals (n).
    integer, intent(out) :: group(n)
    integer, intent(out) :: n_groups  !! Number of groups.
    !> Mean unit normal of each group, weighted with the areas; n_groups columns are set (dim, n) [].
    real(dp), intent(out) :: mean(dim, n)
    integer :: i, j, member, stack(n), height
    group = 0
    n_groups = 0
    mean = 0
    do i = 1, n
      if (group(i) > 0) cycle
      n_groups = n_groups + 1
      group(i) = n_groups
      height = 1
      stack(1) = i
      do while (height > 0)
        member = stack(height)
        height = height - 1
        mean(:, n_groups) = mean(:, n_groups) + area(member)*normal(:, member)
        do j = i + 1, n
          if (group(j) > 0 .or. signature(j) /= signature(i)) cycle
          if (dot_product(normal(:, j), normal(:, member)) < least_cosine) cycle
          group(j) = n_groups
          height = height + 1
          stack(height) = j
        end do
      end do
      ! Chains may go round, as the sides of a needle do, and their normals cancel: the first normal represents them.
      if (.not. norm2(mean(:, n_groups)) > cancelled*area(i)) mean(:, n_groups) = normal(:, i)
      mean(:, n_groups) = mean(:, n_groups)/norm2(mean(:, n_groups))
    end do
  end subroutine group_normals
end module dotyk_elasticity_face_normals
