!> Meshes and fields of all bodies in the results file (docs/results.md), collected on the first rank, which writes
!> them.
module dotyk_driver_results_fields
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: field_contact, field_displacement, field_error, field_nodal_stress, field_reaction, &
    field_stress
  use dotyk_control_balance, only: balance_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_fields, only: contact_fields_t, status_none
  use dotyk_control_error_budget, only: error_budget_t
  use dotyk_control_body_solution, only: element_field_t
  use dotyk_control_nodal_stresses, only: nodal_stress_t
  use dotyk_control_penetration_check, only: penetration_check_t
  use dotyk_control_pressures, only: nodal_field_t
  use dotyk_driver_whole_bodies, only: whole_body_fields_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_nodal_stress, only: principal_stresses
  use dotyk_elasticity_stress, only: von_mises
  use dotyk_input_case, only: case_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_output_results_file, only: connectivity_length, results_file_t
  use dotyk_ranks_communication, only: this_rank
  implicit none
  private
  public :: write_fields

contains

  !> Create the file with the first load case; meshes, displacements, contact pressures and stresses of all bodies.
  subroutine write_fields(file, case, step, body, ranks, solution, nodal_stress, contact_pressure, contact, balance, &
                          budget, penetration, error)
    type(results_file_t), intent(inout) :: file  !! Results file; open on return, on the first rank.
    type(case_t), intent(in) :: case  !! The case, with the fields to write.
    integer, intent(in) :: step  !! The load case; the first one creates the file.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements and stresses of the bodies (n_bodies).
    !> Stresses at the nodes of the bodies, if they are wanted (n_bodies).
    type(nodal_stress_t), intent(in) :: nodal_stress(:)
    type(nodal_field_t), intent(in) :: contact_pressure(:)  !! Contact pressures at the nodes of the bodies (n_bodies).
    type(contact_fields_t), intent(in) :: contact(:)  !! Contact tractions, gaps and status there (n_bodies).
    type(balance_t), intent(in) :: balance  !! Reactions of the supports, if they are known.
    type(error_budget_t), intent(in) :: budget  !! Error budget, with the discretization errors of the elements.
    !> Outcome of the check of the deformed bodies against each other.
    type(penetration_check_t), intent(in) :: penetration
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written; it is discarded.
    integer(int64), dimension(size(body)) :: n_points, n_cells, n_connectivity
    type(whole_body_fields_t) :: fields
    type(body_mesh_t) :: mesh
    real(dp), allocatable :: values(:, :), vectors(:, :), nodal(:), status(:), mises(:)
    logical :: writes
    integer :: b, e, k
    do b = 1, size(body)
      n_points(b) = body(b)%mesh%n_whole_nodes()
      n_cells(b) = body(b)%mesh%n_whole_elements()
      n_connectivity(b) = connectivity_length(body(b)%mesh)
      if (.not. allocated(body(b)%mesh%face)) cycle
      ! The faces of a body without volume, all of which every rank has, are its cells.
      if (allocated(mesh%block)) deallocate (mesh%block)
      mesh%block = body(b)%mesh%face
      n_cells(b) = mesh%n_elements()
      n_connectivity(b) = connectivity_length(mesh)
    end do
    writes = this_rank() == 0
    if (writes .and. step == 1) &
      call file%begin(case%scene%output, n_points, n_cells, n_connectivity, case%output%field, &
                      merge(case%n_cases(), 0, case%has_cases()))
    if (writes .and. case%has_cases()) call file%begin_case(step, case%load_case(step)%name)
    ! All ranks take part to the end, even where the first one cannot write.
    do b = 1, size(body)
      call fields%init(body(b), ranks, b)
      if (step == 1) then
        call fields%mesh(body(b)%mesh, mesh)
        if (allocated(body(b)%mesh%face)) mesh%block = body(b)%mesh%face
        do k = 1, size(mesh%block)
          mesh%block(k)%material = case%body(b)%material(mesh%block(k)%material)
        end do
        if (writes) call file%write_part(b, mesh)
      end if
      if (case%output%field(field_displacement)) then
        call fields%of_nodes(solution(b)%displacement, values)
        if (writes) call file%write_field(b, 'PointData/displacement', values)
      end if
      if (case%output%field(field_contact)) then
        call fields%of_surface(contact_pressure(b)%value, nodal)
        if (writes) call file%write_field(b, 'PointData/contact_pressure', nodal)
        if (penetration%is_done) call fields%of_surface(penetration%depth(b)%value, nodal)
        if (penetration%is_done .and. writes) call file%write_field(b, 'PointData/penetration', nodal)
        allocate (vectors(size(contact(b)%traction, 1), size(nodal)))
        do k = 1, size(vectors, 1)
          call fields%of_surface(contact(b)%traction(k, :), nodal)
          vectors(k, :) = nodal
        end do
        if (writes) call file%write_field(b, 'PointData/contact_traction', vectors)
        deallocate (vectors)
        call fields%of_surface(contact(b)%gap, nodal)
        call fields%of_surface(real(contact(b)%status, dp), status)
        ! Of bodies of other ranks the surface alone is known.
        where (nint(status) == status_none) nodal = ieee_value(0.0_dp, ieee_quiet_nan)
        if (writes) call file%write_field(b, 'PointData/contact_gap', nodal)
        if (writes) call file%write_field(b, 'PointData/contact_status', nint(status))
      end if
      if (case%output%field(field_reaction)) then
        call fields%of_nodes(reactions_of(b), values)
        if (writes) call file%write_field(b, 'PointData/reaction_force', values)
      end if
      if (case%output%field(field_nodal_stress)) then
        call fields%of_nodes(nodal_stress_of(b), values)
        mises = [(von_mises(values(:, k)), k=1, size(values, 2))]
        vectors = reshape([(principal_stresses(values(:, k)), k=1, size(values, 2))], [3, size(values, 2)])
        if (writes) call file%write_field(b, 'PointData/nodal_stress', values)
        if (writes) call file%write_field(b, 'PointData/nodal_von_mises', mises)
        if (writes) call file%write_field(b, 'PointData/nodal_principal_stress', vectors)
        deallocate (vectors)
      end if
      if (case%output%field(field_stress)) then
        call fields%of_elements(stress_of(solution(b)), values)
        if (allocated(body(b)%mesh%face)) values = spread([(0.0_dp, k=1, 6)], 2, int(n_cells(b)))
        mises = [(von_mises(values(:, e)), e=1, size(values, 2))]
        if (writes) call file%write_field(b, 'CellData/stress', values)
        if (writes) call file%write_field(b, 'CellData/von_mises', mises)
      end if
      if (case%output%field(field_error)) then
        call fields%of_elements(errors_of(budget%of_element(b)), values)
        if (allocated(body(b)%mesh%face)) values = spread([0.0_dp], 2, int(n_cells(b)))
        if (writes) call file%write_field(b, 'CellData/discretization_error', [values])
      end if
    end do
    if (writes) call file%raise(error)

  contains

    !> Reactions at the nodes that this rank holds; 0 where other ranks compute the body (dim, n_nodes) [force].
    function reactions_of(b) result(reaction)
      integer, intent(in) :: b  !! Index of the body.
      real(dp), allocatable :: reaction(:, :)
      allocate (reaction(body(b)%dimension, body(b)%mesh%n_nodes()), source=0.0_dp)
      if (.not. allocated(balance%body)) return
      if (allocated(balance%body(b)%nodal)) reaction = balance%body(b)%nodal
    end function reactions_of

    !> Stresses at the nodes that this rank holds; 0 where other ranks compute the body (6, n_nodes) [pressure].
    function nodal_stress_of(b) result(stress)
      integer, intent(in) :: b  !! Index of the body.
      real(dp), allocatable :: stress(:, :)
      allocate (stress(6, body(b)%mesh%n_nodes()), source=0.0_dp)
      if (allocated(nodal_stress(b)%value)) stress = nodal_stress(b)%value
    end function nodal_stress_of
  end subroutine write_fields

  !> Stresses that this rank has (6, n_elements) [pressure].
  pure function stress_of(solution) result(stress)
    type(body_solution_t), intent(in) :: solution  !! Of one body.
    real(dp), allocatable :: stress(:, :)
    allocate (stress(6, 0))
    if (allocated(solution%stress)) stress = solution%stress
  end function stress_of

  !> Discretization errors that this rank has (1, n_elements) [].
  pure function errors_of(field) result(values)
    type(element_field_t), intent(in) :: field  !! Of one body.
    real(dp), allocatable :: values(:, :)
    allocate (values(1, 0))
    if (allocated(field%value)) values = reshape(field%value, [1, size(field%value)])
  end function errors_of
end module dotyk_driver_results_fields
