!> Rigid body modes and sizes of bodies in parts, under mpirun, against those of the whole body, which every rank has
!> here: the same motions at the held nodes, orthonormal over all ranks, with the same resultants and texts.
program split_modes
  use, intrinsic :: iso_fortran_env, only: output_unit
  use test_bodies, only: box_t, curved, hold_own_part, make_body, make_support, rotation, steel, undistorted
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_3d, analysis_plane_strain, load_force_density, load_traction
  use dotyk_elasticity_body, only: body_t, hold_surface
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_element_ranks, only: element_work, rank_elements
  use dotyk_elasticity_load, only: add_surface_load, add_volume_load, load_t
  use dotyk_elasticity_rigid_motion, only: free_rigid_modes
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_elasticity_support, only: support_t
  use dotyk_mesh_element, only: element_hex20, element_hex8, element_tet10, element_tri6
  use dotyk_mesh_held_part, only: surface_part
  use dotyk_ranks_communication, only: end_ranks, n_ranks, start_ranks, this_rank
  use dotyk_ranks_exchange, only: add_up, greatest, on_any_rank
  implicit none

  !> Differences of displacements of modes, whose squares add up to 1, and relative ones of sizes and forces [].
  real(dp), parameter :: accuracy = 1.0e-12_dp
  integer :: n_failed, code
  n_failed = 0
  call start_ranks()
  call test_free()
  call test_plane()
  call test_symmetry_planes()
  call test_components()
  call test_ranks_without_nodes()
  call test_slender()
  call test_kinds_of_parts()
  code = min(1, n_failed)
  call end_ranks(code)
  stop code, quiet=.true.

