!> The constraint preconditioner of the linear system of an active set (`dotyk_scheme_active_system`): solutions of
!>
!>     M_p x - G alpha = r,    G^T x + S alpha = e
!>
!> (Keller, Gould, Wathen, SIAM J. Matrix Anal. Appl. 21, 2000), M_p being M = C + Theta W^{-1} without some of the
!> couplings of the rows:
!>
!>  - all couplings kept: M_p = M, and the solution is a direct one;
!>  - couplings of different pairs: contacts yield near their points, and a body couples its pairs weakly; the number of
!>    iterations depends on the shape of the bodies, not on how many there are;
!>  - all couplings, and an approximate diagonal: nothing but products with the compliance is needed.
!>
!> CHOLMOD factorizes M_p, and the stiffness `H = G^T M_p^{-1} G + S` of rigid bodies on their contacts, as in FETI the
!> coarse problem.
!>
!> With theta = 0 rows can be linearly dependent and M singular: M_p has a small fraction of its diagonal more, the
!> proximal point method (Rockafellar, SIAM J. Control Optim. 14, 1976). Consistent equations are solved exactly,
!> redundant rows share the force of least norm. The fraction goes with 1/w, as a penalty theta does: the norm is that
!> of the pressures, sum lambda^2/w, and redundant forces are the limit of those with theta -> 0.
module dotyk_scheme_constraint_preconditioner
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemv, dsyrk
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_clique_matrix, only: clique_t, assemble_cliques
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_stiffness, only: mode_stiffness_t
  implicit none
  private

  !> Couplings of rows that the preconditioner knows: all, those within a pair, none.
  integer, parameter, public :: coupling_all = 1, coupling_pairs = 2, coupling_none = 3

  type :: row_group_t  !! Rows whose modes L^{-1} G knows: those of a contact pair, or all.
    integer :: first = 1, last = 0  !! Rows first .. last.
    integer, allocatable :: body(:)  !! Bodies with modes (n).
    integer, allocatable :: start(:)  !! Columns of the modes of the k-th body are start(k) .. start(k+1)-1 (n + 1).
    integer, allocatable :: mode(:)  !! The mode of each column (n_columns).
  end type row_group_t

  !> The preconditioner. It owns factors: never copy it, destroy it in the end.
  type, public :: constraint_preconditioner_t
    integer :: coupling = coupling_all  !! One of `coupling_*`.
    real(dp), allocatable :: diagonal(:)  !! Diagonal of C, or an approximate one (n) [length/force].
    type(row_group_t), allocatable, private :: group(:)  !! Groups of rows, ascending (n_groups).
    !> Rows of the QP that all others are restrictions of, for which the pattern and C stand in `matrix` (n).
    integer, allocatable, private :: parent(:)
    integer, private :: level = 0  !! Aggregations of that QP.
    !> C with the couplings that M_p has; and the factor of M_p [length/force].
    type(sparse_symmetric_t), private :: matrix
    type(cholesky_t), private :: factor
    !> L^{-1} G with the factor L of M_p: columns are the modes of the group of each row (n, most modes of a group)
    !> [sqrt(force/length)].
    real(dp), allocatable, private :: half(:, :)
    type(mode_stiffness_t), private :: network  !! H.
  contains
    procedure :: init => preconditioner_init
    procedure :: apply => preconditioner_apply
    procedure :: forget => preconditioner_forget
    procedure :: destroy => preconditioner_destroy
  end type constraint_preconditioner_t

  !> Proximal term: the fraction of the diagonal of M that is added before the factorization. Far above the rounding of
  !> M (1e-16 of it), far below what slows down the refinement: each step gains as many digits where rows are
  !> independent.
  real(dp), parameter :: proximal_fraction = 1.0e-9_dp
  !> Most of it, where weights or stiffnesses differ.
  real(dp), parameter :: most_proximal_fraction = 1.0e-6_dp
  !> With ties, over the same without: the compliance of a facet of a slender body is as small beside that of bending.
  !> Redundant rows share their force less exactly then.
  real(dp), parameter :: with_ties = 1.0e-2_dp

