!> The script that makes solids of an STL file, which gmsh reads after the file and before that of
!> `dotyk_mesh_cad_script`: the triangles become faces, divided at sharp edges and so that each can be meshed anew; each
!> closed surface is a solid.
module dotyk_mesh_stl_script
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: sharp, stl_script

  !> Angle at which faces meet in an edge [degrees], as in contact surfaces of meshes without faces.
  integer, parameter :: sharp = 40

contains

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
end module dotyk_mesh_stl_script
