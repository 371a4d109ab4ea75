// Eight square plates on top of each other, each with a mesh of its own; z is up. Lengths in metres.
SetFactory("OpenCASCADE");
m = 8;               // elements along an edge of a plate: 8 gives 34,000 unknowns, 14 gives 103,000
w = 1;               // edge of a plate
t = 0.12;            // thickness
b = 0.6;             // edge of the loaded patch, in the corner x = y = 0
n = 8;               // plates, plate 1 is the lowest

Mesh.ElementOrder = 2;

For k In {1:n}
  Box(k) = {0, 0, (k - 1)*t, w, w, t};
EndFor
patch = newreg;
Rectangle(patch) = {0, 0, n*t, b, b};
BooleanFragments{ Volume{n}; Delete; }{ Surface{patch}; Delete; }

// plates of odd number a little coarser than those of even number, so that no two faces match
For k In {1:n}
  h = w/m*((k % 2 == 1) ? 1 : 0.88);
  face() = Boundary{ Volume{k}; };
  edge() = Abs(Boundary{ Surface{face()}; });
  For i In {0:#edge() - 1}
    x() = BoundingBox Curve{edge(i)};
    Transfinite Curve{edge(i)} = Ceil((x(3) - x(0) + x(4) - x(1) + x(5) - x(2))/h - 0.01) + 1;
  EndFor
EndFor

// face k lies between plates k and k + 1 and consists of a surface of each
e = 1e-6;
For k In {0:n}
  Physical Surface(Sprintf("face %g", k)) = Surface In BoundingBox {-e, -e, k*t - e, w + e, w + e, k*t + e};
EndFor
For k In {1:n}
  Physical Volume(Sprintf("plate %g", k)) = {k};
EndFor
Physical Surface("patch") = Surface In BoundingBox {-e, -e, n*t - e, b + e, b + e, n*t + e};
Physical Surface("sides x") = {Surface In BoundingBox {-e, -e, -e, e, w + e, n*t + e},
                               Surface In BoundingBox {w - e, -e, -e, w + e, w + e, n*t + e}};
Physical Surface("sides y") = {Surface In BoundingBox {-e, -e, -e, w + e, e, n*t + e},
                               Surface In BoundingBox {-e, w - e, -e, w + e, w + e, n*t + e}};
