!> p-multigrid for one body: conjugate gradients in double precision, preconditioned by one cycle of two levels.
!>
!> A cycle smooths the residual (`dotyk_linalg_chebyshev`), corrects it on the corner space
!> (`dotyk_elasticity_corner_space`), whose Galerkin matrix is factorized, and smooths again: symmetric, hence a
!> preconditioner for conjugate gradients. Smoothing is in single precision; the correction of the corner space is large
!> where the displacement is nearly rigid, and stays in double precision. Memory and time of a solve are linear in the
!> unknowns, but for the factor of the corner space: 1/8 of the unknowns of tet10. A large corner space has cycles of
!> smoothed aggregation in its place (`dotyk_linalg_smoothed_aggregation`): all is linear then. Linear elements have no
!> lower degree: smoothed aggregates of nodes (`dotyk_response_aggregate_space`) are their corners.
!>
!> A body with rigid body modes R: P = I - R R^T after the cycle, and the Moore-Penrose inverse of the corner space
!> (`dotyk_response_direct`). Residuals are in the range of P, as the right-hand side is.
module dotyk_response_multigrid
  use dotyk_base_error, only: add_context, error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_base_thresholds, only: half_digits
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_corner_space, only: corner_space_t
  use dotyk_elasticity_rigid_body_modes, only: rigid_body_modes_t
  use dotyk_elasticity_two_levels, only: is_linear, two_levels_t
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_linalg_dense, only: orthonormal_range
  use dotyk_linalg_fixed_sum, only: remove_components
  use dotyk_linalg_ordered_solve, only: ordered_solve_t
  use dotyk_linalg_ordering, only: expand_permutation
  use dotyk_linalg_smoothed_aggregation, only: lower_triangle, order_blocks
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_linalg_springs, only: add_springs, choose_fixing_equations
  use dotyk_response_aggregate_space, only: aggregate_space_t, aggregated_corners_t
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_response_corner_compliance, only: form_corner_compliance
  use dotyk_response_direct, only: direct_response_t, remove_modes
  use dotyk_response_stiffness_factor, only: factorization_report_t
  implicit none
  private

  !> The two levels of a body. It owns a factor: never copy it, destroy it in the end.
  type, extends(body_grid_t), public :: multigrid_t
    type(direct_response_t) :: coarse  !! Compliance operator of the corner space.
    type(ordered_solve_t), private :: coarse_solve  !! Its solves in a cycle.
    !> Corner spaces and aggregates of more unknowns are not factorized; aggregates are coupled to more others.
    integer :: largest_factor = 300000, largest_aggregates = 100000
    logical :: is_aggregated = .false.  !! Whether `aggregated` takes the place of `coarse`.
    type(aggregated_corners_t) :: aggregated  !! Smoothed aggregation on a large corner space.
    !> Whether the stiffness of the corner space is kept beside its factor, as ties need it; and that matrix.
    logical :: keeps_corner_matrix = .false.
    type(sparse_symmetric_t), private :: corner_matrix
    type(two_levels_t), allocatable :: levels  !! Between `assemble` and `factorize`: both levels.
  contains
    procedure :: init => multigrid_init
    procedure :: assemble => multigrid_assemble
    procedure :: analyze => multigrid_analyze
    procedure :: factorize => multigrid_factorize
    procedure :: take_whole => multigrid_take_whole
    procedure, private :: take_rows => multigrid_take_rows
    procedure, private :: take_modes => multigrid_take_modes
    procedure :: make_smoother => multigrid_make_smoother
    procedure :: corner_entries => multigrid_corner_entries
    procedure :: prepare_rows => multigrid_prepare_rows
    procedure :: form_row_compliance => multigrid_form_row_compliance
    procedure :: keep_matrix => multigrid_keep_matrix
    procedure :: get_corner_matrix => multigrid_get_corner_matrix
    procedure :: precondition => multigrid_precondition
    procedure :: solve_coarse => multigrid_solve_coarse
    procedure :: solve => multigrid_solve
    procedure :: bytes => multigrid_bytes
    procedure :: destroy => multigrid_destroy
  end type multigrid_t

  !> Entries of a factor that threads share in a solve: some ms; CHOLMOD solves with smaller ones.
  integer(int64), parameter, public :: least_shared = 1000000

