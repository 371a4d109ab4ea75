!> The dilatation of a body as a continuous function, from its means over elements: what pressures of nearly incompressible bodies are
!> compared with, and output from.
!>
!> Around each vertex a linear function is fitted to the means of the elements, weighted with their volumes: those that have the vertex, or two
!> rings where these do not determine it (at boundaries); where these do not either, a constant. Alternating errors, as pressures of
!> quadrilaterals and hexahedra with a constant dilatation may have, fall out of the fit: `smooth_pressures` takes them off stresses.
module dotyk_elasticity_dilatation_fit
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_elasticity_shape_table, only: shape_table_t, map_element
  use dotyk_elasticity_node_graph, only: incidence_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_recovery_patch, only: diagonalize
  use dotyk_linalg_normal_equations, only: factorize_gram, solve_gram
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> A linear function at each vertex.
  type, public :: dilatation_fit_t
    !> Value at the vertex [], and slopes [1/length]; zero at nodes that are no vertices (1 + dimension, n_nodes).
    real(dp), allocatable :: coefficient(:, :)
  contains
    procedure :: init => dilatation_fit_init
    procedure :: values => dilatation_fit_values
  end type dilatation_fit_t

  public :: fit_dilatations, smooth_pressures

  !> Inverse condition of the least squares from which on a function counts as determined.
  real(dp), parameter :: determined = 1.0e-2_dp
  !> Rings of elements around a vertex at most.
  integer, parameter :: most_rings = 2

