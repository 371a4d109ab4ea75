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
  use dotyk_base_memory, only: allowance_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_bubble_table, only: bubble_table_t
  use dotyk_elasticity_face_table, only: face_table_t
  use dotyk_elasticity_face_tractions, only: add_faces, face_tractions_t
  use dotyk_elasticity_point_forces, only: point_forces_t
  use dotyk_elasticity_point_stress, only: point_material_t, stresses_at
  use dotyk_linalg_blas, only: dgemm, dpotrf, dsyrk, dtpsv
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: residual_energy, residual_problem

  type, public :: residual_data_t  !! Loads and held directions of bodies of one mesh, in its axes.
    type(face_table_t) :: faces  !! Faces of the elements.
    real(dp), allocatable :: density(:, :, :)  !! Constant by materials (dim, n_bodies, n_materials) [force/volume].
    !> Stresses of the bodies at rest at the nodes, as in `point_material_t`: of their temperatures in each material;
    !> none where not allocated (n_bodies, n_strains, n_nodes, n_materials) [pressure].
    real(dp), allocatable :: thermal(:, :, :, :)
    real(dp), allocatable :: temperature(:, :)  !! Where `thermal` is allocated (n_bodies, n_nodes) [temperature].
    real(dp), allocatable :: initial(:, :, :)  !! Of their initial stresses (n_bodies, n_strains, n_nodes) [pressure].
    real(dp), allocatable :: held(:, :, :, :)  !! On held directions of faces (dim, dim, n_boundary, n_bodies) [].
    type(point_forces_t), allocatable :: applied(:)  !! Other loads (n_bodies).
    integer, allocatable :: first(:, :)  !! First entry of each element in `order` (n_elements + 1, n_bodies).
    integer, allocatable :: order(:, :)  !! Other loads by elements (greatest number of loads, n_bodies).
  end type residual_data_t

  !> Factor of the stiffness of the bubbles of an element: it depends on mesh and material alone.
  type, public :: bubble_factor_t
    !> Its lower triangle, column by column; not allocated where it is not kept (m(m+1)/2) [sqrt(force/length)].
    real(dp), allocatable :: column(:)
  contains
    procedure :: pack => factor_pack
    procedure :: solve => factor_solve
  end type bubble_factor_t

