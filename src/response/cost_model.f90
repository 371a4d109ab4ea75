!> What an iterative scheme's products with the compliance of a body cost: by triangular solves, or with the matrix
!> formed.
!>
!> Costs are floating-point operations at the speed of a factorization. They are compared before anything is factorized,
!> so the speeds of everything else are fractions of it: fixed ones, because the choice must be the same from run to
!> run.
module dotyk_response_cost_model
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: matrix_is_cheaper

  type, public :: workload_t  !! Products to come.
    !> Contact rows of all bodies of the congruence class, and number of these bodies.
    integer :: n_rows = 0, n_bodies = 1
    !> Products one by one, one in each step of an iterative scheme; 0: the scheme forms the matrix.
    integer :: n_steps = 0
  end type workload_t

  !> Speed of a factorization over that of single triangular solves, and of forward substitutions of blocks of rows.
  real(dp), parameter :: slowness_of_solves = 10, slowness_of_substitution = 1.3_dp
  real(dp), parameter :: most_bytes = 1.0e9_dp  !! Bytes that a matrix may take which the user did not ask for.

contains

  !> Whether forming the matrix pays, and it does not take too much memory.
  pure logical function matrix_is_cheaper(work, factor_entries, path_entries) result(cheaper)
    type(workload_t), intent(in) :: work  !! Products to come.
    real(dp), intent(in) :: factor_entries  !! Entries of the factor [].
    !> Entries of the factor from a contact unknown to the root of the elimination tree [].
    real(dp), intent(in) :: path_entries
    cheaper = .false.
    if (work%n_steps == 0 .or. 8*real(work%n_rows, dp)**2/work%n_bodies > most_bytes) return
    cheaper = cost_of_matrix(work, path_entries) < cost_of_solves(work, factor_entries)
  end function matrix_is_cheaper

  !> Triangular solves: each entry of the factor twice, an addition and a multiplication.
  pure real(dp) function cost_of_solves(work, entries) result(cost)
    type(workload_t), intent(in) :: work  !! Products to come.
    real(dp), intent(in) :: entries  !! Entries of the factor [].
    cost = slowness_of_solves*4*entries*work%n_steps*work%n_bodies
  end function cost_of_solves

  !> Forming the matrix, and multiplying with it.
  pure real(dp) function cost_of_matrix(work, path) result(cost)
    type(workload_t), intent(in) :: work  !! Products to come.
    !> Entries from a contact unknown to the root []; the unknowns on the path are about the root of twice as many.
    real(dp), intent(in) :: path
    real(dp) :: n
    n = real(work%n_rows, dp)/work%n_bodies
    cost = work%n_bodies*(slowness_of_substitution*(2*path*n + sqrt(2*path)*n**2) + &
      slowness_of_solves*2*n**2*work%n_steps)
  end function cost_of_matrix
end module dotyk_response_cost_model
