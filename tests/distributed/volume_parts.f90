!> Parts of volumes that ranks make of their shares of a mesh file, under mpirun, against those that are left of the
!> whole body.
program volume_parts
  use, intrinsic :: iso_fortran_env, only: output_unit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_held_body, only: hold_own_part
  use dotyk_elasticity_shortest_extent, only: measure_part, shortest_extent
  use dotyk_elasticity_support, only: collect_supports, support_t
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_gmsh, only: read_gmsh
  use dotyk_mesh_held_part, only: held_surface
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_layer_part, only: held_surface_of_layer
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_selection, only: mesh_selection_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use dotyk_model_volume_parts, only: volume_share_t
  use dotyk_ranks_communication, only: end_ranks, n_ranks, start_ranks, this_rank
  use dotyk_ranks_exchange, only: add_counts, greatest
  implicit none

  real(dp), parameter :: rounding = 1.0e-12_dp  !! Of sums over a body, which depends on their order [].
  integer :: n_failed, code, i
  character(200) :: file, name
  n_failed = 0
  call start_ranks()
  if (command_argument_count() > 1) then
    call get_command_argument(1, file)
    call get_command_argument(2, name)
    call test_parts(trim(file), trim(name))
  else
    do i = 1, 3
      call test_parts('unit/mesh/data/kinds_2.41.part.msh', trim(name_of(i)))
    end do
  end if
  code = min(1, n_failed)
  call end_ranks(code)
  stop code, quiet=.true.

contains

  !> Volumes of the meshes.
  character(10) function name_of(i) result(name)
    integer, intent(in) :: i  !! Which one.
    character(10), parameter :: names(3) = ['tetrahedra', 'hexahedra ', 'prisms    ']
    name = names(i)
  end function name_of

  !> Make the parts of a volume, and compare them.
  subroutine test_parts(file, name)
    character(*), intent(in) :: file  !! Mesh file.
    character(*), intent(in) :: name  !! Volume.
    type(mesh_selection_t) :: selection
    type(mesh_t) :: share, mesh
    type(volume_share_t) :: volume
    type(surface_layer_t) :: layer
    type(body_mesh_t) :: part
    type(joints_t) :: joints, of_whole
    type(body_t) :: body
    type(surface_t) :: boundary, of_layer
    type(error_t), allocatable :: error
    type(support_t) :: none(0)
    real(dp), allocatable :: rank_of(:), count_of(:)
    integer, allocatable :: number(:)
    integer :: b, e, n, before
    selection%everything = .false.
    allocate (selection%volume(1))
    selection%volume(1)%s = name
    selection%n_shares = n_ranks()
    selection%share = this_rank()
    call read_gmsh(file, share, error, selection)
    if (.not. allocated(error)) call volume%take(share, name, 3, error)
    if (allocated(error)) then
      call check(.false., error%message)
      return
    end if
    call volume%make_part(share, name, 1, 0_int64, volume%weight(), part, layer, joints, error)
    call check(.not. allocated(error) .and. .not. allocated(joints%fault), 'no fault')
    call measure_part(part)
    call read_gmsh(file, mesh, error)
    call extract_body(mesh, name, 3, body%mesh, error)
    call of_whole%find(body%mesh)
    call check(joints%n_parts == of_whole%n_parts .and. joints%n_pieces == of_whole%n_pieces, 'parts and pieces')
    ! Which rank owns each element, each just once.
    allocate (rank_of(body%mesh%n_elements()), count_of(body%mesh%n_elements()), source=0.0_dp)
    n = 0
    before = 0
    do b = 1, size(part%block)
      do e = 1, size(part%block(b)%tag)
        n = n + 1
        if (part%whole%own_element(n)) rank_of(before + part%whole%element(n)) = this_rank()
        if (part%whole%own_element(n)) count_of(before + part%whole%element(n)) = 1
      end do
      before = before + size(body%mesh%block(b)%tag)
    end do
    call greatest(rank_of)
    block
      integer(int64) :: owners(size(count_of))
      owners = nint(count_of)
      call add_counts(owners)
      call check(all(owners == 1), 'each element has one owner')
    end block
    call extract_boundary(body%mesh, boundary)
    call collect_supports(body%mesh, body%analysis, none, body%constraint, error)
    call hold_own_part(body, nint(rank_of), this_rank(), n_ranks(), number)
    call held_surface(body%mesh, number, boundary)
    of_layer = layer%boundary
    call held_surface_of_layer(layer, part, of_layer)
    call compare(body%mesh, part)
    call check(all(boundary%node == of_layer%node) .and. all(boundary%element == of_layer%element) .and. &
               all(boundary%kind == of_layer%kind), 'boundary')
    if (this_rank() == 0) write (output_unit, '(3a, i0, a, i0, a)') file, ' ', name, part%n_elements(), ' of ', &
      part%n_whole_elements(), ' elements on the first rank'
  end subroutine test_parts

  !> Compare two held parts.
  subroutine compare(a, b)
    type(body_mesh_t), intent(in) :: a  !! Left of the whole body.
    type(body_mesh_t), intent(in) :: b  !! Made of shares.
    integer :: k
    call check(a%n_nodes() == b%n_nodes() .and. a%n_elements() == b%n_elements(), 'numbers of nodes and elements')
    if (a%n_nodes() /= b%n_nodes() .or. a%n_elements() /= b%n_elements()) return
    call check(all(abs(a%x - b%x) <= 0) .and. all(a%node_tag == b%node_tag), 'nodes')
    do k = 1, size(a%block)
      call check(all(a%block(k)%node == b%block(k)%node) .and. all(a%block(k)%tag == b%block(k)%tag), 'elements')
    end do
    call check(a%whole%n_nodes == b%whole%n_nodes .and. a%whole%n_file_nodes == b%whole%n_file_nodes .and. &
               all(a%whole%n_of_block == b%whole%n_of_block), 'size of the body')
    call check(a%is_in_parts() .and. b%is_in_parts(), 'kind of part')
    call check(abs(a%diameter() - b%diameter()) <= rounding*a%diameter() .and. &
               abs(shortest_extent(a) - shortest_extent(b)) <= rounding*a%diameter(), 'extents')
    call check(all(a%whole%node == b%whole%node) .and. all(a%whole%element == b%whole%element), 'numbers')
    call check(all(a%whole%own_node .eqv. b%whole%own_node), 'own nodes')
    call check(all(a%whole%own_element .eqv. b%whole%own_element), 'own elements')
    call check(all(a%whole%component == b%whole%component), 'components')
    call check(a%whole%n_components == b%whole%n_components, 'number of components')
    call check(all(a%whole%facet_kind == b%whole%facet_kind), 'kinds of facets')
    call check(all(a%whole%facet_node == b%whole%facet_node), 'facets')
  end subroutine compare

  !> Note whether a test has failed.
  subroutine check(holds, what)
    logical, intent(in) :: holds  !! What must hold.
    character(*), intent(in) :: what  !! What was tested.
    if (holds) return
    n_failed = n_failed + 1
    write (output_unit, '(a, i0, 2a)') 'FAILED on rank ', this_rank(), ': ', what
  end subroutine check
end program volume_parts
