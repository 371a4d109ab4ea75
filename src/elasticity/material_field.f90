!> Material field: a material at the points of a body, where a modulus factor (`young_formula` in the input) or
!> constants by formulas make it vary in space.
!>
!> With constants by formulas the stiffness at a point is written as a factor times a matrix, the factor being the least
!> Young's modulus there over that of the material: so the factor has one meaning for all materials.
!> Formulas are parsed here, because a formula serves one thread: no two threads share a field.
module dotyk_elasticity_material_field
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: size_rule, smallest_number
  use dotyk_base_options, only: material_isotropic, material_orthotropic
  use dotyk_base_text, only: point_text, quoted, text_t, to_text
  use dotyk_base_thresholds, only: given_rounding
  use dotyk_elasticity_material, only: material_formulas_t, material_t
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_elasticity_stiffness_tensor, only: kelvin, rotate_stiffness, rotate_strain, scale_components
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private

  type, public :: point_constants_t  !! The constants of a material at a point.
    real(dp) :: factor = 1  !! Factor on the stiffness, see above [].
    real(dp) :: matrix(6, 6) = 0  !! From strains to stresses, without projected part, by the factor (6, 6) [pressure].
    real(dp) :: bulk = 0  !! Projected part of the bulk modulus, by the factor; 0: none [pressure].
    real(dp) :: expansion(6) = 0  !! Thermal expansion, as a strain: order xx yy zz yz xz xy (6) [1/temperature].
  end type point_constants_t

  type, public :: material_field_t  !! A material in space. It owns formulas: never copy it, and destroy it in the end.
    logical :: constant = .true.  !! Whether the material is the same everywhere.
    logical :: varies = .false.  !! Whether more varies than a factor: the matrix, or the expansion.
    type(vector_field_t) :: factor  !! The modulus factor, in the first component.
    type(material_t), private :: material  !! The material.
    type(vector_field_t), allocatable, private :: elastic(:)  !! By formulas, three in each; none where not allocated.
    type(vector_field_t), private :: expansion  !! Thermal expansion along the material axes, where it has formulas.
  contains
    procedure :: init => material_field_init
    procedure :: at => material_field_at
    procedure :: factor_at => material_field_factor_at
    procedure :: whole_at => material_field_whole_at
    procedure :: apply => material_field_apply
    procedure :: destroy => material_field_destroy
  end type material_field_t

  integer, parameter :: indefinite = -1  !! The whole matrix is not positive definite, by no single constant.

