#!/usr/bin/python3
"""Real elastic layers between bodies, and theta by formula: exact pressures, the error budget, messages."""
import os
import subprocess
import sys

import numpy as np

import dotyk_case
from blocks import LOWER, SHORTENING, UPPER, block_geo, column_exact, column_nml


class Layer(dotyk_case.Case):
    def solve(self, contact, solver="tolerance=1e-10", stiffer=1.0, code=0):
        """The column of quad8, non-matching, with keys of &contact and &solver, and blocks that are stiffer."""
        for name, n, y in zip(("lower", "upper"), (3, 4), (0.0, 1.0)):
            self.write(name + ".geo", block_geo("quad8", n, (0.0, y), (1.0, 1.0)))
        text = column_nml(2, None, contact, solver)
        for young, _ in (LOWER, UPPER):
            self.assertIn("young=%r," % young, text)
            text = text.replace("young=%r," % young, "young=%r," % (stiffer * young))
        self.write("column.nml", text)
        self.log = self.dotyk("column.nml", code=code)
        if code:
            return None
        file = self.results("column.vtkhdf")
        return file["dotyk/contact/joint"], file["dotyk/summary"].attrs

    def test_formula_on_stiff_blocks(self):
        """Blocks that are next to rigid: p = shortening/theta(x) at every point, up to their compliance over theta;
        its integral over 1 + 2 x is log(3)/2."""
        for solver in ("tolerance=1e-10", "scheme='neumann', tolerance=1e-10"):
            joint, summary = self.solve(", layer=.true., theta_formula='1 + 2*x'", solver, stiffer=1e10)
            theta = 1 + 2 * joint["position"][:, 0]
            np.testing.assert_allclose(joint["theta"][:], theta, rtol=1e-14)
            np.testing.assert_allclose(joint["pressure"][:] * theta, SHORTENING, rtol=1e-8)
            self.assertAlmostEqual(joint.attrs["force"][1] / SHORTENING / (np.log(3) / 2), 1, delta=1e-5)
            self.assertEqual(joint.attrs["layer"], 1)
            self.assertEqual(summary["error_penalty"], 0)
            self.assertEqual(summary["error_penalty_is_bound"], 1)
        self.assertRegex(self.log, r"joint .*E\+00 layer\n")
        self.assertNotIn("%, penalty", self.log)

    def test_constant_formula_is_constant_theta(self):
        """To rounding, in both discretizations; the pressure is that of the column."""
        for discretization in ("mortar", "quadrature"):
            more = ", layer=.true., discretization='%s'" % discretization
            pressures = []
            for key in ("theta=0.7", "theta_formula='0.7 + 0*x'"):
                joint, _ = self.solve(", " + key + more)
                pressures.append(joint["pressure"][:])
            np.testing.assert_allclose(pressures[0], column_exact(0.7, None)[0], rtol=1e-9)
            np.testing.assert_allclose(pressures[1], pressures[0], rtol=1e-12)

    def test_a_layer_is_no_penalty(self):
        """The same theta as a penalty has an error; as a layer it has none, and nothing is solved for it."""
        keys = ", theta=0.7, discretization='mortar'"
        joint, penalty = self.solve(keys)
        self.assertEqual(joint.attrs["layer"], 0)
        self.assertGreater(penalty["error_penalty"], 0.1)
        self.assertIn("the penalty term is", self.log)
        layer_joint, layer = self.solve(keys + ", layer=.true.")
        self.assertEqual(layer["error_penalty"], 0)
        self.assertNotIn("the penalty term is", self.log)
        self.assertEqual(layer["body_solves"], penalty["body_solves"])
        np.testing.assert_array_equal(layer_joint["pressure"][:], joint["pressure"][:])

    def test_the_budget_keeps_a_layer(self):
        """No tolerance: the budget decides, and a theta that is 1000 times what it would allow stays."""
        joint, summary = self.solve(", layer=.true., theta=50", "")
        self.assertEqual(joint.attrs["theta"], 50)
        np.testing.assert_allclose(joint["pressure"][:], column_exact(50, None)[0], rtol=1e-6)
        self.assertNotIn("multiplied", self.log)
        self.assertEqual(summary["error_penalty"], 0)

    def test_layers_are_at_quadrature_points(self):
        """The literal form is the default of layers, the mortar mean that of penalties."""
        for keys, n in ((", theta=1, layer=.true.", 18), (", theta=1", 5),
                        (", theta=1, layer=.true., discretization='mortar'", 5)):
            joint, _ = self.solve(keys)
            self.assertEqual(joint["weight"].shape[0], n, keys)

    def test_penalty_error_at_quadrature_points(self):
        """Extrapolated: near the exact one of the column."""
        exact = column_exact(0, None)[0], column_exact(0.1, None)[0]
        solver = "tolerance=1e-10, linear_solver='iterative'"
        _, with_error = self.solve(", theta=0.1, discretization='quadrature'", solver)
        self.assertEqual(with_error["error_penalty_is_bound"], 0)
        self.assertAlmostEqual(with_error["error_penalty"] / (exact[0] / exact[1] - 1), 1, delta=0.1)
        self.assertRegex(self.log, "penalty ~ [0-9.]+ %")

    def test_orders(self):
        """studies/layer.py --quick: the orders of both discretizations under full contact."""
        script = dotyk_case.ROOT / "studies/layer.py"
        done = subprocess.run([sys.executable, "-B", script, "--quick", "--kinds", "quad8", "--dotyk",
                               os.environ["DOTYK"]], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertEqual(done.stdout.count("| quad8 | full |"), 3, done.stdout)

    def test_messages(self):
        """Each names file, line, pair and point."""
        for contact, solver, expected in (
                (", theta_formula='x - 2'", "", r"&contact 'joint': theta_formula is -1\.9\d* at \(0\.0\d*, 1, 0\); "
                 "theta must not be negative"),
                (", theta_formula='1/0'", "", r"&contact 'joint': theta_formula is infinity at \("),
                (", theta_formula='0'", "scheme='neumann'",
                 r"theta_formula is 0 at \(.*\); theta = 0 needs scheme='dual'"),
                (", theta_formula='0', layer=.true.", "",
                 r"theta_formula is 0 at \(.*\); theta of a layer must be positive"),
                (", theta_formula='x', theta=1", "", "theta and theta_formula are both given"),
                (", layer=.true.", "", r"layer=\.true\. needs theta, the compliance of the layer"),
                (", layer=.true.", "theta=0", r"layer=\.true\. needs theta > 0"),
                (", layer=.true., theta_mesh=1", "",
                 r"layer=\.true\. needs the compliance of the layer, which no mesh")):
            self.solve(contact, solver, code=2)
            self.assertRegex(self.log, r"column\.nml:10: .*" + expected)


dotyk_case.main()
