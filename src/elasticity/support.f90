!> Supports: prescribed displacements on surfaces, equation (4), along global axes or along those of the surface; on
!> edges and nodes along global axes.
!>
!> Values are three numbers in any dimension: along x, y, z, or along xi, eta, n where `fix` names axes of the surface
!> (z and eta are not used in two dimensions); n is the outward normal. Each support contributes Dirichlet conditions
!> `direction . u = value` at the nodes of its surface; the conditions of each node are combined to nodal axes
!> (`dotyk_elasticity_node_axes`).
module dotyk_elasticity_support
  use dotyk_base_directions, only: directions_t
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: point_text, quoted, text_t, to_text
  use dotyk_base_thresholds, only: same_number, same_place
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_node_axes, only: combine_conditions, nodal_vector_list_t, node_axes_t
  use dotyk_elasticity_support_directions, only: support_directions_t
  use dotyk_elasticity_vector_field, only: vector_field_t, vector_text
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension, kind_nodes, max_facet_nodes, &
    reference_nodes
  use dotyk_mesh_facet, only: facet_geometry, frame_of_normal
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  implicit none
  private

  !> Smallest cosine of the angle of two normals of one smooth face: 20 degrees. Facets of coarse meshes of curved
  !> surfaces meet at smaller angles, edges of machine parts at larger ones.
  real(dp), parameter :: least_cosine = 0.939692620785908_dp

  type, public :: support_t  !! One support.
    type(surface_t) :: surface  !! The surface.
    integer :: line = 0  !! Line of the input, for messages; 0: unknown.
    type(directions_t) :: fix  !! Directions of prescribed displacements.
    real(dp) :: value(3) = 0  !! Prescribed displacement (3) [length].
    type(text_t), allocatable :: formula(:)  !! By components; an empty one keeps the value; or not allocated (3).
  end type support_t

  public :: collect_supports

