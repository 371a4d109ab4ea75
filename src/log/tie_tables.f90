!> Ties in the log: what is tied, and what it transmits.
module dotyk_log_tie_tables
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t, most_shown
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_balance, only: tie_force_t
  use dotyk_control_contact_problem, only: tied_surfaces_t
  use dotyk_control_seams, only: count_split_rows, pair_of_other_roles
  use dotyk_elasticity_body, only: body_t
  use dotyk_log_case_tables, only: vector_text
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: show_ties, show_tie_forces

  integer, parameter :: few = 4  !! The same of ties whose area is tied wholly.
  real(dp), parameter :: nearly_all = 0.999_dp  !! Slave surfaces less of which is tied get a word [].
  !> Sectors whose cuts are farther apart than this fraction of their angle are not cut alike [].
  real(dp), parameter :: most_turned = 0.02_dp
  integer, parameter :: most_compared = 1000  !! Nodes of a cut compared with those of another, about, at most.
  !> Cuts whose normal is farther off the shank get a word: at this angle it carries 0.4 % more [degrees].
  real(dp), parameter :: most_oblique = 5

contains

  !> What is tied.
  subroutine show_ties(log, body, tie, pair)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    character(20) :: label
    integer, allocatable :: n_split(:, :)
    integer :: k, p, q, n
    if (size(tie) == 0) return
    call log%line('')
    call log%line('  tie                  area tied   surfaces')
    n = 0
    do k = 1, size(tie)
      if (n >= merge(most_shown, few, log%verbose .or. tie(k)%tied < nearly_all)) cycle
      n = n + 1
      associate (rows => tie(k)%component(1))
        label = tie(k)%name
        call log%line('  '//label//' '//adjustr(padded(to_text(100*tie(k)%tied, 4)//' %'))//'   '// &
                      side(body(rows%body_a)%name, tie(k)%surface_a)//' to '// &
                      side(body(rows%body_b)%name, tie(k)%surface_b)//', '//to_text(tie(k)%distance, 3)// &
                      ' apart at most')
      end associate
      if (tie(k)%tied < nearly_all) &
        call log%line('    the rest of the slave area projects beside the master surface, or is farther away than '// &
                      'search_radius')
    end do
    if (size(tie) > n) call log%line('  ... '//counted(size(tie) - n, 'more tie')//', at least '// &
                                     to_text(100*minval(tie%tied), 4)//' % of their area tied')
    do k = 1, size(tie)
      if (tie(k)%oblique > most_oblique) &
        call log%line('  warning: the cut of bolt '//quoted(tie(k)%name)//' has its normal '// &
                      to_text(tie(k)%oblique, 2)//' degrees off the shank: force, tension and shortening are along '// &
                      'the normal, and the shank carries more; give the direction of the shank as normal')
    end do
    do k = 1, size(tie)
      do q = 1, k - 1
        p = contact_of_other_sectors(pair, tie(k), tie(q))
        if (p > 0) &
          call log%line('  warning: '//quoted(pair(p)%name)//' joins sectors that are cut '// &
                        to_text(turn_between(tie(k), tie(q)), 2)//' degrees apart: contact with the next sector is '// &
                        'not seen; cut '//quoted(body(pair(p)%body_a)%name)//' and '// &
                        quoted(body(pair(p)%body_b)%name)//' in the same planes')
      end do
    end do
    do p = 1, size(pair)
      if (allocated(pair(p)%other_roles)) &
        call log%line('  '//quoted(pair(p)%name)//': surface_a and surface_b are exchanged, as contact goes on '// &
                      'across the tie '//quoted(pair(p)%other_roles)//', where the other side is surface_a')
    end do
    call count_split_rows(body, pair, tie, n_split)
    do k = 1, size(tie)
      do p = 1, size(pair)
        q = pair_of_other_roles(pair, tie(k), p)
        if (q > 0) &
          call log%line('  warning: '//quoted(pair(p)%name)//' goes on across the tie '//quoted(tie(k)%name)// &
                        ' as '//quoted(pair(q)%name)//', with the slave on the other side: the split of the '// &
                        'pressure there between both is arbitrary; make '//quoted(body(pair(p)%body_b)%name)// &
                        ' surface_a, or surface_b, of both')
        if (n_split(p, k) == 0) cycle
        call log%line('  warning: '//quoted(pair(p)%name)//' goes on across the tie '//quoted(tie(k)%name)// &
                      ', where '//counted(n_split(p, k), 'vertex', 'vertices')//' of the slave surface '// &
                      'lie between no two of the master surface: the split of the pressure there between both '// &
                      'sides is arbitrary; forces, and pressures a few elements away, are right')
      end do
    end do
  end subroutine show_ties

  !> Contact pair between two bodies that are sectors, cut at other angles; 0 where there is none.
  pure integer function contact_of_other_sectors(pair, tie, other) result(p)
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(tied_surfaces_t), intent(in) :: tie  !! A tie.
    type(tied_surfaces_t), intent(in) :: other  !! Another one.
    p = 0
    if (.not. (abs(tie%angle) > 0 .and. abs(other%angle) > 0)) return
    associate (a => tie%component(1)%body_a, b => other%component(1)%body_a)
      do p = size(pair), 1, -1
        if (pair(p)%body_a == a .and. pair(p)%body_b == b .or. pair(p)%body_a == b .and. pair(p)%body_b == a) exit
      end do
    end associate
    if (p == 0) return
    if (turn_between(tie, other) <= most_turned*abs(tie%angle)) p = 0
  end function contact_of_other_sectors

  !> Angle between the cuts of two sectors, of the nearest copies, where they come nearest to each other in radius and
  !> height: curved cuts have other angles elsewhere [degrees].
  pure real(dp) function turn_between(tie, other) result(turn)
    type(tied_surfaces_t), intent(in) :: tie  !! A tie with a rotation.
    type(tied_surfaces_t), intent(in) :: other  !! Another one.
    real(dp) :: apart, near
    integer :: i, j, step_i, step_j
    near = huge(near)
    step_i = 1 + size(tie%around_axis, 2)/most_compared
    step_j = 1 + size(other%around_axis, 2)/most_compared
    do i = 1, size(tie%around_axis, 2), step_i
      do j = 1, size(other%around_axis, 2), step_j
        near = min(near, norm2(tie%around_axis(:2, i) - other%around_axis(:2, j)))
      end do
    end do
    ! Where nodes do not fit, the cut goes on for a facet.
    near = near + max(tie%facet_size, other%facet_size)
    turn = abs(tie%angle)
    do i = 1, size(tie%around_axis, 2), step_i
      do j = 1, size(other%around_axis, 2), step_j
        if (norm2(tie%around_axis(:2, i) - other%around_axis(:2, j)) > near) cycle
        apart = modulo(tie%around_axis(3, i) - other%around_axis(3, j), abs(tie%angle))
        turn = min(turn, apart, abs(tie%angle) - apart)
      end do
    end do
  end function turn_between

  !> A side of a tie.
  function side(body, surface)
    character(*), intent(in) :: body  !! Name of the body.
    type(surface_t), intent(in) :: surface  !! Its surface.
    character(:), allocatable :: side
    side = body//':'//surface%name//' ('//counted(surface%n_facets, 'facet')//')'
  end function side

  !> A short text in a column.
  pure function padded(text)
    character(*), intent(in) :: text  !! The text.
    character(9) :: padded
    padded = text
  end function padded

  !> What ties transmit.
  subroutine show_tie_forces(log, tie, force)
    type(log_t), intent(inout) :: log  !! The log.
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    type(tie_force_t), intent(in) :: force(:)  !! What they transmit (n_ties).
    integer :: k
    character(:), allocatable :: more
    do k = 1, min(size(tie), most_shown)
      associate (all => force(k)%resultant)
        more = ''
        if (log%verbose .and. any(abs(all%moment) > 0)) more = ', moment '//vector_text(all%moment)//' about the origin'
        if (abs(all%radial) > 0) more = more//', radial '//to_text(all%radial, 5)//' around the circumference'
        if (tie(k)%is_bolt) more = more//', tension '//to_text(force(k)%tension, 5)
        if (tie(k)%is_free) then
          more = more//'; nothing determines its shortening: one half is free along the normal'
        else if (tie(k)%is_bolt) then
          more = more//', shortened by '//to_text(force(k)%shortening, 5)
        end if
        call log%line('  '//tie(k)%name//': tie force '//vector_text(all%force)//' on the slave body'//more)
      end associate
    end do
    if (size(tie) > most_shown) call log%line('  ... '//counted(size(tie) - most_shown, 'more tie'))
  end subroutine show_tie_forces
end module dotyk_log_tie_tables
