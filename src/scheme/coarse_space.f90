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
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_linalg_dense, only: solve_dense
  implicit none
  private

  type, public :: contact_modes_t  !! The modes of one body at its contact nodes.
    real(dp), allocatable :: displacement(:, :)  !! In Cartesian components (dimension*n_contact_nodes, n) [].
    real(dp), allocatable :: resultant(:)  !! Resultants of the loads on them (n) [force].
    !> Stiffness of near-null-space modes; not allocated for rigid body modes (n, n) [force/length].
    real(dp), allocatable :: stiffness(:, :)
    !> Contribution of prescribed displacements to the resultants of near-null-space modes (n) [force].
    real(dp), allocatable :: lift_resultant(:)
    real(dp), allocatable :: resultant_size(:)  !! Sums of the absolute terms of the resultants (n) [force].
    !> Amplitudes of the unit translations of a body in one piece, and translations of its centre by its modes (n, 6)
    !> []; without columns for other bodies, not allocated for near-null-space modes.
    real(dp), allocatable :: translation(:, :)
    !> Mean square displacement of all nodes of the body: the same for all its orthonormal modes [].
    real(dp) :: mean_square = 1
  end type contact_modes_t

  type, public :: mode_block_t  !! A dense block of one body.
    real(dp), allocatable :: value(:, :)  !! G_b (rows of the body, modes) or S_b (modes, modes) [force/length].
  end type mode_block_t

  !> A bolt of given tension: a tie whose sides come closer by an unknown shortening s along a direction n,
  !> `B u - d = s n`, until it transmits the force, `-sum lambda.n = force`.
  type, public :: slide_t
    !> Slave body of the tie; first row, number of rows of each component, one component after the other, and number of
    !> components.
    integer :: body = 0, first = 0, n_rows = 0, dimension = 0
    real(dp) :: direction(3) = 0  !! Direction (3) [].
    real(dp) :: force = 0  !! Tension [force].
  end type slide_t

  type, public :: coarse_space_t  !! All modes, body after body; after those of a body the shortenings of its bolts.
    integer :: n = 0  !! Number of modes.
    integer, allocatable :: first(:)  !! Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    logical, allocatable :: is_slide(:)  !! Modes that move no body: shortenings of bolts (n).
    real(dp), allocatable :: resultant(:)  !! Resultants e of the loads (n) [force].
    !> S by bodies, 0 for exact rigid body modes; not allocated where no mode has a stiffness (n_bodies).
    type(mode_block_t), allocatable :: stiffness(:)
    real(dp), allocatable :: lift(:)  !! Contribution of prescribed displacements to e; allocated with S (n) [force].
    real(dp), allocatable :: resultant_size(:)  !! Sums of the absolute terms of e (n) [force].
    real(dp), allocatable :: scale(:)  !! Amplitudes of the modes of the bodies per amplitude of these (n).
    real(dp), allocatable :: mean_square(:)  !! Mean square displacement of the nodes of the body by each mode (n) [].
    type(mode_block_t), allocatable :: translation(:)  !! The same for each body (n_bodies) [length, no unit].
    type(mode_block_t), allocatable :: block(:)  !! G by bodies (n_bodies).
    !> How uncertain G is: its change where the normals of the slave surfaces are taken for those of the master
    !> surfaces; not allocated where they agree (n_bodies).
    type(mode_block_t), allocatable :: deviation(:)
    !> Forces along motions that contact does not determine are errors of the loads or of the mesh up to this fraction
    !> of the forces on the body (`&solver max_unbalanced`) [].
    real(dp) :: max_unbalanced = default_max_unbalanced
    !> The bodies of each row, two but where rows are joined; 0 where there are fewer (n, n_rows).
    integer, allocatable :: body(:, :)
    integer, allocatable :: place(:, :)  !! Position of each row among the rows of these bodies (n, n_rows).
  contains
    procedure :: init => coarse_init
    procedure :: take_rows => coarse_take_rows
    procedure :: stiffness_forces => coarse_stiffness_forces
    procedure :: has_stiffness => coarse_has_stiffness
    procedure :: rounding => coarse_rounding
    procedure :: rows => coarse_rows
    procedure :: destroy => coarse_destroy
  end type coarse_space_t

  public :: multiply_blocks

