!> Lines of the log about gaps that the meshes do not tell exactly.
module dotyk_log_gap_lines
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_gap_doubt, only: gap_doubt_t
  implicit none
  private
  public :: show_gap_doubt

contains

  !> Pairs whose forces, or displacements, hang on what is not known of their gaps, the most uncertain first.
  subroutine show_gap_doubt(log, pair, doubt)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_pair_t), intent(in) :: pair(:)  !! The pairs (n_pairs).
    type(gap_doubt_t), intent(in) :: doubt(:)  !! Of each (n_pairs).
    real(dp), parameter :: considerable = 0.01_dp  !! Part of the greatest value of a scene that gets a line [].
    integer, parameter :: most_lines = 5  !! Lines at most.
    real(dp) :: part(size(doubt))
    logical :: is_shown(size(doubt))
    character(:), allocatable :: line
    integer :: i, k
    if (size(doubt) == 0) return
    if (any(ieee_is_nan(doubt%force_change)) .and. any(doubt%uncertainty > 0)) &
      call log%line('  uncertain        gaps are known to '//to_text(maxval(doubt%uncertainty), 2)// &
                    ' only; what hangs on them could not be found')
    part = max(doubt%force_part, doubt%moved_part)
    is_shown = .false.
    do i = 1, min(most_lines, count(part > considerable))
      k = maxloc(part, dim=1, mask=.not. is_shown)
      is_shown(k) = .true.
      line = ''
      if (doubt(k)%force_part > considerable) &
        line = ' contact force '//to_text(doubt(k)%force, 4)//', uncertain by '//to_text(doubt(k)%force_change, 2)
      if (doubt(k)%moved_part > considerable) line = &
        line//trim(merge(',', ' ', len(line) > 0))//' normal displacements uncertain by '// &
        to_text(doubt(k)%moved_change, 2)
      if (doubt(k)%uncertainty > 0) then
        call log%line('  uncertain        gaps of '//quoted(pair(k)%name)//' are known to '// &
                      to_text(doubt(k)%uncertainty, 2)//' only:'//line)
      else
        call log%line('  uncertain        gaps of other pairs than '//quoted(pair(k)%name)//' are known to '// &
                      to_text(maxval(doubt%uncertainty), 2)//' only: its'//line)
      end if
    end do
    i = count(part > considerable) - most_lines
    if (i > 0) call log%line('                   and '//counted(i, 'other pair'))
    if (any(is_shown)) call log%line('                   refine the surfaces there, or use quadratic elements on '// &
                                     'curved geometry')
  end subroutine show_gap_doubt
end module dotyk_log_gap_lines
