!> Near-null-space vectors of the stiffness of a body, for `dotyk_linalg_smoothed_aggregation`: displacements of rigid
!> bodies, whatever the supports hold.
!>
!> Three translations and three rotations in space, two and one in the plane. Axisymmetric bodies have the same three:
!> away from the axis, on a few elements, radial motions cost little energy, too.
module dotyk_elasticity_near_null_vectors
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_constraint, only: constraint_t, held
  implicit none
  private
  public :: near_null_vectors

contains

  !> The vectors. Rotations are about the middle of the body and scaled by its size.
  subroutine near_null_vectors(x, constraint, vector, box)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dim, n_nodes) [length].
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes.
    !> The vectors in nodal axes, zero along held components (dim*n_nodes, n) [].
    real(dp), allocatable, intent(out) :: vector(:, :)
    !> Lower and upper corner of the box that stands for the body, of which these may be a part; that of the nodes if
    !> absent (dim, 2) [length].
    real(dp), intent(in), optional :: box(:, :)
    real(dp) :: middle(size(x, 1)), radius
    integer :: dim
    dim = size(x, 1)
    allocate (vector(size(x), merge(6, 3, dim == 3)))
    if (size(x) == 0) return
    middle = (minval(x, 2) + maxval(x, 2))/2
    radius = maxval(maxval(x, 2) - middle)
    if (present(box)) then
      middle = (box(:, 1) + box(:, 2))/2
      radius = maxval(box(:, 2) - middle)
    end if
    if (.not. radius > 0) radius = 1
    call fill(dim, size(x, 2), size(vector, 2), x, middle, radius, constraint, vector)
  end subroutine near_null_vectors

  !> Fill the vectors node by node.
  subroutine fill(dim, n, m, x, middle, radius, constraint, vector)
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: m  !! Number of vectors.
    real(dp), intent(in) :: x(dim, n)  !! Nodal coordinates (dim, n) [length].
    real(dp), intent(in) :: middle(dim)  !! Center of the rotations (dim) [length].
    real(dp), intent(in) :: radius  !! Size of the body [length].
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes.
    real(dp), intent(out) :: vector(dim, n, m)  !! The vectors (dim, n, m) [].
    real(dp) :: u(dim, m), y(dim)
    integer :: i, k
    !$omp parallel do default(none) shared(dim, n, m, x, middle, radius, constraint, vector) private(u, y, k) &
    !$omp& schedule(static)
    do i = 1, n
      y = (x(:, i) - middle)/radius
      u = 0
      do k = 1, dim
        u(k, k) = 1
      end do
      if (dim == 3) then
        u(:, 4) = [0.0_dp, -y(3), y(2)]
        u(:, 5) = [y(3), 0.0_dp, -y(1)]
        u(:, 6) = [-y(2), y(1), 0.0_dp]
      else
        u(:, 3) = [-y(2), y(1)]
      end if
      if (constraint%frame_of(i) > 0) u = matmul(transpose(constraint%frame(:, :, constraint%frame_of(i))), u)
      do k = 1, dim
        if (constraint%equation(k, i) == held) u(k, :) = 0
        vector(k, i, :) = u(k, :)
      end do
    end do
    !$omp end parallel do
  end subroutine fill
end module dotyk_elasticity_near_null_vectors
