!> Dual mortar rows: the contact conditions at the vertices of the slave surface as integrals with dual (biorthogonal)
!> shape functions.
!>
!> The dual Lagrange multiplier basis is that of Wohlmuth (SIAM J. Numer. Anal. 38, 2000), used for contact by Popp, Gee
!> and Wall (Int. J. Numer. Methods Engrg. 79, 2009). On one slave facet, over those of its integration points that have
!> a projection, the linear shape functions phi of the corners have the mass matrix M = sum_q w_q phi phi^T and the
!> areas D = diag(sum_q w_q phi). The dual functions psi = D M^{-1} phi fulfil sum_q w_q psi_i phi_j = D_i delta_ij and
!> sum_i psi_i = 1. The sums run over the covered part of the facet only: the consistent treatment of the boundary of
!> the contact zone (Cichosz and Bischoff, Comput. Methods Appl. Mech. Engrg. 200, 2011).
!>
!> The row of vertex i is the weighted mean sum_q w_q psi_i(x_q) (.) / w_i with w_i = sum_q w_q psi_i(x_q) over all
!> facets at i: weighted gap, weighted normal and weighted relative displacement. A continuous field that is linear on
!> each facet has its value at the vertex as its weighted mean; the weights w_i are positive, and their sum is the area.
!>
!> A vertex outside the boundary of the master surface may have next to no area. Its row would be almost a combination
!> of its neighbours' rows and its pressure noise, so that it gets none: on its facets, its phi is added to those of its
!> neighbours before the dual functions are formed. Where M is still singular (too few points), phi replaces psi; the
!> areas are the same.
!>
!> Where a facet is covered in part, psi extrapolates to its corners. Faces that are inclined to each other have the gap
!> of the plane beyond the edge of the master surface then, which may be negative though nothing overlaps: contact
!> through a body. So it is where an edge of the master surface lies across the facet: large gaps beyond the edge count
!> as negative ones at the corners that are far from it. Where a row would overlap deeper than each of its points, and
!> one of its facets extrapolates to its vertex, phi replaces psi on all of them: its means lie between the gaps at the
!> points.
module dotyk_contact_dual_mortar
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: same_place, sharp_cosine
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: dual_mortar_rows

  !> Vertices with less than this fraction of the weight of one of their neighbours get no row. (The smallest
  !> eigenvalues of the compliance are proportional to the square root of this ratio.)
  real(dp), parameter :: min_weight_ratio = 0.02_dp
  !> M is singular where the smallest eigenvalue of D^{-1/2} M D^{-1/2} is below this (the largest is 1). A whole facet
  !> has 1/3 (line), 1/4 (triangle), 1/9 (quadrilateral), a strip along the edge of a facet 1/6 of its relative width.
  real(dp), parameter :: min_eigenvalue = 1.0e-3_dp
  !> Dual functions of facets with 1 to 4 corners extrapolate where the sum of their absolute values exceeds their sum
  !> by this factor: a whole line has 1.7, a triangle 2.4, a square 2.8 (up to 3.0 by two Gauss points in each
  !> direction), half a line 5, a strip of the relative width b 3/b.
  real(dp), parameter :: greatest_amplification(4) = [1.1_dp, 1.8_dp, 2.6_dp, 3.1_dp]
  real(dp), parameter :: at_axis = 2.5_dp  !! The same of a line that ends at the axis: a whole one has 2.4.

