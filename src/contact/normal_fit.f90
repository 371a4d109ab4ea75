!> Surface normal at a vertex, fitted to the vertices around it.
!>
!> The surface is the graph of a function h of two tangential coordinates u, v through the vertex. The fit by least
!> squares is h = a u + b v + (c u^2 + d u v + e v^2) (1 + h^2/(u^2+v^2)). The last factor tends to 1 at the vertex and
!> makes the fit exact on spheres and circles: these obey h = a u + b v + c (u^2+v^2+h^2) in any frame. On every smooth
!> surface the error of the normal is of second order in the distance of the vertices, whether these lie around the
!> vertex or, at the boundary of the surface, on one side of it.
module dotyk_contact_normal_fit
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: fit_normal, uncertain_heights

  integer, parameter :: n_second(2:3) = [2, 5]  !! Coefficients up to second order, in two and three dimensions.
  integer, parameter :: n_third(2:3) = [3, 9]  !! Coefficients up to third order.
  integer, parameter :: n_fits = 3  !! Number of fits, each in the frame of the previous normal.
  !> With a pivot of the scaled normal equations below this the vertices hardly determine a coefficient: two layers of
  !> them tell no curvature from a slope. Pivots of third order are smaller by as much again.
  real(dp), parameter :: min_pivot = 0.02_dp
  !> Points are isotropic where their mixed moment is below this fraction of their polar moment: round-off.
  real(dp), parameter :: isotropy_round_off = 1.0e-14_dp
  !> Points have no extent along an axis where it is below this fraction of the greatest one.
  real(dp), parameter :: min_extent = 1.0e-10_dp

