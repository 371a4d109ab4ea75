!> Discretizes one contact pair of the input.
module dotyk_model_pair_search
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_options, only: analysis_axisymmetric, gap_formula, scheme_auto, scheme_dual, theta_formula, &
    theta_mesh, theta_relative
  use dotyk_contact_met_points, only: discretize_points, met_point_t
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_contact_pair_discretization, only: discretize_pair
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_input_case, only: case_t, contact_input_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_row_theta, only: set_formula_theta, set_mesh_theta
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: allows_zero_theta, search_pair

contains

  !> Discretize one contact pair.
  subroutine search_pair(case, given, body_a, surface_a, body_b, surface_b, division, pair, error, met)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_input_t), intent(in) :: given  !! `&contact`.
    type(body_t), intent(in) :: body_a  !! Body of the slave side.
    type(body_t), intent(in) :: body_b  !! Body of the master side.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    type(division_t), intent(in) :: division  !! Whether ranks divide the search.
    type(contact_pair_t), intent(out) :: pair  !! The contact pair.
    type(error_t), allocatable, intent(out) :: error  !! Where the gap formula, the surfaces or theta cannot be used.
    type(met_point_t), intent(in), optional :: met(:)  !! Points that are its rows, in place of a search (n).
    type(pair_settings_t) :: settings
    type(formula_t) :: formula
    settings%name = given%name
    settings%body_a = given%body_a
    settings%body_b = given%body_b
    settings%axisymmetric = case%scene%analysis == analysis_axisymmetric
    settings%gap_kind = given%gap_kind
    settings%gap = given%gap
    if (given%gap_kind == gap_formula) then
      call formula%init(given%gap_formula, error)
      if (allocated(error)) return
    end if
    if (given%has_search_radius) settings%search_radius = given%search_radius
    settings%discretization = given%discretization
    settings%geometry = given%geometry
    settings%quadrature = given%quadrature
    settings%theta = given%theta
    settings%division = division
    if (given%theta_kind == theta_relative .and. given%theta > 0) &
      settings%theta = given%theta* &
      (shortest_extent(body_a%mesh)/body_a%young() + shortest_extent(body_b%mesh)/body_b%young())
    if (present(met)) then
      call discretize_points(body_a%mesh, surface_a, body_b%mesh, surface_b, settings, met, pair)
    else
      call discretize_pair(body_a%mesh, surface_a, body_b%mesh, surface_b, settings, formula, pair, error)
    end if
    call formula%destroy()
    if (given%found .and. pair%n_points == 0 .and. allocated(error)) then
      deallocate (error)
      return
    end if
    if (allocated(error)) return
    pair%is_layer = given%is_layer
    if (given%theta_kind == theta_mesh .and. given%theta > 0) then
      call set_mesh_theta(given%theta, body_a, surface_a, body_b, surface_b, pair, error)
    else if (given%theta_kind == theta_formula) then
      call set_formula_theta(given%theta_formula, allows_zero_theta(case, given), pair, error)
    end if
  end subroutine search_pair

  !> Whether the penalty parameter of a pair may be zero.
  pure logical function allows_zero_theta(case, given)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_input_t), intent(in) :: given  !! `&contact`.
    allows_zero_theta = .not. given%is_layer .and. any(case%solver%scheme == [scheme_auto, scheme_dual])
  end function allows_zero_theta
end module dotyk_model_pair_search
