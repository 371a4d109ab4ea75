!> The compliance of contact pairs on their own: the diagonal blocks M_p of M = C + Theta W^{-1} between the active rows
!> of a pair, and the stiffness G^T M_p^{-1} G of the network of bodies that pairs alone would make.
!>
!> A body couples its pairs weakly: contacts yield near their points. The blocks have few rows each, whatever the number
!> of bodies. With theta = 0 rows of a pair may be linearly dependent: a small fraction of the diagonal is added
!> (`proximal_term`).
module dotyk_scheme_pair_blocks
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dtrsm, dtrsv
  use dotyk_linalg_block_ldlt, only: block_ldlt_t
  use dotyk_linalg_block_order, only: order_blocks
  use dotyk_linalg_block_tree, only: block_tree_t
  use dotyk_linalg_clique_graph, only: make_clique_graph
  use dotyk_linalg_lapack, only: dpotrf
  use dotyk_scheme_coarse_space, only: coarse_space_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: network_cost

  !> The active rows of one pair.
  type :: pair_block_t
    !> Active rows first .. last.
    integer :: first = 1, last = 0
    !> The two bodies, 0 where there is no second one.
    integer :: body(2) = 0
    !> Modes of the first and the second body.
    integer :: n_modes(2) = 0
    !> C between the rows (n, n) [length/force].
    real(dp), allocatable :: compliance(:, :)
    !> Cholesky factor L of M_p, lower triangle (n, n) [sqrt(length/force)].
    real(dp), allocatable :: factor(:, :)
    !> Rows of G, modes of the first body before those of the second (n, modes) [].
    real(dp), allocatable :: g(:, :)
    !> L^{-1} G (n, modes) [sqrt(force/length)].
    real(dp), allocatable :: spread(:, :)
  end type pair_block_t

  !> The blocks of all pairs with active rows.
  type, public :: pair_blocks_t
    !> (n_pairs)
    type(pair_block_t), allocatable, private :: pair(:)
    !> The rows that they were made for, in the whole QP of a level (n).
    integer, allocatable, private :: row(:)
    !> Aggregations of that QP.
    integer, private :: level = 0
    !> Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    integer, allocatable, private :: first_mode(:)
    !> Diagonal of C (n) [length/force].
    real(dp), allocatable :: diagonal(:)
    !> Bodies that pairs couple to body b: neighbour(start(b):start(b+1)-1) (n_bodies + 1).
    integer, allocatable, private :: start(:)
    !> See `start`.
    integer, allocatable, private :: neighbour(:)
    !> The body that is eliminated k-th (n_bodies).
    integer, allocatable, private :: order(:)
  contains
    procedure :: init => blocks_init
    procedure :: factorize => blocks_factorize
    procedure :: add_network => blocks_add_network
    procedure :: stiffness_of_modes => blocks_stiffness_of_modes
    procedure :: reduce => blocks_reduce
    procedure :: expand => blocks_expand
    procedure :: find_resultants => blocks_find_resultants
    procedure :: destroy => blocks_destroy
  end type pair_blocks_t

