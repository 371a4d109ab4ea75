!> What a program that makes a mesh has left: its log, in the form of gmsh's, and whether its mesh is complete.
module dotyk_mesh_conversion_log
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: is_stl_file
  use dotyk_base_kinds, only: int64
  use dotyk_base_operating_system, only: directory_of
  use dotyk_base_text, only: text_t
  implicit none
  private
  public :: advice, is_complete

  integer, parameter :: max_lines = 6  !! Greatest number of lines of errors in a message.

  type, public :: conversion_log_t  !! What a log says.
    character(:), allocatable :: errors  !! The first errors, each on a line behind two blanks; empty if none.
    character(:), allocatable :: counts  !! The last line that counts nodes and elements.
    character(:), allocatable :: remark  !! Remark for the user; empty where there is none.
    character(:), allocatable :: command  !! First program that a geometry started; empty where there is none.
    !> Number of files that were read, but for the script behind a geometry and what it reads: these are temporary.
    integer :: n_files = 0
    !> Their names: of gmsh relative to its working directory or with the directory of the geometry (room).
    type(text_t), allocatable :: file(:)
  contains
    procedure :: read => log_read
    procedure :: place_of => log_place_of
  end type conversion_log_t

contains

  !> Read a log.
  subroutine log_read(self, path, found)
    class(conversion_log_t), intent(out) :: self
    character(*), intent(in) :: path  !! Path of the log.
    logical, intent(out) :: found  !! Whether there is one.
    type(byte_cursor_t) :: log
    type(error_t), allocatable :: not_read
    character(:), allocatable :: line, base
    logical :: is_temporary
    integer :: n
    base = path(len(directory_of(path)) + 1:len(path) - len('.log'))
    is_temporary = .false.
    self%errors = ''
    self%counts = ''
    self%remark = ''
    self%command = ''
    allocate (self%file(8))
    call log%load(path, not_read)
    found = .not. allocated(not_read)
    if (.not. found) return
    n = 0
    do while (log%position <= log%size)
      call log%get_line(line)
      if (index(line, ' nodes ') > 0 .and. index(line, ' elements') > 0) self%counts = line
      if (index(line, 'Remark  : ') == 1) self%remark = line(11:)
      if (index(line, 'Info    : Reading ''') == 1 .and. index(line, '''...') > 20) then
        associate (name => line(20:index(line, '''...', back=.true.) - 1))
          is_temporary = is_temporary .or. index(name(len(directory_of(name)) + 1:), base//'.') == 1
          if (.not. is_temporary) call add_file(self, name)
        end associate
      end if
      if (index(line, 'Info    : Calling ''') == 1 .and. len(self%command) == 0) self%command = line(19:)
      if (index(line, 'Error   : ') /= 1) cycle
      line = line(len('Error   : ') + 1:)
      ! Lines of the summary of errors at the end of the log.
      if (index(line, '---') == 1 .or. index(line, 'Mesh generation error') == 1 .or. index(line, '  ') == 1 .or. &
          index(line, 'Check the full log') == 1) cycle
      if (index(self%errors//new_line('a'), new_line('a')//'  '//line//new_line('a')) > 0) cycle
      n = n + 1
      if (n <= max_lines) self%errors = self%errors//new_line('a')//'  '//line
    end do
  end subroutine log_read

  !> Add a file that was read.
  subroutine add_file(log, name)
    type(conversion_log_t), intent(inout) :: log  !! The log.
    character(*), intent(in) :: name  !! Name of the file.
    type(text_t), allocatable :: larger(:)
    integer :: i
    if (log%n_files == size(log%file)) then
      allocate (larger(2*log%n_files))
      do i = 1, log%n_files
        call move_alloc(log%file(i)%s, larger(i)%s)
      end do
      call move_alloc(larger, log%file)
    end if
    log%n_files = log%n_files + 1
    log%file(log%n_files)%s = name
  end subroutine add_file

  !> Where a file that was read is now: beside the file of the mesh, as it was then.
  function log_place_of(self, i, path) result(place)
    class(conversion_log_t), intent(in) :: self
    integer, intent(in) :: i  !! Number of the file; the first one is that of the mesh.
    character(*), intent(in) :: path  !! Path of the file of the mesh.
    character(:), allocatable :: place, folder
    place = self%file(i)%s
    if (len(place) == 0) return
    folder = directory_of(self%file(1)%s)
    if (place(1:1) == '/' .and. index(place, folder) /= 1) return
    if (index(place, folder) == 1) place = place(len(folder) + 1:)
    place = directory_of(path)//place
  end function log_place_of

  !> What is to be done about errors of gmsh; empty where nothing is known.
  pure function advice(file, errors) result(text)
    character(*), intent(in) :: file  !! Path of the file.
    character(*), intent(in) :: errors  !! Errors.
    character(:), allocatable :: text
    text = ''
    if (is_stl_file(file) .and. index(errors, 'No elements in volume') > 0) &
      text = new_line('a')//'  the surface must be closed, without holes and without triangles that cross'
  end function advice

  !> Whether a mesh file ends with the end of a section.
  logical function is_complete(file) result(complete)
    character(*), intent(in) :: file  !! Path of the mesh.
    integer, parameter :: tail_length = 32  !! Longer than any '$EndPeriodic' or '$EndElements'.
    character(tail_length) :: tail
    integer(int64) :: n_bytes
    integer :: unit, status
    complete = .false.
    open (newunit=unit, file=file, access='stream', form='unformatted', action='read', status='old', iostat=status)
    if (status /= 0) return
    inquire (unit=unit, size=n_bytes)
    if (n_bytes > tail_length) then
      read (unit, pos=n_bytes - tail_length + 1, iostat=status) tail
      complete = status == 0 .and. index(tail, '$End') > 0 .and. tail(tail_length:) == achar(10)
    end if
    close (unit)
  end function is_complete
end module dotyk_mesh_conversion_log
