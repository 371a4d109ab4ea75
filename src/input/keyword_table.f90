!> THE table of groups and keys, one entry for each: reading, checks, defaults, `--help` and docs/input.md (`dotyk
!> --help=markdown`) follow from it.
module dotyk_input_keyword_table
  use dotyk_base_options, only: aim_energy, aim_names, analysis_names, condition_names, default_analysis, &
    default_condition, default_discretization, default_gamma_rule, default_geometry, default_linear_solver, &
    default_locking, default_max_iterations, default_max_unbalanced, default_quadrature, default_response, &
    default_scheme, default_stop_rule, default_tolerance, discretization_names, error_part_names, field_names, &
    gamma_rule_names, geometry_names, linear_solver_names, locking_names, option_name, quadrature_names, &
    response_names, scheme_names, stop_rule_names
  use dotyk_base_text, only: to_text
  use dotyk_input_keywords, only: any_number, at_least_one, at_most_one, exactly_one, group_keyword_t, keyword_list_t, &
    kind_formula, kind_integer, kind_logical, kind_name, kind_names, kind_real, kind_text
  implicit none
  private
  public :: list_keywords

  integer, parameter :: most_volumes = 1000  !! Greatest number of volumes of a body.
  integer, parameter :: most_names = 200  !! Greatest number of names in a key `case`.
  character, parameter :: lf = new_line('a')

