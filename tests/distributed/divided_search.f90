!> The search for contact and the check for penetration that ranks divide, under mpirun: the same to the bit as those of
!> a rank that does all of it, and each rank gets from the others what it has not computed.
program divided_search
  use, intrinsic :: iso_fortran_env, only: output_unit
  use test_bodies, only: box_t, curved
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_mortar, discretization_quadrature, gap_formula, geometry_smooth, &
    quadrature_plain, quadrature_segments
  use dotyk_base_parcel, only: parcel_t
  use dotyk_contact_met_points, only: inside_point_t
  use dotyk_contact_operator, only: build_operator, contact_operator_t
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t, share_pairs
  use dotyk_contact_pair_discretization, only: discretize_pair
  use dotyk_contact_penetration_search, only: find_penetration
  use dotyk_contact_penetration_tolerance, only: penetration_t, penetration_tolerance_t
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_element, only: element_hex8, element_quad4, element_tet10
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_communication, only: end_ranks, n_ranks, start_ranks, this_rank
  use dotyk_ranks_division, only: deal_out, division_t
  use dotyk_ranks_exchange, only: all_ranks, exchange_cost, exchange_cost_t
  implicit none

  real(dp), parameter :: bytes_of_point = 100  !! Numbers of a point that ranks exchange, at least [bytes].
  integer :: n_failed, code
  n_failed = 0
  call start_ranks()
  call test_portions()
  call test_pair('segments, tet10', element_tet10, discretization_mortar, quadrature_segments)
  call test_pair('segments, hex8', element_hex8, discretization_mortar, quadrature_segments)
  call test_pair('whole facets, hex8', element_hex8, discretization_quadrature, quadrature_plain)
  call test_pair('lines, quad4', element_quad4, discretization_mortar, quadrature_segments)
  call test_penetration('tet10', element_tet10)
  call test_penetration('hex8', element_hex8)
  code = min(1, n_failed)
  call end_ranks(code)
  stop code, quiet=.true.

