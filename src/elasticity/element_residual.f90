!> Element residuals: the energy of the local answer to the forces that an element does not balance.
!>
!> On each element the displacement e in the space of bubbles (`dotyk_elasticity_bubble_table`) solves
!>
!>     A(e, w) = L(w) - A(u, w) + (g, w) on the faces          for all bubbles w,
!>
!> with the mean g of the tractions of both elements at a face (Bank and Weiser, Math. Comp. 44, 1985). Where the
!> stiffness jumps, the softer side counts more (Petzoldt, Adv. Comput. Math. 16, 2002). On the boundary g is the load,
!> and along held directions, such as the normal of a support or of contact, the element's own traction. Bubbles vanish
!> at the nodes: no rigid motion is among them, and the problems need no equilibrated tractions.
module dotyk_elasticity_element_residual
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_analysis, only: two_pi
  use dotyk_elasticity_bubble_table, only: bubble_table_t
  use dotyk_elasticity_face_table, only: face_table_t, point_of_element
  use dotyk_elasticity_point_forces, only: point_forces_t
  use dotyk_elasticity_point_stress, only: modulus_at, point_material_t, strains_at, traction_at
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm
  use dotyk_linalg_lapack, only: dpotrf
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_facet, only: facet_geometry
  implicit none
  private

  !> Loads and held directions of bodies of one mesh, in its axes.
  type, public :: residual_data_t
    !> Faces of the elements.
    type(face_table_t) :: faces
    !> Constant force densities (dim, n_bodies) [force/volume].
    real(dp), allocatable :: density(:, :)
    !> Projections on the held directions of the faces of the boundary (dim, dim, n_boundary, n_bodies) [].
    real(dp), allocatable :: held(:, :, :, :)
    !> Other loads (n_bodies).
    type(point_forces_t), allocatable :: applied(:)
    !> First entry of each element in `order` (n_elements + 1, n_bodies).
    integer, allocatable :: first(:, :)
    !> Other loads by elements (greatest number of loads, n_bodies).
    integer, allocatable :: order(:, :)
  end type residual_data_t

  public :: residual_energy

