!> Projected dilatation: what keeps nearly incompressible materials from locking.
!>
!> The energy density is e.C e/2 with the strain e. Of a nearly incompressible material most of C is b m m^T, m = (1 1 1 0 0 0) and b
!> a part of its bulk modulus: then the dilatation m.e must nearly vanish wherever it is evaluated, and there are not enough
!> displacements for so many conditions. So the material is split, C = C' + b m m^T with C' positive semidefinite
!> (`dotyk_elasticity_material`), and of the second part only the projection of m.e onto a few functions on each element counts: its mean,
!> or a polynomial of degree one in space. It is the mixed method with discontinuous pressures, with these eliminated (Malkus and
!> Hughes, Comput. Methods Appl. Mech. Eng. 15, 1978), and the B-bar method for isotropic materials. Stable are
!>
!> - the mean on quad4 and hex8 in displacements (the pressures of single elements may alternate, see `dotyk_elasticity_pressure_fit`);
!> - the mean on tri6, tet10, quad8, hex20 and prisms of order two; polynomials of degree one on quad9 and hex27 (Boffi, Brezzi,
!>   Fortin, Mixed Finite Element Methods and Applications, 2013, chapter 8; Chapelle and Bathe, Comput. Struct. 47, 1993);
!> - nothing on linear simplices and prisms: these are made quadratic first (`dotyk_mesh_second_order`).
!>
!> The projection is that of the stiffness's quadrature, weighted with the factor on the stiffness. In axisymmetric analyses u_r/r is part
!> of the dilatation.
module dotyk_elasticity_dilatation
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_hex27, element_quad9
  implicit none
  private
  public :: n_projections, projection_functions, projected_dilatations, add_projected_stiffness

  !> Most functions on an element.
  integer, parameter, public :: most_projections = 4

  !> A function of which less than this is left, when those before it are taken off, is none.
  real(dp), parameter :: nothing_left = 1.0e-8_dp

contains

  !> Number of functions on an element of a kind.
  pure integer function n_projections(kind, dimension) result(n)
    integer, intent(in) :: kind, dimension
    n = 1
    if (kind == element_quad9 .or. kind == element_hex27) n = 1 + dimension
  end function n_projections

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
    real(dp) :: length, before
    integer :: j, k, pass
    do j = 1, n_functions
      if (j == 1) then
        value(:, j) = 1
      else
        ! From the first node, so that elements far from the origin lose no digits.
        k = j - 1
        value(:, j) = matmul(x(k, :) - x(k, 1), shape)
      end if
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
  end subroutine projection_functions

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
end module dotyk_elasticity_dilatation
