!> Stresses of a displacement and stiffness at points of elements.
module dotyk_elasticity_point_stress
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_isoparametric_map, only: interpolate, map_points, physical_gradients, point_shape_table_t
  use dotyk_elasticity_material_field, only: material_field_t, point_constants_t
  implicit none
  private

  type, public :: point_material_t  !! The material of a body at points.
    type(energy_form_t) :: form  !! Strains of the analysis.
    real(dp), allocatable :: stiffness(:, :)  !! From strains to stresses (n_strains, n_strains) [pressure].
    real(dp) :: size = 0  !! Magnitude of the stiffness, to compare materials [pressure].
    integer :: slots = 0  !! Number of gradient slots.
    !> Stresses of bodies at rest at the nodes: of their temperatures, where the modulus factor is 1; none where not
    !> allocated (n_bodies, n_strains, n_nodes) [pressure].
    real(dp), allocatable :: thermal(:, :, :)
    !> Their initial stresses; allocated where those of temperatures are (n_bodies, n_strains, n_nodes) [pressure].
    real(dp), allocatable :: initial(:, :, :)
    !> Temperatures of the bodies at the nodes, for materials of which more varies than a factor; none where not
    !> allocated (n_bodies, n_nodes) [temperature].
    real(dp), allocatable :: temperature(:, :)
    integer :: analysis = 0  !! Type of analysis: one of the `analysis_*` constants.
    type(material_field_t) :: field  !! The material in space.
  contains
    procedure :: init => point_material_init
  end type point_material_t

  !> Points on faces are moved towards the centre of the element by this fraction to find the modulus of the element.
  real(dp), parameter, public :: inward = 1.0e-6_dp

  public :: stresses_at

