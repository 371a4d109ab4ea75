!> Reads a namelist file into a case. All that needs no mesh is checked, and all problems are reported together.
module dotyk_input_parse
  use dotyk_base_error, only: error_t
  use dotyk_base_operating_system, only: directory_of
  use dotyk_input_body_list, only: read_bodies
  use dotyk_input_case, only: case_t
  use dotyk_input_checks, only: check_group, check_group_names, check_occurrences
  use dotyk_input_contacts, only: read_contact
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_keyword_table, only: list_keywords
  use dotyk_input_keywords, only: find_group, group_keyword_t
  use dotyk_input_loads, only: read_initial_stresses, read_loads, read_supports, read_temperatures
  use dotyk_input_paths, only: read_text, refuse_other_content
  use dotyk_input_problems, only: no_line
  use dotyk_input_reader, only: read_groups
  use dotyk_input_references, only: input_t, names_t
  use dotyk_input_remarks, only: add_remarks
  use dotyk_input_rigid_bodies, only: read_rigid_bodies
  use dotyk_input_settings, only: check_solver_keys, read_accuracy, read_contact_cases, read_load_cases, &
    read_mesh_sizes, read_output, read_quantities, read_scene, read_solver
  use dotyk_input_ties, only: read_ties
  implicit none
  private
  public :: read_case, parse_case

contains

  !> Read a namelist file.
  subroutine read_case(file, case, error)
    character(*), intent(in) :: file  !! Path.
    type(case_t), intent(out) :: case  !! The case; incomplete where there is an error.
    type(error_t), allocatable, intent(out) :: error  !! Where the file has mistakes: all of them, one per line.
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
    type(error_t), allocatable, intent(out) :: error  !! Where the file has mistakes: all of them, one per line.
    type(input_t) :: input
    type(group_keyword_t), allocatable :: table(:)
    type(group_t), allocatable :: groups(:)
    logical, allocatable :: misspelled(:)
    integer :: i
    case%file = file
    case%directory = directory_of(file)
    case%text = text
    call input%init(file)
    call list_keywords(table)
    call read_groups(text, input, groups)
    if (size(groups) == 0) then
      call input%add(no_line, 'the file has no groups')
      call input%raise(error)
      return
    end if
    allocate (misspelled(size(table)))
    call check_group_names(groups, table, input, misspelled)
    call check_occurrences(groups, table, misspelled, input)
    do i = 1, size(groups)
      if (find_group(table, groups(i)%name) > 0) call check_group(groups(i), table, input)
    end do
    call convert(groups, table, misspelled, input, case)
    call input%raise(error)
    if (.not. allocated(error)) call add_remarks(case)
  end subroutine parse_case

  !> Make plain data of checked groups.
  subroutine convert(groups, table, misspelled, input, case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(group_keyword_t), intent(in) :: table(:)  !! Groups that the program knows (n_known).
    logical, intent(in) :: misspelled(:)  !! Whether a known group may be in the file, misspelled (n_known).
    type(input_t), intent(inout) :: input  !! Problems of the file; mistakes are added. All else is set.
    type(case_t), intent(inout) :: case  !! The case, with file and directory; all else is set.
    type(names_t) :: contacts, ties
    type(group_t) :: solver, output
    integer, allocatable :: picked(:)
    integer :: i
    logical :: mesh_expected
    input%materials = names_of('material')
    input%bodies = names_of('body')
    contacts = names_of('contact')
    input%cases = names_of('case')
    call read_load_cases(groups, input, case%load_case)

    mesh_expected = .false.
    case%scene%mesh = ''
    case%scene%output = ''
    case%scene%dimension = 0
    call pick_groups(groups, 'scene', picked)
    if (size(picked) > 0) then
      associate (group => groups(picked(1)))
        call read_scene(group, input, case%file, case%scene)
        mesh_expected = group%is_usable('mesh') .or. .not. group%is_given('mesh')
      end associate
    end if
    input%scene = case%scene
    call single_group(groups, 'solver', table, input, solver)
    call read_solver(solver, input, case%solver)
    input%solver = case%solver
    call single_group(groups, 'output', table, input, output)
    call read_output(output, case%output)

    call read_bodies(groups, input, mesh_expected, case)
    allocate (case%quantity(0))
    call read_mesh_sizes(groups, input, case%body, case%mesh_size)
    call pick_groups(groups, 'accuracy', picked)
    if (size(picked) > 0) then
      call read_accuracy(groups(picked(1)), input, case%body, case%accuracy)
      call read_quantities(groups(picked(1)), input, .true., case%quantity)
    end if
    call read_quantities(output, input, .false., case%quantity)
    if (case%accuracy%is_given .or. size(case%quantity) > 0) case%output%error_discretization = .true.
    call read_supports(groups, input, case%support)
    call read_loads(groups, input, case%body, case%material, case%load)
    call read_temperatures(groups, input, case%body, case%material, case%temperature)
    call read_initial_stresses(groups, input, case%initial_stress)
    call pick_groups(groups, 'contact', picked)
    allocate (case%contact(size(picked)))
    do i = 1, size(picked)
      call read_contact(groups(picked(i)), input, case%contact(i))
    end do
    ties = names_of('tie')
    ties = names_of('bolt')
    call read_ties(groups, input, case%body, case%tie)
    call read_rigid_bodies(groups, input, case)
    call read_contact_cases(groups, input, case%contact, case%contact_case)
    if (case%has_cases() .and. case%output%interval > 0) &
      call input%add(case%output%line, '&output: interval: results of load cases are written case after case, '// &
                     'not on the way; remove interval')
    call check_solver_keys(solver, input, case%solver, case%output%error_penalty)

  contains

    !> Names of the groups of one kind; names that are given twice are reported.
    type(names_t) function names_of(what) result(names)
      character(*), intent(in) :: what  !! Name of the groups.
      call input%gather_names(groups, what, misspelled(find_group(table, what)), names)
    end function names_of
  end subroutine convert

  !> The first group of a name; where the file has none, one with the defaults of the table, in line 0.
  subroutine single_group(groups, name, table, input, group)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    character(*), intent(in) :: name  !! Name of the group.
    type(group_keyword_t), intent(in) :: table(:)  !! Groups that the program knows (n_known).
    type(input_t), intent(inout) :: input  !! Problems of the file; mistakes are added.
    type(group_t), intent(out) :: group  !! The group.
    integer, allocatable :: picked(:)
    call pick_groups(groups, name, picked)
    if (size(picked) > 0) then
      group = groups(picked(1))
    else
      group%name = name
      allocate (group%entry(8))
      call check_group(group, table, input)
    end if
  end subroutine single_group
end module dotyk_input_parse
