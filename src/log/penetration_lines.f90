!> Bodies that penetrate each other, in the log.
module dotyk_log_penetration_lines
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: gap_formula
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_penetration_check, only: body_penetration_t, penetration_check_t
  use dotyk_elasticity_body, only: body_t
  implicit none
  private
  public :: note_formulas, show_initial_overlap, show_met_points, show_penetration

  !> Greatest number of couples of bodies with a line each; more are summed up.
  integer, parameter :: most_shown = 20, most_touching = 5

contains

  !> One line for each couple of bodies, the deepest first.
  subroutine show_penetration(log, body, check)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(penetration_check_t), intent(in) :: check  !! Outcome of the check.
    integer :: k
    do k = 1, min(most_shown, size(check%found))
      call log%line('  penetration      '//line_of(body, check%found(k)))
    end do
    if (size(check%found) > most_shown) &
      call log%line('  penetration      '//counted(size(check%found) - most_shown, 'more couple')//' of bodies')
    do k = 1, min(most_touching, size(check%between_rows))
      associate (found => check%between_rows(k))
        call log%line('  warning          '//quoted(body(found%body)%name)//' is inside '// &
                      quoted(body(found%other)%name)//' by '//to_text(found%worst%between_rows, 4)//' at '// &
                      place_of(found%worst%between_at)//', between contact rows: facets bend there; refine them')
      end associate
    end do
    if (size(check%between_rows) > most_touching) &
      call log%line('  warning          '//counted(size(check%between_rows) - most_touching, 'more couple')// &
                    ' of bodies in each other between contact rows')
    do k = 1, min(most_touching, size(check%touching))
      associate (found => check%touching(k))
        call log%line('  no pair          '//quoted(body(found%body)%name)//' and '// &
                      quoted(body(found%other)%name)//' touch at '//place_of(found%touch%position)//' ('// &
                      counted(found%touch%n_facets, 'facet')//'), and no &contact names them')
        if (found%touch%depth > 0) &
          call log%line('  warning          '//quoted(body(found%body)%name)//' is inside '// &
                        quoted(body(found%other)%name)//' by '//to_text(found%touch%depth, 4)// &
                        ', no deeper than facets are known there')
      end associate
    end do
    if (size(check%touching) > most_touching) &
      call log%line('  no pair          '//counted(size(check%touching) - most_touching, 'more couple')//' of bodies')
  end subroutine show_penetration

  !> Bodies that meet beside their contact rows, before the scene is solved again with rows there.
  subroutine show_met_points(log, body, check)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(penetration_check_t), intent(in) :: check  !! Outcome of the check.
    integer :: k
    do k = 1, min(most_shown, size(check%found))
      call log%line('  corners          '//line_of(body, check%found(k))//', where there is no contact row')
    end do
    if (size(check%found) > most_shown) &
      call log%line('  corners          '//counted(size(check%found) - most_shown, 'more couple')//' of bodies')
    call log%line('  corners          '//counted(size(check%met), 'contact row')//' added there; solving again')
  end subroutine show_met_points

  !> Bodies that overlap before they are loaded, the deepest first.
  subroutine show_initial_overlap(log, body, found)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_penetration_t), intent(in) :: found(:)  !! Couples of bodies (n_found).
    integer :: k
    do k = 1, min(most_touching, size(found))
      call log%line('  overlap          '//line_of(body, found(k))//' before loading')
    end do
    if (size(found) > most_touching) &
      call log%line('  overlap          '//counted(size(found) - most_touching, 'more couple')//' of bodies')
    if (size(found) > 0) &
      call log%line('    warning: no contact pair explains these overlaps; check the positions of the bodies')
  end subroutine show_initial_overlap

  !> Say that pairs with a gap formula are checked on their surfaces only.
  subroutine note_formulas(log, pair)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer :: n, first
    n = count(pair%gap_kind == gap_formula)
    if (n == 0) return
    first = findloc(pair%gap_kind, gap_formula, 1)
    if (n == 1) then
      call log%line('  not checked      beside the surfaces of '//quoted(pair(first)%name)//': its gap_formula is '// &
                    'not in the meshes')
    else
      call log%line('  not checked      beside the surfaces of '//quoted(pair(first)%name)//' and '//to_text(n - 1)// &
                    ' more pairs with a gap_formula, which is not in the meshes')
    end if
  end subroutine note_formulas

  !> A position in brackets.
  function place_of(x) result(text)
    real(dp), intent(in) :: x(3)  !! Position (3) [length].
    character(:), allocatable :: text
    text = '('//to_text(x(1), 4)//', '//to_text(x(2), 4)//', '//to_text(x(3), 4)//')'
  end function place_of

  !> Who, where and how deep.
  function line_of(body, found) result(text)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_penetration_t), intent(in) :: found  !! One body inside another.
    character(:), allocatable :: text
    associate (worst => found%worst)
      text = quoted(body(found%body)%name)//' '// &
             trim(merge('has passed through', 'is inside         ', worst%n_passed > 0))//' '// &
             quoted(body(found%other)%name)//' by '// &
             to_text(worst%depth, 4)//' at '//place_of(worst%position)
      if (worst%n_nodes > 0) text = text//', '//counted(worst%n_nodes, 'node')
      if (worst%n_passed > 0) text = text//', '//counted(worst%n_passed, 'node')//' passed'
      if (worst%n_edges > 0) text = text//', '//counted(worst%n_edges, 'edge')
    end associate
  end function line_of
end module dotyk_log_penetration_lines
