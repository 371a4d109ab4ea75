!> How the bodies of a scene are solved: by a sparse factor of their stiffness, or by p-multigrid; and their assembly
!> for that.
!>
!> A direct factorization takes n^2 operations for n unknowns of a three-dimensional body, p-multigrid about n, but
!> for the factor of the corner space, of 1/8 of the unknowns. Where one body is solved by p-multigrid, the contact is
!> solved by displacements (`dotyk_scheme_primal`), and the other bodies join with their factors as coarse level.
!>
!> Costs of factors of bodies that are split over ranks say when conjugate gradients are given up for them. No rank has
!> the graph of a whole body: nodes and boundary nodes are counted. The separators of nested dissection are cross
!> sections. For n nodes, s of them on the boundary, they have about n/sqrt(s) nodes whatever the shape: n^(2/3) of
!> cubes, sqrt(n t) of plates of t layers.
module dotyk_control_response_choice
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_base_options, only: response_auto, response_multigrid
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_material, only: least_compressible
  use dotyk_elasticity_two_levels, only: is_linear, multigrid_obstacle, obstacle_none
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  use dotyk_ranks_communication, only: n_local_ranks, n_ranks
  use dotyk_ranks_exchange, only: on_any_rank
  use dotyk_response_direct, only: direct_response_t
  use dotyk_response_multigrid_response, only: multigrid_response_t
  implicit none
  private
  public :: assemble_representative, choose_forms, keeps_factor, suits_multigrid, compactness, factors_fit, &
    iterations_worth_factors

  !> How a body is solved.
  integer, parameter, public :: form_direct = 1     !< by the factor of its stiffness
  integer, parameter, public :: form_multigrid = 2  !< by p-multigrid
  integer, parameter, public :: form_whole = 3      !< by its factor, beside others that are solved by p-multigrid
  integer, parameter, public :: form_split = 4      !< by p-multigrid over all ranks

  type, public :: operator_slot_t  !! The compliance operator of a representative on the way: one of both is allocated.
    type(direct_response_t), allocatable :: direct  !! By its factor.
    type(multigrid_response_t), allocatable :: multigrid  !! By p-multigrid, or by its factor beside others that are.
  end type operator_slot_t

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
  !> Iterations of a contact problem over those of the solution without contact.
  integer, parameter, public :: iterations_per_step = 5
  !> Iterations in five times the time of a factor, over the unknowns of a cube: its operations are 14 to 19 times the
  !> square of the unknowns of balls and blocks of 76,000 to 230,000 unknowns, a fifth of that of a plate of four
  !> layers, as the compactness tells, and 20,000 of them per unknown take the time of an iteration with its set-ups.
  !> The estimate is rough, and the work is lost.
  real(dp), parameter :: iterations_per_unknown = 3.5e-3_dp
  integer, parameter :: always_allowed = 300  !! Iterations that are no reason for factors.
  !> Stiffness of quadratic elements with the graph of its nodes, over the unknowns n; factor of a cube, 22 entries of 8
  !> bytes over n^(4/3) [bytes].
  real(dp), parameter, public :: bytes_of_unknown = 1000
  real(dp), parameter :: bytes_of_power = 176

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

  !> Nodes of a separator over those of a cube with as many nodes, 1 at most.
  elemental real(dp) function compactness(n_nodes, n_boundary_nodes)
    integer, intent(in) :: n_nodes  !! Nodes of the body.
    integer, intent(in) :: n_boundary_nodes  !! Those on its boundary.
    compactness = min(1.0_dp, sqrt(6*real(n_nodes, dp)**(2.0_dp/3)/max(1, n_boundary_nodes)))
  end function compactness

  !> Of each body.
  function compactness_of(body) result(compact)
    type(body_t), intent(in) :: body(:)  !! Wholly or in parts (n_bodies).
    real(dp) :: compact(size(body))  !! (n_bodies)
    type(surface_t) :: boundary
    integer, allocatable :: node(:)
    integer :: b
    do b = 1, size(body)
      call extract_boundary(body(b)%mesh, boundary)
      call surface_nodes(boundary, node)
      compact(b) = compactness(body(b)%mesh%n_whole_nodes(), size(node))
    end do
  end function compactness_of

  !> Iterations of conjugate gradients that take far longer than to factorize each body on one rank; the same on all.
  integer function iterations_worth_factors(body) result(n)
    type(body_t), intent(in) :: body(:)  !! Bodies in parts (n_bodies).
    real(dp) :: square(size(body)), of_rank
    square = real(body%n_unknowns(), dp)**2*compactness_of(body)**3
    of_rank = max(1.0_dp, sum(real(body%n_unknowns(), dp))/n_ranks())
    n = max(always_allowed, int(min(real(huge(1), dp)/2, iterations_per_unknown* &
                                    max(maxval(square), sum(square)/n_ranks())/of_rank)))
  end function iterations_worth_factors

  !> Whether the memory suffices for factors, each on one rank; the same on all ranks, which call it together.
  logical function factors_fit(body) result(fit)
    type(body_t), intent(in) :: body(:)  !! Bodies in parts (n_bodies).
    type(memory_t) :: memory
    real(dp) :: bytes(size(body))
    bytes = bytes_of_unknown*body%n_unknowns() + &
      bytes_of_power*real(body%n_unknowns(), dp)**(4.0_dp/3)*compactness_of(body)
    memory = memory_now()
    ! The ranks of a node share its memory.
    fit = .not. on_any_rank(memory%is_known .and. &
                            max(maxval(bytes), sum(bytes)*n_local_ranks()/n_ranks()) > memory%left)
  end function factors_fit
end module dotyk_control_response_choice
