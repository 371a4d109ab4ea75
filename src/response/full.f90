!> The response of a body through the Cholesky factor of its whole stiffness.
!>
!> Built in steps, because a driver runs them for many bodies with different shares of the machine: `prepare` (ordering and
!> symbolic analysis: fill and flops are known then), `factorize`, `attach` (where contact forces act).
module dotyk_response_full
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_ordering, only: expand_permutation, nested_dissection
  use dotyk_response_response, only: response_t
  implicit none
  private

  !> Response by solves with the factor of the full stiffness.
  type, extends(response_t), public :: full_response_t
    !> Factor of the stiffness over the free equations.
    type(cholesky_t) :: factor
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
    procedure :: solve => full_response_solve
    procedure :: destroy => full_response_destroy
  end type full_response_t

  !> A pivot that elimination has left less than this part of is round-off.
  real(dp), parameter :: least_pivot = 1.0e-13_dp

contains

  !> Order the equations and analyse the factorization.
  subroutine full_response_prepare(self, body, error)
    class(full_response_t), intent(inout) :: self
    !> The body, assembled.
    type(body_t), intent(in) :: body
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: node_order(:), permutation(:)
    self%dimension = body%dimension
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
    integer :: failed_column, place(2)
    call self%factor%factorize_and_discard(body%stiffness, failed_column, error)
    if (allocated(error)) return
    ! A part that is not held can pass the factorization by round-off; its last pivot is nothing but that.
    if (failed_column == 0 .and. self%factor%weakest_pivot < least_pivot) failed_column = self%factor%weakest_equation
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
  end subroutine full_response_attach

  !> Contact forces to displacements: scatter, solve, gather.
  subroutine full_response_apply(self, force, displacement)
    class(full_response_t), intent(inout) :: self
    !> Forces (dimension, n_contact_nodes) [force].
    real(dp), intent(in) :: force(:, :)
    !> Displacements (dimension, n_contact_nodes) [length].
    real(dp), intent(out) :: displacement(:, :)
    real(dp) :: local(self%dimension)
    integer :: i, k
    self%x = 0
    do i = 1, self%n_contact_nodes
      local = force(:, i)
      if (self%axes_of(i) > 0) local = matmul(local, self%axes(:, :, self%axes_of(i)))
      do k = 1, self%dimension
        if (self%equation(k, i) > 0) self%x(self%equation(k, i)) = local(k)
      end do
    end do
    call self%factor%solve(self%x)
    do i = 1, self%n_contact_nodes
      do k = 1, self%dimension
        local(k) = 0
        if (self%equation(k, i) > 0) local(k) = self%x(self%equation(k, i))
      end do
      if (self%axes_of(i) > 0) local = matmul(self%axes(:, :, self%axes_of(i)), local)
      displacement(:, i) = local
    end do
  end subroutine full_response_apply

  !> A full solve.
  subroutine full_response_solve(self, x)
    class(full_response_t), intent(inout) :: self
    !> Right-hand side in, solution out (n_equations).
    real(dp), intent(inout) :: x(:)
    call self%factor%solve(x)
  end subroutine full_response_solve

  !> Give back all memory.
  subroutine full_response_destroy(self)
    class(full_response_t), intent(inout) :: self
    call self%factor%destroy()
    if (allocated(self%equation)) deallocate (self%equation, self%axes_of, self%axes, self%x)
    self%n_contact_nodes = 0
  end subroutine full_response_destroy
end module dotyk_response_full
