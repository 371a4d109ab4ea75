!> Rows at the vertices of surface_a as weighted means of the integration points around them, with dual shape functions.
!>
!> On one facet, over those of its points that have a partner, the linear corner shape functions phi have the mass matrix
!> M = sum_q w_q phi phi^T and the areas D = diag(sum_q w_q phi). The dual functions psi = D M^{-1} phi fulfil
!> sum_q w_q psi_i phi_j = D_i delta_ij and sum_i psi_i = 1, however many of the points have a partner (Cichosz and
!> Bischoff, Comput. Methods Appl. Mech. Engrg. 200, 2011). The row of vertex i is the mean
!> sum_q w_q psi_i(x_q) (.) / w_i, w_i = sum_q w_q psi_i(x_q) over all facets at i: a field that is linear on each facet and
!> continuous has its value at the vertex as its mean, and the weights are positive and add up to the area.
!>
!> A vertex beyond the rim of the other surface may have next to no area. Its row would be all but a combination of its
!> neighbours' and its pressure noise, so it gets none: on its facets, its phi is added to those of its neighbours before the
!> dual functions are made. Where M is singular all the same (too few points), phi takes the place of psi: that has the same
!> areas.
module dotyk_contact_dual_mortar
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_linalg_sparse, only: sparse_rows_t
  implicit none
  private
  public :: dual_mortar_rows

  !> Vertices of less than this part of the weight of one of their neighbours get no row. (Least eigenvalues of the compliance
  !> go with the root of this ratio.)
  real(dp), parameter :: least_weight = 0.02_dp
  !> Least eigenvalue of D^{-1/2} M D^{-1/2}, whose largest is 1, that counts as regular: a whole facet has 1/3 (line), 1/4
  !> (triangle), 1/9 (quadrilateral), a strip along the edge of a facet 1/6 of its relative width.
  real(dp), parameter :: regular = 1e-3_dp

contains

  !> The rows of all vertices of facets that carry points.
  subroutine dual_mortar_rows(corners, facet, weight, vertex, row_weight, average)
    !> Corners and shape functions of the points.
    type(corner_interpolation_t), intent(in) :: corners
    !> Facets of the points (n_points), ascending.
    integer, intent(in) :: facet(:)
    !> Areas of the points (n_points).
    real(dp), intent(in) :: weight(:)
    !> Body-local node number of each row (n_rows), ascending.
    integer, allocatable, intent(out) :: vertex(:)
    !> Areas of the rows (n_rows).
    real(dp), allocatable, intent(out) :: row_weight(:)
    !> The means (n_rows x n_points).
    type(sparse_rows_t), intent(inout) :: average
    real(dp), allocatable :: dual(:, :), total(:), value(:)
    integer, allocatable :: row_of(:), row(:), column(:)
    logical, allocatable :: light(:)
    integer :: first, last, n, i, j, k
    allocate (dual(4, size(facet)), source=0.0_dp)
    allocate (total(corners%n), row_of(corners%n))
    call find_light(corners, weight, light)
    total = 0
    first = 1
    do while (first <= size(facet))
      last = first
      do while (last < size(facet))
        if (facet(last + 1) /= facet(first)) exit
        last = last + 1
      end do
      n = count(corners%corner(:, first) > 0)
      associate (corner => corners%corner(1:n, first))
        call facet_functions(light(corner), weight(first:last), corners%shape(1:n, first:last), dual(1:n, first:last))
        total(corner) = total(corner) + matmul(dual(1:n, first:last), weight(first:last))
      end associate
      first = last + 1
    end do
    row_of = 0
    n = 0
    do k = 1, corners%n
      if (light(k)) cycle
      n = n + 1
      row_of(k) = n
    end do
    vertex = pack(corners%corner_node, .not. light)
    row_weight = pack(total, .not. light)
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
    call average%init_from_triplets(size(vertex), size(facet), row(1:n), column(1:n), value(1:n))
  end subroutine dual_mortar_rows

  !> The vertices that get no row; of each facet one does.
  subroutine find_light(corners, weight, light)
    type(corner_interpolation_t), intent(in) :: corners
    !> Areas of the points (n_points).
    real(dp), intent(in) :: weight(:)
    !> (corners%n).
    logical, allocatable, intent(out) :: light(:)
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
    light = total < least_weight*heaviest
    do i = 1, size(weight)
      n = count(corners%corner(:, i) > 0)
      associate (corner => corners%corner(1:n, i))
        if (all(light(corner))) light(corner(maxloc(total(corner), 1))) = .false.
      end associate
    end do
  end subroutine find_light

  !> Dual shape functions of the corners of one facet that have rows, 0 at the others.
  subroutine facet_functions(light, weight, shape, dual)
    !> Corners without row (n_corners); not all of them.
    logical, intent(in) :: light(:)
    !> Areas (n_points).
    real(dp), intent(in) :: weight(:)
    !> Linear shape functions (n_corners, n_points).
    real(dp), intent(in) :: shape(:, :)
    !> Dual ones (n_corners, n_points).
    real(dp), intent(out) :: dual(:, :)
    real(dp) :: share(size(light), size(light))
    logical :: heir(size(light))
    integer, allocatable :: kept(:)
    integer :: i, n
    n = size(light)
    share = 0
    do i = 1, n
      heir = .false.
      if (light(i)) then
        ! Neighbours on the two edges at this corner, else all corners.
        heir([modulo(i - 2, n) + 1, modulo(i, n) + 1]) = .true.
        heir = heir .and. .not. light
        if (.not. any(heir)) heir = .not. light
      else
        heir(i) = .true.
      end if
      share(:, i) = merge(1.0_dp/count(heir), 0.0_dp, heir)
    end do
    kept = pack([(i, i=1, n)], .not. light)
    dual = 0
    dual(kept, :) = dual_functions(weight, matmul(share(kept, :), shape))
  end subroutine facet_functions

  !> Dual shape functions at the points of one facet.
  function dual_functions(weight, shape) result(dual)
    !> Areas (n_points).
    real(dp), intent(in) :: weight(:)
    !> Linear shape functions (n, n_points).
    real(dp), intent(in) :: shape(:, :)
    !> Dual ones (n, n_points).
    real(dp) :: dual(size(shape, 1), size(shape, 2))
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
    if (values(1) < regular) return
    do i = 1, size(weight)
      dual(:, i) = root*matmul(vectors, matmul(shape(:, i)/root, vectors)/values)
    end do
  end function dual_functions
end module dotyk_contact_dual_mortar
