!> Normals of the slave surfaces at the points of contact pairs, whose own normals are those of the master surfaces, and
!> how the rows of rigid body modes change where they are taken.
module dotyk_control_slave_normals
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: half_digits, sharp_cosine
  use dotyk_contact_operator, only: build_operator, contact_block_t, contact_operator_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_mesh_element, only: element_line2, element_quad4, element_tri3, kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t
  implicit none
  private
  public :: find_deviations

  !> Normals of two surfaces that touch differ by less than 25 degrees, those of coarse facets, too.
  real(dp), parameter :: least_cosine = cos(25*acos(-1.0_dp)/180)

contains

  !> How uncertain the rows of the modes are: their change where the normals of the slave surfaces are taken.
  subroutine find_deviations(problem, block, modes, coarse)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    type(contact_modes_t), intent(in) :: modes(:)  !! The modes at the contact nodes (n_bodies).
    !> Gets `deviation`, 0 for rows of ties, unless all normals agree or all bodies are held.
    type(coarse_space_t), intent(inout) :: coarse
    type(contact_pair_t), allocatable :: pair(:)
    type(contact_operator_t) :: operator
    logical :: differ
    integer :: b, j, k
    if (coarse%n == 0) return
    allocate (pair(size(problem%pair)))
    differ = .false.
    do k = 1, size(pair)
      pair(k) = problem%pair(k)
      call take_slave_normals(problem%body(pair(k)%body_a)%mesh%x, problem%surface_a(k), pair(k))
      differ = differ .or. any(norm2(pair(k)%normal - problem%pair(k)%normal, 1) > half_digits)
    end do
    if (.not. differ) return
    call build_operator(size(problem%body(1)%mesh%x, 1), size(problem%body), pair, problem%surface_a, &
                        problem%surface_b, operator)
    allocate (coarse%deviation(size(modes)))
    do b = 1, size(modes)
      associate (of_body => coarse%deviation(b), n => size(modes(b)%resultant), &
                 n_contact => size(operator%block(b)%row))
        allocate (of_body%value(size(block(b)%row), size(coarse%block(b)%value, 2)), source=0.0_dp)
        do j = 1, n
          ! Rows of ties come behind those of contact.
          if (n_contact == 0) cycle
          associate (scale => coarse%scale(coarse%first(b) + j - 1))
            call operator%block(b)%matrix%multiply(scale*modes(b)%displacement(components(b), j), &
                                                   of_body%value(:n_contact, j))
          end associate
        end do
        of_body%value(:n_contact, :) = of_body%value(:n_contact, :) - coarse%block(b)%value(:n_contact, :)
      end associate
    end do

  contains

    !> Components of the nodes of contact pairs among those of all contact nodes, which ties have, too.
    pure function components(b) result(component)
      integer, intent(in) :: b  !! The body.
      integer, allocatable :: component(:)
      integer :: place(maxval(block(b)%contact_node)), c, i
      associate (dim => operator%dimension, node => operator%block(b)%contact_node)
        place(block(b)%contact_node) = [(i, i=1, size(block(b)%contact_node))]
        component = [((dim*(place(node(i)) - 1) + c, c=1, dim), i=1, size(node))]
      end associate
    end function components
  end subroutine find_deviations

  !> Replace the normals of a pair by those of its slave surface: of the elements where they are curved, interpolated
  !> between the vertices where they are linear.
  subroutine take_slave_normals(x, surface, pair)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the slave body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Slave surface.
    type(contact_pair_t), intent(inout) :: pair  !! Its normals are replaced.
    real(dp) :: position(pair%dimension), normal(pair%dimension), jacobian, shape(max_facet_nodes)
    real(dp), allocatable :: of_facet(:, :), at_vertex(:, :)
    integer, allocatable :: first(:), around(:)
    logical, allocatable :: at_edge(:)
    integer :: q, k, i, f
    allocate (of_facet(pair%dimension, surface%n_facets))
    call facet_normals(x, surface, of_facet)
    call facets_of_nodes(surface, first, around)
    allocate (at_vertex(pair%dimension, max_facet_nodes))
    at_edge = [(has_edge(of_facet(:, around(first(i):first(i + 1) - 1))), i=1, size(first) - 1)]
    ! Vertices and edges have no normal of their own.
    do q = 1, pair%n_points - pair%n_point_contacts
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
                  sharp_cosine*norm2(of_facet(:, around(i)))*norm2(of_facet(:, f))) cycle
              at_vertex(:, k) = at_vertex(:, k) + of_facet(:, around(i))
            end do
            normal = normal + shape(k)*at_vertex(:, k)/max(tiny(jacobian), norm2(at_vertex(:, k)))
          end do
          normal = normal/max(tiny(jacobian), norm2(normal))
        end if
      end associate
      ! Flanks beside sharp edges, as those of chamfers, are no other view of the same normal.
      if (any(at_edge(surface%node(:kind_nodes(surface%kind(f)), f))) .and. &
          dot_product(normal, pair%normal(:, q)) <= least_cosine) cycle
      if (norm2(normal) > 0) pair%normal(:, q) = normal
    end do
  end subroutine take_slave_normals

  !> Whether normals of facets at a node differ by more than at a sharp edge.
  pure logical function has_edge(normal)
    real(dp), intent(in) :: normal(:, :)  !! The normals, of any length (dimension, n) [any].
    integer :: i
    has_edge = .false.
    do i = 2, size(normal, 2)
      has_edge = dot_product(normal(:, i), normal(:, 1)) <= sharp_cosine*norm2(normal(:, i))*norm2(normal(:, 1))
      if (has_edge) return
    end do
  end function has_edge

  !> Normals of the middle of facets, as long as the facets are large.
  subroutine facet_normals(x, surface, normal)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(out) :: normal(:, :)  !! (dimension, n_facets) [length^2; length in two dimensions].
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
    type(surface_t), intent(in) :: surface  !! The surface.
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
