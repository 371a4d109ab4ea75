!> The contact problem as every scheme sees it: responses of the bodies, the contact operator, and the scene without contact.
!>
!> With `C = B K^{-1} B^T` (DESIGN.md, section 2) every iterate is `u = u0 - K^{-1} B^T W m`, so its state is one number `m` per contact
!> point, and `y = B u - d = (B u0 - d) - C W m` is all that the contact conditions ask of it. Free bodies (K^+ for K^{-1}) add their
!> rigid motions: `u = u0 - K^+ B^T W m + R alpha`, `y = (B u0 - d) - C W m + G alpha`, with the amplitudes `alpha` of the coarse space.
!>
!> As a linear operator the problem is `Theta^{-1/2} W^{1/2} C W^{1/2} Theta^{-1/2}`: symmetric, with the spectrum of
!> `Theta^{-1} C W`, whose largest eigenvalue L rules the relaxation.
module dotyk_scheme_problem
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_operator_t, contact_block_t
  use dotyk_linalg_spectrum, only: linear_operator_t
  use dotyk_response_response, only: response_t, response_slot_t
  use dotyk_scheme_coarse_space, only: coarse_space_t
  implicit none
  private

  !> Room for one body's part of a sweep.
  type :: sweep_work_t
    !> Forces at this body's rows, and displacements of the same rows (n_rows of the block).
    real(dp), allocatable :: row_force(:), row_displacement(:)
    !> Nodal forces, and displacements (dimension*n_contact_nodes).
    real(dp), allocatable :: force(:), displacement(:)
    !> Compliance of the rows, where it stands for the response (n_rows of the block, n_rows of the block) [length/force].
    real(dp), allocatable :: matrix(:, :)
  end type sweep_work_t

  !> All that a scheme may know.
  type, extends(linear_operator_t), public :: contact_problem_t
    !> Contact points: B, W, d, theta.
    type(contact_operator_t) :: operator
    !> What the bodies answer to contact forces (n_bodies).
    type(response_slot_t), allocatable :: response(:)
    !> Rigid motions that the supports leave to the bodies; none where all are held.
    type(coarse_space_t) :: coarse
    !> B u0 - d (n_rows) [length]: how far the scene without contact penetrates.
    real(dp), allocatable :: y_free(:)
    !> B K^{-1} f with supports at rest (n_rows) [length]: `sum w m y_load` is the work of the loads on K^{-1} B^T W m.
    real(dp), allocatable :: y_load(:)
    !> Compliance of an elastic foundation that stands for the bodies where a scheme needs a first guess (n_rows) [length/pressure].
    real(dp), allocatable :: foundation(:)
    !> F(u0) = A(u0,u0)/2 - L(u0) [energy].
    real(dp) :: energy_free = 0
    !> A(u0,u0) [energy].
    real(dp) :: norm_free = 0
    !> Sweeps over all bodies so far.
    integer :: body_solves = 0
    !> Solves with whole factors for the displacements of bodies.
    integer :: full_solves = 0
    !> True: bodies are solved side by side; false: one after the other (each with all BLAS threads).
    logical :: side_by_side = .true.
    !> Cost of one solve of each body (n_bodies), any unit.
    real(dp), allocatable :: cost(:)
    !> First body of the kind of each body, and the axes of the kind as they are turned with it, as columns; not allocated where nothing is
    !> known of kinds (n_bodies), (dimension, dimension, n_bodies).
    integer, allocatable :: kind(:)
    real(dp), allocatable :: axes(:, :, :)
    !> Bodies that take part, the one with most work first.
    integer, allocatable, private :: sequence(:)
    type(sweep_work_t), allocatable, private :: work(:)
  contains
    procedure :: prepare => problem_prepare
    procedure :: take_matrix => problem_take_matrix
    procedure :: compliance => problem_compliance
    procedure :: apply => problem_apply
    procedure :: norm => problem_norm
    procedure :: energy => problem_energy
    procedure :: distance => problem_distance
    procedure :: body_force => problem_body_force
    procedure :: free_responses => problem_free_responses
    procedure :: destroy => problem_destroy
  end type contact_problem_t

