!> Stiffness matrix of a body: element by element into the pattern, without intermediate lists.
module dotyk_elasticity_assembly
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_magnitude, only: size_rule, smallest_number
  use dotyk_base_text, only: text_t, to_text
  use dotyk_elasticity_analysis, only: analysis_3d, gradient_slots, strain_index
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_dilatation, only: add_projected_stiffness, kept_bulk, most_projections, n_projections, &
    projected_dilatations, projection_functions
  use dotyk_elasticity_element_order, only: element_order
  use dotyk_elasticity_element_shares, only: element_shares_t
  use dotyk_elasticity_element_table, only: element_table_t, map_element, table_pair_t
  use dotyk_elasticity_field, only: field_t, place_text
  use dotyk_elasticity_kernel, only: gradient_products, rotate_blocks, stiffness_general, stiffness_isotropic
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_pattern, only: block_places_t, scatter
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: assemble_stiffness, read_factor, apply_factor, bad_element

contains

  !> Add the stiffness of all elements to a matrix of zeros, and the forces of given displacements to the right-hand
  !> side.
  subroutine assemble_stiffness(mesh, analysis, material, constraint, places, matrix, rhs, volume, mean_factor, error)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    type(constraint_t), intent(in) :: constraint
    !> Places of the blocks.
    type(block_places_t), intent(in) :: places
    !> The matrix with its pattern.
    type(sparse_symmetric_t), intent(inout) :: matrix
    !> Right-hand side, from which K_fc z is subtracted (n_equations) [force].
    real(dp), intent(inout) :: rhs(:)
    !> Volume of the body, that of the full turn in axisymmetric analyses [length^dim].
    real(dp), intent(out) :: volume
    !> Mean over the volume of the factor on the stiffness [1].
    real(dp), intent(out) :: mean_factor
    !> Allocated where an element is inverted or the factor is not positive.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: of_element(:), factor_of_element(:)
    integer :: i, first, last
    allocate (of_element(mesh%n_elements()), factor_of_element(mesh%n_elements()))
    volume = 0
    mean_factor = 0
    last = 0
    do i = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(i)%node, 2)
      call assemble_block(mesh, i, analysis, material, constraint, places, matrix, rhs, of_element(first:last), &
                          factor_of_element(first:last), error)
      if (allocated(error)) return
    end do
    volume = sum(of_element)
    mean_factor = sum(factor_of_element)/volume
  end subroutine assemble_stiffness

  !> The elements of one block, shared out over the threads.
  subroutine assemble_block(mesh, i_block, analysis, material, constraint, places, matrix, rhs, volume, factor_integral, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(constraint_t), intent(in) :: constraint
    type(block_places_t), intent(in) :: places
    type(sparse_symmetric_t), intent(inout) :: matrix
    real(dp), intent(inout) :: rhs(:)
    !> Of the elements [length^dim].
    real(dp), intent(inout) :: volume(:), factor_integral(:)
    type(error_t), allocatable, intent(out) :: error
    type(element_shares_t) :: shares
    type(error_t), allocatable :: failed
    logical, allocatable :: special(:)
    integer, allocatable :: order(:)
    integer :: i, s, place, first_failed
    ! Nodes that are neither plainly free nor held at zero.
    allocate (special(mesh%n_nodes()))
    special(:) = constraint%frame_of > 0
    do i = 1, size(special)
      if (any(abs(constraint%prescribed(:, i)) > 0)) special(i) = .true.
    end do
    allocate (order(size(mesh%block(i_block)%node, 2)))
    call element_order(mesh%dimension, mesh%x, mesh%block(i_block)%node, order)
    call shares%init(mesh%n_nodes(), mesh%block(i_block)%node, order, merge(1, omp_get_max_threads(), omp_in_parallel()))
    first_failed = huge(first_failed)
    !$omp parallel do default(none) schedule(static, 1) private(failed, place) &
    !$omp& shared(mesh, i_block, analysis, material, constraint, places, matrix, rhs, volume, factor_integral, shares, special, &
    !$omp& order, first_failed, error)
    do s = 1, shares%n
      call assemble_share(mesh, i_block, analysis, material, constraint, places, shares, s, special, order, matrix, rhs, &
                          volume, factor_integral, place, failed)
      if (.not. allocated(failed)) cycle
      ! The first one in the order, as with one thread.
      !$omp critical(dotyk_assembly)
      if (place < first_failed) then
        first_failed = place
        call move_alloc(failed, error)
      end if
      !$omp end critical(dotyk_assembly)
    end do
    !$omp end parallel do
  end subroutine assemble_block

  !> One thread's elements of a block.
  subroutine assemble_share(mesh, i_block, analysis, material, constraint, places, shares, share, special, order, matrix, rhs, &
      volume, factor_integral, place, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(constraint_t), intent(in) :: constraint
    type(block_places_t), intent(in) :: places
    type(element_shares_t), intent(in) :: shares
    integer, intent(in) :: share
    !> Nodes that are neither plainly free nor held at zero (n_nodes).
    logical, intent(in) :: special(:)
    !> The element that comes k-th.
    integer, intent(in) :: order(:)
    type(sparse_symmetric_t), intent(inout) :: matrix
    real(dp), intent(inout) :: rhs(:), volume(:), factor_integral(:)
    !> Place of the element that is wrong.
    integer, intent(out) :: place
    type(error_t), allocatable, intent(out) :: error
    type(field_t) :: factor
    type(table_pair_t) :: tables
    type(element_kind_t) :: kind
    real(dp), allocatable :: x(:, :), g(:), w(:), products(:), k(:), value(:), dilatation(:)
    integer, allocatable :: node(:), strain(:, :), frame_of(:)
    real(dp) :: matrix_of_material(6, 6), lambda, bulk, worst
    integer :: n, dim, slots, most_points, n_functions, e, i, s
    logical :: fast
    place = 0
    ! One formula serves one thread.
    call read_factor(material, factor, error)
    if (allocated(error)) return
    kind = element_kind(mesh%block(i_block)%kind)
    n = kind%n_nodes
    dim = mesh%dimension
    slots = gradient_slots(analysis)
    fast = material%isotropic .and. analysis == analysis_3d
    call material%split(analysis, kept_bulk(mesh%block(i_block)%kind, material%incompressibility), &
                        matrix_of_material, lambda, bulk)
    n_functions = n_projections(mesh%block(i_block)%kind, dim)
    strain = reshape([((strain_index(analysis, i, s), i=1, dim), s=1, slots)], [dim, slots])
    call tables%init_stiffness(mesh%block(i_block)%kind, analysis, .not. factor%constant)
    most_points = max(tables%straight%n_points, tables%curved%n_points)
    allocate (x(dim, n), g(n*slots*most_points), w(most_points), products((n*slots)**2), k((n*dim)**2))
    allocate (node(n), frame_of(n), value(most_points*most_projections), dilatation(n*dim*most_projections))
    do i = shares%first(share), shares%first(share + 1) - 1
      place = shares%place(i)
      e = order(place)
      node(:) = mesh%block(i_block)%node(:, e)
      x(:, :) = mesh%x(:, node)
      if (tables%is_curved(x)) then
        call add_element(tables%curved)
      else
        call add_element(tables%straight)
      end if
      if (allocated(error)) exit
    end do
    call factor%destroy()

  contains

    subroutine add_element(table)
      type(element_table_t), intent(in) :: table
      integer :: n_points
      n_points = table%n_points
      call map_element(n, dim, slots, n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
      if (.not. worst > 0) then
        call bad_element(mesh, i_block, e, error)
        return
      end if
      if (i <= shares%own(share)) volume(e) = sum(w(:n_points))
      if (.not. factor%constant) then
        call apply_factor(factor, table%shape, x, mesh%block(i_block)%tag(e), w(:n_points), error)
        if (allocated(error)) return
      end if
      if (i <= shares%own(share)) factor_integral(e) = sum(w(:n_points))
      call gradient_products(n, slots, n_points, g, w, products)
      if (fast) then
        call stiffness_isotropic(n, lambda, material%mu, products, k)
      else
        call stiffness_general(n, dim, slots, strain, matrix_of_material, products, k)
      end if
      if (bulk > 0) then
        call projection_functions(n, dim, n_points, n_functions, table%shape, x, w, value)
        call projected_dilatations(n, dim, slots, n_points, n_functions, g, w, value, dilatation)
        call add_projected_stiffness(n, dim, n_functions, bulk, dilatation, k)
      end if
      if (any(special(node))) then
        frame_of(:) = constraint%frame_of(node)
        call rotate_blocks(n, dim, size(constraint%frame, 3), frame_of, constraint%frame, k)
        call move_prescribed(n, dim, size(special), node, k, share, shares%owner, constraint%equation, &
                             constraint%prescribed, rhs)
      end if
      call scatter(n, dim, size(special), node, k, share, shares%owner, constraint%equation, places%n_free, places%first, &
                   places%neighbour, places%offset, matrix%column_start, matrix%value)
    end subroutine add_element
  end subroutine assemble_share

  !> Subtract the forces of given displacements from the right-hand side.
  pure subroutine move_prescribed(n, dim, n_nodes, node, k, share, owner, equation, prescribed, rhs)
    integer, intent(in) :: n, dim, n_nodes
    !> Nodes of the element.
    integer, intent(in) :: node(n)
    !> Stiffness along the nodes' axes: node a, node b, component i, component j.
    real(dp), intent(in) :: k(n, n, dim, dim)
    !> A share, and the one that each node belongs to: forces on nodes of others are left to these.
    integer, intent(in) :: share, owner(n_nodes)
    integer, intent(in) :: equation(dim, n_nodes)
    !> Given displacements along the nodes' axes, zero where free.
    real(dp), intent(in) :: prescribed(dim, n_nodes)
    real(dp), intent(inout) :: rhs(*)
    integer :: a, b, i, j, row
    do b = 1, n
      do j = 1, dim
        if (.not. abs(prescribed(j, node(b))) > 0) cycle
        do i = 1, dim
          do a = 1, n
            if (owner(node(a)) /= share) cycle
            row = equation(i, node(a))
            if (row > 0) rhs(row) = rhs(row) - k(a, b, i, j)*prescribed(j, node(b))
          end do
        end do
      end do
    end do
  end subroutine move_prescribed

  !> Parse the factor on the stiffness of a material: 1 where it has none.
  subroutine read_factor(material, factor, error)
    type(material_t), intent(in) :: material
    !> The factor is the first component.
    type(field_t), intent(inout) :: factor
    type(error_t), allocatable, intent(out) :: error
    type(text_t), allocatable :: text(:)
    if (material%has_factor()) then
      allocate (text(1))
      text(1)%s = material%factor_text
    end if
    call factor%init([1.0_dp, 0.0_dp, 0.0_dp], error, text)
    call add_context(error, 'young_formula: ')
  end subroutine read_factor

  !> Multiply the weights of an element's points by the factor on the stiffness.
  subroutine apply_factor(factor, shape, x, tag, w, error)
    type(field_t), intent(in) :: factor
    !> Shape functions at the points (n_nodes, n_points).
    real(dp), intent(in) :: shape(:, :)
    !> Nodes of the element (dim, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Tag of the element, for messages.
    integer(int64), intent(in) :: tag
    !> Weights (n_points).
    real(dp), intent(inout) :: w(:)
    !> Allocated where the factor is not a positive number.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: place(size(x, 1)), value(3)
    integer :: q
    do q = 1, size(w)
      place = matmul(x, shape(:, q))
      call factor%evaluate(place, value, error)
      if (.not. allocated(error)) then
        if (.not. value(1) > 0) then
          call set_error(error, 'the factor on the stiffness must be positive, it is '//to_text(value(1))//' at '// &
                         place_text(place), exit_bad_input)
        else if (.not. value(1) >= smallest_number) then
          call set_error(error, 'the formula is '//to_text(value(1))//' at '//place_text(place)//'; '//size_rule, exit_bad_input)
        end if
      end if
      if (allocated(error)) then
        call add_context(error, 'young_formula: ')
        error%message = error%message//' (element '//to_text(tag)//')'
        return
      end if
      w(q) = w(q)*value(1)
    end do
  end subroutine apply_factor

  !> The error of an element that cannot be mapped.
  subroutine bad_element(mesh, i_block, e, error)
    type(body_mesh_t), intent(in) :: mesh
    !> The block, and the element in it.
    integer, intent(in) :: i_block, e
    type(error_t), allocatable, intent(out) :: error
    type(element_kind_t) :: kind
    character(:), allocatable :: what
    kind = element_kind(mesh%block(i_block)%kind)
    what = ' is inverted or has no volume'
    if (mesh%dimension == 2) then
      if (any(mesh%x(1, mesh%block(i_block)%node(:, e)) < 0)) what = ' is inverted, or lies beyond the axis x = 0'
    end if
    call set_error(error, 'element '//to_text(mesh%block(i_block)%tag(e))//' ('//trim(kind%name)//')'//what// &
      ' near '//place_text(mesh%x(:, mesh%block(i_block)%node(1, e))), exit_not_solvable)
  end subroutine bad_element
end module dotyk_elasticity_assembly
