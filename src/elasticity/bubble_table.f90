!> Bubbles of an element kind: functions of one degree more than the element has, minus their interpolants, so that they
!> vanish at all nodes. Values and gradients at the points of a rule in the element and of rules on its faces.
!>
!> Simplices have the monomials of the next degree, quadrilaterals and hexahedra those of the next degree in each
!> variable, prisms the products of both. Pyramids have monomials of the collapsed coordinates
!> (`dotyk_mesh_shape_functions`).
module dotyk_elasticity_bubble_table
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: shape_rounding
  use dotyk_elasticity_isoparametric_map, only: point_shape_table_t
  use dotyk_elasticity_shape_table, only: shape_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_prism6, element_pyramid5, element_tet4, &
    element_tri3, kind_dimension, quadrature_rule, reference_nodes, shape_functions, shape_gradients
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_shape_functions, only: collapsed_coordinates
  implicit none
  private

  type, public :: face_bubbles_t  !! Bubbles at the points of one face.
    integer :: n_points = 0  !! Number of points.
    real(dp), allocatable :: on_face(:, :)  !! Reference coordinates on the face (dim - 1, n_points) [].
    real(dp), allocatable :: xi(:, :)  !! Reference coordinates in the element (dim, n_points) [].
    real(dp), allocatable :: value(:, :)  !! Bubbles (n, n_points) [].
    integer, allocatable :: corner(:)  !! Nodes of the element at the corners of the face (n_corners).
    type(point_shape_table_t) :: points  !! Shape functions, and the weights of the points on the face.
    real(dp), allocatable :: normal(:)  !! Outward normal in xi, area by reference area of the face (dim) [].
    !> The same point for the element behind, whose corners i and k of the face are the first and second here; 0 where
    !> the rule has none (n_points, n_corners, n_corners).
    integer, allocatable :: match(:, :, :)
  end type face_bubbles_t

  type, public :: bubble_table_t  !! The bubbles of an element kind.
    integer :: kind = 0  !! Element kind.
    logical :: collapsed = .false.  !! Whether the monomials are those of the collapsed coordinates.
    integer :: n = 0  !! Number of bubbles.
    integer, allocatable :: exponent(:, :)  !! Exponents of their monomials (dim, n).
    real(dp), allocatable :: at_node(:, :)  !! Monomials at the nodes (n, n_nodes) [].
    integer :: degree = 0  !! Degree of the rules.
    integer :: n_points = 0  !! Number of points in the element.
    type(point_shape_table_t) :: points  !! Shape functions there.
    real(dp), allocatable :: value(:, :)  !! Bubbles at the points (n, n_points) [].
    real(dp), allocatable :: gradient(:, :, :)  !! Their derivatives by reference coordinates (n, dim, n_points) [].
    real(dp), allocatable :: slope(:, :, :)  !! By points; 0 for repetitions (points%n_points, n, dim) [].
    type(face_bubbles_t), allocatable :: face(:)  !! The faces (n_faces).
  contains
    procedure :: init => bubble_table_init
    procedure :: values => bubble_table_values
    procedure :: gradients => bubble_table_gradients
  end type bubble_table_t

  public :: points_table

