!> Projected dilatation: the B-bar method against volumetric locking of nearly incompressible materials.
!>
!> The energy density is e.C e/2 with the strain e. Most of the stiffness C of a nearly incompressible material is b m
!> m^T, m = (1 1 1 0 0 0), with b a part of the bulk modulus. The dilatation m.e must then nearly vanish at every
!> quadrature point, and the elements have too few displacements for so many conditions: they lock. The material is
!> split, C = C' + b m m^T with C' positive semidefinite (`material_split` in `dotyk_elasticity_material`), and of the
!> second term only the L2 projection of m.e onto a few functions on each element counts: its mean, or a polynomial of
!> degree one in space. This is the mixed displacement-pressure method with discontinuous pressures, eliminated
!> element by element (Malkus and Hughes, Comput. Methods Appl. Mech. Eng. 15, 1978), and the B-bar method (Hughes,
!> Int. J. Numer. Methods Eng. 15, 1980) for isotropic materials. Stable pairs are
!>
!> - the mean on quad4 and hex8, as far as displacements go (element pressures may alternate:
!>   `dotyk_elasticity_dilatation_fit`);
!> - the mean on tri6, tet10, prisms and pyramids of order two; polynomials of degree one on quad9 and hex27 (Boffi,
!>   Brezzi and Fortin, Mixed Finite Element Methods and Applications, 2013, chapter 8; Chapelle and Bathe, Comput.
!>   Struct. 47, 1993);
!> - none on linear simplices, prisms and pyramids: order elevation comes first (`dotyk_mesh_order_elevation`).
!>
!> C' keeps as much of the bulk modulus as the element bears without locking; materials below that are not split, so
!> that solutions depend continuously on the material. The kept part is needed where only the mean is projected on a
!> quadratic element: otherwise the rest of its dilatation would cost no energy, and displacement errors would be ten
!> times larger (grad-div stabilization; Olshanskii and Reusken, Math. Comput. 73, 2004).
!>
!> Where the projected part b of the bulk modulus varies within an element by more than the modulus field, pressures p
!> are sought among the projection functions times that field: they make int p m.e - p^2/(2 b) stationary, and the
!> functions are orthonormal with the weight 1/b. Where b varies by more than a factor of 4, as in an element of which
!> only a part is nearly incompressible, the excess is left unprojected (`limit_projected_part`).
!>
!> The projection uses the quadrature of the stiffness, weighted with the modulus field. In axisymmetric analyses
!> u_r/r is part of the dilatation.
module dotyk_elasticity_projected_dilatation
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: no_offset
  use dotyk_mesh_element, only: element_hex27, element_kind, element_kind_t, element_quad9
  implicit none
  private
  public :: unprojected_bulk_ratio, n_projection_functions, project_onto_functions, projection_functions
  public :: projected_dilatations, add_projected_stiffness, limit_projected_part

  integer, parameter, public :: max_projection_functions = 4  !! Largest number of projection functions on an element.

  !> Ratio of bulk to shear modulus that elements bear without locking: that of Poisson's ratio 0.4.
  real(dp), parameter :: locking_free_ratio = 14.0_dp/3
  !> The same for quadratic elements of which only the mean dilatation is projected: Poisson's ratio 0.45.
  real(dp), parameter :: locking_free_ratio_of_mean = 29.0_dp/3

  real(dp), parameter :: most_variation = 4.0_dp  !! Greatest ratio of projected bulk moduli in an element [].

