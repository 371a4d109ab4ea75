!> Orientation of the elements of a body: a mesh whose elements all are inverted is reversed; some of both signs, and
!> degenerate elements, are refused.
module dotyk_mesh_element_orientation
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: counted, to_text
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_jacobian, only: jacobian_range, mirror_order
  use dotyk_mesh_mesh, only: element_block_t
  use dotyk_mesh_mesh_check, only: position_text
  implicit none
  private
  public :: orient_elements

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

contains

  !> Reverse all elements if all volumes are negative; refuse a mixture, and elements whose Jacobian determinant
  !> vanishes or changes its sign.
  subroutine orient_elements(x, block, error)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dimension, n_nodes) [length].
    !> Elements (n_blocks); the nodes of all are permuted if all are inverted.
    type(element_block_t), intent(inout) :: block(:)
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
    !> Allocated on return: names the worst element and the number of degenerate ones.
    type(error_t), allocatable, intent(out) :: error
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
    !> Allocated on return: names the elements of the rarer orientation.
    type(error_t), allocatable, intent(out) :: error
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
end module dotyk_mesh_element_orientation
