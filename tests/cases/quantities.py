#!/usr/bin/python3
"""Error bars of contact forces, mean displacements of faces and reactions of supports (&output quantity)."""
import re

import numpy as np

import dotyk_case

A, B, C = 1.0, 1.5, 2.2  # radii: bore, joint, outside
YOUNG, POISSON = 200.0, 0.3
INTERFERENCE = 1e-3

# A quarter of a tube.
TUBE = """
Mesh.ElementOrder = 2;
Point(1) = {%r, 0, 0};
line() = Extrude {%r, 0, 0} { Point{1}; Layers{%d}; };
ring() = Extrude { {0, 0, 1}, {0, 0, 0}, Pi/2 } { Curve{line(1)}; Layers{%d}; Recombine; };
Physical Surface("tube") = {ring(1)};
Physical Curve("inside") = {Abs(ring(3))};
Physical Curve("outside") = {Abs(ring(2))};
Physical Curve("plane y") = {line(1)};
Physical Curve("plane x") = {ring(0)};
"""

TUBES = """
&scene analysis='plane_strain' /
&material name='steel', young=200, poisson=0.3 /
&body name='inner', mesh='inner.geo', volume='tube', material='steel' /
&body name='outer', mesh='outer.geo', volume='tube', material='steel' /
&support body='*', surface='plane x', fix='x' /
&support body='*', surface='plane y', fix='y' /
&contact name='fit', surface_a='inner:outside', surface_b='outer:inside', gap=-1e-3 /
&solver theta=0, tolerance=1e-8 /
"""

# A block on another one, and a third one beside them that a gap keeps away.
BLOCKS = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 4, 1};
Rectangle(2) = {1, 1, 0, 1, 1};
Rectangle(3) = {3, 1.01, 0, 1, 1};
Physical Surface("base") = {1};
Physical Surface("left") = {2};
Physical Surface("right") = {3};
e = 1e-6;
Physical Curve("bottom") = {Curve In BoundingBox{-e, -e, -e, 4 + e, e, e}};
Physical Curve("up") = {Curve In BoundingBox{-e, 1 - e, -e, 4 + e, 1 + e, e}};
Physical Curve("top") = {Curve In BoundingBox{-e, 2 - e, -e, 4 + e, 2.1, e}};
Physical Curve("low") = {Curve In BoundingBox{2.5, 1.01 - e, -e, 4 + e, 1.01 + e, e}};
Mesh.ElementOrder = 2;
Mesh.MeshSizeMax = 0.25;
"""

PRESSED = """
&scene mesh='blocks.geo', analysis='plane_strain' /
&material name='m', young=1, poisson=0.3 /
&body name='base', volume='base', material='m' /
&body name='left', volume='left', material='m' /
&body name='right', volume='right', material='m' /
&support body='base', surface='bottom', fix='xy' /
&support body='left', surface='top', fix='x' /
&support body='left', surface='top', fix='y', value=0,-1e-3, case='down' /
&support body='left', surface='top', fix='y', value=0,-2e-3, case='farther' /
&support body='right', surface='top', fix='xy' /
&contact name='touch', surface_a='left:up', surface_b='base:up', gap=0 /
&contact name='apart', surface_a='right:low', surface_b='base:up' /
&case name='down' /
&case name='farther' /
"""


class Quantities(dotyk_case.Case):
    def quantities(self, case=""):
        """Value, bar and estimate by name."""
        group = self.results("case.vtkhdf")["dotyk" + case + "/quantities"]
        names = group.attrs["names"]
        names = (names.decode() if isinstance(names, bytes) else names).split("\n")
        return {name: [group[what][i] for what in ("value", "error", "estimate")] for i, name in enumerate(names)}

    def run_scene(self, nml, quantity, code=0):
        self.write("case.nml", nml + "&output quantity=" + quantity + " /\n")
        return self.dotyk("case.nml", code=code)

    def tubes(self, radial, around, quantity, code=0):
        self.write("inner.geo", TUBE % (A, B - A, radial, around))
        self.write("outer.geo", TUBE % (B, C - B, radial, around))
        return self.run_scene(TUBES, quantity, code)

    def test_bars_hold_the_exact_force_and_displacement_of_a_press_fit(self):
        # Lame; the force on a quarter of the joint is along its bisector, the mean of a radial displacement along x
        # has the mean of the cosine.
        stiffness = YOUNG / (1 - POISSON**2)
        pressure = INTERFERENCE * stiffness * (B**2 - A**2) * (C**2 - B**2) / (2 * B**3 * (C**2 - A**2))
        widening = 2 * pressure * B**2 * C / (stiffness * (C**2 - B**2))
        exact = {"force:fit": np.sqrt(2) * pressure * B, "displacement:outer:outside x": widening * 2 / np.pi}
        last = None
        for n in (3, 6):
            log = self.tubes(n, 3 * n, "'force:*', 'displacement:outer:outside x', 'reaction:inner:plane x x'")
            found = self.quantities()
            for name, value in exact.items():
                self.assertLess(abs(value - found[name][0]), found[name][1], log)
            # The strains of tubes are smooth: on fine meshes the estimate corrects the value.
            got, bar, estimate = found["force:fit"]
            if n == 6:
                self.assertLess(abs(exact["force:fit"] - got - estimate), abs(exact["force:fit"] - got), log)
            # The half of the inner tube right of x = 0 is in equilibrium.
            for a, b in zip(found["reaction:inner:plane x x"], found["force:fit"]):
                self.assertAlmostEqual(abs(a) / abs(b) * np.sqrt(2), 1, delta=0.05)
            if last:
                self.assertLess(found["force:fit"][1], last / 4)
            last = found["force:fit"][1]
        self.assertRegex(log, r"force:fit +0\.\d+ \+- \d")

    def test_load_cases_and_contact_that_is_open(self):
        self.write("blocks.geo", BLOCKS)
        log = self.run_scene(PRESSED, "'force:base - *', 'reaction:base:bottom y', 'displacement:left:up y', 'reaction:right:top x'")
        once, twice = (self.quantities("/cases/" + case) for case in ("down", "farther"))
        for name in ("force:touch", "reaction:base:bottom y", "displacement:left:up y"):
            # Twice the motion, twice the values: no row opens or closes where all of them are pressed.
            np.testing.assert_allclose(twice[name], 2 * np.array(once[name]), rtol=1e-3, err_msg=name)
            self.assertGreater(once[name][1], 0)
        # The base rests on its bottom alone.
        self.assertAlmostEqual(once["reaction:base:bottom y"][0] / once["force:touch"][0], 1, delta=1e-9)
        self.assertEqual(once["force:apart"][0], 0)
        self.assertTrue(np.isnan(once["force:apart"][1]))
        self.assertIn("force:apart          0, no error bar: no constraint is active", log)
        self.assertIn("no error bar: zero, but for rounding", log)

    def test_contact_that_goes_on_across_a_tie_has_the_bar_of_one_body(self):
        bars = []
        for cut in (False, True):
            base = "Rectangle(1) = {0, 0, 0, 1.5, 1}; Rectangle(4) = {1.5, 0, 0, 2.5, 1};" if cut else "Rectangle(1) = {0, 0, 0, 4, 1};"
            names = 'Physical Surface("far") = {4}; Physical Curve("cut") = {Curve In BoundingBox{1.5 - e, -e, -e, 1.5 + e, 1 + e, e}};'
            self.write("blocks.geo", BLOCKS.replace("Rectangle(1) = {0, 0, 0, 4, 1};", base).replace("Mesh.MeshSizeMax", names * cut + "\nMesh.MeshSizeMax"))
            nml = PRESSED
            if cut:
                nml += """&body name='far', volume='far', material='m' /