contains

  !> Prepare it for some rows; others may have been there before. Rows that are the same as before keep their entries.
  subroutine preconditioner_init(self, qp, compliance, row, layer, is_singular, error)
    class(constraint_preconditioner_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, and rigid body modes with their stiffness.
    class(compliance_t), intent(inout) :: compliance  !! Formed at the rows unless the coupling is none.
    integer, intent(in) :: row(:)  !! The rows, ascending (n).
    real(dp), intent(in) :: layer(:)  !! Compliance theta/w of the Winkler layer there (n) [length/force].
    logical, intent(out) :: is_singular  !! M_p or H is not positive definite.
    type(error_t), allocatable, intent(out) :: error  !! METIS or CHOLMOD has no memory.
    integer :: failed
    logical :: is_known
    is_singular = .false.
    is_known = .false.
    if (allocated(self%parent)) then
      is_known = self%level == qp%level .and. size(self%parent) == size(row)
      if (is_known) is_known = all(self%parent == qp%parent_row(row))
    end if
    if (.not. is_known) then
      call self%forget()
      call form_matrix(self, qp, compliance, row, layer, error)
      if (allocated(error)) return
      self%parent = qp%parent_row(row)
      self%level = qp%level
    end if
    associate (k => self%matrix%column_start(:size(row)) + 1)
      self%matrix%value(k) = self%diagonal + layer + merge(with_ties, 1.0_dp, any(qp%is_tied(row)))* &
        proximal_term(self%diagonal + layer, layer, qp%weight(row))
    end associate
    call self%factor%factorize(self%matrix, failed, error)
    if (allocated(error)) return
    is_singular = failed > 0
    if (is_singular) return
    call form_network(self, qp, row)
    call self%network%factorize(is_singular, error)
  end subroutine preconditioner_init

  !> What is added to the diagonal of M for the factorization: the same theta on all rows without a layer, as far as
  !> that is a small fraction of the diagonal [length/force].
  pure function proximal_term(diagonal, layer, weight) result(term)
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of M (n) [length/force].
    real(dp), intent(in) :: layer(:)  !! Compliance theta/w of the layer (n) [length/force].
    real(dp), intent(in) :: weight(:)  !! Weights of the rows (n) [length^2; length in two dimensions].
    real(dp) :: term(size(diagonal))
    real(dp) :: theta
    theta = maxval(diagonal*weight, mask=.not. layer > 0)
    term = proximal_fraction*diagonal
    where (.not. layer > 0) term = max(term, min(proximal_fraction*theta/weight, most_proximal_fraction*diagonal))
  end function proximal_term

  !> C with the couplings of M_p, its symbolic factorization, and that of H.
  subroutine form_matrix(self, qp, compliance, row, layer, error)
    type(constraint_preconditioner_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    integer, intent(in) :: row(:)  !! As in `init` (n).
    real(dp), intent(in) :: layer(:)  !! As in `init` (n) [length/force].
    type(error_t), allocatable, intent(out) :: error  !! As in `init`.
    type(clique_t), allocatable :: clique(:)
    integer, allocatable :: order(:), first(:)
    real(dp), allocatable :: yields(:)
    integer :: i, n
    n = size(row)
    call find_pairs(qp, row, first)
    select case (self%coupling)
    case (coupling_all)
      call couple_bodies(qp, row, compliance, clique)
    case (coupling_pairs)
      call couple_pairs(qp, row, first, compliance, clique)
    case default
      allocate (clique(0))
    end select
    call assemble_cliques(clique, first, self%matrix, order, error)
    if (allocated(error)) return
    deallocate (clique)
    if (self%coupling == coupling_none) then
      allocate (yields(qp%n_rows))
      call compliance%nodal_diagonal(qp, yields)
      self%diagonal = yields(row)
      ! Rows between prescribed displacements get no force.
      where (.not. self%diagonal + layer > 0) self%diagonal = max(tiny(1.0_dp), maxval(yields))/epsilon(1.0_dp)
    else
      self%diagonal = self%matrix%value(self%matrix%column_start(:n) + 1)
    end if
    call self%factor%analyze(self%matrix, order, error)
    if (allocated(error)) return
    ! Bodies that H couples: those of each pair, or all together.
    if (allocated(self%group)) deallocate (self%group)
    if (self%coupling == coupling_all) then
      allocate (self%group(1))
      call set_group(qp, [(i, i=1, size(qp%block))], 1, n, self%group(1))
    else
      allocate (self%group(size(first) - 1))
      do i = 1, size(self%group)
        call set_group(qp, qp%coarse%body(:, row(first(i))), first(i), first(i + 1) - 1, self%group(i))
      end do
    end if
    deallocate (first)
    allocate (first(size(self%group) + 1), source=1)
    do i = 1, size(self%group)
      first(i + 1) = first(i) + size(self%group(i)%body)
    end do
    call self%network%init(qp%coarse%first, first, [(self%group(i)%body, i=1, size(self%group))], error)
  end subroutine form_matrix

  !> A group of rows and the modes of some bodies. (gfortran 12 leaks components of functions in array constructors.)
  pure subroutine set_group(qp, body, first, last, group)
    type(contact_qp_t), intent(in) :: qp  !! With rigid body modes.
    integer, intent(in) :: body(:)  !! The bodies; 0 is none.
    integer, intent(in) :: first, last  !! The rows first .. last.
    type(row_group_t), intent(out) :: group  !! The group.
    integer, allocatable :: present(:), n_modes(:)
    integer :: k, j
    group%first = first
    group%last = last
    present = pack(body, body > 0)
    n_modes = qp%coarse%first(present + 1) - qp%coarse%first(present)
    group%body = pack(present, n_modes > 0)
    n_modes = pack(n_modes, n_modes > 0)
    group%start = [1, (1 + sum(n_modes(:k)), k=1, size(n_modes))]
    group%mode = [((qp%coarse%first(group%body(k)) + j, j=0, n_modes(k) - 1), k=1, size(n_modes))]
  end subroutine set_group

  !> Successive rows of the same pair and bodies: those of the i-th are first(i) .. first(i+1)-1.
  subroutine find_pairs(qp, row, first)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes.
    integer, intent(in) :: row(:)  !! The rows, ascending (n).
    integer, allocatable, intent(out) :: first(:)  !! (n_pairs + 1)
    logical :: is_new(size(row) + 1)
    integer :: i, at
    is_new = .true.
    at = 0
    do i = 1, size(row)
      if (i > 1) is_new(i) = any(qp%coarse%body(:, row(i)) /= qp%coarse%body(:, row(i - 1)))
      do while (row(i) >= qp%pair_first_row(at + 1))
        at = at + 1
        is_new(i) = .true.
      end do
    end do
    first = pack([(i, i=1, size(is_new))], is_new)
  end subroutine find_pairs

  !> The compliance of each body couples all its rows.
  subroutine couple_bodies(qp, row, compliance, clique)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: row(:)  !! The rows, ascending (n).
    class(compliance_t), intent(in) :: compliance  !! Compliance operator, formed at the rows.
    type(clique_t), allocatable, intent(out) :: clique(:)  !! Those of the bodies (n_bodies).
    integer :: number(qp%n_rows), b, i
    number = 0
    number(row) = [(i, i=1, size(row))]
    allocate (clique(size(qp%block)))
    do b = 1, size(clique)
      associate (own => qp%block(b)%row)
        clique(b)%row = pack(number(own), number(own) > 0)
        call compliance%get_entries(qp, b, row(clique(b)%row), clique(b)%value)
      end associate
    end do
  end subroutine couple_bodies

  !> The compliances of its two bodies couple the rows of each pair.
  subroutine couple_pairs(qp, row, first, compliance, clique)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: row(:)  !! The rows, ascending (n).
    integer, intent(in) :: first(:)  !! As of `find_pairs` (n_pairs + 1).
    class(compliance_t), intent(in) :: compliance  !! Compliance operator, formed at the rows.
    type(clique_t), allocatable, intent(out) :: clique(:)  !! Those of the pairs (n_pairs).
    real(dp), allocatable :: entries(:, :)
    integer :: p, k, i, n
    allocate (clique(size(first) - 1))
    do p = 1, size(clique)
      clique(p)%row = [(i, i=first(p), first(p + 1) - 1)]
      n = size(clique(p)%row)
      allocate (clique(p)%value(n, n), source=0.0_dp)
      do k = 1, size(qp%coarse%body, 1)
        associate (body => qp%coarse%body(k, row(first(p))))
          if (body == 0) cycle
          call compliance%get_entries(qp, body, row(clique(p)%row), entries)
          clique(p)%value = clique(p)%value + entries
        end associate
      end do
    end do
  end subroutine couple_pairs

  !> L^{-1} G, and H.
  subroutine form_network(self, qp, row)
    type(constraint_preconditioner_t), intent(inout) :: self  !! M_p is factorized; sets `half` and `network`.
    type(contact_qp_t), intent(in) :: qp  !! With the coarse space.
    integer, intent(in) :: row(:)  !! The rows (n).
    real(dp), allocatable :: h(:, :)
    integer :: b, g, k, l, n, n_columns
    n = size(row)
    n_columns = maxval([0, (size(self%group(g)%mode), g=1, size(self%group))])
    if (allocated(self%half)) then
      if (any(shape(self%half) /= [n, n_columns])) deallocate (self%half)
    end if
    if (.not. allocated(self%half)) allocate (self%half(n, n_columns))
    self%half = 0
    do g = 1, size(self%group)
      call take_rows(self%group(g), qp, row, self%half)
    end do
    if (size(self%half) > 0) call self%factor%solve_forward(self%half)
    call self%network%clear()
    do g = 1, size(self%group)
      associate (group => self%group(g), start => self%group(g)%start)
        n_columns = size(group%mode)
        allocate (h(n_columns, n_columns), source=0.0_dp)
        if (min(n, n_columns) > 0) call dsyrk('L', 'T', n_columns, group%last - group%first + 1, 1.0_dp, &
                                              self%half(group%first, 1), n, 0.0_dp, h, n_columns)
        do k = 1, size(group%body)
          do l = 1, k
            call self%network%add(group%body(k), group%body(l), h(start(k):start(k + 1) - 1, start(l):start(l + 1) - 1))
          end do
        end do
        deallocate (h)
      end associate
    end do
    if (.not. allocated(qp%coarse%stiffness)) return
    do b = 1, size(qp%block)
      call self%network%add(b, b, qp%coarse%stiffness(b)%value)
    end do
  end subroutine form_network

  !> G at the rows of a group, in the columns of its modes.
  pure subroutine take_rows(group, qp, row, g)
    type(row_group_t), intent(in) :: group  !! The group.
    type(contact_qp_t), intent(in) :: qp  !! With the coarse space.
    integer, intent(in) :: row(:)  !! All rows (n).
    real(dp), intent(inout) :: g(:, :)  !! (n, most modes of a group) [].
    integer :: i, k, j
    do i = group%first, group%last
      do k = 1, size(qp%coarse%body, 1)
        associate (b => qp%coarse%body(k, row(i)))
          j = findloc(group%body, b, 1)
          if (j > 0) g(i, group%start(j):group%start(j + 1) - 1) = &
            qp%coarse%block(b)%value(qp%coarse%place(k, row(i)), :)
        end associate
      end do
    end do
  end subroutine take_rows

  !> Solve `M_p x - G alpha = r`, `G^T x + S alpha = e`: the modes between both halves of a solution with M_p.
  subroutine preconditioner_apply(self, r, e, x, alpha)
    class(constraint_preconditioner_t), intent(in) :: self
    real(dp), intent(in) :: r(:)  !! At the rows (n) [length].
    real(dp), intent(in), optional :: e(:)  !! On the modes; 0 if absent (coarse%n) [force].
    real(dp), intent(out), contiguous :: x(:)  !! Forces (n) [force].
    real(dp), intent(out), contiguous :: alpha(:)  !! Amplitudes (coarse%n) [length].
    real(dp) :: half(size(r), 1)
    real(dp), allocatable :: own(:)
    integer :: g
    half(:, 1) = r
    if (size(r) > 0) call self%factor%solve_forward(half)
    alpha = 0
    if (present(e)) alpha = e
    do g = 1, size(self%group)
      associate (group => self%group(g))
        own = alpha(group%mode)
        call multiply(group, 'T', -1.0_dp, half(group%first:, 1), own)
        alpha(group%mode) = own
      end associate
    end do
    call self%network%solve(alpha)
    do g = 1, size(self%group)
      associate (group => self%group(g))
        call multiply(group, 'N', 1.0_dp, alpha(group%mode), half(group%first:, 1))
      end associate
    end do
    if (size(r) > 0) call self%factor%solve_back(half)
    x = half(:, 1)

  contains

    !> y := y + factor op(A) x with the rows A of a group in L^{-1} G.
    subroutine multiply(group, op, factor, x, y)
      type(row_group_t), intent(in) :: group  !! The group.
      character(1), intent(in) :: op  !! 'N', or 'T' for the transpose.
      real(dp), intent(in) :: factor  !! The factor [].
      real(dp), intent(in), contiguous :: x(:)
      real(dp), intent(inout), contiguous :: y(:)
      if (size(group%mode) > 0 .and. group%last >= group%first) &
        call dgemv(op, group%last - group%first + 1, size(group%mode), factor, self%half(group%first, 1), &
                   size(self%half, 1), x, 1, 1.0_dp, y, 1)
    end subroutine multiply
  end subroutine preconditioner_apply

  !> Forget the rows.
  subroutine preconditioner_forget(self)
    class(constraint_preconditioner_t), intent(inout) :: self
    if (allocated(self%parent)) deallocate (self%parent)
  end subroutine preconditioner_forget

  !> Free all memory.
  subroutine preconditioner_destroy(self)
    class(constraint_preconditioner_t), intent(inout) :: self
    call self%forget()
    call self%factor%destroy()
    call self%network%destroy()
    call self%matrix%destroy()
    if (allocated(self%group)) deallocate (self%group)
    if (allocated(self%diagonal)) deallocate (self%diagonal)
    if (allocated(self%half)) deallocate (self%half)
  end subroutine preconditioner_destroy
end module dotyk_scheme_constraint_preconditioner
