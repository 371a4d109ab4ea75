!> Contact of the bodies of a scene: pairs, ties, and their rows.
module dotyk_driver_contact_building
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_text, only: to_text
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_control_contact_problem, only: build_rows, contact_problem_t
  use dotyk_control_seams, only: pair_of_other_roles
  use dotyk_driver_scene, only: scene_t
  use dotyk_input_case, only: case_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_contact_cases, only: check_contact_cases
  use dotyk_model_met_pairs, only: add_met_pairs
  use dotyk_model_pair_search, only: search_pair
  use dotyk_model_pairs, only: find_pairs
  use dotyk_model_ties, only: find_ties
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_division, only: division_t
  use dotyk_ranks_exchange, only: meet
  implicit none
  private
  public :: build_contact

contains

  !> Find contact pairs and ties, and make their rows.
  subroutine build_contact(case, surfaces, met, scene, error)
    type(case_t), intent(inout) :: case  !! The case; its contacts become the pairs that they stand for.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(met_point_t), intent(in) :: met(:)  !! Points at which bodies met beside their contact rows before (n).
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
      call find_ties(case, problem%body, surfaces, problem%pair, problem%surface_a, problem%surface_b, problem%tie, &
                     error)
      if (.not. allocated(error)) call align_roles(case, problem, error)
      if (.not. allocated(error)) call add_met_pairs(case, met, problem%body, problem%surface_a, problem%surface_b, &
                                                     problem%pair, error)
      if (.not. allocated(error)) call check_contact_cases(case, problem, scene%pair_conditions, error)
      if (allocated(error)) return
      call build_rows(problem, case%scene%dimension, scene%operator, divided=n_ranks() > 1)
      do i = 1, size(problem%body)
        associate (block => scene%operator%block(i))
          if (n_ranks() > 1) block%whole_node = problem%body(i)%mesh%whole_nodes(block%contact_node)
        end associate
      end do
    end associate
  end subroutine build_contact

  !> Exchange the sides of a pair in which contact goes on across a tie with other roles: both tied bodies are slaves of
  !> the third one then, and their pressures one function. Rigid bodies remain masters.
  subroutine align_roles(case, problem, error)
    type(case_t), intent(inout) :: case  !! The case, with one contact for each pair.
    type(contact_problem_t), intent(inout) :: problem  !! With pairs and ties.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the pair cannot be discretized; names the line.
    type(surface_t) :: surface
    logical :: is_exchanged(size(problem%pair))
    integer :: k, p, q
    is_exchanged = .false.
    ! Pairs may be divided over ranks.
    if (n_ranks() > 1) return
    do k = 1, problem%n_ties()
      do p = 1, size(problem%pair)
        q = pair_of_other_roles(problem%pair, problem%tie(k), p)
        if (q == 0 .or. is_exchanged(p)) cycle
        if (is_exchanged(q) .or. problem%body(problem%pair(q)%body_b)%constraint%rigid%is_set) cycle
        is_exchanged(q) = .true.
        call case%contact(q)%exchange()
        surface = problem%surface_a(q)
        problem%surface_a(q) = problem%surface_b(q)
        problem%surface_b(q) = surface
        associate (given => case%contact(q))
          call search_pair(case, given, problem%body(given%body_a), problem%surface_a(q), problem%body(given%body_b), &
                           problem%surface_b(q), division_t(), problem%pair(q), error)
          if (allocated(error)) call add_context(error, case%file//':'//to_text(given%line)//': ')
        end associate
        if (allocated(error)) return
        problem%pair(q)%other_roles = problem%tie(k)%name
      end do
    end do
  end subroutine align_roles
end module dotyk_driver_contact_building
