// Quarters of two tubes, one in the other, and of an inner tube that is too large by s. Quadrilaterals; millimetres.
a = 10;              // radius of the bore
b = 20;              // radius of the joint
c = 30;              // outer radius
s = 0.02;            // by how much the second inner tube is too large
h = a/4;             // element size
match = 0.8;         // element size of the outer tube relative to that of the inner ones; 1: the meshes match along the joint
order = 2;           // of the elements

Mesh.ElementOrder = order;
Mesh.SecondOrderIncomplete = 1;

// inner tube, outer tube, larger inner tube
inside() = {a, b, a};
outside() = {b, c, b + s};
size() = {h, match*h, h};
For k In {0:2}
  p = 10*k;
  Point(p + 1) = {inside(k), 0, 0};   Point(p + 2) = {outside(k), 0, 0};
  Point(p + 3) = {0, outside(k), 0};  Point(p + 4) = {0, inside(k), 0};  Point(p + 5) = {0, 0, 0};
  Line(p + 1) = {p + 1, p + 2};
  Circle(p + 2) = {p + 2, p + 5, p + 3};
  Line(p + 3) = {p + 3, p + 4};
  Circle(p + 4) = {p + 4, p + 5, p + 1};
  Curve Loop(k + 1) = {p + 1:p + 4};
  Plane Surface(k + 1) = {k + 1};
  Transfinite Curve {p + 1, p + 3} = Round((outside(k) - inside(k))/size(k)) + 1;
  Transfinite Curve {p + 2, p + 4} = Round(Pi/2*b/size(k)) + 1;
  Transfinite Surface {k + 1};
  Recombine Surface {k + 1};
EndFor

Physical Surface("inner") = {1};
Physical Surface("outer") = {2};
Physical Surface("large inner") = {3};
Physical Curve("inside") = {4, 14, 24};
Physical Curve("outside") = {2, 12, 22};
Physical Curve("plane y") = {1, 11, 21};
Physical Curve("plane x") = {3, 13, 23};
