!> What acts on a body, from the input: supports with their values, loads, temperature and initial stress with the nodal
!> forces that they make, in each load case.
module dotyk_model_body_actions
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, problem_list_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, analysis_names, analysis_plane_strain, option_name
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_base_thresholds, only: same_number
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_initial_stress, only: add_initial_forces, initial_state_t
  use dotyk_elasticity_load_cases, only: clear_actions, keep_case, take_case
  use dotyk_elasticity_load_report, only: difference_in_volume
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_elasticity_part_sums, only: greatest_of_parts
  use dotyk_elasticity_support, only: support_t
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_input_case, only: applies_in, case_t, field_input_t, load_input_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, reference_nodes, shape_functions
  use dotyk_mesh_gmsh_node_data, only: node_values_t, read_node_data
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_loads, only: acts_on_surface, add_load, note_difference
  use dotyk_model_body_supports, only: gather_supports, hold_rigid, move_rigid, set_supports, support_group_t
  use dotyk_model_volumes, only: volume_t
  use dotyk_ranks_exchange, only: agree_on_error
  implicit none
  private
  public :: set_actions

  !> Resultants of centrifugal forces of floating bodies, relative to their size, that are taken for the accuracy of the
  !> mesh: in scenes without contact, where the accuracy is that of facets on circles, and in others [].
  real(dp), parameter :: alone = 1.0e-3_dp, in_contact = 1.0e-6_dp

