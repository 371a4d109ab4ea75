!> Complementarity error: the work of the contact pressure on the gaps that remain under it between the mortar rows,
!> which meet the contact conditions in the mean only.
!>
!> For the exact pressure p and any admissible displacement u_h, the energy exceeds its minimum by two terms: `2 (F(u_h)
!> - F(u)) = ||u - u_h||_A^2 + 2 int p (d - B u_h) dS`. The second term is not part of the energy norm of the error, but
!> measures how well the contact is resolved. It is computed facet by facet, with the row pressures interpolated
!> linearly between vertices.
module dotyk_contact_complementarity
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_facet_bending, only: bending_of_points
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_mesh_element, only: kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: complementarity_error

contains

  !> Sum over the slave facets of the absolute work of the pressure on the gap under it, the compression of the penalty
  !> layer deducted [energy].
  real(dp) function complementarity_error(pair, surface_a, surface_b, u_a, u_b, pressure, row_theta) &
    result(total)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    real(dp), intent(in) :: u_a(:, :)  !! Displacements of body a (dimension, n_nodes) [length].
    real(dp), intent(in) :: u_b(:, :)  !! Displacements of body b (dimension, n_nodes) [length].
    real(dp), intent(in) :: pressure(:)  !! Row pressures (n_rows) [pressure].
    real(dp), intent(in) :: row_theta(:)  !! Penalty parameters of the solution (n_rows) [length/pressure].
    real(dp), allocatable :: p(:), gap(:), work(:)
    integer :: first, last
    call gaps_under_pressure(pair, surface_a, surface_b, u_a, u_b, pressure, row_theta, p, gap)
    allocate (work(pair%n_points))
    work = pair%weight*p*gap
    total = 0
    first = 1
    do while (first <= pair%n_points)
      last = first
      do while (last < pair%n_points)
        if (pair%facet_a(last + 1) /= pair%facet_a(first)) exit
        last = last + 1
      end do
      total = total + abs(sum(work(first:last)))
      first = last + 1
    end do
  end function complementarity_error

  !> Pressures and gaps of the deformed bodies at the integration points.
  subroutine gaps_under_pressure(pair, surface_a, surface_b, u_a, u_b, pressure, row_theta, p, gap)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    real(dp), intent(in) :: u_a(:, :)  !! Displacements of body a (dimension, n_nodes) [length].
    real(dp), intent(in) :: u_b(:, :)  !! Displacements of body b (dimension, n_nodes) [length].
    real(dp), intent(in) :: pressure(:)  !! Row pressures (n_rows) [pressure].
    real(dp), intent(in) :: row_theta(:)  !! Penalty parameters of the solution (n_rows) [length/pressure].
    !> Pressures, interpolated linearly between vertices (n_points) [pressure].
    real(dp), allocatable, intent(out) :: p(:)
    !> Gaps, the compression of the penalty layer deducted (n_points) [length].
    real(dp), allocatable, intent(out) :: gap(:)
    type(corner_interpolation_t) :: corners
    real(dp), allocatable :: at_corner(:), theta_at_corner(:)
    real(dp) :: bend(pair%n_points), relative(size(u_a, 1)), theta
    integer :: i, n
    allocate (p(pair%n_points), gap(pair%n_points))
    bend = bending_of_points(pair, surface_a, pressure, 0*pair%bend)
    if (pair%n_mortar_points > 0) then
      call corners%init(surface_a, pair%facet_a(1:pair%n_mortar_points), pair%xi_a(:, 1:pair%n_mortar_points), &
                        pair%sheet_b(1:pair%n_mortar_points))
      ! Vertices without a row have almost no area.
      allocate (at_corner(corners%n), theta_at_corner(corners%n), source=0.0_dp)
      at_corner(pair%row_corner) = pressure(1:pair%n_mortar_rows)
      theta_at_corner(pair%row_corner) = row_theta(1:pair%n_mortar_rows)
    end if
    do i = 1, pair%n_points
      if (i > pair%n_mortar_points) then
        p(i) = pressure(pair%n_mortar_rows + i - pair%n_mortar_points)
        theta = row_theta(pair%n_mortar_rows + i - pair%n_mortar_points)
      else
        n = count(corners%corner(:, i) > 0)
        p(i) = dot_product(corners%shape(:n, i), at_corner(corners%corner(:n, i)))
        theta = dot_product(corners%shape(:n, i), theta_at_corner(corners%corner(:n, i)))
      end if
      relative = displacement(surface_a, pair%facet_a(i), pair%xi_a(:, i), u_a) - &
                displacement(surface_b, pair%facet_b(i), pair%xi_b(:, i), u_b)
      gap(i) = pair%gap(i) + bend(i) + theta*p(i) - dot_product(pair%normal(:, i), relative)
    end do
  end subroutine gaps_under_pressure

  !> Displacement at a point of a facet.
  pure function displacement(surface, facet, xi, u) result(value)
    type(surface_t), intent(in) :: surface  !! Surface.
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: xi(:)  !! Reference coordinates (dimension-1) [].
    real(dp), intent(in) :: u(:, :)  !! Nodal displacements of the body (dimension, n_nodes) [length].
    real(dp) :: value(size(u, 1))  !! Displacement (dimension) [length].
    real(dp) :: shape(max_facet_nodes)
    integer :: n, i
    n = kind_nodes(surface%kind(facet))
    call shape_functions(surface%kind(facet), xi, shape(:n))
    value = 0
    do i = 1, n
      value = value + shape(i)*u(:, surface%node(i, facet))
    end do
  end function displacement
end module dotyk_contact_complementarity
