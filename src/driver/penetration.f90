!> The check of the deformed bodies against each other, in a run.
module dotyk_driver_penetration
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t, most_shown
  use dotyk_base_memory, only: set_stage
  use dotyk_base_options, only: gap_formula
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_met_points, only: is_same, met_point_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_couple_penetration, only: large_displacement
  use dotyk_control_penetration_check, only: body_penetration_t, check_penetration, find_initial_overlap, &
    penetration_check_t
  use dotyk_driver_scene, only: scene_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_check
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_placement, only: mean_rotation
  use dotyk_scheme_solver_state, only: ended_penetration
  implicit none
  private
  public :: check_bodies, check_placement

  integer, parameter :: most_touching = 5  !! Greatest number of couples of bodies that touch, with a line each.

  real(dp), parameter :: large_rotation = 0.05_dp  !! Rotation from which on there is a warning [].
  real(dp), parameter :: large_strain = 0.02_dp  !! Strain from which on there is a line [].

contains

  !> Warn of bodies that overlap before they are loaded.
  subroutine check_placement(scene, monitor)
    type(scene_t), intent(in) :: scene  !! The scene, built.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(body_penetration_t), allocatable :: found(:)
    call set_stage('checking for overlaps')
    call find_initial_overlap(scene%problem, found)
    call show_initial_overlap(monitor%log, scene%problem%body, found)
    call monitor%lap(stage_check)
  end subroutine check_placement

  !> Check the solution. Where bodies penetrate each other it is none.
  subroutine check_bodies(scene, solution, may_add, monitor, met, has_met)
    type(scene_t), intent(in) :: scene  !! The scene, solved.
    type(contact_solution_t), intent(inout) :: solution  !! The solution, with the outcome of the check on return.
    logical, intent(in) :: may_add  !! Whether `met` may grow.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(met_point_t), allocatable, intent(inout) :: met(:)  !! Points where bodies met beside their rows (n).
    logical, intent(out) :: has_met  !! Whether it has grown: the scene is to be solved again.
    integer :: i, k
    has_met = .false.
    call set_stage('checking for penetration')
    if (.not. all_displaced()) return
    call check_penetration(scene%problem, solution%displacements%body, scene%qp%pair_first_row, &
                           solution%state%penetration, solution%gap_doubt%moved_change, &
                           solution%state%error_bound, solution%penetration)
    call monitor%lap(stage_check)
    ! A point that has been added before has its row, or is excluded.
    associate (check => solution%penetration)
      check%met = pack(check%met, [(.not. any([(is_same(check%met(i), met(k)), k=1, size(met))]), &
                                    i=1, size(check%met))])
      has_met = may_add .and. size(check%met) > 0 .and. solution%state%has_converged()
      if (has_met) then
        call show_met_points(monitor%log, scene%problem%body, check)
        met = [met, check%met]
        return
      end if
    end associate
    call show_large_motion(monitor%log, scene%problem, solution%displacements%body)
    call show_penetration(monitor%log, scene%problem%body, solution%penetration)
    call note_formulas(monitor%log, scene%problem%pair)
    if (size(solution%penetration%found) > 0 .and. solution%state%has_converged()) &
      solution%state%ended = ended_penetration

  contains

    !> Whether the displacements of all bodies are known.
    logical function all_displaced()
      integer :: b
      all_displaced = .false.
      if (.not. allocated(solution%displacements%body)) return
      all_displaced = all([(allocated(solution%displacements%body(b)%displacement), &
                            b=1, size(solution%displacements%body))])
    end function all_displaced
  end subroutine check_bodies

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

  !> Warn of the body that moves farthest by its size, of the one that rotates most, and of the one with the largest
  !> strain.
  subroutine show_large_motion(log, problem, solution)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    real(dp), dimension(size(solution)) :: ratio, angle, stretch
    integer :: b
    ratio = 0
    angle = 0
    stretch = 0
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (x => problem%body(b)%mesh%x, u => solution(b)%displacement)
        ratio(b) = maxval(norm2(u, dim=1))/norm2(maxval(x, 2) - minval(x, 2))
        ! Of a part of a body the rotation of the part: parts of a body turn with it.
        angle(b) = norm2(mean_rotation(x, u))
        stretch(b) = largest_stretch(problem%body(b)%mesh, u)
      end associate
    end do
    call problem%ranks%share_greatest(ratio)
    call problem%ranks%share_greatest(angle)
    call problem%ranks%share_greatest(stretch)
    b = maxloc(ratio, dim=1)
    if (ratio(b) > large_displacement) &
      call log%line('  large motion     '//quoted(problem%body(b)%name)//' moves by '//to_text(ratio(b), 3)// &
                    ' times its size'//others(count(ratio > large_displacement) - 1)// &
                    '; contact was searched where the bodies are placed')
    b = maxloc(angle, dim=1)
    if (angle(b) > large_rotation) &
      call log%line('  large motion     '//quoted(problem%body(b)%name)//' rotates by '//to_text(angle(b), 3)// &
                    ' rad'//others(count(angle > large_rotation) - 1)// &
                    '; small-displacement theory stretches it by '// &
                    to_text(100*angle(b)**2/2, 2)//' %')
    b = maxloc(stretch, dim=1)
    if (stretch(b) > large_strain) &
      call log%line('  large strain     '//quoted(problem%body(b)%name)//': an element is stretched or '// &
                    'shortened by '//to_text(100*stretch(b), 2)//' %'//others(count(stretch > large_strain) - 1)// &
                    '; check loads, positions and units, or a singular corner: the theory is linear')
  end subroutine show_large_motion

  !> Largest relative change of the distance of two corners of an element [].
  pure real(dp) function largest_stretch(mesh, u) result(stretch)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    real(dp), intent(in) :: u(:, :)  !! Displacements of its nodes (dimension, n_nodes) [length].
    type(element_kind_t) :: kind
    real(dp) :: along(size(u, 1))
    integer :: k, e, i, j
    stretch = 0
    do k = 1, size(mesh%block)
      kind = element_kind(mesh%block(k)%kind)
      do e = 1, size(mesh%block(k)%node, 2)
        associate (node => mesh%block(k)%node(:, e))
          do i = 2, kind%n_corners
            do j = 1, i - 1
              along = mesh%x(:, node(i)) - mesh%x(:, node(j))
              stretch = max(stretch, abs(dot_product(along, u(:, node(i)) - u(:, node(j))))/ &
                            max(tiny(stretch), dot_product(along, along)))
            end do
          end do
        end associate
      end do
    end do
  end function largest_stretch

  !> How many bodies more do so; empty for none.
  function others(n) result(text)
    integer, intent(in) :: n  !! Number of bodies.
    character(:), allocatable :: text
    text = ''
    if (n > 0) text = ' ('//counted(n, 'body', 'bodies')//' more, less)'
  end function others
end module dotyk_driver_penetration
