!> Element residuals: the energy of the local answer to the forces that an element does not balance.
!>
!> On each element the displacement e in the space of bubbles (`dotyk_elasticity_bubble_table`) solves
!>
!>     A(e, w) = L(w) - A(u, w) + (g, w) on the faces          for all bubbles w,
!>
!> A(u, w) standing for the work of the stress on the strain of w, with that of a temperature and the initial stress,
!> with the mean g of the tractions of both elements at a face (Bank and Weiser, Math. Comp. 44, 1985). Where the
!> stiffness jumps, the softer side counts more (Petzoldt, Adv. Comput. Math. 16, 2002). On the boundary g is the load,
!> and along held directions, such as the normal of a support or of contact, the element's own traction. Bubbles vanish
!> at the nodes: no rigid motion is among them, and the problems need no equilibrated tractions.
module dotyk_elasticity_element_residual
  use dotyk_base_allowance, only: allowance_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_bubble_table, only: bubble_table_t
  use dotyk_elasticity_face_table, only: face_table_t
  use dotyk_elasticity_face_tractions, only: add_faces
  use dotyk_elasticity_point_forces, only: point_forces_t
  use dotyk_elasticity_point_stress, only: point_material_t, stresses_at
  use dotyk_linalg_blas, only: dsyrk, dtrsm
  use dotyk_linalg_lapack, only: dpotrf
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private

  !> Loads and held directions of bodies of one mesh, in its axes.
  type, public :: residual_data_t
    !> Faces of the elements.
    type(face_table_t) :: faces
    !> Constant force densities in each material (dim, n_bodies, n_materials) [force/volume].
    real(dp), allocatable :: density(:, :, :)
    !> Stresses of the bodies at rest at the nodes, as in `point_material_t`: of their temperatures in each material;
    !> none where not allocated (n_bodies, n_strains, n_nodes, n_materials) [pressure].
    real(dp), allocatable :: thermal(:, :, :, :)
    !> Their temperatures, where `thermal` is allocated (n_bodies, n_nodes) [temperature].
    real(dp), allocatable :: temperature(:, :)
    !> Of their initial stresses (n_bodies, n_strains, n_nodes) [pressure].
    real(dp), allocatable :: initial(:, :, :)
    !> Projections on the held directions of the faces of the boundary (dim, dim, n_boundary, n_bodies) [].
    real(dp), allocatable :: held(:, :, :, :)
    !> Other loads (n_bodies).
    type(point_forces_t), allocatable :: applied(:)
    !> First entry of each element in `order` (n_elements + 1, n_bodies).
    integer, allocatable :: first(:, :)
    !> Other loads by elements (greatest number of loads, n_bodies).
    integer, allocatable :: order(:, :)
  end type residual_data_t

  !> Factor of the stiffness of the bubbles of an element: it depends on mesh and material alone.
  type, public :: bubble_factor_t
    !> Its lower triangle, column by column; not allocated where it is not kept (m(m+1)/2) [sqrt(force/length)].
    real(dp), allocatable :: column(:)
  contains
    procedure :: keep => factor_keep
    procedure :: unpack => factor_unpack
  end type bubble_factor_t

  public :: residual_energy, residual_problem

