!> The table of contact pairs in the head of the log.
module dotyk_log_pair_table
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: discretization_quadrature
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_problem, only: mesh_compliance
  use dotyk_elasticity_body, only: body_t
  use dotyk_log_found_pairs, only: body_names
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: show_pairs

  integer, parameter :: most_shown = 20  !! Greatest number of contact pairs with a line each; more are summed up.

contains

  !> Lines for each contact pair; many pairs are summed up.
  subroutine show_pairs(log, body, pair, surface_a, surface_b)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(surface_t), intent(in) :: surface_a(:)  !! Slave surfaces (n_pairs).
    type(surface_t), intent(in) :: surface_b(:)  !! Master surfaces (n_pairs).
    real(dp) :: least, most
    logical :: alone(size(body))
    integer :: k
    if (size(pair) == 0) return
    call log%line('')
    call log%line('  contact pair         constraints    area projected   smallest gap    largest gap          theta')
    least = huge(least)
    most = -huge(most)
    do k = 1, size(pair)
      least = min(least, minval(pair(k)%row_gap))
      most = max(most, maxval(pair(k)%row_gap))
      if (size(pair) <= most_shown) call show_pair(log, body, pair(k), surface_a(k), surface_b(k))
      call warn_of_oscillation(log, body, pair(k))
    end do
    if (size(pair) > most_shown) &
      call log%line(pair_line(to_text(size(pair))//' contact pairs', sum(pair%n_rows), -1.0_dp, least, most, &
                              maxval(pair%theta)))
    alone = .true.
    alone(pair%body_a) = .false.
    alone(pair%body_b) = .false.
    if (any(alone)) call log%line('  '//counted(count(alone), 'body', 'bodies')//' without contact: '// &
                                  body_names(body, alone))
  end subroutine show_pairs

  !> The lines of one contact pair.
  subroutine show_pair(log, body, pair, surface_a, surface_b)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair  !! The contact pair.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    real(dp) :: lost
    lost = pair%lost_not_facing + pair%lost_outside + pair%lost_too_far
    call log%line(pair_line(pair%name, pair%n_rows, 1 - lost, minval(pair%row_gap), maxval(pair%row_gap), &
                            pair%theta)//trim(merge(' layer', '      ', pair%is_layer)))
    call log%line('    slave '//body(pair%body_a)%name//':'//surface_a%name//' ('// &
                  counted(surface_a%n_facets, 'facet')//'), master '//body(pair%body_b)%name//':'// &
                  surface_b%name//' ('//counted(surface_b%n_facets, 'facet')//')')
    if (body(pair%body_a)%constraint%rigid%is_set) &
      call log%line('    warning: the slave side is a rigid body: where its mesh is finer than that of '// &
                    quoted(body(pair%body_b)%name)//', pressures are not unique; make it surface_b')
    if (pair%n_unprojected > 0 .or. lost > 0) &
      call log%line('    not projected: '//percent(pair%lost_outside)//' of the slave area beyond the edge of the '// &
                    'master surface, '//percent(pair%lost_not_facing)//' facing away from it, '// &
                    percent(pair%lost_too_far)//' beyond search_radius')
  end subroutine show_pair

  !> A line of the table of contact pairs.
  function pair_line(name, rows, projected, least, most, theta) result(line)
    character(*), intent(in) :: name  !! Name of the pair.
    integer, intent(in) :: rows  !! Number of contact rows.
    !> Fraction of the slave area that has a projection on the master surface; negative: not shown [].
    real(dp), intent(in) :: projected
    real(dp), intent(in) :: least  !! Smallest gap [length].
    real(dp), intent(in) :: most  !! Largest gap [length].
    real(dp), intent(in) :: theta  !! Penalty parameter [length/pressure].
    character(97) :: line
    ! Left-justified: an edit descriptor justifies to the right.
    character(20) :: label
    character(18) :: share
    label = name
    share = ''
    if (projected >= 0) write (share, '(f16.1,a)') 100*projected, ' %'
    write (line, '(2x,a20,i12,a18,es15.3,es15.3,es15.3)') label, rows, share, least, most, theta
  end function pair_line

  !> Text of a fraction in percent.
  function percent(fraction) result(text)
    real(dp), intent(in) :: fraction  !! Fraction [].
    character(:), allocatable :: text
    text = to_text(100*fraction, 2)//' %'
  end function percent

  !> Quadrature points outnumber the unknowns of their surface: with theta far below h/E the constraints at single
  !> points are over-determined, and their pressures oscillate.
  subroutine warn_of_oscillation(log, body, pair)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair  !! The contact pair.
    real(dp) :: compliance
    real(dp), parameter :: far_below = 1.0e-3_dp  !! Fraction of h/E below which theta counts as far smaller.
    if (pair%discretization /= discretization_quadrature) return
    compliance = mesh_compliance(body(pair%body_a), body(pair%body_b), pair)
    if (pair%theta < far_below*compliance) &
      call log%line('    warning: theta is far below h/E = '//to_text(compliance, 2)//': the pressures at single '// &
                    'quadrature points oscillate, only their averages converge; '// &
                    "use discretization='mortar'")
  end subroutine warn_of_oscillation
end module dotyk_log_pair_table
