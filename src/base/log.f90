!> The log on standard output: plain lines, and one live line of progress on a terminal.
module dotyk_base_log
  use, intrinsic :: iso_c_binding, only: c_int
  use dotyk_base_files, only: print_text
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: append_text, text_t
  use dotyk_base_timer, only: wall_time
  implicit none
  private

  type, public :: log_t  !! Lines to standard output, unless quiet.
    logical :: quiet = .false.  !! Whether only errors are printed.
    logical :: verbose = .false.  !! Whether details are printed.
    logical :: terminal = .false.  !! Whether standard output is a terminal, where a live line can be redrawn.
    logical, private :: live = .false.  !! Whether the last line is a live line, which the next one replaces.
    real(dp), private :: drawn = -huge(1.0_dp)  !! Wall time of the last live line [s].
    real(dp), private :: pause = 2  !! Time to the next line of progress where standard output is no terminal [s].
    !> Lines to be printed later, those that were held last at the end; not allocated where lines are printed (n).
    type(text_t), allocatable, private :: held(:)
  contains
    procedure :: init => log_init
    procedure :: line => log_line
    procedure :: detail => log_detail
    procedure :: hold => log_hold
    procedure :: take => log_take
    procedure :: due => log_due
    procedure :: progress => log_progress
    procedure :: end_progress => log_end_progress
  end type log_t

  public :: print_error

  integer, parameter, public :: most_shown = 20  !! Greatest number of lines of one kind in a table; more are summed up.

  real(dp), parameter :: redraw = 0.1_dp  !! Time between live lines on a terminal [s].
  real(dp), parameter :: longest_pause = 60  !! Without a terminal the time between lines doubles up to this [s].

  interface
    !> C library: is a file descriptor a terminal?
    integer(c_int) function c_isatty(descriptor) bind(c, name='isatty')
      import :: c_int
      integer(c_int), value :: descriptor  !! File descriptor.
    end function c_isatty
  end interface

