!> Mean dilatations of elements, and the recovered dilatation: a continuous function fitted to them.
!>
!> Around each vertex a linear function is fitted to the means of the elements by least squares, weighted with their
!> volumes: the elements of the vertex, or two rings where these do not determine the function (at boundaries), or a
!> constant where two rings do not either. Alternating errors, such as the checkerboard pressures of quadrilaterals and
!> hexahedra with a constant dilatation, cancel in the fit: `smooth_pressures` removes them from element stresses. The
!> error estimate of nearly incompressible bodies compares projected dilatations with the fit
!> (`dotyk_elasticity_discretization_error`).
module dotyk_elasticity_dilatation_fit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_number_set, only: number_set_t
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_field, only: material_field_t, point_constants_t
  use dotyk_elasticity_node_graph, only: incidence_t
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_elasticity_recovery_patch, only: diagonalize
  use dotyk_elasticity_shape_table, only: map_element, shape_table_t
  use dotyk_linalg_dense, only: factorize_gram, solve_gram
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: fit_dilatations, smooth_pressures, mean_dilatations

  type, public :: dilatation_fit_t  !! A linear function at each vertex.
    !> Value at the vertex [] and gradient [1/length]; zero at nodes that are no vertices (1 + dim, n_nodes).
    real(dp), allocatable :: coefficient(:, :)
  contains
    procedure :: init => dilatation_fit_init
    procedure :: values => dilatation_fit_values
  end type dilatation_fit_t


  !> Smallest inverse condition number of the least squares for which the linear function counts as determined: with
  !> less, extrapolation to the vertex amplifies alternating errors.
  real(dp), parameter :: determined = 1.0e-2_dp
  integer, parameter :: most_rings = 2  !! Largest number of rings of elements around a vertex.

