!> Element types of gmsh, supported or not: numbers of nodes and names. A reader must know the size of elements that it
!> skips.
module dotyk_mesh_gmsh_type
  implicit none
  private
  public :: gmsh_type_nodes, gmsh_type_name

  integer, parameter, public :: gmsh_point = 15  !! Type number of a point, which is never kept.

  type :: gmsh_type_t  !! Element type of gmsh.
    integer :: number  !! Type number.
    integer :: n_nodes  !! Number of nodes.
    integer :: dimension  !! Dimension.
    character(34) :: name  !! Name, for messages.
  end type gmsh_type_t

  !> The types of the gmsh reference manual (section "MSH file format"), except those of order 5 and more.
  type(gmsh_type_t), parameter :: types(*) = [ &
                                  gmsh_type_t(1, 2, 1, 'line with 2 nodes'), &
                                  gmsh_type_t(2, 3, 2, 'triangle with 3 nodes'), &
                                  gmsh_type_t(3, 4, 2, 'quadrangle with 4 nodes'), &
                                  gmsh_type_t(4, 4, 3, 'tetrahedron with 4 nodes'), &
                                  gmsh_type_t(5, 8, 3, 'hexahedron with 8 nodes'), &
                                  gmsh_type_t(6, 6, 3, 'prism with 6 nodes'), &
                                  gmsh_type_t(7, 5, 3, 'pyramid with 5 nodes'), &
                                  gmsh_type_t(8, 3, 1, 'line with 3 nodes'), &
                                  gmsh_type_t(9, 6, 2, 'triangle with 6 nodes'), &
                                  gmsh_type_t(10, 9, 2, 'quadrangle with 9 nodes'), &
                                  gmsh_type_t(11, 10, 3, 'tetrahedron with 10 nodes'), &
                                  gmsh_type_t(12, 27, 3, 'hexahedron with 27 nodes'), &
                                  gmsh_type_t(13, 18, 3, 'prism with 18 nodes'), &
                                  gmsh_type_t(14, 14, 3, 'pyramid with 14 nodes'), &
                                  gmsh_type_t(15, 1, 0, 'point'), &
                                  gmsh_type_t(16, 8, 2, 'quadrangle with 8 nodes'), &
                                  gmsh_type_t(17, 20, 3, 'hexahedron with 20 nodes'), &
                                  gmsh_type_t(18, 15, 3, 'prism with 15 nodes'), &
                                  gmsh_type_t(19, 13, 3, 'pyramid with 13 nodes'), &
                                  gmsh_type_t(20, 9, 2, 'incomplete triangle with 9 nodes'), &
                                  gmsh_type_t(21, 10, 2, 'triangle with 10 nodes'), &
                                  gmsh_type_t(22, 12, 2, 'incomplete triangle with 12 nodes'), &
                                  gmsh_type_t(23, 15, 2, 'triangle with 15 nodes'), &
                                  gmsh_type_t(26, 4, 1, 'line with 4 nodes'), &
                                  gmsh_type_t(27, 5, 1, 'line with 5 nodes'), &
                                  gmsh_type_t(29, 20, 3, 'tetrahedron with 20 nodes'), &
                                  gmsh_type_t(30, 35, 3, 'tetrahedron with 35 nodes'), &
                                  gmsh_type_t(36, 16, 2, 'quadrangle with 16 nodes'), &
                                  gmsh_type_t(37, 25, 2, 'quadrangle with 25 nodes'), &
                                  gmsh_type_t(90, 40, 3, 'prism with 40 nodes'), &
                                  gmsh_type_t(92, 64, 3, 'hexahedron with 64 nodes'), &
                                  gmsh_type_t(93, 125, 3, 'hexahedron with 125 nodes'), &
                                  gmsh_type_t(118, 30, 3, 'pyramid with 30 nodes')]

contains

  !> Index of a type in the table, 0 if it is unknown.
  pure integer function index_of(number) result(index)
    integer, intent(in) :: number  !! Type number of gmsh.
    do index = 1, size(types)
      if (types(index)%number == number) return
    end do
    index = 0
  end function index_of

  !> Number of nodes of a type, 0 if it is unknown.
  pure integer function gmsh_type_nodes(number) result(n_nodes)
    integer, intent(in) :: number  !! Type number of gmsh.
    integer :: index
    index = index_of(number)
    n_nodes = 0
    if (index > 0) n_nodes = types(index)%n_nodes
  end function gmsh_type_nodes

  !> Name of a type.
  pure function gmsh_type_name(number) result(name)
    integer, intent(in) :: number  !! Type number of gmsh.
    character(:), allocatable :: name  !! Name.
    integer :: index
    index = index_of(number)
    name = 'unknown type'
    if (index > 0) name = trim(types(index)%name)
  end function gmsh_type_name
end module dotyk_mesh_gmsh_type
