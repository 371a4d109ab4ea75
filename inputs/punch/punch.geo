// Half of a flat punch with rounded edges and half of the body below it: two deep layers whose faces touch along y = 0; y is up.
// The faces are flat: the rounding is in the gap. Plane strain.
a = 0.6;             // half-width of the flat part
b = 1;               // expected half-width of the contact
D = 100*b;           // depth and half-width of each body
h = b/50;            // element size where they touch
match = 0.8;         // element size on the lower face relative to that on the upper one; 1: the two match
growth = 8*h/b;      // of the element size with the distance from where they touch
order = 2;           // of the elements

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// two bodies; the second one is the mirror image of the first. They may touch up to 1.5 b.
For k In {0:1}
  s = (k == 0) ? 1 : -1;
  p = 10*k;
  Point(p + 1) = {0, 0, 0};    Point(p + 2) = {a, 0, 0};    Point(p + 3) = {1.5*b, 0, 0};
  Point(p + 4) = {D, 0, 0};    Point(p + 5) = {D, s*D, 0};  Point(p + 6) = {0, s*D, 0};
  For i In {1:5}
    Line(p + i) = {p + i, p + i + 1};
  EndFor
  Line(p + 6) = {p + 6, p + 1};
  Curve Loop(k + 1) = {s*(p + 1), s*(p + 2), s*(p + 3), s*(p + 4), s*(p + 5), s*(p + 6)};
  Plane Surface(k + 1) = {k + 1};
  // fine up to 1.2 b, then growing
  Point(p + 7) = {0, 0, 0};
  Point(p + 8) = {1.2*b, 0, 0};
  Line(p + 7) = {p + 7, p + 8};
  Field[p + 1] = Distance;
  Field[p + 1].CurvesList = {p + 7};
  Field[p + 1].NumPointsPerCurve = 500;
  Field[p + 2] = MathEval;
  Field[p + 2].F = Sprintf("%g + %g*F%g", (k == 0) ? h : match*h, growth, p + 1);
  Field[p + 3] = Restrict;
  Field[p + 3].InField = p + 2;
  Field[p + 3].SurfacesList = {k + 1};
  Field[p + 3].CurvesList = {p + 1:p + 6};
EndFor
Field[30] = Min;
Field[30].FieldsList = {3, 13};
Background Field = 30;

Physical Surface("upper") = {1};
Physical Surface("lower") = {2};
Physical Curve("upper face") = {1, 2};
Physical Curve("lower face") = {11, 12};
Physical Curve("top") = {5};
Physical Curve("bottom") = {15};
Physical Curve("middle") = {6, 16};
