"""What the tests through the executable share: `Case`, a unittest.TestCase with a folder of its own, and `main`.

ctest names the executable in the environment variable DOTYK.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
INPUTS = ROOT / "inputs"
PACKAGE = str(ROOT / "tools" / "python")
sys.path.insert(0, PACKAGE)
# For the commands of the package that tests start.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (PACKAGE, os.environ.get("PYTHONPATH"))))


class Case(unittest.TestCase):
    """A test with a temporary folder `self.folder`, which is removed at the end."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="dotyk-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, name, text):
        """Write a file into the folder."""
        path = self.folder / name
        path.write_text(text)
        return path

    def copy(self, path):
        """Copy an example, such as 'hertz', or a file into the folder."""
        source = INPUTS / path
        target = self.folder / source.name
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copy(source, target)
        return target

    def dotyk(self, *arguments, code=0, timeout=600, **environment):
        """Run the executable in the folder; its exit code must be `code` (None: any). Returns what it printed, as one
        text, with its details. With exit code 0, no contact row of the results may be violated."""
        if arguments and str(arguments[0]).endswith(".nml"):
            arguments = (arguments[0], "--verbose", *arguments[1:])
        began = time.time() - 1
        done = subprocess.run([os.environ["DOTYK"], *map(str, arguments)], cwd=self.folder, timeout=timeout, text=True,
                              env={**os.environ, **environment}, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if code is not None:
            self.assertEqual(done.returncode, code, "dotyk %s:\n%s" % (" ".join(map(str, arguments)), done.stdout))
        if done.returncode == 0:
            for path in self.folder.rglob("*.vtkhdf"):
                if path.is_file() and path.stat().st_mtime > began:
                    self.assertEqual(violated_rows(path), [], done.stdout)
        return done.stdout

    def assertBetween(self, low, value, high, message=None):
        """low < value < high."""
        self.assertLess(low, value, message)
        self.assertLess(value, high, message)

    def assertUnknown(self, values, message=None):
        """A value that is not known, or all values of an array: NaN."""
        import numpy as np
        np.testing.assert_array_equal(values, np.full(np.shape(values), np.nan), err_msg=str(message or ""))

    def assertIncreasing(self, values, least=0.0, message=None):
        """Each value is above the one before it, or above it by more than `least`, which may be negative."""
        steps = [float(after - before) for before, after in zip(values, values[1:])]
        self.assertGreater(min(steps), least, "%s: %s" % (message or "not increasing", list(values)))

    def results(self, name):
        """A results file of the folder, opened with h5py."""
        import h5py
        file = h5py.File(self.folder / name, "r")
        self.addCleanup(file.close)
        return file


def violated_rows(path):
    """Contact rows, active or not, of all pairs and load cases of a results file that penetrate by more than theta times
    their pressure, to rounding of coordinates and displacements and what the error bound allows; and where `max_penetration` is not
    the greatest of them. Rows of one vertex on both sides of a tie are one (docs/ties.md): their mean counts."""
    import h5py
    import numpy as np
    found = []
    with h5py.File(path) as file:
        own = file["dotyk"]
        u = file["VTKHDF/PointData/displacement"][:] if "displacement" in file["VTKHDF/PointData"] else np.zeros((1, 3))
        size = np.ptp(file["VTKHDF/Points"][:], axis=0).max()
        rounding = 1e-14 * np.abs(file["VTKHDF/Points"][:]).max()
        for name, group in own["cases"].items() if "cases" in own else [("", own)]:
            summary = group["summary"].attrs
            rows = [(pair, *(data[key][:] for key in ("gap", "theta", "pressure", "weight", "gap_initial", "position")))
                    for pair, data in group["contact"].items() if len(data["gap"])]
            if not rows:
                continue
            pair = np.concatenate([[row[0]] * len(row[1]) for row in rows])
            gap, theta, pressure, weight, before, place = (np.concatenate([row[k] for row in rows]) for k in range(1, 7))
            over = -gap - theta * pressure
            if "ties" in group:
                _, vertex = np.unique(np.round(place / size, 9), axis=0, return_inverse=True)
                over = (np.bincount(vertex, weight * over) / np.bincount(vertex, weight))[vertex]
            scale = max(np.abs(u).max(), np.abs(gap - before).max(), -before.min())
            # An error e in the energy norm moves a row by e times the root of its compliance: of the mesh, by which
            # a small row yields up to 30 times as far as the body does by as much energy, and of the layer, theta/weight.
            # A step of neumann and robin changes pressures by gamma times what rows are violated.
            error = summary["error_bound"] * summary["energy_norm"] * np.sqrt(2 * theta / weight)
            step = summary["gamma"] if np.isfinite(summary["gamma"]) else 1
            allowed = rounding + (1e-9 + 30 * summary["error_bound"] / step) * scale + np.nan_to_num(error)
            worst = np.argmax(over - allowed)
            if over[worst] > allowed[worst]:
                found.append("%s %s at %s penetrates by %.3e, theta*pressure is %.3e, allowed beside it %.3e" % (
                    name, pair[worst], place[worst], -gap[worst], theta[worst] * pressure[worst], allowed[worst]))
            if abs(max(0.0, -gap.min()) - summary["max_penetration"]) > rounding + 1e-9 * scale:
                found.append("%s max_penetration is %.3e, that of the rows %.3e" % (
                    name, summary["max_penetration"], max(0.0, -gap.min())))
    return found


def main():
    """Run the tests of the calling script; that there is none is a failure."""
    result = unittest.main(exit=False).result
    sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
