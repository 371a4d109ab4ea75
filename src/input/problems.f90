!> Problems of a namelist file, gathered in any order and reported in the order of its lines.
module dotyk_input_problems
  use dotyk_base_error, only: error_t, problem_list_t
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: text_t, to_text
  implicit none
  private

  type, public :: problems_t  !! All the problems of one file.
    character(:), allocatable :: file  !! Name of the file, as in the messages.
    integer :: count = 0  !! Number of problems.
    integer, allocatable :: line(:)  !! Lines of the file; the first `count` are in use (n_allocated).
    type(text_t), allocatable :: message(:)  !! Messages without place; the first `count` are in use (n_allocated).
  contains
    procedure :: init => problems_init
    procedure :: add => problems_add
    procedure :: raise => problems_raise
  end type problems_t

  integer, parameter, public :: no_line = huge(1)  !! Line of a problem of the whole file; it is reported last.

contains

  !> Start an empty list.
  subroutine problems_init(self, file)
    class(problems_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Name of the file.
    self%file = file
    self%count = 0
    if (allocated(self%line)) deallocate (self%line, self%message)
    allocate (self%line(8), self%message(8))
  end subroutine problems_init

  !> Add a problem.
  subroutine problems_add(self, line, message)
    class(problems_t), intent(inout) :: self
    integer, intent(in) :: line  !! Line of the file, or `no_line`.
    character(*), intent(in) :: message  !! What is wrong.
    integer, allocatable :: lines(:)
    type(text_t), allocatable :: messages(:)
    integer :: i
    if (self%count == size(self%line)) then
      allocate (lines(2*self%count), messages(2*self%count))
      lines(:self%count) = self%line
      do i = 1, self%count
        call move_alloc(self%message(i)%s, messages(i)%s)
      end do
      call move_alloc(lines, self%line)
      call move_alloc(messages, self%message)
    end if
    self%count = self%count + 1
    self%line(self%count) = line
    self%message(self%count)%s = message
  end subroutine problems_add

  !> Make one error of the list.
  subroutine problems_raise(self, error)
    class(problems_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the list is not empty.
    type(problem_list_t) :: list
    integer, allocatable :: order(:)
    integer :: i, k
    allocate (order(self%count))
    call sort_order(self%line(:self%count), order)
    do i = 1, self%count
      k = order(i)
      if (self%line(k) == no_line) then
        call list%add(self%file//': '//self%message(k)%s)
      else
        call list%add(self%file//':'//to_text(self%line(k))//': '//self%message(k)%s)
      end if
    end do
    call list%raise(error)
  end subroutine problems_raise
end module dotyk_input_problems
