!> A namelist file as plain data, checked as far as possible without a mesh.
!>
!> Conventions. Paths lead from the working directory to the file. References are indices. Vectors have three
!> components: x, y, z in global axes, xi, eta, n in the axes of a surface; in two dimensions the third (global) or
!> second (local, eta) is zero. A formula that is not given is an array of size 0 or an empty text; one that is given is
!> correct.
!> `line` is the line of the namelist file where the group begins.
!>
!> A bolt cuts no elements: those whose centre lies ahead of a plane make up one half of a body, the others the other
!> one; or those on both sides of a surface inside the body. The halves are two bodies; what the input says of the whole
!> holds for each of them.
module dotyk_input_case
  use dotyk_base_directions, only: directions_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: aim_energy, default_analysis, default_discretization, default_gamma_rule, default_gap, &
    default_geometry, default_linear_solver, default_locking, default_max_iterations, default_max_unbalanced, &
    default_quadrature, default_response, default_scheme, default_stop_rule, default_theta, default_tolerance, &
    load_traction, material_isotropic, n_fields, quantity_force
  use dotyk_base_place, only: place_t
  use dotyk_base_rotation, only: rotation_matrix
  use dotyk_base_text, only: quoted, text_t
  use dotyk_base_thresholds, only: rounding
  implicit none
  private
  public :: applies_in, share_a_case

  type, public :: scene_input_t  !! `&scene`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: title  !! Title; may be empty.
    character(:), allocatable :: mesh  !! Mesh of the bodies that name none of their own; empty where it is not given.
    real(dp) :: mesh_size = 0  !! Size of the elements of CAD files; 0 where it is not given [length].
    integer :: mesh_order = 2  !! Their order.
    character(:), allocatable :: output  !! Results file.
    integer :: analysis = default_analysis  !! One of `analysis_*`.
    integer :: dimension = 3  !! Dimension of space, 2 or 3; 0 where the analysis has a mistake.
  end type scene_input_t

  type, public :: action_t  !! What groups about bodies have in common: one for each body that a group names.
    integer :: line = 0  !! Line of the group.
    integer :: body = 0  !! Index of the body.
    !> Whether wildcards name the body: of these bodies, those without the place have no such support, load or size.
    logical :: any_body = .false.
    type(place_t) :: place  !! Where on the body; without a name for the whole body.
    logical, allocatable :: in_case(:)  !! Load cases that it belongs to; not allocated where these are all (n_cases).
  end type action_t

  type, public, extends(action_t) :: mesh_size_input_t  !! `&mesh_size` of one body.
    !> Size of the elements of the body or face, and of those at its contact pairs; 0 where it is not given [length].
    real(dp) :: size = 0, contact = 0
  end type mesh_size_input_t

  type, public :: accuracy_input_t  !! `&accuracy`.
    integer :: line = 0  !! Line of the group.
    logical :: is_given = .false.  !! Whether the file has the group.
    real(dp) :: error = 0  !! Relative error in the energy norm that is asked for [].
    integer :: aim = aim_energy  !! One of `aim_*`.
    integer :: max_meshes = 0  !! Meshes at most.
    integer :: max_unknowns = 0  !! Unknowns of a mesh at most.
    real(dp) :: max_seconds = 0  !! Time from which on no mesh begins; 0 where it is not given [s].
  end type accuracy_input_t

  type, public :: quantity_input_t  !! A quantity of `&output` or `&accuracy`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: text  !! As written.
    integer :: kind = quantity_force  !! One of `quantity_*`.
    logical :: is_goal = .false.  !! Whether meshes are made until its error is small enough.
    character(:), allocatable :: name  !! Name of a contact pair or `body - body`; or of the body: maybe with wildcards.
    character(:), allocatable :: surface  !! Physical group of the face or support, maybe with wildcards.
    integer :: axis = 0  !! Component of displacement or reaction.
    logical :: any_body = .false.  !! Whether wildcards name the body: those without the surface have no such quantity.
    integer, allocatable :: body(:)  !! Bodies of displacements and reactions (n).
  end type quantity_input_t

  type, public :: material_input_t  !! `&material`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: name  !! Name that bodies refer to.
    integer :: kind = material_isotropic  !! One of `material_*`: decides which of the components below are used.
    real(dp) :: young(3) = 0  !! Young's modulus; isotropic: the first; orthotropic: along the axes 1, 2, 3 [pressure].
    real(dp) :: poisson(3) = 0  !! Poisson's ratio; isotropic: the first; orthotropic: 12, 13, 23 (3) [].
    real(dp) :: shear(3) = 0  !! Shear moduli 12, 13, 23 of an orthotropic material (3) [pressure].
    real(dp) :: axis_1(3) = [1.0_dp, 0.0_dp, 0.0_dp]  !! Axis 1 of the material, as written, not of unit length (3) [].
    real(dp) :: axis_2(3) = [0.0_dp, 1.0_dp, 0.0_dp]  !! In the plane of axes 1 and 2, as written; not along axis 1 [].
    !> Upper triangle of the elasticity matrix by rows (21), order 11 22 33 23 13 12 of the material axes
    !> [pressure].
    real(dp) :: stiffness(21) = 0
    character(:), allocatable :: young_formula  !! Modulus field: factor of elasticity; empty where none.
    !> Formulas of young and poisson; of young, poisson and shear; or of stiffness: empty where the number holds; not
    !> allocated where none has a formula (2, 9 or 21).
    type(text_t), allocatable :: stiffness_formula(:)
    type(text_t), allocatable :: expansion_formula(:)  !! Formulas of the expansion (0, 1 or 3).
    character(:), allocatable :: density_formula  !! Formula of the density; empty where there is none.
    real(dp) :: density = 0  !! Density; 0 where it is not given [mass/volume].
    real(dp) :: expansion(3) = 0  !! Coefficients of thermal expansion along the axes 1, 2, 3 (3) [1/temperature].
    logical :: expands = .false.  !! Whether they are given.
  end type material_input_t

  type, public :: cut_input_t  !! Which half a body is of which whole.
    integer :: line = 0  !! Line of the `&bolt`; 0 for a body that is not cut.
    integer :: half = 0  !! Half: 1 behind the plane, 2 ahead of it, where its normal points to.
    character(:), allocatable :: whole  !! Name of the body that is cut.
    !> A point of the plane (3) [length], and its normal, of length 1 (3) []; of bodies in place.
    real(dp) :: point(3) = 0, normal(3) = 0
    character(:), allocatable :: surface  !! Surface inside the body; empty where a plane is given.
  contains
    procedure :: is_cut => cut_is_cut
    procedure :: same_as => cut_same_as
    procedure :: place_back => cut_place_back
  end type cut_input_t

  type, public :: body_input_t  !! `&body`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: name  !! Name that other groups refer to.
    !> Physical group of its elements in the mesh; of several ones the name of their union: those of one material
    !> joined by `, `, materials by `; `.
    character(:), allocatable :: volume
    type(text_t), allocatable :: volumes(:)  !! The physical groups (n_volumes).
    integer, allocatable :: material_of(:)  !! Number of the material of each of them in `material` (n_volumes).
    integer, allocatable :: material(:)  !! Indices of its materials, each once; 0 for an unknown one (n_materials).
    character(:), allocatable :: mesh  !! Its mesh: its own, or that of the scene.
    real(dp) :: at(3) = 0  !! Position of the origin of its mesh (3) [length].
    !> Axis through the origin of the mesh about which the body is rotated first, as written (3) []; angle [degrees].
    real(dp) :: axis(3) = [0.0_dp, 0.0_dp, 1.0_dp], angle = 0
    logical :: crack = .false.  !! Whether faces of the body that touch without common nodes are a crack that is meant.
    !> Whether it has no volume: its groups are those of a surface, and it is rigid; whether a point is given that sees
    !> the side of contact of this surface.
    logical :: is_surface = .false., has_facing = .false.
    real(dp) :: facing(3) = 0  !! This point, in coordinates of the mesh (3) [length].
    type(cut_input_t) :: cut  !! Which half it is of a body that a bolt cuts.
  contains
    procedure :: has_shape_of => body_input_has_shape_of
  end type body_input_t

  type, public, extends(action_t) :: support_input_t  !! `&support`, or `&spring`: an elastic one.
    type(directions_t) :: fix  !! Directions of prescribed displacements.
    real(dp) :: value(3) = 0  !! Prescribed displacement in the axes of `fix` (3) [length]; zero in other directions.
    type(text_t), allocatable :: value_formula(:)  !! Formulas of the given displacement (3), or none.
    !> Whether it is a spring; exactly one of its foundation modulus [pressure/length] and its total stiffness
    !> [force/length] is not 0 then.
    logical :: is_spring = .false.
    real(dp) :: modulus = 0, stiffness = 0
  end type support_input_t

  type, public, extends(action_t) :: load_input_t  !! `&load`.
    integer :: kind = load_traction  !! One of `load_*`.
    !> Constant value, a pressure in the first component or a vector (3) [pressure, force/volume, 1/time, force/mass, or
    !> force of `load_total`].
    real(dp) :: value(3) = 0
    real(dp) :: moment(3) = 0  !! Moment of `load_total` (3) [force length].
    logical :: has_point = .false.  !! Whether the point of force and moment is given; else the centroid.
    real(dp) :: point(3) = 0  !! This point (3) [length].
    real(dp) :: centre(3) = 0  !! A point on the axis of an angular velocity (3) [length].
    type(text_t), allocatable :: formula(:)  !! Formulas: 1 for a pressure, 3 for vectors, or none (n_formulas).
    logical :: of_mass = .false.  !! Whether it is a `&mass` under acceleration or rotation of its body.
  end type load_input_t

  type, public, extends(action_t) :: rigid_input_t  !! `&rigid_body`.
    logical :: held(6) = .false.  !! Whether the displacements x, y, z of the point and the rotations about it are held.
    real(dp) :: motion(6) = 0  !! Their values (6) [length, radian].
    real(dp) :: point(3) = 0  !! The point (3) [length].
  end type rigid_input_t

  type, public, extends(action_t) :: field_input_t  !! `&temperature` or `&initial_stress`.
    !> Constant value: a temperature in the first component [temperature], or stresses in the order xx yy zz xy yz xz
    !> [pressure] (6).
    real(dp) :: value(6) = 0
    type(text_t), allocatable :: formula(:)  !! Formulas: 1 or 6, or none (n_formulas).
    !> Array of the points of the mesh that has the temperature, and that of the unstressed body; empty where there is
    !> none [temperature].
    character(:), allocatable :: array
    real(dp) :: reference = 0
  end type field_input_t

  type, public :: exclusion_t  !! Pairs of bodies that no contact pair is found for.
    character(:), allocatable :: a  !! Name of a body, maybe with wildcards.
    character(:), allocatable :: b  !! Name of the other body, maybe with wildcards.
  end type exclusion_t

  type, public :: contact_input_t  !! `&contact`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: name  !! Name of the contact pair; empty where `auto` has none.
    !> Whether the group stands for all pairs of `bodies_a` and `bodies_b` that the search for near faces finds.
    logical :: searched = .false.
    logical :: auto = .false.  !! Whether these are pairs of any bodies and faces; else the surfaces are named.
    logical :: found = .false.  !! Whether the search has found the pair.
    integer, allocatable :: bodies_a(:)  !! Where it is searched: bodies of the slave side (n); all for `auto`.
    integer, allocatable :: bodies_b(:)  !! Bodies that the master side names, likewise (n).
    !> Where the group is searched: excluded pairs of bodies, as names with wildcards, in any order.
    type(exclusion_t), allocatable :: exclude(:)
    integer :: body_a = 0  !! Index of the body of the slave side.
    integer :: body_b = 0  !! Index of the body of the master side; another one.
    !> Physical group of the slave surface; with wildcards, the union of those that the body has; empty for `auto`.
    character(:), allocatable :: surface_a
    character(:), allocatable :: surface_b  !! Physical group of the master surface, likewise.
    integer :: gap_kind = default_gap  !! One of `gap_*`.
    real(dp) :: gap = 0  !! Initial gap where it is constant [length].
    character(:), allocatable :: gap_formula  !! Initial gap where it is a formula; else empty.
    integer :: theta_kind = default_theta  !! One of `theta_*`; that of `&solver` where the pair has none of its own.
    real(dp) :: theta = 0  !! Penalty parameter [length/pressure], or factor [] of a relative one; 1: by formula.
    character(:), allocatable :: theta_formula  !! Penalty parameter where it is a formula; else empty.
    !> Initial gap up to which its constraints have Robin conditions in the Robin scheme: `huge` for all, `-huge` for
    !> none [length].
    real(dp) :: robin_gap = huge(1.0_dp)
    logical :: theta_given = .false.  !! Whether theta is given, for this pair or in `&solver`.
    logical :: is_layer = .false.  !! Whether theta is the compliance of a real elastic layer, not a penalty.
    logical :: has_search_radius = .false.  !! Whether a search radius is given.
    real(dp) :: search_radius = 0  !! Greatest distance between a point and its projection [length].
    integer :: discretization = default_discretization  !! One of `discretization_*`.
    integer :: geometry = default_geometry  !! One of `geometry_*`.
    integer :: quadrature = default_quadrature  !! One of `quadrature_*`.
  contains
    procedure :: exchange => contact_exchange
  end type contact_input_t

  type, public :: tie_input_t  !! `&tie` or `&bolt`.
    integer :: line = 0  !! Line of the group.
    !> Whether it is a bolt, pulled together along the normal of its surfaces: until it transmits `force`, or by
    !> `shortening`.
    logical :: is_bolt = .false., has_force = .false.
    !> Whether it is the cut of a body that a `&bolt` divides: the meshes of both sides are one, and `axis` is its
    !> normal where a plane is given.
    logical :: is_cut = .false.
    real(dp) :: force = 0  !! Tension [force].
    !> Load cases in which `force` acts; in those after them the bolt is locked; all cases where not allocated
    !> (n_cases).
    logical, allocatable :: in_case(:)
    real(dp) :: shortening = 0  !! Length that is taken out of the bolt [length].
    !> Rotation of the master side to the slave side, for cyclic symmetry: axis as written (3) [], and angle [degrees].
    real(dp) :: axis(3) = [0.0_dp, 0.0_dp, 1.0_dp], angle = 0
    real(dp) :: centre(3) = 0  !! A point on the axis (3) [length].
    character(:), allocatable :: name  !! Name of the tie.
    integer :: body_a = 0, body_b = 0  !! Indices of the bodies of the slave and of the master side.
    !> Physical groups of the surfaces; with wildcards, the union of those that the body has.
    character(:), allocatable :: surface_a, surface_b
    real(dp) :: search_radius = 0  !! Greatest distance that is tied; 0: half a facet [length].
  contains
    procedure :: exchange => tie_exchange
  end type tie_input_t

  type, public :: load_case_input_t  !! `&case`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: name  !! Name of the load case.
    logical :: continues = .false.  !! Whether the solution starts from that of the case before.
  end type load_case_input_t

  type, public :: contact_case_input_t  !! `&contact_case`.
    integer :: line = 0  !! Line of the group.
    logical, allocatable :: in_case(:)  !! Load cases that it belongs to (n_cases).
    character(:), allocatable :: contact  !! Name of contact pairs, maybe with wildcards.
    logical :: has_gap = .false.  !! Whether a gap is given; the three below are as in `contact_input_t`.
    integer :: gap_kind = default_gap
    real(dp) :: gap = 0
    character(:), allocatable :: gap_formula
    logical :: has_theta = .false.  !! Whether a penalty parameter is given; these three as in `contact_input_t`.
    integer :: theta_kind = default_theta
    real(dp) :: theta = 0
    character(:), allocatable :: theta_formula
  end type contact_case_input_t

  type, public :: solver_input_t  !! `&solver`.
    integer :: line = 0  !! Line of the group; 0 where it is not in the file.
    integer :: scheme = default_scheme  !! One of `scheme_*`.
    integer :: theta_kind = default_theta  !! One of `theta_*`.
    real(dp) :: theta = 0  !! Penalty parameter [length/pressure], or its factor [] where it is relative.
    real(dp) :: robin_gap = huge(1.0_dp)  !! As in `contact_input_t`, for pairs without their own [length].
    logical :: theta_given = .false.  !! Whether theta is given.
    integer :: gamma_rule = default_gamma_rule  !! One of `gamma_*`.
    integer :: linear_solver = default_linear_solver  !! One of `linear_solver_*`.
    integer :: response = default_response  !! One of `response_*`.
    real(dp) :: gamma = 0  !! Relaxation parameter []; 0 where the rule is not `gamma_fixed`.
    integer :: stop_rule = default_stop_rule  !! One of `stop_*`.
    real(dp) :: tolerance = default_tolerance  !! Relative error in the energy norm at which the iteration stops [].
    !> Forces along motions that contact does not determine, as a fraction of the forces on the body [].
    real(dp) :: max_unbalanced = default_max_unbalanced
    integer :: max_iterations = default_max_iterations  !! Greatest number of iterations.
    integer :: locking = default_locking  !! One of `locking_*`.
    logical :: reproducible = .false.  !! Whether results have the same digits on any number of threads.
  end type solver_input_t

  type, public :: output_input_t  !! `&output`.
    integer :: line = 0  !! Line of the group; 0 where it is not in the file.
    logical :: field(n_fields) = .false.  !! Which fields are written, by `field_*` (n_fields).
    logical :: error_penalty = .false.  !! Whether the penalty error is estimated.
    logical :: error_discretization = .false.  !! Whether the discretization error is estimated.
    real(dp) :: interval = 0  !! Iteration time between intermediate results [s]; 0: results are written at the end.
  end type output_input_t

  type, public :: case_t  !! The whole file.
    !> Path of the namelist file, as named by the user; its directory with a slash at the end, or empty.
    character(:), allocatable :: file, directory
    character(:), allocatable :: text  !! The whole text of the file.
    type(text_t), allocatable :: remark(:)  !! Lines for the log on what the file says (n_remarks).
    logical :: no_shell = .false.  !! Whether geometries may start no program and write their mesh only.
    type(scene_input_t) :: scene  !! `&scene`.
    type(material_input_t), allocatable :: material(:)  !! In the order of the file, at least one (n_materials).
    type(body_input_t), allocatable :: body(:)  !! Bodies in the order of the file, at least one (n_bodies).
    type(support_input_t), allocatable :: support(:)  !! Supports in the order of the file, then springs (n_supports).
    type(load_input_t), allocatable :: load(:)  !! Loads in the order of the file, then those of point masses (n_loads).
    type(rigid_input_t), allocatable :: rigid(:)  !! Rigid bodies (n_rigid).
    !> Temperatures, and initial stresses, in the order of the file, no two of one body and load case (number of these).
    type(field_input_t), allocatable :: temperature(:), initial_stress(:)
    type(contact_input_t), allocatable :: contact(:)  !! Contact pairs in the order of the file (n_pairs).
    type(tie_input_t), allocatable :: tie(:)  !! Ties in the order of the file, bolts after them (n_ties).
    !> Load cases in the order of the file; of size 0 or not allocated where it has none (n_cases).
    type(load_case_input_t), allocatable :: load_case(:)
    type(contact_case_input_t), allocatable :: contact_case(:)  !! Gaps and theta by cases (n_contact_cases).
    !> Sizes of elements in the order of the file, one for each body that a group names (n_mesh_sizes).
    type(mesh_size_input_t), allocatable :: mesh_size(:)
    type(accuracy_input_t) :: accuracy  !! `&accuracy`.
    type(quantity_input_t), allocatable :: quantity(:)  !! Quantities with error bars (n_quantities).
    integer :: mesh_number = 0  !! Number of the mesh where one follows the other; 0 where there is one.
    !> Geometries whose elements get sizes of the program, and what gmsh reads after each; not allocated without (n).
    type(text_t), allocatable :: sized_file(:), size_script(:)
    character(:), allocatable :: size_mark  !! What names of meshes with sizes by `&mesh_size` end with; or absent.
    type(solver_input_t) :: solver  !! `&solver`; defaults where the file has none.
    type(output_input_t) :: output  !! `&output`; defaults where the file has none.
  contains
    procedure :: n_cases => case_n_cases
    procedure :: has_cases => case_has_cases
    procedure :: in_case_text => case_in_case_text
  end type case_t

  character(*), parameter, public :: cut_surface = '(cut)'  !! Name of the surface of a half at the cut.

