#!/usr/bin/python3
"""inputs/multilayer: a plane package of layers by the Neumann and the dual scheme; studies/gamma_sweep.py --quick."""
import copy
import importlib.util
import os
import pathlib
import re
import sys
import tempfile

import numpy as np

import dotyk_case

sys.path.insert(0, str(dotyk_case.ROOT / "studies"))
import gamma_sweep  # noqa: E402
import gamma_sweep_figures  # noqa: E402
import theory  # noqa: E402


def groups(text):
    """The namelist groups of a file, without comments and line breaks."""
    return re.sub(r"\s+", " ", re.sub(r"(?m)^!.*$", "", text)).strip()


class Example(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.copy("multilayer")
        self.text = (self.folder / "multilayer/multilayer.nml").read_text()
        spec = importlib.util.spec_from_file_location("check", dotyk_case.INPUTS / "multilayer/check.py")
        self.check = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.check)

    def test_scene_is_the_generated_one(self):
        self.assertEqual(groups(self.text), groups(gamma_sweep.scene(8)))

    def test_statics(self):
        """Every layer in equilibrium, for an early iterate too: its displacements belong to its pressures."""
        self.dotyk("multilayer/multilayer.nml")
        e, joints = self.check.errors(self.folder / "multilayer/multilayer.vtkhdf")
        for name, error in e.items():
            self.assertLessEqual(error, self.check.LIMITS[name], name)
        # the load spreads, and decays downwards: zones come apart in the lower joints, none joins others
        zones = [len(joint["zones"]) for joint in joints]
        self.assertEqual(zones, sorted(zones, reverse=True))
        self.assertGreater(zones[0], zones[-1])
        self.assertIncreasing([joint["force"] for joint in joints])
        self.assertIncreasing([joint["closed"] for joint in joints])
        early = self.text.replace("theta_relative=0.1", "theta_relative=0.1, max_iterations=7")
        self.write("multilayer/early.nml", early)
        self.dotyk("multilayer/early.nml", code=1)
        e = self.check.errors(self.folder / "multilayer/early.vtkhdf")[0]
        self.assertLess(e["layers"], self.check.BALANCE)
        self.assertGreater(e["pressure against penetration"], self.check.PENALTY)

    def test_rules_for_gamma(self):
        """The solution and contact zones of the dual scheme within the bounds; at most as many iterations as the factors
        say."""
        package = gamma_sweep.Package(os.environ["DOTYK"], self.folder, "multilayer/multilayer.geo", 8)
        dual, lambda_max, start = gamma_sweep.reference(package, 1)
        active = dual.active()
        for rule, factor in (("spectral", theory.factor), ("theory", theory.factor_of_paper)):
            run = package.run(scheme="neumann", theta_relative=1, gamma_rule=rule)
            error = gamma_sweep.distance(run, dual) / dual.summary["energy_norm"]
            self.assertLessEqual(error, run.summary["error_bound"] * (1 + 1e-6), rule)
            self.assertLessEqual(run.summary["error_bound"], gamma_sweep.TOLERANCE * (1 + 1e-3), rule)
            np.testing.assert_array_equal(run.active(), active, err_msg=rule)
            # the log counts the same rows, not those whose pressures have not yet decayed
            shown = [int(n) for n in re.findall(r"joint \d: (\d+) of 41 constraints active", run.text)]
            self.assertEqual(shown, [np.sum(joint["gap"] < 0) for joint in dual.joints], rule)
            self.assertGreater(np.sum(run.pressure > 0), active.sum())
            # the zones are found before the pressures
            found = run.history["active"]
            self.assertEqual(set(found[len(found) // 2:]), {active.sum()}, rule)
            gamma = run.summary["gamma"]
            self.assertLessEqual(run.iterations, gamma_sweep.most_steps(factor(gamma, lambda_max), lambda_max, start))
            self.assertLessEqual(run.summary["q_measured"], theory.factor(gamma, lambda_max) * (1 + 1e-6), rule)


class Sweep(dotyk_case.Case):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory(prefix="dotyk-") as folder:
            cls.measured = gamma_sweep.measure(os.path.abspath(os.environ["DOTYK"]), folder, quick=True)

    def wrong(self, measured):
        return theory.contradictions(gamma_sweep.figures(measured))

    def test_nothing_contradicts_the_theory(self):
        self.assertEqual(self.wrong(self.measured), [])

    def test_best_gamma(self):
        """Near 2/(2+L); with all rows closed 2/(1+L) is sharp."""
        for one in self.measured["sweeps"]:
            good = [row for row in one["rows"] if row["converged"]]
            best = min(good, key=lambda row: row["iterations"])
            self.assertBetween(0.9, best["gamma"] / one["best"], 1.3, gamma_sweep.title_of(one))
            theorem = gamma_sweep.row_at(one, one["best_of_paper"])
            self.assertGreater(theorem["iterations"], 10 * best["iterations"])
            if one["variant"] == "all closed":
                self.assertBetween(0.98, max(row["gamma"] for row in good) / one["limit"], 1)

    def test_contradictions_are_seen(self):
        def spoiled(change):
            measured = copy.deepcopy(self.measured)
            change(measured["sweeps"])
            return "\n".join(self.wrong(measured))

        def slow(sweeps):
            sweeps[0]["rows"][0]["iterations"] *= 3

        def far(sweeps):
            sweeps[1]["rows"][0]["error"] = 2e-6

        def lasting(sweeps):
            sweeps[2]["rows"][-1]["diverged"] = False

        def large(sweeps):
            sweeps[1]["L"] *= 1.2

        for change, name in ((slow, "the most by q"), (far, "error over error_bound"), (lasting, "not diverged beyond"),
                             (large, "L over that of two layers")):
            self.assertIn(name, spoiled(change))

    def test_table_and_figures(self):
        lines = gamma_sweep.table(self.measured).splitlines()
        self.assertEqual(len(lines), 2 + len(self.measured["sweeps"]))
        self.assertEqual({line.count("|") for line in lines}, {lines[0].count("|")})
        for draw in (gamma_sweep_figures.draw_sweeps, gamma_sweep_figures.draw_zones):
            picture = pathlib.Path(self.folder) / "picture.png"
            draw(self.measured, picture)
            self.assertEqual(picture.read_bytes()[:4], b"\x89PNG")
            self.assertLess(picture.stat().st_size, 120000)


dotyk_case.main()
