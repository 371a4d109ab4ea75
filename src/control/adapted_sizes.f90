!> Sizes of elements by which a scene reaches a given error of the mesh with the fewest elements: equal errors of all
!> elements (Zienkiewicz and Zhu, Int. J. Numer. Methods Engrg. 24, 1987), and enough elements over each contact patch.
!>
!> An element of the error eta and the size h gets the size `h (c n/eta^2)^(1/(2 p + d))`, n the number of its copies in
!> the scene, p the order of the elements, d the dimension, and one c for all.
module dotyk_control_adapted_sizes
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: quoted, text_t
  use dotyk_base_thresholds, only: notable, pi
  use dotyk_contact_broad_phase, only: overlapping_boxes
  use dotyk_control_body_solution, only: element_field_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_mesh_quantities, only: quantity_history_t
  use dotyk_control_quantity_error, only: quantity_errors_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_element, only: element_tet10, element_tet4, element_tri3, element_tri6
  use dotyk_mesh_placement, only: placement_t
  use dotyk_mesh_size_view, only: size_of_measure, size_view_t
  use dotyk_mesh_tag_map, only: tag_map_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private

  type :: errors_t  !! Of the elements of a view.
    !> Squared relative errors of all copies together, of the worst load case; of one load case (n_elements) [].
    real(dp), allocatable :: square(:), now(:)
    integer, allocatable :: copies(:)  !! Elements of the scene that each one is (n_elements).
  end type errors_t

  type :: places_t  !! Where the elements of a body are.
    integer, allocatable :: view(:), place(:)  !! View of each element, and number in it (n_elements).
    type(placement_t) :: placement  !! From the axes of the geometry to those of the scene.
  end type places_t

  type :: patch_t  !! A connected patch of active rows.
    integer :: body(2) = 0  !! The bodies.
    real(dp) :: size = 0  !! Greatest size of elements there [length].
    real(dp), allocatable :: x(:, :), width(:)  !! Positions and widths of the rows (3, n), (n) [length].
  end type patch_t

  type, public :: adapted_sizes_t  !! What is known of a scene on its last mesh, and the sizes of the next one.
    type(size_view_t), allocatable :: view(:)  !! One for each volume (n_views).
    !> Error of the mesh of the worst load case, relative in the energy norm; or the root of the greatest relative error
    !> bar of the quantities that meshes are made for, which is of the same order in the size of the elements [].
    real(dp) :: error = 0
    logical :: is_known = .true.  !! Whether it is known in all load cases.
    logical :: has_goal = .false.  !! Whether quantities that meshes are made for have a value.
    logical :: is_confirmed = .true.  !! Whether their error bars are confirmed in all load cases.
    character(:), allocatable :: without_limit  !! Name of a quantity that has no limit.
    real(dp) :: contact = 0  !! Greatest error of the contact conditions of all load cases [].
    integer :: n_elements = 0  !! Elements of the scene.
    real(dp) :: expected = 0  !! Expected number of elements of the next mesh in the scene [].
    real(dp) :: predicted = 0  !! Error that is expected of it [].
    type(errors_t), allocatable, private :: errors(:)  !! (n_views)
    type(places_t), allocatable, private :: of_body(:)  !! (n_bodies)
    type(patch_t), allocatable, private :: patch(:)  !! Of all load cases (n_patches).
  contains
    procedure :: observe => sizes_observe
    procedure :: plan => sizes_plan
  end type adapted_sizes_t

  !> Error of the contact conditions up to which the error of the mesh is one to rely on: contact that the mesh does not
  !> resolve is in this one alone [].
  real(dp), parameter, public :: resolved = 0.3_dp
  !> Order of convergence of quadratic elements, and that which singular elements are given: those with a notable part
  !> of the squared error [].
  real(dp), parameter :: order = 2, singular_order = 0.5_dp
  !> Sizes change by these factors in a round at most; those of singular elements become smaller by up to the last [].
  real(dp), parameter :: least_ratio = 0.15_dp, greatest_ratio = 4, singular_ratio = 0.01_dp
  real(dp), parameter :: over_radius = 4  !! Elements over the radius of a contact patch.
  !> Rows are one patch where they are nearer to each other than so many of their widths; nodes are at a row likewise.
  real(dp), parameter :: connected = 2.5_dp, near = 1.5_dp
  real(dp), parameter :: floor_of_size = 1.0e-4_dp  !! Smallest size as a fraction of the extent of a volume [].
  real(dp), parameter :: relax = 1.15_dp  !! The aim is relaxed by this factor until the elements are as few as allowed.
  integer, parameter :: n_bisections = 100  !! Bisections of log c.

