!> Estimates of recovered strains held against the residuals of the elements.
!>
!> Recovered strains (`dotyk_elasticity_discretization_error`) are asymptotically exact where the displacement is
!> smooth. They miss up to half of the error at singular edges and the part that no fit sees, such as parabolic shear
!> over one layer of elements; and they are too large where the stiffness jumps and in thin bodies, where polynomials
!> around a vertex are poor. Residuals (`dotyk_elasticity_element_residual`) need no neighbours to be smooth: with a
!> constant for the kind of the elements their energy is 0.8 to 1.5 times the error in both. So they bound the recovered
!> ones from both sides. The constants are measured: docs/errors.md, `studies/error_estimates.py`.
!>
!> Residuals of clusters of flat simplices: quadratic triangles and tetrahedra that meet at faces over which both are
!> flat, such as the three tetrahedra of each prism of a thin sheet. The mean of the tractions of both sides of such a
!> face is as wrong as the stresses, on an area that is large beside the volumes: alone, the local answer of each side
!> (`dotyk_elasticity_element_residual`) grows like length over thickness, though the errors of the two sides cancel. A
!> cluster answers as one, by one local problem in the continuous bubbles of all its elements.
!>
!> Bubbles of quadratic simplices are cubic functions that vanish at the nodes: one for each edge, antisymmetric, and
!> one for each face (for a triangle, one in the middle). Those that have the same values at edges and faces are
!> continuous, so the local problem of the cluster is assembled from those of its elements, and the tractions at the
!> faces between them cancel.
module dotyk_elasticity_residual_check
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: allowance_t
  use dotyk_elasticity_bubble_table, only: bubble_table_t
  use dotyk_elasticity_element_residual, only: bubble_factor_t, residual_data_t, residual_energy, residual_problem
  use dotyk_elasticity_face_table, only: face_table_t
  use dotyk_elasticity_face_tractions, only: face_tractions_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_point_stress, only: point_material_t
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_linalg_blas, only: dpotrf, dtrsm
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_tet10, element_tri6, n_element_kinds, &
    reference_nodes
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: check_by_residuals, cluster_energy

  type, public :: simplex_bubbles_t  !! Bubbles of a quadratic simplex by their values on edges and faces.
    integer :: n = 0  !! Number of bubbles; 0 for other kinds of elements.
    integer :: n_edges = 0  !! Number of edges; their bubbles are the first ones.
    integer, allocatable :: corner(:, :)  !! Corners of the edges (2, n_edges).
    integer, allocatable :: middle(:)  !! Nodes in the middle of the edges (n_edges).
    real(dp), allocatable :: coefficient(:, :)  !! Coefficients of these bubbles in those of the table (n, n) [].
  contains
    procedure :: init => simplex_bubbles_init
  end type simplex_bubbles_t

  type :: part_t  !! Local problem of one element, in continuous bubbles.
    real(dp), allocatable :: matrix(:, :)  !! The stiffness (dim*n, dim*n) [force/length].
    integer, allocatable :: unknown(:)  !! Unknown of the cluster for each bubble of one component.
  end type part_t

  type, public :: flat_clusters_t  !! All elements of a body, those of a cluster one after the other.
    integer :: n = 0  !! Number of clusters; elements that are in none are clusters of one.
    integer, allocatable :: first(:)  !! First entry of each cluster in `element` (n + 1).
    integer, allocatable :: element(:)  !! Elements, counted through all blocks (n_elements).
  contains
    procedure :: init => flat_clusters_init
  end type flat_clusters_t

  !> Greatest height of both simplices over a face at which they are a cluster, relative to the size of the face, its
  !> length or the root of its area [].
  real(dp), parameter :: flat = 0.45_dp
  integer, parameter :: most_elements = 48  !! Elements of a cluster at most: without order all hang together.

  !> Error over the root of the energy of the residual of each element kind; none of lines (n_element_kinds) [].
  real(dp), parameter :: constant(n_element_kinds) = [0.0_dp, 0.0_dp, 1.1_dp, 1.4_dp, 1.1_dp, 1.4_dp, 1.5_dp, 0.4_dp, &
                                                      1.0_dp, 0.8_dp, 1.2_dp, 1.2_dp, 0.7_dp, 1.25_dp, 1.25_dp, &
                                                      0.45_dp, 1.1_dp, 1.2_dp]
  !> Recovered strains count where they say at least this fraction of what the residual says [].
  real(dp), parameter :: least_fraction = 0.6_dp
  real(dp), parameter :: most_multiple = 1.6_dp  !! They count up to this multiple of it [].

