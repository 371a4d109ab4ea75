!> Errors as values: a message for the user and the exit code that it leads to.
!>
!> A procedure that can fail has `type(error_t), allocatable, intent(out) :: error` as its last argument; it is
!> allocated exactly when the procedure failed. Callers add context; only `main` stops the program.
module dotyk_base_error
  use dotyk_base_text, only: to_text
  implicit none
  private

  !> Exit codes of the program.
  integer, parameter, public :: exit_converged = 0      !< solved to the tolerance
  integer, parameter, public :: exit_not_converged = 1  !< stopped before the tolerance; results written and marked
  integer, parameter, public :: exit_bad_input = 2      !< something the user wrote cannot be read or used
  integer, parameter, public :: exit_not_solvable = 3   !< the problem cannot be solved as posed
  integer, parameter, public :: exit_not_written = 4    !< a file could not be written
  integer, parameter, public :: exit_machine = 5        !< out of memory, or another failure of the machine

  !> What an error is about whose place in the case file the one who raises it does not know.
  integer, parameter, public :: about_nothing = 0  !< the message says it
  integer, parameter, public :: about_solver = 1  !< the settings of `&solver`
  integer, parameter, public :: about_case = 2  !< something that the message names

  type, public :: error_t  !! What went wrong.
    !> Text for the user with file, line, body, surface or element, and with advice; maybe of several lines.
    character(:), allocatable :: message
    integer :: code = exit_bad_input  !! One of the exit codes above, never `exit_converged`.
    integer :: about = about_nothing  !! One of `about_*`.
  end type error_t

  type, public :: error_slot_t  !! Error of one item of a parallel loop.
    type(error_t), allocatable :: error  !! Allocated where the item failed.
  end type error_slot_t

  type, public :: problem_list_t  !! All the problems of one stage, reported together.
    integer :: count = 0  !! Number of problems.
    integer, private :: n_repeated = 0  !! Number of those that were in the list already.
    character(:), allocatable :: messages  !! Their messages, one a line.
    integer :: code = exit_bad_input  !! Exit code of the first problem.
  contains
    procedure :: add => problem_list_add
    procedure :: add_error => problem_list_add_error
    procedure :: raise => problem_list_raise
  end type problem_list_t

  public :: set_error, add_context

  integer, parameter :: most_listed = 50  !! Greatest number of problems in the message; further ones are counted.

contains

  !> Make an error.
  subroutine set_error(error, message, code, about)
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return.
    character(*), intent(in) :: message  !! Message for the user.
    integer, intent(in), optional :: code  !! Exit code; `exit_bad_input` if absent.
    integer, intent(in), optional :: about  !! What it is about, one of `about_*`; `about_nothing` if absent.
    allocate (error)
    error%message = message
    if (present(code)) error%code = code
    if (present(about)) error%about = about
  end subroutine set_error

  !> Put context in front of the message of an error, as in "body 'upper': ".
  subroutine add_context(error, context)
    type(error_t), allocatable, intent(inout) :: error  !! The error; nothing happens where it is not allocated.
    character(*), intent(in) :: context  !! Text to put in front.
    if (allocated(error)) error%message = context//error%message
  end subroutine add_context

  !> Add a problem to the list. One that is there already counts, but is told once: two halves of a body have the same.
  subroutine problem_list_add(self, message, code)
    class(problem_list_t), intent(inout) :: self
    character(*), intent(in) :: message  !! Message for the user.
    integer, intent(in), optional :: code  !! Exit code; `exit_bad_input` if absent. The list has that of the first.
    character(*), parameter :: end_of_line = new_line('a')
    self%count = self%count + 1
    if (self%count > 1 .and. self%count - self%n_repeated <= most_listed) then
      if (index(end_of_line//self%messages//end_of_line, end_of_line//message//end_of_line) > 0) then
        self%n_repeated = self%n_repeated + 1
        return
      end if
    end if
    if (self%count == 1) then
      self%messages = message
      if (present(code)) self%code = code
    else if (self%count - self%n_repeated <= most_listed) then
      self%messages = self%messages//end_of_line//message
    end if
  end subroutine problem_list_add

  !> Add an error to the list, where there is one; it is deallocated.
  subroutine problem_list_add_error(self, error, context)
    class(problem_list_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error  !! The error, not allocated on return.
    character(*), intent(in), optional :: context  !! Text before its message, as "body 'upper': "; none if absent.
    if (.not. allocated(error)) return
    if (present(context)) call add_context(error, context)
    call self%add(error%message, error%code)
    deallocate (error)
  end subroutine problem_list_add_error

  !> Turn the list into one error, if it has any problem.
  subroutine problem_list_raise(self, error)
    class(problem_list_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the list is not empty.
    if (self%count == 0) return
    call set_error(error, self%messages, self%code)
    if (self%count - self%n_repeated > most_listed) &
      error%message = error%message//new_line('a')//'and '//to_text(self%count - self%n_repeated - most_listed)// &
                      ' more problems'
  end subroutine problem_list_raise
end module dotyk_base_error