contains

  !> Pack a factor.
  subroutine factor_pack(self, m, matrix)
    class(bubble_factor_t), intent(inout) :: self
    integer, intent(in) :: m  !! Order.
    real(dp), intent(in) :: matrix(m, m)  !! The factor in its lower triangle (m, m) [sqrt(force/length)].
    integer :: j, k
    allocate (self%column(m*(m + 1)/2))
    k = 0
    do j = 1, m
      self%column(k + 1:k + m - j + 1) = matrix(j:, j)
      k = k + m - j + 1
    end do
  end subroutine factor_pack

  !> X <- L^{-1} X.
  subroutine factor_solve(self, x)
    class(bubble_factor_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:, :)  !! Right-hand sides in, solutions out (m, n_bodies) [force].
    integer :: k
    do k = 1, size(x, 2)
      call dtpsv('L', 'N', 'N', size(x, 1), self%column, x(:, k), 1)
    end do
  end subroutine factor_solve

  !> Energies of the local answers of one element.
  subroutine residual_energy(mesh, data, material, table, tractions, u, element, factor, room, square, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(residual_data_t), intent(in) :: data  !! Loads and held directions.
    type(point_material_t), intent(in) :: material(:)  !! Materials (n_materials).
    type(bubble_table_t), intent(in) :: table(:)  !! Bubbles of the kinds of the blocks (n_blocks).
    type(face_tractions_t), intent(in) :: tractions  !! Mean tractions at faces between elements, where known.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    integer, intent(in) :: element  !! The element, in the order of the blocks.
    type(bubble_factor_t), intent(inout) :: factor  !! Factor of its bubbles: used where it was kept.
    type(allowance_t), intent(inout) :: room  !! Memory for factors.
    real(dp), intent(out) :: square(:)  !! Energies; 0 where the element is inverted (n_bodies) [energy].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    type(bubble_factor_t) :: packed
    real(dp), allocatable :: matrix(:, :), rhs(:, :)
    integer :: m, info
    square = 0
    if (allocated(factor%column)) then
      call residual_problem(mesh, data, material, table, tractions, u, element, rhs, error)
      if (allocated(error) .or. .not. allocated(rhs)) return
      call factor%solve(rhs)
    else
      call residual_problem(mesh, data, material, table, tractions, u, element, rhs, error, matrix)
      if (allocated(error) .or. .not. allocated(rhs)) return
      m = size(matrix, 1)
      call dpotrf('L', m, matrix, m, info)
      ! An element so flat that its bubbles are dependent has no local answer: its recovered strains alone count.
      if (info /= 0) return
      call packed%pack(m, matrix)
      call packed%solve(rhs)
      if (room%take(8_int64*size(packed%column))) call move_alloc(packed%column, factor%column)
    end if
    m = size(rhs, 1)
    square = sum(sum(reshape(rhs**2, [m/mesh%dimension, mesh%dimension, size(rhs, 2)]), dim=1), dim=1)
  end subroutine residual_energy

  !> The local problem of one element.
  subroutine residual_problem(mesh, data, material, table, tractions, u, element, rhs, error, matrix)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(residual_data_t), intent(in) :: data  !! Loads and held directions.
    type(point_material_t), intent(in) :: material(:)  !! Materials (n_materials).
    type(bubble_table_t), intent(in) :: table(:)  !! Bubbles of the kinds of the blocks (n_blocks).
    type(face_tractions_t), intent(in) :: tractions  !! Mean tractions at faces between elements, where known.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    integer, intent(in) :: element  !! The element, in the order of the blocks.
    !> Residual forces on the bubbles; not allocated where the element is inverted (dim*n_bubbles, n_bodies) [force].
    real(dp), allocatable, intent(out) :: rhs(:, :)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the modulus field has no value.
    !> Stiffness of the bubbles, its lower triangle, by bubbles and then components (dim*n_bubbles, dim*n_bubbles)
    !> [force/length].
    real(dp), allocatable, intent(out), optional :: matrix(:, :)
    real(dp), allocatable :: lower(:, :)
    logical :: valid
    integer :: block, n_bodies, dim, n, n_bubbles, n_strains, slots, n_points, n_matrix
    block = data%faces%block(element)
    n_bodies = size(u, 1)
    dim = mesh%dimension
    n = size(mesh%block(block)%node, 1)
    n_bubbles = table(block)%n
    n_strains = material(1)%form%n_strains
    slots = material(1)%slots
    n_points = table(block)%points%n_points
    allocate (rhs(dim*n_bubbles, n_bodies))
    ! Where it is not wanted the matrix is of size 0.
    n_matrix = merge(dim*n_bubbles, 0, present(matrix))
    allocate (lower(n_matrix, n_matrix))
    call set_up(mesh%block(block)%node(:, element - data%faces%before(block)), rhs, lower)
    if (present(matrix)) call move_alloc(lower, matrix)
    if (.not. valid) deallocate (rhs)

  contains

    !> Set up the local problem; it is not valid where a point of the element is inverted.
    subroutine set_up(node, of_bubbles, lower_triangle)
      integer, intent(in) :: node(n)  !! Nodes of the element (n).
      real(dp), intent(out) :: of_bubbles(n_bubbles, dim, n_bodies)  !! Residual forces on the bubbles [force].
      real(dp), intent(out) :: lower_triangle(n_matrix, n_matrix)  !! Of the stiffness, alone [force/length].
      real(dp) :: inverse(n_points, dim, dim), stress(n_points, n_strains, n_bodies)
      real(dp), dimension(n_points) :: radius, w, modulus
      real(dp) :: by_reference(n_points, dim, n_bodies), stiffness(n_strains, n_strains, n_points), worst
      integer :: i, j, k, l, s
      valid = .false.
      of_bubbles = 0
      associate (own => table(block), mine => material(mesh%block(block)%material), &
                 density => data%density(:, :, mesh%block(block)%material))
        call stresses_at(n, n_points, n_bodies, dim, n_strains, slots, mine, own%points, node, mesh%x, u, .false., &
                         inverse, radius, w, modulus, stress, worst, error, stiffness)
        if (allocated(error) .or. .not. worst > 0) return
        ! - sigma : grad w, the stress taken to the reference coordinates.
        do l = 1, dim
          by_reference = 0
          do k = 1, n_bodies
            do s = 1, dim
              do i = 1, dim
                j = mine%form%index(i, s)
                if (j > 0) by_reference(:, i, k) = by_reference(:, i, k) + w*inverse(:, l, s)*stress(:, j, k)
              end do
            end do
          end do
          call dgemm('T', 'N', n_bubbles, dim*n_bodies, n_points, -1.0_dp, own%slope(:, :, l), n_points, by_reference, &
                     n_points, 1.0_dp, of_bubbles, n_bubbles)
        end do
        do k = 1, n_bodies
          do i = 1, dim
            if (slots > dim) then
              j = mine%form%index(i, 3)
              if (j > 0) of_bubbles(:, i, k) = of_bubbles(:, i, k) - &
                matmul(own%value, w(:own%n_points)*stress(:own%n_points, j, k)/radius(:own%n_points))
            end if
            if (abs(density(i, k)) > 0) of_bubbles(:, i, k) = of_bubbles(:, i, k) + &
              density(i, k)*matmul(own%value, w(:own%n_points))
          end do
        end do
        call add_faces(n_bodies, dim, n, n_bubbles, n_strains, slots, mesh, data%faces, data%held, material, table, &
                       tractions, block, u, element, node, of_bubbles, worst, error)
        if (allocated(error) .or. .not. worst > 0) return
        call add_loads(n_bodies, dim, n_bubbles, data, own, element, of_bubbles)
        if (n_matrix > 0) call bubble_stiffness(n_points, n_bubbles, dim, slots, n_strains, own, mine, inverse, &
                                                   radius, w*modulus, stiffness, lower_triangle)
      end associate
      valid = .true.
    end subroutine set_up
  end subroutine residual_problem

  !> Add the loads at points; those along held directions do no work.
  subroutine add_loads(n_bodies, dim, n_bubbles, data, table, element, rhs)
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n_bubbles  !! Number of bubbles.
    type(residual_data_t), intent(in) :: data  !! Loads and held directions.
    type(bubble_table_t), intent(in) :: table  !! Bubbles of the element's kind.
    integer, intent(in) :: element  !! The element.
    real(dp), intent(inout) :: rhs(n_bubbles, dim, n_bodies)  !! Residual forces on the bubbles, added to [force].
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

  !> The stiffness of the bubbles, its lower triangle.
  subroutine bubble_stiffness(n_points, n_bubbles, dim, slots, n_strains, table, material, inverse, radius, w, &
                              stiffness, matrix)
    !> Numbers of points with repetitions, bubbles, displacement components, gradient slots and strains.
    integer, intent(in) :: n_points, n_bubbles, dim, slots, n_strains
    type(bubble_table_t), intent(in) :: table  !! Bubbles of the kind.
    type(point_material_t), intent(in) :: material  !! Material.
    real(dp), intent(in) :: inverse(n_points, dim, dim)  !! Inverse Jacobians (n_points, dim, dim) [1/length].
    real(dp), intent(in) :: radius(n_points)  !! Radius in axisymmetric analyses (n_points) [length].
    real(dp), intent(in) :: w(n_points)  !! Weights of the points by the modulus factor (n_points) [volume].
    real(dp), intent(in) :: stiffness(n_strains, n_strains, n_points)  !! Material, by the factor [pressure].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)  !! Lower triangle [force/length].
    real(dp) :: slope(n_points, n_bubbles, slots)
    integer :: i, k, q, s
    slope = 0
    do s = 1, dim
      do i = 1, n_bubbles
        do k = 1, dim
          do q = 1, n_points
            slope(q, i, s) = slope(q, i, s) + table%slope(q, i, k)*inverse(q, k, s)
          end do
        end do
      end do
    end do
    if (slots > dim) then
      do q = 1, table%n_points
        slope(q, :, 3) = table%value(:, q)/radius(q)
      end do
    end if
    if (material%field%varies) then
      call form_varying(n_points, n_bubbles, dim, slots, n_strains, material%form%index, stiffness, w, slope, matrix)
    else
      call form_matrix(n_points, n_bubbles, dim, slots, n_strains, material%form%index, material%stiffness, w, slope, &
                       matrix)
    end if
  end subroutine bubble_stiffness

  !> The stiffness of the bubbles, its lower triangle: from sums over the points of products of two derivatives.
  subroutine form_matrix(n_points, n_bubbles, dim, slots, n_strains, index, stiffness, w, slope, matrix)
    integer, intent(in) :: n_points  !! Number of points.
    integer, intent(in) :: n_bubbles  !! Number of bubbles.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: slots  !! Number of gradient slots.
    integer, intent(in) :: n_strains  !! Number of strains.
    integer, intent(in) :: index(dim, slots)  !! Strain of each slot of each component, 0 for none (dim, slots).
    real(dp), intent(in) :: stiffness(n_strains, n_strains)  !! From strains to stresses [pressure].
    real(dp), intent(in) :: w(n_points)  !! Weights of the points (n_points) [volume].
    real(dp), intent(in) :: slope(n_points, n_bubbles, slots)  !! Derivatives of the bubbles [1/length].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)  !! Lower triangle [force/length].
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
    integer, intent(in) :: index(dim, slots)  !! Strain of each slot of each component, 0 for none (dim, slots).
    real(dp), intent(in) :: stiffness(n_strains, n_strains, n_points)  !! From strains to stresses [pressure].
    real(dp), intent(in) :: w(n_points)  !! Weights of the points (n_points) [volume].
    real(dp), intent(in) :: slope(n_points, n_bubbles, slots)  !! Derivatives of the bubbles [1/length].
    real(dp), intent(out) :: matrix(n_bubbles, dim, n_bubbles, dim)  !! Lower triangle [force/length].
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
end module dotyk_elasticity_element_residual
