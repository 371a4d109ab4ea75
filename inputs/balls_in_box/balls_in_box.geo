// A ball of diameter 10 around the origin, an open box that three by three by three such balls fill, and its lid. Millimetres.
d = 10;                  // diameter of a ball
t = 0.5*d;               // thickness of the walls
DefineConstant[n = 5];   // elements on a diameter

SetFactory("OpenCASCADE");
Mesh.ElementOrder = 2;
Sphere(1) = {0, 0, 0, d/2};
Box(2) = {-d/2 - t, -d/2 - t, -d/2 - t, 3*d + 2*t, 3*d + 2*t, 2.5*d + t};
Box(3) = {-d/2, -d/2, -d/2, 3*d, 3*d, 3*d};
box() = BooleanDifference{ Volume{2}; Delete; }{ Volume{3}; Delete; };
lid = newv;
Box(lid) = {-d/2, -d/2, 2.5*d, 3*d, 3*d, t};
bottom() = Surface In BoundingBox {-2*d, -2*d, -d/2 - t - 1e-3, 4*d, 4*d, -d/2 - t + 1e-3};
top() = Surface In BoundingBox {-2*d, -2*d, 2.5*d + t - 1e-3, 4*d, 4*d, 2.5*d + t + 1e-3};

// Flat faces need no fine mesh.
MeshSize{ PointsOf{ Volume{box(), lid}; } } = d;
MeshSize{ PointsOf{ Volume{1}; } } = d/n;

Physical Volume("ball") = {1};
Physical Volume("box") = {box()};
Physical Volume("lid") = {lid};
Physical Surface("bottom") = {bottom()};
Physical Surface("top") = {top()};
