!> Springs on surfaces of a body: elastic supports, a Winkler foundation.
!>
!> At each point of the surface springs along some directions d, global ones or those of the surface, pull the body back
!> to the displacement g of their far ends with the traction t = -k D (u - g), D = sum d d^T and k the foundation
!> modulus [pressure/length]. They add the matrix int N^T k D N dA to the stiffness and the forces int N^T k D g dA to
!> the loads; in axisymmetric analyses dA is that of the full circumference.
module dotyk_elasticity_foundation
  use dotyk_base_directions, only: directions_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_base_thresholds, only: given_rounding
  use dotyk_elasticity_analysis, only: two_pi
  use dotyk_elasticity_shape_table, only: load_degree
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_point, max_facet_nodes, quadrature_rule, &
    shape_functions
  use dotyk_mesh_facet, only: facet_geometry, frame_of_normal
  use dotyk_mesh_placement, only: placement_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: surface_area

  type, public :: foundation_t  !! All springs of a body.
    integer :: n = 0  !! Number of facets with springs; a facet under two springs counts twice.
    type(text_t), allocatable :: place(:)  !! Surface of each spring (n_springs).
    type(directions_t), allocatable :: fix(:)  !! Directions of each spring (n_springs).
    real(dp), allocatable :: modulus(:)  !! Foundation modulus of each (n_springs) [pressure/length].
    !> Area of its surface; 0 where it is not given (n_springs) [length^2; length in plane analyses].
    real(dp), allocatable :: area(:)
    real(dp), allocatable :: value(:, :)  !! Displacement of its far ends in the axes of `fix` (3, n_springs) [length].
    integer, allocatable :: of(:)  !! Spring of each facet (n).
    integer, allocatable :: kind(:)  !! Element kind of each facet (n).
    integer, allocatable :: node(:, :)  !! Nodes of each facet, padded with 0, oriented outward (max_facet_nodes, n).
    integer, allocatable :: block(:), element(:)  !! Block of the element behind each facet, and its number in it (n).
  contains
    procedure :: add => foundation_add
    procedure :: n_springs => foundation_n_springs
    procedure :: points_of => foundation_points_of
    procedure :: add_forces => foundation_add_forces
    procedure :: add_loads => foundation_add_loads
    procedure :: add_up_reactions => foundation_add_up_reactions
    procedure :: renumber => foundation_renumber
    procedure :: choose => foundation_choose
    procedure :: is_moved => foundation_is_moved
    procedure :: carry => foundation_carry
  end type foundation_t

  type, public :: foundation_points_t  !! The springs of one facet at its quadrature points.
    integer :: kind = -1  !! Element kind of the facet; -1 before the first one.
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

