!> What the error of an answer is made of: iteration, penalty, mesh; all in the energy norm, relative to that of the answer.
!>
!> The part of the iteration is the guaranteed bound of the scheme. That of the penalty is the distance to the solution without it
!> (`dotyk_scheme_penalty`), that of the mesh an asymptotically exact estimate (`dotyk_elasticity_discretization_error`), to which
!> contact adds what its conditions, met in the mean, are violated by in single places (`dotyk_contact_violation`).
module dotyk_driver_error_budget
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_driver_pressures, only: nodal_field_t
  use dotyk_driver_recovery, only: body_solution_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_discretization_error, only: estimate_discretization_error
  implicit none
  private

  !> Parts of the error, relative; NaN where a part is not known.
  type, public :: error_budget_t
    real(dp) :: penalty = 0, discretization = 0
    !> Energy norm ||u||_A of the answer [sqrt(energy)].
    real(dp) :: norm = 0
    !> Discretization, of each body, and of each element of each body; not allocated where nobody asked (n_bodies). Squares add up.
    real(dp), allocatable :: of_body(:)
    type(nodal_field_t), allocatable :: of_element(:)
  contains
    procedure :: init => budget_init
    procedure :: others => budget_others
  end type error_budget_t

  public :: estimate_mesh_error

contains

  !> Nothing is known.
  subroutine budget_init(self)
    class(error_budget_t), intent(out) :: self
    self%penalty = ieee_value(self%penalty, ieee_quiet_nan)
    self%discretization = self%penalty
    self%norm = self%penalty
  end subroutine budget_init

  !> Penalty and discretization together, as far as they are known.
  pure real(dp) function budget_others(self) result(others)
    class(error_budget_t), intent(in) :: self
    others = 0
    if (self%penalty >= 0) others = others + self%penalty
    if (self%discretization >= 0) others = others + self%discretization
  end function budget_others

  !> The part of the mesh.
  subroutine estimate_mesh_error(body, solution, budget, error)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> With displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    type(error_budget_t), intent(inout) :: budget
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: norm_square, of_one
    integer :: b
    if (allocated(budget%of_body)) deallocate (budget%of_body, budget%of_element)
    allocate (budget%of_body(size(body)), budget%of_element(size(body)))
    norm_square = 0
    do b = 1, size(body)
      allocate (budget%of_element(b)%value(body(b)%mesh%n_elements()))
      call estimate_discretization_error(body(b)%mesh, body(b)%analysis, body(b)%material, solution(b)%displacement, &
                                         budget%of_element(b)%value, of_one, error)
      if (allocated(error)) return
      norm_square = norm_square + of_one
    end do
    budget%norm = sqrt(norm_square)
    do b = 1, size(body)
      if (norm_square > 0) budget%of_element(b)%value = sqrt(budget%of_element(b)%value/norm_square)
      budget%of_body(b) = norm2(budget%of_element(b)%value)
    end do
    budget%discretization = norm2(budget%of_body)
  end subroutine estimate_mesh_error
end module dotyk_driver_error_budget
