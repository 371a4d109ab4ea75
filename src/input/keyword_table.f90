!> THE table of groups and keys: checks, defaults, `--help` and docs/input.md (`dotyk --help=markdown`) come from here,
!> those of `&solver` and `&output` from `dotyk_input_solver_keywords`, those of `&contact`, `&tie` and `&bolt` from
!> `dotyk_input_contact_keywords`.
module dotyk_input_keyword_table
  use dotyk_base_options, only: analysis_names, default_analysis, option_name
  use dotyk_input_attachments, only: add_mass_keys, add_rigid_keys, add_spring_keys
  use dotyk_input_case_keywords, only: add_case, add_case_key, add_contact_case
  use dotyk_input_contact_keywords, only: add_bolt, add_contact, add_tie
  use dotyk_input_keywords, only: any_number, at_least_one, at_most_one, exactly_one, group_keyword_t, keyword_list_t, &
    keyword_t, kind_formula, kind_integer, kind_logical, kind_name, kind_real, kind_text
  use dotyk_input_solver_keywords, only: add_accuracy, add_mesh_size, add_output, add_solver
  implicit none
  private
  public :: list_groups, list_keywords

  integer, parameter :: most_volumes = 1000  !! Greatest number of volumes of a body.

contains

  !> All groups, in the order of the reference.
  pure subroutine list_groups(groups)
    type(group_keyword_t), allocatable, intent(out) :: groups(:)  !! The groups (n_groups).
    character, parameter :: lf = new_line('a')
    allocate (groups(19))
    groups(1) = group('scene', exactly_one, 'the scene as a whole', &
                      "&scene title='ball on a block', mesh='hertz.geo', analysis='3d' /")
    groups(2) = group('material', at_least_one, 'an elastic material: young and poisson (isotropic), three each of '// &
                      'young, poisson and shear (orthotropic), or stiffness (anisotropic)', &
                      "&material name='steel', young=210e9, poisson=0.3 /"//lf// &
                      "&material name='spruce', young=11e9,0.7e9,0.4e9, poisson=0.4,0.45,0.5,"//lf// &
                      '          shear=0.7e9,0.6e9,0.04e9, axis_1=1,0,0, axis_2=0,1,0 /')
    groups(3) = group('body', at_least_one, 'an elastic body', &
                      "&body name='block', volume='block', material='steel' /"//lf// &
                      "&body name='plate', mesh='plate.msh', surface='plate', facing=0,0,-1 /"//lf// &
                      "&body name='roller 2', mesh='roller.msh', volume='roller', material='steel',"//lf// &
                      '      at=0.1,0,0, axis=0,0,1, angle=15 /'//lf// &
                      "&body name='pin', volume='core', 'shell', material='steel', 'rubber' /"//lf// &
                      "&body name='segment *', volume='segment', material='concrete', repeat=6, axis=0,0,1, angle=60 /")
    groups(4) = group('support', any_number, 'prescribed displacement (Dirichlet condition) on a body surface, '// &
                      'zero where no value is given', &
                      "&support body='block', surface='bottom', fix='xyz' /"//lf// &
                      "&support body='ball', surface='cut', fix='n', value=0,0,-3e-5 /")
    groups(5) = group('spring', any_number, 'springs on a body surface: an elastic support (Winkler foundation); '// &
                      'exactly one of modulus and stiffness', &
                      "&spring body='slab', surface='bottom', fix='n', modulus=50e6 /"//lf// &
                      "&spring body='motor', surface='feet', fix='xyz', stiffness=2e6 /")
    groups(6) = group('rigid_body', any_number, 'makes a body rigid: six motions (three in the plane, one about '// &
                      'an axis), held, moved or free', &
                      "&rigid_body body='punch', fix='xyz rx ry rz', value=0,0,-1e-4 /"//lf// &
                      "&rigid_body body='ball', fix='x y' /")
    groups(7) = group('load', any_number, 'a load on a body: exactly one of traction, pressure, local_traction, '// &
                      'force_density or their formulas, acceleration, angular_velocity, or force and moment', &
                      "&load body='block', surface='side', pressure=1e6 /"//lf// &
                      "&load body='shaft', surface='end', force=0,0,-2e3, moment=0,0,150 /"//lf// &
                      "&load body='block', force_density_formula='0', '0', '-7850*9.81' /"//lf// &
                      "&load body='*', acceleration=0,0,-9.81 /"//lf// &
                      "&load body='disc', angular_velocity=0,0,314, centre=0.2,0,0 /")
    groups(8) = group('mass', any_number, 'a point mass that a body surface carries: its weight under '// &
                      'acceleration, its centrifugal force under angular_velocity', &
                      "&mass body='frame', surface='seat', mass=75, point=0.3,0,1.1 /")
    groups(9) = group('temperature', any_number, 'temperature of a body above that of its unstressed state: '// &
                      'its material expands; exactly one of value, formula and field', &
                      "&temperature body='ring', value=120 /"//lf// &
                      "&temperature body='wall *', formula='20 + 80*x/0.3' /"//lf// &
                      "&temperature body='cover', field='T', reference=20, case='hot' /")
    groups(10) = group('initial_stress', any_number, 'stress that a body has before any displacement; exactly one '// &
                      'of value and formula', &
                      "&initial_stress body='ground', formula='9e3*y', '18e3*y', '9e3*y', '0', '0', '0' /")
    groups(11) = group('contact', any_number, 'a pair of surfaces that may touch', &
                      "&contact name='touch', surface_a='ball:low', surface_b='block:up' /"//lf// &
                      "&contact name='fit', surface_a='shaft:outside', surface_b='hub:inside', gap=-2e-5 /"//lf// &
                      "&contact name='races', surface_a='ball *:ball', surface_b='* ring:race' /"//lf// &
                      "&contact auto=.true., exclude='housing - cover' /")
    groups(12) = group('tie', any_number, 'two surfaces that are joined: equal displacements, whatever their meshes', &
                      "&tie name='weld', surface_a='rib:foot', surface_b='plate:top' /"//lf// &
                      "&tie name='sectors', surface_a='sector:right', surface_b='sector:left', axis=0,0,1, angle=30 /")
    groups(13) = group('bolt', any_number, 'pretension of a bolt: of a body that is cut in two, or of two bodies '// &
                       'on both sides of a flat cut; exactly one of force and shortening', &
                       "&bolt name='M12', body='bolt *', point=0,0,40, normal=0,0,1, force=35e3 /"//lf// &
                       "&bolt name='M12', surface_a='shank:cut', surface_b='head:cut', force=35e3 /")
    groups(14) = group('case', any_number, 'a load case: loads, values of supports, temperatures, initial '// &
                      'stresses, gaps and theta by case; without this group there is one, unnamed', &
                      "&case name='pressed' /"//lf//"&case name='hot', history=.true. /"//lf// &
                      "&temperature body='ring', value=120, case='hot' /")
    groups(15) = group('contact_case', any_number, 'gap or penalty parameter of contact pairs in some load cases', &
                       "&contact_case case='hot', contact='fit', gap=-3e-5 /")
    groups(16) = group('accuracy', at_most_one, 'meshes that the program chooses until the error is small enough: '// &
                      'of .geo and CAD files with triangles and tetrahedra', &
                      '&accuracy error=0.05 /'//lf// &
                      "&accuracy error=0.01, quantity='force:ball - block', 'displacement:block:up z' /")
    groups(17) = group('mesh_size', any_number, 'size of the elements of a body, of its faces, or at its contact '// &
                       'pairs, in .geo and CAD files with triangles and tetrahedra', &
                       "&mesh_size body='ball', contact=0.05 /"//lf// &
                       "&mesh_size body='flange *', size=4 /"//lf// &
                       "&mesh_size body='rod', surface='fillet *', size=0.5 /")
    groups(18) = group('solver', at_most_one, 'how the contact problem is solved', &
                      '&solver theta=0, tolerance=1e-8 /'//lf// &
                      "&solver scheme='neumann', theta_mesh=0.1, stop_rule='paper', gamma_rule='theory' /")
    groups(19) = group('output', at_most_one, 'contents of the results file', &
                      "&output fields='displacement contact', error_parts='', interval=600 /")
  end subroutine list_groups

  !> One group.
  pure function group(name, occurs, meaning, example) result(row)
    character(*), intent(in) :: name  !! Its name in lower case.
    !> How often it may stand in a file, one of `exactly_one`, `at_most_one`, `at_least_one`, `any_number`.
    integer, intent(in) :: occurs
    character(*), intent(in) :: meaning  !! What it describes.
    character(*), intent(in) :: example  !! A typical group.
    type(group_keyword_t) :: row
    row%name = name
    row%occurs = occurs
    row%meaning = meaning
    row%example = example
  end function group

  !> All keys, those of a group together, in the order of the groups.
  pure subroutine list_keywords(table)
    type(keyword_t), allocatable, intent(out) :: table(:)  !! The keys (n_keys).
    type(keyword_list_t) :: list
    call list%init()
    call add_scene(list)
    call add_material(list)
    call add_body(list)
    call add_support(list)
    call add_spring_keys(list)
    call add_rigid_keys(list)
    call add_load(list)
    call add_mass_keys(list)
    call add_temperature(list)
    call add_initial_stress(list)
    call add_contact(list)
    call add_tie(list)
    call add_bolt(list)
    call add_case(list)
    call add_contact_case(list)
    call add_accuracy(list)
    call add_mesh_size(list)
    call add_solver(list)
    call add_output(list)
    call move_alloc(list%row, table)
  end subroutine list_keywords

  !> Keys of `&scene`.
  pure subroutine add_scene(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('scene')
    call list%add('title', kind_text, may_be_empty=.true., &
                  meaning='title')
    call list%add('mesh', kind_text, &
                  'mesh file of all bodies without a mesh key: .msh (gmsh 2.2 or 4.1), .geo (meshed by gmsh), .inp '// &
                  '(Abaqus, CalculiX: sets of elements are volumes, surfaces and sets of nodes surfaces), .vtu '// &
                  '(VTK: values of arrays of integers of cells are volumes and surfaces, those of points '// &
                  'surfaces), .med and other formats of meshio, or a CAD file (.step, .stp, .iges, .igs, .brep, '// &
                  '.brp, .stl; meshed by gmsh, lengths in mm; each closed surface of an .stl file is a solid), '// &
                  'whose volumes are solid 1, solid 2, ..., and whose surfaces face 1, face 2, ..., as gmsh '// &
                  'numbers them; relative to the namelist file')
    call list%add('mesh_size', kind_real, unit='length', positive=.true., &
                  meaning='size of the elements in CAD files; smaller at curved faces (16 around a circle); if '// &
                  'absent, a twelfth of the largest extent of each solid')
    call list%add('mesh_order', kind_integer, positive=.true., default='2', &
                  meaning='order of the elements in CAD files, 1 or 2')
    call list%add('output', kind_text, &
                  'results file, relative to the namelist file; if absent, the namelist file with extension .vtkhdf')
    call list%add('analysis', kind_name, names=analysis_names, default=option_name(analysis_names, default_analysis), &
                  meaning='type of analysis; axisymmetric: y is the axis, x the radius')
  end subroutine add_scene

  !> Keys of `&material`.
  pure subroutine add_material(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('material')
    call list%add('name', kind_text, required=.true., &
                  meaning='name of the material')
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
    call list%add('stiffness', kind_real, least=21, most=21, unit='pressure', &
                  meaning='anisotropic: upper triangle of the elasticity matrix by rows, order 11 22 33 23 13 12 '// &
                  'of its axes, xx yy zz yz xz xy where axis_1 and axis_2 are not given')
    call list%add('young_formula', kind_formula, most=3, &
                  meaning='one: modulus field, dimensionless factor of the elasticity matrix as a formula; without '// &
                  'young it is Young''s modulus itself [pressure]; three, without young: Young''s moduli of an '// &
                  'orthotropic material [pressure]')
    call list%add('poisson_formula', kind_formula, most=3, &
                  meaning='Poisson''s ratio as formulas, in place of poisson')
    call list%add('shear_formula', kind_formula, least=3, most=3, unit='pressure', &
                  meaning='shear moduli as formulas, in place of shear')
    call list%add('stiffness_formula', kind_formula, least=21, most=21, unit='pressure', &
                  meaning='stiffness as formulas, in place of it')
    call list%add('density', kind_real, unit='mass/volume', positive=.true., &
                  meaning='density, for angular_velocity and acceleration of &load')
    call list%add('density_formula', kind_formula, unit='mass/volume', &
                  meaning='density as a formula')
    call list%add('expansion', kind_real, most=3, unit='1/temperature', &
                  meaning='coefficient of thermal expansion; orthotropic or anisotropic: one, or three along the '// &
                  'axes 1, 2, 3')
    call list%add('expansion_formula', kind_formula, most=3, unit='1/temperature', &
                  meaning='expansion as formulas')
  end subroutine add_material

  !> Keys of `&body`.
  pure subroutine add_body(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('body')
    call list%add('name', kind_text, required=.true., &
                  meaning='name of the body')
    call list%add('volume', kind_text, most=most_volumes, &
                  meaning='physical group of the elements in the mesh (in two dimensions a physical surface); '// &
                  'several ones that share nodes are one body; required but with surface')
    call list%add('material', kind_text, most=most_volumes, &
                  meaning='name of the material; of several volumes, one for all or one each; required but with '// &
                  'surface')
    call list%add('surface', kind_text, &
                  meaning='in place of volume, for a body of &rigid_body: physical group of a surface, in two '// &
                  'dimensions of a curve, without elements behind it. It has no material; one of its sides touches '// &
                  'others')
    call list%add('facing', kind_real, least=2, most=3, unit='length', &
                  meaning='with surface: a point that sees the side of contact, in coordinates of the mesh. '// &
                  'Required where the surface is open; of a closed one the outside touches others, if absent. The '// &
                  'orientation of the facets in the file does not matter')
    call list%add('mesh', kind_text, &
                  'mesh file of the body; if absent, mesh of &scene')
    call list%add('at', kind_real, least=2, most=3, unit='length', &
                  meaning='translation of the mesh, after the rotation (if absent, 0): many bodies may use one '// &
                  'meshed volume; in axisymmetric analyses along y only')
    call list%add('axis', kind_real, least=3, most=3, &
                  meaning='axis of rotation, through the origin of the mesh (if absent, z); material axes rotate '// &
                  'with the body; supports, loads and formulas in x, y, z use global axes')
    call list%add('angle', kind_real, most=3, unit='degrees', &
                  meaning='angle of rotation about axis; with repeat, the angle from copy to copy; not in '// &
                  'axisymmetric analyses')
    call list%add('repeat', kind_integer, most=3, positive=.true., &
                  meaning='number of copies of the body, or two or three numbers for an array of copies; each copy '// &
                  'is the first one rotated about axis through centre by a multiple of angle, then translated '// &
                  'by a multiple of shift; numbers of the copies, from 1, replace the * of name, and of volume: '// &
                  'segment 1, segment 2; in arrays, the first number fastest, a single * gets all numbers '// &
                  '(ball 1 1, ball 2 1), several * get one each')
    call list%add('shift', kind_real, least=2, most=9, unit='length', &
                  meaning='translation from copy to copy, one vector for each number of repeat')
    call list%add('centre', kind_real, least=2, most=3, unit='length', &
                  meaning='point on the axis about which copies are rotated (if absent, 0)')
    call list%add('first_angle', kind_real, unit='degrees', &
                  meaning='angle of rotation of the first copy about axis, through the origin of its mesh')
    call list%add('crack', kind_logical, default='.false.', &
                  meaning='faces of the body that touch without common nodes are a crack, whose sides do not see '// &
                  'each other; otherwise such a body is refused')
  end subroutine add_body

  !> Keys of `&support`.
  pure subroutine add_support(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('support')
    call list%add('body', kind_text, required=.true., &
                  meaning='name of the body; * and ? are wildcards: all bodies with such names that '// &
                  'have the surface; those that are rigid have no support')
    call list%add('surface', kind_text, required=.true., &
                  meaning='physical group of the surface (in two dimensions a physical curve); with wildcards, the '// &
                  'union of all physical groups that the body has')
    call list%add('fix', kind_text, required=.true., &
                  meaning='directions with prescribed displacement: letters of ''xyz'' (global axes), or of n, t '// &
                  '(both tangents), xi, eta (axes of the surface: n is the outward normal, xi the global x axis '// &
                  'projected on the surface, y where that vanishes, eta = n x xi)')
    call list%add('value', kind_real, least=2, most=3, unit='length', &
                  meaning='prescribed displacement in the axes chosen by fix: x, y, z or xi, eta, n (in two '// &
                  'dimensions x, y or xi, n)')
    call list%add('value_formula', kind_formula, least=2, most=3, unit='length', &
                  meaning='value as formulas')
    call add_case_key(list, 'load cases in which value holds, with wildcards; in the others the surface is held '// &
                      'without displacement along fix, unless another &support of the same surface and fix has them')
  end subroutine add_support

  !> Keys of `&load`.
  pure subroutine add_load(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('load')
    call list%add('body', kind_text, required=.true., &
                  meaning='name of the body, with wildcards as in &support')
    call list%add('surface', kind_text, &
                  'physical group of the surface, with wildcards as in &support; not with force_density, '// &
                  'acceleration and angular_velocity')
    call list%add('traction', kind_real, least=2, most=3, unit='pressure', &
                  meaning='force per area in global axes')
    call list%add('pressure', kind_real, unit='pressure', &
                  meaning='force per area along the inward normal: a positive pressure pushes into the body')
    call list%add('local_traction', kind_real, least=2, most=3, unit='pressure', &
                  meaning='force per area in the axes of the surface: xi, eta, n (in two dimensions xi, n)')
    call list%add('force_density', kind_real, least=2, most=3, unit='force/volume', &
                  meaning='force per volume in global axes')
    call list%add('traction_formula', kind_formula, least=2, most=3, unit='pressure', &
                  meaning='traction as formulas')
    call list%add('pressure_formula', kind_formula, unit='pressure', &
                  meaning='pressure as a formula')
    call list%add('local_traction_formula', kind_formula, least=2, most=3, unit='pressure', &
                  meaning='local_traction as formulas')
    call list%add('force_density_formula', kind_formula, least=2, most=3, unit='force/volume', &
                  meaning='force_density as formulas')
    call list%add('acceleration', kind_real, least=2, most=3, unit='force/mass', &
                  meaning='force per mass in global axes, such as gravity: the density of the material times it is '// &
                  'a force density, point masses (&mass) bear it, too; in axisymmetry along the axis y')
    call list%add('angular_velocity', kind_real, most=3, unit='1/time', &
                  meaning='rotation about an axis through centre, in radians per time: the centrifugal force, '// &
                  'density times angular_velocity squared times the distance from the axis; one value in two '// &
                  'dimensions: about z, in axisymmetry about the axis y')
    call list%add('centre', kind_real, least=2, most=3, unit='length', &
                  meaning='a point on the axis of angular_velocity; the origin if absent; not in axisymmetry')
    call list%add('force', kind_real, least=2, most=3, unit='force', &
                  meaning='total force in global axes, spread over the surface with moment as a traction that is '// &
                  'linear in the position, a + b x (x - c): its resultants are exact on any mesh; in the plane per '// &
                  'unit thickness, in axisymmetric analyses on the full circumference along the axis. Of several '// &
                  'bodies each gets it')
    call list%add('moment', kind_real, least=1, most=3, unit='force*length', &
                  meaning='total moment, likewise; in two dimensions that about z; not in axisymmetric analyses')
    call list%add('point', kind_real, least=2, most=3, unit='length', &
                  meaning='point that force and moment refer to, the centroid of the surface if not given')
    call add_case_key(list, 'load cases with this load, with wildcards; all if absent')
  end subroutine add_load

  !> Keys of `&temperature`.
  pure subroutine add_temperature(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('temperature')
    call list%add('body', kind_text, required=.true., &
                  meaning='name of the body, with wildcards as in &support; its material has an expansion')
    call list%add('value', kind_real, unit='temperature', &
                  meaning='temperature above that of the unstressed body')
    call list%add('formula', kind_formula, unit='temperature', &
                  meaning='the same as a formula; between the nodes the shape functions interpolate')
    call list%add('field', kind_text, &
                  meaning='the same at the nodes from the mesh file, as a thermal analysis writes it: name of an '// &
                  'array of the points of a .vtu file or of a format of meshio, or of $NodeData of a .msh file; in '// &
                  'a deck (.inp) temperature (*TEMPERATURE; temperature step 2 where several steps have it) or '// &
                  'initial_temperature (*INITIAL CONDITIONS)')
    call list%add('reference', kind_real, unit='temperature', &
                  meaning='with field, temperature of the unstressed body in its units (if absent, 0)')
    call add_case_key(list, 'load cases with this temperature, with wildcards; all if absent')
  end subroutine add_temperature

  !> Keys of `&initial_stress`.
  pure subroutine add_initial_stress(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('initial_stress')
    call list%add('body', kind_text, required=.true., &
                  meaning='name of the body, with wildcards as in &support')
    call list%add('value', kind_real, least=6, most=6, unit='pressure', &
                  meaning='stresses xx, yy, zz, xy, yz, xz in global axes (zz: hoop stress in axisymmetry); yz and '// &
                  'xz are 0 in two dimensions, zz too in plane stress')
    call list%add('formula', kind_formula, least=6, most=6, unit='pressure', &
                  meaning='the same as formulas; between the nodes the shape functions interpolate')
    call add_case_key(list, 'load cases with this stress, with wildcards; all if absent')
  end subroutine add_initial_stress
end module dotyk_input_keyword_table