contains

  !> Add a spring.
  subroutine foundation_add(self, surface, fix, modulus, value, area)
    class(foundation_t), intent(inout) :: self
    type(surface_t), intent(in) :: surface  !! The surface.
    type(directions_t), intent(in) :: fix  !! Directions.
    real(dp), intent(in) :: modulus  !! Foundation modulus [pressure/length].
    real(dp), intent(in) :: value(3)  !! Displacement of the far ends in the axes of `fix`, 0 along others (3) [length].
    real(dp), intent(in), optional :: area  !! Area of the surface, for the log [length^2; length in plane analyses].
    type(text_t), allocatable :: place(:)
    integer :: i, n
    if (.not. allocated(self%modulus)) then
      allocate (self%place(0), self%fix(0), self%modulus(0), self%area(0), self%value(3, 0), self%of(0), self%kind(0))
      allocate (self%node(max_facet_nodes, 0), self%block(0), self%element(0))
    end if
    n = size(self%modulus) + 1
    allocate (place(n))
    do i = 1, n - 1
      place(i)%s = self%place(i)%s
    end do
    place(n)%s = surface%name
    call move_alloc(place, self%place)
    self%fix = [self%fix, fix]
    self%modulus = [self%modulus, modulus]
    self%area = [self%area, 0.0_dp]
    if (present(area)) self%area(n) = area
    self%value = reshape([self%value, value], [3, n])
    self%of = [self%of, (n, i=1, surface%n_facets)]
    self%kind = [self%kind, surface%kind(:surface%n_facets)]
    self%node = reshape([self%node, surface%node(:, :surface%n_facets)], [max_facet_nodes, size(self%of)])
    self%block = [self%block, surface%block(:surface%n_facets)]
    self%element = [self%element, surface%element(:surface%n_facets)]
    self%n = size(self%of)
  end subroutine foundation_add

  !> Number of springs.
  pure integer function foundation_n_springs(self) result(n)
    class(foundation_t), intent(in) :: self
    n = 0
    if (allocated(self%modulus)) n = size(self%modulus)
  end function foundation_n_springs

  !> Springs at the quadrature points of a facet.
  subroutine foundation_points_of(self, x, analysis, f, points)
    class(foundation_t), intent(in) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    integer, intent(in) :: f  !! Index of the facet.
    type(foundation_points_t), intent(inout) :: points  !! The points; those of the facet before keep what they share.
    real(dp) :: normal(size(x, 1)), axes(size(x, 1), 3), value(3)
    logical :: fixed(3)
    integer :: dim, i, q
    dim = size(x, 1)
    call points%take_rule(dim, self%kind(f))
    associate (fix => self%fix(self%of(f)), modulus => self%modulus(self%of(f)), node => self%node(:points%n_nodes, f))
      fixed = fix%fixed
      value = self%value(:, self%of(f))
      if (dim == 2) fixed(merge(2, 3, fix%local)) = .false.
      points%n_directions = count(fixed)
      points%tensor = 0
      points%pull = 0
      do q = 1, size(points%weight)
        call facet_geometry(points%kind, dim, x(:, node), points%xi(:, q), points%x(:, q), normal, points%area(q))
        points%area(q) = points%area(q)*points%weight(q)
        if (analysis == analysis_axisymmetric .and. points%kind /= element_point) &
          points%area(q) = points%area(q)*two_pi*points%x(1, q)
        call axes_at(dim, fix%local, normal, axes)
        points%direction(:, :points%n_directions, q) = axes(:, pack([1, 2, 3], fixed))
        do i = 1, 3
          if (.not. fixed(i)) cycle
          points%tensor(:, :, q) = points%tensor(:, :, q) + &
                                   modulus*spread(axes(:, i), 2, dim)*spread(axes(:, i), 1, dim)
          points%pull(:, q) = points%pull(:, q) + modulus*value(i)*axes(:, i)
        end do
      end do
    end associate
  end subroutine foundation_points_of

  !> Add the forces K_s u of the springs' matrix, and u.K_s u.
  subroutine foundation_add_forces(self, x, analysis, u, force, energy)
    class(foundation_t), intent(in) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(inout) :: force(:, :)  !! Forces in global axes, added to (dim, n_nodes) [force].
    real(dp), intent(inout) :: energy  !! Twice the energy of the springs with far ends at rest, added to [energy].
    type(foundation_points_t) :: points
    real(dp) :: moved(size(x, 1)), traction(size(x, 1))
    integer :: a, f, q
    do f = 1, self%n
      call self%points_of(x, analysis, f, points)
      associate (node => self%node(:points%n_nodes, f))
        do q = 1, size(points%weight)
          moved = matmul(u(:, node), points%shape(:, q))
          traction = points%area(q)*matmul(points%tensor(:, :, q), moved)
          energy = energy + dot_product(traction, moved)
          do a = 1, points%n_nodes
            force(:, node(a)) = force(:, node(a)) + points%shape(a, q)*traction
          end do
        end do
      end associate
    end do
  end subroutine foundation_add_forces

  !> Add the forces of the displacements of the far ends.
  subroutine foundation_add_loads(self, x, analysis, force)
    class(foundation_t), intent(in) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(inout) :: force(:, :)  !! Forces in global axes, added to (dim, n_nodes) [force].
    type(foundation_points_t) :: points
    integer :: a, f, q
    do f = 1, self%n
      if (.not. any(abs(self%value(:, self%of(f))) > 0)) cycle
      call self%points_of(x, analysis, f, points)
      do q = 1, size(points%weight)
        do a = 1, points%n_nodes
          associate (node => self%node(a, f))
            force(:, node) = force(:, node) + points%area(q)*points%shape(a, q)*points%pull(:, q)
          end associate
        end do
      end do
    end do
  end subroutine foundation_add_loads

  !> Forces of the springs on the body, spring by spring, with their moments about the origin; their energies.
  subroutine foundation_add_up_reactions(self, x, analysis, u, sums, energy)
    class(foundation_t), intent(in) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(out) :: sums(:, :)  !! Force and moment of each spring (6, n_springs) [force, force length].
    real(dp), intent(out) :: energy  !! k (u - g) D (u - g)/2, integrated over all springs [energy].
    type(foundation_points_t) :: points
    real(dp) :: moved(size(x, 1)), force(3), p(3), along(3)
    integer :: f, i, q, s, dim
    dim = size(x, 1)
    sums = 0
    energy = 0
    force = 0
    p = 0
    do f = 1, self%n
      call self%points_of(x, analysis, f, points)
      s = self%of(f)
      do q = 1, size(points%weight)
        moved = matmul(u(:, self%node(:points%n_nodes, f)), points%shape(:, q))
        force(:dim) = points%area(q)*(points%pull(:, q) - matmul(points%tensor(:, :, q), moved))
        p(:dim) = points%x(:, q)
        sums(:, s) = sums(:, s) + [force, p(2)*force(3) - p(3)*force(2), p(3)*force(1) - p(1)*force(3), &
                                   p(1)*force(2) - p(2)*force(1)]
        ! The force has components along the springs alone.
        do i = 1, points%n_directions
          along(i) = dot_product(force(:dim), points%direction(:, i, q))
        end do
        if (points%area(q) > 0) energy = energy + sum(along(:points%n_directions)**2)/(2*self%modulus(s)*points%area(q))
      end do
    end do
  end subroutine foundation_add_up_reactions

  !> Give the nodes other numbers.
  pure subroutine foundation_renumber(self, number)
    class(foundation_t), intent(inout) :: self
    integer, intent(in) :: number(:)  !! New number of each node; those of facets have one (n_nodes).
    integer :: a, f
    do f = 1, self%n
      do a = 1, max_facet_nodes
        if (self%node(a, f) > 0) self%node(a, f) = number(self%node(a, f))
      end do
    end do
  end subroutine foundation_renumber

  !> Keep the facets that have one of some nodes.
  pure subroutine foundation_choose(self, selected)
    class(foundation_t), intent(inout) :: self
    logical, intent(in) :: selected(:)  !! Whether facets with a node are kept (n_nodes).
    logical, allocatable :: kept(:)
    integer, allocatable :: chosen(:)
    integer :: a, f
    if (self%n == 0) return
    allocate (kept(self%n), source=.false.)
    do f = 1, self%n
      do a = 1, max_facet_nodes
        if (self%node(a, f) > 0) kept(f) = kept(f) .or. selected(self%node(a, f))
      end do
    end do
    chosen = pack([(f, f=1, self%n)], kept)
    self%of = self%of(chosen)
    self%kind = self%kind(chosen)
    self%node = self%node(:, chosen)
    self%block = self%block(chosen)
    self%element = self%element(chosen)
    self%n = size(chosen)
  end subroutine foundation_choose

  !> Whether another foundation has the same springs but for a rigid motion; far ends may move otherwise.
  pure logical function foundation_is_moved(self, other, dim, motion) result(same)
    class(foundation_t), intent(in) :: self
    type(foundation_t), intent(in) :: other  !! The other one.
    integer, intent(in) :: dim  !! Number of displacement components.
    type(placement_t), intent(in) :: motion  !! Rigid motion from this one to the other.
    logical :: all_fixed
    integer :: s
    same = self%n == other%n .and. self%n_springs() == other%n_springs()
    if (.not. same .or. self%n == 0) return
    same = all(self%of == other%of) .and. all(self%kind == other%kind) .and. all(self%node == other%node) .and. &
           all(abs(self%modulus - other%modulus) <= given_rounding*self%modulus)
    do s = 1, self%n_springs()
      associate (a => self%fix(s), b => other%fix(s))
        same = same .and. (a%local .eqv. b%local) .and. all(a%fixed .eqv. b%fixed)
        if (.not. motion%rotated) cycle
        ! Normals move with the body, and the plane of both tangents; xi and eta alone follow the global axes.
        all_fixed = all(a%fixed(:dim))
        if (a%local) all_fixed = dim == 2 .or. (a%fixed(1) .eqv. a%fixed(2))
        same = same .and. all_fixed
      end associate
    end do
  end function foundation_is_moved

  !> Area of a surface, of the full circumference in axisymmetric analyses [length^2; length in plane analyses].
  real(dp) function surface_area(x, analysis, surface) result(area)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(surface_t), intent(in) :: surface  !! The surface.
    type(foundation_t) :: whole
    type(foundation_points_t) :: points
    integer :: f
    call whole%add(surface, directions_t(), 1.0_dp, [0.0_dp, 0.0_dp, 0.0_dp])
    area = 0
    do f = 1, whole%n
      call whole%points_of(x, analysis, f, points)
      area = area + sum(points%area)
    end do
  end function surface_area

  !> Put the springs into a parcel, or take them out.
  subroutine foundation_carry(self, parcel)
    class(foundation_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    integer, allocatable :: flag(:, :)
    integer :: s
    call parcel%carry(self%n)
    if (self%n == 0) return
    call parcel%carry(self%place)
    call parcel%carry(self%modulus)
    call parcel%carry(self%area)
    call parcel%carry(self%value)
    call parcel%carry(self%of)
    call parcel%carry(self%kind)
    call parcel%carry(self%node)
    call parcel%carry(self%block)
    call parcel%carry(self%element)
    if (parcel%is_read) then
      allocate (self%fix(size(self%modulus)))
    else
      allocate (flag(4, size(self%modulus)))
      do s = 1, size(self%modulus)
        flag(:, s) = merge(1, 0, [self%fix(s)%local, self%fix(s)%fixed])
      end do
    end if
    call parcel%carry(flag)
    do s = 1, size(self%modulus)
      self%fix(s)%local = flag(1, s) > 0
      self%fix(s)%fixed = flag(2:, s) > 0
    end do
  end subroutine foundation_carry

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
    real(dp), intent(out) :: k(n, n, dim, dim)  !! Node a, node b, component i, component j [force/length].
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
end module dotyk_elasticity_foundation
