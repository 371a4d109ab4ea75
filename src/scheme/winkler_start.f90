!> Rigid bodies on elastic foundations: where free bodies come to rest, and whether they can.
!>
!> Both questions are the minimum over the amplitudes alpha of
!> `mu |alpha|^2/2 - e.alpha + sum_i k_i max(0, y_i + (G alpha)_i)^2/2`, convex and piecewise quadratic: Newton's method with an exact
!> line search. It costs no solve of any body; where there are many motions the systems are sparse, one block for each couple of bodies.
module dotyk_scheme_winkler_start
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_linalg_block_ldlt, only: block_ldlt_t
  use dotyk_linalg_block_ldlt_solution, only: solve_block_ldlt
  use dotyk_scheme_coarse_space, only: coarse_space_t
  use dotyk_scheme_line_search, only: line_minimum
  implicit none
  private
  public :: winkler_equilibrium, find_unbounded_direction

  !> Newton steps at most; a start need not be exact.
  integer, parameter :: most_steps = 100
  !> More free motions than this have sparse matrices.
  integer, parameter :: many_motions = 60

contains

  !> Let the free bodies come to rest.
  subroutine winkler_equilibrium(operator, coarse, resultant, stiffness, y, alpha)
    type(contact_operator_t), intent(in) :: operator
    type(coarse_space_t), intent(in) :: coarse
    !> Resultants that the contact points have to balance (coarse%n) [force].
    real(dp), intent(in) :: resultant(:)
    !> Stiffness of the foundation at the contact points (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)
    !> Penetrations at alpha = 0 (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Amplitudes (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    ! Motions that nothing stops yet must not run away: a spring that is far softer than any contact.
    real(dp), parameter :: soft = 1.0e-9_dp
    alpha = 0
    if (coarse%n == 0 .or. operator%n_rows == 0) return
    call minimize(operator, coarse, resultant, soft*sum(stiffness)/operator%n_rows, stiffness, y, alpha, coarse%stiffness)
  end subroutine winkler_equilibrium

  !> Look for a motion that the loads excite and no contact can stop: the part of e that no pressures balance. It is the projection of e
  !> on the motions with G alpha <= 0, `min |alpha - e|^2/2`, with these conditions by a large penalty.
  subroutine find_unbounded_direction(operator, coarse, motion, found)
    type(contact_operator_t), intent(in) :: operator
    type(coarse_space_t), intent(in) :: coarse
    !> The motion (coarse%n).
    real(dp), intent(out) :: motion(:)
    logical, intent(out) :: found
    real(dp), allocatable :: e(:), none(:), penalty(:), springs(:, :)
    real(dp) :: length
    integer :: i
    ! A load that is unbalanced by less than this part of the largest is rounding, of the loads or of the mesh.
    real(dp), parameter :: rounding = 1.0e-7_dp, stiff = 1.0e10_dp
    motion = 0
    found = .false.
    if (coarse%n == 0) return
    length = maxval(abs(coarse%resultant))
    if (.not. length > 0) return
    e = coarse%resultant/length
    allocate (none(operator%n_rows), penalty(operator%n_rows))
    none = 0
    penalty = stiff
    if (allocated(coarse%stiffness)) then
      ! Springs stop a motion too.
      allocate (springs(coarse%n, coarse%n), source=0.0_dp)
      do i = 1, coarse%n
        if (coarse%stiffness(i, i) > 0) springs(i, i) = stiff
      end do
    end if
    call minimize(operator, coarse, e, 1.0_dp, penalty, none, motion, springs)
    found = maxval(abs(motion)) > rounding
  end subroutine find_unbounded_direction

  !> The minimum of the function above; alpha is the start on entry.
  subroutine minimize(operator, coarse, e, mu, k, y, alpha, springs)
    type(contact_operator_t), intent(in) :: operator
    type(coarse_space_t), intent(in) :: coarse
    !> See above: (coarse%n), a number, (n_rows), (n_rows).
    real(dp), intent(in) :: e(:), mu, k(:), y(:)
    real(dp), intent(inout) :: alpha(:)
    !> Springs on the motions; none if absent (coarse%n, coarse%n) [force/length].
    real(dp), intent(in), optional :: springs(:, :)
    real(dp), allocatable :: gradient(:), step(:), position(:), change(:)
    type(block_ldlt_t) :: factor
    integer, allocatable :: start(:), neighbour(:), order(:)
    real(dp) :: first_size, t
    logical :: failed
    integer :: i
    allocate (gradient(coarse%n), step(coarse%n), position(size(y)), change(size(y)))
    if (coarse%n > many_motions) call order_bodies(operator, coarse, start, neighbour, order)
    call coarse%displacement(operator, alpha, position)
    position = y + position
    first_size = maxval(abs(e))
    do i = 1, most_steps
      call coarse%resultant_of(operator, k*max(0.0_dp, position), gradient)
      gradient = gradient + held(alpha) - e
      if (maxval(abs(gradient)) <= 1.0e-12_dp*first_size) exit
      step = -gradient
      if (allocated(order)) then
        call solve_sparse(coarse, mu, k, position, start, neighbour, order, factor, step, failed, springs)
      else
        call solve_full(coarse, mu, k, position, springs, step, failed)
      end if
      if (failed) exit
      call coarse%displacement(operator, step, change)
      t = line_minimum(dot_product(held(alpha) - e, step), dot_product(step, held(step)), k, position, change)
      t = min(t, 1.0e15_dp)
      alpha = alpha + t*step
      position = position + t*change
    end do
  contains
    !> What springs resist a motion with.
    function held(motion) result(force)
      real(dp), intent(in) :: motion(:)
      real(dp) :: force(size(motion))
      force = mu*motion
      if (present(springs)) force = force + coarse%by_bodies(springs, motion)
    end function held
  end subroutine minimize

  !> x <- (mu I + springs + sum of k_i G_i G_i^T over points under pressure)^{-1} x, by a dense matrix.
  subroutine solve_full(coarse, mu, k, position, springs, x, failed)
    type(coarse_space_t), intent(in) :: coarse
    real(dp), intent(in) :: mu, k(:), position(:)
    real(dp), intent(in), optional :: springs(:, :)
    real(dp), intent(inout) :: x(:)
    logical, intent(out) :: failed
    type(error_t), allocatable :: error
    real(dp) :: column(size(x), 1)
    real(dp), allocatable :: hessian(:, :)
    integer :: i
    allocate (hessian(coarse%n, coarse%n), source=0.0_dp)
    do i = 1, coarse%n
      hessian(i, i) = mu
    end do
    if (present(springs)) hessian = hessian + springs
    call add_contact(coarse, k, position, hessian)
    column(:, 1) = x
    call solve_dense(hessian, column, error)
    x = column(:, 1)
    failed = allocated(error)
  end subroutine solve_full

  !> Bodies that share contact points, and an order to eliminate them in.
  subroutine order_bodies(operator, coarse, start, neighbour, order)
    type(contact_operator_t), intent(in) :: operator
    type(coarse_space_t), intent(in) :: coarse
    !> Neighbours of each body (n_bodies + 1); the body that comes k-th (n_bodies).
    integer, allocatable, intent(out) :: start(:), neighbour(:), order(:)
    type(error_t), allocatable :: error
    integer, allocatable :: partner(:), list(:)
    integer :: b, i, n
    n = size(coarse%block)
    allocate (start(n + 1), order(n), neighbour(0))
    start(1) = 1
    do b = 1, n
      allocate (list(0))
      if (coarse%first(b + 1) > coarse%first(b)) then
        partner = sum(coarse%body(:, operator%block(b)%row), 1) - b
        do while (size(partner) > 0)
          i = partner(1)
          if (i > 0) then
            if (coarse%first(i + 1) > coarse%first(i)) list = [list, i]
          end if
          partner = pack(partner, partner /= i)
        end do
      end if
      neighbour = [neighbour, list]
      start(b + 1) = start(b) + size(list)
      deallocate (list)
    end do
    call nested_dissection(start, neighbour, order, error)
    if (allocated(error)) order = [(b, b=1, n)]
  end subroutine order_bodies

  !> The same by a sparse one.
  subroutine solve_sparse(coarse, mu, k, position, start, neighbour, order, factor, x, failed, springs)
    type(coarse_space_t), intent(in) :: coarse
    real(dp), intent(in) :: mu, k(:), position(:)
    !> Of `order_bodies`.
    integer, intent(in) :: start(:), neighbour(:), order(:)
    !> Work space.
    type(block_ldlt_t), intent(inout) :: factor
    real(dp), intent(inout) :: x(:)
    logical, intent(out) :: failed
    !> A block for each body (coarse%n, coarse%n).
    real(dp), intent(in), optional :: springs(:, :)
    integer :: n(size(order)), b, i, j, p, q, block
    real(dp), allocatable :: own(:, :), g_p(:, :), g_q(:, :)
    n = coarse%first(2:) - coarse%first(:size(order))
    call factor%init(n, [(1, b=1, size(order))], start, neighbour, order)
    do b = 1, size(order)
      allocate (own(n(b), n(b)), source=0.0_dp)
      if (present(springs)) own = springs(coarse%first(b):coarse%first(b + 1) - 1, coarse%first(b):coarse%first(b + 1) - 1)
      do j = 1, n(b)
        own(j, j) = own(j, j) + mu
      end do
      call factor%add(b, b, own)
      deallocate (own)
    end do
    do i = 1, size(position)
      if (.not. position(i) > 0) cycle
      do p = 1, 2
        do q = 1, p
          if (coarse%body(p, i) == 0 .or. coarse%body(q, i) == 0) cycle
          if (n(coarse%body(p, i)) == 0 .or. n(coarse%body(q, i)) == 0) cycle
          g_p = reshape(coarse%block(coarse%body(p, i))%value(coarse%place(p, i), :), [n(coarse%body(p, i)), 1])
          g_q = reshape(coarse%block(coarse%body(q, i))%value(coarse%place(q, i), :), [1, n(coarse%body(q, i))])
          call factor%add(coarse%body(p, i), coarse%body(q, i), k(i)*matmul(g_p, g_q))
        end do
      end do
    end do
    call factor%factorize([(0.0_dp, b=1, size(order))], block)
    failed = block > 0
    if (.not. failed) call solve_block_ldlt(factor, x)
    call factor%destroy()
  end subroutine solve_sparse

  !> Add the sum of k_i G_i G_i^T over points under pressure.
  subroutine add_contact(coarse, k, position, hessian)
    type(coarse_space_t), intent(in) :: coarse
    real(dp), intent(in) :: k(:), position(:)
    real(dp), intent(inout) :: hessian(:, :)
    real(dp), allocatable :: g_a(:), g_b(:)
    integer :: i, j, a, b
    do i = 1, size(position)
      if (.not. position(i) > 0) cycle
      a = coarse%body(1, i)
      b = coarse%body(2, i)
      g_a = coarse%block(a)%value(coarse%place(1, i), :)
      g_b = coarse%block(b)%value(coarse%place(2, i), :)
      do j = 1, size(g_a)
        associate (column => coarse%first(a) + j - 1)
          call add(coarse%first(a), k(i)*g_a(j), g_a, hessian(:, column))
          call add(coarse%first(b), k(i)*g_a(j), g_b, hessian(:, column))
        end associate
      end do
      do j = 1, size(g_b)
        associate (column => coarse%first(b) + j - 1)
          call add(coarse%first(a), k(i)*g_b(j), g_a, hessian(:, column))
          call add(coarse%first(b), k(i)*g_b(j), g_b, hessian(:, column))
        end associate
      end do
    end do
  end subroutine add_contact

  !> column(first:) += factor * g.
  pure subroutine add(first, factor, g, column)
    integer, intent(in) :: first
    real(dp), intent(in) :: factor, g(:)
    real(dp), intent(inout) :: column(:)
    column(first:first + size(g) - 1) = column(first:first + size(g) - 1) + factor*g
  end subroutine add
end module dotyk_scheme_winkler_start
