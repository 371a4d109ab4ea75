// A quarter of the lower half of a sphere on a quarter of a block; z is up, they touch at the origin. Lengths in metres.
R = 0.01;            // radius of the sphere
L = 0.01;            // edge of the block
DefineConstant[a = 0.0005];  // expected contact radius; what fine.geo has set stays
DefineConstant[n = 10];      // elements over it
DefineConstant[s = 2.5];     // how fast they grow: by s at a distance of n elements
order = 2;                   // of the elements
h = a/n;                     // their size where they touch
g = s*h/a;
H = R/3;                     // the largest
c = 2*a;             // radius of the zone that may touch

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// sphere: centre, pole, edge of the cap that may touch, equator
z = R - Sqrt(R*R - c*c);
Point(1) = {0, 0, R};
Point(2) = {0, 0, 0};
Point(3) = {c, 0, z};
Point(4) = {0, c, z};
Point(5) = {R, 0, R};
Point(6) = {0, R, R};
Point(7) = {0, 0, z};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 7, 4};
Circle(3) = {4, 1, 2};
Circle(4) = {3, 1, 5};
Circle(5) = {5, 1, 6};
Circle(6) = {6, 1, 4};
Line(7) = {2, 1};
Line(8) = {1, 5};
Line(9) = {6, 1};
Curve Loop(1) = {1, 2, 3};        Surface(1) = {1} In Sphere {1};
Curve Loop(2) = {4, 5, 6, -2};    Surface(2) = {2} In Sphere {1};
Curve Loop(3) = {7, 8, -4, -1};   Plane Surface(3) = {3};
Curve Loop(4) = {9, -7, -3, -6};  Plane Surface(4) = {4};
Curve Loop(5) = {8, 5, 9};        Plane Surface(5) = {5};
Surface Loop(1) = {1, 2, 3, 4, 5};
Volume(1) = {1};

// block
Point(11) = {0, 0, 0};
Point(12) = {c, 0, 0};
Point(13) = {0, c, 0};
Point(14) = {L, 0, 0};
Point(15) = {L, L, 0};
Point(16) = {0, L, 0};
Point(17) = {0, 0, -L};
Point(18) = {L, 0, -L};
Point(19) = {L, L, -L};
Point(20) = {0, L, -L};
Line(11) = {11, 12};
Circle(12) = {12, 11, 13};
Line(13) = {13, 11};
Line(14) = {12, 14};
Line(15) = {14, 15};
Line(16) = {15, 16};
Line(17) = {16, 13};
Line(18) = {17, 18};
Line(19) = {18, 19};
Line(20) = {19, 20};
Line(21) = {20, 17};
Line(22) = {11, 17};
Line(23) = {14, 18};
Line(24) = {15, 19};
Line(25) = {16, 20};
Curve Loop(11) = {11, 12, 13};              Plane Surface(11) = {11};
Curve Loop(12) = {14, 15, 16, 17, -12};     Plane Surface(12) = {12};
Curve Loop(13) = {18, 19, 20, 21};          Plane Surface(13) = {13};
Curve Loop(14) = {11, 14, 23, -18, -22};    Plane Surface(14) = {14};
Curve Loop(15) = {13, 22, -21, -25, 17};    Plane Surface(15) = {15};
Curve Loop(16) = {15, 24, -19, -23};        Plane Surface(16) = {16};
Curve Loop(17) = {16, 25, -20, -24};        Plane Surface(17) = {17};
Surface Loop(11) = {11, 12, 13, 14, 15, 16, 17};
Volume(11) = {11};

// h where they touch; it grows with the distance from there, in depth too: the stresses are smooth but at the rim of the contact
Field[1] = MathEval;
Field[1].F = Sprintf("Min(%g, %g + %g*Sqrt(z^2 + Max(0, Sqrt(x^2 + y^2) - %g)^2))", H, h, g, 1.2*a);
Background Field = 1;

Physical Volume("ball") = {1};
Physical Volume("block") = {11};
Physical Surface("low") = {1};
Physical Surface("cut") = {5};
Physical Surface("up") = {11};
Physical Surface("bottom") = {13};
Physical Surface("plane x") = {4, 15};
Physical Surface("plane y") = {3, 14};
