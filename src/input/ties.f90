!> Reads `&tie` and `&bolt` from checked groups.
module dotyk_input_ties
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, option_name, scheme_auto, scheme_dual, scheme_names
  use dotyk_base_text, only: quoted, shown, to_text
  use dotyk_input_case, only: body_input_t, cut_surface, tie_input_t
  use dotyk_input_contacts, only: read_side
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: input_t, names_t
  implicit none
  private
  public :: read_ties

contains

  !> Read all `&tie`, then all `&bolt`.
  subroutine read_ties(groups, input, body, tie)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(tie_input_t), allocatable, intent(out) :: tie(:)  !! Ties and bolts; incomplete if groups are wrong (n_ties).
    type(tie_input_t), allocatable :: ties(:), bolts(:)
    integer :: i, k
    call read_kind(groups, input, 'tie', body, ties)
    call read_kind(groups, input, 'bolt', body, bolts)
    tie = [ties, bolts]
    if (size(tie) == 0) return
    do i = 2, size(tie)
      do k = 1, i - 1
        if (joins_the_same(tie(i), tie(k))) &
          call input%add(tie(i)%line, 'the surfaces of '//shown(tie(i)%name)//' are joined already by '// &
                         shown(tie(k)%name)//' (line '//to_text(tie(k)%line)//')')
      end do
    end do
    if (all(input%solver%scheme /= [scheme_auto, scheme_dual])) &
      call input%add(input%solver%line, '&solver: scheme='//quoted(option_name(scheme_names, input%solver%scheme))// &
                     ' knows no ties: leave it out')
  end subroutine read_ties

  !> Whether two ties name the same two surfaces.
  pure logical function joins_the_same(one, other)
    type(tie_input_t), intent(in) :: one  !! A tie.
    type(tie_input_t), intent(in) :: other  !! Another one.
    joins_the_same = .false.
    if (min(one%body_a, one%body_b) == 0) return
    if (one%body_a == other%body_a .and. one%body_b == other%body_b) &
      joins_the_same = one%surface_a == other%surface_a .and. one%surface_b == other%surface_b
    if (one%body_a == other%body_b .and. one%body_b == other%body_a) &
      joins_the_same = joins_the_same .or. (one%surface_a == other%surface_b .and. one%surface_b == other%surface_a)
  end function joins_the_same

  !> Read all groups of one name.
  subroutine read_kind(groups, input, name, body, tie)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: name  !! 'tie' or 'bolt'.
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    !> In the order of the file; those that wildcards stand for one after the other (n_ties).
    type(tie_input_t), allocatable, intent(out) :: tie(:)
    type(tie_input_t) :: given
    integer, allocatable :: picked(:), matched_a(:), matched_b(:), of_a(:), of_b(:)
    integer :: i, ia, ib, k, n
    call pick_groups(groups, name, picked)
    allocate (tie(0))
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        if (group%is_given('body')) then
          call read_halves(group, body, given, matched_a, matched_b)
        else
          call read_sides(group, input, given, matched_a, matched_b)
        end if
        if (name == 'tie') call read_turn(group, input, given)
        if (name == 'bolt') call read_tension(group, input, given)
        of_a = whole_bodies(input%bodies, matched_a)
        of_b = whole_bodies(input%bodies, matched_b)
        n = max(n_wholes(of_a), n_wholes(of_b))
        do k = 1, n
          do ia = 1, max(1, size(of_a))
            if (.not. belongs(of_a, ia, k)) cycle
            do ib = 1, max(1, size(of_b))
              if (.not. belongs(of_b, ib, k)) cycle
              ! The cut joins the halves of one body; each is tied to itself in a sector.
              if (group%is_given('body') .and. ia /= ib) cycle
              if (group%is_given('angle') .and. size(of_a) > n_wholes(of_a) .and. ia /= ib) cycle
              tie = [tie, given]
              associate (one => tie(size(tie)))
                if (size(of_a) > 0) one%body_a = matched_a(ia)
                if (size(of_b) > 0) one%body_b = matched_b(ib)
                if (n > 1) one%name = numbered(given%name, k)
                call check_bodies(group, input, name, one)
              end associate
            end do
          end do
        end do
      end associate
    end do

  contains

    !> Whether a body is meant in a place of the list, of those of one side.
    pure logical function belongs(whole, i, k)
      integer, intent(in) :: whole(:)  !! Places of the bodies of the side (n).
      integer, intent(in) :: i, k  !! The body, and the place.
      belongs = n_wholes(whole) <= 1
      if (.not. belongs) belongs = whole(i) == k
    end function belongs
  end subroutine read_kind

  !> Report a tie of a body with itself.
  subroutine check_bodies(group, input, name, tie)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: name  !! 'tie' or 'bolt'.
    type(tie_input_t), intent(in) :: tie  !! The tie.
    if (tie%body_a /= tie%body_b .or. tie%body_a == 0) return
    if (group%is_given('angle') .and. tie%surface_a /= tie%surface_b) return
    if (group%is_given('angle')) then
      call input%report(group, 'surface_b', 'surface_a and surface_b are the same surface')
    else if (name == 'tie') then
      call input%report(group, 'surface_b', 'a tie without an angle needs two different bodies, got '// &
                        shown(input%bodies%name(tie%body_a)%s)//' twice; for cyclic symmetry add axis=0,0,1, '// &
                        'angle=360/n, in degrees')
    else
      call input%report(group, 'surface_b', '&'//name//' needs two different bodies, got '// &
                        shown(input%bodies%name(tie%body_a)%s)//' twice')
    end if
  end subroutine check_bodies

  !> Number of each body among the wholes, those of one side; both halves of a body that is cut have that of this.
  pure function whole_bodies(bodies, matched) result(whole)
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    integer, intent(in) :: matched(:)  !! Bodies of the side, ascending (n).
    integer :: whole(size(matched))
    logical :: same
    integer :: k, n
    n = 0
    do k = 1, size(matched)
      same = .false.
      if (k > 1 .and. allocated(bodies%whole)) then
        associate (before => bodies%whole(matched(max(1, k - 1))), now => bodies%whole(matched(k)))
          same = len(now%s) > 0 .and. now%s == before%s
        end associate
      end if
      if (.not. same) n = n + 1
      whole(k) = n
    end do
  end function whole_bodies

  !> Number of wholes of a side.
  pure integer function n_wholes(whole) result(n)
    integer, intent(in) :: whole(:)  !! As of `whole_bodies` (n).
    n = 0
    if (size(whole) > 0) n = whole(size(whole))
  end function n_wholes

  !> Make ties of the halves of the bodies that a bolt cuts.
  subroutine read_halves(group, body, tie, half_1, half_2)
    type(group_t), intent(in) :: group  !! Checked group.
    type(body_input_t), intent(in) :: body(:)  !! Bodies, cut (n_bodies).
    type(tie_input_t), intent(out) :: tie  !! The tie, without its bodies.
    integer, allocatable, intent(out) :: half_1(:), half_2(:)  !! First and second halves (n).
    integer :: b
    tie%line = group%line
    tie%name = group%text_of('name')
    tie%is_cut = .true.
    tie%surface_a = cut_surface
    tie%surface_b = cut_surface
    half_1 = pack([(b, b=1, size(body))], body%cut%line == group%line .and. body%cut%half == 1)
    half_2 = half_1 + 1
    if (size(half_1) > 0) tie%axis = body(half_1(1))%cut%normal
  end subroutine read_halves

  !> Name of one of several ties.
  pure function numbered(name, k)
    character(*), intent(in) :: name  !! Name of all; the number takes the place of its first *.
    integer, intent(in) :: k  !! The number.
    character(:), allocatable :: numbered
    integer :: star
    star = index(name, '*')
    if (star == 0) then
      numbered = name//' '//to_text(k)
    else
      numbered = name(:star - 1)//to_text(k)//name(star + 1:)
    end if
  end function numbered

  !> Read name, surfaces and search distance.
  subroutine read_sides(group, input, tie, matched_a, matched_b)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(tie_input_t), intent(out) :: tie  !! The tie, without its bodies.
    integer, allocatable, intent(out) :: matched_a(:)  !! Bodies of the slave side (n or 1).
    !> Bodies of the master side, each with the one of the slave side in its place (n or 1).
    integer, allocatable, intent(out) :: matched_b(:)
    character(9), parameter :: sides(2) = ['surface_a', 'surface_b']
    logical :: several
    integer :: k, n_a, n_b
    tie%line = group%line
    tie%name = group%text_of('name')
    ! Of a tie, the table of the keys asks for them.
    do k = 1, size(sides)
      if (group%name == 'bolt' .and. .not. group%is_given(sides(k))) &
        call input%add(group%line, '&bolt: '''//sides(k)//''' is missing, or body, which the program cuts')
    end do
    call read_side(group, input, 'surface_a', matched_a, tie%surface_a, several)
    call read_side(group, input, 'surface_b', matched_b, tie%surface_b, several)
    n_a = n_wholes(whole_bodies(input%bodies, matched_a))
    n_b = n_wholes(whole_bodies(input%bodies, matched_b))
    if (min(n_a, n_b) > 1 .and. n_a /= n_b) &
      call input%report(group, 'surface_b', 'surface_a names '//to_text(n_a)//' bodies and surface_b '//to_text(n_b)// &
                        ': give each its own, in the same order, or one for all')
    if (group%is_usable('search_radius')) tie%search_radius = group%real_of('search_radius')
  end subroutine read_sides

  !> Read the rotation of the master side.
  subroutine read_turn(group, input, tie)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(tie_input_t), intent(inout) :: tie  !! The tie; gets the rotation.
    real(dp), allocatable :: numbers(:)
    tie%angle = group%real_of('angle')
    if (group%is_usable('axis')) then
      call group%reals_of('axis', numbers)
      tie%axis = numbers
      if (.not. any(abs(numbers) > 0)) call input%report(group, 'axis', 'axis has no direction')
      if (input%scene%dimension == 2 .and. any(abs(numbers(:2)) > 0)) &
        call input%report(group, 'axis', 'in two dimensions surfaces are rotated about z')
    end if
    if (group%is_usable('centre')) then
      call group%reals_of('centre', numbers)
      tie%centre(:size(numbers)) = numbers
    end if
    if (.not. group%is_given('angle')) then
      if (group%is_given('axis')) call input%report(group, 'axis', 'axis is given without an angle')
      if (group%is_given('centre')) call input%report(group, 'centre', 'centre is given without an angle')
    else if (input%scene%analysis == analysis_axisymmetric) then
      call input%report(group, 'angle', 'angle means nothing in axisymmetric analyses')
    else if (group%is_usable('angle') .and. .not. abs(tie%angle) > 0) then
      call input%report(group, 'angle', 'an angle of 0 is no rotation: that of one of n sectors is 360/n degrees')
    end if
  end subroutine read_turn

  !> Read how far a bolt is tightened.
  subroutine read_tension(group, input, bolt)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(tie_input_t), intent(inout) :: bolt  !! The bolt.
    integer :: k
    bolt%is_bolt = .true.
    bolt%has_force = group%is_given('force')
    bolt%force = group%real_of('force')
    bolt%shortening = group%real_of('shortening')
    if (bolt%has_force .and. group%is_given('shortening')) then
      call input%report(group, 'shortening', 'force and shortening are both given: only one can be meant')
    else if (.not. (bolt%has_force .or. group%is_given('shortening'))) then
      call input%add(group%line, '&bolt: ''force'' or ''shortening'' is missing')
    end if
    if (group%is_given('case') .and. .not. bolt%has_force) &
      call input%report(group, 'case', 'case is for a bolt with a force: a shortening is the same in all cases')
    call input%cases_of(group, bolt%in_case)
    ! Tightened first, then locked.
    if (.not. allocated(bolt%in_case) .and. size(input%cases%name) > 0) &
      bolt%in_case = [(k == 1, k=1, size(input%cases%name))]
  end subroutine read_tension
end module dotyk_input_ties
