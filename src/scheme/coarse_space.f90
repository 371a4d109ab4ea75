!> The coarse space of a scene: rigid motions that the supports leave to its bodies, as the contact points see them.
!>
!> With R_b the free motions of body b and B_b its columns of B, the blocks are `G_b = B_b R_b`: amplitudes `alpha` move the contact
!> points by `G alpha`, and forces `lambda` at the points have the resultants `G^T lambda` on the motions. Free bodies are in
!> equilibrium where `G^T lambda = e`, the resultants of their loads. Soft motions, which supports hardly resist, have springs S:
!> `G^T lambda + S alpha = e`. Motions are scaled so that the contact nodes of the body move by
!> 1 at most: amplitudes are lengths, resultants are forces.
module dotyk_scheme_coarse_space
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_linalg_dense, only: solve_dense, symmetric_eigen
  use dotyk_response_response, only: response_slot_t
  implicit none
  private

  !> One body's motions at its rows.
  type, public :: motion_block_t
    !> G_b (n_rows of the block, number of motions).
    real(dp), allocatable :: value(:, :)
  end type motion_block_t

  !> All motions, body after body.
  type, public :: coarse_space_t
    !> Number of motions.
    integer :: n = 0
    !> Motions of body b are first(b) .. first(b+1)-1 (n_bodies+1).
    integer, allocatable :: first(:)
    !> Resultants e of the loads (n) [force].
    real(dp), allocatable :: resultant(:)
    !> S, and what given displacements have added to e; not allocated where no motion has a spring (n, n) [force/length], (n) [force].
    real(dp), allocatable :: stiffness(:, :), lift(:)
    !> What e is made up of, without signs, for motions with springs (n) [force].
    real(dp), allocatable :: resultant_size(:)
    !> Amplitudes of the response's motions per amplitude of these (n).
    real(dp), allocatable :: scale(:)
    !> G by bodies (n_bodies).
    type(motion_block_t), allocatable :: block(:)
    !> Bodies that each row touches, and its place among their rows; 0 where there is no second one (2, n_rows).
    integer, allocatable :: body(:, :), place(:, :)
  contains
    procedure :: init => coarse_init
    procedure :: displacement => coarse_displacement
    procedure :: resultant_of => coarse_resultant_of
    procedure :: springs => coarse_springs
    procedure :: is_sprung => coarse_is_sprung
    procedure :: by_bodies => coarse_by_bodies
    procedure :: rounding => coarse_rounding
    procedure :: rows => coarse_rows
    procedure :: invert => coarse_invert
    procedure :: destroy => coarse_destroy
  end type coarse_space_t

  !> Motions along a surface move its points by this part of the motion, by rounding.
  real(dp), parameter :: rounding = 1.0e-12_dp
  !> Eigenvalues of a scaled matrix below this belong to motions that nothing holds.
  real(dp), parameter :: least_hold = 1.0e-13_dp
  !> Rounding errors of sums of forces over a body, as a part of what they are made up of: they come with all signs, so that one is as
  !> much as many.
  real(dp), parameter :: rounding_of_sums = epsilon(1.0_dp)
  !> Springs below this part of what contact resists are none.
  real(dp), parameter :: tiny_spring = 1.0e-25_dp

