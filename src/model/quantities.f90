!> Quantities of the input on the bodies and contact pairs of a scene.
module dotyk_model_quantities
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: last_linear_quantity, load_traction, option_name, quantity_displacement, &
    quantity_mises, quantity_names, quantity_of_pair, quantity_reaction, quantity_travel
  use dotyk_base_text, only: has_wildcard, matches, quoted, shown, to_text
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_quantity_error, only: quantity_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load, only: add_surface_load, load_t
  use dotyk_input_case, only: case_t, quantity_input_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: find_quantities

contains

  !> Find the quantities of a case, each one once; those that are linear in displacements and contact forces come first.
  subroutine find_quantities(case, surfaces, problem, quantity, error)
    type(case_t), intent(in) :: case  !! The case.
    type(body_surfaces_t), intent(in) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(quantity_t), allocatable, intent(out) :: quantity(:)  !! The quantities (n).
    !> Allocated where a name is unknown, or several ranks have the bodies; names file and line.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: known
    integer :: i, k
    logical :: is_found
    allocate (quantity(0))
    do i = 1, size(case%quantity)
      associate (given => case%quantity(i))
        if (n_ranks() > 1) then
          call set_error(error, 'quantity: one process estimates errors of quantities; run without mpirun', &
                         exit_bad_input)
        else
          known = ''
          is_found = .false.
          if (quantity_of_pair(given%kind)) then
            call take_pairs(given, problem, quantity, known, is_found)
            ! Scenes without contact have none of all pairs.
            if (has_wildcard(given%name) .and. size(problem%pair) == 0) is_found = .true.
          else
            do k = 1, size(given%body)
              associate (b => given%body(k))
                call take_places(given, b, problem%body(b), surfaces(b), quantity, known, is_found, error)
              end associate
              if (allocated(error)) exit
            end do
          end if
          if (.not. (is_found .or. allocated(error))) then
            if (len(known) == 0) known = ' none'
            call set_error(error, 'quantity: '//shown(given%text)//' does not exist; there are:'//known, exit_bad_input)
          end if
        end if
        call add_context(error, case%file//':'//to_text(given%line)//': ')
        if (allocated(error)) return
      end associate
    end do
  end subroutine find_quantities

  !> Take contact pairs, by their names or those of their bodies, in any order.
  subroutine take_pairs(given, problem, quantity, known, is_found)
    type(quantity_input_t), intent(in) :: given  !! What is wanted.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(quantity_t), allocatable, intent(inout) :: quantity(:)  !! The quantities; grows (n).
    character(:), allocatable, intent(inout) :: known  !! Names of all pairs, added to.
    logical, intent(inout) :: is_found  !! Set where there is one.
    type(quantity_t) :: new
    character(:), allocatable :: kind
    integer :: k
    kind = option_name(quantity_names, given%kind)//':'
    do k = 1, size(problem%pair)
      associate (pair => problem%pair(k))
        known = known//' '//quoted(kind//pair%name)
        associate (a => problem%body(pair%body_a)%name, b => problem%body(pair%body_b)%name)
          if (.not. any([matches(given%name, pair%name), matches(given%name, a//' - '//b), &
                         matches(given%name, b//' - '//a)])) cycle
        end associate
        new%name = kind//pair%name
        new%pair = k
        call add(given, new, quantity, is_found)
      end associate
    end do
  end subroutine take_pairs

  !> Take a face or the supports of a body.
  subroutine take_places(given, b, body, surfaces, quantity, known, is_found, error)
    type(quantity_input_t), intent(in) :: given  !! What is wanted.
    integer, intent(in) :: b  !! Index of the body.
    type(body_t), intent(in) :: body  !! The body.
    type(body_surfaces_t), intent(in) :: surfaces  !! Its surfaces.
    type(quantity_t), allocatable, intent(inout) :: quantity(:)  !! The quantities; grows (n).
    character(:), allocatable, intent(inout) :: known  !! Names of such quantities, added to.
    logical, intent(inout) :: is_found  !! Set where the body has one.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the face has no area.
    type(quantity_t) :: new
    integer :: s
    character(:), allocatable :: kind, axis
    kind = option_name(quantity_names, merge(quantity_displacement, given%kind, given%kind == quantity_travel))
    kind = kind//':'//body%name
    new%body = b
    axis = ''
    if (given%axis > 0) axis = ' '//given%text(len_trim(given%text):len_trim(given%text))
    if (given%kind /= quantity_reaction) then
      if (given%kind == quantity_mises .and. body%constraint%rigid%is_set) return
      if (len(axis) == 0) known = known//' '//quoted(kind)
      do s = 1, surfaces%n
        known = known//' '//quoted(kind//':'//surfaces%name(s)%s//axis)
      end do
      new%name = kind
      s = 0
      if (len(given%surface) > 0) then
        s = surfaces%find(given%surface)
        if (s == 0) return
        new%name = kind//':'//given%surface//axis
      end if
      if (given%kind == quantity_displacement) then
        allocate (new%weight(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
        call weigh_face()
      else
        allocate (new%node(body%mesh%n_nodes()), source=s == 0)
        if (s > 0) new%node(pack(surfaces%surface(s)%node, surfaces%surface(s)%node > 0)) = .true.
      end if
      if (.not. allocated(error)) call add(given, new, quantity, is_found)
      return
    end if
    kind = kind//':'
    do s = 1, body%directions%n_supports()
      associate (place => body%directions%place(s)%s)
        known = known//' '//quoted(kind//place//axis)
        ! A rigid body has no reactions at nodes.
        if (body%constraint%rigid%is_set .or. .not. matches(given%surface, place)) cycle
        if (.not. allocated(new%weight)) allocate (new%weight(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
        new%weight = new%weight + body%directions%weights(s, given%axis, body%mesh%n_nodes())
      end associate
    end do
    new%name = kind//given%surface//axis
    if (allocated(new%weight)) call add(given, new, quantity, is_found)

  contains

    !> Weights of the mean displacement of the face.
    subroutine weigh_face()
      type(load_t) :: load
      load%kind = load_traction
      load%value(given%axis) = 1
      call add_surface_load(body%mesh, body%analysis, surfaces%surface(s), load, new%weight, error)
      if (.not. allocated(error)) new%weight = new%weight/sum(new%weight)
    end subroutine weigh_face
  end subroutine take_places

  !> Add a quantity, once.
  subroutine add(given, new, quantity, is_found)
    type(quantity_input_t), intent(in) :: given  !! What the input has of it.
    type(quantity_t), intent(inout) :: new  !! The quantity.
    type(quantity_t), allocatable, intent(inout) :: quantity(:)  !! The quantities; grows (n).
    logical, intent(inout) :: is_found  !! Set.
    type(quantity_t), allocatable :: more(:)
    integer :: i
    is_found = .true.
    new%kind = given%kind
    new%is_goal = given%is_goal
    do i = 1, size(quantity)
      if (quantity(i)%name == new%name) quantity(i)%is_goal = quantity(i)%is_goal .or. new%is_goal
      if (quantity(i)%name == new%name) return
    end do
    i = size(quantity)
    if (new%kind <= last_linear_quantity) i = count(quantity%kind <= last_linear_quantity)
    allocate (more(size(quantity) + 1))
    more(:i) = quantity(:i)
    more(i + 1) = new
    more(i + 2:) = quantity(i + 1:)
    call move_alloc(more, quantity)
  end subroutine add
end module dotyk_model_quantities