&support body='far', surface='bottom', fix='xy' /
&tie name='weld', surface_a='far:cut', surface_b='base:cut' /
&contact name='on', surface_a='left:up', surface_b='far:up', gap=0 /
"""
                nml = nml.replace("surface_a='right:low', surface_b='base:up'", "surface_a='right:low', surface_b='far:up'")
            self.run_scene(nml, "'displacement:left:up y', 'reaction:left:top y'")
            bars.append(self.quantities("/cases/down"))
        for name in bars[0]:
            self.assertAlmostEqual(bars[0][name][0], bars[1][name][0], delta=0.5 * bars[0][name][1], msg=name)
            self.assertBetween(0.5 * bars[0][name][1], bars[1][name][1], 2 * bars[0][name][1], name)

    def test_unknown_names_are_refused_with_what_there_is(self):
        for quantity, text in (("'force:fitt'", "there are: 'force:fit'"),
                               ("'reaction:inner:outside x'", "there are: 'reaction:inner:plane x x'"),
                               ("'displacement:inner:edge x'", "'inside'"),
                               ("'displacement:*:edge x'", "there are:"),
                               ("'displacement:middle:outside x'", "middle"),
                               ("'displacement:inner:outside z'", "an axis of the scene"),
                               ("'forces:fit'", "'KIND:NAME")):
            log = self.tubes(1, 3, quantity, code=2)
            self.assertRegex(log, r"case.nml:\d+: ")
            self.assertIn(text, log)

    def test_multigrid_has_no_bars_and_says_so(self):
        self.write("block.geo", """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};
Box(2) = {0, 0, 1, 1, 1, 1};
Physical Volume("low") = {1};
Physical Volume("high") = {2};
e = 1e-6;
Physical Surface("bottom") = {Surface In BoundingBox{-e, -e, -e, 1 + e, 1 + e, e}};
Physical Surface("top") = {Surface In BoundingBox{-e, -e, 2 - e, 1 + e, 1 + e, 2 + e}};
Mesh.ElementOrder = 2;
Mesh.MeshSizeMax = 0.5;
""")
        nml = """
&scene mesh='block.geo' /
&material name='m', young=1, poisson=0.3 /
&body name='low', volume='low', material='m' /
&body name='high', volume='high', material='m' /
&support body='low', surface='bottom', fix='xyz' /
&support body='high', surface='top', fix='xyz', value=0,0,-1e-3 /
&contact auto=.true. /
&solver response='multigrid' /
"""
        log = self.run_scene(nml, "'force:high - low'")
        self.assertIn("bodies have no factors", log)
        log = self.run_scene(nml.replace("response='multigrid'", ""), "'force:high - low'")
        self.assertTrue(re.search(r"force:.*\+-", log), log)


if __name__ == "__main__":
    dotyk_case.main()
