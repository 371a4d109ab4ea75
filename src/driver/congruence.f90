!> The kinds of bodies of a scene: bodies of one kind differ by their place, and by loads and values of given displacements.
!>
!> The first body of a kind is assembled, ordered and factorized; the others make their right-hand sides and use its factor.
module dotyk_driver_congruence
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_congruence, only: adopt_constraint, are_congruent, fingerprint_t
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  !> The kinds.
  type, public :: kinds_t
    !> First body of the kind of each body (n_bodies).
    integer, allocatable :: first(:)
    !> How each body came to its place from there (n_bodies).
    type(placement_t), allocatable :: motion(:)
  contains
    procedure :: init => kinds_init
    procedure :: find => kinds_find
    procedure :: leads => kinds_leads
    procedure :: n => kinds_n
    procedure :: tell => kinds_tell
    procedure :: contact_nodes => kinds_contact_nodes
  end type kinds_t

contains

  !> Every body is one of a kind.
  subroutine kinds_init(self, n_bodies)
    class(kinds_t), intent(out) :: self
    integer, intent(in) :: n_bodies
    integer :: b
    self%first = [(b, b=1, n_bodies)]
    allocate (self%motion(n_bodies))
  end subroutine kinds_init

  !> Find the kinds. Bodies get the equations, and moved with them the axes of their nodes, of the first of their kind.
  subroutine kinds_find(self, body)
    class(kinds_t), intent(inout) :: self
    !> With supports, not yet assembled (n_bodies).
    type(body_t), intent(inout) :: body(:)
    type(fingerprint_t), allocatable :: fingerprint(:)
    type(placement_t) :: motion
    integer :: b, c
    call self%init(size(body))
    allocate (fingerprint(size(body)))
    do b = 1, size(body)
      call fingerprint(b)%take(body(b))
      do c = 1, b - 1
        if (self%first(c) /= c) cycle
        if (.not. fingerprint(c)%matches(fingerprint(b))) cycle
        if (.not. are_congruent(body(c), fingerprint(c), body(b), fingerprint(b), motion)) cycle
        self%first(b) = c
        self%motion(b) = motion
        call adopt_constraint(body(c)%constraint, motion, body(b)%constraint)
        exit
      end do
    end do
  end subroutine kinds_find

  !> Whether a body is the first of its kind.
  elemental logical function kinds_leads(self, b) result(leads)
    class(kinds_t), intent(in) :: self
    integer, intent(in) :: b
    leads = self%first(b) == b
  end function kinds_leads

  !> Number of kinds.
  pure integer function kinds_n(self) result(n)
    class(kinds_t), intent(in) :: self
    integer :: b
    n = count([(self%first(b) == b, b=1, size(self%first))])
  end function kinds_n

  !> Tell a scheme.
  pure subroutine kinds_tell(self, dimension, kind, axes)
    class(kinds_t), intent(in) :: self
    !> Of space.
    integer, intent(in) :: dimension
    !> First body of the kind of each body (n_bodies).
    integer, allocatable, intent(out) :: kind(:)
    !> The axes of the kind as they are turned with each body, as columns (dimension, dimension, n_bodies).
    real(dp), allocatable, intent(out) :: axes(:, :, :)
    integer :: b
    kind = self%first
    allocate (axes(dimension, dimension, size(kind)))
    do b = 1, size(kind)
      axes(:, :, b) = self%motion(b)%rotation(:dimension, :dimension)
    end do
  end subroutine kinds_tell

  !> Nodes where any body of a kind may touch, in the numbers that all of them have, and the contact points of all of them.
  subroutine kinds_contact_nodes(self, first, block, node, n_points)
    class(kinds_t), intent(in) :: self
    !> First body of the kind.
    integer, intent(in) :: first
    !> Where bodies may touch (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Ascending.
    integer, allocatable, intent(out) :: node(:)
    integer, intent(out) :: n_points
    logical, allocatable :: touched(:)
    integer :: b, i
    n_points = 0
    i = 0
    do b = first, size(block)
      if (self%first(b) == first .and. size(block(b)%contact_node) > 0) i = max(i, maxval(block(b)%contact_node))
    end do
    allocate (touched(i), source=.false.)
    do b = first, size(block)
      if (self%first(b) /= first) cycle
      n_points = n_points + size(block(b)%row)
      touched(block(b)%contact_node) = .true.
    end do
    node = pack([(i, i=1, size(touched))], touched)
  end subroutine kinds_contact_nodes
end module dotyk_driver_congruence
