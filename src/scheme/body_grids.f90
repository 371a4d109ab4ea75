!> Several bodies with their p-multigrids, and the contact rows on both levels of each body.
!>
!> A vector has the unknowns of the bodies (`multigrid_t`), one body after the other. Rows of B add up over the bodies
!> in their order: sums do not depend on the number of threads.
module dotyk_scheme_body_grids
  use dotyk_base_kinds, only: dp, sp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_conjugate_gradient, only: preconditioned_system_t
  use dotyk_response_contact_map, only: contact_map_t
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_multigrid_rows, only: multigrid_rows_t
  implicit none
  private
  public :: scatter_rows

  !> A body among others.
  type, public :: grid_body_t
    !> Body whose p-multigrid is that of this one: congruent bodies share it.
    integer :: representative = 0
    !> Contact nodes and their equations.
    type(contact_map_t) :: map
    !> Rows of the problem that involve the body, in the order of `rows`.
    integer, allocatable :: row(:)
    !> Its rows on both levels.
    type(multigrid_rows_t) :: rows
  end type grid_body_t

  !> The p-multigrid of a body.
  type, public :: grid_pointer_t
    !> Associated for representatives of congruent bodies.
    type(multigrid_t), pointer :: p => null()
  end type grid_pointer_t

  !> The bodies: the base of linear systems over all of them. It refers to the p-multigrids of others.
  type, abstract, extends(preconditioned_system_t), public :: body_grids_t
    !> Number of unknowns.
    integer :: n = 0
    !> Number of contact rows.
    integer :: n_rows = 0
    !> Components of a node.
    integer :: dim = 0
    !> Unknowns of body b are first(b)+1 .. first(b+1) (n_bodies + 1).
    integer, allocatable :: first(:)
    !> p-multigrids of the representatives (n_bodies).
    type(grid_pointer_t), allocatable :: grid(:)
    !> (n_bodies).
    type(grid_body_t), allocatable :: body(:)
    !> Modes of body b are first_mode(b)+1 .. first_mode(b+1) (n_bodies + 1).
    integer, allocatable :: first_mode(:)
  contains
    procedure :: init => grids_init
    procedure :: row_displacement => grids_row_displacement
    procedure :: row_displacement_low => grids_row_displacement_low
    procedure :: subtract_row_force => grids_subtract_row_force
    procedure :: subtract_row_force_low => grids_subtract_row_force_low
    procedure :: multiply_bodies => grids_multiply_bodies
    procedure :: row_compliance => grids_row_compliance
    procedure :: corner_displacement => grids_corner_displacement
  end type body_grids_t

