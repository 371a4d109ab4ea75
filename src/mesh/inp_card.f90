!> Lines of an Abaqus or CalculiX deck: keyword cards with parameters, and the fields of data lines.
module dotyk_mesh_inp_card
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_number_text, only: most_digits, scan_real
  use dotyk_base_text, only: lower, text_t
  implicit none
  private
  public :: next_field, to_integer, get_real_field, without_quotes

  integer, parameter :: max_parameters = 32  !! Greatest number of parameters of a card.

  type, public :: inp_card_t  !! A keyword card, as `*ELEMENT, TYPE=C3D8, ELSET=part`.
    !> Keyword in small letters without blanks and star, as 'endpart'; empty before the first card.
    character(:), allocatable :: keyword
    integer :: n = 0  !! Number of parameters.
    type(text_t) :: key(max_parameters)  !! Names of the parameters in small letters without blanks (max_parameters).
    !> Their values as written, without quotes; empty where there is none (max_parameters).
    type(text_t) :: value(max_parameters)
  contains
    procedure :: parse => card_parse
    procedure :: has => card_has
    procedure :: get => card_get
  end type inp_card_t

contains

  !> Take a card apart.
  subroutine card_parse(self, text)
    class(inp_card_t), intent(inout) :: self
    character(*), intent(in) :: text  !! The card with its continuation lines, from its star on.
    character(:), allocatable :: field
    integer :: p, q, equals
    logical :: quoted
    self%n = 0
    self%keyword = ''
    p = 2
    do while (p <= len(text))
      quoted = .false.
      do q = p, len(text)
        if (text(q:q) == '"') quoted = .not. quoted
        if (text(q:q) == ',' .and. .not. quoted) exit
      end do
      field = trimmed(text(p:q - 1))
      if (p == 2) then
        self%keyword = lower(without_blanks(field))
      else if (len(field) > 0 .and. self%n < max_parameters) then
        self%n = self%n + 1
        equals = index(field, '=')
        if (equals == 0) equals = len(field) + 1
        self%key(self%n)%s = lower(without_blanks(field(:equals - 1)))
        self%value(self%n)%s = without_quotes(trimmed(field(equals + 1:)))
      end if
      p = q + 1
    end do
  end subroutine card_parse

  !> Whether the card has a parameter.
  pure logical function card_has(self, key) result(has)
    class(inp_card_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the parameter.
    integer :: i
    has = .false.
    do i = 1, self%n
      has = has .or. self%key(i)%s == key
    end do
  end function card_has

  !> Value of a parameter; empty where the card has no such parameter.
  pure function card_get(self, key) result(value)
    class(inp_card_t), intent(in) :: self
    character(*), intent(in) :: key  !! Name of the parameter.
    character(:), allocatable :: value
    integer :: i
    value = ''
    do i = 1, self%n
      if (self%key(i)%s == key) value = self%value(i)%s
    end do
  end function card_get

  !> The next field of a data line.
  pure subroutine next_field(text, p, last, first, end)
    character(*), intent(in) :: text  !! Text of the file.
    !> Where the field begins; behind its comma on return, beyond `last` where it is the last one.
    integer(int64), intent(inout) :: p
    integer(int64), intent(in) :: last  !! Last character of the line.
    !> First and last character of the field, without blanks around it; end < first where it is empty.
    integer(int64), intent(out) :: first, end
    integer(int64) :: q
    do first = p, last
      if (iachar(text(first:first)) > 32) exit
    end do
    do q = first, last
      if (text(q:q) == ',') exit
    end do
    p = q + 1
    do end = q - 1, first, -1
      if (iachar(text(end:end)) > 32) exit
    end do
  end subroutine next_field

  !> An integer.
  pure subroutine to_integer(text, value, valid)
    character(*), intent(in) :: text  !! Text without blanks around it.
    integer(int64), intent(out) :: value  !! The integer; 0 where the text is none.
    logical, intent(out) :: valid  !! Whether the text is an integer of at most 18 digits.
    integer :: i, digit, start
    value = 0
    start = 1
    if (len(text) > 0) start = merge(2, 1, scan(text(1:1), '+-') == 1)
    valid = len(text) >= start .and. len(text) < start + most_digits
    if (.not. valid) return
    do i = start, len(text)
      digit = iachar(text(i:i)) - iachar('0')
      valid = valid .and. digit >= 0 .and. digit <= 9
      value = 10*value + digit
    end do
    if (.not. valid) value = 0
    if (text(1:1) == '-') value = -value
  end subroutine to_integer

  !> A real, also with an exponent D as Fortran writes it.
  subroutine get_real_field(text, first, end, value, valid)
    character(*), intent(inout) :: text  !! Text of the file; the comma behind the field becomes a blank character.
    integer(int64), intent(in) :: first, end  !! First and last character of the field.
    real(dp), intent(out) :: value  !! The real; 0 for an empty field [any].
    logical, intent(out) :: valid  !! Whether the field is empty or a finite number.
    integer(int64) :: p
    integer :: exponent
    value = 0
    valid = end < first
    if (valid) return
    if (text(end + 1:end + 1) == ',') text(end + 1:end + 1) = ' '
    exponent = scan(text(first:end), 'dD')
    if (exponent > 0) text(first + exponent - 1:first + exponent - 1) = 'e'
    p = first
    call scan_real(text, p, value, valid)
    valid = valid .and. p == end + 1
  end subroutine get_real_field

  !> Text without blanks around it, and without other characters below a blank.
  pure function trimmed(text) result(short)
    character(*), intent(in) :: text  !! Any text.
    character(:), allocatable :: short
    integer :: first, last
    do first = 1, len(text)
      if (iachar(text(first:first)) > 32) exit
    end do
    do last = len(text), first, -1
      if (iachar(text(last:last)) > 32) exit
    end do
    short = text(first:last)
  end function trimmed

  !> Text without blanks.
  pure function without_blanks(text) result(short)
    character(*), intent(in) :: text  !! Any text.
    character(:), allocatable :: short
    integer :: i
    short = ''
    do i = 1, len(text)
      if (iachar(text(i:i)) > 32) short = short//text(i:i)
    end do
  end function without_blanks

  !> Text without the quotes around it.
  pure function without_quotes(text) result(short)
    character(*), intent(in) :: text  !! Any text.
    character(:), allocatable :: short
    short = text
    if (len(text) < 2) return
    if (text(1:1) == '"' .and. text(len(text):) == '"') short = text(2:len(text) - 1)
  end function without_quotes
end module dotyk_mesh_inp_card
