!> The linear system of an active set: contact forces on the active rows, and amplitudes of the rigid body modes.
!>
!> With M = C + Theta W^{-1} on the active rows, G their rows of the coarse space, and S the stiffness of the modes,
!> that of near-null-space modes and of the springs that keep floating bodies (`dotyk_scheme_proximal_motion`):
!>
!>     M lambda - G alpha = b,    G^T lambda + S alpha = c.
!>
!> It is symmetric quasi-definite, and solved by conjugate gradients with the constraint preconditioner
!> `[M_p -G; -G^T -S]` (Keller, Gould, Wathen, SIAM J. Matrix Anal. Appl. 21, 2000), M_p being M without some of the
!> couplings of the rows:
!>
!>  - none left out: M_p = M, and the solution is a direct one with iterative refinement;
!>  - couplings of different pairs: contacts yield near their points, and a body couples its pairs weakly; the number of
!>    iterations depends on the shape of the bodies, not on how many there are;
!>  - all couplings, and an approximate diagonal: nothing but products with the compliance is needed.
!>
!> CHOLMOD factorizes M_p, and the stiffness `H = G^T M_p^{-1} G + S` of rigid bodies on their contacts, as in FETI the
!> coarse problem. All iterates are in equilibrium with c, where conjugate gradients see the positive definite M (Gould,
!> Hribar, Nocedal, SIAM J. Sci. Comput. 23, 2001).
!>
!> With theta = 0 rows can be linearly dependent and M singular: M_p has a small fraction of its diagonal more, the
!> proximal point method (Rockafellar, SIAM J. Control Optim. 14, 1976). Consistent equations are solved exactly,
!> redundant rows share the force of least norm. The fraction goes with 1/w, as a penalty theta does: the norm is that
!> of the pressures, sum lambda^2/w, and redundant forces are the limit of those with theta -> 0. With ties it is a
!> hundredth of that: the compliance of a facet of a slender body is as small beside that of its bending.
module dotyk_scheme_active_system
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemv, dsyrk
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_clique_matrix, only: clique_t, assemble_cliques
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_stiffness, only: mode_stiffness_t
  implicit none
  private

  !> Couplings of rows that the preconditioner knows: all, those within a pair, none.
  integer, parameter, public :: coupling_all = 1, coupling_pairs = 2, coupling_none = 3

  type :: pair_rows_t  !! Rows of a contact pair.
    integer :: first = 1, last = 0  !! Active rows first .. last.
    !> Bodies, 0 where there are fewer than of other rows; and their numbers of modes (n).
    integer, allocatable :: body(:), n_modes(:)
  end type pair_rows_t

  type, public :: active_system_t  !! The system. It owns factors: never copy it, destroy it in the end.
    integer :: coupling = coupling_all  !! One of `coupling_*`.
    !> Whether all couplings may be taken where those within pairs turn out not to suffice.
    logical :: may_couple_all = .false.
    integer, allocatable :: row(:)  !! Active rows of the contact operator, ascending (n).
    real(dp), allocatable :: layer(:)  !! Compliance theta/w of the Winkler layer there (n) [length/force].
    !> Solutions end where the residual of the start is reduced to this fraction; 0: at rounding [].
    real(dp) :: reduction = 0
    !> Steps of Newton's method need no more accuracy: fraction of the energy of the step that may be left in the
    !> residual; 0: rounding [].
    real(dp) :: step_reduction = 0
    !> Iterations of all solutions so far, and number of solutions; pointers, since solutions do not change the system.
    integer, pointer :: n_iterations => null(), n_solutions => null()
    real(dp), allocatable, private :: diagonal(:)  !! Diagonal of C, or an approximate one (n) [length/force].
    type(pair_rows_t), allocatable, private :: pair(:)  !! The pairs (n_pairs).
    !> Rows of the QP that all others are restrictions of, for which the pattern and C stand in `matrix` (n).
    integer, allocatable, private :: parent(:)
    integer, private :: level = 0  !! Aggregations of that QP.
    !> C with the couplings that M_p has; and the factor of M_p [length/force].
    type(sparse_symmetric_t), private :: matrix
    type(cholesky_t), private :: factor
    !> L^{-1} G with the factor L of M_p: columns of all modes where all rows couple, of the modes of the two bodies of
    !> the pair of each row elsewhere (n, number of columns) [sqrt(force/length)].
    real(dp), allocatable, private :: half(:, :)
    type(mode_stiffness_t), private :: network  !! H.
  contains
    procedure :: init => system_init
    procedure :: solve => system_solve
    procedure :: is_for => system_is_for
    procedure :: needs_entries => system_needs_entries
    procedure :: forget => system_forget
    procedure :: destroy => system_destroy
  end type active_system_t

  !> Proximal term: the fraction of the diagonal of M that is added before the factorization. Far above the rounding of
  !> M (1e-16 of it), far below what slows down the refinement: each step gains nine digits where rows are independent.
  real(dp), parameter :: proximal_fraction = 1.0e-9_dp
  !> Most of it, where weights or stiffnesses differ: six digits a step.
  real(dp), parameter :: most_proximal_fraction = 1.0e-6_dp
  real(dp), parameter :: proximal_of_ties = 1.0e-2_dp  !! With ties, over the same without.
  !> A residual in the norm of the preconditioner is rounding at this fraction of the right-hand side.
  real(dp), parameter :: tolerance = 1.0e-14_dp
  !> Conjugate gradients begin anew, from the true residual, when they have reduced it to this fraction.
  real(dp), parameter :: restart = 1.0e-8_dp
  !> Iterations from one true residual to the next at most, and true residuals.
  integer, parameter :: most_iterations = 2000, most_rounds = 8
  !> Rounds at most with ties where all rows couple: refinements of a direct solution.
  integer, parameter :: most_rounds_of_ties = 40
  !> Iterations of a solution with the couplings within pairs: balls in a box take 1 to 20, bodies whose contacts lie
  !> close together a hundred.
  integer, parameter :: most_of_pairs = 30
  !> Rounds go on while the squared residual falls to this fraction (of contact rows, of equilibrium).
  real(dp), parameter :: worthwhile_gain = 0.1_dp, worthwhile_gain_of_equilibrium = 0.01_dp
  !> The same of rows where there are ties: solutions cost little beside factors.
  real(dp), parameter :: worthwhile_gain_of_ties = 0.5_dp
  !> Directions whose forces are out of equilibrium by this fraction are rounding errors: as many rows as modes leave no
  !> self-equilibrated forces.
  real(dp), parameter :: most_imbalance = 1.0e-5_dp
  !> Compliance of rows between prescribed displacements, which get no force, as a multiple of the largest one.
  real(dp), parameter :: no_force = 1.0e16_dp

