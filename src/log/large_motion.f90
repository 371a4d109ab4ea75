!> Motions beyond small-displacement theory, in the log.
module dotyk_log_large_motion
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_couple_penetration, only: large_displacement
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_mean_rotation, only: mean_rotation
  implicit none
  private
  public :: show_large_motion

  real(dp), parameter :: large_rotation = 0.05_dp  !! Rotation from which on there is a warning [].
  real(dp), parameter :: large_strain = 0.02_dp  !! Strain from which on there is a line [].

contains

  !> Warn of the body that moves farthest by its size, of the one that rotates most, and of the one with the largest
  !> strain.
  subroutine show_large_motion(log, problem, solution)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    real(dp), dimension(size(solution)) :: ratio, angle, stretch
    integer :: b
    ratio = 0
    angle = 0
    stretch = 0
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (x => problem%body(b)%mesh%x, u => solution(b)%displacement)
        ratio(b) = maxval(norm2(u, dim=1))/norm2(maxval(x, 2) - minval(x, 2))
        ! Of a part of a body the rotation of the part: parts of a body turn with it.
        angle(b) = norm2(mean_rotation(x, u))
        stretch(b) = largest_stretch(problem%body(b)%mesh, u)
      end associate
    end do
    call problem%ranks%share_greatest(ratio)
    call problem%ranks%share_greatest(angle)
    call problem%ranks%share_greatest(stretch)
    b = maxloc(ratio, dim=1)
    if (ratio(b) > large_displacement) &
      call log%line('  large motion     '//quoted(problem%body(b)%name)//' moves by '//to_text(ratio(b), 3)// &
                    ' times its size'//others(count(ratio > large_displacement) - 1)// &
                    '; contact was searched where the bodies are placed')
    b = maxloc(angle, dim=1)
    if (angle(b) > large_rotation) &
      call log%line('  large motion     '//quoted(problem%body(b)%name)//' rotates by '//to_text(angle(b), 3)// &
                    ' rad'//others(count(angle > large_rotation) - 1)// &
                    '; small-displacement theory stretches it by '// &
                    to_text(100*angle(b)**2/2, 2)//' %')
    b = maxloc(stretch, dim=1)
    if (stretch(b) > large_strain) &
      call log%line('  large strain     '//quoted(problem%body(b)%name)//': an element is stretched or '// &
                    'shortened by '//to_text(100*stretch(b), 2)//' %'//others(count(stretch > large_strain) - 1)// &
                    '; check loads, positions and units, or a singular corner: the theory is linear')
  end subroutine show_large_motion

  !> Largest relative change of the distance of two corners of an element [].
  pure real(dp) function largest_stretch(mesh, u) result(stretch)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    real(dp), intent(in) :: u(:, :)  !! Displacements of its nodes (dimension, n_nodes) [length].
    type(element_kind_t) :: kind
    real(dp) :: along(size(u, 1))
    integer :: k, e, i, j
    stretch = 0
    do k = 1, size(mesh%block)
      kind = element_kind(mesh%block(k)%kind)
      do e = 1, size(mesh%block(k)%node, 2)
        associate (node => mesh%block(k)%node(:, e))
          do i = 2, kind%n_corners
            do j = 1, i - 1
              along = mesh%x(:, node(i)) - mesh%x(:, node(j))
              stretch = max(stretch, abs(dot_product(along, u(:, node(i)) - u(:, node(j))))/ &
                            max(tiny(stretch), dot_product(along, along)))
            end do
          end do
        end associate
      end do
    end do
  end function largest_stretch

  !> How many bodies more do so; empty for none.
  function others(n) result(text)
    integer, intent(in) :: n  !! Number of bodies.
    character(:), allocatable :: text
    text = ''
    if (n > 0) text = ' ('//counted(n, 'body', 'bodies')//' more, less)'
  end function others
end module dotyk_log_large_motion
