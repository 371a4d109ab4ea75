!> Springs of one facet at its quadrature points, and their matrix.
module dotyk_elasticity_foundation_points
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_shape_table, only: load_degree
  use dotyk_mesh_element, only: element_kind, element_kind_t, quadrature_rule, shape_functions
  use dotyk_mesh_facet, only: frame_of_normal
  implicit none
  private

  type, public :: foundation_points_t  !! The springs of one facet at its quadrature points.
    integer :: kind = 0  !! Element kind of the facet; 0 before the first one.
    integer :: n_nodes = 0, n_directions = 0  !! Number of nodes of the facet, and of directions at each point.
    real(dp), allocatable :: xi(:, :)  !! Reference coordinates (dim - 1, n_points) [].
    real(dp), allocatable :: weight(:)  !! Reference weights (n_points) [].
    real(dp), allocatable :: shape(:, :)  !! Shape functions (n_nodes, n_points) [].
    real(dp), allocatable :: x(:, :)  !! Positions (dim, n_points) [length].
    real(dp), allocatable :: area(:)  !! Areas (n_points) [length^2; length in plane analyses].
    real(dp), allocatable :: direction(:, :, :)  !! Unit vectors of the springs (dim, 3, n_points) [].
    real(dp), allocatable :: tensor(:, :, :)  !! k D (dim, dim, n_points) [pressure/length].
    real(dp), allocatable :: pull(:, :)  !! k D g (dim, n_points) [pressure].
  contains
    procedure :: take_rule
    procedure :: matrix => facet_matrix
  end type foundation_points_t

  public :: axes_at

contains

  !> Rule and shape functions of a kind of facets.
  subroutine take_rule(points, dim, kind)
    class(foundation_points_t), intent(inout) :: points
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: kind  !! Element kind of the facet.
    type(element_kind_t) :: properties
    integer :: n, q
    if (points%kind == kind) return
    properties = element_kind(kind)
    points%kind = kind
    points%n_nodes = properties%n_nodes
    if (allocated(points%shape)) &
      deallocate (points%shape, points%x, points%area, points%direction, points%tensor, points%pull)
    call quadrature_rule(kind, load_degree(properties%order), points%xi, points%weight)
    n = size(points%weight)
    allocate (points%shape(properties%n_nodes, n), points%x(dim, n), points%area(n), points%direction(dim, 3, n))
    allocate (points%tensor(dim, dim, n), points%pull(dim, n))
    do q = 1, n
      call shape_functions(kind, points%xi(:, q), points%shape(:, q))
    end do
  end subroutine take_rule

  !> Unit vectors along x, y, z, or along xi, eta, n of a surface; what there is none of is 0.
  pure subroutine axes_at(dim, local, normal, axes)
    integer, intent(in) :: dim  !! Number of coordinates.
    logical, intent(in) :: local  !! Whether the axes are those of the surface.
    real(dp), intent(in) :: normal(dim)  !! Its outward unit normal (dim) [].
    real(dp), intent(out) :: axes(dim, 3)  !! The axes (dim, 3) [].
    real(dp) :: frame(dim, dim)
    integer :: i
    axes = 0
    if (local) then
      call frame_of_normal(dim, normal, frame)
      axes(:, 1) = frame(:, 1)
      if (dim == 3) axes(:, 2) = frame(:, 2)
      axes(:, 3) = frame(:, dim)
    else
      do i = 1, dim
        axes(i, i) = 1
      end do
    end if
  end subroutine axes_at

  !> Matrix of the springs of a facet in global axes.
  pure subroutine facet_matrix(points, n, dim, k)
    class(foundation_points_t), intent(in) :: points
    integer, intent(in) :: n  !! Number of nodes of the facet.
    integer, intent(in) :: dim  !! Number of displacement components.
    !> Node a, node b, component i, component j (n, n, dim, dim) [force/length].
    real(dp), intent(out) :: k(n, n, dim, dim)
    integer :: a, i, j, q
    k = 0
    do q = 1, size(points%weight)
      do j = 1, dim
        do i = 1, dim
          do a = 1, n
            k(:, a, i, j) = k(:, a, i, j) + points%area(q)*points%tensor(i, j, q)*points%shape(a, q)*points%shape(:, q)
          end do
        end do
      end do
    end do
  end subroutine facet_matrix
end module dotyk_elasticity_foundation_points