contains

  !> Part of the ratio of bulk to shear modulus that is not projected [].
  pure real(dp) function unprojected_bulk_ratio(kind, incompressibility) result(kept)
    integer, intent(in) :: kind  !! Element kind: one of the `element_*` constants.
    real(dp), intent(in) :: incompressibility  !! Ratio of bulk to shear modulus of the material [].
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    if (properties%order == 1) then
      ! Decreasing with the ratio: linear elements are best without any.
      kept = locking_free_ratio
      if (incompressibility > locking_free_ratio) kept = locking_free_ratio**2/incompressibility
    else if (n_projection_functions(kind, properties%dimension) > 1) then
      kept = locking_free_ratio
    else
      kept = locking_free_ratio_of_mean
    end if
  end function unprojected_bulk_ratio

  !> Number of projection functions on an element.
  pure integer function n_projection_functions(kind, dimension) result(n)
    integer, intent(in) :: kind  !! Element kind: one of the `element_*` constants.
    integer, intent(in) :: dimension  !! Number of coordinates.
    n = 1
    if (kind == element_quad9 .or. kind == element_hex27) n = 1 + dimension
  end function n_projection_functions

  !> Limit the variation of the projected part of the bulk modulus within an element: the excess joins the unprojected
  !> part.
  pure subroutine limit_projected_part(n_points, bulk, matrix)
    integer, intent(in) :: n_points  !! Number of quadrature points.
    !> Projected parts of the bulk modulus; 0 at all points on return where there is none at one (n_points) [pressure].
    real(dp), intent(inout) :: bulk(n_points)
    real(dp), intent(inout) :: matrix(6, 6, n_points)  !! Unprojected, from strains to stresses [pressure].
    real(dp) :: most
    integer :: q
    most = most_variation*minval(bulk)
    do q = 1, n_points
      if (.not. bulk(q) > most) cycle
      matrix(1:3, 1:3, q) = matrix(1:3, 1:3, q) + (bulk(q) - most)
      bulk(q) = most
    end do
  end subroutine limit_projected_part

  !> Evaluate the projection functions at the quadrature points of an element: orthonormal in the weighted sum over
  !> them.
  pure subroutine projection_functions(n, dim, n_points, n_functions, shape, x, w, value)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: n_functions  !! Number of projection functions.
    real(dp), intent(in) :: shape(n, n_points)  !! Shape functions (n, n_points) [].
    real(dp), intent(in) :: x(dim, n)  !! Nodes (dim, n) [length].
    real(dp), intent(in) :: w(n_points)  !! Weights times the modulus field (n_points) [volume].
    real(dp), intent(out) :: value(n_points, n_functions)  !! Values of the functions [1/sqrt(volume)].
    integer :: j
    ! Relative to the first node: no cancellation in elements far from the origin.
    do j = 2, n_functions
      value(:, j) = matmul(x(j - 1, :) - x(j - 1, 1), shape)
    end do
    call orthonormalize(n_points, n_functions, w, value)
  end subroutine projection_functions

  !> Replace a function by its L2 projection onto the projection functions of an element.
  pure subroutine project_onto_functions(dim, n_points, n_functions, place, w, f)
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: n_functions  !! Number of projection functions.
    real(dp), intent(in) :: place(n_points, dim)  !! Quadrature points (n_points, dim) [length].
    real(dp), intent(in) :: w(n_points)  !! Weights times the modulus field (n_points) [volume].
    real(dp), intent(inout) :: f(n_points)  !! Values of the function, replaced by those of its projection [].
    real(dp) :: value(n_points, n_functions)
    integer :: j
    do j = 2, n_functions
      value(:, j) = place(:, j - 1) - place(1, j - 1)
    end do
    call orthonormalize(n_points, n_functions, w, value)
    f = matmul(value, matmul(w*f, value))
  end subroutine project_onto_functions

  !> Orthonormalize functions in the weighted sum over the points; the first one becomes constant.
  pure subroutine orthonormalize(n_points, n_functions, w, value)
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: n_functions  !! Number of projection functions.
    real(dp), intent(in) :: w(n_points)  !! Weights (n_points) [volume].
    !> Values of the functions, of which the first is set here (n_points, n_functions) [1/sqrt(volume)] on return.
    real(dp), intent(inout) :: value(n_points, n_functions)
    real(dp) :: length, before
    integer :: j, k, pass
    value(:, 1) = 1
    do j = 1, n_functions
      before = sqrt(sum(w*value(:, j)**2))
      ! Gram-Schmidt twice: in flat elements oblique to the axes the functions are nearly dependent.
      do pass = 1, 2
        do k = 1, j - 1
          value(:, j) = value(:, j) - sum(w*value(:, k)*value(:, j))*value(:, k)
        end do
      end do
      length = sqrt(sum(w*value(:, j)**2))
      if (length > no_offset*before) then
        value(:, j) = value(:, j)/length
      else
        value(:, j) = 0
      end if
    end do
  end subroutine orthonormalize

  !> Coefficients of the projected dilatation as linear forms of the nodal displacements.
  pure subroutine projected_dilatations(n, dim, slots, n_points, n_functions, g, w, value, d)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: n_functions  !! Number of projection functions.
    !> Gradients of the shape functions; third slot N/r in axisymmetric analyses (n, slots, n_points) [1/length].
    real(dp), intent(in) :: g(n, slots, n_points)
    real(dp), intent(in) :: w(n_points)  !! Weights times the modulus field (n_points) [volume].
    real(dp), intent(in) :: value(n_points, n_functions)  !! Projection functions at the points [1/sqrt(volume)].
    real(dp), intent(out) :: d(n, dim, n_functions)  !! Coefficients by displacements [sqrt(volume)/length].
    integer :: i, j, q
    d = 0
    do j = 1, n_functions
      do q = 1, n_points
        do i = 1, dim
          d(:, i, j) = d(:, i, j) + (w(q)*value(q, j))*g(:, i, q)
        end do
        if (slots > dim) d(:, 1, j) = d(:, 1, j) + (w(q)*value(q, j))*g(:, 3, q)
      end do
    end do
  end subroutine projected_dilatations

  !> Add the stiffness of the projected dilatation to an element stiffness.
  pure subroutine add_projected_stiffness(n, dim, n_functions, bulk, d, k)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n_functions  !! Number of projection functions.
    real(dp), intent(in) :: bulk  !! Projected part of the bulk modulus [pressure].
    real(dp), intent(in) :: d(n, dim, n_functions)  !! Linear forms from `projected_dilatations` [sqrt(volume)/length].
    real(dp), intent(inout) :: k(n, n, dim, dim)  !! Node a, node b, component i, component j [force/length].
    integer :: i, j, b, f
    do j = 1, dim
      do i = 1, dim
        do b = 1, n
          do f = 1, n_functions
            k(:, b, i, j) = k(:, b, i, j) + (bulk*d(b, j, f))*d(:, i, f)
          end do
        end do
      end do
    end do
  end subroutine add_projected_stiffness
end module dotyk_elasticity_projected_dilatation
