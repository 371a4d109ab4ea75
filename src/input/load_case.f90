!> Load cases as plain data, a part of `dotyk_input_case`.
module dotyk_input_load_case
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: default_gap, default_theta
  implicit none
  private
  public :: applies_in

  type, public :: load_case_input_t  !! `&case`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: name  !! Name of the load case.
    logical :: continues = .false.  !! Whether the solution starts from that of the case before.
  end type load_case_input_t

  type, public :: contact_case_input_t  !! `&contact_case`.
    integer :: line = 0  !! Line of the group.
    logical, allocatable :: in_case(:)  !! Load cases that it belongs to (n_cases).
    character(:), allocatable :: contact  !! Name of contact pairs, maybe with wildcards.
    logical :: has_gap = .false.  !! Whether a gap is given; the three below are as in `contact_input_t`.
    integer :: gap_kind = default_gap
    real(dp) :: gap = 0
    character(:), allocatable :: gap_formula
    !> Whether a penalty parameter is given; the three below are as in `contact_input_t`.
    logical :: has_theta = .false.
    integer :: theta_kind = default_theta
    real(dp) :: theta = 0
    character(:), allocatable :: theta_formula
  end type contact_case_input_t

contains

  !> Whether a group belongs to a load case.
  pure logical function applies_in(in_case, k) result(applies)
    logical, allocatable, intent(in) :: in_case(:)  !! Its component `in_case`.
    integer, intent(in) :: k  !! The load case.
    applies = .true.
    if (allocated(in_case)) applies = in_case(k)
  end function applies_in
end module dotyk_input_load_case
