// Half a period of two deep layers with a row of grooves; they touch along y = 0, y is up. The faces are flat: grooves are in the gap.
b = 1;               // half-width of the groove
L = 2*b;             // half the distance to the next groove: the sides are smooth walls
D = 12*b;            // depth of each layer
h = b/50;            // element size on the groove
match = 0.8;         // element size on the lower face relative to that on the upper one; 1: the two match
growth = 8*h/b;      // of the element size with the distance from the groove
order = 2;           // of the elements

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// two layers; the second one is the mirror image of the first
For k In {0:1}
  s = (k == 0) ? 1 : -1;
  p = 10*k;
  Point(p + 1) = {0, 0, 0};    Point(p + 2) = {b, 0, 0};    Point(p + 3) = {L, 0, 0};
  Point(p + 4) = {L, s*D, 0};  Point(p + 5) = {0, s*D, 0};
  For i In {1:4}
    Line(p + i) = {p + i, p + i + 1};
  EndFor
  Line(p + 5) = {p + 5, p + 1};
  Curve Loop(k + 1) = {s*(p + 1), s*(p + 2), s*(p + 3), s*(p + 4), s*(p + 5)};
  Plane Surface(k + 1) = {k + 1};
  // fine up to 1.2 b, then growing
  Point(p + 6) = {0, 0, 0};
  Point(p + 7) = {1.2*b, 0, 0};
  Line(p + 6) = {p + 6, p + 7};
  Field[p + 1] = Distance;
  Field[p + 1].CurvesList = {p + 6};
  Field[p + 1].NumPointsPerCurve = 500;
  Field[p + 2] = MathEval;
  Field[p + 2].F = Sprintf("%g + %g*F%g", (k == 0) ? h : match*h, growth, p + 1);
  Field[p + 3] = Restrict;
  Field[p + 3].InField = p + 2;
  Field[p + 3].SurfacesList = {k + 1};
  Field[p + 3].CurvesList = {p + 1:p + 5};
EndFor
Field[30] = Min;
Field[30].FieldsList = {3, 13};
Background Field = 30;

Physical Surface("upper") = {1};
Physical Surface("lower") = {2};
Physical Curve("upper face") = {1, 2};
Physical Curve("lower face") = {11, 12};
Physical Curve("top") = {4};
Physical Curve("bottom") = {14};
Physical Curve("sides") = {3, 5, 13, 15};
