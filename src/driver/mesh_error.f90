!> Errors of the mesh of all bodies: those of one kind together, in the axes of the first of them.
module dotyk_driver_mesh_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_pressures, only: nodal_field_t
  use dotyk_driver_body_solution, only: body_solution_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_discretization_error, only: estimate_discretization_errors
  implicit none
  private
  public :: estimate_mesh_errors

  !> Bodies of a kind that are looked at together, at most: what depends on the mesh alone is little work beside that for so many, and
  !> what is kept of them is little memory beside a factor.
  integer, parameter :: most_bodies = 16

contains

  !> Squared errors of all elements, and the squared norm of the answer.
  subroutine estimate_mesh_errors(body, classes, solution, of_element, norm_square, error)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    !> With displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Elements in the order of the blocks (n_bodies) [force length].
    type(nodal_field_t), allocatable, intent(out) :: of_element(:)
    !> [force length].
    real(dp), intent(out) :: norm_square
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: alike(:)
    real(dp) :: of_body(size(body))
    integer :: b, c, i
    allocate (of_element(size(body)))
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) cycle
      alike = pack([(c, c=1, size(body))], classes%first == b)
      do i = 1, size(alike), most_bodies
        call estimate_some(body(b), classes, alike(i:min(i + most_bodies - 1, size(alike))), solution, of_element, of_body, error)
        if (allocated(error)) return
      end do
    end do
    norm_square = sum(of_body)
  end subroutine estimate_mesh_errors

  !> Some bodies of one kind.
  subroutine estimate_some(first, classes, alike, solution, of_element, norm_square, error)
    !> The first body of the kind.
    type(body_t), intent(in) :: first
    type(congruence_classes_t), intent(in) :: classes
    !> The bodies.
    integer, intent(in) :: alike(:)
    !> Of all bodies (n_bodies), as in `estimate_mesh_errors`.
    type(body_solution_t), intent(in) :: solution(:)
    type(nodal_field_t), intent(inout) :: of_element(:)
    !> Of each body (n_bodies) [force length].
    real(dp), intent(inout) :: norm_square(:)
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :, :), square(:, :)
    real(dp) :: of_body(size(alike))
    integer :: i, d
    d = first%dimension
    allocate (u(size(alike), d, first%mesh%n_nodes()), square(size(alike), first%mesh%n_elements()))
    do i = 1, size(alike)
      associate (motion => classes%motion(alike(i)), displacement => solution(alike(i))%displacement)
        if (motion%rotated) then
          u(i, :, :) = matmul(transpose(motion%rotation(:d, :d)), displacement)
        else
          u(i, :, :) = displacement
        end if
      end associate
    end do
    call estimate_discretization_errors(first%mesh, first%analysis, first%material, u, square, of_body, error)
    if (allocated(error)) return
    do i = 1, size(alike)
      of_element(alike(i))%value = square(i, :)
      norm_square(alike(i)) = of_body(i)
    end do
  end subroutine estimate_some
end module dotyk_driver_mesh_error
