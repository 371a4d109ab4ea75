!> Memory of a run, predicted when all is assembled and analysed: what is in use, and what the factors, the block rows
!> and the matrices of ties will take. Rows of ties are all active, and their matrices count where the run will have
!> them; how many contact rows will be is not known.
module dotyk_control_run_prediction
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: linear_solver_auto, linear_solver_iterative
  use dotyk_control_factorization, only: beside_factor, factor_size_t
  use dotyk_control_response_choice, only: form_direct, form_multigrid
  use dotyk_scheme_linear_solver_choice, only: add_costs, takes_products
  implicit none
  private
  public :: predicted_memory

  !> Vectors, low-precision copies and estimates of a body with p-multigrid beside its block rows, and of a body that is
  !> solved by its factor [byte/unknown].
  real(dp), parameter :: beside_rows = 200, beside_direct = 100

contains

  !> Peak memory [bytes].
  real(dp) function predicted_memory(n_unknowns, n_rows, size_of, used, n_tied, linear_solver, room) result(memory)
    integer, intent(in) :: n_unknowns(:)  !! Unknowns of the bodies (n_bodies).
    integer, intent(in) :: n_rows(:)  !! Contact rows of the bodies (n_bodies).
    !> Sizes of the factors; without bytes for all but one of congruent bodies (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)
    real(dp), intent(in) :: used  !! Memory in use, all assembled and analysed [bytes].
    integer, intent(in), optional :: n_tied(:)  !! Rows of ties among those of the bodies; none if absent (n_bodies).
    integer, intent(in), optional :: linear_solver  !! One of `linear_solver_*`; present with `n_tied`.
    real(dp), intent(in), optional :: room  !! Memory for matrices of the rows; present with `n_tied` [bytes].
    real(dp) :: cost(2), of_ties
    integer :: b
    logical :: by_products
    memory = used + (1 + beside_factor)*sum(real(size_of%bytes, dp)) + &
             sum(n_unknowns*merge(beside_rows, beside_direct, size_of%form == form_multigrid))
    ! The compliance of the rows in the corner spaces.
    if (any(size_of%form /= form_direct)) memory = memory + 8*sum(real(n_rows, dp)**2)
    if (.not. present(n_tied)) return
    cost = 0
    of_ties = 0
    do b = 1, size(size_of)
      if (n_tied(b) > 0) call add_costs(n_tied(b), size_of(b)%path_entries, real(size_of(b)%class_entries, dp), &
                                        .true., all(n_rows == n_tied), cost, of_ties)
    end do
    by_products = linear_solver == linear_solver_iterative
    if (linear_solver == linear_solver_auto) by_products = takes_products(cost, [of_ties, 0.0_dp], room)
    if (.not. by_products) memory = memory + of_ties
  end function predicted_memory
end module dotyk_control_run_prediction
