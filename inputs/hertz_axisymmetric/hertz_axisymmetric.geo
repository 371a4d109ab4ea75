// The lower half of a ball on a half-space, axisymmetric: x is the radius, y is up, they touch at the origin. Lengths in millimetres.
R = 100;                     // radius of the ball
D = R;                       // radius of what is meshed of the half-space
a = 0.2;                     // expected contact radius
DefineConstant[n = 40];      // elements over it
DefineConstant[s = 4];       // how fast they grow: by s at a distance of n elements
order = 2;                   // of the elements
h = a/n;                     // their size where they touch
g = s*h/a;
H = R/8;                     // the largest
c = 2*a;                     // radius of the zone that may touch

Mesh.ElementOrder = order;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

// ball
Point(1) = {0, R, 0};
Point(2) = {0, 0, 0};
Point(3) = {c, R - Sqrt(R*R - c*c), 0};
Point(4) = {R, R, 0};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Line(3) = {4, 1};
Line(4) = {1, 2};
Curve Loop(1) = {1:4};
Plane Surface(1) = {1};

// half-space
Point(11) = {0, 0, 0};
Point(12) = {c, 0, 0};
Point(13) = {D, 0, 0};
Point(14) = {0, -D, 0};
Line(11) = {11, 12};
Line(12) = {12, 13};
Circle(13) = {14, 11, 13};
Line(14) = {11, 14};
Curve Loop(2) = {14, 13, -12, -11};
Plane Surface(2) = {2};

// h where they touch; it grows with the distance from there
Field[1] = MathEval;
Field[1].F = Sprintf("Min(%g, %g + %g*Sqrt(y^2 + Max(0, x - %g)^2))", H, h, g, 1.2*a);
Background Field = 1;

Physical Surface("ball") = {1};
Physical Surface("half-space") = {2};
Physical Curve("low") = {1};
Physical Curve("cut") = {3};
Physical Curve("up") = {11};
Physical Curve("far") = {13};
Physical Curve("axis") = {4, 14};
