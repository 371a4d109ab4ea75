!> The boundary facets of one body as polygons, in a bounding-volume tree: what the search for pairs needs of a body.
module dotyk_contact_body_faces
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: same_number
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_t, bounding_volume_tree_t
  use dotyk_contact_facet_distance, only: ray_meets_polygon
  use dotyk_contact_facet_set, only: corner_normal, facet_set_t
  use dotyk_contact_tree_search, only: region_t, tree_walk_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, max_facet_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: body_faces_t  !! Boundary facets of a body.
    integer :: n = 0  !! Number of facets.
    integer, allocatable :: n_corners(:)  !! Number of corners of each facet, 2 to 4 (n).
    real(dp), allocatable :: corner(:, :, :)  !! Corners; z = 0 in two dimensions (3, 4, n) [length].
    real(dp), allocatable :: normal(:, :)  !! Unit outward normal of the polygon (3, n) [].
    !> Greatest angle between this normal and those of the facet, estimated (n) [rad].
    real(dp), allocatable :: half_angle(:)
    real(dp), allocatable :: bulge(:)  !! Greatest distance of the facet from its polygon, estimated (n) [length].
    real(dp), allocatable :: spacing(:)  !! Mean spacing of the nodes along the edges (n) [length].
    real(dp) :: lo(3) = 0  !! Lower corner of the box of all facets (3) [length].
    real(dp) :: hi(3) = 0  !! Upper corner of that box (3) [length].
    !> Diameter: twice the greatest distance of a corner from the mean of all corners, invariant under
    !> rotations [length].
    real(dp) :: diameter = 0
    type(bounding_volume_tree_t) :: tree  !! Tree of the facets.
  contains
    procedure :: init => faces_init
    procedure :: centre => faces_centre
    procedure :: cross_along => faces_cross_along
  end type body_faces_t

  type, extends(region_t) :: ray_t  !! A part of a line.
    real(dp) :: origin(3) = 0  !! Origin of the line (3) [length].
    real(dp) :: direction(3) = 0  !! Unit direction (3) [].
    real(dp) :: from = 0  !! Beginning of the part [length].
    real(dp) :: to = 0  !! Its end [length].
  contains
    procedure :: misses => ray_misses
  end type ray_t

  !> The face of an elevated or quadratic facet bulges beyond the node that is farthest from the polygon [].
  real(dp), parameter :: bulge_factor = 1.5_dp

