!> Adds loads from the input to a body: nodal forces, forces at points, resultants for the log, and warnings of formulas
!> that quadrature or the mesh does not resolve.
module dotyk_model_body_loads
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: load_acceleration, load_angular_velocity, load_force_density, load_names, option_name
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_base_thresholds, only: notable
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load, only: add_surface_load, add_volume_load, balance_centrifugal_force, load_t
  use dotyk_elasticity_load_report, only: difference_in_volume, difference_on_surface, load_resultant_t, resultant_of
  use dotyk_input_case, only: load_input_t
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  use dotyk_ranks_exchange, only: agree_on_error
  implicit none
  private
  public :: acts_on_surface, add_load, check_formula, note_difference

contains

  !> Whether a load acts on a surface, not in the volume.
  pure logical function acts_on_surface(given)
    type(load_input_t), intent(in) :: given  !! `&load`.
    acts_on_surface = .not. any(given%kind == [load_force_density, load_angular_velocity, load_acceleration])
  end function acts_on_surface

  !> Add one load.
  subroutine add_load(given, surface, accuracy, body, error)
    type(load_input_t), intent(in) :: given  !! `&load`.
    type(surface_t), intent(in) :: surface  !! Surface on which it acts; not used by force densities.
    !> Resultants of centrifugal forces up to this fraction of their size are taken for the accuracy of the mesh [].
    real(dp), intent(in) :: accuracy
    type(body_t), intent(inout) :: body  !! The body, with supports, and nodal forces so far.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the load cannot be used.
    type(load_t) :: load
    type(text_t), allocatable :: one(:)
    real(dp), allocatable :: before(:, :)
    integer :: m
    load%kind = given%kind
    load%value = given%value
    load%formula = given%formula
    load%moment = given%moment
    if (given%has_point) load%point = given%point
    load%centre = given%centre
    load%density = body%material%density
    allocate (load%density_formula(size(body%material)))
    do m = 1, size(body%material)
      load%density_formula(m)%s = ''
      if (.not. allocated(body%material(m)%formulas%density)) cycle
      ! The formula multiplies the force of a unit density.
      load%density(m) = 1
      load%density_formula(m)%s = body%material(m)%formulas%density
    end do
    before = body%load
    ! A body without volume has neither mass nor weight.
    if (allocated(body%mesh%face) .and. .not. acts_on_surface(given)) return
    if (.not. acts_on_surface(given)) then
      call add_volume_load(body%mesh, body%analysis, load, body%load, error, body%applied)
      ! Each rank has other elements of a body in parts.
      if (body%mesh%is_in_parts()) call agree_on_error(error)
      if (allocated(error)) return
      if (load%kind == load_angular_velocity) call balance_forces(before, accuracy, body)
      if (.not. allocated(body%density)) allocate (body%density(3, size(body%material)), source=0.0_dp)
      do m = 1, size(body%material)
        if (load%kind == load_acceleration .and. len(load%density_formula(m)%s) == 0) &
          body%density(:, m) = body%density(:, m) + load%density(m)*load%value
        if (load%kind == load_force_density .and. size(load%formula) == 0) &
          body%density(:, m) = body%density(:, m) + load%value
      end do
      call note_resultant(body, body%load - before, option_name(load_names, given%kind))
      call note_difference(body, 'the force density', difference_in_volume(body%mesh, load%formula))
      do m = 1, size(body%material)
        if (load%kind == load_force_density .or. len(load%density_formula(m)%s) == 0) cycle
        if (.not. allocated(one)) allocate (one(1))
        one(1)%s = load%density_formula(m)%s
        call note_difference(body, 'the density of material '//quoted(body%material(m)%name), &
                             difference_in_volume(body%mesh, one))
      end do
    else
      call add_surface_load(body%mesh, body%analysis, surface, load, body%load, error, body%applied)
      if (allocated(error)) return
      if (given%of_mass) then
        call note_resultant(body, body%load - before, surface%name//' (mass)')
      else
        call note_resultant(body, body%load - before, surface%name)
      end if
      if (surface%is_concentrated() .and. .not. body%constraint%rigid%is_set) then
        associate (new => body%resultant(size(body%resultant)))
          new%is_concentrated = .true.
          call surface_nodes(surface, new%node)
        end associate
      end if
      call check_formula(body, 'the load on '//quoted(surface%name), surface, load%formula)
    end if
  end subroutine add_load

  !> Balance the centrifugal forces of a floating body, where the mesh is the reason that they are not balanced.
  subroutine balance_forces(before, accuracy, body)
    real(dp), intent(in) :: before(:, :)  !! Nodal forces without them (dim, n_nodes) [force].
    real(dp), intent(in) :: accuracy  !! As in `add_load` [].
    type(body_t), intent(inout) :: body  !! The body; its nodal forces change.
    real(dp), allocatable :: force(:, :)
    real(dp) :: balanced
    ! Ranks with parts of the body do not see its resultants; springs resist them.
    if (body%mesh%is_in_parts() .or. .not. allocated(body%constraint%equation)) return
    if (body%constraint%foundation%n_springs() > 0) return
    force = body%load - before
    call balance_centrifugal_force(body, accuracy, force, balanced)
    if (.not. balanced > 0) return
    body%load = before + force
    call add_warning(body, quoted(body%name)//' floats, and its centrifugal forces have a resultant of '// &
                     to_text(balanced, 2)//' of their size, within the accuracy of the mesh: they are balanced, as '// &
                     'if the axis went through the centroid')
  end subroutine balance_forces

  !> Note the resultant of a load.
  subroutine note_resultant(body, force, place)
    type(body_t), intent(inout) :: body  !! The body.
    real(dp), intent(in) :: force(:, :)  !! Nodal forces of the load (dim, n_nodes) [force].
    character(*), intent(in) :: place  !! Where it acts.
    type(load_resultant_t), allocatable :: more(:)
    integer :: i, n
    n = 0
    if (allocated(body%resultant)) n = size(body%resultant)
    allocate (more(n + 1))
    do i = 1, n
      more(i) = body%resultant(i)
    end do
    more(n + 1) = resultant_of(body%mesh, body%analysis, force, place)
    call move_alloc(more, body%resultant)
  end subroutine note_resultant

  !> Note formulas on a surface for which two quadrature rules differ.
  subroutine check_formula(body, name, surface, formula)
    type(body_t), intent(inout) :: body  !! The body.
    character(*), intent(in) :: name  !! What has the formulas.
    type(surface_t), intent(in) :: surface  !! The surface.
    type(text_t), intent(in), allocatable :: formula(:)  !! Formulas; none where not allocated (<= 3).
    call note_difference(body, name, difference_on_surface(body%mesh, surface, formula))
  end subroutine check_formula

  !> Note a difference that is worth a warning.
  subroutine note_difference(body, name, difference)
    type(body_t), intent(inout) :: body  !! The body.
    character(*), intent(in) :: name  !! What has the formulas.
    real(dp), intent(in) :: difference  !! Difference of two rules, relative [].
    if (.not. difference > notable) return
    call add_warning(body, quoted(body%name)//': the formula of '//name//' varies within elements: two quadrature '// &
                     'rules differ by '//to_text(100*difference, 2)//' %')
  end subroutine note_difference

  !> Add a warning about loads or supports.
  subroutine add_warning(body, text)
    type(body_t), intent(inout) :: body  !! The body.
    character(*), intent(in) :: text  !! The warning.
    type(text_t), allocatable :: more(:)
    integer :: i, n
    n = 0
    if (allocated(body%unresolved)) n = size(body%unresolved)
    allocate (more(n + 1))
    do i = 1, n
      more(i)%s = body%unresolved(i)%s
    end do
    more(n + 1)%s = text
    call move_alloc(more, body%unresolved)
  end subroutine add_warning
end module dotyk_model_body_loads
