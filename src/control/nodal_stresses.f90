!> Stresses at the nodes of all bodies: congruent ones together, in the axes of the representative.
module dotyk_control_nodal_stresses
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_body_solution, only: body_solution_t, displacements_t
  use dotyk_control_contact_problem, only: congruent_group_t, congruent_groups, contact_problem_t
  use dotyk_control_kept_estimates, only: kept_class_t, kept_estimates_t
  use dotyk_control_mesh_error, only: to_representative
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_material, only: elements_of_material, mesh_of_material, nodes_of_material
  use dotyk_elasticity_nodal_stress, only: nodal_stresses, take_stress_of_means
  use dotyk_elasticity_stiffness_tensor, only: rotate_strain, rotate_stress
  implicit none
  private

  type, public :: nodal_stress_t  !! Stresses at the nodes of a body.
    !> In global axes, order xx yy zz xy yz xz; not allocated for bodies of other ranks (6, n_nodes) [pressure].
    real(dp), allocatable :: value(:, :)
  end type nodal_stress_t

  public :: recover_nodal_stresses

contains

  !> Recover the stresses of all bodies whose displacements are known.
  subroutine recover_nodal_stresses(problem, displacements, kept, stress, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and ranks.
    type(displacements_t), intent(inout) :: displacements  !! Known; recovered strains are not, on return.
    type(kept_estimates_t), intent(inout) :: kept  !! Recovered strains, those of the error estimate where there is one.
    type(nodal_stress_t), allocatable, intent(out) :: stress(:)  !! Their stresses (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of a material cannot be parsed.
    type(congruent_group_t), allocatable :: group(:)
    integer :: g, m
    allocate (stress(size(problem%body)))
    call kept%init(size(problem%body))
    call congruent_groups(problem, group)
    do g = 1, size(group)
      associate (first => group(g)%representative)
        call kept%of_class(first)%init(problem%body(first))
        if (allocated(displacements%recovered)) then
          associate (recovered => displacements%recovered(g)%of_material, recovery => kept%of_class(first)%recovery)
            do m = 1, size(recovery)
              if (allocated(recovered(m)%u)) call recovery(m)%take(recovered(m))
            end do
          end associate
        end if
        call recover_some(problem, group(g)%body, displacements%body, kept%of_class(first), stress, error)
      end associate
      if (allocated(error)) return
    end do
  end subroutine recover_nodal_stresses

  !> Some congruent bodies.
  subroutine recover_some(problem, alike, solution, kept, stress, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, classes and ranks.
    integer, intent(in) :: alike(:)  !! Indices of the bodies (n).
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of all bodies (n_bodies).
    type(kept_class_t), intent(inout) :: kept  !! Recovered strains.
    type(nodal_stress_t), intent(inout) :: stress(:)  !! Stresses; those of these bodies are set (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula of the material cannot be parsed.
    real(dp), allocatable :: u(:, :, :), of_alike(:, :, :), of_material(:, :, :), temperature(:, :), expansion(:, :, :)
    logical, allocatable :: has(:), is_set(:)
    integer :: i, k, m
    call to_representative(problem, alike, solution, u)
    associate (first => problem%body(problem%classes%first(alike(1))))
      allocate (expansion(6, size(alike), size(first%material)), source=0.0_dp)
    end associate
    do i = 1, size(alike)
      associate (body => problem%body(alike(i)))
        if (.not. (problem%ranks%is_own(alike(i)) .and. allocated(body%initial%temperature))) cycle
        if (.not. allocated(temperature)) allocate (temperature(size(u, 1), size(u, 3)), source=0.0_dp)
        temperature(i, :) = body%initial%temperature
        do m = 1, size(body%material)
          expansion(:, i, m) = rotate_strain(body%material(m)%expansion, &
                                             transpose(problem%classes%motion(alike(i))%rotation))
        end do
      end associate
    end do
    associate (first => problem%body(problem%classes%first(alike(1))))
      if (size(first%material) == 1) then
        call nodal_stresses(first%mesh, first%analysis, first%material(1), u, kept%recovery(1), of_alike, error, &
                            temperature, expansion(:, :, 1))
        if (allocated(error)) return
      else
        ! Stresses jump where materials meet: there, the first one counts.
        allocate (of_alike(6, first%mesh%n_nodes(), size(alike)), source=0.0_dp)
        allocate (is_set(first%mesh%n_nodes()), source=.false.)
        do m = 1, size(first%material)
          has = nodes_of_material(first%mesh, m) .and. .not. is_set
          if (.not. any(has)) cycle
          call nodal_stresses(mesh_of_material(first%mesh, m), first%analysis, first%material(m), u, &
                              kept%recovery(m), of_material, error, temperature, expansion(:, :, m))
          if (allocated(error)) return
          do k = 1, size(has)
            if (has(k)) of_alike(:, k, :) = of_material(:, k, :)
          end do
          is_set = is_set .or. has
        end do
      end if
    end associate
    do i = 1, size(alike)
      if (.not. problem%ranks%is_own(alike(i))) cycle
      associate (body => problem%body(alike(i)), motion => problem%classes%motion(alike(i)), &
                 of_body => of_alike(:, :, i))
        allocate (stress(alike(i))%value(6, size(of_body, 2)))
        do k = 1, size(of_body, 2)
          if (motion%rotated) of_body(:, k) = rotate_stress(of_body(:, k), motion%rotation)
          if (allocated(body%initial%stress)) of_body(:, k) = of_body(:, k) + body%initial%stress(:, k)
        end do
        stress(alike(i))%value(:, :) = of_body([1, 2, 3, 6, 4, 5], :)
        call take_means(body, solution(alike(i)), stress(alike(i))%value)
      end associate
    end do
  end subroutine recover_some

  !> Take the fit of mean stresses where that is the better one.
  subroutine take_means(body, solution, stress)
    type(body_t), intent(in) :: body  !! The body.
    type(body_solution_t), intent(in) :: solution  !! Its displacements, and stresses where they are known.
    real(dp), intent(inout) :: stress(:, :)  !! Stresses at the nodes (6, n_nodes) [pressure].
    logical :: is_set(size(stress, 2))
    integer :: m
    if (.not. allocated(solution%stress)) return
    if (size(body%material) == 1) then
      is_set = .true.
      call take_stress_of_means(body%mesh, body%analysis, body%material(1), solution%displacement, solution%stress, &
                                is_set, stress)
      return
    end if
    is_set = .false.
    do m = 1, size(body%material)
      call take_stress_of_means(mesh_of_material(body%mesh, m), body%analysis, body%material(m), &
                                solution%displacement, solution%stress(:, elements_of_material(body%mesh, m)), &
                                nodes_of_material(body%mesh, m) .and. .not. is_set, stress)
      is_set = is_set .or. nodes_of_material(body%mesh, m)
    end do
  end subroutine take_means
end module dotyk_control_nodal_stresses
