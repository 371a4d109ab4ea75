!> Stresses of bodies at rest: those of a temperature whose expansion is held, and the initial stress of the input.
!>
!> The stress of a displacement is C (e - a T) + s with its strain e, the thermal expansion a and the initial stress s.
!> What does not depend on the displacement, s - C a T, is at equilibrium with nodal forces that join the loads: initial
!> strains and stresses as in Zienkiewicz and Taylor, The Finite Element Method, volume 1. Where the dilatation is
!> projected (`dotyk_elasticity_projected_dilatation`), that of the expansion is, too: a free body expands without
!> stress. The modulus field is a factor of C, not of s.
module dotyk_elasticity_initial_stress
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_stiffness_tensor, only: rotate_stress
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: add_initial_forces, add_mean_initial_stress, initial_stress_of_nodes

  type, public :: initial_state_t  !! Fields at the nodes of a body; between them the shape functions interpolate.
    real(dp), allocatable :: temperature(:)  !! Above the stress-free one; or not allocated (n_nodes) [temperature].
    real(dp) :: range(2) = 0  !! Its extremes over the whole body, for the log (2) [temperature].
    !> Initial stress in global axes, order xx yy zz yz xz xy; none where not allocated (6, n_nodes) [pressure].
    real(dp), allocatable :: stress(:, :)
  contains
    procedure :: is_set => initial_state_is_set
    procedure :: thermal_dilatation => initial_state_thermal_dilatation
    procedure :: hold_nodes => initial_state_hold_nodes
    procedure :: carry => initial_state_carry
  end type initial_state_t

