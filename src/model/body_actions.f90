!> What acts on a body, from the input: supports with their values, loads, temperature and initial stress, in each load
!> case.
module dotyk_model_body_actions
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load_cases, only: clear_actions, keep_case, take_case
  use dotyk_elasticity_support, only: support_t
  use dotyk_input_case, only: applies_in, case_t, load_input_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_loads, only: acts_on_surface, add_load
  use dotyk_model_body_supports, only: gather_supports, hold_rigid, move_rigid, set_supports, support_group_t
  use dotyk_model_initial_states, only: add_initial_stress, add_temperature
  use dotyk_model_volumes, only: volume_t
  implicit none
  private
  public :: set_actions

  !> Resultants of centrifugal forces of floating bodies, relative to their size, that are taken for the accuracy of the
  !> mesh: in scenes without contact, where the accuracy is that of facets on circles, and in others [].
  real(dp), parameter :: alone = 1.0e-3_dp, in_contact = 1.0e-6_dp

contains

  !> Set supports, loads, temperature and initial stress of a body.
  subroutine set_actions(case, mesh, volume, b, body, support_used, load_used, problems)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_t), intent(in) :: mesh  !! Mesh of the body's volume.
    type(volume_t), intent(inout) :: volume  !! Volume of the body in the mesh; its surfaces are kept.
    integer, intent(in) :: b  !! Index of the body.
    !> The body, with mesh and material; not yet assembled. That of the first load case on return.
    type(body_t), intent(inout) :: body
    !> Whether a support is that of a named body, or acts on one of those that wildcards name (n_supports).
    logical, intent(inout) :: support_used(:)
    logical, intent(inout) :: load_used(:)  !! The same of loads (n_loads).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; those of the body are added.
    type(error_t), allocatable :: failed
    type(support_t), allocatable :: support(:)
    type(support_group_t), allocatable :: group(:)
    logical :: supports_vary, varies
    integer :: i, k, before, rigid
    before = problems%count
    rigid = 0
    if (allocated(case%rigid)) rigid = findloc(case%rigid%body, b, dim=1)
    call gather_supports(case, mesh, b, volume, body, support, group, support_used, problems)
    supports_vary = any([(case%support(i)%body == b .and. allocated(case%support(i)%in_case), i=1, size(case%support))])
    varies = supports_vary .or. &
             any([(case%load(i)%body == b .and. allocated(case%load(i)%in_case), i=1, size(case%load))]) .or. &
             any([(case%temperature(i)%body == b .and. allocated(case%temperature(i)%in_case), &
                   i=1, size(case%temperature))]) .or. &
             any([(case%initial_stress(i)%body == b .and. allocated(case%initial_stress(i)%in_case), &
                   i=1, size(case%initial_stress))])
    if (rigid > 0) &
      varies = varies .or. any([(case%rigid(i)%body == b .and. allocated(case%rigid(i)%in_case), &
                                 i=1, size(case%rigid))])
    varies = varies .and. case%n_cases() > 1
    if (varies) allocate (body%of_case(case%n_cases()))
    do k = 1, merge(case%n_cases(), 1, varies)
      call clear_actions(body)
      if (problems%count == before .and. rigid > 0) then
        if (k == 1) call hold_rigid(case%rigid(rigid), body, failed)
        call add_context(failed, 'body '//quoted(body%name)//': ')
        call note(case%rigid(rigid)%line, failed)
        if (problems%count == before) call move_rigid(case, b, k, body)
      else if (problems%count == before .and. (k == 1 .or. supports_vary)) then
        call set_supports(case, k, support, group, body, failed)
        if (allocated(failed)) &
          call problems%add(case%file//": body '"//body%name//"': "//failed%message//case%in_case_text(k), failed%code)
        if (problems%count > before .and. k > 1) return
      end if
      if (problems%count == before) call body%constraint%foundation%add_loads(body%mesh%x, body%analysis, body%load)
      call set_loads(k)
      if (problems%count > before) return
      if (varies) call keep_case(body, k)
    end do
    call take_case(body, 1)

  contains

    !> Take a surface of the body; messages name the body.
    subroutine take_surface(name, surface, error)
      character(*), intent(in) :: name  !! Name of the surface, maybe with wildcards.
      type(surface_t), intent(out) :: surface  !! The surface.
      type(error_t), allocatable, intent(out) :: error  !! Allocated where the body has no such surface.
      call volume%take_surface(mesh, name, surface, error)
      call add_context(error, 'body '//quoted(body%name)//': ')
    end subroutine take_surface

    !> Set loads, temperature and initial stress of a load case.
    subroutine set_loads(k)
      integer, intent(in) :: k  !! The load case.
      integer :: i
      do i = 1, size(case%load)
        if (case%load(i)%body /= b) cycle
        if (case%load(i)%any_body .and. acts_on_surface(case%load(i))) then
          if (.not. volume%has_surface(mesh, case%load(i)%surface)) cycle
          ! Of the bodies that wildcards name, one on the axis has as little of a load as one without the surface.
          if (volume%lies_on_axis(mesh, body%mesh%x, body%analysis, case%load(i)%surface)) cycle
        end if
        load_used(i) = .true.
        if (.not. applies_in(case%load(i)%in_case, k)) cycle
        call set_load(case%load(i), failed)
        call note(case%load(i)%line, failed)
      end do
      do i = 1, size(case%temperature)
        if (case%temperature(i)%body /= b .or. .not. applies_in(case%temperature(i)%in_case, k)) cycle
        call add_temperature(case%temperature(i), body, failed)
        call note(case%temperature(i)%line, failed)
      end do
      do i = 1, size(case%initial_stress)
        if (case%initial_stress(i)%body /= b .or. .not. applies_in(case%initial_stress(i)%in_case, k)) cycle
        call add_initial_stress(case%initial_stress(i), body, failed)
        call note(case%initial_stress(i)%line, failed)
      end do
    end subroutine set_loads

    !> Add the nodal forces of one load.
    subroutine set_load(given, failed)
      type(load_input_t), intent(in) :: given  !! `&load`.
      type(error_t), allocatable, intent(out) :: failed  !! Allocated where the load cannot be used.
      type(surface_t) :: surface
      if (acts_on_surface(given)) then
        call take_surface(given%surface, surface, failed)
        if (.not. allocated(failed)) then
          if (volume%lies_on_axis(mesh, body%mesh%x, body%analysis, given%surface)) &
            call set_error(failed, 'body '//quoted(body%name)//': '//quoted(given%surface)//' lies on the axis and '// &
                           'has no area', exit_bad_input)
        end if
      end if
      ! In contact or tied, a small resultant may be what is asked for; alone, the scene would have no equilibrium.
      if (.not. allocated(failed)) &
        call add_load(given, surface, merge(alone, in_contact, size(case%contact) + size(case%tie) == 0), body, failed)
    end subroutine set_load

    !> Add a problem of a line of the namelist file, if there is one.
    subroutine note(line, failed)
      integer, intent(in) :: line  !! Line of the namelist file.
      type(error_t), allocatable, intent(inout) :: failed  !! Problem; not allocated on return.
      if (.not. allocated(failed)) return
      call problems%add_error(failed, case%file//':'//to_text(line)//': ')
    end subroutine note
  end subroutine set_actions
end module dotyk_model_body_actions
