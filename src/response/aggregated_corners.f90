!> Approximate inverse of the stiffness of a large corner space, or of many aggregates: cycles of smoothed aggregation
!> in place of a factor.
module dotyk_response_aggregated_corners
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_rigid_body_modes, only: near_null_vectors
  use dotyk_elasticity_two_levels, only: two_levels_t
  use dotyk_linalg_smoothed_aggregation, only: smoothed_aggregation_t
  use dotyk_response_aggregate_space, only: aggregate_space_t
  use dotyk_response_free_unknowns, only: to_equations, to_unknowns
  implicit none
  private

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

contains

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
end module dotyk_response_aggregated_corners
