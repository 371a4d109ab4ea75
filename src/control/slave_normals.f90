!> Normals of the slave surface at the points of a contact pair, whose own normals are those of the master surface.
module dotyk_control_slave_normals
  use dotyk_base_kinds, only: dp
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_mesh_element, only: element_line2, element_quad4, element_tri3, kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: take_slave_normals

  !> Facets at a vertex belong to one smooth surface if their normals differ by less than 40 degrees.
  real(dp), parameter :: smooth_cosine = 0.766_dp

contains

  !> Replace the normals of a pair by those of its slave surface: of the elements where they are curved, interpolated
  !> between the vertices where they are linear.
  subroutine take_slave_normals(x, surface, pair)
    !> Nodes of the slave body (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Slave surface.
    type(surface_t), intent(in) :: surface
    !> Its normals are replaced.
    type(contact_pair_t), intent(inout) :: pair
    real(dp) :: position(pair%dimension), normal(pair%dimension), jacobian, shape(max_facet_nodes)
    real(dp), allocatable :: of_facet(:, :), at_vertex(:, :)
    integer, allocatable :: first(:), around(:)
    integer :: q, k, i, f
    allocate (of_facet(pair%dimension, surface%n_facets))
    call facet_normals(x, surface, of_facet)
    call facets_of_nodes(surface, first, around)
    allocate (at_vertex(pair%dimension, max_facet_nodes))
    do q = 1, pair%n_points
      f = pair%facet_a(q)
      associate (kind => surface%kind(f), node => surface%node(:kind_nodes(surface%kind(f)), f))
        call facet_geometry(kind, pair%dimension, x(:, node), pair%xi_a(:, q), position, normal, jacobian)
        if (any(kind == [element_line2, element_tri3, element_quad4])) then
          call shape_functions(kind, pair%xi_a(:, q), shape)
          normal = 0
          do k = 1, size(node)
            at_vertex(:, k) = 0
            do i = first(node(k)), first(node(k) + 1) - 1
              if (dot_product(of_facet(:, around(i)), of_facet(:, f)) <= &
                  smooth_cosine*norm2(of_facet(:, around(i)))*norm2(of_facet(:, f))) cycle
              at_vertex(:, k) = at_vertex(:, k) + of_facet(:, around(i))
            end do
            normal = normal + shape(k)*at_vertex(:, k)/max(tiny(jacobian), norm2(at_vertex(:, k)))
          end do
          normal = normal/max(tiny(jacobian), norm2(normal))
        end if
      end associate
      if (norm2(normal) > 0) pair%normal(:, q) = normal
    end do
  end subroutine take_slave_normals

  !> Normals of the middle of facets, as long as the facets are large.
  subroutine facet_normals(x, surface, normal)
    !> Nodes of the body (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> The surface.
    type(surface_t), intent(in) :: surface
    !> (dimension, n_facets) [length^2; length in two dimensions].
    real(dp), intent(out) :: normal(:, :)
    real(dp) :: position(size(x, 1)), middle(size(x, 1) - 1), jacobian
    integer :: f
    do f = 1, surface%n_facets
      associate (kind => surface%kind(f))
        middle = merge(1.0_dp/3, 0.0_dp, kind == element_tri3)
        call facet_geometry(kind, size(x, 1), x(:, surface%node(:kind_nodes(kind), f)), middle, position, &
                            normal(:, f), jacobian)
        normal(:, f) = jacobian*normal(:, f)
      end associate
    end do
  end subroutine facet_normals

  !> The facets at each node.
  pure subroutine facets_of_nodes(surface, first, facet)
    !> The surface.
    type(surface_t), intent(in) :: surface
    !> Facets of node i are facet(first(i):first(i+1)-1) (largest node + 1).
    integer, allocatable, intent(out) :: first(:), facet(:)
    integer, allocatable :: next(:)
    integer :: f, k, n
    n = maxval(surface%node)
    allocate (first(n + 1), source=0)
    do f = 1, surface%n_facets
      do k = 1, kind_nodes(surface%kind(f))
        first(surface%node(k, f) + 1) = first(surface%node(k, f) + 1) + 1
      end do
    end do
    first(1) = 1
    do k = 1, n
      first(k + 1) = first(k) + first(k + 1)
    end do
    next = first
    allocate (facet(first(n + 1) - 1))
    do f = 1, surface%n_facets
      do k = 1, kind_nodes(surface%kind(f))
        associate (entry => next(surface%node(k, f)))
          facet(entry) = f
          entry = entry + 1
        end associate
      end do
    end do
  end subroutine facets_of_nodes

end module dotyk_control_slave_normals
