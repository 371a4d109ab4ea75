!> Modes of a body that its compliance operator leaves to the schemes: rigid body modes that the supports leave free
!> (floating bodies), or near-null-space modes, which the supports hardly resist.
!>
!> Rigid body modes are a basis of the null space of the stiffness. Near-null-space modes come from its factorization,
!> with spring stiffnesses that the scheme adds. A body has modes of one kind.
module dotyk_elasticity_body_modes
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_thresholds, only: given_rounding
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_part_sums, only: add_up_parts, own_product
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  type, public :: body_modes_t  !! The modes of one body.
    integer :: n = 0  !! Number of modes.
    !> Nodal displacements in global axes, zero along prescribed unknowns; rigid body modes are orthonormal in the
    !> Euclidean product over nodes and components (dim, n_nodes, n) [].
    real(dp), allocatable :: shape(:, :, :)
    real(dp), allocatable :: resultant(:)  !! Resultants of the loads on the modes (n) [force].
    !> Spring stiffnesses of near-null-space modes; not allocated for rigid body modes (n, n) [force/length].
    real(dp), allocatable :: stiffness(:, :)
    real(dp), allocatable :: lift_resultant(:)  !! Of prescribed displacements on near-null-space modes (n) [force].
    real(dp), allocatable :: resultant_size(:)  !! Sums of the absolute terms of the resultants (n) [force].
    type(rigid_body_modes_t) :: rigid  !! Rigid body modes as translations and rotations, for messages.
  contains
    procedure :: find => modes_find
    procedure :: move => modes_move
    procedure :: rotate => modes_rotate
    procedure :: take_loads => modes_take_loads
    procedure :: hold_nodes => modes_hold_nodes
    procedure :: carry => modes_carry
    procedure :: components => modes_components
    procedure :: take_near_null => modes_take_near_null
    procedure :: pack_near_null => modes_pack_near_null
    procedure :: unpack_near_null => modes_unpack_near_null
    procedure :: is_near_null => modes_is_near_null
    procedure :: combination_text => modes_combination_text
    procedure :: span_text => modes_span_text
  end type body_modes_t

