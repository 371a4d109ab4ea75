!> Interpolation P from the coarse level of p-multigrid: from the corners of quadratic elements
!> (`dotyk_elasticity_corner_space`), or from aggregates of the nodes of linear ones.
module dotyk_response_coarse_interpolation
  use dotyk_base_kinds, only: dp, sp
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_corner_space, only: corner_space_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_aggregate_space, only: aggregate_space_t
  implicit none
  private

  type, public :: coarse_interpolation_t  !! The interpolation.
    integer :: n = 0  !! Unknowns of the coarse level.
    type(corner_space_t) :: space  !! Corners.
    type(constraint_t) :: corner_constraint  !! Their equations and nodal axes.
    type(aggregate_space_t) :: aggregates  !! Aggregates; empty where there are corners.
  contains
    procedure :: restrict => interpolation_restrict
    procedure :: prolong => interpolation_prolong
    procedure :: carry_rows => interpolation_carry_rows
  end type coarse_interpolation_t

contains

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
end module dotyk_response_coarse_interpolation
