!> Gradient recovery: polynomial-preserving recovery of the strains of a displacement (Zhang and Naga, SIAM J. Sci.
!> Comput. 26, 2005).
!>
!> On the patch of elements around a vertex, a polynomial of one degree more than that of the elements is fitted to
!> the nodal displacements by weighted least squares. Where the displacement is such a polynomial and the patch
!> determines it, the gradient of the fit is exact, on any mesh and up to the boundary; where it is smooth, the
!> gradient is superconvergent. Bodies of one or two layers of elements do not determine the whole polynomial:
!> polynomials of lower degrees are then fitted first, so that at least these are reproduced. The fit uses axes in
!> which the patch is about as long as wide: flat elements do not deteriorate it.
!>
!> Patches, monomials and factors (`dotyk_elasticity_vertex_fit`) depend on the mesh alone: several displacements of one
!> mesh are fitted together, and load cases keep them.
module dotyk_elasticity_gradient_recovery
  use dotyk_base_allowance, only: allowance_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_isoparametric_map, only: points_in_row
  use dotyk_elasticity_monomials, only: monomials_t
  use dotyk_elasticity_node_graph, only: incidence_t
  use dotyk_elasticity_recovery_patch, only: recovery_patch_t
  use dotyk_elasticity_vertex_fit, only: vertex_fit_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> Recovered strains of several bodies of one mesh: polynomials around the vertices.
  type, public :: gradient_recovery_t
    type(monomials_t) :: monomials  !! Monomials of the fitted displacements.
    integer :: n_bodies = 0  !! Number of bodies.
    integer :: n_vertices = 0  !! Number of vertices.
    !> Number of strains: xx yy zz yz xz xy in three dimensions, xx yy xy in two, with engineering shear strains.
    integer :: n_strains = 0
    integer, allocatable :: vertex(:)  !! Vertex of each node, 0 for nodes that are no vertices (n_nodes).
    real(dp), allocatable :: centre(:, :)  !! Positions of the vertices (dim, n_vertices) [length].
    !> Axes of the patches, as rows, in which no node is farther from the vertex than 1 (dim, dim, n_vertices)
    !> [1/length].
    real(dp), allocatable :: axes(:, :, :)
    !> Coefficients of the strains in axes (x - centre) (n_bodies, n_strains, n_lower, n_vertices) [].
    real(dp), allocatable :: strain(:, :, :, :)
    integer, allocatable :: node(:)  !! Nodes of the vertices (n_vertices).
    type(allowance_t) :: room  !! Memory for patches that are kept; none at first.
    !> Patches that are kept; without nodes where not. Empty where there is no memory for any (n_vertices).
    type(vertex_fit_t), allocatable :: fit(:)
    real(dp), allocatable :: u(:, :, :)  !! The displacements (n_bodies, dim, n_nodes) [length].
  contains
    procedure :: init => gradient_recovery_init
    procedure :: take => gradient_recovery_take
    procedure :: give => gradient_recovery_give
  end type gradient_recovery_t

  type, public :: recovered_strains_t  !! Displacements of some bodies, and the strains recovered from them.
    real(dp), allocatable :: u(:, :, :)  !! As in `gradient_recovery_t` (n_bodies, dim, n_nodes) [length].
    real(dp), allocatable :: strain(:, :, :, :)  !! Likewise (n_bodies, n_strains, n_lower, n_vertices) [].
  end type recovered_strains_t

  public :: vertex_functions

  !> Strain of a derivative in three dimensions (component, variable).
  integer, parameter :: strain_3d(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])
  !> Strain of a derivative in two dimensions (component, variable).
  integer, parameter :: strain_2d(2, 2) = reshape([1, 3, 3, 2], [2, 2])

