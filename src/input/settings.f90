!> Reads `&scene`, `&accuracy`, `&mesh_size`, `&solver`, `&output` and the penalty parameter of a group from checked
!> groups.
module dotyk_input_settings
  use dotyk_base_files, only: is_cad_file, is_foreign_mesh, is_geo_file, is_msh_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_operating_system, only: directory_of
  use dotyk_base_options, only: analysis_3d, error_part_discretization, error_part_penalty, field_contact, &
    field_displacement, field_error, field_nodal_stress, field_reaction, field_stress, gamma_fixed, gamma_theory, &
    option_name, scheme_auto, scheme_dual, scheme_neumann, stop_paper, theta_absolute, theta_formula, theta_mesh, &
    theta_names
  use dotyk_base_text, only: quoted, shown, to_text
  use dotyk_input_body, only: body_input_t
  use dotyk_input_case, only: accuracy_input_t, mesh_size_input_t, output_input_t, scene_input_t, solver_input_t
  use dotyk_input_paths, only: extension_of, is_directory, resolve_path, why_not_readable, without_extension
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: has_option, integer_of, is_given, is_usable, logical_of, names_t, pick_groups, &
    real_of, refuse, report, text_of
  use dotyk_input_wildcards, only: names_several, refer_to_bodies
  implicit none
  private
  public :: read_accuracy, read_mesh_sizes, read_scene, read_solver, read_output, read_theta, read_mesh_path

  !> theta_mesh where no theta is given: for the dual scheme, which is insensitive to theta, and for the others, whose
  !> number of iterations grows like 1/theta [].
  real(dp), parameter :: default_theta_dual = 1.0e-2_dp, default_theta_other = 1.0e-1_dp