contains

  !> Hold the squared errors of elements against their residuals. Bodies with a projected dilatation keep theirs.
  subroutine check_by_residuals(mesh, analysis, material, data, u, least, factor, room, face_room, square, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(residual_data_t), intent(in) :: data  !! Loads and held directions of the bodies.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in) :: least(:)  !! Elements with smaller squared errors are left alone (n_bodies) [energy].
    !> Factors of elements: those that were kept are used, and others are kept where there is room (n_elements).
    type(bubble_factor_t), intent(inout) :: factor(:)
    type(allowance_t), intent(inout) :: room  !! Memory for factors.
    type(allowance_t), intent(inout) :: face_room  !! Memory for the tractions of faces, while this runs.
    real(dp), intent(inout) :: square(:, :)  !! Squared errors, by elements (n_bodies, n_elements) [energy].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    type(point_material_t) :: point_material(size(material))
    type(bubble_table_t), allocatable :: table(:)
    type(simplex_bubbles_t), allocatable :: bubbles(:)
    type(flat_clusters_t) :: clusters
    type(face_tractions_t) :: tractions
    type(error_t), allocatable :: failure
    real(dp), allocatable :: energy(:, :)
    logical, allocatable :: is_needed(:)
    real(dp) :: matrix(6, 6), lambda, bulk
    integer :: b, c, e, k, m
    allocate (table(size(mesh%block)), bubbles(size(mesh%block)))
    do b = 1, size(mesh%block)
      associate (own => material(mesh%block(b)%material))
        call own%split(analysis, unprojected_bulk_ratio(mesh%block(b)%kind, own%incompressibility), matrix, lambda, &
                       bulk)
      end associate
      if (bulk > 0) return
      call table(b)%init(mesh%block(b)%kind)
      call bubbles(b)%init(table(b), error)
      if (allocated(error)) return
    end do
    do m = 1, size(material)
      call point_material(m)%init(analysis, material(m)%plane_matrix(analysis))
      if (allocated(data%thermal)) then
        point_material(m)%thermal = data%thermal(:, :, :, m)
        point_material(m)%initial = data%initial
        if (material(m)%formulas%vary()) point_material(m)%temperature = data%temperature
      end if
      call point_material(m)%field%init(material(m), error)
      if (allocated(error)) exit
    end do
    if (allocated(error)) then
      call forget()
      return
    end if
    call clusters%init(mesh, data%faces)
    allocate (is_needed(size(square, 2)), source=.false.)
    do b = 1, size(square, 1)
      is_needed = is_needed .or. square(b, :) > least(b)
    end do
    call tractions%find(mesh, data%faces, point_material, table, u, is_needed, face_room)
    ! A formula serves one thread.
    !$omp parallel do default(none) schedule(dynamic, 16) if (all(point_material%field%constant)) &
    !$omp& private(failure, energy, b, e, k) &
    !$omp& shared(mesh, data, point_material, table, bubbles, tractions, clusters, u, is_needed, least, factor, room, &
    !$omp& square, error)
    do c = 1, clusters%n
      associate (own => clusters%element(clusters%first(c):clusters%first(c + 1) - 1))
        if (.not. any(is_needed(own))) cycle
        if (allocated(energy)) deallocate (energy)
        allocate (energy(size(square, 1), size(own)))
        if (size(own) > 1) then
          call cluster_energy(mesh, data, point_material, table, bubbles, tractions, u, own, energy, failure)
        else
          call residual_energy(mesh, data, point_material, table, tractions, u, own(1), factor(own(1)), room, &
                               energy(:, 1), failure)
        end if
        if (allocated(failure)) then
          !$omp critical
          if (.not. allocated(error)) call move_alloc(failure, error)
          !$omp end critical
          cycle
        end if
        do k = 1, size(own)
          e = own(k)
          energy(:, k) = constant(mesh%block(data%faces%block(e))%kind)**2*energy(:, k)
          do b = 1, size(energy, 1)
            ! Whatever the other bodies are.
            if (square(b, e) > least(b)) call hold(energy(b, k), square(b, e))
          end do
        end do
      end associate
    end do
    !$omp end parallel do
    call forget()

  contains

    !> Free the formulas.
    subroutine forget()
      integer :: m
      do m = 1, size(point_material)
        call point_material(m)%field%destroy()
      end do
    end subroutine forget
  end subroutine check_by_residuals

  !> Hold one number against the other.
  pure subroutine hold(residual, recovered)
    real(dp), intent(in) :: residual  !! Squared error by the residual; none where it is 0 [energy].
    real(dp), intent(inout) :: recovered  !! Squared error by recovered strains [energy].
    if (.not. residual > 0) return
    if (recovered < least_fraction**2*residual) recovered = residual
    recovered = min(recovered, most_multiple**2*residual)
  end subroutine hold

  !> Find the bubbles of a kind.
  subroutine simplex_bubbles_init(self, table, error)
    class(simplex_bubbles_t), intent(out) :: self
    type(bubble_table_t), intent(in) :: table  !! Bubbles of the kind.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the table has others; this does not happen.
    type(element_kind_t) :: kind
    real(dp), allocatable :: x(:, :), at_point(:, :)
    real(dp) :: point(3)
    integer :: a, b, d, k
    if (all(table%kind /= [element_tri6, element_tet10])) return
    kind = element_kind(table%kind)
    d = kind%dimension
    allocate (x(d, kind%n_nodes))
    call reference_nodes(table%kind, x)
    self%n_edges = kind%n_nodes - kind%n_corners
    self%n = table%n
    allocate (self%corner(2, self%n_edges), self%middle(self%n_edges), at_point(self%n, self%n))
    do k = 1, self%n_edges
      self%middle(k) = kind%n_corners + k
      do a = 1, kind%n_corners
        do b = a + 1, kind%n_corners
          if (all(abs(x(:, a) + x(:, b) - 2*x(:, self%middle(k))) < epsilon(x))) self%corner(:, k) = [a, b]
        end do
      end do
      at_point(k, :) = table%values((2*x(:, self%corner(1, k)) + x(:, self%corner(2, k)))/3)
    end do
    do k = self%n_edges + 1, self%n
      point(:d) = sum(x(:, :kind%n_corners), dim=2)/kind%n_corners
      if (d == 3) point(:d) = sum(x(:, table%face(k - self%n_edges)%corner), dim=2)/3
      at_point(k, :) = table%values(point(:d))
    end do
    allocate (self%coefficient(self%n, self%n), source=0.0_dp)
    do k = 1, self%n
      self%coefficient(k, k) = 1
    end do
    call solve_dense(at_point, self%coefficient, error)
  end subroutine simplex_bubbles_init

  !> Energies of the answer of a cluster on each of its elements.
  subroutine cluster_energy(mesh, data, material, table, bubbles, tractions, u, element, square, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(residual_data_t), intent(in) :: data  !! Loads and held directions.
    type(point_material_t), intent(in) :: material(:)  !! Materials (n_materials).
    type(bubble_table_t), intent(in) :: table(:)  !! Bubbles of the kinds of the blocks (n_blocks).
    type(simplex_bubbles_t), intent(in) :: bubbles(:)  !! The same by edges and faces (n_blocks).
    type(face_tractions_t), intent(in) :: tractions  !! Mean tractions at faces between elements, where known.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    integer, intent(in) :: element(:)  !! Elements of the cluster (n).
    real(dp), intent(out) :: square(:, :)  !! Energies; 0 where an element is inverted (n_bodies, n) [energy].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    type(part_t) :: part(size(element))
    real(dp), allocatable :: matrix(:, :), rhs(:, :), of_element(:, :), answer(:)
    integer, allocatable :: place(:)
    integer :: b, d, i, k, n, n_unknowns, info
    square = 0
    d = mesh%dimension
    call number_bubbles(mesh, data, table, bubbles, element, part, n_unknowns)
    allocate (matrix(d*n_unknowns, d*n_unknowns), rhs(d*n_unknowns, size(u, 1)), source=0.0_dp)
    do k = 1, size(element)
      b = data%faces%block(element(k))
      n = bubbles(b)%n
      call residual_problem(mesh, data, material, table, tractions, u, element(k), of_element, error, part(k)%matrix)
      if (allocated(error)) return
      if (.not. allocated(of_element)) return
      call to_edges(n, d, size(u, 1), bubbles(b), mesh%block(b)%node(:, element(k) - data%faces%before(b)), &
                    part(k)%matrix, of_element)
      place = [(part(k)%unknown + i*n_unknowns, i=0, d - 1)]
      matrix(place, place) = matrix(place, place) + part(k)%matrix
      rhs(place, :) = rhs(place, :) + of_element
    end do
    n = d*n_unknowns
    call dpotrf('L', n, matrix, n, info)
    if (info /= 0) return
    call dtrsm('L', 'L', 'N', 'N', n, size(u, 1), 1.0_dp, matrix, n, rhs, n)
    call dtrsm('L', 'L', 'T', 'N', n, size(u, 1), 1.0_dp, matrix, n, rhs, n)
    do k = 1, size(element)
      place = [(part(k)%unknown + i*n_unknowns, i=0, d - 1)]
      do b = 1, size(u, 1)
        answer = rhs(place, b)
        square(b, k) = dot_product(answer, matmul(part(k)%matrix, answer))
      end do
    end do
  end subroutine cluster_energy

  !> Number the bubbles of a cluster.
  pure subroutine number_bubbles(mesh, data, table, bubbles, element, part, n)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(residual_data_t), intent(in) :: data  !! Faces of the elements.
    type(bubble_table_t), intent(in) :: table(:)  !! Bubbles of the kinds of the blocks (n_blocks).
    type(simplex_bubbles_t), intent(in) :: bubbles(:)  !! The same by edges and faces (n_blocks).
    integer, intent(in) :: element(:)  !! Elements of the cluster.
    type(part_t), intent(inout) :: part(:)  !! Their parts; the unknowns are set (size(element)).
    integer, intent(out) :: n  !! Number of unknowns of one component.
    integer :: edge(sum(bubbles(data%faces%block(element))%n_edges))
    integer :: b, f, k, l, found, node, n_edges, behind
    n = 0
    n_edges = 0
    do k = 1, size(element)
      b = data%faces%block(element(k))
      allocate (part(k)%unknown(bubbles(b)%n), source=0)
      do l = 1, bubbles(b)%n_edges
        node = mesh%block(b)%node(bubbles(b)%middle(l), element(k) - data%faces%before(b))
        found = findloc(edge(:n_edges), node, dim=1)
        if (found == 0) then
          n_edges = n_edges + 1
          edge(n_edges) = node
          found = n_edges
        end if
        part(k)%unknown(l) = found
      end do
    end do
    n = n_edges
    do k = 1, size(element)
      b = data%faces%block(element(k))
      do l = bubbles(b)%n_edges + 1, bubbles(b)%n
        found = 0
        if (mesh%dimension == 3) then
          behind = data%faces%neighbour(l - bubbles(b)%n_edges, element(k))
          if (behind > 0) found = findloc(element(:k - 1), behind, dim=1)
          if (found > 0) then
            associate (their => data%faces%block(behind))
              f = findloc(data%faces%neighbour(:size(table(their)%face), behind), element(k), dim=1)
              part(k)%unknown(l) = part(found)%unknown(bubbles(their)%n_edges + f)
            end associate
            cycle
          end if
        end if
        n = n + 1
        part(k)%unknown(l) = n
      end do
    end do
  end subroutine number_bubbles

  !> Transform the local problem of an element to bubbles that are continuous to its neighbours.
  pure subroutine to_edges(n, dim, n_bodies, bubbles, node, matrix, rhs)
    integer, intent(in) :: n  !! Number of bubbles.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n_bodies  !! Number of bodies.
    type(simplex_bubbles_t), intent(in) :: bubbles  !! Bubbles by edges and faces.
    integer, intent(in) :: node(:)  !! Nodes of the element.
    real(dp), intent(inout) :: matrix(n, dim, n, dim)  !! Its lower triangle; all of it on return [force/length].
    real(dp), intent(inout) :: rhs(n, dim, n_bodies)  !! The forces (n, dim, n_bodies) [force].
    real(dp) :: c(n, n)
    integer :: i, j, k
    c = bubbles%coefficient
    ! Edges run from the smaller number of a node to the greater one, whichever element they belong to.
    do k = 1, bubbles%n_edges
      if (node(bubbles%corner(1, k)) > node(bubbles%corner(2, k))) c(:, k) = -c(:, k)
    end do
    do j = 1, dim
      do k = 1, n
        matrix(:k - 1, j, k, j) = matrix(k, j, :k - 1, j)
      end do
      do i = j + 1, dim
        matrix(:, j, :, i) = transpose(matrix(:, i, :, j))
      end do
    end do
    do j = 1, dim
      do i = 1, dim
        matrix(:, i, :, j) = matmul(transpose(c), matmul(matrix(:, i, :, j), c))
      end do
    end do
    do k = 1, n_bodies
      rhs(:, :, k) = matmul(transpose(c), rhs(:, :, k))
    end do
  end subroutine to_edges

  !> Find the clusters; elements of other ranks are in none.
  subroutine flat_clusters_init(self, mesh, faces)
    class(flat_clusters_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(face_table_t), intent(in) :: faces  !! Faces of the elements.
    logical, allocatable :: free(:)
    integer :: e, k, f, behind, n
    allocate (self%first(mesh%n_elements() + 1), self%element(mesh%n_elements()), free(mesh%n_elements()))
    free = .true.
    n = 0
    k = 1
    do e = 1, size(free)
      if (.not. free(e)) cycle
      self%n = self%n + 1
      self%first(self%n) = n + 1
      call take(e)
      ! k runs behind n, over the elements of the cluster.
      do while (k <= n)
        if (can_join(self%element(k))) then
          do f = 1, size(faces%neighbour, 1)
            behind = faces%neighbour(f, self%element(k))
            if (behind == 0 .or. n - self%first(self%n) + 1 >= most_elements) cycle
            if (.not. free(behind)) cycle
            if (.not. can_join(behind)) cycle
            if (max(height(self%element(k), behind), height(behind, self%element(k))) < flat) call take(behind)
          end do
        end if
        k = k + 1
      end do
    end do
    self%first(self%n + 1) = n + 1

  contains

    !> Add an element to the last cluster.
    subroutine take(element)
      integer, intent(in) :: element  !! The element.
      n = n + 1
      self%element(n) = element
      free(element) = .false.
    end subroutine take

    !> Whether an element may have company.
    pure logical function can_join(element)
      integer, intent(in) :: element  !! The element.
      can_join = any(mesh%block(faces%block(element))%kind == [element_tri6, element_tet10])
      if (can_join) can_join = mesh%is_own_element(element)
    end function can_join

    !> Height of a simplex over its face towards another one, relative to the size of the face [].
    pure real(dp) function height(element, behind)
      integer, intent(in) :: element  !! The simplex.
      integer, intent(in) :: behind  !! The other one.
      type(element_kind_t) :: kind
      real(dp) :: x(3, 4), normal(3)
      integer :: b, d, i
      b = faces%block(element)
      kind = element_kind(mesh%block(b)%kind)
      d = mesh%dimension
      x = 0
      associate (node => mesh%block(b)%node(:, element - faces%before(b)), &
                 face => kind%face_node(:d, findloc(faces%neighbour(:, element), behind, dim=1)))
        x(:d, :d) = mesh%x(:, node(face))
        i = findloc([(any(face == i), i=1, d + 1)], .false., dim=1)
        x(:d, 4) = mesh%x(:, node(i))
      end associate
      if (d == 2) then
        ! The face is a line of unit depth.
        normal = cross(x(:, 2) - x(:, 1), [0.0_dp, 0.0_dp, 1.0_dp])
        height = abs(dot_product(normal, x(:, 4) - x(:, 1)))/max(sum(normal**2), tiny(height))
      else
        normal = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))
        height = abs(dot_product(normal, x(:, 4) - x(:, 1)))/max(norm2(normal)*sqrt(norm2(normal)/2), tiny(height))
      end if
    end function height
  end subroutine flat_clusters_init
end module dotyk_elasticity_residual_check
