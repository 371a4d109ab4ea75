!> The head of the log: title, tables of bodies and contact pairs, nearly incompressible bodies, factorization and
!> memory.
module dotyk_log_scene_tables
  use dotyk_base_directions, only: directions_t
  use dotyk_base_files, only: is_cad_file
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: log_t, most_shown
  use dotyk_base_memory, only: memory_text
  use dotyk_base_options, only: analysis_names, analysis_plane_stress, discretization_quadrature, locking_ignore, &
    option_name
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_base_version, only: version
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_contact_problem, only: contact_problem_t, mesh_compliance
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_response_choice, only: form_multigrid, form_split, keeps_factor
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_material, only: least_compressible
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_input_case, only: case_t
  use dotyk_log_found_pairs, only: body_names, show_found
  use dotyk_log_case_tables, only: show_loads
  use dotyk_log_timing, only: duration
  use dotyk_log_tie_tables, only: show_ties
  use dotyk_mesh_order_elevation, only: has_linear_simplices
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: show_title, show_scene, show_factorization, show_memory

  integer, parameter :: width_of_material = 14  !! Letters of the names of materials in the table of bodies.

  !> Greatest Young's modulus in units that go with mm: of diamond, in kPa [pressure].
  real(dp), parameter :: greatest_modulus = 2.0e9_dp

