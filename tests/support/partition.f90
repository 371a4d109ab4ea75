!> Parts of bodies for the ranks that compute them together.
module test_partition
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_distributed_part, only: part_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_elasticity_element_ranks, only: element_work, rank_elements
  use test_bodies, only: hold_own_part
  implicit none
  private
  public :: cut_bodies

contains

  !> The parts of one rank, from whole bodies.
  subroutine cut_bodies(body, rank, n_ranks, part)
    type(body_t), intent(in) :: body(:)  !! The bodies; they need not be assembled (n_bodies).
    integer, intent(in) :: rank  !! The rank, from 0.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    type(part_t), allocatable, intent(out) :: part(:)  !! Its part of each body, maybe without elements (n_bodies).
    type(body_t) :: piece
    type(rigid_body_modes_t) :: modes
    real(dp), allocatable :: mode(:, :, :)
    integer, allocatable :: element_rank(:), number(:)
    type(error_t), allocatable :: error
    integer(int64) :: work, before
    integer :: b
    allocate (part(size(body)))
    work = sum([(element_work(body(b)%mesh), b=1, size(body))])
    before = 0
    do b = 1, size(body)
      call rank_elements(body(b)%mesh, 1, before, work, n_ranks, element_rank, error)
      if (allocated(error)) error stop 'the elements are not divided'
      before = before + element_work(body(b)%mesh)
      call modes%init(body(b)%mesh, body(b)%analysis, body(b)%constraint, mode)
      piece = body(b)
      call hold_own_part(piece, element_rank, rank, number)
      call part(b)%init(b, piece, mode(:, piece%mesh%whole%node, :))
    end do
  end subroutine cut_bodies
end module test_partition
