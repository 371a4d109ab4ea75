!> Contact pressures as users look at them: projected, with resultants, and as a field of the nodes.
!>
!> At the edge between two pairs each has the pressure of its own part of the faces around the node.
!>
!> Fields of the nodes are tractions on both surfaces, gaps and contact status on the slave surface.
module dotyk_control_pressures
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_sort, only: sort_order
  use dotyk_base_thresholds, only: half_digits, rounding, sharp_cosine
  use dotyk_contact_contact_patches, only: contact_patch_t, find_patches
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_pair, only: contact_pair_t, pair_resultant, pair_resultant_t
  use dotyk_contact_pressure_projection, only: pressure_projection_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: project_pressures

  type, public :: contact_fields_t  !! Fields of one body.
    !> Traction of the contact pressure on the body; 0 off the contact surfaces (dim, n_nodes) [pressure].
    real(dp), allocatable :: traction(:, :)
    !> Gap after deformation at nodes of slave surfaces, the least one where a node has several; NaN elsewhere (n_nodes)
    !> [length].
    real(dp), allocatable :: gap(:)
    integer, allocatable :: status(:)  !! One of `status_*` (n_nodes).
  contains
    procedure :: init => fields_init
  end type contact_fields_t

  integer, parameter, public :: status_none = 0    !< no constraint: not on a slave surface, or without projection
  integer, parameter :: status_open = 1    !< inactive constraints
  integer, parameter :: status_active = 2  !< an active constraint at the node, or next to it on its facet edge

  type :: nodal_pressures_t  !! What the pairs of one body have at its nodes.
    integer, private :: n = 0  !! Number of entries, in the order of the pairs.
    integer, allocatable, private :: node(:)  !! Node of each entry (n_allocated).
    !> Its pressure [pressure], and the weight of the pair around the node [as the weights of the pair] (n_allocated).
    real(dp), allocatable, private :: pressure(:), weight(:)
    real(dp), allocatable, private :: normal(:, :)  !! Its unit normal into the body (dim, n_allocated) [].
  contains
    procedure :: add => nodal_add
    procedure :: combine => nodal_combine
  end type nodal_pressures_t

  type, public :: pair_solution_t  !! Pressures of one pair.
    real(dp), allocatable :: pressure(:)  !! Pressure of the scheme (n_rows) [pressure].
    !> The same, projected on the linear shape functions of surface_a; 0 where that is less (n_rows) [pressure].
    real(dp), allocatable :: projected(:)
    real(dp), allocatable :: gap(:)  !! Gap that is left, negative where the points penetrate (n_rows) [length].
    real(dp) :: force(3) = 0  !! Resultant on body a (3) [force].
    !> Radial components on body a, summed around the circumference: no resultant; 0 in other analyses [force].
    real(dp) :: radial_force = 0
    !> Active rows: with theta > 0 those that penetrate, with theta = 0 those under pressure. The pressures of the
    !> Neumann scheme decay on rows that have opened, but do not vanish.
    integer :: n_active = 0
    real(dp) :: moment(3) = 0  !! Moment on body a about the origin; 0 in axisymmetric analyses (3) [force length].
    real(dp) :: centre(3) = 0  !! Centre of pressure, see `pair_resultant_t`; NaN where there is none (3) [length].
    type(contact_patch_t), allocatable :: patch(:)  !! Connected patches of active rows (n_patches).
    real(dp) :: area = 0  !! Contact area, the sum of their areas [as the weights].
    !> Greatest projected pressure of rows that the master covers, of the others where these have none [pressure].
    real(dp) :: peak = 0
    real(dp) :: peak_position(3) = 0  !! Position of its row (3) [length].
    real(dp) :: peak_covered = 1  !! Fraction of the slave surface around this row that the master covers [].
    real(dp) :: least_gap = 0  !! Least gap [length].
    real(dp) :: gap_position(3) = 0  !! Position of its row (3) [length].
  contains
    procedure :: is_rounding => pair_solution_is_rounding
  end type pair_solution_t

  type, public :: nodal_field_t  !! One number per node of a body.
    real(dp), allocatable :: value(:)  !! (n_nodes).
  end type nodal_field_t

  !> Fraction of the slave surface around a vertex from which on the master covers it: on straight edges of the master
  !> across facets it is half, at corners a quarter []. The pressure at a sliver is no measure of that beside it.
  real(dp), parameter, public :: well_covered = 0.2_dp

