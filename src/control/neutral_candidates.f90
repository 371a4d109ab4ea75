!> The neutral modes of each floating body (`dotyk_scheme_neutral_modes`), the other bodies at rest, and how far a
!> solution moves along them and is out of balance there.
module dotyk_control_neutral_candidates
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_contact_problem, only: contact_problem_t, neutral_body_t
  use dotyk_linalg_dense, only: complete_basis, orthonormal_range, right_singular_vectors
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: item_t, share
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t, mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_neutral_modes, only: neutral_directions, touching_rows
  implicit none
  private

  !> The modes of a body, in an order of their own.
  type, public :: candidate_t
    !> Number of neutral modes, and of those that are held.
    integer :: n = 0, n_held = 0
    !> Orthonormal combinations of the modes as columns: those that are held, the other neutral ones, the rest (n_modes,
    !> n_modes).
    real(dp), allocatable :: basis(:, :)
    !> Orthonormal combinations along which contact resists no motion: the neutral ones of the basis together with the
    !> translations that were taken out of them. A body whose centroid is beside the axis of its spin translates by as
    !> much as it rotates (n_modes, n).
    real(dp), allocatable :: whole(:, :)
    !> Rows of the modes (rows of the body, n_modes) [].
    real(dp), allocatable :: g(:, :)
    !> Mean size of the facets that are about to touch [length].
    real(dp) :: element_size = 0
  end type candidate_t

  public :: find_candidates, find_left_over, floats, moved_beyond_others

  !> Motions along neutral modes that are larger than all other displacements by this factor have no cause but the
  !> errors of the mesh.
  real(dp), parameter :: without_cause = 3
  !> Loads of which contact resists less than half are lost [].
  real(dp), parameter :: most_resisted = 0.5_dp
  !> Fraction of the contact forces up to which they are within the uncertainty of the normals, as weights are beside
  !> the forces of a press fit [].
  real(dp), parameter :: least_lost = 1.0e-3_dp

