!> Reads a namelist file into a case. All that needs no mesh is checked, and all problems are reported together.
module dotyk_input_parse
  use dotyk_base_error, only: error_t
  use dotyk_base_operating_system, only: directory_of
  use dotyk_base_options, only: stop_budget, stop_residual
  use dotyk_input_actions, only: read_actions
  use dotyk_input_attachments, only: read_rigid_bodies
  use dotyk_input_body_list, only: read_bodies
  use dotyk_input_case, only: case_t
  use dotyk_input_checks, only: check_group, check_group_names, check_occurrences
  use dotyk_input_contacts, only: read_contact
  use dotyk_input_keyword_table, only: list_groups, list_keywords
  use dotyk_input_keywords, only: group_keyword_t, keyword_t
  use dotyk_input_load_cases, only: read_contact_cases, read_load_cases
  use dotyk_input_paths, only: read_text, refuse_other_content
  use dotyk_input_problems, only: no_line, problems_t
  use dotyk_input_reader, only: group_t, read_groups
  use dotyk_input_remarks, only: add_remarks
  use dotyk_input_quantities, only: read_quantities
  use dotyk_input_settings, only: read_accuracy, read_mesh_sizes, read_output, read_scene, read_solver
  use dotyk_input_ties, only: read_ties
  use dotyk_input_solver_checks, only: check_solver_keys
  use dotyk_input_values, only: gather_names, is_given, is_usable, names_t, pick_groups
  implicit none
  private
  public :: read_case, parse_case

