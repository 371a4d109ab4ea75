!> The solution without contact, u_0: one solve of every body that has loads or prescribed displacements. Every scheme
!> starts from it, and for bodies that touch no other it is the solution.
!>
!> A floating body does not move by its rigid body modes in u_0: loads are taken without their resultants on these
!> modes, which are the schemes' to balance.
module dotyk_control_contact_free
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_contact_problem, only: isolated_body_t
  use dotyk_control_parallel, only: largest_first, set_blas_threads
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: add_up, item_t, on_any_rank, share
  use dotyk_response_response, only: equation_vector_t, response_slot_t, response_t
  implicit none
  private
  public :: solve_without_contact

  type, public :: contact_free_t  !! What the QP is made of.
    real(dp), allocatable :: initial_penetration(:)  !! y_0 = B u_0 - d (n_rows) [length].
    real(dp), allocatable :: load_displacement(:)  !! B K^+ f, with supports at rest (n_rows) [length].
    real(dp) :: energy = 0  !! F(u_0) = A(u_0,u_0)/2 - L(u_0) [energy].
    real(dp) :: norm_square = 0  !! A(u_0,u_0) [energy].
    integer :: n_solves = 0  !! Solves that it took.
    !> Of bodies that are solved iteratively: u_0, loads, and the forces that the solve has left (n_bodies).
    type(equation_vector_t), allocatable :: u_0(:), load(:), left(:)
    logical :: is_rough = .false.  !! Whether u_0 of a body is a rough solution.
  end type contact_free_t

  type :: contribution_t  !! What one body adds.
    real(dp), allocatable :: u_0(:)  !! Displacements of the contact nodes without contact (dimension*n) [length].
    real(dp), allocatable :: u_load(:)  !! Those by the loads alone, with supports at rest (dimension*n) [length].
    real(dp) :: strain_energy = 0  !! A(u_0,u_0)/2 [energy].
    real(dp) :: work = 0  !! L(u_0) [energy].
    integer :: n_solves = 0  !! Solves that it took.
  end type contribution_t

