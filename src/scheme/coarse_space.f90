!> The coarse space of the contact problem, as in FETI: rigid body modes of floating bodies at the contact rows.
!>
!> With R_b the rigid body modes of body b and B_b its columns of B, the blocks are `G_b = B_b R_b`: amplitudes `alpha`
!> move the contact points by `G alpha`, and contact forces `lambda` have the resultants `G^T lambda` on the modes.
!> Floating bodies are in equilibrium where `G^T lambda = e`, the resultants of their loads. Near-null-space modes,
!> which supports hardly restrain, have a stiffness S: `G^T lambda + S alpha = e`. Modes are scaled to move the contact
!> nodes of the body by 1 at most: amplitudes are lengths, resultants are forces.
module dotyk_scheme_coarse_space
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: default_max_unbalanced
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_dense, only: solve_dense
  implicit none
  private

  !> The modes of one body at its contact nodes.
  type, public :: contact_modes_t
    !> In Cartesian components (dimension*n_contact_nodes, n) [].
    real(dp), allocatable :: displacement(:, :)
    !> Resultants of the loads on them (n) [force].
    real(dp), allocatable :: resultant(:)
    !> Stiffness of near-null-space modes; not allocated for rigid body modes (n, n) [force/length].
    real(dp), allocatable :: stiffness(:, :)
    !> Contribution of prescribed displacements to the resultants of near-null-space modes (n) [force].
    real(dp), allocatable :: lift_resultant(:)
    !> Sum of the absolute values that these resultants are made up of (n) [force].
    real(dp), allocatable :: resultant_size(:)
    !> Mean square displacement of all nodes of the body: the same for all its orthonormal modes [].
    real(dp) :: mean_square = 1
  end type contact_modes_t

  !> A dense block of one body.
  type, public :: mode_block_t
    !> G_b (rows of the body, modes) or S_b (modes, modes) [force/length].
    real(dp), allocatable :: value(:, :)
  end type mode_block_t

  !> All modes, body after body.
  type, public :: coarse_space_t
    !> Number of modes.
    integer :: n = 0
    !> Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    integer, allocatable :: first(:)
    !> Resultants e of the loads (n) [force].
    real(dp), allocatable :: resultant(:)
    !> S by bodies, 0 for exact rigid body modes; not allocated where no mode has a stiffness (n_bodies).
    type(mode_block_t), allocatable :: stiffness(:)
    !> Contribution of prescribed displacements to e; allocated with S (n) [force].
    real(dp), allocatable :: lift(:)
    !> Sum of the absolute values that e is made up of, for its rounding error; allocated with S (n) [force].
    real(dp), allocatable :: resultant_size(:)
    !> Amplitudes of the modes of the bodies per amplitude of these (n).
    real(dp), allocatable :: scale(:)
    !> Mean square displacement of the nodes of the body by each mode (n) [].
    real(dp), allocatable :: mean_square(:)
    !> G by bodies (n_bodies).
    type(mode_block_t), allocatable :: block(:)
    !> How uncertain G is: its change where the normals of the slave surfaces are taken for those of the master
    !> surfaces; not allocated where they agree (n_bodies).
    type(mode_block_t), allocatable :: deviation(:)
    !> Forces along motions that contact does not determine are errors of the loads or of the mesh up to this fraction
    !> of the forces on the body (`&solver max_unbalanced`) [].
    real(dp) :: max_unbalanced = default_max_unbalanced
    !> The two bodies of each row, 0 where there is no second one (2, n_rows).
    integer, allocatable :: body(:, :)
    !> Position of each row among the rows of these bodies (2, n_rows).
    integer, allocatable :: place(:, :)
  contains
    procedure :: init => coarse_init
    procedure :: take_rows => coarse_take_rows
    procedure :: stiffness_forces => coarse_stiffness_forces
    procedure :: has_stiffness => coarse_has_stiffness
    procedure :: rounding => coarse_rounding
    procedure :: rows => coarse_rows
    procedure :: add_springs => coarse_add_springs
    procedure :: destroy => coarse_destroy
  end type coarse_space_t

  public :: multiply_blocks

  !> Entries of G below this are rounding errors: modes along a surface.
  real(dp), parameter :: rounding = 1.0e-12_dp
  !> Rounding errors of sums of forces over a body, as a fraction of the sum of their absolute values: errors have all
  !> signs, so that many add up to no more than one.
  real(dp), parameter :: rounding_of_sums = epsilon(1.0_dp)

