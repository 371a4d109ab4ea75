!> One elastic body: elements, material, Dirichlet conditions and loads, and the linear system K u = f that they
!> define.
module dotyk_elasticity_body
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d
  use dotyk_elasticity_assembly, only: assemble_stiffness
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_dirichlet_lift, only: subtract_dirichlet_lift
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_elasticity_rigid_motion, only: find_free_rigid_modes
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, build_pattern
  use dotyk_elasticity_stress_energy, only: stresses_and_energy
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  !> A body. Its user sets the components from `name` to `load`; `assemble` sets the others.
  type, public :: body_t
    !> Name in the input.
    character(:), allocatable :: name
    !> Type of analysis: one of the `analysis_*` constants.
    integer :: analysis = analysis_3d
    !> Number of displacement components, 2 or 3.
    integer :: dimension = 3
    !> Elements and nodes.
    type(body_mesh_t) :: mesh
    !> Material.
    type(material_t) :: material
    !> Equations, prescribed displacements and nodal axes.
    type(constraint_t) :: constraint
    !> Nodal forces of the loads in global axes; zero where not allocated (dim, n_nodes) [force].
    real(dp), allocatable :: load(:, :)
    !> Stiffness matrix over the free equations [force/length].
    type(sparse_symmetric_t) :: stiffness
    !> Loads minus the forces of prescribed displacements, over the free equations (n_equations) [force].
    real(dp), allocatable :: rhs(:)
    !> Rigid body modes that the supports leave free, in global axes: an orthonormal basis in the Euclidean product
    !> over nodes and components, zero along prescribed unknowns; near-null-space modes where `has_near_null_modes`
    !> (dim, n_nodes, n_modes) [].
    real(dp), allocatable :: rigid_mode(:, :, :)
    !> Resultants of the loads on these modes (n_modes) [force].
    real(dp), allocatable :: resultant(:)
    !> Whether the modes are near-null-space modes, which the supports hardly resist, and not exactly free ones.
    logical :: has_near_null_modes = .false.
    !> Contribution of prescribed displacements to the resultants on near-null-space modes (n_modes) [force].
    real(dp), allocatable :: lift_resultant(:)
    !> Sum of the absolute terms of the resultants on near-null-space modes (n_modes) [force].
    real(dp), allocatable :: resultant_size(:)
    !> The same modes as translations and rotations, for messages; only their number where they are near-null-space
    !> modes.
    type(rigid_body_modes_t) :: modes
    !> First neighbour of each node in `graph_neighbour`, see `node_graph`; may be deallocated after use
    !> (n_nodes + 1).
    integer, allocatable :: graph_start(:)
    !> Neighbours of the nodes, one node after the other (graph_start(n_nodes + 1) - 1).
    integer, allocatable :: graph_neighbour(:)
    !> Volume [volume].
    real(dp) :: volume = 0
    !> Mean of the modulus field over the volume [].
    real(dp) :: mean_modulus_factor = 1
  contains
    procedure :: find_rigid_modes => body_find_rigid_modes
    procedure :: mode_text => body_mode_text
    procedure :: assemble => body_assemble
    procedure :: assemble_like => body_assemble_like
    procedure :: adopt_near_null_modes => body_adopt_near_null_modes
    procedure :: young => body_young
    procedure :: destroy => body_destroy
  end type body_t

  public :: node_graph, strain_energy, free_rigid_modes

  !> Resultants below this fraction of the sum of their absolute terms are rounding errors: 450 epsilon, the
  !> rounding of a sum of 2e5 terms of mixed signs.
  real(dp), parameter :: rounding = 1.0e-13_dp

