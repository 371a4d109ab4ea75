!> The response of a body through the Cholesky factor of its whole stiffness, or through the last block of that factor alone.
!>
!> Built in steps, because a driver runs them for many bodies with different shares of the machine: `prepare` (ordering and
!> symbolic analysis: fill and flops are known then), `attach` (where contact forces act), `factorize`.
!>
!> Contact unknowns that come last in the order of elimination make the factor a little larger (+3 % flops where 5 % of a face may
!> touch, +76 % for all of it) and responses much cheaper, see `dotyk_response_condensed`. The compliance of the contact points as a
!> matrix, by forward substitutions with either factor, makes them cheaper still. Which is best is known from the symbolic analysis of both
!> orders and the responses to come (`dotyk_response_demand`).
!>
!> A body with free motions R is factorized with springs on a few unknowns, see dotyk_response_hold, K_s: then
!> `K^+ = P K_s^{-1} P`, `P = I - R R^T`. Forces act at contact nodes, so R^T f takes the motions of these only.
!>
!> Bodies of one kind (dotyk_elasticity_congruence) have one factor: the first one's response makes it, owns it and gives it back, the
!> others `share` it and are not used after that. Axes of nodes are each body's own, equations and motions over them are the kind's.
module dotyk_response_full
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: response_auto, response_compliance, response_condensed, response_full
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_node_ordering, only: fill_reducing_order
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_ordering, only: expand_permutation
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_response_components, only: gather, scatter, to_equations
  use dotyk_response_condensed, only: condensed_t
  use dotyk_response_demand, only: cost_of_matrix, cost_of_solves, response_demand_t
  use dotyk_response_forward_solver, only: forward_solver_t
  use dotyk_response_definite, only: digits_t, factorize_stiffness
  use dotyk_response_hold, only: choose_holds
  use dotyk_response_motions, only: remove_motions, subtract_motions
  use dotyk_response_response, only: forward_response_t, response_t
  implicit none
  private

  !> Response by solves with the factor of the full stiffness.
  type, extends(response_t), public :: full_response_t
    !> Factor of the stiffness over the free equations; the first's of the kind where it is shared.
    type(cholesky_t), pointer :: factor => null()
    !> Whether factor and rigid are another response's.
    logical :: shares = .false.
    !> Whether the contact unknowns are the last ones of the factor.
    logical :: is_condensed = .false.
    !> Whether single responses are to go by the compliance as a matrix: whoever knows B has to make it.
    logical :: is_explicit = .false.
    !> Contact unknowns where they are.
    integer, private :: n_last = 0
    !> Operations and entries of the factor in the order that is best without regard to contact.
    real(dp) :: whole_flops = 0
    integer(int64) :: whole_entries = 0
    type(condensed_t), private :: condensed
    !> Equations with springs, one for each free motion; chosen by `prepare` (n_motions).
    integer, allocatable :: hold(:)
    !> Free motions over the equations, orthonormal (n_equations, n_motions).
    real(dp), pointer, contiguous, private :: rigid(:, :) => null()
    !> Equations of the contact nodes (dimension, n_contact_nodes), in the node's axes; 0 where prescribed.
    integer, allocatable, private :: equation(:, :)
    !> Axes of each contact node: 0 for the global ones, else an index into `axes` (n_contact_nodes).
    integer, allocatable, private :: axes_of(:)
    !> Axes as columns (dimension, dimension, n).
    real(dp), allocatable, private :: axes(:, :, :)
    !> Right-hand side and solution (n_equations).
    real(dp), allocatable, private :: x(:)
    !> What the factor lost; of the first of the kind.
    type(digits_t) :: digits
    !> What forward substitutions need; the first's of the kind where it is shared.
    type(forward_solver_t), pointer, private :: forward => null()
  contains
    procedure :: prepare => full_response_prepare
    procedure :: share => full_response_share
    procedure :: factorize => full_response_factorize
    procedure :: attach => full_response_attach
    procedure :: adopt_near_null_modes => full_response_adopt_soft_motions
    procedure :: apply => full_response_apply
    procedure :: response_entries => full_response_entries
    procedure, private :: choose_form => full_response_choose_form
    procedure :: share_condensed => full_response_share_condensed
    procedure, private :: take_condensed => full_response_take_condensed
    procedure, private :: keep_diagonal => full_response_keep_diagonal
    procedure :: prepare_forward_substitution => full_response_prepare_forward_substitution
    procedure :: path_entries => full_response_path_entries
    procedure :: forward_substitution => full_response_forward_substitution
    procedure :: forward_product => full_response_forward_product
    procedure :: solve => full_response_solve
    procedure :: destroy => full_response_destroy
  end type full_response_t

  !> Bytes that a matrix may take which is not asked for.
  real(dp), parameter :: most_bytes = 1.0e9_dp

