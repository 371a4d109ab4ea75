!> The surfaces of one body that contact pairs may need: those that the input names, and the whole boundary.
module dotyk_model_body_surfaces
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_mesh_surface, only: facets_in_boundary, surface_t
  implicit none
  private

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
end module dotyk_model_body_surfaces
