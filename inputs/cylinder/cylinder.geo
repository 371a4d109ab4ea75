// Half of the lower half of a cylinder on half of a block; y is up, they touch at the origin. Plane strain, millimetres.
R = 50;              // radius of the cylinder
D = 100;             // depth and half-width of the block
b = 1;               // expected half-width of the contact
h = b/20;            // element size where they touch
match = 0.8;         // element size of the block there relative to that of the cylinder
growth = 3.2*h/b;    // of the element size with the distance from where they touch
order = 2;           // of the elements

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// cylinder: centre, lowest point, end of what may touch, side
c = 2*b;
Point(1) = {0, R, 0};
Point(2) = {0, 0, 0};
Point(3) = {c, R - Sqrt(R*R - c*c), 0};
Point(4) = {R, R, 0};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Line(3) = {4, 1};
Line(4) = {1, 2};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

// block
Point(11) = {0, 0, 0};   Point(12) = {1.1*c, 0, 0};   Point(13) = {D, 0, 0};   Point(14) = {D, -D, 0};   Point(15) = {0, -D, 0};
Line(11) = {11, 12};  Line(12) = {12, 13};  Line(13) = {13, 14};  Line(14) = {14, 15};  Line(15) = {15, 11};
Curve Loop(2) = {-15, -14, -13, -12, -11};
Plane Surface(2) = {2};

// fine up to 1.2 b, then growing
For k In {0:1}
  p = 20 + 10*k;
  Point(p + 1) = {0, 0, 0};
  Point(p + 2) = {1.2*b, 0, 0};
  Line(p + 1) = {p + 1, p + 2};
  Field[p + 1] = Distance;
  Field[p + 1].CurvesList = {p + 1};
  Field[p + 1].NumPointsPerCurve = 500;
  Field[p + 2] = MathEval;
  Field[p + 2].F = Sprintf("%g + %g*F%g", (k == 0) ? h : match*h, growth, p + 1);
  Field[p + 3] = Restrict;
  Field[p + 3].InField = p + 2;
  Field[p + 3].SurfacesList = {k + 1};
  Field[p + 3].CurvesList = {10*k + 1:11*k + 4};
EndFor
Field[40] = Min;
Field[40].FieldsList = {23, 33};
Background Field = 40;

Physical Surface("cylinder") = {1};
Physical Surface("block") = {2};
Physical Curve("low") = {1};
Physical Curve("cut") = {3};
Physical Curve("up") = {11};
Physical Curve("bottom") = {14};
Physical Curve("plane x") = {4, 15};
