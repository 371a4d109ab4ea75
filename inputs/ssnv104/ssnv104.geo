// Two hemispheres of radius 50 mm, axisymmetric: x is the radius, y is up, they touch at the origin. And a flat plate at y <= 0, for
// the half of it: the upper hemisphere on its plane of symmetry.
R = 50;
a = 10;                      // expected contact radius
DefineConstant[n = 40];      // elements over it
DefineConstant[s = 4];       // how fast they grow: by s at a distance of n elements
order = 2;                   // of the elements
h = a/n;                     // their size where they touch
g = s*h/a;
H = R/20;                    // the largest
c = 1.5*a;                   // radius of the zone that may touch

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

For i In {0:1}               // below, above
  p = 10*i;
  s = 2*i - 1;
  Point(p + 1) = {0, s*R, 0};
  Point(p + 2) = {0, 0, 0};
  Point(p + 3) = {c, s*(R - Sqrt(R*R - c*c)), 0};
  Point(p + 4) = {R, s*R, 0};
  Circle(p + 1) = {p + 2, p + 1, p + 3};
  Circle(p + 2) = {p + 3, p + 1, p + 4};
  Line(p + 3) = {p + 4, p + 1};
  Line(p + 4) = {p + 1, p + 2};
  Curve Loop(i + 1) = {p + 1:p + 4};
  Plane Surface(i + 1) = {i + 1};
EndFor

// plate
t = 3;
Point(21) = {0, 0, 0};
Point(22) = {1.2*c, 0, 0};
Point(23) = {1.2*c, -t, 0};
Point(24) = {0, -t, 0};
Line(21) = {21, 22};
Line(22) = {22, 23};
Line(23) = {23, 24};
Line(24) = {24, 21};
Curve Loop(3) = {21:24};
Plane Surface(3) = {3};

// h where they touch; it grows with the distance from there
Field[1] = MathEval;
Field[1].F = Sprintf("Min(%g, %g + %g*Sqrt(y^2 + Max(0, x - %g)^2))", H, h, g, 1.2*a);
Background Field = 1;

Physical Surface("lower") = {1};
Physical Surface("upper") = {2};
Physical Surface("plate") = {3};
Physical Curve("lower face") = {1};
Physical Curve("upper face") = {11};
Physical Curve("plate face") = {21};
Physical Curve("bottom") = {3, 23};
Physical Curve("top") = {13};
Physical Curve("axis") = {4, 14, 24};
