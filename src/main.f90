!> dotyk: frictionless contact of linear elastic bodies.
program dotyk
  use dotyk_base_error, only: error_t, exit_converged, exit_not_written, set_error
  use dotyk_base_files, only: hold_standard_files, print_text
  use dotyk_base_interrupt, only: wait_for_agreement, watch_interrupts
  use dotyk_base_memory, only: watch_ends
  use dotyk_base_progress, only: stop_progress
  use dotyk_base_version, only: build_type, compiler, version
  use dotyk_driver_arguments, only: arguments_t, read_arguments
  use dotyk_driver_run_case, only: run_case
  use dotyk_input_help, only: help_text, manual_text, reference_text
  use dotyk_output_hdf5_reason, only: start_hdf5
  use dotyk_ranks_communication, only: built_with, end_ranks, n_ranks, start_ranks, this_rank
  implicit none
  type(arguments_t) :: arguments
  type(error_t), allocatable :: error
  integer :: code
  call hold_standard_files()
  ! HDF5 must be there before MPI is: it would have MPI end it, too, and crash there with a file that could not be
  ! written.
  call start_hdf5()
  call start_ranks()
  call watch_ends()
  call watch_interrupts()
  if (n_ranks() > 1) call wait_for_agreement()
  call read_arguments(arguments, error)
  ! The first rank speaks for all.
  arguments%quiet = arguments%quiet .or. this_rank() > 0
  if (.not. allocated(error)) call execute_command()
  if (allocated(error)) then
    code = error%code
    call end_ranks(code, error%message)
  else
    call end_ranks(code)
  end if
  stop code, quiet=.true.

contains

  !> Print help, reference, manual page or version, or run a case.
  subroutine execute_command()
    code = exit_converged
    if (arguments%help) then
      call print_output(help_text())
    else if (arguments%reference) then
      call print_output(reference_text())
    else if (arguments%manual) then
      call print_output(manual_text())
    else if (arguments%version) then
      call print_output('dotyk '//version//' ('//compiler//', '//build_type//built_with//')')
    else
      call run_case(arguments, code, error)
      call stop_progress()
    end if
  end subroutine execute_command

  !> Print a text that the command line asked for.
  subroutine print_output(text)
    character(*), intent(in) :: text  !! The text.
    integer :: status
    if (this_rank() > 0) return
    call print_text(text//new_line('a'), status)
    if (status /= 0) call set_error(error, 'standard output cannot be written', exit_not_written)
  end subroutine print_output
end program dotyk
