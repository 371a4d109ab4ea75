!> Faces that are near each other and in no contact pair: a part that was forgotten passes through another in silence.
!> And bodies in no pair that others come near, just beyond the search distance: the log says what distance finds them.
module dotyk_model_unnamed_faces
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: of_mesh, opposite_cosine
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_contact_near_facets, only: find_facets, near_faces_t, search_distance
  use dotyk_contact_pair_report, only: distant_body_t, unnamed_faces_t
  use dotyk_input_case, only: case_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_pair_list, only: are_tied, exclusion_of, pair_list_t
  implicit none
  private
  public :: list_unnamed_faces, list_distant_bodies

  real(dp), parameter :: beyond = 3  !! Bodies up to this many search distances away count [].

contains

  !> List the faces of all bodies that are near each other and in no pair.
  subroutine list_unnamed_faces(case, surfaces, faces, near, list, unnamed)
    type(case_t), intent(in) :: case  !! The case, with the groups of its input.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(body_faces_t), intent(in) :: faces(:)  !! Facets of the bodies (n_bodies).
    type(near_faces_t), intent(in) :: near(:)  !! Facets that are near each other (n_near).
    type(pair_list_t), intent(in) :: list  !! The pairs.
    type(unnamed_faces_t), allocatable, intent(out) :: unnamed(:)  !! Faces in no pair, by bodies (n_unnamed).
    type(unnamed_faces_t) :: found(size(near))
    logical, allocatable :: open(:), seen(:)
    integer :: i, k, n, least
    n = 0
    do i = 1, size(near)
      associate (a => near(i)%body_a, b => near(i)%body_b)
        open = near(i)%opposite
        k = list%between(a, b, 0)
        if (k > 0) then
          open = open .and. abs(near(i)%distance) <= of_mesh*min(faces(a)%diameter, faces(b)%diameter)
          call leave_flanks(faces(a), faces(b), near(i), open)
          if (any(open)) call leave_pairs(surfaces, near(i), list, open)
        end if
        if (.not. any(open)) cycle
        if (is_left_out(case, a, b)) cycle
        n = n + 1
        found(n)%body_a = a
        found(n)%body_b = b
        found(n)%in_pair = k > 0
        ! Facets on the far sides of thin parts face each other as well: they are no overlap.
        least = minloc(abs(near(i)%distance), 1, open)
        found(n)%distance = near(i)%distance(least)
        found(n)%position = faces(a)%centre(near(i)%facet_a(least))
        if (allocated(seen)) deallocate (seen)
        allocate (seen(faces(a)%n))
        seen = .false.
        seen(pack(near(i)%facet_a, open)) = .true.
        found(n)%n_facets = count(seen)
      end associate
    end do
    unnamed = found(:n)
  end subroutine list_unnamed_faces

  !> Leave out facets that face each other by their curvature, or that of their polygons, alone: a flank beside the end
  !> of a cylinder that is in a pair touches the other body by the rim of this end.
  pure subroutine leave_flanks(a, b, near, counts)
    type(body_faces_t), intent(in) :: a  !! Facets of the first body.
    type(body_faces_t), intent(in) :: b  !! Facets of the second body.
    type(near_faces_t), intent(in) :: near  !! Facets of the two bodies that are near each other.
    logical, intent(inout) :: counts(:)  !! Facets that count so far (near%n).
    integer :: i
    do i = 1, size(counts)
      if (.not. counts(i)) cycle
      counts(i) = dot_product(a%normal(:, near%facet_a(i)), b%normal(:, near%facet_b(i))) < opposite_cosine
    end do
  end subroutine leave_flanks

  !> Leave out the facets that the pairs of two bodies have.
  subroutine leave_pairs(surfaces, near, list, open)
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(near_faces_t), intent(in) :: near  !! Facets of the two bodies.
    type(pair_list_t), intent(in) :: list  !! The pairs.
    logical, intent(inout) :: open(:)  !! Facets in no pair so far (near%n).
    logical, allocatable :: in_a(:), in_b(:)
    integer :: k, place_a, place_b
    k = 0
    do
      k = list%between(near%body_a, near%body_b, k)
      if (k == 0) return
      place_a = merge(list%place_a(k), list%place_b(k), list%contact(k)%body_a == near%body_a)
      place_b = merge(list%place_b(k), list%place_a(k), list%contact(k)%body_a == near%body_a)
      ! A pair that the search has found has all near faces.
      if (place_a == 0 .or. place_b == 0) then
        open = .false.
        return
      end if
      call surfaces(near%body_a)%facets(place_a, in_a)
      call surfaces(near%body_b)%facets(place_b, in_b)
      open = open .and. .not. (in_a(near%facet_a) .and. in_b(near%facet_b))
    end do
  end subroutine leave_pairs

  !> Whether some group leaves out two bodies.
  logical function is_left_out(case, a, b) result(left_out)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: a  !! Index of a body.
    integer, intent(in) :: b  !! Index of the other body.
    integer :: k
    left_out = .true.
    if (are_tied(case, a, b)) return
    do k = 1, size(case%contact)
      if (.not. allocated(case%contact(k)%exclude)) cycle
      if (exclusion_of(case%contact(k)%exclude, case%body(a), case%body(b)) > 0) return
    end do
    left_out = .false.
  end function is_left_out

  !> List the bodies in no pair, each with the one that is nearest beyond the search distance of `auto`.
  subroutine list_distant_bodies(case, faces, list, distant)
    type(case_t), intent(in) :: case  !! The case, with the groups of its input.
    type(body_faces_t), intent(in) :: faces(:)  !! Facets of the bodies (n_bodies).
    type(pair_list_t), intent(in) :: list  !! The pairs.
    type(distant_body_t), allocatable, intent(out) :: distant(:)  !! The bodies that have such a neighbour (n_distant).
    type(distant_body_t) :: found(size(faces))
    logical :: alone(size(faces))
    integer :: group, b, k, n
    n = 0
    group = findloc(case%contact%auto, .true., 1)
    if (group > 0) then
      alone = .true.
      do k = 1, list%n
        if (list%group(k) == 0) cycle
        alone(list%contact(k)%body_a) = .false.
        alone(list%contact(k)%body_b) = .false.
      end do
      ! The nearest one of a tied body is the one that it is tied to.
      if (allocated(case%tie)) then
        do k = 1, size(case%tie)
          alone([case%tie(k)%body_a, case%tie(k)%body_b]) = .false.
        end do
      end if
      do b = 1, size(faces)
        if (.not. alone(b)) cycle
        call find_nearest(case, group, faces, b, found(n + 1))
        if (found(n + 1)%other == 0) cycle
        ! Two bodies alone with each other are told once.
        if (any(found(:n)%body == found(n + 1)%other .and. found(:n)%other == b)) cycle
        n = n + 1
      end do
    end if
    allocate (distant(n))
    distant = found(:n)
  end subroutine list_distant_bodies

  !> The body that is nearest to one.
  subroutine find_nearest(case, group, faces, body, nearest)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: group  !! The group with `auto`.
    type(body_faces_t), intent(in) :: faces(:)  !! Facets of the bodies (n_bodies).
    integer, intent(in) :: body  !! Index of the body.
    type(distant_body_t), intent(out) :: nearest  !! The nearest one; no index beyond `beyond` search distances.
    type(near_faces_t) :: near
    real(dp) :: reach, searched
    integer :: c
    nearest%body = body
    nearest%distance = huge(reach)
    do c = 1, size(faces)
      if (c == body .or. faces(c)%n == 0 .or. faces(body)%n == 0) cycle
      searched = search_distance(faces(body), faces(c), case%contact(group)%search_radius)
      reach = min(beyond*searched, nearest%distance)
      if (any(faces(c)%lo > faces(body)%hi + reach .or. faces(c)%hi < faces(body)%lo - reach)) cycle
      if (exclusion_of(case%contact(group)%exclude, case%body(body), case%body(c)) > 0) cycle
      near = near_faces_t()
      call find_facets(faces(body), faces(c), reach, near)
      if (.not. any(near%opposite)) cycle
      nearest%other = c
      nearest%distance = minval(near%distance, near%opposite)
      nearest%searched = searched
    end do
  end subroutine find_nearest
end module dotyk_model_unnamed_faces
