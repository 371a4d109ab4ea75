!> The system of an active set by factorization of all of it, border included: for scenes of many free bodies.
!>
!> Blocks are the pairs with active points and the motions of the free bodies, a body after the last of its pairs
!> (`dotyk_linalg_block_ldlt`). What fills in is little where bodies touch few others, and motions that nothing holds are found on
!> the way. As in `dotyk_scheme_direct_system` a small part of the diagonal is added, and solutions are refined with the true matrix.
module dotyk_scheme_saddle_system
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_ldlt, only: block_ldlt_t
  use dotyk_linalg_block_ldlt_solution, only: expand_null_vector, solve_block_ldlt
  use dotyk_scheme_active_system, only: active_system_t, proximal_part
  use dotyk_scheme_body_graph, only: body_graph_t, make_body_graph
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> The factorized system. It owns a factor: never copy it, destroy it in the end.
  type, extends(active_system_t), public :: saddle_system_t
    type(block_ldlt_t), private :: factor
    !> Which pairs have active points, whose they are.
    type(body_graph_t), private :: graph
    !> Diagonal of M (n) [length/force].
    real(dp), allocatable, private :: diagonal(:)
    !> Orthonormal motions of several bodies together that nothing holds, as columns (coarse%n, number of them).
    real(dp), allocatable, private :: shared_null(:, :)
  contains
    procedure :: init => saddle_system_init
    procedure :: solve => saddle_system_solve
    procedure :: destroy => saddle_system_destroy
  end type saddle_system_t

