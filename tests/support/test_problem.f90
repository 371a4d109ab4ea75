!> From bodies and contact rows to a quadratic programme and its compliance operator: the driver's way, without an input
!> file.
module test_problem
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: response_full
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_control_contact_free, only: contact_free_t, solve_without_contact
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_body_operators, only: find_modes, make_operators
  use dotyk_control_factorization, only: analyze_bodies, factor_size_t, factorize_bodies
  use dotyk_control_response_choice, only: operator_slot_t
  use dotyk_elasticity_body, only: stiffness_t
  use dotyk_response_response, only: response_slot_t
  use dotyk_scheme_body_compliance, only: body_compliance_t, body_operator_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: make_problem

contains

  !> Assemble, factorize and solve without contact. Every body has a compliance operator of its own, of its whole
  !> stiffness: near-null-space modes are not split off.
  subroutine make_problem(operator, problem, qp, compliance, error)
    type(contact_operator_t), intent(inout) :: operator  !! Rows of B; without its blocks on return.
    type(contact_problem_t), intent(inout) :: problem  !! With bodies that have supports and loads; the rest is set.
    type(contact_qp_t), intent(out) :: qp  !! With a Winkler foundation: each row with the stiffness of its nodes alone.
    type(body_compliance_t), intent(inout) :: compliance
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a body cannot be assembled or factorized.
    type(stiffness_t), allocatable :: stiffness(:)
    type(operator_slot_t), allocatable :: direct(:)
    type(factor_size_t), allocatable :: size_of(:)
    type(response_slot_t), allocatable :: response(:)
    type(body_operator_t), allocatable :: operators(:)
    type(contact_modes_t), allocatable :: modes(:)
    type(coarse_space_t) :: coarse
    type(contact_free_t) :: free
    real(dp), allocatable :: foundation(:)
    integer :: b, n
    n = size(problem%body)
    allocate (problem%modes(n), stiffness(n))
    call problem%classes%init(n)
    call problem%ranks%init(problem%body, problem%classes)
    do b = 1, n
      call problem%body(b)%assemble(stiffness(b), error)
      if (allocated(error)) return
      call problem%modes(b)%find(problem%body(b))
    end do
    associate (classes => problem%classes, block => operator%block)
      allocate (direct(size(classes%first)))
      call analyze_bodies(problem%body, problem%modes, stiffness, classes, problem%ranks, block, response_full, 1, &
                          direct, size_of, error)
      if (allocated(error)) return
      call factorize_bodies(problem%body, problem%ranks, problem%modes, .false., size_of, stiffness, direct, &
                            problem%report, error)
      if (allocated(error)) return
      call find_modes(problem%body, classes, problem%ranks, block, problem%report, problem%modes, modes, error)
      if (allocated(error)) return
      call make_operators(problem%body, classes, problem%ranks, block, problem%report, size_of, direct, response, &
                          operators)
      call solve_without_contact(problem%body, problem%ranks, block, operator%gap, response, classes%first, .true., &
                                 1, .false., free, problem%isolated)
      call coarse%init(block, operator%n_rows, modes)
    end associate
    allocate (foundation(operator%n_rows), source=1.0_dp)
    call qp%init(operator, free%initial_penetration, free%load_displacement, free%energy, free%norm_square, &
                 foundation, coarse)
    call compliance%init(qp, response, operators, .true.)
    ! Schemes divide by it where theta is zero.
    call compliance%nodal_diagonal(qp, foundation)
    qp%foundation = foundation*qp%weight
  end subroutine make_problem
end module test_problem
