!> Bodies in no pair that others come near, just beyond the search distance: the log says what distance finds them.
module dotyk_model_distant_bodies
  use dotyk_base_kinds, only: dp
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_contact_facing_facets, only: search_distance
  use dotyk_contact_near_facets, only: find_facets, near_faces_t
  use dotyk_contact_pair_report, only: distant_body_t
  use dotyk_input_case, only: case_t
  use dotyk_model_exclusions, only: exclusion_of
  use dotyk_model_pair_list, only: pair_list_t
  implicit none
  private
  public :: list_distant_bodies

  real(dp), parameter :: beyond = 3  !! Bodies up to this many search distances away count [].

contains

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
    !> The nearest one; no index where all are farther than `beyond` search distances.
    type(distant_body_t), intent(out) :: nearest
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
end module dotyk_model_distant_bodies
