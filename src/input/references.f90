!> What groups refer to: names of materials, bodies and load cases, maybe with wildcards; and what else of a file its
!> readers need.
!>
!> Vectors of two or three components, as numbers or formulas, from checked groups.
module dotyk_input_references
  use dotyk_base_kinds, only: dp
  use dotyk_base_place, only: place_t
  use dotyk_base_text, only: has_wildcard, matches, shown, suggestion, text_t, to_text, visible
  use dotyk_input_case, only: action_t, scene_input_t, solver_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_problems, only: problems_t
  implicit none
  private
  public :: append_places, bodies_named, find_name, first_names, names_several, need_place, why_unknown, &
    read_formulas, read_vector

  !> Keys that tell where a group acts.
  character(8), parameter, public :: place_key(4) = [character(8) :: 'surface', 'edge', 'nodes', 'nodes_at']

  type, public :: names_t  !! Names of all groups of one kind, such as the bodies.
    character(:), allocatable :: what  !! Kind of the groups, for messages: 'body'.
    type(text_t), allocatable :: name(:)  !! The names (n); empty where one cannot be used.
    integer, allocatable :: line(:)  !! Lines of the groups (n).
    !> Name of the body of which each is a half, empty where it is none; not allocated where no body is cut (n).
    type(text_t), allocatable :: whole(:)
    logical :: incomplete = .false.  !! Whether names may be missing because of mistakes that are reported already.
  end type names_t

  !> A namelist file whose groups are being read: its problems so far, and what groups refer to.
  type, public, extends(problems_t) :: input_t
    type(names_t) :: materials, bodies, cases  !! Names that groups refer to; of bodies, copies and halves, too.
    type(scene_input_t) :: scene  !! `&scene`.
    type(solver_input_t) :: solver  !! `&solver`.
  contains
    procedure :: begin_action, cases_of, gather_names, refer_to_bodies, refuse, refuse_both, report
  end type input_t

