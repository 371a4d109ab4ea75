#!/usr/bin/python3
"""studies/work_precision.py on a small grid: table, figures, omissions with their reasons, what is done before is not
run again."""
import csv
import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np

import dotyk_case

TOOL = dotyk_case.ROOT / "studies/work_precision.py"
GRID = """! two sizes and orders; no scheme but dual does without a penalty, and five steps are too few for neumann
&grid scene='wavy/wavy.nml', check='plain.py', title='small wave', size=0.125,0.0625, order=1,2, threads=1
  theta_relative=0, scheme='dual', repeat=2, error='a_error','energy', reference_size=0.03125, reference_order=2 /
&grid size=0.125, order=2, theta_relative=0,1e-2, scheme='neumann' /
"""


class WorkPrecision(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.copy("wavy")
        # errors without exact stresses: 'energy' is measured against a finer run
        self.write("plain.py", "import sys\nsys.path.insert(0, %r)\nfrom check import errors\n"
                   % str(self.folder / "wavy"))

    def run_grid(self, text, code=0):
        """Write the grid, run it; what was printed."""
        self.write("grid.nml", text)
        done = subprocess.run([sys.executable, "-B", TOOL, "grid.nml"], cwd=self.folder, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              stdin=subprocess.DEVNULL)
        self.assertEqual(done.returncode, code, done.stdout)
        return done.stdout

    def test_small_grid(self):
        text = GRID.replace("repeat=2", "repeat=2, max_iterations=5")
        printed = self.run_grid(text)
        self.assertIn("6 points, 0 done before", printed)
        self.assertRegex(printed, r"\[6/6\] .*, about \d+ s left")
        folder = self.folder / "grid"
        with open(folder / "table.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), 6)
        good = [row for row in rows if row["converged"] == "1"]
        self.assertEqual([(row["size"], row["order"], row["scheme"]) for row in good],
                         [("0.125", "1", "dual"), ("0.125", "2", "dual"), ("0.0625", "1", "dual"),
                          ("0.0625", "2", "dual")])
        for row in good:
            seconds = [float(row[key]) for key in ("seconds_min", "seconds", "seconds_max")]
            self.assertGreater(seconds[0], 0)
            self.assertEqual(seconds, sorted(seconds))
            self.assertEqual(row["repeats"], "2")
        # Halved elements of order 1 and 2: errors of 0.5 and 0.25 of the coarser ones, at least of 0.7 and 0.5.
        energy = [float(row["energy"]) for row in good]
        self.assertLess(energy[2], 0.7 * energy[0])
        self.assertLess(energy[3], 0.5 * energy[1])
        self.assertLess(energy[1], energy[0])
        with h5py.File(folder / "table.h5") as file:
            self.assertEqual(file.attrs["grid_text"], text)
            for name in ("cpu", "cores", "memory_gib", "dotyk", "git_commit", "git_dirty", "date", "reference"):
                self.assertIn(name, file.attrs)
            self.assertEqual(set(file["table"]), set(rows[0]))
            np.testing.assert_array_equal(file["table/seconds"][:], [float(row["seconds"] or "nan") for row in rows])
        report = (folder / "report.md").read_text()
        omissions = report[report.index("## Omissions"):]
        self.assertRegex(omissions, r"theta relative 0, scheme neumann \| 2 \| .*theta = 0")
        self.assertRegex(omissions, r"theta relative 0.01, scheme neumann \| 1 \| not converged: error bound .* after "
                         r"5 iter")
        self.assertEqual(omissions.count("scheme neumann |"), 2)
        for name in ("time.png", "solves.png", "parts.png"):
            self.assertIn("(%s)" % name, report)
            self.assertEqual((folder / name).read_bytes()[:4], b"\x89PNG")
        # Nothing is run again; another repeat is another point.
        before = (folder / "table.csv").read_text()
        self.assertIn("6 points, 6 done before", self.run_grid(text))
        self.assertEqual((folder / "table.csv").read_text(), before)

    def test_exact_stress(self):
        """The error in the energy norm against exact stresses; a parameter that is a DefineConstant; a count of
        elements."""
        geometry = self.folder / "wavy/wavy.geo"
        text = geometry.read_text()
        self.assertIn("h = l/80;", text)
        geometry.write_text(text.replace("h = l/80;", "DefineConstant[n = 80];\nh = l/n;"))
        self.run_grid("&grid scene='wavy/wavy.nml', check='wavy/check.py', geometry_parameter='n', size=10,20, "
                      "repeat=1, error='energy' /")
        with h5py.File(self.folder / "grid/table.h5") as file:
            self.assertEqual(file["table/size"][:].tolist(), [10, 20])
            coarse, fine = file["table/energy"][:]
            self.assertNotIn("reference", file.attrs)
        self.assertLess(fine, 0.7 * coarse)
        self.assertLess(coarse, 0.1)

    def test_out_of_time(self):
        """A run that takes too long is stopped, and finer ones are not tried."""
        self.run_grid("&grid scene='wavy/wavy.nml', check='wavy/check.py', size=0.125,0.0625, repeat=1, "
                      "limit_seconds=1e-3, error='a_error' /")
        report = (self.folder / "grid/report.md").read_text()
        self.assertIn("| size 0.125 | - | stopped after limit_seconds=0.001 |", report)
        self.assertIn("| size 0.0625 | - | not tried: out of time on a coarser mesh |", report)

    def test_interrupted(self):
        """An interrupted run goes on where it stopped."""
        text = ("&grid scene='wavy/wavy.nml', check='plain.py', size=0.125, order=1,2, repeat=2, error='a_error', "
                "threads=1,2 /")
        self.write("grid.nml", text)
        process = subprocess.Popen([sys.executable, "-B", TOOL, "grid.nml"], cwd=self.folder, text=True,
                                   stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        until = time.monotonic() + 60
        points = self.folder / "grid/points"
        while not list(points.glob("*.json")) and time.monotonic() < until and process.poll() is None:
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGINT)
        self.assertIn("interrupted", process.communicate()[0])
        self.assertNotEqual(process.returncode, 0)
        done = len(list((self.folder / "grid").glob("points/*.json")))
        self.assertGreaterEqual(done, 1)
        self.assertIn("4 points, %d done before" % done, self.run_grid(text))

    def test_mistakes(self):
        for text, message in (("&grid\n  scen='x' /", "grid.nml:2: &grid: unknown key 'scen' (did you mean 'scene'?)"),
                              ("&grid\n  scene='wavy/wavy.nml', error='a_error', order=1.5 /",
                               "grid.nml:2: &grid: order: 1.5 is not an integer"),
                              ("&grd /", "grid.nml:1: &grd: the only group is &grid"),
                              ("&grid scene='wavy/wavy.nml',\n error='energy', check='plain.py' /",
                               "reference_size is not given"),
                              ("&grid scene='wavy/wavy.nml', error='a_error', check='plain.py', size=1, "
                               "geometry_parameter='k' /",
                               "no line 'k = ...;' in wavy.geo")):
            with self.subTest(message):
                self.assertIn(message, self.run_grid(text, code=2))


dotyk_case.main()
