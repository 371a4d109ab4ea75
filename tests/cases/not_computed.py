#!/usr/bin/python3
"""Nothing is computed that the input does not ask for: log and results file agree, and all other results stay the
same."""
import re

import numpy as np

import dotyk_case


class NotComputed(dotyk_case.Case):
    def run_scene(self, name, replace=(), code=0):
        """Run an example with some of its lines replaced; log and results."""
        if not (self.folder / name).exists():
            self.copy(name)
        text = (dotyk_case.INPUTS / name / (name + ".nml")).read_text()
        for pattern, by in replace:
            text, n = re.subn(r"(?m)^" + pattern, by, text)
            self.assertGreater(n, 0)
        self.write(name + "/case.nml", text)
        printed = self.dotyk(name + "/case.nml", "--output", "case.vtkhdf", code=code)
        file = self.results("case.vtkhdf")
        return printed, file, file["dotyk/summary"].attrs

    def test_no_contact(self):
        """No contact pairs: one solve of the body with loads or prescribed displacements, no solve of the other
        body, and the one moves into the other."""
        printed, file, summary = self.run_scene("wavy", [("&contact.*$", ""), ("&solver.*$", "")], code=1)
        self.assertIn("no contact pairs: one linear solve per body", printed)
        self.assertEqual(summary["constraints"], 0)
        self.assertEqual(summary["body_solves"], 0)
        self.assertEqual(summary["full_solves"], 1)
        self.assertGreater(np.abs(file["VTKHDF/PointData/displacement"]).max(), 0)
        self.assertAlmostEqual(summary["penetration_depth"], 0.0062, delta=1e-9)

    def test_solves_of_a_contact_scene(self):
        """One solve of the loaded body, and one solve of each body that recovers the displacements."""
        _, _, summary = self.run_scene("wavy", [("&solver.*$", "&solver theta_relative=1e-2, tolerance=1e-8 /")])
        self.assertEqual(summary["full_solves"], 3)

    def test_only_what_was_asked_for(self):
        """Contact fields only: no displacements (and no solve for them), no stresses, no estimates; the same
        pressures."""
        solver = ("&solver.*$", "&solver theta_relative=1e-2, tolerance=1e-8 /")
        printed, file, summary = self.run_scene("wavy", [solver])
        self.assertNotIn("discretization error", printed)
        self.assertNotIn("stresses", printed)
        self.assertBetween(0, summary["error_discretization"], np.inf)
        pressure = file["dotyk/contact/wave/pressure"][:]
        output = ("&solver.*$", solver[1] + "\n&output fields='contact', error_parts='' /")
        printed, file, summary = self.run_scene("wavy", [output])
        for part in ("displacements", "stresses", "discretization error", "penalty error"):
            self.assertRegex(printed, r"\n  not computed +.*" + part)
        self.assertEqual(summary["full_solves"], 1)
        self.assertUnknown(summary["error_discretization"])
        self.assertUnknown(summary["error_penalty"])
        self.assertNotIn("displacement", file["VTKHDF/PointData"])
        self.assertNotIn("stress", file["VTKHDF/CellData"])
        np.testing.assert_allclose(file["dotyk/contact/wave/pressure"][:], pressure, rtol=0,
                                   atol=1e-12 * pressure.max())

    def test_screened_constraints(self):
        """Constraints at the open end of a groove stay out of the linear systems; the solution equals that with all
        constraints."""
        solver = ("&solver.*$", "&solver theta_relative=1e-2, tolerance=1e-10, linear_solver='%s' /")
        few, many = ([(solver[0], solver[1] % kind)] for kind in ("direct", "iterative"))
        printed, file, summary = self.run_scene("groove_row", few)
        screened = summary["constraints_screened"]
        self.assertGreater(screened, 0)
        self.assertIn("%d inactive constraints (screened out)" % screened, printed)
        pair = next(iter(file["dotyk/contact"].values()))
        pressure, gap = pair["pressure"][:], pair["gap"][:]
        self.assertLessEqual(np.count_nonzero(pressure), len(pressure) - screened)
        _, file, summary = self.run_scene("groove_row", many)
        self.assertEqual(summary["constraints_screened"], 0)
        pair = next(iter(file["dotyk/contact"].values()))
        np.testing.assert_allclose(pressure, pair["pressure"][:], rtol=0, atol=1e-8 * pressure.max())
        np.testing.assert_allclose(gap, pair["gap"][:], rtol=0, atol=1e-8 * np.abs(gap).max())


dotyk_case.main()
