!> Memory of the machine, what of it may be taken to save time, and the current stage of work for messages about an
!> unexpected end.
module dotyk_base_memory
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_null_char, c_ptr, c_size_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: memory_now, memory_text, peak_memory, set_stage, stage_text, set_item, watch_ends, end_expected

  type, public :: memory_t  !! Memory in use and left.
    real(dp) :: used = 0  !! Memory in use by this process [bytes].
    real(dp) :: left = 0  !! Memory that it can still get [bytes].
    logical :: is_known = .false.  !! Whether `left` is known.
    character(:), allocatable :: limit  !! Limit of the memory, as in "of the machine".
  end type memory_t


  interface
    subroutine c_memory(used, left, limit) bind(c, name='dotyk_memory')
      import :: c_double, c_int
      real(c_double), intent(out) :: used  !! Memory in use [bytes].
      real(c_double), intent(out) :: left  !! Memory that is left [bytes].
      integer(c_int), intent(out) :: limit  !! 0 unknown, 1 machine, 2 container or batch job, 3 process.
    end subroutine c_memory

    !> Largest memory that the process has had so far [bytes].
    real(c_double) function peak_memory() bind(c, name='dotyk_peak_memory')
      import :: c_double
    end function peak_memory

    subroutine c_set_stage(text) bind(c, name='dotyk_set_stage')
      import :: c_char
      character(kind=c_char), intent(in) :: text(*)  !! Text, ended by a null character.
    end subroutine c_set_stage

    type(c_ptr) function c_stage() bind(c, name='dotyk_stage')
      import :: c_ptr
    end function c_stage

    pure integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      type(c_ptr), value, intent(in) :: text  !! Text, ended by a null character.
    end function c_strlen

    subroutine c_set_item(text) bind(c, name='dotyk_set_item')
      import :: c_char
      character(kind=c_char), intent(in) :: text(*)  !! Text, ended by a null character.
    end subroutine c_set_item

    !> From here on an unexpected end of the program gets a message and an exit code.
    subroutine watch_ends() bind(c, name='dotyk_watch_ends')
    end subroutine watch_ends

    !> The program is about to end as planned.
    subroutine end_expected() bind(c, name='dotyk_end_expected')
    end subroutine end_expected
  end interface

  type, public :: allowance_t  !! An allowance; nothing at first.
    integer(int64) :: left = 0  !! Memory that may still be taken [bytes].
  contains
    procedure :: take => allowance_take
  end type allowance_t

contains

  !> Memory in use and left.
  function memory_now() result(memory)
    type(memory_t) :: memory
    integer(c_int) :: limit
    call c_memory(memory%used, memory%left, limit)
    memory%is_known = limit > 0
    select case (limit)
    case (1)
      memory%limit = 'of the machine'
    case (2)
      memory%limit = 'of the container or batch job'
    case (3)
      memory%limit = 'of the process (ulimit -v)'
    case default
      memory%limit = ''
    end select
  end function memory_now

  !> Memory in MiB or GiB.
  function memory_text(bytes) result(text)
    real(dp), intent(in) :: bytes  !! Memory [bytes].
    character(:), allocatable :: text
    if (bytes < 1.0e4_dp*1048576) then
      text = to_text(max(1, nint(bytes/1048576)))//' MiB'
    else
      text = to_text(bytes/1073741824, 3)//' GiB'
    end if
  end function memory_text

  !> Set the stage of work, as in "assembling".
  subroutine set_stage(what)
    character(*), intent(in) :: what  !! Work of the program, as in "assembling".
    call c_set_stage(what//c_null_char)
  end subroutine set_stage

  !> Stage of work.
  function stage_text() result(text)
    character(:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer :: i
    call c_f_pointer(c_stage(), letters, [c_strlen(c_stage())])
    text = repeat(' ', size(letters))
    do i = 1, len(text)
      text(i:i) = letters(i)
    end do
  end function stage_text

  !> Set the item that this thread works on.
  subroutine set_item(what)
    character(*), intent(in) :: what  !! Work of the thread, as in "body 'upper'"; empty for none.
    call c_set_item(what//c_null_char)
  end subroutine set_item

  !> Take memory where there is enough, from any thread; whether there is.
  logical function allowance_take(self, bytes) result(granted)
    class(allowance_t), intent(inout) :: self
    integer(int64), intent(in) :: bytes  !! Memory [bytes].
    !$omp critical (allowance)
    granted = self%left >= bytes
    if (granted) self%left = self%left - bytes
    !$omp end critical (allowance)
  end function allowance_take
end module dotyk_base_memory
