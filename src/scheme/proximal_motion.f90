!> Motions of floating bodies by the proximal point method (Rockafellar, SIAM J. Control Optim. 14, 1976), that is
!> iterated Tikhonov regularization: the weak springs of engineers, whose feet follow the bodies.
!>
!> The QP gets the term `(alpha - alpha_k)^T T (alpha - alpha_k)/2` on the amplitudes of the rigid body modes, T a small
!> fraction of the contact stiffness in the metric of the mean square displacement of each body, and is solved again
!> with alpha_k moved up. A motion that contact resists by the stiffness k converges like `(T/(T + k))^n`; one that
!> nothing resists keeps the least motion within all inequalities. Where a body goes on moving, its springs are
!> weakened along that motion: it travels until it touches, or contact resists it more weakly than the springs did.
!> When more rows than ever become active, the springs are as strong as before.
!>
!> What the springs carry is the imbalance `r = T (alpha_{k+1} - alpha_k)` of the body. The iteration ends when it is
!> rounding, or no more than `max_unbalanced` of the forces on a body that goes on moving along a direction in which the
!> rows G resist by no more than they are uncertain (`deviation` of `dotyk_scheme_coarse_space`), and along which loads
!> do not act: contact does not determine such a motion. Where it is far, and other bodies at rest would resist it no
!> more, the body is brought back, and its springs become nearly as stiff as the contact there.
!>
!> Bodies that ties join are one: they have no springs where ties, springs and supports resist all their motions, and
!> what resists one of them is what resists all together. Shortenings of bolts have none.
module dotyk_scheme_proximal_motion
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: half_digits, least_gain, one_digit, rounding
  use dotyk_linalg_dense, only: orthonormal_range, symmetric_eigen
  use dotyk_scheme_coarse_space, only: coarse_space_t, mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_tied_groups, only: find_held_groups
  implicit none
  private
  public :: stiff_part

  type, public :: proximal_motion_t  !! The springs.
    !> T by bodies; of size 0 for bodies without modes, those whose modes have a stiffness, and those that ties hold
    !> (n_bodies).
    type(mode_block_t), allocatable :: stiffness(:)
    real(dp), allocatable :: centre(:)  !! alpha_k: where the feet of the springs are (n_modes) [length].
    real(dp), allocatable :: imbalance(:)  !! T (alpha_{k+1} - alpha_k) of the last step (n_modes) [force].
    !> Imbalance of each body as a fraction of the forces on it, where it is more than rounding, and without what the
    !> uncertainty of the normals explains (n_bodies) [].
    real(dp), allocatable :: rest(:), excess(:)
    real(dp) :: most = 0  !! Greatest force of all steps: what is rounding of it is none [force].
    integer :: n_steps = 0  !! Number of steps so far.
    logical :: has_changed = .true.  !! Whether T is another one than in the last step.
    !> Motions that are held, by bodies: rows resist them by no more than they are uncertain.
    !> Orthonormal in the mean square displacement (modes of the body, number of directions) [].
    type(mode_block_t), allocatable :: held(:)
    !> The same, rotations about the centre of the body: what loads act along (modes, number of directions) [].
    type(mode_block_t), allocatable, private :: loaded(:)
    !> Size of the imbalance of the last step by bodies; negative before it (n_bodies) [force].
    real(dp), allocatable, private :: last(:)
    integer, allocatable, private :: n_active(:)  !! Most active rows of each body so far (n_bodies).
    !> Group of bodies that ties join, of each body (n_bodies); those that ties hold (n_groups).
    integer, allocatable :: group(:)
    logical, allocatable :: is_held(:)
  contains
    procedure :: init => motion_init
    procedure :: apply => motion_apply
    procedure :: advance => motion_advance
  end type proximal_motion_t

  real(dp), parameter, public :: fraction = 1.0e-6_dp  !! Stiffness of the springs as a fraction of that of the contact.
  !> Springs are weakened by this factor along a motion that goes on, until they are rounding of the contact.
  real(dp), parameter :: weakening = 0.1_dp
  !> Stiffness of the springs of a body that is brought back, as a fraction of that of the contact: what contact
  !> resists converges a hundredfold in each step.
  real(dp), parameter :: brought_back = 0.01_dp
  !> Rows resist a motion by no more than they are uncertain if the uncertainty is at least this fraction of the
  !> resistance: 1 is a spin on facets, 1.04/0.04 a motion along a race with an osculation of 52 %.
  real(dp), parameter, public :: uncertain = 0.5_dp
  !> Directions that are held from the first step on are spins: nothing but facets resists them. They are rotations by
  !> more than this fraction.
  real(dp), parameter :: spins = 0.9_dp, half = 0.5_dp
  !> Loads act along a motion where they do more than this part of the work that they could do at all [].
  real(dp), parameter :: acting = one_digit
  real(dp), parameter :: far = 10  !! A body moves far that moves by more than this times the approach of its contact.
  integer, parameter :: most_steps = 60  !! Steps at most.

