!> Unknowns without a stiffness in the systems of p-multigrid: the motions of a rigid body, or the shortening of a bolt.
!>
!> They are a body whose stiffness is zero, and whose rigid body modes are its unknowns: contact and ties resist them.
!> Its corner space is the same, so that ties hold it in the factor of their group; the smoother leaves it alone.
module dotyk_scheme_motion_grid
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_response_body_grid, only: body_grid_t
  implicit none
  private

  type, extends(body_grid_t), public :: motion_grid_t  !! The unknowns.
    type(sparse_symmetric_t), private :: nothing  !! The stiffness: zeros.
    real(dp), allocatable, private :: unit(:, :)  !! The unknowns as null vectors of it (n_motions, n_motions) [].
  contains
    procedure :: init => motion_init
    procedure :: multiply => motion_multiply
    procedure :: precondition => motion_precondition
    procedure :: solve_coarse => motion_solve_coarse
    procedure :: corner_entries => motion_corner_entries
    procedure :: prepare_rows => motion_prepare_rows
    procedure :: form_row_compliance => motion_form_row_compliance
    procedure :: get_corner_matrix => motion_get_corner_matrix
    procedure :: destroy => motion_destroy
  end type motion_grid_t

contains

  !> Make some unknowns.
  subroutine motion_init(self, dim, n)
    class(motion_grid_t), intent(inout) :: self
    integer, intent(in) :: dim  !! Components of a node of the other bodies: unknowns come by nodes.
    integer, intent(in) :: n  !! Number of unknowns.
    integer :: i, n_nodes
    n_nodes = (n + dim - 1)/dim
    self%n = dim*n_nodes
    call self%constraint%init(dim, n_nodes)
    self%constraint%equation = reshape([(merge(i, 0, i <= n), i=1, self%n)], [dim, n_nodes])
    self%constraint%n_equations = n
    self%interpolation%n = n
    call self%interpolation%space%init_all_nodes([(i, i=1, n_nodes)])
    self%interpolation%corner_constraint = self%constraint
    call self%fine%rows%init(dim, [(1_int64, i=1, n_nodes + 1)], [integer ::], 1.0_dp)
    call self%fine%rows%pack()
    allocate (self%fine%inverse(dim, dim, n_nodes), source=0.0)
    self%fine%greatest = 1
    allocate (self%mode(self%n, n), self%unit(n, n), source=0.0_dp)
    do i = 1, n
      self%mode(i, i) = 1
      self%unit(i, i) = 1
    end do
    self%nothing%n = n
    self%nothing%column_start = [(int(i, int64), i=0, n)]
    self%nothing%row = [(int(i, int64), i=0, n - 1)]
    allocate (self%nothing%value(n), source=0.0_dp)
    self%is_sure = .true.
  end subroutine motion_init

  !> y = 0.
  subroutine motion_multiply(self, x, y)
    class(motion_grid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Displacements (n) [length].
    real(dp), intent(out), contiguous :: y(:)  !! Forces (n) [force].
    y = 0
    associate (not_needed => [self%n, size(x)])
    end associate
  end subroutine motion_multiply

  !> z = 0: nothing but motions is left of forces without resultants on them.
  subroutine motion_precondition(self, r, z)
    class(motion_grid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! Forces (n) [force].
    real(dp), intent(out), contiguous :: z(:)  !! Displacements (n) [length].
    z = 0
    associate (not_needed => [self%n, size(r)])
    end associate
  end subroutine motion_precondition

  !> x := 0.
  subroutine motion_solve_coarse(self, x)
    class(motion_grid_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Forces in [force], displacements out [length] (interpolation%n).
    x = 0
    associate (not_needed => self%n)
    end associate
  end subroutine motion_solve_coarse

  !> A solve costs nothing.
  pure real(dp) function motion_corner_entries(self) result(entries)
    class(motion_grid_t), intent(in) :: self
    entries = self%interpolation%n
  end function motion_corner_entries

  !> There is nothing to prepare.
  subroutine motion_prepare_rows(self)
    class(motion_grid_t), intent(inout) :: self
    associate (not_needed => self%n)
    end associate
  end subroutine motion_prepare_rows

  !> Rows do not yield but by the motions.
  subroutine motion_form_row_compliance(self, rows, value)
    class(motion_grid_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows  !! The rows over the motions.
    real(dp), allocatable, intent(out) :: value(:, :)  !! Zero (n, n) [length/force].
    allocate (value(rows%n_rows, rows%n_rows), source=0.0_dp)
    associate (not_needed => self%n)
    end associate
  end subroutine motion_form_row_compliance

  !> Zeros, and the motions.
  subroutine motion_get_corner_matrix(self, matrix, mode)
    class(motion_grid_t), target, intent(in) :: self
    type(sparse_symmetric_t), pointer, intent(out) :: matrix  !! (n_motions, n_motions) [force/length]
    real(dp), pointer, intent(out) :: mode(:, :)  !! (n_motions, n_motions) []
    matrix => self%nothing
    mode => self%unit
  end subroutine motion_get_corner_matrix

  !> Give back all memory.
  subroutine motion_destroy(self)
    class(motion_grid_t), intent(inout) :: self
    call self%fine%destroy()
    call self%nothing%destroy()
    self%n = 0
  end subroutine motion_destroy
end module dotyk_scheme_motion_grid
