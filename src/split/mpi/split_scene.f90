!> Bodies that all ranks compute together, as a run sees them.
module dotyk_split_split_scene
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_interrupt, only: watch_interrupts
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_distributed_petsc, only: start_petsc, stop_petsc
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_material, only: weight_moduli
  use dotyk_elasticity_stress_energy, only: stresses_and_energy
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: add_up, agree_on_error
  use dotyk_response_response, only: response_slot_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_split_split_bodies, only: split_bodies_t
  use dotyk_split_split_primal, only: split_primal_t
  use dotyk_split_split_response, only: split_response_t
  implicit none
  private
  public :: can_split

  type, public :: split_scene_t  !! The bodies of a scene.
    !> They; one place for all copies, because others refer to it.
    type(split_bodies_t), pointer, private :: bodies => null()
  contains
    procedure :: assemble => scene_assemble
    procedure :: factorize => scene_factorize
    procedure :: take_responses => scene_take_responses
    procedure :: take_scheme => scene_take_scheme
    procedure :: destroy => scene_destroy
  end type split_scene_t

contains

  !> Whether there are several ranks, and what splits bodies.
  logical function can_split()
    can_split = n_ranks() > 1
  end function can_split

  !> Assemble the parts of all bodies.
  subroutine scene_assemble(self, body, modes, error)
    class(split_scene_t), intent(inout) :: self
    !> Parts of bodies with supports and loads; get the mean modulus of the bodies (n_bodies).
    type(body_t), intent(inout) :: body(:)
    type(body_modes_t), intent(in) :: modes(:)  !! Their rigid body modes (n_bodies).
    !> Allocated where elements do not conform, or are inverted, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    call start_petsc(error)
    if (allocated(error)) return
    ! PETSc has taken the signals.
    call watch_interrupts()
    call set_mean_modulus(body, error)
    if (allocated(error)) return
    allocate (self%bodies)
    call self%bodies%assemble(body, modes, error)
  end subroutine scene_assemble

  !> Means of the modulus fields over the volumes of bodies.
  subroutine set_mean_modulus(body, error)
    !> Parts of bodies; those with a modulus field or several materials get the mean (n_bodies).
    type(body_t), intent(inout) :: body(:)
    !> Allocated where a field is not positive, or an element is inverted.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :), stress(:, :), factor(:), volume(:)
    real(dp) :: energy, sums(2)
    integer :: b, first, k, last
    do b = 1, size(body)
      if (size(body(b)%material) == 1 .and. .not. body(b)%material(1)%has_modulus_field()) cycle
      associate (mesh => body(b)%mesh)
        allocate (u(body(b)%dimension, mesh%n_nodes()), source=0.0_dp)
        allocate (stress(6, mesh%n_elements()), factor(mesh%n_elements()), volume(mesh%n_elements()))
        call stresses_and_energy(mesh, body(b)%analysis, body(b)%material, u, stress, energy, error, factor, volume)
        call agree_on_error(error)
        call add_context(error, 'body '//quoted(body(b)%name)//': ')
        if (allocated(error)) return
        last = 0
        do k = 1, size(mesh%block)
          first = last + 1
          last = last + size(mesh%block(k)%tag)
          call weight_moduli(body(b)%material, mesh%block(k)%material, factor(first:last))
        end do
        sums = [sum(factor*volume, mask=mesh%whole%own_element), sum(volume, mask=mesh%whole%own_element)]
      end associate
      call add_up(sums)
      body(b)%mean_modulus_factor = sums(1)/sums(2)
      deallocate (u, stress, factor, volume)
    end do
  end subroutine set_mean_modulus

  !> Make ready for solves.
  subroutine scene_factorize(self, body, operator, report, error)
    class(split_scene_t), intent(in) :: self
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_operator_t), intent(in) :: operator  !! Contact rows, the same on all ranks.
    !> Gets the diagonals of the stiffnesses (n_bodies).
    type(factorization_report_t), allocatable, intent(out) :: report(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer :: b
    allocate (report(size(body)))
    call self%bodies%factorize(operator, error)
    if (allocated(error)) return
    do b = 1, size(body)
      call self%bodies%diagonal(b, report(b)%diagonal)
      allocate (report(b)%fixing_equation(0), report(b)%spring(0))
    end do
  end subroutine scene_factorize

  !> Compliance operators.
  subroutine scene_take_responses(self, body, modes, response)
    class(split_scene_t), intent(in) :: self
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_modes_t), intent(in) :: modes(:)  !! Their rigid body modes (n_bodies).
    type(response_slot_t), intent(inout) :: response(:)  !! Get the operators (n_bodies).
    type(split_response_t), allocatable :: form
    integer :: b, k
    do b = 1, size(body)
      allocate (form)
      form%bodies => self%bodies
      form%b = b
      allocate (form%mode(body(b)%constraint%n_equations, modes(b)%n))
      do k = 1, modes(b)%n
        call body(b)%constraint%reduce(modes(b)%shape(:, :, k), form%mode(:, k))
      end do
      call move_alloc(form, response(b)%form)
    end do
  end subroutine scene_take_responses

  !> The scheme.
  subroutine scene_take_scheme(self, most_iterations, scheme)
    class(split_scene_t), intent(in) :: self
    integer, intent(in) :: most_iterations  !! Iterations of conjugate gradients after which it ends without a solution.
    class(scheme_t), allocatable, intent(inout) :: scheme  !! Replaced.
    if (allocated(scheme)) deallocate (scheme)
    allocate (split_primal_t :: scheme)
    select type (scheme)
    type is (split_primal_t)
      scheme%bodies => self%bodies
      scheme%bodies%system%most_iterations = most_iterations
    end select
  end subroutine scene_take_scheme

  !> Give back all memory.
  subroutine scene_destroy(self)
    class(split_scene_t), intent(inout) :: self
    if (.not. associated(self%bodies)) return
    call self%bodies%destroy()
    deallocate (self%bodies)
    call stop_petsc()
  end subroutine scene_destroy
end module dotyk_split_split_scene
