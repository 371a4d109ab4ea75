!> Internal forces K u of a displacement, element by element, without the cancellation of the assembled matrix; forces
!> of a body with those of its springs, and reactions of its supports.
!>
!> Where u is nearly rigid, K u is small and computed with the assembled matrix it is the rounding of products that
!> cancel. Here every element first subtracts its own translation and rotation in quadruple precision; the remainder is
!> strain, and its forces are as accurate as the strain. The forces of an element balance each other up to their own
!> rounding, so that forces of a soft support are not lost beside a stiff body.
!>
!> Reactions are K u - f at the nodes where displacements are prescribed, in their directions. K u comes from the
!> elements next to these nodes alone; f has the loads and the contact forces. At nodes in parts of bodies each rank
!> finds the reactions of its own nodes.
module dotyk_elasticity_internal_force
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_assembly, only: extract_elements
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: internal_force, body_force, find_reactions

  !> Elements whose forces are stored before they are added up: enough for the threads, few beside those of a body.
  integer, parameter :: chunk = 8192

contains

  !> Internal forces on all nodes, those at supports included.
  subroutine internal_force(mesh, analysis, material, u, force, energy, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    real(qp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(out) :: force(:, :)  !! Internal forces in global axes (dim, n_nodes) [force].
    real(dp), intent(out) :: energy  !! Twice the strain energy, A(u,u) [energy].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    type(error_t), allocatable :: failed
    real(dp), allocatable :: of_element(:, :, :)
    real(dp) :: energies(chunk)
    integer :: a, b, before, e, n, n_parts, s
    force = 0
    energy = 0
    n_parts = merge(1, omp_get_max_threads(), omp_in_parallel())
    do b = 1, size(mesh%block)
      associate (node => mesh%block(b)%node)
        allocate (of_element(size(force, 1), size(node, 1), min(chunk, size(node, 2))))
        do before = 0, size(node, 2) - 1, chunk
          n = min(chunk, size(node, 2) - before)
          !$omp parallel do default(none) schedule(static, 1) private(failed) shared(n, n_parts, error)
          do s = 1, n_parts
            call evaluate_elements((n*(s - 1))/n_parts + 1, (n*s)/n_parts, failed)
            if (.not. allocated(failed)) cycle
            !$omp critical (dotyk_recovery)
            if (.not. allocated(error)) call move_alloc(failed, error)
            !$omp end critical (dotyk_recovery)
          end do
          !$omp end parallel do
          if (allocated(error)) return
          ! Summed in the order of the elements: the same rounding on any number of threads.
          do e = 1, n
            energy = energy + energies(e)
            do a = 1, size(node, 1)
              force(:, node(a, before + e)) = force(:, node(a, before + e)) + of_element(:, a, e)
            end do
          end do
        end do
        deallocate (of_element)
      end associate
    end do

  contains

    !> Forces and energies of some elements of a chunk of block b: the work of one thread.
    subroutine evaluate_elements(first, last, failed)
      integer, intent(in) :: first, last  !! The first and the last of them, counted in the chunk.
      type(error_t), allocatable, intent(out) :: failed  !! Where an element is inverted or the modulus not positive.
      type(element_quadrature_t) :: points
      real(dp), allocatable :: strained(:, :)
      integer :: e
      if (last < first) return
      call points%init(mesh, b, analysis, material, failed)
      if (allocated(failed)) return
      associate (n => points%n, dim => points%dim, slots => points%slots)
        allocate (strained(dim, n))
        do e = first, last
          call points%move_to(mesh, b, before + e, failed)
          if (allocated(failed)) exit
          call subtract_rigid_motion(n, dim, slots, analysis == analysis_axisymmetric, points%g, points%x, &
                                     u(:, points%node), strained)
          energies(e) = 0
          call forces_of_strain(n, dim, slots, points%n_points, points%g, points%stiffness, points%strain, &
                                points%n_matrices, points%matrix, strained, of_element(:, :, e), energies(e))
          if (points%bulk > 0) then
            call add_dilatation(n, dim, points%n_functions, points%bulk, points%dilatation, strained, &
                                of_element(:, :, e), energies(e))
          end if
        end do
      end associate
      call points%destroy()
    end subroutine evaluate_elements
  end subroutine internal_force

  !> Displacements of the nodes of an element minus the translation of its first node and the rotation at the first
  !> quadrature point.
  pure subroutine subtract_rigid_motion(n, dim, slots, axisymmetric, g, x, u, strained)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    logical, intent(in) :: axisymmetric  !! Whether only the translation along the axis y is rigid.
    real(dp), intent(in) :: g(n, slots)  !! Gradients of the shape functions at the first point (n, slots) [1/length].
    real(dp), intent(in) :: x(dim, n)  !! Nodes (dim, n) [length].
    real(qp), intent(in) :: u(dim, n)  !! Displacements (dim, n) [length].
    real(dp), intent(out) :: strained(dim, n)  !! Displacements without the rigid motion (dim, n) [length].
    real(qp) :: v(dim, n)
    real(dp) :: slope(dim, dim), rotation
    integer :: a, i, j
    v = u
    do i = merge(2, 1, axisymmetric), dim
      v(i, :) = v(i, :) - u(i, 1)
    end do
    strained = real(v, dp)
    if (axisymmetric) return
    slope = matmul(strained, g(:, :dim))
    do j = 1, dim
      do i = 1, dim
        if (i == j) cycle
        rotation = (slope(i, j) - slope(j, i))/2
        do a = 2, n
          v(i, a) = v(i, a) - rotation*(real(x(j, a), qp) - x(j, 1))
        end do
      end do
    end do
    strained = real(v, dp)
  end subroutine subtract_rigid_motion

  !> Internal forces of an element, and its energy.
  pure subroutine forces_of_strain(n, dim, slots, n_points, g, w, strain_of, n_matrices, matrix, u, force, energy)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    real(dp), intent(in) :: g(n, slots, n_points)  !! Gradients of the shape functions (n, slots, n_points) [1/length].
    real(dp), intent(in) :: w(n_points)  !! Weights times the modulus field (n_points) [volume].
    integer, intent(in) :: strain_of(dim, slots)  !! Strain index of each component and slot, 0 for none (dim, slots).
    integer, intent(in) :: n_matrices  !! Number of matrices: 1, or one for each point.
    real(dp), intent(in) :: matrix(6, 6, n_matrices)  !! Unprojected, from strains to stresses [pressure].
    real(dp), intent(in) :: u(dim, n)  !! Displacements (dim, n) [length].
    real(dp), intent(out) :: force(dim, n)  !! Internal forces (dim, n) [force].
    real(dp), intent(inout) :: energy  !! Twice the strain energy, added to [energy].
    real(dp) :: strain(6), stress(6)
    integer :: q, i, s
    force = 0
    do q = 1, n_points
      strain = 0
      do s = 1, slots
        do i = 1, dim
          if (strain_of(i, s) > 0) strain(strain_of(i, s)) = strain(strain_of(i, s)) + dot_product(u(i, :), g(:, s, q))
        end do
      end do
      stress = w(q)*matmul(matrix(:, :, min(q, n_matrices)), strain)
      energy = energy + dot_product(strain, stress)
      do s = 1, slots
        do i = 1, dim
          if (strain_of(i, s) > 0) force(i, :) = force(i, :) + stress(strain_of(i, s))*g(:, s, q)
        end do
      end do
    end do
  end subroutine forces_of_strain

  !> Add the forces and the energy of the projected dilatation.
  pure subroutine add_dilatation(n, dim, n_functions, bulk, d, u, force, energy)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n_functions  !! Number of projection functions.
    real(dp), intent(in) :: bulk  !! Projected part of the bulk modulus [pressure].
    real(dp), intent(in) :: d(n, dim, n_functions)  !! Linear forms from `projected_dilatations` [sqrt(volume)/length].
    real(dp), intent(in) :: u(dim, n)  !! Displacements (dim, n) [length].
    real(dp), intent(inout) :: force(dim, n)  !! Internal forces, added to (dim, n) [force].
    real(dp), intent(inout) :: energy  !! Twice the strain energy, added to [energy].
    real(dp) :: amplitude
    integer :: j
    do j = 1, n_functions
      amplitude = sum(transpose(u)*d(:, :, j))
      force = force + bulk*amplitude*transpose(d(:, :, j))
      energy = energy + bulk*amplitude**2
    end do
  end subroutine add_dilatation

  !> Forces on all nodes, those at supports included.
  subroutine body_force(body, u, force, energy, error)
    type(body_t), intent(in) :: body  !! The body.
    real(qp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(out) :: force(:, :)  !! Forces in global axes (dim, n_nodes) [force].
    real(dp), intent(out) :: energy  !! Twice the energy, u.K u [energy].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    call internal_force(body%mesh, body%analysis, body%material, u, force, energy, error)
    if (allocated(error) .or. body%constraint%foundation%n == 0) return
    call body%constraint%foundation%add_forces(body%mesh%x, body%analysis, real(u, dp), force, energy)
  end subroutine body_force

  !> Forces of the supports on the body at its nodes; 0 at nodes without, and at those of other ranks.
  subroutine find_reactions(body, u, contact_node, contact_force, reaction, error)
    type(body_t), intent(in) :: body  !! The body.
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    integer, intent(in) :: contact_node(:)  !! Contact nodes (n_contact_nodes).
    real(dp), intent(in) :: contact_force(:, :)  !! Contact forces on them (dim, n_contact_nodes) [force].
    real(dp), allocatable, intent(out) :: reaction(:, :)  !! In global axes (dim, n_nodes) [force].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    type(body_mesh_t) :: next_to
    logical, allocatable :: selected(:)
    real(dp) :: energy
    integer :: i
    allocate (reaction(size(u, 1), size(u, 2)), source=0.0_dp)
    selected = any(body%constraint%equation == held, dim=1)
    do i = 1, size(selected)
      if (selected(i)) selected(i) = body%mesh%is_own_node(i)
    end do
    if (.not. any(selected)) return
    call extract_elements(body%mesh, selected, next_to)
    call internal_force(next_to, body%analysis, body%material, real(u, qp), reaction, energy, error)
    if (allocated(error)) return
    call body%constraint%foundation%add_forces(body%mesh%x, body%analysis, u, reaction, energy)
    reaction = reaction - body%load
    reaction(:, contact_node) = reaction(:, contact_node) - contact_force
    do i = 1, size(selected)
      if (selected(i)) then
        call keep_prescribed(body%constraint, i, reaction(:, i))
      else
        reaction(:, i) = 0
      end if
    end do
  end subroutine find_reactions

  !> Keep the components of a force along prescribed displacements: along free ones it is the residual of the solution.
  pure subroutine keep_prescribed(constraint, node, force)
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes.
    integer, intent(in) :: node  !! The node.
    real(dp), intent(inout) :: force(:)  !! Force in global axes (dim) [force].
    associate (equation => constraint%equation(:, node), k => constraint%frame_of(node))
      if (k > 0) force = matmul(force, constraint%frame(:, :, k))
      where (equation /= held) force = 0
      if (k > 0) force = matmul(constraint%frame(:, :, k), force)
    end associate
  end subroutine keep_prescribed
end module dotyk_elasticity_internal_force
