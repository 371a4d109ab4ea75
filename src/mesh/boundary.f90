!> The whole boundary of a body: the faces of its elements that belong to one element only.
!>
!> Faces are sorted into buckets by their lowest corner and compared within each bucket: O(number of elements), without
!> hashing.
module dotyk_mesh_boundary
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, max_facet_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: extract_boundary

  !> Corners of a face beside the lowest one.
  integer, parameter :: n_others = 3

contains

  !> All facets of the boundary of a body, oriented outward, in the order of the elements.
  subroutine extract_boundary(mesh, surface)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> The boundary; it has no name and no tags.
    type(surface_t), intent(out) :: surface
    integer, allocatable :: start(:), block(:), element(:), face(:), key(:, :)
    logical, allocatable :: single(:)
    type(element_kind_t) :: kind
    integer :: b, e, f, i, n, n_nodes
    call sort_faces(mesh, start, block, element, face, key)
    allocate (single(size(block)))
    call find_single(start, key, single)
    n = count(single)
    surface%name = ''
    surface%dimension = mesh%dimension
    surface%order_elevated = mesh%order_elevated
    surface%n_facets = n
    allocate (surface%kind(n), surface%node(max_facet_nodes, n), surface%block(n), surface%element(n))
    surface%node = 0
    n = 0
    b = 0
    do i = 1, size(block)
      if (.not. single(i)) cycle
      if (block(i) /= b) kind = element_kind(mesh%block(block(i))%kind)
      b = block(i)
      e = element(i)
      f = face(i)
      n = n + 1
      n_nodes = kind_nodes(kind%face_kind(f))
      surface%kind(n) = kind%face_kind(f)
      surface%node(1:n_nodes, n) = mesh%block(b)%node(kind%face_node(1:n_nodes, f), e)
      surface%block(n) = b
      surface%element(n) = e
    end do
  end subroutine extract_boundary

  !> All faces of all elements, sorted by their lowest corners.
  subroutine sort_faces(mesh, start, block, element, face, key)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Faces with lowest corner v are start(v) .. start(v+1)-1 (n_nodes + 1).
    integer, allocatable, intent(out) :: start(:)
    !> Block of the element of each face (n_faces).
    integer, allocatable, intent(out) :: block(:)
    !> Element of each face in its block (n_faces).
    integer, allocatable, intent(out) :: element(:)
    !> Number of each face in its element (n_faces).
    integer, allocatable, intent(out) :: face(:)
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
    !> Element kind of the facet.
    integer, intent(in) :: facet_kind
    type(element_kind_t) :: kind
    kind = element_kind(facet_kind)
    n = kind%n_corners
  end function corners_of

  !> Corners of a face without the lowest one, ascending, padded with 0 in front.
  pure subroutine other_corners(corner, low, key)
    !> Corners (2 to 4).
    integer, intent(in) :: corner(:)
    !> The lowest of them.
    integer, intent(in) :: low
    !> The others (n_others).
    integer, intent(out) :: key(n_others)
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

  !> Faces without an equal one.
  subroutine find_single(start, key, single)
    !> First face of each bucket (n_nodes + 1).
    integer, intent(in) :: start(:)
    !> Other corners of each face (n_others, n_faces).
    integer, intent(in) :: key(:, :)
    !> Whether no other face has the same corners (n_faces).
    logical, intent(out) :: single(:)
    integer :: v, i, j
    single = .true.
    do v = 1, size(start) - 1
      do i = start(v), start(v + 1) - 1
        if (.not. single(i)) cycle
        do j = i + 1, start(v + 1) - 1
          if (key(n_others, j) /= key(n_others, i)) cycle
          if (any(key(:, j) /= key(:, i))) cycle
          single(i) = .false.
          single(j) = .false.
          exit
        end do
      end do
    end do
  end subroutine find_single
end module dotyk_mesh_boundary
