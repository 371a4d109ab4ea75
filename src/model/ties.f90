!> Discretizes the ties of the input. A bolt acts along its shank: the faces around the cut have its direction.
module dotyk_model_ties
  use dotyk_base_error, only: error_slot_t, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_rotation, only: rotation_matrix
  use dotyk_base_text, only: quoted, to_text
  use dotyk_base_thresholds, only: pi
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_contact_tie, only: discretize_matching_tie, discretize_tie, facet_size
  use dotyk_control_contact_problem, only: tied_surfaces_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_recovery_patch, only: diagonalize
  use dotyk_input_case, only: applies_in, case_t, tie_input_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: area_vector, frame_of_normal
  use dotyk_mesh_surface, only: find_common_facets, surface_nodes, surface_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  implicit none
  private
  public :: find_ties, set_bolts, tightens

  real(dp), parameter :: most_distant = 0.5_dp  !! Surfaces are tied up to this distance, in facets [].
  !> The rotated side of a sector lies on the other one up to this fraction of a facet: what facets of curved sides are
  !> apart.
  real(dp), parameter :: most_off_sector = 0.1_dp
  real(dp), parameter :: nearly_flat = 0.9999_dp  !! Least length of the mean of unit normals over a flat surface [].
  real(dp), parameter :: whole_side = 0.999_dp  !! Least fraction of the side of a sector tied where the body is cut [].

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.
  !> A body is a shank where the mean squared cosine between the normals around the cut and its direction is less than
  !> this fraction of that of any other direction: a cone of 17 degrees still is, the foot of a head is not [].
  real(dp), parameter :: clearly = 0.2_dp

