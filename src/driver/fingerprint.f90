!> What a scene is made of, as far as its contact points and its answer depend on it: the lines by which a checkpoint is known to be of
!> this scene or of another.
!>
!> What the iteration does with the scene (`&solver`, theta among it), what is written, names of files and numbers of threads are no part of
!> it. A part that is added here makes checkpoints of before ones of other scenes: raise `layout` of checkpoint_file.f90 then.
module dotyk_driver_fingerprint
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t, contact_input_t, load_input_t, material_input_t, support_input_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_content_hash, only: content_hash_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: fingerprint, differences

  !> What stands between the name of a part and its hash.
  character(*), parameter :: mark = '|'
  !> Differences that are listed.
  integer, parameter :: most_listed = 5

contains

  !> One line for each part: its name, '|', the hash of what matters of it.
  function fingerprint(case, body, surface_a, surface_b, pair) result(lines)
    type(case_t), intent(in) :: case
    !> (n_bodies), where they are placed.
    type(body_t), intent(in) :: body(:)
    !> (n_pairs).
    type(surface_t), intent(in) :: surface_a(:), surface_b(:)
    type(contact_pair_t), intent(in) :: pair(:)
    character(:), allocatable :: lines
    type(content_hash_t) :: hash
    character(:), allocatable :: name
    integer :: b, k
    lines = ''
    call add_integer(hash, case%scene%analysis)
    call put('the kind of analysis')
    do b = 1, size(body)
      name = ' of body '//quoted(body(b)%name)
      call add_mesh(hash, body(b)%mesh)
      call put('the mesh'//name)
      call add_material(hash, case%material(case%body(b)%material))
      if (.not. body(b)%material%isotropic) call add_reals(hash, [case%body(b)%axis, case%body(b)%angle])
      call put('the material'//name)
      do k = 1, size(case%support)
        if (case%support(k)%body == b) call add_support(hash, case%support(k))
      end do
      call add_integers(hash, body(b)%constraint%equation)
      call add_sum(hash, body(b)%constraint%prescribed)
      call put('the supports'//name)
      do k = 1, size(case%load)
        if (case%load(k)%body == b) call add_load(hash, case%load(k))
      end do
      call add_sum(hash, body(b)%load)
      call put('the loads'//name)
    end do
    do k = 1, size(pair)
      name = ' of contact '//quoted(pair(k)%name)
      call add_integer(hash, pair(k)%body_a)
      call add_integer(hash, pair(k)%body_b)
      call add_surface(hash, surface_a(k))
      call add_surface(hash, surface_b(k))
      call put('the surfaces'//name)
      call add_contact(hash, case%contact(k))
      call put('the settings'//name)
      call add_integer(hash, pair(k)%n_rows)
      call add_sum(hash, spread(pair(k)%row_weight, 1, 1))
      call put('the number of points ('//to_text(pair(k)%n_rows)//')'//name)
    end do
  contains
    !> Another line, and a new hash.
    subroutine put(part)
      character(*), intent(in) :: part
      lines = lines//part//mark//hash%digits()//new_line('a')
      hash = content_hash_t()
    end subroutine put
  end function fingerprint

  !> What differs between two scenes, for a message: the first few names of parts; empty where nothing does.
  function differences(here, there) result(text)
    !> Lines of this scene, and of the checkpoint's.
    character(*), intent(in) :: here, there
    character(:), allocatable :: text
    type(text_t), allocatable :: a(:), b(:)
    integer :: i, n
    text = ''
    if (here == there) return
    call split_lines(here, a)
    call split_lines(there, b)
    if (size(a) /= size(b)) then
      text = 'another number of bodies or contact pairs'
      return
    end if
    n = 0
    do i = 1, size(a)
      if (a(i)%s == b(i)%s) cycle
      n = n + 1
      if (n > most_listed) cycle
      if (n > 1) text = text//', '
      text = text//name_of(a(i)%s)
      if (name_of(a(i)%s) /= name_of(b(i)%s)) text = text//' (there: '//name_of(b(i)%s)//')'
    end do
    if (n > most_listed) text = text//' and '//to_text(n - most_listed)//' more'
  end function differences

  !> The part of a line before its hash.
  pure function name_of(line) result(name)
    character(*), intent(in) :: line
    character(:), allocatable :: name
    name = line(:index(line, mark, back=.true.) - 1)
  end function name_of

  !> Lines of a text.
  pure subroutine split_lines(text, lines)
    character(*), intent(in) :: text
    type(text_t), allocatable, intent(out) :: lines(:)
    integer :: i, first, n
    allocate (lines(count([(text(i:i) == new_line('a'), i=1, len(text))])))
    first = 1
    n = 0
    do i = 1, len(text)
      if (text(i:i) /= new_line('a')) cycle
      n = n + 1
      lines(n)%s = text(first:i - 1)
      first = i + 1
    end do
  end subroutine split_lines

  !> Coordinates, elements.
  subroutine add_mesh(hash, mesh)
    type(content_hash_t), intent(inout) :: hash
    type(body_mesh_t), intent(in) :: mesh
    integer :: i
    do i = 1, size(mesh%x, 2)
      call add_reals(hash, mesh%x(:, i))
    end do
    do i = 1, size(mesh%block)
      call add_integer(hash, mesh%block(i)%kind)
      call add_integers(hash, mesh%block(i)%node)
    end do
  end subroutine add_mesh

  subroutine add_material(hash, material)
    type(content_hash_t), intent(inout) :: hash
    type(material_input_t), intent(in) :: material
    call add_integer(hash, material%kind)
    call add_reals(hash, [material%young, material%poisson, material%shear, material%axis_1, material%axis_2, material%stiffness])
    call add_text(hash, material%young_formula)
  end subroutine add_material

  subroutine add_support(hash, support)
    type(content_hash_t), intent(inout) :: hash
    type(support_input_t), intent(in) :: support
    integer :: i
    call add_text(hash, support%surface)
    call add_text(hash, support%fix)
    call add_reals(hash, support%value)
    do i = 1, size(support%value_formula)
      call add_text(hash, support%value_formula(i)%s)
    end do
  end subroutine add_support

  subroutine add_load(hash, load)
    type(content_hash_t), intent(inout) :: hash
    type(load_input_t), intent(in) :: load
    integer :: i
    call add_integer(hash, load%kind)
    call add_text(hash, load%surface)
    call add_reals(hash, load%value)
    do i = 1, size(load%formula)
      call add_text(hash, load%formula(i)%s)
    end do
  end subroutine add_load

  !> All but theta.
  subroutine add_contact(hash, contact)
    type(content_hash_t), intent(inout) :: hash
    type(contact_input_t), intent(in) :: contact
    call add_integers(hash, reshape([contact%gap_kind, contact%points, contact%geometry, contact%quadrature], [4, 1]))
    call add_reals(hash, [contact%gap, contact%search_radius])
    call add_text(hash, contact%gap_formula)
  end subroutine add_contact

  subroutine add_surface(hash, surface)
    type(content_hash_t), intent(inout) :: hash
    type(surface_t), intent(in) :: surface
    call add_integers(hash, surface%node)
  end subroutine add_surface

  subroutine add_text(hash, text)
    type(content_hash_t), intent(inout) :: hash
    character(:), allocatable, intent(in) :: text
    if (allocated(text)) call hash%add(text)
    call hash%add(mark)
  end subroutine add_text

  subroutine add_integer(hash, value)
    type(content_hash_t), intent(inout) :: hash
    integer, intent(in) :: value
    character(4) :: bytes
    bytes = transfer(value, bytes)
    call hash%add(bytes)
  end subroutine add_integer

  subroutine add_integers(hash, values)
    type(content_hash_t), intent(inout) :: hash
    integer, intent(in) :: values(:, :)
    integer :: i, j
    call add_integer(hash, size(values, 2))
    do j = 1, size(values, 2)
      do i = 1, size(values, 1)
        call add_integer(hash, values(i, j))
      end do
    end do
  end subroutine add_integers

  !> Sums of values that were computed, to so many digits that rounding errors do not show.
  subroutine add_sum(hash, values)
    type(content_hash_t), intent(inout) :: hash
    !> (components, n).
    real(dp), intent(in) :: values(:, :)
    integer, parameter :: digits = 9
    integer :: i
    call hash%add(to_text(sum(abs(values)), digits)//mark)
    ! Where on the nodes or points they are counts too.
    call hash%add(to_text(sum([(i*sum(abs(values(:, i))), i=1, size(values, 2))]), digits)//mark)
  end subroutine add_sum

  subroutine add_reals(hash, values)
    type(content_hash_t), intent(inout) :: hash
    real(dp), intent(in) :: values(:)
    character(8) :: bytes
    integer :: i
    call add_integer(hash, size(values))
    do i = 1, size(values)
      ! -0 is 0.
      bytes = transfer(transfer(values(i) + 0.0_dp, 0_int64), bytes)
      call hash%add(bytes)
    end do
  end subroutine add_reals
end module dotyk_driver_fingerprint
