// A quarter of eight square plates on top of each other; z is up. Lengths in metres.
// Neighbouring plates share the faces of the mesh; in dotyk each body has nodes of its own.
w = 0.5;             // half the width of a plate
t = 0.1;             // thickness
b = 0.15;            // half the width of the loaded patch
n = 8;               // plates

Mesh.ElementOrder = 2;
Mesh.SecondOrderIncomplete = 1;

// the lower face of the lowest plate, in two by two parts
Point(1) = {0, 0, 0};
patch() = Extrude {b, 0, 0} { Point{1}; Layers{3}; };
rest() = Extrude {w - b, 0, 0} { Point{patch(0)}; Layers{5}; };
row1() = Extrude {0, b, 0} { Curve{patch(1), rest(1)}; Layers{3}; Recombine; };
row2() = Extrude {0, w - b, 0} { Curve{row1(0), row1(4)}; Layers{5}; Recombine; };
face() = {row1(1), row1(5), row2(1), row2(5)};
Physical Surface("face 0") = face();

// plates 1 to n, from below; face k lies between plates k and k + 1
e = 1e-6;
For k In {1:n}
  volume() = {};
  top() = {};
  For i In {0:3}
    out() = Extrude {0, 0, t} { Surface{face(i)}; Layers{2}; Recombine; };
    top() += out(0);
    volume() += out(1);
  EndFor
  face() = top();
  Physical Volume(Sprintf("plate %g", k)) = volume();
  Physical Surface(Sprintf("face %g", k)) = face();
EndFor
Physical Surface("patch") = {face(0)};
Physical Surface("plane x") = Surface In BoundingBox {-e, -e, -e, e, w + e, n*t + e};
Physical Surface("plane y") = Surface In BoundingBox {-e, -e, -e, w + e, e, n*t + e};
Physical Surface("edge") = {Surface In BoundingBox {w - e, -e, -e, w + e, w + e, n*t + e},
                            Surface In BoundingBox {-e, w - e, -e, w + e, w + e, n*t + e}};
