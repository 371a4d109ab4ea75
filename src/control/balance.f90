!> Forces on the bodies of a solution: loads, contact forces, reactions of supports, and their equilibrium; strain
!> energies.
!>
!> Moments are those about the origin. In axisymmetric analyses forces are those on the full circumference along the
!> axis; radial components balance each other around it.
!>
!> Ties transmit a force and a moment on the slave body; bolts have a tension and a shortening.
module dotyk_control_balance
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_thresholds, only: half_digits
  use dotyk_contact_pair, only: pair_resultant, pair_resultant_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_elasticity_internal_force, only: find_reactions
  use dotyk_elasticity_load_report, only: load_resultant_t
  use dotyk_elasticity_support_directions, only: wrench
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_ranks_exchange, only: add_up, agree_on_error, item_t, share
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: find_balance, keep_shortenings

  type, public :: tie_force_t  !! Forces of one tie.
    type(pair_resultant_t) :: resultant  !! Force, moment about the origin, and radial force on the slave body.
    real(dp) :: tension = 0  !! Of a bolt: force on the slave body along the normal of the cut, out of it [force].
    real(dp) :: shortening = 0  !! Of a bolt: how far its halves overlap; NaN where nothing determines it [length].
  end type tie_force_t

  type, public :: body_balance_t  !! Forces on one body.
    type(load_resultant_t), allocatable :: support(:)  !! Resultants of its supports, then of its springs (n_supports).
    !> Resultants of all its loads, contact forces and reactions; those of the axis of symmetry are no forces.
    type(load_resultant_t) :: load, contact, reaction
    !> Strain energy A(u,u)/2, whatever the initial state, without its springs; energy of its springs [energy].
    real(dp) :: energy = 0, spring_energy = 0
    !> Motion of a rigid body: displacement of its point and rotation about it (6) [length, radian].
    real(dp) :: motion(6) = 0
    real(dp) :: force_scale = 0  !! Sum of the magnitudes of all nodal forces [force].
    real(dp) :: moment_scale = 0  !! Sum of their products with the distance to the origin [force length].
    !> Sum of the moments of all nodal forces about a point amid the body, and of their products with the distance to
    !> it (4) [force length].
    real(dp) :: about_centre(4) = 0
    !> Reactions at the nodes of this rank (dim, n_nodes) [force]; not allocated unless wanted.
    real(dp), allocatable :: nodal(:, :)
  end type body_balance_t

  type, public :: balance_t  !! Forces on all bodies.
    type(body_balance_t), allocatable :: body(:)  !! Not allocated where displacements are not known (n_bodies).
    !> Largest sum of all forces on a body, which would vanish in equilibrium, as a fraction of the largest
    !> `force_scale` [].
    real(dp) :: force_error = 0
    !> The same of the moments about points amid the bodies, however far they are from the origin; 0 in axisymmetric
    !> analyses [].
    real(dp) :: moment_error = 0
    !> Sum of the moments of the contact forces on all bodies, as a fraction of the sum of those of all nodal forces
    !> about points amid the bodies: action and reaction are not on one line; 0 with cyclic ties and in axisymmetric
    !> analyses [].
    real(dp) :: couple_error = 0
    integer :: worst = 0  !! The body with the largest sum of forces.
    type(tie_force_t), allocatable :: tie(:)  !! What ties transmit (n_ties).
  end type balance_t


  !> Places in the list of numbers of a body, before its supports: energies, scales, moments about its centre, the
  !> three resultants, and the motion of a rigid body.
  integer, parameter :: at_energy = 1, at_springs = 2, at_scales = 3, at_centre = 5, at_load = 9, at_contact = 15, &
                        at_reaction = 21, at_motion = 27, at_supports = 33

