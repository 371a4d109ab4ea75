!> The p-multigrid of a body as systems over several bodies see it: the block rows with their smoother, the corner space
!> and solves in it.
!>
!> Vectors of the system are over all components of all nodes, in nodal axes and in the order of a space-filling curve,
!> zero along held components.
module dotyk_response_body_grid
  use dotyk_base_kinds, only: dp, sp
  use dotyk_base_thresholds, only: golden, rough
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_corner_space, only: corner_space_t
  use dotyk_linalg_chebyshev, only: chebyshev_t
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient, preconditioned_system_t
  use dotyk_linalg_fixed_sum, only: remove_components, scalar_product
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_response_aggregate_space, only: aggregate_space_t, to_equations, to_unknowns
  implicit none
  private

  type :: coarse_interpolation_t  !! The interpolation.
    integer :: n = 0  !! Unknowns of the coarse level.
    type(corner_space_t) :: space  !! Corners.
    type(constraint_t) :: corner_constraint  !! Their equations and nodal axes.
    type(aggregate_space_t) :: aggregates  !! Aggregates; empty where there are corners.
  contains
    procedure :: restrict => interpolation_restrict
    procedure :: prolong => interpolation_prolong
    procedure :: carry_rows => interpolation_carry_rows
  end type coarse_interpolation_t

  !> The levels of one body. An extension has the operator of the corner space.
  type, abstract, extends(preconditioned_system_t), public :: body_grid_t
    integer :: n = 0  !! Number of unknowns of the system: components times nodes.
    type(chebyshev_t) :: fine  !! The stiffness by block rows, with its smoother.
    type(constraint_t) :: constraint  !! Equations of the body and nodal axes, nodes in the order of the rows.
    !> Interpolation from the corners, or from aggregates of linear elements.
    type(coarse_interpolation_t) :: interpolation
    !> Rigid body modes over the unknowns of the system, orthonormal (n, n_modes) [].
    real(dp), allocatable :: mode(:, :)
    !> Least and greatest Ritz value of the preconditioned stiffness in all solves so far [].
    real(dp) :: least = 1, greatest = 1
    logical :: is_sure = .false.  !! Whether no eigenvalue is below `least_eigenvalue`, all but certainly.
    real(dp) :: worst = 0  !! Largest residual that a solve has left, relative, in the norm of the preconditioner [].
  contains
    procedure :: multiply => grid_multiply
    procedure :: to_system => grid_to_system
    procedure :: to_equations => grid_to_equations
    procedure :: least_eigenvalue => grid_least_eigenvalue
    procedure :: take_spectrum => grid_take_spectrum
    procedure :: measure_spectrum => grid_measure_spectrum
    procedure :: make_sure_of_least => grid_make_sure_of_least
    procedure :: force_norm => grid_force_norm
    procedure(solve_corners), deferred :: solve_coarse  !! x := K_c^+ x in the corner space, about.
    procedure(count_entries), deferred :: corner_entries  !! Cost of such a solve.
    !> Make ready for compliances of contact rows; one thread at a time.
    procedure(change_grid), deferred :: prepare_rows
    procedure(form_compliance), deferred :: form_row_compliance  !! Compliance of contact rows in the corner space.
    procedure(get_corner_matrix), deferred :: get_corner_matrix  !! Stiffness of the corner space, where it is kept.
    procedure(change_grid), deferred :: destroy  !! Give back all memory.
  end type body_grid_t

  abstract interface
    !> x := K_c^+ x.
    subroutine solve_corners(self, x)
      import :: body_grid_t, dp
      class(body_grid_t), intent(in) :: self
      !> Forces on the corners in, displacements out (interpolation%n) [force], [length].
      real(dp), intent(inout) :: x(:)
    end subroutine solve_corners

    !> Entries that a solve in the corner space reads.
    pure real(dp) function count_entries(self)
      import :: body_grid_t, dp
      class(body_grid_t), intent(in) :: self
    end function count_entries

    !> K_c and its null vectors.
    subroutine get_corner_matrix(self, matrix, mode)
      import :: body_grid_t, sparse_symmetric_t, dp
      class(body_grid_t), target, intent(in) :: self
      !> Stiffness of the corner space; not associated where it is not kept (interpolation%n, interpolation%n)
      !> [force/length].
      type(sparse_symmetric_t), pointer, intent(out) :: matrix
      real(dp), pointer, intent(out) :: mode(:, :)  !! Its null vectors, orthonormal (interpolation%n, n_modes) [].
    end subroutine get_corner_matrix

    !> Change what the levels have.
    subroutine change_grid(self)
      import :: body_grid_t
      class(body_grid_t), intent(inout) :: self
    end subroutine change_grid

    !> B P K_c^+ P^T B^T.
    subroutine form_compliance(self, rows, value)
      import :: body_grid_t, sparse_rows_t, dp
      class(body_grid_t), intent(in) :: self
      !> The rows over the equations of the corner space, B P (n x n_corner_equations) [].
      type(sparse_rows_t), intent(in) :: rows
      real(dp), allocatable, intent(out) :: value(:, :)  !! (n, n) [length/force].
    end subroutine form_compliance
  end interface

  !> Safety factor of the least Ritz value, which is larger than the least eigenvalue [].
  real(dp), parameter :: margin = 0.7_dp
  !> Share of a start without order along an eigenvector, as a fraction of that of the mean one: one in a hundred has
  !> less [].
  real(dp), parameter :: least_share = 0.01_dp
  integer, parameter :: most_steps = 400  !! Iterations at most.
  real(dp), parameter :: silver = 0.4142135623730951_dp  !! Fractions of its multiples have no order.