contains

  !> Make the coarse space.
  subroutine coarse_init(self, block, n_rows, modes, slide)
    class(coarse_space_t), intent(inout) :: self
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B by bodies (n_bodies).
    integer, intent(in) :: n_rows  !! Number of contact rows.
    type(contact_modes_t), intent(in) :: modes(:)  !! Modes at the contact nodes (n_bodies).
    type(slide_t), intent(in), optional :: slide(:)  !! Bolts of given tension; none if absent (n_slides).
    type(slide_t), allocatable :: bolt(:)
    real(dp) :: most
    integer :: b, j, n
    allocate (bolt(0))
    if (present(slide)) bolt = slide
    call self%destroy()
    call self%take_rows(block, n_rows)
    allocate (self%first(size(block) + 1), self%block(size(block)), self%translation(size(block)))
    self%first(1) = 1
    do b = 1, size(block)
      self%first(b + 1) = self%first(b) + size(modes(b)%resultant) + count(bolt%body == b)
    end do
    self%n = self%first(size(block) + 1) - 1
    allocate (self%resultant(self%n), self%resultant_size(self%n))
    allocate (self%scale(self%n), self%mean_square(self%n), source=1.0_dp)
    allocate (self%is_slide(self%n), source=.true.)
    do b = 1, size(block)
      associate (own => modes(b), first => self%first(b))
        allocate (self%block(b)%value(size(block(b)%row), self%first(b + 1) - self%first(b)))
        if (allocated(own%translation)) self%translation(b)%value = own%translation
        do j = 1, size(own%resultant)
          self%is_slide(first + j - 1) = .false.
          self%resultant(first + j - 1) = own%resultant(j)
          self%resultant_size(first + j - 1) = own%resultant_size(j)
          self%mean_square(first + j - 1) = own%mean_square
          if (size(block(b)%row) == 0) cycle
          ! A mode of a part without contact nodes moves none.
          most = maxval(abs(own%displacement(:, j)))
          if (most > rounding) self%scale(first + j - 1) = 1/most
          self%resultant(first + j - 1) = self%scale(first + j - 1)*own%resultant(j)
          self%resultant_size(first + j - 1) = self%scale(first + j - 1)*own%resultant_size(j)
          self%mean_square(first + j - 1) = self%scale(first + j - 1)**2*own%mean_square
          if (allocated(own%translation)) then
            if (size(own%translation) > 0) self%translation(b)%value(j, :) = own%translation(j, :)*&
              self%scale(first + j - 1)**[-1, -1, -1, 1, 1, 1]
          end if
          call block(b)%matrix%multiply(self%scale(first + j - 1)*own%displacement(:, j), self%block(b)%value(:, j))
          ! Near-null-space modes are not exactly rigid: small entries may be true, as small as the stiffness.
          if (allocated(own%stiffness)) cycle
          where (abs(self%block(b)%value(:, j)) < rounding) self%block(b)%value(:, j) = 0
        end do
      end associate
      n = size(modes(b)%resultant)
      do j = 1, size(bolt)
        if (bolt(j)%body /= b) cycle
        n = n + 1
        self%resultant(self%first(b) + n - 1) = bolt(j)%force
        self%resultant_size(self%first(b) + n - 1) = abs(bolt(j)%force)
        self%block(b)%value(:, n) = opened_by(bolt(j), block(b)%row)
      end do
    end do
    if (any([(allocated(modes(b)%stiffness), b=1, size(modes))])) call take_stiffness(self, modes)
  end subroutine coarse_init

  !> How a shortening of 1 opens rows, which it closes where displacements take it up (size of `row`) [].
  pure function opened_by(slide, row) result(value)
    type(slide_t), intent(in) :: slide  !! The bolt.
    integer, intent(in) :: row(:)  !! Rows.
    real(dp) :: value(size(row))
    integer :: i, c
    value = 0
    do i = 1, size(row)
      c = (row(i) - slide%first)/slide%n_rows + 1
      if (row(i) >= slide%first .and. c <= slide%dimension) value(i) = -slide%direction(c)
    end do
  end function opened_by

  !> The bodies of each row.
  subroutine coarse_take_rows(self, block, n_rows)
    class(coarse_space_t), intent(inout) :: self
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B by bodies (n_bodies).
    integer, intent(in) :: n_rows  !! Number of contact rows.
    integer :: n_bodies(n_rows), b, i
    n_bodies = 0
    do b = 1, size(block)
      n_bodies(block(b)%row) = n_bodies(block(b)%row) + 1
    end do
    if (allocated(self%body)) deallocate (self%body, self%place)
    associate (most => maxval([2, n_bodies]))
      allocate (self%body(most, n_rows), self%place(most, n_rows), source=0)
    end associate
    n_bodies = 0
    do b = 1, size(block)
      do i = 1, size(block(b)%row)
        associate (j => block(b)%row(i))
          n_bodies(j) = n_bodies(j) + 1
          self%body(n_bodies(j), j) = b
          self%place(n_bodies(j), j) = i
        end associate
      end do
    end do
  end subroutine coarse_take_rows

  !> Stiffness of the near-null-space modes, and the parts of their resultants.
  subroutine take_stiffness(self, modes)
    class(coarse_space_t), intent(inout) :: self
    type(contact_modes_t), intent(in) :: modes(:)  !! Modes of the bodies; at least one has a stiffness (n_bodies).
    integer :: b, j, n, n_all
    allocate (self%stiffness(size(modes)))
    allocate (self%lift(self%n), source=0.0_dp)
    do b = 1, size(modes)
      n = size(modes(b)%resultant)
      n_all = self%first(b + 1) - self%first(b)
      associate (own => modes(b), first => self%first(b), last => self%first(b) + n - 1, &
                 scale => self%scale(self%first(b):self%first(b) + n - 1))
        allocate (self%stiffness(b)%value(n_all, n_all), source=0.0_dp)
        if (.not. allocated(own%stiffness)) cycle
        do j = 1, n
          self%stiffness(b)%value(:n, j) = scale*own%stiffness(:, j)*scale(j)
        end do
        self%lift(first:last) = scale*own%lift_resultant
      end associate
    end do
  end subroutine take_stiffness

  !> S alpha, 0 where there is no stiffness.
  pure function coarse_stiffness_forces(self, alpha) result(force)
    class(coarse_space_t), intent(in) :: self
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (n) [length].
    real(dp) :: force(size(alpha))  !! (n) [force]
    force = 0
    if (allocated(self%stiffness)) force = multiply_blocks(self%first, self%stiffness, alpha)
  end function coarse_stiffness_forces

  !> Product of a block diagonal matrix with amplitudes.
  pure function multiply_blocks(first, block, alpha) result(product)
    integer, intent(in) :: first(:)  !! Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    type(mode_block_t), intent(in) :: block(:)  !! Diagonal blocks (n_bodies).
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (n) [length].
    real(dp) :: product(size(alpha))  !! (n)
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
    class(coarse_space_t), intent(in) :: self
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(out) :: norm  !! 0 without a stiffness, `huge` where S is singular [sqrt(energy)].
    type(error_t), allocatable :: error
    real(dp), allocatable :: force(:), inverse(:, :)
    integer :: b, i, j, n
    norm = 0
    if (.not. allocated(self%lift)) return
    do b = 1, size(self%block)
      associate (first => self%first(b), last => self%first(b + 1) - 1, stiffness => self%stiffness(b)%value)
        n = count(.not. self%is_slide(first:last))
        if (n == 0) cycle
        if (.not. stiffness(1, 1) > 0) cycle
        ! Errors of sums have all signs: many add up to no more than one.
        force = epsilon(norm)*(self%resultant_size(first:first + n - 1) + &
                              matmul(abs(lambda(block(b)%row)), abs(self%block(b)%value(:, :n))))
        allocate (inverse(n, n), source=0.0_dp)
        do i = 1, n
          inverse(i, i) = 1
        end do
        call solve_dense(stiffness(:n, :n), inverse, error)
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

  !> Some rows of G as a dense matrix, or how uncertain they are.
  pure subroutine coarse_rows(self, row, g, uncertain)
    class(coarse_space_t), intent(in) :: self
    integer, intent(in) :: row(:)  !! The rows (m).
    real(dp), intent(out) :: g(:, :)  !! G, or `deviation` (m, n) [].
    logical, intent(in), optional :: uncertain  !! Whether `deviation` is asked for; not if absent.
    logical :: is_deviation
    integer :: i, k, b
    g = 0
    is_deviation = .false.
    if (present(uncertain)) is_deviation = uncertain
    do i = 1, size(row)
      do k = 1, size(self%body, 1)
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

  !> Whether every mode of a body has a stiffness of its own, but for shortenings of bolts.
  pure logical function coarse_has_stiffness(self, b) result(has_stiffness)
    class(coarse_space_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    integer :: i
    has_stiffness = allocated(self%stiffness)
    if (.not. has_stiffness) return
    associate (is_slide => self%is_slide(self%first(b):self%first(b + 1) - 1))
      has_stiffness = all([(self%stiffness(b)%value(i, i) > 0 .or. is_slide(i), i=1, size(is_slide))]) .and. &
                      .not. (size(is_slide) > 0 .and. all(is_slide))
    end associate
  end function coarse_has_stiffness

  !> Free all memory.
  subroutine coarse_destroy(self)
    class(coarse_space_t), intent(inout) :: self
    self%n = 0
    if (allocated(self%first)) deallocate (self%first, self%block, self%body, self%place)
    if (allocated(self%scale)) deallocate (self%scale, self%mean_square)
    if (allocated(self%deviation)) deallocate (self%deviation)
    if (allocated(self%translation)) deallocate (self%translation)
    if (allocated(self%stiffness)) deallocate (self%stiffness)
    if (allocated(self%lift)) deallocate (self%lift)
    if (allocated(self%resultant)) deallocate (self%resultant, self%resultant_size, self%is_slide)
  end subroutine coarse_destroy
end module dotyk_scheme_coarse_space
