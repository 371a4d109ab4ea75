!> A file in memory, or a window of it, which can be moved over files of any size.
module dotyk_base_byte_window
  use dotyk_base_error, only: error_t, set_error, exit_bad_input
  use dotyk_base_files, only: why_no_file
  use dotyk_base_kinds, only: int64
  implicit none
  private

  !> Bytes per read: the run-time library passes a read to the system in one call, which is limited to 2 GB.
  integer(int64), parameter :: chunk = 2_int64**29
  type, public :: byte_window_t  !! Bytes of a file.
    character(:), allocatable :: file  !! Name of the file, for messages.
    character(:), allocatable :: text  !! Bytes of the file, or of a window of it, followed by a NUL.
    integer(int64) :: size = 0  !! Number of bytes of the file.
    integer(int64) :: before = 0  !! Number of bytes of the file before the window; 0 where all is in memory.
    integer(int64) :: n_held = 0  !! Number of bytes in memory.
    integer(int64) :: window = 2_int64**22  !! Bytes of a window.
    integer :: unit = 0  !! Unit of a file that is read by windows; 0 where there is none.
    logical :: broken = .false.  !! Whether a fault was found.
    character(:), allocatable :: fault  !! Message of the first fault, with its position.
  contains
    procedure :: read_all => window_read_all
    procedure :: open_window => window_open
    procedure :: take_text => window_take_text
    procedure :: hold => window_hold
    procedure :: byte => window_byte
    procedure :: first_bytes => window_first_bytes
    procedure :: line_of => window_line_of
    procedure :: close => window_close
  end type byte_window_t

