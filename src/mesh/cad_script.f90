!> The script that gmsh reads after a CAD file: element sizes, and the physical groups `solid 1`, `solid 2`, ... and
!> `face 1`, `face 2`, ..., numbered as gmsh does; and solids by their names in the file, with numbers where several
!> have the same. Before it, for an STL file, the script that makes solids of its triangles: they become faces, divided
!> at sharp edges and so that each can be meshed anew; each closed surface is a solid.
module dotyk_mesh_cad_script
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: cad_script, script_of_solid, sharp

  !> Elements along the largest extent of a solid, where no size is given, and around a circle; half as many on a mesh
  !> that others follow.
  integer, parameter :: most_along = 12, most_around = 16
  integer, parameter :: most_along_solid = 1000  !! More elements along a solid are a mistake: gmsh would take hours.
  integer, parameter :: most_named = 1000  !! Solids beyond which names are not read: they are compared with each other.

  !> Angle at which faces meet in an edge [degrees], as in contact surfaces of meshes without faces.
  integer, parameter :: sharp = 40

contains

  !> The script.
  function cad_script(size, order, of_triangles, is_first) result(text)
    real(dp), intent(in) :: size  !! Size away from curved faces; not positive: a fraction of each solid [length].
    integer, intent(in) :: order  !! Order of the elements, 1 or 2.
    logical, intent(in) :: of_triangles  !! Whether the file is an STL file.
    logical, intent(in) :: is_first  !! Whether other meshes follow, with sizes by the errors of this one.
    character(:), allocatable :: text, beginning, unit
    character, parameter :: lf = new_line('a')
    integer :: along_solid, around_circle
    along_solid = merge(most_along/2, most_along, is_first)
    around_circle = merge(most_around/2, most_around, is_first)
    beginning = ''
    unit = ' mm: lengths are in mm'
    if (of_triangles) then
      ! Curvature is in the edges of triangles only; mid-side nodes stay on their chords.
      beginning = 'Mesh.SecondOrderLinear = 1;'//lf//stl_script()
      unit = ''
    end if
    text = beginning//'Mesh.ElementOrder = '//to_text(order)//';'//lf// &
      ! Sizes by curvature keep quadratic elements at curved faces from being inverted; more than a simple optimization
      ! takes most of the time of meshing and repairs little.
      'Mesh.HighOrderOptimize = '//to_text(merge(1, 0, order > 1))//';'//lf// &
      'Mesh.MeshSizeFromCurvature = '//to_text(merge(0, around_circle, of_triangles))//';'//lf// &
      'solid() = Volume{:};'//lf// &
      'If (#solid() == 0)'//lf// &
      '  Error("the file has no solids");'//lf// &
      '  Exit;'//lf// &
      'EndIf'//lf// &
      'For i In {0:#solid()-1}'//lf// &
      '  Physical Volume(Sprintf("solid %g", solid(i))) = {solid(i)};'//lf// &
      '  box() = BoundingBox Volume{solid(i)};'//lf// &
      '  extent = box(3) - box(0);'//lf// &
      '  For k In {1:2}'//lf// &
      '    extent = (box(3+k) - box(k) > extent) ? box(3+k) - box(k) : extent;'//lf// &
      '  EndFor'//lf
    if (size > 0) then
      text = text//'  If (extent > '//to_text(most_along_solid)//'*'//to_text(size, 17)//')'//lf// &
        '    Error("mesh_size is less than 1/'//to_text(most_along_solid)// &
        ' of the extent of solid %g, %g'//unit//'", solid(i), extent);'//lf// &
        '    Exit;'//lf// &
        '  EndIf'//lf// &
        'EndFor'//lf// &
        'Mesh.MeshSizeMax = '//to_text(size, 17)//';'//lf
    else if (of_triangles) then
      ! Sizes at points do not reach the inside of faces of triangles.
      text = text//'  Field[i+1] = Box;'//lf//'  Field[i+1].VIn = extent/'//to_text(along_solid)//';'//lf// &
        '  Field[i+1].VOut = 1e22;'//lf// &
        '  Field[i+1].XMin = box(0) - extent/100;  Field[i+1].XMax = box(3) + extent/100;'//lf// &
        '  Field[i+1].YMin = box(1) - extent/100;  Field[i+1].YMax = box(4) + extent/100;'//lf// &
        '  Field[i+1].ZMin = box(2) - extent/100;  Field[i+1].ZMax = box(5) + extent/100;'//lf// &
        'EndFor'//lf// &
        'all = #solid() + 1;'//lf// &
        'Field[all] = Min;'//lf// &
        'Field[all].FieldsList = {1:#solid()};'//lf// &
        'Background Field = all;'//lf
    else
      text = text//'  MeshSize{ PointsOf{ Volume{solid(i)}; } } = extent/'//to_text(along_solid)//';'//lf// 'EndFor'//lf
    end if
    if (.not. of_triangles) text = text//names_of_solids()
    text = text//'face() = Surface{:};'//lf// &
      'For i In {0:#face()-1}'//lf// &
      '  Physical Surface(Sprintf("face %g", face(i))) = {face(i)};'//lf// &
      'EndFor'//lf
  end function cad_script

  !> Groups of the solids by their names in the file: the last part of gmsh's label, `Shapes/Assembly/Bolt`. Names that
  !> translators make up are none, nor are those that look like numbers of solids.
  function names_of_solids() result(text)
    character(:), allocatable :: text
    character, parameter :: lf = new_line('a')
    text = 'For i In {0:#solid()-1}'//lf// &
      '  name = Str(StrRelative(StrCat("/", Volume{solid(i)})));'//lf// &
      '  same = 0; place = 0;'//lf// &
      '  If (StrLen(name) > 0 && #solid() <= '//to_text(most_named)//')'//lf// &
      '    For k In {0:#solid()-1}'//lf// &
      '      If (StrCmp(StrRelative(StrCat("/", Volume{solid(k)})), name) == 0)'//lf// &
      '        same += 1;'//lf// &
      '        place = (k <= i) ? same : place;'//lf// &
      '      EndIf'//lf// &
      '    EndFor'//lf// &
      '  EndIf'//lf// &
      '  If (same > 1)'//lf// &
      '    name = Str(StrCat(name, Sprintf(" %g", place)));'//lf// &
      '    For k In {0:#solid()-1}'//lf// &
      '      If (StrCmp(StrRelative(StrCat("/", Volume{solid(k)})), name) == 0)'//lf// &
      '        same = 0;'//lf// &
      '      EndIf'//lf// &
      '    EndFor'//lf// &
      '  EndIf'//lf// &
      '  If (same > 0 && StrFind(name, "Open CASCADE") == 0 && StrFind(name, "solid ") == 0)'//lf// &
      '    Physical Volume(Str(name)) = {solid(i)};'//lf// &
      '  EndIf'//lf// &
      'EndFor'//lf
  end function names_of_solids

  !> What comes before the script for one solid alone.
  function script_of_solid(number) result(text)
    integer, intent(in) :: number  !! Its number in the file, from 1.
    character(:), allocatable :: text
    character, parameter :: lf = new_line('a')
    text = 'solid() = Volume{:};'//lf// &
      'If (#solid() < '//to_text(number)//')'//lf// &
      '  Error("no more solids");'//lf// &
      '  Exit;'//lf// &
      'EndIf'//lf// &
      'For i In {0:#solid()-1}'//lf// &
      '  If (i != '//to_text(number - 1)//')'//lf// &
      '    Recursive Delete { Volume{solid(i)}; }'//lf// &
      '  EndIf'//lf// &
      'EndFor'//lf
  end function script_of_solid

  !> The script.
  function stl_script() result(text)
    character(:), allocatable :: text
    character, parameter :: lf = new_line('a')
    text = 'ClassifySurfaces{'//to_text(sharp)//'*Pi/180, 1, 1, Pi};'//lf// &
      'CreateGeometry;'//lf// &
      'f() = Surface{:};'//lf// &
      'n = #f();'//lf// &
      'If (n == 0)'//lf// &
      '  Error("the file has no triangles");'//lf// &
      '  Exit;'//lf// &
      'EndIf'//lf// &
      'For i In {0:n-1}'//lf// &
      '  b~{i}() = Abs(Boundary{ Surface{f(i)}; });'//lf// &
      '  label~{i} = i;'//lf// &
      'EndFor'//lf// &
      ! Faces that share curves get one label, the least of their numbers.
      'changed = 1;'//lf// &
      'For pass In {0:n}'//lf// &
      '  If (changed)'//lf// &
      '    changed = 0;'//lf// &
      '    For i In {0:n-1}'//lf// &
      '      For j In {0:#b~{i}()-1}'//lf// &
      '        c = b~{i}(j);'//lf// &
      '        If (!Exists(least~{c}))'//lf// &
      '          least~{c} = label~{i};'//lf// &
      '        EndIf'//lf// &
      '        If (least~{c} > label~{i})'//lf// &
      '          least~{c} = label~{i};'//lf// &
      '          changed = 1;'//lf// &
      '        EndIf'//lf// &
      '        If (label~{i} > least~{c})'//lf// &
      '          label~{i} = least~{c};'//lf// &
      '          changed = 1;'//lf// &
      '        EndIf'//lf// &
      '      EndFor'//lf// &
      '    EndFor'//lf// &
      '  EndIf'//lf// &
      'EndFor'//lf// &
      'v = 0;'//lf// &
      'For i In {0:n-1}'//lf// &
      '  If (label~{i} == i)'//lf// &
      '    v += 1;'//lf// &
      '    own() = {};'//lf// &
      '    For k In {0:n-1}'//lf// &
      '      If (label~{k} == i)'//lf// &
      '        own() += f(k);'//lf// &
      '      EndIf'//lf// &
      '    EndFor'//lf// &
      '    Surface Loop(v) = own();'//lf// &
      '    Volume(v) = {v};'//lf// &
      '    box~{v}() = BoundingBox Volume{v};'//lf// &
      '  EndIf'//lf// &
      'EndFor'//lf// &
      ! A cavity, or a part inside of another: the file does not say which.
      'For i In {1:v}'//lf// &
      '  For k In {1:v}'//lf// &
      '    inside = i != k;'//lf// &
      '    For c In {0:2}'//lf// &
      '      inside = inside && box~{i}(c) >= box~{k}(c) && box~{i}(c+3) <= box~{k}(c+3);'//lf// &
      '    EndFor'//lf// &
      '    If (inside)'//lf// &
      '      Error("closed surface %g lies in the box of closed surface %g, a part or a cavity: write a file for '// &
      'each part, or a .geo file", i, k);'//lf// &
      '      Exit;'//lf// &
      '    EndIf'//lf// &
      '  EndFor'//lf// &
      'EndFor'//lf
  end function stl_script
end module dotyk_mesh_cad_script
