!> The check for penetration of two bodies: all parts of the one against all parts of the other.
!>
!> Bodies can lie almost exactly in each other, such as a copy shifted by metres where millimetres are meant. Their
!> boundaries are near each other everywhere, so that no node is deep; the middles of elements are.
module dotyk_control_couple_penetration
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_thresholds, only: given_rounding, notable, of_mesh, same_place
  use dotyk_contact_facet_set, only: facet_position_and_normal
  use dotyk_contact_met_points, only: add_met_points, inside_point_t, is_same, met_point_t
  use dotyk_contact_passage_search, only: swept_facets_t
  use dotyk_contact_penetration_search, only: find_passages, find_penetration
  use dotyk_contact_penetration_tolerance, only: left_by_pairs_t, penetration_t, penetration_tolerance_t
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_explained_penetration, only: find_left, pairs_of_bodies_t
  use dotyk_control_pressures, only: nodal_field_t
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_element, only: kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_held_part, only: sample_step
  use dotyk_mesh_placement, only: mean_rotation
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: check_bodies, split_parts

  type :: touch_t  !! Touching of two parts.
    integer :: n_facets = 0  !! Facets of the two whose centres lie on faces of the other which face them.
    real(dp) :: position(3) = 0  !! Centre of the deepest of them after deformation (3) [length].
    real(dp) :: depth = 0  !! Its depth in the other part, 0 where none is below its facets [length].
  end type touch_t

  !> Faces face each other where the cosine of the angle of their normals is below this: 150 degrees.
  real(dp), parameter :: facing_cosine = -0.866_dp

  type, public :: body_penetration_t  !! One body inside another.
    integer :: body = 0  !! The body whose points are inside.
    integer :: other = 0  !! The body that they are in; the same for two parts of one body.
    type(penetration_t) :: worst  !! The deepest point.
    type(touch_t) :: touch  !! Faces that touch though no contact pair has the two.
  contains
    procedure :: carry => body_penetration_carry
  end type body_penetration_t

  type, public :: parts_t  !! Parts of one body.
    type(solid_t), allocatable :: part(:)  !! The parts (n_parts).
    type(swept_facets_t), allocatable :: swept(:)  !! Their facets in motion (n_parts).
  end type parts_t

  !> Displacement relative to the size of a body from which on small displacements no longer describe it [].
  real(dp), parameter, public :: large_displacement = 0.5_dp

  !> Thickness of parts relative to their smallest facet: less is not looked for.
  real(dp), parameter :: least_thickness = 0.01_dp
  !> Depths between contact rows are told from this part of what the two bodies move on.
  real(dp), parameter :: told_part = 0.25_dp
  !> Only bodies whose boxes before deformation differ by less than this fraction of their diagonal are looked at [].
  real(dp), parameter :: same_box = 0.25_dp

