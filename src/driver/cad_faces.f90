!> What `--check` says of the faces of CAD files, whose names are numbers that a user has to tell apart, with a picture
!> of them for ParaView and dotyk-render; and of the sets and surfaces of meshes that other programs made.
module dotyk_driver_cad_faces
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: is_cad_file, is_foreign_mesh, is_stl_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, text_t, to_text
  use dotyk_base_thresholds, only: same_number
  use dotyk_input_case, only: case_t
  use dotyk_linalg_blas, only: dgesv, dsyev
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_conversion, only: meshing_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_mesh, only: group_names, groups_named, mesh_t
  use dotyk_mesh_surface, only: extract_surface, surface_names, surface_t
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_mesh
  use dotyk_ranks_communication, only: this_rank
  implicit none
  private
  public :: show_cad_faces

  !> Mean deviation of the corners, relative to the radius, up to which a face has a shape.
  real(dp), parameter :: tolerance = 5.0e-4_dp
  !> Distance of the middle of a facet from the axis or centre, relative to the radius, at least: seven facets around.
  !> The corners of a box lie on a sphere, too.
  real(dp), parameter :: least_middle = 0.9_dp
  !> Greatest radius, relative to the extent of the face: the height of its arc is the tolerance there.
  real(dp), parameter :: greatest_radius = 5
  integer, parameter :: n_steps = 6  !! Steps of Newton's method, and components of vectors that are 0.
  real(dp), parameter :: rounding = 1.0e-4_dp

  real(dp), parameter :: plane = 0.999_dp  !! Resultant over area of the normals of a face that counts as plane.

  type :: face_drawing_t  !! Facets so far, each with points of its own.
    integer :: n_points = 0, n_facets = 0  !! Number of points and facets.
    real(dp), allocatable :: x(:, :)  !! The points (3, room) [length].
    integer, allocatable :: facet(:, :)  !! Corners, number of the face and of the body of each facet (3, room).
  contains
    procedure :: add => drawing_add
    procedure :: write => drawing_write
  end type face_drawing_t

