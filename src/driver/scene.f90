!> A contact problem on its way from the input to the solution.
module dotyk_driver_scene
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_kept_estimates, only: kept_estimates_t
  use dotyk_control_quantity_error, only: quantity_t
  use dotyk_control_response_choice, only: form_multigrid, form_split, operator_slot_t
  use dotyk_elasticity_body, only: stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_model_contact_cases, only: pair_conditions_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_split_split_scene, only: split_scene_t
  implicit none
  private

  type, public :: scene_t  !! The parts of a contact problem, in the order in which they are made.
    type(contact_problem_t) :: problem  !! Bodies, modes, contact pairs.
    type(stiffness_t), allocatable :: stiffness(:)  !! Of the representatives, until they are factorized (n_bodies).
    type(contact_operator_t) :: operator  !! Rows of B, weights, gaps and theta, until the QP has them.
    type(operator_slot_t), allocatable :: slot(:)  !! Of the representatives, until the compliance has them (n_bodies).
    type(factor_size_t), allocatable :: size_of(:)  !! Sizes of the factors (n_bodies).
    integer :: n_full_solves = 0  !! Solves with whole factors so far.
    integer :: case = 1  !! The load case that acts on it; 0: parts of several.
    logical :: is_rough = .false.  !! Whether the solution without contact is rough: displacements correct it.
    logical :: is_factorized = .false.  !! Whether the factors, or what is in their place, belong to the bodies.
    !> Rigid body modes as the supports leave them; kept where there are several load cases (n_bodies).
    type(body_modes_t), allocatable :: modes(:)
    type(pair_conditions_t), allocatable :: pair_conditions(:)  !! Gaps and theta that cases change (n_pairs).
    type(contact_qp_t) :: qp  !! The quadratic programme.
    type(body_compliance_t) :: compliance  !! Its compliance.
    type(kept_estimates_t) :: kept  !! What error estimates and nodal stresses keep between rounds and load cases.
    type(quantity_t), allocatable :: quantity(:)  !! Quantities with error bars (n_quantities).
    type(split_scene_t) :: split  !! Bodies that all ranks compute together.
  contains
    procedure :: has_multigrid => scene_has_multigrid
    procedure :: is_split => scene_is_split
  end type scene_t

contains

  !> Whether bodies are solved by p-multigrid.
  pure logical function scene_has_multigrid(self) result(has)
    class(scene_t), intent(in) :: self
    has = any(self%size_of%form == form_multigrid)
  end function scene_has_multigrid

  !> Whether all ranks compute each body together.
  pure logical function scene_is_split(self) result(is_split)
    class(scene_t), intent(in) :: self
    is_split = any(self%size_of%form == form_split)
  end function scene_is_split
end module dotyk_driver_scene
