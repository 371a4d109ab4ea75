!> Facets at the cuts of bolts: they are inside their bodies, and touch nothing but the other half.
module dotyk_model_cut_facets
  use dotyk_contact_near_facets, only: near_faces_t
  use dotyk_input_case, only: case_t
  use dotyk_input_cut, only: cut_surface
  use dotyk_model_body_surfaces, only: body_surfaces_t
  implicit none
  private

  type :: facet_mask_t  !! Of one body.
    !> Whether each facet of the boundary is at the cut; not allocated where the body is whole (n_facets).
    logical, allocatable :: facet(:)
  end type facet_mask_t

  type, public :: cut_facets_t  !! Of all bodies.
    type(facet_mask_t), allocatable, private :: body(:)  !! (n_bodies)
  contains
    procedure :: init => cut_facets_init
    procedure :: has => cut_facets_has
    procedure :: leave_out => cut_facets_leave_out
  end type cut_facets_t

contains

  !> Find the facets.
  subroutine cut_facets_init(self, case, surfaces)
    class(cut_facets_t), intent(out) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies; tables are made (n_bodies).
    integer :: b
    allocate (self%body(size(surfaces)))
    do b = 1, size(surfaces)
      if (case%body(b)%cut%is_cut()) call surfaces(b)%facets(surfaces(b)%find(cut_surface), self%body(b)%facet)
    end do
  end subroutine cut_facets_init

  !> Whether facets of a body are at its cut.
  pure function cut_facets_has(self, b, facet) result(has)
    class(cut_facets_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    integer, intent(in) :: facet(:)  !! Facets of its boundary (n).
    logical :: has(size(facet))
    has = .false.
    if (allocated(self%body(b)%facet)) has = self%body(b)%facet(facet)
  end function cut_facets_has

  !> Let such facets be opposite nothing.
  pure subroutine cut_facets_leave_out(self, near)
    class(cut_facets_t), intent(in) :: self
    type(near_faces_t), intent(inout) :: near(:)  !! Facets near each other, by couples of bodies (n_couples).
    integer :: i
    do i = 1, size(near)
      near(i)%opposite = near(i)%opposite .and. .not. (self%has(near(i)%body_a, near(i)%facet_a) .or. &
                                                       self%has(near(i)%body_b, near(i)%facet_b))
    end do
  end subroutine cut_facets_leave_out
end module dotyk_model_cut_facets
