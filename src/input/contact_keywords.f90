!> Keys of `&contact`, `&tie` and `&bolt`: a part of the table of `dotyk_input_keyword_table`.
module dotyk_input_contact_keywords
  use dotyk_base_options, only: condition_names, default_condition, default_discretization, default_geometry, &
    default_quadrature, discretization_names, geometry_names, option_name, quadrature_names
  use dotyk_input_case_keywords, only: add_case_key
  use dotyk_input_keywords, only: keyword_list_t, kind_formula, kind_logical, kind_name, kind_real, kind_text
  implicit none
  private
  public :: add_bolt, add_contact, add_tie

contains

  !> Keys of `&contact`.
  pure subroutine add_contact(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('contact')
    call list%add('name', kind_text, &
                  meaning='name of the contact pair; required without auto; pairs that are found are called '// &
                  '''name: body - body''')
    call list%add('surface_a', kind_text, &
                  meaning='slave (non-mortar) side, as ''body:surface'': its vertices or quadrature points carry '// &
                  'the contact pressures; choose the surface with the finer mesh, else the curved surface or '// &
                  'that of the softer body; of a curved and a planar surface in 3D choose the curved one, above '// &
                  'all where a body floats; required without auto; * and ? are wildcards: in the body, for a pair '// &
                  'of each two bodies whose surfaces are near each other; in the surface, for the union of all '// &
                  'physical groups of the body (faces in none do not count)')
    call list%add('surface_b', kind_text, &
                  meaning='master (mortar) side, as ''body:surface'' of another body, with wildcards as in '// &
                  'surface_a: points of surface_a are projected on it; a planar surface against a curved one '// &
                  'should be the master; required without auto')
    call list%add('auto', kind_logical, default='.false.', &
                  meaning='a pair of each two bodies whose faces are near each other, and which no other &contact '// &
                  'names; the keys of the group hold for all these pairs')
    call list%add('exclude', kind_text, most=200, &
                  meaning='pairs of bodies that the search leaves out, as ''body - body'', or bodies with all '// &
                  'their pairs; with wildcards')
    call list%add('gap', kind_real, unit='length', &
                  meaning='initial gap, the same everywhere; if absent, the distance between the surfaces')
    call list%add('gap_formula', kind_formula, unit='length', &
                  meaning='initial gap as a formula, evaluated on surface_a')
    call list%add('theta', kind_real, unit='length/pressure', not_negative=.true., &
                  meaning='penalty parameter of this pair; if absent, theta of &solver')
    call list%add('theta_relative', kind_real, not_negative=.true., &
                  meaning='penalty parameter as a factor of size_a/E_a + size_b/E_b; size is the shortest edge of '// &
                  'the body if it is a brick, else of the brick with the same moments of inertia')
    call list%add('theta_mesh', kind_real, not_negative=.true., &
                  meaning='penalty parameter as a factor of h_a/E_a + h_b/E_b, point by point; h is the size of '// &
                  'the facet')
    call list%add('theta_formula', kind_formula, unit='length/pressure', &
                  meaning='penalty parameter as a formula, evaluated on surface_a; contact rows take its weighted mean')
    call list%add('layer', kind_logical, default='.false.', &
                  meaning='theta of this pair is the compliance of a real elastic (Winkler) layer: it is given, '// &
                  'positive, kept by the error budget, and no part of the penalty error')
    call list%add('search_radius', kind_real, unit='length', positive=.true., &
                  meaning='largest distance between a point and its projection; if absent, the size of the '// &
                  'smaller body (its diameter); points beyond it are normal where '// &
                  'surface_a is closed')
    call list%add('discretization', kind_name, names=discretization_names, &
                  default=option_name(discretization_names, default_discretization), &
                  meaning='contact constraints: mortar, dual (biorthogonal) mortar with one weighted gap per '// &
                  'vertex of surface_a, stable for every theta; quadrature, one gap per quadrature point, with a '// &
                  'penalty, (18) literally; if absent and layer=.true., quadrature')
    call list%add('geometry', kind_name, names=geometry_names, default=option_name(geometry_names, default_geometry), &
                  meaning='surface geometry for gaps and normals: smooth, patches with continuous normals over '// &
                  'the facets (planes stay flat, and edges between faces of the CAD model sharp); elements, '// &
                  'the facets of the mesh')
    call list%add('quadrature', kind_name, names=quadrature_names, &
                  default=option_name(quadrature_names, default_quadrature), &
                  meaning='quadrature points: segments, on the mortar segments (overlaps of facets of the two '// &
                  'surfaces), exact on flat faces with any meshes; plain, on whole facets of surface_a')
    call list%add('condition', kind_name, names=condition_names, &
                  default=option_name(condition_names, default_condition), &
                  meaning='interface condition in scheme=''robin'': robin, each body on springs 1/theta; '// &
                  'neumann, each body under the last contact pressure')
    call list%add('robin_gap', kind_real, unit='length', &
                  meaning='initial gap up to which constraints of this pair have springs; if absent, robin_gap of '// &
                  '&solver')
  end subroutine add_contact

  !> Keys of `&tie`.
  pure subroutine add_tie(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('tie')
    call list%add('name', kind_text, required=.true., &
                  meaning='name of the tie; where wildcards name several bodies, their number takes the place of its *')
    call list%add('surface_a', kind_text, required=.true., &
                  meaning='slave side, as ''body:surface'': the surface with the finer mesh; * and ? are '// &
                  'wildcards: in the body, for a tie of each body that matches with the one in the same place of '// &
                  'those of surface_b, or with a single one; in the surface as in &contact')
    call list%add('surface_b', kind_text, required=.true., &
                  meaning='master side, as ''body:surface'' of another body')
    call list%add('search_radius', kind_real, unit='length', positive=.true., &
                  meaning='greatest distance between the surfaces that is tied, without closing it; if absent, '// &
                  'half the size of a facet')
    call list%add('angle', kind_real, unit='degrees', &
                  meaning='cyclic symmetry: surface_b, rotated by this angle about axis through centre, lies on '// &
                  'surface_a, and its displacements, rotated as much, equal those there; both may be of one body')
    call list%add('axis', kind_real, least=3, most=3, &
                  meaning='axis of this rotation (if absent, z)')
    call list%add('centre', kind_real, least=2, most=3, unit='length', &
                  meaning='a point on it (if absent, 0)')
  end subroutine add_tie

  !> Keys of `&bolt`.
  pure subroutine add_bolt(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('bolt')
    call list%add('name', kind_text, required=.true., &
                  meaning='name of the bolt')
    call list%add('body', kind_text, &
                  meaning='body that the program cuts in two, ''NAME (1)'' and ''NAME (2)'', with wildcards '// &
                  'several; supports, loads, pairs and other groups that name NAME hold for both')
    call list%add('point', kind_real, least=2, most=3, unit='length', &
                  meaning='a point of the plane of the cut, with the bodies in place: elements whose centres lie '// &
                  'ahead of the plane make up the second half')
    call list%add('normal', kind_real, least=2, most=3, &
                  meaning='normal of this plane, the axis of the bolt')
    call list%add('surface', kind_text, &
                  meaning='in place of the plane, a flat surface of the mesh inside the body')
    call list%add('surface_a', kind_text, &
                  meaning='without body, flat cut through the bolt as one half has it, as ''body:surface'': the '// &
                  'finer mesh')
    call list%add('surface_b', kind_text, &
                  meaning='the same cut as the other half has it')
    call list%add('force', kind_real, unit='force', positive=.true., &
                  meaning='tension of the bolt: the halves are pulled together until the cut transmits it')
    call add_case_key(list, 'load cases in which the bolt is tightened by force, with wildcards; in those after '// &
                      'them it is locked, with the shortening that it has then; the first case if absent')
    call list%add('shortening', kind_real, unit='length', &
                  meaning='length that is taken out of the bolt: the halves overlap by it')
    call list%add('search_radius', kind_real, unit='length', positive=.true., &
                  meaning='as in &tie')
  end subroutine add_bolt
end module dotyk_input_contact_keywords
