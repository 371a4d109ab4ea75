!> Materials and bodies of a namelist file: copies have bodies of their own, and bolts cut theirs.
module dotyk_input_body_list
  use dotyk_base_files, only: is_cad_file
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
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(names_t), intent(in) :: materials  !! Names of the materials.
    logical, intent(in) :: mesh_expected  !! Whether the scene has no mesh, so that each body needs one.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(names_t), intent(inout) :: bodies  !! Names of the bodies: of the groups in, of all bodies out.
    type(case_t), intent(inout) :: case  !! The case with its scene; gets materials and bodies.
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
    call cut_bodies(groups, case%scene, problems, case%body, bodies)
    call check_mesh_keys(groups, case%body, problems)
  end subroutine read_bodies

  !> Keys of `&scene` for CAD files mean nothing where no body has one.
  subroutine check_mesh_keys(groups, body, problems)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(body_input_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
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
