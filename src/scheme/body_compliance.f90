!> The compliance of bodies with compliance operators of their own: matrix-free by solves, or as matrices where these
!> are formed.
!>
!> A product without entries solves every body once, side by side, congruent bodies in batches
!> (`dotyk_scheme_congruent_products`). Entries are formed when a scheme asks for them, many rows at a time
!> (`dotyk_scheme_entry_forming`). Congruent bodies have one operator; those that touch in the same way have one matrix
!> (`dotyk_scheme_entry_forming`).
module dotyk_scheme_body_compliance
  use dotyk_base_kinds, only: dp
  use dotyk_ranks_exchange, only: is_own, share
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_response_response, only: response_slot_t
  use dotyk_scheme_compliance, only: entries_t
  use dotyk_scheme_congruent_products, only: batch_t, make_batches, multiply_bodies, row_displacement_t, share_moved, &
    solve_bodies, solve_together
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_entry_forming, only: add_rows, body_operator_t, cut_rows, form_blocks, row_blocks_t
  implicit none
  private
  public :: body_operator_t

  type, extends(dense_compliance_t), public :: body_compliance_t  !! The operator, with entries that were formed.
    type(response_slot_t), allocatable :: response(:)  !! Operators of the representatives (n_bodies).
    type(body_operator_t), allocatable :: body(:)  !! (n_bodies).
    !> Whether bodies are solved side by side, or one after the other (each with all BLAS threads).
    logical :: side_by_side = .true.
    !> Bodies that may touch others, in batches of congruent ones, those with most work first.
    type(batch_t), allocatable, private :: batch(:)
  contains
    procedure :: init => compliance_init
    procedure :: has_grids => compliance_has_grids
    procedure :: body_grid => compliance_body_grid
    procedure :: solve_error => compliance_solve_error
    procedure :: forget_displacements => compliance_forget_displacements
    procedure :: solves_together => compliance_solves_together
    procedure :: solve => compliance_solve
    procedure :: solve_block => compliance_solve_block
    procedure :: multiply => compliance_multiply
    procedure :: form => compliance_form
    procedure :: form_bodies => compliance_form_bodies
    procedure :: form_all => compliance_form_all
    procedure :: nodal_diagonal => compliance_nodal_diagonal
    procedure :: get_costs => compliance_get_costs
    procedure :: destroy => compliance_destroy
  end type body_compliance_t