contains

  !> Dual mortar rows at all vertices of facets that carry integration points.
  subroutine dual_mortar_rows(division, corners, facet, weight, gap, normal, axisymmetric, row_corner, &
                              row_weight, mortar)
    type(division_t), intent(in) :: division  !! How ranks divide the facets.
    !> Corners of the facets and their shape functions at the points.
    type(corner_interpolation_t), intent(in) :: corners
    integer, intent(in) :: facet(:)  !! Slave facet of each point, ascending (n_points).
    !> Quadrature weights of the points (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: weight(:)
    real(dp), intent(in) :: gap(:)  !! Gaps of the points (n_points) [length].
    real(dp), intent(in) :: normal(:, :)  !! Unit normals at the points (dimension, n_points) [].
    logical, intent(in) :: axisymmetric  !! Whether the weights include the circumference.
    integer, allocatable, intent(out) :: row_corner(:)  !! Corner of each row, ascending (n_rows).
    !> Weights w of the rows (n_rows) [length^2; length in two dimensions].
    real(dp), allocatable, intent(out) :: row_weight(:)
    !> Coefficients w_q psi_i(x_q) / w_i of the points in the rows (n_rows x n_points) [].
    type(sparse_rows_t), intent(inout) :: mortar
    real(dp), allocatable :: dual(:, :), total(:), value(:)
    integer, allocatable :: row_of(:), row(:), column(:), first(:)
    logical, allocatable :: dropped(:), extrapolates(:), replaced(:)
    integer :: n, i, j, k, first_own, last_own
    allocate (dual(4, size(facet)), source=0.0_dp)
    allocate (total(corners%n), row_of(corners%n))
    call find_vertices_without_row(corners, weight, dropped)
    ! The part of a facet that faces one sheet of the master surface.
    n = size(facet)
    first = [pack([(i, i=1, n)], [.true., facet(2:) /= facet(:n - 1) .or. &
                                  corners%corner(1, 2:) /= corners%corner(1, :n - 1)]), n + 1]
    call division%portion(real(first(2:) - first(:size(first) - 1), dp), first_own, last_own)
    do i = first_own, last_own
      n = count(corners%corner(:, first(i)) > 0)
      associate (corner => corners%corner(1:n, first(i)), last => first(i + 1) - 1)
        call facet_functions(dropped(corner), weight(first(i):last), corners%shape(1:n, first(i):last), .true., &
                             dual(1:n, first(i):last))
      end associate
    end do
    call division%fill(dual, first(first_own), first(last_own + 1) - 1)
    total = 0
    do i = 1, size(first) - 1
      n = count(corners%corner(:, first(i)) > 0)
      associate (corner => corners%corner(1:n, first(i)), last => first(i + 1) - 1)
        total(corner) = total(corner) + matmul(dual(1:n, first(i):last), weight(first(i):last))
      end associate
    end do
    allocate (replaced(size(first) - 1), source=.false.)
    do
      call find_extrapolations(corners, first, weight, gap, normal, axisymmetric, dual, total, extrapolates)
      extrapolates = extrapolates .and. .not. replaced
      if (.not. any(extrapolates)) exit
      replaced = replaced .or. extrapolates
      do i = 1, size(first) - 1
        if (.not. extrapolates(i)) cycle
        n = count(corners%corner(:, first(i)) > 0)
        associate (corner => corners%corner(1:n, first(i)), last => first(i + 1) - 1)
          call facet_functions(dropped(corner), weight(first(i):last), corners%shape(1:n, first(i):last), .false., &
                               dual(1:n, first(i):last))
        end associate
      end do
    end do
    row_of = 0
    n = 0
    do k = 1, corners%n
      if (dropped(k)) cycle
      n = n + 1
      row_of(k) = n
    end do
    row_corner = pack([(k, k=1, corners%n)], .not. dropped)
    row_weight = pack(total, .not. dropped)
    allocate (row(4*size(facet)), column(4*size(facet)), value(4*size(facet)))
    n = 0
    do i = 1, size(facet)
      do j = 1, count(corners%corner(:, i) > 0)
        k = row_of(corners%corner(j, i))
        if (k == 0) cycle
        n = n + 1
        row(n) = k
        column(n) = i
        value(n) = weight(i)*dual(j, i)/row_weight(k)
      end do
    end do
    call mortar%init_from_triplets(size(row_corner), size(facet), row(1:n), column(1:n), value(1:n))
  end subroutine dual_mortar_rows

  !> Facets at a vertex whose row overlaps deeper than each of its points, where the dual functions of one of them
  !> extrapolate to it: the vertex is beyond the covered part of the surface, whatever another facet shows.
  subroutine find_extrapolations(corners, first, weight, gap, normal, axisymmetric, dual, total, extrapolates)
    !> Corners of the facets and their shape functions at the points.
    type(corner_interpolation_t), intent(in) :: corners
    !> Points of the facet number i in the list are first(i) .. first(i+1)-1 (n_facets + 1).
    integer, intent(in) :: first(:)
    !> Quadrature weights of the points (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: weight(:)
    real(dp), intent(in) :: gap(:)  !! Gaps of the points (n_points) [length].
    real(dp), intent(in) :: normal(:, :)  !! Unit normals at the points (dimension, n_points) [].
    logical, intent(in) :: axisymmetric  !! Whether the weights include the circumference.
    real(dp), intent(in) :: dual(:, :)  !! Dual functions of the corners at the points (4, n_points) [].
    real(dp), intent(in) :: total(:)  !! Weights of the vertices (corners%n) [length^2; length in two dimensions].
    logical, allocatable, intent(out) :: extrapolates(:)  !! The facets (n_facets).
    real(dp), dimension(corners%n) :: mean, least, greatest
    logical :: is_below(corners%n), is_beyond(corners%n)
    real(dp) :: limit
    integer :: i, k, n
    mean = 0
    least = huge(least)
    greatest = 0
    do k = 1, size(gap)
      n = count(corners%corner(:, k) > 0)
      associate (corner => corners%corner(1:n, k))
        mean(corner) = mean(corner) + weight(k)*dual(1:n, k)*gap(k)
        least(corner) = min(least(corner), gap(k))
        greatest(corner) = max(greatest(corner), abs(gap(k)))
      end associate
    end do
    is_below = mean < min(-same_place*greatest, least - same_place*greatest)*total
    allocate (extrapolates(size(first) - 1), source=.false.)
    if (.not. any(is_below)) return
    is_beyond = .false.
    do i = 1, size(extrapolates)
      n = count(corners%corner(:, first(i)) > 0)
      limit = merge(at_axis, greatest_amplification(n), axisymmetric)
      associate (normals => normal(:, first(i):first(i + 1) - 1))
        if (minval(matmul(transpose(normals), normals)) < sharp_cosine) limit = 1
      end associate
      do k = 1, n
        if (.not. is_below(corners%corner(k, first(i)))) cycle
        associate (value => weight(first(i):first(i + 1) - 1)*dual(k, first(i):first(i + 1) - 1))
          if (sum(abs(value)) > limit*sum(value)) is_beyond(corners%corner(k, first(i))) = .true.
        end associate
      end do
    end do
    do i = 1, size(extrapolates)
      extrapolates(i) = any(is_beyond(pack(corners%corner(:, first(i)), corners%corner(:, first(i)) > 0)))
    end do
  end subroutine find_extrapolations

  !> Vertices that get no row; each facet keeps at least one vertex with a row.
  subroutine find_vertices_without_row(corners, weight, dropped)
    !> Corners of the facets and their shape functions at the points.
    type(corner_interpolation_t), intent(in) :: corners
    !> Quadrature weights of the points (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: weight(:)
    logical, allocatable, intent(out) :: dropped(:)  !! Vertices without a row (corners%n).
    real(dp), allocatable :: total(:), heaviest(:)
    integer :: i, n
    allocate (total(corners%n), heaviest(corners%n))
    call corners%moments(weight, total)
    heaviest = 0
    do i = 1, size(weight)
      n = count(corners%corner(:, i) > 0)
      associate (corner => corners%corner(1:n, i))
        heaviest(corner) = max(heaviest(corner), maxval(total(corner)))
      end associate
    end do
    dropped = total < min_weight_ratio*heaviest
    do i = 1, size(weight)
      n = count(corners%corner(:, i) > 0)
      associate (corner => corners%corner(1:n, i))
        if (all(dropped(corner))) dropped(corner(maxloc(total(corner), 1))) = .false.
      end associate
    end do
  end subroutine find_vertices_without_row

  !> Dual shape functions of the corners of one facet that have rows; zero at the other corners.
  subroutine facet_functions(dropped, weight, shape, is_dual, dual)
    logical, intent(in) :: dropped(:)  !! Corners without a row (n_corners); at least one has a row.
    !> Quadrature weights of the points of the facet (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: weight(:)
    real(dp), intent(in) :: shape(:, :)  !! Linear shape functions at the points (n_corners, n_points) [].
    logical, intent(in) :: is_dual  !! Dual functions; phi if false.
    real(dp), intent(out) :: dual(:, :)  !! Dual shape functions at the points (n_corners, n_points) [].
    real(dp) :: distribution(size(dropped), size(dropped))
    logical :: receiver(size(dropped))
    integer, allocatable :: kept(:)
    integer :: i, n
    n = size(dropped)
    distribution = 0
    do i = 1, n
      receiver = .false.
      if (dropped(i)) then
        ! To the neighbours on the two edges at this corner; to all corners where these have no row.
        receiver([modulo(i - 2, n) + 1, modulo(i, n) + 1]) = .true.
        receiver = receiver .and. .not. dropped
        if (.not. any(receiver)) receiver = .not. dropped
      else
        receiver(i) = .true.
      end if
      distribution(:, i) = merge(1.0_dp/count(receiver), 0.0_dp, receiver)
    end do
    kept = pack([(i, i=1, n)], .not. dropped)
    dual = 0
    dual(kept, :) = matmul(distribution(kept, :), shape)
    if (is_dual) dual(kept, :) = dual_functions(weight, dual(kept, :))
  end subroutine facet_functions

  !> Dual shape functions psi = D M^{-1} phi at the points of one facet; phi where M is singular.
  function dual_functions(weight, shape) result(dual)
    !> Quadrature weights of the points of the facet (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: weight(:)
    real(dp), intent(in) :: shape(:, :)  !! Linear shape functions phi at the points (n, n_points) [].
    real(dp) :: dual(size(shape, 1), size(shape, 2))  !! Dual shape functions psi at the points (n, n_points) [].
    type(error_t), allocatable :: error
    real(dp), dimension(size(shape, 1), size(shape, 1)) :: mass, vectors
    real(dp), dimension(size(shape, 1)) :: root, values
    integer :: i, n
    n = size(shape, 1)
    root = sqrt(matmul(shape, weight))
    mass = 0
    do i = 1, size(weight)
      mass = mass + weight(i)*spread(shape(:, i)/root, 2, n)*spread(shape(:, i)/root, 1, n)
    end do
    dual = shape
    call symmetric_eigen(mass, values, vectors, error)
    if (allocated(error)) return
    if (values(1) < min_eigenvalue) return
    do i = 1, size(weight)
      dual(:, i) = root*matmul(vectors, matmul(shape(:, i)/root, vectors)/values)
    end do
  end function dual_functions
end module dotyk_contact_dual_mortar
