!> Surfaces that are bodies of their own, without volume: rigid ones.
!>
!> Whatever their orientation in the file, the normals of all facets point to one side, that of contact: the outside of
!> a closed surface, or the side that a given point sees. Which one that is, the solid angle tells under which the
!> surface is seen from the point, positive where normals point away from it: A. Van Oosterom, J. Strackee, The solid
!> angle of a plane triangle, IEEE Trans. Biomed. Eng. 30 (1983). In two dimensions surfaces are curves.
module dotyk_mesh_rigid_surface
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_base_thresholds, only: pi
  use dotyk_mesh_body_mesh, only: body_mesh_t, gather_elements, number_nodes
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_mesh, only: groups_named, mesh_t, unknown_group
  use dotyk_mesh_mesh_check, only: check_plane, check_repeated_elements, check_size, mirror_order
  implicit none
  private

  type, public :: facing_t  !! The side of a surface that is to touch others.
    logical :: is_given = .false.  !! Whether a point is given.
    real(dp) :: point(3) = 0  !! A point that sees this side, in coordinates of the mesh (3) [length].
  end type facing_t

  type :: facet_t  !! A facet by its corners.
    integer :: block = 0, element = 0  !! Block, and element in it.
    integer, allocatable :: corner(:)  !! Corners, in the order of the file (n_corners).
    logical :: is_reversed = .false., is_reached = .false.  !! Whether its normal is reversed, once it is reached.
  end type facet_t

  type :: edge_t  !! Facets on both sides of an edge, of a node in two dimensions; 0 where there is none.
    integer :: facet(2) = 0
  end type edge_t

  public :: extract_rigid_surface

  !> A point sees no side where the angle of what it sees is smaller than this fraction of the full one.
  real(dp), parameter :: least_view = 1.0e-4_dp

