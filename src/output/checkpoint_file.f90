!> A checkpoint: the state of an iteration in a file, HDF5 with a line behind its end that has a checksum of all before it.
!>
!> The checksum is looked at before HDF5 sees the file, so that files that were cut short, damaged or are something else altogether are
!> told from each other, and no damage gets into an iteration. Written to a temporary name and renamed: whole or absent.
module dotyk_output_checkpoint_file
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use dotyk_base_error, only: error_t, add_context, exit_bad_input, exit_not_written, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_mesh_bytes, only: byte_cursor_t
  use dotyk_mesh_content_hash, only: content_hash_t
  use dotyk_output_file_system, only: delete_file, replace_file, temporary_name
  use dotyk_output_hdf5, only: hdf5_file_t
  use dotyk_output_hdf5_read, only: hdf5_source_t
  implicit none
  private

  !> What a checkpoint holds.
  type, public :: checkpoint_t
    !> Version of the program, name of the scheme, and how far it is: one of the names of `ending_name`, or 'running'.
    character(:), allocatable :: version, scheme, status
    !> What the scene is made of, one line for each part: what it is, a '|', and a hash of what matters of it.
    character(:), allocatable :: scene
    !> Pressures of all contact points [pressure], and whether to take them for closed (1) or open (0) where it goes on (n_rows).
    real(dp), allocatable :: pressure(:)
    integer(int64), allocatable :: closed(:)
    !> Amplitudes of the free motions of the bodies [length].
    real(dp), allocatable :: alpha(:)
    !> Penalty parameter of each pair before it was made smaller [length/pressure], and by what factor it was (n_pairs).
    real(dp), allocatable :: theta(:), theta_factor(:)
    !> Tolerance of the answer that is under way, and upper estimate of L, 0 if there is none.
    real(dp) :: tolerance = 0, lambda_max = 0
    !> Steps so far (8, n): seconds, increment, error_bound, error_penalty, error_discretization, energy, max_penetration, active.
    real(dp), allocatable :: history(:, :)
  contains
    procedure :: write => checkpoint_write
    procedure :: read => checkpoint_read
  end type checkpoint_t

  public :: is_checkpoint

  !> The last line: this, the 16 digits of the checksum, an end of line.
  character(*), parameter :: mark = new_line('a')//'dotyk checkpoint '
  integer, parameter :: mark_length = len(mark) + 17
  !> Columns of the history.
  integer, parameter, public :: n_columns = 8
  !> Of the layout of the file.
  integer, parameter :: layout = 1

