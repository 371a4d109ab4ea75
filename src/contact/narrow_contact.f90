!> How uncertain the approach of bodies is where their contact spans no facet: the mesh makes it as stiff as a facet,
!> whatever its own width.
!>
!> The curvatures of the gaps around a row with pressure, from a quadratic function fitted to those of its neighbours,
!> and the force tell by Hertz (Johnson, Contact Mechanics, 4.2 and 5.1: half-planes under cylinders, half-spaces under
!> ellipsoids that are nearly round) how far the sides dip between the contact and the neighbours. How far they do on
!> the mesh differs from that by the error of the approach. A contact at the rim of its surface is taken for one at a
!> plane of symmetry: the force is that of the whole.
module dotyk_contact_narrow_contact
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: pi, same_place
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_facet_bending, only: find_contact
  use dotyk_contact_gap_interpolation, only: min_mean_square
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_surface, only: surface_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: find_narrow_contact

  integer, parameter :: n_terms = 5  !! Of a quadratic function of two coordinates that vanishes at a row.
  integer, parameter :: most_neighbours = 12  !! Ordered pairs of corners of a facet.
  !> Weight of slopes against curvatures: neighbours on one side do not tell both, and touching bodies have no slope
  !> where they touch [].
  real(dp), parameter :: slope_weight = 0.03_dp
  !> Rows in planes of symmetry, which have a half or a quarter of the facets around them, tell where the middle of a
  !> patch is: those with less than this multiple of the least part [].
  real(dp), parameter :: rim = 1.5_dp
  !> A row is softer than a contact as wide as a facet by less than this: what seems more is no dip []. Measured: 1.7.
  real(dp), parameter :: softest = 2

  type :: patches_t  !! Connected rows with pressure; those of the whole where planes of symmetry cut them.
    integer, allocatable :: of(:)  !! Patch of each row: its first row (n_mortar_rows).
    integer, allocatable :: n_rows(:)  !! Number of its rows with pressure (n_mortar_rows).
    real(dp), allocatable :: force(:)  !! Its force (n_mortar_rows) [force; in the plane force/length].
    real(dp), allocatable :: centre(:, :)  !! Its middle (dimension, n_mortar_rows) [length].
    logical, allocatable :: is_central(:)  !! Whether a row tells where the middle is (n_mortar_rows).
  contains
    procedure :: init => patches_init
  end type patches_t

