#!/usr/bin/python3
"""The examples: each runs to convergence and is as near to its exact answer as stated, by the functions of its check.py."""
import importlib.util
import re

import numpy as np

import dotyk_case


def check_of(example):
    """The module inputs/<example>/check.py."""
    spec = importlib.util.spec_from_file_location("check_" + example, dotyk_case.INPUTS / example / "check.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Examples(dotyk_case.Case):
    def edit(self, name, *changes):
        """Replace patterns in a file of the folder; each must be there once."""
        text = (self.folder / name).read_text()
        for pattern, new in changes:
            text, n = re.subn(pattern, new, text, flags=re.M)
            self.assertEqual(n, 1, pattern)
        self.write(name, text)

    def run_example(self, name):
        """Run it and check that it ended as it says."""
        self.dotyk("%s/%s.nml" % (name, name))
        file = self.results("%s/%s.vtkhdf" % (name, name))
        summary = file["dotyk/summary"].attrs
        tolerance = float(re.search(r"tolerance=([^ ,/]+)", (self.folder / name / (name + ".nml")).read_text())[1])
        self.assertEqual(summary["converged"], 1)
        self.assertLessEqual(summary["error_bound"], tolerance)
        self.assertLessEqual(summary["iterations"], 8)
        return file

    def test_column(self):
        self.copy("column")
        self.run_example("column")
        errors = check_of("column").errors(self.folder / "column/column.vtkhdf")
        self.assertLess(abs(errors["mean_error"]), 1e-3)
        # Facets of surface_a are cut by those of surface_b: single pressures are as good as the means there.
        self.assertLess(errors["largest_error"], 0.05)

    def test_wavy(self):
        self.copy("wavy")
        file = self.run_example("wavy")
        errors = check_of("wavy").errors(self.folder / "wavy/wavy.vtkhdf")
        # Some 25 elements over the contact zone: 2 %.
        self.assertLess(abs(errors["a_error"]), 0.02)
        self.assertLess(abs(errors["p0_error"]), 0.02)
        self.assertLess(errors["profile_error"], 0.02)
        wave = file["dotyk/contact/wave"]
        # The gap is the formula in the mean at each vertex: less by h^2/12 of its second derivative.
        x = wave["position"][:, 0]
        gap = 0.002 * (1 - np.cos(2 * np.pi * x) - (2 * np.pi / 80)**2 / 12 * np.cos(2 * np.pi * x))
        inside = np.minimum(x, 0.5 - x) > 1e-6
        np.testing.assert_allclose(wave["gap_initial"][inside], gap[inside], rtol=0, atol=1e-9)

    def test_wavy_at_quadrature_points(self):
        self.copy("wavy")
        # Quadrature points need a penalty: without it their single pressures are not determined.
        self.edit("wavy/wavy.nml", (r"theta_relative=[^,]+", "theta_relative=2e-3"), (r"name='wave',", "name='wave', points='quadrature',"))
        file = self.run_example("wavy")
        errors = check_of("wavy").errors(self.folder / "wavy/wavy.vtkhdf")
        self.assertLess(abs(errors["a_error"]), 0.02)
        self.assertLess(abs(errors["p0_error"]), 0.02)
        self.assertLess(errors["profile_error"], 0.02)
        wave = file["dotyk/contact/wave"]
        # The gap is the formula at each point.
        x = wave["position"][:, 0]
        np.testing.assert_allclose(wave["gap_initial"][:], 0.002 * (1 - np.cos(2 * np.pi * x)), rtol=0, atol=1e-15)

    def test_hertz_coarse(self):
        """4 elements over the contact radius, for a quick test: six such meshes are within 0.7 % of a and p0, and 8 %."""
        self.copy("hertz")
        self.edit("hertz/hertz.geo", (r"\[n = 10\]", "[n = 4]"), (r"\[g = 0.25\]", "[g = 0.4]"))
        self.run_example("hertz")
        errors = check_of("hertz").errors(self.folder / "hertz/hertz.vtkhdf")
        self.assertLess(abs(errors["a_error"]), 0.015)
        self.assertLess(abs(errors["p0_error"]), 0.015)
        self.assertLess(errors["profile_error"], 0.1)
        # What is measured is right on the exact pressure.
        self.assertLess(errors["estimator_error"], 1e-3)
        self.assertLess(errors["a/R"], 0.06)

    def test_composite(self):
        """Softer joints, for a quick test. There is no exact answer: balance, signs and symmetry instead."""
        self.copy("composite")
        self.edit("composite/composite.nml", (r"theta_relative=\S+?,", "theta_relative=1,"))
        file = self.run_example("composite")
        joints = [file["dotyk/contact/joint %d" % k] for k in range(1, 8)]
        forces = np.array([joint.attrs["force"] for joint in joints])
        load = 50e6 * 0.15**2
        # Clamped edges take a part of the load in every plate: the force grows from below to above and stays below the load.
        self.assertTrue(np.all(np.diff(forces[:, 2]) > 0), forces)
        self.assertGreater(forces[0, 2], 0)
        self.assertLess(forces[-1, 2], load)
        # Flat joints without friction: no force along them.
        np.testing.assert_allclose(forces[:, :2], 0, atol=1e-9 * load)
        for joint in joints:
            p, w = joint["pressure"][:], joint["weight"][:]
            self.assertGreaterEqual(p.min(), 0)
            self.assertAlmostEqual(np.sum(w * p) / joint.attrs["force"][2], 1, delta=1e-9)
            self.assertAlmostEqual(np.sum(w) / 0.25, 1, delta=1e-12)
            # p = penetration/theta
            np.testing.assert_allclose(p, np.maximum(0, -joint["gap"][:]) / joint.attrs["theta"], rtol=0, atol=2e-3 * p.max())
        # The quarter, its mesh and its load do not change when x and y are swapped.
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        body = np.repeat(np.arange(8), file["VTKHDF/NumberOfPoints"][:])
        keys = np.column_stack([body, np.round(x / 1e-6)])
        here = np.lexsort(keys.T)
        there = np.lexsort(keys[:, [0, 2, 1, 3]].T)
        np.testing.assert_allclose(x[here], x[there][:, [1, 0, 2]], rtol=0, atol=1e-9)
        np.testing.assert_allclose(u[here], u[there][:, [1, 0, 2]], rtol=0, atol=1e-9 * np.abs(u).max())

    def test_ball_between_plates_coarse(self):
        """3 elements over the contact radius, for a quick test: 5 % of a, 5 % of p0, and the same balance."""
        self.copy("ball_between_plates")
        self.edit("ball_between_plates/ball_between_plates.geo", (r"^h = a/5;", "h = a/3;"), (r"^H = R/4;", "H = R/2.5;"))
        self.run_example("ball_between_plates")
        check = check_of("ball_between_plates")
        errors = check.errors(self.folder / "ball_between_plates/ball_between_plates.vtkhdf")
        self.assertLess(errors["force_error"], check.FORCE)
        self.assertLess(errors["force_difference"], check.FORCE)
        for name, contact in errors["contacts"].items():
            self.assertLess(abs(contact["a_error"]), 0.05, name)
            self.assertLess(abs(contact["p0_error"]), 0.05, name)
            self.assertLess(contact["profile_error"], 0.15, name)

    def limits(self, example):
        """Run it and compare all errors with the limits of its check.py."""
        self.copy(example)
        self.run_example(example)
        check = check_of(example)
        errors, *figures = check.errors(self.folder / example / (example + ".vtkhdf"))
        for name, error in errors.items():
            limit = check.LIMITS[name] if hasattr(check, "LIMITS") else check.TOLERANCE
            self.assertLessEqual(error, limit, name)
        return figures

    def test_free_stack(self):
        figures, = self.limits("free_stack")
        # The load does not spread over the whole plates in any joint, and spreads from above to below.
        self.assertTrue(np.all(np.diff(figures["open"]) > -0.02), figures["open"])

    def test_nearly_rigid_bricks(self):
        """Bricks 5e5 times as stiff as the ground touch on edges and corners: active sets come back, and the proximal method ends it."""
        self.copy("bricks")
        self.edit("bricks/bricks.nml", (r"young=15e3", "young=15e9"))
        text = self.dotyk("bricks/bricks.nml")
        self.assertIn("the proximal method of multipliers goes on", text)
        file = self.results("bricks/bricks.vtkhdf")
        self.assertLessEqual(file["dotyk/summary"].attrs["error_bound"], 1e-8)
        force = {name: pair.attrs["force"][2] for name, pair in file["dotyk/contact"].items()}
        # The beds carry three bricks, the bearings one.
        self.assertAlmostEqual((force["left bed"] + force["right bed"]) / -(force["left bearing"] + force["right bearing"]), 3, delta=1e-8)

    def test_bricks(self):
        reaction, = self.limits("bricks")
        # Each reaction acts where the bridging brick lies on another one.
        self.assertTrue(230 < reaction["x1"] < 290 and 380 < reaction["x2"] < 470, reaction)

    def test_bearing(self):
        self.limits("bearing")

    def test_receding(self):
        """The contact of a layer that lifts off is the same under any load."""
        self.copy("receding")
        self.run_example("receding")
        self.dotyk("receding/tenfold.nml")
        check = check_of("receding")
        path, other = self.folder / "receding/receding.vtkhdf", self.folder / "receding/tenfold.vtkhdf"
        errors = check.errors(path, check.LOAD["receding"])
        self.assertLess(abs(errors["b_error"]), check.WIDTH_ERROR)
        self.assertLess(errors["profile_error"], check.PROFILE_ERROR)
        self.assertLess(abs(errors["force_error"]), check.FORCE_ERROR)
        scaled = check.scaled_errors(path, check.LOAD["receding"], other, check.LOAD["tenfold"])
        self.assertEqual(scaled["points"], 0)
        self.assertLess(scaled["b_error"], check.SCALED_ERROR)
        self.assertLess(scaled["pressure_error"], check.SCALED_ERROR)

    def coarse(self, example, h, factors, **measured):
        """Run it on a coarse mesh, for a quick test: errors as measured there, times `factors`; the limits of check.py for the others."""
        self.copy(example)
        self.edit("%s/%s.geo" % (example, example), (r"^h = [^;]+;", "h = %s;" % h))
        self.run_example(example)
        check = check_of(example)
        errors, figures = check.errors(self.folder / example / (example + ".vtkhdf"))
        for name, error in errors.items():
            self.assertLessEqual(error, factors * measured[name] if name in measured else check.LIMITS[name], name)
        return figures

    def test_groove_coarse(self):
        """25 elements over the groove."""
        self.coarse("groove", "b/25", 2, c=4.4e-3, peak=9.0e-3, profile=2.5e-2)
        # The theory beside the example: two half-planes in place of a row of grooves.
        check = check_of("groove")
        c, peak = check.closed_form()
        self.assertAlmostEqual(check.row(1e4) / c, 1, delta=1e-8)
        self.assertAlmostEqual(check.row(check.PERIOD) / c, 1, delta=1e-4)
        self.assertAlmostEqual(check.pressure(check.WIDTH) / peak, 1, delta=1e-12)
        self.assertAlmostEqual(check.pressure(1e3) / check.PRESSURE, 1, delta=1e-6)

    def test_cylinder_coarse(self):
        """10 elements over half the width of the contact."""
        self.coarse("cylinder", "b/10", 2, b=1.4e-3, p0=5e-4, profile=1.5e-2)


dotyk_case.main()
