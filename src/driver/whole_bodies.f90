!> Whole bodies on the first rank, which writes the results: their meshes and fields, collected body after body from the
!> ranks that hold them. All ranks take part; on one rank nothing is collected.
module dotyk_driver_whole_bodies
  use dotyk_base_kinds, only: dp, int64
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: kind_nodes
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: collect
  implicit none
  private

  type, public :: whole_body_fields_t  !! One body, of which each rank has its own nodes and elements.
    private
    logical :: is_here = .true.  !! Whether this rank has it all, and writes it.
    !> Own nodes, in the numbers of this rank, and their numbers in the whole body (n_own_nodes).
    integer, allocatable :: node(:), whole_node(:)
    integer, allocatable :: element(:), whole_element(:)  !! The same of elements, through all blocks (n_own_elements).
    integer, allocatable :: held_node(:)  !! Numbers in the whole body of the nodes of this rank (n_nodes).
    integer, public :: n_nodes = 0, n_elements = 0  !! Numbers of nodes and elements of the whole body.
  contains
    procedure :: init => fields_init
    procedure :: mesh => fields_mesh
    procedure :: of_nodes => fields_of_nodes
    procedure :: of_elements => fields_of_elements
    procedure :: of_surface => fields_of_surface
  end type whole_body_fields_t

