!> Lines of the log on the engine that solves a contact, and why it is not another one.
module dotyk_log_engine_lines
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_scheme_scheme, only: reason_accuracy, reason_aggregates, reason_near_null_modes, &
    reason_rigid_rows, reason_slow
  implicit none
  private
  public :: note_factors, note_no_memory, note_rebuilt

contains

  !> Bodies get factors in place of p-multigrids.
  subroutine note_factors(reason, monitor)
    integer, intent(in) :: reason  !! One of `reason_*`.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%note('factors          '//sentence(reason)// &
                      ': the bodies are factorized, and the contact solved again')
  end subroutine note_factors

  !> They do not get them.
  subroutine note_no_memory(reason, monitor)
    integer, intent(in) :: reason  !! One of `reason_*`.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%log%line('  warning          '//sentence(reason)//', and the memory does not suffice for factors')
  end subroutine note_no_memory

  !> Bodies that were split get factors.
  subroutine note_rebuilt(reason, monitor)
    integer, intent(in) :: reason  !! One of `reason_*`.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%note('factors          '//sentence(reason)//': the bodies are not split over ranks, each has its '// &
                      'factor on one of them')
  end subroutine note_rebuilt

  !> A reason as a sentence.
  pure function sentence(reason) result(text)
    integer, intent(in) :: reason  !! One of `reason_*`.
    character(:), allocatable :: text
    select case (reason)
    case (reason_near_null_modes)
      text = 'the contact needs factors, as supports hardly resist some motions'
    case (reason_rigid_rows)
      text = 'the contact needs factors, as supports press rows together'
    case (reason_aggregates)
      text = 'the ties need factors, as bodies of theirs are too large for p-multigrid with ties'
    case (reason_slow)
      text = 'p-multigrid would take longer than factors'
    case (reason_accuracy)
      text = 'the accuracy of p-multigrid does not suffice'
    case default
      text = 'the contact needs factors'
    end select
  end function sentence
end module dotyk_log_engine_lines
