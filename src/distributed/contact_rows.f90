!> The contact rows B beside distributed displacements.
!>
!> Rows, their forces and their displacements are the same on all ranks; a rank has the columns of its own nodes, so
!> that a product with B is one sum over ranks of the length of the rows, and one with B^T is local. The compliance of
!> the rows in the diagonal blocks of the smoother, B D^{-1} B^T, is of the size of the contact surfaces and on one rank
!> of each node.
!>
!> Matrices of the size of the contact surfaces, and their factors, are on one rank of each node, which sends the others
!> the results. Every node computes the same, so that results are the same to the bit on all ranks.
module dotyk_distributed_contact_rows
  use mpi_f08, only: mpi_bcast, mpi_comm, mpi_comm_free, mpi_comm_rank, mpi_comm_split_type, mpi_comm_type_shared, &
    mpi_comm_world, mpi_double_precision, mpi_info_null
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_petsc, only: sum_of_ranks
  use dotyk_elasticity_constraint, only: held
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_ranks_exchange, only: agree_on_error
  use dotyk_scheme_gap_closing, only: close_gaps
  implicit none
  private
  public :: without_rounding

  type :: node_keeper_t  !! The ranks of a node. All ranks call its procedures together.
    logical :: keeps = .true.  !! Whether this rank is the one that keeps.
    type(mpi_comm), private :: ranks  !! The ranks of the node.
    logical, private :: is_set = .false.  !! Whether there is such a communicator.
  contains
    procedure :: init => keeper_init
    procedure :: tell => keeper_tell
    procedure :: destroy => keeper_destroy
  end type node_keeper_t

  type, public :: contact_rows_t  !! The rows.
    integer :: n = 0  !! Number of rows.
    integer :: dim = 0  !! Number of displacement components.
    integer, allocatable :: node(:)  !! Own nodes that rows touch: their places among the own nodes (n_nodes).
    !> Entries of the rows at these nodes, along their axes; none of held components (n x dim*n_nodes) [].
    type(sparse_rows_t) :: own
    real(dp), allocatable :: prescribed(:)  !! Displacement of the rows by prescribed displacements (n) [length].
    !> Inverse diagonal blocks of the smoother at these nodes (dim, dim, n_nodes) [length/force].
    real(dp), allocatable :: inverse(:, :, :)
    type(node_keeper_t) :: keeper  !! The rank of this node that has `compliance`.
    !> B D^{-1} B^T, lower triangle; empty on the other ranks (n, n) [length/force].
    type(sparse_symmetric_t) :: compliance
    real(dp), allocatable :: self_compliance(:)  !! Its diagonal, on all ranks (n) [length/force].
    !> Contact nodes and contact blocks of this rank's nodes, for `set_inverse`.
    integer, allocatable, private :: contact_node(:), block_of(:)
    !> Axes of these nodes: global component, component of the node (dim, dim, n_nodes) [].
    real(dp), allocatable, private :: axes(:, :, :)
  contains
    procedure :: init => rows_init
    procedure :: set_inverse => rows_set_inverse
    procedure :: displacement => rows_displacement
    procedure :: subtract_force => rows_subtract_force
    procedure :: subtract_smoothed => rows_subtract_smoothed
    procedure :: close_gaps => rows_close_gaps
    procedure :: destroy => rows_destroy
  end type contact_rows_t

