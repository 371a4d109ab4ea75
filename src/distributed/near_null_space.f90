!> The near null space of the coarse matrix of distributed bodies: what smoothed aggregation makes its coarse levels of.
module dotyk_distributed_near_null_space
  use petscmat, only: MatNullSpaceCreate, MatNullSpaceDestroy, MatSetNearNullSpace, PETSC_COMM_WORLD, PETSC_DETERMINE, &
    PETSC_FALSE, tMat, tMatNullSpace
  use petscvec, only: tVec, VecAXPY, VecDestroy, VecDot, VecDuplicate, VecGetArrayF90, VecNormalize, VecRestoreArrayF90
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_petsc, only: first_of_rank, has_failed, largest_of_ranks
  use dotyk_elasticity_rigid_body_modes, only: near_null_vectors
  implicit none
  private
  public :: set_near_null_space

contains

  !> Rigid motions as near-null-space vectors of the coarse matrix.
  subroutine set_near_null_space(dim, parts, n_own_corners, coarse, error)
    integer, intent(in) :: dim  !! Number of displacement components.
    type(part_t), intent(in) :: parts(:)  !! Parts of this rank, numbered (n_parts).
    integer, intent(in) :: n_own_corners  !! Own corners.
    type(tMat), intent(in) :: coarse  !! The matrix; gets the vectors [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tMatNullSpace) :: space
    type(tVec), allocatable :: vector(:)
    real(dp), allocatable, target :: value(:, :)
    real(dp), allocatable :: of_part(:, :)
    real(dp) :: box(dim, 2), extent(2*dim), product
    integer :: p, c, j, k, code, first
    first = dim*first_of_rank(n_own_corners)
    extent = -huge(extent)
    do p = 1, size(parts)
      if (size(parts(p)%mesh%x) == 0) cycle
      associate (x => parts(p)%mesh%x)
        extent = max(extent, [-minval(x, 2), maxval(x, 2)])
      end associate
    end do
    call largest_of_ranks(extent)
    box(:, 1) = -extent(:dim)
    box(:, 2) = extent(dim + 1:)
    allocate (value(dim*n_own_corners, merge(6, 3, dim == 3)), source=0.0_dp)
    do p = 1, size(parts)
      associate (part => parts(p))
        call near_null_vectors(part%mesh%x, part%constraint, of_part, box)
        do c = 1, part%space%n
          if (.not. part%is_own(part%space%node(c))) cycle
          j = dim*part%corner_row(c) - first
          k = dim*(part%space%node(c) - 1)
          value(j + 1:j + dim, :) = of_part(k + 1:k + dim, :)
        end do
      end associate
    end do
    allocate (vector(size(value, 2)))
    do j = 1, size(vector)
      call VecCreateMPIWithArray(PETSC_COMM_WORLD, dim, size(value, 1), PETSC_DETERMINE, value(:, j), vector(j), code)
      do k = 1, j - 1
        call VecDot(vector(j), vector(k), product, code)
        call VecAXPY(vector(j), -product, vector(k), code)
      end do
      call VecNormalize(vector(j), product, code)
    end do
    ! It refers to the vectors: they need memory of their own.
    do j = 1, size(vector)
      call own_copy(vector(j))
    end do
    call MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, size(vector), vector, space, code)
    if (has_failed(code, 'near null space', error)) return
    call MatSetNearNullSpace(coarse, space, code)
    call MatNullSpaceDestroy(space, code)
    do j = 1, size(vector)
      call VecDestroy(vector(j), code)
    end do
  end subroutine set_near_null_space

  !> A vector with memory of its own in place of one over an array.
  subroutine own_copy(vector)
    type(tVec), intent(inout) :: vector  !! The vector.
    type(tVec) :: copy
    real(dp), pointer :: from(:), to(:)
    integer :: code
    call VecDuplicate(vector, copy, code)
    call VecGetArrayF90(vector, from, code)
    call VecGetArrayF90(copy, to, code)
    to = from
    call VecRestoreArrayF90(copy, to, code)
    call VecRestoreArrayF90(vector, from, code)
    call VecDestroy(vector, code)
    vector = copy
  end subroutine own_copy
end module dotyk_distributed_near_null_space
