!> From the input to bodies: meshes, materials, supports, loads, and the surfaces of the contact pairs.
module dotyk_driver_bodies
  use dotyk_base_error, only: error_t, problem_list_t, add_context
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_driver_materials, only: build_material
  use dotyk_driver_parallel, only: largest_first
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load, only: load_t
  use dotyk_elasticity_support, only: support_t
  use dotyk_input_case, only: case_t
  use dotyk_input_names, only: load_force_density
  use dotyk_mesh_body_mesh, only: extract_body
  use dotyk_mesh_gmsh, only: read_gmsh
  use dotyk_mesh_gmsh_run, only: mesh_geometry
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_surface, only: surface_t, extract_surface
  implicit none
  private
  public :: build_bodies, assemble_bodies

contains

  !> Read every mesh once and build its bodies; all problems are reported together.
  subroutine build_bodies(case, body, surface_a, surface_b, error)
    type(case_t), intent(in) :: case
    !> (n_bodies).
    type(body_t), allocatable, intent(out) :: body(:)
    !> The two surfaces of each contact pair (n_pairs).
    type(surface_t), allocatable, intent(out) :: surface_a(:), surface_b(:)
    type(error_t), allocatable, intent(out) :: error
    type(problem_list_t) :: problems
    type(mesh_t) :: mesh
    type(error_t), allocatable :: failed
    logical :: done(size(case%body)), same(size(case%body))
    integer :: b, c
    allocate (body(size(case%body)), surface_a(size(case%contact)), surface_b(size(case%contact)))
    done = .false.
    do b = 1, size(body)
      if (done(b)) cycle
      same = [(case%body(c)%mesh == case%body(b)%mesh, c=1, size(body))]
      done = done .or. same
      call read_mesh(case%body(b)%mesh, case%scene%dimension, mesh, failed)
      call problems%add_error(failed)
      if (problems%count > 0) cycle
      do c = 1, size(body)
        if (same(c)) call build_body(case, mesh, c, body(c), surface_a, surface_b, problems)
      end do
    end do
    call problems%raise(error)
  end subroutine build_bodies

  !> A .msh file, or a .geo file by way of gmsh.
  subroutine read_mesh(path, dimension, mesh, error)
    character(*), intent(in) :: path
    !> 2 or 3: for gmsh.
    integer, intent(in) :: dimension
    type(mesh_t), intent(out) :: mesh
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: msh
    msh = path
    if (len(path) > 4) then
      if (path(len(path) - 3:) == '.geo') call mesh_geometry(path, dimension, msh, error)
    end if
    if (.not. allocated(error)) call read_gmsh(msh, mesh, error)
  end subroutine read_mesh

  !> One body and the surfaces of its contact pairs.
  subroutine build_body(case, mesh, b, body, surface_a, surface_b, problems)
    type(case_t), intent(in) :: case
    type(mesh_t), intent(in) :: mesh
    !> Index of the body.
    integer, intent(in) :: b
    type(body_t), intent(inout) :: body
    type(surface_t), intent(inout) :: surface_a(:), surface_b(:)
    type(problem_list_t), intent(inout) :: problems
    type(error_t), allocatable :: failed
    type(support_t), allocatable :: support(:)
    integer :: k, before
    before = problems%count
    body%name = case%body(b)%name
    body%analysis = case%scene%analysis
    body%dimension = case%scene%dimension
    call build_material(case%material(case%body(b)%material), body%material, failed)
    call note(case%material(case%body(b)%material)%line, failed)
    call extract_body(mesh, case%body(b)%volume, body%dimension, body%mesh, failed)
    call note(case%body(b)%line, failed)
    if (problems%count > before) return

    do k = 1, size(case%contact)
      associate (contact => case%contact(k))
        if (contact%body_a == b) call extract_surface(mesh, body%mesh, contact%surface_a, surface_a(k), failed)
        call note(contact%line, failed)
        if (contact%body_b == b) call extract_surface(mesh, body%mesh, contact%surface_b, surface_b(k), failed)
        call note(contact%line, failed)
      end associate
    end do
    call build_supports(support)
    if (problems%count == before) then
      call body%hold(support, failed)
      if (allocated(failed)) call problems%add(case%file//": body '"//body%name//"': "//failed%message, failed%code)
    end if
    call build_loads()

  contains

    !> The supports of this body.
    subroutine build_supports(support)
      type(support_t), allocatable, intent(out) :: support(:)
      integer :: i, n
      allocate (support(count(case%support%body == b)))
      n = 0
      do i = 1, size(case%support)
        associate (given => case%support(i))
          if (given%body /= b) cycle
          n = n + 1
          call extract_surface(mesh, body%mesh, given%surface, support(n)%surface, failed)
          call note(given%line, failed)
          support(n)%fix = given%fix
          support(n)%value = given%value
          support(n)%formula = given%value_formula
        end associate
      end do
    end subroutine build_supports

    !> The loads of this body.
    subroutine build_loads()
      type(surface_t) :: surface
      integer :: i
      do i = 1, size(case%load)
        associate (given => case%load(i))
          if (given%body /= b) cycle
          if (given%kind /= load_force_density) then
            call extract_surface(mesh, body%mesh, given%surface, surface, failed)
            if (allocated(failed)) then
              call note(given%line, failed)
              cycle
            end if
          end if
        end associate
      end do
    end subroutine build_loads

    !> A problem of a line of the input.
    subroutine note(line, failed)
      integer, intent(in) :: line
      type(error_t), allocatable, intent(inout) :: failed
      call add_context(failed, case%file//':'//to_text(line)//': ')
      call problems%add_error(failed)
    end subroutine note
  end subroutine build_body
end module dotyk_driver_bodies
