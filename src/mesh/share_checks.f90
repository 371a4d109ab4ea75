!> Checks of a body of which each rank has a share of the elements only: the same errors as `extract_body` gives for the
!> whole body, on all ranks.
!>
!> Each check packs what the rank finds into a plain array; those of all ranks, one after the other, tell whether the
!> body is refused. Repeated elements are found with the faces (`dotyk_mesh_share_faults`).
module dotyk_mesh_share_checks
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element_orientation, only: element_sign_t, orientation_census_t, refuse_orientations, &
    reverse_elements
  use dotyk_mesh_face_faults, only: face_order
  use dotyk_mesh_layer_share, only: whole_numbers_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_check, only: first_out_of_range, refuse_off_plane, refuse_position, refuse_small
  implicit none
  private
  public :: pack_extent, check_extent, pack_orientation, orient_share

  !> Numbers of a rank in `pack_extent`: four nodes with their numbers in the file, tags and coordinates; the box.
  integer, parameter :: node_length = 5, extent_length = 4*node_length + 6
  !> The nodes: the first out of range; the first of all; those of lowest and greatest z.
  integer, parameter :: out_of_range = 1, first_node = 2, lowest = 3, highest = 4
  integer, parameter :: census_length = 14  !! Numbers at the head of a rank in `pack_orientation`.

