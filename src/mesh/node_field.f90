!> Fields of the nodes in mesh files, such as temperatures, by their names.
module dotyk_mesh_node_field
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_files, only: is_inp_file, is_vtu_file
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: lower, quoted
  use dotyk_mesh_gmsh_node_data, only: read_node_data
  use dotyk_mesh_inp_reader, only: read_deck
  use dotyk_mesh_inp_state, only: inp_state_t
  use dotyk_mesh_node_values, only: node_values_t
  use dotyk_mesh_vtu, only: read_point_array
  implicit none
  private
  public :: read_node_field

contains

  !> Read a field: an array of the points of a .vtu file, $NodeData of a .msh file, temperatures of a deck.
  subroutine read_node_field(file, name, values, error)
    character(*), intent(in) :: file  !! Path of the mesh.
    character(*), intent(in) :: name  !! Name of the field.
    type(node_values_t), intent(out) :: values  !! The values by the tags of the nodes [any].
    !> Set where the file cannot be read, has no such field, or is of another kind.
    type(error_t), allocatable, intent(out) :: error
    type(inp_state_t) :: state
    real(dp), allocatable :: at_point(:)
    integer(int64) :: i
    if (is_vtu_file(file)) then
      call read_point_array(file, name, at_point, error)
      if (allocated(error)) return
      do i = 1, size(at_point, kind=int64)
        call values%set(i, at_point(i))
      end do
    else if (is_inp_file(file)) then
      call read_deck(file, state, error, name)
      if (.not. allocated(error)) call state%temperature%finish(file, values, error)
    else if (lower(file(max(1, len(file) - 3):)) == '.msh') then
      call read_node_data(file, name, values, error)
    else
      call set_error(error, 'field is read from .msh, .inp and .vtu files, and the mesh is '//quoted(file)// &
                     ': write mesh and temperature as one such file', exit_bad_input)
    end if
  end subroutine read_node_field
end module dotyk_mesh_node_field