contains

  !> Extract a physical group of facets as a body without elements, with normals to the side of contact.
  subroutine extract_rigid_surface(mesh, name, dimension, is_axisymmetric, facing, body_mesh, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    character(*), intent(in) :: name  !! Name of the physical groups.
    integer, intent(in) :: dimension  !! Dimension of space.
    logical, intent(in) :: is_axisymmetric  !! Whether a curve that ends on the axis x = 0 is closed.
    type(facing_t), intent(in) :: facing  !! The side of contact; that outside of closed surfaces if it is not given.
    type(body_mesh_t), intent(out) :: body_mesh  !! Mesh of the body: nodes and faces.
    !> Allocated for an unknown name, and for surfaces without two sides, or of which nothing tells the side of contact.
    type(error_t), allocatable, intent(out) :: error
    logical :: wanted(size(mesh%group))
    wanted = groups_named(mesh, trim(name), dimension - 1)
    if (.not. any(wanted)) then
      call set_error(error, unknown_group(mesh, trim(name), dimension - 1))
      return
    end if
    body_mesh%file = mesh%file
    body_mesh%dimension = dimension
    call gather_elements(mesh, wanted, dimension - 1, body_mesh%block)
    if (size(body_mesh%block) == 0) then
      call set_error(error, 'mesh '//quoted(mesh%file)//': physical group '//quoted(trim(name))//' has no elements')
      return
    end if
    call number_nodes(mesh, body_mesh)
    call check_size(body_mesh%x, body_mesh%node_tag, error)
    if (dimension == 2 .and. .not. allocated(error)) &
      call check_plane(mesh%x(:, body_mesh%mesh_node), body_mesh%node_tag, error)
    if (.not. allocated(error)) call check_repeated_elements(body_mesh%block, error)
    if (.not. allocated(error)) call orient_facets(body_mesh, is_axisymmetric, facing, error)
    if (allocated(error)) then
      error%message = 'mesh '//quoted(mesh%file)//', surface '//quoted(trim(name))//': '//error%message
      return
    end if
    call move_alloc(body_mesh%block, body_mesh%face)
    allocate (body_mesh%block(0))
  end subroutine extract_rigid_surface

  !> Let all normals point to the side of contact.
  subroutine orient_facets(mesh, is_axisymmetric, facing, error)
    type(body_mesh_t), intent(inout) :: mesh  !! Mesh of the body, with the facets as its elements.
    logical, intent(in) :: is_axisymmetric  !! Whether a curve that ends on the axis is closed.
    type(facing_t), intent(in) :: facing  !! The side of contact.
    type(error_t), allocatable, intent(out) :: error  !! Where the surface has no two sides, or none of contact.
    type(facet_t), allocatable :: facet(:)
    type(corner_table_t) :: table
    type(edge_t), allocatable :: edge(:)
    character(:), allocatable :: unit
    real(dp) :: view, full, area
    logical :: is_closed
    integer :: f, i, n
    call list_facets(mesh, facet)
    call find_edges(mesh, facet, table, edge, error)
    if (allocated(error)) return
    call compare_neighbours(mesh, facet, table, edge, error)
    if (allocated(error)) return
    is_closed = .true.
    do i = 1, table%n
      if (edge(i)%facet(2) > 0) cycle
      if (is_axisymmetric) then
        if (.not. abs(mesh%x(1, table%key(size(table%key, 1), i))) > 0) cycle
      end if
      is_closed = .false.
    end do
    mesh%is_open = .not. is_closed
    full = merge(4*pi, 2*pi, mesh%dimension == 3)
    if (facing%is_given) then
      view = 0
      do f = 1, size(facet)
        view = view + sign_of(facet(f))*angle_of(mesh%x(:, facet(f)%corner), facing%point(:mesh%dimension))
        ! The other half of the section through the axis.
        if (is_axisymmetric) view = view - sign_of(facet(f))* &
          angle_of(spread([-1.0_dp, 1.0_dp], 2, 2)*mesh%x(:, facet(f)%corner), facing%point(:2))
      end do
      if (is_closed) then
        ! From inside the full angle, from outside none; the area tells which normals point outward.
        view = merge(view, -volume_of(mesh, facet), abs(view) > full/2)
      else if (abs(view) < least_view*full) then
        call set_error(error, 'facing does not tell the side of contact: from there the surface is seen edge-on; '// &
                       'choose a point in front of this side', exit_bad_input)
        return
      end if
      ! Normals point towards the point: the angle is negative.
      if (view > 0) facet%is_reversed = .not. facet%is_reversed
    else if (is_closed) then
      area = volume_of(mesh, facet)
      if (area < 0) facet%is_reversed = .not. facet%is_reversed
    else
      unit = trim(merge('edge', 'end ', mesh%dimension == 3))
      do i = 1, table%n
        if (edge(i)%facet(2) == 0) exit
      end do
      n = edge(i)%facet(1)
      call set_error(error, 'it is open ('//facet_text(mesh, facet(n))//' has a free '//unit//'), and nothing '// &
                     'tells which of its sides touches others: give facing of &body, a point in front of this '// &
                     'side, in coordinates of the mesh', exit_bad_input)
      return
    end if
    do f = 1, size(facet)
      if (.not. facet(f)%is_reversed) cycle
      associate (own => mesh%block(facet(f)%block))
        own%node(:, facet(f)%element) = own%node(reversed_order(own%kind), facet(f)%element)
      end associate
    end do
  end subroutine orient_facets

  !> Sign of the normal of a facet.
  pure real(dp) function sign_of(facet)
    type(facet_t), intent(in) :: facet  !! The facet.
    sign_of = merge(-1.0_dp, 1.0_dp, facet%is_reversed)
  end function sign_of

  !> List the facets.
  pure subroutine list_facets(mesh, facet)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body, with the facets as its elements.
    type(facet_t), allocatable, intent(out) :: facet(:)  !! The facets (n).
    type(element_kind_t) :: kind
    integer :: b, e, n
    allocate (facet(mesh%n_elements()))
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      do e = 1, size(mesh%block(b)%tag)
        n = n + 1
        facet(n)%block = b
        facet(n)%element = e
        facet(n)%corner = mesh%block(b)%node(:kind%n_corners, e)
      end do
    end do
  end subroutine list_facets

  !> Find the facets on both sides of all edges.
  subroutine find_edges(mesh, facet, table, edge, error)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body, with the facets as its elements.
    type(facet_t), intent(in) :: facet(:)  !! The facets (n).
    type(corner_table_t), intent(out) :: table  !! Edges by their nodes.
    type(edge_t), allocatable, intent(out) :: edge(:)  !! Their facets (table%n and more).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where three facets share an edge.
    integer :: f, i, k, m
    m = mesh%dimension - 1
    call table%init(m, sum([(size(facet(f)%corner), f=1, size(facet))]))
    allocate (edge(sum([(size(facet(f)%corner), f=1, size(facet))])))
    do f = 1, size(facet)
      do i = 1, size(facet(f)%corner)
        call table%add(edge_nodes(facet(f), i, m), k)
        if (edge(k)%facet(1) == 0) then
          edge(k)%facet(1) = f
        else if (edge(k)%facet(2) == 0) then
          edge(k)%facet(2) = f
        else
          call set_error(error, 'more than two facets meet at '//trim(merge('an edge', 'a node ', m == 2))//': '// &
                         facet_text(mesh, facet(edge(k)%facet(1)))//', '//facet_text(mesh, facet(edge(k)%facet(2)))// &
                         ' and '//facet_text(mesh, facet(f))//'; such a surface has no two sides: make each part a '// &
                         'body', exit_bad_input)
          return
        end if
      end do
    end do
  end subroutine find_edges

  !> Nodes of an edge of a facet, from its beginning to its end.
  pure function edge_nodes(facet, i, m) result(node)
    type(facet_t), intent(in) :: facet  !! The facet.
    integer, intent(in) :: i  !! Number of the edge, or of the end in two dimensions.
    integer, intent(in) :: m  !! Number of nodes of an edge: 2, or 1 in two dimensions.
    integer :: node(m), all(2)
    all = [facet%corner(i), facet%corner(modulo(i, size(facet%corner)) + 1)]
    node = all(:m)
  end function edge_nodes

  !> Find which facets are to be reversed so that all have the orientation of the first one.
  subroutine compare_neighbours(mesh, facet, table, edge, error)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body, with the facets as its elements.
    type(facet_t), intent(inout) :: facet(:)  !! The facets (n).
    type(corner_table_t), intent(in) :: table  !! Edges by their nodes.
    type(edge_t), intent(in) :: edge(:)  !! Their facets.
    type(error_t), allocatable, intent(out) :: error  !! Where there is none, or edges do not join all facets.
    integer :: waiting(size(facet)), f, first, g, i, last, m
    logical :: reversed
    m = mesh%dimension - 1
    facet(1)%is_reached = .true.
    waiting(1) = 1
    first = 1
    last = 1
    do while (first <= last)
      f = waiting(first)
      first = first + 1
      do i = 1, size(facet(f)%corner)
        g = sum(edge(table%find(edge_nodes(facet(f), i, m)))%facet) - f
        if (g == 0) cycle
        reversed = facet(f)%is_reversed .neqv. goes_alike(edge_nodes(facet(f), i, m), i, facet(g))
        if (.not. facet(g)%is_reached) then
          facet(g)%is_reached = .true.
          facet(g)%is_reversed = reversed
          last = last + 1
          waiting(last) = g
        else if (facet(g)%is_reversed .neqv. reversed) then
          call set_error(error, 'it has one side only, as a Moebius strip: the sides change between '// &
                         facet_text(mesh, facet(f))//' and '//facet_text(mesh, facet(g))//'; cut it there into '// &
                         'two bodies', exit_bad_input)
          return
        end if
      end do
    end do
    if (last == size(facet)) return
    g = findloc(facet%is_reached, .false., dim=1)
    call set_error(error, 'it is in pieces, '//to_text(size(facet) - last)//' of its '//to_text(size(facet))// &
                   ' facets (the first is '//facet_text(mesh, facet(g))//') are joined to '// &
                   facet_text(mesh, facet(1))//' by no edge: make each piece a body', exit_bad_input)
  end subroutine compare_neighbours

  !> Whether the edge of a facet runs in the same direction in its neighbour, which then is oriented otherwise.
  pure logical function goes_alike(node, i, other)
    integer, intent(in) :: node(:)  !! Nodes of the edge, in the order of the facet (1 or 2).
    integer, intent(in) :: i  !! Number of the edge in the facet.
    type(facet_t), intent(in) :: other  !! The neighbour.
    integer :: k
    if (size(node) == 1) then
      goes_alike = other%corner(i) == node(1)
    else
      k = findloc(other%corner, node(1), dim=1)
      goes_alike = other%corner(modulo(k, size(other%corner)) + 1) == node(2)
    end if
  end function goes_alike

  !> Solid angle of a facet, or plane angle, from a point: positive where its normal points away from it [rad].
  pure real(dp) function angle_of(x, point) result(angle)
    real(dp), intent(in) :: x(:, :)  !! Corners (dim, n_corners) [length].
    real(dp), intent(in) :: point(:)  !! The point (dim) [length].
    real(dp) :: a(3), b(3), c(3), la, lb, lc
    integer :: i
    angle = 0
    a = 0
    b = 0
    a(:size(point)) = x(:, 1) - point
    if (size(point) == 2) then
      b(:2) = x(:, 2) - point
      angle = atan2(a(1)*b(2) - a(2)*b(1), dot_product(a, b))
      return
    end if
    la = norm2(a)
    do i = 2, size(x, 2) - 1
      b = x(:, i) - point
      c = x(:, i + 1) - point
      lb = norm2(b)
      lc = norm2(c)
      angle = angle + 2*atan2(dot_product(a, cross(b, c)), la*lb*lc + dot_product(a, b)*lc + dot_product(a, c)*lb + &
                              dot_product(b, c)*la)
    end do
  end function angle_of

  !> Volume inside a closed surface, or area inside a closed curve: positive where the normals point outward [volume].
  pure real(dp) function volume_of(mesh, facet) result(volume)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(facet_t), intent(in) :: facet(:)  !! The facets (n).
    real(dp) :: centre(mesh%dimension), x(mesh%dimension, 4)
    integer :: f, i, n
    ! On the axis of axisymmetric analyses, which closes curves: x dy is 0 there.
    centre = sum(mesh%x, dim=2)/mesh%n_nodes()
    centre(1) = merge(0.0_dp, centre(1), mesh%dimension == 2)
    volume = 0
    do f = 1, size(facet)
      n = size(facet(f)%corner)
      x(:, :n) = mesh%x(:, facet(f)%corner) - spread(centre, 2, n)
      if (mesh%dimension == 2) then
        volume = volume + sign_of(facet(f))*(x(1, 1) + x(1, 2))*(x(2, 2) - x(2, 1))/2
        cycle
      end if
      do i = 2, n - 1
        volume = volume + sign_of(facet(f))*dot_product(x(:, 1), cross(x(:, i), x(:, i + 1)))/6
      end do
    end do
  end function volume_of

  !> Order of the nodes of a facet whose normal is reversed.
  pure function reversed_order(kind) result(order)
    integer, intent(in) :: kind  !! Element kind.
    integer, allocatable :: order(:)
    type(element_kind_t) :: properties
    integer :: i
    if (kind_dimension(kind) == 2) then
      order = mirror_order(kind)
    else
      properties = element_kind(kind)
      order = [2, 1, (i, i=3, properties%n_nodes)]
    end if
  end function reversed_order

  !> A facet, for messages.
  function facet_text(mesh, facet) result(text)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body, with the facets as its elements.
    type(facet_t), intent(in) :: facet  !! The facet.
    character(:), allocatable :: text
    text = 'element '//to_text(mesh%block(facet%block)%tag(facet%element))
  end function facet_text
end module dotyk_mesh_rigid_surface
