!> The normal of a surface at a vertex, from the vertices around it.
!>
!> The surface is the graph of a function h of two tangential coordinates u, v, and passes through the vertex. Fitted, by
!> least squares, is h = a u + b v + (c u^2 + d u v + e v^2) (1 + h^2/(u^2+v^2)). The last factor tends to 1 at the vertex,
!> and makes the fit exact on spheres and circles through it: these obey h = a u + b v + c (u^2+v^2+h^2) in any frame. The
!> error of the normal falls like the square of the distance of the vertices on every smooth surface, whether they lie
!> around the vertex or, at the rim of the surface, on one side of it.
module dotyk_contact_normal_fit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private
  public :: fit_normal

  !> Fits, each in the frame of the normal before.
  integer, parameter :: fits = 3
  !> Pivots of the normal equations below this: the vertices hardly determine the function.
  real(dp), parameter :: least_pivot = 0.02_dp
  !> Eigenvalues below this, of the largest, are taken for zero.
  real(dp), parameter :: least_eigenvalue = 1e-6_dp

contains

  !> Fit the normal. Without enough vertices `determined` is false; then the normal is that of the smallest coefficients that fit.
  subroutine fit_normal(dimension, point, normal, determined)
    !> Of space, 2 or 3.
    integer, intent(in) :: dimension
    !> Vertices relative to the vertex itself, which is not among them (3, n) [length].
    real(dp), intent(in) :: point(:, :)
    !> Unit vector (3): a guess, from which all heights are functions of the tangential coordinates; the fit on return.
    real(dp), intent(inout) :: normal(3)
    !> The vertices determine the function.
    logical, intent(out) :: determined
    real(dp) :: axis(3, 2), slope(2)
    integer :: k
    do k = 1, fits
      call tangents(dimension, normal, axis)
      call fit_slope(dimension, point, normal, axis, slope, determined)
      normal = normal - slope(1)*axis(:, 1) - slope(2)*axis(:, 2)
      normal = normal/norm2(normal)
    end do
  end subroutine fit_normal

  !> Two unit vectors across a normal; in the plane, one, and zero.
  pure subroutine tangents(dimension, normal, axis)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: normal(3)
    real(dp), intent(out) :: axis(3, 2)
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

  !> Slope of the surface at the vertex along the two axes.
  subroutine fit_slope(dimension, point, normal, axis, slope, determined)
    integer, intent(in) :: dimension
    !> (3, n).
    real(dp), intent(in) :: point(:, :)
    !> Frame (3), (3,2).
    real(dp), intent(in) :: normal(3), axis(3, 2)
    real(dp), intent(out) :: slope(2)
    logical, intent(out) :: determined
    real(dp) :: p(2, size(point, 2)), h(size(point, 2)), row(5), gram(5, 5), right(5), scale(5), principal(2, 2), square, bend
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
      bend = 1 + h(i)**2/square
      associate (q => matmul(transpose(principal), p(:, i)))
        if (dimension == 2) then
          row(1:2) = [q(1), bend*q(1)**2]
        else
          row = [q(1), q(2), bend*q(1)**2, bend*q(1)*q(2), bend*q(2)**2]
        end if
        ! near vertices count more
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
    determined = size(h) >= n
    if (determined) call solve(gram(1:n, 1:n), right(1:n), determined)
    if (.not. determined) call solve_least(gram(1:n, 1:n), right(1:n))
    right = right*scale
    if (dimension == 2) right(2) = 0
    slope = matmul(principal, right(1:2))
  end subroutine fit_slope

  !> Principal axes of points, over their root mean squares: coordinates along these are of the size of one. An axis along which
  !> the points have no extent is zero.
  pure subroutine principal_axes(p, axes)
    !> (2, n).
    real(dp), intent(in) :: p(:, :)
    !> Columns (2,2).
    real(dp), intent(out) :: axes(2, 2)
    real(dp) :: xx, xy, yy, angle, extent(2)
    integer :: i
    xx = sum(p(1, :)**2)/size(p, 2)
    xy = sum(p(1, :)*p(2, :))/size(p, 2)
    yy = sum(p(2, :)**2)/size(p, 2)
    angle = 0
    if (abs(xy) > 1e-14_dp*(xx + yy)) angle = atan2(2*xy, xx - yy)/2
    axes(:, 1) = [cos(angle), sin(angle)]
    axes(:, 2) = [-sin(angle), cos(angle)]
    do i = 1, 2
      extent(i) = sqrt(sum(matmul(axes(:, i), p)**2)/size(p, 2))
    end do
    do i = 1, 2
      if (extent(i) > 1e-10_dp*maxval(extent)) then
        axes(:, i) = axes(:, i)/extent(i)
      else
        axes(:, i) = 0
      end if
    end do
  end subroutine principal_axes

  !> Solve by Cholesky's factorization; nothing happens to b where a pivot is too small.
  pure subroutine solve(a, b, regular)
    !> Symmetric with diagonal 1 (n,n).
    real(dp), intent(in) :: a(:, :)
    !> Right-hand side and solution (n).
    real(dp), intent(inout) :: b(:)
    logical, intent(out) :: regular
    real(dp) :: l(size(b), size(b)), y(size(b)), pivot
    integer :: i, j
    regular = .false.
    l = 0
    do j = 1, size(b)
      pivot = a(j, j) - sum(l(j, :j - 1)**2)
      if (.not. pivot > least_pivot) return
      l(j, j) = sqrt(pivot)
      do i = j + 1, size(b)
        l(i, j) = (a(i, j) - sum(l(i, :j - 1)*l(j, :j - 1)))/l(j, j)
      end do
    end do
    do i = 1, size(b)
      y(i) = (b(i) - sum(l(i, :i - 1)*y(:i - 1)))/l(i, i)
    end do
    do i = size(b), 1, -1
      b(i) = (y(i) - sum(l(i + 1:, i)*b(i + 1:)))/l(i, i)
    end do
    regular = .true.
  end subroutine solve

  !> The smallest solution of a singular system in the least squares.
  subroutine solve_least(a, b)
    !> Symmetric (n,n).
    real(dp), intent(in) :: a(:, :)
    !> Right-hand side and solution (n).
    real(dp), intent(inout) :: b(:)
    real(dp) :: values(size(b)), vectors(size(b), size(b)), c(size(b))
    type(error_t), allocatable :: error
    call symmetric_eigen(a, values, vectors, error)
    if (allocated(error)) then
      b = 0
      return
    end if
    c = matmul(transpose(vectors), b)
    where (values > least_eigenvalue*maxval(values))
      c = c/values
    elsewhere
      c = 0
    end where
    b = matmul(vectors, c)
  end subroutine solve_least
end module dotyk_contact_normal_fit
