!> What every scheme is: a solver of a contact QP for a given penalty parameter, with properties that others ask for.
!>
!> A new scheme is an extension in a file of its own, a name in `dotyk_base_options`, and a line in
!> `dotyk_scheme_registry`.
module dotyk_scheme_scheme
  use dotyk_base_error, only: error_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  !> Why a scheme leaves a QP to another one, or its solution is not taken.
  integer, parameter, public :: reason_none = 0  !< it solves it itself
  integer, parameter, public :: reason_no_rows = 1  !< there is no contact
  integer, parameter, public :: reason_near_null_modes = 2  !< supports hardly resist some motions
  integer, parameter, public :: reason_rigid_rows = 3  !< supports press rows together, and theta is zero
  integer, parameter, public :: reason_slow = 4  !< it would take longer than another one
  integer, parameter, public :: reason_accuracy = 5  !< it does not reach the tolerance
  integer, parameter, public :: reason_aggregates = 7  !< tied bodies are too large for the factor of a corner space
  integer, parameter, public :: reason_parts = 6  !< ranks have parts of bodies that are not to be split

  type, abstract, public :: scheme_t  !! A scheme.
  contains
    procedure(solve_interface), deferred :: solve  !! Solve a QP.
    !> Whether it is the general iteration (32), of held bodies with theta > 0; others take any.
    procedure, nopass :: is_iteration => no_iteration
    !> Products with the compliance that it takes one by one, about; 0: it forms the entries that it needs.
    procedure, nopass :: expected_products => no_products
    procedure, nopass :: why_not => no_reason  !! Why it leaves such a QP to another one.
  end type scheme_t

  abstract interface
    !> Solve.
    subroutine solve_interface(self, qp, compliance, settings, monitor, state, error)
      import :: scheme_t, contact_qp_t, compliance_t, solver_settings_t, monitor_t, solver_state_t, error_t
      class(scheme_t), intent(in) :: self
      type(contact_qp_t), intent(in) :: qp  !! The rows, the initial penetration, the rigid body modes.
      class(compliance_t), intent(inout) :: compliance  !! C; what entries it forms stays there.
      type(solver_settings_t), intent(in) :: settings  !! What the user chose.
      class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
      !> Where to begin if it has pressures; where the scheme ended, and how.
      type(solver_state_t), intent(inout) :: state
      !> Allocated where the settings contradict each other, the matrix of a linear system is singular or not positive
      !> definite, or an interrupt came before there was a state.
      type(error_t), allocatable, intent(out) :: error
    end subroutine solve_interface
  end interface

contains

  !> The scheme is no iteration (32).
  pure logical function no_iteration() result(is_iteration)
    is_iteration = .false.
  end function no_iteration

  !> The scheme forms the entries that it needs.
  pure integer function no_products() result(n)
    n = 0
  end function no_products

  !> The scheme solves every QP: one of `reason_*`.
  integer function no_reason(qp, compliance) result(reason)
    type(contact_qp_t), intent(in) :: qp  !! The rows, the initial penetration, the rigid body modes.
    class(compliance_t), intent(in) :: compliance  !! C.
    reason = reason_none
    associate (not_needed => [same_type_as(compliance, compliance), qp%n_rows == size(qp%theta)])
    end associate
  end function no_reason

end module dotyk_scheme_scheme
