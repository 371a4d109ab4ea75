!> Contact pressures as users look at them: projected, with resultants, and as a field of the nodes.
module dotyk_driver_pressures
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_pair, only: contact_pair_t, pair_force
  use dotyk_contact_pressure_projection, only: pressure_projection_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> Pressures of one pair.
  type, public :: pair_solution_t
    !> Of the scheme, and projected on surface_a's linear shape functions (n_rows) [pressure].
    real(dp), allocatable :: pressure(:), projected(:)
    !> Gap that is left, negative where the points penetrate (n_rows) [length].
    real(dp), allocatable :: gap(:)
    !> Resultant on body a (3) [force].
    real(dp) :: force(3) = 0
  end type pair_solution_t

  !> One number per node of a body.
  type, public :: nodal_field_t
    !> (n_nodes).
    real(dp), allocatable :: value(:)
  end type nodal_field_t

  public :: project_pressures

contains

  !> Pressures of all pairs. A node on several pairs gets the sum.
  subroutine project_pressures(body, pair, surface_a, surface_b, problem, m, y, solution, nodal, error)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> Contact points and surfaces (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(surface_t), intent(in) :: surface_a(:), surface_b(:)
    type(contact_problem_t), intent(in) :: problem
    !> State [pressure] and B u - d [length] of the scheme (n_rows).
    real(dp), intent(in) :: m(:), y(:)
    !> (n_pairs).
    type(pair_solution_t), allocatable, intent(out) :: solution(:)
    !> Projected pressure at the nodes (n_bodies) [pressure].
    type(nodal_field_t), allocatable, intent(out) :: nodal(:)
    type(error_t), allocatable, intent(out) :: error
    type(pressure_projection_t) :: projection
    real(dp), allocatable :: on_a(:), on_b(:)
    integer :: k, b, first, last
    allocate (solution(size(pair)), nodal(size(body)))
    do b = 1, size(body)
      allocate (nodal(b)%value(body(b)%mesh%n_nodes()), source=0.0_dp)
    end do
    do k = 1, size(pair)
      first = problem%operator%pair_first_row(k)
      last = problem%operator%pair_first_row(k + 1) - 1
      solution(k)%pressure = m(first:last)
      solution(k)%gap = -y(first:last)
      solution(k)%force = pair_force(pair(k), solution(k)%pressure)
      call projection%init(pair(k), surface_a(k), surface_b(k), error)
      if (allocated(error)) return
      allocate (solution(k)%projected(last - first + 1), on_a(size(projection%side_a%node)), on_b(size(projection%side_b%node)))
      call projection%project(pair(k), solution(k)%pressure, solution(k)%projected, on_a, on_b)
      call add_at(nodal(pair(k)%body_a)%value, projection%side_a%node, on_a)
      call add_at(nodal(pair(k)%body_b)%value, projection%side_b%node, on_b)
      call projection%destroy()
      deallocate (on_a, on_b)
    end do
  end subroutine project_pressures

  !> total(node) += value.
  pure subroutine add_at(total, node, value)
    real(dp), intent(inout) :: total(:)
    integer, intent(in) :: node(:)
    real(dp), intent(in) :: value(:)
    total(node) = total(node) + value
  end subroutine add_at
end module dotyk_driver_pressures
