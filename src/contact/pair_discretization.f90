!> Discretization of a contact pair by a segment-to-segment dual mortar method (Wohlmuth, SIAM J. Numer. Anal. 38, 2000;
!> Popp, Gee and Wall, Int. J. Numer. Methods Engrg. 79, 2009), or by a quadrature-point penalty.
!>
!> The contact search has a broad phase (bounding-volume tree) and a narrow phase (clipping of the master facets on the
!> slave facets to mortar segments, projection of the integration points). The rows, at which the contact conditions are
!> imposed, are weighted means of the integration points: weighted gaps at the vertices of the slave surface with dual
!> shape functions, or each point by itself. Vertices and edges that face nothing get rows of their own.
!>
!> Of a plane master surface only a part counts. A floor or wall that many bodies touch has far more facets than any of
!> them comes near. Within a search radius only those near the slave matter; on a plane the others have the same normal,
!> so that whether and why a point has no projection does not depend on them either.
module dotyk_contact_pair_discretization
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: is_too_large, size_rule
  use dotyk_base_options, only: discretization_mortar, gap_constant, gap_formula
  use dotyk_base_text, only: quoted, to_text
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_edge_contacts, only: find_edge_contacts
  use dotyk_contact_gap_interpolation, only: interpolate_formula
  use dotyk_contact_local_depth, only: find_depths
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_contact_pair_rows, only: choose_origin, replace_points, set_rows, shift_origin
  use dotyk_contact_parallel_edges, only: find_parallel_edges
  use dotyk_contact_point_contacts, only: find_vertex_contacts, point_contact_t, touches_in_points, turn_about_axis
  use dotyk_contact_projection, only: master_surface_t
  use dotyk_contact_slave_points, only: project_slave_points
  use dotyk_contact_smooth_sheets, only: sharp_edges
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_quad4, element_tri3, kind_nodes
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: discretize_pair, set_given_gap, find_plane_part

  integer, parameter :: many = 64  !! Fewer facets are cheap, and
  real(dp), parameter :: worthwhile = 0.7_dp  !! a part is worth while if it has fewer than this fraction of them.
  !> Rings of facets around those near the slave: normals of smooth surfaces come from four, and what is flat there is
  !> known from one more.
  integer, parameter :: n_rings = 6

