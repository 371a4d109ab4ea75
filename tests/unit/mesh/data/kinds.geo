// Three boxes of 1 x 1 x 0.5, meshed with tetrahedra, hexahedra and prisms: every element kind in small meshes.
//   for o in 1 2; do for f in 22 41; do
//     gmsh -3 -order $o -format msh$f -o kinds_$o.$f.msh kinds.geo
//     gmsh -3 -order $o -format msh$f -bin -o kinds_$o.$f.bin.msh kinds.geo
//   done; done
// and the same with -order 2 -setnumber Mesh.SecondOrderIncomplete 1 for kinds_2i.
General.Terminal = 1;
Mesh.MeshSizeMin = 1;
Mesh.MeshSizeMax = 1;

Macro Square
  p = newp;
  Point(p) = {x, 0, 0};
  Point(p + 1) = {x + 1, 0, 0};
  Point(p + 2) = {x + 1, 1, 0};
  Point(p + 3) = {x, 1, 0};
  l = newl;
  Line(l) = {p, p + 1};
  Line(l + 1) = {p + 1, p + 2};
  Line(l + 2) = {p + 2, p + 3};
  Line(l + 3) = {p + 3, p};
  c = newll;
  Curve Loop(c) = {l : l + 3};
  s = news;
  Plane Surface(s) = {c};
  Transfinite Curve{l : l + 3} = 2;
  Transfinite Surface{s};
Return

x = 0;
Call Square;
t() = Extrude{0, 0, 0.5}{ Surface{s}; };
Physical Volume("tetrahedra", 11) = {t(1)};
Physical Surface("bottom", 3) = {s};
Physical Surface("top and more") = {t(0)};
Physical Curve("edge", 100) = {l};

x = 2;
Call Square;
Recombine Surface{s};
h() = Extrude{0, 0, 0.5}{ Surface{s}; Layers{1}; Recombine; };
Physical Volume("hexahedra") = {h(1)};
Physical Surface("bottom", 3) += {s};
Physical Surface(77) = {h(0)};

x = 4;
Call Square;
w() = Extrude{0, 0, 0.5}{ Surface{s}; Layers{1}; Recombine; };
Physical Volume("prisms") = {w(1)};
Physical Surface("bottom", 3) += {s};
Physical Point("corner") = {p};
