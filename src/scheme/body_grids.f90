!> Several bodies with their p-multigrids, and the contact rows on both levels of each body.
!>
!> A vector has the unknowns of the bodies (`body_grid_t`), one body after the other. Rows of B add up over the bodies
!> in their order: sums do not depend on the number of threads.
!>
!> A body that is larger than its share of the machine is worked on by all threads, bodies that are smaller side by
!> side, one thread each (`dotyk_scheme_grid_body`): a loop over the former, then one in parallel over the latter.
module dotyk_scheme_body_grids
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, sp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_fixed_sum, only: add_multiple, scalar_product
  use dotyk_response_multigrid, only: least_shared
  use dotyk_scheme_corner_group, only: corner_group_t
  use dotyk_scheme_grid_body, only: body_groups_t, body_vector_t, grid_body_t, grid_pointer_t, scatter_rows
  use dotyk_scheme_proximal_system, only: proximal_system_t
  implicit none
  private

  !> The bodies: the base of linear systems over all of them. It refers to the p-multigrids of others.
  type, abstract, extends(proximal_system_t), public :: body_grids_t
    integer :: dim = 0  !! Components of a node.
    integer, allocatable :: first(:)  !! Unknowns of body b are first(b)+1 .. first(b+1) (n_bodies + 1).
    type(grid_pointer_t), allocatable :: grid(:)  !! p-multigrids of the representatives (n_bodies).
    type(grid_body_t), allocatable :: body(:)  !! (n_bodies).
    integer, allocatable :: first_mode(:)  !! Modes of body b are first_mode(b)+1 .. first_mode(b+1) (n_bodies + 1).
    type(body_groups_t) :: groups  !! Bodies that are worked on side by side, by their unknowns.
    type(corner_group_t), allocatable :: group(:)  !! Bodies, or groups of tied ones, in the corner space (n_groups).
    type(body_groups_t) :: solves  !! Groups side by side, by the entries of their factors: solves in the corner space.
    logical, allocatable :: is_tied(:)  !! Rows of ties, which are always active (n_rows).
    !> Why ties cannot be closed in the corner space; not allocated where they can.
    type(error_t), allocatable :: obstacle
  contains
    procedure :: init => grids_init
    procedure :: solve_group => grids_solve_group
    procedure :: tie_stiffness => grids_tie_stiffness
    procedure :: row_displacement => grids_row_displacement
    procedure :: row_displacement_low => grids_row_displacement_low
    procedure :: subtract_row_force => grids_subtract_row_force
    procedure :: subtract_row_force_low => grids_subtract_row_force_low
    procedure :: multiply_bodies => grids_multiply_bodies
    procedure :: strain_forces => grids_strain_forces
    procedure :: many_rows => grids_many_rows
    procedure :: add_rows => grids_add_rows
    procedure :: add_modes => grids_add_modes
    procedure :: resultants => grids_resultants
    procedure :: row_resultants => grids_row_resultants
    procedure :: product => grids_product
    procedure :: row_compliance => grids_row_compliance
    procedure :: is_rigid_row => grids_is_rigid_row
  end type body_grids_t

  !> The proximal term as a fraction of the compliance of the rows in the corner space. Smaller ones converge in fewer
  !> proximal steps, and lose more digits of B u in the pressures.
  real(dp), parameter :: proximal_fraction = 1.0e-4_dp
  !> Compliance of a row in the corner space, in terms of that against the diagonal blocks, about [].
  real(dp), parameter :: tie_factor = 10
  integer, parameter :: worth_threads = 1000  !! Rows from which on threads are worth their start in a product with B.