contains

  !> Order the equations and analyse the factorization.
  subroutine full_response_prepare(self, body, error, contact_node, form, demand)
    class(full_response_t), intent(inout) :: self
    !> The body, assembled.
    type(body_t), intent(in) :: body
    type(error_t), allocatable, intent(out) :: error
    !> Nodes where contact forces may act; none if absent.
    integer, intent(in), optional :: contact_node(:)
    !> One of `form_*`; if absent, the whole factor.
    integer, intent(in), optional :: form
    !> Responses to come.
    type(response_demand_t), intent(in), optional :: demand
    integer, allocatable :: node_order(:), permutation(:)
    integer :: k
    self%dimension = body%dimension
    self%n_motions = size(body%rigid_mode, 3)
    allocate (self%rigid(body%constraint%n_equations, self%n_motions))
    do k = 1, self%n_motions
      call body%constraint%reduce(body%rigid_mode(:, :, k), self%rigid(:, k))
    end do
    call choose_holds(self%rigid, self%hold)
    ! Nodes are ordered, not equations: the graph is smaller, and the equations of a node stay together.
    allocate (node_order(size(body%graph_start) - 1))
    call fill_reducing_order(body%mesh, body%graph_start, body%graph_neighbour, node_order, error)
    if (allocated(error)) return
    allocate (permutation(body%constraint%n_equations))
    call expand_permutation(node_order, body%constraint%equation, permutation)
    if (.not. associated(self%factor)) allocate (self%factor, self%forward)
    call self%factor%analyze(body%stiffness, permutation, error)
    if (allocated(error)) return
    self%whole_flops = self%factor%flops
    self%whole_entries = self%factor%factor_entries
    if (.not. present(form)) return
    call self%choose_form(body, permutation, pack(body%constraint%equation(:, contact_node), &
                                                  body%constraint%equation(:, contact_node) > 0), form, demand, error)
  end subroutine full_response_prepare

  !> Take the form that costs least, or the one that was asked for: contact unknowns last or not, single responses by solves or by the
  !> compliance as a matrix.
  subroutine full_response_choose_form(self, body, permutation, last, form, demand, error)
    class(full_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body
    !> Order of elimination for the whole factor (n_equations).
    integer, intent(in) :: permutation(:)
    !> Equations of the contact nodes.
    integer, intent(in) :: last(:)
    !> As in `prepare`.
    integer, intent(in) :: form
    type(response_demand_t), intent(in) :: demand
    type(error_t), allocatable, intent(out) :: error
    type(cholesky_t), pointer :: other
    logical, allocatable :: is_last(:)
    real(dp) :: solves(2), matrix(2), entries
    integer :: n
    n = size(last)
    if (n == 0) return
    entries = real(n, dp)*(n + 1)/2
    solves = cost_of_solves(demand, [real(self%factor%factor_entries, dp), entries])
    matrix = cost_of_matrix(demand, [self%forward%path_entries(self%factor, last), entries])
    self%is_explicit = form == response_compliance
    if (form == response_auto .and. demand%n_steps > 0 .and. 8*real(demand%n_rows, dp)**2/demand%n_bodies < most_bytes) then
      self%is_explicit = minval(matrix) < minval(solves)
    end if
    if (self%is_explicit .or. demand%n_steps == 0) solves = matrix
    self%is_explicit = self%is_explicit .and. demand%n_steps > 0
    if (any(form == [response_full, response_compliance])) return
    ! The last block alone takes n^3/3.
    if (form == response_auto .and. solves(2) + real(n, dp)**3/3 > solves(1) + self%factor%flops) return
    allocate (is_last(size(permutation)), source=.false.)
    is_last(last) = .true.
    allocate (other)
    call other%analyze(body%stiffness, [pack(permutation, .not. is_last(permutation)), pack(permutation, is_last(permutation))], &
                       error, n)
    if (allocated(error)) then
      deallocate (other)
      return
    end if
    self%is_condensed = form == response_condensed .or. solves(2) + other%flops < solves(1) + self%factor%flops
    if (self%is_condensed) then
      call self%factor%destroy()
      call self%forward%destroy()
      deallocate (self%factor)
      self%factor => other
      self%n_last = n
    else
      call other%destroy()
      deallocate (other)
    end if
  end subroutine full_response_choose_form

  !> In place of `prepare`: be the response of another body of the same kind.
  subroutine full_response_share(self, first)
    class(full_response_t), intent(inout) :: self
    !> Prepared; it is destroyed after this one is used for the last time.
    class(full_response_t), intent(in) :: first
    self%shares = .true.
    self%dimension = first%dimension
    self%n_motions = first%n_motions
    self%is_condensed = first%is_condensed
    self%is_explicit = first%is_explicit
    self%n_last = first%n_last
    self%factor => first%factor
    self%forward => first%forward
    self%rigid => first%rigid
  end subroutine full_response_share

  !> Entries of the factor that a response goes through, twice.
  pure integer(int64) function full_response_entries(self) result(entries)
    !> Prepared.
    class(full_response_t), intent(in) :: self
    entries = self%factor%factor_entries
    if (self%is_condensed) entries = int(self%n_last, int64)*(self%n_last + 1)/2
  end function full_response_entries

  !> Factorize. The memory of the stiffness is given back before that of the factor is taken.
  subroutine full_response_factorize(self, body, error, take_apart)
    class(full_response_t), intent(inout) :: self
    !> The same body as in `prepare`; without stiffness on return.
    type(body_t), intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    !> Whether soft motions may be treated apart, see `adopt_near_null_modes`; not if absent.
    logical, intent(in), optional :: take_apart
    call factorize_stiffness(body, self%factor, self%hold, self%digits, error, take_apart)
    if (allocated(error)) return
    call self%take_condensed()
  end subroutine full_response_factorize

  !> Say where contact forces act.
  subroutine full_response_attach(self, body, contact_node, first)
    class(full_response_t), intent(inout) :: self
    !> The same body as in `prepare`, or another one of its kind that shares its factor.
    type(body_t), intent(in) :: body
    !> Nodes of the body where contact forces may act (n_contact_nodes).
    integer, intent(in) :: contact_node(:)
    !> The body that has the stiffness, where it is another one.
    type(body_t), intent(in), optional :: first
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
    if (present(first)) then
      call self%keep_diagonal(first%stiffness)
    else
      call self%keep_diagonal(body%stiffness)
    end if
    self%motion = reshape(body%rigid_mode(:, contact_node, :), [self%dimension*size(contact_node), self%n_motions])
    call self%take_condensed()
  end subroutine full_response_attach

  !> Take the soft motions for motions with springs, once the first of the kind is factorized; the response is that of the body held in
  !> them then.
  subroutine full_response_adopt_soft_motions(self, digits)
    !> Attached, of a body that is held.
    class(full_response_t), intent(inout) :: self
    !> Of the first of the kind, with soft motions.
    type(digits_t), intent(in) :: digits
    real(dp), allocatable :: u(:, :)
    integer :: k
    self%n_motions = size(digits%motion, 2)
    self%motion_stiffness = digits%stiffness
    deallocate (self%motion)
    allocate (self%motion(self%dimension*self%n_contact_nodes, self%n_motions), u(self%dimension, self%n_contact_nodes))
    do k = 1, self%n_motions
      call gather(self%dimension, self%n_contact_nodes, self%equation, self%axes_of, self%axes, digits%motion(:, k), u)
      self%motion(:, k) = reshape(u, [size(u)])
    end do
  end subroutine full_response_adopt_soft_motions

  !> The condensed stiffness, once there are a factor and contact nodes.
  subroutine full_response_take_condensed(self)
    class(full_response_t), intent(inout) :: self
    if (.not. self%is_condensed .or. .not. allocated(self%equation) .or. self%shares) return
    if (self%factor%is_factorized()) call self%condensed%init(self%factor, self%n_last, self%equation, self%rigid)
  end subroutine full_response_take_condensed

  !> The same of a body that shares its factor.
  subroutine full_response_share_condensed(self, first)
    !> Attached.
    class(full_response_t), intent(inout) :: self
    !> The one that owns the factor, attached and factorized.
    class(full_response_t), intent(in) :: first
    if (self%is_condensed) call self%condensed%share(first%condensed, self%equation)
  end subroutine full_response_share_condensed

  !> Keep the diagonal of the stiffness at the contact nodes, if it is still there.
  subroutine full_response_keep_diagonal(self, stiffness)
    class(full_response_t), intent(inout) :: self
    type(sparse_symmetric_t), intent(in) :: stiffness
    real(dp) :: axis(self%dimension), entry
    integer :: i, k
    allocate (self%diagonal(self%dimension*self%n_contact_nodes), source=0.0_dp)
    if (.not. allocated(stiffness%value)) return
    do i = 1, self%n_contact_nodes
      do k = 1, self%dimension
        if (self%equation(k, i) == 0) cycle
        entry = stiffness%value(stiffness%column_start(self%equation(k, i)) + 1)
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
    real(dp), allocatable :: x(:, :)
    if (self%condensed%n > 0) then
      allocate (x(self%condensed%n, 1))
      call scatter(self%dimension, self%n_contact_nodes, self%condensed%place, self%axes_of, self%axes, force, x(:, 1))
      call self%condensed%solve_block(self%factor, x)
      call gather(self%dimension, self%n_contact_nodes, self%condensed%place, self%axes_of, self%axes, x(:, 1), displacement)
      return
    end if
    call scatter(self%dimension, self%n_contact_nodes, self%equation, self%axes_of, self%axes, force, self%x)
    if (size(self%rigid, 2) > 0) call subtract_motions(self%rigid, matmul(reshape(force, [size(force)]), self%motion), self%x)
    call self%factor%solve(self%x)
    call remove_motions(self%rigid, self%x)
    call gather(self%dimension, self%n_contact_nodes, self%equation, self%axes_of, self%axes, self%x, displacement)
  end subroutine full_response_apply

  !> Get ready for forward substitutions.
  subroutine full_response_prepare_forward_substitution(self)
    class(full_response_t), intent(inout) :: self
    call self%forward%init(self%factor, self%rigid)
  end subroutine full_response_prepare_forward_substitution

  !> Entries of a path through the factor.
  real(dp) function full_response_path_entries(self) result(entries)
    class(full_response_t), intent(inout) :: self
    entries = self%forward%path_entries(self%factor, pack(self%equation, self%equation > 0))
  end function full_response_path_entries

  !> Forward substitutions for rows of B.
  subroutine full_response_forward_substitution(self, matrix, row, forward)
    class(full_response_t), intent(in) :: self
    !> As in `response_t`.
    type(sparse_rows_t), intent(in) :: matrix
    integer, intent(in) :: row(:)
    type(forward_response_t), intent(inout) :: forward
    type(sparse_rows_t) :: rows
    call to_equations(self%equation, self%axes_of, self%axes, matrix, row, rows)
    call self%forward%solve(rows, self%rigid, forward)
  end subroutine full_response_forward_substitution

  !> b K^+ b'.
  subroutine full_response_forward_product(self, a, b, same, c)
    class(full_response_t), intent(in) :: self
    !> As in `response_t`.
    type(forward_response_t), intent(in) :: a, b
    logical, intent(in) :: same
    real(dp), intent(out) :: c(:, :)
    call self%forward%product(a, b, same, c)
  end subroutine full_response_forward_product

  !> A full solve.
  subroutine full_response_solve(self, x)
    class(full_response_t), intent(inout) :: self
    !> Right-hand side in, solution out (n_equations).
    real(dp), intent(inout) :: x(:)
    call remove_motions(self%rigid, x)
    call self%factor%solve(x)
    call remove_motions(self%rigid, x)
  end subroutine full_response_solve

  !> Give back all memory that is its own.
  subroutine full_response_destroy(self)
    class(full_response_t), intent(inout) :: self
    if (associated(self%factor) .and. .not. self%shares) then
      call self%factor%destroy()
      call self%forward%destroy()
      deallocate (self%factor, self%forward)
    end if
    if (associated(self%rigid) .and. .not. self%shares) deallocate (self%rigid)
    nullify (self%factor, self%forward, self%rigid)
    self%shares = .false.
    call self%condensed%destroy()
    self%is_condensed = .false.
    if (allocated(self%equation)) deallocate (self%diagonal, self%equation, self%axes_of, self%axes, self%x, self%motion)
    if (allocated(self%hold)) deallocate (self%hold)
    if (allocated(self%motion_stiffness)) deallocate (self%motion_stiffness)
    self%n_motions = 0
    self%n_contact_nodes = 0
  end subroutine full_response_destroy
end module dotyk_response_full
