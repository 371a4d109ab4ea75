// A cylindrical roller bearing in its plane: inner ring, 12 rollers, outer ring, all of them touching. Roller 1 is the lowest,
// the others follow counter-clockwise. The right half is drawn and meshed; the left half is its mirror image. Millimetres.
bore = 8;            // radius of the bore: the inner ring is in one piece with a hollow shaft
pitch = 35;          // radius of the circle of the rollers' centres
r = 6;               // radius of a roller
outside = 50;        // outer radius
b = 0.23;            // expected half-width of the most loaded contact
h = b/4;             // element size where they touch
H = r/3;             // element size far away

Mesh.ElementOrder = 2;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// half of each circle, through the contact points on the races; i = 0 is the lowest point, i = 6 the highest
Point(1) = {0, 0, 0};
race() = {bore, pitch - r, pitch + r, outside};
For k In {0:3}
  For i In {0:6}
    Point(100*(k + 1) + i) = {race(k)*Sin(i*Pi/6), -race(k)*Cos(i*Pi/6), 0};
  EndFor
  For i In {1:6}
    Circle(100*(k + 1) + i) = {100*(k + 1) + i - 1, 1, 100*(k + 1) + i};
  EndFor
EndFor
// half rings
For k In {1:3:2}
  p = 100*k;
  Line(p + 7) = {p, p + 100};
  Line(p + 8) = {p + 106, p + 6};
  Curve Loop(k) = {p + 7, p + 101:p + 106, p + 8, -(p + 6), -(p + 5), -(p + 4), -(p + 3), -(p + 2), -(p + 1)};
  Plane Surface(k) = {k};
EndFor

// rollers, and half of the lowest and of the highest one: centre, and points every 90 degrees from the one that is outermost
For i In {0:6}
  p = 500 + 10*i;
  x = pitch*Sin(i*Pi/6);
  y = -pitch*Cos(i*Pi/6);
  Point(p + 4) = {x, y, 0};
  For j In {0:3}
    t = (i - 3)*Pi/6 + j*Pi/2;
    Point(p + j) = {x + r*Cos(t), y + r*Sin(t), 0};
  EndFor
  first = (i == 6) ? 2 : 0;
  last = (i == 0) ? 1 : 3;
  For j In {first:last}
    Circle(p + j) = {p + j, p + 4, p + (j + 1) % 4};
  EndFor
  If (i == 0)
    Line(p + 2) = {p + 2, p};
  ElseIf (i == 6)
    Line(p + 1) = {p, p + 2};
    first = 1;
  EndIf
  Curve Loop(10 + i) = {p + first:p + ((i == 0) ? 2 : 3)};
  Plane Surface(10 + i) = {10 + i};
EndFor

// the left half, with the mirror images of the meshes
right() = {1, 3, 10:16};
left() = Symmetry {1, 0, 0, 0} { Duplicata { Surface{right()}; } };
Periodic Surface {left()} = {right()} Affine {-1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1};
ReverseMesh Surface {left()};

// fine where they touch
Field[1] = Distance;
Field[1].PointsList = {200:206, 300:306};
Field[2] = Threshold;
Field[2].InField = 1;
Field[2].SizeMin = h;
Field[2].SizeMax = H;
Field[2].DistMin = 1.4*b;
Field[2].DistMax = 0.6*r;
Background Field = 2;

Physical Surface("inner ring") = {right(0), left(0)};
Physical Surface("outer ring") = {right(1), left(1)};
Physical Surface("roller 1") = {right(2), left(2)};
Physical Surface("roller 7") = {right(8), left(8)};
For i In {2:6}
  Physical Surface(Sprintf("roller %g", i)) = {right(i + 1)};
  Physical Surface(Sprintf("roller %g", 14 - i)) = {left(i + 1)};
EndFor
Physical Curve("rolling surface") = CombinedBoundary{ Surface{right({2:8}), left({2:8})}; };
// The boundary of a half ring: a cut, the six arcs of its outer circle, a cut, the six arcs of its inner circle.
inner() = {Abs(Boundary{ Surface{right(0)}; }), Abs(Boundary{ Surface{left(0)}; })};
outer() = {Abs(Boundary{ Surface{right(1)}; }), Abs(Boundary{ Surface{left(1)}; })};
Physical Curve("bore") = inner({8:13, 22:27});
Physical Curve("inner race") = inner({1:6, 15:20});
Physical Curve("outer race") = outer({8:13, 22:27});
Physical Curve("housing") = outer({1:6, 15:20});
