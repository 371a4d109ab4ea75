!> Clocks and memory for the benchmark of p-multigrid.
module multigrid_clock
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_timer, only: wall_time
  implicit none
  private
  public :: start_clock, read_clock, reset_peak, memory_of

contains

  !> Start the clocks.
  subroutine start_clock(start, begun)
    real(dp), intent(out) :: start  !! Wall-clock time [s].
    real(dp), intent(out) :: begun  !! Processor time [s].
    call cpu_time(begun)
    start = wall_time()
  end subroutine start_clock

  !> Write the time since the start.
  subroutine read_clock(name, start, begun)
    character(*), intent(in) :: name  !! What was measured.
    real(dp), intent(in) :: start  !! Wall-clock time at the start [s].
    real(dp), intent(in) :: begun  !! Processor time at the start [s].
    real(dp) :: now
    character(24) :: label
    label = name
    call cpu_time(now)
    write (*, '(a, f0.2, a, f0.2, a)') label//' ', wall_time() - start, ' s wall, ', now - begun, ' s processor'
  end subroutine read_clock

  !> Reset the peak of the resident memory.
  subroutine reset_peak()
    integer :: unit, status
    open (newunit=unit, file='/proc/self/clear_refs', action='write', status='old', iostat=status)
    if (status /= 0) return
    write (unit, '(i0)') 5
    close (unit)
  end subroutine reset_peak

  !> A figure of /proc/self/status [bytes].
  integer(int64) function memory_of(name) result(bytes)
    character(*), intent(in) :: name  !! With its colon.
    character(200) :: line
    integer :: unit, status
    bytes = 0
    open (newunit=unit, file='/proc/self/status', action='read', status='old', iostat=status)
    do while (status == 0)
      read (unit, '(a)', iostat=status) line
      if (status == 0 .and. index(line, name) == 1) read (line(len(name) + 1:index(line, 'kB') - 1), *) bytes
    end do
    close (unit)
    bytes = 1024*bytes
  end function memory_of
end module multigrid_clock
