!> Linear elastic materials: isotropic, orthotropic with axes of its own, fully anisotropic.
!>
!> A stiffness matrix maps the strains xx yy zz yz xz xy (engineering shear) to the stresses in the same order. A
!> material owns no resource: copies are independent. The factor on the stiffness that depends on the place is kept
!> as text, for a formula serves one thread at a time and each body makes its own.
module dotyk_elasticity_material
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_base_text, only: quoted, to_text
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private

  !> A material.
  type, public :: material_t
    !> Its name in the input.
    character(:), allocatable :: name
    !> Whether `lambda` and `mu` say everything.
    logical :: isotropic = .false.
    !> Lame's constants of an isotropic material [pressure].
    real(dp) :: lambda = 0, mu = 0
    !> Stiffness in global axes (6, 6) [pressure].
    real(dp) :: stiffness(6, 6) = 0
    !> Formula of a factor on the stiffness in x, y, z; not allocated: 1 everywhere.
    character(:), allocatable :: modulus_formula
    !> Young's modulus of the softest of its axes, whichever way they point: of axes 1, 2, 3 where it is orthotropic, the least 1/S_ii,
    !> i = 1..3, of the compliance S where the stiffness was given [pressure].
    real(dp) :: least_young = 0
    !> Bulk over shear modulus, and the bulk modulus, where the dilatation may be projected; 0 where it is not to be, see
    !> `project_dilatation` [1], [pressure].
    real(dp) :: incompressibility = 0, bulk = 0
  contains
    procedure :: init_isotropic => material_init_isotropic
    procedure :: init_orthotropic => material_init_orthotropic
    procedure :: init_anisotropic => material_init_anisotropic
    procedure :: plane_matrix => material_plane_matrix
    procedure :: has_modulus_field => material_has_modulus_field
    procedure :: bulk_modulus => material_bulk_modulus
    procedure :: bulk_over_shear => material_bulk_over_shear
    procedure :: project_dilatation => material_project_dilatation
    procedure :: split => material_split
  end type material_t

  public :: rotate_stiffness

  !> Weights of a strain in Kelvin's notation, in which eigenvalues are those of the tensor.
  real(dp), parameter :: kelvin(6) = [1.0_dp, 1.0_dp, 1.0_dp, sqrt(2.0_dp), sqrt(2.0_dp), sqrt(2.0_dp)]
  !> The two tensor indices of each of the six components.
  integer, parameter :: first_index(6) = [1, 2, 3, 2, 1, 1], second_index(6) = [1, 2, 3, 3, 3, 2]
  !> A ratio of eigenvalues below this counts as singular.
  real(dp), parameter :: least_ratio = 1.0e-13_dp

