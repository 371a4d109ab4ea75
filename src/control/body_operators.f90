!> What the schemes get of the bodies: the modes that they solve for, and the compliance operators.
!>
!> Rows of the modes are uncertain by as much as they change where the normals are those of the slave surfaces in place
!> of those of the master surfaces.
module dotyk_control_body_operators
  use dotyk_base_error, only: error_slot_t, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: half_digits, sharp_cosine, smooth_cosine
  use dotyk_contact_operator, only: build_operator, contact_block_t, contact_operator_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_response_choice, only: operator_slot_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_mesh_element, only: element_line2, element_quad4, element_tri3, kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: item_t, share, share_errors
  use dotyk_response_response, only: response_slot_t
  use dotyk_response_stiffness_factor, only: factorization_report_t, separate_by_contact
  use dotyk_scheme_body_compliance, only: body_operator_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t
  implicit none
  private
  public :: find_modes, make_operators, find_deviations

contains

  !> The modes that the scheme solves for: near-null-space modes where the factorization found them, rigid body modes
  !> elsewhere.
  subroutine find_modes(body, classes, ranks, block, report, modes, at_contact, error)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Classes of congruent bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    type(factorization_report_t), intent(in) :: report(:)  !! Reports of the representatives (n_bodies).
    !> Rigid body modes; those that are near-null-space modes are replaced (n_bodies).
    type(body_modes_t), intent(inout) :: modes(:)
    type(contact_modes_t), allocatable, intent(out) :: at_contact(:)  !! The modes at the contact nodes (n_bodies).
    !> Allocated where a mode at the contact rows is not finite, or LAPACK's singular value decomposition does not
    !> converge.
    type(error_t), allocatable, intent(out) :: error
    type(item_t) :: item(size(body))
    type(error_slot_t) :: failed(size(body))
    integer :: b
    allocate (at_contact(size(body)))
    do b = 1, size(body)
      associate (of_class => report(classes%first(b)))
        if (of_class%n_near_null == 0 .or. .not. ranks%is_own(b)) cycle
        call take_near_null(body(b), block(b), of_class, modes(b), failed(b)%error)
        if (n_ranks() > 1 .and. .not. allocated(failed(b)%error)) &
          call modes(b)%pack_near_null(body(b)%shared_node, item(b)%value)
      end associate
    end do
    call share_errors(ranks%owner, failed)
    do b = 1, size(body)
      if (.not. allocated(failed(b)%error)) cycle
      call move_alloc(failed(b)%error, error)
      return
    end do
    call share(ranks%owner, item)
    do b = 1, size(body)
      if (.not. ranks%is_own(b) .and. report(classes%first(b))%n_near_null > 0) &
        call modes(b)%unpack_near_null(body(b)%mesh%n_nodes(), body(b)%shared_node, item(b)%value)
      at_contact(b)%displacement = reshape(modes(b)%shape(:, block(b)%contact_node, :), &
                                           [size(modes(b)%shape, 1)*size(block(b)%contact_node), modes(b)%n])
      at_contact(b)%resultant = modes(b)%resultant
      at_contact(b)%resultant_size = modes(b)%resultant_size
      at_contact(b)%mean_square = 1.0_dp/max(1, body(b)%mesh%n_whole_nodes())
      if (.not. modes(b)%is_near_null()) then
        at_contact(b)%translation = modes(b)%rigid%translations()
        cycle
      end if
      at_contact(b)%stiffness = modes(b)%stiffness
      at_contact(b)%lift_resultant = modes(b)%lift_resultant
    end do
  end subroutine find_modes

  !> The near-null-space modes of one body, separated by what its contact rows feel.
  subroutine take_near_null(body, block, report, modes, error)
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(contact_block_t), intent(in) :: block  !! Its rows of B.
    type(factorization_report_t), intent(in) :: report  !! Report of the representative.
    type(body_modes_t), intent(inout) :: modes  !! Replaced by the near-null-space modes.
    type(error_t), allocatable, intent(out) :: error  !! As in `find_modes`.
    real(dp), allocatable :: mode(:, :), stiffness(:, :), at_rows(:, :), u(:, :)
    integer :: k
    allocate (mode, mold=report%near_null)
    mode = report%near_null
    stiffness = report%near_null_stiffness
    allocate (at_rows(size(block%row), size(mode, 2)), u(body%dimension, body%mesh%n_nodes()))
    do k = 1, size(mode, 2)
      if (size(block%row) == 0) cycle
      call body%constraint%expand(mode(:, k), u, .false.)
      call block%matrix%multiply(reshape(u(:, block%contact_node), [body%dimension*size(block%contact_node)]), &
                                 at_rows(:, k))
    end do
    call separate_by_contact(at_rows, mode, stiffness, error)
    if (.not. allocated(error)) call modes%take_near_null(body, mode, stiffness)
  end subroutine take_near_null

  !> What the compliance of all bodies is made of.
  subroutine make_operators(body, classes, ranks, block, report, size_of, slot, response, operators)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Classes of congruent bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    type(factorization_report_t), intent(in) :: report(:)  !! Reports of the representatives (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    type(operator_slot_t), intent(inout) :: slot(:)  !! Factorized; empty on return (n_bodies).
    !> Compliance operators of the representatives (n_bodies).
    type(response_slot_t), allocatable, intent(out) :: response(:)
    !> Parts of the compliance that belong to each body (n_bodies).
    type(body_operator_t), allocatable, intent(out) :: operators(:)
    type(item_t) :: diagonal(size(body))
    integer :: b
    allocate (response(size(body)), operators(size(body)))
    do b = 1, size(body)
      if (allocated(slot(b)%direct)) call move_alloc(slot(b)%direct, response(b)%form)
      if (allocated(slot(b)%multigrid)) call move_alloc(slot(b)%multigrid, response(b)%form)
      associate (own => operators(b), d => body(b)%dimension)
        own%representative = classes%first(b)
        own%rotation = classes%motion(b)%rotation(:d, :d)
        call own%map%init(body(b)%constraint, block(b)%contact_node)
        if (ranks%is_own(b)) diagonal(b)%value = own%map%diagonal(report(classes%first(b))%diagonal)
        own%cost = real(size_of(b)%product_entries, dp)
        own%owner = ranks%owner(b)
      end associate
    end do
    call share(ranks%owner, diagonal)
    do b = 1, size(body)
      call move_alloc(diagonal(b)%value, operators(b)%nodal_stiffness)
    end do
  end subroutine make_operators

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
          dot_product(normal, pair%normal(:, q)) <= smooth_cosine) cycle
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
end module dotyk_control_body_operators