contains

  !> Where the contact spans no facet: by how much the gaps of rows with pressure are uncertain, and how great the
  !> pressure is by Hertz.
  subroutine find_narrow_contact(pair, surface_a, axisymmetric, modulus, pressure, gap, moved, uncertainty, peak)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface.
    logical, intent(in) :: axisymmetric  !! Whether a row on the axis is a point, with its neighbours all around.
    real(dp), intent(in) :: modulus  !! 1/((1 - nu_a^2)/E_a + (1 - nu_b^2)/E_b) [pressure].
    real(dp), intent(in) :: pressure(:)  !! Pressures of the rows (n_rows) [pressure].
    real(dp), intent(in) :: gap(:)  !! Their gaps (n_rows) [length].
    !> Normal displacements of their sides towards each other (n_rows) [length].
    real(dp), intent(in) :: moved(:)
    real(dp), intent(out) :: uncertainty(:)  !! Of the gaps (n_rows) [length].
    real(dp), intent(out) :: peak  !! Greatest pressure by Hertz; 0 where no contact is narrow [pressure].
    type(corner_interpolation_t) :: corners
    type(patches_t) :: patches
    logical, allocatable :: is_bent(:), is_narrow(:), is_round(:)
    integer, allocatable :: row(:), from(:), to(:), of(:), n_open(:), n_beside(:)
    real(dp), allocatable :: around(:), distance(:), kappa(:, :), axis(:, :), slope(:, :)
    real(dp), allocatable :: tilt(:, :), total(:), width(:), exact(:), found(:)
    real(dp) :: load
    integer :: d, i, k, n
    uncertainty = 0
    peak = 0
    if (.not. allocated(pair%bend)) return
    call find_contact(pair, surface_a, pressure, is_bent, is_narrow, corners)
    if (.not. any(is_narrow)) return
    d = pair%dimension
    n = pair%n_mortar_rows
    allocate (row(0:corners%n), source=0)
    row(pair%row_corner) = [(i, i=1, n)]
    call find_neighbours(pair, corners, row, is_narrow, pressure, from, to, around)
    call patches%init(pair, pressure, around, from, to)
    call fit(pair, axisymmetric, gap, moved, from, to, distance, kappa, axis, slope)
    ! A round contact is one thing, of a long one each row.
    allocate (tilt(d, n), total(n), width(n), exact(n), found(n), source=0.0_dp)
    allocate (n_open(n), n_beside(n), source=0)
    of = [(i, i=1, n)]
    is_round = [(is_point(patches%force(patches%of(i)), kappa(:, i), modulus, distance(i)), i=1, n)]
    where (is_round) of = patches%of
    do i = 1, n
      if (.not. pressure(i) > 0 .or. is_round(i) .and. .not. patches%is_central(i)) cycle
      total(of(i)) = total(of(i)) + pair%row_weight(i)*pressure(i)
      tilt(:, of(i)) = tilt(:, of(i)) + pair%row_weight(i)*pressure(i)*slope(:, i)
    end do
    do k = 1, size(from)
      if (.not. is_open(k)) cycle
      n_beside(from(k)) = n_beside(from(k)) + 1
      width(from(k)) = width(from(k)) + across(k)
    end do
    do k = 1, size(from)
      if (.not. is_open(k)) cycle
      i = from(k)
      associate (r => of(i))
        if (is_round(i)) then
          exact(r) = exact(r) + dip_of_point(patches%force(r), sqrt(product(kappa(:, i))), modulus, across(k))
          found(r) = found(r) + sum(kappa(:, i))/4*sum((pair%row_position(:, i) - patches%centre(:, r))**2)
        else
          exact(r) = exact(r) + dip_of_line(pressure(i)*width(i)/n_beside(i), kappa(2, i), modulus, across(k))
        end if
        found(r) = found(r) + moved(to(k)) - moved(i) - &
          dot_product(tilt(:, r), pair%row_position(:, to(k)) - pair%row_position(:, i))/max(tiny(1.0_dp), total(r))
        n_open(r) = n_open(r) + 1
      end associate
    end do
    found = max(0.0_dp, min(found, softest*exact))
    do i = 1, n
      if (.not. pressure(i) > 0 .or. n_open(of(i)) == 0) cycle
      associate (r => of(i))
        uncertainty(i) = abs(exact(r) - found(r))/n_open(r)
        ! One row answers in proportion, a round contact with the approach to the power 3/2.
        if (is_round(i) .and. patches%n_rows(r) == 1 .and. exact(r) < found(r)) &
          uncertainty(i) = found(r)/n_open(r)*((found(r)/exact(r))**1.5_dp - 1)
        if (is_round(i)) then
          associate (force => patches%force(r))
            peak = max(peak, 1.5_dp*force/(pi*mean_radius(force, sqrt(product(kappa(:, i))), modulus)**2))
          end associate
        else if (n_beside(i) > 0) then
          load = pressure(i)*width(i)/n_beside(i)
          if (half_width(load, kappa(2, i), modulus) < width(i)/n_beside(i)) &
            peak = max(peak, 2*load/(pi*half_width(load, kappa(2, i), modulus)))
        end if
      end associate
    end do

  contains

    logical function is_open(k)  !! Whether a neighbour tells how far the sides dip.
      integer, intent(in) :: k  !! Its number.
      is_open = .not. pressure(to(k)) > 0 .and. kappa(2, from(k)) > 0
    end function is_open

    real(dp) function across(k)  !! Distance of a neighbour from the middle of a round contact, or across a long one.
      integer, intent(in) :: k  !! Its number.
      if (is_round(from(k))) then
        across = norm2(pair%row_position(:, to(k)) - patches%centre(:, of(from(k))))
      else
        across = abs(dot_product(axis(:, from(k)), pair%row_position(:, to(k)) - pair%row_position(:, from(k))))
      end if
    end function across
  end subroutine find_narrow_contact

  !> Find the patches.
  subroutine patches_init(self, pair, pressure, around, from, to)
    class(patches_t), intent(out) :: self
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    real(dp), intent(in) :: pressure(:)  !! Pressures of the rows (n_rows) [pressure].
    real(dp), intent(in) :: around(:)  !! Part of the angle around each row that its facets fill (n_rows) [].
    integer, intent(in) :: from(:), to(:)  !! Row with pressure, and its neighbour (n).
    integer :: parent(pair%n_rows)
    real(dp) :: part(pair%n_mortar_rows), central(pair%n_mortar_rows)
    integer :: i, k
    associate (n => pair%n_mortar_rows, force => pair%row_weight*pressure)
      parent = [(i, i=1, size(parent))]
      do k = 1, size(from)
        if (pressure(to(k)) > 0) call join(parent, from(k), to(k))
      end do
      self%of = [(root_of(parent, i), i=1, n)]
      allocate (self%n_rows(n), source=0)
      allocate (self%force(n), self%centre(pair%dimension, n), source=0.0_dp)
      part = around(:n)
      do i = 1, n
        if (pressure(i) > 0) part(self%of(i)) = min(part(self%of(i)), around(i))
      end do
      self%is_central = around(:n) < rim*part(self%of)
      central = 0
      do i = 1, n
        if (.not. pressure(i) > 0) cycle
        associate (p => self%of(i))
          self%n_rows(p) = self%n_rows(p) + 1
          self%force(p) = self%force(p) + force(i)
          if (.not. self%is_central(i)) cycle
          central(p) = central(p) + force(i)
          self%centre(:, p) = self%centre(:, p) + force(i)*pair%row_position(:, i)
        end associate
      end do
      do i = 1, n
        if (central(i) > 0) self%centre(:, i) = self%centre(:, i)/central(i)
        if (pair%dimension == 3 .and. part(i) > 0) self%force(i) = self%force(i)/part(i)
      end do
    end associate
  end subroutine patches_init

  !> Rows with pressure and their neighbours with rows, on facets of narrow contact; a neighbour as often as facets have
  !> both.
  subroutine find_neighbours(pair, corners, row, is_narrow, pressure, from, to, around)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(corner_interpolation_t), intent(in) :: corners  !! Corners of the points.
    integer, intent(in) :: row(0:)  !! Row of each corner, or 0 (0:n).
    logical, intent(in) :: is_narrow(:)  !! Points of narrow contact (n_mortar_points).
    real(dp), intent(in) :: pressure(:)  !! Pressures of the rows (n_rows) [pressure].
    integer, allocatable, intent(out) :: from(:), to(:)  !! Row with pressure, and its neighbour (n).
    !> Part of the angle around a row that its facets fill, for those with pressure (n_rows) [].
    real(dp), allocatable, intent(out) :: around(:)
    integer :: i, j, m, n, q
    allocate (around(pair%n_rows), source=0.0_dp)
    allocate (from(most_neighbours*count(is_narrow)), to(most_neighbours*count(is_narrow)))
    n = 0
    do q = 1, size(is_narrow)
      if (.not. is_narrow(q)) cycle
      if (q > 1) then
        if (pair%facet_a(q) == pair%facet_a(q - 1) .and. pair%sheet_b(q) == pair%sheet_b(q - 1)) cycle
      end if
      associate (of => row(corners%corner(:, q)))
        m = count(corners%corner(:, q) > 0)
        do i = 1, m
          if (of(i) == 0) cycle
          if (.not. pressure(of(i)) > 0) cycle
          around(of(i)) = around(of(i)) + part_of_angle(of(i), of(modulo(i, m) + 1), of(modulo(i - 2, m) + 1))
          do j = 1, m
            if (j == i .or. of(j) == 0) cycle
            n = n + 1
            from(n) = of(i)
            to(n) = of(j)
          end do
        end do
      end associate
    end do
    from = from(:n)
    to = to(:n)

  contains

    !> Part of the full angle between two neighbours, half of it in the plane; 0 where one has no row.
    pure real(dp) function part_of_angle(i, next, last) result(part)
      integer, intent(in) :: i, next, last  !! Rows.
      real(dp) :: a(pair%dimension), b(pair%dimension)
      part = merge(0.5_dp, 0.0_dp, pair%dimension == 2)
      if (next == last .or. next == 0 .or. last == 0) return
      a = pair%row_position(:, next) - pair%row_position(:, i)
      b = pair%row_position(:, last) - pair%row_position(:, i)
      part = acos(max(-1.0_dp, min(1.0_dp, dot_product(a, b)/max(tiny(part), norm2(a)*norm2(b)))))/(2*pi)
    end function part_of_angle
  end subroutine find_neighbours

  !> Curvatures of the gaps at rows with pressure, and the slopes of the displacements.
  subroutine fit(pair, axisymmetric, gap, moved, from, to, distance, kappa, axis, slope)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    logical, intent(in) :: axisymmetric  !! As in `find_narrow_contact`.
    real(dp), intent(in) :: gap(:), moved(:)  !! As in `find_narrow_contact` (n_rows) [length].
    integer, intent(in) :: from(:), to(:)  !! Row with pressure, and its neighbour (n).
    real(dp), allocatable, intent(out) :: distance(:)  !! Mean distance of the neighbours (n_rows) [length].
    !> Principal curvatures, ascending, none negative; the first is 0 in the plane (2, n_rows) [1/length].
    real(dp), allocatable, intent(out) :: kappa(:, :)
    real(dp), allocatable, intent(out) :: axis(:, :)  !! Direction of the second one (dimension, n_rows) [].
    real(dp), allocatable, intent(out) :: slope(:, :)  !! Of the displacements (dimension, n_rows) [].
    real(dp) :: matrix(n_terms, n_terms, pair%n_rows), right(n_terms, 2, pair%n_rows)
    real(dp) :: plane(pair%dimension, 2), values(n_terms), vectors(n_terms, n_terms), of(n_terms, 2), term(n_terms)
    real(dp) :: axes(2, 2), d(2)
    integer :: n(pair%n_rows), i, k
    type(error_t), allocatable :: failed
    allocate (distance(pair%n_rows), kappa(2, pair%n_rows), source=0.0_dp)
    allocate (axis(pair%dimension, pair%n_rows), slope(pair%dimension, pair%n_rows), source=0.0_dp)
    n = 0
    do k = 1, size(from)
      n(from(k)) = n(from(k)) + 1
      distance(from(k)) = distance(from(k)) + norm2(pair%row_position(:, to(k)) - pair%row_position(:, from(k)))
    end do
    distance = distance/max(1, n)
    matrix = 0
    right = 0
    do k = 1, size(from)
      i = from(k)
      plane = tangents(pair%row_normal(:, i))
      d = matmul(pair%row_position(:, to(k)) - pair%row_position(:, i), plane)/distance(i)
      term = [slope_weight*d, d(1)**2/2, d(2)**2/2, d(1)*d(2)]
      matrix(:, :, i) = matrix(:, :, i) + spread(term, 1, n_terms)*spread(term, 2, n_terms)
      right(:, 1, i) = right(:, 1, i) + term*(gap(to(k)) - gap(i))
      right(:, 2, i) = right(:, 2, i) + term*(moved(to(k)) - moved(i))
    end do
    do i = 1, pair%n_rows
      if (n(i) == 0) cycle
      call symmetric_eigen(matrix(:, :, i), values, vectors, failed)
      if (allocated(failed)) cycle
      of = matmul(transpose(vectors), right(:, :, i))
      do k = 1, n_terms
        of(k, :) = merge(of(k, :)/max(tiny(of), values(k)), 0.0_dp, values(k) > min_mean_square*values(n_terms))
      end do
      of = matmul(vectors, of)
      plane = tangents(pair%row_normal(:, i))
      slope(:, i) = matmul(plane, of(:2, 2))*slope_weight/distance(i)
      call symmetric_eigen(reshape(of([3, 5, 5, 4], 1), [2, 2]), kappa(:, i), axes, failed)
      if (allocated(failed)) cycle
      kappa(:, i) = max(0.0_dp, kappa(:, i))/distance(i)**2
      axis(:, i) = matmul(plane, axes(:, 2))
      if (is_on_axis(i)) kappa(1, i) = kappa(2, i)
    end do

  contains

    logical function is_on_axis(i)  !! Whether a row is on the axis of an axisymmetric analysis.
      integer, intent(in) :: i  !! The row.
      is_on_axis = axisymmetric
      if (is_on_axis) is_on_axis = pair%row_position(1, i) < same_place*distance(i)
    end function is_on_axis
  end subroutine fit

  !> Tangents of a surface; the second is 0 in the plane (dimension, 2) [].
  pure function tangents(normal)
    real(dp), intent(in) :: normal(:)  !! Unit normal (dimension) [].
    real(dp) :: tangents(size(normal), 2)
    tangents = 0
    if (size(normal) == 2) then
      tangents(:, 1) = [-normal(2), normal(1)]
      return
    end if
    tangents(minloc(abs(normal), 1), 1) = 1
    tangents(:, 1) = tangents(:, 1) - dot_product(tangents(:, 1), normal)*normal
    tangents(:, 1) = tangents(:, 1)/norm2(tangents(:, 1))
    associate (t => tangents(:, 1))
      tangents(:, 2) = [normal(2)*t(3) - normal(3)*t(2), normal(3)*t(1) - normal(1)*t(3), &
                        normal(1)*t(2) - normal(2)*t(1)]
    end associate
  end function tangents

  !> Radius of a round contact, or geometric mean of the half axes of an elliptic one [length].
  pure real(dp) function mean_radius(force, kappa, modulus) result(c)
    real(dp), intent(in) :: force  !! [force].
    real(dp), intent(in) :: kappa  !! Geometric mean of the principal relative curvatures [1/length].
    real(dp), intent(in) :: modulus  !! As in `find_narrow_contact` [pressure].
    c = (3*force/(4*modulus*kappa))**(1.0_dp/3)
  end function mean_radius

  !> Whether a force makes a contact that is shorter than a facet, too: half axes are as curvatures to the power 2/3.
  pure logical function is_point(force, kappa, modulus, h)
    real(dp), intent(in) :: force  !! [force].
    real(dp), intent(in) :: kappa(2)  !! Principal relative curvatures, ascending (2) [1/length].
    real(dp), intent(in) :: modulus  !! As in `find_narrow_contact` [pressure].
    real(dp), intent(in) :: h  !! Distance to the neighbours [length].
    is_point = kappa(1) > min_mean_square*kappa(2)
    if (is_point) is_point = mean_radius(force, sqrt(product(kappa)), modulus)*(kappa(2)/kappa(1))**(1.0_dp/3) < h
  end function is_point

  !> Displacement of the middle of a round contact relative to that in a distance [length].
  pure real(dp) function dip_of_point(force, kappa, modulus, h) result(dip)
    real(dp), intent(in) :: force  !! [force].
    real(dp), intent(in) :: kappa  !! Relative curvature [1/length].
    real(dp), intent(in) :: modulus  !! As in `find_narrow_contact` [pressure].
    real(dp), intent(in) :: h  !! The distance [length].
    real(dp) :: s, a
    a = mean_radius(force, kappa, modulus)
    if (a >= h) then
      dip = kappa*h**2/2
    else
      s = h/a
      dip = kappa*a**2*(1 - ((2 - s**2)*asin(1/s) + sqrt(s**2 - 1))/pi)
    end if
  end function dip_of_point

  !> Half-width of a long contact [length].
  pure real(dp) function half_width(force, kappa, modulus)
    real(dp), intent(in) :: force  !! Force per length [force/length].
    real(dp), intent(in) :: kappa  !! Relative curvature across [1/length].
    real(dp), intent(in) :: modulus  !! As in `find_narrow_contact` [pressure].
    half_width = sqrt(4*force/(pi*modulus*kappa))
  end function half_width

  !> Displacement of the middle of a long contact relative to that in a distance [length].
  pure real(dp) function dip_of_line(force, kappa, modulus, h) result(dip)
    real(dp), intent(in) :: force  !! Force per length [force/length].
    real(dp), intent(in) :: kappa  !! Relative curvature across [1/length].
    real(dp), intent(in) :: modulus  !! As in `find_narrow_contact` [pressure].
    real(dp), intent(in) :: h  !! The distance [length].
    real(dp) :: a, root
    a = half_width(force, kappa, modulus)
    if (a >= h) then
      dip = kappa*h**2/2
    else
      root = sqrt(h**2 - a**2)
      dip = kappa/2*(h**2 - h*root + a**2*log((h + root)/a))
    end if
  end function dip_of_line
end module dotyk_contact_narrow_contact
