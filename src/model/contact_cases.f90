!> Gaps and penalty parameters of contact pairs by load cases. Points, normals and rows of a pair are the same in all of
!> them.
module dotyk_model_contact_cases
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, gap_constant, gap_formula, theta_formula, theta_mesh, &
    theta_relative
  use dotyk_base_text, only: matches, quoted, to_text
  use dotyk_base_thresholds, only: same_place
  use dotyk_contact_pair, only: pair_settings_t
  use dotyk_contact_pair_discretization, only: set_given_gap
  use dotyk_contact_pair_rows, only: row_gaps
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_input_case, only: applies_in, case_t, contact_input_t
  use dotyk_model_pair_search, only: allows_zero_theta, set_formula_theta, set_mesh_theta
  implicit none
  private
  public :: check_contact_cases, contacts_of_case, set_contact_case

  type, public :: pair_conditions_t  !! Gap and theta of a pair as `&contact` has them.
    integer :: gap_kind = 0  !! One of `gap_*`.
    real(dp), allocatable :: gap(:)  !! Gaps of the points; not allocated where no case changes any (n_points) [length].
    real(dp), allocatable :: bend(:)  !! What was taken off them (n_points) [length].
    real(dp), allocatable :: curved(:)  !! What of that part they still have (n_points) [length].
    real(dp), allocatable :: uncertainty(:)  !! How uncertain they are (n_points) [length].
    real(dp), allocatable :: row_gap(:)  !! Those of the rows (n_rows) [length].
    real(dp), allocatable :: row_theta(:)  !! Penalty parameters of the rows (n_rows) [length/pressure].
    real(dp) :: theta = 0  !! Their mean [length/pressure].
  end type pair_conditions_t

