!> Clusters of flat simplices: quadratic triangles and tetrahedra that meet at faces over which both are flat, such as
!> the three tetrahedra of each prism of a thin sheet.
!>
!> The mean of the tractions of both sides of such a face is as wrong as the stresses, on an area that is large beside
!> the volumes: alone, the local answer of each side (`dotyk_elasticity_element_residual`) grows like length over
!> thickness, though the errors of the two sides cancel. Clusters answer as one (`dotyk_elasticity_cluster_residual`).
module dotyk_elasticity_flat_clusters
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_face_table, only: face_table_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_tet10, element_tri6
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  type, public :: flat_clusters_t  !! All elements of a body, those of a cluster one after the other.
    integer :: n = 0  !! Number of clusters; elements that are in none are clusters of one.
    integer, allocatable :: first(:)  !! First entry of each cluster in `element` (n + 1).
    integer, allocatable :: element(:)  !! Elements, counted through all blocks (n_elements).
  contains
    procedure :: init => flat_clusters_init
  end type flat_clusters_t

  !> Greatest height of both simplices over a face at which they are a cluster, relative to the size of the face, its
  !> length or the root of its area [].
  real(dp), parameter :: flat = 0.45_dp
  !> Elements of a cluster at most: in sheets without order all elements hang together.
  integer, parameter :: most_elements = 48

contains

  !> Find the clusters; elements of other ranks are in none.
  subroutine flat_clusters_init(self, mesh, faces)
    class(flat_clusters_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(face_table_t), intent(in) :: faces  !! Faces of the elements.
    logical, allocatable :: free(:)
    integer :: e, k, f, behind, n
    allocate (self%first(mesh%n_elements() + 1), self%element(mesh%n_elements()), free(mesh%n_elements()))
    free = .true.
    n = 0
    k = 1
    do e = 1, size(free)
      if (.not. free(e)) cycle
      self%n = self%n + 1
      self%first(self%n) = n + 1
      call take(e)
      ! k runs behind n, over the elements of the cluster.
      do while (k <= n)
        if (can_join(self%element(k))) then
          do f = 1, size(faces%neighbour, 1)
            behind = faces%neighbour(f, self%element(k))
            if (behind == 0 .or. n - self%first(self%n) + 1 >= most_elements) cycle
            if (.not. free(behind)) cycle
            if (.not. can_join(behind)) cycle
            if (max(height(self%element(k), behind), height(behind, self%element(k))) < flat) call take(behind)
          end do
        end if
        k = k + 1
      end do
    end do
    self%first(self%n + 1) = n + 1

  contains

    !> Add an element to the last cluster.
    subroutine take(element)
      integer, intent(in) :: element  !! The element.
      n = n + 1
      self%element(n) = element
      free(element) = .false.
    end subroutine take

    !> Whether an element may have company.
    pure logical function can_join(element)
      integer, intent(in) :: element  !! The element.
      can_join = any(mesh%block(faces%block(element))%kind == [element_tri6, element_tet10])
      if (can_join) can_join = mesh%is_own_element(element)
    end function can_join

    !> Height of a simplex over its face towards another one, relative to the size of the face [].
    pure real(dp) function height(element, behind)
      integer, intent(in) :: element  !! The simplex.
      integer, intent(in) :: behind  !! The other one.
      type(element_kind_t) :: kind
      real(dp) :: x(3, 4), normal(3)
      integer :: b, d, i
      b = faces%block(element)
      kind = element_kind(mesh%block(b)%kind)
      d = mesh%dimension
      x = 0
      associate (node => mesh%block(b)%node(:, element - faces%before(b)), &
                 face => kind%face_node(:d, findloc(faces%neighbour(:, element), behind, dim=1)))
        x(:d, :d) = mesh%x(:, node(face))
        i = findloc([(any(face == i), i=1, d + 1)], .false., dim=1)
        x(:d, 4) = mesh%x(:, node(i))
      end associate
      if (d == 2) then
        ! The face is a line of unit depth.
        normal = cross(x(:, 2) - x(:, 1), [0.0_dp, 0.0_dp, 1.0_dp])
        height = abs(dot_product(normal, x(:, 4) - x(:, 1)))/max(sum(normal**2), tiny(height))
      else
        normal = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))
        height = abs(dot_product(normal, x(:, 4) - x(:, 1)))/max(norm2(normal)*sqrt(norm2(normal)/2), tiny(height))
      end if
    end function height
  end subroutine flat_clusters_init
end module dotyk_elasticity_flat_clusters