contains

  !> Fit the normal.
  pure subroutine fit_normal(dimension, point, normal, n_undetermined)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    !> Vertices of the patch relative to the vertex itself, which is not among them (3, n) [length].
    real(dp), intent(in) :: point(:, :)
    !> Unit normal: on entry a guess, in whose frame all heights are functions of the tangential coordinates; the fit on
    !> return (3) [].
    real(dp), intent(inout) :: normal(3)
    !> Number of coefficients that the vertices do not determine: they are zero, those of second order first.
    integer, intent(out) :: n_undetermined
    real(dp) :: axis(3, 2), slope(2)
    integer :: k
    do k = 1, n_fits
      call tangents(dimension, normal, axis)
      call fit_slope(dimension, point, normal, axis, slope, n_undetermined)
      normal = normal - slope(1)*axis(:, 1) - slope(2)*axis(:, 2)
      normal = normal/norm2(normal)
    end do
  end subroutine fit_normal

  !> Two unit vectors normal to a direction; in two dimensions one, and zero.
  pure subroutine tangents(dimension, normal, axis)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: normal(3)  !! Direction (3) [].
    real(dp), intent(out) :: axis(3, 2)  !! Unit vectors (3, 2) [].
    integer :: i
    axis = 0
    if (dimension == 2) then
      axis(1:2, 1) = [-normal(2), normal(1)]
      return
    end if
    i = minloc(abs(normal), dim=1)
    axis(i, 1) = 1
    axis(:, 1) = axis(:, 1) - normal(i)*normal
    axis(:, 1) = axis(:, 1)/norm2(axis(:, 1))
    axis(1, 2) = normal(2)*axis(3, 1) - normal(3)*axis(2, 1)
    axis(2, 2) = normal(3)*axis(1, 1) - normal(1)*axis(3, 1)
    axis(3, 2) = normal(1)*axis(2, 1) - normal(2)*axis(1, 1)
  end subroutine tangents

  !> Slopes of the surface at the vertex along the two tangential axes.
  pure subroutine fit_slope(dimension, point, normal, axis, slope, n_undetermined)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: point(:, :)  !! Vertices relative to the vertex (3, n) [length].
    real(dp), intent(in) :: normal(3)  !! Normal of the frame (3) [].
    real(dp), intent(in) :: axis(3, 2)  !! Tangential axes of the frame (3, 2) [].
    real(dp), intent(out) :: slope(2)  !! Slopes along the axes (2) [].
    integer, intent(out) :: n_undetermined  !! As in `fit_normal`.
    real(dp) :: p(2, size(point, 2)), principal(2, 2), coefficient(n_second(dimension)), h(size(point, 2))
    logical :: is_determined(n_second(dimension))
    p = matmul(transpose(axis), point)
    h = matmul(normal, point)
    call principal_axes(p, principal)
    is_determined = .true.
    call fit_heights(dimension, matmul(transpose(principal), p), h, 1 + h**2/max(sum(p**2, 1), tiny(h)), coefficient, &
                     is_determined)
    n_undetermined = count(.not. is_determined)
    slope = principal(:, 1)*coefficient(1)
    if (dimension == 3) slope = slope + principal(:, 2)*coefficient(2)
  end subroutine fit_slope

  !> How uncertain the surface is halfway between the vertex and others: by the slope that a fit of third order has in
  !> the frame of the normal, and by the terms of second order that it does not confirm, as the vertices do not
  !> determine the third power along the same axis.
  !>
  !> The smooth edge between vertices is off by s/8 where the tangents at both its ends rise by s over its length, and
  !> the middle of the chord of c s^2 by a quarter.
  pure subroutine uncertain_heights(dimension, point, normal, height, is_confirmed)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: point(:, :)  !! Vertices of the patch relative to the vertex (3, n) [length].
    real(dp), intent(in) :: normal(3)  !! Unit normal at the vertex (3) [].
    real(dp), intent(out) :: height(:)  !! Uncertainty halfway to the first of them (at most n) [length].
    logical, intent(out) :: is_confirmed  !! Whether all curvatures are.
    real(dp) :: axis(3, 2), p(2, size(point, 2)), q(2, size(point, 2)), principal(2, 2), h(size(point, 2))
    real(dp) :: factor(size(point, 2)), second(n_second(dimension)), third(n_third(dimension)), row(n_third(dimension))
    logical :: is_second(n_second(dimension)), is_third(n_third(dimension))
    integer :: i
    call tangents(dimension, normal, axis)
    p = matmul(transpose(axis), point)
    h = matmul(normal, point)
    call principal_axes(p, principal)
    q = matmul(transpose(principal), p)
    factor = 1 + h**2/max(sum(p**2, 1), tiny(h))
    is_second = .true.
    call fit_heights(dimension, q, h, factor, second, is_second)
    ! Factors could make products independent which are not by the positions of the vertices.
    factor = 1
    is_third = .true.
    call fit_heights(dimension, q, h, factor, third, is_third)
    factor = [(1 + bending(dimension, second, principal, q(:, i), h(i)), i=1, size(h))]
    call fit_heights(dimension, q, h, factor, third, is_third)
    if (dimension == 2) then
      if (is_third(3)) third(2) = 0
    else
      if (is_third(6)) third(3) = 0
      if (any(is_third(7:8))) third(4) = 0
      if (is_third(9)) third(5) = 0
    end if
    is_confirmed = all(is_second) .and. .not. any(abs(third(dimension:n_second(dimension))) > 0)
    do i = 1, size(height)
      row = powers(dimension, q(:, i))
      associate (slope => third(:dimension - 1)*row(:dimension - 1), &
                 curvature => third(dimension:n_second(dimension))*row(dimension:n_second(dimension)))
        height(i) = (abs(sum(slope)) + abs(sum(curvature)))/4
      end associate
    end do
  end subroutine uncertain_heights

  !> (h/Q)^2 |grad Q|^2/4 with the terms Q of second order: h = Q (1 + this) on spheres, where it is h^2/(u^2+v^2), and
  !> on cylinders of any direction [].
  pure real(dp) function bending(dimension, coefficient, principal, q, h)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: coefficient(:)  !! Of first and second order [length].
    real(dp), intent(in) :: principal(2, 2)  !! Axes of the scaled coordinates (2, 2) [1/length].
    real(dp), intent(in) :: q(2)  !! Scaled coordinates (2) [].
    real(dp), intent(in) :: h  !! Height [length].
    real(dp) :: c(3), quadratic
    c = 0
    c(:max(1, 3*(dimension - 2))) = coefficient(dimension:)
    quadratic = c(1)*q(1)**2 + c(2)*q(1)*q(2) + c(3)*q(2)**2
    bending = sum(principal(:, 1)**2)*(c(1)*q(1) + c(2)*q(2)/2)**2 + &
              sum(principal(:, 2)**2)*(c(3)*q(2) + c(2)*q(1)/2)**2
    ! Not along directions in which the surface is not curved.
    if (2*abs(quadratic) > abs(h)) bending = bending*(h/quadratic)**2
  end function bending

  !> Products of the coordinates: of first, second and third order [].
  pure function powers(dimension, q) result(row)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: q(2)  !! Scaled tangential coordinates (2) [].
    real(dp) :: row(n_third(dimension))
    if (dimension == 2) then
      row = [q(1), q(1)**2, q(1)**3]
    else
      row = [q(1), q(2), q(1)**2, q(1)*q(2), q(2)**2, q(1)**3, q(1)**2*q(2), q(1)*q(2)**2, q(2)**3]
    end if
  end function powers

  !> Least-squares fit of heights, up to second or third order by the number of coefficients; those that the vertices do
  !> not determine are zero, the last first.
  pure subroutine fit_heights(dimension, q, h, factor, coefficient, is_determined)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: q(:, :)  !! Scaled tangential coordinates of the vertices (2, n) [].
    real(dp), intent(in) :: h(:)  !! Their heights (n) [length].
    real(dp), intent(in) :: factor(:)  !! Factors of the terms above first order (n) [].
    real(dp), intent(out) :: coefficient(:)  !! Coefficients of the products of coordinates [length].
    !> Coefficients that may be determined on entry, those that the vertices determine on return.
    logical, intent(inout) :: is_determined(:)
    real(dp) :: gram(size(coefficient), size(coefficient)), row(n_third(dimension)), scale(size(coefficient))
    integer :: i, n
    n = size(coefficient)
    gram = 0
    coefficient = 0
    do i = 1, size(h)
      if (.not. sum(q(:, i)**2) > 0) cycle
      row = powers(dimension, q(:, i))
      row(dimension:) = factor(i)*row(dimension:)
      ! weight 1/distance^2
      gram = gram + spread(row(:n), 2, n)*spread(row(:n), 1, n)/sum(q(:, i)**2)
      coefficient = coefficient + row(:n)*h(i)/sum(q(:, i)**2)
    end do
    scale = 1
    do i = 1, n
      if (gram(i, i) > 0) scale(i) = 1/sqrt(gram(i, i))
    end do
    gram = gram*spread(scale, 2, n)*spread(scale, 1, n)
    coefficient = coefficient*scale
    call solve_determined(gram, [(merge(min_pivot, min_pivot**2, i <= n_second(dimension)), i=1, n)], coefficient, &
                          is_determined)
    coefficient = coefficient*scale
  end subroutine fit_heights

  !> Principal axes of points and the origin about their mean, which follow the layers of a mesh, divided by the
  !> root-mean-square coordinates along them. An axis along which the points have no extent is zero.
  pure subroutine principal_axes(p, axes)
    real(dp), intent(in) :: p(:, :)  !! Points (2, n) [length].
    real(dp), intent(out) :: axes(2, 2)  !! Axes as columns (2, 2) [1/length].
    real(dp) :: xx, xy, yy, angle, extent(2), mean(2)
    integer :: i
    mean = sum(p, dim=2)/(size(p, 2) + 1)
    xx = sum(p(1, :)**2)/(size(p, 2) + 1) - mean(1)**2
    xy = sum(p(1, :)*p(2, :))/(size(p, 2) + 1) - mean(1)*mean(2)
    yy = sum(p(2, :)**2)/(size(p, 2) + 1) - mean(2)**2
    angle = 0
    if (abs(xy) > isotropy_round_off*(xx + yy)) angle = atan2(2*xy, xx - yy)/2
    axes(:, 1) = [cos(angle), sin(angle)]
    axes(:, 2) = [-sin(angle), cos(angle)]
    do i = 1, 2
      extent(i) = sqrt(sum(matmul(axes(:, i), p)**2)/size(p, 2))
    end do
    do i = 1, 2
      if (extent(i) > min_extent*maxval(extent)) then
        axes(:, i) = axes(:, i)/extent(i)
      else
        axes(:, i) = 0
      end if
    end do
  end subroutine principal_axes

  !> Solve by Cholesky factorization, without the unknowns that those before them determine already: they are zero.
  pure subroutine solve_determined(a, least, b, is_determined)
    real(dp), intent(in) :: a(:, :)  !! Symmetric matrix with diagonal 1, or 0 of unknowns that are zero (n, n) [].
    real(dp), intent(in) :: least(:)  !! Least pivots (n) [].
    real(dp), intent(inout) :: b(:)  !! Right-hand side; solution on return (n) [any].
    !> Unknowns that are not zero on entry, those of them that are determined on return (n).
    logical, intent(inout) :: is_determined(:)
    real(dp) :: l(size(b), size(b)), y(size(b)), pivot
    integer :: i, j
    l = 0
    do j = 1, size(b)
      pivot = a(j, j) - sum(l(j, :j - 1)**2)
      is_determined(j) = is_determined(j) .and. pivot > least(j)
      if (is_determined(j)) then
        l(j, j) = sqrt(pivot)
        l(j + 1:, j) = [((a(i, j) - sum(l(i, :j - 1)*l(j, :j - 1)))/l(j, j), i=j + 1, size(b))]
        y(j) = (b(j) - sum(l(j, :j - 1)*y(:j - 1)))/l(j, j)
      else
        l(j, j) = 1
        y(j) = 0
      end if
    end do
    do j = size(b), 1, -1
      b(j) = (y(j) - sum(l(j + 1:, j)*b(j + 1:)))/l(j, j)
    end do
  end subroutine solve_determined
end module dotyk_contact_normal_fit
