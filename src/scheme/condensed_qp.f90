!> The programme of the groups of tied bodies: its rows are the contact rows, its bodies the groups
!> (`dotyk_scheme_condensation`).
module dotyk_scheme_condensed_qp
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_condensation, only: slide_t, tied_group_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_restriction, only: aggregate_compliance, aggregate_qp
  use dotyk_scheme_tied_bodies, only: find_groups
  implicit none
  private

  !> What joins bodies and rows.
  type, public :: ties_t
    !> Rows from this one on are ties.
    integer :: first_tie = 1
    !> Bolts of given tension (n_slides).
    type(slide_t), allocatable :: slide(:)
    !> First row of each tie, and its name (n_ties).
    integer, allocatable :: first_row(:)
    type(text_t), allocatable :: name(:)
    !> Row of the programme that each contact row belongs to: those of the two sides of a tie whose vertices meet are
    !> one (first_tie - 1).
    integer, allocatable :: joined_row(:)
  end type ties_t

  !> The programme.
  type, public :: condensed_qp_t
    !> Group of each body (n_bodies).
    integer, allocatable :: group_of(:)
    !> (n_groups).
    type(tied_group_t), allocatable :: group(:)
    !> Its rows are the joined contact rows, its bodies the groups.
    type(contact_qp_t) :: qp
    !> Their compliance.
    type(dense_compliance_t) :: compliance
    !> Fraction of each contact row in the weight of its joined row (first_tie - 1) [].
    real(dp), allocatable :: fraction(:)
  end type condensed_qp_t

  public :: condense

  !> Ties that stay open by more than this fraction of what they or their forces would open contradict each other or
  !> supports.
  real(dp), parameter :: most_open = 1.0e-6_dp
  !> Rounding of the displacements of a group that moves, over `most_open` [].
  real(dp), parameter :: rounding_of_motion = 1.0e3_dp*epsilon(1.0_dp)/most_open
  !> Penetrations of rows that ties hold, below this fraction of the largest one without ties, are rounding [].
  real(dp), parameter :: rounding_of_closing = 1.0e-9_dp
  !> So are those below this fraction of the terms that they are the sum of: slender bodies move far by the forces of
  !> ties, and back by those of others [].
  real(dp), parameter :: rounding_of_terms = 1.0e-12_dp
  !> Resultants on several bodies below this fraction of those of each are rounding.
  real(dp), parameter :: rounding_of_sums = 1.0e-12_dp
  !> Means of rows below this fraction of these are rounding [].
  real(dp), parameter :: rounding_of_means = 1.0e-13_dp

