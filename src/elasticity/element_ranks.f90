!> The ranks that compute the elements of bodies in parts. All bodies are in a row, and each rank has an equal length of
!> it by work: many small bodies have few ranks each. The elements of a body are divided by METIS.
module dotyk_elasticity_element_ranks
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_ordering, only: partition_elements
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
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
  subroutine rank_elements(mesh, n_bodies, before, work, n_ranks, element_rank, error)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the whole body.
    integer, intent(in) :: n_bodies  !! Number of bodies that have this mesh.
    integer(int64), intent(in) :: before, work  !! Work for the bodies before these, and for all.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    integer, allocatable, intent(out) :: element_rank(:)  !! From 0, counted through all blocks (n_elements).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where METIS has no memory.
    type(element_kind_t) :: kind
    integer, allocatable :: start(:), node(:), cost(:)
    real(dp), allocatable :: length(:)
    real(dp) :: low, high
    integer :: b, e, n, m, first, last, r, longest
    allocate (element_rank(mesh%n_elements()), cost(mesh%n_elements()), start(mesh%n_elements() + 1))
    if (size(element_rank) == 0) return
    ! The length of the body in the row, and that of each rank in it, in ranks.
    low = n_ranks*(real(before, dp)/work)
    high = n_ranks*(real(before + n_bodies*element_work(mesh), dp)/work)
    first = min(int(low), n_ranks - 1)
    last = max(first, min(ceiling(high), n_ranks) - 1)
    length = [(min(high, r + 1.0_dp) - max(low, real(r, dp)), r=first, last)]
    ! Less than an element is nothing, unless all are.
    length = max(length, 0.0_dp)
    longest = maxloc(length, 1)
    where (length < (high - low)/size(element_rank)) length = 0
    if (.not. any(length > 0)) length(longest) = 1
    n = 0
    start(1) = 1
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      do e = 1, size(mesh%block(b)%tag)
        n = n + 1
        cost(n) = kind%n_nodes**2
        start(n + 1) = start(n) + kind%n_corners
      end do
    end do
    allocate (node(start(n + 1) - 1))
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      associate (k => kind%n_corners*size(mesh%block(b)%tag))
        node(n + 1:n + k) = reshape(mesh%block(b)%node(:kind%n_corners, :), [k])
        n = n + k
      end associate
    end do
    associate (ranks => pack([(r, r=first, last)], length > 0), fraction => pack(length, length > 0))
      m = merge(3, 2, mesh%dimension == 3)
      call partition_elements(start, node, mesh%n_nodes(), m, cost, real(fraction/sum(fraction)), element_rank, error)
      if (.not. allocated(error)) element_rank = ranks(element_rank)
    end associate
  end subroutine rank_elements
end module dotyk_elasticity_element_ranks
