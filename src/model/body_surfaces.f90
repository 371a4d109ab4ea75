!> The surfaces of one body that contact pairs may need: those that the input names, and the whole boundary.
!>
!> Each rank goes on to hold the bodies that it computes, and of others, which have one rank each, their surfaces.
module dotyk_model_body_surfaces
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t, hold_surface
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_mesh_held_part, only: held_surface, surface_part
  use dotyk_mesh_surface, only: facets_in_boundary, surface_t
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: hold_parts, keep_surface

  type :: facet_numbers_t  !! Facets of a surface by their numbers in the boundary.
    integer, allocatable :: of(:)  !! The numbers (n_facets); not allocated until they are asked for.
  end type facet_numbers_t

  type, public :: body_surfaces_t  !! Surfaces of a body.
    type(surface_t) :: boundary  !! The whole boundary; without facets where no search needs it.
    integer :: n = 0  !! Number of named surfaces.
    type(text_t), allocatable :: name(:)  !! Names in the input, with wildcards; the first n are used (n_allocated).
    type(surface_t), allocatable :: surface(:)  !! The surfaces; the first n are in use (n_allocated).
    !> Their facets in the boundary; the first n are in use (n_allocated).
    type(facet_numbers_t), allocatable, private :: number(:)
  contains
    procedure :: find => surfaces_find
    procedure :: facets => surfaces_facets
    procedure :: add => surfaces_add
    procedure :: carry => surfaces_carry
  end type body_surfaces_t

contains

  !> Index of a named surface; 0 where the body has none of the name.
  pure integer function surfaces_find(self, name) result(place)
    class(body_surfaces_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name as the input has it.
    do place = 1, self%n
      if (self%name(place)%s == name) return
    end do
    place = 0
  end function surfaces_find

  !> Which facets of the boundary belong to a named surface.
  subroutine surfaces_facets(self, place, belongs)
    class(body_surfaces_t), intent(inout) :: self
    integer, intent(in) :: place  !! Index of the surface.
    logical, allocatable, intent(out) :: belongs(:)  !! Whether a facet belongs to it (boundary%n_facets).
    if (.not. allocated(self%number(place)%of)) &
      call facets_in_boundary(self%boundary, self%surface(place), self%number(place)%of)
    allocate (belongs(self%boundary%n_facets))
    belongs = .false.
    belongs(self%number(place)%of) = .true.
  end subroutine surfaces_facets

  !> Add a named surface.
  subroutine surfaces_add(self, name, surface)
    class(body_surfaces_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Name as the input has it.
    type(surface_t), intent(in) :: surface  !! The surface.
    type(text_t), allocatable :: names(:)
    type(surface_t), allocatable :: surfaces(:)
    type(facet_numbers_t), allocatable :: numbers(:)
    integer :: i
    if (.not. allocated(self%name)) allocate (self%name(2), self%surface(2), self%number(2))
    if (self%n == size(self%name)) then
      allocate (names(2*self%n), surfaces(2*self%n), numbers(2*self%n))
      do i = 1, self%n
        names(i)%s = self%name(i)%s
        surfaces(i) = self%surface(i)
      end do
      call move_alloc(names, self%name)
      call move_alloc(surfaces, self%surface)
      call move_alloc(numbers, self%number)
    end if
    self%n = self%n + 1
    self%name(self%n)%s = name
    self%surface(self%n) = surface
  end subroutine surfaces_add

  !> Put the surfaces into a parcel, or take them out.
  subroutine surfaces_carry(self, parcel)
    class(body_surfaces_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    character(:), allocatable :: name
    type(surface_t) :: none
    integer :: n, i
    call self%boundary%carry(parcel)
    n = self%n
    call parcel%carry(n)
    do i = 1, n
      if (parcel%is_read) then
        call self%add('', none)
      else
        name = self%name(i)%s
      end if
      call parcel%carry(name)
      self%name(i)%s = name
      call self%surface(i)%carry(parcel)
    end do
  end subroutine surfaces_carry

  !> Give up what this rank does not need. Rigid body modes are found before where other ranks compute the body, and
  !> after it, by all ranks together, where each has a part.
  subroutine hold_parts(classes, ranks, body, surfaces, modes)
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(body_t), intent(inout) :: body(:)  !! Bodies with supports and loads, not assembled (n_bodies).
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Their surfaces; by held nodes on return (n_bodies).
    !> Rigid body modes that supports leave; found for bodies that are not held wholly, at the held nodes (n_bodies).
    type(body_modes_t), allocatable, intent(out) :: modes(:)
    integer :: b
    allocate (modes(size(body)))
    if (n_ranks() == 1) return
    if (.not. ranks%are_split()) then
      call hold_surfaces(classes, ranks, body, surfaces, modes)
      return
    end if
    do b = 1, size(body)
      call modes(b)%find(body(b))
    end do
  end subroutine hold_parts

  !> Give up the volumes of bodies that this rank neither solves nor factorizes.
  subroutine hold_surfaces(classes, ranks, body, surfaces, modes)
    type(congruence_classes_t), intent(in) :: classes  !! As in `hold_parts`.
    type(body_ranks_t), intent(in) :: ranks  !! As in `hold_parts`.
    type(body_t), intent(inout) :: body(:)  !! As in `hold_parts`.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! As in `hold_parts`.
    type(body_modes_t), intent(inout) :: modes(:)  !! As in `hold_parts`.
    logical :: holds(size(body))
    logical, allocatable :: sample(:)
    integer :: b, c
    holds = ranks%factorizes .or. ranks%is_own([(b, b=1, size(body))])
    do b = 1, size(body)
      if (.not. classes%is_representative(b) .or. all(holds .or. classes%first /= b)) cycle
      call modes(b)%find(body(b))
      do c = b + 1, size(body)
        if (classes%first(c) /= b .or. holds(c)) cycle
        call modes(c)%move(modes(b), classes%motion(c), body(c))
        call keep_surface(body(c), surfaces(c), modes(c))
      end do
      if (holds(b)) cycle
      call keep_surface(body(b), surfaces(b), modes(b))
    end do
    do b = 1, size(body)
      if (holds(b)) call surface_part(body(b)%mesh, sample, body(b)%shared_node)
    end do
  end subroutine hold_surfaces

  !> Give up the volume of a body.
  subroutine keep_surface(body, surfaces, modes)
    type(body_t), intent(inout) :: body  !! The body.
    type(body_surfaces_t), intent(inout) :: surfaces  !! Its surfaces.
    type(body_modes_t), intent(inout) :: modes  !! Its rigid body modes.
    integer, allocatable :: number(:)
    call hold_surface(body, number)
    call follow(body, number, surfaces)
    call modes%hold_nodes(body%mesh%whole%node)
  end subroutine keep_surface

  !> Reduce surfaces to what is held of their body.
  subroutine follow(body, number, surfaces)
    type(body_t), intent(in) :: body  !! Reduced.
    integer, intent(in) :: number(:)  !! Number of each node of the whole body in it (n_nodes).
    type(body_surfaces_t), intent(inout) :: surfaces  !! Surfaces of the body.
    integer :: k
    if (surfaces%boundary%n_facets > 0) call held_surface(body%mesh, number, surfaces%boundary)
    do k = 1, surfaces%n
      call held_surface(body%mesh, number, surfaces%surface(k))
    end do
  end subroutine follow
end module dotyk_model_body_surfaces
