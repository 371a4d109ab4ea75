// A quarter of a ball between two thick plates; z is up, the lower plate ends at z = 0. Lengths in metres.
R = 0.01;            // radius of the ball
L = 0.01;            // half the edge of the plates, and their thickness
a = 0.0005;          // expected contact radius
DefineConstant[n = 8];    // elements over it
DefineConstant[s = 2.5];  // how fast they grow: by s at a distance of n elements
order = 2;           // of the elements
h = a/n;             // their size where they touch
g = s*h/a;
H = R/3;             // the largest
c = 2*a;             // radius of the zones that may touch

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// ball: centre, equator, and below (i = 0) and above (i = 1) the pole and the cap that may touch
z = Sqrt(R*R - c*c);
Point(1) = {0, 0, R};
Point(2) = {R, 0, R};
Point(3) = {0, R, R};
Circle(1) = {2, 1, 3};
For i In {0:1}
  p = 10*(i + 1);
  s = 2*i - 1;
  Point(p + 1) = {0, 0, R + s*R};
  Point(p + 2) = {c, 0, R + s*z};
  Point(p + 3) = {0, c, R + s*z};
  Point(p + 4) = {0, 0, R + s*z};
  Circle(p + 1) = {p + 1, 1, p + 2};
  Circle(p + 2) = {p + 2, p + 4, p + 3};
  Circle(p + 3) = {p + 3, 1, p + 1};
  Circle(p + 4) = {p + 2, 1, 2};
  Circle(p + 5) = {3, 1, p + 3};
  Curve Loop(p + 1) = {p + 1, p + 2, p + 3};        Surface(p + 1) = {p + 1} In Sphere {1};
  Curve Loop(p + 2) = {p + 4, 1, p + 5, -(p + 2)};  Surface(p + 2) = {p + 2} In Sphere {1};
EndFor
Line(2) = {21, 11};
Curve Loop(1) = {11, 14, -24, -21, 2};              Plane Surface(1) = {1};
Curve Loop(2) = {-13, -15, 25, 23, 2};              Plane Surface(2) = {2};
Surface Loop(1) = {1, 2, 11, 12, 21, 22};
Volume(1) = {1};

// plates: the face towards the ball (its centre, the zone that may touch, corners), the face away from it
For i In {0:1}
  p = 100*(i + 1);
  z = 2*R*i;
  Point(p + 1) = {0, 0, z};
  Point(p + 2) = {c, 0, z};
  Point(p + 3) = {0, c, z};
  Point(p + 4) = {L, 0, z};
  Point(p + 5) = {L, L, z};
  Point(p + 6) = {0, L, z};
  z += (2*i - 1)*L;
  Point(p + 7) = {0, 0, z};
  Point(p + 8) = {L, 0, z};
  Point(p + 9) = {L, L, z};
  Point(p + 10) = {0, L, z};
  Line(p + 1) = {p + 1, p + 2};
  Circle(p + 2) = {p + 2, p + 1, p + 3};
  Line(p + 3) = {p + 3, p + 1};
  Line(p + 4) = {p + 2, p + 4};
  Line(p + 5) = {p + 4, p + 5};
  Line(p + 6) = {p + 5, p + 6};
  Line(p + 7) = {p + 6, p + 3};
  Line(p + 8) = {p + 7, p + 8};
  Line(p + 9) = {p + 8, p + 9};
  Line(p + 10) = {p + 9, p + 10};
  Line(p + 11) = {p + 10, p + 7};
  Line(p + 12) = {p + 1, p + 7};
  Line(p + 13) = {p + 4, p + 8};
  Line(p + 14) = {p + 5, p + 9};
  Line(p + 15) = {p + 6, p + 10};
  Curve Loop(p + 1) = {p + 1, p + 2, p + 3};                                 Plane Surface(p + 1) = {p + 1};
  Curve Loop(p + 2) = {p + 4, p + 5, p + 6, p + 7, -(p + 2)};                Plane Surface(p + 2) = {p + 2};
  Curve Loop(p + 3) = {p + 8, p + 9, p + 10, p + 11};                        Plane Surface(p + 3) = {p + 3};
  Curve Loop(p + 4) = {p + 1, p + 4, p + 13, -(p + 8), -(p + 12)};           Plane Surface(p + 4) = {p + 4};
  Curve Loop(p + 5) = {p + 3, p + 12, -(p + 11), -(p + 15), p + 7};          Plane Surface(p + 5) = {p + 5};
  Curve Loop(p + 6) = {p + 5, p + 14, -(p + 9), -(p + 13)};                  Plane Surface(p + 6) = {p + 6};
  Curve Loop(p + 7) = {p + 6, p + 15, -(p + 10), -(p + 14)};                 Plane Surface(p + 7) = {p + 7};
  Surface Loop(p + 1) = {p + 1:p + 7};
  Volume(p + 1) = {p + 1};
EndFor

// h where they touch; it grows with the distance from there, in depth too
Field[1] = MathEval;
Field[1].F = Sprintf("Min(%g, %g + %g*Sqrt(Min(Abs(z), Abs(z - %g))^2 + Max(0, Sqrt(x^2 + y^2) - %g)^2))", H, h, g, 2*R, 1.2*a);
Background Field = 1;

Physical Volume("ball") = {1};
Physical Volume("lower plate") = {101};
Physical Volume("upper plate") = {201};
Physical Surface("lower cap") = {11};
Physical Surface("upper cap") = {21};
Physical Surface("towards the ball") = {101, 201};
Physical Surface("ground") = {103};
Physical Surface("top") = {203};
Physical Surface("plane x") = {2, 105, 205};
Physical Surface("plane y") = {1, 104, 204};
