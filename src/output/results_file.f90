!> The results file (docs/results.md): meshes and fields of `/VTKHDF` (`dotyk_output_fields_file`), and `/dotyk`.
!> It is written under a temporary name and renamed by `commit`: complete or absent; an older one stays until then. All
!> errors have the exit code `exit_not_written`.
module dotyk_output_results_file
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_output_fields_file, only: connectivity_length, fields_file_t
  use dotyk_output_file_system, only: check_writable, replace_file
  use dotyk_output_results_layout, only: create_result_groups, with_three_components
  implicit none
  private

  type, extends(fields_file_t), public :: results_file_t  !! A results file being written.
    character(:), allocatable :: root  !! Group of the results, `/dotyk` where not allocated: a load case has its own.
  contains
    procedure :: begin_case => results_begin_case
    procedure :: end_cases => results_end_cases
    procedure :: add_group => results_add_group
    procedure, private :: put_text, put_integer, put_long, put_real, put_logical, put_reals
    !> put_attribute(group, name, value): `group` is relative to `/dotyk`: '', 'summary', 'timing', contact_group(name).
    !> Values: text, integers (32 and 64 bits), real, logical (0 or 1), real vector. A failure is reported by `commit`.
    generic :: put_attribute => put_text, put_integer, put_long, put_real, put_logical, put_reals
    procedure, private :: array_real, array_integer, array_long, array_vectors
    !> put_array(group, name, values): numbers (n), or real vectors (2 or 3, n), stored with three components. `group`
    !> is relative to `/dotyk`: 'history', contact_group(name). A failure is reported by `commit`.
    generic :: put_array => array_real, array_integer, array_long, array_vectors
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
  subroutine results_begin_case(self, step, name, error)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: step  !! Number of the case.
    character(*), intent(in) :: name  !! Its name.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    self%step = step
    self%root = '/dotyk/cases/'//name
    call self%file%add_group(self%root, error)
    if (.not. allocated(error)) call create_result_groups(self%file, self%root, error)
    if (.not. allocated(error)) call self%file%put_attribute(self%root, 'step', step, error)
  end subroutine results_begin_case

  !> What follows is of all load cases.
  subroutine results_end_cases(self, names, n_written, n_cases, error)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: names  !! Names of the cases that were written, separated by line feeds.
    integer, intent(in) :: n_written  !! Their number.
    integer, intent(in) :: n_cases  !! Number of those of the scene: more where the run was interrupted.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    deallocate (self%root)
    call self%finish_steps(n_written, error)
    if (.not. allocated(error)) call self%file%put_attribute('/dotyk/cases', 'names', names, error)
    if (.not. allocated(error)) call self%file%put_attribute('/dotyk/cases', 'n_missing', n_cases - n_written, error)
  end subroutine results_end_cases

  !> Add the group of a contact pair; `commit` reports a failure.
  subroutine results_add_group(self, group)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Path of the group below /dotyk.
    if (allocated(self%failure)) return
    call self%file%add_group(dotyk_path(self, group), self%failure)
  end subroutine results_add_group

  !> Path in the file of a group below `/dotyk`.
  pure function dotyk_path(self, group) result(path)
    class(results_file_t), intent(in) :: self
    character(*), intent(in) :: group  !! Path of the group below /dotyk; empty for /dotyk itself.
    character(:), allocatable :: path
    path = '/dotyk'
    if (allocated(self%root)) path = self%root
    if (len(group) > 0) path = path//'/'//group
  end function dotyk_path

  !> Write a text as attribute.
  subroutine put_text(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the attribute.
    character(*), intent(in) :: value  !! Its text.
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(self, group), name, value, self%failure)
  end subroutine put_text

  !> Write an integer as attribute.
  subroutine put_integer(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the attribute.
    integer(int32), intent(in) :: value  !! Value of the attribute.
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(self, group), name, value, self%failure)
  end subroutine put_integer

  !> Write a 64-bit integer as attribute.
  subroutine put_long(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the attribute.
    integer(int64), intent(in) :: value  !! Value of the attribute.
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(self, group), name, value, self%failure)
  end subroutine put_long

  !> Write a real as attribute.
  subroutine put_real(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the attribute.
    real(dp), intent(in) :: value  !! Value of the attribute [any].
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(self, group), name, value, self%failure)
  end subroutine put_real

  !> Write a logical as attribute.
  subroutine put_logical(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the attribute.
    logical, intent(in) :: value  !! Its value; 1 for true in the file.
    call self%put_integer(group, name, merge(1, 0, value))
  end subroutine put_logical

  !> Write reals as attribute.
  subroutine put_reals(self, group, name, value)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the attribute.
    real(dp), intent(in), contiguous :: value(:)  !! Values of the attribute (n) [any].
    if (allocated(self%failure)) return
    call self%file%put_attribute(dotyk_path(self, group), name, value, self%failure)
  end subroutine put_reals

  !> Write a dataset of reals.
  subroutine array_real(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the dataset.
    real(dp), intent(in), contiguous :: values(:)  !! Values (n) [any].
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(self, group)//'/'//name, values, self%failure)
  end subroutine array_real

  !> Write a dataset of 32-bit integers.
  subroutine array_integer(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the dataset.
    integer(int32), intent(in), contiguous :: values(:)  !! Values (n).
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(self, group)//'/'//name, values, self%failure)
  end subroutine array_integer

  !> Write a dataset of 64-bit integers.
  subroutine array_long(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the dataset.
    integer(int64), intent(in), contiguous :: values(:)  !! Values (n).
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(self, group)//'/'//name, values, self%failure)
  end subroutine array_long

  !> Write a dataset of vectors, with three components.
  subroutine array_vectors(self, group, name, values)
    class(results_file_t), intent(inout) :: self
    character(*), intent(in) :: group  !! Group below /dotyk.
    character(*), intent(in) :: name  !! Name of the dataset.
    real(dp), intent(in), contiguous :: values(:, :)  !! Vectors (width, n) [any].
    if (allocated(self%failure)) return
    call self%file%put_dataset(dotyk_path(self, group)//'/'//name, with_three_components(values), self%failure)
  end subroutine array_vectors

  !> Finish the file and rename it, in place of an older one; where a write has failed, the file is deleted.
  subroutine results_commit(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    if (allocated(self%failure)) then
      call move_alloc(self%failure, error)
    else
      call self%file%close(error)
      if (.not. allocated(error)) call replace_file(self%temporary, self%path, error)
    end if
    if (allocated(error)) call self%discard()
  end subroutine results_commit
end module dotyk_output_results_file
