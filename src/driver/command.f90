!> What the command line asks for: a text about the program, or the run of a case.
module dotyk_driver_command
  use dotyk_base_error, only: error_t, set_error, exit_converged, exit_not_written
  use dotyk_base_files, only: print_text
  use dotyk_base_progress, only: stop_progress
  use dotyk_base_version, only: version, compiler, build_type
  use dotyk_driver_arguments, only: arguments_t
  use dotyk_driver_run_case, only: run_case
  use dotyk_input_help, only: help_text, manual_text, reference_text
  use dotyk_output_hdf5_reason, only: start_hdf5
  use dotyk_ranks_communication, only: built_with, this_rank
  implicit none
  private
  public :: execute_command, start_libraries

contains

  !> Start libraries that must be there before MPI is: HDF5 would have MPI end it, too, and crash there with a file that
  !> could not be written.
  subroutine start_libraries()
    call start_hdf5()
  end subroutine start_libraries

  !> Print help, reference, manual page or version, or run a case.
  subroutine execute_command(arguments, code, error)
    type(arguments_t), intent(in) :: arguments  !! The command line.
    integer, intent(out) :: code  !! Exit code where there is no error.
    !> Allocated where the run has no results, or the standard output cannot be written; with its exit code.
    type(error_t), allocatable, intent(out) :: error
    code = exit_converged
    if (arguments%help) then
      call print_output(help_text(), error)
    else if (arguments%reference) then
      call print_output(reference_text(), error)
    else if (arguments%manual) then
      call print_output(manual_text(), error)
    else if (arguments%version) then
      call print_output('dotyk '//version//' ('//compiler//', '//build_type//built_with//')', error)
    else
      call run_case(arguments, code, error)
      call stop_progress()
    end if
  end subroutine execute_command

  !> Print a text that the command line asked for.
  subroutine print_output(text, error)
    character(*), intent(in) :: text  !! The text.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the standard output cannot be written.
    integer :: status
    if (this_rank() > 0) return
    call print_text(text//new_line('a'), status)
    if (status /= 0) call set_error(error, 'standard output cannot be written', exit_not_written)
  end subroutine print_output
end module dotyk_driver_command
