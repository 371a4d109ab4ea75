!> A picture of the faces of CAD files with their numbers: facets in a file for ParaView and dotyk-render.
module dotyk_driver_face_drawing
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: face_drawing_t  !! Facets so far, each with points of its own.
    integer :: n_points = 0, n_facets = 0  !! Number of points and facets.
    real(dp), allocatable :: x(:, :)  !! The points (3, room) [length].
    integer, allocatable :: facet(:, :)  !! Corners, number of the face and of the body of each facet (3, room).
  contains
    procedure :: add => drawing_add
    procedure :: write => drawing_write
  end type face_drawing_t

contains

  !> Add a face.
  subroutine drawing_add(self, x, surface, face, body)
    class(face_drawing_t), intent(inout) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The face.
    integer, intent(in) :: face, body  !! Its number, and that of the body.
    type(element_kind_t) :: kind
    real(dp), allocatable :: larger(:, :)
    integer, allocatable :: more(:, :)
    integer :: f, n, room
    if (.not. allocated(self%x)) allocate (self%x(3, 0), self%facet(3, 0))
    room = self%n_facets + surface%n_facets
    if (room > size(self%facet, 2)) then
      room = 2*room
      allocate (larger(3, 4*room), more(3, room))
      larger(:, :self%n_points) = self%x(:, :self%n_points)
      more(:, :self%n_facets) = self%facet(:, :self%n_facets)
      call move_alloc(larger, self%x)
      call move_alloc(more, self%facet)
    end if
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      n = kind%n_corners
      self%x(:, self%n_points + 1:self%n_points + n) = x(:, surface%node(:n, f))
      self%n_points = self%n_points + n
      self%n_facets = self%n_facets + 1
      self%facet(:, self%n_facets) = [n, face, body]
    end do
  end subroutine drawing_add

  !> Write the file.
  subroutine drawing_write(self, path, written)
    class(face_drawing_t), intent(in) :: self
    character(*), intent(in) :: path  !! Path of the file; it is replaced.
    logical, intent(out) :: written  !! Whether it could be written.
    integer, parameter :: type_of(3:4) = [5, 9]  !! Cell types of VTK: triangle and quadrilateral.
    integer :: unit, status, i, n
    integer, allocatable :: offset(:)
    open (newunit=unit, file=path, action='write', status='replace', iostat=status)
    written = status == 0
    if (.not. written) return
    allocate (offset(self%n_facets))
    n = 0
    do i = 1, self%n_facets
      n = n + self%facet(1, i)
      offset(i) = n
    end do
    call write_line('<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">')
    call write_line('<UnstructuredGrid>')
    call write_line('<Piece NumberOfPoints="'//to_text(self%n_points)//'" NumberOfCells="'// &
                    to_text(self%n_facets)//'">')
    call write_line('<CellData>')
    call write_integers('face', self%facet(2, :self%n_facets))
    call write_integers('body', self%facet(3, :self%n_facets))
    call write_line('</CellData>')
    call write_line('<Points>')
    call write_line('<DataArray type="Float64" Name="Points" NumberOfComponents="3" format="ascii">')
    write (unit, '(3es18.9)', iostat=status) self%x(:, :self%n_points)
    written = written .and. status == 0
    call write_line('</DataArray>')
    call write_line('</Points>')
    call write_line('<Cells>')
    call write_integers('connectivity', [(i, i=0, self%n_points - 1)])
    call write_integers('offsets', offset)
    call write_integers('types', type_of(self%facet(1, :self%n_facets)))
    call write_line('</Cells>')
    call write_line('</Piece>')
    call write_line('</UnstructuredGrid>')
    call write_line('</VTKFile>')
    close (unit, iostat=status)
    written = written .and. status == 0

  contains

    !> Write a line.
    subroutine write_line(text)
      character(*), intent(in) :: text  !! The line.
      integer :: fault
      write (unit, '(a)', iostat=fault) text
      written = written .and. fault == 0
    end subroutine write_line

    !> Write an array.
    subroutine write_integers(name, value)
      character(*), intent(in) :: name  !! Its name.
      integer, intent(in) :: value(:)  !! Its values (n).
      integer :: fault
      call write_line('<DataArray type="Int32" Name="'//name//'" format="ascii">')
      write (unit, '(12(i0, 1x))', iostat=fault) value
      written = written .and. fault == 0
      call write_line('</DataArray>')
    end subroutine write_integers
  end subroutine drawing_write
end module dotyk_driver_face_drawing
