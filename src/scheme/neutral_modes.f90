!> Neutral modes: rigid body modes that contact resists by no more than the normals are uncertain.
!>
!> Where curved surfaces touch, the normals of the two sides differ: by the angle between the surfaces beside the point
!> of contact, which the linear gap condition neglects, and by the errors of facets. With G the rows of the modes along
!> the normals of the master side, and D their change where the normals of the slave side are taken, a mode z of a body
!> is neutral if `|D z| >= |G z|/limit` in the norm of the row weights, over the rows that are about to touch. The spin
!> of a ball, rolling and sliding along a race are neutral: one side's normals resist a spin, the other side's do not.
!> A stiffness against such a motion is an artefact, its sign and size depend on the mesh. The mode is indeterminate:
!> least motion is taken, and no equilibrium is asked for along it (docs/theory.md, section 3).
!>
!> Where loads or contact forces along a neutral mode are not small they are no noise: such a direction is left to
!> the contact rows (`dotyk_control_neutral_modes`).
module dotyk_scheme_neutral_modes
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: orthonormal_range, right_singular_vectors
  use dotyk_scheme_centrality, only: point_t
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_winkler_start, only: winkler_equilibrium
  implicit none
  private
  public :: neutral_directions, touching_rows, rest_on_foundation

  !> A mode is neutral if rows of the other side's normals change it by at least this fraction: 1 is a spin, 1.04/0.04
  !> the motion across a groove with an osculation of 52 %. limit = 2.
  real(dp), parameter :: limit = 2
  !> Singular values of the rows below this fraction of the largest are rounding errors: no row feels the mode at all.
  real(dp), parameter :: felt = 1.0e-9_dp
  !> Deviations of normals below this are rounding errors [].
  real(dp), parameter, public :: flat = 1.0e-8_dp
  !> Normals of the Winkler start span the true ones and this many times their deviation, so that no neutral mode moves
  !> bodies far; the added angle is at most `widest` [].
  real(dp), parameter :: cone = 10, widest = 0.5_dp

contains

  !> The neutral modes of one body, the others at rest.
  subroutine neutral_directions(g, deviation, weight, direction, error)
    !> Rows of G that are about to touch (n, n_modes) [].
    real(dp), intent(in) :: g(:, :)
    !> Their change D where the normals of the slave side are taken (n, n_modes) [].
    real(dp), intent(in) :: deviation(:, :)
    !> Weights of the rows (n) [area].
    real(dp), intent(in) :: weight(:)
    !> Orthonormal combinations of the modes as columns (n_modes, number of them).
    real(dp), allocatable, intent(out) :: direction(:, :)
    !> An entry is not finite, or LAPACK's singular value decomposition does not converge.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: rows(2*size(g, 1), size(g, 2)), values(size(g, 2)), vectors(size(g, 2), size(g, 2))
    real(dp) :: combined(size(g, 2), size(g, 2)), root(size(g, 1))
    real(dp), allocatable :: shares(:), share_vectors(:, :)
    integer :: n, n_felt, n_neutral, j
    n = size(g, 1)
    allocate (direction(size(g, 2), 0))
    if (.not. any(abs(deviation) > flat)) return
    root = sqrt(weight)
    do j = 1, size(g, 2)
      rows(:n, j) = root*g(:, j)
      rows(n + 1:, j) = root*deviation(:, j)
    end do
    ! In the basis of these vectors, each divided by its singular value, |G z|^2 + |D z|^2 = |z|^2.
    call right_singular_vectors(rows, values, vectors, error)
    if (allocated(error)) return
    n_felt = count(values > felt*values(1))
    do j = 1, n_felt
      vectors(:, j) = vectors(:, j)/values(j)
    end do
    allocate (shares(n_felt), share_vectors(n_felt, n_felt))
    call right_singular_vectors(matmul(rows(n + 1:, :), vectors(:, :n_felt)), shares, share_vectors, error)
    if (allocated(error)) return
    n_neutral = count(shares**2*(1 + limit**2) >= 1)
    call orthonormal_range(matmul(vectors(:, :n_felt), share_vectors(:, :n_neutral)), felt, combined, n_neutral)
    direction = combined(:, :n_neutral)
  end subroutine neutral_directions

  !> Rows that are about to touch: those of rigid bodies in equilibrium on a Winkler foundation, and rows that are no
  !> farther from it than the deepest one is in it.
  subroutine touching_rows(qp, deviation, angle, stiffness, touching)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> D by bodies, in the scale of the modes of the QP (n_bodies) [].
    type(mode_block_t), intent(in) :: deviation(:)
    !> Deviation of the normals of each row (n_rows) [].
    real(dp), intent(in) :: angle(:)
    !> Stiffness of the foundation (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)
    !> Whether a row is about to touch (n_rows).
    logical, intent(out) :: touching(:)
    type(contact_qp_t) :: spread
    real(dp), allocatable :: alpha(:), y(:), factor(:), added(:, :)
    integer :: b, j
    spread%n_rows = 2*qp%n_rows
    spread%coarse = qp%coarse
    spread%coarse%body = reshape([qp%coarse%body, qp%coarse%body], [2, 2*qp%n_rows])
    allocate (spread%block(size(qp%block)))
    spread%coarse%place = reshape([qp%coarse%place, qp%coarse%place], [2, 2*qp%n_rows])
    factor = min(cone, widest/max(angle, tiny(1.0_dp)))
    do b = 1, size(qp%block)
      associate (row => qp%block(b)%row, g => qp%coarse%block(b)%value)
        spread%block(b)%row = [row, row + qp%n_rows]
        where (spread%coarse%body(:, qp%n_rows + 1:) == b) &
          spread%coarse%place(:, qp%n_rows + 1:) = spread%coarse%place(:, qp%n_rows + 1:) + size(row)
        added = deviation(b)%value
        do j = 1, size(added, 2)
          added(:, j) = factor(row)*added(:, j)
        end do
        associate (rows => spread%coarse%block(b))
          deallocate (rows%value)
          allocate (rows%value(2*size(row), size(g, 2)))
          rows%value(:size(row), :) = g + added
          rows%value(size(row) + 1:, :) = g - added
        end associate
      end associate
    end do
    allocate (alpha(qp%coarse%n), y(qp%n_rows))
    call winkler_equilibrium(spread, qp%coarse%resultant, [stiffness, stiffness]/2, &
                             [qp%initial_penetration, qp%initial_penetration], alpha)
    call qp%mode_displacement(alpha, y)
    y = y + qp%initial_penetration
    touching = y > -max(0.0_dp, maxval(y))
  end subroutine touching_rows

  !> Contact forces of rigid bodies in equilibrium on a Winkler foundation.
  subroutine rest_on_foundation(qp, stiffness, force, alpha, start, kept)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Stiffness of the foundation (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)
    !> (n_rows) [force]
    real(dp), intent(out) :: force(:)
    !> Amplitudes of the modes (qp%coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    !> See `winkler_equilibrium` (qp%coarse%n) [length].
    real(dp), intent(in), optional :: start(:)
    !> See `winkler_equilibrium`.
    type(point_t), intent(inout), optional :: kept
    call winkler_equilibrium(qp, qp%coarse%resultant, stiffness, qp%initial_penetration, alpha, start, kept)
    call qp%mode_displacement(alpha, force)
    force = stiffness*max(0.0_dp, force + qp%initial_penetration)
  end subroutine rest_on_foundation
end module dotyk_scheme_neutral_modes
