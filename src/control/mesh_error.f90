!> Discretization errors of all bodies: congruent ones together, in the axes of the representative.
module dotyk_control_mesh_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_discretization_error, only: estimate_discretization_errors
  implicit none
  private

  !> One number for each element of a body.
  type, public :: element_field_t
    !> In the order of the blocks (n_elements).
    real(dp), allocatable :: value(:)
  end type element_field_t

  public :: estimate_mesh_errors

  !> Congruent bodies in one pass at most: the work that depends on the mesh alone is small beside that for so many, and
  !> the memory is small beside a factor.
  integer, parameter :: most_bodies = 16

contains

  !> Squared errors of all elements, and the squared norm of the solution.
  subroutine estimate_mesh_errors(body, classes, solution, of_element, norm_square, error)
    !> Bodies (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> Classes of congruent bodies.
    type(congruence_classes_t), intent(in) :: classes
    !> With displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Elements in the order of the blocks (n_bodies) [energy].
    type(element_field_t), allocatable, intent(out) :: of_element(:)
    !> Squared energy norm of the solution [energy].
    real(dp), intent(out) :: norm_square
    !> Allocated where a formula of a material cannot be evaluated.
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: alike(:)
    real(dp) :: of_body(size(body))
    integer :: b, c, i
    allocate (of_element(size(body)))
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) cycle
      alike = pack([(c, c=1, size(body))], classes%first == b)
      do i = 1, size(alike), most_bodies
        call estimate_some(body(b), classes, alike(i:min(i + most_bodies - 1, size(alike))), solution, of_element, &
                           of_body, error)
        if (allocated(error)) return
      end do
    end do
    norm_square = sum(of_body)
  end subroutine estimate_mesh_errors

  !> Some congruent bodies.
  subroutine estimate_some(first, classes, alike, solution, of_element, norm_square, error)
    !> Their representative.
    type(body_t), intent(in) :: first
    !> Classes of congruent bodies.
    type(congruence_classes_t), intent(in) :: classes
    !> Indices of the bodies (n).
    integer, intent(in) :: alike(:)
    !> Solutions of all bodies, with displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Squared errors; those of these bodies are set (n_bodies) [energy].
    type(element_field_t), intent(inout) :: of_element(:)
    !> Squared energy norm of each body (n_bodies) [energy].
    real(dp), intent(inout) :: norm_square(:)
    !> Allocated where a formula of a material cannot be evaluated.
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
end module dotyk_control_mesh_error
