!> Checks of the mesh of one body: range of coordinates, nodes off the plane, repeated elements.
!>
!> Each check finds and tells: ranks that have shares of the body find, and tell what all of them have found.
module dotyk_mesh_mesh_check
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: is_too_large, size_rule, smallest_number
  use dotyk_base_text, only: to_text
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: check_size, check_plane, check_repeated_elements
  public :: first_out_of_range, refuse_position, refuse_small, refuse_off_plane, find_repeated, refuse_repeated
  public :: position_text

  !> Nodes of a plane mesh may deviate from the plane by this fraction of the size of the body.
  real(dp), parameter :: plane_tolerance = 1.0e-9_dp

contains

  !> Check that coordinates are finite, and neither they nor the size of the body too large or too small to compute
  !> with.
  subroutine check_size(x, tag, error)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dimension, n_nodes) [length].
    integer(int64), intent(in) :: tag(:)  !! Node tags (n_nodes).
    !> Set for the first node out of range, or for a body that is too small.
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    i = first_out_of_range(x)
    if (i > 0) then
      call refuse_position(x(:, i), tag(i), error)
    else if (size(tag) > 1) then
      call refuse_small(maxval(maxval(x, dim=2) - minval(x, dim=2)), error)
    end if
  end subroutine check_size

  !> The first node whose coordinates cannot be computed with; 0 if there is none.
  pure integer function first_out_of_range(x) result(first)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dimension, n_nodes) [length].
    do first = 1, size(x, 2)
      if (any(is_too_large(x(:, first)))) return
    end do
    first = 0
  end function first_out_of_range

  !> Error for a node out of range.
  subroutine refuse_position(x, tag, error)
    real(dp), intent(in) :: x(:)  !! Its coordinates (dimension) [length].
    integer(int64), intent(in) :: tag  !! Its tag.
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return.
    if (all(ieee_is_finite(x))) then
      call set_error(error, 'node '//to_text(tag)//' is too far away, at '//position_text(x)//'; '//size_rule)
    else
      call set_error(error, 'the coordinates of node '//to_text(tag)//' are not finite: '//position_text(x))
    end if
  end subroutine refuse_position

  !> Refuse a body that is too small to compute with.
  subroutine refuse_small(edge, error)
    real(dp), intent(in) :: edge  !! Longest edge of the box of its nodes [length].
    type(error_t), allocatable, intent(out) :: error  !! Set for a body that is too small.
    if (edge >= smallest_number) return
    call set_error(error, 'the body is too small, its longest edge is '//to_text(edge)//'; '//size_rule)
  end subroutine refuse_small

  !> Check that all nodes have the same z, for a plane analysis.
  subroutine check_plane(x, tag, error)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (3, n_nodes) [length].
    integer(int64), intent(in) :: tag(:)  !! Node tags (n_nodes).
    type(error_t), allocatable, intent(out) :: error  !! Set if a node is off the plane of the first node.
    integer :: worst
    worst = maxloc(abs(x(3, :) - x(3, 1)), dim=1)
    call refuse_off_plane(x(:, [1, worst]), tag([1, worst]), norm2(maxval(x(:2, :), dim=2) - minval(x(:2, :), dim=2)), &
                          error)
  end subroutine check_plane

  !> Refuse a body of which a node is off the plane.
  subroutine refuse_off_plane(x, tag, diagonal, error)
    real(dp), intent(in) :: x(3, 2)  !! The first node, and the one that is farthest from its plane (3, 2) [length].
    integer(int64), intent(in) :: tag(2)  !! Their tags.
    real(dp), intent(in) :: diagonal  !! Diagonal of the box of all nodes in the plane [length].
    type(error_t), allocatable, intent(out) :: error  !! Set if the node is off the plane.
    if (abs(x(3, 2) - x(3, 1)) <= plane_tolerance*diagonal) return
    call set_error(error, 'node '//to_text(tag(2))//' at '//position_text(x(:, 2))//' and node '//to_text(tag(1))// &
                   ' at '//position_text(x(:, 1))// &
                   ' do not lie in one plane z = const, as an analysis in two dimensions needs')
  end subroutine refuse_off_plane

  !> Check that no element is repeated, which would double its stiffness.
  subroutine check_repeated_elements(block, error)
    type(element_block_t), intent(in) :: block(:)  !! Elements (n_blocks).
    type(error_t), allocatable, intent(out) :: error  !! Set if two elements of a kind have the same corners.
    integer :: b, e
    integer(int64) :: tag(2)
    call find_repeated(block, b, e, tag)
    if (b > 0) call refuse_repeated(block(b)%kind, tag, error)
  end subroutine check_repeated_elements

  !> The first element that has the same corners as one before it.
  subroutine find_repeated(block, b, e, tag)
    type(element_block_t), intent(in) :: block(:)  !! Elements (n_blocks).
    integer, intent(out) :: b  !! Block of the element; 0 where no element is repeated.
    integer, intent(out) :: e  !! The element in its block.
    integer(int64), intent(out) :: tag(2)  !! Tags of the one before it and of the element.
    integer :: kind, k, other
    ! Blocks of one kind have different materials.
    do k = 1, size(block)
      kind = block(k)%kind
      if (any(block(:k - 1)%kind == kind)) cycle
      call search(pack([(b, b=1, size(block))], block%kind == kind))
      if (b > 0) return
    end do

  contains

    !> Search some blocks of one kind.
    subroutine search(chosen)
      integer, intent(in) :: chosen(:)  !! The blocks.
      ! Elements with the same lowest corner form a chain: first(corner), then next(element).
      integer, allocatable :: first(:), next(:), of_block(:), of_element(:)
      type(element_kind_t) :: properties
      integer :: i, j, n, nc, low
      properties = element_kind(kind)
      nc = properties%n_corners
      of_block = [(spread(chosen(i), 1, size(block(chosen(i))%tag)), i=1, size(chosen))]
      of_element = [([(j, j=1, size(block(chosen(i))%tag))], i=1, size(chosen))]
      allocate (first(maxval([(maxval(block(chosen(i))%node), i=1, size(chosen))])), source=0)
      allocate (next(size(of_block)))
      do n = 1, size(next)
        b = of_block(n)
        e = of_element(n)
        low = minval(block(b)%node(:nc, e))
        other = first(low)
        do while (other > 0)
          associate (node => block(of_block(other))%node(:nc, of_element(other)))
            if (same_set(nc, block(b)%node(:nc, e), node)) then
              tag = [block(of_block(other))%tag(of_element(other)), block(b)%tag(e)]
              return
            end if
          end associate
          other = next(other)
        end do
        next(n) = first(low)
        first(low) = n
      end do
      b = 0
    end subroutine search
  end subroutine find_repeated

  !> Error for two elements with the same corners.
  subroutine refuse_repeated(kind, tag, error)
    integer, intent(in) :: kind  !! Kind of the elements.
    integer(int64), intent(in) :: tag(2)  !! Their tags.
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return.
    type(element_kind_t) :: element
    element = element_kind(kind)
    call set_error(error, 'elements '//to_text(tag(1))//' and '//to_text(tag(2))//' ('//trim(element%name)// &
                   ') have the same corners: remove one, as gmsh does with `Coherence Mesh;`')
  end subroutine refuse_repeated

  !> Whether two lists of distinct numbers are permutations of each other.
  pure logical function same_set(n, a, b)
    integer, intent(in) :: n  !! Length of the lists.
    integer, intent(in) :: a(n)  !! First list (n).
    integer, intent(in) :: b(n)  !! Second list (n).
    integer :: i
    same_set = sum(a) == sum(b)
    do i = 1, n
      if (same_set) same_set = any(b == a(i))
    end do
  end function same_set

  !> Coordinates, for messages.
  pure function position_text(x) result(text)
    real(dp), intent(in) :: x(:)  !! Coordinates (dimension) [length].
    character(:), allocatable :: text  !! Text.
    integer :: k
    text = '('//to_text(x(1))
    do k = 2, size(x)
      text = text//', '//to_text(x(k))
    end do
    text = text//')'
  end function position_text
end module dotyk_mesh_mesh_check
