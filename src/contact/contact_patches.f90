!> Where the bodies of a pair touch: the connected patches of its active rows with areas, centres and half axes.
!>
!> The area is of second order though rows open and close as wholes. Near its rim the pressure of a smooth contact is
!> the root of the depth d inside, sqrt(g d) (Johnson, Contact Mechanics, 4.2), and rows have means of it with hat
!> functions of the half-width H across the rim: sqrt(g H) m(d/H), where m is the second difference of
!> 4/15 t^(5/2). The ratio of two rows one behind the other gives the depth of the outer one, once the curvature of the
!> square of the pressure is taken off, which the next row tells. Facets at the rim count in part then.
!> Where the pressure does not fall outwards (sharp edges), or the surface ends, active rows count whole. A face that is
!> touched along its edge to a face in contact, as the flank of a chamfer, adds no area.
module dotyk_contact_contact_patches
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_surface, only: surface_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: find_patches

  type, public :: contact_patch_t  !! A connected patch of active rows.
    real(dp) :: area = 0  !! Area [as the weights of the rows].
    real(dp) :: force = 0  !! Integral of the pressure [force].
    real(dp) :: centre(3) = 0  !! Mean of the positions, weighted with the pressure (3) [length].
    !> Half axes of the Hertzian ellipse whose pressure has the same second moments; the half-width and 0 in two
    !> dimensions (2) [length].
    real(dp) :: half_axes(2) = 0
  end type contact_patch_t

  type :: rim_t  !! What the corners of the slave side tell of the rim.
    type(corner_interpolation_t) :: corners  !! Interpolation on the slave side.
    integer, allocatable :: first(:)  !! Points of facet part k are first(k) .. first(k+1)-1 (n_parts+1).
    real(dp), allocatable :: x(:, :)  !! Positions of the points (3, n_points) [length].
    real(dp), allocatable :: weight(:)  !! Weights of the points (n_points) [as the weights of the rows].
    logical, allocatable :: active(:)  !! Whether a row of the corner is active (n).
    real(dp), allocatable :: pressure(:)  !! Means of the pressure with the hat functions (n) [pressure].
    real(dp), allocatable :: total(:)  !! Integrals of the hat functions (n) [as the weights].
    !> Their centres and second moments about these (3, n) [length], (3, 3, n) [length^2].
    real(dp), allocatable :: centre(:, :), second(:, :, :)
    logical, allocatable :: whole(:)  !! Whether a facet at the corner has active corners only (n).
    logical, allocatable :: ends(:)  !! Whether a neighbour is inactive (n).
    logical, allocatable :: has_depth(:)  !! Whether the depth is known (n).
    real(dp), allocatable :: depth(:)  !! Depth of the centre inside of the rim (n) [length].
    real(dp), allocatable :: outwards(:, :)  !! Unit vector out of the contact (3, n) [].
  end type rim_t

  !> Rows deeper than so many of their half-widths do not tell where the rim is; deeper than the second one the mean of
  !> the root is the root [].
  real(dp), parameter :: deep = 2.5_dp, no_mean = 4
  !> The neighbours with more pressure are on one side of a row where the square of the distance to their centre is more
  !> than this fraction of the mean square of those to themselves: a row among them is a minimum [].
  real(dp), parameter :: one_sided = 0.1_dp
  integer, parameter :: n_bisections = 40   !! Bisections of the depth: to rounding of the pressures.
  integer, parameter :: n_curvatures = 2  !! Steps that take the curvature off.

