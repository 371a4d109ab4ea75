!> The axes of one node from all the directions in which its displacement is given.
module dotyk_elasticity_node_axes
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_facet, only: frame_of_normal
  implicit none
  private

  !> What is given at a node.
  type, public :: node_axes_t
    !> Number of independent directions.
    integer :: rank = 0
    !> Whether the axes are the global ones.
    logical :: is_global = .true.
    !> Axes as columns (3, 3); only (dim, dim) means something.
    real(dp) :: frame(3, 3) = 0
    !> Whether the displacement along each axis is given.
    logical :: is_given(3) = .false.
    !> The displacement along each axis that is given, else 0 [length].
    real(dp) :: value(3) = 0
    !> Condition that contradicts the others, 0 for none.
    integer :: contradiction = 0
    !> Value of the contradicting condition, and the value that the other conditions imply for its direction [length].
    real(dp) :: conflicting_value = 0, implied_value = 0
  end type node_axes_t

  public :: combine_conditions

  !> A direction with less than this beside the others (a sine) adds nothing to them. Mesh files with few digits stay
  !> below it; edges of real bodies stay above.
  real(dp), parameter :: least_sine = 1.0e-3_dp
  !> Components below this of a unit vector are round-off: flat faces along the global axes need no axes of their own.
  real(dp), parameter :: round_off = 1.0e-12_dp

contains

  !> Combine the conditions `direction . u = value` of one node.
  pure function combine_conditions(dim, n, direction, value, tolerance) result(axes)
    !> Number of displacement components.
    integer, intent(in) :: dim
    !> Number of conditions.
    integer, intent(in) :: n
    !> Unit vectors (dim, n).
    real(dp), intent(in) :: direction(dim, n)
    !> Given displacements along them (n) [length].
    real(dp), intent(in) :: value(n)
    !> Differences of displacements below this are round-off [length].
    real(dp), intent(in) :: tolerance
    type(node_axes_t) :: axes
    real(dp) :: q(dim, dim), z(dim), rest(dim, n), left(n), length, greatest, u(dim)
    logical :: used(n)
    integer :: i, k, best
    q = 0
    z = 0
    used = .false.
    rest = direction
    left = value
    ! Gram-Schmidt, always with the direction that adds most; the first of equals.
    do k = 1, dim
      best = 0
      greatest = least_sine
      do i = 1, n
        if (used(i)) cycle
        length = norm2(rest(:, i))
        if (length > greatest*(1 + 1.0e-9_dp)) then
          greatest = length
          best = i
        end if
      end do
      if (best == 0) exit
      used(best) = .true.
      axes%rank = k
      q(:, k) = rest(:, best)/greatest
      z(k) = left(best)/greatest
      do i = 1, n
        if (used(i)) cycle
        length = dot_product(rest(:, i), q(:, k))
        rest(:, i) = rest(:, i) - length*q(:, k)
        left(i) = left(i) - length*z(k)
      end do
    end do
    do i = 1, n
      if (used(i)) cycle
      ! What is left of a direction that adds nothing may still be up to `least_sine` of it.
      if (abs(left(i)) > tolerance + norm2(rest(:, i))*maxval(abs(value))) then
        axes%contradiction = i
        axes%conflicting_value = value(i)
        axes%implied_value = value(i) - left(i)
        return
      end if
    end do
    if (axes%rank == 0) return
    call choose_axes(dim, q, axes)
    if (axes%is_global) then
      u = matmul(q(:, :axes%rank), z(:axes%rank))
      do i = 1, dim
        if (axes%is_given(i)) axes%value(i) = u(i)
      end do
    else
      axes%frame(:dim, :dim) = q
      axes%is_given(:axes%rank) = .true.
      axes%value(:axes%rank) = z(:axes%rank)
    end if
  end function combine_conditions

  !> Complete the axes, and find out whether the global axes serve as well.
  pure subroutine choose_axes(dim, q, axes)
    integer, intent(in) :: dim
    !> Orthonormal directions in the first `rank` columns; completed on return unless the global axes serve.
    real(dp), intent(inout) :: q(dim, dim)
    !> `rank` on entry; `is_global`, `is_given` and `frame` on return.
    type(node_axes_t), intent(inout) :: axes
    real(dp) :: local(dim, dim)
    integer :: i, free
    axes%is_global = .true.
    do i = 1, 3
      axes%frame(i, i) = 1
    end do
    if (axes%rank == dim) then
      axes%is_given(:dim) = .true.
      return
    end if
    if (axes%rank == 1) then
      i = maxloc(abs(q(:, 1)), 1)
      if (all(abs(without(q(:, 1), i)) < round_off)) then
        axes%is_given(i) = .true.
        return
      end if
      call frame_of_normal(dim, q(:, 1), local)
      q(:, 2:) = local(:, :dim - 1)
    else
      q(:, 3) = [q(2, 1)*q(3, 2) - q(3, 1)*q(2, 2), q(3, 1)*q(1, 2) - q(1, 1)*q(3, 2), &
        q(1, 1)*q(2, 2) - q(2, 1)*q(1, 2)]
      free = maxloc(abs(q(:, 3)), 1)
      if (all(abs(without(q(:, 3), free)) < round_off)) then
        axes%is_given = .true.
        axes%is_given(free) = .false.
        return
      end if
    end if
    axes%is_global = .false.
  end subroutine choose_axes

  !> A vector without one of its components.
  pure function without(vector, i) result(others)
    real(dp), intent(in) :: vector(:)
    integer, intent(in) :: i
    real(dp) :: others(size(vector) - 1)
    others = [vector(:i - 1), vector(i + 1:)]
  end function without
end module dotyk_elasticity_node_axes