contains

  !> Make room for the sweeps, once operator and responses are there.
  subroutine problem_prepare(self, cost)
    class(contact_problem_t), intent(inout) :: self
    !> Cost of one solve of each body (n_bodies), any unit; bodies are dealt out largest first.
    real(dp), intent(in) :: cost(:)
    integer :: b, n, n_dofs
    if (allocated(self%work)) deallocate (self%work, self%sequence)
    self%cost = cost
    if (.not. allocated(self%operator%origin)) self%operator%origin = [(b, b=1, self%operator%n_rows)]
    allocate (self%work(size(cost)), self%sequence(0))
    do b = 1, size(cost)
      n = size(self%operator%block(b)%row)
      if (n == 0) cycle
      n_dofs = self%operator%dimension*size(self%operator%block(b)%contact_node)
      allocate (self%work(b)%row_force(n), self%work(b)%row_displacement(n))
      allocate (self%work(b)%force(n_dofs), self%work(b)%displacement(n_dofs))
      n = count(cost(self%sequence) >= cost(b))
      self%sequence = [self%sequence(:n), b, self%sequence(n + 1:)]
    end do
  end subroutine problem_prepare

  !> Let the compliance of a body's rows stand for its response in sweeps.
  subroutine problem_take_matrix(self, b, matrix)
    !> Prepared.
    class(contact_problem_t), intent(inout) :: self
    !> Which body.
    integer, intent(in) :: b
    !> (n_rows of its block, n_rows of its block) [length/force].
    real(dp), intent(in) :: matrix(:, :)
    self%work(b)%matrix = matrix
  end subroutine problem_take_matrix

  !> z = C x: forces at the contact points to the displacements B K^{-1} B^T x. One solve of every body that may touch.
  subroutine problem_compliance(self, x, z)
    class(contact_problem_t), intent(inout) :: self
    !> Normal forces at the contact points, weights included (n_rows) [force].
    real(dp), intent(in) :: x(:)
    !> Normal displacements of the same points (n_rows) [length].
    real(dp), intent(out) :: z(:)
    integer :: i, b
    !$omp parallel do default(none) shared(self, x) private(b) schedule(dynamic, 1) if (self%side_by_side)
    do i = 1, size(self%sequence)
      b = self%sequence(i)
      call solve_body(self%operator%block(b), self%response(b)%form, x, self%work(b))
    end do
    !$omp end parallel do
    ! Bodies are added in their own order, so that the sum does not depend on who came first.
    z = 0
    do b = 1, size(self%work)
      if (.not. allocated(self%work(b)%row_displacement)) cycle
      associate (row => self%operator%block(b)%row)
        z(row) = z(row) + self%work(b)%row_displacement
      end associate
    end do
    self%body_solves = self%body_solves + 1
  end subroutine problem_compliance

  !> One body's part of a sweep.
  subroutine solve_body(block, response, x, work)
    !> The body's rows of B.
    type(contact_block_t), intent(in) :: block
    class(response_t), intent(inout) :: response
    !> Forces at all contact points (n_rows).
    real(dp), intent(in) :: x(:)
    type(sweep_work_t), intent(inout) :: work
    work%row_force = x(block%row)
    if (allocated(work%matrix)) then
      work%row_displacement = matmul(work%matrix, work%row_force)
      return
    end if
    call block%matrix%multiply_transposed(work%row_force, work%force)
    call respond(response, response%dimension, response%n_contact_nodes, work%force, work%displacement)
    call block%matrix%multiply(work%displacement, work%row_displacement)
  end subroutine solve_body

  !> A response with its nodal vectors seen as (dimension, n).
  subroutine respond(response, dimension, n, force, displacement)
    class(response_t), intent(inout) :: response
    integer, intent(in) :: dimension, n
    real(dp), intent(in) :: force(dimension, n)
    real(dp), intent(out) :: displacement(dimension, n)
    call response%apply(force, displacement)
  end subroutine respond

  !> y = Theta^{-1/2} W^{1/2} C W^{1/2} Theta^{-1/2} x.
  subroutine problem_apply(self, x, y)
    class(contact_problem_t), intent(inout) :: self
    real(dp), intent(in) :: x(:)
    real(dp), intent(out) :: y(:)
    real(dp), allocatable :: scale(:)
    allocate (scale(self%operator%n_rows))
    scale = sqrt(self%operator%weight/self%operator%theta)
    call self%compliance(scale*x, y)
    y = scale*y
  end subroutine problem_apply

  !> rest = y_free + G alpha [length]: C W m is this minus y.
  subroutine find_rest(self, rest, alpha)
    class(contact_problem_t), intent(in) :: self
    real(dp), intent(out) :: rest(:)
    real(dp), intent(in), optional :: alpha(:)
    rest = 0
    if (present(alpha)) call self%coarse%displacement(self%operator, alpha, rest)
    rest = self%y_free + rest
  end subroutine find_rest

  !> The energy norm ||u||_A of u = u0 - K^+ B^T W m + R alpha [sqrt(energy)].
  real(dp) function problem_norm(self, m, y, alpha) result(norm)
    class(contact_problem_t), intent(in) :: self
    !> State (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Amplitudes of the coarse space; zero where not given (coarse%n) [length].
    real(dp), intent(in), optional :: alpha(:)
    real(dp), allocatable :: rest(:)
    allocate (rest(size(y)))
    call find_rest(self, rest, alpha)
    norm = self%norm_free + sum(self%operator%weight*m*((rest - y) - 2*self%y_load))
    if (present(alpha) .and. allocated(self%coarse%stiffness)) &
      norm = norm + dot_product(alpha, self%coarse%stiffness_forces(alpha) - 2*self%coarse%lift)
    norm = sqrt(max(0.0_dp, norm))
  end function problem_norm

  !> The energy norm of the difference of two states, by a sweep.
  real(dp) function problem_distance(self, m, alpha) result(distance)
    class(contact_problem_t), intent(inout) :: self
    !> Difference of the pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Difference of the amplitudes of the responses' motions (coarse%n) [length].
    real(dp), intent(in) :: alpha(:)
    real(dp), allocatable :: z(:), amplitude(:)
    allocate (z(size(m)))
    call self%compliance(self%operator%weight*m, z)
    amplitude = alpha/self%coarse%scale
    distance = sqrt(max(0.0_dp, sum(self%operator%weight*m*z) + dot_product(amplitude, self%coarse%stiffness_forces(amplitude))))
  end function problem_distance

  !> F_theta(u) of (19) [energy]; without penetrations where theta = 0. The work of the loads cancels, because u0 is in equilibrium
  !> with them, but for the work on rigid motions.
  real(dp) function problem_energy(self, m, y, alpha) result(energy)
    class(contact_problem_t), intent(in) :: self
    !> State (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Amplitudes of the coarse space; zero where not given (coarse%n) [length].
    real(dp), intent(in), optional :: alpha(:)
    real(dp), allocatable :: rest(:)
    allocate (rest(size(y)))
    call find_rest(self, rest, alpha)
    energy = self%energy_free + 0.5_dp*sum(self%operator%weight*m*(rest - y)) + &
      0.5_dp*sum(self%operator%weight*max(0.0_dp, y)**2/self%operator%theta, mask=self%operator%theta > 0)
    if (present(alpha)) energy = energy + dot_product(alpha, 0.5_dp*self%coarse%stiffness_forces(alpha) - self%coarse%resultant)
  end function problem_energy

  !> Nodal contact forces on one body, - B_b^T W m [force].
  subroutine problem_body_force(self, b, m, force)
    class(contact_problem_t), intent(in) :: self
    !> Which body.
    integer, intent(in) :: b
    !> Pressures (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> Forces at the body's contact nodes (dimension, n_contact_nodes).
    real(dp), allocatable, intent(out) :: force(:, :)
    real(dp), allocatable :: flat(:)
    associate (block => self%operator%block(b))
      allocate (flat(self%operator%dimension*size(block%contact_node)))
      call block%matrix%multiply_transposed(self%operator%weight(block%row)*m(block%row), flat)
      force = reshape(-flat, [self%operator%dimension, size(block%contact_node)])
    end associate
  end subroutine problem_body_force

  !> Give back the factors, once nothing is left to solve.
  subroutine problem_free_responses(self)
    class(contact_problem_t), intent(inout) :: self
    integer :: b
    if (.not. allocated(self%response)) return
    do b = 1, size(self%response)
      if (allocated(self%response(b)%form)) call self%response(b)%form%destroy()
    end do
    deallocate (self%response)
  end subroutine problem_free_responses

  !> Give back all memory.
  subroutine problem_destroy(self)
    class(contact_problem_t), intent(inout) :: self
    call self%free_responses()
    if (allocated(self%work)) deallocate (self%work, self%sequence)
    if (allocated(self%y_free)) deallocate (self%y_free, self%y_load)
    if (allocated(self%foundation)) deallocate (self%foundation)
    call self%coarse%destroy()
  end subroutine problem_destroy
end module dotyk_scheme_problem
