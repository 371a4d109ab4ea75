!> Penalty parameters by mesh size: theta = factor (h_a/E_a + h_b/E_b) at every quadrature point, with the size h of the
!> facet and Young's modulus E at the point. With theta ~ h/E the penalty keeps the order of convergence in h
!> (Chouly and Hild, Appl. Numer. Math. 65, 2013).
module dotyk_model_mesh_theta
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_mesh_element, only: kind_nodes, quadrature_rule
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_row_theta, only: set_row_theta
  implicit none
  private
  public :: set_mesh_theta

contains

  !> Set the penalty parameters of a pair.
  subroutine set_mesh_theta(factor, body_a, surface_a, body_b, surface_b, pair, error)
    real(dp), intent(in) :: factor  !! Factor of h/E [].
    type(body_t), intent(in) :: body_a  !! Body of the slave side.
    type(body_t), intent(in) :: body_b  !! Body of the master side.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    type(contact_pair_t), intent(inout) :: pair  !! The contact pair; its penalty parameters are set.
    !> Allocated where a modulus field cannot be evaluated; assembly finds that first.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: at_points(:)
    allocate (at_points(pair%n_points), source=0.0_dp)
    call add_side(body_a, surface_a, pair%facet_a, pair%position, at_points, error)
    if (allocated(error)) return
    call add_side(body_b, surface_b, pair%facet_b, pair%position, at_points, error)
    if (allocated(error)) return
    call set_row_theta(factor, at_points, pair)
  end subroutine set_mesh_theta

  !> Add h/E of one side at the points.
  subroutine add_side(body, surface, facet, position, at_points, error)
    type(body_t), intent(in) :: body  !! Body of the side.
    type(surface_t), intent(in) :: surface  !! Surface of the side.
    integer, intent(in) :: facet(:)  !! Facet of each point (n_points).
    real(dp), intent(in) :: position(:, :)  !! Positions of the points (dimension, n_points) [length].
    !> Sum of h/E at the points (n_points) [length/pressure]; that of the side is added.
    real(dp), intent(inout) :: at_points(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field cannot be evaluated.
    type(material_field_t) :: stiffness(size(body%material))
    real(dp), allocatable :: size_of(:), point(:, :), weight(:)
    real(dp) :: value(3), young
    integer :: i, m, of_rule
    ! Sizes are computed when needed: most facets may have no points.
    allocate (size_of(surface%n_facets), source=-1.0_dp)
    do m = 1, size(stiffness)
      if (.not. allocated(error)) call stiffness(m)%init(body%material(m), error)
    end do
    value(1) = body%mean_modulus_factor
    young = body%young()
    of_rule = 0
    do i = 1, size(facet)
      if (allocated(error)) exit
      associate (f => facet(i), kind => surface%kind(facet(i)))
        if (size_of(f) < 0) then
          if (kind /= of_rule) call quadrature_rule(kind, 2, point, weight)
          of_rule = kind
          size_of(f) = facet_size(kind, body%mesh%x(:, surface%node(1:kind_nodes(kind), f)), point, weight)
        end if
      end associate
      m = 1
      if (size(stiffness) > 1) then
        ! The material behind the facet; that of the body is compared with the first one.
        m = body%mesh%block(surface%block(facet(i)))%material
        value(1) = 1
      end if
      if (.not. stiffness(m)%constant) call stiffness(m)%factor_at(position(:, i), value(1), error)
      if (allocated(error)) exit
      if (m > 1) value(1) = value(1)*(body%material(m)%least_young/body%material(1)%least_young)
      ! A modulus that vanishes on the surface must not make theta infinite.
      at_points(i) = at_points(i) + size_of(facet(i))/(young*max(value(1)/body%mean_modulus_factor, 1.0e-3_dp))
    end do
    do m = 1, size(stiffness)
      call stiffness(m)%destroy()
    end do
  end subroutine add_side

  !> Size of a facet: its length, or the root of its area [length].
  real(dp) function facet_size(kind, x, point, weight) result(length)
    integer, intent(in) :: kind  !! Element kind of the facet.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the facet (dimension, n_nodes) [length].
    real(dp), intent(in) :: point(:, :)  !! Points of a rule (dimension-1, n_points) [].
    real(dp), intent(in) :: weight(:)  !! Its weights (n_points) [].
    real(dp) :: position(size(x, 1)), normal(size(x, 1)), jacobian
    integer :: q
    length = 0
    do q = 1, size(weight)
      call facet_geometry(kind, size(x, 1), x, point(:, q), position, normal, jacobian)
      length = length + weight(q)*jacobian
    end do
    if (size(x, 1) == 3) length = sqrt(length)
  end function facet_size
end module dotyk_model_mesh_theta