contains

  !> Put it into a parcel, or take it out.
  subroutine body_penetration_carry(self, parcel)
    class(body_penetration_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%body)
    call parcel%carry(self%other)
    call self%worst%carry(parcel)
    call parcel%carry(self%touch%n_facets)
    call parcel%carry_fixed(size(self%touch%position), self%touch%position)
    call parcel%carry(self%touch%depth)
  end subroutine body_penetration_carry

  !> Boundaries of the parts of a body.
  subroutine split_parts(b, problem, pairs, displacement, parts)
    integer, intent(in) :: b  !! Index of the body.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(pairs_of_bodies_t), intent(in) :: pairs  !! The pairs of each body.
    real(dp), intent(in) :: displacement(:, :)  !! Displacements of its nodes (dimension, n_nodes) [length].
    type(parts_t), intent(out) :: parts  !! Its parts.
    type(surface_t) :: boundary
    integer, allocatable :: component(:), of_facet(:), list(:)
    integer :: n, k, f
    associate (mesh => problem%body(b)%mesh)
      call extract_boundary(mesh, boundary)
      allocate (component(mesh%n_nodes()))
      call connected_components(mesh, component, n)
      allocate (boundary%entity(boundary%n_facets), source=0)
      list = pairs%of(b)
      do k = 1, size(list)
        if (problem%pair(list(k))%body_a == b) call take_entities(problem%surface_a(list(k)), mesh%n_nodes(), boundary)
        if (problem%pair(list(k))%body_b == b) call take_entities(problem%surface_b(list(k)), mesh%n_nodes(), boundary)
      end do
      allocate (parts%part(n), parts%swept(n))
      of_facet = component(boundary%node(1, :))
      do k = 1, n
        call parts%part(k)%init(b, mesh%x, displacement, boundary, pack([(f, f=1, boundary%n_facets)], of_facet == k))
        call parts%swept(k)%init(parts%part(k))
      end do
    end associate
  end subroutine split_parts

  !> Give facets of a boundary the geometric entities that a contact surface knows: what is smooth to the contact is so
  !> to its check.
  pure subroutine take_entities(surface, n_nodes, boundary)
    type(surface_t), intent(in) :: surface  !! The contact surface.
    integer, intent(in) :: n_nodes  !! Number of nodes of the body.
    type(surface_t), intent(inout) :: boundary  !! The boundary; entities are set.
    integer :: lowest(n_nodes), next(boundary%n_facets), f, g, k
    if (.not. allocated(surface%entity)) return
    ! Facets of the boundary by their lowest node.
    lowest = 0
    do f = 1, boundary%n_facets
      k = minval(boundary%node(:kind_nodes(boundary%kind(f)), f))
      next(f) = lowest(k)
      lowest(k) = f
    end do
    do g = 1, surface%n_facets
      associate (node => surface%node(:kind_nodes(surface%kind(g)), g))
        f = lowest(minval(node))
        do while (f > 0)
          if (all([(any(boundary%node(:, f) == node(k)), k=1, size(node))])) boundary%entity(f) = surface%entity(g)
          f = next(f)
        end do
      end associate
    end do
  end subroutine take_entities

  !> Check the parts of two bodies, or of one.
  subroutine check_bodies(division, problem, pairs, first_row, penetration, uncertainty, parts_a, parts_b, a, b, u, &
                          error_bound, depth, found, met)
    type(division_t), intent(in) :: division  !! How ranks divide the nodes.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(pairs_of_bodies_t), intent(in) :: pairs  !! The pairs of each body.
    integer, intent(in) :: first_row(:)  !! First row of each pair (n_pairs+1).
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    real(dp), intent(in) :: uncertainty(:)  !! Of the normal displacements of each pair (n_pairs) [length].
    type(parts_t), intent(in) :: parts_a  !! Parts of the first body.
    type(parts_t), intent(in) :: parts_b  !! Parts of the second body.
    integer, intent(in) :: a  !! Index of the first body.
    integer, intent(in) :: b  !! Index of the second body.
    real(dp), intent(in) :: u(:, :)  !! Displacements of the nodes of the first body (dimension, n_nodes) [length].
    real(dp), intent(in) :: error_bound  !! Relative error of the iteration [].
    !> Depth at the nodes of the bodies: grows at those of the two (n_bodies) [length].
    type(nodal_field_t), intent(inout) :: depth(:)
    !> The deeper one of the two in the other; of depth 0 where neither is.
    type(body_penetration_t), intent(out) :: found
    !> Points of the one in the other at which contact rows keep them apart; none where rows do not (n).
    type(met_point_t), allocatable, intent(out) :: met(:)
    type(body_penetration_t) :: a_in_b, b_in_a
    type(penetration_tolerance_t) :: tolerance
    type(left_by_pairs_t) :: left_a, left_b
    type(met_point_t), allocatable :: met_b(:), of_other(:)
    type(penetration_t) :: shared
    real(dp) :: rounding
    logical :: only_corners
    integer, allocatable :: list(:)
    integer :: i, j
    allocate (met(0), met_b(0))
    if (a == b .and. size(parts_a%part) == 1) return
    call find_left(problem, pairs, first_row, penetration, a, b, left_a)
    call find_left(problem, pairs, first_row, penetration, b, a, left_b)
    ! Uncertain displacements are those of two bodies against each other: they count once, not on both sides.
    list = pairs%linking(problem%pair, a, b)
    left_a%depth = left_a%depth + maxval([0.0_dp, pack(uncertainty(list), .not. ieee_is_nan(uncertainty(list)))])
    list = pairs%between(problem%pair, a, b)
    only_corners = size(list) == 0
    a_in_b = body_penetration_t(a, b)
    b_in_a = body_penetration_t(b, a)
    call measure_motion(parts_a, parts_b, tolerance%moved, rounding)
    tolerance%slack = (of_mesh + min(notable, max(0.0_dp, error_bound)))*tolerance%moved + rounding
    do i = 1, size(parts_a%part)
      do j = merge(i + 1, 1, a == b), size(parts_b%part)
        associate (p => parts_a%part(i), q => parts_b%part(j))
          tolerance%left_a = left_a%at(p%node)
          tolerance%left_b = left_b%at(q%node)
          if (.not. problem%body(b)%mesh%is_open) &
            call check_parts(division, p, q, parts_b%swept(j), tolerance, only_corners, depth(a)%value, &
                             a_in_b%worst, met)
          if (.not. problem%body(a)%mesh%is_open) &
            call check_parts(division, q, p, parts_a%swept(i), tolerance%swapped(), only_corners, depth(b)%value, &
                             b_in_a%worst, met_b)
        end associate
      end do
    end do
    found = a_in_b
    if (b_in_a%worst%outweighs(a_in_b%worst) .or. (.not. a_in_b%worst%depth > 0 .and. &
        b_in_a%worst%between_rows > a_in_b%worst%between_rows)) then
      found = b_in_a
      call move_alloc(met, of_other)
      call move_alloc(met_b, met)
      call move_alloc(of_other, met_b)
    end if
    if (found%worst%between_rows < told_part*tolerance%moved) found%worst%between_rows = 0
    if (found%worst%depth > 0) then
      ! Rows between places that are far from each other before deformation would hold what slides off.
      if (a == b .or. any(met%facet_b == 0) .or. &
          tolerance%moved > large_displacement*min(size_of(parts_a), size_of(parts_b))) met = met(:0)
      if (.not. all(is_meant(problem, list, met))) met = met(:0)
      if (size(met) > 0) call add_other_side(pack(met_b, is_meant(problem, list, met_b) .and. met_b%facet_b > 0), &
                                             2*tolerance%moved, met)
    end if
    if (problem%body(a)%mesh%is_open .or. problem%body(b)%mesh%is_open) return
    if (a /= b .and. size(parts_a%part) == 1 .and. size(parts_b%part) == 1) then
      call find_shared_interior(problem%body(a)%mesh, u, parts_a%part(1), parts_b%part(1), shared%depth, &
                                shared%position)
      if (shared%depth > found%worst%depth) then
        found = body_penetration_t(a, b, shared)
        met = met(:0)
      end if
    end if
    if (found%worst%depth > 0 .or. .not. only_corners) return
    do i = 1, size(parts_a%part)
      do j = merge(i + 1, 1, a == b), size(parts_b%part)
        call find_touch(parts_a%part(i), parts_b%part(j), tolerance%slack, found%touch)
        call find_touch(parts_b%part(j), parts_a%part(i), tolerance%slack, found%touch)
      end do
    end do
  end subroutine check_bodies

  !> Add the points of the other body, where rows of the first one are not: else they would be in it next time.
  pure subroutine add_other_side(other, most, met)
    type(met_point_t), intent(in) :: other(:)  !! Points of the other body (n).
    real(dp), intent(in) :: most  !! What the two move against each other: nearer points are one contact [length].
    type(met_point_t), allocatable, intent(inout) :: met(:)  !! Points of the first body; others are added (n).
    integer :: i, k, n
    n = size(met)
    do i = 1, size(other)
      if (any([(norm2(other(i)%x - met(k)%x) <= most .or. is_same(other(i), met(k)), k=1, n)])) cycle
      met = [met, other(i)]
    end do
  end subroutine add_other_side

  !> Whether points may be kept out: interference is meant between the surfaces of a contact pair only.
  function is_meant(problem, list, met) result(meant)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    integer, intent(in) :: list(:)  !! Contact pairs of the two bodies (n_pairs).
    type(met_point_t), intent(in) :: met(:)  !! The points (n).
    logical :: meant(size(met))
    type(surface_t) :: boundary(2)
    integer, allocatable :: node_a(:), node_b(:)
    integer :: i, k, first
    meant = .not. (met%is_behind .and. met%facet_b > 0)
    if (all(meant)) return
    call extract_boundary(problem%body(met(1)%body_a)%mesh, boundary(1))
    call extract_boundary(problem%body(met(1)%body_b)%mesh, boundary(2))
    do i = 1, size(met)
      if (meant(i)) cycle
      first = merge(1, 2, met(i)%body_a == met(1)%body_a)
      associate (p => met(i), of_b => boundary(3 - first))
        node_a = nodes_at(boundary(first), p%facet_a, p%xi_a)
        node_b = of_b%node(:kind_nodes(of_b%kind(p%facet_b)), p%facet_b)
        if (p%edge_b > 0) node_b = nodes_at(of_b, p%facet_b, p%xi_b)
        do k = 1, size(list)
          associate (pair => problem%pair(list(k)), slave => problem%surface_a(list(k)), &
                     master => problem%surface_b(list(k)))
            if (pair%body_a == p%body_a) meant(i) = meant(i) .or. (has(slave, node_a) .and. has(master, node_b))
            if (pair%body_a == p%body_b) meant(i) = meant(i) .or. (has(slave, node_b) .and. has(master, node_a))
          end associate
        end do
      end associate
    end do

  contains

    !> The node at a point of a facet, or the nodes that it lies between.
    pure function nodes_at(surface, facet, xi) result(node)
      type(surface_t), intent(in) :: surface  !! The facets.
      integer, intent(in) :: facet  !! The facet.
      real(dp), intent(in) :: xi(2)  !! Reference coordinates of the point (2) [].
      integer, allocatable :: node(:)
      real(dp) :: shape(max_facet_nodes)
      integer :: n
      n = kind_nodes(surface%kind(facet))
      call shape_functions(surface%kind(facet), xi(:surface%dimension - 1), shape(:n))
      node = pack(surface%node(:n, facet), abs(shape(:n)) > sqrt(epsilon(shape)))
    end function nodes_at

    !> Whether a surface has some nodes.
    pure logical function has(surface, nodes)
      type(surface_t), intent(in) :: surface  !! The surface.
      integer, intent(in) :: nodes(:)  !! The nodes (n).
      integer :: j
      has = all([(any(surface%node(:, :surface%n_facets) == nodes(j)), j=1, size(nodes))])
    end function has
  end function is_meant

  !> How far two bodies move beside the rigid motion that is common to them: that of least squares of both boundaries.
  !> A common motion is no error of the one against the other.
  subroutine measure_motion(parts_a, parts_b, moved, rounding)
    type(parts_t), intent(in) :: parts_a  !! Parts of the first body.
    type(parts_t), intent(in) :: parts_b  !! Parts of the second body.
    real(dp), intent(out) :: moved  !! Largest displacement beside the common motion [length].
    real(dp), intent(out) :: rounding  !! Rounding of the coordinates before and after deformation [length].
    real(dp), allocatable :: x(:, :), u(:, :)
    real(dp) :: rotation(3)
    integer :: i
    allocate (x(3, 0), u(3, 0))
    call append(parts_a%part)
    call append(parts_b%part)
    moved = 0
    rounding = 0
    if (size(x, 2) == 0) return
    rounding = given_rounding*max(maxval(abs(x)), maxval(abs(x + u)))
    x = x - spread(sum(x, dim=2)/size(x, 2), 2, size(x, 2))
    u = u - spread(sum(u, dim=2)/size(u, 2), 2, size(u, 2))
    rotation = mean_rotation(x, u)
    do i = 1, size(x, 2)
      moved = max(moved, norm2(u(:, i) - cross(rotation, x(:, i))))
    end do

  contains

    !> Append the nodes of parts, and their displacements.
    subroutine append(part)
      type(solid_t), intent(in) :: part(:)  !! The parts (any number).
      integer :: k
      do k = 1, size(part)
        x = reshape([x, part(k)%x0], [3, size(x, 2) + part(k)%n_nodes])
        u = reshape([u, part(k)%x - part(k)%x0], [3, size(x, 2)])
      end do
    end subroutine append
  end subroutine measure_motion

  !> Greatest diagonal of the parts of a body before deformation [length].
  pure real(dp) function size_of(parts)
    type(parts_t), intent(in) :: parts  !! The parts.
    integer :: i
    size_of = maxval([(norm2(maxval(parts%part(i)%x0, 2) - minval(parts%part(i)%x0, 2)), i=1, size(parts%part))])
  end function size_of

  !> Check one part against another one.
  subroutine check_parts(division, p, q, swept, tolerance, only_corners, depth, worst, met)
    type(division_t), intent(in) :: division  !! How ranks divide the nodes.
    type(solid_t), intent(in) :: p  !! The part.
    type(solid_t), intent(in) :: q  !! The other part.
    type(swept_facets_t), intent(in) :: swept  !! Facets of the other part in motion.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    logical, intent(in) :: only_corners  !! Whether the two bodies have no contact pair.
    real(dp), intent(inout) :: depth(:)  !! Depth at the nodes of the body (n_nodes) [length].
    !> The deepest point of the body so far; numbers of nodes and edges are added.
    type(penetration_t), intent(inout) :: worst
    type(met_point_t), allocatable, intent(inout) :: met(:)  !! Points that are too deep are added (n).
    type(penetration_t) :: here
    type(inside_point_t), allocatable :: inside(:)
    real(dp), allocatable :: own(:), clear(:)
    associate (box_p => p%tree%volume(1), box_q => q%tree%volume(1))
      if (any(box_p%lo > box_q%hi .or. box_p%hi < box_q%lo)) then
        allocate (own(p%n_nodes), clear(p%n_nodes), source=0.0_dp)
        allocate (inside(0))
      else
        call find_penetration(division, p, q, tolerance, own, here, clear, inside)
      end if
    end associate
    ! Facets are no guide to the thickness of a part, but none is thinner than a small fraction of them.
    if (maxval(norm2(p%x - p%x0 - spread(swept%shift, 2, p%n_nodes), 1)) + swept%farthest > &
        least_thickness*minval(q%set%size)) &
      call find_passages(division, p, q, swept, tolerance, clear, own, here, inside)
    call add_met_points(p, q, inside, tolerance, only_corners, met)
    if (here%depth > 0) then
      !$omp critical (penetration_of_body)
      depth(p%node) = max(depth(p%node), own)
      !$omp end critical (penetration_of_body)
    end if
    call worst%add(here)
  end subroutine check_parts

  !> Facets of a part whose centres lie on faces of another one.
  pure subroutine find_touch(a, b, slack, touch)
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    real(dp), intent(in) :: slack  !! Error of the displacements and of rounding [length].
    type(touch_t), intent(inout) :: touch  !! Facets are added.
    real(dp) :: depth, xi(2), x(3), normal(3), xu(3), xv(3)
    integer :: f, facet, hint
    hint = 0
    do f = 1, a%set%n
      if (any(a%set%hi(:, f) < b%tree%volume(1)%lo - slack .or. a%set%lo(:, f) > b%tree%volume(1)%hi + slack)) cycle
      xi = merge(1/3.0_dp, 0.0_dp, a%set%corners(f) == 3)
      call facet_position_and_normal(a%set, f, xi, x, normal, xu, xv)
      call b%depth_of(x, hint, depth, facet, xi)
      hint = facet
      if (abs(depth) > same_place*b%set%size(facet) + slack + b%roughness(facet) + a%roughness(f)) cycle
      if (dot_product(normal, b%normal(:, facet)) > facing_cosine) cycle
      if (touch%n_facets == 0 .or. depth > touch%depth) touch%position = x
      touch%n_facets = touch%n_facets + 1
      if (depth > slack) touch%depth = max(touch%depth, depth)
    end do
  end subroutine find_touch

  !> Find the deepest middle of an element of a body inside another body, if half of those looked at are inside.
  pure subroutine find_shared_interior(mesh, u, own, other, depth, position)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    real(dp), intent(in) :: u(:, :)  !! Displacements of its nodes (dimension, n_nodes) [length].
    type(solid_t), intent(in) :: own  !! Its boundary.
    type(solid_t), intent(in) :: other  !! Boundary of the other body.
    real(dp), intent(out) :: depth  !! Depth; 0 where less than half of the body is inside [length].
    real(dp), intent(out) :: position(3)  !! Position after deformation (3) [length].
    real(dp) :: x(3), xi(2), here, size_of
    integer :: b, e, facet, n, n_inside, first, step
    depth = 0
    position = 0
    size_of = norm2(maxval(own%x0, 2) - minval(own%x0, 2))
    if (any(abs(maxval(own%x0, 2) - maxval(other%x0, 2)) > same_box*size_of) .or. &
        any(abs(minval(own%x0, 2) - minval(other%x0, 2)) > same_box*size_of)) return
    n = 0
    n_inside = 0
    x = 0
    first = 0
    do b = 1, size(mesh%block)
      associate (node => mesh%block(b)%node, d => size(u, 1))
        step = sample_step(size(node, 2))
        if (allocated(mesh%whole)) step = 1
        do e = 1, size(node, 2), step
          if (allocated(mesh%whole)) then
            if (mod(mesh%whole%element(first + e) - 1, sample_step(mesh%whole%n_of_block(b))) > 0) cycle
          end if
          x(1:d) = sum(mesh%x(:, node(:, e)) + u(:, node(:, e)), 2)/size(node, 1)
          call other%depth_of(x, 0, here, facet, xi)
          n = n + 1
          if (.not. here > 0) cycle
          n_inside = n_inside + 1
          if (here <= depth) cycle
          depth = here
          position = x
        end do
        first = first + size(node, 2)
      end associate
    end do
    if (2*n_inside < n) depth = 0
  end subroutine find_shared_interior
end module dotyk_control_couple_penetration
