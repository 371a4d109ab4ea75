!> The contact problem as a quadratic programme: the unilateral (Signorini) problem of discretized bodies. Nothing
!> writes to it but the next load case (`set_loads`); the correction of ill-conditioned bodies shifts the initial
!> penetration of a copy (`dotyk_control_contact_solution`).
!>
!> In the displacements it is `min u^T K u/2 - f^T u + penalty` subject to the contact rows `B u - d <= 0`: equation
!> (12) on the set K of equation (11), or equation (19) with the penalty of equation (18). In the Lagrange multipliers,
!> the contact forces `lambda = W p >= 0`, it is
!>
!>     min lambda^T (C + Theta W^{-1}) lambda/2 - lambda^T y_0    subject to  lambda >= 0,  G^T lambda + S alpha = e,
!>
!> with `C = B K^+ B^T` (`dotyk_scheme_compliance`), the initial penetration `y_0 = B u_0 - d` of the solution without
!> contact u_0, and the rigid body modes `G = B R` of floating bodies, their resultants e and springs S
!> (`dotyk_scheme_coarse_space`). Every iterate is `u = u_0 - K^+ B^T W m + R alpha`: its state is one pressure m per
!> row, and the amplitudes alpha. Then `y = B u - d = y_0 - C W m + G alpha`. The tolerance is an argument of a solve;
!> the penalty parameters theta belong to the rows. Rows of ties are equations, `B u - d = 0`: their forces have any
!> sign, and their theta is 0. (docs/theory.md)
module dotyk_scheme_contact_qp
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_operator, only: contact_block_t, contact_operator_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_scheme_coarse_space, only: coarse_space_t
  implicit none
  private

  !> The quadratic programme. Only this module and `dotyk_scheme_restriction` write its components.
  type, public :: contact_qp_t
    integer :: n_rows = 0  !! Number of rows, of contact and of ties.
    logical, allocatable :: is_tied(:)  !! Rows of ties (n_rows).
    !> Pressures of the rows from those of the QP that the scheme solves, where contact goes on across a tie: rows of
    !> one vertex on both sides are one, others are interpolated. Not allocated where each has its own (n_rows, n_left)
    !> [].
    type(sparse_rows_t), allocatable :: seam
    integer :: dimension = 0  !! Dimension of space.
    !> Rows of pair k are pair_first_row(k) .. pair_first_row(k+1)-1; after contact pairs come the components of ties
    !> (n_pairs+1).
    integer, allocatable :: pair_first_row(:)
    integer :: level = 0  !! Aggregations that the QP has gone through.
    !> Row of the whole QP of the same level that each row is: a restriction is an index set over those (n_rows).
    integer, allocatable :: parent_row(:)
    real(dp), allocatable :: weight(:)  !! Weights w (n_rows) [area].
    real(dp), allocatable :: gap(:)  !! Gaps d (n_rows) [length].
    real(dp), allocatable :: theta(:)  !! Penalty parameters, 0 of ties (n_rows) [length/pressure].
    type(contact_block_t), allocatable :: block(:)  !! Rows of B, body by body (n_bodies).
    real(dp), allocatable :: initial_penetration(:)  !! y_0 = B u_0 - d (n_rows) [length].
    !> B K^+ f with supports at rest (n_rows) [length]: `sum w m load_displacement` is the work of the loads on K^+ B^T
    !> W m.
    real(dp), allocatable :: load_displacement(:)
    !> Compliance of the Winkler foundation that stands for the bodies where a scheme needs a first guess; positive
    !> (n_rows) [length/pressure].
    real(dp), allocatable :: foundation(:)
    type(coarse_space_t) :: coarse  !! Rigid body modes that the supports leave.
    real(dp) :: energy_0 = 0, norm_square_0 = 0  !! F(u_0) = A(u_0,u_0)/2 - L(u_0) and A(u_0,u_0) [energy].
  contains
    procedure :: init => qp_init
    procedure :: set_loads => qp_set_loads
    procedure :: shift_penetration => qp_shift_penetration
    procedure :: replace_theta => qp_replace_theta
    procedure :: shift_gap => qp_shift_gap
    procedure :: replace_modes => qp_replace_modes
    procedure :: mode_displacement => qp_mode_displacement
    procedure :: opened_by_slides => qp_opened_by_slides
    procedure :: mode_resultant => qp_mode_resultant
    procedure :: energy_norm => qp_energy_norm
    procedure :: energy => qp_energy
    procedure :: penalty_of_rows => qp_penalty_of_rows
    procedure :: load_work => qp_load_work
    procedure :: body_force => qp_body_force
    procedure :: of_vertices => qp_of_vertices
  end type contact_qp_t

