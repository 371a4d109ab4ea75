!> Error estimates of load cases that are solved ahead: those of one mesh in one pass.
module dotyk_control_estimates_ahead
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_case_ahead, only: case_ahead_t
  use dotyk_control_congruent_groups, only: congruent_group_t, congruent_groups, most_bodies
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_kept_estimates, only: kept_class_t, kept_estimates_t
  use dotyk_control_mesh_error, only: collect_thermal, hold_against_residuals, least_share, to_representative
  use dotyk_control_residual_actions, only: collect_actions, join_actions
  use dotyk_elasticity_discretization_error, only: estimate_discretization_errors
  use dotyk_elasticity_element_residual, only: residual_data_t
  use dotyk_elasticity_load_cases, only: take_case
  implicit none
  private
  public :: estimate_ahead

contains

  !> Errors of the mesh of all cases, as in `estimate_mesh_errors`.
  subroutine estimate_ahead(problem, first_row, kept, cases, error)
    !> Bodies, classes and pairs; any of the load cases acts on the bodies on return.
    type(contact_problem_t), intent(inout) :: problem
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> What does not depend on the loads.
    type(kept_estimates_t), intent(inout) :: kept
    !> With displacements (n).
    type(case_ahead_t), intent(inout) :: cases(:)
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    type(congruent_group_t), allocatable :: group(:)
    real(dp) :: of_body(size(problem%body), size(cases)), of_elements(size(problem%body)), least(size(cases))
    integer :: b, g, first, j, last, n, n_together, part
    call congruent_groups(problem, group)
    call collect(problem, group, first_row, cases)
    call kept%init(size(problem%body))
    do j = 1, size(cases)
      allocate (cases(j)%of_element(size(problem%body)))
    end do
    of_body = 0
    least = 0
    do part = 1, 2
      do g = 1, size(group)
        associate (some => group(g)%body, kept_class => kept%of_class(group(g)%representative))
          call kept_class%init(problem%body(group(g)%representative))
          n_together = max(1, most_bodies/size(some))
          do first = 1, size(cases), n_together
            last = min(first + n_together - 1, size(cases))
            if (part == 1) then
              call estimate_group(problem, g, some, kept_class, cases(first:last), of_body(:, first:last), error)
            else
              call check_group(problem, g, some, least(first:last), kept_class, cases(first:last), error)
            end if
            if (allocated(error)) return
          end do
        end associate
      end do
      if (part == 2) exit
      n = sum([(problem%body(b)%mesh%n_whole_elements(), b=1, size(problem%body))])
      do j = 1, size(cases)
        of_elements = 0
        do b = 1, size(problem%body)
          if (allocated(cases(j)%of_element(b)%value)) of_elements(b) = sum(cases(j)%of_element(b)%value)
        end do
        call problem%ranks%share_sum(of_elements)
        least(j) = least_share*sum(of_elements)/n
        call problem%ranks%share_sum(of_body(:, j))
        cases(j)%norm_square = sum(of_body(:, j))
      end do
    end do
  end subroutine estimate_ahead

  !> What the estimates read of the loads.
  subroutine collect(problem, group, first_row, cases)
    !> Bodies, classes and pairs; the last of the load cases acts on the bodies on return.
    type(contact_problem_t), intent(inout) :: problem
    !> Groups of congruent bodies.
    type(congruent_group_t), intent(in) :: group(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> Get the actions on all groups (n).
    type(case_ahead_t), intent(inout) :: cases(:)
    integer :: b, g, j
    do j = 1, size(cases)
      do b = 1, size(problem%body)
        call take_case(problem%body(b), cases(j)%number)
      end do
      allocate (cases(j)%group(size(group)))
      do g = 1, size(group)
        associate (own => cases(j)%group(g), some => group(g)%body)
          call collect_thermal(problem, some, own%thermal)
          call collect_actions(problem, some, first_row, cases(j)%state%m, cases(j)%body, own%actions)
        end associate
      end do
    end do
  end subroutine collect

  !> Displacements of a group in all cases, case after case, in the axes of the representative.
  subroutine displacements_of(problem, some, cases, u)
    !> Bodies, classes and ranks.
    type(contact_problem_t), intent(in) :: problem
    !> The bodies (n_bodies).
    integer, intent(in) :: some(:)
    !> With displacements (n).
    type(case_ahead_t), intent(in) :: cases(:)
    !> (n_bodies*n, dim, n_nodes) [length]
    real(dp), allocatable, intent(out) :: u(:, :, :)
    real(dp), allocatable :: of_case(:, :, :)
    integer :: j
    do j = 1, size(cases)
      call to_representative(problem, some, cases(j)%body, of_case)
      if (.not. allocated(u)) allocate (u(size(some)*size(cases), size(of_case, 2), size(of_case, 3)))
      u((j - 1)*size(some) + 1:j*size(some), :, :) = of_case
    end do
  end subroutine displacements_of

  !> Recovered strains of a group in all cases, and its errors by them.
  subroutine estimate_group(problem, g, some, kept, cases, norm_square, error)
    !> Bodies, classes and ranks.
    type(contact_problem_t), intent(in) :: problem
    !> The group.
    integer, intent(in) :: g
    !> Its bodies (n_bodies).
    integer, intent(in) :: some(:)
    !> What does not depend on the loads.
    type(kept_class_t), intent(inout) :: kept
    !> Get squared errors and recovered strains (n).
    type(case_ahead_t), intent(inout) :: cases(:)
    !> Squared energy norms of all bodies; those of these are set (n_all_bodies, n) [energy].
    real(dp), intent(inout) :: norm_square(:, :)
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :, :), square(:, :), thermal(:, :, :), norm(:)
    integer :: b, i, j, m
    call displacements_of(problem, some, cases, u)
    do j = 1, size(cases)
      if (.not. allocated(cases(j)%group(g)%thermal)) cycle
      associate (own => cases(j)%group(g)%thermal)
        if (.not. allocated(thermal)) allocate (thermal(size(u, 1), size(own, 2), size(own, 3)), source=0.0_dp)
        thermal((j - 1)*size(some) + 1:j*size(some), :, :) = own
      end associate
    end do
    associate (first => problem%body(problem%classes%first(some(1))))
      allocate (square(size(u, 1), first%mesh%n_elements()), norm(size(u, 1)))
      call estimate_discretization_errors(first%mesh, first%analysis, first%material, u, kept%recovery, square, norm, &
                                          error, thermal)
    end associate
    if (allocated(error)) return
    do j = 1, size(cases)
      do i = 1, size(some)
        b = some(i)
        if (.not. problem%ranks%is_own(b)) cycle
        cases(j)%of_element(b)%value = square((j - 1)*size(some) + i, :)
        norm_square(b, j) = norm((j - 1)*size(some) + i)
      end do
      allocate (cases(j)%group(g)%recovered(size(kept%recovery)))
      do m = 1, size(kept%recovery)
        if (.not. allocated(kept%recovery(m)%u)) cycle
        call kept%recovery(m)%give((j - 1)*size(some) + 1, j*size(some), cases(j)%group(g)%recovered(m))
      end do
    end do
  end subroutine estimate_group

  !> Hold the errors of a group in all cases against the residuals of its elements.
  subroutine check_group(problem, g, some, least, kept, cases, error)
    !> Bodies, classes and ranks.
    type(contact_problem_t), intent(in) :: problem
    !> The group.
    integer, intent(in) :: g
    !> Its bodies (n_bodies).
    integer, intent(in) :: some(:)
    !> Elements with smaller squared errors are left alone (n) [energy].
    real(dp), intent(in) :: least(:)
    !> What does not depend on the loads.
    type(kept_class_t), intent(inout) :: kept
    !> Their squared errors change (n).
    type(case_ahead_t), intent(inout) :: cases(:)
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    type(residual_data_t) :: data
    real(dp), allocatable :: u(:, :, :), square(:, :)
    real(dp) :: least_of(size(some)*size(cases))
    integer :: i, j
    do j = 1, size(cases)
      least_of((j - 1)*size(some) + 1:j*size(some)) = least(j)
    end do
    associate (first => problem%body(problem%classes%first(some(1))))
      allocate (square(size(least_of), first%mesh%n_elements()), source=0.0_dp)
      do j = 1, size(cases)
        do i = 1, size(some)
          if (problem%ranks%is_own(some(i))) square((j - 1)*size(some) + i, :) = cases(j)%of_element(some(i))%value
        end do
      end do
      call displacements_of(problem, some, cases, u)
      call join_actions([(cases(j)%group(g)%actions, j=1, size(cases))], data)
      call hold_against_residuals(first, data, u, least_of, kept, square, error)
    end associate
    if (allocated(error)) return
    do j = 1, size(cases)
      do i = 1, size(some)
        if (problem%ranks%is_own(some(i))) cases(j)%of_element(some(i))%value = square((j - 1)*size(some) + i, :)
      end do
    end do
  end subroutine check_group
end module dotyk_control_estimates_ahead
