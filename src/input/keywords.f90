!> THE table of groups and keys: what is checked, what defaults are and what `--help` prints all come from here.
module dotyk_input_keywords
  use dotyk_base_options, only: analysis_names, default_analysis, default_budget_fraction, default_discretization, &
    default_gamma_rule, default_geometry, default_linear_solver, default_locking, default_max_iterations, &
    default_quadrature, default_response, default_scheme, default_tolerance, discretization_names, error_part_names, &
    field_names, gamma_rule_names, geometry_names, linear_solver_names, locking_names, option_name, quadrature_names, &
    response_names, scheme_names, stop_rule_names
  use dotyk_base_text, only: text_t, to_text
  implicit none
  private

  !> How often a group may stand in a file.
  integer, parameter, public :: exactly_one = 1, at_most_one = 2, at_least_one = 3, any_number = 4

  !> What the values of a key are.
  integer, parameter, public :: kind_real = 1     !< real numbers
  integer, parameter, public :: kind_integer = 2  !< whole numbers
  integer, parameter, public :: kind_logical = 3  !< .true. or .false.
  integer, parameter, public :: kind_text = 4     !< text in quotes
  integer, parameter, public :: kind_name = 5     !< one name of a list, in quotes
  integer, parameter, public :: kind_names = 6    !< names of a list, separated by blanks, in one pair of quotes
  integer, parameter, public :: kind_formula = 7  !< formulas in x, y, z, each in quotes

  !> A group.
  type, public :: group_keyword_t
    character(:), allocatable :: name
    !> One of `exactly_one`, ...
    integer :: occurs = any_number
    character(:), allocatable :: meaning
  end type group_keyword_t

  !> A key of a group.
  type, public :: keyword_t
    character(:), allocatable :: group, key
    !> One of `kind_*`.
    integer :: kind = kind_text
    !> Least and greatest number of values; no other one between them is meant.
    integer :: least = 1, most = 1
    !> Must its numbers be above 0?
    logical :: positive = .false.
    !> Must its numbers not be below 0?
    logical :: not_negative = .false.
    !> Must it be given?
    logical :: required = .false.
    !> May its text be empty?
    logical :: may_be_empty = .false.
    !> Are its numbers measured in units, or multiples of what is, so that their size is limited?
    logical :: measured = .false.
    !> Unit of the numbers; empty where they have none.
    character(:), allocatable :: unit
    !> Names that are allowed, separated by blanks.
    character(:), allocatable :: names
    !> Default values, separated by blanks; empty where there is none.
    character(:), allocatable :: default
    character(:), allocatable :: meaning
  end type keyword_t

  !> The table while it is made.
  type :: rows_t
    integer :: n = 0
    type(keyword_t) :: row(80)
  contains
    procedure :: add
  end type rows_t

  public :: list_groups, list_keywords, place_of_keyword, keys_of_group

