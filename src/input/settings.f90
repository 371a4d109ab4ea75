!> Reads the settings of a run from checked groups: `&scene`, `&accuracy`, `&mesh_size`, `&solver`, `&output`, load
!> cases (`&case`, the key `case` of other groups, `&contact_case`) and the penalty parameter of a group. Keys of
!> `&solver` that the chosen scheme or stopping rule would ignore are mistakes of the input.
module dotyk_input_settings
  use dotyk_base_files, only: is_cad_file, is_foreign_mesh, is_geo_file, is_msh_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_operating_system, only: directory_of
  use dotyk_base_options, only: analysis_3d, error_part_discretization, error_part_penalty, field_error, gamma_fixed, &
    gamma_theory, gap_constant, gap_formula, last_linear_quantity, linear_solver_auto, n_fields, option_name, &
    quantity_displacement, quantity_mises, quantity_names, quantity_of_pair, quantity_reaction, quantity_travel, &
    response_auto, response_full, response_multigrid, scheme_auto, scheme_dual, scheme_names, scheme_neumann, &
    scheme_robin, stop_increment, stop_paper, theta_absolute, theta_formula, theta_mesh, theta_names
  use dotyk_base_text, only: matches, quoted, shown, text_t, to_text
  use dotyk_input_case, only: accuracy_input_t, body_input_t, contact_case_input_t, contact_input_t, &
    load_case_input_t, mesh_size_input_t, output_input_t, quantity_input_t, scene_input_t, solver_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_paths, only: is_directory, resolve_path, why_not_readable, without_extension
  use dotyk_input_references, only: input_t, names_several
  implicit none
  private
  public :: read_accuracy, read_mesh_sizes, read_scene, read_solver, read_output, read_theta, read_mesh_path, &
    read_contact_cases, read_load_cases, read_quantities, check_solver_keys

  !> theta_mesh where no theta is given: of schemes other than the dual one, whose number of iterations grows like
  !> 1/theta, and of constraints at quadrature points, which outnumber the unknowns of their surface [].
  real(dp), parameter :: theta_of_iterations = 0.1_dp
  real(dp), parameter, public :: theta_of_points = 0.01_dp

  !> Schemes with a relaxation parameter, which (41) is about.
  integer, parameter :: schemes_of_paper(2) = [scheme_neumann, scheme_robin]
  character(*), parameter :: names_of_paper = '''neumann'' or ''robin'''

