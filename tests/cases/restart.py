"""Warm starts from results files (--restart), and results that are written on the way (&output interval)."""
import os
import shutil
import signal
import subprocess
import time

import h5py
import numpy as np

import dotyk_case

SCHEMES = ("dual", "neumann", "robin")


class Restart(dotyk_case.Case):
    """The column example, its upper block pushed down on one side, so that the joint opens on the other."""

    def setUp(self):
        super().setUp()
        self.copy("column/column.geo")

    def scene(self, solver, *changes, output=""):
        """Write case.nml; changes are (old, new) texts."""
        text = (dotyk_case.INPUTS/"column"/"column.nml").read_text()
        lines = [line for line in text.splitlines() if "'top'" not in line and "&solver" not in line]
        lines += ["&support body='upper', surface='top', fix='z', value_formula='0','0','1e-3*(0.3-x)' /",
                  "&solver %s /" % solver, "&output %s /" % output]
        text = "\n".join(lines) + "\n"
        for old, new in changes:
            self.assertIn(old, text)
            text = text.replace(old, new)
        self.write("case.nml", text)

    def solution(self, name="case.vtkhdf"):
        """Pressures and summary."""
        results = self.results(name)
        return results["dotyk/contact/joint/pressure"][:], dict(results["dotyk/summary"].attrs)

    # Warm starts

    def test_the_solution_of_the_same_case_needs_no_more_than_a_step(self):
        for scheme in SCHEMES:
            self.scene("scheme='%s', theta_relative=1e-2, tolerance=1e-8" % scheme)
            self.dotyk("case.nml")
            cold, summary = self.solution()
            text = self.dotyk("case.nml", "--restart", "case.vtkhdf")
            self.assertIn("warm start       from case.vtkhdf: %d of %d constraints active"
                          % (np.count_nonzero(cold > 0), len(cold)), text)
            warm, again = self.solution()
            self.assertEqual(again["converged"], 1)
            # The two sides of robin start from their mean.
            self.assertLessEqual(again["iterations"], {"dual": 1, "robin": summary["iterations"]//2}.get(scheme, 2),
                                 scheme)
            np.testing.assert_allclose(warm, cold, atol=1e-6*cold.max(), err_msg=scheme)

    def test_schemes_start_from_the_pressures_of_others(self):
        self.scene("scheme='neumann', theta_relative=1e-2, tolerance=1e-3")
        self.dotyk("case.nml", "--output", "rough.vtkhdf")
        for scheme in SCHEMES:
            self.scene("scheme='%s', theta_relative=1e-2, tolerance=1e-8" % scheme)
            self.dotyk("case.nml", "--output", "cold.vtkhdf")
            self.dotyk("case.nml", "--restart", "rough.vtkhdf")
            (cold, before), (warm, after) = self.solution("cold.vtkhdf"), self.solution()
            self.assertEqual(after["converged"], 1)
            self.assertLessEqual(after["iterations"], before["iterations"], scheme)
            np.testing.assert_allclose(warm, cold, atol=1e-6*cold.max(), err_msg=scheme)

    def test_loads_materials_and_theta_may_differ(self):
        self.scene("theta_relative=1e-2, tolerance=1e-9")
        self.dotyk("case.nml", "--output", "first.vtkhdf")
        for change in (("1e-3*(0.3-x)", "1e-3*(0.5-x)"), ("1e-3*(0.3-x)", "1e-3*(0.1-x)"), ("young=30e9", "young=3e9"),
                       ("theta_relative=1e-2", "theta=0"), ("theta_relative=1e-2", "theta_relative=1")):
            self.scene("theta_relative=1e-2, tolerance=1e-9", change)
            self.dotyk("case.nml", "--output", "cold.vtkhdf")
            self.dotyk("case.nml", "--restart", "first.vtkhdf")
            cold, warm = self.solution("cold.vtkhdf")[0], self.solution()[0]
            np.testing.assert_allclose(warm, cold, atol=1e-7*cold.max(), err_msg=str(change))

    def test_budget_and_default_theta(self):
        self.scene("")
        self.dotyk("case.nml", "--output", "cold.vtkhdf")
        self.dotyk("case.nml", "--restart", "cold.vtkhdf")
        (cold, _), (warm, summary) = self.solution("cold.vtkhdf"), self.solution()
        self.assertEqual(summary["converged"], 1)
        np.testing.assert_allclose(warm, cold, atol=1e-3*cold.max())

    def test_floating_bodies(self):
        self.copy("free_stack/free_stack.geo")
        text = (dotyk_case.INPUTS/"free_stack"/"free_stack.nml").read_text()
        self.write("stack.nml", text)
        self.dotyk("stack.nml")
        self.dotyk("stack.nml", "--restart", "stack.vtkhdf", "--output", "again.vtkhdf")
        first, again = self.results("stack.vtkhdf"), self.results("again.vtkhdf")
        self.assertLess(again["dotyk/summary"].attrs["iterations"], first["dotyk/summary"].attrs["iterations"])
        for name in first["dotyk/contact"]:
            a, b = (file["dotyk/contact"][name]["pressure"][:] for file in (first, again))
            np.testing.assert_allclose(b, a, atol=1e-8*a.max())
        # Loads that no contact can carry are found all the same.
        self.write("pulled.nml", text.replace("pressure=50e6", "pressure=-50e6"))
        self.assertIn("body 'plate 8'", self.dotyk("pulled.nml", "--restart", "stack.vtkhdf", code=3))

    def test_pressures_that_vanish_start_from_the_scene_without_contact(self):
        self.scene("theta_relative=1e-2", ("1e-3*(0.3-x)", "1e-3"))
        self.dotyk("case.nml", "--output", "open.vtkhdf")
        self.assertEqual(self.solution("open.vtkhdf")[0].max(), 0)
        self.scene("theta_relative=1e-2")
        self.dotyk("case.nml", "--output", "cold.vtkhdf")
        self.dotyk("case.nml", "--restart", "open.vtkhdf")
        np.testing.assert_array_equal(self.solution()[0], self.solution("cold.vtkhdf")[0])

    # Files that are refused

    def test_other_contact_rows_are_refused(self):
        self.scene("theta_relative=1e-2")
        self.dotyk("case.nml", "--output", "first.vtkhdf")
        n = len(self.solution("first.vtkhdf")[0])
        rows = "'first.vtkhdf' has other contact rows: pair 'joint' has %d rows in the file and " % n
        geo = (self.folder/"column.geo").read_text()
        self.write("column.geo", geo + "\nMesh.MeshSizeFactor = 0.7;\n")
        self.assertIn(rows, self.dotyk("case.nml", "--restart", "first.vtkhdf", code=2))
        self.write("column.geo", geo)
        self.scene("theta_relative=1e-2", ("&contact ", "&contact discretization='quadrature', "))
        self.assertIn(rows, self.dotyk("case.nml", "--restart", "first.vtkhdf", "--check", code=2))
        self.scene("theta_relative=1e-2", ("name='joint'", "name='other'"))
        self.assertIn("pair 'other' is missing", self.dotyk("case.nml", "--restart", "first.vtkhdf", code=2))
        self.scene("theta_relative=1e-2", ("name='upper',", "name='upper', at=1e-4,0,0,"))
        self.assertIn("row 1 of pair 'joint' is displaced by 0.0001",
                      self.dotyk("case.nml", "--restart", "first.vtkhdf", code=2))
        self.scene("theta_relative=1e-2", ("name='upper',", "name='upper', at=1e-8,0,0,"))
        self.dotyk("case.nml", "--restart", "first.vtkhdf")

    def test_files_that_are_no_results(self):
        self.scene("theta_relative=1e-2")
        self.dotyk("case.nml")

        def refused(name, message):
            text = self.dotyk("case.nml", "--restart", name, code=2)
            self.assertIn("--restart: '%s'" % name, text)
            self.assertIn(message, text)

        def damage(change):
            shutil.copy(self.folder/"case.vtkhdf", self.folder/"bad.vtkhdf")
            with h5py.File(self.folder/"bad.vtkhdf", "a") as file:
                change(file["dotyk/contact"])

        refused("none.vtkhdf", "does not exist")
        refused(".", "is a directory")
        refused("case.nml", "cannot be read")
        whole = (self.folder/"case.vtkhdf").read_bytes()
        for n in (0, 8, 1000, len(whole)//2):
            (self.folder/"bad.vtkhdf").write_bytes(whole[:n])
            refused("bad.vtkhdf", "cannot be read")
        with h5py.File(self.folder/"bad.vtkhdf", "w") as file:
            file["x"] = 1
        refused("bad.vtkhdf", "is not a results file of dotyk")
        damage(lambda contact: contact.create_group("more"))
        refused("bad.vtkhdf", "has 2 contact pairs, and the case has 1")
        damage(lambda contact: contact["joint"].pop("position"))
        refused("bad.vtkhdf", "position does not hold")
        damage(lambda contact: contact["joint"].pop("pressure"))
        refused("bad.vtkhdf", "pair 'joint' has 0 rows in the file")
        for value in (np.nan, np.inf, 1e300):
            damage(lambda contact, v=value:
                   contact["joint/pressure"].write_direct(np.full(len(contact["joint/pressure"]), v)))
            refused("bad.vtkhdf", "the pressures of pair 'joint' are those of a diverged run")
        self.assertEqual((self.folder/"case.vtkhdf").read_bytes(), whole)
        self.assertIn("option --restart needs a value", self.dotyk("case.nml", "--restart", code=2))

    # Results on the way

    def test_schemes_continue_as_if_nothing_had_been_written(self):
        solver = "scheme='%s', theta_relative=1e-4, tolerance=1e-9, max_iterations=%d"
        # An interval of a few hundred steps, and one shorter than a step: each iterate is written.
        for scheme, limit, interval in [("neumann", 1000000, 0.05)] + [(scheme, 30, 1e-9) for scheme in SCHEMES[1:]]:
            code = int(limit == 30)
            self.scene(solver % (scheme, limit))
            self.dotyk("case.nml", "--output", "plain.vtkhdf", code=code)
            self.scene(solver % (scheme, limit), output="interval=%g" % interval)
            text = self.dotyk("case.nml", code=code)
            self.assertIn("written          case.vtkhdf after ", text)
            (plain, before), (written, after) = self.solution("plain.vtkhdf"), self.solution()
            for name in ("status", "iterations", "q_measured", "energy"):
                self.assertEqual(after[name], before[name], "%s: %s" % (scheme, name))
            self.assertEqual(after["iterations"], len(self.results("case.vtkhdf")["dotyk/history/energy"]))
            np.testing.assert_array_equal(written, plain, err_msg=scheme)

    def test_a_run_that_is_killed_leaves_the_results_of_its_last_interval(self):
        self.scene("scheme='neumann', theta_relative=1e-9, tolerance=1e-12, max_iterations=100000000",
                   output="interval=0.1")
        for number, status in ((signal.SIGKILL, b"running"), (signal.SIGTERM, b"interrupted")):
            process = subprocess.Popen([os.environ["DOTYK"], "case.nml"], cwd=self.folder, stdout=subprocess.PIPE,
                                       text=True)
            self.addCleanup(process.stdout.close)
            while "written" not in process.stdout.readline():
                self.assertIsNone(process.poll())
            time.sleep(0.05)
            process.send_signal(number)
            process.communicate(timeout=60)
            pressure, summary = self.solution()
            self.assertEqual(summary["status"], status)
            self.assertEqual(summary["converged"], 0)
            self.assertGreater(summary["iterations"], 0)
            self.assertGreater(summary["error_bound"], 1e-12)
            self.results("case.vtkhdf").close()
        # The file is the start of a run that overwrites it.
        self.scene("theta_relative=1e-2, tolerance=1e-9")
        self.dotyk("case.nml", "--restart", "case.vtkhdf")
        self.dotyk("case.nml", "--output", "cold.vtkhdf")
        np.testing.assert_allclose(self.solution()[0], self.solution("cold.vtkhdf")[0], atol=1e-6*pressure.max())


if __name__ == "__main__":
    dotyk_case.main()
