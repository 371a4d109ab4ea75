!> Surfaces that are tied together: displacements of both are equal in the weighted mean over the dual shape functions
!> of each vertex of the slave surface, component by component (mesh tying by dual mortar rows: M. Puso, Int. J. Numer.
!> Methods Engrg. 59, 2004).
!>
!> A tie is one pair for each component: its rows are those of a contact pair whose normals are the axis of the
!> component everywhere, and whose gaps are 0, whatever lies between the surfaces. With the arm r = x' - x from a point
!> of the slave surface to its projection, it is u_a at the end of the arm that equals u_b there: the arm moves with its
!> facet,
!>
!>     u_a(x + r) = u_a + grad_s u_a . r_s - grad_s(u_a . r_n),
!>
!> r_s and r_n its parts along the facet and across it, so that rotations of both bodies together leave ties closed
!> where the meshes of a curved surface do not fit.
!>
!> Ties of matching surfaces join the nodes of one mesh that was divided there, those on edges, too, each to the one at
!> its place: the displacements are those of the undivided mesh.
module dotyk_contact_tie
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_mortar, gap_constant, geometry_elements, quadrature_segments
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_contact_pair_discretization, only: discretize_pair
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, max_facet_nodes, reference_nodes, &
    shape_functions, shape_gradients
  use dotyk_mesh_facet, only: area_vector
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  implicit none
  private
  public :: discretize_tie, facet_size, discretize_matching_tie

contains

  !> Discretize a tie.
  subroutine discretize_tie(mesh_a, surface_a, mesh_b, surface_b, settings, tie, normal, distance, error, turn)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    type(pair_settings_t), intent(in) :: settings  !! Name, bodies, search radius, axisymmetry.
    type(contact_pair_t), allocatable, intent(out) :: tie(:)  !! One pair for each component (dimension).
    !> Mean normal of the slave surface; of length 1 where it is flat (dimension) [].
    real(dp), intent(out) :: normal(:)
    real(dp), intent(out) :: distance  !! Greatest distance of the surfaces [length].
    !> No point of the slave surface has a projection, or a facet has no area.
    type(error_t), allocatable, intent(out) :: error
    !> Rotation of the master body that brings its surface there; its mesh is rotated already (dimension, dimension) [].
    real(dp), intent(in), optional :: turn(:, :)
    type(pair_settings_t) :: of_tie
    type(contact_pair_t) :: pair
    type(formula_t) :: none
    integer :: c
    of_tie = settings
    of_tie%gap_kind = gap_constant
    of_tie%gap = 0
    of_tie%theta = 0
    of_tie%discretization = discretization_mortar
    of_tie%geometry = geometry_elements
    of_tie%quadrature = quadrature_segments
    of_tie%is_tie = .true.
    distance = 0
    normal = 0
    call discretize_pair(mesh_a, surface_a, mesh_b, surface_b, of_tie, none, pair, error)
    if (allocated(error)) return
    call set_arms(mesh_a, surface_a, mesh_b, surface_b, pair, distance, error)
    if (allocated(error)) return
    normal = matmul(pair%normal, pair%weight)/sum(pair%weight)
    if (present(turn)) pair%turn = turn
    allocate (tie(pair%dimension))
    do c = 1, pair%dimension
      pair%normal = 0
      pair%normal(c, :) = 1
      pair%row_normal = 0
      pair%row_normal(c, :) = 1
      tie(c) = pair
    end do
  end subroutine discretize_tie

  !> Displacements of the slave surface at the ends of the arms, where the tractions of the tie act, as combinations of
  !> those of the nodes of its facets.
  subroutine set_arms(mesh_a, surface_a, mesh_b, surface_b, pair, distance, error)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    type(contact_pair_t), intent(inout) :: pair  !! Points are given; gets the parts of the arms.
    real(dp), intent(out) :: distance  !! Length of the longest arm [length].
    type(error_t), allocatable, intent(out) :: error  !! A facet has no area.
    real(dp) :: shape(max_facet_nodes), gradient(pair%dimension - 1, max_facet_nodes), r(pair%dimension)
    real(dp) :: tangent(pair%dimension, pair%dimension - 1), metric(pair%dimension - 1, pair%dimension - 1)
    real(dp) :: along(pair%dimension - 1, max_facet_nodes + 1)
    integer :: q, m, j, f
    distance = 0
    allocate (pair%arm_shape(max_facet_nodes, pair%n_points), &
              pair%arm_gradient(pair%dimension, max_facet_nodes, pair%n_points), &
              pair%arm_normal(pair%dimension, pair%n_points), source=0.0_dp)
    do q = 1, pair%n_points
      f = pair%facet_b(q)
      m = kind_nodes(surface_b%kind(f))
      call shape_functions(surface_b%kind(f), pair%xi_b(:, q), shape(:m))
      r = matmul(mesh_b%x(:, surface_b%node(:m, f)), shape(:m))
      f = pair%facet_a(q)
      m = kind_nodes(surface_a%kind(f))
      call shape_functions(surface_a%kind(f), pair%xi_a(:, q), shape(:m))
      call shape_gradients(surface_a%kind(f), pair%xi_a(:, q), gradient(:, :m))
      associate (x => mesh_a%x(:, surface_a%node(:m, f)))
        r = r - matmul(x, shape(:m))
        tangent = matmul(x, transpose(gradient(:, :m)))
      end associate
      distance = max(distance, norm2(r))
      pair%position(:, q) = pair%position(:, q) + r
      metric = matmul(transpose(tangent), tangent)
      along(:, 1) = matmul(r, tangent)
      along(:, 2:m + 1) = gradient(:, :m)
      call solve_dense(metric, along(:, :m + 1), error)
      if (allocated(error)) return
      pair%arm_normal(:, q) = r - matmul(tangent, along(:, 1))
      do j = 1, m
        pair%arm_shape(j, q) = dot_product(gradient(:, j), along(:, 1))
        pair%arm_gradient(:, j, q) = matmul(tangent, along(:, j + 1))
      end do
    end do
  end subroutine set_arms

  !> Mean size of the facets of a surface, the side of a square of the same area [length].
  real(dp) function facet_size(mesh, surface) result(mean)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(surface_t), intent(in) :: surface  !! The surface.
    integer :: f
    mean = 0
    do f = 1, surface%n_facets
      associate (x => mesh%x(:, surface%node(:kind_nodes(surface%kind(f)), f)))
        mean = mean + maxval(maxval(x, dim=2) - minval(x, dim=2))
      end associate
    end do
    mean = mean/max(1, surface%n_facets)
  end function facet_size

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
end module dotyk_contact_tie
