!> References to bodies by names with wildcards, and the groups that they stand for.
module dotyk_input_wildcards
  use dotyk_base_text, only: shown
  use dotyk_base_wildcard, only: has_wildcard, matches
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: find_name, first_names, names_t, refer, report
  implicit none
  private
  public :: append_places, bodies_named, names_several, refer_to_bodies

contains

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

  !> Find the bodies that a key refers to; a name that is unknown or matches nothing is reported.
  subroutine refer_to_bodies(group, key, name, bodies, problems, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! Key of the reference.
    character(*), intent(in) :: name  !! Name that it refers to; nothing is reported where it is empty.
    type(names_t), intent(in) :: bodies  !! Names of the bodies.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    integer, allocatable, intent(out) :: matched(:)  !! Indices of the bodies, ascending (n_matched).
    integer :: place
    call bodies_named(name, bodies, matched)
    if (size(matched) > 0) return
    if (names_several(name, bodies)) then
      if (bodies%incomplete .or. size(bodies%name) == 0) return
      call report(problems, group, key, key//': no body has a name like '//shown(name)//' (known: '// &
                  first_names(bodies%name)//')')
    else
      call refer(group, key, name, bodies, problems, place)
    end if
  end subroutine refer_to_bodies

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
end module dotyk_input_wildcards
