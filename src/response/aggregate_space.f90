!> The coarse space of a body of linear elements: smoothed aggregates of its nodes (`dotyk_linalg_smoothed_aggregation`)
!> in the place that the corners have for quadratic elements.
!>
!> An aggregate has about twenty nodes, and six unknowns in space, three in the plane: rigid motions, after one step of
!> smoothing. Aggregates reproduce the rigid body modes of the body.
!>
!> A large corner space, or one of many aggregates, is solved by cycles of smoothed aggregation in place of a factor.
module dotyk_response_aggregate_space
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_rigid_body_modes, only: near_null_vectors
  use dotyk_elasticity_two_levels, only: two_levels_t
  use dotyk_linalg_block_prolongator, only: block_prolongator_t
  use dotyk_linalg_block_rows, only: block_rows_t
  use dotyk_linalg_chebyshev, only: chebyshev_t
  use dotyk_linalg_smoothed_aggregation, only: aggregation_level_t, make_level, smoothed_aggregation_t
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  implicit none
  private
  public :: to_equations, to_unknowns

  type, public :: aggregated_corners_t  !! The levels. It owns a factor: never copy it, destroy it in the end.
    type(smoothed_aggregation_t) :: levels  !! Smoothed aggregation over all components of the corners, in nodal axes.
    integer :: cycles = 1  !! Cycles of a solve: symmetric with any number.
    !> Equation of each component of each corner, 0 where it is held (dim*n_corners).
    integer, allocatable :: equation(:)
  contains
    procedure :: init => corners_init
    procedure :: init_aggregates => corners_init_aggregates
    procedure :: solve => corners_solve
    procedure :: bytes => corners_bytes
    procedure :: destroy => corners_destroy
  end type aggregated_corners_t

  type, public :: aggregate_space_t  !! The space.
    integer :: n = 0  !! Number of unknowns of the aggregates.
    type(block_prolongator_t) :: prolongator  !! Interpolation P from the aggregates.
    !> Until it is analysed: the Galerkin matrix P^T K P by block rows [force/length], vectors that it maps to little,
    !> and its null vectors, orthonormal (n, any) [].
    type(block_rows_t) :: rows
    real(dp), allocatable :: near_null(:, :), mode(:, :)
    type(sparse_symmetric_t) :: matrix  !! From then on until it is factorized: the Galerkin matrix [force/length].
  contains
    procedure :: init => space_init
    procedure :: restrict => space_restrict
    procedure :: prolong => space_prolong
    procedure :: carry_rows => space_carry_rows
    procedure :: rows_of_node => space_rows_of_node
    procedure :: matrix_bytes => space_matrix_bytes
    procedure :: bytes => space_bytes
    procedure :: destroy => space_destroy
  end type aggregate_space_t

