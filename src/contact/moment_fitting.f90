!> Weights of a cell that deal out a uniform pressure exactly, on facets of any shape.
!>
!> On flat quadrilaterals that are no parallelograms, shape functions are not polynomials in the plane, and no usual rule
!> has their integrals over a polygon. A rule of high degree has them to round-off; the weights of the points in use are
!> changed by the little that takes to have the integrals of the shape functions of both facets. Then a uniform pressure
!> loads the nodes of both sides as it should, whatever the meshes: the patch test.
module dotyk_contact_moment_fitting
  use dotyk_base_kinds, only: dp
  use dotyk_contact_segment_quadrature, only: most_degree, polygon_rule, rule_table_t
  use dotyk_contact_auxiliary_plane, only: auxiliary_plane_t, reference_centre, inverse_map
  use dotyk_contact_facet_set, only: evaluate_facet, facet_set_t
  use dotyk_contact_polygon, only: polygon_t
  use dotyk_mesh_element, only: kind_nodes, shape_functions
  implicit none
  private
  public :: fit_segment_weights

  !> Functions of which the part that is independent of the others is below this, relative, are looked at closely.
  real(dp), parameter :: dependent = 1e-8_dp
  !> Parts below this are round-off.
  real(dp), parameter :: least_part = 1e-13_dp
  !> Errors of integrals below this are round-off, relative to the area.
  real(dp), parameter :: noise = 3e-15_dp
  !> Greatest change for the sake of such a function.
  real(dp), parameter :: small_change = 0.05_dp
  !> Weights change by less than this part.
  real(dp), parameter :: most_change = 0.5_dp

