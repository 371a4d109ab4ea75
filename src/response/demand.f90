!> What a scheme asks of the responses of a body, and what it costs in each form.
!>
!> Costs are floating-point operations at the speed of a factorization. They are compared before anything is factorized, so the speeds
!> of everything else are parts of it: fixed ones, because the choice must be the same from run to run.
module dotyk_response_demand
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: cost_of_matrix, cost_of_solves

  !> Responses to come.
  type, public :: response_demand_t
    !> Contact points of all bodies that share the factor, and how many bodies they are.
    integer :: n_rows = 0, n_bodies = 1
    !> Responses one by one, one in each step of a scheme; 0: the scheme takes the compliance of all points as a matrix.
    integer :: n_steps = 0
  end type response_demand_t

  !> How much slower the operations of single solves are, and those of forward substitutions and their products.
  real(dp), parameter :: slowness_of_solves = 10, slowness_of_halves = 1.3_dp

contains

  !> Single solves.
  elemental real(dp) function cost_of_solves(demand, entries) result(cost)
    type(response_demand_t), intent(in) :: demand
    !> Entries of the triangle that a response goes through, twice.
    real(dp), intent(in) :: entries
    cost = slowness_of_solves*4*entries*demand%n_steps*demand%n_bodies
  end function cost_of_solves

  !> Making the compliance, and multiplying with it.
  elemental real(dp) function cost_of_matrix(demand, path) result(cost)
    type(response_demand_t), intent(in) :: demand
    !> Entries from a contact unknown to the root; its unknowns are about the root of twice as many.
    real(dp), intent(in) :: path
    real(dp) :: n
    n = real(demand%n_rows, dp)/demand%n_bodies
    cost = demand%n_bodies*(slowness_of_halves*(2*path*n + sqrt(2*path)*n**2) + slowness_of_solves*2*n**2*demand%n_steps)
  end function cost_of_matrix
end module dotyk_response_demand
