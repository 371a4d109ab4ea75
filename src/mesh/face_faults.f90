!> What is wrong with faces of several elements: more than two of them, or other nodes on either side. Of faces on one
!> rank, or on several, whose findings are added up.
module dotyk_mesh_face_faults
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_sort, only: sort_order
  implicit none
  private

  type, public :: face_faults_t  !! Faults of faces; elements have an order, and the first of each kind is told.
    integer :: n_shared = 0  !! Number of faces of more than two elements.
    !> Place of the first of them in the order of the elements (`face_order`); huge where there is none.
    integer(int64) :: shared_order = huge(0_int64)
    real(dp) :: shared_position(3) = 0  !! A node of it (3) [length].
    integer :: n_mixed = 0  !! Number of faces on which two elements have other nodes.
    !> Place of the first of them in the order of the elements; huge where there is none.
    integer(int64) :: mixed_order = huge(0_int64)
    integer(int64) :: mixed(2) = 0  !! Tags of its elements.
    logical :: mixed_kinds = .false.  !! Whether they have another kind of face each, such as tri6 and tri3.
    real(dp) :: mixed_position(3) = 0  !! A node of it (3) [length].
  contains
    procedure :: add => faults_add
  end type face_faults_t

  type, public :: face_occurrences_t  !! Faces of elements; those of one group have the same corners.
    integer, allocatable :: group(:)  !! Group of each face (n).
    integer(int64), allocatable :: order(:)  !! Place of each face in the order of the elements (n).
    integer, allocatable :: signature(:)  !! Signature of the nodes on each face, from `face_signature` (n).
    integer(int64), allocatable :: tag(:)  !! Tag of the element of each face (n).
    real(dp), allocatable :: x(:, :)  !! First node of each face (3, n) [length].
  end type face_occurrences_t

  public :: face_order, face_signature, judge_faces

  integer, parameter :: kind_bits = 5  !! Signatures end with the kind of the face in this many bits.

contains

  !> Place of a face in the order of the elements: blocks, elements of the block, faces of the element.
  pure integer(int64) function face_order(block, element, face) result(order)
    integer, intent(in) :: block  !! Block of the element.
    integer, intent(in) :: element  !! Number of the element in its block of the whole body.
    integer, intent(in) :: face  !! Number of the face in the element.
    order = ishft(int(block, int64), 40) + 8*int(element, int64) + face
  end function face_order

  !> A number that tells the nodes on a face beside its corners: equal where kind and nodes are, in any order of nodes.
  pure integer function face_signature(kind, inner_node) result(signature)
    integer, intent(in) :: kind  !! Element kind of the face.
    !> Nodes of the face that are no corners, by their numbers in the whole body (any).
    integer, intent(in) :: inner_node(:)
    integer(int64), parameter :: factor = 1327217885_int64
    integer(int64) :: hash
    integer :: i
    hash = 0
    do i = 1, size(inner_node)
      hash = hash + iand(ieor(inner_node(i)*factor, ishft(inner_node(i)*factor, -29)), int(z'7fffffff', int64))
    end do
    signature = int(ishft(ibits(hash, 0, 31 - kind_bits), kind_bits)) + kind
  end function face_signature

  !> Add the faults of other faces.
  subroutine faults_add(self, other)
    class(face_faults_t), intent(inout) :: self
    type(face_faults_t), intent(in) :: other  !! Faults of faces with other corners.
    self%n_shared = self%n_shared + other%n_shared
    self%n_mixed = self%n_mixed + other%n_mixed
    if (other%shared_order < self%shared_order) then
      self%shared_order = other%shared_order
      self%shared_position = other%shared_position
    end if
    if (other%mixed_order < self%mixed_order) then
      self%mixed_order = other%mixed_order
      self%mixed = other%mixed
      self%mixed_kinds = other%mixed_kinds
      self%mixed_position = other%mixed_position
    end if
  end subroutine faults_add

  !> Find what is wrong with faces, of which all elements are known.
  subroutine judge_faces(faces, faults)
    type(face_occurrences_t), intent(in) :: faces  !! The faces.
    type(face_faults_t), intent(out) :: faults  !! The faults.
    integer, allocatable :: by_element(:), order(:)
    integer :: n, k, i, first, times
    n = size(faces%group)
    allocate (by_element(n), order(n))
    call sort_order(real(faces%order, dp), by_element)
    call sort_order(faces%group(by_element), order)
    order = by_element(order)
    times = 0
    first = 0
    do k = 1, n
      i = order(k)
      if (first > 0) then
        if (faces%group(first) /= faces%group(i)) first = 0
      end if
      if (first == 0) then
        first = i
        times = 0
      end if
      times = times + 1
      if (times == 3) then
        faults%n_shared = faults%n_shared + 1
        if (faces%order(i) < faults%shared_order) then
          faults%shared_order = faces%order(i)
          faults%shared_position = faces%x(:, i)
        end if
      end if
      if (faces%signature(i) == faces%signature(first)) cycle
      faults%n_mixed = faults%n_mixed + 1
      if (faces%order(i) > faults%mixed_order) cycle
      faults%mixed_order = faces%order(i)
      faults%mixed = faces%tag([first, i])
      faults%mixed_kinds = have_other_kinds(faces%signature(first), faces%signature(i))
      faults%mixed_position = faces%x(:, i)
    end do
  end subroutine judge_faces

  !> Whether two signatures are of faces of two kinds.
  pure logical function have_other_kinds(a, b)
    integer, intent(in) :: a  !! First signature.
    integer, intent(in) :: b  !! Second signature.
    have_other_kinds = ibits(a, 0, kind_bits) /= ibits(b, 0, kind_bits)
  end function have_other_kinds
end module dotyk_mesh_face_faults
