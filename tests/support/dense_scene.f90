!> Scenes of bodies with dense compliance operators, in one direction: what a test writes down, and the QP and
!> compliance made of it.
module dense_scene
  use dense_response, only: dense_response_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_response_response, only: response_slot_t
  use dotyk_scheme_body_compliance, only: body_compliance_t, body_operator_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t, slide_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  type, public :: dense_body_t  !! One body of n nodes.
    class(dense_response_t), allocatable :: response  !! Its compliance operator, K^+ where it has modes.
    !> Rigid body modes (n, n_modes), and the resultants of the loads on them (n_modes); none if not allocated.
    real(dp), allocatable :: mode(:, :), resultant(:)
    !> Stiffness of near-null-space modes; not allocated for rigid body modes (n_modes, n_modes).
    real(dp), allocatable :: stiffness(:, :)
    real(dp), allocatable :: diagonal(:)  !! Diagonal of the stiffness; not known if not allocated (n).
    real(dp) :: cost = 1  !! Cost of a solve.
    integer :: representative = 0  !! An earlier body that it is congruent to; 0: it is a representative.
  end type dense_body_t

  type, public :: dense_scene_t  !! A scene.
    type(contact_operator_t) :: operator  !! Rows of B, weights and gaps.
    !> Penalty parameters, y_0, B K^+ f, compliance of the Winkler foundation (n_rows).
    real(dp), allocatable :: theta(:), y_0(:), y_load(:), foundation(:)
    real(dp) :: energy_0 = 0, norm_square_0 = 0  !! Of the solution without contact.
    type(dense_body_t), allocatable :: body(:)
    logical, allocatable :: is_tied(:)  !! Rows of ties; none if not allocated (n_rows).
    type(slide_t), allocatable :: slide(:)  !! Bolts of given tension; none if not allocated.
  contains
    procedure :: build => scene_build
  end type dense_scene_t

contains

  !> The QP and its compliance; the scene stays as it is.
  subroutine scene_build(self, qp, compliance)
    class(dense_scene_t), intent(in) :: self
    type(contact_qp_t), intent(out) :: qp
    type(body_compliance_t), intent(out) :: compliance
    type(contact_operator_t) :: operator
    type(contact_modes_t) :: modes(size(self%body))
    type(coarse_space_t) :: coarse
    type(response_slot_t), allocatable :: response(:)
    type(body_operator_t), allocatable :: body(:)
    type(constraint_t) :: constraint
    real(dp), allocatable :: foundation(:)
    integer :: b, i, n
    allocate (response(size(self%body)), body(size(self%body)))
    operator = self%operator
    operator%theta = [(0.0_dp, i=1, operator%n_rows)]
    if (allocated(self%theta)) operator%theta = self%theta
    if (.not. allocated(operator%pair_first_row)) operator%pair_first_row = [1, operator%n_rows + 1]
    foundation = [(1.0_dp, i=1, operator%n_rows)]
    if (allocated(self%foundation)) foundation = self%foundation
    do b = 1, size(self%body)
      associate (given => self%body(b))
        n = size(given%response%compliance, 1)
        allocate (response(b)%form, source=given%response)
        if (allocated(response(b)%form%mode)) deallocate (response(b)%form%mode)
        allocate (response(b)%form%mode(n, 0))
        constraint%equation = reshape([(i, i=1, n)], [1, n])
        constraint%frame_of = [(0, i=1, n)]
        if (allocated(constraint%frame)) deallocate (constraint%frame)
        allocate (constraint%frame(1, 1, 0))
        call body(b)%map%init(constraint, operator%block(b)%contact_node)
        body(b)%representative = merge(given%representative, b, given%representative > 0)
        body(b)%rotation = reshape([1.0_dp], [1, 1])
        body(b)%nodal_stiffness = [(0.0_dp, i=1, n)]
        if (allocated(given%diagonal)) body(b)%nodal_stiffness = given%diagonal
        body(b)%cost = given%cost
        allocate (modes(b)%displacement(n, 0), modes(b)%resultant(0))
        if (.not. allocated(given%mode)) cycle
        modes(b)%displacement = given%mode
        modes(b)%resultant = given%resultant
        modes(b)%resultant_size = abs(given%resultant)
        if (.not. allocated(given%stiffness)) cycle
        modes(b)%stiffness = given%stiffness
        modes(b)%lift_resultant = 0*given%resultant
        modes(b)%resultant_size = abs(given%resultant)
      end associate
    end do
    ! What is not allocated is absent.
    call coarse%init(operator%block, operator%n_rows, modes, self%slide)
    call qp%init(operator, self%y_0, self%y_load, self%energy_0, self%norm_square_0, foundation, coarse, self%is_tied)
    call compliance%init(qp, response, body, .true.)
  end subroutine scene_build
end module dense_scene