contains

  !> Pack what a rank finds of the range of the coordinates.
  subroutine pack_extent(mesh, own, file_node, packed)
    type(mesh_t), intent(in) :: mesh  !! Mesh, of which the rank has read a share.
    type(body_mesh_t), intent(in) :: own  !! Elements from it, and their nodes.
    integer, intent(in) :: file_node(:)  !! Number of each node in the file, ascending (n_nodes).
    integer(int64), allocatable, intent(out) :: packed(:)  !! What other ranks must know (extent_length).
    real(dp) :: box(6)
    integer :: node(4), k
    node = 0
    box(:3) = huge(box)
    box(4:) = -huge(box)
    associate (x => mesh%x(:, own%mesh_node))
      if (size(x, 2) > 0) then
        node(out_of_range) = first_out_of_range(x(:own%dimension, :))
        ! Numbers that are not finite have no order.
        if (node(out_of_range) == 0) then
          node(first_node:) = [1, minloc(x(3, :)), maxloc(x(3, :))]
          box = [minval(x, dim=2), maxval(x, dim=2)]
        end if
      end if
      allocate (packed(extent_length), source=0_int64)
      do k = 1, size(node)
        if (node(k) > 0) packed((k - 1)*node_length + 1:k*node_length) = &
          [int(file_node(node(k)), int64), own%node_tag(node(k)), transfer(x(:, node(k)), packed)]
      end do
      packed(4*node_length + 1:) = transfer(box, packed)
    end associate
  end subroutine pack_extent

  !> Refuse coordinates that are not finite, too large or too small to compute with, or off the plane.
  subroutine check_extent(own, volume_name, packed, error)
    type(body_mesh_t), intent(in) :: own  !! Elements of the rank.
    character(*), intent(in) :: volume_name  !! Name of the physical groups.
    integer(int64), intent(in) :: packed(:)  !! The arrays of `pack_extent` of all ranks, one after the other (any).
    !> Set for the first node out of range, for a body that is too small, and for nodes off the plane.
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: number(4), tag(4)
    real(dp) :: x(3, 4), position(3), low(3), high(3), box(6)
    integer :: at, d, k, far
    number = 0
    low = huge(low)
    high = -huge(high)
    do at = 0, size(packed) - 1, extent_length
      do k = 1, 4
        associate (node => packed(at + (k - 1)*node_length + 1:at + k*node_length))
          if (node(1) == 0) cycle
          position = transfer(node(3:), position)
          if (number(k) > 0 .and. .not. is_ahead(k)) cycle
          number(k) = node(1)
          tag(k) = node(2)
          x(:, k) = position
        end associate
      end do
      box = transfer(packed(at + 4*node_length + 1:at + extent_length), box)
      low = min(low, box(:3))
      high = max(high, box(4:))
    end do
    d = own%dimension
    if (number(out_of_range) > 0) then
      call refuse_position(x(:d, out_of_range), tag(out_of_range), error)
    else
      call refuse_small(maxval(high(:d) - low(:d)), error)
      far = merge(highest, lowest, x(3, highest) - x(3, first_node) > x(3, first_node) - x(3, lowest))
      if (d == 2 .and. .not. allocated(error)) &
        call refuse_off_plane(x(:, [first_node, far]), tag([first_node, far]), norm2(high(:2) - low(:2)), error)
    end if
    if (allocated(error)) call add_place(own, volume_name, error)

  contains

    !> Whether the node of a rank comes before the one that is known.
    logical function is_ahead(k)
      integer, intent(in) :: k  !! What the node is.
      is_ahead = packed(at + (k - 1)*node_length + 1) < number(k)
      if (k == lowest .and. abs(position(3) - x(3, k)) > 0) is_ahead = position(3) < x(3, k)
      if (k == highest .and. abs(position(3) - x(3, k)) > 0) is_ahead = position(3) > x(3, k)
    end function is_ahead
  end subroutine check_extent

  !> Pack what a rank finds of the orientation of its elements.
  subroutine pack_orientation(own, whole, packed)
    type(body_mesh_t), intent(in) :: own  !! Elements that the rank owns.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body; those of nodes are not needed.
    integer(int64), allocatable, intent(out) :: packed(:)  !! What other ranks must know (any).
    type(orientation_census_t) :: census
    call census%find(own%x, own%block)
    if (census%badness >= 0) census%worst_order = in_whole(census%worst_order)
    packed = [census%positive%n, census%negative%n, census%n_degenerate, transfer(census%badness, packed), &
              census%worst_order, census%worst_tag, census%worst_kind, &
              transfer([census%range, census%middle], packed), &
              int([size(census%positive%tag), size(census%negative%tag)], int64), &
              in_whole(census%positive%order), census%positive%tag, &
              in_whole(census%negative%order), census%negative%tag]

  contains

    !> Place of an element in the order of those of the whole body.
    elemental integer(int64) function in_whole(order)
      integer(int64), intent(in) :: order  !! Its place among those of the rank.
      integer :: b, e
      b = int(ishft(order, -40))
      e = int(ibits(order, 0, 40)/8)
      in_whole = face_order(b, whole%block(b)%element(e), 0)
    end function in_whole
  end subroutine pack_orientation

  !> Reverse all elements of the rank if those of all ranks are inverted; refuse a mixture and degenerate elements.
  subroutine orient_share(own, volume_name, packed, error)
    !> Elements that the rank owns; their nodes are permuted if all elements of the body are inverted.
    type(body_mesh_t), intent(inout) :: own
    character(*), intent(in) :: volume_name  !! Name of the physical groups.
    !> The arrays of `pack_orientation` of all ranks, one after the other (any).
    integer(int64), intent(in) :: packed(:)
    !> Set, with the exit code `exit_not_solvable`, for a mixture of orientations and for degenerate elements; repeated
    !> elements are to be told first.
    type(error_t), allocatable, intent(out) :: error
    type(orientation_census_t) :: census, of_rank
    real(dp) :: reals(5)
    integer :: at, n(2)
    call census%find(own%x, own%block(:0))
    at = 0
    do while (at < size(packed))
      associate (head => packed(at + 1:at + census_length))
        of_rank%n_degenerate = head(3)
        of_rank%badness = transfer(head(4), of_rank%badness)
        of_rank%worst_order = head(5)
        of_rank%worst_tag = head(6)
        of_rank%worst_kind = head(7)
        reals = transfer(head(8:12), reals)
        of_rank%range = reals(:2)
        of_rank%middle = reals(3:)
        n = int(head(13:14))
        associate (listed => packed(at + census_length + 1:at + census_length + 2*sum(n)))
          of_rank%positive = element_sign_t(head(1), listed(:n(1)), listed(n(1) + 1:2*n(1)))
          of_rank%negative = element_sign_t(head(2), listed(2*n(1) + 1:2*n(1) + n(2)), listed(2*n(1) + n(2) + 1:))
        end associate
      end associate
      call census%add(of_rank)
      at = at + census_length + 2*sum(n)
    end do
    call refuse_orientations(census, own%dimension, error)
    if (allocated(error)) then
      call add_place(own, volume_name, error)
    else if (census%negative%n > 0) then
      call reverse_elements(own%block)
    end if
  end subroutine orient_share

  !> Say which mesh and volume an error is about.
  subroutine add_place(own, volume_name, error)
    type(body_mesh_t), intent(in) :: own  !! Elements of the rank.
    character(*), intent(in) :: volume_name  !! Name of the physical groups.
    type(error_t), allocatable, intent(inout) :: error  !! The error.
    error%message = 'mesh '//quoted(own%file)//', '//quoted(volume_name)//': '//error%message
  end subroutine add_place
end module dotyk_mesh_share_checks
