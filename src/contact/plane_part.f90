!> The part of a plane master surface that a slave surface may touch.
!>
!> A floor or wall that many bodies touch has far more facets than any of them comes near. Within a search radius only
!> those near the slave matter; on a plane the others have the same normal, so that whether and why a point has no
!> projection does not depend on them either.
module dotyk_contact_plane_part
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_tri3, element_quad4, kind_nodes
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: find_plane_part

  integer, parameter :: many = 64  !! Fewer facets are cheap, and
  real(dp), parameter :: worthwhile = 0.7_dp  !! a part is worth while if it has fewer than this fraction of them.
  !> Rings of facets around those near the slave: normals of smooth surfaces come from four, and what is flat there is
  !> known from one more.
  integer, parameter :: n_rings = 6
  real(dp), parameter :: same_normal = 1.0e-12_dp  !! Normals that differ by less are the same [].

contains

  !> Find the part; without facets where the whole surface is to be taken.
  subroutine find_plane_part(x_a, surface_a, x_b, surface_b, radius, facet, part)
    real(dp), intent(in) :: x_a(:, :)  !! Nodes of the slave body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    real(dp), intent(in) :: x_b(:, :)  !! Nodes of the master body, likewise (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    real(dp), intent(in) :: radius  !! Search radius [length].
    integer, allocatable, intent(out) :: facet(:)  !! Facets of the master surface in the part, ascending (n).
    type(surface_t), intent(out) :: part  !! The part, as far as a pair needs it.
    real(dp) :: low(3), high(3), low_b(3), high_b(3), size_b
    logical :: marked(surface_b%n_facets), is_node(size(x_b, 2))
    integer :: f, k
    allocate (facet(0))
    if (size(x_b, 1) /= 3 .or. surface_b%n_facets < many) return
    if (.not. is_plane(x_b, surface_b)) return
    ! Facets of the slave near the plane, then those of the plane near these.
    call box_of(x_b, surface_b, low_b, high_b, size_b)
    call box_near(x_a, surface_a, low_b - radius - size_b, high_b + radius + size_b, low, high)
    if (any(low > high)) return
    do f = 1, surface_b%n_facets
      associate (x => x_b(:, surface_b%node(:kind_nodes(surface_b%kind(f)), f)))
        marked(f) = all(maxval(x, 2) + radius + size_b >= low .and. minval(x, 2) - radius - size_b <= high)
      end associate
    end do
    do k = 1, n_rings
      is_node = .false.
      do f = 1, surface_b%n_facets
        if (marked(f)) is_node(surface_b%node(:kind_nodes(surface_b%kind(f)), f)) = .true.
      end do
      do f = 1, surface_b%n_facets
        if (.not. marked(f)) marked(f) = any(is_node(surface_b%node(:kind_nodes(surface_b%kind(f)), f)))
      end do
    end do
    if (.not. any(marked) .or. count(marked) >= worthwhile*surface_b%n_facets) return
    facet = pack([(f, f=1, surface_b%n_facets)], marked)
    part%name = surface_b%name
    part%dimension = surface_b%dimension
    part%order_elevated = surface_b%order_elevated
    part%n_facets = size(facet)
    part%kind = surface_b%kind(facet)
    part%node = surface_b%node(:, facet)
    if (allocated(surface_b%entity)) part%entity = surface_b%entity(facet)
    if (allocated(surface_b%sheet)) part%sheet = surface_b%sheet(:, facet)
  end subroutine find_plane_part

  !> Whether all facets are plane and have the same normal.
  pure logical function is_plane(x, surface)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp) :: normal(3), first(3)
    integer :: f, c
    is_plane = .false.
    first = 0
    do f = 1, surface%n_facets
      if (all(surface%kind(f) /= [element_tri3, element_quad4])) return
      ! Two triangles of a quadrilateral; one twice of a triangle.
      do c = 3, kind_nodes(surface%kind(f))
        normal = cross(x(:, surface%node(c - 1, f)) - x(:, surface%node(1, f)), &
                       x(:, surface%node(c, f)) - x(:, surface%node(1, f)))
        if (.not. norm2(normal) > 0) return
        normal = normal/norm2(normal)
        if (f == 1 .and. c == 3) first = normal
        if (maxval(abs(normal - first)) > same_normal) return
      end do
    end do
    is_plane = .true.
  end function is_plane

  !> Bounding box of a surface, and of its largest facet the diagonal.
  pure subroutine box_of(x, surface, low, high, diagonal)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(out) :: low(3), high(3)  !! Lower and upper corner (3) [length].
    real(dp), intent(out) :: diagonal  !! Diagonal of the largest box of a facet [length].
    integer :: f
    low = huge(low)
    high = -huge(high)
    diagonal = 0
    do f = 1, surface%n_facets
      associate (of_facet => x(:, surface%node(:kind_nodes(surface%kind(f)), f)))
        low = min(low, minval(of_facet, 2))
        high = max(high, maxval(of_facet, 2))
        diagonal = max(diagonal, norm2(maxval(of_facet, 2) - minval(of_facet, 2)))
      end associate
    end do
  end subroutine box_of

  !> Bounding box of the facets of a surface whose boxes, widened by their own diagonals, meet another box.
  pure subroutine box_near(x, surface, other_low, other_high, low, high)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(in) :: other_low(3), other_high(3)  !! Corners of the other box (3) [length].
    !> Corners of the box; the lower one above the upper one where there is no such facet (3) [length].
    real(dp), intent(out) :: low(3), high(3)
    real(dp), dimension(3) :: own_low, own_high
    real(dp) :: margin
    integer :: f
    low = huge(low)
    high = -huge(high)
    do f = 1, surface%n_facets
      associate (of_facet => x(:, surface%node(:kind_nodes(surface%kind(f)), f)))
        own_low = minval(of_facet, 2)
        own_high = maxval(of_facet, 2)
      end associate
      margin = norm2(own_high - own_low)
      if (any(own_low - margin > other_high .or. own_high + margin < other_low)) cycle
      low = min(low, own_low - margin)
      high = max(high, own_high + margin)
    end do
  end subroutine box_near
end module dotyk_contact_plane_part
