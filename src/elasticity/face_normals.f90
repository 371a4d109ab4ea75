!> Normals of surfaces at their nodes: faces that meet smoothly are averaged, edges keep both sides.
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

  !> Normals within 20 degrees belong to one smooth face.
  real(dp), parameter :: least_cosine = 0.939692620785908_dp

contains

  !> Add the outward normal of each facet at each of its nodes to a list, with its area as the number.
  subroutine add_face_normals(x, surface, source, faces)
    !> Nodes of the body (dim, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    type(surface_t), intent(in) :: surface
    !> Number of the surface for the list.
    integer, intent(in) :: source
    type(nodal_vector_list_t), intent(inout) :: faces
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

  !> Area of the reference domain of a facet's kind.
  pure real(dp) function reference_area(properties) result(area)
    type(element_kind_t), intent(in) :: properties
    select case (properties%n_corners)
    case (2)
      area = 2
    case (3)
      area = 0.5_dp
    case default
      area = 4
    end select
  end function reference_area

  !> Group normals: two within 20 degrees belong together, and so do those that a chain of such pairs joins.
  pure subroutine group_normals(dim, n, normal, area, signature, group, n_groups, mean)
    integer, intent(in) :: dim, n
    !> Unit normals.
    real(dp), intent(in) :: normal(dim, n)
    !> Areas of their faces.
    real(dp), intent(in) :: area(n)
    !> Only normals of equal signature are joined.
    integer, intent(in) :: signature(n)
    !> Group of each normal, numbered by their first normals.
    integer, intent(out) :: group(n)
    integer, intent(out) :: n_groups
    !> Mean unit normal of each group, weighted by area; n_groups columns are set.
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
      ! A chain may close round, as the sides of a needle do: then its first normal stands for it.
      if (.not. norm2(mean(:, n_groups)) > 1.0e-6_dp*area(i)) mean(:, n_groups) = normal(:, i)
      mean(:, n_groups) = mean(:, n_groups)/norm2(mean(:, n_groups))
    end do
  end subroutine group_normals
end module dotyk_elasticity_face_normals
