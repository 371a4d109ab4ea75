// The rings of a deep groove ball bearing (35 x 72 x 17), half of them, above the plane of symmetry z = 0. Millimetres.
SetFactory("OpenCASCADE");
R = 5.5;                  // radius of the balls
pitch = 26.75;            // radius of the circle of their centres
groove = 1.04*R;          // radius of the grooves: an osculation of 52 %
bore = 17.5; outside = 36; width = 8.5;
shoulder() = {24, 29.5};  // radii of the rings beside the grooves
a = 2.1; b = 0.24;        // expected half-axes of the most loaded contact, along the axis of the bearing and along the race
DefineConstant[n = 2.4];  // elements over b
h = b/n;                  // their size
H = 3;                    // size of the largest elements
g = 0.7;                  // growth of the sizes with the distance from the contacts

Mesh.ElementOrder = 2;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// profiles of the inner (i = 0) and of the outer ring (i = 1): the far face, the bottom of the groove, its edge, the width
far() = {bore, outside};
bottom() = {pitch - R, pitch + R};
centre() = {pitch - R + groove, pitch + R - groove};
For i In {0:1}
  p = 10*i;
  z = Sqrt(groove^2 - (centre(i) - shoulder(i))^2);
  Point(p + 1) = {far(i), 0, 0};
  Point(p + 2) = {bottom(i), 0, 0};
  Point(p + 3) = {shoulder(i), 0, z};
  Point(p + 4) = {shoulder(i), 0, width};
  Point(p + 5) = {far(i), 0, width};
  Point(p + 6) = {centre(i), 0, 0};
  Line(p + 1) = {p + 1, p + 2};
  Circle(p + 2) = {p + 2, p + 6, p + 3};
  Line(p + 3) = {p + 3, p + 4};
  Line(p + 4) = {p + 4, p + 5};
  Line(p + 5) = {p + 5, p + 1};
  Curve Loop(p + 1) = {p + 1:p + 5};
  Plane Surface(p + 1) = {p + 1};
EndFor
// Volume, then the surfaces that the five lines sweep.
inner() = Extrude { {0, 0, 1}, {0, 0, 0}, 2*Pi } { Surface{1}; };
outer() = Extrude { {0, 0, 1}, {0, 0, 0}, 2*Pi } { Surface{11}; };

// h near the contacts, every 45 degrees: along the race, across it, and in depth
quarter = "(2*((x^2 - y^2)/(x^2 + y^2))^2 - 1)";
along = StrCat("Sqrt(x^2 + y^2)/8*Acos(Max(-1, Min(1, 2*", quarter, "^2 - 1)))");
depth = "Abs(Sqrt((Sqrt(x^2 + y^2) - %g)^2 + z^2) - %g)";
Field[1] = MathEval;
Field[1].F = StrCat(Sprintf("Min(%g, %g + %g*Sqrt(", H, h, g),
                    "Max(0, ", along, Sprintf(" - %g)^2 + Max(0, z - %g)^2", b, 0.9*a),
                    " + Min(", Sprintf(depth, centre(0), groove), ", ", Sprintf(depth, centre(1), groove), ")^2))");
Background Field = 1;

Physical Volume("inner ring") = {inner(1)};
Physical Volume("outer ring") = {outer(1)};
Physical Surface("cut") = {inner(2), outer(2)};
Physical Surface("inner race") = {inner(3)};
Physical Surface("outer race") = {outer(3)};
Physical Surface("bore") = {inner(6)};
Physical Surface("housing") = {outer(6)};