contains

  !> How much the area per reference area changes over a facet: (greatest - least)/(greatest + least), by its corners.
  pure real(dp) function distortion(set, facet) result(ratio)
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: facet
    real(dp), parameter :: corner(2, 4) = reshape([-1.0_dp, -1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp], [2, 4])
    real(dp) :: area(4)
    real(dp), dimension(3) :: x, xu, xv, xuu, xuv, xvv
    integer :: i
    ratio = 0
    if (set%corners(facet) /= 4) return
    do i = 1, 4
      call evaluate_facet(set%coefficient(:, :, facet), corner(1, i), corner(2, i), x, xu, xv, xuu, xuv, xvv)
      area(i) = dot_product(set%axis(:, facet), [xu(2)*xv(3) - xu(3)*xv(2), xu(3)*xv(1) - xu(1)*xv(3), &
                                                 xu(1)*xv(2) - xu(2)*xv(1)])
    end do
    ratio = min(0.9_dp, (maxval(area) - minval(area))/max(maxval(area) + minval(area), tiny(ratio)))
  end function distortion

  !> Change the weights of a cell.
  pure subroutine fit_segment_weights(chart, set_a, facet_a, kind_a, set_b, facet_b, kind_b, polygon, table, xi, weight, fits)
    !> Chart of the facet of a, which is straight.
    type(auxiliary_plane_t), intent(in) :: chart
    !> The facets, and their kinds; both flat, and parallel.
    type(facet_set_t), intent(in) :: set_a, set_b
    integer, intent(in) :: facet_a, kind_a, facet_b, kind_b
    !> The cell in the chart.
    type(polygon_t), intent(in) :: polygon
    type(rule_table_t), intent(in) :: table
    !> Points in the reference coordinates of facet a (2, n) and weights there (n).
    real(dp), intent(in) :: xi(:, :)
    real(dp), intent(inout) :: weight(:)
    !> It takes but a little change; else the weights stay, and more points are called for.
    logical, intent(out) :: fits
    real(dp), allocatable :: points(:, :), weights(:), values(:, :), integrals(:), fitted(:), plane(:, :), scale(:)
    real(dp) :: part, ratio
    real(dp), dimension(3) :: x, xu, xv, xuu, xuv, xvv
    integer :: n, m, i, degree
    logical :: ok
    fits = .false.
    ! Square-root singularities lie outside the cell by this ratio: the error of a rule falls like a power of it.
    part = min(1.0_dp, norm2(maxval(polygon%x(:, 1:polygon%n), dim=2) - minval(polygon%x(:, 1:polygon%n), dim=2))/ &
                       min(set_a%size(facet_a), set_b%size(facet_b)))
    ratio = max(1e-3_dp, part*max(distortion(set_a, facet_a), distortion(set_b, facet_b)))
    degree = min(most_degree, 6 + ceiling(32/log(1/ratio + sqrt(1/ratio**2 - 1))))
    call polygon_rule(polygon, table, degree, m, points, weights, ok)
    if (.not. ok) return
    n = kind_nodes(kind_a) + kind_nodes(kind_b)
    allocate (values(n, max(m, size(weight))), integrals(n), plane(2, size(weight)), scale(size(weight)))
    call all_shapes(points, values(:, 1:m), ok)
    if (.not. ok) return
    integrals = matmul(values(:, 1:m), weights)
    do i = 1, size(weight)
      call evaluate_facet(set_a%coefficient(:, :, facet_a), xi(1, i), xi(2, i), x, xu, xv, xuu, xuv, xvv)
      plane(:, i) = matmul(x, chart%axes(:, 1:2))
      associate (u => matmul(xu, chart%axes(:, 1:2)), v => matmul(xv, chart%axes(:, 1:2)))
        scale(i) = u(1)*v(2) - u(2)*v(1)
      end associate
    end do
    call all_shapes(plane, values(:, 1:size(weight)), ok)
    if (.not. ok) return
    fitted = weight*scale
    call fit_weights(values(:, 1:size(weight)), integrals, fitted, fits)
    if (fits) weight = fitted/scale

  contains

    !> Shape functions of both facets at points of the plane.
    pure subroutine all_shapes(p, shape, ok)
      !> (2, n).
      real(dp), intent(in) :: p(:, :)
      !> (n_functions, n).
      real(dp), intent(out) :: shape(:, :)
      logical, intent(out) :: ok
      real(dp) :: a(2), b(2), shift(2), determinant
      integer :: k
      a = reference_centre(set_a%corners(facet_a))
      b = reference_centre(set_b%corners(facet_b))
      shift = chart%to_plane(set_b%origin(:, facet_b))
      do k = 1, size(p, 2)
        call inverse_map(set_a%coefficient(:, :, facet_a), [0.0_dp, 0.0_dp], chart%axes, chart%size, p(:, k), a, &
                             determinant, ok)
        if (ok) call inverse_map(set_b%coefficient(:, :, facet_b), shift, chart%axes, set_b%size(facet_b), p(:, k), b, &
                                     determinant, ok)
        if (.not. ok) return
        call shape_functions(kind_a, a, shape(1:kind_nodes(kind_a), k))
        call shape_functions(kind_b, b, shape(kind_nodes(kind_a) + 1:, k))
      end do
    end subroutine all_shapes
  end subroutine fit_segment_weights

  !> The smallest change of weights, relative to them, that gives some functions their integrals. Functions that depend on
  !> each other are allowed; nothing changes where weights would change too much.
  pure subroutine fit_weights(values, integrals, weights, fits)
    !> Values of the functions at the points (n_functions, n_points).
    real(dp), intent(in) :: values(:, :)
    !> Their integrals (n_functions).
    real(dp), intent(in) :: integrals(:)
    !> Weights (n_points).
    real(dp), intent(inout) :: weights(:)
    !> Done.
    logical, intent(out) :: fits
    real(dp) :: v(size(weights), size(integrals)), rest(size(integrals)), length(size(integrals)), q(size(weights))
    real(dp) :: change(size(weights)), scale, share, total
    logical :: waiting(size(integrals))
    integer :: i, j, k, n, sweep
    n = size(integrals)
    do sweep = 1, 2   ! the second takes out what the round-off of the first left
      do j = 1, n
        v(:, j) = values(j, :)*sqrt(weights)
        rest(j) = integrals(j) - sum(values(j, :)*weights)
        length(j) = norm2(v(:, j))
      end do
      scale = maxval(length)
      total = sum(weights)
      waiting = .true.
      change = 0
      ! Gram-Schmidt, the longest first.
      do i = 1, n
        k = maxloc(length, dim=1, mask=waiting)
        if (.not. length(k) > least_part*scale) exit
        waiting(k) = .false.
        ! What is all but a combination of the others has its integral with them, or too little of its own to correct it.
        if (length(k) < dependent*scale .and. (abs(rest(k)) < noise*total .or. &
                                               abs(rest(k)) > small_change*length(k)*sqrt(total))) cycle
        q = v(:, k)/length(k)
        change = change + rest(k)/length(k)*q
        do j = 1, n
          if (.not. waiting(j)) cycle
          share = dot_product(q, v(:, j))
          v(:, j) = v(:, j) - share*q
          rest(j) = rest(j) - share*rest(k)/length(k)
          share = dot_product(q, v(:, j))   ! once more, against round-off
          v(:, j) = v(:, j) - share*q
          rest(j) = rest(j) - share*rest(k)/length(k)
          length(j) = norm2(v(:, j))
        end do
      end do
      change = change/sqrt(weights)
      fits = all(abs(change) < most_change)
      if (.not. fits) return
      weights = weights*(1 + change)
    end do
  end subroutine fit_weights
end module dotyk_contact_moment_fitting
