!> A volume of a mesh and its surfaces, extracted once for all bodies that use it: the whole volume, or the part of it
!> that this rank goes on with.
!>
!> Bodies that are no whole volume of a mesh: rigid ones that are a surface, and halves of those that a bolt cuts.
module dotyk_model_volumes
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_total
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_place, only: place_t
  use dotyk_base_text, only: matches, quoted, text_t, to_text
  use dotyk_elasticity_foundation, only: surface_area
  use dotyk_input_case, only: body_input_t, case_t, cut_input_t, cut_surface, scene_input_t
  use dotyk_mesh_body_cut, only: cut_along_plane, cut_along_surface, extract_cut, take_half
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body, whole_body_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_edges_and_nodes, only: extract_edges_or_nodes, find_nodes_at, known_to_all
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_held_part, only: choose_part, held_surface, hold_part
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_order_elevation, only: elevate_order, has_linear_simplices
  use dotyk_mesh_rigid_surface, only: extract_rigid_surface, facing_t
  use dotyk_mesh_surface, only: extract_surface, find_common_facets, find_entities, node_numbers, refuse_inner, &
    surface_names, surface_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: refuse_on_both_halves

  type, public :: volume_t  !! A volume and its extracted surfaces.
    type(body_mesh_t) :: mesh  !! Its elements, at the position in the mesh file.
    type(joints_t) :: joints  !! How its parts hang together.
    type(error_t), allocatable :: error  !! Allocated where the mesh has no such volume.
    integer :: n_bodies = 0  !! Number of bodies that were built of it.
    integer, private :: n = 0  !! Number of extracted surfaces, edges and sets of nodes.
    type(surface_t), allocatable, private :: surface(:)  !! All of these; the first n are in use (n_allocated).
    !> Names of its physical groups of surfaces; allocated when first asked for (n_names).
    type(text_t), allocatable, private :: name(:)
    type(surface_t), allocatable, private :: boundary  !! Its whole boundary; allocated when first asked for.
    logical, private :: is_half = .false.  !! Whether it is one half of a body that a bolt cuts.
  contains
    procedure :: take => volume_take
    procedure :: complete => volume_complete
    procedure :: hold => volume_hold
    procedure :: carry => volume_carry
    procedure :: take_place => volume_take_place
    procedure :: take_surface => volume_take_surface
    procedure :: has_place => volume_has_place
    procedure :: has_surface => volume_has_surface
    procedure :: lies_on_axis => volume_lies_on_axis
    procedure :: take_boundary => volume_take_boundary
  end type volume_t