contains

  !> Parse the formulas of a material.
  subroutine material_field_init(self, material, error)
    class(material_field_t), intent(inout) :: self
    type(material_t), intent(in) :: material  !! The material.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula does not parse.
    type(text_t), allocatable :: text(:)
    integer :: first, i, k, n
    call self%destroy()
    call read_modulus_field(material, self%factor, error)
    if (allocated(error)) return
    self%constant = self%factor%constant
    self%varies = material%formulas%vary()
    if (.not. self%varies) return
    self%constant = .false.
    self%material = material
    if (allocated(material%formulas%stiffness)) then
      n = size(material%formulas%stiffness)
      allocate (self%elastic((n + 2)/3), text(3))
      do i = 1, size(self%elastic)
        first = 3*i - 2
        do k = 1, 3
          text(k)%s = ''
          if (first + k - 1 <= n) text(k)%s = material%formulas%stiffness(first + k - 1)%s
        end do
        call self%elastic(i)%init(material%formulas%constant(first:first + 2), error, text)
        if (allocated(error)) exit
      end do
    end if
    if (.not. allocated(error) .and. allocated(material%formulas%expansion)) &
      call self%expansion%init([0.0_dp, 0.0_dp, 0.0_dp], error, material%formulas%expansion)
    if (allocated(error)) call self%destroy()
  end subroutine material_field_init

  !> The material at a point, where more than a factor varies, in global axes, without the modulus factor.
  subroutine material_field_whole_at(self, x, here, error)
    class(material_field_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! The point (dim) [length].
    !> Its stiffness, moduli and expansion are set; the ratio of bulk to shear modulus is not.
    type(material_t), intent(inout) :: here
    !> Allocated where a formula has no value, or the material is not stable; names the material and the point.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: value(21)
    integer :: i
    if (allocated(self%elastic)) then
      do i = 1, size(self%elastic)
        call self%elastic(i)%evaluate(x, value(3*i - 2:3*i), error)
        if (allocated(error)) exit
      end do
      if (allocated(error)) then
        call locate('the constants by formulas: ', .false.)
        return
      end if
      i = size(self%material%formulas%stiffness)
      call elastic_constants(self%material%formulas, value(:i), here, error)
      if (allocated(error)) then
        call locate('', .true.)
        return
      end if
    else
      here%isotropic = self%material%isotropic
      here%lambda = self%material%lambda
      here%mu = self%material%mu
      here%bulk = self%material%bulk
      here%stiffness = self%material%stiffness
      here%least_young = self%material%least_young
    end if
    here%expansion = self%material%expansion
    if (.not. allocated(self%material%formulas%expansion)) return
    call self%expansion%evaluate(x, value(:3), error)
    if (allocated(error)) then
      call locate('expansion_formula: ', .false.)
      return
    end if
    here%expansion = 0
    here%expansion(:3) = value(1)
    if (size(self%material%formulas%expansion) == 1) return
    here%expansion(:3) = value(:3)
    here%expansion = rotate_strain(here%expansion, self%material%formulas%axes)

  contains

    !> Add the material, and maybe the point, to the message.
    subroutine locate(what, with_point)
      character(*), intent(in) :: what  !! What has the formula.
      logical, intent(in) :: with_point  !! Whether the message does not name the point.
      !$omp critical (message)
      if (with_point) error%message = error%message//' at '//point_text(x)
      call add_context(error, 'material '//quoted(self%material%name)//': '//what)
      !$omp end critical (message)
    end subroutine locate
  end subroutine material_field_whole_at

  !> The constants at a point, where more than a factor varies.
  subroutine material_field_at(self, analysis, x, here, error, kind)
    class(material_field_t), intent(in) :: self
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: x(:)  !! The point (dim) [length].
    type(point_constants_t), intent(out) :: here  !! The constants.
    type(error_t), allocatable, intent(out) :: error  !! Where a formula has no value, or the material is not stable.
    integer, intent(in), optional :: kind  !! Element kind whose part of the dilatation is projected; none if absent.
    type(material_t) :: material
    real(dp) :: kept, lambda, value(3)
    call self%whole_at(x, material, error)
    if (allocated(error)) return
    kept = huge(kept)
    if (present(kind)) then
      ! Where nothing of the worst point is projected, nothing is, also at points that are no integration points.
      associate (worst => self%material%incompressibility)
        if (worst > unprojected_bulk_ratio(kind, worst)) then
          material%incompressibility = material%bulk_over_shear()
          kept = unprojected_bulk_ratio(kind, material%incompressibility)
        end if
      end associate
    end if
    call material%split(analysis, kept, here%matrix, lambda, here%bulk)
    here%expansion = material%expansion
    here%factor = material%least_young/self%material%least_young
    here%matrix = here%matrix/here%factor
    here%bulk = here%bulk/here%factor
    if (self%factor%constant) return
    call self%factor%evaluate(x, value, error)
    if (allocated(error)) then
      call add_context(error, 'young_formula: ')
    else if (.not. value(1) > 0) then
      !$omp critical (message)
      call set_error(error, 'young_formula: the modulus factor must be positive, it is '//to_text(value(1))//' at '// &
                     point_text(x), exit_bad_input)
      !$omp end critical (message)
    end if
    here%factor = value(1)*here%factor
  end subroutine material_field_at

  !> The factor at a point; positive.
  subroutine material_field_factor_at(self, x, factor, error)
    class(material_field_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! The point (dim) [length].
    real(dp), intent(out) :: factor  !! The factor [].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the field has no value.
    type(material_t) :: here
    real(dp) :: value(3)
    factor = 1
    if (self%varies) then
      call self%whole_at(x, here, error)
      if (allocated(error)) return
      factor = here%least_young/self%material%least_young
    end if
    if (self%factor%constant) return
    call self%factor%evaluate(x, value, error)
    if (.not. allocated(error)) factor = factor*max(value(1), tiny(factor))
  end subroutine material_field_factor_at

  !> Multiply the quadrature weights of an element by the factor, and evaluate what else varies.
  subroutine material_field_apply(self, analysis, kind, shape, x, tag, w, error, matrix, bulk, expansion)
    class(material_field_t), intent(in) :: self
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    integer, intent(in) :: kind  !! Element kind: one of the `element_*` constants.
    real(dp), intent(in) :: shape(:, :)  !! Shape functions at the points (n_nodes, n_points) [].
    real(dp), intent(in) :: x(:, :)  !! Nodes of the element (dim, n_nodes) [length].
    integer(int64), intent(in) :: tag  !! Tag of the element, for messages.
    real(dp), intent(inout) :: w(:)  !! Weights (n_points) [volume].
    type(error_t), allocatable, intent(out) :: error  !! Where a formula has no value, or the material is not stable.
    !> Matrices at the points, set where more than the factor varies (6, 6, n_points) [pressure].
    real(dp), intent(inout), optional :: matrix(:, :, :)
    real(dp), intent(inout), optional :: bulk(:)  !! Projected bulk moduli, set alike (n_points) [pressure].
    real(dp), intent(inout), optional :: expansion(:, :)  !! Expansions, set alike (6, n_points) [1/temperature].
    type(point_constants_t) :: here
    integer :: q
    if (.not. self%varies) then
      call apply_modulus_field(self%factor, shape, x, tag, w, error)
      return
    end if
    do q = 1, size(w)
      call self%at(analysis, matmul(x, shape(:, q)), here, error, kind)
      if (allocated(error)) then
        !$omp critical (message)
        error%message = error%message//' (element '//to_text(tag)//')'
        !$omp end critical (message)
        return
      end if
      w(q) = w(q)*here%factor
      if (present(matrix)) matrix(:, :, q) = here%matrix
      if (present(bulk)) bulk(q) = here%bulk
      if (present(expansion)) expansion(:, q) = here%expansion
    end do
  end subroutine material_field_apply

  !> Free the formulas; the field is constant afterwards.
  subroutine material_field_destroy(self)
    class(material_field_t), intent(inout) :: self
    integer :: i
    call self%factor%destroy()
    call self%expansion%destroy()
    if (allocated(self%elastic)) then
      do i = 1, size(self%elastic)
        call self%elastic(i)%destroy()
      end do
      deallocate (self%elastic)
    end if
    self%constant = .true.
    self%varies = .false.
  end subroutine material_field_destroy

  !> Parse the modulus field of a material: 1 where the material has none.
  subroutine read_modulus_field(material, factor, error)
    type(material_t), intent(in) :: material  !! The material.
    type(vector_field_t), intent(inout) :: factor  !! The modulus field, in the first component.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the formula does not parse.
    type(text_t), allocatable :: text(:)
    if (allocated(material%modulus_formula)) then
      allocate (text(1))
      text(1)%s = material%modulus_formula
    end if
    call factor%init([1.0_dp, 0.0_dp, 0.0_dp], error, text)
    call add_context(error, 'young_formula: ')
  end subroutine read_modulus_field

  !> Multiply the quadrature weights of an element by the modulus field.
  subroutine apply_modulus_field(factor, shape, x, tag, w, error)
    type(vector_field_t), intent(in) :: factor  !! The modulus field, in the first component.
    real(dp), intent(in) :: shape(:, :)  !! Shape functions at the points (n_nodes, n_points) [].
    real(dp), intent(in) :: x(:, :)  !! Nodes of the element (dim, n_nodes) [length].
    integer(int64), intent(in) :: tag  !! Tag of the element, for messages.
    real(dp), intent(inout) :: w(:)  !! Weights (n_points) [volume].
    !> Allocated where the modulus field has no value, is not positive, or is too large or too small at a point.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: position(size(x, 1)), value(3)
    integer :: q
    do q = 1, size(w)
      position = matmul(x, shape(:, q))
      call factor%evaluate(position, value, error)
      if (.not. allocated(error) .and. value(1) >= smallest_number) then
        w(q) = w(q)*value(1)
        cycle
      end if
      !$omp critical (message)
      if (allocated(error)) then
        continue   ! The formula has no value there: the message exists.
      else if (.not. value(1) > 0) then
        call set_error(error, 'the modulus factor must be positive, it is '//to_text(value(1))//' at '// &
                       point_text(position), exit_bad_input)
      else
        call set_error(error, 'the formula is '//to_text(value(1))//' at '//point_text(position)//'; '//size_rule, &
                       exit_bad_input)
      end if
      call add_context(error, 'young_formula: ')
      error%message = error%message//' (element '//to_text(tag)//')'
      !$omp end critical (message)
      return
    end do
  end subroutine apply_modulus_field

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
    if (.not. determinant > given_rounding) then
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
      if (.not. pivot > given_rounding) return
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
end module dotyk_elasticity_material_field
