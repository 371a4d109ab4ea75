!> Memory and time of a run, predicted when all is assembled and analysed: what the run has taken so far is measured,
!> the rest follows from the sizes of the factors and of the block rows, and from the speed of the machine.
!>
!> Constants are measured on Hertz scenes of 0.17 to 2 million unknowns. Iterations are assumed: contact problems with
!> many changes of the active set take more time. Rows of ties are all active, and their matrices count where the run
!> will have them; how many contact rows will be is not known.
module dotyk_control_run_prediction
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: linear_solver_auto, linear_solver_iterative
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_response_choice, only: form_direct, form_multigrid
  use dotyk_linalg_machine_speed, only: machine_speed_t
  use dotyk_scheme_linear_solver_choice, only: add_costs, takes_products
  implicit none
  private

  type, public :: run_prediction_t  !! A prediction.
    real(dp) :: memory = 0  !! Peak memory [bytes].
    real(dp) :: seconds = 0  !! Wall time of the whole run [s].
    integer :: n_threads = 1  !! Number of threads that it is made for.
    real(dp) :: speed = 0  !! Speed of a thread, as measured [flop/s].
    real(dp) :: bandwidth = 0  !! Memory bandwidth, as measured [byte/s].
  contains
    procedure :: init => run_prediction_init
  end type run_prediction_t

  real(dp), parameter :: beside_factor = 0.15_dp  !! Memory beside a factor while it is made, as a fraction of it [].
  !> Vectors, low-precision copies and estimates of a body with p-multigrid, beside its block rows [byte/unknown].
  real(dp), parameter :: beside_rows = 200
  real(dp), parameter :: beside_direct = 100  !! The same of a body that is solved by its factor [byte/unknown].
  real(dp), parameter :: factorization_speed = 0.7_dp  !! Speed of a factorization over that of dense products [].
  real(dp), parameter :: cycles = 66  !! Cycles of p-multigrid in a run: trial steps, solution without contact, contact.
  real(dp), parameter :: corner_solves = 90  !! Solves in the corner space: two in a cycle of the contact.
  real(dp), parameter :: traffic = 2400  !! Memory traffic of a cycle without its coarse solve [byte/unknown].
  !> Speed of a cycle, with its vectors, over that of products with block rows [].
  real(dp), parameter :: cycle_speed = 0.7_dp
  real(dp), parameter :: direct_solves = 10  !! Solves with a factor in a run.
  !> Work of estimates, recovery and checks: dense operations that take the same time [flop/unknown].
  real(dp), parameter :: work_afterwards = 3.2e5_dp

contains

  !> Predict.
  subroutine run_prediction_init(self, n_unknowns, n_rows, size_of, used, elapsed, speed, n_tied, linear_solver, room)
    class(run_prediction_t), intent(out) :: self
    integer, intent(in) :: n_unknowns(:)  !! Unknowns of the bodies (n_bodies).
    integer, intent(in) :: n_rows(:)  !! Contact rows of the bodies (n_bodies).
    !> Sizes of the factors; without bytes for all but one of congruent bodies (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)
    real(dp), intent(in) :: used  !! Memory in use, all assembled and analysed [bytes].
    real(dp), intent(in) :: elapsed  !! Wall time so far [s].
    type(machine_speed_t), intent(in) :: speed  !! The machine.
    integer, intent(in), optional :: n_tied(:)  !! Rows of ties among those of the bodies; none if absent (n_bodies).
    integer, intent(in), optional :: linear_solver  !! One of `linear_solver_*`; present with `n_tied`.
    real(dp), intent(in), optional :: room  !! Memory for matrices of the rows; present with `n_tied` [bytes].
    real(dp) :: n, bytes, flops, of_solve, cost(2), of_ties
    logical :: by_rows, by_products
    integer :: b
    self%n_threads = speed%n_threads
    self%speed = speed%flops
    self%bandwidth = speed%bandwidth
    self%memory = used
    bytes = 0
    flops = 0
    by_rows = any(size_of%form /= form_direct)
    do b = 1, size(size_of)
      n = n_unknowns(b)
      self%memory = self%memory + (1 + beside_factor)*real(size_of(b)%bytes, dp)
      if (size_of(b)%form == form_multigrid) then
        self%memory = self%memory + beside_rows*n
      else
        self%memory = self%memory + beside_direct*n
      end if
      ! A solve reads the factor of the class twice.
      of_solve = 2*8*real(size_of(b)%class_entries, dp)
      if (by_rows) then
        ! The compliance of the rows in the corner spaces.
        self%memory = self%memory + 8*real(n_rows(b), dp)**2
        bytes = bytes + corner_solves*of_solve/cycle_speed
        if (size_of(b)%form == form_multigrid) bytes = bytes + cycles*traffic*n/cycle_speed
        bytes = bytes + n_rows(b)*2*8*real(size_of(b)%row_entries, dp)/cycle_speed
      else
        bytes = bytes + direct_solves*of_solve
      end if
      flops = flops + size_of(b)%flops/factorization_speed + work_afterwards*n
    end do
    if (present(n_tied)) then
      cost = 0
      of_ties = 0
      do b = 1, size(size_of)
        if (n_tied(b) > 0) call add_costs(n_tied(b), size_of(b)%path_entries, real(size_of(b)%class_entries, dp), &
                                          .true., all(n_rows == n_tied), cost, of_ties)
      end do
      by_products = linear_solver == linear_solver_iterative
      if (linear_solver == linear_solver_auto) by_products = takes_products(cost, [of_ties, 0.0_dp], room)
      if (by_products) then
        bytes = bytes + 4*cost(2)
      else
        self%memory = self%memory + of_ties
        bytes = bytes + 4*cost(1)
      end if
    end if
    self%seconds = elapsed + bytes/max(speed%bandwidth, tiny(1.0_dp)) + &
                   flops/max(1, speed%n_threads)/max(speed%flops, tiny(1.0_dp))
  end subroutine run_prediction_init
end module dotyk_control_run_prediction
