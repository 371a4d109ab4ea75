!> The script that gmsh reads after a CAD file: element sizes, and the physical groups `solid 1`, `solid 2`, ... and
!> `face 1`, `face 2`, ..., numbered as gmsh does.
module dotyk_mesh_cad_script
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: cad_script

  !> Elements along the largest extent of a solid, where no size is given, and around a circle.
  integer, parameter :: along_solid = 12, around_circle = 16

contains

  !> The script.
  function cad_script(size, order) result(text)
    !> Size of the elements away from curved faces; not positive: a fraction of each solid [length].
    real(dp), intent(in) :: size
    !> Order of the elements, 1 or 2.
    integer, intent(in) :: order
    character(:), allocatable :: text
    character, parameter :: lf = new_line('a')
    text = 'Mesh.ElementOrder = '//to_text(order)//';'//lf// &
      ! Quadratic elements at curved faces must not be inverted.
      'Mesh.HighOrderOptimize = '//to_text(merge(2, 0, order > 1))//';'//lf// &
      'Mesh.MeshSizeFromCurvature = '//to_text(around_circle)//';'//lf// &
      'solid() = Volume{:};'//lf// &
      'For i In {0:#solid()-1}'//lf// &
      '  Physical Volume(Sprintf("solid %g", solid(i))) = {solid(i)};'//lf
    if (size > 0) then
      text = text//'EndFor'//lf//'Mesh.MeshSizeMax = '//to_text(size, 17)//';'//lf
    else
      text = text//'  box() = BoundingBox Volume{solid(i)};'//lf// &
        '  size = box(3) - box(0);'//lf// &
        '  For k In {1:2}'//lf// &
        '    size = (box(3+k) - box(k) > size) ? box(3+k) - box(k) : size;'//lf// &
        '  EndFor'//lf// &
        '  MeshSize{ PointsOf{ Volume{solid(i)}; } } = size/'//to_text(along_solid)//';'//lf// &
        'EndFor'//lf
    end if
    text = text//'face() = Surface{:};'//lf// &
      'For i In {0:#face()-1}'//lf// &
      '  Physical Surface(Sprintf("face %g", face(i))) = {face(i)};'//lf// &
      'EndFor'//lf
  end function cad_script
end module dotyk_mesh_cad_script
