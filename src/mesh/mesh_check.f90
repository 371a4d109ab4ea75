!> Checks of the mesh of one body: range of coordinates, nodes off the plane, repeated elements.
module dotyk_mesh_mesh_check
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: is_too_large, size_rule, smallest_number
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: same_number
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: check_size, check_plane, check_repeated_elements, position_text

contains

  !> Check that coordinates are finite, and neither they nor the size of the body too large or too small to compute
  !> with.
  subroutine check_size(x, tag, error)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dimension, n_nodes) [length].
    integer(int64), intent(in) :: tag(:)  !! Node tags (n_nodes).
    type(error_t), allocatable, intent(out) :: error  !! For the first node out of range, or too small a body.
    real(dp) :: edge
    integer :: i
    do i = 1, size(x, 2)
      if (.not. any(is_too_large(x(:, i)))) cycle
      if (all(ieee_is_finite(x(:, i)))) then
        call set_error(error, 'node '//to_text(tag(i))//' is too far away, at '//position_text(x(:, i))//'; '// &
                       size_rule)
      else
        call set_error(error, 'the coordinates of node '//to_text(tag(i))//' are not finite: '//position_text(x(:, i)))
      end if
      return
    end do
    if (size(tag) < 2) return
    edge = maxval(maxval(x, dim=2) - minval(x, dim=2))
    if (edge < smallest_number) &
      call set_error(error, 'the body is too small, its longest edge is '//to_text(edge)//'; '//size_rule)
  end subroutine check_size

  !> Check that all nodes have the same z, for a plane analysis.
  subroutine check_plane(x, tag, error)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (3, n_nodes) [length].
    integer(int64), intent(in) :: tag(:)  !! Node tags (n_nodes).
    type(error_t), allocatable, intent(out) :: error  !! Set if a node is off the plane of the first node.
    integer :: worst
    worst = maxloc(abs(x(3, :) - x(3, 1)), dim=1)
    if (abs(x(3, worst) - x(3, 1)) <= same_number*norm2(maxval(x(:2, :), dim=2) - minval(x(:2, :), dim=2))) return
    call set_error(error, 'node '//to_text(tag(worst))//' at '//position_text(x(:, worst))//' and node '// &
                   to_text(tag(1))//' at '//position_text(x(:, 1))// &
                   ' do not lie in one plane z = const, as an analysis in two dimensions needs')
  end subroutine check_plane

  !> Check that no element is repeated, which would double its stiffness.
  subroutine check_repeated_elements(block, error)
    type(element_block_t), intent(in) :: block(:)  !! Elements (n_blocks).
    type(error_t), allocatable, intent(out) :: error  !! Set if two elements of a kind have the same corners.
    integer :: kind, b, k
    ! Blocks of one kind have different materials.
    do k = 1, size(block)
      kind = block(k)%kind
      if (any(block(:k - 1)%kind == kind)) cycle
      call search(pack([(b, b=1, size(block))], block%kind == kind))
      if (allocated(error)) return
    end do

  contains

    !> Search some blocks of one kind.
    subroutine search(chosen)
      integer, intent(in) :: chosen(:)  !! The blocks.
      ! Elements with the same lowest corner form a chain: first(corner), then next(element).
      integer, allocatable :: first(:), next(:), of_block(:), of_element(:)
      type(element_kind_t) :: properties
      integer :: b, e, i, j, n, nc, low, other
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
              call set_error(error, 'elements '//to_text(block(of_block(other))%tag(of_element(other)))//' and '// &
                             to_text(block(b)%tag(e))//' ('//trim(properties%name)// &
                             ') have the same corners: remove one, as gmsh does with `Coherence Mesh;`')
              return
            end if
          end associate
          other = next(other)
        end do
        next(n) = first(low)
        first(low) = n
      end do
    end subroutine search
  end subroutine check_repeated_elements

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
