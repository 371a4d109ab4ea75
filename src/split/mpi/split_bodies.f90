!> Bodies that all ranks compute together: their distributed stiffness and contact, and the exchange of displacements
!> and forces between the equations of the part that each rank holds and the own unknowns of each rank.
module dotyk_split_split_bodies
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_distributed_system, only: distributed_system_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_response_multigrid_response, only: accuracy
  use dotyk_response_response, only: equation_vector_t
  use dotyk_scheme_proximal_system, only: solve_outcome_t
  implicit none
  private

  type :: equation_map_t  !! Where the equations of the part of one body are.
    integer, allocatable :: equation(:)  !! Those that this rank computes (n_own).
    integer, allocatable :: place(:)  !! Their places among the own unknowns of all bodies (n_own).
    integer, allocatable :: entry(:)  !! Entry of each equation in distributed vectors, from 0 (n_equations).
  end type equation_map_t

  !> The bodies of a scene. PETSc has addresses of components: it is never copied or moved.
  type, public :: split_bodies_t
    type(distributed_stiffness_t) :: stiffness  !! Stiffness of all bodies.
    type(distributed_system_t) :: system  !! The linear systems of their contact.
    type(equation_map_t), allocatable :: map(:)  !! Equations of the bodies (n_bodies).
    real(dp) :: worst = 0  !! Greatest relative residual that a solve has left so far [].
    integer :: steps_of_free = 0  !! Iterations that the displacements by the loads took; 0 before.
    !> Displacements of all bodies by their loads, without contact, along the axes of the own nodes (n) [length].
    real(dp), allocatable, private :: free(:)
  contains
    procedure :: assemble => bodies_assemble
    procedure :: factorize => bodies_factorize
    procedure :: solve => bodies_solve
    procedure :: solve_all => bodies_solve_all
    procedure :: subtract_forces => bodies_subtract_forces
    procedure :: to_equations => bodies_to_equations
    procedure :: diagonal => bodies_diagonal
    procedure :: solve_error => bodies_solve_error
    procedure :: destroy => bodies_destroy
  end type split_bodies_t

  integer, parameter :: most_steps = 300  !! Iterations of a solve at most.

