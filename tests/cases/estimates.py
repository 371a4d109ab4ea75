#!/usr/bin/python3
"""The estimated discretization error is never short where it is hard: at singular corners, in sheets of one layer, where
the modulus jumps; and it is no gross overestimate. Formulas that quadrature misses are told."""
import os

import dotyk_case
import estimate_scenes
import shell_scenes


class Estimates(dotyk_case.Case):
    def check(self, name, kinds, n=4, least=0.8, most=2.2):
        """Estimate over true error of a scene."""
        dotyk = os.environ["DOTYK"]
        exact = estimate_scenes.reference(self.folder, dotyk, name)
        for kind in kinds:
            with self.subTest(scene=name, kind=kind):
                self.assertBetween(least, estimate_scenes.ratio(self.folder, dotyk, name, kind, n, exact)[1], most)

    def test_smooth(self):
        self.check("smooth", ("tri3", "quad4", "tri6", "quad8"), n=8, least=0.9, most=1.15)

    def test_singular_corners(self):
        for name in ("corner", "clamped, pressed", "clamped, sheared", "crack"):
            self.check(name, ("tri3", "quad4", "tri6", "quad8"), most=1.5)
        self.check("clamped, sheared", estimate_scenes.KINDS_3D, most=1.5)

    def test_sheets_of_one_layer(self):
        self.check("sheet 1:5", ("tri6", "quad8"), n=8)
        self.check("sheet 1:20", ("tri6", "quad9"))
        self.check("sheet 1:100", ("tri6", "quad8"), n=8)
        self.check("sheet 1:20", ("tet10",), most=1.5)
        self.check("sheet 1:100", ("tri6", "tet10"), most=2)

    def test_shells_of_one_layer(self):
        """Lame's sphere and cylinder, a radius of 20 to 1000 thicknesses: before tetrahedra answered together, 41 at 1000."""
        for name, kind, slenderness in (("sphere", "tet10", 20), ("sphere", "tet10", 200), ("sphere", "tet10", 1000),
                                        ("cylinder", "tet10", 1000), ("sphere", "prism18", 200), ("sphere", "hex27", 200)):
            with self.subTest(scene=name, kind=kind, slenderness=slenderness):
                true, ratio = shell_scenes.ratio(self.folder, os.environ["DOTYK"], name, kind, 4, slenderness)
                self.assertLess(true, 4e-3)
                self.assertBetween(0.8, ratio, 3.5 if kind == "prism18" else 3)

    def test_contact_that_wraps_a_corner(self):
        self.check("contact wraps a corner, part is slave", ("tri3", "quad4", "tri6", "quad8"), most=1.4)

    def test_modulus_that_jumps(self):
        self.check("modulus jumps by 1000", ("tri3", "quad4", "tri6", "quad8"), most=2)


class Formulas(dotyk_case.Case):
    SCENE = """&scene mesh='a.geo', analysis='plane_strain' /
&material name='m', young=1, poisson=0.3%s /
&body name='s', volume='s', material='m' /
&support body='s', surface='left', fix='xy' /
&load body='s', surface='right', %s /
"""
    GEO = """Point(1) = {0, 0, 0}; line() = Extrude {2, 0, 0} { Point{1}; Layers{8}; };
face() = Extrude {0, 1, 0} { Curve{line(1)}; Layers{4}; Recombine; };
Physical Surface("s") = {face(1)}; Physical Curve("left") = {face(3)}; Physical Curve("right") = {face(2)};
"""

    def log(self, load, material=""):
        """The log of a bar under a load on its right end."""
        self.write("a.geo", self.GEO)
        self.write("a.nml", self.SCENE % (material, load))
        return self.dotyk("a.nml")

    def test_resultants(self):
        log = self.log("traction=3,-2")
        self.assertIn("s:right              force (3, -2, 0), moment about the origin -5.5", log)
        self.assertNotIn("warning", log)
        # a parabola: integral 1/6, centre at 1/2
        log = self.log("traction_formula='y*(1 - y)','0'")
        self.assertIn("force (0.16667, 0, 0), moment about the origin -0.083333", log)
        self.assertNotIn("warning", log)

    def test_formulas_that_quadrature_misses(self):
        log = self.log("traction_formula='y < 0.1 ? 1 : 0','0'")
        self.assertIn("warning: 's': the formula of the load on 'right' varies within elements: two quadrature rules "
                      "differ by", log)
        self.assertNotIn("warning", self.log("traction_formula='y < 0.25 ? 1 : 0','0'"))

    def test_moduli_that_quadrature_misses(self):
        log = self.log("traction=1,0", ", young_formula='1 + 0.9*sin(100*x)'")
        self.assertIn("warning: 's': young_formula varies within elements: two quadrature rules differ by", log)
        self.assertNotIn("warning", self.log("traction=1,0", ", young_formula='x < 1 ? 1 : 10'"))


if __name__ == "__main__":
    dotyk_case.main()
