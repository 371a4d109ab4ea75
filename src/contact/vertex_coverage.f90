!> How much of the surface around a slave vertex the master covers.
!>
!> Where that is little, the row of the vertex holds it in place as if the master went on, and its pressure is the force
!> that this takes, over a sliver: no measure of the pressure in the contact zone.
module dotyk_contact_vertex_coverage
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: area_vector
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: vertex_coverage

  real(dp), parameter :: pi = acos(-1.0_dp)

contains

  !> Covered fraction of the area around each corner of the slave side.
  subroutine vertex_coverage(facet, weight, axisymmetric, surface, x, side, covered)
    integer, intent(in) :: facet(:)  !! Slave facet of each integration point (n_points).
    real(dp), intent(in) :: weight(:)  !! Weights of the points (n_points) [length^2; length in two dimensions].
    logical, intent(in) :: axisymmetric  !! Whether they include the circumference 2 pi r.
    type(surface_t), intent(in) :: surface  !! Slave surface.
    real(dp), intent(in) :: x(:, :)  !! Nodes of its body (dimension, n_nodes) [length].
    type(corner_interpolation_t), intent(in) :: side  !! Interpolation on the slave surface.
    real(dp), allocatable, intent(out) :: covered(:)  !! Fractions (side%n) [].
    type(element_kind_t) :: kind
    real(dp), allocatable :: around(:, :)
    real(dp) :: whole(side%n), area
    integer, allocatable :: sheet(:, :)
    integer :: c, f, q
    allocate (sheet(4, surface%n_facets), source=1)
    if (allocated(surface%sheet)) sheet = surface%sheet(:, :surface%n_facets)
    allocate (around(maxval([1, sheet]), size(x, 2)), source=0.0_dp)
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      associate (m => kind%n_corners)
        area = norm2(area_vector(x(:, surface%node(:m, f))))
        do c = 1, m
          associate (whole_area => around(sheet(c, f), surface%node(c, f)))
            if (axisymmetric) then
              whole_area = whole_area + area*2*pi*(x(1, surface%node(c, f)) + sum(x(1, surface%node(:m, f))))/6
            else
              whole_area = whole_area + area/m
            end if
          end associate
        end do
      end associate
    end do
    whole = 0
    do q = 1, size(facet)
      f = facet(q)
      do c = 1, count(side%corner(:, q) > 0)
        whole(side%corner(c, q)) = around(sheet(c, f), surface%node(c, f))
      end do
    end do
    allocate (covered(side%n))
    call side%moments(weight, covered)
    where (whole > 0)
      covered = covered/whole
    else where
      covered = 1
    end where
  end subroutine vertex_coverage
end module dotyk_contact_vertex_coverage
