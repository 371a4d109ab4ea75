// A cube with sides of length 1. The tests of the input only ask whether the file is there.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};
Physical Volume("block") = {1};
