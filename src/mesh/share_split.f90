!> Balanced parts of a body of which each rank has read a share: elements move to the rank of their place on a Morton
!> curve.
!>
!> The way: `share_box` and the box of all ranks; `share_weights` and their sum over all ranks; `parts_of_bins` on each
!> rank; `pack_for_rank` for each other rank, and `dotyk_mesh_surface_layer` unpacks what all of them send. Nothing is
!> as large as the body: the weights have a fixed number of bins, elements are sent once.
module dotyk_mesh_share_split
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_body_part, only: element_centres
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_element_ordering, only: curve_bits, morton_keys
  use dotyk_mesh_layer_share, only: layer_share_t, no_elements, pack_items, whole_numbers_t
  implicit none
  private
  public :: share_box, share_weights, parts_of_bins, parts_of_share, pack_for_rank

  !> Bits of the number of bins along the curve.
  integer, parameter :: bin_bits = 18
  !> Number of bins along the curve.
  integer, parameter, public :: n_bins = 2**bin_bits

contains

  !> Box of the nodes of a share; huge and negative where it has none.
  pure subroutine share_box(own, low, high)
    !> Elements of the share.
    type(body_mesh_t), intent(in) :: own
    !> Lower corner (dimension) [length].
    real(dp), intent(out) :: low(:)
    !> Upper corner (dimension) [length].
    real(dp), intent(out) :: high(:)
    low = minval(own%x, dim=2)
    high = maxval(own%x, dim=2)
  end subroutine share_box

  !> Bin of each element along the curve.
  subroutine bins_of_share(own, low, high, bin, weight)
    !> Elements of the share.
    type(body_mesh_t), intent(in) :: own
    !> Lower corner of the whole body (dimension) [length].
    real(dp), intent(in) :: low(:)
    !> Upper corner of the whole body (dimension) [length].
    real(dp), intent(in) :: high(:)
    !> Bin of each element, from 0, counted through all blocks (n_elements).
    integer, allocatable, intent(out) :: bin(:)
    !> Number of nodes of each element (n_elements).
    integer, allocatable, intent(out) :: weight(:)
    real(dp), allocatable :: centre(:, :)
    integer :: e
    call element_centres(own, centre, weight)
    allocate (bin(size(weight)))
    call morton_keys(own%dimension, centre, reshape([(e, e=1, size(bin))], [1, size(bin)]), low, maxval(high - low), &
                     bin)
    bin = ishft(bin, -(curve_bits(own%dimension) - bin_bits))
  end subroutine bins_of_share

  !> Nodes of elements in each bin.
  subroutine share_weights(own, low, high, total)
    !> Elements of the share.
    type(body_mesh_t), intent(in) :: own
    !> Lower corner of the whole body (dimension) [length].
    real(dp), intent(in) :: low(:)
    !> Upper corner of the whole body (dimension) [length].
    real(dp), intent(in) :: high(:)
    !> Nodes of the elements of the share in each bin (0:n_bins-1).
    integer(int64), intent(out) :: total(0:)
    integer, allocatable :: bin(:), weight(:)
    integer :: e
    call bins_of_share(own, low, high, bin, weight)
    total = 0
    do e = 1, size(bin)
      total(bin(e)) = total(bin(e)) + weight(e)
    end do
  end subroutine share_weights

  !> Part of each bin, so that the parts have about the same weight: those of all volumes, one after the other.
  pure subroutine parts_of_bins(total, before, whole, n_parts, part)
    !> Nodes of the elements of all shares in each bin (0:n_bins-1).
    integer(int64), intent(in) :: total(0:)
    !> Those of the volumes before this one, and of all volumes.
    integer(int64), intent(in) :: before, whole
    !> Number of parts.
    integer, intent(in) :: n_parts
    !> Part of each bin, from 0 (0:n_bins-1).
    integer, intent(out) :: part(0:)
    integer(int64) :: done
    integer :: i
    done = before
    do i = 0, size(total) - 1
      part(i) = min(n_parts - 1, int((2*done + total(i))*n_parts/(2*max(1_int64, whole))))
      done = done + total(i)
    end do
  end subroutine parts_of_bins

  !> Part of each element of a share.
  subroutine parts_of_share(own, low, high, part_of_bin, part)
    !> Elements of the share.
    type(body_mesh_t), intent(in) :: own
    !> Lower corner of the whole body (dimension) [length].
    real(dp), intent(in) :: low(:)
    !> Upper corner of the whole body (dimension) [length].
    real(dp), intent(in) :: high(:)
    !> Part of each bin, from 0 (0:n_bins-1).
    integer, intent(in) :: part_of_bin(0:)
    !> Part of each element, from 0, counted through all blocks (n_elements).
    integer, allocatable, intent(out) :: part(:)
    integer, allocatable :: bin(:), weight(:)
    call bins_of_share(own, low, high, bin, weight)
    part = [part_of_bin(bin)]
  end subroutine parts_of_share

  !> Pack the elements of a share that move to one rank.
  subroutine pack_for_rank(own, whole, file_node, n_file_nodes, part, rank, share)
    !> Elements of the share.
    type(body_mesh_t), intent(in) :: own
    !> Their numbers in the whole body; those of nodes are not needed.
    type(whole_numbers_t), intent(in) :: whole
    !> Number of each node in the file, ascending (n_nodes).
    integer, intent(in) :: file_node(:)
    !> Number of nodes of the file.
    integer, intent(in) :: n_file_nodes
    !> Part of each element (n_elements).
    integer, intent(in) :: part(:)
    !> The rank that gets them.
    integer, intent(in) :: rank
    !> What is sent; nodes have their numbers in the file.
    type(layer_share_t), intent(out) :: share
    type(whole_numbers_t) :: numbers
    type(boundary_candidates_t) :: nothing
    logical, allocatable :: has(:, :)
    integer :: b, n
    numbers%n_nodes = n_file_nodes
    numbers%node = file_node
    numbers%block = whole%block
    numbers%rank = rank
    allocate (numbers%node_rank(size(file_node)), numbers%global_node(size(file_node)), nothing%root(size(file_node)), &
              source=0)
    call no_elements(own, has)
    n = 0
    do b = 1, size(own%block)
      has(:size(own%block(b)%tag), b) = part(n + 1:n + size(own%block(b)%tag)) == rank
      n = n + size(own%block(b)%tag)
    end do
    call pack_items(own, numbers, has, spread(.false., 1, size(file_node)), nothing, 0, [integer(int64) ::], 0.0_dp, &
                    share)
  end subroutine pack_for_rank
end module dotyk_mesh_share_split
