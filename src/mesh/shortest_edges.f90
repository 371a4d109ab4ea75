!> Shortest edges of the elements at nodes, which tell what is small there.
module dotyk_mesh_shortest_edges
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_layer_share, only: whole_numbers_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  implicit none
  private
  public :: find_shortest_edges, find_layer_edges

contains

  !> Shortest edge or diagonal of the elements at each node: what is small beside it is no thickness of elements.
  pure subroutine find_shortest_edges(mesh, shortest)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    real(dp), intent(out) :: shortest(:)  !! Lengths; huge at nodes that are no corners (n_nodes) [length].
    type(element_kind_t) :: kind
    real(dp) :: length
    integer :: b, e, i, j, n, p, q
    shortest = huge(shortest)
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      n = kind%n_corners
      do e = 1, size(mesh%block(b)%tag)
        do i = 2, n
          p = mesh%block(b)%node(i, e)
          do j = 1, i - 1
            q = mesh%block(b)%node(j, e)
            length = norm2(mesh%x(:, p) - mesh%x(:, q))
            shortest(p) = min(shortest(p), length)
            shortest(q) = min(shortest(q), length)
          end do
        end do
      end do
    end do
  end subroutine find_shortest_edges

  !> Shortest edge of the elements of a rank at each node of a surface layer.
  subroutine find_layer_edges(own, whole, layer, shortest)
    type(body_mesh_t), intent(in) :: own  !! Elements that the rank owns, and their nodes, maybe among others.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    type(surface_layer_t), intent(in) :: layer  !! Surface layer of the body.
    !> Lengths; huge where the rank has no element (n_nodes of the layer) [length].
    real(dp), allocatable, intent(out) :: shortest(:)
    real(dp), allocatable :: of_own(:)
    integer :: i, k
    allocate (of_own(own%n_nodes()))
    call find_shortest_edges(own, of_own)
    allocate (shortest(layer%mesh%n_nodes()), source=huge(0.0_dp))
    k = 1
    do i = 1, size(of_own)
      ! Both lists of nodes ascend.
      do while (k <= size(shortest))
        if (layer%whole%node(k) >= whole%node(i)) exit
        k = k + 1
      end do
      if (k > size(shortest)) exit
      if (layer%whole%node(k) == whole%node(i)) shortest(k) = of_own(i)
    end do
  end subroutine find_layer_edges
end module dotyk_mesh_shortest_edges
