!> Shape functions and their gradients at the quadrature points of an element kind, and the isoparametric map of an
!> element.
!>
!> Quadratic simplices have two tables: one that is exact where edges are straight, and one of a higher degree for
!> curved elements.
module dotyk_elasticity_shape_table
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_thresholds, only: no_offset
  use dotyk_elasticity_analysis, only: two_pi
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_tet4, element_tri3, element_prism6, &
    element_pyramid5, quadrature_rule, reference_nodes, shape_functions, shape_gradients
  implicit none
  private

  type, public :: shape_table_t  !! Shape functions at the points of one quadrature rule.
    integer :: n_nodes = 0  !! Number of nodes.
    integer :: dimension = 0  !! Number of coordinates.
    integer :: n_points = 0  !! Number of points.
    real(dp), allocatable :: shape(:, :)  !! Shape functions (n_nodes, n_points) [].
    real(dp), allocatable :: gradient(:, :, :)  !! By reference coordinates (n_nodes, dimension, n_points) [].
    real(dp), allocatable :: weight(:)  !! Reference weights (n_points) [].
  contains
    procedure :: init => shape_table_init
  end type shape_table_t

  type, public :: shape_table_pair_t  !! The tables of one element kind.
    type(shape_table_t) :: straight  !! Table for straight elements, or for all where one serves both.
    type(shape_table_t) :: curved  !! Table for curved elements; not set where one table serves both.
    logical :: two = .false.  !! Whether there are two tables.
    !> Linear shape functions at the nodes that are not corners (n_corners, n_nodes - n_corners) [].
    real(dp), allocatable :: corner_shape(:, :)
  contains
    procedure :: init_stiffness => shape_table_pair_init_stiffness
    procedure :: init_load => shape_table_pair_init_load
    procedure :: is_curved => shape_table_pair_is_curved
  end type shape_table_pair_t

  public :: map_element, load_degree

