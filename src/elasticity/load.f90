!> Loads as consistent nodal forces: tractions and pressures on surfaces, equation (5), force densities in bodies, those
!> of a rotation among them. With all L(v) is a continuous linear form, equation (16).
!>
!> A positive pressure pushes into the body. A local traction has its components along xi, eta, n of the surface with
!> n the outward normal; eta is not used in two dimensions. Forces on plane bodies are per unit thickness, forces on
!> axisymmetric ones are those on the full circumference.
!>
!> A total force F and moment M on a surface, spread as a traction that is linear in the position,
!>
!>     t(x) = a + b x (x - c),   a = F/A,   b = J^-1 (M + (p - c) x F),
!>
!> the distributing coupling with area weights: A is the area, c the centroid, J = int |r|^2 I - r r^T dA, r = x - c,
!> and p the point that F and M refer to. Area, centroid and J have the quadrature of the load: the resultants of the
!> nodal forces are F and M to rounding on any mesh, curved facets included. A force in the plane of the surface through
!> its centroid is a uniform shear traction; a moment about an axis in the plane of a flat surface is the linear normal
!> traction of beam theory.
!>
!> On edges dA is the length and tractions are forces per length; on nodes it is 1 for each, as for the nodal forces of
!> other programs, and tractions are the forces of the nodes.
!>
!> Balance of the centrifugal forces of a floating body. A free body turns about an axis through its centroid; that of
!> its mesh may be beside the axis by the accuracy of the mesh, and the forces then have resultants that nothing holds.
module dotyk_elasticity_load
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_acceleration, load_angular_velocity, load_force_density, &
    load_local_traction, load_pressure, load_total, load_traction
  use dotyk_base_text, only: quoted, text_t
  use dotyk_base_thresholds, only: given_rounding, shape_rounding
  use dotyk_elasticity_analysis, only: gradient_slots, two_pi
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_element_quadrature, only: inverted_element_error
  use dotyk_elasticity_face_table, only: local_face, point_of_element
  use dotyk_elasticity_point_forces, only: point_forces_t
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_elasticity_shape_table, only: load_degree, map_element, shape_table_pair_t, shape_table_t
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_linalg_dense, only: factorize_gram, right_singular_vectors, solve_gram
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_point, kind_nodes, n_element_kinds, &
    quadrature_rule, reference_nodes, shape_functions
  use dotyk_mesh_facet, only: cross, facet_geometry, frame_of_normal
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: add_surface_load, add_volume_load, balance_centrifugal_force

  type, public :: load_t  !! One load. The place where it acts is an argument of the procedures.
    integer :: kind = load_traction  !! Kind of the load: one of the `load_*` constants.
    !> Value: a pressure in the first component, else a vector (3) [pressure], [force/volume], [1/time], or
    !> [force] of a total load.
    real(dp) :: value(3) = 0
    real(dp) :: centre(3) = 0  !! A point on the axis of an angular velocity (3) [length].
    !> Densities of the materials that an angular velocity or acceleration acts on (n_materials) [mass/volume].
    real(dp), allocatable :: density(:)
    type(text_t), allocatable :: density_formula(:)  !! Their formulas; empty where the number holds (n_materials).
    type(text_t), allocatable :: formula(:)  !! By components; an empty one keeps the value; or not allocated (3).
    real(dp) :: moment(3) = 0  !! Moment of a total load (3) [force length].
    !> Point that force and moment of a total load refer to; the centroid of the surface where not allocated (3)
    !> [length].
    real(dp), allocatable :: point(:)
  end type load_t

  type :: facet_rule_t  !! Shape functions of a facet kind at the points of its quadrature rule.
    real(dp), allocatable :: point(:, :)  !! Reference coordinates (dim - 1, n_points) [].
    real(dp), allocatable :: weight(:)  !! Reference weights (n_points) [].
    real(dp), allocatable :: shape(:, :)  !! Shape functions (n_nodes, n_points) [].
  end type facet_rule_t

