!> What is wrong with the faces and elements of a body of which each rank has a share only: faces of more than two
!> elements, faces with other nodes on either side, repeated elements; and the number of its parts and pieces.
!>
!> The way: `boundary_candidates_t`; `pack_faults` on each rank; the arrays of all ranks side by side give the same
!> faults on all of them (`unpack`). What is sent is short where nothing is wrong.
module dotyk_mesh_share_faults
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: quoted
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes
  use dotyk_mesh_element_faces, only: corners_of
  use dotyk_mesh_face_faults, only: face_faults_t, face_occurrences_t, face_order, face_signature, judge_faces
  use dotyk_mesh_face_keys, only: max_corners
  use dotyk_mesh_layer_share, only: whole_numbers_t
  use dotyk_mesh_mesh_check, only: find_repeated, refuse_repeated
  implicit none
  private
  public :: pack_faults

  type :: repeated_t  !! Two elements with the same corners, the first such in the order of the elements.
    !> Place of the second of them in the order of the elements; huge where no element is repeated.
    integer(int64) :: order = huge(0_int64)
    integer(int64) :: tag(2) = 0  !! Their tags.
    integer :: kind = 0  !! Their kind.
  end type repeated_t

  type, public :: share_faults_t  !! Faults of a body, the same on all ranks.
    integer :: n_parts = 0  !! Number of unconnected parts.
    integer :: n_pieces = 0  !! Number of pieces that no whole face joins.
    type(face_faults_t) :: faces  !! Faults of faces.
    type(repeated_t), private :: repeated  !! Repeated elements.
  contains
    procedure :: unpack => faults_unpack
    procedure :: check_repeated => faults_check_repeated
  end type share_faults_t

  integer, parameter :: most_corners = 8  !! Greatest number of corners of an element.
  !> Numbers at the head of a rank; of a face: corners, order, signature, tag, position; of an element: block, kind,
  !> order, tag, corners.
  integer, parameter :: head_length = 23, face_length = max_corners + 6, element_length = 4 + most_corners

