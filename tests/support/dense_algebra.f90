!> Forms on a space of few dimensions as dense matrices: values, norms, constants of continuity and coercivity.
module dense_algebra
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: solve_dense, symmetric_eigen
  implicit none
  private
  public :: inner, norm_of, dual_norm_of, random_vector, relative_spectrum, continuity_of, solved

contains

  !> Value of a bilinear form, X(u, v).
  pure real(dp) function inner(x, u, v)
    real(dp), intent(in) :: x(:, :)  !! Its matrix (n, n).
    real(dp), intent(in) :: u(:), v(:)  !! (n).
    inner = dot_product(v, matmul(x, u))
  end function inner

  !> sqrt(X(u, u)).
  pure real(dp) function norm_of(x, u)
    real(dp), intent(in) :: x(:, :)  !! Symmetric and positive definite (n, n).
    real(dp), intent(in) :: u(:)  !! (n).
    norm_of = sqrt(inner(x, u, u))
  end function norm_of

  !> The least S with |f v| <= S sqrt(X(v, v)) for all v: the norm of a linear form.
  real(dp) function dual_norm_of(x, f) result(s)
    real(dp), intent(in) :: x(:, :)  !! Symmetric and positive definite (n, n).
    real(dp), intent(in) :: f(:)  !! (n).
    s = sqrt(dot_product(f, solved(x, f)))
  end function dual_norm_of

  !> X^{-1} f (n).
  function solved(x, f) result(u)
    real(dp), intent(in) :: x(:, :)  !! Regular (n, n).
    real(dp), intent(in) :: f(:)  !! (n).
    real(dp) :: u(size(f))
    real(dp), allocatable :: column(:, :)
    type(error_t), allocatable :: error
    column = reshape(f, [size(f), 1])
    call solve_dense(x, column, error)
    if (allocated(error)) error stop 'dense_algebra: a singular matrix'
    u = column(:, 1)
  end function solved

  !> Y^{-1/2}, but for a rotation: root^T Y root is the unit matrix (n, n).
  function inverse_root(y) result(root)
    real(dp), intent(in) :: y(:, :)  !! Symmetric and positive definite (n, n).
    real(dp) :: root(size(y, 1), size(y, 1))
    real(dp) :: values(size(y, 1)), vectors(size(y, 1), size(y, 1))
    type(error_t), allocatable :: error
    integer :: i
    call symmetric_eigen(y, values, vectors, error)
    if (allocated(error)) error stop 'dense_algebra: no eigenvalues'
    do i = 1, size(values)
      root(:, i) = vectors(:, i)/sqrt(values(i))
    end do
  end function inverse_root

  !> Eigenvalues of X v = value Y v, ascending: the least and the largest are the constants of coercivity and continuity
  !> of the form X in the norm of Y. Where X is not symmetric, its symmetric part: the least one is still the constant
  !> of coercivity (n).
  function relative_spectrum(x, y) result(values)
    real(dp), intent(in) :: x(:, :)  !! (n, n).
    real(dp), intent(in) :: y(:, :)  !! Symmetric and positive definite (n, n).
    real(dp) :: values(size(x, 1))
    real(dp), dimension(size(x, 1), size(x, 1)) :: root, vectors
    type(error_t), allocatable :: error
    root = inverse_root(y)
    root = matmul(transpose(root), matmul((x + transpose(x))/2, root))
    call symmetric_eigen(root, values, vectors, error)
    if (allocated(error)) error stop 'dense_algebra: no eigenvalues'
  end function relative_spectrum

  !> The least M with |X(u, v)| <= M sqrt(Y(u, u)) sqrt(Y(v, v)) for all u and v.
  real(dp) function continuity_of(x, y) result(m)
    real(dp), intent(in) :: x(:, :)  !! (n, n), symmetric or not.
    real(dp), intent(in) :: y(:, :)  !! Symmetric and positive definite (n, n).
    real(dp), dimension(size(x, 1), size(x, 1)) :: root, vectors
    real(dp) :: values(size(x, 1))
    type(error_t), allocatable :: error
    root = inverse_root(y)
    root = matmul(transpose(root), matmul(x, root))
    call symmetric_eigen(matmul(transpose(root), root), values, vectors, error)
    if (allocated(error)) error stop 'dense_algebra: no eigenvalues'
    m = sqrt(values(size(values)))
  end function continuity_of

  !> Numbers between -1 and 1, the same on every machine (n).
  pure function random_vector(n, seed) result(u)
    integer, intent(in) :: n  !! Length.
    integer, intent(in) :: seed  !! Another one gives other numbers.
    real(dp) :: u(n)
    integer :: i
    ! The digits of a sine that come late are as good as random.
    u = [(12345.678_dp*sin(12.9898_dp*i + 78.233_dp*seed), i=1, n)]
    u = 2*(u - floor(u)) - 1
  end function random_vector
end module dense_algebra
