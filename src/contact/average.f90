!> Rows at the vertices of surface_a as weighted means of the integration points around them, with dual shape functions.
!>
!> On one facet, over those of its points that have a partner, the linear corner shape functions phi have the mass matrix
!> M = sum_q w_q phi phi^T and the areas D = diag(sum_q w_q phi). The dual functions psi = D M^{-1} phi fulfil
!> sum_q w_q psi_i phi_j = D_i delta_ij and sum_i psi_i = 1, however many of the points have a partner (Cichosz and
!> Bischoff, Comput. Methods Appl. Mech. Engrg. 200, 2011). The row of vertex i is the mean
!> sum_q w_q psi_i(x_q) (.) / w_i, w_i = sum_q w_q psi_i(x_q) over all facets at i: a field that is linear on each facet and
!> continuous has its value at the vertex as its mean, and the weights are positive and add up to the area.
!>
!> Where too few points of a facet have a partner, M is singular, and phi takes the place of psi: that has the same areas.
module dotyk_contact_average
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_field, only: corner_field_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_linalg_sparse, only: sparse_rows_t
  implicit none
  private
  public :: average_at_vertices

  !> Least eigenvalue of D^{-1/2} M D^{-1/2}, whose largest is 1, that counts as regular: a whole facet has 1/3 (line), 1/4
  !> (triangle), 1/9 (quadrilateral), a strip along the edge of a facet 1/6 of its relative width.
  real(dp), parameter :: regular = 1e-6_dp
  !> Vertices of less than this part of the mean weight get no row.
  real(dp), parameter :: least_weight = 1e-12_dp

contains

  !> The rows of all vertices of facets that carry points.
  subroutine average_at_vertices(corners, facet, weight, vertex, row_weight, average)
    !> Corners and shape functions of the points.
    type(corner_field_t), intent(in) :: corners
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
    integer :: first, last, n, i, j, k
    allocate (dual(4, size(facet)), total(corners%n), row_of(corners%n))
    first = 1
    do while (first <= size(facet))
      last = first
      do while (last < size(facet))
        if (facet(last + 1) /= facet(first)) exit
        last = last + 1
      end do
      n = count(corners%corner(:, first) > 0)
      dual(:, first:last) = 0
      call dual_functions(weight(first:last), corners%shape(1:n, first:last), dual(1:n, first:last))
      first = last + 1
    end do
    call corners%moments(weight, total)
    row_of = 0
    n = 0
    do k = 1, corners%n
      if (total(k) < least_weight*sum(total)/corners%n) cycle
      n = n + 1
      row_of(k) = n
    end do
    vertex = pack(corners%corner_node, row_of > 0)
    row_weight = pack(total, row_of > 0)
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
  end subroutine average_at_vertices

  !> Dual shape functions at the points of one facet.
  subroutine dual_functions(weight, shape, dual)
    !> Areas (n_points).
    real(dp), intent(in) :: weight(:)
    !> Linear shape functions (n_corners, n_points).
    real(dp), intent(in) :: shape(:, :)
    !> Dual ones (n_corners, n_points).
    real(dp), intent(out) :: dual(:, :)
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
  end subroutine dual_functions
end module dotyk_contact_average
