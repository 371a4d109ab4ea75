!> Stresses at the nodes: those of the recovered strains (`dotyk_elasticity_gradient_recovery`), which are exact where
!> the displacement is a polynomial of one degree more than that of the elements, up to the boundary.
!>
!> The strain of a vertex is that of its polynomial; between the vertices of an element the polynomials are weighted
!> with the linear shape functions, as in the error estimate. Each body has its own values: at interfaces they are
!> one-sided. Where a part of the dilatation is projected, the pressure is that of the recovered dilatation
!> (`dotyk_elasticity_dilatation_fit`).
!>
!> Where the dilatation of a quadratic element is projected on a constant, its displacement is no better than that of a
!> linear one: strains are of first order, at the nodes, too, and so are those recovered from the displacements of the
!> nodes. Their means over elements are of second order: stresses at the nodes of such elements come from linear
!> functions that are fitted to the means around each vertex (`take_stress_of_means`).
module dotyk_elasticity_nodal_stress
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: same_number
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_dilatation_fit, only: dilatation_fit_t, fit_dilatations, mean_dilatations, smooth_pressures
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_gradient_recovery, only: gradient_recovery_t
  use dotyk_elasticity_initial_stress, only: initial_state_t
  use dotyk_elasticity_material, only: elements_of_material, material_t, mesh_of_material
  use dotyk_elasticity_material_field, only: material_field_t, point_constants_t
  use dotyk_elasticity_point_stress, only: inward
  use dotyk_elasticity_projected_dilatation, only: n_projection_functions, unprojected_bulk_ratio
  use dotyk_elasticity_recovery_patch, only: diagonalize
  use dotyk_elasticity_stress_energy, only: stresses_and_energy
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, reference_nodes, shape_functions
  implicit none
  private
  public :: nodal_stresses, principal_stresses, take_stress_of_means, element_stress, von_mises, thermal_dilatation

  type :: corner_weights_t  !! Linear shape functions of the corners at the nodes of an element kind.
    integer :: n_corners = 0  !! Number of corners.
    real(dp), allocatable :: at_node(:, :)  !! Values (n_corners, n_nodes) [].
    real(dp) :: matrix(6, 6) = 0  !! Unprojected part of the material: from strains to stresses (6, 6) [pressure].
    real(dp) :: bulk = 0  !! Projected part of the bulk modulus [pressure].
  end type corner_weights_t

  !> Projected part of the bulk modulus over the other one from which on the means are better: from Poisson's ratio
  !> 0.475 on [].
  real(dp), parameter :: much = 1