contains

  !> Read `&scene`.
  subroutine read_scene(group, input, file, scene)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: file  !! Path of the namelist file.
    type(scene_input_t), intent(out) :: scene  !! The scene; incomplete where the group has mistakes.
    scene%line = group%line
    scene%title = group%text_of('title')
    scene%analysis = group%integer_of('analysis')
    ! A wrong analysis leaves the dimension unknown: nothing is checked against it.
    scene%dimension = 0
    if (scene%analysis > 0) scene%dimension = merge(3, 2, scene%analysis == analysis_3d)
    input%scene%dimension = scene%dimension
    call read_mesh_path(group, input, directory_of(file), scene%mesh)
    scene%mesh_size = group%real_of('mesh_size')
    scene%mesh_order = group%integer_of('mesh_order')
    if (group%is_usable('mesh_order') .and. scene%mesh_order > 2) &
      call input%report(group, 'mesh_order', 'mesh_order must be 1 or 2')
    if (group%is_given('output')) then
      scene%output = resolve_path(directory_of(file), group%text_of('output'))
    else
      scene%output = without_extension(file)//'.vtkhdf'
    end if
    if (len(scene%output) == 0) return
    if (is_directory(scene%output)) then
      call input%report(group, 'output', 'output: '//shown(scene%output)//' is a directory')
    else if (scene%output == file .or. scene%output == scene%mesh) then
      call input%report(group, 'output', 'output: '//shown(scene%output)//' is an input file')
    end if
  end subroutine read_scene

  !> Read the mesh of a group: a readable file with a known extension.
  subroutine read_mesh_path(group, input, directory, path)
    type(group_t), intent(in) :: group  !! `&scene` or `&body`.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: directory  !! Directory of the namelist file.
    character(:), allocatable, intent(out) :: path  !! Path of the mesh; empty where it is not given.
    character(:), allocatable :: reason
    path = resolve_path(directory, group%text_of('mesh'))
    if (len(path) == 0) return
    if (.not. (is_msh_file(path) .or. is_geo_file(path) .or. is_cad_file(path) .or. is_foreign_mesh(path))) &
      call input%report(group, 'mesh', 'mesh: '//shown(path)//' must end with .msh, .geo, .inp, .vtu, .med, '// &
                        'another ending of meshio (.vtk, .xdmf, .exo, .bdf, .nas, .mesh, .su2) or that of a CAD '// &
                        'file: .step, .stp, .iges, .igs, .brep, .brp, .stl')
    if (input%scene%dimension == 2 .and. is_cad_file(path)) &
      call input%report(group, 'mesh', 'mesh: '//shown(path)//' has solids, which need analysis=''3d''; for bodies '// &
                        'in the plane write a .geo file')
    reason = why_not_readable(path)
    if (len(reason) > 0) call input%report(group, 'mesh', 'mesh: '//shown(path)//' '//reason)
  end subroutine read_mesh_path

  !> Read `&accuracy`.
  subroutine read_accuracy(group, input, body, accuracy)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(accuracy_input_t), intent(out) :: accuracy  !! What is asked for.
    integer :: b
    accuracy%line = group%line
    accuracy%is_given = .true.
    accuracy%error = group%real_of('error')
    if (group%is_usable('error') .and. .not. accuracy%error < 1) &
      call input%report(group, 'error', 'error is a fraction of the energy norm below 1, 0.05 for 5 %, got '// &
                        to_text(accuracy%error))
    accuracy%aim = group%integer_of('aim')
    if (group%is_given('quantity')) call input%refuse(group, 'aim', 'quantity')
    accuracy%max_meshes = group%integer_of('max_meshes')
    accuracy%max_unknowns = group%integer_of('max_unknowns')
    accuracy%max_seconds = group%real_of('max_seconds')
    do b = 1, size(body)
      if (is_meshed(group, input, body(b))) cycle
      return
    end do
  end subroutine read_accuracy

  !> Read all `&mesh_size`.
  subroutine read_mesh_sizes(groups, input, body, mesh_size)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(mesh_size_input_t), allocatable, intent(out) :: mesh_size(:)  !! The sizes (n_mesh_sizes).
    type(mesh_size_input_t) :: new
    integer, allocatable :: picked(:), matched(:)
    integer :: i, k
    allocate (mesh_size(0))
    call pick_groups(groups, 'mesh_size', picked)
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call input%begin_action(group, new, matched)
        new%size = group%real_of('size')
        new%contact = group%real_of('contact')
        if (.not. (group%is_given('size') .or. group%is_given('contact'))) &
          call input%add(group%line, '&mesh_size: one of size (of the body, or of its surface) and contact (at its '// &
                         'contact pairs) is needed')
        if (group%is_given('surface') .and. .not. group%is_given('size') .and. group%is_given('contact')) &
          call input%report(group, 'surface', 'surface has no size: give size, or remove surface')
        do k = 1, size(matched)
          new%body = matched(k)
          if (matched(k) <= size(body)) then
            if (.not. is_meshed(group, input, body(matched(k)))) exit
          end if
          mesh_size = [mesh_size, new]
        end do
      end associate
    end do
  end subroutine read_mesh_sizes

  !> Whether gmsh makes the mesh of a body; reported if not.
  logical function is_meshed(group, input, body)
    type(group_t), intent(in) :: group  !! Group that needs it.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body  !! The body.
    is_meshed = len(body%mesh) == 0 .or. is_cad_file(body%mesh) .or. is_geo_file(body%mesh)
    if (.not. is_meshed) &
      call input%add(group%line, '&'//group%name//': the mesh of body '//quoted(body%name)//' is no geometry: '// &
                     shown(body%mesh)//'; gmsh makes new meshes of .geo and CAD files')
  end function is_meshed

  !> Read `&solver`.
  subroutine read_solver(group, input, solver)
    type(group_t), intent(in) :: group  !! Checked group; only defaults where the file has none.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(solver_input_t), intent(out) :: solver  !! Settings of the solver; incomplete where the group has mistakes.
    solver%line = group%line
    solver%scheme = group%integer_of('scheme')
    call read_theta(group, input, solver%theta_given, solver%theta_kind, solver%theta)
    solver%linear_solver = group%integer_of('linear_solver')
    solver%response = group%integer_of('response')
    solver%gamma_rule = group%integer_of('gamma_rule')
    solver%gamma = group%real_of('gamma')
    if (group%is_given('gamma') .and. .not. group%is_given('gamma_rule')) solver%gamma_rule = gamma_fixed
    if (group%is_usable('gamma_rule')) then
      if (group%is_given('gamma') .and. solver%gamma_rule /= gamma_fixed) &
        call input%report(group, 'gamma', 'gamma is given, but gamma_rule is not ''fixed''; remove one of them')
      if (.not. group%is_given('gamma') .and. solver%gamma_rule == gamma_fixed) &
        call input%report(group, 'gamma_rule', '''gamma'' is missing: gamma_rule is ''fixed''')
    end if
    solver%stop_rule = group%integer_of('stop_rule')
    ! (41) needs a gamma that Theorem 4 is about.
    if (solver%stop_rule == stop_paper .and. .not. (group%is_given('gamma') .or. group%is_given('gamma_rule'))) &
      solver%gamma_rule = gamma_theory
    ! The options of the paper select its scheme.
    if (solver%scheme == scheme_auto .and. (group%is_given('gamma') .or. group%is_given('gamma_rule') .or. &
                                            solver%stop_rule == stop_paper)) solver%scheme = scheme_neumann
    if (.not. solver%theta_given .and. all(solver%scheme /= [scheme_auto, scheme_dual])) &
      solver%theta = theta_of_iterations
    if (group%is_usable('robin_gap')) solver%robin_gap = group%real_of('robin_gap')
    solver%tolerance = group%real_of('tolerance')
    solver%max_unbalanced = group%real_of('max_unbalanced')
    if (group%is_usable('max_unbalanced') .and. solver%max_unbalanced > 1) &
      call input%report(group, 'max_unbalanced', 'max_unbalanced is a fraction of the forces on a body, from 0 to '// &
                        '1, got '//to_text(solver%max_unbalanced))
    solver%max_iterations = group%integer_of('max_iterations')
    solver%locking = group%integer_of('locking')
    solver%reproducible = group%logical_of('reproducible')
  end subroutine read_solver

  !> Read the penalty parameter of a group.
  subroutine read_theta(group, input, given, kind, theta)
    type(group_t), intent(in) :: group  !! `&solver` or `&contact`.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    logical, intent(out) :: given  !! Whether the group has one.
    integer, intent(out) :: kind  !! One of `theta_*`.
    !> Penalty parameter [length/pressure], or the factor of the relative one; 1 where it is a formula [1].
    real(dp), intent(out) :: theta
    integer :: k
    kind = theta_mesh
    theta = 0
    given = .false.
    do k = theta_absolute, theta_formula
      if (.not. group%is_given(option_name(theta_names, k))) cycle
      if (given) then
        call input%report(group, option_name(theta_names, k), option_name(theta_names, kind)//' and '// &
                          option_name(theta_names, k)//' are both given: only one can be meant')
        cycle
      end if
      given = .true.
      kind = k
      theta = 1
      if (k /= theta_formula) theta = group%real_of(option_name(theta_names, k))
    end do
  end subroutine read_theta

  !> Read `&output`.
  subroutine read_output(group, output)
    type(group_t), intent(in) :: group  !! Checked group; only defaults where the file has none.
    type(output_input_t), intent(out) :: output  !! Contents of the results file.
    integer :: k
    output%line = group%line
    output%field = [(group%has_option('fields', k), k=1, n_fields)]
    output%error_penalty = group%has_option('error_parts', error_part_penalty)
    ! Who asks for the field asks for the estimate.
    output%error_discretization = group%has_option('error_parts', error_part_discretization) .or. &
                                  (output%field(field_error) .and. group%is_given('fields'))
    output%field(field_error) = output%field(field_error) .and. output%error_discretization
    output%interval = group%real_of('interval')
  end subroutine read_output

  !> Read all `&case`.
  subroutine read_load_cases(groups, input, load_case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    !> The cases; none where the file has no such group (n_cases).
    type(load_case_input_t), allocatable, intent(out) :: load_case(:)
    integer, allocatable :: picked(:)
    integer :: i
    call pick_groups(groups, 'case', picked)
    allocate (load_case(size(picked)))
    do i = 1, size(picked)
      associate (group => groups(picked(i)), own => load_case(i))
        own%line = group%line
        own%name = group%text_of('name')
        own%continues = group%logical_of('history')
        ! The name becomes that of a folder in the results file.
        if (index(own%name, '/') > 0 .or. own%name == '.' .or. own%name == '..') &
          call input%report(group, 'name', 'name: '//shown(own%name)//' cannot name a folder of the results file')
        if (i == 1 .and. own%continues) &
          call input%report(group, 'history', 'history: the first case has no case before it')
      end associate
    end do
  end subroutine read_load_cases

  !> Read all `&contact_case`.
  subroutine read_contact_cases(groups, input, contact, contact_case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(contact_input_t), intent(in) :: contact(:)  !! Contact pairs as the file has them (n_contacts).
    type(contact_case_input_t), allocatable, intent(out) :: contact_case(:)  !! Gaps and theta (n_contact_cases).
    integer, allocatable :: picked(:)
    integer :: i
    call pick_groups(groups, 'contact_case', picked)
    allocate (contact_case(size(picked)))
    do i = 1, size(picked)
      call input%cases_of(groups(picked(i)), contact_case(i)%in_case)
      call read_contact_case(groups(picked(i)), input, contact, contact_case(i))
    end do
  end subroutine read_contact_cases

  !> Read one `&contact_case`.
  subroutine read_contact_case(group, input, contact, own)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(contact_input_t), intent(in) :: contact(:)  !! Contact pairs as the file has them (n_contacts).
    type(contact_case_input_t), intent(inout) :: own  !! Gets gap and penalty parameter.
    integer :: k
    own%line = group%line
    own%contact = group%text_of('contact')
    own%gap = group%real_of('gap')
    own%gap_formula = group%text_of('gap_formula')
    own%has_gap = group%is_given('gap') .or. group%is_given('gap_formula')
    own%gap_kind = merge(gap_formula, gap_constant, group%is_given('gap_formula'))
    if (group%is_given('gap') .and. group%is_given('gap_formula')) &
      call input%report(group, 'gap', 'gap and gap_formula are both given: only one can be meant')
    call read_theta(group, input, own%has_theta, own%theta_kind, own%theta)
    own%theta_formula = group%text_of('theta_formula')
    if (.not. (own%has_gap .or. own%has_theta)) call input%add(group%line, '&contact_case: a gap or a theta is missing')
    if (own%has_theta .and. own%theta_kind /= theta_formula .and. .not. abs(own%theta) > 0 .and. &
        all(input%solver%scheme /= [scheme_auto, scheme_dual])) call input%report(group, option_name(theta_names, &
        own%theta_kind), 'theta = 0 needs scheme=''dual'', got '''//option_name(scheme_names, input%solver%scheme)// &
        '''')
    ! Pairs that are found have their names after the search.
    if (len(own%contact) == 0 .or. any(contact%searched)) return
    if (any([(matches(own%contact, contact(k)%name), k=1, size(contact))])) return
    call input%report(group, 'contact', 'contact: no &contact has a name like '//shown(own%contact))
  end subroutine read_contact_case

  !> Append the quantities of a group.
  subroutine read_quantities(group, input, is_goal, quantity)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    logical, intent(in) :: is_goal  !! Whether meshes are made for them.
    type(quantity_input_t), allocatable, intent(inout) :: quantity(:)  !! The quantities (n).
    type(text_t), allocatable :: texts(:)
    type(quantity_input_t) :: new
    integer :: i
    logical :: is_known
    call group%texts_of('quantity', texts)
    do i = 1, size(texts)
      call read_one(group, input, texts(i)%s, new, is_known)
      new%is_goal = is_goal
      if (is_known) quantity = [quantity, new]
    end do
  end subroutine read_quantities

  !> Read one of them.
  subroutine read_one(group, input, text, quantity, is_known)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: text  !! The text.
    type(quantity_input_t), intent(out) :: quantity  !! The quantity.
    logical, intent(out) :: is_known  !! Whether it is one.
    character(:), allocatable :: kind, place
    integer, allocatable :: matched(:)
    integer :: blank, colon, k
    is_known = .false.
    quantity%line = group%line
    quantity%text = text
    quantity%surface = ''
    colon = index(text, ':')
    kind = ''
    if (colon > 0) kind = trim(adjustl(text(:colon - 1)))
    quantity%kind = findloc([(option_name(quantity_names, k) == kind, k=1, quantity_mises)], .true., 1)
    place = trim(adjustl(text(colon + 1:)))
    if (quantity_of_pair(quantity%kind)) then
      quantity%name = place
      is_known = len(place) > 0
    else if (quantity%kind > 0) then
      blank = index(place, ' ', back=.true.)
      colon = index(place, ':')
      if (any(quantity%kind == [quantity_displacement, quantity_reaction]) .and. blank > colon + 1 .and. &
          colon > 0 .and. blank + 1 == len(place)) then
        quantity%axis = index('xyz', place(blank + 1:))
        if (quantity%axis > 0) place = trim(place(:blank))
      end if
      if (quantity%kind == quantity_displacement .and. quantity%axis == 0) quantity%kind = quantity_travel
      quantity%name = place
      if (colon > 0) then
        quantity%name = trim(place(:colon - 1))
        quantity%surface = trim(adjustl(place(colon + 1:)))
      end if
      is_known = len(quantity%name) > 0 .and. (colon == 0 .or. len(quantity%surface) > 0) .and. &
        (quantity%axis > 0 .eqv. quantity%kind <= last_linear_quantity) .and. &
        (quantity%axis <= input%scene%dimension .or. input%scene%dimension == 0)
    end if
    if (.not. is_known) then
      call input%report(group, 'quantity', 'quantity: '//shown(text)//' is none of ''KIND:NAME OF A CONTACT '// &
                        'PAIR'' or ''KIND:BODY - BODY'' of the kinds force, mean_pressure, peak, area; '// &
                        '''displacement:BODY:SURFACE x'', ''reaction:BODY:SURFACE x'', x an axis of the scene; '// &
                        '''displacement:BODY'', ''displacement:BODY:SURFACE'', ''mises:BODY'', '// &
                        '''mises:BODY:SURFACE''')
      return
    end if
    if (quantity_of_pair(quantity%kind)) return
    call input%refer_to_bodies(group, 'quantity', quantity%name, matched)
    quantity%any_body = names_several(quantity%name, input%bodies)
    is_known = size(matched) > 0
    quantity%body = matched
  end subroutine read_one

  !> Report every given key that has no effect.
  subroutine check_solver_keys(group, input, solver, wants_penalty_error)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(solver_input_t), intent(in) :: solver  !! What was read from it, with scheme and stopping rule resolved.
    logical, intent(in) :: wants_penalty_error  !! Whether the penalty error is estimated, by the dual scheme.
    character(:), allocatable :: name
    integer :: scheme
    if (group%is_usable('scheme')) then
      scheme = merge(scheme_dual, solver%scheme, solver%scheme == scheme_auto)
      name = 'scheme='''//option_name(scheme_names, scheme)//''''
      call check_relaxation('gamma')
      call check_relaxation('gamma_rule')
      call check_stop_rule()
      if (group%is_given('robin_gap') .and. scheme /= scheme_robin) &
        call input%report(group, 'robin_gap', 'robin_gap is for scheme=''robin''; '//name// &
                          ' does not use it: remove it, or set scheme=''robin''')
      if (group%is_given('max_unbalanced') .and. scheme /= scheme_dual) &
        call input%report(group, 'max_unbalanced', 'max_unbalanced is about floating bodies, for scheme=''dual''; '// &
                          name//' has none: remove it')
      call check_response()
      if (scheme /= scheme_dual .and. .not. wants_penalty_error .and. group%is_usable('linear_solver') .and. &
          solver%linear_solver /= linear_solver_auto) call input%report(group, 'linear_solver', 'linear_solver is '// &
          'for scheme=''dual'' and estimates of the penalty error, and this run has neither; remove it')
    end if

  contains

    !> gamma and gamma_rule.
    subroutine check_relaxation(key)
      character(*), intent(in) :: key  !! 'gamma' or 'gamma_rule'.
      if (.not. group%is_given(key) .or. any(scheme == schemes_of_paper)) return
      call input%report(group, key, key//' is for scheme='//names_of_paper//'; '//name// &
                        ' does not use it: remove it or choose another scheme')
    end subroutine check_relaxation

    !> Stopping rules: the active sets of the dual scheme have no increment, and (41) is a theorem on the paper's
    !> iteration.
    subroutine check_stop_rule()
      if (.not. group%is_given('stop_rule') .or. .not. group%is_usable('stop_rule')) return
      if (solver%stop_rule == stop_paper .and. all(scheme /= schemes_of_paper)) &
        call input%report(group, 'stop_rule', 'stop_rule=''paper'' is for scheme='//names_of_paper// &
                          ', which (41) is about; '//name//' has stop_rule=''residual''')
      if (solver%stop_rule == stop_increment .and. scheme == scheme_dual) &
        call input%report(group, 'stop_rule', 'stop_rule=''increment'' is for iterative schemes; '//name// &
                          ' has stop_rule=''residual'': choose this or another scheme')
    end subroutine check_stop_rule

    !> The compliance operator of a body: the dual scheme and robin form the matrices that they need.
    subroutine check_response()
      if (.not. group%is_usable('response') .or. solver%response == response_auto) return
      if (solver%response == response_multigrid) then
        if (scheme /= scheme_dual) &
          call input%report(group, 'response', 'response=''multigrid'' is for scheme=''dual'', and this run has '// &
                            name//'; remove one of them')
        if (solver%linear_solver /= linear_solver_auto) &
          call input%report(group, 'linear_solver', 'response=''multigrid'' solves the contact by displacements, '// &
                            'without the systems that linear_solver is about; remove linear_solver')
        return
      end if
      if (scheme == scheme_neumann) return
      if (scheme == scheme_dual .and. solver%response == response_full) return
      call input%report(group, 'response', 'response is for scheme=''neumann''; '//name// &
                        ' forms the dense compliances that it needs: remove response')
    end subroutine check_response
  end subroutine check_solver_keys
end module dotyk_input_settings
