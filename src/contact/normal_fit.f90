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
  public :: fit_normal

  integer, parameter :: n_fits = 3  !! Number of fits, each in the frame of the previous normal.
  !> With a pivot of the scaled normal equations below this the vertices hardly determine a coefficient: two layers of
  !> them tell no curvature from a slope.
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
    real(dp) :: p(2, size(point, 2)), h(size(point, 2)), row(5), gram(5, 5), right(5), scale(5), principal(2, 2)
    real(dp) :: square, curvature_factor
    integer :: i, n
    n = merge(2, 5, dimension == 2)
    p = matmul(transpose(axis), point)
    h = matmul(normal, point)
    call principal_axes(p, principal)
    gram = 0
    right = 0
    do i = 1, size(h)
      square = sum(p(:, i)**2)
      if (.not. square > 0) cycle
      curvature_factor = 1 + h(i)**2/square
      associate (q => matmul(transpose(principal), p(:, i)))
        if (dimension == 2) then
          row(1:2) = [q(1), curvature_factor*q(1)**2]
        else
          row = [q(1), q(2), curvature_factor*q(1)**2, curvature_factor*q(1)*q(2), curvature_factor*q(2)**2]
        end if
        ! weight 1/distance^2
        gram(1:n, 1:n) = gram(1:n, 1:n) + spread(row(1:n), 2, n)*spread(row(1:n), 1, n)/sum(q**2)
        right(1:n) = right(1:n) + row(1:n)*h(i)/sum(q**2)
      end associate
    end do
    scale = 1
    do i = 1, n
      if (gram(i, i) > 0) scale(i) = 1/sqrt(gram(i, i))
    end do
    gram = gram*spread(scale, 2, 5)*spread(scale, 1, 5)
    right = right*scale
    call solve_determined(gram(1:n, 1:n), right(1:n), n_undetermined)
    right = right*scale
    if (dimension == 2) right(2) = 0
    slope = matmul(principal, right(1:2))
  end subroutine fit_slope

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
  pure subroutine solve_determined(a, b, n_undetermined)
    real(dp), intent(in) :: a(:, :)  !! Symmetric matrix with diagonal 1, or 0 of unknowns that are zero (n, n) [].
    real(dp), intent(inout) :: b(:)  !! Right-hand side; solution on return (n) [any].
    integer, intent(out) :: n_undetermined  !! Number of unknowns that are not determined.
    real(dp) :: l(size(b), size(b)), y(size(b)), pivot
    integer :: i, j
    n_undetermined = 0
    l = 0
    do j = 1, size(b)
      pivot = a(j, j) - sum(l(j, :j - 1)**2)
      if (pivot > min_pivot) then
        l(j, j) = sqrt(pivot)
        l(j + 1:, j) = [((a(i, j) - sum(l(i, :j - 1)*l(j, :j - 1)))/l(j, j), i=j + 1, size(b))]
        y(j) = (b(j) - sum(l(j, :j - 1)*y(:j - 1)))/l(j, j)
      else
        n_undetermined = n_undetermined + 1
        l(j, j) = 1
        y(j) = 0
      end if
    end do
    do j = size(b), 1, -1
      b(j) = (y(j) - sum(l(j + 1:, j)*b(j + 1:)))/l(j, j)
    end do
  end subroutine solve_determined
end module dotyk_contact_normal_fit