contains

  !> Assemble both levels and factorize the coarse one.
  subroutine multigrid_init(self, body, modes, report, error)
    class(multigrid_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body; it need not be assembled.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that its supports leave.
    type(factorization_report_t), intent(out) :: report  !! Condition of the corner space.
    type(error_t), allocatable, intent(out) :: error  !! As in `assemble`, `analyze` and `factorize`.
    call self%assemble(body, error)
    if (.not. allocated(error)) call self%analyze(body, modes, error)
    if (.not. allocated(error)) call self%factorize(report, error)
    if (.not. allocated(error)) call self%make_smoother(error)
  end subroutine multigrid_init

  !> Assemble both levels.
  subroutine multigrid_assemble(self, body, error)
    class(multigrid_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body; it need not be assembled.
    !> Allocated where an element is inverted, the modulus field is not positive, or the elements do not conform.
    type(error_t), allocatable, intent(out) :: error
    call self%destroy()
    allocate (self%levels)
    if (is_linear(body%mesh)) then
      call assemble_linear(self, body, error)
      return
    end if
    call self%levels%assemble(body, error, self%largest_factor)
    if (allocated(error)) return
    self%interpolation%corner_constraint = self%levels%corner_body%constraint
    self%interpolation%n = self%interpolation%corner_constraint%n_equations
    self%is_aggregated = allocated(self%levels%corner_rows%column)
  end subroutine multigrid_assemble

  !> Assemble the stiffness of linear elements, and the Galerkin matrix of its aggregates.
  subroutine assemble_linear(self, body, error)
    class(multigrid_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! As in `assemble`.
    !> As in `assemble`; also where a diagonal block of the stiffness is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    type(rigid_body_modes_t) :: rigid
    real(dp), allocatable :: x(:, :), shape(:, :, :)
    call self%levels%assemble_rows(body, error)
    if (allocated(error)) return
    call self%take_rows()
    ! All nodes are corners of this space, which the aggregates replace.
    x = body%mesh%x(:, self%interpolation%space%corner)
    self%interpolation%space = corner_space_t()
    call rigid%init(body%mesh, body%analysis, body%constraint, shape)
    call self%take_modes(body, shape)
    call self%interpolation%aggregates%init(self%fine, x, self%constraint, self%mode, error)
    self%interpolation%n = self%interpolation%aggregates%n
    self%is_aggregated = self%interpolation%n > self%largest_aggregates
  end subroutine assemble_linear

  !> Order and analyse the factorization of the corner space: the memory of its factor is known then.
  subroutine multigrid_analyze(self, body, modes, error)
    class(multigrid_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The same body as in `assemble`.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that its supports leave.
    type(error_t), allocatable, intent(out) :: error  !! As in `analyze` of `direct_response_t`.
    type(body_modes_t) :: corner_modes
    if (self%interpolation%aggregates%n == 0) call self%take_rows()
    call self%take_modes(body, modes%shape)
    if (self%is_aggregated) return
    if (self%interpolation%aggregates%n > 0) then
      call analyze_aggregates(self%interpolation%aggregates, self%coarse, error)
      return
    end if
    associate (levels => self%levels)
      call corner_modes%find(levels%corner_body)
      ! The corners do not tell which motions springs hold.
      if (body%constraint%foundation%n > 0) call restrict_modes(self, corner_modes)
      call self%coarse%analyze(levels%corner_body, corner_modes, levels%corner_stiffness, error)
      call levels%corner_stiffness%forget_graph()
    end associate
    if (allocated(error)) call add_context(error, 'multigrid, corner space: ')
  end subroutine multigrid_analyze

  !> Rigid body modes of the corner body: those of the body at its corners.
  subroutine restrict_modes(self, modes)
    class(multigrid_t), intent(in) :: self
    type(body_modes_t), intent(inout) :: modes  !! Of the corner body; gets them.
    real(dp), allocatable :: at_corners(:, :), basis(:, :)
    integer :: c, k, dim
    associate (space => self%interpolation%space, constraint => self%constraint)
      dim = size(constraint%equation, 1)
      allocate (at_corners(dim*space%n, size(self%mode, 2)), basis(dim*space%n, size(self%mode, 2)))
      do c = 1, space%n
        associate (node => space%node(c))
          at_corners(dim*(c - 1) + 1:dim*c, :) = self%mode(dim*(node - 1) + 1:dim*node, :)
          if (constraint%frame_of(node) == 0) cycle
          do k = 1, size(self%mode, 2)
            at_corners(dim*(c - 1) + 1:dim*c, k) = matmul(constraint%frame(:, :, constraint%frame_of(node)), &
                                                         self%mode(dim*(node - 1) + 1:dim*node, k))
          end do
        end associate
      end do
      call orthonormal_range(at_corners, half_digits, basis, modes%n)
      modes%shape = reshape(basis(:, :modes%n), [dim, space%n, modes%n])
    end associate
  end subroutine restrict_modes

  !> Factorize the corner space, or make the levels of smoothed aggregation: the report is empty then.
  subroutine multigrid_factorize(self, report, error)
    class(multigrid_t), intent(inout) :: self
    type(factorization_report_t), intent(out) :: report  !! Condition of the corner space.
    !> Allocated where the stiffness is not positive definite, or memory runs out.
    type(error_t), allocatable, intent(out) :: error
    if (self%is_aggregated .and. self%interpolation%aggregates%n > 0) then
      call self%aggregated%init_aggregates(self%interpolation%aggregates, error)
    else if (self%is_aggregated) then
      call self%aggregated%init(self%levels, error)
    else if (self%interpolation%aggregates%n > 0) then
      call self%keep_matrix(self%interpolation%aggregates%matrix)
      call factorize_aggregates(self%interpolation%aggregates, self%coarse, report, error)
    else
      call self%keep_matrix(self%levels%corner_stiffness%matrix)
      call self%coarse%factorize(self%levels%corner_body, self%levels%corner_stiffness, .false., report, error)
      if (allocated(error)) call add_context(error, 'multigrid, corner space: ')
    end if
    deallocate (self%levels)
  end subroutine multigrid_factorize

  !> The fine level of a body whose coarse level is the body itself: for bodies that are solved directly beside others
  !> in one system. `coarse` is made by the caller.
  subroutine multigrid_take_whole(self, body, modes, error)
    class(multigrid_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that its supports leave.
    !> Allocated where an element is inverted, or the modulus field is not positive.
    type(error_t), allocatable, intent(out) :: error
    allocate (self%levels)
    call self%levels%assemble_rows(body, error)
    if (allocated(error)) return
    self%interpolation%corner_constraint = body%constraint
    self%interpolation%n = body%constraint%n_equations
    call self%take_rows()
    call self%take_modes(body, modes%shape)
    deallocate (self%levels)
  end subroutine multigrid_take_whole

  !> Take the fine level.
  subroutine multigrid_take_rows(self)
    class(multigrid_t), intent(inout) :: self
    self%constraint = self%levels%constraint
    self%interpolation%space = self%levels%space
    self%n = size(self%constraint%equation)
    call self%levels%rows%move_to(self%fine%rows)
  end subroutine multigrid_take_rows

  !> Take the rigid body modes.
  subroutine multigrid_take_modes(self, body, shape)
    class(multigrid_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body.
    !> Rigid body modes that its supports leave, as in `body_modes_t` (dim, n_nodes, n_modes) [].
    real(dp), intent(in) :: shape(:, :, :)
    real(dp), allocatable :: mode(:)
    integer :: k
    if (allocated(self%mode)) deallocate (self%mode)
    allocate (self%mode(self%n, size(shape, 3)), mode(body%constraint%n_equations))
    do k = 1, size(self%mode, 2)
      call body%constraint%reduce(shape(:, :, k), mode)
      call self%to_system(mode, self%mode(:, k))
    end do
  end subroutine multigrid_take_modes

  !> Invert the diagonal blocks.
  subroutine multigrid_make_smoother(self, error)
    class(multigrid_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a diagonal block is not positive definite.
    logical :: regular
    if (self%coarse%factor%factor_entries > least_shared) call self%coarse_solve%init(self%coarse%factor)
    ! That of linear elements has been made with the aggregates.
    if (allocated(self%fine%inverse)) return
    call self%fine%prepare(regular)
    if (regular) return
    !$omp critical (message)
    call set_error(error, 'multigrid: a diagonal block of the stiffness is not positive definite', exit_not_solvable)
    !$omp end critical (message)
  end subroutine multigrid_make_smoother

  !> Entries of the factor of the corner space, or of the levels in its place, that a solve reads.
  pure real(dp) function multigrid_corner_entries(self) result(entries)
    class(multigrid_t), intent(in) :: self
    if (self%is_aggregated) then
      entries = self%aggregated%bytes()/8.0_dp
    else
      entries = real(self%coarse%factor%factor_entries, dp)
    end if
  end function multigrid_corner_entries

  !> Make the corner space ready for compliances of contact rows.
  subroutine multigrid_prepare_rows(self)
    class(multigrid_t), intent(inout) :: self
    if (.not. self%is_aggregated) call self%coarse%prepare_substitution()
  end subroutine multigrid_prepare_rows

  !> Compliance of contact rows in the corner space: by the factor, or with the cycles of smoothed aggregation in its
  !> place, row by row.
  subroutine multigrid_form_row_compliance(self, rows, value)
    class(multigrid_t), intent(in) :: self
    !> The rows over the equations of the corner space (n x n_corner_equations) [].
    type(sparse_rows_t), intent(in) :: rows
    real(dp), allocatable, intent(out) :: value(:, :)  !! (n, n) [length/force].
    real(dp), allocatable :: x(:), e(:)
    integer :: i
    if (.not. self%is_aggregated) then
      call form_corner_compliance(self%coarse, rows, value)
      return
    end if
    allocate (value(rows%n_rows, rows%n_rows), x(rows%n_columns), e(rows%n_rows))
    do i = 1, rows%n_rows
      e = 0
      e(i) = 1
      call rows%multiply_transposed(e, x)
      call self%solve_coarse(x)
      call rows%multiply(x, value(:, i))
    end do
    value = (value + transpose(value))/2
  end subroutine multigrid_form_row_compliance

  !> Keep the stiffness of the corner space, if that is asked for.
  subroutine multigrid_keep_matrix(self, matrix)
    class(multigrid_t), intent(inout) :: self
    type(sparse_symmetric_t), intent(in) :: matrix  !! The stiffness, without springs [force/length].
    if (self%keeps_corner_matrix) self%corner_matrix = matrix
  end subroutine multigrid_keep_matrix

  !> K_c and its null vectors.
  subroutine multigrid_get_corner_matrix(self, matrix, mode)
    class(multigrid_t), target, intent(in) :: self
    !> Not associated where it is not kept (interpolation%n, interpolation%n) [force/length].
    type(sparse_symmetric_t), pointer, intent(out) :: matrix
    real(dp), pointer, intent(out) :: mode(:, :)  !! (interpolation%n, n_modes) []
    nullify (matrix, mode)
    if (.not. allocated(self%corner_matrix%value)) return
    matrix => self%corner_matrix
    mode => self%coarse%mode
  end subroutine multigrid_get_corner_matrix

  !> One cycle.
  subroutine multigrid_precondition(self, r, z)
    class(multigrid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! Forces r (n) [force].
    real(dp), intent(out), contiguous :: z(:)  !! Displacements z, about K^+ r (n) [length].
    real(sp), allocatable :: b(:), x(:), rest(:)
    real(dp), allocatable :: correction(:), coarse(:)
    real(dp) :: size_of_r
    integer :: i
    size_of_r = maxval(abs(r))
    ! Zero or NaN.
    if (.not. size_of_r > 0) then
      z = r
      return
    end if
    allocate (b(self%n), x(self%n), rest(self%n), correction(self%n), coarse(self%interpolation%n))
    !$omp parallel do default(none) shared(self, r, b, size_of_r) schedule(static)
    do i = 1, self%n
      b(i) = real(r(i)/size_of_r, sp)
    end do
    !$omp end parallel do
    call self%fine%smooth(b, x)
    call self%fine%rows%residual(b, x, rest)
    call self%interpolation%restrict(self%constraint, self%fine%rows%scale, rest, coarse)
    call self%solve_coarse(coarse)
    call self%interpolation%prolong(self%constraint, coarse, correction)
    call self%fine%rows%subtract_product(correction, rest)
    call self%fine%smooth(rest, b)
    !$omp parallel do default(none) shared(self, z, b, x, correction, size_of_r) schedule(static)
    do i = 1, self%n
      z(i) = size_of_r/self%fine%rows%scale*(correction(i) + (real(x(i), dp) + b(i)))
    end do
    !$omp end parallel do
    call remove_components(self%n, self%mode, z)
  end subroutine multigrid_precondition

  !> x := K_c^+ x, about, by all threads: by the factor, or by cycles of smoothed aggregation.
  subroutine multigrid_solve_coarse(self, x)
    class(multigrid_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Forces on the corners in, displacements out (interpolation%n) [force], [length].
    if (self%is_aggregated) then
      call self%aggregated%solve(x)
      return
    else if (self%coarse_solve%n == 0) then
      call self%coarse%solve(x)
      return
    end if
    call remove_modes(self%coarse%mode, x)
    call self%coarse_solve%solve(x)
    call remove_modes(self%coarse%mode, x)
  end subroutine multigrid_solve_coarse

  !> x := K^+ x over the equations of the body, by conjugate gradients.
  subroutine multigrid_solve(self, x, tolerance, most_steps, outcome)
    class(multigrid_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    !> Reduction of the residual to stop at, in the norm of the preconditioner, about the energy norm of the error [].
    real(dp), intent(in) :: tolerance
    integer, intent(in) :: most_steps  !! Greatest number of iterations.
    type(cg_outcome_t), intent(out) :: outcome  !! Iterations, convergence.
    real(dp), allocatable :: b(:), y(:)
    allocate (b(self%n), y(self%n))
    call self%to_system(x, b)
    call remove_components(self%n, self%mode, b)
    call conjugate_gradient(self, b, y, tolerance, most_steps, outcome)
    call remove_components(self%n, self%mode, y)
    call self%to_equations(y, x)
  end subroutine multigrid_solve

  !> Memory of the matrices, the factor and the modes [bytes].
  pure integer(int64) function multigrid_bytes(self) result(bytes)
    class(multigrid_t), intent(in) :: self
    bytes = self%fine%bytes() + self%coarse%factor%factor_bytes + self%aggregated%bytes() + &
            self%corner_matrix%bytes() + &
            self%interpolation%aggregates%bytes()
    if (allocated(self%mode)) bytes = bytes + 8*size(self%mode, kind=int64)
  end function multigrid_bytes

  !> Give back all memory.
  subroutine multigrid_destroy(self)
    class(multigrid_t), intent(inout) :: self
    call self%fine%destroy()
    call self%coarse%destroy()
    call self%coarse_solve%destroy()
    call self%aggregated%destroy()
    call self%corner_matrix%destroy()
    call self%interpolation%aggregates%destroy()
    self%is_aggregated = .false.
    if (allocated(self%mode)) deallocate (self%mode)
    if (allocated(self%levels)) deallocate (self%levels)
    self%interpolation%n = 0
    self%n = 0
  end subroutine multigrid_destroy

  !> Order and analyse the factorization of the Galerkin matrix.
  subroutine analyze_aggregates(self, response, error)
    type(aggregate_space_t), intent(inout) :: self  !! The space; gets the matrix in place of its block rows.
    type(direct_response_t), intent(inout) :: response  !! Compliance operator of the space.
    type(error_t), allocatable, intent(out) :: error  !! As in `analyze` of `direct_response_t`.
    integer, allocatable :: order(:), permutation(:), equation(:, :)
    integer :: i
    call lower_triangle(self%rows, self%matrix)
    self%matrix%value(:) = self%rows%scale*self%matrix%value
    call order_blocks(self%rows, order, error)
    if (allocated(error)) return
    equation = reshape([(i, i=1, self%n)], [self%rows%dim, self%rows%n])
    allocate (permutation(self%n))
    call expand_permutation(order, equation, permutation)
    call self%rows%destroy()
    deallocate (self%near_null)
    call move_alloc(self%mode, response%mode)
    call choose_fixing_equations(response%mode, response%fixing_equation)
    call response%factor%analyze(self%matrix, permutation, error)
  end subroutine analyze_aggregates

  !> Factorize the Galerkin matrix.
  subroutine factorize_aggregates(self, response, report, error)
    type(aggregate_space_t), intent(inout) :: self  !! The space; without its matrix on return.
    type(direct_response_t), intent(inout) :: response  !! Compliance operator of the space.
    type(factorization_report_t), intent(out) :: report  !! Condition of the Galerkin matrix.
    !> Allocated where the Galerkin matrix is not positive definite beside its null vectors, or memory runs out.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: spring(:)
    integer :: failed_column
    call add_springs(self%matrix, response%fixing_equation, spring)
    call response%factor%factorize_and_discard(self%matrix, failed_column, error)
    if (.not. allocated(error) .and. failed_column > 0) then
      !$omp critical (message)
      call set_error(error, 'the stiffness is not positive definite: the body, or a part of it that is connected '// &
                     'by single nodes or edges only, has a free rigid body mode; add a &support', exit_not_solvable)
      !$omp end critical (message)
    end if
    if (allocated(error)) then
      call add_context(error, 'multigrid, aggregates: ')
      return
    end if
    report%condition = 1/response%factor%weakest_pivot
    report%condition_left = report%condition
  end subroutine factorize_aggregates
end module dotyk_response_multigrid
