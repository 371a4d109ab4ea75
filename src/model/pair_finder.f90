!> Forms the contact pairs from the groups of the input: named ones, those that wildcards stand for, and those that the
!> search for near faces finds by itself (docs/pairs.md).
module dotyk_model_pair_finder
  use dotyk_base_error, only: error_t, exit_bad_input, problem_list_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: join, quoted, text_t, to_text
  use dotyk_base_thresholds, only: of_mesh
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_contact_near_faces, only: find_near_faces
  use dotyk_contact_near_facets, only: near_faces_t, search_distance
  use dotyk_contact_pair_report, only: group_report_t, pair_report_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t, contact_input_t, cut_surface
  use dotyk_mesh_surface, only: boundary_part, surface_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_boundary_patch, only: facet_graph_t, first_is_slave, grow_patch
  use dotyk_model_pair_list, only: are_tied, exclusion_of, exclusion_texts, merge_double_pairs, pair_list_t
  use dotyk_model_unnamed_faces, only: list_distant_bodies, list_unnamed_faces
  implicit none
  private
  public :: form_pairs

  type :: facet_mask_t  !! Of one body.
    !> Whether each facet of the boundary is at the cut; not allocated where the body is whole (n_facets).
    logical, allocatable :: facet(:)
  end type facet_mask_t

  type :: cut_facets_t  !! Of all bodies.
    type(facet_mask_t), allocatable, private :: body(:)  !! (n_bodies)
  contains
    procedure :: init => cut_facets_init
    procedure :: has => cut_facets_has
    procedure :: leave_out => cut_facets_leave_out
  end type cut_facets_t

