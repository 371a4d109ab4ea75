!> Bodies that are no whole volume of a mesh: rigid ones that are a surface, and halves of those that a bolt cuts.
module dotyk_model_special_volumes
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_options, only: analysis_axisymmetric, load_total
  use dotyk_base_text, only: quoted, to_text
  use dotyk_input_case, only: body_input_t, case_t, scene_input_t
  use dotyk_input_cut, only: cut_input_t, cut_surface
  use dotyk_mesh_body_cut, only: cut_along_plane, cut_along_surface, extract_cut, take_half
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_rigid_surface, only: extract_rigid_surface, facing_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: cut_volume, refuse_on_both_halves, take_cut, take_rigid_surface

contains

  !> Take the faces of a rigid body without volume.
  subroutine take_rigid_surface(mesh, scene, given, body_mesh, error)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its dimension and analysis.
    type(body_input_t), intent(in) :: given  !! The body.
    type(body_mesh_t), intent(out) :: body_mesh  !! Its faces.
    type(error_t), allocatable, intent(out) :: error  !! Set for an unknown name and faces that are no surface.
    call extract_rigid_surface(mesh, given%volume, scene%dimension, scene%analysis == analysis_axisymmetric, &
                               facing_t(given%has_facing, given%facing), body_mesh, error)
  end subroutine take_rigid_surface

  !> Go on with one half of a body that a bolt cuts, along faces of its elements.
  subroutine cut_volume(mesh, given, body_mesh, whole, error)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    type(body_input_t), intent(in) :: given  !! The half.
    type(body_mesh_t), intent(inout) :: body_mesh  !! Mesh of the whole body; that of the half on return.
    type(body_mesh_t), intent(out) :: whole  !! Mesh of the whole body.
    type(error_t), allocatable, intent(out) :: error  !! Set where the body cannot be cut in two halves.
    type(cut_input_t) :: cut
    type(joints_t) :: joints
    logical, allocatable :: is_ahead(:)
    whole = body_mesh
    cut = given%cut%place_back(given%at, given%axis, given%angle)
    call joints%find(whole)
    if (joints%n_pieces > 1) then
      call set_error(error, 'it consists of '//to_text(joints%n_pieces)//' parts', exit_bad_input)
    else if (len(cut%surface) > 0) then
      call cut_along_surface(mesh, whole, cut%surface, is_ahead, error)
    else
      call cut_along_plane(whole, cut%point(:whole%dimension), cut%normal(:whole%dimension), is_ahead, error)
    end if
    if (.not. allocated(error)) call take_half(whole, is_ahead .eqv. cut%half == 2, body_mesh)
    if (.not. allocated(error) .and. len(cut%surface) == 0 .and. whole%dimension == 3) call refuse_two_sections()
    call add_context(error, 'body '//quoted(cut%whole)//' cannot be cut by the &bolt of line '//to_text(cut%line)//': ')

  contains

    !> A plane through a ring has two sections, which would share the force.
    subroutine refuse_two_sections()
      type(surface_t) :: section
      type(element_kind_t) :: kind
      integer, allocatable :: parent(:)
      logical :: is_root(body_mesh%n_nodes())
      integer :: f, i, n
      call extract_cut(whole, body_mesh, cut_surface, section)
      parent = [(i, i=1, body_mesh%n_nodes())]
      do f = 1, section%n_facets
        kind = element_kind(section%kind(f))
        do i = 2, kind%n_corners
          call join(parent, section%node(1, f), section%node(i, f))
        end do
      end do
      is_root = .false.
      do f = 1, section%n_facets
        is_root(root_of(parent, section%node(1, f))) = .true.
      end do
      n = count(is_root)
      if (n > 1) &
        call set_error(error, 'the plane cuts it in '//to_text(n)//' places, which would share the force: a bolt '// &
                       'is cut once, across its shank; give the body by a volume of its own, or another point or '// &
                       'normal', exit_bad_input)
    end subroutine refuse_two_sections
  end subroutine cut_volume

  !> The surface of a half at the cut.
  subroutine take_cut(whole, half, surface)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the whole body.
    type(body_mesh_t), intent(in) :: half  !! Mesh of the half.
    type(surface_t), intent(out) :: surface  !! The surface.
    call extract_cut(whole, half, cut_surface, surface)
  end subroutine take_cut

  !> Refuse what both halves of a body would get wholly: total forces, masses and total stiffnesses.
  subroutine refuse_on_both_halves(case, support_used, load_used, problems)
    type(case_t), intent(in) :: case  !! The case.
    logical, intent(in) :: support_used(:)  !! Whether a support acts on its body (n_supports).
    logical, intent(in) :: load_used(:)  !! The same of loads (n_loads).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; mistakes are added.
    integer :: k
    do k = 1, size(case%support)
      if (.not. case%support(k)%stiffness > 0) cycle
      if (is_on_both(case%support%body, case%support%line, support_used, k)) &
        call refuse(case%support(k)%line, '&spring', 'the whole stiffness', case%support(k)%body)
    end do
    do k = 1, size(case%load)
      if (case%load(k)%kind /= load_total) cycle
      if (is_on_both(case%load%body, case%load%line, load_used, k)) &
        call refuse(case%load(k)%line, trim(merge('&mass', '&load', case%load(k)%of_mass)), &
                    trim(merge('the whole mass ', 'the whole force', case%load(k)%of_mass)), case%load(k)%body)
    end do

  contains

    !> Whether the item of a first half is that of the second half, too.
    pure logical function is_on_both(body, line, used, k)
      integer, intent(in) :: body(:), line(:)  !! Bodies of the items, their lines, and whether they act (n).
      logical, intent(in) :: used(:)
      integer, intent(in) :: k  !! The item.
      is_on_both = .false.
      if (body(k) == 0) return
      if (used(k) .and. case%body(body(k))%cut%half == 1) &
        is_on_both = any(used .and. line == line(k) .and. body == body(k) + 1)
    end function is_on_both

    !> Add the problem.
    subroutine refuse(line, group, what, body)
      integer, intent(in) :: line  !! Line of the group.
      character(*), intent(in) :: group, what  !! The group, and what both halves would get.
      integer, intent(in) :: body  !! The first half.
      call problems%add(case%file//':'//to_text(line)//': '//group//': the surface lies on both halves of body '// &
                        quoted(case%body(body)%cut%whole)//', and each would get '//what//': name a surface of one '// &
                        'half, or '//quoted(case%body(body)%name)//' or '//quoted(case%body(body + 1)%name)// &
                        ' as the body', exit_bad_input)
    end subroutine refuse
  end subroutine refuse_on_both_halves
end module dotyk_model_special_volumes
