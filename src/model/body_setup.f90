!> Builds bodies from the input: meshes, materials, supports, loads, and the surfaces that contact pairs may need.
module dotyk_model_body_setup
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_options, only: analysis_axisymmetric, quantity_reaction
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: body_input_t, case_t
  use dotyk_mesh_conversion, only: meshing_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_placement, only: placement_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_actions, only: set_actions
  use dotyk_model_body_supports, only: load_names, support_names
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_joints, only: add_remark, check_joints, describe_joints
  use dotyk_model_materials, only: build_material, survey_material, turn_material, would_lock
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_alone, read_mesh
  use dotyk_model_volumes, only: refuse_on_both_halves, volume_t
  implicit none
  private
  public :: build_bodies, build_body, refuse_unused

contains

  !> Read every mesh once, extract every volume once, and build the bodies; all problems are reported together.
  subroutine build_bodies(case, body, surfaces, remarks, error, kept, given)
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), allocatable, intent(out) :: body(:)  !! Bodies, not yet assembled (n_bodies).
    type(body_surfaces_t), allocatable, intent(out) :: surfaces(:)  !! Surfaces that pairs may need (n_bodies).
    type(text_t), allocatable, intent(out) :: remarks(:)  !! Lines for the log (n_remarks).
    type(error_t), allocatable, intent(out) :: error  !! Where meshes, materials, supports or loads are wrong.
    !> The volumes with the surfaces that were asked for, those of the first bodies with each; the meshes are read
    !> without the other ranks (n_bodies).
    type(volume_t), intent(inout), optional :: kept(:)
    type(volume_t), intent(inout), optional :: given(:)  !! Of this rank's parts of the bodies (n_bodies).
    type(problem_list_t) :: problems
    type(mesh_t) :: whole_mesh
    type(meshing_t) :: meshing
    type(error_t), allocatable :: failed
    logical, dimension(size(case%body)) :: read, done, same, locks
    logical :: support_used(size(case%support)), load_used(size(case%load))
    integer :: b, c, before
    allocate (body(size(case%body)), surfaces(size(case%body)))
    allocate (remarks(0))
    meshing = meshing_of(case)
    read = .false.
    support_used = .not. case%support%any_body
    load_used = .not. case%load%any_body
    done = .false.
    locks = [(would_lock(case, b), b=1, size(body))]
    do b = 1, size(body)
      if (interrupted()) exit
      if (read(b)) cycle
      same = [(case%body(c)%mesh == case%body(b)%mesh, c=1, size(body))]
      read = read .or. same
      if (present(given)) then
        call build_file(whole_mesh)
        cycle
      end if
      before = problems%count
      if (present(kept)) then
        call read_alone(case%body(b)%mesh, case%scene%dimension, whole_mesh, meshing, failed)
      else
        call read_mesh(case%body(b)%mesh, case%scene%dimension, whole_mesh, meshing, failed)
      end if
      if (len(meshing%remark) > 0) call add_remark(remarks, meshing%remark)
      call problems%add_error(failed)
      if (problems%count > before) cycle
      call add_unions(case, case%body(b)%mesh, whole_mesh)
      call build_file(whole_mesh)
    end do
    if (problems%count == 0) then
      call refuse_unused(case%file, case%scene%analysis, case%support%line, support_used, support_names(case), &
                         case%support%place%dimension == case%scene%dimension - 1, problems)
      call refuse_unused(case%file, case%scene%analysis, case%load%line, load_used, load_names(case), &
                         case%load%place%dimension == case%scene%dimension - 1, problems)
      call refuse_on_both_halves(case, support_used, load_used, problems)
    end if
    call problems%raise(error)

  contains

    !> Build the bodies of one file.
    subroutine build_file(mesh)
      type(mesh_t), intent(in) :: mesh  !! The file; empty where this rank has parts of its volumes.
      type(volume_t) :: volume
      integer :: c
      do c = b, size(body)
        if (.not. same(c) .or. done(c)) cycle
        if (present(given)) then
          call build_volume(mesh, c, given(c))
        else
          call volume%take(mesh, case%scene, case%body(c), locks(c))
          call build_volume(mesh, c, volume)
        end if
        if (.not. present(kept) .or. problems%count > 0) cycle
        call volume%complete(mesh)
        kept(c) = volume
      end do
    end subroutine build_file

    !> Build the bodies of one volume.
    subroutine build_volume(mesh, c, volume)
      type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
      integer, intent(in) :: c  !! The first body.
      type(volume_t), intent(inout) :: volume  !! The volume.
      integer :: k
      volume%n_bodies = 0
      do k = c, size(body)
        if (.not. same(k) .or. (locks(k) .neqv. locks(c))) cycle
        if (.not. case%body(k)%has_shape_of(case%body(c))) cycle
        done(k) = .true.
        volume%n_bodies = volume%n_bodies + 1
        call build_body(case, mesh, volume, k, body(k), surfaces(k), support_used, load_used, problems)
      end do
      if (.not. allocated(volume%error)) call describe_joints(case, volume%joints, volume%n_bodies, c, remarks)
    end subroutine build_volume
  end subroutine build_bodies

  !> Report groups whose wildcards name bodies of which none has the surface.
  subroutine refuse_unused(file, analysis, line, used, group, on_surface, problems)
    character(*), intent(in) :: file  !! The namelist file.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    integer, intent(in) :: line(:)  !! Line of each support or load; those of one group follow each other (n).
    logical, intent(in) :: used(:)  !! Whether the body has the surface (n).
    character(*), intent(in) :: group(:)  !! Name of the group of each, for messages (n).
    logical, intent(in) :: on_surface(:)  !! Whether its place is a surface, not an edge or nodes (n).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; mistakes are added.
    logical :: one_used
    integer :: k
    one_used = .false.
    do k = 1, size(line)
      one_used = one_used .or. used(k)
      if (k < size(line)) then
        if (line(k + 1) == line(k)) cycle
      end if
      if (.not. one_used) &
        call problems%add(file//':'//to_text(line(k))//': '//trim(group(k))//': none of the bodies '// &
                          'has such '//trim(merge('a surface       ', 'an edge or nodes', on_surface(k)))// &
                          trim(merge(' off the axis', '             ', on_surface(k) .and. &
                                     analysis == analysis_axisymmetric .and. group(k) /= '&support')), exit_bad_input)
      one_used = .false.
    end do
  end subroutine refuse_unused

  !> Build one body, and its surfaces for contact pairs.
  subroutine build_body(case, mesh, volume, b, body, surfaces, support_used, load_used, problems)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_t), intent(in) :: mesh  !! Mesh of the body's volume.
    type(volume_t), intent(inout) :: volume  !! Volume of the body in the mesh; its surfaces are kept.
    integer, intent(in) :: b  !! Index of the body.
    type(body_t), intent(inout) :: body  !! The body, not yet assembled.
    type(body_surfaces_t), intent(inout) :: surfaces  !! Its surfaces that contact pairs may need.
    !> Whether a support is that of a named body, or acts on one of those that wildcards name (n_supports).
    logical, intent(inout) :: support_used(:)
    logical, intent(inout) :: load_used(:)  !! The same of loads (n_loads).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; those of the body are added.
    type(error_t), allocatable :: failed
    integer :: k, before
    logical :: failed_survey, is_half
    before = problems%count
    failed_survey = .false.
    body%name = case%body(b)%name
    body%analysis = case%scene%analysis
    body%dimension = case%scene%dimension
    allocate (body%material(size(case%body(b)%material)))
    do k = 1, size(body%material)
      associate (given => case%material(case%body(b)%material(k)))
        call build_material(given, case%solver%locking, body%material(k), failed)
        call note(given%line, failed)
      end associate
    end do
    if (allocated(volume%error)) failed = volume%error
    call note(case%body(b)%line, failed)
    if (.not. allocated(volume%error)) call check_joints(case%body(b), volume%joints, failed)
    call note(case%body(b)%line, failed)
    if (problems%count > before) return
    body%is_hinged = volume%joints%n_pieces > volume%joints%n_parts
    call place(case%body(b))
    do k = 1, size(body%material)
      call body%material(k)%check_plane(body%analysis, failed)
      call note(case%body(b)%line, failed)
      call survey_material(body%mesh, body%analysis, k, case%solver%locking, body%material(k), failed)
      call add_context(failed, 'body '//quoted(body%name)//': ')
      failed_survey = failed_survey .or. allocated(failed)
      call note(case%material(case%body(b)%material(k))%line, failed)
    end do
    ! Loads would find the same mistakes.
    if (failed_survey) return

    ! A single body has no pairs.
    if (size(case%body) > 1) call volume%take_boundary(mesh, surfaces%boundary)
    do k = 1, size(case%contact)
      associate (contact => case%contact(k))
        if (contact%auto) cycle
        if (contact%searched) then
          if (any(contact%bodies_a == b)) call take_side(contact%line, contact%surface_a, .true.)
          if (any(contact%bodies_b == b)) call take_side(contact%line, contact%surface_b, .true.)
        else
          if (contact%body_a == b) call take_side(contact%line, contact%surface_a, .false.)
          if (contact%body_b == b) call take_side(contact%line, contact%surface_b, .false.)
        end if
      end associate
    end do
    do k = 1, size(case%quantity)
      associate (given => case%quantity(k))
        if (given%kind == quantity_reaction .or. len(given%surface) == 0) cycle
        if (any(given%body == b)) call take_side(given%line, given%surface, given%any_body)
      end associate
    end do
    is_half = case%body(b)%cut%is_cut()
    do k = 1, size(case%tie)
      if (case%tie(k)%body_a == b) &
        call take_side(case%tie(k)%line, case%tie(k)%surface_a, is_half .and. .not. case%tie(k)%is_cut)
      if (case%tie(k)%body_b == b) &
        call take_side(case%tie(k)%line, case%tie(k)%surface_b, is_half .and. .not. case%tie(k)%is_cut)
    end do
    call set_actions(case, mesh, volume, b, body, support_used, load_used, problems)
    ! All ranks have the same problems.
    if (body%mesh%is_in_parts() .and. problems%count == before) call body%take_part()

  contains

    !> Rotate and shift the body with the axes of its materials.
    subroutine place(given)
      type(body_input_t), intent(in) :: given  !! `&body`.
      type(placement_t) :: placement
      integer :: m
      call placement%init(given%axis, given%angle, given%at)
      body%mesh = volume%mesh
      call placement%apply(body%mesh%x)
      do m = 1, size(body%material)
        if (placement%rotated) call turn_material(placement%rotation, body%material(m))
      end do
    end subroutine place

    !> Take a surface of the body for contact pairs, ties and mean displacements.
    subroutine take_side(line, name, may_lack)
      integer, intent(in) :: line  !! Line of the namelist file.
      character(*), intent(in) :: name  !! Name of the surface, maybe with wildcards.
      logical, intent(in) :: may_lack  !! Whether the body need not have it.
      type(surface_t) :: surface
      if (surfaces%find(name) > 0) return
      if (may_lack) then
        if (.not. volume%has_surface(mesh, name)) return
      end if
      call take_surface(name, surface, failed)
      if (.not. allocated(failed)) call surfaces%add(name, surface)
      call note(line, failed)
    end subroutine take_side

    !> Take a surface of the body; messages name the body.
    subroutine take_surface(name, surface, error)
      character(*), intent(in) :: name  !! Name of the surface, maybe with wildcards.
      type(surface_t), intent(out) :: surface  !! The surface.
      type(error_t), allocatable, intent(out) :: error  !! Allocated where the body has no such surface.
      call volume%take_surface(mesh, name, surface, error)
      call add_context(error, 'body '//quoted(body%name)//': ')
    end subroutine take_surface

    !> Add a problem of a line of the namelist file, if there is one.
    subroutine note(line, failed)
      integer, intent(in) :: line  !! Line of the namelist file.
      type(error_t), allocatable, intent(inout) :: failed  !! Problem; not allocated on return.
      ! Asked for every body and pair: no text where there is no problem.
      if (.not. allocated(failed)) return
      call problems%add_error(failed, case%file//':'//to_text(line)//': ')
    end subroutine note
  end subroutine build_body
end module dotyk_model_body_setup