contains

  !> The rows without entries that are rounding errors: a row of a held node would else seem to move, by forces without
  !> bound.
  function without_rounding(block) result(clean)
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B, body by body (n_bodies).
    type(contact_block_t), allocatable :: clean(:)  !! The same, with zeros (n_bodies).
    integer :: b, i
    clean = block
    do b = 1, size(clean)
      associate (matrix => clean(b)%matrix)
        do i = 1, matrix%n_rows
          associate (value => matrix%value(matrix%row_start(i):matrix%row_start(i + 1) - 1))
            if (size(value) == 0) cycle
            where (abs(value) <= rounding*maxval(abs(value))) value = 0
          end associate
        end do
      end associate
    end do
  end function without_rounding

  !> Take the rows at the own nodes.
  subroutine rows_init(self, n_rows, dim, block, part, first)
    class(contact_rows_t), intent(out) :: self
    integer, intent(in) :: n_rows  !! Number of rows.
    integer, intent(in) :: dim  !! Number of displacement components.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B, body by body (n_bodies).
    type(part_t), intent(in) :: part(:)  !! Parts of this rank, numbered (n_parts).
    integer, intent(in) :: first  !! Block row of the first own node, from 0.
    integer, allocatable :: local(:), column_of(:), row(:), column(:)
    real(dp), allocatable :: value(:)
    real(dp) :: entry(dim), rotation(dim, dim)
    integer :: p, b, i, k, c, j, node, n, n_entries
    self%n = n_rows
    self%dim = dim
    call self%keeper%init()
    allocate (self%prescribed(n_rows), source=0.0_dp)
    n = sum([(size(block(part(p)%body)%contact_node), p=1, size(part))])
    n_entries = sum([(size(block(part(p)%body)%matrix%value), p=1, size(part))])
    allocate (self%node(n), self%contact_node(n), self%block_of(n), self%axes(dim, dim, n))
    allocate (row(n_entries), column(n_entries), value(n_entries))
    n = 0
    n_entries = 0
    do p = 1, size(part)
      b = part(p)%body
      associate (nodes => block(b)%node_numbers(), matrix => block(b)%matrix, constraint => part(p)%constraint)
        local = [(part(p)%local_node(nodes(i)), i=1, size(nodes))]
        column_of = spread(0, 1, size(nodes))
        do i = 1, size(nodes)
          if (local(i) == 0) cycle
          if (.not. part(p)%is_own(local(i))) cycle
          n = n + 1
          column_of(i) = n
          self%node(n) = part(p)%row(local(i)) - first + 1
          self%contact_node(n) = i
          self%block_of(n) = b
          self%axes(:, :, n) = part(p)%axes(local(i))
        end do
        do i = 1, matrix%n_rows
          k = matrix%row_start(i)
          do while (k < matrix%row_start(i + 1))
            ! All entries of one node.
            c = (matrix%column(k) - 1)/dim + 1
            entry = 0
            do while (k < matrix%row_start(i + 1))
              if ((matrix%column(k) - 1)/dim + 1 /= c) exit
              entry(matrix%column(k) - dim*(c - 1)) = matrix%value(k)
              k = k + 1
            end do
            if (column_of(c) == 0) cycle
            node = local(c)
            rotation = part(p)%axes(node)
            do j = 1, dim
              if (constraint%equation(j, node) == held) cycle
              n_entries = n_entries + 1
              row(n_entries) = block(b)%row(i)
              column(n_entries) = dim*(column_of(c) - 1) + j
              value(n_entries) = dot_product(entry, rotation(:, j))
            end do
            if (constraint%frame_of(node) > 0) entry = matmul(entry, constraint%frame(:, :, constraint%frame_of(node)))
            self%prescribed(block(b)%row(i)) = self%prescribed(block(b)%row(i)) + &
              sum(entry*constraint%prescribed(:, node), mask=constraint%equation(:, node) == held)
          end do
        end do
      end associate
    end do
    self%node = self%node(:n)
    self%contact_node = self%contact_node(:n)
    self%block_of = self%block_of(:n)
    self%axes = self%axes(:, :, :n)
    call self%own%init_from_triplets(n_rows, dim*n, row(:n_entries), column(:n_entries), value(:n_entries))
    call sum_of_ranks(self%prescribed)
  end subroutine rows_init

  !> Set the inverse diagonal blocks, and from them the compliance of the rows.
  subroutine rows_set_inverse(self, block, inverse)
    class(contact_rows_t), intent(inout) :: self
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B, body by body (n_bodies).
    !> Inverse blocks at `node`, along the axes of the nodes (dim, dim, n_nodes) [length/force].
    real(dp), intent(in) :: inverse(:, :, :)
    real(dp), allocatable :: all(:)
    integer, allocatable :: first(:)
    integer :: b, i, k, n
    self%inverse = inverse
    associate (dim => self%dim)
      allocate (first, source=[0, (sum([(size(block(k)%contact_node), k=1, b)]), b=1, size(block))])
      allocate (all(dim*dim*first(size(first))), source=0.0_dp)
      do i = 1, size(self%node)
        n = dim*dim*(first(self%block_of(i)) + self%contact_node(i) - 1)
        all(n + 1:n + dim*dim) = reshape(matmul(self%axes(:, :, i), matmul(inverse(:, :, i), &
                                                                          transpose(self%axes(:, :, i)))), [dim*dim])
      end do
      call sum_of_ranks(all)
    end associate
    allocate (self%self_compliance(self%n))
    if (self%keeper%keeps) then
      call form_compliance(self%n, self%dim, block, first, all, self%compliance)
      self%self_compliance(:) = self%compliance%value(self%compliance%column_start(:self%n) + 1)
    end if
    call self%keeper%tell(self%self_compliance)
  end subroutine rows_set_inverse

  !> B D^{-1} B^T.
  subroutine form_compliance(n_rows, dim, block, first, inverse, compliance)
    integer, intent(in) :: n_rows  !! Number of rows.
    integer, intent(in) :: dim  !! Number of displacement components.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B, body by body (n_bodies).
    integer, intent(in) :: first(:)  !! Contact nodes before each body (n_bodies + 1).
    !> Inverse blocks at the contact nodes of all bodies (dim*dim*first(n_bodies + 1)) [length/force].
    real(dp), intent(in) :: inverse(:)
    type(sparse_symmetric_t), intent(out) :: compliance  !! Lower triangle (n_rows, n_rows) [length/force].
    type(sparse_rows_t) :: scaled, transposed, product
    integer, allocatable :: row(:), column(:), of_body(:)
    real(dp), allocatable :: value(:)
    integer :: b, i, m
    allocate (row(0), column(0), value(0))
    do b = 1, size(block)
      associate (matrix => block(b)%matrix)
        if (matrix%n_rows == 0) cycle
        call block_diagonal(dim, size(block(b)%contact_node), inverse(dim*dim*first(b) + 1:dim*dim*first(b + 1)), &
                            scaled)
        call transpose_rows(matrix, transposed)
        call product%set_product(scaled, transposed)
        call scaled%set_product(matrix, product)
        m = scaled%row_start(scaled%n_rows + 1) - 1
        of_body = [(spread(block(b)%row(i), 1, scaled%row_start(i + 1) - scaled%row_start(i)), i=1, scaled%n_rows)]
        row = [row, of_body]
        column = [column, block(b)%row(scaled%column(:m))]
        value = [value, scaled%value(:m)]
      end associate
    end do
    ! Rows between held nodes have no entries.
    row = [row, (i, i=1, n_rows)]
    column = [column, (i, i=1, n_rows)]
    value = [value, (0.0_dp, i=1, n_rows)]
    call product%init_from_triplets(n_rows, n_rows, row, column, value)
    call take_lower(product, compliance)
  end subroutine form_compliance

  !> A block diagonal matrix.
  subroutine block_diagonal(dim, n, blocks, matrix)
    integer, intent(in) :: dim  !! Order of the blocks.
    integer, intent(in) :: n  !! Number of blocks.
    real(dp), intent(in) :: blocks(dim, dim, n)  !! The blocks, symmetric (dim, dim, n) [any].
    type(sparse_rows_t), intent(inout) :: matrix  !! The matrix.
    integer :: i, j, k
    call matrix%init_from_triplets(dim*n, dim*n, [(((dim*(k - 1) + i, i=1, dim), j=1, dim), k=1, n)], &
                                   [(((dim*(k - 1) + j, i=1, dim), j=1, dim), k=1, n)], reshape(blocks, [dim*dim*n]))
  end subroutine block_diagonal

  !> A^T.
  subroutine transpose_rows(matrix, transposed)
    type(sparse_rows_t), intent(in) :: matrix  !! A.
    type(sparse_rows_t), intent(inout) :: transposed  !! Its transpose.
    integer :: row(matrix%row_start(matrix%n_rows + 1) - 1), i
    do i = 1, matrix%n_rows
      row(matrix%row_start(i):matrix%row_start(i + 1) - 1) = i
    end do
    call transposed%init_from_triplets(matrix%n_columns, matrix%n_rows, matrix%column(:size(row)), row, &
                                       matrix%value(:size(row)))
  end subroutine transpose_rows

  !> The lower triangle of a symmetric matrix with all diagonal entries.
  subroutine take_lower(all, lower)
    type(sparse_rows_t), intent(in) :: all  !! The matrix.
    type(sparse_symmetric_t), intent(out) :: lower  !! Its lower triangle, by columns.
    integer :: i, k
    integer(int64) :: n
    lower%n = all%n_rows
    n = (size(all%column, kind=int64) + all%n_rows)/2
    allocate (lower%column_start(all%n_rows + 1), lower%row(n), lower%value(n))
    n = 0
    do i = 1, all%n_rows
      lower%column_start(i) = n
      do k = all%row_start(i), all%row_start(i + 1) - 1
        if (all%column(k) < i) cycle
        n = n + 1
        lower%row(n) = all%column(k) - 1
        lower%value(n) = all%value(k)
      end do
    end do
    lower%column_start(all%n_rows + 1) = n
  end subroutine take_lower

  !> y = B x, without prescribed displacements.
  subroutine rows_displacement(self, x, y)
    class(contact_rows_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Displacements of the own nodes (dim*n_own) [length].
    real(dp), intent(out), contiguous :: y(:)  !! On all ranks (n) [length].
    real(dp) :: own(self%own%n_columns)
    integer :: i
    do i = 1, size(self%node)
      own(self%dim*(i - 1) + 1:self%dim*i) = x(self%dim*(self%node(i) - 1) + 1:self%dim*self%node(i))
    end do
    call self%own%multiply(own, y)
    call sum_of_ranks(y)
  end subroutine rows_displacement

  !> r := r - B^T lambda.
  subroutine rows_subtract_force(self, lambda, r)
    class(contact_rows_t), intent(in) :: self
    real(dp), intent(in) :: lambda(:)  !! Forces, the same on all ranks (n) [force].
    real(dp), intent(inout), contiguous :: r(:)  !! Forces on the own nodes (dim*n_own) [force].
    real(dp) :: own(self%own%n_columns)
    integer :: i
    call self%own%multiply_transposed(lambda, own)
    do i = 1, size(self%node)
      associate (at => r(self%dim*(self%node(i) - 1) + 1:self%dim*self%node(i)))
        at = at - own(self%dim*(i - 1) + 1:self%dim*i)
      end associate
    end do
  end subroutine rows_subtract_force

  !> z := z - D^{-1} B^T lambda.
  subroutine rows_subtract_smoothed(self, lambda, z)
    class(contact_rows_t), intent(in) :: self
    real(dp), intent(in) :: lambda(:)  !! Forces, the same on all ranks (n) [force].
    real(dp), intent(inout), contiguous :: z(:)  !! Displacements of the own nodes (dim*n_own) [length].
    real(dp) :: own(self%own%n_columns)
    integer :: i
    call self%own%multiply_transposed(lambda, own)
    do i = 1, size(self%node)
      associate (at => z(self%dim*(self%node(i) - 1) + 1:self%dim*self%node(i)))
        at = at - matmul(self%inverse(:, :, i), own(self%dim*(i - 1) + 1:self%dim*i))
      end associate
    end do
  end subroutine rows_subtract_smoothed

  !> Close gaps by forces on the diagonal blocks of the smoother (`dotyk_scheme_gap_closing`). All ranks call it.
  subroutine rows_close_gaps(self, chosen, gap, softness, shift, closed, norm, error)
    class(contact_rows_t), intent(in) :: self
    logical, intent(in) :: chosen(:)  !! Rows to close (n_rows).
    real(dp), intent(in) :: gap(:)  !! Gaps to close (n_rows) [length].
    real(dp), intent(in) :: softness(:)  !! theta/w (n_rows) [length/force].
    real(dp), intent(in) :: shift  !! Fraction of the diagonal that is added [].
    real(dp), intent(out), contiguous :: closed(:)  !! B g, of all rows (n_rows) [length].
    real(dp), intent(out) :: norm  !! Energy norm of g, at most; `huge` where there is none [sqrt(energy)].
    type(error_t), allocatable, intent(out) :: error  !! As in `close_gaps`.
    real(dp) :: found(1)
    if (self%keeper%keeps) call close_gaps(self%compliance, chosen, gap, softness, shift, closed, found(1), error)
    call agree_on_error(error)
    call self%keeper%tell(closed)
    call self%keeper%tell(found)
    norm = found(1)
  end subroutine rows_close_gaps

  !> Give back the communicator.
  subroutine rows_destroy(self)
    class(contact_rows_t), intent(inout) :: self
    call self%keeper%destroy()
  end subroutine rows_destroy

  !> Choose the first rank of each node.
  subroutine keeper_init(self)
    class(node_keeper_t), intent(out) :: self
    integer :: rank
    call mpi_comm_split_type(mpi_comm_world, mpi_comm_type_shared, 0, mpi_info_null, self%ranks)
    call mpi_comm_rank(self%ranks, rank)
    self%keeps = rank == 0
    self%is_set = .true.
  end subroutine keeper_init

  !> Make the numbers of the rank that keeps known to all ranks of its node.
  subroutine keeper_tell(self, x)
    class(node_keeper_t), intent(in) :: self
    !> Those of the rank that keeps in, on all ranks out (any number) [any].
    real(dp), intent(inout), contiguous :: x(:)
    call mpi_bcast(x, size(x), mpi_double_precision, 0, self%ranks)
  end subroutine keeper_tell

  !> Give back the communicator.
  subroutine keeper_destroy(self)
    class(node_keeper_t), intent(inout) :: self
    if (self%is_set) call mpi_comm_free(self%ranks)
    self%is_set = .false.
  end subroutine keeper_destroy
end module dotyk_distributed_contact_rows
