!> Contact pairs as they are formed from the groups of the input, with a quick way to those of two bodies.
module dotyk_model_pair_list
  use dotyk_input_case, only: contact_input_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: pair_list_t  !! The pairs.
    integer :: n = 0  !! Number of pairs.
    !> Pairs as if the input named each of them; the first n are in use (n_allocated).
    type(contact_input_t), allocatable :: contact(:)
    type(surface_t), allocatable :: surface_a(:)  !! Their slave surfaces (n_allocated).
    type(surface_t), allocatable :: surface_b(:)  !! Their master surfaces (n_allocated).
    integer, allocatable :: group(:)  !! Groups of the input that they come from (n_allocated).
    !> Indices of the named slave surfaces of their bodies; 0 for parts of the boundary (n_allocated).
    integer, allocatable :: place_a(:)
    integer, allocatable :: place_b(:)  !! The same of the master surfaces (n_allocated).
    !> First pair of each body that has a higher number than its partner; 0 where there is none (n_bodies).
    integer, allocatable, private :: first(:)
    integer, allocatable, private :: next(:)  !! Next pair of this body; 0 at the end (n_allocated).
  contains
    procedure :: init => list_init
    procedure :: add => list_add
    procedure :: between => list_between
  end type pair_list_t

contains

  !> Empty list.
  subroutine list_init(self, n_bodies)
    class(pair_list_t), intent(out) :: self
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer, parameter :: room = 16
    allocate (self%contact(room), self%surface_a(room), self%surface_b(room), self%group(room), self%place_a(room), &
              self%place_b(room), self%next(room), self%first(n_bodies))
    self%first = 0
  end subroutine list_init

  !> Add a pair.
  subroutine list_add(self, contact, group, surface_a, place_a, surface_b, place_b)
    class(pair_list_t), intent(inout) :: self
    type(contact_input_t), intent(in) :: contact  !! The pair, its bodies set.
    integer, intent(in) :: group  !! Group of the input.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    integer, intent(in) :: place_a  !! Index among the named surfaces of its body, or 0.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    integer, intent(in) :: place_b  !! Index among the named surfaces of its body, or 0.
    integer :: b
    if (self%n == size(self%contact)) call enlarge(self)
    self%n = self%n + 1
    self%contact(self%n) = contact
    self%surface_a(self%n) = surface_a
    self%surface_b(self%n) = surface_b
    self%group(self%n) = group
    self%place_a(self%n) = place_a
    self%place_b(self%n) = place_b
    b = max(contact%body_a, contact%body_b)
    self%next(self%n) = self%first(b)
    self%first(b) = self%n
  end subroutine list_add

  !> Double the room.
  subroutine enlarge(self)
    type(pair_list_t), intent(inout) :: self  !! The list.
    type(contact_input_t), allocatable :: contact(:)
    type(surface_t), allocatable :: surface(:)
    integer :: n
    n = self%n
    allocate (contact(2*n))
    contact(:n) = self%contact
    call move_alloc(contact, self%contact)
    allocate (surface(2*n))
    surface(:n) = self%surface_a
    call move_alloc(surface, self%surface_a)
    allocate (surface(2*n))
    surface(:n) = self%surface_b
    call move_alloc(surface, self%surface_b)
    self%group = [self%group, self%group]
    self%place_a = [self%place_a, self%place_a]
    self%place_b = [self%place_b, self%place_b]
    self%next = [self%next, self%next]
  end subroutine enlarge

  !> The next pair of two bodies, the latest first; 0 at the end.
  pure integer function list_between(self, a, b, after) result(pair)
    class(pair_list_t), intent(in) :: self
    integer, intent(in) :: a  !! One body.
    integer, intent(in) :: b  !! The other body.
    integer, intent(in) :: after  !! The pair before; 0 to begin.
    if (after == 0) then
      pair = self%first(max(a, b))
    else
      pair = self%next(after)
    end if
    do while (pair > 0)
      if (min(self%contact(pair)%body_a, self%contact(pair)%body_b) == min(a, b)) return
      pair = self%next(pair)
    end do
  end function list_between
end module dotyk_model_pair_list
