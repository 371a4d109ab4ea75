!> From checked groups to plain data: `&scene`, `&solver`, `&output`, and the penalty parameter of a group.
module dotyk_input_settings
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d, error_part_discretization, error_part_penalty, field_contact, &
    field_displacement, field_error, field_stress, gamma_fixed, option_name, scheme_auto, scheme_dual, scheme_neumann, &
    stop_paper, theta_absolute, theta_mesh, theta_names
  use dotyk_base_text, only: shown
  use dotyk_input_case, only: output_input_t, scene_input_t, solver_input_t
  use dotyk_input_paths, only: directory_of, extension_of, is_directory, resolve_path, why_not_readable, &
    without_extension
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: has_option, integer_of, is_given, is_usable, logical_of, real_of, report, text_of
  implicit none
  private
  public :: read_scene, read_solver, read_output, read_theta, read_mesh_path

  !> Factor of h/E where no theta is given: for the dual scheme, which does not mind a small one, and for the others, whose steps grow
  !> like 1/theta.
  real(dp), parameter :: default_theta_mesh(2) = [1.0e-2_dp, 1.0e-1_dp]

contains

  !> `&scene`.
  subroutine read_scene(group, file, problems, scene)
    type(group_t), intent(in) :: group
    !> The namelist file.
    character(*), intent(in) :: file
    type(problems_t), intent(inout) :: problems
    type(scene_input_t), intent(out) :: scene
    scene%line = group%line
    scene%title = text_of(group, 'title')
    scene%analysis = integer_of(group, 'analysis')
    ! Where the analysis cannot be used, no number of dimensions is known: nothing is checked against it.
    scene%dimension = 0
    if (scene%analysis > 0) scene%dimension = merge(3, 2, scene%analysis == analysis_3d)
    call read_mesh_path(group, directory_of(file), problems, scene%mesh)
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

  !> The mesh of a group: a file that is there, with an extension that means something.
  subroutine read_mesh_path(group, directory, problems, path)
    type(group_t), intent(in) :: group
    !> Directory of the namelist file.
    character(*), intent(in) :: directory
    type(problems_t), intent(inout) :: problems
    !> The path; empty where there is none.
    character(:), allocatable, intent(out) :: path
    character(:), allocatable :: reason
    path = resolve_path(directory, text_of(group, 'mesh'))
    if (len(path) == 0) return
    if (extension_of(path) /= '.msh' .and. extension_of(path) /= '.geo') &
      call report(problems, group, 'mesh', 'mesh: '//shown(path)//' must end with .msh or .geo')
    reason = why_not_readable(path)
    if (len(reason) > 0) call report(problems, group, 'mesh', 'mesh: '//shown(path)//' '//reason)
  end subroutine read_mesh_path

  !> `&solver`.
  subroutine read_solver(group, problems, solver)
    !> The group; one with nothing but defaults where the file has none.
    type(group_t), intent(in) :: group
    type(problems_t), intent(inout) :: problems
    type(solver_input_t), intent(out) :: solver
    solver%line = group%line
    solver%scheme = integer_of(group, 'scheme')
    call read_theta(group, problems, solver%theta_given, solver%theta_kind, solver%theta)
    solver%linear_solver = integer_of(group, 'linear_solver')
    solver%response = integer_of(group, 'response')
    solver%gamma_rule = integer_of(group, 'gamma_rule')
    solver%gamma = real_of(group, 'gamma')
    if (is_usable(group, 'gamma_rule')) then
      if (is_given(group, 'gamma') .and. solver%gamma_rule /= gamma_fixed) &
        call report(problems, group, 'gamma', 'gamma is given, but gamma_rule is not ''fixed''')
      if (.not. is_given(group, 'gamma') .and. solver%gamma_rule == gamma_fixed) &
        call report(problems, group, 'gamma_rule', '''gamma'' is missing: gamma_rule is ''fixed''')
    end if
    solver%stop_rule = integer_of(group, 'stop_rule')
    ! These keys mean the Neumann scheme and nothing else.
    if (solver%scheme == scheme_auto .and. (is_given(group, 'gamma') .or. is_given(group, 'gamma_rule') .or. &
                                            solver%stop_rule == stop_paper)) solver%scheme = scheme_neumann
    if (.not. solver%theta_given) solver%theta = merge(default_theta_mesh(1), default_theta_mesh(2), &
                                                       solver%scheme == scheme_auto .or. solver%scheme == scheme_dual)
    if (solver%stop_rule == stop_paper .and. is_usable(group, 'scheme') .and. solver%scheme /= scheme_neumann) &
      call report(problems, group, 'stop_rule', 'stop_rule=''paper'' is for scheme=''neumann'', which (41) is about')
    solver%budget_fraction = real_of(group, 'budget_fraction')
    solver%tolerance = real_of(group, 'tolerance')
    solver%max_iterations = integer_of(group, 'max_iterations')
    solver%locking = integer_of(group, 'locking')
    solver%reproducible = logical_of(group, 'reproducible')
  end subroutine read_solver

  !> The penalty parameter of a group.
  subroutine read_theta(group, problems, given, kind, theta)
    !> `&solver` or `&contact`.
    type(group_t), intent(in) :: group
    type(problems_t), intent(inout) :: problems
    !> Does the group have one?
    logical, intent(out) :: given
    !> One of `theta_*`.
    integer, intent(out) :: kind
    !> Penalty parameter [length/pressure], or the factor of the relative one [1].
    real(dp), intent(out) :: theta
    integer :: k
    kind = theta_mesh
    theta = 0
    given = .false.
    do k = theta_absolute, theta_mesh
      if (.not. is_given(group, option_name(theta_names, k))) cycle
      if (given) then
        call report(problems, group, option_name(theta_names, k), option_name(theta_names, kind)//' and '// &
                    option_name(theta_names, k)//' are both given: only one can be meant')
        cycle
      end if
      given = .true.
      kind = k
      theta = real_of(group, option_name(theta_names, k))
    end do
  end subroutine read_theta

  !> `&output`.
  subroutine read_output(group, output)
    !> The group; one with nothing but defaults where the file has none.
    type(group_t), intent(in) :: group
    type(output_input_t), intent(out) :: output
    output%line = group%line
    output%displacement = has_option(group, 'fields', field_displacement)
    output%stress = has_option(group, 'fields', field_stress)
    output%contact = has_option(group, 'fields', field_contact)
    output%error = has_option(group, 'fields', field_error)
    output%error_penalty = has_option(group, 'error_parts', error_part_penalty)
    ! Who asks for the field asks for the estimate.
    output%error_discretization = has_option(group, 'error_parts', error_part_discretization) .or. &
                                  (output%error .and. is_given(group, 'fields'))
    output%error = output%error .and. output%error_discretization
    output%interval = real_of(group, 'interval')
  end subroutine read_output
end module dotyk_input_settings
