!> Motions of floating bodies that the active rows do not restrain.
!>
!> Where the loads do no work on them they are neutral. Where they do, the bodies move until rows meet, which is the
!> next active set; without such rows there is no equilibrium.
module dotyk_scheme_free_motion
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_fixed_sum, only: add_multiple, scalar_product
  use dotyk_scheme_contact_multigrid, only: contact_multigrid_t
  use dotyk_scheme_solver_state, only: ended_no_equilibrium
  implicit none
  private
  public :: follow_free_motion, imbalance, meet_rows

  !> Resultants below this fraction of the loads are rounding errors, of the loads or of the mesh.
  real(dp), parameter :: imbalance = 1.0e-7_dp
  !> Rows that approach by less than this fraction of the fastest one do not.
  real(dp), parameter :: slowest = 1.0e-9_dp
  !> Rows meet together where they do so within this fraction of the motion.
  real(dp), parameter :: together = 1.0e-6_dp

contains

  !> Move until rows meet.
  subroutine follow_free_motion(system, load, r, gap, active, u, moved, ended)
    !> The bodies, with motions that the active rows do not restrain.
    class(contact_multigrid_t), intent(in) :: system
    !> Loads (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Residual of the equilibrium (n) [force].
    real(dp), intent(in), contiguous :: r(:)
    !> Gaps that are left (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Active rows; the rows that meet join (n_rows).
    logical, intent(inout) :: active(:)
    !> Displacements (n) [length].
    real(dp), intent(inout), contiguous :: u(:)
    !> Whether the loads excite a motion and rows stop it.
    logical, intent(out) :: moved
    !> Set to `ended_no_equilibrium` where no row stops it.
    integer, intent(inout) :: ended
    real(dp), allocatable :: resultant(:), motion(:), rate(:)
    real(dp) :: first
    resultant = matmul(system%resultants(r), system%active%free_mode)
    where (abs(resultant) <= imbalance*norm2(system%active%free_mode, 1)* &
           sqrt(max(scalar_product(system%n, load, load), scalar_product(system%n, r, r)))) resultant = 0
    moved = any(abs(resultant) > 0)
    if (.not. moved) return
    allocate (motion(system%n), rate(size(gap)))
    motion = 0
    call system%add_modes(matmul(system%active%free_mode, resultant), motion)
    call system%row_displacement(motion, rate)
    call meet_rows(rate, gap, active, first, ended)
    if (ended /= ended_no_equilibrium) call add_multiple(system%n, first, motion, u)
  end subroutine follow_free_motion

  !> The rows that meet first in a motion.
  pure subroutine meet_rows(rate, gap, active, first, ended)
    !> Displacements of the rows by the motion (n_rows) [length].
    real(dp), intent(in) :: rate(:)
    !> Gaps that are left (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Active rows; the rows that meet join (n_rows).
    logical, intent(inout) :: active(:)
    !> Multiple of the motion at which they meet; 0 where none do [].
    real(dp), intent(out) :: first
    !> Set to `ended_no_equilibrium` where no row stops the motion.
    integer, intent(inout) :: ended
    real(dp) :: time(size(rate))
    logical :: approaches(size(rate))
    first = 0
    approaches = .not. active .and. rate > slowest*maxval([0.0_dp, abs(rate)])
    if (.not. any(approaches)) then
      ended = ended_no_equilibrium
      return
    end if
    time = huge(time)
    where (approaches) time = max(0.0_dp, gap)/rate
    first = minval(time)
    active = active .or. time <= (1 + together)*first
  end subroutine meet_rows
end module dotyk_scheme_free_motion