contains

  !> Make the coarse space.
  subroutine coarse_init(self, block, n_rows, modes)
    !> The coarse space.
    class(coarse_space_t), intent(inout) :: self
    !> Rows of B by bodies (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Number of contact rows.
    integer, intent(in) :: n_rows
    !> Modes at the contact nodes (n_bodies).
    type(contact_modes_t), intent(in) :: modes(:)
    real(dp) :: most
    integer :: b, j
    call self%destroy()
    call self%take_rows(block, n_rows)
    allocate (self%first(size(block) + 1), self%block(size(block)))
    self%first(1) = 1
    do b = 1, size(block)
      self%first(b + 1) = self%first(b) + size(modes(b)%resultant)
    end do
    self%n = self%first(size(block) + 1) - 1
    allocate (self%scale(self%n), self%resultant(self%n), self%mean_square(self%n))
    do b = 1, size(block)
      associate (own => modes(b), first => self%first(b))
        allocate (self%block(b)%value(size(block(b)%row), size(own%resultant)))
        do j = 1, size(own%resultant)
          self%scale(first + j - 1) = 1
          self%resultant(first + j - 1) = own%resultant(j)
          self%mean_square(first + j - 1) = own%mean_square
          if (size(block(b)%row) == 0) cycle
          ! A mode of a part without contact nodes moves none.
          most = maxval(abs(own%displacement(:, j)))
          if (most > rounding) self%scale(first + j - 1) = 1/most
          self%resultant(first + j - 1) = self%scale(first + j - 1)*own%resultant(j)
          self%mean_square(first + j - 1) = self%scale(first + j - 1)**2*own%mean_square
          call block(b)%matrix%multiply(self%scale(first + j - 1)*own%displacement(:, j), self%block(b)%value(:, j))
          ! Near-null-space modes are not exactly rigid: small entries may be true, as small as the stiffness.
          if (allocated(own%stiffness)) cycle
          where (abs(self%block(b)%value(:, j)) < rounding) self%block(b)%value(:, j) = 0
        end do
      end associate
    end do
    if (any([(allocated(modes(b)%stiffness), b=1, size(modes))])) call take_stiffness(self, modes)
  end subroutine coarse_init

  !> The bodies of each row.
  subroutine coarse_take_rows(self, block, n_rows)
    !> Sets `body` and `place`.
    class(coarse_space_t), intent(inout) :: self
    !> Rows of B by bodies (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Number of contact rows.
    integer, intent(in) :: n_rows
    integer :: b, i, j, k
    if (allocated(self%body)) deallocate (self%body, self%place)
    allocate (self%body(2, n_rows), self%place(2, n_rows), source=0)
    do b = 1, size(block)
      do i = 1, size(block(b)%row)
        j = block(b)%row(i)
        k = merge(1, 2, self%body(1, j) == 0)
        self%body(k, j) = b
        self%place(k, j) = i
      end do
    end do
  end subroutine coarse_take_rows

  !> Stiffness of the near-null-space modes, and the parts of their resultants.
  subroutine take_stiffness(self, modes)
    !> Sets `stiffness`, `lift` and `resultant_size`.
    class(coarse_space_t), intent(inout) :: self
    !> Modes of the bodies; at least one has a stiffness (n_bodies).
    type(contact_modes_t), intent(in) :: modes(:)
    integer :: b, j, n
    allocate (self%stiffness(size(modes)))
    allocate (self%lift(self%n), source=0.0_dp)
    self%resultant_size = abs(self%resultant)
    do b = 1, size(modes)
      associate (own => modes(b), first => self%first(b), last => self%first(b + 1) - 1, &
                 scale => self%scale(self%first(b):self%first(b + 1) - 1))
        n = size(scale)
        allocate (self%stiffness(b)%value(n, n), source=0.0_dp)
        if (.not. allocated(own%stiffness)) cycle
        do j = 1, n
          self%stiffness(b)%value(:, j) = scale*own%stiffness(:, j)*scale(j)
        end do
        self%lift(first:last) = scale*own%lift_resultant
        self%resultant_size(first:last) = scale*own%resultant_size
      end associate
    end do
  end subroutine take_stiffness

  !> S alpha, 0 where there is no stiffness.
  pure function coarse_stiffness_forces(self, alpha) result(force)
    !> The coarse space.
    class(coarse_space_t), intent(in) :: self
    !> Amplitudes (n) [length].
    real(dp), intent(in) :: alpha(:)
    !> (n) [force]
    real(dp) :: force(size(alpha))
    force = 0
    if (allocated(self%stiffness)) force = multiply_blocks(self%first, self%stiffness, alpha)
  end function coarse_stiffness_forces

  !> Product of a block diagonal matrix with amplitudes.
  pure function multiply_blocks(first, block, alpha) result(product)
    !> Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    integer, intent(in) :: first(:)
    !> Diagonal blocks (n_bodies).
    type(mode_block_t), intent(in) :: block(:)
    !> Amplitudes (n) [length].
    real(dp), intent(in) :: alpha(:)
    !> (n)
    real(dp) :: product(size(alpha))
    integer :: b, j
    do b = 1, size(block)
      associate (own => product(first(b):first(b + 1) - 1))
        own = 0
        do j = 1, size(own)
          own = own + alpha(first(b) + j - 1)*block(b)%value(:, j)
        end do
      end associate
    end do
  end function multiply_blocks

  !> Energy norm of the amplitudes that rounding errors of forces and resultants excite against the stiffness S alone.
  subroutine coarse_rounding(self, block, lambda, norm)
    !> The coarse space.
    class(coarse_space_t), intent(in) :: self
    !> Rows of B (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Contact forces (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> 0 without a stiffness, `huge` where S is singular [sqrt(energy)].
    real(dp), intent(out) :: norm
    type(error_t), allocatable :: error
    real(dp), allocatable :: force(:), inverse(:, :)
    integer :: b, i, j
    norm = 0
    if (.not. allocated(self%lift)) return
    do b = 1, size(self%block)
      associate (first => self%first(b), last => self%first(b + 1) - 1, stiffness => self%stiffness(b)%value)
        if (last < first) cycle
        if (.not. stiffness(1, 1) > 0) cycle
        force = rounding_of_sums*(self%resultant_size(first:last) + &
                                  matmul(abs(lambda(block(b)%row)), abs(self%block(b)%value)))
        allocate (inverse(size(force), size(force)), source=0.0_dp)
        do i = 1, size(force)
          inverse(i, i) = 1
        end do
        call solve_dense(stiffness, inverse, error)
        if (allocated(error)) then
          norm = huge(norm)
          return
        end if
        norm = norm + sum([((force(i)*abs(inverse(i, j))*force(j), i=1, size(force)), j=1, size(force))])
        deallocate (inverse)
      end associate
    end do
    norm = sqrt(norm)
  end subroutine coarse_rounding

  !> Add the same spring to the stiffness of all modes.
  subroutine coarse_add_springs(self, spring)
    !> The coarse space.
    class(coarse_space_t), intent(inout) :: self
    !> Stiffness against each mode [force/length].
    real(dp), intent(in) :: spring
    integer :: b, i, n
    if (.not. allocated(self%stiffness)) then
      allocate (self%stiffness(size(self%block)))
      do b = 1, size(self%block)
        n = self%first(b + 1) - self%first(b)
        allocate (self%stiffness(b)%value(n, n), source=0.0_dp)
      end do
    end if
    do b = 1, size(self%block)
      do i = 1, size(self%stiffness(b)%value, 1)
        self%stiffness(b)%value(i, i) = self%stiffness(b)%value(i, i) + spring
      end do
    end do
  end subroutine coarse_add_springs

  !> Some rows of G as a dense matrix, or how uncertain they are.
  pure subroutine coarse_rows(self, row, g, uncertain)
    !> The coarse space.
    class(coarse_space_t), intent(in) :: self
    !> The rows (m).
    integer, intent(in) :: row(:)
    !> G, or `deviation` (m, n) [].
    real(dp), intent(out) :: g(:, :)
    !> Whether `deviation` is asked for; not if absent.
    logical, intent(in), optional :: uncertain
    logical :: is_deviation
    integer :: i, k, b
    g = 0
    is_deviation = .false.
    if (present(uncertain)) is_deviation = uncertain
    do i = 1, size(row)
      do k = 1, 2
        b = self%body(k, row(i))
        if (b == 0) cycle
        if (is_deviation) then
          g(i, self%first(b):self%first(b + 1) - 1) = self%deviation(b)%value(self%place(k, row(i)), :)
        else
          g(i, self%first(b):self%first(b + 1) - 1) = self%block(b)%value(self%place(k, row(i)), :)
        end if
      end do
    end do
  end subroutine coarse_rows

  !> Whether every mode of a body has a stiffness of its own.
  pure logical function coarse_has_stiffness(self, b) result(has_stiffness)
    !> The coarse space.
    class(coarse_space_t), intent(in) :: self
    !> The body.
    integer, intent(in) :: b
    integer :: i
    has_stiffness = allocated(self%stiffness)
    if (has_stiffness) &
      has_stiffness = all([(self%stiffness(b)%value(i, i) > 0, i=1, size(self%stiffness(b)%value, 1))])
  end function coarse_has_stiffness

  !> Free all memory.
  subroutine coarse_destroy(self)
    !> The coarse space.
    class(coarse_space_t), intent(inout) :: self
    self%n = 0
    if (allocated(self%first)) deallocate (self%first, self%block, self%body, self%place)
    if (allocated(self%scale)) deallocate (self%scale, self%mean_square)
    if (allocated(self%deviation)) deallocate (self%deviation)
    if (allocated(self%stiffness)) deallocate (self%stiffness)
    if (allocated(self%lift)) deallocate (self%lift, self%resultant_size)
    if (allocated(self%resultant)) deallocate (self%resultant)
  end subroutine coarse_destroy
end module dotyk_scheme_coarse_space