contains

  !> y = K x.
  subroutine grid_multiply(self, x, y)
    class(body_grid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Displacements x (n) [length].
    real(dp), intent(out), contiguous :: y(:)  !! Forces y (n) [force].
    call self%fine%multiply(x, y)
  end subroutine grid_multiply

  !> A vector over the equations of the body as one of the system.
  subroutine grid_to_system(self, x, y)
    class(body_grid_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Vector over the equations (n_equations) [any].
    real(dp), intent(out), contiguous :: y(:)  !! Vector of the system (n) [as x].
    call to_unknowns(size(self%constraint%equation), self%constraint%equation, x, y)
  end subroutine grid_to_system

  !> A vector of the system as one over the equations of the body.
  subroutine grid_to_equations(self, y, x)
    class(body_grid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: y(:)  !! Vector of the system (n) [any].
    real(dp), intent(inout) :: x(:)  !! Vector over the equations (n_equations) [as y].
    call to_equations(size(self%constraint%equation), self%constraint%equation, y, x)
  end subroutine grid_to_equations

  !> A lower bound of the eigenvalues of the preconditioned stiffness, but for rigid body modes, as measured.
  pure real(dp) function grid_least_eigenvalue(self) result(least)
    class(body_grid_t), intent(in) :: self
    least = margin*self%least
  end function grid_least_eigenvalue

  !> Take the Ritz values of an iteration from a start without order, and whether they leave no room for an eigenvalue
  !> below `least_eigenvalue`.
  subroutine grid_take_spectrum(self, outcome)
    class(body_grid_t), intent(inout) :: self
    type(cg_outcome_t), intent(in) :: outcome  !! The iteration.
    real(dp) :: least, greatest
    if (outcome%steps == 0) return
    call outcome%ritz_values(least, greatest)
    self%least = min(self%least, least)
    self%greatest = max(self%greatest, greatest)
    self%is_sure = outcome%eigenvalue_bound(share_of_start(self)) >= self%least_eigenvalue()
  end subroutine grid_take_spectrum

  !> Share of a start without order along an eigenvector, at least [].
  pure real(dp) function share_of_start(self) result(share)
    class(body_grid_t), intent(in) :: self
    share = least_share/sqrt(real(self%n, dp))
  end function share_of_start

  !> Measure the Ritz values by conjugate gradients from a start without order, until all that is left of it is less
  !> than what an eigenvector with an eigenvalue far below the least of them would leave: ten iterations where
  !> p-multigrid converges fast.
  !>
  !> The start is the sum of forces without order and of those of displacements without order: weak and strong
  !> eigenvectors have a share.
  subroutine grid_measure_spectrum(self, most_steps, outcome)
    class(body_grid_t), intent(inout) :: self
    integer, intent(in) :: most_steps  !! Iterations at most.
    type(cg_outcome_t), intent(out) :: outcome  !! The iteration.
    real(dp), allocatable :: b(:), x(:)
    allocate (b(self%n), x(self%n))
    call without_order(self%n, self%constraint%equation, golden, x)
    call self%multiply(x, b)
    b(:) = b/self%force_norm(b)
    call without_order(self%n, self%constraint%equation, silver, x)
    call remove_components(self%n, self%mode, x)
    b(:) = b + x/self%force_norm(x)
    call remove_components(self%n, self%mode, b)
    call conjugate_gradient(self, b, x, rough*share_of_start(self), most_steps, outcome)
    call self%take_spectrum(outcome)
  end subroutine grid_measure_spectrum

  !> Make sure that no eigenvalue is far below the least Ritz value, in some hundred iterations if need be.
  subroutine grid_make_sure_of_least(self)
    class(body_grid_t), intent(inout) :: self
    type(cg_outcome_t) :: outcome
    if (self%is_sure) return
    call self%measure_spectrum(most_steps, outcome)
    ! What is left may be more than what a weak eigenvector leaves.
    if (.not. self%is_sure) self%least = min(self%least, outcome%eigenvalue_bound(share_of_start(self))/margin)
    self%is_sure = .true.
  end subroutine grid_make_sure_of_least

  !> Numbers without order at free components, zero at held ones.
  pure subroutine without_order(n, equation, ratio, x)
    integer, intent(in) :: n  !! Number of unknowns.
    integer, intent(in) :: equation(n)  !! Their equations, 0 where held (n).
    real(dp), intent(in) :: ratio  !! Fractions of its multiples are taken [].
    real(dp), intent(out) :: x(n)  !! Between -1/2 and 1/2 (n) [].
    integer :: i
    do i = 1, n
      x(i) = merge(modulo(i*ratio, 1.0_dp) - 0.5_dp, 0.0_dp, equation(i) > 0)
    end do
  end subroutine without_order

  !> A bound of sqrt(r^T K^+ r), the energy norm of the displacement by some forces, from one cycle: the preconditioner
  !> is at least `least_eigenvalue` times the inverse.
  real(dp) function grid_force_norm(self, r) result(norm)
    class(body_grid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! Forces over the unknowns (n) [force].
    real(dp), allocatable :: z(:)
    allocate (z(size(r)))
    call self%precondition(r, z)
    norm = scalar_product(size(r), r, z)
    if (norm > 0) then
      norm = sqrt(norm/self%least_eigenvalue())
    else
      ! Rounding, or a number that is not finite.
      norm = merge(0.0_dp, huge(norm), norm <= 0)
    end if
  end function grid_force_norm

  !> P^T r.
  subroutine interpolation_restrict(self, constraint, factor, r, coarse)
    class(coarse_interpolation_t), intent(in) :: self
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    real(dp), intent(in) :: factor  !! Factor of the result [].
    real(sp), intent(in), contiguous :: r(:)  !! Forces in nodal axes, zero along held components (dim*n_nodes) [force].
    real(dp), intent(out), contiguous :: coarse(:)  !! On the coarse level (n) [force].
    if (self%aggregates%n > 0) then
      call self%aggregates%restrict(factor, r, coarse)
    else
      call self%space%restrict(constraint, self%corner_constraint, factor, r, coarse)
    end if
  end subroutine interpolation_restrict

  !> P x.
  subroutine interpolation_prolong(self, constraint, coarse, x)
    class(coarse_interpolation_t), intent(in) :: self
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    real(dp), intent(in), contiguous :: coarse(:)  !! Of the coarse level (n) [length].
    real(dp), intent(out), contiguous :: x(:)  !! Displacements in nodal axes (dim*n_nodes) [length].
    if (self%aggregates%n > 0) then
      call self%aggregates%prolong(coarse, x)
    else
      call self%space%prolong(constraint, self%corner_constraint, coarse, x)
    end if
  end subroutine interpolation_prolong

  !> B P.
  subroutine interpolation_carry_rows(self, constraint, rows, coarse)
    class(coarse_interpolation_t), intent(in) :: self
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    !> Rows B over all components of the nodes, in nodal axes (n_rows x dim*n_nodes) [].
    type(sparse_rows_t), intent(in) :: rows
    type(sparse_rows_t), intent(inout) :: coarse  !! The rows over the unknowns of the coarse level (n_rows x n) [].
    if (self%aggregates%n > 0) then
      call self%aggregates%carry_rows(rows, coarse)
    else
      call corner_rows(self%space, constraint, self%corner_constraint, rows, coarse)
    end if
  end subroutine interpolation_carry_rows

  !> B P for the corner space.
  subroutine corner_rows(space, constraint, corner_constraint, rows, corner)
    type(corner_space_t), intent(in) :: space  !! The corner space.
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    type(constraint_t), intent(in) :: corner_constraint  !! Equations and nodal axes of the corners.
    type(sparse_rows_t), intent(in) :: rows  !! Rows over the unknowns of the system.
    type(sparse_rows_t), intent(inout) :: corner  !! The rows over the corner equations.
    real(dp), allocatable :: share(:, :), value(:)
    real(dp) :: v(size(constraint%equation, 1))
    integer, allocatable :: row(:), column(:), touched(:)
    logical, allocatable :: is_touched(:)
    integer :: i, j, k, l, c, dim, n, n_touched
    dim = size(v)
    allocate (share(dim, space%n), source=0.0_dp)
    allocate (touched(space%n), is_touched(space%n))
    is_touched = .false.
    ! An entry goes to eight corners at most, with all components in tilted axes.
    allocate (row(8*dim*size(rows%column)), column(8*dim*size(rows%column)), value(8*dim*size(rows%column)))
    n = 0
    do i = 1, rows%n_rows
      n_touched = 0
      do k = rows%row_start(i), rows%row_start(i + 1) - 1
        j = (rows%column(k) - 1)/dim + 1
        v = 0
        v(rows%column(k) - dim*(j - 1)) = rows%value(k)/(space%start(j + 1) - space%start(j))
        if (constraint%frame_of(j) > 0) v = matmul(constraint%frame(:, :, constraint%frame_of(j)), v)
        do l = space%start(j), space%start(j + 1) - 1
          c = space%corner(l)
          if (.not. is_touched(c)) then
            n_touched = n_touched + 1
            touched(n_touched) = c
            is_touched(c) = .true.
            share(:, c) = 0
          end if
          share(:, c) = share(:, c) + v
        end do
      end do
      do l = 1, n_touched
        c = touched(l)
        is_touched(c) = .false.
        v = share(:, c)
        if (corner_constraint%frame_of(c) > 0) &
          v = matmul(v, corner_constraint%frame(:, :, corner_constraint%frame_of(c)))
        do j = 1, dim
          if (corner_constraint%equation(j, c) == 0 .or. .not. abs(v(j)) > 0) cycle
          n = n + 1
          row(n) = i
          column(n) = corner_constraint%equation(j, c)
          value(n) = v(j)
        end do
      end do
    end do
    call corner%init_from_triplets(rows%n_rows, corner_constraint%n_equations, row(:n), column(:n), value(:n))
  end subroutine corner_rows
end module dotyk_response_body_grid