contains

  !> Set supports, loads, temperature and initial stress of a body.
  subroutine set_actions(case, mesh, volume, b, body, support_used, load_used, problems)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_t), intent(in) :: mesh  !! Mesh of the body's volume.
    type(volume_t), intent(inout) :: volume  !! Volume of the body in the mesh; its surfaces are kept.
    integer, intent(in) :: b  !! Index of the body.
    !> The body, with mesh and material; not yet assembled. That of the first load case on return.
    type(body_t), intent(inout) :: body
    !> Whether a support is that of a named body, or acts on one of those that wildcards name (n_supports).
    logical, intent(inout) :: support_used(:)
    logical, intent(inout) :: load_used(:)  !! The same of loads (n_loads).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; those of the body are added.
    type(error_t), allocatable :: failed
    type(support_t), allocatable :: support(:)
    type(support_group_t), allocatable :: group(:)
    logical :: supports_vary, varies
    integer :: i, k, before, rigid
    before = problems%count
    rigid = 0
    if (allocated(case%rigid)) rigid = findloc(case%rigid%body, b, dim=1)
    call gather_supports(case, mesh, b, volume, body, support, group, support_used, problems)
    supports_vary = any([(case%support(i)%body == b .and. allocated(case%support(i)%in_case), i=1, size(case%support))])
    varies = supports_vary .or. &
             any([(case%load(i)%body == b .and. allocated(case%load(i)%in_case), i=1, size(case%load))]) .or. &
             any([(case%temperature(i)%body == b .and. allocated(case%temperature(i)%in_case), &
                   i=1, size(case%temperature))]) .or. &
             any([(case%initial_stress(i)%body == b .and. allocated(case%initial_stress(i)%in_case), &
                   i=1, size(case%initial_stress))])
    if (rigid > 0) &
      varies = varies .or. any([(case%rigid(i)%body == b .and. allocated(case%rigid(i)%in_case), &
                                 i=1, size(case%rigid))])
    varies = varies .and. case%n_cases() > 1
    if (varies) allocate (body%of_case(case%n_cases()))
    do k = 1, merge(case%n_cases(), 1, varies)
      call clear_actions(body)
      if (problems%count == before .and. rigid > 0) then
        if (k == 1) call hold_rigid(case%rigid(rigid), body, failed)
        call add_context(failed, 'body '//quoted(body%name)//': ')
        call note(case%rigid(rigid)%line, failed)
        if (problems%count == before) call move_rigid(case, b, k, body)
      else if (problems%count == before .and. (k == 1 .or. supports_vary)) then
        call set_supports(case, k, support, group, body, failed)
        if (allocated(failed)) &
          call problems%add(case%file//": body '"//body%name//"': "//failed%message//case%in_case_text(k), failed%code)
        if (problems%count > before .and. k > 1) return
      end if
      if (problems%count == before) call body%constraint%foundation%add_loads(body%mesh%x, body%analysis, body%load)
      call set_loads(k)
      if (problems%count > before) return
      if (varies) call keep_case(body, k)
    end do
    call take_case(body, 1)

  contains

    !> Set loads, temperature and initial stress of a load case.
    subroutine set_loads(k)
      integer, intent(in) :: k  !! The load case.
      integer :: i
      do i = 1, size(case%load)
        if (case%load(i)%body /= b) cycle
        if (case%load(i)%any_body .and. acts_on_surface(case%load(i))) then
          if (.not. volume%has_place(mesh, body%mesh%x, case%load(i)%place)) cycle
          ! Of the bodies that wildcards name, one on the axis has as little of a load as one without the surface.
          if (volume%lies_on_axis(mesh, body%mesh%x, body%analysis, case%load(i)%place)) cycle
        end if
        load_used(i) = .true.
        if (.not. applies_in(case%load(i)%in_case, k)) cycle
        call set_load(case%load(i), failed)
        call note(case%load(i)%line, failed)
      end do
      do i = 1, size(case%temperature)
        if (case%temperature(i)%body /= b .or. .not. applies_in(case%temperature(i)%in_case, k)) cycle
        call add_temperature(case%temperature(i), body, failed)
        call note(case%temperature(i)%line, failed)
      end do
      do i = 1, size(case%initial_stress)
        if (case%initial_stress(i)%body /= b .or. .not. applies_in(case%initial_stress(i)%in_case, k)) cycle
        call add_initial_stress(case%initial_stress(i), body, failed)
        call note(case%initial_stress(i)%line, failed)
      end do
    end subroutine set_loads

    !> Add the nodal forces of one load.
    subroutine set_load(given, failed)
      type(load_input_t), intent(in) :: given  !! `&load`.
      type(error_t), allocatable, intent(out) :: failed  !! Allocated where the load cannot be used.
      type(surface_t) :: surface
      if (acts_on_surface(given)) then
        call volume%take_place(mesh, body%mesh%x, given%place, surface, failed)
        call add_context(failed, 'body '//quoted(body%name)//': ')
        if (.not. allocated(failed)) then
          if (volume%lies_on_axis(mesh, body%mesh%x, body%analysis, given%place)) &
            call set_error(failed, 'body '//quoted(body%name)//': '//quoted(surface%name)//' lies on the axis and '// &
                           'has no area', exit_bad_input)
        end if
      end if
      ! In contact or tied, a small resultant may be what is asked for; alone, the scene would have no equilibrium.
      if (.not. allocated(failed)) &
        call add_load(given, surface, merge(alone, in_contact, size(case%contact) + size(case%tie) == 0), body, failed)
    end subroutine set_load

    !> Add a problem of a line of the namelist file, if there is one.
    subroutine note(line, failed)
      integer, intent(in) :: line  !! Line of the namelist file.
      type(error_t), allocatable, intent(inout) :: failed  !! Problem; not allocated on return.
      if (.not. allocated(failed)) return
      call problems%add_error(failed, case%file//':'//to_text(line)//': ')
    end subroutine note
  end subroutine set_actions

  !> Add a temperature.
  subroutine add_temperature(given, body, error)
    type(field_input_t), intent(in) :: given  !! `&temperature`.
    type(body_t), intent(inout) :: body  !! The body, with its material and nodal forces so far.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the temperature cannot be used.
    type(initial_state_t) :: state
    real(dp), allocatable :: value(:, :)
    real(dp) :: extremes(2)
    call check_expansion(body, error)
    if (allocated(error)) return
    if (len(given%array) > 0) then
      call evaluate_array(body%mesh, given, value, error)
    else
      call evaluate(body%mesh, given, 1, value, error)
    end if
    if (.not. allocated(error)) then
      state%temperature = value(1, :)
      body%initial%temperature = state%temperature
      extremes = [-minval(value), maxval(value)]
      call add_initial_forces(body%mesh, body%analysis, body%material, state, body%load, error)
    end if
    call finish(body, 'the temperature', given%formula, error)
    if (allocated(error)) return
    call greatest_of_parts(body%mesh, extremes)
    body%initial%range = [-extremes(1), extremes(2)]
  end subroutine add_temperature

  !> Add an initial stress.
  subroutine add_initial_stress(given, body, error)
    type(field_input_t), intent(in) :: given  !! `&initial_stress`.
    type(body_t), intent(inout) :: body  !! The body, with its material and nodal forces so far.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the stress cannot be used.
    type(initial_state_t) :: state
    real(dp), allocatable :: value(:, :)
    call evaluate(body%mesh, given, 6, value, error)
    if (.not. allocated(error)) then
      ! From the order of the input, xx yy zz xy yz xz.
      state%stress = value([1, 2, 3, 5, 6, 4], :)
      body%initial%stress = state%stress
      call add_initial_forces(body%mesh, body%analysis, body%material, state, body%load, error)
    end if
    call finish(body, 'the initial stress', given%formula, error)
  end subroutine add_initial_stress

  !> Temperatures at the nodes from a field of the mesh file. Nodes of order elevation have those of the
  !> linear elements of the file.
  subroutine evaluate_array(mesh, given, value, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(field_input_t), intent(in) :: given  !! The field, and the temperature of the unstressed body.
    real(dp), allocatable, intent(out) :: value(:, :)  !! The values (1, n_nodes) [temperature].
    type(error_t), allocatable, intent(out) :: error  !! Where the file has no such field, or a node has no value.
    real(dp), allocatable :: xi(:, :), shape(:)
    logical, allocatable :: found(:)
    type(node_values_t) :: field
    type(element_kind_t) :: kind
    integer :: b, e, i
    call read_node_data(mesh%file, mesh%dimension, given%array, field, error)
    if (allocated(error)) return
    allocate (value(1, mesh%n_nodes()), found(mesh%n_nodes()))
    do i = 1, mesh%n_nodes()
      call field%find(mesh%node_tag(i), value(1, i), found(i))
      value(1, i) = value(1, i) - given%reference
    end do
    do b = 1, merge(size(mesh%block), 0, mesh%order_elevated)
      kind = element_kind(mesh%block(b)%kind)
      allocate (xi(mesh%dimension, kind%n_nodes), shape(kind%n_corners))
      call reference_nodes(mesh%block(b)%kind, xi)
      do i = kind%n_corners + 1, kind%n_nodes
        call shape_functions(kind%corner_kind, xi(:, i), shape)
        do e = 1, size(mesh%block(b)%tag)
          associate (node => mesh%block(b)%node(:, e))
            value(1, node(i)) = dot_product(shape, value(1, node(:kind%n_corners)))
            found(node(i)) = .true.
          end associate
        end do
      end do
      deallocate (xi, shape)
    end do
    i = findloc(found, .false., dim=1)
    if (i > 0) call set_error(error, mesh%file//': field '//quoted(given%array)//' has no value at node '// &
                              to_text(mesh%node_tag(i)), exit_bad_input)
  end subroutine evaluate_array

  !> Values at the nodes.
  subroutine evaluate(mesh, given, n, value, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(field_input_t), intent(in) :: given  !! Numbers or formulas.
    integer, intent(in) :: n  !! How many.
    real(dp), allocatable, intent(out) :: value(:, :)  !! The values (n, n_nodes) [unit of the field].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula has no value at a node.
    type(vector_field_t) :: field
    type(text_t), allocatable :: text(:)
    real(dp) :: of_node(3)
    integer :: first, i, last
    allocate (value(n, mesh%n_nodes()))
    do first = 1, n, 3
      last = min(first + 2, n)
      if (size(given%formula) > 0) text = given%formula(first:last)
      call field%init(given%value(first:first + 2), error, text)
      do i = 1, size(value, 2)
        if (allocated(error)) exit
        call field%evaluate(mesh%x(:, i), of_node, error)
        value(first:last, i) = of_node(:last - first + 1)
      end do
      call field%destroy()
      if (allocated(error)) return
    end do
  end subroutine evaluate

  !> What follows any of them: ranks with parts of a body agree, and formulas that the mesh does not resolve are noted.
  subroutine finish(body, name, formula, error)
    type(body_t), intent(inout) :: body  !! The body.
    character(*), intent(in) :: name  !! What it is.
    type(text_t), intent(in) :: formula(:)  !! Its formulas (n_formulas).
    type(error_t), allocatable, intent(inout) :: error  !! Problems so far, of all ranks on return; name the body.
    type(text_t), allocatable :: some(:)
    real(dp) :: difference
    integer :: first
    call add_context(error, 'body '//quoted(body%name)//': '//name//': ')
    if (body%mesh%is_in_parts()) call agree_on_error(error)
    if (allocated(error)) return
    difference = 0
    do first = 1, size(formula), 3
      some = formula(first:min(first + 2, size(formula)))
      difference = max(difference, difference_in_volume(body%mesh, some))
    end do
    call note_difference(body, name, difference)
  end subroutine finish

  !> Refuse a material whose expansion makes shear stresses out of the plane where nothing can move across it, as
  !> `check_plane` of the material does for strains.
  subroutine check_expansion(body, error)
    type(body_t), intent(in) :: body  !! The body.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the analysis cannot have the expansion.
    type(material_field_t) :: field
    integer :: i, k, n
    if (.not. any(body%analysis == [analysis_plane_strain, analysis_axisymmetric])) return
    do k = 1, size(body%material)
      call field%init(body%material(k), error)
      if (allocated(error)) return
      n = merge(body%mesh%n_nodes(), 1, field%varies)
      if (.not. any([(makes_shear(body%mesh%x(:, i)), i=1, n)])) cycle
      call set_error(error, 'material '//quoted(body%material(k)%name)//': its thermal expansion makes shear '// &
                     'stresses out of the plane, but analysis='''//option_name(analysis_names, body%analysis)// &
                     ''' assumes that nothing moves across it: the plane must be that of two axes of the material; '// &
                     'use analysis=''3d''', exit_bad_input)
      exit
    end do

  contains

    !> Whether the expansion makes such stresses at a point.
    logical function makes_shear(x)
      real(dp), intent(in) :: x(:)  !! The point (dim) [length].
      type(material_t) :: here
      type(error_t), allocatable :: no_value
      real(dp) :: stress(6)
      here%stiffness = body%material(k)%stiffness
      here%expansion = body%material(k)%expansion
      if (field%varies) call field%whole_at(x, here, no_value)
      stress = matmul(here%stiffness, here%expansion)
      makes_shear = .not. allocated(no_value) .and. any(abs(stress(4:5)) > same_number*maxval(abs(stress)))
    end function makes_shear
  end subroutine check_expansion
end module dotyk_model_body_actions