contains

  !> Take the p-multigrids of the bodies, and carry the contact rows to both levels.
  subroutine grids_init(self, block, n_rows, grid, body, is_tied)
    class(body_grids_t), intent(out) :: self
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B by bodies of the QP (any number).
    integer, intent(in) :: n_rows  !! Number of contact rows.
    type(grid_pointer_t), intent(in) :: grid(:)  !! Of the representatives (n_bodies).
    !> With representatives and maps, and the rows of motions; not allocated on return (n_bodies).
    type(grid_body_t), allocatable, intent(inout) :: body(:)
    logical, intent(in), optional :: is_tied(:)  !! Rows of ties; none if absent (n_rows).
    integer :: b, k
    self%grid = grid
    call move_alloc(body, self%body)
    self%n_rows = n_rows
    self%proximal_fraction = proximal_fraction
    allocate (self%is_tied(n_rows), source=.false.)
    if (present(is_tied)) self%is_tied(:) = is_tied
    allocate (self%first(size(self%body) + 1), self%first_mode(size(self%body) + 1))
    self%first(1) = 0
    self%first_mode(1) = 0
    do b = 1, size(self%body)
      associate (grid_of => self%grid(self%body(b)%representative)%p)
        self%dim = grid_of%fine%rows%dim
        self%first(b + 1) = self%first(b) + grid_of%n
        self%first_mode(b + 1) = self%first_mode(b) + size(grid_of%mode, 2)
        if (self%body(b)%block == 0) self%body(b)%block = b
        if (.not. allocated(self%body(b)%row)) self%body(b)%row = block(self%body(b)%block)%row
      end associate
    end do
    self%n = self%first(size(self%body) + 1)
    call self%groups%init(real(self%first(2:) - self%first(:size(self%body)), dp), omp_get_max_threads())
    do k = 1, self%groups%n_alone
      call carry_rows(self%groups%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%groups%n_alone < self%groups%n)
    do k = self%groups%n_alone + 1, self%groups%n
      call carry_rows(self%groups%body(k))
    end do
    !$omp end parallel do
    call form_groups(self)
    call form_compliances(self)
    call share_solves(self)

  contains

    !> The rows of one body.
    subroutine carry_rows(b)
      integer, intent(in) :: b  !! The body.
      if (self%body(b)%first_motion > 0) return
      call self%body(b)%rows%init(self%grid(self%body(b)%representative)%p, self%body(b)%map, &
                                  block(self%body(b)%block)%matrix)
    end subroutine carry_rows
  end subroutine grids_init

  !> Groups of bodies that ties join, in the order of their first bodies; others are by themselves.
  subroutine form_groups(self)
    class(body_grids_t), intent(inout) :: self
    integer :: first(size(self%body)), of_row(self%n_rows), b, i, k
    logical :: has_tie(size(self%body)), changes
    first = [(b, b=1, size(first))]
    has_tie = [(any(self%is_tied(self%body(b)%row)), b=1, size(first))]
    changes = any(has_tie)
    do while (changes)
      changes = .false.
      of_row = size(first)
      do b = 1, size(first)
        of_row(self%body(b)%row) = min(of_row(self%body(b)%row), first(b))
      end do
      do b = 1, size(first)
        associate (least => minval([first(b), pack(of_row(self%body(b)%row), self%is_tied(self%body(b)%row))]))
          changes = changes .or. least < first(b)
          first(b) = least
        end associate
      end do
    end do
    allocate (self%group(count(first == [(b, b=1, size(first))])))
    k = 0
    do b = 1, size(first)
      if (first(b) /= b) cycle
      k = k + 1
      if (has_tie(b)) then
        if (.not. allocated(self%obstacle)) &
          call self%group(k)%init_tied(pack([(i, i=1, size(first))], first == b), self%body, self%grid, &
                                       self%first_mode, self%is_tied, self%tie_stiffness(), self%obstacle)
      else
        call self%group(k)%init(b, self%body(b), self%first_mode(b))
      end if
    end do
  end subroutine form_groups

  !> W of tied rows, as they have it in each active set; 0 of contact rows.
  pure function grids_tie_stiffness(self) result(stiffness)
    class(body_grids_t), intent(in) :: self
    real(dp) :: stiffness(self%n_rows)  !! (n_rows) [force/length]
    stiffness = tie_compliance(self)
    where (self%is_tied .and. stiffness > 0)
      stiffness = 1/(self%proximal_fraction*stiffness)
    else where
      stiffness = 0
    end where
  end function grids_tie_stiffness

  !> Compliance of tied rows against the diagonal blocks: that in the corner space would take as many solves.
  pure function tie_compliance(self) result(compliance)
    class(body_grids_t), intent(in) :: self
    real(dp) :: compliance(self%n_rows)  !! 0 of contact rows (n_rows) [length/force].
    integer :: b, i, k
    compliance = 0
    do b = 1, size(self%body)
      associate (row => self%body(b)%row, matrix => self%body(b)%rows%smoother)
        do i = 1, size(row)
          if (.not. self%is_tied(row(i))) cycle
          do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            if (matrix%column(k) == i) compliance(row(i)) = compliance(row(i)) + tie_factor*matrix%value(k)
          end do
        end do
      end associate
    end do
  end function tie_compliance

  !> Compliances of the rows in the corner space; congruent bodies with the same rows share them.
  subroutine form_compliances(self)
    class(body_grids_t), intent(inout) :: self
    integer :: k, l, i
    do k = 1, size(self%group)
      self%group(k)%owner = k
      if (self%group(k)%is_tied) cycle
      associate (own => self%body(self%group(k)%body(1)))
        do l = 1, k - 1
          if (self%group(l)%is_tied .or. self%group(l)%owner /= l) cycle
          associate (other => self%body(self%group(l)%body(1)))
            if (other%representative /= own%representative) cycle
            if (.not. own%rows%is_like(other%rows)) cycle
          end associate
          self%group(k)%owner = l
          exit
        end do
        if (own%rows%n > 0) call self%grid(own%representative)%p%prepare_rows()
      end associate
    end do
    do i = 1, self%groups%n_alone
      call form_compliance(self%groups%body(i))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%groups%n_alone < self%groups%n)
    do i = self%groups%n_alone + 1, self%groups%n
      call form_compliance(self%groups%body(i))
    end do
    !$omp end parallel do

  contains

    !> The compliance of one body.
    subroutine form_compliance(b)
      integer, intent(in) :: b  !! The body.
      integer :: g
      do g = 1, size(self%group)
        if (self%group(g)%is_tied .or. self%group(g)%owner /= g) cycle
        if (self%group(g)%body(1) /= b) cycle
        call self%grid(self%body(b)%representative)%p%form_row_compliance(self%body(b)%rows%corner, &
                                                                          self%group(g)%compliance)
      end do
    end subroutine form_compliance
  end subroutine form_compliances

  !> Choose the groups whose solves in the corner space are side by side.
  subroutine share_solves(self)
    class(body_grids_t), intent(inout) :: self
    real(dp) :: entries(size(self%group))
    integer :: k
    do k = 1, size(entries)
      if (self%group(k)%is_tied) then
        entries(k) = self%group(k)%entries()
      else
        entries(k) = self%grid(self%body(self%group(k)%body(1))%representative)%p%corner_entries()
      end if
    end do
    call self%solves%init(entries, merge(omp_get_max_threads(), 1, maxval(entries) > least_shared))
  end subroutine share_solves

  !> x := K_c^+ x in the corner spaces of the bodies of a group; with its ties, where it has some.
  subroutine grids_solve_group(self, k, x)
    class(body_grids_t), intent(in) :: self
    integer, intent(in) :: k  !! The group.
    !> Forces in [force], displacements out [length], of all bodies (n_bodies).
    type(body_vector_t), intent(inout) :: x(:)
    associate (group => self%group(k))
      if (group%is_tied) then
        call group%solve(x)
      else
        call self%grid(self%body(group%body(1))%representative)%p%solve_coarse(x(group%body(1))%value)
      end if
    end associate
  end subroutine grids_solve_group

  !> The sum of vectors over the rows of each body.
  pure subroutine grids_add_rows(self, own, y)
    class(body_grids_t), intent(in) :: self
    type(body_vector_t), intent(in) :: own(:)  !! At the rows of each body (n_bodies) [any].
    real(dp), intent(out) :: y(:)  !! At all rows (n_rows) [as own].
    integer :: b
    y = 0
    do b = 1, size(self%body)
      call scatter_rows(self%body(b)%row, own(b)%value, y)
    end do
  end subroutine grids_add_rows

  !> y = B u.
  subroutine grids_row_displacement(self, u, y)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(out) :: y(:)  !! At the rows (n_rows) [length].
    type(body_vector_t), allocatable :: own(:)
    integer :: b
    allocate (own(size(self%body)))
    !$omp parallel do default(none) shared(self, u, own) schedule(dynamic, 1) if (self%many_rows())
    do b = 1, size(self%body)
      allocate (own(b)%value(size(self%body(b)%row)), source=0.0_dp)
      call self%body(b)%rows%add_displacement(self%dim, u(self%first(b) + 1:self%first(b + 1)), own(b)%value)
    end do
    !$omp end parallel do
    call self%add_rows(own, y)
  end subroutine grids_row_displacement

  !> Whether threads are worth their start in a product with B.
  pure logical function grids_many_rows(self) result(many_rows)
    class(body_grids_t), intent(in) :: self
    many_rows = size(self%body) > 1 .and. self%n_rows > worth_threads
  end function grids_many_rows

  !> y = B x of a vector in single precision, x of each body times the scale of its stiffness.
  subroutine grids_row_displacement_low(self, x, y)
    class(body_grids_t), intent(in) :: self
    real(sp), intent(in), contiguous :: x(:)  !! Scaled displacements (n) [force].
    real(dp), intent(out) :: y(:)  !! At the rows (n_rows) [length].
    type(body_vector_t), allocatable :: own(:)
    integer :: b
    allocate (own(size(self%body)))
    !$omp parallel do default(none) shared(self, x, own) schedule(dynamic, 1) if (self%many_rows())
    do b = 1, size(self%body)
      allocate (own(b)%value(size(self%body(b)%row)), source=0.0_dp)
      call self%body(b)%rows%add_displacement_low(self%dim, &
        1/self%grid(self%body(b)%representative)%p%fine%rows%scale, x(self%first(b) + 1:self%first(b + 1)), &
        own(b)%value)
    end do
    !$omp end parallel do
    call self%add_rows(own, y)
  end subroutine grids_row_displacement_low

  !> r := r - B^T lambda.
  subroutine grids_subtract_row_force(self, lambda, r)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(inout), contiguous :: r(:)  !! Forces (n) [force].
    integer :: b
    !$omp parallel do default(none) shared(self, lambda, r) schedule(dynamic, 1) if (self%many_rows())
    do b = 1, size(self%body)
      associate (own => self%body(b))
        call own%rows%subtract_force(self%dim, lambda(own%row), r(self%first(b) + 1:self%first(b + 1)))
      end associate
    end do
    !$omp end parallel do
  end subroutine grids_subtract_row_force

  !> r := r - B^T lambda in single precision.
  subroutine grids_subtract_row_force_low(self, lambda, r)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(sp), intent(inout), contiguous :: r(:)  !! Residual (n) [force].
    integer :: b
    !$omp parallel do default(none) shared(self, lambda, r) schedule(dynamic, 1) if (self%many_rows())
    do b = 1, size(self%body)
      associate (own => self%body(b))
        call own%rows%subtract_force_low(self%dim, lambda(own%row), r(self%first(b) + 1:self%first(b + 1)))
      end associate
    end do
    !$omp end parallel do
  end subroutine grids_subtract_row_force_low

  !> y = K x.
  subroutine grids_multiply_bodies(self, x, y)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Displacements (n) [length].
    real(dp), intent(out), contiguous :: y(:)  !! Forces (n) [force].
    integer :: k
    do k = 1, self%groups%n_alone
      call multiply_body(self%groups%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%groups%n_alone < self%groups%n)
    do k = self%groups%n_alone + 1, self%groups%n
      call multiply_body(self%groups%body(k))
    end do
    !$omp end parallel do

  contains

    !> The product of one body.
    subroutine multiply_body(b)
      integer, intent(in) :: b  !! The body.
      associate (first => self%first(b) + 1, last => self%first(b + 1))
        call self%grid(self%body(b)%representative)%p%multiply(x(first:last), y(first:last))
      end associate
    end subroutine multiply_body
  end subroutine grids_multiply_bodies

  !> u := u + R alpha.
  subroutine grids_add_modes(self, alpha, u)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in) :: alpha(:)  !! Amplitudes of the rigid body modes (n_modes) [length].
    real(dp), intent(inout), contiguous :: u(:)  !! Displacements (n) [length].
    integer :: b, k
    do b = 1, size(self%body)
      associate (grid => self%grid(self%body(b)%representative)%p)
        do k = 1, size(grid%mode, 2)
          call add_multiple(grid%n, alpha(self%first_mode(b) + k), grid%mode(:, k), &
                            u(self%first(b) + 1:self%first(b + 1)))
        end do
      end associate
    end do
  end subroutine grids_add_modes

  !> f = K u without the rigid motions of u, of which rounding would leave forces.
  subroutine grids_strain_forces(self, u, f)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(out), contiguous :: f(:)  !! Forces (n) [force].
    real(dp), allocatable :: strained(:)
    if (self%first_mode(size(self%first_mode)) == 0) then
      call self%multiply_bodies(u, f)
    else
      allocate (strained, source=u)
      call self%add_modes(-self%resultants(u), strained)
      call self%multiply_bodies(strained, f)
    end if
  end subroutine grids_strain_forces

  !> R^T f.
  function grids_resultants(self, f) result(resultant)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Forces (n) [force].
    real(dp), allocatable :: resultant(:)  !! On the rigid body modes (n_modes) [force].
    integer :: b, k
    allocate (resultant(self%first_mode(size(self%first_mode))))
    do b = 1, size(self%body)
      associate (grid => self%grid(self%body(b)%representative)%p)
        do k = 1, size(grid%mode, 2)
          resultant(self%first_mode(b) + k) = scalar_product(grid%n, grid%mode(:, k), &
                                                             f(self%first(b) + 1:self%first(b + 1)))
        end do
      end associate
    end do
  end function grids_resultants

  !> G^T lambda, G = B R.
  function grids_row_resultants(self, lambda) result(resultant)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), allocatable :: resultant(:)  !! On the rigid body modes (n_modes) [force].
    integer :: b
    allocate (resultant(self%first_mode(size(self%first_mode))))
    do b = 1, size(self%body)
      associate (own => self%body(b))
        resultant(self%first_mode(b) + 1:self%first_mode(b + 1)) = matmul(lambda(own%row), own%rows%mode)
      end associate
    end do
  end function grids_row_resultants

  !> Scalar product, the same on any number of threads.
  real(dp) function grids_product(self, a, b) result(product)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: a(:), b(:)  !! Vectors (n) [any].
    product = scalar_product(self%n, a, b)
  end function grids_product

  !> Compliance of each row: of contact rows in the corner space, the diagonal of B P K_c^+ P^T B^T; of tied ones
  !> against the diagonal blocks.
  pure function grids_row_compliance(self) result(compliance)
    class(body_grids_t), intent(in) :: self
    real(dp) :: compliance(self%n_rows)  !! (n_rows) [length/force].
    integer :: k, i
    compliance = tie_compliance(self)
    do k = 1, size(self%group)
      associate (own => self%group(k), value => self%group(self%group(k)%owner)%compliance)
        call scatter_rows(own%row, [(value(i, i), i=1, size(own%row))], compliance)
      end associate
    end do
  end function grids_row_compliance

  !> Whether rows have no free unknown.
  pure function grids_is_rigid_row(self) result(is_rigid)
    class(body_grids_t), intent(in) :: self
    logical :: is_rigid(self%n_rows)  !! (n_rows)
    integer :: b, i
    is_rigid = .true.
    do b = 1, size(self%body)
      associate (own => self%body(b), fine => self%body(b)%rows%fine)
        do i = 1, size(own%row)
          if (fine%row_start(i + 1) > fine%row_start(i)) is_rigid(own%row(i)) = .false.
        end do
      end associate
    end do
  end function grids_is_rigid_row
end module dotyk_scheme_body_grids
