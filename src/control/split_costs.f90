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
  !> Operations and entries of a factor of n unknowns, over n^2 and n^(4/3), for cubes: 14 to 19, and 22, of balls and
  !> blocks of 76,000 to 230,000 unknowns; a fifth, and half, of a plate of four layers, as the compactness tells.
  real(dp), parameter :: flops_per_square = 14, entries_per_power = 22
  !> Operations of a factorization in the time of an iteration, set-ups included, per unknown: 34,000 to 229,000
  !> unknowns.
  real(dp), parameter :: work_of_iteration = 2.0e4_dp
  !> Iterations that are no reason for factors; and the factor of the estimate: it is rough, and the work is lost.
  real(dp), parameter :: always_allowed = 300, patience = 5
  !> Stiffness of quadratic elements with the graph of its nodes, and an entry of a factor [bytes].
  real(dp), parameter :: bytes_of_unknown = 1000, bytes_of_entry = 8

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
    real(dp) :: flops(size(body)), of_iteration
    flops = flops_per_square*real(body%n_unknowns(), dp)**2*compactness_of(body)**3
    of_iteration = work_of_iteration*sum(real(body%n_unknowns(), dp))/n_ranks()
    n = int(min(real(huge(1), dp)/2, &
                max(always_allowed, patience*max(maxval(flops), sum(flops)/n_ranks())/max(of_iteration, 1.0_dp))))
  end function iterations_worth_factors

  !> Whether the memory suffices for factors, each on one rank; the same on all ranks, which call it together.
  logical function factors_fit(body) result(fit)
    type(body_t), intent(in) :: body(:)  !! Bodies in parts (n_bodies).
    type(memory_t) :: memory
    real(dp) :: bytes(size(body))
    bytes = bytes_of_unknown*body%n_unknowns() + &
      bytes_of_entry*entries_per_power*real(body%n_unknowns(), dp)**(4.0_dp/3)*compactness_of(body)
    memory = memory_now()
    ! The ranks of a node share its memory.
    fit = .not. on_any_rank(memory%is_known .and. &
                            max(maxval(bytes), sum(bytes)*n_local_ranks()/n_ranks()) > memory%left)
  end function factors_fit
end module dotyk_control_split_costs
