!> Contact of bodies that are tied together: a scheme solves the programme of the groups of tied bodies, which has the
!> contact rows only, in place of that of the bodies (`dotyk_scheme_condensation`).
module dotyk_scheme_tied
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_condensation, only: find_groups, slide_t, tied_group_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_stalled, solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  !> The scheme.
  type, extends(scheme_t), public :: tied_t
    !> Scheme of the groups.
    class(scheme_t), allocatable :: of_groups
    !> Rows from this one on are ties.
    integer :: first_tie = 1
    !> Bolts of given tension (n_slides).
    type(slide_t), allocatable :: slide(:)
    !> First row of each tie, and its name (n_ties).
    integer, allocatable :: first_row(:)
    type(text_t), allocatable :: name(:)
  contains
    procedure :: solve => tied_solve
    procedure :: needs_held_bodies => tied_needs_held_bodies
    procedure :: allows_zero_theta => tied_allows_zero_theta
    procedure :: expected_products => tied_expected_products
    procedure :: finds_displacements => tied_finds_displacements
  end type tied_t

  !> The programme of the groups.
  type :: condensed_t
    !> Group of each body (n_bodies).
    integer, allocatable :: group_of(:)
    !> (n_groups).
    type(tied_group_t), allocatable :: group(:)
    !> Its rows are the contact rows, its bodies the groups.
    type(contact_qp_t) :: qp
    !> Their compliance.
    type(dense_compliance_t) :: compliance
  end type condensed_t

  !> Ties that stay open by more than this fraction of what they or their forces would open contradict each other or
  !> supports.
  real(dp), parameter :: most_open = 1.0e-6_dp
  !> Rounding of the displacements of a group that moves, over `most_open` [].
  real(dp), parameter :: rounding_of_motion = 1.0e3_dp*epsilon(1.0_dp)/most_open
  !> Resultants on several bodies below this fraction of those of each are rounding.
  real(dp), parameter :: rounding_of_sums = 1.0e-12_dp

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
    type(condensed_t) :: condensed
    call compliance%form(qp)
    call condense(self, qp, compliance, condensed, error)
    if (allocated(error)) return
    associate (n => self%first_tie - 1)
      if (allocated(state%m)) then
        state%m = state%m(:n)
        if (allocated(state%y)) state%y = state%y(:n)
      end if
      if (allocated(state%alpha)) deallocate (state%alpha)
      call self%of_groups%solve(condensed%qp, condensed%compliance, theta(:n), settings, monitor, state, error)
    end associate
    if (allocated(error)) return
    call expand(qp, compliance, condensed, settings%tolerance, state)
  end subroutine tied_solve

  !> The programme of the groups.
  subroutine condense(self, qp, compliance, condensed, error)
    !> The scheme, with the ties.
    type(tied_t), intent(in) :: self
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> Formed at all rows.
    class(compliance_t), intent(inout) :: compliance
    !> The programme.
    type(condensed_t), intent(out) :: condensed
    !> As in `tied_solve`.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: lambda(:), alpha(:), of_loads(:), alpha_of_loads(:), y(:), z(:), load_work(:)
    real(dp) :: work
    integer :: n_groups, g, i
    work = 0
    call find_groups(qp, self%first_tie, condensed%group_of, n_groups)
    allocate (condensed%group(n_groups))
    allocate (lambda(qp%n_rows), of_loads(qp%n_rows), alpha(qp%coarse%n), alpha_of_loads(qp%coarse%n), &
              source=0.0_dp)
    do g = 1, n_groups
      associate (group => condensed%group(g))
        call group%take_rows(qp, self%first_tie, condensed%group_of, g, self%slide)
        call group%form(qp, compliance, error)
        if (allocated(error)) return
        call tie_without_contact(self, group, qp, lambda, alpha, of_loads, alpha_of_loads, work, error)
        if (allocated(error)) return
      end associate
    end do
    ! The solution with ties and without contact, u_0 - K^+ B_t^T lambda + R alpha, and what loads alone do.
    allocate (y(qp%n_rows), z(qp%n_rows), load_work(qp%n_rows))
    call qp%mode_displacement(alpha, y)
    call compliance%multiply(qp, lambda, z)
    y = qp%initial_penetration - z + y
    call qp%mode_displacement(alpha_of_loads, load_work)
    call compliance%multiply(qp, of_loads, z)
    load_work = qp%load_displacement - z + load_work
    associate (small => condensed%qp, n => self%first_tie - 1)
      small%n_rows = n
      small%dimension = qp%dimension
      small%pair_first_row = qp%pair_first_row
      small%level = qp%level
      small%parent_row = [(i, i=1, n)]
      small%weight = qp%weight(:n)
      small%gap = qp%gap(:n)
      small%foundation = qp%foundation(:n)
      small%initial_penetration = y(:n)
      small%load_displacement = load_work(:n)
      small%norm_square_0 = qp%energy_norm(lambda/qp%weight, y, alpha)**2
      small%energy_0 = small%norm_square_0/2 - qp%load_work(lambda/qp%weight, alpha) - work
      allocate (small%block(n_groups))
      do g = 1, n_groups
        small%block(g)%row = condensed%group(g)%contact
        allocate (small%block(g)%contact_node(0))
        allocate (small%block(g)%matrix%row_start(size(small%block(g)%row) + 1), source=1)
        allocate (small%block(g)%matrix%column(0), small%block(g)%matrix%value(0))
        small%block(g)%matrix%n_rows = size(small%block(g)%row)
      end do
      call take_modes(qp, condensed)
      call condensed%compliance%init(small)
      do g = 1, n_groups
        call condensed%compliance%set(small, g, condensed%group(g)%condensed_compliance())
      end do
    end associate
  end subroutine condense

  !> Forces of the ties of a group, and amplitudes of its modes, without contact.
  subroutine tie_without_contact(self, group, qp, lambda, alpha, of_loads, alpha_of_loads, work, error)
    !> The scheme, with the ties.
    type(tied_t), intent(in) :: self
    !> The group, formed.
    type(tied_group_t), intent(in) :: group
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> Forces; those of the ties of the group are set (n_rows) [force].
    real(dp), intent(inout) :: lambda(:)
    !> Amplitudes; those of the group are set (coarse%n) [length].
    real(dp), intent(inout) :: alpha(:)
    !> The same by loads alone, with supports at rest (n_rows) [force].
    real(dp), intent(inout) :: of_loads(:)
    !> The same by loads alone, with supports at rest (coarse%n) [length].
    real(dp), intent(inout) :: alpha_of_loads(:)
    !> Work of the tensions of bolts; added to [energy].
    real(dp), intent(inout) :: work
    !> Allocated where the ties contradict each other or supports.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: c(size(group%s, 1), 2), b(size(group%tie), 2), open, most
    real(dp), allocatable :: forces(:, :), amplitudes(:, :)
    integer :: worst
    if (size(group%tie) == 0) return
    c(:, 1) = group%resultants(qp%coarse%resultant)
    c(:, 2) = c(:, 1)
    if (allocated(qp%coarse%lift)) c(:, 2) = group%resultants(qp%coarse%resultant - qp%coarse%lift)
    b(:, 1) = qp%initial_penetration(group%tie)
    b(:, 2) = qp%load_displacement(group%tie)
    call group%solve(b, c, forces, amplitudes, open, worst=worst)
    most = max(maxval(abs(b)), maxval(abs(matmul(group%c_tt, forces))))
    ! Large motions of the whole group, on soft springs, leave their rounding.
    most = max(most, rounding_of_motion*maxval(matmul(abs(group%g_t), abs(amplitudes))))
    if (open > most_open*most) then
      call set_error(error, 'tie '//quoted(self%name(count(self%first_row <= group%tie(worst)))%s)//' cannot be '// &
                     'closed: '//to_text(open, 2)//' of '//to_text(most, 2)//' remain open; supports '// &
                     'with different displacements hold both sides, or ties contradict each other', &
                     exit_not_solvable)
      return
    end if
    lambda(group%tie) = forces(:, 1)
    alpha(group%mode) = amplitudes(:size(group%mode), 1)
    work = work + group%shortening_work(amplitudes(:, 1))
    of_loads(group%tie) = forces(:, 2)
    alpha_of_loads(group%mode) = amplitudes(:size(group%mode), 2)
  end subroutine tie_without_contact

  !> The rigid body motions of the groups; those of single bodies are its modes, with their stiffness.
  subroutine take_modes(qp, condensed)
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> With groups and rows; gets the coarse space.
    type(condensed_t), intent(inout) :: condensed
    integer :: g
    associate (coarse => condensed%qp%coarse, group => condensed%group)
      call coarse%take_rows(condensed%qp%block, condensed%qp%n_rows)
      allocate (coarse%first(size(group) + 1), coarse%block(size(group)))
      coarse%first(1) = 1
      do g = 1, size(group)
        coarse%first(g + 1) = coarse%first(g) + size(group(g)%free, 2)
        coarse%block(g)%value = matmul(group(g)%g_c, group(g)%free)
      end do
      coarse%n = coarse%first(size(group) + 1) - 1
      allocate (coarse%scale(coarse%n), source=1.0_dp)
      coarse%resultant = of_groups(qp%coarse%resultant, with_tensions=.true.)
      if (.not. allocated(qp%coarse%stiffness)) return
      coarse%lift = of_groups(qp%coarse%lift, with_tensions=.false.)
      coarse%resultant_size = of_groups(qp%coarse%resultant_size, with_tensions=.false.)
      allocate (coarse%stiffness(size(group)))
      do g = 1, size(group)
        allocate (coarse%stiffness(g)%value(size(group(g)%free, 2), size(group(g)%free, 2)), source=0.0_dp)
        if (size(group(g)%tie) == 0) coarse%stiffness(g)%value = group(g)%s
      end do
    end associate

  contains

    !> Forces on the motions of the groups.
    function of_groups(force, with_tensions) result(on_groups)
      !> On the modes of the bodies (coarse%n) [force].
      real(dp), intent(in) :: force(:)
      !> Whether bolts take part.
      logical, intent(in) :: with_tensions
      real(dp) :: on_groups(condensed%qp%coarse%n)
      real(dp), allocatable :: own_force(:)
      integer :: k
      do k = 1, size(condensed%group)
        associate (own => condensed%group(k), sums => on_groups(condensed%qp%coarse%first(k): &
                                                                condensed%qp%coarse%first(k + 1) - 1))
          own_force = own%resultants(force)
          if (.not. with_tensions) own_force(size(own%mode) + 1:) = 0
          sums = matmul(own_force, own%free)
          if (size(own%tie) == 0) cycle
          ! Forces on tied bodies cancel but for rounding.
          where (abs(sums) < rounding_of_sums*max(matmul(abs(own_force), abs(own%free)), &
                                                  maxval(abs(own_force))*maxval(abs(own%free), 1))) sums = 0
        end associate
      end do
    end function of_groups
  end subroutine take_modes

  !> The state of the bodies from that of the groups.
  subroutine expand(qp, compliance, condensed, tolerance, state)
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies.
    class(compliance_t), intent(inout) :: compliance
    !> The programme of the groups.
    type(condensed_t), intent(in) :: condensed
    !> Error that is allowed, relative in the energy norm [].
    real(dp), intent(in) :: tolerance
    !> That of the groups in, of the bodies out.
    type(solver_state_t), intent(inout) :: state
    type(mode_columns_t) :: indeterminate
    real(dp), allocatable :: lambda(:), alpha(:), z(:), of_group(:)
    real(dp), allocatable :: forces(:, :), amplitudes(:, :), b(:, :), c(:, :), motion(:, :)
    real(dp) :: work, energy, left, norm
    integer :: g, k
    work = 0
    left = 0
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
    associate (n => condensed%qp%n_rows)
      lambda(:n) = qp%weight(:n)*state%m
    end associate
    ! Without a scale.
    alpha = motions_of(state%alpha)/qp%coarse%scale
    do g = 1, size(condensed%group)
      associate (group => condensed%group(g))
        if (size(group%tie) == 0) cycle
        b = reshape(qp%initial_penetration(group%tie) - matmul(group%c_tc, lambda(group%contact)), [size(group%tie), 1])
        c = reshape(group%resultants(qp%coarse%resultant) - matmul(lambda(group%contact), group%g_c), &
                    [size(group%s, 1), 1])
        call group%solve(b, c, forces, amplitudes, energy=energy)
        left = left + energy
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
