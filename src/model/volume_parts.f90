!> A volume of a mesh file of which each rank reads a share: the part that each rank goes on with, and its surface.
!> No rank ever has the whole volume.
!>
!> The elements that a rank has read move to the rank of their place on a space-filling curve; directories of the nodes
!> tell their numbers in the whole body and the ranks that have them; two layers of elements around its own ones, and
!> some samples of the others, come from the ranks that own them; faces that occur once are gathered, and give the
!> surface on all ranks. What is found is what `hold_own_part` leaves of a whole body
!> (`dotyk_elasticity_held_body`), in the same order, with the same numbers.
module dotyk_model_volume_parts
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_body_part, only: body_part_t, n_ghost_layers
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_layer_part, only: hold_layer_part
  use dotyk_mesh_layer_share, only: layer_share_t, pack_layer, whole_numbers_t
  use dotyk_mesh_layer_surface, only: find_inner_facets
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_part_assembly, only: extract_share, finish_part, pack_ghosts, pack_samples
  use dotyk_mesh_share_checks, only: check_extent, orient_share, pack_extent, pack_orientation
  use dotyk_mesh_share_faults, only: share_faults_t
  use dotyk_mesh_share_split, only: pack_for_rank, part_bounds_t, share_box, share_curve_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use dotyk_model_node_sharers, only: hold_more, number_nodes
  use dotyk_model_share_exchange, only: deliver_shares, gather_shares
  use dotyk_model_volume_joints, only: find_boundary, find_joints
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: add_counts, agree_on_error, gather_all, greatest
  implicit none
  private

  type, public :: volume_share_t  !! What this rank has read of a volume.
    type(body_mesh_t), private :: own  !! The elements, and their nodes.
    type(whole_numbers_t), private :: whole  !! Their numbers in the whole body.
    integer, allocatable, private :: file_node(:)  !! Number of each node in the file, ascending (n_nodes).
    integer, private :: n_file_nodes = 0  !! Number of nodes of the file.
    real(dp), allocatable, private :: low(:), high(:)  !! Box of the whole volume (dimension) [length].
    integer(int64), private :: n_element_nodes = 0  !! Nodes of the elements of all ranks.
  contains
    procedure :: take => share_take
    procedure :: weight => share_weight
    procedure :: make_part => share_make_part
  end type volume_share_t

