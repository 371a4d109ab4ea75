!> Lines of the log on nearly incompressible bodies.
module dotyk_log_incompressibility
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: analysis_plane_stress, locking_ignore
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_material, only: least_compressible
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_input_case, only: case_t
  use dotyk_mesh_order_elevation, only: has_linear_simplices
  implicit none
  private
  public :: show_locking

  integer, parameter :: most_shown = 20  !! Greatest number of congruence classes with a line each; more are summed up.

contains

  !> Log one line per congruence class of nearly incompressible bodies; many classes are summed up.
  subroutine show_locking(log, case, body, classes)
    type(log_t), intent(inout) :: log  !! The log.
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    integer :: b, n, before, after
    n = 0
    before = 0
    after = 0
    do b = 1, size(body)
      if (.not. is_nearly_incompressible(body(b), case%solver%locking)) cycle
      n = n + 1
      before = before + body(b)%mesh%n_file_nodes()
      after = after + body(b)%mesh%n_whole_nodes()
      if (classes%n() <= most_shown .and. classes%is_representative(b)) &
        call log%line(line_of(body(b), count(classes%first == b), case%solver%locking))
    end do
    if (n == 0 .or. classes%n() <= most_shown) return
    if (case%solver%locking == locking_ignore) then
      call log%line('  warning: '//to_text(n)//' nearly incompressible bodies: volumetric locking is likely with '// &
                    "locking='ignore'")
    else
      call log%line('  nearly incompressible: '//to_text(n)//' bodies, projected dilatation (B-bar); '// &
                    to_text(before)//' nodes in the mesh, '//to_text(after)//' now')
    end if
  end subroutine show_locking

  !> Whether a body is nearly incompressible.
  logical function is_nearly_incompressible(body, locking) result(nearly)
    type(body_t), intent(in) :: body  !! The body.
    integer, intent(in) :: locking  !! One of `locking_*`.
    real(dp) :: ratio
    integer :: k
    nearly = .false.
    if (body%analysis == analysis_plane_stress) return
    do k = 1, size(body%mesh%block)
      associate (material => body%material(body%mesh%block(k)%material))
        ratio = material%incompressibility
        if (locking == locking_ignore) ratio = material%bulk_over_shear()
      end associate
      nearly = nearly .or. ratio > unprojected_bulk_ratio(body%mesh%block(k)%kind, ratio)
    end do
  end function is_nearly_incompressible

  !> Line of the log for one class.
  function line_of(body, number, locking) result(line)
    type(body_t), intent(in) :: body  !! First body of the class.
    integer, intent(in) :: number  !! Number of bodies of the class.
    integer, intent(in) :: locking  !! One of `locking_*`.
    character(:), allocatable :: line
    line = 'nearly incompressible: '//quoted(body%name)
    if (number > 1) line = line//' and '//counted(number - 1, 'congruent body', 'congruent bodies')
    line = line//' (K/G = '//to_text(body%material(least_compressible(body%material))%bulk_over_shear(), 3)//'): '
    if (locking == locking_ignore) then
      line = '  warning: '//line//"volumetric locking is likely with locking='ignore'"
    else
      line = '  '//line//'projected dilatation (B-bar)'
      if (body%mesh%order_elevated) then
        line = line//'; linear elements elevated to order 2: '//to_text(body%mesh%n_file_nodes())// &
          ' nodes in the mesh, '//to_text(body%mesh%n_whole_nodes())//' now'
      else if (has_linear_simplices(body%mesh)) then
        line = line//'; linear triangles, tetrahedra, prisms and pyramids may lock'
      end if
    end if
  end function line_of
end module dotyk_log_incompressibility
