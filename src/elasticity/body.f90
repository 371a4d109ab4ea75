!> One elastic body: elements, material, Dirichlet conditions and loads, and the linear system K u = f that they define.
!> What acts on it in one load case are its loads, temperature, initial stress and the values of prescribed
!> displacements; all else is the same in all load cases.
module dotyk_elasticity_body
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_3d, analysis_plane_stress
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_elasticity_assembly, only: assemble_elements => assemble_stiffness, subtract_dirichlet_lift
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_initial_stress, only: initial_state_t
  use dotyk_elasticity_load_report, only: load_resultant_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_point_forces, only: point_forces_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, build_pattern
  use dotyk_elasticity_stress_energy, only: stresses_and_energy
  use dotyk_elasticity_support_directions, only: support_directions_t
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t, whole_body_t
  use dotyk_mesh_held_part, only: describe_whole, hold_part, surface_part
  use dotyk_ranks_exchange, only: add_counts
  implicit none
  private
  public :: node_graph, strain_energy, assemble_stiffness, hold_body, hold_surface

  !> A body. Its user sets the components from `name` to `load`; `assemble` sets the others. Its stiffness and its
  !> modes (`dotyk_elasticity_body_modes`) are values of their own.
  type, public :: body_t
    character(:), allocatable :: name  !! Name in the input.
    integer :: analysis = analysis_3d  !! Type of analysis: one of the `analysis_*` constants.
    integer :: dimension = 3  !! Number of displacement components, 2 or 3.
    type(body_mesh_t) :: mesh  !! Elements and nodes.
    logical :: is_hinged = .false.  !! Whether edges or corners alone join pieces, as hinges: motions cost no energy.
    !> Materials; the blocks of the mesh tell which of them their elements have (n_materials).
    type(material_t), allocatable :: material(:)
    type(constraint_t) :: constraint  !! Equations, prescribed displacements and nodal axes.
    type(support_directions_t) :: directions  !! Directions of its supports, for their reactions.
    type(initial_state_t) :: initial  !! Temperature and initial stress.
    !> Nodal forces of the loads, and of the initial state, in global axes; zero where not allocated (dim, n_nodes)
    !> [force].
    real(dp), allocatable :: load(:, :)
    type(point_forces_t) :: applied  !! Loads on surfaces, and force densities that vary, at quadrature points.
    !> Sum of the constant force densities in each material, in global axes; none where not allocated (3, n_materials)
    !> [force/volume].
    real(dp), allocatable :: density(:, :)
    type(load_resultant_t), allocatable :: resultant(:)  !! Resultants of the loads (n_loads); for the log.
    !> Warnings of formulas of loads and supports that quadrature or the mesh does not resolve.
    type(text_t), allocatable :: unresolved(:)
    !> What acts on the body in each load case; not allocated where it is the same in all of them (n_cases).
    type(body_actions_t), allocatable :: of_case(:)
    real(dp), allocatable :: rhs(:)  !! Loads minus forces of prescribed displacements (n_equations) [force].
    real(dp) :: volume = 0  !! Volume [volume].
    !> Mean of the modulus field over the volume; of several materials, those of the others count by their least Young's
    !> modulus over that of the first [].
    real(dp) :: mean_modulus_factor = 1
    !> Nodes that every rank holds, ascending: those of the boundary among them; allocated in runs on several ranks
    !> (n_shared_nodes).
    integer, allocatable :: shared_node(:)
    !> Whether this rank computes each equation; allocated where all ranks compute the body together, each a part
    !> (n_equations).
    logical, allocatable :: own_equation(:)
    !> Whether the body has loads or given displacements at nodes that this rank does not hold.
    logical :: is_loaded_inside = .false.
    integer, private :: n_whole_equations = 0  !! Equations of the whole body where this rank numbers its part.
  contains
    procedure :: assemble => body_assemble
    procedure :: assemble_like => body_assemble_like
    procedure :: assemble_loads => body_assemble_loads
    procedure :: hold_nodes => body_hold_nodes
    procedure :: number_part => body_number_part
    procedure :: take_part => body_take_part
    procedure :: n_unknowns => body_n_unknowns
    procedure :: of_own_equations => body_of_own_equations
    procedure :: of_own_nodes => body_of_own_nodes
    procedure :: is_idle => body_is_idle
    procedure :: young => body_young
    procedure :: contact_compliance => body_contact_compliance
    procedure :: carry => body_carry
    procedure :: destroy => body_destroy
  end type body_t

  type, public :: stiffness_t  !! The stiffness of a body, until it is factorized.
    type(sparse_symmetric_t) :: matrix  !! Matrix over the free equations [force/length].
    integer(int64), allocatable :: graph_start(:)  !! First of each node in `graph_neighbour` (n_nodes + 1).
    integer, allocatable :: graph_neighbour(:)  !! Neighbours, node after node (graph_start(n_nodes + 1) - 1).
  contains
    procedure :: forget_graph => stiffness_forget_graph
    procedure :: destroy => stiffness_destroy
  end type stiffness_t

  type :: body_actions_t  !! Components of `body_t` with the same names.
    real(dp), allocatable :: prescribed(:, :)  !! Along the nodal axes; zero if not allocated (dim, n_nodes) [length].
    real(dp) :: rigid_motion(6) = 0  !! Held motions of a rigid body, see `rigid_hold_t` (6) [length, radian].
    type(initial_state_t) :: initial  !! Temperature and initial stress.
    real(dp), allocatable :: load(:, :)  !! Nodal forces; zero where not allocated (dim, n_nodes) [force].
    type(point_forces_t) :: applied  !! Loads at quadrature points.
    !> Sums of the constant force densities of the materials; none where not allocated (3, n_materials) [force/volume].
    real(dp), allocatable :: density(:, :)
    type(load_resultant_t), allocatable :: resultant(:)  !! Resultants of the loads (n_loads).
    type(text_t), allocatable :: unresolved(:)  !! Warnings of formulas.
    logical :: is_loaded_inside = .false.  !! Whether there are any at nodes that this rank does not hold.
  contains
    procedure :: is_idle => actions_is_idle
    procedure :: hold_nodes => actions_hold_nodes
    procedure :: carry => actions_carry
  end type body_actions_t

