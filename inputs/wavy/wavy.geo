// Half a wave of the contact of two deep layers in plane strain; y is up, the surfaces are flat (the wave is in the gap).
l = 1;               // wave length
D = 1.5*l;           // depth of each layer
h = l/80;            // element size on the surface
H = 20*h;            // element size far away
order = 2;           // of the elements

Mesh.ElementOrder = order;

Point(1) = {0, 0, 0, h};      Point(2) = {l/2, 0, 0, h};
Point(3) = {l/2, D, 0, H};    Point(4) = {0, D, 0, H};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

Point(5) = {0, 0, 0, h};      Point(6) = {l/2, 0, 0, h};
Point(7) = {l/2, -D, 0, H};   Point(8) = {0, -D, 0, H};
Line(5) = {6, 5};  Line(6) = {5, 8};  Line(7) = {8, 7};  Line(8) = {7, 6};
Curve Loop(2) = {5, 6, 7, 8};
Plane Surface(2) = {2};

Physical Surface("upper") = {1};
Physical Surface("lower") = {2};
Physical Curve("upper face") = {1};
Physical Curve("lower face") = {5};
Physical Curve("top") = {3};
Physical Curve("bottom") = {7};
Physical Curve("sides") = {2, 4, 6, 8};
