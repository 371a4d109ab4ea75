!> Bodies that lie almost exactly in each other, such as a copy shifted by metres where millimetres are meant. Their
!> boundaries are near each other everywhere, so that no node is deep; the middles of elements are.
module dotyk_control_shared_interior
  use dotyk_base_kinds, only: dp
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_held_part, only: sample_step
  implicit none
  private
  public :: find_shared_interior

  !> Only bodies whose boxes before deformation differ by less than this fraction of their diagonal are looked at [].
  real(dp), parameter :: same_box = 0.25_dp

contains

  !> Find the deepest middle of an element of a body inside another body, if half of those looked at are inside.
  pure subroutine find_shared_interior(mesh, u, own, other, depth, position)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    real(dp), intent(in) :: u(:, :)  !! Displacements of its nodes (dimension, n_nodes) [length].
    type(solid_t), intent(in) :: own  !! Its boundary.
    type(solid_t), intent(in) :: other  !! Boundary of the other body.
    real(dp), intent(out) :: depth  !! Depth; 0 where less than half of the body is inside [length].
    real(dp), intent(out) :: position(3)  !! Position after deformation (3) [length].
    real(dp) :: x(3), xi(2), here, size_of
    integer :: b, e, facet, n, n_inside, first, step
    depth = 0
    position = 0
    size_of = norm2(maxval(own%x0, 2) - minval(own%x0, 2))
    if (any(abs(maxval(own%x0, 2) - maxval(other%x0, 2)) > same_box*size_of) .or. &
        any(abs(minval(own%x0, 2) - minval(other%x0, 2)) > same_box*size_of)) return
    n = 0
    n_inside = 0
    x = 0
    first = 0
    do b = 1, size(mesh%block)
      associate (node => mesh%block(b)%node, d => size(u, 1))
        step = sample_step(size(node, 2))
        if (allocated(mesh%whole)) step = 1
        do e = 1, size(node, 2), step
          if (allocated(mesh%whole)) then
            if (mod(mesh%whole%element(first + e) - 1, sample_step(mesh%whole%n_of_block(b))) > 0) cycle
          end if
          x(1:d) = sum(mesh%x(:, node(:, e)) + u(:, node(:, e)), 2)/size(node, 1)
          call other%depth_of(x, 0, here, facet, xi)
          n = n + 1
          if (.not. here > 0) cycle
          n_inside = n_inside + 1
          if (here <= depth) cycle
          depth = here
          position = x
        end do
        first = first + size(node, 2)
      end associate
    end do
    if (2*n_inside < n) depth = 0
  end subroutine find_shared_interior
end module dotyk_control_shared_interior
