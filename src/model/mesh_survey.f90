!> What mesh files have of the volumes of the bodies, without their elements: kinds and numbers, from the heads of the
!> blocks of a file where it has some. By them the ranks choose which bodies each of them reads.
module dotyk_model_mesh_survey
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: text_t
  use dotyk_input_case, only: case_t
  use dotyk_mesh_element, only: element_hex20, element_hex27, element_hex8, element_prism15, element_prism18, &
    element_prism6, element_pyramid13, element_pyramid14, element_pyramid5, element_quad4, element_quad8, &
    element_quad9, element_tet10, element_tet4, element_tri3, element_tri6, kind_dimension, n_element_kinds
  use dotyk_mesh_conversion, only: meshing_t
  use dotyk_mesh_mesh, only: groups_named, mesh_selection_t, mesh_t
  use dotyk_model_materials, only: would_lock
  use dotyk_model_joints, only: add_remark
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_mesh
  use dotyk_ranks_exchange, only: on_any_rank
  implicit none
  private

  type, public :: mesh_survey_t  !! What the files have.
    logical :: is_known = .false.  !! Whether all files could be read, and have the same mesh at each reading.
    !> The first body of the same file, and of the same volume with elements of the same order (n_bodies).
    integer, allocatable :: first_of_file(:), first_of_volume(:)
    logical, allocatable :: locks(:)  !! Whether linear elements would lock and are elevated (n_bodies).
    type(text_t), allocatable :: remark(:)  !! What the log is to say of the files (n_remarks).
    integer(int64), allocatable, private :: n_of_kind(:, :)  !! Elements of each kind (n_element_kinds, n_bodies).
  contains
    procedure :: read => survey_read
    procedure :: volumes => survey_volumes
    procedure :: alike => survey_alike
    procedure :: most_nodes => survey_most_nodes
    procedure :: expected_nodes => survey_expected_nodes
  end type mesh_survey_t

  !> Nodes of a plate that is one element thick, over those of as many elements inside a large body: 2 for hexahedra and
  !> prisms of first order, less for others.
  real(dp), parameter :: most_of_expected = 2

