!> What hangs on gaps that the meshes do not tell exactly, and on contacts narrower than their facets: how contact
!> forces and displacements change where all gaps are smaller by their uncertainty, and, with several pairs, where every
!> second one is greater instead.
!>
!> The scheme solves the QP again from its solution: the active set is nearly the same, and what it needs of the
!> compliance is known.
module dotyk_control_gap_doubt
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_thresholds, only: notable, rounding
  use dotyk_contact_contact_patches, only: contact_patch_t, find_patches
  use dotyk_contact_narrow_contact, only: find_narrow_contact
  use dotyk_control_body_solution, only: displacements_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_ranks_exchange, only: greatest
  use dotyk_scheme_active_set, only: foundation_stiffness
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_linear_solver_choice, only: is_heap
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_proximal_motion, only: fraction
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_limit, ended_solves, ended_stalled
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  type, public :: gap_doubt_t  !! Of one pair; NaN where it is not known.
    real(dp) :: uncertainty = 0  !! Uncertainty of its gaps where they matter: of rows that may be active [length].
    real(dp) :: force = 0, force_change = 0  !! Sum of its contact forces, and its uncertainty [force].
    real(dp) :: area_change = 0  !! Uncertainty of its contact area [as the weights].
    real(dp) :: moved_change = 0  !! Uncertainty of normal displacements of its sides against each other [length].
    !> Both uncertainties as parts of the greatest force of all pairs and the greatest displacement of all bodies [].
    real(dp) :: force_part = 0, moved_part = 0
    real(dp) :: peak = 0  !! Its greatest pressure [pressure].
    real(dp) :: hertz_peak = 0  !! The same by Hertz; 0 where no contact is narrower than a facet [pressure].
  end type gap_doubt_t

  public :: find_gap_doubt, is_doubtful, is_narrow

  !> Part of the greatest force from which on the uncertainty of a force makes the results doubtful []. Displacements
  !> are told only: floating bodies on coarse facets move by more than their load moves them.
  real(dp), parameter :: doubtful_part = 0.5_dp
  !> Part of the greatest force or displacement below which a rough estimate of its uncertainty is good enough: bodies
  !> in contact are stiffer than their foundation, by the ratio of their size to that of the contact [].
  real(dp), parameter :: negligible = 1.0e-3_dp
  !> Springs of floating bodies are a fraction of their contact as a whole; of a few rows it is ten times as much [].
  real(dp), parameter :: of_springs = 30
  !> Another solution takes so many active sets more than this one at most, and so many where this one took few. Fewer
  !> than this one took leave heaps of bodies out of equilibrium, and their forces look uncertain.
  integer, parameter :: most_more = 3, enough = 20

