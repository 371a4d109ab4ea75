!> A volume of a mesh and its surfaces, extracted once for all bodies that use it: the whole volume, or the part of it
!> that this rank goes on with.
module dotyk_model_volumes
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: text_t
  use dotyk_base_wildcard, only: matches
  use dotyk_elasticity_foundation, only: surface_area
  use dotyk_elasticity_shortest_extent, only: measure_part
  use dotyk_input_case, only: body_input_t, scene_input_t
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_boundary_part, only: find_entities
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_layer_part, only: held_surface_of_layer
  use dotyk_mesh_common_facets, only: find_common_facets
  use dotyk_mesh_layer_surface, only: extract_layer_surface, layer_boundary, layer_surface_names
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_order_elevation, only: has_linear_simplices, elevate_order
  use dotyk_mesh_surface, only: extract_surface, node_numbers, refuse_inner, surface_names, surface_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use dotyk_model_special_volumes, only: cut_volume, take_cut, take_rigid_surface
  use dotyk_model_volume_parts, only: volume_share_t
  implicit none
  private

  type, public :: volume_t  !! A volume and its extracted surfaces.
    type(body_mesh_t) :: mesh  !! Its elements, at the position in the mesh file.
    type(joints_t) :: joints  !! How its parts hang together.
    type(error_t), allocatable :: error  !! Allocated where the mesh has no such volume.
    integer, private :: n = 0  !! Number of extracted surfaces.
    type(surface_t), allocatable, private :: surface(:)  !! Extracted surfaces; the first n are in use (n_allocated).
    !> Names of its physical groups of surfaces; allocated when first asked for (n_names).
    type(text_t), allocatable, private :: name(:)
    type(surface_t), allocatable, private :: boundary  !! Its whole boundary; allocated when first asked for.
    logical, private :: is_half = .false.  !! Whether it is one half of a body that a bolt cuts.
    type(surface_layer_t), allocatable, private :: layer  !! Its surface, where this rank has a part of its elements.
  contains
    procedure :: take => volume_take
    procedure :: take_part => volume_take_part
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

  !> Make the part of this rank, with all ranks.
  subroutine volume_take_part(self, mesh, name, share, n_bodies, before, all_weight)
    class(volume_t), intent(out) :: self
    type(mesh_t), intent(in) :: mesh  !! What this rank has read of the file.
    character(*), intent(in) :: name  !! Physical group of the volume.
    type(volume_share_t), intent(inout) :: share  !! What it has read of the volume; given up.
    integer, intent(in) :: n_bodies  !! Number of bodies that use the volume.
    !> Weights of the bodies of the volumes before this one, and of all bodies.
    integer(int64), intent(in) :: before, all_weight
    allocate (self%layer)
    call share%make_part(mesh, name, n_bodies, before, all_weight, self%mesh, self%layer, self%joints, self%error)
    if (.not. allocated(self%error) .and. .not. allocated(self%joints%fault)) call measure_part(self%mesh)
    allocate (self%surface(4))
  end subroutine volume_take_part

  !> The whole boundary of the volume.
  subroutine volume_take_boundary(self, mesh, boundary)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    type(surface_t), intent(out) :: boundary  !! The boundary.
    integer, allocatable :: number(:)
    if (.not. allocated(self%boundary)) then
      allocate (self%boundary)
      if (allocated(self%layer)) then
        call layer_boundary(mesh, self%layer, self%boundary)
        call held_surface_of_layer(self%layer, self%mesh, self%boundary)
      else
        call extract_boundary(self%mesh, self%boundary)
        call node_numbers(mesh, self%mesh, number)
        call find_entities(mesh, number, self%boundary)
      end if
    end if
    boundary = self%boundary
  end subroutine volume_take_boundary

  !> Whether the volume has a surface of a name.
  logical function volume_has_surface(self, mesh, name) result(has)
    class(volume_t), intent(inout) :: self
    type(mesh_t), intent(in) :: mesh  !! Mesh of the volume.
    character(*), intent(in) :: name  !! Physical group of the surface, maybe with wildcards.
    integer :: i
    if (.not. allocated(self%name)) then
      if (allocated(self%layer)) then
        call layer_surface_names(mesh, self%layer, self%name)
      else
        call surface_names(mesh, self%mesh, self%name)
        if (self%is_half) call drop_edges()
      end if
    end if
    has = .true.
    do i = 1, size(self%name)
      if (self%name(i)%s == name .or. matches(name, self%name(i)%s)) return
    end do
    has = .false.

  contains

    !> Of surfaces that end at a jagged cut a half may have all nodes of a facet, and no facet.
    subroutine drop_edges()
      type(surface_t) :: surface
      type(error_t), allocatable :: failed
      logical :: is_there(size(self%name))
      do i = 1, size(is_there)
        ! Names of facets inside the half stay: what acts on them is refused.
        call extract_surface(mesh, self%mesh, self%name(i)%s, surface, failed, is_there(i))
      end do
      self%name = pack(self%name, is_there)
    end subroutine drop_edges
  end function volume_has_surface

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
    if (allocated(self%layer)) then
      call extract_layer_surface(mesh, self%layer, name, surface, error)
      if (.not. allocated(error)) call held_surface_of_layer(self%layer, self%mesh, surface)
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
