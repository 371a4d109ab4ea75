!> Twice the strain energy density as a quadratic form of the strains of an analysis, without the zeros of its matrix.
!>
!> The strains are xx yy zz yz xz xy in three dimensions, xx yy xy in plane analyses, xx yy xy zz in axisymmetric
!> ones. The form of an isotropic body has nine terms in three dimensions, four in plane analyses.
module dotyk_elasticity_energy_form
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_analysis, only: analysis_dimension, gradient_slots, strain_index
  implicit none
  private

  type, public :: energy_form_t  !! The terms of the form.
    integer :: n_strains = 0  !! Number of strains.
    integer :: n_terms = 0  !! Number of terms.
    integer, allocatable :: component(:)  !! Component of each strain in the order xx yy zz yz xz xy (n_strains).
    integer, allocatable :: index(:, :)  !! Strain that a slot of a component adds to, 0: none (dim, slots).
    integer, allocatable :: pair(:, :)  !! The two strains of each term (2, n_terms).
    real(dp), allocatable :: coefficient(:)  !! Coefficient of each term (n_terms) [pressure].
    real(dp) :: largest = 0  !! Largest entry of the material matrix [pressure].
  contains
    procedure :: init => energy_form_init
    procedure :: strains => energy_form_strains
    procedure :: energy => energy_form_energy
    procedure :: product => energy_form_product
  end type energy_form_t

contains

  !> List the terms of a material.
  subroutine energy_form_init(self, analysis, matrix)
    class(energy_form_t), intent(out) :: self
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: matrix(6, 6)  !! Stiffness of the material: from strains to stresses (6, 6) [pressure].
    integer :: i, s, t, strain_of_slot
    real(dp) :: c
    allocate (self%index(analysis_dimension(analysis), gradient_slots(analysis)), source=0)
    self%component = [1, 2, 3, 4, 5, 6]
    if (analysis_dimension(analysis) == 2) self%component = [1, 2, 6]
    if (analysis_dimension(analysis) < gradient_slots(analysis)) self%component = [1, 2, 6, 3]
    self%n_strains = size(self%component)
    do s = 1, size(self%index, 2)
      do i = 1, size(self%index, 1)
        strain_of_slot = strain_index(analysis, i, s)
        if (strain_of_slot > 0) self%index(i, s) = findloc(self%component, strain_of_slot, dim=1)
      end do
    end do
    allocate (self%pair(2, 21), self%coefficient(21))
    do t = 1, self%n_strains
      do s = 1, t
        c = matrix(self%component(s), self%component(t))
        if (s < t) c = c + matrix(self%component(t), self%component(s))
        if (.not. abs(c) > 0) cycle
        self%n_terms = self%n_terms + 1
        self%pair(:, self%n_terms) = [s, t]
        self%coefficient(self%n_terms) = c
      end do
    end do
    self%largest = maxval(abs(matrix))
  end subroutine energy_form_init

  !> Strains of displacement gradients.
  pure subroutine energy_form_strains(self, n_points, slope, strain)
    class(energy_form_t), intent(in) :: self
    integer, intent(in) :: n_points  !! Number of points.
    !> Slots of the gradients of the components (n_points, dim, slots) [].
    real(dp), intent(in) :: slope(n_points, size(self%index, 1), size(self%index, 2))
    real(dp), intent(out) :: strain(n_points, self%n_strains)  !! Strains (n_points, n_strains) [].
    integer :: i, s
    strain = 0
    do s = 1, size(slope, 3)
      do i = 1, size(slope, 2)
        associate (k => self%index(i, s))
          if (k > 0) strain(:, k) = strain(:, k) + slope(:, i, s)
        end associate
      end do
    end do
  end subroutine energy_form_strains

  !> Twice the strain energy, summed over points [energy].
  pure real(dp) function energy_form_energy(self, weight, strain, matrix) result(energy)
    class(energy_form_t), intent(in) :: self
    real(dp), intent(in) :: weight(:)  !! Volumes of the points (n_points) [volume].
    real(dp), intent(in), contiguous :: strain(:, :)  !! Strains (n_points, n_strains) [].
    !> Material matrices at the points, in place of that of the form; not where not allocated (6, 6, n_points)
    !> [pressure].
    real(dp), intent(in), allocatable, optional :: matrix(:, :, :)
    real(dp) :: density(size(weight))
    integer :: k, q
    density = 0
    if (present(matrix)) then
      if (allocated(matrix)) then
        do q = 1, size(weight)
          density(q) = dot_product(strain(q, :), matmul(matrix(self%component, self%component, q), strain(q, :)))
        end do
        energy = dot_product(weight, density)
        return
      end if
    end if
    do k = 1, self%n_terms
      associate (s => self%pair(1, k), t => self%pair(2, k), c => self%coefficient(k))
        do q = 1, size(weight)
          density(q) = density(q) + c*(strain(q, s)*strain(q, t))
        end do
      end associate
    end do
    energy = dot_product(weight, density)
  end function energy_form_energy

  !> The bilinear form of two strains, whose energy is that of a strain with itself, summed over points [energy].
  pure real(dp) function energy_form_product(self, weight, strain, other, matrix) result(product)
    class(energy_form_t), intent(in) :: self
    real(dp), intent(in) :: weight(:)  !! Volumes of the points (n_points) [volume].
    real(dp), intent(in), contiguous :: strain(:, :), other(:, :)  !! Strains (n_points, n_strains) [].
    real(dp), intent(in), allocatable :: matrix(:, :, :)  !! As in `energy`.
    real(dp) :: density(size(weight))
    integer :: k, q
    density = 0
    if (allocated(matrix)) then
      do q = 1, size(weight)
        density(q) = dot_product(strain(q, :), matmul(matrix(self%component, self%component, q), other(q, :)))
      end do
    else
      do k = 1, self%n_terms
        associate (s => self%pair(1, k), t => self%pair(2, k), c => self%coefficient(k)/2)
          density = density + c*(strain(:, s)*other(:, t) + strain(:, t)*other(:, s))
        end associate
      end do
    end if
    product = dot_product(weight, density)
  end function energy_form_product
end module dotyk_elasticity_energy_form