contains

  !> A floating body under a load that moves it, and under one that is in equilibrium.
  subroutine test_free()
    type(box_t) :: box
    type(support_t) :: none(0)
    call box%init(element_hex20, 4, curved)
    call compare('free hex20', box, none, .true., 6, .false.)
    call box%transform(rotation(3, 0.7_dp), [10.0_dp, -20.0_dp, 5.0_dp])
    call compare('free hex20 in equilibrium', box, none, .false., 6, .false.)
  end subroutine test_free

  !> Two dimensions.
  subroutine test_plane()
    type(box_t) :: box
    type(support_t) :: none(0), s(1)
    call box%init(element_tri6, 7, curved)
    call compare('free tri6', box, none, .true., 3, .false.)
    call box%transform(rotation(2, 0.3_dp), [0.1_dp, 0.2_dp])
    s(1) = make_support(box%side(2, .false.), 'n')
    call compare('tri6 on a turned symmetry line', box, s, .true., 1, .false.)
  end subroutine test_plane

  !> Supports in turned axes.
  subroutine test_symmetry_planes()
    type(box_t) :: box
    type(support_t) :: s(2)
    call box%init(element_tet10, 4, curved)
    call box%transform(rotation(3, 0.7_dp), [0.1_dp, 0.2_dp, 0.3_dp])
    s(1) = make_support(box%side(3, .false.), 'n')
    call compare('tet10 on a turned symmetry plane', box, s(:1), .true., 3, .false.)
    s(2) = make_support(box%side(2, .true.), 'n')
    call compare('tet10 between two of them', box, s, .true., 1, .false.)
    s(2) = make_support(box%side(2, .true.), 'xyz')
    call compare('held tet10', box, s, .true., 0, .false.)
  end subroutine test_symmetry_planes

  !> Two connected components, whose first nodes are inside, with tags that are no real numbers.
  subroutine test_components()
    type(box_t) :: box
    type(support_t) :: none(0), s(1)
    integer :: inside, i
    call box%init(element_tet10, 3, curved)
    inside = findloc([(all(box%lattice(:, i) == 3), i=1, size(box%lattice, 2))], .true., 1)
    call swap_nodes(box, 1, inside)
    s(1) = make_support(box%side(1, .false.), 'xyz')
    call box%repeat([3.0_dp, 5.0_dp, 1.0_dp])
    box%mesh%node_tag = box%mesh%node_tag + 2_int64**60
    call compare('two free components', box, none, .true., 12, .false.)
    call compare('two components, one held', box, s, .true., 6, .false.)
  end subroutine test_components

  !> Bodies of which only the last rank computes anything.
  subroutine test_ranks_without_nodes()
    type(box_t) :: box
    type(support_t) :: none(0), s(1)
    call box%init(element_hex8, 1, undistorted)
    call compare('one hex8', box, none, .true., 6, .false.)
    call box%init(element_tet10, 3, curved)
    s(1) = make_support(box%side(3, .false.), 'n')
    call box%repeat([3.0_dp, 5.0_dp, 1.0_dp])
    call compare('two components of the last rank', box, s, .true., 9, .true.)
  end subroutine test_ranks_without_nodes

  !> A turned strut: the displacements of its rotation about its axis are small differences.
  subroutine test_slender()
    real(dp) :: stretch(3, 3)
    type(box_t) :: box
    type(support_t) :: none(0)
    call box%init(element_hex20, 3, curved)
    stretch = 0
    stretch(1, 1) = 1
    stretch(2, 2) = 0.02_dp
    stretch(3, 3) = 0.01_dp
    call box%transform(matmul(rotation(3, 0.4_dp), stretch), [1.0_dp, 2.0_dp, 3.0_dp])
    call compare('strut', box, none, .true., 6, .false.)
  end subroutine test_slender

  !> Modes, sizes and texts of a body in parts against those of the whole body.
  subroutine compare(name, box, supports, moves, n_modes, on_last)
    character(*), intent(in) :: name  !! Of the test.
    type(box_t), intent(in) :: box  !! The box.
    type(support_t), intent(in) :: supports(:)  !! Its supports (n_supports).
    logical, intent(in) :: moves  !! Whether its loads move it; else they are in equilibrium.
    integer, intent(in) :: n_modes  !! Number of modes.
    logical, intent(in) :: on_last  !! Whether the last rank computes the whole body.
    type(body_t) :: body, part
    type(body_modes_t) :: modes, of_part
    integer, allocatable :: element_rank(:), number(:), node(:)
    logical, allocatable :: of_surface(:), own(:)
    real(dp), allocatable :: to_part(:, :), gram(:, :), one(:, :), force(:)
    character(:), allocatable :: text, text_of_part
    type(error_t), allocatable :: error
    real(dp) :: worst(6)
    integer :: i, k, n, n_free, n_free_of_part
    logical :: is_good
    call make_loaded(box, supports, moves, body)
    call modes%find(body)
    call free_rigid_modes(body, n_free, text)
    call surface_part(body%mesh, of_surface, node)
    if (on_last) then
      allocate (element_rank(body%mesh%n_elements()), source=n_ranks() - 1)
    else
      call rank_elements(body%mesh, 1, 0_int64, element_work(body%mesh), n_ranks(), element_rank, error)
      if (allocated(error)) error stop 'the elements are not divided'
    end if
    part = body
    call hold_own_part(part, element_rank, this_rank(), number)
    own = part%mesh%whole%own_node
    ! Forces at nodes of others need not be complete.
    do i = 1, size(own)
      if (.not. own(i)) part%load(:, i) = 1000
    end do
    call of_part%find(part)
    call free_rigid_modes(part, n_free_of_part, text_of_part)
    n = modes%n
    is_good = n == n_modes .and. of_part%n == n_modes .and. n_free == n_modes .and. n_free_of_part == n_modes .and. &
              text == text_of_part
    worst = 0
    if (is_good .and. n > 0) then
      allocate (to_part(n, n), gram(n, n), one(n, n))
      one = 0
      do i = 1, n
        one(i, i) = 1
        do k = 1, n
          to_part(i, k) = own_sum(modes%shape(:, part%mesh%whole%node, i)*of_part%shape(:, :, k), own)
          gram(i, k) = own_sum(of_part%shape(:, :, i)*of_part%shape(:, :, k), own)
        end do
      end do
      worst(1) = maxval(abs(gram - one))
      worst(2) = maxval(abs(matmul(transpose(to_part), to_part) - one))
      do i = 1, size(own)
        worst(3) = max(worst(3), maxval(abs(matmul(modes%shape(:, part%mesh%whole%node(i), :), to_part) - &
                                            of_part%shape(:, i, :))))
      end do
      force = matmul(modes%resultant, to_part)
      worst(4) = maxval(abs(force - of_part%resultant))/max(maxval(abs(force)), tiny(1.0_dp))
      worst(5) = difference_of_ranks([of_part%resultant, reshape(of_part%shape(:, number(node), :), &
                                                                 [body%dimension*size(node)*n])])
      is_good = (maxval(abs(of_part%resultant)) > 0 .eqv. moves) .and. &
                modes%span_text(one) == of_part%span_text(one) .and. all(modes%components() == of_part%components())
    end if
    worst(6) = abs(part%mesh%diameter() - body%mesh%diameter()) + &
               abs(shortest_extent(part%mesh) - shortest_extent(body%mesh))
    call greatest(worst)
    call note(name, is_good .and. all(worst <= accuracy) .and. .not. worst(5) > 0, worst)
    if (.not. is_good) write (output_unit, '(a)') text, text_of_part
  end subroutine compare

  !> Bodies in parts are told from whole ones and from surfaces of bodies of other ranks.
  subroutine test_kinds_of_parts()
    type(box_t) :: box
    type(body_t) :: body, part
    type(support_t) :: none(0)
    integer, allocatable :: number(:)
    integer :: i
    logical :: is_good
    call box%init(element_hex8, 2, undistorted)
    call make_loaded(box, none, .true., body)
    is_good = body%mesh%is_own_node(1) .and. body%mesh%is_own_element(8) .and. .not. body%mesh%is_in_parts()
    part = body
    call hold_surface(part, number)
    is_good = is_good .and. .not. (part%mesh%is_own_node(1) .or. part%mesh%is_own_element(1) .or. &
                                   part%mesh%is_in_parts())
    part = body
    call hold_own_part(part, spread(0, 1, 8), this_rank(), number)
    is_good = is_good .and. part%mesh%is_in_parts() .and. &
              all([(part%mesh%is_own_node(i), i=1, 27)] .eqv. this_rank() == 0) .and. &
              all([(part%mesh%is_own_element(i), i=1, 8)] .eqv. this_rank() == 0)
    call note('kinds of parts', is_good, [real(dp) ::])
  end subroutine test_kinds_of_parts

  !> A body with loads.
  subroutine make_loaded(box, supports, moves, body)
    type(box_t), intent(in) :: box  !! As in `compare`.
    type(support_t), intent(in) :: supports(:)  !! As in `compare`.
    logical, intent(in) :: moves  !! As in `compare`.
    type(body_t), intent(out) :: body  !! The body.
    type(load_t) :: load
    type(error_t), allocatable :: error
    real(dp) :: force(box%mesh%dimension)
    integer :: i, j
    call make_body(box, merge(analysis_3d, analysis_plane_strain, box%mesh%dimension == 3), steel(), supports, body, &
                   error)
    if (allocated(error)) error stop 'the body is not made'
    if (moves) then
      load%kind = load_traction
      load%value = [0.3_dp, -0.1_dp, 0.2_dp]
      call add_surface_load(body%mesh, body%analysis, box%side(1, .true.), load, body%load, error)
      load%kind = load_force_density
      if (.not. allocated(error)) call add_volume_load(body%mesh, body%analysis, load, body%load, error)
      if (allocated(error)) error stop 'the loads are not added'
      return
    end if
    ! Pairs of opposite forces along the line between two nodes.
    do i = 1, body%mesh%n_nodes()/2
      j = body%mesh%n_nodes() + 1 - i
      force = (1 + mod(i, 7))*(body%mesh%x(:, j) - body%mesh%x(:, i))
      body%load(:, i) = body%load(:, i) - force
      body%load(:, j) = body%load(:, j) + force
    end do
  end subroutine make_loaded

  !> Exchange the numbers of two nodes.
  subroutine swap_nodes(box, i, j)
    type(box_t), intent(inout) :: box  !! The box.
    integer, intent(in) :: i, j  !! The nodes.
    integer :: e, k
    box%mesh%x(:, [i, j]) = box%mesh%x(:, [j, i])
    box%lattice(:, [i, j]) = box%lattice(:, [j, i])
    do e = 1, box%mesh%n_elements()
      do k = 1, size(box%mesh%block(1)%node, 1)
        associate (node => box%mesh%block(1)%node(k, e))
          if (node == i) then
            node = j
          else if (node == j) then
            node = i
          end if
        end associate
      end do
    end do
  end subroutine swap_nodes

  !> Sum over the nodes of all ranks.
  real(dp) function own_sum(value, own)
    real(dp), intent(in) :: value(:, :)  !! At the held nodes (dim, n_nodes) [any].
    logical, intent(in) :: own(:)  !! Whether this rank computes each (n_nodes).
    real(dp) :: total(1)
    total = sum(sum(value, 1), mask=own)
    call add_up(total)
    own_sum = total(1)
  end function own_sum

  !> Greatest difference of numbers that all ranks should have alike, to the bit.
  real(dp) function difference_of_ranks(value) result(difference)
    real(dp), intent(in) :: value(:)  !! The numbers (n) [any].
    real(dp) :: high(size(value)), low(size(value))
    high = value
    low = -value
    call greatest(high)
    call greatest(low)
    difference = maxval(high + low)
  end function difference_of_ranks

  !> Note a result.
  subroutine note(name, passed, worst)
    character(*), intent(in) :: name  !! Of the test.
    logical, intent(in) :: passed  !! Whether this rank finds it passed.
    real(dp), intent(in) :: worst(:)  !! Differences (n) [].
    logical :: is_good
    is_good = .not. on_any_rank(.not. passed)
    if (.not. is_good) n_failed = n_failed + 1
    if (this_rank() == 0) write (output_unit, '(a,2x,a,*(es8.1))') merge('passed', 'FAILED', is_good), name, worst
  end subroutine note
end program split_modes
