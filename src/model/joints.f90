!> Bodies that nobody can have meant, or that are told in the log: those whose parts do not hang together, and those
!> that are given twice.
module dotyk_model_joints
  use dotyk_base_error, only: error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_input_case, only: body_input_t, case_t
  use dotyk_mesh_joints, only: joints_t
  implicit none
  private
  public :: check_joints, describe_joints, add_remark, refuse_doubles

  integer, parameter :: most_lines = 12  !! Bodies of several parts with a line each.

contains

  !> Refuse a body with overlapping or mismatching elements, or with a crack that is not meant.
  subroutine check_joints(body, joints, error)
    type(body_input_t), intent(in) :: body  !! `&body`.
    type(joints_t), intent(in) :: joints  !! How the parts of its volume hang together.
    type(error_t), allocatable, intent(out) :: error  !! Set for a body that is refused.
    character(:), allocatable :: start
    start = "body '"//body%name//"', mesh '"//body%mesh//"': "
    if (allocated(joints%fault)) then
      call set_error(error, start//joints%fault)
    else if (allocated(joints%crack) .and. .not. body%crack) then
      call set_error(error, start//joints%crack//': the body is disconnected there. Join its parts in gmsh: '// &
                     '`Coherence;` after the geometry or `Coherence Mesh;` after the mesh; or make them separate '// &
                     'bodies; crack=.true. keeps a crack that is meant')
    end if
  end subroutine check_joints

  !> Tell of parts, cracks and slits of a volume.
  subroutine describe_joints(case, joints, n_bodies, b, remarks)
    type(case_t), intent(in) :: case  !! The case.
    type(joints_t), intent(in) :: joints  !! How those of the volume hang together.
    integer, intent(in) :: n_bodies  !! Number of bodies that use it.
    integer, intent(in) :: b  !! The first of them.
    type(text_t), allocatable, intent(inout) :: remarks(:)  !! Lines for the log; completed (n_remarks).
    character(:), allocatable :: name, text
    if (allocated(joints%fault)) return
    if (allocated(joints%crack) .and. .not. case%body(b)%crack) return
    name = "body '"//case%body(b)%name//"'"
    if (n_bodies > 1) name = name//' and '//to_text(n_bodies - 1)//' more of the same mesh'
    if (allocated(joints%slit)) call add_remark(remarks, 'warning: '//name//': '//joints%slit)
    if (allocated(joints%crack)) call add_remark(remarks, name//': cracked, as crack=.true. says: '// joints%crack)
    if (joints%n_pieces == 1 .or. size(remarks) > most_lines) return
    if (joints%n_parts > 1) then
      text = name//': '//to_text(joints%n_parts)//' unconnected parts'
      if (joints%n_pieces > joints%n_parts) &
        text = text//' of '//to_text(joints%n_pieces)//' pieces; edges or corners alone join some, as hinges do'
    else
      text = 'warning: '//name//': edges or corners alone join its '//to_text(joints%n_pieces)// ' pieces, as hinges do'
    end if
    if (size(remarks) == most_lines) text = 'further bodies consist of several parts'
    call add_remark(remarks, text)
  end subroutine describe_joints

  !> Add a line for the log.
  subroutine add_remark(remarks, text)
    type(text_t), allocatable, intent(inout) :: remarks(:)  !! Lines so far (n_remarks).
    character(*), intent(in) :: text  !! The line.
    type(text_t), allocatable :: more(:)
    integer :: n
    n = size(remarks)
    allocate (more(n + 1))
    more(:n) = remarks
    more(n + 1)%s = text
    call move_alloc(more, remarks)
  end subroutine add_remark

  !> Refuse bodies that are the same volume of a mesh in one place; copies of one group are compared already.
  subroutine refuse_doubles(case, error)
    type(case_t), intent(in) :: case  !! The case.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where there are some; names both lines.
    type(problem_list_t) :: problems
    real(dp), parameter :: factor(3) = [0.7310585786_dp, 0.2689414213_dp, 0.5772156649_dp]  !! Usually unique.
    real(dp) :: key(size(case%body))
    integer :: order(size(case%body)), i, j, k, b, c
    associate (body => case%body)
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
          call problems%add(case%file//':'//to_text(body(b)%line)//': &body: '//quoted(body(b)%name)// &
                            ' is the same volume in the same place as '//quoted(body(c)%name)//' of line '// &
                            to_text(body(c)%line)//': a volume is one body; move it by at, or remove one of them', &
                            exit_bad_input)
          exit
        end do
      end do
    end associate
    call problems%raise(error)
  end subroutine refuse_doubles
end module dotyk_model_joints