contains

  !> Take the elements of a volume that this rank has read.
  subroutine share_take(self, mesh, name, dimension, error)
    class(volume_share_t), intent(out) :: self
    type(mesh_t), intent(in) :: mesh  !! What this rank has read of the file.
    character(*), intent(in) :: name  !! Physical group of the volume.
    integer, intent(in) :: dimension  !! Dimension of space.
    !> The same on all ranks: an unknown name, an empty group, coordinates out of range, inverted or degenerate
    !> elements.
    type(error_t), allocatable, intent(out) :: error
    integer(int64), allocatable :: packed(:), all(:)
    integer(int64) :: n_nodes(1)
    integer :: b
    call extract_share(mesh, name, dimension, this_rank(), self%own, self%whole, self%file_node, error)
    call agree_on_error(error)
    if (allocated(error)) return
    call pack_extent(mesh, self%own, self%file_node, packed)
    call gather_all(packed, all)
    call check_extent(self%own, name, all, error)
    if (allocated(error)) return
    call pack_orientation(self%own, self%whole, packed)
    call gather_all(packed, all)
    call orient_share(self%own, name, all, error)
    if (allocated(error)) return
    self%n_file_nodes = mesh%n_file_nodes
    allocate (self%low(dimension), self%high(dimension))
    call share_box(self%own, self%low, self%high)
    self%low = -self%low
    call greatest(self%low)
    self%low = -self%low
    call greatest(self%high)
    n_nodes = sum([(size(self%own%block(b)%node, kind=int64), b=1, size(self%own%block))])
    call add_counts(n_nodes)
    self%n_element_nodes = n_nodes(1)
  end subroutine share_take

  !> Nodes of all elements of the volume, on all ranks.
  pure integer(int64) function share_weight(self) result(weight)
    class(volume_share_t), intent(in) :: self
    weight = self%n_element_nodes
  end function share_weight

  !> The part of this rank, and the surface of the volume. The share is given up.
  subroutine share_make_part(self, mesh, name, n_bodies, before, all_weight, part, layer, joints, error)
    class(volume_share_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! What this rank has read of the file.
    character(*), intent(in) :: name  !! Physical group of the volume.
    integer, intent(in) :: n_bodies  !! Number of bodies that use the volume.
    !> Weights of the bodies of the volumes before this one, and of all bodies.
    integer(int64), intent(in) :: before, all_weight
    !> The part; `mesh_node` is not allocated, its size is not measured (`measure_part`).
    type(body_mesh_t), intent(out) :: part
    type(surface_layer_t), intent(out) :: layer  !! The surface, the same on all ranks.
    type(joints_t), intent(out) :: joints  !! How its parts hang together; there is no part where they cannot.
    type(error_t), allocatable, intent(out) :: error  !! The same on all ranks: elements are repeated.
    type(boundary_candidates_t) :: candidates
    type(share_faults_t) :: faults
    type(body_part_t) :: body_part
    integer, allocatable :: first_node(:), n_sharers(:), sharer(:), component(:)
    integer(int64), allocatable :: number(:)
    real(dp), allocatable :: x(:)
    integer :: k
    call move_elements(self, n_bodies, before, all_weight)
    call number_nodes(self%file_node, self%n_file_nodes, self%whole, first_node, n_sharers, sharer)
    call find_boundary(self%own, self%whole, n_sharers, candidates, faults)
    call faults%check_repeated(self%own%file, name, error)
    if (allocated(error)) return
    call find_layer(self, mesh, candidates, layer)
    call find_joints(self%own, self%whole, layer, faults, joints)
    if (allocated(joints%fault)) return
    do k = 2, n_ghost_layers
      call hold_more(self%own, self%whole, n_sharers, sharer)
    end do
    call fetch_ghosts(self, candidates, n_sharers, sharer, number, x)
    call finish_part(number, x, layer, first_node, this_rank(), n_ranks(), body_part, component)
    call hold_layer_part(body_part, component, layer, part)
    deallocate (self%file_node)
    self%own = body_mesh_t()
    self%whole = whole_numbers_t()
  end subroutine share_make_part

  !> Elements move to the ranks of their places on the curve.
  subroutine move_elements(self, n_bodies, before, all_weight)
    class(volume_share_t), intent(inout) :: self
    integer, intent(in) :: n_bodies  !! As in `make_part`.
    integer(int64), intent(in) :: before, all_weight  !! As in `make_part`.
    type(layer_share_t) :: share(0:n_ranks() - 1)
    type(surface_layer_t) :: got
    integer(int64), allocatable :: number(:)
    real(dp), allocatable :: x(:)
    type(share_curve_t) :: curve
    type(part_bounds_t) :: bounds
    integer(int64), allocatable :: n_nodes(:)
    integer, allocatable :: part(:)
    logical :: sends(0:n_ranks() - 1)
    integer :: r, e
    call curve%init(self%own, self%low, self%high)
    call bounds%init(n_ranks(), self%n_element_nodes, n_bodies, before, all_weight)
    do while (size(bounds%probe) > 0)
      n_nodes = curve%nodes_before(bounds%probe)
      call add_counts(n_nodes)
      call bounds%narrow(n_nodes)
    end do
    call bounds%parts_of(curve, part)
    sends = .false.
    do e = 1, size(part)
      sends(part(e)) = .true.
    end do
    ! A share tells the kinds of the elements, even if it has none.
    sends(this_rank()) = .true.
    do r = 0, n_ranks() - 1
      if (sends(r)) &
        call pack_for_rank(self%own, self%whole, self%file_node, self%n_file_nodes, part, r, share(r))
    end do
    call deliver_shares(share, number, x)
    call got%unpack(self%own%file, number, x)
    self%own = got%mesh
    self%whole = got%whole
    self%whole%rank = this_rank()
    self%file_node = got%whole%node
  end subroutine move_elements

  !> The surface of the volume, on all ranks.
  subroutine find_layer(self, mesh, candidates, layer)
    class(volume_share_t), intent(in) :: self
    type(mesh_t), intent(in) :: mesh  !! What this rank has read of the file.
    type(boundary_candidates_t), intent(in) :: candidates  !! Faces of own elements on the boundary.
    type(surface_layer_t), intent(out) :: layer  !! The surface.
    type(layer_share_t) :: share
    integer(int64), allocatable :: inner(:), number(:)
    real(dp), allocatable :: x(:)
    call find_inner_facets(mesh, self%own, candidates, inner)
    call pack_layer(self%own, self%whole, candidates, inner, 0.0_dp, share)
    call gather_shares(share, number, x)
    call layer%unpack(self%own%file, number, x)
  end subroutine find_layer

  !> Own elements, those around them that other ranks own, and samples.
  subroutine fetch_ghosts(self, candidates, n_sharers, sharer, number, x)
    class(volume_share_t), intent(in) :: self
    type(boundary_candidates_t), intent(in) :: candidates  !! Faces of own elements on the boundary.
    integer, intent(in) :: n_sharers(:)  !! Number of ranks that have each node (n_nodes).
    integer, intent(in) :: sharer(:)  !! The ranks (any).
    integer(int64), allocatable, intent(out) :: number(:)  !! Whole numbers of the shares that came (any).
    real(dp), allocatable, intent(out) :: x(:)  !! Their coordinates (any) [length].
    type(layer_share_t) :: share(0:n_ranks() - 1), sample
    integer(int64), allocatable :: of_samples(:)
    real(dp), allocatable :: x_of_samples(:)
    integer :: r
    do r = 0, n_ranks() - 1
      if (r /= this_rank() .and. .not. any(sharer == r)) cycle
      call pack_ghosts(self%own, self%whole, candidates, n_sharers, sharer, r, share(r))
    end do
    call deliver_shares(share, number, x)
    call pack_samples(self%own, self%whole, candidates, sample)
    call gather_shares(sample, of_samples, x_of_samples)
    number = [number, of_samples]
    x = [x, x_of_samples]
  end subroutine fetch_ghosts
end module dotyk_model_volume_parts
