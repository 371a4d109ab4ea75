!> The ranks that compute the elements of bodies in parts: all elements along one space-filling curve through body after
!> body, in equal lengths of work.
module dotyk_mesh_element_ranks
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element_ordering, only: morton_order
  implicit none
  private
  public :: element_work, rank_elements

contains

  !> Work for a body: entries of its element matrices.
  pure integer(int64) function element_work(mesh) result(work)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    integer :: k
    work = 0
    do k = 1, size(mesh%block)
      work = work + size(mesh%block(k)%node, 1, kind=int64)*size(mesh%block(k)%node, kind=int64)
    end do
  end function element_work

  !> The rank of each element.
  subroutine rank_elements(mesh, before, work, n_ranks, element_rank)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the whole body.
    integer(int64), intent(in) :: before, work  !! Work for the bodies before this one, and for all.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    integer, allocatable, intent(out) :: element_rank(:)  !! From 0, counted through all blocks (n_elements).
    integer, allocatable :: node(:, :), cost(:), order(:)
    integer(int64) :: done
    integer :: k, e, n
    allocate (node(1, mesh%n_elements()), cost(mesh%n_elements()))
    n = 0
    do k = 1, size(mesh%block)
      associate (of_block => mesh%block(k)%node)
        node(1, n + 1:n + size(of_block, 2)) = of_block(1, :)
        cost(n + 1:n + size(of_block, 2)) = size(of_block, 1)**2
        n = n + size(of_block, 2)
      end associate
    end do
    allocate (order(n), element_rank(n))
    call morton_order(mesh%dimension, mesh%x, node, order)
    done = before
    do e = 1, n
      element_rank(order(e)) = int(n_ranks*done/work)
      done = done + cost(order(e))
    end do
  end subroutine rank_elements
end module dotyk_mesh_element_ranks
