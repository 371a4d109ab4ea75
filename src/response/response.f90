!> The compliance operator of a body: loads over its equations to displacements.
!>
!> It is the inverse of the stiffness K or, where the supports leave rigid body modes R, its Moore-Penrose inverse
!> `K^+ = P K_s^{-1} P`, `P = I - R R^T`, with K_s the stiffness regularized by springs
!> (`dotyk_linalg_springs`). Restricted to the contact nodes (`dotyk_response_contact_map`) it is the
!> Neumann-to-Dirichlet map (inverse Steklov-Poincare operator) that the schemes ask for. Congruent bodies share one
!> operator: equations and modes over them are the same.
module dotyk_response_response
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_forward_substitution, only: forward_solution_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_body_grid, only: body_grid_t
  implicit none
  private

  type, abstract, public :: response_t  !! The compliance operator of a class of congruent bodies, in one of its forms.
    !> Rigid body modes over the equations, orthonormal (n_equations, n_modes) []; without columns for a body that is
    !> held.
    real(dp), allocatable :: mode(:, :)
  contains
    procedure(solve_interface), deferred :: solve  !! x := K^+ x.
    procedure :: solve_roughly => response_solve_roughly  !! The same to some percent, where that takes less time.
    procedure :: solve_block => response_solve_block  !! x := K^+ x for a block of right-hand sides.
    procedure :: solve_from => response_solve_from  !! x := K^+ x, from an approximation where that helps.
    procedure :: subtract_forces => response_subtract_forces  !! f := f - K x, what a solve leaves.
    !> Whether a solve of all bodies costs no more than one of them, and that solve.
    procedure :: solves_together => response_solves_together
    procedure :: solve_together => response_solve_together
    !> Relative error of a solve in the energy norm; 0 where it is rounding.
    procedure :: solve_error => response_solve_error
    !> The p-multigrid of the body, for systems over several bodies; not associated where it has none.
    procedure :: body_grid => response_body_grid
    !> Make ready for forward substitutions; one thread at a time.
    procedure(prepare_interface), deferred :: prepare_substitution
    !> Entries of the factor that the forward substitution of one row goes through, on average; before the factorization
    !> too.
    procedure(path_entries_interface), deferred :: path_entries
    !> Forward substitution of rows of B; many threads may do this with one operator.
    procedure(substitute_interface), deferred :: substitute
    !> B K^+ B^T for the rows of two forward substitutions; many threads may do this with one operator.
    procedure(product_interface), deferred :: product
    procedure(destroy_interface), deferred :: destroy  !! Give back all memory.
  end type response_t

  type, public :: substituted_rows_t  !! Forward substitution of some rows b of B.
    type(forward_solution_t) :: forward  !! L^{-1} b, L the factor of the (regularized) stiffness.
    real(dp), allocatable :: along(:, :), regularized(:, :)  !! b R and b Z, Z = K_s^{-1} R (n, n_modes).
  end type substituted_rows_t

  type, public :: equation_vector_t  !! Displacements or forces of one body over its equations.
    real(dp), allocatable :: value(:)  !! (n_equations) [length or force]
  end type equation_vector_t

  type, public :: response_slot_t  !! One place in an array of operators that may have different forms.
    !> The operator; allocated for the representative of each class of congruent bodies.
    class(response_t), allocatable :: form
  end type response_slot_t

  abstract interface
    !> x := K^+ x.
    subroutine solve_interface(self, x)
      import :: response_t, dp
      class(response_t), intent(in) :: self
      real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    end subroutine solve_interface

    !> Make ready.
    subroutine prepare_interface(self)
      import :: response_t
      class(response_t), intent(inout) :: self
    end subroutine prepare_interface

    !> Entries of the factor on the elimination-tree paths.
    real(dp) function path_entries_interface(self, equation)
      import :: response_t, dp
      class(response_t), intent(inout) :: self
      integer, intent(in) :: equation(:)  !! Equations where the paths begin (n).
    end function path_entries_interface

    !> Forward substitution.
    subroutine substitute_interface(self, rows, substituted)
      import :: response_t, sparse_rows_t, substituted_rows_t
      class(response_t), intent(in) :: self
      type(sparse_rows_t), intent(in) :: rows  !! Rows over the equations.
      type(substituted_rows_t), intent(inout) :: substituted  !! L^{-1} of them.
    end subroutine substitute_interface

    !> c_ij = a_i K^+ b_j.
    subroutine product_interface(self, a, b, same, c)
      import :: response_t, substituted_rows_t, dp
      class(response_t), intent(in) :: self
      type(substituted_rows_t), intent(in) :: a, b  !! Rows of the two sides.
      logical, intent(in) :: same  !! Whether a and b are the same rows.
      real(dp), intent(out) :: c(:, :)  !! Entries between the rows (a%forward%n, b%forward%n) [length/force].
    end subroutine product_interface

    !> Give back all memory.
    subroutine destroy_interface(self)
      import :: response_t
      class(response_t), intent(inout) :: self
    end subroutine destroy_interface
  end interface

contains

  !> x := K^+ x. A factor needs no approximation.
  subroutine response_solve_from(self, start, x)
    class(response_t), intent(in) :: self
    real(dp), intent(in) :: start(:)  !! Approximate solution (n_equations) [length].
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    call self%solve(x)
    associate (not_needed => start)
    end associate
  end subroutine response_solve_from

  !> Forces that a solve leaves: those of a factor are rounding, which is judged elsewhere.
  subroutine response_subtract_forces(self, x, f)
    class(response_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Solution (n_equations) [length].
    real(dp), intent(inout) :: f(:)  !! Right-hand side in, what is left of it out (n_equations) [force].
    f = 0
    associate (not_needed => same_type_as(self, self), not_used => x)
    end associate
  end subroutine response_subtract_forces

  !> A factor is that of one body.
  pure logical function response_solves_together(self) result(together)
    class(response_t), intent(in) :: self
    together = .false.
    associate (not_needed => same_type_as(self, self))
    end associate
  end function response_solves_together

  !> A factor gives the exact solution in the same time.
  subroutine response_solve_roughly(self, x)
    class(response_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    call self%solve(x)
  end subroutine response_solve_roughly

  !> Never called where bodies are not solved together.
  subroutine response_solve_together(self, x)
    class(response_t), intent(in) :: self
    type(equation_vector_t), intent(inout) :: x(:)  !! Right-hand sides [force] in, solutions [length] out (n_bodies).
    associate (not_needed => same_type_as(self, self), not_used => x)
    end associate
  end subroutine response_solve_together

  !> Relative error of a solve: that of a factor is rounding, which is judged elsewhere.
  pure real(dp) function response_solve_error(self) result(error)
    class(response_t), intent(in) :: self
    error = 0
    associate (not_needed => same_type_as(self, self))
    end associate
  end function response_solve_error

  !> A factor has no p-multigrid.
  function response_body_grid(self) result(grid)
    class(response_t), intent(in) :: self
    class(body_grid_t), pointer :: grid  !! Not associated.
    grid => null()
    associate (not_needed => same_type_as(self, self))
    end associate
  end function response_body_grid

  !> X := K^+ X, column by column.
  subroutine response_solve_block(self, x)
    class(response_t), intent(in) :: self
    !> Right-hand sides [force] in, solutions [length] out (n_equations, n).
    real(dp), intent(inout), contiguous :: x(:, :)
    integer :: j
    do j = 1, size(x, 2)
      call self%solve(x(:, j))
    end do
  end subroutine response_solve_block
end module dotyk_response_response
