!> Loads as consistent nodal forces: tractions and pressures on surfaces, equation (5), force densities in bodies, those
!> of a rotation among them. With all L(v) is a continuous linear form, equation (16).
!>
!> A positive pressure pushes into the body. A local traction has its components along xi, eta, n of the surface with
!> n the outward normal; eta is not used in two dimensions. Forces on plane bodies are per unit thickness, forces on
!> axisymmetric ones are those on the full circumference.
module dotyk_elasticity_load
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_acceleration, load_angular_velocity, load_force_density, &
    load_local_traction, load_pressure, load_total, load_traction
  use dotyk_base_text, only: quoted, text_t
  use dotyk_elasticity_analysis, only: gradient_slots, two_pi
  use dotyk_elasticity_face_table, only: local_face, point_of_element
  use dotyk_elasticity_point_forces, only: point_forces_t
  use dotyk_elasticity_element_quadrature, only: inverted_element_error
  use dotyk_elasticity_shape_table, only: shape_table_t, load_degree, map_element, shape_table_pair_t
  use dotyk_elasticity_total_load, only: spread_total_load
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds, quadrature_rule, &
    reference_nodes, shape_functions
  use dotyk_mesh_facet, only: facet_geometry, frame_of_normal
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: load_t  !! One load. The place where it acts is an argument of the procedures.
    integer :: kind = load_traction  !! Kind of the load: one of the `load_*` constants.
    !> Value: a pressure in the first component, else a vector (3) [pressure], [force/volume], [1/time], or
    !> [force] of a total load.
    real(dp) :: value(3) = 0
    real(dp) :: centre(3) = 0  !! A point on the axis of an angular velocity (3) [length].
    !> Densities of the materials that an angular velocity or acceleration acts on (n_materials) [mass/volume].
    real(dp), allocatable :: density(:)
    type(text_t), allocatable :: density_formula(:)  !! Their formulas; empty where the number holds (n_materials).
    !> Formulas of the components; an empty one keeps the value; no formulas where not allocated (3).
    type(text_t), allocatable :: formula(:)
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

  public :: add_surface_load, add_volume_load

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
    type(facet_rule_t) :: rule(n_element_kinds)
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
    if (axisymmetric) area = area*two_pi*position(1)
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
    !> A force density that varies at the quadrature points, added to.
    type(point_forces_t), intent(inout), optional :: points
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
    !> A force density that varies at the quadrature points, added to.
    type(point_forces_t), intent(inout), optional :: points
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
end module dotyk_elasticity_load