contains

  !> Find the rigid body modes that the supports leave free. `assemble` does so where it was not done before.
  subroutine body_find_rigid_modes(self)
    class(body_t), intent(inout) :: self
    call self%modes%init(self%mesh, self%analysis, self%constraint, self%rigid_mode)
  end subroutine body_find_rigid_modes

  !> Describe a combination of the rigid body modes, as in "translation along (0, 0, 1)"; empty for none. The modes
  !> must have been found.
  function body_mode_text(self, amplitude) result(text)
    class(body_t), intent(in) :: self
    !> Amplitudes of the modes of `rigid_mode` (n_modes) [any unit].
    real(dp), intent(in) :: amplitude(:)
    character(:), allocatable :: text
    text = self%modes%combination_text(amplitude)
  end function body_mode_text

  !> Assemble the stiffness matrix and the right-hand side.
  subroutine body_assemble(self, error)
    class(body_t), intent(inout) :: self
    !> Allocated where an element is inverted or the modulus field is not positive at a quadrature point.
    type(error_t), allocatable, intent(out) :: error
    type(block_positions_t) :: positions
    if (.not. allocated(self%graph_start)) call node_graph(self%mesh, self%graph_start, self%graph_neighbour)
    if (.not. allocated(self%load)) allocate (self%load(self%dimension, self%mesh%n_nodes()), source=0.0_dp)
    if (.not. allocated(self%rigid_mode)) call self%find_rigid_modes()
    self%resultant = resultants(self%rigid_mode, self%load)
    if (allocated(self%rhs)) deallocate (self%rhs)
    allocate (self%rhs(self%constraint%n_equations))
    call self%constraint%reduce(self%load, self%rhs)
    call build_pattern(self%dimension, self%constraint%equation, self%graph_start, self%graph_neighbour, positions, &
      self%stiffness)
    call assemble_stiffness(self%mesh, self%analysis, self%material, self%constraint, positions, self%stiffness, &
      self%rhs, self%volume, self%mean_modulus_factor, error)
  end subroutine body_assemble

  !> Resultants of loads on modes. Rounding errors of loads that balance each other are set to zero.
  pure function resultants(motion, load) result(resultant)
    !> Modes (dim, n_nodes, n_modes) [].
    real(dp), intent(in) :: motion(:, :, :)
    !> Nodal forces (dim, n_nodes) [force].
    real(dp), intent(in) :: load(:, :)
    real(dp) :: resultant(size(motion, 3))
    real(dp) :: largest
    integer :: i, k
    do k = 1, size(motion, 3)
      resultant(k) = sum(motion(:, :, k)*load)
      largest = 0
      do i = 1, size(load, 2)
        largest = largest + norm2(motion(:, i, k))*norm2(load(:, i))
      end do
      if (abs(resultant(k)) <= rounding*largest) resultant(k) = 0
    end do
  end function resultants

  !> Assemble only the right-hand side of a body that is congruent to another one and uses its stiffness.
  !>
  !> The constraint of the body has the equations and axes of the representative, see `adopt_congruent_constraint`.
  subroutine body_assemble_like(self, first, motion, error)
    !> Its constraint has the equations and axes of the first one, see `adopt_congruent_constraint`.
    class(body_t), intent(inout) :: self
    !> The representative, assembled.
    type(body_t), intent(in) :: first
    !> Rigid motion from the representative to this body.
    type(placement_t), intent(in) :: motion
    !> Allocated as in `assemble`.
    type(error_t), allocatable, intent(out) :: error
    integer :: i, k
    if (.not. allocated(self%load)) allocate (self%load(self%dimension, self%mesh%n_nodes()), source=0.0_dp)
    self%rigid_mode = first%rigid_mode
    if (motion%rotated) then
      associate (rotation => motion%rotation(:self%dimension, :self%dimension))
        do k = 1, size(self%rigid_mode, 3)
          do i = 1, size(self%rigid_mode, 2)
            self%rigid_mode(:, i, k) = matmul(rotation, self%rigid_mode(:, i, k))
          end do
        end do
      end associate
    end if
    self%modes = first%modes
    call self%modes%move(self%mesh, motion)
    self%resultant = resultants(self%rigid_mode, self%load)
    self%volume = first%volume
    self%mean_modulus_factor = first%mean_modulus_factor
    if (allocated(self%rhs)) deallocate (self%rhs)
    allocate (self%rhs(self%constraint%n_equations))
    call self%constraint%reduce(self%load, self%rhs)
    call subtract_dirichlet_lift(self%mesh, self%analysis, self%material, self%constraint, self%rhs, error)
  end subroutine body_assemble_like

  !> Replace the rigid body modes by near-null-space modes, which the supports hardly resist. The scheme adds their
  !> springs.
  subroutine body_adopt_near_null_modes(self, motion)
    class(body_t), intent(inout) :: self
    !> The modes over the equations of the assembled body (n_equations, n_modes) [].
    real(dp), intent(in) :: motion(:, :)
    real(dp), allocatable :: load(:)
    integer :: k
    self%has_near_null_modes = .true.
    self%modes%n = size(motion, 2)
    deallocate (self%rigid_mode)
    allocate (self%rigid_mode(self%dimension, self%mesh%n_nodes(), size(motion, 2)), load(size(motion, 1)))
    do k = 1, size(motion, 2)
      call self%constraint%expand(motion(:, k), self%rigid_mode(:, :, k), .false.)
    end do
    call self%constraint%reduce(self%load, load)
    self%lift_resultant = matmul(self%rhs - load, motion)
    ! No resultant is set to zero here: small resultants divided by small spring stiffnesses are finite displacements.
    self%resultant = matmul(self%rhs, motion)
    self%resultant_size = matmul(abs(self%rhs), abs(motion))
  end subroutine body_adopt_near_null_modes

  !> Young's modulus for scaling: that of the softest material axis, averaged over the body [pressure].
  real(dp) function body_young(self) result(young)
    class(body_t), intent(in) :: self
    young = self%material%least_young*self%mean_modulus_factor
  end function body_young

  !> Free the memory of matrix, vectors, modes and graph.
  subroutine body_destroy(self)
    class(body_t), intent(inout) :: self
    call self%stiffness%destroy()
    if (allocated(self%rhs)) deallocate (self%rhs)
    if (allocated(self%load)) deallocate (self%load)
    if (allocated(self%rigid_mode)) deallocate (self%rigid_mode)
    if (allocated(self%resultant)) deallocate (self%resultant)
    if (allocated(self%graph_start)) deallocate (self%graph_start, self%graph_neighbour)
  end subroutine body_destroy

  !> Strain energy A(u,u)/2 of a displacement, prescribed displacements included [energy].
  real(dp) function strain_energy(body, u) result(energy)
    !> The body; assembled before, so that its elements and formulas are known to be valid.
    type(body_t), intent(in) :: body
    !> Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    type(error_t), allocatable :: error
    real(dp), allocatable :: stress(:, :)
    allocate (stress(6, body%mesh%n_elements()))
    call stresses_and_energy(body%mesh, body%analysis, body%material, u, stress, energy, error)
  end function strain_energy

  !> Number and description of the rigid body modes that the supports of a body leave free.
  subroutine free_rigid_modes(body, n_free, text)
    !> The body; it need not be assembled.
    type(body_t), intent(in) :: body
    !> Number of independent modes, summed over the connected components of the body.
    integer, intent(out) :: n_free
    !> Description of the modes; empty for none.
    character(:), allocatable, intent(out) :: text
    call find_free_rigid_modes(body%mesh, body%analysis, body%constraint, n_free, text)
  end subroutine free_rigid_modes
end module dotyk_elasticity_body