contains

  !> Assemble the stiffness and the right-hand side.
  subroutine body_assemble(self, stiffness, error)
    class(body_t), intent(inout) :: self
    type(stiffness_t), intent(inout) :: stiffness  !! Stiffness by free equations, with the node graph [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    if (.not. allocated(self%load)) allocate (self%load(self%dimension, self%mesh%n_nodes()), source=0.0_dp)
    if (allocated(self%rhs)) deallocate (self%rhs)
    allocate (self%rhs(self%constraint%n_equations))
    call self%constraint%reduce(self%load, self%rhs)
    call assemble_matrix(self, stiffness, self%rhs, self%volume, self%mean_modulus_factor, error)
  end subroutine body_assemble

  !> Assemble only the stiffness of a body that was assembled before.
  subroutine assemble_stiffness(body, stiffness, error)
    type(body_t), intent(in) :: body  !! The body.
    type(stiffness_t), intent(inout) :: stiffness  !! Stiffness by free equations, with the node graph [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    real(dp), allocatable :: rhs(:)
    real(dp) :: volume, mean_modulus_factor
    allocate (rhs(body%constraint%n_equations), source=0.0_dp)
    call assemble_matrix(body, stiffness, rhs, volume, mean_modulus_factor, error)
  end subroutine assemble_stiffness

  !> Sparsity pattern and values of the stiffness.
  subroutine assemble_matrix(body, stiffness, rhs, volume, mean_modulus_factor, error)
    type(body_t), intent(in) :: body  !! The body.
    type(stiffness_t), intent(inout) :: stiffness  !! Stiffness by free equations, with the node graph [force/length].
    real(dp), intent(inout) :: rhs(:)  !! Loads, minus forces of prescribed displacements (n_equations) [force].
    real(dp), intent(out) :: volume  !! Volume of the body [volume].
    real(dp), intent(out) :: mean_modulus_factor  !! Mean of the modulus field over the volume [].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    type(block_positions_t) :: positions
    call node_graph(body%mesh, stiffness%graph_start, stiffness%graph_neighbour)
    call build_pattern(body%dimension, body%constraint%equation, stiffness%graph_start, stiffness%graph_neighbour, &
                       positions, stiffness%matrix)
    call assemble_elements(body%mesh, body%analysis, body%material, body%constraint, positions, stiffness%matrix, rhs, &
                           volume, mean_modulus_factor, error)
  end subroutine assemble_matrix

  !> Assemble only the right-hand side of a body that is congruent to another one and has its stiffness.
  !>
  !> The constraint of the body has the equations and axes of the representative, see `adopt_congruent_constraint`.
  subroutine body_assemble_like(self, first, error)
    class(body_t), intent(inout) :: self
    type(body_t), intent(in) :: first  !! The representative, assembled.
    !> Allocated where an element next to a prescribed displacement is inverted, or the modulus field is not positive.
    type(error_t), allocatable, intent(out) :: error
    self%volume = first%volume
    self%mean_modulus_factor = first%mean_modulus_factor
    call self%assemble_loads(error)
  end subroutine body_assemble_like

  !> Assemble only the right-hand side of a body whose stiffness matrix is not needed as a whole.
  subroutine body_assemble_loads(self, error)
    class(body_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! As in `assemble_like`.
    if (.not. allocated(self%load)) allocate (self%load(self%dimension, self%mesh%n_nodes()), source=0.0_dp)
    if (allocated(self%rhs)) deallocate (self%rhs)
    allocate (self%rhs(self%constraint%n_equations))
    call self%constraint%reduce(self%load, self%rhs)
    call subtract_dirichlet_lift(self%mesh, self%analysis, self%material, self%constraint, self%rhs, error)
  end subroutine body_assemble_loads

  !> Keep what belongs to some nodes. The equations keep their numbers in the whole body.
  subroutine body_hold_nodes(self, node)
    class(body_t), intent(inout) :: self
    integer, intent(in) :: node(:)  !! Numbers of the nodes in the whole body, ascending (n_held_nodes).
    integer, allocatable :: number(:)
    integer :: i
    self%is_loaded_inside = .not. self%is_idle()
    associate (constraint => self%constraint)
      constraint%equation = constraint%equation(:, node)
      constraint%prescribed = constraint%prescribed(:, node)
      constraint%frame_of = constraint%frame_of(node)
      if (constraint%foundation%n > 0) then
        ! They are on the surface, whose nodes are held.
        allocate (number(maxval(node)), source=0)
        number(node) = [(i, i=1, size(node))]
        call constraint%foundation%renumber(number)
      end if
    end associate
    call self%directions%hold_nodes(node)
    if (allocated(self%load)) self%load = self%load(:, node)
    call self%initial%hold_nodes(node)
    if (allocated(self%of_case)) then
      do i = 1, size(self%of_case)
        call self%of_case(i)%hold_nodes(node)
      end do
    end if
    self%shared_node = [(i, i=1, size(node))]
  end subroutine body_hold_nodes

  !> Number the equations of a part of a body that all ranks compute together.
  subroutine body_number_part(self, own_node)
    class(body_t), intent(inout) :: self
    logical, intent(in) :: own_node(:)  !! Whether this rank computes each held node (n_held_nodes).
    integer :: i, k
    self%n_whole_equations = self%constraint%n_equations
    call self%constraint%number_equations()
    allocate (self%own_equation(self%constraint%n_equations))
    associate (equation => self%constraint%equation)
      do i = 1, size(equation, 2)
        do k = 1, size(equation, 1)
          if (equation(k, i) > 0) self%own_equation(equation(k, i)) = own_node(i)
        end do
      end do
    end associate
  end subroutine body_number_part

  !> Take a part that was made without the whole body, with its supports and loads. All ranks do so together.
  subroutine body_take_part(self)
    class(body_t), intent(inout) :: self
    integer(int64) :: n(2)
    integer :: i
    self%shared_node = [(i, i=1, self%mesh%n_nodes())]
    call self%number_part(self%mesh%whole%own_node)
    n = [count(self%own_equation), merge(0, 1, self%is_idle())]
    call add_counts(n)
    self%n_whole_equations = int(n(1))
    self%is_loaded_inside = n(2) > 0
  end subroutine body_take_part

  !> Number of equations of the whole body.
  elemental integer function body_n_unknowns(self) result(n)
    class(body_t), intent(in) :: self
    n = self%constraint%n_equations
    if (allocated(self%own_equation)) n = self%n_whole_equations
  end function body_n_unknowns

  !> Numbers over the equations that this rank computes, 0 elsewhere, for sums to which each rank adds its own
  !> (n_equations).
  pure function body_of_own_equations(self, x) result(own)
    class(body_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Over the equations (n_equations) [any].
    real(dp), allocatable :: own(:)
    own = x
    if (.not. allocated(self%own_equation)) return
    where (.not. self%own_equation) own = 0
  end function body_of_own_equations

  !> The same of nodes (n, n_nodes).
  pure function body_of_own_nodes(self, f) result(own)
    class(body_t), intent(in) :: self
    real(dp), intent(in) :: f(:, :)  !! At the nodes (n, n_nodes) [any].
    real(dp), allocatable :: own(:, :)
    integer :: i
    own = f
    if (.not. allocated(self%own_equation)) return
    do i = 1, size(own, 2)
      if (.not. self%mesh%whole%own_node(i)) own(:, i) = 0
    end do
  end function body_of_own_nodes

  !> Whether there are neither loads nor prescribed displacements.
  pure logical function body_is_idle(self) result(is_idle)
    class(body_t), intent(in) :: self
    is_idle = .not. (self%is_loaded_inside .or. any(abs(self%constraint%prescribed) > 0))
    if (is_idle .and. allocated(self%load)) is_idle = .not. any(abs(self%load) > 0)
  end function body_is_idle

  !> Young's modulus for scaling: those of the softest axes of the materials, averaged over the body [pressure].
  real(dp) function body_young(self) result(young)
    class(body_t), intent(in) :: self
    young = self%material(1)%least_young*self%mean_modulus_factor
  end function body_young

  !> Compliance (1 - nu^2)/E of a half-space of its first material, with the mean modulus; nu = 0.3 where that is not
  !> isotropic [1/pressure].
  real(dp) function body_contact_compliance(self) result(compliance)
    class(body_t), intent(in) :: self
    real(dp) :: nu
    nu = 0.3_dp
    if (self%analysis == analysis_plane_stress) then
      nu = 0
    else if (self%material(1)%isotropic) then
      nu = self%material(1)%lambda/(2*(self%material(1)%lambda + self%material(1)%mu))
    end if
    compliance = (1 - nu**2)/self%young()
  end function body_contact_compliance

  !> Put a body that is not assembled into a parcel, or take it out.
  subroutine body_carry(self, parcel)
    class(body_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    logical :: is_there, has_cases
    integer :: n(1), i
    call parcel%carry(self%name)
    call parcel%carry(self%analysis)
    call parcel%carry(self%dimension)
    call self%mesh%carry(parcel)
    call parcel%carry(self%is_hinged)
    is_there = allocated(self%material)
    if (is_there) n = shape(self%material)
    call parcel%carry_shape(is_there, n)
    if (is_there .and. parcel%is_read) allocate (self%material(n(1)))
    if (is_there) then
      do i = 1, n(1)
        call self%material(i)%carry(parcel)
      end do
    end if
    call self%constraint%carry(parcel)
    call self%initial%carry(parcel)
    call self%directions%carry(parcel)
    call parcel%carry(self%load)
    call self%applied%carry(parcel)
    call parcel%carry(self%density)
    call carry_resultants(parcel, self%resultant)
    call parcel%carry(self%unresolved)
    call parcel%carry(self%shared_node)
    call parcel%carry(self%is_loaded_inside)
    has_cases = allocated(self%of_case)
    if (has_cases) n = shape(self%of_case)
    call parcel%carry_shape(has_cases, n)
    if (has_cases .and. parcel%is_read) allocate (self%of_case(n(1)))
    if (.not. has_cases) return
    do i = 1, n(1)
      call self%of_case(i)%carry(parcel)
    end do
  end subroutine body_carry

  !> Free the memory of the vectors.
  subroutine body_destroy(self)
    class(body_t), intent(inout) :: self
    if (allocated(self%rhs)) deallocate (self%rhs)
    if (allocated(self%load)) deallocate (self%load)
  end subroutine body_destroy

  !> Free the memory of the graph.
  subroutine stiffness_forget_graph(self)
    class(stiffness_t), intent(inout) :: self
    if (allocated(self%graph_start)) deallocate (self%graph_start, self%graph_neighbour)
  end subroutine stiffness_forget_graph

  !> Free the memory of the matrix and the graph.
  subroutine stiffness_destroy(self)
    class(stiffness_t), intent(inout) :: self
    call self%matrix%destroy()
    call self%forget_graph()
  end subroutine stiffness_destroy

  !> Strain energy A(u,u)/2 of a displacement, prescribed displacements included, and that of springs with far ends at
  !> rest [energy].
  real(dp) function strain_energy(body, u) result(energy)
    type(body_t), intent(in) :: body  !! The body; assembled before: its elements and formulas are valid.
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    type(error_t), allocatable :: error
    real(dp), allocatable :: stress(:, :), force(:, :)
    real(dp) :: of_springs
    allocate (stress(6, body%mesh%n_elements()))
    call stresses_and_energy(body%mesh, body%analysis, body%material, u, stress, energy, error)
    if (body%constraint%foundation%n == 0) return
    allocate (force(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
    of_springs = 0
    call body%constraint%foundation%add_forces(body%mesh%x, body%analysis, u, force, of_springs)
    energy = energy + of_springs/2
  end function strain_energy

  !> Whether there are neither loads nor prescribed displacements.
  pure logical function actions_is_idle(self) result(is_idle)
    class(body_actions_t), intent(in) :: self
    is_idle = .not. (self%is_loaded_inside .or. allocated(self%prescribed) .or. allocated(self%load))
  end function actions_is_idle

  !> Keep what belongs to some nodes.
  pure subroutine actions_hold_nodes(self, node)
    class(body_actions_t), intent(inout) :: self
    integer, intent(in) :: node(:)  !! Numbers of the nodes in the whole body, ascending (n_held_nodes).
    self%is_loaded_inside = .not. self%is_idle()
    if (allocated(self%prescribed)) self%prescribed = self%prescribed(:, node)
    if (allocated(self%load)) self%load = self%load(:, node)
    call self%initial%hold_nodes(node)
  end subroutine actions_hold_nodes

  !> Put the actions into a parcel, or take them out.
  subroutine actions_carry(self, parcel)
    class(body_actions_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%prescribed)
    call parcel%carry_fixed(6, self%rigid_motion)
    call self%initial%carry(parcel)
    call parcel%carry(self%load)
    call self%applied%carry(parcel)
    call parcel%carry(self%density)
    call carry_resultants(parcel, self%resultant)
    call parcel%carry(self%unresolved)
    call parcel%carry(self%is_loaded_inside)
  end subroutine actions_carry

  !> Put resultants of loads into a parcel, or take them out.
  subroutine carry_resultants(parcel, resultant)
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    type(load_resultant_t), allocatable, intent(inout) :: resultant(:)  !! The resultants, if there are any (n_loads).
    logical :: has_loads
    integer :: n(1), i
    has_loads = allocated(resultant)
    if (has_loads) n = shape(resultant)
    call parcel%carry_shape(has_loads, n)
    if (has_loads .and. parcel%is_read) allocate (resultant(n(1)))
    if (.not. has_loads) return
    do i = 1, n(1)
      call resultant(i)%carry(parcel)
    end do
  end subroutine carry_resultants

  !> Reduce a body that other ranks compute to its surface.
  subroutine hold_surface(body, number)
    type(body_t), intent(inout) :: body  !! The body, with supports and loads, not assembled.
    !> Number of each node of the whole body in the held part, 0 where it is not held (n_nodes).
    integer, allocatable, intent(out) :: number(:)
    logical, allocatable :: holds(:), nothing(:)
    integer, allocatable :: node(:)
    call surface_part(body%mesh, holds, node)
    allocate (nothing(body%mesh%n_nodes()), source=.false.)
    call hold_body(body, holds, spread(.false., 1, size(holds)), nothing, number)
  end subroutine hold_surface

  !> Reduce a body to some of its elements, and its surface.
  subroutine hold_body(body, holds, own_element, own_node, number)
    type(body_t), intent(inout) :: body  !! The body, with supports and loads, not assembled.
    logical, intent(in) :: holds(:), own_element(:)  !! Whether each element is held, and of this rank (n_elements).
    logical, intent(in) :: own_node(:)  !! Whether this rank computes each node (n_nodes).
    integer, allocatable, intent(out) :: number(:)  !! As in `hold_surface`.
    type(whole_body_t) :: whole
    integer, allocatable :: of_element(:)
    integer :: e, n
    call describe_whole(body%mesh, shortest_extent(body%mesh), whole)
    call hold_part(body%mesh, whole, holds, own_element, own_node, number)
    call body%hold_nodes(body%mesh%whole%node)
    allocate (of_element(size(holds)), source=0)
    n = 0
    do e = 1, size(holds)
      if (.not. holds(e)) cycle
      n = n + 1
      of_element(e) = n
    end do
    call body%applied%hold(of_element)
    if (.not. allocated(body%of_case)) return
    do n = 1, size(body%of_case)
      call body%of_case(n)%applied%hold(of_element)
    end do
  end subroutine hold_body
end module dotyk_elasticity_body
