// Half of a stiff and of a soft layer; x is along the layers, y up. Lengths in metres. The scene stacks copies of them.
// The soft layer has more elements than the stiff one: the meshes do not match.
w = 0.02;                 // half the width
t = 0.01;                 // thickness
b = 0.01;                 // half the width of the loaded patch
DefineConstant[m = 32];   // elements along half of a stiff layer

Geometry.AutoCoherence = 0;
Mesh.ElementOrder = 2;
Mesh.SecondOrderIncomplete = 1;

// each layer in two parts, under the patch and beside it
For k In {0:1}
  p = 10*k;
  size = (k == 0) ? m : 5*m/4;
  For i In {0:1}
    Point(p + 1 + i) = {0, i*t, 0};
    Point(p + 3 + i) = {b, i*t, 0};
    Point(p + 5 + i) = {w, i*t, 0};
    Line(p + 1 + i) = {p + 1 + i, p + 3 + i};
    Line(p + 3 + i) = {p + 3 + i, p + 5 + i};
  EndFor
  For i In {0:2}
    Line(p + 5 + i) = {p + 1 + 2*i, p + 2 + 2*i};
  EndFor
  Curve Loop(p + 1) = {p + 1, p + 6, -(p + 2), -(p + 5)};
  Curve Loop(p + 2) = {p + 3, p + 7, -(p + 4), -(p + 6)};
  Plane Surface(p + 1) = {p + 1};
  Plane Surface(p + 2) = {p + 2};
  Transfinite Curve {p + 1, p + 2} = Round(size*b/w) + 1;
  Transfinite Curve {p + 3, p + 4} = Round(size*(w - b)/w) + 1;
  Transfinite Curve {p + 5, p + 6, p + 7} = Round(size*t/w/2) + 1;
  Transfinite Surface {p + 1, p + 2};
  Recombine Surface {p + 1, p + 2};
  name = StrChoice(k == 0, "stiff ", "soft ");
  Physical Surface(StrCat(name, "layer")) = {p + 1, p + 2};
  Physical Curve(StrCat(name, "lower face")) = {p + 1, p + 3};
  Physical Curve(StrCat(name, "upper face")) = {p + 2, p + 4};
  Physical Curve(StrCat(name, "patch")) = {p + 2};
  Physical Curve(StrCat(name, "middle")) = {p + 5};
  Physical Curve(StrCat(name, "end")) = {p + 7};
EndFor