contains

  !> Whether it needs the entries of the compliance at the active rows.
  pure logical function system_needs_entries(self) result(needed)
    class(active_system_t), intent(in) :: self
    needed = self%coupling /= coupling_none
  end function system_needs_entries

  !> Whether the system is prepared for an active set.
  pure logical function system_is_for(self, qp, active) result(is_for)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it may have been made for.
    logical, intent(in) :: active(:)  !! The active set (n_rows).
    is_for = .false.
    if (.not. allocated(self%row)) return
    if (size(self%row) /= count(active)) return
    is_for = all(active(self%row)) .and. .not. any(abs(self%layer - qp%theta(self%row)/qp%weight(self%row)) > 0)
  end function system_is_for

  !> Prepare the system of an active set; another one may stand there before. Rows that are the same as before keep
  !> their entries.
  subroutine system_init(self, qp, compliance, active, error, theta)
    class(active_system_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, and rigid body modes with their stiffness.
    !> Compliance operator, formed at all active rows unless the coupling is none.
    class(compliance_t), intent(inout) :: compliance
    logical, intent(in) :: active(:)  !! The active set (n_rows).
    !> M_p or H is not positive definite: rows are linearly dependent to rounding with theta = 0, or an entry is not a
    !> number. Or METIS or CHOLMOD has no memory.
    type(error_t), allocatable, intent(out) :: error
    real(dp), intent(in), optional :: theta(:)  !! In place of that of the QP (n_rows) [length/pressure].
    integer :: i, failed
    logical :: is_known, is_singular
    if (.not. associated(self%n_iterations)) allocate (self%n_iterations, self%n_solutions, source=0)
    if (self%coupling == coupling_pairs .and. self%may_couple_all .and. &
        self%n_iterations > most_of_pairs*self%n_solutions) then
      self%coupling = coupling_all
      if (allocated(self%parent)) deallocate (self%parent)
    end if
    self%row = pack([(i, i=1, size(active))], active)
    self%layer = qp%theta(self%row)/qp%weight(self%row)
    if (present(theta)) self%layer = theta(self%row)/qp%weight(self%row)
    is_known = .false.
    if (allocated(self%parent)) then
      is_known = self%level == qp%level .and. size(self%parent) == size(self%row)
      if (is_known) is_known = all(self%parent == qp%parent_row(self%row))
    end if
    if (.not. is_known) then
      call form_matrix(self, qp, compliance, error)
      if (allocated(error)) return
      self%parent = qp%parent_row(self%row)
      self%level = qp%level
    end if
    associate (k => self%matrix%column_start(:size(self%row)) + 1)
      self%matrix%value(k) = self%diagonal + self%layer + merge(proximal_of_ties, 1.0_dp, any(qp%is_tied(self%row)))* &
        proximal_term(self%diagonal + self%layer, self%layer, qp%weight(self%row))
    end associate
    call self%factor%factorize(self%matrix, failed, error)
    if (allocated(error)) return
    is_singular = failed > 0
    if (.not. is_singular) then
      call form_network(self, qp)
      call self%network%factorize(is_singular, error)
      if (allocated(error)) return
    end if
    if (.not. is_singular) return
    deallocate (self%row)
    call set_error(error, 'the compliance matrix of the active constraints is not positive definite '// &
                   '(constraints are linearly dependent to rounding): a spring that holds a body may be too weak '// &
                   'beside its elements, a stiffer one or a support helps; else give a greater theta', &
                   exit_not_solvable)
  end subroutine system_init

  !> What is added to the diagonal of M for the factorization: the same theta on all rows without a layer, as far as
  !> that is a small fraction of the diagonal [length/force].
  pure function proximal_term(diagonal, layer, weight) result(term)
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of M (n) [length/force].
    real(dp), intent(in) :: layer(:)  !! Compliance theta/w of the layer (n) [length/force].
    real(dp), intent(in) :: weight(:)  !! Weights of the rows (n) [length^2; length in two dimensions].
    real(dp) :: term(size(diagonal))
    real(dp) :: theta
    theta = maxval(diagonal*weight, mask=.not. layer > 0)
    term = proximal_fraction*diagonal
    where (.not. layer > 0) term = max(term, min(proximal_fraction*theta/weight, most_proximal_fraction*diagonal))
  end function proximal_term

  !> C with the couplings of M_p, its symbolic factorization, and that of H.
  subroutine form_matrix(self, qp, compliance, error)
    type(active_system_t), intent(inout) :: self  !! Its rows are taken.
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    type(error_t), allocatable, intent(out) :: error  !! As in `init`.
    type(clique_t), allocatable :: clique(:)
    integer, allocatable :: order(:), member(:), first(:)
    real(dp), allocatable :: yields(:)
    integer :: i, p, k, n
    if (allocated(self%parent)) deallocate (self%parent)
    call find_pairs(qp, self%row, self%pair)
    n = size(self%row)
    select case (self%coupling)
    case (coupling_all)
      call couple_bodies(qp, self%row, compliance, clique)
    case (coupling_pairs)
      call couple_pairs(qp, self%row, self%pair, compliance, clique)
    case default
      allocate (clique(0))
    end select
    call assemble_cliques(n, clique, self%pair%first, self%matrix, order, error)
    if (allocated(error)) return
    deallocate (clique)
    if (self%coupling == coupling_none) then
      allocate (yields(qp%n_rows))
      call compliance%nodal_diagonal(qp, yields)
      self%diagonal = yields(self%row)
      where (.not. self%diagonal + self%layer > 0) self%diagonal = no_force*max(tiny(1.0_dp), maxval(yields))
    else
      self%diagonal = self%matrix%value(self%matrix%column_start(:n) + 1)
    end if
    call self%factor%analyze(self%matrix, order, error)
    if (allocated(error)) return
    ! Bodies that H couples: those of each pair, or all together.
    allocate (member(size(self%pair)*size(qp%coarse%body, 1)), first(size(self%pair) + 1), source=1)
    n = 0
    do p = 1, size(self%pair)
      do k = 1, size(self%pair(p)%body)
        if (self%pair(p)%n_modes(k) == 0) cycle
        n = n + 1
        member(n) = self%pair(p)%body(k)
      end do
      first(p + 1) = n + 1
    end do
    if (self%coupling == coupling_all) then
      member = pack([(i, i=1, size(qp%block))], qp%coarse%first(2:) > qp%coarse%first(:size(qp%block)))
      first = [1, size(member) + 1]
    end if
    call self%network%init(qp%coarse%first, first, member(:first(size(first)) - 1), error)
  end subroutine form_matrix

  !> Successive active rows of the same pair and bodies.
  subroutine find_pairs(qp, row, pair)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    integer, intent(in) :: row(:)  !! Active rows, ascending (n).
    type(pair_rows_t), allocatable, intent(out) :: pair(:)  !! (n_pairs)
    type(pair_rows_t), allocatable :: found(:)
    integer :: i, k, n, at, b
    logical :: is_new
    allocate (found(size(row)))
    n = 0
    at = 0
    do i = 1, size(row)
      is_new = i == 1
      do while (row(i) >= qp%pair_first_row(at + 1))
        at = at + 1
        is_new = .true.
      end do
      if (.not. is_new) is_new = any(qp%coarse%body(:, row(i)) /= found(n)%body)
      if (is_new) then
        n = n + 1
        found(n)%first = i
        found(n)%body = qp%coarse%body(:, row(i))
        found(n)%n_modes = 0*found(n)%body
        do k = 1, size(found(n)%body)
          b = found(n)%body(k)
          if (b > 0) found(n)%n_modes(k) = qp%coarse%first(b + 1) - qp%coarse%first(b)
        end do
      end if
      found(n)%last = i
    end do
    pair = found(:n)
  end subroutine find_pairs

  !> The compliance of each body couples all its rows.
  subroutine couple_bodies(qp, row, compliance, clique)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: row(:)  !! Active rows, ascending (n).
    class(compliance_t), intent(in) :: compliance  !! Compliance operator, formed at the rows.
    type(clique_t), allocatable, intent(out) :: clique(:)  !! Those of the bodies (n_bodies).
    integer :: number(qp%n_rows), b, i
    number = 0
    number(row) = [(i, i=1, size(row))]
    allocate (clique(size(qp%block)))
    do b = 1, size(clique)
      associate (own => qp%block(b)%row)
        clique(b)%row = pack(number(own), number(own) > 0)
        call compliance%get_entries(qp, b, row(clique(b)%row), clique(b)%value)
      end associate
    end do
  end subroutine couple_bodies

  !> The compliances of its two bodies couple the rows of each pair.
  subroutine couple_pairs(qp, row, pair, compliance, clique)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: row(:)  !! Active rows, ascending (n).
    type(pair_rows_t), intent(in) :: pair(:)  !! The pairs (n_pairs).
    class(compliance_t), intent(in) :: compliance  !! Compliance operator, formed at the rows.
    type(clique_t), allocatable, intent(out) :: clique(:)  !! Those of the pairs (n_pairs).
    real(dp), allocatable :: entries(:, :)
    integer :: p, k, i, n
    allocate (clique(size(pair)))
    do p = 1, size(pair)
      clique(p)%row = [(i, i=pair(p)%first, pair(p)%last)]
      n = size(clique(p)%row)
      allocate (clique(p)%value(n, n), source=0.0_dp)
      do k = 1, size(pair(p)%body)
        if (pair(p)%body(k) == 0) cycle
        call compliance%get_entries(qp, pair(p)%body(k), row(clique(p)%row), entries)
        clique(p)%value = clique(p)%value + entries
      end do
    end do
  end subroutine couple_pairs

  !> L^{-1} G, and H.
  subroutine form_network(self, qp)
    type(active_system_t), intent(inout) :: self  !! M_p is factorized; sets `half` and `network`.
    type(contact_qp_t), intent(in) :: qp  !! With the coarse space.
    real(dp), allocatable :: h(:, :)
    integer :: b, c, p, k, l, n, n_columns
    call self%network%clear()
    n = size(self%row)
    n_columns = qp%coarse%n
    if (self%coupling /= coupling_all) n_columns = maxval([0, (sum(self%pair(p)%n_modes), p=1, size(self%pair))])
    if (allocated(self%half)) then
      if (any(shape(self%half) /= [n, n_columns])) deallocate (self%half)
    end if
    if (.not. allocated(self%half)) allocate (self%half(n, n_columns))
    if (self%coupling == coupling_all) then
      call qp%coarse%rows(self%row, self%half)
    else
      call rows_of_pairs(self, qp, self%half)
    end if
    if (size(self%half) > 0) call self%factor%solve_forward(self%half)
    associate (first => qp%coarse%first, n_bodies => size(qp%block))
      if (self%coupling == coupling_all) then
        allocate (h(n_columns, n_columns), source=0.0_dp)
        if (size(self%half) > 0) &
          call dsyrk('L', 'T', n_columns, n, 1.0_dp, self%half, n, 0.0_dp, h, n_columns)
        do b = 1, n_bodies
          do c = 1, b
            call self%network%add(b, c, h(first(b):first(b + 1) - 1, first(c):first(c + 1) - 1))
          end do
        end do
      else
        do p = 1, size(self%pair)
          associate (of_pair => self%half(self%pair(p)%first:self%pair(p)%last, :sum(self%pair(p)%n_modes)), &
                     m => self%pair(p)%n_modes)
            h = matmul(transpose(of_pair), of_pair)
            do k = 1, size(m)
              do l = 1, k
                if (m(k)*m(l) > 0) call self%network%add(self%pair(p)%body(k), self%pair(p)%body(l), &
                  h(sum(m(:k - 1)) + 1:sum(m(:k)), sum(m(:l - 1)) + 1:sum(m(:l))))
              end do
            end do
          end associate
          deallocate (h)
        end do
      end if
      if (.not. allocated(qp%coarse%stiffness)) return
      do b = 1, n_bodies
        call self%network%add(b, b, qp%coarse%stiffness(b)%value)
      end do
    end associate
  end subroutine form_network

  !> G at the active rows: the modes of the bodies of each pair one after the other.
  pure subroutine rows_of_pairs(self, qp, g)
    type(active_system_t), intent(in) :: self  !! With rows and pairs.
    type(contact_qp_t), intent(in) :: qp  !! With the coarse space.
    real(dp), intent(out) :: g(:, :)  !! (n, most modes of a pair) [].
    integer :: p, i, k, at
    g = 0
    do p = 1, size(self%pair)
      at = 0
      do k = 1, size(self%pair(p)%body)
        associate (b => self%pair(p)%body(k), n => self%pair(p)%n_modes(k))
          if (n == 0) cycle
          do i = self%pair(p)%first, self%pair(p)%last
            g(i, at + 1:at + n) = qp%coarse%block(b)%value(qp%coarse%place(k, self%row(i)), :)
          end do
          at = at + n
        end associate
      end do
    end do
  end subroutine rows_of_pairs

  !> Solve `M_p x - G alpha = r`, `G^T x + S alpha = e`: the modes between both halves of a solution with M_p.
  subroutine apply_preconditioner(self, qp, r, e, x, alpha)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for.
    real(dp), intent(in) :: r(:)  !! At the active rows (n) [length].
    real(dp), intent(in), optional :: e(:)  !! On the modes; 0 if absent (coarse%n) [force].
    real(dp), intent(out), contiguous :: x(:)  !! Forces (n) [force].
    real(dp), intent(out), contiguous :: alpha(:)  !! Amplitudes (coarse%n) [length].
    real(dp) :: half(size(r), 1)
    integer :: p, k, j, at, mode
    half(:, 1) = r
    if (size(r) > 0) call self%factor%solve_forward(half)
    alpha = 0
    if (present(e)) alpha = e
    if (self%coupling == coupling_all) then
      if (size(self%half) > 0) &
        call dgemv('T', size(r), size(alpha), -1.0_dp, self%half, size(r), half, 1, 1.0_dp, alpha, 1)
    else
      do p = 1, size(self%pair)
        associate (first => self%pair(p)%first, last => self%pair(p)%last)
          at = 0
          do k = 1, size(self%pair(p)%body)
            do j = 1, self%pair(p)%n_modes(k)
              mode = qp%coarse%first(self%pair(p)%body(k)) + j - 1
              alpha(mode) = alpha(mode) - dot_product(self%half(first:last, at + j), half(first:last, 1))
            end do
            at = at + self%pair(p)%n_modes(k)
          end do
        end associate
      end do
    end if
    call self%network%solve(alpha)
    if (self%coupling == coupling_all) then
      if (size(self%half) > 0) &
        call dgemv('N', size(r), size(alpha), 1.0_dp, self%half, size(r), alpha, 1, 1.0_dp, half, 1)
    else
      do p = 1, size(self%pair)
        associate (first => self%pair(p)%first, last => self%pair(p)%last)
          at = 0
          do k = 1, size(self%pair(p)%body)
            do j = 1, self%pair(p)%n_modes(k)
              mode = qp%coarse%first(self%pair(p)%body(k)) + j - 1
              half(first:last, 1) = half(first:last, 1) + alpha(mode)*self%half(first:last, at + j)
            end do
            at = at + self%pair(p)%n_modes(k)
          end do
        end associate
      end do
    end if
    if (size(r) > 0) call self%factor%solve_back(half)
    x = half(:, 1)
  end subroutine apply_preconditioner

  !> G^T x.
  subroutine resultants_of(self, qp, x, resultant)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! With the coarse space.
    real(dp), intent(in) :: x(:)  !! Contact forces (n) [force].
    real(dp), intent(out) :: resultant(:)  !! (coarse%n) [force]
    real(dp), allocatable :: force(:)
    allocate (force(qp%n_rows), source=0.0_dp)
    force(self%row) = x
    call qp%mode_resultant(force, resultant)
  end subroutine resultants_of

  !> M x at the active rows.
  subroutine apply_matrix(self, qp, compliance, x, q)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    real(dp), intent(in) :: x(:)  !! Contact forces (n) [force].
    real(dp), intent(out) :: q(:)  !! Product (n) [length].
    real(dp), allocatable :: force(:), z(:)
    allocate (force(qp%n_rows), z(qp%n_rows))
    force = 0
    force(self%row) = x
    call compliance%multiply(qp, force, z)
    q = z(self%row) + self%layer*x
  end subroutine apply_matrix

  !> Residuals of contact rows and of equilibrium.
  subroutine find_residuals(self, qp, compliance, b, c, lambda, alpha, r_b, r_c)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    real(dp), intent(in) :: b(:)  !! Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: c(:)  !! Right-hand side of equilibrium (coarse%n) [force].
    real(dp), intent(in) :: lambda(:)  !! Forces (n) [force].
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (coarse%n) [length].
    real(dp), intent(out) :: r_b(:)  !! `b - M lambda + G alpha` (n) [length].
    real(dp), intent(out) :: r_c(:)  !! `c - G^T lambda - S alpha` (coarse%n) [force].
    real(dp), allocatable :: motion(:)
    allocate (motion(qp%n_rows))
    call apply_matrix(self, qp, compliance, lambda, r_b)
    call qp%mode_displacement(alpha, motion)
    r_b = b - r_b + motion(self%row)
    call resultants_of(self, qp, lambda, r_c)
    r_c = c - r_c - qp%coarse%stiffness_forces(alpha)
  end subroutine find_residuals

  !> Solve from the given forces. Rounds of conjugate gradients, each from the true residual, until rounding allows no
  !> more, or one round to `step_reduction` or `reduction`. An interrupt ends them early.
  subroutine system_solve(self, qp, compliance, b, c, lambda, alpha)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for; resultants may be others.
    class(compliance_t), intent(inout) :: compliance  !! The compliance that it was made for.
    real(dp), intent(in) :: b(:)  !! Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: c(:)  !! Right-hand side of the equilibrium of the modes (coarse%n) [force].
    !> Contact forces; an initial guess on entry, which is not used where all rows couple (n) [force].
    real(dp), intent(inout) :: lambda(:)
    real(dp), intent(out) :: alpha(:)  !! Amplitudes of the modes (coarse%n) [length].
    real(dp), allocatable :: r_b(:), r_c(:), x(:), beta(:), next_b(:), next_c(:)
    real(dp) :: residual, previous, imbalance, previous_imbalance, scale, once, gain
    integer :: k, n
    logical :: has_ties
    n = size(self%row)
    has_ties = self%coupling == coupling_all .and. any(qp%is_tied(self%row))
    gain = merge(worthwhile_gain_of_ties, worthwhile_gain, has_ties)
    allocate (r_b(n), x(n), next_b(n), r_c(qp%coarse%n), beta(qp%coarse%n), next_c(qp%coarse%n))
    alpha = 0
    scale = 0
    ! Redundant rows share the force of least norm where the start is none.
    if (self%coupling == coupling_all) lambda = 0
    if (any(abs(lambda) > 0)) then
      call find_residuals(self, qp, compliance, b, c, lambda, alpha, r_b, r_c)
    else
      r_b = b
      r_c = c
    end if
    previous = huge(previous)
    previous_imbalance = huge(previous_imbalance)
    once = max(self%step_reduction, self%reduction)
    self%n_solutions = self%n_solutions + 1
    do k = 1, merge(most_rounds_of_ties, most_rounds, has_ties)
      if (interrupted()) exit
      call conjugate_gradients(self, qp, compliance, merge(once, restart, once > 0), r_b, r_c, scale, x, beta)
      if (once > 0) then
        lambda = lambda + x
        alpha = alpha + beta
        exit
      end if
      call find_residuals(self, qp, compliance, b, c, lambda + x, alpha + beta, next_b, next_c)
      residual = sum(next_b**2/(self%diagonal + self%layer))
      imbalance = sum(next_c**2)
      if (k > 1 .and. .not. (residual < previous .or. &
                             imbalance < worthwhile_gain_of_equilibrium*previous_imbalance)) exit
      lambda = lambda + x
      alpha = alpha + beta
      r_b = next_b
      r_c = next_c
      if (.not. (residual < gain*previous .or. &
                 imbalance < worthwhile_gain_of_equilibrium*previous_imbalance)) exit
      previous = residual
      previous_imbalance = imbalance
    end do
  end subroutine system_solve

  !> Preconditioned conjugate gradients from zero.
  subroutine conjugate_gradients(self, qp, compliance, reduction, r_b, r_c, scale, x, beta)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    !> They end where the residual, in the norm of the preconditioner, is this fraction of the first one, or of the
    !> energy of the first step if that is larger [].
    real(dp), intent(in) :: reduction
    real(dp), intent(in) :: r_b(:)  !! Residual of the contact rows (n) [length].
    real(dp), intent(in) :: r_c(:)  !! Residual of equilibrium (coarse%n) [force].
    real(dp), intent(inout) :: scale  !! The largest of these energies so far; they end at rounding of it too [energy].
    real(dp), intent(out), contiguous :: x(:)  !! Forces (n) [force].
    real(dp), intent(out), contiguous :: beta(:)  !! Amplitudes (coarse%n) [length].
    real(dp), allocatable :: r(:), z(:), p(:), q(:), r_old(:), z_modes(:), p_modes(:), moved(:), imbalance(:)
    real(dp) :: rz, rz_end, rz_old, curvature, step, share, first
    integer :: k
    allocate (z(size(r_b)), p(size(r_b)), q(size(r_b)), r_old(size(r_b)), moved(qp%n_rows))
    allocate (z_modes(size(r_c)), imbalance(size(r_c)))
    ! The first step brings equilibrium; all others keep it.
    call apply_preconditioner(self, qp, r_b, r_c, x, beta)
    ! The preconditioner is the matrix, but for the proximal term: rounds refine its solution. Conjugate gradients would
    ! divide by the curvature along redundant rows. Rigid bodies on foundations have no compliance.
    if (self%coupling == coupling_all .or. .not. any(self%diagonal > 0)) return
    call apply_matrix(self, qp, compliance, x, q)
    call qp%mode_displacement(beta, moved)
    r = r_b - q + moved(self%row)
    rz_end = 0
    rz_old = 0
    self%n_iterations = self%n_iterations + 1
    first = dot_product(x, q)
    do k = 1, most_iterations
      if (interrupted()) exit
      call apply_preconditioner(self, qp, r, x=z, alpha=z_modes)
      rz = dot_product(r, z)
      if (k == 1) then
        first = max(first, rz)
        scale = max(scale, first)
        rz_end = max(reduction**2*first, tolerance**2*scale)
      end if
      if (.not. rz > rz_end) exit
      call resultants_of(self, qp, z, imbalance)
      imbalance = imbalance + qp%coarse%stiffness_forces(z_modes)
      if (norm2(imbalance) > most_imbalance*norm2(z)) exit
      if (k == 1) then
        p = z
        p_modes = z_modes
      else
        ! The formula of Polak and Ribiere is less sensitive to rounding than that of Fletcher and Reeves.
        share = max(0.0_dp, (rz - dot_product(r_old, z))/rz_old)
        p = z + share*p
        p_modes = z_modes + share*p_modes
      end if
      call apply_matrix(self, qp, compliance, p, q)
      curvature = dot_product(p, q) + dot_product(p_modes, qp%coarse%stiffness_forces(p_modes))
      if (.not. curvature > 0) exit
      call qp%mode_displacement(p_modes, moved)
      step = rz/curvature
      x = x + step*p
      beta = beta + step*p_modes
      r_old = r
      r = r - step*(q - moved(self%row))
      rz_old = rz
      self%n_iterations = self%n_iterations + 1
    end do
  end subroutine conjugate_gradients

  !> Forget which active set the system is that of.
  subroutine system_forget(self)
    class(active_system_t), intent(inout) :: self
    if (allocated(self%row)) deallocate (self%row)
  end subroutine system_forget

  !> Free all memory.
  subroutine system_destroy(self)
    class(active_system_t), intent(inout) :: self
    call self%forget()
    call self%factor%destroy()
    call self%network%destroy()
    call self%matrix%destroy()
    if (allocated(self%parent)) deallocate (self%parent)
    if (allocated(self%pair)) deallocate (self%pair, self%diagonal)
    if (allocated(self%half)) deallocate (self%half)
    if (allocated(self%layer)) deallocate (self%layer)
    if (associated(self%n_iterations)) deallocate (self%n_iterations, self%n_solutions)
  end subroutine system_destroy
end module dotyk_scheme_active_system