contains

  !> Fit the dilatations of some bodies of one mesh and material, where a part of it is projected on some element.
  subroutine fit_dilatations(mesh, analysis, material, u, fits)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Displacements in the mesh's axes (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :, :)
    !> (n_bodies), or none.
    type(dilatation_fit_t), allocatable, intent(out) :: fits(:)
    real(dp), allocatable :: mean(:), centre(:, :), volume(:)
    integer :: i
    if (.not. is_projected(mesh, analysis, material)) then
      allocate (fits(0))
      return
    end if
    allocate (fits(size(u, 1)))
    do i = 1, size(fits)
      call all_mean_dilatations(mesh, analysis, u(i, :, :), mean, centre, volume)
      call fits(i)%init(mesh, mean, centre, volume)
    end do
  end subroutine fit_dilatations

  !> Take alternating errors off the mean stresses of linear quadrilaterals and hexahedra.
  subroutine smooth_pressures(mesh, analysis, material, u, factor, stress)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    !> Mean of the factor on the stiffness over each element (n_elements).
    real(dp), intent(in) :: factor(:)
    !> xx, yy, zz come first (6, n_elements) [pressure].
    real(dp), intent(inout) :: stress(:, :)
    type(dilatation_fit_t) :: fit
    type(element_kind_t) :: kind
    real(dp), allocatable :: mean(:), centre(:, :), volume(:)
    real(dp) :: matrix(6, 6), lambda, bulk, smooth(1)
    integer :: b, e, first, last
    if (.not. is_projected(mesh, analysis, material)) return
    call all_mean_dilatations(mesh, analysis, u, mean, centre, volume)
    call fit%init(mesh, mean, centre, volume)
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      kind = element_kind(mesh%block(b)%kind)
      if (kind%order > 1) cycle
      call material%split(analysis, unprojected_bulk_ratio(mesh%block(b)%kind, material%incompressibility), matrix, lambda, bulk)
      do e = first, last
        associate (node => mesh%block(b)%node(:, e - first + 1))
          call fit%values(mesh%x(:, node), node, spread([1.0_dp/size(node)], 2, size(node)), &
                          reshape(centre(:, e), [1, size(centre, 1)]), smooth)
        end associate
        stress(1:3, e) = stress(1:3, e) + bulk*factor(e)*(smooth(1) - mean(e))
      end do
    end do
  end subroutine smooth_pressures

  !> Whether a part of the dilatation is projected on some element.
  pure logical function is_projected(mesh, analysis, material)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    integer :: b
    is_projected = .false.
    if (analysis == analysis_plane_stress) return
    do b = 1, size(mesh%block)
      if (material%incompressibility > unprojected_bulk_ratio(mesh%block(b)%kind, material%incompressibility)) is_projected = .true.
    end do
  end function is_projected

  !> Mean dilatations of all elements, their centres and volumes.
  subroutine all_mean_dilatations(mesh, analysis, u, mean, centre, volume)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: analysis
    !> Displacements (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    !> As in `mean_dilatations`.
    real(dp), allocatable, intent(out) :: mean(:), centre(:, :), volume(:)
    integer :: b, first, last
    allocate (mean(mesh%n_elements()), centre(mesh%dimension, mesh%n_elements()), volume(mesh%n_elements()))
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      call mean_dilatations(mesh, b, analysis, u, mean(first:last), centre(:, first:last), volume(first:last))
    end do
  end subroutine all_mean_dilatations

  !> Mean dilatations of the elements of a block, their centres and volumes.
  subroutine mean_dilatations(mesh, i_block, analysis, u, mean, centre, volume)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    !> Displacements (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    !> (n_elements), (dim, n_elements) [length], (n_elements) [length^dim]; volumes are 0 where elements tell nothing.
    real(dp), intent(out) :: mean(:), centre(:, :), volume(:)
    type(shape_table_t) :: table
    type(element_kind_t) :: kind
    integer :: e
    kind = element_kind(mesh%block(i_block)%kind)
    call table%init(mesh%block(i_block)%kind, 2*kind%order)
    !$omp parallel do default(none) schedule(static) shared(mesh, i_block, analysis, table, u, mean, centre, volume)
    do e = 1, size(mean)
      associate (node => mesh%block(i_block)%node(:, e))
        call mean_dilatation(table%n_nodes, mesh%dimension, gradient_slots(analysis), table%n_points, table, mesh%x(:, node), &
                             u(:, node), mean(e), centre(:, e), volume(e))
      end associate
    end do
    !$omp end parallel do
  end subroutine mean_dilatations

  !> Mean dilatation of an element.
  pure subroutine mean_dilatation(n, dim, slots, n_points, table, x, u, mean, centre, volume)
    integer, intent(in) :: n, dim, slots, n_points
    type(shape_table_t), intent(in) :: table
    !> Nodes, and their displacements [length].
    real(dp), intent(in) :: x(dim, n), u(dim, n)
    real(dp), intent(out) :: mean, centre(dim), volume
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
    end do
    mean = mean/volume
    centre = matmul(x, matmul(table%shape, w))/volume
  end subroutine mean_dilatation

  !> Fit the functions.
  subroutine dilatation_fit_init(self, mesh, mean, centre, volume)
    class(dilatation_fit_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh
    !> From `all_mean_dilatations`.
    real(dp), intent(in) :: mean(:), centre(:, :), volume(:)
    type(incidence_t) :: elements
    integer, allocatable :: mark(:), list(:)
    logical, allocatable :: is_vertex(:)
    integer :: b, i, ring, n
    logical :: done
    allocate (self%coefficient(1 + mesh%dimension, mesh%n_nodes()), source=0.0_dp)
    allocate (is_vertex(mesh%n_nodes()), source=.false.)
    do b = 1, size(mesh%block)
      do i = 1, corners_of(mesh%block(b)%kind)
        is_vertex(mesh%block(b)%node(i, :)) = .true.
      end do
    end do
    call elements%init(mesh)
    !$omp parallel default(none) shared(self, mesh, mean, centre, volume, elements, is_vertex) private(i, ring, n, done, mark, list)
    allocate (mark(size(mean)), source=0)
    allocate (list(size(mean)))
    !$omp do schedule(dynamic, 64)
    do i = 1, mesh%n_nodes()
      if (.not. is_vertex(i)) cycle
      n = 0
      call add_elements(elements, i, i, mark, list, n)
      do ring = 1, most_rings
        if (ring > 1) call add_neighbours(elements, i, mark, list, n)
        call fit(mesh%dimension, n, list(:n), mesh%x(:, i), mean, centre, volume, self%coefficient(:, i), done)
        if (done) exit
      end do
    end do
    !$omp end do
    deallocate (mark, list)
    !$omp end parallel
  end subroutine dilatation_fit_init

  !> Number of corners of a kind.
  pure integer function corners_of(kind)
    integer, intent(in) :: kind
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    corners_of = properties%n_corners
  end function corners_of

  !> Add the elements of a node to a list.
  pure subroutine add_elements(elements, node, centre, mark, list, n)
    type(incidence_t), intent(in) :: elements
    integer, intent(in) :: node
    !> The vertex whose list it is.
    integer, intent(in) :: centre
    integer, intent(inout) :: mark(:), list(:)
    integer, intent(inout) :: n
    integer :: k
    do k = elements%first(node), elements%first(node + 1) - 1
      associate (e => elements%element(k))
        if (mark(e) == centre) cycle
        mark(e) = centre
        n = n + 1
        list(n) = e
      end associate
    end do
  end subroutine add_elements

  !> Add the elements of all nodes of those in a list.
  pure subroutine add_neighbours(elements, centre, mark, list, n)
    type(incidence_t), intent(in) :: elements
    integer, intent(in) :: centre
    integer, intent(inout) :: mark(:), list(:)
    integer, intent(inout) :: n
    integer :: i, p
    do i = 1, n
      do p = elements%start(list(i)), elements%start(list(i) + 1) - 1
        call add_elements(elements, elements%node(p), centre, mark, list, n)
      end do
    end do
  end subroutine add_neighbours

  !> A linear function of least squares, or the mean where the elements do not determine one.
  subroutine fit(dim, n, list, vertex, mean, centre, volume, coefficient, done)
    integer, intent(in) :: dim, n
    integer, intent(in) :: list(n)
    real(dp), intent(in) :: vertex(dim), mean(:), centre(:, :), volume(:)
    real(dp), intent(out) :: coefficient(1 + dim)
    !> The elements determine it.
    logical, intent(out) :: done
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

  !> Axes in which the centres of some elements are about as far along as across.
  pure subroutine own_axes(dim, n, list, vertex, centre, axes)
    integer, intent(in) :: dim, n
    integer, intent(in) :: list(n)
    real(dp), intent(in) :: vertex(dim), centre(:, :)
    !> [1/length].
    real(dp), intent(out) :: axes(dim, dim)
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

  !> The mean of the functions of some vertices, each weighted with a function, at some points.
  pure subroutine dilatation_fit_values(self, vertex, node, weight, x, value)
    class(dilatation_fit_t), intent(in) :: self
    !> Places of the vertices (dimension, n_vertices) [length], and their nodes (n_vertices).
    real(dp), intent(in) :: vertex(:, :)
    integer, intent(in) :: node(:)
    !> (n_points, n_vertices).
    real(dp), intent(in) :: weight(:, :)
    !> Places (n_points, dimension) [length].
    real(dp), intent(in) :: x(:, :)
    !> (n_points) [].
    real(dp), intent(out) :: value(:)
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
end module dotyk_elasticity_dilatation_fit
