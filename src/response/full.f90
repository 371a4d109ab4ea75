!> The response of a body through the Cholesky factor of its whole stiffness.
!>
!> Built in steps, because a driver runs them for many bodies with different shares of the machine: `prepare` (ordering and
!> symbolic analysis: fill and flops are known then), `attach` (where contact forces act), `factorize`.
!>
!> A body with free motions R is factorized with springs on a few unknowns, see dotyk_response_hold, K_s: then
!> `K^+ = P K_s^{-1} P`, `P = I - R R^T`. Forces act at contact nodes, so R^T f takes the motions of these only.
module dotyk_response_full
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_linalg_blas, only: add_product, transposed_product
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_ordering, only: expand_permutation, nested_dissection
  use dotyk_response_hold, only: add_springs, choose_holds, is_mechanism
  use dotyk_response_response, only: response_t
  implicit none
  private

  !> Response by solves with the factor of the full stiffness.
  type, extends(response_t), public :: full_response_t
    !> Factor of the stiffness over the free equations.
    type(cholesky_t) :: factor
    !> Equations with springs, one for each free motion; chosen by `prepare` (n_motions).
    integer, allocatable :: hold(:)
    !> Free motions over the equations, orthonormal (n_equations, n_motions).
    real(dp), allocatable, private :: rigid(:, :)
    !> Equations of the contact nodes (dimension, n_contact_nodes), in the node's axes; 0 where prescribed.
    integer, allocatable, private :: equation(:, :)
    !> Axes of each contact node: 0 for the global ones, else an index into `axes` (n_contact_nodes).
    integer, allocatable, private :: axes_of(:)
    !> Axes as columns (dimension, dimension, n).
    real(dp), allocatable, private :: axes(:, :, :)
    !> Right-hand side and solution (n_equations).
    real(dp), allocatable, private :: x(:)
  contains
    procedure :: prepare => full_response_prepare
    procedure :: factorize => full_response_factorize
    procedure :: attach => full_response_attach
    procedure :: apply => full_response_apply
    procedure, private :: keep_diagonal => full_response_keep_diagonal
    procedure :: apply_block => full_response_apply_block
    procedure :: solve => full_response_solve
    procedure :: destroy => full_response_destroy
  end type full_response_t

  !> A pivot that elimination has left less than this part of may be round-off. (Thin bodies have small ones too, and round-off
  !> leaves 1e-16 to 1e-13: whether it is, the displacement says that belongs to it.)
  real(dp), parameter :: suspicious_pivot = 1.0e-8_dp
  !> Right-hand sides that are solved for at a time.
  integer, parameter :: block_size = 64