contains

  !> Add the nodal forces of a load on a surface.
  subroutine add_surface_load(mesh, analysis, surface, load, force, error, points)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(surface_t), intent(in) :: surface  !! The surface.
    type(load_t), intent(in) :: load  !! Traction, pressure, local traction, or a total load.
    real(dp), intent(inout) :: force(:, :)  !! Nodal forces, added to (dim, n_nodes) [force].
    !> Allocated where a formula does not parse, or has no value at a quadrature point, or where the surface cannot take
    !> the total load; names the surface.
    type(error_t), allocatable, intent(out) :: error
    type(point_forces_t), intent(inout), optional :: points  !! The load at the quadrature points, added to.
    type(facet_rule_t) :: rule(0:n_element_kinds)
    type(vector_field_t) :: field
    integer :: f
    call field%init(load%value, error, load%formula)
    if (load%kind == load_total) &
      call spread_total_load(mesh, analysis, surface, load%value, load%moment, load%point, field, error)
    if (.not. allocated(error)) then
      do f = 1, surface%n_facets
        associate (kind => surface%kind(f))
          if (.not. allocated(rule(kind)%weight)) call make_rule(kind, rule(kind))
          call add_facet(kind, mesh%dimension, kind_nodes(kind), mesh%x, surface%node(:kind_nodes(kind), f), &
                         rule(kind), analysis == analysis_axisymmetric, load%kind, field, force, error)
        end associate
        if (allocated(error)) exit
        ! Other ranks have the elements of the other facets of a body in parts.
        if (present(points) .and. surface%element(f) > 0) call add_points(f)
      end do
    end if
    call field%destroy()
    call add_context(error, 'load on surface '//quoted(surface%name)//': ')

  contains

    !> Add the load on a facet at its quadrature points.
    subroutine add_points(f)
      integer, intent(in) :: f  !! Index of the facet.
      type(element_kind_t) :: kind
      real(dp) :: traction(mesh%dimension), area
      integer :: element, face, q
      kind = element_kind(surface%kind(f))
      associate (block => mesh%block(surface%block(f)), node => surface%node(:kind%n_nodes, f))
        face = local_face(mesh, surface%block(f), surface%element(f), surface%node(:, f))
        element = surface%element(f) + sum([(size(mesh%block(q)%node, 2), q=1, surface%block(f) - 1)])
        do q = 1, size(rule(surface%kind(f))%weight)
          call traction_at(surface%kind(f), mesh%dimension, kind%n_nodes, mesh%x(:, node), &
                           rule(surface%kind(f))%point(:, q), rule(surface%kind(f))%weight(q), &
                           analysis == analysis_axisymmetric, load%kind, field, traction, area, error)
          if (allocated(error)) return
          call points%add(element, face, point_of_element(block%kind, block%node(:, surface%element(f)), &
                                                          kind%corner_kind, node(:kind%n_corners), &
                                                          rule(surface%kind(f))%point(:, q)), area*traction)
        end do
      end associate
    end subroutine add_points
  end subroutine add_surface_load

  !> Quadrature rule of a facet kind.
  subroutine make_rule(kind, rule)
    integer, intent(in) :: kind  !! Facet kind: one of the `element_*` constants.
    type(facet_rule_t), intent(out) :: rule  !! Shape functions at the points of the rule.
    type(element_kind_t) :: properties
    integer :: q
    properties = element_kind(kind)
    call quadrature_rule(kind, load_degree(properties%order), rule%point, rule%weight)
    allocate (rule%shape(properties%n_nodes, size(rule%weight)))
    do q = 1, size(rule%weight)
      call shape_functions(kind, rule%point(:, q), rule%shape(:, q))
    end do
  end subroutine make_rule

  !> Add the nodal forces on one facet.
  subroutine add_facet(kind, dim, n, x, node, rule, axisymmetric, load_kind, field, force, error)
    integer, intent(in) :: kind  !! Facet kind: one of the `element_*` constants.
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n  !! Number of nodes of the facet.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: node(n)  !! Nodes of the facet (n).
    type(facet_rule_t), intent(in) :: rule  !! Shape functions at the points of the rule.
    logical, intent(in) :: axisymmetric  !! Whether the analysis is axisymmetric.
    integer, intent(in) :: load_kind  !! Kind of the load: one of those on surfaces.
    type(vector_field_t), intent(in) :: field  !! Value of the load.
    real(dp), intent(inout) :: force(:, :)  !! Nodal forces, added to (dim, n_nodes) [force].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula has no value at a quadrature point.
    real(dp) :: corners(dim, n), traction(dim), area
    integer :: q, a
    corners = x(:, node)
    do q = 1, size(rule%weight)
      call traction_at(kind, dim, n, corners, rule%point(:, q), rule%weight(q), axisymmetric, load_kind, field, &
                       traction, area, error)
      if (allocated(error)) return
      do a = 1, n
        force(:, node(a)) = force(:, node(a)) + area*rule%shape(a, q)*traction
      end do
    end do
  end subroutine add_facet

  !> Traction at a point of a facet.
  subroutine traction_at(kind, dim, n, x, point, weight, axisymmetric, load_kind, field, traction, area, error)
    integer, intent(in) :: kind  !! Facet kind: one of the `element_*` constants.
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n  !! Number of nodes of the facet.
    real(dp), intent(in) :: x(dim, n)  !! Nodes of the facet (dim, n) [length].
    real(dp), intent(in) :: point(dim - 1)  !! Reference coordinates (dim - 1) [].
    real(dp), intent(in) :: weight  !! Reference weight [].
    logical, intent(in) :: axisymmetric  !! Whether the analysis is axisymmetric.
    integer, intent(in) :: load_kind  !! Kind of the load: one of those on surfaces.
    type(vector_field_t), intent(in) :: field  !! Value of the load.
    real(dp), intent(out) :: traction(dim)  !! Traction (dim) [pressure].
    !> Area of the point, of the full circumference in axisymmetric analyses [length^2; length in plane ones].
    real(dp), intent(out) :: area
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula has no value there.
    real(dp) :: position(dim), normal(dim), frame(dim, dim), value(3)
    traction = 0
    call facet_geometry(kind, dim, x, point, position, normal, area)
    area = area*weight
    ! The force of a node is that on the full circumference.
    if (axisymmetric .and. kind /= element_point) area = area*two_pi*position(1)
    call field%evaluate(position, value, error)
    if (allocated(error)) return
    select case (load_kind)
    case (load_pressure)
      traction = -value(1)*normal
    case (load_local_traction)
      call frame_of_normal(dim, normal, frame)
      traction = value(1)*frame(:, 1) + value(3)*frame(:, dim)
      if (dim == 3) traction = traction + value(2)*frame(:, 2)
    case default
      traction = value(:dim)
    end select
  end subroutine traction_at

  !> Add the nodal forces of a force density, given or that of a rotation.
  subroutine add_volume_load(mesh, analysis, load, force, error, points)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(load_t), intent(in) :: load  !! Force density, angular velocity or acceleration.
    real(dp), intent(inout) :: force(:, :)  !! Nodal forces, added to (dim, n_nodes) [force].
    !> Allocated where a formula does not parse or has no value at a quadrature point, or where an element is
    !> inverted.
    type(error_t), allocatable, intent(out) :: error
    type(point_forces_t), intent(inout), optional :: points  !! A varying force density at the points, added to.
    type(vector_field_t) :: field
    integer :: i
    if (load%kind == load_force_density) call field%init(load%value, error, load%formula)
    do i = 1, size(mesh%block)
      if (allocated(error)) exit
      associate (m => mesh%block(i)%material)
        if (load%kind == load_angular_velocity) then
          call field%init_affine(centrifugal(load%value, load%density(m)), load%centre)
        else if (load%kind == load_acceleration) then
          call field%init(load%density(m)*load%value, error)
        end if
        if (load%kind /= load_force_density .and. allocated(load%density_formula)) then
          if (len(load%density_formula(m)%s) > 0) call field%multiply_by_density(load%density_formula(m)%s, error)
        end if
      end associate
      if (allocated(error)) exit
      call add_block(mesh, i, analysis, field, force, error, points)
    end do
    call field%destroy()
    call add_context(error, 'force density: ')
  end subroutine add_volume_load

  !> Centrifugal force per volume by the position relative to a point on the axis: density (w.w I - w w^T) (3, 3)
  !> [force/volume/length].
  pure function centrifugal(velocity, density) result(slope)
    real(dp), intent(in) :: velocity(3)  !! Angular velocity w (3) [1/time].
    real(dp), intent(in) :: density  !! Density [mass/volume].
    real(dp) :: slope(3, 3)
    integer :: i
    slope = -density*spread(velocity, 2, 3)*spread(velocity, 1, 3)
    do i = 1, 3
      slope(i, i) = density*(sum(velocity**2, mask=[1, 2, 3] /= i))
    end do
  end function centrifugal

  !> Add the nodal forces of a force density on one block of elements.
  subroutine add_block(mesh, i_block, analysis, field, force, error, points)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(vector_field_t), intent(in) :: field  !! Force density.
    real(dp), intent(inout) :: force(:, :)  !! Nodal forces, added to (dim, n_nodes) [force].
    !> Allocated where a formula has no value at a quadrature point, or where an element is inverted.
    type(error_t), allocatable, intent(out) :: error
    type(point_forces_t), intent(inout), optional :: points  !! A varying force density at the points, added to.
    type(shape_table_pair_t) :: tables
    real(dp), allocatable :: xi(:, :)
    type(element_kind_t) :: kind
    real(dp), allocatable :: x(:, :), g(:), w(:)
    integer, allocatable :: node(:)
    integer :: e, n, dim, slots, most_points, before
    kind = element_kind(mesh%block(i_block)%kind)
    n = kind%n_nodes
    dim = mesh%dimension
    slots = gradient_slots(analysis)
    call tables%init_load(mesh%block(i_block)%kind, analysis, .not. field%constant)
    before = sum([(size(mesh%block(e)%node, 2), e=1, i_block - 1)])
    allocate (xi(dim, n))
    call reference_nodes(mesh%block(i_block)%kind, xi)
    most_points = max(tables%straight%n_points, tables%curved%n_points)
    allocate (x(dim, n), node(n), g(n*slots*most_points), w(most_points))
    do e = 1, size(mesh%block(i_block)%node, 2)
      node(:) = mesh%block(i_block)%node(:, e)
      x(:, :) = mesh%x(:, node)
      if (tables%is_curved(x)) then
        call add_element(tables%curved)
      else
        call add_element(tables%straight)
      end if
      if (allocated(error)) return
    end do

  contains

    !> Add the nodal forces on the current element.
    subroutine add_element(table)
      type(shape_table_t), intent(in) :: table  !! Shape functions at the points of the rule.
      real(dp) :: value(3), worst
      integer :: q, a
      call map_element(n, dim, slots, table%n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
      if (.not. worst > 0) then
        call inverted_element_error(mesh, i_block, e, error)
        return
      end if
      value = field%value
      do q = 1, table%n_points
        if (.not. field%constant) call field%evaluate(matmul(x, table%shape(:, q)), value, error)
        if (allocated(error)) return
        do a = 1, n
          force(:, node(a)) = force(:, node(a)) + w(q)*table%shape(a, q)*value(:dim)
        end do
        if (present(points) .and. .not. field%constant) &
          call points%add(before + e, 0, matmul(xi, table%shape(:, q)), w(q)*value(:dim))
      end do
    end subroutine add_element
  end subroutine add_block

  !> Traction of a total load.
  subroutine spread_total_load(mesh, analysis, surface, force, moment, point, traction, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(in) :: force(3)  !! F; in axisymmetric analyses along the axis, on the full circumference [force].
    real(dp), intent(in) :: moment(3)  !! M; 0 in axisymmetric analyses (3) [force length].
    real(dp), allocatable, intent(in) :: point(:)  !! p; the centroid where not allocated (3) [length].
    type(vector_field_t), intent(inout) :: traction  !! The traction [pressure].
    type(error_t), allocatable, intent(out) :: error  !! Where the load has no meaning, or the surface cannot take it.
    real(dp) :: area, centre(3), second(3, 3), about_centre(3), spin(3), values(3), axes(3, 3), inverse(3)
    if (analysis == analysis_axisymmetric) then
      if (abs(force(1)) > 0 .or. any(abs(moment) > 0)) then
        call set_error(error, 'force and moment: in axisymmetric analyses only a force along the axis y is a '// &
                       'resultant, force = 0,fy without moment', exit_bad_input)
        return
      end if
    end if
    call area_moments(mesh, analysis == analysis_axisymmetric, surface, area, centre, second)
    call traction%init(force/area, error)
    if (allocated(error) .or. analysis == analysis_axisymmetric) return
    about_centre = moment
    if (allocated(point)) about_centre = moment + cross(point - centre, force)
    if (mesh%dimension == 2 .and. second(3, 3) > 0) then
      ! The only one in the plane is the polar one.
      spin = [0.0_dp, 0.0_dp, about_centre(3)/second(3, 3)]
    else
      call right_singular_vectors(second, values, axes, error)
      if (allocated(error)) return
      inverse = 0
      where (values > shape_rounding*values(1)) inverse = 1/values
      spin = matmul(about_centre, axes)
      if (any(inverse <= 0 .and. abs(spin) > shape_rounding*norm2(about_centre))) then
        call set_error(error, 'moment: what lies on a line takes no moment about it, and a node takes none', &
                       exit_bad_input)
        return
      end if
      spin = matmul(axes, inverse*spin)
    end if
    ! b x r as a matrix by r.
    call traction%init_affine(reshape([0.0_dp, spin(3), -spin(2), -spin(3), 0.0_dp, spin(1), spin(2), -spin(1), &
                                       0.0_dp], [3, 3]), centre)
    traction%value = force/area
  end subroutine spread_total_load

  !> Area, centroid and second moments J of a surface.
  subroutine area_moments(mesh, axisymmetric, surface, area, centre, second)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    logical, intent(in) :: axisymmetric  !! Whether areas are those of the full circumference.
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(out) :: area  !! Area [length^2; length in plane analyses].
    real(dp), intent(out) :: centre(3)  !! Centroid (3) [length].
    real(dp), intent(out) :: second(3, 3)  !! J about the centroid (3, 3) [area length^2].
    real(dp), allocatable :: xi(:, :), weight(:)
    type(element_kind_t) :: kind
    real(dp) :: x(mesh%dimension), normal(mesh%dimension), r(3), w
    integer :: pass, f, q, i, last
    area = 0
    centre = 0
    second = 0
    last = -1
    do pass = 1, 2
      do f = 1, surface%n_facets
        if (surface%kind(f) /= last) then
          kind = element_kind(surface%kind(f))
          call quadrature_rule(surface%kind(f), load_degree(kind%order), xi, weight)
          last = surface%kind(f)
        end if
        associate (node => surface%node(:kind%n_nodes, f))
          do q = 1, size(weight)
            call facet_geometry(surface%kind(f), mesh%dimension, mesh%x(:, node), xi(:, q), x, normal, w)
            w = w*weight(q)
            if (axisymmetric .and. surface%kind(f) /= element_point) w = w*two_pi*x(1)
            r = 0
            r(:mesh%dimension) = x
            if (pass == 1) then
              area = area + w
              centre = centre + w*r
              cycle
            end if
            r = r - centre
            second = second - w*spread(r, 1, 3)*spread(r, 2, 3)
            do i = 1, 3
              second(i, i) = second(i, i) + w*dot_product(r, r)
            end do
          end do
        end associate
      end do
      if (pass == 1) centre = centre/area
    end do
  end subroutine area_moments

  !> Where the resultants on all motions that the supports leave are small, subtract nodal forces that have them: along
  !> these motions, and in proportion to the forces of the nodes.
  subroutine balance_centrifugal_force(body, tolerance, force, balanced)
    type(body_t), intent(in) :: body  !! The body, whole, with its supports.
    real(dp), intent(in) :: tolerance  !! Greatest resultant balanced, relative to the sum of magnitudes [].
    real(dp), intent(inout) :: force(:, :)  !! Nodal centrifugal forces (dim, n_nodes) [force].
    real(dp), intent(out) :: balanced  !! Greatest relative resultant that was subtracted; 0: none [].
    type(rigid_body_modes_t) :: modes
    real(dp), allocatable :: shape(:, :, :), resultant(:), magnitude(:), gram(:, :), factor(:, :), amplitude(:, :)
    integer, allocatable :: pivot(:)
    integer :: i, k, rank
    balanced = 0
    call modes%init(body%mesh, body%analysis, body%constraint, shape)
    associate (n => size(shape, 3))
      if (n == 0) return
      allocate (resultant(n), magnitude(n), gram(n, n), factor(n, n), amplitude(1, n), pivot(n))
      resultant = 0
      magnitude = 0
      gram = 0
      do i = 1, size(force, 2)
        associate (size_of => norm2(force(:, i)))
          resultant = resultant + matmul(force(:, i), shape(:, i, :))
          magnitude = magnitude + size_of*norm2(shape(:, i, :), 1)
          gram = gram + size_of*matmul(transpose(shape(:, i, :)), shape(:, i, :))
        end associate
      end do
      if (all(abs(resultant) <= given_rounding*magnitude) .or. any(abs(resultant) > tolerance*magnitude)) return
      call factorize_gram(n, gram, given_rounding, factor, pivot, rank)
      if (rank < n) return
      amplitude(1, :) = resultant
      call solve_gram(n, 1, factor, pivot, amplitude)
      do i = 1, size(force, 2)
        force(:, i) = force(:, i) - norm2(force(:, i))*matmul(shape(:, i, :), amplitude(1, :))
      end do
      do k = 1, n
        if (magnitude(k) > 0) balanced = max(balanced, abs(resultant(k))/magnitude(k))
      end do
    end associate
  end subroutine balance_centrifugal_force
end module dotyk_elasticity_load