contains

  !> Recover the strains of displacements. Those of the same displacements, and patches that were kept, are reused.
  subroutine gradient_recovery_init(self, mesh, u)
    class(gradient_recovery_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body; always the same.
    !> Displacements in the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    type(vertex_fit_t) :: fit
    type(incidence_t) :: elements
    type(recovery_patch_t) :: patch
    real(dp), allocatable :: coefficient(:)
    integer :: v, dim
    logical :: keeps, is_kept
    if (allocated(self%u)) then
      if (size(self%u) == size(u)) then
        ! NaN differs from itself: nothing is reused then.
        if (all(abs(self%u - u) <= 0)) return
      end if
      deallocate (self%strain)
    else
      call find_vertices(self, mesh)
    end if
    dim = mesh%dimension
    self%n_bodies = size(u, 1)
    allocate (self%strain(self%n_bodies, self%n_strains, self%monomials%n_lower, self%n_vertices))
    self%u = u
    keeps = size(self%fit) > 0
    is_kept = keeps
    if (keeps) is_kept = all(self%fit%n_nodes > 0)
    if (.not. is_kept) call elements%init(mesh)
    !$omp parallel default(none) shared(self, mesh, u, elements, dim, keeps) &
    !$omp& private(v, patch, coefficient, fit, is_kept)
    allocate (coefficient(self%n_bodies*dim*self%monomials%n))
    !$omp do schedule(dynamic, 16)
    do v = 1, self%n_vertices
      is_kept = keeps
      if (keeps) is_kept = self%fit(v)%n_nodes > 0
      if (is_kept) then
        call self%fit(v)%solve(self%monomials, self%n_bodies*dim, u, coefficient)
      else
        call fit%init(self%monomials, elements, self%vertex, mesh%x, self%node(v), patch, self%axes(:, :, v))
        call fit%solve(self%monomials, self%n_bodies*dim, u, coefficient)
        if (keeps) then
          if (self%room%take(fit%bytes())) self%fit(v) = fit
        end if
      end if
      call differentiate(self%monomials, self%n_bodies, coefficient, self%axes(:, :, v), self%strain(:, :, :, v))
    end do
    !$omp end do
    deallocate (coefficient)
    !$omp end parallel
  end subroutine gradient_recovery_init

  !> Copy what was recovered for some of the bodies.
  pure subroutine gradient_recovery_give(self, first, last, recovered)
    class(gradient_recovery_t), intent(in) :: self
    integer, intent(in) :: first, last  !! The bodies.
    type(recovered_strains_t), intent(out) :: recovered  !! Their displacements and strains.
    recovered%u = self%u(first:last, :, :)
    recovered%strain = self%strain(first:last, :, :, :)
  end subroutine gradient_recovery_give

  !> Take what was recovered for some bodies in place of what is there.
  pure subroutine gradient_recovery_take(self, recovered)
    class(gradient_recovery_t), intent(inout) :: self
    type(recovered_strains_t), intent(inout) :: recovered  !! Their displacements and strains; nothing on return.
    call move_alloc(recovered%u, self%u)
    call move_alloc(recovered%strain, self%strain)
    self%n_bodies = size(self%u, 1)
  end subroutine gradient_recovery_take

  !> Find the vertices, and choose the monomials.
  subroutine find_vertices(self, mesh)
    class(gradient_recovery_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(element_kind_t) :: kind
    logical, allocatable :: corner(:)
    integer :: b, i, v, order
    allocate (corner(mesh%n_nodes()), source=.false.)
    order = 1
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      order = max(order, kind%order)
      do i = 1, kind%n_corners
        corner(mesh%block(b)%node(i, :)) = .true.
      end do
    end do
    call self%monomials%init(mesh%dimension, order + 1)
    self%node = pack([(i, i=1, size(corner))], corner)
    self%n_vertices = size(self%node)
    self%n_strains = mesh%dimension*(mesh%dimension + 1)/2
    allocate (self%vertex(size(corner)), source=0)
    self%vertex(self%node) = [(v, v=1, self%n_vertices)]
    self%centre = mesh%x(:, self%node)
    allocate (self%axes(mesh%dimension, mesh%dimension, self%n_vertices))
    allocate (self%fit(merge(self%n_vertices, 0, self%room%left > 0)))
  end subroutine find_vertices

  !> Strains of the fitted polynomials.
  pure subroutine differentiate(monomials, n_bodies, coefficient, axes, strain)
    type(monomials_t), intent(in) :: monomials  !! Monomials of the fit.
    integer, intent(in) :: n_bodies  !! Number of bodies.
    !> Coefficients of the displacements (n_bodies, dim, monomials%n) [length].
    real(dp), intent(in) :: coefficient(n_bodies, monomials%dimension, monomials%n)
    real(dp), intent(in) :: axes(:, :)  !! Axes of the patch, as rows (dim, dim) [1/length].
    !> Coefficients of the strains in the axes of the mesh (n_bodies, n_strains, n_lower) [].
    real(dp), intent(out) :: strain(:, :, :)
    integer :: i, j, k, lower, s
    strain = 0
    do k = 2, monomials%n
      do j = 1, monomials%dimension
        lower = monomials%derivative(j, k)
        if (lower == 0) cycle
        do i = 1, monomials%dimension
          do s = 1, monomials%dimension
            associate (e => merge(strain_3d(s, i), strain_2d(min(s, 2), min(i, 2)), monomials%dimension == 3))
              strain(:, e, lower) = strain(:, e, lower) + (monomials%exponent(j, k)*axes(j, i))*coefficient(:, s, k)
            end associate
          end do
        end do
      end do
    end do
  end subroutine differentiate

  !> Monomials around vertices at points, each times the weight of its vertex: the basis of the recovered strains of
  !> an element.
  pure subroutine vertex_functions(dim, n_lower, n_vertices, n_points, vertex, parent, axis, centre, axes, weight, x, &
                                   values)
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n_lower  !! Number of monomials of the strains.
    integer, intent(in) :: n_vertices  !! Number of vertices.
    integer, intent(in) :: n_points  !! Number of points, a multiple of `points_in_row`.
    integer, intent(in) :: vertex(n_vertices)  !! The vertices (n_vertices).
    integer, intent(in) :: parent(n_lower)  !! Earlier monomial of each product, see `monomials_t` (n_lower).
    integer, intent(in) :: axis(n_lower)  !! Variable of each product, see `monomials_t` (n_lower).
    real(dp), intent(in) :: centre(dim, *)  !! Positions of all vertices of the body (dim, *) [length].
    real(dp), intent(in) :: axes(dim, dim, *)  !! Axes of all patches of the body (dim, dim, *) [1/length].
    real(dp), intent(in) :: x(n_points, dim)  !! Points (n_points, dim) [length].
    !> Weights of the vertices at the points (n_points, n_vertices) [].
    real(dp), intent(in) :: weight(n_points, n_vertices)
    !> Values of the basis (n_points, n_lower, n_vertices) [].
    real(dp), intent(out) :: values(n_points, n_lower, n_vertices)
    real(dp) :: t(points_in_row, dim), line(points_in_row)
    integer :: i, k, q, v
    do v = 1, n_vertices
      associate (origin => centre(:, vertex(v)), a => axes(:, :, vertex(v)))
        do q = 0, n_points - points_in_row, points_in_row
          do i = 1, dim
            line = 0
            do k = 1, dim
              line = line + a(i, k)*(x(q + 1:q + points_in_row, k) - origin(k))
            end do
            t(:, i) = line
          end do
          values(q + 1:q + points_in_row, 1, v) = weight(q + 1:q + points_in_row, v)
          do k = 2, n_lower
            values(q + 1:q + points_in_row, k, v) = values(q + 1:q + points_in_row, parent(k), v)*t(:, axis(k))
          end do
        end do
      end associate
    end do
  end subroutine vertex_functions
end module dotyk_elasticity_gradient_recovery
