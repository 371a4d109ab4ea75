!> What a run of gmsh has left: errors in its log, and whether its mesh is complete.
module dotyk_mesh_gmsh_log
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_files, only: is_med_file, is_stl_file
  use dotyk_base_kinds, only: int64
  implicit none
  private
  public :: advice, is_complete, read_log

  integer, parameter :: max_lines = 6  !! Greatest number of lines of the gmsh log in a message.

contains

  !> What is to be done about errors of gmsh; empty where nothing is known.
  pure function advice(file, errors) result(text)
    character(*), intent(in) :: file  !! Path of the file.
    character(*), intent(in) :: errors  !! Errors.
    character(:), allocatable :: text
    text = ''
    if (is_med_file(file) .and. index(errors, 'MED support') > 0) then
      text = new_line('a')//'  gmsh of Debian lacks it: set DOTYK_GMSH to one that has it (gmsh.info, pip install '// &
             'gmsh), or convert the file to .vtu or .msh'
    else if (is_stl_file(file) .and. index(errors, 'No elements in volume') > 0) then
      text = new_line('a')//'  the surface must be closed, without holes and without triangles that cross'
    end if
  end function advice

  !> Extract errors and counts from the gmsh log.
  subroutine read_log(log, errors, counts)
    type(byte_cursor_t), intent(inout) :: log  !! Cursor over the log.
    !> The first errors, each on a line of its own, empty where there is none.
    character(:), allocatable, intent(out) :: errors
    character(:), allocatable, intent(out) :: counts  !! The last line that counts nodes and elements.
    character(:), allocatable :: line
    integer :: n
    errors = ''
    counts = ''
    n = 0
    do while (log%position <= log%size)
      call log%get_line(line)
      if (index(line, ' nodes ') > 0 .and. index(line, ' elements') > 0) counts = line
      if (index(line, 'Error   : ') /= 1) cycle
      line = line(len('Error   : ') + 1:)
      ! Lines of the summary of errors at the end of the log.
      if (index(line, '---') == 1 .or. index(line, 'Mesh generation error') == 1 .or. index(line, '  ') == 1 .or. &
          index(line, 'Check the full log') == 1) cycle
      if (index(errors//new_line('a'), new_line('a')//'  '//line//new_line('a')) > 0) cycle
      n = n + 1
      if (n <= max_lines) errors = errors//new_line('a')//'  '//line
    end do
  end subroutine read_log

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
end module dotyk_mesh_gmsh_log
