!> Static condensation of ties: bodies that are tied together become one body of a smaller quadratic programme, which
!> has the contact rows only.
!>
!> Ties are rows t of the QP without a sign, `y_t = 0`, beside the contact rows c. For the bodies of one group, with the
!> compliance C, the modes G and their stiffness S,
!>
!>     y_c = y0_c - C_cc lambda_c - C_ct lambda_t + G_c alpha,
!>     C_tt lambda_t - G_t alpha = y0_t - C_tc lambda_c,    G_t^T lambda_t + S alpha = e - G_c^T lambda_c.
!>
!> The second line is solved for any lambda_c but for the motions N of the whole group: rigid body motions, `G_t N = 0`,
!> and soft ones (`dotyk_scheme_group_motions`), which strain the bodies a little. With `(P, Q)` its solution for
!> `(C_tc, G_c^T)`, `(lambda_0, alpha_0)` that for `(y0_t, e)`, and F the forces of the ties per amplitude of N,
!> `C_tt F = G_t N`, the group is a body with
!>
!>     C^ = C_cc - C_ct P + G_c Q,    y0^ = y0_c - C_ct lambda_0 + G_c alpha_0,    G^ = G_c N - C_ct F,
!>     S^ = N^T S N + F^T C_tt F,     e^ = N^T (e - G_t^T lambda_0 - S alpha_0),
!>
!> and every scheme solves the programme of groups as it does that of bodies. The dual form of substructuring: C.
!> Farhat, F.-X. Roux, Int. J. Numer. Methods Engrg. 32, 1991. Rows may be linearly dependent (ties that cross each
!> other or run into supports): C_tt plus a small fraction of its diagonal is factorized, and solutions are refined with
!> C_tt itself.
module dotyk_scheme_condensation
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: add_product, transposed_product
  use dotyk_linalg_dense_cholesky, only: dense_cholesky_t
  use dotyk_scheme_active_system, only: proximal_term
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_group_motions, only: group_motions_t
  implicit none
  private

  !> A bolt of given tension: a tie whose sides come closer by an unknown shortening s along a direction n,
  !> `y_t = s n`, until the tie transmits the force. The shortening is one more mode of the group, with
  !> `-sum lambda_t . n` as its equilibrium.
  type, public :: slide_t
    !> First row, number of rows of each component, one component after the other, and number of components.
    integer :: first = 0, n_rows = 0, dimension = 0
    !> Direction (3) [].
    real(dp) :: direction(3) = 0
    !> Tension [force].
    real(dp) :: force = 0
  end type slide_t

  !> Bodies that ties join.
  type, public :: tied_group_t
    !> Rows of the QP from this one on are ties.
    integer :: first_tie = 0
    !> The bodies, ascending (n_bodies).
    integer, allocatable :: body(:)
    !> Rows of the QP: ties of the group, and contact rows that touch one of its bodies; ascending (n_tie), (n_contact).
    integer, allocatable :: tie(:), contact(:)
    !> Modes of its bodies in the coarse space (n_body_modes); the modes of the group are these, and its slides.
    integer, allocatable :: mode(:)
    !> Slides among its ties.
    type(slide_t), allocatable :: slide(:)
    !> C_tt (n_tie, n_tie), C_tc (n_tie, n_contact), C_cc (n_contact, n_contact) [length/force].
    real(dp), allocatable :: c_tt(:, :), c_tc(:, :), c_cc(:, :)
    !> G_t (n_tie, n_modes), G_c (n_contact, n_modes) [].
    real(dp), allocatable :: g_t(:, :), g_c(:, :)
    !> S (n_modes, n_modes) [force/length].
    real(dp), allocatable :: s(:, :)
    !> Motions N of the whole group, as columns; each moves its rows by 1 at most (n_modes, n_motions) [].
    real(dp), allocatable :: free(:, :)
    !> Number of the first of them that nothing resists.
    integer :: n_free = 0
    !> F (n_tie, n_motions) [force/length], G^ (n_contact, n_motions) [], S^ (n_motions, n_motions) [force/length].
    real(dp), allocatable :: tie_forces(:, :), rows(:, :), stiffness(:, :)
    !> Factor of C_tt, and its diagonal (n_tie) [length/force].
    type(dense_cholesky_t), private :: factor
    real(dp), allocatable, private :: diagonal(:)
    !> Inverse of `G_t^T C_tt^{-1} G_t + S` but for the motions N (n_modes, n_modes) [length/force].
    real(dp), allocatable, private :: inverse(:, :)
    !> What remains of resultants without those on the motions N (n_modes, n_modes) [].
    real(dp), allocatable, private :: balance(:, :)
  contains
    procedure :: take_rows => group_take_rows
    procedure :: form => group_form
    procedure :: solve => group_solve
    procedure :: condense => group_condense
    procedure :: resultants => group_resultants
    procedure :: motion_resultants => group_motion_resultants
    procedure :: move => group_move
    procedure :: shortening_work => group_shortening_work
  end type tied_group_t

  !> Rows that yield by less than this fraction of the row that yields most do not yield: supports hold both sides [].
  real(dp), parameter :: least_compliance = 1.0e-12_dp
  !> Rows with ties that yield by less than this fraction of what they yield without are held by the ties: rounding
  !> leaves 1e-16 to 1e-15, and beside the tie of a cantilever 700 times as long as thick a row yields by 4e-10 of what
  !> it yields without the tie [].
  real(dp), parameter :: rounding_of_held = 1.0e-12_dp
  !> Motions of held rows below this are rounding [].
  real(dp), parameter :: rounding_of_moves = 1.0e-9_dp
  !> The proximal term of ties is this fraction of that of contact rows, 1e-11 of the diagonal: the compliance of a
  !> facet of a slender body is as small beside that of its bending [].
  real(dp), parameter :: proximal_fraction = 1.0e-2_dp
  !> Steps of iterative refinement at most, and the fraction to which a step reduces the residual where more are worth
  !> it.
  integer, parameter :: most_refinements = 40
  real(dp), parameter :: worthwhile_gain = 0.5_dp

