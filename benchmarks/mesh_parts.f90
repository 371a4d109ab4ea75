!> Memory and time to read a mesh file, volumes of it, or a share of them; and the surfaces of bodies in parts against
!> those of the whole mesh.
!>
!> usage: benchmark_mesh_parts read FILE [VOLUME [N_SHARES SHARE]]     volume '' reads the surfaces alone
!>        benchmark_mesh_parts check FILE...                           all volumes in 1, 2, 3 and 5 parts
!>        benchmark_mesh_parts assemble FILE VOLUME                    parts made of shares, on 1, 2, 3 and 5 ranks
program mesh_parts
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_gmsh, only: read_gmsh
  use dotyk_mesh_element, only: kind_dimension
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_selection, only: mesh_selection_t
  use layer_check, only: check_volumes
  use part_check, only: check_assembly
  implicit none
  integer :: i
  select case (argument(1))
  case ('read')
    call measure(argument(2))
  case ('check')
    do i = 2, command_argument_count()
      call check(argument(i))
    end do
  case ('assemble')
    call assemble(argument(2), argument(3))
  case default
    stop 2, quiet=.true.
  end select

contains

  !> An argument of the command line.
  function argument(i) result(text)
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(4096) :: value
    call get_command_argument(i, value)
    text = trim(value)
  end function argument

  !> Read a file and tell what it took.
  subroutine measure(file)
    character(*), intent(in) :: file
    type(mesh_t) :: mesh
    type(mesh_selection_t) :: selection
    type(error_t), allocatable :: error
    character(:), allocatable :: text
    real(dp) :: start, finish
    integer :: b, n(0:3)
    selection%everything = command_argument_count() < 3
    allocate (selection%volume(1))
    selection%volume(1)%s = argument(3)
    if (command_argument_count() > 4) then
      text = argument(4)
      read (text, *) selection%n_shares
      text = argument(5)
      read (text, *) selection%share
    end if
    call cpu_time(start)
    call read_gmsh(file, mesh, error, selection)
    call cpu_time(finish)
    if (allocated(error)) then
      write (*, '(a)') error%message
      stop 1, quiet=.true.
    end if
    n = 0
    do b = 1, size(mesh%block)
      associate (d => kind_dimension(mesh%block(b)%kind))
        n(d) = n(d) + size(mesh%block(b)%tag)
      end associate
    end do
    write (*, '(a,i0,a,i0,a,i0,a,f0.3,a,f0.1,a)') 'nodes ', size(mesh%x, 2), ' facets ', n(2), ' elements ', n(3), &
      ' seconds ', finish - start, ' peak ', peak()/2.0_dp**20, ' MiB'
  end subroutine measure

  !> Peak memory of the process [B].
  real(dp) function peak()
    character(80) :: line
    integer(int64) :: kilobytes
    integer :: unit, status
    peak = 0
    open (newunit=unit, file='/proc/self/status', action='read', iostat=status)
    do while (status == 0)
      read (unit, '(a)', iostat=status) line
      if (line(1:6) /= 'VmHWM:') cycle
      read (line(7:index(line, 'kB') - 1), *) kilobytes
      peak = 1024.0_dp*kilobytes
      exit
    end do
    close (unit)
  end function peak

  !> Compare parts made of shares with those cut from the whole body.
  subroutine assemble(file, volume)
    character(*), intent(in) :: file, volume
    integer, parameter :: n_ranks(4) = [1, 2, 3, 5]
    character(:), allocatable :: message
    integer :: k, most
    logical :: split
    do k = 1, 8
      split = k > 4
      call check_assembly(file, volume, n_ranks(mod(k - 1, 4) + 1), split, most, message)
      write (*, '(a,i0,a,l1,a,i0,a)') 'ranks ', n_ranks(mod(k - 1, 4) + 1), ' moved ', split, ' most elements ', most, &
        ' '//message
      if (message /= '') stop 1, quiet=.true.
    end do
  end subroutine assemble

  !> Compare surfaces from parts with those of the whole mesh.
  subroutine check(file)
    character(*), intent(in) :: file
    type(mesh_t) :: mesh
    type(error_t), allocatable :: error
    character(:), allocatable :: message
    integer :: n, b, dimension
    call read_gmsh(file, mesh, error)
    if (allocated(error)) then
      write (*, '(a)') error%message
      stop 1, quiet=.true.
    end if
    dimension = maxval([(kind_dimension(mesh%block(b)%kind), b=1, size(mesh%block))])
    n = 0
    call check_volumes(mesh, dimension, [1, 2, 3, 5], n, message)
    write (*, '(a,i0,a,a)') file//': ', n, ' surfaces', merge(': same  ', ': differ', message == '')
    if (message == '') return
    write (*, '(a)') message
    stop 1, quiet=.true.
  end subroutine check
end program mesh_parts