contains

  !> Solve.
  subroutine solve_without_contact(body, ranks, block, gap, response, representative, side_by_side, n_blas, roughly, &
                                   solution, isolated)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    real(dp), intent(in) :: gap(:)  !! Gaps (n_rows) [length].
    type(response_slot_t), intent(in) :: response(:)  !! Compliance operators of the representatives (n_bodies).
    integer, intent(in) :: representative(:)  !! Representative of each body (n_bodies).
    logical, intent(in) :: side_by_side  !! Whether bodies are solved at the same time.
    integer, intent(in) :: n_blas  !! BLAS threads of each solve.
    !> Whether rough solutions suffice where bodies touch others: the scheme knows what they leave.
    logical, intent(in) :: roughly
    type(contact_free_t), intent(out) :: solution  !! Initial penetrations and energies of u_0.
    type(isolated_body_t), allocatable, intent(out) :: isolated(:)  !! Bodies that touch no other (n_bodies).
    type(contribution_t), allocatable :: part(:)
    real(dp), allocatable :: row_displacement(:)
    integer :: i, b, order(size(body))
    allocate (part(size(body)), isolated(size(body)), solution%u_0(size(body)), solution%load(size(body)), &
              solution%left(size(body)))
    order = largest_first(real(body%n_unknowns(), dp))
    call set_blas_threads(n_blas)
    !$omp parallel do default(none) private(b) schedule(dynamic, 1) &
    !$omp& shared(body, ranks, block, response, representative, part, isolated, order, solution, side_by_side) &
    !$omp& shared(roughly) &
    !$omp& if (side_by_side)
    do i = 1, size(body)
      b = order(i)
      if (.not. ranks%is_own(b)) cycle
      call solve_body(body(b), response(representative(b))%form, block(b)%contact_node, roughly, part(b), &
                      solution%u_0(b), solution%load(b), solution%left(b), isolated(b))
    end do
    !$omp end parallel do
    call set_blas_threads(1)
    solution%is_rough = roughly .and. any([(allocated(solution%u_0(b)%value), b=1, size(body))])
    call share_parts(ranks, part, isolated)

    solution%initial_penetration = -gap
    allocate (solution%load_displacement(size(gap)), source=0.0_dp)
    do b = 1, size(body)
      solution%energy = solution%energy + part(b)%strain_energy - part(b)%work
      solution%norm_square = solution%norm_square + 2*part(b)%strain_energy
      solution%n_solves = solution%n_solves + part(b)%n_solves
      associate (row => block(b)%row)
        if (size(row) == 0) cycle
        if (allocated(row_displacement)) deallocate (row_displacement)
        allocate (row_displacement(size(row)))
        call block(b)%matrix%multiply(part(b)%u_0, row_displacement)
        solution%initial_penetration(row) = solution%initial_penetration(row) + row_displacement
        call block(b)%matrix%multiply(part(b)%u_load, row_displacement)
        solution%load_displacement(row) = solution%load_displacement(row) + row_displacement
      end associate
    end do
  end subroutine solve_without_contact

  !> Make the parts of all bodies known to all ranks.
  subroutine share_parts(ranks, part, isolated)
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(contribution_t), intent(inout) :: part(:)  !! Those of this rank in, of all out (n_bodies).
    type(isolated_body_t), intent(inout) :: isolated(:)  !! The same (n_bodies).
    type(item_t) :: item(size(part))
    integer :: b
    if (n_ranks() == 1) return
    if (ranks%are_split()) then
      call add_up(part%strain_energy)
      call add_up(part%work)
      return
    end if
    do b = 1, size(part)
      if (.not. ranks%is_own(b)) cycle
      if (.not. allocated(part(b)%u_load)) allocate (part(b)%u_load(0))
      item(b)%value = [part(b)%strain_energy, part(b)%work, real(part(b)%n_solves, dp), part(b)%u_0, part(b)%u_load]
    end do
    call share(ranks%owner, item)
    do b = 1, size(part)
      if (ranks%is_own(b)) cycle
      associate (value => item(b)%value, n => (size(item(b)%value) - 3)/2)
        part(b)%strain_energy = value(1)
        part(b)%work = value(2)
        part(b)%n_solves = nint(value(3))
        part(b)%u_0 = value(4:3 + n)
        part(b)%u_load = value(4 + n:3 + 2*n)
      end associate
      ! Which bodies are isolated is known to all, their displacements to their ranks.
      if (size(part(b)%u_0) == 0) allocate (isolated(b)%displacement(0, 0))
    end do
  end subroutine share_parts

  !> One body without contact.
  subroutine solve_body(body, response, contact_node, roughly, part, u_0, load, left, isolated)
    type(body_t), intent(in) :: body  !! The body, assembled.
    class(response_t), intent(in) :: response  !! Compliance operator of its representative.
    integer, intent(in) :: contact_node(:)  !! Nodes of the body that may touch another (n).
    logical, intent(in) :: roughly  !! As in `solve_without_contact`.
    type(contribution_t), intent(out) :: part  !! What it adds to the solution.
    !> Gets the displacement over the equations where the body is solved iteratively and touches others.
    type(equation_vector_t), intent(inout) :: u_0
    type(equation_vector_t), intent(inout) :: load  !! Gets its loads, likewise.
    type(equation_vector_t), intent(inout) :: left  !! Gets the forces that an iterative solve has left.
    type(isolated_body_t), intent(inout) :: isolated  !! Gets the displacement of a body without contact nodes.
    real(dp), allocatable :: x(:), u(:, :)
    logical :: is_moved
    is_moved = any(abs(body%constraint%prescribed) > 0)
    x = body%rhs
    call solve_if_loaded(body, response, roughly .and. size(contact_node) > 0, x, part%n_solves)
    allocate (u(body%dimension, size(body%mesh%x, 2)))
    call body%constraint%expand(x, u, .true.)
    if (response%solve_error() > 0) then
      left%value = body%rhs
      call response%subtract_forces(x, left%value)
      if (size(contact_node) > 0) then
        u_0%value = x
        allocate (load%value(size(x)))
        call body%constraint%reduce(body%load, load%value)
      end if
    end if
    if (is_moved) then
      part%strain_energy = strain_energy(body, u)
    else
      part%strain_energy = dot_product(body%of_own_equations(x), body%rhs)/2
      if (allocated(left%value)) part%strain_energy = part%strain_energy - &
        dot_product(body%of_own_equations(x), left%value)/2
    end if
    part%work = sum(body%of_own_nodes(body%load)*u)
    part%u_0 = reshape(u(:, contact_node), [body%dimension*size(contact_node)])
    if (size(contact_node) == 0) then
      call move_alloc(u, isolated%displacement)
    else if (is_moved) then
      call body%constraint%reduce(body%load, x)
      call solve_if_loaded(body, response, roughly, x, part%n_solves)
      call body%constraint%expand(x, u, .false.)
      part%u_load = reshape(u(:, contact_node), [body%dimension*size(contact_node)])
    else
      part%u_load = part%u_0
    end if
  end subroutine solve_body

  !> A solve, unless the right-hand side is zero: most bodies of many scenes have neither loads nor prescribed
  !> displacements.
  subroutine solve_if_loaded(body, response, roughly, x, n_solves)
    type(body_t), intent(in) :: body  !! The body.
    class(response_t), intent(in) :: response  !! Compliance operator.
    logical, intent(in) :: roughly  !! Whether a rough solution suffices.
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    integer, intent(inout) :: n_solves  !! Counts.
    logical :: is_loaded
    is_loaded = any(abs(x) > 0)
    if (allocated(body%own_equation)) is_loaded = on_any_rank(is_loaded)
    if (.not. is_loaded) return
    if (roughly) then
      call response%solve_roughly(x)
    else
      call response%solve(x)
    end if
    n_solves = n_solves + 1
  end subroutine solve_if_loaded
end module dotyk_control_contact_free
