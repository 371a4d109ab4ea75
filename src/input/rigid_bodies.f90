!> Reads `&rigid_body` from checked groups: bodies of which nothing but rigid motions is left.
module dotyk_input_rigid_bodies
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_acceleration, load_angular_velocity, load_force_density, &
    load_names, option_name
  use dotyk_base_text, only: lower, shown, to_text
  use dotyk_input_case, only: case_t, rigid_input_t, share_a_case
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: append_places, input_t, read_vector
  use dotyk_input_remarks, only: add_spared
  implicit none
  private
  public :: read_rigid_bodies

  !> Linear rotations by more than this move points by more than their distance from the axis [radian].
  real(dp), parameter :: largest_rotation = 1

  character(2), parameter :: names(6) = ['x ', 'y ', 'z ', 'rx', 'ry', 'rz']  !! Names of the motions in `fix`.

contains

  !> Read all `&rigid_body`, and refuse what rigid bodies do not have.
  subroutine read_rigid_bodies(groups, input, case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(case_t), intent(inout) :: case  !! The case with all other groups; gets the rigid bodies.
    type(rigid_input_t), allocatable :: rigid(:)
    integer, allocatable :: picked(:), matched(:), group_of(:), body_of(:)
    logical, allocatable :: spared(:)
    integer :: i
    call pick_groups(groups, 'rigid_body', picked)
    allocate (rigid(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_rigid(groups(picked(i)), input, rigid(i), matched)
      call append_places(i, matched, group_of, body_of)
    end do
    allocate (case%rigid(size(group_of)))
    do i = 1, size(group_of)
      case%rigid(i) = rigid(group_of(i))
      case%rigid(i)%body = body_of(i)
      if (body_of(i) == 0) cycle
      call compare(case%rigid(i), case%rigid(:i - 1))
    end do
    do i = 1, size(case%body)
      if (.not. case%body(i)%is_surface .or. any(case%rigid%body == i)) cycle
      call input%add(case%body(i)%line, '&body: '//shown(case%body(i)%name)//' is a surface without volume: it is '// &
                     'rigid; add &rigid_body body='//shown(case%body(i)%name)//', or give volume and material')
    end do
    if (size(case%rigid) == 0) return
    do i = 1, size(case%load)
      if (case%load(i)%body == 0) cycle
      ! Where wildcards name it, as in gravity on all bodies, it has no share.
      if (case%load(i)%any_body .or. .not. case%body(case%load(i)%body)%is_surface) cycle
      if (case%load(i)%kind /= load_force_density .and. any(case%load%of_mass .and. &
                                                            case%load%body == case%load(i)%body)) cycle
      if (any(case%load(i)%kind == [load_force_density, load_acceleration, load_angular_velocity])) &
        call input%add(case%load(i)%line, '&load: body '//shown(input%bodies%name(case%load(i)%body)%s)// &
                       ' has neither volume nor mass for '//option_name(load_names, case%load(i)%kind)// &
                       ': give force and moment on its surface')
    end do
    ! Where wildcards name it among others, as in a temperature of all bodies, it has no share.
    spared = is_spared(case%temperature%line, case%temperature%body, case%temperature%any_body)
    call add_spared(case, '&temperature', case%temperature%line, case%temperature%body, spared)
    case%temperature = pack(case%temperature, .not. spared)
    spared = is_spared(case%initial_stress%line, case%initial_stress%body, case%initial_stress%any_body)
    call add_spared(case, '&initial_stress', case%initial_stress%line, case%initial_stress%body, spared)
    case%initial_stress = pack(case%initial_stress, .not. spared)
    spared = is_spared(case%support%line, case%support%body, case%support%any_body)
    call add_spared(case, '&support', case%support%line, case%support%body, spared .and. .not. case%support%is_spring)
    call add_spared(case, '&spring', case%support%line, case%support%body, spared .and. case%support%is_spring)
    case%support = pack(case%support, .not. spared)
    do i = 1, size(case%support)
      call refuse(case%support(i)%line, case%support(i)%body, &
                  trim(merge('&spring ', '&support', case%support(i)%is_spring)), &
                  'its motions are held by fix of &rigid_body')
    end do
    do i = 1, size(case%temperature)
      call refuse(case%temperature(i)%line, case%temperature(i)%body, '&temperature', 'it does not expand')
    end do
    do i = 1, size(case%tie)
      if (min(case%tie(i)%body_a, case%tie(i)%body_b) == 0) cycle
      if (any(case%rigid%body == case%tie(i)%body_a) .and. any(case%rigid%body == case%tie(i)%body_b)) &
        call input%add(case%tie(i)%line, trim(merge('&bolt', '&tie ', case%tie(i)%is_bolt))//': both bodies are '// &
                       'rigid: make them one body, or give both the same motions')
    end do
    do i = 1, size(case%initial_stress)
      call refuse(case%initial_stress(i)%line, case%initial_stress(i)%body, '&initial_stress', 'it has no stress')
    end do

  contains

    !> Compare a group with those before it: groups of one body have values for different load cases.
    subroutine compare(own, others)
      type(rigid_input_t), intent(in) :: own  !! The group.
      type(rigid_input_t), intent(in) :: others(:)  !! The groups before it.
      integer :: j
      do j = 1, size(others)
        if (others(j)%body /= own%body) cycle
        if (share_a_case(own%in_case, others(j)%in_case)) then
          call input%add(own%line, '&rigid_body: body '//shown(input%bodies%name(own%body)%s)// &
                         ' is rigid already: one group per body'// &
                         trim(merge(' and load case', '              ', size(input%cases%name) > 0)))
          return
        else if (any(own%held .neqv. others(j)%held) .or. any(abs(own%point - others(j)%point) > 0)) then
          call input%add(own%line, '&rigid_body: body '//shown(input%bodies%name(own%body)%s)//' has another fix '// &
                         'or point in line '//to_text(others(j)%line)//': they are the same in all load cases')
          return
        end if
      end do
    end subroutine compare

    !> Whether a group of several bodies spares one because it is rigid: not where all are.
    pure function is_spared(line, body, several)
      integer, intent(in) :: line(:), body(:)  !! Lines of the groups, bodies or 0, whether a group names several (n).
      logical, intent(in) :: several(:)
      logical :: is_spared(size(line)), is_rigid(size(line))
      integer :: k
      is_rigid = [(any(case%rigid%body == body(k)), k=1, size(body))]
      do k = 1, size(line)
        is_spared(k) = is_rigid(k) .and. several(k) .and. any(line == line(k) .and. .not. is_rigid .and. body > 0)
      end do
    end function is_spared

    !> Report a group of a rigid body.
    subroutine refuse(line, body, group, reason)
      integer, intent(in) :: line  !! Its line.
      integer, intent(in) :: body  !! Its body; 0 for none.
      character(*), intent(in) :: group, reason  !! Its name, and what is wrong.
      if (body == 0) return
      if (any(case%rigid%body == body)) &
        call input%add(line, group//': body '//shown(input%bodies%name(body)%s)//' is rigid: '//reason)
    end subroutine refuse
  end subroutine read_rigid_bodies

  !> Read one `&rigid_body`.
  subroutine read_rigid(group, input, rigid, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(rigid_input_t), intent(out) :: rigid  !! The motions; incomplete where the group has mistakes.
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that the group names, ascending (n_matched).
    real(dp), allocatable :: rotation(:)
    character(:), allocatable :: key
    logical :: exists(6)
    integer :: k
    call input%begin_action(group, rigid, matched)
    exists = .true.
    if (input%scene%dimension == 2) exists = [.true., .true., .false., .false., .false., .true.]
    if (input%scene%analysis == analysis_axisymmetric) exists = [.false., .true., .false., .false., .false., .false.]
    if (group%is_usable('fix')) call parse_motions(group, input, group%text_of('fix'), exists, rigid%held)
    call read_vector(group, input, 'value', .false., rigid%motion(1:3))
    call read_vector(group, input, 'point', .false., rigid%point)
    call group%reals_of('rotation', rotation)
    if (size(rotation) == 3) then
      rigid%motion(4:6) = rotation
    else if (size(rotation) == 1 .and. input%scene%dimension == 2) then
      rigid%motion(6) = rotation(1)
    else if (size(rotation) > 0) then
      call input%report(group, 'rotation', 'rotation needs 3 values'// &
                        trim(merge(' or that about z', '                ', input%scene%dimension == 2))// &
                        ', got '//to_text(group%count_of('rotation')))
    end if
    if (any(abs(rigid%motion(4:6)) > largest_rotation)) &
      call input%report(group, 'rotation', 'rotation is small, in radians: '// &
                        to_text(maxval(abs(rigid%motion(4:6))))//' is no small rotation, if it is not in degrees')
    do k = 1, 6
      if (rigid%held(k) .or. .not. abs(rigid%motion(k)) > 0) cycle
      key = trim(merge('value   ', 'rotation', k <= 3))
      call input%report(group, key, key//' has '//to_text(rigid%motion(k))//' for '//trim(names(k))// &
                        ', but fix does not name it')
    end do
  end subroutine read_rigid

  !> Read the names of motions.
  subroutine parse_motions(group, input, text, exists, held)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: text  !! Names; blanks and commas may separate them.
    logical, intent(in) :: exists(6)  !! Whether each motion exists in the analysis (6).
    logical, intent(out) :: held(6)  !! Whether each motion is named (6).
    character(:), allocatable :: word
    integer :: i, k
    held = .false.
    i = 1
    do while (i <= len(text))
      if (text(i:i) == ' ' .or. text(i:i) == ',') then
        i = i + 1
        cycle
      end if
      word = lower(text(i:i))
      if (word == 'r') word = lower(text(i:min(i + 1, len(text))))
      k = findloc(names == word, .true., dim=1)
      if (k == 0) then
        call input%report(group, 'fix', 'fix: unknown motion '//shown(text(i:))// ' (motions are x, y, z, rx, ry, rz)')
        return
      else if (.not. exists(k)) then
        call input%report(group, 'fix', 'fix: there is no motion '//word//' in this analysis')
        return
      end if
      held(k) = .true.
      i = i + len(word)
    end do
  end subroutine parse_motions
end module dotyk_input_rigid_bodies
