!> Bodies that ties join, and whether they can move as a whole.
module dotyk_scheme_tied_groups
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: find_groups, find_held_groups

contains

  !> Groups of bodies that ties join, those without any tie each by itself, in the order of their first bodies.
  subroutine find_groups(qp, group_of, n_groups)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    integer, allocatable, intent(out) :: group_of(:)  !! Group of each body (n_bodies).
    integer, intent(out) :: n_groups  !! Number of groups.
    integer :: i, b, least, number(size(qp%block))
    logical :: changes
    group_of = [(b, b=1, size(qp%block))]
    changes = any(qp%is_tied)
    do while (changes)
      changes = .false.
      do i = 1, qp%n_rows
        if (.not. qp%is_tied(i)) cycle
        associate (one => qp%coarse%body(1, i), other => qp%coarse%body(2, i))
          if (one == 0 .or. other == 0) cycle
          least = min(group_of(one), group_of(other))
          if (group_of(one) == least .and. group_of(other) == least) cycle
          group_of(one) = least
          group_of(other) = least
          changes = .true.
        end associate
      end do
    end do
    n_groups = 0
    do b = 1, size(group_of)
      if (group_of(b) == b) then
        n_groups = n_groups + 1
        number(b) = n_groups
      end if
      group_of(b) = number(group_of(b))
    end do
  end subroutine find_groups

  !> Groups of several bodies, or of one that is tied to itself, in which ties, springs and supports resist all motions.
  subroutine find_held_groups(qp, foundation, group_of, is_held)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    !> Stiffness of the foundation that stands for the bodies at the ties (n_rows) [force/length].
    real(dp), intent(in) :: foundation(:)
    integer, allocatable, intent(out) :: group_of(:)  !! Group of each body (n_bodies).
    logical, allocatable, intent(out) :: is_held(:)  !! (n_groups).
    integer, allocatable :: mode(:)
    real(dp), allocatable :: a(:, :), s(:, :), g(:, :)
    integer :: n_groups, b, i, k, n
    call find_groups(qp, group_of, n_groups)
    allocate (is_held(n_groups), source=.false.)
    do k = 1, n_groups
      if (.not. any([(any(qp%is_tied(qp%block(b)%row)) .and. group_of(b) == k, b=1, size(group_of))])) cycle
      mode = [integer ::]
      do b = 1, size(group_of)
        if (group_of(b) == k) mode = [mode, (i, i=qp%coarse%first(b), qp%coarse%first(b + 1) - 1)]
      end do
      n = size(mode)
      allocate (a(n, n), s(n, n), source=0.0_dp)
      allocate (g(1, qp%coarse%n))
      do i = 1, qp%n_rows
        if (.not. qp%is_tied(i)) cycle
        if (group_of(qp%coarse%body(1, i)) /= k) cycle
        call qp%coarse%rows([i], g)
        a = a + foundation(i)*matmul(transpose(g(:, mode)), g(:, mode))
      end do
      n = 0
      do b = 1, size(group_of)
        if (group_of(b) /= k) cycle
        associate (own => n + qp%coarse%first(b + 1) - qp%coarse%first(b))
          if (allocated(qp%coarse%stiffness)) s(n + 1:own, n + 1:own) = qp%coarse%stiffness(b)%value
          n = own
        end associate
      end do
      is_held(k) = resists_all(a, s)
      deallocate (a, s, g)
    end do
  end subroutine find_held_groups

  !> Whether the sum of two stiffnesses resists all motions, however small the second one is beside the first.
  logical function resists_all(of_ties, of_springs) result(resists)
    real(dp), intent(in) :: of_ties(:, :), of_springs(:, :)  !! Symmetric (n, n) [force/length].
    type(error_t), allocatable :: error
    real(dp), allocatable :: root(:), values(:), vectors(:, :), scaled(:, :), own(:, :)
    integer :: i, n
    n = size(of_ties, 1)
    resists = n == 0
    if (n == 0) return
    root = [(sqrt(of_ties(i, i) + of_springs(i, i)), i=1, n)]
    if (.not. all(root > 0)) return
    allocate (values(n), vectors(n, n))
    scaled = of_ties/spread(root, 2, n)/spread(root, 1, n)
    call symmetric_eigen(scaled, values, vectors, error)
    if (allocated(error)) return
    ! Each mode is scaled by its own stiffness.
    n = count(values < rounding)
    resists = n == 0
    if (resists) return
    scaled = of_springs/spread(root, 2, size(root))/spread(root, 1, size(root))
    if (.not. maxval(abs(scaled)) > 0) return
    own = matmul(transpose(vectors(:, :n)), matmul(scaled, vectors(:, :n)))
    deallocate (values, vectors)
    allocate (values(n), vectors(n, n))
    call symmetric_eigen((own + transpose(own))/2, values, vectors, error)
    if (.not. allocated(error)) resists = values(1) > rounding*maxval(abs(scaled))
  end function resists_all
end module dotyk_scheme_tied_groups