contains

  !> Fit the dilatations of several bodies of one mesh and material, where a part of the dilatation is projected.
  subroutine fit_dilatations(mesh, analysis, material, u, thermal, fits)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the body.
    real(dp), intent(in) :: u(:, :, :)  !! Displacements in the axes of the mesh (n_bodies, dim, n_nodes) [length].
    !> Thermal dilatations at the nodes, which are subtracted; none where not allocated (n_bodies, n_nodes) [].
    real(dp), allocatable, intent(in) :: thermal(:, :)
    type(dilatation_fit_t), allocatable, intent(out) :: fits(:)  !! By bodies; empty where none is projected (n_bodies).
    real(dp), allocatable :: mean(:), centre(:, :), volume(:)
    integer :: i
    if (.not. is_projected(mesh, analysis, material)) then
      allocate (fits(0))
      return
    end if
    allocate (fits(size(u, 1)))
    do i = 1, size(fits)
      if (allocated(thermal)) then
        call mean_dilatations(mesh, analysis, u(i, :, :), mean, centre, volume, thermal(i, :))
      else
        call mean_dilatations(mesh, analysis, u(i, :, :), mean, centre, volume)
      end if
      call fits(i)%init(mesh, mean, centre, volume)
    end do
  end subroutine fit_dilatations

  !> Replace the pressures of linear quadrilaterals and hexahedra by those of the fit, which do not alternate.
  subroutine smooth_pressures(mesh, analysis, material, u, factor, stress, thermal)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the body.
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(in) :: factor(:)  !! Mean of the modulus field over each element (n_elements) [].
    real(dp), intent(inout) :: stress(:, :)  !! Mean stresses, of which xx, yy, zz change (6, n_elements) [pressure].
    real(dp), intent(in), optional :: thermal(:)  !! Thermal dilatation at the nodes; none where absent (n_nodes) [].
    type(dilatation_fit_t) :: fit
    type(element_kind_t) :: kind
    real(dp), allocatable :: mean(:), centre(:, :), volume(:)
    type(material_field_t) :: field
    type(point_constants_t) :: here
    type(error_t), allocatable :: error
    real(dp) :: matrix(6, 6), lambda, bulk, smooth(1)
    integer :: b, e, first, last
    if (.not. is_projected(mesh, analysis, material)) return
    call mean_dilatations(mesh, analysis, u, mean, centre, volume, thermal)
    call fit%init(mesh, mean, centre, volume)
    ! Assembly has found mistakes of the formulas.
    call field%init(material, error)
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      kind = element_kind(mesh%block(b)%kind)
      if (kind%order > 1) cycle
      call material%split(analysis, unprojected_bulk_ratio(mesh%block(b)%kind, material%incompressibility), matrix, &
                          lambda, bulk)
      do e = first, last
        associate (node => mesh%block(b)%node(:, e - first + 1))
          call fit%values(mesh%x(:, node), node, spread([1.0_dp/size(node)], 2, size(node)), &
                          reshape(centre(:, e), [1, size(centre, 1)]), smooth)
        end associate
        if (field%varies) then
          call field%at(analysis, centre(:, e), here, error, mesh%block(b)%kind)
          bulk = here%bulk
          if (allocated(error)) bulk = 0
        end if
        stress(1:3, e) = stress(1:3, e) + bulk*factor(e)*(smooth(1) - mean(e))
      end do
    end do
    call field%destroy()
  end subroutine smooth_pressures

  !> Fit a linear function around each vertex.
  subroutine dilatation_fit_init(self, mesh, mean, centre, volume)
    class(dilatation_fit_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(in) :: mean(:)  !! Mean dilatation of each element (n_elements) [].
    real(dp), intent(in) :: centre(:, :)  !! Centroid of each element (dim, n_elements) [length].
    real(dp), intent(in) :: volume(:)  !! Volume of each element (n_elements) [volume].
    type(incidence_t) :: elements
    type(number_set_t) :: patch
    logical, allocatable :: is_vertex(:)
    integer :: b, i, ring
    logical :: done
    allocate (self%coefficient(1 + mesh%dimension, mesh%n_nodes()), source=0.0_dp)
    allocate (is_vertex(mesh%n_nodes()), source=.false.)
    do b = 1, size(mesh%block)
      do i = 1, corners_of(mesh%block(b)%kind)
        is_vertex(mesh%block(b)%node(i, :)) = .true.
      end do
    end do
    call elements%init(mesh)
    !$omp parallel do default(none) shared(self, mesh, mean, centre, volume, elements, is_vertex) &
    !$omp& private(ring, done, patch) schedule(dynamic, 64)
    do i = 1, mesh%n_nodes()
      if (.not. is_vertex(i)) cycle
      call patch%clear()
      call add_elements(elements, i, patch)
      do ring = 1, most_rings
        if (ring > 1) call add_neighbours(elements, patch)
        call fit(mesh%dimension, patch%n, patch%member(:patch%n), mesh%x(:, i), mean, centre, volume, &
                 self%coefficient(:, i), done)
        if (done) exit
      end do
    end do
    !$omp end parallel do
  end subroutine dilatation_fit_init

  !> Number of corners of an element kind.
  pure integer function corners_of(kind)
    integer, intent(in) :: kind  !! Element kind: one of the `element_*` constants.
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    corners_of = properties%n_corners
  end function corners_of

  !> Add the elements of a node to a patch.
  pure subroutine add_elements(elements, node, patch)
    type(incidence_t), intent(in) :: elements  !! Incidence of nodes and elements.
    integer, intent(in) :: node  !! The node.
    type(number_set_t), intent(inout) :: patch  !! Elements of the patch.
    integer :: k
    do k = elements%first(node), elements%first(node + 1) - 1
      call patch%add(elements%element(k))
    end do
  end subroutine add_elements

  !> Add one ring: the elements of all nodes of the elements in a patch.
  pure subroutine add_neighbours(elements, patch)
    type(incidence_t), intent(in) :: elements  !! Incidence of nodes and elements.
    type(number_set_t), intent(inout) :: patch  !! Elements of the patch.
    integer :: i, p
    do i = 1, patch%n
      do p = elements%start(patch%member(i)), elements%start(patch%member(i) + 1) - 1
        call add_elements(elements, elements%node(p), patch)
      end do
    end do
  end subroutine add_neighbours

  !> Fit a linear function by least squares, or a constant where the elements do not determine a linear one.
  subroutine fit(dim, n, list, vertex, mean, centre, volume, coefficient, done)
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n  !! Number of elements.
    integer, intent(in) :: list(n)  !! Elements (n).
    real(dp), intent(in) :: vertex(dim)  !! Position of the vertex (dim) [length].
    real(dp), intent(in) :: mean(:)  !! Mean dilatation of each element of the body (n_elements) [].
    real(dp), intent(in) :: centre(:, :)  !! Centroid of each element of the body (dim, n_elements) [length].
    real(dp), intent(in) :: volume(:)  !! Volume of each element of the body (n_elements) [volume].
    real(dp), intent(out) :: coefficient(1 + dim)  !! Value at the vertex [] and gradient [1/length] (1 + dim).
    logical, intent(out) :: done  !! Whether the elements determine the linear function.
    real(dp), dimension(1 + dim, 1 + dim) :: gram, r
    real(dp) :: row(1 + dim), moment(1, 1 + dim), axes(dim, dim)
    integer :: i, k, pivot(1 + dim), rank
    call own_axes(dim, n, list, vertex, centre, axes)
    gram = 0
    moment = 0
    row(1) = 1
    do i = 1, n
      row(2:) = matmul(axes, centre(:, list(i)) - vertex)
      do k = 1, 1 + dim
        gram(:, k) = gram(:, k) + (volume(list(i))*row(k))*row
      end do
      moment(1, :) = moment(1, :) + (volume(list(i))*mean(list(i)))*row
    end do
    coefficient = 0
    done = .false.
    if (.not. gram(1, 1) > 0) return
    moment = moment/gram(1, 1)
    gram = gram/gram(1, 1)
    coefficient(1) = moment(1, 1)
    call factorize_gram(1 + dim, gram, determined, r, pivot, rank)
    done = rank == 1 + dim
    if (.not. done) return
    call solve_gram(1 + dim, 1, r, pivot, moment)
    coefficient(1) = moment(1, 1)
    coefficient(2:) = matmul(moment(1, 2:), axes)
  end subroutine fit

  !> Principal axes of the centroids of elements, scaled so that all principal moments are equal.
  pure subroutine own_axes(dim, n, list, vertex, centre, axes)
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n  !! Number of elements.
    integer, intent(in) :: list(n)  !! Elements (n).
    real(dp), intent(in) :: vertex(dim)  !! Position of the vertex (dim) [length].
    real(dp), intent(in) :: centre(:, :)  !! Centroid of each element of the body (dim, n_elements) [length].
    real(dp), intent(out) :: axes(dim, dim)  !! Axes as rows (dim, dim) [1/length].
    real(dp) :: moment(dim, dim), vectors(dim, dim), x(dim), largest
    integer :: i, k
    moment = 0
    do i = 1, n
      x = centre(:, list(i)) - vertex
      do k = 1, dim
        moment(:, k) = moment(:, k) + x(k)*x
      end do
    end do
    moment = moment/n
    largest = tiny(largest)
    do k = 1, dim
      largest = max(largest, moment(k, k))
    end do
    moment = moment/largest
    call diagonalize(dim, moment, vectors)
    do k = 1, dim
      axes(k, :) = vectors(:, k)/(sqrt(max(moment(k, k), epsilon(largest)))*sqrt(largest))
    end do
  end subroutine own_axes

  !> Evaluate the weighted sum of the functions of some vertices at points.
  pure subroutine dilatation_fit_values(self, vertex, node, weight, x, value)
    class(dilatation_fit_t), intent(in) :: self
    real(dp), intent(in) :: vertex(:, :)  !! Positions of the vertices (dim, n_vertices) [length].
    integer, intent(in) :: node(:)  !! Nodes of the vertices (n_vertices).
    real(dp), intent(in) :: weight(:, :)  !! Weight of each vertex at each point (n_points, n_vertices) [].
    real(dp), intent(in) :: x(:, :)  !! Points (n_points, dim) [length].
    real(dp), intent(out) :: value(:)  !! Values (n_points) [].
    integer :: v, q
    value = 0
    do v = 1, size(node)
      associate (c => self%coefficient(:, node(v)))
        do q = 1, size(value)
          value(q) = value(q) + weight(q, v)*(c(1) + dot_product(c(2:), x(q, :) - vertex(:, v)))
        end do
      end associate
    end do
  end subroutine dilatation_fit_values

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
    real(dp), allocatable, intent(out) :: volume(:)  !! Volumes, 0 for inverted elements (n_elements) [volume].
    real(dp), intent(in), optional :: thermal(:)  !! Thermal, subtracted; none where absent (n_nodes) [].
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
end module dotyk_elasticity_dilatation_fit
