!> How the bodies of a scene are solved: by a sparse factor of their stiffness, or by p-multigrid; and their assembly
!> for that.
!>
!> A direct factorization takes n^2 operations for n unknowns of a three-dimensional body, p-multigrid about n, but
!> for the factor of the corner space, of 1/8 of the unknowns. Where one body is solved by p-multigrid, the contact is
!> solved by displacements (`dotyk_scheme_primal`), and the other bodies join with their factors as coarse level.
module dotyk_control_response_choice
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: response_auto, response_multigrid
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_material, only: least_compressible
  use dotyk_elasticity_two_levels, only: is_linear, multigrid_obstacle, obstacle_none
  use dotyk_response_direct, only: direct_response_t
  use dotyk_response_multigrid_response, only: multigrid_response_t
  implicit none
  private

  !> How a body is solved.
  integer, parameter, public :: form_direct = 1     !< by the factor of its stiffness
  integer, parameter, public :: form_multigrid = 2  !< by p-multigrid
  integer, parameter, public :: form_whole = 3      !< by its factor, beside others that are solved by p-multigrid
  integer, parameter, public :: form_split = 4      !< by p-multigrid over all ranks

  type, public :: operator_slot_t  !! The compliance operator of a representative on the way: one of both is allocated.
    type(direct_response_t), allocatable :: direct  !! By its factor.
    type(multigrid_response_t), allocatable :: multigrid  !! By p-multigrid, or by its factor beside others that are.
  end type operator_slot_t

  public :: assemble_representative, choose_forms, keeps_factor, suits_multigrid

  !> Unknowns from which on p-multigrid is taken in three dimensions. On one thread a whole run with factors takes 0.9,
  !> 1.4, 1.7 and 1.9 times as long with 18,000, 42,000, 69,000 and 87,000 unknowns a body (Hertzian contact), with 2.4,
  !> 3.8, 4.8 and 4.8 times the memory.
  integer, parameter :: crossover = 25000
  !> The same where factors are of more use: error bars of quantities take them, and bodies that are split over ranks
  !> take much communication.
  integer, parameter, public :: large = 100000
  !> Bulk over shear modulus up to which p-multigrid is tried: Poisson's ratio 0.49, 23 to 41 iterations, and 0.45 for
  !> linear elements.
  real(dp), parameter :: most_bulk_over_shear = 50, most_of_linear = 9.7_dp

contains

  !> Choose for all bodies.
  function choose_forms(body, classes, response, allowed, wants_factors) result(form)
    type(body_t), intent(in) :: body(:)  !! Bodies, not assembled (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes.
    integer, intent(in) :: response  !! One of `response_*` of dotyk_base_options.
    logical, intent(in) :: allowed  !! Whether the scheme of the run can do without factors.
    logical, intent(in) :: wants_factors  !! Whether factors are of more use to the run.
    integer, allocatable :: form(:)  !! One of `form_*` (n_bodies).
    logical :: is_chosen(size(body))
    integer :: b
    allocate (form(size(body)), source=form_direct)
    if (.not. allowed) return
    is_chosen = .false.
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) cycle
      if (body(b)%constraint%rigid%is_set) cycle
      if (multigrid_obstacle(body(b)) /= obstacle_none) cycle
      is_chosen(b) = response == response_multigrid
      if (response == response_auto) is_chosen(b) = body(b)%dimension == 3 .and. suits_multigrid(body(b)) .and. &
                                                    body(b)%n_unknowns() > merge(large, crossover, wants_factors)
    end do
    if (.not. any(is_chosen)) return
    form(:) = merge(form_multigrid, form_whole, is_chosen(classes%first))
    ! Rigid bodies have no stiffness.
    where ([(body(b)%constraint%rigid%is_set, b=1, size(body))]) form = form_direct
  end function choose_forms

  !> Whether a body that is large enough for p-multigrid has a factor because it is nearly incompressible.
  logical function keeps_factor(body)
    type(body_t), intent(in) :: body  !! Assembled or not.
    keeps_factor = body%dimension == 3 .and. body%n_unknowns() > large
    if (keeps_factor) keeps_factor = .not. suits_multigrid(body)
  end function keeps_factor

  !> Whether the iterations of p-multigrid do not grow much with the material.
  logical function suits_multigrid(body)
    type(body_t), intent(in) :: body  !! Assembled or not.
    suits_multigrid = body%material(least_compressible(body%material))%bulk_over_shear() < &
                      merge(most_of_linear, most_bulk_over_shear, is_linear(body%mesh))
  end function suits_multigrid

  !> Assemble a representative: its stiffness, or the two levels of its p-multigrid.
  subroutine assemble_representative(body, form, modes, stiffness, slot, error)
    type(body_t), intent(inout) :: body  !! The body.
    integer, intent(in) :: form  !! One of `form_*`.
    type(body_modes_t), intent(inout) :: modes  !! Rigid body modes that its supports leave.
    type(stiffness_t), intent(inout) :: stiffness  !! Its stiffness matrix; empty with p-multigrid.
    type(operator_slot_t), intent(inout) :: slot  !! Its compliance operator to come.
    !> Allocated where an element is inverted, the modulus field is not positive, or the elements do not conform.
    type(error_t), allocatable, intent(out) :: error
    select case (form)
    case (form_direct)
      allocate (slot%direct)
      call body%assemble(stiffness, error)
    case (form_whole)
      allocate (slot%multigrid)
      call body%assemble(stiffness, error)
    case default
      allocate (slot%multigrid)
      call slot%multigrid%assemble(body, error)
      if (.not. allocated(error)) call body%assemble_loads(error)
    end select
    call modes%find(body)
  end subroutine assemble_representative
end module dotyk_control_response_choice