contains

  !> Stresses at the nodes of several bodies of one mesh and material, without initial stresses.
  subroutine nodal_stresses(mesh, analysis, material, u, fit, stress, error, temperature, expansion)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the body.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    type(gradient_recovery_t), intent(inout) :: fit  !! Those of u on return; what is kept of the mesh is reused.
    !> Stresses in the axes of the mesh, order xx yy zz yz xz xy; NaN at nodes where the modulus field has no value
    !> (6, n_nodes, n_bodies) [pressure].
    real(dp), allocatable, intent(out) :: stress(:, :, :)
    type(error_t), allocatable, intent(out) :: error  !! Where the modulus field is no formula.
    !> Temperatures at the nodes above those of the stress-free bodies; none where absent or not allocated
    !> (n_bodies, n_nodes) [temperature].
    real(dp), allocatable, intent(in), optional :: temperature(:, :)
    !> Their thermal expansions in the axes of the mesh, strains in the order of the stresses; given with the
    !> temperatures (6, n_bodies) [1/temperature].
    real(dp), intent(in), optional :: expansion(:, :)
    type(dilatation_fit_t), allocatable :: dilatation(:)
    type(corner_weights_t), allocatable :: of_block(:)
    type(energy_form_t) :: form
    type(point_constants_t), allocatable :: here(:)
    real(dp), allocatable :: thermal(:, :), factor(:)
    integer, allocatable :: home(:, :)
    real(dp) :: strain(6), matrix(6, 6), bulk, axis_radius
    integer :: b, i
    logical :: is_heated
    call find_homes(mesh, home)
    call constants_of_nodes(mesh, analysis, material, home, factor, here, error)
    if (allocated(error)) return
    is_heated = .false.
    if (present(temperature)) is_heated = allocated(temperature)
    if (is_heated) thermal = temperature*spread(sum(expansion(:3, :), dim=1), 2, size(temperature, 2))
    if (is_heated .and. allocated(here)) &
      thermal = temperature*spread([(sum(here(i)%expansion(:3)), i=1, size(here))], 1, size(u, 1))
    call fit%init(mesh, u)
    call fit_dilatations(mesh, analysis, material, u, thermal, dilatation)
    call weigh_corners(mesh, analysis, material, of_block)
    call form%init(analysis, material%stiffness)
    axis_radius = 0
    if (gradient_slots(analysis) > mesh%dimension) axis_radius = same_number*maxval(abs(mesh%x(1, :)))
    allocate (stress(6, mesh%n_nodes(), size(u, 1)), source=0.0_dp)
    !$omp parallel do default(none) schedule(static) private(b, strain, matrix, bulk) &
    !$omp& shared(mesh, u, stress, temperature, expansion, fit, dilatation, of_block, form, factor, home, axis_radius) &
    !$omp& shared(is_heated, here)
    do i = 1, size(stress, 2)
      if (home(1, i) == 0) cycle
      associate (weights => of_block(home(1, i)), &
                 node => mesh%block(home(1, i))%node(:of_block(home(1, i))%n_corners, home(2, i)))
        do b = 1, size(u, 1)
          call recovered_strain(fit, form, b, weights%at_node(:, home(3, i)), node, mesh%x(:, i), strain)
          if (size(form%component) == 4) strain(3) = hoop_strain(mesh%x(1, i), u(b, 1, i), axis_radius, strain(1))
          matrix = weights%matrix
          bulk = weights%bulk
          if (allocated(here)) then
            matrix = here(i)%matrix
            bulk = here(i)%bulk
            if (is_heated) strain = strain - temperature(b, i)*here(i)%expansion
          else if (is_heated) then
            strain = strain - temperature(b, i)*expansion(:, b)
          end if
          stress(:, i, b) = matmul(matrix, strain)
          if (bulk > 0) stress(:3, i, b) = stress(:3, i, b) + &
            bulk*fitted(dilatation(b), mesh%x, node, weights%at_node(:, home(3, i)), mesh%x(:, i))
          stress(:, i, b) = factor(i)*stress(:, i, b)
        end do
      end associate
    end do
    !$omp end parallel do
  end subroutine nodal_stresses

  !> Weights and materials of the element kinds of all blocks.
  subroutine weigh_corners(mesh, analysis, material, of_block)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the body.
    type(corner_weights_t), allocatable, intent(out) :: of_block(:)  !! One for each block (n_blocks).
    type(element_kind_t) :: kind
    real(dp), allocatable :: xi(:, :)
    real(dp) :: lambda
    integer :: b, i
    allocate (of_block(size(mesh%block)))
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      if (allocated(xi)) deallocate (xi)
      allocate (xi(kind%dimension, kind%n_nodes))
      call reference_nodes(mesh%block(b)%kind, xi)
      associate (weights => of_block(b))
        weights%n_corners = kind%n_corners
        allocate (weights%at_node(kind%n_corners, kind%n_nodes))
        do i = 1, kind%n_nodes
          call shape_functions(kind%corner_kind, xi(:, i), weights%at_node(:, i))
        end do
        call material%split(analysis, unprojected_bulk_ratio(mesh%block(b)%kind, material%incompressibility), &
                            weights%matrix, lambda, weights%bulk)
      end associate
    end do
  end subroutine weigh_corners

  !> Recovered strain at a node of an element, without the hoop strain.
  pure subroutine recovered_strain(fit, form, body, weight, node, x, strain)
    type(gradient_recovery_t), intent(in) :: fit  !! Polynomials of the vertices.
    type(energy_form_t), intent(in) :: form  !! Strains of the analysis.
    integer, intent(in) :: body  !! Index of the body.
    real(dp), intent(in) :: weight(:)  !! Weights of the corners of the element (n_corners) [].
    integer, intent(in) :: node(:)  !! Nodes of the corners (n_corners).
    real(dp), intent(in) :: x(:)  !! Position of the node (dim) [length].
    real(dp), intent(out) :: strain(6)  !! The strain, order xx yy zz yz xz xy, engineering shear (6) [].
    real(dp) :: t(size(x)), power(fit%monomials%n_lower)
    integer :: c, k, s
    strain = 0
    do c = 1, size(node)
      if (.not. abs(weight(c)) > 0) cycle
      associate (v => fit%vertex(node(c)))
        t = matmul(fit%axes(:, :, v), x - fit%centre(:, v))
        power(1) = weight(c)
        do k = 2, fit%monomials%n_lower
          power(k) = power(fit%monomials%parent(k))*t(fit%monomials%axis(k))
        end do
        do s = 1, fit%n_strains
          strain(form%component(s)) = strain(form%component(s)) + dot_product(fit%strain(body, s, :, v), power)
        end do
      end associate
    end do
  end subroutine recovered_strain

  !> Hoop strain at a node of an axisymmetric body [].
  pure real(dp) function hoop_strain(radius, u, axis_radius, radial_strain) result(strain)
    real(dp), intent(in) :: radius  !! Radius of the node [length].
    real(dp), intent(in) :: u  !! Radial displacement [length].
    real(dp), intent(in) :: axis_radius  !! Radii up to this one are on the axis [length].
    real(dp), intent(in) :: radial_strain  !! Radial strain, the limit of the hoop strain on the axis [].
    strain = radial_strain
    if (abs(radius) > axis_radius) strain = u/radius
  end function hoop_strain

  !> Recovered dilatation at a node of an element [].
  pure real(dp) function fitted(fit, x, node, weight, position)
    type(dilatation_fit_t), intent(in) :: fit  !! Linear functions around the vertices.
    real(dp), intent(in) :: x(:, :)  !! All nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: node(:)  !! Nodes of the corners of the element (n_corners).
    real(dp), intent(in) :: weight(:)  !! Weights of the corners (n_corners) [].
    real(dp), intent(in) :: position(:)  !! Position of the node (dim) [length].
    real(dp) :: value(1)
    call fit%values(x(:, node), node, reshape(weight, [1, size(weight)]), reshape(position, [1, size(position)]), value)
    fitted = value(1)
  end function fitted

  !> Principal stresses, the greatest first (3) [pressure].
  pure function principal_stresses(stress) result(principal)
    real(dp), intent(in) :: stress(6)  !! Stress, order xx yy zz xy yz xz (6) [pressure].
    real(dp) :: principal(3), tensor(3, 3), vectors(3, 3), greatest, least
    integer :: i
    principal = sum(stress)
    if (.not. ieee_is_finite(sum(abs(stress)))) return
    tensor = reshape([stress(1), stress(4), stress(6), stress(4), stress(2), stress(5), stress(6), stress(5), &
                      stress(3)], [3, 3])
    call diagonalize(3, tensor, vectors)
    principal = [(tensor(i, i), i=1, 3)]
    greatest = maxval(principal)
    least = minval(principal)
    principal = [greatest, max(min(principal(1), principal(2)), min(max(principal(1), principal(2)), principal(3))), &
                 least]
  end function principal_stresses

  !> Whether the greater part of the dilatation of a kind of quadratic elements is projected on a constant.
  logical function has_constant_dilatation(kind, analysis, material) result(is_constant)
    integer, intent(in) :: kind  !! Element kind: one of the `element_*` constants.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the elements.
    type(element_kind_t) :: properties
    real(dp) :: matrix(6, 6), lambda, bulk
    properties = element_kind(kind)
    is_constant = properties%order > 1 .and. n_projection_functions(kind, properties%dimension) == 1
    if (.not. is_constant) return
    call material%split(analysis, unprojected_bulk_ratio(kind, material%incompressibility), matrix, lambda, bulk)
    is_constant = bulk > much*sum(matrix(:3, :3))/9
  end function has_constant_dilatation

  !> Take the stresses of the fit at the nodes of such elements, but where there are too few elements for it.
  subroutine take_stress_of_means(mesh, analysis, material, u, mean, is_meant, stress)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of one material, and all nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! The material.
    real(dp), intent(in) :: u(:, :)  !! Displacements (dim, n_nodes) [length].
    real(dp), intent(in) :: mean(:, :)  !! Mean stresses of the elements (6, n_elements) [pressure].
    logical, intent(in) :: is_meant(:)  !! Nodes whose stress is that of this material (n_nodes).
    real(dp), intent(inout) :: stress(:, :)  !! Stresses; those of some nodes change (6, n_nodes) [pressure].
    type(dilatation_fit_t) :: fit(6)
    type(element_kind_t) :: kind
    real(dp), allocatable :: dilatation(:), centre(:, :), volume(:), xi(:, :), weight(:)
    integer, allocatable :: home(:, :)
    logical :: is_constant(size(mesh%block))
    real(dp) :: value(1)
    integer :: b, i, s
    is_constant = [(has_constant_dilatation(mesh%block(b)%kind, analysis, material), b=1, size(is_constant))]
    if (.not. any(is_constant)) return
    call mean_dilatations(mesh, analysis, u, dilatation, centre, volume)
    do s = 1, 6
      call fit(s)%init(mesh, mean(s, :), centre, volume)
    end do
    call find_homes(mesh, home)
    do b = 1, size(mesh%block)
      if (.not. is_constant(b)) cycle
      kind = element_kind(mesh%block(b)%kind)
      if (allocated(xi)) deallocate (xi, weight)
      allocate (xi(kind%dimension, kind%n_nodes), weight(kind%n_corners))
      call reference_nodes(mesh%block(b)%kind, xi)
      do i = 1, size(home, 2)
        if (home(1, i) /= b .or. .not. is_meant(i)) cycle
        call shape_functions(kind%corner_kind, xi(:, home(3, i)), weight)
        associate (corner => mesh%block(b)%node(:kind%n_corners, home(2, i)))
          if (.not. all([(is_linear(corner(s)), s=1, size(corner))] .or. .not. abs(weight) > 0)) cycle
          do s = 1, 6
            call fit(s)%values(mesh%x(:, corner), corner, reshape(weight, [1, size(weight)]), &
                               reshape(mesh%x(:, i), [1, mesh%dimension]), value)
            stress(s, i) = value(1)
          end do
        end associate
      end do
    end do

  contains

    !> Whether the elements around a vertex determine linear functions.
    pure logical function is_linear(vertex)
      integer, intent(in) :: vertex  !! The node.
      integer :: k
      is_linear = any([(any(abs(fit(k)%coefficient(2:, vertex)) > 0), k=1, 6)])
    end function is_linear
  end subroutine take_stress_of_means

  !> Mean stress of each element; nearly incompressible linear elements get a smoothed pressure, which does not
  !> alternate.
  subroutine element_stress(body, u, stress, energy)
    type(body_t), intent(in) :: body  !! The body; assembled before: its elements and formulas are valid.
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    !> Stresses, order xx yy zz xy yz xz, elements in the order of the blocks (6, n_elements) [pressure].
    real(dp), intent(out) :: stress(:, :)
    real(dp), intent(out), optional :: energy  !! Strain energy; of own elements of a part of the body [energy].
    type(error_t), allocatable :: error
    real(dp), allocatable :: factor(:), thermal(:)
    integer, allocatable :: own(:)
    real(dp) :: of_body, shear(3)
    integer :: e, m
    allocate (factor(size(stress, 2)))
    call stresses_and_energy(body%mesh, body%analysis, body%material, u, stress, of_body, error, factor, &
                             initial=body%initial)
    if (present(energy)) energy = of_body
    do m = 1, size(body%material)
      if (allocated(error)) exit
      if (allocated(body%initial%temperature)) &
        call thermal_dilatation(body%mesh, body%analysis, body%material(m), body%initial, thermal)
      if (size(body%material) == 1) then
        call smooth_pressures(body%mesh, body%analysis, body%material(m), u, factor, stress, thermal)
      else
        ! Pressures jump where materials meet.
        own = elements_of_material(body%mesh, m)
        if (size(own) > 0) call smooth_some(body%material(m), mesh_of_material(body%mesh, m))
      end if
    end do
    do e = 1, size(stress, 2)
      shear = stress(4:6, e)
      stress(4:6, e) = [shear(3), shear(1), shear(2)]
    end do

  contains

    !> Smooth the pressures in one of several materials.
    subroutine smooth_some(material, part)
      type(material_t), intent(in) :: material  !! The material.
      type(body_mesh_t), intent(in) :: part  !! Its elements.
      real(dp) :: of_part(6, size(own))
      of_part = stress(:, own)
      call smooth_pressures(part, body%analysis, material, u, factor(own), of_part, thermal)
      stress(:, own) = of_part
    end subroutine smooth_some
  end subroutine element_stress

  !> Equivalent stress of von Mises [pressure].
  pure real(dp) function von_mises(stress)
    real(dp), intent(in) :: stress(6)  !! Stresses xx yy zz and the three shear stresses in any order (6) [pressure].
    von_mises = sqrt(0.5_dp*((stress(1) - stress(2))**2 + (stress(2) - stress(3))**2 + (stress(3) - stress(1))**2) + &
                     3*(stress(4)**2 + stress(5)**2 + stress(6)**2))
  end function von_mises

  !> An element of each node: of the own ones, where the rank has some.
  subroutine find_homes(mesh, home)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, allocatable, intent(out) :: home(:, :)  !! Block, element and number in it of each node; or 0 (3, n_nodes).
    integer :: b, e, i, number, round
    allocate (home(3, mesh%n_nodes()), source=0)
    ! Recovered strains are those of the whole body in own elements: these come first.
    do round = 1, 2
      number = 0
      do b = 1, size(mesh%block)
        do e = 1, size(mesh%block(b)%node, 2)
          number = number + 1
          if (mesh%is_own_element(number) .neqv. round == 1) cycle
          do i = 1, size(mesh%block(b)%node, 1)
            associate (node => mesh%block(b)%node(i, e))
              if (home(1, node) == 0) home(:, node) = [b, e, i]
            end associate
          end do
        end do
      end do
    end do
  end subroutine find_homes

  !> Factors and constants at the nodes.
  subroutine constants_of_nodes(mesh, analysis, material, home, factor, here, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the body.
    integer, intent(in) :: home(:, :)  !! Block, element and number of each node (3, n_nodes).
    real(dp), allocatable, intent(out) :: factor(:)  !! The factor; NaN where it has no value (n_nodes) [].
    !> The constants; not allocated where a factor alone varies (n_nodes).
    type(point_constants_t), allocatable, intent(out) :: here(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula does not parse.
    type(error_t), allocatable :: no_value
    type(material_field_t) :: field
    integer :: i
    allocate (factor(size(home, 2)), source=1.0_dp)
    call field%init(material, error)
    if (allocated(error)) return
    if (field%varies) allocate (here(size(factor)))
    if (.not. field%constant) then
      do i = 1, size(factor)
        if (home(1, i) == 0) cycle
        call evaluate(mesh%x(:, i))
        if (.not. allocated(no_value) .and. factor(i) > tiny(factor) .and. ieee_is_finite(factor(i))) cycle
        associate (node => mesh%block(home(1, i))%node(:, home(2, i)))
          call evaluate((1 - inward)*mesh%x(:, i) + inward*sum(mesh%x(:, node), dim=2)/size(node))
        end associate
        if (allocated(no_value)) factor(i) = ieee_value(factor(i), ieee_quiet_nan)
      end do
    end if
    call field%destroy()

  contains

    !> Evaluate the material of the node at a point.
    subroutine evaluate(x)
      real(dp), intent(in) :: x(:)  !! The point (dim) [length].
      if (field%varies) then
        call field%at(analysis, x, here(i), no_value, mesh%block(home(1, i))%kind)
        factor(i) = here(i)%factor
      else
        call field%factor_at(x, factor(i), no_value)
      end if
    end subroutine evaluate
  end subroutine constants_of_nodes

  !> Dilatation of the thermal expansion at the nodes of a body with a temperature (n_nodes) [].
  subroutine thermal_dilatation(mesh, analysis, material, initial, dilatation)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! The material.
    type(initial_state_t), intent(in) :: initial  !! The temperature.
    real(dp), allocatable, intent(out) :: dilatation(:)  !! The dilatation (n_nodes) [].
    type(point_constants_t), allocatable :: here(:)
    type(error_t), allocatable :: error
    real(dp), allocatable :: factor(:)
    integer, allocatable :: home(:, :)
    integer :: i
    dilatation = initial%thermal_dilatation(material%expansion)
    if (.not. allocated(material%formulas%expansion)) return
    call find_homes(mesh, home)
    ! Assembly has found mistakes of the formulas.
    call constants_of_nodes(mesh, analysis, material, home, factor, here, error)
    if (allocated(error)) return
    dilatation = [(sum(here(i)%expansion(:3))*initial%temperature(i), i=1, size(here))]
  end subroutine thermal_dilatation
end module dotyk_elasticity_nodal_stress
