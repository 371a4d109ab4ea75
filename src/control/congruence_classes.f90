!> Congruence classes of the bodies of a scene: bodies of a class have one stiffness matrix; only position, loads and
!> values of prescribed displacements differ.
!>
!> The first body of a class represents it: its stiffness matrix is assembled, ordered and factorized. The other bodies
!> assemble right-hand sides and solve with the factor of the representative.
module dotyk_control_congruence_classes
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_congruence, only: are_congruent, congruence_invariants_t
  use dotyk_elasticity_load_cases, only: adopt_congruent_body
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  type, public :: congruence_classes_t  !! Partition of the bodies into congruence classes.
    !> Representative of the class of each body: the first body of the class (n_bodies).
    integer, allocatable :: first(:)
    type(placement_t), allocatable :: motion(:)  !! Rigid motion from the representative to each body (n_bodies).
  contains
    procedure :: init => congruence_classes_init
    procedure :: find => congruence_classes_find
    procedure :: is_representative => congruence_classes_is_representative
    procedure :: n => congruence_classes_n
    procedure :: contact_nodes => congruence_classes_contact_nodes
  end type congruence_classes_t

contains

  !> Every body is a class of its own.
  subroutine congruence_classes_init(self, n_bodies)
    class(congruence_classes_t), intent(out) :: self
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer :: b
    self%first = [(b, b=1, n_bodies)]
    allocate (self%motion(n_bodies))
  end subroutine congruence_classes_init

  !> Find the classes. Each body gets the equations of its representative, and the axes of the nodes of the
  !> representative, moved with the body.
  subroutine congruence_classes_find(self, body)
    class(congruence_classes_t), intent(inout) :: self
    type(body_t), intent(inout) :: body(:)  !! Bodies with supports, not yet assembled (n_bodies).
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
        call adopt_congruent_body(body(c), motion, body(b))
        exit
      end do
    end do
  end subroutine congruence_classes_find

  !> Whether a body represents its class.
  elemental logical function congruence_classes_is_representative(self, b) result(leads)
    class(congruence_classes_t), intent(in) :: self
    integer, intent(in) :: b  !! Number of the body.
    leads = self%first(b) == b
  end function congruence_classes_is_representative

  !> Number of classes.
  pure integer function congruence_classes_n(self) result(n)
    class(congruence_classes_t), intent(in) :: self
    integer :: b
    n = count([(self%first(b) == b, b=1, size(self%first))])
  end function congruence_classes_n

  !> Contact nodes of all bodies of a class, in the node numbers that the bodies have in common, and the number of
  !> contact rows of all bodies of the class.
  subroutine congruence_classes_contact_nodes(self, first, block, node, n_rows)
    class(congruence_classes_t), intent(in) :: self
    integer, intent(in) :: first  !! Representative of the class.
    type(contact_block_t), intent(in) :: block(:)  !! Contact operators of the bodies (n_bodies).
    integer, allocatable, intent(out) :: node(:)  !! Contact nodes, ascending (number of contact nodes).
    integer, intent(out) :: n_rows  !! Number of contact rows.
    logical, allocatable :: touched(:)
    integer, allocatable :: number(:)
    integer :: b, i
    n_rows = 0
    i = 0
    do b = first, size(block)
      if (self%first(b) == first .and. size(block(b)%contact_node) > 0) i = max(i, maxval(block(b)%node_numbers()))
    end do
    allocate (touched(i), source=.false.)
    do b = first, size(block)
      if (self%first(b) /= first) cycle
      n_rows = n_rows + size(block(b)%row)
      number = block(b)%node_numbers()
      touched(number) = .true.
    end do
    node = pack([(i, i=1, size(touched))], touched)
  end subroutine congruence_classes_contact_nodes
end module dotyk_control_congruence_classes