contains

  !> Program, title, and size of the scene.
  subroutine show_title(log, case, threads)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: threads  !! Number of threads.
    character(:), allocatable :: title, pairs, ranks
    integer :: i, k, n
    title = case%scene%title
    if (len(title) == 0) title = case%file
    pairs = counted(size(case%contact), 'contact pair')
    ! Of the halves of a body that is cut, one has the surface: both have the name of the tie.
    n = 0
    do k = 1, size(case%tie)
      if (.not. any([(case%tie(i)%name == case%tie(k)%name, i=1, k - 1)])) n = n + 1
    end do
    if (n > 0) pairs = pairs//', '//counted(n, 'tie')
    if (any(case%contact%searched)) pairs = 'search for contact pairs'
    ranks = ''
    if (n_ranks() > 1) ranks = counted(n_ranks(), 'rank')//' of '
    call log%line('dotyk '//version//' - '//title)
    call log%line('  '//case%file//', '//option_name(analysis_names, case%scene%analysis)//', '// &
                  counted(size(case%body), 'body', 'bodies')//', '// &
                  pairs//', '// &
                  ranks//counted(threads, 'thread'))
    do k = 1, size(case%remark)
      call log%line('  '//case%remark(k)%s)
    end do
    do k = 1, size(case%body)
      if (size(case%body(k)%material) == 0 .or. .not. is_cad_file(case%body(k)%mesh)) cycle
      i = maxloc([(maxval(case%material(case%body(k)%material(n))%young), n=1, size(case%body(k)%material))], 1)
      associate (material => case%material(case%body(k)%material(i)))
        if (.not. maxval(material%young) > greatest_modulus) cycle
        call log%line('  warning: lengths of '//quoted(case%body(k)%mesh)//' are in mm, and young='// &
                      to_text(maxval(material%young), 3)//' of '//quoted(material%name)//' looks like Pa: with N '// &
                      'and mm stresses are in MPa')
      end associate
      exit
    end do
  end subroutine show_title

  !> Bodies, treatment of locking, and contact pairs.
  subroutine show_scene(log, case, problem, size_of, again)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs of the case.
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    logical, intent(in) :: again  !! Whether only the factors are new.
    call show_bodies(log, case, problem%body, problem%classes, size_of)
    if (again) then
      call log%line('')
      return
    end if
    call show_locking(log, case, problem%body, problem%classes)
    call show_springs(log, problem%body)
    if (.not. case%has_cases()) call show_loads(log, case, problem)
    call show_pairs(log, problem%body, problem%pair, problem%surface_a, problem%surface_b)
    if (problem%n_ties() > 0) call show_ties(log, problem%body, problem%tie, problem%pair)
    call show_found(log, problem)
    call log%line('')
  end subroutine show_scene

  !> One line per class of congruent bodies; many classes are summed up.
  subroutine show_bodies(log, case, body, classes, size_of)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    character(:), allocatable :: name
    integer :: b, elements, nodes, unknowns
    call log%line('')
    call log%line('  body                 material         elements      nodes   unknowns  factor nonzeros     Gflop')
    elements = 0
    nodes = 0
    unknowns = 0
    do b = 1, size(body)
      elements = elements + body(b)%mesh%n_whole_elements()
      nodes = nodes + body(b)%mesh%n_whole_nodes()
      unknowns = unknowns + body(b)%n_unknowns()
      if (classes%n() > most_shown .or. .not. classes%is_representative(b)) cycle
      name = body(b)%name
      if (count(classes%first == b) > 1) name = to_text(count(classes%first == b))//' x '//name
      call log%line(body_line(name, names_of(body(b)), body(b)%mesh%n_whole_elements(), &
                              body(b)%mesh%n_whole_nodes(), body(b)%n_unknowns(), size_of(b)%entries, size_of(b)%flops))
    end do
    if (size(body) > 1) &
      call log%line(body_line(counted(size(body), 'body', 'bodies'), '', elements, nodes, unknowns, &
                              sum(size_of%entries), sum(size_of%flops)))
    if (classes%n() < size(body)) &
      call log%detail('  '//counted(size(body), 'body', 'bodies')//' in '// &
                    counted(classes%n(), 'congruence class', 'congruence classes')//': '// &
                    counted(classes%n(), 'factorization'))
    if (size(case%contact) + size(case%tie) == 0) call log%line('  no contact pairs: one linear solve per body')
  end subroutine show_bodies

  !> Names of the materials of a body, or their number where these are too long for the table; none of a body without
  !> volume.
  function names_of(body) result(text)
    type(body_t), intent(in) :: body  !! The body.
    character(:), allocatable :: text
    integer :: m
    text = ''
    if (allocated(body%mesh%face)) return
    text = body%material(1)%name
    do m = 2, size(body%material)
      text = text//', '//body%material(m)%name
    end do
    if (len(text) > width_of_material .and. size(body%material) > 1) text = to_text(size(body%material))//' materials'
  end function names_of

  !> A line of the table of bodies.
  function body_line(name, material, elements, nodes, unknowns, entries, flops) result(line)
    character(*), intent(in) :: name  !! Name of the body.
    character(*), intent(in) :: material  !! Name of its material.
    integer, intent(in) :: elements  !! Number of elements.
    integer, intent(in) :: nodes  !! Number of nodes.
    integer, intent(in) :: unknowns  !! Number of unknowns.
    integer(int64), intent(in) :: entries  !! Nonzeros of the factor.
    real(dp), intent(in) :: flops  !! Operations of the factorization [flop].
    character(120) :: line
    ! Left-justified: an edit descriptor justifies to the right.
    character(20) :: first
    character(width_of_material) :: second
    first = name
    second = material
    write (line, '(2x,a20,1x,a14,i11,i11,i11,es17.2,f10.2)') first, second, elements, nodes, unknowns, &
      real(entries, dp), flops/1.0e9_dp
  end function body_line

  !> Time and size of the factorization, and the bodies with an explicit compliance matrix.
  subroutine show_factorization(log, body, size_of, is_chosen, seconds)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    logical, intent(in) :: is_chosen  !! Whether the program chooses between factors and p-multigrid.
    real(dp), intent(in) :: seconds  !! Wall time [s].
    real(dp) :: fraction
    integer :: b
    if (any(size_of%form == form_split)) then
      call log%line('  p-multigrid      all bodies are split over '//to_text(n_ranks())//' ranks; coarse levels by '// &
                    'smoothed aggregation (PETSc)')
      return
    end if
    call log%detail('  factorization    '//duration(seconds)//', '//memory_text(real(sum(size_of%bytes), dp))//', '// &
                  to_text(sum(size_of%flops)/max(seconds, tiny(seconds))/1.0e9_dp, 3)//' Gflop/s')
    if (any(size_of%form == form_multigrid)) call log%detail('  p-multigrid      '// &
      counted(count(size_of%form == form_multigrid), 'body', 'bodies')//'; factors are those of the corner nodes '// &
      'there, or of aggregates of linear elements')
    do b = 1, size(size_of)
      ! One line for congruent bodies: their representative alone has a factor.
      if (size_of(b)%entries == 0) cycle
      if (size_of(b)%is_slow) then
        call show_slow(log, quoted(body(b)%name), size_of(b))
      else if (is_chosen .and. size_of(b)%form /= form_multigrid) then
        if (keeps_factor(body(b))) call log%detail('  factor           '//quoted(body(b)%name)// &
          ': nearly incompressible: p-multigrid would take many iterations')
      end if
    end do
    associate (chosen => size_of%forms_matrix)
      if (.not. any(chosen)) return
      fraction = sum(size_of%product_entries, mask=chosen)/ &
                 max(1.0_dp, real(sum(size_of%class_entries, mask=chosen), dp))
      call log%detail('  compliance       '//counted(count(chosen), 'body', 'bodies')// &
                    ' with an explicit compliance matrix: a product costs '//to_text(100*fraction, 2)// &
                    ' % of a solve with the factor')
    end associate
  end subroutine show_factorization

  !> A body for which a factor is better than p-multigrid.
  subroutine show_slow(log, name, size_of)
    type(log_t), intent(inout) :: log  !! The log.
    character(*), intent(in) :: name  !! The body.
    type(factor_size_t), intent(in) :: size_of  !! Size of its factor.
    character(:), allocatable :: iterations
    iterations = 'more than 1000'
    if (size_of%steps < 1000) iterations = 'about '//to_text(nint(size_of%steps))
    iterations = iterations//' iterations per solve'
    if (size_of%form == form_multigrid) then
      call log%line('  warning          '//name//': p-multigrid takes '//iterations// &
                    ', and the memory does not suffice for a factor')
    else
      call log%detail('  factor           '//name//': it costs less than p-multigrid with '//iterations)
    end if
  end subroutine show_slow

  !> Show what memory a run will take.
  subroutine show_memory(log, size_of, memory)
    type(log_t), intent(inout) :: log  !! The log.
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    real(dp), intent(in) :: memory  !! At most [bytes].
    call log%line('')
    call log%line('  estimated memory: factors '//memory_text(real(sum(size_of%bytes), dp))//', stiffness matrices '// &
                  memory_text(real(sum(size_of%stiffness_bytes), dp))//', total about '//memory_text(memory))
  end subroutine show_memory

  !> A line for each spring; nothing where no body has one.
  subroutine show_springs(log, body)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    character(20) :: label
    integer :: b, n, s
    n = 0
    do b = 1, size(body)
      associate (springs => body(b)%constraint%foundation)
        do s = 1, springs%n_springs()
          n = n + 1
          if (n > most_shown) cycle
          if (n == 1) then
            call log%line('')
            call log%line('  spring               area, stiffness')
          end if
          label = body(b)%name//':'//springs%place(s)%s
          call log%line('  '//label//' '//to_text(springs%area(s), 5)//', '// &
                        to_text(springs%area(s)*springs%modulus(s), 5)//' in total along '// &
                        directions_text(springs%fix(s), body(b)%dimension)//', '//to_text(springs%modulus(s), 5)// &
                        ' per area')
        end do
      end associate
    end do
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more spring'))
  end subroutine show_springs

  !> The directions of a spring: "each of x, y, z".
  function directions_text(fix, dimension) result(text)
    type(directions_t), intent(in) :: fix  !! The directions.
    integer, intent(in) :: dimension  !! Dimension of space.
    character(:), allocatable :: text
    integer :: i, n
    text = ''
    n = 0
    do i = 1, 3
      if (.not. fix%fixed(i)) cycle
      ! In the plane there is neither z nor eta.
      if (dimension == 2 .and. i == merge(2, 3, fix%local)) cycle
      n = n + 1
      if (n > 1) text = text//', '
      text = text//fix%name(i)
    end do
    if (n > 1) text = 'each of '//text
  end function directions_text

  !> Lines for each contact pair; many pairs are summed up.
  subroutine show_pairs(log, body, pair, surface_a, surface_b)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(surface_t), intent(in) :: surface_a(:)  !! Slave surfaces (n_pairs).
    type(surface_t), intent(in) :: surface_b(:)  !! Master surfaces (n_pairs).
    real(dp) :: least, most
    logical :: alone(size(body))
    integer :: k
    if (size(pair) == 0) return
    call log%line('')
    call log%line('  contact pair         constraints    area projected   smallest gap    largest gap          theta')
    least = huge(least)
    most = -huge(most)
    do k = 1, size(pair)
      least = min(least, minval(pair(k)%row_gap))
      most = max(most, maxval(pair(k)%row_gap))
      if (size(pair) <= most_shown) call show_pair(log, body, pair(k), surface_a(k), surface_b(k))
      call warn_of_oscillation(log, body, pair(k))
    end do
    if (size(pair) > most_shown) &
      call log%line(pair_line(to_text(size(pair))//' contact pairs', sum(pair%n_rows), -1.0_dp, least, most, &
                              maxval(pair%theta)))
    alone = .true.
    alone(pair%body_a) = .false.
    alone(pair%body_b) = .false.
    if (any(alone)) call log%line('  '//counted(count(alone), 'body', 'bodies')//' without contact: '// &
                                  body_names(body, alone))
  end subroutine show_pairs

  !> The lines of one contact pair.
  subroutine show_pair(log, body, pair, surface_a, surface_b)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair  !! The contact pair.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    real(dp) :: lost
    lost = pair%lost_not_facing + pair%lost_outside + pair%lost_too_far
    call log%line(pair_line(pair%name, pair%n_rows, 1 - lost, minval(pair%row_gap), maxval(pair%row_gap), &
                            pair%theta)//trim(merge(' layer', '      ', pair%is_layer)))
    call log%detail('    slave '//body(pair%body_a)%name//':'//surface_a%name//' ('// &
                  counted(surface_a%n_facets, 'facet')//'), master '//body(pair%body_b)%name//':'// &
                  surface_b%name//' ('//counted(surface_b%n_facets, 'facet')//')')
    if (body(pair%body_a)%constraint%rigid%is_set) &
      call log%line('    warning: the slave side is a rigid body: where its mesh is finer than that of '// &
                    quoted(body(pair%body_b)%name)//', pressures are not unique; make it surface_b')
    if (pair%n_unprojected > 0 .or. lost > 0) &
      call log%detail('    not projected: '//percent(pair%lost_outside)//' of the slave area beyond the edge of '// &
                      'the master surface, '//percent(pair%lost_not_facing)//' facing away from it, '// &
                      percent(pair%lost_too_far)//' beyond search_radius')
  end subroutine show_pair

  !> A line of the table of contact pairs.
  function pair_line(name, rows, projected, least, most, theta) result(line)
    character(*), intent(in) :: name  !! Name of the pair.
    integer, intent(in) :: rows  !! Number of contact rows.
    !> Fraction of the slave area that has a projection on the master surface; negative: not shown [].
    real(dp), intent(in) :: projected
    real(dp), intent(in) :: least  !! Smallest gap [length].
    real(dp), intent(in) :: most  !! Largest gap [length].
    real(dp), intent(in) :: theta  !! Penalty parameter [length/pressure].
    character(97) :: line
    ! Left-justified: an edit descriptor justifies to the right.
    character(20) :: label
    character(18) :: share
    label = name
    share = ''
    if (projected >= 0) write (share, '(f16.1,a)') 100*projected, ' %'
    write (line, '(2x,a20,i12,a18,es15.3,es15.3,es15.3)') label, rows, share, least, most, theta
  end function pair_line

  !> Text of a fraction in percent.
  function percent(fraction) result(text)
    real(dp), intent(in) :: fraction  !! Fraction [].
    character(:), allocatable :: text
    text = to_text(100*fraction, 2)//' %'
  end function percent

  !> Quadrature points outnumber the unknowns of their surface: with theta far below h/E the constraints at single
  !> points are over-determined, and their pressures oscillate.
  subroutine warn_of_oscillation(log, body, pair)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair  !! The contact pair.
    real(dp) :: compliance
    real(dp), parameter :: far_below = 1.0e-3_dp  !! Fraction of h/E below which theta counts as far smaller.
    if (pair%discretization /= discretization_quadrature) return
    compliance = mesh_compliance(body(pair%body_a), body(pair%body_b), pair)
    if (pair%theta < far_below*compliance) &
      call log%line('    warning: theta is far below h/E = '//to_text(compliance, 2)//': the pressures at single '// &
                    'quadrature points oscillate, only their averages converge; '// &
                    "use discretization='mortar'")
  end subroutine warn_of_oscillation

  !> Log one line per congruence class of nearly incompressible bodies; many classes are summed up.
  subroutine show_locking(log, case, body, classes)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    integer :: b, n, before, after
    n = 0
    before = 0
    after = 0
    do b = 1, size(body)
      if (.not. is_nearly_incompressible(body(b), case%solver%locking)) cycle
      n = n + 1
      before = before + body(b)%mesh%n_file_nodes()
      after = after + body(b)%mesh%n_whole_nodes()
      if (classes%n() <= most_shown .and. classes%is_representative(b)) &
        call log%line(line_of(body(b), count(classes%first == b), case%solver%locking))
    end do
    if (n == 0 .or. classes%n() <= most_shown) return
    if (case%solver%locking == locking_ignore) then
      call log%line('  warning: '//to_text(n)//' nearly incompressible bodies: volumetric locking is likely with '// &
                    "locking='ignore'")
    else
      call log%line('  nearly incompressible: '//to_text(n)//' bodies, projected dilatation (B-bar); '// &
                    to_text(before)//' nodes in the mesh, '//to_text(after)//' now')
    end if
  end subroutine show_locking

  !> Whether a body is nearly incompressible.
  logical function is_nearly_incompressible(body, locking) result(nearly)
    type(body_t), intent(in) :: body  !! The body.
    integer, intent(in) :: locking  !! One of `locking_*`.
    real(dp) :: ratio
    integer :: k
    nearly = .false.
    if (body%analysis == analysis_plane_stress) return
    do k = 1, size(body%mesh%block)
      associate (material => body%material(body%mesh%block(k)%material))
        ratio = material%incompressibility
        if (locking == locking_ignore) ratio = material%bulk_over_shear()
      end associate
      nearly = nearly .or. ratio > unprojected_bulk_ratio(body%mesh%block(k)%kind, ratio)
    end do
  end function is_nearly_incompressible

  !> Line of the log for one class.
  function line_of(body, number, locking) result(line)
    type(body_t), intent(in) :: body  !! First body of the class.
    integer, intent(in) :: number  !! Number of bodies of the class.
    integer, intent(in) :: locking  !! One of `locking_*`.
    character(:), allocatable :: line
    line = 'nearly incompressible: '//quoted(body%name)
    if (number > 1) line = line//' and '//counted(number - 1, 'congruent body', 'congruent bodies')
    line = line//' (K/G = '//to_text(body%material(least_compressible(body%material))%bulk_over_shear(), 3)//'): '
    if (locking == locking_ignore) then
      line = '  warning: '//line//"volumetric locking is likely with locking='ignore'"
    else
      line = '  '//line//'projected dilatation (B-bar)'
      if (body%mesh%order_elevated) then
        line = line//'; linear elements elevated to order 2: '//to_text(body%mesh%n_file_nodes())// &
          ' nodes in the mesh, '//to_text(body%mesh%n_whole_nodes())//' now'
      else if (has_linear_simplices(body%mesh)) then
        line = line//'; linear triangles, tetrahedra, prisms and pyramids may lock'
      end if
    end if
  end function line_of
end module dotyk_log_scene_tables