contains

  !> Read `&scene`.
  subroutine read_scene(group, file, problems, scene)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: file  !! Path of the namelist file.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(scene_input_t), intent(out) :: scene  !! The scene; incomplete where the group has mistakes.
    scene%line = group%line
    scene%title = text_of(group, 'title')
    scene%analysis = integer_of(group, 'analysis')
    ! A wrong analysis leaves the dimension unknown: nothing is checked against it.
    scene%dimension = 0
    if (scene%analysis > 0) scene%dimension = merge(3, 2, scene%analysis == analysis_3d)
    call read_mesh_path(group, directory_of(file), scene%dimension, problems, scene%mesh)
    if (is_given(group, 'mesh_size')) scene%mesh_size = real_of(group, 'mesh_size')
    scene%mesh_order = integer_of(group, 'mesh_order')
    if (is_usable(group, 'mesh_order') .and. scene%mesh_order > 2) &
      call report(problems, group, 'mesh_order', 'mesh_order must be 1 or 2')
    if (is_given(group, 'output')) then
      scene%output = resolve_path(directory_of(file), text_of(group, 'output'))
    else
      scene%output = without_extension(file)//'.vtkhdf'
    end if
    if (len(scene%output) == 0) return
    if (is_directory(scene%output)) then
      call report(problems, group, 'output', 'output: '//shown(scene%output)//' is a directory')
    else if (scene%output == file .or. scene%output == scene%mesh) then
      call report(problems, group, 'output', 'output: '//shown(scene%output)//' is an input file')
    end if
  end subroutine read_scene

  !> Read the mesh of a group: a readable file with a known extension.
  subroutine read_mesh_path(group, directory, dimension, problems, path)
    type(group_t), intent(in) :: group  !! `&scene` or `&body`.
    character(*), intent(in) :: directory  !! Directory of the namelist file.
    integer, intent(in) :: dimension  !! Dimension of space; 0 where it is unknown.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    character(:), allocatable, intent(out) :: path  !! Path of the mesh; empty where it is not given.
    character(:), allocatable :: reason
    path = resolve_path(directory, text_of(group, 'mesh'))
    if (len(path) == 0) return
    if (.not. (is_msh_file(path) .or. is_geo_file(path) .or. is_cad_file(path) .or. is_foreign_mesh(path))) &
      call report(problems, group, 'mesh', 'mesh: '//shown(path)//' must end with .msh, .geo, .inp, .vtu, .med, '// &
                  'another ending of meshio (.vtk, .xdmf, .exo, .bdf, .nas, .mesh, .su2) or that of a CAD file: '// &
                  '.step, .stp, .iges, .igs, .brep, .brp, .stl')
    if (dimension == 2 .and. is_cad_file(path)) &
      call report(problems, group, 'mesh', 'mesh: '//shown(path)//' has solids, which need analysis=''3d''; for '// &
                  'bodies in the plane write a .geo file')
    reason = why_not_readable(path)
    if (len(reason) > 0) call report(problems, group, 'mesh', 'mesh: '//shown(path)//' '//reason)
  end subroutine read_mesh_path

  !> Read `&accuracy`.
  subroutine read_accuracy(group, body, problems, accuracy)
    type(group_t), intent(in) :: group  !! Checked group.
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(accuracy_input_t), intent(out) :: accuracy  !! What is asked for.
    integer :: b
    accuracy%line = group%line
    accuracy%is_given = .true.
    if (is_usable(group, 'error')) accuracy%error = real_of(group, 'error')
    if (is_usable(group, 'error') .and. .not. accuracy%error < 1) &
      call report(problems, group, 'error', 'error is a fraction of the energy norm below 1, 0.05 for 5 %, got '// &
                  to_text(accuracy%error))
    accuracy%aim = integer_of(group, 'aim')
    if (is_given(group, 'quantity')) call refuse(group, 'aim', 'quantity', problems)
    accuracy%max_meshes = integer_of(group, 'max_meshes')
    accuracy%max_unknowns = integer_of(group, 'max_unknowns')
    if (is_given(group, 'max_seconds')) accuracy%max_seconds = real_of(group, 'max_seconds')
    do b = 1, size(body)
      if (is_meshed(group, body(b), problems)) cycle
      return
    end do
  end subroutine read_accuracy

  !> Read all `&mesh_size`.
  subroutine read_mesh_sizes(groups, body, bodies, problems, mesh_size)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(names_t), intent(in) :: bodies  !! Their names.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(mesh_size_input_t), allocatable, intent(out) :: mesh_size(:)  !! The sizes (n_mesh_sizes).
    type(mesh_size_input_t) :: new
    integer, allocatable :: picked(:), matched(:)
    integer :: i, k
    allocate (mesh_size(0))
    call pick_groups(groups, 'mesh_size', picked)
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call refer_to_bodies(group, 'body', text_of(group, 'body'), bodies, problems, matched)
        new%line = group%line
        new%any_body = names_several(text_of(group, 'body'), bodies)
        new%surface = text_of(group, 'surface')
        new%size = 0
        if (is_usable(group, 'size')) new%size = real_of(group, 'size')
        new%contact = 0
        if (is_usable(group, 'contact')) new%contact = real_of(group, 'contact')
        if (.not. (is_given(group, 'size') .or. is_given(group, 'contact'))) &
          call problems%add(group%line, '&mesh_size: one of size (of the body, or of its surface) and contact (at '// &
                            'its contact pairs) is needed')
        if (is_given(group, 'surface') .and. .not. is_given(group, 'size') .and. is_given(group, 'contact')) &
          call report(problems, group, 'surface', 'surface has no size: give size, or remove surface')
        do k = 1, size(matched)
          new%body = matched(k)
          if (matched(k) <= size(body)) then
            if (.not. is_meshed(group, body(matched(k)), problems)) exit
          end if
          mesh_size = [mesh_size, new]
        end do
      end associate
    end do
  end subroutine read_mesh_sizes

  !> Whether gmsh makes the mesh of a body; reported if not.
  logical function is_meshed(group, body, problems)
    type(group_t), intent(in) :: group  !! Group that needs it.
    type(body_input_t), intent(in) :: body  !! The body.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    is_meshed = len(body%mesh) == 0 .or. is_cad_file(body%mesh) .or. is_geo_file(body%mesh)
    if (.not. is_meshed) &
      call problems%add(group%line, '&'//group%name//': the mesh of body '//quoted(body%name)//' is no geometry: '// &
                        shown(body%mesh)//'; gmsh makes new meshes of .geo and CAD files')
  end function is_meshed

  !> Read `&solver`.
  subroutine read_solver(group, problems, solver)
    type(group_t), intent(in) :: group  !! Checked group; only defaults where the file has none.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(solver_input_t), intent(out) :: solver  !! Settings of the solver; incomplete where the group has mistakes.
    solver%line = group%line
    solver%scheme = integer_of(group, 'scheme')
    call read_theta(group, problems, solver%theta_given, solver%theta_kind, solver%theta)
    solver%linear_solver = integer_of(group, 'linear_solver')
    solver%response = integer_of(group, 'response')
    solver%gamma_rule = integer_of(group, 'gamma_rule')
    solver%gamma = real_of(group, 'gamma')
    if (is_given(group, 'gamma') .and. .not. is_given(group, 'gamma_rule')) solver%gamma_rule = gamma_fixed
    if (is_usable(group, 'gamma_rule')) then
      if (is_given(group, 'gamma') .and. solver%gamma_rule /= gamma_fixed) &
        call report(problems, group, 'gamma', 'gamma is given, but gamma_rule is not ''fixed''; remove one of them')
      if (.not. is_given(group, 'gamma') .and. solver%gamma_rule == gamma_fixed) &
        call report(problems, group, 'gamma_rule', '''gamma'' is missing: gamma_rule is ''fixed''')
    end if
    solver%stop_rule = integer_of(group, 'stop_rule')
    ! (41) needs a gamma that Theorem 4 is about.
    if (solver%stop_rule == stop_paper .and. .not. (is_given(group, 'gamma') .or. is_given(group, 'gamma_rule'))) &
      solver%gamma_rule = gamma_theory
    ! The options of the paper select its scheme.
    if (solver%scheme == scheme_auto .and. (is_given(group, 'gamma') .or. is_given(group, 'gamma_rule') .or. &
                                            solver%stop_rule == stop_paper)) solver%scheme = scheme_neumann
    if (.not. solver%theta_given) &
      solver%theta = merge(default_theta_dual, default_theta_other, &
                           solver%scheme == scheme_auto .or. solver%scheme == scheme_dual)
    if (is_usable(group, 'robin_gap')) solver%robin_gap = real_of(group, 'robin_gap')
    solver%budget_fraction = real_of(group, 'budget_fraction')
    solver%tolerance = real_of(group, 'tolerance')
    solver%max_unbalanced = real_of(group, 'max_unbalanced')
    if (is_usable(group, 'max_unbalanced') .and. solver%max_unbalanced > 1) &
      call report(problems, group, 'max_unbalanced', 'max_unbalanced is a fraction of the forces on a body, from 0 '// &
                  'to 1, got '//to_text(solver%max_unbalanced))
    solver%max_iterations = integer_of(group, 'max_iterations')
    solver%locking = integer_of(group, 'locking')
    solver%reproducible = logical_of(group, 'reproducible')
  end subroutine read_solver

  !> Read the penalty parameter of a group.
  subroutine read_theta(group, problems, given, kind, theta)
    type(group_t), intent(in) :: group  !! `&solver` or `&contact`.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    logical, intent(out) :: given  !! Whether the group has one.
    integer, intent(out) :: kind  !! One of `theta_*`.
    !> Penalty parameter [length/pressure], or the factor of the relative one; 1 where it is a formula [1].
    real(dp), intent(out) :: theta
    integer :: k
    kind = theta_mesh
    theta = 0
    given = .false.
    do k = theta_absolute, theta_formula
      if (.not. is_given(group, option_name(theta_names, k))) cycle
      if (given) then
        call report(problems, group, option_name(theta_names, k), option_name(theta_names, kind)//' and '// &
                    option_name(theta_names, k)//' are both given: only one can be meant')
        cycle
      end if
      given = .true.
      kind = k
      theta = 1
      if (k /= theta_formula) theta = real_of(group, option_name(theta_names, k))
    end do
  end subroutine read_theta

  !> Read `&output`.
  subroutine read_output(group, output)
    type(group_t), intent(in) :: group  !! Checked group; only defaults where the file has none.
    type(output_input_t), intent(out) :: output  !! Contents of the results file.
    output%line = group%line
    output%displacement = has_option(group, 'fields', field_displacement)
    output%stress = has_option(group, 'fields', field_stress)
    output%contact = has_option(group, 'fields', field_contact)
    output%error = has_option(group, 'fields', field_error)
    output%reaction = has_option(group, 'fields', field_reaction)
    output%nodal_stress = has_option(group, 'fields', field_nodal_stress)
    output%error_penalty = has_option(group, 'error_parts', error_part_penalty)
    ! Who asks for the field asks for the estimate.
    output%error_discretization = has_option(group, 'error_parts', error_part_discretization) .or. &
                                  (output%error .and. is_given(group, 'fields'))
    output%error = output%error .and. output%error_discretization
    output%interval = real_of(group, 'interval')
  end subroutine read_output
end module dotyk_input_settings
