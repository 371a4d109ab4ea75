!> Rigid body modes: an orthonormal basis of the rigid motions that the supports of a body leave free, as nodal
!> displacements.
!>
!> The basis is stored as translations and rotations beside the displacements, which are evaluated from these alone:
!> they are rigid to rounding, however thin the body is.
!>
!> Near-null-space vectors of the stiffness of a body, for `dotyk_linalg_smoothed_aggregation`: displacements of rigid
!> bodies, whatever the supports hold.
!>
!> Three translations and three rotations in space, two and one in the plane. Axisymmetric bodies have the same three:
!> away from the axis, on a few elements, radial motions cost little energy, too.
module dotyk_elasticity_rigid_body_modes
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_3d
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_base_thresholds, only: same_number
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_part_sums, only: add_up_parts, own_product
  use dotyk_elasticity_rigid_motion, only: component_text, describe_rigid_motions, first_node, rigid_displacement, &
    rigid_null_space
  use dotyk_linalg_dense, only: least_squares, orthonormal_range
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private
  public :: near_null_vectors

  type, public :: rigid_body_modes_t  !! Free rigid body modes of all connected components of a body.
    integer :: n = 0  !! Number of modes.
    integer, private :: analysis = analysis_3d  !! Type of analysis: one of the `analysis_*` constants.
    integer, allocatable :: component(:)  !! Connected component that each mode moves (n).
    !> Translation, and rotation times the radius of the component, about its centre (6, n) [].
    real(dp), allocatable, private :: coefficient(:, :)
    real(dp), allocatable, private :: centre(:, :)  !! Centre of each component (3, n_components) [length].
    real(dp), allocatable, private :: radius(:)  !! Radius of each component (n_components) [length].
    type(text_t), allocatable, private :: component_name(:)  !! Text before the modes of each component (n_components).
  contains
    procedure :: init => rigid_body_modes_init
    procedure :: move => rigid_body_modes_move
    procedure :: rotate => rigid_body_modes_rotate
    procedure :: amplitudes => rigid_body_modes_amplitudes
    procedure :: translations => rigid_body_modes_translations
    procedure :: combination_text => rigid_body_modes_combination_text
    procedure :: span_text => rigid_body_modes_span_text
    procedure :: carry => rigid_body_modes_carry
  end type rigid_body_modes_t

