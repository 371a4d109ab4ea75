!> Supports of a body from the input: prescribed displacements and springs.
module dotyk_model_body_supports
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: held
  use dotyk_elasticity_foundation, only: surface_area
  use dotyk_elasticity_support, only: collect_supports, support_t
  use dotyk_input_case, only: case_t, rigid_input_t, support_input_t
  use dotyk_mesh_body_mesh, only: connected_components
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_loads, only: check_formula
  use dotyk_model_volumes, only: volume_t
  implicit none
  private
  public :: build_supports, load_names, support_names

  !> Young's modulus of rigid bodies for scales, such as penalty parameters: above that of any other body [pressure].
  real(dp), parameter :: rigid_young = 1.0e100_dp

contains

  !> Names of the groups of supports, for messages (n_supports).
  pure function support_names(case) result(name)
    !> The case.
    type(case_t), intent(in) :: case
    character(8), allocatable :: name(:)
    name = merge('&spring ', '&support', case%support%is_spring)
  end function support_names

  !> Names of the groups of loads, for messages (n_loads).
  pure function load_names(case) result(name)
    !> The case.
    type(case_t), intent(in) :: case
    character(5), allocatable :: name(:)
    name = merge('&mass', '&load', case%load%of_mass)
  end function load_names

  !> Collect the supports of a body.
  subroutine build_supports(case, mesh, b, volume, body, used, problems)
    !> The case.
    type(case_t), intent(in) :: case
    !> Mesh of the body's volume.
    type(mesh_t), intent(in) :: mesh
    !> Index of the body.
    integer, intent(in) :: b
    !> Volume of the body in the mesh; its surfaces are kept.
    type(volume_t), intent(inout) :: volume
    !> The body with its mesh; gets its constraint.
    type(body_t), intent(inout) :: body
    !> Whether a support is that of a named body, or acts on one of those that wildcards name (n_supports).
    logical, intent(inout) :: used(:)
    !> Problems so far; those of the supports are added.
    type(problem_list_t), intent(inout) :: problems
    type(error_t), allocatable :: failed
    type(support_t), allocatable :: gathered(:)
    type(surface_t), allocatable :: surface(:)
    integer, allocatable :: of(:)
    integer :: i, before
    before = problems%count
    allocate (of(0), surface(count(case%support%body == b)))
    do i = 1, size(case%support)
      associate (given => case%support(i))
        if (given%body /= b) cycle
        if (given%any_body) then
          if (.not. volume%has_surface(mesh, given%surface)) cycle
          used(i) = .true.
        end if
        of = [of, i]
        call volume%take_surface(mesh, given%surface, surface(size(of)), failed)
        call add_context(failed, 'body '//quoted(body%name)//': ')
        if (allocated(failed)) &
          call problems%add_error(failed, case%file//':'//to_text(given%line)//': ')
      end associate
    end do
    if (problems%count > before) return
    i = 0
    if (allocated(case%rigid)) i = findloc(case%rigid%body, b, dim=1)
    if (i > 0) then
      call hold_rigid(case%rigid(i), body, failed)
      if (allocated(failed)) &
        call problems%add_error(failed, case%file//':'//to_text(case%rigid(i)%line)//': body '//quoted(body%name)//': ')
      return
    end if
    call gather_fixed(case%support, of, surface, body, gathered)
    call collect_supports(body%mesh, body%analysis, gathered, body%constraint, failed, body%directions)
    if (allocated(failed)) call problems%add(case%file//": body '"//body%name//"': "//failed%message, failed%code)
    do i = 1, size(of)
      if (case%support(of(i))%is_spring) call add_spring(case%support(of(i)), surface(i), body)
    end do
  end subroutine build_supports

  !> Give all nodes of a rigid body the displacements of its held motions.
  subroutine hold_rigid(given, body, error)
    !> `&rigid_body`.
    type(rigid_input_t), intent(in) :: given
    !> The body with its mesh; gets its constraint.
    type(body_t), intent(inout) :: body
    !> Allocated where it is in pieces.
    type(error_t), allocatable, intent(out) :: error
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
      constraint%rigid%motion = given%motion
      constraint%rigid%point = given%point
      constraint%equation = held
      call constraint%number_equations()
      do i = 1, n
        constraint%prescribed(:, i) = constraint%rigid%displacement(body%mesh%x(:, i))
      end do
    end associate
    ! One support has the reaction.
    allocate (body%directions%place(1), body%directions%direction(body%dimension, n))
    body%directions%place(1)%s = 'rigid body'
    body%directions%node = [(i, i=1, n)]
    body%directions%source = [(1, i=1, n)]
    body%directions%direction = 0
  end subroutine hold_rigid

  !> Supports with prescribed displacements.
  subroutine gather_fixed(support, of, surface, body, gathered)
    !> Supports of the case (n_supports).
    type(support_input_t), intent(in) :: support(:)
    !> Those of the body (n).
    integer, intent(in) :: of(:)
    !> Their surfaces (>= n).
    type(surface_t), intent(in) :: surface(:)
    !> The body; formulas that vary within facets are noted.
    type(body_t), intent(inout) :: body
    !> The supports.
    type(support_t), allocatable, intent(out) :: gathered(:)
    integer :: i, n
    n = 0
    allocate (gathered(count(.not. support(of)%is_spring)))
    do i = 1, size(of)
      associate (given => support(of(i)))
        if (given%is_spring) cycle
        n = n + 1
        gathered(n)%surface = surface(i)
        gathered(n)%fix = given%fix
        gathered(n)%value = given%value
        gathered(n)%formula = given%value_formula
        call check_formula(body, 'the support of '//quoted(given%surface), surface(i), given%value_formula)
      end associate
    end do
  end subroutine gather_fixed

  !> Add a spring.
  subroutine add_spring(given, surface, body)
    !> `&spring`.
    type(support_input_t), intent(in) :: given
    !> Its surface.
    type(surface_t), intent(in) :: surface
    !> Gets it.
    type(body_t), intent(inout) :: body
    real(dp) :: modulus
    modulus = given%modulus
    if (given%stiffness > 0) modulus = given%stiffness/surface_area(body%mesh%x, body%analysis, surface)
    call body%constraint%foundation%add(surface, given%fix, modulus, given%value)
  end subroutine add_spring
end module dotyk_model_body_supports
