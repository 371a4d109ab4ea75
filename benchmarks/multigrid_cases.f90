!> Bodies for the table of p-multigrid: materials and shapes, from easy to hard.
module multigrid_cases
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_element, only: element_tet10
  use multigrid_blocks, only: hold_side, make_block, move_corners, thin_layer
  implicit none
  private
  public :: make_case

  integer, parameter, public :: n_cases = 47  !! Number of cases.

contains

  !> Make a body of a case.
  subroutine make_case(number, kind, cells, body, name, shape)
    integer, intent(in) :: number  !! Number of the case, 1..n_cases.
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: cells  !! Cells along each edge of a cube.
    type(body_t), intent(out) :: body  !! The body; without elements where the case does not exist for the element kind.
    character(:), allocatable, intent(out) :: name  !! What it is.
    integer, intent(out) :: shape  !! Cases of one number have the same mesh, up to the places of its nodes.
    real(dp), parameter :: poisson(7) = [0.0_dp, 0.3_dp, 0.4_dp, 0.45_dp, 0.47_dp, 0.49_dp, 0.499_dp]
    integer, parameter :: flat(5) = [2, 5, 10, 20, 100], power(3) = [2, 4, 6], ratio(3) = [5, 20, 100]
    type(error_t), allocatable :: error
    character(16) :: text
    integer :: i
    shape = 1
    call make_block(kind, cells, cells, body)
    select case (number)
    case (1:7)
      i = number
      write (text, '(f5.3)') poisson(i)
      name = "Poisson's ratio "//trim(text)
      call move_corners(body, cells, cells, 1, spread(0.15_dp, 1, 3), .true.)
      call body%material(1)%init_isotropic('m', 2.0_dp, poisson(i), error)
      call body%material(1)%project_dilatation()
    case (8:12)
      i = number - 7
      name = 'all cells flat 1:'//digits_of(flat(i))
      body%mesh%x(3, :) = body%mesh%x(3, :)/flat(i)
    case (13:16)
      i = number - 11
      name = 'one layer of cells flat 1:'//digits_of(flat(i))
      call thin_layer(body, cells, flat(i))
    case (17:19)
      i = number - 16
      name = 'needles 1:'//digits_of(10**i)//' among the elements'
      if (i == 3) name = 'needles 1:5 among the elements'
      if (kind == element_tet10) then
        call move_corners(body, cells, cells, 20, [merge(0.8_dp, 1 - 0.1_dp**i, i == 3), 0.0_dp, 0.0_dp], .false.)
      else
        body = no_body()
      end if
    case (20:22)
      i = number - 19
      name = 'modulus 1:1e'//digits_of(power(i))//' in two halves'
      body%material(1)%modulus_formula = 'x > 0.5 ? 1e'//digits_of(power(i))//' : 1'
    case (23:25)
      i = number - 22
      name = 'modulus 1:1e'//digits_of(power(i))//', stiff grains across elements'
      body%material(1)%modulus_formula = 'sin(12*x)*sin(14*y)*sin(13*z) > 0.2 ? 1e'//digits_of(power(i))//' : 1'
    case (26:28)
      i = number - 25
      name = 'modulus 1:1e'//digits_of(power(i))//', graded'
      body%material(1)%modulus_formula = '10^('//digits_of(power(i))//'*x)'
    case (29:31)
      i = number - 28
      name = 'orthotropy '//digits_of(ratio(i))//':1:1'
      call body%material(1)%init_orthotropic('m', [real(ratio(i), dp), 1.0_dp, 1.0_dp], [0.3_dp, 0.3_dp, 0.3_dp], &
        [0.4_dp, 0.4_dp, 0.4_dp], [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp], error)
    case (32:34)
      i = number - 31
      name = 'orthotropy '//digits_of(ratio(i))//':1:1, oblique'
      call body%material(1)%init_orthotropic('m', [real(ratio(i), dp), 1.0_dp, 1.0_dp], [0.3_dp, 0.3_dp, 0.3_dp], &
        [0.4_dp, 0.4_dp, 0.4_dp], [1.0_dp, 0.5_dp, 0.3_dp], [0.0_dp, 1.0_dp, 0.0_dp], error)
    case (35:37)
      i = number - 34
      name = 'orthotropy 1:1:1/'//digits_of(ratio(i))
      call body%material(1)%init_orthotropic('m', [1.0_dp, 1.0_dp, 1.0_dp/ratio(i)], [0.3_dp, 0.3_dp, 0.3_dp], &
        [0.4_dp, 0.4_dp/ratio(i), 0.4_dp/ratio(i)], [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp], error)
    case (38:40)
      call make_plate(number - 37)
      name = 'plate 1:'//digits_of(aspect_of(number - 37))//', held at a side, compact cells'
    case (41:43)
      call make_beam(number - 40)
      name = 'beam 1:'//digits_of(aspect_of(number - 40))//', held at an end, compact cells'
    case (44:46)
      i = number - 43
      name = 'plate 1:'//digits_of(aspect_of(i))//', held at a side, cells flat 1:'//digits_of(aspect_of(i))
      body%mesh%x(3, :) = body%mesh%x(3, :)/aspect_of(i)
      call hold_side(body)
    case default
      name = 'plate 1:30, held below, compact cells'
      call make_block(kind, 5*cells, 2, body)
      shape = 3
    end select

  contains

    !> A plate.
    subroutine make_plate(i)
      integer, intent(in) :: i  !! Number of the aspect ratio.
      integer :: layers, across
      layers = 4 - i
      across = layers*aspect_of(i)*cells/12
      if (i == 3) across = max(across, 8*cells)
      call make_block(kind, across, layers, body)
      body%mesh%x(3, :) = body%mesh%x(3, :)*real(across, dp)/(layers*aspect_of(i))
      call hold_side(body)
      shape = 1 + i
    end subroutine make_plate

    !> A beam.
    subroutine make_beam(i)
      integer, intent(in) :: i  !! Number of the aspect ratio.
      call make_block(kind, max(2, cells/3), max(2, cells/3)*aspect_of(i), body)
      shape = 4 + i
    end subroutine make_beam
  end subroutine make_case

  !> Aspect ratios of plates and beams [].
  pure integer function aspect_of(i) result(aspect)
    integer, intent(in) :: i  !! Number of the ratio, 1..3.
    integer, parameter :: aspects(3) = [10, 30, 100]
    aspect = aspects(i)
  end function aspect_of

  !> A body without elements.
  function no_body() result(body)
    type(body_t) :: body
    body%name = ''
  end function no_body

  !> A number as text.
  function digits_of(number) result(text)
    integer, intent(in) :: number  !! The number.
    character(:), allocatable :: text
    character(12) :: buffer
    write (buffer, '(i0)') number
    text = trim(buffer)
  end function digits_of
end module multigrid_cases