contains

  !> Form all contact pairs; the groups of the case become the pairs.
  subroutine form_pairs(case, body, surfaces, surface_a, surface_b, report, error)
    type(case_t), intent(inout) :: case  !! The case; `contact` has one entry for each pair on return, in order.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Their surfaces (n_bodies).
    type(surface_t), allocatable, intent(out) :: surface_a(:)  !! Slave surface of each pair (n_pairs).
    type(surface_t), allocatable, intent(out) :: surface_b(:)  !! Master surface of each pair (n_pairs).
    type(pair_report_t), intent(out) :: report  !! What was found.
    !> Allocated where wildcards find no pair, or the same contact is named with different settings.
    type(error_t), allocatable, intent(out) :: error
    type(body_faces_t) :: faces(size(body))
    type(facet_graph_t) :: graph(size(body))
    type(cut_facets_t) :: inside
    type(near_faces_t), allocatable :: near(:)
    type(group_report_t) :: group
    type(pair_list_t) :: list
    type(problem_list_t) :: problems
    real(dp) :: searched
    logical, allocatable :: used(:)
    logical :: auto
    integer :: b, k, pass, n
    call list%init(size(body))
    do k = 1, size(case%contact)
      associate (given => case%contact(k))
        if (given%searched) cycle
        call add_named(list, given, k, surfaces(given%body_a), surfaces(given%body_b))
      end associate
    end do
    !$omp parallel do default(none) shared(body, surfaces, faces) schedule(dynamic, 1)
    do b = 1, size(body)
      if (surfaces(b)%boundary%n_facets > 0) call faces(b)%init(body(b)%mesh%x, surfaces(b)%boundary)
    end do
    !$omp end parallel do
    call inside%init(case, surfaces)
    do b = 1, size(body)
      ! The search distance is that of the whole, about.
      if (case%body(b)%cut%half == 1) faces(b:b + 1)%diameter = sum(faces(b:b + 1)%diameter)
    end do
    searched = -1
    allocate (report%group(count(case%contact%searched)))
    ! Pairs of named surfaces first: faces that are named are not for `auto`.
    do pass = 1, 2
      auto = pass == 2
      n = 0
      do k = 1, size(case%contact)
        if (.not. case%contact(k)%searched) cycle
        n = n + 1
        if (case%contact(k)%auto .neqv. auto) cycle
        call search(case%contact(k)%search_radius)
        group%line = case%contact(k)%line
        group%name = case%contact(k)%name
        group%auto = auto
        group%n_pairs = list%n
        group%n_named = 0
        group%n_excluded = 0
        group%distance = 0
        if (allocated(used)) deallocate (used)
        allocate (used(size(case%contact(k)%exclude)), source=.false.)
        if (auto) then
          call find_auto(case%contact(k), k)
        else
          call find_named(case%contact(k), k)
        end if
        group%n_pairs = list%n - group%n_pairs
        group%unused = exclusion_texts(case%contact(k)%exclude, .not. used)
        if (.not. auto .and. group%n_pairs == 0) call report_none(case%contact(k))
        report%group(n) = group
      end do
    end do
    call merge_double_pairs(case%file, surfaces, list, report%merged, problems)
    call problems%raise(error)
    if (allocated(error)) return
    if (size(body) > 1) then
      if (abs(searched) > 0) then
        call find_near_faces(faces, 0.0_dp, near, named_bodies(), of_mesh)
        call inside%leave_out(near)
      end if
      call list_unnamed_faces(case, surfaces, faces, near, list, report%unnamed)
    else
      allocate (report%unnamed(0))
    end if
    call list_distant_bodies(case, faces, list, report%distant)
    call order_pairs(case, list, surface_a, surface_b)

  contains

    !> Find the near faces, unless they are those of the search before.
    subroutine search(radius)
      real(dp), intent(in) :: radius  !! Search distance that the user gives, or 0 [length].
      if (abs(searched - radius) <= 0) return
      call find_near_faces(faces, radius, near)
      call inside%leave_out(near)
      searched = radius
    end subroutine search

    !> Facets of a body around those opposite another one, without those at the cut of a bolt.
    subroutine find_patch(b, facet, patch)
      integer, intent(in) :: b  !! The body.
      integer, intent(in) :: facet(:)  !! Facets opposite the other body, maybe several times (n_near).
      integer, allocatable, intent(out) :: patch(:)  !! Facets of the patch, ascending (n_patch).
      if (.not. allocated(graph(b)%start)) call graph(b)%init(surfaces(b)%boundary)
      call grow_patch(surfaces(b)%boundary, graph(b), faces(b), facet, patch)
      patch = pack(patch, .not. inside%has(b, patch))
    end subroutine find_patch

    !> Bodies of the pairs so far, and those that are tied to each other (2, n).
    function named_bodies() result(bodies)
      integer, allocatable :: bodies(:, :), a(:), b(:)
      a = list%contact(:list%n)%body_a
      b = list%contact(:list%n)%body_b
      if (allocated(case%tie)) then
        a = [a, case%tie%body_a]
        b = [b, case%tie%body_b]
      end if
      bodies = transpose(reshape([a, b], [size(a), 2]))
    end function named_bodies

    !> Report that wildcards find no pair, and why.
    subroutine report_none(given)
      type(contact_input_t), intent(in) :: given  !! `&contact`.
      character(:), allocatable :: text
      text = ''
      if (group%n_excluded > 0) then
        text = 'exclude removes all pairs ('//to_text(group%n_excluded)//')'
      else
        call report_lacking('surface_a', given%bodies_a, given%surface_a, text)
        call report_lacking('surface_b', given%bodies_b, given%surface_b, text)
        if (len(text) == 0) text = 'none of the surfaces of surface_a is near one of surface_b; the search '// &
                                   'distance is search_radius, or 10 % of the smaller body'
      end if
      call problems%add(case%file//':'//to_text(given%line)//': &contact '//quoted(given%name)//': '//text, &
                        exit_bad_input)
    end subroutine report_none

    !> Say that none of the bodies of a side has the surface, if so.
    subroutine report_lacking(key, bodies, name, text)
      character(*), intent(in) :: key  !! Key of the side.
      integer, intent(in) :: bodies(:)  !! Bodies that the side names (n).
      character(*), intent(in) :: name  !! The surface, maybe with wildcards.
      character(:), allocatable, intent(inout) :: text  !! Message so far.
      type(text_t) :: names(size(bodies))
      integer :: i
      do i = 1, size(bodies)
        if (surfaces(bodies(i))%find(name) > 0) return
        names(i)%s = quoted(body(bodies(i))%name)
      end do
      if (len(text) > 0) text = text//'; '
      text = text//key//': no physical surface '//quoted(name)//' on '//join(names, ', ')
    end subroutine report_lacking

    !> Whether the group leaves out two bodies.
    logical function is_excluded(given, a, b)
      type(contact_input_t), intent(in) :: given  !! `&contact`.
      integer, intent(in) :: a  !! Index of a body.
      integer, intent(in) :: b  !! Index of the other body.
      integer :: place
      place = exclusion_of(given%exclude, case%body(a), case%body(b))
      is_excluded = place > 0
      if (.not. is_excluded) return
      used(place) = .true.
      group%n_excluded = group%n_excluded + 1
    end function is_excluded

    !> Add a pair that the search has found.
    subroutine add_found(given, k, a, b, contact_a, place_a, contact_b, place_b)
      type(contact_input_t), intent(in) :: given  !! `&contact`, with the names of the surfaces.
      integer, intent(in) :: k  !! Its number among the groups.
      integer, intent(in) :: a  !! Slave body.
      integer, intent(in) :: b  !! Master body.
      type(surface_t), intent(in) :: contact_a  !! Slave surface.
      integer, intent(in) :: place_a  !! Its index among the named surfaces of the body, or 0.
      type(surface_t), intent(in) :: contact_b  !! Master surface.
      integer, intent(in) :: place_b  !! Its index among the named surfaces of the body, or 0.
      type(contact_input_t) :: contact
      real(dp) :: distance
      distance = search_distance(faces(a), faces(b), given%search_radius)
      group%distance = max(group%distance, distance)
      contact = given
      contact%searched = .false.
      contact%found = .true.
      contact%body_a = a
      contact%body_b = b
      contact%name = pair_name(given%name, body(a)%name, body(b)%name)
      if (given%auto) then
        contact%search_radius = distance
        contact%has_search_radius = .true.
        contact%surface_a = contact_a%name
        contact%surface_b = contact_b%name
      end if
      call list%add(contact, k, contact_a, place_a, contact_b, place_b)
    end subroutine add_found

    !> Find the pairs of a group that names bodies with wildcards: those of its surfaces that are near each other.
    subroutine find_named(given, k)
      type(contact_input_t), intent(in) :: given  !! `&contact`.
      integer, intent(in) :: k  !! Its number among the groups.
      logical, allocatable :: in_a(:), in_b(:)
      logical :: is_a(size(body)), is_b(size(body)), is_near
      integer :: i, turn, a, b, place_a, place_b
      is_a = .false.
      is_a(given%bodies_a) = .true.
      is_b = .false.
      is_b(given%bodies_b) = .true.
      do i = 1, size(near)
        do turn = 1, 2
          a = merge(near(i)%body_a, near(i)%body_b, turn == 1)
          b = merge(near(i)%body_b, near(i)%body_a, turn == 1)
          if (.not. (is_a(a) .and. is_b(b))) cycle
          place_a = surfaces(a)%find(given%surface_a)
          place_b = surfaces(b)%find(given%surface_b)
          if (place_a == 0 .or. place_b == 0) cycle
          call surfaces(a)%facets(place_a, in_a)
          call surfaces(b)%facets(place_b, in_b)
          if (turn == 1) then
            is_near = any(in_a(near(i)%facet_a) .and. in_b(near(i)%facet_b) .and. near(i)%opposite)
          else
            is_near = any(in_a(near(i)%facet_b) .and. in_b(near(i)%facet_a) .and. near(i)%opposite)
          end if
          if (.not. is_near) cycle
          if (is_excluded(given, a, b)) exit
          call add_found(given, k, a, b, surfaces(a)%surface(place_a), place_a, surfaces(b)%surface(place_b), place_b)
          ! The same surfaces the other way round are the same contact.
          if (given%surface_a == given%surface_b .and. is_a(b) .and. is_b(a)) exit
        end do
      end do
    end subroutine find_named

    !> Find the pairs of a group with `auto`: faces of any two bodies that are near each other.
    subroutine find_auto(given, k)
      type(contact_input_t), intent(in) :: given  !! `&contact`.
      integer, intent(in) :: k  !! Its number among the groups.
      type(surface_t) :: patch_a, patch_b
      integer, allocatable :: facet_a(:), facet_b(:)
      logical :: first
      integer :: i
      do i = 1, size(near)
        if (.not. any(near(i)%opposite)) cycle
        associate (a => near(i)%body_a, b => near(i)%body_b)
          if (is_excluded(given, a, b) .or. are_tied(case, a, b)) cycle
          if (list%between(a, b, 0) > 0) then
            group%n_named = group%n_named + 1
            cycle
          end if
          call find_patch(a, pack(near(i)%facet_a, near(i)%opposite), facet_a)
          call find_patch(b, pack(near(i)%facet_b, near(i)%opposite), facet_b)
          call boundary_part(surfaces(a)%boundary, facet_a, patch_a)
          call boundary_part(surfaces(b)%boundary, facet_b, patch_b)
          first = first_is_slave(faces(a), near(i)%facet_a, body(a)%young(), faces(b), near(i)%facet_b, body(b)%young())
          ! Both halves of a body have one role on others, so that contact can go on across the cut.
          if (case%body(a)%cut%is_cut() .neqv. case%body(b)%cut%is_cut()) first = case%body(a)%cut%is_cut()
          ! Multipliers of a rigid body would be more than what yields.
          if (body(a)%constraint%rigid%is_set .neqv. body(b)%constraint%rigid%is_set) &
            first = body(b)%constraint%rigid%is_set
          if (first) then
            call add_found(given, k, a, b, patch_a, 0, patch_b, 0)
          else
            call add_found(given, k, b, a, patch_b, 0, patch_a, 0)
          end if
        end associate
      end do
    end subroutine find_auto
  end subroutine form_pairs

  !> Add a pair of named surfaces.
  subroutine add_named(list, contact, group, surfaces_a, surfaces_b)
    type(pair_list_t), intent(inout) :: list  !! Pairs so far.
    type(contact_input_t), intent(in) :: contact  !! The pair, its bodies set.
    integer, intent(in) :: group  !! Group of the input.
    type(body_surfaces_t), intent(in) :: surfaces_a  !! Surfaces of the slave body.
    type(body_surfaces_t), intent(in) :: surfaces_b  !! Surfaces of the master body.
    integer :: a, b
    a = surfaces_a%find(contact%surface_a)
    b = surfaces_b%find(contact%surface_b)
    call list%add(contact, group, surfaces_a%surface(a), a, surfaces_b%surface(b), b)
  end subroutine add_named

  !> Name of a pair that was found; it names a folder of the results file.
  pure function pair_name(group, a, b) result(name)
    character(*), intent(in) :: group  !! Name of the group; may be empty.
    character(*), intent(in) :: a  !! Name of the slave body.
    character(*), intent(in) :: b  !! Name of the master body.
    character(:), allocatable :: name
    integer :: i
    name = a//' - '//b
    do i = 1, len(name)
      if (name(i:i) == '/') name(i:i) = '|'
    end do
    if (len(group) > 0) name = group//': '//name
  end function pair_name

  !> Give the pairs back in the order of their groups.
  subroutine order_pairs(case, list, surface_a, surface_b)
    type(case_t), intent(inout) :: case  !! The case; its contacts are set.
    type(pair_list_t), intent(in) :: list  !! The pairs.
    type(surface_t), allocatable, intent(out) :: surface_a(:)  !! Slave surfaces (n_pairs).
    type(surface_t), allocatable, intent(out) :: surface_b(:)  !! Master surfaces (n_pairs).
    integer :: start(size(case%contact) + 1), k, i
    start = 0
    do k = 1, list%n
      if (list%group(k) > 0) start(list%group(k) + 1) = start(list%group(k) + 1) + 1
    end do
    do i = 1, size(case%contact)
      start(i + 1) = start(i) + start(i + 1)
    end do
    i = start(size(start))
    deallocate (case%contact)
    allocate (case%contact(i), surface_a(i), surface_b(i))
    do k = 1, list%n
      if (list%group(k) == 0) cycle
      start(list%group(k)) = start(list%group(k)) + 1
      i = start(list%group(k))
      case%contact(i) = list%contact(k)
      surface_a(i) = list%surface_a(k)
      surface_b(i) = list%surface_b(k)
    end do
  end subroutine order_pairs

  !> Find the facets.
  subroutine cut_facets_init(self, case, surfaces)
    class(cut_facets_t), intent(out) :: self
    type(case_t), intent(in) :: case  !! The case.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies; tables are made (n_bodies).
    integer :: b
    allocate (self%body(size(surfaces)))
    do b = 1, size(surfaces)
      if (case%body(b)%cut%is_cut()) call surfaces(b)%facets(surfaces(b)%find(cut_surface), self%body(b)%facet)
    end do
  end subroutine cut_facets_init

  !> Whether facets of a body are at its cut.
  pure function cut_facets_has(self, b, facet) result(has)
    class(cut_facets_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    integer, intent(in) :: facet(:)  !! Facets of its boundary (n).
    logical :: has(size(facet))
    has = .false.
    if (allocated(self%body(b)%facet)) has = self%body(b)%facet(facet)
  end function cut_facets_has

  !> Let such facets be opposite nothing.
  pure subroutine cut_facets_leave_out(self, near)
    class(cut_facets_t), intent(in) :: self
    type(near_faces_t), intent(inout) :: near(:)  !! Facets near each other, by couples of bodies (n_couples).
    integer :: i
    do i = 1, size(near)
      near(i)%opposite = near(i)%opposite .and. .not. (self%has(near(i)%body_a, near(i)%facet_a) .or. &
                                                       self%has(near(i)%body_b, near(i)%facet_b))
    end do
  end subroutine cut_facets_leave_out
end module dotyk_model_pair_finder
