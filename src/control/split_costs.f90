!> What factors of bodies that are split over ranks would cost: when iterations of conjugate gradients are given up for
!> them. No rank has the graph of a whole body: nodes and boundary nodes are counted.
!>
!> The separators of nested dissection are cross sections. For n nodes, s of them on the boundary, they have about
!> n/sqrt(s) nodes whatever the shape: n^(2/3) of cubes, sqrt(n t) of plates of t layers.
module dotyk_control_split_costs
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  use dotyk_ranks_communication, only: n_local_ranks, n_ranks
  use dotyk_ranks_exchange, only: on_any_rank
  implicit none
  private
  public :: compactness, factors_fit, iterations_worth_factors

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
end module dotyk_control_split_costs
