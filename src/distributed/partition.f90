!> Bodies that every rank knows wholly, cut into parts: all elements along one space-filling curve through body after
!> body, in equal lengths of work.
module dotyk_distributed_partition
  use dotyk_base_kinds, only: dp, int64
  use dotyk_distributed_part, only: part_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_body_part, only: body_part_t, cut_part
  use dotyk_mesh_element_ordering, only: morton_order
  implicit none
  private
  public :: cut_bodies

contains

  !> The parts of one rank.
  subroutine cut_bodies(body, rank, n_ranks, part)
    !> The bodies; they need not be assembled (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> The rank, from 0.
    integer, intent(in) :: rank
    !> Number of ranks.
    integer, intent(in) :: n_ranks
    !> Its part of each body, maybe without elements (n_bodies).
    type(part_t), allocatable, intent(out) :: part(:)
    type(rigid_body_modes_t) :: modes
    type(body_part_t) :: piece
    real(dp), allocatable :: mode(:, :, :)
    integer, allocatable :: element_rank(:)
    integer(int64) :: work, before
    integer :: b
    allocate (part(size(body)))
    work = sum([(work_of(body(b)%mesh), b=1, size(body))])
    before = 0
    do b = 1, size(body)
      call rank_elements(body(b)%mesh, before, work, n_ranks, element_rank)
      before = before + work_of(body(b)%mesh)
      call cut_part(body(b)%mesh, element_rank, rank, n_ranks, piece)
      call modes%init(body(b)%mesh, body(b)%analysis, body(b)%constraint, mode)
      call part(b)%init(b, body(b), mode, piece)
    end do
  end subroutine cut_bodies

  !> Work for a body: entries of its element matrices.
  pure integer(int64) function work_of(mesh) result(work)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    integer :: k
    work = 0
    do k = 1, size(mesh%block)
      work = work + size(mesh%block(k)%node, 1, kind=int64)*size(mesh%block(k)%node, kind=int64)
    end do
  end function work_of

  !> The rank of each element.
  subroutine rank_elements(mesh, before, work, n_ranks, element_rank)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Work for the bodies before this one, and for all.
    integer(int64), intent(in) :: before, work
    !> Number of ranks.
    integer, intent(in) :: n_ranks
    !> From 0, counted through all blocks (n_elements).
    integer, allocatable, intent(out) :: element_rank(:)
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
end module dotyk_distributed_partition
