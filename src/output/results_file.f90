!> The results file (docs/results.md): meshes and fields of `/VTKHDF` (`dotyk_output_fields_file`), and `/dotyk`.
!> It is written under a temporary name and renamed by `commit`: complete or absent; an older one stays until then. All
!> errors have the exit code `exit_not_written`.
module dotyk_output_results_file
  use dotyk_base_error, only: error_t
  use dotyk_output_fields_file, only: connectivity_length, fields_file_t
  use dotyk_output_file_system, only: check_writable, replace_file
  use dotyk_output_results_layout, only: create_result_groups
  implicit none
  private

  !> A results file being written. Groups are relative to `/dotyk`, or to that of a load case: '', 'summary', 'timing',
  !> 'history', contact_group(name). The first failure is reported by `commit`.
  type, extends(fields_file_t), public :: results_file_t
  contains
    procedure :: begin_case => results_begin_case
    procedure :: end_cases => results_end_cases
    procedure :: commit => results_commit
  end type results_file_t

  public :: check_writable, connectivity_length, contact_group

contains

  !> Group of a contact pair below `/dotyk`.
  pure function contact_group(name) result(group)
    character(*), intent(in) :: name  !! Name of the contact pair.
    character(:), allocatable :: group
    integer :: i
    group = trim(name)
    ! '/' separates groups, and '.' is the group itself.
    do i = 1, len(group)
      if (group(i:i) == '/') group(i:i) = '_'
    end do
    if (group == '.') group = '_'
    group = 'contact/'//group
  end function contact_group

  !> What follows is of a load case.
  subroutine results_begin_case(self, step, name)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: step  !! Number of the case.
    character(*), intent(in) :: name  !! Its name.
    self%step = step
    self%root = '/dotyk/cases/'//name
    call self%add_group('')
    call create_result_groups(self)
    call self%put_attribute('', 'step', step)
  end subroutine results_begin_case

  !> What follows is of all load cases.
  subroutine results_end_cases(self, names, n_written, n_cases)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: names  !! Names of the cases that were written, separated by line feeds.
    integer, intent(in) :: n_written  !! Their number.
    integer, intent(in) :: n_cases  !! Number of those of the scene: more where the run was interrupted.
    self%root = '/dotyk'
    call self%finish_steps(n_written)
    call self%put_attribute('cases', 'names', names)
    call self%put_attribute('cases', 'n_missing', n_cases - n_written)
  end subroutine results_end_cases

  !> Finish the file and rename it, in place of an older one; where a write has failed, the file is deleted.
  subroutine results_commit(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call self%close(error)
    if (.not. allocated(error)) call replace_file(self%temporary, self%path, error)
    if (allocated(error)) call self%discard()
  end subroutine results_commit
end module dotyk_output_results_file
