!> The rows of a contact pair: dual mortar rows at the vertices of the slave surface, or integration points by
!> themselves; and the point contacts of vertices and edges, each a row by itself.
!>
!> Where the master covers little of the surface around a slave vertex, its row holds it in place as if the master went
!> on, and its pressure is the force that this takes, over a sliver: no measure of the pressure in the contact zone.
!>
!> Surfaces far from the origin have a local one, so that gaps keep their accuracy there.
module dotyk_contact_pair_rows
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_quadrature
  use dotyk_base_thresholds, only: pi
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_dual_mortar, only: dual_mortar_rows
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_contact_point_contacts, only: point_contact_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes
  use dotyk_mesh_facet, only: area_vector
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: replace_points, row_gaps, set_rows, choose_origin, shift_origin

  !> A surface is far from the origin where its distance exceeds this multiple of its size.
  real(dp), parameter :: far_ratio = 16

contains

  !> Keep some integration points of a pair, and append point contacts.
  subroutine replace_points(kept, contact, pair)
    logical, intent(in) :: kept(:)  !! Points to keep (n_points).
    type(point_contact_t), intent(in) :: contact(:)  !! Point contacts (n).
    type(contact_pair_t), intent(inout) :: pair  !! Pair; its points are replaced.
    integer, allocatable :: list(:)
    integer :: d, i
    d = pair%dimension
    list = pack([(i, i=1, pair%n_points)], kept)
    pair%position = reshape([pair%position(:, list), [(contact(i)%position(1:d), i=1, size(contact))]], &
                            [d, size(list) + size(contact)])
    pair%normal = reshape([pair%normal(:, list), [(contact(i)%normal(1:d), i=1, size(contact))]], &
                          [d, size(list) + size(contact)])
    pair%xi_a = reshape([pair%xi_a(:, list), [(contact(i)%xi_a(1:d - 1), i=1, size(contact))]], &
                        [d - 1, size(list) + size(contact)])
    pair%xi_b = reshape([pair%xi_b(:, list), [(contact(i)%xi_b(1:d - 1), i=1, size(contact))]], &
                        [d - 1, size(list) + size(contact)])
    pair%weight = [pair%weight(list), contact%weight]
    pair%gap = [pair%gap(list), contact%gap]
    pair%bend = [pair%bend(list), [(0.0_dp, i=1, size(contact))]]
    pair%curved = [pair%curved(list), [(0.0_dp, i=1, size(contact))]]
    pair%uncertainty = [pair%uncertainty(list), [(0.0_dp, i=1, size(contact))]]
    pair%facet_a = [pair%facet_a(list), contact%facet_a]
    pair%facet_b = [pair%facet_b(list), contact%facet_b]
    pair%sheet_b = [pair%sheet_b(list), [(0, i=1, size(contact))]]
    pair%n_points = size(list) + size(contact)
  end subroutine replace_points

  !> Set the rows from the integration points. Each point a row is equation (18) literally; mortar rows have the
  !> weighted mean of the gap before it is squared.
  subroutine set_rows(division, axisymmetric, mesh_a, surface_a, origin, n_contacts, pair)
    type(division_t), intent(in) :: division  !! How ranks divide the slave facets.
    logical, intent(in) :: axisymmetric  !! Whether weights include the circumference 2 pi r.
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body, in shifted coordinates.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    real(dp), intent(in) :: origin(3)  !! Local origin (3) [length].
    integer, intent(in) :: n_contacts  !! Number of point contacts, the last integration points.
    type(contact_pair_t), intent(inout) :: pair  !! Pair; its points are given, its rows are set.
    type(corner_interpolation_t) :: corners
    type(sparse_rows_t) :: mortar
    real(dp), allocatable :: covered(:)
    integer :: c, i, n, m
    n = 0
    if (pair%discretization /= discretization_quadrature) n = pair%n_points - n_contacts
    pair%n_mortar_points = n
    pair%n_point_contacts = n_contacts
    allocate (pair%row_corner(0), pair%row_weight(0))
    m = 0
    if (n > 0) then
      call corners%init(surface_a, pair%facet_a(1:n), pair%xi_a(:, 1:n), pair%sheet_b(1:n))
      deallocate (pair%row_corner, pair%row_weight)
      call dual_mortar_rows(division, corners, pair%facet_a(1:n), pair%weight(1:n), pair%gap(1:n), &
                            pair%normal(:, 1:n), axisymmetric, pair%row_corner, pair%row_weight, mortar)
      m = size(pair%row_corner)
      call vertex_coverage(pair%facet_a(1:n), pair%weight(1:n), axisymmetric, surface_a, mesh_a%x, corners, covered)
      pair%row_covered = covered(pair%row_corner)
    else
      allocate (pair%row_covered(0))
    end if
    pair%n_mortar_rows = m
    pair%n_rows = m + pair%n_points - n
    if (m == 0) then
      call pair%average%set_identity(pair%n_points)
    else
      call append_identity(mortar, pair%n_points - n, pair%average)
    end if
    allocate (pair%row_position(pair%dimension, pair%n_rows), pair%row_normal(pair%dimension, pair%n_rows), &
              pair%row_gap(pair%n_rows))
    if (m > 0) then
      pair%row_position(:, 1:m) = mesh_a%x(:, corners%corner_node(pair%row_corner))
      call shift_origin(pair%row_position(:, 1:m), -origin)
    end if
    pair%row_position(:, m + 1:) = pair%position(:, n + 1:)
    pair%row_weight = [pair%row_weight, pair%weight(n + 1:)]
    call pair%average%multiply(pair%gap, pair%row_gap)
    do c = 1, pair%dimension
      call pair%average%multiply(pair%normal(c, :), pair%row_normal(c, :))
    end do
    do i = 1, m
      pair%row_normal(:, i) = pair%row_normal(:, i)/max(norm2(pair%row_normal(:, i)), tiny(1.0_dp))
    end do
  end subroutine set_rows

  !> Gaps that the rows would have if they were made for the gaps of the points: mortar functions on facets that are
  !> covered in part depend on the gap.
  subroutine row_gaps(axisymmetric, surface_a, pair, row_gap)
    logical, intent(in) :: axisymmetric  !! Whether weights include the circumference 2 pi r.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(contact_pair_t), intent(in) :: pair  !! Pair with its rows, made for other gaps.
    real(dp), allocatable, intent(out) :: row_gap(:)  !! The gaps (n_rows) [length].
    type(corner_interpolation_t) :: corners
    type(sparse_rows_t) :: mortar
    integer, allocatable :: row_corner(:)
    real(dp), allocatable :: row_weight(:)
    allocate (row_gap(pair%n_rows))
    associate (n => pair%n_mortar_points)
      row_gap(pair%n_mortar_rows + 1:) = pair%gap(n + 1:)
      if (n == 0) return
      call corners%init(surface_a, pair%facet_a(1:n), pair%xi_a(:, 1:n), pair%sheet_b(1:n))
      call dual_mortar_rows(division_t(), corners, pair%facet_a(1:n), pair%weight(1:n), pair%gap(1:n), &
                            pair%normal(:, 1:n), axisymmetric, row_corner, row_weight, mortar)
      call mortar%multiply(pair%gap(1:n), row_gap(1:pair%n_mortar_rows))
    end associate
  end subroutine row_gaps

  !> Rows of a matrix, and after them rows that each have a one in one of as many further columns.
  subroutine append_identity(matrix, n, extended)
    type(sparse_rows_t), intent(in) :: matrix  !! Matrix (n_rows x n_columns) [any].
    integer, intent(in) :: n  !! Number of further rows and columns.
    type(sparse_rows_t), intent(inout) :: extended  !! Extended matrix (n_rows+n x n_columns+n) [any].
    integer :: i
    extended%n_rows = matrix%n_rows + n
    extended%n_columns = matrix%n_columns + n
    extended%row_start = [matrix%row_start, (matrix%row_start(matrix%n_rows + 1) + i, i=1, n)]
    extended%column = [matrix%column, (matrix%n_columns + i, i=1, n)]
    extended%value = [matrix%value, (1.0_dp, i=1, n)]
  end subroutine append_identity

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

  !> Local origin: zero, except for a surface that is far from the origin, where sums of coordinates would lose the
  !> significant digits of the gaps; differences of coordinates do not.
  pure subroutine choose_origin(x, surface, origin)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    real(dp), intent(out) :: origin(:)  !! A node of the surface, or zero (dimension) [length].
    real(dp) :: low(size(origin)), high(size(origin))
    integer :: f, i
    low = huge(1.0_dp)
    high = -huge(1.0_dp)
    do f = 1, surface%n_facets
      do i = 1, kind_nodes(surface%kind(f))
        low = min(low, x(:, surface%node(i, f)))
        high = max(high, x(:, surface%node(i, f)))
      end do
    end do
    origin = 0
    if (surface%n_facets == 0) return
    if (maxval(abs(low + high)/2) > far_ratio*maxval(high - low)) origin = x(:, surface%node(1, 1))
  end subroutine choose_origin

  !> Subtract an origin from coordinates.
  pure subroutine shift_origin(x, origin)
    real(dp), intent(inout) :: x(:, :)  !! Coordinates (dimension, n) [length].
    real(dp), intent(in) :: origin(3)  !! Origin (3) [length].
    integer :: i
    do i = 1, size(x, 2)
      x(:, i) = x(:, i) - origin(1:size(x, 1))
    end do
  end subroutine shift_origin
end module dotyk_contact_pair_rows
