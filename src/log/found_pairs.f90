!> What the search for contact pairs found, and which bodies carry nothing.
module dotyk_log_found_pairs
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_base_thresholds, only: same_number
  use dotyk_contact_pair_report, only: group_report_t, unnamed_faces_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: body_t
  implicit none
  private
  public :: show_found, show_idle_bodies, body_names

  integer, parameter :: most_lines = 6, most_names = 8  !! Most lines, and names in a line; more are summed up.

contains

  !> The groups that were searched, pairs that were merged, and faces in no pair.
  subroutine show_found(log, problem)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    integer :: k
    if (.not. allocated(problem%found%group)) return
    associate (found => problem%found)
      do k = 1, size(found%group)
        call show_group(log, found%group(k), problem%n_ties() > 0)
      end do
      if (found%n_empty > 0) &
        call log%line('  found            '//counted(found%n_empty, 'pair')// &
                      ' of these nowhere opposite each other: dropped')
      do k = 1, size(found%merged)
        if (k > most_lines) exit
        call log%line('  same contact     '//quoted(found%merged(k)%name)//' (line '//to_text(found%merged(k)%line)// &
                      ') and '//quoted(found%merged(k)%kept)//' (line '//to_text(found%merged(k)%kept_line)// &
                      '): one contact, named twice; '//quoted(found%merged(k)%kept)//' is used')
      end do
      if (size(found%merged) > most_lines) &
        call log%line('  same contact     '//to_text(size(found%merged) - most_lines)//' more that are named twice')
      do k = 1, min(most_lines, size(found%distant))
        associate (distant => found%distant(k))
          call log%line('  not searched     '//quoted(problem%body(distant%body)%name)//' is in no pair: its '// &
                        'distance from '//quoted(problem%body(distant%other)%name)//' is '// &
                        to_text(distant%distance, 3)//', and the search distance '//to_text(distant%searched, 3)// &
                        ' (search_radius)')
        end associate
      end do
      if (size(found%distant) > most_lines) &
        call log%line('  not searched     '//to_text(size(found%distant) - most_lines)//' more bodies in no pair')
      do k = 1, size(found%unnamed)
        if (k > most_lines) exit
        call show_unnamed(log, problem%body, found%unnamed(k))
      end do
      if (size(found%unnamed) > most_lines) &
        call log%line('  in no pair       near faces of '//to_text(size(found%unnamed) - most_lines)// &
                      ' more pairs of bodies')
      if (size(found%unnamed) > 0) &
        call log%line('                   nothing keeps these faces apart: add a &contact, or &contact auto=.true.')
    end associate
  end subroutine show_found

  !> The pairs of one group.
  subroutine show_group(log, group, has_ties)
    type(log_t), intent(inout) :: log  !! The log.
    type(group_report_t), intent(in) :: group  !! The group.
    logical, intent(in) :: has_ties  !! Whether bodies are tied.
    character(:), allocatable :: text
    integer :: k
    text = '  found            '//counted(group%n_pairs, 'pair')//' of '
    if (group%auto) then
      text = text//'faces'
    else
      text = text//'surfaces'
    end if
    text = text//' that face each other'
    if (group%n_pairs > 0) text = text//' (searched up to a distance of '//to_text(group%distance, 3)//')'
    if (len(group%name) > 0) text = text//', for '//quoted(group%name)
    if (group%n_named > 0) text = text//'; '//counted(group%n_named, 'pair of bodies', 'pairs of bodies')// &
                                  ' named by other groups'
    if (group%n_excluded > 0) text = text//'; '//to_text(group%n_excluded)//' excluded'
    call log%line(text)
    if (group%auto .and. group%n_pairs == 0 .and. group%n_named == 0) then
      if (group%n_excluded > 0) then
        call log%line('    warning: exclude removes all pairs')
      else
        call log%line('    warning: no faces'//trim(merge(' but those of tied bodies', '                         ', &
                                                          has_ties))//' are within the search distance '// &
                      '(search_radius, or 10 % of the smaller body): check the positions of the bodies, or give a '// &
                      'search_radius')
      end if
    end if
    do k = 1, size(group%unused)
      call log%line('    warning: exclude='//quoted(group%unused(k)%s)//' removes nothing: these bodies form no pair')
    end do
  end subroutine show_group

  !> Faces of two bodies in no pair.
  subroutine show_unnamed(log, body, unnamed)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(unnamed_faces_t), intent(in) :: unnamed  !! The faces.
    character(:), allocatable :: text
    integer :: i
    text = '  in no pair       '//quoted(body(unnamed%body_a)%name)//' and '//quoted(body(unnamed%body_b)%name)
    if (unnamed%distance > same_number*body(unnamed%body_a)%mesh%diameter()) then
      text = text//' are '//to_text(unnamed%distance, 3)//' apart'
    else
      ! Overlaps have lines of their own, by the check for penetration.
      text = text//' touch'
    end if
    text = text//' at ('
    do i = 1, body(unnamed%body_a)%dimension
      if (i > 1) text = text//', '
      text = text//to_text(unnamed%position(i), 4)
    end do
    text = text//'), '//counted(unnamed%n_facets, 'facet')
    if (unnamed%in_pair) text = text//' outside of their pairs'
    call log%line(text)
  end subroutine show_unnamed

  !> Bodies without loads on which no contact force acts.
  subroutine show_idle_bodies(log, problem, pressure, first_row)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    logical :: idle(size(problem%body))
    real(dp) :: least
    integer :: k
    !> Pressures of schemes of relaxation decay on rows that open, and do not vanish: below this fraction of the
    !> greatest one they are none [].
    real(dp), parameter :: nothing = 1.0e-9_dp
    if (size(problem%body) < 2 .or. size(pressure) == 0) return
    least = nothing*maxval(abs(pressure))
    do k = 1, size(idle)
      idle(k) = problem%body(k)%is_idle()
    end do
    do k = 1, size(problem%pair)
      if (.not. maxval(abs(pressure(first_row(k):first_row(k + 1) - 1))) > least) cycle
      idle(problem%pair(k)%body_a) = .false.
      idle(problem%pair(k)%body_b) = .false.
    end do
    do k = 1, problem%n_ties()
      idle(problem%tie(k)%component(1)%body_a) = .false.
      idle(problem%tie(k)%component(1)%body_b) = .false.
    end do
    if (any(idle)) call log%line('  carry nothing    '//body_names(problem%body, idle)// &
                                 ': no load or contact force acts on '//trim(merge('them', 'it  ', count(idle) > 1)))
  end subroutine show_idle_bodies

  !> Names of some bodies; many are summed up.
  function body_names(body, chosen) result(text)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    logical, intent(in) :: chosen(:)  !! Those to name (n_bodies).
    character(:), allocatable :: text
    integer :: b, n
    text = ''
    n = 0
    do b = 1, size(body)
      if (.not. chosen(b)) cycle
      n = n + 1
      if (n > most_names) cycle
      if (n > 1) text = text//', '
      text = text//quoted(body(b)%name)
    end do
    if (n > most_names) text = text//' and '//to_text(n - most_names)//' more'
  end function body_names
end module dotyk_log_found_pairs