contains

  !> Evaluate the shape functions of an element kind at the points of a rule.
  subroutine shape_table_init(self, kind, degree)
    class(shape_table_t), intent(out) :: self
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: degree  !! Degree of the quadrature rule.
    type(element_kind_t) :: properties
    real(dp), allocatable :: points(:, :), gradients(:, :)
    integer :: q
    properties = element_kind(kind)
    call quadrature_rule(kind, degree, points, self%weight)
    self%n_nodes = properties%n_nodes
    self%dimension = properties%dimension
    self%n_points = size(self%weight)
    allocate (self%shape(self%n_nodes, self%n_points), self%gradient(self%n_nodes, self%dimension, self%n_points))
    allocate (gradients(self%dimension, self%n_nodes))
    do q = 1, self%n_points
      call shape_functions(kind, points(:, q), self%shape(:, q))
      call shape_gradients(kind, points(:, q), gradients)
      self%gradient(:, :, q) = transpose(gradients)
    end do
  end subroutine shape_table_init

  !> Tables for the stiffness of an element kind.
  subroutine shape_table_pair_init_stiffness(self, kind, analysis, varying)
    class(shape_table_pair_t), intent(out) :: self
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    logical, intent(in) :: varying  !! Whether the modulus varies within elements.
    type(element_kind_t) :: properties
    integer :: degree
    properties = element_kind(kind)
    degree = stiffness_degree(properties%corner_kind, properties%order, analysis)
    ! A modulus field counts as a polynomial of degree 2.
    if (varying) degree = degree + 2
    call init_tables(self, kind, properties, degree, degree + 2)
  end subroutine shape_table_pair_init_stiffness

  !> Tables for the nodal forces of a force density.
  subroutine shape_table_pair_init_load(self, kind, analysis, varying)
    class(shape_table_pair_t), intent(out) :: self
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    logical, intent(in) :: varying  !! Whether the force density varies.
    type(element_kind_t) :: properties
    integer :: degree
    properties = element_kind(kind)
    degree = load_degree(properties%order)
    if (is_simplex(properties%corner_kind) .and. .not. varying) then
      ! A shape function, and the radius.
      degree = properties%order + merge(1, 0, analysis == analysis_axisymmetric)
    end if
    call init_tables(self, kind, properties, degree, load_degree(properties%order))
  end subroutine shape_table_pair_init_load

  !> Create both tables.
  subroutine init_tables(self, kind, properties, degree, curved_degree)
    class(shape_table_pair_t), intent(inout) :: self
    integer, intent(in) :: kind  !! Element kind: one of the `element_*` constants.
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    integer, intent(in) :: degree  !! Degree of quadrature on straight elements, and on all that are no simplices.
    integer, intent(in) :: curved_degree  !! Degree of quadrature on curved simplices.
    real(dp), allocatable :: xi(:, :)
    integer :: i
    call self%straight%init(kind, degree)
    self%two = properties%order == 2 .and. is_simplex(properties%corner_kind) .and. curved_degree > degree
    if (.not. self%two) return
    call self%curved%init(kind, curved_degree)
    allocate (xi(properties%dimension, properties%n_nodes))
    call reference_nodes(kind, xi)
    allocate (self%corner_shape(properties%n_corners, properties%n_nodes - properties%n_corners))
    do i = 1, properties%n_nodes - properties%n_corners
      call shape_functions(properties%corner_kind, xi(:, properties%n_corners + i), self%corner_shape(:, i))
    end do
  end subroutine init_tables

  !> Degree of the quadrature of the stiffness: exact on straight elements with a constant material.
  pure integer function stiffness_degree(corner_kind, order, analysis) result(degree)
    integer, intent(in) :: corner_kind  !! Linear kind of the same family.
    integer, intent(in) :: order  !! Order of the element.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    if (is_simplex(corner_kind)) then
      degree = 2*(order - 1)
      ! The radius and N^2/r.
      if (analysis == analysis_axisymmetric) degree = degree + 3
      degree = max(degree, 1)
    else if (any(corner_kind == [element_prism6, element_pyramid5])) then
      degree = 2*order
    else
      degree = 2*order + 1
    end if
  end function stiffness_degree

  !> Whether the reference element is a simplex.
  pure logical function is_simplex(corner_kind)
    integer, intent(in) :: corner_kind  !! Linear kind of the family.
    is_simplex = corner_kind == element_tri3 .or. corner_kind == element_tet4
  end function is_simplex

  !> Degree of the quadrature of loads on elements or facets.
  pure integer function load_degree(order) result(degree)
    integer, intent(in) :: order  !! Order of the element or facet.
    ! Shape function, Jacobian of a curved element, and two or more degrees for the load.
    degree = merge(6, 4, order == 2)
  end function load_degree

  !> Whether an element is curved and needs the second table.
  pure logical function shape_table_pair_is_curved(self, x) result(is_curved)
    class(shape_table_pair_t), intent(in) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodes of the element (dim, n_nodes) [length].
    real(dp) :: size_squared, deviation_squared, middle
    integer :: i, k, corners, c
    is_curved = .false.
    if (.not. self%two) return
    corners = size(self%corner_shape, 1)
    size_squared = 0
    do k = 1, size(x, 1)
      size_squared = max(size_squared, (maxval(x(k, :corners)) - minval(x(k, :corners)))**2)
    end do
    do i = 1, size(self%corner_shape, 2)
      deviation_squared = 0
      do k = 1, size(x, 1)
        middle = 0
        do c = 1, corners
          middle = middle + x(k, c)*self%corner_shape(c, i)
        end do
        deviation_squared = deviation_squared + (x(k, corners + i) - middle)**2
      end do
      if (deviation_squared > no_offset**2*size_squared) is_curved = .true.
    end do
  end function shape_table_pair_is_curved

  !> Gradients of the shape functions in space and quadrature weights of one element.
  pure subroutine map_element(n, dim, slots, n_points, shape, gradient, weight, x, g, w, worst)
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: dim  !! Number of coordinates, 2 or 3.
    integer, intent(in) :: slots  !! Gradient slots: `dim`, or 3 with `dim` 2 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    real(dp), intent(in) :: shape(n, n_points)  !! Shape functions (n, n_points) [].
    real(dp), intent(in) :: gradient(n, dim, n_points)  !! Derivatives by reference coordinates (n, dim, n_points) [].
    real(dp), intent(in) :: weight(n_points)  !! Reference weights (n_points) [].
    real(dp), intent(in) :: x(dim, n)  !! Nodes (dim, n) [length].
    !> Gradients of the shape functions; third slot N/r in axisymmetric analyses (n, slots, n_points) [1/length].
    real(dp), intent(out) :: g(n, slots, n_points)
    real(dp), intent(out) :: w(n_points)  !! Quadrature weights (n_points) [volume].
    !> Smallest Jacobian determinant, or radius in axisymmetric analyses; where it is not positive g and w are
    !> undefined [volume].
    real(dp), intent(out) :: worst
    real(dp) :: jacobian(dim, dim), inverse(dim, dim), determinant, radius
    integer :: q, k, m, a
    worst = huge(1.0_dp)
    do q = 1, n_points
      ! jacobian(k, m) = d x_k / d xi_m
      do m = 1, dim
        do k = 1, dim
          jacobian(k, m) = 0
          do a = 1, n
            jacobian(k, m) = jacobian(k, m) + x(k, a)*gradient(a, m, q)
          end do
        end do
      end do
      call invert(dim, jacobian, inverse, determinant)
      worst = min(worst, determinant)
      if (.not. determinant > 0) then
        worst = min(worst, 0.0_dp)
        return
      end if
      w(q) = weight(q)*determinant
      if (dim == 3) then
        do k = 1, 3
          do a = 1, n
            g(a, k, q) = gradient(a, 1, q)*inverse(1, k) + gradient(a, 2, q)*inverse(2, k) &
              + gradient(a, 3, q)*inverse(3, k)
          end do
        end do
      else
        do k = 1, 2
          do a = 1, n
            g(a, k, q) = gradient(a, 1, q)*inverse(1, k) + gradient(a, 2, q)*inverse(2, k)
          end do
        end do
        if (slots == 3) then
          radius = dot_product(shape(:, q), x(1, :))
          worst = min(worst, radius)
          if (.not. radius > 0) then
            worst = min(worst, 0.0_dp)
            return
          end if
          g(:, 3, q) = shape(:, q)/radius
          w(q) = w(q)*two_pi*radius
        end if
      end if
    end do
  end subroutine map_element

  !> Determinant and inverse of a small matrix; of a singular one, the adjugate.
  pure subroutine invert(dim, matrix, inverse, determinant)
    integer, intent(in) :: dim  !! Order of the matrix, 2 or 3.
    real(dp), intent(in) :: matrix(dim, dim)  !! The matrix (dim, dim) [length].
    real(dp), intent(out) :: inverse(dim, dim)  !! The inverse (dim, dim) [1/length].
    real(dp), intent(out) :: determinant  !! The determinant [volume].
    if (dim == 2) then
      inverse(1, 1) = matrix(2, 2)
      inverse(2, 1) = -matrix(2, 1)
      inverse(1, 2) = -matrix(1, 2)
      inverse(2, 2) = matrix(1, 1)
    else
      inverse(1, 1) = matrix(2, 2)*matrix(3, 3) - matrix(2, 3)*matrix(3, 2)
      inverse(2, 1) = matrix(2, 3)*matrix(3, 1) - matrix(2, 1)*matrix(3, 3)
      inverse(3, 1) = matrix(2, 1)*matrix(3, 2) - matrix(2, 2)*matrix(3, 1)
      inverse(1, 2) = matrix(1, 3)*matrix(3, 2) - matrix(1, 2)*matrix(3, 3)
      inverse(2, 2) = matrix(1, 1)*matrix(3, 3) - matrix(1, 3)*matrix(3, 1)
      inverse(3, 2) = matrix(1, 2)*matrix(3, 1) - matrix(1, 1)*matrix(3, 2)
      inverse(1, 3) = matrix(1, 2)*matrix(2, 3) - matrix(1, 3)*matrix(2, 2)
      inverse(2, 3) = matrix(1, 3)*matrix(2, 1) - matrix(1, 1)*matrix(2, 3)
      inverse(3, 3) = matrix(1, 1)*matrix(2, 2) - matrix(1, 2)*matrix(2, 1)
    end if
    determinant = dot_product(matrix(1, :), inverse(:, 1))
    if (abs(determinant) > 0) inverse = inverse/determinant
  end subroutine invert
end module dotyk_elasticity_shape_table
