// Two bricks on the ground and a third that bridges them, off centre; z is up. Lengths in millimetres.
SetFactory("OpenCASCADE");
l = 240;  b = 120;  t = 60;      // length, width and height of a brick
h = 15;                          // element size of the bricks; divides all lengths, so that the upper brick ends on faces of the others
H = 35;                          // and of the ground

Mesh.ElementOrder = 2;
Mesh.SecondOrderIncomplete = 1;  // hexahedra with 20 nodes

Box(1) = {0, -90, -100, 700, 300, 100};   // ground
Box(2) = {50, 0, 0, l, b, t};             // left brick
Box(3) = {380, 15, 0, l, b, t};           // right brick
Box(4) = {230, 30, t, l, b, t};           // bridging brick: 60 mm of it above the left one, 90 mm above the right one

// the bridging brick: tetrahedra; the others: hexahedra. Edges of an OpenCASCADE box: 12 a box, along z, y and x.
MeshSize{ PointsOf{ Volume{4}; } } = 1.2*h;
For i In {0:2}
  s = (i == 0) ? H : h;
  x() = BoundingBox Volume{i + 1};
  e = 12*i;
  Transfinite Curve{e + 1, e + 3, e + 5, e + 7} = Ceil((x(5) - x(2))/s) + 1;
  Transfinite Curve{e + 2, e + 4, e + 6, e + 8} = Ceil((x(4) - x(1))/s) + 1;
  Transfinite Curve{e + 9, e + 10, e + 11, e + 12} = Ceil((x(3) - x(0))/s) + 1;
  Transfinite Surface{6*i + 1:6*i + 6};
  Recombine Surface{6*i + 1:6*i + 6};
  Transfinite Volume{i + 1};
EndFor

// faces of an OpenCASCADE box: x min, x max, y min, y max, z min, z max
Physical Volume("ground") = {1};
Physical Volume("left brick") = {2};
Physical Volume("right brick") = {3};
Physical Volume("bridging brick") = {4};
Physical Surface("underside") = {5, 11, 17, 23};
Physical Surface("top") = {6, 12, 18, 24};
