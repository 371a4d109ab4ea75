!> Stiffness tensors as 6 by 6 matrices, stresses and strains as 6 components: material axes, rotation, inverse,
!> Kelvin's notation.
module dotyk_elasticity_stiffness_tensor
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: given_rounding, same_place
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private
  public :: invert_stiffness, material_axes, rotate_stiffness, rotate_strain, rotate_stress, scale_components

  !> Square roots of the multiplicities of the strain components in the tensor (Kelvin's notation), with which the
  !> eigenvalues of the 6 by 6 matrix are those of the tensor (6) [].
  real(dp), parameter, public :: kelvin(6) = [1.0_dp, 1.0_dp, 1.0_dp, sqrt(2.0_dp), sqrt(2.0_dp), sqrt(2.0_dp)]
  !> The two tensor indices of each of the six components (6).
  integer, parameter :: first_index(6) = [1, 2, 3, 2, 1, 1], second_index(6) = [1, 2, 3, 3, 3, 2]

contains

  !> Orthonormal right-handed axes from two directions.
  subroutine material_axes(axis_1, axis_2, axes, error)
    real(dp), intent(in) :: axis_1(3)  !! Direction of axis 1, of any length (3) [any].
    real(dp), intent(in) :: axis_2(3)  !! A direction in the plane of axes 1 and 2 (3) [any].
    real(dp), intent(out) :: axes(3, 3)  !! Unit vectors along axes 1, 2, 3, as columns (3, 3) [].
    type(error_t), allocatable, intent(out) :: error  !! Where a direction is zero, or where both are parallel.
    real(dp) :: length_1, length_2, rest(3)
    axes = 0
    length_1 = norm2(axis_1)
    length_2 = norm2(axis_2)
    if (.not. (length_1 > 0 .and. length_2 > 0)) then
      call set_error(error, 'axis_1 and axis_2 must not be zero', exit_bad_input)
      return
    end if
    axes(:, 1) = axis_1/length_1
    rest = axis_2/length_2
    rest = rest - dot_product(rest, axes(:, 1))*axes(:, 1)
    if (.not. norm2(rest) > same_place) then
      call set_error(error, 'axis_1 and axis_2 must not be parallel', exit_bad_input)
      return
    end if
    axes(:, 2) = rest/norm2(rest)
    axes(:, 3) = [axes(2, 1)*axes(3, 2) - axes(3, 1)*axes(2, 2), axes(3, 1)*axes(1, 2) - axes(1, 1)*axes(3, 2), &
                  axes(1, 1)*axes(2, 2) - axes(2, 1)*axes(1, 2)]
  end subroutine material_axes

  !> A 6 by 6 matrix with rows and columns multiplied by weights (6, 6) [any].
  pure function scale_components(matrix, weight) result(product)
    real(dp), intent(in) :: matrix(6, 6)  !! The matrix (6, 6) [any].
    real(dp), intent(in) :: weight(6)  !! Weight of each row and column (6) [].
    real(dp) :: product(6, 6)
    integer :: i, j
    do j = 1, 6
      do i = 1, 6
        product(i, j) = weight(i)*weight(j)*matrix(i, j)
      end do
    end do
  end function scale_components

  !> Inverse of a positive definite stiffness or compliance.
  subroutine invert_stiffness(matrix, weight, inverse, error)
    real(dp), intent(in) :: matrix(6, 6)  !! Stiffness (6, 6) [pressure] or compliance [1/pressure].
    real(dp), intent(in) :: weight(6)  !! Kelvin's weights: `kelvin` for a stiffness, 1/`kelvin` for a compliance [].
    real(dp), intent(out) :: inverse(6, 6)  !! The inverse (6, 6) [1/pressure] or [pressure].
    !> Allocated where the matrix is not positive definite; names the least eigenvalue of the inverse, a stiffness.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: values(6), vectors(6, 6)
    integer :: i, j
    inverse = 0
    call symmetric_eigen(scale_components(matrix, weight), values, vectors, error)
    if (allocated(error)) return
    i = minloc(values, 1)
    if (.not. values(i) > given_rounding*maxval(abs(values))) then
      if (values(i) < 0) then
        ! The inverse's most negative eigenvalue comes from the negative one nearest to zero.
        call set_error(error, 'the stiffness is not positive definite, its least eigenvalue is '// &
                       to_text(1/maxval(values, mask=values < 0)), exit_bad_input)
      else
        call set_error(error, 'the stiffness is not positive definite, it has an infinite eigenvalue', exit_bad_input)
      end if
      return
    end if
    do j = 1, 6
      do i = 1, 6
        inverse(i, j) = weight(i)*weight(j)*sum(vectors(i, :)*vectors(j, :)/values)
      end do
    end do
    inverse = 0.5_dp*(inverse + transpose(inverse))
  end subroutine invert_stiffness

  !> Transform a stiffness from its own axes to global axes (Bond's transformation).
  pure function rotate_stiffness(stiffness, axes) result(rotated)
    real(dp), intent(in) :: stiffness(6, 6)  !! Stiffness in its own axes (6, 6) [pressure].
    real(dp), intent(in) :: axes(3, 3)  !! These axes as columns, orthonormal (3, 3) [].
    real(dp) :: rotated(6, 6)  !! Stiffness in global axes (6, 6) [pressure].
    real(dp) :: bond(6, 6)
    bond = bond_matrix(axes)
    rotated = matmul(bond, matmul(stiffness, transpose(bond)))
    rotated = 0.5_dp*(rotated + transpose(rotated))
  end function rotate_stiffness

  !> Transform a stress from its own axes to global axes.
  pure function rotate_stress(stress, axes) result(rotated)
    real(dp), intent(in) :: stress(6)  !! Stress in its own axes, order xx yy zz yz xz xy (6) [pressure].
    real(dp), intent(in) :: axes(3, 3)  !! These axes as columns, orthonormal (3, 3) [].
    real(dp) :: rotated(6)  !! Stress in global axes (6) [pressure].
    real(dp) :: bond(6, 6)
    bond = bond_matrix(axes)
    rotated = matmul(bond, stress)
  end function rotate_stress

  !> Transform a strain from its own axes to global axes; the work of stress on strain stays the same.
  pure function rotate_strain(strain, axes) result(rotated)
    real(dp), intent(in) :: strain(6)  !! Strain in its own axes, order xx yy zz yz xz xy, engineering shear (6) [any].
    real(dp), intent(in) :: axes(3, 3)  !! These axes as columns, orthonormal (3, 3) [].
    real(dp) :: rotated(6)  !! Strain in global axes (6) [any].
    real(dp) :: bond(6, 6)
    bond = bond_matrix(transpose(axes))
    rotated = matmul(transpose(bond), strain)
  end function rotate_strain

  !> Bond's matrix, which transforms the six components of a stress from its own axes to global axes (6, 6) [].
  pure function bond_matrix(axes) result(bond)
    real(dp), intent(in) :: axes(3, 3)  !! These axes as columns, orthonormal (3, 3) [].
    real(dp) :: bond(6, 6)
    integer :: row, column, i, j, a, b
    do column = 1, 6
      a = first_index(column)
      b = second_index(column)
      do row = 1, 6
        i = first_index(row)
        j = second_index(row)
        bond(row, column) = axes(i, a)*axes(j, b)
        if (a /= b) bond(row, column) = bond(row, column) + axes(i, b)*axes(j, a)
      end do
    end do
  end function bond_matrix
end module dotyk_elasticity_stiffness_tensor
