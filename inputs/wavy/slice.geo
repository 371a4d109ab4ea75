// A slice of wavy.geo, of tetrahedra; y is up, the slice is t thick along z.
l = 1;               // wave length
D = 1.5*l;           // depth of each layer
h = l/40;            // element size on the surface
H = 10*h;            // element size far away
t = h;               // thickness
order = 2;           // of the elements

Mesh.ElementOrder = order;

Point(1) = {0, 0, 0, h};      Point(2) = {l/2, 0, 0, h};
Point(3) = {l/2, D, 0, H};    Point(4) = {0, D, 0, H};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

// apart by this much, so that Extrude does not make one of the two faces
e = 1e-6*l;
Point(5) = {0, -e, 0, h};     Point(6) = {l/2, -e, 0, h};
Point(7) = {l/2, -D, 0, H};   Point(8) = {0, -D, 0, H};
Line(5) = {6, 5};  Line(6) = {5, 8};  Line(7) = {8, 7};  Line(8) = {7, 6};
Curve Loop(2) = {5, 6, 7, 8};
Plane Surface(2) = {2};

upper() = Extrude {0, 0, t} { Surface{1}; Layers{1}; };
lower() = Extrude {0, 0, t} { Surface{2}; Layers{1}; };

Physical Volume("upper") = {upper(1)};
Physical Volume("lower") = {lower(1)};
Physical Surface("upper face") = {upper(2)};
Physical Surface("lower face") = {lower(2)};
Physical Surface("top") = {upper(4)};
Physical Surface("bottom") = {lower(4)};
Physical Surface("sides") = {upper(3), upper(5), lower(3), lower(5)};
Physical Surface("cuts") = {1, upper(0), 2, lower(0)};