contains

  !> Discretize all ties; all problems are reported together.
  subroutine find_ties(case, body, surfaces, pair, surface_a, surface_b, tie, error)
    type(case_t), intent(inout) :: case  !! The case; ties of halves that do not have their surfaces are dropped.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_surfaces_t), intent(in) :: surfaces(:)  !! Their named surfaces (n_bodies).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(surface_t), intent(in) :: surface_a(:)  !! Their slave surfaces (n_pairs).
    type(surface_t), intent(in) :: surface_b(:)  !! Their master surfaces (n_pairs).
    type(tied_surfaces_t), allocatable, intent(out) :: tie(:)  !! The ties, in the order of the input (n_ties).
    type(error_t), allocatable, intent(out) :: error  !! Where ties cannot be discretized: all problems.
    type(problem_list_t) :: problems
    type(error_slot_t), allocatable :: failed(:)
    integer :: k, p
    call drop_absent_ties(case, surfaces, problems)
    call problems%raise(error)
    if (allocated(error)) return
    call make_halves_slaves(case)
    allocate (tie(size(case%tie)), failed(size(case%tie)))
    do k = 1, size(case%tie)
      associate (given => case%tie(k))
        call find_tie(given, case%scene%analysis == analysis_axisymmetric, body(given%body_a), body(given%body_b), &
                      surfaces(given%body_a), surfaces(given%body_b), tie(k), failed(k)%error)
      end associate
    end do
    call drop_distant_halves(case, tie, failed)
    do k = 1, size(case%tie)
      associate (given => case%tie(k))
        call problems%add_error(failed(k)%error, case%file//':'//to_text(given%line)//': ')
        if (.not. allocated(tie(k)%component)) cycle
        do p = 1, size(pair)
          if (is_tied_contact(tie(k), pair(p), surface_a(p), surface_b(p))) &
            call problems%add(case%file//':'//to_text(case%contact(p)%line)//': &contact '//quoted(pair(p)%name)// &
                              ' is in part between the faces that '//quoted(given%name)//' (line '// &
                              to_text(given%line)//') ties to each other: the split of forces between both would '// &
                              'be arbitrary; name other faces, or one of both groups only', exit_bad_input)
        end do
        do p = 1, k - 1
          if (.not. allocated(tie(p)%component)) cycle
          if (is_tied_contact(tie(p), tie(k)%component(1), tie(k)%surface_a, tie(k)%surface_b)) &
            call problems%add(case%file//':'//to_text(given%line)//': '//quoted(given%name)//' ties faces that '// &
                              quoted(case%tie(p)%name)//' (line '//to_text(case%tie(p)%line)//') ties to each '// &
                              'other already: the split of forces between both would be arbitrary; name other '// &
                              'faces, or one of both only', exit_bad_input)
        end do
      end associate
    end do
    do k = 1, size(tie)
      associate (given => case%tie(k))
        if (.not. (abs(given%angle) > 0 .and. case%body(given%body_a)%cut%is_cut())) cycle
        if (tie(k)%tied < whole_side) &
          call problems%add(case%file//':'//to_text(given%line)//': &tie '//quoted(given%name)//': '// &
                            to_text(100*(1 - tie(k)%tied), 2)//' % of '//quoted(given%surface_a)//' of body '// &
                            quoted(body(given%body_a)%name)//' meets the other half of the cut body, to which it '// &
                            'would not be tied: the cut leaves other lines on both sides of the sector; let '// &
                            '&bolt cut along a surface of the mesh, or along faces that are alike on both '// &
                            'sides', exit_bad_input)
      end associate
    end do
    call problems%raise(error)
    if (.not. allocated(error)) call set_bolts(case%tie, 1, tie)
  end subroutine find_ties

  !> Drop the ties of halves of cut bodies that the other side does not reach, where it reaches another half.
  subroutine drop_distant_halves(case, tie, failed)
    type(case_t), intent(inout) :: case  !! The case.
    type(tied_surfaces_t), allocatable, intent(inout) :: tie(:)  !! The ties; rows where one was found (n_ties).
    type(error_slot_t), allocatable, intent(inout) :: failed(:)  !! Why there is none (n_ties).
    type(tied_surfaces_t), allocatable :: kept(:)
    type(error_slot_t), allocatable :: left(:)
    logical :: is_kept(size(tie))
    integer :: i, k, n
    do k = 1, size(tie)
      is_kept(k) = .not. allocated(failed(k)%error)
      if (is_kept(k)) cycle
      is_kept(k) = .true.
      do i = 1, size(tie)
        if (allocated(failed(i)%error)) cycle
        if (joins_halves_of(case, i, k)) is_kept(k) = .false.
      end do
    end do
    if (all(is_kept)) return
    n = count(is_kept)
    allocate (kept(n), left(n))
    n = 0
    do k = 1, size(tie)
      if (.not. is_kept(k)) cycle
      n = n + 1
      kept(n) = tie(k)
      if (allocated(failed(k)%error)) call move_alloc(failed(k)%error, left(n)%error)
    end do
    case%tie = pack(case%tie, is_kept)
    call move_alloc(kept, tie)
    call move_alloc(left, failed)
  end subroutine drop_distant_halves

  !> Drop the ties of halves of cut bodies that do not have the surface: it is on the other half.
  subroutine drop_absent_ties(case, surfaces, problems)
    type(case_t), intent(inout) :: case  !! The case.
    type(body_surfaces_t), intent(in) :: surfaces(:)  !! Named surfaces of the bodies (n_bodies).
    type(problem_list_t), intent(inout) :: problems  !! Mistakes are added.
    logical :: is_there(size(case%tie))
    integer :: i, k
    do k = 1, size(case%tie)
      associate (given => case%tie(k))
        is_there(k) = surfaces(given%body_a)%find(given%surface_a) > 0 .and. &
                      surfaces(given%body_b)%find(given%surface_b) > 0
      end associate
    end do
    do k = 1, size(case%tie)
      associate (given => case%tie(k))
        if (is_there(k) .or. any([(is_there(i) .and. joins_halves_of(case, i, k), i=1, size(is_there))])) cycle
        call problems%add(case%file//':'//to_text(given%line)//': '// &
                          trim(merge('&bolt', '&tie ', given%is_bolt))//' '//quoted(given%name)// &
                          ': no half of the bodies that are cut has the surface '// &
                          quoted(given%surface_a)//' or '//quoted(given%surface_b), exit_bad_input)
        return
      end associate
    end do
    ! A surface on both halves makes two ties of one name.
    do k = 2, size(case%tie)
      if (.not. (is_there(k) .and. is_there(k - 1))) cycle
      if (case%tie(k)%line == case%tie(k - 1)%line .and. case%tie(k)%name == case%tie(k - 1)%name) &
        case%tie(k)%name = case%tie(k)%name//' (2)'
    end do
    case%tie = pack(case%tie, is_there)
  end subroutine drop_absent_ties

  !> Make the side of a tie that both halves of a cut body have its slave side: rows at a vertex of another body that
  !> meets both halves would hold it to one of them.
  subroutine make_halves_slaves(case)
    type(case_t), intent(inout) :: case  !! The case, without ties of surfaces that are not there.
    logical :: is_exchanged(size(case%tie))
    integer :: i, k
    do k = 1, size(is_exchanged)
      associate (given => case%tie(k))
        is_exchanged(k) = .not. (given%is_bolt .or. given%is_cut .or. abs(given%angle) > 0) .and. &
                          case%body(given%body_b)%cut%is_cut() .and. .not. case%body(given%body_a)%cut%is_cut() .and. &
                          any([(case%tie(i)%body_b /= given%body_b .and. joins_halves_of(case, i, k), &
                                i=1, size(case%tie))])
      end associate
    end do
    do k = 1, size(is_exchanged)
      if (is_exchanged(k)) call case%tie(k)%exchange()
    end do
  end subroutine make_halves_slaves

  !> Whether two ties are one of the input: of the same bodies, or of halves of these.
  pure logical function joins_halves_of(case, one, other) result(joins)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: one, other  !! The ties.
    joins = case%tie(one)%line == case%tie(other)%line
    if (joins) joins = has_same_whole(case%tie(one)%body_a, case%tie(other)%body_a) .and. &
                       has_same_whole(case%tie(one)%body_b, case%tie(other)%body_b)

  contains

    !> Whether two bodies are one, or halves of one.
    pure logical function has_same_whole(a, b)
      integer, intent(in) :: a, b  !! The bodies.
      has_same_whole = a == b
      if (has_same_whole .or. .not. (case%body(a)%cut%is_cut() .and. case%body(b)%cut%is_cut())) return
      has_same_whole = case%body(a)%cut%whole == case%body(b)%cut%whole
    end function has_same_whole
  end function joins_halves_of

  !> Whether a contact pair has points between a slave facet and a master facet that are both tied, to each other.
  logical function is_tied_contact(tie, pair, surface_a, surface_b) result(is_tied)
    type(tied_surfaces_t), intent(in) :: tie  !! The tie.
    type(contact_pair_t), intent(in) :: pair  !! The pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface.
    type(surface_t), intent(in) :: surface_b  !! Its master surface.
    is_tied = .false.
    associate (rows => tie%component(1))
      if (pair%body_a == rows%body_a .and. pair%body_b == rows%body_b) is_tied = joins(tie%surface_a, tie%surface_b)
      if (is_tied) return
      ! Of one body, either side may be either surface.
      if (pair%body_a == rows%body_b .and. pair%body_b == rows%body_a) is_tied = joins(tie%surface_b, tie%surface_a)
    end associate

  contains

    !> Whether points of the pair join facets of two surfaces.
    logical function joins(one, other)
      type(surface_t), intent(in) :: one  !! Surface of the slave body.
      type(surface_t), intent(in) :: other  !! Surface of the master body.
      logical, allocatable :: tied_a(:), tied_b(:)
      integer :: p
      call find_common_facets(surface_a, one, tied_a)
      call find_common_facets(surface_b, other, tied_b)
      joins = any([(tied_a(pair%facet_a(p)) .and. tied_b(pair%facet_b(p)), p=1, pair%n_points)])
    end function joins
  end function is_tied_contact

  !> Discretize one tie.
  subroutine find_tie(given, axisymmetric, body_a, body_b, surfaces_a, surfaces_b, tie, error)
    type(tie_input_t), intent(in) :: given  !! `&tie`.
    logical, intent(in) :: axisymmetric  !! Whether the bodies are axisymmetric.
    type(body_t), intent(in) :: body_a  !! Body of the slave side.
    type(body_t), intent(in) :: body_b  !! Body of the master side.
    type(body_surfaces_t), intent(in) :: surfaces_a  !! Surfaces of the slave body.
    type(body_surfaces_t), intent(in) :: surfaces_b  !! Surfaces of the master body.
    type(tied_surfaces_t), intent(out) :: tie  !! The tie.
    type(error_t), allocatable, intent(out) :: error  !! The surfaces are too far apart, or do not face each other.
    type(pair_settings_t) :: settings
    type(contact_pair_t), allocatable :: of_component(:)
    type(body_mesh_t) :: turned
    real(dp) :: turn(3, 3), lost
    tie%name = given%name
    tie%surface_a = surfaces_a%surface(surfaces_a%find(given%surface_a))
    tie%surface_b = surfaces_b%surface(surfaces_b%find(given%surface_b))
    settings%name = given%name
    settings%group = merge('&bolt', '&tie ', given%is_bolt)
    settings%body_a = given%body_a
    settings%body_b = given%body_b
    settings%axisymmetric = axisymmetric
    settings%search_radius = given%search_radius
    tie%facet_size = min(facet_size(body_a%mesh, tie%surface_a), facet_size(body_b%mesh, tie%surface_b))
    if (.not. settings%search_radius > 0) settings%search_radius = most_distant*tie%facet_size
    associate (d => body_a%dimension)
      if (given%is_cut) then
        call discretize_matching_tie(body_a%mesh, tie%surface_a, body_b%mesh, tie%surface_b, settings, of_component, &
                                     tie%normal(:d))
        if (norm2(given%axis) > 0) tie%normal = given%axis
      else if (abs(given%angle) > 0) then
        turn = rotation_matrix(given%axis, given%angle)
        tie%angle = given%angle
        tie%around_axis = cylindrical(given%axis, given%centre, body_a%mesh, tie%surface_a)
        tie%offset(:d) = given%centre(:d) - matmul(turn(:d, :d), given%centre(:d))
        turned = body_b%mesh
        turned%x = spread(given%centre(:d), 2, size(turned%x, 2)) + &
          matmul(turn(:d, :d), turned%x - spread(given%centre(:d), 2, size(turned%x, 2)))
        call discretize_tie(body_a%mesh, tie%surface_a, turned, tie%surface_b, settings, of_component, &
                            tie%normal(:d), tie%distance, error, turn(:d, :d))
        if (.not. allocated(error) .and. tie%distance > most_off_sector*tie%facet_size) &
          call set_error(error, '&tie '//quoted(given%name)//': surface_b '//quoted(given%surface_b)// &
                         ', rotated by angle='//to_text(given%angle)//' about axis through centre, is up to '// &
                         to_text(tie%distance, 3)//' from surface_a '//quoted(given%surface_a)// &
                         ', on which it has to lie (facets of '//to_text(tie%facet_size, 3)// &
                         '): the angle of one of n sectors is 360/n degrees, positive or negative', exit_bad_input)
      else
        call discretize_tie(body_a%mesh, tie%surface_a, body_b%mesh, tie%surface_b, settings, of_component, &
                            tie%normal(:d), tie%distance, error)
      end if
    end associate
    if (allocated(error)) return
    tie%is_bolt = given%is_bolt
    if (given%is_bolt) call tighten(given, tie, error)
    if (allocated(error)) return
    if (given%is_bolt .and. .not. axisymmetric) &
      tie%oblique = angle_of_halves(angle_to_shank(body_a%mesh, tie%surface_a, tie%normal), &
                                    angle_to_shank(body_b%mesh, tie%surface_b, tie%normal))
    associate (pair => of_component(1))
      lost = pair%lost_not_facing + pair%lost_outside + pair%lost_too_far
    end associate
    tie%tied = 1 - lost
    call move_alloc(of_component, tie%component)
  end subroutine find_tie

  !> Angle between normal and shank, from those that the halves of a bolt show [degrees].
  !>
  !> A half that is a head there has the cut in its underside, whose normals are those of a shank across; or it is no
  !> shank at all, and its angle 0.
  pure real(dp) function angle_of_halves(a, b) result(angle)
    real(dp), intent(in) :: a, b  !! Angles of the halves, 0 where they are no shank [degrees].
    ! Beyond it one half alone says nothing [degrees].
    real(dp), parameter :: across = 60
    angle = min(a, b)
    if (angle > 0) return
    angle = max(a, b)
    if (angle > across) angle = 0
  end function angle_of_halves

  !> Radius, height and angle of the nodes of a surface around an axis, which points to the same side for either sign
  !> of its direction (3, n_nodes of the surface) [length, length, degrees].
  function cylindrical(axis, centre, mesh, surface)
    real(dp), intent(in) :: axis(3)  !! Direction of the axis (3) [].
    real(dp), intent(in) :: centre(3)  !! A point of it (3) [length].
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), allocatable :: cylindrical(:, :)
    real(dp) :: frame(3, 3), arm(3)
    integer, allocatable :: node(:)
    integer :: i
    call surface_nodes(surface, node)
    allocate (cylindrical(3, size(node)))
    call frame_of_normal(3, sign(1.0_dp, axis(maxloc(abs(axis), 1)))*axis/norm2(axis), frame)
    do i = 1, size(node)
      arm = -centre
      arm(:mesh%dimension) = arm(:mesh%dimension) + mesh%x(:, node(i))
      arm = matmul(arm, frame)
      cylindrical(:, i) = [norm2(arm(:2)), arm(3), atan2(arm(2), arm(1))*180/pi]
    end do
  end function cylindrical

  !> Find the axis of a bolt, and how it is pulled together.
  subroutine tighten(given, bolt, error)
    type(tie_input_t), intent(in) :: given  !! `&bolt`.
    type(tied_surfaces_t), intent(inout) :: bolt  !! The bolt, with the normal of its cut.
    type(error_t), allocatable, intent(out) :: error  !! The cut is not flat.
    if (norm2(bolt%normal) < nearly_flat) then
      call set_error(error, '&bolt '//quoted(given%name)//': the surface '//quoted(bolt%surface_a%name)// &
                     ' is not flat: a bolt is cut across its axis', exit_bad_input)
      return
    end if
    bolt%normal = bolt%normal/norm2(bolt%normal)
    bolt%force = given%force
    bolt%shortening = given%shortening
  end subroutine tighten

  !> Tighten or lock the bolts of a load case.
  subroutine set_bolts(given, load_case, tie)
    type(tie_input_t), intent(in) :: given(:)  !! `&tie` and `&bolt` (n_ties).
    integer, intent(in) :: load_case  !! The load case.
    type(tied_surfaces_t), intent(inout) :: tie(:)  !! The same, with the shortenings of the load case before (n_ties).
    integer :: k
    do k = 1, size(tie)
      if (given(k)%is_bolt) call tie(k)%lock(.not. tightens(given(k), load_case))
    end do
  end subroutine set_bolts

  !> Whether a load case tightens a bolt.
  pure logical function tightens(given, load_case)
    type(tie_input_t), intent(in) :: given  !! `&tie` or `&bolt`.
    integer, intent(in) :: load_case  !! The load case.
    tightens = given%is_bolt .and. given%has_force
    if (tightens) tightens = applies_in(given%in_case, load_case)
  end function tightens

  !> Angle between the normal of a cut and the shank, 0 where the body is no shank there [degrees].
  !>
  !> The normals n of the faces beside the cut are perpendicular to a shank: its direction is the eigenvector of the
  !> smallest eigenvalue of the sum of A n n^T over these faces of areas A.
  real(dp) function angle_to_shank(mesh, cut, normal) result(angle)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of one half.
    type(surface_t), intent(in) :: cut  !! Its faces at the cut.
    real(dp), intent(in) :: normal(3)  !! Unit normal of the cut (3) [].
    type(surface_t) :: boundary
    type(corner_table_t) :: faces
    type(element_kind_t) :: kind
    logical, allocatable :: at_cut(:)
    real(dp) :: total(mesh%dimension, mesh%dimension), vectors(mesh%dimension, mesh%dimension), n(mesh%dimension)
    real(dp) :: spread_of(mesh%dimension)
    integer :: d, f, i, entry, least
    d = mesh%dimension
    angle = 0
    allocate (at_cut(mesh%n_nodes()), source=.false.)
    call faces%init(max_corners, cut%n_facets)
    do f = 1, cut%n_facets
      kind = element_kind(cut%kind(f))
      call faces%add(cut%node(:kind%n_corners, f), entry)
      at_cut(cut%node(:kind%n_corners, f)) = .true.
    end do
    call extract_boundary(mesh, boundary)
    total = 0
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      associate (corner => boundary%node(:kind%n_corners, f))
        if (.not. any(at_cut(corner))) cycle
        if (faces%find(corner) > 0) cycle
        n = area_vector(mesh%x(:, corner))
      end associate
      if (norm2(n) > 0) total = total + spread(n, 2, d)*spread(n, 1, d)/norm2(n)
    end do
    call diagonalize(d, total, vectors)
    spread_of = [(total(i, i), i=1, d)]
    least = minloc(spread_of, dim=1)
    if (.not. spread_of(least) < clearly*minval(spread_of, mask=[(i /= least, i=1, d)])) return
    angle = acos(min(1.0_dp, abs(dot_product(vectors(:, least), normal(:d)))))*180/pi
  end function angle_to_shank
end module dotyk_model_ties
