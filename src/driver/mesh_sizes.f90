!> Sizes of elements: those that a user gives by `&mesh_size`, on a first mesh of the geometry without them, and what
!> gmsh reads for a mesh by sizes.
module dotyk_driver_mesh_sizes
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_files, only: is_cad_file, own_mark
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_operating_system, only: remove_file
  use dotyk_base_text, only: append_text, matches, quoted, text_t, to_text
  use dotyk_input_case, only: case_t, mesh_size_input_t
  use dotyk_input_paths, only: read_text
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_conversion, only: forget_mesh, is_kept, meshing_t
  use dotyk_mesh_element, only: element_tet10, element_tet4, element_tri3, element_tri6
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_cache, only: find_cache
  use dotyk_mesh_size_view, only: size_of_measure, size_view_t
  use dotyk_mesh_surface, only: extract_surface, surface_names, surface_nodes, surface_t
  use dotyk_model_mesh_file, only: add_unions, meshing_of, read_alone
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: choose_sizes, remove_views, write_views

  real(dp), parameter :: many = 7.0e4_dp  !! From this number of elements gmsh's parallel algorithm is faster.
  real(dp), parameter :: most_elements = 1.0e8_dp  !! More elements are a mistake: gmsh would take hours [].
  integer, parameter :: first_field = 9000  !! Fields of gmsh from this number on: geometries may have their own.

