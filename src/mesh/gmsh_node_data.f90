!> Values at nodes, such as temperatures, by the tags of the nodes, from the sections $NodeData of gmsh mesh files, text
!> and binary, and of meshes that were made of other files (`dotyk_mesh_conversion`).
!>
!> Source: gmsh reference manual, "MSH file format".
module dotyk_mesh_gmsh_node_data
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_files, only: is_cad_file, is_geo_file
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_mesh_conversion, only: make_mesh, meshing_t, needs_conversion
  use dotyk_mesh_gmsh_common, only: begin_section, read_end, read_format, skip_section
  use dotyk_mesh_tag_map, only: growing_tag_map_t
  implicit none
  private
  public :: read_node_data

  type, public :: node_values_t  !! The values.
    type(growing_tag_map_t) :: node  !! Nodes that have one.
    real(dp), allocatable, private :: value(:)  !! Values by indices of nodes; the first `node%n` are used (room) [any].
  contains
    procedure :: set => node_values_set
    procedure :: find => node_values_find
  end type node_values_t

contains

  !> Read the field of a name. Sections of one time step, as those of partitions, are one field; several steps are
  !> refused, for which of them is meant is not known.
  subroutine read_node_data(file, dimension, name, values, error)
    character(*), intent(in) :: file  !! Path of the file, whose mesh was made where it is of another format.
    integer, intent(in) :: dimension  !! Dimension of space.
    character(*), intent(in) :: name  !! Name of the field, the first string tag of its sections.
    type(node_values_t), intent(out) :: values  !! The values [any].
    !> Set for files that cannot be read, without such a field, and for mistakes in it, with file and line.
    type(error_t), allocatable, intent(out) :: error
    type(byte_cursor_t) :: cursor
    type(meshing_t) :: meshing
    character(:), allocatable :: section, names, msh
    integer(int64) :: position, step
    logical :: found, has_format
    if (is_geo_file(file) .or. is_cad_file(file)) then
      call set_error(error, 'field is read from meshes (.msh, .inp, .vtu and others), and this is a geometry, '// &
                     quoted(file)//': write mesh and temperature as one such file', exit_bad_input)
      return
    end if
    msh = file
    if (needs_conversion(file)) then
      meshing%is_made = .true.
      call make_mesh(file, dimension, msh, error, meshing)
      if (allocated(error)) return
    end if
    call cursor%open(msh, error)
    if (allocated(error)) return
    cursor%file = file
    has_format = .false.
    found = .false.
    names = ''
    do while (.not. cursor%broken)
      if (cursor%at_end()) exit
      call begin_section(cursor, has_format, section, position)
      if (cursor%broken) exit
      select case (section)
      case ('$MeshFormat')
        call read_format(cursor)
        has_format = .true.
        call read_end(cursor, section)
      case ('$NodeData')
        call read_section(cursor, name, position, values, step, found, names)
      case default
        call skip_section(cursor, section, position)
      end select
      cursor%section = ''
    end do
    if (cursor%broken) then
      call set_error(error, cursor%fault, exit_bad_input)
    else if (.not. found) then
      if (len(names) == 0) names = ', none'
      call set_error(error, file//': the nodes have no field '//quoted(name)//'; they have '//names(3:), exit_bad_input)
    end if
    call cursor%close
  end subroutine read_node_data

  !> Read a section: string, real and integer tags, which are text in binary files too; then a node and its value each.
  subroutine read_section(cursor, name, position, values, step, found, names)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind '$NodeData'.
    character(*), intent(in) :: name  !! Name of the field that is wanted.
    integer(int64), intent(in) :: position  !! Position of the section in the file.
    type(node_values_t), intent(inout) :: values  !! Values so far [any].
    integer(int64), intent(inout) :: step  !! Its time step, where it was found.
    logical, intent(inout) :: found  !! Whether the field was found.
    character(:), allocatable, intent(inout) :: names  !! Names so far, each after a comma.
    integer(int64) :: n, tag, integer_tag(3), i
    character(:), allocatable :: line, own
    real(dp) :: value
    logical :: binary
    binary = cursor%binary
    cursor%binary = .false.
    own = ''
    call cursor%get_int(n)
    do i = 1, n
      if (cursor%broken) return
      call cursor%skip_blanks
      call cursor%get_line(line)
      if (i == 1) own = between_quotes(line)
    end do
    call cursor%get_int(n)
    do i = 1, n
      if (cursor%broken) return
      call cursor%get_real(value)
    end do
    call cursor%get_int(n)
    integer_tag = 0
    do i = 1, n
      if (cursor%broken) return
      call cursor%get_int(tag)
      if (i <= size(integer_tag)) integer_tag(i) = tag
    end do
    if (index(names//', ', ', '//quoted(own)//', ') == 0) names = names//', '//quoted(own)
    if (binary .and. own == name) call cursor%end_line
    cursor%binary = binary
    if (cursor%broken) return
    if (own /= name) then
      call skip_section(cursor, '$NodeData', position)
      return
    end if
    if (n < 3) then
      call cursor%fail('the integers time step, components and number of values are missing', position)
    else if (integer_tag(2) /= 1) then
      call cursor%fail('field '//quoted(name)//' has '//to_text(integer_tag(2))//' components, it must have one', &
                       position)
    else if (found .and. step /= integer_tag(1)) then
      call cursor%fail('field '//quoted(name)//' has several time steps, '//to_text(step)//' and '// &
                       to_text(integer_tag(1))//': save the one that is meant, or give each a name of its own', &
                       position)
    end if
    found = .true.
    step = integer_tag(1)
    call cursor%require(integer_tag(3), merge(12, 4, binary), 'values', position)
    do i = 1, integer_tag(3)
      if (cursor%broken) return
      call cursor%get_int(tag)
      call cursor%get_real(value)
      if (.not. cursor%broken) call values%set(tag, value)
    end do
    call read_end(cursor, '$NodeData')
  end subroutine read_section

  !> What a line has between its quotes; the line without them.
  pure function between_quotes(line) result(text)
    character(*), intent(in) :: line  !! The line.
    character(:), allocatable :: text
    integer :: first, last
    first = index(line, '"')
    last = index(line, '"', back=.true.)
    text = trim(line)
    if (last > first) text = line(first + 1:last - 1)
  end function between_quotes

  !> Set the value of a node.
  subroutine node_values_set(self, tag, value)
    class(node_values_t), intent(inout) :: self
    integer(int64), intent(in) :: tag  !! Tag of the node.
    real(dp), intent(in) :: value  !! The value [any].
    real(dp), allocatable :: larger(:)
    integer :: i
    call self%node%add(tag, i)
    if (.not. allocated(self%value)) allocate (self%value(32))
    if (i > size(self%value)) then
      allocate (larger(2*size(self%value)))
      larger(:size(self%value)) = self%value
      call move_alloc(larger, self%value)
    end if
    self%value(i) = value
  end subroutine node_values_set

  !> The value of a node.
  pure subroutine node_values_find(self, tag, value, found)
    class(node_values_t), intent(in) :: self
    integer(int64), intent(in) :: tag  !! Tag of the node.
    real(dp), intent(out) :: value  !! The value; 0 where it has none [any].
    logical, intent(out) :: found  !! Whether it has one.
    integer :: i
    value = 0
    i = 0
    if (self%node%n > 0) i = self%node%find(tag)
    found = i > 0
    if (found) value = self%value(i)
  end subroutine node_values_find
end module dotyk_mesh_gmsh_node_data
