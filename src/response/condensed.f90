!> The response of a body at its contact nodes alone: the stiffness with all other unknowns eliminated.
!>
!> With the contact unknowns last in the order of elimination, the last block of the factor of K is the Cholesky factor of the condensed
!> stiffness: a response costs two solves with it, where it is, and touches nothing else. Where the body has free motions R, K is K_s, held by springs, and
!> the response is that of `K^+ = P K_s^{-1} P`, `P = I - R R^T`: with Z = K_s^{-1} R,
!> `K^+ f = K_s^{-1} f - Z (R^T f) - R (Z^T f - R^T Z R^T f)`, of which the contact unknowns are all that is needed.
module dotyk_response_condensed
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: add_product, transposed_product
  use dotyk_linalg_cholesky, only: cholesky_t
  implicit none
  private

  !> The condensed stiffness. What bodies of one kind have in common belongs to the first of them.
  type, public :: condensed_t
    !> Contact unknowns; 0 while there is no condensed stiffness.
    integer :: n = 0
    !> Place of each contact node's unknowns among the n (dimension, n_contact_nodes), 0 where prescribed.
    integer, allocatable :: place(:, :)
    !> Whether what follows is to be given back here.
    logical, private :: owns = .false.
    !> Place of each equation among the n, 0 for the others (0:n_equations).
    integer, pointer, contiguous, private :: place_of(:) => null()
    !> Free motions and what the held body answers to them as forces, at the contact unknowns (n, n_motions), and their products
    !> R^T Z (n_motions, n_motions).
    real(dp), pointer, contiguous, private :: rigid(:, :) => null(), answer(:, :) => null(), product(:, :) => null()
  contains
    procedure :: init => condensed_init
    procedure :: share => condensed_share
    procedure, private :: find_places => condensed_find_places
    procedure :: solve_block => condensed_solve_block
    procedure :: destroy => condensed_destroy
  end type condensed_t

contains

  !> Take the block of the contact unknowns out of a factor.
  subroutine condensed_init(self, factor, n, equation, rigid)
    class(condensed_t), intent(inout) :: self
    !> Of the whole stiffness, with the contact unknowns last.
    type(cholesky_t), intent(in) :: factor
    !> Number of contact unknowns, of all bodies with this factor together.
    integer, intent(in) :: n
    !> Equations of the contact nodes (dimension, n_contact_nodes); 0 where prescribed.
    integer, intent(in) :: equation(:, :)
    !> Free motions over all equations (n_equations, n_motions).
    real(dp), intent(in) :: rigid(:, :)
    integer, allocatable :: number(:)
    real(dp), allocatable :: z(:, :)
    integer :: k, m
    call self%destroy()
    self%n = n
    self%owns = .true.
    m = size(rigid, 2)
    allocate (number(n), self%place_of(0:size(rigid, 1)), self%rigid(n, m), self%answer(n, m), self%product(m, m))
    call factor%trailing(number)
    self%place_of = 0
    self%place_of(number) = [(k, k=1, n)]
    allocate (z, source=rigid)
    call factor%solve_block(z)
    call transposed_product(rigid, z, self%product)
    self%rigid = rigid(number, :)
    self%answer = z(number, :)
    call self%find_places(equation)
  end subroutine condensed_init

  !> The same for another body of the kind.
  subroutine condensed_share(self, first, equation)
    class(condensed_t), intent(inout) :: self
    !> It stays what it is as long as this one is used.
    type(condensed_t), intent(in) :: first
    !> Equations of this body's contact nodes (dimension, n_contact_nodes); 0 where prescribed.
    integer, intent(in) :: equation(:, :)
    call self%destroy()
    self%n = first%n
    self%place_of => first%place_of
    self%rigid => first%rigid
    self%answer => first%answer
    self%product => first%product
    call self%find_places(equation)
  end subroutine condensed_share

  !> Places of the contact nodes' unknowns.
  subroutine condensed_find_places(self, equation)
    class(condensed_t), intent(inout) :: self
    integer, intent(in) :: equation(:, :)
    integer :: i
    allocate (self%place(size(equation, 1), size(equation, 2)))
    do i = 1, size(equation, 2)
      self%place(:, i) = self%place_of(equation(:, i))
    end do
  end subroutine condensed_find_places

  !> Forces on the contact unknowns to their displacements.
  subroutine condensed_solve_block(self, factor, x)
    class(condensed_t), intent(in) :: self
    !> The same as before.
    type(cholesky_t), intent(in) :: factor
    !> (n,m)
    real(dp), intent(inout), contiguous :: x(:, :)
    real(dp), allocatable :: resultant(:, :), motion(:, :)
    if (size(self%rigid, 2) == 0) then
      call factor%solve_trailing(x)
      return
    end if
    allocate (resultant(size(self%rigid, 2), size(x, 2)), motion(size(self%rigid, 2), size(x, 2)))
    call transposed_product(self%rigid, x, resultant)
    call transposed_product(self%answer, x, motion)
    call add_product(-1.0_dp, self%product, resultant, motion)
    call factor%solve_trailing(x)
    call add_product(-1.0_dp, self%answer, resultant, x)
    call add_product(-1.0_dp, self%rigid, motion, x)
  end subroutine condensed_solve_block

  !> Give back all memory.
  subroutine condensed_destroy(self)
    class(condensed_t), intent(inout) :: self
    if (allocated(self%place)) deallocate (self%place)
    if (self%owns) deallocate (self%place_of, self%rigid, self%answer, self%product)
    nullify (self%place_of, self%rigid, self%answer, self%product)
    self%owns = .false.
    self%n = 0
  end subroutine condensed_destroy
end module dotyk_response_condensed
