!> Tokens of gmsh's language for geometries: words, texts in quotes, and other characters. Comments are skipped.
module dotyk_mesh_geometry_tokens
  use dotyk_base_kinds, only: int64
  implicit none
  private

  !> Kinds of tokens.
  integer, parameter, public :: token_end = 0   !< end of the text
  integer, parameter, public :: token_word = 1  !< letters, digits and underscores: a key word, a name, a number
  integer, parameter, public :: token_text = 2  !< what is between two single or two double quotes
  integer, parameter, public :: token_mark = 3  !< any other character

  type, public :: geometry_token_t  !! One token.
    integer :: kind = token_end  !! One of `token_*`.
    integer :: line = 0  !! Line of its first character.
    character(:), allocatable :: text  !! Its characters; without the quotes.
  end type geometry_token_t

  public :: next_token

  character(*), parameter :: line_feed = achar(10)
  character(*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_'
  character(*), parameter :: blanks = ' '//achar(9)//achar(12)//achar(13)//line_feed

contains

  !> The token at a position. A quote ends at the next one of its kind, maybe lines below; there are no escapes.
  subroutine next_token(text, position, line, token)
    character(*), intent(in) :: text  !! The whole text.
    integer(int64), intent(inout) :: position  !! Position; behind the token on return.
    integer, intent(inout) :: line  !! Line of the position.
    type(geometry_token_t), intent(out) :: token  !! The token.
    integer(int64) :: first, length
    call skip_blanks(text, position, line)
    token%line = line
    if (position > len(text, int64)) then
      token%text = ''
      return
    end if
    first = position
    select case (text(first:first))
    case ('"', '''')
      token%kind = token_text
      length = index(text(first + 1:), text(first:first), kind=int64)
      if (length == 0) length = len(text, int64) - first + 1
      token%text = text(first + 1:first + length - 1)
      position = first + length + 1
    case default
      length = verify(text(first:), letters, kind=int64) - 1
      if (length < 0) length = len(text, int64) - first + 1
      token%kind = merge(token_word, token_mark, length > 0)
      length = max(1_int64, length)
      token%text = text(first:first + length - 1)
      position = first + length
    end select
    line = line + count_lines(token%text)
  end subroutine next_token

  !> Skip blanks, line ends and comments.
  subroutine skip_blanks(text, position, line)
    character(*), intent(in) :: text  !! The whole text.
    integer(int64), intent(inout) :: position  !! Position; moved.
    integer, intent(inout) :: line  !! Line of the position.
    integer(int64) :: length
    do while (position <= len(text, int64))
      length = 1
      if (index(blanks, text(position:position)) == 0) then
        if (text(position:position) /= '/' .or. position == len(text, int64)) exit
        select case (text(position + 1:position + 1))
        case ('/')
          length = index(text(position:), line_feed, kind=int64)
        case ('*')
          length = index(text(position + 2:), '*/', kind=int64)
          if (length > 0) length = length + 3
        case default
          exit
        end select
        if (length == 0) length = len(text, int64) - position + 1
      end if
      line = line + count_lines(text(position:position + length - 1))
      position = position + length
    end do
  end subroutine skip_blanks

  !> Number of line feeds in a text.
  pure integer function count_lines(text)
    character(*), intent(in) :: text  !! The text.
    integer(int64) :: i
    count_lines = 0
    do i = 1, len(text, int64)
      if (text(i:i) == line_feed) count_lines = count_lines + 1
    end do
  end function count_lines
end module dotyk_mesh_geometry_tokens
