// A segment of a tunnel's lining, the sixth part of a ring; the axis of the tunnel is z. Lengths in metres.
a = 2.5;                  // radius inside
b = 2.8;                  // and outside
w = 1.5;                  // width of a ring
DefineConstant[n = 3];    // elements through the lining
order = 2;                // of the elements

Mesh.ElementOrder = order;
Mesh.SecondOrderIncomplete = 1;
c = Cos(Pi/6);
Point(1) = {c*a, -a/2, 0};
line() = Extrude {c*(b - a), -(b - a)/2, 0} { Point{1}; Layers{n}; };

// in three parts around: the ground holds the one in the middle
start = line(1);
For i In {1:3}
  face() = Extrude {{0, 0, 1}, {0, 0, 0}, Pi/9} { Curve{start}; Layers{Ceil(4*n/3)}; Recombine; };
  body() = Extrude {0, 0, w} { Surface{face(1)}; Layers{2*n}; Recombine; };
  start = face(0);
  front(i) = face(1);
  back(i) = body(0);
  part(i) = body(1);
  If (i == 1)
    right = body(2);
  EndIf
  outside(i) = body(3);
  left = body(4);
EndFor

Physical Volume("segment") = {part(1), part(2), part(3)};
Physical Surface("front") = {front(1), front(2), front(3)};
Physical Surface("back") = {back(1), back(2), back(3)};
Physical Surface("right") = {right};    // as the angle falls
Physical Surface("left") = {left};
Physical Surface("outside") = {outside(1), outside(2), outside(3)};
Physical Surface("middle") = {outside(2)};
