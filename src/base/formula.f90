!> Formulas in x, y, z, such as '1e6*exp(-(x^2+y^2)/0.01)'. The only module that knows muParser.
!>
!> Constants are pi and e; `^` is power. A formula is one value: assignments and lists are refused.
module dotyk_base_formula
  use, intrinsic :: ieee_exceptions, only: ieee_get_halting_mode, ieee_set_flag, ieee_set_halting_mode, ieee_usual
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_null_char, c_null_ptr, &
    c_ptr, c_size_t
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: lower, quoted, to_text
  implicit none
  private

  !> A parsed formula. It owns its parser: it must not be copied, must be destroyed, and serves one thread at a time.
  type, public :: formula_t
    private
    type(c_ptr) :: handle = c_null_ptr  !! muParser's parser.
    real(c_double), pointer :: x(:) => null()  !! Coordinates x, y, z, which the parser reads here (3) [length].
  contains
    procedure :: init
    procedure :: is_set
    procedure :: evaluate
    procedure :: destroy
  end type formula_t

  integer(c_int), parameter :: base_type_real = 0  !! Base type of muParser: real numbers.
  integer(c_int), parameter :: unassignable_token = 1, unexpected_end = 2  !! Error codes that get a message of ours.

  integer, parameter :: longest = 20000  !! Longest formula; muParser's recursion is on the stack.
  !> Longest formula with a message of muParser, which quotes the formula in a buffer of 2048 bytes.
  integer, parameter :: longest_described = 900
  character(*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_'

  interface
    type(c_ptr) function mup_create(base_type) bind(c, name='mupCreate')
      import :: c_int, c_ptr
      integer(c_int), value :: base_type  !! Type of the values, `base_type_real`.
    end function mup_create
    subroutine mup_release(handle) bind(c, name='mupRelease')
      import :: c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
    end subroutine mup_release
    subroutine mup_set_expression(handle, text) bind(c, name='mupSetExpr')
      import :: c_char, c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
      character(c_char), intent(in) :: text(*)  !! Formula, ended by a null character.
    end subroutine mup_set_expression
    subroutine mup_define_variable(handle, name, variable) bind(c, name='mupDefineVar')
      import :: c_char, c_double, c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
      character(c_char), intent(in) :: name(*)  !! Name, ended by a null character.
      real(c_double) :: variable  !! Where the parser finds the value.
    end subroutine mup_define_variable
    subroutine mup_clear_constants(handle) bind(c, name='mupClearConst')
      import :: c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
    end subroutine mup_clear_constants
    subroutine mup_define_constant(handle, name, number) bind(c, name='mupDefineConst')
      import :: c_char, c_double, c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
      character(c_char), intent(in) :: name(*)  !! Name, ended by a null character.
      real(c_double), value :: number  !! Value.
    end subroutine mup_define_constant
    real(c_double) function mup_evaluate(handle) bind(c, name='mupEval')
      import :: c_double, c_ptr
      type(c_ptr), value :: handle
    end function mup_evaluate
    type(c_ptr) function mup_evaluate_list(handle, n) bind(c, name='mupEvalMulti')
      import :: c_int, c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
      integer(c_int), intent(out) :: n  !! Number of values.
    end function mup_evaluate_list
    integer(c_int) function mup_error(handle) bind(c, name='mupError')
      import :: c_int, c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
    end function mup_error
    integer(c_int) function mup_error_code(handle) bind(c, name='mupGetErrorCode')
      import :: c_int, c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
    end function mup_error_code
    integer(c_int) function mup_error_position(handle) bind(c, name='mupGetErrorPos')
      import :: c_int, c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
    end function mup_error_position
    type(c_ptr) function mup_error_message(handle) bind(c, name='mupGetErrorMsg')
      import :: c_ptr
      type(c_ptr), value :: handle  !! Parser of muParser.
    end function mup_error_message
    integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      type(c_ptr), value :: text  !! Text, ended by a null character.
    end function c_strlen
  end interface

contains

  !> Parse a formula.
  subroutine init(self, text, error)
    class(formula_t), intent(inout) :: self
    character(*), intent(in) :: text  !! The formula.
    !> Allocated where the formula has a mistake, with its column; the formula is not set then.
    type(error_t), allocatable, intent(out) :: error
    real(c_double), parameter :: pi = acos(-1.0_dp)
    logical :: halting(3)
    integer(c_int) :: n
    type(c_ptr) :: values
    call self%destroy()
    call check_characters(text, error)
    if (allocated(error)) return
    self%handle = mup_create(base_type_real)
    allocate (self%x(3), source=0.0_c_double)
    call mup_define_variable(self%handle, 'x'//c_null_char, self%x(1))
    call mup_define_variable(self%handle, 'y'//c_null_char, self%x(2))
    call mup_define_variable(self%handle, 'z'//c_null_char, self%x(3))
    ! The constant _pi of muParser has 12 digits.
    call mup_clear_constants(self%handle)
    call mup_define_constant(self%handle, 'pi'//c_null_char, pi)
    call mup_define_constant(self%handle, 'e'//c_null_char, exp(1.0_c_double))
    ! muParser parses at the first evaluation, and folds constants: 1/0 is not an error of the syntax.
    call pause_halting(halting)
    call mup_set_expression(self%handle, text//c_null_char)
    if (mup_error(self%handle) == 0) values = mup_evaluate_list(self%handle, n)
    call resume_halting(halting)
    if (mup_error(self%handle) /= 0) then
      call describe_error(self%handle, text, error)
    else if (n /= 1) then
      call set_error(error, to_text(int(n))//' values in '//quoted(text)//' (a formula is one value)')
    end if
    if (allocated(error)) call self%destroy()
  end subroutine init

  !> Whether a formula is set.
  pure logical function is_set(self)
    class(formula_t), intent(in) :: self
    is_set = c_associated(self%handle)
  end function is_set

  !> Value of the formula at a point; it may be infinite or NaN, which callers check [any].
  real(dp) function evaluate(self, x) result(value)
    class(formula_t), intent(in) :: self
    real(dp), intent(in) :: x(3)  !! The point (3) [length].
    logical :: halting(3)
    self%x = x
    call pause_halting(halting)
    value = mup_evaluate(self%handle)
    call resume_halting(halting)
  end function evaluate

  !> Release the parser; the formula is not set then.
  subroutine destroy(self)
    class(formula_t), intent(inout) :: self
    if (c_associated(self%handle)) call mup_release(self%handle)
    self%handle = c_null_ptr
    if (associated(self%x)) deallocate (self%x)
  end subroutine destroy

  !> Suspend floating-point traps: values that are not finite are results.
  subroutine pause_halting(halting)
    logical, intent(out) :: halting(3)  !! Whether each usual exception halts (3).
    call ieee_get_halting_mode(ieee_usual, halting)
    if (any(halting)) call ieee_set_halting_mode(ieee_usual, .false.)
  end subroutine pause_halting

  !> Undo `pause_halting`.
  subroutine resume_halting(halting)
    logical, intent(in) :: halting(3)  !! Exceptions that halt again (3).
    if (.not. any(halting)) return
    call ieee_set_flag(ieee_usual, .false.)
    call ieee_set_halting_mode(ieee_usual, halting)
  end subroutine resume_halting

  !> Report what is no single value of x, y, z: assignments, lists, texts.
  subroutine check_characters(text, error)
    character(*), intent(in) :: text  !! The formula.
    type(error_t), allocatable, intent(out) :: error  !! Where the formula is something else than one value of x, y, z.
    integer :: i
    if (len_trim(text) == 0) then
      call set_error(error, 'the formula is empty')
      return
    else if (len(text) > longest) then
      call set_error(error, 'the formula has '//to_text(len(text))//' letters, more than '//to_text(longest))
      return
    end if
    do i = 1, len(text)
      select case (text(i:i))
      case (' ':'!', '#':'<', '>':'~')
        if (text(i:min(i + 1, len(text))) == '**') then
          call set_error(error, at_column(i, text)//": '**' is not an operator (power is '^')")
          return
        end if
      case ('=')
        if (.not. in_comparison(text, i)) then
          call set_error(error, at_column(i, text)//": '=' assigns nothing here (equality is '==')")
          return
        end if
      case default
        call set_error(error, at_column(i, text)//': unexpected character')
        return
      end select
    end do
  end subroutine check_characters

  !> Whether a '=' is part of '==', '<=', '>=' or '!='.
  pure logical function in_comparison(text, i) result(inside)
    character(*), intent(in) :: text  !! The formula.
    integer, intent(in) :: i  !! Place of the '='.
    inside = .false.
    if (i > 1) inside = scan(text(i - 1:i - 1), '=<>!') > 0
    if (i < len(text)) inside = inside .or. text(i + 1:i + 1) == '='
  end function in_comparison

  !> Message for an error of muParser.
  subroutine describe_error(handle, text, error)
    type(c_ptr), intent(in) :: handle  !! Parser with an error.
    character(*), intent(in) :: text  !! The formula.
    type(error_t), allocatable, intent(out) :: error  !! The message; always allocated.
    character(:), allocatable :: message
    integer :: column, mark
    column = max(1, min(int(mup_error_position(handle)) + 1, len(text) + 1))
    select case (mup_error_code(handle))
    case (unassignable_token)
      message = 'unknown name or sign '//quoted(word_at(text, column))//' (known are x, y, z, pi, e, and '// &
                'functions with parentheses)'
    case (unexpected_end)
      message = 'the formula ends too early'
    case default
      message = 'the formula cannot be read from here on'
      if (len(text) <= longest_described) message = text_of_c(mup_error_message(handle))
      message = lower(message(:1))//message(2:)
      ! Its positions count from 0; the column is in front already.
      mark = max(index(message, ' at position '), index(message, ' at expression position '))
      if (mark > 0) message = message(:mark - 1)
    end select
    call set_error(error, at_column(column, text)//': '//message)
  end subroutine describe_error

  !> The name that begins at a column, or the sign there.
  pure function word_at(text, column) result(word)
    character(*), intent(in) :: text  !! The formula.
    integer, intent(in) :: column  !! Column, from 1.
    character(:), allocatable :: word
    integer, parameter :: most = 40
    integer :: last
    last = verify(text(min(column, len(text) + 1):), letters)
    if (last == 0) last = len(text) - column + 2
    last = min(column + max(last - 2, 0), len(text))
    word = text(column:min(last, column + most))
    if (last > column + most) word = word//'...'
  end function word_at

  !> "column 3 of 'x+*y'", or of the part of a long formula that is near.
  pure function at_column(column, text) result(place)
    integer, intent(in) :: column  !! Column, from 1.
    character(*), intent(in) :: text  !! The formula.
    character(:), allocatable :: place
    integer, parameter :: most = 60  ! letters on each side of the column
    integer :: first, last
    first = max(1, column - most)
    last = min(len(text), column + most)
    place = text(first:last)
    if (first > 1) place = '...'//place
    if (last < len(text)) place = place//'...'
    place = 'column '//to_text(column)//' of '//quoted(place)
  end function at_column

  !> A copy of a C text.
  function text_of_c(pointer) result(text)
    type(c_ptr), intent(in) :: pointer  !! Text of C, ended by a null character.
    character(:), allocatable :: text
    character(c_char), pointer :: letters(:)
    integer :: i, n
    text = ''
    if (.not. c_associated(pointer)) return
    n = int(c_strlen(pointer))
    call c_f_pointer(pointer, letters, [n])
    do i = 1, n
      text = text//letters(i)
    end do
  end function text_of_c
end module dotyk_base_formula