contains

  !> Find the rigid body modes that the supports leave free. All ranks find those of a body in parts together.
  subroutine modes_find(self, body)
    class(body_modes_t), intent(out) :: self
    type(body_t), intent(in) :: body  !! The body, with supports and loads.
    call self%rigid%init(body%mesh, body%analysis, body%constraint, self%shape)
    self%n = self%rigid%n
    call find_resultants(body%mesh, self%shape, body%load, self%resultant, self%resultant_size)
  end subroutine modes_find

  !> Rigid body modes of a congruent body, from those of the representative.
  subroutine modes_move(self, first, motion, body)
    class(body_modes_t), intent(out) :: self
    type(body_modes_t), intent(in) :: first  !! Rigid body modes of the representative.
    type(placement_t), intent(in) :: motion  !! Rigid motion from the representative to the body.
    type(body_t), intent(in) :: body  !! The body, with its loads.
    integer :: i, k
    self%n = first%n
    self%shape = first%shape
    if (motion%rotated) then
      associate (rotation => motion%rotation(:body%dimension, :body%dimension))
        do k = 1, size(self%shape, 3)
          do i = 1, size(self%shape, 2)
            self%shape(:, i, k) = matmul(rotation, self%shape(:, i, k))
          end do
        end do
      end associate
    end if
    self%rigid = first%rigid
    call self%rigid%move(body%mesh, motion)
    call find_resultants(body%mesh, self%shape, body%load, self%resultant, self%resultant_size)
  end subroutine modes_move

  !> Take the loads of another load case.
  subroutine modes_take_loads(self, body)
    class(body_modes_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body, with its loads.
    call find_resultants(body%mesh, self%shape, body%load, self%resultant, self%resultant_size)
  end subroutine modes_take_loads

  !> Keep the displacements of some nodes.
  subroutine modes_hold_nodes(self, node)
    class(body_modes_t), intent(inout) :: self
    integer, intent(in) :: node(:)  !! Numbers of the nodes, ascending (n_held_nodes).
    self%shape = self%shape(:, node, :)
  end subroutine modes_hold_nodes

  !> Put rigid body modes into a parcel, or take them out.
  subroutine modes_carry(self, parcel)
    class(body_modes_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%n)
    call parcel%carry(self%shape)
    call parcel%carry(self%resultant)
    call parcel%carry(self%resultant_size)
    call self%rigid%carry(parcel)
  end subroutine modes_carry

  !> Take another basis of the rigid body modes.
  subroutine modes_rotate(self, basis)
    class(body_modes_t), intent(inout) :: self
    !> Orthonormal combinations of the modes as columns, none of which mixes connected components (n, n) [].
    real(dp), intent(in) :: basis(:, :)
    associate (points => size(self%shape, 1)*size(self%shape, 2))
      self%shape = reshape(matmul(reshape(self%shape, [points, self%n]), basis), shape(self%shape))
    end associate
    self%resultant = matmul(self%resultant, basis)
    self%resultant_size = matmul(self%resultant_size, abs(basis))
    call self%rigid%rotate(basis)
  end subroutine modes_rotate

  !> The connected component of the body that each rigid body mode moves (n).
  pure function modes_components(self) result(component)
    class(body_modes_t), intent(in) :: self
    integer, allocatable :: component(:)
    component = self%rigid%component
  end function modes_components

  !> Near-null-space modes of a body that its supports hold.
  subroutine modes_take_near_null(self, body, mode, stiffness)
    class(body_modes_t), intent(out) :: self
    type(body_t), intent(in) :: body  !! The body, assembled.
    real(dp), intent(in) :: mode(:, :)  !! The modes over the equations (n_equations, n) [].
    real(dp), intent(in) :: stiffness(:, :)  !! Their spring stiffnesses (n, n) [force/length].
    real(dp), allocatable :: load(:)
    integer :: k
    self%n = size(mode, 2)
    self%stiffness = stiffness
    allocate (self%shape(body%dimension, body%mesh%n_nodes(), size(mode, 2)), load(size(mode, 1)))
    do k = 1, size(mode, 2)
      call body%constraint%expand(mode(:, k), self%shape(:, :, k), .false.)
    end do
    call body%constraint%reduce(body%load, load)
    self%lift_resultant = matmul(body%rhs - load, mode)
    ! No resultant is set to zero here: small resultants over small spring stiffnesses are finite displacements.
    self%resultant = matmul(body%rhs, mode)
    self%resultant_size = matmul(abs(body%rhs), abs(mode))
  end subroutine modes_take_near_null

  !> Near-null-space modes as numbers for other ranks.
  pure subroutine modes_pack_near_null(self, node, value)
    class(body_modes_t), intent(in) :: self
    integer, intent(in) :: node(:)  !! Nodes of which the displacements are packed (n_shared).
    real(dp), allocatable, intent(out) :: value(:)  !! The numbers (any).
    value = [real(self%n, dp), self%resultant, self%lift_resultant, self%resultant_size, &
             reshape(self%stiffness, [self%n**2]), &
             reshape(self%shape(:, node, :), [size(self%shape, 1)*size(node)*self%n])]
  end subroutine modes_pack_near_null

  !> Near-null-space modes from the numbers of another rank, in place of the rigid body modes.
  subroutine modes_unpack_near_null(self, n_nodes, node, value)
    class(body_modes_t), intent(inout) :: self
    integer, intent(in) :: n_nodes  !! Number of nodes of the body on this rank.
    integer, intent(in) :: node(:)  !! Those whose displacements were packed; others get 0 (n_shared).
    real(dp), intent(in) :: value(:)  !! From `pack_near_null` (any).
    integer :: n, d
    d = size(self%shape, 1)
    n = nint(value(1))
    self%n = n
    self%resultant = value(2:n + 1)
    self%lift_resultant = value(n + 2:2*n + 1)
    self%resultant_size = value(2*n + 2:3*n + 1)
    self%stiffness = reshape(value(3*n + 2:3*n + 1 + n**2), [n, n])
    deallocate (self%shape)
    allocate (self%shape(d, n_nodes, n), source=0.0_dp)
    self%shape(:, node, :) = reshape(value(3*n + 2 + n**2:), [d, size(node), n])
    self%rigid = rigid_body_modes_t()
  end subroutine modes_unpack_near_null

  !> Whether the modes are near-null-space modes.
  elemental logical function modes_is_near_null(self) result(is_near_null)
    class(body_modes_t), intent(in) :: self
    is_near_null = allocated(self%stiffness)
  end function modes_is_near_null

  !> Describe a combination of rigid body modes, as in "translation along (0, 0, 1)"; empty for none.
  function modes_combination_text(self, amplitude) result(text)
    class(body_modes_t), intent(in) :: self
    real(dp), intent(in) :: amplitude(:)  !! Amplitude of each mode (n) [any].
    character(:), allocatable :: text
    text = self%rigid%combination_text(amplitude)
  end function modes_combination_text

  !> Describe the span of several combinations of rigid body modes; empty for none.
  function modes_span_text(self, amplitude) result(text)
    class(body_modes_t), intent(in) :: self
    real(dp), intent(in) :: amplitude(:, :)  !! Amplitudes of each combination as columns (n, n_combinations) [any].
    character(:), allocatable :: text
    text = self%rigid%span_text(amplitude)
  end function modes_span_text

  !> Resultants of loads on modes. Rounding errors of self-equilibrated loads are set to zero.
  subroutine find_resultants(mesh, shape, load, resultant, resultant_size)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(in) :: shape(:, :, :)  !! Modes (dim, n_nodes, n) [].
    real(dp), intent(in) :: load(:, :)  !! Nodal forces, complete at the own nodes (dim, n_nodes) [force].
    !> Resultants, and the sums of their absolute terms (n) [force].
    real(dp), allocatable, intent(out) :: resultant(:), resultant_size(:)
    real(dp) :: total(2*size(shape, 3))
    integer :: i, k, n
    n = size(shape, 3)
    total = 0
    do k = 1, n
      total(k) = own_product(mesh, shape(:, :, k), load)
      do i = 1, size(load, 2)
        if (mesh%is_own_node(i)) total(n + k) = total(n + k) + norm2(shape(:, i, k))*norm2(load(:, i))
      end do
    end do
    if (n > 0) call add_up_parts(mesh, total)
    resultant = total(:n)
    resultant_size = total(n + 1:)
    where (abs(resultant) <= given_rounding*resultant_size) resultant = 0
  end subroutine find_resultants
end module dotyk_elasticity_body_modes