contains

  !> Take the operators of the bodies.
  subroutine compliance_init(self, qp, response, body, side_by_side)
    class(body_compliance_t), intent(out) :: self
    type(contact_qp_t), intent(in) :: qp  !! All rows.
    !> Factorized, of the representatives; not allocated on return (n_bodies).
    type(response_slot_t), allocatable, intent(inout) :: response(:)
    type(body_operator_t), allocatable, intent(inout) :: body(:)  !! Not allocated on return (n_bodies).
    logical, intent(in) :: side_by_side  !! As in `body_compliance_t`.
    integer :: b
    call self%dense_compliance_t%begin(qp)
    call move_alloc(response, self%response)
    call move_alloc(body, self%body)
    self%side_by_side = side_by_side
    call make_batches(self%body, [(size(qp%block(b)%row), b=1, size(self%body))], self%batch)
  end subroutine compliance_init

  !> Whether all bodies have p-multigrids, but for rigid ones.
  logical function compliance_has_grids(self) result(has_grids)
    class(body_compliance_t), intent(in) :: self
    integer :: b
    has_grids = any([(associated(self%body_grid(b)), b=1, size(self%body))])
    do b = 1, size(self%body)
      ! A rigid body has no equations.
      if (.not. associated(self%body_grid(b)) .and. any(self%body(b)%map%equation > 0)) has_grids = .false.
    end do
  end function compliance_has_grids

  !> The p-multigrid of a body; not associated where it has none.
  function compliance_body_grid(self, b) result(grid)
    class(body_compliance_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    class(body_grid_t), pointer :: grid  !! That of its representative.
    grid => self%response(self%body(b)%representative)%form%body_grid()
  end function compliance_body_grid

  !> Forget the displacements that a scheme has found.
  subroutine compliance_forget_displacements(self)
    class(body_compliance_t), intent(inout) :: self
    integer :: b
    do b = 1, size(self%body)
      if (allocated(self%body(b)%found)) deallocate (self%body(b)%found)
    end do
  end subroutine compliance_forget_displacements

  !> Relative error of solves in the energy norm; 0 where it is rounding.
  pure real(dp) function compliance_solve_error(self) result(error)
    class(body_compliance_t), intent(in) :: self
    integer :: b
    error = 0
    do b = 1, size(self%body)
      if (allocated(self%response(b)%form)) error = max(error, self%response(b)%form%solve_error())
    end do
  end function compliance_solve_error

  !> Whether all bodies are solved at once.
  pure logical function compliance_solves_together(self) result(together)
    class(body_compliance_t), intent(in) :: self
    integer :: b
    together = size(self%response) > 0
    do b = 1, size(self%response)
      if (together) together = allocated(self%response(b)%form)
      if (together) together = self%response(b)%form%solves_together()
    end do
  end function compliance_solves_together

  !> x := K_b^+ x, over the equations of a body; many threads may.
  subroutine compliance_solve(self, b, x)
    class(body_compliance_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    if (allocated(self%body(b)%found)) then
      call self%response(self%body(b)%representative)%form%solve_from(self%body(b)%found, x)
    else
      call self%response(self%body(b)%representative)%form%solve(x)
    end if
  end subroutine compliance_solve

  !> Solve a body for several right-hand sides: the entries of a factor are read once.
  subroutine compliance_solve_block(self, b, x)
    class(body_compliance_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    !> Right-hand sides [force] in, solutions [length] out (n_equations, n).
    real(dp), intent(inout), contiguous :: x(:, :)
    if (size(x, 2) == 1) then
      call self%solve(b, x(:, 1))
    else
      call self%response(self%body(b)%representative)%form%solve_block(x)
    end if
  end subroutine compliance_solve_block

  !> z = C lambda: by the matrices of bodies that have all entries, by one solve of every other body that the rows
  !> touch, or of all of them at once.
  subroutine compliance_multiply(self, qp, lambda, z)
    class(body_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(out) :: z(:)  !! Displacements of the rows (n_rows) [length].
    type(row_displacement_t) :: moved(size(self%body))
    logical :: formed(size(self%body)), together
    real(dp), allocatable :: force(:), moved_formed(:)
    integer :: i, b
    formed = [(self%is_body_formed(qp, b), b=1, size(self%body))]
    allocate (force(size(self%row_body, 2)), moved_formed(size(self%row_body, 2)), source=0.0_dp)
    ! Rows of an aggregation are none of the rows that are formed.
    if (any(formed)) force(qp%parent_row) = lambda
    together = self%solves_together()
    if (together) then
      formed = .false.
      call solve_together(self%response, self%body, qp%block, lambda, moved)
    end if
    ! Products with entries cost less than to start the threads.
    !$omp parallel do default(none) shared(self, qp, lambda, force, formed, moved) schedule(dynamic, 1) &
    !$omp& if (self%side_by_side .and. .not. all(formed))
    do i = 1, merge(0, size(self%batch), together)
      ! A batch is solved as a whole, so that its digits do not depend on the ranks of its bodies.
      if (.not. any(is_own(self%body(self%batch(i)%body)%owner))) cycle
      call multiply_batch(self, qp, self%batch(i)%body, formed, lambda, force, moved)
    end do
    !$omp end parallel do
    call share_moved(self%body%owner, lambda, moved)
    ! In the order of the bodies: the sum must not depend on which thread is first.
    z = 0
    do b = 1, size(self%body)
      if (.not. allocated(moved(b)%value)) cycle
      if (formed(b)) then
        associate (row => self%of_body(b)%row)
          moved_formed(row) = moved_formed(row) + moved(b)%value
        end associate
      else
        associate (row => qp%block(b)%row)
          z(row) = z(row) + moved(b)%value
        end associate
      end if
    end do
    if (any(formed)) z = z + moved_formed(qp%parent_row)
    if (.not. all(formed)) self%n_sweeps = self%n_sweeps + 1
  end subroutine compliance_multiply

  !> The products of one batch of congruent bodies.
  subroutine multiply_batch(self, qp, body, formed, lambda, force, moved)
    class(body_compliance_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: body(:)  !! The congruent bodies (n).
    logical, intent(in) :: formed(:)  !! Bodies whose entries at the rows are there (n_bodies).
    !> Contact forces, at the rows of the QP (n_rows), and at those of the QP of `begin` (all its rows) [force].
    real(dp), intent(in) :: lambda(:), force(:)
    type(row_displacement_t), intent(inout) :: moved(:)  !! Gets displacements of the bodies in the batch (n_bodies).
    logical :: has_rows(size(body))
    integer :: k
    has_rows = [(size(qp%block(body(k))%row) > 0, k=1, size(body))]
    call multiply_bodies(self%dense_compliance_t, pack(body, has_rows .and. formed(body)), force, moved)
    call solve_bodies(self%response(self%body(body(1))%representative)%form, self%body, qp%block, &
                      pack(body, has_rows .and. .not. formed(body)), lambda, moved)
  end subroutine multiply_batch

  !> Form the entries at all rows of a QP.
  subroutine compliance_form(self, qp, may_stop)
    class(body_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! A restriction of that of `begin`, in which all formed rows are.
    logical, intent(in), optional :: may_stop  !! As in `compliance_t`.
    integer :: b
    logical :: stops
    stops = .false.
    if (present(may_stop)) stops = may_stop
    call self%form_bodies(qp, [(.true., b=1, size(self%body))], stops)
  end subroutine compliance_form

  !> Form the entries of some bodies at all of their rows.
  subroutine compliance_form_bodies(self, qp, chosen, may_stop)
    class(body_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! As in `form`.
    logical, intent(in) :: chosen(:)  !! Bodies whose entries are formed (n_bodies).
    logical, intent(in) :: may_stop  !! Whether an interrupt ends it, with entries that are not valid.
    type(row_blocks_t), allocatable :: blocks(:)
    integer :: first_new(size(self%body)), b
    allocate (blocks(size(self%body)))
    first_new = 0
    do b = 1, size(self%body)
      if (.not. chosen(b) .or. self%is_body_formed(qp, b)) cycle
      call add_rows(self%dense_compliance_t, self%body, qp, b, blocks(b)%place, first_new(b))
      if (self%of_body(b)%same_as > 0) first_new(b) = 0
      if (first_new(b) == 0) cycle
      call cut_rows(self%of_body(b)%n, first_new(b), blocks(b)%first)
    end do
    if (all(first_new == 0)) return
    call form_blocks(self%response, self%body, qp%block, blocks, first_new, may_stop, self%dense_compliance_t)
    self%n_sweeps = self%n_sweeps + (maxval(self%of_body%n - first_new + 1, mask=first_new > 0) + 1)/2
  end subroutine compliance_form_bodies

  !> Entries at all rows of any QP over the same bodies; this operator keeps none of them.
  subroutine compliance_form_all(self, qp, entries)
    class(body_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! A restriction of that of `begin`, an aggregation, or that one.
    !> Entries of each body at its rows, in their order (n_bodies).
    type(entries_t), allocatable, intent(out) :: entries(:)
    type(dense_compliance_t) :: matrix
    type(row_blocks_t), allocatable :: blocks(:)
    integer :: first_new(size(self%body)), b, i
    allocate (entries(size(self%body)))
    if (self%is_formed(qp)) then
      do b = 1, size(self%body)
        call self%get_entries(qp, b, qp%block(b)%row, entries(b)%value)
      end do
      return
    end if
    allocate (matrix%of_body(size(self%body)), blocks(size(self%body)))
    first_new = 0
    do b = 1, size(self%body)
      associate (n => size(qp%block(b)%row))
        allocate (matrix%of_body(b)%value(n, n))
        if (n == 0) cycle
        first_new(b) = 1
        blocks(b)%place = [(i, i=1, n)]
        call cut_rows(n, 1, blocks(b)%first)
      end associate
    end do
    call form_blocks(self%response, self%body, qp%block, blocks, first_new, .false., matrix)
    do b = 1, size(self%body)
      call move_alloc(matrix%of_body(b)%value, entries(b)%value)
    end do
    self%n_sweeps = self%n_sweeps + (maxval([(size(qp%block(b)%row), b=1, size(self%body))]) + 1)/2
  end subroutine compliance_form_all

  !> `B D^{-1} B^T` with the diagonals of the stiffnesses.
  subroutine compliance_nodal_diagonal(self, qp, diagonal)
    class(body_compliance_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(out) :: diagonal(:)  !! Diagonal entries (n_rows) [length/force].
    integer :: b, i, k
    diagonal = 0
    do b = 1, size(self%body)
      associate (stiffness => self%body(b)%nodal_stiffness, row => qp%block(b)%row, matrix => qp%block(b)%matrix)
        do i = 1, size(row)
          do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            if (stiffness(matrix%column(k)) > 0) &
              diagonal(row(i)) = diagonal(row(i)) + matrix%value(k)**2/stiffness(matrix%column(k))
          end do
        end do
      end associate
    end do
  end subroutine compliance_nodal_diagonal

  !> Costs of one body.
  subroutine compliance_get_costs(self, b, path, solve)
    class(body_compliance_t), intent(inout) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(out) :: path  !! Entries of the factor on the elimination-tree path of a row, on average [].
    real(dp), intent(out) :: solve  !! Entries that a product with the compliance goes through [].
    real(dp) :: of_owner(1)
    if (is_own(self%body(b)%owner)) then
      associate (equation => self%body(b)%map%equation)
        of_owner = self%response(self%body(b)%representative)%form%path_entries(pack(equation, equation > 0))
      end associate
    end if
    call share([self%body(b)%owner], of_owner)
    path = of_owner(1)
    solve = self%body(b)%cost
  end subroutine compliance_get_costs

  !> Give back all memory.
  subroutine compliance_destroy(self)
    class(body_compliance_t), intent(inout) :: self
    integer :: b
    if (.not. allocated(self%response)) return
    do b = 1, size(self%response)
      if (allocated(self%response(b)%form)) call self%response(b)%form%destroy()
    end do
    deallocate (self%response)
  end subroutine compliance_destroy
end module dotyk_scheme_body_compliance
