!> Element types of Abaqus and CalculiX: which shape they are, their order of nodes, and their faces S1, S2, ...
!>
!> Source: CalculiX CrunchiX USER'S MANUAL, chapter "Element types"; the same in the Abaqus Analysis User's Guide,
!> "Three-dimensional solid element library". Variants (reduced integration R, incompatible modes I, hybrid H,
!> modified M, and others) are of the same shape; how elements are integrated is no matter of the mesh.
module dotyk_mesh_inp_element_type
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_hex20, element_hex8, element_kind, element_kind_t, element_line2, &
    element_line3, element_prism15, element_prism6, element_pyramid5, element_quad4, element_quad8, element_tet10, &
    element_tet4, element_tri3, element_tri6, kind_dimension, kind_nodes, max_element_nodes, &
    reference_nodes
  implicit none
  private
  public :: find_inp_type, face_of_label

  type, public :: inp_type_t  !! One element type.
    integer :: kind = 0  !! Element kind of `dotyk_mesh_element`; 0 for a type that is not read.
    integer :: n_nodes = 0  !! Number of nodes.
    integer :: order(max_element_nodes) = 0  !! Node i of the kind is node order(i) of the type (n_nodes).
  end type inp_type_t

  character(*), parameter :: variants = 'rihmstpe'  !! Letters of variants of the same shape.

  ! Corners at the ends of the edges that have mid-side nodes, in the order of these nodes.
  integer, parameter :: tet_edge(2, 6) = reshape([1, 2, 2, 3, 3, 1, 1, 4, 2, 4, 3, 4], [2, 6])
  integer, parameter :: hex_edge(2, 12) = reshape([1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 6, 7, 7, 8, 8, 5, &
                                                   1, 5, 2, 6, 3, 7, 4, 8], [2, 12])
  integer, parameter :: prism_edge(2, 9) = reshape([1, 2, 2, 3, 3, 1, 4, 5, 5, 6, 6, 4, 1, 4, 2, 5, 3, 6], [2, 9])
  integer, parameter :: triangle_edge(2, 3) = reshape([1, 2, 2, 3, 3, 1], [2, 3])
  integer, parameter :: quadrilateral_edge(2, 4) = reshape([1, 2, 2, 3, 3, 4, 4, 1], [2, 4])
  ! Corners of the faces S1, S2, ..., padded with 0.
  integer, parameter :: tet_face(4, 4) = reshape([1, 2, 3, 0, 1, 4, 2, 0, 2, 4, 3, 0, 3, 4, 1, 0], [4, 4])
  integer, parameter :: hex_face(4, 6) = reshape([1, 2, 3, 4, 5, 8, 7, 6, 1, 5, 6, 2, 2, 6, 7, 3, 3, 7, 8, 4, &
                                                  4, 8, 5, 1], [4, 6])
  integer, parameter :: prism_face(4, 5) = reshape([1, 2, 3, 0, 4, 6, 5, 0, 1, 4, 5, 2, 2, 5, 6, 3, 3, 6, 4, 1], [4, 5])
  integer, parameter :: pyramid_face(4, 5) = reshape([1, 2, 3, 4, 1, 5, 2, 0, 2, 5, 3, 0, 3, 5, 4, 0, 4, 5, 1, 0], &
                                                     [4, 5])

contains

  !> Find a type by its name.
  pure type(inp_type_t) function find_inp_type(name) result(type)
    character(*), intent(in) :: name  !! Name in small letters, as c3d20r.
    integer :: last
    select case (name)
    case ('t3d2')
      call set_kind(element_line2, reshape([integer ::], [2, 0]))
      return
    case ('t3d3')
      call set_kind(element_line3, reshape([1, 2], [2, 1]))
      return
    end select
    last = 3 + verify(name(min(4, len(name) + 1):)//' ', '0123456789') - 1
    if (len(name) < 4 .or. verify(name(last + 1:), variants) > 0) return
    select case (name(:last))
    case ('c3d4')
      call set_kind(element_tet4, reshape([integer ::], [2, 0]))
    case ('c3d10')
      call set_kind(element_tet10, tet_edge)
    case ('c3d8')
      call set_kind(element_hex8, reshape([integer ::], [2, 0]))
    case ('c3d20')
      call set_kind(element_hex20, hex_edge)
    case ('c3d6')
      call set_kind(element_prism6, reshape([integer ::], [2, 0]))
    case ('c3d15')
      call set_kind(element_prism15, prism_edge)
    case ('c3d5')
      call set_kind(element_pyramid5, reshape([integer ::], [2, 0]))
    case ('cps3', 'cpe3', 'cax3')
      call set_kind(element_tri3, reshape([integer ::], [2, 0]))
    case ('cps6', 'cpe6', 'cax6')
      call set_kind(element_tri6, triangle_edge)
    case ('cps4', 'cpe4', 'cax4')
      call set_kind(element_quad4, reshape([integer ::], [2, 0]))
    case ('cps8', 'cpe8', 'cax8')
      call set_kind(element_quad8, quadrilateral_edge)
    end select

  contains

    !> Set the kind and the order of the nodes: corners are the same, mid-side nodes are found by their edges.
    pure subroutine set_kind(kind, edge)
      integer, intent(in) :: kind  !! Element kind.
      !> Corners of the edges in the order of the mid-side nodes of the type (2, n_edges).
      integer, intent(in) :: edge(:, :)
      real(dp) :: xi(kind_dimension(kind), kind_nodes(kind))
      integer :: i, k
      type%kind = kind
      type%n_nodes = kind_nodes(kind)
      type%order(:type%n_nodes) = [(i, i=1, type%n_nodes)]
      call reference_nodes(kind, xi)
      k = type%n_nodes - size(edge, 2)
      do i = 1, size(edge, 2)
        type%order(k + minloc(sum(abs(xi(:, k + 1:) - spread((xi(:, edge(1, i)) + xi(:, edge(2, i)))/2, 2, &
                                                             size(edge, 2))), dim=1), dim=1)) = k + i
      end do
    end subroutine set_kind
  end function find_inp_type

  !> Face of a kind that a label S1, S2, ... names: the one with the same corners; 0 where there is none.
  pure integer function face_of_label(kind, label) result(face)
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: label  !! Number of the label.
    type(element_kind_t) :: properties, of_face
    integer :: corner(4), i
    properties = element_kind(kind)
    corner = 0
    face = 0
    if (label > properties%n_faces) return
    select case (properties%corner_kind)
    case (element_tet4)
      corner = tet_face(:, label)
    case (element_hex8)
      corner = hex_face(:, label)
    case (element_prism6)
      corner = prism_face(:, label)
    case (element_pyramid5)
      corner = pyramid_face(:, label)
    case (element_tri3)
      corner(:2) = triangle_edge(:, label)
    case (element_quad4)
      corner(:2) = quadrilateral_edge(:, label)
    end select
    do face = 1, properties%n_faces
      of_face = element_kind(properties%face_kind(face))
      if (of_face%n_corners /= count(corner > 0)) cycle
      if (all([(any(corner == properties%face_node(i, face)), i=1, of_face%n_corners)])) return
    end do
    face = 0
  end function face_of_label
end module dotyk_mesh_inp_element_type
