!> The choice whether ranks compute the bodies of a scene together.
module dotyk_driver_split_choice
  use dotyk_base_error, only: error_t
  use dotyk_base_options, only: last_linear_quantity
  use dotyk_base_text, only: quoted, to_text
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_response_choice, only: choose_forms, form_direct, form_multigrid, form_split, &
    suits_multigrid
  use dotyk_driver_run_settings, only: may_use_multigrid
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_free_modes, only: free_rigid_modes
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_split_split_scene, only: can_split
  implicit none
  private
  public :: choose_solution

  !> Floating bodies at most that are split: the coarse level does not know the motions of each, and needs hundreds of
  !> iterations for networks of more.
  integer, parameter :: most_floating = 15

contains

  !> How the bodies are solved, and whether ranks compute them together.
  subroutine choose_solution(case, body, classes, may_split, monitor, form, splits)
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), intent(in) :: body(:)  !! Bodies with supports (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes.
    logical, intent(in) :: may_split  !! Whether several ranks may compute a body together.
    !> Gets a line where they do not, although p-multigrid would be taken.
    type(log_monitor_t), intent(inout) :: monitor
    integer, allocatable, intent(out) :: form(:)  !! One of `form_*` (n_bodies).
    logical, intent(out) :: splits  !! Whether the bodies are split over all ranks.
    form = choose_forms(body, classes, case%solver%response, may_use_multigrid(case), &
                        can_split() .or. any(case%quantity%kind <= last_linear_quantity))
    splits = can_split() .and. any(form == form_multigrid)
    ! Bodies that are split know no ties.
    if (splits .and. .not. (may_split .and. size(case%tie) == 0)) form(:) = form_direct
    ! A scene that is built anew has told already why.
    if (splits .and. case%n_cases() > 1) call note_factors('there are load cases', monitor)
    splits = splits .and. may_split .and. size(case%tie) == 0
    if (splits) call choose_split(body, monitor, form, splits)
  end subroutine choose_solution

  !> Split the bodies over all ranks, or leave each to one rank with its factor: not where the iterations would be too
  !> many, for nearly incompressible bodies and networks of many floating ones.
  subroutine choose_split(body, monitor, form, splits)
    type(body_t), intent(in) :: body(:)  !! Bodies with supports (n_bodies).
    type(log_monitor_t), intent(inout) :: monitor  !! Gets a line where they are not split.
    integer, intent(inout) :: form(:)  !! How the bodies are solved (n_bodies).
    logical, intent(out) :: splits  !! Whether they are split.
    character(:), allocatable :: reason, motions
    integer :: b, n_free, n_floating
    reason = ''
    n_floating = 0
    do b = 1, size(body)
      call free_rigid_modes(body(b), n_free, motions)
      if (n_free > 0) n_floating = n_floating + 1
      if (.not. suits_multigrid(body(b))) reason = quoted(body(b)%name)//' is nearly incompressible'
      if (body(b)%constraint%foundation%n > 0) reason = quoted(body(b)%name)//' has springs'
      if (body(b)%is_hinged) reason = 'edges or corners alone join pieces of '//quoted(body(b)%name)
      if (len(reason) > 0) exit
    end do
    if (n_floating > most_floating) reason = to_text(n_floating)//' bodies float'
    splits = len(reason) == 0
    form(:) = merge(form_split, form_direct, splits)
    if (.not. splits) call note_factors(reason, monitor)
  end subroutine choose_split

  !> Tell that each body has its factor on one rank.
  subroutine note_factors(reason, monitor)
    character(*), intent(in) :: reason  !! Why bodies are not split.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%note('factors          '//reason//': bodies are not split over ranks, each has its factor on one '// &
                      'of them')
  end subroutine note_factors
end module dotyk_driver_split_choice
