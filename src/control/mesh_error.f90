!> Discretization errors of all bodies: congruent ones together, in the axes of the representative.
module dotyk_control_mesh_error
  use dotyk_base_allowance, only: allowance_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_congruent_groups, only: congruent_group_t, congruent_groups
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_kept_estimates, only: kept_class_t, kept_estimates_t
  use dotyk_control_residual_actions, only: collect_actions
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_discretization_error, only: estimate_discretization_errors
  use dotyk_elasticity_node_constants, only: thermal_dilatation
  use dotyk_elasticity_element_residual, only: residual_data_t
  use dotyk_elasticity_residual_check, only: check_by_residuals
  use dotyk_ranks_communication, only: n_local_ranks
  implicit none
  private

  !> One number for each element of a body.
  type, public :: element_field_t
    !> In the order of the blocks (n_elements).
    real(dp), allocatable :: value(:)
  end type element_field_t

  public :: collect_thermal, estimate_mesh_errors, hold_against_residuals, to_representative

  !> Elements with a squared error below this fraction of the mean of all keep that of their recovered strains.
  real(dp), parameter, public :: least_share = 0.01_dp
  !> Fraction of the memory that is left which tractions of faces take at most [].
  real(dp), parameter :: most_of_memory = 0.125_dp

contains

  !> Squared errors of all elements, and the squared norm of the solution.
  subroutine estimate_mesh_errors(problem, first_row, m, solution, kept, of_element, norm_square, error)
    !> Bodies, classes and pairs.
    type(contact_problem_t), intent(in) :: problem
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> Pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> With displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> What does not depend on the loads; the recovered strains are those of the solution on return.
    type(kept_estimates_t), intent(inout) :: kept
    !> Elements in the order of the blocks; not allocated for bodies of other ranks (n_bodies) [energy].
    type(element_field_t), allocatable, intent(out) :: of_element(:)
    !> Squared energy norm of the solution [energy].
    real(dp), intent(out) :: norm_square
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    type(congruent_group_t), allocatable :: group(:)
    real(dp) :: of_body(size(problem%body)), of_elements(size(problem%body)), least
    integer :: g, i, n, part
    allocate (of_element(size(problem%body)))
    call kept%init(size(problem%body))
    call congruent_groups(problem, group)
    of_body = 0
    least = 0
    n = 0
    ! The residuals after all recovered strains: elements without a share in the error need none.
    do part = 1, 2
      do g = 1, size(group)
        associate (some => group(g)%body, first => group(g)%representative)
          if (part == 1) then
            call kept%of_class(first)%init(problem%body(first))
            call estimate_some(problem, some, solution, kept%of_class(first), of_element, of_body, error)
          else
            call check_some(problem, some, first_row, m, solution, least, kept%of_class(first), of_element, error)
          end if
        end associate
        if (allocated(error)) return
      end do
      if (part == 2) exit
      of_elements = 0
      do i = 1, size(of_element)
        if (allocated(of_element(i)%value)) of_elements(i) = sum(of_element(i)%value)
        n = n + problem%body(i)%mesh%n_whole_elements()
      end do
      call problem%ranks%share_sum(of_elements)
      least = least_share*sum(of_elements)/n
    end do
    call problem%ranks%share_sum(of_body)
    norm_square = sum(of_body)
  end subroutine estimate_mesh_errors

  !> Hold the errors of some congruent bodies against the residuals of their elements.
  subroutine check_some(problem, alike, first_row, m, solution, least, kept, of_element, error)
    !> Bodies, classes and pairs.
    type(contact_problem_t), intent(in) :: problem
    !> Indices of the bodies (n).
    integer, intent(in) :: alike(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> Pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Solutions of all bodies, with displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Elements with smaller squared errors are left alone [energy].
    real(dp), intent(in) :: least
    !> What does not depend on the loads.
    type(kept_class_t), intent(inout) :: kept
    !> Squared errors; those of these bodies are changed (n_bodies) [energy].
    type(element_field_t), intent(inout) :: of_element(:)
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    type(residual_data_t) :: data
    real(dp), allocatable :: u(:, :, :), square(:, :)
    integer :: i
    allocate (square(size(alike), problem%body(problem%classes%first(alike(1)))%mesh%n_elements()), source=0.0_dp)
    do i = 1, size(alike)
      if (problem%ranks%is_own(alike(i))) square(i, :) = of_element(alike(i))%value
    end do
    if (all(square <= least)) return
    call collect_actions(problem, alike, first_row, m, solution, data)
    call to_representative(problem, alike, solution, u)
    call hold_against_residuals(problem%body(problem%classes%first(alike(1))), data, u, &
                                spread(least, 1, size(alike)), kept, square, error)
    if (allocated(error)) return
    do i = 1, size(alike)
      if (problem%ranks%is_own(alike(i))) of_element(alike(i))%value = square(i, :)
    end do
  end subroutine check_some

  !> Hold the errors of bodies of one mesh against the residuals of their elements.
  subroutine hold_against_residuals(first, data, u, least, kept, square, error)
    !> The representative.
    type(body_t), intent(in) :: first
    !> What acts on the bodies.
    type(residual_data_t), intent(in) :: data
    !> Their displacements in its axes (n, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> Elements of each with smaller squared errors are left alone (n) [energy].
    real(dp), intent(in) :: least(:)
    !> What does not depend on the loads.
    type(kept_class_t), intent(inout) :: kept
    !> Squared errors of the elements (n, n_elements) [energy].
    real(dp), intent(inout) :: square(:, :)
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    type(allowance_t) :: face_room
    type(memory_t) :: memory
    memory = memory_now()
    if (memory%is_known) face_room%left = int(most_of_memory*memory%left/n_local_ranks(), int64)
    call check_by_residuals(first%mesh, first%analysis, first%material, data, u, least, kept%factor, kept%room, &
                            face_room, square, error)
  end subroutine hold_against_residuals

  !> Displacements of congruent bodies in the axes of their representative; 0 for those of other ranks.
  subroutine to_representative(problem, alike, solution, u)
    !> Bodies, classes and ranks.
    type(contact_problem_t), intent(in) :: problem
    !> Indices of the bodies (n).
    integer, intent(in) :: alike(:)
    !> Solutions of all bodies, with displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Displacements (n, dim, n_nodes) [length].
    real(dp), allocatable, intent(out) :: u(:, :, :)
    integer :: d, i
    associate (first => problem%body(problem%classes%first(alike(1))))
      d = first%dimension
      allocate (u(size(alike), d, first%mesh%n_nodes()), source=0.0_dp)
    end associate
    do i = 1, size(alike)
      if (.not. problem%ranks%is_own(alike(i))) cycle
      associate (motion => problem%classes%motion(alike(i)), displacement => solution(alike(i))%displacement)
        if (motion%rotated) then
          u(i, :, :) = matmul(transpose(motion%rotation(:d, :d)), displacement)
        else
          u(i, :, :) = displacement
        end if
      end associate
    end do
  end subroutine to_representative

  !> Thermal dilatations of congruent bodies at their nodes.
  subroutine collect_thermal(problem, alike, thermal)
    !> Bodies, classes and ranks.
    type(contact_problem_t), intent(in) :: problem
    !> Indices of the bodies (n).
    integer, intent(in) :: alike(:)
    !> Those in each material; not allocated where no own body has a temperature (n, n_nodes, n_materials) [].
    real(dp), allocatable, intent(out) :: thermal(:, :, :)
    real(dp), allocatable :: of_material(:)
    integer :: i, m
    do i = 1, size(alike)
      associate (body => problem%body(alike(i)))
        if (.not. (problem%ranks%is_own(alike(i)) .and. allocated(body%initial%temperature))) cycle
        if (.not. allocated(thermal)) &
          allocate (thermal(size(alike), body%mesh%n_nodes(), size(body%material)), source=0.0_dp)
        do m = 1, size(body%material)
          call thermal_dilatation(body%mesh, body%analysis, body%material(m), body%initial, of_material)
          thermal(i, :, m) = of_material
        end do
      end associate
    end do
  end subroutine collect_thermal

  !> Some congruent bodies.
  subroutine estimate_some(problem, alike, solution, kept, of_element, norm_square, error)
    !> Bodies, classes and ranks.
    type(contact_problem_t), intent(in) :: problem
    !> Indices of the bodies (n).
    integer, intent(in) :: alike(:)
    !> Solutions of all bodies, with displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> What does not depend on the loads.
    type(kept_class_t), intent(inout) :: kept
    !> Squared errors; those of these bodies are set (n_bodies) [energy].
    type(element_field_t), intent(inout) :: of_element(:)
    !> Squared energy norm of each body (n_bodies) [energy].
    real(dp), intent(inout) :: norm_square(:)
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :, :), square(:, :), thermal(:, :, :)
    real(dp) :: of_body(size(alike))
    integer :: i
    call to_representative(problem, alike, solution, u)
    call collect_thermal(problem, alike, thermal)
    associate (first => problem%body(problem%classes%first(alike(1))))
      allocate (square(size(alike), first%mesh%n_elements()))
      call estimate_discretization_errors(first%mesh, first%analysis, first%material, u, kept%recovery, square, &
                                          of_body, error, thermal)
    end associate
    if (allocated(error)) return
    do i = 1, size(alike)
      if (.not. problem%ranks%is_own(alike(i))) cycle
      of_element(alike(i))%value = square(i, :)
      norm_square(alike(i)) = of_body(i)
    end do
  end subroutine estimate_some
end module dotyk_control_mesh_error