contains

  !> The neutral modes of each body, the others at rest.
  subroutine find_candidates(problem, modes, coarse, qp, deviation, angle, stiffness, candidate, error)
    !> Bodies and their modes.
    type(contact_problem_t), intent(in) :: problem
    !> The modes at the contact nodes (n_bodies).
    type(contact_modes_t), intent(in) :: modes(:)
    !> Rows of all of them.
    type(coarse_space_t), intent(in) :: coarse
    !> The quadratic programme, the modes of tied bodies 0.
    type(contact_qp_t), intent(in) :: qp
    !> D by bodies, in the scale of the modes of the QP (n_bodies) [].
    type(mode_block_t), intent(in) :: deviation(:)
    !> Deviation of the normals of each row (n_rows) [].
    real(dp), intent(in) :: angle(:)
    !> Stiffness of the Winkler foundation; 0 for ties (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)
    !> Their modes, with the neutral ones first (n_bodies).
    type(candidate_t), intent(inout) :: candidate(:)
    !> As in `find` of `neutral_modes_t`.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: d(:, :)
    logical, allocatable :: touching(:)
    type(item_t) :: of_body(size(modes))
    real(dp), allocatable :: translation(:, :)
    integer, allocatable :: place(:)
    integer :: b, i, j
    allocate (touching(qp%n_rows))
    call touching_rows(qp, deviation, angle, stiffness, touching)
    call find_translations(problem, of_body)
    do b = 1, size(modes)
      if (.not. floats(modes(b))) cycle
      associate (row => qp%block(b)%row, scale => coarse%scale(coarse%first(b):coarse%first(b + 1) - 1), &
                 own => candidate(b))
        place = pack([(i, i=1, size(row))], touching(row) .and. stiffness(row) > 0)
        if (size(place) == 0) cycle
        own%element_size = sum(qp%weight(row(place))**(1.0_dp/(qp%dimension - 1)))/size(place)
        own%g = coarse%block(b)%value
        d = deviation(b)%value(place, :)
        do j = 1, size(scale)
          own%g(:, j) = own%g(:, j)/scale(j)
          d(:, j) = d(:, j)/scale(j)
        end do
        translation = reshape(of_body(b)%value, [size(scale), size(of_body(b)%value)/size(scale)])
        call find_directions(problem%modes(b)%components(), translation, own%g(place, :), d, qp%weight(row(place)), &
                             own%basis, own%n, own%whole, error)
        if (allocated(error)) return
      end associate
    end do
  end subroutine find_candidates

  !> Whether a body has rigid body modes.
  pure logical function floats(modes)
    !> The modes of the body.
    type(contact_modes_t), intent(in) :: modes
    floats = size(modes%resultant) > 0 .and. .not. allocated(modes%stiffness)
  end function floats

  !> An orthonormal basis of the modes of a body that begins with the neutral ones. Connected components of a body are
  !> treated one by one.
  subroutine find_directions(component, translation, g, d, weight, basis, n_neutral, whole, error)
    !> Connected component that each mode moves (n_modes).
    integer, intent(in) :: component(:)
    !> Amplitudes of the translations of the components; of no columns where they are not known (n_modes, dim) [].
    real(dp), intent(in) :: translation(:, :)
    !> Rows of G and D that are about to touch (n, n_modes) [].
    real(dp), intent(in) :: g(:, :), d(:, :)
    !> Weights of the rows (n) [area].
    real(dp), intent(in) :: weight(:)
    !> Basis as columns; no column mixes components (n_modes, n_modes) [].
    real(dp), allocatable, intent(out) :: basis(:, :)
    !> Number of neutral modes: the first ones of the basis.
    integer, intent(out) :: n_neutral
    !> The neutral ones with their translations: see `candidate_t` (n_modes, n) [].
    real(dp), allocatable, intent(out) :: whole(:, :)
    !> As in `find` of `neutral_modes_t`.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: direction(:, :), of_component(:, :), moving(:, :)
    integer, allocatable :: mode(:)
    integer :: p, i, n, last, n_whole
    allocate (basis(size(component), size(component)), moving(size(component), size(component)), source=0.0_dp)
    n_neutral = 0
    n_whole = 0
    last = size(component)
    do p = 1, maxval(component)
      mode = pack([(i, i=1, size(component))], component == p)
      if (size(mode) == 0) cycle
      call neutral_directions(g(:, mode), d(:, mode), weight, direction, error)
      if (allocated(error)) return
      moving(mode, n_whole + 1:n_whole + size(direction, 2)) = direction
      n_whole = n_whole + size(direction, 2)
      call leave_translations(translation(mode, :), direction, error)
      if (allocated(error)) return
      n = size(direction, 2)
      if (allocated(of_component)) deallocate (of_component)
      allocate (of_component(size(mode), size(mode)), source=0.0_dp)
      of_component(:, :n) = direction
      call complete_basis(of_component, n)
      basis(mode, n_neutral + 1:n_neutral + n) = of_component(:, :n)
      basis(mode, last - size(mode) + n + 1:last) = of_component(:, n + 1:)
      n_neutral = n_neutral + n
      last = last - size(mode) + n
    end do
    whole = moving(:, :n_whole)
  end subroutine find_directions

  !> Amplitudes of the translations in the modes of all bodies: ranks know the modes of their own bodies at all nodes.
  subroutine find_translations(problem, of_body)
    !> Bodies and their modes.
    type(contact_problem_t), intent(in) :: problem
    !> By modes and axes; nothing where bodies are split (n_bodies) [].
    type(item_t), intent(inout) :: of_body(:)
    real(dp), allocatable :: sums(:, :)
    integer, allocatable :: component(:), mode(:)
    integer :: b, k, p, n_nodes
    do b = 1, size(of_body)
      allocate (of_body(b)%value(0))
      if (problem%ranks%are_split() .or. .not. problem%ranks%is_own(b) .or. problem%modes(b)%n == 0) cycle
      if (problem%modes(b)%is_near_null()) cycle
      associate (shape => problem%modes(b)%shape)
        component = problem%modes(b)%components()
        sums = transpose(sum(shape, dim=2))
        ! In the orthonormal modes a translation of length 1 at n nodes has the norm of the root of n.
        do p = 1, maxval(component)
          mode = pack([(k, k=1, size(component))], component == p)
          n_nodes = count(any(any(abs(shape(:, :, mode)) > 0, dim=3), dim=1))
          sums(mode, :) = sums(mode, :)/sqrt(real(max(1, n_nodes), dp))
        end do
        of_body(b)%value = reshape(sums, [size(sums)])
      end associate
    end do
    if (n_ranks() > 1 .and. .not. problem%ranks%are_split()) call share(problem%ranks%owner, of_body)
  end subroutine find_translations

  !> Take out of neutral modes the translations that are not neutral themselves: a body whose spin is held may still
  !> translate, whichever the axis of the contact. Two bodies with a common motion that nothing resists keep it exactly.
  subroutine leave_translations(sums, direction, error)
    !> Amplitudes of the translations along the axes in the modes of a connected component, of length 1 where these have
    !> them (n_modes, dim) [].
    real(dp), intent(in) :: sums(:, :)
    !> Orthonormal combinations of them as columns (n_modes, n) [].
    real(dp), allocatable, intent(inout) :: direction(:, :)
    !> As in `find` of `neutral_modes_t`.
    type(error_t), allocatable, intent(out) :: error
    !> Cosines above these say that a direction is a translation, and that a translation is neutral.
    real(dp), parameter :: same = 1 - 1.0e-9_dp, neutral = 0.7_dp
    real(dp) :: value(size(sums, 2)), vector(size(sums, 2), size(sums, 2))
    real(dp), allocatable :: translation(:, :), cosine(:), turn(:, :), left(:, :)
    integer :: j, n
    if (size(direction, 2) == 0 .or. size(sums, 2) == 0) return
    call right_singular_vectors(sums, value, vector, error)
    if (allocated(error)) return
    n = count(value > same .and. value < 2 - same)
    translation = matmul(sums, vector(:, :n))
    allocate (cosine(n), turn(n, n), left(size(direction, 1), size(direction, 2)))
    call right_singular_vectors(matmul(transpose(direction), translation), cosine, turn, error)
    if (allocated(error)) return
    translation = matmul(translation, turn)
    left = direction
    do j = 1, n
      if (cosine(j) < neutral) left = left - matmul(translation(:, j:j), matmul(transpose(translation(:, j:j)), left))
    end do
    call orthonormal_range(left, 0.0_dp, direction, n)
  end subroutine leave_translations

  !> Bodies that move far along neutral modes where nothing else moves as far: a hinge that swings by mesh noise, less
  !> than its facets are long and more than anything yields.
  pure function moved_beyond_others(candidate, problem, qp, y, alpha) result(moved)
    !> Neutral modes of the bodies (n_bodies).
    type(candidate_t), intent(in) :: candidate(:)
    !> Bodies and their modes, those that are held in their basis.
    type(contact_problem_t), intent(in) :: problem
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Amplitudes of the modes of all bodies, body after body [length].
    real(dp), intent(in) :: alpha(:)
    !> (n_bodies)
    logical, allocatable :: moved(:)
    real(dp) :: neutral(size(candidate)), elastic(size(y)), other
    real(dp), allocatable :: amplitude(:), along(:)
    integer :: b, first, n
    call qp%mode_displacement(alpha/qp%coarse%scale, elastic)
    elastic = y + qp%gap - elastic
    other = maxval([0.0_dp, abs(elastic)])
    neutral = 0
    first = 1
    do b = 1, size(candidate)
      n = problem%modes(b)%n
      if (n == 0) cycle
      associate (own => candidate(b), shape => problem%modes(b)%shape)
        amplitude = alpha(first:first + n - 1)
        first = first + n
        if (problem%modes(b)%is_near_null()) cycle
        if (own%n > 0 .and. own%n_held == 0) then
          along = matmul(own%whole, matmul(amplitude, own%whole))
          neutral(b) = largest(shape, along)
          amplitude = amplitude - along
        end if
        other = max(other, largest(shape, amplitude))
      end associate
    end do
    moved = neutral > without_cause*other
  end function moved_beyond_others

  !> Largest displacement of a node.
  pure real(dp) function largest(shape, amplitude)
    !> Rigid body modes (dimension, n_nodes, n) [].
    real(dp), intent(in) :: shape(:, :, :)
    !> Amplitudes of the first ones (n_amplitudes <= n) [length].
    real(dp), intent(in) :: amplitude(:)
    real(dp) :: u(size(shape, 1))
    integer :: i, k
    largest = 0
    do i = 1, size(shape, 2)
      u = 0
      do k = 1, size(amplitude)
        u = u + amplitude(k)*shape(:, i, k)
      end do
      largest = max(largest, norm2(u))
    end do
  end function largest

  !> What is left of the equilibrium of a body along its neutral modes that are held.
  pure subroutine find_left_over(neutral, shape, lambda)
    !> Neutral modes of the body; there is one. Get what is left.
    type(neutral_body_t), intent(inout) :: neutral
    !> Modes of the body (dimension, n_nodes, n_modes) [].
    real(dp), intent(in) :: shape(:, :, :)
    !> Contact forces of the rows of the body (n) [force].
    real(dp), intent(in) :: lambda(:)
    real(dp) :: along(neutral%n), load
    neutral%left_over = 0
    neutral%lost_load = 0
    along = neutral%resultant - matmul(lambda, neutral%at_rows)
    if (norm2(along) > 0) neutral%left_over = force_along(along)/max(tiny(load), sum(lambda))
    if (.not. norm2(neutral%resultant) > 0) return
    if (dot_product(along, neutral%resultant) < most_resisted*sum(neutral%resultant**2)) return
    load = force_along(neutral%resultant)
    if (load > least_lost*sum(lambda)) neutral%lost_load = load

  contains

    !> The force at the farthest node that does the work of a resultant on its own direction [force].
    pure real(dp) function force_along(resultant)
      !> Along the modes (n) [force].
      real(dp), intent(in) :: resultant(:)
      force_along = sum(resultant**2)/largest(shape, resultant)
    end function force_along
  end subroutine find_left_over
end module dotyk_control_neutral_candidates