contains

  !> List the faces of all bodies from CAD files, in the coordinates of the files: area, centre, and the outward normal
  !> of plane ones. All ranks do it together.
  subroutine show_cad_faces(case, log)
    type(case_t), intent(in) :: case  !! The case, checked.
    type(log_t), intent(inout) :: log  !! Gets the table.
    type(mesh_t) :: mesh
    type(body_mesh_t) :: body_mesh
    type(meshing_t) :: meshing
    type(error_t), allocatable :: error
    type(face_drawing_t) :: drawing
    character(:), allocatable :: path
    integer :: b, first
    logical :: written
    meshing = meshing_of(case)
    do first = 1, size(case%body)
      if (.not. is_listed(case%body(first)%mesh) .or. seen(first, .false.)) cycle
      call read_mesh(case%body(first)%mesh, case%scene%dimension, mesh, meshing, error)
      if (allocated(error)) return
      call add_unions(case, case%body(first)%mesh, mesh)
      call show_volumes(mesh, case%scene%dimension, log)
      if (is_cad_file(case%body(first)%mesh)) then
        call log%line('  faces of '//case%body(first)%mesh//' in its own coordinates'// &
                      trim(merge('       ', ', in mm', is_stl_file(case%body(first)%mesh)))// &
                      ': about their area, centre, and normal where plane')
      else
        call log%line('  surfaces of '//case%body(first)%mesh//' in its own coordinates: about their '// &
                      trim(merge('area  ', 'length', case%scene%dimension == 3))//', centre, and normal where plane')
      end if
      do b = first, size(case%body)
        if (case%body(b)%mesh /= case%body(first)%mesh .or. seen(b, .true.)) cycle
        call extract_body(mesh, case%body(b)%volume, case%scene%dimension, body_mesh, error)
        if (allocated(error)) return
        call show_faces(mesh, body_mesh, b, quoted(case%body(b)%name)//', '//case%body(b)%volume, log, drawing)
      end do
    end do
    if (drawing%n_facets == 0 .or. this_rank() > 0) return
    path = case%scene%output
    path = path(:index(path, '.', back=.true.))//'faces.vtu'
    call drawing%write(path, written)
    if (written) call log%line('  the faces are drawn in '//path//': dotyk-render shows their numbers')

  contains

    !> Whether an earlier body has the mesh of a body, and its volume.
    logical function seen(b, with_volume)
      integer, intent(in) :: b  !! The body.
      logical, intent(in) :: with_volume  !! Whether the volume counts.
      integer :: i
      seen = .true.
      do i = 1, b - 1
        if (case%body(i)%mesh == case%body(b)%mesh .and. &
            (case%body(i)%volume == case%body(b)%volume .or. .not. with_volume)) return
      end do
      seen = .false.
    end function seen
  end subroutine show_cad_faces

  !> Whether the volumes and faces of a file are listed.
  pure logical function is_listed(path)
    character(*), intent(in) :: path  !! Path of the file.
    is_listed = is_cad_file(path) .or. is_foreign_mesh(path)
  end function is_listed

  !> List the volumes of a mesh; of a CAD file, the solids that have names.
  subroutine show_volumes(mesh, dimension, log)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(log_t), intent(inout) :: log  !! Gets the lines.
    type(text_t), allocatable :: names(:)
    logical :: wanted(size(mesh%group))
    integer :: i, b, n
    call group_names(mesh, dimension, names)
    if (.not. is_cad_file(mesh%file)) then
      call log%line('  element sets of '//mesh%file)
    else if (any([(index(names(i)%s, 'solid ') /= 1, i=1, size(names))])) then
      call log%line('  solids of '//mesh%file//' by their names')
    end if
    do i = 1, size(names)
      if (is_cad_file(mesh%file) .and. index(names(i)%s, 'solid ') == 1) cycle
      wanted = groups_named(mesh, names(i)%s, dimension)
      n = 0
      do b = 1, size(mesh%block)
        if (any(wanted(mesh%block(b)%group))) n = n + size(mesh%block(b)%tag)
      end do
      call log%line('    '//names(i)%s//repeat(' ', max(1, 14 - len(names(i)%s)))//counted(n, 'element'))
    end do
  end subroutine show_volumes

  !> List the faces of one body.
  subroutine show_faces(mesh, body_mesh, body, title, log, drawing)
    type(mesh_t), intent(in) :: mesh  !! The mesh of the file.
    type(body_mesh_t), intent(in) :: body_mesh  !! That of the body.
    integer, intent(in) :: body  !! Number of the body.
    character(*), intent(in) :: title  !! Names of the body and of the volume.
    type(log_t), intent(inout) :: log  !! Gets the lines.
    type(face_drawing_t), intent(inout) :: drawing  !! Gets the faces of CAD files.
    type(text_t), allocatable :: names(:)
    type(surface_t) :: surface
    type(error_t), allocatable :: error
    character(:), allocatable :: line, shape
    real(dp) :: area, centre(3), normal(3)
    integer :: i, number, status
    call log%line('    '//title)
    call surface_names(mesh, body_mesh, names)
    do i = 1, size(names)
      call extract_surface(mesh, body_mesh, names(i)%s, surface, error)
      if (allocated(error)) cycle
      call measure(body_mesh%x, surface, area, centre, normal)
      line = '      '//names(i)%s//repeat(' ', max(1, 12 - len(names(i)%s)))//to_text(area, 4)//', '//vector(centre)
      if (norm2(normal) > plane) then
        line = line//', '//vector(normal)
      else if (size(body_mesh%x, 1) == 3) then
        shape = shape_text(body_mesh%x, surface)
        if (len(shape) > 0) line = line//', '//shape
      end if
      call log%line(line)
      if (index(names(i)%s, 'face ') /= 1 .or. .not. is_cad_file(mesh%file)) cycle
      read (names(i)%s(6:), *, iostat=status) number
      if (status == 0) call drawing%add(body_mesh%x, surface, number, body)
    end do
  end subroutine show_faces

  !> Area, centre and mean normal of a surface whose facets are taken for polygons of their corners.
  subroutine measure(x, surface, area, centre, normal)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(out) :: area  !! Area; length in two dimensions [area; length].
    real(dp), intent(out) :: centre(3)  !! Centre (3) [length].
    real(dp), intent(out) :: normal(3)  !! Mean of the outward normals; of length 1 for a plane surface (3) [].
    type(element_kind_t) :: kind
    real(dp) :: p(3, 3), vector(3)
    integer :: f, k
    area = 0
    centre = 0
    normal = 0
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      if (size(x, 1) == 2) then
        p = 0
        p(:2, :2) = x(:, surface%node(:2, f))
        vector = [p(2, 2) - p(2, 1), p(1, 1) - p(1, 2), 0.0_dp]
        area = area + norm2(vector)
        centre = centre + norm2(vector)*(p(:, 1) + p(:, 2))/2
        normal = normal + vector
        cycle
      end if
      do k = 2, kind%n_corners - 1
        p = x(:, surface%node([1, k, k + 1], f))
        vector = cross(p(:, 2) - p(:, 1), p(:, 3) - p(:, 1))/2
        area = area + norm2(vector)
        centre = centre + norm2(vector)*sum(p, dim=2)/3
        normal = normal + vector
      end do
    end do
    centre = centre/max(tiny(area), area)
    normal = normal/max(tiny(area), area)
    where (abs(centre) < same_number*max(maxval(abs(centre)), sqrt(area))) centre = 0
    where (abs(normal) < same_number) normal = 0
  end subroutine measure

  !> A vector as text.
  function vector(v) result(text)
    real(dp), intent(in) :: v(3)  !! Vector (3) [any].
    character(:), allocatable :: text
    text = '('//to_text(v(1), 4)//', '//to_text(v(2), 4)//', '//to_text(v(3), 4)//')'
  end function vector

  !> Shape of a face in space; empty where it is none of those that are known.
  function shape_text(x, surface) result(text)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The face.
    character(:), allocatable :: text
    real(dp), allocatable :: p(:, :), middle(:, :), normal(:, :)
    character(:), allocatable :: as_cylinder
    real(dp) :: centre(3), axis(3), radius, extent, deviation, of_cylinder
    logical :: may_be_sphere
    text = ''
    call find_corners(x, surface, p, middle, normal)
    if (size(p, 2) < 6) return
    ! The corners of a cone, a torus or a cylinder of one layer lie on a sphere, too.
    may_be_sphere = has_inner_corner(surface)
    extent = maxval(maxval(p, dim=2) - minval(p, dim=2))
    centre = sum(p, dim=2)/size(p, 2)
    call fit_cylinder(p, normal, centre, axis, radius)
    as_cylinder = ''
    of_cylinder = huge(of_cylinder)
    if (fits(distances(p), distances(middle))) then
      of_cylinder = deviation
      as_cylinder = words('cylinder', 'hole')//' of radius '//to_text(radius, 4)//' about '//vector_text(axis)
    end if
    centre = sum(p, dim=2)/size(p, 2)
    call fit_sphere(p, centre, radius)
    if (fits(norm2(p - spread(centre, 2, size(p, 2)), dim=1), &
             norm2(middle - spread(centre, 2, size(p, 2)), dim=1)) .and. may_be_sphere) &
      text = words('sphere', 'hollow sphere')//' of radius '//to_text(radius, 4)
    if (len(as_cylinder) > 0 .and. (len(text) == 0 .or. of_cylinder <= max(deviation, rounding*tolerance))) &
      text = as_cylinder

  contains

    !> Distances from the axis.
    pure function distances(q) result(distance)
      real(dp), intent(in) :: q(:, :)  !! Points (3, n) [length].
      real(dp) :: distance(size(q, 2))
      integer :: i
      do i = 1, size(q, 2)
        distance(i) = norm2(q(:, i) - centre - axis*dot_product(q(:, i) - centre, axis))
      end do
    end function distances

    !> Whether distances are the radius.
    logical function fits(distance, of_middles)
      real(dp), intent(in) :: distance(:), of_middles(:)  !! Of corners, and of the middles of facets [length].
      fits = radius > 0 .and. radius < greatest_radius*extent
      deviation = huge(deviation)
      if (fits) deviation = norm2(distance - radius)/(radius*sqrt(real(size(distance), dp)))
      if (fits) fits = deviation < tolerance
      if (fits) fits = minval(of_middles) > least_middle*radius
    end function fits

    !> The word for a face that bulges out, or for one that bulges in.
    function words(outward, inward) result(word)
      character(*), intent(in) :: outward, inward  !! The words.
      character(:), allocatable :: word
      word = inward
      if (sum(normal*(p - spread(centre, 2, size(p, 2)))) > 0) word = outward
    end function words
  end function shape_text

  !> Whether a face has corners that are not on its border. The facets around such a corner close: what the next corner
  !> of one of them is, is the last one of another.
  pure logical function has_inner_corner(surface) result(has)
    type(surface_t), intent(in) :: surface  !! The face.
    integer :: left(maxval(surface%node))
    logical :: is_corner(size(left))
    type(element_kind_t) :: kind
    integer :: f, i
    left = 0
    is_corner = .false.
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      associate (n => kind%n_corners, corner => surface%node(:, f))
        is_corner(corner(:n)) = .true.
        do i = 1, n
          left(corner(i)) = left(corner(i)) + corner(modulo(i, n) + 1) - corner(modulo(i - 2, n) + 1)
        end do
      end associate
    end do
    has = any(is_corner .and. left == 0)
  end function has_inner_corner

  !> Corners of the facets, as often as facets have them, and the areas and normals of these.
  subroutine find_corners(x, surface, p, middle, normal)
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The face.
    real(dp), allocatable, intent(out) :: p(:, :)  !! The corners (3, n) [length].
    real(dp), allocatable, intent(out) :: middle(:, :)  !! Middles of their facets (3, n) [length].
    real(dp), allocatable, intent(out) :: normal(:, :)  !! Area times normal of their facets (3, n) [area].
    type(element_kind_t) :: kind
    integer :: f, n
    allocate (p(3, 4*surface%n_facets), middle(3, 4*surface%n_facets), normal(3, 4*surface%n_facets))
    n = 0
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      associate (corner => surface%node(:kind%n_corners, f))
        p(:, n + 1:n + kind%n_corners) = x(:, corner)
        middle(:, n + 1:n + kind%n_corners) = spread(sum(x(:, corner), dim=2)/kind%n_corners, 2, kind%n_corners)
        normal(:, n + 1:n + kind%n_corners) = &
          spread(cross(x(:, corner(2)) - x(:, corner(1)), x(:, corner(3)) - x(:, corner(1))), 2, kind%n_corners)
      end associate
      n = n + kind%n_corners
    end do
    p = p(:, :n)
    middle = middle(:, :n)
    normal = normal(:, :n)
  end subroutine find_corners

  !> Sphere through points by least squares of |p|^2 = 2 c p + k.
  subroutine fit_sphere(p, centre, radius)
    real(dp), intent(in) :: p(:, :)  !! Points (3, n) [length].
    real(dp), intent(inout) :: centre(3)  !! A point near them; the centre on return (3) [length].
    real(dp), intent(out) :: radius  !! Radius; 0 where there is no sphere [length].
    real(dp) :: a(4, 4), b(4, 1), row(4), scale
    integer :: i, info, pivot(4)
    scale = max(tiny(scale), maxval(abs(p - spread(centre, 2, size(p, 2)))))
    a = 0
    b = 0
    do i = 1, size(p, 2)
      row = [(p(:, i) - centre)/scale, 1.0_dp]
      a = a + spread(row, 2, 4)*spread(row, 1, 4)
      b(:, 1) = b(:, 1) + row*sum(row(:3)**2)
    end do
    radius = 0
    call dgesv(4, 1, a, 4, pivot, b, 4, info)
    if (info /= 0) return
    radius = scale*sqrt(max(0.0_dp, b(4, 1) + sum(b(:3, 1)**2)/4))
    centre = centre + scale*b(:3, 1)/2
  end subroutine fit_sphere

  !> Cylinder through points: the axis to which the normals are most nearly perpendicular, then Gauss-Newton steps.
  subroutine fit_cylinder(p, normal, centre, axis, radius)
    real(dp), intent(in) :: p(:, :)  !! Points (3, n) [length].
    real(dp), intent(in) :: normal(:, :)  !! Normals there (3, n) [any].
    real(dp), intent(inout) :: centre(3)  !! A point near them; one of the axis on return (3) [length].
    real(dp), intent(out) :: axis(3)  !! Direction of the axis; its greatest component is positive (3) [].
    real(dp), intent(out) :: radius  !! Radius; 0 where there is no cylinder [length].
    real(dp) :: a(3, 3), value(3), work(32), j(5), m(5, 5), r(5, 1), q(3), u(3), v(3), d, h, scale
    integer :: i, step, info, pivot(5)
    radius = 0
    a = matmul(normal, transpose(normal))
    call dsyev('V', 'L', 3, a, 3, value, work, size(work), info)
    if (info /= 0) return
    axis = a(:, 1)
    scale = max(tiny(scale), maxval(abs(p - spread(centre, 2, size(p, 2)))))
    radius = scale
    ! A circle in the plane of the other two directions is the start.
    call fit_circle(p, a(:, 2), a(:, 3), scale, centre, radius)
    do step = 1, n_steps
      u = a(:, 2) - axis*dot_product(a(:, 2), axis)
      u = u/norm2(u)
      v = cross(axis, u)
      m = 0
      r = 0
      do i = 1, size(p, 2)
        h = dot_product(p(:, i) - centre, axis)
        q = p(:, i) - centre - axis*h
        d = max(tiny(d), norm2(q))
        q = q/d
        j = [-dot_product(q, u), -dot_product(q, v), -dot_product(q, u)*h/scale, -dot_product(q, v)*h/scale, -1.0_dp]
        m = m + spread(j, 2, 5)*spread(j, 1, 5)
        r(:, 1) = r(:, 1) - j*(d - radius)
      end do
      call dgesv(5, 1, m, 5, pivot, r, 5, info)
      if (info /= 0) return
      centre = centre + r(1, 1)*u + r(2, 1)*v
      axis = axis + (r(3, 1)*u + r(4, 1)*v)/scale
      axis = axis/norm2(axis)
      radius = radius + r(5, 1)
    end do
    axis = axis*sign(1.0_dp, axis(maxloc(abs(axis), dim=1)))
  end subroutine fit_cylinder

  !> Circle through the projections of points.
  subroutine fit_circle(p, u, v, scale, centre, radius)
    real(dp), intent(in) :: p(:, :)  !! Points (3, n) [length].
    real(dp), intent(in) :: u(3), v(3)  !! Directions of its plane (3) [].
    real(dp), intent(in) :: scale  !! Size of the points [length].
    real(dp), intent(inout) :: centre(3)  !! A point near them; the centre on return (3) [length].
    real(dp), intent(inout) :: radius  !! Radius; unchanged where there is no circle [length].
    real(dp) :: a(3, 3), b(3, 1), row(3)
    integer :: i, info, pivot(3)
    a = 0
    b = 0
    do i = 1, size(p, 2)
      row = [dot_product(p(:, i) - centre, u)/scale, dot_product(p(:, i) - centre, v)/scale, 1.0_dp]
      a = a + spread(row, 2, 3)*spread(row, 1, 3)
      b(:, 1) = b(:, 1) + row*sum(row(:2)**2)
    end do
    call dgesv(3, 1, a, 3, pivot, b, 3, info)
    if (info /= 0) return
    radius = scale*sqrt(max(0.0_dp, b(3, 1) + sum(b(:2, 1)**2)/4))
    centre = centre + scale*(b(1, 1)*u + b(2, 1)*v)/2
  end subroutine fit_circle

  !> A vector as text; components that are small beside the others are 0.
  function vector_text(v) result(text)
    real(dp), intent(in) :: v(3)  !! Vector (3) [any].
    character(:), allocatable :: text
    real(dp) :: w(3)
    w = v
    where (abs(w) < rounding*maxval(abs(w))) w = 0
    text = '('//to_text(w(1), 4)//', '//to_text(w(2), 4)//', '//to_text(w(3), 4)//')'
  end function vector_text

  !> Add a face.
  subroutine drawing_add(self, x, surface, face, body)
    class(face_drawing_t), intent(inout) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The face.
    integer, intent(in) :: face, body  !! Its number, and that of the body.
    type(element_kind_t) :: kind
    real(dp), allocatable :: larger(:, :)
    integer, allocatable :: more(:, :)
    integer :: f, n, room
    if (.not. allocated(self%x)) allocate (self%x(3, 0), self%facet(3, 0))
    room = self%n_facets + surface%n_facets
    if (room > size(self%facet, 2)) then
      room = 2*room
      allocate (larger(3, 4*room), more(3, room))
      larger(:, :self%n_points) = self%x(:, :self%n_points)
      more(:, :self%n_facets) = self%facet(:, :self%n_facets)
      call move_alloc(larger, self%x)
      call move_alloc(more, self%facet)
    end if
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      n = kind%n_corners
      self%x(:, self%n_points + 1:self%n_points + n) = x(:, surface%node(:n, f))
      self%n_points = self%n_points + n
      self%n_facets = self%n_facets + 1
      self%facet(:, self%n_facets) = [n, face, body]
    end do
  end subroutine drawing_add

  !> Write the file.
  subroutine drawing_write(self, path, written)
    class(face_drawing_t), intent(in) :: self
    character(*), intent(in) :: path  !! Path of the file; it is replaced.
    logical, intent(out) :: written  !! Whether it could be written.
    integer, parameter :: type_of(3:4) = [5, 9]  !! Cell types of VTK: triangle and quadrilateral.
    integer :: unit, status, i, n
    integer, allocatable :: offset(:)
    open (newunit=unit, file=path, action='write', status='replace', iostat=status)
    written = status == 0
    if (.not. written) return
    allocate (offset(self%n_facets))
    n = 0
    do i = 1, self%n_facets
      n = n + self%facet(1, i)
      offset(i) = n
    end do
    call write_line('<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">')
    call write_line('<UnstructuredGrid>')
    call write_line('<Piece NumberOfPoints="'//to_text(self%n_points)//'" NumberOfCells="'// &
                    to_text(self%n_facets)//'">')
    call write_line('<CellData>')
    call write_integers('face', self%facet(2, :self%n_facets))
    call write_integers('body', self%facet(3, :self%n_facets))
    call write_line('</CellData>')
    call write_line('<Points>')
    call write_line('<DataArray type="Float64" Name="Points" NumberOfComponents="3" format="ascii">')
    write (unit, '(3es18.9)', iostat=status) self%x(:, :self%n_points)
    written = written .and. status == 0
    call write_line('</DataArray>')
    call write_line('</Points>')
    call write_line('<Cells>')
    call write_integers('connectivity', [(i, i=0, self%n_points - 1)])
    call write_integers('offsets', offset)
    call write_integers('types', type_of(self%facet(1, :self%n_facets)))
    call write_line('</Cells>')
    call write_line('</Piece>')
    call write_line('</UnstructuredGrid>')
    call write_line('</VTKFile>')
    close (unit, iostat=status)
    written = written .and. status == 0

  contains

    !> Write a line.
    subroutine write_line(text)
      character(*), intent(in) :: text  !! The line.
      integer :: fault
      write (unit, '(a)', iostat=fault) text
      written = written .and. fault == 0
    end subroutine write_line

    !> Write an array.
    subroutine write_integers(name, value)
      character(*), intent(in) :: name  !! Its name.
      integer, intent(in) :: value(:)  !! Its values (n).
      integer :: fault
      call write_line('<DataArray type="Int32" Name="'//name//'" format="ascii">')
      write (unit, '(12(i0, 1x))', iostat=fault) value
      written = written .and. fault == 0
      call write_line('</DataArray>')
    end subroutine write_integers
  end subroutine drawing_write
end module dotyk_driver_cad_faces
