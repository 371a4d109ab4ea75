!> Stresses at the nodes of nearly incompressible quadratic elements, from the mean stresses of the elements.
!>
!> Where the dilatation of a quadratic element is projected on a constant, its displacement is no better than that of a
!> linear one: strains are of first order, at the nodes, too, and so are those recovered from the displacements of the
!> nodes. Their means over elements are of second order. Around each vertex a linear function is fitted to the means
!> (`dotyk_elasticity_dilatation_fit`).
module dotyk_elasticity_stress_of_means
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_dilatation_fit, only: dilatation_fit_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_mean_dilatation, only: mean_dilatations
  use dotyk_elasticity_node_constants, only: find_homes
  use dotyk_elasticity_projected_dilatation, only: n_projection_functions, unprojected_bulk_ratio
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, reference_nodes, shape_functions
  implicit none
  private
  public :: take_stress_of_means

  !> Projected part of the bulk modulus over the other one from which on the means are better: from Poisson's ratio
  !> 0.475 on [].
  real(dp), parameter :: much = 1

contains

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
    !> Stresses in the order of the means; those of some nodes change (6, n_nodes) [pressure].
    real(dp), intent(inout) :: stress(:, :)
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
end module dotyk_elasticity_stress_of_means
