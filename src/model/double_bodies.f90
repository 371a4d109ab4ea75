!> Bodies that are given twice.
module dotyk_model_double_bodies
  use dotyk_base_error, only: error_t, exit_bad_input, problem_list_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: quoted, to_text
  use dotyk_input_case, only: case_t
  implicit none
  private
  public :: refuse_doubles

contains

  !> Refuse bodies that are the same volume of a mesh in one place; copies of one group are compared already.
  subroutine refuse_doubles(case, error)
    type(case_t), intent(in) :: case  !! The case.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where there are some; names both lines.
    type(problem_list_t) :: problems
    !> Different for different places and names, as a rule.
    real(dp), parameter :: factor(3) = [0.7310585786_dp, 0.2689414213_dp, 0.5772156649_dp]
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
end module dotyk_model_double_bodies