contains

  !> Find the bodies, rows and modes of a group.
  subroutine group_take_rows(self, qp, first_tie, group_of, group, slide)
    class(tied_group_t), intent(inout) :: self
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Rows from this one on are ties.
    integer, intent(in) :: first_tie
    !> Group of each body (n_bodies).
    integer, intent(in) :: group_of(:)
    !> Number of the group.
    integer, intent(in) :: group
    !> Slides of all groups (n_slides).
    type(slide_t), intent(in) :: slide(:)
    logical :: touches(qp%n_rows)
    integer :: i, b, k
    self%first_tie = first_tie
    self%body = pack([(b, b=1, size(group_of))], group_of == group)
    touches = .false.
    allocate (self%mode(0))
    do i = 1, size(self%body)
      b = self%body(i)
      touches(qp%block(b)%row) = .true.
      self%mode = [self%mode, [(k, k=qp%coarse%first(b), qp%coarse%first(b + 1) - 1)]]
    end do
    self%contact = pack([(i, i=1, first_tie - 1)], touches(:first_tie - 1))
    self%tie = pack([(i, i=first_tie, qp%n_rows)], touches(first_tie:))
    self%slide = pack(slide, touches(slide%first))
  end subroutine group_take_rows

  !> Collect the compliance of the bodies, factorize that of the ties, and find the motions of the group.
  subroutine group_form(self, qp, compliance, error)
    !> With bodies, rows and modes.
    class(tied_group_t), intent(inout) :: self
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Formed at all rows.
    class(compliance_t), intent(in) :: compliance
    !> Allocated where the compliance of the ties has no factor: an entry is not a number.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: entries(:, :), proximal(:)
    real(dp) :: largest
    integer :: place(qp%n_rows), i, j, k, b, n, n_modes, failed
    n = size(self%tie)
    n_modes = size(self%mode) + size(self%slide)
    place = 0
    place(self%contact) = [(i, i=1, size(self%contact))]
    place(self%tie) = [(i, i=1, n)]
    allocate (self%c_tt(n, n), self%c_tc(n, size(self%contact)), self%c_cc(size(self%contact), size(self%contact)), &
              self%g_t(n, n_modes), self%g_c(size(self%contact), n_modes), self%s(n_modes, n_modes), source=0.0_dp)
    k = 0
    do i = 1, size(self%body)
      b = self%body(i)
      associate (row => qp%block(b)%row, g => qp%coarse%block(b)%value)
        ! Rows are ascending: contact rows come before ties.
        j = count(row < self%first_tie)
        call compliance%get_entries(qp, b, row, entries)
        associate (c => place(row(:j)), t => place(row(j + 1:)), last => k + size(g, 2))
          self%c_cc(c, c) = self%c_cc(c, c) + entries(:j, :j)
          self%c_tc(t, c) = self%c_tc(t, c) + entries(j + 1:, :j)
          self%c_tt(t, t) = self%c_tt(t, t) + entries(j + 1:, j + 1:)
          self%g_c(c, k + 1:last) = g(:j, :)
          self%g_t(t, k + 1:last) = g(j + 1:, :)
          if (allocated(qp%coarse%stiffness)) self%s(k + 1:last, k + 1:last) = qp%coarse%stiffness(b)%value
        end associate
        k = k + size(g, 2)
      end associate
    end do
    do i = 1, size(self%slide)
      associate (own => self%slide(i))
        do j = 1, own%dimension
          self%g_t(place([(b, b=own%first + (j - 1)*own%n_rows, own%first + j*own%n_rows - 1)]), k + i) = &
            -own%direction(j)
        end do
      end associate
    end do
    self%diagonal = [(self%c_tt(i, i), i=1, n)]
    largest = maxval([tiny(largest), self%diagonal])
    where (.not. self%diagonal > least_compliance*largest) self%diagonal = largest
    proximal = proximal_fraction*proximal_term(self%diagonal, 0*self%diagonal, qp%weight(self%tie))
    call self%factor%resize(n)
    do i = 1, n
      self%factor%value((i - 1)*n + 1:i*n) = self%c_tt(:, i)
      self%factor%value((i - 1)*n + i) = self%diagonal(i) + proximal(i)
    end do
    call self%factor%factorize(failed)
    if (failed > 0) then
      call set_error(error, 'the compliance matrix of the ties is not positive definite', exit_not_solvable)
      return
    end if
    if (n > 0) then
      call find_motions(self, error)
    else
      allocate (self%free(n_modes, n_modes), self%tie_forces(n, n_modes), source=0.0_dp)
      do i = 1, n_modes
        self%free(i, i) = 1
      end do
      self%n_free = n_modes
      self%rows = self%g_c
      self%stiffness = self%s
    end if
  end subroutine group_form

  !> The motions N of the whole group, and the inverse of the stiffness of the ties against all others.
  subroutine find_motions(self, error)
    !> Factorized.
    type(tied_group_t), intent(inout) :: self
    !> Allocated where LAPACK finds no eigenvalues.
    type(error_t), allocatable, intent(out) :: error
    type(group_motions_t) :: motions
    real(dp), allocatable :: y(:, :), stiffness(:, :), forces(:, :), change(:, :)
    real(dp) :: most
    integer :: i
    allocate (stiffness, mold=self%s)
    y = self%g_t
    call self%factor%solve_columns(y)
    call transposed_product(self%g_t, y, stiffness)
    call motions%find((stiffness + transpose(stiffness))/2 + self%s, self%s, error)
    if (allocated(error)) return
    call move_alloc(motions%balance, self%balance)
    call move_alloc(motions%inverse, self%inverse)
    call move_alloc(motions%motion, self%free)
    self%n_free = motions%n_free
    do i = 1, size(self%free, 2)
      most = maxval([0.0_dp, abs(matmul(self%g_c, self%free(:, i)))])
      if (most > least_compliance*maxval(abs(self%free(:, i)))) then
        self%free(:, i) = self%free(:, i)/most
      else
        self%free(:, i) = self%free(:, i)/maxval(abs(self%free(:, i)))
      end if
    end do
    allocate (self%tie_forces(size(self%tie), size(self%free, 2)), source=0.0_dp)
    self%rows = matmul(self%g_c, self%free)
    allocate (self%stiffness(size(self%free, 2), size(self%free, 2)), source=0.0_dp)
    if (self%n_free == size(self%free, 2)) return
    associate (soft => self%free(:, self%n_free + 1:), f => self%tie_forces(:, self%n_free + 1:))
      call self%solve(matmul(self%g_t, soft), -matmul(self%s, soft), forces, change)
      f = forces
      soft = soft + change
      self%rows(:, self%n_free + 1:) = matmul(self%g_c, soft) - matmul(transpose(self%c_tc), f)
      ! Stationary in the motion and its forces: as accurate as both products.
      self%stiffness(self%n_free + 1:, self%n_free + 1:) = matmul(transpose(soft), matmul(self%s, soft)) + &
                                                           matmul(transpose(f), matmul(self%c_tt, f))
    end associate
    self%stiffness = (self%stiffness + transpose(self%stiffness))/2
  end subroutine find_motions

  !> Solve `C_tt lambda - G_t alpha = b, G_t^T lambda + S alpha = c` for many right-hand sides; without the resultants c
  !> on the motions N, which get amplitude 0.
  subroutine group_solve(self, b, c, lambda, alpha, residual, energy, worst)
    class(tied_group_t), intent(in) :: self
    !> (n_tie, n) [length].
    real(dp), intent(in), contiguous :: b(:, :)
    !> (n_modes, n) [force].
    real(dp), intent(in), contiguous :: c(:, :)
    !> (n_tie, n) [force].
    real(dp), allocatable, intent(out) :: lambda(:, :)
    !> (n_modes, n) [length].
    real(dp), allocatable, intent(out) :: alpha(:, :)
    !> What the ties still open by, the largest of all (1) [length].
    real(dp), intent(out), optional :: residual
    !> Twice the strain energy that it takes to close them, and to balance the forces that are left [energy].
    real(dp), intent(out), optional :: energy
    !> Place among the ties of the row that opens most.
    integer, intent(out), optional :: worst
    real(dp), allocatable, dimension(:, :) :: r_b, r_c, step, step_alpha, half, closing
    real(dp) :: left, previous
    integer :: k
    allocate (lambda(size(b, 1), size(b, 2)), alpha(size(c, 1), size(c, 2)), source=0.0_dp)
    allocate (half, r_c, step_alpha, mold=c)
    r_b = b
    r_c = 0
    call add_product(1.0_dp, self%balance, c, r_c)
    previous = huge(previous)
    do k = 1, most_refinements
      step = r_b
      call self%factor%solve_columns(step)
      call transposed_product(self%g_t, step, half)
      half = r_c - half
      step_alpha = 0
      call add_product(1.0_dp, self%inverse, half, step_alpha)
      step = r_b
      call add_product(1.0_dp, self%g_t, step_alpha, step)
      call self%factor%solve_columns(step)
      step = lambda + step
      step_alpha = alpha + step_alpha
      r_b = b
      call add_product(-1.0_dp, self%c_tt, step, r_b)
      call add_product(1.0_dp, self%g_t, step_alpha, r_b)
      call transposed_product(self%g_t, step, half)
      call add_product(1.0_dp, self%s, step_alpha, half)
      half = c - half
      r_c = 0
      call add_product(1.0_dp, self%balance, half, r_c)
      left = sum(sum(r_b**2, 2)/max(tiny(left), self%diagonal)) + sum(r_c*matmul(self%inverse, r_c))
      ! Where rounding dominates, residuals do not fall, and the step is not taken.
      if (k > 1 .and. .not. left < previous) exit
      lambda = step
      alpha = step_alpha
      if (present(residual)) residual = maxval([0.0_dp, abs(r_b)])
      if (present(worst)) worst = maxloc(maxval(abs(r_b), 2), 1)
      if (present(energy)) then
        closing = r_b
        call self%factor%solve_columns(closing)
        energy = sum(r_b*closing) + sum(r_c*matmul(self%inverse, r_c))
      end if
      if (.not. left < worthwhile_gain*previous) exit
      previous = left
    end do
  end subroutine group_solve

  !> Forces on the modes of the group: of its bodies, and the tensions of its slides.
  pure function group_resultants(self, of_bodies) result(resultants)
    class(tied_group_t), intent(in) :: self
    !> On all modes of the bodies (coarse%n) [force].
    real(dp), intent(in) :: of_bodies(:)
    !> (n_modes) [force]
    real(dp), allocatable :: resultants(:)
    resultants = [of_bodies(self%mode), self%slide%force]
  end function group_resultants

  !> Forces on the motions N, e^.
  pure function group_motion_resultants(self, resultants, lambda, alpha) result(on_motions)
    class(tied_group_t), intent(in) :: self
    !> On the modes of the group (n_modes) [force].
    real(dp), intent(in) :: resultants(:)
    !> Forces of the ties in the solution without contact, the motions N at rest (n_tie) [force].
    real(dp), intent(in) :: lambda(:)
    !> Its amplitudes of the modes of the bodies (number of these) [length].
    real(dp), intent(in) :: alpha(:)
    real(dp) :: on_motions(size(self%free, 2))
    on_motions = matmul(resultants, self%free)
    associate (soft => self%free(:, self%n_free + 1:), n => size(self%mode))
      on_motions(self%n_free + 1:) = on_motions(self%n_free + 1:) - matmul(lambda, matmul(self%g_t, soft)) - &
                                     matmul(alpha, matmul(self%s(:n, :), soft))
    end associate
  end function group_motion_resultants

  !> Add to the right-hand sides of `solve` what the soft ones of the motions N open the ties and resist.
  pure subroutine group_move(self, beta, b, c)
    class(tied_group_t), intent(in) :: self
    !> Amplitudes of the motions N (n_motions) [length].
    real(dp), intent(in) :: beta(:)
    !> (n_tie) [length].
    real(dp), intent(inout) :: b(:)
    !> (n_modes) [force].
    real(dp), intent(inout) :: c(:)
    real(dp), allocatable :: alpha(:)
    alpha = matmul(self%free(:, self%n_free + 1:), beta(self%n_free + 1:))
    b = b + matmul(self%g_t, alpha)
    c = c - matmul(self%s, alpha)
  end subroutine group_move

  !> Work of the tensions on the slides.
  pure real(dp) function group_shortening_work(self, alpha) result(work)
    class(tied_group_t), intent(in) :: self
    !> Amplitudes of the modes of the group (n_modes) [length].
    real(dp), intent(in) :: alpha(:)
    work = dot_product(self%slide%force, alpha(size(self%mode) + 1:))
  end function group_shortening_work

  !> C^, the compliance of the contact rows with closed ties. Rows of vertices that ties hold on both sides do not
  !> yield: what is left of their compliance is rounding.
  subroutine group_condense(self, compliance, is_held)
    class(tied_group_t), intent(in) :: self
    !> Symmetric; 0 in rows and columns that are held (n_contact, n_contact) [length/force].
    real(dp), allocatable, intent(out) :: compliance(:, :)
    !> Whether ties hold the row (n_contact).
    logical, allocatable, intent(out) :: is_held(:)
    real(dp), allocatable :: p(:, :), q(:, :), by_ties(:, :), by_modes(:, :), moves(:)
    integer :: i
    compliance = self%c_cc
    allocate (is_held(size(compliance, 1)), source=.false.)
    if (size(self%tie) == 0 .or. size(compliance) == 0) return
    call self%solve(self%c_tc, transpose(self%g_c), p, q)
    allocate (by_ties, by_modes, mold=compliance)
    call transposed_product(self%c_tc, p, by_ties)
    by_modes = 0
    call add_product(1.0_dp, self%g_c, q, by_modes)
    compliance = compliance - by_ties + by_modes
    compliance = (compliance + transpose(compliance))/2
    allocate (moves(size(is_held)), source=0.0_dp)
    if (size(self%free, 2) > 0) moves = maxval(abs(self%rows), 2)
    do i = 1, size(is_held)
      is_held(i) = abs(compliance(i, i)) <= rounding_of_held*(abs(self%c_cc(i, i)) + abs(by_ties(i, i)) + &
                                                               abs(by_modes(i, i))) .and. moves(i) <= rounding_of_moves
    end do
    do i = 1, size(is_held)
      if (.not. is_held(i)) cycle
      compliance(:, i) = 0
      compliance(i, :) = 0
    end do
  end subroutine group_condense
end module dotyk_scheme_condensation
