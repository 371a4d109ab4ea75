!> Discretizes one contact pair of the input.
!>
!> Penalty parameters of the contact rows, theta of (18), from values at the quadrature points: by a formula of the
!> position, or by mesh size, theta = factor (h_a/E_a + h_b/E_b) with the size h of the facet and Young's modulus E at
!> the point. With theta ~ h/E the penalty keeps the order of convergence in h (Chouly and Hild, Appl. Numer. Math. 65,
!> 2013).
module dotyk_model_pair_search
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: is_too_large, size_rule
  use dotyk_base_options, only: analysis_axisymmetric, gap_formula, scheme_auto, scheme_dual, theta_formula, &
    theta_mesh, theta_relative
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_met_points, only: discretize_points, met_point_t
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_contact_pair_discretization, only: discretize_pair
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_input_case, only: case_t, contact_input_t
  use dotyk_mesh_element, only: kind_nodes, quadrature_rule
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: allows_zero_theta, search_pair, set_formula_theta, set_row_theta, set_mesh_theta

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

  !> Set the penalty parameters of a pair by a formula of the position on surface_a.
  subroutine set_formula_theta(text, allows_zero, pair, error)
    character(*), intent(in) :: text  !! The formula, in x, y, z [length/pressure].
    logical, intent(in) :: allows_zero  !! Whether the formula may be zero at points.
    type(contact_pair_t), intent(inout) :: pair  !! The contact pair; its penalty parameters are set.
    !> Allocated where the formula cannot be read, or is negative, zero though it must not be, too large or no number at
    !> a point; names the pair and the point.
    type(error_t), allocatable, intent(out) :: error
    type(formula_t) :: formula
    real(dp) :: at_points(pair%n_points), x(3)
    integer :: i
    call formula%init(text, error)
    if (allocated(error)) return
    x = 0
    do i = 1, pair%n_points
      x(1:pair%dimension) = pair%position(:, i)
      at_points(i) = formula%evaluate(x)
      if (.not. is_wrong(at_points(i))) cycle
      !$omp critical (message)
      call set_error(error, '&contact '//quoted(pair%name)//': theta_formula is '//to_text(at_points(i))//' at ('// &
                     to_text(x(1))//', '//to_text(x(2))//', '//to_text(x(3))//')', exit_bad_input)
      if (at_points(i) < 0) then
        error%message = error%message//'; theta must not be negative'
      else if (pair%is_layer .and. abs(at_points(i)) <= 0) then
        error%message = error%message//'; theta of a layer must be positive'
      else if (abs(at_points(i)) <= 0) then
        error%message = error%message//"; theta = 0 needs scheme='dual'"
      else if (ieee_is_finite(at_points(i))) then
        error%message = error%message//'; '//size_rule
      end if
      !$omp end critical (message)
      exit
    end do
    call formula%destroy()
    if (.not. allocated(error)) call set_row_theta(1.0_dp, at_points, pair)
  contains
    !> Whether a value is no penalty parameter.
    pure logical function is_wrong(value)
      real(dp), intent(in) :: value  !! Value of the formula [length/pressure].
      is_wrong = ieee_is_nan(value) .or. is_too_large(value)
      if (.not. is_wrong) is_wrong = value < 0 .or. (.not. value > 0 .and. .not. allows_zero)
    end function is_wrong
  end subroutine set_formula_theta

  !> Set the penalty parameters of the rows of a pair, means of values at its points.
  subroutine set_row_theta(factor, at_points, pair)
    real(dp), intent(in) :: factor  !! Factor of the values [].
    real(dp), intent(in) :: at_points(:)  !! Values at the points (n_points) [length/pressure].
    type(contact_pair_t), intent(inout) :: pair  !! The contact pair; its penalty parameters are set.
    integer :: i, k
    ! Weights of dual shape functions may be negative: theta of a row is the mean by their magnitudes.
    associate (average => pair%average)
      do i = 1, pair%n_rows
        pair%row_theta(i) = 0
        do k = average%row_start(i), average%row_start(i + 1) - 1
          pair%row_theta(i) = pair%row_theta(i) + abs(average%value(k))*at_points(average%column(k))
        end do
        pair%row_theta(i) = factor*pair%row_theta(i)/ &
                            sum(abs(average%value(average%row_start(i):average%row_start(i + 1) - 1)))
      end do
    end associate
    pair%theta = sum(pair%row_weight*pair%row_theta)/sum(pair%row_weight)
  end subroutine set_row_theta

  !> Set the penalty parameters of a pair.
  subroutine set_mesh_theta(factor, body_a, surface_a, body_b, surface_b, pair, error)
    real(dp), intent(in) :: factor  !! Factor of h/E [].
    type(body_t), intent(in) :: body_a  !! Body of the slave side.
    type(body_t), intent(in) :: body_b  !! Body of the master side.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    type(contact_pair_t), intent(inout) :: pair  !! The contact pair; its penalty parameters are set.
    type(error_t), allocatable, intent(out) :: error  !! Where a modulus field cannot be evaluated.
    real(dp), allocatable :: at_points(:)
    allocate (at_points(pair%n_points), source=0.0_dp)
    call add_side(body_a, surface_a, pair%facet_a, pair%position, at_points, error)
    if (allocated(error)) return
    call add_side(body_b, surface_b, pair%facet_b, pair%position, at_points, error)
    if (allocated(error)) return
    call set_row_theta(factor, at_points, pair)
  end subroutine set_mesh_theta

  !> Add h/E of one side at the points.
  subroutine add_side(body, surface, facet, position, at_points, error)
    type(body_t), intent(in) :: body  !! Body of the side.
    type(surface_t), intent(in) :: surface  !! Surface of the side.
    integer, intent(in) :: facet(:)  !! Facet of each point (n_points).
    real(dp), intent(in) :: position(:, :)  !! Positions of the points (dimension, n_points) [length].
    real(dp), intent(inout) :: at_points(:)  !! Sum of h/E at the points, added to (n_points) [length/pressure].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field cannot be evaluated.
    type(material_field_t) :: stiffness(size(body%material))
    real(dp), allocatable :: size_of(:), point(:, :), weight(:)
    real(dp) :: value(3), young
    integer :: i, m, of_rule
    ! Sizes are computed when needed: most facets may have no points.
    allocate (size_of(surface%n_facets), source=-1.0_dp)
    do m = 1, size(stiffness)
      if (.not. allocated(error)) call stiffness(m)%init(body%material(m), error)
    end do
    value(1) = body%mean_modulus_factor
    young = body%young()
    of_rule = 0
    do i = 1, size(facet)
      if (allocated(error)) exit
      associate (f => facet(i), kind => surface%kind(facet(i)))
        if (size_of(f) < 0) then
          if (kind /= of_rule) call quadrature_rule(kind, 2, point, weight)
          of_rule = kind
          size_of(f) = facet_size(kind, body%mesh%x(:, surface%node(1:kind_nodes(kind), f)), point, weight)
        end if
      end associate
      m = 1
      if (size(stiffness) > 1) then
        ! The material behind the facet; that of the body is compared with the first one.
        m = body%mesh%block(surface%block(facet(i)))%material
        value(1) = 1
      end if
      if (.not. stiffness(m)%constant) call stiffness(m)%factor_at(position(:, i), value(1), error)
      if (allocated(error)) exit
      if (m > 1) value(1) = value(1)*(body%material(m)%least_young/body%material(1)%least_young)
      ! A modulus that vanishes on the surface must not make theta infinite.
      at_points(i) = at_points(i) + size_of(facet(i))/(young*max(value(1)/body%mean_modulus_factor, 1.0e-3_dp))
    end do
    do m = 1, size(stiffness)
      call stiffness(m)%destroy()
    end do
  end subroutine add_side

  !> Size of a facet: its length, or the root of its area [length].
  real(dp) function facet_size(kind, x, point, weight) result(length)
    integer, intent(in) :: kind  !! Element kind of the facet.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the facet (dimension, n_nodes) [length].
    real(dp), intent(in) :: point(:, :)  !! Points of a rule (dimension-1, n_points) [].
    real(dp), intent(in) :: weight(:)  !! Its weights (n_points) [].
    real(dp) :: position(size(x, 1)), normal(size(x, 1)), jacobian
    integer :: q
    length = 0
    do q = 1, size(weight)
      call facet_geometry(kind, size(x, 1), x, point(:, q), position, normal, jacobian)
      length = length + weight(q)*jacobian
    end do
    if (size(x, 1) == 3) length = sqrt(length)
  end function facet_size
end module dotyk_model_pair_search
