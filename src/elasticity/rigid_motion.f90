!> Rigid body modes that the supports of a body leave free: null space of the held unknowns, and descriptions for
!> messages.
!>
!> A rigid motion is a translation and a rotation times the radius of the component, both about its centre: six
!> numbers of one unit.
module dotyk_elasticity_rigid_motion
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_3d, analysis_axisymmetric
  use dotyk_base_text, only: point_text, to_text
  use dotyk_base_thresholds, only: same_number, same_place
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_foundation, only: foundation_points_t
  use dotyk_elasticity_part_sums, only: add_up_parts, gather_rows, greatest_of_parts
  use dotyk_elasticity_vector_field, only: vector_text
  use dotyk_linalg_dense, only: right_singular_vectors
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: rigid_null_space, describe_rigid_motions, first_node, component_text, rigid_displacement, free_rigid_modes

  !> Rotations and translations of a normalized motion below this are rounding errors of the null space.
  real(dp), parameter :: negligible = 1.0e-5_dp
  !> A single rotation about an axis farther from the centre than this many radii is described as a translation.
  real(dp), parameter :: far_axis = 10

  !> An axis of a rotation passes through a component if it is no farther from its centre than this fraction of the
  !> radius [].
  real(dp), parameter :: off_centre = 0.1_dp

