!> Reads `&contact` from checked groups.
module dotyk_input_contacts
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: condition_neumann, discretization_quadrature, gap_constant, gap_formula, &
    gap_geometry, option_name, scheme_auto, scheme_dual, scheme_names, scheme_robin, theta_mesh, theta_names
  use dotyk_base_text, only: shown, text_t
  use dotyk_input_case, only: contact_input_t, exclusion_t, solver_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_settings, only: read_theta
  use dotyk_input_values, only: first_names, integer_of, is_given, is_usable, logical_of, names_t, real_of, report, &
    text_of, texts_of
  use dotyk_input_wildcards, only: bodies_named, names_several, refer_to_bodies
  implicit none
  private
  public :: read_contact, read_side

contains

  !> Read `&contact`.
  subroutine read_contact(group, bodies, solver, problems, contact)
    type(group_t), intent(in) :: group  !! Checked group.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    !> Settings of the solver: its penalty parameter is that of pairs without their own.
    type(solver_input_t), intent(in) :: solver
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> The contact pair, or what its search is to find; incomplete where the group has mistakes.
    type(contact_input_t), intent(out) :: contact
    real(dp) :: theta
    integer :: theta_kind, k
    logical :: own_theta, several_a, several_b
    character(:), allocatable :: theta_key, source
    contact%line = group%line
    contact%name = text_of(group, 'name')
    contact%auto = logical_of(group, 'auto')
    call read_required(group, contact%auto, problems)
    ! The name becomes that of a folder in the results file.
    if (index(contact%name, '/') > 0 .or. contact%name == '.' .or. contact%name == '..') &
      call report(problems, group, 'name', 'name: '//shown(contact%name)//' cannot name a folder of the results file')
    call read_side(group, 'surface_a', bodies, problems, contact%bodies_a, contact%surface_a, several_a)
    call read_side(group, 'surface_b', bodies, problems, contact%bodies_b, contact%surface_b, several_b)
    contact%searched = contact%auto .or. several_a .or. several_b
    if (contact%auto) then
      contact%bodies_a = [(k, k=1, size(bodies%name))]
      contact%bodies_b = contact%bodies_a
    else if (.not. contact%searched) then
      if (size(contact%bodies_a) > 0) contact%body_a = contact%bodies_a(1)
      if (size(contact%bodies_b) > 0) contact%body_b = contact%bodies_b(1)
    end if
    if (contact%body_a > 0 .and. contact%body_a == contact%body_b) &
      call report(problems, group, 'surface_b', 'a pair needs two different bodies, got '// &
                  shown(bodies%name(contact%body_a)%s)//' twice')
    call read_exclusions(group, bodies, contact%searched, problems, contact%exclude)
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
    ! A theta below 0 is a mistake of its own.
    if (.not. abs(contact%theta) > 0 .and. all(solver%scheme /= [scheme_auto, scheme_dual])) then
      theta_key = 'name'
      source = ' of &solver'
      if (own_theta) theta_key = option_name(theta_names, theta_kind)
      if (own_theta) source = ''
      call report(problems, group, theta_key, 'theta = 0'//source//' needs scheme=''dual'', got '''// &
                  option_name(scheme_names, solver%scheme)//'''')
    end if
    contact%theta_formula = text_of(group, 'theta_formula')
    contact%is_layer = logical_of(group, 'layer')
    if (contact%is_layer) call check_layer(group, problems, contact)
    call read_condition(group, solver, problems, contact%robin_gap)
    contact%has_search_radius = is_usable(group, 'search_radius')
    contact%search_radius = real_of(group, 'search_radius')
    contact%discretization = integer_of(group, 'discretization')
    ! The mortar mean of a fixed theta has a lower order (docs/theory.md, section 2).
    if (contact%is_layer .and. .not. is_given(group, 'discretization')) &
      contact%discretization = discretization_quadrature
    contact%geometry = integer_of(group, 'geometry')
    contact%quadrature = integer_of(group, 'quadrature')
  end subroutine read_contact

  !> The compliance of a real layer is a property of the scene: given, positive, and independent of the mesh.
  subroutine check_layer(group, problems, contact)
    type(group_t), intent(in) :: group  !! Checked group.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(contact_input_t), intent(in) :: contact  !! The contact pair, with its theta.
    if (.not. contact%theta_given) then
      call report(problems, group, 'layer', 'layer=.true. needs theta, the compliance of the layer '// &
                  '[length/pressure], in &contact or &solver: none is given')
    else if (contact%theta_kind == theta_mesh) then
      call report(problems, group, 'layer', 'layer=.true. needs the compliance of the layer, which no mesh size '// &
                  'changes: give theta, theta_relative or theta_formula, not theta_mesh')
    else if (.not. contact%theta > 0) then
      call report(problems, group, 'layer', 'layer=.true. needs theta > 0, the compliance of the layer')
    end if
  end subroutine check_layer

  !> Read the interface condition of the Robin scheme.
  subroutine read_condition(group, solver, problems, robin_gap)
    type(group_t), intent(in) :: group  !! Checked group.
    type(solver_input_t), intent(in) :: solver  !! Settings of the solver.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> Initial gap up to which constraints have Robin conditions; `-huge` for none [length].
    real(dp), intent(out) :: robin_gap
    character(9) :: key
    integer :: k
    robin_gap = solver%robin_gap
    if (is_usable(group, 'robin_gap')) robin_gap = real_of(group, 'robin_gap')
    if (integer_of(group, 'condition') == condition_neumann) then
      robin_gap = -huge(robin_gap)
      if (is_given(group, 'robin_gap')) &
        call report(problems, group, 'robin_gap', 'robin_gap is given, but condition is ''neumann''; remove one '// &
                    'of them')
    end if
    do k = 1, 2
      key = merge('condition', 'robin_gap', k == 1)
      if (is_given(group, key) .and. solver%scheme /= scheme_robin) &
        call report(problems, group, key, key//' is for scheme=''robin'', and the scheme is '''// &
                    option_name(scheme_names, solver%scheme)//'''; remove it, or set scheme=''robin''')
    end do
  end subroutine read_condition

  !> Read one side of a pair: 'body:surface'.
  subroutine read_side(group, key, bodies, problems, matched, surface, several)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Name of the key.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> Bodies that the side names; none where it is unknown (n_matched).
    integer, allocatable, intent(out) :: matched(:)
    character(:), allocatable, intent(out) :: surface  !! Physical group of the surface.
    logical, intent(out) :: several  !! Whether wildcards name the body.
    character(:), allocatable :: text
    integer :: colon
    allocate (matched(0))
    surface = ''
    several = .false.
    text = text_of(group, key)
    if (len(text) == 0) return
    colon = index(text, ':')
    if (colon > 0) surface = trim(adjustl(text(colon + 1:)))
    if (colon <= 1 .or. len(surface) == 0) then
      call report(problems, group, key, key//' must be ''body:surface'', got '//shown(text))
      return
    end if
    several = names_several(trim(text(:colon - 1)), bodies)
    call refer_to_bodies(group, key, trim(text(:colon - 1)), bodies, problems, matched)
  end subroutine read_side

  !> Report missing keys: name and surfaces, without `auto`; and surfaces with it.
  subroutine read_required(group, auto, problems)
    type(group_t), intent(in) :: group  !! Checked group.
    logical, intent(in) :: auto  !! Whether the group has `auto`.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    character(9), parameter :: keys(3) = [character(9) :: 'name', 'surface_a', 'surface_b']
    logical :: unclear
    integer :: k
    ! With a mistake in auto, or with exclude, the mistake is not the missing surfaces.
    unclear = is_given(group, 'auto') .and. .not. is_usable(group, 'auto')
    if (is_given(group, 'exclude') .and. .not. any([(is_given(group, trim(keys(k))), k=2, 3)])) unclear = .true.
    do k = 1, size(keys)
      if (.not. auto .and. .not. unclear .and. .not. is_given(group, trim(keys(k)))) &
        call problems%add(group%line, '&contact: '''//trim(keys(k))//''' is missing')
      if (auto .and. k > 1 .and. is_given(group, trim(keys(k)))) &
        call report(problems, group, trim(keys(k)), trim(keys(k))//' does not go together with auto=.true.')
    end do
  end subroutine read_required

  !> Read the excluded pairs of bodies: 'a - b', or 'a' for all pairs of a body, names with wildcards.
  subroutine read_exclusions(group, bodies, searched, problems, exclude)
    type(group_t), intent(in) :: group  !! Checked group.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    logical, intent(in) :: searched  !! Whether the group is searched.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(exclusion_t), allocatable, intent(out) :: exclude(:)  !! The pairs (n_exclusions).
    type(text_t), allocatable :: texts(:)
    integer, allocatable :: matched(:), other(:)
    integer :: i, k
    logical :: known
    call texts_of(group, 'exclude', texts)
    allocate (exclude(size(texts)))
    if (is_given(group, 'exclude') .and. .not. searched .and. &
        (is_usable(group, 'auto') .or. .not. is_given(group, 'auto'))) &
      call report(problems, group, 'exclude', 'exclude is for pairs that are searched: auto=.true., or bodies with '// &
                  'wildcards')
    do i = 1, size(texts)
      exclude(i)%a = texts(i)%s
      exclude(i)%b = '*'
      call bodies_named(texts(i)%s, bodies, matched)
      known = size(matched) > 0
      ! Names of bodies may have a '-' of their own: the first place at which both sides name bodies.
      do k = 2, len(texts(i)%s) - 1
        if (known) exit
        if (texts(i)%s(k:k) /= '-') cycle
        call bodies_named(trim(texts(i)%s(:k - 1)), bodies, matched)
        call bodies_named(trim(adjustl(texts(i)%s(k + 1:))), bodies, other)
        known = size(matched) > 0 .and. size(other) > 0
        if (.not. known) cycle
        exclude(i)%a = trim(texts(i)%s(:k - 1))
        exclude(i)%b = trim(adjustl(texts(i)%s(k + 1:)))
      end do
      if (known .or. bodies%incomplete) cycle
      call report(problems, group, 'exclude', 'exclude: '//shown(texts(i)%s)//' names no bodies: write '// &
                  '''body - body'', or ''body'' for all its pairs (known: '//first_names(bodies%name)//')')
    end do
  end subroutine read_exclusions
end module dotyk_input_contacts