contains

  !> Extract the volume of a body from a mesh, or its surface where it has no volume.
  subroutine volume_take(self, mesh, scene, given, locks)
    class(volume_t), intent(out) :: self
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its dimension and analysis.
    type(body_input_t), intent(in) :: given  !! The body.
    !> Whether linear triangles, tetrahedra, prisms and pyramids would lock: then they are elevated to order 2.
    logical, intent(in) :: locks
    type(body_mesh_t) :: uncut
    allocate (self%surface(4))
    if (given%is_surface) then
      call take_rigid_surface(mesh, scene, given, self%mesh, self%error)
      return
    end if
    call extract_body(mesh, given%volume, scene%dimension, self%mesh, self%error)
    if (given%cut%is_cut() .and. .not. allocated(self%error)) call cut_volume(mesh, given, self%mesh, uncut, self%error)
    if (.not. allocated(self%error)) call self%joints%find(self%mesh)
    if (locks .and. .not. allocated(self%error)) then
      if (has_linear_simplices(self%mesh)) call elevate_order(self%mesh)
    end if
    self%is_half = given%cut%is_cut()
    if (allocated(self%error) .or. .not. self%is_half) return
    self%n = 1
    call take_cut(uncut, self%mesh, self%surface(1))
  end subroutine volume_take

  !> Find what can no longer be found without the mesh: the names of the surfaces.
  subroutine volume_complete(self, mesh)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    if (.not. allocated(self%name)) call find_names(self, mesh)
  end subroutine volume_complete

  !> Reduce the volume to the part of a rank: some of its elements, and of its surfaces those that were asked for.
  subroutine volume_hold(self, whole, element_rank, rank)
    class(volume_t), intent(inout) :: self
    type(whole_body_t), intent(in) :: whole  !! The whole volume, from `describe_whole`.
    integer, intent(in) :: element_rank(:)  !! Rank of each element, from 0, through all blocks (n_elements).
    integer, intent(in) :: rank  !! The rank, from 0.
    logical, allocatable :: holds(:), own_node(:)
    integer, allocatable :: number(:)
    integer :: i
    call choose_part(self%mesh, element_rank, rank, holds, own_node)
    call hold_part(self%mesh, whole, holds, element_rank == rank, own_node, number)
    self%mesh%whole%in_parts = .true.
    do i = 1, self%n
      call held_surface(self%mesh, number, self%surface(i))
    end do
    if (allocated(self%boundary)) call held_surface(self%mesh, number, self%boundary)
  end subroutine volume_hold

  !> Put it into a parcel, or take it out.
  subroutine volume_carry(self, parcel)
    class(volume_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    logical :: has_boundary
    integer :: i
    call parcel%carry(self%n_bodies)
    if (self%n_bodies == 0) return
    call self%mesh%carry(parcel)
    call self%joints%carry(parcel)
    call parcel%carry(self%n)
    if (parcel%is_read) allocate (self%surface(max(1, self%n)))
    do i = 1, self%n
      call self%surface(i)%carry(parcel)
    end do
    call parcel%carry(self%name)
    has_boundary = allocated(self%boundary)
    call parcel%carry(has_boundary)
    if (parcel%is_read .and. has_boundary) allocate (self%boundary)
    if (has_boundary) call self%boundary%carry(parcel)
  end subroutine volume_carry

  !> The whole boundary of the volume.
  subroutine volume_take_boundary(self, mesh, boundary)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    type(surface_t), intent(out) :: boundary  !! The boundary.
    integer, allocatable :: number(:)
    if (.not. allocated(self%boundary)) then
      allocate (self%boundary)
      call extract_boundary(self%mesh, self%boundary)
      call node_numbers(mesh, self%mesh, number)
      call find_entities(mesh, number, self%boundary)
    end if
    boundary = self%boundary
  end subroutine volume_take_boundary

  !> Whether the volume has a surface, an edge or nodes.
  logical function volume_has_place(self, mesh, x, place) result(has)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body in place (dimension, n_nodes) [length].
    type(place_t), intent(in) :: place  !! The place.
    type(surface_t) :: surface
    type(error_t), allocatable :: failed
    if (place%dimension == self%mesh%dimension - 1) then
      has = self%has_surface(mesh, place%name)
    else
      call self%take_place(mesh, x, place, surface, failed)
      has = .not. allocated(failed)
    end if
  end function volume_has_place

  !> Whether the volume has a surface of a name.
  logical function volume_has_surface(self, mesh, name) result(has)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    character(*), intent(in) :: name  !! Physical group of the surface, maybe with wildcards.
    integer :: i
    if (.not. allocated(self%name)) call find_names(self, mesh)
    has = .true.
    do i = 1, size(self%name)
      if (self%name(i)%s == name .or. matches(name, self%name(i)%s)) return
    end do
    has = .false.
  end function volume_has_surface

  !> Names of the surfaces of a volume.
  subroutine find_names(volume, mesh)
    type(volume_t), intent(inout) :: volume  !! The volume; gets its names.
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    type(surface_t) :: surface
    type(error_t), allocatable :: failed
    logical, allocatable :: is_there(:)
    integer :: i
    call surface_names(mesh, volume%mesh, volume%name)
    if (.not. volume%is_half) return
    ! Of surfaces that end at a jagged cut a half may have all nodes of a facet, and no facet. Names of facets inside
    ! the half stay: what acts on them is refused.
    allocate (is_there(size(volume%name)))
    do i = 1, size(is_there)
      call extract_surface(mesh, volume%mesh, volume%name(i)%s, surface, failed, is_there(i))
    end do
    volume%name = pack(volume%name, is_there)
  end subroutine find_names

  !> Whether a surface lies on the axis of an axisymmetric body, where it has no area; not where there is no such
  !> surface. Nodes have no area anywhere.
  logical function volume_lies_on_axis(self, mesh, x, analysis, place) result(lies)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body in place (dimension, n_nodes) [length].
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(place_t), intent(in) :: place  !! The surface.
    type(surface_t) :: surface
    type(error_t), allocatable :: failed
    lies = .false.
    if (analysis /= analysis_axisymmetric .or. place%dimension == 0) return
    call self%take_surface(mesh, place%name, surface, failed)
    if (.not. allocated(failed)) lies = .not. surface_area(x, analysis, surface) > 0
  end function volume_lies_on_axis

  !> Extract a surface of the volume, or copy it where it is extracted already.
  subroutine volume_take_surface(self, mesh, name, surface, error)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    character(*), intent(in) :: name  !! Physical group of the surface.
    type(surface_t), intent(out) :: surface  !! The surface.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the volume has no such surface.
    type(place_t) :: place
    place%dimension = self%mesh%dimension - 1
    place%name = trim(name)
    call take_named(self, mesh, place, surface, error)
  end subroutine volume_take_surface

  !> Take a surface, an edge or nodes of a body.
  subroutine volume_take_place(self, mesh, x, place, surface, error)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body in place (dimension, n_nodes) [length].
    type(place_t), intent(in) :: place  !! The place.
    type(surface_t), intent(out) :: surface  !! The place as a surface, maybe of facets that are lines or nodes.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the body has none.
    integer :: f
    logical, allocatable :: known(:)
    if (allocated(place%at)) then
      call find_nodes_at(self%mesh, x, place, surface, error)
    else
      call take_named(self, mesh, place, surface, error)
    end if
    if (allocated(error) .or. place%dimension > 0 .or. .not. self%mesh%is_in_parts()) return
    known = [.false., known_to_all(self%mesh)]
    if (.not. all([(known(1 + surface%node(1, f)), f=1, surface%n_facets)])) &
      call set_error(error, quoted(surface%name)//' lies inside the body, which is split over ranks: those on its '// &
                     'surface are possible, or run with one process', exit_bad_input)
  end subroutine volume_take_place

  !> Extract what physical groups name, or copy it where it is extracted already.
  subroutine take_named(self, mesh, place, surface, error)
    type(volume_t), intent(inout) :: self  !! The volume; keeps it.
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    type(place_t), intent(in) :: place  !! The place.
    type(surface_t), intent(out) :: surface  !! The place as a surface.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the volume has no such place.
    type(surface_t), allocatable :: more(:)
    character(:), allocatable :: name
    integer :: i
    name = place%text(self%mesh%dimension)
    do i = 1, self%n
      if (self%surface(i)%name /= name) cycle
      surface = self%surface(i)
      return
    end do
    if (self%mesh%is_in_parts()) then
      call set_error(error, 'the parts of mesh '//quoted(self%mesh%file)//' have no surface '//quoted(name))
    else if (place%dimension < self%mesh%dimension - 1) then
      call extract_edges_or_nodes(mesh, self%mesh, place, surface, error)
    else
      call extract_surface(mesh, self%mesh, name, surface, error)
      if (self%is_half .and. .not. allocated(error)) call refuse_at_cut()
    end if
    if (allocated(error)) return
    if (self%n == size(self%surface)) then
      allocate (more(2*self%n))
      more(:self%n) = self%surface
      call move_alloc(more, self%surface)
    end if
    self%n = self%n + 1
    self%surface(self%n) = surface

  contains

    !> Facets at the cut are inside the whole body: what acts on them would act on both halves.
    subroutine refuse_at_cut()
      logical, allocatable :: is_cut(:)
      call find_common_facets(surface, self%surface(1), is_cut)
      if (any(is_cut)) call refuse_inner(mesh, name, count(is_cut), surface%tag(findloc(is_cut, .true., dim=1)), error)
    end subroutine refuse_at_cut
  end subroutine take_named

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
      if (case%load(k)%kind /= load_total .and. case%load(k)%place%dimension == case%scene%dimension - 1) cycle
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
end module dotyk_model_volumes
