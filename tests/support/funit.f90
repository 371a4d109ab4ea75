!> The small test runner's half of pFUnit's interface: assertions under pFUnit's names. `pf.py` writes the calls, with
!> each value wrapped in `funit_value` and the line number added. Arrays are compared element by element.
module funit
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use, intrinsic :: iso_fortran_env, only: real64, int32, int64
  implicit none
  private

  type :: value_t  !! Any value that can be compared: its shape and one of the other three.
    integer, allocatable :: shape(:)
    integer(int64), allocatable :: integers(:)
    real(real64), allocatable :: reals(:)
    character(:), allocatable :: text
  end type value_t

  interface funit_value
    module procedure int32_scalar, int32_vector, int32_matrix, int64_scalar, int64_vector, int64_matrix
    module procedure real_scalar, real_vector, real_matrix, value_of_text
  end interface funit_value

  public :: assertEqual, assertLessThan, assertLessThanOrEqual, assertGreaterThan, assertGreaterThanOrEqual
  public :: funit_value, anyExceptions, funit_begin, funit_end, funit_close

  logical :: failed
  integer :: n_passed = 0, n_failed = 0
  character(:), allocatable :: test_file, test_name

contains

  !> Begin a test, unless the command line is "-f part" (as pFUnit's) and its name has no such part.
  logical function funit_begin(file, name) result(chosen)
    character(*), intent(in) :: file, name
    character(256) :: part
    test_file = file
    test_name = name
    failed = .false.
    call get_command_argument(2, part)
    chosen = index(name, trim(part)) > 0
  end function funit_begin

  !> End a test.
  subroutine funit_end()
    n_failed = n_failed + merge(1, 0, failed)
    n_passed = n_passed + merge(0, 1, failed)
  end subroutine funit_end

  !> The closing line. That no test was run is a failure.
  subroutine funit_close(executable)
    character(*), intent(in) :: executable
    print '(a,": ",i0," tests, ",i0," failed")', executable, n_passed + n_failed, n_failed
    if (n_failed > 0 .or. n_passed == 0) stop 1, quiet=.true.
  end subroutine funit_close

  !> Whether the running test has failed: it returns then.
  logical function anyExceptions()
    anyExceptions = failed
  end function anyExceptions

  subroutine fail(what, message, line)
    character(*), intent(in) :: what
    character(*), intent(in), optional :: message
    integer, intent(in) :: line
    failed = .true.
    print '(a,":",i0,": ",a,": ",a)', test_file, line, test_name, what
    if (present(message)) print '(2x,a)', message
  end subroutine fail

  !> lhs < rhs, exactly.
  subroutine assertLessThan(lhs, rhs, message, line)
    !> The two sides: reals or integers; a scalar on the left stands for a whole array.
    type(value_t), intent(in) :: lhs, rhs
    character(*), intent(in), optional :: message  !! Shown where the assertion fails.
    integer, intent(in) :: line  !! Line of the assertion.
    call assert_order(lhs, 'less than', rhs, message, line)
  end subroutine assertLessThan

  !> lhs <= rhs, exactly.
  subroutine assertLessThanOrEqual(lhs, rhs, message, line)
    !> The two sides: reals or integers; a scalar on the left stands for a whole array.
    type(value_t), intent(in) :: lhs, rhs
    character(*), intent(in), optional :: message  !! Shown where the assertion fails.
    integer, intent(in) :: line  !! Line of the assertion.
    call assert_order(lhs, 'less than or equal to', rhs, message, line)
  end subroutine assertLessThanOrEqual

  !> lhs > rhs, exactly.
  subroutine assertGreaterThan(lhs, rhs, message, line)
    !> The two sides: reals or integers; a scalar on the left stands for a whole array.
    type(value_t), intent(in) :: lhs, rhs
    character(*), intent(in), optional :: message  !! Shown where the assertion fails.
    integer, intent(in) :: line  !! Line of the assertion.
    call assert_order(lhs, 'greater than', rhs, message, line)
  end subroutine assertGreaterThan

  !> lhs >= rhs, exactly.
  subroutine assertGreaterThanOrEqual(lhs, rhs, message, line)
    !> The two sides: reals or integers; a scalar on the left stands for a whole array.
    type(value_t), intent(in) :: lhs, rhs
    character(*), intent(in), optional :: message  !! Shown where the assertion fails.
    integer, intent(in) :: line  !! Line of the assertion.
    call assert_order(lhs, 'greater than or equal to', rhs, message, line)
  end subroutine assertGreaterThanOrEqual

  !> Compare element by element; the first pair out of order is shown. As in pFUnit, an array on the left needs one on
  !> the right.
  subroutine assert_order(lhs, relation, rhs, message, line)
    type(value_t), intent(in) :: lhs, rhs  !! The two sides.
    character(*), intent(in) :: relation  !! The relation in words, as `in_order` knows it.
    character(*), intent(in), optional :: message  !! Shown where the assertion fails.
    integer, intent(in) :: line  !! Line of the assertion.
    character(:), allocatable :: what
    integer :: i, j
    ! pFUnit has no such procedures.
    if (allocated(rhs%integers) .and. .not. allocated(lhs%integers)) then
      call fail('a real is compared with an integer', message, line)
      return
    end if
    if (size(lhs%shape) > 0 .and. as_list(lhs%shape) /= as_list(rhs%shape)) then
      call fail('shape'//as_list(lhs%shape)//' is compared with shape'//as_list(rhs%shape), message, line)
      return
    end if
    do i = 1, product(rhs%shape)
      j = merge(1, i, size(lhs%shape) == 0)
      if (in_order(lhs, j, relation, rhs, i)) cycle
      what = as_text(lhs, j)//' is not '//relation//' '//as_text(rhs, i)
      if (size(rhs%shape) > 0) what = what//' at'//as_list(place(i, rhs%shape))
      call fail(what, message, line)
      return
    end do
  end subroutine assert_order

  !> Whether an element of the left side has the relation to one of the right side. Integers are compared as integers.
  !> NaN is in no order; builds that trap invalid operations come through.
  logical function in_order(lhs, j, relation, rhs, i) result(holds)
    type(value_t), intent(in) :: lhs, rhs  !! The two sides.
    integer, intent(in) :: j, i  !! The element of the left side and that of the right side.
    character(*), intent(in) :: relation  !! The relation in words.
    real(real64) :: a, b
    logical :: less, equal
    if (allocated(lhs%integers) .and. allocated(rhs%integers)) then
      less = lhs%integers(j) < rhs%integers(i)
      equal = lhs%integers(j) == rhs%integers(i)
    else
      a = as_real(lhs, j)
      b = as_real(rhs, i)
      holds = .false.
      if (ieee_is_nan(a) .or. ieee_is_nan(b)) return
      less = a < b
      equal = .not. (a < b .or. a > b)
    end if
    select case (relation)
    case ('less than'); holds = less
    case ('less than or equal to'); holds = less .or. equal
    case ('greater than'); holds = .not. (less .or. equal)
    case ('greater than or equal to'); holds = .not. less
    case default; error stop 'an unknown relation'
    end select
  end function in_order

  !> Texts and integers are equal exactly, reals within the absolute tolerance (0 if absent). A scalar stands for a
  !> whole array.
  subroutine assertEqual(expected, found, tolerance, message, line)
    type(value_t), intent(in) :: expected, found
    real(real64), intent(in), optional :: tolerance
    character(*), intent(in), optional :: message
    integer, intent(in) :: line
    real(real64) :: allowed
    character(:), allocatable :: what
    logical :: same
    integer :: i, j
    if (size(expected%shape) > 0 .and. as_list(expected%shape) /= as_list(found%shape)) then
      call fail('expected shape'//as_list(expected%shape)//', found'//as_list(found%shape), message, line)
      return
    end if
    allowed = 0
    if (present(tolerance)) allowed = tolerance
    do i = 1, product(found%shape)
      j = merge(1, i, size(expected%shape) == 0)
      if (allocated(found%text) .and. allocated(expected%text)) then
        same = expected%text == found%text
      else if (allocated(found%integers) .and. allocated(expected%integers)) then
        same = expected%integers(j) == found%integers(i)
      else
        same = near(as_real(expected, j), as_real(found, i), allowed)
      end if
      if (same) cycle
      what = 'expected '//as_text(expected, j)//', found '//as_text(found, i)
      if (size(found%shape) > 0) what = what//' at'//as_list(place(i, found%shape))
      if (present(tolerance)) what = what//', tolerance '//as_text(real_scalar(allowed), 1)
      call fail(what, message, line)
      return
    end do
  end subroutine assertEqual

  !> NaN is near nothing, an infinity near itself. Builds that trap invalid operations come through.
  logical function near(a, b, allowed)
    real(real64), intent(in) :: a, b, allowed
    near = .false.
    if (ieee_is_nan(a) .or. ieee_is_nan(b) .or. ieee_is_nan(allowed)) return
    near = .not. (a < b .or. a > b)
    if (ieee_is_finite(a) .and. ieee_is_finite(b)) near = abs(a - b) <= allowed
  end function near

  real(real64) function as_real(v, i)
    type(value_t), intent(in) :: v
    integer, intent(in) :: i
    if (allocated(v%text)) error stop 'a text is compared with a number'
    if (allocated(v%reals)) as_real = v%reals(i)
    if (allocated(v%integers)) as_real = real(v%integers(i), real64)
  end function as_real

  function as_text(v, i) result(text)
    type(value_t), intent(in) :: v
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(32) :: buffer
    if (allocated(v%reals)) write (buffer, '(g0)') v%reals(i)
    if (allocated(v%integers)) write (buffer, '(i0)') v%integers(i)
    text = trim(buffer)
    if (allocated(v%text)) text = '"'//trim(v%text)//'"'
  end function as_text

  function as_list(values) result(text)
    integer, intent(in) :: values(:)
    character(:), allocatable :: text
    character(64) :: buffer
    write (buffer, '(" (",*(i0,:,","))') values
    text = trim(buffer)//')'
  end function as_list

  !> Subscripts of the i-th element of an array.
  function place(i, shape) result(subscript)
    integer, intent(in) :: i, shape(:)
    integer :: subscript(size(shape)), k
    do k = 1, size(shape)
      subscript(k) = mod((i - 1)/product(shape(:k - 1)), shape(k)) + 1
    end do
  end function place

  function int32_scalar(x) result(v)
    integer(int32), intent(in) :: x
    type(value_t) :: v
    v%shape = shape(x)
    v%integers = [int(x, int64)]
  end function int32_scalar

  function int32_vector(x) result(v)
    integer(int32), intent(in) :: x(:)
    type(value_t) :: v
    v%shape = shape(x)
    v%integers = int(x, int64)
  end function int32_vector

  function int32_matrix(x) result(v)
    integer(int32), intent(in) :: x(:, :)
    type(value_t) :: v
    v%shape = shape(x)
    v%integers = reshape(int(x, int64), [size(x)])
  end function int32_matrix

  function int64_scalar(x) result(v)
    integer(int64), intent(in) :: x
    type(value_t) :: v
    v%shape = shape(x)
    v%integers = [x]
  end function int64_scalar

  function int64_vector(x) result(v)
    integer(int64), intent(in) :: x(:)
    type(value_t) :: v
    v%shape = shape(x)
    v%integers = x
  end function int64_vector

  function int64_matrix(x) result(v)
    integer(int64), intent(in) :: x(:, :)
    type(value_t) :: v
    v%shape = shape(x)
    v%integers = reshape(x, [size(x)])
  end function int64_matrix

  function real_scalar(x) result(v)
    real(real64), intent(in) :: x
    type(value_t) :: v
    v%shape = shape(x)
    v%reals = [x]
  end function real_scalar

  function real_vector(x) result(v)
    real(real64), intent(in) :: x(:)
    type(value_t) :: v
    v%shape = shape(x)
    v%reals = x
  end function real_vector

  function real_matrix(x) result(v)
    real(real64), intent(in) :: x(:, :)
    type(value_t) :: v
    v%shape = shape(x)
    v%reals = reshape(x, [size(x)])
  end function real_matrix

  function value_of_text(x) result(v)
    character(*), intent(in) :: x
    type(value_t) :: v
    allocate (v%shape(0))
    v%text = x
  end function value_of_text
end module funit
