!> Mean dilatations of elements, with their centroids and volumes.
module dotyk_elasticity_mean_dilatation
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_elasticity_shape_table, only: map_element, shape_table_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: is_projected, mean_dilatations

contains

  !> Whether a part of the dilatation is projected on some element of the body.
  pure logical function is_projected(mesh, analysis, material)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the body.
    integer :: b
    is_projected = .false.
    if (analysis == analysis_plane_stress) return
    do b = 1, size(mesh%block)
      associate (ratio => material%incompressibility)
        if (ratio > unprojected_bulk_ratio(mesh%block(b)%kind, ratio)) is_projected = .true.
      end associate
    end do
  end function is_projected

  !> Mean dilatations, centroids and volumes of all elements, in the order of the blocks.
  subroutine mean_dilatations(mesh, analysis, u, mean, centre, volume, thermal)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: u(:, :)  !! Displacements in the axes of the mesh (dim, n_nodes) [length].
    real(dp), allocatable, intent(out) :: mean(:)  !! Mean dilatation of each element (n_elements) [].
    real(dp), allocatable, intent(out) :: centre(:, :)  !! Centroid of each element (dim, n_elements) [length].
    !> Volume of each element, 0 for inverted elements (n_elements) [volume].
    real(dp), allocatable, intent(out) :: volume(:)
    !> Thermal dilatation at the nodes, which is subtracted; none where absent (n_nodes) [].
    real(dp), intent(in), optional :: thermal(:)
    real(dp), allocatable :: expanded(:)
    integer :: b, first, last
    allocate (expanded(mesh%n_nodes()), source=0.0_dp)
    if (present(thermal)) expanded(:) = thermal
    allocate (mean(mesh%n_elements()), centre(mesh%dimension, mesh%n_elements()), volume(mesh%n_elements()))
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      call block_mean_dilatations(mesh, b, analysis, u, expanded, mean(first:last), centre(:, first:last), &
                                  volume(first:last))
    end do
  end subroutine mean_dilatations

  !> Mean dilatations, centroids and volumes of the elements of a block.
  subroutine block_mean_dilatations(mesh, i_block, analysis, u, expanded, mean, centre, volume)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: u(:, :)  !! Displacements in the axes of the mesh (dim, n_nodes) [length].
    real(dp), intent(in) :: expanded(:)  !! Thermal dilatation at the nodes (n_nodes) [].
    real(dp), intent(out) :: mean(:)  !! Mean dilatation of each element of the block (n_elements) [].
    real(dp), intent(out) :: centre(:, :)  !! Centroid of each element (dim, n_elements) [length].
    real(dp), intent(out) :: volume(:)  !! Volume of each element, 0 for inverted elements (n_elements) [volume].
    type(shape_table_t) :: table
    type(element_kind_t) :: kind
    integer :: e
    kind = element_kind(mesh%block(i_block)%kind)
    call table%init(mesh%block(i_block)%kind, 2*kind%order)
    !$omp parallel do default(none) schedule(static) &
    !$omp& shared(mesh, i_block, analysis, table, u, expanded, mean, centre, volume)
    do e = 1, size(mean)
      associate (node => mesh%block(i_block)%node(:, e))
        call element_mean_dilatation(table%n_nodes, mesh%dimension, gradient_slots(analysis), table%n_points, table, &
                                     mesh%x(:, node), u(:, node), expanded(node), mean(e), centre(:, e), volume(e))
      end associate
    end do
    !$omp end parallel do
  end subroutine block_mean_dilatations

  !> Mean dilatation, centroid and volume of an element.
  pure subroutine element_mean_dilatation(n, dim, slots, n_points, table, x, u, expanded, mean, centre, volume)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    type(shape_table_t), intent(in) :: table  !! Shape functions at the quadrature points.
    real(dp), intent(in) :: x(dim, n)  !! Nodes (dim, n) [length].
    real(dp), intent(in) :: u(dim, n)  !! Nodal displacements (dim, n) [length].
    real(dp), intent(in) :: expanded(n)  !! Thermal dilatation at the nodes, which is subtracted (n) [].
    real(dp), intent(out) :: mean  !! Mean dilatation [].
    real(dp), intent(out) :: centre(dim)  !! Centroid (dim) [length].
    real(dp), intent(out) :: volume  !! Volume, 0 where the element is inverted [volume].
    real(dp) :: g(n, slots, n_points), w(n_points), worst
    integer :: i, q
    mean = 0
    centre = x(:, 1)
    volume = 0
    call map_element(n, dim, slots, n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
    if (.not. worst > 0) return
    volume = sum(w)
    do q = 1, n_points
      do i = 1, dim
        mean = mean + w(q)*dot_product(g(:, i, q), u(i, :))
      end do
      if (slots > dim) mean = mean + w(q)*dot_product(g(:, 3, q), u(1, :))
      mean = mean - w(q)*dot_product(table%shape(:, q), expanded)
    end do
    mean = mean/volume
    centre = matmul(x, matmul(table%shape, w))/volume
  end subroutine element_mean_dilatation
end module dotyk_elasticity_mean_dilatation
