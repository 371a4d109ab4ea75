!> What ties transmit: force and moment on the slave body; tension and shortening of bolts.
module dotyk_control_tie_forces
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_thresholds, only: half_digits
  use dotyk_contact_pair, only: pair_resultant, pair_resultant_t
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private

  type, public :: tie_force_t  !! Forces of one tie.
    type(pair_resultant_t) :: resultant  !! Force, moment about the origin, and radial force on the slave body.
    real(dp) :: tension = 0  !! Of a bolt: force on the slave body along the normal of the cut, out of it [force].
    real(dp) :: shortening = 0  !! Of a bolt: how far its halves overlap; NaN where nothing determines it [length].
  end type tie_force_t

  public :: find_tie_forces, keep_shortenings

contains

  !> Forces of all ties.
  function find_tie_forces(problem, pressure, penetration) result(of_tie)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, pairs and ties, with the shortenings of the solution.
    !> Pressures of the contact rows and tractions of the ties after them (n_rows) [pressure].
    real(dp), intent(in) :: pressure(:)
    real(dp), intent(in) :: penetration(:)  !! B u - d of the same rows (n_rows) [length].
    type(tie_force_t), allocatable :: of_tie(:)  !! (n_ties).
    type(pair_resultant_t) :: part
    integer :: c, k, n
    allocate (of_tie(problem%n_ties()))
    n = sum(problem%pair%n_rows)
    do k = 1, size(of_tie)
      associate (tie => problem%tie(k), all => of_tie(k)%resultant)
        do c = 1, size(tie%component)
          associate (rows => tie%component(c), last => n + tie%component(c)%n_rows)
            part = pair_resultant(rows, problem%body(rows%body_a)%analysis == analysis_axisymmetric, &
                                  pressure(n + 1:last))
            all%force = all%force + part%force
            all%moment = all%moment + part%moment
            all%radial = all%radial + part%radial
            of_tie(k)%shortening = of_tie(k)%shortening + &
              tie%normal(c)*sum(rows%row_weight*(penetration(n + 1:last) + rows%row_gap))/sum(rows%row_weight)
            n = last
          end associate
        end do
        if (tie%slides) of_tie(k)%shortening = tie%shortening
        if (tie%is_free) of_tie(k)%shortening = ieee_value(tie%shortening, ieee_quiet_nan)
        of_tie(k)%tension = dot_product(all%force, tie%normal)
      end associate
    end do
  end function find_tie_forces

  !> Keep how far bolts that slide are shortened, for the load cases in which they are locked.
  subroutine keep_shortenings(state, problem)
    type(solver_state_t), intent(in) :: state  !! With amplitudes of all modes.
    type(contact_problem_t), intent(inout) :: problem  !! Its bolts that slide get their shortenings.
    real(dp) :: motion(size(state%alpha))
    integer :: i, k, j, first(size(problem%body) + 1), n_before(size(problem%body))
    if (problem%n_ties() == 0) return
    first = first_mode(problem%modes, problem%tie)
    n_before = problem%modes%n
    do k = 1, size(problem%tie)
      associate (tie => problem%tie(k), b => problem%tie(k)%component(1)%body_a)
        tie%is_free = .false.
        if (.not. tie%slides) cycle
        i = first(b) + n_before(b)
        n_before(b) = n_before(b) + 1
        tie%shortening = state%alpha(i)
        do j = 1, state%indeterminate%n
          call state%indeterminate%get(j, motion)
          if (abs(motion(i)) > half_digits*maxval(abs(motion))) tie%is_free = .true.
        end do
      end associate
    end do
  end subroutine keep_shortenings
end module dotyk_control_tie_forces
