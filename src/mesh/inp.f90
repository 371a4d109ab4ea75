!> Reader of the meshes of Abaqus and CalculiX decks (.inp).
!>
!> Sets of elements become volumes, in two dimensions surfaces; surfaces, and sets of nodes as the outer faces all of
!> whose nodes are in the set, become surfaces, in two dimensions curves. Where elements belong to no set, all elements
!> are the volume `Eall`. Each process reads the whole file, and keeps its selection.
module dotyk_mesh_inp
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_mesh_element, only: kind_dimension, kind_nodes, n_element_kinds
  use dotyk_mesh_inp_faces, only: face_nodes, faces_of_surface, inp_face_list_t, inp_outer_faces_t
  use dotyk_mesh_inp_numbering, only: inp_numbering_t
  use dotyk_mesh_inp_reader, only: read_deck
  use dotyk_mesh_inp_state, only: inp_state_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  use dotyk_mesh_mesh_selection, only: mesh_selection_t
  implicit none
  private
  public :: mesh_of_sets, read_inp

  character(*), parameter :: all_elements = 'Eall'  !! Volume of all elements, where some are in no set.
  integer, parameter :: most_listed = 5  !! Greatest number of node sets in a remark.

contains

  !> Read a deck, or a selection of it.
  subroutine read_inp(file, dimension, mesh, remark, error, selection)
    character(*), intent(in) :: file  !! Path of the file.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(mesh_t), intent(out) :: mesh  !! Mesh.
    character(:), allocatable, intent(out) :: remark  !! Remark for the log; empty where there is none.
    !> Set for files that cannot be read and for mistakes in them, with file and line.
    type(error_t), allocatable, intent(out) :: error
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read; all if absent.
    type(inp_state_t) :: state
    remark = ''
    call read_deck(file, state, error)
    if (.not. allocated(error)) call mesh_of_sets(file, state, dimension, mesh, remark, error, selection)
  end subroutine read_inp

  !> Mesh of elements with sets: of a deck, or of another file that tells surfaces by sets.
  subroutine mesh_of_sets(file, state, dimension, mesh, remark, error, selection)
    character(*), intent(in) :: file  !! Path of the file.
    type(inp_state_t), intent(inout) :: state  !! What was read; mistakes are kept there.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(mesh_t), intent(out) :: mesh  !! Mesh.
    character(:), allocatable, intent(out) :: remark  !! Remark for the log; empty where there is none.
    type(error_t), allocatable, intent(out) :: error  !! Set for mistakes in the file, with its line.
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read; all if absent.
    type(inp_numbering_t) :: numbering
    type(mesh_builder_t) :: builder
    remark = ''
    if (present(selection)) builder%selection = selection
    call numbering%find(state, dimension)
    if (.not. allocated(state%fault)) call add_elements(state, numbering, dimension, builder)
    if (.not. allocated(state%fault)) call add_surfaces(state, numbering, dimension, builder, remark)
    if (allocated(state%fault)) then
      call set_error(error, state%fault)
      return
    end if
    if (len(state%not_read) > 0) then
      if (len(remark) > 0) remark = '; '//remark
      remark = 'not read: '//state%not_read//remark
    end if
    if (len(remark) > 0) remark = file//', read as a mesh: '//remark
    call add_nodes(state, builder)
    mesh%file = file
    call builder%finish(mesh)
  end subroutine mesh_of_sets

  !> Add the elements: blocks of one kind and one combination of sets.
  subroutine add_elements(state, numbering, dimension, builder)
    type(inp_state_t), intent(inout) :: state  !! What was read.
    type(inp_numbering_t), intent(in) :: numbering  !! Its numbering.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; groups and blocks are added.
    ! Groups of the sets by dimension; number of elements, block and elements so far of each combination and kind.
    integer, allocatable :: group(:, :), total(:, :), block(:, :), n(:, :), own(:)
    integer :: e, c, k, s, d, entity
    integer(int64) :: first, last
    associate (part => state%slot(1)%part)
      allocate (group(2, part%n_element_sets + 1), source=0)
      allocate (total(n_element_kinds, numbering%n_combinations), source=0)
      allocate (block(n_element_kinds, numbering%n_combinations), n(n_element_kinds, numbering%n_combinations), &
                source=0)
      do e = 1, part%n_elements
        c = numbering%combination(e)
        total(part%kind(e), c) = total(part%kind(e), c) + 1
      end do
      call add_groups()
      do c = 1, numbering%n_combinations
        do k = 1, n_element_kinds
          if (total(k, c) == 0) cycle
          d = kind_dimension(k)
          if (d < dimension - 1) cycle
          own = group(dimension - d + 1, numbering%sets_of(c))
          s = group(dimension - d + 1, part%n_element_sets + 1)
          if (s > 0) own = [own, s]
          if (size(own) == 0) cycle
          if (.not. builder%wants(d, own)) cycle
          call builder%add_block(k, kind_nodes(k), own, block(k, c))
          first = 0
          last = total(k, c)
          if (.not. builder%selection%everything .and. d == dimension) &
            call builder%selection%limits(int(total(k, c), int64), 0, first, last)
          builder%block(block(k, c))%n_in_file = total(k, c)
          call builder%reserve(block(k, c), int(last - first))
        end do
      end do
      do e = 1, part%n_elements
        c = numbering%combination(e)
        k = part%kind(e)
        if (block(k, c) == 0) cycle
        n(k, c) = n(k, c) + 1
        first = 0
        last = total(k, c)
        if (.not. builder%selection%everything .and. numbering%dimension(e) == dimension) &
          call builder%selection%limits(int(total(k, c), int64), 0, first, last)
        if (n(k, c) <= first .or. n(k, c) > last) cycle
        entity = 0
        if (allocated(part%entity)) entity = part%entity(e)
        call builder%add_element(block(k, c), part%element_tag(e), entity, &
                                 numbering%node(part%first(e):part%first(e + 1) - 1), n(k, c))
      end do
    end associate

  contains

    !> Add the groups of the sets: of volumes, and of surfaces as gmsh writes them.
    subroutine add_groups()
      logical :: has(2, state%slot(1)%part%n_element_sets + 1)
      integer, allocatable :: sets(:)
      integer :: dd, kk, cc, i
      has = .false.
      do cc = 1, numbering%n_combinations
        sets = numbering%sets_of(cc)
        do kk = 1, n_element_kinds
          if (total(kk, cc) == 0) cycle
          dd = dimension - kind_dimension(kk) + 1
          if (dd > 2) cycle
          has(dd, sets) = .true.
          if (cc == 1 .and. dd == 1) has(1, size(has, 2)) = .true.
        end do
      end do
      associate (part => state%slot(1)%part)
        do i = 1, part%n_element_sets
          has(1, size(has, 2)) = has(1, size(has, 2)) .and. part%element_set(i)%name /= all_elements
        end do
        do dd = 1, 2
          do i = 1, part%n_element_sets
            if (has(dd, i)) &
              call builder%add_group(dimension - dd + 1, builder%n_groups + 1, group(dd, i), part%element_set(i)%name)
          end do
        end do
        if (has(1, size(has, 2))) &
          call builder%add_group(dimension, builder%n_groups + 1, group(1, size(has, 2)), all_elements)
      end associate
    end subroutine add_groups
  end subroutine add_elements

  !> Add the faces of surfaces and node sets.
  subroutine add_surfaces(state, numbering, dimension, builder, remark)
    type(inp_state_t), intent(inout) :: state  !! What was read; mistakes are kept there.
    type(inp_numbering_t), intent(in) :: numbering  !! Its numbering.
    integer, intent(in) :: dimension  !! Dimension of space.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; groups and blocks are added.
    !> What is to be said about node sets; empty where there is nothing.
    character(:), allocatable, intent(out) :: remark
    type(inp_outer_faces_t) :: outer
    type(inp_face_list_t) :: faces
    logical, allocatable :: is_member(:)
    integer, allocatable :: node(:)
    integer :: i, j, n_left, n_partly
    remark = ''
    n_partly = 0
    associate (part => state%slot(1)%part)
      allocate (is_member(part%n_nodes), source=.false.)
      if (part%n_node_sets > 0 .or. any([(part%surface(i)%of_nodes .or. any(part%surface(i)%face(:part%surface(i)%n) &
                                          == 0), i=1, part%n_surfaces)])) call outer%find(part, numbering, dimension)
      do i = 1, part%n_surfaces
        faces%n = 0
        call faces_of_surface(state, numbering, part%surface(i), outer, is_member, faces)
        if (allocated(state%fault)) return
        call add_faces(part%surface(i)%name)
      end do
      do i = 1, part%n_node_sets
        if (any([(part%surface(j)%key == part%node_set(i)%key, j=1, part%n_surfaces)])) cycle
        call numbering%members(state, part%node_set(i), .true., node)
        if (allocated(state%fault)) return
        faces%n = 0
        call outer%of_nodes(part, numbering, node, is_member, faces, n_left)
        call add_faces(part%node_set(i)%name)
        if (faces%n == 0 .or. n_left == 0) cycle
        n_partly = n_partly + 1
        if (n_partly <= most_listed) remark = remark//', '//quoted(part%node_set(i)%name)// &
                                              ' ('//to_text(n_left)//' of '//to_text(size(node))//')'
      end do
    end associate
    if (n_partly > most_listed) remark = remark//', ...'
    if (n_partly > 0) remark = 'node sets are the outer faces all of whose nodes they have; these sets have more '// &
                               'nodes on outer faces than on those: '//remark(3:)

  contains

    !> Add the faces as a group.
    subroutine add_faces(name)
      character(*), intent(in) :: name  !! Name of the group.
      integer :: group, block, kind, k, own(9)
      call builder%add_group(dimension - 1, builder%n_groups + 1, group, name)
      do k = 1, faces%n
        call face_nodes(state%slot(1)%part, numbering, faces%element(k), faces%face(k), kind, own)
        call builder%add_block(kind, kind_nodes(kind), [group], block)
        call builder%reserve(block, 1)
        builder%block(block)%n_in_file = builder%block(block)%n_in_file + 1
        call builder%add_element(block, state%slot(1)%part%element_tag(faces%element(k)), 0, own(:kind_nodes(kind)), &
                                 builder%block(block)%n_in_file)
      end do
    end subroutine add_faces
  end subroutine add_surfaces

  !> Add the nodes: all, or those of the selection.
  subroutine add_nodes(state, builder)
    type(inp_state_t), intent(in) :: state  !! What was read.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; its nodes are set.
    integer, allocatable :: number(:)
    integer :: b, e, i, n
    associate (part => state%slot(1)%part)
      if (builder%selection%everything) then
        builder%x = part%x(:, :part%n_nodes)
        builder%node_tag = part%node_tag(:part%n_nodes)
        return
      end if
      allocate (number(part%n_nodes), source=0)
      do b = 1, builder%n_blocks
        do e = 1, builder%block(b)%n
          number(builder%block(b)%node(:, e)) = 1
        end do
      end do
      n = sum(number)
      allocate (builder%x(3, n), builder%node_tag(n), builder%file_node(n))
      n = 0
      do i = 1, part%n_nodes
        if (number(i) == 0) cycle
        n = n + 1
        number(i) = n
        builder%file_node(n) = i
        builder%x(:, n) = part%x(:, i)
        builder%node_tag(n) = part%node_tag(i)
      end do
      builder%n_file_nodes = part%n_nodes
      call builder%use_nodes(number)
    end associate
  end subroutine add_nodes
end module dotyk_mesh_inp