contains

  !> Add the nodal forces of an initial state: those that hold a body with its stress at rest, with the opposite sign.
  subroutine add_initial_forces(mesh, analysis, material, state, force, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(initial_state_t), intent(in) :: state  !! Temperature and initial stress.
    real(dp), intent(inout) :: force(:, :)  !! Nodal forces in global axes, added to (dim, n_nodes) [force].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    type(element_quadrature_t) :: points
    real(dp), allocatable :: of_element(:, :)
    integer :: b, e
    if (.not. state%is_set()) return
    do b = 1, size(mesh%block)
      call points%init(mesh, b, analysis, material, error)
      if (allocated(error)) return
      allocate (of_element(points%dim, points%n))
      do e = 1, size(mesh%block(b)%node, 2)
        call points%move_to(mesh, b, e, error)
        if (allocated(error)) exit
        call element_forces(points%n, points%dim, points%slots, points%n_points, points%n_functions, points, state, &
                            points%g, points%dilatation, of_element)
        force(:, points%node) = force(:, points%node) + of_element
      end do
      deallocate (of_element)
      call points%destroy()
      if (allocated(error)) return
    end do
  end subroutine add_initial_forces

  !> Nodal forces on one element.
  subroutine element_forces(n, dim, slots, n_points, n_functions, points, state, g, d, force)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: n_functions  !! Number of projection functions.
    type(element_quadrature_t), intent(in) :: points  !! The element.
    type(initial_state_t), intent(in) :: state  !! Temperature and initial stress.
    real(dp), intent(in) :: g(n, slots, n_points)  !! Gradients of the shape functions (n, slots, n_points) [1/length].
    real(dp), intent(in) :: d(n, dim, n_functions)  !! Of the projected dilatation [sqrt(volume)/length].
    real(dp), intent(out) :: force(dim, n)  !! Nodal forces (dim, n) [force].
    real(dp) :: stress(6, n_points), amplitude(n_functions)
    integer :: i, k, q, s
    call at_rest(points, state, stress, amplitude)
    force = 0
    do q = 1, n_points
      do s = 1, slots
        do i = 1, dim
          k = points%strain(i, s)
          if (k > 0) force(i, :) = force(i, :) - stress(k, q)*g(:, s, q)
        end do
      end do
    end do
    if (.not. points%bulk > 0) return
    do k = 1, n_functions
      force = force - amplitude(k)*transpose(d(:, :, k))
    end do
  end subroutine element_forces

  !> Add the mean over the current element of the stress that does not depend on the displacement.
  pure subroutine add_mean_initial_stress(points, state, stress)
    type(element_quadrature_t), intent(in) :: points  !! The element.
    type(initial_state_t), intent(in) :: state  !! Temperature and initial stress.
    real(dp), intent(inout) :: stress(6)  !! Mean stress, order xx yy zz yz xz xy, added to (6) [pressure].
    real(dp) :: at_points(6, points%n_points), amplitude(points%n_functions), volume
    call at_rest(points, state, at_points, amplitude)
    volume = sum(points%w(:points%n_points))
    stress = stress + sum(at_points, dim=2)/volume
    if (points%bulk > 0) stress(1:3) = stress(1:3) + points%pressure_integral(amplitude)/volume
  end subroutine add_mean_initial_stress

  !> The stress that does not depend on the displacement at the quadrature points of an element, times their volumes.
  pure subroutine at_rest(points, state, stress, amplitude)
    type(element_quadrature_t), intent(in) :: points  !! The element.
    type(initial_state_t), intent(in) :: state  !! Temperature and initial stress.
    real(dp), intent(out) :: stress(:, :)  !! Without that of the projected dilatation (6, n_points) [pressure volume].
    !> That of the projected dilatation: coefficients of the projection functions; 0 where none is projected
    !> (n_functions) [pressure sqrt(volume)].
    real(dp), intent(out) :: amplitude(:)
    real(dp) :: rate(6), temperature(points%n_points), dilatation(points%n_points)
    integer :: k, m, q
    stress = 0
    amplitude = 0
    m = points%n_points
    if (allocated(state%temperature)) then
      temperature = points%at_points(state%temperature)
      if (points%varies) then
        do q = 1, m
          rate = -matmul(points%matrix(:, :, q), points%expansion(:, q))
          stress(:, q) = rate*points%stiffness(q)*temperature(q)
        end do
      else
        rate = -matmul(points%matrix(:, :, 1), points%expansion(:, 1))
        do k = 1, 6
          stress(k, :) = rate(k)*points%stiffness(:m)*temperature
        end do
      end if
      if (points%bulk > 0) then
        dilatation = [(sum(points%expansion(1:3, min(q, points%n_matrices)))*temperature(q), q=1, m)]
        amplitude = -points%bulk*points%project(dilatation)
      end if
    end if
    if (allocated(state%stress)) then
      do k = 1, 6
        stress(k, :) = stress(k, :) + points%w(:m)*points%at_points(state%stress(k, :))
      end do
    end if
  end subroutine at_rest

  !> The stress that does not depend on the displacement, at the nodes and in axes that move with the body. For bodies
  !> without a projected dilatation.
  subroutine initial_stress_of_nodes(analysis, material, state, axes, component, thermal, initial)
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(initial_state_t), intent(in) :: state  !! Temperature and initial stress.
    real(dp), intent(in) :: axes(3, 3)  !! Rotation from global axes to those of the results (3, 3) [].
    integer, intent(in) :: component(:)  !! Components that are asked for, in the order xx yy zz yz xz xy (n).
    !> That of the temperature in each material where its modulus field is 1; 0 in materials of which more varies
    !> (n, n_nodes, n_materials) [pressure].
    real(dp), intent(out) :: thermal(:, :, :)
    real(dp), intent(out) :: initial(:, :)  !! The initial stress (n, n_nodes) [pressure].
    real(dp) :: rate(6), stress(6)
    integer :: i, m
    thermal = 0
    initial = 0
    if (allocated(state%temperature)) then
      do m = 1, size(material)
        if (material(m)%formulas%vary()) cycle
        rate = rotate_stress(-matmul(material(m)%plane_matrix(analysis), material(m)%expansion), axes)
        do i = 1, size(thermal, 2)
          thermal(:, i, m) = rate(component)*state%temperature(i)
        end do
      end do
    end if
    if (allocated(state%stress)) then
      do i = 1, size(initial, 2)
        stress = rotate_stress(state%stress(:, i), axes)
        initial(:, i) = stress(component)
      end do
    end if
  end subroutine initial_stress_of_nodes

  !> Whether there is any of it.
  pure logical function initial_state_is_set(self) result(is_set)
    class(initial_state_t), intent(in) :: self
    is_set = allocated(self%temperature) .or. allocated(self%stress)
  end function initial_state_is_set

  !> Dilatation of the thermal expansion at the nodes, where there is a temperature (n_nodes) [].
  pure function initial_state_thermal_dilatation(self, expansion) result(dilatation)
    class(initial_state_t), intent(in) :: self
    real(dp), intent(in) :: expansion(6)  !! Thermal expansion as a strain: xx yy zz first (6) [1/temperature].
    real(dp) :: dilatation(size(self%temperature))
    dilatation = sum(expansion(1:3))*self%temperature
  end function initial_state_thermal_dilatation

  !> Keep that of some nodes.
  pure subroutine initial_state_hold_nodes(self, node)
    class(initial_state_t), intent(inout) :: self
    integer, intent(in) :: node(:)  !! Numbers of the nodes, ascending (n_held_nodes).
    if (allocated(self%temperature)) self%temperature = self%temperature(node)
    if (allocated(self%stress)) self%stress = self%stress(:, node)
  end subroutine initial_state_hold_nodes

  !> Put the state into a parcel, or take it out.
  subroutine initial_state_carry(self, parcel)
    class(initial_state_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%temperature)
    call parcel%carry_fixed(2, self%range)
    call parcel%carry(self%stress)
  end subroutine initial_state_carry
end module dotyk_elasticity_initial_stress