contains

  !> Create the material of an analysis; its field is set elsewhere.
  subroutine point_material_init(self, analysis, matrix)
    class(point_material_t), intent(inout) :: self
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: matrix(6, 6)  !! Stiffness: from strains to stresses (6, 6) [pressure].
    integer :: k, n
    call self%form%init(analysis, matrix)
    self%analysis = analysis
    self%slots = gradient_slots(analysis)
    n = self%form%n_strains
    allocate (self%stiffness(n, n), source=0.0_dp)
    do k = 1, self%form%n_terms
      associate (s => self%form%pair(1, k), t => self%form%pair(2, k), c => self%form%coefficient(k))
        self%stiffness(s, t) = self%stiffness(s, t) + c/2
        self%stiffness(t, s) = self%stiffness(t, s) + c/2
      end associate
    end do
    self%size = sum([(self%stiffness(k, k), k=1, n)])
  end subroutine point_material_init

  !> Stresses at all points of a table.
  subroutine stresses_at(n, n_points, n_bodies, dim, n_strains, slots, material, points, node, all_x, all_u, at_faces, &
                         inverse, radius, w, modulus, stress, worst, error, matrix)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: n_points  !! Number of points, with repetitions.
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n_strains  !! Number of strains.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    type(point_material_t), intent(in) :: material  !! Material.
    type(point_shape_table_t), intent(in) :: points  !! Shape functions at the points.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    real(dp), intent(in) :: all_x(dim, *)  !! Nodes of the body (dim, n_nodes) [length].
    real(dp), intent(in) :: all_u(n_bodies, dim, *)  !! Displacements (n_bodies, dim, n_nodes) [length].
    logical, intent(in) :: at_faces  !! Whether the points are on faces: the modulus is that beside them.
    real(dp), intent(out) :: inverse(n_points, dim, dim)  !! Inverse Jacobians (n_points, dim, dim) [1/length].
    real(dp), intent(out) :: radius(n_points)  !! Radius in axisymmetric analyses, 1 in others (n_points) [length].
    real(dp), intent(out) :: w(n_points)  !! Jacobian determinants by the weights, 0 for repetitions [volume].
    real(dp), intent(out) :: modulus(n_points)  !! Modulus factor (n_points) [].
    real(dp), intent(out) :: stress(n_points, n_strains, n_bodies)  !! Stresses; 0 where inverted at a point [pressure].
    real(dp), intent(out) :: worst  !! Smallest determinant; if not positive `inverse` and `w` are undefined [volume].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    real(dp), intent(out), optional :: matrix(n_strains, n_strains, n_points)  !! Material, by the factor [pressure].
    type(point_constants_t) :: here
    real(dp) :: x(dim, n), u(n_bodies, dim, n), g_square(n_points), slope(n_points, dim, slots)
    real(dp) :: by_reference(n_points, n_bodies, dim, dim), displacement(n_points, n_bodies, dim)
    real(dp) :: strain(n_points, n_strains), place(n_points, dim), centre(dim), point(dim)
    real(dp) :: at_rest(n_points, n_bodies, n_strains)
    real(dp), allocatable :: varying(:, :, :), held(:, :), heat(:, :)
    integer :: i, k, q, s
    do i = 1, n
      x(:, i) = all_x(:, node(i))
      u(:, :, i) = all_u(:, :, node(i))
    end do
    stress = 0
    modulus = 1
    call map_points(n, dim, slots, n_points, points%shape, points%shape_square, points%gradient, points%products, &
                    points%weight, x, inverse, radius, g_square, w, worst)
    if (material%field%varies) allocate (varying(n_strains, n_strains, n_points), held(n_strains, n_points))
    if (.not. material%field%constant) then
      call interpolate(n, dim, n_points, points%shape, x, place)
      centre = sum(x, dim=2)/n
      do q = 1, n_points
        point = place(q, :)
        if (at_faces) point = point + inward*(centre - point)
        if (material%field%varies) then
          call material%field%at(material%analysis, point, here, error)
          if (allocated(error)) return
          modulus(q) = here%factor
          varying(:, :, q) = here%matrix(material%form%component, material%form%component)
          ! The stress per temperature whose expansion is held.
          here%expansion = -matmul(here%matrix, here%expansion)
          held(:, q) = here%expansion(material%form%component)
        else
          call material%field%factor_at(point, modulus(q), error)
          if (allocated(error)) return
        end if
      end do
    end if
    if (present(matrix)) then
      matrix = spread(material%stiffness, 3, n_points)
      if (material%field%varies) matrix = varying
    end if
    if (.not. worst > 0) return
    do i = 1, dim
      call interpolate(n, n_bodies*dim, n_points, points%gradient(:, :, i), u, by_reference(:, :, :, i))
    end do
    if (slots > dim) call interpolate(n, n_bodies*dim, n_points, points%shape, u, displacement)
    do k = 1, n_bodies
      call physical_gradients(dim, slots, n_points, n_bodies, k, by_reference, inverse, displacement, radius, slope)
      call material%form%strains(n_points, slope, strain)
      if (material%field%varies) then
        if (allocated(material%temperature)) then
          if (.not. allocated(heat)) then
            allocate (heat(n_points, n_bodies))
            call interpolate(n, n_bodies, n_points, points%shape, material%temperature(:, node), heat)
          end if
          do i = 1, n_strains
            stress(:, i, k) = heat(:, k)*held(i, :)
          end do
        end if
        do q = 1, n_points
          stress(q, :, k) = stress(q, :, k) + matmul(varying(:, :, q), strain(q, :))
        end do
        cycle
      end if
      do i = 1, n_strains
        do s = 1, n_strains
          if (.not. abs(material%stiffness(s, i)) > 0) cycle
          stress(:, s, k) = stress(:, s, k) + material%stiffness(s, i)*strain(:, i)
        end do
      end do
    end do
    if (allocated(material%thermal)) then
      call interpolate(n, n_bodies*n_strains, n_points, points%shape, material%thermal(:, :, node), at_rest)
      call add_at_rest()
    end if
    if (.not. material%field%constant) then
      do k = 1, n_bodies
        do s = 1, n_strains
          stress(:, s, k) = modulus*stress(:, s, k)
        end do
      end do
    end if
    if (allocated(material%initial)) then
      call interpolate(n, n_bodies*n_strains, n_points, points%shape, material%initial(:, :, node), at_rest)
      call add_at_rest()
    end if

  contains

    !> Add stresses of bodies at rest.
    subroutine add_at_rest()
      integer :: k, s
      do k = 1, n_bodies
        do s = 1, n_strains
          stress(:, s, k) = stress(:, s, k) + at_rest(:, k, s)
        end do
      end do
    end subroutine add_at_rest
  end subroutine stresses_at
end module dotyk_elasticity_point_stress
