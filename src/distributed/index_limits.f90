!> What PETSc's indices can count, checked before a matrix is made: sizes beyond it would wrap around in silence.
module dotyk_distributed_index_limits
  use dotyk_base_error, only: error_t, exit_machine, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_distributed_petsc, only: largest_of_ranks
  implicit none
  private
  public :: check_entries, check_unknowns

  integer(int64), parameter :: largest = huge(1)  !! Largest index: PETSc and the program count in default integers.

contains

  !> Whether all unknowns have a number.
  subroutine check_unknowns(n, error)
    integer(int64), intent(in) :: n  !! Unknowns of all bodies, held ones included.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where they are too many; the same on all ranks.
    if (n <= largest) return
    call set_error(error, 'PETSc was built with 32-bit indices, which number '//to_text(largest)//' unknowns; '// &
                   'these bodies have '//to_text(n)//': make the meshes coarser', exit_machine)
  end subroutine check_unknowns

  !> Whether the entries of a matrix on each rank can be counted. All ranks ask together.
  subroutine check_entries(n, error)
    integer(int64), intent(in) :: n  !! Entries of this rank.
    !> Allocated where those of a rank are too many; the same on all ranks.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: most(1)
    most = real(n, dp)
    call largest_of_ranks(most)
    if (most(1) <= real(largest, dp)) return
    call set_error(error, 'PETSc was built with 32-bit indices, which number '//to_text(largest)// &
                   ' entries of the stiffness on a rank; one has '//to_text(nint(most(1), int64))// &
                   ': take more ranks', exit_machine)
  end subroutine check_entries
end module dotyk_distributed_index_limits
