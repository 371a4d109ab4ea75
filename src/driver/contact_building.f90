!> Contact of the bodies of a scene: pairs, ties, and their rows.
module dotyk_driver_contact_building
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_control_contact_problem, only: build_rows
  use dotyk_driver_scene, only: scene_t
  use dotyk_input_case, only: case_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_contact_cases, only: check_contact_cases
  use dotyk_model_pairs, only: find_pairs
  use dotyk_model_ties, only: find_ties
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: meet
  implicit none
  private
  public :: build_contact

contains

  !> Find contact pairs and ties, and make their rows.
  subroutine build_contact(case, surfaces, scene, error)
    type(case_t), intent(inout) :: case  !! The case; its contacts become the pairs that they stand for.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(scene_t), intent(inout) :: scene  !! The scene with its bodies; gets pairs, ties and rows.
    !> Allocated where a pair, a tie or a load case is wrong, or after an interrupt.
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    associate (problem => scene%problem)
      call find_pairs(case, problem%body, surfaces, problem%surface_a, problem%surface_b, problem%pair, problem%found, &
                      error)
      call meet()
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call check_contact_cases(case, problem, scene%pair_conditions, error)
      if (allocated(error)) return
      call find_ties(case, problem%body, surfaces, problem%pair, problem%surface_a, problem%surface_b, problem%tie, &
                     error)
      if (allocated(error)) return
      call build_rows(problem, case%scene%dimension, scene%operator, divided=n_ranks() > 1)
      do i = 1, size(problem%body)
        associate (block => scene%operator%block(i))
          if (n_ranks() > 1) block%whole_node = problem%body(i)%mesh%whole_nodes(block%contact_node)
        end associate
      end do
    end associate
  end subroutine build_contact
end module dotyk_driver_contact_building