contains

  !> Assemble and factorize.
  subroutine saddle_system_init(self, problem, compliance, theta, active, error)
    class(saddle_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> Of all rows.
    type(explicit_compliance_t), intent(in) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> (n_rows).
    logical, intent(in) :: active(:)
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    integer :: failed
    call self%destroy()
    call self%take_points(problem, theta, active)
    call make_body_graph(problem, active, self%graph, error)
    if (allocated(error)) return
    associate (graph => self%graph)
      call self%factor%init(graph%size, graph%sign, graph%start, graph%neighbour, graph%order)
    end associate
    self%diagonal = self%layer
    call add_compliance(self, compliance)
    call add_motions(self, problem)
    call self%factor%factorize(stiffness_of_bodies(self, problem), failed)
    if (failed > 0) call set_error(error, 'the compliance of the active contact points is not positive definite', &
                                   exit_not_solvable)
    if (.not. allocated(error)) call find_null_modes(self, problem)
  end subroutine saddle_system_init

  !> M: what the bodies of two pairs that share them contribute to the pairs' block, layers, and the small part.
  subroutine add_compliance(self, compliance)
    type(saddle_system_t), intent(inout) :: self
    type(explicit_compliance_t), intent(in) :: compliance
    real(dp), allocatable :: layers(:, :)
    integer, allocatable :: number(:)
    integer :: b, i, k, l
    associate (graph => self%graph)
      do b = 1, size(compliance%body)
        associate (run => graph%body(b), value => compliance%body(b)%value)
          number = compliance%body(b)%number(run%place)
          do i = 1, size(number)
            self%diagonal(graph%number(run%row(i))) = self%diagonal(graph%number(run%row(i))) + value(number(i), number(i))
          end do
          do k = 1, size(run%block)
            do l = 1, k
              call self%factor%add(run%block(k), run%block(l), value(number(run%first(k):run%first(k + 1) - 1), &
                                                                     number(run%first(l):run%first(l + 1) - 1)))
            end do
          end do
        end associate
      end do
      do k = 1, graph%n_pairs
        associate (n => graph%size(k), first => graph%first(k))
          if (allocated(layers)) deallocate (layers)
          allocate (layers(n, n), source=0.0_dp)
          do i = 1, n
            layers(i, i) = self%layer(first + i - 1) + proximal_part*self%diagonal(first + i - 1)
          end do
          call self%factor%add(k, k, layers)
        end associate
      end do
    end associate
  end subroutine add_compliance

  !> -G, and -H, the springs.
  subroutine add_motions(self, problem)
    type(saddle_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer :: b, k
    do b = 1, size(self%graph%body)
      associate (run => self%graph%body(b), g => problem%coarse%block(b)%value)
        if (run%motions == 0) cycle
        do k = 1, size(run%block)
          call self%factor%add(run%block(k), run%motions, -g(run%place(run%first(k):run%first(k + 1) - 1), :))
        end do
        if (.not. allocated(problem%coarse%stiffness)) cycle
        associate (first => problem%coarse%first(b), last => problem%coarse%first(b + 1) - 1)
          call self%factor%add(run%motions, run%motions, -problem%coarse%stiffness(first:last, first:last))
        end associate
      end associate
    end do
  end subroutine add_motions

  !> How much the points of each body would hold the best held of its motions if each yielded for itself; 0 where springs hold all of them.
  function stiffness_of_bodies(self, problem) result(stiffness)
    type(saddle_system_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable :: stiffness(:)
    integer :: b, j
    allocate (stiffness(size(self%graph%size)), source=0.0_dp)
    do b = 1, size(self%graph%body)
      associate (run => self%graph%body(b), g => problem%coarse%block(b)%value)
        if (run%motions == 0) cycle
        ! However soft its springs are.
        if (problem%coarse%is_sprung(b)) cycle
        do j = 1, size(g, 2)
          stiffness(run%motions) = max(stiffness(run%motions), &
                                       sum(g(run%place, j)**2/self%diagonal(self%graph%number(run%row))))
        end do
      end associate
    end do
  end function stiffness_of_bodies

  !> Motions that the active points do not hold: of single bodies, and of several ones together.
  subroutine find_null_modes(self, problem)
    type(saddle_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    real(dp) :: x(size(self%row) + problem%coarse%n), moved
    real(dp), allocatable :: shared(:, :)
    integer :: i, j, b, n, n_shared
    n = size(self%row)
    allocate (self%null_mode(problem%coarse%n, size(self%factor%null_block)), source=0.0_dp)
    allocate (shared(problem%coarse%n, size(self%factor%null_block)))
    n_shared = 0
    do i = 1, size(self%factor%null_block)
      b = self%graph%body_of(self%factor%null_block(i))
      associate (first => problem%coarse%first(b), last => problem%coarse%first(b + 1) - 1, run => self%graph%body(b))
        self%null_mode(first:last, i) = self%factor%null_direction(:last - first + 1, i)
        moved = 0
        do j = 1, size(run%place)
          moved = max(moved, abs(dot_product(problem%coarse%block(b)%value(run%place(j), :), &
                                             self%null_mode(first:last, i))))
        end do
      end associate
      if (moved > 1.0e-9_dp) then
        call expand_null_vector(self%factor, i, x)
        self%null_mode(self%graph%motion, i) = x(n + 1:)
        n_shared = n_shared + 1
        shared(:, n_shared) = self%null_mode(:, i)
        do j = 1, n_shared - 1
          shared(:, n_shared) = shared(:, n_shared) - dot_product(shared(:, j), shared(:, n_shared))*shared(:, j)
        end do
        shared(:, n_shared) = shared(:, n_shared)/norm2(shared(:, n_shared))
      end if
      self%null_mode(:, i) = self%null_mode(:, i)/maxval(abs(self%null_mode(:, i)))
    end do
    self%shared_null = shared(:, :n_shared)
  end subroutine find_null_modes

  !> Solve, and refine the solution until rounding allows no more. Motions that nothing holds stay at rest; the part of c that excites
  !> them is left over.
  subroutine saddle_system_solve(self, problem, compliance, b, c, lambda, alpha)
    class(saddle_system_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> Right-hand sides: (n) [length], (coarse%n) [force].
    real(dp), intent(in) :: b(:), c(:)
    !> Forces at the active points; what they are on entry does not matter (n) [force].
    real(dp), intent(inout) :: lambda(:)
    !> Amplitudes of the free motions (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    real(dp), allocatable :: r_b(:), r_c(:), x(:), all_forces(:), z(:), motion(:), step(:), step_alpha(:)
    real(dp) :: residual, previous, missing, last_missing
    integer :: k, n
    integer, parameter :: most_steps = 8
    n = size(self%row)
    allocate (all_forces(problem%operator%n_rows), z(problem%operator%n_rows), motion(problem%operator%n_rows), source=0.0_dp)
    allocate (x(n + problem%coarse%n), step(n), step_alpha(problem%coarse%n))
    r_b = b
    r_c = c
    lambda = 0
    alpha = 0
    previous = huge(previous)
    last_missing = huge(last_missing)
    do k = 1, most_steps
      x(:n) = r_b
      x(n + 1:) = -r_c(self%graph%motion)
      call solve_block_ldlt(self%factor, x)
      step = x(:n)
      step_alpha(self%graph%motion) = x(n + 1:)
      all_forces(self%row) = lambda + step
      call compliance%multiply(problem, all_forces, z)
      call problem%coarse%displacement(problem%operator, alpha + step_alpha, motion)
      r_b = b - z(self%row) - self%layer*(lambda + step) + motion(self%row)
      call problem%coarse%resultant_of(problem%operator, all_forces, r_c)
      r_c = c - r_c - problem%coarse%springs(alpha + step_alpha)
      residual = sum(r_b**2/self%diagonal)
      missing = sum(r_c**2)
      ! Rounding errors do not get smaller.
      if (k > 1 .and. .not. (residual < previous .or. missing < 0.01_dp*last_missing)) exit
      lambda = lambda + step
      alpha = alpha + step_alpha
      if (.not. (residual < 0.1_dp*previous .or. missing < 0.01_dp*last_missing)) exit
      previous = residual
      last_missing = missing
    end do
    do k = 1, size(self%shared_null, 2)
      alpha = alpha - dot_product(self%shared_null(:, k), alpha)*self%shared_null(:, k)
    end do
  end subroutine saddle_system_solve

  !> Give all memory back.
  subroutine saddle_system_destroy(self)
    class(saddle_system_t), intent(inout) :: self
    call self%factor%destroy()
    call self%forget()
    if (allocated(self%shared_null)) deallocate (self%shared_null)
    if (allocated(self%diagonal)) deallocate (self%diagonal)
  end subroutine saddle_system_destroy
end module dotyk_scheme_saddle_system
