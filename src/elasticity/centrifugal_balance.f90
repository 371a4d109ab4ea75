!> Balance of the centrifugal forces of a floating body. A free body turns about an axis through its centroid; that of
!> its mesh may be beside the axis by the accuracy of the mesh, and the forces then have resultants that nothing holds.
module dotyk_elasticity_centrifugal_balance
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_linalg_normal_equations, only: factorize_gram, solve_gram
  implicit none
  private
  public :: balance_centrifugal_force

  !> Resultants below this fraction of the magnitudes are rounding errors, which are left as they are.
  real(dp), parameter :: rounding = 1.0e-13_dp

contains

  !> Where the resultants on all motions that the supports leave are small, subtract nodal forces that have them: along
  !> these motions, and in proportion to the forces of the nodes.
  subroutine balance_centrifugal_force(body, tolerance, force, balanced)
    type(body_t), intent(in) :: body  !! The body, whole, with its supports.
    !> Greatest resultant that is balanced, relative to the sum of the magnitudes of its terms [].
    real(dp), intent(in) :: tolerance
    real(dp), intent(inout) :: force(:, :)  !! Nodal centrifugal forces (dim, n_nodes) [force].
    real(dp), intent(out) :: balanced  !! Greatest relative resultant that was subtracted; 0: none [].
    type(rigid_body_modes_t) :: modes
    real(dp), allocatable :: shape(:, :, :), resultant(:), magnitude(:), gram(:, :), factor(:, :), amplitude(:, :)
    integer, allocatable :: pivot(:)
    integer :: i, k, rank
    balanced = 0
    call modes%init(body%mesh, body%analysis, body%constraint, shape)
    associate (n => size(shape, 3))
      if (n == 0) return
      allocate (resultant(n), magnitude(n), gram(n, n), factor(n, n), amplitude(1, n), pivot(n))
      resultant = 0
      magnitude = 0
      gram = 0
      do i = 1, size(force, 2)
        associate (size_of => norm2(force(:, i)))
          resultant = resultant + matmul(force(:, i), shape(:, i, :))
          magnitude = magnitude + size_of*norm2(shape(:, i, :), 1)
          gram = gram + size_of*matmul(transpose(shape(:, i, :)), shape(:, i, :))
        end associate
      end do
      if (all(abs(resultant) <= rounding*magnitude) .or. any(abs(resultant) > tolerance*magnitude)) return
      call factorize_gram(n, gram, rounding, factor, pivot, rank)
      if (rank < n) return
      amplitude(1, :) = resultant
      call solve_gram(n, 1, factor, pivot, amplitude)
      do i = 1, size(force, 2)
        force(:, i) = force(:, i) - norm2(force(:, i))*matmul(shape(:, i, :), amplitude(1, :))
      end do
      do k = 1, n
        if (magnitude(k) > 0) balanced = max(balanced, abs(resultant(k))/magnitude(k))
      end do
    end associate
  end subroutine balance_centrifugal_force
end module dotyk_elasticity_centrifugal_balance