contains

  !> The first springs, with their feet at given amplitudes.
  subroutine motion_init(self, qp, foundation, active, near, alpha)
    class(proximal_motion_t), intent(out) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    !> Stiffness of the Winkler foundation that stands for the bodies (n_rows) [force/length].
    real(dp), intent(in) :: foundation(:)
    logical, intent(in) :: active(:)  !! Rows that are expected to be active (n_rows).
    !> Rows that may become active. Others tell nothing of spins: a body would have to turn far before they touch
    !> (n_rows).
    logical, intent(in) :: near(:)
    real(dp), intent(in) :: alpha(:)  !! (n_modes) [length]
    integer :: b
    call find_held_groups(qp, foundation, self%group, self%is_held)
    associate (n_bodies => size(qp%block))
      allocate (self%stiffness(n_bodies), self%n_active(n_bodies))
      allocate (self%rest(n_bodies), self%excess(n_bodies), source=0.0_dp)
      allocate (self%last(n_bodies), source=-1.0_dp)
      allocate (self%held(n_bodies), self%loaded(n_bodies))
      do b = 1, n_bodies
        self%stiffness(b)%value = springs_of(qp, b, foundation, active)
        if (self%is_held(self%group(b))) deallocate (self%stiffness(b)%value)
        if (self%is_held(self%group(b))) allocate (self%stiffness(b)%value(0, 0))
        self%n_active(b) = count(active(qp%block(b)%row))
        call find_uncertain(qp, b, merge(foundation, 0.0_dp, near), self%stiffness(b)%value, self%held(b)%value, &
                            self%loaded(b)%value)
        call hold(self%held(b)%value, self%stiffness(b)%value)
      end do
    end associate
    self%centre = alpha
    self%imbalance = 0*alpha
  end subroutine motion_init

  !> The first springs of a body.
  pure function springs_of(qp, b, foundation, active) result(stiffness)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: foundation(:)  !! Stiffness of the foundation (n_rows) [force/length].
    !> Rows that the stiffness of the contact is that of; all of the body if it has none of them (n_rows).
    logical, intent(in) :: active(:)
    real(dp), allocatable :: stiffness(:, :)  !! (modes of the body, the same) [force/length]
    real(dp) :: contact
    integer :: j
    associate (row => qp%block(b)%row, first => qp%coarse%first(b), n => qp%coarse%first(b + 1) - qp%coarse%first(b))
      if (qp%coarse%has_stiffness(b) .or. n == 0) then
        allocate (stiffness(0, 0))
        return
      end if
      contact = sum(foundation(row), mask=active(row) .and. .not. qp%is_tied(row))
      if (.not. contact > 0) contact = sum(foundation(row))
      if (.not. (contact > 0 .and. contact <= huge(contact))) contact = 1
      allocate (stiffness(n, n), source=0.0_dp)
      do j = 1, n
        if (.not. qp%coarse%is_slide(first + j - 1)) &
          stiffness(j, j) = fraction*contact*qp%coarse%mean_square(first + j - 1)
      end do
    end associate
  end function springs_of

  !> Rotations that all rows of a body together resist by no more than they are uncertain: the spins of a ball, of a
  !> shaft in its bore. Springs against them carry moments alone.
  subroutine find_uncertain(qp, b, foundation, springs, direction, loaded)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: foundation(:)  !! Stiffness of the foundation (n_rows) [force/length].
    real(dp), intent(in) :: springs(:, :)  !! The springs of the body (modes, modes) [force/length].
    !> Orthonormal in the mean square displacement (modes, number of directions) [].
    real(dp), allocatable, intent(out) :: direction(:, :)
    !> The same, rotations about the centre (modes, number of directions) [].
    real(dp), allocatable, intent(out) :: loaded(:, :)
    type(error_t), allocatable :: error
    real(dp), allocatable :: root(:), g(:, :), d(:, :), values(:), vectors(:, :), q(:, :), columns(:, :)
    integer :: k, n, n_translations, rank
    n = size(springs, 1)
    allocate (direction(n, 0), loaded(n, 0))
    if (n == 0 .or. .not. allocated(qp%coarse%deviation)) return
    associate (first => qp%coarse%first(b), row => qp%block(b)%row)
      if (size(row) == 0 .or. size(qp%coarse%translation(b)%value, 1) /= n) return
      if (size(qp%coarse%translation(b)%value, 2) == 0) return
      root = sqrt(qp%coarse%mean_square(first:first + n - 1))
      g = spread(sqrt(foundation(row)), 2, n)*qp%coarse%block(b)%value/spread(root, 1, size(row))
      d = spread(sqrt(foundation(row)), 2, n)*qp%coarse%deviation(b)%value/spread(root, 1, size(row))
      if (.not. maxval(abs(d)) > 0) return
      allocate (values(n), vectors(n, n), q(n, n))
      call symmetric_eigen(matmul(transpose(g), g) - matmul(transpose(d), d)/spins**2, values, vectors, error)
      if (allocated(error)) return
      columns = qp%coarse%translation(b)%value(:, :3)*spread(root, 2, 3)
      ! What is left of translations that supports hold is rounding.
      columns(:, pack([1, 2, 3], norm2(columns, 1) < half*maxval(norm2(columns, 1)))) = 0
      call orthonormal_range(columns, half, q, n_translations)
      associate (found => vectors(:, :count(values < 0)), translation => q(:, :n_translations))
        columns = found - matmul(translation, matmul(transpose(translation), found))
        columns(:, pack([(k, k=1, size(found, 2))], norm2(columns, 1) < half)) = 0
      end associate
      call orthonormal_range(columns, half, q, rank)
      direction = q(:, :rank)/spread(root, 2, rank)
      ! Nodes are not centred: the weight of a body has a moment about their mean.
      associate (unit => qp%coarse%translation(b)%value(:, :3), of_centre => qp%coarse%translation(b)%value(:, 4:6))
        loaded = direction - matmul(unit, matmul(transpose(of_centre), direction))
      end associate
    end associate
  end subroutine find_uncertain

  !> Springs as stiff as the contact in some directions.
  pure subroutine hold(direction, springs)
    !> Orthonormal in the mean square displacement (modes, number of directions) [].
    real(dp), intent(in) :: direction(:, :)
    real(dp), intent(inout) :: springs(:, :)  !! Its first springs in; stiffer on return (modes, modes) [force/length].
    if (size(direction) > 0) springs = springs + stiff_part(direction, springs)/fraction
  end subroutine hold

  !> The part of springs that acts in some directions.
  pure function stiff_part(direction, springs) result(part)
    real(dp), intent(in) :: direction(:, :)  !! As in `hold`.
    real(dp), intent(in) :: springs(:, :)  !! As stiff in all of these directions (modes, modes) [force/length].
    real(dp) :: part(size(springs, 1), size(springs, 1))
    real(dp) :: force(size(springs, 1), size(direction, 2))
    force = matmul(springs, direction)
    part = matmul(force, transpose(force))/dot_product(direction(:, 1), force(:, 1))
  end function stiff_part

  !> The QP with the springs, of which nothing else may change between the steps.
  subroutine motion_apply(self, qp, with_springs)
    class(proximal_motion_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    type(contact_qp_t), intent(inout) :: with_springs  !! Its copy; gets stiffness and resultants of the springs.
    type(coarse_space_t) :: coarse
    integer :: b
    coarse = qp%coarse
    if (.not. allocated(coarse%stiffness)) then
      allocate (coarse%stiffness(size(qp%block)))
      do b = 1, size(qp%block)
        associate (n => coarse%first(b + 1) - coarse%first(b))
          allocate (coarse%stiffness(b)%value(n, n), source=0.0_dp)
        end associate
      end do
    end if
    do b = 1, size(qp%block)
      if (size(self%stiffness(b)%value) == 0) cycle
      associate (first => coarse%first(b), last => coarse%first(b + 1) - 1)
        coarse%stiffness(b)%value = coarse%stiffness(b)%value + self%stiffness(b)%value
        coarse%resultant(first:last) = coarse%resultant(first:last) + &
          matmul(self%stiffness(b)%value, self%centre(first:last))
      end associate
    end do
    call with_springs%replace_modes(coarse)
  end subroutine motion_apply

  !> Move the feet of the springs to the bodies, and decide whether they are to be moved again.
  subroutine motion_advance(self, qp, foundation, lambda, alpha, active, done)
    class(proximal_motion_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    real(dp), intent(in) :: foundation(:)  !! Stiffness of the foundation (n_rows) [force/length].
    real(dp), intent(in) :: lambda(:)  !! Contact forces with the springs (n_rows) [force].
    real(dp), intent(in) :: alpha(:)  !! Amplitudes with the springs (n_modes) [length].
    logical, intent(in) :: active(:)  !! Active rows (n_rows).
    !> Whether all bodies are in equilibrium, or contact does not determine what they go on doing.
    logical, intent(out) :: done
    real(dp) :: before(size(alpha)), step(size(alpha)), force(size(alpha))
    real(dp) :: moved(qp%n_rows), uncertainty(qp%n_rows)
    real(dp), dimension(size(self%is_held)) :: resisted, alone, doubted, weight, whole, work, most_work, on_group
    real(dp) :: greatest, size_now
    logical :: goes_on, may_rest, is_free
    integer :: b, n_active
    done = .true.
    self%has_changed = .false.
    before = self%centre
    step = alpha - self%centre
    self%centre = alpha
    self%n_steps = self%n_steps + 1
    greatest = maxval([0.0_dp, abs(lambda), abs(qp%coarse%resultant)])
    self%most = max(self%most, greatest)
    self%rest = 0
    self%excess = 0
    call find_forces()
    do b = 1, size(qp%block)
      if (size(self%stiffness(b)%value) > 0) call judge_held()
    end do
    call qp%mode_displacement(step, moved)
    call find_uncertainty(qp, step, uncertainty)
    call measure_groups()
    do b = 1, size(qp%block)
      associate (springs => self%stiffness(b)%value, row => qp%block(b)%row, &
                 first => qp%coarse%first(b), last => qp%coarse%first(b + 1) - 1)
        if (size(springs) == 0) cycle
        force(first:last) = matmul(springs, step(first:last))
        size_now = maxval(abs(force(first:last)))
        ! Contact resists the motion by less than the springs do.
        goes_on = self%last(b) >= 0 .and. .not. size_now < least_gain*self%last(b)
        self%last(b) = size_now
        n_active = count(active(row))
        if (size_now > rounding*self%most .and. .not. (goes_on .and. size_now <= half_digits*greatest)) then
          associate (g => self%group(b))
            self%rest(b) = max(self%rest(b), size_now/on_group(g))
            self%excess(b) = max(self%excess(b), size_now/on_group(g))
            is_free = is_uncertain(alone(g), g) .and. whole(g)*weight(g)**2 > (far*on_group(g))**2
            may_rest = is_uncertain(resisted(g), g)
            if (goes_on .and. may_rest .and. abs(work(g)) > acting*most_work(g)) &
              self%excess(b) = max(self%excess(b), abs(work(g))/most_work(g))
            may_rest = may_rest .and. self%excess(b) <= qp%coarse%max_unbalanced
          end associate
          if (.not. goes_on) then
            done = .false.
          else if (.not. may_rest) then
            if (may_change(stiffer=.false.)) done = .false.
          else if (is_free) then
            if (may_change(stiffer=.true.)) done = .false.
          end if
        end if
        ! A body that has met others: what these do not resist is held as before.
        if (n_active > self%n_active(b)) then
          springs = springs_of(qp, b, foundation, active)
          call hold(self%held(b)%value, springs)
          self%last(b) = -1
          self%has_changed = .true.
        end if
        self%n_active(b) = max(self%n_active(b), n_active)
      end associate
    end do
    if (self%n_steps >= most_steps) done = .true.

  contains

    !> The greatest force on a body of each group.
    subroutine find_forces()
      integer :: body
      on_group = max(half_digits*greatest, tiny(greatest))
      do body = 1, size(qp%block)
        associate (row => qp%block(body)%row, first => qp%coarse%first(body), last => qp%coarse%first(body + 1) - 1, &
                   g => self%group(body))
          on_group(g) = max(on_group(g), sum(abs(lambda(row)), mask=.not. qp%is_tied(row)), &
                            maxval([0.0_dp, abs(qp%coarse%resultant(first:last))]))
        end associate
      end do
    end subroutine find_forces

    !> Forces of the springs of body b; in directions that are held their feet stay, and the step is without these. A
    !> direction is released where loads act along it, or the springs carry more than the uncertainty of the normals
    !> makes of the contact forces.
    subroutine judge_held()
      real(dp), allocatable :: held(:, :), carried(:), uncertain_part(:), load(:), most_load(:)
      integer, allocatable :: kept(:)
      integer :: j
      associate (row => qp%block(b)%row, on_body => on_group(self%group(b)), first => qp%coarse%first(b), &
                 last => qp%coarse%first(b + 1) - 1)
        self%imbalance(first:last) = matmul(self%stiffness(b)%value, step(first:last))
        held = self%held(b)%value
        if (size(held) == 0) return
        carried = matmul(self%imbalance(first:last), held)/on_body
        associate (mean => qp%coarse%mean_square(first:last))
          step(first:last) = step(first:last) - matmul(held, matmul(mean*step(first:last), held))
          self%centre(first:last) = before(first:last) + step(first:last)
        end associate
        self%rest(b) = norm2(carried)
        uncertain_part = [(sum(abs(lambda(row)*matmul(qp%coarse%deviation(b)%value, held(:, j)))), &
                           j=1, size(held, 2))]/(uncertain*on_body)
        self%excess(b) = maxval([0.0_dp, abs(carried) - uncertain_part])
        load = abs(matmul(qp%coarse%resultant(first:last), self%loaded(b)%value))
        most_load = matmul(qp%coarse%resultant_size(first:last), abs(self%loaded(b)%value))
        ! The axis of the spin is known roughly, and so is the moment of the loads: none that springs do not carry.
        carried = max(abs(carried) - uncertain_part, min(abs(carried), load/on_body))
        kept = pack([(j, j=1, size(carried))], .not. (carried > qp%coarse%max_unbalanced .or. load > acting*most_load))
        if (size(kept) == size(carried)) return
        self%held(b)%value = held(:, kept)
        held = self%loaded(b)%value(:, kept)
        self%loaded(b)%value = held
        self%stiffness(b)%value = springs_of(qp, b, foundation, active)
        call hold(self%held(b)%value, self%stiffness(b)%value)
        self%last(b) = -1
        self%has_changed = .true.
        done = .false.
      end associate
    end subroutine judge_held

    !> Whether rows resist the step of a group by no more than they are uncertain.
    pure logical function is_uncertain(resistance, g)
      real(dp), intent(in) :: resistance  !! Of these rows [energy].
      integer, intent(in) :: g  !! The group.
      is_uncertain = resistance <= rounding*weight(g)*whole(g) .or. doubted(g) >= uncertain**2*resistance
    end function is_uncertain

    !> By how much the active rows of each group of bodies that ties join resist the step, by how much they would if the
    !> other bodies were at rest, and by how much they are uncertain; the work of the loads.
    subroutine measure_groups()
      real(dp) :: own(qp%n_rows)
      integer :: body, n
      resisted = 0
      alone = 0
      doubted = 0
      weight = 0
      whole = 0
      work = 0
      most_work = 0
      do body = 1, size(qp%block)
        associate (row => qp%block(body)%row, first => qp%coarse%first(body), last => qp%coarse%first(body + 1) - 1, &
                   g => self%group(body))
          n = size(row)
          own(:n) = matmul(qp%coarse%block(body)%value, step(first:last))
          where (qp%is_tied(row)) own(:n) = moved(row)
          weight(g) = weight(g) + sum(foundation(row), mask=active(row))
          resisted(g) = resisted(g) + sum(foundation(row)*moved(row)**2, mask=active(row))
          alone(g) = alone(g) + sum(foundation(row)*own(:n)**2, mask=active(row))
          doubted(g) = doubted(g) + sum(foundation(row)*uncertainty(row)**2, mask=active(row))
          whole(g) = whole(g) + sum(qp%coarse%mean_square(first:last)*step(first:last)**2)
          work(g) = work(g) + dot_product(qp%coarse%resultant(first:last), step(first:last))
          most_work(g) = most_work(g) + dot_product(qp%coarse%resultant_size(first:last), abs(step(first:last)))
        end associate
      end do
    end subroutine measure_groups

    !> Make the springs of the body weaker along its step; or bring it back, and make them nearly as stiff as the
    !> contact is. False where they are so already.
    logical function may_change(stiffer) result(may)
      logical, intent(in) :: stiffer  !! Whether they become stiffer.
      real(dp), allocatable :: first_springs(:, :)
      real(dp) :: along, at_first, next
      associate (first => qp%coarse%first(b), last => qp%coarse%first(b + 1) - 1, springs => self%stiffness(b)%value)
        along = dot_product(step(first:last), force(first:last))
        first_springs = springs_of(qp, b, foundation, active)
        at_first = dot_product(step(first:last), matmul(first_springs, step(first:last)))
        if (stiffer) then
          next = brought_back*at_first/fraction
          may = along < least_gain*next
        else
          may = fraction*along > epsilon(along)*at_first
          next = weakening*along
        end if
        if (.not. may) return
        if (stiffer) then
          self%centre(first:last) = self%centre(first:last) - &
            step(first:last)*(dot_product(force(first:last), self%centre(first:last))/along)
          ! Rows that become active again do not restore its springs.
          self%n_active(b) = size(qp%block(b)%row)
        end if
        springs = springs + (next - along)/along**2*matmul(reshape(force(first:last), [last - first + 1, 1]), &
                                                           reshape(force(first:last), [1, last - first + 1]))
        self%last(b) = -1
        self%has_changed = .true.
      end associate
    end function may_change
  end subroutine motion_advance

  !> How uncertain the displacements of the rows by a motion are.
  pure subroutine find_uncertainty(qp, alpha, z)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    real(dp), intent(in) :: alpha(:)  !! The motion (n_modes) [length].
    real(dp), intent(out) :: z(:)  !! (n_rows) [length]
    integer :: b, j
    z = 0
    if (.not. allocated(qp%coarse%deviation)) return
    do b = 1, size(qp%block)
      associate (row => qp%block(b)%row, d => qp%coarse%deviation(b)%value)
        do j = 1, size(d, 2)
          z(row) = z(row) + alpha(qp%coarse%first(b) + j - 1)*d(:, j)
        end do
      end associate
    end do
  end subroutine find_uncertainty
end module dotyk_scheme_proximal_motion
