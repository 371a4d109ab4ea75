!> Meshes and fields of all bodies in the results file (docs/results.md), collected body after body on the first rank,
!> which writes them, from the ranks that hold them. All ranks take part; on one rank nothing is collected.
module dotyk_driver_results_fields
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: field_contact, field_displacement, field_error, field_nodal_stress, field_reaction, &
    field_stress
  use dotyk_control_balance, only: balance_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_body_solution, only: body_solution_t, element_field_t
  use dotyk_control_error_budget, only: error_budget_t
  use dotyk_control_nodal_stresses, only: nodal_stress_t
  use dotyk_control_penetration_check, only: penetration_check_t
  use dotyk_control_pressures, only: contact_fields_t, nodal_field_t, status_none
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_nodal_stress, only: principal_stresses, von_mises
  use dotyk_input_case, only: case_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: kind_nodes
  use dotyk_output_results_file, only: connectivity_length, results_file_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: collect
  implicit none
  private
  public :: write_fields

  type :: whole_body_fields_t  !! One body, of which each rank has its own nodes and elements.
    private
    logical :: is_here = .true.  !! Whether this rank has it all, and writes it.
    integer, allocatable :: node(:), whole_node(:)  !! Own nodes, by this rank and in the whole body (n_own_nodes).
    integer, allocatable :: element(:), whole_element(:)  !! The same of elements, through all blocks (n_own_elements).
    integer, allocatable :: held_node(:)  !! Numbers in the whole body of the nodes of this rank (n_nodes).
    integer, public :: n_nodes = 0, n_elements = 0  !! Numbers of nodes and elements of the whole body.
  contains
    procedure :: init => fields_init
    procedure :: mesh => fields_mesh
    procedure :: of_nodes => fields_of_nodes
    procedure :: of_elements => fields_of_elements
    procedure :: of_surface => fields_of_surface
  end type whole_body_fields_t

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
    type(nodal_stress_t), intent(in) :: nodal_stress(:)  !! Stresses at nodes, if they are wanted (n_bodies).
    type(nodal_field_t), intent(in) :: contact_pressure(:)  !! Contact pressures at the nodes of the bodies (n_bodies).
    type(contact_fields_t), intent(in) :: contact(:)  !! Contact tractions, gaps and status there (n_bodies).
    type(balance_t), intent(in) :: balance  !! Reactions of the supports, if they are known.
    type(error_budget_t), intent(in) :: budget  !! Error budget, with the discretization errors of the elements.
    type(penetration_check_t), intent(in) :: penetration  !! What the check of the deformed bodies found.
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

  !> Number the nodes and elements that this rank has to give.
  subroutine fields_init(self, body, ranks, b)
    class(whole_body_fields_t), intent(out) :: self
    type(body_t), intent(in) :: body  !! The body, or the part of it that this rank holds.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    integer, intent(in) :: b  !! Index of the body.
    integer :: i, k, n, before
    self%is_here = n_ranks() == 1
    self%n_nodes = body%mesh%n_whole_nodes()
    self%n_elements = body%mesh%n_whole_elements()
    if (self%is_here) return
    self%held_node = body%mesh%whole_nodes([(i, i=1, body%mesh%n_nodes())])
    if (allocated(body%mesh%whole)) then
      self%node = pack([(i, i=1, body%mesh%n_nodes())], body%mesh%whole%own_node)
      self%element = pack([(i, i=1, body%mesh%n_elements())], body%mesh%whole%own_element)
      allocate (self%whole_element(body%mesh%n_elements()))
      n = 0
      before = 0
      do k = 1, size(body%mesh%block)
        associate (size_of => size(body%mesh%block(k)%tag))
          self%whole_element(n + 1:n + size_of) = before + body%mesh%whole%element(n + 1:n + size_of)
          n = n + size_of
          before = before + body%mesh%whole%n_of_block(k)
        end associate
      end do
      self%whole_element = self%whole_element(self%element)
    else if (ranks%owner(b) == this_rank() .or. (this_rank() == 0 .and. ranks%is_own(b))) then
      self%node = [(i, i=1, self%n_nodes)]
      self%element = [(i, i=1, self%n_elements)]
      self%whole_element = self%element
    else
      allocate (self%node(0), self%element(0), self%whole_element(0))
    end if
    self%whole_node = self%held_node(self%node)
  end subroutine fields_init

  !> The mesh of the whole body.
  subroutine fields_mesh(self, held, mesh)
    class(whole_body_fields_t), intent(in) :: self
    type(body_mesh_t), intent(in) :: held  !! What this rank holds.
    type(body_mesh_t), intent(out) :: mesh  !! The whole mesh; empty on ranks but the first.
    real(dp), allocatable :: node(:, :), element(:, :), table(:, :)
    integer, allocatable :: chosen(:)
    integer :: k, first, before, n, held_before
    if (self%is_here) then
      mesh = held
      return
    end if
    mesh%file = held%file
    mesh%dimension = held%dimension
    mesh%order_elevated = held%order_elevated
    allocate (node(mesh%dimension + 1, size(held%node_tag)))
    node(:mesh%dimension, :) = held%x
    node(mesh%dimension + 1, :) = real(held%node_tag, dp)
    call self%of_nodes(node, table)
    mesh%x = table(:mesh%dimension, :)
    mesh%node_tag = nint(table(mesh%dimension + 1, :), int64)
    allocate (mesh%block(size(held%block)))
    before = 0
    held_before = 0
    first = 1
    do k = 1, size(held%block)
      associate (block => held%block(k), width => kind_nodes(held%block(k)%kind))
        n = size(block%tag)
        chosen = pack(self%element, self%element > held_before .and. self%element <= held_before + n) - held_before
        associate (number => self%whole_element(first:first + size(chosen) - 1) - before, &
                   of_block => merge(held%whole_block_size(k), 0, this_rank() == 0))
          allocate (element(width + 1, size(chosen)))
          element(:width, :) = reshape(real(held%whole_nodes(reshape(block%node(:, chosen), [width*size(chosen)])), &
                                            dp), [width, size(chosen)])
          element(width + 1, :) = real(block%tag(chosen), dp)
          call collect_rows(number, element, of_block, table)
        end associate
        mesh%block(k)%kind = block%kind
        mesh%block(k)%material = block%material
        mesh%block(k)%node = nint(table(:width, :))
        mesh%block(k)%tag = nint(table(width + 1, :), int64)
        deallocate (element)
        first = first + size(chosen)
        held_before = held_before + n
        before = before + held%whole_block_size(k)
      end associate
    end do
  end subroutine fields_mesh

  !> A field of the nodes.
  subroutine fields_of_nodes(self, held, whole)
    class(whole_body_fields_t), intent(in) :: self
    real(dp), intent(in) :: held(:, :)  !! At the nodes that this rank holds (n, n_held_nodes) [any].
    !> At those of the whole body; of size 0 on ranks but the first (n, n_nodes) [as held].
    real(dp), allocatable, intent(out) :: whole(:, :)
    if (self%is_here) then
      whole = held
    else
      call collect_rows(self%whole_node, held(:, self%node), merge(self%n_nodes, 0, this_rank() == 0), whole)
    end if
  end subroutine fields_of_nodes

  !> A field of the elements. Ranks without own elements may give one of no columns.
  subroutine fields_of_elements(self, held, whole)
    class(whole_body_fields_t), intent(in) :: self
    real(dp), intent(in) :: held(:, :)  !! At the held elements, in the order of blocks (n, n_held_elements) [any].
    !> At those of the whole body; of size 0 on ranks but the first (n, n_elements) [as held].
    real(dp), allocatable, intent(out) :: whole(:, :)
    if (self%is_here) then
      whole = held
    else
      call collect_rows(self%whole_element, held(:, self%element), merge(self%n_elements, 0, this_rank() == 0), whole)
    end if
  end subroutine fields_of_elements

  !> A field of the boundary, which every rank has; it is 0 elsewhere.
  subroutine fields_of_surface(self, held, whole)
    class(whole_body_fields_t), intent(in) :: self
    real(dp), intent(in) :: held(:)  !! At the nodes that this rank holds (n_held_nodes) [any].
    !> At those of the whole body; of size 0 on ranks but the first (n_nodes) [as held].
    real(dp), allocatable, intent(out) :: whole(:)
    if (self%is_here) then
      whole = held
      return
    end if
    allocate (whole(merge(self%n_nodes, 0, this_rank() == 0)), source=0.0_dp)
    if (this_rank() == 0) whole(self%held_node) = held
  end subroutine fields_of_surface

  !> Rows of a table from all ranks.
  subroutine collect_rows(number, own, n, whole)
    integer, intent(in) :: number(:)  !! Numbers in the table of the rows of this rank (n_own).
    real(dp), intent(in) :: own(:, :)  !! Its rows, as columns (width, n_own) [any].
    integer, intent(in) :: n  !! Number of all rows on the first rank, 0 elsewhere.
    real(dp), allocatable, intent(out) :: whole(:, :)  !! All rows, as columns (width, n) [as own].
    real(dp), allocatable :: all(:)
    integer(int64) :: at, first
    integer :: i, n_rows, width
    ! In one exchange: number of rows, their numbers, the rows.
    call collect([real(size(number), dp), real(number, dp), reshape(own, [size(own)])], all)
    width = size(own, 1)
    allocate (whole(width, n))
    at = 0
    do while (at < size(all, kind=int64))
      n_rows = nint(all(at + 1))
      first = at + 1 + n_rows
      do i = 1, n_rows
        whole(:, nint(all(at + 1 + i))) = all(first + (i - 1)*int(width, int64) + 1:first + i*int(width, int64))
      end do
      at = first + n_rows*int(width, int64)
    end do
  end subroutine collect_rows
end module dotyk_driver_results_fields