contains

  !> Take the errors and the contact of a load case; the first one brings the meshes.
  subroutine sizes_observe(self, file, placement, problem, near_contact, case, asked, history, solution, error)
    class(adapted_sizes_t), intent(inout) :: self
    type(text_t), intent(in) :: file(:)  !! Geometry of each body (n_bodies).
    type(placement_t), intent(in) :: placement(:)  !! Placement of each body (n_bodies).
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    logical, intent(in) :: near_contact  !! Whether errors far from the contact count less.
    integer, intent(in) :: case  !! The load case.
    real(dp), intent(in) :: asked  !! Relative error that is asked for [].
    type(quantity_history_t), intent(inout) :: history  !! Quantities on the meshes so far; gets those of this one.
    type(contact_solution_t), intent(inout) :: solution  !! With its errors; quantities get error bars.
    !> Allocated where a body has other elements than triangles or tetrahedra.
    type(error_t), allocatable, intent(out) :: error
    type(element_field_t), allocatable :: square(:)
    character(:), allocatable :: name
    real(dp) :: reached
    integer :: b, e, first, k, v
    if (.not. allocated(self%view)) call find_views(self, file, placement, problem, error)
    if (allocated(error)) return
    do v = 1, size(self%view)
      self%errors(v)%now = 0*self%errors(v)%square
    end do
    first = size(self%patch) + 1
    do k = 1, size(problem%pair)
      associate (first_row => solution%qp%pair_first_row(k), last_row => solution%qp%pair_first_row(k + 1) - 1)
        call add_patches(self, problem, k, solution%state%pressure(first_row:last_row) > 0)
      end associate
    end do
    reached = solution%budget%discretization
    allocate (square(size(problem%body)))
    if (allocated(solution%budget%of_element)) then
      do b = 1, size(square)
        if (allocated(solution%budget%of_element(b)%value)) square(b)%value = solution%budget%of_element(b)%value**2
      end do
    end if
    if (near_contact) call weigh(problem, self%patch(first:), reached, square)
    if (allocated(solution%quantities%of)) then
      if (solution%budget%contact < resolved) &
        call history%compare(case, norm2([reached, solution%budget%contact]), asked, solution%quantities)
      if (solution%quantities%has_goal()) call take_goals(solution%quantities, reached, square)
      name = solution%quantities%name_without_limit()
      if (len(name) > 0) call move_alloc(name, self%without_limit)
    end if
    do b = 1, size(problem%body)
      if (.not. allocated(square(b)%value)) cycle
      do e = 1, size(self%of_body(b)%view)
        associate (now => self%errors(self%of_body(b)%view(e))%now, place => self%of_body(b)%place(e))
          now(place) = now(place) + square(b)%value(e)
        end associate
      end do
    end do
    do v = 1, size(self%view)
      self%errors(v)%square = max(self%errors(v)%square, self%errors(v)%now)
    end do
    if (.not. reached >= 0) self%is_known = .false.
    self%error = max(self%error, reached)
    self%has_goal = self%has_goal .or. solution%quantities%has_goal()
    self%is_confirmed = self%is_confirmed .and. solution%quantities%are_confirmed()
    self%contact = max(self%contact, solution%budget%contact)
  end subroutine sizes_observe

  !> Weigh errors by `1/(1 + d/a)^2`, a the radius of a contact patch, d the distance to the box around its rows.
  subroutine weigh(problem, patch, reached, square)
    type(contact_problem_t), intent(in) :: problem  !! Bodies.
    type(patch_t), intent(in) :: patch(:)  !! Patches of the load case; nothing is weighed without.
    real(dp), intent(inout) :: reached  !! Error of the scene [].
    type(element_field_t), intent(inout) :: square(:)  !! Squares of those of the elements (n_bodies) [].
    real(dp) :: x(3), weight, total
    integer :: b, e, i, k, p
    if (size(patch) == 0 .or. .not. all([(allocated(square(b)%value), b=1, size(square))])) return
    total = 0
    do b = 1, size(square)
      i = 0
      associate (mesh => problem%body(b)%mesh)
        do k = 1, size(mesh%block)
          associate (node => mesh%block(k)%node(:mesh%dimension + 1, :))
            do e = 1, size(node, 2)
              i = i + 1
              x = 0
              x(:mesh%dimension) = sum(mesh%x(:, node(:, e)), 2)/size(node, 1)
              weight = 0
              do p = 1, size(patch)
                associate (low => minval(patch(p)%x, 2), high => maxval(patch(p)%x, 2))
                  weight = max(weight, (1 + norm2(max(0.0_dp, low - x, x - high))/(over_radius*patch(p)%size))**(-2))
                end associate
              end do
              square(b)%value(i) = weight*square(b)%value(i)
            end do
          end associate
        end do
      end associate
      total = total + sum(square(b)%value)
    end do
    reached = sqrt(total)
  end subroutine weigh

  !> Errors of the quantities that meshes are made for, in place of that in the energy norm, to which those of
  !> quantities without dual solutions are proportional.
  subroutine take_goals(goal, reached, square)
    type(quantity_errors_t), intent(in) :: goal  !! The quantities, with error bars.
    real(dp), intent(inout) :: reached  !! As `error` of `adapted_sizes_t`; NaN where it is not known [].
    type(element_field_t), intent(inout) :: square(:)  !! Squares of what elements contribute (n_bodies) [].
    real(dp) :: linear, other, of_goal, of_energy
    integer :: b
    linear = goal%greatest(.true.)
    other = goal%greatest(.false.)
    of_goal = 0
    if (allocated(goal%of_element)) of_goal = sum([(sum(goal%of_element(b)%value), b=1, size(square))])
    of_energy = sum([(sum(square(b)%value), b=1, size(square))])
    reached = sqrt(merge(linear + other, max(linear, other), ieee_is_nan(linear + other)))
    do b = 1, size(square)
      square(b)%value = other/max(tiny(of_energy), of_energy)*square(b)%value
      if (linear > 0 .and. allocated(goal%of_element)) &
        square(b)%value = square(b)%value + linear/max(tiny(of_goal), of_goal)*goal%of_element(b)%value
      square(b)%value = max(linear, other)/max(tiny(linear), linear + other)*square(b)%value
    end do
  end subroutine take_goals

  !> The elements of the bodies by volumes of their geometries.
  subroutine find_views(self, file, placement, problem, error)
    type(adapted_sizes_t), intent(inout) :: self  !! Gets views, errors of zero, and the places of the elements.
    type(text_t), intent(in) :: file(:)  !! As in `sizes_observe`.
    type(placement_t), intent(in) :: placement(:)  !! As in `sizes_observe`.
    type(contact_problem_t), intent(in) :: problem  !! Bodies.
    type(error_t), allocatable, intent(out) :: error  !! As in `sizes_observe`.
    type(tag_map_t) :: tags
    type(size_view_t) :: new
    type(errors_t) :: none
    real(dp), allocatable :: x(:, :)
    integer, allocatable :: entity(:), corner(:, :), mine(:), place(:)
    integer(int64), allocatable :: tag(:)
    integer :: b, e, k, v, d, twice
    allocate (self%view(0), self%errors(0), self%patch(0), self%of_body(size(problem%body)))
    do b = 1, size(problem%body)
      associate (mesh => problem%body(b)%mesh, at => self%of_body(b))
        d = mesh%dimension
        at%placement = placement(b)
        x = spread(-placement(b)%shift(:d), 2, mesh%n_nodes()) + mesh%x
        x = matmul(transpose(placement(b)%rotation(:d, :d)), x)
        allocate (entity(0), corner(d + 1, 0), tag(0))
        do k = 1, size(mesh%block)
          if (all(mesh%block(k)%kind /= [element_tri3, element_tri6, element_tet4, element_tet10])) then
            call set_error(error, file(b)%s//': body '//quoted(problem%body(b)%name)//' has other elements than '// &
                           'triangles or tetrahedra, whose sizes &accuracy cannot choose: remove Recombine, Layers '// &
                           'or Transfinite from the geometry')
            return
          end if
          entity = [entity, mesh%block(k)%entity]
          tag = [tag, mesh%block(k)%tag]
          corner = reshape([corner, mesh%block(k)%node(:d + 1, :)], [d + 1, size(tag)])
        end do
        self%n_elements = self%n_elements + size(tag)
        allocate (at%view(size(tag)), at%place(size(tag)), source=0)
        do while (any(at%view == 0))
          e = findloc(at%view, 0, 1)
          mine = pack([(k, k=1, size(tag))], entity == entity(e))
          place = 0*mine
          do v = 1, size(self%view)
            if (self%view(v)%file /= file(b)%s .or. self%view(v)%entity /= entity(e)) cycle
            call tags%init(self%view(v)%mesh%block(1)%tag, twice)
            place = [(tags%find(tag(mine(k))), k=1, size(mine))]
            if (all(place > 0)) exit
          end do
          if (v > size(self%view)) then
            call new%init(file(b)%s, entity(e), d, x, corner(:, mine), tag(mine))
            self%view = [self%view, new]
            none = errors_t([(0.0_dp, k=1, size(mine))], [real(dp) ::], [(0, k=1, size(mine))])
            self%errors = [self%errors, none]
            place = [(k, k=1, size(mine))]
          end if
          at%view(mine) = v
          at%place(mine) = place
          self%errors(v)%copies(place) = self%errors(v)%copies(place) + 1
        end do
        deallocate (entity, corner, tag)
      end associate
    end do
  end subroutine find_views

  !> The connected patches of the active rows of a pair.
  subroutine add_patches(self, problem, k, active)
    type(adapted_sizes_t), intent(inout) :: self  !! Gets the patches.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    integer, intent(in) :: k  !! The pair.
    logical, intent(in) :: active(:)  !! Its active rows (n_rows).
    real(dp), allocatable :: x(:, :), weight(:), width(:)
    integer, allocatable :: couple(:, :), parent(:), list(:)
    real(dp) :: centre(3), moment(3, 3), axes(3, 3), values(3), radius
    type(error_t), allocatable :: error
    type(patch_t) :: new
    integer :: i, j, n
    associate (pair => problem%pair(k))
      if (.not. any(active) .or. .not. allocated(pair%row_position)) return
      n = count(active)
      allocate (x(3, n), source=0.0_dp)
      do i = 1, size(pair%row_position, 1)
        x(i, :) = pack(pair%row_position(i, :), active)
      end do
      weight = pack(pair%row_weight, active)
      if (problem%body(pair%body_a)%analysis == analysis_axisymmetric) weight = weight/(2*pi*max(x(1, :), tiny(1.0_dp)))
      width = weight
      if (pair%dimension == 3) width = sqrt(weight)
      call overlapping_boxes(x - spread(connected/2*width, 1, 3), x + spread(connected/2*width, 1, 3), couple)
      parent = [(i, i=1, n)]
      do i = 1, size(couple, 2)
        call join(parent, couple(1, i), couple(2, i))
      end do
      do i = 1, n
        j = root_of(parent, i)
      end do
      do i = 1, n
        if (root_of(parent, i) /= i) cycle
        list = pack([(j, j=1, n)], [(root_of(parent, j) == i, j=1, n)])
        radius = sum(weight(list))/2
        if (pair%dimension == 3) then
          centre = matmul(x(:, list), weight(list))/sum(weight(list))
          moment = matmul((x(:, list) - spread(centre, 2, size(list)))*spread(weight(list), 1, 3), &
                          transpose(x(:, list) - spread(centre, 2, size(list))))/sum(weight(list))
          radius = sqrt(sum(weight(list))/pi)/2
          call symmetric_eigen(moment, values, axes, error)
          ! The least one is across the surface.
          if (.not. allocated(error)) radius = max(radius, 2*sqrt(max(0.0_dp, values(2))))
        end if
        new%body = [pair%body_a, pair%body_b]
        new%size = radius/over_radius
        new%x = x(:, list)
        new%width = width(list)
        self%patch = [self%patch, new]
      end do
    end associate
  end subroutine add_patches

  !> Choose the sizes.
  subroutine sizes_plan(self, aim, most_elements, allowed, factor, first)
    class(adapted_sizes_t), intent(inout) :: self
    real(dp), intent(in) :: aim  !! Relative error in the energy norm that is aimed at [].
    real(dp), intent(in) :: most_elements  !! Elements of the scene at most, unless the contact needs more [].
    real(dp), intent(in) :: allowed  !! The same, whatever the contact needs [].
    real(dp), intent(in) :: factor  !! Elements of the last mesh over those that were expected of it [].
    !> Whether this is the first mesh, whose greatest errors need not be at singular points.
    logical, intent(in) :: first
    real(dp) :: relaxed
    integer :: v
    relaxed = aim
    do
      call choose(self, relaxed, first)
      self%expected = self%expected*factor
      if (self%expected <= min(most_elements, allowed) .or. relaxed >= 1) exit
      relaxed = relax*relaxed
    end do
    if (self%expected <= allowed) return
    do v = 1, size(self%view)
      associate (view => self%view(v))
        view%size = view%size*(self%expected/allowed)**(1.0_dp/view%mesh%dimension)
      end associate
    end do
    self%expected = allowed
  end subroutine sizes_plan

  !> Sizes for an aim, the elements that they make, and the error that is expected of these.
  subroutine choose(self, aim, first)
    type(adapted_sizes_t), intent(inout) :: self  !! As in `sizes_plan`.
    real(dp), intent(in) :: aim  !! As in `sizes_plan`.
    logical, intent(in) :: first  !! As in `sizes_plan`.
    type :: ratios_t
      real(dp), allocatable :: value(:), p(:), least(:), square(:)
    end type ratios_t
    type(ratios_t) :: r(size(self%view))
    real(dp) :: low, high, log_c, total, reached
    integer :: d, i, v
    d = self%view(1)%mesh%dimension
    total = sum([(sum(self%errors(v)%square), v=1, size(r))])
    do v = 1, size(r)
      associate (one => r(v))
        one%square = max(self%errors(v)%square, tiny(total), 1.0e-30_dp*total)
        allocate (one%p(size(one%square)), source=order)
        allocate (one%least(size(one%square)), source=least_ratio)
        if (.not. first) then
          where (one%square > notable*total)
            one%p = singular_order
            one%least = singular_ratio
          end where
        end if
      end associate
    end do
    low = minval([(minval(log(r(v)%square)), v=1, size(r))]) - 60
    high = maxval([(maxval(log(r(v)%square)), v=1, size(r))]) + 60
    do i = 1, n_bisections
      log_c = (low + high)/2
      reached = 0
      do v = 1, size(r)
        associate (one => r(v), copies => self%errors(v)%copies)
          one%value = exp((log_c - log(2*one%p*one%square/(d*copies)))/(2*one%p + d))
          one%value = min(greatest_ratio, max(one%least, one%value))
          reached = reached + sum(one%square*one%value**(2*one%p))
        end associate
      end do
      if (reached > aim**2) then
        high = log_c
      else
        low = log_c
      end if
    end do
    self%predicted = sqrt(reached)
    self%expected = 0
    do v = 1, size(r)
      associate (view => self%view(v))
        associate (extent => maxval(maxval(view%mesh%x, 2) - minval(view%mesh%x, 2)))
          call view%spread_to_nodes(max(floor_of_size*extent, r(v)%value*size_of_measure(view%measures(), d)))
        end associate
        call refine_patches(self, v)
        call view%limit_gradient()
        ! Copies that differ in number, as the halves of a cut body, are of several views.
        self%expected = self%expected + view%expected_elements()*maxval(self%errors(v)%copies)
      end associate
    end do
  end subroutine choose

  !> Enough elements over the radius of each contact patch on a view.
  subroutine refine_patches(self, v)
    type(adapted_sizes_t), intent(inout) :: self  !! As in `choose`.
    integer, intent(in) :: v  !! The view.
    type(size_view_t) :: last
    real(dp), allocatable :: x(:, :), widest(:)
    integer :: b, i, k, p, d
    last = self%view(v)
    call last%spread_to_nodes(size_of_measure(last%measures(), last%mesh%dimension))
    associate (view => self%view(v))
      d = view%mesh%dimension
      do p = 1, size(self%patch)
        associate (patch => self%patch(p))
          do k = 1, 2
            b = patch%body(k)
            if (.not. any(self%of_body(b)%view == v)) cycle
            associate (placement => self%of_body(b)%placement)
              x = matmul(transpose(placement%rotation), patch%x - spread(placement%shift, 2, size(patch%x, 2)))
            end associate
            widest = [(near*maxval(patch%width), i=1, d)]
            do i = 1, view%mesh%n_nodes()
              associate (node => view%mesh%x(:, i))
                if (view%size(i) <= patch%size) cycle
                if (any(node < minval(x(:d, :), 2) - widest .or. node > maxval(x(:d, :), 2) + widest)) cycle
                if (any(norm2(x(:d, :) - spread(node, 2, size(x, 2)), 1) <= near*patch%width)) &
                  view%size(i) = min(view%size(i), max(patch%size, least_ratio*last%size(i)))
              end associate
            end do
          end do
        end associate
      end do
    end associate
  end subroutine refine_patches
end module dotyk_control_adapted_sizes