contains

  !> Take the entries of C of each pair. Rows that are the same as before keep theirs.
  subroutine blocks_init(self, qp, compliance, row)
    !> The blocks.
    class(pair_blocks_t), intent(inout) :: self
    !> Contact rows and rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at the rows.
    class(compliance_t), intent(inout) :: compliance
    !> Active rows, ascending (n).
    integer, intent(in) :: row(:)
    real(dp), allocatable :: entries(:, :)
    integer :: p, k, i, b
    if (allocated(self%row)) then
      if (self%level == qp%level .and. size(self%row) == size(row)) then
        if (all(self%row == qp%parent_row(row))) return
      end if
    end if
    call self%destroy()
    self%row = qp%parent_row(row)
    self%level = qp%level
    self%first_mode = qp%coarse%first
    call find_pairs(qp, row, self%pair)
    allocate (self%diagonal(size(row)))
    do p = 1, size(self%pair)
      associate (pair => self%pair(p))
        associate (own => row(pair%first:pair%last))
          allocate (pair%compliance(size(own), size(own)), source=0.0_dp)
          allocate (pair%g(size(own), sum(pair%n_modes)))
          do k = 1, 2
            b = pair%body(k)
            if (b == 0) cycle
            call compliance%get_entries(qp, b, own, entries)
            pair%compliance = pair%compliance + entries
            do i = 1, size(own)
              pair%g(i, merge(0, pair%n_modes(1), k == 1) + 1:merge(0, pair%n_modes(1), k == 1) + pair%n_modes(k)) = &
                qp%coarse%block(b)%value(qp%coarse%place(k, own(i)), :)
            end do
          end do
          do i = 1, size(own)
            self%diagonal(pair%first + i - 1) = pair%compliance(i, i)
          end do
        end associate
      end associate
    end do
    call order_bodies(self)
  end subroutine blocks_init

  !> The active rows of each pair: successive rows of one pair between the same two bodies.
  subroutine find_pairs(qp, row, pair)
    !> Contact rows and rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Active rows, ascending (n).
    integer, intent(in) :: row(:)
    !> Rows, bodies and numbers of modes (n_pairs).
    type(pair_block_t), allocatable, intent(out) :: pair(:)
    type(pair_block_t), allocatable :: found(:)
    integer :: i, k, n, at, b
    logical :: is_new
    allocate (found(size(row)))
    n = 0
    at = 0
    do i = 1, size(row)
      is_new = i == 1
      do while (row(i) >= qp%pair_first_row(at + 1))
        at = at + 1
        is_new = .true.
      end do
      if (.not. is_new) is_new = any(qp%coarse%body(:, row(i)) /= found(n)%body)
      if (is_new) then
        n = n + 1
        found(n)%first = i
        found(n)%body = qp%coarse%body(:, row(i))
        do k = 1, 2
          b = found(n)%body(k)
          if (b > 0) found(n)%n_modes(k) = qp%coarse%first(b + 1) - qp%coarse%first(b)
        end do
      end if
      found(n)%last = i
    end do
    pair = found(:n)
  end subroutine find_pairs

  !> Couplings of the bodies by pairs, and their elimination order.
  subroutine order_bodies(self)
    !> Sets `start`, `neighbour` and `order`.
    type(pair_blocks_t), intent(inout) :: self
    integer, allocatable :: first(:), member(:)
    integer :: p, k, n
    n = size(self%first_mode) - 1
    allocate (first(size(self%pair) + 1), member(2*size(self%pair)))
    first(1) = 1
    do p = 1, size(self%pair)
      first(p + 1) = first(p)
      ! Bodies without modes couple nothing.
      if (any(self%pair(p)%n_modes == 0)) cycle
      do k = 1, 2
        member(first(p + 1)) = self%pair(p)%body(k)
        first(p + 1) = first(p + 1) + 1
      end do
    end do
    call make_clique_graph(first, member(:first(size(first)) - 1), n, self%start, self%neighbour)
    call order_blocks(self%first_mode(2:) - self%first_mode(:n), self%start, self%neighbour, self%order)
  end subroutine order_bodies

  !> Factorize the blocks with what stands on the diagonal beside C.
  subroutine blocks_factorize(self, added, failed)
    !> The blocks.
    class(pair_blocks_t), intent(inout) :: self
    !> Added to the diagonal (n) [length/force].
    real(dp), intent(in) :: added(:)
    !> Whether a block is not positive definite.
    logical, intent(out) :: failed
    integer :: p, i, n, info
    failed = .false.
    !$omp parallel do default(none) shared(self, added) private(i, n, info) reduction(.or.: failed) schedule(static)
    do p = 1, size(self%pair)
      associate (pair => self%pair(p))
        n = size(pair%compliance, 1)
        pair%factor = pair%compliance
        do i = 1, n
          pair%factor(i, i) = pair%factor(i, i) + added(pair%first + i - 1)
        end do
        call dpotrf('L', n, pair%factor, n, info)
        ! The comparison is false for NaN too.
        failed = failed .or. info /= 0 .or. .not. abs(pair%factor(n, n)) <= huge(1.0_dp)
        pair%spread = pair%g
        if (info == 0 .and. size(pair%g, 2) > 0) &
          call dtrsm('L', 'L', 'N', 'N', n, size(pair%g, 2), 1.0_dp, pair%factor, n, pair%spread, n)
      end associate
    end do
    !$omp end parallel do
  end subroutine blocks_factorize

  !> Make the matrix -G^T M_p^{-1} G, or the positive one, a block for each body, that is yet to be factorized.
  subroutine blocks_add_network(self, sign, network)
    !> Factorized.
    class(pair_blocks_t), intent(in) :: self
    !> -1, or 1 where no mode is a null mode: many bodies are then eliminated together.
    integer, intent(in) :: sign
    !> The matrix; what it was before is lost.
    type(block_ldlt_t), intent(inout) :: network
    real(dp), allocatable :: part(:, :)
    integer :: p, k, l, b, n(2), at(2), sizes(size(self%first_mode) - 1)
    sizes = self%first_mode(2:) - self%first_mode(:size(sizes))
    call network%init(sizes, [(sign, b=1, size(sizes))], self%start, self%neighbour, self%order)
    do p = 1, size(self%pair)
      associate (pair => self%pair(p))
        n = pair%n_modes
        at = [0, n(1)]
        do k = 1, 2
          do l = 1, k
            if (n(k) == 0 .or. n(l) == 0) cycle
            part = sign*matmul(transpose(pair%spread(:, at(k) + 1:at(k) + n(k))), &
                               pair%spread(:, at(l) + 1:at(l) + n(l)))
            call network%add(pair%body(k), pair%body(l), part)
          end do
        end do
      end associate
    end do
  end subroutine blocks_add_network

  !> Stiffness of the contact of each body against its best restrained mode, if each row yielded on its own (n_bodies)
  !> [force/length].
  function blocks_stiffness_of_modes(self, coarse, added) result(stiffness)
    !> The blocks.
    class(pair_blocks_t), intent(in) :: self
    !> Their rigid body modes. 0 where all modes of a body have a stiffness of their own.
    type(coarse_space_t), intent(in) :: coarse
    !> What stands on the diagonal beside C (n) [length/force].
    real(dp), intent(in) :: added(:)
    real(dp), allocatable :: stiffness(:), of_mode(:)
    integer :: p, k, j, b, at
    allocate (of_mode(coarse%n), source=0.0_dp)
    do p = 1, size(self%pair)
      associate (pair => self%pair(p))
        at = 0
        do k = 1, 2
          do j = 1, pair%n_modes(k)
            associate (mode => of_mode(coarse%first(pair%body(k)) + j - 1))
              mode = mode + sum(pair%g(:, at + j)**2/(self%diagonal(pair%first:pair%last) + &
                                                      added(pair%first:pair%last)))
            end associate
          end do
          at = at + pair%n_modes(k)
        end do
      end associate
    end do
    allocate (stiffness(size(coarse%first) - 1), source=0.0_dp)
    do b = 1, size(stiffness)
      if (coarse%has_stiffness(b)) cycle
      stiffness(b) = maxval([0.0_dp, of_mode(coarse%first(b):coarse%first(b + 1) - 1)])
    end do
  end function blocks_stiffness_of_modes

  !> r <- L^{-1} r, and the resultants G^T M_p^{-1} r.
  subroutine blocks_reduce(self, r, resultant)
    !> Factorized.
    class(pair_blocks_t), intent(in) :: self
    !> At the rows (n) [length; sqrt(energy) on return].
    real(dp), intent(inout), contiguous :: r(:)
    !> On the modes (n_modes) [force].
    real(dp), intent(out) :: resultant(:)
    integer :: p, k, j, n, at
    resultant = 0
    do p = 1, size(self%pair)
      associate (pair => self%pair(p))
        n = size(pair%factor, 1)
        call dtrsv('L', 'N', 'N', n, pair%factor, n, r(pair%first:pair%last), 1)
        at = 0
        do k = 1, 2
          do j = 1, pair%n_modes(k)
            associate (e => resultant(self%first_mode(pair%body(k)) + j - 1))
              e = e + dot_product(pair%spread(:, at + j), r(pair%first:pair%last))
            end associate
          end do
          at = at + pair%n_modes(k)
        end do
      end associate
    end do
  end subroutine blocks_reduce

  !> r <- L^{-T} (r + L^{-1} G alpha): the forces M_p^{-1} (r_0 + G alpha) of what `reduce` was given.
  subroutine blocks_expand(self, alpha, r)
    !> Factorized.
    class(pair_blocks_t), intent(in) :: self
    !> Amplitudes (n_modes) [length].
    real(dp), intent(in) :: alpha(:)
    !> As `reduce` left it; forces on return (n) [sqrt(energy); force].
    real(dp), intent(inout), contiguous :: r(:)
    integer :: p, k, j, n, at
    do p = 1, size(self%pair)
      associate (pair => self%pair(p))
        n = size(pair%factor, 1)
        at = 0
        do k = 1, 2
          do j = 1, pair%n_modes(k)
            r(pair%first:pair%last) = r(pair%first:pair%last) + &
              alpha(self%first_mode(pair%body(k)) + j - 1)*pair%spread(:, at + j)
          end do
          at = at + pair%n_modes(k)
        end do
        call dtrsv('L', 'T', 'N', n, pair%factor, n, r(pair%first:pair%last), 1)
      end associate
    end do
  end subroutine blocks_expand

  !> G^T x.
  subroutine blocks_find_resultants(self, x, resultant)
    !> With rows and modes.
    class(pair_blocks_t), intent(in) :: self
    !> Forces (n) [force].
    real(dp), intent(in) :: x(:)
    !> On the modes (n_modes) [force].
    real(dp), intent(out) :: resultant(:)
    integer :: p, k, j, at
    resultant = 0
    do p = 1, size(self%pair)
      associate (pair => self%pair(p))
        at = 0
        do k = 1, 2
          do j = 1, pair%n_modes(k)
            associate (e => resultant(self%first_mode(pair%body(k)) + j - 1))
              e = e + dot_product(pair%g(:, at + j), x(pair%first:pair%last))
            end associate
          end do
          at = at + pair%n_modes(k)
        end do
      end associate
    end do
  end subroutine blocks_find_resultants

  !> Cost of the preconditioner with the given rows active.
  subroutine network_cost(qp, active, flops, entries)
    !> Contact rows and rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> The rows (n_rows).
    logical, intent(in) :: active(:)
    !> Floating-point operations of a factorization [].
    real(dp), intent(out) :: flops
    !> Entries that a solution goes through twice [].
    real(dp), intent(out) :: entries
    type(pair_blocks_t) :: blocks
    type(block_tree_t) :: tree
    real(dp) :: n, m
    integer :: i, p
    blocks%first_mode = qp%coarse%first
    call find_pairs(qp, pack([(i, i=1, qp%n_rows)], active), blocks%pair)
    call order_bodies(blocks)
    associate (first => qp%coarse%first, n_bodies => size(qp%coarse%first) - 1)
      call tree%init(first(2:) - first(:n_bodies), blocks%start, blocks%neighbour, blocks%order)
    end associate
    flops = tree%operations()
    entries = real(tree%entries(), dp)
    do p = 1, size(blocks%pair)
      n = blocks%pair(p)%last - blocks%pair(p)%first + 1
      m = sum(blocks%pair(p)%n_modes)
      flops = flops + n**3/3 + n**2*m + n*m**2
      entries = entries + n**2/2 + n*m
    end do
  end subroutine network_cost

  !> Free all memory.
  subroutine blocks_destroy(self)
    !> The blocks.
    class(pair_blocks_t), intent(inout) :: self
    if (allocated(self%pair)) deallocate (self%pair)
    if (allocated(self%row)) deallocate (self%row, self%first_mode, self%diagonal)
    if (allocated(self%start)) deallocate (self%start, self%neighbour, self%order)
  end subroutine blocks_destroy
end module dotyk_scheme_pair_blocks
