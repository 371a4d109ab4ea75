!> Motions of tied bodies that their ties do not resist, or hardly.
!>
!> With C_tt the compliance of the ties, G_t the modes of the bodies at them and S the stiffness of these modes, the
!> ties resist the modes by `A = G_t^T C_tt^{-1} G_t + S`. Its eigenvectors, each mode scaled by its own entry of A, are
!> of three kinds: motions of the whole group that nothing resists; where bodies have near-null-space modes, soft
!> motions, which springs or weak supports resist and the ties hardly; and those that the ties resist. The soft motions
!> stay modes of the group, with a stiffness. In the compliance of the group they would stand as a matrix of low rank
!> that is larger than all else by the ratio of the stiffness of the bodies to that of the springs, and so many digits
!> would be lost.
module dotyk_scheme_group_motions
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private

  !> Motions, and the inverse of A for all others.
  type, public :: group_motions_t
    !> Number of motions that nothing resists: the first ones.
    integer :: n_free = 0
    !> Motions, the soft ones last, as columns (n_modes, n_motions) [].
    real(dp), allocatable :: motion(:, :)
    !> Inverse of A without these motions (n_modes, n_modes) [length/force].
    real(dp), allocatable :: inverse(:, :)
    !> What remains of resultants without those on the motions (n_modes, n_modes) [].
    real(dp), allocatable :: balance(:, :)
  contains
    procedure :: find => motions_find
  end type group_motions_t

  !> Eigenvalues of the stiffness of the ties against the modes, relative to those of each mode by itself, are zero
  !> below this: motions of the whole group [].
  real(dp), parameter :: least_eigenvalue = 1.0e-11_dp
  !> Below this the motions of groups with near-null-space modes are soft. It divides no kinds: a motion on either side
  !> of it has the same solution, with as many digits less as it is below 1 [].
  real(dp), parameter :: largest_soft = 1.0e-2_dp
  !> Directions that ties do not resist: stiffness of springs and supports below this fraction of the largest one is
  !> none [].
  real(dp), parameter :: least_stiffness = 1.0e-9_dp
  !> Rounding of a product with S, as a fraction of its largest entry [].
  real(dp), parameter :: rounding = 1.0e-13_dp

contains

  !> Find them.
  subroutine motions_find(self, stiffness, of_modes, error)
    class(group_motions_t), intent(out) :: self
    !> A, symmetric (n_modes, n_modes) [force/length].
    real(dp), intent(in) :: stiffness(:, :)
    !> S, 0 where no body has near-null-space modes (n_modes, n_modes) [force/length].
    real(dp), intent(in) :: of_modes(:, :)
    !> Allocated where LAPACK finds no eigenvalues.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: scaled(:, :), root(:), values(:), vectors(:, :)
    integer :: i, n, n_motions
    n = size(stiffness, 1)
    allocate (scaled(n, n), values(n), vectors(n, n), root(n))
    do i = 1, n
      root(i) = sqrt(stiffness(i, i))
      if (.not. root(i) > 0) root(i) = 1
    end do
    do i = 1, n
      scaled(:, i) = stiffness(:, i)/root/root(i)
    end do
    call symmetric_eigen(scaled, values, vectors, error)
    if (allocated(error)) return
    n_motions = count(values < least_eigenvalue)
    self%n_free = n_motions
    if (maxval([0.0_dp, abs(of_modes)]) > 0) then
      ! What ties do not resist springs and supports may: their stiffness is exact, however small beside that of ties.
      call soft_directions(of_modes/spread(root, 2, n)/spread(root, 1, n), vectors(:, :n_motions), self%n_free, error)
      if (allocated(error)) return
      n_motions = count(values < largest_soft)
    end if
    allocate (self%balance(n, n), self%inverse(n, n), self%motion(n, n_motions), source=0.0_dp)
    do i = n_motions + 1, n
      self%balance = self%balance + spread(root*vectors(:, i), 2, n)*spread(vectors(:, i)/root, 1, n)
      self%inverse = self%inverse + spread(vectors(:, i)/root, 2, n)*spread(vectors(:, i)/root, 1, n)/values(i)
    end do
    do i = 1, n_motions
      self%motion(:, i) = vectors(:, i)/root
    end do
  end subroutine motions_find

  !> Directions that ties do not resist, those that nothing resists first.
  subroutine soft_directions(stiffness, vectors, n_free, error)
    !> S in the scale of the vectors (n, n) [].
    real(dp), intent(in) :: stiffness(:, :)
    !> Orthonormal; another basis of their span on return (n, n_soft) [].
    real(dp), intent(inout) :: vectors(:, :)
    !> Number of those that nothing resists.
    integer, intent(out) :: n_free
    !> Allocated where LAPACK finds no eigenvalues.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: own(:, :), turn(:, :), values(:)
    n_free = size(vectors, 2)
    if (n_free == 0) return
    own = matmul(transpose(vectors), matmul(stiffness, vectors))
    if (.not. maxval(abs(own)) > rounding*maxval(abs(stiffness))) return
    own = (own + transpose(own))/2
    allocate (turn, mold=own)
    allocate (values(n_free))
    call symmetric_eigen(own, values, turn, error)
    if (allocated(error)) return
    vectors = matmul(vectors, turn)
    n_free = count(values < max(least_stiffness*values(size(values)), rounding*maxval(abs(stiffness))))
  end subroutine soft_directions
end module dotyk_scheme_group_motions
