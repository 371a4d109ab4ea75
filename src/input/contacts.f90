!> Reads `&contact` from checked groups.
module dotyk_input_contacts
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gap_constant, gap_formula, gap_geometry, option_name, scheme_auto, scheme_dual, &
    scheme_names
  use dotyk_base_text, only: shown
  use dotyk_input_case, only: contact_input_t, solver_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_settings, only: read_theta
  use dotyk_input_values, only: integer_of, is_given, is_usable, names_t, real_of, refer, report, text_of
  implicit none
  private
  public :: read_contact

contains

  !> Read `&contact`.
  subroutine read_contact(group, bodies, solver, problems, contact)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Names of the bodies.
    type(names_t), intent(in) :: bodies
    !> Settings of the solver: its penalty parameter is that of pairs without their own.
    type(solver_input_t), intent(in) :: solver
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> The contact pair; incomplete where the group has mistakes.
    type(contact_input_t), intent(out) :: contact
    real(dp) :: theta
    integer :: theta_kind
    logical :: own_theta
    character(:), allocatable :: theta_key
    contact%line = group%line
    contact%name = text_of(group, 'name')
    ! The name becomes that of a folder in the results file.
    if (index(contact%name, '/') > 0 .or. contact%name == '.' .or. contact%name == '..') &
      call report(problems, group, 'name', 'name: '//shown(contact%name)//' cannot name a folder of the results file')
    call read_side(group, 'surface_a', bodies, problems, contact%body_a, contact%surface_a)
    call read_side(group, 'surface_b', bodies, problems, contact%body_b, contact%surface_b)
    if (contact%body_a > 0 .and. contact%body_a == contact%body_b) &
      call report(problems, group, 'surface_b', 'a pair needs two different bodies, got '// &
                  shown(bodies%name(contact%body_a)%s)//' twice')
    contact%gap_kind = gap_geometry
    contact%gap = real_of(group, 'gap')
    contact%gap_formula = text_of(group, 'gap_formula')
    if (is_given(group, 'gap')) contact%gap_kind = gap_constant
    if (is_given(group, 'gap_formula')) contact%gap_kind = gap_formula
    if (is_given(group, 'gap') .and. is_given(group, 'gap_formula')) &
      call report(problems, group, 'gap', 'gap and gap_formula are both given: only one can be meant')
    contact%theta_kind = solver%theta_kind
    contact%theta = solver%theta
    contact%theta_given = solver%theta_given
    call read_theta(group, problems, own_theta, theta_kind, theta)
    if (own_theta) then
      contact%theta_kind = theta_kind
      contact%theta = theta
      contact%theta_given = .true.
    end if
    if (.not. contact%theta > 0 .and. all(solver%scheme /= [scheme_auto, scheme_dual])) then
      theta_key = 'theta_relative'
      if (is_given(group, 'theta')) theta_key = 'theta'
      call report(problems, group, theta_key, 'theta = 0 needs scheme=''dual'', got '''// &
                  option_name(scheme_names, solver%scheme)//'''')
    end if
    contact%has_search_radius = is_usable(group, 'search_radius')
    contact%search_radius = real_of(group, 'search_radius')
    contact%discretization = integer_of(group, 'discretization')
    contact%geometry = integer_of(group, 'geometry')
    contact%quadrature = integer_of(group, 'quadrature')
  end subroutine read_contact

  !> Read one side of a pair: 'body:surface'.
  subroutine read_side(group, key, bodies, problems, body, surface)
    !> Checked group.
    type(group_t), intent(in) :: group
    !> Name of the key.
    character(*), intent(in) :: key
    !> Names of the bodies.
    type(names_t), intent(in) :: bodies
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> Index of the body; 0 where it is unknown.
    integer, intent(out) :: body
    !> Physical group of the surface.
    character(:), allocatable, intent(out) :: surface
    character(:), allocatable :: text
    integer :: colon
    body = 0
    surface = ''
    text = text_of(group, key)
    if (len(text) == 0) return
    colon = index(text, ':')
    if (colon > 0) surface = trim(adjustl(text(colon + 1:)))
    if (colon <= 1 .or. len(surface) == 0) then
      call report(problems, group, key, key//' must be ''body:surface'', got '//shown(text))
      return
    end if
    call refer(group, key, trim(text(:colon - 1)), bodies, problems, body)
  end subroutine read_side
end module dotyk_input_contacts
