!> Interrupts: whether somebody asked the program to stop (Ctrl-C, SIGTERM of a batch system, SIGHUP of a closed terminal).
!>
!> Iterations ask at each step and stop there, with results that are marked; all before that stops between two stages, as there is
!> nothing to write yet. A second signal ends the program at once.
module dotyk_base_interrupt
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use dotyk_base_error, only: error_t, exit_not_converged, set_error
  use dotyk_base_memory, only: stage_text
  implicit none
  private
  public :: watch_interrupts, interrupted, set_interrupt, stop_if_interrupted, run_command

  !> Exit status of `run_command` for a program that a signal ended: this and more.
  integer, parameter, public :: status_of_signals = 128

  !> SIGTERM: nobody starts programs with this one ignored, as shells do with SIGINT behind an ampersand.
  integer(c_int), parameter :: terminate = 15

  interface
    !> Begin to listen.
    subroutine watch_interrupts() bind(c, name='dotyk_watch_interrupts')
    end subroutine watch_interrupts

    integer(c_int) function c_interrupt_signal() bind(c, name='dotyk_interrupt_signal')
      import :: c_int
    end function c_interrupt_signal

    subroutine c_set_interrupt(number) bind(c, name='dotyk_set_interrupt')
      import :: c_int
      integer(c_int), value :: number
    end subroutine c_set_interrupt

    integer(c_int) function c_run_command(command) bind(c, name='dotyk_run_command')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: command(*)
    end function c_run_command
  end interface

contains

  !> Whether the program was asked to stop.
  logical function interrupted()
    interrupted = c_interrupt_signal() /= 0
  end function interrupted

  !> As if the program had been asked to stop, or had not.
  subroutine set_interrupt(asked)
    logical, intent(in) :: asked
    call c_set_interrupt(merge(terminate, 0_c_int, asked))
  end subroutine set_interrupt

  !> An error where the program was asked to stop before there is anything to write.
  subroutine stop_if_interrupted(error)
    !> Left as it is where there is one already.
    type(error_t), allocatable, intent(inout) :: error
    if (allocated(error)) return
    if (.not. interrupted()) return
    call set_error(error, 'interrupted while '//stage_text()//': no results were written', exit_not_converged)
  end subroutine stop_if_interrupted

  !> Run a command of the shell and wait for its end; interrupts reach it too.
  integer function run_command(command) result(status)
    character(*), intent(in) :: command
    status = int(c_run_command(command//c_null_char))
  end function run_command
end module dotyk_base_interrupt
