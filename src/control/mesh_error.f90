!> Discretization errors of all bodies in a block of load cases: congruent bodies together, in the axes of the
!> representative, and all load cases in one pass over each mesh.
module dotyk_control_mesh_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_memory, only: allowance_t, memory_now, memory_t
  use dotyk_base_thresholds, only: notable
  use dotyk_control_body_solution, only: body_solution_t, displacements_t
  use dotyk_control_contact_problem, only: congruent_group_t, congruent_groups, contact_problem_t, most_bodies
  use dotyk_control_kept_estimates, only: kept_class_t, kept_estimates_t, most_of_memory
  use dotyk_control_residual_actions, only: collect_actions, join_actions
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_discretization_error, only: estimate_discretization_errors
  use dotyk_elasticity_element_residual, only: residual_data_t
  use dotyk_elasticity_load_cases, only: take_case
  use dotyk_elasticity_nodal_stress, only: thermal_dilatation
  use dotyk_elasticity_residual_check, only: check_by_residuals
  use dotyk_ranks_communication, only: n_local_ranks
  implicit none
  private
  public :: collect_thermal, estimate_mesh_errors, to_representative

contains

  !> Squared errors of all elements, and the squared norms of the solutions.
  subroutine estimate_mesh_errors(problem, first_row, kept, block, error)
    !> Bodies, classes and pairs; any of the load cases acts on the bodies on return.
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    !> What does not depend on the loads; the recovered strains of a load case that acts on the bodies stay here.
    type(kept_estimates_t), intent(inout) :: kept
    type(displacements_t), intent(inout) :: block(:)  !! With displacements and pressures (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of a material cannot be evaluated.
    type(congruent_group_t), allocatable :: group(:)
    real(dp) :: of_body(size(problem%body), size(block)), of_elements(size(problem%body)), least(size(block))
    integer :: b, first, g, j, last, n, part
    call kept%init(size(problem%body))
    call congruent_groups(problem, group)
    do j = 1, size(block)
      if (allocated(block(j)%square)) deallocate (block(j)%square)
      allocate (block(j)%square(size(problem%body)))
      if (block(j)%case > 0) allocate (block(j)%recovered(size(group)))
    end do
    of_body = 0
    least = 0
    ! The residuals after all recovered strains: elements without a share in the error need none.
    do part = 1, 2
      do g = 1, size(group)
        associate (some => group(g)%body, of_class => kept%of_class(group(g)%representative))
          call of_class%init(problem%body(group(g)%representative))
          do first = 1, size(block), max(1, most_bodies/size(some))
            last = min(first + max(1, most_bodies/size(some)) - 1, size(block))
            if (part == 1) then
              call estimate_group(problem, g, some, of_class, block(first:last), of_body(:, first:last), error)
            else
              call check_group(problem, some, first_row, least(first:last), of_class, block(first:last), error)
            end if
            if (allocated(error)) return
          end do
        end associate
      end do
      if (part == 2) exit
      n = sum([(problem%body(b)%mesh%n_whole_elements(), b=1, size(problem%body))])
      do j = 1, size(block)
        of_elements = 0
        do b = 1, size(problem%body)
          if (allocated(block(j)%square(b)%value)) of_elements(b) = sum(block(j)%square(b)%value)
        end do
        call problem%ranks%share_sum(of_elements)
        least(j) = notable*sum(of_elements)/n
        call problem%ranks%share_sum(of_body(:, j))
        block(j)%norm_square = sum(of_body(:, j))
      end do
    end do
  end subroutine estimate_mesh_errors

  !> Recovered strains of congruent bodies, and their errors by them.
  subroutine estimate_group(problem, g, some, kept, block, norm_square, error)
    !> Bodies, classes and ranks; the last of the load cases acts on these bodies on return.
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: g  !! The group.
    integer, intent(in) :: some(:)  !! Its bodies (n_bodies).
    type(kept_class_t), intent(inout) :: kept  !! What does not depend on the loads.
    type(displacements_t), intent(inout) :: block(:)  !! Get squared errors and recovered strains (n).
    !> Squared energy norms of all bodies; those of these are set (n_all_bodies, n) [energy].
    real(dp), intent(inout) :: norm_square(:, :)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of a material cannot be evaluated.
    real(dp), allocatable :: u(:, :, :), square(:, :), thermal(:, :, :), of_case(:, :, :), norm(:)
    logical, allocatable :: singular(:, :)
    integer :: i, j, m, n
    n = size(some)
    associate (first => problem%body(problem%classes%first(some(1))))
      allocate (singular(n*size(block), first%mesh%n_elements()), source=.false.)
    end associate
    do j = 1, size(block)
      call act(problem, some, block(j)%case)
      do i = 1, n
        if (problem%ranks%is_own(some(i))) &
          singular((j - 1)*n + i, :) = elements_at_concentrated(problem%body(some(i)), size(singular, 2))
      end do
      call collect_thermal(problem, some, of_case)
      if (.not. allocated(of_case)) cycle
      if (.not. allocated(thermal)) allocate (thermal(n*size(block), size(of_case, 2), size(of_case, 3)), source=0.0_dp)
      thermal((j - 1)*n + 1:j*n, :, :) = of_case
    end do
    call displacements_of(problem, some, block, u)
    associate (first => problem%body(problem%classes%first(some(1))))
      allocate (square(size(u, 1), first%mesh%n_elements()), norm(size(u, 1)))
      call estimate_discretization_errors(first%mesh, first%analysis, first%material, u, kept%recovery, square, norm, &
                                          error, thermal)
    end associate
    if (allocated(error)) return
    ! The stress of a force without area has no finite energy, and no error. A mesh of a few elements does not see that.
    do i = 1, size(square, 1)
      if (2*count(singular(i, :)) <= size(square, 2)) where (singular(i, :)) square(i, :) = 0
    end do
    do j = 1, size(block)
      do i = 1, n
        if (.not. problem%ranks%is_own(some(i))) cycle
        block(j)%square(some(i))%value = square((j - 1)*n + i, :)
        norm_square(some(i), j) = norm((j - 1)*n + i)
      end do
      if (block(j)%case == 0) cycle
      allocate (block(j)%recovered(g)%of_material(size(kept%recovery)))
      do m = 1, size(kept%recovery)
        if (allocated(kept%recovery(m)%u)) &
          call kept%recovery(m)%give((j - 1)*n + 1, j*n, block(j)%recovered(g)%of_material(m))
      end do
    end do
  end subroutine estimate_group

  !> Elements of a body at edges and nodes with loads or supports (n_elements).
  pure function elements_at_concentrated(body, n_elements) result(are)
    type(body_t), intent(in) :: body  !! The body.
    integer, intent(in) :: n_elements  !! Number of its elements.
    logical :: are(n_elements)
    logical, allocatable :: at(:)
    integer :: b, e, k, n
    are = .false.
    allocate (at(body%mesh%n_nodes()), source=.false.)
    if (allocated(body%resultant)) then
      do k = 1, size(body%resultant)
        if (body%resultant(k)%is_concentrated) at(body%resultant(k)%node) = .true.
      end do
    end if
    if (allocated(body%directions%is_concentrated)) then
      do k = 1, size(body%directions%node)
        associate (source => body%directions%source(k))
          if (source == 0) cycle
          if (body%directions%is_concentrated(source)) at(body%directions%node(k)) = .true.
        end associate
      end do
    end if
    if (.not. any(at)) return
    n = 0
    do b = 1, size(body%mesh%block)
      do e = 1, size(body%mesh%block(b)%node, 2)
        n = n + 1
        are(n) = any(at(body%mesh%block(b)%node(:, e)))
      end do
    end do
  end function elements_at_concentrated

  !> Hold the errors of congruent bodies against the residuals of their elements.
  subroutine check_group(problem, some, first_row, least, kept, block, error)
    !> Bodies, classes and pairs; the last of the load cases acts on these bodies on return.
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: some(:)  !! The bodies (n_bodies).
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: least(:)  !! Elements with smaller squared errors are left alone (n) [energy].
    type(kept_class_t), intent(inout) :: kept  !! What does not depend on the loads.
    type(displacements_t), intent(inout) :: block(:)  !! Their squared errors change (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of a material cannot be evaluated.
    type(residual_data_t), target :: of_case(size(block)), joined
    type(residual_data_t), pointer :: data
    type(allowance_t) :: face_room
    type(memory_t) :: memory
    real(dp), allocatable :: u(:, :, :), square(:, :)
    real(dp) :: least_of(size(some)*size(block))
    integer :: i, j, n
    n = size(some)
    associate (first => problem%body(problem%classes%first(some(1))))
      allocate (square(size(least_of), first%mesh%n_elements()), source=0.0_dp)
      do j = 1, size(block)
        least_of((j - 1)*n + 1:j*n) = least(j)
        do i = 1, n
          if (problem%ranks%is_own(some(i))) square((j - 1)*n + i, :) = block(j)%square(some(i))%value
        end do
      end do
      if (all(square <= spread(least_of, 2, size(square, 2)))) return
      do j = 1, size(block)
        call act(problem, some, block(j)%case)
        call collect_actions(problem, some, first_row, block(j)%pressure, block(j)%body, of_case(j))
      end do
      data => of_case(1)
      if (size(block) > 1) then
        call join_actions(of_case, joined)
        data => joined
      end if
      call displacements_of(problem, some, block, u)
      memory = memory_now()
      if (memory%is_known) face_room%left = int(most_of_memory*memory%left/n_local_ranks(), int64)
      call check_by_residuals(first%mesh, first%analysis, first%material, data, u, least_of, kept%factor, kept%room, &
                              face_room, square, error)
    end associate
    if (allocated(error)) return
    do j = 1, size(block)
      do i = 1, n
        if (problem%ranks%is_own(some(i))) block(j)%square(some(i))%value = square((j - 1)*n + i, :)
      end do
    end do
  end subroutine check_group

  !> Let a load case act on some bodies.
  subroutine act(problem, some, case)
    type(contact_problem_t), intent(inout) :: problem  !! The bodies.
    integer, intent(in) :: some(:)  !! Indices of those on which it is to act (n).
    integer, intent(in) :: case  !! The load case; 0: it acts on them already.
    integer :: i
    if (case == 0) return
    do i = 1, size(some)
      call take_case(problem%body(some(i)), case)
    end do
  end subroutine act

  !> Displacements of congruent bodies in all load cases, case after case, in the axes of the representative.
  subroutine displacements_of(problem, some, block, u)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and ranks.
    integer, intent(in) :: some(:)  !! The bodies (n_bodies).
    type(displacements_t), intent(in) :: block(:)  !! With displacements (n).
    real(dp), allocatable, intent(out) :: u(:, :, :)  !! (n_bodies*n, dim, n_nodes) [length]
    real(dp), allocatable :: of_case(:, :, :)
    integer :: j
    do j = 1, size(block)
      call to_representative(problem, some, block(j)%body, of_case)
      if (.not. allocated(u)) allocate (u(size(some)*size(block), size(of_case, 2), size(of_case, 3)))
      u((j - 1)*size(some) + 1:j*size(some), :, :) = of_case
    end do
  end subroutine displacements_of

  !> Displacements of congruent bodies in the axes of their representative; 0 for those of other ranks.
  subroutine to_representative(problem, alike, solution, u)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and ranks.
    integer, intent(in) :: alike(:)  !! Indices of the bodies (n).
    type(body_solution_t), intent(in) :: solution(:)  !! Solutions of all bodies, with displacements (n_bodies).
    real(dp), allocatable, intent(out) :: u(:, :, :)  !! Displacements (n, dim, n_nodes) [length].
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
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and ranks.
    integer, intent(in) :: alike(:)  !! Indices of the bodies (n).
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
end module dotyk_control_mesh_error
