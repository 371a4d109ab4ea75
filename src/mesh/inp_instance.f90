!> Instances of the parts of an Abaqus deck: copies of a part with names of their own, translated and rotated.
!>
!> Names of the sets and surfaces of a part get the name of the instance and a dot in front, as Abaqus writes them; the
!> instance itself is a set of its elements. Numbers get an offset: 2000017 is number 17 of the second instance.
module dotyk_mesh_inp_instance
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_rotation, only: rotation_matrix
  use dotyk_base_text, only: lower, text_t
  use dotyk_mesh_element, only: kind_nodes
  use dotyk_mesh_inp_part, only: add_entry, add_member, add_set, inp_part_t, inp_set_t
  implicit none
  private
  public :: add_instance

  type, public :: instance_list_t  !! Names and offsets of the instances.
    integer :: n = 0  !! Number of instances.
    type(text_t), allocatable :: key(:)  !! Their names in small letters (room).
    integer(int64), allocatable :: offset(:)  !! What is added to the numbers of each (room).
  contains
    procedure :: add => list_add
    procedure :: offset_of => list_offset_of
  end type instance_list_t

contains

  !> Add an instance.
  subroutine list_add(self, key, step)
    class(instance_list_t), intent(inout) :: self
    character(*), intent(in) :: key  !! Its name in small letters.
    integer(int64), intent(in) :: step  !! A power of ten above all numbers of the parts.
    type(text_t), allocatable :: larger(:)
    integer(int64), allocatable :: larger_offset(:)
    integer :: i
    if (.not. allocated(self%key)) allocate (self%key(8), self%offset(8))
    if (self%n == size(self%key)) then
      allocate (larger(2*self%n), larger_offset(2*self%n))
      do i = 1, self%n
        call move_alloc(self%key(i)%s, larger(i)%s)
      end do
      larger_offset(:self%n) = self%offset
      call move_alloc(larger, self%key)
      call move_alloc(larger_offset, self%offset)
    end if
    self%n = self%n + 1
    self%key(self%n)%s = key
    self%offset(self%n) = self%n*step
  end subroutine list_add

  !> What is added to the numbers of an instance; 0 where there is none of the name.
  pure integer(int64) function list_offset_of(self, key) result(offset)
    class(instance_list_t), intent(in) :: self
    character(*), intent(in) :: key  !! Its name in small letters.
    integer :: i
    offset = 0
    do i = 1, self%n
      if (self%key(i)%s == key) offset = self%offset(i)
    end do
  end function list_offset_of

  !> Add an instance of a part to the model.
  subroutine add_instance(model, part, name, offset, placement, n_placement)
    type(inp_part_t), intent(inout) :: model  !! The model.
    type(inp_part_t), intent(in) :: part  !! The part.
    character(*), intent(in) :: name  !! Name of the instance.
    integer(int64), intent(in) :: offset  !! What is added to its numbers.
    !> Translation; two points of the axis and the angle of a rotation after it (10) [length; degrees].
    real(dp), intent(in) :: placement(:)
    integer, intent(in) :: n_placement  !! How many of these are given; more than 3 where there is a rotation.
    real(dp) :: rotation(3, 3), x(3)
    integer(int64) :: node(27)
    integer :: i, j, k, set
    rotation = 0
    if (n_placement > 3) rotation = rotation_matrix(placement(7:9) - placement(4:6), placement(10))
    do i = 1, part%n_nodes
      x = part%x(:, i) + placement(:3)
      if (n_placement > 3) x = placement(4:6) + matmul(rotation, x - placement(4:6))
      call model%add_node(part%node_tag(i) + offset, x, part%node_line(i))
    end do
    call add_set(model%element_set, model%n_element_sets, name, lower(name), set)
    do i = 1, part%n_elements
      k = kind_nodes(part%kind(i))
      node(:k) = part%connectivity(part%first(i):part%first(i) + k - 1) + offset
      call model%add_element(part%element_tag(i) + offset, part%kind(i), node(:k), part%element_line(i))
      call add_member(model%element_set(set), part%element_tag(i) + offset, 0_int64)
    end do
    do i = 1, part%n_node_sets
      call add_set(model%node_set, model%n_node_sets, name//'.'//part%node_set(i)%name, &
                   lower(name)//'.'//part%node_set(i)%key, set)
      call copy_members(part%node_set(i), model%node_set(set))
    end do
    do i = 1, part%n_element_sets
      call add_set(model%element_set, model%n_element_sets, name//'.'//part%element_set(i)%name, &
                   lower(name)//'.'//part%element_set(i)%key, set)
      call copy_members(part%element_set(i), model%element_set(set))
    end do
    do i = 1, part%n_surfaces
      associate (from => part%surface(i))
        call model%add_surface(name//'.'//from%name, lower(name)//'.'//from%key, from%of_nodes)
        do j = 1, from%n
          if (len(from%set(j)%s) > 0) then
            call add_entry(model%surface(model%n_surfaces), lower(name)//'.'//from%set(j)%s, 0_int64, from%face(j), &
                           from%line(j))
          else
            call add_entry(model%surface(model%n_surfaces), '', from%number(j) + offset, from%face(j), from%line(j))
          end if
        end do
      end associate
    end do

  contains

    !> Copy the members of a set.
    subroutine copy_members(from, to)
      type(inp_set_t), intent(in) :: from  !! Set of the part.
      type(inp_set_t), intent(inout) :: to  !! Set of the model.
      do j = 1, from%n
        call add_member(to, from%member(j) + offset, from%line(j))
      end do
    end subroutine copy_members
  end subroutine add_instance
end module dotyk_mesh_inp_instance
