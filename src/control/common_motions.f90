!> Motions that two floating bodies in contact have in common.
!>
!> Each body has its neutral modes held by itself, and moves by the others. A press fit that nothing supports floats as
!> a whole: its bodies keep their common motions exactly where what they keep are the same motions of space. The neutral
!> modes of each are those of its own mesh, to which the others are orthogonal in its own nodes, and differ by as much
!> as the meshes do. A rotation that one body almost has would be resisted a little: a stiffness of rounding.
module dotyk_control_common_motions
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_neutral_candidates, only: candidate_t
  use dotyk_linalg_dense, only: complete_basis, orthonormal_range, right_singular_vectors
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: keep_common_motions

  !> Neutral modes may change by this cosine at least: what is out of balance along those that are held is larger by no
  !> more than its inverse. Bodies whose centroids are apart tilt about different points.
  real(dp), parameter :: least_cosine = 0.1_dp
  !> Motions of space are dependent below this fraction.
  real(dp), parameter :: dependent = 1.0e-9_dp

contains

  !> Let bodies that touch have the same motions beside their neutral modes: from body to body along the contacts, those
  !> with the fewest modes first, where the neutral modes remain nearly their own.
  subroutine keep_common_motions(problem, qp, candidate)
    !> Bodies and their modes.
    type(contact_problem_t), intent(in) :: problem
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Their modes, with the neutral ones first; other bases on return (n_bodies).
    type(candidate_t), intent(inout) :: candidate(:)
    integer, allocatable :: couple(:, :), partner(:)
    logical :: is_done(size(candidate))
    integer :: order(size(candidate)), queue(size(candidate)), first, last, i, k
    ! Rows of a pair follow each other.
    couple = qp%coarse%body(:, pack([(i, i=1, qp%n_rows)], [(differs(i), i=1, qp%n_rows)]))
    couple = couple(:, pack([(k, k=1, size(couple, 2))], minval(couple, 1) > 0))
    call sort_order(problem%modes%n, order)
    is_done = [(.not. is_single(i), i=1, size(candidate))]
    do i = 1, size(order)
      if (is_done(order(i))) cycle
      is_done(order(i)) = .true.
      queue(1) = order(i)
      last = 1
      first = 1
      do while (first <= last)
        partner = [pack(couple(2, :), couple(1, :) == queue(first)), pack(couple(1, :), couple(2, :) == queue(first))]
        do k = 1, size(partner)
          if (is_done(partner(k))) cycle
          is_done(partner(k)) = .true.
          if (candidate(partner(k))%n > 0) call take_motions(queue(first), partner(k))
          last = last + 1
          queue(last) = partner(k)
        end do
        first = first + 1
      end do
    end do

  contains

    !> Whether a row has other bodies than the one before it.
    pure logical function differs(i)
      !> The row.
      integer, intent(in) :: i
      differs = i == 1
      if (.not. differs) differs = any(qp%coarse%body(:, i) /= qp%coarse%body(:, i - 1))
    end function differs

    !> Whether a body has modes that are not neutral, all of one connected component. A body without neutral modes,
    !> rigid and held in one direction at a point beside the axis of a press fit, has motions that its partner keeps.
    logical function is_single(b)
      !> The body.
      integer, intent(in) :: b
      is_single = allocated(candidate(b)%basis) .and. candidate(b)%n < problem%modes(b)%n
      if (is_single) is_single = .not. problem%modes(b)%is_near_null()
      if (is_single) is_single = all(problem%modes(b)%components() == 1)
    end function is_single

    !> Give a body the motions of another one.
    subroutine take_motions(from, to)
      !> The bodies.
      integer, intent(in) :: from, to
      type(error_t), allocatable :: error
      real(dp), allocatable :: amplitude(:, :), own(:, :), rest(:, :), basis(:, :), cosine(:), turn(:, :)
      real(dp), allocatable :: value(:), vector(:, :)
      logical :: are_free
      integer :: n, n_modes, rank
      n = candidate(to)%n
      n_modes = problem%modes(to)%n
      associate (of_other => candidate(from)%basis(:, candidate(from)%n + 1:))
        if (size(of_other, 2) > n_modes - n) return
        call problem%modes(to)%rigid%amplitudes(problem%modes(from)%rigid%motions(of_other), amplitude, are_free)
        if (.not. are_free) return
        ! Motions of its own beside those of the other one, those farthest from them first.
        allocate (rest(n_modes, n_modes - n), basis(n_modes, n_modes), source=0.0_dp)
        call orthonormal_range(amplitude, dependent, rest, rank)
        own = candidate(to)%basis(:, n + 1:)
        allocate (value(n_modes - n), vector(n_modes - n, n_modes - n))
        call right_singular_vectors(own - matmul(rest, matmul(transpose(rest), own)), value, vector, error)
        if (allocated(error)) return
        call orthonormal_range(reshape([amplitude, matmul(own, vector)], [n_modes, size(of_other, 2) + n_modes - n]), &
                               dependent, rest, rank)
      end associate
      if (rank /= n_modes - n) return
      basis(:, :rank) = rest
      call complete_basis(basis, rank)
      basis = cshift(basis, rank, 2)
      allocate (cosine(n), turn(n, n))
      call right_singular_vectors(matmul(transpose(candidate(to)%basis(:, :n)), basis(:, :n)), cosine, turn, error)
      if (allocated(error)) return
      if (minval(cosine) < least_cosine) return
      candidate(to)%basis = basis
    end subroutine take_motions
  end subroutine keep_common_motions
end module dotyk_control_common_motions
