!> The constants of a material at the nodes of a body, where they are formulas.
module dotyk_elasticity_node_constants
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_initial_stress, only: initial_state_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_field, only: material_field_t, point_constants_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: constants_of_nodes, find_homes, thermal_dilatation

  !> Where the material has no value at a node, it is taken this fraction of the way to the centre of an element.
  real(dp), parameter :: inward = 1.0e-6_dp

contains

  !> An element of each node: of the own ones, where the rank has some.
  subroutine find_homes(mesh, home)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, allocatable, intent(out) :: home(:, :)  !! Block, element and number in it of each node; or 0 (3, n_nodes).
    integer :: b, e, i, number, round
    allocate (home(3, mesh%n_nodes()), source=0)
    ! Recovered strains are those of the whole body in own elements: these come first.
    do round = 1, 2
      number = 0
      do b = 1, size(mesh%block)
        do e = 1, size(mesh%block(b)%node, 2)
          number = number + 1
          if (mesh%is_own_element(number) .neqv. round == 1) cycle
          do i = 1, size(mesh%block(b)%node, 1)
            associate (node => mesh%block(b)%node(i, e))
              if (home(1, node) == 0) home(:, node) = [b, e, i]
            end associate
          end do
        end do
      end do
    end do
  end subroutine find_homes

  !> Factors and constants at the nodes.
  subroutine constants_of_nodes(mesh, analysis, material, home, factor, here, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material of the body.
    integer, intent(in) :: home(:, :)  !! Block, element and number of each node (3, n_nodes).
    real(dp), allocatable, intent(out) :: factor(:)  !! The factor; NaN where it has no value (n_nodes) [].
    !> The constants; not allocated where a factor alone varies (n_nodes).
    type(point_constants_t), allocatable, intent(out) :: here(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula does not parse.
    type(error_t), allocatable :: no_value
    type(material_field_t) :: field
    integer :: i
    allocate (factor(size(home, 2)), source=1.0_dp)
    call field%init(material, error)
    if (allocated(error)) return
    if (field%varies) allocate (here(size(factor)))
    if (.not. field%constant) then
      do i = 1, size(factor)
        if (home(1, i) == 0) cycle
        call evaluate(mesh%x(:, i))
        if (.not. allocated(no_value) .and. factor(i) > tiny(factor) .and. ieee_is_finite(factor(i))) cycle
        associate (node => mesh%block(home(1, i))%node(:, home(2, i)))
          call evaluate((1 - inward)*mesh%x(:, i) + inward*sum(mesh%x(:, node), dim=2)/size(node))
        end associate
        if (allocated(no_value)) factor(i) = ieee_value(factor(i), ieee_quiet_nan)
      end do
    end if
    call field%destroy()

  contains

    !> Evaluate the material of the node at a point.
    subroutine evaluate(x)
      real(dp), intent(in) :: x(:)  !! The point (dim) [length].
      if (field%varies) then
        call field%at(analysis, x, here(i), no_value, mesh%block(home(1, i))%kind)
        factor(i) = here(i)%factor
      else
        call field%factor_at(x, factor(i), no_value)
      end if
    end subroutine evaluate
  end subroutine constants_of_nodes

  !> Dilatation of the thermal expansion at the nodes of a body with a temperature (n_nodes) [].
  subroutine thermal_dilatation(mesh, analysis, material, initial, dilatation)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! The material.
    type(initial_state_t), intent(in) :: initial  !! The temperature.
    real(dp), allocatable, intent(out) :: dilatation(:)  !! The dilatation (n_nodes) [].
    type(point_constants_t), allocatable :: here(:)
    type(error_t), allocatable :: error
    real(dp), allocatable :: factor(:)
    integer, allocatable :: home(:, :)
    integer :: i
    dilatation = initial%thermal_dilatation(material%expansion)
    if (.not. allocated(material%formulas%expansion)) return
    call find_homes(mesh, home)
    ! Assembly has found mistakes of the formulas.
    call constants_of_nodes(mesh, analysis, material, home, factor, here, error)
    if (allocated(error)) return
    dilatation = [(sum(here(i)%expansion(:3))*initial%temperature(i), i=1, size(here))]
  end subroutine thermal_dilatation
end module dotyk_elasticity_node_constants
