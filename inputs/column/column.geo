// Two unit cubes on top of each other; their meshes do not match. Lengths in metres.
SetFactory("OpenCASCADE");
Mesh.ElementOrder = 1;
Box(1) = {0, 0, 0, 1, 1, 1};
Box(2) = {0, 0, 1, 1, 1, 1};

// the lower one: hexahedra
Transfinite Curve{1:12} = 5;
Transfinite Surface{1:6};
Recombine Surface{1:6};
Transfinite Volume{1};

// the upper one: tetrahedra
MeshSize{ PointsOf{ Volume{2}; } } = 0.3;

// surfaces of an OpenCASCADE box: x min, x max, y min, y max, z min, z max
Physical Volume("lower") = {1};
Physical Volume("upper") = {2};
Physical Surface("bottom") = {5};
Physical Surface("lower top") = {6};
Physical Surface("upper bottom") = {11};
Physical Surface("top") = {12};
Physical Surface("sides x") = {1, 2, 7, 8};
Physical Surface("sides y") = {3, 4, 9, 10};
