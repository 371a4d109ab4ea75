!> Directions in which a support prescribes displacements: `&support fix` as a plain value.
module dotyk_base_directions
  use dotyk_base_text, only: lower, shown
  implicit none
  private

  type, public :: directions_t  !! Prescribed directions, in global axes or in axes of a surface.
    logical :: local = .false.  !! Whether axes are those of the surface: tangents xi, eta, normal n; else x, y, z.
    logical :: fixed(3) = .false.  !! Whether the displacement is prescribed along x, y, z or xi, eta, n (3).
  contains
    procedure :: parse => directions_parse
    procedure :: name => directions_name
  end type directions_t

contains

  !> Read directions from a text such as 'xyz', 'nt' or 'xi, n', in upper or lower case.
  subroutine directions_parse(self, text, dimension, message)
    class(directions_t), intent(out) :: self
    character(*), intent(in) :: text  !! Letters x, y, z, or xi, eta, n and t (both tangents), or separators.
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3; 0: unknown, all directions are allowed.
    character(:), allocatable, intent(out) :: message  !! The mistake, after "fix: "; empty where there is none.
    ! 'xi' before 'x': the longer name wins. The first four are axes of the surface.
    integer, parameter :: n_names = 7, n_local = 4
    character(3), parameter :: name(n_names) = ['eta', 'xi ', 'n  ', 't  ', 'x  ', 'y  ', 'z  ']
    logical :: seen(n_names), named(3)
    integer :: i, k
    message = ''
    seen = .false.
    i = 1
    do while (i <= len(text))
      if (text(i:i) == ' ' .or. text(i:i) == ',') then
        i = i + 1
        cycle
      end if
      do k = 1, n_names
        if (index(lower(text(i:)), trim(name(k))) == 1) exit
      end do
      if (k > n_names) then
        message = shown(text)//' must consist of letters of ''xyz'', or of n, t, xi, eta'
        return
      end if
      named(1) = name(k) == 'xi' .or. name(k) == 't' .or. name(k) == 'x'
      named(2) = name(k) == 'eta' .or. (name(k) == 't' .and. dimension /= 2) .or. name(k) == 'y'
      named(3) = name(k) == 'n' .or. name(k) == 'z'
      if (any(self%fixed .and. named) .and. (any(seen(:n_local)) .eqv. k <= n_local)) then
        message = shown(text)//' names a direction twice'
        return
      end if
      seen(k) = .true.
      self%fixed = self%fixed .or. named
      i = i + len_trim(name(k))
    end do
    self%local = any(seen(:n_local))
    if (self%local .and. any(seen(n_local + 1:))) then
      message = shown(text)//' mixes global axes (x, y, z) with axes of the surface (n, t, xi, eta)'
    else if (dimension == 2 .and. (seen(1) .or. seen(n_names))) then
      message = shown(text)//': there is no '//trim(merge('eta', 'z  ', seen(1)))//' in two dimensions'
    else if (.not. any(self%fixed)) then
      message = shown(text)//' names no direction'
    end if
  end subroutine directions_parse

  !> Name of a direction: x, y, z, or xi, eta, n.
  pure function directions_name(self, i) result(name)
    class(directions_t), intent(in) :: self
    integer, intent(in) :: i  !! Direction, 1 to 3.
    character(:), allocatable :: name
    character(3), parameter :: global_name(3) = ['x  ', 'y  ', 'z  '], local_name(3) = ['xi ', 'eta', 'n  ']
    name = trim(merge(local_name(i), global_name(i), self%local))
  end function directions_name
end module dotyk_base_directions