contains

  !> Count the elements of all bodies.
  subroutine survey_read(self, case)
    class(mesh_survey_t), intent(out) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_selection_t) :: selection
    type(meshing_t) :: meshing
    type(mesh_t) :: mesh
    type(error_t), allocatable :: failed
    integer :: b, c, n
    n = size(case%body)
    self%locks = [(would_lock(case, b), b=1, n)]
    allocate (self%first_of_file(n), self%first_of_volume(n), self%remark(0))
    ! Bodies without volume, and those that are cut, are built by all ranks.
    if (any(case%body%is_surface .or. case%body%cut%is_cut())) return
    allocate (self%n_of_kind(n_element_kinds, n), source=0_int64)
    do b = 1, n
      do c = 1, b
        if (case%body(c)%mesh == case%body(b)%mesh) exit
      end do
      self%first_of_file(b) = c
      do c = c, b
        if (case%body(c)%mesh == case%body(b)%mesh .and. case%body(c)%volume == case%body(b)%volume .and. &
            (self%locks(c) .eqv. self%locks(b))) exit
      end do
      self%first_of_volume(b) = c
    end do
    meshing = meshing_of(case)
    selection%everything = .false.
    selection%counts_only = .true.
    selection%dimension = case%scene%dimension
    do b = 1, n
      if (self%first_of_file(b) /= b) cycle
      selection%volume = self%volumes(case, self%first_of_file == b)
      call read_mesh(case%body(b)%mesh, case%scene%dimension, mesh, meshing, failed, selection)
      if (on_any_rank(allocated(failed))) return
      if (interrupted()) return
      if (len(meshing%remark) > 0) call add_remark(self%remark, meshing%remark)
      call add_unions(case, case%body(b)%mesh, mesh)
      do c = b, n
        if (self%first_of_file(c) == b) &
          call count_elements(mesh, case%body(c)%volume, case%scene%dimension, self%n_of_kind(:, c))
      end do
    end do
    self%is_known = .true.
  end subroutine survey_read

  !> Count the elements of a volume.
  pure subroutine count_elements(mesh, name, dimension, n_of_kind)
    type(mesh_t), intent(in) :: mesh  !! What was read of the file.
    character(*), intent(in) :: name  !! Physical group of the volume.
    integer, intent(in) :: dimension  !! Dimension of space.
    integer(int64), intent(inout) :: n_of_kind(:)  !! Number of elements of each kind (n_element_kinds).
    logical :: wanted(size(mesh%group))
    integer :: b
    wanted = groups_named(mesh, trim(name), dimension)
    do b = 1, size(mesh%block)
      associate (block => mesh%block(b))
        if (kind_dimension(block%kind) /= dimension .or. .not. any(wanted(block%group))) cycle
        n_of_kind(block%kind) = n_of_kind(block%kind) + block%n_in_file
      end associate
    end do
  end subroutine count_elements

  !> Names of the physical groups of the volumes of some bodies (n_names).
  function survey_volumes(self, case, chosen) result(name)
    class(mesh_survey_t), intent(in) :: self
    type(case_t), intent(in) :: case  !! The case.
    logical, intent(in) :: chosen(:)  !! Which bodies (n_bodies).
    type(text_t), allocatable :: name(:)
    logical :: used(size(chosen))
    integer :: b, k, n
    used = .false.
    do b = 1, size(chosen)
      if (chosen(b)) used(self%first_of_volume(b)) = .true.
    end do
    allocate (name(sum([(size(case%body(b)%volumes), b=1, size(used))], mask=used)))
    n = 0
    do b = 1, size(chosen)
      if (.not. used(b)) cycle
      do k = 1, size(case%body(b)%volumes)
        n = n + 1
        name(n)%s = case%body(b)%volumes(k)%s
      end do
    end do
  end function survey_volumes

  !> Whether two bodies have as many elements of each kind.
  pure logical function survey_alike(self, b, c) result(alike)
    class(mesh_survey_t), intent(in) :: self
    integer, intent(in) :: b, c  !! The bodies.
    alike = all(self%n_of_kind(:, b) == self%n_of_kind(:, c)) .and. (self%locks(b) .eqv. self%locks(c))
  end function survey_alike

  !> Nodes that a body has at most, unless it is one element thick in two directions.
  pure real(dp) function survey_most_nodes(self, b) result(n)
    class(mesh_survey_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    n = most_of_expected*self%expected_nodes(b)
  end function survey_most_nodes

  !> Number of nodes as in the interior of a mesh of such elements.
  pure real(dp) function survey_expected_nodes(self, b) result(n)
    class(mesh_survey_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    integer :: kind
    n = 1
    do kind = 1, n_element_kinds
      n = n + nodes_per_element(kind_in_body(self, b, kind))*real(self%n_of_kind(kind, b), dp)
    end do
  end function survey_expected_nodes

  !> The kind that elements have in a body: of order 2 where linear triangles, tetrahedra, prisms and pyramids would
  !> lock.
  pure integer function kind_in_body(self, b, kind)
    type(mesh_survey_t), intent(in) :: self  !! The survey.
    integer, intent(in) :: b  !! The body.
    integer, intent(in) :: kind  !! Kind in the file.
    kind_in_body = kind
    if (.not. self%locks(b)) return
    if (all(self%n_of_kind([element_tri3, element_tet4, element_prism6, element_pyramid5], b) == 0)) return
    select case (kind)
    case (element_tri3)
      kind_in_body = element_tri6
    case (element_quad4)
      kind_in_body = element_quad9
    case (element_tet4)
      kind_in_body = element_tet10
    case (element_hex8)
      kind_in_body = element_hex27
    case (element_prism6)
      kind_in_body = element_prism18
    case (element_pyramid5)
      kind_in_body = element_pyramid14
    end select
  end function kind_in_body

  !> Nodes for each element of a large mesh: corners, edges, faces and elements of regular ones.
  pure real(dp) function nodes_per_element(kind) result(n)
    integer, intent(in) :: kind  !! Element kind.
    select case (kind)
    case (element_tri3, element_prism6)
      n = 0.5_dp
    case (element_tri6)
      n = 2
    case (element_quad4, element_hex8)
      n = 1
    case (element_quad8)
      n = 3
    case (element_quad9, element_hex20, element_prism18)
      n = 4
    case (element_tet4)
      n = 0.18_dp
    case (element_tet10)
      n = 1.4_dp
    case (element_hex27)
      n = 8
    case (element_prism15)
      n = 2.5_dp
    case (element_pyramid5)
      n = 0.33_dp
    case (element_pyramid13)
      n = 2.2_dp
    case (element_pyramid14)
      n = 2.7_dp
    case default
      n = 0
    end select
  end function nodes_per_element
end module dotyk_model_mesh_survey
