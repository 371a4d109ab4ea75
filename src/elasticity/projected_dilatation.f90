!> Projected dilatation: what keeps nearly incompressible materials from locking.
!>
!> The energy density is e.C e/2 with the strain e. Of a nearly incompressible material most of C is b m m^T, m = (1 1 1 0 0 0) and b
!> a part of its bulk modulus: then the dilatation m.e must nearly vanish wherever it is evaluated, and there are not enough
!> displacements for so many conditions. So the material is split, C = C' + b m m^T with C' positive semidefinite
!> (`dotyk_elasticity_material`), and of the second part only the projection of m.e onto a few functions on each element counts: its mean,
!> or a polynomial of degree one in space. It is the mixed method with discontinuous pressures, with these eliminated (Malkus and
!> Hughes, Comput. Methods Appl. Mech. Eng. 15, 1978), and the B-bar method for isotropic materials. Stable are
!>
!> - the mean on quad4 and hex8, in displacements (pressures of single elements may alternate: output takes their neighbours' mean);
!> - the mean on tri6, tet10 and prisms of order two; polynomials of degree one on quad9 and hex27 (Boffi, Brezzi, Fortin, Mixed
!>   Finite Element Methods and Applications, 2013, chapter 8; Chapelle and Bathe, Comput. Struct. 47, 1993);
!> - nothing on linear simplices and prisms: these are made quadratic first (`dotyk_mesh_order_elevation`).
!>
!> C' keeps a bulk modulus of its own, as much as the element stands without locking: what is below that is not split at all, so that
!> answers depend on the material without a jump. It matters where the mean of a quadratic element is projected: the rest of
!> its dilatation would cost no energy, and displacements would be ten times worse (a grad-div term; Olshanskii and Reusken, Math. Comput.
!> 73, 2004).
!>
!> The projection is that of the stiffness's quadrature, weighted with the factor on the stiffness. In axisymmetric analyses u_r/r is part
!> of the dilatation.
module dotyk_elasticity_projected_dilatation
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_hex27, element_kind, element_kind_t, element_quad9
  implicit none
  private
  public :: unprojected_bulk_ratio, n_projection_functions, project_onto_functions, projection_functions
  public :: projected_dilatations, add_projected_stiffness

  !> Most functions on an element.
  integer, parameter, public :: max_projection_functions = 4

  !> Bulk over shear modulus that elements stand: Poisson's ratios of 0.4 and, for quadratic ones of which the mean is projected, 0.45.
  real(dp), parameter :: bulk_of_linear = 14.0_dp/3, bulk_of_mean = 29.0_dp/3

  !> A function of which less than this is left, when those before it are taken off, is none.
  real(dp), parameter :: nothing_left = 1.0e-8_dp

contains

  !> Bulk over shear modulus that goes with the strains as they are.
  pure real(dp) function unprojected_bulk_ratio(kind, incompressibility) result(kept)
    integer, intent(in) :: kind
    !> Bulk over shear modulus of the material.
    real(dp), intent(in) :: incompressibility
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    if (properties%order == 1) then
      ! Less and less: linear elements want none.
      kept = bulk_of_linear
      if (incompressibility > bulk_of_linear) kept = bulk_of_linear**2/incompressibility
    else if (n_projection_functions(kind, properties%dimension) > 1) then
      kept = bulk_of_linear
    else
      kept = bulk_of_mean
    end if
  end function unprojected_bulk_ratio

  !> Number of functions on an element of a kind.
  pure integer function n_projection_functions(kind, dimension) result(n)
    integer, intent(in) :: kind, dimension
    n = 1
    if (kind == element_quad9 .or. kind == element_hex27) n = 1 + dimension
  end function n_projection_functions

  !> The functions at the quadrature points of an element: orthonormal in the sum over these.
  pure subroutine projection_functions(n, dim, n_points, n_functions, shape, x, w, value)
    !> Numbers of nodes, dimensions, points and functions.
    integer, intent(in) :: n, dim, n_points, n_functions
    !> Shape functions.
    real(dp), intent(in) :: shape(n, n_points)
    !> Nodes [length].
    real(dp), intent(in) :: x(dim, n)
    !> Weights times the factor on the stiffness [volume].
    real(dp), intent(in) :: w(n_points)
    !> [1/sqrt(volume)].
    real(dp), intent(out) :: value(n_points, n_functions)
    integer :: j
    ! From the first node, so that elements far from the origin lose no digits.
    do j = 2, n_functions
      value(:, j) = matmul(x(j - 1, :) - x(j - 1, 1), shape)
    end do
    call orthonormalize(n_points, n_functions, w, value)
  end subroutine projection_functions

  !> The projection of a function on those of an element.
  pure subroutine project_onto_functions(dim, n_points, n_functions, place, w, f)
    !> Numbers of dimensions, points and functions.
    integer, intent(in) :: dim, n_points, n_functions
    !> The points [length].
    real(dp), intent(in) :: place(n_points, dim)
    !> Weights times the factor on the stiffness [volume].
    real(dp), intent(in) :: w(n_points)
    !> Its values at the points; the projection's on return.
    real(dp), intent(inout) :: f(n_points)
    real(dp) :: value(n_points, n_functions)
    integer :: j
    do j = 2, n_functions
      value(:, j) = place(:, j - 1) - place(1, j - 1)
    end do
    call orthonormalize(n_points, n_functions, w, value)
    f = matmul(value, matmul(w*f, value))
  end subroutine project_onto_functions

  !> Make functions orthonormal, the first of which is 1.
  pure subroutine orthonormalize(n_points, n_functions, w, value)
    integer, intent(in) :: n_points, n_functions
    real(dp), intent(in) :: w(n_points)
    !> The first one need not be set.
    real(dp), intent(inout) :: value(n_points, n_functions)
    real(dp) :: length, before
    integer :: j, k, pass
    value(:, 1) = 1
    do j = 1, n_functions
      before = sqrt(sum(w*value(:, j)**2))
      ! Twice: flat elements across the axes make functions that are nearly the same.
      do pass = 1, 2
        do k = 1, j - 1
          value(:, j) = value(:, j) - sum(w*value(:, k)*value(:, j))*value(:, k)
        end do
      end do
      length = sqrt(sum(w*value(:, j)**2))
      if (length > nothing_left*before) then
        value(:, j) = value(:, j)/length
      else
        value(:, j) = 0
      end if
    end do
  end subroutine orthonormalize

  !> Components of the dilatation along the functions, from displacements.
  pure subroutine projected_dilatations(n, dim, slots, n_points, n_functions, g, w, value, d)
    !> Numbers of nodes, displacement components, gradient slots, points and functions.
    integer, intent(in) :: n, dim, slots, n_points, n_functions
    !> Gradients of the shape functions; third slot N/r in axisymmetric analyses [1/length].
    real(dp), intent(in) :: g(n, slots, n_points)
    !> Weights times the factor on the stiffness [volume].
    real(dp), intent(in) :: w(n_points)
    !> The functions at the points.
    real(dp), intent(in) :: value(n_points, n_functions)
    !> Of a node's displacement, component by component [sqrt(volume)/length].
    real(dp), intent(out) :: d(n, dim, n_functions)
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

  !> Add the stiffness of the projected dilatation.
  pure subroutine add_projected_stiffness(n, dim, n_functions, bulk, d, k)
    !> Numbers of nodes, displacement components and functions.
    integer, intent(in) :: n, dim, n_functions
    !> The part of the bulk modulus that belongs to it [pressure].
    real(dp), intent(in) :: bulk
    !> From `projected_dilatations`.
    real(dp), intent(in) :: d(n, dim, n_functions)
    !> Stiffness: node a, node b, component i, component j [force/length].
    real(dp), intent(inout) :: k(n, n, dim, dim)
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