contains

  !> Make the meshes of the geometries that `&mesh_size` names, unless they are kept.
  subroutine choose_sizes(case, remesh, error)
    type(case_t), intent(inout) :: case  !! The case; gets the geometries and the mark of their meshes.
    logical, intent(in) :: remesh  !! Whether they are made again.
    !> Allocated where a geometry cannot be meshed, has other elements or no such surface, or does not take sizes.
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: unsized
    type(size_view_t), allocatable :: view(:)
    type(text_t), allocatable :: file(:), view_file(:)
    type(mesh_t) :: mesh
    type(meshing_t) :: meshing
    character(:), allocatable :: path
    integer, allocatable :: n_elements(:)
    integer :: f, k, v
    real(dp) :: expected
    if (size(case%mesh_size) == 0) return
    if (n_ranks() > 1) then
      call fail(case, case%mesh_size(1), 'one process makes the meshes; run without mpirun', error)
      return
    end if
    unsized = case
    allocate (file(0), view(0))
    do k = 1, size(case%mesh_size)
      path = case%body(case%mesh_size(k)%body)%mesh
      if (.not. any([(file(f)%s == path, f=1, size(file))])) call append_text(file, path)
    end do
    case%size_mark = mark_of(case)
    case%sized_file = file
    case%size_script = [(text_t(''), f=1, size(file))]
    meshing = meshing_of(case)
    do f = 1, size(file)
      if (remesh) call forget_mesh(file(f)%s, case%scene%dimension, meshing)
    end do
    if (all([(is_kept(file(f)%s, case%scene%dimension, meshing), f=1, size(file))])) return
    allocate (n_elements(size(file)), source=0)
    do f = 1, size(file)
      meshing = meshing_of(unsized)
      call read_alone(file(f)%s, case%scene%dimension, mesh, meshing, error)
      if (allocated(error)) return
      call add_unions(case, file(f)%s, mesh)
      n_elements(f) = count_elements(mesh)
      call add_views(case, file(f)%s, mesh, view, error)
      if (allocated(error)) return
    end do
    call check_use(case, error)
    if (allocated(error)) return
    expected = 0
    do v = 1, size(view)
      call view(v)%limit_gradient()
      expected = expected + view(v)%expected_elements()
    end do
    if (expected > most_elements) then
      call fail(case, case%mesh_size(1), 'the sizes make about '//to_text(expected, 2)//' elements', error)
      return
    end if
    call write_views(view, expected, case, view_file, error)
    meshing = meshing_of(case)
    do f = 1, size(file)
      if (.not. allocated(error)) call read_alone(file(f)%s, case%scene%dimension, mesh, meshing, error)
      if (allocated(error)) exit
      if (count_elements(mesh) /= n_elements(f)) cycle
      call forget_mesh(file(f)%s, case%scene%dimension, meshing)
      call fail(case, case%mesh_size(1), file(f)%s//' has the mesh that it has without sizes: give others, or '// &
                'remove what fixes it (Transfinite, Layers)', error)
    end do
    call remove_views(view_file)

  contains

    !> Number of elements of all dimensions.
    pure integer function count_elements(mesh) result(n)
      type(mesh_t), intent(in) :: mesh  !! The mesh.
      integer :: b
      n = sum([(size(mesh%block(b)%tag), b=1, size(mesh%block))])
    end function count_elements
  end subroutine choose_sizes

  !> Report a mistake of a group.
  subroutine fail(case, given, text, error)
    type(case_t), intent(in) :: case  !! The case.
    type(mesh_size_input_t), intent(in) :: given  !! The group.
    character(*), intent(in) :: text  !! What is wrong.
    type(error_t), allocatable, intent(out) :: error  !! The mistake.
    call set_error(error, case%file//':'//to_text(given%line)//': &mesh_size: '//text)
  end subroutine fail

  !> A number of what the groups ask for, by which meshes are kept.
  function mark_of(case) result(mark)
    type(case_t), intent(in) :: case  !! The case.
    character(:), allocatable :: mark
    type(text_t), allocatable :: name(:)
    integer(int64) :: sums(2)
    integer :: i, k, s
    ! Two primes below 2^31, and bases: no two lists of a user have the same sums.
    integer(int64), parameter :: prime(2) = [2147483647_int64, 2147483629_int64], base(2) = [257_int64, 263_int64]
    character(:), allocatable :: text
    sums = 0
    do k = 1, size(case%mesh_size)
      associate (given => case%mesh_size(k))
        text = case%body(given%body)%mesh//'|'//case%body(given%body)%volume//'|'//given%place%name//'|'// &
          to_text(given%size, 17)//'|'//to_text(given%contact, 17)
        if (given%contact > 0) then
          name = contact_surfaces(case, given%body)
          do s = 1, size(name)
            text = text//'|'//name(s)%s
          end do
        end if
      end associate
      do i = 1, len(text)
        sums = mod(sums*base + iachar(text(i:i)) + 1, prime)
      end do
    end do
    mark = to_text(int(sums(1)))//to_text(int(sums(2)))
  end function mark_of

  !> Surfaces of a body in the contact pairs of the file.
  function contact_surfaces(case, body) result(name)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: body  !! The body.
    type(text_t), allocatable :: name(:)  !! Physical groups, maybe with wildcards (n).
    integer :: k
    allocate (name(0))
    do k = 1, size(case%contact)
      if (case%contact(k)%auto) cycle
      if (any(case%contact(k)%bodies_a == body)) call append_text(name, case%contact(k)%surface_a)
      if (any(case%contact(k)%bodies_b == body)) call append_text(name, case%contact(k)%surface_b)
    end do
  end function contact_surfaces

  !> Refuse sizes at contact pairs that are not named.
  subroutine check_use(case, error)
    type(case_t), intent(in) :: case  !! The case.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a body has none.
    integer :: k
    do k = 1, size(case%mesh_size)
      associate (given => case%mesh_size(k))
        if (.not. given%contact > 0 .or. size(contact_surfaces(case, given%body)) > 0) cycle
        call fail(case, given, 'contact: no &contact names a surface of body '// &
                  quoted(case%body(given%body)%name)//'; name them there (auto does not), or give surface and size', &
                  error)
        return
      end associate
    end do
  end subroutine check_use

  !> Add the views of the bodies of a geometry.
  subroutine add_views(case, file, mesh, view, error)
    type(case_t), intent(in) :: case  !! The case.
    character(*), intent(in) :: file  !! The geometry.
    type(mesh_t), intent(in) :: mesh  !! Its mesh without sizes.
    type(size_view_t), allocatable, intent(inout) :: view(:)  !! The views; are more on return (n_views).
    type(error_t), allocatable, intent(out) :: error  !! As in `choose_sizes`.
    type(body_mesh_t) :: body
    type(size_view_t) :: new
    real(dp), allocatable :: size_at(:)
    integer, allocatable :: entity(:), corner(:, :), mine(:)
    integer(int64), allocatable :: tag(:)
    logical, allocatable :: used(:), has_node(:)
    integer :: b, d, e, k, v
    d = case%scene%dimension
    allocate (used(size(case%mesh_size)), source=.false.)
    do b = 1, size(case%body)
      if (case%body(b)%mesh /= file .or. case%body(b)%is_surface) cycle
      call extract_body(mesh, case%body(b)%volume, d, body, error)
      if (allocated(error)) return
      allocate (entity(0), corner(d + 1, 0), tag(0))
      do k = 1, size(body%block)
        if (all(body%block(k)%kind /= [element_tri3, element_tri6, element_tet4, element_tet10])) then
          call set_error(error, file//': body '//quoted(case%body(b)%name)//' has other elements than triangles '// &
                         'or tetrahedra, which take no sizes of &mesh_size: remove Recombine, Layers or '// &
                         'Transfinite from the geometry')
          return
        end if
        entity = [entity, body%block(k)%entity]
        tag = [tag, body%block(k)%tag]
        corner = reshape([corner, body%block(k)%node(:d + 1, :)], [d + 1, size(tag)])
      end do
      call sizes_of_body(case, b, mesh, body, size_at, used, error)
      if (allocated(error)) return
      do while (any(entity > 0))
        e = maxval(entity)
        mine = pack([(k, k=1, size(tag))], entity == e)
        call new%init(file, e, d, body%x, corner(:, mine), tag(mine))
        call new%spread_to_nodes(size_of_measure(new%measures(), d))
        has_node = [(.false., k=1, size(size_at))]
        has_node([corner(:, mine)]) = .true.
        associate (at => pack(size_at, has_node))
          where (at < huge(at)) new%size = at
        end associate
        do v = 1, size(view)
          if (view(v)%file == file .and. view(v)%entity == e) exit
        end do
        if (v > size(view)) then
          view = [view, new]
        else
          view(v)%size = min(view(v)%size, new%size)
        end if
        where (entity == e) entity = 0
      end do
      deallocate (entity, corner, tag)
    end do
    do k = 1, size(used)
      if (used(k) .or. case%body(case%mesh_size(k)%body)%mesh /= file) cycle
      if (any(used .and. case%mesh_size%line == case%mesh_size(k)%line)) cycle
      call fail(case, case%mesh_size(k), 'none of its bodies has a surface '// &
                quoted(case%mesh_size(k)%place%name), error)
      return
    end do
  end subroutine add_views

  !> Sizes that groups give the nodes of a body.
  subroutine sizes_of_body(case, b, mesh, body, size_at, used, error)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: b  !! The body.
    type(mesh_t), intent(in) :: mesh  !! Mesh of its geometry.
    type(body_mesh_t), intent(in) :: body  !! Its mesh.
    real(dp), allocatable, intent(out) :: size_at(:)  !! The sizes; huge where no group gives one (n_nodes) [length].
    logical, intent(inout) :: used(:)  !! Whether a group has found its surface (n_mesh_sizes).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the body has no such surface.
    type(text_t), allocatable :: known(:), at_contact(:)
    real(dp) :: of_body, at_faces(body%n_nodes())
    integer :: k, s
    of_body = huge(of_body)
    at_faces = huge(of_body)
    call surface_names(mesh, body, known)
    do k = 1, size(case%mesh_size)
      associate (given => case%mesh_size(k))
        if (given%body /= b) cycle
        if (len(given%place%name) == 0) then
          used(k) = .true.
          if (given%size > 0) of_body = min(of_body, given%size)
        else if (.not. given%any_body .or. has(given%place%name)) then
          used(k) = .true.
          call take(given%place%name, given%size)
        end if
        if (allocated(error) .or. .not. given%contact > 0) cycle
        at_contact = contact_surfaces(case, b)
        do s = 1, size(at_contact)
          if (has(at_contact(s)%s) .and. .not. allocated(error)) call take(at_contact(s)%s, given%contact)
        end do
      end associate
      if (allocated(error)) return
    end do
    size_at = merge(at_faces, of_body, at_faces < huge(of_body))

  contains

    !> Whether the body has a surface.
    logical function has(name)
      character(*), intent(in) :: name  !! Its name, maybe with wildcards.
      integer :: i
      has = any([(known(i)%s == name .or. matches(name, known(i)%s), i=1, size(known))])
    end function has

    !> Take the size of a face.
    subroutine take(name, size_there)
      character(*), intent(in) :: name  !! Its name, maybe with wildcards.
      real(dp), intent(in) :: size_there  !! The size [length].
      type(surface_t) :: surface
      integer, allocatable :: node(:)
      call extract_surface(mesh, body, name, surface, error)
      if (allocated(error)) then
        error%message = case%file//':'//to_text(case%mesh_size(k)%line)//': &mesh_size: '//error%message
        return
      end if
      call surface_nodes(surface, node)
      at_faces(node) = min(at_faces(node), size_there)
    end subroutine take
  end subroutine sizes_of_body

  !> What gmsh reads for meshes with sizes.
  subroutine write_views(view, expected, case, view_file, error)
    type(size_view_t), intent(in) :: view(:)  !! The sizes (n_views).
    real(dp), intent(in) :: expected  !! Expected number of elements [].
    type(case_t), intent(inout) :: case  !! Its sizes are set.
    type(text_t), allocatable, intent(out) :: view_file(:)  !! Files that gmsh reads (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a file cannot be written.
    character(:), allocatable :: folder, path, name, script, list
    character, parameter :: lf = new_line('a')
    real(dp) :: extent
    type(text_t), allocatable :: files(:), scripts(:)
    integer :: v, f, field
    allocate (view_file(0), files(0), scripts(0))
    do v = 1, size(view)
      if (any([(files(f)%s == view(v)%file, f=1, size(files))])) cycle
      call find_cache(view(v)%file, folder, error)
      if (allocated(error)) return
      script = ''
      list = ''
      extent = 0
      do f = v, size(view)
        if (view(f)%file /= view(v)%file) cycle
        name = 'sizes'//own_mark()//'.'//to_text(f)//'.pos'
        path = folder//name
        call view(f)%write(path, error)
        if (allocated(error)) return
        call append_text(view_file, path)
        field = first_field + 2*f
        script = script//view(f)%script(name, field)
        if (len(list) > 0) list = list//', '
        list = list//to_text(field + 1)
        extent = max(extent, maxval(maxval(view(f)%mesh%x, 2) - minval(view(f)%mesh%x, 2)))
      end do
      ! What the geometry says of sizes does not count beside these.
      script = 'Mesh.MeshSizeExtendFromBoundary = 0;'//lf//'Mesh.MeshSizeFromPoints = 0;'//lf// &
        'Mesh.MeshSizeFromCurvature = '//to_text(merge(8, 0, has_curvatures(view(v)%file)))//';'//lf// &
        'Mesh.MeshSizeMin = 0;'//lf// &
        'Mesh.MeshSizeMax = '//to_text(2*extent, 17)//';'//lf//'Mesh.MeshSizeFactor = 1;'//lf// &
        'Mesh.HighOrderOptimize = 1;'//lf//script
      if (expected > many) script = script//'Mesh.Algorithm3D = 10;'//lf
      script = script//'Field['//to_text(first_field)//'] = Min;'//lf// &
        'Field['//to_text(first_field)//'].FieldsList = {'//list//'};'//lf// &
        'Background Field = '//to_text(first_field)//';'//lf
      call append_text(files, view(v)%file)
      call append_text(scripts, script)
    end do
    call move_alloc(files, case%sized_file)
    call move_alloc(scripts, case%size_script)

  contains

    !> Whether gmsh knows the curvatures of the surfaces: its own kernel finds none, and meshes without end, at corners
    !> where the parameters of a surface are degenerate, such as those of three-sided patches.
    logical function has_curvatures(file)
      character(*), intent(in) :: file  !! The geometry.
      character(:), allocatable :: text
      type(error_t), allocatable :: failed
      has_curvatures = is_cad_file(file)
      if (has_curvatures) return
      call read_text(file, text, failed)
      has_curvatures = index(text, 'OpenCASCADE') > 0
    end function has_curvatures
  end subroutine write_views

  !> Remove what gmsh has read for a mesh.
  subroutine remove_views(view_file)
    type(text_t), allocatable, intent(inout) :: view_file(:)  !! The files; none on return (n).
    integer :: f
    do f = 1, size(view_file)
      call remove_file(view_file(f)%s)
    end do
    deallocate (view_file)
  end subroutine remove_views
end module dotyk_driver_mesh_sizes
