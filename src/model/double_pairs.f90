!> The same contact named twice: A-B and B-A, one pair twice, or by surfaces of which one is a part of the other.
module dotyk_model_double_pairs
  use dotyk_base_error, only: exit_bad_input, problem_list_t
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_pair_report, only: merged_pair_t
  use dotyk_input_case, only: contact_input_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_pair_list, only: pair_list_t
  implicit none
  private
  public :: merge_double_pairs

contains

  !> Drop pairs that are contained in others with the same settings; refuse those with other settings.
  subroutine merge_double_pairs(file, surfaces, list, merged, problems)
    character(*), intent(in) :: file  !! The namelist file.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(pair_list_t), intent(inout) :: list  !! The pairs; those that are dropped have the group 0 on return.
    type(merged_pair_t), allocatable, intent(out) :: merged(:)  !! Pairs that were dropped (n_merged).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; mistakes are added.
    type(merged_pair_t) :: one
    logical :: overlap, first_in_second, second_in_first
    integer :: k, other, kept, dropped
    allocate (merged(0))
    do k = 1, list%n
      other = k
      do
        if (list%group(k) == 0) exit
        other = list%between(list%contact(k)%body_a, list%contact(k)%body_b, other)
        if (other == 0) exit
        if (list%group(other) == 0) cycle
        call compare(surfaces, list, other, k, overlap, first_in_second, second_in_first)
        if (.not. overlap .or. .not. (first_in_second .or. second_in_first)) cycle
        ! The pair that the user names himself remains, then the larger one, then the first.
        kept = other
        if (.not. second_in_first) kept = k
        if (list%contact(other)%found .neqv. list%contact(k)%found) kept = merge(k, other, list%contact(other)%found)
        dropped = other + k - kept
        if (.not. merge(second_in_first, first_in_second, kept == other)) then
          call problems%add(file//':'//to_text(list%contact(dropped)%line)//': &contact '// &
                            quoted(list%contact(dropped)%name)//' contains the faces of '// &
                            quoted(list%contact(kept)%name)//' (line '//to_text(list%contact(kept)%line)// &
                            "): name each face once, or leave these bodies out by exclude='body - body'", &
                            exit_bad_input)
          cycle
        end if
        if (.not. same_settings(list%contact(kept), list%contact(dropped))) then
          call problems%add(file//':'//to_text(list%contact(dropped)%line)//': &contact '// &
                            quoted(list%contact(dropped)%name)//' is the same contact as '// &
                            quoted(list%contact(kept)%name)//' (line '//to_text(list%contact(kept)%line)// &
                            '), with another gap or theta: remove one of them', exit_bad_input)
          cycle
        end if
        one%name = list%contact(dropped)%name
        one%line = list%contact(dropped)%line
        one%kept = list%contact(kept)%name
        one%kept_line = list%contact(kept)%line
        merged = [merged, one]
        list%group(dropped) = 0
      end do
    end do
  end subroutine merge_double_pairs

  !> Compare the faces of two pairs of the same bodies.
  subroutine compare(surfaces, list, first, second, overlap, first_in_second, second_in_first)
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(pair_list_t), intent(in) :: list  !! The pairs.
    integer, intent(in) :: first  !! A pair.
    integer, intent(in) :: second  !! Another pair of the same bodies, maybe the other way round.
    logical, intent(out) :: overlap  !! Whether they have common facets on both bodies.
    logical, intent(out) :: first_in_second  !! Whether the second pair has all facets of the first one.
    logical, intent(out) :: second_in_first  !! Whether the first pair has all facets of the second one.
    logical, allocatable :: one(:), other(:)
    integer :: side, place_one, place_other, b
    overlap = .true.
    first_in_second = .true.
    second_in_first = .true.
    do side = 1, 2
      b = merge(list%contact(first)%body_a, list%contact(first)%body_b, side == 1)
      place_one = merge(list%place_a(first), list%place_b(first), side == 1)
      place_other = merge(list%place_a(second), list%place_b(second), list%contact(second)%body_a == b)
      ! Parts of the boundary are in one pair only.
      if (place_one == 0 .or. place_other == 0) then
        overlap = .false.
        return
      end if
      associate (body => surfaces(b))
        call body%facets(place_one, one)
        call body%facets(place_other, other)
      end associate
      overlap = overlap .and. any(one .and. other)
      first_in_second = first_in_second .and. all(other .or. .not. one)
      second_in_first = second_in_first .and. all(one .or. .not. other)
      if (.not. overlap) return
    end do
  end subroutine compare

  !> Whether two pairs have the same gap and penalty parameter.
  pure logical function same_settings(a, b) result(same)
    type(contact_input_t), intent(in) :: a  !! A pair.
    type(contact_input_t), intent(in) :: b  !! Another pair.
    same = a%gap_kind == b%gap_kind .and. abs(a%gap - b%gap) <= 0 .and. a%gap_formula == b%gap_formula .and. &
           a%theta_kind == b%theta_kind .and. abs(a%theta - b%theta) <= 0 .and. a%theta_formula == b%theta_formula &
           .and. (a%is_layer .eqv. b%is_layer) .and. a%discretization == b%discretization
  end function same_settings
end module dotyk_model_double_pairs
