!> The table of springs in the head of the log: areas, and what stiffness stands for.
module dotyk_log_spring_table
  use dotyk_base_directions, only: directions_t
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, to_text
  use dotyk_elasticity_body, only: body_t
  implicit none
  private
  public :: show_springs

  integer, parameter :: most_shown = 20  !! Greatest number of springs with a line each.

contains

  !> A line for each spring; nothing where no body has one.
  subroutine show_springs(log, body)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    character(20) :: label
    integer :: b, n, s
    n = 0
    do b = 1, size(body)
      associate (springs => body(b)%constraint%foundation)
        do s = 1, springs%n_springs()
          n = n + 1
          if (n > most_shown) cycle
          if (n == 1) then
            call log%line('')
            call log%line('  spring               area, stiffness')
          end if
          label = body(b)%name//':'//springs%place(s)%s
          call log%line('  '//label//' '//to_text(springs%area(s), 5)//', '// &
                        to_text(springs%area(s)*springs%modulus(s), 5)//' in total along '// &
                        directions_text(springs%fix(s), body(b)%dimension)//', '//to_text(springs%modulus(s), 5)// &
                        ' per area')
        end do
      end associate
    end do
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more spring'))
  end subroutine show_springs

  !> The directions of a spring: "each of x, y, z".
  function directions_text(fix, dimension) result(text)
    type(directions_t), intent(in) :: fix  !! The directions.
    integer, intent(in) :: dimension  !! Dimension of space.
    character(:), allocatable :: text
    integer :: i, n
    text = ''
    n = 0
    do i = 1, 3
      if (.not. fix%fixed(i)) cycle
      ! In the plane there is neither z nor eta.
      if (dimension == 2 .and. i == merge(2, 3, fix%local)) cycle
      n = n + 1
      if (n > 1) text = text//', '
      text = text//fix%name(i)
    end do
    if (n > 1) text = 'each of '//text
  end function directions_text
end module dotyk_log_spring_table