contains

  !> Assemble the parts.
  subroutine bodies_assemble(self, body, modes, error)
    class(split_bodies_t), target, intent(inout) :: self
    !> The part of each body that this rank holds, with supports and loads (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(body_modes_t), intent(in) :: modes(:)  !! Their rigid body modes (n_bodies).
    !> Allocated where elements do not conform, or are inverted, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    type(part_t), allocatable :: part(:)
    integer :: b
    allocate (part(size(body)))
    do b = 1, size(body)
      call part(b)%init(b, body(b), modes(b)%shape)
    end do
    call self%stiffness%init(part, [(body(b)%mesh%n_whole_nodes(), b=1, size(body))], error)
    if (allocated(error)) return
    allocate (self%map(size(body)))
    do b = 1, size(body)
      associate (of_part => self%stiffness%part(b))
        call make_map(self%stiffness%dim, self%stiffness%first, of_part, self%map(b))
      end associate
    end do
  end subroutine bodies_assemble

  !> Where the equations of the part of a body are.
  subroutine make_map(dim, first, part, map)
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: first  !! Block row of the first own node, from 0.
    type(part_t), intent(in) :: part  !! The part, numbered.
    type(equation_map_t), intent(out) :: map  !! The map.
    integer :: i, k, n
    associate (constraint => part%constraint)
      allocate (map%entry(constraint%n_equations), map%equation(constraint%n_equations))
      n = 0
      do i = 1, size(part%row)
        do k = 1, dim
          if (constraint%equation(k, i) <= 0) cycle
          map%entry(constraint%equation(k, i)) = dim*part%row(i) + k - 1
          if (.not. part%is_own(i)) cycle
          n = n + 1
          map%equation(n) = constraint%equation(k, i)
        end do
      end do
    end associate
    map%equation = map%equation(:n)
    map%place = map%entry(map%equation) - dim*first + 1
  end subroutine make_map

  !> Make ready for solves.
  subroutine bodies_factorize(self, operator, error)
    class(split_bodies_t), target, intent(inout) :: self
    type(contact_operator_t), intent(in) :: operator  !! Contact rows, the same on all ranks.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    call self%system%init(self%stiffness, operator, error)
  end subroutine bodies_factorize

  !> x := K^+ x over the equations of one body. All ranks do it at the same time.
  !>
  !> A solve for one body costs as much as one for all: the displacements by the loads of all bodies are found at once,
  !> and most right-hand sides are these loads.
  subroutine bodies_solve(self, b, x)
    class(split_bodies_t), target, intent(inout) :: self
    integer, intent(in) :: b  !! The body.
    !> Right-hand side [force] in, solution [length] out, over the equations of the part (n_equations).
    real(dp), intent(inout) :: x(:)
    real(dp), allocatable :: r(:), e(:)
    allocate (r(self%system%n), source=0.0_dp)
    call from_equations(self, b, x, r)
    call solve_at(self, self%map(b)%place, r, e)
    call self%to_equations(b, e, x)
  end subroutine bodies_solve

  !> The same for all bodies at once.
  subroutine bodies_solve_all(self, x)
    class(split_bodies_t), target, intent(inout) :: self
    type(equation_vector_t), intent(inout) :: x(:)  !! Right-hand sides [force] in, solutions [length] out (n_bodies).
    real(dp), allocatable :: r(:), e(:)
    integer :: b, i
    allocate (r(self%system%n), source=0.0_dp)
    do b = 1, size(x)
      call from_equations(self, b, x(b)%value, r)
    end do
    call solve_at(self, [(i, i=1, size(r))], r, e)
    do b = 1, size(x)
      call self%to_equations(b, e, x(b)%value)
    end do
  end subroutine bodies_solve_all

  !> e := K^+ r, r zero but at some places.
  subroutine solve_at(self, place, r, e)
    class(split_bodies_t), target, intent(inout) :: self
    integer, intent(in) :: place(:)  !! The places among the own unknowns of all bodies.
    !> Forces; without resultants on rigid body modes on return (n) [force].
    real(dp), intent(inout), contiguous :: r(:)
    real(dp), allocatable, intent(out) :: e(:)  !! (n) [length]
    real(dp), allocatable :: left(:), known(:)
    real(dp) :: first, of_left
    allocate (e(size(r)), source=0.0_dp)
    associate (system => self%system)
      call system%remove_modes(r)
      first = system%force_norm(r)
      if (.not. first > 0) return
      call find_free(self)
      allocate (known(size(r)), left(size(r)), source=0.0_dp)
      known(place) = self%free(place)
      call system%strain_forces(known, left)
      left = r - left
      call system%remove_modes(left)
      of_left = system%force_norm(left)
      if (of_left < first) then
        if (of_left > accuracy*first) call solve_for(self, left, first, e)
        if (.not. of_left > accuracy*first) self%worst = max(self%worst, of_left/first)
        e = known + e
      else
        call solve_for(self, r, first, e)
      end if
      call system%remove_modes(e)
    end associate
  end subroutine solve_at

  !> Find the displacements of all bodies by their loads, unless they are known.
  subroutine find_free(self)
    class(split_bodies_t), target, intent(inout) :: self
    type(solve_outcome_t) :: outcome
    type(error_t), allocatable :: error
    real(dp), allocatable :: r(:)
    if (allocated(self%free)) return
    r = self%stiffness%load
    allocate (self%free(size(r)))
    call self%system%remove_modes(r)
    call self%system%solve_alone(r, accuracy, most_steps, self%free, outcome, error)
    self%steps_of_free = outcome%steps
    ! Those who use it look at what it leaves.
    if (allocated(error) .or. outcome%has_failed) self%free(:) = 0
  end subroutine find_free

  !> e := K^+ r, and note what is left.
  subroutine solve_for(self, r, norm, e)
    class(split_bodies_t), target, intent(inout) :: self
    real(dp), intent(inout), contiguous :: r(:)  !! Forces, without resultants on rigid body modes (n) [force].
    real(dp), intent(in) :: norm  !! Norm of the forces that the accuracy is a fraction of [sqrt(energy)].
    real(dp), intent(inout), contiguous :: e(:)  !! (n) [length]
    type(solve_outcome_t) :: outcome
    type(error_t), allocatable :: error
    associate (system => self%system)
      call system%solve_alone(r, min(1.0_dp, accuracy*norm/system%force_norm(r)), most_steps, e, outcome, error)
    end associate
    if (allocated(error) .or. outcome%has_failed .or. .not. norm < huge(norm)) then
      self%worst = huge(norm)
    else
      self%worst = max(self%worst, outcome%residual/norm)
    end if
  end subroutine solve_for

  !> f := f - K x over the equations of one body, without resultants on its rigid body modes.
  subroutine bodies_subtract_forces(self, b, x, f)
    class(split_bodies_t), target, intent(inout) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: x(:)  !! Displacements (n_equations) [length].
    real(dp), intent(inout) :: f(:)  !! Forces (n_equations) [force].
    real(dp), allocatable :: own_x(:), own_f(:), product(:)
    allocate (own_x(self%system%n), own_f(self%system%n), source=0.0_dp)
    call from_equations(self, b, x, own_x)
    call from_equations(self, b, f, own_f)
    allocate (product(size(own_x)))
    call self%system%strain_forces(own_x, product)
    own_f = own_f - product
    call self%system%remove_modes(own_f)
    call self%to_equations(b, own_f, f)
  end subroutine bodies_subtract_forces

  !> Diagonal of the stiffness of one body.
  subroutine bodies_diagonal(self, b, diagonal)
    class(split_bodies_t), target, intent(inout) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), allocatable, intent(out) :: diagonal(:)  !! Over the equations of the part (n_equations) [force/length].
    real(dp), allocatable :: own(:)
    call self%stiffness%diagonal(own)
    allocate (diagonal(size(self%map(b)%entry)))
    call self%to_equations(b, own, diagonal)
  end subroutine bodies_diagonal

  !> Equations of one body to own unknowns.
  subroutine from_equations(self, b, x, own)
    type(split_bodies_t), intent(in) :: self  !! The bodies.
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: x(:)  !! Over its equations (n_equations) [any].
    real(dp), intent(inout) :: own(:)  !! Of this rank; gets those of the body (n) [as x].
    own(self%map(b)%place) = x(self%map(b)%equation)
  end subroutine from_equations

  !> Equations of the part of one body from the own unknowns of all ranks.
  subroutine bodies_to_equations(self, b, own, x)
    class(split_bodies_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: own(:)  !! Of this rank (n) [any].
    !> Over the equations of the part; the same on all ranks that have one (n_equations) [as own].
    real(dp), intent(out) :: x(:)
    type(error_t), allocatable :: error
    real(dp), allocatable :: found(:)
    ! A failure ends all ranks, see `has_failed`.
    call self%stiffness%entries(own, self%map(b)%entry, found, error)
    x = found
  end subroutine bodies_to_equations

  !> Relative error of a solve in the energy norm [].
  pure real(dp) function bodies_solve_error(self) result(error)
    class(split_bodies_t), intent(in) :: self
    error = huge(error)
    if (self%worst < 1) error = max(accuracy, self%worst)/sqrt(self%system%least)
  end function bodies_solve_error

  !> Give back all memory.
  subroutine bodies_destroy(self)
    class(split_bodies_t), intent(inout) :: self
    call self%system%destroy()
    call self%stiffness%destroy()
  end subroutine bodies_destroy
end module dotyk_split_split_bodies
