!> dotyk: frictionless contact of linear elastic bodies.
program dotyk
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: hold_standard_files
  use dotyk_base_interrupt, only: watch_interrupts
  use dotyk_base_memory, only: end_expected, watch_ends
  use dotyk_base_log, only: print_error
  use dotyk_driver_arguments, only: arguments_t, read_arguments
  use dotyk_driver_command, only: execute_command
  implicit none
  type(arguments_t) :: arguments
  type(error_t), allocatable :: error
  integer :: code
  call hold_standard_files()
  call watch_ends()
  call watch_interrupts()
  call read_arguments(arguments, error)
  if (.not. allocated(error)) call execute_command(arguments, code, error)
  if (allocated(error)) then
    call print_error(error%message)
    code = error%code
  end if
  call end_expected()
  stop code, quiet=.true.
end program dotyk
