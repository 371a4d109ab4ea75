!> Rigid motions that contact does not determine: active rows resist them by less than the springs of
!> `dotyk_scheme_proximal_motion` do, or by no more than their normals are uncertain.
module dotyk_scheme_undetermined_motion
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: find_inverse_root, symmetric_eigen
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  use dotyk_scheme_proximal_motion, only: fraction, proximal_motion_t, stiff_part, uncertain
  implicit none
  private
  public :: find_undetermined

  !> Motions of several bodies together are looked for among so many modes at most; the eigenvectors of more would take
  !> longer than the contact.
  integer, parameter :: most_modes = 300

contains

  !> The motions that contact does not determine: rows resist them by less than the springs do, or than they are
  !> uncertain.
  subroutine find_undetermined(self, qp, foundation, active, motion)
    type(proximal_motion_t), intent(in) :: self  !! The springs, where the solution has them.
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    real(dp), intent(in) :: foundation(:)  !! Stiffness of the foundation (n_rows) [force/length].
    logical, intent(in) :: active(:)  !! Active rows (n_rows).
    type(mode_columns_t), intent(out) :: motion  !! As columns of amplitudes; the largest one of each is 1.
    integer :: b, g
    if (qp%coarse%n <= most_modes) then
      call find_of(self, qp, foundation, active, [(b, b=1, size(qp%block))], motion)
    else
      do g = 1, size(self%is_held)
        call find_of(self, qp, foundation, active, pack([(b, b=1, size(qp%block))], self%group == g), motion)
      end do
    end if
  end subroutine find_undetermined

  !> Undetermined motions of some bodies, the others at rest.
  subroutine find_of(self, qp, foundation, active, body, motion)
    type(proximal_motion_t), intent(in) :: self  !! As in `find_undetermined`.
    type(contact_qp_t), intent(in) :: qp  !! As in `find_undetermined`.
    real(dp), intent(in) :: foundation(:)  !! (n_rows) [force/length]
    logical, intent(in) :: active(:)  !! (n_rows)
    integer, intent(in) :: body(:)  !! The bodies.
    type(mode_columns_t), intent(inout) :: motion  !! Gets their motions.
    type(error_t), allocatable :: error
    real(dp), allocatable :: g(:, :), d(:, :), weak(:, :), root(:, :), null_space(:, :), values(:), vectors(:, :)
    real(dp), allocatable :: alpha(:)
    integer, allocatable :: mode(:), row(:)
    integer :: b, i, k, n, before, failed
    allocate (mode(0))
    do k = 1, size(body)
      b = body(k)
      if (size(self%stiffness(b)%value) > 0) mode = [mode, (i, i=qp%coarse%first(b), qp%coarse%first(b + 1) - 1)]
    end do
    n = size(mode)
    if (n == 0) return
    if (size(body) == 1) then
      row = pack(qp%block(b)%row, active(qp%block(b)%row))
    else
      row = pack([(i, i=1, qp%n_rows)], active)
    end if
    before = mode(1) - 1
    mode = mode - before
    allocate (weak(n, n), source=0.0_dp)
    allocate (values(n), vectors(n, n), alpha(mode(n)))
    i = 0
    call rows_of(qp, qp%coarse%block, row, foundation, before, mode(n), g)
    g = g(:, mode)
    do k = 1, size(body)
      associate (springs => self%stiffness(body(k))%value, held => self%held(body(k))%value, &
                 last => i + size(self%stiffness(body(k))%value, 1), first_mode => qp%coarse%first(body(k)))
        weak(i + 1:last, i + 1:last) = springs
        ! What is held is not determined, and does not count as resistance.
        if (size(held) > 0) then
          weak(i + 1:last, i + 1:last) = springs - (1 - fraction)*stiff_part(held, springs)
          g(:, i + 1:last) = g(:, i + 1:last) - matmul(matmul(g(:, i + 1:last), held), transpose( &
            spread(qp%coarse%mean_square(first_mode:first_mode + last - i - 1), 2, size(held, 2))*held))
        end if
        i = last
      end associate
    end do
    ! Shortenings of bolts have no springs.
    associate (most => maxval([(weak(i, i), i=1, n)]))
      do i = 1, n
        if (.not. weak(i, i) > 0) weak(i, i) = most
      end do
    end associate
    if (allocated(qp%coarse%deviation)) then
      call rows_of(qp, qp%coarse%deviation, row, foundation, before, mode(n), d)
      d = d(:, mode)
      weak = weak + matmul(transpose(d), d)/uncertain**2
    end if
    call find_inverse_root(weak, 0.0_dp, root, null_space, failed)
    if (failed /= 0) return
    g = matmul(g, root)
    call symmetric_eigen(matmul(transpose(g), g), values, vectors, error)
    if (allocated(error)) return
    vectors = matmul(root, vectors)
    do k = 1, n
      if (.not. values(k) < 1) cycle
      alpha = 0
      alpha(mode) = vectors(:, k)/maxval(abs(vectors(:, k)))
      call motion%add(alpha, offset=before)
    end do
  end subroutine find_of

  !> Some rows of successive modes, by the root of their stiffness.
  pure subroutine rows_of(qp, block, row, foundation, before, n, g)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    type(mode_block_t), intent(in) :: block(:)  !! Rows by bodies (n_bodies) [].
    integer, intent(in) :: row(:)  !! The rows (n_rows of g).
    real(dp), intent(in) :: foundation(:)  !! Stiffness of all rows (n_rows) [force/length].
    integer, intent(in) :: before, n  !! Modes before the first one, and number of modes.
    real(dp), allocatable, intent(out) :: g(:, :)  !! (rows, n) [sqrt(force/length)]
    integer :: i, k, b
    allocate (g(size(row), n), source=0.0_dp)
    do i = 1, size(row)
      do k = 1, size(qp%coarse%body, 1)
        b = qp%coarse%body(k, row(i))
        if (b == 0) cycle
        associate (first => qp%coarse%first(b) - before, last => qp%coarse%first(b + 1) - 1 - before)
          if (first < 1 .or. last > n) cycle
          g(i, first:last) = sqrt(foundation(row(i)))*block(b)%value(qp%coarse%place(k, row(i)), :)
        end associate
      end do
    end do
  end subroutine rows_of
end module dotyk_scheme_undetermined_motion
