!> A volume of a mesh and its surfaces, extracted once for all bodies that use it: the whole volume, or the part of it
!> that this rank goes on with.
module dotyk_model_volumes
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: quoted, text_t
  use dotyk_base_wildcard, only: matches
  use dotyk_elasticity_foundation, only: surface_area
  use dotyk_input_case, only: body_input_t, scene_input_t
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_boundary_part, only: find_entities
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_common_facets, only: find_common_facets
  use dotyk_mesh_held_part, only: choose_part, held_surface, hold_part
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_order_elevation, only: has_linear_simplices, elevate_order
  use dotyk_mesh_surface, only: extract_surface, node_numbers, refuse_inner, surface_names, surface_t
  use dotyk_mesh_whole_body, only: whole_body_t
  use dotyk_model_special_volumes, only: cut_volume, take_cut, take_rigid_surface
  implicit none
  private

  type, public :: volume_t  !! A volume and its extracted surfaces.
    type(body_mesh_t) :: mesh  !! Its elements, at the position in the mesh file.
    type(joints_t) :: joints  !! How its parts hang together.
    type(error_t), allocatable :: error  !! Allocated where the mesh has no such volume.
    integer :: n_bodies = 0  !! Number of bodies that were built of it.
    integer, private :: n = 0  !! Number of extracted surfaces.
    type(surface_t), allocatable, private :: surface(:)  !! Extracted surfaces; the first n are in use (n_allocated).
    !> Names of its physical groups of surfaces; allocated when first asked for (n_names).
    type(text_t), allocatable, private :: name(:)
    type(surface_t), allocatable, private :: boundary  !! Its whole boundary; allocated when first asked for.
    logical, private :: is_half = .false.  !! Whether it is one half of a body that a bolt cuts.
  contains
    procedure :: take => volume_take
    procedure :: complete => volume_complete
    procedure :: hold => volume_hold
    procedure :: carry => volume_carry
    procedure :: take_surface => volume_take_surface
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
  !> surface.
  logical function volume_lies_on_axis(self, mesh, x, analysis, name) result(lies)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body in place (dimension, n_nodes) [length].
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    character(*), intent(in) :: name  !! Physical group of the surface.
    type(surface_t) :: surface
    type(error_t), allocatable :: failed
    lies = .false.
    if (analysis /= analysis_axisymmetric) return
    call self%take_surface(mesh, name, surface, failed)
    if (.not. allocated(failed)) lies = .not. surface_area(x, analysis, surface) > 0
  end function volume_lies_on_axis

  !> Extract a surface of the volume, or copy it where it is extracted already.
  subroutine volume_take_surface(self, mesh, name, surface, error)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    character(*), intent(in) :: name  !! Physical group of the surface.
    type(surface_t), intent(out) :: surface  !! The surface.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the volume has no such surface.
    type(surface_t), allocatable :: more(:)
    integer :: i
    do i = 1, self%n
      if (self%surface(i)%name /= trim(name)) cycle
      surface = self%surface(i)
      return
    end do
    if (self%mesh%is_in_parts()) then
      call set_error(error, 'the parts of mesh '//quoted(self%mesh%file)//' have no surface '//quoted(name))
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
  end subroutine volume_take_surface
end module dotyk_model_volumes
