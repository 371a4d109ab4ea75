#!/usr/bin/python3
"""The general iteration (32) with Robin conditions on three bodies, a soft one between stiff ones: on all constraints, on those
with a small gap, on one pair, on none."""
import sys

import numpy as np

import dotyk_case
from blocks import block_geo

sys.path.insert(0, str(dotyk_case.ROOT / "tools"))
import energy_norm  # noqa: E402

SCENE = """
&scene analysis='plane_strain' /
&material name='soft', young=1e9, poisson=0.3 /
&material name='stiff', young=2e11, poisson=0.25 /
&body name='lower', mesh='lower.geo', volume='block', material='stiff' /
&body name='middle', mesh='middle.geo', volume='block', material='soft' /
&body name='upper', mesh='upper.geo', volume='block', material='stiff' /
&support body='lower', surface='bottom', fix='xy' /
&support body='middle', surface='sides x', fix='x' /
&support body='middle', surface='sides x', fix='y' /
&support body='upper', surface='sides x', fix='xy' /
&load body='upper', surface='top', pressure_formula='1e6*(2+x)' /
&load body='middle', force_density=0,-2e6 /
&contact name='low', surface_a='middle:bottom', surface_b='lower:top'%s /
&contact name='high', surface_a='middle:top', surface_b='upper:bottom', gap_formula='2e-6*x^2'%s /
&solver %s /
&output error_parts='' /
"""
ROBIN = "scheme='robin', theta_relative=1e-1, tolerance=1e-8"
# The keys of the two pairs and of the solver.
CHOICES = {"all": ("", "", ROBIN), "near": ("", "", ROBIN + ", robin_gap=1e-6"),
           "one pair": ("", ", condition='neumann'", ROBIN), "near in one": ("", ", robin_gap=5e-7", ROBIN),
           "none": (", condition='neumann'", ", condition='neumann'", ROBIN)}


class Robin(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        for name, y, n in (("lower", 0.0, 5), ("middle", 0.5, 6), ("upper", 1.0, 7)):
            self.write(name + ".geo", block_geo("quad4", n, (0.0, y), (1.0, 0.5)))

    def solve(self, keys, code=0):
        self.write("case.nml", SCENE.lstrip() % keys)
        text = self.dotyk("case.nml", code=code)
        return (self.results("case.vtkhdf"), text) if code < 2 else (None, text)

    def test_every_choice_finds_the_same(self):
        exact, _ = self.solve(("", "", "scheme='dual', theta_relative=1e-1, tolerance=1e-12"))
        u = exact["VTKHDF/PointData/displacement"][:]
        norm = exact["dotyk/summary"].attrs["energy_norm"]
        energy = exact["dotyk/summary"].attrs["energy"]
        neumann, _ = self.solve(("", "", ROBIN.replace("robin", "neumann")))
        plain = dict(neumann["dotyk/summary"].attrs)
        found = {}
        for name, keys in CHOICES.items():
            file, text = self.solve(keys)
            summary = found[name] = dict(file["dotyk/summary"].attrs)
            self.assertEqual(summary["converged"], 1, name)
            np.testing.assert_allclose(file["VTKHDF/PointData/displacement"][:], u, rtol=0, atol=1e-6*np.abs(u).max())
            # The minimum is flat: twice the difference of the energies is at most the square of the error.
            self.assertLessEqual(2*abs(summary["energy"] - energy), (2*summary["error_bound"]*norm)**2 + 1e-12*norm**2)
            self.assertLessEqual(summary["q_measured"], summary["q_predicted"]*(1 + 1e-6))
            self.assertLess(summary["gamma"], summary["gamma_limit"])
            self.assertGreater(summary["gamma_limit"], summary["gamma_2"])
            self.assertIn("Robin conditions on", text)
        self.assertAlmostEqual(found["none"]["iterations"]/plain["iterations"], 1, delta=0.1)
        self.assertAlmostEqual(found["none"]["penalty_constant"]/plain["penalty_constant"], 1, delta=0.04)
        # j'' <= 2 X where all have springs.
        self.assertLess(found["all"]["penalty_constant"], 2.05)

    def test_theorem_4_and_its_bound(self):
        self.solve(("", "", "scheme='dual', theta_relative=20, tolerance=1e-12"))
        exact = energy_norm.Results(self.folder / "case.vtkhdf")
        for name, keys in CHOICES.items():
            keys = (*keys[:2], keys[2].replace("1e-8", "0.05").replace("=1e-1", "=20") +
                    ", gamma_rule='theory', stop_rule='paper'")
            file, text = self.solve(keys)
            summary, history = dict(file["dotyk/summary"].attrs), file["dotyk/history"]
            self.assertIn("'paper' is met", text)
            self.assertAlmostEqual(summary["gamma"]/summary["gamma_2"], 0.5, delta=1e-12)
            self.assertAlmostEqual(summary["q_paper"], summary["q_theory"], delta=1e-12)
            self.assertLess(summary["q_predicted"], summary["q_paper"])
            # B, D and gamma_2 = 2 B/(1+D)^2 with the other constants 1.
            self.assertAlmostEqual(summary["gamma_2"]*(1 + summary["penalty_constant"])**2/(2*summary["coercivity"]), 1,
                                   delta=1e-12)
            bound = history["error_bound_paper"][:]
            self.assertTrue(np.isfinite(bound).all())
            self.assertLessEqual(bound[-1], 0.05)
            self.assertTrue((bound[:-1] > 0.05).all())
            error = energy_norm.distance(energy_norm.Results(self.folder / "case.vtkhdf"), exact)/summary["energy_norm"]
            self.assertBetween(1e-6, error, min(bound[-1], summary["error_bound"]), name)

    def test_slow_is_not_diverged(self):
        """A small theta: far from the end after many steps, with a bound that says how far."""
        file, _ = self.solve(("", "", "scheme='robin', theta_relative=1e-7, tolerance=1e-8, max_iterations=15000"), code=1)
        summary = file["dotyk/summary"].attrs
        self.assertEqual(summary["status"].decode(), "max_iterations")
        self.assertLess(summary["error_bound"], 2)

    def test_divergence_is_told_by_its_own_limit(self):
        _, text = self.solve(("", "", ROBIN + ", gamma=3"), code=1)
        self.assertRegex(text, r"\n  diverged +gamma = 3 exceeds the stability limit 1\.\d+")

    def test_keys_are_refused(self):
        for keys, line, words in (
                ((", condition='neumann', robin_gap=1", "", ROBIN), 13, "robin_gap is given, but condition is 'neumann'"),
                (("", ", condition='robin'", "theta_relative=1"), 14, "condition is for scheme='robin'"),
                (("", ", robin_gap=1", "scheme='neumann'"), 14, "robin_gap is for scheme='robin'"),
                (("", "", "scheme='dual', robin_gap=1"), 15, "robin_gap is for scheme='robin'"),
                (("", "", ROBIN + ", stop_rule='paper', gamma=0.5"), 15, "gamma_2")):
            _, text = self.solve(keys, code=2)
            self.assertIn("case.nml:%d:" % line, text)
            self.assertIn(words, text)


if __name__ == "__main__":
    dotyk_case.main()