contains

  !> Set up from the boundary of a body.
  subroutine faces_init(self, x, boundary)
    class(body_faces_t), intent(out) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: boundary  !! Boundary of the body.
    type(facet_set_t) :: set
    type(element_kind_t) :: kind
    real(dp) :: y(3, max_facet_nodes), mean(3), margin
    integer :: f, n, d
    n = boundary%n_facets
    d = size(x, 1)
    self%n = n
    allocate (self%n_corners(n), self%corner(3, 4, n), self%normal(3, n), self%half_angle(n), self%bulge(n), &
              self%spacing(n))
    set%n = n
    set%dimension = d
    allocate (set%lo(3, n), set%hi(3, n))
    self%corner = 0
    y = 0
    mean = 0
    do f = 1, n
      kind = element_kind(boundary%kind(f))
      y(:d, :kind%n_nodes) = x(:, boundary%node(:kind%n_nodes, f))
      self%n_corners(f) = kind%n_corners
      self%corner(:, :kind%n_corners, f) = y(:, :kind%n_corners)
      call shape_of(kind%n_corners, kind%n_nodes, y, self%normal(:, f), self%half_angle(f), self%bulge(f), &
                    self%spacing(f))
      set%lo(:, f) = minval(y(:, :kind%n_corners), 2)
      set%hi(:, f) = maxval(y(:, :kind%n_corners), 2)
      margin = self%bulge(f) + same_number*maxval(set%hi(:, f) - set%lo(:, f))
      set%lo(:, f) = set%lo(:, f) - margin
      set%hi(:, f) = set%hi(:, f) + margin
      mean = mean + sum(y(:, :kind%n_corners), 2)/kind%n_corners
    end do
    if (n == 0) return
    mean = mean/n
    do f = 1, n
      self%diameter = max(self%diameter, 2*maxval(norm2(self%corner(:, :self%n_corners(f), f) - &
                                                        spread(mean, 2, self%n_corners(f)), 1)))
    end do
    set%axis = self%normal
    set%half_angle = self%half_angle
    self%lo = minval(set%lo, 2)
    self%hi = maxval(set%hi, 2)
    call self%tree%init(set)
  end subroutine faces_init

  !> Normal, curvature and size of a facet.
  pure subroutine shape_of(n_corners, n_nodes, y, normal, half_angle, bulge, spacing)
    integer, intent(in) :: n_corners  !! Number of corners.
    integer, intent(in) :: n_nodes  !! Number of nodes, the corners first.
    real(dp), intent(in) :: y(:, :)  !! Nodes (3, at least n_nodes) [length].
    real(dp), intent(out) :: normal(3)  !! Unit normal of the polygon (3) [].
    real(dp), intent(out) :: half_angle  !! Greatest angle of a normal of the facet to it, estimated [rad].
    real(dp), intent(out) :: bulge  !! Greatest distance from the polygon, estimated [length].
    real(dp), intent(out) :: spacing  !! Mean spacing of the nodes along the edges [length].
    real(dp) :: length
    integer :: i, edges
    normal = corner_normal(y(:, :n_corners))
    edges = merge(1, n_corners, n_corners == 2)
    length = 0
    do i = 1, edges
      length = length + norm2(y(:, mod(i, n_corners) + 1) - y(:, i))/edges
    end do
    bulge = 0
    do i = 2, n_nodes
      bulge = max(bulge, abs(dot_product(y(:, i) - y(:, 1), normal)))
    end do
    ! The slope of a parabola at its ends is four times its height over its length.
    half_angle = atan(4*bulge_factor*bulge/max(length, tiny(1.0_dp)))
    bulge = bulge_factor*bulge
    spacing = length
    if (n_nodes > n_corners) spacing = length/2
  end subroutine shape_of

  !> Mean of the corners of a facet [length].
  pure function faces_centre(self, facet) result(centre)
    class(body_faces_t), intent(in) :: self
    integer, intent(in) :: facet  !! Facet.
    real(dp) :: centre(3)
    centre = sum(self%corner(:, :self%n_corners(facet), facet), 2)/self%n_corners(facet)
  end function faces_centre

  !> Where a part of a line first enters the body, and where it leaves the body after that.
  pure subroutine faces_cross_along(self, origin, direction, from, to, without, enters, leaves)
    class(body_faces_t), intent(in) :: self
    real(dp), intent(in) :: origin(3)  !! Origin of the line (3) [length].
    real(dp), intent(in) :: direction(3)  !! Unit direction (3) [].
    real(dp), intent(in) :: from  !! Beginning of the part [length].
    real(dp), intent(in) :: to  !! Its end [length].
    integer, intent(in) :: without  !! Facet that does not count, or 0.
    !> First place where the line enters; `from` where it leaves first, huge where it meets nothing [length].
    real(dp), intent(out) :: enters
    real(dp), intent(out) :: leaves  !! Next place where it leaves; huge where it does not [length].
    type(ray_t) :: ray
    type(tree_walk_t) :: walk
    real(dp) :: first_leave, t
    integer :: facet, pass
    logical :: meets
    ray = ray_t(origin, direction, from, to)
    enters = huge(enters)
    leaves = huge(leaves)
    first_leave = huge(first_leave)
    ! In a second pass, the first exit behind the entry.
    do pass = 1, 2
      call walk%start(self%tree)
      do
        call walk%next(self%tree, ray, facet)
        if (facet == 0) exit
        if (facet == without) cycle
        associate (n => self%n_corners(facet))
          call ray_meets_polygon(origin, direction, n, self%corner(:, :n, facet), self%normal(:, facet), meets, t)
        end associate
        if (.not. meets .or. t < from .or. t > to) cycle
        if (dot_product(direction, self%normal(:, facet)) < 0) then
          if (pass == 1) enters = min(enters, t)
        else if (pass == 1) then
          first_leave = min(first_leave, t)
        else if (t >= enters) then
          leaves = min(leaves, t)
        end if
      end do
      if (first_leave < enters) then
        enters = from
        leaves = first_leave
        return
      end if
      if (.not. enters < huge(enters)) return
    end do
  end subroutine faces_cross_along

  !> Whether the box of a volume lies beside a part of a line.
  pure logical function ray_misses(self, volume) result(misses)
    class(ray_t), intent(in) :: self
    type(bounding_volume_t), intent(in) :: volume  !! Bounds of a node or facet.
    real(dp) :: near, far, a, b
    integer :: k
    near = self%from
    far = self%to
    misses = .false.
    do k = 1, 3
      if (abs(self%direction(k)) > tiny(1.0_dp)) then
        a = (volume%lo(k) - self%origin(k))/self%direction(k)
        b = (volume%hi(k) - self%origin(k))/self%direction(k)
        near = max(near, min(a, b))
        far = min(far, max(a, b))
      else if (self%origin(k) < volume%lo(k) .or. self%origin(k) > volume%hi(k)) then
        misses = .true.
        return
      end if
    end do
    misses = near > far
  end function ray_misses
end module dotyk_contact_body_faces
