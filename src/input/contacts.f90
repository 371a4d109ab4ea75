!> Reads `&contact` from checked groups.
module dotyk_input_contacts
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: condition_neumann, discretization_quadrature, gap_constant, gap_formula, gap_geometry, &
    option_name, scheme_auto, scheme_dual, scheme_names, scheme_robin, theta_mesh, theta_names
  use dotyk_base_text, only: shown, text_t
  use dotyk_input_case, only: contact_input_t, exclusion_t
  use dotyk_input_groups, only: group_t
  use dotyk_input_references, only: bodies_named, first_names, input_t, names_several
  use dotyk_input_settings, only: read_theta, theta_of_points
  implicit none
  private
  public :: read_contact, read_side

contains

  !> Read `&contact`.
  subroutine read_contact(group, input, contact)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    !> The contact pair, or what its search is to find; incomplete where the group has mistakes.
    type(contact_input_t), intent(out) :: contact
    real(dp) :: theta
    integer :: theta_kind, k
    logical :: own_theta, several_a, several_b
    character(:), allocatable :: theta_key, source
    contact%line = group%line
    contact%name = group%text_of('name')
    contact%auto = group%logical_of('auto')
    call read_required(group, input, contact%auto)
    ! The name becomes that of a folder in the results file.
    if (index(contact%name, '/') > 0 .or. contact%name == '.' .or. contact%name == '..') &
      call input%report(group, 'name', 'name: '//shown(contact%name)//' cannot name a folder of the results file')
    call read_side(group, input, 'surface_a', contact%bodies_a, contact%surface_a, several_a)
    call read_side(group, input, 'surface_b', contact%bodies_b, contact%surface_b, several_b)
    contact%searched = contact%auto .or. several_a .or. several_b
    if (contact%auto) then
      contact%bodies_a = [(k, k=1, size(input%bodies%name))]
      contact%bodies_b = contact%bodies_a
    else if (.not. contact%searched) then
      if (size(contact%bodies_a) > 0) contact%body_a = contact%bodies_a(1)
      if (size(contact%bodies_b) > 0) contact%body_b = contact%bodies_b(1)
    end if
    if (contact%body_a > 0 .and. contact%body_a == contact%body_b) &
      call input%report(group, 'surface_b', 'a pair needs two different bodies, got '// &
                        shown(input%bodies%name(contact%body_a)%s)//' twice')
    call read_exclusions(group, input, contact%searched, contact%exclude)
    contact%gap_kind = gap_geometry
    contact%gap = group%real_of('gap')
    contact%gap_formula = group%text_of('gap_formula')
    if (group%is_given('gap')) contact%gap_kind = gap_constant
    if (group%is_given('gap_formula')) contact%gap_kind = gap_formula
    if (group%is_given('gap') .and. group%is_given('gap_formula')) &
      call input%report(group, 'gap', 'gap and gap_formula are both given: only one can be meant')
    contact%theta_kind = input%solver%theta_kind
    contact%theta = input%solver%theta
    contact%theta_given = input%solver%theta_given
    call read_theta(group, input, own_theta, theta_kind, theta)
    if (own_theta) then
      contact%theta_kind = theta_kind
      contact%theta = theta
      contact%theta_given = .true.
    end if
    ! A theta below 0 is a mistake of its own.
    if (.not. abs(contact%theta) > 0 .and. all(input%solver%scheme /= [scheme_auto, scheme_dual])) then
      theta_key = 'name'
      source = ' of &solver'
      if (own_theta) theta_key = option_name(theta_names, theta_kind)
      if (own_theta) source = ''
      call input%report(group, theta_key, 'theta = 0'//source//' needs scheme=''dual'', got '''// &
                        option_name(scheme_names, input%solver%scheme)//'''')
    end if
    contact%theta_formula = group%text_of('theta_formula')
    contact%is_layer = group%logical_of('layer')
    if (contact%is_layer) call check_layer(group, input, contact)
    call read_condition(group, input, contact%robin_gap)
    contact%has_search_radius = group%is_usable('search_radius')
    contact%search_radius = group%real_of('search_radius')
    contact%discretization = group%integer_of('discretization')
    ! The mortar mean of a fixed theta has a lower order (docs/theory.md, section 2).
    if (contact%is_layer .and. .not. group%is_given('discretization')) &
      contact%discretization = discretization_quadrature
    if (contact%discretization == discretization_quadrature .and. .not. contact%theta_given) &
      contact%theta = max(contact%theta, theta_of_points)
    contact%geometry = group%integer_of('geometry')
    contact%quadrature = group%integer_of('quadrature')
  end subroutine read_contact

  !> The compliance of a real layer is a property of the scene: given, positive, and independent of the mesh.
  subroutine check_layer(group, input, contact)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(contact_input_t), intent(in) :: contact  !! The contact pair, with its theta.
    if (.not. contact%theta_given) then
      call input%report(group, 'layer', 'layer=.true. needs theta, the compliance of the layer [length/pressure], '// &
                        'in &contact or &solver: none is given')
    else if (contact%theta_kind == theta_mesh) then
      call input%report(group, 'layer', 'layer=.true. needs the compliance of the layer, which no mesh size '// &
                        'changes: give theta, theta_relative or theta_formula, not theta_mesh')
    else if (.not. contact%theta > 0) then
      call input%report(group, 'layer', 'layer=.true. needs theta > 0, the compliance of the layer')
    end if
  end subroutine check_layer

  !> Read the interface condition of the Robin scheme.
  subroutine read_condition(group, input, robin_gap)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    real(dp), intent(out) :: robin_gap  !! Initial gap up to which conditions are Robin; `-huge`: none [length].
    character(9) :: key
    integer :: k
    robin_gap = input%solver%robin_gap
    if (group%is_usable('robin_gap')) robin_gap = group%real_of('robin_gap')
    if (group%integer_of('condition') == condition_neumann) then
      robin_gap = -huge(robin_gap)
      if (group%is_given('robin_gap')) &
        call input%report(group, 'robin_gap', 'robin_gap is given, but condition is ''neumann''; remove one of them')
    end if
    do k = 1, 2
      key = merge('condition', 'robin_gap', k == 1)
      if (group%is_given(key) .and. input%solver%scheme /= scheme_robin) &
        call input%report(group, key, key//' is for scheme=''robin'', and the scheme is '''// &
                          option_name(scheme_names, input%solver%scheme)//'''; remove it, or set scheme=''robin''')
    end do
  end subroutine read_condition

  !> Read one side of a pair: 'body:surface'.
  subroutine read_side(group, input, key, matched, surface, several)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that the side names; none if unknown (n_matched).
    character(:), allocatable, intent(out) :: surface  !! Physical group of the surface.
    logical, intent(out) :: several  !! Whether wildcards name the body.
    character(:), allocatable :: text
    integer :: colon
    allocate (matched(0))
    surface = ''
    several = .false.
    text = group%text_of(key)
    if (len(text) == 0) return
    colon = index(text, ':')
    if (colon > 0) surface = trim(adjustl(text(colon + 1:)))
    if (colon <= 1 .or. len(surface) == 0) then
      call input%report(group, key, key//' must be ''body:surface'', got '//shown(text))
      return
    end if
    several = names_several(trim(text(:colon - 1)), input%bodies)
    call input%refer_to_bodies(group, key, trim(text(:colon - 1)), matched)
  end subroutine read_side

  !> Report missing keys: name and surfaces, without `auto`; and surfaces with it.
  subroutine read_required(group, input, auto)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    logical, intent(in) :: auto  !! Whether the group has `auto`.
    character(9), parameter :: keys(3) = [character(9) :: 'name', 'surface_a', 'surface_b']
    logical :: unclear
    integer :: k
    ! With a mistake in auto, or with exclude, the mistake is not the missing surfaces.
    unclear = group%is_given('auto') .and. .not. group%is_usable('auto')
    if (group%is_given('exclude') .and. .not. any([(group%is_given(trim(keys(k))), k=2, 3)])) unclear = .true.
    do k = 1, size(keys)
      if (.not. auto .and. .not. unclear .and. .not. group%is_given(trim(keys(k)))) &
        call input%add(group%line, '&contact: '''//trim(keys(k))//''' is missing')
      if (auto .and. k > 1 .and. group%is_given(trim(keys(k)))) &
        call input%report(group, trim(keys(k)), trim(keys(k))//' does not go together with auto=.true.')
    end do
  end subroutine read_required

  !> Read the excluded pairs of bodies: 'a - b', or 'a' for all pairs of a body, names with wildcards.
  subroutine read_exclusions(group, input, searched, exclude)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    logical, intent(in) :: searched  !! Whether the group is searched.
    type(exclusion_t), allocatable, intent(out) :: exclude(:)  !! The pairs (n_exclusions).
    type(text_t), allocatable :: texts(:)
    integer, allocatable :: matched(:), other(:)
    integer :: i, k
    logical :: known
    call group%texts_of('exclude', texts)
    allocate (exclude(size(texts)))
    if (group%is_given('exclude') .and. .not. searched .and. (group%is_usable('auto') .or. .not. group%is_given(&
        'auto'))) call input%report(group, 'exclude', 'exclude is for pairs that are searched: auto=.true., or '// &
        'bodies with wildcards')
    do i = 1, size(texts)
      exclude(i)%a = texts(i)%s
      exclude(i)%b = '*'
      call bodies_named(texts(i)%s, input%bodies, matched)
      known = size(matched) > 0
      ! Names of bodies may have a '-' of their own: the first place at which both sides name bodies.
      do k = 2, len(texts(i)%s) - 1
        if (known) exit
        if (texts(i)%s(k:k) /= '-') cycle
        call bodies_named(trim(texts(i)%s(:k - 1)), input%bodies, matched)
        call bodies_named(trim(adjustl(texts(i)%s(k + 1:))), input%bodies, other)
        known = size(matched) > 0 .and. size(other) > 0
        if (.not. known) cycle
        exclude(i)%a = trim(texts(i)%s(:k - 1))
        exclude(i)%b = trim(adjustl(texts(i)%s(k + 1:)))
      end do
      if (known .or. input%bodies%incomplete) cycle
      call input%report(group, 'exclude', 'exclude: '//shown(texts(i)%s)//' names no bodies: write '// &
                        '''body - body'', or ''body'' for all its pairs (known: '//first_names(input%bodies)//')')
    end do
  end subroutine read_exclusions
end module dotyk_input_contacts
