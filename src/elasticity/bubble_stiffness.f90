!> Stiffness of the bubbles of an element, for the local problems of its residual.
module dotyk_elasticity_bubble_stiffness
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_bubble_table, only: bubble_table_t
  use dotyk_elasticity_point_stress, only: point_material_t
  use dotyk_linalg_blas, only: dsyrk
  implicit none
  private
  public :: bubble_stiffness

contains

  !> The stiffness of the bubbles, its lower triangle.
  subroutine bubble_stiffness(n_points, n_bubbles, dim, slots, n_strains, table, material, inverse, radius, w, &
                              stiffness, matrix)
    !> Numbers of points with repetitions, bubbles, displacement components, gradient slots and strains.
    integer, intent(in) :: n_points, n_bubbles, dim, slots, n_strains
    type(bubble_table_t), intent(in) :: table  !! Bubbles of the kind.
    type(point_material_t), intent(in) :: material  !! Material.
    real(dp), intent(in) :: inverse(n_points, dim, dim)  !! Inverse Jacobians (n_points, dim, dim) [1/length].
    real(dp), intent(in) :: radius(n_points)  !! Radius in axisymmetric analyses (n_points) [length].
    real(dp), intent(in) :: w(n_points)  !! Weights of the points by the modulus factor (n_points) [volume].
    !> Material at the points, by the factor (n_strains, n_strains, n_points) [pressure].
    real(dp), intent(in) :: stiffness(n_strains, n_strains, n_points)
    !> The matrix; its upper triangle is not set (n_bubbles, dim, n_bubbles, dim) [force/length].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)
    real(dp) :: slope(n_points, n_bubbles, slots)
    integer :: i, k, q, s
    slope = 0
    do s = 1, dim
      do i = 1, n_bubbles
        do k = 1, dim
          do q = 1, n_points
            slope(q, i, s) = slope(q, i, s) + table%slope(q, i, k)*inverse(q, k, s)
          end do
        end do
      end do
    end do
    if (slots > dim) then
      do q = 1, table%n_points
        slope(q, :, 3) = table%value(:, q)/radius(q)
      end do
    end if
    if (material%field%varies) then
      call form_varying(n_points, n_bubbles, dim, slots, n_strains, material%form%index, stiffness, w, slope, matrix)
    else
      call form_matrix(n_points, n_bubbles, dim, slots, n_strains, material%form%index, material%stiffness, w, slope, &
                       matrix)
    end if
  end subroutine bubble_stiffness

  !> The stiffness of the bubbles, its lower triangle: from sums over the points of products of two derivatives.
  subroutine form_matrix(n_points, n_bubbles, dim, slots, n_strains, index, stiffness, w, slope, matrix)
    integer, intent(in) :: n_points  !! Number of points.
    integer, intent(in) :: n_bubbles  !! Number of bubbles.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: slots  !! Number of gradient slots.
    integer, intent(in) :: n_strains  !! Number of strains.
    integer, intent(in) :: index(dim, slots)  !! Strain of each slot of each component, 0 for none (dim, slots).
    !> From strains to stresses (n_strains, n_strains) [pressure].
    real(dp), intent(in) :: stiffness(n_strains, n_strains)
    real(dp), intent(in) :: w(n_points)  !! Weights of the points (n_points) [volume].
    !> Derivatives of the bubbles (n_points, n_bubbles, slots) [1/length].
    real(dp), intent(in) :: slope(n_points, n_bubbles, slots)
    !> The matrix; its upper triangle is not set (n_bubbles, dim, n_bubbles, dim) [force/length].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)
    real(dp) :: root(n_points, n_bubbles, slots), product(n_bubbles, slots, n_bubbles, slots), of_weight(n_points), c
    integer :: a, i, j, s, t
    of_weight = sqrt(w)
    do s = 1, slots
      do a = 1, n_bubbles
        root(:, a, s) = of_weight*slope(:, a, s)
      end do
    end do
    call dsyrk('L', 'T', n_bubbles*slots, n_points, 1.0_dp, root, n_points, 0.0_dp, product, n_bubbles*slots)
    do s = 1, slots
      do t = 1, s
        do a = 1, n_bubbles
          if (s > t) then
            product(a, t, :, s) = product(:, s, a, t)
          else
            product(a, s, a + 1:, s) = product(a + 1:, s, a, s)
          end if
        end do
      end do
    end do
    matrix = 0
    do j = 1, dim
      do i = j, dim
        do t = 1, slots
          if (index(j, t) == 0) cycle
          do s = 1, slots
            if (index(i, s) == 0) cycle
            c = stiffness(index(i, s), index(j, t))
            if (abs(c) > 0) matrix(:, i, :, j) = matrix(:, i, :, j) + c*product(:, s, :, t)
          end do
        end do
      end do
    end do
  end subroutine form_matrix

  !> The stiffness of the bubbles, its lower triangle, where the material differs from point to point.
  subroutine form_varying(n_points, n_bubbles, dim, slots, n_strains, index, stiffness, w, slope, matrix)
    !> Numbers of points, bubbles, displacement components, gradient slots and strains.
    integer, intent(in) :: n_points, n_bubbles, dim, slots, n_strains
    integer, intent(in) :: index(dim, slots)  !! Strain of each slot of each component, 0 for none (dim, slots).
    !> From strains to stresses (n_strains, n_strains, n_points) [pressure].
    real(dp), intent(in) :: stiffness(n_strains, n_strains, n_points)
    real(dp), intent(in) :: w(n_points)  !! Weights of the points (n_points) [volume].
    !> Derivatives of the bubbles (n_points, n_bubbles, slots) [1/length].
    real(dp), intent(in) :: slope(n_points, n_bubbles, slots)
    !> The matrix; its upper triangle is not set (n_bubbles, dim, n_bubbles, dim) [force/length].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)
    real(dp) :: strain(n_bubbles, n_strains, dim), stress(n_strains, n_bubbles)
    integer :: i, j, q, s
    matrix = 0
    do q = 1, n_points
      if (.not. w(q) > 0) cycle
      strain = 0
      do j = 1, dim
        do s = 1, slots
          if (index(j, s) > 0) strain(:, index(j, s), j) = strain(:, index(j, s), j) + slope(q, :, s)
        end do
      end do
      do j = 1, dim
        stress = matmul(w(q)*stiffness(:, :, q), transpose(strain(:, :, j)))
        do i = j, dim
          matrix(:, i, :, j) = matrix(:, i, :, j) + matmul(strain(:, :, i), stress)
        end do
      end do
    end do
  end subroutine form_varying
end module dotyk_elasticity_bubble_stiffness