contains

  !> The contact pairs of a case as they are in one load case.
  subroutine contacts_of_case(case, load_case, contact, is_changed)
    type(case_t), intent(in) :: case  !! The case, with one contact for each pair.
    integer, intent(in) :: load_case  !! The load case.
    type(contact_input_t), allocatable, intent(out) :: contact(:)  !! Contacts with gap and theta of the case (n_pairs).
    logical, allocatable, intent(out) :: is_changed(:)  !! Whether a `&contact_case` changes a pair (n_pairs).
    integer :: i, k
    contact = case%contact
    allocate (is_changed(size(contact)), source=.false.)
    if (.not. allocated(case%contact_case)) return
    do i = 1, size(case%contact_case)
      associate (given => case%contact_case(i))
        if (.not. applies_in(given%in_case, load_case)) cycle
        do k = 1, size(contact)
          if (.not. matches(given%contact, contact(k)%name)) cycle
          is_changed(k) = .true.
          contact(k)%line = given%line
          if (given%has_gap) then
            contact(k)%gap_kind = given%gap_kind
            contact(k)%gap = given%gap
            contact(k)%gap_formula = given%gap_formula
          end if
          if (given%has_theta) then
            contact(k)%theta_kind = given%theta_kind
            contact(k)%theta = given%theta
            contact(k)%theta_formula = given%theta_formula
            contact(k)%theta_given = .true.
          end if
        end do
      end associate
    end do
  end subroutine contacts_of_case

  !> Refuse `&contact_case` of no pair, and gaps and penalty parameters that cannot be used, of all load cases.
  subroutine check_contact_cases(case, problem, base, error)
    type(case_t), intent(in) :: case  !! The case, with one contact for each pair.
    type(contact_problem_t), intent(inout) :: problem  !! Bodies and pairs.
    type(pair_conditions_t), allocatable, intent(out) :: base(:)  !! Gap and theta as `&contact` has them (n_pairs).
    type(error_t), allocatable, intent(out) :: error  !! Where there is something wrong: all problems.
    type(problem_list_t) :: problems
    type(contact_input_t), allocatable :: contact(:)
    logical, allocatable :: is_changed(:)
    integer :: c, i, k
    allocate (base(size(problem%pair)))
    if (.not. allocated(case%contact_case)) return
    do i = 1, size(case%contact_case)
      associate (given => case%contact_case(i))
        if (any([(matches(given%contact, case%contact(k)%name), k=1, size(case%contact))])) cycle
        call problems%add(case%file//':'//to_text(given%line)//': &contact_case: no contact pair has a name like '// &
                          quoted(given%contact)//'; --check lists the pairs', exit_bad_input)
      end associate
    end do
    do c = 1, case%n_cases()
      call contacts_of_case(case, c, contact, is_changed)
      do k = 1, size(is_changed)
        if (.not. is_changed(k) .or. allocated(base(k)%gap)) cycle
        associate (pair => problem%pair(k))
          base(k)%gap_kind = pair%gap_kind
          base(k)%gap = pair%gap
          base(k)%bend = pair%bend
          base(k)%curved = pair%curved
          base(k)%uncertainty = pair%uncertainty
          base(k)%row_gap = pair%row_gap
          base(k)%row_theta = pair%row_theta
          base(k)%theta = pair%theta
        end associate
      end do
    end do
    do c = case%n_cases(), 1, -1
      call set_contact_case(case, c, base, problem, error)
      if (.not. allocated(error)) cycle
      call problems%add_error(error)
      exit
    end do
    call problems%raise(error)
  end subroutine check_contact_cases

  !> Give the pairs gap and theta of a load case.
  subroutine set_contact_case(case, load_case, base, problem, error)
    type(case_t), intent(in) :: case  !! The case, with one contact for each pair.
    integer, intent(in) :: load_case  !! The load case.
    type(pair_conditions_t), intent(in) :: base(:)  !! As of `check_contact_cases` (n_pairs).
    type(contact_problem_t), intent(inout) :: problem  !! Bodies and pairs.
    !> Allocated where a gap or a penalty parameter cannot be used; names file, line and pair.
    type(error_t), allocatable, intent(out) :: error
    type(contact_input_t), allocatable :: contact(:)
    logical, allocatable :: is_changed(:)
    integer :: k
    call contacts_of_case(case, load_case, contact, is_changed)
    do k = 1, size(base)
      if (.not. allocated(base(k)%gap)) cycle
      associate (pair => problem%pair(k))
        pair%gap_kind = base(k)%gap_kind
        pair%gap = base(k)%gap
        pair%bend = base(k)%bend
        pair%curved = base(k)%curved
        pair%uncertainty = base(k)%uncertainty
        pair%row_gap = base(k)%row_gap
        pair%row_theta = base(k)%row_theta
        pair%theta = base(k)%theta
      end associate
      if (.not. is_changed(k)) cycle
      call change_pair(case, contact(k), k, problem, error)
      call add_context(error, case%file//':'//to_text(contact(k)%line)//': ')
      if (allocated(error)) return
    end do
  end subroutine set_contact_case

  !> Give one pair another gap or theta.
  subroutine change_pair(case, given, k, problem, error)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_input_t), intent(in) :: given  !! The contact in the load case.
    integer, intent(in) :: k  !! Index of the pair.
    type(contact_problem_t), intent(inout) :: problem  !! Bodies and pairs.
    type(error_t), allocatable, intent(out) :: error  !! Where gap or penalty parameter are wrong; names the pair.
    type(pair_settings_t) :: settings
    type(formula_t) :: formula
    real(dp), allocatable :: own(:)
    real(dp) :: theta
    integer :: far
    associate (pair => problem%pair(k), base => case%contact(k), body_a => problem%body(problem%pair(k)%body_a), &
               body_b => problem%body(problem%pair(k)%body_b))
      if (any(given%gap_kind == [gap_constant, gap_formula])) then
        settings%name = pair%name
        settings%group = '&contact_case'
        settings%gap_kind = given%gap_kind
        settings%gap = given%gap
        if (given%gap_kind == gap_formula) call formula%init(given%gap_formula, error)
        if (.not. allocated(error)) &
          call set_given_gap(settings, formula, problem%surface_a(k), body_a%mesh%x, &
                             pair%n_points - pair%n_point_contacts, pair, error)
        call formula%destroy()
        if (allocated(error)) return
        call pair%average%multiply(pair%gap, pair%row_gap)
        call row_gaps(body_a%analysis == analysis_axisymmetric, problem%surface_a(k), pair, own)
        far = maxloc(abs(own - pair%row_gap), 1)
        if (abs(own(far) - pair%row_gap(far)) > same_place*maxval(abs(pair%gap))) then
          call set_error(error, '&contact_case: '//quoted(pair%name)//': the gap varies so much where faces are '// &
                         'covered in part that the rows made for the gap of &contact do not suit it (gap of a row '// &
                         to_text(pair%row_gap(far), 4)//', and '//to_text(own(far), 4)//' with rows of its own); '// &
                         'give &contact a gap_formula that varies alike', exit_bad_input)
          return
        end if
      end if
      if (given%theta_kind == base%theta_kind .and. abs(given%theta - base%theta) <= 0 .and. &
          given%theta_formula == base%theta_formula) return
      if (pair%is_layer .and. (given%theta_kind == theta_mesh .or. .not. given%theta > 0)) then
        call set_error(error, '&contact_case: '//quoted(pair%name)//' is a layer, whose compliance must be '// &
                       'positive and independent of the mesh: give theta, theta_relative or theta_formula', &
                       exit_bad_input)
        return
      end if
      theta = given%theta
      if (given%theta_kind == theta_relative .and. theta > 0) theta = theta* &
        (shortest_extent(body_a%mesh)/body_a%young() + shortest_extent(body_b%mesh)/body_b%young())
      pair%theta = theta
      pair%row_theta = theta
      if (given%theta_kind == theta_mesh) then
        call set_mesh_theta(given%theta, body_a, problem%surface_a(k), body_b, problem%surface_b(k), pair, error)
      else if (given%theta_kind == theta_formula) then
        call set_formula_theta(given%theta_formula, allows_zero_theta(case, given), pair, error)
      end if
    end associate
  end subroutine change_pair
end module dotyk_model_contact_cases
