!> Progress of long stages of a run (`set_stage` of `dotyk_base_memory`): a thread of its own shows the stage, its share
!> that is done and the time left, on a terminal in one line, elsewhere in lines of ever longer stages.
!>
!> Stages whose work is known expect it and count what is done, from any thread; the unit is up to them.
module dotyk_base_progress
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: add_progress, expect_progress, start_progress, stop_progress

  interface
    subroutine c_start(terminal, seconds) bind(c, name='dotyk_progress_start')
      import :: c_double, c_int
      integer(c_int), value :: terminal  !! Whether standard output is a terminal.
      real(c_double), value :: seconds  !! Time of a stage before its first line where it is not [s].
    end subroutine c_start

    !> End the thread, before the program ends.
    subroutine stop_progress() bind(c, name='dotyk_progress_stop')
    end subroutine stop_progress

    subroutine c_expect(work) bind(c, name='dotyk_progress_expect')
      import :: c_double
      real(c_double), value :: work  !! Work of the stage.
    end subroutine c_expect

    subroutine c_add(work) bind(c, name='dotyk_progress_add')
      import :: c_double
      real(c_double), value :: work  !! Work that is done.
    end subroutine c_add
  end interface

contains

  !> Start the thread.
  subroutine start_progress(terminal, seconds)
    logical, intent(in) :: terminal  !! Whether standard output is a terminal.
    real(dp), intent(in) :: seconds  !! Time of a stage before its first line where it is not [s].
    call c_start(merge(1_c_int, 0_c_int, terminal), real(seconds, c_double))
  end subroutine start_progress

  !> The work of the current stage; one thread calls it, before any of it is done.
  subroutine expect_progress(work)
    real(dp), intent(in) :: work  !! In the unit of `add_progress`.
    call c_expect(real(work, c_double))
  end subroutine expect_progress

  !> Some work of the current stage is done; any thread calls it.
  subroutine add_progress(work)
    real(dp), intent(in) :: work  !! In the unit of `expect_progress`; whole numbers count.
    call c_add(real(work, c_double))
  end subroutine add_progress
end module dotyk_base_progress