contains

  !> Take the p-multigrids of the bodies, and carry the contact rows to both levels.
  subroutine grids_init(self, block, n_rows, grid, body)
    class(body_grids_t), intent(out) :: self
    !> Rows of B by bodies (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Number of contact rows.
    integer, intent(in) :: n_rows
    !> Of the representatives (n_bodies).
    type(grid_pointer_t), intent(in) :: grid(:)
    !> With representatives and maps; not allocated on return (n_bodies).
    type(grid_body_t), allocatable, intent(inout) :: body(:)
    integer :: b
    self%grid = grid
    call move_alloc(body, self%body)
    self%n_rows = n_rows
    allocate (self%first(size(self%body) + 1), self%first_mode(size(self%body) + 1))
    self%first(1) = 0
    self%first_mode(1) = 0
    do b = 1, size(self%body)
      associate (own => self%body(b), grid_of => self%grid(self%body(b)%representative)%p)
        self%dim = grid_of%fine%rows%dim
        self%first(b + 1) = self%first(b) + grid_of%n
        self%first_mode(b + 1) = self%first_mode(b) + size(grid_of%mode, 2)
        own%row = block(b)%row
        call own%rows%init(grid_of, own%map, block(b)%matrix)
      end associate
    end do
    self%n = self%first(size(self%body) + 1)
  end subroutine grids_init

  !> Add a vector over the rows of a body to one over all rows. A row can belong to a body twice.
  pure subroutine scatter_rows(row, own, all)
    !> Rows of the body (n).
    integer, intent(in) :: row(:)
    !> At these rows (n) [any].
    real(dp), intent(in) :: own(:)
    !> At all rows (n_rows) [as own].
    real(dp), intent(inout) :: all(:)
    integer :: i
    do i = 1, size(row)
      all(row(i)) = all(row(i)) + own(i)
    end do
  end subroutine scatter_rows

  !> y = B x.
  subroutine grids_row_displacement(self, x, y)
    class(body_grids_t), intent(in) :: self
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: x(:)
    !> At the rows (n_rows) [length].
    real(dp), intent(out) :: y(:)
    real(dp), allocatable :: own(:)
    integer :: b
    y = 0
    do b = 1, size(self%body)
      allocate (own(size(self%body(b)%row)), source=0.0_dp)
      call self%body(b)%rows%add_displacement(self%dim, x(self%first(b) + 1:self%first(b + 1)), own)
      call scatter_rows(self%body(b)%row, own, y)
      deallocate (own)
    end do
  end subroutine grids_row_displacement

  !> y = B x of a vector in single precision, x of each body times the scale of its stiffness.
  subroutine grids_row_displacement_low(self, x, y)
    class(body_grids_t), intent(in) :: self
    !> Scaled displacements (n) [force].
    real(sp), intent(in), contiguous :: x(:)
    !> At the rows (n_rows) [length].
    real(dp), intent(out) :: y(:)
    real(dp), allocatable :: own(:)
    integer :: b
    y = 0
    do b = 1, size(self%body)
      allocate (own(size(self%body(b)%row)), source=0.0_dp)
      call self%body(b)%rows%add_displacement_low(self%dim, &
        1/self%grid(self%body(b)%representative)%p%fine%rows%scale, x(self%first(b) + 1:self%first(b + 1)), own)
      call scatter_rows(self%body(b)%row, own, y)
      deallocate (own)
    end do
  end subroutine grids_row_displacement_low

  !> r := r - B^T lambda.
  subroutine grids_subtract_row_force(self, lambda, r)
    class(body_grids_t), intent(in) :: self
    !> Contact forces (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> Forces (n) [force].
    real(dp), intent(inout), contiguous :: r(:)
    integer :: b
    do b = 1, size(self%body)
      associate (own => self%body(b))
        call own%rows%subtract_force(self%dim, lambda(own%row), r(self%first(b) + 1:self%first(b + 1)))
      end associate
    end do
  end subroutine grids_subtract_row_force

  !> r := r - B^T lambda in single precision.
  subroutine grids_subtract_row_force_low(self, lambda, r)
    class(body_grids_t), intent(in) :: self
    !> Contact forces (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> Residual (n) [force].
    real(sp), intent(inout), contiguous :: r(:)
    integer :: b
    do b = 1, size(self%body)
      associate (own => self%body(b))
        call own%rows%subtract_force_low(self%dim, lambda(own%row), r(self%first(b) + 1:self%first(b + 1)))
      end associate
    end do
  end subroutine grids_subtract_row_force_low

  !> y = K x.
  subroutine grids_multiply_bodies(self, x, y)
    class(body_grids_t), intent(in) :: self
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: x(:)
    !> Forces (n) [force].
    real(dp), intent(out), contiguous :: y(:)
    integer :: b
    do b = 1, size(self%body)
      associate (first => self%first(b) + 1, last => self%first(b + 1))
        call self%grid(self%body(b)%representative)%p%multiply(x(first:last), y(first:last))
      end associate
    end do
  end subroutine grids_multiply_bodies

  !> Compliance of each row in the corner space, the diagonal of B P K_c^+ P^T B^T.
  pure function grids_row_compliance(self) result(compliance)
    class(body_grids_t), intent(in) :: self
    !> (n_rows) [length/force].
    real(dp) :: compliance(self%n_rows)
    integer :: b, i
    compliance = 0
    do b = 1, size(self%body)
      associate (own => self%body(b))
        call scatter_rows(own%row, [(own%rows%compliance(i, i), i=1, size(own%row))], compliance)
      end associate
    end do
  end function grids_row_compliance

  !> B P K_c^+ P^T f: the rows by loads, in the corner space, without contact.
  subroutine grids_corner_displacement(self, f, y)
    class(body_grids_t), intent(in) :: self
    !> Loads (n) [force].
    real(dp), intent(in), contiguous :: f(:)
    !> At the rows (n_rows) [length].
    real(dp), intent(out) :: y(:)
    real(dp), allocatable :: coarse(:), own(:)
    real(dp) :: size_of_f
    integer :: b
    y = 0
    do b = 1, size(self%body)
      associate (first => self%first(b) + 1, last => self%first(b + 1), &
                 grid => self%grid(self%body(b)%representative)%p)
        size_of_f = max(maxval(abs(f(first:last))), tiny(size_of_f))
        allocate (coarse(grid%corner_constraint%n_equations), own(size(self%body(b)%row)))
        call grid%space%restrict(grid%constraint, grid%corner_constraint, size_of_f, &
                                 real(f(first:last)/size_of_f, sp), coarse)
        call grid%coarse%solve(coarse)
        call self%body(b)%rows%corner%multiply(coarse, own)
        call scatter_rows(self%body(b)%row, own, y)
        deallocate (coarse, own)
      end associate
    end do
  end subroutine grids_corner_displacement
end module dotyk_scheme_body_grids
