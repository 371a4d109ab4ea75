!> Surfaces of one mesh that was divided there: all their nodes are tied, those on edges, too, each to the one at its
!> place. The displacements are those of the undivided mesh.
module dotyk_contact_matching_tie
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_mortar
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, max_facet_nodes, reference_nodes
  use dotyk_mesh_facet, only: area_vector
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  implicit none
  private
  public :: discretize_matching_tie

contains

  !> Make one pair for each component: a row for each node.
  subroutine discretize_matching_tie(mesh_a, surface_a, mesh_b, surface_b, settings, tie, normal)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body.
    type(surface_t), intent(in) :: surface_b  !! Master surface: the same facets.
    type(pair_settings_t), intent(in) :: settings  !! Name and bodies.
    type(contact_pair_t), allocatable, intent(out) :: tie(:)  !! One pair for each component (dimension).
    !> Mean normal of the slave surface; of length 1 where it is flat (dimension) [].
    real(dp), intent(out) :: normal(:)
    type(contact_pair_t) :: pair
    type(corner_table_t) :: facets
    type(element_kind_t) :: kind
    integer, allocatable :: node(:), row_of(:), facet_of(:), row(:)
    real(dp) :: area, vector(size(normal))
    integer :: c, d, f, g, j, k, n, q, entry
    d = mesh_a%dimension
    call facets%init(4, surface_b%n_facets)
    allocate (facet_of(surface_b%n_facets))
    do f = 1, surface_b%n_facets
      kind = element_kind(surface_b%kind(f))
      call facets%add(mesh_b%mesh_node(surface_b%node(:kind%n_corners, f)), entry)
      facet_of(entry) = f
    end do
    call surface_nodes(surface_a, node)
    n = size(node)
    allocate (row_of(mesh_a%n_nodes()), source=0)
    row_of(node) = [(k, k=1, n)]
    pair%name = settings%name
    pair%body_a = settings%body_a
    pair%body_b = settings%body_b
    pair%dimension = d
    pair%discretization = discretization_mortar
    pair%n_points = sum([(kind_nodes(surface_a%kind(f)), f=1, surface_a%n_facets)])
    pair%n_rows = n
    pair%n_mortar_rows = n
    pair%n_mortar_points = pair%n_points
    pair%row_position = mesh_a%x(:, node)
    pair%row_corner = [(k, k=1, n)]
    allocate (pair%row_weight(n), source=0.0_dp)
    associate (m => pair%n_points)
      allocate (row(m), pair%facet_a(m), pair%facet_b(m), pair%sheet_b(m), source=0)
      allocate (pair%xi_a(d - 1, m), pair%xi_b(d - 1, m), pair%position(d, m), pair%weight(m), source=0.0_dp)
    end associate
    q = 0
    normal = 0
    area = 0
    do f = 1, surface_a%n_facets
      kind = element_kind(surface_a%kind(f))
      vector = area_vector(mesh_a%x(:, surface_a%node(:kind%n_corners, f)))
      normal = normal + vector
      area = area + norm2(vector)
      g = facet_of(facets%find(mesh_a%mesh_node(surface_a%node(:kind%n_corners, f))))
      do j = 1, kind_nodes(surface_a%kind(f))
        q = q + 1
        row(q) = row_of(surface_a%node(j, f))
        pair%position(:, q) = mesh_a%x(:, surface_a%node(j, f))
        pair%facet_a(q) = f
        pair%xi_a(:, q) = reference_node(d - 1, surface_a%kind(f), j)
        pair%facet_b(q) = g
        k = closest_of(pair%position(:, q), mesh_b%x(:, surface_b%node(:kind_nodes(surface_b%kind(g)), g)))
        pair%xi_b(:, q) = reference_node(d - 1, surface_b%kind(g), k)
        pair%weight(q) = norm2(vector)/kind_nodes(surface_a%kind(f))
        pair%row_weight(row(q)) = pair%row_weight(row(q)) + pair%weight(q)
      end do
    end do
    normal = normal/area
    ! The points of a row are one node, as each of its facets has it.
    call pair%average%init_from_triplets(n, q, row, [(k, k=1, q)], pair%weight/pair%row_weight(row))
    pair%gap = spread(0.0_dp, 1, q)
    pair%bend = pair%gap
    pair%curved = pair%gap
    pair%row_gap = spread(0.0_dp, 1, n)
    pair%row_theta = pair%row_gap
    allocate (tie(d))
    do c = 1, d
      pair%normal = spread([(merge(1.0_dp, 0.0_dp, k == c), k=1, d)], 2, q)
      pair%row_normal = pair%normal(:, :n)
      tie(c) = pair
    end do
  end subroutine discretize_matching_tie

  !> Reference coordinates of a node of a facet (dimension - 1) [].
  pure function reference_node(d, kind, j) result(xi)
    integer, intent(in) :: d  !! Dimension of the facet.
    integer, intent(in) :: kind  !! Element kind of the facet.
    integer, intent(in) :: j  !! The node.
    real(dp) :: xi(d), all_of_them(d, max_facet_nodes)
    call reference_nodes(kind, all_of_them(:, :kind_nodes(kind)))
    xi = all_of_them(:, j)
  end function reference_node

  !> Number of the nearest of some points.
  pure integer function closest_of(x, points) result(k)
    real(dp), intent(in) :: x(:)  !! A point (dimension) [length].
    real(dp), intent(in) :: points(:, :)  !! The points (dimension, n_points) [length].
    k = minloc(norm2(points - spread(x, 2, size(points, 2)), dim=1), dim=1)
  end function closest_of
end module dotyk_contact_matching_tie