contains

  !> Report a problem of a key, at its line.
  subroutine report(self, group, key, message)
    class(input_t), intent(inout) :: self
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! The key; the line is that of the group where it is not given.
    character(*), intent(in) :: message  !! What is wrong, after '&group: '.
    call self%add(group%line_of(key), '&'//group%name//': '//message)
  end subroutine report

  !> Report a key that another one excludes.
  subroutine refuse(self, group, key, other)
    class(input_t), intent(inout) :: self
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key, other  !! The excluded key, and the one that excludes it.
    if (group%is_given(key)) call self%report(group, key, key//' does not go together with '//other)
  end subroutine refuse

  !> Report two keys that say the same.
  subroutine refuse_both(self, group, key, other)
    class(input_t), intent(inout) :: self
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key, other  !! The keys; the line is that of the first one.
    if (group%is_given(key) .and. group%is_given(other)) &
      call self%report(group, key, key//' and '//other//' are both given: only one can be meant')
  end subroutine refuse_both

  !> Gather the names of groups of one kind and report duplicates.
  subroutine gather_names(self, groups, what, misspelled, names)
    class(input_t), intent(inout) :: self
    type(group_t), intent(in) :: groups(:)  !! All groups of the file (n_groups).
    character(*), intent(in) :: what  !! Name of the groups.
    logical, intent(in) :: misspelled  !! Whether the file may have such a group under a misspelled name.
    type(names_t), intent(out) :: names  !! Their names.
    integer, allocatable :: picked(:)
    integer :: i, j
    call pick_groups(groups, what, picked)
    names%what = what
    names%incomplete = misspelled
    allocate (names%name(size(picked)), names%line(size(picked)))
    do i = 1, size(picked)
      names%name(i)%s = groups(picked(i))%text_of('name')
      names%line(i) = groups(picked(i))%line
      if (len(names%name(i)%s) == 0) then
        names%incomplete = .true.
        cycle
      end if
      do j = 1, i - 1
        if (names%name(j)%s /= names%name(i)%s .or. len(names%name(j)%s) /= len(names%name(i)%s)) cycle
        call self%report(groups(picked(i)), 'name', 'a second '//what//' '//shown(names%name(i)%s)// &
                         ' (the first is in line '//to_text(names%line(j))//')')
        exit
      end do
    end do
  end subroutine gather_names

  !> Index of a name; 0 where it is unknown.
  pure integer function find_name(names, name) result(place)
    type(names_t), intent(in) :: names  !! Names to search.
    character(*), intent(in) :: name  !! Name to look up.
    do place = 1, size(names%name)
      if (names%name(place)%s == name .and. len(names%name(place)%s) == len(name)) return
    end do
    place = 0
  end function find_name

  !> Why a name that a key refers to is unknown; empty where it is known or empty, or where it may be missing because of
  !> mistakes that are reported already.
  function why_unknown(names, name) result(message)
    type(names_t), intent(in) :: names  !! Names that the key may refer to.
    character(*), intent(in) :: name  !! Name that it refers to.
    character(:), allocatable :: message, hint
    message = ''
    if (len(name) == 0 .or. find_name(names, name) > 0 .or. names%incomplete .or. size(names%name) == 0) return
    hint = suggestion(name, names%name)
    if (len(hint) == 0) hint = ' (known: '//first_names(names)//')'
    message = 'unknown '//names%what//' '//shown(name)//hint
  end function why_unknown

  !> The first names of a list, for messages.
  function first_names(names) result(text)
    type(names_t), intent(in) :: names  !! The names, at least one.
    character(:), allocatable :: text
    integer, parameter :: most = 10
    integer :: i
    text = visible(names%name(1)%s)
    do i = 2, min(most, size(names%name))
      text = text//', '//visible(names%name(i)%s)
    end do
    if (size(names%name) > most) text = text//' and '//to_text(size(names%name) - most)//' more'
  end function first_names

  !> Whether a name stands for all bodies that it matches: it has wildcards, and is no body's own name.
  pure logical function names_several(name, bodies)
    character(*), intent(in) :: name  !! Name of a body, maybe with wildcards.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    integer :: i
    names_several = .false.
    if (find_name(bodies, name) > 0) return
    names_several = has_wildcard(name)
    if (.not. allocated(bodies%whole)) return
    ! Both halves of a body that is cut.
    do i = 1, size(bodies%whole)
      names_several = names_several .or. (bodies%whole(i)%s == name .and. len(bodies%whole(i)%s) == len(name))
    end do
  end function names_several

  !> Bodies that a name stands for, ascending.
  pure subroutine bodies_named(name, bodies, matched)
    character(*), intent(in) :: name  !! Name of a body, maybe with wildcards.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    integer, allocatable, intent(out) :: matched(:)  !! Their indices (n_matched).
    integer :: i
    if (names_several(name, bodies)) then
      matched = pack([(i, i=1, size(bodies%name))], [(is_meant(i), i=1, size(bodies%name))])
    else
      i = find_name(bodies, name)
      matched = pack([i], [i > 0])
    end if

  contains

    !> Whether a body is meant, by its name or as a half.
    pure logical function is_meant(i)
      integer, intent(in) :: i  !! The body.
      is_meant = matches(name, bodies%name(i)%s)
      if (is_meant .or. .not. allocated(bodies%whole)) return
      if (len(bodies%whole(i)%s) > 0) is_meant = matches(name, bodies%whole(i)%s) .or. name == bodies%whole(i)%s
    end function is_meant
  end subroutine bodies_named

  !> Find what a name stands for, maybe with wildcards.
  subroutine find_named(names, name, matched, message)
    type(names_t), intent(in) :: names  !! Names that it may refer to.
    character(*), intent(in) :: name  !! The name.
    integer, allocatable, intent(out) :: matched(:)  !! Their indices, ascending (n_matched).
    !> Why there are none; empty where there are, or where mistakes that are reported already may be the reason.
    character(:), allocatable, intent(out) :: message
    call bodies_named(name, names, matched)
    message = ''
    if (size(matched) > 0) return
    if (.not. names_several(name, names)) then
      message = why_unknown(names, name)
    else if (.not. names%incomplete .and. size(names%name) > 0) then
      message = 'no '//names%what//' has a name like '//shown(name)//' (known: '//first_names(names)//')'
    end if
  end subroutine find_named

  !> Find the bodies that a key refers to; a name that is unknown or matches nothing is reported.
  subroutine refer_to_bodies(self, group, key, name, matched)
    class(input_t), intent(inout) :: self
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Key of the reference.
    character(*), intent(in) :: name  !! Name that it refers to; nothing is reported where it is empty.
    integer, allocatable, intent(out) :: matched(:)  !! Indices of the bodies, ascending (n_matched).
    character(:), allocatable :: message
    call find_named(self%bodies, name, matched, message)
    if (len(message) > 0) call self%report(group, key, key//': '//message)
  end subroutine refer_to_bodies

  !> The cases that the key `case` names.
  subroutine cases_of(self, group, in_case)
    class(input_t), intent(inout) :: self
    type(group_t), intent(in) :: group  !! Checked group.
    !> Whether the group belongs to each case; not allocated where it belongs to all (n_cases).
    logical, allocatable, intent(out) :: in_case(:)
    type(text_t), allocatable :: texts(:)
    character(:), allocatable :: message
    integer, allocatable :: matched(:)
    integer :: i
    if (.not. group%is_given('case')) return
    allocate (in_case(max(1, size(self%cases%name))), source=.false.)
    if (size(self%cases%name) == 0) then
      if (group%is_usable('case') .and. .not. self%cases%incomplete) &
        call self%report(group, 'case', 'case names load cases, and the file has no &case: add &case name=''...'' '// &
                          '/ for each of them')
      return
    end if
    call group%texts_of('case', texts)
    do i = 1, size(texts)
      call find_named(self%cases, texts(i)%s, matched, message)
      in_case(matched) = .true.
      if (len(message) > 0) call self%report(group, 'case', 'case: '//message)
    end do
  end subroutine cases_of

  !> What a group about bodies has in common with others.
  subroutine begin_action(self, group, action, matched)
    class(input_t), intent(inout) :: self
    type(group_t), intent(in) :: group  !! Checked group.
    class(action_t), intent(inout) :: action  !! Gets all but its body.
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that it names, ascending (n_matched).
    call self%refer_to_bodies(group, 'body', group%text_of('body'), matched)
    call self%cases_of(group, action%in_case)
    action%line = group%line
    action%any_body = names_several(group%text_of('body'), self%bodies)
    call read_place(self, group, action%place)
  end subroutine begin_action

  !> Report a group that needs a place and has none.
  subroutine need_place(input, group)
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(group_t), intent(in) :: group  !! Checked group.
    integer :: i
    if (any([(group%is_given(trim(place_key(i))), i=1, size(place_key))])) return
    call input%add(group%line, '&'//group%name//': ''surface'' is missing (or edge, nodes, nodes_at)')
  end subroutine need_place

  !> Where a group acts: on a surface, an edge or nodes; nowhere in particular where it names none of them.
  subroutine read_place(input, group, place)
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(group_t), intent(in) :: group  !! Checked group.
    type(place_t), intent(out) :: place  !! The place.
    real(dp), allocatable :: numbers(:)
    integer :: i, k, d
    d = input%scene%dimension
    place%dimension = d - 1
    place%name = ''
    k = 0
    do i = 1, size(place_key)
      if (.not. group%is_given(trim(place_key(i)))) cycle
      if (k > 0) call input%refuse_both(group, trim(place_key(k)), trim(place_key(i)))
      k = i
      if (k < 4) place%name = group%text_of(trim(place_key(i)))
    end do
    if (k == 2 .and. d == 2) &
      call input%report(group, 'edge', 'edge: in two dimensions an edge of a body is a surface: give surface')
    if (k == 2) place%dimension = 1
    if (k > 2) place%dimension = 0
    if (k < 4) return
    call group%reals_of('nodes_at', numbers)
    if (d == 0 .or. size(numbers) == 0) return
    if (mod(size(numbers), d) /= 0) then
      call input%report(group, 'nodes_at', 'nodes_at needs '//to_text(d)//' values for each node, got '// &
                        to_text(size(numbers)))
      return
    end if
    allocate (place%at(3, size(numbers)/d), source=0.0_dp)
    place%at(:d, :) = reshape(numbers, [d, size(numbers)/d])
  end subroutine read_place

  !> Append what one group stands for: itself, once for each body that it names.
  pure subroutine append_places(group, matched, group_of, body_of)
    integer, intent(in) :: group  !! Number of the group.
    !> Bodies that it names; it stands for itself, without a body, where there are none (n_matched).
    integer, intent(in) :: matched(:)
    integer, allocatable, intent(inout) :: group_of(:)  !! Group of each item so far (n_items).
    integer, allocatable, intent(inout) :: body_of(:)  !! Body of each item, 0 for none (n_items).
    integer :: i
    if (size(matched) == 0) then
      group_of = [group_of, group]
      body_of = [body_of, 0]
    else
      group_of = [group_of, [(group, i=1, size(matched))]]
      body_of = [body_of, matched]
    end if
  end subroutine append_places

  !> Read a vector with three components from two or three numbers.
  subroutine read_vector(group, input, key, local, vector)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the vector is in the axes of a surface: xi, eta, n.
    real(dp), intent(out) :: vector(3)  !! The vector (3) [unit of the key]; 0 where it is not given.
    real(dp), allocatable :: numbers(:)
    integer :: across
    vector = 0
    call group%reals_of(key, numbers)
    if (.not. right_count(group, input, key, size(numbers))) return
    across = merge(2, 3, local)
    if (size(numbers) == 3) then
      vector = numbers
      if (input%scene%dimension == 2 .and. abs(vector(across)) > 0) call report_across(group, input, key, local)
    else
      vector(1) = numbers(1)
      vector(merge(3, 2, local)) = numbers(2)
    end if
  end subroutine read_vector

  !> Read a vector of formulas from two or three texts.
  subroutine read_formulas(group, input, key, local, formulas)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the formulas are in the axes of a surface: xi, eta, n.
    type(text_t), allocatable, intent(out) :: formulas(:)  !! Formulas of the components (3), or none.
    type(text_t), allocatable :: texts(:)
    integer :: i, across
    call group%texts_of(key, texts)
    if (.not. right_count(group, input, key, size(texts))) then
      allocate (formulas(0))
      return
    end if
    across = merge(2, 3, local)
    allocate (formulas(3))
    if (size(texts) == 3) then
      do i = 1, 3
        formulas(i)%s = texts(i)%s
      end do
      if (input%scene%dimension == 2 .and. formulas(across)%s /= '0') call report_across(group, input, key, local)
    else
      formulas(1)%s = texts(1)%s
      formulas(across)%s = '0'
      formulas(merge(3, 2, local))%s = texts(2)%s
    end if
  end subroutine read_formulas

  !> Whether a vector is given with as many values as the space has dimensions; too few are reported.
  logical function right_count(group, input, key, n) result(right)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    integer, intent(in) :: n  !! Number of its values; 0 where it is not given or not usable.
    right = n > 0
    if (n /= 2 .or. input%scene%dimension /= 3) return
    call input%report(group, key, key//' needs 3 values in three dimensions, got '//to_text(group%count_of(key)))
    right = .false.
  end function right_count

  !> Report a component across the plane in two dimensions.
  subroutine report_across(group, input, key, local)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the vector is in the axes of a surface: xi, eta, n.
    call input%report(group, key, key//': the '//trim(merge('eta', 'z  ', local))//' component must be 0 in two '// &
                      'dimensions')
  end subroutine report_across
end module dotyk_input_references
