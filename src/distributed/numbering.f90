!> Block rows of the matrices of all bodies: rank after rank, each rank's own nodes part by part along a space-filling
!> curve; those of the coarse matrix likewise, on the corners.
module dotyk_distributed_numbering
  use petscvec, only: INSERT_VALUES, PETSC_COMM_SELF, PETSC_COMM_WORLD, PETSC_COPY_VALUES, PETSC_DECIDE, &
    SCATTER_FORWARD, &
    tIS, tVec, tVecScatter, ISCreateGeneral, ISCreateStride, ISDestroy, VecAssemblyBegin, VecAssemblyEnd, &
    VecCreateMPI, VecCreateSeq, VecDestroy, VecGetArrayReadF90, VecRestoreArrayReadF90, &
    VecSetValues
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_petsc, only: first_of_rank, has_failed
  use dotyk_mesh_element_ordering, only: morton_order
  implicit none
  private
  public :: gather_entries, number_rows

contains

  !> Number the nodes and corners of all parts.
  subroutine number_rows(part, n_of_body, n_own, n_own_corners, error)
    type(part_t), intent(inout) :: part(:)  !! Parts of this rank; get `row` and `corner_row` (n_parts).
    integer, intent(in) :: n_of_body(:)  !! Number of nodes of each body (n_bodies).
    integer, intent(out) :: n_own, n_own_corners  !! Own nodes, and own corners.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer, allocatable :: order(:), id(:), first_id(:), own_id(:), wanted(:), row(:), corner_row(:)
    real(dp), allocatable :: found(:)
    integer :: p, i, k, n, first, first_corner
    allocate (first_id, source=[0, (sum(n_of_body(:k)), k=1, size(n_of_body))])
    n_own = sum([(count(part(p)%is_own), p=1, size(part))])
    n_own_corners = sum([(count(part(p)%is_own(part(p)%space%node)), p=1, size(part))])
    first = first_of_rank(n_own)
    first_corner = first_of_rank(n_own_corners)
    allocate (own_id(n_own), row(n_own), corner_row(n_own), wanted(0))
    n = 0
    k = 0
    do p = 1, size(part)
      associate (mesh => part(p)%mesh)
        allocate (order(mesh%n_nodes()))
        id = first_id(part(p)%body) + part(p)%whole_node - 1
        call morton_order(mesh%dimension, mesh%x, reshape([(i, i=1, size(order))], [1, size(order)]), order)
        do i = 1, size(order)
          if (.not. part(p)%is_own(order(i))) cycle
          n = n + 1
          own_id(n) = id(order(i))
          row(n) = first + n - 1
          corner_row(n) = -1
          if (part(p)%space%number(order(i)) == 0) cycle
          corner_row(n) = first_corner + k
          k = k + 1
        end do
        wanted = [wanted, id]
        deallocate (order)
      end associate
    end do
    call look_up(sum(n_of_body), own_id, row, wanted, found, error)
    if (allocated(error)) return
    n = 0
    do p = 1, size(part)
      part(p)%row = nint(found(n + 1:n + size(part(p)%whole_node)))
      n = n + size(part(p)%whole_node)
    end do
    call look_up(sum(n_of_body), own_id, corner_row, wanted, found, error)
    if (allocated(error)) return
    n = 0
    do p = 1, size(part)
      part(p)%corner_row = nint(found(n + part(p)%space%node))
      n = n + size(part(p)%whole_node)
    end do
  end subroutine number_rows

  !> Values that other ranks know.
  subroutine look_up(n, own, value, wanted, found, error)
    integer, intent(in) :: n  !! Number of entries in all.
    integer, intent(in) :: own(:)  !! Entries that this rank knows, from 0 (n_own).
    integer, intent(in) :: value(:)  !! Their values (n_own).
    integer, intent(in) :: wanted(:)  !! Entries that it wants to know, from 0 (n_wanted).
    real(dp), allocatable, intent(out) :: found(:)  !! Their values (n_wanted).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tVec) :: all
    integer :: code
    call VecCreateMPI(PETSC_COMM_WORLD, PETSC_DECIDE, n, all, code)
    call VecSetValues(all, size(own), own, real(value, dp), INSERT_VALUES, code)
    call VecAssemblyBegin(all, code)
    call VecAssemblyEnd(all, code)
    if (has_failed(code, 'numbering', error)) return
    call gather_entries(all, wanted, found, error)
    call VecDestroy(all, code)
  end subroutine look_up

  !> Entries of a distributed vector, wherever they are.
  subroutine gather_entries(all, wanted, found, error)
    type(tVec), intent(in) :: all  !! The vector.
    integer, intent(in) :: wanted(:)  !! Its entries that this rank wants, from 0 (n_wanted).
    real(dp), allocatable, intent(out) :: found(:)  !! (n_wanted) [as `all`]
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tVec) :: own
    type(tIS) :: from, to
    type(tVecScatter) :: exchange
    real(dp), pointer :: x(:)
    integer :: code
    call VecCreateSeq(PETSC_COMM_SELF, size(wanted), own, code)
    call ISCreateGeneral(PETSC_COMM_SELF, size(wanted), wanted, PETSC_COPY_VALUES, from, code)
    call ISCreateStride(PETSC_COMM_SELF, size(wanted), 0, 1, to, code)
    call VecScatterCreate(all, from, own, to, exchange, code)
    if (has_failed(code, 'exchange of nodes', error)) return
    call VecScatterBegin(exchange, all, own, INSERT_VALUES, SCATTER_FORWARD, code)
    call VecScatterEnd(exchange, all, own, INSERT_VALUES, SCATTER_FORWARD, code)
    if (has_failed(code, 'exchange of nodes', error)) return
    call VecGetArrayReadF90(own, x, code)
    found = x
    call VecRestoreArrayReadF90(own, x, code)
    call VecScatterDestroy(exchange, code)
    call ISDestroy(from, code)
    call ISDestroy(to, code)
    call VecDestroy(own, code)
  end subroutine gather_entries
end module dotyk_distributed_numbering
