!> The p-multigrid of a body as systems over several bodies see it: the block rows with their smoother, the corner space
!> and solves in it.
!>
!> Vectors of the system are over all components of all nodes, in nodal axes and in the order of a space-filling curve,
!> zero along held components.
module dotyk_response_body_grid
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_linalg_chebyshev, only: chebyshev_t
  use dotyk_linalg_conjugate_gradient, only: preconditioned_system_t
  use dotyk_linalg_fixed_sum, only: scalar_product
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_coarse_interpolation, only: coarse_interpolation_t
  use dotyk_response_free_unknowns, only: to_equations, to_unknowns
  implicit none
  private

  !> The levels of one body. An extension has the operator of the corner space.
  type, abstract, extends(preconditioned_system_t), public :: body_grid_t
    !> Number of unknowns of the system: components times nodes.
    integer :: n = 0
    !> The stiffness by block rows, with its smoother.
    type(chebyshev_t) :: fine
    !> Equations of the body and nodal axes, nodes in the order of the rows.
    type(constraint_t) :: constraint
    !> Interpolation from the corners, or from aggregates of linear elements.
    type(coarse_interpolation_t) :: interpolation
    !> Rigid body modes over the unknowns of the system, orthonormal (n, n_modes) [].
    real(dp), allocatable :: mode(:, :)
    !> Least and greatest Ritz value of the preconditioned stiffness in all solves so far [].
    real(dp) :: least = 1, greatest = 1
    !> Largest residual that a solve has left, relative, in the norm of the preconditioner [].
    real(dp) :: worst = 0
  contains
    procedure :: multiply => grid_multiply
    procedure :: to_system => grid_to_system
    procedure :: to_equations => grid_to_equations
    procedure :: least_eigenvalue => grid_least_eigenvalue
    procedure :: force_norm => grid_force_norm
    !> x := K_c^+ x in the corner space, about.
    procedure(solve_corners), deferred :: solve_coarse
    !> Cost of such a solve.
    procedure(count_entries), deferred :: corner_entries
    !> Make ready for compliances of contact rows; one thread at a time.
    procedure(change_grid), deferred :: prepare_rows
    !> Compliance of contact rows in the corner space.
    procedure(form_compliance), deferred :: form_row_compliance
    !> Give back all memory.
    procedure(change_grid), deferred :: destroy
  end type body_grid_t

  abstract interface
    !> x := K_c^+ x.
    subroutine solve_corners(self, x)
      import :: body_grid_t, dp
      !> The levels.
      class(body_grid_t), intent(in) :: self
      !> Forces on the corners in, displacements out (interpolation%n) [force], [length].
      real(dp), intent(inout) :: x(:)
    end subroutine solve_corners

    !> Entries that a solve in the corner space reads.
    pure real(dp) function count_entries(self)
      import :: body_grid_t, dp
      !> The levels.
      class(body_grid_t), intent(in) :: self
    end function count_entries

    !> Change what the levels have.
    subroutine change_grid(self)
      import :: body_grid_t
      !> The levels.
      class(body_grid_t), intent(inout) :: self
    end subroutine change_grid

    !> B P K_c^+ P^T B^T.
    subroutine form_compliance(self, rows, value)
      import :: body_grid_t, sparse_rows_t, dp
      !> The levels, ready by `prepare_rows` if there are rows.
      class(body_grid_t), intent(in) :: self
      !> The rows over the equations of the corner space, B P (n x n_corner_equations) [].
      type(sparse_rows_t), intent(in) :: rows
      !> (n, n) [length/force].
      real(dp), allocatable, intent(out) :: value(:, :)
    end subroutine form_compliance
  end interface

  !> Safety factor of the least Ritz value, which is larger than the least eigenvalue [].
  real(dp), parameter :: margin = 0.7_dp

contains

  !> y = K x.
  subroutine grid_multiply(self, x, y)
    class(body_grid_t), intent(in) :: self
    !> Displacements x (n) [length].
    real(dp), intent(in), contiguous :: x(:)
    !> Forces y (n) [force].
    real(dp), intent(out), contiguous :: y(:)
    call self%fine%multiply(x, y)
  end subroutine grid_multiply

  !> A vector over the equations of the body as one of the system.
  subroutine grid_to_system(self, x, y)
    class(body_grid_t), intent(in) :: self
    !> Vector over the equations (n_equations) [any].
    real(dp), intent(in) :: x(:)
    !> Vector of the system (n) [as x].
    real(dp), intent(out), contiguous :: y(:)
    call to_unknowns(size(self%constraint%equation), self%constraint%equation, x, y)
  end subroutine grid_to_system

  !> A vector of the system as one over the equations of the body.
  subroutine grid_to_equations(self, y, x)
    class(body_grid_t), intent(in) :: self
    !> Vector of the system (n) [any].
    real(dp), intent(in), contiguous :: y(:)
    !> Vector over the equations (n_equations) [as y].
    real(dp), intent(inout) :: x(:)
    call to_equations(size(self%constraint%equation), self%constraint%equation, y, x)
  end subroutine grid_to_equations

  !> A lower bound of the eigenvalues of the preconditioned stiffness, but for rigid body modes, as measured.
  pure real(dp) function grid_least_eigenvalue(self) result(least)
    class(body_grid_t), intent(in) :: self
    least = margin*self%least
  end function grid_least_eigenvalue

  !> A bound of sqrt(r^T K^+ r), the energy norm of the displacement by some forces, from one cycle: the preconditioner
  !> is at least `least_eigenvalue` times the inverse.
  real(dp) function grid_force_norm(self, r) result(norm)
    class(body_grid_t), intent(in) :: self
    !> Forces over the unknowns (n) [force].
    real(dp), intent(in), contiguous :: r(:)
    real(dp), allocatable :: z(:)
    allocate (z(size(r)))
    call self%precondition(r, z)
    norm = sqrt(max(0.0_dp, scalar_product(size(r), r, z))/self%least_eigenvalue())
  end function grid_force_norm
end module dotyk_response_body_grid
