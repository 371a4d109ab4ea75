#!/usr/bin/python3
"""studies/theory.py --quick: Theorems 1, 3 and 4 on small scenes, also with Robin conditions, the bounds, and what
depends on the mesh."""
import copy
import os
import pathlib
import sys
import tempfile

import numpy as np

import dotyk_case

sys.path.insert(0, str(dotyk_case.ROOT / "studies"))
import theory  # noqa: E402


class Theory(dotyk_case.Case):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="dotyk-") as folder:
            cls.measured = theory.measure(os.path.abspath(os.environ["DOTYK"]), folder, quick=True)
        cls.figures = theory.figures(cls.measured)

    def test_nothing_contradicts_the_theory(self):
        self.assertEqual(theory.contradictions(self.figures), [])

    def test_penalty(self):
        """Theorem 1: slope 1 where theta is small against the compliance of the bodies; the bend takes 3e-4 of it at
        1e-3."""
        for name in ("column", "wave"):
            self.assertAlmostEqual(self.figures["slope at small theta, " + name][0], 1, delta=1e-3)
        # the tolerance of the dual scheme is 1e-12 of the norm, the least error 1e-6
        self.assertLess(self.figures["error against theta/(c + theta), column"][1], 1e-6)
        wave = self.measured["penalty"]["wave"]
        self.assertGreater(wave["rows"][0]["active"], wave["active"])

    def test_factor(self):
        """Theorems 3 and 4: never above q, nor above (40); 2/(1+L) is sharp where all points stay closed."""
        for name, iteration in self.measured["iteration"].items():
            for row in iteration["rows"]:
                self.assertLess(row["largest"], row["q"] * (1 + 1e-6), (name, row["gamma"]))
                if row["gamma"] < iteration["limit_of_paper"]:
                    self.assertLess(row["largest"], row["q_of_paper"] * (1 + 1e-6), (name, row["gamma"]))
                if row["gamma"] < iteration["limit"]:
                    self.assertTrue(row["converged"] and not row["warned"], (name, row["gamma"]))
                else:
                    self.assertTrue(row["warned"], (name, row["gamma"]))
        # 1 - gamma is attained where points open again
        iteration = self.measured["iteration"]["open wave"]
        open_best = min(iteration["rows"], key=lambda row: abs(row["gamma"] - iteration["best"]))
        self.assertGreater(open_best["largest"] / open_best["q"], 0.99)
        beyond = self.measured["iteration"]["closed wave"]["rows"][-1]
        self.assertTrue(beyond["diverged"])
        self.assertGreater(beyond["largest"], 1)

    def test_general_iteration(self):
        """(32) with Robin conditions on all points, on some, and on one joint of two: the constants differ, and the best
        gamma by Lambda takes far fewer iterations than that of Theorem 4."""
        for scene in self.measured["general"].values():
            constants = {name: form["constants"] for name, form in scene["forms"].items()}
            self.assertEqual(constants["G = A"]["coercivity"], 1)
            for name, one in constants.items():
                self.assertEqual(one["coercivity"] < 1, name != "G = A")
                self.assertLessEqual(one["smoothness"], 1 + one["penalty_constant"])
                iterations = [row["iterations"] for gamma in ("gamma_theory", "best")
                              for row in scene["forms"][name]["rows"] if row["gamma"] == one[gamma]]
                self.assertGreater(iterations[0], 4 * iterations[1], name)
            self.assertLess(constants["Robin, all points"]["smoothness"], constants["G = A"]["smoothness"] / 2)
        self.assertLess(self.measured["general"]["open layers"]["closed"], 1)
        self.assertEqual(self.measured["general"]["closed layers"]["closed"], 1)
        text = theory.general_iteration.table(self.measured["general"])
        self.assertEqual(len(text.splitlines()), 16)
        self.assertEqual(len({line.count(" | ") for line in text.splitlines()[2:]}), 1)

    def test_bounds(self):
        """Never below the true error; the guaranteed one is not far above it."""
        for name, iteration in self.measured["iteration"].items():
            ratios = theory.ratios(iteration, "bounds")
            self.assertGreaterEqual(ratios.min(), 1 - 1e-6, name)
            self.assertLess(ratios.max(), 10, name)
            self.assertGreaterEqual(theory.ratios(iteration, "bounds_of_paper").min(), 1 - 1e-6, name)
            # distances of contact states and of displacements
            self.assertLess(iteration["deviation"], 1e-6, name)
            for row in iteration["rows"]:
                inside = row["gamma"] < iteration["limit_of_paper"]
                known = np.isfinite(row["bounds_of_paper"][1:])
                np.testing.assert_array_equal(known, np.full(known.shape, inside),
                                              err_msg="%s, gamma %g" % (name, row["gamma"]))

    def test_bounds_of_all_schemes(self):
        """Never below the true error; how far above is the schemes' own affair."""
        self.assertEqual(set(self.measured["schemes"]), {"neumann", "robin", "dual"})
        for scheme, ratios in self.measured["schemes"].items():
            self.assertGreaterEqual(min(ratios), 1 - 1e-6, scheme)

    def test_meshes(self):
        """theta fixed: L to the 1 % of its estimate, and steps; theta as h: both as 1/h."""
        rows = self.measured["meshes"]["wave, fixed theta"]
        self.assertLess(np.ptp([row["lambda_max"] for row in rows]) / rows[0]["lambda_max"], 0.02)
        self.assertLess(np.ptp([row["iterations"] for row in rows]) / rows[0]["iterations"], 0.03)
        rows = self.measured["meshes"]["wave, theta as h"]
        for key in ("lambda_max", "iterations"):
            self.assertAlmostEqual(theory.slope([1 / row["h"] for row in rows], [row[key] for row in rows]), 1,
                                   delta=0.03)

    def test_contradictions_are_seen(self):
        """Figures with an error of the program put in."""
        def spoiled(change):
            measured = copy.deepcopy(self.measured)
            change(measured)
            return "\n".join(theory.contradictions(theory.figures(measured)))

        def low_bound(measured):
            measured["iteration"]["open wave"]["rows"][0]["bounds"] /= 2

        def slow_step(measured):
            measured["iteration"]["closed wave"]["rows"][0]["largest"] *= 1.2

        def half_slope(measured):
            for row in measured["penalty"]["wave"]["rows"]:
                row["error"] = np.sqrt(row["theta"]) / 100

        def small_lambda(measured):
            measured["iteration"]["column"]["L"] *= 0.95

        for change, name in ((low_bound, "bound over error, open wave"), (slow_step, "factor over q, closed wave"),
                             (half_slope, "slope at small theta, wave"), (small_lambda, "L over exact L, column")):
            self.assertIn(name, spoiled(change))

    def test_table_and_figure(self):
        lines = theory.table(self.measured).splitlines()
        self.assertEqual({line.count("|") for line in lines}, {lines[0].count("|")})
        self.assertIn("Theorem 4", "\n".join(lines))
        picture = pathlib.Path(self.folder) / "theory.png"
        theory.draw(self.measured, picture)
        self.assertEqual(picture.read_bytes()[:4], b"\x89PNG")
        self.assertLess(picture.stat().st_size, 200000)


dotyk_case.main()