contains

  !> An isotropic material.
  subroutine material_init_isotropic(self, name, young, poisson, error)
    class(material_t), intent(out) :: self
    !> Its name in the input.
    character(*), intent(in) :: name
    !> Young's modulus, > 0 [pressure].
    real(dp), intent(in) :: young
    !> Poisson's ratio, between -1 and 0.5.
    real(dp), intent(in) :: poisson
    !> Allocated where the numbers are out of range.
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    self%name = name
    self%isotropic = .true.
    if (.not. (young > 0 .and. young <= huge(young))) then
      call set_error(error, 'material '//quoted(name)//': young must be positive, not '//to_text(young), exit_bad_input)
      return
    end if
    if (.not. (poisson > -1 .and. poisson < 0.5_dp)) then
      call set_error(error, 'material '//quoted(name)//': poisson must lie between -1 and 0.5, not '// &
        to_text(poisson), exit_bad_input)
      return
    end if
    self%least_young = young
    self%lambda = young*poisson/((1 + poisson)*(1 - 2*poisson))
    self%mu = young/(2*(1 + poisson))
    self%stiffness(1:3, 1:3) = self%lambda
    do i = 1, 3
      self%stiffness(i, i) = self%lambda + 2*self%mu
      self%stiffness(i + 3, i + 3) = self%mu
    end do
  end subroutine material_init_isotropic

  !> An orthotropic material.
  subroutine material_init_orthotropic(self, name, young, poisson, shear, axis_1, axis_2, error)
    class(material_t), intent(out) :: self
    !> Its name in the input.
    character(*), intent(in) :: name
    !> Young's moduli along the material's axes 1, 2, 3 [pressure].
    real(dp), intent(in) :: young(3)
    !> Poisson's ratios 12, 13, 23: ij is minus the strain along j per strain along i under tension along i.
    real(dp), intent(in) :: poisson(3)
    !> Shear moduli 12, 13, 23 [pressure].
    real(dp), intent(in) :: shear(3)
    !> Direction of axis 1, of any length.
    real(dp), intent(in) :: axis_1(3)
    !> A direction in the plane of axes 1 and 2; its part along axis 1 does not count.
    real(dp), intent(in) :: axis_2(3)
    !> Allocated where the numbers are out of range or the stiffness is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: compliance(6, 6), axes(3, 3), stiffness(6, 6)
    integer :: i
    self%name = name
    if (.not. (all(young > 0) .and. all(shear > 0) .and. all(young <= huge(1.0_dp)) &
      .and. all(shear <= huge(1.0_dp)))) then
      call set_error(error, 'material '//quoted(name)//': all values of young and shear must be positive', &
        exit_bad_input)
      return
    end if
    call make_axes(axis_1, axis_2, axes, error)
    if (allocated(error)) then
      call add_context(error, 'material '//quoted(name)//': ')
      return
    end if
    compliance = 0
    do i = 1, 3
      compliance(i, i) = 1/young(i)
    end do
    compliance(1, 2) = -poisson(1)/young(1)
    compliance(1, 3) = -poisson(2)/young(1)
    compliance(2, 3) = -poisson(3)/young(2)
    compliance(2, 1) = compliance(1, 2)
    compliance(3, 1) = compliance(1, 3)
    compliance(3, 2) = compliance(2, 3)
    compliance(4, 4) = 1/shear(3)
    compliance(5, 5) = 1/shear(2)
    compliance(6, 6) = 1/shear(1)
    call invert(compliance, 1/kelvin, stiffness, error)
    if (allocated(error)) then
      call add_context(error, 'material '//quoted(name)//': ')
      return
    end if
    self%stiffness = rotate_stiffness(stiffness, axes)
    self%least_young = minval(young)
  end subroutine material_init_orthotropic

  !> A fully anisotropic material.
  subroutine material_init_anisotropic(self, name, upper, error)
    class(material_t), intent(out) :: self
    !> Its name in the input.
    character(*), intent(in) :: name
    !> Upper triangle of the stiffness by rows, order xx yy zz yz xz xy (21) [pressure].
    real(dp), intent(in) :: upper(21)
    !> Allocated where the stiffness is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: values(6), vectors(6, 6), compliance(6, 6)
    integer :: i, j, k
    self%name = name
    k = 0
    do i = 1, 6
      do j = i, 6
        k = k + 1
        self%stiffness(i, j) = upper(k)
        self%stiffness(j, i) = upper(k)
      end do
    end do
    if (.not. all(abs(upper) <= huge(1.0_dp))) then
      call set_error(error, 'material '//quoted(name)//': all values of stiffness must be finite numbers', &
        exit_bad_input)
      return
    end if
    call symmetric_eigen(scaled(self%stiffness, kelvin), values, vectors, error)
    if (allocated(error)) return
    if (.not. minval(values) > least_ratio*maxval(abs(values))) then
      call refuse(name, minval(values), error)
      return
    end if
    call invert(self%stiffness, kelvin, compliance, error)
    if (.not. allocated(error)) self%least_young = min(1/compliance(1, 1), 1/compliance(2, 2), 1/compliance(3, 3))
  end subroutine material_init_anisotropic

  !> The error of a stiffness that is not positive definite.
  subroutine refuse(name, eigenvalue, error)
    !> Name of the material.
    character(*), intent(in) :: name
    !> Least eigenvalue of its stiffness.
    real(dp), intent(in) :: eigenvalue
    !> Allocated on return.
    type(error_t), allocatable, intent(out) :: error
    call set_error(error, 'material '//quoted(name)//': the stiffness is not positive definite, '// &
      'its least eigenvalue is '//to_text(eigenvalue), exit_bad_input)
  end subroutine refuse

  !> An orthonormal right-handed set of axes from two directions.
  subroutine make_axes(axis_1, axis_2, axes, error)
    real(dp), intent(in) :: axis_1(3), axis_2(3)
    !> Unit vectors along axes 1, 2, 3, as columns.
    real(dp), intent(out) :: axes(3, 3)
    !> Allocated where the directions are zero or parallel.
    type(error_t), allocatable, intent(out) :: error
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
    if (.not. norm2(rest) > 1.0e-6_dp) then
      call set_error(error, 'axis_1 and axis_2 must not be parallel', exit_bad_input)
      return
    end if
    axes(:, 2) = rest/norm2(rest)
    axes(:, 3) = [axes(2, 1)*axes(3, 2) - axes(3, 1)*axes(2, 2), axes(3, 1)*axes(1, 2) - axes(1, 1)*axes(3, 2), &
      axes(1, 1)*axes(2, 2) - axes(2, 1)*axes(1, 2)]
  end subroutine make_axes

  !> A 6 by 6 matrix with rows and columns multiplied by weights.
  pure function scaled(matrix, weight) result(product)
    real(dp), intent(in) :: matrix(6, 6), weight(6)
    real(dp) :: product(6, 6)
    integer :: i, j
    do j = 1, 6
      do i = 1, 6
        product(i, j) = weight(i)*weight(j)*matrix(i, j)
      end do
    end do
  end function scaled

  !> Inverse of a positive definite matrix of material constants; the error quotes the least eigenvalue of the inverse.
  subroutine invert(matrix, weight, inverse, error)
    !> Compliance or stiffness (6, 6).
    real(dp), intent(in) :: matrix(6, 6)
    !> Weights that bring it to Kelvin's notation: `kelvin` for a stiffness, its reciprocal for a compliance.
    real(dp), intent(in) :: weight(6)
    !> The inverse (6, 6).
    real(dp), intent(out) :: inverse(6, 6)
    !> Allocated where the matrix is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: values(6), vectors(6, 6)
    integer :: i, j
    inverse = 0
    call symmetric_eigen(scaled(matrix, weight), values, vectors, error)
    if (allocated(error)) return
    i = minloc(values, 1)
    if (.not. values(i) > least_ratio*maxval(abs(values))) then
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
  end subroutine invert

  !> A stiffness given in axes of its own, in global axes.
  pure function rotate_stiffness(stiffness, axes) result(rotated)
    !> Stiffness in its own axes (6, 6) [pressure].
    real(dp), intent(in) :: stiffness(6, 6)
    !> These axes as columns, orthonormal (3, 3).
    real(dp), intent(in) :: axes(3, 3)
    !> Stiffness in global axes (6, 6) [pressure].
    real(dp) :: rotated(6, 6)
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
    rotated = matmul(bond, matmul(stiffness, transpose(bond)))
    rotated = 0.5_dp*(rotated + transpose(rotated))
  end function rotate_stiffness

  !> The matrix that maps the strains of an analysis to its stresses (6, 6) [pressure].
  !>
  !> It is the stiffness itself, but for plane stress, where the strains zz, yz, xz follow from the stresses zz, yz,
  !> xz being zero.
  pure function material_plane_matrix(self, analysis) result(matrix)
    class(material_t), intent(in) :: self
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    real(dp) :: matrix(6, 6)
    integer, parameter :: out_of_plane(3) = [3, 4, 5]
    integer :: k, s, i, j
    matrix = self%stiffness
    if (analysis /= analysis_plane_stress) return
    ! Eliminates one strain after the other: a Schur complement of a positive definite matrix.
    do k = 1, 3
      s = out_of_plane(k)
      do j = 1, 6
        if (j == s) cycle
        do i = 1, 6
          if (i /= s) matrix(i, j) = matrix(i, j) - matrix(i, s)*matrix(s, j)/matrix(s, s)
        end do
      end do
      matrix(s, :) = 0
      matrix(:, s) = 0
    end do
  end function material_plane_matrix

  !> Bulk modulus: pressure over dilatation under the same pressure from all sides [pressure].
  real(dp) function material_bulk_modulus(self) result(bulk)
    class(material_t), intent(in) :: self
    type(error_t), allocatable :: error
    real(dp) :: compliance(6, 6)
    if (self%isotropic) then
      bulk = self%lambda + 2*self%mu/3
    else
      call invert(self%stiffness, kelvin, compliance, error)
      bulk = 0
      if (.not. allocated(error)) bulk = 1/sum(compliance(1:3, 1:3))
    end if
  end function material_bulk_modulus

  !> Bulk over shear modulus: how near to incompressible the material is.
  !>
  !> The shear modulus of an anisotropic material is half the third of the five stiffnesses against changes of shape: layers that slide
  !> do not make it incompressible, nor fibres compressible.
  real(dp) function material_bulk_over_shear(self) result(ratio)
    class(material_t), intent(in) :: self
    type(error_t), allocatable :: error
    real(dp) :: deviator(6, 6), values(6), vectors(6, 6)
    integer :: i
    if (self%isotropic) then
      ratio = self%bulk_modulus()/self%mu
      return
    end if
    deviator = 0
    do i = 1, 6
      deviator(i, i) = 1
    end do
    deviator(1:3, 1:3) = deviator(1:3, 1:3) - 1.0_dp/3
    ! Dilatation is no change of shape: its eigenvalue is 0, below all others.
    call symmetric_eigen(matmul(deviator, matmul(scaled(self%stiffness, kelvin), deviator)), values, vectors, error)
    ratio = 0
    if (.not. allocated(error)) ratio = 2*self%bulk_modulus()/values(4)
  end function material_bulk_over_shear

  !> Let the dilatation be projected where it is nearly incompressible.
  subroutine material_project_dilatation(self)
    class(material_t), intent(inout) :: self
    self%incompressibility = self%bulk_over_shear()
    self%bulk = self%bulk_modulus()
  end subroutine material_project_dilatation

  !> The material in an analysis in two parts: the first goes with the strains, the second with the projected dilatation alone.
  subroutine material_split(self, analysis, kept, matrix, lambda, bulk)
    class(material_t), intent(in) :: self
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    !> How much bulk over shear modulus the first part keeps; the second one is what is beyond that.
    real(dp), intent(in) :: kept
    !> From strains to stresses, without the second part (6, 6) [pressure].
    real(dp), intent(out) :: matrix(6, 6)
    !> Lame's constant of an isotropic material, without the second part [pressure].
    real(dp), intent(out) :: lambda
    !> Bulk modulus of the second part; 0 for none, as always in plane stress, which lets the volume change [pressure].
    real(dp), intent(out) :: bulk
    integer :: i
    matrix = self%plane_matrix(analysis)
    lambda = self%lambda
    bulk = 0
    if (.not. self%incompressibility > kept .or. analysis == analysis_plane_stress) return
    bulk = (1 - kept/self%incompressibility)*self%bulk
    if (self%isotropic) then
      lambda = (kept - 2.0_dp/3)*self%mu
      matrix(1:3, 1:3) = lambda
      do i = 1, 3
        matrix(i, i) = lambda + 2*self%mu
      end do
    else
      matrix(1:3, 1:3) = matrix(1:3, 1:3) - bulk
    end if
  end subroutine material_split

  !> Whether the stiffness depends on the place.
  pure logical function material_has_modulus_field(self) result(has)
    class(material_t), intent(in) :: self
    has = allocated(self%modulus_formula)
    if (has) has = len_trim(self%modulus_formula) > 0
  end function material_has_modulus_field
end module dotyk_elasticity_material
