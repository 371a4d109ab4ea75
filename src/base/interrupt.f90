!> Interrupts: Ctrl-C, SIGTERM of a batch system, SIGHUP of a closed terminal.
!>
!> Iterations poll at each step and end there; their results are written and marked. Earlier stages end between two of
!> their parts, without results. A second signal ends the program at once. The ranks of an MPI run get their signals at
!> different times: they stop when they have agreed on it (`dotyk_ranks_exchange`).
module dotyk_base_interrupt
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use dotyk_base_error, only: error_t, exit_not_converged, set_error
  use dotyk_base_memory, only: stage_text
  implicit none
  private
  public :: watch_interrupts, interrupted, set_interrupt, stop_if_interrupted, run_command, is_asked, &
    agree_on_interrupt, wait_for_agreement

  !> Whether the program stops when all ranks have agreed on it, and whether they have.
  logical :: needs_agreement = .false., is_agreed = .false.

  !> Exit statuses of `run_command` above this belong to programs that a signal has ended.
  integer, parameter, public :: status_of_signals = 128
  !> Exit status of `run_command` where a command cannot be confined on this machine.
  integer, parameter, public :: status_not_confined = 125

  integer(c_int), parameter :: terminate = 15  !! SIGTERM; shells ignore SIGINT in programs behind an ampersand.

  interface
    !> Install the signal handlers.
    subroutine watch_interrupts() bind(c, name='dotyk_watch_interrupts')
    end subroutine watch_interrupts

    integer(c_int) function c_interrupt_signal() bind(c, name='dotyk_interrupt_signal')
      import :: c_int
    end function c_interrupt_signal

    subroutine c_set_interrupt(number) bind(c, name='dotyk_set_interrupt')
      import :: c_int
      integer(c_int), value :: number  !! Number of the signal; 0 for none.
    end subroutine c_set_interrupt

    integer(c_int) function c_run_command(command, folder) bind(c, name='dotyk_run_command')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: command(*)  !! Command, ended by a null character.
      character(kind=c_char), intent(in), optional :: folder(*)  !! Folder of a confined command, null-terminated.
    end function c_run_command
  end interface

contains

  !> Whether the program is to stop.
  logical function interrupted()
    if (needs_agreement) then
      interrupted = is_agreed
    else
      interrupted = is_asked()
    end if
  end function interrupted

  !> Whether this process is asked to stop.
  logical function is_asked()
    is_asked = c_interrupt_signal() /= 0
  end function is_asked

  !> From here on the program stops only when all ranks have agreed on it.
  subroutine wait_for_agreement()
    needs_agreement = .true.
  end subroutine wait_for_agreement

  !> All ranks know that one of them is asked to stop, or that none is.
  subroutine agree_on_interrupt(asked)
    logical, intent(in) :: asked  !! Whether one of them is.
    is_agreed = asked
  end subroutine agree_on_interrupt

  !> Set or clear the request to stop, for tests.
  subroutine set_interrupt(asked)
    logical, intent(in) :: asked  !! Whether the program is asked to stop.
    call c_set_interrupt(merge(terminate, 0_c_int, asked))
  end subroutine set_interrupt

  !> Raise an error where the program is asked to stop before there are results.
  subroutine stop_if_interrupted(error)
    !> Allocated on return where the program is asked to stop; unchanged where it is allocated already.
    type(error_t), allocatable, intent(inout) :: error
    if (allocated(error)) return
    if (.not. interrupted()) return
    call set_error(error, 'interrupted while '//stage_text()//': no results were written', exit_not_converged)
  end subroutine stop_if_interrupted

  !> Run a command of the shell and wait for its end; interrupts reach the command too. The result is its exit status.
  integer function run_command(command, folder) result(status)
    character(*), intent(in) :: command  !! Command of the shell.
    !> Folder to which the command is confined: it starts no other process, and changes files below the folder only;
    !> empty: the working directory. Not confined if absent.
    character(*), intent(in), optional :: folder
    if (present(folder)) then
      status = int(c_run_command(command//c_null_char, folder//c_null_char))
    else
      status = int(c_run_command(command//c_null_char))
    end if
  end function run_command
end module dotyk_base_interrupt
