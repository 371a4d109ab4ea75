!> A namelist file as plain data, checked as far as possible without a mesh.
!>
!> Conventions. Paths lead from the working directory to the file. References are indices. Vectors have three
!> components: x, y, z in global axes, xi, eta, n in the axes of a surface; in two dimensions the third (global) or
!> second (local, eta) is zero. A formula that is not given is an array of size 0 or an empty text; one that is given is
!> correct.
!> `line` is the line of the namelist file where the group begins.
module dotyk_input_case
  use dotyk_base_directions, only: directions_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: default_analysis, default_budget_fraction, default_discretization, default_gamma_rule, &
    default_gap, default_geometry, default_linear_solver, default_locking, default_max_iterations, &
    default_max_unbalanced, default_quadrature, default_response, default_scheme, default_stop_rule, default_theta, &
    default_tolerance, load_traction, material_isotropic
  use dotyk_base_text, only: quoted, text_t
  use dotyk_input_body, only: body_input_t
  use dotyk_input_load_case, only: applies_in, contact_case_input_t, load_case_input_t
  use dotyk_input_tie, only: tie_input_t
  implicit none
  private

  !> `&scene`.
  type, public :: scene_input_t
    !> Line of the group.
    integer :: line = 0
    !> Title; may be empty.
    character(:), allocatable :: title
    !> Mesh of the bodies that name none of their own; empty where it is not given.
    character(:), allocatable :: mesh
    !> Size of the elements of CAD files; 0 where it is not given [length].
    real(dp) :: mesh_size = 0
    !> Their order.
    integer :: mesh_order = 2
    !> Results file.
    character(:), allocatable :: output
    !> One of `analysis_*`.
    integer :: analysis = default_analysis
    !> Dimension of space, 2 or 3; 0 where the analysis has a mistake.
    integer :: dimension = 3
  end type scene_input_t

  !> `&material`.
  type, public :: material_input_t
    !> Line of the group.
    integer :: line = 0
    !> Name that bodies refer to.
    character(:), allocatable :: name
    !> One of `material_*`: decides which of the components below are used.
    integer :: kind = material_isotropic
    !> Young's modulus; isotropic: the first; orthotropic: along the axes 1, 2, 3 (3) [pressure].
    real(dp) :: young(3) = 0
    !> Poisson's ratio; isotropic: the first; orthotropic: 12, 13, 23 (3) [].
    real(dp) :: poisson(3) = 0
    !> Shear moduli 12, 13, 23 of an orthotropic material (3) [pressure].
    real(dp) :: shear(3) = 0
    !> Axis 1 of an orthotropic or anisotropic material, as written, not of unit length (3) [].
    real(dp) :: axis_1(3) = [1.0_dp, 0.0_dp, 0.0_dp]
    !> A direction in the plane of its axes 1 and 2, as written; not parallel to axis 1 (3) [].
    real(dp) :: axis_2(3) = [0.0_dp, 1.0_dp, 0.0_dp]
    !> Upper triangle of the elasticity matrix by rows (21), order 11 22 33 23 13 12 of the material axes
    !> [pressure].
    real(dp) :: stiffness(21) = 0
    !> Modulus field: factor of the elasticity matrix; empty where there is none.
    character(:), allocatable :: young_formula
    !> Formulas of young and poisson; of young, poisson and shear; or of stiffness: empty where the number holds; not
    !> allocated where none has a formula (2, 9 or 21).
    type(text_t), allocatable :: stiffness_formula(:)
    !> Formulas of the expansion (0, 1 or 3).
    type(text_t), allocatable :: expansion_formula(:)
    !> Formula of the density; empty where there is none.
    character(:), allocatable :: density_formula
    !> Density; 0 where it is not given [mass/volume].
    real(dp) :: density = 0
    !> Coefficients of thermal expansion along the axes 1, 2, 3 (3) [1/temperature].
    real(dp) :: expansion(3) = 0
    !> Whether they are given.
    logical :: expands = .false.
  end type material_input_t

  !> `&support`, or `&spring`: an elastic one.
  type, public :: support_input_t
    !> Line of the group.
    integer :: line = 0
    !> Index of the body.
    integer :: body = 0
    !> Whether wildcards name the body: of these bodies, those without the surface have no such support.
    logical :: any_body = .false.
    !> Physical group of the surface; with wildcards, the union of those that the body has.
    character(:), allocatable :: surface
    !> Directions of prescribed displacements.
    type(directions_t) :: fix
    !> Prescribed displacement in the axes of `fix` (3) [length]; zero in other directions.
    real(dp) :: value(3) = 0
    !> Formulas of the given displacement (3), or none.
    type(text_t), allocatable :: value_formula(:)
    !> Whether it is a spring; exactly one of its foundation modulus [pressure/length] and its total stiffness
    !> [force/length] is not 0 then.
    logical :: is_spring = .false.
    real(dp) :: modulus = 0, stiffness = 0
    !> Load cases that it belongs to; not allocated where these are all (n_cases).
    logical, allocatable :: in_case(:)
  end type support_input_t

  !> `&load`.
  type, public :: load_input_t
    !> Line of the group.
    integer :: line = 0
    !> Index of the body.
    integer :: body = 0
    !> Whether wildcards name the body: of these bodies, those without the surface have no such load.
    logical :: any_body = .false.
    !> Physical group of the surface, as in `support_input_t`; empty for a force density and an angular
    !> velocity.
    character(:), allocatable :: surface
    !> One of `load_*`.
    integer :: kind = load_traction
    !> Constant value, a pressure in the first component or a vector (3) [pressure, force/volume, 1/time, force/mass, or
    !> force of `load_total`].
    real(dp) :: value(3) = 0
    !> Moment of `load_total` (3) [force length].
    real(dp) :: moment(3) = 0
    !> Whether the point that force and moment refer to is given; else the centroid of the surface.
    logical :: has_point = .false.
    !> This point (3) [length].
    real(dp) :: point(3) = 0
    !> A point on the axis of an angular velocity (3) [length].
    real(dp) :: centre(3) = 0
    !> Formulas: 1 for a pressure, 3 for vectors, or none (n_formulas).
    type(text_t), allocatable :: formula(:)
    !> Whether it is the force of a `&mass` under an acceleration or a rotation of its body.
    logical :: of_mass = .false.
    !> Load cases that it belongs to; not allocated where these are all (n_cases).
    logical, allocatable :: in_case(:)
  end type load_input_t

  !> `&rigid_body`.
  type, public :: rigid_input_t
    !> Line of the group.
    integer :: line = 0
    !> Index of the body.
    integer :: body = 0
    !> Whether the displacements x, y, z of the point and the rotations about it are held (6).
    logical :: held(6) = .false.
    !> Their values (6) [length, radian].
    real(dp) :: motion(6) = 0
    !> The point (3) [length].
    real(dp) :: point(3) = 0
    !> Load cases with these values; not allocated where these are all (n_cases).
    logical, allocatable :: in_case(:)
  end type rigid_input_t

  !> `&temperature` or `&initial_stress`.
  type, public :: field_input_t
    !> Line of the group.
    integer :: line = 0
    !> Index of the body.
    integer :: body = 0
    !> Whether wildcards name it, maybe among others.
    logical :: any_body = .false.
    !> Constant value: a temperature in the first component [temperature], or stresses in the order xx yy zz xy yz xz
    !> [pressure] (6).
    real(dp) :: value(6) = 0
    !> Formulas: 1 or 6, or none (n_formulas).
    type(text_t), allocatable :: formula(:)
    !> Array of the points of the mesh that has the temperature, and that of the unstressed body; empty where there is
    !> none [temperature].
    character(:), allocatable :: array
    real(dp) :: reference = 0
    !> Load cases that it belongs to; not allocated where these are all (n_cases).
    logical, allocatable :: in_case(:)
  end type field_input_t

  !> Pairs of bodies that no contact pair is found for.
  type, public :: exclusion_t
    !> Name of a body, maybe with wildcards.
    character(:), allocatable :: a
    !> Name of the other body, maybe with wildcards.
    character(:), allocatable :: b
  end type exclusion_t

  !> `&contact`.
  type, public :: contact_input_t
    !> Line of the group.
    integer :: line = 0
    !> Name of the contact pair; empty where `auto` has none.
    character(:), allocatable :: name
    !> Whether the group stands for all pairs of `bodies_a` and `bodies_b` that the search for near faces finds.
    logical :: searched = .false.
    !> Whether these are pairs of any bodies and faces; else the surfaces are named.
    logical :: auto = .false.
    !> Whether the search has found the pair.
    logical :: found = .false.
    !> Where the group is searched: bodies that the slave side names (n); all bodies for `auto`.
    integer, allocatable :: bodies_a(:)
    !> Bodies that the master side names, likewise (n).
    integer, allocatable :: bodies_b(:)
    !> Where the group is searched: excluded pairs of bodies, as names with wildcards, in any order.
    type(exclusion_t), allocatable :: exclude(:)
    !> Index of the body of the slave side.
    integer :: body_a = 0
    !> Index of the body of the master side; another one.
    integer :: body_b = 0
    !> Physical group of the slave surface; with wildcards, the union of those that the body has; empty for `auto`.
    character(:), allocatable :: surface_a
    !> Physical group of the master surface, likewise.
    character(:), allocatable :: surface_b
    !> One of `gap_*`.
    integer :: gap_kind = default_gap
    !> Initial gap where it is constant [length].
    real(dp) :: gap = 0
    !> Initial gap where it is a formula; else empty.
    character(:), allocatable :: gap_formula
    !> One of `theta_*`; that of `&solver` where the pair has none of its own.
    integer :: theta_kind = default_theta
    !> Penalty parameter [length/pressure], or its factor [] where it is relative; 1 where it is a formula.
    real(dp) :: theta = 0
    !> Penalty parameter where it is a formula; else empty.
    character(:), allocatable :: theta_formula
    !> Initial gap up to which its constraints have Robin conditions in the Robin scheme: `huge` for all, `-huge` for
    !> none [length].
    real(dp) :: robin_gap = huge(1.0_dp)
    !> Whether theta is given, for this pair or in `&solver`; the error budget may reduce a default.
    logical :: theta_given = .false.
    !> Whether theta is the compliance of a real elastic layer, not a penalty.
    logical :: is_layer = .false.
    !> Whether a search radius is given.
    logical :: has_search_radius = .false.
    !> Greatest distance between a point and its projection [length].
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
    !> Penalty parameter [length/pressure], or its factor [] where it is relative.
    real(dp) :: theta = 0
    !> As in `contact_input_t`, for pairs without their own [length].
    real(dp) :: robin_gap = huge(1.0_dp)
    !> Whether theta is given.
    logical :: theta_given = .false.
    !> One of `gamma_*`.
    integer :: gamma_rule = default_gamma_rule
    !> One of `linear_solver_*`.
    integer :: linear_solver = default_linear_solver
    !> One of `response_*`.
    integer :: response = default_response
    !> Relaxation parameter []; 0 where the rule is not `gamma_fixed`.
    real(dp) :: gamma = 0
    !> One of `stop_*`.
    integer :: stop_rule = default_stop_rule
    !> Iteration error as a fraction of the other errors where the rule is `stop_budget` [].
    real(dp) :: budget_fraction = default_budget_fraction
    !> Relative error in the energy norm at which the iteration stops [].
    real(dp) :: tolerance = default_tolerance
    !> Forces along motions that contact does not determine, as a fraction of the forces on the body [].
    real(dp) :: max_unbalanced = default_max_unbalanced
    !> Greatest number of iterations.
    integer :: max_iterations = default_max_iterations
    !> One of `locking_*`.
    integer :: locking = default_locking
    !> Whether results have the same digits on any number of threads.
    logical :: reproducible = .false.
  end type solver_input_t

  !> `&output`.
  type, public :: output_input_t
    !> Line of the group; 0 where it is not in the file.
    integer :: line = 0
    !> Whether the displacement is written.
    logical :: displacement = .false.
    !> Whether the stress is written.
    logical :: stress = .false.
    !> Whether contact pressure, traction, gap and status are written.
    logical :: contact = .false.
    !> Whether reactions of supports are written.
    logical :: reaction = .false.
    !> Whether stresses at the nodes are written.
    logical :: nodal_stress = .false.
    !> Whether the discretization error of the elements is written.
    logical :: error = .false.
    !> Whether the penalty error is estimated.
    logical :: error_penalty = .false.
    !> Whether the discretization error is estimated.
    logical :: error_discretization = .false.
    !> Iteration time between intermediate results [s]; 0: results are written at the end.
    real(dp) :: interval = 0
  end type output_input_t

  !> The whole file.
  type, public :: case_t
    !> Path of the namelist file, as named by the user; its directory with a slash at the end, or empty.
    character(:), allocatable :: file, directory
    !> The whole text of the file.
    character(:), allocatable :: text
    !> Lines for the log on what the file says (n_remarks).
    type(text_t), allocatable :: remark(:)
    !> Whether geometries may start no program and write no file but their mesh (command line).
    logical :: no_shell = .false.
    !> `&scene`.
    type(scene_input_t) :: scene
    !> Materials in the order of the file, at least one (n_materials).
    type(material_input_t), allocatable :: material(:)
    !> Bodies in the order of the file, at least one (n_bodies).
    type(body_input_t), allocatable :: body(:)
    !> Supports in the order of the file, then springs (n_supports).
    type(support_input_t), allocatable :: support(:)
    !> Loads in the order of the file, then those of point masses (n_loads).
    type(load_input_t), allocatable :: load(:)
    !> Rigid bodies (n_rigid).
    type(rigid_input_t), allocatable :: rigid(:)
    !> Temperatures, and initial stresses, in the order of the file, no two of one body and load case (number of these).
    type(field_input_t), allocatable :: temperature(:), initial_stress(:)
    !> Contact pairs in the order of the file (n_pairs).
    type(contact_input_t), allocatable :: contact(:)
    !> Ties in the order of the file, bolts after them (n_ties).
    type(tie_input_t), allocatable :: tie(:)
    !> Load cases in the order of the file; of size 0 or not allocated where it has none (n_cases).
    type(load_case_input_t), allocatable :: load_case(:)
    !> Gaps and penalty parameters by load cases, in the order of the file (n_contact_cases).
    type(contact_case_input_t), allocatable :: contact_case(:)
    !> `&solver`; defaults where the file has none.
    type(solver_input_t) :: solver
    !> `&output`; defaults where the file has none.
    type(output_input_t) :: output
  contains
    procedure :: n_cases => case_n_cases
    procedure :: has_cases => case_has_cases
    procedure :: in_case_text => case_in_case_text
  end type case_t

  public :: applies_in, body_input_t, contact_case_input_t, load_case_input_t, tie_input_t

contains

  !> Number of load cases: at least one.
  pure integer function case_n_cases(self) result(n)
    class(case_t), intent(in) :: self
    n = 1
    if (self%has_cases()) n = size(self%load_case)
  end function case_n_cases

  !> Whether load cases are named.
  pure logical function case_has_cases(self) result(has)
    class(case_t), intent(in) :: self
    has = allocated(self%load_case)
    if (has) has = size(self%load_case) > 0
  end function case_has_cases

  !> " in case 'braked'", for messages; empty where load cases have no names.
  function case_in_case_text(self, k) result(text)
    class(case_t), intent(in) :: self
    !> The load case.
    integer, intent(in) :: k
    character(:), allocatable :: text
    text = ''
    if (self%has_cases()) text = ' in case '//quoted(self%load_case(k)%name)
  end function case_in_case_text
end module dotyk_input_case