contains

  !> Discretize a pair.
  subroutine discretize_pair(mesh_a, surface_a, mesh_b, surface_b, settings, formula, pair, error)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    type(pair_settings_t), intent(in) :: settings  !! What the user says.
    type(formula_t), intent(inout) :: formula  !! Gap formula, evaluated where settings%gap_kind is `gap_formula`.
    type(contact_pair_t), intent(out) :: pair  !! Discretized pair.
    !> Set if no integration point has a projection, or if the gap formula gives no number or one that is too large.
    type(error_t), allocatable, intent(out) :: error
    type(surface_t) :: part
    integer, allocatable :: facet(:)
    if (settings%search_radius > 0) then
      call find_plane_part(mesh_a%x, surface_a, mesh_b%x, surface_b, settings%search_radius, facet, part)
      if (size(facet) > 0) then
        call discretize_surfaces(mesh_a, surface_a, mesh_b, part, settings, formula, pair, error)
        if (.not. allocated(error)) pair%facet_b = facet(pair%facet_b)
        ! Messages are about the whole surface.
        if (.not. allocated(error)) return
        deallocate (error)
      end if
    end if
    call discretize_surfaces(mesh_a, surface_a, mesh_b, surface_b, settings, formula, pair, error)
  end subroutine discretize_pair

  !> Discretize a pair with coordinates relative to a local origin where it is far from the global one.
  subroutine discretize_surfaces(mesh_a, surface_a, mesh_b, surface_b, settings, formula, pair, error)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b), or the part of it that matters.
    type(pair_settings_t), intent(in) :: settings  !! What the user says.
    type(formula_t), intent(inout) :: formula  !! Gap formula, evaluated where settings%gap_kind is `gap_formula`.
    type(contact_pair_t), intent(out) :: pair  !! Discretized pair.
    type(error_t), allocatable, intent(out) :: error  !! As in `discretize_pair`.
    type(body_mesh_t) :: shifted_a, shifted_b
    real(dp) :: origin(3)
    origin = 0
    call choose_origin(mesh_a%x, surface_a, origin(1:mesh_a%dimension))
    if (settings%axisymmetric) origin(1) = 0
    if (.not. any(abs(origin) > 0)) then
      call discretize_shifted(mesh_a, surface_a, mesh_b, surface_b, origin, settings, formula, pair, error)
    else
      shifted_a = mesh_a
      shifted_b = mesh_b
      call shift_origin(shifted_a%x, origin)
      call shift_origin(shifted_b%x, origin)
      call discretize_shifted(shifted_a, surface_a, shifted_b, surface_b, origin, settings, formula, pair, error)
    end if
  end subroutine discretize_surfaces

  !> Discretize a pair with coordinates relative to a local origin.
  subroutine discretize_shifted(mesh_a, surface_a, mesh_b, surface_b, origin, settings, formula, pair, error)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body, in shifted coordinates.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body, in shifted coordinates.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    real(dp), intent(in) :: origin(3)  !! Local origin (3) [length].
    type(pair_settings_t), intent(in) :: settings  !! Settings of the pair.
    type(formula_t), intent(inout) :: formula  !! Gap formula, evaluated where settings%gap_kind is `gap_formula`.
    type(contact_pair_t), intent(out) :: pair  !! Discretized pair, in global coordinates.
    !> Set if no integration point has a projection, or if the gap formula gives no number or one that is too large.
    type(error_t), allocatable, intent(out) :: error
    type(master_surface_t) :: slave, master
    type(point_contact_t), allocatable :: contact(:)
    real(dp), allocatable :: x(:, :)
    logical, allocatable :: in_points(:)
    real(dp) :: radius
    radius = settings%search_radius
    if (.not. radius > 0) radius = min(mesh_a%diameter(), mesh_b%diameter())
    call master%init(mesh_b%x, surface_b)
    call slave%init(mesh_a%x, surface_a)
    call find_depths(settings%division, slave%tree, slave%adjacency%neighbour, radius, slave%set)
    call find_depths(settings%division, master%tree, master%adjacency%neighbour, radius, master%set)
    call project_slave_points(mesh_a, surface_a, slave, mesh_b, surface_b, master, settings, radius, x, pair)
    if (.not. settings%is_tie) then
      call find_point_contacts(mesh_a, surface_a, slave, mesh_b, surface_b, master, radius, contact)
    else
      allocate (contact(0))
    end if
    if (size(contact) > 0) then
      if (settings%axisymmetric) call turn_about_axis(contact)
      allocate (in_points(pair%n_points))
      call touches_in_points(contact, slave, master, pair%facet_a, pair%facet_b, pair%normal, in_points)
      call replace_points(.not. in_points, contact, pair)
    end if
    pair%name = settings%name
    pair%body_a = settings%body_a
    pair%body_b = settings%body_b
    pair%theta = settings%theta
    pair%discretization = settings%discretization
    if (pair%n_points == 0) then
      call explain_no_projection(settings, pair, surface_a%name, surface_b%name, master, x, radius, error)
      return
    end if
    call shift_origin(pair%position, -origin)
    associate (d => mesh_a%dimension, n => size(mesh_a%x, 2))
      call set_given_gap(settings, formula, surface_a, mesh_a%x + spread(origin(:d), 2, n), &
                         pair%n_points - size(contact), pair, error)
    end associate
    if (allocated(error)) return
    call set_rows(settings%division, settings%axisymmetric, mesh_a, surface_a, origin, size(contact), pair)
    allocate (pair%row_theta(pair%n_rows), source=pair%theta)
  end subroutine discretize_shifted

  !> Point contacts of vertices and edges.
  subroutine find_point_contacts(mesh_a, surface_a, slave, mesh_b, surface_b, master, radius, contact)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(master_surface_t), intent(in) :: slave  !! Slave surface, prepared for projections.
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    type(point_contact_t), allocatable, intent(out) :: contact(:)  !! Contacts (n).
    logical, allocatable :: sharp_a(:, :), sharp_b(:, :)
    allocate (contact(0))
    call sharp_edges(mesh_a%x, surface_a, slave%adjacency, sharp_a)
    call sharp_edges(mesh_b%x, surface_b, master%adjacency, sharp_b)
    call find_vertex_contacts(slave, sharp_a, &
                              kind_nodes(surface_a%kind(:surface_a%n_facets)) > slave%set%corners, master, radius, &
                              .true., contact)
    call find_vertex_contacts(master, sharp_b, &
                              kind_nodes(surface_b%kind(:surface_b%n_facets)) > master%set%corners, slave, radius, &
                              .false., contact)
    if (mesh_a%dimension == 2) return
    if (any(sharp_a) .or. any(sharp_b)) call find_edge_contacts(slave, master, sharp_a, sharp_b, radius, contact)
    if (any(sharp_a) .and. any(sharp_b)) &
      call find_parallel_edges(slave, master, sharp_a, sharp_b, &
                               kind_nodes(surface_a%kind(:surface_a%n_facets)) > slave%set%corners, radius, contact)
  end subroutine find_point_contacts

  !> Replace the distance between the surfaces by a given gap.
  subroutine set_given_gap(settings, formula, surface_a, x_a, n_facet_points, pair, error)
    type(pair_settings_t), intent(in) :: settings  !! Settings of the pair.
    type(formula_t), intent(inout) :: formula  !! Gap formula, evaluated where settings%gap_kind is `gap_formula`.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    real(dp), intent(in) :: x_a(:, :)  !! Nodes of its body (dimension, n_nodes) [length].
    integer, intent(in) :: n_facet_points  !! Number of integration points that are no point contacts.
    type(contact_pair_t), intent(inout) :: pair  !! Pair; its gaps are set.
    !> Set if the gap formula gives no number or one that is too large.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: x(3)
    integer :: i
    pair%gap_kind = settings%gap_kind
    if (any(settings%gap_kind == [gap_constant, gap_formula])) then
      pair%bend = 0
      pair%curved = 0
      pair%uncertainty = 0
    end if
    select case (settings%gap_kind)
    case (gap_constant)
      pair%gap = settings%gap
    case (gap_formula)
      x = 0
      do i = 1, pair%n_points
        x(1:pair%dimension) = pair%position(:, i)
        pair%gap(i) = formula%evaluate(x)
        if (.not. is_too_large(pair%gap(i))) cycle
        !$omp critical (message)
        call set_error(error, trim(settings%group)//' '//quoted(settings%name)//': gap_formula is '// &
                       to_text(pair%gap(i))//' at ('//to_text(x(1))//', '//to_text(x(2))//', '//to_text(x(3))//')', &
                       exit_bad_input)
        !$omp end critical (message)
        if (ieee_is_finite(pair%gap(i))) error%message = error%message//'; '//size_rule
        return
      end do
      if (pair%discretization == discretization_mortar) &
        call interpolate_formula(surface_a, x_a, formula, n_facet_points, pair)
    end select
  end subroutine set_given_gap

  !> Error for a pair without projections: a distance beyond the search radius, or the most frequent reason; and advice.
  subroutine explain_no_projection(settings, pair, name_a, name_b, master, x, radius, error)
    type(pair_settings_t), intent(in) :: settings  !! What the user says.
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    character(*), intent(in) :: name_a  !! Name of the slave surface.
    character(*), intent(in) :: name_b  !! Name of the master surface.
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    real(dp), intent(in) :: x(:, :)  !! All integration points (3, n) [length].
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return: the commonest reason, and advice.
    character(:), allocatable :: reason, advice
    real(dp) :: smallest
    logical :: is_far
    integer :: i, n_most
    smallest = huge(smallest)
    do i = 1, size(x, 2)
      smallest = min(smallest, master%smallest_distance(x(:, i)))
    end do
    n_most = max(pair%n_not_facing, pair%n_outside, pair%n_too_far)
    ! On a closed surface most points face away from the master, however near it is.
    is_far = smallest > radius .and. pair%n_too_far > 0
    if (is_far) n_most = pair%n_unprojected
    !$omp critical (message)
    if (is_far .or. pair%n_too_far == n_most) then
      reason = to_text(n_most)//' are farther away than search_radius = '//to_text(radius)
      advice = 'increase search_radius, or check the positions of the bodies'
    else if (pair%n_outside == n_most) then
      reason = to_text(n_most)//' project beyond its edge'
      advice = 'check that the surfaces lie opposite each other, or extend surface_b beyond surface_a'
    else
      reason = 'no facet faces '//to_text(n_most)//' of them (n_a . n_b < -0.5)'
      advice = 'check that the two surfaces face each other'
    end if
    call set_error(error, trim(settings%group)//' '//quoted(pair%name)//': none of the '// &
                   to_text(pair%n_unprojected)//' integration points of surface_a '//quoted(name_a)// &
                   ' has a projection on surface_b '// &
                   quoted(name_b)//': '//reason//'; the smallest distance between the surfaces is '// &
                   to_text(smallest)//'; '//advice, exit_bad_input)
    !$omp end critical (message)
  end subroutine explain_no_projection

  !> Find the part; without facets where the whole surface is to be taken.
  subroutine find_plane_part(x_a, surface_a, x_b, surface_b, radius, facet, part)
    real(dp), intent(in) :: x_a(:, :)  !! Nodes of the slave body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    real(dp), intent(in) :: x_b(:, :)  !! Nodes of the master body, likewise (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    real(dp), intent(in) :: radius  !! Search radius [length].
    integer, allocatable, intent(out) :: facet(:)  !! Facets of the master surface in the part, ascending (n).
    type(surface_t), intent(out) :: part  !! The part, as far as a pair needs it.
    real(dp) :: low(3), high(3), low_b(3), high_b(3), size_b
    logical :: marked(surface_b%n_facets), is_node(size(x_b, 2))
    integer :: f, k
    allocate (facet(0))
    if (size(x_b, 1) /= 3 .or. surface_b%n_facets < many) return
    if (.not. is_plane(x_b, surface_b)) return
    ! Facets of the slave near the plane, then those of the plane near these.
    call box_of(x_b, surface_b, low_b, high_b, size_b)
    call box_near(x_a, surface_a, low_b - radius - size_b, high_b + radius + size_b, low, high)
    if (any(low > high)) return
    do f = 1, surface_b%n_facets
      associate (x => x_b(:, surface_b%node(:kind_nodes(surface_b%kind(f)), f)))
        marked(f) = all(maxval(x, 2) + radius + size_b >= low .and. minval(x, 2) - radius - size_b <= high)
      end associate
    end do
    do k = 1, n_rings
      is_node = .false.
      do f = 1, surface_b%n_facets
        if (marked(f)) is_node(surface_b%node(:kind_nodes(surface_b%kind(f)), f)) = .true.
      end do
      do f = 1, surface_b%n_facets
        if (.not. marked(f)) marked(f) = any(is_node(surface_b%node(:kind_nodes(surface_b%kind(f)), f)))
      end do
    end do
    if (.not. any(marked) .or. count(marked) >= worthwhile*surface_b%n_facets) return
    facet = pack([(f, f=1, surface_b%n_facets)], marked)
    part%name = surface_b%name
    part%dimension = surface_b%dimension
    part%order_elevated = surface_b%order_elevated
    part%n_facets = size(facet)
    part%kind = surface_b%kind(facet)
    part%node = surface_b%node(:, facet)
    if (allocated(surface_b%entity)) part%entity = surface_b%entity(facet)
    if (allocated(surface_b%sheet)) part%sheet = surface_b%sheet(:, facet)
  end subroutine find_plane_part

  !> Whether all facets are plane and have the same normal.
  pure logical function is_plane(x, surface)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp) :: normal(3), first(3)
    integer :: f, c
    is_plane = .false.
    first = 0
    do f = 1, surface%n_facets
      if (all(surface%kind(f) /= [element_tri3, element_quad4])) return
      ! Two triangles of a quadrilateral; one twice of a triangle.
      do c = 3, kind_nodes(surface%kind(f))
        normal = cross(x(:, surface%node(c - 1, f)) - x(:, surface%node(1, f)), &
                       x(:, surface%node(c, f)) - x(:, surface%node(1, f)))
        if (.not. norm2(normal) > 0) return
        normal = normal/norm2(normal)
        if (f == 1 .and. c == 3) first = normal
        if (maxval(abs(normal - first)) > rounding) return
      end do
    end do
    is_plane = .true.
  end function is_plane

  !> Bounding box of a surface, and of its largest facet the diagonal.
  pure subroutine box_of(x, surface, low, high, diagonal)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(out) :: low(3), high(3)  !! Lower and upper corner (3) [length].
    real(dp), intent(out) :: diagonal  !! Diagonal of the largest box of a facet [length].
    integer :: f
    low = huge(low)
    high = -huge(high)
    diagonal = 0
    do f = 1, surface%n_facets
      associate (of_facet => x(:, surface%node(:kind_nodes(surface%kind(f)), f)))
        low = min(low, minval(of_facet, 2))
        high = max(high, maxval(of_facet, 2))
        diagonal = max(diagonal, norm2(maxval(of_facet, 2) - minval(of_facet, 2)))
      end associate
    end do
  end subroutine box_of

  !> Bounding box of the facets of a surface whose boxes, widened by their own diagonals, meet another box.
  pure subroutine box_near(x, surface, other_low, other_high, low, high)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(in) :: other_low(3), other_high(3)  !! Corners of the other box (3) [length].
    !> Corners of the box; the lower one above the upper one where there is no such facet (3) [length].
    real(dp), intent(out) :: low(3), high(3)
    real(dp), dimension(3) :: own_low, own_high
    real(dp) :: margin
    integer :: f
    low = huge(low)
    high = -huge(high)
    do f = 1, surface%n_facets
      associate (of_facet => x(:, surface%node(:kind_nodes(surface%kind(f)), f)))
        own_low = minval(of_facet, 2)
        own_high = maxval(of_facet, 2)
      end associate
      margin = norm2(own_high - own_low)
      if (any(own_low - margin > other_high .or. own_high + margin < other_low)) cycle
      low = min(low, own_low - margin)
      high = max(high, own_high + margin)
    end do
  end subroutine box_near
end module dotyk_contact_pair_discretization
