!> Reports on loads and formulas for the log: resultants of loads, and formulas that vary within elements or facets more
!> than quadrature sees.
module dotyk_elasticity_load_report
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_elasticity_part_sums, only: add_up_parts
  use dotyk_elasticity_shape_table, only: load_degree
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, quadrature_rule, shape_functions, shape_gradients
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: load_resultant_t  !! Resultant of one load.
    character(:), allocatable :: place  !! Where it acts, for the log.
    real(dp) :: force(3) = 0  !! Force; along the axis in axisymmetric analyses (3) [force].
    real(dp) :: moment(3) = 0  !! Moment about the origin; 0 in axisymmetric analyses (3) [force length].
    real(dp) :: radial = 0  !! Radial components in axisymmetric analyses, around the circumference [force].
    !> Whether it acts on an edge or nodes of an elastic body, where stress and displacement have no limit.
    logical :: is_concentrated = .false.
    integer, allocatable :: node(:)  !! Nodes of such a load; not allocated for others (n).
  contains
    procedure :: carry => load_resultant_carry
  end type load_resultant_t

  integer, parameter :: more_degrees = 5  !! The second rule is exact to as many degrees more.
  integer, parameter :: most_elements = 20000  !! Elements looked at, at most: evaluating formulas takes time.

  public :: resultant_of, difference_on_surface, difference_in_volume