contains

  !> Find the patches of a pair. The sum of their areas is that of the contact.
  subroutine find_patches(pair, surface_a, pressure, active, patch)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface.
    real(dp), intent(in) :: pressure(:)  !! Row pressures (n_rows) [pressure].
    logical, intent(in) :: active(:)  !! Whether the rows are active (n_rows).
    type(contact_patch_t), allocatable, intent(out) :: patch(:)  !! (n_patches)
    type(rim_t) :: rim
    integer, allocatable :: parent(:), of(:)
    real(dp), allocatable :: second(:, :, :)
    real(dp) :: axes(3, 3), values(3), r(3)
    type(error_t), allocatable :: error
    integer :: i, j, k, n
    allocate (patch(0))
    if (any(active(:pair%n_rows - pair%n_point_contacts))) then
      call set_corners(pair, surface_a, pressure, active, rim)
      call find_depths(rim)
      n = rim%corners%n
      parent = [(i, i=1, n)]
      do k = 1, size(rim%first) - 1
        associate (corner => part_corners(rim, k))
          j = maxval(pack(corner, rim%active(corner)))
          do i = 1, size(corner)
            if (rim%active(corner(i))) call join(parent, j, corner(i))
          end do
        end associate
      end do
      allocate (of(n), source=0)
      do i = 1, n
        if (.not. rim%active(i)) cycle
        if (root_of(parent, i) == i) patch = [patch, contact_patch_t()]
        of(i) = merge(size(patch), of(root_of(parent, i)), root_of(parent, i) == i)
        associate (p => patch(of(i)), force => rim%total(i)*rim%pressure(i))
          p%force = p%force + force
          p%centre = p%centre + force*rim%centre(:, i)
        end associate
      end do
      do k = 1, size(rim%first) - 1
        associate (corner => part_corners(rim, k))
          i = maxval(of(corner))
          if (i == 0) cycle
          if (.not. is_beside(rim, corner)) patch(i)%area = patch(i)%area + part_area(rim, k)
        end associate
      end do
      allocate (second(3, 3, size(patch)), source=0.0_dp)
      do i = 1, size(patch)
        if (patch(i)%force > 0) patch(i)%centre = patch(i)%centre/patch(i)%force
      end do
      do i = 1, n
        if (of(i) == 0) cycle
        associate (p => patch(of(i)))
          if (.not. p%force > 0) cycle
          r = rim%centre(:, i) - p%centre
          ! The projection of squares of the position on the hat functions.
          second(:, :, of(i)) = second(:, :, of(i)) + rim%total(i)*rim%pressure(i)/p%force* &
            (spread(r, 2, 3)*spread(r, 1, 3) - rim%second(:, :, i))
        end associate
      end do
      do i = 1, size(patch)
        call symmetric_eigen(second(:, :, i), values, axes, error)
        if (allocated(error)) values = 0
        patch(i)%half_axes = sqrt((pair%dimension + 2)*max(0.0_dp, values([3, 2])))
        if (pair%dimension == 2) patch(i)%half_axes(2) = 0
      end do
    end if
    ! Contacts at points and edges have the area of their rows.
    do i = pair%n_rows - pair%n_point_contacts + 1, pair%n_rows
      if (.not. active(i)) cycle
      r = 0
      r(:pair%dimension) = pair%row_position(:, i)
      patch = [patch, contact_patch_t(pair%row_weight(i), pair%row_weight(i)*pressure(i), r)]
    end do
  end subroutine find_patches

  !> The corners of the slave side with the means of the pressure.
  subroutine set_corners(pair, surface_a, pressure, active, rim)
    type(contact_pair_t), intent(in) :: pair  !! As in `find_patches`.
    type(surface_t), intent(in) :: surface_a  !! As in `find_patches`.
    real(dp), intent(in) :: pressure(:)  !! As in `find_patches`.
    logical, intent(in) :: active(:)  !! As in `find_patches`.
    type(rim_t), intent(out) :: rim  !! Depths are not set.
    real(dp) :: at_points(pair%n_points), r(3)
    integer :: c, j, n, q
    n = pair%n_points - pair%n_point_contacts
    associate (corners => rim%corners)
      call corners%init(surface_a, pair%facet_a(:n), pair%xi_a(:, :n), pair%sheet_b(:n))
      rim%first = [pack([(q, q=1, n)], [.true., pair%facet_a(2:n) /= pair%facet_a(:n - 1) .or. &
                                        corners%corner(1, 2:) /= corners%corner(1, :n - 1)]), n + 1]
      allocate (rim%x(3, n), rim%pressure(corners%n), rim%centre(3, corners%n), rim%second(3, 3, corners%n), &
                rim%total(corners%n), source=0.0_dp)
      rim%weight = pair%weight(:n)
      rim%x(:pair%dimension, :) = pair%position(:, :n)
      call pair%average%multiply_transposed(pair%row_weight*merge(pressure, 0.0_dp, active), at_points)
      call corners%moments(rim%weight, rim%total)
      call corners%moments(at_points(:n), rim%pressure)
      do c = 1, 3
        call corners%moments(rim%weight*rim%x(c, :), rim%centre(c, :))
        rim%centre(c, :) = rim%centre(c, :)/rim%total
      end do
      rim%pressure = max(0.0_dp, rim%pressure/rim%total)
      do q = 1, n
        do j = 1, count(corners%corner(:, q) > 0)
          associate (i => corners%corner(j, q))
            r = rim%x(:, q) - rim%centre(:, i)
            rim%second(:, :, i) = rim%second(:, :, i) + &
              rim%weight(q)*corners%shape(j, q)/rim%total(i)*spread(r, 2, 3)*spread(r, 1, 3)
          end associate
        end do
      end do
      ! Vertices without a row are active as the pressures of their neighbours are on them.
      rim%active = rim%pressure > 0
      if (pair%n_mortar_rows > 0) rim%active(pair%row_corner) = active(:pair%n_mortar_rows)
    end associate
    allocate (rim%whole(rim%corners%n), source=.false.)
    do q = 1, size(rim%first) - 1
      associate (corner => part_corners(rim, q))
        if (all(rim%active(corner))) rim%whole(corner) = .true.
      end associate
    end do
  end subroutine set_corners

  !> Whether a facet part has only corners in contact that another face, in contact there, has, too.
  pure logical function is_beside(rim, corner)
    type(rim_t), intent(in) :: rim  !! The rim.
    integer, intent(in) :: corner(:)  !! Corners of the part.
    integer :: first, last, i
    is_beside = .not. all(rim%active(corner))
    do i = 1, size(corner)
      if (.not. is_beside) return
      if (.not. rim%active(corner(i))) cycle
      ! Corners of one node are successive: one for each face.
      associate (node => rim%corners%corner_node, c => corner(i))
        first = c
        do while (first > 1)
          if (node(first - 1) /= node(c)) exit
          first = first - 1
        end do
        last = c
        do while (last < size(node))
          if (node(last + 1) /= node(c)) exit
          last = last + 1
        end do
        is_beside = any(rim%whole(first:last)) .and. .not. rim%whole(c)
      end associate
    end do
  end function is_beside

  !> Corners of a facet part.
  pure function part_corners(rim, k) result(corner)
    type(rim_t), intent(in) :: rim  !! The rim.
    integer, intent(in) :: k  !! The part.
    integer, allocatable :: corner(:)  !! Their numbers (2 to 4).
    corner = pack(rim%corners%corner(:, rim%first(k)), rim%corners%corner(:, rim%first(k)) > 0)
  end function part_corners

  !> Depths of the active corners next to the rim.
  subroutine find_depths(rim)
    type(rim_t), intent(inout) :: rim  !! Corners in, depths out.
    !> Of the neighbours with more pressure, which are inside: sums of weights; means of the squares of pressures, of
    !> the slopes of these, and of the squares of the distances.
    real(dp), dimension(rim%corners%n) :: share, square, slope_inside, reach
    !> Slopes and curvatures of the squares of the pressures, distances to the neighbours inside, half-widths, and
    !> depths over these.
    real(dp), dimension(rim%corners%n) :: slope, curvature, distance, width, depth
    !> Means of the positions of the neighbours inside, and of the places of their slopes; place of the slope.
    real(dp), dimension(3, rim%corners%n) :: inside, place_inside, place
    real(dp) :: p(rim%corners%n), w, apart
    logical :: falls(rim%corners%n)
    integer, allocatable :: couple(:, :)
    integer :: c, i, j, step
    call find_couples(rim, couple)
    p = rim%pressure/max(maxval(rim%pressure), tiny(p))
    share = 0
    inside = 0
    square = 0
    reach = 0
    allocate (rim%ends(size(p)), source=.false.)
    do c = 1, size(couple, 2)
      i = couple(1, c)
      j = couple(2, c)
      rim%ends(i) = rim%ends(i) .or. .not. rim%active(j)
      w = weight_of(i, j)
      share(i) = share(i) + w
      inside(:, i) = inside(:, i) + w*rim%centre(:, j)
      square(i) = square(i) + w*p(j)**2
      reach(i) = reach(i) + w*sum((rim%centre(:, j) - rim%centre(:, i))**2)
    end do
    falls = .false.
    allocate (rim%outwards(3, size(p)), source=0.0_dp)
    place = rim%centre
    slope = 0
    depth = huge(depth)
    do i = 1, size(p)
      if (.not. share(i) > 0) cycle
      inside(:, i) = inside(:, i)/share(i)
      square(i) = square(i)/share(i)
      distance(i) = norm2(rim%centre(:, i) - inside(:, i))
      falls(i) = distance(i)**2 > one_sided*reach(i)/share(i)
      if (.not. falls(i)) cycle
      rim%outwards(:, i) = (rim%centre(:, i) - inside(:, i))/distance(i)
      ! A hat function of the half-width H has the second moment H^2/6.
      width(i) = sqrt(6*dot_product(rim%outwards(:, i), matmul(rim%second(:, :, i), rim%outwards(:, i))))
      place(:, i) = (rim%centre(:, i) + inside(:, i))/2
      depth(i) = depth_of(p(i)**2/square(i), distance(i)/width(i), rim%ends(i))
      slope(i) = (p(i)/mean_root(depth(i), rim%ends(i)))**2/width(i)
    end do
    slope_inside = 0
    place_inside = 0
    do c = 1, size(couple, 2)
      i = couple(1, c)
      j = couple(2, c)
      w = weight_of(i, j)
      slope_inside(i) = slope_inside(i) + w*slope(j)*dot_product(rim%outwards(:, i), rim%outwards(:, j))
      place_inside(:, i) = place_inside(:, i) + w*place(:, j)
    end do
    do i = 1, size(p)
      if (depth(i) > no_mean) cycle
      apart = dot_product(place(:, i) - place_inside(:, i)/share(i), rim%outwards(:, i))
      curvature(i) = 0
      if (apart > 0) curvature(i) = max(0.0_dp, (slope(i) - slope_inside(i)/share(i))/apart)
      do step = 1, n_curvatures
        associate (d => width(i)*depth(i))
          depth(i) = depth_of((p(i)**2 + min(p(i)**2, curvature(i)/2*max(0.0_dp, d)**2))/ &
                              (square(i) + min(square(i), curvature(i)/2*(d + distance(i))**2)), &
                              distance(i)/width(i), rim%ends(i))
        end associate
      end do
    end do
    call smooth_depths(rim, couple, falls .and. depth < deep, depth, width)

  contains

    !> Weight of a neighbour inside: 0 if it is none.
    real(dp) function weight_of(i, j)
      integer, intent(in) :: i  !! The corner.
      integer, intent(in) :: j  !! Its neighbour.
      weight_of = 0
      if (rim%active(i) .and. rim%active(j)) weight_of = max(0.0_dp, p(j)**2 - p(i)**2)**2
    end function weight_of
  end subroutine find_depths

  !> Mean depths of each active corner and its neighbours, weighted with how much the pressures tell of them.
  subroutine smooth_depths(rim, couple, tells, depth, width)
    type(rim_t), intent(inout) :: rim  !! With the vectors outwards of single corners; gets means and depths.
    integer, intent(in) :: couple(:, :)  !! Couples of neighbours in both orders (2, n_couples).
    logical, intent(in) :: tells(:)  !! Whether the corner has a depth (n).
    real(dp), intent(in) :: depth(:)  !! Depths over half-widths (n) [].
    real(dp), intent(in) :: width(:)  !! Half-widths (n) [length].
    real(dp) :: weight(size(tells)), total(size(tells)), outwards(3, size(tells))
    integer :: c, i
    weight = 0
    do i = 1, size(tells)
      if (tells(i)) weight(i) = mean_root_slope(depth(i))
    end do
    total = weight
    rim%depth = [(merge(weight(i)*width(i)*depth(i), 0.0_dp, tells(i)), i=1, size(tells))]
    outwards = spread(weight, 1, 3)*rim%outwards
    do c = 1, size(couple, 2)
      associate (i => couple(1, c), j => couple(2, c))
        if (.not. (rim%active(i) .and. tells(j))) cycle
        total(i) = total(i) + weight(j)
        outwards(:, i) = outwards(:, i) + weight(j)*rim%outwards(:, j)
        rim%depth(i) = rim%depth(i) + weight(j)* &
          (width(j)*depth(j) + dot_product(rim%outwards(:, j), rim%centre(:, j) - rim%centre(:, i)))
      end associate
    end do
    rim%has_depth = total > 0 .and. norm2(outwards, 1) > 0
    do i = 1, size(tells)
      if (.not. rim%has_depth(i)) cycle
      rim%depth(i) = rim%depth(i)/total(i)
      rim%outwards(:, i) = outwards(:, i)/norm2(outwards(:, i))
    end do
  end subroutine smooth_depths

  !> Area of a facet part inside of the rim.
  real(dp) function part_area(rim, k) result(area)
    type(rim_t), intent(in) :: rim  !! The rim, with depths.
    integer, intent(in) :: k  !! The part, with an active corner.
    real(dp), allocatable :: depth(:), closed(:)
    integer, allocatable :: corner(:)
    logical, allocatable :: known(:)
    real(dp) :: whole, mean, deviation
    integer :: i, j
    corner = part_corners(rim, k)
    known = rim%active(corner) .and. rim%has_depth(corner)
    associate (q => [(i, i=rim%first(k), rim%first(k + 1) - 1)])
      associate (weight => rim%weight(q), x => rim%x(:, q))
        whole = sum(weight)
        closed = matmul(merge(1.0_dp, 0.0_dp, rim%active(corner)), rim%corners%shape(:size(corner), q))
        area = sum(weight*closed)
        if (.not. any(known .and. rim%ends(corner)) .or. all(rim%active(corner)) .and. .not. all(known)) return
        allocate (depth(size(q)), source=0.0_dp)
        do i = 1, size(corner)
          if (.not. known(i)) cycle
          j = corner(i)
          depth = depth + (rim%depth(j) - matmul(rim%outwards(:, j), x - spread(rim%centre(:, j), 2, size(q))))/ &
            count(known)
        end do
        mean = sum(weight*depth)/whole
        deviation = sqrt(sum(weight*(depth - mean)**2)/whole)
        ! The depth must fall to where the rows are inactive.
        if (.not. all(rim%active(corner)) .and. sum(weight*closed*(depth - mean)) <= 0) return
        ! As if the depths were distributed evenly, within sqrt(3) deviations.
        if (deviation > 0) area = whole*min(1.0_dp, max(0.0_dp, 0.5_dp + mean/(sqrt(12.0_dp)*deviation)))
      end associate
    end associate
  end function part_area

  !> Couples of corners that are neighbours on a facet part, in both orders.
  pure subroutine find_couples(rim, couple)
    type(rim_t), intent(in) :: rim  !! The rim.
    integer, allocatable, intent(out) :: couple(:, :)  !! (2, n_couples)
    integer :: i, j, k, n
    allocate (couple(2, 12*(size(rim%first) - 1)))
    n = 0
    do k = 1, size(rim%first) - 1
      associate (corner => part_corners(rim, k))
        if (.not. any(rim%active(corner))) cycle
        do i = 1, size(corner)
          do j = 1, size(corner)
            if (i == j) cycle
            n = n + 1
            couple(:, n) = corner([i, j])
          end do
        end do
      end associate
    end do
    couple = couple(:, :n)
  end subroutine find_couples

  !> Depth of a row over its half-width, from the ratio of the squares of its pressure and that of a row inside.
  pure real(dp) function depth_of(ratio, distance, ends) result(depth)
    real(dp), intent(in) :: ratio  !! The ratio, below 1 [].
    real(dp), intent(in) :: distance  !! Distance between the rows over the half-width [].
    logical, intent(in) :: ends  !! As in `mean_root`.
    real(dp) :: low, high
    integer :: i
    depth = distance*ratio/max(1 - ratio, tiny(ratio))
    if (depth > no_mean) return
    low = -1
    high = no_mean + 1
    do i = 1, n_bisections
      depth = (low + high)/2
      if (mean_root(depth, ends)**2 < ratio*mean_root(depth + distance, .false.)**2) then
        low = depth
      else
        high = depth
      end if
    end do
  end function depth_of

  !> Mean of the root of the depth, 0 outside, with a hat function of the half-width 1.
  pure real(dp) function mean_root(depth, ends) result(mean)
    real(dp), intent(in) :: depth  !! Depth of its centre [].
    !> Whether the row is the last active one, which has the forces of the hat function beyond it, too.
    logical, intent(in) :: ends
    mean = 4/15.0_dp*sum([1, -2, 1]*max(0.0_dp, depth + [1, 0, -1])**2.5_dp)
    if (depth > 2*no_mean) mean = sqrt(depth)
    if (ends) mean = mean + 4/15.0_dp*sum([1, -2, 1]*max(0.0_dp, depth - [0, 1, 2])**2.5_dp)
  end function mean_root

  !> Its derivative.
  pure real(dp) function mean_root_slope(depth) result(slope)
    real(dp), intent(in) :: depth  !! Depth of the centre [].
    slope = 2/3.0_dp*sum([1, -2, 1]*max(0.0_dp, depth + [1, 0, -1])**1.5_dp)
  end function mean_root_slope
end module dotyk_contact_contact_patches
