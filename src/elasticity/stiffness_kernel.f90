!> Kernels of element stiffness matrices.
!>
!> With M(ak,bl) = sum over points of w g_ak g_bl, where g_ak is gradient slot k of shape function a, every linear
!> elastic stiffness is K(ai,bj) = sum_kl C(ik,jl) M(ak,bl) in any analysis; an isotropic body in three dimensions
!> needs only K(ai,bj) = lambda M(ai,bj) + mu M(aj,bi) + mu delta_ij sum_k M(ak,bk).
module dotyk_elasticity_stiffness_kernel
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: gradient_products, stiffness_isotropic, stiffness_general, stiffness_varying, rotate_blocks

contains

  !> Products of gradients, summed over the points: the blocks of M on and below the diagonal.
  pure subroutine gradient_products(n, slots, n_points, g, w, products)
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: slots  !! Number of gradient slots.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    real(dp), intent(in) :: g(n*slots, n_points)  !! Node and slot in one index (n*slots, n_points) [1/length].
    real(dp), intent(in) :: w(n_points)  !! Quadrature weights times the modulus field (n_points) [volume].
    real(dp), intent(out) :: products(n*slots, n*slots)  !! M; lower blocks (n*slots, n*slots) [length^(dim-2)].
    integer :: first, last, column, row, q
    real(dp) :: c1, c2, c3, c4
    last = n*slots
    do column = 1, last
      first = ((column - 1)/n)*n + 1
      products(first:last, column) = 0
      ! Four points at a time: one pass through memory for four multiplications and additions.
      do q = 1, n_points - 3, 4
        c1 = w(q)*g(column, q)
        c2 = w(q + 1)*g(column, q + 1)
        c3 = w(q + 2)*g(column, q + 2)
        c4 = w(q + 3)*g(column, q + 3)
        do row = first, last
          products(row, column) = products(row, column) + (c1*g(row, q) + c2*g(row, q + 1)) &
            + (c3*g(row, q + 2) + c4*g(row, q + 3))
        end do
      end do
      do q = n_points - mod(n_points, 4) + 1, n_points
        c1 = w(q)*g(column, q)
        do row = first, last
          products(row, column) = products(row, column) + c1*g(row, q)
        end do
      end do
    end do
  end subroutine gradient_products

  !> Stiffness of an isotropic element in three dimensions.
  pure subroutine stiffness_isotropic(n, lambda, mu, m, k)
    integer, intent(in) :: n  !! Number of nodes.
    real(dp), intent(in) :: lambda  !! Lame's first parameter [pressure].
    real(dp), intent(in) :: mu  !! Shear modulus [pressure].
    real(dp), intent(in) :: m(n, 3, n, 3)  !! Products of gradients from `gradient_products` (n, 3, n, 3) [length].
    real(dp), intent(out) :: k(n, n, 3, 3)  !! Node a, node b, component i, component j (n, n, 3, 3) [force/length].
    integer :: i, j, a, b
    do b = 1, n
      do a = 1, n
        k(a, b, 3, 3) = mu*(m(a, 1, b, 1) + m(a, 2, b, 2) + m(a, 3, b, 3))
      end do
    end do
    do i = 1, 3
      do b = 1, n
        do a = 1, n
          k(a, b, i, i) = (lambda + mu)*m(a, i, b, i) + k(a, b, 3, 3)
        end do
      end do
    end do
    do j = 1, 2
      do i = j + 1, 3
        do b = 1, n
          do a = 1, n
            k(a, b, i, j) = lambda*m(a, i, b, j) + mu*m(b, i, a, j)
          end do
        end do
        do b = 1, n
          do a = 1, n
            k(a, b, j, i) = k(b, a, i, j)
          end do
        end do
      end do
    end do
  end subroutine stiffness_isotropic

  !> Stiffness of an element of any material in any analysis.
  pure subroutine stiffness_general(n, dim, slots, strain, material, m, k)
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: slots  !! Number of gradient slots.
    integer, intent(in) :: strain(dim, slots)  !! Strain index of each component and slot, 0 for none (dim, slots).
    real(dp), intent(in) :: material(6, 6)  !! Material matrix: from strains to stresses (6, 6) [pressure].
    !> Products of gradients from `gradient_products`; blocks above the diagonal are set on return
    !> (n, slots, n, slots) [length^(dim-2)].
    real(dp), intent(inout) :: m(n, slots, n, slots)
    real(dp), intent(out) :: k(n, n, dim, dim)  !! Node a, node b, component i, component j [force/length].
    integer :: i, j, s, t, a, b
    real(dp) :: c
    do t = 2, slots
      do b = 1, n
        do s = 1, t - 1
          do a = 1, n
            m(a, s, b, t) = m(b, t, a, s)
          end do
        end do
      end do
    end do
    do j = 1, dim
      do i = j, dim
        k(:, :, i, j) = 0
        do t = 1, slots
          if (strain(j, t) == 0) cycle
          do s = 1, slots
            if (strain(i, s) == 0) cycle
            c = material(strain(i, s), strain(j, t))
            if (.not. abs(c) > 0) cycle
            do b = 1, n
              do a = 1, n
                k(a, b, i, j) = k(a, b, i, j) + c*m(a, s, b, t)
              end do
            end do
          end do
        end do
        if (i > j) k(:, :, j, i) = transpose(k(:, :, i, j))
      end do
    end do
  end subroutine stiffness_general

  !> Stiffness of an element whose material matrix differs from point to point.
  pure subroutine stiffness_varying(n, dim, slots, n_points, strain, material, g, w, k)
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: slots  !! Number of gradient slots.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: strain(dim, slots)  !! Strain index of each component and slot, 0 for none (dim, slots).
    real(dp), intent(in) :: material(6, 6, n_points)  !! Material matrices: from strains to stresses [pressure].
    real(dp), intent(in) :: g(n, slots, n_points)  !! Gradients of the shape functions (n, slots, n_points) [1/length].
    real(dp), intent(in) :: w(n_points)  !! Quadrature weights times the factor of the matrices (n_points) [volume].
    real(dp), intent(out) :: k(n, n, dim, dim)  !! Node a, node b, component i, component j [force/length].
    real(dp) :: b(n, 6, dim), stress(6, n, dim)
    integer :: i, j, q, s
    k = 0
    do q = 1, n_points
      b = 0
      do i = 1, dim
        do s = 1, slots
          if (strain(i, s) > 0) b(:, strain(i, s), i) = b(:, strain(i, s), i) + g(:, s, q)
        end do
        stress(:, :, i) = matmul(w(q)*material(:, :, q), transpose(b(:, :, i)))
      end do
      do j = 1, dim
        do i = j, dim
          k(:, :, i, j) = k(:, :, i, j) + matmul(b(:, :, i), stress(:, :, j))
        end do
      end do
    end do
    do j = 1, dim
      do i = j + 1, dim
        k(:, :, j, i) = transpose(k(:, :, i, j))
      end do
    end do
  end subroutine stiffness_varying

  !> Rotate the unknowns of nodes into their local axes: K_ab <- R_a^T K_ab R_b.
  pure subroutine rotate_blocks(n, dim, n_frames, frame_of, frame, k)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n_frames  !! Number of sets of axes.
    integer, intent(in) :: frame_of(n)  !! Local axes of each node of the element, 0 for the global axes (n).
    real(dp), intent(in) :: frame(dim, dim, n_frames)  !! Axes as columns (dim, dim, n_frames) [].
    real(dp), intent(inout) :: k(n, n, dim, dim)  !! Node a, node b, component i, component j [force/length].
    real(dp) :: line(n, dim)
    integer :: a, i, j
    do a = 1, n
      if (frame_of(a) == 0) cycle
      do j = 1, dim
        line = k(a, :, :, j)
        do i = 1, dim
          k(a, :, i, j) = matmul(line, frame(:, i, frame_of(a)))
        end do
      end do
      do i = 1, dim
        line = k(:, a, i, :)
        do j = 1, dim
          k(:, a, i, j) = matmul(line, frame(:, j, frame_of(a)))
        end do
      end do
    end do
  end subroutine rotate_blocks
end module dotyk_elasticity_stiffness_kernel
