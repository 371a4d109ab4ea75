#!/usr/bin/python3
"""Screws, bolts with nuts and tubes that nothing but contact without friction holds: forces by statics, motions that nothing
determines are least ones, and no row is violated."""
import numpy as np

import dotyk_case

HEAD = 'SetFactory("OpenCASCADE");\nMesh.ElementOrder = 2; Mesh.HighOrderOptimize = 2; Mesh.MeshSizeMax = %g;\n'


class Fasteners(dotyk_case.Case):
    def solve(self, name, geometry, size, bodies, lines, solver="theta=0, tolerance=1e-8", code=0):
        """Mesh and solve; log, results file, and the displacements of each body."""
        self.write(name + ".geo", HEAD % size + geometry)
        self.write(name + ".nml", "\n".join([
            "&scene mesh='%s.geo' /" % name, "&material name='steel', young=210e3, poisson=0.3 /",
            *("&body name='%s', volume='%s', material='steel' /" % (body, body) for body in bodies), *lines,
            "&solver %s /" % solver, "&output fields='displacement contact', error_parts='' /"]) + "\n")
        log = self.dotyk(name + ".nml", code=code)
        file = self.results(name + ".vtkhdf")
        self.assertLess(file["dotyk/summary"].attrs["error_bound"], 1e-8)
        ends = np.cumsum(file["VTKHDF/NumberOfPoints"][:])[:-1]
        u = np.split(file["VTKHDF/PointData/displacement"][:], ends)
        return log, file, dict(zip(bodies, u))

    def force(self, file, one, other):
        """Contact force on a body by another one."""
        total = np.zeros(3)
        for name, pair in file["dotyk/contact"].items():
            for sign, names in ((1, (one, other)), (-1, (other, one))):
                if name.split(" (")[0] == "%s - %s" % names:
                    total += sign * pair.attrs["force"]
        return total

    def test_screw_in_a_clearance_hole(self):
        """The head of a screw is pulled on a plate. Along the plate it stays; pushed, it moves through the clearance until its
        shank is at the hole, which carries the push. Its spin is not determined."""
        clearance = 0.2
        geometry = """
Box(1) = {-10, -10, -4, 20, 20, 4}; Cylinder(2) = {0, 0, -5, 0, 0, 6, 3}; Cylinder(3) = {0, 0, -5, 0, 0, 6, %g};
BooleanDifference(4) = { Volume{1}; Delete; }{ Volume{3}; Delete; };
Cylinder(5) = {0, 0, -9, 0, 0, 9, 3}; Cylinder(6) = {0, 0, 0, 0, 0, 2, 5};
Recursive Delete { Volume{2}; }
BooleanUnion(7) = { Volume{5}; Delete; }{ Volume{6}; Delete; };
Physical Volume("plate") = {4}; Physical Volume("screw") = {7};
Physical Surface("side") = Surface In BoundingBox {-10.1, -10.1, -4.1, -9.9, 10.1, 0.1};
Physical Surface("end") = Surface In BoundingBox {-3.1, -3.1, -9.1, 3.1, 3.1, -8.9};
""" % (3 + clearance)
        lines = ["&support body='plate', surface='side', fix='xyz' /", "&contact auto=.true. /"]
        for push in 0.0, 50.0:
            with self.subTest(push=push):
                log, file, u = self.solve("screw", geometry, 1.8, ("plate", "screw"),
                                          [*lines, "&load body='screw', surface='end', force=%r,0,-1000, point=0,0,-1 /" % push])
                self.assertRegex(log, "not determined by contact: .*spin about the axis .* of 'screw'; least motion taken")
                np.testing.assert_allclose(self.force(file, "screw", "plate"), [-push, 0, 1000], atol=1)
                moved = u["screw"].mean(axis=0)
                if push:
                    # Facets of 1.8 on a radius of 3, and the tilt that the push causes.
                    self.assertAlmostEqual(moved[0] / clearance, 1, delta=0.05)
                else:
                    self.assertLess(np.abs(moved[:2]).max(), 0.01 * clearance)
                # Rows are half a facet apart, 0.3 of the radius.
                self.assertLess(abs(moved[1]), 0.3 * clearance)

    def test_bracket_with_bolts_and_nuts(self):
        """A bracket on a base, pushed aside, with two bolts and their nuts in holes that they fill, without threads, ties or
        springs: the bolts carry the push, and the base the pressure."""
        # Facets of shanks and holes coincide: all bodies are extruded, with as many nodes on each circle.
        geometry = """
Macro Plate
  Rectangle(n) = {-20, -10, z, 40, 20}; Disk(n + 1) = {-10, 0, z, 3}; Disk(n + 2) = {10, 0, z, 3};
  BooleanDifference{ Surface{n}; Delete; }{ Surface{n + 1, n + 2}; Delete; }
  v() = Extrude {0, 0, 8} { Surface{n}; Layers{3}; Recombine; };
Return
Macro Bolt
  Disk(n) = {x, 0, 8, 3}; Disk(n + 1) = {x, 0, 8, 5};
  f() = BooleanFragments{ Surface{n}; Delete; }{ Surface{n + 1}; Delete; };
  shank() = Surface In BoundingBox {x - 3.1, -3.1, 7.9, x + 3.1, 3.1, 8.1};
  v() = Extrude {0, 0, 3} { Surface{f()}; Layers{2}; Recombine; };
  v() = Extrude {0, 0, -22} { Surface{shank(0)}; Layers{8}; Recombine; };
  bolt() = Volume In BoundingBox {x - 5.1, -5.1, -14.1, x + 5.1, 5.1, 11.1};
  Disk(n + 50) = {x, 0, -12, 5}; Disk(n + 51) = {x, 0, -12, 3};
  BooleanDifference{ Surface{n + 50}; Delete; }{ Surface{n + 51}; Delete; }
  v() = Extrude {0, 0, 4} { Surface{n + 50}; Layers{2}; Recombine; };
  nut() = Volume In BoundingBox {x - 5.1, -5.1, -12.1, x + 5.1, 5.1, -7.9};
  bolt() -= nut();
Return
Mesh.ElementOrder = 1;
n = 100; x = -10; Call Bolt;
Physical Volume("bolt 1") = {bolt()}; Physical Volume("nut 1") = {nut()};
n = 200; x = 10; Call Bolt;
Physical Volume("bolt 2") = {bolt()}; Physical Volume("nut 2") = {nut()};
n = 300; z = -8; Call Plate;
Physical Volume("base") = {v(1)};
n = 400; z = 0; Call Plate;
Physical Volume("bracket") = {v(1)};
For x In {-10:10:20}
  c() = Curve In BoundingBox {x - 5.1, -5.1, -20, x + 5.1, 5.1, 20};
  For i In {0:#c() - 1}
    q() = BoundingBox Curve{c(i)};
    If (q(5) - q(2) < 0.1) Transfinite Curve{c(i)} = 17; EndIf
  EndFor
EndFor
Physical Surface("under") = Surface In BoundingBox {-20.1, -10.1, -8.1, 20.1, 10.1, -7.9};
Physical Surface("end") = Surface In BoundingBox {-20.1, -10.1, -0.1, -19.9, 10.1, 8.1};
Physical Surface("top") = Surface In BoundingBox {-20.1, -10.1, 7.9, 20.1, 10.1, 8.1};
"""
        push, press = 200.0, 1500.0
        log, file, u = self.solve("bracket", geometry, 2.5, ("base", "bracket", "bolt 1", "bolt 2", "nut 1", "nut 2"), [
            "&support body='base', surface='under', fix='xyz' /", "&contact auto=.true., geometry='elements' /",
            "&load body='bracket', surface='end', force=%r,0,0, point=-20,0,0 /" % push,
            "&load body='bracket', surface='top', force=0,0,%r, point=0,0,8 /" % -press])
        np.testing.assert_allclose(self.force(file, "base", "bracket"), [0, 0, -press], atol=1e-8 * press)
        forces = [self.force(file, "bolt " + k, "base") for k in "12"]
        np.testing.assert_allclose(sum(forces), [-push, 0, 0], atol=1e-8 * press)
        # The bracket is compressed: the bolt on the side of the push has 20 % more.
        self.assertBetween(1.1, forces[0][0] / forces[1][0], 1.3)
        for k in "12":
            # Least motion: no nut comes off, no bolt out of its hole.
            for body in "bolt " + k, "nut " + k:
                self.assertLess(np.abs(u[body]).max(), 0.01)
        self.assertIn("not determined by contact: sliding along (0, 0, 1) and spin about the axis (0, 0, 1) of 'bolt 1', 'bolt 2', ",
                      log)

    def test_nut_tied_to_a_stud(self):
        """A stud in a clearance hole is pulled and bent; the nut around it, tied, holds both on the plate: the support
        has the moment that statics say."""
        log, file, _ = self.solve("stud", """Box(1) = {-20, -20, -10, 40, 40, 10};
Cylinder(10) = {0, 0, -10, 0, 0, 10, 5.5};
BooleanDifference{ Volume{1}; Delete; }{ Volume{10}; Delete; }
Cylinder(3) = {0, 0, -20, 0, 0, 26, 5};
Box(5) = {-10, -7.5, 0, 20, 15, 5}; Cylinder(12) = {0, 0, 0, 0, 0, 5, 5};
BooleanDifference(6) = { Volume{5}; Delete; }{ Volume{12}; Delete; };
tol = 1e-3;
Physical Volume("plate") = {1}; Physical Volume("stud") = {3}; Physical Volume("nut") = {6};
s() = Surface In BoundingBox {-20-tol, -20-tol, -10-tol, -20+tol, 20+tol, tol}; Physical Surface("held") = {s()};
s() = Surface In BoundingBox {-5-tol, -5-tol, -20-tol, 5+tol, 5+tol, -20+tol}; Physical Surface("pulled") = {s()};
s() = Boundary{ Volume{6}; }; Physical Surface("nut skin") = {s()};
s() = Boundary{ Volume{3}; }; Physical Surface("stud skin") = {s()};
""", 12, ("plate", "stud", "nut"), [
            "&support body='plate', surface='held', fix='xyz' /",
            "&tie name='thread', surface_a='nut:nut skin', surface_b='stud:stud skin' /",
            "&contact auto=.true. /",
            "&load body='stud', surface='pulled', force=0,0,-1000, moment=0,2000,0 /"])
        # The weak springs carry 1e-6 of it.
        np.testing.assert_allclose(file["dotyk/supports/moment"][0], [0, -2000, 0], atol=0.01)
        self.assertIn("spin about the axis (0, 0, 1) of 'stud', 'nut'; least motion taken\n", log)

    def test_rim_below_a_head(self):
        """A quarter of a pin with a head in a hole of its radius. Edges of the rim of the hole are chords, inside the shank
        just below the head by more than anything moves: that is the mesh. A shank that is thicker by 0.4 is not."""
        for thicker, code in (0.0, 0), (0.4, 1):
            with self.subTest(thicker=thicker):
                geometry = """
Cylinder(1) = {0, 0, -14, 0, 0, 14, %g, Pi/2}; Cylinder(2) = {0, 0, 0, 0, 0, 3, 8, Pi/2};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Box(4) = {0, 0, -10, 15, 15, 10}; Cylinder(5) = {0, 0, -10, 0, 0, 10, 5, Pi/2};
BooleanDifference(6) = { Volume{4}; Delete; }{ Volume{5}; Delete; };
Physical Volume("pin") = {3}; Physical Volume("plate") = {6};
Physical Surface("x0") = Surface In BoundingBox {-0.1, -0.1, -20, 0.1, 20, 20};
Physical Surface("y0") = Surface In BoundingBox {-0.1, -0.1, -20, 20, 0.1, 20};
Physical Surface("bottom") = Surface In BoundingBox {-0.1, -0.1, -10.1, 20, 20, -9.9};
Physical Surface("end") = Surface In BoundingBox {-0.1, -0.1, -14.1, 20, 20, -13.9};
Physical Surface("seat") = Surface In BoundingBox {-0.1, -0.1, -0.1, 20, 20, 0.1};
Mesh.HighOrderOptimize = 0;
""" % (5 + thicker)
                log, file, _ = self.solve("rim", geometry, 2, ("pin", "plate"), [
                    "&support body='p*', surface='x0', fix='x' /", "&support body='p*', surface='y0', fix='y' /",
                    "&support body='plate', surface='bottom', fix='z' /",
                    "&load body='pin', surface='end', force=0,0,-2500 /",
                    "&contact name='head', surface_a='pin:seat', surface_b='plate:seat' /"], code=code)
                self.assertAlmostEqual(file["dotyk/contact/head"].attrs["force"][2] / 2500, 1, delta=1e-8)
                self.assertEqual("is inside 'pin'" in log or "is inside 'plate'" in log, code == 1, log)

    def test_tube_between_plates(self):
        """A tube between two plates, the upper one under a pressure: the tube as slave and as master."""
        geometry = """
Box(1) = {-8, -8, -3, 16, 16, 3}; Box(2) = {-8, -8, 10, 16, 16, 3};
Cylinder(3) = {0, 0, 0, 0, 0, 10, 6}; Cylinder(4) = {0, 0, 0, 0, 0, 10, 4};
BooleanDifference(5) = { Volume{3}; Delete; }{ Volume{4}; Delete; };
Physical Volume("lower") = {1}; Physical Volume("upper") = {2}; Physical Volume("tube") = {5};
Physical Surface("under") = Surface In BoundingBox {-8.1, -8.1, -3.1, 8.1, 8.1, -2.9};
Physical Surface("over") = Surface In BoundingBox {-8.1, -8.1, 12.9, 8.1, 8.1, 13.1};
Physical Surface("lower end") = Surface In BoundingBox {-8.1, -8.1, -0.1, 8.1, 8.1, 0.1};
Physical Surface("upper end") = Surface In BoundingBox {-8.1, -8.1, 9.9, 8.1, 8.1, 10.1};
"""
        energy = []
        for tube_is_slave in True, False:
            with self.subTest(tube_is_slave=tube_is_slave):
                pairs = [("tube:lower end", "lower:lower end"), ("tube:upper end", "upper:upper end")]
                lines = ["&support body='lower', surface='under', fix='xyz' /",
                         "&load body='upper', surface='over', pressure=5 /"]
                lines += ["&contact name='%s', surface_a='%s', surface_b='%s' /" % (
                    name, *(pair if tube_is_slave else pair[::-1])) for name, pair in zip(("lower", "upper"), pairs)]
                log, file, u = self.solve("tube", geometry, 1.8, ("lower", "upper", "tube"), lines)
                self.assertRegex(log, "not determined by contact: sliding along .* and spin about the axis .* of 'upper', 'tube'; "
                                      "least motion taken")
                for name, sign in ("lower", 1), ("upper", -1):
                    force = file["dotyk/contact"][name].attrs["force"]
                    np.testing.assert_allclose(force if tube_is_slave else -force, [0, 0, sign * 5 * 16**2], atol=1e-6 * 1280)
                # By symmetry nothing moves aside; facets are not quite symmetric.
                for body in "upper", "tube":
                    mean = u[body].mean(axis=0)
                    self.assertLess(np.abs(mean[:2]).max(), 0.02 * abs(mean[2]))
                energy.append(file["dotyk/summary"].attrs["energy"])
        # Of the joint, which the ends of the tube dent, but for a part.
        self.assertAlmostEqual(energy[0] / energy[1], 1, delta=0.02)


dotyk_case.main()
