!> What is read of a mesh file: all of it, or volumes of some names with all surfaces, so that no process need hold the
!> volumes of all bodies.
module dotyk_mesh_mesh_selection
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: text_t
  implicit none
  private

  type, public :: mesh_selection_t  !! What is read of a mesh file.
    logical :: everything = .true.  !! Whether all is read; the other components have no meaning then.
    !> Dimension of the volumes: that of space. Elements of lower dimension than surfaces are not read.
    integer :: dimension = 3
    !> Names of physical groups: their elements are read, and all elements of surfaces (n_names).
    type(text_t), allocatable :: volume(:)
    !> Number of shares into which the elements of the volumes are divided: partitions of a partitioned file (`gmsh
    !> -part N`), or else elements that follow each other.
    integer :: n_shares = 1
    integer :: share = 0  !! The share that is read, from 0.
    !> Whether the elements of the volumes are counted only (`n_in_file` of their blocks): nothing else is read.
    logical :: counts_only = .false.
  contains
    procedure :: has_volume => selection_has_volume
    procedure :: limits => selection_limits
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

  !> The share of n elements that follow each other in the file: those after number `first` up to number `last`.
  pure subroutine selection_limits(self, n, partition, first, last)
    class(mesh_selection_t), intent(in) :: self
    integer(int64), intent(in) :: n  !! Number of elements.
    integer, intent(in) :: partition  !! Their partition, from 1; 0 where the file is not partitioned.
    integer(int64), intent(out) :: first  !! Number of the elements before the share.
    integer(int64), intent(out) :: last  !! The last element of the share.
    if (self%counts_only) then
      first = 0
      last = 0
    else if (partition > 0) then
      first = 0
      last = merge(n, 0_int64, mod(partition - 1, self%n_shares) == self%share)
    else
      first = n*self%share/self%n_shares
      last = n*(self%share + 1)/self%n_shares
    end if
  end subroutine selection_limits
end module dotyk_mesh_mesh_selection