contains

  !> Order the equations and analyse the factorization.
  subroutine full_response_prepare(self, body, error)
    class(full_response_t), intent(inout) :: self
    !> The body, assembled.
    type(body_t), intent(in) :: body
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: node_order(:), permutation(:)
    integer :: k
    self%dimension = body%dimension
    self%n_motions = size(body%free_motion, 3)
    allocate (self%rigid(body%constraint%n_equations, self%n_motions))
    do k = 1, self%n_motions
      call body%constraint%reduce(body%free_motion(:, :, k), self%rigid(:, k))
    end do
    call choose_holds(self%rigid, self%hold)
    ! Nested dissection orders the nodes: the graph is smaller, and the equations of a node stay together.
    allocate (node_order(size(body%graph_start) - 1))
    call nested_dissection(body%graph_start, body%graph_neighbour, node_order, error)
    if (allocated(error)) return
    allocate (permutation(body%constraint%n_equations))
    call expand_permutation(node_order, body%constraint%equation, permutation)
    call self%factor%analyze(body%stiffness, permutation, error)
  end subroutine full_response_prepare

  !> Factorize. The memory of the stiffness is given back before that of the factor is taken.
  subroutine full_response_factorize(self, body, error)
    class(full_response_t), intent(inout) :: self
    !> The same body as in `prepare`; without stiffness on return.
    type(body_t), intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: diagonal(:), spring(:), x(:)
    integer :: failed_column, place(2), i
    call add_springs(body%stiffness, self%hold, spring)
    diagonal = [(body%stiffness%value(body%stiffness%column_start(i) + 1), i=1, body%stiffness%n)]
    call self%factor%factorize_and_discard(body%stiffness, failed_column, error)
    if (allocated(error)) return
    ! A part that is not held can pass the factorization by round-off; its last pivot is nothing but that.
    if (failed_column == 0 .and. self%factor%weakest_pivot < suspicious_pivot) then
      allocate (x(size(diagonal)), source=0.0_dp)
      x(self%factor%weakest_equation) = 1
      call self%factor%solve(x)
      if (is_mechanism(body, diagonal, self%hold, spring, x)) failed_column = self%factor%weakest_equation
    end if
    if (failed_column > 0) then
      place = findloc(body%constraint%equation, failed_column)
      call set_error(error, 'the stiffness is not positive definite (node '// &
        to_text(body%mesh%node_tag(place(2)))//', direction '//to_text(place(1))//'): the body, or a part of it that '// &
        'hangs on single nodes or edges, is not held; add a &support', exit_not_solvable)
    end if
  end subroutine full_response_factorize

  !> Say where contact forces act.
  subroutine full_response_attach(self, body, contact_node)
    class(full_response_t), intent(inout) :: self
    !> The same body as in `prepare`.
    type(body_t), intent(in) :: body
    !> Nodes of the body where contact forces may act (n_contact_nodes).
    integer, intent(in) :: contact_node(:)
    integer :: i, n_axes, frame
    self%n_contact_nodes = size(contact_node)
    self%equation = body%constraint%equation(:, contact_node)
    allocate (self%axes_of(size(contact_node)), source=0)
    n_axes = count(body%constraint%frame_of(contact_node) > 0)
    allocate (self%axes(self%dimension, self%dimension, n_axes))
    n_axes = 0
    do i = 1, size(contact_node)
      frame = body%constraint%frame_of(contact_node(i))
      if (frame == 0) cycle
      n_axes = n_axes + 1
      self%axes_of(i) = n_axes
      self%axes(:, :, n_axes) = body%constraint%frame(:, :, frame)
    end do
    allocate (self%x(body%constraint%n_equations))
    call self%keep_diagonal(body)
    self%motion = reshape(body%free_motion(:, contact_node, :), [self%dimension*size(contact_node), self%n_motions])
  end subroutine full_response_attach

  !> Keep the diagonal of the stiffness at the contact nodes, if the body still has it.
  subroutine full_response_keep_diagonal(self, body)
    class(full_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body
    real(dp) :: axis(self%dimension), entry
    integer :: i, k
    allocate (self%diagonal(self%dimension*self%n_contact_nodes), source=0.0_dp)
    if (.not. allocated(body%stiffness%value)) return
    do i = 1, self%n_contact_nodes
      do k = 1, self%dimension
        if (self%equation(k, i) == 0) cycle
        entry = body%stiffness%value(body%stiffness%column_start(self%equation(k, i)) + 1)
        axis = 0
        axis(k) = 1
        if (self%axes_of(i) > 0) axis = self%axes(:, k, self%axes_of(i))
        associate (own => self%diagonal((i - 1)*self%dimension + 1:i*self%dimension))
          own = own + axis**2*entry
        end associate
      end do
    end do
  end subroutine full_response_keep_diagonal

  !> Contact forces to displacements: scatter, solve, gather.
  subroutine full_response_apply(self, force, displacement)
    class(full_response_t), intent(inout) :: self
    !> Forces (dimension, n_contact_nodes) [force].
    real(dp), intent(in) :: force(:, :)
    !> Displacements (dimension, n_contact_nodes) [length].
    real(dp), intent(out) :: displacement(:, :)
    call scatter(self%dimension, self%n_contact_nodes, self%equation, self%axes_of, self%axes, force, self%x)
    if (self%n_motions > 0) call subtract_motions(self%rigid, matmul(reshape(force, [size(force)]), self%motion), self%x)
    call self%factor%solve(self%x)
    call remove_motions(self%rigid, self%x)
    call gather(self%dimension, self%n_contact_nodes, self%equation, self%axes_of, self%axes, self%x, displacement)
  end subroutine full_response_apply

  !> The same for many forces at a time.
  subroutine full_response_apply_block(self, force, displacement)
    class(full_response_t), intent(in) :: self
    !> Forces, one case a column (dimension*n_contact_nodes, m) [force].
    real(dp), intent(in) :: force(:, :)
    !> Displacements (dimension*n_contact_nodes, m) [length].
    real(dp), intent(out) :: displacement(:, :)
    real(dp), allocatable :: x(:, :), amplitude(:, :)
    integer :: first, m, j
    do first = 1, size(force, 2), block_size
      m = min(block_size, size(force, 2) - first + 1)
      if (allocated(x)) then
        if (size(x, 2) /= m) deallocate (x, amplitude)
      end if
      if (.not. allocated(x)) allocate (x(size(self%x), m), amplitude(self%n_motions, m))
      do j = 1, m
        call scatter(self%dimension, self%n_contact_nodes, self%equation, self%axes_of, self%axes, &
                     force(:, first + j - 1), x(:, j))
      end do
      call transposed_product(self%motion, force(:, first:first + m - 1), amplitude)
      call add_product(-1.0_dp, self%rigid, amplitude, x)
      call self%factor%solve_block(x)
      call transposed_product(self%rigid, x, amplitude)
      do j = 1, m
        call gather(self%dimension, self%n_contact_nodes, self%equation, self%axes_of, self%axes, x(:, j), &
                    displacement(:, first + j - 1))
      end do
      ! What is not gathered need not be projected.
      call add_product(-1.0_dp, self%motion, amplitude, displacement(:, first:first + m - 1))
    end do
  end subroutine full_response_apply_block

  !> A full solve.
  subroutine full_response_solve(self, x)
    class(full_response_t), intent(inout) :: self
    !> Right-hand side in, solution out (n_equations).
    real(dp), intent(inout) :: x(:)
    call remove_motions(self%rigid, x)
    call self%factor%solve(x)
    call remove_motions(self%rigid, x)
  end subroutine full_response_solve

  !> x <- P x.
  pure subroutine remove_motions(rigid, x)
    !> Orthonormal motions (n, n_motions).
    real(dp), intent(in) :: rigid(:, :)
    real(dp), intent(inout) :: x(:)
    real(dp) :: amplitude(size(rigid, 2))
    integer :: k
    do k = 1, size(rigid, 2)
      amplitude(k) = dot_product(rigid(:, k), x)
    end do
    call subtract_motions(rigid, amplitude, x)
  end subroutine remove_motions

  !> x <- x - R amplitude.
  pure subroutine subtract_motions(rigid, amplitude, x)
    !> Motions (n, n_motions).
    real(dp), intent(in) :: rigid(:, :)
    !> Their amplitudes (n_motions).
    real(dp), intent(in) :: amplitude(:)
    real(dp), intent(inout) :: x(:)
    integer :: k
    do k = 1, size(rigid, 2)
      x = x - amplitude(k)*rigid(:, k)
    end do
  end subroutine subtract_motions

  !> Forces at the contact nodes to a right-hand side.
  pure subroutine scatter(dim, n, equation, axes_of, axes, force, x)
    !> Numbers of displacement components and of contact nodes.
    integer, intent(in) :: dim, n
    !> Equations and axes of the contact nodes, as in the type.
    integer, intent(in) :: equation(dim, n), axes_of(n)
    real(dp), intent(in) :: axes(:, :, :)
    !> Forces [force].
    real(dp), intent(in) :: force(dim, n)
    !> Right-hand side (n_equations).
    real(dp), intent(out) :: x(:)
    real(dp) :: local(dim)
    integer :: i, k
    x = 0
    do i = 1, n
      local = force(:, i)
      if (axes_of(i) > 0) local = matmul(local, axes(:, :, axes_of(i)))
      do k = 1, dim
        if (equation(k, i) > 0) x(equation(k, i)) = local(k)
      end do
    end do
  end subroutine scatter

  !> A solution to displacements of the contact nodes.
  pure subroutine gather(dim, n, equation, axes_of, axes, x, displacement)
    !> As in `scatter`.
    integer, intent(in) :: dim, n
    integer, intent(in) :: equation(dim, n), axes_of(n)
    real(dp), intent(in) :: axes(:, :, :)
    !> Solution (n_equations).
    real(dp), intent(in) :: x(:)
    !> Displacements [length].
    real(dp), intent(out) :: displacement(dim, n)
    real(dp) :: local(dim)
    integer :: i, k
    do i = 1, n
      local = 0
      do k = 1, dim
        if (equation(k, i) > 0) local(k) = x(equation(k, i))
      end do
      if (axes_of(i) > 0) local = matmul(axes(:, :, axes_of(i)), local)
      displacement(:, i) = local
    end do
  end subroutine gather

  !> Give back all memory.
  subroutine full_response_destroy(self)
    class(full_response_t), intent(inout) :: self
    call self%factor%destroy()
    if (allocated(self%equation)) deallocate (self%diagonal, self%equation, self%axes_of, self%axes, self%x, self%motion)
    if (allocated(self%rigid)) deallocate (self%rigid, self%hold)
    self%n_motions = 0
    self%n_contact_nodes = 0
  end subroutine full_response_destroy
end module dotyk_response_full
