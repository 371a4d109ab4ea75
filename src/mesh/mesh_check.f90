!> Checks of the mesh of one body: range of coordinates, nodes off the plane, repeated elements; and the
!> orientation of its elements by the signs of their Jacobian determinants: a mesh whose elements all are inverted is
!> reversed; some of both signs, and degenerate elements, are refused.
module dotyk_mesh_mesh_check
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: is_too_large, size_rule, smallest_number
  use dotyk_base_text, only: counted, to_text
  use dotyk_base_thresholds, only: few_roundings, same_number
  use dotyk_mesh_element, only: element_hex8, element_kind, element_kind_t, element_prism6, element_pyramid5, &
    element_quad4, kind_dimension, kind_nodes, max_element_nodes, quadrature_rule, reference_nodes, shape_gradients
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: check_size, check_plane, check_repeated_elements, orient_elements, jacobian_range, mirror_order

  integer, parameter :: max_listed = 10  !! Greatest number of tags in a message.

  type :: element_sign_t  !! Elements of one sign of the Jacobian determinant.
    integer(int64) :: n = 0  !! Number of elements.
    integer(int64), allocatable :: tag(:)  !! Tags of the first of them (0 .. max_listed).
  end type element_sign_t

  type :: orientation_census_t  !! Elements by the sign of their Jacobian determinant.
    type(element_sign_t) :: positive, negative  !! Elements of positive volume, and of negative volume.
    integer(int64) :: n_degenerate = 0  !! Number of other elements.
    !> How bad the worst of them is: the ratio of the determinant of the wrong sign to that of the right one, 1 for an
    !> element that vanishes; negative where there is none.
    real(dp) :: badness = -1
    integer(int64) :: worst_tag = 0, worst_kind = 0  !! Its tag and kind.
    real(dp) :: range(2) = 0  !! Its least and greatest determinant [length^dimension].
    real(dp) :: middle(3) = 0  !! Mean of its corners (3) [length].
  contains
    procedure :: find => census_find
  end type orientation_census_t

  integer, parameter :: min_parallel = 1000  !! Loops over fewer elements are faster on one thread.

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

  !> Reverse all elements if all volumes are negative; refuse a mixture, and elements whose Jacobian determinant
  !> vanishes or changes its sign.
  subroutine orient_elements(x, block, error)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dimension, n_nodes) [length].
    type(element_block_t), intent(inout) :: block(:)  !! Elements (n_blocks); nodes permuted if all are inverted.
    !> Set, with the exit code `exit_not_solvable`, for a mixture of orientations and for degenerate elements.
    type(error_t), allocatable, intent(out) :: error
    type(orientation_census_t) :: census
    call census%find(x, block)
    call refuse_orientations(census, size(x, 1), error)
    if (census%negative%n > 0 .and. .not. allocated(error)) call reverse_elements(block)
  end subroutine orient_elements

  !> Reverse all elements.
  subroutine reverse_elements(block)
    type(element_block_t), intent(inout) :: block(:)  !! Elements (n_blocks); their nodes are permuted.
    integer :: b
    do b = 1, size(block)
      block(b)%node = block(b)%node(mirror_order(block(b)%kind), :)
    end do
  end subroutine reverse_elements

  !> Count elements by their signs.
  subroutine census_find(self, x, block)
    class(orientation_census_t), intent(out) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dimension, n_nodes) [length].
    type(element_block_t), intent(in) :: block(:)  !! Elements (n_blocks).
    type(element_kind_t) :: kind
    real(dp), allocatable :: smallest(:), largest(:)
    real(dp) :: badness
    integer :: b, e
    allocate (self%positive%tag(0), self%negative%tag(0))
    do b = 1, size(block)
      kind = element_kind(block(b)%kind)
      allocate (smallest(size(block(b)%tag)), largest(size(block(b)%tag)))
      call jacobian_range(block(b)%kind, size(smallest), block(b)%node, size(x, 1), size(x, 2), x, smallest, largest)
      do e = 1, size(smallest)
        if (smallest(e) > 0) then
          call count_element(self%positive, block(b)%tag(e))
        else if (largest(e) < 0) then
          call count_element(self%negative, block(b)%tag(e))
        else
          self%n_degenerate = self%n_degenerate + 1
          badness = 1
          if (largest(e) > smallest(e)) badness = min(-smallest(e), largest(e))/max(-smallest(e), largest(e))
          if (badness <= self%badness) cycle
          self%badness = badness
          self%worst_tag = block(b)%tag(e)
          self%worst_kind = block(b)%kind
          self%range = [smallest(e), largest(e)]
          self%middle(:size(x, 1)) = sum(x(:, block(b)%node(:kind%n_corners, e)), dim=2)/kind%n_corners
        end if
      end do
      deallocate (smallest, largest)
    end do
  end subroutine census_find

  !> Count an element, and keep its tag where it is one of the first.
  subroutine count_element(elements, tag)
    type(element_sign_t), intent(inout) :: elements  !! Elements of the sign; updated.
    integer(int64), intent(in) :: tag  !! Tag of the element.
    elements%n = elements%n + 1
    if (elements%n > max_listed) return
    elements%tag = [elements%tag, tag]
  end subroutine count_element

  !> Refuse degenerate elements, and a mixture of orientations.
  subroutine refuse_orientations(census, dimension, error)
    type(orientation_census_t), intent(in) :: census  !! Census of the whole body.
    integer, intent(in) :: dimension  !! Dimension of space.
    !> Set, with the exit code `exit_not_solvable`, for a mixture of orientations and for degenerate elements.
    type(error_t), allocatable, intent(out) :: error
    if (census%n_degenerate > 0) then
      call report_degenerate(census, dimension, error)
    else if (census%positive%n > 0 .and. census%negative%n > 0) then
      call report_mixture(census, dimension, error)
    end if
  end subroutine refuse_orientations

  !> Error for degenerate elements, which names the worst.
  subroutine report_degenerate(census, dimension, error)
    type(orientation_census_t), intent(in) :: census  !! Census of the whole body.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(error_t), allocatable, intent(out) :: error  !! Names the worst element and the number of degenerate ones.
    type(element_kind_t) :: kind
    real(dp) :: range(2)
    character(:), allocatable :: advice
    range = census%range
    if (census%negative%n > census%positive%n) range = -range([2, 1])
    kind = element_kind(int(census%worst_kind))
    advice = ''
    if (kind%order > 1) advice = ', as gmsh does at curved faces with Mesh.MeshSizeFromCurvature = 16'
    call set_error(error, 'element '//to_text(census%worst_tag)//' ('//trim(kind%name)//') near '// &
                   position_text(census%middle(:dimension))//' is degenerate: its Jacobian determinant ranges from '// &
                   to_text(range(1))//' to '//to_text(range(2))//' ('// &
                   counted(int(census%n_degenerate), 'such element')//'): refine the mesh there'//advice, &
                   exit_not_solvable)
  end subroutine report_degenerate

  !> Error for a mixture of orientations, which names the elements of the minority.
  subroutine report_mixture(census, dimension, error)
    type(orientation_census_t), intent(in) :: census  !! Census of the whole body.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(error_t), allocatable, intent(out) :: error  !! Names the elements of the rarer orientation.
    type(element_sign_t) :: rare
    character(:), allocatable :: tags, hint
    integer :: i
    rare = census%positive
    if (census%negative%n <= census%positive%n) rare = census%negative
    tags = ''
    do i = 1, size(rare%tag)
      tags = tags//trim(merge(', ', '  ', i > 1))//' '//to_text(rare%tag(i))
    end do
    if (rare%n > max_listed) tags = tags//', ...'
    hint = ''
    if (dimension == 2) hint = ' (gmsh reverses surfaces with `ReverseMesh Surface {...};`)'
    call set_error(error, to_text(rare%n)//' of '//to_text(census%positive%n + census%negative%n)// &
                   ' elements are inverted against the others (their volumes have the other sign):'//tags//hint, &
                   exit_not_solvable)
  end subroutine report_mixture

  !> Smallest and largest Jacobian determinant of each element, over the quadrature points and nodes.
  !>
  !> For elements that are affine images of the reference domain one point suffices.
  subroutine jacobian_range(kind, n, node, d, n_nodes, x, smallest, largest)
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: n  !! Number of elements.
    integer, intent(in) :: node(kind_nodes(kind), n)  !! Nodes of the elements (kind_nodes(kind), n).
    integer, intent(in) :: d  !! Dimension of space and of the kind.
    integer, intent(in) :: n_nodes  !! Number of nodes.
    real(dp), intent(in) :: x(d, n_nodes)  !! Nodal coordinates (d, n_nodes) [length].
    real(dp), intent(out) :: smallest(n)  !! Smallest determinant; 0 where it is round-off (n) [length^d].
    real(dp), intent(out) :: largest(n)  !! Largest determinant, likewise (n) [length^d].
    type(element_kind_t) :: info
    real(dp), allocatable :: gradient(:, :, :), barycentric(:, :)
    real(dp) :: xe(3, max_element_nodes), det, diameter
    integer :: e, p, m, nn, nc, base(4)
    info = element_kind(kind)
    nn = info%n_nodes
    nc = info%n_corners
    call sampling(info, kind, gradient, base, barycentric)
    !$omp parallel do default(none) schedule(static) if (n > min_parallel) private(e, p, m, xe, det, diameter) &
    !$omp shared(n, nn, nc, d, node, x, smallest, largest, gradient, barycentric, base)
    do e = 1, n
      xe(3, :nn) = 0
      do p = 1, nn
        xe(:d, p) = x(:, node(p, e))
      end do
      diameter = 0
      do p = 2, nc
        diameter = max(diameter, sum((xe(:, p) - xe(:, 1))**2))
      end do
      diameter = sqrt(diameter)
      m = size(gradient, 3)
      if (is_affine(nn, xe, base, barycentric, same_number*diameter)) m = 1
      smallest(e) = huge(det)
      largest(e) = -huge(det)
      do p = 1, m
        det = determinant(d, nn, xe, gradient(:, :, p))
        if (abs(det) <= few_roundings*diameter**d) det = 0
        smallest(e) = min(smallest(e), det)
        largest(e) = max(largest(e), det)
      end do
    end do
    !$omp end parallel do
  end subroutine jacobian_range

  !> Gradients at the points where the determinant is evaluated, and the affine image of the reference domain.
  subroutine sampling(info, kind, gradient, base, barycentric)
    type(element_kind_t), intent(in) :: info  !! Properties of the element kind.
    integer, intent(in) :: kind  !! Element kind.
    !> Gradients at quadrature points, then at nodes, 0 beyond the dimension (3, n_nodes, n_points) [].
    real(dp), allocatable, intent(out) :: gradient(:, :, :)
    integer, intent(out) :: base(4)  !! Corners that span the affine image (4); the last is 1 in two dimensions.
    !> Weights of these corners in the position of each node (4, n_nodes) [].
    real(dp), allocatable, intent(out) :: barycentric(:, :)
    real(dp), allocatable :: points(:, :), weights(:)
    real(dp) :: nodes(info%dimension, info%n_nodes)
    integer :: i, m, d
    d = info%dimension
    call quadrature_rule(kind, 2*info%order, points, weights)
    call reference_nodes(kind, nodes)
    m = size(weights)
    allocate (gradient(3, info%n_nodes, m + info%n_nodes), barycentric(4, info%n_nodes))
    gradient = 0
    do i = 1, m
      call gradients_at(points(:, i), gradient(:d, :, i))
    end do
    do i = 1, info%n_nodes
      call gradients_at(nodes(:, i), gradient(:d, :, m + i))
    end do
    ! Coordinates from 0 to 1 along the edges from corner 1.
    barycentric = 0
    barycentric(2:d + 1, :) = nodes
    select case (info%corner_kind)
    case (element_quad4, element_hex8)
      base = [1, 2, 4, 5]
      barycentric(2:d + 1, :) = 0.5_dp*(1 + nodes)
    case (element_prism6)
      base = [1, 2, 3, 4]
      barycentric(4, :) = 0.5_dp*(1 + nodes(3, :))
    case (element_pyramid5)
      base = [1, 2, 4, 5]
      barycentric(2, :) = 0.5_dp*(1 + nodes(1, :) - nodes(3, :))
      barycentric(3, :) = 0.5_dp*(1 + nodes(2, :) - nodes(3, :))
    case default
      base = [1, 2, 3, 4]
    end select
    if (d == 2) base(4) = 1
    barycentric(1, :) = 1 - sum(barycentric(2:, :), dim=1)

  contains

    !> Gradients of the shape functions at a point.
    subroutine gradients_at(xi, values)
      real(dp), intent(in) :: xi(:)  !! Reference coordinates (dimension) [].
      real(dp), intent(out) :: values(:, :)  !! Gradients (dimension, n_nodes) [].
      real(dp) :: found(info%dimension, info%n_nodes)
      call shape_gradients(kind, xi, found)
      values = found
    end subroutine gradients_at
  end subroutine sampling

  !> Whether all nodes are at their positions under an affine map of the reference domain.
  pure logical function is_affine(nn, xe, base, barycentric, tolerance)
    integer, intent(in) :: nn  !! Number of nodes.
    integer, intent(in) :: base(4)  !! Corners that span the affine image (4).
    real(dp), intent(in) :: xe(3, nn)  !! Nodal coordinates (3, nn) [length].
    real(dp), intent(in) :: barycentric(4, nn)  !! Weights of these corners (4, nn) [].
    real(dp), intent(in) :: tolerance  !! Greatest deviation [length].
    real(dp) :: corner(3, 4), deviation(3)
    integer :: i, k
    is_affine = .false.
    do k = 1, 4
      corner(:, k) = xe(:, base(k))
    end do
    do i = 1, nn
      deviation = -xe(:, i)
      do k = 1, 4
        deviation = deviation + barycentric(k, i)*corner(:, k)
      end do
      if (any(abs(deviation) > tolerance)) return
    end do
    is_affine = .true.
  end function is_affine

  !> Jacobian determinant [length^d].
  pure real(dp) function determinant(d, nn, xe, gradient) result(det)
    integer, intent(in) :: d  !! Dimension.
    integer, intent(in) :: nn  !! Number of nodes.
    real(dp), intent(in) :: xe(3, nn)  !! Nodal coordinates, the third 0 in two dimensions (3, nn) [length].
    real(dp), intent(in) :: gradient(3, nn)  !! Gradients of the shape functions, likewise (3, nn) [].
    real(dp) :: a(3), b(3), c(3)
    integer :: i
    a = 0
    b = 0
    c = 0
    do i = 1, nn
      a = a + xe(:, i)*gradient(1, i)
      b = b + xe(:, i)*gradient(2, i)
      c = c + xe(:, i)*gradient(3, i)
    end do
    if (d == 2) c(3) = 1
    det = a(1)*(b(2)*c(3) - b(3)*c(2)) + a(2)*(b(3)*c(1) - b(1)*c(3)) + a(3)*(b(1)*c(2) - b(2)*c(1))
  end function determinant

  !> Node order of the mirror image of an element: node i of the image is node order(i).
  !>
  !> Every reference domain of two or three dimensions is symmetric in its first two coordinates: nodes that swap under
  !> the exchange of these coordinates are exchanged.
  pure function mirror_order(kind) result(order)
    integer, intent(in) :: kind  !! Element kind, not a line.
    integer :: order(kind_nodes(kind))  !! Permutation (n_nodes).
    real(dp) :: nodes(kind_dimension(kind), kind_nodes(kind)), image(kind_dimension(kind))
    integer :: i, j
    call reference_nodes(kind, nodes)
    order = 0
    do i = 1, size(order)
      image = nodes(:, i)
      image(:2) = nodes([2, 1], i)
      do j = 1, size(order)
        if (all(abs(nodes(:, j) - image) < 0.1_dp)) order(i) = j
      end do
    end do
  end function mirror_order
end module dotyk_mesh_mesh_check
