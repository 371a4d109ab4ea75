!> Contact of bodies that are tied together: a scheme solves the programme of the groups of tied bodies, which has the
!> contact rows only, in place of that of the bodies (`dotyk_scheme_condensation`).
module dotyk_scheme_tied
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_condensed_qp, only: condense, condensed_qp_t, ties_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_restriction, only: aggregate_values
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_stalled, solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  !> The scheme.
  type, extends(scheme_t), public :: tied_t
    !> Scheme of the groups.
    class(scheme_t), allocatable :: of_groups
    !> What joins bodies and rows.
    type(ties_t) :: ties
  contains
    procedure :: solve => tied_solve
    procedure :: needs_held_bodies => tied_needs_held_bodies
    procedure :: allows_zero_theta => tied_allows_zero_theta
    procedure :: expected_products => tied_expected_products
    procedure :: finds_displacements => tied_finds_displacements
  end type tied_t

  !> Rounding of the displacements of a group that moves as a whole, as a fraction of what its ties close [].
  real(dp), parameter :: rounding_of_motion = 1.0e3_dp*epsilon(1.0_dp)

contains

  !> As the scheme of the groups.
  pure logical function tied_needs_held_bodies(self) result(needed)
    !> The scheme.
    class(tied_t), intent(in) :: self
    needed = self%of_groups%needs_held_bodies()
  end function tied_needs_held_bodies

  !> As the scheme of the groups.
  pure logical function tied_allows_zero_theta(self) result(allowed)
    !> The scheme.
    class(tied_t), intent(in) :: self
    allowed = self%of_groups%allows_zero_theta()
  end function tied_allows_zero_theta

  !> It forms the entries that it needs.
  pure integer function tied_expected_products(self) result(n)
    !> The scheme.
    class(tied_t), intent(in) :: self
    n = self%of_groups%expected_products()
  end function tied_expected_products

  !> Another theta is for the scheme: ties are no contact forces, of which tensile ones may be dropped.
  logical function tied_finds_displacements(self, qp, compliance, theta) result(finds)
    !> The scheme.
    class(tied_t), intent(in) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> C.
    class(compliance_t), intent(in) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    finds = .true.
    associate (not_needed => [same_type_as(self, self), same_type_as(compliance, compliance), &
                              qp%n_rows == size(theta)])
    end associate
  end function tied_finds_displacements

  !> Solve.
  subroutine tied_solve(self, qp, compliance, theta, settings, monitor, state, error)
    !> The scheme.
    class(tied_t), intent(in) :: self
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows; all its entries are formed.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters; 0 for ties (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> Where to begin if it has pressures; those of ties are tractions in x, y, z.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where ties contradict each other or supports, or the scheme of the groups fails.
    type(error_t), allocatable, intent(out) :: error
    type(condensed_qp_t) :: condensed
    call compliance%form(qp)
    call condense(self%ties, qp, compliance, condensed, error)
    if (allocated(error)) return
    associate (n => self%ties%first_tie - 1, n_joined => condensed%qp%n_rows, joined_row => self%ties%joined_row)
      if (allocated(state%m)) then
        state%m = aggregate_values(joined_row, n_joined, condensed%fraction, state%m(:n))
        if (allocated(state%y)) state%y = aggregate_values(joined_row, n_joined, condensed%fraction, state%y(:n))
      end if
      if (allocated(state%alpha)) deallocate (state%alpha)
      call self%of_groups%solve(condensed%qp, condensed%compliance, &
                                aggregate_values(joined_row, n_joined, condensed%fraction, theta(:n)), settings, &
                                monitor, state, error)
    end associate
    if (allocated(error)) return
    if (state%rigid_row > 0) state%rigid_row = findloc(self%ties%joined_row, state%rigid_row, 1)
    call expand(qp, compliance, self%ties%joined_row, condensed, settings%tolerance, state)
  end subroutine tied_solve

  !> The state of the bodies from that of the groups.
  subroutine expand(qp, compliance, joined_row, condensed, tolerance, state)
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies.
    class(compliance_t), intent(inout) :: compliance
    !> Row of the programme of the groups of each contact row (number of these).
    integer, intent(in) :: joined_row(:)
    !> The programme of the groups.
    type(condensed_qp_t), intent(in) :: condensed
    !> Error that is allowed, relative in the energy norm [].
    real(dp), intent(in) :: tolerance
    !> That of the groups in, of the bodies out.
    type(solver_state_t), intent(inout) :: state
    type(mode_columns_t) :: indeterminate
    real(dp), allocatable :: lambda(:), alpha(:), z(:), of_group(:)
    real(dp), allocatable :: forces(:, :), amplitudes(:, :), b(:, :), c(:, :), motion(:, :)
    real(dp) :: work, energy, left, noise, norm, open
    integer :: g, k, n
    work = 0
    left = 0
    noise = 0
    allocate (of_group(condensed%qp%coarse%n), motion(qp%coarse%n, state%indeterminate%n))
    do k = 1, state%indeterminate%n
      call state%indeterminate%get(k, of_group)
      motion(:, k) = motions_of(of_group)
      call indeterminate%add(motion(:, k))
    end do
    state%indeterminate = indeterminate
    if (allocated(state%unbounded)) state%unbounded = motions_of(state%unbounded)
    if (.not. allocated(state%m)) return
    allocate (lambda(qp%n_rows), z(qp%n_rows), source=0.0_dp)
    n = size(joined_row)
    lambda(:n) = qp%weight(:n)*state%m(joined_row)
    ! Without a scale.
    alpha = motions_of(state%alpha)/qp%coarse%scale
    do g = 1, size(condensed%group)
      associate (group => condensed%group(g))
        if (size(group%tie) == 0) cycle
        b = reshape(qp%initial_penetration(group%tie) - matmul(group%c_tc, lambda(group%contact)), [size(group%tie), 1])
        c = reshape(group%resultants(qp%coarse%resultant) - matmul(lambda(group%contact), group%g_c), &
                    [size(group%s, 1), 1])
        associate (beta => state%alpha(condensed%qp%coarse%first(g):condensed%qp%coarse%first(g + 1) - 1))
          call group%move(beta, b(:, 1), c(:, 1))
        end associate
        call group%solve(b, c, forces, amplitudes, residual=open, energy=energy)
        left = left + energy
        if (open > 0) noise = noise + energy*(rounding_of_motion*maxval(abs(b))/open)**2
        lambda(group%tie) = forces(:, 1)
        alpha(group%mode) = alpha(group%mode) + amplitudes(:size(group%mode), 1)
        associate (beta => state%alpha(condensed%qp%coarse%first(g):condensed%qp%coarse%first(g + 1) - 1))
          work = work + group%shortening_work(amplitudes(:, 1) + matmul(group%free, beta))
        end associate
      end associate
    end do
    call remove_indeterminate(qp%coarse%scale, motion, alpha)
    call compliance%multiply(qp, lambda, z)
    state%y = 0*z
    call qp%mode_displacement(alpha, state%y)
    state%y = qp%initial_penetration - z + state%y
    state%m = lambda/qp%weight
    state%alpha = qp%coarse%scale*alpha
    norm = qp%energy_norm(state%m, state%y, alpha)
    ! A motion of the whole group without strains leaves rounding alone: no energy to relate it to.
    if (norm**2 <= noise) left = 0
    ! The bound of the scheme is that of closed ties.
    if (state%error_bound < huge(norm) .and. norm > 0) state%error_bound = state%error_bound + sqrt(left)/norm
    if (state%history%n > 0) state%history%error_bound(state%history%n) = state%error_bound
    if (state%ended == ended_converged .and. state%error_bound > tolerance) state%ended = ended_stalled
    if (abs(work) > 0) &
      state%terms = [norm**2/2, qp%load_work(state%m, alpha) + work]

  contains

    !> Amplitudes of the modes of the bodies.
    function motions_of(of_groups) result(of_bodies)
      !> Of the motions of the groups (number of these) [length].
      real(dp), intent(in) :: of_groups(:)
      !> (coarse%n) [length]
      real(dp) :: of_bodies(qp%coarse%n)
      integer :: i
      of_bodies = 0
      do i = 1, size(condensed%group)
        associate (own => condensed%group(i), first => condensed%qp%coarse%first(i), &
                   last => condensed%qp%coarse%first(i + 1) - 1)
          of_bodies(own%mode) = qp%coarse%scale(own%mode)*matmul(own%free(:size(own%mode), :), of_groups(first:last))
        end associate
      end do
    end function motions_of
  end subroutine expand

  !> Leave nothing of the amplitudes along indeterminate motions: these are combinations of the modes of several bodies,
  !> of which a scheme holds one mode each.
  subroutine remove_indeterminate(scale, motion, alpha)
    !> Amplitudes of the modes of the bodies per amplitude (n).
    real(dp), intent(in) :: scale(:)
    !> The motions as amplitudes of the modes of the bodies, in columns; orthonormal on return (n, n_motions) [].
    real(dp), intent(inout) :: motion(:, :)
    !> Amplitudes, without the scale (n) [length].
    real(dp), intent(inout) :: alpha(:)
    integer :: k, j
    do k = 1, size(motion, 2)
      motion(:, k) = motion(:, k)/scale
      do j = 1, k - 1
        motion(:, k) = motion(:, k) - dot_product(motion(:, j), motion(:, k))*motion(:, j)
      end do
      motion(:, k) = motion(:, k)/max(tiny(1.0_dp), norm2(motion(:, k)))
      alpha = alpha - dot_product(motion(:, k), alpha)*motion(:, k)
    end do
  end subroutine remove_indeterminate
end module dotyk_scheme_tied
