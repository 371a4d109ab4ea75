!> Where bodies move most, and where their stress is greatest, in the log.
module dotyk_log_greatest_values
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: quoted, to_text
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_nodal_stresses, only: nodal_stress_t
  use dotyk_control_pressures, only: nodal_field_t
  use dotyk_elasticity_stress, only: von_mises
  use dotyk_log_load_tables, only: vector_text
  implicit none
  private
  public :: show_greatest_values

contains

  !> The greatest displacement of all nodes, and the greatest von Mises stress, if stresses at nodes are known.
  subroutine show_greatest_values(log, problem, solution, nodal_stress)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    type(nodal_stress_t), intent(in) :: nodal_stress(:)  !! Stresses at their nodes (n_bodies).
    type(nodal_field_t) :: moved(size(solution)), stressed(size(solution))
    integer :: b, i
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      if (allocated(solution(b)%displacement)) moved(b)%value = norm2(solution(b)%displacement, 1)
      if (allocated(nodal_stress(b)%value)) &
        stressed(b)%value = [(von_mises(nodal_stress(b)%value(:, i)), i=1, size(nodal_stress(b)%value, 2))]
    end do
    call show_greatest(log, problem, 'displacement     ', moved)
    call show_greatest(log, problem, 'von Mises        ', stressed)
  end subroutine show_greatest_values

  !> The greatest value at a node, its body and its place; nothing where all are 0.
  subroutine show_greatest(log, problem, word, field)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    character(*), intent(in) :: word  !! What the values are.
    type(nodal_field_t), intent(in) :: field(:)  !! Values at the nodes that this rank holds (n_bodies) [any].
    real(dp) :: greatest(size(field)), along(size(field)), place(3)
    logical, allocatable :: is_there(:)
    integer :: b, i
    greatest = 0
    do b = 1, size(field)
      if (allocated(field(b)%value)) greatest(b) = maxval(field(b)%value)
    end do
    call problem%ranks%share_greatest(greatest)
    b = maxloc(greatest, 1)
    if (.not. greatest(b) > 0) return
    place = 0
    associate (body => problem%body(b))
      allocate (is_there(body%mesh%n_nodes()), source=.false.)
      if (allocated(field(b)%value)) is_there = .not. field(b)%value < greatest(b)
      ! Ranks that share a body must name one node.
      do i = 1, body%dimension
        along = -huge(along)
        if (any(is_there)) along(b) = maxval(body%mesh%x(i, :), mask=is_there)
        call problem%ranks%share_greatest(along)
        place(i) = along(b)
        is_there = is_there .and. .not. body%mesh%x(i, :) < place(i)
      end do
      call log%line('  '//word//'greatest '//to_text(greatest(b), 5)//' in '//quoted(body%name)//' at '// &
                    vector_text(place, body%mesh%diameter()))
    end associate
  end subroutine show_greatest
end module dotyk_log_greatest_values