contains

  !> All groups.
  pure subroutine list_groups(groups)
    type(group_keyword_t), allocatable, intent(out) :: groups(:)
    allocate (groups(8))
    groups(1) = group('scene', exactly_one, 'the scene as a whole')
    groups(2) = group('material', at_least_one, 'an elastic material: young and poisson (isotropic), three each of '// &
                      'young, poisson and shear (orthotropic), or stiffness')
    groups(3) = group('body', at_least_one, 'an elastic body')
    groups(4) = group('support', any_number, 'given displacement on a surface of a body, zero where no value is given')
    groups(5) = group('load', any_number, 'a load on a body: exactly one of traction, pressure, local_traction, '// &
                      'force_density or their formulas')
    groups(6) = group('contact', any_number, 'a pair of surfaces that may touch')
    groups(7) = group('solver', at_most_one, 'how the contact is solved')
    groups(8) = group('output', at_most_one, 'what is written to the results file')
  end subroutine list_groups

  !> All keys, those of a group together, in the order of the groups.
  pure subroutine list_keywords(table)
    type(keyword_t), allocatable, intent(out) :: table(:)
    type(rows_t) :: t
    integer :: i
    call t%add('scene', 'title', kind_text, may_be_empty=.true., &
               meaning='title, for people')
    call t%add('scene', 'mesh', kind_text, &
               'mesh file of the bodies that name none of their own: .msh (gmsh 2.2 or 4.1) or .geo '// &
               '(meshed by gmsh); relative to the namelist file')
    call t%add('scene', 'output', kind_text, &
               'results file, relative to the namelist file; if absent, the name of the namelist file '// &
               'with .vtkhdf')
    call t%add('scene', 'analysis', kind_name, names=analysis_names, &
               default=option_name(analysis_names, default_analysis), &
               meaning='kind of problem; axisymmetric is about y with x as the radius')

    call t%add('material', 'name', kind_text, required=.true., &
               meaning='name of the material')
    call t%add('material', 'young', kind_real, most=3, unit='pressure', positive=.true., &
               meaning='Young''s modulus; orthotropic: three, along the axes 1, 2, 3')
    call t%add('material', 'poisson', kind_real, most=3, &
               meaning='Poisson''s ratio, above -1 and below 0.5; orthotropic: three, 12, 13, 23')
    call t%add('material', 'shear', kind_real, least=3, most=3, unit='pressure', positive=.true., &
               meaning='shear moduli 12, 13, 23 of an orthotropic material')
    call t%add('material', 'axis_1', kind_real, least=3, most=3, default='1 0 0', &
               meaning='axis 1 of an orthotropic material')
    call t%add('material', 'axis_2', kind_real, least=3, most=3, default='0 1 0', &
               meaning='a direction in the plane of its axes 1 and 2')
    call t%add('material', 'stiffness', kind_real, least=21, most=21, unit='pressure', &
               meaning='anisotropic: upper triangle of the stiffness by rows, order xx yy zz yz xz xy')
    call t%add('material', 'young_formula', kind_formula, &
               'factor on the stiffness')

    call t%add('body', 'name', kind_text, required=.true., &
               meaning='name of the body')
    call t%add('body', 'volume', kind_text, required=.true., &
               meaning='physical name of its elements in the mesh (a plane group in two dimensions)')
    call t%add('body', 'material', kind_text, required=.true., &
               meaning='name of its material')
    call t%add('body', 'mesh', kind_text, &
               'its own mesh file; if absent, that of the scene')
    call t%add('body', 'at', kind_real, least=2, most=3, unit='length', &
               meaning='where the origin of its mesh is placed (if absent, where it is drawn): a volume may be drawn once '// &
               'and be many bodies; in axisymmetric analyses along y only')
    call t%add('body', 'axis', kind_real, least=3, most=3, &
               meaning='axis through the origin of its mesh about which it is turned before that (if absent, z); the axes '// &
               'of its material turn with it, supports, loads and formulas are those of its place')
    call t%add('body', 'angle', kind_real, unit='degrees', &
               meaning='angle of that turn; not in axisymmetric analyses')

    call t%add('support', 'body', kind_text, required=.true., &
               meaning='name of the body')
    call t%add('support', 'surface', kind_text, required=.true., &
               meaning='physical name of the surface (a group of curves in two dimensions)')
    call t%add('support', 'fix', kind_text, required=.true., &
               meaning='what is held: letters of ''xyz'' (global axes), or of n, t (both tangents), xi, eta '// &
               '(axes of the surface: xi is the global x axis projected on it, y where that vanishes; '// &
               'eta = n x xi)')
    call t%add('support', 'value', kind_real, least=2, most=3, unit='length', &
               meaning='given displacement in the axes that fix names: x, y, z or xi, eta, n (in two dimensions '// &
               'x, y or xi, n)')
    call t%add('support', 'value_formula', kind_formula, least=2, most=3, unit='length', &
               meaning='the same as formulas')

    call t%add('load', 'body', kind_text, required=.true., &
               meaning='name of the body')
    call t%add('load', 'surface', kind_text, &
               'physical name of the surface; not with force_density')
    call t%add('load', 'traction', kind_real, least=2, most=3, unit='pressure', &
               meaning='force per area in global axes')
    call t%add('load', 'pressure', kind_real, unit='pressure', &
               meaning='force per area along the inward normal: positive pushes into the body')
    call t%add('load', 'local_traction', kind_real, least=2, most=3, unit='pressure', &
               meaning='force per area in the axes of the surface: xi, eta, n (in two dimensions xi, n)')
    call t%add('load', 'force_density', kind_real, least=2, most=3, unit='force/volume', &
               meaning='force per volume in global axes')
    call t%add('load', 'traction_formula', kind_formula, least=2, most=3, unit='pressure', &
               meaning='traction as formulas')
    call t%add('load', 'pressure_formula', kind_formula, unit='pressure', &
               meaning='pressure as a formula')
    call t%add('load', 'local_traction_formula', kind_formula, least=2, most=3, unit='pressure', &
               meaning='local_traction as formulas')
    call t%add('load', 'force_density_formula', kind_formula, least=2, most=3, unit='force/volume', &
               meaning='force_density as formulas')

    call t%add('contact', 'name', kind_text, required=.true., &
               meaning='name of the pair')
    call t%add('contact', 'surface_a', kind_text, required=.true., &
               meaning='side with the contact points, as ''body:surface''')
    call t%add('contact', 'surface_b', kind_text, required=.true., &
               meaning='side on which they are projected, as ''body:surface''; of another body')
    call t%add('contact', 'gap', kind_real, unit='length', &
               meaning='initial distance; if absent, that of the geometry')
    call t%add('contact', 'gap_formula', kind_formula, unit='length', &
               meaning='initial distance as a formula')
    call t%add('contact', 'theta', kind_real, unit='length/pressure', not_negative=.true., &
               meaning='penalty parameter of this pair; if absent, that of &solver')
    call t%add('contact', 'theta_relative', kind_real, not_negative=.true., &
               meaning='the same, times size_a/E_a + size_b/E_b; size is the smallest edge of the body''s '// &
               'bounding box')
    call t%add('contact', 'theta_mesh', kind_real, not_negative=.true., &
               meaning='the same, times h_a/E_a + h_b/E_b, point by point; h is the size of the facet there')
    call t%add('contact', 'search_radius', kind_real, unit='length', positive=.true., &
               meaning='greatest distance of partners; if absent, the smaller body''s size')
    call t%add('contact', 'discretization', kind_name, names=discretization_names, &
               default=option_name(discretization_names, default_discretization), &
               meaning='contact constraints: mortar, dual mortar with one weighted gap per vertex of surface_a (stable for '// &
               'every theta); quadrature, one gap per quadrature point (point-wise penalty)')
    call t%add('contact', 'geometry', kind_name, names=geometry_names, &
               default=option_name(geometry_names, default_geometry), &
               meaning='what gaps and normals are taken from: smooth puts patches with continuous normals over the facets '// &
               '(edges of more than 40 degrees stay sharp, planes flat); elements: the facets as they are')
    call t%add('contact', 'quadrature', kind_name, names=quadrature_names, &
               default=option_name(quadrature_names, default_quadrature), &
               meaning='integration points: segments puts them on the pieces that the facets of surface_b cut out of those '// &
               'of surface_a, exact on flat faces whatever their meshes; plain puts them on whole facets of surface_a')

    call t%add('solver', 'scheme', kind_name, names=scheme_names, &
               default=option_name(scheme_names, default_scheme), &
               meaning='auto: dual, or neumann where gamma, gamma_rule or stop_rule=''paper'' say so; '// &
               'neumann: the parallel Neumann scheme, for held bodies; '// &
               'dual: contact forces as unknowns, any theta and free bodies; the others are there to compare: '// &
               'robin holds each body by springs towards the others, nesterov, anderson and secant '// &
               'accelerate neumann')
    call t%add('solver', 'theta', kind_real, unit='length/pressure', not_negative=.true., &
               meaning='penalty parameter, the compliance of a layer between the bodies; 0: no layer, no penetration')
    call t%add('solver', 'theta_relative', kind_real, not_negative=.true., &
               meaning='the same, times size_a/E_a + size_b/E_b of each pair; not together with theta')
    call t%add('solver', 'theta_mesh', kind_real, not_negative=.true., &
               meaning='the same, times h_a/E_a + h_b/E_b, point by point; h is the size of the facet there; if no theta '// &
               'is given, 0.01 (other schemes than dual: 0.1), and less where the error of the penalty would dominate '// &
               'that of the mesh')
    call t%add('solver', 'linear_solver', kind_name, names=linear_solver_names, &
               default=option_name(linear_solver_names, default_linear_solver), &
               meaning='how the dual scheme solves for the forces of closed points: direct forms their compliance, '// &
               'iterative is by conjugate gradients, auto what is cheaper')
    call t%add('solver', 'response', kind_name, names=response_names, &
               default=option_name(response_names, default_response), &
               meaning='how a body answers to contact forces: full solves with its whole factor; condensed orders the contact '// &
               'unknowns last, and solves with their part of the factor; compliance makes a matrix of the answers of '// &
               'all contact points; auto is, body by body, what is cheapest')
    call t%add('solver', 'gamma_rule', kind_name, names=gamma_rule_names, &
               default=option_name(gamma_rule_names, default_gamma_rule), &
               meaning='relaxation parameter: spectral is 2/(2+L), theory is 1/(1+L)^2, fixed is gamma')
    call t%add('solver', 'gamma', kind_real, positive=.true., &
               meaning='relaxation parameter where gamma_rule is ''fixed''')
    call t%add('solver', 'stop_rule', kind_name, names=stop_rule_names, &
               meaning='residual: the guaranteed error bound is below tolerance; paper: the bound (41) is; increment: the '// &
               'last step is; budget: the guaranteed error bound is below budget_fraction times the error of penalty '// &
               'and mesh; if absent, budget where neither tolerance nor any theta is given, else residual')
    call t%add('solver', 'budget_fraction', kind_real, default=to_text(default_budget_fraction), positive=.true., &
               meaning='part of the other errors that the iteration may add where stop_rule is ''budget''')
    call t%add('solver', 'tolerance', kind_real, default=to_text(default_tolerance), positive=.true., &
               meaning='relative error in the energy norm at which the iteration stops')
    call t%add('solver', 'max_iterations', kind_integer, default=to_text(default_max_iterations), positive=.true., &
               meaning='most iterations')
    call t%add('solver', 'locking', kind_name, names=locking_names, &
               default=option_name(locking_names, default_locking), &
               meaning='against locking in nearly incompressible bodies (Poisson''s ratio above 0.4; not in plane stress): '// &
               'auto takes the projected dilatation, and makes linear triangles, tetrahedra and prisms quadratic from 0.45 on; '// &
               'ignore does nothing')
    call t%add('solver', 'reproducible', kind_logical, default='.false.', &
               meaning='the same digits on any number of threads')

    call t%add('output', 'fields', kind_names, names=field_names, default=field_names, may_be_empty=.true., &
               meaning='fields that are computed and written')
    call t%add('output', 'error_parts', kind_names, names=error_part_names, default=error_part_names, may_be_empty=.true., &
               meaning='what is estimated besides the bound of the iteration: penalty, the distance to the solution '// &
               'without it; discretization, the error of the mesh')
    call t%add('output', 'interval', kind_real, default='0', unit='seconds', not_negative=.true., &
               meaning='time between results that are written while an iterative scheme runs, with status ''running''; '// &
               '0: results are written at the end')
    allocate (table(t%n))
    do i = 1, t%n
      table(i) = t%row(i)
    end do
  end subroutine list_keywords

  !> Add a row; what is absent is as in `keyword_t`.
  pure subroutine add(self, group, key, kind, meaning, least, most, unit, names, default, positive, &
                      not_negative, required, may_be_empty)
    class(rows_t), intent(inout) :: self
    character(*), intent(in) :: group, key
    integer, intent(in) :: kind
    character(*), intent(in) :: meaning
    integer, intent(in), optional :: least, most
    character(*), intent(in), optional :: unit, names, default
    logical, intent(in), optional :: positive, not_negative, required, may_be_empty
    self%n = self%n + 1
    associate (row => self%row(self%n))
      row%group = group
      row%key = key
      row%kind = kind
      row%meaning = meaning
      row%unit = ''
      row%names = ''
      row%default = ''
      if (present(least)) row%least = least
      if (present(most)) row%most = most
      if (present(unit)) row%unit = unit
      row%measured = len(row%unit) > 0 .or. index(key, 'theta') == 1
      if (present(names)) row%names = names
      if (present(default)) row%default = default
      if (present(positive)) row%positive = positive
      if (present(not_negative)) row%not_negative = not_negative
      if (present(required)) row%required = required
      if (present(may_be_empty)) row%may_be_empty = may_be_empty
    end associate
  end subroutine add

  !> One row of the table of groups.
  pure function group(name, occurs, meaning) result(row)
    character(*), intent(in) :: name, meaning
    integer, intent(in) :: occurs
    type(group_keyword_t) :: row
    row%name = name
    row%occurs = occurs
    row%meaning = meaning
  end function group

  !> Place of a key in the table; 0 where the group has no such key.
  pure integer function place_of_keyword(table, group, key) result(place)
    type(keyword_t), intent(in) :: table(:)
    !> Names in lower case.
    character(*), intent(in) :: group, key
    integer :: i
    place = 0
    do i = 1, size(table)
      if (table(i)%group == group .and. table(i)%key == key) place = i
    end do
  end function place_of_keyword

  !> The keys of a group.
  pure subroutine keys_of_group(table, group, keys)
    type(keyword_t), intent(in) :: table(:)
    character(*), intent(in) :: group
    type(text_t), allocatable, intent(out) :: keys(:)
    integer :: i, n
    n = 0
    do i = 1, size(table)
      if (table(i)%group == group) n = n + 1
    end do
    allocate (keys(n))
    n = 0
    do i = 1, size(table)
      if (table(i)%group /= group) cycle
      n = n + 1
      keys(n)%s = table(i)%key
    end do
  end subroutine keys_of_group
end module dotyk_input_keywords
