!> The linear system of an active set by factorization: contact compliances and rigid body modes as one saddle point
!> matrix.
!>
!> With M = C + Theta W^{-1} on the active rows, G their rows of the coarse space and S the stiffness of near-null-space
!> modes,
!>
!>     [M  -G; -G^T  -S] (lambda, alpha) = (b, -c).
!>
!> Blocks are the pairs with active rows and the modes of the bodies (`dotyk_scheme_contact_graph`); the block LDL^T
!> factorization (`dotyk_linalg_block_ldlt`) fills in little where bodies touch few others, and finds the modes that the
!> active rows do not restrain. With theta = 0 rows can be linearly dependent and M singular: M plus a small fraction of
!> its diagonal is factorized, and the solution refined with the true matrix. This is the proximal point method
!> (Rockafellar, SIAM J. Control Optim. 14, 1976): consistent equations are solved exactly, redundant rows share the
!> force of least norm. The fraction goes with 1/w, as a penalty theta does: the norm is that of the pressures, sum
!> lambda^2/w, and redundant forces are the limit of those with theta -> 0.
module dotyk_scheme_direct_system
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_ldlt, only: block_ldlt_t
  use dotyk_linalg_block_ldlt_solution, only: expand_null_vector, solve_block_ldlt
  use dotyk_scheme_active_system, only: active_system_t, proximal_term
  use dotyk_scheme_contact_graph, only: contact_graph_t, make_contact_graph
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  !> The factorized system. It owns a factor: never copy it, destroy it in the end.
  type, extends(active_system_t), public :: direct_system_t
    !> The factor.
    type(block_ldlt_t), private :: factor
    !> Blocks of the factor.
    type(contact_graph_t), private :: graph
    !> Diagonal of M (n) [length/force].
    real(dp), allocatable, private :: diagonal(:)
    !> Orthonormal null modes of several bodies together, as columns (coarse%n, number of them).
    real(dp), allocatable, private :: joint_null(:, :)
  contains
    procedure :: init => direct_system_init
    procedure :: solve => direct_system_solve
    procedure :: needs_entries => direct_system_needs_entries
    procedure :: destroy => direct_system_destroy
  end type direct_system_t

  !> A null direction of one body that moves an active point by more than this (of 1, the scale of modes) restrains that
  !> point against another body: the null vector has components there. Null directions are known to the square root of
  !> `least_eigenvalue`, 1e-6, at worst and to rounding where bodies do not touch.
  real(dp), parameter :: least_motion = 1.0e-9_dp
  !> Steps of iterative refinement at most.
  integer, parameter :: most_refinements = 8
  !> Refinement goes on while the squared residual falls to this fraction (of contact rows, of equilibrium); equilibrium
  !> is exact but for rounding after one step, unless springs are soft.
  real(dp), parameter :: worthwhile_gain = 0.1_dp, worthwhile_gain_of_equilibrium = 0.01_dp

