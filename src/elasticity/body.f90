!> One elastic body: its elements, material, supports and loads, and the linear system that they make.
module dotyk_elasticity_body
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d
  use dotyk_elasticity_assembly, only: assemble_stiffness
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_dirichlet_lift, only: subtract_dirichlet_lift
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, build_pattern
  use dotyk_elasticity_stress_energy, only: stresses_and_energy
  use dotyk_elasticity_rigid_motion, only: find_free_rigid_modes
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private

  !> A body. The first seven components are set by its user, the rest by `assemble`.
  type, public :: body_t
    !> Its name in the input.
    character(:), allocatable :: name
    !> One of dotyk_elasticity_analysis' constants.
    integer :: analysis = analysis_3d
    !> Number of displacement components.
    integer :: dimension = 3
    !> Its elements.
    type(body_mesh_t) :: mesh
    !> Its material.
    type(material_t) :: material
    !> Its free and given unknowns.
    type(constraint_t) :: constraint
    !> Nodal forces of its loads in global axes; zero where not allocated (dim, n_nodes) [force].
    real(dp), allocatable :: load(:, :)
    !> Stiffness over the free equations [force/length].
    type(sparse_symmetric_t) :: stiffness
    !> Load minus the forces of given displacements, over the free equations (n_equations) [force].
    real(dp), allocatable :: rhs(:)
    !> Rigid motions that the supports leave free, in Cartesian components: an orthonormal basis in the sum over nodes and
    !> components, zero along given unknowns (dim, n_nodes, n_motions) [1].
    real(dp), allocatable :: rigid_mode(:, :, :)
    !> Resultants of the loads on them (n_motions) [force].
    real(dp), allocatable :: resultant(:)
    !> Whether they are not quite free: motions that the supports hardly resist, which schemes treat apart.
    logical :: has_near_null_modes = .false.
    !> What given displacements add to the resultants, of soft motions (n_motions) [force].
    real(dp), allocatable :: lift_resultant(:)
    !> What the resultants on soft motions are made up of, without signs (n_motions) [force].
    real(dp), allocatable :: resultant_size(:)
    !> The same motions as translations and rotations, to say them; their number alone where they are soft.
    type(rigid_body_modes_t) :: modes
    !> Adjacency of the nodes, see `node_graph`; may be deallocated when no longer needed.
    integer, allocatable :: graph_start(:), graph_neighbour(:)
    !> Volume; that of the full turn where axisymmetric [length^dim].
    real(dp) :: volume = 0
    !> Mean over the volume of the factor on the stiffness [1].
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

  !> Resultants below this part of what makes them up are rounding errors.
  real(dp), parameter :: rounding = 1.0e-13_dp

contains

  !> Find the free rigid motions. `assemble` does it where it was not done before.
  subroutine body_find_rigid_modes(self)
    class(body_t), intent(inout) :: self
    call self%modes%init(self%mesh, self%analysis, self%constraint, self%rigid_mode)
  end subroutine body_find_rigid_modes

  !> A combination of the free motions in words, such as "translation along (0, 0, 1)"; empty for none.
  function body_mode_text(self, amplitude) result(text)
    !> With motions found.
    class(body_t), intent(in) :: self
    !> Amplitude of each of `rigid_mode` (n_motions), any unit.
    real(dp), intent(in) :: amplitude(:)
    character(:), allocatable :: text
    text = self%modes%combination_text(amplitude)
  end function body_mode_text

  !> Make the stiffness matrix and the right-hand side.
  subroutine body_assemble(self, error)
    class(body_t), intent(inout) :: self
    !> Allocated where an element is inverted or the factor on the stiffness is not positive.
    type(error_t), allocatable, intent(out) :: error
    type(block_positions_t) :: places
    if (.not. allocated(self%graph_start)) call node_graph(self%mesh, self%graph_start, self%graph_neighbour)
    if (.not. allocated(self%load)) allocate (self%load(self%dimension, self%mesh%n_nodes()), source=0.0_dp)
    if (.not. allocated(self%rigid_mode)) call self%find_rigid_modes()
    self%resultant = resultants(self%rigid_mode, self%load)
    if (allocated(self%rhs)) deallocate (self%rhs)
    allocate (self%rhs(self%constraint%n_equations))
    call self%constraint%reduce(self%load, self%rhs)
    call build_pattern(self%dimension, self%constraint%equation, self%graph_start, self%graph_neighbour, places, &
      self%stiffness)
    call assemble_stiffness(self%mesh, self%analysis, self%material, self%constraint, places, self%stiffness, &
      self%rhs, self%volume, self%mean_modulus_factor, error)
  end subroutine body_assemble

  !> Resultants of loads on motions; rounding errors of loads that balance each other are none.
  pure function resultants(motion, load) result(resultant)
    !> (dimension, n_nodes, n_motions) [].
    real(dp), intent(in) :: motion(:, :, :)
    !> (dimension, n_nodes) [force].
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

  !> Make the right-hand side alone, of a body that is another one, moved: it has no stiffness of its own.
  subroutine body_assemble_like(self, first, motion, error)
    !> Its constraint has the equations and axes of the first one, see `adopt_congruent_constraint`.
    class(body_t), intent(inout) :: self
    !> Assembled.
    type(body_t), intent(in) :: first
    !> From the first to this one.
    type(placement_t), intent(in) :: motion
    !> As in `assemble`.
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

  !> Treat motions that the supports hardly resist as if they were free; springs on them are the scheme's.
  subroutine body_adopt_near_null_modes(self, motion)
    !> Assembled, held.
    class(body_t), intent(inout) :: self
    !> The motions over the equations (n_equations, n_motions).
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
    ! Resultants as small as the springs are do count.
    self%resultant = matmul(self%rhs, motion)
    self%resultant_size = matmul(abs(self%rhs), abs(motion))
  end subroutine body_adopt_near_null_modes

  !> Young's modulus for scales: of the softest global direction, mean over the body [pressure].
  real(dp) function body_young(self) result(young)
    class(body_t), intent(in) :: self
    young = self%material%least_young*self%mean_modulus_factor
  end function body_young

  !> Give all memory back.
  subroutine body_destroy(self)
    class(body_t), intent(inout) :: self
    call self%stiffness%destroy()
    if (allocated(self%rhs)) deallocate (self%rhs)
    if (allocated(self%load)) deallocate (self%load)
    if (allocated(self%rigid_mode)) deallocate (self%rigid_mode)
    if (allocated(self%resultant)) deallocate (self%resultant)
    if (allocated(self%graph_start)) deallocate (self%graph_start, self%graph_neighbour)
  end subroutine body_destroy

  !> Strain energy A(u,u)/2 of a displacement, given displacements included [force length].
  real(dp) function strain_energy(body, u) result(energy)
    !> The body; assembled before, so that its elements and formulas are known to be sound.
    type(body_t), intent(in) :: body
    !> Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    type(error_t), allocatable :: error
    real(dp), allocatable :: stress(:, :)
    allocate (stress(6, body%mesh%n_elements()))
    call stresses_and_energy(body%mesh, body%analysis, body%material, u, stress, energy, error)
  end function strain_energy

  !> The rigid motions that the supports of a body leave free.
  subroutine free_rigid_modes(body, n_free, text)
    !> The body; it need not be assembled.
    type(body_t), intent(in) :: body
    !> Number of independent free motions, of all its connected parts together.
    integer, intent(out) :: n_free
    !> They in words; empty for none.
    character(:), allocatable, intent(out) :: text
    call find_free_rigid_modes(body%mesh, body%analysis, body%constraint, n_free, text)
  end subroutine free_rigid_modes
end module dotyk_elasticity_body
