!> What a body in parts knows as a whole: sums and extremes over the nodes and elements that each rank computes.
!>
!> All ranks come here together where a body is in parts, outside of parallel regions, also those that compute nothing
!> of it. Nothing is exchanged of bodies that one rank computes.
module dotyk_elasticity_part_sums
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: right_singular_vectors
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: add_up, greatest, item_t, share
  implicit none
  private
  public :: own_product, add_up_parts, greatest_of_parts, gather_rows

contains

  !> Product of two nodal vectors over the nodes that this rank computes.
  pure real(dp) function own_product(mesh, a, b) result(product)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(in) :: a(:, :), b(:, :)  !! Nodal vectors (dim, n_nodes) [any].
    integer :: i
    if (mesh%is_whole()) then
      product = sum(a*b)
      return
    end if
    product = 0
    do i = 1, size(a, 2)
      if (mesh%is_own_node(i)) product = product + dot_product(a(:, i), b(:, i))
    end do
  end function own_product

  !> Sums over a body of what the ranks have found at their nodes or elements.
  subroutine add_up_parts(mesh, value)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(inout) :: value(:)  !! Those of this rank in, those of the body out (n) [any].
    if (mesh%is_in_parts()) call add_up(value)
  end subroutine add_up_parts

  !> The greatest over a body of what the ranks have found at their nodes or elements.
  subroutine greatest_of_parts(mesh, value)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(inout) :: value(:)  !! Those of this rank in, those of the body out (n) [any].
    if (mesh%is_in_parts()) call greatest(value)
  end subroutine greatest_of_parts

  !> A matrix with the singular values and right singular vectors of the one that the rows of all ranks make: each rank
  !> gives as many rows as there are columns, at most.
  subroutine gather_rows(mesh, rows)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    !> Rows of this rank in, those of the body out; unchanged unless the body is in parts (any, n) [any].
    real(dp), allocatable, intent(inout) :: rows(:, :)
    type(error_t), allocatable :: error
    type(item_t) :: item(n_ranks())
    real(dp) :: values(size(rows, 2)), vectors(size(rows, 2), size(rows, 2))
    integer :: k, r, m, n
    if (.not. mesh%is_in_parts()) return
    n = size(rows, 2)
    if (size(rows, 1) > n) then
      ! S V^T in place of U S V^T: no digits are lost. Where there are no singular values, all ranks find that out from
      ! the rows.
      call right_singular_vectors(rows, values, vectors, error)
      if (.not. allocated(error)) rows = reshape([(values*vectors(k, :), k=1, n)], [n, n])
    end if
    item(this_rank() + 1)%value = reshape(rows, [size(rows)])
    call share([(r, r=0, n_ranks() - 1)], item)
    m = sum([(size(item(r)%value), r=1, size(item))])/n
    deallocate (rows)
    allocate (rows(m, n))
    m = 0
    do r = 1, size(item)
      k = size(item(r)%value)/n
      rows(m + 1:m + k, :) = reshape(item(r)%value, [k, n])
      m = m + k
    end do
  end subroutine gather_rows
end module dotyk_elasticity_part_sums
