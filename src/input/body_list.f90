!> Materials and bodies of a namelist file: copies have bodies of their own, and bolts cut theirs.
module dotyk_input_body_list
  use dotyk_base_files, only: is_cad_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: shown, to_text
  use dotyk_input_bodies, only: read_body
  use dotyk_input_case, only: body_input_t, case_t
  use dotyk_input_cut_bodies, only: cut_bodies
  use dotyk_input_materials, only: read_material
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_repeat, only: append_bodies, name_copies, repeat_body
  use dotyk_input_values, only: is_given, names_t, pick_groups, report
  implicit none
  private
  public :: read_bodies

contains

  !> Read the materials and bodies.
  subroutine read_bodies(groups, materials, mesh_expected, problems, bodies, case)
    !> Groups of the file (n_groups).
    type(group_t), intent(in) :: groups(:)
    !> Names of the materials.
    type(names_t), intent(in) :: materials
    !> Whether the scene has no mesh, so that each body needs one.
    logical, intent(in) :: mesh_expected
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> Names of the bodies: of the groups in, of all bodies out.
    type(names_t), intent(inout) :: bodies
    !> The case with its scene; gets materials and bodies.
    type(case_t), intent(inout) :: case
    type(body_input_t) :: body
    type(body_input_t), allocatable :: copies(:)
    integer, allocatable :: picked(:)
    integer :: i, n
    call pick_groups(groups, 'material', picked)
    allocate (case%material(size(picked)))
    do i = 1, size(picked)
      call read_material(groups(picked(i)), problems, case%material(i))
    end do
    call pick_groups(groups, 'body', picked)
    allocate (case%body(size(picked)))
    n = 0
    do i = 1, size(picked)
      call read_body(groups(picked(i)), materials, case%scene, case%directory, mesh_expected, problems, body)
      call repeat_body(groups(picked(i)), case%scene, problems, body, copies)
      call append_bodies(case%body, n, copies)
    end do
    case%body = case%body(:n)
    if (n > size(picked)) call name_copies(case%body, problems, bodies)
    ! Others may be a cause, such as a wrong name.
    if (problems%count == 0) call refuse_doubles(case%body, problems)
    call cut_bodies(groups, case%scene, problems, case%body, bodies)
    call check_mesh_keys(groups, case%body, problems)
  end subroutine read_bodies

  !> Refuse bodies that are the same volume of a mesh in one place; copies of one group are compared already.
  subroutine refuse_doubles(body, problems)
    !> Bodies (n_bodies).
    type(body_input_t), intent(in) :: body(:)
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> Different for different places and names, as a rule.
    real(dp), parameter :: factor(3) = [0.7310585786_dp, 0.2689414213_dp, 0.5772156649_dp]
    real(dp) :: key(size(body))
    integer :: order(size(body)), i, j, k, b, c
    do b = 1, size(body)
      key(b) = dot_product(factor, body(b)%at)
      do k = 1, len(body(b)%volume)
        key(b) = key(b) + ichar(body(b)%volume(k:k))*(1 + factor(1)*k)
      end do
    end do
    call sort_order(key, order)
    do i = 2, size(body)
      do j = i - 1, 1, -1
        if (key(order(j)) < key(order(i))) exit
        b = max(order(i), order(j))
        c = min(order(i), order(j))
        if (body(b)%line == body(c)%line .or. any(abs(body(b)%at - body(c)%at) > 0)) cycle
        if (abs(body(b)%angle - body(c)%angle) > 0 .or. body(b)%mesh /= body(c)%mesh) cycle
        if (abs(body(b)%angle) > 0 .and. any(abs(body(b)%axis - body(c)%axis) > 0)) cycle
        if (len(body(b)%volume) == 0 .or. .not. body(b)%has_shape_of(body(c))) cycle
        call problems%add(body(b)%line, '&body: '//shown(body(b)%name)//' is the same volume in the same place as '// &
                          shown(body(c)%name)//' of line '//to_text(body(c)%line)//': a volume is one body; move it '// &
                          'by at, or remove one of them')
        exit
      end do
    end do
  end subroutine refuse_doubles

  !> Keys of `&scene` for CAD files mean nothing where no body has one.
  subroutine check_mesh_keys(groups, body, problems)
    !> Groups of the file (n_groups).
    type(group_t), intent(in) :: groups(:)
    !> Bodies (n_bodies).
    type(body_input_t), intent(in) :: body(:)
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    character(10), parameter :: keys(2) = ['mesh_size ', 'mesh_order']
    integer, allocatable :: picked(:)
    integer :: b, k
    call pick_groups(groups, 'scene', picked)
    if (size(picked) == 0 .or. any([(is_cad_file(body(b)%mesh), b=1, size(body))])) return
    do k = 1, size(keys)
      if (is_given(groups(picked(1)), trim(keys(k)))) &
        call report(problems, groups(picked(1)), trim(keys(k)), trim(keys(k))//' is for CAD files, and no body has '// &
                    'one: sizes and orders of .geo files are in them')
    end do
  end subroutine check_mesh_keys
end module dotyk_input_body_list
