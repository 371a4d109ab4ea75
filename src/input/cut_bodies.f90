!> Makes two bodies of each that a `&bolt` cuts.
module dotyk_input_cut_bodies
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: shown, text_t, to_text
  use dotyk_input_case, only: body_input_t, scene_input_t
  use dotyk_input_cut, only: cut_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: is_given, is_usable, names_t, pick_groups, read_numbers, refuse, report, text_of
  use dotyk_input_wildcards, only: refer_to_bodies
  implicit none
  private
  public :: cut_bodies

contains

  !> Cut the bodies that `&bolt` names by its key `body`.
  subroutine cut_bodies(groups, scene, problems, body, names)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(scene_input_t), intent(in) :: scene  !! The scene, for its analysis.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> Bodies; those that are cut are two, one after the other, on return (n_bodies).
    type(body_input_t), allocatable, intent(inout) :: body(:)
    type(names_t), intent(inout) :: names  !! Their names (n_bodies).
    type(cut_input_t), allocatable :: cut(:)
    type(cut_input_t) :: given
    integer, allocatable :: picked(:), matched(:)
    integer :: i, k
    call pick_groups(groups, 'bolt', picked)
    allocate (cut(size(body)))
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call read_cut(group, scene, problems, given)
        if (.not. is_given(group, 'body')) cycle
        call refer_to_bodies(group, 'body', text_of(group, 'body'), names, problems, matched)
        do k = 1, size(matched)
          if (matched(k) > size(body)) cycle
          associate (whole => body(matched(k)))
            if (cut(matched(k))%is_cut()) &
              call report(problems, group, 'body', 'body '//shown(whole%name)//' is cut already in line '// &
                          to_text(cut(matched(k))%line)//': a bolt has one cut')
            if (whole%is_surface) &
              call report(problems, group, 'body', 'body '//shown(whole%name)//' has no volume to cut')
            cut(matched(k)) = given
            cut(matched(k))%whole = whole%name
          end associate
        end do
      end associate
    end do
    if (.not. any(cut%is_cut())) return
    call divide(cut, body, names)
    do i = 1, size(body)
      if (.not. body(i)%cut%is_cut()) cycle
      do k = 1, size(body)
        if (k /= i .and. body(k)%name == body(i)%name) &
          call problems%add(body(k)%line, '&body: '//shown(body(k)%name)//' is the name of a half of body '// &
                            shown(body(i)%cut%whole)//', which the &bolt of line '//to_text(body(i)%cut%line)// &
                            ' cuts: give it another name')
      end do
    end do
  end subroutine cut_bodies

  !> Read where a bolt is cut.
  subroutine read_cut(group, scene, problems, cut)
    type(group_t), intent(in) :: group  !! Checked group.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its analysis.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(cut_input_t), intent(out) :: cut  !! The cut.
    character(7), parameter :: of_cut(3) = [character(7) :: 'point', 'normal', 'surface']
    integer :: k
    cut%line = group%line
    cut%surface = text_of(group, 'surface')
    if (.not. is_given(group, 'body')) then
      do k = 1, size(of_cut)
        if (is_given(group, trim(of_cut(k)))) &
          call report(problems, group, trim(of_cut(k)), trim(of_cut(k))//' is for a body that is cut: add body')
      end do
      return
    end if
    call refuse(group, 'surface_a', 'body', problems)
    call refuse(group, 'surface_b', 'body', problems)
    call refuse(group, 'search_radius', 'body', problems)
    if (is_given(group, 'surface')) then
      call refuse(group, 'point', 'surface', problems)
      call refuse(group, 'normal', 'surface', problems)
      return
    end if
    if (.not. is_given(group, 'point') .or. .not. is_given(group, 'normal')) then
      call problems%add(group%line, '&bolt: a body is cut by a plane, ''point'' and ''normal'', or along a '// &
                        '''surface'' inside it')
      return
    end if
    call read_numbers(group, 'point', cut%point)
    call read_numbers(group, 'normal', cut%normal)
    if (.not. is_usable(group, 'normal')) return
    if (.not. norm2(cut%normal) > 0) then
      call report(problems, group, 'normal', 'normal has no direction')
      return
    end if
    cut%normal = cut%normal/norm2(cut%normal)
    if (scene%dimension == 2 .and. abs(cut%normal(3)) > 0) &
      call report(problems, group, 'normal', 'in two dimensions the normal of a cut is in the plane')
    if (scene%analysis == analysis_axisymmetric .and. abs(cut%normal(1)) > 0) &
      call report(problems, group, 'normal', 'in axisymmetric analyses bolts are along the axis: normal=0,1')
  end subroutine read_cut

  !> Put two halves in the place of each body that is cut.
  subroutine divide(cut, body, names)
    type(cut_input_t), intent(in) :: cut(:)  !! Cut of each body (n_bodies).
    type(body_input_t), allocatable, intent(inout) :: body(:)  !! Bodies; more on return (n_bodies).
    type(names_t), intent(inout) :: names  !! Their names (n_bodies).
    type(body_input_t), allocatable :: all_bodies(:)
    type(names_t) :: all_names
    integer :: b, half, n
    n = size(body) + count(cut%is_cut())
    allocate (all_bodies(n), all_names%name(n), all_names%line(n), all_names%whole(n))
    all_names%what = names%what
    all_names%incomplete = names%incomplete
    n = 0
    do b = 1, size(body)
      do half = 1, merge(2, 1, cut(b)%is_cut())
        n = n + 1
        all_bodies(n) = body(b)
        all_names%whole(n)%s = ''
        if (cut(b)%is_cut()) then
          all_bodies(n)%cut = cut(b)
          all_bodies(n)%cut%half = half
          all_bodies(n)%name = body(b)%name//' ('//to_text(half)//')'
          all_names%whole(n)%s = body(b)%name
        end if
        all_names%name(n)%s = all_bodies(n)%name
        all_names%line(n) = body(b)%line
      end do
    end do
    call move_alloc(all_bodies, body)
    names = all_names
  end subroutine divide
end module dotyk_input_cut_bodies