contains

  !> The programme of the groups.
  subroutine condense(ties, qp, compliance, condensed, error)
    !> The ties.
    type(ties_t), intent(in) :: ties
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> Formed at all rows.
    class(compliance_t), intent(inout) :: compliance
    !> The programme.
    type(condensed_qp_t), intent(out) :: condensed
    !> Allocated where ties contradict each other or supports.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: lambda(:), alpha(:), of_loads(:), alpha_of_loads(:), y(:), z(:), load_work(:)
    real(dp), allocatable :: entries(:, :), terms(:)
    logical, allocatable :: is_held(:)
    integer, allocatable :: held(:)
    real(dp) :: work
    integer :: n_groups, g, i
    work = 0
    call find_groups(qp, ties%first_tie, condensed%group_of, n_groups)
    allocate (condensed%group(n_groups))
    allocate (lambda(qp%n_rows), of_loads(qp%n_rows), alpha(qp%coarse%n), alpha_of_loads(qp%coarse%n), &
              source=0.0_dp)
    do g = 1, n_groups
      associate (group => condensed%group(g))
        call group%take_rows(qp, ties%first_tie, condensed%group_of, g, ties%slide)
        call group%form(qp, compliance, error)
        if (allocated(error)) return
        call tie_without_contact(ties, group, qp, lambda, alpha, of_loads, alpha_of_loads, work, error)
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
    associate (small => condensed%qp, n => ties%first_tie - 1)
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
      call take_modes(qp, lambda, alpha, of_loads, alpha_of_loads, condensed)
      call condensed%compliance%init(small)
      do g = 1, n_groups
        call condensed%group(g)%condense(entries, is_held)
        call condensed%compliance%set(small, g, entries)
        if (.not. any(is_held)) cycle
        ! There, rounding of what the ties close is no penetration.
        held = pack(condensed%group(g)%contact, is_held)
        associate (own => condensed%group(g))
          terms = pack(abs(qp%initial_penetration(own%contact)) + matmul(abs(lambda(own%tie)), abs(own%c_tc)) + &
                       matmul(abs(own%g_c(:, :size(own%mode))), abs(alpha(own%mode))), is_held)
        end associate
        terms = max(rounding_of_terms*terms, rounding_of_closing*maxval(abs(qp%initial_penetration)))
        where (abs(small%initial_penetration(held)) <= terms) small%initial_penetration(held) = 0
        small%load_displacement(held) = 0
        do i = 1, size(is_held)
          if (is_held(i)) small%coarse%block(g)%value(i, :) = 0
        end do
      end do
    end associate
    call join_contact_rows(ties%joined_row, condensed)
  end subroutine condense

  !> Join contact rows: what meets in a vertex on the tied surfaces is one row, whose pressure would be divided between
  !> two at will.
  subroutine join_contact_rows(joined_row, condensed)
    !> Joined row of each contact row (number of these).
    integer, intent(in) :: joined_row(:)
    !> The programme; of the joined rows on return.
    type(condensed_qp_t), intent(inout) :: condensed
    type(contact_qp_t) :: joined
    type(dense_compliance_t) :: compliance
    integer :: n, g, k
    n = maxval([0, joined_row])
    if (n == size(joined_row)) then
      allocate (condensed%fraction(n), source=1.0_dp)
      return
    end if
    call aggregate_qp(condensed%qp, joined_row, n, joined, condensed%fraction)
    call aggregate_compliance(condensed%qp, condensed%compliance, joined_row, condensed%fraction, joined, compliance)
    ! Motions that move the rows of both sides in opposite directions, as a rotation moves the two rows of one vertex of
    ! a polygon, leave rounding in their mean.
    do g = 1, size(condensed%group)
      associate (mean => joined%coarse%block(g)%value, each => condensed%qp%coarse%block(g)%value)
        do k = 1, size(mean, 2)
          where (abs(mean(:, k)) < rounding_of_means*maxval(abs(each(:, k)))) mean(:, k) = 0
        end do
      end associate
    end do
    condensed%qp = joined
    condensed%compliance = compliance
  end subroutine join_contact_rows

  !> Forces of the ties of a group, and amplitudes of its modes, without contact.
  subroutine tie_without_contact(ties, group, qp, lambda, alpha, of_loads, alpha_of_loads, work, error)
    !> The ties.
    type(ties_t), intent(in) :: ties
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
      call set_error(error, 'tie '//quoted(ties%name(count(ties%first_row <= group%tie(worst)))%s)//' cannot be '// &
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

  !> The motions of the groups, those of single bodies its modes, with their stiffness.
  subroutine take_modes(qp, lambda, alpha, of_loads, alpha_of_loads, condensed)
    !> Contact rows, ties after them.
    type(contact_qp_t), intent(in) :: qp
    !> Forces of the ties in the solution without contact, and its amplitudes (n_rows) [force], (coarse%n) [length].
    real(dp), intent(in) :: lambda(:), alpha(:)
    !> The same by loads alone (n_rows) [force], (coarse%n) [length].
    real(dp), intent(in) :: of_loads(:), alpha_of_loads(:)
    !> With groups and rows; gets the coarse space.
    type(condensed_qp_t), intent(inout) :: condensed
    real(dp), allocatable :: rows(:, :)
    integer :: g
    associate (coarse => condensed%qp%coarse, group => condensed%group)
      call coarse%take_rows(condensed%qp%block, condensed%qp%n_rows)
      coarse%max_unbalanced = qp%coarse%max_unbalanced
      allocate (coarse%first(size(group) + 1), coarse%block(size(group)))
      coarse%first(1) = 1
      do g = 1, size(group)
        coarse%first(g + 1) = coarse%first(g) + size(group(g)%free, 2)
        coarse%block(g)%value = group(g)%rows
      end do
      coarse%n = coarse%first(size(group) + 1) - 1
      allocate (coarse%scale(coarse%n), source=1.0_dp)
      allocate (coarse%mean_square(coarse%n))
      if (allocated(qp%coarse%deviation)) allocate (coarse%deviation(size(group)))
      do g = 1, size(group)
        associate (own => group(g), motion => group(g)%free(:size(group(g)%mode), :))
          coarse%mean_square(coarse%first(g):coarse%first(g + 1) - 1) = &
            matmul(qp%coarse%mean_square(own%mode), motion**2)
          if (.not. allocated(coarse%deviation)) cycle
          allocate (rows(size(own%contact), qp%coarse%n))
          call qp%coarse%rows(own%contact, rows, uncertain=.true.)
          coarse%deviation(g)%value = matmul(rows(:, own%mode), motion)
          deallocate (rows)
        end associate
      end do
      coarse%resultant = of_groups(qp%coarse%resultant, lambda, alpha)
      if (.not. allocated(qp%coarse%stiffness)) return
      ! Ties that prescribed displacements or gaps open do work on soft motions, too, which is none of the loads.
      coarse%lift = coarse%resultant - of_groups(qp%coarse%resultant - qp%coarse%lift, of_loads, alpha_of_loads)
      coarse%resultant_size = sizes_of_groups()
      allocate (coarse%stiffness(size(group)))
      do g = 1, size(group)
        coarse%stiffness(g)%value = group(g)%stiffness
      end do
    end associate

  contains

    !> Forces on the motions of the groups.
    function of_groups(force, tie_force, amplitude) result(on_groups)
      !> On the modes of the bodies (coarse%n) [force].
      real(dp), intent(in) :: force(:)
      !> Of the ties (n_rows) [force].
      real(dp), intent(in) :: tie_force(:)
      !> Of the modes of the bodies (coarse%n) [length].
      real(dp), intent(in) :: amplitude(:)
      real(dp) :: on_groups(condensed%qp%coarse%n)
      real(dp), allocatable :: own_force(:)
      integer :: k
      do k = 1, size(condensed%group)
        associate (own => condensed%group(k), sums => on_groups(condensed%qp%coarse%first(k): &
                                                                condensed%qp%coarse%first(k + 1) - 1))
          own_force = own%resultants(force)
          sums = own%motion_resultants(own_force, tie_force(own%tie), amplitude(own%mode))
          if (size(own%tie) == 0) cycle
          ! Forces on tied bodies cancel but for rounding.
          where (abs(sums) < rounding_of_sums*max(matmul(abs(own_force), abs(own%free)), &
                                                  maxval(abs(own_force))*maxval(abs(own%free), 1))) sums = 0
        end associate
      end do
    end function of_groups

    !> Sum of the absolute values that these are made up of.
    function sizes_of_groups() result(on_groups)
      real(dp) :: on_groups(condensed%qp%coarse%n)
      integer :: k
      do k = 1, size(condensed%group)
        associate (own => condensed%group(k), sums => on_groups(condensed%qp%coarse%first(k): &
                                                                condensed%qp%coarse%first(k + 1) - 1))
          sums = matmul(own%resultants(qp%coarse%resultant_size), abs(own%free))
          associate (soft => own%free(:, own%n_free + 1:))
            sums(own%n_free + 1:) = sums(own%n_free + 1:) + &
                                    matmul(abs(lambda(own%tie)), matmul(abs(own%g_t), abs(soft)))
          end associate
        end associate
      end do
    end function sizes_of_groups
  end subroutine take_modes
end module dotyk_scheme_condensed_qp
