!> The linear system of an active set: contact forces on the active rows, and amplitudes of the rigid body modes.
!>
!> With M = C + Theta W^{-1} on the active rows, G their rows of the coarse space, and S the stiffness of
!> near-null-space modes:
!>
!>     M lambda - G alpha = b,    G^T lambda + S alpha = c.
!>
!> It is solved by factorization of the whole saddle point matrix (`dotyk_scheme_direct_system`), by conjugate
!> gradients that know the network of many bodies (`dotyk_scheme_network_system`), or matrix-free by projected conjugate
!> gradients (`dotyk_scheme_iterative_system`).
module dotyk_scheme_active_system
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  implicit none
  private
  public :: proximal_term

  !> The system.
  type, abstract, public :: active_system_t
    !> Active rows of the contact operator, ascending (n).
    integer, allocatable :: row(:)
    !> Compliance theta/w of the Winkler layer there (n) [length/force].
    real(dp), allocatable :: layer(:)
    !> Iterative solutions end where the residual of the start is reduced to this fraction; 0: at rounding [].
    real(dp) :: reduction = 0
    !> Steps of Newton's method need no more accuracy: fraction of the energy of the step that the network system may
    !> leave in the residual; 0: rounding [].
    real(dp) :: step_reduction = 0
    !> Null modes: rigid body modes that the active points do not restrain; the largest amplitude of each is 1.
    type(mode_columns_t) :: null_mode
  contains
    !> Set `row` and `layer`.
    procedure :: take_points => system_take_points
    !> Whether it is prepared for an active set.
    procedure :: is_for => system_is_for
    !> Free the components of this type.
    procedure :: forget => system_forget
    !> Prepare the system of an active set; another one may stand there before.
    procedure(init_interface), deferred :: init
    !> Solve to rounding, or to `reduction`. Null modes get amplitude 0; the part of c that excites them remains in the
    !> residual.
    procedure(solve_interface), deferred :: solve
    !> Whether it needs the entries of the compliance at the active rows.
    procedure(needs_entries_interface), deferred :: needs_entries
    !> Free all memory.
    procedure(destroy_interface), deferred :: destroy
  end type active_system_t

  abstract interface
    !> Prepare the system.
    subroutine init_interface(self, qp, compliance, theta, active, error)
      import :: active_system_t, contact_qp_t, compliance_t, error_t, dp
      !> The system.
      class(active_system_t), intent(inout) :: self
      !> Contact rows and rigid body modes.
      type(contact_qp_t), intent(in) :: qp
      !> Compliance operator, formed at all active rows or matrix-free.
      class(compliance_t), intent(inout) :: compliance
      !> Penalty parameters (n_rows) [length/pressure].
      real(dp), intent(in) :: theta(:)
      !> The active set (n_rows).
      logical, intent(in) :: active(:)
      !> The system cannot be prepared; the extensions say why.
      type(error_t), allocatable, intent(out) :: error
    end subroutine init_interface

    !> Solve the system.
    subroutine solve_interface(self, qp, compliance, b, c, lambda, alpha)
      import :: active_system_t, contact_qp_t, compliance_t, dp
      !> The system.
      class(active_system_t), intent(in) :: self
      !> The problem that it was made for.
      type(contact_qp_t), intent(in) :: qp
      !> The compliance that it was made for.
      class(compliance_t), intent(inout) :: compliance
      !> Right-hand side of the contact rows (n) [length].
      real(dp), intent(in) :: b(:)
      !> Right-hand side of the equilibrium of the modes (coarse%n) [force].
      real(dp), intent(in) :: c(:)
      !> Contact forces; an initial guess on entry (n) [force].
      real(dp), intent(inout) :: lambda(:)
      !> Amplitudes of the modes (coarse%n) [length].
      real(dp), intent(out) :: alpha(:)
    end subroutine solve_interface

    !> Whether it needs the entries of the compliance.
    pure logical function needs_entries_interface(self)
      import :: active_system_t
      !> The system.
      class(active_system_t), intent(in) :: self
    end function needs_entries_interface

    !> Free all memory.
    subroutine destroy_interface(self)
      import :: active_system_t
      !> The system.
      class(active_system_t), intent(inout) :: self
    end subroutine destroy_interface
  end interface

  !> Proximal term: the fraction of the diagonal of M that is added before the factorization. Far above the rounding of
  !> M (1e-16 of it), far below what slows down the refinement: each step gains nine digits where rows are independent.
  real(dp), parameter :: proximal_fraction = 1.0e-9_dp
  !> Most of it, where weights or stiffnesses differ: six digits a step.
  real(dp), parameter :: most_proximal_fraction = 1.0e-6_dp

contains

  !> Take the active rows of a problem.
  subroutine system_take_points(self, qp, theta, active)
    !> The system.
    class(active_system_t), intent(inout) :: self
    !> With the weights of the rows.
    type(contact_qp_t), intent(in) :: qp
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The active set (n_rows).
    logical, intent(in) :: active(:)
    integer :: i
    self%row = pack([(i, i=1, size(active))], active)
    self%layer = theta(self%row)/qp%weight(self%row)
  end subroutine system_take_points

  !> Whether the system is prepared for an active set.
  pure logical function system_is_for(self, qp, theta, active) result(is_for)
    !> The system.
    class(active_system_t), intent(in) :: self
    !> The problem that it may have been made for.
    type(contact_qp_t), intent(in) :: qp
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The active set (n_rows).
    logical, intent(in) :: active(:)
    is_for = .false.
    if (.not. allocated(self%row)) return
    if (size(self%row) /= count(active)) return
    is_for = all(active(self%row)) .and. .not. any(abs(self%layer - theta(self%row)/qp%weight(self%row)) > 0)
  end function system_is_for

  !> What is added to the diagonal of M for the factorization: the same theta on all rows without a layer, as far as
  !> that is a small fraction of the diagonal [length/force].
  pure function proximal_term(diagonal, layer, weight) result(term)
    !> Diagonal of M (n) [length/force].
    real(dp), intent(in) :: diagonal(:)
    !> Compliance theta/w of the layer (n) [length/force].
    real(dp), intent(in) :: layer(:)
    !> Weights of the rows (n) [length^2; length in two dimensions].
    real(dp), intent(in) :: weight(:)
    real(dp) :: term(size(diagonal))
    real(dp) :: theta
    theta = maxval(diagonal*weight, mask=.not. layer > 0)
    term = proximal_fraction*diagonal
    where (.not. layer > 0) term = max(term, min(proximal_fraction*theta/weight, most_proximal_fraction*diagonal))
  end function proximal_term

  !> Free what all systems have.
  subroutine system_forget(self)
    !> The system.
    class(active_system_t), intent(inout) :: self
    if (allocated(self%row)) deallocate (self%row, self%layer)
    call self%null_mode%destroy()
  end subroutine system_forget
end module dotyk_scheme_active_system