contains

  !> Make the QP.
  subroutine qp_init(self, operator, initial_penetration, load_displacement, energy_0, norm_square_0, &
                     foundation, coarse, is_tied, seam)
    class(contact_qp_t), intent(out) :: self
    !> Rows of B, weights, gaps, theta; without its blocks on return.
    type(contact_operator_t), intent(inout) :: operator
    real(dp), intent(in) :: initial_penetration(:)  !! y_0 (n_rows) [length].
    real(dp), intent(in) :: load_displacement(:)  !! B K^+ f (n_rows) [length].
    real(dp), intent(in) :: energy_0  !! Potential energy of the solution without contact [energy].
    real(dp), intent(in) :: norm_square_0  !! Squared energy norm of the solution without contact [energy].
    !> Compliance of a Winkler foundation that stands for the bodies; positive (n_rows) [length/pressure].
    real(dp), intent(in) :: foundation(:)
    type(coarse_space_t), intent(in) :: coarse  !! Coarse space of the same rows.
    logical, intent(in), optional :: is_tied(:)  !! Rows of ties; none if absent (n_rows).
    type(sparse_rows_t), allocatable, intent(in), optional :: seam  !! See `contact_qp_t` (n_rows, n_left).
    integer :: i
    self%n_rows = operator%n_rows
    self%dimension = operator%dimension
    self%pair_first_row = operator%pair_first_row
    self%parent_row = [(i, i=1, operator%n_rows)]
    self%weight = operator%weight
    self%gap = operator%gap
    self%theta = operator%theta
    call move_alloc(operator%block, self%block)
    self%initial_penetration = initial_penetration
    self%load_displacement = load_displacement
    self%energy_0 = energy_0
    self%norm_square_0 = norm_square_0
    self%foundation = foundation
    self%coarse = coarse
    allocate (self%is_tied(operator%n_rows), source=.false.)
    if (present(is_tied)) self%is_tied = is_tied
    if (.not. present(seam)) return
    if (allocated(seam)) self%seam = seam
  end subroutine qp_init

  !> The QP of another load case: the rows are the same.
  subroutine qp_set_loads(self, gap, theta, initial_penetration, load_displacement, energy_0, norm_square_0, coarse)
    class(contact_qp_t), intent(inout) :: self
    real(dp), intent(in) :: gap(:)  !! Gaps d (n_rows) [length].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: initial_penetration(:)  !! As in `init`.
    real(dp), intent(in) :: load_displacement(:)  !! As in `init`.
    real(dp), intent(in) :: energy_0  !! As in `init`.
    real(dp), intent(in) :: norm_square_0  !! As in `init`.
    type(coarse_space_t), intent(in) :: coarse  !! As in `init`.
    self%gap = gap
    self%theta = theta
    self%initial_penetration = initial_penetration
    self%load_displacement = load_displacement
    self%energy_0 = energy_0
    self%norm_square_0 = norm_square_0
    self%coarse = coarse
  end subroutine qp_set_loads

  !> The QP with other modes of the same bodies.
  subroutine qp_replace_modes(self, coarse)
    class(contact_qp_t), intent(inout) :: self
    type(coarse_space_t), intent(in) :: coarse  !! Coarse space of the same rows.
    self%coarse = coarse
  end subroutine qp_replace_modes

  !> The QP with another initial penetration, as more accurate displacements tell it.
  subroutine qp_shift_penetration(self, change)
    class(contact_qp_t), intent(inout) :: self
    real(dp), intent(in) :: change(:)  !! Added to the initial penetration (n_rows) [length].
    self%initial_penetration = self%initial_penetration + change
  end subroutine qp_shift_penetration

  !> The QP with other penalty parameters.
  subroutine qp_replace_theta(self, theta)
    class(contact_qp_t), intent(inout) :: self
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    self%theta = theta
  end subroutine qp_replace_theta

  !> The QP with other gaps.
  subroutine qp_shift_gap(self, change)
    class(contact_qp_t), intent(inout) :: self
    real(dp), intent(in) :: change(:)  !! Added to the gaps (n_rows) [length].
    self%gap = self%gap + change
    self%initial_penetration = self%initial_penetration - change
  end subroutine qp_shift_gap

  !> z = G alpha.
  pure subroutine qp_mode_displacement(self, alpha, z)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (coarse%n) [length].
    real(dp), intent(out) :: z(:)  !! Normal displacements of the rows (n_rows) [length].
    integer :: b, j
    z = 0
    do b = 1, size(self%block)
      do j = 1, size(self%coarse%block(b)%value, 2)
        associate (row => self%block(b)%row)
          z(row) = z(row) + alpha(self%coarse%first(b) + j - 1)*self%coarse%block(b)%value(:, j)
        end associate
      end do
    end do
  end subroutine qp_mode_displacement

  !> The part of G alpha that moves no body: y is `B u - d` plus this.
  pure function qp_opened_by_slides(self, alpha) result(z)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: alpha(:)  !! Amplitudes, with the scale of the modes or without (coarse%n) [length].
    real(dp) :: z(self%n_rows)  !! (n_rows) [length].
    call self%mode_displacement(merge(alpha, 0.0_dp, self%coarse%is_slide), z)
  end function qp_opened_by_slides

  !> e = G^T lambda.
  pure subroutine qp_mode_resultant(self, lambda, e)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: lambda(:)  !! Contact forces, weights included (n_rows) [force].
    real(dp), intent(out) :: e(:)  !! Resultants (coarse%n) [force].
    integer :: b, j
    do b = 1, size(self%block)
      do j = 1, size(self%coarse%block(b)%value, 2)
        e(self%coarse%first(b) + j - 1) = sum(self%coarse%block(b)%value(:, j)*lambda(self%block(b)%row))
      end do
    end do
  end subroutine qp_mode_resultant

  !> C W m = y_0 + G alpha - y, which costs no product.
  pure subroutine find_compliance_product(self, penetration, product, alpha)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    real(dp), intent(out) :: product(:)  !! C W m (n_rows) [length].
    real(dp), intent(in), optional :: alpha(:)  !! Zero if absent (coarse%n) [length].
    product = 0
    if (present(alpha)) call self%mode_displacement(alpha, product)
    product = (self%initial_penetration + product) - penetration
  end subroutine find_compliance_product

  !> The energy norm ||u||_A of u = u_0 - K^+ B^T W m + R alpha [sqrt(energy)].
  pure real(dp) function qp_energy_norm(self, pressure, penetration, alpha) result(norm)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    !> Amplitudes of the rigid body modes; zero if absent (coarse%n) [length].
    real(dp), intent(in), optional :: alpha(:)
    real(dp), allocatable :: product(:)
    allocate (product(size(penetration)))
    call find_compliance_product(self, penetration, product, alpha)
    norm = self%norm_square_0 + sum(self%weight*pressure*(product - 2*self%load_displacement))
    if (present(alpha)) then
      norm = norm + dot_product(alpha, self%coarse%stiffness_forces(alpha))
      if (allocated(self%coarse%lift)) norm = norm - 2*dot_product(alpha, self%coarse%lift)
    end if
    norm = sqrt(max(0.0_dp, norm))
  end function qp_energy_norm

  !> The penalty term (18) of each row (n_rows) [energy]: that of its penetration, or of its force where the penetration
  !> is rounding, which a small theta would magnify; 0 where theta = 0.
  pure function qp_penalty_of_rows(self, pressure, penetration) result(penalty)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    real(dp) :: penalty(size(penetration)), least
    least = rounding*maxval([0.0_dp, abs(self%initial_penetration)])
    penalty = 0
    where (self%theta > 0 .and. penetration > least)
      penalty = self%weight*penetration**2/(2*self%theta)
    else where (self%theta > 0 .and. pressure > 0 .and. penetration > -least)
      penalty = self%weight*self%theta*pressure**2/2
    end where
  end function qp_penalty_of_rows

  !> F_theta(u) of equations (19), (25) [energy]; without the energy of penetrations where theta = 0. The work of the
  !> loads cancels, because u_0 is in equilibrium with them, except for the work on rigid body modes.
  real(dp) function qp_energy(self, pressure, penetration, alpha) result(energy)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    !> Amplitudes of the rigid body modes; zero if absent (coarse%n) [length].
    real(dp), intent(in), optional :: alpha(:)
    real(dp), allocatable :: product(:)
    allocate (product(size(penetration)))
    call find_compliance_product(self, penetration, product, alpha)
    energy = self%energy_0 + 0.5_dp*sum(self%weight*pressure*product) + sum(self%penalty_of_rows(pressure, penetration))
    if (present(alpha)) energy = energy + dot_product(alpha, 0.5_dp*self%coarse%stiffness_forces(alpha) - &
      self%coarse%resultant)
  end function qp_energy

  !> L(u), the work of the loads on u = u_0 - K^+ B^T W m + R alpha [energy].
  pure real(dp) function qp_load_work(self, pressure, alpha) result(work)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(in) :: alpha(:)  !! Amplitudes of the rigid body modes (coarse%n) [length].
    ! F(u_0) = A(u_0,u_0)/2 - L(u_0).
    work = self%norm_square_0/2 - self%energy_0 - sum(self%weight*pressure*self%load_displacement)
    if (size(alpha) > 0) work = work + dot_product(self%coarse%resultant, alpha)
    ! Prescribed displacements do work on near-null-space modes, which is none of the loads.
    if (allocated(self%coarse%lift)) work = work - dot_product(self%coarse%lift, alpha)
  end function qp_load_work

  !> Penetrations in which the rows of one vertex have their mean (n_rows) [length].
  pure function qp_of_vertices(self, penetration) result(mean)
    class(contact_qp_t), intent(in) :: self
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    real(dp), allocatable :: mean(:), weight(:), left(:)
    mean = penetration
    if (.not. allocated(self%seam)) return
    allocate (weight(self%seam%n_columns), left(self%seam%n_columns))
    call self%seam%multiply_transposed(self%weight, weight)
    call self%seam%multiply_transposed(self%weight*penetration, left)
    call self%seam%multiply(left/weight, mean)
  end function qp_of_vertices

  !> Nodal contact forces on one body, - B_b^T W m.
  subroutine qp_body_force(self, b, pressure, force)
    class(contact_qp_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    !> At the contact nodes of the body (dimension, n_contact_nodes) [force].
    real(dp), allocatable, intent(out) :: force(:, :)
    real(dp), allocatable :: flat(:)
    associate (block => self%block(b))
      allocate (flat(self%dimension*size(block%contact_node)))
      call block%matrix%multiply_transposed(self%weight(block%row)*pressure(block%row), flat)
      force = reshape(-flat, [self%dimension, size(block%contact_node)])
    end associate
  end subroutine qp_body_force
end module dotyk_scheme_contact_qp
