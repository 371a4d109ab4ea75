!> A scene as plain data: what a namelist file says, checked as far as that goes without a mesh.
!>
!> Conventions. Paths are resolved: they lead from the working directory to the file. References are resolved to
!> indices. Vectors have three components: x, y, z in global axes, xi, eta, n in the axes of a surface; in two
!> dimensions the third (global) or second (local, eta) is zero. A formula that is not given is an array of size 0 or
!> an empty text; one that is given was parsed once without an error. `line` is the line of the namelist file where
!> the group begins.
module dotyk_input_case
  use dotyk_base_directions, only: directions_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: default_analysis, default_budget_fraction, default_discretization, default_gamma_rule, &
    default_gap, default_geometry, default_linear_solver, default_locking, default_max_iterations, default_quadrature, &
    default_response, default_scheme, default_stop_rule, default_theta, default_tolerance, load_traction, &
    material_isotropic
  use dotyk_base_text, only: text_t
  implicit none
  private

  !> `&scene`.
  type, public :: scene_input_t
    !> Line of the group.
    integer :: line = 0
    !> For people; may be empty.
    character(:), allocatable :: title
    !> Mesh of the bodies that name none of their own; empty where there is none.
    character(:), allocatable :: mesh
    !> Results file.
    character(:), allocatable :: output
    !> One of `analysis_*`.
    integer :: analysis = default_analysis
    !> 2 or 3.
    integer :: dimension = 3
  end type scene_input_t

  !> `&material`.
  type, public :: material_input_t
    !> Line of the group.
    integer :: line = 0
    character(:), allocatable :: name
    !> One of `material_*`: which of the components below mean something.
    integer :: kind = material_isotropic
    !> Young's modulus [pressure]; isotropic: the first; orthotropic: along the axes 1, 2, 3.
    real(dp) :: young(3) = 0
    !> Poisson's ratio [1]; isotropic: the first; orthotropic: 12, 13, 23.
    real(dp) :: poisson(3) = 0
    !> Shear moduli 12, 13, 23 of an orthotropic material [pressure].
    real(dp) :: shear(3) = 0
    !> Axis 1 of an orthotropic material, as written (not of unit length).
    real(dp) :: axis_1(3) = [1.0_dp, 0.0_dp, 0.0_dp]
    !> A direction in the plane of its axes 1 and 2, as written; not parallel to axis 1.
    real(dp) :: axis_2(3) = [0.0_dp, 1.0_dp, 0.0_dp]
    !> Upper triangle of the stiffness by rows, order xx yy zz yz xz xy [pressure].
    real(dp) :: stiffness(21) = 0
    !> Factor on the stiffness; empty where there is none.
    character(:), allocatable :: young_formula
  end type material_input_t

  !> `&body`.
  type, public :: body_input_t
    !> Line of the group.
    integer :: line = 0
    character(:), allocatable :: name
    !> Physical name of its elements in the mesh.
    character(:), allocatable :: volume
    !> Index of its material.
    integer :: material = 0
    !> Its mesh: its own, or that of the scene.
    character(:), allocatable :: mesh
    !> Where the origin of the mesh is placed [length].
    real(dp) :: at(3) = 0
    !> Axis through the origin of the mesh, as written, about which the body is turned before, and the angle [degrees].
    real(dp) :: axis(3) = [0.0_dp, 0.0_dp, 1.0_dp]
    real(dp) :: angle = 0
  end type body_input_t

  !> `&support`.
  type, public :: support_input_t
    !> Line of the group.
    integer :: line = 0
    !> Index of the body.
    integer :: body = 0
    !> Physical name of the surface.
    character(:), allocatable :: surface
    !> Directions of prescribed displacements.
    type(directions_t) :: fix
    !> Prescribed displacement in the axes of `fix` (3) [length]; zero in other directions.
    real(dp) :: value(3) = 0
    !> Formulas of the given displacement (3), or none.
    type(text_t), allocatable :: value_formula(:)
  end type support_input_t

  !> `&load`.
  type, public :: load_input_t
    !> Line of the group.
    integer :: line = 0
    !> Index of the body.
    integer :: body = 0
    !> Physical name of the surface; empty for a force density.
    character(:), allocatable :: surface
    !> One of `load_*`.
    integer :: kind = load_traction
    !> Its constant value [pressure, or force per volume]: a pressure in the first component, else a vector.
    real(dp) :: value(3) = 0
    !> Its formulas: 1 for a pressure, 3 else; or none.
    type(text_t), allocatable :: formula(:)
  end type load_input_t

  !> `&contact`.
  type, public :: contact_input_t
    !> Line of the group.
    integer :: line = 0
    character(:), allocatable :: name
    !> Indices of the two bodies; never equal.
    integer :: body_a = 0, body_b = 0
    !> Physical names of the two surfaces.
    character(:), allocatable :: surface_a, surface_b
    !> One of `gap_*`.
    integer :: gap_kind = default_gap
    !> The gap where it is constant [length].
    real(dp) :: gap = 0
    !> The gap where it is a formula; else empty.
    character(:), allocatable :: gap_formula
    !> One of `theta_*`; that of `&solver` where the pair has none of its own.
    integer :: theta_kind = default_theta
    !> Penalty parameter [length/pressure], or the factor of the relative one [1].
    real(dp) :: theta = 0
    !> Was it given, for the pair or for all? If not, it may be made smaller.
    logical :: theta_given = .false.
    !> Is there a search radius?
    logical :: has_search_radius = .false.
    !> Greatest distance of partners [length].
    real(dp) :: search_radius = 0
    !> One of `discretization_*`.
    integer :: discretization = default_discretization
    !> One of `geometry_*`.
    integer :: geometry = default_geometry
    !> One of `quadrature_*`.
    integer :: quadrature = default_quadrature
  end type contact_input_t

  !> `&solver`.
  type, public :: solver_input_t
    !> Line of the group; 0 where it is not in the file.
    integer :: line = 0
    !> One of `scheme_*`.
    integer :: scheme = default_scheme
    !> One of `theta_*`.
    integer :: theta_kind = default_theta
    !> Penalty parameter [length/pressure], or the factor of the relative one [1].
    real(dp) :: theta = 0
    !> Was it given?
    logical :: theta_given = .false.
    !> One of `gamma_*`.
    integer :: gamma_rule = default_gamma_rule
    !> One of `linear_solver_*`.
    integer :: linear_solver = default_linear_solver
    !> One of `response_*`.
    integer :: response = default_response
    !> Relaxation parameter [1]; 0 where the rule is not `gamma_fixed`.
    real(dp) :: gamma = 0
    !> One of `stop_*`.
    integer :: stop_rule = default_stop_rule
    !> Part of the other errors that the iteration may add where the rule is `stop_budget` [1].
    real(dp) :: budget_fraction = default_budget_fraction
    !> Where to stop [1].
    real(dp) :: tolerance = default_tolerance
    !> Most iterations.
    integer :: max_iterations = default_max_iterations
    !> One of `locking_*`.
    integer :: locking = default_locking
    !> The same digits on any number of threads?
    logical :: reproducible = .false.
  end type solver_input_t

  !> `&output`.
  type, public :: output_input_t
    !> Line of the group; 0 where it is not in the file.
    integer :: line = 0
    !> Is the displacement wanted?
    logical :: displacement = .false.
    !> Is the stress wanted?
    logical :: stress = .false.
    !> Is the contact pressure wanted?
    logical :: contact = .false.
    !> Is the discretization error of the elements wanted?
    logical :: error = .false.
    !> Which errors are to be estimated?
    logical :: error_penalty = .false., error_discretization = .false.
    !> Iteration time between results that are written on the way; 0: none are [s].
    real(dp) :: interval = 0
  end type output_input_t

  !> The whole scene.
  type, public :: case_t
    !> The namelist file, as named by the user.
    character(:), allocatable :: file
    !> Its directory with a slash at the end; empty for the working directory.
    character(:), allocatable :: directory
    !> The whole text of the file.
    character(:), allocatable :: text
    type(scene_input_t) :: scene
    !> At least one each of materials and bodies.
    type(material_input_t), allocatable :: material(:)
    type(body_input_t), allocatable :: body(:)
    !> Any number of the others, in the order of the file.
    type(support_input_t), allocatable :: support(:)
    type(load_input_t), allocatable :: load(:)
    type(contact_input_t), allocatable :: contact(:)
    type(solver_input_t) :: solver
    type(output_input_t) :: output
  end type case_t
end module dotyk_input_case