contains

  !> Pack what a rank knows of faults.
  subroutine pack_faults(own, whole, candidates, packed)
    type(body_mesh_t), intent(in) :: own  !! Elements that the rank owns, and their nodes, maybe among others.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    type(boundary_candidates_t), intent(in) :: candidates  !! Faces of these elements, after `keep_boundary`.
    integer(int64), allocatable, intent(out) :: packed(:)  !! What other ranks must know (any).
    type(face_occurrences_t) :: faces, local
    type(face_faults_t) :: faults
    type(repeated_t) :: repeated
    type(element_kind_t) :: kind
    integer, allocatable :: corner(:, :), here(:), there(:)
    integer :: i, k, n, b, e
    integer(int64) :: tag(2)
    call take_inner_faces(own, whole, candidates, faces, corner)
    here = pack([(i, i=1, candidates%inner%n)], .not. candidates%inner%on_ranks)
    there = pack([(i, i=1, candidates%inner%n)], candidates%inner%on_ranks)
    call choose_faces(faces, here, local)
    call judge_faces(local, faults)
    call find_repeated(own%block, b, e, tag)
    if (b > 0) then
      repeated%order = face_order(b, whole%block(b)%element(e), 0)
      repeated%tag = tag
      repeated%kind = own%block(b)%kind
    end if
    allocate (packed(head_length + face_length*size(there) + element_length*size(candidates%enclosed, 2)))
    packed = 0
    packed(:head_length) = &
      [int([candidates%n_parts, candidates%n_closed_parts, candidates%n_pieces, candidates%n_closed_pieces, &
            faults%n_shared], int64), faults%shared_order, transfer(faults%shared_position, packed), &
       int([faults%n_mixed, merge(1, 0, faults%mixed_kinds)], int64), faults%mixed_order, faults%mixed, &
       transfer(faults%mixed_position, packed), repeated%order, repeated%tag, int(repeated%kind, int64), &
       int([size(there), size(candidates%enclosed, 2)], int64)]
    n = head_length
    do k = 1, size(there)
      i = there(k)
      packed(n + 1:n + face_length) = [int(corner(:, i), int64), faces%order(i), int(faces%signature(i), int64), &
                                       faces%tag(i), transfer(faces%x(:, i), packed)]
      n = n + face_length
    end do
    do k = 1, size(candidates%enclosed, 2)
      b = candidates%enclosed(1, k)
      e = candidates%enclosed(2, k)
      kind = element_kind(own%block(b)%kind)
      packed(n + 1:n + 4) = [int(b, int64), int(own%block(b)%kind, int64), &
                             face_order(b, whole%block(b)%element(e), 0), own%block(b)%tag(e)]
      packed(n + 5:n + 4 + kind%n_corners) = whole%node(own%block(b)%node(:kind%n_corners, e))
      n = n + element_length
    end do
  end subroutine pack_faults

  !> Faces of the rank that may be wrong.
  subroutine take_inner_faces(own, whole, candidates, faces, corner)
    type(body_mesh_t), intent(in) :: own  !! Elements that the rank owns.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    type(boundary_candidates_t), intent(in) :: candidates  !! Faces of these elements.
    type(face_occurrences_t), intent(out) :: faces  !! The faces.
    !> Their corners by their numbers in the whole body, padded with 0 (max_corners, n).
    integer, allocatable, intent(out) :: corner(:, :)
    type(element_kind_t) :: kind
    integer :: i, b, e, f, m, id
    associate (inner => candidates%inner)
      allocate (faces%order(inner%n), faces%signature(inner%n), faces%tag(inner%n), corner(max_corners, inner%n))
      allocate (faces%x(3, inner%n), source=0.0_dp)
      faces%group = inner%group
      do i = 1, inner%n
        b = inner%block(i)
        e = inner%element(i)
        f = inner%face(i)
        kind = element_kind(own%block(b)%kind)
        id = kind%face_kind(f)
        m = corners_of(id)
        associate (node => own%block(b)%node(kind%face_node(:kind_nodes(id), f), e))
          corner(:, i) = 0
          corner(:m, i) = whole%node(node(:m))
          faces%signature(i) = face_signature(id, whole%node(node(m + 1:)))
          faces%x(:own%dimension, i) = own%x(:, node(1))
        end associate
        faces%order(i) = face_order(b, whole%block(b)%element(e), f)
        faces%tag(i) = own%block(b)%tag(e)
      end do
    end associate
  end subroutine take_inner_faces

  !> Some faces of many.
  pure subroutine choose_faces(faces, chosen, some)
    type(face_occurrences_t), intent(in) :: faces  !! The faces.
    integer, intent(in) :: chosen(:)  !! Those that are wanted (n).
    type(face_occurrences_t), intent(out) :: some  !! Those faces.
    some%group = faces%group(chosen)
    some%order = faces%order(chosen)
    some%signature = faces%signature(chosen)
    some%tag = faces%tag(chosen)
    some%x = faces%x(:, chosen)
  end subroutine choose_faces

  !> Put together what all ranks know.
  subroutine faults_unpack(self, packed)
    class(share_faults_t), intent(out) :: self
    integer(int64), intent(in) :: packed(:)  !! The arrays of `pack_faults` of all ranks, one after the other (any).
    type(face_occurrences_t) :: faces
    type(face_faults_t) :: faults
    type(corner_table_t) :: table
    integer, allocatable :: head(:), face(:), element(:), first(:), order(:)
    integer :: i, j, entry
    call find_starts(packed, head, face, element)
    self%n_parts = int(packed(1))
    self%n_pieces = int(packed(3))
    do i = 1, size(head)
      associate (of_rank => packed(head(i) + 1:head(i) + head_length))
        self%n_parts = self%n_parts + int(of_rank(2))
        self%n_pieces = self%n_pieces + int(of_rank(4))
        faults%n_shared = int(of_rank(5))
        faults%shared_order = of_rank(6)
        faults%shared_position = transfer(of_rank(7:9), faults%shared_position)
        faults%n_mixed = int(of_rank(10))
        faults%mixed_kinds = of_rank(11) == 1
        faults%mixed_order = of_rank(12)
        faults%mixed = of_rank(13:14)
        faults%mixed_position = transfer(of_rank(15:17), faults%mixed_position)
        call self%faces%add(faults)
        call take_repeated(self, of_rank(18), of_rank(19:20), int(of_rank(21)))
      end associate
    end do
    allocate (faces%group(size(face)), faces%order(size(face)), faces%signature(size(face)), faces%tag(size(face)), &
              faces%x(3, size(face)))
    call table%init(max_corners, size(face))
    do i = 1, size(face)
      associate (record => packed(face(i) + 1:face(i) + face_length))
        call table%add(int(pack(record(:max_corners), record(:max_corners) > 0)), faces%group(i))
        faces%order(i) = record(max_corners + 1)
        faces%signature(i) = int(record(max_corners + 2))
        faces%tag(i) = record(max_corners + 3)
        faces%x(:, i) = transfer(record(max_corners + 4:), faces%x)
      end associate
    end do
    call judge_faces(faces, faults)
    call self%faces%add(faults)
    allocate (order(size(element)), first(size(element)), source=0)
    call sort_order(real(packed(element + 3), dp), order)
    call table%init(most_corners + 1, size(element))
    do i = 1, size(element)
      j = element(order(i))
      associate (record => packed(j + 1:j + element_length))
        ! The block as one more number, which is no node.
        call table%add([-int(record(1)), int(pack(record(5:), record(5:) > 0))], entry)
        if (first(entry) == 0) then
          first(entry) = j
        else
          call take_repeated(self, record(3), [packed(first(entry) + 4), record(4)], int(record(2)))
        end if
      end associate
    end do
  end subroutine faults_unpack

  !> Take a repeated element, unless an earlier one is known.
  subroutine take_repeated(self, order, tag, kind)
    class(share_faults_t), intent(inout) :: self
    integer(int64), intent(in) :: order  !! Place in the order of the elements.
    integer(int64), intent(in) :: tag(2)  !! Tags of the one before it, and of the element.
    integer, intent(in) :: kind  !! Their kind.
    if (order >= self%repeated%order) return
    self%repeated%order = order
    self%repeated%tag = tag
    self%repeated%kind = kind
  end subroutine take_repeated

  !> Where heads, faces and elements begin.
  subroutine find_starts(packed, head, face, element)
    integer(int64), intent(in) :: packed(:)  !! The arrays of all ranks (any).
    integer, allocatable, intent(out) :: head(:)  !! Numbers before each head (n_ranks).
    integer, allocatable, intent(out) :: face(:)  !! Numbers before each face (any).
    integer, allocatable, intent(out) :: element(:)  !! Numbers before each element (any).
    integer :: at, i, n(2), n_heads, n_all(2), pass
    do pass = 1, 2
      n_heads = 0
      n_all = 0
      at = 0
      do while (at < size(packed))
        n = int(packed(at + head_length - 1:at + head_length))
        n_heads = n_heads + 1
        if (pass == 2) then
          head(n_heads) = at
          face(n_all(1) + 1:n_all(1) + n(1)) = [(at + head_length + face_length*i, i=0, n(1) - 1)]
          element(n_all(2) + 1:n_all(2) + n(2)) = &
            [(at + head_length + face_length*n(1) + element_length*i, i=0, n(2) - 1)]
        end if
        n_all = n_all + n
        at = at + head_length + face_length*n(1) + element_length*n(2)
      end do
      if (at /= size(packed)) error stop 'the faults of a share are damaged'
      if (pass == 1) allocate (head(n_heads), face(n_all(1)), element(n_all(2)))
    end do
  end subroutine find_starts

  !> Refuse repeated elements, which would double the stiffness.
  subroutine faults_check_repeated(self, file, volume_name, error)
    class(share_faults_t), intent(in) :: self
    character(*), intent(in) :: file  !! File of the mesh.
    character(*), intent(in) :: volume_name  !! Name of the physical groups.
    !> Set, or replaced, where two elements of a kind have the same corners: that is told before inverted elements.
    type(error_t), allocatable, intent(inout) :: error
    if (self%repeated%kind == 0) return
    call refuse_repeated(self%repeated%kind, self%repeated%tag, error)
    error%message = 'mesh '//quoted(file)//', '//quoted(volume_name)//': '//error%message
  end subroutine faults_check_repeated
end module dotyk_mesh_share_faults