contains

  !> Equations and prescribed displacements of a body from all its supports.
  !>
  !> At a node on several surfaces, or on several faces of one, the conditions of all directions count. Normals of a
  !> surface, or of surfaces with the same `fix`, that are within 20 degrees are averaged; others count separately. In
  !> axisymmetric analyses nodes on the axis have no radial displacement.
  subroutine collect_supports(mesh, analysis, supports, constraint, error, directions)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(support_t), intent(in) :: supports(:)  !! Supports of the body (n_supports).
    type(constraint_t), intent(out) :: constraint  !! Equations, prescribed displacements and nodal axes.
    !> Allocated where a formula does not parse or has no value at a node, or where supports contradict each other.
    type(error_t), allocatable, intent(out) :: error
    type(support_directions_t), intent(out), optional :: directions  !! Prescribed directions, for reactions.
    type(nodal_vector_list_t) :: conditions, faces
    type(vector_field_t) :: fields(size(supports))
    type(text_t) :: place(size(supports))
    integer :: s
    call constraint%init(mesh%dimension, mesh%n_nodes())
    call conditions%init(mesh%dimension)
    call faces%init(mesh%dimension)
    do s = 1, size(supports)
      call fields(s)%init(supports(s)%value, error, supports(s)%formula)
      if (.not. allocated(error)) then
        if (supports(s)%fix%local) then
          call add_face_normals(mesh%x, supports(s)%surface, s, faces)
        else
          call add_global_conditions(mesh%x, supports(s)%surface, s, supports(s)%fix%fixed, fields(s), conditions, &
                                     error)
        end if
      end if
      if (allocated(error)) then
        call add_context(error, 'support of surface '//quoted(supports(s)%surface%name)//': ')
        exit
      end if
    end do
    if (.not. allocated(error)) call add_local_conditions(mesh%x, supports, fields, faces, conditions, error)
    do s = 1, size(supports)
      call fields(s)%destroy()
    end do
    if (allocated(error)) return
    if (analysis == analysis_axisymmetric) call add_axis_conditions(mesh%x, conditions)
    call apply_conditions(mesh, supports, conditions, constraint, error)
    if (allocated(error)) return
    call constraint%number_equations()
    if (.not. present(directions)) return
    do s = 1, size(supports)
      place(s)%s = supports(s)%surface%name
    end do
    call directions%init(place, [(supports(s)%surface%is_concentrated(), s=1, size(supports))], conditions, &
                         mesh%n_nodes())
  end subroutine collect_supports

  !> Add the Dirichlet conditions of a support in global axes at the nodes of its surface.
  subroutine add_global_conditions(x, surface, s, fixed, field, conditions, error)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface of the support.
    integer, intent(in) :: s  !! Index of the support.
    logical, intent(in) :: fixed(3)  !! Whether the displacements along x, y, z are prescribed (3).
    type(vector_field_t), intent(in) :: field  !! Prescribed displacement [length].
    type(nodal_vector_list_t), intent(inout) :: conditions  !! Dirichlet conditions, added to.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula has no value at a node.
    integer, allocatable :: nodes(:)
    real(dp) :: value(3), axis(size(x, 1))
    integer :: i, k
    call surface_nodes(surface, nodes)
    do i = 1, size(nodes)
      call field%evaluate(x(:, nodes(i)), value, error)
      if (allocated(error)) return
      do k = 1, size(axis)
        if (.not. fixed(k)) cycle
        axis = 0
        axis(k) = 1
        call conditions%add(nodes(i), s, axis, value(k))
      end do
    end do
  end subroutine add_global_conditions

  !> Add the Dirichlet conditions of supports in axes of their surfaces, face by face.
  subroutine add_local_conditions(x, supports, fields, faces, conditions, error)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    type(support_t), intent(in) :: supports(:)  !! Supports of the body (n_supports).
    type(vector_field_t), intent(in) :: fields(:)  !! Prescribed displacements (n_supports) [length].
    type(nodal_vector_list_t), intent(in) :: faces  !! Normals of the facets at the nodes.
    type(nodal_vector_list_t), intent(inout) :: conditions  !! Dirichlet conditions, added to.
    type(error_t), allocatable, intent(out) :: error  !! Where a formula has no value at a node; names the surface.
    integer, allocatable :: first(:), order(:), signature(:), group(:)
    real(dp), allocatable :: normal(:, :), area(:), mean(:, :)
    integer :: node, g, i, n, dim, n_groups
    dim = size(x, 1)
    call faces%by_node(size(x, 2), first, order)
    do node = 1, size(x, 2)
      n = first(node + 1) - first(node)
      if (n == 0) cycle
      associate (here => order(first(node):first(node + 1) - 1))
        normal = faces%direction(:, here)
        area = faces%value(here)
        signature = [(sum(merge([1, 2, 4], 0, supports(faces%source(here(i)))%fix%fixed)), i=1, n)]
        if (allocated(group)) deallocate (group, mean)
        allocate (group(n), mean(dim, n))
        call group_normals(dim, n, normal, area, signature, group, n_groups, mean)
        do g = 1, n_groups
          do i = 1, n
            if (group(i) /= g) cycle
            ! Each support of a group contributes once.
            if (any(group(:i - 1) == g .and. faces%source(here(:i - 1)) == faces%source(here(i)))) cycle
            call add_face_conditions(x(:, node), node, mean(:, g), faces%source(here(i)), &
                                     supports(faces%source(here(i)))%fix%fixed, fields(faces%source(here(i))), &
                                     conditions, error)
            if (allocated(error)) then
              call add_context(error, 'support of surface '//quoted(supports(faces%source(here(i)))%surface%name)//': ')
              return
            end if
          end do
        end do
      end associate
    end do
  end subroutine add_local_conditions

  !> Add the Dirichlet conditions of one support at a node on one smooth face.
  subroutine add_face_conditions(x, node, normal, s, fixed, field, conditions, error)
    real(dp), intent(in) :: x(:)  !! Position of the node (dim) [length].
    integer, intent(in) :: node  !! The node.
    real(dp), intent(in) :: normal(:)  !! Unit normal of the face (dim) [].
    integer, intent(in) :: s  !! Index of the support.
    logical, intent(in) :: fixed(3)  !! Whether the displacements along xi, eta, n are prescribed (3).
    type(vector_field_t), intent(in) :: field  !! Prescribed displacement along xi, eta, n [length].
    type(nodal_vector_list_t), intent(inout) :: conditions  !! Dirichlet conditions, added to.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula has no value at the node.
    real(dp) :: value(3), frame(size(x), size(x))
    call field%evaluate(x, value, error)
    if (allocated(error)) return
    call frame_of_normal(size(x), normal, frame)
    if (fixed(1)) call conditions%add(node, s, frame(:, 1), value(1))
    if (fixed(2)) call conditions%add(node, s, frame(:, 2), value(2))
    if (fixed(3)) call conditions%add(node, s, frame(:, size(x)), value(3))
  end subroutine add_face_conditions

  !> Add the conditions of symmetry: nodes on the axis of an axisymmetric body have no radial displacement.
  subroutine add_axis_conditions(x, conditions)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (2, n_nodes) [length].
    type(nodal_vector_list_t), intent(inout) :: conditions  !! Dirichlet conditions, added to.
    real(dp) :: body_size
    integer :: i
    body_size = max(maxval(abs(x(1, :))), maxval(x(2, :)) - minval(x(2, :)))
    do i = 1, size(x, 2)
      if (abs(x(1, i)) <= same_number*body_size) call conditions%add(i, 0, [1.0_dp, 0.0_dp], 0.0_dp)
    end do
  end subroutine add_axis_conditions

  !> Combine the conditions node by node to nodal axes and prescribed displacements.
  subroutine apply_conditions(mesh, supports, conditions, constraint, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(support_t), intent(in) :: supports(:)  !! Supports of the body, for messages (n_supports).
    type(nodal_vector_list_t), intent(in) :: conditions  !! Dirichlet conditions.
    type(constraint_t), intent(inout) :: constraint  !! Equations, prescribed displacements and nodal axes.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where supports contradict each other.
    type(node_axes_t) :: axes
    integer, allocatable :: first(:), order(:)
    real(dp), allocatable :: frame(:, :, :), direction(:, :), value(:)
    real(dp) :: tolerance
    integer :: node, n, n_frames, dim
    dim = mesh%dimension
    tolerance = 0
    if (conditions%n > 0) tolerance = same_number*maxval(abs(conditions%value(:conditions%n)))
    call conditions%by_node(mesh%n_nodes(), first, order)
    n_frames = 0
    allocate (frame(dim, dim, count(first(2:mesh%n_nodes() + 1) > first(:mesh%n_nodes()))))
    do node = 1, mesh%n_nodes()
      n = first(node + 1) - first(node)
      if (n == 0) cycle
      direction = conditions%direction(:, order(first(node):first(node + 1) - 1))
      value = conditions%value(order(first(node):first(node + 1) - 1))
      axes = combine_conditions(dim, n, direction, value, tolerance)
      if (axes%contradiction > 0) then
        associate (source => conditions%source(order(first(node):first(node + 1) - 1)), &
                   along => abs(matmul(direction(:, axes%contradiction), direction)))
          call contradiction_error(mesh, supports, node, pack(source, along > same_place), axes, &
                                   direction(:, axes%contradiction), error)
        end associate
        return
      end if
      where (axes%is_given(:dim)) constraint%equation(:, node) = held
      constraint%prescribed(:, node) = axes%value(:dim)
      if (axes%is_global) cycle
      n_frames = n_frames + 1
      frame(:, :, n_frames) = axes%frame(:dim, :dim)
      constraint%frame_of(node) = n_frames
    end do
    constraint%frame = frame(:, :, :n_frames)
  end subroutine apply_conditions

  !> Create the error of supports that contradict each other at a node.
  subroutine contradiction_error(mesh, supports, node, source, axes, direction, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(support_t), intent(in) :: supports(:)  !! Supports of the body (n_supports).
    integer, intent(in) :: node  !! The node.
    !> Supports of the conditions at the node that are not perpendicular to this one; 0 for the axis of symmetry (n).
    integer, intent(in) :: source(:)
    type(node_axes_t), intent(in) :: axes  !! Nodal axes with the contradicting condition.
    real(dp), intent(in) :: direction(:)  !! Direction of this condition (dim) [].
    type(error_t), allocatable, intent(out) :: error  !! Names node, surfaces, direction and both displacements.
    character(:), allocatable :: names, name
    real(dp) :: unit(size(direction)), sign
    integer :: i
    names = ''
    do i = 1, size(source)
      if (any(source(:i - 1) == source(i))) cycle
      name = 'the axis of symmetry'
      if (source(i) > 0) then
        name = quoted(supports(source(i))%surface%name)
        if (supports(source(i))%line > 0) name = name//' of line '//to_text(supports(source(i))%line)
      end if
      if (len(names) > 0) names = names//', '
      names = names//name
    end do
    unit = direction
    ! Along an axis rather than against it, so that the numbers look like those of the input.
    sign = 1
    if (maxval(unit) < maxval(abs(unit))) sign = -1
    unit = sign*unit
    call set_error(error, 'contradictory supports at node '//to_text(mesh%node_tag(node))//' at '// &
                   point_text(mesh%x(:, node))//' (surfaces '//names//'): the displacement along '// &
                   vector_text(unit, 1.0_dp)//' is prescribed as '//to_text(sign*axes%implied_value)//' and as '// &
                   to_text(sign*axes%conflicting_value), exit_bad_input)
  end subroutine contradiction_error

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
    integer, intent(out) :: group(n)  !! Group of each normal; groups are numbered in the order of their first normals.
    integer, intent(out) :: n_groups  !! Number of groups.
    real(dp), intent(out) :: mean(dim, n)  !! Mean unit normals, weighted with areas; n_groups columns (dim, n) [].
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
      if (.not. norm2(mean(:, n_groups)) > same_place*area(i)) mean(:, n_groups) = normal(:, i)
      mean(:, n_groups) = mean(:, n_groups)/norm2(mean(:, n_groups))
    end do
  end subroutine group_normals
end module dotyk_elasticity_support
