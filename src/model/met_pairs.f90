!> Contact pairs of the points at which bodies met beside their contact rows in an earlier solution.
module dotyk_model_met_pairs
  use dotyk_base_error, only: error_t
  use dotyk_base_options, only: gap_geometry
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t, contact_input_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_pair_list, only: exclusion_of
  use dotyk_model_pair_search, only: search_pair
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: add_met_pairs

contains

  !> Append a pair for each two bodies that met, with the penalty parameter of a pair that they have, or of the first.
  subroutine add_met_pairs(case, met, body, surface_a, surface_b, pair, error)
    type(case_t), intent(inout) :: case  !! The case; its contacts get those of the new pairs.
    type(met_point_t), intent(in) :: met(:)  !! The points (n).
    type(body_t), intent(in) :: body(:)  !! Assembled bodies (n_bodies).
    type(surface_t), allocatable, intent(inout) :: surface_a(:)  !! Slave surface of each pair (n_pairs).
    type(surface_t), allocatable, intent(inout) :: surface_b(:)  !! Master surface of each pair (n_pairs).
    type(contact_pair_t), allocatable, intent(inout) :: pair(:)  !! Contact pairs (n_pairs).
    type(error_t), allocatable, intent(out) :: error  !! As in `search_pair`.
    type(contact_input_t) :: given
    type(contact_pair_t) :: new
    type(surface_t) :: of_a, of_b
    logical :: of_couple(size(met)), is_left(size(met))
    integer :: i, k, a, b
    is_left = .true.
    do i = 1, size(met)
      if (.not. is_left(i)) cycle
      a = met(i)%body_a
      b = met(i)%body_b
      of_couple = met%body_a == a .and. met%body_b == b
      is_left = is_left .and. .not. of_couple
      k = max(1, findloc(min(pair%body_a, pair%body_b) == min(a, b) .and. max(pair%body_a, pair%body_b) == max(a, b), &
                         .true., dim=1))
      given = case%contact(k)
      if (allocated(given%exclude)) then
        if (exclusion_of(given%exclude, case%body(a), case%body(b)) > 0) cycle
      end if
      given%name = case%body(a)%name//' - '//case%body(b)%name//' (corners)'
      given%found = .true.
      given%body_a = a
      given%body_b = b
      given%gap_kind = gap_geometry
      given%is_layer = .false.
      call extract_boundary(body(a)%mesh, of_a)
      call extract_boundary(body(b)%mesh, of_b)
      call search_pair(case, given, body(a), of_a, body(b), of_b, division_t(), new, error, pack(met, of_couple))
      if (allocated(error)) return
      case%contact = [case%contact, given]
      surface_a = [surface_a, of_a]
      surface_b = [surface_b, of_b]
      pair = [pair, new]
    end do
  end subroutine add_met_pairs
end module dotyk_model_met_pairs
