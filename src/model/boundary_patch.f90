!> Parts of the boundaries of two bodies as the two sides of a contact pair: which facets, and which side is the slave.
module dotyk_model_boundary_patch
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: same_place, sharp_cosine
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: facet_graph_t  !! Facets at each corner node of a boundary.
    integer, allocatable :: start(:)  !! Facets at node i are facet(start(i):start(i+1)-1) (number of nodes + 1).
    integer, allocatable :: facet(:)  !! The facets.
  contains
    procedure :: init => graph_init
  end type facet_graph_t

  public :: grow_patch, first_is_slave

  !> Rings of facets beyond those opposite the other body: normals of smooth surfaces depend on the neighbours.
  integer, parameter :: rings = 1
  !> A planar side is the slave of a curved one where its mesh is finer by more than this factor [].
  real(dp), parameter :: much_finer = 2
  real(dp), parameter :: finer = 1.1_dp  !! Else the finer side is the slave, by more than this factor [].
  real(dp), parameter :: clearly = 1.01_dp  !! Else the softer side, or that of the smaller body, by more than this [].

contains

  !> Set up from a boundary.
  subroutine graph_init(self, boundary)
    class(facet_graph_t), intent(out) :: self
    type(surface_t), intent(in) :: boundary  !! The boundary.
    type(element_kind_t) :: kind
    integer, allocatable :: fill(:)
    integer :: f, i, n
    n = maxval(boundary%node)
    allocate (self%start(n + 1))
    self%start = 0
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      do i = 1, kind%n_corners
        associate (next => self%start(boundary%node(i, f) + 1))
          next = next + 1
        end associate
      end do
    end do
    self%start(1) = 1
    do i = 1, n
      self%start(i + 1) = self%start(i) + self%start(i + 1)
    end do
    allocate (self%facet(self%start(n + 1) - 1))
    fill = self%start
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      do i = 1, kind%n_corners
        associate (next => fill(boundary%node(i, f)))
          self%facet(next) = f
          next = next + 1
        end associate
      end do
    end do
  end subroutine graph_init

  !> Facets opposite another body, and the rings of facets around them on the same smooth sheet.
  subroutine grow_patch(boundary, graph, faces, near, patch)
    type(surface_t), intent(in) :: boundary  !! Boundary of the body.
    type(facet_graph_t), intent(in) :: graph  !! Facets at its nodes.
    type(body_faces_t), intent(in) :: faces  !! Its facets.
    integer, intent(in) :: near(:)  !! Facets opposite the other body, maybe several times (n_near).
    integer, allocatable, intent(out) :: patch(:)  !! Facets of the patch, ascending (n_patch).
    integer, allocatable :: ring(:)
    integer :: f, i, j, k, first, last, n
    allocate (ring(boundary%n_facets), source=0)
    allocate (patch(boundary%n_facets))
    n = 0
    do i = 1, size(near)
      if (ring(near(i)) > 0) cycle
      ring(near(i)) = 1
      n = n + 1
      patch(n) = near(i)
    end do
    first = 1
    do k = 1, rings
      last = n
      do i = first, last
        f = patch(i)
        do j = 1, faces%n_corners(f)
          call add_facets_at(boundary%node(j, f))
        end do
      end do
      first = last + 1
    end do
    patch = pack([(f, f=1, size(ring))], ring > 0)

  contains

    !> Add the facets at a node that continue the facet smoothly.
    subroutine add_facets_at(node)
      integer, intent(in) :: node  !! Node of the body.
      integer :: m
      do m = graph%start(node), graph%start(node + 1) - 1
        associate (g => graph%facet(m))
          if (ring(g) > 0) cycle
          if (dot_product(faces%normal(:, f), faces%normal(:, g)) < sharp_cosine) cycle
          ring(g) = 1
          n = n + 1
          patch(n) = g
        end associate
      end do
    end subroutine add_facets_at
  end subroutine grow_patch

  !> Whether the first of two sides is the slave: of a curved and a planar side the curved one, unless the planar one
  !> has a much finer mesh; else the finer one; else the softer one; else that of the smaller body; else the first.
  pure logical function first_is_slave(a, facet_a, young_a, b, facet_b, young_b) result(first)
    type(body_faces_t), intent(in) :: a  !! Facets of the first body.
    integer, intent(in) :: facet_a(:)  !! Those of the side (n_a).
    real(dp), intent(in) :: young_a  !! Young's modulus of the first body [pressure].
    type(body_faces_t), intent(in) :: b  !! Facets of the second body.
    integer, intent(in) :: facet_b(:)  !! Those of the side (n_b).
    real(dp), intent(in) :: young_b  !! Young's modulus of the second body [pressure].
    logical :: curved_a, curved_b
    real(dp) :: ratio
    curved_a = is_curved(a, facet_a)
    curved_b = is_curved(b, facet_b)
    ! Above 1 where the first side is finer.
    ratio = sum(b%spacing(facet_b))/size(facet_b)/(sum(a%spacing(facet_a))/size(facet_a))
    if (curved_a .neqv. curved_b) then
      first = curved_a
      if (merge(1/ratio, ratio, curved_a) > much_finer) first = .not. first
    else if (max(ratio, 1/ratio) > finer) then
      first = ratio > 1
    else if (max(young_a/young_b, young_b/young_a) > clearly) then
      first = young_a < young_b
    else if (max(a%diameter/b%diameter, b%diameter/a%diameter) > clearly) then
      first = a%diameter < b%diameter
    else
      first = .true.
    end if
  end function first_is_slave

  !> Whether a side is no plane.
  pure logical function is_curved(faces, facet)
    type(body_faces_t), intent(in) :: faces  !! Facets of the body.
    integer, intent(in) :: facet(:)  !! Those of the side (n).
    integer :: i
    is_curved = .true.
    do i = 1, size(facet)
      if (norm2(faces%normal(:, facet(i)) - faces%normal(:, facet(1))) > same_place) return
      if (faces%half_angle(facet(i)) > same_place) return
    end do
    is_curved = .false.
  end function is_curved
end module dotyk_model_boundary_patch
