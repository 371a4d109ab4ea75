!> The bilinear form G = A + X of the general iteration (32) with Robin conditions, body by body, and the constants that
!> Theorems 3 and 4 need of it.
!>
!> X is the penalty form of each body by itself on a fixed set F of contact rows, `X(u,v) = sum_a u_a^T B_a^T P_F B_a
!> v_a`, `P_F = Theta^{-1} W` there and 0 elsewhere: each side of such a row lies on a spring. With the body's own
!> compliance `C_a = B_a K_a^{-1} B_a^T` the compliance of G is `C_a^G = B_a (K_a + B_a^T P_F B_a)^{-1} B_a^T = (I + C_a
!> P_F)^{-1} C_a`. No solve of a body is needed once the entries of C_a are there. G is symmetric, continuous and
!> coercive, equations (29), (30), (31), so that every step, equations (33), (34), has one solution.
module dotyk_scheme_robin_form
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: cholesky_factor, solve_dense
  use dotyk_linalg_spectrum, only: linear_operator_t
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_compliance, only: compliance_t, entries_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_relaxation, only: upper_estimate
  implicit none
  private
  public :: form_sides, find_constants

  !> One body: everything is on its rows.
  type, public :: side_t
    !> Contact forces [force], and displacements C_a lambda by them [length] (n_rows of the block).
    real(dp), allocatable :: lambda(:), z(:)
    !> C_a, and C_a^G [length/force] (n_rows of the block, the same), symmetric.
    real(dp), allocatable :: compliance(:, :), compliance_g(:, :)
  end type side_t

  !> A symmetric matrix as an operator.
  type, extends(linear_operator_t) :: matrix_operator_t
    !> (n, n).
    real(dp), allocatable :: value(:, :)
  contains
    procedure :: apply => matrix_operator_apply
  end type matrix_operator_t

  !> `L^T (E^T P E - k P_F) L + k I`, with the factors `C_a^G = L_a L_a^T`, E the sum of both sides of a row and P =
  !> Theta^{-1} W: the spectrum is that of G^{-1} j'' for k = 0, that of G^{-1} (A + j'') for k = 1, j'' with all rows
  !> active. The pointers are to variables of the procedure that has it as a local variable.
  type, extends(linear_operator_t) :: form_operator_t
    !> The rows.
    type(contact_qp_t), pointer :: qp => null()
    !> P, and P_F (n_rows) [force/length].
    real(dp), allocatable :: penalty(:), spring(:)
    !> L_a (n_bodies).
    type(entries_t), allocatable :: factor(:)
    !> k [].
    real(dp) :: k = 0
  contains
    procedure :: apply => form_operator_apply
  end type form_operator_t

