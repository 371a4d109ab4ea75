!> What is read of a mesh file: all of it, or volumes of some names with all surfaces, so that no process need hold the
!> volumes of all bodies.
module dotyk_mesh_mesh_selection
  use dotyk_base_text, only: text_t
  implicit none
  private

  type, public :: mesh_selection_t  !! What is read of a mesh file.
    logical :: everything = .true.  !! Whether all is read; the other components have no meaning then.
    !> Dimension of the volumes: that of space. Elements of lower dimension than surfaces are not read.
    integer :: dimension = 3
    !> Names of physical groups: their elements are read, and all elements of surfaces (n_names).
    type(text_t), allocatable :: volume(:)
    !> Whether the elements of the volumes are counted only (`n_in_file` of their blocks): nothing else is read.
    logical :: counts_only = .false.
  contains
    procedure :: has_volume => selection_has_volume
  end type mesh_selection_t

contains

  !> Whether the elements of a physical group of the dimension of space are read.
  pure logical function selection_has_volume(self, name) result(has)
    class(mesh_selection_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the group.
    integer :: i
    has = .false.
    do i = 1, size(self%volume)
      has = has .or. self%volume(i)%s == name
    end do
  end function selection_has_volume
end module dotyk_mesh_mesh_selection
