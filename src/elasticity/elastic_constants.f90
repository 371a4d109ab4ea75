!> Elasticity matrices from the constants of a material at a point, and the check that they are those of a stable one:
!> that the matrix is positive definite. Small and direct, for every integration point.
module dotyk_elasticity_elastic_constants
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: size_rule, smallest_number
  use dotyk_base_options, only: material_isotropic, material_orthotropic
  use dotyk_base_text, only: to_text
  use dotyk_elasticity_material, only: material_formulas_t, material_t
  use dotyk_elasticity_stiffness_tensor, only: kelvin, rotate_stiffness, scale_components, singular_ratio
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private
  public :: elastic_constants

  integer, parameter :: indefinite = -1  !! The whole matrix is not positive definite, by no single constant.

contains

  !> The elasticity of a material with given constants, in global axes.
  subroutine elastic_constants(formulas, value, here, error)
    type(material_formulas_t), intent(in) :: formulas  !! Kind of the material, its axes, names of its constants.
    real(dp), intent(in) :: value(:)  !! The constants, in the order of `formulas` (n_constants) [pressure] or [].
    type(material_t), intent(inout) :: here  !! Stiffness, Lame's parameters, least modulus and bulk modulus are set.
    !> Allocated where the material is not stable; names the constant, or those that do not fit together.
    type(error_t), allocatable, intent(out) :: error
    integer :: fault
    select case (formulas%kind)
    case (material_isotropic)
      call isotropic(value, here, fault)
    case (material_orthotropic)
      call orthotropic(value, here, fault)
    case default
      call anisotropic(value, here, fault)
    end select
    if (fault == 0) then
      if (.not. here%isotropic) here%stiffness = rotate_stiffness(here%stiffness, formulas%axes)
      return
    end if
    !$omp critical (message)
    call describe(formulas, value, fault, error)
    !$omp end critical (message)
  end subroutine elastic_constants

  !> Isotropic: Young's modulus and Poisson's ratio.
  pure subroutine isotropic(value, here, fault)
    real(dp), intent(in) :: value(:)  !! The constants (2).
    type(material_t), intent(inout) :: here  !! Gets the elasticity.
    integer, intent(out) :: fault  !! Index of the constant that is out of its range, else 0.
    integer :: i
    fault = 0
    if (.not. value(1) >= smallest_number) fault = 1
    if (.not. (value(2) > -1 .and. value(2) < 0.5_dp)) fault = 2
    if (fault /= 0) return
    here%isotropic = .true.
    here%least_young = value(1)
    here%lambda = value(1)*value(2)/((1 + value(2))*(1 - 2*value(2)))
    here%mu = value(1)/(2*(1 + value(2)))
    here%bulk = value(1)/(3*(1 - 2*value(2)))
    here%stiffness = 0
    here%stiffness(1:3, 1:3) = here%lambda
    do i = 1, 3
      here%stiffness(i, i) = here%lambda + 2*here%mu
      here%stiffness(i + 3, i + 3) = here%mu
    end do
  end subroutine isotropic

  !> Orthotropic, in the material axes: three Young's moduli, Poisson's ratios 12, 13, 23 and shear moduli.
  pure subroutine orthotropic(value, here, fault)
    real(dp), intent(in) :: value(:)  !! The constants (9).
    type(material_t), intent(inout) :: here  !! Gets the elasticity.
    integer, intent(out) :: fault  !! Index of the constant that is out of its range; or `indefinite`; else 0.
    real(dp) :: root(3), a, b, c, determinant, normal(3, 3)
    integer :: i, k
    integer, parameter :: sized(6) = [1, 2, 3, 7, 8, 9]
    fault = 0
    do k = 1, 6
      if (.not. value(sized(k)) >= smallest_number) fault = sized(k)
    end do
    if (fault /= 0) return
    root = sqrt(value(1:3))
    ! Compliances 12, 13, 23 times the roots of both Young's moduli: those of unit moduli.
    a = -value(4)*root(2)/root(1)
    b = -value(5)*root(3)/root(1)
    c = -value(6)*root(3)/root(2)
    if (.not. abs(c) < 1) fault = 6
    if (.not. abs(b) < 1) fault = 5
    if (.not. abs(a) < 1) fault = 4
    if (fault /= 0) return
    determinant = 1 + 2*a*b*c - a**2 - b**2 - c**2
    if (.not. determinant > singular_ratio) then
      fault = indefinite
      return
    end if
    normal = reshape([1 - c**2, b*c - a, a*c - b, b*c - a, 1 - b**2, a*b - c, a*c - b, a*b - c, 1 - a**2], [3, 3])
    here%isotropic = .false.
    here%stiffness = 0
    do k = 1, 3
      do i = 1, 3
        here%stiffness(i, k) = normal(i, k)*root(i)*root(k)/determinant
      end do
    end do
    here%stiffness(4, 4) = value(9)
    here%stiffness(5, 5) = value(8)
    here%stiffness(6, 6) = value(7)
    here%least_young = minval(value(1:3))
    here%bulk = 1/(sum(1/value(1:3)) + 2*(a/(root(1)*root(2)) + b/(root(1)*root(3)) + c/(root(2)*root(3))))
  end subroutine orthotropic

  !> Anisotropic, in the material axes: the upper triangle of the stiffness by rows.
  pure subroutine anisotropic(value, here, fault)
    real(dp), intent(in) :: value(:)  !! The constants (21) [pressure].
    type(material_t), intent(inout) :: here  !! Gets the elasticity.
    integer, intent(out) :: fault  !! `indefinite`, or 0.
    real(dp) :: factor(6, 6), inverse(6, 6), scale(6), pivot, compliance(3, 3)
    integer :: i, j
    fault = indefinite
    here%isotropic = .false.
    here%stiffness = full_matrix(value)
    do i = 1, 6
      if (.not. here%stiffness(i, i) >= smallest_number) return
      scale(i) = 1/sqrt(here%stiffness(i, i))
    end do
    ! The Cholesky factor of the matrix with unit diagonal, and its inverse.
    factor = scale_components(here%stiffness, scale)
    inverse = 0
    do j = 1, 6
      pivot = factor(j, j) - sum(factor(j, :j - 1)**2)
      if (.not. pivot > singular_ratio) return
      factor(j, j) = sqrt(pivot)
      do i = j + 1, 6
        factor(i, j) = (factor(i, j) - sum(factor(i, :j - 1)*factor(j, :j - 1)))/factor(j, j)
      end do
      inverse(j, j) = 1/factor(j, j)
      do i = 1, j - 1
        inverse(j, i) = -sum(factor(j, i:j - 1)*inverse(i:j - 1, i))/factor(j, j)
      end do
    end do
    do j = 1, 3
      do i = 1, 3
        compliance(i, j) = scale(i)*scale(j)*sum(inverse(:, i)*inverse(:, j))
      end do
    end do
    here%least_young = min(1/compliance(1, 1), 1/compliance(2, 2), 1/compliance(3, 3))
    here%bulk = 1/sum(compliance)
    fault = 0
  end subroutine anisotropic

  !> The 6 by 6 matrix of its upper triangle (6, 6) [pressure].
  pure function full_matrix(upper) result(matrix)
    real(dp), intent(in) :: upper(:)  !! The triangle by rows (21) [pressure].
    real(dp) :: matrix(6, 6)
    integer :: i, j, k
    k = 0
    do i = 1, 6
      do j = i, 6
        k = k + 1
        matrix(i, j) = upper(k)
        matrix(j, i) = upper(k)
      end do
    end do
  end function full_matrix

  !> The message of constants that are not those of a stable material.
  subroutine describe(formulas, value, fault, error)
    type(material_formulas_t), intent(in) :: formulas  !! Names of the constants.
    real(dp), intent(in) :: value(:)  !! The constants (n_constants).
    integer, intent(in) :: fault  !! What is wrong.
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return.
    type(error_t), allocatable :: no_value
    real(dp) :: values(6), vectors(6, 6)
    character(:), allocatable :: text
    if (fault == indefinite .and. formulas%kind == material_orthotropic) then
      text = 'the three poisson ratios, '//to_text(value(4))//', '//to_text(value(5))//' and '//to_text(value(6))// &
             ', do not go together with young '//to_text(value(1))//', '//to_text(value(2))//', '// &
             to_text(value(3))//': the elasticity matrix is not positive definite'
    else if (fault == indefinite) then
      call symmetric_eigen(scale_components(full_matrix(value), kelvin), values, vectors, no_value)
      text = 'the elasticity matrix is not positive definite'
      if (.not. allocated(no_value)) text = text//', its least eigenvalue is '//to_text(values(1))
      text = text//' ('//formulas%constant_name(1)//' = '//to_text(value(1))//')'
    else
      text = formulas%constant_name(fault)//' is '//to_text(value(fault))
      if (formulas%kind == material_isotropic .and. fault == 2) then
        text = text//', but must lie between -1 and 0.5'
      else if (formulas%kind == material_orthotropic .and. fault > 3 .and. fault < 7) then
        text = text//', but must be smaller than the root of the ratio of the two Young''s moduli'
      else if (value(fault) > 0) then
        text = text//'; '//size_rule
      else
        text = text//', but must be positive'
      end if
    end if
    call set_error(error, text, exit_bad_input)
  end subroutine describe
end module dotyk_elasticity_elastic_constants