contains

  !> Find the modes. All ranks find those of a body in parts together.
  subroutine rigid_body_modes_init(self, mesh, analysis, constraint, mode)
    class(rigid_body_modes_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    !> Nodal displacements in global axes, orthonormal in the Euclidean product over nodes and components, exactly
    !> zero along held unknowns (dim, n_nodes, n) [].
    real(dp), allocatable, intent(out) :: mode(:, :, :)
    integer, allocatable :: component(:)
    real(dp), allocatable :: free(:, :, :)
    integer, allocatable :: n_of_component(:)
    integer(int64) :: tag
    real(dp) :: x(mesh%dimension)
    integer :: p, n_components, first
    allocate (component(mesh%n_nodes()))
    call connected_components(mesh, component, n_components)
    self%analysis = analysis
    allocate (self%centre(3, n_components), self%radius(n_components), self%component_name(n_components))
    allocate (free(6, 6, n_components), n_of_component(n_components))
    do p = 1, n_components
      call rigid_null_space(mesh, analysis, constraint, component, p, self%centre(:, p), self%radius(p), &
                            free(:, :, p), n_of_component(p))
      call first_node(mesh, component, p, tag, x)
      ! Texts of allocatable length are made by one thread at a time, see dotyk_base_text.
      !$omp critical (message)
      self%component_name(p)%s = component_text(p, n_components, tag, x)
      !$omp end critical (message)
    end do
    self%n = sum(n_of_component)
    allocate (self%component(self%n), self%coefficient(6, self%n), mode(mesh%dimension, mesh%n_nodes(), self%n))
    first = 1
    do p = 1, n_components
      associate (last => first + n_of_component(p) - 1)
        self%component(first:last) = p
        self%coefficient(:, first:last) = free(:, :n_of_component(p), p)
        call make_orthonormal(mesh, constraint, component, p, self%centre(:, p), self%radius(p), &
                              self%coefficient(:, first:last), mode(:, :, first:last))
        first = last + 1
      end associate
    end do
  end subroutine rigid_body_modes_init

  !> The modes of a congruent body.
  subroutine rigid_body_modes_move(self, mesh, placement)
    class(rigid_body_modes_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the congruent body.
    type(placement_t), intent(in) :: placement  !! Rigid motion from the body of the modes to the congruent one.
    integer, allocatable :: component(:)
    integer(int64) :: tag
    real(dp) :: x(mesh%dimension)
    integer :: p, n_components, k
    do k = 1, self%n
      self%coefficient(1:3, k) = matmul(placement%rotation, self%coefficient(1:3, k))
      self%coefficient(4:6, k) = matmul(placement%rotation, self%coefficient(4:6, k))
    end do
    call placement%apply(self%centre)
    if (size(self%radius) == 1) return
    allocate (component(mesh%n_nodes()))
    call connected_components(mesh, component, n_components)
    do p = 1, n_components
      call first_node(mesh, component, p, tag, x)
      !$omp critical (message)
      self%component_name(p)%s = component_text(p, n_components, tag, x)
      !$omp end critical (message)
    end do
  end subroutine rigid_body_modes_move

  !> Amplitudes of the unit translations of a body in one piece, and translations of its centre by its modes (n, 6) [];
  !> without columns for other bodies.
  function rigid_body_modes_translations(self) result(translation)
    class(rigid_body_modes_t), intent(in) :: self
    real(dp), allocatable :: translation(:, :), amplitude(:, :)
    real(dp) :: motion(6, 3)
    logical :: are_free
    integer :: k
    allocate (translation(self%n, 0))
    if (self%n == 0 .or. size(self%radius) > 1) return
    motion = 0
    do k = 1, 3
      motion(k, k) = 1
    end do
    call self%amplitudes(motion, amplitude, are_free)
    translation = reshape([amplitude(:self%n, :), transpose(self%coefficient(1:3, :))], [self%n, 6])
  end function rigid_body_modes_translations

  !> Take another basis of the modes.
  subroutine rigid_body_modes_rotate(self, basis)
    class(rigid_body_modes_t), intent(inout) :: self
    !> Orthonormal combinations of the modes as columns, none of which mixes connected components (n, n) [].
    real(dp), intent(in) :: basis(:, :)
    real(dp), allocatable :: rotated(:, :)
    integer :: k
    allocate (rotated, source=matmul(self%coefficient, basis))
    call move_alloc(rotated, self%coefficient)
    self%component = [(self%component(maxloc(abs(basis(:, k)), 1)), k=1, self%n)]
  end subroutine rigid_body_modes_rotate

  !> Motions of space as combinations of the modes of a body of one component.
  subroutine rigid_body_modes_amplitudes(self, motion, amplitude, are_free)
    class(rigid_body_modes_t), intent(in) :: self
    real(dp), intent(in) :: motion(:, :)  !! Translation of the origin, and rotation (6, n_motions) [length, radian].
    real(dp), allocatable, intent(out) :: amplitude(:, :)  !! Amplitudes as columns (n, n_motions) [length].
    logical, intent(out) :: are_free  !! Whether the modes of the body have all these motions.
    type(error_t), allocatable :: error
    real(dp) :: about_centre(6, size(motion, 2)), a(6, self%n)
    integer :: k, rank
    about_centre(4:6, :) = motion(4:6, :)*self%radius(1)
    do k = 1, size(motion, 2)
      about_centre(1:3, k) = motion(1:3, k) + cross(motion(4:6, k), self%centre(:, 1))
    end do
    amplitude = about_centre
    a = self%coefficient
    call least_squares(a, amplitude, same_number, rank, error)
    are_free = .not. allocated(error) .and. rank == self%n
    if (.not. are_free) return
    amplitude = amplitude(:self%n, :)
    are_free = all(abs(matmul(self%coefficient, amplitude) - about_centre) <= same_number*maxval(abs(about_centre)))
  end subroutine rigid_body_modes_amplitudes

  !> Orthonormalize the modes of a component by Gram-Schmidt on their coefficients.
  subroutine make_orthonormal(mesh, constraint, component, p, centre, radius, coefficient, mode)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    integer, intent(in) :: p  !! Index of the component.
    real(dp), intent(in) :: centre(3)  !! Centre of the component (3) [length].
    real(dp), intent(in) :: radius  !! Radius of the component [length].
    real(dp), intent(inout) :: coefficient(:, :)  !! Independent motions, orthonormal ones on return (6, n) [].
    real(dp), intent(out) :: mode(:, :, :)  !! Their nodal displacements (dim, n_nodes, n) [].
    real(dp) :: product(size(coefficient, 2)), square(1)
    integer :: j, k, pass
    do j = 1, size(coefficient, 2)
      ! The second pass removes the components that normalization of a short remainder has amplified; the third one
      ! changes nothing but the last digit.
      do pass = 1, 3
        call evaluate(mesh%x, constraint, component, p, centre, radius, coefficient(:, j), mode(:, :, j))
        do k = 1, j - 1
          product(k) = own_product(mesh, mode(:, :, k), mode(:, :, j))
        end do
        if (j > 1) call add_up_parts(mesh, product(:j - 1))
        do k = 1, j - 1
          coefficient(:, j) = coefficient(:, j) - product(k)*coefficient(:, k)
        end do
        call evaluate(mesh%x, constraint, component, p, centre, radius, coefficient(:, j), mode(:, :, j))
        square = own_product(mesh, mode(:, :, j), mode(:, :, j))
        call add_up_parts(mesh, square)
        coefficient(:, j) = coefficient(:, j)/sqrt(square(1))
      end do
      call evaluate(mesh%x, constraint, component, p, centre, radius, coefficient(:, j), mode(:, :, j))
    end do
  end subroutine make_orthonormal

  !> Nodal displacements of a rigid motion of a component; other nodes do not move.
  pure subroutine evaluate(x, constraint, component, p, centre, radius, coefficient, mode)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    integer, intent(in) :: component(:)  !! Connected component of each node (n_nodes).
    integer, intent(in) :: p  !! Index of the component.
    real(dp), intent(in) :: centre(3)  !! Centre of the component (3) [length].
    real(dp), intent(in) :: radius  !! Radius of the component [length].
    real(dp), intent(in) :: coefficient(:)  !! The motion (6) [].
    real(dp), intent(out) :: mode(:, :)  !! Nodal displacements (dim, n_nodes) [].
    real(dp) :: u(size(x, 1))
    integer :: i
    do i = 1, size(x, 2)
      u = 0
      if (component(i) == p) u = rigid_displacement(coefficient, centre, radius, x(:, i))
      if (any(constraint%equation(:, i) == 0) .and. .not. constraint%rigid%is_set) then
        ! Only rounding is set to zero here, but it would be multiplied by large support forces.
        if (constraint%frame_of(i) > 0) u = matmul(u, constraint%frame(:, :, constraint%frame_of(i)))
        where (constraint%equation(:, i) == 0) u = 0
        if (constraint%frame_of(i) > 0) u = matmul(constraint%frame(:, :, constraint%frame_of(i)), u)
      end if
      mode(:, i) = u
    end do
  end subroutine evaluate

  !> Describe a combination of the modes, as in "translation along (0, 0, 1)"; empty for none.
  function rigid_body_modes_combination_text(self, amplitude) result(text)
    class(rigid_body_modes_t), intent(in) :: self
    real(dp), intent(in) :: amplitude(:)  !! Amplitude of each mode (n) [any].
    character(:), allocatable :: text
    character(:), allocatable :: motion
    real(dp) :: combined(6, 1), most
    integer :: p, k
    text = ''
    most = same_number*maxval([0.0_dp, abs(amplitude)])
    do p = 1, size(self%radius)
      combined = 0
      do k = 1, self%n
        if (self%component(k) /= p .or. .not. abs(amplitude(k)) > most) cycle
        combined(:, 1) = combined(:, 1) + amplitude(k)*self%coefficient(:, k)
      end do
      if (.not. maxval(abs(combined)) > 0) cycle
      combined = combined/maxval(abs(combined))
      call describe_rigid_motions(self%analysis, combined, self%centre(:, p), self%radius(p), motion)
      if (len(text) > 0) text = text//'; '
      text = text//self%component_name(p)%s//motion
    end do
  end function rigid_body_modes_combination_text

  !> Describe the span of several combinations of the modes as motions of bodies in contact, as in "sliding along
  !> (1, 0, 0) and spin about the axis (0, 0, 1) through (0, 0, 0)", "any motion" for all; empty for none.
  function rigid_body_modes_span_text(self, amplitude) result(text)
    class(rigid_body_modes_t), intent(in) :: self
    !> Amplitudes of each combination as columns; small columns count as zero (n, n_combinations) [any].
    real(dp), intent(in) :: amplitude(:, :)
    character(:), allocatable :: text
    character(:), allocatable :: motion
    real(dp) :: combined(6, size(amplitude, 2)), projector(6, 6), basis(6, 6), length(6)
    integer :: p, k, j, n, order(6)
    !> Entries and singular values below this fraction of the largest one are errors of the mesh: facets turn axes by
    !> 1e-4 and more.
    real(dp), parameter :: small = 1.0e-2_dp
    text = ''
    do p = 1, size(self%radius)
      combined = 0
      do j = 1, size(amplitude, 2)
        do k = 1, self%n
          if (self%component(k) == p) combined(:, j) = combined(:, j) + amplitude(k, j)*self%coefficient(:, k)
        end do
      end do
      call orthonormal_range(combined, small, basis, n)
      if (n == 0) cycle
      ! The projector, its longest columns first, is the same for any combinations of the same span.
      projector = matmul(basis(:, :n), transpose(basis(:, :n)))
      where (abs(projector) <= small*maxval(abs(projector))) projector = 0
      length = norm2(projector, dim=1)
      do j = 1, 6
        order(j) = maxloc(length, 1)
        length(order(j)) = -1
      end do
      call orthonormal_range(projector(:, order), small, basis(:, :n), n)
      call describe_rigid_motions(self%analysis, basis(:, :n), self%centre(:, p), self%radius(p), motion, &
                                  on_contact=.true.)
      if (n == merge(6, 3, self%analysis == analysis_3d)) motion = 'any motion'
      if (len(text) > 0) text = text//'; '
      text = text//self%component_name(p)%s//motion
    end do
  end function rigid_body_modes_span_text

  !> Put the modes into a parcel, or take them out.
  subroutine rigid_body_modes_carry(self, parcel)
    class(rigid_body_modes_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%n)
    call parcel%carry(self%analysis)
    call parcel%carry(self%component)
    call parcel%carry(self%coefficient)
    call parcel%carry(self%centre)
    call parcel%carry(self%radius)
    call parcel%carry(self%component_name)
  end subroutine rigid_body_modes_carry

  !> The vectors. Rotations are about the middle of the body and scaled by its size.
  subroutine near_null_vectors(x, constraint, vector, box)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates (dim, n_nodes) [length].
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes.
    !> The vectors in nodal axes, zero along held components (dim*n_nodes, n) [].
    real(dp), allocatable, intent(out) :: vector(:, :)
    !> Lower and upper corner of the box that stands for the body, of which these may be a part; that of the nodes if
    !> absent (dim, 2) [length].
    real(dp), intent(in), optional :: box(:, :)
    real(dp) :: middle(size(x, 1)), radius
    integer :: dim
    dim = size(x, 1)
    allocate (vector(size(x), merge(6, 3, dim == 3)))
    if (size(x) == 0) return
    middle = (minval(x, 2) + maxval(x, 2))/2
    radius = maxval(maxval(x, 2) - middle)
    if (present(box)) then
      middle = (box(:, 1) + box(:, 2))/2
      radius = maxval(box(:, 2) - middle)
    end if
    if (.not. radius > 0) radius = 1
    call fill(dim, size(x, 2), size(vector, 2), x, middle, radius, constraint, vector)
  end subroutine near_null_vectors

  !> Fill the vectors node by node.
  subroutine fill(dim, n, m, x, middle, radius, constraint, vector)
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: m  !! Number of vectors.
    real(dp), intent(in) :: x(dim, n)  !! Nodal coordinates (dim, n) [length].
    real(dp), intent(in) :: middle(dim)  !! Center of the rotations (dim) [length].
    real(dp), intent(in) :: radius  !! Size of the body [length].
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes.
    real(dp), intent(out) :: vector(dim, n, m)  !! The vectors (dim, n, m) [].
    real(dp) :: u(dim, m), y(dim)
    integer :: i, k
    !$omp parallel do default(none) shared(dim, n, m, x, middle, radius, constraint, vector) private(u, y, k) &
    !$omp& schedule(static)
    do i = 1, n
      y = (x(:, i) - middle)/radius
      u = 0
      do k = 1, dim
        u(k, k) = 1
      end do
      if (dim == 3) then
        u(:, 4) = [0.0_dp, -y(3), y(2)]
        u(:, 5) = [y(3), 0.0_dp, -y(1)]
        u(:, 6) = [-y(2), y(1), 0.0_dp]
      else
        u(:, 3) = [-y(2), y(1)]
      end if
      if (constraint%frame_of(i) > 0) u = matmul(transpose(constraint%frame(:, :, constraint%frame_of(i))), u)
      do k = 1, dim
        if (constraint%equation(k, i) == held) u(k, :) = 0
        vector(k, i, :) = u(k, :)
      end do
    end do
    !$omp end parallel do
  end subroutine fill
end module dotyk_elasticity_rigid_body_modes