contains

  !> Choose the monomials, and evaluate the bubbles.
  subroutine bubble_table_init(self, kind)
    class(bubble_table_t), intent(out) :: self
    integer, intent(in) :: kind  !! Element kind.
    type(element_kind_t) :: properties
    real(dp), allocatable :: place(:, :), xi(:, :), weight(:)
    logical, allocatable :: kept(:)
    integer :: i, q
    properties = element_kind(kind)
    self%kind = kind
    self%collapsed = properties%corner_kind == element_pyramid5
    call list_monomials(properties, self%exponent)
    self%n = size(self%exponent, 2)
    allocate (place(properties%dimension, properties%n_nodes))
    call reference_nodes(kind, place)
    allocate (self%at_node(self%n, properties%n_nodes))
    do i = 1, properties%n_nodes
      self%at_node(:, i) = monomials(self%exponent, variables(self, place(:, i)))
    end do
    self%degree = rule_degree(properties)
    call quadrature_rule(kind, self%degree, xi, weight)
    call points_table(kind, xi, weight, self%points)
    self%n_points = size(weight)
    allocate (self%value(self%n, self%n_points))
    do q = 1, self%n_points
      self%value(:, q) = self%values(xi(:, q))
    end do
    kept = maxval(abs(self%value), dim=2) > shape_rounding
    self%exponent = self%exponent(:, pack([(i, i=1, self%n)], kept))
    self%at_node = self%at_node(pack([(i, i=1, self%n)], kept), :)
    self%value = self%value(pack([(i, i=1, self%n)], kept), :)
    self%n = count(kept)
    allocate (self%gradient(self%n, properties%dimension, self%n_points), self%face(properties%n_faces))
    do q = 1, self%n_points
      self%gradient(:, :, q) = self%gradients(xi(:, q))
    end do
    allocate (self%slope(self%points%n_points, self%n, properties%dimension), source=0.0_dp)
    do i = 1, properties%dimension
      self%slope(:self%n_points, :, i) = transpose(self%gradient(:, i, :))
    end do
    do i = 1, properties%n_faces
      call init_face(self, properties, place, i, self%face(i))
    end do
  end subroutine bubble_table_init

  !> Evaluate the bubbles on a face.
  subroutine init_face(self, properties, place, f, face)
    class(bubble_table_t), intent(in) :: self
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    real(dp), intent(in) :: place(:, :)  !! Reference coordinates of the nodes (dim, n_nodes) [].
    integer, intent(in) :: f  !! Number of the face.
    type(face_bubbles_t), intent(out) :: face  !! The bubbles there.
    type(element_kind_t) :: of_face
    real(dp), allocatable :: corner(:), weight(:), corner_gradient(:, :)
    real(dp) :: along(3, 2)
    integer :: i, q
    of_face = element_kind(properties%face_kind(f))
    call quadrature_rule(of_face%corner_kind, self%degree, face%on_face, weight)
    face%n_points = size(weight)
    face%corner = properties%face_node(:of_face%n_corners, f)
    allocate (face%xi(properties%dimension, face%n_points), face%value(self%n, face%n_points))
    allocate (corner(of_face%n_corners))
    associate (at_corner => place(:, properties%face_node(:of_face%n_corners, f)))
      do q = 1, face%n_points
        call shape_functions(of_face%corner_kind, face%on_face(:, q), corner)
        face%xi(:, q) = matmul(at_corner, corner)
        face%value(:, q) = self%values(face%xi(:, q))
      end do
      ! Faces of reference elements are flat, and quadrilateral ones are parallelograms.
      allocate (corner_gradient(properties%dimension - 1, of_face%n_corners))
      call shape_gradients(of_face%corner_kind, face%on_face(:, 1), corner_gradient)
      along = 0
      do i = 1, properties%dimension - 1
        along(:properties%dimension, i) = matmul(at_corner, corner_gradient(i, :))
      end do
      if (properties%dimension == 2) along(3, 2) = 1
      along(:, 1) = cross(along(:, 1), along(:, 2))
      face%normal = along(:properties%dimension, 1)
    end associate
    call points_table(self%kind, face%xi, weight, face%points)
    call match_points(of_face, face)
  end subroutine init_face

  !> The points of a face as the element behind it numbers them.
  subroutine match_points(of_face, face)
    type(element_kind_t), intent(in) :: of_face  !! Properties of the face.
    type(face_bubbles_t), intent(inout) :: face  !! The face; `match` is set.
    real(dp) :: at(of_face%n_corners, face%n_points), same(of_face%n_corners)
    integer :: q, i, k, c, m, step
    m = of_face%n_corners
    do q = 1, face%n_points
      call shape_functions(of_face%corner_kind, face%on_face(:, q), at(:, q))
    end do
    allocate (face%match(face%n_points, m, m), source=0)
    do k = 1, m
      do i = 1, m
        step = modulo(k - i, m)
        ! Neighbouring corners, in one direction or the other.
        if (i == k .or. all(step /= [1, m - 1])) cycle
        if (m > 2 .and. step == m - 1) step = -1
        do q = 1, face%n_points
          do c = 1, m
            same(modulo(i - 1 + step*(c - 1), m) + 1) = at(c, q)
          end do
          do c = 1, face%n_points
            if (all(abs(at(:, c) - same) <= shape_rounding)) face%match(q, i, k) = c
          end do
        end do
      end do
    end do
  end subroutine match_points

  !> Shape functions of an element kind at points.
  subroutine points_table(kind, xi, weight, points)
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: xi(:, :)  !! Reference coordinates (dim, n_points) [].
    real(dp), intent(in) :: weight(:)  !! Reference weights (n_points) [].
    type(point_shape_table_t), intent(out) :: points  !! Shape functions there, by points.
    type(shape_table_t) :: table
    type(element_kind_t) :: properties
    real(dp), allocatable :: gradient(:, :)
    integer :: q
    properties = element_kind(kind)
    table%n_nodes = properties%n_nodes
    table%dimension = properties%dimension
    table%n_points = size(weight)
    table%weight = weight
    allocate (table%shape(table%n_nodes, table%n_points))
    allocate (table%gradient(table%n_nodes, table%dimension, table%n_points))
    allocate (gradient(table%dimension, table%n_nodes))
    do q = 1, table%n_points
      call shape_functions(kind, xi(:, q), table%shape(:, q))
      call shape_gradients(kind, xi(:, q), gradient)
      table%gradient(:, :, q) = transpose(gradient)
    end do
    call points%init(table)
  end subroutine points_table

  !> Degree of the rules: exact for products of two gradients on straight elements.
  pure integer function rule_degree(properties) result(degree)
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    degree = 2*properties%order + 2
    if (any(properties%corner_kind == [element_tri3, element_tet4])) degree = degree - 1
  end function rule_degree

  !> Monomials up to the next degree, in the element or in each variable; on pyramids t^c a^a b^b with a, b <= c.
  pure subroutine list_monomials(properties, exponent)
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    integer, allocatable, intent(out) :: exponent(:, :)  !! Their exponents (dim, n).
    integer :: p(3), a, b, c, n, m
    integer :: all_of_them(3, 64)
    m = properties%order + 1
    n = 0
    do c = 0, merge(m, 0, properties%dimension == 3)
      do b = 0, m
        do a = 0, m
          p = [a, b, c]
          if (any(properties%corner_kind == [element_tri3, element_tet4]) .and. sum(p) > m) cycle
          if (properties%corner_kind == element_prism6 .and. a + b > m) cycle
          if (properties%corner_kind == element_pyramid5 .and. max(a, b) > c) cycle
          n = n + 1
          all_of_them(:, n) = p
        end do
      end do
    end do
    exponent = all_of_them(:properties%dimension, :n)
  end subroutine list_monomials

  !> The variables of the monomials at a point.
  pure function variables(table, xi) result(x)
    class(bubble_table_t), intent(in) :: table  !! The bubbles.
    real(dp), intent(in) :: xi(:)  !! Reference coordinates (dim) [].
    real(dp) :: x(size(xi))  !! The variables (dim) [].
    x = xi
    if (table%collapsed) x = collapsed_coordinates(xi)
  end function variables

  !> Values of monomials at a point.
  pure function monomials(exponent, xi) result(value)
    integer, intent(in) :: exponent(:, :)  !! Exponents (dim, n).
    real(dp), intent(in) :: xi(:)  !! Reference coordinates (dim) [].
    real(dp) :: value(size(exponent, 2))
    integer :: i, k
    value = 1
    do i = 1, size(value)
      do k = 1, size(xi)
        if (exponent(k, i) > 0) value(i) = value(i)*xi(k)**exponent(k, i)
      end do
    end do
  end function monomials

  !> Values of the bubbles at a point (n) [].
  pure function bubble_table_values(self, xi) result(value)
    class(bubble_table_t), intent(in) :: self
    real(dp), intent(in) :: xi(:)  !! Reference coordinates (dim) [].
    real(dp) :: value(size(self%exponent, 2))
    real(dp) :: shape(size(self%at_node, 2))
    call shape_functions(self%kind, xi, shape)
    value = monomials(self%exponent, variables(self, xi)) - matmul(self%at_node, shape)
  end function bubble_table_values

  !> Derivatives of the bubbles by reference coordinates at a point (n, dim) [].
  pure function bubble_table_gradients(self, xi) result(gradient)
    class(bubble_table_t), intent(in) :: self
    real(dp), intent(in) :: xi(:)  !! Reference coordinates (dim) [].
    real(dp) :: gradient(size(self%exponent, 2), kind_dimension(self%kind))
    real(dp) :: shape(kind_dimension(self%kind), size(self%at_node, 2)), x(size(xi))
    integer :: lower(size(self%exponent, 1), size(self%exponent, 2)), k
    call shape_gradients(self%kind, xi, shape)
    x = variables(self, xi)
    do k = 1, size(gradient, 2)
      lower = self%exponent
      lower(k, :) = max(lower(k, :) - 1, 0)
      gradient(:, k) = self%exponent(k, :)*monomials(lower, x)
    end do
    ! From derivatives by a, b and t = 1 - xi_3 to those by a t, b t and xi_3; t > 0 at quadrature points.
    if (self%collapsed) then
      gradient(:, :2) = gradient(:, :2)/x(3)
      gradient(:, 3) = matmul(gradient(:, :2), x(:2)) - gradient(:, 3)
    end if
    do k = 1, size(gradient, 2)
      gradient(:, k) = gradient(:, k) - matmul(self%at_node, shape(k, :))
    end do
  end function bubble_table_gradients
end module dotyk_elasticity_bubble_table