contains

  !> Portions cover all items once and differ little in work; large items are divided, the others dealt out.
  subroutine test_portions()
    type(division_t) :: division
    real(dp) :: cost(100), work(100)
    integer :: first, last, i, r, counted(100), owner(100)
    division%is_divided = .true.
    counted = 0
    do r = 0, n_ranks() - 1
      call division%portion(100, first, last, r)
      counted(first:last) = counted(first:last) + 1
      call check('portions of items', last - first + 1 >= 100/n_ranks() .and. last - first <= 100/n_ranks())
    end do
    call check('items in one portion', all(counted == 1))
    cost = [(merge(1.0_dp, 0.01_dp, i > 50), i=1, 100)]
    call division%portion(cost, first, last)
    work = 0
    work(first:last) = cost(first:last)
    call check('portions by work', abs(sum(work) - sum(cost)/n_ranks()) <= 1)
    call division%fill(work, first, last)
    call check('work of all', all(abs(work - cost) <= 0))
    call division%portion([real(dp) ::], first, last)
    call check('no items', last - first == -1)
    call division%portion([0.0_dp, 0.0_dp], first, last)
    call check('no work', last - first + 1 == merge(2, 0, this_rank() == 0))
    cost(1) = 1000
    owner = deal_out(cost, 10.0_dp)
    call check('a large item', (owner(1) == all_ranks) .eqv. n_ranks() > 1)
    do r = 0, n_ranks() - 1
      call check('small items', abs(sum(pack(cost(2:), owner(2:) == r)) - sum(cost(2:))/n_ranks()) <= 1)
    end do
  end subroutine test_portions

  !> A pair of curved boxes, and its rows, divided and not.
  subroutine test_pair(name, kind, discretization, quadrature)
    character(*), intent(in) :: name  !! Of the test.
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: discretization  !! One of `discretization_*`.
    integer, intent(in) :: quadrature  !! One of `quadrature_*`.
    type(box_t) :: upper, lower
    type(surface_t) :: surface(2)
    type(pair_settings_t) :: settings
    type(formula_t) :: formula
    type(contact_pair_t) :: pair(2)
    type(contact_operator_t) :: operator(2)
    type(error_t), allocatable :: error
    type(exchange_cost_t) :: before, after
    integer :: i, dim
    call make_boxes(kind, 0.0_dp, upper, lower)
    dim = upper%mesh%dimension
    surface = [upper%side(dim, .false.), lower%side(dim, .true.)]
    settings%name = name
    settings%body_a = 1
    settings%body_b = 2
    settings%search_radius = 0.3_dp
    settings%discretization = discretization
    settings%quadrature = quadrature
    settings%geometry = geometry_smooth
    do i = 1, 2
      settings%division%is_divided = i == 2
      before = exchange_cost()
      call discretize_pair(upper%mesh, surface(1), lower%mesh, surface(2), settings, formula, pair(i), error)
      after = exchange_cost()
      call check(name//': discretized', .not. allocated(error))
      if (allocated(error)) return
      if (i == 1) call check(name//': nothing is exchanged', after%n == before%n)
      call build_operator(dim, 2, pair(i:i), surface(1:1), surface(2:2), operator(i), divided=i == 2)
    end do
    ! A rank gets the points of the others, all but its share of them.
    call check(name//': shares', n_ranks() == 1 .or. after%bytes - before%bytes > &
               0.7_dp*bytes_of_point*pair(1)%n_points*(1 - 1.0_dp/n_ranks()))
    call check(name//': points', pair(1)%n_points > 20 .and. pair(1)%n_points == pair(2)%n_points .and. &
               pair(1)%n_unprojected == pair(2)%n_unprojected)
    call compare(name//': position', [pair(1)%position], [pair(2)%position])
    call compare(name//': normal', [pair(1)%normal], [pair(2)%normal])
    call compare(name//': gap', pair(1)%gap, pair(2)%gap)
    call compare(name//': uncertainty', pair(1)%uncertainty, pair(2)%uncertainty)
    call compare(name//': weight', pair(1)%weight, pair(2)%weight)
    call compare(name//': row gap', pair(1)%row_gap, pair(2)%row_gap)
    call compare(name//': row weight', pair(1)%row_weight, pair(2)%row_weight)
    call check(name//': facets', all(pair(1)%facet_a == pair(2)%facet_a) .and. all(pair(1)%facet_b == pair(2)%facet_b))
    do i = 1, 2
      associate (one => operator(1)%block(i)%matrix, other => operator(2)%block(i)%matrix)
        call check(name//': columns', all(one%column == other%column) .and. all(one%row_start == other%row_start))
        call compare(name//': B', one%value, other%value)
      end associate
    end do
    call test_dealt(name, dim, pair(1), surface, operator(1))
  end subroutine test_pair

  !> A pair that another rank has searched.
  subroutine test_dealt(name, dim, pair, surface, operator)
    character(*), intent(in) :: name  !! Of the test.
    integer, intent(in) :: dim  !! Dimension of space.
    type(contact_pair_t), intent(in) :: pair  !! The pair, the same on all ranks.
    type(surface_t), intent(in) :: surface(2)  !! Its surfaces.
    type(contact_operator_t), intent(in) :: operator  !! Its rows.
    type(contact_pair_t) :: dealt(2*n_ranks()), original
    type(contact_operator_t) :: of_dealt
    type(parcel_t), allocatable :: one, other
    integer :: owner(2*n_ranks()), k
    ! Each rank has one pair, and one without points.
    owner = [(k - 1, k=1, n_ranks()), (k - 1, k=1, n_ranks())]
    original = pair
    ! No two counts, fractions or flags alike.
    original%is_layer = .true.
    original%gap_kind = gap_formula
    original%n_unprojected = 101
    original%n_not_facing = 102
    original%n_outside = 103
    original%n_too_far = 104
    original%n_point_contacts = 105
    original%lost_not_facing = 0.1_dp
    original%lost_outside = 0.2_dp
    original%lost_too_far = 0.3_dp
    original%theta = 0.4_dp
    original%row_theta = [(0.5_dp + k, k=1, pair%n_rows)]
    dealt(this_rank() + 1) = original
    call share_pairs(owner, dealt)
    allocate (one)
    call original%carry(one)
    do k = 1, n_ranks()
      allocate (other)
      call dealt(k)%carry(other)
      call check(name//': words of a dealt pair', one%n_words() == other%n_words())
      if (one%n_words() == other%n_words()) call check(name//': dealt', all(one%words() == other%words()))
      deallocate (other)
      call check(name//': layer', dealt(k)%is_layer .and. dealt(k)%gap_kind == gap_formula)
      call check(name//': points without projection', all([dealt(k)%n_unprojected, dealt(k)%n_not_facing, &
                 dealt(k)%n_outside, dealt(k)%n_too_far, dealt(k)%n_point_contacts] == [101, 102, 103, 104, 105]))
      call compare(name//': lost', [dealt(k)%lost_not_facing, dealt(k)%lost_outside, dealt(k)%lost_too_far], &
                   [0.1_dp, 0.2_dp, 0.3_dp])
      call compare(name//': theta', [dealt(k)%theta, dealt(k)%row_theta], [original%theta, original%row_theta])
      call build_operator(dim, 2, dealt(k:k), surface(1:1), surface(2:2), of_dealt)
      call compare(name//': rows of a dealt pair', operator%block(2)%matrix%value, of_dealt%block(2)%matrix%value)
      call compare(name//': gaps of a dealt pair', operator%gap, of_dealt%gap)
      call check(name//': no pair', dealt(n_ranks() + k)%n_points == 0)
    end do
  end subroutine test_dealt

  !> Boxes that overlap, divided and not.
  subroutine test_penetration(name, kind)
    character(*), intent(in) :: name  !! Of the test.
    integer, intent(in) :: kind  !! Element kind.
    type(box_t) :: upper, lower
    type(solid_t) :: solid(2)
    type(penetration_tolerance_t) :: tolerance
    type(penetration_t) :: worst(2)
    type(inside_point_t), allocatable :: inside(:)
    real(dp), allocatable :: depth(:), other(:), clear(:)
    call make_boxes(kind, -0.07_dp, upper, lower)
    call make_solid(upper, solid(1))
    call make_solid(lower, solid(2))
    tolerance%slack = 1.0e-9_dp
    allocate (tolerance%left_a%depth(solid(1)%n_nodes), tolerance%left_b%depth(solid(2)%n_nodes), source=0.0_dp)
    tolerance%left_a%width = tolerance%left_a%depth
    tolerance%left_b%width = tolerance%left_b%depth
    tolerance%left_a%uncertainty = tolerance%left_a%depth
    tolerance%left_b%uncertainty = tolerance%left_b%depth
    allocate (tolerance%left_a%is_averaged(solid(1)%n_nodes), tolerance%left_b%is_averaged(solid(2)%n_nodes), &
              source=.true.)
    call find_penetration(division_t(), solid(1), solid(2), tolerance, depth, worst(1), clear, inside)
    call find_penetration(division_t(.true.), solid(1), solid(2), tolerance, other, worst(2), clear, inside)
    call compare(name//': depth', depth, other)
    call compare(name//': deepest', [worst(1)%depth, worst(1)%position], &
                 [worst(2)%depth, worst(2)%position])
    call check(name//': nodes and edges', worst(1)%n_nodes > 0 .and. worst(1)%n_nodes == worst(2)%n_nodes .and. &
               worst(1)%n_edges == worst(2)%n_edges)
  end subroutine test_penetration

  !> Two boxes with bent sides, one on the other.
  subroutine make_boxes(kind, gap, upper, lower)
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: gap  !! Distance of the boxes [length].
    type(box_t), intent(out) :: upper, lower  !! The boxes.
    real(dp), allocatable :: turn(:, :), shift(:)
    integer :: dim, i
    call upper%init(kind, 5, curved)
    call lower%init(kind, 4, curved)
    dim = upper%mesh%dimension
    allocate (turn(dim, dim), shift(dim), source=0.0_dp)
    do i = 1, dim
      turn(i, i) = 1
    end do
    ! Inclined, so that neither gaps nor depths are alike.
    turn(dim, 1) = 0.03_dp
    shift(dim) = 1 + gap
    call upper%transform(turn, shift)
  end subroutine make_boxes

  !> Boundary of a box.
  subroutine make_solid(box, solid)
    type(box_t), intent(in) :: box  !! The box.
    type(solid_t), intent(out) :: solid  !! Its boundary.
    type(surface_t) :: boundary
    real(dp), allocatable :: u(:, :)
    integer :: f
    call extract_boundary(box%mesh, boundary)
    allocate (u, mold=box%mesh%x)
    u = 0
    call solid%init(1, box%mesh%x, u, boundary, [(f, f=1, boundary%n_facets)])
  end subroutine make_solid

  !> Two arrays must be the same to the bit.
  subroutine compare(name, one, other)
    character(*), intent(in) :: name  !! What they are.
    real(dp), intent(in) :: one(:), other(:)  !! The arrays.
    logical :: same
    same = size(one) == size(other)
    if (same) same = all(abs(one - other) <= 0)
    call check(name, same)
  end subroutine compare

  !> Something must hold.
  subroutine check(name, holds)
    character(*), intent(in) :: name  !! What it is.
    logical, intent(in) :: holds  !! Whether it does.
    if (holds) return
    write (output_unit, '(a, i0, 2a)') 'rank ', this_rank(), ', failed: ', name
    n_failed = n_failed + 1
  end subroutine check
end program divided_search