contains

  !> Whether there are contact forces that are rounding beside the others: they are no contact, which has no place.
  pure logical function pair_solution_is_rounding(self, pair, force) result(is_rounding)
    class(pair_solution_t), intent(in) :: self
    type(contact_pair_t), intent(in) :: pair  !! The pair.
    real(dp), intent(in) :: force  !! Sum of the sizes of all nodal forces on its bodies [force].
    is_rounding = (self%n_active > 0 .or. any(abs(self%pressure) > 0)) .and. &
      sum(pair%row_weight*abs(self%pressure)) <= rounding*force
  end function pair_solution_is_rounding

  !> Pressures of all pairs.
  subroutine project_pressures(problem, first_row, pressure, penetration, solution, nodal, error, fields, forgotten)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, pairs and their surfaces.
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: pressure(:)  !! Contact pressures (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    !> Pressures, gaps and resultants of the pairs (n_pairs).
    type(pair_solution_t), allocatable, intent(out) :: solution(:)
    type(nodal_field_t), allocatable, intent(out) :: nodal(:)  !! Projected pressure at the nodes (n_bodies) [pressure].
    !> Allocated where the mass matrix of a surface cannot be factorized; names the pair.
    type(error_t), allocatable, intent(out) :: error
    !> Tractions, gaps and contact status at the nodes (n_bodies).
    type(contact_fields_t), allocatable, intent(out), optional :: fields(:)
    !> Pairs whose pressures are rounding: they have none, and no active row; all have theirs if absent (n_pairs).
    logical, intent(in), optional :: forgotten(:)
    type(pressure_projection_t) :: projection
    type(pair_resultant_t) :: resultant
    type(nodal_pressures_t) :: at_nodes(size(problem%body))
    real(dp), allocatable :: on_a(:), on_b(:), traction(:, :)
    logical, allocatable :: active(:)
    integer :: k, b, first, last
    allocate (solution(size(problem%pair)), nodal(size(problem%body)))
    do b = 1, size(problem%body)
      allocate (nodal(b)%value(problem%body(b)%mesh%n_nodes()), source=0.0_dp)
    end do
    if (present(fields)) then
      allocate (fields(size(problem%body)))
      do b = 1, size(problem%body)
        call fields(b)%init(problem%body(b)%dimension, problem%body(b)%mesh%n_nodes())
      end do
    end if
    do k = 1, size(problem%pair)
      first = first_row(k)
      last = first_row(k + 1) - 1
      solution(k)%pressure = pressure(first:last)
      solution(k)%gap = -penetration(first:last)
      active = merge(penetration(first:last), pressure(first:last), problem%pair(k)%row_theta > 0) > 0
      if (present(forgotten)) then
        if (forgotten(k)) then
          solution(k)%pressure = 0
          active = .false.
        end if
      end if
      resultant = pair_resultant(problem%pair(k), problem%body(problem%pair(k)%body_a)%analysis == &
                                 analysis_axisymmetric, solution(k)%pressure)
      solution(k)%force = resultant%force
      solution(k)%radial_force = resultant%radial
      solution(k)%moment = resultant%moment
      solution(k)%centre = resultant%centre
      solution(k)%n_active = count(active)
      call find_patches(problem%pair(k), problem%surface_a(k), solution(k)%pressure, active, solution(k)%patch)
      solution(k)%area = sum(solution(k)%patch%area)
      call projection%init(problem%pair(k), problem%surface_a(k), problem%surface_b(k), error)
      if (allocated(error)) return
      allocate (solution(k)%projected(last - first + 1), on_a(size(projection%side_a%node)), &
        on_b(size(projection%side_b%node)))
      call projection%project(problem%pair(k), solution(k)%pressure, solution(k)%projected, on_a, on_b)
      ! The projection may fall below 0 at the rim of the contact.
      solution(k)%projected = max(0.0_dp, solution(k)%projected)
      on_a = max(0.0_dp, on_a)
      on_b = max(0.0_dp, on_b)
      call at_nodes(problem%pair(k)%body_a)%add(problem%pair(k), projection%side_a, -1.0_dp, on_a)
      call at_nodes(problem%pair(k)%body_b)%add(problem%pair(k), projection%side_b, 1.0_dp, on_b)
      call find_extremes(problem%pair(k), solution(k))
      if (present(fields)) &
        call add_contact_fields(problem%pair(k), problem%surface_a(k), projection, solution(k)%gap, active, &
                                fields(problem%pair(k)%body_a))
      call projection%destroy()
      deallocate (on_a, on_b)
    end do
    do b = 1, size(problem%body)
      associate (mesh => problem%body(b)%mesh)
        allocate (traction(problem%body(b)%dimension, mesh%n_nodes()))
        call at_nodes(b)%combine(nodal(b)%value, traction)
        if (present(fields)) call move_alloc(traction, fields(b)%traction)
        if (allocated(traction)) deallocate (traction)
      end associate
    end do
  end subroutine project_pressures

  !> Greatest pressure and least gap of a pair, and where they are.
  pure subroutine find_extremes(pair, solution)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(pair_solution_t), intent(inout) :: solution  !! Its projected pressures and gaps in, the extremes out.
    logical :: covered(pair%n_rows)
    integer :: i
    if (pair%n_rows == 0) return
    ! Contacts at points and edges have no area.
    covered = .true.
    covered(:pair%n_mortar_rows) = pair%row_covered >= well_covered
    if (.not. any(covered .and. solution%projected > half_digits*maxval(solution%projected))) covered = .true.
    i = maxloc(solution%projected, 1, covered)
    solution%peak = solution%projected(i)
    solution%peak_position(:pair%dimension) = pair%row_position(:, i)
    if (i <= pair%n_mortar_rows .and. solution%peak > 0) solution%peak_covered = pair%row_covered(i)
    i = minloc(solution%gap, 1)
    solution%least_gap = solution%gap(i)
    solution%gap_position(:pair%dimension) = pair%row_position(:, i)
  end subroutine find_extremes

  !> Add one side of a pair.
  subroutine nodal_add(self, pair, side, sign, pressure)
    class(nodal_pressures_t), intent(inout) :: self
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(corner_interpolation_t), intent(in) :: side  !! Interpolation on this side.
    real(dp), intent(in) :: sign  !! -1 on body a, 1 on body b: from the normals of the pair to those into the body [].
    real(dp), intent(in) :: pressure(:)  !! Projected pressures at side%node (their number) [pressure].
    real(dp) :: corner(side%n), component(size(side%node)), normal(pair%dimension, size(side%node))
    integer :: c, i
    if (self%n == 0) then
      self%node = [integer ::]
      self%pressure = [real(dp) ::]
      self%weight = self%pressure
      allocate (self%normal(pair%dimension, 0))
    end if
    do c = 1, pair%dimension
      call side%moments(pair%weight*pair%normal(c, :), corner)
      call side%at_nodes(corner, component)
      normal(c, :) = component
    end do
    do i = 1, size(side%node)
      normal(:, i) = sign*normal(:, i)/max(norm2(normal(:, i)), tiny(sign))
    end do
    call side%moments(pair%weight, corner)
    call side%at_nodes(corner, component)
    self%n = self%n + size(side%node)
    self%node = [self%node, side%node]
    self%pressure = [self%pressure, pressure]
    self%weight = [self%weight, component]
    self%normal = reshape([self%normal, normal], [pair%dimension, self%n])
  end subroutine nodal_add

  !> Pressures and tractions of the nodes. Pairs with about the same normal at a node have the mean, by their weights;
  !> where faces meet at an edge the node has the greatest of their pressures, and the sum of their tractions.
  pure subroutine nodal_combine(self, pressure, traction)
    class(nodal_pressures_t), intent(in) :: self
    real(dp), intent(out) :: pressure(:)  !! Pressures; 0 at nodes without entries (n_nodes) [pressure].
    real(dp), intent(out) :: traction(:, :)  !! Tractions, likewise (dim, n_nodes) [pressure].
    integer :: order(self%n), group(self%n), i, j, k, first, last
    real(dp) :: p
    pressure = 0
    traction = 0
    if (self%n == 0) return
    call sort_order(self%node, order)
    group = 0
    last = 0
    do while (last < self%n)
      first = last + 1
      last = first
      do while (last < self%n)
        if (self%node(order(last + 1)) /= self%node(order(first))) exit
        last = last + 1
      end do
      associate (node => self%node(order(first)), entry => order(first:last))
        do i = 1, size(entry)
          j = 1
          do while (dot_product(self%normal(:, entry(j)), self%normal(:, entry(i))) < sharp_cosine .and. j < i)
            j = j + 1
          end do
          group(entry(i)) = i
          if (j < i) group(entry(i)) = group(entry(j))
        end do
        do i = 1, size(entry)
          if (.not. any(group(entry) == i)) cycle
          p = mean_of(pack(entry, group(entry) == i))
          if (abs(p) > abs(pressure(node))) pressure(node) = p
          do k = 1, size(entry)
            if (group(entry(k)) /= i) cycle
            traction(:, node) = traction(:, node) + p*self%normal(:, entry(k))
            exit
          end do
        end do
      end associate
    end do

  contains

    !> Mean pressure of some entries.
    pure real(dp) function mean_of(entry) result(mean)
      integer, intent(in) :: entry(:)  !! The entries, at least one (n).
      mean = self%pressure(entry(1))
      if (size(entry) == 1) return
      if (sum(self%weight(entry)) > 0) then
        mean = sum(self%weight(entry)*self%pressure(entry))/sum(self%weight(entry))
      else
        mean = sum(self%pressure(entry))/size(entry)
      end if
    end function mean_of
  end subroutine nodal_combine

  !> Fields of a body without contact.
  subroutine fields_init(self, dimension, n_nodes)
    class(contact_fields_t), intent(out) :: self
    integer, intent(in) :: dimension  !! Dimension of space.
    integer, intent(in) :: n_nodes  !! Number of nodes.
    allocate (self%traction(dimension, n_nodes), source=0.0_dp)
    allocate (self%gap(n_nodes), source=ieee_value(0.0_dp, ieee_quiet_nan))
    allocate (self%status(n_nodes), source=status_none)
  end subroutine fields_init

  !> Add gaps and contact status of one pair.
  subroutine add_contact_fields(pair, surface_a, projection, gap, active, of_a)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface.
    type(pressure_projection_t), intent(in) :: projection  !! Its projection.
    real(dp), intent(in) :: gap(:)  !! Gaps of the rows after deformation (n_rows) [length].
    logical, intent(in) :: active(:)  !! Whether the rows are active (n_rows).
    type(contact_fields_t), intent(inout) :: of_a  !! Fields of body a, added to.
    type(corner_interpolation_t) :: mortar
    real(dp), allocatable :: total(:), sums(:)
    logical, allocatable :: is_active(:)
    integer :: i, j, q
    if (pair%n_mortar_rows > 0) then
      ! Corners of mortar rows have the numbers of the mortar points alone.
      call mortar%init(surface_a, pair%facet_a(:pair%n_mortar_points), pair%xi_a(:, :pair%n_mortar_points), &
                       pair%sheet_b(:pair%n_mortar_points))
      allocate (total(mortar%n), sums(mortar%n), source=0.0_dp)
      allocate (is_active(mortar%n), source=.false.)
      total(pair%row_corner) = 1
      sums(pair%row_corner) = gap(:pair%n_mortar_rows)
      is_active(pair%row_corner) = active(:pair%n_mortar_rows)
      call add_gaps(mortar, total, sums, is_active, of_a)
      deallocate (total, sums, is_active)
    end if
    if (pair%n_rows == pair%n_mortar_rows) return
    ! Points that are rows: means around the corners of their facets.
    associate (side => projection%side_a)
      allocate (total(side%n), sums(side%n), source=0.0_dp)
      allocate (is_active(side%n), source=.false.)
      do i = pair%n_mortar_rows + 1, pair%n_rows
        q = pair%n_mortar_points + i - pair%n_mortar_rows
        do j = 1, 4
          if (side%corner(j, q) == 0) cycle
          associate (corner => side%corner(j, q), weight => pair%row_weight(i)*side%shape(j, q))
            total(corner) = total(corner) + weight
            sums(corner) = sums(corner) + weight*gap(i)
            is_active(corner) = is_active(corner) .or. active(i)
          end associate
        end do
      end do
      call add_gaps(side, total, sums, is_active, of_a)
    end associate
  end subroutine add_contact_fields

  !> Add gaps and status of corners at the nodes of their facets.
  subroutine add_gaps(side, total, sums, is_active, field)
    type(corner_interpolation_t), intent(in) :: side  !! Interpolation on the slave side.
    !> Sums of the weights of the constraints of each corner; 0 where it has none (side%n) [any].
    real(dp), intent(in) :: total(:)
    real(dp), intent(in) :: sums(:)  !! Sums of weights times gaps (side%n) [length].
    logical, intent(in) :: is_active(:)  !! Whether a constraint of the corner is active (side%n).
    type(contact_fields_t), intent(inout) :: field  !! Added to.
    real(dp) :: gap
    integer :: i
    do i = 1, size(side%position)
      associate (from => side%from(1:side%n_from(i), i), node => side%node(side%position(i)))
        if (.not. all(total(from) > 0)) cycle
        gap = sum(sums(from)/total(from))/size(from)
        if (ieee_is_nan(field%gap(node))) field%gap(node) = gap
        field%gap(node) = min(field%gap(node), gap)
        field%status(node) = max(field%status(node), merge(status_active, status_open, any(is_active(from))))
      end associate
    end do
  end subroutine add_gaps
end module dotyk_control_pressures