contains

  !> Write a file, in place of an older one.
  subroutine checkpoint_write(self, path, error)
    class(checkpoint_t), intent(in) :: self
    character(*), intent(in) :: path
    !> Exit code `exit_not_written`; an older file is as it was.
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(hdf5_file_t) :: file
    character(:), allocatable :: temporary
    temporary = temporary_name(path)
    call file%create(temporary, error, label=path)
    if (.not. allocated(error)) call put_all(self, file, error)
    if (allocated(error)) then
      call file%close(ignored)
    else
      call file%close(error)
    end if
    if (.not. allocated(error)) call append_mark(temporary, path, error)
    if (.not. allocated(error)) call replace_file(temporary, path, error)
    if (allocated(error)) call delete_file(temporary)
  end subroutine checkpoint_write

  !> All that the file holds.
  subroutine put_all(self, file, error)
    type(checkpoint_t), intent(in) :: self
    type(hdf5_file_t), intent(in) :: file
    type(error_t), allocatable, intent(out) :: error
    character(*), parameter :: group = '/checkpoint'
    call file%add_group(group, error)
    if (.not. allocated(error)) call file%put_attribute(group, 'layout', layout, error)
    if (.not. allocated(error)) call file%put_attribute(group, 'version', self%version, error)
    if (.not. allocated(error)) call file%put_attribute(group, 'scheme', self%scheme, error)
    if (.not. allocated(error)) call file%put_attribute(group, 'status', self%status, error)
    if (.not. allocated(error)) call file%put_attribute(group, 'scene', self%scene, error)
    if (.not. allocated(error)) call file%put_attribute(group, 'steps', size(self%history, 2), error)
    if (.not. allocated(error)) call file%put_attribute(group, 'tolerance', self%tolerance, error)
    if (.not. allocated(error)) call file%put_attribute(group, 'lambda_max', self%lambda_max, error)
    if (.not. allocated(error)) call file%put_dataset(group//'/pressure', self%pressure, error)
    if (.not. allocated(error)) call file%put_dataset(group//'/closed', self%closed, error)
    if (.not. allocated(error)) call file%put_dataset(group//'/alpha', self%alpha, error)
    if (.not. allocated(error)) call file%put_dataset(group//'/theta', self%theta, error)
    if (.not. allocated(error)) call file%put_dataset(group//'/theta_factor', self%theta_factor, error)
    if (.not. allocated(error)) call file%put_dataset(group//'/history', self%history, error)
  end subroutine put_all

  !> Put the last line behind a file.
  subroutine append_mark(temporary, path, error)
    character(*), intent(in) :: temporary, path
    type(error_t), allocatable, intent(out) :: error
    type(byte_cursor_t) :: cursor
    type(content_hash_t) :: hash
    character(200) :: message
    integer :: unit, status, ignored
    call cursor%load(temporary, error)
    if (allocated(error)) then
      error%code = exit_not_written
      return
    end if
    call hash%add(cursor%text(:cursor%size))
    open (newunit=unit, file=temporary, access='stream', form='unformatted', position='append', action='write', status='old', &
          iostat=status, iomsg=message)
    if (status == 0) then
      write (unit, iostat=status, iomsg=message) mark//hash%digits()//new_line('a')
      if (status == 0) flush (unit, iostat=status, iomsg=message)
      close (unit, iostat=ignored)
      if (status == 0) status = ignored
    end if
    if (status /= 0) call set_error(error, quoted(path)//' cannot be written: '//trim(message), exit_not_written)
  end subroutine append_mark

  !> Whether a file looks like a checkpoint of this program, whole or not; false where there is none.
  logical function is_checkpoint(path)
    character(*), intent(in) :: path
    character(mark_length) :: tail
    integer(int64) :: length
    integer :: unit, status
    is_checkpoint = .false.
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read', status='old', iostat=status)
    if (status /= 0) return
    inquire (unit=unit, size=length)
    if (length > mark_length) then
      read (unit, pos=length - mark_length + 1, iostat=status) tail
      is_checkpoint = status == 0 .and. index(tail, mark) == 1
    end if
    close (unit, iostat=status)
  end function is_checkpoint

  !> Read a file.
  subroutine checkpoint_read(self, path, error)
    class(checkpoint_t), intent(out) :: self
    character(*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(hdf5_source_t) :: source
    call check_mark(path, error)
    if (allocated(error)) return
    call source%open(path, error)
    if (allocated(error)) return
    call get_all(self, source, error)
    call source%close()
    if (.not. allocated(error)) call check_shapes(self, error)
    call add_context(error, 'checkpoint '//quoted(path)//': ')
  end subroutine checkpoint_read

  !> Refuse files that are something else, or not what was written once.
  subroutine check_mark(path, error)
    character(*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(byte_cursor_t) :: cursor
    type(content_hash_t) :: hash
    character(*), parameter :: signature = 'HDF'
    integer(int64) :: length
    call cursor%load(path, error)
    if (allocated(error)) then
      error%message = 'checkpoint '//error%message
      return
    end if
    length = cursor%size - mark_length
    if (length > 0) then
      if (index(cursor%text(length + 1:cursor%size), mark) == 1) then
        call hash%add(cursor%text(:length))
        if (cursor%text(length + len(mark) + 1:cursor%size - 1) /= hash%digits()) call set_error(error, 'checkpoint '// &
          quoted(path)//' is damaged: its bytes are not those that were written; start without --restart', exit_bad_input)
        return
      end if
    end if
    if (index(cursor%text(:min(4_int64, cursor%size)), signature) == 2) then
      call set_error(error, quoted(path)//' is no checkpoint of dotyk, or the end of one is missing', exit_bad_input)
    else
      call set_error(error, quoted(path)//' is no checkpoint of dotyk', exit_bad_input)
    end if
  end subroutine check_mark

  !> All that the file holds.
  subroutine get_all(self, source, error)
    class(checkpoint_t), intent(inout) :: self
    type(hdf5_source_t), intent(in) :: source
    type(error_t), allocatable, intent(out) :: error
    character(*), parameter :: group = '/checkpoint'
    integer(int64), allocatable :: number(:)
    real(dp), allocatable :: value(:)
    call source%get_attribute(group, 'layout', number, error)
    if (.not. allocated(error)) then
      if (number(1) /= layout) call set_error(error, 'it has layout '//to_text(number(1))//', and this version of dotyk reads '// &
                                              to_text(layout))
    end if
    if (.not. allocated(error)) call source%get_text(group, 'version', self%version, error)
    if (.not. allocated(error)) call source%get_text(group, 'scheme', self%scheme, error)
    if (.not. allocated(error)) call source%get_text(group, 'status', self%status, error)
    if (.not. allocated(error)) call source%get_text(group, 'scene', self%scene, error)
    if (.not. allocated(error)) call source%get_attribute(group, 'tolerance', value, error)
    if (.not. allocated(error)) self%tolerance = value(1)
    if (.not. allocated(error)) call source%get_attribute(group, 'lambda_max', value, error)
    if (.not. allocated(error)) self%lambda_max = value(1)
    if (.not. allocated(error)) call source%get_dataset(group//'/pressure', self%pressure, error)
    if (.not. allocated(error)) call source%get_dataset(group//'/closed', self%closed, error)
    if (.not. allocated(error)) call source%get_dataset(group//'/alpha', self%alpha, error)
    if (.not. allocated(error)) call source%get_dataset(group//'/theta', self%theta, error)
    if (.not. allocated(error)) call source%get_dataset(group//'/theta_factor', self%theta_factor, error)
    if (.not. allocated(error)) call source%get_dataset(group//'/history', self%history, error)
  end subroutine get_all

  !> Arrays that belong together are of one length, and numbers are such as a scene can have.
  subroutine check_shapes(self, error)
    class(checkpoint_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error
    !> Thetas become smaller by a few factors of ten.
    real(dp), parameter :: least_factor = 1.0e-30_dp
    logical :: fits
    if (size(self%pressure) /= size(self%closed) .or. size(self%theta) /= size(self%theta_factor) .or. &
        size(self%history, 1) /= n_columns) then
      call set_error(error, 'its arrays do not fit together')
      return
    end if
    fits = are_usual([abs(self%pressure), abs(self%alpha), self%theta, self%theta_factor, self%tolerance, self%lambda_max]) .and. &
      are_usual(self%history(n_columns, :)) .and. all(ieee_is_finite(self%history([1, 2, 3, 6, 7, 8], :))) .and. &
      all(ieee_is_finite(self%history(4:5, :)) .or. ieee_is_nan(self%history(4:5, :)))
    if (fits) fits = all(self%theta_factor >= least_factor)
    if (.not. fits) call set_error(error, 'it holds numbers that none of its kind can have')
  end subroutine check_shapes

  !> Whether numbers are such as a scene can have: those of the input are below 1e40, and what grows until it is seen to diverge must not overflow.
  pure logical function are_usual(values)
    real(dp), intent(in) :: values(:)
    real(dp), parameter :: largest = 1.0e60_dp
    are_usual = all(ieee_is_finite(values))
    if (are_usual) are_usual = all(values >= 0 .and. values <= largest)
  end function are_usual
end module dotyk_output_checkpoint_file
