!> A load case that is solved ahead, and told later.
!>
!> Load cases are solved several together: once the contact of each is solved, their displacements
!> (`dotyk_control_recovery_ahead`) take one solve of each body with as many right-hand sides, and their error estimates
!> (`dotyk_control_estimates_ahead`) one pass over each mesh. Entries of factors, and what depends on the mesh alone,
!> are read once for all of them.
module dotyk_control_case_ahead
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: text_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_congruent_groups, only: congruent_group_t, congruent_groups
  use dotyk_control_contact_free, only: contact_free_t
  use dotyk_control_contact_problem, only: contact_problem_t, isolated_body_t
  use dotyk_control_kept_estimates, only: kept_estimates_t
  use dotyk_control_mesh_error, only: element_field_t
  use dotyk_elasticity_element_residual, only: residual_data_t
  use dotyk_elasticity_gradient_recovery, only: recovered_strains_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private

  !> Some congruent bodies in a load case.
  type, public :: group_ahead_t
    !> Thermal dilatations, as in `collect_thermal` [].
    real(dp), allocatable :: thermal(:, :, :)
    !> What acts on them.
    type(residual_data_t) :: actions
    !> Strains that were recovered in each material (n_materials).
    type(recovered_strains_t), allocatable :: recovered(:)
  end type group_ahead_t

  !> A load case that is solved ahead.
  type, public :: case_ahead_t
    !> Its number.
    integer :: number = 0
    !> Where the scheme ended.
    type(solver_state_t) :: state
    !> The solution without contact.
    type(contact_free_t) :: free
    !> Displacements of bodies that touch no other (n_bodies).
    type(isolated_body_t), allocatable :: isolated(:)
    !> What the scheme had to tell.
    type(text_t), allocatable :: note(:)
    !> Time that the contact took [s].
    real(dp) :: seconds = 0
    !> Right-hand sides per body that it took.
    integer :: n_sweeps = 0
    !> Displacements and stresses; not allocated once they are taken (n_bodies).
    type(body_solution_t), allocatable :: body(:)
    !> Squared errors of the elements, likewise (n_bodies) [energy].
    type(element_field_t), allocatable :: of_element(:)
    !> Squared energy norm of the solution [energy].
    real(dp) :: norm_square = 0
    !> Those of `congruent_groups` (n_groups).
    type(group_ahead_t), allocatable :: group(:)
  contains
    procedure :: give_estimates => ahead_give_estimates
  end type case_ahead_t

contains

  !> Give the estimates of a case, and leave its recovered strains where nodal stresses look for them.
  subroutine ahead_give_estimates(self, problem, kept, of_element, norm_square)
    class(case_ahead_t), intent(inout) :: self
    !> Bodies and classes.
    type(contact_problem_t), intent(in) :: problem
    !> The recovered strains are those of this case on return.
    type(kept_estimates_t), intent(inout) :: kept
    !> Squared errors of the elements (n_bodies) [energy].
    type(element_field_t), allocatable, intent(out) :: of_element(:)
    !> Squared energy norm of the solution [energy].
    real(dp), intent(out) :: norm_square
    type(congruent_group_t), allocatable :: group(:)
    integer :: g, m
    call move_alloc(self%of_element, of_element)
    norm_square = self%norm_square
    call congruent_groups(problem, group)
    do g = 1, size(group)
      associate (recovery => kept%of_class(group(g)%representative)%recovery)
        do m = 1, size(recovery)
          if (allocated(self%group(g)%recovered(m)%u)) call recovery(m)%take(self%group(g)%recovered(m))
        end do
      end associate
    end do
    deallocate (self%group)
  end subroutine ahead_give_estimates
end module dotyk_control_case_ahead
