!> Supports of a body from the input: prescribed displacements and springs.
module dotyk_model_body_supports
  use dotyk_base_directions, only: directions_t
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_foundation, only: surface_area
  use dotyk_elasticity_support, only: collect_supports, support_t
  use dotyk_input_case, only: applies_in, case_t, rigid_input_t, support_input_t
  use dotyk_mesh_body_mesh, only: connected_components
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_loads, only: check_formula
  use dotyk_model_volumes, only: volume_t
  implicit none
  private

  !> What one support of a body stands for: a `&support`, several of the same surface and `fix` that no load case has in
  !> common, or a `&spring`.
  type, public :: support_group_t
    integer, allocatable :: member(:)  !! Their indices in the case (n).
    logical :: is_spring = .false.  !! Whether it is a spring.
  end type support_group_t

  public :: gather_supports, hold_rigid, move_rigid, load_names, set_supports, support_names

  !> Young's modulus of rigid bodies for scales, such as penalty parameters: above that of any other body [pressure].
  real(dp), parameter :: rigid_young = 1.0e100_dp

contains

  !> Names of the groups of supports, for messages (n_supports).
  pure function support_names(case) result(name)
    type(case_t), intent(in) :: case  !! The case.
    character(8), allocatable :: name(:)
    name = merge('&spring ', '&support', case%support%is_spring)
  end function support_names

  !> Names of the groups of loads, for messages (n_loads).
  pure function load_names(case) result(name)
    type(case_t), intent(in) :: case  !! The case.
    character(5), allocatable :: name(:)
    name = merge('&mass', '&load', case%load%of_mass)
  end function load_names

  !> Gather the supports of a body: those of displacements, without values, and springs.
  subroutine gather_supports(case, mesh, b, volume, body, support, group, used, problems)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_t), intent(in) :: mesh  !! Mesh of the body's volume.
    integer, intent(in) :: b  !! Index of the body.
    type(volume_t), intent(inout) :: volume  !! Volume of the body in the mesh; its surfaces are kept.
    type(body_t), intent(in) :: body  !! The body with its mesh.
    type(support_t), allocatable, intent(out) :: support(:)  !! Supports and springs (n_supports).
    type(support_group_t), allocatable, intent(out) :: group(:)  !! What they stand for (n_supports).
    !> Whether a support is that of a named body, or acts on one of those that wildcards name (n_supports).
    logical, intent(inout) :: used(:)
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; those of the supports are added.
    type(support_t), allocatable :: gathered(:)
    type(support_group_t), allocatable :: groups(:)
    type(error_t), allocatable :: failed
    integer :: i, g, n
    allocate (gathered(count(case%support%body == b)), groups(count(case%support%body == b)))
    n = 0
    do i = 1, size(case%support)
      associate (given => case%support(i))
        if (given%body /= b) cycle
        if (given%any_body) then
          if (.not. volume%has_place(mesh, body%mesh%x, given%place)) cycle
          if (given%is_spring) then
            if (volume%lies_on_axis(mesh, body%mesh%x, body%analysis, given%place)) cycle
          end if
          used(i) = .true.
        end if
        g = alternative_to(case, groups(:n), i)
        if (g > 0) then
          groups(g)%member = [groups(g)%member, i]
          cycle
        end if
        n = n + 1
        groups(n)%member = [i]
        groups(n)%is_spring = given%is_spring
        call volume%take_place(mesh, body%mesh%x, given%place, gathered(n)%surface, failed)
        gathered(n)%fix = given%fix
        call add_context(failed, 'body '//quoted(body%name)//': ')
        if (given%is_spring .and. .not. allocated(failed)) then
          if (volume%lies_on_axis(mesh, body%mesh%x, body%analysis, given%place)) &
            call set_error(failed, '&spring: body '//quoted(body%name)//': '//quoted(gathered(n)%surface%name)// &
                           ' lies on the axis and has no area', exit_bad_input)
        end if
        if (allocated(failed)) call problems%add_error(failed, case%file//':'//to_text(given%line)//': ')
      end associate
    end do
    support = gathered(:n)
    group = groups(:n)
  end subroutine gather_supports

  !> Hold all nodes of a rigid body.
  subroutine hold_rigid(given, body, error)
    type(rigid_input_t), intent(in) :: given  !! `&rigid_body`.
    type(body_t), intent(inout) :: body  !! The body with its mesh; gets its constraint, without displacements.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where it is in pieces.
    integer, allocatable :: component(:)
    integer :: i, n, n_components
    n = body%mesh%n_nodes()
    allocate (component(n))
    call connected_components(body%mesh, component, n_components)
    if (n_components > 1) then
      call set_error(error, 'it has '//to_text(n_components)//' pieces, which would move as one: make each a body', &
                     exit_bad_input)
      return
    end if
    body%material%least_young = rigid_young
    call body%constraint%init(body%dimension, n)
    associate (constraint => body%constraint)
      constraint%rigid%is_set = .true.
      constraint%rigid%held = given%held
      constraint%rigid%point = given%point
      constraint%equation = held
      call constraint%number_equations()
    end associate
    ! One support has the reaction.
    allocate (body%directions%place(1), body%directions%direction(body%dimension, n))
    body%directions%place(1)%s = 'rigid body'
    body%directions%node = [(i, i=1, n)]
    body%directions%source = [(1, i=1, n)]
    body%directions%direction = 0
  end subroutine hold_rigid

  !> Give all nodes of a rigid body the displacements of its held motions in a load case.
  subroutine move_rigid(case, b, k, body)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: b  !! Index of the body.
    integer, intent(in) :: k  !! The load case.
    type(body_t), intent(inout) :: body  !! The body, held by `hold_rigid`.
    integer :: i
    associate (constraint => body%constraint)
      constraint%rigid%motion = 0
      do i = 1, size(case%rigid)
        if (case%rigid(i)%body == b .and. applies_in(case%rigid(i)%in_case, k)) &
          constraint%rigid%motion = case%rigid(i)%motion
      end do
      do i = 1, body%mesh%n_nodes()
        constraint%prescribed(:, i) = constraint%rigid%displacement(body%mesh%x(:, i))
      end do
    end associate
  end subroutine move_rigid

  !> Set prescribed displacements of a load case; in the first one equations, axes and springs, too.
  subroutine set_supports(case, k, support, group, body, error)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: k  !! The load case.
    type(support_t), intent(in) :: support(:)  !! Supports and springs of the body, of `gather_supports` (n_supports).
    type(support_group_t), intent(in) :: group(:)  !! What they stand for (n_supports).
    type(body_t), intent(inout) :: body  !! The body with its mesh; formulas that vary within facets are noted.
    !> Allocated where a formula has no value at a node, or where supports contradict each other.
    type(error_t), allocatable, intent(out) :: error
    type(support_t), allocatable :: fixed(:)
    type(constraint_t) :: constraint
    integer :: g, i, n
    n = 0
    allocate (fixed(count(.not. group%is_spring)))
    do g = 1, size(group)
      if (group(g)%is_spring) cycle
      n = n + 1
      fixed(n)%surface = support(g)%surface
      fixed(n)%fix = support(g)%fix
      fixed(n)%line = case%support(group(g)%member(1))%line
      do i = 1, size(group(g)%member)
        associate (given => case%support(group(g)%member(i)))
          if (.not. applies_in(given%in_case, k)) cycle
          fixed(n)%line = given%line
          fixed(n)%value = given%value
          fixed(n)%formula = given%value_formula
          call check_formula(body, 'the support of '//quoted(fixed(n)%surface%name), fixed(n)%surface, &
                             given%value_formula)
        end associate
      end do
    end do
    if (k > 1) then
      call collect_supports(body%mesh, body%analysis, fixed, constraint, error)
      ! Directions, and with them all else, are the same.
      if (.not. allocated(error)) body%constraint%prescribed = constraint%prescribed
      return
    end if
    call collect_supports(body%mesh, body%analysis, fixed, body%constraint, error, body%directions)
    if (allocated(error)) return
    do g = 1, size(group)
      if (group(g)%is_spring) call add_spring(case%support(group(g)%member(1)), support(g)%surface, body)
    end do
  end subroutine set_supports

  !> Add a spring.
  subroutine add_spring(given, surface, body)
    type(support_input_t), intent(in) :: given  !! `&spring`.
    type(surface_t), intent(in) :: surface  !! Its surface.
    type(body_t), intent(inout) :: body  !! Gets it.
    real(dp) :: modulus, area
    area = surface_area(body%mesh%x, body%analysis, surface)
    modulus = given%modulus
    if (given%stiffness > 0) modulus = given%stiffness/area
    call body%constraint%foundation%add(surface, given%fix, modulus, given%value, area)
  end subroutine add_spring

  !> The group of supports that a support joins, as the load cases tell which of them holds; 0 for none.
  pure integer function alternative_to(case, group, i) result(g)
    type(case_t), intent(in) :: case  !! The case.
    type(support_group_t), intent(in) :: group(:)  !! Supports of the body so far (n_groups).
    integer, intent(in) :: i  !! The support.
    integer :: m
    do g = 1, size(group)
      associate (first => case%support(group(g)%member(1)), own => case%support(i))
        if (own%is_spring .or. first%is_spring) cycle
        if (first%place%text(3) /= own%place%text(3) .or. .not. same_directions(first%fix, own%fix)) cycle
      end associate
      if (all([(are_apart(group(g)%member(m), i), m=1, size(group(g)%member))])) return
    end do
    g = 0

  contains

    !> Whether no load case has both of two supports.
    pure logical function are_apart(one, other)
      integer, intent(in) :: one  !! A support.
      integer, intent(in) :: other  !! Another one.
      integer :: k
      are_apart = .not. any([(applies_in(case%support(one)%in_case, k) .and. &
                              applies_in(case%support(other)%in_case, k), k=1, case%n_cases())])
    end function are_apart
  end function alternative_to

  !> Whether two supports prescribe displacements in the same directions.
  pure logical function same_directions(one, other) result(same)
    type(directions_t), intent(in) :: one  !! Directions of a support.
    type(directions_t), intent(in) :: other  !! Those of another one.
    same = (one%local .eqv. other%local) .and. all(one%fixed .eqv. other%fixed)
  end function same_directions
end module dotyk_model_body_supports
