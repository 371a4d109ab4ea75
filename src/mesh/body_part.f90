!> Parts of the mesh of one body, for bodies that are distributed over ranks.
!>
!> Each element has one owner. A rank holds its own elements and one layer of ghost elements around them, so that it has
!> all elements of its own nodes. It has all nodes on the boundary of the body, whoever owns them, as contact surfaces
!> are the same on all ranks.
module dotyk_mesh_body_part
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  type, public :: part_elements_t  !! Elements of one block of a part.
    logical, allocatable :: own(:)  !! Whether the rank owns each element; the others are ghosts (n_elements).
    integer, allocatable :: whole(:)  !! Number of each element in its block of the whole body, ascending (n_elements).
    integer :: n_whole = 0  !! Number of elements in the block of the whole body.
  end type part_elements_t

  type, public :: body_part_t  !! The part of one body's mesh that one rank holds.
    integer :: rank = 0  !! This rank, from 0.
    integer :: n_ranks = 1  !! Number of ranks.
    !> Own elements, ghost elements, their nodes and all nodes on the boundary of the body. The blocks are those of the
    !> whole body, maybe empty; elements and nodes are in the order of the whole body.
    type(body_mesh_t) :: mesh
    type(part_elements_t), allocatable :: elements(:)  !! Elements of the part (n_blocks).
    integer :: n_whole_nodes = 0  !! Number of nodes of the whole body.
    integer, allocatable :: whole_node(:)  !! Number of each node in the whole body, ascending (n_nodes).
    !> Owner of each node: the lowest rank that has an own element with it (n_nodes).
    integer, allocatable :: node_rank(:)
    integer :: n_own_nodes = 0  !! Number of nodes that this rank owns.
    !> The nodes of rank r have the global numbers first_node(r) .. first_node(r + 1) - 1, from 0 (0:n_ranks).
    integer, allocatable :: first_node(:)
    !> Global number of each node, from 0: by owner, and then by the number in the whole body (n_nodes).
    integer, allocatable :: global_node(:)
  contains
    procedure :: n_own_elements => part_n_own_elements
  end type body_part_t

  !> Layers of elements that a rank holds around its own ones: recovered strains at the nodes of its elements need
  !> those of all vertices around them.
  integer, parameter, public :: n_ghost_layers = 2

  public :: element_centres, node_owners

contains

  !> Number of elements that the rank owns.
  pure integer function part_n_own_elements(self) result(n)
    class(body_part_t), intent(in) :: self
    integer :: b
    n = sum([(count(self%elements(b)%own), b=1, size(self%elements))])
  end function part_n_own_elements

  !> Mean of the corners of all elements, and their weights.
  subroutine element_centres(mesh, centre, weight)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    !> Mean of the corners of each element, counted through all blocks (dimension, n_elements) [length].
    real(dp), allocatable, intent(out) :: centre(:, :)
    integer, allocatable, intent(out) :: weight(:)  !! Number of nodes of each element (n_elements).
    type(element_kind_t) :: kind
    integer :: b, d, e, n
    allocate (centre(mesh%dimension, mesh%n_elements()), weight(mesh%n_elements()))
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      associate (node => mesh%block(b)%node)
        do e = 1, size(node, 2)
          do d = 1, mesh%dimension
            centre(d, n + e) = sum(mesh%x(d, node(:kind%n_corners, e)))/kind%n_corners
          end do
        end do
        weight(n + 1:n + size(node, 2)) = kind%n_nodes
        n = n + size(node, 2)
      end associate
    end do
  end subroutine element_centres

  !> Owner of each node: the lowest rank that owns an element with it.
  pure subroutine node_owners(mesh, part_of_element, n_ranks, node_rank)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    !> Owner of each element, from 0, counted through all blocks (n_elements).
    integer, intent(in) :: part_of_element(:)
    integer, intent(in) :: n_ranks  !! Number of ranks.
    integer, allocatable, intent(out) :: node_rank(:)  !! Owner of each node; n_ranks where it has no element (n_nodes).
    integer :: b, e, n
    allocate (node_rank(mesh%n_nodes()), source=n_ranks)
    n = 0
    do b = 1, size(mesh%block)
      associate (node => mesh%block(b)%node)
        do e = 1, size(node, 2)
          node_rank(node(:, e)) = min(node_rank(node(:, e)), part_of_element(n + e))
        end do
        n = n + size(node, 2)
      end associate
    end do
  end subroutine node_owners
end module dotyk_mesh_body_part