contains

  !> Energies of the local answers of one element.
  subroutine residual_energy(mesh, data, material, table, u, element, square, error)
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Loads and held directions.
    type(residual_data_t), intent(in) :: data
    !> Material.
    type(point_material_t), intent(in) :: material
    !> Bubbles of the kinds of the blocks (n_blocks).
    type(bubble_table_t), intent(in) :: table(:)
    !> Displacements in the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> The element, in the order of the blocks.
    integer, intent(in) :: element
    !> Energies; 0 where the element is inverted (n_bodies) [energy].
    real(dp), intent(out) :: square(:)
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    integer :: b, i
    b = data%faces%block(element)
    i = element - data%faces%before(b)
    associate (node => mesh%block(b)%node(:, i))
      call solve_local(size(u, 1), mesh%dimension, size(node), table(b)%n, material%form%n_strains, mesh, data, &
                       material, table(b), u, element, node, square, error)
    end associate
  end subroutine residual_energy

  !> Set up and solve the local problem.
  subroutine solve_local(n_bodies, dim, n, n_bubbles, n_strains, mesh, data, material, table, u, element, node, &
                         square, error)
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
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Loads and held directions.
    type(residual_data_t), intent(in) :: data
    !> Material.
    type(point_material_t), intent(in) :: material
    !> Bubbles of the element's kind.
    type(bubble_table_t), intent(in) :: table
    !> Displacements (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> The element.
    integer, intent(in) :: element
    !> Its nodes (n).
    integer, intent(in) :: node(n)
    !> Energies (n_bodies) [energy].
    real(dp), intent(out) :: square(n_bodies)
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: root_strain(n_strains, table%n_points, dim*n_bubbles), root_stress(n_strains, table%n_points, n_bodies)
    real(dp) :: matrix(dim*n_bubbles, dim*n_bubbles), rhs(dim*n_bubbles, n_bodies)
    real(dp) :: strain(n_strains, n_bodies), b_matrix(n_strains, dim*n_bubbles)
    real(dp) :: inverse(dim, dim), bubble(n_bubbles, dim), position(dim), w, modulus
    integer :: i, k, q, s, info, m
    m = dim*n_bubbles
    square = 0
    rhs = 0
    do q = 1, table%n_points
      call strains_at(mesh, material, table%kind, node, u, table%xi(:, q), position, inverse, w, strain)
      if (.not. w > 0) return
      w = w*table%weight(q)
      if (material%slots > dim) w = w*two_pi*position(1)
      bubble = matmul(table%gradient(:, :, q), inverse)
      b_matrix = 0
      do s = 1, dim
        do i = 1, dim
          k = material%form%index(i, s)
          if (k > 0) b_matrix(k, (i - 1)*n_bubbles + 1:i*n_bubbles) = &
            b_matrix(k, (i - 1)*n_bubbles + 1:i*n_bubbles) + bubble(:, s)
        end do
      end do
      if (material%slots > dim) then
        k = material%form%index(1, 3)
        b_matrix(k, :n_bubbles) = b_matrix(k, :n_bubbles) + table%value(:, q)/position(1)
      end if
      call modulus_at(material%factor, position, modulus, error)
      if (allocated(error)) return
      root_strain(:, q, :) = sqrt(w*modulus)*matmul(material%root, b_matrix)
      root_stress(:, q, :) = sqrt(w*modulus)*matmul(material%root, strain)
      do k = 1, n_bodies
        do i = 1, dim
          if (.not. abs(data%density(i, k)) > 0) cycle
          rhs((i - 1)*n_bubbles + 1:i*n_bubbles, k) = rhs((i - 1)*n_bubbles + 1:i*n_bubbles, k) + &
                                                      w*data%density(i, k)*table%value(:, q)
        end do
      end do
    end do
    k = n_strains*table%n_points
    call dgemm('T', 'N', m, n_bodies, k, -1.0_dp, root_strain, k, root_stress, k, 1.0_dp, rhs, m)
    call dsyrk('L', 'T', m, k, 1.0_dp, root_strain, k, 0.0_dp, matrix, m)
    call add_faces(rhs, error)
    if (allocated(error)) return
    call add_loads(n_bodies, dim, n_bubbles, data, table, element, rhs)
    call dpotrf('L', m, matrix, m, info)
    ! An element so flat that its bubbles are dependent has no local answer: its recovered strains alone count.
    if (info /= 0) return
    call dtrsm('L', 'L', 'N', 'N', m, n_bodies, 1.0_dp, matrix, m, rhs, m)
    square = sum(rhs**2, dim=1)

  contains

    !> Add the mean tractions of the faces.
    subroutine add_faces(rhs, error)
      !> Residual forces on the bubbles, added to (n_bubbles, dim, n_bodies) [force].
      real(dp), intent(inout) :: rhs(n_bubbles, dim, n_bodies)
      !> Allocated where the modulus field has no value.
      type(error_t), allocatable, intent(out) :: error
      type(element_kind_t) :: kind, of_face
      real(dp) :: position(dim), normal(dim), area, own(dim, n_bodies), other(dim, n_bodies), mine, theirs, share
      integer :: b, f, i, k, q, behind
      kind = element_kind(table%kind)
      do f = 1, kind%n_faces
        behind = data%faces%neighbour(f, element)
        of_face = element_kind(kind%face_kind(f))
        if (behind == 0) then
          if (.not. any(abs(data%held(:, :, data%faces%boundary(f, element), :)) > 0)) cycle
        end if
        associate (face => table%face(f), on_face => node(kind%face_node(:of_face%n_nodes, f)))
          do q = 1, face%n_points
            call facet_geometry(kind%face_kind(f), dim, mesh%x(:, on_face), face%on_face(:, q), position, normal, area)
            area = area*face%weight(q)
            if (material%slots > dim) area = area*two_pi*position(1)
            call traction_at(mesh, material, table%kind, node, u, face%xi(:, q), normal, own, mine, error)
            if (allocated(error)) return
            if (behind > 0) then
              b = data%faces%block(behind)
              associate (their_node => mesh%block(b)%node(:, behind - data%faces%before(b)))
                call traction_at(mesh, material, mesh%block(b)%kind, their_node, u, &
                                 point_of_element(mesh%block(b)%kind, their_node, of_face%corner_kind, &
                                                  on_face(:of_face%n_corners), face%on_face(:, q)), normal, other, &
                                 theirs, error)
              end associate
              if (allocated(error)) return
              share = sqrt(theirs)/(sqrt(mine) + sqrt(theirs))
              own = share*own + (1 - share)*other
            else
              do k = 1, n_bodies
                own(:, k) = matmul(turned(dim, data%held(:, :, data%faces%boundary(f, element), k), normal), own(:, k))
              end do
            end if
            do k = 1, n_bodies
              do i = 1, dim
                rhs(:, i, k) = rhs(:, i, k) + (area*own(i, k))*face%value(:, q)
              end do
            end do
          end do
        end associate
      end do
    end subroutine add_faces
  end subroutine solve_local

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

  !> Add the loads at points; those along held directions do no work.
  subroutine add_loads(n_bodies, dim, n_bubbles, data, table, element, rhs)
    !> Number of bodies.
    integer, intent(in) :: n_bodies
    !> Number of displacement components.
    integer, intent(in) :: dim
    !> Number of bubbles.
    integer, intent(in) :: n_bubbles
    !> Loads and held directions.
    type(residual_data_t), intent(in) :: data
    !> Bubbles of the element's kind.
    type(bubble_table_t), intent(in) :: table
    !> The element.
    integer, intent(in) :: element
    !> Residual forces on the bubbles, added to (n_bubbles, dim, n_bodies) [force].
    real(dp), intent(inout) :: rhs(n_bubbles, dim, n_bodies)
    real(dp) :: force(dim), value(n_bubbles)
    integer :: b, i, k, l
    do b = 1, n_bodies
      do k = data%first(element, b), data%first(element + 1, b) - 1
        l = data%order(k, b)
        force = data%applied(b)%force(:, l)
        i = data%applied(b)%face(l)
        if (i > 0) force = force - matmul(data%held(:, :, data%faces%boundary(i, element), b), force)
        value = table%values(data%applied(b)%xi(:, l))
        do i = 1, dim
          rhs(:, i, b) = rhs(:, i, b) + force(i)*value
        end do
      end do
    end do
  end subroutine add_loads

end module dotyk_elasticity_element_residual
