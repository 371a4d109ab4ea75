!> Reads `&scene`, `&accuracy`, `&mesh_size`, `&solver`, `&output` and the penalty parameter of a group from checked
!> groups.
module dotyk_input_settings
  use dotyk_base_files, only: is_cad_file, is_foreign_mesh, is_geo_file, is_msh_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_operating_system, only: directory_of
  use dotyk_base_options, only: analysis_3d, error_part_discretization, error_part_penalty, field_error, gamma_fixed, &
    gamma_theory, n_fields, option_name, scheme_auto, scheme_dual, scheme_neumann, stop_paper, theta_absolute, &
    theta_formula, theta_mesh, theta_names
  use dotyk_base_text, only: quoted, shown, to_text
  use dotyk_input_case, only: accuracy_input_t, body_input_t, mesh_size_input_t, output_input_t, scene_input_t, &
    solver_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_paths, only: is_directory, resolve_path, why_not_readable, without_extension
  use dotyk_input_references, only: input_t
  implicit none
  private
  public :: read_accuracy, read_mesh_sizes, read_scene, read_solver, read_output, read_theta, read_mesh_path

  !> theta_mesh where no theta is given: of schemes other than the dual one, whose number of iterations grows like
  !> 1/theta, and of constraints at quadrature points, which outnumber the unknowns of their surface [].
  real(dp), parameter :: theta_of_iterations = 0.1_dp
  real(dp), parameter, public :: theta_of_points = 0.01_dp

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
end module dotyk_input_settings
