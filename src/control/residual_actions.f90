!> What acts on bodies, for the residuals of their elements: loads, stresses of temperatures and initial ones, and the
!> directions along which supports or contact hold a face.
module dotyk_control_residual_actions
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_element_residual, only: residual_data_t
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_face_table, only: face_table_t, local_face, point_of_element
  use dotyk_elasticity_foundation, only: foundation_points_t
  use dotyk_elasticity_initial_stress, only: initial_stress_of_nodes
  use dotyk_elasticity_point_forces, only: point_forces_t
  use dotyk_elasticity_recovery_patch, only: diagonalize
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> Mean squared cosine between a direction and those that the nodes of a face hold, above which the face is held:
  !> normals of one curved face differ.
  real(dp), parameter :: is_held = 0.9_dp

  public :: collect_actions, join_actions

contains

  !> Collect the actions on congruent bodies, in the axes of their representative; none on those of other ranks.
  subroutine collect_actions(problem, alike, first_row, m, solution, data)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and pairs.
    integer, intent(in) :: alike(:)  !! Indices of congruent bodies; their representative is that of the class (n).
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: m(:)  !! Pressures (n_rows) [pressure].
    type(body_solution_t), intent(in) :: solution(:)  !! With displacements (n_bodies).
    type(residual_data_t), intent(out) :: data  !! Loads, forces of springs, and held directions.
    integer, allocatable :: first(:), order(:)
    integer :: b, d, i, k, n
    real(dp) :: back(3, 3)
    associate (leader => problem%body(problem%classes%first(alike(1))))
      d = leader%dimension
      n = leader%mesh%n_elements()
      call data%faces%init(leader%mesh)
      allocate (data%density(d, size(alike), size(leader%material)), source=0.0_dp)
      allocate (data%applied(size(alike)), data%first(n + 1, size(alike)))
      allocate (data%held(d, d, data%faces%n_boundary, size(alike)))
      call hold_supports(d, leader%mesh, leader%constraint, data%faces, data%held(:, :, :, 1))
    end associate
    do i = 1, size(alike)
      b = alike(i)
      back = transpose(problem%classes%motion(b)%rotation)
      data%held(:, :, :, i) = data%held(:, :, :, 1)
      if (allocated(problem%body(b)%density)) &
        data%density(:, i, :) = matmul(back(:d, :d), problem%body(b)%density(:d, :))
      if (problem%ranks%is_own(b)) then
        data%applied(i) = problem%body(b)%applied
        call add_springs(problem%body(b), solution(b)%displacement, data%applied(i))
      end if
    end do
    allocate (data%order(maxval(data%applied%n), size(alike)), source=0)
    do i = 1, size(alike)
      back = transpose(problem%classes%motion(alike(i))%rotation)
      associate (applied => data%applied(i))
        do k = 1, applied%n
          applied%force(:, k) = matmul(back(:d, :d), applied%force(:, k))
        end do
        call applied%by_element(n, first, order)
        data%first(:, i) = first
        data%order(:applied%n, i) = order
      end associate
    end do
    call collect_initial_stresses(problem, alike, data)
    do i = size(alike), 1, -1
      if (.not. problem%ranks%is_own(alike(i))) cycle
      back = transpose(problem%classes%motion(alike(i))%rotation)
      do k = 1, size(problem%pair)
        associate (pair => problem%pair(k), pressure => significant(m(first_row(k):first_row(k + 1) - 1), &
                                                                    largest_stress(solution(alike(i)), m)))
          if (pair%body_a == alike(i)) &
            call hold_contact(problem%body(alike(i)), pair, problem%surface_a(k), pair%facet_a, pressure, &
                              back(:d, :d), data%faces, data%held(:, :, :, i))
          if (pair%body_b == alike(i)) &
            call hold_contact(problem%body(alike(i)), pair, problem%surface_b(k), pair%facet_b, pressure, &
                              back(:d, :d), data%faces, data%held(:, :, :, i))
        end associate
      end do
      do k = 1, problem%n_ties()
        associate (tie => problem%tie(k), pair => problem%tie(k)%component(1))
          if (pair%body_a == alike(i)) &
            call hold_tie(problem%body(alike(i)), tie%surface_a, pair%facet_a, data%faces, data%held(:, :, :, i))
          if (pair%body_b == alike(i)) &
            call hold_tie(problem%body(alike(i)), tie%surface_b, pair%facet_b, data%faces, data%held(:, :, :, i))
        end associate
      end do
    end do
  end subroutine collect_actions

  !> The actions on bodies of one mesh, in one list.
  subroutine join_actions(part, data)
    type(residual_data_t), intent(in) :: part(:)  !! Parts of the list, with the same faces.
    type(residual_data_t), intent(out) :: data  !! All bodies, part after part.
    integer :: first, i, last, n
    n = sum([(size(part(i)%applied), i=1, size(part))])
    associate (some => part(1))
      data%faces = some%faces
      allocate (data%density(size(some%density, 1), n, size(some%density, 3)), data%applied(n))
      allocate (data%first(size(some%first, 1), n))
      allocate (data%held(size(some%held, 1), size(some%held, 2), size(some%held, 3), n))
      allocate (data%order(maxval([(size(part(i)%order, 1), i=1, size(part))]), n), source=0)
    end associate
    do i = 1, size(part)
      if (allocated(data%thermal) .or. .not. allocated(part(i)%thermal)) cycle
      associate (thermal => part(i)%thermal)
        allocate (data%thermal(n, size(thermal, 2), size(thermal, 3), size(thermal, 4)), source=0.0_dp)
        allocate (data%initial(n, size(thermal, 2), size(thermal, 3)), source=0.0_dp)
        allocate (data%temperature(n, size(thermal, 3)), source=0.0_dp)
      end associate
    end do
    last = 0
    do i = 1, size(part)
      first = last + 1
      last = last + size(part(i)%applied)
      data%density(:, first:last, :) = part(i)%density
      data%applied(first:last) = part(i)%applied
      data%first(:, first:last) = part(i)%first
      data%order(:size(part(i)%order, 1), first:last) = part(i)%order
      data%held(:, :, :, first:last) = part(i)%held
      if (.not. allocated(part(i)%thermal)) cycle
      data%thermal(first:last, :, :, :) = part(i)%thermal
      data%initial(first:last, :, :) = part(i)%initial
      data%temperature(first:last, :) = part(i)%temperature
    end do
  end subroutine join_actions

  !> Pressures beside which others of the body are no rounding.
  pure function significant(pressure, largest) result(p)
    real(dp), intent(in) :: pressure(:)  !! Pressures of a pair (n_rows) [pressure].
    real(dp), intent(in) :: largest  !! Greatest pressure or stress [pressure].
    real(dp) :: p(size(pressure))
    p = merge(pressure, 0.0_dp, pressure > rounding*largest)
  end function significant

  !> Greatest contact pressure, or stress of a body where it is known [pressure].
  pure real(dp) function largest_stress(solution, pressure) result(largest)
    type(body_solution_t), intent(in) :: solution  !! The body.
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    largest = maxval([0.0_dp, abs(pressure)])
    if (allocated(solution%stress)) largest = max(largest, maxval(abs(solution%stress)))
  end function largest_stress

  !> Stresses of congruent bodies at rest, in the axes of their representative; nothing where none of them has any.
  subroutine collect_initial_stresses(problem, alike, data)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and pairs.
    integer, intent(in) :: alike(:)  !! Indices of congruent bodies (n).
    type(residual_data_t), intent(inout) :: data  !! Gets the stresses.
    type(energy_form_t) :: form
    integer :: i
    if (.not. any([(problem%body(alike(i))%initial%is_set(), i=1, size(alike))])) return
    associate (leader => problem%body(problem%classes%first(alike(1))))
      call form%init(leader%analysis, leader%material(1)%stiffness)
      allocate (data%thermal(size(alike), form%n_strains, leader%mesh%n_nodes(), size(leader%material)), source=0.0_dp)
      allocate (data%initial(size(alike), form%n_strains, leader%mesh%n_nodes()), source=0.0_dp)
      allocate (data%temperature(size(alike), leader%mesh%n_nodes()), source=0.0_dp)
    end associate
    do i = 1, size(alike)
      if (.not. problem%ranks%is_own(alike(i))) cycle
      associate (body => problem%body(alike(i)))
        if (allocated(body%initial%temperature)) data%temperature(i, :) = body%initial%temperature
        call initial_stress_of_nodes(body%analysis, body%material, body%initial, &
                                     transpose(problem%classes%motion(alike(i))%rotation), form%component, &
                                     data%thermal(i, :, :, :), data%initial(i, :, :))
      end associate
    end do
  end subroutine collect_initial_stresses

  !> Add the tractions of springs at the displacements of their body.
  subroutine add_springs(body, u, applied)
    type(body_t), intent(in) :: body  !! The body.
    real(dp), intent(in) :: u(:, :)  !! Its displacements (dim, n_nodes) [length].
    type(point_forces_t), intent(inout) :: applied  !! Forces at points, added to.
    type(foundation_points_t) :: points
    type(element_kind_t) :: kind
    integer :: element, f, face, i, q
    do f = 1, body%constraint%foundation%n
      associate (springs => body%constraint%foundation, mesh => body%mesh)
        ! Not held by this rank.
        if (springs%element(f) == 0) cycle
        call springs%points_of(mesh%x, body%analysis, f, points)
        kind = element_kind(points%kind)
        associate (block => mesh%block(springs%block(f)), node => springs%node(:points%n_nodes, f))
          face = local_face(mesh, springs%block(f), springs%element(f), springs%node(:, f))
          element = springs%element(f) + sum([(size(mesh%block(i)%node, 2), i=1, springs%block(f) - 1)])
          do q = 1, size(points%weight)
            call applied%add(element, face, point_of_element(block%kind, block%node(:, springs%element(f)), &
                                                             kind%corner_kind, node(:kind%n_corners), &
                                                             points%xi(:, q)), &
                             points%area(q)*(points%pull(:, q) - matmul(points%tensor(:, :, q), &
                                                                        matmul(u(:, node), points%shape(:, q)))))
          end do
        end associate
      end associate
    end do
  end subroutine add_springs

  !> Directions that all nodes of a face hold.
  subroutine hold_supports(dim, mesh, constraint, faces, projection)
    integer, intent(in) :: dim  !! Number of displacement components.
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(constraint_t), intent(in) :: constraint  !! Its held unknowns.
    type(face_table_t), intent(in) :: faces  !! Faces of its elements.
    real(dp), intent(out) :: projection(:, :, :)  !! Projections on the held directions (dim, dim, n_boundary) [].
    type(element_kind_t) :: kind, of_face
    real(dp) :: mean(dim, dim), vectors(dim, dim)
    integer :: b, e, f, i, k
    projection = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      do e = 1, size(mesh%block(b)%node, 2)
        do f = 1, kind%n_faces
          associate (face => faces%boundary(f, faces%before(b) + e))
            if (face == 0) cycle
            of_face = element_kind(kind%face_kind(f))
            mean = 0
            do i = 1, of_face%n_nodes
              call add_node(mesh%block(b)%node(kind%face_node(i, f), e), mean)
            end do
            if (.not. any(abs(mean) > 0)) cycle
            mean = mean/of_face%n_nodes
            call diagonalize(dim, mean, vectors)
            do k = 1, dim
              if (mean(k, k) > is_held) projection(:, :, face) = projection(:, :, face) + &
                spread(vectors(:, k), 2, dim)*spread(vectors(:, k), 1, dim)
            end do
          end associate
        end do
      end do
    end do

  contains

    !> Add the projection on the held directions of a node.
    subroutine add_node(node, total)
      integer, intent(in) :: node  !! The node.
      real(dp), intent(inout) :: total(dim, dim)  !! Projections, added to (dim, dim) [].
      real(dp) :: axis(dim)
      integer :: c
      do c = 1, dim
        if (constraint%equation(c, node) /= held) cycle
        axis = 0
        axis(c) = 1
        if (constraint%frame_of(node) > 0) axis = constraint%frame(:, c, constraint%frame_of(node))
        total = total + spread(axis, 2, dim)*spread(axis, 1, dim)
      end do
    end subroutine add_node
  end subroutine hold_supports

  !> Hold all directions of tied facets.
  subroutine hold_tie(body, surface, facet, faces, projection)
    type(body_t), intent(in) :: body  !! The body.
    type(surface_t), intent(in) :: surface  !! Its tied surface.
    integer, intent(in) :: facet(:)  !! Its facet at each integration point (n_points).
    type(face_table_t), intent(in) :: faces  !! Faces of the elements of the representative.
    !> Projections on the held directions; set (dim, dim, n_boundary) [].
    real(dp), intent(inout) :: projection(:, :, :)
    logical :: is_tied(surface%n_facets)
    integer :: c, f, q
    is_tied = .false.
    is_tied(facet) = .true.
    do q = 1, surface%n_facets
      ! Not held by this rank.
      if (.not. is_tied(q) .or. surface%element(q) == 0) cycle
      f = local_face(body%mesh, surface%block(q), surface%element(q), surface%node(:, q))
      if (f == 0) cycle
      associate (face => faces%boundary(f, faces%before(surface%block(q)) + surface%element(q)))
        if (face == 0) cycle
        projection(:, :, face) = 0
        do c = 1, size(projection, 1)
          projection(c, c, face) = 1
        end do
      end associate
    end do
  end subroutine hold_tie

  !> Hold the normals of the facets under contact pressure.
  subroutine hold_contact(body, pair, surface, facet, pressure, back, faces, projection)
    type(body_t), intent(in) :: body  !! The body.
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface  !! Surface of the body in the pair.
    integer, intent(in) :: facet(:)  !! Its facet at each integration point (n_points).
    real(dp), intent(in) :: pressure(:)  !! Pressures of the rows (n_rows) [pressure].
    real(dp), intent(in) :: back(:, :)  !! Rotation to the axes of the representative (dim, dim) [].
    type(face_table_t), intent(in) :: faces  !! Faces of the elements of the representative.
    !> Projections on the held directions, added to (dim, dim, n_boundary) [].
    real(dp), intent(inout) :: projection(:, :, :)
    real(dp) :: force(pair%n_points), normal(size(back, 1), surface%n_facets), direction(size(back, 1))
    real(dp) :: least
    integer :: e, f, q
    call pair%average%multiply_transposed(pair%row_weight*max(pressure, 0.0_dp), force)
    least = rounding*maxval(abs(force))
    normal = 0
    do q = 1, pair%n_points
      if (abs(force(q)) > least) normal(:, facet(q)) = normal(:, facet(q)) + pair%weight(q)*pair%normal(:, q)
    end do
    do q = 1, surface%n_facets
      if (.not. any(abs(normal(:, q)) > 0)) cycle
      ! Not held by this rank.
      if (surface%element(q) == 0) cycle
      f = local_face(body%mesh, surface%block(q), surface%element(q), surface%node(:, q))
      e = faces%before(surface%block(q)) + surface%element(q)
      if (f == 0) cycle
      associate (face => faces%boundary(f, e))
        if (face == 0) cycle
        direction = matmul(back, normal(:, q)/norm2(normal(:, q)))
        direction = direction - matmul(projection(:, :, face), direction)
        ! Held by a support, or by another pair, already.
        if (norm2(direction) < 0.1_dp) cycle
        direction = direction/norm2(direction)
        projection(:, :, face) = projection(:, :, face) + &
                                 spread(direction, 2, size(direction))*spread(direction, 1, size(direction))
      end associate
    end do
  end subroutine hold_contact
end module dotyk_control_residual_actions