contains

  !> The compliances of all bodies.
  subroutine form_sides(qp, compliance, spring, side, error)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> P_F (n_rows) [force/length].
    real(dp), intent(in) :: spring(:)
    !> Bodies with their compliances, without forces (n_bodies).
    type(side_t), allocatable, intent(out) :: side(:)
    !> Allocated where I + C_a P_F of a body is singular: C_a is not positive semidefinite then.
    type(error_t), allocatable, intent(out) :: error
    type(entries_t), allocatable :: entries(:)
    real(dp), allocatable :: matrix(:, :)
    integer :: b, i, n
    allocate (side(size(qp%block)))
    call compliance%form_all(qp, entries)
    do b = 1, size(side)
      associate (row => qp%block(b)%row, own => side(b))
        n = size(row)
        allocate (own%lambda(n), own%z(n), source=0.0_dp)
        call move_alloc(entries(b)%value, own%compliance)
        allocate (own%compliance_g(n, n))
        if (n == 0) cycle
        matrix = own%compliance
        do i = 1, n
          matrix(:, i) = spring(row(i))*matrix(:, i)
          matrix(i, i) = matrix(i, i) + 1
        end do
        own%compliance_g = own%compliance
        call solve_dense(matrix, own%compliance_g, error)
        if (allocated(error)) return
        own%compliance_g = (own%compliance_g + transpose(own%compliance_g))/2
      end associate
    end do
  end subroutine form_sides

  !> Constants in the norm of G: M = B~ = M~ = 1, since A <= G; B = 1/(1+l) with the largest eigenvalue l of P_F C_a
  !> over all bodies; D the largest eigenvalue of G^{-1} j'', and Lambda that of G^{-1} (A + j''). All on the
  !> safe side, as far as the estimates of the eigenvalues are.
  subroutine find_constants(qp, penalty, spring, side, constants, error)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in), target :: qp
    !> P (n_rows) [force/length].
    real(dp), intent(in) :: penalty(:)
    !> P_F (n_rows) [force/length].
    real(dp), intent(in) :: spring(:)
    !> Bodies with their compliances (n_bodies).
    type(side_t), intent(in) :: side(:)
    !> The constants.
    type(iteration_constants_t), intent(out) :: constants
    !> Allocated where C_a^G of a body is not positive semidefinite.
    type(error_t), allocatable, intent(out) :: error
    type(matrix_operator_t) :: of_body
    type(form_operator_t) :: form
    real(dp) :: largest
    integer :: b, i, n
    n = 0
    largest = 0
    form%qp => qp
    form%penalty = penalty
    form%spring = spring
    allocate (form%factor(size(side)))
    do b = 1, size(side)
      associate (row => qp%block(b)%row, own => side(b))
        n = n + size(row)
        of_body%value = own%compliance
        do i = 1, size(row)
          of_body%value(i, :) = sqrt(spring(row(i)))*of_body%value(i, :)
          of_body%value(:, i) = sqrt(spring(row(i)))*of_body%value(:, i)
        end do
        largest = max(largest, upper_estimate(of_body, size(row)))
        call cholesky_factor(own%compliance_g, form%factor(b)%value, error)
        if (allocated(error)) return
      end associate
    end do
    constants%coercivity = 1/(1 + largest)
    constants%penalty = upper_estimate(form, n)
    form%k = 1
    constants%smoothness = upper_estimate(form, n)
    ! On rows with springs (v_a + v_b)^2 <= 2 (v_a^2 + v_b^2), so that j'' <= 2 X there, and X <= l/(1+l) G; likewise
    ! A + j'' <= G + X. Estimates may be above that.
    if (all(spring > 0)) then
      constants%penalty = min(constants%penalty, 2*largest/(1 + largest))
      constants%smoothness = min(constants%smoothness, 1 + largest/(1 + largest))
    end if
    ! A <= G and j'' <= D G.
    constants%smoothness = min(constants%smoothness, 1 + constants%penalty)
  end subroutine find_constants

  !> y = A x.
  subroutine matrix_operator_apply(self, x, y)
    !> The operator.
    class(matrix_operator_t), intent(inout) :: self
    !> Vector x (n) [any].
    real(dp), intent(in) :: x(:)
    !> Product y (n) [operator times x].
    real(dp), intent(out) :: y(:)
    y = matmul(self%value, x)
  end subroutine matrix_operator_apply

  !> y = (L^T (E^T P E - k P_F) L + k I) x.
  subroutine form_operator_apply(self, x, y)
    !> The operator.
    class(form_operator_t), intent(inout) :: self
    !> Vector x, body after body (number of rows of all bodies) [sqrt(energy)].
    real(dp), intent(in) :: x(:)
    !> Product y (the same) [sqrt(energy)].
    real(dp), intent(out) :: y(:)
    real(dp), allocatable :: s(:), force(:)
    integer :: b, before, n
    allocate (s(size(x)), force(self%qp%n_rows))
    force = 0
    before = 0
    do b = 1, size(self%factor)
      associate (row => self%qp%block(b)%row)
        n = size(row)
        s(before + 1:before + n) = matmul(self%factor(b)%value, x(before + 1:before + n))
        force(row) = force(row) + self%penalty(row)*s(before + 1:before + n)
        before = before + n
      end associate
    end do
    before = 0
    do b = 1, size(self%factor)
      associate (row => self%qp%block(b)%row)
        n = size(row)
        y(before + 1:before + n) = self%k*x(before + 1:before + n) + &
          matmul(force(row) - self%k*self%spring(row)*s(before + 1:before + n), self%factor(b)%value)
        before = before + n
      end associate
    end do
  end subroutine form_operator_apply
end module dotyk_scheme_robin_form