contains

  !> Make the coarse space.
  subroutine coarse_init(self, operator, response, resultant, lift)
    class(coarse_space_t), intent(inout) :: self
    type(contact_operator_t), intent(in) :: operator
    !> Responses, attached (n_bodies).
    type(response_slot_t), intent(in) :: response(:)
    !> Resultants of the loads on the motions of the responses, body after body [force].
    real(dp), intent(in) :: resultant(:)
    !> What given displacements have added to them; 0 where absent.
    real(dp), intent(in), allocatable, optional :: lift(:)
    real(dp) :: most
    integer :: b, i, j, k
    call self%destroy()
    allocate (self%first(size(response) + 1), self%block(size(response)))
    allocate (self%body(2, operator%n_rows), self%place(2, operator%n_rows), source=0)
    self%first(1) = 1
    do b = 1, size(response)
      self%first(b + 1) = self%first(b) + response(b)%form%n_motions
      do i = 1, size(operator%block(b)%row)
        j = operator%block(b)%row(i)
        k = merge(1, 2, self%body(1, j) == 0)
        self%body(k, j) = b
        self%place(k, j) = i
      end do
    end do
    self%n = self%first(size(response) + 1) - 1
    allocate (self%scale(self%n))
    do b = 1, size(response)
      associate (matrix => operator%block(b)%matrix, form => response(b)%form, first => self%first(b))
        allocate (self%block(b)%value(size(operator%block(b)%row), form%n_motions))
        do j = 1, form%n_motions
          self%scale(first + j - 1) = 1
          if (size(operator%block(b)%row) == 0) cycle
          ! A part of the body that has no contact nodes moves none.
          most = maxval(abs(form%motion(:, j)))
          if (most > rounding) self%scale(first + j - 1) = 1/most
          call matrix%multiply(self%scale(first + j - 1)*form%motion(:, j), self%block(b)%value(:, j))
          ! Soft motions are not quite rigid, and what they strain is as small as their springs.
          if (allocated(form%motion_stiffness)) cycle
          where (abs(self%block(b)%value(:, j)) < rounding) self%block(b)%value(:, j) = 0
        end do
      end associate
    end do
    self%resultant = self%scale*resultant
    call take_springs(self, response)
    if (.not. allocated(self%stiffness)) return
    self%lift = 0*resultant
    self%resultant_size = abs(self%resultant)
    if (.not. present(lift)) return
    if (allocated(lift)) self%lift = self%scale*lift
  end subroutine coarse_init

  !> Springs of the bodies' motions.
  subroutine take_springs(self, response)
    class(coarse_space_t), intent(inout) :: self
    type(response_slot_t), intent(in) :: response(:)
    integer :: b, j
    do b = 1, size(response)
      associate (form => response(b)%form, first => self%first(b), last => self%first(b + 1) - 1)
        if (.not. allocated(form%motion_stiffness)) cycle
        if (.not. allocated(self%stiffness)) allocate (self%stiffness(self%n, self%n), source=0.0_dp)
        do j = first, last
          self%stiffness(first:last, j) = self%scale(first:last)*form%motion_stiffness(:, j - first + 1)*self%scale(j)
        end do
      end associate
    end do
  end subroutine take_springs

  !> S alpha, 0 where there are no springs.
  pure function coarse_springs(self, alpha) result(force)
    class(coarse_space_t), intent(in) :: self
    !> Amplitudes (n) [length].
    real(dp), intent(in) :: alpha(:)
    !> (n) [force]
    real(dp) :: force(size(alpha))
    force = 0
    if (allocated(self%stiffness)) force = self%by_bodies(self%stiffness, alpha)
  end function coarse_springs

  !> A matrix that has a block for each body times amplitudes.
  pure function coarse_by_bodies(self, matrix, alpha) result(product)
    class(coarse_space_t), intent(in) :: self
    !> (n, n), 0 but for the bodies' own blocks.
    real(dp), intent(in) :: matrix(:, :)
    !> (n)
    real(dp), intent(in) :: alpha(:)
    real(dp) :: product(size(alpha))
    integer :: b, j
    do b = 1, size(self%block)
      associate (first => self%first(b), last => self%first(b + 1) - 1)
        product(first:last) = 0
        do j = first, last
          product(first:last) = product(first:last) + alpha(j)*matrix(first:last, j)
        end do
      end associate
    end do
  end function coarse_by_bodies

  !> z = G alpha.
  pure subroutine coarse_displacement(self, operator, alpha, z)
    class(coarse_space_t), intent(in) :: self
    type(contact_operator_t), intent(in) :: operator
    !> Amplitudes (n) [length].
    real(dp), intent(in) :: alpha(:)
    !> Normal displacements of the contact points (n_rows) [length].
    real(dp), intent(out) :: z(:)
    integer :: b, j
    z = 0
    do b = 1, size(self%block)
      do j = 1, size(self%block(b)%value, 2)
        associate (row => operator%block(b)%row)
          z(row) = z(row) + alpha(self%first(b) + j - 1)*self%block(b)%value(:, j)
        end associate
      end do
    end do
  end subroutine coarse_displacement

  !> e = G^T lambda.
  pure subroutine coarse_resultant_of(self, operator, lambda, e)
    class(coarse_space_t), intent(in) :: self
    type(contact_operator_t), intent(in) :: operator
    !> Forces at the contact points, weights included (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> Resultants (n) [force].
    real(dp), intent(out) :: e(:)
    integer :: b, j
    do b = 1, size(self%block)
      do j = 1, size(self%block(b)%value, 2)
        e(self%first(b) + j - 1) = sum(self%block(b)%value(:, j)*lambda(operator%block(b)%row))
      end do
    end do
  end subroutine coarse_resultant_of

  !> Energy norm of the motions that rounding errors of forces and their resultants excite against the springs alone.
  subroutine coarse_rounding(self, operator, lambda, norm)
    class(coarse_space_t), intent(in) :: self
    type(contact_operator_t), intent(in) :: operator
    !> Forces at the contact points (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> [sqrt(energy)].
    real(dp), intent(out) :: norm
    type(error_t), allocatable :: error
    real(dp), allocatable :: rest(:), inverse(:, :)
    integer :: b, i, j
    norm = 0
    if (.not. allocated(self%stiffness)) return
    do b = 1, size(self%block)
      associate (first => self%first(b), last => self%first(b + 1) - 1)
        if (last < first) cycle
        if (.not. self%stiffness(first, first) > 0) cycle
        rest = rounding_of_sums*(self%resultant_size(first:last) + &
                                 matmul(abs(lambda(operator%block(b)%row)), abs(self%block(b)%value)))
        allocate (inverse(size(rest), size(rest)), source=0.0_dp)
        do i = 1, size(rest)
          inverse(i, i) = 1
        end do
        call solve_dense(self%stiffness(first:last, first:last), inverse, error)
        if (allocated(error)) then
          norm = huge(norm)
          return
        end if
        norm = norm + sum([((rest(i)*abs(inverse(i, j))*rest(j), i=1, size(rest)), j=1, size(rest))])
        deallocate (inverse)
      end associate
    end do
    norm = sqrt(norm)
  end subroutine coarse_rounding

  !> Some rows of G as a dense matrix.
  pure subroutine coarse_rows(self, row, g)
    class(coarse_space_t), intent(in) :: self
    !> Which rows (m).
    integer, intent(in) :: row(:)
    !> G there (m, n).
    real(dp), intent(out) :: g(:, :)
    integer :: i, k, b
    g = 0
    do i = 1, size(row)
      do k = 1, 2
        b = self%body(k, row(i))
        if (b == 0) cycle
        g(i, self%first(b):self%first(b + 1) - 1) = self%block(b)%value(self%place(k, row(i)), :)
      end do
    end do
  end subroutine coarse_rows

  !> Pseudo-inverse of a matrix that says how the motions are held, and its null space: what is not held.
  subroutine coarse_invert(self, matrix, inverse, null_mode, error)
    class(coarse_space_t), intent(in) :: self
    !> Symmetric, not negative (n, n).
    real(dp), intent(in) :: matrix(:, :)
    real(dp), allocatable, intent(out) :: inverse(:, :)
    !> As columns, the largest amplitude of each is 1 (n, number of them).
    real(dp), allocatable, intent(out) :: null_mode(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: scaled(:, :), scale(:), values(:), vectors(:, :), part(:, :)
    real(dp) :: most
    logical :: is_held(self%n)
    integer :: i, b, n_null
    if (all_sprung(self)) then
      ! Elimination keeps motions apart that have nothing to do with each other, however different their springs.
      allocate (inverse(self%n, self%n), null_mode(self%n, 0))
      inverse = 0
      do i = 1, self%n
        inverse(i, i) = 1
      end do
      call solve_dense(matrix, inverse, error)
      return
    end if
    allocate (scale(self%n), values(self%n), vectors(self%n, self%n), scaled(self%n, self%n))
    ! All motions of a body are measured by the one that is held best: they move it by the same lengths.
    scale = 1
    do b = 1, size(self%first) - 1
      associate (first => self%first(b), last => self%first(b + 1) - 1)
        most = maxval([0.0_dp, (matrix(i, i), i=first, last)])
        if (most > 0) scale(first:last) = 1/sqrt(most)
      end associate
    end do
    do i = 1, self%n
      scaled(:, i) = scale*matrix(:, i)*scale(i)
    end do
    call symmetric_eigen(scaled, values, vectors, error)
    if (allocated(error)) return
    is_held = values > least_hold
    call count_springs(self, scale, vectors, is_held, values)
    n_null = count(.not. is_held)
    associate (held => pack([(i, i=1, self%n)], is_held))
      part = vectors(:, held)
      do i = 1, size(held)
        part(:, i) = part(:, i)/values(held(i))
      end do
      inverse = matmul(part, transpose(vectors(:, held)))
    end associate
    do i = 1, self%n
      inverse(:, i) = scale*inverse(:, i)*scale(i)
    end do
    null_mode = vectors(:, pack([(i, i=1, self%n)], .not. is_held))
    do i = 1, n_null
      null_mode(:, i) = scale*null_mode(:, i)
      null_mode(:, i) = null_mode(:, i)/maxval(abs(null_mode(:, i)))
    end do
  end subroutine coarse_invert

  !> Whether every motion has a spring.
  pure logical function all_sprung(self)
    class(coarse_space_t), intent(in) :: self
    integer :: b
    all_sprung = allocated(self%stiffness)
    if (all_sprung) all_sprung = all([(self%is_sprung(b), b=1, size(self%block))])
  end function all_sprung

  !> Whether every motion of a body has a spring.
  pure logical function coarse_is_sprung(self, b) result(is_sprung)
    class(coarse_space_t), intent(in) :: self
    !> The body.
    integer, intent(in) :: b
    integer :: i
    is_sprung = allocated(self%stiffness)
    if (is_sprung) is_sprung = all([(self%stiffness(i, i) > 0, i=self%first(b), self%first(b + 1) - 1)])
  end function coarse_is_sprung

  !> Motions with springs are held, however soft these are; a matrix that has them is no softer than they are.
  subroutine count_springs(self, scale, vectors, is_held, values)
    class(coarse_space_t), intent(in) :: self
    !> Of the matrix (n).
    real(dp), intent(in) :: scale(:)
    !> Eigenvectors of the scaled matrix (n, n).
    real(dp), intent(in) :: vectors(:, :)
    logical, intent(inout) :: is_held(:)
    !> Its eigenvalues (n).
    real(dp), intent(inout) :: values(:)
    real(dp) :: spring
    integer :: i
    if (.not. allocated(self%stiffness)) return
    do i = 1, self%n
      spring = dot_product(scale*vectors(:, i), self%springs(scale*vectors(:, i)))
      ! What rounding mixes of other motions into a free one is no spring.
      if (.not. spring > tiny_spring) cycle
      values(i) = max(values(i), spring)
      is_held(i) = .true.
    end do
  end subroutine count_springs

  !> Give all memory back.
  subroutine coarse_destroy(self)
    class(coarse_space_t), intent(inout) :: self
    self%n = 0
    if (allocated(self%first)) deallocate (self%first, self%block, self%body, self%place)
    if (allocated(self%scale)) deallocate (self%scale)
    if (allocated(self%stiffness)) deallocate (self%stiffness, self%lift, self%resultant_size)
    if (allocated(self%resultant)) deallocate (self%resultant)
  end subroutine coarse_destroy
end module dotyk_scheme_coarse_space