contains

  !> Find the aggregates, and the Galerkin matrix.
  subroutine space_init(self, fine, x, constraint, mode, error)
    class(aggregate_space_t), intent(inout) :: self
    type(chebyshev_t), intent(inout) :: fine  !! The stiffness; the smoother is prepared on return.
    real(dp), intent(in) :: x(:, :)  !! Coordinates of the nodes (dim, n_nodes) [length].
    type(constraint_t), intent(in) :: constraint  !! Their equations and axes.
    real(dp), intent(in) :: mode(:, :)  !! Rigid body modes that the supports leave, orthonormal (n_fine, n_modes) [].
    !> Allocated where a diagonal block of the stiffness is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    type(aggregation_level_t) :: level
    level%smoother%degree = fine%degree
    level%smoother%ratio = fine%ratio
    call fine%rows%move_to(level%smoother%rows)
    call near_null_vectors(x, constraint, self%near_null)
    self%mode = mode
    call make_level(1, 0.0_dp, self%near_null, self%mode, level, self%rows, error)
    call level%smoother%rows%move_to(fine%rows)
    if (allocated(error)) return
    fine%greatest = level%smoother%greatest
    call move_alloc(level%smoother%inverse, fine%inverse)
    call level%prolongator%move_to(self%prolongator)
    self%n = self%prolongator%m*self%prolongator%n_coarse
  end subroutine space_init

  !> P^T r.
  subroutine space_restrict(self, factor, r, coarse)
    class(aggregate_space_t), intent(in) :: self
    real(dp), intent(in) :: factor  !! Factor of the result [].
    real(sp), intent(in), contiguous :: r(:)  !! Forces in nodal axes, zero along held components (n_fine) [force].
    real(dp), intent(out) :: coarse(:)  !! On the aggregates (n) [force].
    real(sp), allocatable :: low(:)
    allocate (low(self%n))
    call self%prolongator%restrict(r, low)
    coarse(:) = factor*low
  end subroutine space_restrict

  !> P x.
  subroutine space_prolong(self, coarse, x)
    class(aggregate_space_t), intent(in) :: self
    real(dp), intent(in), contiguous :: coarse(:)  !! Of the aggregates (n) [length].
    real(dp), intent(out), contiguous :: x(:)  !! Displacements in nodal axes (n_fine) [length].
    call self%prolongator%prolong(coarse, x)
  end subroutine space_prolong

  !> B P.
  subroutine space_carry_rows(self, rows, coarse)
    class(aggregate_space_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows  !! Rows B over the unknowns of the body (n_rows x n_fine) [].
    type(sparse_rows_t), intent(inout) :: coarse  !! The rows over the unknowns of the aggregates (n_rows x n) [].
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
    integer :: i, j, k, l, c, node, pass, n
    associate (p => self%prolongator)
      do pass = 1, 2
        n = 0
        do i = 1, rows%n_rows
          do k = rows%row_start(i), rows%row_start(i + 1) - 1
            node = (rows%column(k) - 1)/p%dim + 1
            c = rows%column(k) - p%dim*(node - 1)
            do l = p%start(node), p%start(node + 1) - 1
              if (pass == 2) then
                do j = 1, p%m
                  row(n + j) = i
                  column(n + j) = p%m*(p%column(l) - 1) + j
                  value(n + j) = p%value(j, c, l)*rows%value(k)
                end do
              end if
              n = n + p%m
            end do
          end do
        end do
        if (pass == 1) allocate (row(n), column(n), value(n))
      end do
      call coarse%init_from_triplets(rows%n_rows, self%n, row, column, value)
    end associate
  end subroutine space_carry_rows

  !> Block rows of an aggregate in the Galerkin matrix.
  pure integer function space_rows_of_node(self) result(n)
    class(aggregate_space_t), intent(in) :: self
    n = self%prolongator%m/3
  end function space_rows_of_node

  !> Memory of the Galerkin matrix [bytes].
  pure integer(int64) function space_matrix_bytes(self) result(bytes)
    class(aggregate_space_t), intent(in) :: self
    bytes = self%rows%bytes() + self%matrix%bytes()
  end function space_matrix_bytes

  !> Memory of the interpolation [bytes].
  pure integer(int64) function space_bytes(self) result(bytes)
    class(aggregate_space_t), intent(in) :: self
    bytes = self%prolongator%bytes()
  end function space_bytes

  !> Give back all memory.
  subroutine space_destroy(self)
    class(aggregate_space_t), intent(inout) :: self
    call self%prolongator%destroy()
    call self%rows%destroy()
    if (allocated(self%near_null)) deallocate (self%near_null)
    if (allocated(self%mode)) deallocate (self%mode)
    call self%matrix%destroy()
    self%n = 0
  end subroutine space_destroy

  !> Make the levels.
  subroutine corners_init(self, levels, error)
    class(aggregated_corners_t), intent(inout) :: self
    !> Assembled, with the corner space by block rows, whose arrays are taken over.
    type(two_levels_t), intent(inout) :: levels
    type(error_t), allocatable, intent(out) :: error  !! As in `smoothed_aggregation_t`.
    type(body_modes_t) :: modes
    real(dp), allocatable :: vector(:, :), mode(:, :), reduced(:)
    integer :: k
    associate (constraint => levels%corner_body%constraint)
      self%equation = reshape(constraint%equation, [size(constraint%equation)])
      call near_null_vectors(levels%corner_body%mesh%x, constraint, vector)
      call modes%find(levels%corner_body)
      allocate (mode(size(self%equation), modes%n), reduced(constraint%n_equations))
      do k = 1, modes%n
        call constraint%reduce(modes%shape(:, :, k), reduced)
        call to_unknowns(size(self%equation), self%equation, reduced, mode(:, k))
      end do
    end associate
    call self%levels%init(levels%corner_rows, vector, mode, error)
    if (allocated(error)) call add_context(error, 'multigrid, corner space: ')
  end subroutine corners_init

  !> Make the levels below the aggregates of a body of linear elements.
  subroutine corners_init_aggregates(self, aggregates, error)
    class(aggregated_corners_t), intent(inout) :: self
    type(aggregate_space_t), intent(inout) :: aggregates  !! With their Galerkin matrix, whose arrays are taken over.
    type(error_t), allocatable, intent(out) :: error  !! As in `smoothed_aggregation_t`.
    integer :: i
    self%equation = [(i, i=1, aggregates%n)]
    self%levels%threshold = self%levels%coarse_threshold
    call self%levels%init(aggregates%rows, aggregates%near_null, aggregates%mode, error, aggregates%rows_of_node())
    deallocate (aggregates%near_null, aggregates%mode)
    if (allocated(error)) call add_context(error, 'multigrid, aggregates: ')
  end subroutine corners_init_aggregates

  !> x := about K_c^+ x.
  subroutine corners_solve(self, x)
    class(aggregated_corners_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    real(dp), allocatable :: b(:), y(:), rest(:), step(:)
    integer :: k
    allocate (b(self%levels%n), y(self%levels%n))
    call to_unknowns(size(self%equation), self%equation, x, b)
    call self%levels%cycle(b, y)
    if (self%cycles > 1) allocate (rest(self%levels%n), step(self%levels%n))
    do k = 2, self%cycles
      call self%levels%multiply(y, rest)
      rest = b - rest
      call self%levels%cycle(rest, step)
      y = y + step
    end do
    call to_equations(size(self%equation), self%equation, y, x)
  end subroutine corners_solve

  !> Memory of the levels [bytes].
  pure integer(int64) function corners_bytes(self) result(bytes)
    class(aggregated_corners_t), intent(in) :: self
    bytes = self%levels%bytes()
    if (allocated(self%equation)) bytes = bytes + 4*size(self%equation, kind=int64)
  end function corners_bytes

  !> Give back all memory.
  subroutine corners_destroy(self)
    class(aggregated_corners_t), intent(inout) :: self
    call self%levels%destroy()
    if (allocated(self%equation)) deallocate (self%equation)
  end subroutine corners_destroy

  !> Values of equations at their unknowns; zero where held.
  pure subroutine to_unknowns(n, equation, x, y)
    integer, intent(in) :: n  !! Number of unknowns.
    integer, intent(in) :: equation(n)  !! Their equations, 0 or less where held (n).
    real(dp), intent(in) :: x(:)  !! Over the equations (n_equations) [any].
    real(dp), intent(out) :: y(:)  !! Over the unknowns (n) [as x].
    integer :: i
    do i = 1, n
      y(i) = 0
      if (equation(i) > 0) y(i) = x(equation(i))
    end do
  end subroutine to_unknowns

  !> Values of unknowns at their equations.
  pure subroutine to_equations(n, equation, y, x)
    integer, intent(in) :: n  !! Number of unknowns.
    integer, intent(in) :: equation(n)  !! Their equations, 0 or less where held (n).
    real(dp), intent(in) :: y(:)  !! Over the unknowns (n) [any].
    real(dp), intent(inout) :: x(:)  !! Over the equations (n_equations) [as y].
    integer :: i
    do i = 1, n
      if (equation(i) > 0) x(equation(i)) = y(i)
    end do
  end subroutine to_equations
end module dotyk_response_aggregate_space