contains

  !> Begin a log.
  subroutine log_init(self, quiet, verbose)
    class(log_t), intent(inout) :: self
    logical, intent(in) :: quiet  !! Print errors only.
    logical, intent(in) :: verbose  !! Print details, too.
    self%quiet = quiet
    self%verbose = verbose
    self%terminal = .not. is_launched()
    if (self%terminal) self%terminal = c_isatty(1_c_int) /= 0
    self%live = .false.
    self%drawn = wall_time()
    self%pause = 2
  end subroutine log_init

  !> Whether a launcher such as mpirun started this process: it gives it a terminal of its own, wherever output goes.
  logical function is_launched()
    character(*), parameter :: variable(*) = [character(9) :: 'PMIX_RANK', 'PMI_RANK']
    integer :: i, length
    is_launched = .false.
    do i = 1, size(variable)
      call get_environment_variable(trim(variable(i)), length=length)
      is_launched = is_launched .or. length > 0
    end do
  end function is_launched

  !> Print a line.
  subroutine log_line(self, text)
    class(log_t), intent(inout) :: self
    character(*), intent(in) :: text  !! The line.
    integer :: status
    if (self%quiet) return
    if (allocated(self%held)) then
      associate (last => self%held(size(self%held)))
        last%s = last%s//trim(text)//new_line('a')
      end associate
    else
      call self%end_progress()
      call print_text(trim(text)//new_line('a'), status)
      call look(self, status)
      ! Progress is for when nothing else is printed.
      if (.not. self%terminal) self%drawn = wall_time()
    end if
  end subroutine log_line

  !> Print a line that is a detail, if these are wanted.
  subroutine log_detail(self, text)
    class(log_t), intent(inout) :: self
    character(*), intent(in) :: text  !! The line.
    if (self%verbose) call self%line(text)
  end subroutine log_detail

  !> Hold the lines that follow; those within lines that are held already are taken first.
  subroutine log_hold(self)
    class(log_t), intent(inout) :: self
    call append_text(self%held, '')
  end subroutine log_hold

  !> Take the lines that were held, and print the next ones.
  subroutine log_take(self, lines)
    class(log_t), intent(inout) :: self
    character(:), allocatable, intent(out) :: lines  !! One after the other; empty where there are none.
    lines = ''
    if (.not. allocated(self%held)) return
    associate (n => size(self%held))
      if (len(self%held(n)%s) > 0) lines = self%held(n)%s(:len(self%held(n)%s) - 1)
      if (n > 1) self%held = self%held(:n - 1)
      if (n == 1) deallocate (self%held)
    end associate
  end subroutine log_take

  !> Turn the log off where it cannot be written (full disk, closed terminal): the run goes on.
  subroutine look(self, status)
    class(log_t), intent(inout) :: self
    integer, intent(in) :: status  !! Status of the last output; 0 if all is written.
    if (status == 0) return
    self%quiet = .true.
    call print_error('warning: the log cannot be written; the run continues without it')
  end subroutine look

  !> Whether the next line of progress is due; callers ask before they make its text. A line that stays belongs below
  !> the lines that are held.
  logical function log_due(self) result(due)
    class(log_t), intent(in) :: self
    due = .false.
    if (self%quiet .or. (allocated(self%held) .and. .not. self%terminal)) return
    due = wall_time() - self%drawn >= merge(redraw, self%pause, self%terminal)
  end function log_due

  !> Draw the live line (terminal), or print a line of progress.
  subroutine log_progress(self, text)
    class(log_t), intent(inout) :: self
    character(*), intent(in) :: text  !! The line.
    character, parameter :: escape = achar(27), return = achar(13)
    integer :: status
    if (self%quiet) return
    if (self%terminal) then
      call print_text(return//escape//'[2K'//trim(text), status, live=.true.)
      self%live = .true.
    else
      call print_text(trim(text)//new_line('a'), status, live=.true.)
      self%pause = min(longest_pause, 2*self%pause)
    end if
    call look(self, status)
    self%drawn = wall_time()
  end subroutine log_progress

  !> Clear the live line.
  subroutine log_end_progress(self)
    class(log_t), intent(inout) :: self
    integer :: status
    ! A text replaces the live line, an empty one clears it.
    if (self%live) call print_text('', status)
    self%live = .false.
  end subroutine log_end_progress

  !> Print an error on standard error, also where the log is quiet. Control characters of names are replaced, and long
  !> lines are cut: names of a damaged file may have any length.
  subroutine print_error(message)
    character(*), intent(in) :: message  !! Message, possibly of several lines.
    character(:), allocatable :: printable
    integer :: i, first, status
    allocate (character(0) :: printable)
    first = 1
    do while (first <= len(message))
      i = index(message(first:), new_line('a'))
      if (i == 0) i = len(message) - first + 2
      printable = printable//cut(message(first:first + i - 2))//new_line('a')
      first = first + i
    end do
    do i = 1, len(printable)
      if (printable(i:i) == new_line('a')) cycle
      if (iachar(printable(i:i)) < 32 .or. iachar(printable(i:i)) == 127) printable(i:i) = '?'
    end do
    call print_text(printable, status, to_error=.true.)
  end subroutine print_error

  !> A line that is not too long: its middle is left out.
  pure function cut(line)
    character(*), intent(in) :: line  !! The line.
    character(:), allocatable :: cut
    integer, parameter :: most = 1000
    integer :: head, tail
    cut = line
    if (len(line) <= most) return
    head = most/2
    tail = len(line) - most/2 + 1
    ! Letters of several bytes stay whole: their later bytes are 128 to 191.
    do while (head > 1 .and. is_later_byte(line(head + 1:head + 1)))
      head = head - 1
    end do
    do while (tail < len(line) .and. is_later_byte(line(tail:tail)))
      tail = tail + 1
    end do
    cut = line(:head)//' [...] '//line(tail:)

  contains

    !> Whether a byte is not the first of its letter.
    pure logical function is_later_byte(byte)
      character, intent(in) :: byte  !! The byte.
      is_later_byte = iachar(byte) >= 128 .and. iachar(byte) < 192
    end function is_later_byte
  end function cut
end module dotyk_base_log
