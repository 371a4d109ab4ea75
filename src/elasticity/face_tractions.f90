!> Mean tractions of both elements at the faces of an element, for the residual of the element.
!>
!> Both elements have the same points on a face where their rules are of one degree: the table of each kind serves from
!> both sides. Elsewhere the points are placed in the element behind.
module dotyk_elasticity_face_tractions
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_bubble_table, only: bubble_table_t, face_bubbles_t, points_table
  use dotyk_elasticity_face_table, only: face_table_t, point_of_element
  use dotyk_elasticity_isoparametric_map, only: point_shape_table_t
  use dotyk_elasticity_point_stress, only: point_material_t, stresses_at
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: add_faces

contains

  !> Add the mean tractions of the faces.
  subroutine add_faces(n_bodies, dim, n, n_bubbles, n_strains, slots, mesh, faces, held, material, table, block, u, &
                       element, node, rhs, worst, error)
    !> Number of bodies.
    integer, intent(in) :: n_bodies
    !> Number of displacement components, 2 or 3.
    integer, intent(in) :: dim
    !> Number of nodes of the element.
    integer, intent(in) :: n
    !> Number of bubbles.
    integer, intent(in) :: n_bubbles
    !> Number of strains.
    integer, intent(in) :: n_strains
    !> Number of gradient slots.
    integer, intent(in) :: slots
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Faces of the elements.
    type(face_table_t), intent(in) :: faces
    !> Projections on the held directions of the faces of the boundary (dim, dim, n_boundary, n_bodies) [].
    real(dp), intent(in) :: held(:, :, :, :)
    !> Materials (n_materials).
    type(point_material_t), intent(in) :: material(:)
    !> Bubbles of the kinds of the blocks (n_blocks).
    type(bubble_table_t), intent(in) :: table(:)
    !> Block of the element.
    integer, intent(in) :: block
    !> Displacements (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> The element.
    integer, intent(in) :: element
    !> Its nodes (n).
    integer, intent(in) :: node(n)
    !> Residual forces on the bubbles, added to (n_bubbles, dim, n_bodies) [force].
    real(dp), intent(inout) :: rhs(n_bubbles, dim, n_bodies)
    !> Smallest determinant of the element at points of its faces [volume].
    real(dp), intent(inout) :: worst
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    type(element_kind_t) :: kind
    type(point_shape_table_t) :: points
    integer :: b, f, behind, g, boundary
    logical :: known
    integer, allocatable :: same(:)
    do f = 1, size(table(block)%face)
      behind = faces%neighbour(f, element)
      boundary = faces%boundary(f, element)
      if (behind == 0) then
        if (.not. any(abs(held(:, :, boundary, :)) > 0)) cycle
      end if
      associate (face => table(block)%face(f), own => material(mesh%block(block)%material))
        if (behind == 0) then
          call add_face(n_bodies, dim, n, n_bubbles, n_strains, slots, face%points%n_points, mesh, own, own, face, &
                        node, u, 0, 0, face%points, [integer ::], [integer ::], held(:, :, boundary, :), rhs, &
                        worst, error)
        else
          b = faces%block(behind)
          associate (their_node => mesh%block(b)%node(:, behind - faces%before(b)), &
                     their => material(mesh%block(b)%material), corner => node(face%corner))
            call find_match(table(b), table(block)%degree, face, their_node, corner, g, same, known)
            if (known) then
              call add_face(n_bodies, dim, n, n_bubbles, n_strains, slots, face%points%n_points, mesh, own, their, &
                            face, node, u, size(their_node), table(b)%face(g)%points%n_points, &
                            table(b)%face(g)%points, their_node, same, held(:, :, :0, 1), rhs, worst, error)
            else
              kind = element_kind(table(block)%kind)
              kind = element_kind(kind%face_kind(f))
              call place_points(table(b)%kind, their_node, kind%corner_kind, corner, face, points, same)
              call add_face(n_bodies, dim, n, n_bubbles, n_strains, slots, face%points%n_points, mesh, own, their, &
                            face, node, u, size(their_node), points%n_points, points, their_node, same, &
                            held(:, :, :0, 1), rhs, worst, error)
            end if
          end associate
        end if
      end associate
      if (allocated(error) .or. .not. worst > 0) return
    end do
  end subroutine add_faces

  !> The points of a face among those of a face of the element behind.
  pure subroutine find_match(their_table, degree, face, their_node, corner, their_face, same, known)
    !> Bubbles of the kind of the element behind.
    type(bubble_table_t), intent(in) :: their_table
    !> Degree of the rule of the face.
    integer, intent(in) :: degree
    !> The face.
    type(face_bubbles_t), intent(in) :: face
    !> Nodes of the element behind (n).
    integer, intent(in) :: their_node(:)
    !> Nodes at the corners of the face (n_corners).
    integer, intent(in) :: corner(:)
    !> Face of the element behind.
    integer, intent(out) :: their_face
    !> Its point for each point of the face (n_points).
    integer, allocatable, intent(out) :: same(:)
    !> Whether there is one.
    logical, intent(out) :: known
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
    !> Kind of the element behind.
    integer, intent(in) :: kind
    !> Its nodes (n).
    integer, intent(in) :: node(:)
    !> Linear kind of the face.
    integer, intent(in) :: corner_kind
    !> Nodes at the corners of the face (n_corners).
    integer, intent(in) :: corner(:)
    !> The face.
    type(face_bubbles_t), intent(in) :: face
    !> Shape functions there.
    type(point_shape_table_t), intent(out) :: points
    !> Number of each point of the face (n_points).
    integer, allocatable, intent(out) :: same(:)
    real(dp) :: xi(size(face%xi, 1), face%n_points)
    integer :: q
    do q = 1, face%n_points
      xi(:, q) = point_of_element(kind, node, corner_kind, corner, face%on_face(:, q))
    end do
    call points_table(kind, xi, [(1.0_dp, q=1, face%n_points)], points)
    same = [(q, q=1, face%n_points)]
  end subroutine place_points

  !> Add the mean tractions of one face.
  subroutine add_face(n_bodies, dim, n, n_bubbles, n_strains, slots, n_points, mesh, material, their, face, node, u, &
                      their_n, their_n_points, their_points, their_node, same, held, rhs, worst, error)
    !> Number of bodies.
    integer, intent(in) :: n_bodies
    !> Number of displacement components, 2 or 3.
    integer, intent(in) :: dim
    !> Number of nodes of the element.
    integer, intent(in) :: n
    !> Number of bubbles.
    integer, intent(in) :: n_bubbles
    !> Number of strains.
    integer, intent(in) :: n_strains
    !> Number of gradient slots.
    integer, intent(in) :: slots
    !> Number of points of the face, with repetitions.
    integer, intent(in) :: n_points
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Material of the element.
    type(point_material_t), intent(in) :: material
    !> Material of the element behind.
    type(point_material_t), intent(in) :: their
    !> The face.
    type(face_bubbles_t), intent(in) :: face
    !> Nodes of the element (n).
    integer, intent(in) :: node(n)
    !> Displacements (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> Number of nodes of the element behind; 0 on the boundary.
    integer, intent(in) :: their_n
    !> Number of its points, with repetitions.
    integer, intent(in) :: their_n_points
    !> Shape functions at its points.
    type(point_shape_table_t), intent(in) :: their_points
    !> Its nodes (their_n).
    integer, intent(in) :: their_node(their_n)
    !> Its point for each point of the face; unused on the boundary (n_points without repetitions).
    integer, intent(in) :: same(:)
    !> Projections on the held directions of a face of the boundary (dim, dim, n_bodies) [].
    real(dp), intent(in) :: held(:, :, :)
    !> Residual forces on the bubbles, added to (n_bubbles, dim, n_bodies) [force].
    real(dp), intent(inout) :: rhs(n_bubbles, dim, n_bodies)
    !> Smallest determinant of the element at the points [volume].
    real(dp), intent(out) :: worst
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: inverse(n_points, dim, dim), stress(n_points, n_strains, n_bodies)
    real(dp), dimension(n_points) :: radius, w, modulus
    real(dp) :: their_inverse(their_n_points, dim, dim), their_stress(their_n_points, n_strains, n_bodies)
    real(dp), dimension(their_n_points) :: their_radius, their_w, their_modulus
    real(dp) :: their_worst, their_root, share, area(dim), traction(dim), mean(n_strains)
    integer :: i, k, q, s
    call stresses_at(n, n_points, n_bodies, dim, n_strains, slots, material, face%points, node, mesh%x, u, .true., &
                     inverse, radius, w, modulus, stress, worst, error)
    if (allocated(error) .or. .not. worst > 0) return
    if (their_n > 0) then
      call stresses_at(their_n, their_n_points, n_bodies, dim, n_strains, slots, their, their_points, their_node, &
                       mesh%x, u, .true., their_inverse, their_radius, their_w, their_modulus, their_stress, &
                       their_worst, error)
      if (allocated(error)) return
    end if
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
        traction = 0
        do s = 1, dim
          do i = 1, dim
            if (material%form%index(i, s) > 0) traction(i) = traction(i) + area(s)*mean(material%form%index(i, s))
          end do
        end do
        if (their_n == 0) traction = matmul(turned(dim, held(:, :, k), area/norm2(area)), traction)
        do i = 1, dim
          rhs(:, i, k) = rhs(:, i, k) + traction(i)*face%value(:, q)
        end do
      end do
    end do
  end subroutine add_face

  !> Projection on the directions held at a point of a curved face: where the normal of the face is held, that of the
  !> point is.
  pure function turned(dim, held, normal) result(projection)
    !> Number of displacement components.
    integer, intent(in) :: dim
    !> Projection on the held directions of the face (dim, dim) [].
    real(dp), intent(in) :: held(dim, dim)
    !> Normal at the point (dim) [].
    real(dp), intent(in) :: normal(dim)
    real(dp) :: projection(dim, dim)
    !> Cosine between the normals of a face and of a point on it, at least.
    real(dp), parameter :: along = 0.9_dp
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
