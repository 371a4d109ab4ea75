!> The kinds of bodies of a scene: bodies of one kind differ by their place, and by loads and values of given
!> displacements.
!>
!> The first body of a kind is assembled, ordered and factorized; the others make their right-hand sides and use its
!> factor.
module dotyk_control_congruence_classes
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_congruence, only: adopt_congruent_constraint, are_congruent, congruence_invariants_t
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  !> The kinds.
  type, public :: congruence_classes_t
    !> First body of the kind of each body (n_bodies).
    integer, allocatable :: first(:)
    !> How each body came to its place from there (n_bodies).
    type(placement_t), allocatable :: motion(:)
  contains
    procedure :: init => congruence_classes_init
    procedure :: find => congruence_classes_find
    procedure :: is_representative => congruence_classes_is_representative
    procedure :: n => congruence_classes_n
    procedure :: copy => congruence_classes_copy
    procedure :: contact_nodes => congruence_classes_contact_nodes
  end type congruence_classes_t

contains

  !> Every body is one of a kind.
  subroutine congruence_classes_init(self, n_bodies)
    class(congruence_classes_t), intent(out) :: self
    integer, intent(in) :: n_bodies
    integer :: b
    self%first = [(b, b=1, n_bodies)]
    allocate (self%motion(n_bodies))
  end subroutine congruence_classes_init

  !> Find the kinds. Bodies get the equations, and moved with them the axes of their nodes, of the first of their kind.
  subroutine congruence_classes_find(self, body)
    class(congruence_classes_t), intent(inout) :: self
    !> With supports, not yet assembled (n_bodies).
    type(body_t), intent(inout) :: body(:)
    type(congruence_invariants_t), allocatable :: invariants(:)
    type(placement_t) :: motion
    integer :: b, c
    call self%init(size(body))
    allocate (invariants(size(body)))
    do b = 1, size(body)
      call invariants(b)%init(body(b))
      do c = 1, b - 1
        if (self%first(c) /= c) cycle
        if (.not. invariants(c)%matches(invariants(b))) cycle
        if (.not. are_congruent(body(c), invariants(c), body(b), invariants(b), motion)) cycle
        self%first(b) = c
        self%motion(b) = motion
        call adopt_congruent_constraint(body(c)%constraint, motion, body(b)%constraint)
        exit
      end do
    end do
  end subroutine congruence_classes_find

  !> Whether a body is the first of its kind.
  elemental logical function congruence_classes_is_representative(self, b) result(leads)
    class(congruence_classes_t), intent(in) :: self
    integer, intent(in) :: b
    leads = self%first(b) == b
  end function congruence_classes_is_representative

  !> Number of kinds.
  pure integer function congruence_classes_n(self) result(n)
    class(congruence_classes_t), intent(in) :: self
    integer :: b
    n = count([(self%first(b) == b, b=1, size(self%first))])
  end function congruence_classes_n

  !> Tell a scheme.
  pure subroutine congruence_classes_copy(self, dimension, kind, axes)
    class(congruence_classes_t), intent(in) :: self
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
  end subroutine congruence_classes_copy

  !> Nodes where any body of a kind may touch, in the numbers that all of them have, and the contact points of all of
  !> them.
  subroutine congruence_classes_contact_nodes(self, first, block, node, n_points)
    class(congruence_classes_t), intent(in) :: self
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
  end subroutine congruence_classes_contact_nodes
end module dotyk_control_congruence_classes