contains

  !> Read a whole file.
  subroutine window_read_all(self, file, error)
    class(byte_window_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Where it is missing, no regular file, or cannot be read.
    character(:), allocatable :: text
    integer(int64) :: n_bytes
    integer :: unit
    call open_bytes(file, unit, n_bytes, error)
    if (allocated(error)) return
    allocate (character(n_bytes + 1) :: text)
    call read_bytes(unit, file, 1_int64, text(:n_bytes), error)
    close (unit)
    if (allocated(error)) return
    text(n_bytes + 1:) = achar(0)
    call self%take_text(file, text)
  end subroutine window_read_all

  !> Open a file, of which only a window is in memory: its beginning.
  subroutine window_open(self, file, error)
    class(byte_window_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Where it is missing, no regular file, or cannot be read.
    character(:), allocatable :: text
    integer(int64) :: n_bytes
    integer :: unit
    call open_bytes(file, unit, n_bytes, error)
    if (allocated(error)) return
    text = achar(0)
    call self%take_text(file, text)
    self%unit = unit
    self%size = n_bytes
    call window_move(self, 1_int64, 1_int64, error)
    if (allocated(error)) call self%close
  end subroutine window_open

  !> Use bytes in memory as the content of a file.
  subroutine window_take_text(self, file, text)
    class(byte_window_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Name, for messages.
    character(:), allocatable, intent(inout) :: text  !! Bytes and a NUL behind them; moved from the caller.
    call move_alloc(text, self%text)
    self%file = file
    self%size = len(self%text, int64) - 1
    self%n_held = self%size
    self%before = 0
    self%unit = 0
    self%broken = .false.
    if (allocated(self%fault)) deallocate (self%fault)
  end subroutine window_take_text

  !> Make bytes of the file available in memory, as far as the file has them.
  subroutine window_hold(self, first, n)
    class(byte_window_t), intent(inout) :: self
    integer(int64), intent(in) :: first  !! The first of them.
    integer(int64), intent(in) :: n  !! Their number.
    type(error_t), allocatable :: error
    if (first > self%before .and. min(first + n - 1, self%size) <= self%before + self%n_held) return
    call window_move(self, first, n, error)
    if (.not. allocated(error)) return
    self%broken = .true.
    self%fault = error%message
  end subroutine window_hold

  !> A byte of the file, with the bytes before it from a position on in memory; NUL after a fault.
  character function window_byte(self, position, n) result(byte)
    class(byte_window_t), intent(inout) :: self
    integer(int64), intent(in) :: position  !! First byte that stays in memory.
    integer(int64), intent(in) :: n  !! Number of bytes before the one that is asked for.
    if (position <= self%before .or. position + n > self%before + self%n_held) &
      call self%hold(position, 2*n + self%window)
    byte = achar(0)
    if (position + n <= self%before + self%n_held) &
      byte = self%text(position + n - self%before:position + n - self%before)
  end function window_byte

  !> The beginning of the file.
  subroutine window_first_bytes(self, n, bytes)
    class(byte_window_t), intent(inout) :: self
    integer, intent(in) :: n  !! Number of bytes.
    character(:), allocatable, intent(out) :: bytes  !! The bytes; fewer where the file is shorter.
    integer(int64) :: length
    length = min(int(n, int64), self%size)
    call self%hold(1_int64, length)
    bytes = self%text(1 - self%before:min(length, self%n_held) - self%before)
  end subroutine window_first_bytes

  !> Line of a position.
  integer(int64) function window_line_of(self, position) result(line)
    class(byte_window_t), intent(inout) :: self
    integer(int64), intent(in) :: position  !! Byte number.
    integer(int64) :: p
    line = 1
    p = 1
    do while (p < min(position, self%size + 1))
      call self%hold(p, 1_int64)
      if (self%n_held == 0) exit
      if (self%text(p - self%before:p - self%before) == achar(10)) line = line + 1
      p = p + 1
    end do
  end function window_line_of

  !> Move the window to bytes that are not in memory.
  subroutine window_move(self, first, n, error)
    class(byte_window_t), intent(inout) :: self
    integer(int64), intent(in) :: first  !! The first byte of the window, from 1.
    integer(int64), intent(in) :: n  !! Number of bytes that the window has at least, as far as the file has them.
    type(error_t), allocatable, intent(out) :: error  !! Set if the file cannot be read; no byte is in memory then.
    integer(int64) :: length
    if (self%unit == 0 .or. first > self%size) return
    length = min(max(self%window, n), self%size - first + 1)
    if (len(self%text, int64) < length + 1) then
      deallocate (self%text)
      allocate (character(length + 1) :: self%text)
    end if
    self%before = first - 1
    self%n_held = length
    call read_bytes(self%unit, self%file, first, self%text(:length), error)
    if (allocated(error)) self%n_held = 0
    self%text(self%n_held + 1:self%n_held + 1) = achar(0)
  end subroutine window_move

  !> Close a file that is read by windows.
  subroutine window_close(self)
    class(byte_window_t), intent(inout) :: self
    if (self%unit /= 0) close (self%unit)
    self%unit = 0
  end subroutine window_close

  !> Open a file to read it.
  subroutine open_bytes(file, unit, n_bytes, error)
    character(*), intent(in) :: file  !! Path of the file.
    integer, intent(out) :: unit  !! Its unit.
    integer(int64), intent(out) :: n_bytes  !! Number of its bytes.
    type(error_t), allocatable, intent(out) :: error  !! Where it is missing, no regular file, or cannot be opened.
    character(:), allocatable :: text
    character(256) :: message
    integer :: status
    logical :: found
    unit = 0
    n_bytes = 0
    inquire (file=file, exist=found)
    if (.not. found) then
      call set_error(error, file//': there is no such file', exit_bad_input)
      return
    end if
    text = why_no_file(file)
    if (len(text) > 0) then
      call set_error(error, file//': it '//text, exit_bad_input)
      return
    end if
    open (newunit=unit, file=file, access='stream', form='unformatted', action='read', status='old', &
          iostat=status, iomsg=message)
    if (status /= 0) then
      call set_error(error, file//': cannot be opened: '//trim(message), exit_bad_input)
      return
    end if
    inquire (unit=unit, size=n_bytes)
    n_bytes = max(0_int64, n_bytes)
  end subroutine open_bytes

  !> Read bytes of an open file.
  subroutine read_bytes(unit, file, first, bytes, error)
    integer, intent(in) :: unit  !! Its unit.
    character(*), intent(in) :: file  !! Its path, for messages.
    integer(int64), intent(in) :: first  !! The first byte to be read, from 1.
    character(*), intent(inout) :: bytes  !! The bytes.
    type(error_t), allocatable, intent(out) :: error  !! Set if they cannot be read.
    character(256) :: message
    integer(int64) :: i
    integer :: status
    do i = 1, len(bytes, int64), chunk
      read (unit, pos=first + i - 1, iostat=status, iomsg=message) bytes(i:min(i + chunk - 1, len(bytes, int64)))
      if (status == 0) cycle
      call set_error(error, file//': cannot be read: '//trim(message), exit_bad_input)
      return
    end do
  end subroutine read_bytes
end module dotyk_base_byte_window
