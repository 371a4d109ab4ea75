!> Checks of the mesh of one body: range of coordinates, nodes off the plane, repeated elements,
!> inverted and degenerate elements.
module dotyk_mesh_mesh_check
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: is_too_large, size_rule, smallest_number
  use dotyk_base_text, only: counted, to_text
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_jacobian, only: jacobian_range, mirror_order
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: check_size, check_plane, check_repeated_elements, orient_elements

  !> Nodes of a plane mesh may deviate from the plane by this fraction of the size of the body.
  real(dp), parameter :: plane_tolerance = 1.0e-9_dp
  !> Greatest number of tags in a message.
  integer, parameter :: max_listed = 10

  !> Numbers of elements by the sign of their Jacobian determinant.
  type :: census_t
    !> Elements of positive volume.
    integer :: n_positive = 0
    !> Elements of negative volume.
    integer :: n_negative = 0
    !> Other elements.
    integer :: n_degenerate = 0
  end type census_t

contains

  !> Check that coordinates are finite, and neither they nor the size of the body too large or too small to compute
  !> with.
  subroutine check_size(x, tag, error)
    !> Nodal coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Node tags (n_nodes).
    integer(int64), intent(in) :: tag(:)
    !> Set for the first node out of range, or for a body that is too small.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: edge
    integer :: i
    do i = 1, size(tag)
      if (.not. any(is_too_large(x(:, i)))) cycle
      if (all(ieee_is_finite(x(:, i)))) then
        call set_error(error, 'node '//to_text(tag(i))//' is too far away, at '//position_text(x(:, i))//'; '// &
                       size_rule)
      else
        call set_error(error, 'the coordinates of node '//to_text(tag(i))//' are not finite: '//position_text(x(:, i)))
      end if
      return
    end do
    edge = maxval(maxval(x, dim=2) - minval(x, dim=2))
    if (edge >= smallest_number .or. size(tag) < 2) return
    call set_error(error, 'the body is too small, its longest edge is '//to_text(edge)//'; '//size_rule)
  end subroutine check_size

  !> Check that all nodes have the same z, for a plane analysis.
  subroutine check_plane(x, tag, error)
    !> Nodal coordinates (3, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Node tags (n_nodes).
    integer(int64), intent(in) :: tag(:)
    !> Set if a node is off the plane of the first node.
    type(error_t), allocatable, intent(out) :: error
    integer :: worst
    worst = maxloc(abs(x(3, :) - x(3, 1)), dim=1)
    if (abs(x(3, worst) - x(3, 1)) <= plane_tolerance*norm2(maxval(x(:2, :), dim=2) - minval(x(:2, :), dim=2))) return
    call set_error(error, 'node '//to_text(tag(worst))//' at '//position_text(x(:, worst))//' and node '// &
                   to_text(tag(1))//' at '//position_text(x(:, 1))// &
                   ' do not lie in one plane z = const, as an analysis in two dimensions needs')
  end subroutine check_plane

  !> Check that no element is repeated, which would double its stiffness.
  subroutine check_repeated_elements(block, error)
    !> Elements (n_blocks).
    type(element_block_t), intent(in) :: block(:)
    !> Set if two elements of a kind have the same corners.
    type(error_t), allocatable, intent(out) :: error
    ! Elements with the same lowest corner form a chain: first(corner), then next(element).
    integer, allocatable :: first(:), next(:)
    integer :: b, e, other, nc, low
    type(element_kind_t) :: kind
    do b = 1, size(block)
      kind = element_kind(block(b)%kind)
      nc = kind%n_corners
      allocate (first(maxval(block(b)%node)), next(size(block(b)%tag)))
      first = 0
      do e = 1, size(next)
        low = minval(block(b)%node(:nc, e))
        other = first(low)
        do while (other > 0)
          if (same_set(nc, block(b)%node(:nc, e), block(b)%node(:nc, other))) then
            call set_error(error, 'elements '//to_text(block(b)%tag(other))//' and '//to_text(block(b)%tag(e))// &
                           ' ('//trim(kind%name)//') have the same corners: remove one, as gmsh does with '// &
                           '`Coherence Mesh;`')
            return
          end if
          other = next(other)
        end do
        next(e) = first(low)
        first(low) = e
      end do
      deallocate (first, next)
    end do
  end subroutine check_repeated_elements

  !> Whether two lists of distinct numbers are permutations of each other.
  pure logical function same_set(n, a, b)
    !> Length of the lists.
    integer, intent(in) :: n
    !> First list (n).
    integer, intent(in) :: a(n)
    !> Second list (n).
    integer, intent(in) :: b(n)
    integer :: i
    same_set = sum(a) == sum(b)
    do i = 1, n
      if (same_set) same_set = any(b == a(i))
    end do
  end function same_set

  !> Reverse all elements if all volumes are negative; refuse a mixture, and elements whose Jacobian determinant
  !> vanishes or changes its sign.
  subroutine orient_elements(x, block, error)
    !> Nodal coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Elements (n_blocks); the nodes of all are permuted if all are inverted.
    type(element_block_t), intent(inout) :: block(:)
    !> Set, with the exit code `exit_not_solvable`, for a mixture of orientations and for degenerate elements.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: smallest(:), largest(:)
    type(census_t) :: census
    integer :: b
    do b = 1, size(block)
      call block_jacobians(x, block(b), smallest, largest)
      census%n_positive = census%n_positive + count(smallest > 0)
      census%n_negative = census%n_negative + count(largest < 0)
      census%n_degenerate = census%n_degenerate + count(.not. (smallest > 0 .or. largest < 0))
    end do
    if (census%n_degenerate > 0) then
      call report_degenerate(x, block, census, error)
    else if (census%n_positive > 0 .and. census%n_negative > 0) then
      call report_mixture(x, block, census, error)
    else if (census%n_negative > 0) then
      do b = 1, size(block)
        block(b)%node = block(b)%node(mirror_order(block(b)%kind), :)
      end do
    end if
  end subroutine orient_elements

  !> Smallest and largest Jacobian determinant of each element of a block.
  subroutine block_jacobians(x, block, smallest, largest)
    !> Nodal coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Elements.
    type(element_block_t), intent(in) :: block
    !> Smallest determinants (n_elements) [length^dimension].
    real(dp), allocatable, intent(out) :: smallest(:)
    !> Largest determinants (n_elements) [length^dimension].
    real(dp), allocatable, intent(out) :: largest(:)
    allocate (smallest(size(block%tag)), largest(size(block%tag)))
    call jacobian_range(block%kind, size(block%tag), block%node, size(x, 1), size(x, 2), x, smallest, largest)
  end subroutine block_jacobians

  !> Error for degenerate elements, which names the worst.
  subroutine report_degenerate(x, block, census, error)
    !> Nodal coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Elements (n_blocks).
    type(element_block_t), intent(in) :: block(:)
    !> Numbers of elements by orientation.
    type(census_t), intent(in) :: census
    !> Allocated on return: names the worst element and the number of degenerate ones.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: smallest(:), largest(:), middle(:)
    real(dp) :: badness, worst, range(2)
    character(:), allocatable :: advice
    integer :: b, e, worst_element(2), n
    type(element_kind_t) :: kind
    worst = -1
    worst_element = 0
    range = 0
    do b = 1, size(block)
      call block_jacobians(x, block(b), smallest, largest)
      do e = 1, size(smallest)
        if (smallest(e) > 0 .or. largest(e) < 0) cycle
        ! Ratio of the determinant of the wrong sign to that of the right one: 0 .. 1; 1 for a vanishing element.
        badness = 1
        if (largest(e) > smallest(e)) badness = min(-smallest(e), largest(e))/max(-smallest(e), largest(e))
        if (badness <= worst) cycle
        worst = badness
        worst_element = [b, e]
        range = [smallest(e), largest(e)]
      end do
    end do
    if (census%n_negative > census%n_positive) range = -range([2, 1])
    kind = element_kind(block(worst_element(1))%kind)
    n = kind%n_corners
    middle = sum(x(:, block(worst_element(1))%node(:n, worst_element(2))), dim=2)/n
    advice = ''
    if (kind%order > 1) advice = '; gmsh repairs quadratic elements with Mesh.HighOrderOptimize = 2;'
    call set_error(error, 'element '//to_text(block(worst_element(1))%tag(worst_element(2)))//' ('//trim(kind%name)// &
                   ') near '//position_text(middle)//' is degenerate: its Jacobian determinant ranges from '// &
                   to_text(range(1))//' to '//to_text(range(2))//' ('// &
                   counted(census%n_degenerate, 'such element')//'): refine the mesh there'//advice, exit_not_solvable)
  end subroutine report_degenerate

  !> Error for a mixture of orientations, which names the elements of the minority.
  subroutine report_mixture(x, block, census, error)
    !> Nodal coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Elements (n_blocks).
    type(element_block_t), intent(in) :: block(:)
    !> Numbers of elements by orientation.
    type(census_t), intent(in) :: census
    !> Allocated on return: names the elements of the rarer orientation.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: smallest(:), largest(:)
    character(:), allocatable :: tags, hint
    logical :: negative
    integer :: b, e, n
    negative = census%n_negative <= census%n_positive
    n = 0
    tags = ''
    do b = 1, size(block)
      call block_jacobians(x, block(b), smallest, largest)
      do e = 1, size(smallest)
        if (negative .neqv. largest(e) < 0) cycle
        n = n + 1
        if (n <= max_listed) tags = tags//trim(merge(', ', '  ', n > 1))//' '//to_text(block(b)%tag(e))
      end do
    end do
    if (n > max_listed) tags = tags//', ...'
    hint = ''
    if (size(x, 1) == 2) hint = ' (gmsh reverses surfaces with `ReverseMesh Surface {...};`)'
    call set_error(error, to_text(n)//' of '//to_text(census%n_positive + census%n_negative)// &
                   ' elements are inverted against the others (their volumes have the other sign):'//tags//hint, &
                   exit_not_solvable)
  end subroutine report_mixture

  !> Coordinates, for messages.
  pure function position_text(x) result(text)
    !> Coordinates (dimension) [length].
    real(dp), intent(in) :: x(:)
    !> Text.
    character(:), allocatable :: text
    integer :: k
    text = '('//to_text(x(1))
    do k = 2, size(x)
      text = text//', '//to_text(x(k))
    end do
    text = text//')'
  end function position_text
end module dotyk_mesh_mesh_check
