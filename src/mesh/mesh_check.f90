!> Faults of one body's mesh: nodes off the plane or at the same place, elements given twice, inverted or degenerate.
module dotyk_mesh_mesh_check
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: is_too_large, size_rule, smallest_number
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: to_text
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_jacobian, only: jacobian_range, mirror_order
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: check_size, check_plane, check_nodes, check_repeated_elements, orient_elements

  !> Nodes nearer than this times the body's size lie at the same place.
  real(dp), parameter :: same_place = 1.0e-12_dp
  !> Nodes of a plane mesh may be this far off the plane, relative to the body's size.
  real(dp), parameter :: off_plane = 1.0e-9_dp
  !> Most tags that a message lists.
  integer, parameter :: most_listed = 10

  !> What the sign of the jacobian says of the elements of one or all blocks.
  type :: census_t
    !> Numbers of elements of positive and of negative volume, and of others.
    integer :: n_up = 0, n_down = 0, n_bad = 0
  end type census_t

contains

  !> Coordinates are numbers, and neither they nor the whole body too large or too small to compute with.
  subroutine check_size(x, tag, error)
    !> Coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Node tags (n_nodes).
    integer(int64), intent(in) :: tag(:)
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: edge
    integer :: i
    do i = 1, size(tag)
      if (.not. any(is_too_large(x(:, i)))) cycle
      if (all(ieee_is_finite(x(:, i)))) then
        call set_error(error, 'node '//to_text(tag(i))//' is too far away, at '//place_text(x(:, i))//'; '//size_rule)
      else
        call set_error(error, 'the coordinates of node '//to_text(tag(i))//' are not finite: '//place_text(x(:, i)))
      end if
      return
    end do
    edge = maxval(maxval(x, dim=2) - minval(x, dim=2))
    if (edge >= smallest_number .or. size(tag) < 2) return
    call set_error(error, 'the body is too small, its longest edge is '//to_text(edge)//'; '//size_rule)
  end subroutine check_size

  !> A plane analysis needs all nodes at the same z.
  subroutine check_plane(x, tag, error)
    !> Coordinates (3, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Node tags (n_nodes).
    integer(int64), intent(in) :: tag(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: worst
    worst = maxloc(abs(x(3, :) - x(3, 1)), dim=1)
    if (abs(x(3, worst) - x(3, 1)) <= off_plane*norm2(maxval(x(:2, :), dim=2) - minval(x(:2, :), dim=2))) return
    call set_error(error, 'node '//to_text(tag(worst))//' at '//place_text(x(:, worst))//' and node '//to_text(tag(1)) &
      //' at '//place_text(x(:, 1))//' do not lie in one plane z = const, as an analysis in two dimensions needs')
  end subroutine check_plane

  !> Two nodes at the same place are a slit that nobody meant.
  subroutine check_nodes(x, tag, error)
    !> Coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Node tags (n_nodes).
    integer(int64), intent(in) :: tag(:)
    type(error_t), allocatable, intent(out) :: error
    ! Some direction: planes of a regular mesh do not lie across it.
    real(dp), parameter :: direction(3) = [0.5453920137_dp, 0.6180339887_dp, 0.5663117921_dp]
    real(dp), allocatable :: along(:)
    integer, allocatable :: order(:)
    real(dp) :: tolerance
    integer :: i, j, n, first(2)
    tolerance = same_place*norm2(maxval(x, dim=2) - minval(x, dim=2))
    along = matmul(direction(:size(x, 1)), x)
    allocate (order(size(along)))
    call sort_order(along, order)
    n = 0
    do i = 1, size(order)
      do j = i + 1, size(order)
        if (along(order(j)) - along(order(i)) > 2*tolerance) exit
        if (norm2(x(:, order(j)) - x(:, order(i))) > tolerance) cycle
        n = n + 1
        if (n == 1) first = [min(order(i), order(j)), max(order(i), order(j))]
      end do
    end do
    if (n == 0) return
    call set_error(error, 'nodes '//to_text(tag(first(1)))//' and '//to_text(tag(first(2)))//' lie at the same place ' &
      //place_text(x(:, first(1)))//' ('//counted(n, 'such pair')//'): the body falls apart there. Join its parts in ' &
      //'gmsh: `Coherence;` after the geometry or `Coherence Mesh;` after the mesh; or make them bodies of their own')
  end subroutine check_nodes

  !> An element that is given twice would be twice as stiff.
  subroutine check_repeated_elements(block, error)
    !> Elements (n_blocks).
    type(element_block_t), intent(in) :: block(:)
    type(error_t), allocatable, intent(out) :: error
    ! Elements with the same lowest corner are in one chain: first(corner), then next(element).
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
            call set_error(error, 'elements '//to_text(block(b)%tag(other))//' and '//to_text(block(b)%tag(e))//' (' &
              //trim(kind%name)//') have the same corners: remove one, as gmsh does with `Coherence Mesh;`')
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

  !> Whether two lists of different numbers are the same but for the order.
  pure logical function same_set(n, a, b)
    integer, intent(in) :: n, a(n), b(n)
    integer :: i
    same_set = sum(a) == sum(b)
    do i = 1, n
      if (same_set) same_set = any(b == a(i))
    end do
  end function same_set

  !> Make all volumes positive where all are negative; refuse a mixture, and elements whose jacobian vanishes or changes
  !> its sign.
  subroutine orient_elements(x, block, error)
    !> Coordinates (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Elements (n_blocks); the nodes of all are permuted where all are inverted.
    type(element_block_t), intent(inout) :: block(:)
    !> Exit code `exit_not_solvable`.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: least(:), most(:)
    type(census_t) :: census
    integer :: b
    do b = 1, size(block)
      call measure(x, block(b), least, most)
      census%n_up = census%n_up + count(least > 0)
      census%n_down = census%n_down + count(most < 0)
      census%n_bad = census%n_bad + count(.not. (least > 0 .or. most < 0))
    end do
    if (census%n_bad > 0) then
      call report_degenerate(x, block, census, error)
    else if (census%n_up > 0 .and. census%n_down > 0) then
      call report_mixture(x, block, census, error)
    else if (census%n_down > 0) then
      do b = 1, size(block)
        block(b)%node = block(b)%node(mirror_order(block(b)%kind), :)
      end do
    end if
  end subroutine orient_elements

  !> Least and largest jacobian of each element of a block.
  subroutine measure(x, block, least, most)
    real(dp), intent(in) :: x(:, :)
    type(element_block_t), intent(in) :: block
    real(dp), allocatable, intent(out) :: least(:), most(:)
    allocate (least(size(block%tag)), most(size(block%tag)))
    call jacobian_range(block%kind, size(block%tag), block%node, size(x, 1), size(x, 2), x, least, most)
  end subroutine measure

  !> Some elements are degenerate: name the worst.
  subroutine report_degenerate(x, block, census, error)
    real(dp), intent(in) :: x(:, :)
    type(element_block_t), intent(in) :: block(:)
    type(census_t), intent(in) :: census
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: least(:), most(:), middle(:)
    real(dp) :: badness, worst, range(2)
    character(:), allocatable :: advice
    integer :: b, e, place(2), n
    type(element_kind_t) :: kind
    worst = -1
    place = 0
    range = 0
    do b = 1, size(block)
      call measure(x, block(b), least, most)
      do e = 1, size(least)
        if (least(e) > 0 .or. most(e) < 0) cycle
        ! How far the jacobian reaches to the wrong side, relative to the right one: 0 .. 1; no element, 1.
        badness = 1
        if (most(e) > least(e)) badness = min(-least(e), most(e))/max(-least(e), most(e))
        if (badness <= worst) cycle
        worst = badness
        place = [b, e]
        range = [least(e), most(e)]
      end do
    end do
    if (census%n_down > census%n_up) range = -range([2, 1])
    kind = element_kind(block(place(1))%kind)
    n = kind%n_corners
    middle = sum(x(:, block(place(1))%node(:n, place(2))), dim=2)/n
    advice = ''
    if (kind%order > 1) advice = '; gmsh mends quadratic elements with Mesh.HighOrderOptimize = 2;'
    call set_error(error, 'element '//to_text(block(place(1))%tag(place(2)))//' ('//trim(kind%name)//') near ' &
      //place_text(middle)//' is degenerate: its jacobian determinant goes from '//to_text(range(1))//' to ' &
      //to_text(range(2))//' ('//counted(census%n_bad, 'such element')//'): refine the mesh there'//advice, &
      exit_not_solvable)
  end subroutine report_degenerate

  !> Some elements are inverted, some are not: name those of the smaller party.
  subroutine report_mixture(x, block, census, error)
    real(dp), intent(in) :: x(:, :)
    type(element_block_t), intent(in) :: block(:)
    type(census_t), intent(in) :: census
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: least(:), most(:)
    character(:), allocatable :: tags, hint
    logical :: down
    integer :: b, e, n
    down = census%n_down <= census%n_up
    n = 0
    tags = ''
    do b = 1, size(block)
      call measure(x, block(b), least, most)
      do e = 1, size(least)
        if (down .neqv. most(e) < 0) cycle
        n = n + 1
        if (n <= most_listed) tags = tags//trim(merge(', ', '  ', n > 1))//' '//to_text(block(b)%tag(e))
      end do
    end do
    if (n > most_listed) tags = tags//', ...'
    hint = ''
    if (size(x, 1) == 2) hint = ' (gmsh turns surfaces with `ReverseMesh Surface {...};`)'
    call set_error(error, to_text(n)//' of '//to_text(census%n_up + census%n_down)//' elements are inverted against ' &
      //'the others (their volumes have the other sign):'//tags//hint, exit_not_solvable)
  end subroutine report_mixture

  !> A number and a noun.
  pure function counted(n, noun) result(text)
    integer, intent(in) :: n
    character(*), intent(in) :: noun
    character(:), allocatable :: text
    text = to_text(n)//' '//noun
    if (n /= 1) text = text//'s'
  end function counted

  !> Coordinates for messages.
  pure function place_text(x) result(text)
    real(dp), intent(in) :: x(:)
    character(:), allocatable :: text
    integer :: k
    text = '('//to_text(x(1))
    do k = 2, size(x)
      text = text//', '//to_text(x(k))
    end do
    text = text//')'
  end function place_text
end module dotyk_mesh_mesh_check
