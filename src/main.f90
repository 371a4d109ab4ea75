!> dotyk: frictionless contact of linear elastic bodies.
program dotyk
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: hold_standard_files
  use dotyk_base_interrupt, only: wait_for_agreement, watch_interrupts
  use dotyk_base_memory, only: watch_ends
  use dotyk_driver_arguments, only: arguments_t, read_arguments
  use dotyk_driver_command, only: execute_command, start_libraries
  use dotyk_ranks_communication, only: end_ranks, n_ranks, start_ranks, this_rank
  implicit none
  type(arguments_t) :: arguments
  type(error_t), allocatable :: error
  integer :: code
  call hold_standard_files()
  call start_libraries()
  call start_ranks()
  call watch_ends()
  call watch_interrupts()
  if (n_ranks() > 1) call wait_for_agreement()
  call read_arguments(arguments, error)
  ! The first rank speaks for all.
  arguments%quiet = arguments%quiet .or. this_rank() > 0
  if (.not. allocated(error)) call execute_command(arguments, code, error)
  if (allocated(error)) then
    code = error%code
    call end_ranks(code, error%message)
  else
    call end_ranks(code)
  end if
  stop code, quiet=.true.
end program dotyk
