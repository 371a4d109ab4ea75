!> Divides a body in two along faces of its elements: those that a plane separates best, or those of a
!> surface inside it.
module dotyk_mesh_body_cut
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_base_thresholds, only: of_mesh, same_number
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, max_element_nodes
  use dotyk_mesh_facet, only: area_vector
  use dotyk_mesh_mesh, only: groups_like, mesh_t, unknown_group
  use dotyk_mesh_surface, only: gather_facets, node_numbers, surface_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: cut_along_plane, cut_along_surface, extract_cut, take_half

  !> Area of a cut, seen along the normal, as a fraction of the section of the body by the plane, at least: a cut
  !> through a prism has all of it, one across the edge between two faces less [].
  real(dp), parameter :: least_fraction = 0.7_dp
  integer, parameter :: max_corners = 4  !! Greatest number of corners of a face.

contains

  !> The elements ahead of a plane. Single elements beside it that no face joins to the others of their half belong to
  !> the other one.
  subroutine cut_along_plane(whole, point, normal, is_ahead, error)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the body.
    real(dp), intent(in) :: point(:)  !! A point of the plane (dimension) [length].
    real(dp), intent(in) :: normal(:)  !! Its normal (dimension) [].
    !> Whether each element is in the second half, counted through all blocks (n_elements).
    logical, allocatable, intent(out) :: is_ahead(:)
    type(error_t), allocatable, intent(out) :: error  !! Where all elements lie on one side, or a side is in pieces.
    type(corner_table_t) :: none
    integer, allocatable :: parent(:), n_of(:), beside(:, :)
    logical, allocatable :: is_crossed(:), moves(:)
    real(dp) :: distance(max_element_nodes), fraction, extent
    integer :: b, e, i, n, round
    n = whole%n_elements()
    allocate (is_ahead(n), is_crossed(n), moves(n))
    extent = 0
    i = 0
    do b = 1, size(whole%block)
      associate (node => whole%block(b)%node)
        do e = 1, size(node, 2)
          i = i + 1
          associate (m => size(node, 1))
            distance(:m) = matmul(normal, whole%x(:, node(:, e)) - spread(point, 2, m))
            is_ahead(i) = sum(distance(:m)) > same_number*sum(abs(distance(:m)))
            is_crossed(i) = minval(distance(:m)) <= 0 .and. maxval(distance(:m)) >= 0
            if (is_crossed(i)) extent = extent + maxval(distance(:m)) - minval(distance(:m))
          end associate
        end do
      end associate
    end do
    call none%init(max_corners, 0)
    call find_neighbours(whole, none, beside)
    do round = 1, 2
      if (all(is_ahead) .or. .not. any(is_ahead)) then
        call set_error(error, 'the plane leaves all elements on one side of it: name a point inside the body', &
                       exit_bad_input)
        return
      end if
      call find_pieces(beside, is_ahead, parent, n_of)
      ! Small pieces all of whose elements the plane crosses hang on by edges.
      moves = .true.
      do i = 1, n
        if (.not. is_crossed(i)) moves(parent(i)) = .false.
      end do
      moves(maxloc(merge(n_of, 0, is_ahead), dim=1)) = .false.
      moves(maxloc(merge(n_of, 0, .not. is_ahead), dim=1)) = .false.
      moves = moves(parent)
      is_ahead = is_ahead .neqv. moves
      if (.not. any(moves)) exit
    end do
    call find_pieces(beside, is_ahead, parent, n_of)
    do b = 1, 2
      n = count(n_of > 0 .and. (is_ahead .eqv. b == 2))
      if (n > 1) then
        call set_error(error, 'the plane leaves '//to_text(n)//' pieces on the side '// &
                       trim(merge('of its normal     ', 'against its normal', b == 2))// &
                       ': a bolt is cut once, across its shank; give the body by a volume of its own, or another '// &
                       'point or normal', exit_bad_input)
        return
      end if
    end do
    fraction = fraction_of_section(whole, is_ahead, point, normal, extent/max(1, count(is_crossed)))
    if (fraction < least_fraction) &
      call set_error(error, 'along faces of elements the plane takes '//to_text(100*max(0.0_dp, fraction), 2)//' % '// &
                     'of its section with it: elements there are too large for a cut so near an end or a shoulder; '// &
                     'name a point farther inside the shank, or make a finer mesh', exit_bad_input)
  end subroutine cut_along_plane

  !> Area of a cut along faces of elements, seen along the normal of the plane, as a fraction of the section of the body
  !> by the plane, or by one half an element beside it where that is smaller: at a shoulder the cut is that of the
  !> shank [].
  !>
  !> What closes a part of the boundary has its area vector with the other sign: the boundary of the elements behind
  !> the cut, and the boundary behind the plane, facets clipped.
  real(dp) function fraction_of_section(whole, is_ahead, point, normal, extent) result(fraction)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the body.
    logical, intent(in) :: is_ahead(:)  !! Whether each element is in the second half (n_elements).
    real(dp), intent(in) :: point(:)  !! A point of the plane (dimension) [length].
    real(dp), intent(in) :: normal(:)  !! Its normal (dimension) [].
    real(dp), intent(in) :: extent  !! Mean extent along the normal of the elements that the plane crosses [length].
    type(surface_t) :: boundary
    type(element_kind_t) :: kind
    real(dp) :: x(size(point), max_corners), behind(size(point), 2*max_corners), cut, section(-1:1)
    integer :: before(size(whole%block)), f, i, k, side
    i = 0
    do k = 1, size(whole%block)
      before(k) = i
      i = i + size(whole%block(k)%tag)
    end do
    call extract_boundary(whole, boundary)
    cut = 0
    section = 0
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      associate (m => kind%n_corners)
        x(:, :m) = whole%x(:, boundary%node(:m, f))
        if (.not. is_ahead(before(boundary%block(f)) + boundary%element(f))) &
          cut = cut - dot_product(area_vector(x(:, :m)), normal)
        do side = -1, 1
          call clip(x(:, :m), point + side*extent/2*normal, behind, k)
          section(side) = section(side) - dot_product(area_vector(behind(:, :k)), normal)
        end do
      end associate
    end do
    ! Beyond an end there is none.
    fraction = cut/minval(section, mask=section > of_mesh*section(0))

  contains

    !> The part of a facet behind a plane with the normal.
    subroutine clip(corner, through, part, n)
      real(dp), intent(in) :: corner(:, :)  !! Corners (dimension, 2 to 4) [length].
      real(dp), intent(in) :: through(:)  !! A point of the plane (dimension) [length].
      real(dp), intent(out) :: part(:, :)  !! Corners of the part (dimension, >= n) [length].
      integer, intent(out) :: n  !! Number of these.
      real(dp) :: ahead(size(corner, 2))
      integer :: c, next
      do c = 1, size(ahead)
        ahead(c) = dot_product(normal, corner(:, c) - through)
      end do
      n = 0
      do c = 1, size(ahead)
        if (ahead(c) <= 0) then
          n = n + 1
          part(:, n) = corner(:, c)
        end if
        next = modulo(c, size(ahead)) + 1
        ! A facet of two corners has one edge.
        if (size(ahead) == 2 .and. c == 2) exit
        if (.not. ahead(c)*ahead(next) < 0) cycle
        n = n + 1
        part(:, n) = corner(:, c) + ahead(c)/(ahead(c) - ahead(next))*(corner(:, next) - corner(:, c))
      end do
    end subroutine clip
  end function fraction_of_section

  !> The elements on one side of a surface inside a body: those that are not on the side of its first element.
  subroutine cut_along_surface(mesh, whole, name, is_ahead, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh from which the body was extracted.
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the body.
    character(*), intent(in) :: name  !! Physical groups of the surface.
    logical, allocatable, intent(out) :: is_ahead(:)  !! Whether each element is in the second half (n_elements).
    !> Set for an unknown name, and where the surface does not divide the body in two.
    type(error_t), allocatable, intent(out) :: error
    type(corner_table_t) :: facets
    integer(int64), allocatable :: tag(:)
    integer, allocatable :: number(:), entity(:), beside(:, :), parent(:), n_of(:)
    logical :: wanted(size(mesh%group))
    wanted = groups_like(mesh, name, whole%dimension - 1)
    if (.not. any(wanted)) then
      call set_error(error, unknown_group(mesh, name, whole%dimension - 1), exit_bad_input)
      return
    end if
    call node_numbers(mesh, whole, number)
    call gather_facets(mesh, whole%dimension, number, wanted, facets, tag, entity)
    call find_neighbours(whole, facets, beside)
    allocate (is_ahead(whole%n_elements()), source=.false.)
    call find_pieces(beside, is_ahead, parent, n_of)
    if (count(n_of > 0) /= 2) then
      call set_error(error, 'the surface '//quoted(name)//' leaves '//to_text(count(n_of > 0))//' of the body, not '// &
                     'two halves: it has to reach through the shank'//merge(', and there once', '                ', &
                     count(n_of > 0) > 2), exit_bad_input)
      return
    end if
    is_ahead = parent /= parent(1)
  end subroutine cut_along_surface

  !> Pairs of elements that have a face in common.
  subroutine find_neighbours(whole, facets, beside)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the body.
    type(corner_table_t), intent(in) :: facets  !! Faces that divide elements, by their corners.
    integer, allocatable, intent(out) :: beside(:, :)  !! The pairs (2, n).
    type(corner_table_t) :: faces
    type(element_kind_t) :: kind, face
    integer, allocatable :: pairs(:, :)
    integer :: b, e, f, i, n, entry
    n = 0
    do b = 1, size(whole%block)
      kind = element_kind(whole%block(b)%kind)
      n = n + kind%n_faces*size(whole%block(b)%tag)
    end do
    call faces%init(max_corners, n)
    allocate (pairs(2, n), source=0)
    i = 0
    do b = 1, size(whole%block)
      kind = element_kind(whole%block(b)%kind)
      do e = 1, size(whole%block(b)%tag)
        i = i + 1
        do f = 1, kind%n_faces
          face = element_kind(kind%face_kind(f))
          associate (corner => whole%block(b)%node(kind%face_node(:face%n_corners, f), e))
            if (facets%n > 0) then
              if (facets%find(corner) > 0) cycle
            end if
            call faces%add(corner, entry)
          end associate
          pairs(merge(1, 2, pairs(1, entry) == 0), entry) = i
        end do
      end do
    end do
    beside = pairs(:, pack([(i, i=1, faces%n)], pairs(2, :faces%n) > 0))
  end subroutine find_neighbours

  !> Pieces of elements of one half that faces join.
  subroutine find_pieces(beside, is_ahead, parent, n_of)
    integer, intent(in) :: beside(:, :)  !! Pairs of elements with a common face (2, n).
    logical, intent(in) :: is_ahead(:)  !! Half of each element (n_elements).
    integer, allocatable, intent(out) :: parent(:)  !! Lowest element of the piece of each element (n_elements).
    !> Number of elements of the piece of which each element is the lowest, 0 where it is not (n_elements).
    integer, allocatable, intent(out) :: n_of(:)
    integer :: i
    parent = [(i, i=1, size(is_ahead))]
    do i = 1, size(beside, 2)
      if (is_ahead(beside(1, i)) .eqv. is_ahead(beside(2, i))) call join(parent, beside(1, i), beside(2, i))
    end do
    allocate (n_of(size(parent)), source=0)
    do i = 1, size(parent)
      parent(i) = root_of(parent, i)
      n_of(parent(i)) = n_of(parent(i)) + 1
    end do
  end subroutine find_pieces

  !> The mesh of one half.
  subroutine take_half(whole, chosen, half)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the body.
    logical, intent(in) :: chosen(:)  !! Elements of the half (n_elements).
    type(body_mesh_t), intent(out) :: half  !! Mesh of the half.
    integer, allocatable :: number(:), kept(:)
    integer :: b, e, i, n
    half%file = whole%file
    half%dimension = whole%dimension
    allocate (number(whole%n_nodes()), source=0)
    i = 0
    n = 0
    do b = 1, size(whole%block)
      associate (m => size(whole%block(b)%tag))
        if (any(chosen(i + 1:i + m))) n = n + 1
        do e = 1, m
          if (chosen(i + e)) number(whole%block(b)%node(:, e)) = 1
        end do
        i = i + m
      end associate
    end do
    kept = pack([(i, i=1, size(number))], number > 0)
    number(kept) = [(i, i=1, size(kept))]
    half%x = whole%x(:, kept)
    half%node_tag = whole%node_tag(kept)
    half%mesh_node = whole%mesh_node(kept)
    allocate (half%block(n))
    i = 0
    n = 0
    do b = 1, size(whole%block)
      associate (given => whole%block(b), m => size(whole%block(b)%tag))
        kept = pack([(e, e=1, m)], chosen(i + 1:i + m))
        i = i + m
        if (size(kept) == 0) cycle
        n = n + 1
        half%block(n)%kind = given%kind
        half%block(n)%material = given%material
        half%block(n)%tag = given%tag(kept)
        if (allocated(given%entity)) half%block(n)%entity = given%entity(kept)
        half%block(n)%node = reshape(number(reshape(given%node(:, kept), [size(given%node, 1)*size(kept)])), &
                                     [size(given%node, 1), size(kept)])
      end associate
    end do
  end subroutine take_half

  !> The faces of a half that are inside the whole body.
  subroutine extract_cut(whole, half, name, surface)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the body.
    type(body_mesh_t), intent(in) :: half  !! Mesh of the half; it may have further nodes of order elevation.
    character(*), intent(in) :: name  !! Name of the surface.
    type(surface_t), intent(out) :: surface  !! The surface.
    type(corner_table_t) :: outside
    type(surface_t) :: boundary
    type(element_kind_t) :: kind
    integer, allocatable :: chosen(:)
    logical, allocatable :: inner(:)
    integer :: f, entry
    call extract_boundary(whole, boundary)
    call outside%init(max_corners, boundary%n_facets)
    do f = 1, boundary%n_facets
      kind = element_kind(boundary%kind(f))
      call outside%add(whole%mesh_node(boundary%node(:kind%n_corners, f)), entry)
    end do
    call extract_boundary(half, surface)
    allocate (inner(surface%n_facets))
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      inner(f) = outside%find(half%mesh_node(surface%node(:kind%n_corners, f))) == 0
    end do
    chosen = pack([(f, f=1, size(inner))], inner)
    surface%name = name
    surface%n_facets = size(chosen)
    surface%kind = surface%kind(chosen)
    surface%node = surface%node(:, chosen)
    surface%block = surface%block(chosen)
    surface%element = surface%element(chosen)
    allocate (surface%tag(size(chosen)), surface%entity(size(chosen)))
    surface%tag = 0
    surface%entity = 0
  end subroutine extract_cut
end module dotyk_mesh_body_cut
