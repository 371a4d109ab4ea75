// A layer on a deep foundation, both symmetric about x = 0; y is up, they touch along y = 0. Lengths in millimetres.
t = 10;              // thickness of the layer
c = 0.05*t;          // half the width of the loaded strip
h = t/25;            // element size where they touch; some 33 elements over the expected half-width of 1.325 t
l = 4*t;             // half the length of the layer: far beyond what stays in contact
D = 40*t;            // depth of the foundation, and half its width
H = D/8;             // element size far away

Mesh.ElementOrder = 2;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// layer
Point(1) = {-l, 0, 0};  Point(2) = {l, 0, 0};
Point(3) = {l, t, 0};   Point(4) = {c, t, 0};  Point(5) = {0, t, 0};  Point(6) = {-c, t, 0};  Point(7) = {-l, t, 0};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 5};  Line(5) = {5, 6};  Line(6) = {6, 7};  Line(7) = {7, 1};
Curve Loop(1) = {1:7};
Plane Surface(1) = {1};

// foundation
Point(11) = {-1.1*l, 0, 0};  Point(12) = {1.1*l, 0, 0};
Point(13) = {D, 0, 0};   Point(14) = {D, -D, 0};  Point(15) = {-D, -D, 0};  Point(16) = {-D, 0, 0};
Line(11) = {11, 12};  Line(12) = {12, 13};  Line(13) = {13, 14};  Line(14) = {14, 15};  Line(15) = {15, 16};  Line(16) = {16, 11};
Curve Loop(2) = {-11, -16, -15, -14, -13, -12};
Plane Surface(2) = {2};

// fine where they touch and under the strip
Point(21) = {-1.5*t, 0, 0};  Point(22) = {1.5*t, 0, 0};
Line(21) = {21, 22};
Field[1] = Distance;
Field[1].CurvesList = {21};
Field[1].NumPointsPerCurve = 400;
Field[2] = Threshold;
Field[2].InField = 1;
Field[2].SizeMin = h;
Field[2].SizeMax = H;
Field[2].DistMin = h;
Field[2].DistMax = D;
Field[3] = Distance;
Field[3].PointsList = {5};
Field[4] = Threshold;
Field[4].InField = 3;
Field[4].SizeMin = c/4;
Field[4].SizeMax = t/4;
Field[4].DistMin = c;
Field[4].DistMax = t;
Field[4].StopAtDistMax = 1;
Field[5] = Min;
Field[5].FieldsList = {2, 4};
Background Field = 5;

Physical Surface("layer") = {1};
Physical Surface("foundation") = {2};
Physical Curve("underside") = {1};
Physical Curve("strip") = {4, 5};
Physical Curve("surface") = {11};
Physical Curve("base") = {14};
Physical Curve("sides") = {13, 15};
