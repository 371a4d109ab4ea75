!> Mean tractions of both elements at the faces of an element, for the residual of the element.
!>
!> Both elements have the same points on a face where their rules are of one degree: the table of each kind serves from
!> both sides, and the traction found for one element is that of the other with the opposite sign. Elsewhere the points
!> are placed in the element behind.
module dotyk_elasticity_face_tractions
  use dotyk_base_memory, only: allowance_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_bubble_table, only: bubble_table_t, face_bubbles_t, points_table
  use dotyk_elasticity_face_table, only: face_table_t, point_of_element
  use dotyk_elasticity_isoparametric_map, only: point_shape_table_t
  use dotyk_elasticity_point_stress, only: point_material_t, stresses_at
  use dotyk_linalg_blas, only: dgemm
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  type, public :: face_tractions_t  !! Mean tractions at faces between two elements.
    !> Tractions by areas on the element with the smaller number, at its points (greatest number of points, dim,
    !> n_bodies, n_interior) [force].
    real(dp), allocatable :: value(:, :, :, :)
    logical, allocatable :: is_known(:)  !! Whether those of a face are known; not allocated: none (n_interior).
  contains
    procedure :: find => face_tractions_find
  end type face_tractions_t

  public :: add_faces

contains

  !> Find them, where there is room: the other faces are evaluated from each side.
  subroutine face_tractions_find(self, mesh, faces, material, table, u, is_needed, room)
    class(face_tractions_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(face_table_t), intent(in) :: faces  !! Faces of the elements.
    type(point_material_t), intent(in) :: material(:)  !! Materials (n_materials).
    type(bubble_table_t), intent(in) :: table(:)  !! Bubbles of the kinds of the blocks (n_blocks).
    real(dp), intent(in), contiguous :: u(:, :, :)  !! Displacements (n_bodies, dim, n_nodes) [length].
    logical, intent(in) :: is_needed(:)  !! Elements whose faces are needed (n_elements).
    type(allowance_t), intent(inout) :: room  !! Memory for the tractions.
    integer :: b, e, f, k, n_points
    n_points = 0
    do b = 1, size(table)
      n_points = max(n_points, maxval(table(b)%face%n_points))
    end do
    if (.not. room%take(8_int64*n_points*mesh%dimension*size(u, 1)*faces%n_interior)) return
    allocate (self%value(n_points, mesh%dimension, size(u, 1), faces%n_interior))
    allocate (self%is_known(faces%n_interior), source=.false.)
    ! A formula serves one thread.
    !$omp parallel do default(none) schedule(dynamic, 16) if (all(material%field%constant)) private(b, f, k) &
    !$omp& shared(self, mesh, faces, material, table, u, is_needed)
    do e = 1, size(is_needed)
      b = faces%block(e)
      do f = 1, size(table(b)%face)
        if (faces%neighbour(f, e) <= e) cycle
        if (.not. (is_needed(e) .or. is_needed(faces%neighbour(f, e)))) cycle
        k = faces%interior(f, e)
        call find_one(b, e, f, self%value(:, :, :, k), self%is_known(k))
      end do
    end do
    !$omp end parallel do

  contains

    !> Find those of one face.
    subroutine find_one(block, element, f, value, is_known)
      integer, intent(in) :: block  !! Block of the element with the smaller number.
      integer, intent(in) :: element  !! The element.
      integer, intent(in) :: f  !! Its face.
      real(dp), intent(inout) :: value(:, :, :)  !! The tractions (n_points, dim, n_bodies) [force].
      logical, intent(out) :: is_known  !! Whether they were found.
      type(error_t), allocatable :: error
      real(dp) :: worst, their_worst
      integer, allocatable :: same(:)
      integer :: their_block, their_face
      associate (face => table(block)%face(f), behind => faces%neighbour(f, element))
        their_block = faces%block(behind)
        associate (node => mesh%block(block)%node(:, element - faces%before(block)), &
                   their_node => mesh%block(their_block)%node(:, behind - faces%before(their_block)), &
                   theirs => table(their_block), own => material(mesh%block(block)%material), &
                   their => material(mesh%block(their_block)%material))
          call find_match(theirs, table(block)%degree, face, their_node, node(face%corner), their_face, same, is_known)
          if (.not. is_known) return
          call mean_tractions(size(u, 1), mesh%dimension, size(node), own%form%n_strains, own%slots, &
                              face%points%n_points, mesh, own, their, face, node, u, size(their_node), &
                              theirs%face(their_face)%points%n_points, theirs%face(their_face)%points, their_node, &
                              same, value(:face%n_points, :, :), worst, their_worst, error)
          ! Each element finds what is wrong with itself.
          is_known = .not. allocated(error) .and. worst > 0 .and. their_worst > 0
        end associate
      end associate
    end subroutine find_one
  end subroutine face_tractions_find

  !> Add the mean tractions of the faces of an element.
  subroutine add_faces(n_bodies, dim, n, n_bubbles, n_strains, slots, mesh, faces, held, material, table, tractions, &
                       block, u, element, node, rhs, worst, error)
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: n_bubbles  !! Number of bubbles.
    integer, intent(in) :: n_strains  !! Number of strains.
    integer, intent(in) :: slots  !! Number of gradient slots.
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(face_table_t), intent(in) :: faces  !! Faces of the elements.
    real(dp), intent(in) :: held(:, :, :, :)  !! On held directions of faces (dim, dim, n_boundary, n_bodies) [].
    type(point_material_t), intent(in) :: material(:)  !! Materials (n_materials).
    type(bubble_table_t), intent(in) :: table(:)  !! Bubbles of the kinds of the blocks (n_blocks).
    type(face_tractions_t), intent(in) :: tractions  !! Those of faces between two elements, as far as they are known.
    integer, intent(in) :: block  !! Block of the element.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! Displacements (n_bodies, dim, n_nodes) [length].
    integer, intent(in) :: element  !! The element.
    integer, intent(in) :: node(n)  !! Its nodes (n).
    real(dp), intent(inout) :: rhs(n_bubbles, dim, n_bodies)  !! Residual forces on the bubbles, added to [force].
    real(dp), intent(inout) :: worst  !! Smallest determinant of the element at points of its faces [volume].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    type(element_kind_t) :: kind
    type(point_shape_table_t) :: points
    real(dp), allocatable :: traction(:, :, :)
    real(dp) :: their_worst
    integer :: b, f, behind, g, boundary
    logical :: known, matched
    integer, allocatable :: same(:)
    do f = 1, size(table(block)%face)
      behind = faces%neighbour(f, element)
      boundary = faces%boundary(f, element)
      if (behind == 0) then
        if (.not. any(abs(held(:, :, boundary, :)) > 0)) cycle
      end if
      associate (face => table(block)%face(f), own => material(mesh%block(block)%material))
        if (allocated(traction)) deallocate (traction)
        allocate (traction(face%n_points, dim, n_bodies))
        if (behind == 0) then
          call mean_tractions(n_bodies, dim, n, n_strains, slots, face%points%n_points, mesh, own, own, face, node, u, &
                              0, 0, face%points, [integer ::], [integer ::], traction, worst, their_worst, error, &
                              held(:, :, boundary, :))
        else
          b = faces%block(behind)
          known = .false.
          if (allocated(tractions%is_known)) known = tractions%is_known(faces%interior(f, element))
          associate (their_node => mesh%block(b)%node(:, behind - faces%before(b)), &
                     their => material(mesh%block(b)%material), corner => node(face%corner))
            if (known .and. behind > element) then
              traction = tractions%value(:face%n_points, :, :, faces%interior(f, element))
            else
              call find_match(table(b), table(block)%degree, face, their_node, corner, g, same, matched)
              if (known .and. matched) then
                traction = -tractions%value(same, :, :, faces%interior(f, element))
              else if (matched) then
                call mean_tractions(n_bodies, dim, n, n_strains, slots, face%points%n_points, mesh, own, their, face, &
                                    node, u, size(their_node), table(b)%face(g)%points%n_points, &
                                    table(b)%face(g)%points, their_node, same, traction, worst, their_worst, error)
              else
                kind = element_kind(table(block)%kind)
                kind = element_kind(kind%face_kind(f))
                call place_points(table(b)%kind, their_node, kind%corner_kind, corner, face, points, same)
                call mean_tractions(n_bodies, dim, n, n_strains, slots, face%points%n_points, mesh, own, their, face, &
                                    node, u, size(their_node), points%n_points, points, their_node, same, traction, &
                                    worst, their_worst, error)
              end if
            end if
          end associate
        end if
        if (allocated(error) .or. .not. worst > 0) return
        call dgemm('N', 'N', n_bubbles, dim*n_bodies, face%n_points, 1.0_dp, face%value, n_bubbles, traction, &
                   face%n_points, 1.0_dp, rhs, n_bubbles)
      end associate
    end do
  end subroutine add_faces

  !> The points of a face among those of a face of the element behind.
  pure subroutine find_match(their_table, degree, face, their_node, corner, their_face, same, known)
    type(bubble_table_t), intent(in) :: their_table  !! Bubbles of the kind of the element behind.
    integer, intent(in) :: degree  !! Degree of the rule of the face.
    type(face_bubbles_t), intent(in) :: face  !! The face.
    integer, intent(in) :: their_node(:)  !! Nodes of the element behind (n).
    integer, intent(in) :: corner(:)  !! Nodes at the corners of the face (n_corners).
    integer, intent(out) :: their_face  !! Face of the element behind.
    integer, allocatable, intent(out) :: same(:)  !! Its point for each point of the face (n_points).
    logical, intent(out) :: known  !! Whether there is one.
    integer :: first, second
    known = .false.
    their_face = 0
    if (their_table%degree /= degree) return
    do their_face = 1, size(their_table%face)
      if (size(their_table%face(their_face)%corner) /= size(corner)) cycle
      associate (theirs => their_node(their_table%face(their_face)%corner))
        first = findloc(theirs, corner(1), dim=1)
        if (first == 0) cycle
        second = findloc(theirs, corner(2), dim=1)
        if (second == 0) cycle
        if (size(corner) > 2) then
          if (.not. any(theirs == corner(3))) cycle
        end if
      end associate
      same = their_table%face(their_face)%match(:, first, second)
      known = size(same) == face%n_points .and. all(same > 0)
      return
    end do
  end subroutine find_match

  !> The points of a face in the element behind.
  subroutine place_points(kind, node, corner_kind, corner, face, points, same)
    integer, intent(in) :: kind  !! Kind of the element behind.
    integer, intent(in) :: node(:)  !! Its nodes (n).
    integer, intent(in) :: corner_kind  !! Linear kind of the face.
    integer, intent(in) :: corner(:)  !! Nodes at the corners of the face (n_corners).
    type(face_bubbles_t), intent(in) :: face  !! The face.
    type(point_shape_table_t), intent(out) :: points  !! Shape functions there.
    integer, allocatable, intent(out) :: same(:)  !! Number of each point of the face (n_points).
    real(dp) :: xi(size(face%xi, 1), face%n_points)
    integer :: q
    do q = 1, face%n_points
      xi(:, q) = point_of_element(kind, node, corner_kind, corner, face%on_face(:, q))
    end do
    call points_table(kind, xi, [(1.0_dp, q=1, face%n_points)], points)
    same = [(q, q=1, face%n_points)]
  end subroutine place_points

  !> Mean tractions of one face, by areas.
  subroutine mean_tractions(n_bodies, dim, n, n_strains, slots, n_points, mesh, material, their, face, node, u, &
                            their_n, their_n_points, their_points, their_node, same, traction, worst, their_worst, &
                            error, held)
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: n_strains  !! Number of strains.
    integer, intent(in) :: slots  !! Number of gradient slots.
    integer, intent(in) :: n_points  !! Number of points of the face, with repetitions.
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(point_material_t), intent(in) :: material  !! Material of the element.
    type(point_material_t), intent(in) :: their  !! Material of the element behind.
    type(face_bubbles_t), intent(in) :: face  !! The face.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    real(dp), intent(in), contiguous :: u(:, :, :)  !! Displacements (n_bodies, dim, n_nodes) [length].
    integer, intent(in) :: their_n  !! Number of nodes of the element behind; 0 on the boundary.
    integer, intent(in) :: their_n_points  !! Number of its points, with repetitions.
    type(point_shape_table_t), intent(in) :: their_points  !! Shape functions at its points.
    integer, intent(in) :: their_node(their_n)  !! Its nodes (their_n).
    integer, intent(in) :: same(:)  !! Its points at those of the face; unused on the boundary (n_points).
    !> Tractions by areas on the element; undefined with an error, or where `worst` is not positive (n_points without
    !> repetitions, dim, n_bodies) [force].
    real(dp), intent(inout) :: traction(:, :, :)
    real(dp), intent(out) :: worst  !! Smallest determinant of the element at the points [volume].
    !> That of the element behind, whose stress is 0 where it is not positive; 1 on the boundary [volume].
    real(dp), intent(out) :: their_worst
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    real(dp), intent(in), optional :: held(:, :, :)  !! On held directions of a face (dim, dim, n_bodies) [].
    real(dp) :: inverse(n_points, dim, dim), stress(n_points, n_strains, n_bodies)
    real(dp), dimension(n_points) :: radius, w, modulus
    real(dp) :: their_inverse(their_n_points, dim, dim), their_stress(their_n_points, n_strains, n_bodies)
    real(dp), dimension(their_n_points) :: their_radius, their_w, their_modulus
    real(dp) :: their_root, share, area(dim), mean(n_strains)
    integer :: i, k, q, s
    their_worst = 1
    call stresses_at(n, n_points, n_bodies, dim, n_strains, slots, material, face%points, node, mesh%x, u, .true., &
                     inverse, radius, w, modulus, stress, worst, error)
    if (allocated(error) .or. .not. worst > 0) return
    if (their_n > 0) then
      call stresses_at(their_n, their_n_points, n_bodies, dim, n_strains, slots, their, their_points, their_node, &
                       mesh%x, u, .true., their_inverse, their_radius, their_w, their_modulus, their_stress, &
                       their_worst, error)
      if (allocated(error)) return
    end if
    traction = 0
    do q = 1, face%n_points
      ! The normal times the area of the point (Nanson).
      area = w(q)*matmul(face%normal, inverse(q, :, :))
      do k = 1, n_bodies
        mean = stress(q, :, k)
        if (their_n > 0) then
          their_root = sqrt(their_modulus(same(q))*(their%size/material%size))
          share = their_root/(sqrt(modulus(q)) + their_root)
          mean = share*mean + (1 - share)*their_stress(same(q), :, k)
        end if
        do s = 1, dim
          do i = 1, dim
            if (material%form%index(i, s) > 0) &
              traction(q, i, k) = traction(q, i, k) + area(s)*mean(material%form%index(i, s))
          end do
        end do
        if (present(held)) traction(q, :, k) = matmul(turned(dim, held(:, :, k), area/norm2(area)), traction(q, :, k))
      end do
    end do
  end subroutine mean_tractions

  !> Projection on the directions held at a point of a curved face: where the normal of the face is held, that of the
  !> point is.
  pure function turned(dim, held, normal) result(projection)
    integer, intent(in) :: dim  !! Number of displacement components.
    real(dp), intent(in) :: held(dim, dim)  !! Projection on the held directions of the face (dim, dim) [].
    real(dp), intent(in) :: normal(dim)  !! Normal at the point (dim) [].
    real(dp) :: projection(dim, dim)
    real(dp), parameter :: along = 0.9_dp  !! Cosine between the normals of a face and of a point on it, at least.
    real(dp) :: free(dim, dim), axis(dim)
    integer :: i, rank
    projection = held
    rank = nint(sum([(held(i, i), i=1, dim)]))
    if (rank == 0 .or. rank == dim) return
    if (norm2(matmul(held, normal)) < along) return
    if (rank == 1) then
      projection = spread(normal, 2, dim)*spread(normal, 1, dim)
      return
    end if
    free = -held
    do i = 1, dim
      free(i, i) = free(i, i) + 1
    end do
    axis = free(:, maxloc([(free(i, i), i=1, dim)], dim=1))
    axis = axis - dot_product(axis, normal)*normal
    axis = axis/norm2(axis)
    projection = -spread(axis, 2, dim)*spread(axis, 1, dim)
    do i = 1, dim
      projection(i, i) = projection(i, i) + 1
    end do
  end function turned
end module dotyk_elasticity_face_tractions
