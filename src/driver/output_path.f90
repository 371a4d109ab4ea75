!> The path of the results file.
module dotyk_driver_output_path
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: behind_links
  use dotyk_input_case, only: case_t
  use dotyk_output_file_system, only: check_replaceable, check_writable
  use dotyk_ranks_communication, only: this_rank
  implicit none
  private
  public :: prepare_output

contains

  !> The path of the results file; refuse one that cannot be written before anything is computed.
  subroutine prepare_output(case, output, error)
    type(case_t), intent(inout) :: case  !! The case; its path of the results file is set.
    character(*), intent(in) :: output  !! Path from the command line; empty for that of the case.
    !> Allocated where the file cannot be written, or where another file would be replaced.
    type(error_t), allocatable, intent(out) :: error
    if (len(output) > 0) case%scene%output = output
    ! A new file takes the place of an old one, not that of a link to it.
    case%scene%output = behind_links(case%scene%output)
    ! The first rank writes.
    if (this_rank() > 0) return
    call check_writable(case%scene%output, error)
    if (.not. allocated(error)) call check_replaceable(case%scene%output, error)
  end subroutine prepare_output
end module dotyk_driver_output_path