contains

  !> Forces on all bodies. All ranks take part.
  subroutine find_balance(problem, qp, pressure, penetration, solution, want_nodal, balance, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    logical, intent(in) :: want_nodal  !! Whether reactions at nodes are wanted.
    type(balance_t), intent(out) :: balance  !! The forces.
    !> Allocated where an element is inverted or the modulus field is not positive; assembly finds this first.
    type(error_t), allocatable, intent(out) :: error
    type(item_t), allocatable :: item(:)
    real(dp), allocatable :: all(:)
    integer :: b, n, first
    allocate (balance%body(size(problem%body)), item(size(problem%body)))
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      call body_numbers(problem%body(b), qp, b, pressure, solution(b), want_nodal, balance%body(b)%nodal, &
                        item(b)%value, error)
      if (allocated(error)) exit
    end do
    call agree_on_error(error)
    if (allocated(error)) return
    if (problem%ranks%are_split()) then
      all = [(item(b)%value, b=1, size(item))]
      call add_up(all)
      first = 0
      do b = 1, size(item)
        n = size(item(b)%value)
        item(b)%value = all(first + 1:first + n)
        first = first + n
      end do
    else
      call share(problem%ranks%owner, item)
    end if
    do b = 1, size(item)
      call take_numbers(problem%body(b), item(b)%value, balance%body(b))
    end do
    balance%tie = find_tie_forces(problem, pressure, penetration)
    call judge(balance)
    if (problem%n_ties() > 0) then
      if (any(abs(problem%tie%angle) > 0)) balance%couple_error = 0
    end if
  end subroutine find_balance

  !> Numbers of one body, of which each rank that computes it has a part.
  subroutine body_numbers(body, qp, b, pressure, solution, want_nodal, nodal, numbers, error)
    type(body_t), intent(in) :: body  !! The body.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    integer, intent(in) :: b  !! Index of the body.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    type(body_solution_t), intent(in) :: solution  !! Its displacements.
    logical, intent(in) :: want_nodal  !! Whether reactions at nodes are wanted.
    real(dp), allocatable, intent(out) :: nodal(:, :)  !! Reactions at nodes, where wanted (dim, n_nodes) [force].
    real(dp), allocatable, intent(out) :: numbers(:)  !! In the places `at_...` (32 + 6 n_supports).
    type(error_t), allocatable, intent(out) :: error  !! As in `find_balance`.
    real(dp), allocatable :: contact(:, :), reaction(:, :), of_support(:, :), load(:, :), pull(:, :)
    real(dp) :: scale(2), twice, centre(body%dimension), about_centre(4), own(6)
    integer :: n, n_fixed
    n_fixed = body%directions%n_supports()
    n = n_fixed + body%constraint%foundation%n_springs()
    allocate (numbers(at_supports - 1 + 6*n), of_support(6, n))
    call qp%body_force(b, pressure, contact)
    associate (node => qp%block(b)%contact_node, mesh => body%mesh)
      call find_reactions(body, solution%displacement, node, contact, reaction, error)
      if (allocated(error)) return
      numbers(at_energy) = solution%strain_energy
      if (.not. allocated(solution%stress)) numbers(at_energy) = strain_energy(body, solution%displacement)
      call body%directions%add_up_reactions(mesh, reaction, of_support(:, :n_fixed))
      numbers(at_springs) = 0
      numbers(at_motion:at_supports - 1) = 0
      load = body%load
      associate (springs => body%constraint%foundation)
        if (springs%n_springs() > 0) then
          ! Their far ends pull as reactions, not as loads.
          allocate (pull, source=0*load)
          call springs%add_loads(mesh%x, body%analysis, pull)
          load = load - pull
          twice = 0
          call springs%add_forces(mesh%x, body%analysis, -solution%displacement, pull, twice)
          if (.not. allocated(solution%stress)) numbers(at_energy) = numbers(at_energy) - twice/2
          reaction = reaction + pull
          call springs%add_up_reactions(mesh%x, body%analysis, solution%displacement, of_support(:, n_fixed + 1:), &
                                        numbers(at_springs))
        end if
      end associate
      if (body%constraint%rigid%is_set) then
        ! What balances the other forces is a reaction along held motions only; no node has it.
        of_support(:, 1) = body%constraint%rigid%reaction(of_support(:, 1))
        numbers(at_motion:at_supports - 1) = body%constraint%rigid%motion_of(mesh%x, solution%displacement)
        reaction = 0
      end if
      scale = 0
      about_centre = 0
      centre = centre_of(body)
      call add_forces(mesh, centre, load, numbers(at_load:at_contact - 1), scale, about_centre)
      call add_forces(mesh, centre, contact, numbers(at_contact:at_reaction - 1), scale, about_centre, node)
      call add_forces(mesh, centre, reaction, numbers(at_reaction:at_motion - 1), scale, about_centre)
      if (body%constraint%rigid%is_set) then
        numbers(at_reaction:at_motion - 1) = of_support(:, 1)
        own = of_support(:, 1) - wrench(centre, of_support(:body%dimension, 1))
        about_centre(:3) = about_centre(:3) + own(4:)
      end if
      numbers(at_scales:at_centre - 1) = scale
      numbers(at_centre:at_load - 1) = about_centre
      numbers(at_supports:) = reshape(of_support, [6*n])
    end associate
    if (want_nodal) call move_alloc(reaction, nodal)
  end subroutine body_numbers

  !> A point amid a body, the same on all ranks: the mean of the nodes that all of them hold (dim) [length].
  pure function centre_of(body) result(centre)
    type(body_t), intent(in) :: body  !! The body.
    real(dp) :: centre(body%dimension)
    if (body%mesh%is_in_parts() .and. allocated(body%shared_node)) then
      centre = sum(body%mesh%x(:, body%shared_node), dim=2)/max(1, size(body%shared_node))
    else
      centre = sum(body%mesh%x, dim=2)/max(1, body%mesh%n_nodes())
    end if
  end function centre_of

  !> Resultant of the forces on own nodes, and their size.
  subroutine add_forces(mesh, centre, force, resultant, scale, about_centre, node)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(in) :: centre(:)  !! A point amid the body (dim) [length].
    real(dp), intent(in) :: force(:, :)  !! Forces (dim, n) [force].
    real(dp), intent(out) :: resultant(6)  !! Force and moment about the origin (6) [force, force length].
    real(dp), intent(inout) :: scale(2)  !! Sums of magnitudes, added to (2) [force, force length].
    !> Moment about the point, and the sum of magnitudes, added to (4) [force length].
    real(dp), intent(inout) :: about_centre(4)
    integer, intent(in), optional :: node(:)  !! Nodes of the forces; all nodes if absent (n).
    real(dp) :: own(6)
    integer :: i, k
    resultant = 0
    do i = 1, size(force, 2)
      k = i
      if (present(node)) k = node(i)
      if (.not. any(abs(force(:, i)) > 0)) cycle
      if (.not. mesh%is_own_node(k)) cycle
      resultant = resultant + wrench(mesh%x(:, k), force(:, i))
      scale = scale + norm2(force(:, i))*[1.0_dp, norm2(mesh%x(:, k))]
      own = wrench(mesh%x(:, k) - centre, force(:, i))
      about_centre = about_centre + [own(4:), norm2(force(:, i))*norm2(mesh%x(:, k) - centre)]
    end do
  end subroutine add_forces

  !> Name the numbers of a body.
  subroutine take_numbers(body, numbers, balance)
    type(body_t), intent(in) :: body  !! The body.
    real(dp), intent(in) :: numbers(:)  !! In the places `at_...` (32 + 6 n_supports).
    type(body_balance_t), intent(inout) :: balance  !! Forces on the body.
    logical :: around
    integer :: s, n_fixed
    around = body%analysis == analysis_axisymmetric
    balance%energy = numbers(at_energy)
    balance%spring_energy = numbers(at_springs)
    balance%force_scale = numbers(at_scales)
    balance%moment_scale = numbers(at_scales + 1)
    if (.not. around) balance%about_centre = numbers(at_centre:at_load - 1)
    balance%load = named('loads', numbers(at_load:at_contact - 1), around)
    balance%contact = named('contact', numbers(at_contact:at_reaction - 1), around)
    balance%reaction = named('reactions', numbers(at_reaction:at_motion - 1), around)
    balance%motion = numbers(at_motion:at_supports - 1)
    n_fixed = body%directions%n_supports()
    allocate (balance%support(n_fixed + body%constraint%foundation%n_springs()))
    do s = 1, size(balance%support)
      associate (sums => numbers(at_supports + 6*(s - 1):at_supports + 6*s - 1))
        if (s > n_fixed) then
          balance%support(s) = named(body%constraint%foundation%place(s - n_fixed)%s//' (spring)', sums, around)
        else
          balance%support(s) = named(body%directions%place(s)%s, sums, around)
          if (allocated(body%directions%is_concentrated)) &
            balance%support(s)%is_concentrated = body%directions%is_concentrated(s)
        end if
      end associate
    end do
  end subroutine take_numbers

  !> A resultant from sums over nodes.
  pure function named(place, sums, axisymmetric) result(resultant)
    character(*), intent(in) :: place  !! Where it acts.
    real(dp), intent(in) :: sums(6)  !! Force and moment about the origin (6) [force, force length].
    logical, intent(in) :: axisymmetric  !! Whether the first component of the force is radial.
    type(load_resultant_t) :: resultant
    resultant%place = place
    resultant%force = sums(1:3)
    if (axisymmetric) then
      resultant%radial = sums(1)
      resultant%force(1) = 0
    else
      resultant%moment = sums(4:6)
    end if
  end function named

  !> What is left of the equilibrium.
  pure subroutine judge(balance)
    type(balance_t), intent(inout) :: balance  !! With the forces on all bodies; gets the errors.
    real(dp), dimension(size(balance%body)) :: force, moment
    real(dp) :: couple(3)
    integer :: b
    do b = 1, size(balance%body)
      associate (of => balance%body(b))
        force(b) = norm2(of%load%force + of%contact%force + of%reaction%force)
        moment(b) = norm2(of%about_centre(:3))
      end associate
    end do
    balance%worst = maxloc(force, 1)
    balance%force_error = maxval(force)/max(tiny(1.0_dp), maxval(balance%body%force_scale))
    couple = 0
    do b = 1, size(balance%body)
      couple = couple + balance%body(b)%contact%moment
    end do
    balance%couple_error = norm2(couple)/max(tiny(1.0_dp), sum(balance%body%about_centre(4)))
    balance%moment_error = maxval(moment)/max(tiny(1.0_dp), maxval(balance%body%about_centre(4)))
  end subroutine judge

  !> Forces of all ties.
  function find_tie_forces(problem, pressure, penetration) result(of_tie)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, pairs and ties, with the shortenings of the solution.
    !> Pressures of the contact rows and tractions of the ties after them (n_rows) [pressure].
    real(dp), intent(in) :: pressure(:)
    real(dp), intent(in) :: penetration(:)  !! B u - d of the same rows (n_rows) [length].
    type(tie_force_t), allocatable :: of_tie(:)  !! (n_ties).
    type(pair_resultant_t) :: part
    integer :: c, k, n
    allocate (of_tie(problem%n_ties()))
    n = sum(problem%pair%n_rows)
    do k = 1, size(of_tie)
      associate (tie => problem%tie(k), all => of_tie(k)%resultant)
        do c = 1, size(tie%component)
          associate (rows => tie%component(c), last => n + tie%component(c)%n_rows)
            part = pair_resultant(rows, problem%body(rows%body_a)%analysis == analysis_axisymmetric, &
                                  pressure(n + 1:last))
            all%force = all%force + part%force
            all%moment = all%moment + part%moment
            all%radial = all%radial + part%radial
            of_tie(k)%shortening = of_tie(k)%shortening + &
              tie%normal(c)*sum(rows%row_weight*(penetration(n + 1:last) + rows%row_gap))/sum(rows%row_weight)
            n = last
          end associate
        end do
        if (tie%slides) of_tie(k)%shortening = tie%shortening
        if (tie%is_free) of_tie(k)%shortening = ieee_value(tie%shortening, ieee_quiet_nan)
        of_tie(k)%tension = dot_product(all%force, tie%normal)
      end associate
    end do
  end function find_tie_forces

  !> Keep how far bolts that slide are shortened, for the load cases in which they are locked.
  subroutine keep_shortenings(state, problem)
    type(solver_state_t), intent(in) :: state  !! With amplitudes of all modes.
    type(contact_problem_t), intent(inout) :: problem  !! Its bolts that slide get their shortenings.
    real(dp) :: motion(size(state%alpha))
    integer :: i, k, j, first(size(problem%body) + 1), n_before(size(problem%body))
    if (problem%n_ties() == 0) return
    first = first_mode(problem%modes, problem%tie)
    n_before = problem%modes%n
    do k = 1, size(problem%tie)
      associate (tie => problem%tie(k), b => problem%tie(k)%component(1)%body_a)
        tie%is_free = .false.
        if (.not. tie%slides) cycle
        i = first(b) + n_before(b)
        n_before(b) = n_before(b) + 1
        tie%shortening = state%alpha(i)
        do j = 1, state%indeterminate%n
          call state%indeterminate%get(j, motion)
          if (abs(motion(i)) > half_digits*maxval(abs(motion))) tie%is_free = .true.
        end do
      end associate
    end do
  end subroutine keep_shortenings
end module dotyk_control_balance