contains

  !> Resultant of nodal forces. All ranks find that of a body in parts together.
  function resultant_of(mesh, analysis, force, place) result(resultant)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: force(:, :)  !! Nodal forces of the load (dim, n_nodes) [force].
    character(*), intent(in) :: place  !! Where it acts.
    type(load_resultant_t) :: resultant
    real(dp) :: x(3), f(3), sums(6)
    integer :: i, d
    d = mesh%dimension
    resultant%place = place
    sums = 0
    x = 0
    f = 0
    do i = 1, size(force, 2)
      if (.not. mesh%is_own_node(i)) cycle
      x(:d) = mesh%x(:, i)
      f(:d) = force(:, i)
      sums = sums + [f, x(2)*f(3) - x(3)*f(2), x(3)*f(1) - x(1)*f(3), x(1)*f(2) - x(2)*f(1)]
    end do
    call add_up_parts(mesh, sums)
    resultant%force = sums(1:3)
    if (analysis == analysis_axisymmetric) then
      resultant%radial = resultant%force(1)
      resultant%force(1) = 0
    else
      resultant%moment = sums(4:6)
    end if
  end function resultant_of

  !> Difference of two rules for the integrals of formulas over a surface, times linear shape functions, as a fraction
  !> of the integral of their size; 0 without formulas, and where one has no value, which is reported elsewhere.
  real(dp) function difference_on_surface(mesh, surface, formula) result(difference)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(surface_t), intent(in) :: surface  !! The surface.
    type(text_t), intent(in), allocatable :: formula(:)  !! Formulas (<= 3); none where not allocated.
    type(vector_field_t) :: field
    type(element_kind_t) :: kind
    type(error_t), allocatable :: error
    real(dp) :: total(2)
    integer :: f, step
    difference = 0
    call field%init([0.0_dp, 0.0_dp, 0.0_dp], error, formula)
    total = 0
    if (.not. field%constant .and. .not. allocated(error)) then
      step = 1 + surface%n_facets/most_elements
      do f = 1, surface%n_facets, step
        kind = element_kind(surface%kind(f))
        call compare(surface%kind(f), mesh%dimension, mesh%x(:, surface%node(:kind%n_nodes, f)), field, total, error)
        if (allocated(error)) exit
      end do
      if (total(2) > 0 .and. .not. allocated(error)) difference = total(1)/total(2)
    end if
    call field%destroy()
  end function difference_on_surface

  !> The same over the elements; all ranks find that of a body in parts together.
  real(dp) function difference_in_volume(mesh, formula) result(difference)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(text_t), intent(in), allocatable :: formula(:)  !! Formulas (<= 3); none where not allocated.
    type(vector_field_t) :: field
    type(error_t), allocatable :: error
    real(dp) :: total(2)
    integer :: b, e, step, before
    difference = 0
    call field%init([0.0_dp, 0.0_dp, 0.0_dp], error, formula)
    total = 0
    if (.not. field%constant .and. .not. allocated(error)) then
      step = 1 + mesh%n_elements()/most_elements
      before = 0
      do b = 1, size(mesh%block)
        do e = 1, size(mesh%block(b)%node, 2), step
          if (.not. mesh%is_own_element(before + e)) cycle
          call compare(mesh%block(b)%kind, mesh%dimension, mesh%x(:, mesh%block(b)%node(:, e)), field, total, error)
          if (allocated(error)) exit
        end do
        before = before + size(mesh%block(b)%node, 2)
      end do
      if (allocated(error)) total = 0
      call add_up_parts(mesh, total)
      if (total(2) > 0) difference = total(1)/total(2)
    end if
    call field%destroy()
  end function difference_in_volume

  !> Add the difference of the two rules on one element or facet, and the integral of the field's size.
  subroutine compare(kind, dim, x, field, total, error)
    integer, intent(in) :: kind  !! Kind of the element or facet.
    integer, intent(in) :: dim  !! Number of coordinates.
    real(dp), intent(in) :: x(:, :)  !! Its nodes (dim, n_nodes) [length].
    type(vector_field_t), intent(in) :: field  !! The formulas.
    real(dp), intent(inout) :: total(2)  !! Difference and size, added to (2) [integral of the field].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula has no value.
    type(element_kind_t) :: properties
    real(dp), allocatable :: point(:, :), weight(:), shape(:), linear(:), gradient(:, :), integral(:, :, :)
    real(dp) :: position(dim), normal(dim), value(3), area
    integer :: q, rule
    properties = element_kind(kind)
    allocate (shape(properties%n_nodes), linear(properties%n_corners), integral(3, properties%n_corners, 2))
    allocate (gradient(properties%dimension, properties%n_nodes))
    integral = 0
    do rule = 1, 2
      call quadrature_rule(kind, load_degree(properties%order) + merge(0, more_degrees, rule == 1), point, weight)
      do q = 1, size(weight)
        if (properties%dimension < dim) then
          call facet_geometry(kind, dim, x, point(:, q), position, normal, area)
        else
          call shape_functions(kind, point(:, q), shape)
          call shape_gradients(kind, point(:, q), gradient)
          position = matmul(x, shape)
          area = abs(determinant(matmul(x, transpose(gradient))))
        end if
        area = area*weight(q)
        call field%evaluate(position, value, error)
        if (allocated(error)) return
        call shape_functions(properties%corner_kind, point(:, q), linear)
        integral(:, :, rule) = integral(:, :, rule) + area*spread(value, 2, size(linear))*spread(linear, 1, 3)
        if (rule == 2) total(2) = total(2) + area*sum(abs(value))
      end do
    end do
    total(1) = total(1) + sum(abs(integral(:, :, 1) - integral(:, :, 2)))
  end subroutine compare

  !> Determinant of two or three rows.
  pure real(dp) function determinant(a)
    real(dp), intent(in) :: a(:, :)  !! The matrix (dim, dim) [length].
    if (size(a, 1) == 2) then
      determinant = a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1)
    else
      determinant = a(1, 1)*(a(2, 2)*a(3, 3) - a(2, 3)*a(3, 2)) - a(1, 2)*(a(2, 1)*a(3, 3) - a(2, 3)*a(3, 1)) + &
                    a(1, 3)*(a(2, 1)*a(3, 2) - a(2, 2)*a(3, 1))
    end if
  end function determinant

  !> Put a resultant into a parcel, or take it out.
  subroutine load_resultant_carry(self, parcel)
    class(load_resultant_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%place)
    call parcel%carry_fixed(3, self%force)
    call parcel%carry_fixed(3, self%moment)
    call parcel%carry(self%radial)
    call parcel%carry(self%is_concentrated)
    call parcel%carry(self%node)
  end subroutine load_resultant_carry
end module dotyk_elasticity_load_report