contains

  !> Whether the results hang on what is not known of the gaps.
  pure logical function is_doubtful(doubt)
    type(gap_doubt_t), intent(in) :: doubt(:)  !! Of all pairs (n_pairs).
    is_doubtful = any(doubt%force_part > doubtful_part)
  end function is_doubtful

  !> Whether the contact of a pair is so much narrower than a facet that its greatest pressure is notably too low.
  elemental logical function is_narrow(doubt)
    type(gap_doubt_t), intent(in) :: doubt  !! Of the pair.
    is_narrow = doubt%hertz_peak > (1 + notable)*doubt%peak
  end function is_narrow

  !> Find it for all pairs.
  subroutine find_gap_doubt(problem, qp, compliance, linear_solver, scheme, displacements, state, doubt)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    class(compliance_t), intent(inout) :: compliance  !! Its compliance operator; entries that are formed stay there.
    integer, intent(in) :: linear_solver  !! One of `linear_solver_*` of dotyk_base_options, for the dual scheme.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the state.
    type(displacements_t), intent(in) :: displacements  !! Displacements, where they are known.
    type(solver_state_t), intent(in) :: state  !! The solution.
    type(gap_doubt_t), allocatable, intent(out) :: doubt(:)  !! (n_pairs)
    real(dp) :: shift(qp%n_rows), sign, moved, least
    class(scheme_t), allocatable :: solver
    integer :: k, pattern
    allocate (doubt(size(problem%pair)))
    if (all(state%ended /= [ended_converged, ended_stalled, ended_solves])) then
      doubt%force_change = ieee_value(sign, ieee_quiet_nan)
      doubt%area_change = doubt%force_change
      doubt%moved_change = doubt%force_change
      return
    end if
    shift = 0
    do k = 1, size(doubt)
      associate (first => qp%pair_first_row(k), last => qp%pair_first_row(k + 1) - 1, pair => problem%pair(k))
        associate (a => problem%body(pair%body_a), b => problem%body(pair%body_b))
          call find_narrow_contact(pair, problem%surface_a(k), a%analysis == analysis_axisymmetric, &
                                   1/(a%contact_compliance() + b%contact_compliance()), state%pressure(first:last), &
                                   qp%gap(first:last), state%penetration(first:last) + qp%gap(first:last), &
                                   shift(first:last), doubt(k)%hertz_peak)
        end associate
        shift(first:last) = max(shift(first:last), pair%row_uncertainty())
        doubt(k)%peak = maxval([0.0_dp, state%pressure(first:last)])
      end associate
    end do
    moved = greatest_displacement(problem, displacements, maxval([0.0_dp, abs(state%penetration + qp%gap)]))
    call estimate_roughly(qp, state, shift, doubt)
    if (moved <= rounding*maxval([0.0_dp, shift, abs(qp%gap)])) then
      ! Nothing acts on bodies that may touch.
      doubt%force_change = 0
      doubt%moved_change = 0
      return
    end if
    ! Forces that rounding, or the weak springs of floating bodies, make of what the gaps would make of bodies at rest
    ! are none.
    least = merge(of_springs*fraction, rounding, qp%coarse%n > 0)*maxval([0.0_dp, doubt%force_change])
    call find_parts(moved, least, doubt)
    if (all(max(doubt%force_part, doubt%moved_part) < negligible)) return
    doubt%force_change = 0
    doubt%moved_change = 0
    if (.not. scheme%is_iteration()) then
      allocate (solver, source=scheme)
    else
      allocate (dual_t :: solver)
    end if
    ! Of heaps, where a solution is what costs, the one in which forces go other ways.
    do pattern = merge(2, 1, is_heap(qp) .and. size(doubt) > 1), merge(2, 1, size(doubt) > 1)
      sign = -1
      do k = 1, size(doubt)
        associate (of_pair => shift(qp%pair_first_row(k):qp%pair_first_row(k + 1) - 1))
          of_pair = sign*abs(of_pair)
          ! Pairs whose gaps are exact are not counted.
          if (pattern == 2 .and. any(abs(of_pair) > 0)) sign = -sign
        end associate
      end do
      call compare(problem, qp, compliance, linear_solver, solver, state, shift, doubt)
    end do
    call find_parts(moved, least, doubt)
  end subroutine find_gap_doubt

  !> Greatest component of all displacements, or else what is given [length].
  real(dp) function greatest_displacement(problem, displacements, given) result(moved)
    type(contact_problem_t), intent(in) :: problem  !! Bodies.
    type(displacements_t), intent(in) :: displacements  !! Their displacements, where they are known.
    real(dp), intent(in) :: given  !! What is known without [length].
    real(dp) :: of_rank(1)
    integer :: b
    of_rank = given
    if (allocated(displacements%body)) then
      do b = 1, size(displacements%body)
        if (problem%ranks%is_own(b) .and. allocated(displacements%body(b)%displacement)) &
          of_rank = max(of_rank, maxval(abs(displacements%body(b)%displacement)))
      end do
    end if
    call greatest(of_rank)
    moved = of_rank(1)
  end function greatest_displacement

  !> Uncertainties as parts of the greatest values.
  pure subroutine find_parts(moved, least, doubt)
    real(dp), intent(in) :: moved  !! Greatest displacement [length].
    real(dp), intent(in) :: least  !! Forces are compared with at least this one [force].
    type(gap_doubt_t), intent(inout) :: doubt(:)  !! (n_pairs)
    doubt%force_part = doubt%force_change/max(tiny(moved), least, maxval(doubt%force))
    doubt%moved_part = doubt%moved_change/max(tiny(moved), moved)
  end subroutine find_parts

  !> Forces of the solution, and their uncertainty where the bodies are a Winkler foundation: rows that are active, or
  !> would be, have the stiffness that schemes begin with.
  subroutine estimate_roughly(qp, state, shift, doubt)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(solver_state_t), intent(in) :: state  !! The solution.
    real(dp), intent(in) :: shift(:)  !! Uncertainty of the gaps (n_rows) [length].
    type(gap_doubt_t), intent(inout) :: doubt(:)  !! (n_pairs)
    real(dp) :: closed(qp%n_rows), force(qp%n_rows)
    integer :: k
    closed = max(0.0_dp, shift + min(0.0_dp, state%penetration))
    force = foundation_stiffness(qp)*closed
    do k = 1, size(doubt)
      associate (first => qp%pair_first_row(k), last => qp%pair_first_row(k + 1) - 1, of => doubt(k))
        associate (w => qp%weight(first:last), m => state%pressure(first:last))
          of%force = sum(w*m)
          of%uncertainty = maxval([0.0_dp, pack(shift(first:last), m > 0)])
          of%force_change = sum(force(first:last))
          of%moved_change = maxval([0.0_dp, closed(first:last)])
        end associate
      end associate
    end do
  end subroutine estimate_roughly

  !> Solve with other gaps, and compare.
  subroutine compare(problem, qp, compliance, linear_solver, solver, state, shift, doubt)
    type(contact_problem_t), intent(in) :: problem  !! As in `find_gap_doubt`.
    type(contact_qp_t), intent(in) :: qp  !! As in `find_gap_doubt`.
    class(compliance_t), intent(inout) :: compliance  !! As in `find_gap_doubt`.
    integer, intent(in) :: linear_solver  !! As in `find_gap_doubt`.
    class(scheme_t), intent(in) :: solver  !! Solves the QP.
    type(solver_state_t), intent(in) :: state  !! The solution.
    real(dp), intent(in) :: shift(:)  !! Added to the gaps (n_rows) [length].
    type(gap_doubt_t), intent(inout) :: doubt(:)  !! Changes become greater (n_pairs).
    type(solver_settings_t) :: settings
    type(contact_qp_t) :: shifted
    type(solver_state_t) :: other
    type(monitor_t) :: silent
    type(error_t), allocatable :: error
    integer :: k
    settings%linear_solver = linear_solver
    settings%tolerance = max(settings%tolerance, state%error_bound)
    settings%max_iterations = max(state%history%n + most_more, enough)
    shifted = qp
    call shifted%shift_gap(shift)
    other = state
    other%penetration = state%penetration - shift
    call solver%solve(shifted, compliance, settings, silent, other, error)
    if (allocated(error)) then
      if (allocated(other%pressure)) deallocate (other%pressure)
    else if (all(other%ended /= [ended_converged, ended_limit, ended_solves, ended_stalled]) .and. &
             allocated(other%pressure)) then
      deallocate (other%pressure)
    else if (allocated(other%excess) .and. allocated(other%pressure)) then
      if (any(other%excess > qp%coarse%max_unbalanced)) deallocate (other%pressure)
    end if
    do k = 1, size(doubt)
      associate (first => qp%pair_first_row(k), last => qp%pair_first_row(k + 1) - 1, of => doubt(k))
        associate (w => qp%weight(first:last), m => state%pressure(first:last), &
                   moved => state%penetration(first:last) + qp%gap(first:last))
          if (.not. allocated(other%pressure)) then
            of%force_change = ieee_value(of%force, ieee_quiet_nan)
            of%area_change = of%force_change
            of%moved_change = of%force_change
          else if (.not. ieee_is_nan(of%force_change)) then
            associate (m_2 => other%pressure(first:last))
              of%force_change = max(of%force_change, abs(sum(w*m_2) - of%force))
              of%area_change = max(of%area_change, abs(contact_area(problem, k, m_2) - contact_area(problem, k, m)))
              of%moved_change = maxval([of%moved_change, &
                                        pack(abs(other%penetration(first:last) + shifted%gap(first:last) - moved), &
                                             m > 0 .or. m_2 > 0)])
              of%uncertainty = maxval([of%uncertainty, pack(abs(shift(first:last)), m_2 > 0)])
            end associate
          end if
        end associate
      end associate
    end do
  end subroutine compare

  !> Contact area of a pair.
  real(dp) function contact_area(problem, k, pressure) result(area)
    type(contact_problem_t), intent(in) :: problem  !! As in `find_gap_doubt`.
    integer, intent(in) :: k  !! The pair.
    real(dp), intent(in) :: pressure(:)  !! Pressures of its rows (n_rows) [pressure].
    type(contact_patch_t), allocatable :: patch(:)
    call find_patches(problem%pair(k), problem%surface_a(k), pressure, pressure > 0, patch)
    area = sum(patch%area)
  end function contact_area
end module dotyk_control_gap_doubt
