!> The boundary of a volume of which each rank has some elements, and how its parts hang together: what all ranks find
!> from what they gather.
module dotyk_model_volume_joints
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t, key_length
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_layer_share, only: whole_numbers_t
  use dotyk_mesh_share_faults, only: pack_faults, share_faults_t
  use dotyk_mesh_shortest_edges, only: find_layer_edges
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use dotyk_ranks_communication, only: this_rank
  use dotyk_ranks_exchange, only: gather_all
  implicit none
  private
  public :: find_boundary, find_joints

contains

  !> Faces of own elements on the boundary of the volume, and what is wrong with faces.
  subroutine find_boundary(own, whole, n_sharers, candidates, faults)
    !> Elements that this rank owns.
    type(body_mesh_t), intent(in) :: own
    !> Their numbers in the whole body.
    type(whole_numbers_t), intent(in) :: whole
    !> Number of ranks that have each node (n_nodes).
    integer, intent(in) :: n_sharers(:)
    !> The faces.
    type(boundary_candidates_t), intent(out) :: candidates
    !> The faults, the same on all ranks.
    type(share_faults_t), intent(out) :: faults
    integer(int64), allocatable :: keys(:), packed(:), all(:)
    call candidates%find(own, whole%node, n_sharers, this_rank())
    call gather_all(reshape(int(candidates%key, int64), [size(candidates%key)]), keys)
    call candidates%keep_boundary(own, whole%node, reshape(int(keys), [key_length, size(keys)/key_length]))
    call pack_faults(own, whole, candidates, packed)
    call gather_all(packed, all)
    call faults%unpack(all)
  end subroutine find_boundary

  !> How the parts of the volume hang together.
  subroutine find_joints(own, whole, layer, faults, joints)
    !> Elements that this rank owns.
    type(body_mesh_t), intent(in) :: own
    !> Their numbers in the whole body.
    type(whole_numbers_t), intent(in) :: whole
    !> The surface.
    type(surface_layer_t), intent(in) :: layer
    !> What is wrong with faces.
    type(share_faults_t), intent(in) :: faults
    !> The joints, the same on all ranks.
    type(joints_t), intent(out) :: joints
    real(dp), allocatable :: shortest(:), length(:)
    integer, allocatable :: node(:)
    integer(int64), allocatable :: all(:)
    integer :: i
    integer(int64) :: n, done
    call find_layer_edges(own, whole, layer, shortest)
    node = pack([(i, i=1, size(shortest))], shortest < huge(shortest))
    call gather_all([size(node, kind=int64), int(node, int64), &
                     transfer(shortest(node), [integer(int64) ::], size(node))], all)
    ! The least of all ranks.
    done = 0
    do while (done < size(all, kind=int64))
      n = all(done + 1)
      node = int(all(done + 2:done + 1 + n))
      length = transfer(all(done + 2 + n:done + 1 + 2*n), [real(dp) ::], int(n))
      shortest(node) = min(shortest(node), length)
      done = done + 1 + 2*n
    end do
    call joints%find_in_layer(layer, shortest, faults)
  end subroutine find_joints
end module dotyk_model_volume_joints
