!> Nodes and elements of an Abaqus or CalculiX deck by indices in place of numbers, and the groups of the elements.
module dotyk_mesh_inp_numbering
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_mesh_element, only: kind_dimension
  use dotyk_mesh_inp_part, only: inp_part_t, inp_set_t
  use dotyk_mesh_inp_state, only: inp_state_t
  use dotyk_mesh_tag_map, only: tag_map_t
  implicit none
  private

  type, public :: inp_numbering_t  !! The mesh by indices.
    type(tag_map_t) :: node_of_tag, element_of_tag  !! Indices of nodes and elements by their numbers.
    integer, allocatable :: node(:)  !! Nodes of the elements, from `first` of the part on (n).
    integer, allocatable :: dimension(:)  !! Dimension of each element (n_elements).
    !> Combination of element sets to which each element belongs, from 1 (n_elements).
    integer, allocatable :: combination(:)
    integer :: n_combinations = 1  !! Number of combinations; the first is that of no set.
    !> The combination with one set less, and that set; 0 for the first (room).
    integer, allocatable :: parent(:), set(:)
  contains
    procedure :: find => numbering_find
    procedure :: members => numbering_members
    procedure :: sets_of => numbering_sets_of
  end type inp_numbering_t

contains

  !> Find the indices.
  subroutine numbering_find(self, state, dimension)
    class(inp_numbering_t), intent(inout) :: self
    type(inp_state_t), intent(inout) :: state  !! What was read; mistakes are kept there.
    integer, intent(in) :: dimension  !! Dimension of space.
    integer :: repeated, e, k
    associate (part => state%slot(1)%part)
      if (part%n_nodes > 0) call self%node_of_tag%init(part%node_tag(:part%n_nodes), repeated)
      if (part%n_nodes == 0) then
        call state%fail('the file has no nodes outside of parts: *NODE or *INSTANCE is missing')
      else if (repeated > 0) then
        state%line = part%node_line(repeated)
        call state%fail('node '//to_text(part%node_tag(repeated))//' occurs a second time')
      else if (part%n_elements == 0) then
        call state%fail('the file has no elements')
      end if
      if (allocated(state%fault)) return
      call self%element_of_tag%init(part%element_tag(:part%n_elements), repeated)
      if (repeated > 0) then
        state%line = part%element_line(repeated)
        call state%fail('element '//to_text(part%element_tag(repeated))//' occurs a second time')
        return
      end if
      self%dimension = kind_dimension(part%kind(:part%n_elements))
      if (all(self%dimension /= dimension) .or. any(self%dimension > dimension)) then
        e = max(1, findloc(self%dimension > dimension, .true., dim=1))
        state%line = part%element_line(e)
        call state%fail('element '//to_text(part%element_tag(e))//' is of '//to_text(self%dimension(e))// &
                        ' dimensions, the analysis of '//to_text(dimension))
        return
      end if
      allocate (self%node(part%first(part%n_elements + 1) - 1))
      do e = 1, part%n_elements
        do k = part%first(e), part%first(e + 1) - 1
          self%node(k) = self%node_of_tag%find(part%connectivity(k))
          if (self%node(k) > 0) cycle
          state%line = part%element_line(e)
          call state%fail('element '//to_text(part%element_tag(e))//' has node '//to_text(part%connectivity(k))// &
                          ', which no *NODE has')
          return
        end do
      end do
      call combine_sets(self, state, part)
    end associate
  end subroutine numbering_find

  !> Indices of the members of a set, with those that do not exist left out.
  subroutine numbering_members(self, state, set, of_nodes, index)
    class(inp_numbering_t), intent(in) :: self
    type(inp_state_t), intent(inout) :: state  !! What was read; a member that does not exist is kept as a mistake.
    type(inp_set_t), intent(in) :: set  !! The set.
    logical, intent(in) :: of_nodes  !! Whether its members are nodes.
    integer, allocatable, intent(out) :: index(:)  !! The indices (n).
    integer :: i, n, k
    allocate (index(set%n))
    n = 0
    do i = 1, set%n
      if (of_nodes) then
        k = self%node_of_tag%find(set%member(i))
      else
        k = self%element_of_tag%find(set%member(i))
      end if
      if (k > 0) then
        n = n + 1
        index(n) = k
      else if (set%line(i) > 0) then
        state%line = set%line(i)
        call state%fail('set '//quoted(set%name)//': there is no '//trim(merge('node   ', 'element', of_nodes))// &
                        ' '//to_text(set%member(i)))
        exit
      end if
    end do
    index = index(:n)
  end subroutine numbering_members

  !> Combinations of sets: each set divides those that there are into elements with and without it.
  subroutine combine_sets(self, state, part)
    class(inp_numbering_t), intent(inout) :: self
    type(inp_state_t), intent(inout) :: state  !! What was read; mistakes are kept there.
    type(inp_part_t), intent(in) :: part  !! The model.
    ! The combination with the present set, and for which set that was found last; by combination.
    integer, allocatable :: successor(:), found_for(:), member(:), last_set(:)
    integer :: s, i, e, c
    allocate (self%combination(part%n_elements), source=1)
    allocate (last_set(part%n_elements), source=0)
    allocate (self%parent(16), self%set(16), successor(16), found_for(16), source=0)
    do s = 1, part%n_element_sets
      call self%members(state, part%element_set(s), .false., member)
      if (allocated(state%fault)) return
      do i = 1, size(member)
        e = member(i)
        if (last_set(e) == s) cycle
        last_set(e) = s
        c = self%combination(e)
        if (found_for(c) /= s) then
          self%n_combinations = self%n_combinations + 1
          if (self%n_combinations > size(successor)) call double_room(self%parent, self%set, successor, found_for)
          found_for(c) = s
          successor(c) = self%n_combinations
          self%parent(self%n_combinations) = c
          self%set(self%n_combinations) = s
        end if
        self%combination(e) = successor(c)
      end do
    end do
  end subroutine combine_sets

  !> Double the room of lists.
  subroutine double_room(a, b, c, d)
    integer, allocatable, intent(inout) :: a(:), b(:), c(:), d(:)  !! The lists (room); zeros are added.
    integer, allocatable :: zero(:)
    allocate (zero(size(a)), source=0)
    a = [a, zero]
    b = [b, zero]
    c = [c, zero]
    d = [d, zero]
  end subroutine double_room

  !> Sets of a combination, ascending (n_sets).
  pure function numbering_sets_of(self, combination) result(set)
    class(inp_numbering_t), intent(in) :: self
    integer, intent(in) :: combination  !! The combination.
    integer, allocatable :: set(:)
    integer :: c
    allocate (set(0))
    c = combination
    do while (c > 1)
      set = [self%set(c), set]
      c = self%parent(c)
    end do
  end function numbering_sets_of
end module dotyk_mesh_inp_numbering
