!> The contact of the bodies in their corner spaces: where the proximal active set begins.
!>
!> The dual scheme solves it on the compliances of the rows in the corner spaces. Rows at nodes that are no corners
!> depend on those of the corners there: a penalty parameter of a fraction of the compliance of each row keeps the
!> pressures smooth.
module dotyk_scheme_corner_contact
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, sp
  use dotyk_scheme_body_grids, only: body_grids_t
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_grid_body, only: body_vector_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_restriction, only: index_list_t, merge_bodies, restrict_qp
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private
  public :: solve_corner_contact

  !> Penalty parameter as a fraction of the compliance of a row, at least.
  real(dp), parameter :: least_softness = 0.03_dp
  !> Relative error: no smaller one is worth its time, as the corner space is stiffer than the bodies by some percent.
  real(dp), parameter :: tolerance = 1.0e-3_dp

contains

  !> Solve; zero pressures of contact rows where there is no solution.
  subroutine solve_corner_contact(system, qp, gap, load, pressure, u)
    !> The bodies and rows. Its compliances are lent to the dual scheme meanwhile.
    class(body_grids_t), intent(inout) :: system
    type(contact_qp_t), intent(in) :: qp  !! The rows and the rigid body modes.
    !> d, less the displacement of the rows by prescribed displacements (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Loads and forces of prescribed displacements, over the unknowns of the system (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    real(dp), intent(out) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(out), contiguous :: u(:)  !! Displacements (n) [length].
    type(contact_qp_t) :: corner_qp
    type(dense_compliance_t) :: compliance
    type(dual_t) :: scheme
    type(solver_settings_t) :: settings
    type(monitor_t) :: monitor
    type(solver_state_t) :: state
    type(error_t), allocatable :: error
    real(dp), allocatable :: y(:), alpha(:), lambda(:)
    pressure = 0
    u = 0
    if (allocated(system%obstacle)) return
    allocate (alpha(system%first_mode(size(system%first_mode))), source=0.0_dp)
    ! Ties are springs between both sides, less the gap.
    lambda = -system%tie_stiffness()*gap
    if (any(.not. system%is_tied)) then
      allocate (y(size(pressure)))
      call corner_displacement(system, load, lambda, y)
      call make_corner_qp(system, qp, y - gap - qp%initial_penetration, corner_qp)
      settings%tolerance = tolerance
      call corner_qp%replace_theta(pack(max(qp%theta, least_softness*qp%weight*system%row_compliance()), &
                                        .not. system%is_tied))
      call lend(system, corner_qp, compliance)
      call scheme%solve(corner_qp, compliance, settings, monitor, state, error)
      call take_back(system, compliance)
      if (.not. allocated(error) .and. allocated(state%pressure)) then
        pressure(:) = unpack(state%pressure, .not. system%is_tied, pressure)
        if (size(state%alpha) == corner_qp%coarse%n) call take_amplitudes(system, state%alpha, alpha)
      end if
    end if
    call corner_solution(system, load, qp%weight*pressure + lambda, alpha, u)
    if (.not. any(system%is_tied)) return
    if (.not. allocated(y)) allocate (y(size(pressure)))
    call system%row_displacement(u, y)
    where (system%is_tied) pressure = system%tie_stiffness()*(y - gap)/qp%weight
  end subroutine solve_corner_contact

  !> The contact of groups of tied bodies, of which each is one body.
  subroutine make_corner_qp(system, qp, shift, corner_qp)
    class(body_grids_t), intent(in) :: system  !! The bodies.
    type(contact_qp_t), intent(in) :: qp  !! Rows of contact and ties.
    real(dp), intent(in) :: shift(:)  !! Added to the initial penetration (n_rows) [length].
    type(contact_qp_t), intent(out) :: corner_qp  !! Contact rows.
    type(contact_qp_t) :: contact
    type(index_list_t) :: row(size(system%group))
    type(mode_block_t) :: mode(size(system%group)), resultant(size(system%group))
    integer, allocatable :: number(:)
    integer :: g, i
    if (any(system%is_tied)) then
      call restrict_qp(qp, .not. system%is_tied, contact)
      allocate (number(qp%n_rows), source=0)
      number = unpack([(i, i=1, contact%n_rows)], .not. system%is_tied, number)
      do g = 1, size(system%group)
        row(g)%value = number(system%group(g)%row)
        mode(g)%value = system%group(g)%row_mode
        resultant(g)%value = reshape(system%group(g)%to_modes(qp%coarse%resultant/qp%coarse%scale), &
                                     [system%group(g)%n_modes, 1])
      end do
      call merge_bodies(contact, row, mode, resultant, corner_qp)
    else
      corner_qp = qp
    end if
    ! The compliances are those of these rows, and of no others.
    corner_qp%parent_row = [(i, i=1, corner_qp%n_rows)]
    call corner_qp%shift_penetration(pack(shift, .not. system%is_tied))
  end subroutine make_corner_qp

  !> Amplitudes of the rigid body modes of all bodies from those of the groups.
  subroutine take_amplitudes(system, of_groups, alpha)
    class(body_grids_t), intent(in) :: system  !! The bodies.
    real(dp), intent(in) :: of_groups(:)  !! (n_motions) [length]
    real(dp), intent(inout) :: alpha(:)  !! (n_modes) [length]
    integer :: g, n
    n = 0
    do g = 1, size(system%group)
      call system%group(g)%from_modes(of_groups(n + 1:n + system%group(g)%n_modes), alpha)
      n = n + system%group(g)%n_modes
    end do
  end subroutine take_amplitudes

  !> Give the compliances of the rows in the corner space away, without a copy.
  subroutine lend(system, qp, compliance)
    class(body_grids_t), intent(inout) :: system  !! The bodies; without compliances on return.
    type(contact_qp_t), intent(in) :: qp  !! The rows, by groups.
    type(dense_compliance_t), intent(out) :: compliance  !! Gets the compliances.
    integer :: g, i
    call compliance%begin(qp)
    do g = 1, size(system%group)
      associate (own => compliance%of_body(g), owner => system%group(g)%owner)
        own%n = size(qp%block(g)%row)
        own%row = qp%block(g)%row
        own%place = [(i, i=1, own%n)]
        own%number = own%place
        if (owner == g) then
          call move_alloc(system%group(g)%compliance, own%value)
        else
          own%same_as = owner
          deallocate (own%value)
        end if
      end associate
    end do
  end subroutine lend

  !> Take the compliances back.
  subroutine take_back(system, compliance)
    class(body_grids_t), intent(inout) :: system  !! The bodies.
    type(dense_compliance_t), intent(inout) :: compliance  !! With the compliances; without them on return.
    integer :: g
    do g = 1, size(system%group)
      if (system%group(g)%owner == g) call move_alloc(compliance%of_body(g)%value, system%group(g)%compliance)
    end do
  end subroutine take_back

  !> B P K_c^+ P^T (f - B^T lambda): the rows by loads and forces of ties, in the corner space, without contact.
  subroutine corner_displacement(self, f, lambda, y)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Loads (n) [force].
    real(dp), intent(in) :: lambda(:)  !! Forces of ties (n_rows) [force].
    real(dp), intent(out) :: y(:)  !! At the rows (n_rows) [length].
    type(body_vector_t), allocatable :: coarse(:), own(:)
    integer :: b
    call solve_corners(self, f, lambda, coarse)
    allocate (own(size(self%body)))
    do b = 1, size(self%body)
      allocate (own(b)%value(size(self%body(b)%row)))
      call self%body(b)%rows%corner%multiply(coarse(b)%value, own(b)%value)
    end do
    call self%add_rows(own, y)
  end subroutine corner_displacement

  !> Displacements by loads and contact forces in the corner space, P K_c^+ P^T (f - B^T lambda) + R alpha.
  subroutine corner_solution(self, f, lambda, alpha, u)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Loads (n) [force].
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(in) :: alpha(:)  !! Amplitudes of the rigid body modes (n_modes) [length].
    real(dp), intent(out), contiguous :: u(:)  !! Displacements (n) [length].
    type(body_vector_t), allocatable :: coarse(:)
    integer :: b
    call solve_corners(self, f, lambda, coarse)
    do b = 1, size(self%body)
      associate (grid => self%grid(self%body(b)%representative)%p)
        call grid%interpolation%prolong(grid%constraint, coarse(b)%value, u(self%first(b) + 1:self%first(b + 1)))
      end associate
    end do
    call self%add_modes(alpha, u)
  end subroutine corner_solution

  !> K_c^+ P^T (f - B^T lambda).
  subroutine solve_corners(self, f, lambda, coarse)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Loads (n) [force].
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    type(body_vector_t), allocatable, intent(out) :: coarse(:)  !! Displacements of the corners (n_bodies) [length].
    integer :: k
    allocate (coarse(size(self%body)))
    do k = 1, self%solves%n_alone
      call solve_group(self%solves%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%solves%n_alone < self%solves%n)
    do k = self%solves%n_alone + 1, self%solves%n
      call solve_group(self%solves%body(k))
    end do
    !$omp end parallel do

  contains

    !> One group of bodies.
    subroutine solve_group(g)
      integer, intent(in) :: g  !! The group.
      real(dp), allocatable :: pushed(:)
      real(dp) :: size_of_f
      integer :: i
      do i = 1, size(self%group(g)%body)
        associate (b => self%group(g)%body(i))
          associate (first => self%first(b) + 1, last => self%first(b + 1), &
                     grid => self%grid(self%body(b)%representative)%p, own => self%body(b))
            size_of_f = max(maxval(abs(f(first:last))), tiny(size_of_f))
            allocate (coarse(b)%value(grid%interpolation%n), pushed(grid%interpolation%n))
            call grid%interpolation%restrict(grid%constraint, size_of_f, &
                                             real(f(first:last)/size_of_f, sp), coarse(b)%value)
            call own%rows%corner%multiply_transposed(lambda(own%row), pushed)
            coarse(b)%value = coarse(b)%value - pushed
            deallocate (pushed)
          end associate
        end associate
      end do
      call self%solve_group(g, coarse)
    end subroutine solve_group
  end subroutine solve_corners
end module dotyk_scheme_corner_contact
