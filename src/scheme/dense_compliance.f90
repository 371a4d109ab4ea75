!> The compliance of the bodies as dense matrices, one for each body, at those rows where they were formed.
!>
!> Congruent bodies that touch in the same way share one matrix. Rows are numbered as in the QP that the operator was
!> made for; QPs that are restrictions of it know their rows there (`parent_row`).
module dotyk_scheme_dense_compliance
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemm
  use dotyk_scheme_compliance, only: compliance_t, entries_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  type, public :: body_matrix_t  !! The matrix of one body.
    integer :: n = 0  !! Number of rows that are formed.
    !> (n, n), symmetric [length/force]; not allocated where it is that of another body.
    real(dp), allocatable :: value(:, :)
    integer :: same_as = 0  !! The body that has the same matrix; 0: this one has its own.
    !> Row of the QP, and place among the body's rows there, of each row of the matrix (n).
    integer, allocatable :: row(:), place(:)
    !> Row of the matrix of each of the body's rows, 0 where it is not formed (number of rows of the body).
    integer, allocatable :: number(:)
  end type body_matrix_t

  type, extends(compliance_t), public :: dense_compliance_t  !! The compliances of all bodies as matrices.
    type(body_matrix_t), allocatable :: of_body(:)  !! (n_bodies).
    integer :: level = 0  !! Aggregations that the QP of `begin` has gone through.
    !> Bodies that each row touches, and its place among their rows (n, n_rows).
    integer, allocatable :: row_body(:, :), row_place(:, :)
  contains
    procedure :: begin => dense_begin
    procedure :: set => dense_set
    procedure :: owner => dense_owner
    procedure :: multiply_body => dense_multiply_body
    procedure :: multiply_alike => dense_multiply_alike
    procedure :: multiply => dense_multiply
    procedure :: form => dense_form
    procedure :: is_formed => dense_is_formed
    procedure :: has_entries => dense_has_entries
    procedure :: is_body_formed => dense_is_body_formed
    procedure :: get_entries => dense_get_entries
    procedure :: get_diagonal => dense_get_diagonal
    procedure :: nodal_diagonal => dense_nodal_diagonal
    procedure :: get_costs => dense_get_costs
    procedure :: mark_formed => dense_mark_formed
    procedure :: form_all => dense_form_all
    procedure, private :: numbers => dense_numbers
  end type dense_compliance_t