contains

  !> All groups with their keys, in the order of the reference.
  pure subroutine list_keywords(groups)
    type(group_keyword_t), allocatable, intent(out) :: groups(:)  !! The groups (n_groups).
    type(keyword_list_t) :: list
    allocate (list%group(0))
    call add_bodies(list)
    call add_contact(list)
    call add_settings(list)
    call move_alloc(list%group, groups)
  end subroutine list_keywords

  !> Scene, materials, bodies, and what holds and loads them.
  pure subroutine add_bodies(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('scene', exactly_one, 'the scene as a whole', &
      "&scene title='ball on a block', mesh='hertz.geo', analysis='3d' /")
    call list%add('title', kind_text, may_be_empty=.true., meaning='title')
    call list%add('mesh', kind_text, 'mesh file of all bodies without a mesh key: .msh (gmsh 2.2 or 4.1), .geo '// &
      '(meshed by gmsh), .inp (Abaqus, CalculiX: sets of elements are volumes, surfaces and sets of nodes '// &
      'surfaces), .vtu (VTK: values of arrays of integers of cells are volumes and surfaces, those of points '// &
      'surfaces), .med and other formats of meshio, or a CAD file (.step, .stp, .iges, .igs, .brep, .brp, .stl; '// &
      'meshed by gmsh, lengths in mm; each closed surface of an .stl file is a solid), whose volumes are solid 1, '// &
      'solid 2, ..., and whose surfaces face 1, face 2, ..., as gmsh numbers them; relative to the namelist file')
    call list%add('mesh_size', kind_real, unit='length', positive=.true., meaning='size of the elements in CAD '// &
      'files; smaller at curved faces (16 around a circle); if absent, a twelfth of the largest extent of each solid')
    call list%add('mesh_order', kind_integer, positive=.true., default='2', &
      meaning='order of the elements in CAD files, 1 or 2')
    call list%add('output', kind_text, 'results file, relative to the namelist file; if absent, the namelist file '// &
      'with extension .vtkhdf')
    call list%add('analysis', kind_name, names=analysis_names, default=option_name(analysis_names, default_analysis), &
      meaning='type of analysis; axisymmetric: y is the axis, x the radius')

    call list%begin_group('material', at_least_one, 'an elastic material: young and poisson (isotropic), three '// &
      'each of young, poisson and shear (orthotropic), or stiffness (anisotropic)', &
      "&material name='steel', young=210e9, poisson=0.3 /"//lf// &
      "&material name='spruce', young=11e9,0.7e9,0.4e9, poisson=0.4,0.45,0.5,"//lf// &
      '          shear=0.7e9,0.6e9,0.04e9, axis_1=1,0,0, axis_2=0,1,0 /')
    call list%add('name', kind_text, required=.true., meaning='name of the material')
    call list%add('young', kind_real, most=3, unit='pressure', positive=.true., &
      meaning='Young''s modulus; orthotropic: three, along the axes 1, 2, 3')
    call list%add('poisson', kind_real, most=3, &
      meaning='Poisson''s ratio, above -1 and below 0.5; orthotropic: three, 12, 13, 23')
    call list%add('shear', kind_real, least=3, most=3, unit='pressure', positive=.true., &
      meaning='shear moduli 12, 13, 23 of an orthotropic material')
    call list%add('axis_1', kind_real, least=3, most=3, default='1 0 0', &
      meaning='axis 1 of an orthotropic or anisotropic material')
    call list%add('axis_2', kind_real, least=3, most=3, default='0 1 0', &
      meaning='direction in the plane of axes 1 and 2, not parallel to axis_1')
    call list%add('stiffness', kind_real, least=21, most=21, unit='pressure', meaning='anisotropic: upper triangle '// &
      'of the elasticity matrix by rows, order 11 22 33 23 13 12 of its axes, xx yy zz yz xz xy where axis_1 and '// &
      'axis_2 are not given')
    call list%add('young_formula', kind_formula, most=3, &
      meaning='one: modulus field, dimensionless factor of the elasticity matrix as a formula; without young it is '// &
      'Young''s modulus itself [pressure]; three, without young: Young''s moduli of an orthotropic material [pressure]')
    call list%add('poisson_formula', kind_formula, most=3, meaning='Poisson''s ratio as formulas, in place of poisson')
    call list%add('shear_formula', kind_formula, least=3, most=3, unit='pressure', &
      meaning='shear moduli as formulas, in place of shear')
    call list%add('stiffness_formula', kind_formula, least=21, most=21, unit='pressure', &
      meaning='stiffness as formulas, in place of it')
    call list%add('density', kind_real, unit='mass/volume', positive=.true., &
      meaning='density, for angular_velocity and acceleration of &load')
    call list%add('density_formula', kind_formula, unit='mass/volume', meaning='density as a formula')
    call list%add('expansion', kind_real, most=3, unit='1/temperature', &
      meaning='coefficient of thermal expansion; orthotropic or anisotropic: one, or three along the axes 1, 2, 3')
    call list%add('expansion_formula', kind_formula, most=3, unit='1/temperature', meaning='expansion as formulas')

    call list%begin_group('body', at_least_one, 'an elastic body', &
      "&body name='block', volume='block', material='steel' /"//lf// &
      "&body name='plate', mesh='plate.msh', surface='plate', facing=0,0,-1 /"//lf// &
      "&body name='roller 2', mesh='roller.msh', volume='roller', material='steel',"//lf// &
      '      at=0.1,0,0, axis=0,0,1, angle=15 /'//lf// &
      "&body name='pin', volume='core', 'shell', material='steel', 'rubber' /"//lf// &
      "&body name='segment *', volume='segment', material='concrete', repeat=6, axis=0,0,1, angle=60 /")
    call list%add('name', kind_text, required=.true., meaning='name of the body')
    call list%add('volume', kind_text, most=most_volumes, meaning='physical group of the elements in the mesh (in '// &
      'two dimensions a physical surface); several ones that share nodes are one body; required but with surface')
    call list%add('material', kind_text, most=most_volumes, &
      meaning='name of the material; of several volumes, one for all or one each; required but with surface')
    call list%add('surface', kind_text, 'in place of volume, for a body of &rigid_body: physical group of a '// &
      'surface, in two dimensions of a curve, without elements behind it. It has no material; one of its sides '// &
      'touches others')
    call list%add('facing', kind_real, least=2, most=3, unit='length', meaning='with surface: a point that sees '// &
      'the side of contact, in coordinates of the mesh. Required where the surface is open; of a closed one the '// &
      'outside touches others, if absent. The orientation of the facets in the file does not matter')
    call list%add('mesh', kind_text, 'mesh file of the body; if absent, mesh of &scene')
    call list%add('at', kind_real, least=2, most=3, unit='length', meaning='translation of the mesh, after the '// &
      'rotation (if absent, 0): many bodies may use one meshed volume; in axisymmetric analyses along y only')
    call list%add('axis', kind_real, least=3, most=3, meaning='axis of rotation, through the origin of the mesh '// &
      '(if absent, z); material axes rotate with the body; supports, loads and formulas in x, y, z use global axes')
    call list%add('angle', kind_real, most=3, unit='degrees', &
      meaning='angle of rotation about axis; with repeat, the angle from copy to copy; not in axisymmetric analyses')
    call list%add('repeat', kind_integer, most=3, positive=.true., meaning='number of copies of the body, or two '// &
      'or three numbers for an array of copies; each copy is the first one rotated about axis through centre by a '// &
      'multiple of angle, then translated by a multiple of shift; numbers of the copies, from 1, replace the * of '// &
      'name, and of volume: segment 1, segment 2; in arrays, the first number fastest, a single * gets all numbers '// &
      '(ball 1 1, ball 2 1), several * get one each')
    call list%add('shift', kind_real, least=2, most=9, unit='length', &
      meaning='translation from copy to copy, one vector for each number of repeat')
    call list%add('centre', kind_real, least=2, most=3, unit='length', &
      meaning='point on the axis about which copies are rotated (if absent, 0)')
    call list%add('first_angle', kind_real, unit='degrees', &
      meaning='angle of rotation of the first copy about axis, through the origin of its mesh')
    call list%add('crack', kind_logical, default='.false.', meaning='faces of the body that touch without common '// &
      'nodes are a crack, whose sides do not see each other; otherwise such a body is refused')

    call list%begin_group('support', any_number, 'prescribed displacement (Dirichlet condition) on a body surface, '// &
      'an edge or nodes, zero where no value is given', &
      "&support body='block', surface='bottom', fix='xyz' /"//lf// &
      "&support body='ball', surface='cut', fix='n', value=0,0,-3e-5 /"//lf// &
      "&support body='plate', nodes_at=0,0,0, fix='xyz' /")
    call list%add('body', kind_text, required=.true., meaning='name of the body; * and ? are wildcards: all bodies '// &
      'with such names that have the surface; those that are rigid have no support')
    call list%add('surface', kind_text, 'physical group of the surface (in two dimensions a physical curve); with '// &
      'wildcards, the union of all physical groups that the body has')
    call list%add_edges_and_nodes()
    call list%add('fix', kind_text, required=.true., meaning='directions with prescribed displacement: letters of '// &
      '''xyz'' (global axes), or of n, t (both tangents), xi, eta (axes of the surface: n is the outward normal, '// &
      'xi the global x axis projected on the surface, y where that vanishes, eta = n x xi)')
    call list%add('value', kind_real, least=2, most=3, unit='length', meaning='prescribed displacement in the axes '// &
      'chosen by fix: x, y, z or xi, eta, n (in two dimensions x, y or xi, n)')
    call list%add('value_formula', kind_formula, least=2, most=3, unit='length', meaning='value as formulas')
    call list%add('case', kind_text, most=most_names, &
      meaning='load cases in which value holds, with wildcards; in the others the surface is held without '// &
      'displacement along fix, unless another &support of the same surface and fix has them')

    call list%begin_group('spring', any_number, 'springs on a body surface, an edge or nodes: an elastic '// &
      'support (Winkler foundation); exactly one of modulus and stiffness', &
      "&spring body='slab', surface='bottom', fix='n', modulus=50e6 /"//lf// &
      "&spring body='motor', surface='feet', fix='xyz', stiffness=2e6 /")
    call list%add('body', kind_text, required=.true., meaning='name of the body, with wildcards as in &support')
    call list%add('surface', kind_text, 'physical group of the surface, with wildcards as in &support')
    call list%add_edges_and_nodes()
    call list%add('fix', kind_text, required=.true., &
      meaning='directions of the springs, as in &support: letters of xyz, or of n, t, xi, eta')
    call list%add('modulus', kind_real, unit='pressure/length', positive=.true., &
      meaning='stiffness per area of each direction (Winkler foundation); per length of an edge, per node')
    call list%add('stiffness', kind_real, unit='force/length', positive=.true., meaning='total stiffness of each '// &
      'direction in place of modulus, spread evenly over the area of the surface; in the plane per unit thickness, '// &
      'in axisymmetric analyses on the full circumference. Of several bodies each gets it; with wildcards in '// &
      'surface it is that of all surfaces of a body together, as the log shows')
    call list%add('value', kind_real, least=2, most=3, unit='length', &
      meaning='displacement of the far ends of the springs, as value of &support; at rest if absent')

    call list%begin_group('rigid_body', any_number, 'makes a body rigid: six motions (three in the plane, one '// &
      'about an axis), held, moved or free', &
      "&rigid_body body='punch', fix='xyz rx ry rz', value=0,0,-1e-4 /"//lf// &
      "&rigid_body body='ball', fix='x y' /")
    call list%add('body', kind_text, required=.true., &
      meaning='name of the body, with wildcards: each of several bodies is rigid of its own')
    call list%add('fix', kind_text, may_be_empty=.true., &
      meaning='motions that are held: of x, y, z (displacement of the point) and rx, ry, rz (rotation about axes '// &
      'through it), as in ''xyz rx ry''; x, y, rz in the plane, y in axisymmetry. Others are free: loads, &load '// &
      'force and moment among them, move the body against its contact; all are free if absent')
    call list%add('value', kind_real, least=2, most=3, unit='length', &
      meaning='displacement of the point along held directions; 0 if absent')
    call list%add('rotation', kind_real, most=3, unit='radian', &
      meaning='small rotation about held axes; one value in two dimensions; 0 if absent')
    call list%add('point', kind_real, least=2, most=3, unit='length', &
      meaning='point about which the body rotates; the origin if absent')
    call list%add('case', kind_text, most=most_names, meaning='load cases in which value and rotation hold, with '// &
      'wildcards; in the others held motions are 0; all if absent')

    call list%begin_group('load', any_number, 'a load on a body: exactly one of traction, pressure, '// &
      'local_traction, force_density or their formulas, acceleration, angular_velocity, or force and moment', &
      "&load body='block', surface='side', pressure=1e6 /"//lf// &
      "&load body='block', edge='front', traction=0,0,-20 /"//lf// &
      "&load body='block', nodes_at=0,0,10, force=0,0,-500 /"//lf// &
      "&load body='shaft', surface='end', force=0,0,-2e3, moment=0,0,150 /"//lf// &
      "&load body='block', force_density_formula='0', '0', '-7850*9.81' /"//lf// &
      "&load body='*', acceleration=0,0,-9.81 /"//lf// &
      "&load body='disc', angular_velocity=0,0,314, centre=0.2,0,0 /")
    call list%add('body', kind_text, required=.true., meaning='name of the body, with wildcards as in &support')
    call list%add('surface', kind_text, 'physical group of the surface, with wildcards as in &support; not with '// &
      'force_density, acceleration and angular_velocity')
    call list%add_edges_and_nodes()
    call list%add('traction', kind_real, least=2, most=3, unit='pressure', meaning='force per area in global axes; '// &
      'on an edge force per length, on nodes the force of each node, as *CLOAD of a set of nodes')
    call list%add('pressure', kind_real, unit='pressure', &
      meaning='force per area along the inward normal: a positive pressure pushes into the body')
    call list%add('local_traction', kind_real, least=2, most=3, unit='pressure', &
      meaning='force per area in the axes of the surface: xi, eta, n (in two dimensions xi, n)')
    call list%add('force_density', kind_real, 'force per volume in global axes', least=2, most=3, unit='force/volume')
    call list%add('traction_formula', kind_formula, least=2, most=3, unit='pressure', meaning='traction as formulas')
    call list%add('pressure_formula', kind_formula, unit='pressure', meaning='pressure as a formula')
    call list%add('local_traction_formula', kind_formula, least=2, most=3, unit='pressure', &
      meaning='local_traction as formulas')
    call list%add('force_density_formula', kind_formula, least=2, most=3, unit='force/volume', &
      meaning='force_density as formulas')
    call list%add('acceleration', kind_real, least=2, most=3, unit='force/mass', &
      meaning='force per mass in global axes, such as gravity: the density of the material times it is a force '// &
      'density, point masses (&mass) bear it, too; in axisymmetry along the axis y')
    call list%add('angular_velocity', kind_real, most=3, unit='1/time', meaning='rotation about an axis through '// &
      'centre, in radians per time: the centrifugal force, density times angular_velocity squared times the '// &
      'distance from the axis; one value in two dimensions: about z, in axisymmetry about the axis y')
    call list%add('centre', kind_real, least=2, most=3, unit='length', &
      meaning='a point on the axis of angular_velocity; the origin if absent; not in axisymmetry')
    call list%add('force', kind_real, least=2, most=3, unit='force', &
      meaning='total force in global axes, spread over the surface with moment as a traction that is linear in the '// &
      'position, a + b x (x - c), exact on any mesh; on an edge over its length, on nodes equally; in the plane by '// &
      'unit thickness, in axisymmetric analyses on the full circumference along the axis. Every body gets the whole')
    call list%add('moment', kind_real, least=1, most=3, unit='force*length', &
      meaning='total moment, likewise; in two dimensions that about z; not in axisymmetric analyses')
    call list%add('point', kind_real, least=2, most=3, unit='length', &
      meaning='point that force and moment refer to, the centroid of the surface if not given')
    call list%add('case', kind_text, 'load cases with this load, with wildcards; all if absent', most=most_names)

    call list%begin_group('mass', any_number, 'a point mass that a body surface carries: its weight under '// &
      'acceleration, its centrifugal force under angular_velocity', &
      "&mass body='frame', surface='seat', mass=75, point=0.3,0,1.1 /")
    call list%add('body', kind_text, required=.true., &
      meaning='name of the body, with wildcards as in &support; a &load acceleration or angular_velocity acts on it')
    call list%add('surface', kind_text, required=.true., meaning='physical group of the surface that carries the '// &
      'mass, with wildcards as in &support: the force is spread as that of &load force')
    call list%add('mass', kind_real, unit='mass', required=.true., positive=.true., &
      meaning='the mass; in the plane per unit thickness. Of several bodies each has it')
    call list%add('point', kind_real, least=2, most=3, unit='length', &
      meaning='where the mass is, on the surface or away from it; the centroid of the surface if absent, required '// &
      'where the body rotates; in axisymmetry on the axis')

    call list%begin_group('temperature', any_number, 'temperature of a body above that of its unstressed state: '// &
      'its material expands; exactly one of value, formula and field', &
      "&temperature body='ring', value=120 /"//lf// &
      "&temperature body='wall *', formula='20 + 80*x/0.3' /"//lf// &
      "&temperature body='cover', field='T', reference=20, case='hot' /")
    call list%add('body', kind_text, required=.true., &
      meaning='name of the body, with wildcards as in &support; its material has an expansion')
    call list%add('value', kind_real, unit='temperature', meaning='temperature above that of the unstressed body')
    call list%add('formula', kind_formula, unit='temperature', &
      meaning='the same as a formula; between the nodes the shape functions interpolate')
    call list%add('field', kind_text, 'the same at the nodes from the mesh file, as a thermal analysis writes it: '// &
      'name of an array of the points of a .vtu file or of a format of meshio, or of $NodeData of a .msh file; in '// &
      'a deck (.inp) temperature (*TEMPERATURE; temperature step 2 where several steps have it) or '// &
      'initial_temperature (*INITIAL CONDITIONS)')
    call list%add('reference', kind_real, unit='temperature', &
      meaning='with field, temperature of the unstressed body in its units (if absent, 0)')
    call list%add('case', kind_text, most=most_names, &
      meaning='load cases with this temperature, with wildcards; all if absent')

    call list%begin_group('initial_stress', any_number, 'stress that a body has before any displacement; exactly '// &
      'one of value and formula', &
      "&initial_stress body='ground', formula='9e3*y', '18e3*y', '9e3*y', '0', '0', '0' /")
    call list%add('body', kind_text, required=.true., meaning='name of the body, with wildcards as in &support')
    call list%add('value', kind_real, least=6, most=6, unit='pressure', meaning='stresses xx, yy, zz, xy, yz, xz '// &
      'in global axes (zz: hoop stress in axisymmetry); yz and xz are 0 in two dimensions, zz too in plane stress')
    call list%add('formula', kind_formula, least=6, most=6, unit='pressure', &
      meaning='the same as formulas; between the nodes the shape functions interpolate')
    call list%add('case', kind_text, 'load cases with this stress, with wildcards; all if absent', most=most_names)
  end subroutine add_bodies

  !> What joins bodies, and load cases.
  pure subroutine add_contact(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('contact', any_number, 'a pair of surfaces that may touch', &
      "&contact name='touch', surface_a='ball:low', surface_b='block:up' /"//lf// &
      "&contact name='fit', surface_a='shaft:outside', surface_b='hub:inside', gap=-2e-5 /"//lf// &
      "&contact name='races', surface_a='ball *:ball', surface_b='* ring:race' /"//lf// &
      "&contact auto=.true., exclude='housing - cover' /")
    call list%add('name', kind_text, 'name of the contact pair; required without auto; pairs that are found are '// &
      'called ''name: body - body''')
    call list%add('surface_a', kind_text, 'slave (non-mortar) side, as ''body:surface'': its vertices or '// &
      'quadrature points carry the contact pressures; choose the surface with the finer mesh, else the curved '// &
      'surface or that of the softer body; of a curved and a planar surface in 3D choose the curved one, above all '// &
      'where a body floats; required without auto; * and ? are wildcards: in the body, for a pair of each two '// &
      'bodies whose surfaces are near each other; in the surface, for the union of all physical groups of the body '// &
      '(faces in none do not count)')
    call list%add('surface_b', kind_text, 'master (mortar) side, as ''body:surface'' of another body, with '// &
      'wildcards as in surface_a: points of surface_a are projected on it; a planar surface against a curved one '// &
      'should be the master; required without auto')
    call list%add('auto', kind_logical, default='.false.', meaning='a pair of each two bodies whose faces are near '// &
      'each other, and which no other &contact names; the keys of the group hold for all these pairs')
    call list%add('exclude', kind_text, most=200, meaning='pairs of bodies that the search leaves out, as ''body - '// &
      'body'', or bodies with all their pairs; with wildcards')
    call list%add('gap', kind_real, unit='length', &
      meaning='initial gap, the same everywhere; if absent, the distance between the surfaces')
    call list%add('gap_formula', kind_formula, 'initial gap as a formula, evaluated on surface_a', unit='length')
    call list%add('theta', kind_real, unit='length/pressure', not_negative=.true., &
      meaning='penalty parameter of this pair; if absent, theta of &solver')
    call list%add('theta_relative', kind_real, not_negative=.true., meaning='penalty parameter as a factor of '// &
      'size_a/E_a + size_b/E_b; size is the shortest edge of the body if it is a brick, else of the brick with the '// &
      'same moments of inertia')
    call list%add('theta_mesh', kind_real, not_negative=.true., &
      meaning='penalty parameter as a factor of h_a/E_a + h_b/E_b, point by point; h is the size of the facet')
    call list%add('theta_formula', kind_formula, unit='length/pressure', &
      meaning='penalty parameter as a formula, evaluated on surface_a; contact rows take its weighted mean')
    call list%add('layer', kind_logical, default='.false.', meaning='theta of this pair is the compliance of a '// &
      'real elastic (Winkler) layer: it is given, positive, and no part of the penalty error')
    call list%add('search_radius', kind_real, unit='length', positive=.true., &
      meaning='largest distance between a point and its projection; if absent, the size of the smaller body (its '// &
      'diameter); points beyond it are normal where surface_a is closed')
    call list%add('discretization', kind_name, 'contact constraints: mortar, dual (biorthogonal) mortar with one '// &
      'weighted gap per vertex of surface_a, stable for every theta; quadrature, one gap per quadrature point, '// &
      'with a penalty, (18) literally; if absent and layer=.true., quadrature', names=discretization_names, &
      default=option_name(discretization_names, default_discretization))
    call list%add('geometry', kind_name, names=geometry_names, default=option_name(geometry_names, default_geometry), &
      meaning='surface geometry for gaps and normals: smooth, patches with continuous normals over the facets '// &
      '(planes stay flat, and edges between faces of the CAD model sharp); elements, the facets of the mesh')
    call list%add('quadrature', kind_name, 'quadrature points: segments, on the mortar segments (overlaps of '// &
      'facets of the two surfaces), exact on flat faces with any meshes; plain, on whole facets of surface_a', &
      names=quadrature_names, default=option_name(quadrature_names, default_quadrature))
    call list%add('condition', kind_name, names=condition_names, &
      default=option_name(condition_names, default_condition), meaning='interface condition in scheme=''robin'': '// &
      'robin, each body on springs 1/theta; neumann, each body under the last contact pressure')
    call list%add('robin_gap', kind_real, unit='length', &
      meaning='initial gap up to which constraints of this pair have springs; if absent, robin_gap of &solver')

    call list%begin_group('tie', any_number, 'two surfaces that are joined: equal displacements, whatever their '// &
      'meshes', &
      "&tie name='weld', surface_a='rib:foot', surface_b='plate:top' /"//lf// &
      "&tie name='sectors', surface_a='sector:right', surface_b='sector:left', axis=0,0,1, angle=30 /")
    call list%add('name', kind_text, required=.true., &
      meaning='name of the tie; where wildcards name several bodies, their number takes the place of its *')
    call list%add('surface_a', kind_text, required=.true., meaning='slave side, as ''body:surface'': the surface '// &
      'with the finer mesh; * and ? are wildcards: in the body, for a tie of each body that matches with the one '// &
      'in the same place of those of surface_b, or with a single one; in the surface as in &contact')
    call list%add('surface_b', kind_text, required=.true., meaning='master side, as ''body:surface'' of another body')
    call list%add('search_radius', kind_real, unit='length', positive=.true., meaning='greatest distance between '// &
      'the surfaces that is tied, without closing it; if absent, half the size of a facet')
    call list%add('angle', kind_real, unit='degrees', &
      meaning='cyclic symmetry: surface_b, rotated by this angle about axis through centre, lies on surface_a, and '// &
      'its displacements, rotated as much, equal those there; both may be of one body')
    call list%add('axis', kind_real, least=3, most=3, meaning='axis of this rotation (if absent, z)')
    call list%add('centre', kind_real, least=2, most=3, unit='length', meaning='a point on it (if absent, 0)')

    call list%begin_group('bolt', any_number, 'pretension of a bolt: of a body that is cut in two, or of two '// &
      'bodies on both sides of a flat cut; exactly one of force and shortening', &
      "&bolt name='M12', body='bolt *', point=0,0,40, normal=0,0,1, force=35e3 /"//lf// &
      "&bolt name='M12', surface_a='shank:cut', surface_b='head:cut', force=35e3 /")
    call list%add('name', kind_text, required=.true., meaning='name of the bolt')
    call list%add('body', kind_text, "body that the program cuts in two, 'NAME (1)' and 'NAME (2)', with wildcards "// &
      'several; supports, loads, pairs and other groups that name NAME hold for both')
    call list%add('point', kind_real, least=2, most=3, unit='length', meaning='a point of the plane of the cut, '// &
      'with the bodies in place: elements whose centres lie ahead of the plane make up the second half')
    call list%add('normal', kind_real, least=2, most=3, meaning='normal of this plane, the axis of the bolt')
    call list%add('surface', kind_text, 'in place of the plane, a flat surface of the mesh inside the body')
    call list%add('surface_a', kind_text, 'without body, flat cut through the bolt as one half has it, as '// &
      '''body:surface'': the finer mesh')
    call list%add('surface_b', kind_text, 'the same cut as the other half has it')
    call list%add('force', kind_real, unit='force', positive=.true., &
      meaning='tension of the bolt: the halves are pulled together until the cut transmits it')
    call list%add('case', kind_text, 'load cases in which the bolt is tightened by force, with wildcards; in those '// &
      'after them it is locked, with the shortening that it has then; the first case if absent', most=most_names)
    call list%add('shortening', kind_real, unit='length', &
      meaning='length that is taken out of the bolt: the halves overlap by it')
    call list%add('search_radius', kind_real, unit='length', positive=.true., meaning='as in &tie')

    call list%begin_group('case', any_number, 'a load case: loads, values of supports, temperatures, initial '// &
      'stresses, gaps and theta by case; without this group there is one, unnamed', &
      "&case name='pressed' /"//lf// &
      "&case name='hot', history=.true. /"//lf// &
      "&temperature body='ring', value=120, case='hot' /")
    call list%add('name', kind_text, 'name of the load case; groups with the key case refer to it', required=.true.)
    call list%add('history', kind_logical, default='.false.', &
      meaning='the solution starts from the contact pressures of the case before: the results are the same to the '// &
      'tolerance, and where they are near each other it takes fewer iterations')

    call list%begin_group('contact_case', any_number, 'gap or penalty parameter of contact pairs in some load cases', &
      "&contact_case case='hot', contact='fit', gap=-3e-5 /")
    call list%add('case', kind_text, most=most_names, required=.true., &
      meaning='load cases with this gap or theta; * and ? are wildcards')
    call list%add('contact', kind_text, required=.true., &
      meaning='name of the contact pairs, with wildcards; pairs that are found have the names that --check lists')
    call list%add('gap', kind_real, unit='length', meaning='initial gap, in place of that of &contact')
    call list%add('gap_formula', kind_formula, 'initial gap as a formula, evaluated on surface_a', unit='length')
    call list%add('theta', kind_real, unit='length/pressure', not_negative=.true., &
      meaning='penalty parameter, in place of that of &contact')
    call list%add('theta_relative', kind_real, 'the same as a factor of size_a/E_a + size_b/E_b', not_negative=.true.)
    call list%add('theta_mesh', kind_real, not_negative=.true., meaning='the same as a factor of h_a/E_a + h_b/E_b')
    call list%add('theta_formula', kind_formula, unit='length/pressure', &
      meaning='the same as a formula, evaluated on surface_a')
  end subroutine add_contact

  !> Meshes, solver and output.
  pure subroutine add_settings(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('accuracy', at_most_one, 'meshes that the program chooses until the error is small '// &
      'enough: of .geo and CAD files with triangles and tetrahedra', &
      '&accuracy error=0.05 /'//lf// &
      "&accuracy error=0.01, quantity='force:ball - block', 'displacement:block:up z' /")
    call list%add('error', kind_real, required=.true., positive=.true., meaning='largest discretization error, '// &
      'relative, in the energy norm or of each quantity: meshes are made until the estimate is below it and the '// &
      'contact is resolved; else the exit code is 1')
    call list%add('quantity', kind_text, most=20, &
      meaning='quantities whose relative error is to be below error, in place of that of the energy norm: '// &
      "'force:PAIR' or 'force:BODY - BODY', the contact force of a pair, likewise mean_pressure, peak (its "// &
      "greatest pressure) and area; 'displacement:BODY:SURFACE x', the mean displacement of a face along an axis; "// &
      "'reaction:BODY:SURFACE x', that of a support; 'displacement:BODY' or 'displacement:BODY:SURFACE', the "// &
      "greatest displacement; 'mises:BODY' or 'mises:BODY:SURFACE', the greatest von Mises stress; names with "// &
      'wildcards')
    call list%add('aim', kind_name, names=aim_names, default=option_name(aim_names, aim_energy), &
      meaning='energy: all errors count alike; contact: errors at a distance d from a contact patch of the radius '// &
      'a count by 1/(1 + d/a)^2, as with the quantities mean_pressure, peak and area; not with quantity')
    call list%add('max_meshes', kind_integer, default='8', positive=.true., &
      meaning='largest number of meshes, the first one included')
    call list%add('max_unknowns', kind_integer, default='1000000', positive=.true., &
      meaning='number of unknowns up to which meshes are refined')
    call list%add('max_seconds', kind_real, unit='seconds', positive=.true., &
      meaning='time after which no further mesh is begun; if absent, no limit')

    call list%begin_group('mesh_size', any_number, 'size of the elements of a body, of its faces, or at its '// &
      'contact pairs, in .geo and CAD files with triangles and tetrahedra', &
      "&mesh_size body='ball', contact=0.05 /"//lf// &
      "&mesh_size body='flange *', size=4 /"//lf// &
      "&mesh_size body='rod', surface='fillet *', size=0.5 /")
    call list%add('body', kind_text, required=.true., meaning='name of the body, with wildcards as in &support')
    call list%add('surface', kind_text, 'physical group of the face that has the size, with wildcards as in '// &
      '&support; the whole body if absent')
    call list%add('size', kind_real, unit='length', positive=.true., meaning='size of the elements; of several '// &
      'sizes of a face the least holds. Away from faces with smaller ones sizes grow by 0.4 of the distance')
    call list%add('contact', kind_real, unit='length', positive=.true., &
      meaning='size of the elements at the surfaces of the contact pairs of the body')

    call list%begin_group('solver', at_most_one, 'how the contact problem is solved', &
      '&solver theta=0, tolerance=1e-8 /'//lf// &
      "&solver scheme='neumann', theta_mesh=0.1, stop_rule='paper', gamma_rule='theory' /")
    call list%add('scheme', kind_name, names=scheme_names, default=option_name(scheme_names, default_scheme), &
      meaning='auto: dual, or neumann where gamma, gamma_rule or stop_rule=''paper'' is given; dual: primal-dual '// &
      'active set on the Lagrange multipliers, any theta, floating bodies; neumann: the parallel Neumann scheme '// &
      '(43)-(46), for supported bodies and theta > 0; robin: the general iteration (32) with Robin conditions on '// &
      'all constraints, on some (robin_gap) or on some pairs (condition)')
    call list%add('theta', kind_real, unit='length/pressure', not_negative=.true., &
      meaning='penalty parameter, the compliance of a Winkler layer between the bodies; 0: no penetration; if none '// &
      'is given, 0; theta_mesh=0.1 with schemes other than dual, 0.01 with discretization=''quadrature''')
    call list%add('theta_relative', kind_real, not_negative=.true., &
      meaning='penalty parameter as a factor of size_a/E_a + size_b/E_b of each pair; size is the shortest edge of '// &
      'the body if it is a brick, else of the brick with the same moments of inertia')
    call list%add('theta_mesh', kind_real, not_negative=.true., meaning='penalty parameter as a factor of h_a/E_a '// &
      '+ h_b/E_b, point by point; h is the size of the facet')
    call list%add('linear_solver', kind_name, names=linear_solver_names, &
      default=option_name(linear_solver_names, default_linear_solver), meaning='linear systems of the active set '// &
      'in the dual scheme, which also estimates the penalty error of other schemes: direct, columns of the '// &
      'compliance and a factorization; iterative, conjugate gradients; auto, the cheaper one')
    call list%add('response', kind_name, names=response_names, default=option_name(response_names, default_response), &
      meaning='how a body is solved; in dual: multigrid, p-multigrid for all bodies that have one, the contact by '// &
      'displacements; auto, p-multigrid for large bodies that suit it, a factor of the stiffness for all others; '// &
      'full, factors for all; in neumann: full, solves with the factor; compliance, the dense compliance matrix at '// &
      'the contact unknowns, formed once; auto, the cheaper one for each body; robin forms dense compliances')
    call list%add('gamma_rule', kind_name, 'relaxation parameter of neumann and robin: spectral, the best one by '// &
      'eigenvalues, 2/(2+L) in neumann; theory, the best one of Theorem 4, 1/(1+L)^2 in neumann; fixed, gamma; L '// &
      'is the largest eigenvalue of compliance over theta; if absent, fixed where gamma is given, and else theory '// &
      'with stop_rule=''paper''', names=gamma_rule_names, default=option_name(gamma_rule_names, default_gamma_rule))
    call list%add('gamma', kind_real, 'relaxation parameter; alone it means gamma_rule=''fixed''', positive=.true.)
    call list%add('robin_gap', kind_real, unit='length', &
      meaning='initial gap up to which contact constraints have springs in scheme=''robin''; if absent, all have')
    call list%add('stop_rule', kind_name, names=stop_rule_names, meaning='convergence criterion: residual, '// &
      'guaranteed error bound below tolerance; paper, bound (41) below tolerance (neumann, robin); increment, last '// &
      'increment below tolerance (not dual; no measure of the error: not converged where the bound exceeds 0.1)', &
      default=option_name(stop_rule_names, default_stop_rule))
    call list%add('tolerance', kind_real, default=to_text(default_tolerance), positive=.true., &
      meaning='relative tolerance of stop_rule in the energy norm')
    call list%add('max_unbalanced', kind_real, default=to_text(default_max_unbalanced), not_negative=.true., &
      meaning='scheme=''dual'': largest force along a motion of a floating body that supports and contact do not '// &
      'determine, as a fraction of the forces on the body, from 0 to 1: errors of loads and meshes, which weak '// &
      'springs carry; above it the body is not in equilibrium (exit code 1 or 3)')
    call list%add('max_iterations', kind_integer, default=to_text(default_max_iterations), positive=.true., &
      meaning='largest number of iterations')
    call list%add('locking', kind_name, names=locking_names, default=option_name(locking_names, default_locking), &
      meaning='nearly incompressible bodies (Poisson''s ratio above 0.4; not in plane stress): auto, projected '// &
      'dilatation (B-bar), and from 0.45 on linear triangles, tetrahedra, prisms and pyramids are elevated to '// &
      'order 2; ignore, standard elements')
    call list%add('reproducible', kind_logical, default='.false.', &
      meaning='results that do not depend on the number of threads, to the bit')

    call list%begin_group('output', at_most_one, 'contents of the results file', &
      "&output fields='displacement contact', error_parts='', interval=600 /")
    call list%add('fields', kind_names, names=field_names, default=field_names, may_be_empty=.true., &
      meaning='fields to compute and write: displacement; stress; contact: pressure, traction, gap, status; error: '// &
      'discretization error; reaction: forces of the supports at their nodes; nodal_stress: stresses at the nodes, '// &
      'recovered, with von Mises and principal stresses')
    call list%add('error_parts', kind_names, names=error_part_names, default=error_part_names, may_be_empty=.true., &
      meaning='errors to compute besides the iteration error: penalty, the distance to the solution with theta = '// &
      '0; discretization, the estimated error of the mesh')
    call list%add('quantity', kind_text, most=20, &
      meaning='quantities that the log and the results file have with error bars of the mesh, as those of &accuracy')
    call list%add('interval', kind_real, 'time between intermediate results of the schemes neumann and robin, '// &
      "written with status 'running'; the iterates stay the same; 0: results at the end only", &
      default='0', unit='seconds', not_negative=.true.)
  end subroutine add_settings
end module dotyk_input_keyword_table
