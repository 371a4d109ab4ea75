!> What the user sees while the program works: plain lines, and one live line on a terminal.
module dotyk_base_log
  use, intrinsic :: iso_c_binding, only: c_int
  use dotyk_base_files, only: print_text
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: wall_time
  implicit none
  private

  !> Lines to standard output, unless quiet.
  type, public :: log_t
    !> True: print nothing but errors.
    logical :: quiet = .false.
    !> True: standard output is a terminal, where a live line can be redrawn.
    logical :: terminal = .false.
    !> True: the last thing printed is a live line that the next line replaces.
    logical, private :: live = .false.
    !> When the last live line was drawn [s].
    real(dp), private :: drawn = -huge(1.0_dp)
    !> Seconds to the next live line where standard output is not a terminal.
    real(dp), private :: pause = 2
  contains
    procedure :: init => log_init
    procedure :: line => log_line
    procedure :: due => log_due
    procedure :: progress => log_progress
    procedure :: end_progress => log_end_progress
  end type log_t

  public :: print_error

  !> Seconds between redrawings on a terminal.
  real(dp), parameter :: redraw = 0.1_dp
  !> Where there is no terminal the pause between progress lines doubles up to this [s].
  real(dp), parameter :: longest_pause = 60

  interface
    !> C library: is a file descriptor a terminal?
    integer(c_int) function c_isatty(descriptor) bind(c, name='isatty')
      import :: c_int
      integer(c_int), value :: descriptor
    end function c_isatty
  end interface

contains

  !> Look at standard output.
  subroutine log_init(self, quiet)
    class(log_t), intent(inout) :: self
    !> Print errors only.
    logical, intent(in) :: quiet
    self%quiet = quiet
    self%terminal = c_isatty(1_c_int) /= 0
    self%live = .false.
    self%drawn = -huge(1.0_dp)
    self%pause = 2
  end subroutine log_init

  !> Print a line.
  subroutine log_line(self, text)
    class(log_t), intent(inout) :: self
    !> The line.
    character(*), intent(in) :: text
    integer :: status
    if (self%quiet) return
    call self%end_progress()
    call print_text(trim(text)//new_line('a'), status)
    call look(self, status)
  end subroutine log_line

  !> A log that cannot be written (a full disk, a terminal that was closed) is no reason to lose the results.
  subroutine look(self, status)
    class(log_t), intent(inout) :: self
    integer, intent(in) :: status
    if (status == 0) return
    self%quiet = .true.
    call print_error('warning: the log cannot be written; the run goes on without it')
  end subroutine look

  !> Is it time for the next progress line? Asked first, so that its text is made only when it is shown.
  logical function log_due(self) result(due)
    class(log_t), intent(in) :: self
    due = .false.
    if (self%quiet) return
    due = wall_time() - self%drawn >= merge(redraw, self%pause, self%terminal)
  end function log_due

  !> Draw the live line (terminal), or print a line of progress.
  subroutine log_progress(self, text)
    class(log_t), intent(inout) :: self
    !> The line.
    character(*), intent(in) :: text
    character, parameter :: escape = achar(27), return = achar(13)
    integer :: status
    if (self%quiet) return
    if (self%terminal) then
      call print_text(return//escape//'[2K'//trim(text), status)
      self%live = .true.
    else
      call print_text(trim(text)//new_line('a'), status)
      if (self%drawn > 0) self%pause = min(longest_pause, 2*self%pause)
    end if
    call look(self, status)
    self%drawn = wall_time()
  end subroutine log_progress

  !> Leave the live line: wipe it.
  subroutine log_end_progress(self)
    class(log_t), intent(inout) :: self
    integer :: status
    if (self%live) call print_text(achar(13)//achar(27)//'[2K', status)
    self%live = .false.
  end subroutine log_end_progress

  !> An error, to standard error, whatever the verbosity. Names of files and meshes may hold control characters: a terminal gets none.
  subroutine print_error(message)
    !> Message, possibly of several lines.
    character(*), intent(in) :: message
    character(:), allocatable :: printable
    integer :: i, status
    printable = message
    do i = 1, len(message)
      if ((iachar(message(i:i)) < 32 .and. message(i:i) /= new_line('a')) .or. iachar(message(i:i)) == 127) printable(i:i) = '?'
    end do
    call print_text(printable//new_line('a'), status, to_error=.true.)
  end subroutine print_error
end module dotyk_base_log