contains

  !> Exchange slave and master side.
  subroutine contact_exchange(self)
    class(contact_input_t), intent(inout) :: self
    call exchange_sides(self%body_a, self%body_b, self%surface_a, self%surface_b)
  end subroutine contact_exchange

  !> Whether two bodies of one mesh file are the same part of it.
  pure logical function body_input_has_shape_of(self, other) result(same)
    class(body_input_t), intent(in) :: self
    type(body_input_t), intent(in) :: other  !! The other body.
    type(cut_input_t) :: own_cut, other_cut
    same = self%volume == other%volume .and. (self%is_surface .eqv. other%is_surface) .and. &
           (self%has_facing .eqv. other%has_facing) .and. .not. any(abs(self%facing - other%facing) > 0)
    if (.not. same) return
    own_cut = self%cut%place_back(self%at, self%axis, self%angle)
    other_cut = other%cut%place_back(other%at, other%axis, other%angle)
    same = own_cut%same_as(other_cut)
  end function body_input_has_shape_of

  !> Exchange slave and master side; of ties without rotation.
  subroutine tie_exchange(self)
    class(tie_input_t), intent(inout) :: self
    call exchange_sides(self%body_a, self%body_b, self%surface_a, self%surface_b)
  end subroutine tie_exchange

  !> Exchange bodies and surfaces of two sides.
  subroutine exchange_sides(body_a, body_b, surface_a, surface_b)
    integer, intent(inout) :: body_a, body_b  !! Bodies.
    character(:), allocatable, intent(inout) :: surface_a, surface_b  !! Names of surfaces.
    character(:), allocatable :: surface
    integer :: body
    body = body_a
    body_a = body_b
    body_b = body
    call move_alloc(surface_a, surface)
    call move_alloc(surface_b, surface_a)
    call move_alloc(surface, surface_b)
  end subroutine exchange_sides

  !> Whether a group belongs to a load case.
  pure logical function applies_in(in_case, k) result(applies)
    logical, allocatable, intent(in) :: in_case(:)  !! Its component `in_case`.
    integer, intent(in) :: k  !! The load case.
    applies = .true.
    if (allocated(in_case)) applies = in_case(k)
  end function applies_in

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
    integer, intent(in) :: k  !! The load case.
    character(:), allocatable :: text
    text = ''
    if (self%has_cases()) text = ' in case '//quoted(self%load_case(k)%name)
  end function case_in_case_text

  !> Whether two groups belong to the same load case.
  pure logical function share_a_case(one, other) result(share)
    logical, allocatable, intent(in) :: one(:), other(:)  !! Their components `in_case`.
    share = .true.
    if (allocated(one) .and. allocated(other)) then
      share = any(one .and. other)
    else if (allocated(one)) then
      share = any(one)
    else if (allocated(other)) then
      share = any(other)
    end if
  end function share_a_case

  !> Whether the body is a half.
  elemental logical function cut_is_cut(self) result(is_cut)
    class(cut_input_t), intent(in) :: self
    is_cut = self%line > 0
  end function cut_is_cut

  !> The plane in coordinates of the mesh, before the body is rotated and shifted to its place.
  pure function cut_place_back(self, at, axis, angle) result(back)
    class(cut_input_t), intent(in) :: self
    real(dp), intent(in) :: at(3)  !! Position of the origin of the mesh (3) [length].
    real(dp), intent(in) :: axis(3), angle  !! Axis of rotation (3) [], and angle [degrees].
    type(cut_input_t) :: back
    real(dp) :: rotation(3, 3)
    back = self
    back%point = self%point - at
    if (.not. abs(angle) > 0) return
    rotation = rotation_matrix(axis, angle)
    back%point = matmul(back%point, rotation)
    back%normal = matmul(self%normal, rotation)
  end function cut_place_back

  !> Whether two bodies of one volume are the same half of it; planes in coordinates of the mesh.
  pure logical function cut_same_as(self, other) result(same)
    class(cut_input_t), intent(in) :: self
    type(cut_input_t), intent(in) :: other  !! Of the other body.
    same = self%half == other%half
    if (.not. (same .and. self%is_cut())) return
    same = self%surface == other%surface .and. &
           norm2(self%normal - other%normal) <= rounding .and. &
           abs(dot_product(self%normal, self%point - other%point)) <= rounding*(norm2(self%point) + norm2(other%point))
  end function cut_same_as
end module dotyk_input_case
