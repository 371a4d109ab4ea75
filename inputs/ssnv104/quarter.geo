// A quarter of the two hemispheres in three dimensions; z is up, they touch at the origin. Lengths in millimetres.
R = 50;
a = 10;                      // expected contact radius
DefineConstant[n = 8];       // elements over it
DefineConstant[s = 2];       // how fast they grow: by s at a distance of n elements
order = 2;                   // of the elements
h = a/n;                     // their size where they touch
g = s*h/a;
H = R/5;                     // the largest
c = 1.5*a;                   // radius of the zone that may touch

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

For i In {0:1}               // below, above: centre, pole, edge of the cap that may touch, equator
  p = 10*i;
  s = 2*i - 1;
  z = s*(R - Sqrt(R*R - c*c));
  Point(p + 1) = {0, 0, s*R};
  Point(p + 2) = {0, 0, 0};
  Point(p + 3) = {c, 0, z};
  Point(p + 4) = {0, c, z};
  Point(p + 5) = {R, 0, s*R};
  Point(p + 6) = {0, R, s*R};
  Point(p + 7) = {0, 0, z};
  Circle(p + 1) = {p + 2, p + 1, p + 3};
  Circle(p + 2) = {p + 3, p + 7, p + 4};
  Circle(p + 3) = {p + 4, p + 1, p + 2};
  Circle(p + 4) = {p + 3, p + 1, p + 5};
  Circle(p + 5) = {p + 5, p + 1, p + 6};
  Circle(p + 6) = {p + 6, p + 1, p + 4};
  Line(p + 7) = {p + 2, p + 1};
  Line(p + 8) = {p + 1, p + 5};
  Line(p + 9) = {p + 6, p + 1};
  Curve Loop(p + 1) = {p + 1, p + 2, p + 3};           Surface(p + 1) = {p + 1} In Sphere {p + 1};
  Curve Loop(p + 2) = {p + 4, p + 5, p + 6, -p - 2};   Surface(p + 2) = {p + 2} In Sphere {p + 1};
  Curve Loop(p + 3) = {p + 7, p + 8, -p - 4, -p - 1};  Plane Surface(p + 3) = {p + 3};
  Curve Loop(p + 4) = {p + 9, -p - 7, -p - 3, -p - 6}; Plane Surface(p + 4) = {p + 4};
  Curve Loop(p + 5) = {p + 8, p + 5, p + 9};           Plane Surface(p + 5) = {p + 5};
  Surface Loop(i + 1) = {p + 1:p + 5};
  Volume(i + 1) = {i + 1};
EndFor

// h where they touch; it grows with the distance from there
Field[1] = MathEval;
Field[1].F = Sprintf("Min(%g, %g + %g*Sqrt(z^2 + Max(0, Sqrt(x^2 + y^2) - %g)^2))", H, h, g, 1.2*a);
Background Field = 1;

Physical Volume("lower") = {1};
Physical Volume("upper") = {2};
Physical Surface("lower face") = {1};
Physical Surface("upper face") = {11};
Physical Surface("bottom") = {5};
Physical Surface("top") = {15};
Physical Surface("plane x") = {4, 14};
Physical Surface("plane y") = {3, 13};
