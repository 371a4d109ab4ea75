!> All faces of the elements of a body, and which of them are the same.
!>
!> Faces are sorted into buckets by their lowest corner and compared within each bucket: O(number of elements), without
!> hashing.
module dotyk_mesh_element_faces
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> Faces of all elements, sorted by their lowest corners; those with the same lowest corner by their elements.
  type, public :: element_faces_t
    integer :: n = 0  !! Number of faces; each counts once for each of its elements.
    integer, allocatable :: block(:)  !! Block of the element of each face (n).
    integer, allocatable :: element(:)  !! Element of each face in its block (n).
    integer, allocatable :: face(:)  !! Number of each face in its element (n).
    integer, allocatable :: first(:)  !! The first of the faces with the same corners, the face itself included (n).
    integer, allocatable :: times(:)  !! At the first of equal faces their number, at the others 0 (n).
  contains
    procedure :: find => faces_find
  end type element_faces_t

  integer, parameter :: n_others = 3  !! Corners of a face beside the lowest one.

  public :: corners_of

contains

  !> Find the faces of a body.
  subroutine faces_find(self, mesh)
    class(element_faces_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    integer, allocatable :: start(:), key(:, :)
    call sort_faces(mesh, start, self%block, self%element, self%face, key)
    self%n = size(self%block)
    call compare_faces(start, key, self%first, self%times)
  end subroutine faces_find

  !> All faces of all elements, sorted by their lowest corners.
  subroutine sort_faces(mesh, start, block, element, face, key)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    !> Faces with lowest corner v are start(v) .. start(v+1)-1 (n_nodes + 1).
    integer, allocatable, intent(out) :: start(:)
    integer, allocatable, intent(out) :: block(:)  !! Block of the element of each face (n_faces).
    integer, allocatable, intent(out) :: element(:)  !! Element of each face in its block (n_faces).
    integer, allocatable, intent(out) :: face(:)  !! Number of each face in its element (n_faces).
    !> The other corners of each face, ascending, padded with 0 in front (n_others, n_faces).
    integer, allocatable, intent(out) :: key(:, :)
    type(element_kind_t) :: kind
    integer, allocatable :: next(:)
    integer :: b, e, f, v, n, pass, low, corners(6), corner(4, 6)
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      n = n + kind%n_faces*size(mesh%block(b)%tag)
    end do
    allocate (start(mesh%n_nodes() + 1), next(mesh%n_nodes()), block(n), element(n), face(n), key(n_others, n))
    next = 0
    do pass = 1, 2
      do b = 1, size(mesh%block)
        kind = element_kind(mesh%block(b)%kind)
        do f = 1, kind%n_faces
          corners(f) = corners_of(kind%face_kind(f))
          corner(1:corners(f), f) = kind%face_node(1:corners(f), f)
        end do
        associate (node => mesh%block(b)%node)
          do e = 1, size(node, 2)
            do f = 1, kind%n_faces
              low = minval(node(corner(1:corners(f), f), e))
              if (pass == 1) then
                next(low) = next(low) + 1
                cycle
              end if
              n = next(low)
              next(low) = n + 1
              block(n) = b
              element(n) = e
              face(n) = f
              call other_corners(node(corner(1:corners(f), f), e), low, key(:, n))
            end do
          end do
        end associate
      end do
      if (pass == 2) exit
      start(1) = 1
      do v = 1, size(next)
        start(v + 1) = start(v) + next(v)
        next(v) = start(v)
      end do
    end do
  end subroutine sort_faces

  !> Number of corners of a facet.
  pure integer function corners_of(facet_kind) result(n)
    integer, intent(in) :: facet_kind  !! Element kind of the facet.
    type(element_kind_t) :: kind
    kind = element_kind(facet_kind)
    n = kind%n_corners
  end function corners_of

  !> Corners of a face without the lowest one, ascending, padded with 0 in front.
  pure subroutine other_corners(corner, low, key)
    integer, intent(in) :: corner(:)  !! Corners (2 to 4).
    integer, intent(in) :: low  !! The lowest of them.
    integer, intent(out) :: key(n_others)  !! The others (n_others).
    integer :: i, j
    key = 0
    do i = 1, size(corner)
      if (corner(i) == low) cycle
      ! Insert from the left: zeros and smaller numbers move to the front.
      j = 1
      do while (j < n_others)
        if (key(j + 1) >= corner(i)) exit
        key(j) = key(j + 1)
        j = j + 1
      end do
      key(j) = corner(i)
    end do
  end subroutine other_corners

  !> Compare the faces of each bucket.
  subroutine compare_faces(start, key, first, times)
    integer, intent(in) :: start(:)  !! First face of each bucket (n_nodes + 1).
    integer, intent(in) :: key(:, :)  !! Other corners of each face (n_others, n_faces).
    integer, allocatable, intent(out) :: first(:)  !! The first of the faces with the same corners (n_faces).
    integer, allocatable, intent(out) :: times(:)  !! Their number there, 0 at the others (n_faces).
    integer :: v, i, j
    allocate (first(size(key, 2)), times(size(key, 2)), source=0)
    do v = 1, size(start) - 1
      do i = start(v), start(v + 1) - 1
        if (first(i) > 0) cycle
        first(i) = i
        times(i) = 1
        do j = i + 1, start(v + 1) - 1
          if (key(n_others, j) /= key(n_others, i)) cycle
          if (any(key(:, j) /= key(:, i))) cycle
          first(j) = i
          times(i) = times(i) + 1
        end do
      end do
    end do
  end subroutine compare_faces
end module dotyk_mesh_element_faces
