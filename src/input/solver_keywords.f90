!> Keys of `&accuracy`, `&mesh_size`, `&solver` and `&output`, for the table of all keys.
module dotyk_input_solver_keywords
  use dotyk_base_options, only: aim_energy, aim_names, default_budget_fraction, default_gamma_rule, &
    default_linear_solver, default_locking, default_max_iterations, default_max_unbalanced, default_response, &
    default_scheme, default_tolerance, error_part_names, field_names, gamma_rule_names, linear_solver_names, &
    locking_names, option_name, response_names, scheme_names, stop_rule_names
  use dotyk_base_text, only: to_text
  use dotyk_input_keywords, only: keyword_list_t, kind_integer, kind_logical, kind_name, kind_names, kind_real, &
    kind_text
  implicit none
  private
  public :: add_accuracy, add_mesh_size, add_output, add_solver

contains

  !> Keys of `&accuracy`.
  pure subroutine add_accuracy(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('accuracy')
    call list%add('error', kind_real, required=.true., positive=.true., &
                  meaning='largest discretization error, relative, in the energy norm or of each quantity: meshes '// &
                  'are made until the estimate is below it and the contact is resolved; else the exit code is 1')
    call list%add('quantity', kind_text, most=20, &
                  meaning='quantities whose relative error is to be below error, in place of that of the energy '// &
                  'norm: ''force:PAIR'' or ''force:BODY - BODY'', the contact force of a pair; '// &
                  '''displacement:BODY:SURFACE x'', the mean displacement of a face along an axis; '// &
                  '''reaction:BODY:SURFACE x'', that of a support; names with wildcards')
    call list%add('aim', kind_name, names=aim_names, default=option_name(aim_names, aim_energy), &
                  meaning='energy: all errors count alike; contact: errors at a distance d from a contact patch of '// &
                  'the radius a count by 1/(1 + d/a)^2, for pressures, peaks and areas; not with quantity')
    call list%add('max_meshes', kind_integer, default='8', positive=.true., &
                  meaning='largest number of meshes, the first one included')
    call list%add('max_unknowns', kind_integer, default='1000000', positive=.true., &
                  meaning='number of unknowns up to which meshes are refined')
    call list%add('max_seconds', kind_real, unit='seconds', positive=.true., &
                  meaning='time after which no further mesh is begun; if absent, no limit')
  end subroutine add_accuracy

  !> Keys of `&mesh_size`.
  pure subroutine add_mesh_size(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('mesh_size')
    call list%add('body', kind_text, required=.true., &
                  meaning='name of the body, with wildcards as in &support')
    call list%add('surface', kind_text, &
                  meaning='physical group of the face that has the size, with wildcards as in &support; the whole '// &
                  'body if absent')
    call list%add('size', kind_real, unit='length', positive=.true., &
                  meaning='size of the elements; of several sizes of a face the least holds. Away from faces with '// &
                  'smaller ones sizes grow by 0.4 of the distance')
    call list%add('contact', kind_real, unit='length', positive=.true., &
                  meaning='size of the elements at the surfaces of the contact pairs of the body')
  end subroutine add_mesh_size

  !> Keys of `&solver`.
  pure subroutine add_solver(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('solver')
    call list%add('scheme', kind_name, names=scheme_names, default=option_name(scheme_names, default_scheme), &
                  meaning='auto: dual, or neumann where gamma, gamma_rule or stop_rule=''paper'' is given; dual: '// &
                  'primal-dual active set on the Lagrange multipliers, any theta, floating bodies; neumann: the '// &
                  'parallel Neumann scheme (43)-(46), for supported bodies and theta > 0; robin: the general '// &
                  'iteration (32) with Robin conditions on all constraints, on some (robin_gap) or on some '// &
                  'pairs (condition)')
    call list%add('theta', kind_real, unit='length/pressure', not_negative=.true., &
                  meaning='penalty parameter, the compliance of a Winkler layer between the bodies; 0: no penetration')
    call list%add('theta_relative', kind_real, not_negative=.true., &
                  meaning='penalty parameter as a factor of size_a/E_a + size_b/E_b of each pair; size is the '// &
                  'shortest edge of the body if it is a brick, else of the brick with the same moments of inertia')
    call list%add('theta_mesh', kind_real, not_negative=.true., &
                  meaning='penalty parameter as a factor of h_a/E_a + h_b/E_b, point by point; h is the size of '// &
                  'the facet; if no theta is given, 0.01 (schemes other than dual: 0.1), reduced where the '// &
                  'penalty error would exceed the discretization error')
    call list%add('linear_solver', kind_name, names=linear_solver_names, &
                  default=option_name(linear_solver_names, default_linear_solver), &
                  meaning='linear systems of the active set in the dual scheme, which also estimates the penalty '// &
                  'error of other schemes: direct, columns of the compliance and a factorization; iterative, '// &
                  'conjugate gradients; auto, the cheaper one')
    call list%add('response', kind_name, names=response_names, default=option_name(response_names, default_response), &
                  meaning='how a body is solved; in dual: multigrid, p-multigrid for all bodies that have '// &
                  'one, the contact by displacements; auto, p-multigrid for large bodies that suit it, a '// &
                  'factor of the stiffness for all others; full, factors for all; in neumann: full, solves with '// &
                  'the factor; compliance, the dense compliance matrix at the contact unknowns, formed once; auto, '// &
                  'the cheaper one for each body; robin forms dense compliances')
    call list%add('gamma_rule', kind_name, names=gamma_rule_names, &
                  default=option_name(gamma_rule_names, default_gamma_rule), &
                  meaning='relaxation parameter of neumann and robin: spectral, the best one by '// &
                  'eigenvalues, 2/(2+L) in neumann; theory, the best one of Theorem 4, 1/(1+L)^2 in neumann; '// &
                  'fixed, gamma; L is the largest eigenvalue of compliance over theta; if absent, fixed where '// &
                  'gamma is given, and else theory with stop_rule=''paper''')
    call list%add('gamma', kind_real, positive=.true., &
                  meaning='relaxation parameter; alone it means gamma_rule=''fixed''')
    call list%add('robin_gap', kind_real, unit='length', &
                  meaning='initial gap up to which contact constraints have springs in scheme=''robin''; if '// &
                  'absent, all have')
    call list%add('stop_rule', kind_name, names=stop_rule_names, &
                  meaning='convergence criterion: residual, guaranteed error bound below tolerance; paper, bound '// &
                  '(41) below tolerance (neumann, robin); increment, last increment below tolerance (not dual; no '// &
                  'measure of the error: not converged where the bound exceeds 0.1); budget, guaranteed error '// &
                  'bound below budget_fraction times the penalty and discretization errors; if absent, budget if '// &
                  'neither tolerance nor any theta but that of layers is given, else residual')
    call list%add('budget_fraction', kind_real, default=to_text(default_budget_fraction), positive=.true., &
                  meaning='largest iteration error as a fraction of the penalty and discretization errors, for '// &
                  'stop_rule=''budget''')
    call list%add('tolerance', kind_real, default=to_text(default_tolerance), positive=.true., &
                  meaning='relative tolerance of stop_rule in the energy norm; not with stop_rule=''budget''')
    call list%add('max_unbalanced', kind_real, default=to_text(default_max_unbalanced), not_negative=.true., &
                  meaning='scheme=''dual'': largest force along a motion of a floating body that supports and '// &
                  'contact do not determine, as a fraction of the forces on the body, from 0 to 1: errors of loads '// &
                  'and meshes, which weak springs carry; above it the body is not in equilibrium (exit code 1 or 3)')
    call list%add('max_iterations', kind_integer, default=to_text(default_max_iterations), positive=.true., &
                  meaning='largest number of iterations')
    call list%add('locking', kind_name, names=locking_names, default=option_name(locking_names, default_locking), &
                  meaning='nearly incompressible bodies (Poisson''s ratio above 0.4; not in plane stress): auto, '// &
                  'projected dilatation (B-bar), and from 0.45 on linear triangles, tetrahedra, prisms and '// &
                  'pyramids are elevated to order 2; ignore, standard elements')
    call list%add('reproducible', kind_logical, default='.false.', &
                  meaning='results that do not depend on the number of threads, to the bit')
  end subroutine add_solver

  !> Keys of `&output`.
  pure subroutine add_output(list)
    type(keyword_list_t), intent(inout) :: list  !! The table so far.
    call list%begin_group('output')
    call list%add('fields', kind_names, names=field_names, default=field_names, may_be_empty=.true., &
                  meaning='fields to compute and write: displacement; stress; contact: pressure, traction, gap, '// &
                  'status; error: discretization error; reaction: forces of the supports at their nodes; '// &
                  'nodal_stress: stresses at the nodes, recovered, with von Mises and principal stresses')
    call list%add('error_parts', kind_names, names=error_part_names, default=error_part_names, may_be_empty=.true., &
                  meaning='errors to compute besides the iteration error: penalty, the distance to the solution '// &
                  'with theta = 0; discretization, the estimated error of the mesh')
    call list%add('quantity', kind_text, most=20, &
                  meaning='quantities that the log and the results file have with error bars of the mesh, as '// &
                  'those of &accuracy')
    call list%add('interval', kind_real, default='0', unit='seconds', not_negative=.true., &
                  meaning='time between intermediate results of an iterative scheme, written with status '// &
                  '''running''; the iterates stay the same; scheme ''dual'' writes between the solutions for the '// &
                  'error budget only; 0: results at the end only')
  end subroutine add_output
end module dotyk_input_solver_keywords