contains

  !> Number the nodes and elements that this rank has to give.
  subroutine fields_init(self, body, ranks, b)
    class(whole_body_fields_t), intent(out) :: self
    type(body_t), intent(in) :: body  !! The body, or the part of it that this rank holds.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    integer, intent(in) :: b  !! Index of the body.
    integer :: i, k, n, before
    self%is_here = n_ranks() == 1
    self%n_nodes = body%mesh%n_whole_nodes()
    self%n_elements = body%mesh%n_whole_elements()
    if (self%is_here) return
    self%held_node = body%mesh%whole_nodes([(i, i=1, body%mesh%n_nodes())])
    if (allocated(body%mesh%whole)) then
      self%node = pack([(i, i=1, body%mesh%n_nodes())], body%mesh%whole%own_node)
      self%element = pack([(i, i=1, body%mesh%n_elements())], body%mesh%whole%own_element)
      allocate (self%whole_element(body%mesh%n_elements()))
      n = 0
      before = 0
      do k = 1, size(body%mesh%block)
        associate (size_of => size(body%mesh%block(k)%tag))
          self%whole_element(n + 1:n + size_of) = before + body%mesh%whole%element(n + 1:n + size_of)
          n = n + size_of
          before = before + body%mesh%whole%n_of_block(k)
        end associate
      end do
      self%whole_element = self%whole_element(self%element)
    else if (ranks%owner(b) == this_rank() .or. (this_rank() == 0 .and. ranks%is_own(b))) then
      self%node = [(i, i=1, self%n_nodes)]
      self%element = [(i, i=1, self%n_elements)]
      self%whole_element = self%element
    else
      allocate (self%node(0), self%element(0), self%whole_element(0))
    end if
    self%whole_node = self%held_node(self%node)
  end subroutine fields_init

  !> The mesh of the whole body.
  subroutine fields_mesh(self, held, mesh)
    class(whole_body_fields_t), intent(in) :: self
    type(body_mesh_t), intent(in) :: held  !! What this rank holds.
    type(body_mesh_t), intent(out) :: mesh  !! The whole mesh; empty on ranks but the first.
    real(dp), allocatable :: node(:, :), element(:, :), table(:, :)
    integer, allocatable :: chosen(:)
    integer :: k, first, before, n, held_before
    if (self%is_here) then
      mesh = held
      return
    end if
    mesh%file = held%file
    mesh%dimension = held%dimension
    mesh%order_elevated = held%order_elevated
    allocate (node(mesh%dimension + 1, size(held%node_tag)))
    node(:mesh%dimension, :) = held%x
    node(mesh%dimension + 1, :) = real(held%node_tag, dp)
    call self%of_nodes(node, table)
    mesh%x = table(:mesh%dimension, :)
    mesh%node_tag = nint(table(mesh%dimension + 1, :), int64)
    allocate (mesh%block(size(held%block)))
    before = 0
    held_before = 0
    first = 1
    do k = 1, size(held%block)
      associate (block => held%block(k), width => kind_nodes(held%block(k)%kind))
        n = size(block%tag)
        chosen = pack(self%element, self%element > held_before .and. self%element <= held_before + n) - held_before
        associate (number => self%whole_element(first:first + size(chosen) - 1) - before, &
                   of_block => merge(held%whole_block_size(k), 0, this_rank() == 0))
          allocate (element(width + 1, size(chosen)))
          element(:width, :) = reshape(real(held%whole_nodes(reshape(block%node(:, chosen), [width*size(chosen)])), &
                                            dp), [width, size(chosen)])
          element(width + 1, :) = real(block%tag(chosen), dp)
          call collect_rows(number, element, of_block, table)
        end associate
        mesh%block(k)%kind = block%kind
        mesh%block(k)%material = block%material
        mesh%block(k)%node = nint(table(:width, :))
        mesh%block(k)%tag = nint(table(width + 1, :), int64)
        deallocate (element)
        first = first + size(chosen)
        held_before = held_before + n
        before = before + held%whole_block_size(k)
      end associate
    end do
  end subroutine fields_mesh

  !> A field of the nodes.
  subroutine fields_of_nodes(self, held, whole)
    class(whole_body_fields_t), intent(in) :: self
    real(dp), intent(in) :: held(:, :)  !! At the nodes that this rank holds (n, n_held_nodes) [any].
    !> At those of the whole body; of size 0 on ranks but the first (n, n_nodes) [as held].
    real(dp), allocatable, intent(out) :: whole(:, :)
    if (self%is_here) then
      whole = held
    else
      call collect_rows(self%whole_node, held(:, self%node), merge(self%n_nodes, 0, this_rank() == 0), whole)
    end if
  end subroutine fields_of_nodes

  !> A field of the elements. Ranks without own elements may give one of no columns.
  subroutine fields_of_elements(self, held, whole)
    class(whole_body_fields_t), intent(in) :: self
    !> At the elements that this rank holds, in the order of the blocks (n, n_held_elements) [any].
    real(dp), intent(in) :: held(:, :)
    !> At those of the whole body; of size 0 on ranks but the first (n, n_elements) [as held].
    real(dp), allocatable, intent(out) :: whole(:, :)
    if (self%is_here) then
      whole = held
    else
      call collect_rows(self%whole_element, held(:, self%element), merge(self%n_elements, 0, this_rank() == 0), whole)
    end if
  end subroutine fields_of_elements

  !> A field of the boundary, which every rank has; it is 0 elsewhere.
  subroutine fields_of_surface(self, held, whole)
    class(whole_body_fields_t), intent(in) :: self
    real(dp), intent(in) :: held(:)  !! At the nodes that this rank holds (n_held_nodes) [any].
    !> At those of the whole body; of size 0 on ranks but the first (n_nodes) [as held].
    real(dp), allocatable, intent(out) :: whole(:)
    if (self%is_here) then
      whole = held
      return
    end if
    allocate (whole(merge(self%n_nodes, 0, this_rank() == 0)), source=0.0_dp)
    if (this_rank() == 0) whole(self%held_node) = held
  end subroutine fields_of_surface

  !> Rows of a table from all ranks.
  subroutine collect_rows(number, own, n, whole)
    integer, intent(in) :: number(:)  !! Numbers in the table of the rows of this rank (n_own).
    real(dp), intent(in) :: own(:, :)  !! Its rows, as columns (width, n_own) [any].
    integer, intent(in) :: n  !! Number of all rows on the first rank, 0 elsewhere.
    real(dp), allocatable, intent(out) :: whole(:, :)  !! All rows, as columns (width, n) [as own].
    real(dp), allocatable :: all(:)
    integer(int64) :: at, first
    integer :: i, n_rows, width
    ! In one exchange: number of rows, their numbers, the rows.
    call collect([real(size(number), dp), real(number, dp), reshape(own, [size(own)])], all)
    width = size(own, 1)
    allocate (whole(width, n))
    at = 0
    do while (at < size(all, kind=int64))
      n_rows = nint(all(at + 1))
      first = at + 1 + n_rows
      do i = 1, n_rows
        whole(:, nint(all(at + 1 + i))) = all(first + (i - 1)*int(width, int64) + 1:first + i*int(width, int64))
      end do
      at = first + n_rows*int(width, int64)
    end do
  end subroutine collect_rows
end module dotyk_driver_whole_bodies
