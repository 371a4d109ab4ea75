// Makes assembly.step, as a CAD program would: gmsh make_step.geo -parse_and_exit. A table on four tubes, and a plate on four blocks; mm.
SetFactory("OpenCASCADE");
Box(1) = {-60, -40, 0, 120, 80, 12};                                     // base
Cylinder(20) = {0, 0, 0, 0, 0, 12, 22};
BooleanDifference{ Volume{1}; Delete; }{ Volume{20}; Delete; }
For i In {0:3}                                                           // tubes
  x = (i == 0 || i == 3) ? -45 : 45;
  y = (i < 2) ? -27 : 27;
  Cylinder(2+i) = {x, y, 12, 0, 0, 30, 9};
  Cylinder(20) = {x, y, 12, 0, 0, 30, 5};
  BooleanDifference{ Volume{2+i}; Delete; }{ Volume{20}; Delete; }
EndFor
Box(6) = {-60, -40, 42, 120, 80, 12};                                    // table
For i In {0:3}                                                           // blocks
  x = (i == 0 || i == 3) ? -25 : 25;
  y = (i < 2) ? -15 : 15;
  Box(7+i) = {x-7, y-7, 54, 14, 14, 20};
EndFor
Cylinder(11) = {0, 0, 74, 0, 0, 12, 40};                                 // round plate with the load
Save "assembly.step";
