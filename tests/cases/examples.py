#!/usr/bin/python3
"""The examples: each runs to convergence and is as near to its exact answer as stated, by the functions of its
check.py."""
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
        given = re.search(r"tolerance=([^ ,/]+)", (self.folder / name / (name + ".nml")).read_text())
        tolerance = float(given[1]) if given else 1e-6
        self.assertEqual(summary["converged"], 1)
        self.assertLessEqual(summary["error_bound"], tolerance)
        self.assertLessEqual(summary["iterations"], 8)
        return file

    def test_column(self):
        self.copy("column")
        self.run_example("column")
        check = check_of("column")
        errors = check.errors(self.folder / "column/column.vtkhdf")
        for name, limit in check.LIMITS.items():
            self.assertLess(abs(errors[name]), limit, name)

    def test_tunnel(self):
        """Coarser: 2 elements through the lining."""
        self.copy("tunnel")
        self.edit("tunnel/tunnel.geo", (r"n = 3", "n = 2"))
        self.run_example("tunnel")
        check = check_of("tunnel")
        errors = check.errors(self.folder / "tunnel/tunnel.vtkhdf")
        for name, limit in check.LIMITS.items():
            self.assertLessEqual(errors[name], 4 * limit, name)

    def test_wavy(self):
        self.copy("wavy")
        file = self.run_example("wavy")
        errors = check_of("wavy").errors(self.folder / "wavy/wavy.vtkhdf")
        # Some 25 elements over the contact zone: 2 %.
        self.assertLess(abs(errors["a_error"]), 0.02)
        self.assertLess(abs(errors["p0_error"]), 0.02)
        self.assertLess(errors["profile_error"], 0.02)
        wave = file["dotyk/contact/wave"]
        # The gap is the formula in the mean at each vertex, less by h^2/12 of its second derivative; but the formula
        # itself where the facets merely touch, at the vertex beside the crest, too.
        x = wave["position"][:, 0]
        gap = 0.002 * (1 - np.cos(2 * np.pi * x) - (2 * np.pi / 80)**2 / 12 * np.cos(2 * np.pi * x))
        inside = np.minimum(x - 1 / 80, 0.5 - x) > 1e-6
        np.testing.assert_allclose(wave["gap_initial"][inside], gap[inside], rtol=0, atol=1e-9)

    def test_wavy_slice(self):
        """In three dimensions, 20 elements a wave."""
        self.copy("wavy")
        self.edit("wavy/slice.geo", (r"^h = [^;]+;", "h = l/20;"))
        self.dotyk("wavy/slice.nml")
        errors = check_of("wavy").errors(self.folder / "wavy/slice.vtkhdf")
        # Twice what is measured.
        self.assertLess(abs(errors["p0_error"]), 9e-3)
        self.assertLess(errors["profile_error"], 8e-2)

    def test_wavy_at_quadrature_points(self):
        self.copy("wavy")
        # Quadrature points need a penalty: without it their single pressures are not determined.
        self.edit("wavy/wavy.nml", ("tolerance=", "theta_relative=2e-3, tolerance="),
                  (r"name='wave',", "name='wave', discretization='quadrature',"))
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
        """4 elements over the contact radius, for a quick test: six such meshes are within 0.7 % of a and p0, and
        8 %."""
        self.copy("hertz")
        self.edit("hertz/hertz.geo", (r"\[n = 10\]", "[n = 4]"), (r"\[s = 2.5\]", "[s = 1.6]"))
        self.run_example("hertz")
        errors = check_of("hertz").errors(self.folder / "hertz/hertz.vtkhdf")
        self.assertLess(abs(errors["a_error"]), 0.015)
        self.assertLess(abs(errors["p0_error"]), 0.015)
        self.assertLess(errors["profile_error"], 0.1)
        # What is measured is right on the exact pressure.
        self.assertLess(errors["estimator_error"], 1e-3)
        self.assertLess(errors["a/R"], 0.06)

    def test_hertz_axisymmetric_coarse(self):
        """10 elements over the contact radius: measured, 0.14 % of a, 0.11 % of p0, 6 % in the mean square."""
        self.copy("hertz_axisymmetric")
        self.edit("hertz_axisymmetric/hertz_axisymmetric.geo", (r"\[n = 40\]", "[n = 10]"), (r"\[s = 4\]", "[s = 2]"))
        self.run_example("hertz_axisymmetric")
        errors, _ = check_of("hertz_axisymmetric").errors(self.folder / "hertz_axisymmetric/hertz_axisymmetric.vtkhdf")
        for name, limit in {"radius": 4e-3, "peak": 4e-3, "profile": 0.1, "depression": 1e-3, "approach": 3e-3,
                            "force": 1e-9}.items():
            self.assertLess(errors[name], limit, name)

    def test_ssnv104_coarse(self):
        """Two hemispheres and half of them with 20 elements over the contact radius, a quarter with 5, against the
        finest meshes."""
        self.copy("ssnv104")
        self.edit("ssnv104/ssnv104.geo", (r"\[n = 40\]", "[n = 20]"))
        self.edit("ssnv104/quarter.geo", (r"\[n = 8\]", "[n = 5]"))
        self.run_example("ssnv104")
        self.dotyk("ssnv104/half.nml")
        self.dotyk("ssnv104/quarter.nml")
        check = check_of("ssnv104")
        # Measured: 1.1e-3, 2e-4, 8e-3.
        for name, limit in {"ssnv104": 4e-3, "half": 4e-3, "quarter": 0.02}.items():
            errors, _ = check.errors(self.folder / "ssnv104" / (name + ".vtkhdf"))
            for what in "force", "radius", "pressure at the axis":
                self.assertLess(errors[what], limit, name + ": " + what)
            self.assertEqual(errors["not converged"], 0)

    def test_composite(self):
        """Softer joints, for a quick test. There is no exact answer: balance, signs and symmetry instead."""
        self.copy("composite")
        self.edit("composite/composite.nml", ("tolerance=", "theta_relative=1, tolerance="))
        file = self.run_example("composite")
        joints = [file["dotyk/contact/joint %d" % k] for k in range(1, 8)]
        forces = np.array([joint.attrs["force"] for joint in joints])
        load = 50e6 * 0.15**2
        # Clamped edges take a part of the load in every plate: the force grows from below to above and stays below the
        # load.
        self.assertIncreasing(forces[:, 2])
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
            np.testing.assert_allclose(p, np.maximum(0, -joint["gap"][:]) / joint.attrs["theta"], rtol=0,
                                       atol=2e-3 * p.max())
        # The quarter, its mesh and its load do not change when x and y are swapped.
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        body = np.repeat(np.arange(8), file["VTKHDF/NumberOfPoints"][:])
        keys = np.column_stack([body, np.round(x / 1e-6)])
        here = np.lexsort(keys.T)
        there = np.lexsort(keys[:, [0, 2, 1, 3]].T)
        np.testing.assert_allclose(x[here], x[there][:, [1, 0, 2]], rtol=0, atol=1e-9)
        np.testing.assert_allclose(u[here], u[there][:, [1, 0, 2]], rtol=0, atol=1e-9 * np.abs(u).max())

    def test_ball_between_plates_coarse(self):
        """4 elements over the contact radius, for a quick test: three such meshes are within 1.1 % of a, 0.5 % of p0,
        and 7 %."""
        self.copy("ball_between_plates")
        self.edit("ball_between_plates/ball_between_plates.geo", (r"\[n = 8\]", "[n = 4]"),
                  (r"\[s = 2.5\]", "[s = 1.6]"))
        self.run_example("ball_between_plates")
        check = check_of("ball_between_plates")
        errors = check.errors(self.folder / "ball_between_plates/ball_between_plates.vtkhdf")
        self.assertLess(errors["force_error"], check.FORCE)
        self.assertLess(errors["force_difference"], check.FORCE)
        for name, contact in errors["contacts"].items():
            self.assertLess(abs(contact["a_error"]), 0.02, name)
            self.assertLess(abs(contact["p0_error"]), 0.015, name)
            self.assertLess(contact["profile_error"], 0.1, name)

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
        self.assertIncreasing(figures["open"], -0.02)

    def test_nearly_rigid_bricks(self):
        """Bricks 5e5 times as stiff as the ground touch on edges and corners: active sets cycle, and the interior-point
        method finds the solution."""
        self.copy("bricks")
        self.edit("bricks/bricks.nml", (r"young=15e3", "young=15e9"))
        text = self.dotyk("bricks/bricks.nml")
        self.assertIn("active-set iteration cycled; interior-point method used", text)
        file = self.results("bricks/bricks.vtkhdf")
        self.assertLessEqual(file["dotyk/summary"].attrs["error_bound"], 1e-8)
        force = {name: pair.attrs["force"][2] for name, pair in file["dotyk/contact"].items()}
        # The beds carry three bricks, the bearings one.
        bearings = force["left bearing"] + force["right bearing"]
        self.assertAlmostEqual((force["left bed"] + force["right bed"]) / -bearings, 3, delta=1e-8)

    def test_bricks(self):
        reaction, = self.limits("bricks")
        # Each reaction acts where the bridging brick lies on another one.
        self.assertBetween(230, reaction["x1"], 290)
        self.assertBetween(380, reaction["x2"], 470)

    def test_balls_in_box(self):
        self.copy("balls_in_box")
        self.dotyk("balls_in_box/balls_in_box.nml")
        check = check_of("balls_in_box")
        errors, lid = check.errors(self.folder / "balls_in_box/balls_in_box.vtkhdf")
        for name, error in errors.items():
            self.assertLessEqual(error, check.LIMITS[name], name)
        self.assertGreater(lid, 1)

    def test_bearing(self):
        self.limits("bearing")

    def test_flange(self):
        """35 bodies and eight bolts, tightened, under pressure and heat; what neither loads nor contact determine of 34 of
        them shares a line."""
        self.copy("flange")
        self.edit("flange/flange.nml", (r"^&solver", "&output error_parts='', fields='displacement contact' /\n&solver"))
        text = self.dotyk("flange/flange.nml")
        self.assertEqual(text.count("  not determined by contact: "), 3, text)
        self.assertRegex(text, "not determined by contact: sliding along .* of 'gasket', 'cover', 'bolt \\*' \\(8 bodies\\), "
                               "'washer \\*' \\(8 bodies\\), 'nut \\*' \\(8 bodies\\); least motion taken")
        self.assertIn("35 bodies in 7 congruence classes", text)
        check = check_of("flange")
        errors = check.errors(self.folder / "flange/flange.vtkhdf")[0]
        for name, limit in check.LIMITS.items():
            self.assertLessEqual(errors[name], limit, name)

    def test_assembly(self):
        """A STEP file of eleven solids, coarser."""
        self.copy("assembly")
        self.edit("assembly/assembly.nml", ("mesh_size=8", "mesh_size=14"), (r"^&solver", "&output error_parts='' /\n&solver"))
        self.assertIn("16 pairs of faces that face each other", self.dotyk("assembly/assembly.nml"))
        check = check_of("assembly")
        errors = check.errors(self.folder / "assembly/assembly.vtkhdf")[0]
        for name, limit in check.LIMITS.items():
            self.assertLessEqual(errors[name], limit, name)

    def test_conrod(self):
        """The joint opens where the pin pulls, and nowhere else."""
        self.copy("conrod")
        self.dotyk("conrod/conrod.nml")
        check = check_of("conrod")
        errors, state = check.errors(self.folder / "conrod/conrod.vtkhdf")
        for name, limit in check.LIMITS.items():
            self.assertLessEqual(errors[name], limit, name)
        self.assertEqual((state["fitted"][0], state["pushed"][0]), (1, 1))
        self.assertBetween(0.7, state["pulled"][0], 0.95)

    def test_ball_bearing(self):
        """Coarser: half of the unknowns. Spinning and rolling of the balls are indeterminate, not noise."""
        self.copy("ball_bearing")
        for name in "ball", "ball_bearing":
            self.edit("ball_bearing/%s.geo" % name, (r"\[n = 2.4\]", "[n = 1.5]"), (r"^g = 0.7;", "g = 0.9;"))
        self.edit("ball_bearing/ball_bearing.geo", (r"^H = 3;", "H = 2.2;"))
        self.edit("ball_bearing/ball_bearing.nml", (r"^&solver", "&output error_parts='' /\n&solver"))
        file = self.run_example("ball_bearing")
        # One more than it takes to find which facets the contact spans: these bend.
        self.assertLessEqual(file["dotyk/summary"].attrs["iterations"], 6)
        check = check_of("ball_bearing")
        errors = check.errors(self.folder / "ball_bearing/ball_bearing.vtkhdf")[0]
        # One element and a half over half the width of the contact: three such meshes are within 7 % and 1.1 %.
        factors = {"peak pressures": 2, "left against right": 2}
        for name, limit in check.LIMITS.items():
            self.assertLessEqual(errors[name], limit * factors.get(name, 1), name)

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
        """Run it on a coarse mesh, for a quick test: errors as measured there, times `factors`; for the others
        check.py's limits."""
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
        self.coarse("groove", "b/25", 2, c=5.0e-3, peak=1.0e-2, profile=2.6e-2)
        # The theory beside the example: two half-planes in place of a row of grooves.
        check = check_of("groove")
        c, peak = check.closed_form()
        self.assertAlmostEqual(check.row(1e4) / c, 1, delta=1e-8)
        self.assertAlmostEqual(check.row(check.PERIOD) / c, 1, delta=1e-4)
        self.assertAlmostEqual(check.pressure(check.WIDTH) / peak, 1, delta=1e-12)
        self.assertAlmostEqual(check.pressure(1e3) / check.PRESSURE, 1, delta=1e-6)

    def test_groove_row_coarse(self):
        """25 elements over each groove."""
        self.coarse("groove_row", "b/25", 2, c=4.2e-3, peak=7.6e-3, profile=2.1e-2)
        # In the theory, pressure and gap leave the faces flat where they touch: an elastic displacement by Fourier's
        # series.
        check = check_of("groove_row")
        n = 2**14
        x = (np.arange(n) + 0.5) / n * check.PERIOD - check.PERIOD / 2
        waves = np.fft.rfft(check.pressure(x))
        stiffness = check.YOUNG / (1 - check.POISSON**2) / 2
        waves[1:] *= 2 / (stiffness * 2 * np.pi / check.PERIOD * np.arange(1, len(waves)))
        closed = (np.fft.irfft(waves, n) + check.gap(x))[np.abs(x) > check.closed_form()[0]]
        self.assertLess(np.ptp(closed), 1e-5 * check.DEPTH)
        # The formula of the scene is that gap.
        with self.results("groove_row/groove_row.vtkhdf") as file:
            groove = file["dotyk/contact/groove"]
            np.testing.assert_allclose(groove["gap_initial"][:], check.gap(groove["position"][:, 0]), rtol=0,
                                       atol=2e-3 * check.DEPTH)

    def test_cylinder_coarse(self):
        """10 elements over half the width of the contact."""
        self.coarse("cylinder", "b/10", 2, b=1.3e-3, p0=5.5e-4, profile=1.5e-2)

    def test_punch_coarse(self):
        """25 elements over half the width of the contact."""
        self.coarse("punch", "b/25", 2, b=6.9e-4, peak=1.9e-3, middle=4.9e-4, profile=9.2e-3)
        # The formulae against a numerical solution of the integral equation
        check = check_of("punch")
        b = check.half_width()
        force, x, p = check.numerical(b)
        self.assertAlmostEqual(force / check.FORCE, 1, delta=1e-4)
        np.testing.assert_allclose(p, check.pressure(x, b), rtol=0, atol=1e-3 * p.max())

    def test_press_fit(self):
        """The interference given as a gap, and drawn; then linear elements."""
        self.limits("press_fit")
        check = check_of("press_fit")
        self.dotyk("press_fit/overlap.nml")
        errors, _ = check.errors(self.folder / "press_fit/overlap.vtkhdf")
        for name, error in errors.items():
            self.assertLessEqual(error, check.LIMITS[name], name)
        self.edit("press_fit/press_fit.geo", (r"^order = 2;", "order = 1;"))
        self.run_example("press_fit")
        errors, _ = check.errors(self.folder / "press_fit/press_fit.vtkhdf")
        # Chords of 7 degrees; twice what is measured.
        self.assertLess(errors["pressure"], 8e-3)
        self.assertLess(errors["hoop"], 8e-3)

    def in_equilibrium(self, stress, x, y):
        """Differences of the exact stresses in single points: no forces, and a mean stress in the plane that is
        harmonic."""
        step = 1e-4 * np.ptp(x)
        right, left, above, below = stress(x + step, y), stress(x - step, y), stress(x, y + step), stress(x, y - step)
        size = np.abs(right).max() / np.ptp(x)
        for i, j in ((0, 3), (3, 1)):
            np.testing.assert_allclose((right[i] - left[i] + above[j] - below[j]) / (2 * step), 0, atol=1e-4 * size)
        around = sum(t[0] + t[1] for t in (right, left, above, below)) - 4 * (stress(x, y)[:2].sum(axis=0))
        np.testing.assert_allclose(around / step**2, 0, atol=1e-2 * size / np.ptp(x))

    def test_study(self):
        """The table of studies/convergence.py: sizes, unknowns, errors and orders."""
        import subprocess
        import sys
        command = [sys.executable, dotyk_case.ROOT / "studies/convergence.py", "press_fit", "--orders", "1",
                   "--factors", "2,1", "--more", "match=1"]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        lines = done.stdout.splitlines()
        self.assertEqual(len(lines), 4)
        heads, _, first, second = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
        self.assertEqual(heads[:4] + heads[-2:], ["elements", "size", "unknowns", "pressure", "energy norm", "seconds"])
        self.assertEqual((first[:2], second[:2]), (["linear", "2 h"], ["linear", "1 h"]))
        self.assertLess(int(first[2]), int(second[2]))
        # The energy norm falls like h.
        value, order = re.fullmatch(r"(\S+) \((\S+)\)", second[-2]).groups()
        self.assertLess(float(value), 0.1)
        self.assertAlmostEqual(float(order), 1, delta=0.25)

    def test_exact_stresses(self):
        """Westergaard's and Lame's fields, and that of the grooves, are in equilibrium and compatible, and have the
        pressures."""
        check = check_of("wavy")
        x, y = (t.ravel() for t in np.meshgrid(np.linspace(0.02, 0.48, 9), [-1.4, -0.5, 0.1, 0.6, 1.4]))
        self.in_equilibrium(check.exact_stress, x, y)
        mean = check.mean_pressure()
        x = np.linspace(0, 0.5, 21)
        sine2 = mean * check.LENGTH / (np.pi * check.YOUNG / (1 - check.POISSON**2) / 2 * check.HEIGHT)
        pressure = 2 * mean / sine2 * np.cos(np.pi * x) * np.sqrt(np.maximum(0, sine2 - np.sin(np.pi * x)**2))
        for side in (-1e-12, 1e-12):
            stress = check.exact_stress(x, np.full_like(x, side))
            # 1e-6: waves that the outer walls throw back
            np.testing.assert_allclose(stress[1], -pressure, atol=1e-6 * mean)
            np.testing.assert_allclose(stress[3], 0, atol=1e-6 * mean)
        for y in (0.01, 1.0):
            middle = (np.arange(400) + 0.5) / 800
            stress = check.exact_stress(middle, np.full_like(middle, y))
            # the sides stay
            self.assertAlmostEqual(np.mean(stress[0] - check.POISSON * (stress[1] + stress[2])) / mean, 0, delta=1e-6)
            np.testing.assert_allclose(check.exact_stress(np.array([0, 0.5]), np.full(2, y))[3], 0, atol=1e-12 * mean)
            np.testing.assert_allclose(check.exact_stress(middle, np.full_like(middle, check.DEPTH))[3], 0,
                                       atol=1e-12 * mean)

        check = check_of("groove_row")
        x, y = (t.ravel() for t in np.meshgrid(np.linspace(0.1, 1.9, 7), [-6, -1, 0.2, 3]))
        self.in_equilibrium(check.exact_stress, x, y)
        x = np.linspace(0, 2, 21)
        for side in (-1e-12, 1e-12):
            stress = check.exact_stress(x, np.full_like(x, side))
            np.testing.assert_allclose(stress[1], -check.pressure(x), atol=1e-5 * check.PRESSURE)  # a kink at b
            np.testing.assert_allclose(stress[3], 0, atol=1e-5 * check.PRESSURE)

        check = check_of("press_fit")
        angle = np.array([0.1, 0.7, 1.4])
        for body, overlap, inside, outside in ((1, 0, check.A, check.B), (2, 0, check.B, check.C),
                                               (1, check.INTERFERENCE, check.A, check.B + check.INTERFERENCE)):
            r = np.linspace(inside, outside, 4)[:, None]
            x, y = (r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()
            self.in_equilibrium(lambda x, y: check.exact_stress(x, y, None, body, overlap), x, y)
            for r in (inside, outside):
                c, s = np.cos(angle), np.sin(angle)
                stress = check.exact_stress(r * c, r * s, None, body, overlap)
                radial = stress[0] * c * c + stress[1] * s * s + 2 * stress[3] * s * c
                pressure = 0 if r in (check.A, check.C) else check.joint(overlap)[body - 1]
                np.testing.assert_allclose(radial, -pressure, atol=1e-9 * check.joint()[0])
        closed = check.radius_displacement(check.B, 2) - check.radius_displacement(check.B, 1)
        self.assertAlmostEqual(closed, check.INTERFERENCE, delta=1e-12)


dotyk_case.main()