contains

  !> No entries yet.
  subroutine dense_begin(self, qp)
    class(dense_compliance_t), intent(out) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer :: b
    self%level = qp%level
    self%row_body = qp%coarse%body
    self%row_place = qp%coarse%place
    allocate (self%of_body(size(qp%block)))
    do b = 1, size(qp%block)
      allocate (self%of_body(b)%value(0, 0), self%of_body(b)%row(0), self%of_body(b)%place(0))
      allocate (self%of_body(b)%number(size(qp%block(b)%row)), source=0)
    end do
  end subroutine dense_begin

  !> Give the matrix of one body at all of its rows.
  subroutine dense_set(self, qp, b, value)
    class(dense_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows, as in `begin`.
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: value(:, :)  !! Entries between the rows of the body, in their order (n, n) [length/force].
    integer :: i
    associate (own => self%of_body(b))
      own%n = size(value, 1)
      own%value = value
      own%row = qp%block(b)%row
      own%place = [(i, i=1, own%n)]
      own%number = own%place
    end associate
  end subroutine dense_set

  !> The body whose matrix is that of a body.
  pure integer function dense_owner(self, b) result(owner)
    class(dense_compliance_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    owner = merge(self%of_body(b)%same_as, b, self%of_body(b)%same_as > 0)
  end function dense_owner

  !> Displacements of one body's rows by forces on them. Entries of rows that are not formed count as zero.
  pure subroutine dense_multiply_body(self, b, force, displacement)
    class(dense_compliance_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: force(:)  !! At the rows of the QP of `begin` (all its rows) [force].
    !> At the formed rows of the body, in their order (n) [length].
    real(dp), allocatable, intent(out) :: displacement(:)
    integer :: j
    associate (own => self%of_body(b), value => self%of_body(self%owner(b))%value)
      allocate (displacement(own%n), source=0.0_dp)
      ! Most rows of an active set have no force.
      do j = 1, own%n
        if (abs(force(own%row(j))) > 0) displacement = displacement + force(own%row(j))*value(:, j)
      end do
    end associate
  end subroutine dense_multiply_body

  !> The same for bodies with one matrix, as a product of matrices.
  subroutine dense_multiply_alike(self, alike, force, displacement)
    class(dense_compliance_t), intent(in) :: self
    integer, intent(in) :: alike(:)  !! Bodies with the same owner (k).
    real(dp), intent(in) :: force(:)  !! At the rows of the QP of `begin` (all its rows) [force].
    !> At the formed rows of each body, in their order (n, k) [length].
    real(dp), allocatable, intent(out) :: displacement(:, :)
    real(dp), allocatable :: given(:, :)
    integer :: j, n, k
    k = size(alike)
    n = self%of_body(alike(1))%n
    allocate (given(n, k), displacement(n, k))
    if (n == 0) return
    do j = 1, k
      given(:, j) = force(self%of_body(alike(j))%row)
    end do
    associate (value => self%of_body(self%owner(alike(1)))%value)
      call dgemm('N', 'N', n, k, n, 1.0_dp, value, n, given, n, 0.0_dp, displacement, n)
    end associate
  end subroutine dense_multiply_alike

  !> z = C lambda.
  subroutine dense_multiply(self, qp, lambda, z)
    class(dense_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(out) :: z(:)  !! Displacements of the rows (n_rows) [length].
    real(dp), allocatable :: force(:), moved(:), displacement(:)
    integer :: b
    allocate (force(size(self%row_body, 2)), moved(size(self%row_body, 2)), source=0.0_dp)
    force(qp%parent_row) = lambda
    do b = 1, size(self%of_body)
      if (self%of_body(b)%n == 0) cycle
      call self%multiply_body(b, force, displacement)
      moved(self%of_body(b)%row) = moved(self%of_body(b)%row) + displacement
    end do
    z = moved(qp%parent_row)
  end subroutine dense_multiply

  !> Nothing: entries are given by `set`.
  subroutine dense_form(self, qp, may_stop)
    class(dense_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    logical, intent(in), optional :: may_stop  !! Not used.
    associate (not_needed => self%n_sweeps, nor_this => qp%n_rows, nor_that => present(may_stop))
    end associate
  end subroutine dense_form

  !> Whether the entries of all bodies are there.
  pure logical function dense_is_formed(self, qp) result(is_formed)
    class(dense_compliance_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer :: b
    is_formed = allocated(self%of_body)
    if (is_formed) is_formed = all([(self%is_body_formed(qp, b), b=1, size(self%of_body))])
  end function dense_is_formed

  !> Whether any entries are there.
  pure logical function dense_has_entries(self) result(has_entries)
    class(dense_compliance_t), intent(in) :: self
    has_entries = any(self%of_body%n > 0)
  end function dense_has_entries

  !> Whether the entries of one body are there.
  pure logical function dense_is_body_formed(self, qp, b) result(is_formed)
    class(dense_compliance_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: b  !! The body.
    is_formed = qp%level == self%level
    ! Asked in every product: bodies with all entries need no look at their rows.
    if (is_formed .and. self%of_body(b)%n < size(self%of_body(b)%number)) &
      is_formed = all(self%numbers(b, qp%parent_row(qp%block(b)%row)) > 0)
  end function dense_is_body_formed

  !> Rows of the matrix of a body.
  pure function dense_numbers(self, b, row) result(number)
    class(dense_compliance_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    integer, intent(in) :: row(:)  !! Rows of the QP of `begin` that touch it (n).
    integer :: number(size(row))  !! (n)
    integer :: i
    do i = 1, size(row)
      number(i) = self%of_body(b)%number(self%row_place(findloc(self%row_body(:, row(i)), b, 1), row(i)))
    end do
  end function dense_numbers

  !> Entries between some rows of a body; 0 where none are formed.
  subroutine dense_get_entries(self, qp, b, row, entries)
    class(dense_compliance_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: b  !! The body.
    integer, intent(in) :: row(:)  !! Rows (n).
    real(dp), allocatable, intent(out) :: entries(:, :)  !! Entries (n, n) [length/force].
    integer, allocatable :: number(:)
    allocate (number(size(row)))
    number = self%numbers(b, qp%parent_row(row))
    if (self%of_body(b)%n > 0) then
      entries = self%of_body(self%owner(b))%value(number, number)
    else
      allocate (entries(size(row), size(row)), source=0.0_dp)
    end if
  end subroutine dense_get_entries

  !> Diagonal entries.
  subroutine dense_get_diagonal(self, qp, row, diagonal)
    class(dense_compliance_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: row(:)  !! Rows (n).
    real(dp), intent(out) :: diagonal(:)  !! Diagonal entries (n) [length/force].
    integer :: i, k, b, n
    do i = 1, size(row)
      associate (parent => qp%parent_row(row(i)))
        diagonal(i) = 0
        do k = 1, size(self%row_body, 1)
          b = self%row_body(k, parent)
          if (b == 0) cycle
          n = self%of_body(b)%number(self%row_place(k, parent))
          if (n > 0) diagonal(i) = diagonal(i) + self%of_body(self%owner(b))%value(n, n)
        end do
      end associate
    end do
  end subroutine dense_get_diagonal

  !> The diagonal itself.
  subroutine dense_nodal_diagonal(self, qp, diagonal)
    class(dense_compliance_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(out) :: diagonal(:)  !! Diagonal entries (n_rows) [length/force].
    integer :: i
    call self%get_diagonal(qp, [(i, i=1, qp%n_rows)], diagonal)
  end subroutine dense_nodal_diagonal

  !> Nothing is left to be formed, and a product costs twice the entries.
  subroutine dense_get_costs(self, b, path, solve)
    class(dense_compliance_t), intent(inout) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(out) :: path  !! 0: nothing is left to be formed [].
    real(dp), intent(out) :: solve  !! Half the entries of the matrix: a product goes through each once [].
    path = 0
    solve = real(self%of_body(b)%n, dp)**2/2
  end subroutine dense_get_costs

  !> Mark rows with entries.
  subroutine dense_mark_formed(self, formed)
    class(dense_compliance_t), intent(in) :: self
    logical, intent(inout) :: formed(:)  !! Set where a row has entries (all rows of the QP of `begin`).
    integer :: b
    do b = 1, size(self%of_body)
      formed(self%of_body(b)%row) = .true.
    end do
  end subroutine dense_mark_formed

  !> Entries at all rows of a QP, which must be a restriction here.
  subroutine dense_form_all(self, qp, entries)
    class(dense_compliance_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! Formed.
    type(entries_t), allocatable, intent(out) :: entries(:)  !! Entries (n_bodies).
    integer :: b
    allocate (entries(size(qp%block)))
    do b = 1, size(qp%block)
      call self%get_entries(qp, b, qp%block(b)%row, entries(b)%value)
    end do
  end subroutine dense_form_all
end module dotyk_scheme_dense_compliance