contains

  !> Keep a factor, where there is room.
  subroutine factor_keep(self, m, matrix, room)
    class(bubble_factor_t), intent(inout) :: self
    !> Order.
    integer, intent(in) :: m
    !> The factor in its lower triangle (m, m) [sqrt(force/length)].
    real(dp), intent(in) :: matrix(m, m)
    !> Memory for factors.
    type(allowance_t), intent(inout) :: room
    integer :: j, k
    if (.not. room%take(4_int64*m*(m + 1))) return
    allocate (self%column(m*(m + 1)/2))
    k = 0
    do j = 1, m
      self%column(k + 1:k + m - j + 1) = matrix(j:, j)
      k = k + m - j + 1
    end do
  end subroutine factor_keep

  !> The factor that was kept.
  pure subroutine factor_unpack(self, m, matrix)
    class(bubble_factor_t), intent(in) :: self
    !> Order.
    integer, intent(in) :: m
    !> The factor; its upper triangle is not set (m, m) [sqrt(force/length)].
    real(dp), intent(inout) :: matrix(m, m)
    integer :: j, k
    k = 0
    do j = 1, m
      matrix(j:, j) = self%column(k + 1:k + m - j + 1)
      k = k + m - j + 1
    end do
  end subroutine factor_unpack

  !> Energies of the local answers of one element.
  subroutine residual_energy(mesh, data, material, table, u, element, factor, room, square, error)
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Loads and held directions.
    type(residual_data_t), intent(in) :: data
    !> Materials (n_materials).
    type(point_material_t), intent(in) :: material(:)
    !> Bubbles of the kinds of the blocks (n_blocks).
    type(bubble_table_t), intent(in) :: table(:)
    !> Displacements in the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> The element, in the order of the blocks.
    integer, intent(in) :: element
    !> Factor of its bubbles: used where it was kept.
    type(bubble_factor_t), intent(inout) :: factor
    !> Memory for factors.
    type(allowance_t), intent(inout) :: room
    !> Energies; 0 where the element is inverted (n_bodies) [energy].
    real(dp), intent(out) :: square(:)
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: matrix(:, :), rhs(:, :)
    logical :: known
    integer :: m, info
    square = 0
    known = allocated(factor%column)
    call residual_problem(mesh, data, material, table, u, element, factor, matrix, rhs, error)
    if (allocated(error) .or. .not. allocated(matrix)) return
    m = size(matrix, 1)
    if (.not. known) then
      call dpotrf('L', m, matrix, m, info)
      ! An element so flat that its bubbles are dependent has no local answer: its recovered strains alone count.
      if (info /= 0) return
      call factor%keep(m, matrix, room)
    end if
    call dtrsm('L', 'L', 'N', 'N', m, size(rhs, 2), 1.0_dp, matrix, m, rhs, m)
    square = sum(sum(reshape(rhs**2, [m/mesh%dimension, mesh%dimension, size(rhs, 2)]), dim=1), dim=1)
  end subroutine residual_energy

  !> The local problem of one element.
  subroutine residual_problem(mesh, data, material, table, u, element, factor, matrix, rhs, error)
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Loads and held directions.
    type(residual_data_t), intent(in) :: data
    !> Materials (n_materials).
    type(point_material_t), intent(in) :: material(:)
    !> Bubbles of the kinds of the blocks (n_blocks).
    type(bubble_table_t), intent(in) :: table(:)
    !> Displacements in the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> The element, in the order of the blocks.
    integer, intent(in) :: element
    !> Factor of its bubbles.
    type(bubble_factor_t), intent(in) :: factor
    !> Stiffness of the bubbles, its lower triangle, by bubbles and then components, or the factor where it was kept;
    !> not allocated where the element is inverted (dim*n_bubbles, dim*n_bubbles) [force/length].
    real(dp), allocatable, intent(out) :: matrix(:, :)
    !> Residual forces on the bubbles (dim*n_bubbles, n_bodies) [force].
    real(dp), allocatable, intent(out) :: rhs(:, :)
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    logical :: valid
    integer :: b, i, m
    b = data%faces%block(element)
    i = element - data%faces%before(b)
    m = mesh%dimension*table(b)%n
    allocate (matrix(m, m), rhs(m, size(u, 1)))
    associate (node => mesh%block(b)%node(:, i))
      call set_up(size(u, 1), mesh%dimension, size(node), table(b)%n, material(1)%form%n_strains, &
                  material(1)%slots, table(b)%points%n_points, mesh, data, material, table, b, u, element, node, &
                  factor, matrix, rhs, valid, error)
    end associate
    if (.not. valid) deallocate (matrix)
  end subroutine residual_problem

  !> Set up the local problem.
  subroutine set_up(n_bodies, dim, n, n_bubbles, n_strains, slots, n_points, mesh, data, material, table, block, &
                    u, element, node, factor, matrix, rhs, valid, error)
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
    !> Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: slots
    !> Number of points in the element, with repetitions.
    integer, intent(in) :: n_points
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Loads and held directions.
    type(residual_data_t), intent(in) :: data
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
    !> Factor of its bubbles.
    type(bubble_factor_t), intent(in) :: factor
    !> The stiffness, or the factor where it was kept; its upper triangle is not set (n_bubbles, dim, n_bubbles, dim)
    !> [force/length].
    real(dp), intent(out) :: matrix(dim*n_bubbles, dim*n_bubbles)
    !> Residual forces on the bubbles (n_bubbles, dim, n_bodies) [force].
    real(dp), intent(out) :: rhs(n_bubbles, dim, n_bodies)
    !> Whether the element has no inverted point.
    logical, intent(out) :: valid
    !> Allocated where the modulus field has no value.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: inverse(n_points, dim, dim), stress(n_points, n_strains, n_bodies), slope(n_points, n_bubbles, slots)
    real(dp), dimension(n_points) :: radius, w, modulus
    real(dp) :: stiffness(n_strains, n_strains, n_points), worst
    integer :: i, k, q, m_own, s
    valid = .false.
    rhs = 0
    m_own = mesh%block(block)%material
    associate (own => table(block))
      call stresses_at(n, n_points, n_bodies, dim, n_strains, slots, material(m_own), own%points, node, mesh%x, u, &
                       .false., inverse, radius, w, modulus, stress, worst, error, stiffness)
      if (allocated(error) .or. .not. worst > 0) return
      slope = 0
      do s = 1, dim
        do i = 1, n_bubbles
          do k = 1, dim
            do q = 1, n_points
              slope(q, i, s) = slope(q, i, s) + own%slope(q, i, k)*inverse(q, k, s)
            end do
          end do
        end do
      end do
      if (slots > dim) then
        do q = 1, own%n_points
          slope(q, :, 3) = own%value(:, q)/radius(q)
        end do
      end if
      do k = 1, n_bodies
        do s = 1, slots
          do i = 1, dim
            if (material(m_own)%form%index(i, s) == 0) cycle
            rhs(:, i, k) = rhs(:, i, k) - matmul(w*stress(:, material(m_own)%form%index(i, s), k), slope(:, :, s))
          end do
        end do
        do i = 1, dim
          if (abs(data%density(i, k, m_own)) > 0) rhs(:, i, k) = rhs(:, i, k) + &
            data%density(i, k, m_own)*matmul(own%value, w(:own%n_points))
        end do
      end do
      call add_faces(n_bodies, dim, n, n_bubbles, n_strains, slots, mesh, data%faces, data%held, material, table, &
                     block, u, element, node, rhs, worst, error)
      if (allocated(error) .or. .not. worst > 0) return
      call add_loads(n_bodies, dim, n_bubbles, data, own, element, rhs)
    end associate
    if (allocated(factor%column)) then
      call factor%unpack(dim*n_bubbles, matrix)
    else
      if (material(m_own)%field%varies) then
        call form_varying(n_points, n_bubbles, dim, slots, n_strains, material(m_own)%form%index, stiffness, &
                          w*modulus, slope, matrix)
      else
        call form_matrix(n_points, n_bubbles, dim, slots, n_strains, material(m_own)%form%index, &
                         material(m_own)%stiffness, w*modulus, slope, matrix)
      end if
    end if
    valid = .true.
  end subroutine set_up

  !> The stiffness of the bubbles, its lower triangle: from sums over the points of products of two derivatives.
  subroutine form_matrix(n_points, n_bubbles, dim, slots, n_strains, index, stiffness, w, slope, matrix)
    !> Number of points.
    integer, intent(in) :: n_points
    !> Number of bubbles.
    integer, intent(in) :: n_bubbles
    !> Number of displacement components.
    integer, intent(in) :: dim
    !> Number of gradient slots.
    integer, intent(in) :: slots
    !> Number of strains.
    integer, intent(in) :: n_strains
    !> Strain of each slot of each component, 0 for none (dim, slots).
    integer, intent(in) :: index(dim, slots)
    !> From strains to stresses (n_strains, n_strains) [pressure].
    real(dp), intent(in) :: stiffness(n_strains, n_strains)
    !> Weights of the points (n_points) [volume].
    real(dp), intent(in) :: w(n_points)
    !> Derivatives of the bubbles (n_points, n_bubbles, slots) [1/length].
    real(dp), intent(in) :: slope(n_points, n_bubbles, slots)
    !> The matrix; its upper triangle is not set (n_bubbles, dim, n_bubbles, dim) [force/length].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)
    real(dp) :: root(n_points, n_bubbles, slots), product(n_bubbles, slots, n_bubbles, slots), of_weight(n_points), c
    integer :: a, i, j, s, t
    of_weight = sqrt(w)
    do s = 1, slots
      do a = 1, n_bubbles
        root(:, a, s) = of_weight*slope(:, a, s)
      end do
    end do
    call dsyrk('L', 'T', n_bubbles*slots, n_points, 1.0_dp, root, n_points, 0.0_dp, product, n_bubbles*slots)
    do s = 1, slots
      do t = 1, s
        do a = 1, n_bubbles
          if (s > t) then
            product(a, t, :, s) = product(:, s, a, t)
          else
            product(a, s, a + 1:, s) = product(a + 1:, s, a, s)
          end if
        end do
      end do
    end do
    matrix = 0
    do j = 1, dim
      do i = j, dim
        do t = 1, slots
          if (index(j, t) == 0) cycle
          do s = 1, slots
            if (index(i, s) == 0) cycle
            c = stiffness(index(i, s), index(j, t))
            if (abs(c) > 0) matrix(:, i, :, j) = matrix(:, i, :, j) + c*product(:, s, :, t)
          end do
        end do
      end do
    end do
  end subroutine form_matrix

  !> The stiffness of the bubbles, its lower triangle, where the material differs from point to point.
  subroutine form_varying(n_points, n_bubbles, dim, slots, n_strains, index, stiffness, w, slope, matrix)
    !> Numbers of points, bubbles, displacement components, gradient slots and strains.
    integer, intent(in) :: n_points, n_bubbles, dim, slots, n_strains
    !> Strain of each slot of each component, 0 for none (dim, slots).
    integer, intent(in) :: index(dim, slots)
    !> From strains to stresses (n_strains, n_strains, n_points) [pressure].
    real(dp), intent(in) :: stiffness(n_strains, n_strains, n_points)
    !> Weights of the points (n_points) [volume].
    real(dp), intent(in) :: w(n_points)
    !> Derivatives of the bubbles (n_points, n_bubbles, slots) [1/length].
    real(dp), intent(in) :: slope(n_points, n_bubbles, slots)
    !> The matrix; its upper triangle is not set (n_bubbles, dim, n_bubbles, dim) [force/length].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)
    real(dp) :: strain(n_bubbles, n_strains, dim), stress(n_strains, n_bubbles)
    integer :: i, j, q, s
    matrix = 0
    do q = 1, n_points
      if (.not. w(q) > 0) cycle
      strain = 0
      do j = 1, dim
        do s = 1, slots
          if (index(j, s) > 0) strain(:, index(j, s), j) = strain(:, index(j, s), j) + slope(q, :, s)
        end do
      end do
      do j = 1, dim
        stress = matmul(w(q)*stiffness(:, :, q), transpose(strain(:, :, j)))
        do i = j, dim
          matrix(:, i, :, j) = matrix(:, i, :, j) + matmul(strain(:, :, i), stress)
        end do
      end do
    end do
  end subroutine form_varying

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