contains

  !> Number and description of the free rigid body modes of all connected components of a body. All ranks ask together
  !> for a body in parts.
  subroutine find_free_rigid_modes(mesh, analysis, constraint, n_free, text)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    integer, intent(out) :: n_free  !! Number of independent free modes.
    !> Description, as in "translation along (0, 0, 1) and rotation about the axis (0, 1, 0) through (1, 0, 0)"; empty
    !> for none.
    character(:), allocatable, intent(out) :: text
    integer, allocatable :: component(:)
    character(:), allocatable :: motions
    real(dp) :: free(6, 6), centre(3), radius, x(mesh%dimension)
    integer(int64) :: tag
    integer :: p, n_components, n
    allocate (component(mesh%n_nodes()))
    call connected_components(mesh, component, n_components)
    n_free = 0
    text = ''
    do p = 1, n_components
      call rigid_null_space(mesh, analysis, constraint, component, p, centre, radius, free, n)
      if (n == 0) cycle
      n_free = n_free + n
      call describe_rigid_motions(analysis, free(:, :n), centre, radius, motions)
      if (len(text) > 0) text = text//'; '
      call first_node(mesh, component, p, tag, x)
      text = text//component_text(p, n_components, tag, x)//motions
    end do
  end subroutine find_free_rigid_modes

  !> The first node of a connected component in the order of the whole body.
  subroutine first_node(mesh, component, p, tag, x)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    integer, intent(in) :: p  !! Index of the component.
    integer(int64), intent(out) :: tag  !! Tag of the node in the file.
    real(dp), intent(out) :: x(:)  !! Its coordinates (dim) [length].
    integer, parameter :: half = 32  !! Tags go in two halves: not all 64-bit integers are real numbers.
    real(dp) :: earliest(1), found(2 + size(x)), number
    integer :: i
    if (.not. mesh%is_in_parts()) then
      i = findloc(component, p, 1)
      tag = mesh%node_tag(i)
      x = mesh%x(:, i)
      return
    end if
    i = findloc(component == p .and. mesh%whole%own_node, .true., 1)
    number = huge(1.0_dp)
    if (i > 0) number = mesh%whole%node(i)
    earliest = -number
    call greatest_of_parts(mesh, earliest)
    found = 0
    if (i > 0 .and. .not. number > -earliest(1)) then
      found(1) = real(shiftr(mesh%node_tag(i), half), dp)
      found(2) = real(iand(mesh%node_tag(i), maskr(half, int64)), dp)
      found(3:) = mesh%x(:, i)
    end if
    call add_up_parts(mesh, found)
    tag = ior(shiftl(int(found(1), int64), half), int(found(2), int64))
    x = found(3:)
  end subroutine first_node

  !> Text in front of the modes of a connected component; empty where the body has only one.
  function component_text(p, n_components, tag, x) result(text)
    integer, intent(in) :: p  !! Index of the component.
    integer, intent(in) :: n_components  !! Number of connected components.
    integer(int64), intent(in) :: tag  !! Tag of its first node in the file.
    real(dp), intent(in) :: x(:)  !! Coordinates of this node (dim) [length].
    character(:), allocatable :: text
    text = ''
    if (n_components == 1) return
    text = 'connected component '//to_text(p)//' of '//to_text(n_components)//' (node '// &
           to_text(tag)//' at '//point_text(x)//'): '
  end function component_text

  !> Displacement of a point in a rigid motion (dim) [unit of the motion].
  pure function rigid_displacement(motion, centre, radius, x) result(u)
    real(dp), intent(in) :: motion(6)  !! Translation, and rotation times the radius, about the centre (6) [any].
    real(dp), intent(in) :: centre(3)  !! Centre of the component (3) [length].
    real(dp), intent(in) :: radius  !! Radius of the component [length].
    real(dp), intent(in) :: x(:)  !! The point, two or three coordinates (dim) [length].
    real(dp) :: u(size(x)), arm(3), moved(3)
    arm = 0
    arm(:size(x)) = (x - centre(:size(x)))/radius
    moved = motion(1:3) + cross(motion(4:6), arm)
    u = moved(:size(x))
  end function rigid_displacement

  !> Rigid motions of a connected component that leave its held unknowns at rest. All ranks ask together for a body in
  !> parts.
  subroutine rigid_null_space(mesh, analysis, constraint, component, p, centre, radius, free, n)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    integer, intent(in) :: p  !! Index of the component.
    real(dp), intent(out) :: centre(3)  !! Centre of its bounding box; the origin in axisymmetric analyses (3) [length].
    real(dp), intent(out) :: radius  !! Half of the diagonal of this box [length].
    real(dp), intent(out) :: free(6, 6)  !! Orthonormal rigid body modes in the first n columns (6, 6) [].
    integer, intent(out) :: n  !! Number of rigid body modes that the supports leave.
    type(error_t), allocatable :: error
    real(dp), allocatable :: held_displacement(:, :)
    real(dp) :: values(6), vectors(6, 6), low(3), high(3), limits(6), row(6), axis(3), arm(3), least
    integer, allocatable :: exists(:)
    integer :: i, k, j, dim, m
    dim = mesh%dimension
    low = huge(1.0_dp)
    high = -huge(1.0_dp)
    if (dim == 2) low(3) = 0
    if (dim == 2) high(3) = 0
    do i = 1, size(component)
      if (component(i) /= p) cycle
      low(:dim) = min(low(:dim), mesh%x(:, i))
      high(:dim) = max(high(:dim), mesh%x(:, i))
    end do
    ! All ranks have the surface; should a node stick out of it, they still agree.
    limits = [-low, high]
    call greatest_of_parts(mesh, limits)
    low = -limits(:3)
    high = limits(4:)
    centre = 0.5_dp*(low + high)
    radius = 0.5_dp*norm2(high - low)
    if (analysis == analysis_3d) then
      exists = [1, 2, 3, 4, 5, 6]
    else if (analysis == analysis_axisymmetric) then
      exists = [2]
      centre = 0
    else
      exists = [1, 2, 6]
    end if
    if (constraint%rigid%is_set) then
      call constraint%rigid%free_motions(centre, radius, exists, free, n)
      return
    end if
    ! One row per held unknown: its displacement in each motion. Normal equations would lose half of the digits.
    allocate (held_displacement(count(constraint%equation == 0), size(exists)))
    m = 0
    do i = 1, size(component)
      if (component(i) /= p .or. .not. mesh%is_own_node(i)) cycle
      do k = 1, dim
        if (constraint%equation(k, i) > 0) cycle
        axis = 0
        if (constraint%frame_of(i) > 0) then
          axis(:dim) = constraint%frame(:, k, constraint%frame_of(i))
        else
          axis(k) = 1
        end if
        arm = 0
        arm(:dim) = mesh%x(:, i)
        arm = (arm - centre)/radius
        row = [axis, cross(arm, axis)]
        m = m + 1
        held_displacement(m, :) = row(exists)
      end do
    end do
    held_displacement = held_displacement(:m, :)
    call add_springs(mesh, analysis, constraint, component, p, centre, radius, exists, held_displacement)
    call gather_rows(mesh, held_displacement)
    least = same_place*sqrt(1 + sum(held_displacement**2))
    n = 0
    free = 0
    call right_singular_vectors(held_displacement, values(:size(exists)), vectors(:size(exists), :size(exists)), error)
    if (allocated(error)) return
    do j = size(exists), 1, -1
      if (values(j) > least) cycle
      n = n + 1
      free(exists, n) = vectors(:size(exists), j)
    end do
  end subroutine rigid_null_space

  !> Add a row for each direction of a spring, at each of its points.
  subroutine add_springs(mesh, analysis, constraint, component, p, centre, radius, exists, row)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(constraint_t), intent(in) :: constraint  !! With the springs of the body.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    integer, intent(in) :: p  !! Index of the component.
    real(dp), intent(in) :: centre(3)  !! Centre of the component (3) [length].
    real(dp), intent(in) :: radius  !! Radius of the component [length].
    integer, intent(in) :: exists(:)  !! Motions that exist in the analysis (n).
    real(dp), allocatable, intent(inout) :: row(:, :)  !! Displacements in each motion, added to (n_rows, n) [].
    type(foundation_points_t) :: points
    real(dp), allocatable :: more(:, :)
    real(dp) :: axis(3), arm(3), all(6)
    integer :: f, i, m, pass, q
    if (constraint%foundation%n == 0) return
    do pass = 1, 2
      m = size(row, 1)
      do f = 1, constraint%foundation%n
        if (component(constraint%foundation%node(1, f)) /= p) cycle
        call constraint%foundation%points_of(mesh%x, analysis, f, points)
        do q = 1, size(points%weight)
          arm = 0
          arm(:mesh%dimension) = (points%x(:, q) - centre(:mesh%dimension))/radius
          do i = 1, points%n_directions
            m = m + 1
            if (pass == 1) cycle
            axis = 0
            axis(:mesh%dimension) = points%direction(:, i, q)
            all = [axis, cross(arm, axis)]
            more(m, :) = all(exists)
          end do
        end do
      end do
      if (pass == 1) allocate (more(m, size(row, 2)))
      more(:size(row, 1), :) = row
    end do
    call move_alloc(more, row)
  end subroutine add_springs

  !> Describe a space of rigid motions.
  subroutine describe_rigid_motions(analysis, free, centre, radius, text, on_contact)
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: free(:, :)  !! Independent motions (6, n) [].
    real(dp), intent(in) :: centre(3)  !! Centre of the component (3) [length].
    real(dp), intent(in) :: radius  !! Radius of the component [length].
    character(:), allocatable, intent(out) :: text  !! Description.
    !> Whether the words are sliding, spin about an axis through the component, and rocking about another one.
    logical, intent(in), optional :: on_contact
    character(:), allocatable :: sliding
    logical :: on_others
    real(dp) :: motion(6, size(free, 2)), axis(3), shift(3), along(3), through(3)
    integer :: n, j, dim, n_rotations, i
    n = size(free, 2)
    dim = merge(3, 2, analysis == analysis_3d)
    motion = free
    ! Columns in echelon form, rotation components first: the columns without rotation are translations.
    call echelon(motion, [4, 5, 6, 1, 2, 3])
    n_rotations = 0
    do j = 1, n
      if (norm2(motion(4:6, j)) > negligible) n_rotations = n_rotations + 1
    end do
    call remove_translations(motion, n_rotations)
    on_others = .false.
    if (present(on_contact)) on_others = on_contact
    sliding = trim(merge('sliding    ', 'translation', on_others))//' along '
    text = ''
    do i = 1, n
      ! Translations are described first.
      j = mod(i - 1 + n_rotations, n) + 1
      if (i > 1) text = text//merge(' and ', ',    ', i == n)
      if (i > 1 .and. i < n) text = trim(text)//' '
      if (j > n_rotations) then
        text = text//sliding//direction_text(motion(:dim, j))
      else
        axis = motion(4:6, j)/norm2(motion(4:6, j))
        shift = motion(1:3, j)*radius/norm2(motion(4:6, j))
        along = dot_product(shift, axis)*axis
        through = centre + cross(axis, shift)
        if (norm2(shift) > far_axis*radius) then
          ! An axis far away, or a screw of such a pitch, is a translation with a slight rotation.
          text = text//sliding//direction_text(motion(:dim, j))//' with a slight rotation'
          cycle
        end if
        if (dim == 2) then
          text = text//rotation()//' about '//vector_text(through(:2), radius)
        else
          if (norm2(along) > merge(off_centre, same_place, on_others)*radius) then
            text = text//'translation by '//to_text(dot_product(shift, axis), 4)//' per radian of rotation'
          else
            text = text//rotation()
          end if
          text = text//' about the axis '//direction_text(axis)//' through '//vector_text(through, radius)
        end if
      end if
    end do
  contains
    !> What the rotation is called.
    function rotation() result(name)
      character(:), allocatable :: name
      name = 'rotation'
      if (on_others) name = trim(merge('spin   ', 'rocking', norm2(shift - along) <= off_centre*radius))
    end function rotation
  end subroutine describe_rigid_motions

  !> Gauss-Jordan elimination of the columns of a matrix, with the rows in a given order and the largest pivot first
  !> in each row.
  pure subroutine echelon(motion, rows)
    real(dp), intent(inout) :: motion(:, :)  !! Motions as columns; in echelon form on return (6, n) [].
    integer, intent(in) :: rows(:)  !! Order of the rows (6).
    real(dp) :: column(size(motion, 1))
    integer :: r, j, k, next
    next = 1
    do r = 1, size(rows)
      if (next > size(motion, 2)) exit
      k = next - 1 + maxloc(abs(motion(rows(r), next:)), 1)
      if (abs(motion(rows(r), k)) < negligible) then
        motion(rows(r), next:) = 0
        cycle
      end if
      column = motion(:, k)/motion(rows(r), k)
      motion(:, k) = motion(:, next)
      motion(:, next) = column
      do j = 1, size(motion, 2)
        if (j /= next) motion(:, j) = motion(:, j) - motion(rows(r), j)*column
      end do
      next = next + 1
    end do
  end subroutine echelon

  !> Subtract free translations from rotations, so that their axes pass as near to the centre as possible.
  pure subroutine remove_translations(motion, n_rotations)
    real(dp), intent(inout) :: motion(:, :)  !! Motions as columns (6, n) [].
    integer, intent(in) :: n_rotations  !! Number of rotations, the first columns; the others are translations.
    real(dp) :: q(3, 3)
    integer :: i, j, n
    n = 0
    do j = n_rotations + 1, size(motion, 2)
      n = n + 1
      q(:, n) = motion(1:3, j)
      do i = 1, n - 1
        q(:, n) = q(:, n) - dot_product(q(:, i), q(:, n))*q(:, i)
      end do
      q(:, n) = q(:, n)/norm2(q(:, n))
    end do
    do j = 1, n_rotations
      do i = 1, n
        motion(1:3, j) = motion(1:3, j) - dot_product(q(:, i), motion(1:3, j))*q(:, i)
      end do
    end do
  end subroutine remove_translations

  !> A direction as a unit vector for messages, along a global axis rather than against it.
  pure function direction_text(vector) result(text)
    real(dp), intent(in) :: vector(:)  !! The direction (dim) [any].
    character(:), allocatable :: text
    real(dp) :: unit(size(vector))
    unit = vector/norm2(vector)
    where (abs(unit) < negligible) unit = 0
    if (maxval(unit) < maxval(abs(unit))*(1 - same_number)) unit = -unit
    text = vector_text(unit, 1.0_dp)
  end function direction_text

  !> Number and description of the rigid body modes that the supports of a body leave free.
  subroutine free_rigid_modes(body, n_free, text)
    type(body_t), intent(in) :: body  !! The body; it need not be assembled.
    integer, intent(out) :: n_free  !! Number of independent modes, summed over the connected components of the body.
    character(:), allocatable, intent(out) :: text  !! Description of the modes; empty for none.
    call find_free_rigid_modes(body%mesh, body%analysis, body%constraint, n_free, text)
  end subroutine free_rigid_modes
end module dotyk_elasticity_rigid_motion
