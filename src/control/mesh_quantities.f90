!> Quantities that are not linear in displacements and contact forces: areas, mean and greatest contact pressures,
!> greatest displacements and von Mises stresses. They have no dual solution; what they change by from mesh to mesh
!> tells how far they are from their limit.
!>
!> With `r = (e_k/e_(k-1))^q`, e the error of the mesh and q the order of that of the quantity in e, the limit is
!> `|J_k - J_(k-1)| r/(1 - r)` away (Richardson). Two values may be near each other by chance: the error bar is at least
!> r times that of the mesh before, and the relative error that the mesh makes elsewhere, too: e^2 in energies, and
!> 1.5 e^(4/3) in areas of Hertzian contacts. Those of greatest values count when a further mesh has confirmed them: the
!> pressure at a sharp edge, for example, has no limit.
module dotyk_control_mesh_quantities
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: last_linear_quantity, quantity_area, quantity_mean_pressure, quantity_mises, &
    quantity_of_pair, quantity_peak, quantity_travel
  use dotyk_base_thresholds, only: rounding
  use dotyk_control_body_solution, only: displacements_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_kept_estimates, only: kept_estimates_t
  use dotyk_control_nodal_stresses, only: nodal_stress_t, recover_nodal_stresses
  use dotyk_control_pressures, only: nodal_field_t, pair_solution_t, project_pressures
  use dotyk_control_quantity_error, only: bar_is_known, bar_no_contact, bar_no_limit, bar_one_mesh, bar_zero, &
    quantity_errors_t, quantity_t
  use dotyk_elasticity_nodal_stress, only: von_mises
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private

  type :: past_t  !! A quantity on a mesh.
    character(:), allocatable :: name  !! Its name.
    integer :: case = 0  !! The load case.
    real(dp) :: value = 0, change = 0  !! Its value, and the change from the mesh before [any].
    real(dp) :: bar = -1  !! Its error bar; negative where there is none [any].
    real(dp) :: error = 0  !! Error of the mesh [].
    !> Meshes in succession that it has left the error bar of the mesh before with, on one side, by more than the error
    !> that is asked for.
    integer :: n_left = 0
  end type past_t

  type, public :: quantity_history_t  !! Quantities on the meshes so far.
    type(past_t), allocatable, private :: last(:), now(:)  !! On the mesh before, and on the present one (n).
  contains
    procedure :: begin_mesh => history_begin_mesh
    procedure :: compare => history_compare
  end type quantity_history_t

  public :: find_mesh_quantities

  !> A quantity that leaves its error bars so many times in succession, on one side, has no limit.
  integer, parameter :: most_left = 3
  !> Order of quantities in the error of the mesh: that of the energy; at contact the edge between two rows makes it
  !> one of the order 3/2 in the size of the elements, and pressures and areas errors of the order 2.
  real(dp), parameter :: order = 2, order_at_contact = 4.0_dp/3
  real(dp), parameter :: least_of_areas = 1.5_dp  !! Relative errors of areas over e^(4/3): most are 0.8 to 1.4 [].

