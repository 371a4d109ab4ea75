// Half of a ball of the bearing, above its plane of symmetry z = 0; it touches the races at y = -R and y = R. Millimetres.
SetFactory("OpenCASCADE");
R = 5.5;                  // radius
a = 2.1; b = 0.24;        // expected half-axes of the most loaded contact, along the axis of the bearing and along the race
DefineConstant[n = 2.4];  // elements over b
h = b/n;                  // their size
H = R/2.5;                // size of the largest elements
g = 0.7;                  // growth of the sizes with the distance from the contact

Mesh.ElementOrder = 2;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

Sphere(1) = {0, 0, 0, R, 0, Pi/2, 2*Pi};
Field[1] = MathEval;
Field[1].F = Sprintf("Min(%g, %g + %g*Sqrt(Max(0, Abs(x) - %g)^2 + Max(0, Abs(z) - %g)^2 + (%g - Sqrt(x^2 + y^2 + z^2))^2))",
                     H, h, g, b, 0.9*a, R);
Background Field = 1;

cut() = Surface In BoundingBox {-R - 1, -R - 1, -1e-3, R + 1, R + 1, 1e-3};
sphere() = Boundary{ Volume{1}; };
sphere() -= {cut()};
Physical Volume("ball") = {1};
Physical Surface("cut") = {cut()};
Physical Surface("sphere") = {sphere()};
