!> What `--check` says of the faces of CAD files, whose names are numbers that a user has to tell apart, and of the sets
!> and surfaces of meshes that other programs made.
module dotyk_driver_cad_faces
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: is_cad_file, is_foreign_mesh, is_stl_file
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, text_t, to_text
  use dotyk_driver_face_drawing, only: face_drawing_t
  use dotyk_driver_face_shape, only: shape_text
  use dotyk_input_case, only: case_t
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_conversion, only: meshing_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_physical_group, only: group_names, groups_named
  use dotyk_mesh_surface, only: extract_surface, surface_names, surface_t
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_mesh
  use dotyk_ranks_communication, only: this_rank
  implicit none
  private
  public :: show_cad_faces

  real(dp), parameter :: plane = 0.999_dp  !! Resultant over area of the normals of a face that counts as plane.
  real(dp), parameter :: rounding = 1.0e-9_dp  !! Components below this are 0, relative to the others [].

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
    if (written) call log%line('  the faces are drawn in '//path//': tools/render.py shows their numbers')

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
    where (abs(centre) < rounding*max(maxval(abs(centre)), sqrt(area))) centre = 0
    where (abs(normal) < rounding) normal = 0
  end subroutine measure

  !> A vector as text.
  function vector(v) result(text)
    real(dp), intent(in) :: v(3)  !! Vector (3) [any].
    character(:), allocatable :: text
    text = '('//to_text(v(1), 4)//', '//to_text(v(2), 4)//', '//to_text(v(3), 4)//')'
  end function vector
end module dotyk_driver_cad_faces
