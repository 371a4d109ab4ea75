// A blind flange: the ring of a pipe, a gasket, a cover, and one bolt with its washer and nut, of which the input makes
// eight. The nut is a ring under the collar of the bolt: threads are not modelled. The input cuts the bolt in two
// where it is tightened. Millimetres; the axis is z.
DefineConstant[h = 12];   // size of the elements
r = 60;                  // bolt circle

SetFactory("OpenCASCADE");
Mesh.ElementOrder = 2;
Mesh.MeshSizeMax = h;
Mesh.HighOrderOptimize = 2;

Cylinder(1) = {0, 0, 0, 0, 0, 16, 80};
Cylinder(2) = {0, 0, 16, 0, 0, 3, 44};
Cylinder(3) = {0, 0, 19, 0, 0, 14, 80};
Cylinder(4) = {0, 0, 0, 0, 0, 19, 30};
For i In {0:7}
  Cylinder(20 + i) = {r*Cos(i*Pi/4), r*Sin(i*Pi/4), 0, 0, 0, 33, 7};
EndFor
ring() = BooleanDifference{ Volume{1}; Delete; }{ Volume{4, 20:27}; };
gasket() = BooleanDifference{ Volume{2}; Delete; }{ Volume{4}; };
cover() = BooleanDifference{ Volume{3}; Delete; }{ Volume{20:27}; };
Recursive Delete { Volume{4, 20:27}; }
// The underside of the cover has an edge where the pressure ends.
Disk(1000) = {0, 0, 19, 30};
cover() = BooleanFragments{ Volume{cover()}; Delete; }{ Surface{1000}; Delete; };

Cylinder(40) = {r, 0, -8, 0, 0, 8, 10};
Cylinder(41) = {r, 0, 0, 0, 0, 44, 6};
Cylinder(42) = {r, 0, 44, 0, 0, 6, 9};
bolt() = BooleanUnion{ Volume{40}; Delete; }{ Volume{41, 42}; Delete; };
Cylinder(50) = {r, 0, 33, 0, 0, 3, 12};
Cylinder(51) = {r, 0, 33, 0, 0, 3, 6.5};
washer() = BooleanDifference{ Volume{50}; Delete; }{ Volume{51}; Delete; };
Cylinder(60) = {r, 0, 36, 0, 0, 8, 10};
Cylinder(61) = {r, 0, 36, 0, 0, 8, 6.2};
nut() = BooleanDifference{ Volume{60}; Delete; }{ Volume{61}; Delete; };

MeshSize{ PointsOf{ Volume{bolt(), washer(), nut()}; } } = h/2;
e = 1e-3;
Physical Volume("ring") = {ring()};
Physical Volume("gasket") = {gasket()};
Physical Volume("cover") = {cover(0)};
Physical Volume("bolt") = {bolt()};
Physical Volume("washer") = {washer()};
Physical Volume("nut") = {nut()};
Physical Surface("pipe") = Surface In BoundingBox {-30 - e, -30 - e, -e, 30 + e, 30 + e, 16 + e};
Physical Surface("wet") = Surface In BoundingBox {-30 - e, -30 - e, 19 - e, 30 + e, 30 + e, 19 + e};
