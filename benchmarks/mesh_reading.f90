!> Times the reading of mesh files: for each file of the command line, seconds of the fastest of five readings,
!> elements, nodes.
program mesh_reading
  use dotyk_base_kinds, only: dp
  use dotyk_base_error, only: error_t
  use dotyk_base_timer, only: wall_time
  use dotyk_mesh_gmsh, only: read_gmsh
  use dotyk_mesh_mesh, only: mesh_t
  implicit none
  type(error_t), allocatable :: error
  character(4096) :: file
  integer :: i

  do i = 1, command_argument_count()
    call get_command_argument(i, file)
    call time_file(trim(file))
    if (allocated(error)) exit
  end do
  if (allocated(error)) then
    write (*, '(a)') error%message
    stop 2, quiet=.true.
  end if

contains

  !> Read a file five times.
  subroutine time_file(path)
    character(*), intent(in) :: path
    type(mesh_t) :: mesh
    real(dp) :: start, least
    integer :: repetition, b, n_elements
    least = huge(least)
    do repetition = 1, 5
      start = wall_time()
      call read_gmsh(path, mesh, error)
      least = min(least, wall_time() - start)
      if (allocated(error)) return
    end do
    n_elements = 0
    do b = 1, size(mesh%block)
      n_elements = n_elements + size(mesh%block(b)%tag)
    end do
    write (*, '(f9.4,2i10)') least, n_elements, size(mesh%node_tag)
  end subroutine time_file
end program mesh_reading