contains

  !> True: the matrix is made of entries.
  pure logical function direct_system_needs_entries(self) result(needed)
    !> The system.
    class(direct_system_t), intent(in) :: self
    needed = .true.
    associate (not_needed => same_type_as(self, self))
    end associate
  end function direct_system_needs_entries

  !> Assemble and factorize.
  subroutine direct_system_init(self, qp, compliance, theta, active, error)
    !> The system.
    class(direct_system_t), intent(inout) :: self
    !> Contact rows and rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The active set (n_rows).
    logical, intent(in) :: active(:)
    !> The compliance of the active rows is not positive definite: rows are linearly dependent to rounding with theta =
    !> 0, or an entry is not a number. Or METIS cannot order the pairs.
    type(error_t), allocatable, intent(out) :: error
    integer :: failed
    call self%destroy()
    call self%take_points(qp, theta, active)
    call make_contact_graph(qp, active, self%graph, error)
    if (allocated(error)) return
    associate (graph => self%graph)
      call self%factor%init(graph%size, graph%sign, graph%start, graph%neighbour, graph%order)
    end associate
    call add_compliance(self, qp, compliance)
    call add_modes(self, qp)
    call self%factor%factorize(contact_stiffness_of_modes(self, qp), failed)
    if (failed > 0) &
      call set_error(error, 'the compliance matrix of the active constraints is not positive definite '// &
                     '(constraints are linearly dependent to rounding): a spring that holds a body may be too '// &
                     'weak beside its elements, a stiffer one or a support helps; else give a greater theta', &
                     exit_not_solvable)
    if (.not. allocated(error)) call find_null_modes(self, qp)
  end subroutine direct_system_init

  !> M: the compliance of each body couples its pairs; Winkler layers and the proximal term stand on the diagonal.
  subroutine add_compliance(self, qp, compliance)
    !> Sets the blocks of pairs and the diagonal.
    type(direct_system_t), intent(inout) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    real(dp), allocatable :: entries(:, :), proximal(:)
    integer :: b, i, k, l
    self%diagonal = self%layer
    associate (graph => self%graph)
      do b = 1, size(graph%body)
        associate (body => graph%body(b))
          if (size(body%row) == 0) cycle
          call compliance%get_entries(qp, b, body%row, entries)
          do i = 1, size(body%row)
            associate (entry => self%diagonal(graph%number(body%row(i))))
              entry = entry + entries(i, i)
            end associate
          end do
          do k = 1, size(body%block)
            do l = 1, k
              call self%factor%add(body%block(k), body%block(l), &
                                   entries(body%first(k):body%first(k + 1) - 1, body%first(l):body%first(l + 1) - 1))
            end do
          end do
        end associate
      end do
      allocate (proximal(size(self%row)))
      proximal = proximal_term(self%diagonal, self%layer, qp%weight(self%row))
      do k = 1, graph%n_pairs
        associate (first => graph%first(k), last => graph%first(k + 1) - 1)
          call self%factor%add_diagonal(k, self%layer(first:last) + proximal(first:last))
        end associate
      end do
    end associate
  end subroutine add_compliance

  !> -G and -S.
  subroutine add_modes(self, qp)
    !> Sets the blocks of modes.
    type(direct_system_t), intent(inout) :: self
    !> With the coarse space.
    type(contact_qp_t), intent(in) :: qp
    integer :: b, k
    do b = 1, size(self%graph%body)
      associate (body => self%graph%body(b), g => qp%coarse%block(b)%value)
        if (body%modes == 0) cycle
        do k = 1, size(body%block)
          call self%factor%add(body%block(k), body%modes, -g(body%place(body%first(k):body%first(k + 1) - 1), :))
        end do
        if (allocated(qp%coarse%stiffness)) &
          call self%factor%add(body%modes, body%modes, -qp%coarse%stiffness(b)%value)
      end associate
    end do
  end subroutine add_modes

  !> Stiffness of the contact of each body against its best restrained mode, if each active point yielded on its own:
  !> the reference of null directions. 0 where all modes of a body have a stiffness of their own: none is a null
  !> direction, however soft.
  function contact_stiffness_of_modes(self, qp) result(stiffness)
    !> With the diagonal.
    type(direct_system_t), intent(in) :: self
    !> With the coarse space.
    type(contact_qp_t), intent(in) :: qp
    !> By blocks (n_blocks) [force/length].
    real(dp), allocatable :: stiffness(:)
    integer :: b, j
    allocate (stiffness(size(self%graph%size)), source=0.0_dp)
    do b = 1, size(self%graph%body)
      associate (body => self%graph%body(b), g => qp%coarse%block(b)%value)
        if (body%modes == 0) cycle
        if (qp%coarse%has_stiffness(b)) cycle
        do j = 1, size(g, 2)
          stiffness(body%modes) = max(stiffness(body%modes), &
                                      sum(g(body%place, j)**2/self%diagonal(self%graph%number(body%row))))
        end do
      end associate
    end do
  end function contact_stiffness_of_modes

  !> Modes that the active points do not restrain: of single bodies, and of several in contact with each other only.
  subroutine find_null_modes(self, qp)
    !> Factorized; sets the null modes.
    type(direct_system_t), intent(inout) :: self
    !> With the coarse space.
    type(contact_qp_t), intent(in) :: qp
    real(dp), allocatable :: x(:), own(:), joint(:, :)
    real(dp) :: motion
    integer :: i, j, b, n, n_joint
    n = size(self%row)
    allocate (x(n + qp%coarse%n))
    allocate (joint(qp%coarse%n, size(self%factor%null_block)))
    n_joint = 0
    do i = 1, size(self%factor%null_block)
      b = self%graph%body_of(self%factor%null_block(i))
      associate (first => qp%coarse%first(b), last => qp%coarse%first(b + 1) - 1, &
                 place => self%graph%body(b)%place)
        own = self%factor%null_direction(:last - first + 1, i)
        motion = maxval([0.0_dp, abs(matmul(qp%coarse%block(b)%value(place, :), own))])
        if (motion <= least_motion) call self%null_mode%add(own/maxval(abs(own)), offset=first - 1)
      end associate
      if (motion > least_motion) then
        call expand_null_vector(self%factor, i, x)
        ! Blocks of modes follow those of pairs, body after body.
        call self%null_mode%add(x(n + 1:)/maxval(abs(x(n + 1:))))
        n_joint = n_joint + 1
        joint(:, n_joint) = x(n + 1:)
        do j = 1, n_joint - 1
          joint(:, n_joint) = joint(:, n_joint) - dot_product(joint(:, j), joint(:, n_joint))*joint(:, j)
        end do
        joint(:, n_joint) = joint(:, n_joint)/norm2(joint(:, n_joint))
      end if
    end do
    self%joint_null = joint(:, :n_joint)
  end subroutine find_null_modes

  !> Solve with iterative refinement, until rounding allows no more. Null modes get amplitude 0; the part of c that
  !> excites them remains in the residual.
  subroutine direct_system_solve(self, qp, compliance, b, c, lambda, alpha)
    !> Factorized.
    class(direct_system_t), intent(in) :: self
    !> The problem that it was made for.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    !> Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: b(:)
    !> Right-hand side of the equilibrium of the modes (coarse%n) [force].
    real(dp), intent(in) :: c(:)
    !> Contact forces; the value on entry is not used (n) [force].
    real(dp), intent(inout) :: lambda(:)
    !> Amplitudes of the modes (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    real(dp), allocatable :: r_b(:), r_c(:), x(:), all_forces(:), z(:), motion(:), step(:), step_alpha(:)
    real(dp) :: residual, previous, imbalance, previous_imbalance
    integer :: k, n
    n = size(self%row)
    associate (n_rows => qp%n_rows)
      allocate (all_forces(n_rows), z(n_rows), motion(n_rows), source=0.0_dp)
    end associate
    allocate (x(n + qp%coarse%n))
    r_b = b
    r_c = c
    lambda = 0
    alpha = 0
    previous = huge(previous)
    previous_imbalance = huge(previous_imbalance)
    do k = 1, most_refinements
      x(:n) = r_b
      x(n + 1:) = -r_c
      call solve_block_ldlt(self%factor, x)
      step = x(:n)
      step_alpha = x(n + 1:)
      all_forces(self%row) = lambda + step
      call compliance%multiply(qp, all_forces, z)
      call qp%mode_displacement(alpha + step_alpha, motion)
      r_b = b - z(self%row) - self%layer*(lambda + step) + motion(self%row)
      call qp%mode_resultant(all_forces, r_c)
      r_c = c - r_c - qp%coarse%stiffness_forces(alpha + step_alpha)
      residual = sum(r_b**2/self%diagonal)
      imbalance = sum(r_c**2)
      ! Where rounding dominates, residuals do not fall, and the step is not taken.
      if (k > 1 .and. .not. (residual < previous .or. &
                             imbalance < worthwhile_gain_of_equilibrium*previous_imbalance)) exit
      lambda = lambda + step
      alpha = alpha + step_alpha
      if (.not. (residual < worthwhile_gain*previous .or. &
                 imbalance < worthwhile_gain_of_equilibrium*previous_imbalance)) exit
      previous = residual
      previous_imbalance = imbalance
    end do
    do k = 1, size(self%joint_null, 2)
      alpha = alpha - dot_product(self%joint_null(:, k), alpha)*self%joint_null(:, k)
    end do
  end subroutine direct_system_solve

  !> Free all memory.
  subroutine direct_system_destroy(self)
    !> The system.
    class(direct_system_t), intent(inout) :: self
    call self%factor%destroy()
    call self%forget()
    if (allocated(self%joint_null)) deallocate (self%joint_null)
    if (allocated(self%diagonal)) deallocate (self%diagonal)
  end subroutine direct_system_destroy
end module dotyk_scheme_direct_system
