!> The compliance operator of the aggregates of a body of linear elements (`dotyk_response_aggregate_space`): the factor
!> of their Galerkin matrix.
module dotyk_response_aggregate_factor
  use dotyk_base_error, only: add_context, error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_factor, only: lower_triangle, order_blocks
  use dotyk_linalg_ordering, only: expand_permutation
  use dotyk_linalg_springs, only: add_springs, choose_fixing_equations
  use dotyk_response_aggregate_space, only: aggregate_space_t
  use dotyk_response_direct, only: direct_response_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  implicit none
  private
  public :: analyze_aggregates, factorize_aggregates

contains

  !> Order and analyse the factorization of the Galerkin matrix.
  subroutine analyze_aggregates(self, response, error)
    type(aggregate_space_t), intent(inout) :: self  !! The space; gets the matrix in place of its block rows.
    type(direct_response_t), intent(inout) :: response  !! Compliance operator of the space.
    type(error_t), allocatable, intent(out) :: error  !! As in `analyze` of `direct_response_t`.
    integer, allocatable :: order(:), permutation(:), equation(:, :)
    integer :: i
    call lower_triangle(self%rows, self%matrix)
    self%matrix%value(:) = self%rows%scale*self%matrix%value
    call order_blocks(self%rows, order, error)
    if (allocated(error)) return
    equation = reshape([(i, i=1, self%n)], [self%rows%dim, self%rows%n])
    allocate (permutation(self%n))
    call expand_permutation(order, equation, permutation)
    call self%rows%destroy()
    deallocate (self%near_null)
    call move_alloc(self%mode, response%mode)
    call choose_fixing_equations(response%mode, response%fixing_equation)
    call response%factor%analyze(self%matrix, permutation, error)
  end subroutine analyze_aggregates

  !> Factorize the Galerkin matrix.
  subroutine factorize_aggregates(self, response, report, error)
    type(aggregate_space_t), intent(inout) :: self  !! The space; without its matrix on return.
    type(direct_response_t), intent(inout) :: response  !! Compliance operator of the space.
    type(factorization_report_t), intent(out) :: report  !! Condition of the Galerkin matrix.
    !> Allocated where the Galerkin matrix is not positive definite beside its null vectors, or memory runs out.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: spring(:)
    integer :: failed_column
    call add_springs(self%matrix, response%fixing_equation, spring)
    call response%factor%factorize_and_discard(self%matrix, failed_column, error)
    if (.not. allocated(error) .and. failed_column > 0) then
      !$omp critical (message)
      call set_error(error, 'the stiffness is not positive definite: the body, or a part of it that is connected '// &
                     'by single nodes or edges only, has a free rigid body mode; add a &support', exit_not_solvable)
      !$omp end critical (message)
    end if
    if (allocated(error)) then
      call add_context(error, 'multigrid, aggregates: ')
      return
    end if
    report%condition = 1/response%factor%weakest_pivot
    report%condition_left = report%condition
  end subroutine factorize_aggregates
end module dotyk_response_aggregate_factor