contains

  !> Read a namelist file.
  subroutine read_case(file, case, error)
    character(*), intent(in) :: file  !! Path.
    type(case_t), intent(out) :: case  !! The case; incomplete where there is an error.
    !> Allocated where the file has mistakes: all of them, one per line.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: text
    call read_text(file, text, error)
    if (.not. allocated(error)) call refuse_other_content(file, text, error)
    if (allocated(error)) return
    call parse_case(file, text, case, error)
  end subroutine read_case

  !> Read the text of a namelist file.
  subroutine parse_case(file, text, case, error)
    character(*), intent(in) :: file  !! Path of the file, for messages and relative paths.
    character(*), intent(in) :: text  !! Text of the file.
    type(case_t), intent(out) :: case  !! The case; incomplete where there is an error.
    !> Allocated where the file has mistakes: all of them, one per line.
    type(error_t), allocatable, intent(out) :: error
    type(problems_t) :: problems
    type(group_keyword_t), allocatable :: known(:)
    type(keyword_t), allocatable :: table(:)
    type(group_t), allocatable :: groups(:)
    logical, allocatable :: misspelled(:)
    integer :: i, k
    case%file = file
    case%directory = directory_of(file)
    case%text = text
    call problems%init(file)
    call list_groups(known)
    call list_keywords(table)
    call read_groups(text, problems, groups)
    if (size(groups) == 0) then
      call problems%add(no_line, 'the file has no groups')
      call problems%raise(error)
      return
    end if
    allocate (misspelled(size(known)))
    call check_group_names(groups, known, problems, misspelled)
    call check_occurrences(groups, known, misspelled, problems)
    do i = 1, size(groups)
      if (any([(known(k)%name == groups(i)%name, k=1, size(known))])) call check_group(groups(i), table, problems)
    end do
    call convert(groups, known, misspelled, table, problems, case)
    call problems%raise(error)
    if (.not. allocated(error)) call add_remarks(case)
  end subroutine parse_case

  !> Make plain data of checked groups.
  subroutine convert(groups, known, misspelled, table, problems, case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(group_keyword_t), intent(in) :: known(:)  !! Groups that the program knows (n_known).
    logical, intent(in) :: misspelled(:)  !! Whether a known group may be in the file, misspelled (n_known).
    type(keyword_t), intent(in) :: table(:)  !! Table of all keys (n_keys).
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(case_t), intent(inout) :: case  !! The case, with file and directory; all else is set.
    type(names_t) :: materials, bodies, contacts, ties, cases
    type(group_t) :: solver, output
    integer, allocatable :: picked(:)
    integer :: i
    logical :: mesh_expected
    call gather_names(groups, 'material', misspelled(place('material')), problems, materials)
    call gather_names(groups, 'body', misspelled(place('body')), problems, bodies)
    call gather_names(groups, 'contact', misspelled(place('contact')), problems, contacts)
    call gather_names(groups, 'case', misspelled(place('case')), problems, cases)
    call read_load_cases(groups, problems, case%load_case)

    mesh_expected = .false.
    case%scene%mesh = ''
    case%scene%output = ''
    case%scene%dimension = 0
    call pick_groups(groups, 'scene', picked)
    if (size(picked) > 0) then
      call read_scene(groups(picked(1)), case%file, problems, case%scene)
      mesh_expected = is_usable(groups(picked(1)), 'mesh') .or. .not. is_given(groups(picked(1)), 'mesh')
    end if
    call single_group(groups, 'solver', table, problems, solver)
    call read_solver(solver, problems, case%solver)
    call single_group(groups, 'output', table, problems, output)
    call read_output(output, case%output)

    call read_bodies(groups, materials, mesh_expected, problems, bodies, case)
    allocate (case%quantity(0))
    call read_mesh_sizes(groups, case%body, bodies, problems, case%mesh_size)
    call pick_groups(groups, 'accuracy', picked)
    if (size(picked) > 0) then
      call read_accuracy(groups(picked(1)), case%body, problems, case%accuracy)
      call read_quantities(groups(picked(1)), .true., case%scene%dimension, bodies, problems, case%quantity)
    end if
    call read_quantities(output, .false., case%scene%dimension, bodies, problems, case%quantity)
    if (case%accuracy%is_given .or. size(case%quantity) > 0) case%output%error_discretization = .true.
    call read_actions(groups, cases, bodies, problems, case)
    call pick_groups(groups, 'contact', picked)
    allocate (case%contact(size(picked)))
    do i = 1, size(picked)
      call read_contact(groups(picked(i)), bodies, case%solver, problems, case%contact(i))
    end do
    call gather_names(groups, 'tie', misspelled(place('tie')), problems, ties)
    call gather_names(groups, 'bolt', misspelled(place('bolt')), problems, ties)
    call read_ties(groups, case%body, bodies, cases, case%scene, case%solver, problems, case%tie)
    call read_rigid_bodies(groups, bodies, cases, problems, case)
    call read_contact_cases(groups, cases, case%contact, case%solver, problems, case%contact_case)
    if (case%has_cases() .and. case%output%interval > 0) &
      call problems%add(case%output%line, '&output: interval: results of load cases are written case after case, '// &
                        'not on the way; remove interval')
    if (.not. is_usable(solver, 'stop_rule')) then
      case%solver%stop_rule = stop_residual
      if (size(case%contact) > 0 .and. .not. is_given(solver, 'tolerance') .and. .not. &
          any(case%contact%theta_given .and. .not. case%contact%is_layer)) &
        case%solver%stop_rule = stop_budget
    end if
    call check_solver_keys(solver, case%solver, case%output%error_penalty .or. case%solver%stop_rule == stop_budget &
                           .or. .not. all(case%contact%theta_given), problems)

  contains

    !> Place of a group in the table; 0 where it is unknown.
    pure integer function place(name)
      character(*), intent(in) :: name  !! Name of the group.
      do place = 1, size(known)
        if (known(place)%name == name) return
      end do
      place = 0
    end function place
  end subroutine convert

  !> The first group of a name; where the file has none, one with the defaults of the table, in line 0.
  subroutine single_group(groups, name, table, problems, group)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    character(*), intent(in) :: name  !! Name of the group.
    type(keyword_t), intent(in) :: table(:)  !! Table of all keys (n_keys).
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(group_t), intent(out) :: group  !! The group.
    integer, allocatable :: picked(:)
    call pick_groups(groups, name, picked)
    if (size(picked) > 0) then
      group = groups(picked(1))
    else
      group%name = name
      allocate (group%entry(8))
      call check_group(group, table, problems)
    end if
  end subroutine single_group
end module dotyk_input_parse
