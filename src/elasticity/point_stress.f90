!> Strains, tractions and stiffness of a displacement at single points of elements.
module dotyk_elasticity_point_stress
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_linalg_lapack, only: dpotrf
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: shape_functions, shape_gradients
  implicit none
  private

  !> The material of a body at points.
  type, public :: point_material_t
    !> Strains of the analysis.
    type(energy_form_t) :: form
    !> From strains to stresses (n_strains, n_strains) [pressure].
    real(dp), allocatable :: stiffness(:, :)
    !> Its Cholesky factor R, stiffness = R^T R (n_strains, n_strains) [sqrt(pressure)].
    real(dp), allocatable :: root(:, :)
    !> Number of gradient slots.
    integer :: slots = 0
    !> Modulus field.
    type(vector_field_t) :: factor
  contains
    procedure :: init => point_material_init
  end type point_material_t

  !> Points on faces are moved towards the centre of the element by this fraction to find the modulus of the element.
  real(dp), parameter :: inward = 1.0e-6_dp

  public :: modulus_at, strains_at, traction_at

contains

  !> Create the material of an analysis; the modulus field is set elsewhere.
  subroutine point_material_init(self, analysis, matrix)
    class(point_material_t), intent(inout) :: self
    !> Type of analysis: one of the `analysis_*` constants.
    integer, intent(in) :: analysis
    !> Stiffness: from strains to stresses (6, 6) [pressure].
    real(dp), intent(in) :: matrix(6, 6)
    integer :: k, n, info
    call self%form%init(analysis, matrix)
    self%slots = gradient_slots(analysis)
    n = self%form%n_strains
    allocate (self%stiffness(n, n), source=0.0_dp)
    do k = 1, self%form%n_terms
      associate (s => self%form%pair(1, k), t => self%form%pair(2, k), c => self%form%coefficient(k))
        self%stiffness(s, t) = self%stiffness(s, t) + c/2
        self%stiffness(t, s) = self%stiffness(t, s) + c/2
      end associate
    end do
    self%root = self%stiffness
    call dpotrf('U', n, self%root, n, info)
    do k = 1, n
      self%root(k + 1:, k) = 0
    end do
  end subroutine point_material_init

  !> Tractions at a point of a face of an element, and the modulus factor beside it.
  subroutine traction_at(mesh, material, kind, node, u, xi, normal, traction, modulus, error)
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Material.
    type(point_material_t), intent(in) :: material
    !> Kind of the element.
    integer, intent(in) :: kind
    !> Its nodes (n).
    integer, intent(in) :: node(:)
    !> Displacements (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> Reference coordinates (dim) [].
    real(dp), intent(in) :: xi(:)
    !> Unit normal (dim) [].
    real(dp), intent(in) :: normal(:)
    !> Tractions (dim, n_bodies) [pressure].
    real(dp), intent(out) :: traction(:, :)
    !> Modulus factor in the element [].
    real(dp), intent(out) :: modulus
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: strain(material%form%n_strains, size(u, 1)), stress(material%form%n_strains, size(u, 1))
    real(dp) :: inverse(size(xi), size(xi)), position(size(xi)), determinant
    integer :: i, k, s
    call strains_at(mesh, material, kind, node, u, xi, position, inverse, determinant, strain)
    modulus = 1
    if (.not. material%factor%constant) then
      position = position + inward*(sum(mesh%x(:, node), dim=2)/size(node) - position)
      call modulus_at(material%factor, position, modulus, error)
      if (allocated(error)) return
    end if
    stress = modulus*matmul(material%stiffness, strain)
    traction = 0
    do s = 1, size(xi)
      do i = 1, size(xi)
        k = material%form%index(i, s)
        if (k > 0) traction(i, :) = traction(i, :) + normal(s)*stress(k, :)
      end do
    end do
  end subroutine traction_at

  !> Strains at a point of an element.
  pure subroutine strains_at(mesh, material, kind, node, u, xi, position, inverse, determinant, strain)
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Material, for its strains.
    type(point_material_t), intent(in) :: material
    !> Kind of the element.
    integer, intent(in) :: kind
    !> Its nodes (n).
    integer, intent(in) :: node(:)
    !> Displacements (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> Reference coordinates (dim) [].
    real(dp), intent(in) :: xi(:)
    !> Position (dim) [length].
    real(dp), intent(out) :: position(:)
    !> Derivatives of the reference coordinates m by coordinates k (dim, dim) [1/length].
    real(dp), intent(out) :: inverse(:, :)
    !> Determinant of the Jacobian; the other results are undefined where it is not positive [volume].
    real(dp), intent(out) :: determinant
    !> Strains (n_strains, n_bodies) [].
    real(dp), intent(out) :: strain(:, :)
    real(dp) :: shape(size(node)), gradient(size(xi), size(node)), x(size(xi), size(node))
    real(dp) :: slope(size(u, 1)), jacobian(size(xi), size(xi))
    integer :: a, i, k, s
    call shape_functions(kind, xi, shape)
    call shape_gradients(kind, xi, gradient)
    x = mesh%x(:, node)
    position = matmul(x, shape)
    jacobian = matmul(x, transpose(gradient))
    call invert(jacobian, inverse, determinant)
    strain = 0
    if (.not. determinant > 0) return
    gradient = matmul(transpose(inverse), gradient)
    do s = 1, size(xi)
      do i = 1, size(xi)
        k = material%form%index(i, s)
        if (k == 0) cycle
        slope = 0
        do a = 1, size(node)
          slope = slope + gradient(s, a)*u(:, i, node(a))
        end do
        strain(k, :) = strain(k, :) + slope
      end do
    end do
    if (material%slots == size(xi)) return
    k = material%form%index(1, 3)
    do a = 1, size(node)
      strain(k, :) = strain(k, :) + shape(a)/position(1)*u(:, 1, node(a))
    end do
  end subroutine strains_at

  !> The modulus factor at a point.
  subroutine modulus_at(factor, position, modulus, error)
    !> Modulus field.
    type(vector_field_t), intent(in) :: factor
    !> The point (dim) [length].
    real(dp), intent(in) :: position(:)
    !> The factor [].
    real(dp), intent(out) :: modulus
    !> Allocated where the field has no value.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: value(3)
    modulus = 1
    if (factor%constant) return
    call factor%evaluate(position, value, error)
    modulus = max(value(1), tiny(modulus))
  end subroutine modulus_at

  !> Inverse and determinant of d x_k / d xi_m, as derivatives of xi_m by x_k.
  pure subroutine invert(jacobian, inverse, determinant)
    !> Jacobian (dim, dim) [length].
    real(dp), intent(in) :: jacobian(:, :)
    !> Inverse (dim, dim) [1/length].
    real(dp), intent(out) :: inverse(:, :)
    !> Determinant [volume].
    real(dp), intent(out) :: determinant
    integer :: i, k, i1, i2, k1, k2
    if (size(jacobian, 1) == 2) then
      inverse(1, 1) = jacobian(2, 2)
      inverse(2, 1) = -jacobian(2, 1)
      inverse(1, 2) = -jacobian(1, 2)
      inverse(2, 2) = jacobian(1, 1)
    else
      do k = 1, 3
        k1 = mod(k, 3) + 1
        k2 = mod(k + 1, 3) + 1
        do i = 1, 3
          i1 = mod(i, 3) + 1
          i2 = mod(i + 1, 3) + 1
          inverse(i, k) = jacobian(k1, i1)*jacobian(k2, i2) - jacobian(k1, i2)*jacobian(k2, i1)
        end do
      end do
    end if
    determinant = dot_product(jacobian(1, :), inverse(:, 1))
    if (determinant > 0) inverse = inverse/determinant
  end subroutine invert
end module dotyk_elasticity_point_stress
