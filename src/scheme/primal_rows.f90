!> The primal scheme on its working set: pressures of all rows to those of the set, and back.
module dotyk_scheme_primal_rows
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_corner_contact, only: solve_corner_contact
  use dotyk_scheme_primal_system, only: primal_system_t
  use dotyk_scheme_proximal_active_set, only: proximal_outcome_t, solve_proximal
  implicit none
  private
  public :: proximal_outcome_t, solve_rows, start_in_corners

contains

  !> The start: contact of the bodies in their corner spaces.
  subroutine start_in_corners(part, theta, load, working, system, m, v)
    !> The QP on the working set.
    type(contact_qp_t), intent(in) :: part
    !> Penalty parameters of its rows (n) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Loads that u_0 does not balance (system%n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Working set (n_rows).
    logical, intent(in) :: working(:)
    !> The bodies and rows.
    type(primal_system_t), intent(inout) :: system
    !> Pressures (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> Displacements by contact (system%n) [length].
    real(dp), intent(inout), contiguous :: v(:)
    real(dp) :: of_part(part%n_rows), nothing(size(m))
    nothing = 0
    call solve_corner_contact(system, part, -part%initial_penetration, theta, load, of_part, v)
    m(:) = unpack(of_part, working, nothing)
  end subroutine start_in_corners

  !> Solve on the working set.
  subroutine solve_rows(system, part, theta, load, working, accuracy, most_steps, m, v, outcome, error)
    !> The bodies and rows; its active set is changed.
    type(primal_system_t), intent(inout) :: system
    !> The QP on the working set.
    type(contact_qp_t), intent(in) :: part
    !> Penalty parameters of its rows (n) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Loads that u_0 does not balance (system%n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Working set (n_rows).
    logical, intent(in) :: working(:)
    !> Relative, of the displacements in the energy norm [].
    real(dp), intent(in) :: accuracy
    !> Linear systems at most.
    integer, intent(in) :: most_steps
    !> Pressures: start and solution (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> Displacements by contact: start and solution (system%n) [length].
    real(dp), intent(inout), contiguous :: v(:)
    !> How it went.
    type(proximal_outcome_t), intent(out) :: outcome
    !> Allocated where numbers are not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: of_part(part%n_rows), nothing(size(m))
    nothing = 0
    of_part = pack(m, working)
    call solve_proximal(system, part%weight, -part%initial_penetration, theta, load, accuracy, max(1, most_steps), &
                        of_part, v, outcome, error, sqrt(max(0.0_dp, part%norm_square_0)))
    m(:) = unpack(of_part, working, nothing)
  end subroutine solve_rows
end module dotyk_scheme_primal_rows
