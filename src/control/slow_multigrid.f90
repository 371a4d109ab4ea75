!> Bodies whose p-multigrid turns out to converge slowly, such as slivers, or whose factor is cheap, such as beams and
!> plates, get a factor in its place where the memory suffices.
module dotyk_control_slow_multigrid
  use dotyk_base_error, only: add_context, error_t, exit_machine
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_factorization, only: check_memory, factor_size_t
  use dotyk_control_response_choice, only: form_multigrid, form_whole, operator_slot_t
  use dotyk_elasticity_body, only: assemble_stiffness, body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_response_multigrid_response, only: multigrid_response_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_linear_solver_choice, only: work_of_ties
  implicit none
  private
  public :: factor_is_better, find_slow_ones, replace_slow_ones

  !> Iterations of a solve above which the least Ritz value of the trial may be too large for a bound
  !> (`benchmark_multigrid table`).
  real(dp), parameter :: most_steps = 100
  real(dp), parameter :: usual_steps = 14  !! Iterations of a solve before the trial: those of compact elements.
  !> Operations of a factorization per unknown, in the time of a contact problem per iteration of one solve: three
  !> cycles, those of trial, rough solution without contact and active sets, of 1e4 operations each.
  real(dp), parameter :: work_of_step = 3.0e4_dp
  !> Aggregates of linear elements are coupled to more others than corners: the factor of the body takes 11 to 12 times
  !> the operations of theirs, a tenth of the square of the unknowns.
  real(dp), parameter :: of_aggregates = 0.1_dp

contains

  !> Find the bodies whose p-multigrids converge slowly, or cost more than their factors. The factor of a body of n
  !> unknowns, n_c of them in its corner space, takes about (n/n_c)^2 times the operations of the factor of that: 1.1 to
  !> 1.8 times as many were measured for blocks, 0.5 to 1.4 times for plates and beams, 2 to 4 times for a plate that is
  !> held below.
  subroutine find_slow_ones(classes, n_cases, n_tied, slot, size_of)
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    integer, intent(in) :: n_cases  !! Number of load cases: a factor serves all of them, p-multigrid solves each.
    !> Tied rows of each body, all of which are active: their entries of the compliance take work, too (n_bodies).
    integer, intent(in) :: n_tied(:)
    type(operator_slot_t), intent(in) :: slot(:)  !! Analysed, or factorized and tried (n_bodies).
    type(factor_size_t), intent(inout) :: size_of(:)  !! Analysed; says which ones are slow on return (n_bodies).
    real(dp) :: flops, ratio
    integer :: b
    do b = 1, size(slot)
      if (.not. allocated(slot(b)%multigrid) .or. size_of(b)%form /= form_multigrid) cycle
      associate (operator => slot(b)%multigrid, n => real(slot(b)%multigrid%grid%n, dp))
        size_of(b)%steps = operator%expected_steps()
        if (.not. size_of(b)%steps > 0) size_of(b)%steps = usual_steps
        flops = size_of(b)%whole_flops
        if (.not. flops > 0) then
          ratio = (n/max(1, operator%grid%interpolation%n))**2* &
                  merge(of_aggregates, 1.0_dp, operator%grid%interpolation%aggregates%n > 0)
          ! Entries of factors grow by the power 2/3 of their operations; paths of the elimination tree are not known.
          flops = size_of(b)%flops*ratio + work_of_ties(n_tied(b), 0.0_dp, size_of(b)%entries*ratio**(2.0_dp/3))
        end if
        size_of(b)%is_slow = factor_is_better(size_of(b)%steps, n_cases, n*count(classes%first == b), flops)
      end associate
    end do
    size_of%is_slow = size_of(classes%first)%is_slow
    size_of%steps = size_of(classes%first)%steps
    ! The bodies are one contact problem: factors that are no more than cheaper are for all of them, or for none.
    if (any(size_of%form == form_multigrid .and. .not. size_of%is_slow)) size_of%is_slow = size_of%steps > most_steps
  end subroutine find_slow_ones

  !> Whether a factor is better than p-multigrid.
  elemental logical function factor_is_better(steps, n_cases, n, flops) result(is_better)
    real(dp), intent(in) :: steps  !! Iterations of a solve by p-multigrid.
    integer, intent(in) :: n_cases  !! Number of load cases.
    real(dp), intent(in) :: n  !! Unknowns of the bodies that would share the factor.
    real(dp), intent(in) :: flops  !! Operations of the factorization; 0 where they are not known.
    is_better = steps > most_steps
    if (flops > 0) is_better = is_better .or. flops < n_cases*steps*work_of_step*n
  end function factor_is_better

  !> Replace the p-multigrids that converge slowly.
  subroutine replace_slow_ones(body, modes, slot, size_of, report, error)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(body_modes_t), intent(in) :: modes(:)  !! Rigid body modes that supports leave (n_bodies).
    type(operator_slot_t), intent(inout) :: slot(:)  !! Factorized (n_bodies).
    !> Sizes of the factors; those of replaced bodies change (n_bodies).
    type(factor_size_t), intent(inout) :: size_of(:)
    type(factorization_report_t), intent(inout) :: report(:)  !! Reports of the representatives (n_bodies).
    !> Allocated where a stiffness is not positive definite, memory runs out, or an interrupt came; names the body.
    type(error_t), allocatable, intent(out) :: error
    integer :: b
    do b = 1, size(body)
      if (.not. size_of(b)%is_slow .or. .not. allocated(slot(b)%multigrid)) cycle
      call replace(body(b), modes(b), slot(b), size_of(b), report(b), error)
      call add_context(error, "body '"//body(b)%name//"': ")
      if (allocated(error)) return
    end do
  end subroutine replace_slow_ones

  !> Replace one.
  subroutine replace(body, modes, slot, size_of, report, error)
    type(body_t), intent(in) :: body  !! The body.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that supports leave.
    !> Factorized; another operator on return, unless the memory does not suffice for it.
    type(operator_slot_t), intent(inout) :: slot
    type(factor_size_t), intent(inout) :: size_of  !! Of the new factor on return.
    type(factorization_report_t), intent(inout) :: report  !! Report of the new factor on return.
    type(error_t), allocatable, intent(out) :: error  !! As in `replace_slow_ones`.
    type(multigrid_response_t), allocatable :: whole
    type(stiffness_t) :: stiffness
    type(factor_size_t) :: new_size(1)
    character(:), allocatable :: warning
    allocate (whole)
    call assemble_stiffness(body, stiffness, error)
    if (.not. allocated(error)) call whole%analyze_whole(body, modes, stiffness, error)
    if (.not. allocated(error)) then
      call stiffness%forget_graph()
      whole%grid%keeps_corner_matrix = slot%multigrid%grid%keeps_corner_matrix
      new_size(1) = size_of
      new_size(1)%form = form_whole
      call new_size(1)%take(whole%grid%coarse%factor)
      call check_memory(memory_now(), new_size, warning, error)
    end if
    if (allocated(error)) then
      call whole%destroy()
      call stiffness%destroy()
      if (error%code == exit_machine) deallocate (error)
      return
    end if
    call slot%multigrid%destroy()
    call move_alloc(whole, slot%multigrid)
    size_of = new_size(1)
    call slot%multigrid%factorize_whole(body, modes, stiffness, report, error)
    if (.not. allocated(error)) call slot%multigrid%prepare(error)
  end subroutine replace
end module dotyk_control_slow_multigrid