contains

  !> Values of the quantities that have no dual solution. The load case acts on the bodies.
  subroutine find_mesh_quantities(problem, qp, quantity, state, kept, displacements, errors, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(quantity_t), intent(in) :: quantity(:)  !! The quantities (n).
    type(solver_state_t), intent(in) :: state  !! The solution.
    type(kept_estimates_t), intent(inout) :: kept  !! What estimates keep.
    type(displacements_t), intent(inout) :: displacements  !! Known; nodal stresses take recovered strains.
    type(quantity_errors_t), intent(inout) :: errors  !! Gets the values.
    !> Allocated where pressures cannot be projected, or a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    type(pair_solution_t), allocatable :: pair(:)
    type(nodal_field_t), allocatable :: nodal(:)
    type(nodal_stress_t), allocatable :: stress(:)
    integer :: i, k
    if (any([(quantity_of_pair(quantity(i)%kind) .and. quantity(i)%kind > last_linear_quantity, &
              i=1, size(quantity))])) &
      call project_pressures(problem, qp%pair_first_row, state%pressure, qp%of_vertices(state%penetration), pair, &
                             nodal, error)
    if (allocated(error)) return
    if (any(quantity%kind == quantity_mises)) call recover_nodal_stresses(problem, displacements, kept, stress, error)
    if (allocated(error)) return
    do i = 1, size(quantity)
      associate (of => errors%of(i), p => quantity(i)%pair, b => quantity(i)%body)
        select case (quantity(i)%kind)
        case (quantity_area)
          of%value = pair(p)%area
        case (quantity_peak)
          of%value = pair(p)%peak
        case (quantity_mean_pressure)
          if (pair(p)%area > 0) of%value = sum(problem%pair(p)%row_weight*pair(p)%pressure)/pair(p)%area
        case (quantity_mises)
          of%value = maxval([(von_mises(stress(b)%value(:, k)), k=1, size(quantity(i)%node))], quantity(i)%node)
        case (quantity_travel)
          of%value = maxval(norm2(displacements%body(b)%displacement, 1), quantity(i)%node)
        case default
          cycle
        end select
        of%order = merge(order_at_contact, order, p > 0)
        if (any(quantity(i)%kind == [quantity_area, quantity_mean_pressure])) then
          of%least = least_of_areas
          of%least_order = order_at_contact
        end if
        of%is_confirmed = .not. any(quantity(i)%kind == [quantity_peak, quantity_mises])
        of%why_unknown = bar_one_mesh
        if (.not. abs(of%value) > 0) of%why_unknown = merge(bar_no_contact, bar_zero, p > 0)
      end associate
    end do
  end subroutine find_mesh_quantities

  !> A new mesh begins.
  subroutine history_begin_mesh(self)
    class(quantity_history_t), intent(inout) :: self
    if (.not. allocated(self%now)) allocate (self%now(0))
    call move_alloc(self%now, self%last)
    allocate (self%now(0))
  end subroutine history_begin_mesh

  !> Compare with the mesh before: error bars of quantities that have no dual solution.
  subroutine history_compare(self, case, error_of_mesh, asked, errors)
    class(quantity_history_t), intent(inout) :: self
    integer, intent(in) :: case  !! The load case.
    real(dp), intent(in) :: error_of_mesh  !! That which the meshes are made for; NaN where it is not known [].
    real(dp), intent(in) :: asked  !! Relative error that is asked for [].
    type(quantity_errors_t), intent(inout) :: errors  !! The quantities; get error bars.
    type(past_t) :: new
    real(dp) :: ratio
    integer :: i, j
    do i = 1, size(errors%of)
      associate (of => errors%of(i))
        if (of%why_unknown /= bar_one_mesh .or. .not. error_of_mesh > 0) cycle
        new = past_t(case=case, value=of%value, error=error_of_mesh)
        new%name = of%name
        do j = 1, size(self%last)
          if (self%last(j)%case == case .and. self%last(j)%name == of%name) exit
        end do
        if (j <= size(self%last)) then
          associate (past => self%last(j))
            ratio = (error_of_mesh/past%error)**of%order
            new%change = of%value - past%value
            if (abs(new%change) <= rounding*abs(of%value)) ratio = 0
            if (ratio < 1) then
              new%bar = max(abs(new%change)*ratio/(1 - ratio), ratio*past%bar, rounding*abs(of%value), &
                            of%least*error_of_mesh**of%least_order*abs(of%value))
              if (past%bar > 0) then
                if (abs(new%change) <= max(past%bar, asked*abs(of%value))) then
                  of%is_confirmed = .true.
                else if (new%change*past%change > 0) then
                  new%n_left = past%n_left + 1
                end if
              end if
              of%why_unknown = merge(bar_is_known, bar_no_limit, new%n_left < most_left)
              if (of%why_unknown == bar_is_known) of%error = new%bar
            else
              new = past
            end if
          end associate
        end if
        self%now = [self%now, new]
      end associate
    end do
  end subroutine history_compare
end module dotyk_control_mesh_quantities
