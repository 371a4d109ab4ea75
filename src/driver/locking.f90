!> Treatment of volumetric locking in nearly incompressible bodies, and its lines in the log.
module dotyk_driver_locking
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: analysis_plane_stress, locking_auto, locking_ignore
  use dotyk_base_text, only: to_text
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_driver_materials, only: build_material
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio
  use dotyk_elasticity_material, only: material_t
  use dotyk_input_case, only: case_t
  use dotyk_mesh_order_elevation, only: has_linear_simplices
  implicit none
  private
  public :: would_lock, show_locking

  !> Bulk over shear modulus from which on linear triangles, tetrahedra and prisms are elevated to order 2: Poisson's
  !> ratio 0.45 [].
  real(dp), parameter :: linear_simplices_lock = 29.0_dp/3
  !> Greatest number of congruence classes with a line each.
  integer, parameter :: most_shown = 20

contains

  !> Whether linear triangles, tetrahedra and prisms would lock in a body, so that they are elevated to order 2.
  logical function would_lock(case, b) result(locks)
    !> The case.
    type(case_t), intent(in) :: case
    !> Index of the body.
    integer, intent(in) :: b
    type(material_t) :: material
    type(error_t), allocatable :: failed
    locks = .false.
    if (case%solver%locking /= locking_auto .or. case%scene%analysis == analysis_plane_stress) return
    ! Errors are reported where the body is built.
    call build_material(case%material(case%body(b)%material), case%solver%locking, material, failed)
    if (.not. allocated(failed)) locks = material%incompressibility >= linear_simplices_lock
  end function would_lock

  !> Log one line per congruence class of nearly incompressible bodies; many classes are summed up.
  subroutine show_locking(log, case, body, classes)
    !> The log.
    type(log_t), intent(inout) :: log
    !> The case.
    type(case_t), intent(in) :: case
    !> Bodies (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> Congruence classes of the bodies.
    type(congruence_classes_t), intent(in) :: classes
    integer :: b, n, before, after
    n = 0
    before = 0
    after = 0
    do b = 1, size(body)
      if (.not. asks_for_it(body(b), case%solver%locking)) cycle
      n = n + 1
      before = before + size(body(b)%mesh%mesh_node)
      after = after + body(b)%mesh%n_nodes()
      if (classes%n() <= most_shown .and. classes%is_representative(b)) &
        call log%line(line_of(body(b), count(classes%first == b), case%solver%locking))
    end do
    if (n == 0 .or. classes%n() <= most_shown) return
    if (case%solver%locking == locking_ignore) then
      call log%line('  warning: '//to_text(n)//" bodies are nearly incompressible, and may lock (locking='ignore')")
    else
      call log%line('  nearly incompressible: '//to_text(n)//' bodies, projected dilatation; nodes '// &
                    to_text(before)//' in the mesh, '//to_text(after)//' now')
    end if
  end subroutine show_locking

  !> Whether a body is nearly incompressible.
  logical function asks_for_it(body, locking) result(asks)
    !> The body.
    type(body_t), intent(in) :: body
    !> One of `locking_*`.
    integer, intent(in) :: locking
    real(dp) :: ratio
    integer :: k
    asks = .false.
    if (body%analysis == analysis_plane_stress) return
    ratio = body%material%incompressibility
    if (locking == locking_ignore) ratio = body%material%bulk_over_shear()
    do k = 1, size(body%mesh%block)
      asks = asks .or. ratio > unprojected_bulk_ratio(body%mesh%block(k)%kind, ratio)
    end do
  end function asks_for_it

  !> Line of the log for one class.
  function line_of(body, number, locking) result(line)
    !> First body of the class.
    type(body_t), intent(in) :: body
    !> Number of bodies of the class.
    integer, intent(in) :: number
    !> One of `locking_*`.
    integer, intent(in) :: locking
    character(:), allocatable :: line
    line = "nearly incompressible: '"//body%name//"'"
    if (number > 1) line = line//' and '//to_text(number - 1)//' like it'
    line = line//' (bulk over shear modulus '//to_text(body%material%bulk_over_shear(), 3)//'): '
    if (locking == locking_ignore) then
      line = '  warning: '//line//"it may lock (locking='ignore')"
    else
      line = '  '//line//'projected dilatation'
      if (body%mesh%order_elevated) then
        line = line//'; linear elements elevated to order 2: '//to_text(size(body%mesh%mesh_node))// &
          ' nodes in the mesh, '//to_text(body%mesh%n_nodes())//' now'
      else if (has_linear_simplices(body%mesh)) then
        line = line//'; linear triangles, tetrahedra and prisms may lock'
      end if
    end if
  end function line_of
end module dotyk_driver_locking
